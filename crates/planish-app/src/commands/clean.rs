//! `planish clean`: a scan to denoised, oriented points with flags.

use super::{Session, write_failure};
use crate::args::{Clean, Policy, default_memory};
use crate::failure::{Failure, Status};
use crate::files::{self, PointsFile, Scan};
use crate::outputs;
use crate::products::Staged;
use crate::progress;
use crate::summary::Summary;
use planish::cloud::bricks::{BrickStore, CloudStore, StoreError};
use planish::cloud::{self, Cleaned, Cloud, CloudError, PointFacts, Samples};
use planish::mesh::Attribute;
use planish::model::Units;
use planish::pipeline::key;
use planish::pipeline::{self, BRICK_POINTS, BrickPlan, Figure, ScanError, ScanFacts, ScanParams};
use planish::{DVec3, Observer};
use planish_io::report::{Input, Report, count, number};
use planish_io::{ScanWriter, WriteError};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The facts of a scan as an input, from its number of points and its diagonal.
pub fn scan_facts(path: &Path, (points, diagonal): (u64, f64), units: Units) -> Input {
    Input {
        path: crate::words::told(&path.display().to_string()),
        kind: "scan".into(),
        counts: [("points".to_owned(), points)].into(),
        units: units.symbol().into(),
        diagonal,
    }
}

pub fn clean(session: &Session, args: &Clean) -> Result<Status, Failure> {
    files::check_extension(&args.output, &planish_io::WRITTEN_SCANS)?;
    args.lines.as_deref().map_or(Ok(()), |path| files::check_extension(path, &["obj"]))?;
    let staged = Staged::file(&args.output)?;
    let lines = args.lines.as_deref().map(Staged::file).transpose()?;
    let own_report = session.stage_report()?;
    let params = ScanParams {
        clean: args.clean.params(None)?,
        points: args.project.params(None)?,
        memory: default_memory(),
        ..ScanParams::default()
    };
    let room = Staged::file(&args.output)?;
    let ((scan, far_off), read) = session.watched("read", |o| Scan::read(&args.scan, &args.options, Some(&room), o))?;
    let units = session.units_of(&args.scan);
    let (points, diagonal) = scan.size();
    let mut report = Report::new("clean", scan_facts(&args.scan, (points, diagonal), units));
    report.warnings.extend(far_off);
    report.warnings.extend(session.guessed_units(&args.scan, diagonal, scan.shift() != DVec3::ZERO));
    let (made, fit) = session.bars.step("samples", |o| surface(&scan, &params, o));
    let surface = ended(args, made)?;
    let wrong = |path: &Path, e: WriteError| write_failure(&args.scan, path, e);
    let file = PointsFile::create(&staged.file_path(), units).map_err(|e| wrong(&args.output, e))?;
    let mut kept = Kept { file, pieces: Vec::new(), is_parted: args.segment };
    let (made, moved) = session.bars.step("points", |o| match &surface {
        Surface::Samples(cloud, samples) => {
            let cleaned = cloud::project(cloud, samples, params.clean.outlier, &params.points, o)?;
            let facts = cleaned.facts.clone();
            kept.take(cleaned.cloud).map_err(CloudError::from)?;
            Ok::<PointFacts, ScanError>(facts)
        }
        Surface::Bricks(store, plan) => {
            let mut take = |_: &Cloud, cleaned: Cleaned| kept.take(cleaned.cloud);
            pipeline::project_bricks(&**store, plan, &params, &mut take, o)
        }
    });
    if let Some(e) = kept.file.failure() {
        return Err(wrong(&args.output, e));
    }
    let facts = ended(args, made)?;
    let (segments, write) = session.step("write", || {
        let parts = segments(&args.output, &kept.pieces);
        kept.file.finish().map_err(|e| wrong(&args.output, e))?;
        if let Some(staged) = &lines {
            super::write_text(&staged.file_path(), &lines_obj(&facts, scan.shift()))?;
        }
        let paths: Vec<PathBuf> = parts.iter().map(|(path, _)| path.clone()).chain(args.lines.clone()).collect();
        outputs::allow(&[&args.scan, &args.output], &paths, Policy { in_place: false, ..session.common.policy() })?;
        let one = |(path, part): (PathBuf, Vec<Cloud>)| {
            let staged = Staged::file(&path)?;
            let written = ScanWriter::create(&staged.file_path(), units).and_then(|mut writer| {
                part.into_iter().try_for_each(|piece| writer.add(piece))?;
                writer.finish()
            });
            written.map_err(|e| wrong(&path, e))?;
            Ok(staged)
        };
        parts.into_iter().map(one).collect::<Result<Vec<Staged>, Failure>>()
    })?;
    report.stages = vec![read, fit, moved, write];
    let of_samples = surface.facts();
    report.input.diagonal = of_samples.diagonal;
    pipeline::sample_figures(&of_samples, &mut report.quality, &mut report.warnings);
    if let Surface::Bricks(_, plan) = &surface {
        report.quality.insert(key::SCAN_BRICKS.into(), Figure::Count(plan.bricks() as u64));
    }
    figures(&facts, &mut report);
    let written = [staged].into_iter().chain(segments).chain(lines);
    if session.hand_over(written, own_report, &report)? {
        table(args, &of_samples, &facts, &report).print();
    }
    Ok(Status::Done)
}

