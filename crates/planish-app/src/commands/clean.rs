//! `planish clean`: a scan to denoised, oriented points with flags.

use super::{Session, commit_report, write_failure};
use crate::args::{Clean, Policy};
use crate::failure::{Failure, Status};
use crate::files;
use crate::outputs;
use crate::products::Staged;
use crate::progress;
use crate::summary::Summary;
use planish::cloud::{self, Cleaned, Cloud, Samples};
use planish::mesh::Attribute;
use planish::pipeline::{self, Figure};
use planish_io::WriteError;
use planish_io::report::{Input, Report, count, number};
use std::path::{Path, PathBuf};

/// The facts of a scan as an input.
pub fn scan_facts(path: &Path, scan: &Cloud, units: planish::model::Units) -> Input {
    points_facts(path, (scan.points.len() as u64, scan.bounds().diagonal()), units)
}

/// The facts of a scan as an input, from its number of points and its diagonal.
pub fn points_facts(path: &Path, (points, diagonal): (u64, f64), units: planish::model::Units) -> Input {
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
    let params = args.clean.params(None)?;
    let project = args.project.params(None)?;
    let ((scan, far_off), read) = session.step("read", || files::scan_body(&args.scan, &args.options))?;
    let units = session.units_of(&args.scan);
    let mut report = Report::new("clean", scan_facts(&args.scan, &scan, units));
    let far = scan.shift != planish::DVec3::ZERO;
    report.warnings.extend(far_off);
    report.warnings.extend(session.guessed_units(&args.scan, scan.bounds().diagonal(), far));
    let (made, fit) = session.bars.step("samples", |o| cloud::clean(&scan, &params, o));
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let samples = made.map_err(|e| Failure::input(&args.scan, super::with_hint(&e.to_string())))?;
    let (made, moved) = session.bars.step("points", |o| cloud::project(&scan, &samples, params.outlier, &project, o));
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let cleaned = made.map_err(|e| Failure::input(&args.scan, super::with_hint(&e.to_string())))?;
    let wrong = |path: &Path, e: WriteError| write_failure(&args.scan, path, e);
    let (segments, write) = session.step("write", || {
        planish_io::write_scan_in(staged.file_path(), &cleaned.cloud, units).map_err(|e| wrong(&args.output, e))?;
        if let Some(lines) = &lines {
            super::write_text(&lines.file_path(), &lines_obj(&cleaned))?;
        }
        let parts = if args.segment { segments(&args.output, &cleaned) } else { Vec::new() };
        let paths: Vec<PathBuf> = parts.iter().map(|(path, _)| path.clone()).chain(args.lines.clone()).collect();
        outputs::allow(&[&args.scan, &args.output], &paths, Policy { in_place: false, ..session.common.policy() })?;
        let one = |(path, part): (PathBuf, Cloud)| {
            let staged = Staged::file(&path)?;
            planish_io::write_scan_in(staged.file_path(), &part, units).map_err(|e| wrong(&path, e))?;
            Ok(staged)
        };
        parts.into_iter().map(one).collect::<Result<Vec<Staged>, Failure>>()
    })?;
    report.stages = vec![read, fit, moved, write];
    report.input.diagonal = samples.diagonal;
    pipeline::sample_figures(&pipeline::ScanFacts::of(&samples), &mut report.quality, &mut report.warnings);
    figures(&cleaned, &mut report);
    staged.commit()?;
    segments.into_iter().chain(lines).try_for_each(Staged::commit)?;
    commit_report(own_report, &report)?;
    if !session.common.quiet {
        session.tell_warnings(&report);
        table(args, &samples, &cleaned, &report).print();
    }
    Ok(Status::Done)
}

fn figures(cleaned: &Cleaned, report: &mut Report) {
    let counts = [
        ("scan.outliers", cleaned.outliers),
        ("scan.points_out", cleaned.cloud.points.len()),
        ("scan.feature_lines", cleaned.lines.len()),
    ];
    report.quality.extend(counts.map(|(key, n)| (key.to_owned(), Figure::Count(n as u64))));
    report.quality.insert("scan.moved_rms".into(), Figure::Number(cleaned.moved_rms));
}

/// The points of each segment beside the output: `NAME-0.ply`, `NAME-1.ply` ...
fn segments(output: &Path, cleaned: &Cleaned) -> Vec<(PathBuf, Cloud)> {
    let Some(Attribute { values, .. }) = cleaned.cloud.attribute("segment", 1) else { return Vec::new() };
    let most = values.iter().copied().fold(0.0, f32::max) as usize;
    let stem = output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let extension = output.extension().unwrap_or_default().to_string_lossy().into_owned();
    (0..=most)
        .filter_map(|k| {
            let ids: Vec<u32> = (0..values.len() as u32).filter(|&i| values[i as usize] as usize == k).collect();
            let path = output.with_file_name(format!("{stem}-{k}.{extension}"));
            (!ids.is_empty()).then(|| (path, cleaned.cloud.select(&ids)))
        })
        .collect()
}

/// Sharp lines as polylines of an OBJ file.
fn lines_obj(cleaned: &Cleaned) -> String {
    use std::fmt::Write;
    let mut text = format!("# planish {}: sharp lines\n", env!("CARGO_PKG_VERSION"));
    let mut next = 1;
    for line in &cleaned.lines {
        for p in line {
            let p = *p + cleaned.cloud.shift;
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

fn table(args: &Clean, samples: &Samples, cleaned: &Cleaned, report: &Report) -> Summary {
    let mut table = Summary::default();
    table.row("input", format!("{}: {} points", report.input.path, count(report.input.counts["points"])));
    table.row("noise", report.length("scan.noise"));
    table.row("spacing", report.length("scan.spacing"));
    table.row("samples", count(samples.samples.len() as u64));
    table.row("segments", count(samples.closed.len() as u64));
    table.row(
        "orientation",
        format!("{} % of the evidence agrees", number(100.0 * report.figure("scan.confidence").unwrap_or(0.0))),
    );
    table.row("outliers", count(cleaned.outliers as u64));
    table.row("points", format!("{}: {}", args.output.display(), count(cleaned.cloud.points.len() as u64)));
    if let Some(path) = &args.lines {
        table.row("sharp lines", format!("{}: {}", path.display(), count(cleaned.lines.len() as u64)));
    }
    table
}
