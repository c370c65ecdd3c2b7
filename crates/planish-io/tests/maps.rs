//! Maps in every kind of file: what is written comes back, and what is broken is told.

mod common;

use common::folder;
use planish::mesh::TriMesh;
use planish::network::{Corner, Curve, CurveKind, Network, Patch, Side};
use planish::relief::maps::{self, AxisOrder, MapFrame, MapKind, MapParams, PatchMap, SheetKind};
use planish::relief::{self, Displaced, Relief};
use planish::surface::{Surface, fit};
use planish::{DVec3, Silent, Units};
use planish_io::maps::{
    MapFile, MapOptions, as_read, in_one_png, materialx, other_ways, read_maps, read_picture, write_maps,
};

/// Two patches side by side on a bent sheet, with a relief of waves.
struct Pair {
    network: Network,
    surfaces: Vec<Surface>,
    reliefs: Vec<Relief>,
}

fn pair() -> Pair {
    let place = planish::mesh::FacePoint::corner(0, 0);
    // 3 -- 4 -- 5 above 0 -- 1 -- 2.
    let ends = [[0, 1], [1, 4], [3, 4], [0, 3], [1, 2], [2, 5], [4, 5]];
    let curve = |corners| Curve { corners, kind: CurveKind::Smooth, points: Vec::new() };
    let side = |curve, reversed| Side { curve, reversed };
    let patch = |a, b, c, d| Patch { sides: [side(a, false), side(b, false), side(c, true), side(d, true)] };
    let network = Network {
        corners: vec![Corner { place }; 6],
        curves: ends.map(curve).to_vec(),
        patches: vec![patch(0, 1, 2, 3), patch(4, 5, 6, 1)],
    };
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.1 * x * x);
    let surface = |p: usize| {
        let points: Vec<DVec3> =
            (0..9 * 17).map(|k| at(p as f64 + (k % 17) as f64 / 16.0, (k / 17) as f64 / 8.0)).collect();
        fit(&points, 9, 17, [5, 5]).unwrap()
    };
    let wave = |p: usize, k: usize| {
        let t = (k % 17) as f64 / 16.0 + p as f64;
        DVec3::new(0.01 * t.sin(), 0.02 * (3.0 * t).cos(), 0.1 * (7.0 * t).sin())
    };
    let relief = |p| Relief { rows: 9, cols: 17, vectors: (0..9 * 17).map(|k| wave(p, k)).collect() };
    Pair { network, surfaces: vec![surface(0), surface(1)], reliefs: vec![relief(0), relief(1)] }
}

fn options(params: MapParams, file: MapFile) -> MapOptions {
    MapOptions {
        params,
        file,
        upside_down: false,
        max_error: None,
        wiring: String::new(),
        relief: None,
        units: Units::Cm,
        companions: Vec::new(),
    }
}

fn made(pair: &Pair, params: &MapParams) -> Vec<PatchMap> {
    let displaced = Displaced { network: &pair.network, surfaces: &pair.surfaces, reliefs: &pair.reliefs };
    maps::render(&displaced, &TriMesh::default(), params, &Silent).unwrap()
}

fn packed(all: &[PatchMap], params: &MapParams) -> maps::Sheet {
    let shapes: Vec<[usize; 2]> = all.iter().map(|m| [m.rows, m.cols]).collect();
    maps::pack(&shapes, params.sheets, params.gutter, params.tile).unwrap()
}

