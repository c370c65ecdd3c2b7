//! `planish info` of files that are no mesh, scan or model: volumes, scripts, networks, reports, STEP, displacement maps.

use crate::commands::edit;
use crate::failure::Failure;
use crate::summary::Summary;
use planish::DVec3;
use planish::field::Field;
use planish::model::Units;
use planish::network::{CurveKind, Network};
use planish::relief::maps::MapKind;
use planish_io::maps::ReadMaps;
use planish_io::report::{Input, count, number};
use planish_io::script::Script;
use planish_io::{RELIEF_SIDECAR, ReadError};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// What is in a file.
pub(super) struct Contents {
    /// As an input.
    pub input: Input,
    /// In words, after what the file is.
    pub table: Summary,
}

impl Contents {
    fn new(path: &Path, kind: &str, units: Units) -> Contents {
        let (path, kind, units) =
            (crate::words::told(&path.display().to_string()), kind.to_owned(), units.symbol().to_owned());
        let mut table = Summary::default();
        table.row("file", format!("{path}: {kind}"));
        Contents { input: Input { path, kind, units, ..Input::default() }, table }
    }

    fn count(&mut self, what: &str, n: usize) {
        self.input.counts.insert(what.to_owned(), n as u64);
        self.table.row(what, count(n as u64));
    }

    fn bounds(&mut self, min: DVec3, max: DVec3) {
        self.input.diagonal = (max - min).length();
        let unit = self.input.units.clone();
        self.table.row("from", format!("{} {unit}", corner(min, self.input.diagonal)));
        self.table.row("to", format!("{} {unit}", corner(max, self.input.diagonal)));
        self.table.row("diagonal", format!("{} {unit}", number(self.input.diagonal)));
    }
}

/// A corner of a box, to a millionth of its diagonal.
pub(super) fn corner(p: DVec3, diagonal: f64) -> String {
    let decimals = if diagonal > 0.0 { (6.0 - diagonal.log10().ceil()).clamp(0.0, 12.0) as usize } else { 6 };
    let short = |x: f64| {
        let text = format!("{x:.decimals$}");
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        // Rounding leaves signs behind.
        if text == "-0" { "0".to_owned() } else { text.to_owned() }
    };
    p.to_array().map(short).join(" ")
}

/// What is in the file, if it is of such a kind.
/// * `units` - of files that tell none
/// # Errors
/// If it is damaged, or a JSON file of another program.
pub(super) fn of(path: &Path, units: Option<Units>) -> Result<Option<Contents>, Failure> {
    if path.is_dir() && path.join(RELIEF_SIDECAR).is_file() {
        return maps(path).map(Some);
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "nrrd" | "npy" => volume(path, units).map(Some),
        "toml" => script(path, units).map(Some),
        "json" => json(path).map(Some),
        "step" | "stp" => step(path).map(Some),
        "exr" => image(path).map(Some),
        _ => Ok(None),
    }
}

fn volume(path: &Path, units: Option<Units>) -> Result<Contents, Failure> {
    let grid = planish_io::read_grid(path).map_err(|e| Failure::input(path, e))?;
    let mut found = Contents::new(path, "volume", units.unwrap_or_default());
    let [x, y, z] = grid.size;
    found.count("samples", grid.values.len());
    found.table.row("size", format!("{x} x {y} x {z}"));
    let size = grid.spacing * DVec3::from_array(grid.size.map(|n| n.saturating_sub(1) as f64));
    found.bounds(grid.origin, grid.origin + size);
    let finite = grid.values.iter().copied().filter(|v| v.is_finite());
    let (low, high) = finite.clone().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    found.table.row("numbers", format!("{low} to {high}"));
    let lost = grid.values.len() - finite.count();
    if lost > 0 {
        found.table.row("wrong", format!("{} numbers are not finite", count(lost as u64)));
    }
    Ok(found)
}

