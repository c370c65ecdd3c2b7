//! Maps of all kinds and frames, their layout and their seams.

mod patchworks;

use glam::DVec3;
use patchworks::*;
use planish::Silent;
use planish::mesh::{Attribute, FacePoint, TriMesh};
use planish::network::CurveKind;
use planish::relief::maps::{self, AxisOrder, MapFrame, MapKind, MapParams, PatchMap, SheetKind};
use planish::relief::{self, Agreement, Displaced, Relief};
use planish::surface;

fn params(kind: MapKind, frame: MapFrame, texels: usize) -> MapParams {
    MapParams { kind, frame, texels, ..MapParams::default() }
}

fn no_mesh() -> TriMesh {
    TriMesh::default()
}

/// All texels changed, so that all are read.
fn other(maps: &[PatchMap]) -> Vec<PatchMap> {
    let one = |m: &PatchMap| PatchMap { values: vec![f32::MAX; m.values.len()], ..m.clone() };
    maps.iter().map(one).collect()
}

#[test]
fn vector_maps_of_every_frame_and_order_read_back_to_the_grid_within_1e_7_of_the_size() {
    for work in [cube(17, CurveKind::Smooth, blob), torus(13), wavy([9, 14]), tube([30, 12]), purse(17)] {
        let (surfaces, reliefs) = fitted(&work, 5);
        let displaced = Displaced { network: &work.network, surfaces: &surfaces, reliefs: &reliefs };
        for frame in [MapFrame::Surface, MapFrame::Object, MapFrame::Tangent] {
            for order in [AxisOrder::Tbn, AxisOrder::Tnb, AxisOrder::TbnDown] {
                let params = MapParams { order, ..params(MapKind::Vector, frame, 0) };
                let made = maps::render(&displaced, &no_mesh(), &params, &Silent).unwrap();
                let back = maps::read_back(&displaced, &params, &made, &other(&made), &Silent).unwrap();
                for ((grid, s), r) in work.grids.iter().zip(&surfaces).zip(&back) {
                    let points = relief::displace(s, r).unwrap();
                    let worst = points.iter().zip(&grid.points).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                    assert!(worst < 1e-7, "{frame:?} {order:?}: {worst:e}");
                }
                // Nothing changed: the relief to the bit.
                let same = maps::read_back(&displaced, &params, &made, &made, &Silent).unwrap();
                assert_eq!(same, reliefs);
            }
        }
    }
}

#[test]
fn object_maps_have_the_same_bits_on_both_sides_of_every_seam_at_any_resolution() {
    for work in [cube(17, CurveKind::Smooth, blob), torus(13), one_patch_torus([24, 17]), purse(17)] {
        let (surfaces, reliefs) = fitted(&work, 5);
        let displaced = Displaced { network: &work.network, surfaces: &surfaces, reliefs: &reliefs };
        for texels in [2, 7, 17, 50] {
            for kind in [MapKind::Vector, MapKind::Scalar, MapKind::Length] {
                let params = params(kind, MapFrame::Object, texels);
                let made = maps::render(&displaced, &no_mesh(), &params, &Silent).unwrap();
                let shapes = vec![[texels; 2]; made.len()];
                let seams = relief::seam_nodes(&work.network, &shapes).unwrap();
                assert!(!seams.is_empty());
                for members in seams {
                    let (p, n) = members[0];
                    let first = made[p as usize].texel(n as usize);
                    assert!(members.iter().all(|&(p, n)| made[p as usize].texel(n as usize) == first));
                }
            }
        }
    }
}

#[test]
fn resampled_reliefs_open_no_crack_above_1e_14() {
    let work = cube(17, CurveKind::Feature, blob);
    let (surfaces, reliefs) = fitted(&work, 5);
    let displaced = Displaced { network: &work.network, surfaces: &surfaces, reliefs: &reliefs };
    assert!(relief::widest_crack(&displaced).unwrap() < 1e-14);
    for n in [9, 23, 64] {
        let fine = relief::resample_all(&displaced, &[[n; 2]; 6]).unwrap();
        let crack = relief::widest_crack(&Displaced { reliefs: &fine, ..displaced }).unwrap();
        assert!(crack < 1e-14, "{n}: {crack:e}");
    }
    let same = relief::resample_all(&displaced, &[[17; 2]; 6]).unwrap();
    assert_eq!(same, reliefs);
}

