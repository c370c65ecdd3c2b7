//! Edits of reliefs as layers: bands, brushes, stamps, regions, limits, transfer.

mod patchworks;

use glam::DVec3;
use patchworks::*;
use planish::Silent;
use planish::network::CurveKind;
use planish::relief::layers::{self, Ground, Layers, Picture, ReliefEdit};
use planish::relief::{self, Displaced, Relief};
use planish::surface::{self, FitParams, Resolution, Surface};

fn surfaces(work: &Patchwork, control: usize) -> Vec<Surface> {
    let params = FitParams {
        resolution: Resolution::Control([control, control]),
        cells_per_span: 1.0,
        smoothing: 0.0,
        ..FitParams::default()
    };
    surface::fit_network(&work.network, &work.grids, &params, &Silent).unwrap()
}

fn heights(work: &Patchwork, height: impl Fn(DVec3) -> f64) -> Vec<Relief> {
    let one = |g: &planish::grid::Grid| Relief {
        rows: g.rows,
        cols: g.cols,
        vectors: g.points.iter().map(|&p| DVec3::new(0.0, 0.0, height(p))).collect(),
    };
    work.grids.iter().map(one).collect()
}

fn flat(across: usize, nodes: usize) -> Patchwork {
    sheet(across, across, [false, false], [nodes, nodes], |x, y| DVec3::new(x, y, 0.0))
}

fn of(json: &str) -> ReliefEdit {
    serde_json::from_str(json).unwrap()
}

struct Edited<'a> {
    work: &'a Patchwork,
    surfaces: Vec<Surface>,
    layers: Layers,
}