#[test]
fn every_kind_frame_sheet_and_file_comes_back_as_what_it_holds() {
    let pair = pair();
    for kind in [MapKind::Vector, MapKind::Scalar, MapKind::Length, MapKind::Normal] {
        for (frame, order) in [
            (MapFrame::Surface, AxisOrder::Tbn),
            (MapFrame::Tangent, AxisOrder::Tnb),
            (MapFrame::Object, AxisOrder::TbnDown),
        ] {
            for (sheets, texels) in [(SheetKind::Patch, 0), (SheetKind::Atlas, 20), (SheetKind::Udim, 20)] {
                let params = MapParams { kind, frame, order, sheets, texels, gutter: 2, tile: 32 };
                let all = made(&pair, &params);
                let most = all.iter().flat_map(|m| &m.values).fold(0f32, |a, x| a.max(x.abs()));
                for (file, error) in [
                    (MapFile::Exr, 0.0),
                    (MapFile::ExrHalf, 5e-4),
                    (MapFile::Png, 2.0 / 65535.0),
                    (MapFile::Tiff, 2.0 / 65535.0),
                ] {
                    let folder = folder();
                    let sheet = packed(&all, &params);
                    let options = MapOptions { upside_down: texels == 20, ..options(params.clone(), file) };
                    let sidecar = write_maps(folder.path(), &all, &[], &sheet, &pair.surfaces, &options).unwrap();
                    let back = read_maps(folder.path()).unwrap();
                    assert_eq!(back.sidecar, sidecar);
                    assert_eq!(back.maps, as_read(all.clone(), &sidecar), "{kind:?} {frame:?} {sheets:?} {file:?}");
                    let pairs = all.iter().zip(&back.maps).flat_map(|(a, b)| a.values.iter().zip(&b.values));
                    let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0f32, f32::max);
                    assert!(worst <= error * most, "{kind:?} {file:?}: {worst} of {most}");
                }
            }
        }
    }
}

#[test]
fn gutters_repeat_the_border_and_the_first_row_is_the_upper_one() {
    let pair = pair();
    let params = MapParams { kind: MapKind::Scalar, sheets: SheetKind::Atlas, gutter: 3, ..MapParams::default() };
    let all = made(&pair, &params);
    let folder = folder();
    let sheet = packed(&all, &params);
    write_maps(folder.path(), &all, &[], &sheet, &pair.surfaces, &options(params, MapFile::Exr)).unwrap();
    let picture = read_picture(&folder.path().join("atlas.exr")).unwrap();
    let [width, height] = sheet.images[0];
    assert_eq!([picture.width, picture.height], [width, height]);
    for (map, spot) in all.iter().zip(&sheet.spots) {
        for (x, i) in [(0, 0), (3, 0), (3 + 16, 16), (3 + 16 + 3, 16)] {
            for (y, j) in [(0, 0), (3, 0), (3 + 8, 8), (3 + 8 + 3, 8)] {
                let row = height - 1 - (spot.y - 3 + y);
                let found = picture.pixels[row * width + spot.x - 3 + x][0];
                assert_eq!(found, map.values[j * map.cols + i]);
            }
        }
    }
}

#[test]
fn surfaces_and_maps_read_from_files_give_the_grid_within_1e_6_of_the_diagonal_in_each_frame() {
    let mut pair = pair();
    relief::agree(&pair.network, &pair.surfaces, &mut pair.reliefs, relief::Agreement::Average).unwrap();
    let displaced = Displaced { network: &pair.network, surfaces: &pair.surfaces, reliefs: &pair.reliefs };
    let mesh = |reliefs: &[Relief]| relief::displaced_mesh(&pair.network, &pair.surfaces, reliefs, &Silent).unwrap();
    let grid = mesh(&pair.reliefs);
    for frame in [MapFrame::Surface, MapFrame::Object, MapFrame::Tangent] {
        for order in [AxisOrder::Tbn, AxisOrder::Tnb, AxisOrder::TbnDown] {
            let params = MapParams { frame, order, ..MapParams::default() };
            let all = made(&pair, &params);
            let folder = folder();
            let options = options(params.clone(), MapFile::Exr);
            write_maps(folder.path(), &all, &[], &packed(&all, &params), &pair.surfaces, &options).unwrap();
            let back = read_maps(folder.path()).unwrap().maps;
            // As if every texel had been changed, so that all are taken from the files.
            let mut changed = all.clone();
            changed.iter_mut().flat_map(|m| &mut m.values).for_each(|x| *x += 1.0);
            let read = maps::read_back(&displaced, &params, &back, &changed, &Silent).unwrap();
            let found = mesh(&read);
            let worst = grid.points.iter().zip(&found.points).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            let diagonal = grid.bounds().diagonal();
            assert!(worst > 0.0 && worst < 1e-6 * diagonal, "{frame:?} {order:?}: {worst} of {diagonal}");
            // What patches share is one vertex, whatever the maps say: no crack. In object space the maps say the same.
            assert_eq!(found.points.len(), 2 * 9 * 17 - 9);
            for row in (0..9).filter(|_| frame == MapFrame::Object) {
                assert_eq!(back[0].texel(row * 17 + 16), back[1].texel(row * 17), "row {row}");
            }
        }
    }
}

