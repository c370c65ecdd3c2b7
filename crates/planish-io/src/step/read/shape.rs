//! Curves and surfaces of a STEP file: places at parameters, and parameters of places.
//!
//! Parameters are those of ISO 10303-42: angles around an axis from the first direction of its placement, heights along it.

use super::spline::{SplineCurve, SplineSurface};
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// A place with three axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub origin: DVec3,
    pub axes: DMat3,
}

impl Frame {
    fn local(&self, p: DVec3) -> DVec3 {
        self.axes.transpose() * (p - self.origin)
    }

    fn world(&self, p: DVec3) -> DVec3 {
        self.origin + self.axes * p
    }
}

/// A curve.
#[derive(Clone, Debug)]
pub(super) enum Curve {
    Line {
        origin: DVec3,
        along: DVec3,
    },
    /// A circle has two equal radii.
    Ellipse {
        frame: Frame,
        radii: [f64; 2],
    },
    Polyline(Vec<DVec3>),
    Spline(SplineCurve),
}

impl Curve {
    /// The range of its parameter, infinite for a line.
    pub fn range(&self) -> [f64; 2] {
        match self {
            Curve::Line { .. } => [f64::NEG_INFINITY, f64::INFINITY],
            Curve::Ellipse { .. } => [0.0, TAU],
            Curve::Polyline(points) => [0.0, (points.len() - 1) as f64],
            Curve::Spline(spline) => spline.basis.range(),
        }
    }

    pub fn at(&self, t: f64) -> DVec3 {
        match self {
            Curve::Line { origin, along } => *origin + *along * t,
            Curve::Ellipse { frame, radii: [a, b] } => frame.world(DVec3::new(a * t.cos(), b * t.sin(), 0.0)),
            Curve::Polyline(points) => {
                let k = (t.max(0.0) as usize).min(points.len() - 2);
                points[k].lerp(points[k + 1], t - k as f64)
            }
            Curve::Spline(spline) => spline.at(t).0,
        }
    }

    /// The length of its parameter after which a closed curve repeats.
    pub fn period(&self) -> Option<f64> {
        let [from, to] = self.range();
        let is_closed = (to - from).is_finite() && {
            let away = |k: usize| self.at(from + (to - from) * k as f64 / 8.0).distance(self.at(from));
            away(8) <= CLOSED * (1..8).map(away).fold(0.0, f64::max)
        };
        is_closed.then_some(to - from)
    }

    /// Parameters at which its shape may change.
    pub fn breaks(&self) -> Vec<f64> {
        match self {
            Curve::Line { .. } => Vec::new(),
            Curve::Ellipse { .. } => (0..=4).map(|k| k as f64 * FRAC_PI_2).collect(),
            Curve::Polyline(points) => (0..points.len()).map(|k| k as f64).collect(),
            Curve::Spline(spline) => spline.basis.breaks(),
        }
    }

    /// The parameter of the place nearest to `p`.
    pub fn parameter(&self, p: DVec3) -> f64 {
        match self {
            Curve::Line { origin, along } => (p - *origin).dot(*along) / along.length_squared(),
            Curve::Ellipse { frame, radii: [a, b] } => {
                let q = frame.local(p);
                (q.y / b).atan2(q.x / a).rem_euclid(TAU)
            }
            Curve::Polyline(_) | Curve::Spline(_) => nearest_parameter(self, |t| self.at(t).distance_squared(p)),
        }
    }
}

/// Distance of the ends of a closed curve, or of the sides of a surface closed along it, of its size.
pub(super) const CLOSED: f64 = 1e-9;
/// Places of a span from which the nearest one is looked for.
const SEEDS: usize = 4;
/// Steps of the golden section: to a part in 1e11 of two seeds.
const SECTIONS: usize = 54;
/// Steps of Gauss and Newton towards the nearest place of a surface.
const NEWTON_STEPS: usize = 30;

