//! `planish relief export`: maps as images.

use super::super::{Session, write_failure, write_text};
use super::{displaced, folds, open, shape, wrong};
use crate::args::relief::ReliefExport;
use crate::failure::{Failure, Status};
use crate::files;
use crate::placed;
use crate::products::Staged;
use crate::progress::Interrupt;
use crate::summary::Summary;
use crate::tolerance::Scale;
use planish::model::Model;
use planish::pipeline::Figure;
use planish::pipeline::key;
use planish::relief::Displaced;
use planish::relief::maps::{self, MapKind, MapParams, PatchMap, Preset, Sheet, SheetKind};
use planish_io::maps::{
    MapFile, MapOptions, Sidecar, as_read, in_one_png, largest_error, materialx, other_ways, read_maps, relief_sum,
    usd_materials, write_maps,
};
use planish_io::report::{Report, count, number};
use planish_io::{MappedMesh, UsdInput, WriteError, WriteOptions};
use std::path::Path;

/// The base mesh beside the maps.
const BASE: &str = "base.obj";
/// The wiring beside the maps.
const WIRING: &str = "relief.mtlx";
/// The base mesh with a material that reads the maps.
const SCENE: &str = "relief.usda";

pub fn export(session: &Session, args: &ReliefExport) -> Result<Status, Failure> {
    let own_report = session.stage_report()?;
    let preset = args.preset.and_then(|p| maps::preset(p.name()));
    let params = params(args, preset)?;
    let file = match (args.file, preset) {
        (Some(word), _) => word.into(),
        (None, Some(p)) => MapFile::of_word(p.file).unwrap_or_default(),
        (None, None) => MapFile::default(),
    };
    let staged = Staged::folder(&args.output)?;
    let (model, read) = open(session, &args.model)?;
    let mut report = Report::new("relief export", files::model_facts(&args.model, &model, model.units));
    let scale = Scale { diagonal: model.mesh.bounds().diagonal(), units: model.units };
    let max_error = args.max_error.map(|t| t.length(scale));
    if let (Some(e), MapKind::Normal) = (max_error, params.kind) {
        let what = format!("{} does not go with normals", number(e));
        return Err(Failure::usage("--max-error", what).hint("write vectors, scalars, lengths or heights"));
    }
    let (made, bake) = session.step("bake", || {
        let mesh = shape(&model, &params, &args.model)?;
        maps::render(&displaced(&model), &mesh, &params, &Interrupt).map_err(|e| wrong(&args.model, e))
    })?;
    let shapes: Vec<[usize; 2]> = made.iter().map(|m| [m.rows, m.cols]).collect();
    let sheet = maps::pack(&shapes, params.sheets, params.gutter, params.tile).map_err(|p| {
        let [rows, cols] = shapes[p];
        let what =
            format!("patch {p} of {cols} x {rows} texels and its gutter do not fit on a tile of {}", params.tile);
        Failure::usage("--tile", what).hint("raise it, or lower --texels")
    })?;
    let attributes = if args.attributes { attributes(&model, &shapes, &args.model)? } else { Vec::new() };
    let folder = staged.path("");
    let failed = |e| write_failure(&args.model, &args.output, e);
    let options = options(args, preset, file, &params, max_error, &model);
    let (sidecar, write) = session
        .step("write", || write_maps(&folder, &made, &attributes, &sheet, &model.surfaces, &options).map_err(failed))?;
    write_companions(args, &model, &sheet, &sidecar, &folder)?;
    let Measured { bytes, error, crack } = measured(&folder, &made, &model, &args.output)?;
    let triangles = model.mesh.triangles.len() as f64;
    let each =
        |bytes: u64| format!("{} bytes, {} a triangle of the mesh", count(bytes), number(bytes as f64 / triangles));
    report.quality.insert(key::RELIEF_MAP_BYTES.into(), Figure::Count(bytes));
    report.quality.insert(key::RELIEF_MAP_BYTES_PER_TRIANGLE.into(), Figure::Number(bytes as f64 / triangles));
    report.quality.insert(key::RELIEF_MAP_ERROR_MAX.into(), Figure::Number(error));
    if let Some(crack) = crack {
        report.quality.insert(key::RELIEF_MAP_CRACK_MAX.into(), Figure::Number(crack));
    }
    let others = max_error.map_or(Ok(Vec::new()), |e| others(&made, &sheet, &options, e)).map_err(failed)?;
    for other in &others {
        report.quality.insert(format!("relief.{}_bytes", other.key), Figure::Count(other.bytes));
        report.quality.insert(format!("relief.{}_error_max", other.key), Figure::Number(other.error));
    }
    folds(&model, &mut report, &args.model)?;
    report.stages = vec![read, bake, write];
    if session.hand_over([staged], own_report, &report)? {
        let mut table = Summary::default();
        table.row("model", args.model.display().to_string());
        table.row("maps", format!("{} of {} patches", params.kind.word(), made.len()));
        table.row("images", format!("{} in {}", sidecar.images.len(), args.output.display()));
        table.row("images take", each(bytes));
        let unit = if params.kind == MapKind::Normal { String::new() } else { format!(" {}", model.units) };
        if params.kind != MapKind::Normal {
            table.row("largest", format!("{}{unit}", number(sidecar.largest)));
        }
        for other in &others {
            let value = format!("{}, error {} {}", each(other.bytes), number(other.error), model.units);
            table.row(format!("as {}", other.name), value);
        }
        table.row("error", format!("{}{unit} at most, of what was written", number(error)));
        if !sidecar.wiring.is_empty() {
            table.row("wiring", sidecar.wiring.clone());
        }
        if let Some(crack) = crack.filter(|_| max_error.is_some()) {
            table.row("seams", format!("part by {} {} at most", number(crack), model.units));
        }
        table.print();
    }
    Ok(Status::Done)
}

