//! `planish compare`: how far two shapes are from each other.

use super::{Session, commit_report, write_failure};
use crate::args::Compare;
use crate::failure::{Failure, Status};
use crate::files;
use crate::pictures;
use crate::products::{self, Staged};
use crate::progress;
use crate::shapes::{self, Located};
use crate::summary::Summary;
use crate::tolerance::Scale;
use planish::DVec3;
use planish::mesh::compare::Spread;
use planish::mesh::{Attribute, CompareParams};
use planish::model::Units;
use planish::observe::Observer;
use planish::pipeline::key;
use planish::pipeline::{Figure, Quality};
use planish::register::{self, AlignError, AlignParams, Aligned, Deviation, DeviationError, Histogram, Shape};
use planish::render;
use planish_io::WriteOptions;
use planish_io::report::{Report, distance, number, percent};
use std::path::Path;

/// Classes of the histogram: odd, so that zero lies in the middle of one.
const CLASSES: usize = 11;
/// Letters of the longest bar of the histogram.
const BAR: f64 = 30.0;

/// The two shapes in units of A, both as far from the origin as A is.
struct Both {
    a: Shape,
    b: Shape,
    /// What brings them back to their place.
    shift: DVec3,
    units: Units,
}

/// What was measured.
struct Found {
    aligned: Option<Aligned>,
    deviation: Deviation,
    /// Distance of each vertex or point of A, where it is asked for.
    column: Vec<f64>,
}

pub fn compare(session: &Session, args: &Compare) -> Result<Status, Failure> {
    args.output.as_deref().map_or(Ok(()), |path| files::check_extension(path, &["ply"]))?;
    args.picture.as_deref().map_or(Ok(()), |path| files::check_extension(path, &["png"]))?;
    let output = args.output.as_deref().map(Staged::file).transpose()?;
    let picture = args.picture.as_deref().map(Staged::file).transpose()?;
    let own_report = session.stage_report()?;
    let (mut both, read) = session.step("read", || both(session, args))?;
    let mut report = Report::new("compare", shapes::facts(&args.a, &both.a, both.units));
    let (made, measure) = session.bars.step("measure", |o| measure(session, args, &mut both, o));
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let found = made?;
    report.stages = vec![read, measure];
    let scale = Scale { diagonal: found.deviation.diagonal, units: both.units };
    let tolerance = args.tolerance.map(|t| t.length(scale));
    report.quality = figures(&found, tolerance);
    report.histogram = Some(found.deviation.histogram(CLASSES));
    if let Some(picture) = &picture {
        let reach = reach(&found.column);
        let png = pictures::coloured(&both.a, &found.column, reach, args.up.into(), both.units.symbol())?;
        std::fs::write(picture.file_path(), png).map_err(|e| products::unwritable(&picture.file_path(), &e))?;
    }
    if let (Some(staged), Some(path)) = (&output, &args.output) {
        write(&staged.file_path(), path, args, &mut both, &found.column)?;
    }
    [output, picture].into_iter().flatten().try_for_each(Staged::commit)?;
    commit_report(own_report, &report)?;
    let missed = tolerance.is_some_and(|t| found.deviation.share_within(t) < args.within / 100.0);
    if !session.common.quiet {
        table(args, &found, tolerance.map(|t| (t, missed)), &report).print();
    }
    Ok(if missed { Status::Missed } else { Status::Done })
}

/// Reads both, and brings B to the units and the neighbourhood of A.
fn both(session: &Session, args: &Compare) -> Result<Both, Failure> {
    let read = |path: &Path| shapes::read(path, &args.scan, args.surface);
    let (a, mut b) = (read(&args.a)?, read(&args.b)?);
    let units = |path: &Path, found: &Located| match (session.common.units, found.units) {
        (Some(units), Some(_)) => units.into(),
        (_, Some(own)) => own,
        (_, None) => session.units_of(path),
    };
    let (a_units, b_units) = (units(&args.a, &a), units(&args.b, &b));
    let scale = b_units.metres() / a_units.metres();
    let apart = b.shift * scale - a.shift;
    if scale != 1.0 || apart != DVec3::ZERO {
        b.shape.points_mut().iter_mut().for_each(|p| *p = *p * scale + apart);
    }
    Ok(Both { a: a.shape, b: b.shape, shift: a.shift, units: a_units })
}

