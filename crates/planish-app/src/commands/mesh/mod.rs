//! `planish mesh`: a mesh with sharp edges from a mesh, a solid script, a milling job or a volume.

mod decimate;
mod smooth;

pub use decimate::decimate;
pub use smooth::smooth;

use super::{Session, commit_report, write_failure};
use crate::args::Mesh;
use crate::failure::{Failure, Status};
use crate::files::{self, Scan};
use crate::placed::{self, Placed};
use crate::products::Staged;
use crate::progress;
use crate::summary::Summary;
use crate::tolerance::Scale;
use planish::cloud::bricks::StoreError;
use planish::cloud::{self, CloudError};
use planish::contour::{self, Meshed, MeshingError, Sampling};
use planish::field::{Field, Formula, MeshBody, Part, ScalarGrid, Solid, Spacing};
use planish::geom::Aabb;
use planish::mesh::{TriMesh, diagnose};
use planish::model::Units;
use planish::pipeline::key;
use planish::pipeline::{self, Figure, ScanError, ScanMeshed, ScanParams, StageRecord, Warning};
use planish::{DVec3, Observer};
use planish_io::report::{Input, Report, count, number};
use planish_io::script::Script;
use planish_io::{MeshFormat, TilesError, WriteOptions};
use std::path::Path;

/// Cells along the longest side unless the user says.
const RESOLUTION: usize = 129;
/// What is to be meshed.
enum Source {
    /// With what to tell of points that are not of it, and the room that its bricks lie in while they are worked.
    Scan {
        scan: Scan,
        far_off: Option<Warning>,
        _room: Option<Staged>,
    },
    Mesh(Placed),
    Script(Script),
    Grid(Box<planish::field::ScalarGrid>),
}

impl Source {
    /// What brings the coordinates back to their place.
    fn shift(&self) -> DVec3 {
        match self {
            Source::Scan { scan, .. } => scan.shift(),
            Source::Mesh(placed) => placed.shift,
            Source::Script(_) | Source::Grid(_) => DVec3::ZERO,
        }
    }
}

