//! `planish smooth`: noise off a mesh, features kept.

use super::super::{Session, write_failure};
use crate::args::Smooth;
use crate::failure::{Failure, Status};
use crate::files;
use crate::placed::{self, Placed};
use crate::products::Staged;
use crate::progress;
use crate::summary::Summary;
use planish::mesh::smooth as smooth_mesh;
use planish::pipeline::key;
use planish::pipeline::{Figure, Warning};
use planish_io::WriteOptions;
use planish_io::report::{Report, count, number};

pub fn smooth(session: &Session, args: &Smooth) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["ply", "obj", "stl", "glb"])?;
    let staged = Staged::file(&args.output)?;
    let own_report = session.stage_report()?;
    let params = args.smooth.params(None)?;
    let (placed, read) = session.step("read", || Placed::read(&args.mesh))?;
    let (mesh, tags, units) = (&placed.mesh, placed.tags.clone(), session.units_of(&args.mesh));
    let (made, record) = session.bars.step("smooth", |o| smooth_mesh(mesh, tags.as_ref(), &params, o));
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let made = made.map_err(|e| {
        Failure::input(&args.mesh, super::super::with_hint(&e.to_string())).hint("look for faults with `planish info`")
    })?;
    let options = WriteOptions { units, ..WriteOptions::default() };
    let tags = tags.unwrap_or_default();
    let moved = placed::write(&staged.file_path(), &made.mesh, &tags, placed.shift, &options)
        .map_err(|e| write_failure(&args.mesh, &args.output, e))?;
    let mut report = Report::new("smooth", files::mesh_facts(&args.mesh, mesh, units));
    report.warnings.extend(placed.warning(units.symbol()).into_iter().chain(moved));
    report.stages = vec![read, record];
    report.quality.insert(key::MESH_TRIANGLES.into(), Figure::Count(made.mesh.triangles.len() as u64));
    report.quality.insert(key::MESH_NOISE.into(), Figure::Number(made.noise));
    report.quality.insert(key::MESH_KEPT_VERTICES.into(), Figure::Count(made.kept as u64));
    report.quality.insert(key::MESH_FEATURE_EDGES.into(), Figure::Count(tags.edges.len() as u64));
    if made.kept > 0 {
        let text = format!("{} vertices stayed where they were: triangles would have turned or met.", made.kept);
        report.warnings.push(Warning::new("kept_vertices", text, ""));
    }
    if session.hand_over([staged], own_report, &report)? {
        let unit = report.input.units.as_str();
        let mut table = Summary::default();
        table.row("input", format!("{}: {} triangles", report.input.path, count(mesh.triangles.len() as u64)));
        table.row("noise", format!("{} {unit}", number(made.noise)));
        table.row("feature edges", count(tags.edges.len() as u64));
        table.row("mesh", args.output.display().to_string());
        table.print();
    }
    Ok(Status::Done)
}
