//! The demonstration model: an organic body with machined parts.
//!
//! A lobed, bumpy gourd with scales on one side and ripples on the other, cut flat at top and bottom, drilled
//! through along its axis with a counterbore (so the genus is 1), with two round pockets milled into its side, one
//! of them with a blind hole.
//!
//! 1. The body is grown ring by ring, so the cut outlines and the circles of the bore are rings of vertices.
//! 2. A pocket is milled by cutting the closed mesh with a round cutter: vertices near the cutter slide along
//!    their edges onto it, the other crossing edges are split, what is inside goes, and wall and floor are grown
//!    from the loop that is left. So all sharp edges are exact chains of mesh edges.

use super::rings::{Ring, add_ring, grow, grow_disk};
use crate::geom::random;
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// The demonstration model with about `triangles` triangles (at least 2 000, or the relief would be lost), about
/// two units tall. The seed moves bumps, lobes, relief and pockets.
pub fn demo(seed: u64, triangles: usize) -> TriMesh {
    let wanted = triangles.max(2_000) as f64;
    let body = Body::new(seed);
    // The model's area is near 16; two corrections bring the count within a per cent.
    let mut step = (16.0 / wanted / (3f64.sqrt() / 4.0)).sqrt();
    for _ in 0..2 {
        step *= (body.mesh(step).triangles.len() as f64 / wanted).sqrt();
    }
    body.mesh(step)
}

/// Half axes of the ellipsoid under the body: across and along the bore.
const ACROSS: f64 = 1.0;
const ALONG: f64 = 1.2;
/// Heights of the bottom and top cut.
const BOTTOM: f64 = -0.72;
const TOP: f64 = 0.70;
/// Bore and counterbore.
const BORE: f64 = 0.25;
const COUNTERBORE: f64 = 0.38;
const COUNTERBORE_DEPTH: f64 = 0.16;
/// Where a cutter stops at the latest: outside the counterbore, inside the body's outer wall.
const REACH: f64 = 0.5;
/// The least depth of a pocket.
const POCKET_DEPTH: f64 = 0.05;
/// Blind hole in the first pocket.
const HOLE: f64 = 0.16;
const HOLE_DEPTH: f64 = 0.24;
/// Scales around the girth, and their height.
const SCALES: f64 = 34.0;
const SCALE_HEIGHT: f64 = 0.026;
/// Waves per unit of length of the ripples, and their height.
const RIPPLES: f64 = 5.0;
const RIPPLE_HEIGHT: f64 = 0.007;
/// The relief fades out over this distance before a machined edge, so that the edge is a clean line.
const FADE: f64 = 0.12;

/// A round pocket: the cutter comes from far outside along the axis.
struct Pocket {
    /// Unit vector out of the pocket; the axis of the cutter goes through the origin.
    axis: DVec3,
    radius: f64,
    holed: bool,
}

impl Pocket {
    /// Distance from the wall, negative inside the cutter.
    fn outside(&self, p: DVec3) -> f64 {
        let along = p.dot(self.axis);
        // The bore and what lies on its far side are out of reach.
        if along <= REACH { f64::MAX } else { (p - self.axis * along).length() - self.radius }
    }

    /// The nearest point of the wall.
    fn on_wall(&self, p: DVec3) -> DVec3 {
        let foot = self.axis * p.dot(self.axis);
        foot + (p - foot).normalize_or_zero() * self.radius
    }
}

struct Body {
    /// Direction, height and sharpness of low bumps.
    bumps: Vec<(DVec3, f64, f64)>,
    lobe_phase: f64,
    scale_side: DVec3,
    ripple_pole: DVec3,
    pockets: Vec<Pocket>,
    /// Latitude at even steps of arc length from the bottom cut to the top cut.
    latitudes: Vec<f64>,
    meridian: f64,
}

