//! Curves: times and quality, one line each. Ids are `curve/<what>/<input>`; give a part of an id to run only that.

#[path = "../tests/common/mod.rs"]
mod common;

use planish::curve::{
    Canvas, Magnet, PaintMode, PaintParams, ScalarField, Section, Snake, SnakeParams, SurfaceCurve, Sweep, way,
};
use planish::edit::network::{Editor, Holds};
use planish::geom::{Bvh, random};
use planish::grid::{self, Grid, GridParams};
use planish::layout::{Known, LayoutParams, layout};
use planish::mesh::{self, Adjacency, FacePoint, TriMesh};
use planish::network::{CurveKind, PatchMesh, changed_patches, imprint, reimprint};
use planish::synthetic::shapes;
use planish::{DVec3, Silent, mend, surface};
use std::io::Write;
use std::time::Instant;

/// Pairs of picks per input and mode.
const PAIRS: usize = 60;
/// Runs of which the least time counts.
const RUNS: usize = 5;
/// Distance of the picks over the diagonal, with some tolerance.
const APART: [f64; 2] = [0.24, 0.26];

/// A section of this width around the middle of a curve.
fn section(width: f64) -> Holds<'static> {
    Holds { section: Some((0.5, width)), ..Holds::default() }
}

fn tell(id: &str, what: &str) {
    writeln!(std::io::stdout().lock(), "{id:<40} {what}").expect("a terminal");
}

fn milliseconds(start: Instant) -> f64 {
    1e3 * start.elapsed().as_secs_f64()
}

