//! `planish layout`: a network to start from.

use super::{Session, missed, write_failure};
use crate::args::Layout;
use crate::failure::{Failure, Status};
use crate::files;
use crate::placed::Placed;
use crate::products::Staged;
use crate::summary::Summary;
use planish::network::CurveKind;
use planish::pipeline::key;
use planish::pipeline::{self, Figure};
use planish_io::report::{Report, count};

pub fn layout(session: &Session, args: &Layout) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["json"])?;
    let staged = Staged::file(&args.output)?;
    let own_report = session.stage_report()?;
    let params = args.layout.params(session.common.seed)?;
    let (placed, read) = session.step("read", || Placed::read(&args.mesh))?;
    let (input, tags, units) = (&placed.mesh, placed.tags.as_ref(), session.units_of(&args.mesh));
    let mut report = Report::new("layout", files::mesh_facts(&args.mesh, input, units));
    let made = pipeline::layout(input, tags, &params, &session.bars)
        .map_err(|e| super::pipeline_failure(&args.mesh, None, e))?;
    let network = &made.network;
    planish_io::write_network(staged.file_path(), network, &made.mesh)
        .map_err(|e| write_failure(&args.mesh, &args.output, e))?;
    report.stages.push(read);
    report.stages.extend(made.stages);
    report.warnings = made.warnings;
    report.warnings.extend(placed.warning(units.symbol()));
    let wanted = (params.patches > 0 && !params.coarsest).then_some(params.patches as u64);
    report.warnings.extend(missed::patches(network, wanted));
    report.quality = made.quality;
    if !session.hand_over([staged], own_report, &report)? {
        return Ok(Status::Done);
    }
    let of_kind = |is: fn(CurveKind) -> bool| network.curves.iter().filter(|c| is(c.kind)).count() as u64;
    let mut table = Summary::default();
    table.row("input", format!("{}: {} triangles", report.input.path, count(input.triangles.len() as u64)));
    table.row("patches", count(network.patches.len() as u64));
    table.row("corners", count(network.corners.len() as u64));
    table.row(
        "curves",
        format!(
            "{} smooth, {} on sharp edges, {} on the boundary",
            count(of_kind(CurveKind::is_smooth)),
            count(of_kind(|kind| kind == CurveKind::Feature)),
            count(of_kind(|kind| kind == CurveKind::Boundary))
        ),
    );
    if let Some(Figure::Count(irregular)) = report.quality.get(key::PATCHES_IRREGULAR_CORNERS) {
        table.row("irregular", format!("{} corners", count(*irregular)));
    }
    table.row("network", args.output.display().to_string());
    table.print();
    Ok(Status::Done)
}