fn measure(session: &Session, args: &Compare, both: &mut Both, observer: &dyn Observer) -> Result<Found, Failure> {
    let seed = session.common.seed;
    let look = "look for faults in both with `planish info`";
    let aligned = if args.align {
        let params = AlignParams { seed: seed.unwrap_or_default(), ..AlignParams::default() };
        let found = register::align(&both.a, &both.b, &params, observer).map_err(|e| match e {
            AlignError::Cancelled(_) => Failure::interrupted(),
            e => Failure::input(&args.a, format!("cannot be fitted on {}: {e}", args.b.display())).hint(look),
        })?;
        match &mut both.a {
            Shape::Surface(mesh) => found.placement.mesh(mesh),
            Shape::Points(cloud) => found.placement.cloud(cloud),
        }
        Some(found)
    } else {
        None
    };
    let mut params = CompareParams::default();
    params.seed = seed.unwrap_or(params.seed);
    let wrong = |e: DeviationError| match e {
        DeviationError::Cancelled(_) => Failure::interrupted(),
        DeviationError::Mesh { which, error } => {
            Failure::input(if which == 'a' { &args.a } else { &args.b }, error).hint(look)
        }
        DeviationError::NoPoints { which } => {
            let path = if which == 'a' { &args.a } else { &args.b };
            Failure::input(path, "has no point whose coordinates are numbers").hint(look)
        }
    };
    let deviation = register::deviation(&both.a, &both.b, &params, observer).map_err(wrong)?;
    let wants_column = args.output.is_some() || args.picture.is_some();
    let column = if wants_column { register::column(&both.a, &both.b, observer).map_err(wrong)? } else { Vec::new() };
    Ok(Found { aligned, deviation, column })
}

