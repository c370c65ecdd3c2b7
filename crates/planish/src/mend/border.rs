//! Ragged borders of open surfaces, cut back to even ones.
//!
//! An opening, as mathematical morphology has it (Serra, *Image Analysis and Mathematical Morphology*, 1982), with distances along
//! the surface: the places farther than a radius from the border, and around them all that lies nearer to these than a part of the
//! radius. What is narrower than twice the radius goes, unless it is as large as a patch. See `docs/methods/mend.md`, "Even borders".

use super::rims::{averaged, part};
use crate::geom::NONE;
use crate::geom::graph::Search;
use crate::mend;
use crate::mesh::sets::Sets;
use crate::mesh::{Adjacency, FeatureTags, TriMesh, next, previous};
use crate::observe::{Cancelled, Observer};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// So much of the radius is given back. A border then bends outward by this part of the radius at least, and inward by the rest: with
/// all of it given back notches would stay as sharp as they are. Chosen.
const GIVEN_BACK: f64 = 0.75;

/// Narrow parts of at least so many squares of the radius stay: as large as a patch whose side is five times the radius.
const LEAST_LARGE: f64 = 25.0;

/// Rounds of means over the neighbours, which take the steps of triangles out of the new border.
const AVERAGING_ROUNDS: usize = 8;

/// Parameters of what is done to a mesh before its patches are laid.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MendParams {
    /// Where the surface is open, tatters of the border that are narrower than twice this length go before patches are laid;
    /// 0 keeps it as it is. The border of a scan is ragged: where none is given, a fifth of the side of a patch is taken
    /// there, if the mesh had a hundred.
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "diagonal"))]
    pub even_border: f64,
}

/// Cuts the ragged borders of a manifold even; returns the part of the area that went. A surface of which nothing would be left
/// stays.
/// * `radius` - half of the width that is kept everywhere, world units
/// # Errors
/// [`Cancelled`]; the mesh is then as it was.
pub fn even_borders(
    mesh: &mut TriMesh,
    tags: &mut FeatureTags,
    radius: f64,
    observer: &dyn Observer,
) -> Result<f64, Cancelled> {
    let adjacency = Adjacency::new(mesh);
    let vertices = 0..mesh.points.len() as u32;
    let rim: Vec<(u32, f64)> =
        vertices.clone().filter(|&v| adjacency.is_boundary_vertex(v)).map(|v| (v, 0.0)).collect();
    if rim.is_empty() || radius <= 0.0 {
        return Ok(0.0);
    }
    observer.check()?;
    let depth = distances(mesh, &adjacency, &rim, radius);
    let is_inside = |v: u32| depth[v as usize] >= radius;
    // From the line at the radius, which passes between vertices.
    let is_beside = |v: u32| !is_inside(v) && around(mesh, &adjacency, v).any(|(w, _)| is_inside(w));
    let start: Vec<(u32, f64)> =
        vertices.clone().filter(|&v| is_beside(v)).map(|v| (v, radius - depth[v as usize])).collect();
    observer.check()?;
    let off = distances(mesh, &adjacency, &start, radius);
    let large = large_parts(mesh, |v| !is_inside(v) && off[v as usize] >= radius, LEAST_LARGE * radius * radius);
    observer.check()?;
    let start: Vec<(u32, f64)> = start.into_iter().chain(large.into_iter().map(|v| (v, 0.0))).collect();
    let off = distances(mesh, &adjacency, &start, radius);
    let level = |v: u32| {
        let beyond = if is_inside(v) { radius - depth[v as usize].min(2.0 * radius) } else { off[v as usize] };
        GIVEN_BACK * radius - beyond.min(radius)
    };
    let level = averaged(mesh, vertices.map(level).collect(), |_| false, AVERAGING_ROUNDS, observer)?;
    if !level.iter().any(|&l| l > 0.0) {
        return Ok(0.0);
    }
    let area = |mesh: &TriMesh| (0..mesh.triangles.len()).map(|f| mesh.area(f)).sum::<f64>();
    let before = area(mesh);
    mend::trim(mesh, tags, &level);
    part(mesh, tags);
    Ok(1.0 - area(mesh) / before)
}