impl<'a> Edited<'a> {
    fn new(work: &'a Patchwork, reliefs: &[Relief]) -> Edited<'a> {
        let mut layers = Layers::default();
        layers.begin(reliefs);
        Edited { work, surfaces: surfaces(work, 4), layers }
    }

    fn picture(name: &str) -> Result<Picture, String> {
        if name == "grey.png" {
            return Ok(Picture { width: 4, height: 4, pixels: vec![[0.5, 1.0]; 16] });
        }
        if name == "stripes.png" {
            let pixels = (0..256 * 256).map(|k| [(k % 2) as f32, 1.0]).collect();
            return Ok(Picture { width: 256, height: 256, pixels });
        }
        // The left half white, the right half transparent.
        let pixels = (0..8 * 4).map(|k| if k % 8 < 4 { [1.0, 1.0] } else { [1.0, 0.0] }).collect();
        Ok(Picture { width: 8, height: 4, pixels })
    }

    fn make(&mut self, json: &str) -> Result<Vec<String>, String> {
        let parts = (&self.work.network, &self.surfaces[..]);
        let made =
            layers::edit(&mut self.layers, parts, &of(json), &Edited::picture, &Silent).map_err(|e| e.to_string())?;
        self.layers.record("edit", json, made.stack);
        Ok(made.told)
    }

    fn sum(&self) -> Vec<Relief> {
        self.layers.sum().unwrap()
    }

    fn crack(&self) -> f64 {
        let reliefs = self.sum();
        relief::widest_crack(&Displaced { network: &self.work.network, surfaces: &self.surfaces, reliefs: &reliefs })
            .unwrap()
    }
}

#[test]
fn a_wave_goes_to_its_band_to_1e_3_and_bands_sum_to_the_bit() {
    let work = flat(2, 65);
    // Waves of length 0.125 and 1 on a square of side 2, even at its border.
    let wave = |p: DVec3, length: f64| (std::f64::consts::TAU * p.x / length).cos();
    let reliefs = heights(&work, |p| 0.01 * wave(p, 0.125) + 0.02 * wave(p, 1.0));
    let s = surfaces(&work, 4);
    let displaced = Displaced { network: &work.network, surfaces: &s, reliefs: &reliefs };
    let bands = layers::split(&displaced, &[0.4], &Silent).unwrap();
    assert_eq!(bands.len(), 2);
    for (band, wanted) in
        bands.iter().zip([heights(&work, |p| 0.02 * wave(p, 1.0)), heights(&work, |p| 0.01 * wave(p, 0.125))])
    {
        let pairs = band.maps.iter().flat_map(|m| &m.vectors).zip(wanted.iter().flat_map(|m| &m.vectors));
        let worst = pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(worst < 2e-6, "{worst:e}");
    }
    // The mean square of a cosine is a half.
    assert!((bands[0].rms - 0.02 / 2f64.sqrt()).abs() < 2e-4, "{}", bands[0].rms);
    assert!((bands[1].rms - 0.01 / 2f64.sqrt()).abs() < 2e-4, "{}", bands[1].rms);
    let three = layers::split(&displaced, &[0.2, 0.7], &Silent).unwrap();
    for (p, relief) in reliefs.iter().enumerate() {
        for (k, given) in relief.vectors.iter().enumerate() {
            let up: DVec3 = three.iter().map(|b| b.maps[p].vectors[k]).sum();
            let down: DVec3 = three.iter().rev().map(|b| b.maps[p].vectors[k]).sum();
            assert_eq!(up, down);
            assert!(up.distance(*given) < 1e-13);
        }
    }
}

#[test]
fn what_is_even_everywhere_is_no_short_wave_on_a_closed_surface() {
    let work = cube(17, CurveKind::Smooth, blob);
    let s = surfaces(&work, 6);
    let shapes: Vec<[usize; 2]> = work.grids.iter().map(|g| [g.rows, g.cols]).collect();
    let filter = layers::Filter::new(&work.network, &s, &shapes, &Silent).unwrap();
    let even: Vec<Vec<DVec3>> = work.grids.iter().map(|g| vec![DVec3::new(1.0, -2.0, 3.0); g.points.len()]).collect();
    let values = filter.base.gather(&even);
    for d in filter.low_pass(&values, 0.5, &Silent).unwrap() {
        assert!(d.distance(values[0]) < 1e-9, "{d}");
    }
    assert!((filter.rms(&values) - 14f64.sqrt()).abs() < 1e-12);
}

#[test]
fn a_blur_over_1e9_and_1e150_sizes_of_the_surface_leaves_the_mean_and_is_no_fault() {
    let work = flat(2, 17);
    let s = surfaces(&work, 6);
    let shapes: Vec<[usize; 2]> = work.grids.iter().map(|g| [g.rows, g.cols]).collect();
    let filter = layers::Filter::new(&work.network, &s, &shapes, &Silent).unwrap();
    // A half of the square is up by 1.
    let half = |p: &DVec3| DVec3::new(0.0, 0.0, if p.x < 1.0 { 1.0 } else { 0.0 });
    let nodes: Vec<Vec<DVec3>> = work.grids.iter().map(|g| g.points.iter().map(half).collect()).collect();
    for radius in [1e9, 1e150] {
        let soft = filter.blur(&filter.base.gather(&nodes), radius, &Silent).unwrap();
        let spread = soft.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], d| [a.min(d.z), b.max(d.z)]);
        assert!(spread[1] - spread[0] < 1e-6 && (0.45..0.55).contains(&spread[0]), "{radius}: {spread:?}");
    }
}