#[test]
fn sides_that_were_edited_apart_agree_on_the_mean_the_first_or_the_last() {
    let work = torus(9);
    let (surfaces, mut reliefs) = fitted(&work, 5);
    for (p, r) in reliefs.iter_mut().enumerate() {
        r.vectors.iter_mut().for_each(|d| *d = DVec3::new(0.0, 0.0, p as f64));
    }
    let crack = |r: &[Relief]| {
        let displaced = Displaced { network: &work.network, surfaces: &surfaces, reliefs: r };
        relief::widest_crack(&displaced).unwrap()
    };
    assert!(crack(&reliefs) > 1.0);
    // Patches 0 and 1 share the nodes of column 8 of patch 0; row 4 is no corner.
    for (how, wanted) in [(Agreement::Average, 0.5), (Agreement::First, 0.0), (Agreement::Last, 1.0)] {
        let mut agreed = reliefs.clone();
        relief::agree(&work.network, &surfaces, &mut agreed, how).unwrap();
        assert!(crack(&agreed) < 1e-14);
        assert!((agreed[0].vectors[4 * 9 + 8].length() - wanted).abs() < 1e-3, "{how:?}");
    }
}

#[test]
fn a_plane_with_a_slope_has_its_normal_in_every_frame() {
    // z = 0.5 x over the unit square: the normal is (-0.5, 0, 1) / |.|.
    let work = sheet(1, 1, [false, false], [9, 9], |x, y| DVec3::new(x, y, 0.0));
    let surfaces = vec![surface::fit(&work.grids[0].points, 9, 9, [4, 4]).unwrap()];
    let vectors = (0..81).map(|k| DVec3::new(0.0, 0.0, 0.5 * (k % 9) as f64 / 8.0)).collect();
    let reliefs = vec![Relief { rows: 9, cols: 9, vectors }];
    let displaced = Displaced { network: &work.network, surfaces: &surfaces, reliefs: &reliefs };
    let wanted = DVec3::new(-0.5, 0.0, 1.0).normalize().as_vec3().to_array();
    for frame in [MapFrame::Surface, MapFrame::Object, MapFrame::Tangent] {
        let made = maps::render(&displaced, &no_mesh(), &params(MapKind::Normal, frame, 0), &Silent).unwrap();
        for k in 0..81 {
            let far = made[0].texel(k).iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(far < 1e-6, "{frame:?}: {:?}", made[0].texel(k));
        }
        let refused = maps::read_back(&displaced, &params(MapKind::Normal, frame, 0), &made, &made, &Silent);
        assert!(refused.is_err());
    }
}

#[test]
fn heights_by_rays_are_those_of_the_mesh_within_1e_9_and_the_relief_where_it_is_not_met() {
    // A plane at height 0.1 over half of the square; the relief says 0.08 everywhere.
    let work = sheet(1, 1, [false, false], [9, 9], |x, y| DVec3::new(x, y, 0.0));
    let surfaces = vec![surface::fit(&work.grids[0].points, 9, 9, [4, 4]).unwrap()];
    let reliefs = vec![Relief { rows: 9, cols: 9, vectors: vec![DVec3::new(0.0, 0.0, 0.08); 81] }];
    let displaced = Displaced { network: &work.network, surfaces: &surfaces, reliefs: &reliefs };
    let at = |x, y| DVec3::new(x, y, 0.1);
    let mesh =
        TriMesh::new(vec![at(-1.0, -1.0), at(0.5, -1.0), at(0.5, 2.0), at(-1.0, 2.0)], vec![[0, 1, 2], [0, 2, 3]]);
    let made = maps::render(&displaced, &mesh, &params(MapKind::Height, MapFrame::Surface, 0), &Silent).unwrap();
    for k in 0..81 {
        let wanted = if k % 9 < 4 { 0.1f32 } else { 0.08 };
        if k % 9 != 4 {
            assert!((made[0].values[k] - wanted).abs() < 1e-8, "{k}: {}", made[0].values[k]);
        }
    }
}

#[test]
fn scalar_and_length_maps_change_what_they_hold_and_nothing_else() {
    let work = wavy([9, 9]);
    let (surfaces, reliefs) = fitted(&work, 4);
    let displaced = Displaced { network: &work.network, surfaces: &surfaces, reliefs: &reliefs };
    let scalar = params(MapKind::Scalar, MapFrame::Surface, 0);
    let made = maps::render(&displaced, &no_mesh(), &scalar, &Silent).unwrap();
    let mut changed = made.clone();
    changed[2].values[40] = 7.0;
    let back = maps::read_back(&displaced, &scalar, &changed, &made, &Silent).unwrap();
    let was = reliefs[2].vectors[40];
    assert_eq!(back[2].vectors[40], DVec3::new(was.x, was.y, 7.0));
    let mut rest = back;
    rest[2].vectors[40] = was;
    assert_eq!(rest, reliefs);
    let length = params(MapKind::Length, MapFrame::Surface, 0);
    let made = maps::render(&displaced, &no_mesh(), &length, &Silent).unwrap();
    let mut changed = made.clone();
    changed[2].values[40] *= 2.0;
    let back = maps::read_back(&displaced, &length, &changed, &made, &Silent).unwrap();
    assert!(back[2].vectors[40].distance(was * 2.0) < 1e-6 * was.length());
}