/// Distances between the texels of two sets of maps.
fn distances(a: &[PatchMap], b: &[PatchMap]) -> Vec<f64> {
    let far = |(x, y): (&[f32], &[f32])| x.iter().zip(y).map(|(x, y)| (*x as f64 - *y as f64).powi(2)).sum::<f64>();
    let one = |(a, b): (&PatchMap, &PatchMap)| {
        let texels = a.values.chunks(a.channels).zip(b.values.chunks(a.channels));
        texels.map(far).map(f64::sqrt).collect::<Vec<_>>()
    };
    a.iter().zip(b).flat_map(one).collect()
}

#[test]
fn rounding_stays_within_the_bound_and_makes_files_smaller() {
    let pair = pair();
    for (kind, frame) in [
        (MapKind::Vector, MapFrame::Surface),
        (MapKind::Vector, MapFrame::Object),
        (MapKind::Scalar, MapFrame::Surface),
        (MapKind::Length, MapFrame::Surface),
    ] {
        for file in [MapFile::Exr, MapFile::ExrHalf, MapFile::Png, MapFile::Tiff] {
            let sheets = if file == MapFile::Tiff { SheetKind::Atlas } else { SheetKind::Patch };
            let params = MapParams { kind, frame, sheets, texels: 65, ..MapParams::default() };
            let all = made(&pair, &params);
            let sheet = packed(&all, &params);
            let size = |max_error: f64| {
                let folder = folder();
                let options = MapOptions { max_error: Some(max_error), ..options(params.clone(), file) };
                let sidecar = write_maps(folder.path(), &all, &[], &sheet, &pair.surfaces, &options).unwrap();
                let back = read_maps(folder.path()).unwrap();
                let worst = distances(&all, &back.maps).into_iter().fold(0.0, f64::max);
                assert!(worst <= max_error && worst > 0.2 * max_error, "{kind:?} {file:?}: {worst} of {max_error}");
                assert_eq!(back.maps, as_read(all.clone(), &sidecar), "{kind:?} {file:?}");
                let bytes =
                    |i: &planish_io::maps::ImageEntry| std::fs::metadata(folder.path().join(&i.file)).unwrap().len();
                back.sidecar.images.iter().map(bytes).sum::<u64>()
            };
            // Half floats have 11 bits, and the largest displacement is 0.1.
            let coarser = if file == MapFile::ExrHalf { 10.0 } else { 1.0 };
            let sizes = [1e-5 * coarser, 1e-4 * coarser, 1e-3 * coarser].map(size);
            assert!(sizes.windows(2).all(|w| w[1] < w[0]), "{kind:?} {file:?}: {sizes:?}");
        }
    }
}

#[test]
fn rounded_maps_of_the_object_frame_have_the_same_bits_on_both_sides_of_a_seam() {
    let mut pair = pair();
    relief::agree(&pair.network, &pair.surfaces, &mut pair.reliefs, relief::Agreement::Average).unwrap();
    for file in [MapFile::Exr, MapFile::Png] {
        let params = MapParams { frame: MapFrame::Object, ..MapParams::default() };
        let all = made(&pair, &params);
        let folder = folder();
        let options = MapOptions { max_error: Some(1e-3), ..options(params.clone(), file) };
        write_maps(folder.path(), &all, &[], &packed(&all, &params), &pair.surfaces, &options).unwrap();
        let back = read_maps(folder.path()).unwrap().maps;
        for row in 0..9 {
            assert_eq!(back[0].texel(row * 17 + 16), back[1].texel(row * 17), "{file:?}, row {row}");
        }
    }
}

