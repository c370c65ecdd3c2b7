//! What an edit keeps: numbers of patches, their feature curves and sections, where the curves around them change.
//!
//! See `docs/methods/curves.md`, "Mirroring" and "After an edit".

use super::change::mirror::{self, ON_PLANE};
use super::{Ground, Images};
use crate::curve::SurfaceCurve;
use crate::curve::symmetry::Plane;
use crate::grid::{Family, FeatureCurve, Sections};
use crate::mesh::{FacePoint, TriMesh};
use crate::model::Drawing;
use crate::network::{Network, Patch};
use std::collections::BTreeMap;

/// Sides that a patch before the plane or across it keeps at least: across it up to two sides lie behind it.
const FEWEST_KEPT_SIDES: usize = 2;

/// Fewest cells of a section over the plane: two on each side of it.
const FEWEST_ACROSS: usize = 4;

/// How a patch lies on another, by their curves: its side `k` on side `first + k`, or mirrored on `first - k`.
#[derive(Clone, Copy)]
struct Onto {
    patch: u32,
    first: usize,
    mirrored: bool,
}

impl Onto {
    /// The patch among `patches` whose sides are those of `old` by way of `curve`, the new number of a curve; at least
    /// `known` sides must have one.
    fn find(
        old: &Patch,
        curve: &dyn Fn(u32) -> Option<u32>,
        patches: &[Patch],
        mirrored: bool,
        known: usize,
    ) -> Option<Onto> {
        let wanted = old.sides.map(|s| curve(s.curve));
        if wanted.iter().flatten().count() < known {
            return None;
        }
        (0..patches.len()).find_map(|p| {
            let at = |first: usize, k: usize| if mirrored { (first + 4 - k) % 4 } else { (first + k) % 4 };
            let fits = |first: usize| {
                (0..4).all(|k| wanted[k].is_none_or(|curve| patches[p].sides[at(first, k)].curve == curve))
            };
            (0..4).find(|&first| fits(first)).map(|first| Onto { patch: p as u32, first, mirrored })
        })
    }

    fn family(&self, family: Family) -> Family {
        match (family, self.first % 2) {
            (family, 0) => family,
            (Family::U, _) => Family::V,
            (Family::V, _) => Family::U,
        }
    }

    fn sections(&self, of: &Sections) -> Sections {
        let turned = |list: &[usize]| list.iter().rev().copied().collect::<Vec<_>>();
        let (u, v) = (of.u.clone(), of.v.clone());
        match (self.first, self.mirrored) {
            (0, false) => Sections { u, v },
            (1, false) => Sections { u: turned(&v), v: u },
            (2, false) => Sections { u: turned(&u), v: turned(&v) },
            (_, false) => Sections { u: v, v: turned(&u) },
            (0, true) => Sections { u: turned(&u), v },
            (1, true) => Sections { u: turned(&v), v: turned(&u) },
            (2, true) => Sections { u, v: turned(&v) },
            (_, true) => Sections { u: v, v: u },
        }
    }
}

/// Gives the patches their old numbers and first sides back where an edit has moved curves and nothing else; feature
/// curves and sections go to the numbers that their patches have now, and those whose patch is gone go with it.
/// * `moves_alone` - true for an edit that moves curves and nothing else
pub(super) fn keep(moves_alone: bool, drawing: &mut Drawing, before: &Drawing) {
    let (old, new) = (&before.network, &drawing.network);
    let same_ends = |(a, b): (&crate::network::Curve, &crate::network::Curve)| a.corners == b.corners;
    if moves_alone
        && old.patches.len() == new.patches.len()
        && old.curves.len() == new.curves.len()
        && old.curves.iter().zip(&new.curves).all(same_ends)
        && old.patches.iter().all(|p| Onto::find(p, &Some, &new.patches, false, 4).is_some())
    {
        drawing.network.patches = old.patches.clone();
        return;
    }
    let key = |points: &[FacePoint]| -> Vec<(u32, [u64; 3])> {
        points.iter().map(|p| (p.face, p.bary.map(f64::to_bits))).collect()
    };
    let numbers: BTreeMap<_, u32> = new.curves.iter().enumerate().map(|(k, c)| (key(&c.points), k as u32)).collect();
    let renamed = |c: u32| numbers.get(&key(&old.curves[c as usize].points)).copied();
    let sketch = drawing.sketch.clone();
    let onto = |p: u32| Onto::find(old.patches.get(p as usize)?, &renamed, &new.patches, false, 4);
    let features = sketch.features.iter().filter_map(|f| {
        onto(f.patch).map(|o| FeatureCurve { patch: o.patch, family: o.family(f.family), points: f.points.clone() })
    });
    let sections = sketch.sections.iter().filter_map(|(p, s)| onto(*p).map(|o| (o.patch, o.sections(s))));
    (drawing.sketch.features, drawing.sketch.sections) = (features.collect(), sections.collect());
}

