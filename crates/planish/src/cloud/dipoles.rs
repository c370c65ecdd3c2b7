//! The winding number of oriented samples.
//!
//! Barill, Dickson, Schmidt, Levin, Jacobson, *Fast Winding Numbers for Soups and Clouds*, 2018: a sample of area A and
//! normal n adds A (c - p)·n / (4 pi |c - p|^3); far groups count as one dipole and one quadrupole: of the two sides of a
//! plate the dipoles cancel, and on a thin body the number is short by a tenth without the next term.

use glam::DVec3;
use std::f64::consts::PI;

/// A group counts as one from this many of its radii on: right to about 1e-2.
const FAR: f64 = 2.0;
/// And so much is left between a side that is sure and one half.
const ROUGH: f64 = 0.02;
/// Samples in a leaf at most.
const LEAF: usize = 8;

/// A tree of dipoles.
#[derive(Clone, Debug, Default)]
pub struct Dipoles {
    nodes: Vec<Node>,
    centers: Vec<DVec3>,
    moments: Vec<DVec3>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    center: DVec3,
    radius: f64,
    moment: DVec3,
    /// Symmetric part without trace of the moments times their places: xx, yy, zz, yz, zx, xy.
    second_moment: [f64; 6],
    first: u32,
    count: u32,
    second: u32,
}

impl Dipoles {
    /// A tree over samples: centre and normal times area.
    pub fn new(samples: &[(DVec3, DVec3)]) -> Dipoles {
        let mut items = samples.to_vec();
        let mut nodes = Vec::new();
        if !items.is_empty() {
            build(&mut items, 0, &mut nodes);
        }
        Dipoles { nodes, centers: items.iter().map(|i| i.0).collect(), moments: items.iter().map(|i| i.1).collect() }
    }

    /// The winding number at `p`: about one inside, zero outside. Samples within `skip` of `p` are left out; their
    /// plane adds one half to one side and takes it from the other.
    pub fn number(&self, p: DVec3, skip: f64) -> f64 {
        let mut sum = 0.0;
        let mut stack = [0u32; 64];
        let mut top = usize::from(!self.nodes.is_empty());
        let term = |c: DVec3, m: DVec3| {
            let away = c - p;
            let d2 = away.length_squared();
            if d2 > 0.0 { m.dot(away) / (d2 * d2.sqrt()) } else { 0.0 }
        };
        while top > 0 {
            top -= 1;
            let at = stack[top] as usize;
            let node = &self.nodes[at];
            let d = node.center.distance(p);
            if d > FAR * node.radius && d > node.radius + skip {
                sum += term(node.center, node.moment) + node.quadrupole(node.center - p, d);
            } else if node.second == 0 {
                for i in node.first as usize..(node.first + node.count) as usize {
                    if self.centers[i].distance_squared(p) > skip * skip {
                        sum += term(self.centers[i], self.moments[i]);
                    }
                }
            } else {
                stack[top] = node.second;
                stack[top + 1] = at as u32 + 1;
                top += 2;
            }
        }
        sum / (4.0 * PI)
    }

    /// The side of all points within `radius` of `p`: 1 outside, -1 inside; `None` if the number may pass one half there.
    ///
    /// The number of a dipole m at distance d changes by at most 2 |m| / (4 pi d^3) per length, that of a quadrupole S by
    /// 9 |S| / (4 pi d^4).
    pub fn side(&self, p: DVec3, radius: f64) -> Option<f64> {
        let (mut sum, mut change) = (0.0, 0.0);
        let mut add = |c: DVec3, m: DVec3, of: Option<&Node>| {
            let away = c - p;
            let d = away.length();
            sum += m.dot(away) / (d * d * d);
            change += if d > radius { m.length() / (d - radius).powi(3) } else { f64::INFINITY };
            if let Some(node) = of {
                sum += node.quadrupole(away, d);
                change += 4.5 * node.second_length() / (d - radius).powi(4);
            }
            // More than from the inside to the outside.
            2.0 * radius * change < 4.0 * PI
        };
        let mut stack = [0u32; 64];
        let mut top = usize::from(!self.nodes.is_empty());
        while top > 0 {
            top -= 1;
            let at = stack[top] as usize;
            let node = &self.nodes[at];
            if node.center.distance(p) > FAR * node.radius + radius {
                if !add(node.center, node.moment, Some(node)) {
                    return None;
                }
            } else if node.second == 0 {
                let own = node.first as usize..(node.first + node.count) as usize;
                if !own.into_iter().all(|i| add(self.centers[i], self.moments[i], None)) {
                    return None;
                }
            } else {
                stack[top] = node.second;
                stack[top + 1] = at as u32 + 1;
                top += 2;
            }
        }
        let beyond = 0.5 - sum / (4.0 * PI);
        (beyond.abs() > 2.0 * radius * change / (4.0 * PI) + ROUGH).then_some(beyond.signum())
    }
}