/// Least time of some runs, milliseconds: what the machine does besides adds to the others.
fn least<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let start = Instant::now();
    let mut out = run();
    let mut best = milliseconds(start);
    for _ in 1..RUNS {
        let start = Instant::now();
        out = run();
        best = best.min(milliseconds(start));
    }
    (best, out)
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
    let spent = cpu();
    let (time, canvas) = least(|| Canvas::new(mesh));
    let spent = (cpu() - spent) / RUNS as f64;
    tell(
        &format!("curve/paint/{name}"),
        &format!("{} triangles, set-up {time:.0} ms, CPU {spent:.0} ms", mesh.triangles.len()),
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
            let (time, chain) = least(|| way(&canvas, pair[0], pair[1], &params, Some(&magnet)));
            times.push(time);
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

/// Mean turn within the surface: of the parts of the pieces across the blended normals at the points.
fn turn_within(mesh: &TriMesh, normals: &[DVec3], curve: &SurfaceCurve) -> f64 {
    let at = curve.positions(mesh);
    let turns = (1..at.len() - 1).map(|i| {
        let place = &curve.points[i];
        let t = mesh.triangles[place.face as usize];
        let n = (0..3).map(|k| normals[t[k] as usize] * place.bary[k]).sum::<DVec3>().normalize_or_zero();
        let flat = |v: DVec3| v - n * v.dot(n);
        flat(at[i] - at[i - 1]).angle_between(flat(at[i + 1] - at[i])).to_degrees()
    });
    turns.sum::<f64>() / (at.len() - 2) as f64
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
    // An impulse: the middle of a curve at rest is pulled aside by a twentieth of its length. Every way of sweeping has
    // a rest of its own on a rough surface: the state that it is in after many sweeps, settled by fine solves. Counted
    // are the sweeps until the curve stays within a tenth of an edge of that.
    let rest_params = SnakeParams { settle: 1e-6, sweeps: 400, ..params.clone() };
    let mut rest = start_snake();
    rest.relax(&rest_params, &Silent).expect("a snake");
    let (first, last) = (rest.positions()[0], rest.positions()[999]);
    let chord = (last - first).normalize();
    let aside = chord.any_orthonormal_vector() * (0.05 * rest.curve().length(mesh));
    let mut pulled = rest.clone();
    for k in 300..=700 {
        let share = 1.0 - (k as f64 - 500.0).abs() / 200.0;
        pulled.drag(k, aside * share).expect("a drag");
        pulled.pin(k, false).expect("a point");
    }
    let near = 0.1 * canvas.edge;
    let away = |snake: &Snake, goal: &[DVec3]| {
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
    for (sweep, most, step) in [(Sweep::CoarseToFine, 400, 1), (Sweep::Solve, 400, 1), (Sweep::Single, 40_000, 100)] {
        let run = |snake: &mut Snake, k: usize| {
            let kind = if sweep == Sweep::CoarseToFine && k >= 24 { Sweep::Solve } else { sweep };
            snake.step(&params, kind);
        };
        let mut snake = pulled.clone();
        let start = Instant::now();
        (0..most).for_each(|k| run(&mut snake, k));
        let each = milliseconds(start) / most as f64;
        snake.relax(&SnakeParams { sweep: Sweep::Solve, ..rest_params.clone() }, &Silent).expect("a snake");
        let goal: Vec<DVec3> = snake.positions().to_vec();
        let mut snake = pulled.clone();
        let pulled_by = away(&snake, &goal);
        let mut last_outside = 0;
        for k in 0..most {
            if k % step == 0 && away(&snake, &goal) > near {
                last_outside = k + step;
            }
            run(&mut snake, k);
        }
        let told = match last_outside {
            n if n >= most => format!("not in {most} sweeps, {:.2} edges left", away(&snake, &goal) / canvas.edge),
            n => format!("{n} sweeps"),
        };
        tell(
            &format!("curve/converge_{sweep:?}/{name}").to_lowercase(),
            &format!("{told} from {:.1} edges aside, {each:.3} ms each", pulled_by / canvas.edge),
        );
    }
    // Against the geodesic in the same course: the mean over pairs, with points a share of an edge apart.
    let pairs = picks(mesh, &canvas.adjacency);
    let mut normals = vec![DVec3::ZERO; mesh.points.len()];
    for (t, corners) in mesh.triangles.iter().enumerate() {
        corners.iter().for_each(|&v| normals[v as usize] += mesh.area_vector(t));
    }
    normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    for share in [0.5, 1.0] {
        let (mut length, mut worst, mut turns, mut less, mut uneven) = (0.0, 0.0f64, [0.0; 4], 0, 0.0f64);
        let count = 20;
        for pair in pairs.iter().take(count) {
            let params = PaintParams { mode: PaintMode::Geodesic, ..PaintParams::default() };
            let geodesic = SurfaceCurve::open(way(&canvas, pair[0], pair[1], &params, None).expect("a way"));
            let even = geodesic.spaced(mesh, &canvas.adjacency, share * canvas.edge).expect("a curve");
            let mut snake = Snake::new(mesh, &canvas.adjacency, &even).expect("a snake");
            snake.relax(&rest_params, &Silent).expect("a snake");
            let traced = SurfaceCurve::open(snake.curve().trace(mesh, &canvas.adjacency).expect("a trace"));
            let ratio = traced.length(mesh) / geodesic.length(mesh);
            let four = [
                turn(snake.positions()),
                turn(&even.positions(mesh)),
                turn_within(mesh, &normals, &snake.curve()),
                turn_within(mesh, &normals, &even),
            ];
            length += ratio / count as f64;
            worst = worst.max(ratio);
            (0..4).for_each(|k| turns[k] += four[k] / count as f64);
            less += (four[0] < four[1]) as usize;
            uneven = uneven.max(snake.unevenness().expect("one piece"));
        }
        tell(
            &format!("curve/geodesic_{share}/{name}"),
            &format!(
                "length over geodesic {length:.5} in the mean, {worst:.5} at most; turn per point {:.3} against {:.3} deg, \
                 less in {less} of {count}, within the surface {:.3} against {:.3}; unevenness {uneven:.3} at most",
                turns[0], turns[1], turns[2], turns[3]
            ),
        );
    }
}

/// Two patches of 25 thousand vertices each: their common curve is pulled, and one of them is made anew.
fn one_patch(wanted: &dyn Fn(&str) -> bool) {
    let id = "curve/patch/sheet_25k";
    if !wanted(id) {
        return;
    }
    let bump = |x: f64, y: f64| 0.1 * (7.0 * x).sin() * (5.0 * y).cos() + 0.01 * (61.0 * x + 47.0 * y).sin();
    let mesh = shapes::sheet(316, 158, false, false, |s, t| DVec3::new(2.0 * s, t, bump(2.0 * s, t)));
    let adjacency = Adjacency::new(&mesh);
    let bvh = Bvh::new(&mesh);
    let mut editor = Editor::new(&mesh, &adjacency, Default::default());
    let at = |x: f64, y: f64| bvh.closest(DVec3::new(x, y, bump(x, y))).place;
    for (x, y) in [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (0.0, 1.0)] {
        editor.add_corner(at(x, y), 1e-9).expect("a corner");
    }
    editor.add_boundaries().expect("curves");
    let ends = [1, 4].map(|k: usize| editor.network.corners[k].place);
    let middle = SurfaceCurve::open(vec![ends[0], ends[1]]);
    let curve = editor.add_curve(&middle, CurveKind::Smooth, 1e-9).expect("a curve");
    assert!(editor.diagnose().is_finished());
    let params = SnakeParams { fairness: 0.1, curvature: 1.0, ..SnakeParams::default() };
    let before = editor.network.clone();
    let old = imprint(&mesh, &before, &Silent).expect("patches");
    let grid_params = GridParams::default();
    let sizes = grid::choose_sizes(&before, &old, &grid_params);
    let old_grids = grid::relax(&mesh, &old, &sizes, &grid_params, &Silent).expect("grids");
    let start = Instant::now();
    editor.drag_curve(curve, (0.5, DVec3::X * 0.03), &section(0.6), &params, &Silent).expect("a drag");
    let drag = milliseconds(start);
    let which = changed_patches(&before, &editor.network).expect("the same network");
    let near: Vec<&PatchMesh> = which.iter().map(|&p| &old[p]).collect();
    let (whole, patches) = least(|| imprint(&mesh, &editor.network, &Silent).expect("patches"));
    let (cutting, _) =
        least(|| reimprint(&mesh, &adjacency, &editor.network, &near, &which, &Silent).expect("patches"));
    tell(
        id,
        &format!(
            "{} vertices: drag {drag:.1} ms, cut {cutting:.0} ms (both patches; the whole mesh {whole:.0} ms)",
            patches[0].mesh.points.len()
        ),
    );
    compare(id, &mesh, &patches[..1], &old_grids[..1], &grid_params);
}

/// CPU time of this process, milliseconds.
fn cpu() -> f64 {
    let times = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = times.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    // User and system time, in hundredths of a second.
    [11, 12].iter().filter_map(|&k| fields.get(k)?.parse::<f64>().ok()).sum::<f64>() * 10.0
}

/// Grids from nothing and grids that follow, side by side: times and quality.
fn compare(id: &str, mesh: &TriMesh, patches: &[PatchMesh], old: &[Grid], params: &GridParams) {
    const AGAIN: usize = 5;
    let sizes: Vec<(usize, usize)> = old.iter().map(|g| (g.cols, g.rows)).collect();
    let measured = |make: &dyn Fn() -> Vec<Grid>| {
        let (start, spent) = (Instant::now(), cpu());
        let mut grids = make();
        (1..AGAIN).for_each(|_| grids = make());
        (milliseconds(start) / AGAIN as f64, (cpu() - spent) / AGAIN as f64, grids)
    };
    let cold = measured(&|| grid::relax(mesh, patches, &sizes, params, &Silent).expect("grids"));
    let warm = measured(&|| grid::follow(mesh, patches, old, params, &Silent).expect("grids"));
    for (name, (clock, cpu, grids)) in [("from nothing", cold), ("following", warm)] {
        let found: Vec<grid::GridQuality> = grids.iter().zip(patches).map(|(g, p)| grid::measure(g, p)).collect();
        let mean = |of: &dyn Fn(&grid::GridQuality) -> f64| found.iter().map(of).sum::<f64>() / found.len() as f64;
        let fit = |g: &Grid| {
            let surface = surface::fit(&g.points, g.rows, g.cols, [g.rows, g.cols].map(|n| (n / 4).max(4)));
            surface::deviation_of(&surface.expect("a surface"), g).rms
        };
        let fits: Vec<f64> = grids.iter().map(fit).collect();
        tell(
            id,
            &format!(
                "{name}: {clock:.0} ms, CPU {cpu:.0} ms for {} nodes in {} patches; folds {}, spacing cv {:.4}, \
                 angle 95 % {:.1} deg, miss rms {:.2e}, fit rms {:.3e}",
                grids.iter().map(|g| g.points.len()).sum::<usize>(),
                grids.len(),
                found.iter().map(|q| q.folds).sum::<usize>(),
                mean(&|q| q.spacing_cv),
                mean(&|q| q.angle_p95_deg),
                mean(&|q| q.miss_rms),
                (fits.iter().map(|f| f * f).sum::<f64>() / fits.len() as f64).sqrt()
            ),
        );
    }
}

/// Curves of an automatic network dragged by a twentieth of their length, one after the other from the same start; the
/// patches beside them made again.
fn follows(name: &str, mesh: &TriMesh, wanted: &dyn Fn(&str) -> bool) {
    let id = format!("curve/follow/{name}");
    if !wanted(&id) {
        return;
    }
    let adjacency = Adjacency::new(mesh);
    let before = layout(mesh, Known::default(), &LayoutParams::default(), None, &Silent).expect("a network").network;
    let old = imprint(mesh, &before, &Silent).expect("patches");
    let params = GridParams::default();
    let sizes = grid::choose_sizes(&before, &old, &params);
    let (mut patches, mut old_grids) = (Vec::new(), Vec::new());
    let step = (before.curves.len() / 12).max(1);
    for c in (0..before.curves.len()).step_by(step).filter(|&c| before.curves[c].kind.is_smooth()) {
        let mut editor = Editor::new(mesh, &adjacency, before.clone());
        let at: Vec<DVec3> = before.curves[c].points.iter().map(|p| p.position(mesh)).collect();
        let length: f64 = at.windows(2).map(|w| w[0].distance(w[1])).sum();
        let aside = (at[at.len() - 1] - at[0]).any_orthonormal_vector() * (0.05 * length);
        let forces = SnakeParams { fairness: 0.1, curvature: 1.0, ..SnakeParams::default() };
        if editor.drag_curve(c as u32, (0.5, aside), &section(0.7), &forces, &Silent).is_err()
            || !editor.glance().is_finished()
        {
            continue;
        }
        let which = changed_patches(&before, &editor.network).expect("the same network");
        let near: Vec<&PatchMesh> = which.iter().map(|&p| &old[p]).collect();
        let Ok(made) = reimprint(mesh, &adjacency, &editor.network, &near, &which, &Silent) else { continue };
        let sizes: Vec<(usize, usize)> = which.iter().map(|&p| sizes[p]).collect();
        let some: Vec<PatchMesh> = which.iter().map(|&p| old[p].clone()).collect();
        old_grids.extend(grid::relax(mesh, &some, &sizes, &params, &Silent).expect("grids"));
        patches.extend(made);
    }
    compare(&id, mesh, &patches, &old_grids, &params);
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
            inputs.push((file.to_string(), mend::repair(&mesh, &Silent).expect("a mesh").0));
        }
    }
    one_patch(&wanted);
    for (name, mesh) in &inputs {
        painting(name, mesh, &wanted);
        snakes(name, mesh, &wanted);
        drags(name, mesh, &wanted);
        follows(name, mesh, &wanted);
    }
}
