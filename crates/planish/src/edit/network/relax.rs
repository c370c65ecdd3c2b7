//! Curves of a network as snakes: dragged, relaxed, held, or given another course.
//!
//! [K98] §3.8: an edit point and an edit section around it; the rest of the curve stays bit for bit.

use super::{EditError, Editor};
use crate::curve::{CurveError, Relaxed, ScalarField, Section, Snake, SnakeParams, SurfaceCurve, between};
use crate::mesh::FacePoint;
use crate::observe::Observer;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Places beside a section that tell it how the rest of its curve runs.
const PLACES_BESIDE_SECTION: usize = 2;

/// A closed curve shorter than this many mean edges is none.
const SHORTEST_LOOP: f64 = 3.0;

/// A stretch of a curve with weights of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stretch {
    /// Its start as a share of the length of the curve.
    pub from: f64,
    /// Its end as a share of the length.
    pub to: f64,
    /// Factor on the weight of fairness.
    #[serde(default = "one")]
    pub fairness: f64,
    /// Factor on the weight of curvature.
    #[serde(default = "one")]
    pub curvature: f64,
}

fn one() -> f64 {
    1.0
}

/// What a relaxation is told besides its weights; all shares are of the length of the whole curve.
#[derive(Clone, Copy, Debug, Default)]
pub struct Holds<'a> {
    /// Middle and width of the section that moves; nothing for all of the curve.
    pub section: Option<(f64, f64)>,
    /// A scalar that draws the curve.
    pub field: Option<&'a ScalarField>,
    /// Where the curve stays where it is.
    pub pins: &'a [f64],
    /// Stretches with weights of their own.
    pub stiffness: &'a [Stretch],
}

impl<'m> Editor<'m> {
    /// Moves a corner to a place; the curves that end there follow, each relaxed over `reach` (0 to 1) of its length.
    /// A corner between two curves along a sharp edge or the boundary slides along them, to the place nearest to `to`.
    /// Returns the curves that relaxed and how.
    /// # Errors
    /// `NoSuchPart`; `Fixed` and `Meets` for a corner that slides; `Curve`.
    pub fn drag_corner(
        &mut self,
        corner: u32,
        to: FacePoint,
        reach: f64,
        params: &SnakeParams,
        observer: &dyn Observer,
    ) -> Result<Vec<(u32, Relaxed)>, EditError> {
        self.corner(corner)?;
        let faces = self.mesh.triangles.len();
        if to.face as usize >= faces {
            return Err(CurveError::NoSuchFace { face: to.face, faces }.into());
        }
        let slid = self.slide(corner, to.position(self.mesh))?;
        let to = slid.as_ref().map_or(to, |s| s.place);
        let mut curves: Vec<u32> = self.ends_at(corner).iter().map(|e| e / 2).collect();
        curves.dedup();
        curves.retain(|&c| self.network.curves[c as usize].kind.is_smooth());
        let mut moved = Vec::with_capacity(curves.len());
        for &c in &curves {
            let curve = self.movable(c)?;
            let even = self.sampled(&SurfaceCurve::open(curve.points.clone()))?;
            let n = even.points.len();
            let count = ((reach.clamp(0.0, 1.0) * n as f64).ceil() as usize).clamp(3.min(n), n);
            let mut points = even.points;
            // Every place of the reach goes part of the way first: a snake then has nothing to untangle.
            for (end, k) in curve.corners.iter().enumerate() {
                if *k != corner {
                    continue;
                }
                let old = if end == 0 { points[0] } else { points[n - 1] };
                let shift = to.position(self.mesh) - old.position(self.mesh);
                for i in 1..count - 1 {
                    let at = if end == 0 { i } else { n - 1 - i };
                    let share = 1.0 - i as f64 / (count - 1) as f64;
                    points[at] =
                        crate::mesh::move_point_on_surface(self.mesh, self.adjacency, points[at], shift * share);
                }
                points[if end == 0 { 0 } else { n - 1 }] = to;
            }
            let mut snake = Snake::new(self.mesh, self.adjacency, &SurfaceCurve::open(points))?;
            if curve.corners[0] != curve.corners[1] && count < n {
                let first = if curve.corners[0] == corner { 0 } else { n - count };
                snake.edit_section(first, count)?;
            }
            let relaxed = snake.relax(params, observer)?;
            moved.push((c, relaxed, snake.curve().trace(self.mesh, self.adjacency)?));
        }
        self.network.corners[corner as usize].place = to;
        for (c, points) in slid.into_iter().flat_map(|s| s.curves) {
            self.network.curves[c as usize].points = points;
        }
        let mut told = Vec::with_capacity(moved.len());
        for (c, relaxed, points) in moved {
            self.network.curves[c as usize].points = points;
            told.push((c, relaxed));
        }
        Ok(told)
    }

