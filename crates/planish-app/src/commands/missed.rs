//! What was asked for and not reached: by how much, which limit it met, and the option that moves that limit.

use crate::tolerance::{Scale, Tolerance};
use planish::layout;
use planish::model::{Model, Units};
use planish::network::{CurveKind, Network};
use planish::pipeline::key;
use planish::pipeline::{self, PipelineParams, Warning};
use planish::surface::{Continuity, EXACT_DEG, Measure, SeamQuality, normal_deviation_of};
use planish_io::report::{Report, count, number};

/// A demanded tolerance and what is reached, both as shares of the diagonal of the input.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    pub wanted: f64,
    pub reached: f64,
}

impl Reach {
    /// * `of` - the distance that the tolerance bounds, in every patch
    pub fn new(demanded: Option<Tolerance>, of: Measure, report: &Report, units: Units) -> Option<Reach> {
        let wanted = demanded?.share(Scale { diagonal: report.input.diagonal, units });
        let figure = |key: &str| report.figure(key).unwrap_or(0.0);
        let reached = match of {
            Measure::Rms => figure(key::SURFACE_PATCH_RMS_MAX_REL),
            Measure::P95 => figure(key::SURFACE_PATCH_P95_MAX_REL),
            // Between the points of the grids, too.
            Measure::Max => figure(key::SURFACE_PATCH_MAX_REL).max(figure(key::SURFACE_MAX_REL)),
        };
        Some(Reach { wanted, reached })
    }

    pub fn is_missed(self) -> bool {
        self.reached > self.wanted
    }
}

/// Which limit kept the surfaces from a demanded tolerance.
/// * `diagonal` - of the input, its units
pub fn tolerance(model: &Model, params: &PipelineParams, reach: Option<Reach>, diagonal: f64) -> Option<Warning> {
    let reach = reach.filter(|reach| reach.is_missed())?;
    let (wanted, unit) = (reach.wanted * diagonal, model.units.symbol());
    let of = params.fit.tolerance_of;
    let found = model.surfaces.iter().zip(&model.grids).map(|(s, g)| of.among(&normal_deviation_of(s, g)));
    let found: Vec<f64> = found.collect();
    let over: Vec<usize> = (0..found.len()).filter(|&p| found[p] > wanted).collect();
    let Some(&worst) = over.iter().max_by(|&&a, &&b| found[a].total_cmp(&found[b])) else {
        let text = format!(
            "The surfaces are up to {} {unit} from the mesh between grid points that keep the tolerance of {} {unit}: raise --density.",
            number(reach.reached * diagonal),
            number(wanted)
        );
        return Some(Warning::new("tolerance_missed", text, ""));
    };
    let (surface, grid) = (&model.surfaces[worst], &model.grids[worst]);
    let cells = params.fit.cells_per_span;
    // As many control points as the spans that the grid has room for.
    let most = |points: usize| ((points - 1) as f64 / cells) as usize + 3;
    let is_full = surface.cols >= most(grid.cols) || surface.rows >= most(grid.rows);
    let limit = match is_full {
        true if cells > 1.0 => format!(
            "its {} x {} grid points carry no more control points with --cells-per-span {cells}: lower that, or raise --density",
            grid.cols, grid.rows
        ),
        true => format!("its {} x {} grid points carry no more control points: raise --density", grid.cols, grid.rows),
        false if params.fit.smoothing > 0.0 => format!(
            "its {} x {} control points are held back by --fit-smoothing {}: lower that, or give more with --control",
            surface.cols, surface.rows, params.fit.smoothing
        ),
        false => format!("it has {} x {} control points: give more with --control", surface.cols, surface.rows),
    };
    let text = format!(
        "{} of {} patches miss the tolerance of {} {unit}, patch {worst} by most with {} {unit} {}: {limit}.",
        count(over.len() as u64),
        count(found.len() as u64),
        number(wanted),
        number(found[worst]),
        of.name()
    );
    Some(Warning::new("tolerance_missed", text, format!("patch {worst}")))
}

/// Code of the warning of [`angle`].
pub const ANGLE: &str = "angle_missed";

/// Seams that a warning names with their places.
const NAMED: usize = 8;

