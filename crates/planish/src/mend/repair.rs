//! Mends light damage, so that what comes out is always an oriented manifold (possibly with boundary).
//!
//! 1. drop triangles with a repeated vertex, and duplicates     2. weld cracks: open edges that coincide exactly
//! 3. pair edges; those of more than two triangles stay unpaired     4. orient pieces by flood fill; where that
//!    contradicts itself (a one-sided piece) the edge is cut; turn closed pieces that are inside out
//! 5. one vertex per fan, which cuts along all unpaired edges     6. triangles without height: collapse their
//!    short edge or flip their long one, so that no hole is left     7. close tiny handles (`handles`)
//! 8. drop unused vertices     9. close tiny holes (`holes`), but not the slits of 4 and 5
//!
//! Gueziec, Taubin, Lazarus, Horn, *Cutting and Stitching* (2001) is the source of step 5.

use super::handles::TINY_LOOP;
use super::repairs::Repairs;
use crate::mesh::diagnose::sorted_triple;
use crate::mesh::sets::Sets;
use crate::mesh::soup::{Orientation, check, fans, keyed_edges, mates, orient, origin, repeats};
use crate::mesh::{FeatureTags, MeshError, NONE, TriMesh, next};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;

/// Mends `mesh`; attributes are carried along.
/// # Errors
/// [`MeshError`] if a triangle names a missing vertex or one whose position is not finite, or if no triangle
/// is left; [`MeshError::Cancelled`].
pub fn repair(mesh: &TriMesh, observer: &dyn Observer) -> Result<(TriMesh, Repairs), MeshError> {
    check(mesh)?;
    let mut done = Repairs::default();
    let mut triangles = mesh.triangles.clone();
    // The input vertex that each vertex was made of.
    let mut source: Vec<u32> = (0..mesh.points.len() as u32).collect();

    let before = triangles.len();
    // Before welding, as duplicates hide open edges, and after, as welding can bring about both.
    triangles.retain(|t| !repeats(t));
    done.duplicate_faces = drop_duplicates(&mut triangles);
    observer.check()?;
    done.welded_vertices = weld_cracks(mesh, &mut triangles);
    triangles.retain(|t| !repeats(t));
    done.duplicate_faces += drop_duplicates(&mut triangles);
    done.repeated_faces = before - triangles.len() - done.duplicate_faces;
    if triangles.is_empty() {
        return Err(MeshError::Empty);
    }
    make_manifold(mesh, &mut triangles, &mut source, &mut done, observer)?;
    observer.progress(0.3);
    super::slivers::remove(mesh, &mut triangles, &source, &mut done, observer)?;
    let handles = super::handles::close(mesh, &mut triangles, &mut source, observer)?;
    done.closed_handles = handles.count;
    if done.closed_handles > 0 {
        super::slivers::remove(mesh, &mut triangles, &source, &mut done, observer)?;
    }
    observer.progress(0.8);

    let mut used = vec![false; mesh.points.len()];
    mesh.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    done.unreferenced_vertices = used.iter().filter(|&&u| !u).count();
    let (mut mended, id) = gather(mesh, &triangles, &source);
    if handles.count > 0 {
        handles.part(&mut mended, &id, observer)?;
    }
    let longest = TINY_LOOP * mended.bounds().diagonal();
    let mut tags = FeatureTags::from_edges(mended.points.len(), []);
    done.closed_holes = super::close_holes(&mut mended, &mut tags, longest, observer)?;
    observer.progress(1.0);
    Ok((mended, done))
}

/// Merges all vertices at exactly the same place (those of a triangle soup, as STL files hold); triangles that
/// lose a corner by that are dropped. Returns the mesh and the number of vertices merged into others.
pub fn weld(mesh: &TriMesh) -> (TriMesh, usize) {
    let (first, merged) = coincident(&mesh.points);
    let triangles: Vec<[u32; 3]> =
        mesh.triangles.iter().map(|t| t.map(|v| first[v as usize])).filter(|t| !repeats(t)).collect();
    let source: Vec<u32> = (0..mesh.points.len() as u32).collect();
    (gather(mesh, &triangles, &source).0, merged)
}