/// A surface.
#[derive(Clone, Debug)]
pub(super) enum Surface {
    Plane(Frame),
    /// A cylinder, and a cone with a slope of its radius along the axis.
    Cone {
        frame: Frame,
        radius: f64,
        slope: f64,
    },
    /// A sphere has a `major` radius of 0.
    Torus {
        frame: Frame,
        major: f64,
        minor: f64,
    },
    /// `u` turns about an axis through the frame's origin, `v` is the curve's parameter.
    Revolution {
        frame: Frame,
        curve: Curve,
    },
    /// `u` is the curve's parameter, `v` goes along a direction.
    Extrusion {
        curve: Curve,
        along: DVec3,
    },
    /// With what is closed along `u` and `v`.
    Spline {
        spline: SplineSurface,
        closed: [bool; 2],
    },
}

impl Surface {
    /// The lengths after which its parameters repeat.
    pub fn periods(&self) -> [Option<f64>; 2] {
        match self {
            Surface::Plane(_) | Surface::Extrusion { curve: Curve::Line { .. }, .. } => [None, None],
            Surface::Cone { .. } => [Some(TAU), None],
            Surface::Torus { major: 0.0, .. } => [Some(TAU), None],
            Surface::Torus { .. } => [Some(TAU), Some(TAU)],
            Surface::Revolution { curve, .. } => [Some(TAU), curve.period()],
            Surface::Extrusion { curve, .. } => [curve.period(), None],
            Surface::Spline { spline, closed } => [0, 1].map(|k| {
                let [from, to] = spline.basis[k].range();
                closed[k].then_some(to - from)
            }),
        }
    }

    /// Ends of its parameters.
    pub fn ranges(&self) -> [[f64; 2]; 2] {
        const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
        match self {
            Surface::Plane(_) => [ALL, ALL],
            Surface::Cone { .. } => [[0.0, TAU], ALL],
            Surface::Torus { major: 0.0, .. } => [[0.0, TAU], [-FRAC_PI_2, FRAC_PI_2]],
            Surface::Torus { .. } => [[0.0, TAU], [0.0, TAU]],
            Surface::Revolution { curve, .. } => [[0.0, TAU], curve.range()],
            Surface::Extrusion { curve, .. } => [curve.range(), ALL],
            Surface::Spline { spline, .. } => [0, 1].map(|k| spline.basis[k].range()),
        }
    }

    /// Parameters at which its shape may change, along `u` and `v`.
    pub fn breaks(&self, axis: usize) -> Vec<f64> {
        match self {
            Surface::Revolution { curve, .. } if axis == 1 => curve.breaks(),
            Surface::Extrusion { curve, .. } if axis == 0 => curve.breaks(),
            Surface::Spline { spline, .. } => spline.basis[axis].breaks(),
            _ => Vec::new(),
        }
    }

    /// True if the lines of its parameters need not run along its principal directions.
    pub fn twists(&self) -> bool {
        matches!(self, Surface::Spline { .. } | Surface::Revolution { .. })
    }

    /// Parameters that repeat, brought into their range.
    fn within(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let (periods, ranges) = (self.periods(), self.ranges());
        let one = |k: usize, t: f64| match periods[k] {
            Some(period) if t < ranges[k][0] || t > ranges[k][1] => {
                ranges[k][0] + (t - ranges[k][0]).rem_euclid(period)
            }
            _ => t,
        };
        [one(0, u), one(1, v)]
    }

    pub fn at(&self, uv: [f64; 2]) -> DVec3 {
        let [u, v] = self.within(uv);
        match self {
            Surface::Plane(frame) => frame.world(DVec3::new(u, v, 0.0)),
            Surface::Cone { frame, radius, slope } => {
                let r = radius + slope * v;
                frame.world(DVec3::new(r * u.cos(), r * u.sin(), v))
            }
            Surface::Torus { frame, major, minor } => {
                let r = major + minor * v.cos();
                frame.world(DVec3::new(r * u.cos(), r * u.sin(), minor * v.sin()))
            }
            Surface::Revolution { frame, curve } => {
                let p = frame.local(curve.at(v));
                frame.world(DMat3::from_rotation_z(u) * p)
            }
            Surface::Extrusion { curve, along } => curve.at(u) + *along * v,
            Surface::Spline { spline, .. } => spline.at([u, v]).0,
        }
    }