pub fn mesh(session: &Session, args: &Mesh) -> Result<Status, Failure> {
    if args.tiles.is_none() {
        files::check_extension(&args.output, &["ply", "obj", "stl", "glb", "nrrd", "npy"])?;
    }
    let staged = staged(args)?;
    let own_report = session.stage_report()?;
    let params = args.meshing.params()?;
    let grid_params = args.volume.params(None)?;
    let ((source, input, units), read) = session.watched("read", |o| read(session, args, params.cells, o))?;
    match &source {
        Source::Scan { .. } => {}
        Source::Grid(_) => {
            args.meshing.refuse_cleaning("--volume-close tells whether the border of a volume closes the surface")?
        }
        Source::Mesh(_) | Source::Script(_) => {
            args.meshing.refuse_cleaning("leave it out: the result is closed anyway")?
        }
    }
    if is_volume(args) {
        let from = Sampled { staged, own_report, source, input, read };
        return volume(session, args, from, &params);
    }
    let spacing = params.cells.unwrap_or(Spacing::Resolution(RESOLUTION));
    let sampling = Sampling { spacing, memory: params.memory };
    let contour = &params.contour;
    let plain = |made: Meshed| Made::Plain(Box::new(made));
    let (made, record) = session.bars.step("mesh", |o| {
        Ok::<Made, Trouble>(match &source {
            Source::Scan { scan, .. } => Made::OfScan(Box::new(match scan {
                Scan::Whole(cloud) => pipeline::mesh_scan(cloud, &params, o)?,
                Scan::Bricks(bricks) => pipeline::mesh_bricks(bricks, &params, o)?,
            })),
            Source::Mesh(placed) => plain(contour::from_mesh(&placed.mesh, sampling, contour, o)?),
            Source::Script(Script::Part(part)) => plain(contour::from_part(part, sampling, contour, o)?),
            Source::Script(Script::Job(milling)) => plain(contour::from_field(milling, sampling, contour, o)?),
            Source::Grid(grid) => plain(contour::from_grid(grid, &grid_params, params.memory, contour, o)?),
        })
    });
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let all = made.map_err(|e| match e {
        Trouble::Meshing(e) | Trouble::Scan(ScanError::Mesh(e)) => failure(args, &source, e),
        Trouble::Scan(e) => Failure::input(&args.input, super::with_hint(&e.to_string())),
    })?;
    let (made, scanned) = match &all {
        Made::OfScan(scanned) => (&scanned.meshed, Some(&**scanned)),
        Made::Plain(made) => (&**made, None),
    };
    let (mesh, tags) = (&made.extracted.mesh, &made.extracted.tags);
    let shift = source.shift();
    let options = WriteOptions { units, ..WriteOptions::default() };
    let mut tiles = None;
    let (moved, write) = session.watched("write", |o| match args.tiles {
        None => placed::write(&staged.file_path(), mesh, tags, shift, &options)
            .map_err(|e| write_failure(&args.input, &args.output, e)),
        Some(side) => {
            let size = side.length(Scale { diagonal: mesh.bounds().diagonal(), units });
            let written = planish_io::write_tiles(&staged.path(""), mesh, tags, (size, shift), &options, o);
            tiles = Some(written.map_err(|e| match e {
                TilesError::Tile(e) => Failure::usage("--tiles", e.to_string()),
                TilesError::Cancelled(_) => Failure::interrupted(),
                TilesError::Write(e) => write_failure(&args.input, &args.output, e),
            })?);
            Ok(None)
        }
    })?;
    let mut report = Report::new("mesh", input);
    if let Source::Mesh(_) | Source::Scan { .. } = &source {
        let far = shift != DVec3::ZERO;
        report.warnings.extend(session.guessed_units(&args.input, report.input.diagonal, far));
    }
    if let Source::Mesh(placed) = &source {
        report.warnings.extend(placed.warning(units.symbol()));
    }
    if let Source::Scan { far_off, .. } = &source {
        report.warnings.extend(far_off.clone());
    }
    report.warnings.extend(moved);
    report.stages = vec![read, record, write];
    figures(made, &mut report);
    if let Some(count) = tiles {
        report.quality.insert(key::MESH_TILES.into(), Figure::Count(count as u64));
    }
    if let Source::Mesh(input) = &source {
        thin_walls(made, &input.mesh, &mut report);
    }
    if let Some(scanned) = scanned {
        pipeline::scan_figures(scanned, &mut report.quality, &mut report.warnings);
    }
    if session.hand_over([staged], own_report, &report)? {
        table(args, made, &report).print();
    }
    Ok(Status::Done)
}

/// Room for the output: a folder of tiles, or a file.
fn staged(args: &Mesh) -> Result<Staged, Failure> {
    if args.tiles.is_some() { Staged::folder(&args.output) } else { Staged::file(&args.output) }
}

/// True if the field itself is written, and no mesh.
fn is_volume(args: &Mesh) -> bool {
    args.tiles.is_none() && planish_io::is_grid(&args.output)
}

/// A source that is to become a volume.
struct Sampled {
    staged: Staged,
    own_report: Option<Staged>,
    source: Source,
    input: Input,
    read: StageRecord,
}