impl Body {
    fn new(seed: u64) -> Body {
        let draw = |k: u64| random::unit(seed, k);
        let direction = |k: u64| {
            let (z, a) = (1.4 * draw(k) - 0.7, TAU * draw(k + 1));
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * a.cos(), r * a.sin(), z)
        };
        let bumps = (0..8).map(|k| (direction(10 * k), 0.2 * draw(10 * k + 2) - 0.07, 3.0 + 3.0 * draw(10 * k + 3)));
        let (latitudes, meridian) = even_latitudes();
        let mut body = Body {
            bumps: bumps.collect(),
            lobe_phase: TAU * draw(1000),
            scale_side: DVec3::ZERO,
            ripple_pole: DVec3::ZERO,
            pockets: Vec::new(),
            latitudes,
            meridian,
        };
        let azimuth = TAU * draw(1001);
        let around = |turn: f64, z: f64| DVec3::new((azimuth + turn).cos(), (azimuth + turn).sin(), z).normalize();
        body.scale_side = around(PI * 0.55, 0.15);
        body.ripple_pole = around(-PI * 0.6, 0.3);
        body.pockets = vec![
            Pocket { axis: around(0.0, -0.06), radius: 0.37, holed: true },
            Pocket { axis: around(1.25 * PI, 0.05), radius: 0.25, holed: false },
        ];
        body
    }

    fn latitude(&self, s: f64) -> f64 {
        let x = s.clamp(0.0, 1.0) * (self.latitudes.len() - 1) as f64;
        let k = (x as usize).min(self.latitudes.len() - 2);
        self.latitudes[k] + (self.latitudes[k + 1] - self.latitudes[k]) * (x - k as f64)
    }

    /// The body without relief: `s` from the bottom cut to the top cut, angle around.
    fn smooth(&self, s: f64, angle: f64) -> DVec3 {
        let latitude = self.latitude(s);
        // The cuts are exact planes: their height is not computed but set.
        let z = match s {
            0.0 => BOTTOM,
            1.0 => TOP,
            _ => ALONG * latitude.sin(),
        };
        let direction = DVec3::new(latitude.cos() * angle.cos(), latitude.cos() * angle.sin(), latitude.sin());
        let bumps: f64 = self.bumps.iter().map(|&(c, height, k)| height * (k * (direction.dot(c) - 1.0)).exp()).sum();
        let lobes = 0.045 * (5.0 * angle + self.lobe_phase + 1.6 * z).cos();
        let r = ACROSS * latitude.cos() * (1.0 + bumps + lobes);
        DVec3::new(r * angle.cos(), r * angle.sin(), z)
    }

    /// The body with scales and ripples.
    fn outer(&self, s: f64, angle: f64) -> DVec3 {
        let p = self.smooth(s, angle);
        let along = s * self.meridian;
        let rims = along.min(self.meridian - along);
        let pockets = self.pockets.iter().map(|k| k.outside(p).abs()).fold(f64::INFINITY, f64::min);
        let fade = smooth_step(rims / FADE) * smooth_step(pockets / FADE);
        if fade == 0.0 {
            return p;
        }
        let scaly = smooth_step(0.75 + 1.1 * p.normalize().dot(self.scale_side));
        let scales = scaly * SCALE_HEIGHT * scale(angle / TAU * SCALES, along * SCALES / TAU * 1.15);
        let away = p.distance(self.ripple_pole);
        let ripples = (1.0 - scaly) * RIPPLE_HEIGHT * (TAU * RIPPLES * away).cos();
        let normal = (p / DVec3::new(ACROSS, ACROSS, ALONG).powf(2.0)).normalize();
        p + normal * (fade * (scales + ripples))
    }

    fn mesh(&self, step: f64) -> TriMesh {
        let mut mesh = TriMesh::default();
        let circle = |r: f64, a: f64, z: f64| DVec3::new(r * a.cos(), r * a.sin(), z);
        let girth = |s: f64| -> f64 {
            let p: Vec<DVec3> = (0..64).map(|k| self.smooth(s, TAU * k as f64 / 64.0)).collect();
            (0..64).map(|k| p[k].distance(p[(k + 1) % 64])).sum()
        };
        let count = |s: f64| super::rings::girth_count(girth(s), step);
        let mean_radius = |s: f64| girth(s) / TAU;

        // Outside, bottom to top.
        let first = add_ring(&mut mesh, count(0.0), false, |a| self.smooth(0.0, a));
        let ring = grow(&mut mesh, (first.clone(), None), step, self.meridian, girth, |s, a| self.outer(s, a));
        // Top flat, counterbore, its floor, the bore.
        let between = |from: f64, to: f64| move |s: f64| TAU * (from + (to - from) * s);
        let wide = mean_radius(1.0);
        let ring = grow(&mut mesh, (ring, None), step, wide - COUNTERBORE, between(wide, COUNTERBORE), |s, a| {
            self.smooth(1.0, a).lerp(circle(COUNTERBORE, a, TOP), s)
        });
        let floor = TOP - COUNTERBORE_DEPTH;
        let ring = grow(&mut mesh, (ring, None), step, COUNTERBORE_DEPTH, between(COUNTERBORE, COUNTERBORE), |s, a| {
            circle(COUNTERBORE, a, TOP + (floor - TOP) * s)
        });
        let ring = grow(&mut mesh, (ring, None), step, COUNTERBORE - BORE, between(COUNTERBORE, BORE), |s, a| {
            circle(COUNTERBORE + (BORE - COUNTERBORE) * s, a, floor)
        });
        let ring = grow(&mut mesh, (ring, None), step, floor - BOTTOM, between(BORE, BORE), |s, a| {
            circle(BORE, a, floor + (BOTTOM - floor) * s)
        });
        // Bottom flat, back to the first ring.
        let wide = mean_radius(0.0);
        grow(&mut mesh, (ring, Some(first)), step, wide - BORE, between(BORE, wide), |s, a| {
            circle(BORE, a, BOTTOM).lerp(self.smooth(0.0, a), s)
        });
        for pocket in &self.pockets {
            if let Some(milled) = mill(&mesh, pocket, step) {
                mesh = milled;
            }
        }
        mesh
    }
}