    /// Parameters of the place nearest to `p`; `near` are those of a place beside it.
    pub fn parameters(&self, p: DVec3, near: Option<[f64; 2]>) -> [f64; 2] {
        match self {
            Surface::Plane(frame) => {
                let q = frame.local(p);
                [q.x, q.y]
            }
            Surface::Cone { frame, .. } => {
                let q = frame.local(p);
                [q.y.atan2(q.x).rem_euclid(TAU), q.z]
            }
            Surface::Torus { frame, major, .. } => {
                let q = frame.local(p);
                let away = q.truncate().length() - major;
                let v = q.z.atan2(away);
                [q.y.atan2(q.x).rem_euclid(TAU), if *major == 0.0 { v } else { v.rem_euclid(TAU) }]
            }
            Surface::Revolution { frame, curve } => {
                // Distances from the axis and heights do not depend on the turn.
                let q = frame.local(p);
                let at = |v: f64| frame.local(curve.at(v));
                let flat = |r: DVec3| DVec2::new(r.truncate().length(), r.z);
                let v = nearest_parameter(curve, |t| flat(at(t)).distance_squared(flat(q)));
                let turn = |r: DVec3| r.y.atan2(r.x);
                [(turn(q) - turn(at(v))).rem_euclid(TAU), v]
            }
            Surface::Extrusion { curve, along } => {
                let n = along.normalize();
                let flat = |q: DVec3| q - n * q.dot(n);
                let u = match curve {
                    Curve::Line { origin, along: line } => {
                        let (d, line) = (flat(p - *origin), flat(*line));
                        d.dot(line) / line.length_squared()
                    }
                    _ => nearest_parameter(curve, |t| flat(curve.at(t) - p).length_squared()),
                };
                [u, (p - curve.at(u)).dot(*along) / along.length_squared()]
            }
            Surface::Spline { spline, closed } => nearest_on(spline, *closed, p, near),
        }
    }

    /// The direction (0 for `u`, 1 for `v`) that has no value at this place: at a pole, the tip of a cone, a side that is a point.
    pub fn undefined(&self, [u, v]: [f64; 2], tolerance: f64) -> Option<usize> {
        let ranges = self.ranges();
        match self {
            Surface::Plane(_) | Surface::Extrusion { .. } => None,
            Surface::Cone { radius, slope, .. } => ((radius + slope * v).abs() <= tolerance).then_some(0),
            Surface::Torus { major, minor, .. } => (major + minor * v.cos() <= tolerance).then_some(0),
            Surface::Revolution { frame, curve } => {
                (frame.local(curve.at(v)).truncate().length() <= tolerance).then_some(0)
            }
            Surface::Spline { .. } => {
                let is_point = |axis: usize| {
                    let (at, [from, to]) = ([u, v][1 - axis], ranges[axis]);
                    let [low, high] = ranges[1 - axis];
                    let is_end = (at - low).min(high - at) <= 1e-6 * (high - low);
                    let place = |t: f64| self.at(if axis == 0 { [t, at] } else { [at, t] });
                    is_end
                        && [0.25, 0.5, 0.75, 1.0]
                            .iter()
                            .all(|k| place(from).distance(place(from + k * (to - from))) <= tolerance)
                };
                (0..2).find(|&axis| is_point(axis))
            }
        }
    }
}

