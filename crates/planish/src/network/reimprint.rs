//! Patches cut anew after an edit of some curves, from the part of the mesh around them alone.
//!
//! Patches that an edit changes cover together what they covered before, so the faces of the old ones hold the new
//! ones; a ring of faces more holds every place of their curves, in whatever face it is given. Chains of all curves
//! over these faces are cut in the same order as [`imprint`] would, and the patches come out the same, bit for bit.
//!
//! See `docs/methods/curves.md`, "After an edit".

use super::imprint::{Chain, cut_out, place_of};
use super::{ImprintError, Network, PatchMesh, imprint};
use crate::mesh::{Adjacency, FacePoint, NONE, TriMesh};
use crate::observe::Observer;

/// The patches of `network` whose curves are not those of `before`, rising; nothing if the two do not have the same
/// corners, curves and patches in number and order.
pub fn changed_patches(before: &Network, network: &Network) -> Option<Vec<usize>> {
    let same_ends = before.curves.len() == network.curves.len()
        && before.curves.iter().zip(&network.curves).all(|(a, b)| a.corners == b.corners);
    if !same_ends || before.corners.len() != network.corners.len() || before.patches != network.patches {
        return None;
    }
    let changed: Vec<bool> = before.curves.iter().zip(&network.curves).map(|(a, b)| a.points != b.points).collect();
    let is_changed = |p: &usize| network.patches[*p].sides.iter().any(|s| changed[s.curve as usize]);
    Some((0..network.patches.len()).filter(is_changed).collect())
}

/// As [`imprint`] for the patches `which`, in a time that depends on them and not on the mesh.
///
/// * `before` - these patches as they were, in the same order; together they covered the same part of `mesh`
/// * `which` - rising, see [`changed_patches`]
/// # Errors
/// As [`imprint`].
pub fn reimprint(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    network: &Network,
    before: &[&PatchMesh],
    which: &[usize],
    observer: &dyn Observer,
) -> Result<Vec<PatchMesh>, ImprintError> {
    let covered: Vec<u32> = before.iter().flat_map(|p| &p.face_origin).copied().collect();
    reimprint_over(mesh, adjacency, network, &covered, which, observer)
}

/// As [`reimprint`], for who knows of the patches as they were only the faces that they covered.
///
/// * `covered` - faces of `mesh` under these patches, in any order and as often as one likes
/// # Errors
/// As [`imprint`].
pub fn reimprint_over(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    network: &Network,
    covered: &[u32],
    which: &[usize],
    observer: &dyn Observer,
) -> Result<Vec<PatchMesh>, ImprintError> {
    let faces = around(mesh, adjacency, covered);
    let mut own = vec![NONE; mesh.triangles.len()];
    for (i, &f) in faces.iter().enumerate() {
        own[f as usize] = i as u32;
    }
    let local = |p: &FacePoint| {
        let face = own.get(p.face as usize).copied().unwrap_or(NONE);
        (face != NONE).then_some(FacePoint { face, ..*p })
    };
    let part = submesh(mesh, &faces);
    let part_adjacency = Adjacency::new(&part);
    let mut needed = vec![false; network.curves.len()];
    which.iter().flat_map(|&p| &network.patches[p].sides).for_each(|s| needed[s.curve as usize] = true);
    let mut chains = Vec::new();
    let mut whole = vec![0; network.curves.len()];
    for (curve, c) in network.curves.iter().enumerate() {
        let first = chains.len();
        for run in c.points.split(|p| local(p).is_none()).filter(|run| run.len() > 1) {
            let places = run
                .iter()
                .filter_map(local)
                .map(|p| place_of(&part_adjacency, &part.triangles, &p))
                .collect::<Vec<_>>();
            chains.push(Chain { curve, places });
        }
        if needed[curve] {
            // A side that leaves the part: what was said of the old patches does not hold.
            if chains.len() != first + 1 || chains[first].places.len() != c.points.len() {
                let all = imprint(mesh, network, observer)?;
                return Ok(all.into_iter().enumerate().filter(|(p, _)| which.contains(p)).map(|x| x.1).collect());
            }
            whole[curve] = first;
        }
    }
    let (mut made, _) = cut_out((&part, &part_adjacency), network, &chains, &whole, which, observer)?;
    for patch in &mut made {
        patch.face_origin.iter_mut().for_each(|f| *f = faces[*f as usize]);
        patch.origin.iter_mut().for_each(|p| p.face = faces[p.face as usize]);
    }
    Ok(made)
}

/// Faces and those that share a vertex with them, rising.
fn around(mesh: &TriMesh, adjacency: &Adjacency, covered: &[u32]) -> Vec<u32> {
    let mut seen = vec![false; mesh.triangles.len()];
    let mut met = vec![false; mesh.points.len()];
    for &f in covered {
        for v in mesh.triangles[f as usize] {
            if !std::mem::replace(&mut met[v as usize], true) {
                adjacency.fan(v).for_each(|h| seen[h as usize / 3] = true);
            }
        }
    }
    (0..seen.len() as u32).filter(|&f| seen[f as usize]).collect()
}

/// Some faces as a mesh; vertices keep their order.
fn submesh(mesh: &TriMesh, faces: &[u32]) -> TriMesh {
    let mut name = vec![NONE; mesh.points.len()];
    faces.iter().flat_map(|&f| mesh.triangles[f as usize]).for_each(|v| name[v as usize] = 0);
    let mut points = Vec::new();
    for (v, name) in name.iter_mut().enumerate().filter(|(_, n)| **n == 0) {
        *name = points.len() as u32;
        points.push(mesh.points[v]);
    }
    TriMesh::new(points, faces.iter().map(|&f| mesh.triangles[f as usize].map(|v| name[v as usize])).collect())
}