/// Ends of the colour scale: what 98 of 100 distances keep.
fn reach(column: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = column.iter().filter(|d| d.is_finite()).map(|d| d.abs()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    sizes.get(sizes.len() * 98 / 100).copied().unwrap_or(0.0).max(f64::MIN_POSITIVE)
}

/// Writes A with its distances and colours, in its place.
fn write(staged: &Path, path: &Path, args: &Compare, both: &mut Both, column: &[f64]) -> Result<(), Failure> {
    let reach = reach(column);
    let color = |d: &f64| render::signed_color(0.5 + d / reach / 2.0).map(|c| c as f32 / 255.0);
    let attributes = [
        Attribute { name: "distance".into(), width: 1, values: column.iter().map(|d| *d as f32).collect() },
        Attribute { name: "color".into(), width: 3, values: column.iter().flat_map(color).collect() },
    ];
    let own = match &mut both.a {
        Shape::Surface(mesh) => &mut mesh.attributes,
        Shape::Points(cloud) => &mut cloud.attributes,
    };
    own.retain(|a| attributes.iter().all(|new| new.name != a.name));
    own.extend(attributes);
    let shift = both.shift;
    let written = match &mut both.a {
        Shape::Surface(mesh) => {
            mesh.points.iter_mut().for_each(|p| *p += shift);
            planish_io::write_mesh(staged, mesh, &WriteOptions { units: both.units, ..WriteOptions::default() })
        }
        Shape::Points(cloud) => {
            // Points that are no numbers have no distance and no place in a file.
            let ids: Vec<u32> =
                (0..cloud.points.len() as u32).filter(|&i| cloud.points[i as usize].is_finite()).collect();
            let mut kept = cloud.select(&ids);
            kept.shift = shift;
            planish_io::write_scan_in(staged, &kept, both.units)
        }
    };
    written.map_err(|e| write_failure(&args.a, path, e))
}

fn figures(found: &Found, tolerance: Option<f64>) -> Quality {
    let mut quality = Quality::new();
    let d = &found.deviation;
    for (name, spread) in [("distance", &d.both), ("a_to_b", &d.a_to_b), ("b_to_a", &d.b_to_a)] {
        for (key, value) in [("rms", spread.rms), ("mean", spread.mean), ("p95", spread.p95), ("max", spread.max)] {
            quality.insert(format!("{name}.{key}"), Figure::Number(value));
            quality.insert(format!("{name}.{key}_rel"), Figure::Number(value / d.diagonal));
        }
    }
    let mut number = |key: &str, value: f64| quality.insert(key.to_owned(), Figure::Number(value));
    if let Some(normal) = &d.normal_deg {
        for (key, value) in [("rms", normal.rms), ("mean", normal.mean), ("p95", normal.p95), ("max", normal.max)] {
            number(&format!("normal.{key}_deg"), value);
        }
    }
    if let Some(share) = d.flipped_share {
        number(key::NORMAL_FLIPPED_SHARE, share);
    }
    if d.signed {
        let [mean, deviation] = d.mean_and_deviation();
        number(key::SIGNED_MEAN, mean);
        number(key::SIGNED_DEVIATION, deviation);
        number(key::SIGNED_MIN, d.values.first().copied().unwrap_or(0.0));
        number(key::SIGNED_MAX, d.values.last().copied().unwrap_or(0.0));
    }
    if let Some(t) = tolerance {
        number(key::DISTANCE_TOLERANCE, t);
        number(key::DISTANCE_WITHIN_SHARE, d.share_within(t));
    }
    if let Some(a) = &found.aligned {
        number(key::ALIGN_TURN_DEG, a.placement.turn_deg());
        number(key::ALIGN_MEDIAN_BEFORE, a.median[0]);
        number(key::ALIGN_MEDIAN, a.median[1]);
        let m = a.placement.linear;
        for (k, column) in [m.x_axis, m.y_axis, m.z_axis, a.placement.shift].iter().enumerate() {
            for (row, value) in column.to_array().into_iter().enumerate() {
                number(&format!("align.matrix_{}{}", row + 1, k + 1), value);
            }
        }
    }
    quality
}

fn table(args: &Compare, found: &Found, tolerance: Option<(f64, bool)>, report: &Report) -> Summary {
    let unit = report.input.units.as_str();
    let d = &found.deviation;
    let mut table = Summary::default();
    let spread = |s: &Spread| {
        format!(
            "RMS {}, mean {}, 95 % within {}, largest {} {unit}",
            number(s.rms),
            number(s.mean),
            number(s.p95),
            number(s.max)
        )
    };
    table.row("a", args.a.display().to_string());
    table.row("b", args.b.display().to_string());
    if let Some(a) = &found.aligned {
        let rest = if a.settled { "" } else { "; it has not come to rest" };
        let text = format!(
            "A turned by {} degrees; median distance {} before, {} {unit} after{rest}",
            number(a.placement.turn_deg()),
            number(a.median[0]),
            number(a.median[1])
        );
        table.row("best fit", text);
    }
    table.row("distance, RMS", distance(d.both.rms, d.diagonal, unit));
    table.row("distance, largest", distance(d.both.max, d.diagonal, unit));
    table.row("from a to b", spread(&d.a_to_b));
    table.row("from b to a", spread(&d.b_to_a));
    if d.signed {
        let [mean, deviation] = d.mean_and_deviation();
        let [low, high] = [d.values.first(), d.values.last()].map(|v| number(v.copied().unwrap_or(0.0)));
        let text = format!("mean {} {unit}, deviation {}, from {low} to {high}", number(mean), number(deviation));
        table.row("a outside of b", text);
    }
    if let (Some(normal), Some(flipped)) = (&d.normal_deg, d.flipped_share) {
        table.row("normals", format!("mean {} degrees, 95 % within {}", number(normal.mean), number(normal.p95)));
        table.row("turned over", percent(flipped));
    }
    if let Some(histogram) = &report.histogram {
        bars(&mut table, histogram, unit);
    }
    for (name, path) in [("distances", &args.output), ("picture", &args.picture)] {
        if let Some(path) = path {
            table.row(name, path.display().to_string());
        }
    }
    if let Some((tolerance, missed)) = tolerance {
        let word = if missed { "missed" } else { "kept" };
        let share = percent(d.share_within(tolerance));
        table.row(
            "tolerance",
            format!("{} {unit}: {share} within, {} wanted: {word}", number(tolerance), percent(args.within / 100.0)),
        );
    }
    table
}

/// The classes as lines with bars.
fn bars(table: &mut Summary, histogram: &Histogram, unit: &str) {
    let most = histogram.shares.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    for (k, share) in histogram.shares.iter().enumerate() {
        let bar = "#".repeat((BAR * share / most).round() as usize);
        let last = k + 1 == histogram.shares.len();
        let range = match k {
            0 if histogram.bounds[0] < 0.0 => format!("below {} {unit}", number(histogram.bounds[1])),
            _ if last => format!("above {} {unit}", number(histogram.bounds[k])),
            _ => format!("{} to {} {unit}", number(histogram.bounds[k]), number(histogram.bounds[k + 1])),
        };
        table.row(range, format!("{:>7}  {bar}", percent(*share)));
    }
}