#[test]
fn one_png_of_rounded_maps_takes_a_third_of_what_half_floats_take() {
    let pair = pair();
    let params = MapParams { texels: 65, ..MapParams::default() };
    let all = made(&pair, &params);
    let sheet = packed(&all, &params);
    let (bytes, error) = in_one_png(&all, MapKind::Vector, 1e-4).unwrap().unwrap();
    let [(half, half_error), (dwa, dwa_error)] = other_ways(&all, &sheet).unwrap();
    assert!(3 * bytes < half && error <= 1e-4, "{bytes} {error}: {half}");
    assert!(half_error > 0.0 && half_error < 1e-4 && dwa > 0 && dwa_error > half_error && dwa_error < 2e-2);
    // 16 bits have 65536 steps and no more.
    assert_eq!(in_one_png(&all, MapKind::Vector, 1e-7).unwrap(), None);
    let folder = folder();
    let fine = MapOptions { max_error: Some(1e-7), ..options(params.clone(), MapFile::Png) };
    let told = write_maps(folder.path(), &all, &[], &sheet, &pair.surfaces, &fine).unwrap_err().to_string();
    assert!(told.contains("16-bit whole numbers cannot keep an error of 1e-7 here; the least they can is "), "{told}");
    let fine = MapOptions { max_error: Some(1e-6), ..options(params.clone(), MapFile::ExrHalf) };
    let told = write_maps(folder.path(), &all, &[], &sheet, &pair.surfaces, &fine).unwrap_err().to_string();
    assert!(told.contains("half floats cannot keep an error of 1e-6 here; the least they can is "), "{told}");
}

#[test]
fn regress_a_bound_of_1e_300_is_kept_exactly_by_floats_and_the_least_that_is_told_does_for_the_others() {
    let pair = pair();
    for kind in [MapKind::Vector, MapKind::Scalar] {
        let params = MapParams { kind, ..MapParams::default() };
        let all = made(&pair, &params);
        let sheet = packed(&all, &params);
        let written = |file: MapFile, max_error: f64| {
            let folder = folder();
            let options = MapOptions { max_error: Some(max_error), ..options(params.clone(), file) };
            let sidecar = write_maps(folder.path(), &all, &[], &sheet, &pair.surfaces, &options)?;
            let back = read_maps(folder.path()).unwrap().maps;
            assert_eq!(back, as_read(all.clone(), &sidecar));
            Ok::<_, planish_io::WriteError>(distances(&all, &back).into_iter().fold(0.0, f64::max))
        };
        for bound in [1e-300, 1e-20, 1e-12, 1e-8] {
            assert!(written(MapFile::Exr, bound).unwrap() <= bound, "{bound:e}");
            for file in [MapFile::ExrHalf, MapFile::Png, MapFile::Tiff] {
                let told = written(file, bound).unwrap_err().to_string();
                let (_, least) = told.split_once("the least they can is ").expect(&told);
                let least: f64 = least.split(' ').next().unwrap().parse().unwrap();
                let error = written(file, least).unwrap();
                assert!(error <= least && error > 0.2 * least, "{file:?}: {error:e} of {least:e}");
            }
        }
    }
}

#[test]
fn regress_maps_in_object_space_do_not_pass_for_maps_in_the_frame_of_the_surface() {
    let pair = pair();
    let params = MapParams { frame: MapFrame::Object, ..MapParams::default() };
    let all = made(&pair, &params);
    let folder = folder();
    let options = options(params.clone(), MapFile::Exr);
    write_maps(folder.path(), &all, &[], &packed(&all, &params), &pair.surfaces, &options).unwrap();
    let path = folder.path().join("relief.json");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("\"object\"", "\"surface\"")).unwrap();
    let told = read_maps(folder.path()).unwrap_err().to_string();
    assert!(told.contains("\"vector object tbn\"") && told.contains("\"vector surface tbn\""), "{told}");
}