/// Gives every fan of triangles around a vertex a vertex of its own: surfaces that touch in a point come apart. Returns the
/// mesh and, for each of its vertices, the one of the input.
pub fn part_fans(mesh: &TriMesh) -> (TriMesh, Vec<u32>) {
    let mut triangles = mesh.triangles.clone();
    let mut source: Vec<u32> = (0..mesh.points.len() as u32).collect();
    let mate = mates(&keyed_edges(&triangles), 3 * triangles.len());
    one_vertex_per_fan(&mut triangles, &mate, &mut source);
    let points = source.iter().map(|&v| mesh.points[v as usize]).collect();
    let attributes = mesh.attributes.iter().map(|a| a.picked(&source)).collect();
    (TriMesh { points, triangles, attributes }, source)
}

/// For each point the first one at the same place, and how many have an earlier one.
fn coincident(points: &[DVec3]) -> (Vec<u32>, usize) {
    // Adding zero makes -0 and 0 the same bits.
    let key = |v: u32| points[v as usize].to_array().map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_unstable_by_key(|&v| (key(v), v));
    let mut first: Vec<u32> = (0..points.len() as u32).collect();
    let mut merged = 0;
    for run in order.chunk_by(|&a, &b| key(a) == key(b)) {
        for &v in run {
            first[v as usize] = run[0];
        }
        merged += run.len() - 1;
    }
    (first, merged)
}

/// Triangles lower than this share of their edge do not tell to which side of it they lie.
const THIN_TRIANGLE: f64 = 0.1;
/// Open edges this nearly folded onto each other (cosine between their triangles) are the boundary of a two-sided
/// sheet, not a crack.
const FOLDED_COSINE: f64 = 0.999;

/// Joins the ends of pairs of open edges that lie exactly on each other. Only such pairs are joined, so sheets
/// that merely touch at points, and two-sided sheets, stay as they are.
fn weld_cracks(mesh: &TriMesh, triangles: &mut [[u32; 3]]) -> usize {
    let keyed = keyed_edges(triangles);
    let open: Vec<u32> = keyed.chunk_by(|x, y| x.0 == y.0).filter(|run| run.len() == 1).map(|run| run[0].1).collect();
    if open.is_empty() {
        return 0;
    }
    let (first, merged) = coincident(&mesh.points);
    if merged == 0 {
        return 0;
    }
    let mut placed: Vec<((u32, u32), u32)> = open
        .iter()
        .map(|&h| {
            let (a, b) = (first[origin(triangles, h) as usize], first[origin(triangles, next(h)) as usize]);
            ((a.min(b), a.max(b)), h)
        })
        .filter(|((a, b), _)| a != b)
        .collect();
    placed.sort_unstable();
    let mut sets = Sets::new(mesh.points.len());
    for run in placed.chunk_by(|x, y| x.0 == y.0) {
        let [(_, g), (_, h)] = *run else { continue };
        if is_folded(mesh, triangles, g, h) {
            continue;
        }
        let (g0, g1) = (origin(triangles, g), origin(triangles, next(g)));
        let (h0, h1) = (origin(triangles, h), origin(triangles, next(h)));
        let along = first[g0 as usize] == first[h0 as usize];
        sets.join(g0, if along { h0 } else { h1 });
        sets.join(g1, if along { h1 } else { h0 });
    }
    for v in triangles.iter_mut().flatten() {
        *v = sets.root(*v);
    }
    (0..mesh.points.len() as u32).filter(|&v| sets.root(v) != v).count()
}

/// True if the triangles of two edges at one place lie on each other, as far as triangles that are no slivers tell.
fn is_folded(mesh: &TriMesh, triangles: &[[u32; 3]], g: u32, h: u32) -> bool {
    let at = |v: u32| mesh.points[v as usize];
    let p = at(origin(triangles, g));
    let edge = at(origin(triangles, next(g))) - p;
    let axis = edge.normalize_or_zero();
    let aside = |h: u32| {
        let c = at(origin(triangles, crate::mesh::previous(h))) - p;
        c - axis * c.dot(axis)
    };
    let [a, b] = [aside(g), aside(h)];
    let told = a.length().min(b.length()) > THIN_TRIANGLE * edge.length();
    told && a.dot(b) > FOLDED_COSINE * a.length() * b.length()
}