/// Feature curves and sections of patches before the plane, and their images; those behind it go. A curve that crosses
/// the plane, in a patch that does, goes on behind it as its own image.
pub(super) fn mirror(ground: &Ground, drawing: &mut Drawing, before: &Drawing, plane: &Plane, images: &Images) {
    let (old, new): (&Network, &Network) = (&before.network, &drawing.network);
    let mesh = ground.canvas.mesh;
    let (mut features, mut sections) = (Vec::new(), Vec::new());
    let maps = |p: u32| -> (Option<Onto>, Option<Onto>) {
        let Some(patch) = old.patches.get(p as usize) else { return (None, None) };
        let kept = |c: u32| images.kept(c);
        let image = |c: u32| images.kept(c).map(|c| images.image[c as usize]);
        let first = Onto::find(patch, &kept, &new.patches, false, FEWEST_KEPT_SIDES);
        let second = Onto::find(patch, &image, &new.patches, true, FEWEST_KEPT_SIDES);
        (first, second)
    };
    let near = ON_PLANE * mesh.bounds().diagonal();
    for feature in &before.sketch.features {
        let (Some(first), second) = maps(feature.patch) else { continue };
        let mut add = |onto: Onto, points: Vec<FacePoint>| {
            features.push(FeatureCurve { patch: onto.patch, family: onto.family(feature.family), points });
        };
        let heights = feature.points.iter().map(|p| plane.height(p.position(mesh)));
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        // Only a patch that crosses the plane, and so is its own image, has curves across it, behind it and in it.
        let is_own = second.is_some_and(|o| o.patch == first.patch);
        if is_own && high <= near {
            if low >= -near {
                add(first, feature.points.clone());
            }
            continue;
        }
        if is_own && low < -near {
            let open = SurfaceCurve::open(feature.points.clone());
            let points = mirror::across(ground, &open, plane).map_or(feature.points.clone(), |c| c.points);
            add(first, points);
            continue;
        }
        add(first, feature.points.clone());
        if let Some(second) = second {
            add(second, feature.points.iter().map(|p| plane.mirror_place(mesh, &ground.bvh, p)).collect());
        }
    }
    for (p, s) in &before.sketch.sections {
        let (Some(first), second) = maps(*p) else { continue };
        let mut here = first.sections(s);
        match second.filter(|o| first.patch != o.patch) {
            Some(second) => sections.push((second.patch, second.sections(s))),
            None => {
                let image = |c: u32| images.image.get(c as usize).copied();
                let patch = &new.patches[first.patch as usize];
                let own = Onto::find(patch, &image, &new.patches, true, 4).filter(|o| o.patch == first.patch);
                if let Some(own) = own {
                    let features = before.sketch.features.iter().filter(|f| f.patch == *p);
                    across(&mut here, &own, features, mesh, new, plane);
                }
            }
        }
        sections.push((first.patch, here));
    }
    (drawing.sketch.features, drawing.sketch.sections) = (features, sections);
}

/// Cells of a patch that is its own image, made their own image along the direction that crosses the plane: those up to
/// the last curve before the plane count, and the section over the plane takes what is left of the sum.
/// * `own` - the patch as its own image
/// * `features` - the feature curves that it had before
fn across<'a>(
    cells: &mut Sections,
    own: &Onto,
    features: impl Iterator<Item = &'a FeatureCurve>,
    mesh: &TriMesh,
    network: &Network,
    plane: &Plane,
) {
    let patch = &network.patches[own.patch as usize];
    let (list, end) = match own.first {
        0 => (&mut cells.u, 3),
        2 => (&mut cells.v, 0),
        // The plane runs from corner to corner.
        _ => return,
    };
    let near = ON_PLANE * mesh.bounds().diagonal();
    let height = |p: &FacePoint| plane.height(p.position(mesh));
    let side = &network.curves[patch.sides[end].curve as usize].points;
    if height(&side[side.len() / 2]) < 0.0 {
        list.reverse();
    }
    // Curves along the plane, by where they lie: those that cross it are of the other family.
    let tops = features.map(|f| {
        let heights = f.points.iter().map(height);
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
    });
    let (mut front, mut inside) = (0, false);
    for (low, high) in tops {
        front += (low > near) as usize;
        inside |= low >= -near && high <= near;
    }
    if list.len() < front + 1 {
        return;
    }
    let sum: usize = list.iter().sum();
    let last = list[front];
    list.truncate(front);
    let ahead: usize = list.iter().sum();
    let back: Vec<usize> = list.iter().rev().copied().collect();
    match inside {
        true => list.extend([last, last]),
        false if sum >= 2 * ahead + FEWEST_ACROSS => list.push(sum - 2 * ahead),
        false => list.push(last),
    }
    list.extend(back);
}