/// Vertices of the parts of a surface, between the vertices that `is_part` says, that have at least this area.
fn large_parts(mesh: &TriMesh, is_part: impl Fn(u32) -> bool, least: f64) -> Vec<u32> {
    let mut sets = Sets::new(mesh.points.len());
    let faces: Vec<usize> =
        (0..mesh.triangles.len()).filter(|&f| mesh.triangles[f].iter().all(|&v| is_part(v))).collect();
    for &f in &faces {
        let [a, b, c] = mesh.triangles[f];
        sets.join(a, b);
        sets.join(a, c);
    }
    let mut area = vec![0.0; mesh.points.len()];
    faces.iter().for_each(|&f| area[sets.root(mesh.triangles[f][0]) as usize] += mesh.area(f));
    let mut vertices: Vec<u32> = faces.iter().flat_map(|&f| mesh.triangles[f]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices.retain(|&v| area[sets.root(v) as usize] >= least);
    vertices
}

/// Distances along the surface from many sources, each with the one it starts at, up to `reach`; infinite beyond.
///
/// Along edges, as [`crate::mesh::path::distances`], and straight across them to the corner of the face behind: between even triangles
/// edges alone are up to a sixth longer than the way.
fn distances(mesh: &TriMesh, adjacency: &Adjacency, sources: &[(u32, f64)], reach: f64) -> Vec<f64> {
    let mut search = Search::dense(mesh.points.len());
    sources.iter().for_each(|&(v, distance)| search.reach(v, distance, NONE));
    while let Some((v, distance)) = search.settle() {
        if distance > reach {
            break;
        }
        for (w, length) in around(mesh, adjacency, v) {
            search.reach(w, distance + length, v);
        }
    }
    search.reached.distance
}

/// Vertices beside a vertex and across the edges that face it, with their distances.
fn around<'a>(mesh: &'a TriMesh, adjacency: &'a Adjacency, v: u32) -> impl Iterator<Item = (u32, f64)> + 'a {
    let across = adjacency.fan(v).filter_map(move |h| {
        let o = adjacency.opposite[next(h) as usize];
        (o != NONE).then(|| mesh.origin(previous(o)))
    });
    let beside = crate::mesh::path::neighbours(mesh, adjacency, v).map(|(w, _)| w);
    beside.chain(across).map(move |w| (w, mesh.points[v as usize].distance(mesh.points[w as usize])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::Silent;
    use crate::synthetic::shapes;
    use std::f64::consts::PI;

    fn evened(mut mesh: TriMesh, radius: f64) -> (TriMesh, f64) {
        let mut tags = FeatureTags::from_edges(mesh.points.len(), []);
        let cut = even_borders(&mut mesh, &mut tags, radius, &Silent).unwrap();
        assert!(crate::mesh::diagnose(&mesh).manifold);
        (mesh, cut)
    }

    fn area(mesh: &TriMesh) -> f64 {
        (0..mesh.triangles.len()).map(|f| mesh.area(f)).sum()
    }

    #[test]
    fn a_straight_border_goes_back_by_a_quarter_of_the_radius_and_corners_become_arcs_of_the_rest() {
        let (radius, side) = (0.2, 2.0);
        let (mesh, cut) = evened(shapes::rectangle(side, side, 100, 100), radius);
        let (back, arc) = ((1.0 - GIVEN_BACK) * radius, GIVEN_BACK * radius);
        let wanted = (side - 2.0 * back).powi(2) - (4.0 - PI) * arc * arc;
        assert!((area(&mesh) / wanted - 1.0).abs() < 5e-3, "{} {wanted}", area(&mesh));
        assert!((cut - (1.0 - area(&mesh) / (side * side))).abs() < 1e-12);
    }

    #[test]
    fn a_tongue_narrower_than_twice_the_radius_goes_and_a_wider_one_stays() {
        let full = shapes::rectangle(4.0, 2.0, 80, 40);
        let low = full.bounds().min;
        // A tongue in the upper half, a quarter of the length wide or less.
        let tongue = |width: f64| {
            let keeps = |f: &usize| {
                let p = full.corners(*f).into_iter().sum::<glam::DVec3>() / 3.0 - low;
                p.y < 1.0 || (p.x - 2.0).abs() < width / 2.0
            };
            let triangles: Vec<[u32; 3]> = (0..full.triangles.len()).filter(keeps).map(|f| full.triangles[f]).collect();
            let mut mesh = TriMesh::new(full.points.clone(), triangles);
            let stays: Vec<bool> = {
                let mut used = vec![false; mesh.points.len()];
                mesh.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
                used
            };
            FeatureTags::from_edges(mesh.points.len(), []).keep(&mut mesh, &stays);
            evened(mesh, 0.2).0.bounds().max.y - low.y
        };
        assert!(tongue(0.3) < 1.05 && tongue(0.6) > 1.9, "{} {}", tongue(0.3), tongue(0.6));
    }

    #[test]
    fn a_narrow_strip_as_large_as_a_patch_stays_and_a_shorter_one_goes_unless_it_is_all_there_is() {
        let strip = |length: f64| shapes::rectangle(length, 0.3, (20.0 * length) as usize, 6);
        let sheet = shapes::rectangle(2.0, 2.0, 40, 40);
        let beside = |other: &TriMesh| {
            let first = sheet.points.len() as u32;
            let away = other.points.iter().map(|&p| p + glam::DVec3::new(0.0, 9.0, 0.0));
            let points = sheet.points.iter().copied().chain(away).collect();
            let theirs = other.triangles.iter().map(|t| t.map(|v| v + first));
            TriMesh::new(points, sheet.triangles.iter().copied().chain(theirs).collect())
        };
        let alone = area(&evened(sheet.clone(), 0.2).0);
        let left = |length: f64| area(&evened(beside(&strip(length)), 0.2).0) - alone;
        assert!(left(3.0).abs() < 1e-9 && (left(4.0) - 1.2).abs() < 1e-9, "{} {}", left(3.0), left(4.0));
        assert_eq!(evened(strip(1.0), 0.2), (strip(1.0), 0.0));
    }

    #[test]
    fn closed_surfaces_stay() {
        let ball = shapes::sphere(1.0, 3);
        assert_eq!(evened(ball.clone(), 0.3), (ball, 0.0));
    }
}
