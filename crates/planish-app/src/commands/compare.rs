//! `planish compare`: how far two surfaces are from each other.

use super::{Session, commit_report};
use crate::args::{Compare, SurfaceWord};
use crate::failure::{Failure, Status};
use crate::files::{self, Content};
use crate::placed::Placed;
use crate::progress;
use crate::summary::Summary;
use crate::tolerance::Scale;
use planish::DVec3;
use planish::mesh::compare::Spread;
use planish::mesh::{CompareParams, Comparison, TriMesh, compare as compare_meshes};
use planish::model::Units;
use planish::pipeline::{self, Figure, Quality};
use planish_io::report::{Report, distance, number, percent};
use std::path::Path;

pub fn compare(session: &Session, args: &Compare) -> Result<Status, Failure> {
    let own_report = session.stage_report()?;
    let ((a, b), read) = session.step("read", || Ok((files::content(&args.a)?, files::content(&args.b)?)))?;
    let (a_units, b_units) = (units_of(session, &args.a, &a), units_of(session, &args.b, &b));
    let (a, b) = (surface_of(&args.a, a, args.surface)?, surface_of(&args.b, b, args.surface)?);
    // In units of A, and both as far from the origin as A is.
    let scale = b_units.metres() / a_units.metres();
    let apart = b.shift * scale - a.shift;
    let (a, mut b) = (a.mesh, b.mesh);
    if scale != 1.0 || apart != DVec3::ZERO {
        b.points.iter_mut().for_each(|p| *p = *p * scale + apart);
    }
    let mut params = CompareParams::default();
    params.seed = session.common.seed.unwrap_or(params.seed);
    let (found, measure) = session.bars.step("measure", |o| compare_meshes(&a, &b, &params, o));
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let found = found.map_err(|e| Failure::input(&args.a, e).hint("look for faults in both with `planish info`"))?;
    let mut report = Report::new("compare", files::mesh_facts(&args.a, &a, a_units));
    report.stages = vec![read, measure];
    report.quality = figures(&found);
    commit_report(own_report, &report)?;
    let scale = Scale { diagonal: a.bounds().diagonal(), units: a_units };
    let tolerance = args.tolerance.map(|t| t.length(scale));
    let missed = tolerance.is_some_and(|t| found.both.max > t);
    if !session.common.quiet {
        table(args, &found, tolerance, &report).print();
    }
    Ok(if missed { Status::Missed } else { Status::Done })
}

/// Units of a file that is compared: a model has its own.
fn units_of(session: &Session, path: &Path, content: &Content) -> Units {
    match content {
        Content::Model(model) => session.common.units.map_or(model.units, Units::from),
        Content::Mesh(_) => session.units_of(path),
    }
}

/// A surface near the origin, and what brings it back to its place.
struct Far {
    mesh: TriMesh,
    shift: DVec3,
}

/// The surface of a file that is compared.
fn surface_of(path: &Path, content: Content, word: SurfaceWord) -> Result<Far, Failure> {
    let model = match content {
        Content::Mesh(mesh) => {
            let Placed { mesh, shift, .. } = Placed::new(mesh, None);
            return Ok(Far { mesh, shift });
        }
        Content::Model(model) => model,
    };
    let shift = model.shift;
    let made = match word {
        SurfaceWord::Mesh => return Ok(Far { mesh: model.mesh, shift }),
        SurfaceWord::Base => pipeline::surface_mesh(&model, &crate::progress::Interrupt),
        SurfaceWord::Displaced => pipeline::displaced_mesh(&model, &crate::progress::Interrupt),
    };
    let mesh = made.map_err(|e| Failure::input(path, e).hint("fit it again with `planish fit`"))?;
    Ok(Far { mesh, shift })
}

fn figures(found: &Comparison) -> Quality {
    let mut quality = Quality::new();
    let spreads = [("distance", &found.both), ("a_to_b", &found.a_to_b), ("b_to_a", &found.b_to_a)];
    for (name, spread) in spreads {
        for (key, value) in [("rms", spread.rms), ("mean", spread.mean), ("p95", spread.p95), ("max", spread.max)] {
            quality.insert(format!("{name}.{key}"), Figure::Number(value));
            quality.insert(format!("{name}.{key}_rel"), Figure::Number(value / found.diagonal));
        }
    }
    let normal = &found.normal_deg;
    for (key, value) in [("rms", normal.rms), ("mean", normal.mean), ("p95", normal.p95), ("max", normal.max)] {
        quality.insert(format!("normal.{key}_deg"), Figure::Number(value));
    }
    quality.insert("normal.flipped_share".into(), Figure::Number(found.flipped_share));
    quality
}

fn table(args: &Compare, found: &Comparison, tolerance: Option<f64>, report: &Report) -> Summary {
    let unit = report.input.units.as_str();
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
    table.row("distance, RMS", distance(found.both.rms, found.diagonal, unit));
    table.row("distance, largest", distance(found.both.max, found.diagonal, unit));
    table.row("from a to b", spread(&found.a_to_b));
    table.row("from b to a", spread(&found.b_to_a));
    let normal = &found.normal_deg;
    table.row("normals", format!("mean {} degrees, 95 % within {}", number(normal.mean), number(normal.p95)));
    table.row("turned over", percent(found.flipped_share));
    if let Some(tolerance) = tolerance {
        let word = if found.both.max > tolerance { "missed" } else { "kept" };
        table.row("tolerance", format!("{} {unit}: {word}", number(tolerance)));
    }
    table
}