fn script(path: &Path, units: Option<Units>) -> Result<Contents, Failure> {
    let text = edit::read_text(path)?;
    if text.lines().any(|line| matches!(line.trim(), "[[step]]" | "[view]")) {
        let mut found = Contents::new(path, "script of edits", units.unwrap_or_default());
        let names = edit::step_names(path)?;
        found.count("edits", names.len());
        found.table.row("in order", names.join(", "));
        return Ok(found);
    }
    let file = planish_io::script::read_script(path).map_err(|e| Failure::input(path, e))?;
    let units = units.or(file.units).unwrap_or_default();
    let (kind, what, bounds) = match &file.script {
        Script::Part(part) => ("solid script", "solids", part.bounds()),
        Script::Job(job) => ("milling job", "moves", job.bounds()),
    };
    let mut found = Contents::new(path, kind, units);
    found.count(what, file.count);
    if bounds.min.is_finite() && bounds.max.is_finite() {
        found.bounds(bounds.min, bounds.max);
    } else {
        found.table.row("wrong", "it has no end along some axis");
    }
    Ok(found)
}

fn json(path: &Path) -> Result<Contents, Failure> {
    let bytes = planish_io::read_bytes(path).map_err(|e| Failure::input(path, e))?;
    let value: Value = serde_json::from_slice(&bytes).map_err(|e| {
        Failure::input(path, format!("is no JSON (line {})", e.line())).hint("write it again from its source")
    })?;
    let is_network = value["format"] == "planish network";
    if is_network {
        return network(path, &value);
    }
    if value["planish_relief"].is_u64() {
        return maps(path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")));
    }
    if let (Some(version), Some(command)) = (value["planish"].as_str(), value["command"].as_str()) {
        let mut found = Contents::new(path, "report", Units::default());
        found.table.row("of", format!("planish {version}, `planish {command}`"));
        found.table.row("input", value["input"]["path"].as_str().unwrap_or_default());
        let list = |key: &str| value[key].as_array().map_or(0, Vec::len);
        found.count("figures", value["quality"].as_object().map_or(0, |q| q.len()));
        found.count("warnings", list("warnings"));
        return Ok(found);
    }
    Err(Failure::input(path, "is a JSON file of another program")
        .hint("name a network, a report or a relief.json of planish"))
}

fn network(path: &Path, value: &Value) -> Result<Contents, Failure> {
    let damaged = |e: serde_json::Error| {
        Failure::input(path, format!("is no network: {e}")).hint("`planish layout` writes one to start from")
    };
    let parts = serde_json::json!({
        "corners": value["corners"], "curves": value["curves"], "patches": value["patches"]
    });
    let network: Network = serde_json::from_value(parts).map_err(damaged)?;
    let mut found = Contents::new(path, "network", Units::default());
    found.count("corners", network.corners.len());
    found.count("curves", network.curves.len());
    found.count("patches", network.patches.len());
    let of_kind = |is: fn(CurveKind) -> bool| count(network.curves.iter().filter(|c| is(c.kind)).count() as u64);
    found.table.row(
        "of the curves",
        format!(
            "{} smooth, {} on sharp edges, {} on the boundary",
            of_kind(CurveKind::is_smooth),
            of_kind(|kind| kind == CurveKind::Feature),
            of_kind(|kind| kind == CurveKind::Boundary)
        ),
    );
    if let (Some(vertices), Some(triangles)) = (value["mesh"]["vertices"].as_u64(), value["mesh"]["triangles"].as_u64())
    {
        found
            .table
            .row("made on", format!("a mesh of {} triangles and {} vertices", count(triangles), count(vertices)));
    }
    Ok(found)
}

/// The entities of STEP that make up its shape, with what they are called here.
const ENTITIES: [(&str, &str); 5] = [
    ("MANIFOLD_SOLID_BREP", "solids"),
    ("SHELL_BASED_SURFACE_MODEL", "open shells"),
    ("ADVANCED_FACE", "faces"),
    ("B_SPLINE_SURFACE_WITH_KNOTS", "B-spline surfaces"),
    ("EDGE_CURVE", "edges"),
];

fn step(path: &Path) -> Result<Contents, Failure> {
    let bytes = planish_io::read_bytes(path).map_err(|e| Failure::input(path, e))?;
    let text = String::from_utf8_lossy(&bytes);
    if !text.trim_start().starts_with("ISO-10303-21;") {
        return Err(Failure::input(path, "is no STEP file (byte 0)").hint("name a file that begins with ISO-10303-21"));
    }
    let units = match () {
        () if text.contains("CONVERSION_BASED_UNIT('INCH'") => Units::In,
        () if text.contains("SI_UNIT(.CENTI.,.METRE.)") => Units::Cm,
        () if text.contains("SI_UNIT($,.METRE.)") => Units::M,
        () => Units::Mm,
    };
    let mut found = Contents::new(path, "STEP", units);
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    // Each entity ends in a semicolon: `#12=CARTESIAN_POINT('',(0.,1.,2.));`.
    for entity in text.split(';') {
        let Some((_, body)) = entity.split_once('=') else { continue };
        let body = body.trim_start();
        let name = body.split('(').next().unwrap_or_default().trim();
        *counts.entry(name).or_default() += 1;
        if name == "CARTESIAN_POINT" {
            let numbers = body.rsplit('(').next().unwrap_or_default().trim_end_matches(')');
            let numbers: Vec<f64> =
                numbers.split(',').filter_map(|n| n.trim().trim_end_matches(')').parse().ok()).collect();
            if let [x, y, z] = numbers[..] {
                (min, max) = (min.min(DVec3::new(x, y, z)), max.max(DVec3::new(x, y, z)));
            }
        }
    }
    for (name, words) in ENTITIES {
        if let Some(&n) = counts.get(name) {
            found.count(words, n);
        }
    }
    found.table.row("units", units.symbol());
    if min.is_finite() {
        // Control points, which lie a little outside.
        found.bounds(min, max);
    }
    Ok(found)
}

fn image(path: &Path) -> Result<Contents, Failure> {
    let (width, height, channels) = planish_io::image_facts(path).map_err(|e| Failure::input(path, e))?;
    let mut found = Contents::new(path, "EXR image", Units::default());
    found.table.row("size", format!("{width} x {height}"));
    found.count("pixels", width.saturating_mul(height));
    found.table.row("channels", channels.join(", "));
    Ok(found)
}

/// The maps of a folder: those of `planish export`, or of `planish relief export`.
fn maps(folder: &Path) -> Result<Contents, Failure> {
    let sidecar = planish_io::read_bytes(&folder.join(RELIEF_SIDECAR)).map_err(|e| Failure::input(folder, e))?;
    let sidecar: Value = serde_json::from_slice(&sidecar).unwrap_or_default();
    if sidecar["planish_relief"].as_u64() == Some(1) {
        return plain_maps(folder);
    }
    let ReadMaps { sidecar, maps } = planish_io::maps::read_maps(folder).map_err(|e| Failure::input(folder, e))?;
    let (params, units) = (&sidecar.params, sidecar.units);
    let mut found = Contents::new(folder, "maps of a relief", units);
    let word = |value: serde_json::Result<Value>| {
        value.ok().and_then(|v| v.as_str().map(|word| word.replace('_', "-"))).unwrap_or_default()
    };
    found.count("maps", maps.len());
    found.count("texels", maps.iter().map(|m| m.rows * m.cols).sum());
    found.table.row("of", params.kind.word());
    if params.kind.channels() == 3 {
        let [frame, order] = [word(serde_json::to_value(params.frame)), word(serde_json::to_value(params.order))];
        found.table.row("frame, order", format!("{frame}, {order}"));
    }
    let file = word(serde_json::to_value(sidecar.file));
    found.table.row("images", format!("{} of the kind {file}", sidecar.images.len()));
    if params.kind != MapKind::Normal {
        found.table.row("largest", format!("{} {units}", number(sidecar.largest)));
    }
    let names: Vec<&str> = sidecar.attributes.iter().map(|a| a.name.as_str()).collect();
    if !names.is_empty() {
        found.table.row("attributes", names.join(", "));
    }
    Ok(found)
}

fn plain_maps(folder: &Path) -> Result<Contents, Failure> {
    let (reliefs, units) = planish_io::read_relief(folder).map_err(|e: ReadError| Failure::input(folder, e))?;
    let mut found = Contents::new(folder, "displacement maps", units);
    found.count("maps", reliefs.len());
    found.count("texels", reliefs.iter().map(|r| r.vectors.len()).sum());
    let largest = reliefs.iter().flat_map(|r| &r.vectors).map(|d| d.length()).fold(0.0, f64::max);
    found.table.row("largest", format!("{} {units}", number(largest)));
    Ok(found)
}