#[test]
fn images_of_another_frame_than_the_sidecar_tells_are_refused_in_every_kind_of_file() {
    let pair = pair();
    for file in [MapFile::Exr, MapFile::ExrHalf, MapFile::Png, MapFile::Tiff] {
        let folder = folder();
        for frame in [MapFrame::Surface, MapFrame::Object] {
            let params = MapParams { frame, ..MapParams::default() };
            let all = made(&pair, &params);
            let sidecar = std::fs::read(folder.path().join("relief.json"));
            write_maps(folder.path(), &all, &[], &packed(&all, &params), &pair.surfaces, &options(params, file))
                .unwrap();
            read_maps(folder.path()).unwrap();
            if let Ok(before) = sidecar {
                std::fs::write(folder.path().join("relief.json"), before).unwrap();
            }
        }
        let told = read_maps(folder.path()).unwrap_err().to_string();
        assert!(told.contains("it holds \"vector object tbn\", and relief.json tells of"), "{file:?}: {told}");
    }
}

#[test]
fn broken_maps_are_told_in_one_line_with_a_hint() {
    let pair = pair();
    let params = MapParams::default();
    let all = made(&pair, &params);
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let sheet = packed(&all, &params);
    let reset = || {
        write_maps(folder.path(), &all, &[], &sheet, &pair.surfaces, &options(params.clone(), MapFile::Exr)).unwrap();
    };
    let told = |wanted: &str| {
        let text = read_maps(folder.path()).unwrap_err().to_string();
        assert!(text.contains(wanted) && text.contains(" - hint: ") && !text.contains('\n'), "{text}");
        reset();
    };
    reset();
    std::fs::remove_file(at("patch_0001.exr")).unwrap();
    told("patch_0001.exr");
    let whole = std::fs::read(at("patch_0000.exr")).unwrap();
    std::fs::write(at("patch_0000.exr"), &whole[..whole.len() / 2]).unwrap();
    told("patch_0000.exr: ");
    std::fs::write(at("patch_0000.exr"), "no image at all").unwrap();
    told("patch_0000.exr: ");
    // As another program may have left it.
    let pixel = |x: usize, y: usize| if [x, y] == [1, 8] { (0.0, f32::NAN, 0.0) } else { (0.0, 0.0, 0.0) };
    exr::prelude::write_rgb_file(at("patch_0001.exr"), 17, 9, pixel).unwrap();
    told("pixel 1, 8 is NaN, not a finite number");
    let text = std::fs::read_to_string(at("relief.json")).unwrap();
    for (from, to, words) in [
        ("\"width\": 17", "\"width\": 18", "it has 17 x 9 pixels, not 18 x 9"),
        ("\"planish_relief\": 2", "\"planish_relief\": 3", "version 3"),
        ("\"planish_relief\": 2", "\"planish_relief\": \"x\"", "is not that of maps"),
        ("\"kind\": \"vector\"", "\"kind\": \"hair\"", "unknown variant"),
        ("\"scale\": 1.0", "\"scale\": 0.0", "no numbers of a map"),
        ("\"bits\": 32", "\"bits\": 77", "numbers of so many bits"),
        ("patch_0000.exr", "../patch_0000.exr", "another folder"),
        ("\"x\": 0", "\"x\": 18446744073709551615", "outside of its image"),
    ] {
        assert!(text.contains(from), "{from}");
        std::fs::write(at("relief.json"), text.replace(from, to)).unwrap();
        told(words);
    }
    std::fs::remove_file(at("relief.json")).unwrap();
    told("relief.json");
    // One channel where three are wanted.
    let scalar = MapParams { kind: MapKind::Scalar, ..MapParams::default() };
    let heights = made(&pair, &scalar);
    write_maps(folder.path(), &heights, &[], &sheet, &pair.surfaces, &options(params.clone(), MapFile::Exr)).unwrap();
    told("it has 1 channel, not 3");
}