fn drop_duplicates(triangles: &mut Vec<[u32; 3]>) -> usize {
    let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
    order.sort_unstable_by_key(|&t| (sorted_triple(triangles[t as usize]), t));
    let mut keep = vec![false; triangles.len()];
    for run in order.chunk_by(|&a, &b| sorted_triple(triangles[a as usize]) == sorted_triple(triangles[b as usize])) {
        keep[run[0] as usize] = true;
    }
    let before = triangles.len();
    let mut t = 0;
    triangles.retain(|_| {
        t += 1;
        keep[t - 1]
    });
    before - triangles.len()
}

/// Cutting can bring half-edges of one edge together again; so many rounds settle all but contrived soups, and
/// what is left then is detached.
const PAIRING_ROUNDS: usize = 4;

fn make_manifold(
    mesh: &TriMesh,
    triangles: &mut [[u32; 3]],
    source: &mut Vec<u32>,
    done: &mut Repairs,
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    for round in 0..=PAIRING_ROUNDS {
        observer.check()?;
        let keyed = keyed_edges(triangles);
        let over: Vec<u32> =
            keyed.chunk_by(|x, y| x.0 == y.0).filter(|run| run.len() > 2).map(|run| run[0].1).collect();
        let mut mate = mates(&keyed, 3 * triangles.len());
        let one_sided = orient_all(mesh, triangles, source, &mut mate, done, round == 0);
        let split = one_vertex_per_fan(triangles, &mate, source);
        done.cut_edges += over.len();
        done.one_sided_edges += one_sided;
        done.split_vertices += split;
        if over.is_empty() && one_sided == 0 {
            break;
        }
        if round == PAIRING_ROUNDS {
            detach_bad(triangles, source, done);
        }
    }
    Ok(())
}

/// Turns triangles so that neighbours agree; unpairs edges where that cannot be. Returns their number.
fn orient_all(
    mesh: &TriMesh,
    triangles: &mut [[u32; 3]],
    source: &[u32],
    mate: &mut [u32],
    done: &mut Repairs,
    judge_pieces: bool,
) -> usize {
    let orientation = orient(triangles, mate);
    let mut one_sided = 0;
    for h in 0..mate.len() as u32 {
        let g = mate[h as usize];
        if g == NONE || g < h {
            continue;
        }
        let agree = origin(triangles, g) != origin(triangles, h);
        let differ = orientation.turned[h as usize / 3] != orientation.turned[g as usize / 3];
        if agree == differ {
            mate[h as usize] = NONE;
            mate[g as usize] = NONE;
            one_sided += 1;
        }
    }
    // The majority of each piece stays as it is.
    let mut votes = vec![[0usize; 2]; orientation.pieces];
    for t in 0..triangles.len() {
        votes[orientation.piece[t] as usize][orientation.turned[t] as usize] += 1;
    }
    let mut turn: Vec<bool> = (0..triangles.len())
        .map(|t| {
            let [stay, go] = votes[orientation.piece[t] as usize];
            orientation.turned[t] ^ (go > stay)
        })
        .collect();
    done.turned_faces += turn.iter().filter(|&&t| t).count();
    if judge_pieces {
        let inverted = inside_out(mesh, triangles, source, mate, &orientation, &turn);
        done.turned_components += inverted.iter().filter(|&&i| i).count();
        for (t, turn) in turn.iter_mut().enumerate() {
            *turn ^= inverted[orientation.piece[t] as usize];
        }
    }
    // Turning swaps corners 1 and 2 and with them the half-edges 0 and 2: mates move along.
    let moved = |h: u32| if turn[h as usize / 3] { h / 3 * 3 + 2 - h % 3 } else { h };
    let mut fresh = vec![NONE; mate.len()];
    for h in 0..mate.len() as u32 {
        if mate[h as usize] != NONE {
            fresh[moved(h) as usize] = moved(mate[h as usize]);
        }
    }
    mate.copy_from_slice(&fresh);
    for (t, tri) in triangles.iter_mut().enumerate() {
        if turn[t] {
            tri.swap(1, 2);
        }
    }
    one_sided
}