/// How the maps are written.
fn options(
    args: &ReliefExport,
    preset: Option<&Preset>,
    file: MapFile,
    params: &MapParams,
    max_error: Option<f64>,
    model: &Model,
) -> MapOptions {
    // What options change of a preset its program is to be told otherwise.
    let as_wanted = |p: &&Preset| {
        let wanted = (p.kind, p.frame, p.order, MapFile::of_word(p.file).unwrap_or_default());
        wanted == (params.kind, params.frame, params.order, file)
    };
    let companions = [(args.base, BASE), (args.materialx, WIRING), (is_usd(args), SCENE)];
    MapOptions {
        params: params.clone(),
        file,
        upside_down: preset.is_some_and(|p| p.upside_down),
        max_error,
        wiring: preset
            .filter(as_wanted)
            .map_or(String::new(), |p| p.wiring.split_whitespace().collect::<Vec<_>>().join(" ")),
        relief: Some(relief_sum(&model.reliefs)),
        units: model.units,
        companions: companions.iter().filter(|(asked, _)| *asked).map(|(_, name)| name.to_string()).collect(),
    }
}

/// True if a USD scene is wanted beside the maps.
fn is_usd(args: &ReliefExport) -> bool {
    args.usd || args.preset.is_some_and(|p| p.name() == "usd")
}

/// Writes what goes beside the maps.
fn write_companions(
    args: &ReliefExport,
    model: &Model,
    sheet: &Sheet,
    sidecar: &Sidecar,
    folder: &Path,
) -> Result<(), Failure> {
    if args.base {
        let mesh = base(model, &sidecar.params, sheet, args)?;
        let options = WriteOptions { units: model.units, name: "base".into(), ..WriteOptions::default() };
        placed::write_patches(&folder.join(BASE), mesh, model.shift, &options)
            .map_err(|e| write_failure(&args.model, &args.output, e))?;
    }
    if is_usd(args) {
        scene(model, base(model, &sidecar.params, sheet, args)?, sidecar, &folder.join(SCENE), args)?;
    }
    if args.materialx {
        let text = materialx(sidecar).ok_or_else(|| {
            let what = "cannot wire vectors in object space";
            Failure::usage("--materialx", what).hint("add --frame tangent, or take --kind scalar")
        })?;
        write_text(&folder.join(WIRING), &text)?;
    }
    Ok(())
}

/// Another way to write the same maps.
struct Other {
    name: &'static str,
    /// As the report's keys have it.
    key: &'static str,
    bytes: u64,
    error: f64,
}

/// What the maps would take when written otherwise.
fn others(made: &[PatchMap], sheet: &Sheet, options: &MapOptions, max_error: f64) -> Result<Vec<Other>, WriteError> {
    let params = &options.params;
    let same = options.file == MapFile::Png && params.sheets == SheetKind::Atlas && params.gutter == 0;
    let one = if same { None } else { in_one_png(made, params.kind, max_error)? };
    let [half, dwa] = other_ways(made, sheet)?;
    let ways = [("one PNG", "png", one), ("half EXR", "half", Some(half)), ("DWA EXR", "dwa", Some(dwa))];
    let known =
        |(name, key, way): (_, _, Option<(u64, f64)>)| way.map(|(bytes, error)| Other { name, key, bytes, error });
    Ok(ways.into_iter().filter_map(known).collect())
}