    /// Pulls a curve: its point at `share` of its length goes by `force` (world units, along the surface), the section
    /// of `holds` relaxes, the rest stays as it is. The scalar of `holds` is of no use here.
    /// # Errors
    /// `NoSuchPart`, `Bound`, `AtEnd` for a share outside 0 to 1, `Curve`.
    /// Source: [K98] §3.8.1.
    pub fn drag_curve(
        &mut self,
        curve: u32,
        (share, force): (f64, DVec3),
        holds: &Holds,
        params: &SnakeParams,
        observer: &dyn Observer,
    ) -> Result<Relaxed, EditError> {
        self.movable(curve)?;
        if !(share > 0.0 && share < 1.0) {
            return Err(EditError::AtEnd { curve });
        }
        self.resnake(curve, share, holds, |snake, edit| {
            snake.drag(edit, force)?;
            let relaxed = snake.relax(params, observer)?;
            snake.pin(edit, false)?;
            Ok(relaxed)
        })
    }

    /// Relaxes a curve, or a section of it, under `params`. A closed curve whose corner has no other curves moves
    /// with its corner.
    /// # Errors
    /// `NoSuchPart`, `Bound`, `Curve`, `Shrunk`.
    pub fn relax_curve(
        &mut self,
        curve: u32,
        holds: &Holds,
        params: &SnakeParams,
        observer: &dyn Observer,
    ) -> Result<Relaxed, EditError> {
        self.movable(curve)?;
        let middle = holds.section.map_or(0.5, |s| s.0);
        if holds.section.is_none() && self.is_free_loop(curve) {
            return self.relax_loop(curve, holds, params, observer);
        }
        self.resnake(curve, middle, holds, |snake, _| snake.relax(params, observer))
    }

    /// True for a closed curve whose corner ends no other.
    fn is_free_loop(&self, curve: u32) -> bool {
        let [a, b] = self.network.curves[curve as usize].corners;
        a == b && self.ends_at(a).len() == 2
    }

    /// The course of a curve: closed where it is a loop that no other curve ends on.
    pub fn course(&self, curve: u32) -> SurfaceCurve {
        let mut points = self.network.curves[curve as usize].points.clone();
        let closed = self.is_free_loop(curve) && points.len() > 3;
        if closed {
            points.pop();
        }
        SurfaceCurve { points, closed }
    }

    fn relax_loop(
        &mut self,
        curve: u32,
        holds: &Holds,
        params: &SnakeParams,
        observer: &dyn Observer,
    ) -> Result<Relaxed, EditError> {
        let even = self.sampled(&self.course(curve))?;
        let n = even.points.len();
        let mut snake = self.held(&even, holds, |share| (share * n as f64).round() as usize % n)?;
        let relaxed = snake.relax(params, observer)?;
        self.replace_curve(curve, &snake.curve())?;
        Ok(relaxed)
    }