/// Latitudes at even arc length of the ellipse between the two cuts, and the arc length.
fn even_latitudes() -> (Vec<f64>, f64) {
    const FINE: usize = 4000;
    const COARSE: usize = 400;
    let (from, to) = ((BOTTOM / ALONG).asin(), (TOP / ALONG).asin());
    let at = |k: usize| from + (to - from) * k as f64 / FINE as f64;
    let mut arc = vec![0.0];
    for k in 1..=FINE {
        let middle = (at(k - 1) + at(k)) / 2.0;
        let speed = (ACROSS * middle.sin()).hypot(ALONG * middle.cos());
        arc.push(arc[k - 1] + speed * (to - from) / FINE as f64);
    }
    let total = arc[FINE];
    let latitudes = (0..=COARSE).map(|c| {
        let wanted = total * c as f64 / COARSE as f64;
        at(arc.partition_point(|&l| l < wanted).min(FINE))
    });
    (latitudes.collect(), total)
}

/// 0 below 0, 1 above 1, smooth between.
fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Overlapping scales on a staggered lattice of unit cells, about 0 to 1.
fn scale(u: f64, v: f64) -> f64 {
    // Soft maximum of domes that rise towards their lower end: creases stay rounded.
    const SHARPNESS: f64 = 9.0;
    let row = v.floor();
    let mut sum = 0.0;
    for dr in -1..=2 {
        let r = row + dr as f64;
        let shift = if r.rem_euclid(2.0) == 1.0 { 0.5 } else { 0.0 };
        let column = (u - shift).round();
        for dc in -1..=1 {
            let (x, y) = (u - shift - column - dc as f64, v - r);
            let dome = 1.0 - 1.5 * x * x - 0.75 * y * y - 0.35 * y;
            sum += (SHARPNESS * dome).exp();
        }
    }
    sum.ln() / SHARPNESS - 0.6
}

/// A vertex this near to the cutter, as a fraction of a crossing edge, slides onto it.
const SNAP: f64 = 0.4;