#[test]
fn displacements_beyond_numbers_of_32_bits_are_not_written() {
    let mut pair = pair();
    let folder = folder();
    let params = MapParams::default();
    let write = |pair: &Pair| {
        let all = made(pair, &params);
        let options = options(params.clone(), MapFile::Exr);
        write_maps(folder.path().join("o"), &all, &[], &packed(&all, &params), &pair.surfaces, &options)
    };
    pair.reliefs[1].vectors[7] *= 1e300;
    let text = write(&pair).unwrap_err().to_string();
    assert!(text.contains("(patch 1)") && text.contains(" - hint: ") && !folder.path().join("o").exists(), "{text}");
    // The largest that there are have a length that is told all the same.
    pair.reliefs[1].vectors[7] = DVec3::new(1e38, 0.0, 0.0);
    write(&pair).unwrap();
    let largest = read_maps(folder.path().join("o")).unwrap().sidecar.largest;
    assert!((largest / 1e38 - 1.0).abs() < 1e-6, "{largest}");
}

#[test]
fn materialx_names_every_image_and_refuses_what_it_has_no_node_for() {
    let pair = pair();
    let wired = |params: MapParams| {
        let folder = folder();
        let all = made(&pair, &params);
        let sheet = packed(&all, &params);
        let sidecar =
            write_maps(folder.path(), &all, &[], &sheet, &pair.surfaces, &options(params, MapFile::Exr)).unwrap();
        (materialx(&sidecar), sidecar)
    };
    for kind in [MapKind::Vector, MapKind::Scalar, MapKind::Normal] {
        for sheets in [SheetKind::Patch, SheetKind::Udim] {
            let (text, sidecar) =
                wired(MapParams { kind, sheets, frame: MapFrame::Tangent, tile: 32, ..MapParams::default() });
            let text = text.unwrap();
            let named = sidecar.images.iter().all(|i| text.contains(&format!("value=\"{}\"", i.file)));
            assert!(named || text.contains("relief.&lt;UDIM&gt;.exr"), "{text}");
            assert_eq!(text.matches("<surfacematerial").count(), if sheets == SheetKind::Udim { 1 } else { 2 });
        }
    }
    assert!(wired(MapParams { frame: MapFrame::Object, ..MapParams::default() }).0.is_none());
    let text = wired(MapParams { order: AxisOrder::Tnb, ..MapParams::default() }).0.unwrap();
    assert!(text.contains("<combine3 ") && text.contains("nodename=\"parts\" output=\"outz\""), "{text}");
    let text = wired(MapParams { order: AxisOrder::TbnDown, ..MapParams::default() }).0.unwrap();
    assert!(text.contains("value=\"1, -1, 1\""), "{text}");
}

#[test]
fn attributes_stand_in_the_same_places() {
    let pair = pair();
    let params = MapParams { sheets: SheetKind::Atlas, ..MapParams::default() };
    let all = made(&pair, &params);
    let colour = |m: &PatchMap| PatchMap {
        values: (0..m.rows * m.cols * 3).map(|k| (k % 256) as f32 / 255.0).collect(),
        ..m.clone()
    };
    let colours: Vec<PatchMap> = all.iter().map(colour).collect();
    let folder = folder();
    let sheet = packed(&all, &params);
    let list = [("color".to_string(), colours)];
    let sidecar =
        write_maps(folder.path(), &all, &list, &sheet, &pair.surfaces, &options(params, MapFile::Png)).unwrap();
    assert_eq!(
        (sidecar.attributes[0].name.as_str(), &sidecar.attributes[0].files[..]),
        ("color", &["color_atlas.png".to_string()][..])
    );
    assert_eq!((sidecar.attributes[0].mid_level, sidecar.attributes[0].scale), (0.0, 1.0));
    let picture = read_picture(&folder.path().join("color_atlas.png")).unwrap();
    assert_eq!([picture.width, picture.height], sheet.images[0]);
    assert!(planish_io::relief_names(folder.path()).contains(&"color_atlas.png".to_string()));
    // A colour that is no number is refused before anything is written.
    let [(name, mut colours)] = list;
    colours[1].values[0] = f32::NAN;
    let folder = folder.path().join("none");
    let options = options(MapParams { sheets: SheetKind::Atlas, ..MapParams::default() }, MapFile::Png);
    let refused = write_maps(&folder, &all, &[(name, colours)], &sheet, &pair.surfaces, &options).unwrap_err();
    assert!(refused.to_string().contains("\"color\" that is not finite"), "{refused}");
    assert!(!folder.exists());
}