/// Writes the field of a source as a volume: its values at the nodes of the lattice that its mesh would be made on.
fn volume(session: &Session, args: &Mesh, from: Sampled, params: &ScanParams) -> Result<Status, Failure> {
    let Sampled { staged, own_report, source, input, read } = from;
    let (sampled, record) = session.bars.step("sample", |o| {
        let shift = source.shift();
        let sampled = |field: &dyn Field, usual: Spacing| {
            let spacing = params.cells.unwrap_or(usual);
            ScalarGrid::of_field(field, spacing, params.memory, o).map_err(|e| Trouble::Meshing(e.into()))
        };
        let usual = Spacing::Resolution(RESOLUTION);
        let mut grid = match source {
            Source::Grid(grid) => *grid,
            Source::Script(Script::Part(part)) => sampled(&part, usual)?,
            Source::Script(Script::Job(milling)) => sampled(&milling, usual)?,
            Source::Mesh(placed) => {
                let body = MeshBody::new(placed.mesh).map_err(|e| Trouble::Meshing(e.into()))?;
                sampled(&Part::Mesh(Box::new(body)), usual)?
            }
            Source::Scan { scan: Scan::Bricks(_), .. } => {
                let what = "a volume is made of a scan in one piece".into();
                return Err(Trouble::Scan(CloudError::Store(StoreError(what)).into()));
            }
            Source::Scan { scan: Scan::Whole(scan), .. } => {
                let samples = cloud::clean(&scan, &params.clean, o).map_err(|e| Trouble::Scan(e.into()))?;
                sampled(&pipeline::field_of(&samples, params).0, Spacing::Voxel(pipeline::voxel_for(&samples)))?
            }
        };
        grid.origin += shift;
        Ok::<ScalarGrid, Trouble>(grid)
    });
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let told = |e: &dyn std::fmt::Display| Failure::input(&args.input, super::with_hint(&e.to_string()));
    let grid = sampled.map_err(|e| match e {
        Trouble::Meshing(e) => told(&e),
        Trouble::Scan(e) => told(&e),
    })?;
    let (_, write) = session.step("write", || {
        planish_io::write_grid(staged.file_path(), &grid).map_err(|e| write_failure(&args.input, &args.output, e))
    })?;
    let mut report = Report::new("mesh", input);
    report.stages = vec![read, record, write];
    let [x, y, z] = grid.size;
    report.quality.insert(key::VOLUME_SAMPLES.into(), Figure::Count(grid.values.len() as u64));
    report.quality.insert(key::VOLUME_SPACING.into(), Figure::Number(grid.spacing.x));
    staged.commit()?;
    commit_report(own_report, &report)?;
    if !session.common.quiet {
        let mut table = Summary::default();
        table.row("input", format!("{}: {}", report.input.path, report.input.kind));
        table.row("volume", format!("{x} x {y} x {z} samples, {} apart", report.length(key::VOLUME_SPACING)));
        table.row("written", args.output.display().to_string());
        table.print();
    }
    Ok(Status::Done)
}

/// What a source became.
enum Made {
    OfScan(Box<ScanMeshed>),
    Plain(Box<Meshed>),
}

/// What can go wrong with one of the sources.
enum Trouble {
    Meshing(MeshingError),
    Scan(ScanError),
}

impl From<MeshingError> for Trouble {
    fn from(e: MeshingError) -> Trouble {
        Trouble::Meshing(e)
    }
}

impl From<ScanError> for Trouble {
    fn from(e: ScanError) -> Trouble {
        Trouble::Scan(e)
    }
}