/// What points are brought to.
enum Surface<'a> {
    Samples(&'a Cloud, Box<Samples>),
    Bricks(Box<dyn BrickStore + 'a>, Box<BrickPlan>),
}

impl Surface<'_> {
    fn facts(&self) -> ScanFacts {
        match self {
            Surface::Samples(_, samples) => ScanFacts::of(samples),
            Surface::Bricks(_, plan) => *plan.facts(),
        }
    }
}

/// The samples of a scan, in bricks if it is large.
fn surface<'a>(scan: &'a Scan, params: &ScanParams, observer: &dyn Observer) -> Result<Surface<'a>, ScanError> {
    let store: Box<dyn BrickStore> = match scan {
        Scan::Whole(cloud) if cloud.points.len() <= BRICK_POINTS => {
            return Ok(Surface::Samples(cloud, Box::new(cloud::clean(cloud, &params.clean, observer)?)));
        }
        Scan::Whole(cloud) => Box::new(CloudStore::new(cloud, BRICK_POINTS)),
        Scan::Bricks(bricks) => Box::new(bricks.clone()),
    };
    let plan = pipeline::clean_bricks(&*store, params, observer)?;
    Ok(Surface::Bricks(store, Box::new(plan)))
}

/// What became of a step, or why there is nothing.
fn ended<T>(args: &Clean, made: Result<T, ScanError>) -> Result<T, Failure> {
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    made.map_err(|e| Failure::input(&args.scan, super::with_hint(&e.to_string())))
}

/// Points that are kept, on their way to their file.
struct Kept {
    file: PointsFile,
    /// The same points, if their segments are wanted.
    pieces: Vec<Cloud>,
    is_parted: bool,
}

impl Kept {
    fn take(&mut self, piece: Cloud) -> Result<(), StoreError> {
        if self.is_parted {
            self.pieces.push(piece.clone());
        }
        self.file.add(piece)
    }
}

fn figures(facts: &PointFacts, report: &mut Report) {
    let counts = [
        (key::SCAN_OUTLIERS, facts.outliers),
        (key::SCAN_POINTS_OUT, facts.kept),
        (key::SCAN_FEATURE_LINES, facts.lines.len()),
    ];
    report.quality.extend(counts.map(|(key, n)| (key.to_owned(), Figure::Count(n as u64))));
    report.quality.insert(key::SCAN_MOVED_RMS.into(), Figure::Number(facts.moved_rms));
}

/// The points of each segment beside the output: `NAME-0.ply`, `NAME-1.ply` ...
fn segments(output: &Path, pieces: &[Cloud]) -> Vec<(PathBuf, Vec<Cloud>)> {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let extension = output.extension().unwrap_or_default().to_string_lossy().into_owned();
    let mut found: BTreeMap<usize, Vec<Cloud>> = BTreeMap::new();
    for piece in pieces {
        let Some(Attribute { values, .. }) = piece.attribute("segment", 1) else { continue };
        let mut ids: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
        values.iter().zip(0..).for_each(|(&k, i)| ids.entry(k as usize).or_default().push(i));
        ids.into_iter().for_each(|(k, ids)| found.entry(k).or_default().push(piece.select(&ids)));
    }
    let path = |k: usize| output.with_file_name(format!("{stem}-{k}.{extension}"));
    found.into_iter().map(|(k, part)| (path(k), part)).collect()
}

/// Sharp lines as polylines of an OBJ file.
fn lines_obj(facts: &PointFacts, shift: DVec3) -> String {
    use std::fmt::Write;
    let mut text = format!("# planish {}: sharp lines\n", env!("CARGO_PKG_VERSION"));
    let mut next = 1;
    for line in &facts.lines {
        for p in line {
            let p = *p + shift;
            let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
        }
        text.push('l');
        for k in 0..line.len() {
            let _ = write!(text, " {}", next + k);
        }
        text.push('\n');
        next += line.len();
    }
    text
}

fn table(args: &Clean, samples: &ScanFacts, facts: &PointFacts, report: &Report) -> Summary {
    let mut table = Summary::default();
    table.row("input", format!("{}: {} points", report.input.path, count(report.input.counts["points"])));
    table.row("noise", report.length(key::SCAN_NOISE));
    table.row("spacing", report.length(key::SCAN_SPACING));
    table.row("samples", count(samples.samples as u64));
    table.row("segments", count(samples.segments as u64));
    table.row(
        "orientation",
        format!("{} % of the evidence agrees", number(100.0 * report.figure(key::SCAN_CONFIDENCE).unwrap_or(0.0))),
    );
    table.row("outliers", count(facts.outliers as u64));
    table.row("points", format!("{}: {}", args.output.display(), count(facts.kept as u64)));
    if let Some(path) = &args.lines {
        table.row("sharp lines", format!("{}: {}", path.display(), count(facts.lines.len() as u64)));
    }
    table
}