#[test]
fn a_stroke_has_its_height_in_the_middle_and_goes_on_over_seams_without_a_crack() {
    let work = flat(2, 33);
    let mut edited = Edited::new(&work, &heights(&work, |_| 0.0));
    // Along y = 1, where four patches meet, from x = 0.5 to 1.5.
    edited.make(r#"{"edit":"stroke","path":[[0.5,1,0],[1.5,1,0]],"radius":0.25,"height":0.1}"#).unwrap();
    let sum = edited.sum();
    for (grid, relief) in work.grids.iter().zip(&sum) {
        for (p, d) in grid.points.iter().zip(&relief.vectors) {
            let away = DVec3::new(p.x.clamp(0.5, 1.5), 1.0, 0.0).distance(*p);
            let t: f64 = (1.0 - away / 0.25).clamp(0.0, 1.0);
            let wanted = 0.1 * t * t * (3.0 - 2.0 * t);
            assert!(d.distance(DVec3::new(0.0, 0.0, wanted)) < 1e-12, "{p}: {d}");
        }
    }
    assert!(edited.crack() < 1e-14);
    // The other side of a thin wall, which faces away, stays as it was; a sharp edge has no crack.
    let thin = cube(17, CurveKind::Feature, |p| p * DVec3::new(1.0, 1.0, 0.01));
    let mut edited = Edited::new(&thin, &heights(&thin, |_| 0.0));
    edited.make(r#"{"edit":"stroke","path":[[0,0,0.01],[2,0,0.01]],"radius":0.3,"height":0.05}"#).unwrap();
    let sum = edited.sum();
    let bottom = thin.grids.iter().position(|g| g.points.iter().all(|p| p.z < 0.0)).unwrap();
    assert!(sum[bottom].vectors[8 * 17 + 8].length() < 1e-15);
    assert!(sum.iter().flat_map(|r| &r.vectors).any(|d| d.z > 0.04));
    assert!(edited.crack() < 1e-14);
}

#[test]
fn a_stamp_stands_upright_and_gives_way_where_it_is_transparent() {
    let work = flat(2, 33);
    let mut edited = Edited::new(&work, &heights(&work, |_| 0.5));
    edited.make(r#"{"edit":"stamp","image":"a.png","at":[1,1,0],"up":[0,1,0],"width":1,"height":-0.1}"#).unwrap();
    let at = |sum: &[Relief], x: f64, y: f64| {
        let near = |a: &(f64, f64), b: &(f64, f64)| a.0.total_cmp(&b.0);
        let all = work.grids.iter().zip(sum).flat_map(|(g, r)| g.points.iter().zip(&r.vectors));
        all.map(|(p, d)| (p.distance(DVec3::new(x, y, 0.0)), d.z)).min_by(near).unwrap().1
    };
    let sum = edited.sum();
    assert!((at(&sum, 0.75, 1.0) - 0.4).abs() < 1e-12, "white engraves");
    assert_eq!(at(&sum, 1.25, 1.0), 0.5, "transparent leaves");
    assert_eq!(at(&sum, 0.75, 1.4), 0.5, "above the image");
    edited
        .make(r#"{"edit":"stamp","image":"a.png","at":[1,1,0],"up":[1,0,0],"width":1,"height":0.3,"replace":true}"#)
        .unwrap();
    let sum = edited.sum();
    // Up is along x: left of the image is above, along y.
    assert!((at(&sum, 1.0, 1.25) - 0.3).abs() < 1e-12, "what was there gives way");
    assert_eq!(at(&sum, 1.25, 0.6), 0.5);
    assert!(edited.crack() < 1e-14);
}

#[test]
fn regress_stripes_of_a_pixel_finer_than_the_nodes_are_stamped_as_their_mean() {
    let work = flat(2, 33);
    let mut edited = Edited::new(&work, &heights(&work, |_| 0.0));
    edited.make(r#"{"edit":"stamp","image":"stripes.png","at":[1,1,0],"up":[0,1,0],"width":1,"height":0.1}"#).unwrap();
    for (grid, relief) in work.grids.iter().zip(&edited.sum()) {
        for (p, d) in grid.points.iter().zip(&relief.vectors) {
            if (*p - DVec3::new(1.0, 1.0, 0.0)).abs().max_element() < 0.45 {
                assert!((d.z - 0.05).abs() < 1e-6, "{p}: {}", d.z);
            }
        }
    }
}

#[test]
fn scale_threshold_erase_blur_and_sharpen_do_what_they_say() {
    let work = flat(2, 17);
    let bump = |p: DVec3| if p.distance(DVec3::new(1.0, 1.0, 0.0)) < 0.3 { 0.2 } else { 0.01 };
    let reliefs = heights(&work, bump);
    let z = |r: &[Relief]| r.iter().flat_map(|r| &r.vectors).map(|d| d.z).collect::<Vec<f64>>();
    let was = z(&reliefs);
    let after = |json: &str| {
        let mut edited = Edited::new(&work, &reliefs);
        edited.make(json).unwrap();
        assert!(edited.crack() < 1e-14);
        z(&edited.sum())
    };
    assert_eq!(after(r#"{"edit":"scale","factor":2.0}"#), was.iter().map(|z| z * 2.0).collect::<Vec<_>>());
    let low: Vec<f64> = was.iter().map(|&z| if z < 0.1 { 0.0 } else { z }).collect();
    assert_eq!(after(r#"{"edit":"threshold","height":0.1}"#), low);
    let erased = after(r#"{"edit":"erase","region":{"at":[1,1,0],"radius":0.4}}"#);
    assert!(erased.iter().zip(&was).all(|(e, w)| if *w > 0.1 { *e == 0.0 } else { *e <= *w }));
    // Along a path: all of the tube, and nothing beyond its radius.
    let along = |p: DVec3| (p.x - p.x.clamp(0.5, 1.5)).hypot(p.y - 1.0);
    let away: Vec<f64> = heights(&work, along).iter().flat_map(|r| &r.vectors).map(|d| d.z).collect();
    let tube = after(r#"{"edit":"erase","region":{"path":[[0.5,1,0],[1.5,1,0]],"radius":0.2}}"#);
    for ((t, w), away) in tube.iter().zip(&was).zip(&away) {
        assert_eq!(*t, if *away <= 0.2 { 0.0 } else { *w }, "{away}");
    }
    let outside = after(r#"{"edit":"erase","region":{"at":[1,1,0],"radius":0.4,"outside":true}}"#);
    assert!(outside.iter().zip(&was).all(|(o, w)| *w < 0.1 || o == w));
    let one = after(r#"{"edit":"erase","region":{"patches":[3]}}"#);
    assert!(one.iter().zip(&was).any(|(o, w)| o == w) && one.contains(&0.0));
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
    let soft = after(r#"{"edit":"blur","radius":0.1}"#);
    assert!(soft.iter().copied().fold(0.0, f64::max) < 0.2 && (mean(&soft) - mean(&was)).abs() < 2e-3);
    let hard = after(r#"{"edit":"sharpen","radius":0.1,"amount":1.0}"#);
    for ((s, h), w) in soft.iter().zip(&hard).zip(&was) {
        assert!((h - (2.0 * w - s)).abs() < 1e-12, "what is added is what a blur takes");
    }
}

#[test]
fn a_mask_takes_exactly_its_white_half_and_grey_a_half_of_all() {
    let work = flat(2, 33);
    let was = 0.3;
    let after = |json: &str| {
        let mut edited = Edited::new(&work, &heights(&work, |_| was));
        edited.make(json).unwrap();
        assert!(edited.crack() < 1e-14);
        let sum = edited.sum();
        let all = work.grids.iter().zip(&sum).flat_map(|(g, r)| g.points.iter().zip(&r.vectors));
        all.map(|(p, d)| (*p, d.z)).collect::<Vec<(DVec3, f64)>>()
    };
    // A pixel of the mask is as wide as 8 cells: its border, softened over one pixel, is at x = 1.
    let mask = r#""image":"a.png","at":[1,1,0],"up":[0,1,0],"width":2"#;
    for (outside, left) in [(false, 0.0), (true, was)] {
        let json = format!(r#"{{"edit":"erase","region":{{{mask},"outside":{outside}}}}}"#);
        for (p, z) in after(&json).into_iter().filter(|(p, _)| (p.y - 1.0).abs() < 0.3 && p.x > 0.2 && p.x < 1.8) {
            let wanted = if p.x < 0.87 { left } else { was - left };
            assert!(z == wanted || (0.87..1.13).contains(&p.x), "{p}: {z}");
        }
    }
    let grey = r#""image":"grey.png","at":[1,1,0],"up":[0,1,0],"width":3"#;
    assert!(
        after(&format!(r#"{{"edit":"scale","factor":3,"region":{{{grey}}}}}"#)).iter().all(|(_, z)| *z == 2.0 * was)
    );
    // Keys are multiplied: half of what is inside the ball, on the named patch alone.
    let both = after(&format!(r#"{{"edit":"erase","region":{{{grey},"radius":0.5,"patches":[0]}}}}"#));
    for (p, z) in both {
        let inside = p.distance(DVec3::new(1.0, 1.0, 0.0)) < 0.5 - 1e-9 && p.x < 1.0 && p.y < 1.0;
        let seam = p.x == 1.0 || p.y == 1.0;
        assert!((z - if inside { 0.5 * was } else { was }).abs() < 1e-15 || seam, "{p}: {z}");
    }
    // A stroke is let through by half, too.
    let stroke = format!(r#"{{"edit":"stroke","path":[[1,1,0]],"radius":0.5,"height":0.1,"region":{{{grey}}}}}"#);
    assert!(after(&stroke).iter().any(|(p, z)| p.x == 1.0 && p.y == 1.0 && (z - was - 0.05).abs() < 1e-12));
}

#[test]
fn detail_goes_along_with_pairs_to_a_turned_and_a_scaled_copy_and_is_exact_there() {
    let turn = glam::DMat3::from_rotation_z(0.8) * glam::DMat3::from_rotation_x(0.5);
    let height = |p: DVec3| 0.03 * (6.0 * p.x).sin() * (5.0 * p.y).cos();
    let shape = |p: DVec3| blob(p);
    for scale in [1.0, 2.5] {
        let (here, there) = (
            cube(17, CurveKind::Smooth, shape),
            cube(17, CurveKind::Smooth, |p| turn * shape(p) * scale + DVec3::new(4.0, 0.0, 1.0)),
        );
        let (a, b) = (surfaces(&here, 8), surfaces(&there, 8));
        let from: Vec<Relief> = heights(&here, height);
        let shapes = there.grids.iter().map(|g| [g.rows, g.cols]).collect();
        let ground = Ground::new(&there.network, &b, shapes).unwrap();
        let source = Displaced { network: &here.network, surfaces: &a, reliefs: &from };
        let place = |p: u32, u: f64| layers::Place::Patch { patch: p, u, v: 0.4 };
        let pairs: Vec<layers::PlacePair> =
            (0..6).flat_map(|p| [0.3, 0.7].map(|u| layers::PlacePair { from: place(p, u), to: place(p, u) })).collect();
        let warp = layers::warp(&ground, &source, &pairs, &Silent).unwrap();
        assert!(warp.affine && warp.bent < 1e-9, "{}", warp.bent);
        let (found, missed) = layers::transfer(&ground, &source, Some(&warp), 0.1, &Silent).unwrap();
        assert_eq!(missed, 0);
        // The base mesh has flat triangles: what is found between its vertices is off by their sag. Nodes inside are its vertices.
        for (found, from) in found.iter().zip(&from) {
            for k in (0..17 * 17).filter(|k| (1..16).contains(&(k % 17)) && (1..16).contains(&(k / 17))) {
                assert!(found.vectors[k].distance(from.vectors[k] * scale) < 1e-6, "{k}: {}", found.vectors[k]);
            }
        }
        let far = layers::PlacePair { from: layers::Place::Space([90.0, 0.0, 0.0]), to: pairs[0].to };
        let told = |pair| layers::warp(&ground, &source, &[pairs.clone(), vec![pair]].concat(), &Silent).unwrap_err();
        assert!(told(far).to_string().contains("pair 13, `from`: the place is"));
        let none = layers::PlacePair { from: pairs[0].from, to: place(99, 0.5) };
        assert!(told(none).to_string().contains("pair 13, `to`: there is no patch 99 among 6"));
        let out = layers::PlacePair { from: pairs[0].from, to: place(0, 1.5) };
        assert!(told(out).to_string().contains("from 0 to 1"));
    }
}

/// Bricks of .25 x .12 with mortar, and a number of its own for the height of each.
fn bricks(p: DVec3) -> f64 {
    let row = (p.y / 0.12).floor();
    let along = p.x / 0.25 + 0.5 * (row % 2.0);
    let (s, t) = ((along - along.floor() - 0.5).abs() * 0.25, (p.y / 0.12 - row - 0.5).abs() * 0.12);
    let high = 0.02 + 0.004 * (along.floor() * 5.3 + row * 2.1).sin();
    if s > 0.11 || t > 0.045 { 0.0 } else { high }
}

#[test]
fn a_constant_is_synthesised_as_a_constant_on_every_patch_of_a_sheet() {
    let work = flat(3, 17);
    let mut maps = heights(&work, |_| 0.0);
    maps[0].vectors.fill(DVec3::new(0.0, 0.0, 0.25));
    relief::agree(&work.network, &surfaces(&work, 4), &mut maps, relief::Agreement::First).unwrap();
    let mut edited = Edited::new(&work, &maps);
    edited.make(r#"{"edit":"synthesise","from":0,"to":[0,1,2,3,4,5,6,7,8]}"#).unwrap();
    for d in edited.sum().iter().flat_map(|r| &r.vectors) {
        assert!(d.distance(DVec3::new(0.0, 0.0, 0.25)) < 1e-12, "{d}");
    }
    assert!(edited.crack() < 1e-14);
}

#[test]
fn synthesised_bricks_keep_their_heights_join_at_seams_and_come_again_with_the_seed() {
    let work = flat(3, 65);
    let reliefs = heights(&work, |p| if p.x <= 1.0 && p.y <= 1.0 { bricks(p) } else { 0.0 });
    let run = |seed: u64, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut edited = Edited::new(&work, &reliefs);
            let json = format!(r#"{{"edit":"synthesise","from":0,"to":[1,2,3,4,5,6,7,8],"block":0.4,"seed":{seed}}}"#);
            edited.make(&json).unwrap();
            // Samples on both sides of every seam are one vector.
            assert!(edited.crack() < 1e-14);
            edited.sum()
        })
    };
    let sum = run(1, 1);
    assert_eq!(sum, run(1, 4), "any number of threads");
    assert_ne!(sum, run(2, 4), "another seed");
    assert_eq!(sum[0].vectors[33 * 65 + 20], reliefs[0].vectors[33 * 65 + 20], "the source stays");
    let z = |p: usize| sum[p].vectors.iter().map(|d| d.z);
    // As much mortar as in the source, about, and no height beyond it.
    let mortar = |p: usize| z(p).filter(|z| *z < 0.008).count() as f64 / (65.0 * 65.0);
    for p in 1..9 {
        assert!(
            z(p).all(|z| (-0.02..0.045).contains(&z)),
            "patch {p}: {:?}",
            z(p).fold([0.0f64; 2], |[a, b], z| [a.min(z), b.max(z)])
        );
        assert!((mortar(p) - mortar(0)).abs() < 0.1, "patch {p}: {} {}", mortar(p), mortar(0));
    }
    // At a seam the first column inside differs from the border about as much as columns inside differ from each other.
    let step = |p: usize, a: usize, b: usize| {
        (0..65).map(|j| (sum[p].vectors[j * 65 + a].z - sum[p].vectors[j * 65 + b].z).abs()).sum::<f64>() / 65.0
    };
    let usual = (1..64).map(|i| step(4, i, i + 1)).fold(0.0, f64::max);
    assert!(step(4, 0, 1).max(step(5, 0, 1)) <= 1.5 * usual, "{} {} {usual}", step(4, 0, 1), step(5, 0, 1));
}

#[test]
fn layers_come_back_in_every_order_of_undo_and_redo() {
    let work = flat(2, 9);
    let mut edited = Edited::new(&work, &heights(&work, |p| 0.1 * p.x));
    let start = edited.sum();
    edited.make(r#"{"edit":"stroke","path":[[1,1,0]],"radius":0.5,"height":0.1}"#).unwrap();
    let stroked = edited.sum();
    edited.make(r#"{"edit":"scale","factor":0.5,"layer":"stroke"}"#).unwrap();
    edited.make(r#"{"edit":"resample","texels":21}"#).unwrap();
    assert_eq!(edited.sum()[0].cols, 21);
    edited.make(r#"{"edit":"remove","layer":"stroke"}"#).unwrap();
    let end = edited.sum();
    assert!(edited.layers.undo() && edited.layers.undo() && edited.layers.undo());
    assert_eq!(edited.sum(), stroked);
    assert!(edited.layers.undo() && !edited.layers.undo());
    assert_eq!(edited.sum(), start);
    while edited.layers.redo() {}
    assert_eq!(edited.sum(), end);
    // A new edit forgets what was taken back, and maps that nothing names.
    edited.layers.undo();
    edited.layers.undo();
    edited.make(r#"{"edit":"erase"}"#).unwrap();
    assert!(!edited.layers.redo() && edited.layers.fits(4));
    assert_eq!(edited.layers.pool.len(), 3);
}

#[test]
fn edits_that_cannot_be_meant_tell_why() {
    let work = flat(1, 9);
    let mut edited = Edited::new(&work, &heights(&work, |_| 0.1));
    for (json, words) in [
        (r#"{"edit":"stroke","path":[],"radius":1,"height":1}"#, "needs places"),
        (r#"{"edit":"stroke","path":[{"patch":7,"u":0,"v":0}],"radius":1,"height":1}"#, "there is no patch 7 among 1"),
        (r#"{"edit":"stroke","path":[[0,0,0]],"radius":0,"height":1}"#, "radius above 0"),
        (r#"{"edit":"erase","region":{"patches":[1]}}"#, "no patch 1 among 1"),
        (r#"{"edit":"erase","region":{"at":[0,0,0]}}"#, "needs a radius"),
        (r#"{"edit":"erase","region":{"path":[[0,0,0]]}}"#, "needs a radius"),
        (r#"{"edit":"erase","region":{"path":[[0,0,0]],"at":[0,0,0],"radius":1}}"#, "one of path and at"),
        (r#"{"edit":"erase","region":{"image":"a.png"}}"#, "needs at, up and width"),
        (r#"{"edit":"erase","region":{"width":1}}"#, "name the image"),
        (r#"{"edit":"erase","region":{"image":"a.png","at":[0,0,0],"up":[0,0,1],"width":1}}"#, "along the normal"),
        (r#"{"edit":"erase","region":{"image":"a.png","at":[0,0,0],"up":[0,1,0],"width":0}}"#, "a width above 0"),
        (r#"{"edit":"threshold","height":0}"#, "above 0"),
        (r#"{"edit":"split","wavelengths":[]}"#, "above 0"),
        (r#"{"edit":"scale","factor":2,"layer":"hair"}"#, "no layer \"hair\"; there are baked"),
        (r#"{"edit":"remove","layer":"baked"}"#, "only layer"),
        (r#"{"edit":"resample","texels":1}"#, "2 to 16384"),
        (r#"{"edit":"tile","from":0,"to":[4]}"#, "no patch 4"),
        (r#"{"edit":"synthesise","from":0,"to":[4]}"#, "no patch 4"),
        (r#"{"edit":"synthesise","from":0,"to":[]}"#, "patches to fill"),
        (r#"{"edit":"synthesise","from":0,"to":[0],"block":9}"#, "blocks have sides from"),
        (r#"{"edit":"limit","share":2}"#, "at most 1"),
    ] {
        let told = edited.make(json).unwrap_err();
        assert!(told.contains(words), "{json}: {told}");
    }
}

#[test]
fn limited_displacements_stay_within_their_share_of_the_radius() {
    // Radius 1, the normal outward.
    let work = tube([61, 17]);
    let s = surfaces(&work, 12);
    let reliefs = vec![Relief { rows: 17, cols: 61, vectors: vec![DVec3::new(0.0, 0.0, -1.5); 17 * 61] }];
    let mut edited = Edited { surfaces: s, ..Edited::new(&work, &reliefs) };
    let told = edited.make(r#"{"edit":"limit","share":0.5}"#).unwrap();
    assert_eq!(told, ["1037 texels brought back"]);
    let sum = edited.sum();
    assert!(relief::fold_over(&edited.surfaces[0], &sum[0]).unwrap().is_empty());
    // Half the radius that the spline has at the node; at the seam, that of the side that bends more.
    for k in 0..17 * 61 {
        let bends = edited.surfaces[0].jet((k % 61) as f64 / 60.0, (k / 61) as f64 / 16.0).curvatures().unwrap();
        let share = sum[0].vectors[k].z * bends[1];
        assert!(share < 0.5 + 1e-9, "{k}: {share}");
        assert!(share > 0.5 - 1e-9 || !(1..60).contains(&(k % 61)), "{k}: {share}");
    }
}

#[test]
fn a_tiled_patch_repeats_mirrored_and_a_pasted_one_turns() {
    let work = flat(2, 17);
    let reliefs = heights(&work, |p| if p.x <= 1.0 && p.y <= 1.0 { p.x } else { 0.0 });
    let s = surfaces(&work, 4);
    let shapes: Vec<[usize; 2]> = work.grids.iter().map(|g| [g.rows, g.cols]).collect();
    let ground = Ground::new(&work.network, &s, shapes).unwrap();
    let tiled = layers::tile(&ground, &reliefs[0], &[3], [2, 1]);
    // Up to 1 in the middle of the patch and down again; its border is shared with patches that have none.
    for k in 1..16 {
        let wanted = if k <= 8 { k as f64 / 8.0 } else { (16 - k) as f64 / 8.0 };
        assert!((tiled[3].vectors[5 * 17 + k].z - wanted).abs() < 1e-12);
    }
    let turned = layers::paste(&ground, &reliefs[0], &[(1, 3)]);
    assert!((turned[3].vectors[5 * 17 + 3].z - 5.0 / 16.0).abs() < 1e-12);
}

#[test]
fn detail_goes_to_another_network_of_the_same_shape_by_closest_points() {
    let (coarse, fine) = (flat(1, 65), sheet(2, 2, [false, false], [33, 33], |x, y| DVec3::new(x / 2.0, y / 2.0, 0.0)));
    let height = |p: DVec3| 0.05 * (6.0 * p.x).sin() * (5.0 * p.y).cos();
    let (from, to) = (heights(&coarse, height), heights(&fine, height));
    let (a, b) = (surfaces(&coarse, 4), surfaces(&fine, 4));
    let shapes = fine.grids.iter().map(|g| [g.rows, g.cols]).collect();
    let ground = Ground::new(&fine.network, &b, shapes).unwrap();
    let source = Displaced { network: &coarse.network, surfaces: &a, reliefs: &from };
    let (found, missed) = layers::transfer(&ground, &source, None, 0.1, &Silent).unwrap();
    assert_eq!(missed, 0);
    let pairs = found.iter().flat_map(|r| &r.vectors).zip(to.iter().flat_map(|r| &r.vectors));
    let worst = pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn layers_are_the_same_to_the_bit_on_1_and_4_threads() {
    let work = cube(17, CurveKind::Smooth, blob);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut edited = Edited::new(&work, &heights(&work, |p| 0.01 * (20.0 * p.x).sin()));
            edited.make(r#"{"edit":"split","wavelengths":[0.4]}"#).unwrap();
            edited.make(r#"{"edit":"stroke","path":[[1,0,0],[0,1,0],[0,0,1]],"radius":0.3,"height":0.1}"#).unwrap();
            edited.make(r#"{"edit":"blur","radius":0.1}"#).unwrap();
            edited.sum()
        })
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn regress_regions_and_places_that_cannot_be_meant_are_refused_and_idle_edits_tell_so() {
    let work = flat(2, 17);
    let mut edited = Edited::new(&work, &heights(&work, |p| 0.01 * p.x));
    for (json, words) in [
        (r#"{"edit":"erase","region":{"radius":1}}"#, "give its middle, at"),
        (r#"{"edit":"erase","region":{"feather":1}}"#, "give its middle, at"),
        (r#"{"edit":"erase","region":{"radius":1,"at":{"patch":0,"u":1.5,"v":0}}}"#, "u and v go from 0 to 1"),
        (r#"{"edit":"stroke","path":[[100,100,10]],"radius":1,"height":1}"#, "further than the model is long"),
        (r#"{"edit":"stroke","path":[{"patch":9,"u":0,"v":0}],"radius":1,"height":1}"#, "there is no patch 9 among 4"),
        (r#"{"edit":"stroke","path":[],"radius":1,"height":1}"#, "needs places"),
        (r#"{"edit":"stroke","path":[[1,1,0]],"radius":1,"height":1e30}"#, "and the model is 2.828 long"),
        (r#"{"edit":"scale","factor":1e300}"#, "would be displaced by"),
        (r#"{"edit":"scale","factor":1e308}"#, "would be displaced by"),
    ] {
        let told = edited.make(json).unwrap_err();
        assert!(told.contains(words), "{json}: {told}");
    }
    let parts = (&work.network, &edited.surfaces[..]);
    let mut idle = |json: &str| {
        let made = layers::edit(&mut edited.layers, parts, &of(json), &Edited::picture, &Silent);
        made.unwrap().idle
    };
    assert!(idle(r#"{"edit":"stroke","path":[{"patch":0,"u":0.03,"v":0.03}],"radius":1e-4,"height":0.1}"#));
    assert!(!idle(r#"{"edit":"stroke","path":[[0.03,0.03,0]],"radius":0.2,"height":0.1}"#));
}
