//! `planish info`: what is in a file, and what is wrong with it.

mod contents;

use self::contents::Contents;
use super::{Session, batch, commit_report};
use crate::args::{Info, ScanArgs, is_pattern};
use crate::failure::{Failure, Status};
use crate::files::{self, Content};
use crate::summary::Summary;
use crate::{progress, stdout};
use planish::DVec3;
use planish::mesh::{Adjacency, Diagnosis, TriMesh, diagnose};
use planish::model::{Model, Units};
use planish::pipeline::key;
use planish::pipeline::{Figure, Warning};
use planish_io::report::{Report, count, number};
use planish_io::{FileUnits, MeshFormat};

/// True if there is more than one file, or a pattern that may mean so.
pub fn is_several(args: &Info) -> bool {
    args.files.len() > 1 || args.files.iter().any(|path| is_pattern(path))
}

/// One file after the other; one that cannot be used does not stop the others.
pub fn several(session: &Session, args: Info) -> Result<Status, Failure> {
    if let Some(report) = &session.common.report {
        return Err(Failure::usage(report, "takes the report of one file").hint("say --json: a line for each file"));
    }
    let mut status = Status::Done;
    for (n, path) in batch::expanded(&args.files)?.into_iter().enumerate() {
        if n > 0 && !session.common.quiet {
            stdout::table_line("");
        }
        let one = Info { files: vec![path], from: args.from.clone(), common: args.common.clone() };
        match info(session, &one) {
            Err(failure) if failure.status == Status::Interrupted => return Err(failure),
            Err(failure) => {
                failure.print();
                status = failure.status;
            }
            Ok(_) => {}
        }
    }
    Ok(status)
}

pub fn info(session: &Session, args: &Info) -> Result<Status, Failure> {
    let file = &args.files[0];
    let own_report = session.stage_report()?;
    if planish_io::is_scan(file) {
        let report = scan_info(session, args)?;
        return commit_report(own_report, &report).map(|()| Status::Done);
    }
    let units = session.common.units.map(Units::from);
    let (other, read) = session.step("read", || contents::of(file, units))?;
    if let Some(Contents { input, table }) = other {
        let report = Report { stages: vec![read], ..Report::new("info", input) };
        if !session.common.quiet {
            table.print();
        }
        return commit_report(own_report, &report).map(|()| Status::Done);
    }
    if !files::is_model(file) && MeshFormat::of(file).is_none() && file.exists() {
        let scans = planish_io::SCAN_EXTENSIONS.map(|e| format!(".{e}")).join(", ");
        let meshes = MeshFormat::ALL.map(|f| format!(".{}", f.extension())).join(", ");
        return Err(Failure::input(file, "is of no kind that planish knows").hint(format!(
            "meshes are {meshes}; scans {scans}; models .planish; volumes .nrrd, .npy; scripts .toml; networks and reports \
             .json; .step, .exr, folders of maps"
        )));
    }
    let (content, read) = session.step("read", || files::content(file))?;
    let (mesh, model) = match &content {
        Content::Mesh(mesh) => (mesh, None),
        Content::Model(model) => (&model.mesh, Some(model.as_ref())),
    };
    let units =
        session.common.units.map(Into::into).or(model.map(|m| m.units)).unwrap_or_else(|| session.units_of(file));
    let input = match model {
        Some(model) => files::model_facts(file, model, units),
        None => files::mesh_facts(file, mesh, units),
    };
    let mut report = Report::new("info", input);
    let facts = diagnose(mesh);
    report.stages.push(read);
    report.warnings = faults(&facts);
    figures(&facts, &mut report);
    let crossings = crossings(mesh, &mut report);
    let of_mesh = report.warnings.len();
    if let Some(model) = model {
        report.quality.insert(key::PATCHES_COUNT.into(), Figure::Count(model.network.patches.len() as u64));
        let control: usize = model.surfaces.iter().map(|s| s.control.len()).sum();
        report.quality.insert(key::SURFACE_CONTROL_POINTS.into(), Figure::Count(control as u64));
        super::relief::folds(model, &mut report, file)?;
        report.warnings.extend(network_faults(model));
        folds(model, &mut report);
    }
    if session.hand_over([], own_report, &report)? {
        let mut table = Summary::default();
        mesh_rows(&mut table, &report, &facts, model.map_or(DVec3::ZERO, |m| m.shift));
        table.row("crossings", crossings);
        table.row("folded back", report.figure(key::MESH_FOLDED_BACK).map_or(String::new(), |n| count(n as u64)));
        table.row("units", told_units(session, args, model.is_some(), &report));
        let columns: Vec<&str> = mesh.attributes.iter().map(|a| a.name.as_str()).collect();
        table.row("attributes", if columns.is_empty() { "none".into() } else { columns.join(", ") });
        if let Some(model) = model {
            model_rows(&mut table, model);
            if let (Some(grids), Some(surfaces)) = (report.figure(key::GRID_FOLDS), report.figure(key::SURFACE_FOLDS)) {
                table.row("folds", format!("{grids} cells of grids, {surfaces} places of surfaces"));
            }
        }
        let step = if of_mesh > 0 { "; `planish run` repairs what it can of the mesh" } else { "" };
        let verdict = match report.warnings.len() {
            0 => "nothing".to_owned(),
            1 => format!("one thing, told above{step}"),
            n => format!("{n} things, told above{step}"),
        };
        table.row("wrong", verdict);
        table.print();
    }
    Ok(Status::Done)
}