/// The parameter of a curve of finite range at which `away` is least.
fn nearest_parameter(curve: &Curve, away: impl Fn(f64) -> f64) -> f64 {
    let breaks = match curve {
        // A line has no ends: what is nearest follows from two places, since `away` is a parabola.
        Curve::Line { .. } => {
            let [a, b, c] = [-1.0, 0.0, 1.0].map(&away);
            let bend = a - 2.0 * b + c;
            return if bend > 0.0 { (a - c) / (2.0 * bend) } else { 0.0 };
        }
        _ => curve.breaks(),
    };
    let step = |w: &[f64]| {
        let [a, b] = [w[0], w[1]];
        (0..SEEDS).map(move |k| a + (b - a) * k as f64 / SEEDS as f64)
    };
    let mut starts: Vec<f64> = breaks.windows(2).flat_map(step).collect();
    starts.push(breaks[breaks.len() - 1]);
    let values: Vec<f64> = starts.iter().map(|&t| away(t)).collect();
    let nearest = (0..starts.len()).min_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
    let mut range = [starts[nearest.saturating_sub(1)], starts[(nearest + 1).min(starts.len() - 1)]];
    // Golden section.
    let ratio = (5f64.sqrt() - 1.0) / 2.0;
    for _ in 0..SECTIONS {
        let [a, b] = range;
        let (low, high) = (b - ratio * (b - a), a + ratio * (b - a));
        range = if away(low) <= away(high) { [a, high] } else { [low, b] };
    }
    // An end is met exactly.
    let middle = (range[0] + range[1]) / 2.0;
    [middle, starts[0], starts[starts.len() - 1]]
        .into_iter()
        .min_by(|&a, &b| away(a).total_cmp(&away(b)))
        .unwrap_or(middle)
}

/// Parameters of the place of a spline surface nearest to `p`.
fn nearest_on(spline: &SplineSurface, closed: [bool; 2], p: DVec3, near: Option<[f64; 2]>) -> [f64; 2] {
    let ranges = [0, 1].map(|k| spline.basis[k].range());
    // Past the end of a closed direction is its start.
    let within = |k: usize, t: f64| {
        let [from, to] = ranges[k];
        if closed[k] && !(from..=to).contains(&t) { from + (t - from).rem_euclid(to - from) } else { t.clamp(from, to) }
    };
    let refined = |mut uv: [f64; 2]| {
        let mut best = (spline.at(uv).0.distance(p), uv);
        for _ in 0..NEWTON_STEPS {
            let (place, [du, dv]) = spline.at(uv);
            let off = p - place;
            let (a, b, c) = (du.length_squared(), du.dot(dv), dv.length_squared());
            let (f, g) = (off.dot(du), off.dot(dv));
            let det = a * c - b * b;
            let step = if det > 1e-12 * a * c {
                [(c * f - b * g) / det, (a * g - b * f) / det]
            } else {
                [over(f, a), over(g, c)]
            };
            let next = [0, 1].map(|k| within(k, uv[k] + step[k]));
            let moved = (0..2).map(|k| (next[k] - uv[k]).abs() / (ranges[k][1] - ranges[k][0])).fold(0.0, f64::max);
            uv = next;
            let away = spline.at(uv).0.distance(p);
            if away < best.0 {
                best = (away, uv);
            }
            if moved < 1e-14 {
                break;
            }
        }
        best
    };
    let size = spline.control.iter().map(|c| (c.truncate() / c.w).distance(p)).fold(0.0, f64::max);
    if let Some(near) = near {
        let (away, uv) = refined([0, 1].map(|k| within(k, near[k])));
        if away <= NEAR * size {
            return uv;
        }
    }
    // From the places of a grid that are nearest.
    let seeds = |axis: usize| -> Vec<f64> {
        let breaks = spline.basis[axis].breaks();
        let steps = spline.basis[axis].degree;
        let step = |w: &[f64]| {
            let [a, b] = [w[0], w[1]];
            (0..steps).map(move |k| a + (b - a) * k as f64 / steps as f64)
        };
        let mut all: Vec<f64> = breaks.windows(2).flat_map(step).collect();
        all.push(breaks[breaks.len() - 1]);
        all
    };
    let (us, vs) = (seeds(0), seeds(1));
    let mut starts: Vec<(f64, [f64; 2])> = us
        .iter()
        .flat_map(|&u| vs.iter().map(move |&v| [u, v]))
        .map(|uv| (spline.at(uv).0.distance_squared(p), uv))
        .collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    starts.truncate(STARTS);
    starts.into_iter().map(|(_, uv)| refined(uv)).min_by(|a, b| a.0.total_cmp(&b.0)).map_or([0.0; 2], |(_, uv)| uv)
}

fn over(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 0.0 }
}

/// Share of the size of a surface within which a place beside the last one is taken for the right one.
const NEAR: f64 = 1e-5;
/// Places of a grid from which the nearest is looked for.
const STARTS: usize = 4;
