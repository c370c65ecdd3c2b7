//! New vertices where the mesh passes by a line: triangles are divided around them, under the conditions of all local changes.
//!
//! See `docs/methods/contour.md`, step 7.

use super::{GONE, LEANING_COSINE, Local, MOST_FLIPS, Stray};
use crate::geom::closest_in_triangle;
use glam::DVec3;

/// Weight of a corner below which a place in a triangle is as well on the edge opposite of it.
const INNER_WEIGHT: f64 = 0.2;

impl Local<'_> {
    /// Places a new vertex at `p` by dividing the nearest triangle, or two over one of its edges, if the mesh is
    /// farther from there than `least` and nearer than `reach`, stays embedded, and no more triangles lean than
    /// before. Returns its name.
    /// * `normals` - of the surfaces that meet there: what faces as one of them does not lean
    /// * `fixed` - edges that may not be divided
    pub fn insert(
        &mut self,
        (p, normals): (DVec3, [DVec3; 2]),
        [least, reach]: [f64; 2],
        fixed: impl Fn(u32, u32) -> bool,
    ) -> Option<u32> {
        let mut near: Vec<(f64, u32, [f64; 3])> = Vec::new();
        for t in self.around(p, reach) {
            let (square, bary) = closest_in_triangle(&self.mesh.corners(t as usize), p);
            if square < least * least {
                return None;
            }
            near.push((square.sqrt(), t, bary));
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.truncate(MOST_FLIPS);
        near.retain(|n| n.0 < reach);
        near.into_iter().find_map(|(_, t, bary)| {
            let names = self.mesh.triangles[t as usize];
            // Over the edge that is nearest, if the place is no farther within than that.
            let k = (0..3).min_by(|&i, &j| bary[i].total_cmp(&bary[j])).unwrap_or(0);
            let (a, b) = (names[(k + 1) % 3], names[(k + 2) % 3]);
            let shares = |s: &&u32| **s != t && self.mesh.triangles[**s as usize].contains(&b);
            let over = (bary[k] < INNER_WEIGHT && !fixed(a, b)).then(|| self.star(a).iter().find(shares).copied());
            let over = over.flatten().and_then(|s| self.divide(p, normals, &[t, s]));
            over.or_else(|| self.divide(p, normals, &[t]))
        })
    }

    /// Triangles in the cells within `reach` of a place.
    fn around(&self, p: DVec3, reach: f64) -> Vec<u32> {
        let [[x0, x1], [y0, y1], [z0, z1]] = self.reach(p - DVec3::splat(reach), p + DVec3::splat(reach));
        let mut found = Vec::new();
        for (z, y) in (z0..=z1).flat_map(|z| (y0..=y1).map(move |y| (z, y))) {
            let row = z as usize * self.size[1] + y as usize;
            let cells = &self.cells[self.rows[row] as usize..self.rows[row + 1] as usize];
            let first = cells.partition_point(|(c, ..)| (c[0] as i64) < x0);
            let here = cells[first..].iter().take_while(|(c, ..)| c[0] as i64 <= x1);
            found.extend(here.flat_map(|&(_, first, last)| first..last));
            let mut at = self.last[row];
            while at != 0 {
                let Stray { triangle, from, to, before } = self.strays[at as usize - 1];
                if from as i64 <= x1 && to as i64 >= x0 {
                    found.push(triangle);
                }
                at = before;
            }
        }
        found.sort_unstable();
        found.dedup();
        found.retain(|&t| self.mesh.triangles[t as usize] != GONE);
        found
    }

    /// Divides one triangle in three or two beside each other in four, around a new vertex.
    fn divide(&mut self, p: DVec3, normals: [DVec3; 2], old: &[u32]) -> Option<u32> {
        let v = self.mesh.points.len() as u32;
        let before: Vec<[u32; 3]> = old.iter().map(|&t| self.mesh.triangles[t as usize]).collect();
        // Edges around: those that are not shared.
        let sides = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
        let all: Vec<[u32; 2]> = before.iter().flat_map(sides).collect();
        let rim: Vec<[u32; 2]> = all.iter().filter(|[a, b]| !all.contains(&[*b, *a])).copied().collect();
        if rim.len() != old.len() + 2 {
            return None;
        }
        let leaning = self.leaning(old);
        let first = self.mesh.triangles.len() as u32;
        let changed: Vec<u32> = old.iter().copied().chain(first..first + 2).collect();
        self.mesh.points.push(p);
        self.mesh.triangles.extend([GONE; 2]);
        self.seen.extend([0; 2]);
        for (&t, &[a, b]) in changed.iter().zip(&rim) {
            self.mesh.triangles[t as usize] = [a, b, v];
        }
        let wide = changed.iter().all(|&t| self.mesh.area(t as usize) > self.least);
        let stray = |t: &u32| !normals.iter().any(|n| self.mesh.normal(*t as usize).dot(*n) > LEANING_COSINE);
        let doubtful: Vec<u32> = changed.iter().copied().filter(stray).collect();
        if !(wide && self.leaning(&doubtful) <= leaning && self.is_embedded(&changed)) {
            self.mesh.points.pop();
            self.mesh.triangles.truncate(first as usize);
            self.seen.truncate(first as usize);
            old.iter().zip(before).for_each(|(&t, names)| self.mesh.triangles[t as usize] = names);
            return None;
        }
        for x in before.into_iter().flatten() {
            let own = changed.iter().filter(|&&t| self.mesh.triangles[t as usize].contains(&x)).copied();
            if let Some(star) = self.stars.get_mut(self.which[x as usize] as usize) {
                star.retain(|t| !old.contains(t));
                star.extend(own);
                star.sort_unstable();
                star.dedup();
            }
        }
        self.which.push(self.stars.len() as u32);
        self.stars.push(changed.clone());
        self.stray(&changed, std::iter::empty());
        Some(v)
    }
}