/// What is in a scan.
fn scan_info(session: &Session, args: &Info) -> Result<Report, Failure> {
    let file = &args.files[0];
    let (scan, read) = session.step("read", || files::scan(file, &ScanArgs::default()))?;
    let mut report = Report::new(
        "info",
        super::clean::scan_facts(file, (scan.points.len() as u64, scan.bounds().diagonal()), session.units_of(file)),
    );
    report.stages.push(read);
    let lost = scan.points.iter().filter(|p| !p.is_finite()).count();
    let mut places: Vec<[u64; 3]> =
        scan.points.iter().filter(|p| p.is_finite()).map(|p| p.to_array().map(f64::to_bits)).collect();
    let finite = places.len();
    places.sort_unstable();
    places.dedup();
    let repeated = finite - places.len();
    let facts = [
        (key::SCAN_POINTS, scan.points.len()),
        (key::SCAN_NOT_FINITE, lost),
        (key::SCAN_REPEATED, repeated),
        (key::SCAN_SCANNERS, scan.scanners.len()),
    ];
    report.quality.extend(facts.map(|(key, n)| (key.to_owned(), Figure::Count(n as u64))));
    for (n, code, what) in [
        (lost, "not_finite", "points have coordinates that are no numbers; they are left out"),
        (repeated, "repeated", "points repeat others exactly; they count once"),
    ] {
        if n > 0 {
            report.warnings.push(Warning::new(code, format!("{} {what}.", count(n as u64)), ""));
        }
    }
    if session.common.quiet {
        return Ok(report);
    }
    session.tell_warnings(&report);
    let unit = report.input.units.as_str();
    let bounds = scan.bounds();
    let corner = |p: DVec3| contents::corner(p + scan.shift, bounds.diagonal());
    let mut table = Summary::default();
    table.row("points", count(scan.points.len() as u64));
    table.row("from", format!("{} {unit}", corner(bounds.min)));
    table.row("to", format!("{} {unit}", corner(bounds.max)));
    table.row("diagonal", format!("{} {unit}", number(bounds.diagonal())));
    let columns: Vec<&str> = scan.attributes.iter().map(|a| a.name.as_str()).collect();
    table.row("columns", if columns.is_empty() { "positions only".into() } else { columns.join(", ") });
    let scanners = match scan.scanners.len() {
        0 => "positions unknown".to_owned(),
        n => format!("{n} with known positions"),
    };
    table.row("scanners", scanners);
    table.row("units", told_units(session, args, false, &report));
    table.print();
    Ok(report)
}