/// Which seams miss a demanded tolerance of the angle (degrees), where each bends by most, and the limit that kept them from it.
pub fn angle(model: &Model, seams: &[SeamQuality], params: &PipelineParams, demanded: Option<f64>) -> Option<Warning> {
    let wanted = demanded?;
    let mut over: Vec<(u32, f64)> =
        seams.iter().filter_map(|s| Some((s.curve, s.regular_angle_bound_deg?))).filter(|s| s.1 > wanted).collect();
    over.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let found = over.first()?.1;
    let limit = match params.fit.continuity {
        Continuity::C0 => "--continuity c0 leaves seams as they are: give g1".to_owned(),
        _ => format!(
            "--fit-loss {} is what the fit may lose to it: raise that, or give more control points with --tolerance or --control",
            params.stitch.fit_loss
        ),
    };
    let smooth = seams.iter().filter(|s| s.regular_angle_bound_deg.is_some()).count();
    let text = format!(
        "{} of {} smooth seams miss the angle tolerance of {} degrees with up to {} beside corners of 25 to 150 degrees: {limit}.",
        count(over.len() as u64),
        count(smooth as u64),
        number(wanted),
        number(found)
    );
    let inner = pipeline::inner_angles(model);
    let place = |(curve, angle): &(u32, f64)| {
        let at = inner
            .get(curve)
            .map_or(String::new(), |(_, p)| format!(" at ({}, {}, {})", number(p.x), number(p.y), number(p.z)));
        format!("curve {curve}{at} with {}", number(*angle))
    };
    let mut places: Vec<String> = over.iter().take(NAMED).map(place).collect();
    if over.len() > NAMED {
        places.push(format!("{} more", over.len() - NAMED));
    }
    Some(Warning::new(ANGLE, text, places.join("; ")))
}

/// Which smooth seams are not exact where exact ones are asked for, and where each bends by most.
pub fn inexact(seams: &[SeamQuality], params: &PipelineParams) -> Option<Warning> {
    if params.fit.continuity != Continuity::G1Exact {
        return None;
    }
    let angle = |s: &SeamQuality| Some((s.curve, s.angle_max_deg.max(s.regular_angle_bound_deg?)));
    let smooth: Vec<(u32, f64)> = seams.iter().filter_map(angle).collect();
    let over: Vec<&(u32, f64)> = smooth.iter().filter(|s| s.1 > EXACT_DEG).collect();
    if over.is_empty() {
        return None;
    }
    let text = format!(
        "{} of {} smooth seams are not exact: at edges, at corners where a patch is flat or pointed, and where the surfaces \
         would turn over or leave the mesh; they are as smooth as the fit can afford.",
        count(over.len() as u64),
        count(smooth.len() as u64)
    );
    let mut places: Vec<String> = over.iter().take(NAMED).map(|s| format!("curve {}: {}", s.0, number(s.1))).collect();
    if over.len() > NAMED {
        places.push(format!("{} more", over.len() - NAMED));
    }
    Some(Warning::new("seams_inexact", text, places.join("; ")))
}

/// Why there are more or fewer patches than were asked for, by more than a fifth.
pub fn patches(network: &Network, wanted: Option<u64>) -> Option<Warning> {
    let (wanted, found) = (wanted?, network.patches.len() as u64);
    if layout::count_is_near(found as usize, wanted as usize) {
        return None;
    }
    let sharp = network.curves.iter().filter(|c| c.kind == CurveKind::Feature).count() as u64;
    let reason = if found < wanted {
        "networks along the form have certain numbers only, and a coarse mesh has no room for many: ask for another number, \
         or give a finer mesh"
            .to_owned()
    } else if sharp > found / 4 {
        format!(
            "{} curves follow sharp edges, which bound patches: a greater --sharp-angle-deg or --feature-length leaves edges out",
            count(sharp)
        )
    } else {
        "limbs, tips and handles need patches of their own: draw a coarser network with `planish edit`".to_owned()
    };
    let text = format!("{} patches where {} were asked for: {reason}.", count(found), count(wanted));
    Some(Warning::new("patches_missed", text, ""))
}
