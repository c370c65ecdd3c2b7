//! `planish compare`: how far two surfaces are from each other.

use super::{Session, commit_report};
use crate::args::{Compare, SurfaceWord};
use crate::failure::{Failure, Status};
use crate::files::{self, Content};
use crate::progress;
use crate::summary::Summary;
use planish::mesh::compare::Spread;
use planish::mesh::{CompareParams, Comparison, TriMesh, compare as compare_meshes};
use planish::pipeline::{self, Figure, Quality};
use planish_io::report::{Report, distance, number, percent};
use std::path::Path;

pub fn compare(session: &Session, args: &Compare) -> Result<Status, Failure> {
    let own_report = session.stage_report()?;
    let ((a, b), read) = session.step("read", || Ok((files::content(&args.a)?, files::content(&args.b)?)))?;
    let (a, b) = (surface_of(&args.a, a, args.surface)?, surface_of(&args.b, b, args.surface)?);
    let mut params = CompareParams::default();
    params.seed = session.common.seed.unwrap_or(params.seed);
    let (found, measure) = session.bars.step("measure", |o| compare_meshes(&a, &b, &params, o));
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let found = found.map_err(|e| Failure::input(&args.a, e).hint("look for faults in both with `planish info`"))?;
    let mut report = Report::new("compare", files::mesh_facts(&args.a, &a, session.units()));
    report.stages = vec![read, measure];
    report.quality = figures(&found);
    commit_report(own_report, &report)?;
    let missed = args.tolerance.is_some_and(|t| found.both.max > t);
    if !session.common.quiet {
        table(args, &found, &report).print();
    }
    Ok(if missed { Status::Missed } else { Status::Done })
}

/// The surface of a file that is compared.
fn surface_of(path: &Path, content: Content, word: SurfaceWord) -> Result<TriMesh, Failure> {
    let model = match content {
        Content::Mesh(mesh) => return Ok(mesh),
        Content::Model(model) => model,
    };
    let made = match word {
        SurfaceWord::Mesh => return Ok(model.mesh),
        SurfaceWord::Base => pipeline::surface_mesh(&model, &crate::progress::Interrupt),
        SurfaceWord::Displaced => pipeline::displaced_mesh(&model, &crate::progress::Interrupt),
    };
    made.map_err(|e| Failure::input(path, e).hint("fit it again with `planish fit`"))
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

fn table(args: &Compare, found: &Comparison, report: &Report) -> Summary {
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
    if let Some(tolerance) = args.tolerance {
        let word = if found.both.max > tolerance { "missed" } else { "kept" };
        table.row("tolerance", format!("{} {unit}: {word}", number(tolerance)));
    }
    table
}