/// Mills a pocket into a closed mesh. `None` if its outline is not one loop around the axis.
fn mill(mesh: &TriMesh, pocket: &Pocket, step: f64) -> Option<TriMesh> {
    let (mut cut, outline) = cut_out(mesh, pocket)?;
    let tangent = pocket.axis.any_orthonormal_vector();
    let bitangent = pocket.axis.cross(tangent);
    // The outline by angle and height, counter-clockwise, beginning at its least angle.
    let mut rim: Vec<(f64, f64, u32)> = outline
        .iter()
        .map(|&v| {
            let p = cut.points[v as usize];
            (p.dot(bitangent).atan2(p.dot(tangent)).rem_euclid(TAU), p.dot(pocket.axis), v)
        })
        .collect();
    let least = (0..rim.len()).min_by(|&a, &b| rim[a].0.total_cmp(&rim[b].0))?;
    rim.rotate_left(least);
    if rim.windows(2).any(|w| w[1].0 <= w[0].0) {
        return None;
    }
    let height = |angle: f64| {
        let a = angle.rem_euclid(TAU);
        let k = rim.partition_point(|p| p.0 <= a);
        let (low, high) = (rim[(k + rim.len() - 1) % rim.len()], rim[k % rim.len()]);
        low.1 + (high.1 - low.1) * (a - low.0).rem_euclid(TAU) / (high.0 - low.0).rem_euclid(TAU)
    };
    let on = |r: f64, a: f64, h: f64| (tangent * a.cos() + bitangent * a.sin()) * r + pocket.axis * h;
    let floor = rim.iter().map(|p| p.1).fold(f64::INFINITY, f64::min) - POCKET_DEPTH;
    let deep = rim.iter().map(|p| p.1).sum::<f64>() / rim.len() as f64 - floor;
    let ring = Ring { vertices: rim.iter().map(|p| p.2).collect(), angles: rim.iter().map(|p| p.0).collect() };
    let (wide, middle) = (pocket.radius, pocket.axis * floor);
    let ring = grow(
        &mut cut,
        (ring, None),
        step,
        deep,
        |_| TAU * wide,
        |s, a| on(wide, a, height(a) + (floor - height(a)) * s),
    );
    if pocket.holed {
        let radius = |s: f64| wide + (HOLE - wide) * s;
        let ring = grow(&mut cut, (ring, None), step, wide - HOLE, |s| TAU * radius(s), |s, a| on(radius(s), a, floor));
        let ring =
            grow(&mut cut, (ring, None), step, HOLE_DEPTH, |_| TAU * HOLE, |s, a| on(HOLE, a, floor - s * HOLE_DEPTH));
        let bottom = floor - HOLE_DEPTH;
        grow_disk(&mut cut, ring, step, HOLE, pocket.axis * bottom, |a| on(HOLE, a, bottom));
    } else {
        grow_disk(&mut cut, ring, step, wide, middle, |a| on(wide, a, floor));
    }
    Some(cut)
}