/// Reads whatever the input is, by its extension.
fn read(
    session: &Session,
    args: &Mesh,
    cells: Option<Spacing>,
    observer: &dyn Observer,
) -> Result<(Source, Input, Units), Failure> {
    let path = &args.input;
    if let Some(bounds) = &args.bounds {
        return formula(session, path, bounds);
    }
    let chosen = session.common.units.map(Units::from);
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        let file = planish_io::script::read_script(path).map_err(|e| Failure::input(path, e))?;
        let units = chosen.or(file.units).unwrap_or_default();
        let (kind, what, bounds) = match &file.script {
            Script::Part(part) => ("solid script", "solids", planish::field::Field::bounds(part)),
            Script::Job(job) => ("milling job", "moves", planish::field::Field::bounds(job)),
        };
        if !(bounds.min.is_finite() && bounds.max.is_finite()) {
            return Err(Failure::input(path, "the solid has no end along some axis")
                .hint("intersect planes with something of finite size"));
        }
        let input = Input {
            path: crate::words::told(&path.display().to_string()),
            kind: kind.into(),
            counts: [(what.to_owned(), file.count as u64)].into(),
            units: units.symbol().into(),
            diagonal: bounds.diagonal(),
        };
        return Ok((Source::Script(file.script), input, units));
    }
    if planish_io::is_grid(path) && !planish_io::is_scan(path) {
        let mut grid = planish_io::read_grid(path).map_err(|e| Failure::input(path, e))?;
        let npy = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy"));
        let voxel = if let Some(Spacing::Voxel(h)) = cells { Some(h) } else { None };
        if cells.is_some() && !(npy && voxel.is_some()) {
            let what =
                if npy { "the cells of a volume are its own samples" } else { "a NRRD file tells its own spacing" };
            let option = if voxel.is_some() { "--voxel" } else { "--resolution" };
            return Err(Failure::usage(path, format!("{what}, {option} has no meaning here")).hint("leave it out"));
        }
        // NumPy arrays carry no size of a voxel.
        if npy {
            grid.spacing *= voxel.unwrap_or(1.0);
        }
        let units = session.units();
        let size = grid.spacing * glam::DVec3::from_array(grid.size.map(|n| n as f64 - 1.0));
        let input = Input {
            path: crate::words::told(&path.display().to_string()),
            kind: "volume".into(),
            counts: [("samples".to_owned(), grid.values.len() as u64)].into(),
            units: units.symbol().into(),
            diagonal: size.length(),
        };
        return Ok((Source::Grid(Box::new(grid)), input, units));
    }
    if planish_io::is_scan(path) {
        // A volume is made in one piece.
        let room = if is_volume(args) { None } else { Some(staged(args)?) };
        let (scan, far_off) = Scan::read(path, &args.scan, room.as_ref(), observer)?;
        let units = session.units_of(path);
        let input = super::clean::scan_facts(path, scan.size(), units);
        return Ok((Source::Scan { scan, far_off, _room: room }, input, units));
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if !files::is_model(path) && MeshFormat::ALL.iter().all(|f| f.extension() != extension) {
        let list = |all: &[&str]| all.iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(", ");
        let known = format!(
            "meshes are {}; scans {}; volumes .nrrd (one file), .npy; scripts .toml",
            list(&MeshFormat::ALL.map(MeshFormat::extension)),
            list(&planish_io::SCAN_EXTENSIONS)
        );
        return Err(Failure::input(path, format!("unknown extension \"{extension}\"")).hint(known));
    }
    let placed = Placed::new(files::mesh(path)?, None);
    let units = session.units_of(path);
    let input = files::mesh_facts(path, &placed.mesh, units);
    Ok((Source::Mesh(placed), input, units))
}

/// A formula in its box.
fn formula(session: &Session, text: &Path, bounds: &Aabb) -> Result<(Source, Input, Units), Failure> {
    let Some(text) = text.to_str() else {
        return Err(Failure::usage(text, "is a formula with letters that are none").hint("write it in plain letters"));
    };
    let formula = Formula::parse(text).map_err(|e| Failure::usage(format!("\"{text}\""), e))?;
    let units = session.units();
    let input = Input {
        path: text.to_owned(),
        kind: "formula".into(),
        counts: Default::default(),
        units: units.symbol().into(),
        diagonal: bounds.diagonal(),
    };
    let part = Part::Solid(Solid::of_formula(formula, bounds));
    Ok((Source::Script(Script::Part(part)), input, units))
}

fn failure(args: &Mesh, source: &Source, error: MeshingError) -> Failure {
    let hint = match source {
        Source::Mesh(_) => "look for faults with `planish info`",
        Source::Script(Script::Part(Part::Solid(_))) => "use a smaller voxel, or look for solids that take all away",
        _ => "check the input",
    };
    Failure::input(&args.input, super::with_hint(&error.to_string())).hint(hint)
}