    /// A snake with the holds of a relaxation; `index` tells the point at a share of the length.
    fn held<'f>(
        &self,
        even: &SurfaceCurve,
        holds: &Holds<'f>,
        index: impl Fn(f64) -> usize,
    ) -> Result<Snake<'f>, CurveError>
    where
        'm: 'f,
    {
        let n = even.points.len();
        let mut snake = Snake::new(self.mesh, self.adjacency, even)?;
        if let Some(field) = holds.field {
            snake = snake.attracted_to(field)?;
        }
        for stretch in holds.stiffness {
            let first = index(stretch.from).min(n - 1);
            let last = if stretch.to >= 1.0 { n - 1 } else { index(stretch.to).min(n - 1) };
            let Stretch { fairness, curvature, .. } = *stretch;
            let count = (last + 1).saturating_sub(first);
            snake.stiffen(&Section { first, count, fairness, curvature })?;
        }
        for &pin in holds.pins {
            snake.pin(index(pin).min(n - 1), true)?;
        }
        Ok(snake)
    }

    /// Lets `work` change a curve as a snake; it is told the point at the share `middle`. Points outside the section
    /// stay as they are, bit for bit.
    fn resnake(
        &mut self,
        curve: u32,
        middle: f64,
        holds: &Holds,
        work: impl FnOnce(&mut Snake<'_>, usize) -> Result<Relaxed, CurveError>,
    ) -> Result<Relaxed, EditError> {
        let old = self.movable(curve)?;
        let at = self.positions(curve);
        let mut sums = vec![0.0];
        for w in at.windows(2) {
            sums.push(sums[sums.len() - 1] + w[0].distance(w[1]));
        }
        let total = sums[sums.len() - 1];
        let (center, width) = holds.section.unwrap_or((0.5, 1.0));
        // The points of the curve that bound the section.
        let low = (center - width / 2.0).max(0.0) * total;
        let high = (center + width / 2.0).min(1.0) * total;
        let first = sums.partition_point(|s| *s <= low).saturating_sub(1).min(at.len() - 2);
        let last = sums.partition_point(|s| *s < high).clamp(first + 1, at.len() - 1);
        let even = self.sampled(&SurfaceCurve::open(old.points[first..=last].to_vec()))?;
        let n = even.points.len();
        // Places before and behind, so that the section goes on smoothly from the rest.
        let spacing = (sums[last] - sums[first]) / (n - 1) as f64;
        let place = |s: f64| {
            let k = sums.partition_point(|x| *x <= s).clamp(1, at.len() - 1) - 1;
            let share = (s - sums[k]) / (sums[k + 1] - sums[k]).max(f64::MIN_POSITIVE);
            between(self.mesh, self.adjacency, &old.points[k], &old.points[k + 1], share.clamp(0.0, 1.0))
        };
        let steps =
            |room: f64| (1..=PLACES_BESIDE_SECTION).map(move |k| k as f64 * spacing).take_while(move |s| *s <= room);
        let mut points: Vec<FacePoint> = steps(sums[first]).map(|s| place(sums[first] - s)).collect();
        let before = points.len();
        points.reverse();
        points.extend(even.points);
        points.extend(steps(total - sums[last]).map(|s| place(sums[last] + s)));
        let index = |share: f64| {
            let at = ((share * total - sums[first]) / (sums[last] - sums[first])).clamp(0.0, 1.0);
            before + (at * (n - 1) as f64).round() as usize
        };
        let mut snake = self.held(&SurfaceCurve::open(points), holds, index)?;
        snake.edit_section(before, n)?;
        let relaxed = work(&mut snake, index(middle).clamp(before + 1, before + n - 2))?;
        let [a, b] = old.corners;
        if a == b && (first, last) == (0, at.len() - 1) {
            self.check_loop(curve, &snake.curve())?;
        }
        let section = snake.curve().points[before..before + n].to_vec();
        let chain = SurfaceCurve::open(section).trace(self.mesh, self.adjacency)?;
        let points = &mut self.network.curves[curve as usize].points;
        points.splice(first + 1..last, chain[1..chain.len() - 1].iter().copied());
        Ok(relaxed)
    }

    /// Refuses a loop that has shrunk to nothing.
    fn check_loop(&self, curve: u32, course: &SurfaceCurve) -> Result<(), EditError> {
        match course.length(self.mesh) < SHORTEST_LOOP * self.mean_edge(&course.points) {
            true => Err(EditError::Shrunk { curve }),
            false => Ok(()),
        }
    }

    /// Mean edge of the faces of places.
    fn mean_edge(&self, places: &[FacePoint]) -> f64 {
        let edge = |p: &FacePoint| {
            let [a, b, c] = self.mesh.corners(p.face as usize);
            (a.distance(b) + b.distance(c) + c.distance(a)) / 3.0
        };
        places.iter().map(edge).sum::<f64>() / places.len().max(1) as f64
    }

    /// A curve sampled about one mean edge apart, for a snake.
    fn sampled(&self, course: &SurfaceCurve) -> Result<SurfaceCurve, CurveError> {
        const FEWEST: usize = 9;
        let edges = self.mean_edge(&course.points);
        let count = (course.length(self.mesh) / edges.max(f64::MIN_POSITIVE)).round().clamp(0.0, 1e5) as usize + 1;
        course.resampled(self.mesh, self.adjacency, count.max(FEWEST))
    }

    /// Puts another course in the place of a curve. The ends of an open one go to those of the curve; a closed one is
    /// for a closed curve whose corner has no other curves, and takes the corner along.
    /// # Errors
    /// `NoSuchPart`, `Bound`, `Curve`, `Shrunk`.
    pub fn replace_curve(&mut self, curve: u32, with: &SurfaceCurve) -> Result<(), EditError> {
        let corners = self.movable(curve)?.corners;
        if with.points.len() < 2 {
            return Err(CurveError::TooFewPoints { found: with.points.len(), needed: 2 }.into());
        }
        let mut course = with.clone();
        if with.closed && self.is_free_loop(curve) {
            self.check_loop(curve, with)?;
            self.network.corners[corners[0] as usize].place = course.points[0];
        } else {
            let last = course.points.len() - 1;
            let [first, end] = corners.map(|k| self.network.corners[k as usize].place);
            (course.points[0], course.points[last], course.closed) = (first, end, false);
        }
        self.network.curves[curve as usize].points = course.trace(self.mesh, self.adjacency)?;
        Ok(())
    }
}