/// The part of a closed mesh outside the cutter, and its outline, counter-clockwise seen from outside.
fn cut_out(mesh: &TriMesh, pocket: &Pocket) -> Option<(TriMesh, Vec<u32>)> {
    // 1. Slide near vertices along their nearest crossing edge.
    let mut points = mesh.points.clone();
    let mut level: Vec<f64> = points.iter().map(|&p| -pocket.outside(p)).collect();
    let mut nearest = vec![(SNAP, u32::MAX); points.len()];
    for t in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (t[k] as usize, t[(k + 1) % 3] as usize);
            if (level[a] < 0.0) != (level[b] < 0.0) {
                let s = level[a] / (level[a] - level[b]);
                nearest[a] = if s < nearest[a].0 { (s, b as u32) } else { nearest[a] };
                nearest[b] = if 1.0 - s < nearest[b].0 { (1.0 - s, a as u32) } else { nearest[b] };
            }
        }
    }
    for (v, &(s, other)) in nearest.iter().enumerate() {
        if other != u32::MAX {
            points[v] = pocket.on_wall(mesh.points[v].lerp(mesh.points[other as usize], s));
            level[v] = 0.0;
        }
    }
    // 2. Split the other crossing edges, keep what is outside.
    let mut splits: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let mut kept = Vec::new();
    for &t in &mesh.triangles {
        let sign = t.map(|v| level[v as usize].partial_cmp(&0.0).map_or(0, |o| o as i8));
        if sign.iter().all(|&s| s >= 0) {
            continue;
        }
        let mut polygon = Vec::new();
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            if sign[k] <= 0 {
                polygon.push(a);
            }
            if sign[k] * sign[(k + 1) % 3] < 0 {
                let key = (a.min(b), a.max(b));
                polygon.push(*splits.entry(key).or_insert_with(|| {
                    let (p, q) = (points[key.0 as usize], points[key.1 as usize]);
                    let s = level[key.0 as usize] / (level[key.0 as usize] - level[key.1 as usize]);
                    points.push(pocket.on_wall(p.lerp(q, s)));
                    points.len() as u32 - 1
                }));
            }
        }
        match *polygon {
            [a, b, c] => kept.push([a, b, c]),
            [a, b, c, d] => {
                let at = |v: u32| points[v as usize];
                let shorter = at(a).distance_squared(at(c)) <= at(b).distance_squared(at(d));
                kept.extend(if shorter { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
            }
            _ => {}
        }
    }
    // 3. Drop unused vertices, walk the outline.
    let mut ids = vec![u32::MAX; points.len()];
    let mut used = Vec::new();
    for t in &mut kept {
        for v in t {
            if ids[*v as usize] == u32::MAX {
                ids[*v as usize] = used.len() as u32;
                used.push(points[*v as usize]);
            }
            *v = ids[*v as usize];
        }
    }
    let cut = TriMesh::new(used, kept);
    let adjacency = Adjacency::new(&cut);
    let open: Vec<u32> =
        (0..adjacency.opposite.len() as u32).filter(|&h| adjacency.opposite[h as usize] == NONE).collect();
    let from = |h: u32| cut.triangles[h as usize / 3][h as usize % 3];
    let after: BTreeMap<u32, u32> = open.iter().map(|&h| (from(h), from(next(h)))).collect();
    let start = from(*open.first()?);
    let mut outline = vec![start];
    let mut v = *after.get(&start)?;
    while v != start && outline.len() <= open.len() {
        outline.push(v);
        v = *after.get(&v)?;
    }
    // The body lies on the left of its open edges; seen from outside that is clockwise.
    outline.reverse();
    (outline.len() == open.len()).then_some((cut, outline))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::diagnose;

    #[test]
    fn demo_is_closed_of_genus_1_near_the_wanted_size_with_even_triangles_for_20_seeds() {
        for seed in 0..20 {
            let mesh = demo(seed, 20_000);
            let found = diagnose(&mesh);
            assert!(found.manifold && found.watertight, "seed {seed}");
            assert_eq!(found.euler, 0, "seed {seed}");
            assert!((mesh.triangles.len() as f64 / 20_000.0 - 1.0).abs() < 0.03, "{}", mesh.triangles.len());
            let volume: f64 =
                (0..mesh.triangles.len()).map(|t| mesh.corners(t)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
            assert!(volume > 2.0);
            let mut edges: Vec<f64> = Vec::new();
            for t in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(t);
                edges.extend([a.distance(b), b.distance(c), c.distance(a)]);
            }
            edges.sort_by(f64::total_cmp);
            let (low, middle, high) = (edges[0], edges[edges.len() / 2], edges[edges.len() - 1]);
            assert!(low > 0.15 * middle && high < 3.0 * middle, "seed {seed}: {low} {middle} {high}");
        }
    }

    #[test]
    fn demo_has_12_closed_sharp_lines_over_40_degrees_for_20_seeds() {
        for seed in 0..20 {
            let mesh = demo(seed, 20_000);
            let adjacency = Adjacency::new(&mesh);
            let sharp = crate::mesh::sharp_edges(&mesh, &adjacency, 40.0);
            // Every vertex of a sharp line has two sharp edges: the lines are closed, without gap or branch.
            let mut degree = vec![0; mesh.points.len()];
            let mut lines = crate::mesh::sets::Sets::new(mesh.points.len());
            for h in (0..sharp.len() as u32).filter(|&h| sharp[h as usize]) {
                degree[mesh.origin(h) as usize] += 1;
                lines.join(mesh.origin(h), mesh.origin(crate::mesh::next(h)));
            }
            assert!(degree.iter().all(|&d| d == 0 || d == 2), "seed {seed}");
            let roots = (0..mesh.points.len() as u32).filter(|&v| degree[v as usize] > 0 && lines.root(v) == v);
            // Two outlines, two circles each of counterbore and bore, of two pockets their rim and floor, of the
            // hole its mouth and floor; the mouth of the bore lies in the counterbore's floor.
            assert_eq!(roots.count(), 2 + 4 + 4 + 2, "seed {seed}");
        }
    }
}