#[test]
fn regress_attributes_below_0_survive_whole_numbers_and_dark_colours_stay_dark() {
    let pair = pair();
    let params = MapParams { sheets: SheetKind::Atlas, ..MapParams::default() };
    let all = made(&pair, &params);
    let sheet = packed(&all, &params);
    let of = |channels: usize, value: fn(usize) -> f32| -> Vec<PatchMap> {
        let one = |m: &PatchMap| {
            let values = (0..m.rows * m.cols * channels).map(value).collect();
            PatchMap { rows: m.rows, cols: m.cols, channels, values }
        };
        all.iter().map(one).collect()
    };
    let quality = of(1, |k| (k % 121) as f32 - 61.86);
    let list = [("quality".to_string(), quality.clone()), ("color".to_string(), of(3, |k| (k % 100) as f32 / 255.0))];
    for (file, extension) in [(MapFile::Png, "png"), (MapFile::Tiff, "tif")] {
        let folder = folder();
        let options = options(params.clone(), file);
        let sidecar = write_maps(folder.path(), &all, &list, &sheet, &pair.surfaces, &options).unwrap();
        let [scalar, colour] = &sidecar.attributes[..] else { panic!("two attributes") };
        assert_eq!((colour.mid_level, colour.scale), (0.0, 1.0));
        let found = |name: &str, spot: &maps::Spot, map: &PatchMap, k: usize| {
            let picture = read_picture(&folder.path().join(format!("{name}_atlas.{extension}"))).unwrap();
            let row = sheet.images[0][1] - 1 - (spot.y + k / map.cols);
            f64::from(picture.pixels[row * picture.width + spot.x + k % map.cols][0])
        };
        for (map, spot) in quality.iter().zip(&sheet.spots) {
            for k in [0, 1, 60, 100] {
                let value = (found("quality", spot, map, k) - scalar.mid_level) * scalar.scale;
                assert!((value - f64::from(map.values[k])).abs() < 1e-2, "{value} for {}", map.values[k]);
            }
        }
        // The mean of three numbers of a hundred of 255.
        let grey = found("color", &sheet.spots[0], &all[0], 1);
        assert!((grey - 4.0 / 255.0).abs() < 1e-4, "{grey}");
        let bytes = std::fs::read(folder.path().join(format!("color_atlas.{extension}"))).unwrap();
        let has = |words: &str| bytes.windows(words.len()).any(|w| w == words.as_bytes());
        assert!(has("(number - 0) * 1") && !has("* 1 cm"));
    }
}

#[test]
fn what_a_preset_tells_to_type_is_in_the_numbers_of_the_files() {
    let pair = pair();
    let params = MapParams { kind: MapKind::Scalar, ..MapParams::default() };
    let all = made(&pair, &params);
    let folder = folder();
    let wiring = "centre {mid_level}, magnitude {scale_cm}".to_string();
    let options = MapOptions { wiring, units: Units::M, ..options(params.clone(), MapFile::Png) };
    let sidecar = write_maps(folder.path(), &all, &[], &packed(&all, &params), &pair.surfaces, &options).unwrap();
    let magnitude: f64 = sidecar.wiring.strip_prefix("centre 0.5, magnitude ").unwrap().parse().unwrap();
    assert!((magnitude / sidecar.scale / 100.0 - 1.0).abs() < 1e-5, "{magnitude} for {} m", sidecar.scale);
}