#[test]
fn attributes_that_are_linear_on_the_mesh_are_linear_in_the_map() {
    let corner = |x, y| DVec3::new(x, y, 0.0);
    let mut mesh = TriMesh::new(
        vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)],
        vec![[0, 1, 2], [0, 2, 3]],
    );
    let values = vec![0.0, 1.0, 1.0, 1.0, 1.0, 3.0, 0.0, 3.0];
    mesh.attributes.push(Attribute { name: "heat".into(), width: 2, values });
    // u on the first number, 1 + 2 v on the second... at the corners of a square.
    let mut grid = grid(5, 5, corner);
    let place = |k: usize| {
        let (u, v) = ((k % 5) as f64 / 4.0, (k / 5) as f64 / 4.0);
        if u >= v {
            FacePoint { face: 0, bary: [1.0 - u, u - v, v] }
        } else {
            FacePoint { face: 1, bary: [1.0 - v, u, v - u] }
        }
    };
    grid.places = (0..25).map(place).collect();
    let made = maps::attribute_maps(&mesh, &[grid], "heat", &[[9, 17]]).unwrap().unwrap();
    for k in 0..9 * 17 {
        let (u, v) = ((k % 17) as f32 / 16.0, (k / 17) as f32 / 8.0);
        let [a, b] = [made[0].texel(k)[0], made[0].texel(k)[1]];
        assert!((a - u).abs() < 1e-6 && (b - (1.0 + 2.0 * v)).abs() < 1e-6, "{u} {v}: {a} {b}");
    }
    assert!(maps::attribute_maps(&mesh, &[], "colour", &[]).unwrap().is_none());
}

#[test]
fn patches_on_sheets_do_not_overlap_and_tiles_are_numbered_from_1001() {
    let shapes: Vec<[usize; 2]> = (0..40).map(|k| [9 + 7 * (k % 5), 17 + 3 * (k % 7)]).collect();
    for (kind, gutter) in [(SheetKind::Patch, 0), (SheetKind::Atlas, 4), (SheetKind::Udim, 2)] {
        let sheet = maps::pack(&shapes, kind, gutter, 64).unwrap();
        let mut used: Vec<Vec<bool>> = sheet.images.iter().map(|[w, h]| vec![false; w * h]).collect();
        for (spot, [rows, cols]) in sheet.spots.iter().zip(&shapes) {
            let [width, height] = sheet.images[spot.image];
            for y in spot.y - gutter..spot.y + rows + gutter {
                for x in spot.x - gutter..spot.x + cols + gutter {
                    assert!(x < width && y < height);
                    assert!(!std::mem::replace(&mut used[spot.image][y * width + x], true), "{kind:?}");
                }
            }
        }
        assert_eq!(sheet.udim(0), (kind == SheetKind::Udim).then_some(1001));
    }
    let tiles = maps::pack(&shapes, SheetKind::Udim, 2, 64).unwrap();
    assert!(tiles.images.len() > 10 && tiles.images.iter().all(|s| *s == [64, 64]));
    let last = tiles.spots.iter().position(|s| s.image == 10).unwrap();
    let [u, v] = tiles.uv(last, 0, 0);
    assert!(u < 1.0 && (1.0..2.0).contains(&v), "tile 1011 is the first of the second row: {u} {v}");
    assert_eq!(maps::pack(&shapes, SheetKind::Udim, 2, 32).unwrap_err(), 3);
}

#[test]
fn maps_are_the_same_to_the_bit_on_1_and_4_threads() {
    let work = cube(17, CurveKind::Smooth, blob);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (surfaces, reliefs) = fitted(&work, 6);
            let displaced = Displaced { network: &work.network, surfaces: &surfaces, reliefs: &reliefs };
            let all = [MapKind::Vector, MapKind::Normal, MapKind::Scalar];
            all.map(|kind| maps::render(&displaced, &no_mesh(), &params(kind, MapFrame::Tangent, 33), &Silent).unwrap())
        })
    };
    assert_eq!(run(1), run(4));
}