fn figures(facts: &Diagnosis, report: &mut Report) {
    let counts = [
        (key::MESH_TRIANGLES, facts.triangles),
        (key::MESH_VERTICES, facts.vertices),
        (key::MESH_COMPONENTS, facts.components),
        (key::MESH_BOUNDARY_LOOPS, facts.boundary_loops),
        (key::MESH_NON_MANIFOLD_EDGES, facts.non_manifold_edges),
        (key::MESH_NON_MANIFOLD_VERTICES, facts.non_manifold_vertices),
        (key::MESH_DUPLICATE_FACES, facts.duplicate_faces),
        (key::MESH_DEGENERATE_FACES, facts.degenerate_faces),
        (key::MESH_FLIPPED_FACES, facts.flipped_faces),
        (key::MESH_UNREFERENCED_VERTICES, facts.unreferenced_vertices),
    ];
    report.quality.extend(counts.map(|(key, n)| (key.to_owned(), Figure::Count(n as u64))));
    super::mesh_figures(facts, report);
}

/// What is wrong with a mesh, in words.
fn faults(facts: &Diagnosis) -> Vec<Warning> {
    let several = [
        ("bad_indices", facts.bad_indices, "triangles name vertices that do not exist"),
        ("not_finite", facts.non_finite_vertices, "vertices have a position that is no number"),
        ("non_manifold_edges", facts.non_manifold_edges, "edges have more than two triangles"),
        ("non_manifold_vertices", facts.non_manifold_vertices, "vertices join surfaces that touch in a point"),
        ("flipped_faces", facts.flipped_faces, "triangles face the other way than their neighbours"),
        ("inverted_pieces", facts.inverted_components, "closed pieces are inside out, or voids in another"),
        ("duplicate_faces", facts.duplicate_faces, "triangles repeat another"),
        ("degenerate_faces", facts.degenerate_faces, "triangles have no area"),
        ("boundary", facts.boundary_loops, "boundaries: the surface is open"),
        ("unreferenced_vertices", facts.unreferenced_vertices, "vertices belong to no triangle"),
    ];
    let found = several.iter().filter(|(_, n, _)| *n > 0);
    found.map(|(code, n, words)| Warning::new(code, format!("{n} {words}."), "")).collect()
}

/// Tells of triangles that cross others or are folded back on their neighbours; those that cross in words.
fn crossings(mesh: &TriMesh, report: &mut Report) -> String {
    super::meeting_figures(mesh, report);
    let found = |report: &Report, key: &str| report.figure(key).map(|n| count(n as u64));
    for (code, words) in [
        ("folded_back", "pairs of neighbours are folded back on one another"),
        ("self_intersections", "pairs of triangles cross each other"),
    ] {
        if let Some(n) = found(report, &format!("mesh.{code}")).filter(|n| n != "0") {
            report.warnings.push(Warning::new(code, format!("{n} {words}."), ""));
        }
    }
    found(report, key::MESH_SELF_INTERSECTIONS).unwrap_or_else(|| "not looked for: too many triangles".into())
}

/// Counts folds of the grids and surfaces of a model.
fn folds(model: &Model, report: &mut Report) {
    let Ok(patches) = planish::network::imprint(&model.mesh, &model.network, &progress::Interrupt) else { return };
    if model.grids.len() != patches.len() || model.surfaces.len() != patches.len() {
        return;
    }
    let grids: usize = model.grids.iter().zip(&patches).map(|(g, p)| planish::grid::measure(g, p).folds).sum();
    let surfaces: usize = model.surfaces.iter().zip(&model.grids).map(|(s, g)| planish::surface::folds(s, g)).sum();
    for (key, n, words) in [
        (key::GRID_FOLDS, grids, "cells of grids are turned over"),
        (key::SURFACE_FOLDS, surfaces, "places of surfaces are turned over"),
    ] {
        report.quality.insert(key.into(), Figure::Count(n as u64));
        if n > 0 {
            report.warnings.push(Warning::new(&key.replace('.', "_"), format!("{} {words}.", count(n as u64)), ""));
        }
    }
}

