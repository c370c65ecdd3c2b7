//! Hostile meshes: a shape, damaged a few times over, in one of the formats.

use super::dice::Dice;

pub type Mesh = (Vec<[f64; 3]>, Vec<[usize; 3]>);

pub fn ply((points, triangles): &Mesh) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        points.len(),
        triangles.len()
    );
    points.iter().for_each(|p| text += &format!("{:e} {:e} {:e}\n", p[0], p[1], p[2]));
    triangles.iter().for_each(|t| text += &format!("3 {} {} {}\n", t[0], t[1], t[2]));
    text
}

fn obj((points, triangles): &Mesh) -> String {
    let rows = points.iter().map(|p| format!("v {:e} {:e} {:e}\n", p[0], p[1], p[2]));
    let faces = triangles.iter().map(|t| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1));
    rows.chain(faces).collect()
}

fn stl((points, triangles): &Mesh) -> String {
    let vertex = |&v: &usize| {
        let p = points.get(v).copied().unwrap_or_default();
        format!("vertex {:e} {:e} {:e}\n", p[0], p[1], p[2])
    };
    let facet = |t: &[usize; 3]| {
        let corners: String = t.iter().map(vertex).collect();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    format!("solid a\n{}endsolid a\n", triangles.iter().map(facet).collect::<String>())
}

/// A grid of `m` by `n` squares over a rectangle, without those that `hole` names.
pub fn sheet(m: usize, n: usize, size: [f64; 2], hole: impl Fn(usize, usize) -> bool) -> Mesh {
    let point = |k: usize| [size[0] * (k % (m + 1)) as f64 / m as f64, size[1] * (k / (m + 1)) as f64 / n as f64, 0.0];
    let points = (0..(m + 1) * (n + 1)).map(point).collect();
    let mut triangles = Vec::new();
    for j in 0..n {
        for i in (0..m).filter(|&i| !hole(i, j)) {
            let a = j * (m + 1) + i;
            triangles.extend([[a, a + 1, a + m + 2], [a, a + m + 2, a + m + 1]]);
        }
    }
    (points, triangles)
}

/// A ball of latitudes and longitudes, open along one of these and at its poles.
pub fn ball(n: usize) -> Mesh {
    let (mut mesh, turn) = (sheet(2 * n, n, [1.0, 1.0], |_, _| false), std::f64::consts::PI);
    for p in &mut mesh.0 {
        let (a, b) = (2.0 * turn * p[0], turn * p[1]);
        *p = [b.sin() * a.cos(), b.sin() * a.sin(), b.cos()];
    }
    mesh
}

/// A sheet of squares whose ends are joined around, and across where `closed`: a tube or a ring.
fn ring(m: usize, n: usize, closed: bool, twisted: bool) -> Mesh {
    let across = if closed { n } else { n + 1 };
    let index = |i: usize, j: usize| match (i == m, twisted) {
        (true, true) => (n - j.min(n)) % across,
        _ => (i % m) * across + j % across,
    };
    let turn = std::f64::consts::TAU;
    let mut points = Vec::new();
    for i in 0..m {
        for j in 0..across {
            let (a, t) = (turn * i as f64 / m as f64, j as f64 / n as f64);
            let b = if closed { turn * t } else { a / 2.0 };
            let (r, z) = match (closed, twisted) {
                (true, _) => (1.0 + 0.4 * b.cos(), 0.4 * b.sin()),
                (_, true) => (1.0 + (t - 0.5) * b.cos(), (t - 0.5) * b.sin()),
                _ => (1.0, 2.0 * t),
            };
            points.push([r * a.cos(), r * a.sin(), z]);
        }
    }
    let mut triangles = Vec::new();
    for i in 0..m {
        for j in 0..n {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    (points, triangles)
}

/// A box of `n` squares along each edge, closed.
pub fn cuboid(n: usize) -> Mesh {
    let solid = planish::synthetic::shapes::cuboid(planish::DVec3::new(1.0, 1.0, 1.0), n);
    let triangles = solid.triangles.iter().map(|t| t.map(|v| v as usize)).collect();
    (solid.points.iter().map(|p| p.to_array()).collect(), triangles)
}

/// All triangles at one vertex.
fn fan(n: usize) -> Mesh {
    let rim = (0..n).map(|k| std::f64::consts::TAU * k as f64 / n as f64).map(|a| [a.cos(), a.sin(), 0.0]);
    (std::iter::once([0.0, 0.0, 0.5]).chain(rim).collect(), (0..n).map(|k| [0, 1 + k, 1 + (k + 1) % n]).collect())
}

/// Triangles between any of some points, `shared` of them on the average at each.
fn crowd(points: usize, triangles: usize, dice: &mut Dice) -> Mesh {
    let places = (0..points).map(|_| dice.place()).collect();
    (places, (0..triangles).map(|_| [0; 3].map(|_| dice.below(points))).collect())
}

fn base(dice: &mut Dice) -> Mesh {
    let n = 2 + dice.below(9);
    match dice.below(10) {
        0 => sheet(n, 1 + dice.below(9), [1.0, 1.0], |_, _| false),
        1 => sheet(40, 1, [dice.power(0, 7), 1.0], |_, _| false),
        2 => ball(n),
        3 => ring(n + 3, n + 1, true, false),
        4 => ring(n + 3, n, false, false),
        5 => ring(n + 5, 2, false, true),
        6 => cuboid(1 + n / 2),
        7 => fan(3 + dice.below(200)),
        8 => crowd(3 + dice.below(40), 1 + dice.below(400), dice),
        _ => {
            let mut mesh = cuboid(2);
            let (other, shift) = (cuboid(1), dice.place());
            let first = mesh.0.len();
            mesh.0.extend(other.0.iter().map(|p| std::array::from_fn(|k| p[k] + shift[k])));
            mesh.1.extend(other.1.iter().map(|t| t.map(|v| v + first)));
            mesh
        }
    }
}

fn damage(mesh: &mut Mesh, dice: &mut Dice) {
    let (points, triangles) = (mesh.0.len(), mesh.1.len());
    match dice.below(18) {
        0 => {
            let size = dice.power(-300, 300);
            mesh.0.iter_mut().flatten().for_each(|x| *x *= size);
        }
        1 => {
            let size = [0; 3].map(|_| dice.power(-9, 6));
            mesh.0.iter_mut().for_each(|p| *p = std::array::from_fn(|k| p[k] * size[k]));
        }
        2 => {
            let far = dice.power(2, 12);
            mesh.0[dice.below(points)][dice.below(3)] = far;
        }
        3 => mesh.0[dice.below(points)][dice.below(3)] = dice.odd(),
        4 => {
            let share = dice.unit();
            mesh.1.retain(|_| !dice.is(share));
        }
        5 => {
            let share = dice.unit();
            mesh.1.iter_mut().filter(|_| dice.is(share)).for_each(|t| t.swap(0, 1));
        }
        6 => (0..triangles.min(100)).for_each(|_| mesh.1.push(mesh.1[dice.below(triangles)])),
        7 => (0..1 + dice.below(40)).for_each(|_| mesh.1.push([0; 3].map(|_| dice.below(points)))),
        8 => (0..points).for_each(|k| mesh.0.swap(k, dice.below(points))),
        9 => {
            // Triangles that hold on to each other no longer.
            mesh.0 = mesh.1.iter().flatten().map(|&v| mesh.0[v]).collect();
            mesh.1 = (0..triangles).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        }
        10 => {
            let (most, noise) = (dice.power(-9, 0), mesh.0.len());
            (0..noise).for_each(|k| mesh.0[k] = std::array::from_fn(|i| mesh.0[k][i] + most * dice.signed()));
        }
        11 => {
            let axis = dice.below(3);
            mesh.0.iter_mut().for_each(|p| p[axis] = 0.0);
        }
        12 => {
            // Places that are one, of vertices that are not.
            let to = mesh.0[dice.below(points)];
            let share = dice.unit();
            mesh.0.iter_mut().filter(|_| dice.is(share)).for_each(|p| *p = to);
        }
        13 => mesh.1.iter_mut().flatten().for_each(|v| *v = if dice.is(0.02) { dice.below(points) } else { *v }),
        14 => mesh.1.push([0, points + dice.below(9), 1]),
        15 => {
            let far = dice.power(3, 15);
            mesh.0.iter_mut().for_each(|p| *p = p.map(|x| x + far));
        }
        16 => mesh.0.extend((0..50).map(|_| dice.place())),
        _ => {
            let step = dice.power(-6, -1);
            mesh.0.iter_mut().flatten().for_each(|x| *x = (*x / step).round() * step);
        }
    }
}

/// A mesh of a seed with its extension; small enough that a run takes seconds.
pub fn drawn(dice: &mut Dice) -> (&'static str, String) {
    let mut mesh = base(dice);
    for _ in 0..dice.below(4) {
        // Nothing is left to damage.
        if mesh.0.is_empty() || mesh.1.is_empty() {
            break;
        }
        damage(&mut mesh, dice);
    }
    match dice.below(4) {
        0 => ("obj", obj(&mesh)),
        1 => ("stl", stl(&mesh)),
        _ => ("ply", ply(&mesh)),
    }
}