fn figures(made: &Meshed, report: &mut Report) {
    let facts = diagnose(&made.extracted.mesh);
    let counts = made.extracted.counts;
    let whole = [
        (key::MESH_TRIANGLES, facts.triangles),
        (key::MESH_VERTICES, facts.vertices),
        (key::MESH_COMPONENTS, facts.components),
        (key::MESH_FEATURE_EDGES, made.extracted.tags.edges.len()),
        (key::MESH_CELLS, counts.cells),
        (key::MESH_FALLBACK_CELLS, counts.fallbacks),
        (key::MESH_PUSHED_CELLS, counts.pushed),
        (key::MESH_CLAMPED_FEATURES, counts.kept),
        (key::MESH_MENDED_HITS, made.mended),
    ];
    report.quality.extend(whole.map(|(key, n)| (key.to_owned(), Figure::Count(n as u64))));
    super::meeting_figures(&made.extracted.mesh, report);
    report.quality.insert(key::MESH_VOXEL.into(), Figure::Number(made.lattice.step.x));
    super::mesh_figures(&facts, report);
    if counts.fallbacks > 0 {
        let text = format!("{} cells have no sharp vertex although their normals ask for one.", counts.fallbacks);
        report.warnings.push(Warning::new("fallback_cells", text, ""));
    }
    if counts.kept > 0 {
        let text = format!(
            "{} feature vertices had to stay in their cells: details are finer than the voxel there.",
            counts.kept
        );
        report.warnings.push(Warning::new("clamped_features", text, ""));
    }
}

/// A surface passes so many of its lattice edges more often than is kept at sharp edges alone; beyond, walls are too thin.
const LOST_SHARE: f64 = 0.02;

/// Tells of walls and gaps of a mesh that are thinner than the voxel.
fn thin_walls(made: &Meshed, input: &TriMesh, report: &mut Report) {
    let thin = made.thin;
    report.quality.insert(key::MESH_THIN_EDGES.into(), Figure::Count(thin.edges as u64));
    if thin.edges > 0 {
        report.quality.insert(key::MESH_THIN_WIDTH.into(), Figure::Number(thin.width));
    }
    let facts = diagnose(input);
    let pieces = report.quality.get(key::MESH_COMPONENTS).and_then(|f| match f {
        Figure::Count(n) => Some(*n),
        _ => None,
    });
    let broken = facts.watertight && pieces.is_some_and(|n| n != facts.components as u64);
    if thin.edges == 0 || !(broken || thin.lost_share > LOST_SHARE) {
        return;
    }
    let unit = report.input.units.as_str();
    let mut text = format!(
        "Walls or gaps too thin for the voxel: the surface passes {} edges of the lattice more often than can be kept; passes are {} {unit} apart in the median.",
        count(thin.lost as u64),
        number(thin.width)
    );
    if let (true, Some(n)) = (broken, pieces) {
        text += &format!(" The result has {} pieces where the input has {}.", count(n), count(facts.components as u64));
    }
    text += &format!(" Half of them need a voxel of {} {unit}.", number(thin.width));
    report.warnings.push(Warning::new("thin_walls", text, ""));
}

fn table(args: &Mesh, made: &Meshed, report: &Report) -> Summary {
    let unit = report.input.units.as_str();
    let flag =
        |key: &str, yes: &str, no: &str| if report.flag(key) == Some(true) { yes.into() } else { String::from(no) };
    let mut table = Summary::default();
    let [x, y, z] = made.lattice.cells;
    table.row("input", format!("{}: {}", report.input.path, report.input.kind));
    table.row("voxel", format!("{} {unit} ({x} x {y} x {z} cells)", number(made.lattice.step.x)));
    if report.figure(key::SCAN_NOISE).is_some() {
        table.row("noise", report.length(key::SCAN_NOISE));
    }
    if let Some(lids) = report.figure(key::SCAN_LIDS).filter(|&n| n > 0.0) {
        table.row("holes", format!("{} small ones closed", count(lids as u64)));
    }
    table.row("triangles", count(made.extracted.mesh.triangles.len() as u64));
    table.row("feature edges", count(made.extracted.tags.edges.len() as u64));
    table.row(
        "surface",
        format!(
            "{}, {}",
            flag(key::MESH_WATERTIGHT, "watertight", "open"),
            flag(key::MESH_MANIFOLD, "manifold", "not manifold")
        ),
    );
    table.row("fallback cells", count(made.extracted.counts.fallbacks as u64));
    if let Some(tiles) = report.figure(key::MESH_TILES) {
        table.row("tiles", count(tiles as u64));
    }
    table.row("mesh", args.output.display().to_string());
    table
}