/// Closed pieces of negative volume that are not voids inside another closed piece.
fn inside_out(
    mesh: &TriMesh,
    triangles: &[[u32; 3]],
    source: &[u32],
    mate: &[u32],
    orientation: &Orientation,
    turn: &[bool],
) -> Vec<bool> {
    let &Orientation { ref piece, pieces, .. } = orientation;
    let at = |v: u32| mesh.points[source[v as usize] as usize];
    let mut closed = vec![true; pieces];
    let mut reference = vec![DVec3::NAN; pieces];
    let mut volume = vec![0.0; pieces];
    for (t, tri) in triangles.iter().enumerate() {
        let p = piece[t] as usize;
        closed[p] &= mate[3 * t..3 * t + 3].iter().all(|&g| g != NONE);
        let [a, b, c] = tri.map(at);
        if reference[p].is_nan() {
            reference[p] = a;
        }
        let part = (a - reference[p]).dot((b - reference[p]).cross(c - reference[p])) / 6.0;
        volume[p] += if turn[t] { -part } else { part };
    }
    (0..pieces)
        .map(|p| {
            if !closed[p] || volume[p] >= 0.0 {
                return false;
            }
            // Winding number of the other closed pieces around a vertex of this one.
            let x = reference[p];
            let mut winding = vec![0.0; pieces];
            for (t, tri) in triangles.iter().enumerate() {
                let q = piece[t] as usize;
                if q != p && closed[q] {
                    let angle = solid_angle(tri.map(|v| at(v) - x));
                    winding[q] += if turn[t] { -angle } else { angle };
                }
            }
            let around = winding.iter().filter(|w| w.abs() > std::f64::consts::TAU).count();
            around % 2 == 0
        })
        .collect()
}

/// Solid angle of a triangle seen from the origin (van Oosterom and Strackee 1983).
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * a.dot(b.cross(c)).atan2(below)
}

/// Gives every fan a vertex of its own. Returns the number of new vertices.
fn one_vertex_per_fan(triangles: &mut [[u32; 3]], mate: &[u32], source: &mut Vec<u32>) -> usize {
    let fan = fans(triangles, mate);
    let mut taken = vec![false; source.len()];
    let mut vertex_of_fan = vec![NONE; fan.len()];
    let mut split = 0;
    for c in 0..fan.len() {
        let root = fan[c] as usize;
        let corner = &mut triangles[c / 3][c % 3];
        if vertex_of_fan[root] == NONE {
            let v = *corner;
            vertex_of_fan[root] = if std::mem::replace(&mut taken[v as usize], true) {
                source.push(source[v as usize]);
                taken.push(true);
                split += 1;
                source.len() as u32 - 1
            } else {
                v
            };
        }
        *corner = vertex_of_fan[root];
    }
    split
}

/// Gives the triangles at edges that still are not manifold three vertices of their own.
fn detach_bad(triangles: &mut [[u32; 3]], source: &mut Vec<u32>, done: &mut Repairs) {
    let keyed = keyed_edges(triangles);
    let mut bad: Vec<u32> = Vec::new();
    for run in keyed.chunk_by(|x, y| x.0 == y.0) {
        let same_way = run.len() == 2 && origin(triangles, run[0].1) == origin(triangles, run[1].1);
        if run.len() > 2 || same_way {
            bad.extend(run.iter().map(|r| r.1 / 3));
        }
    }
    bad.sort_unstable();
    bad.dedup();
    for t in bad {
        for v in &mut triangles[t as usize] {
            source.push(source[*v as usize]);
            *v = source.len() as u32 - 1;
            done.split_vertices += 1;
        }
    }
    // Taking triangles away can leave two fans at a vertex.
    let mate = mates(&keyed_edges(triangles), 3 * triangles.len());
    done.split_vertices += one_vertex_per_fan(triangles, &mate, source);
}

/// The mesh of `triangles` over the vertices they use, in rising order, attributes included, and the number of each vertex in it.
fn gather(mesh: &TriMesh, triangles: &[[u32; 3]], source: &[u32]) -> (TriMesh, Vec<u32>) {
    let mut id = vec![NONE; source.len()];
    triangles.iter().flatten().for_each(|&v| id[v as usize] = 0);
    let mut from = Vec::new();
    for (v, id) in id.iter_mut().enumerate().filter(|(_, id)| **id == 0) {
        *id = from.len() as u32;
        from.push(source[v]);
    }
    let gathered = TriMesh {
        points: from.iter().map(|&v| mesh.points[v as usize]).collect(),
        triangles: triangles.iter().map(|t| t.map(|v| id[v as usize])).collect(),
        attributes: mesh
            .attributes
            .iter()
            // One that does not match the vertices belongs to no vertex.
            .filter(|a| a.values.len() == a.width * mesh.points.len())
            .map(|a| a.picked(&from))
            .collect(),
    };
    (gathered, id)
}
