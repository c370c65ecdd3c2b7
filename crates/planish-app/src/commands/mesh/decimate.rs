//! `planish decimate`: fewer triangles, features kept.

use super::super::{Session, write_failure};
use crate::args::Decimate;
use crate::failure::{Failure, Status};
use crate::files;
use crate::placed::{self, Placed};
use crate::products::Staged;
use crate::progress;
use crate::summary::Summary;
use crate::tolerance::Scale;
use planish::mesh::{DecimateError, DecimateParams, DecimateTarget, decimate as decimate_mesh, diagnose};
use planish::pipeline::key;
use planish::pipeline::{Figure, Warning};
use planish_io::WriteOptions;
use planish_io::report::{Report, count, number};

pub fn decimate(session: &Session, args: &Decimate) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["ply", "obj", "stl", "glb"])?;
    let staged = Staged::file(&args.output)?;
    let own_report = session.stage_report()?;
    let (placed, read) = session.step("read", || Placed::read(&args.mesh))?;
    let (mesh, tags, units) = (&placed.mesh, placed.tags.as_ref(), session.units_of(&args.mesh));
    let scale = Scale { diagonal: mesh.bounds().diagonal(), units };
    let params = args.decimate.params_at(DecimateParams::default(), None, scale)?;
    let (made, record) = session.bars.step("decimate", |o| decimate_mesh(mesh, tags, &params, o));
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let made = made.map_err(|e| {
        if let DecimateError::Target { .. } = e {
            return Failure::usage(&args.mesh, super::super::with_hint(&e.to_string()));
        }
        Failure::input(&args.mesh, super::super::with_hint(&e.to_string())).hint("look for faults with `planish info`")
    })?;
    let options = WriteOptions { units, ..WriteOptions::default() };
    let moved = placed::write(&staged.file_path(), &made.mesh, &made.tags, placed.shift, &options)
        .map_err(|e| write_failure(&args.mesh, &args.output, e))?;
    let mut report = Report::new("decimate", files::mesh_facts(&args.mesh, mesh, units));
    report.warnings.extend(placed.warning(units.symbol()).into_iter().chain(moved));
    report.stages = vec![read, record];
    let facts = diagnose(&made.mesh);
    report.quality.insert(key::MESH_TRIANGLES.into(), Figure::Count(facts.triangles as u64));
    report.quality.insert(key::MESH_WATERTIGHT.into(), Figure::Flag(facts.watertight));
    report.quality.insert(key::MESH_MANIFOLD.into(), Figure::Flag(facts.manifold));
    report.quality.insert(key::MESH_FEATURE_EDGES.into(), Figure::Count(made.tags.edges.len() as u64));
    report.quality.insert(key::MESH_SELF_INTERSECTIONS.into(), Figure::Count(made.self_intersections as u64));
    if let Some(distance) = made.distance {
        report.quality.insert(key::MESH_DISTANCE_MAX.into(), Figure::Number(distance));
    }
    if made.self_intersections > 0 {
        let text = format!("{} pairs of triangles meet, as in the input.", made.self_intersections);
        report.warnings.push(Warning::new("self_intersections", text, ""));
    }
    let wanted = match params.target {
        DecimateTarget::Triangles(n) => Some(n),
        DecimateTarget::Ratio(r) => Some((mesh.triangles.len() as f64 * r) as usize),
        DecimateTarget::Tolerance(_) => None,
    };
    if let Some(wanted) = wanted.filter(|&n| facts.triangles > n) {
        let text = format!(
            "{} triangles are left where {} were wanted: no other can go without turning one, touching, or leaving a feature.",
            count(facts.triangles as u64),
            count(wanted as u64)
        );
        report.warnings.push(Warning::new("target_missed", text, ""));
    }
    if session.hand_over([staged], own_report, &report)? {
        let unit = report.input.units.as_str();
        let mut table = Summary::default();
        table.row("input", format!("{}: {} triangles", report.input.path, count(mesh.triangles.len() as u64)));
        table.row("triangles", count(facts.triangles as u64));
        table.row("feature edges", count(made.tags.edges.len() as u64));
        if let Some(distance) = made.distance {
            table.row("distance", format!("at most {} {unit} from the input", number(distance)));
        }
        table.row("mesh", args.output.display().to_string());
        table.print();
    }
    Ok(Status::Done)
}