impl Node {
    /// What the places of the dipoles add to their sum: -3 x S x / |x|^5.
    fn quadrupole(&self, x: DVec3, d: f64) -> f64 {
        let [xx, yy, zz, yz, zx, xy] = self.second_moment;
        let diagonal = xx * x.x * x.x + yy * x.y * x.y + zz * x.z * x.z;
        let mixed = yz * x.y * x.z + zx * x.z * x.x + xy * x.x * x.y;
        -3.0 * (diagonal + 2.0 * mixed) / d.powi(5)
    }

    fn second_length(&self) -> f64 {
        let square = |k: usize| self.second_moment[k] * self.second_moment[k];
        (square(0) + square(1) + square(2) + 2.0 * (square(3) + square(4) + square(5))).sqrt()
    }
}

fn build(items: &mut [(DVec3, DVec3)], first: usize, nodes: &mut Vec<Node>) {
    let at = nodes.len();
    let (mut center, mut weight, mut moment) = (DVec3::ZERO, 0.0, DVec3::ZERO);
    for (c, m) in items.iter() {
        let w = m.length();
        center += *c * w;
        weight += w;
        moment += *m;
    }
    center = if weight > 0.0 { center / weight } else { items[0].0 };
    let radius = items.iter().map(|i| i.0.distance(center)).fold(0.0, f64::max);
    let mut second = [0.0; 6];
    for (c, m) in items.iter() {
        let x = *c - center;
        let third = m.dot(x) / 3.0;
        let mixed = [m.y * x.z + m.z * x.y, m.z * x.x + m.x * x.z, m.x * x.y + m.y * x.x].map(|s| s / 2.0);
        let own = [m.x * x.x - third, m.y * x.y - third, m.z * x.z - third, mixed[0], mixed[1], mixed[2]];
        second.iter_mut().zip(own).for_each(|(s, o)| *s += o);
    }
    nodes.push(Node {
        center,
        radius,
        moment,
        second_moment: second,
        first: first as u32,
        count: items.len() as u32,
        second: 0,
    });
    if items.len() <= LEAF {
        return;
    }
    let bounds = crate::geom::Aabb::of(items.iter().map(|i| &i.0));
    let size = bounds.size();
    let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    let mid = items.len() / 2;
    items.select_nth_unstable_by(mid, |a, b| {
        let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
        a.0[axis].total_cmp(&b.0[axis]).then(a.0[i].total_cmp(&b.0[i])).then(a.0[j].total_cmp(&b.0[j]))
    });
    let (a, b) = items.split_at_mut(mid);
    build(a, first, nodes);
    nodes[at].second = nodes.len() as u32;
    build(b, first + mid, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Centres and normals times areas of a unit sphere.
    fn sphere() -> Vec<(DVec3, DVec3)> {
        let n = 2000;
        let golden = PI * (3.0 - 5f64.sqrt());
        (0..n)
            .map(|k| {
                let z = 1.0 - (2 * k + 1) as f64 / n as f64;
                let (s, c) = (k as f64 * golden).sin_cos();
                let p = DVec3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z);
                (p, p * (4.0 * PI / n as f64))
            })
            .collect()
    }

    #[test]
    fn winding_of_2000_samples_of_a_sphere_is_one_inside_and_zero_outside_within_0_04() {
        let samples = sphere();
        let tree = Dipoles::new(&samples);
        for (p, w) in [(DVec3::ZERO, 1.0), (DVec3::new(0.4, -0.3, 0.5), 1.0), (DVec3::new(1.3, 0.4, 0.0), 0.0)] {
            assert!((tree.number(p, 0.0) - w).abs() < 0.04, "{p} {}", tree.number(p, 0.0));
        }
        // On the surface itself half of the sphere remains.
        assert!((tree.number(samples[700].0, 0.1) - 0.5).abs() < 0.06);
    }

    #[test]
    fn balls_beside_a_sphere_have_one_side_and_those_that_meet_it_have_none() {
        let tree = Dipoles::new(&sphere());
        for (p, radius, side) in [
            (DVec3::ZERO, 0.1, Some(-1.0)),
            (DVec3::new(0.0, 0.6, 0.0), 0.05, Some(-1.0)),
            (DVec3::new(1.4, 0.0, 0.4), 0.1, Some(1.0)),
            (DVec3::new(9.0, 0.0, 0.0), 4.0, Some(1.0)),
            (DVec3::new(0.9, 0.0, 0.0), 0.2, None),
            (DVec3::ZERO, 1.5, None),
        ] {
            assert_eq!(tree.side(p, radius), side, "{p} {radius}");
        }
    }
}