/// The preset with the given options in place.
fn params(args: &ReliefExport, preset: Option<&Preset>) -> Result<MapParams, Failure> {
    let base = preset.map_or_else(MapParams::default, |p| MapParams {
        kind: p.kind,
        frame: p.frame,
        order: p.order,
        sheets: p.sheets,
        ..MapParams::default()
    });
    let params = args.maps.params_over(base, None)?;
    if params.texels == 1 {
        return Err(Failure::usage("--texels", "a map needs two texels along a side").hint("give 0, or 2 or more"));
    }
    Ok(params)
}

fn attributes(model: &Model, shapes: &[[usize; 2]], path: &Path) -> Result<Vec<(String, Vec<PatchMap>)>, Failure> {
    let mut all = Vec::new();
    for attribute in model.mesh.attributes.iter().filter(|a| (1..=4).contains(&a.width) && a.width != 2) {
        let maps =
            maps::attribute_maps(&model.mesh, &model.grids, &attribute.name, shapes).map_err(|e| wrong(path, e))?;
        all.extend(maps.map(|maps| (attribute.name.clone(), maps)));
    }
    Ok(all)
}

/// The base mesh with a vertex for each texel.
fn base(model: &Model, params: &MapParams, sheet: &Sheet, args: &ReliefExport) -> Result<MappedMesh, Failure> {
    let (patched, normals) =
        maps::base_mesh(&displaced(model), params, &Interrupt).map_err(|e| wrong(&args.model, e))?;
    let nodes = |(p, n): (usize, &planish::relief::PatchNodes)| {
        (0..n.rows * n.cols).map(|k| sheet.uv(p, k % n.cols, k / n.cols)).collect::<Vec<[f32; 2]>>()
    };
    let uvs = patched.patches.iter().enumerate().map(nodes).collect();
    Ok(MappedMesh { patched, uvs, normals })
}

/// Writes the base mesh with materials that read the maps.
fn scene(
    model: &Model,
    mut mesh: MappedMesh,
    sidecar: &Sidecar,
    path: &Path,
    args: &ReliefExport,
) -> Result<(), Failure> {
    let materials = usd_materials(sidecar).ok_or_else(|| {
        let what = match sidecar.params.kind {
            MapKind::Length => "cannot wire lengths",
            MapKind::Normal => "wires normals in tangent space in the order tbn",
            _ => "wires vectors in tangent space",
        };
        Failure::usage("--usd", what).hint(match sidecar.params.kind {
            MapKind::Length => "take --kind scalar",
            MapKind::Normal => "add --frame tangent --order tbn",
            _ => "add --frame tangent, or take --kind scalar",
        })
    })?;
    if sidecar.upside_down {
        // Within their tile: what its first row holds is below there.
        mesh.uvs.iter_mut().flatten().for_each(|uv| uv[1] = 2.0 * uv[1].floor() + 1.0 - uv[1]);
    }
    let options = WriteOptions { units: model.units, name: "relief".into(), ..WriteOptions::default() };
    let input = UsdInput {
        surfaces: &[],
        mesh: Some(("base", &mesh)),
        shift: model.shift,
        materials: &materials,
        options: &options,
    };
    planish_io::write_usd(path, &input).map_err(|e| write_failure(&args.model, &args.output, e))
}

/// What the files hold.
struct Measured {
    /// Bytes of the images.
    bytes: u64,
    /// Largest distance of a texel from what was made.
    error: f64,
    /// How far apart two patches displace a place that they share, at most; of vectors alone.
    crack: Option<f64>,
}

/// Reads the images back.
fn measured(folder: &Path, made: &[PatchMap], model: &Model, output: &Path) -> Result<Measured, Failure> {
    let back = read_maps(folder).map_err(|e| Failure::usage(output, format!("the maps do not read back: {e}")))?;
    let size = |name: &String| std::fs::metadata(folder.join(name)).map_or(0, |m| m.len());
    let bytes = back.sidecar.images.iter().map(|i| size(&i.file)).sum();
    debug_assert_eq!(as_read(made.to_vec(), &back.sidecar), back.maps);
    let crack = match back.sidecar.params.kind {
        MapKind::Vector => {
            let now = displaced(model);
            let reliefs = maps::read_back(&now, &back.sidecar.params, &back.maps, made, &Interrupt)
                .and_then(|reliefs| planish::relief::widest_crack(&Displaced { reliefs: &reliefs, ..now }));
            Some(reliefs.map_err(|e| wrong(output, e))?)
        }
        _ => None,
    };
    Ok(Measured { bytes, error: largest_error(made, &back.maps), crack })
}