/// The unit, and how sure it is.
fn told_units(session: &Session, args: &Info, is_model: bool, report: &Report) -> String {
    let file = &args.files[0];
    let unit = &report.input.units;
    match planish_io::file_units(file) {
        _ if is_model || session.common.units.is_some() => unit.clone(),
        FileUnits::Standard(_) => format!("{unit}, as the format has it"),
        FileUnits::Usual(_) | FileUnits::Unknown => {
            format!("{unit}, assumed: the file does not tell; --units says otherwise")
        }
    }
}

fn mesh_rows(table: &mut Summary, report: &Report, facts: &Diagnosis, shift: DVec3) {
    let unit = report.input.units.as_str();
    let yes = |yes: bool, a: &str, b: &str| if yes { a.to_owned() } else { b.to_owned() };
    let size = facts.bounds.size();
    table.row("file", format!("{}: {}", report.input.path, report.input.kind));
    table.row("triangles", count(facts.triangles as u64));
    table.row("vertices", count(facts.vertices as u64));
    table.row("size", format!("{} x {} x {} {unit}", number(size.x), number(size.y), number(size.z)));
    table.row("from", format!("{} {unit}", contents::corner(facts.bounds.min + shift, facts.diagonal)));
    table.row("to", format!("{} {unit}", contents::corner(facts.bounds.max + shift, facts.diagonal)));
    table.row("diagonal", format!("{} {unit}", number(facts.diagonal)));
    table.row("pieces", count(facts.components as u64));
    table.row(
        "surface",
        format!("{}, {}", yes(facts.watertight, "watertight", "open"), yes(facts.manifold, "manifold", "not manifold")),
    );
    if let Some(genus) = facts.genus {
        table.row("handles", genus.to_string());
    }
    table.row("area", format!("{} {unit}\u{b2}", number(facts.area)));
    if let Some(volume) = facts.volume {
        table.row("volume", format!("{} {unit}\u{b3}", number(volume)));
    }
}

/// What is left to do on a network before all of the mesh is patches.
fn network_faults(model: &Model) -> Vec<Warning> {
    if model.network.curves.is_empty() {
        return Vec::new();
    }
    let found = planish::network::diagnose(&model.mesh, &Adjacency::new(&model.mesh), &model.network);
    found.faults.iter().map(|f| Warning::new("network_unfinished", f.to_string(), "")).collect()
}

fn model_rows(table: &mut Summary, model: &Model) {
    let control: usize = model.surfaces.iter().map(|s| s.control.len()).sum();
    let points: usize = model.grids.iter().map(|g| g.points.len()).sum();
    let texels: usize = model.reliefs.iter().map(|r| r.vectors.len()).sum();
    let (network, sketch) = (&model.network, &model.sketch);
    let [corners, curves] = [network.corners.len(), network.curves.len()].map(|n| count(n as u64));
    table.row("network", format!("{corners} corners, {curves} curves"));
    table.row("patches", count(network.patches.len() as u64));
    if !sketch.features.is_empty() {
        table.row("feature curves", count(sketch.features.len() as u64));
    }
    if let Some(plane) = sketch.symmetry {
        let [p, n] = [plane.point, plane.normal].map(|v| v.to_array().map(|x| format!("{x:.4}")).join(", "));
        table.row("symmetry", format!("plane through ({p}) with normal ({n})"));
    }
    table.row("grid points", count(points as u64));
    table.row("control points", count(control as u64));
    table.row("relief", format!("{} texels", count(texels as u64)));
    let commands: Vec<&str> = model.history.iter().map(|h| h.command.as_str()).collect();
    table.row("history", commands.join(", "));
    if !model.undo.is_empty() || !model.redo.is_empty() {
        table.row("edits", format!("{} to take back, {} to make again", model.undo.len(), model.redo.len()));
    }
}
