//! Curves: times and quality, one line each. Ids are `curve/<what>/<input>`; give a part of an id to run only that.

#[path = "../tests/common/mod.rs"]
mod common;

use planish::curve::{
    Canvas, Magnet, PaintMode, PaintParams, ScalarField, Section, Snake, SnakeParams, SurfaceCurve, Sweep, way,
};
use planish::geom::random;
use planish::mesh::{self, Adjacency, FacePoint, TriMesh, shapes};
use planish::{DVec3, Silent};
use std::io::Write;
use std::time::Instant;

/// Pairs of picks per input and mode.
const PAIRS: usize = 60;
/// Distance of the picks over the diagonal, with some tolerance.
const APART: [f64; 2] = [0.24, 0.26];

fn tell(id: &str, what: &str) {
    writeln!(std::io::stdout().lock(), "{id:<40} {what}").expect("a terminal");
}

fn milliseconds(start: Instant) -> f64 {
    1e3 * start.elapsed().as_secs_f64()
}

fn median(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

/// Pairs of places on the largest piece, about a quarter of the diagonal apart in space.
fn picks(mesh: &TriMesh, adjacency: &Adjacency) -> Vec<[FacePoint; 2]> {
    let (label, pieces) = mesh::components(adjacency);
    let mut size = vec![0; pieces];
    label.iter().for_each(|&l| size[l as usize] += 1);
    let largest = (0..pieces).max_by_key(|&p| size[p]).expect("a piece") as u32;
    let faces = mesh.triangles.len() as f64;
    let diagonal = mesh.bounds().diagonal();
    let (mut found, mut k) = (Vec::new(), 0);
    while found.len() < PAIRS {
        let mut pick = || {
            k += 1;
            FacePoint { face: (random::unit(7, k) * faces) as u32, bary: [0.25, 0.35, 0.4] }
        };
        let pair = [pick(), pick()];
        let d = pair[0].position(mesh).distance(pair[1].position(mesh)) / diagonal;
        if (APART[0]..APART[1]).contains(&d) && pair.iter().all(|p| label[p.face as usize] == largest) {
            found.push(pair);
        }
    }
    found
}

fn painting(name: &str, mesh: &TriMesh, wanted: &dyn Fn(&str) -> bool) {
    if !wanted(&format!("curve/paint/{name}")) {
        return;
    }
    let start = Instant::now();
    let canvas = Canvas::new(mesh);
    tell(
        &format!("curve/paint/{name}"),
        &format!("{} triangles, set-up {:.0} ms", mesh.triangles.len(), milliseconds(start)),
    );
    let pairs = picks(mesh, &canvas.adjacency);
    let field = ScalarField::maximum_curvature(mesh, &canvas.adjacency).smoothed(mesh, &canvas.adjacency, 4);
    let magnet = Magnet::of_scalar(&field);
    let mut lengths = Vec::new();
    for mode in [PaintMode::Geodesic, PaintMode::Straight, PaintMode::Magnetic] {
        let params = PaintParams { mode, ..PaintParams::default() };
        let mut times = Vec::new();
        let mut total = 0.0;
        for pair in &pairs {
            let start = Instant::now();
            let chain = way(&canvas, pair[0], pair[1], &params, Some(&magnet));
            times.push(milliseconds(start));
            total += SurfaceCurve::open(chain.expect("a way")).length(mesh);
        }
        lengths.push(total);
        let ratio = total / lengths[0];
        tell(
            &format!("curve/paint_{mode:?}/{name}").to_lowercase(),
            &format!(
                "median {:.2} ms, 95 % {:.2} ms, greatest {:.2} ms, length over geodesic {ratio:.4}",
                median(&mut times, 0.5),
                median(&mut times, 0.95),
                median(&mut times, 1.0)
            ),
        );
    }
    let chains: Vec<_> = pairs
        .iter()
        .map(|p| {
            canvas
                .path(mesh.triangles[p[0].face as usize][0], mesh.triangles[p[1].face as usize][0], None)
                .expect("a way")
        })
        .collect();
    let start = Instant::now();
    for (pair, chain) in pairs.iter().zip(&chains) {
        let _ = std::hint::black_box(planish::curve::straighten(mesh, &canvas.adjacency, pair[0], chain, pair[1]));
    }
    tell(&format!("curve/straighten/{name}"), &format!("mean {:.2} ms", milliseconds(start) / PAIRS as f64));
}

/// The longest of the geodesics between picks, sampled.
fn long_curve(canvas: &Canvas, count: usize) -> SurfaceCurve {
    let params = PaintParams { mode: PaintMode::Straight, ..PaintParams::default() };
    let ways = picks(canvas.mesh, &canvas.adjacency)
        .into_iter()
        .take(20)
        .filter_map(|p| way(canvas, p[0], p[1], &params, None).ok().map(SurfaceCurve::open));
    let longest = ways.max_by(|a, b| a.length(canvas.mesh).total_cmp(&b.length(canvas.mesh))).expect("a curve");
    longest.resampled(canvas.mesh, &canvas.adjacency, count).expect("a curve")
}

fn turn(p: &[DVec3]) -> f64 {
    p.windows(3).map(|w| (w[1] - w[0]).angle_between(w[2] - w[1]).to_degrees()).sum::<f64>() / (p.len() - 2) as f64
}

fn snakes(name: &str, mesh: &TriMesh, wanted: &dyn Fn(&str) -> bool) {
    if !wanted(&format!("curve/snake/{name}")) {
        return;
    }
    let canvas = Canvas::new(mesh);
    let curve = long_curve(&canvas, 1000);
    let start_snake = || Snake::new(mesh, &canvas.adjacency, &curve).expect("a snake");
    let params = SnakeParams::default();
    for sweep in [Sweep::Single, Sweep::CoarseToFine, Sweep::Solve] {
        let stiff = SnakeParams { curvature: 1.0, ..params.clone() };
        for (kind, params) in [("fair", &params), ("stiff", &stiff)] {
            let mut snake = start_snake();
            let mut times: Vec<f64> = (0..20)
                .map(|_| {
                    let start = Instant::now();
                    snake.step(params, sweep);
                    milliseconds(start)
                })
                .collect();
            let id = format!("curve/step_{sweep:?}_{kind}_1000/{name}").to_lowercase();
            tell(&id, &format!("median {:.3} ms, greatest {:.3} ms", median(&mut times, 0.5), median(&mut times, 1.0)));
        }
    }
    // An impulse: the middle of a curve at rest is pulled aside by a tenth of its length; back to within a tenth of
    // an edge of the rest.
    let rest_params = SnakeParams { settle: 1e-6, sweeps: 400, ..params.clone() };
    let mut rest = start_snake();
    rest.relax(&rest_params, &Silent).expect("a snake");
    let goal: Vec<DVec3> = rest.positions().to_vec();
    let chord = (goal[999] - goal[0]).normalize();
    let aside = chord.any_orthonormal_vector() * (0.1 * rest.curve().length(mesh));
    let mut pulled = rest.clone();
    for k in 300..=700 {
        let share = 1.0 - (k as f64 - 500.0).abs() / 200.0;
        pulled.drag(k, aside * share).expect("a drag");
        pulled.pin(k, false).expect("a point");
    }
    let near = 0.1 * canvas.edge;
    let away = |snake: &Snake| {
        let to_goal = |p: &DVec3| {
            goal.windows(2)
                .map(|w| {
                    let d = w[1] - w[0];
                    let s = ((*p - w[0]).dot(d) / d.length_squared()).clamp(0.0, 1.0);
                    p.distance(w[0] + d * s)
                })
                .fold(f64::INFINITY, f64::min)
        };
        snake.positions().iter().step_by(10).map(to_goal).fold(0.0, f64::max)
    };
    tell(
        &format!("curve/impulse/{name}"),
        &format!("{:.1} edges aside, {:.1} points per edge", away(&pulled) / canvas.edge, canvas.edge / rest.spacing()),
    );
    for sweep in [Sweep::CoarseToFine, Sweep::Solve, Sweep::Single] {
        let mut snake = pulled.clone();
        let most = if sweep == Sweep::Single { 40_000 } else { 400 };
        let start = Instant::now();
        let mut sweeps = 0;
        let mut left = away(&snake);
        while left > near && sweeps < most {
            let kind = if sweep == Sweep::CoarseToFine && sweeps >= 24 { Sweep::Solve } else { sweep };
            snake.step(&params, kind);
            sweeps += 1;
            if sweep != Sweep::Single || sweeps % 50 == 0 {
                left = away(&snake);
            }
        }
        let told = format!(
            "{sweeps} sweeps to a tenth of an edge, {:.1} ms, {:.3} edges left",
            milliseconds(start),
            away(&snake) / canvas.edge
        );
        tell(&format!("curve/converge_{sweep:?}/{name}").to_lowercase(), &told);
    }
    // Against the geodesic in the same course, with points a share of an edge apart.
    for pair in picks(mesh, &canvas.adjacency).iter().take(4) {
        let params = PaintParams { mode: PaintMode::Geodesic, ..PaintParams::default() };
        let geodesic = SurfaceCurve::open(way(&canvas, pair[0], pair[1], &params, None).expect("a way"));
        for (share, curvature) in
            [(0.5, 0.0), (0.5, 2.0), (0.5, 10.0), (1.0, 0.0), (1.0, 1.0), (1.0, 4.0), (2.0, 0.0), (2.0, 1.0)]
        {
            let rest_params = SnakeParams { curvature, ..rest_params.clone() };
            let even = geodesic.spaced(mesh, &canvas.adjacency, share * canvas.edge).expect("a curve");
            let mut snake = Snake::new(mesh, &canvas.adjacency, &even).expect("a snake");
            let told = snake.relax(&rest_params, &Silent).expect("a snake");
            let traced = SurfaceCurve::open(snake.curve().trace(mesh, &canvas.adjacency).expect("a trace"));
            tell(
                &format!("curve/geodesic_{share}_{curvature}/{name}"),
                &format!(
                    "{} points, {} sweeps: length over geodesic {:.6}, turn per point {:.3} against {:.3} deg, unevenness {:.3}",
                    even.points.len(),
                    told.sweeps,
                    traced.length(mesh) / geodesic.length(mesh),
                    turn(snake.positions()),
                    turn(&even.positions(mesh)),
                    snake.unevenness().expect("one piece")
                ),
            );
        }
    }
}

fn drags(name: &str, mesh: &TriMesh, wanted: &dyn Fn(&str) -> bool) {
    if !wanted(&format!("curve/drag/{name}")) {
        return;
    }
    let canvas = Canvas::new(mesh);
    let curve = long_curve(&canvas, 1000);
    let mut snake = Snake::new(mesh, &canvas.adjacency, &curve).expect("a snake");
    let params = SnakeParams {
        fairness: 0.1,
        curvature: 1.0,
        sweeps: 6,
        settle: 0.05,
        sweep: Sweep::Solve,
        ..SnakeParams::default()
    };
    snake.stiffen(&Section { first: 350, count: 300, fairness: 1.0, curvature: 1.0 }).expect("a section");
    let step = 4.0 * snake.spacing();
    let (mut times, mut sweeps) = (Vec::new(), 0);
    for k in 0..40 {
        let start = Instant::now();
        snake.edit_section(350, 300).expect("a section");
        let a = k as f64 * 0.7;
        snake.drag(500, DVec3::new(a.cos(), a.sin(), (2.0 * a).cos()) * step).expect("a drag");
        sweeps += snake.relax(&params, &Silent).expect("a snake").sweeps;
        let drawn: Vec<DVec3> = snake.positions().to_vec();
        std::hint::black_box(&drawn);
        times.push(milliseconds(start));
    }
    tell(
        &format!("curve/drag_300/{name}"),
        &format!(
            "median {:.2} ms, 95 % {:.2} ms, {:.1} sweeps",
            median(&mut times, 0.5),
            median(&mut times, 0.95),
            sweeps as f64 / 40.0
        ),
    );
}

fn main() {
    let filter = std::env::args().skip(1).find(|a| !a.starts_with('-')).unwrap_or_default();
    let wanted = |id: &str| id.contains(&filter);
    let ball = shapes::sphere(1.0, 7);
    let mut inputs = vec![("sphere".to_string(), ball)];
    for file in ["armadillo", "dragon"] {
        if let Some(mesh) = common::data_mesh(&format!("{file}.ply")) {
            inputs.push((file.to_string(), mesh::repair(&mesh).expect("a mesh").0));
        }
    }
    for (name, mesh) in &inputs {
        painting(name, mesh, &wanted);
        snakes(name, mesh, &wanted);
        drags(name, mesh, &wanted);
    }
}
