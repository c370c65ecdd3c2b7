//! `planish relief part` and `planish relief level`: other surfaces under the same shape.

use super::super::{Session, pipeline_failure};
use super::{finish, folds, open};
use crate::args::AllStages;
use crate::args::relief::{ReliefLevel, ReliefPart};
use crate::failure::{Failure, Status};
use crate::files;
use crate::tolerance::Scale;
use planish::model::{HistoryEntry, Model};
use planish::pipeline::{self, PipelineError, PipelineParams};
use planish::relief::ReliefError;
use planish_io::report::{Report, number};
use std::path::Path;

/// The parameters that the model was made with.
fn stored(path: &Path, model: &Model) -> Result<PipelineParams, Failure> {
    match model.params.as_str() {
        "" => Ok(PipelineParams::default()),
        json => AllStages::stored(json).map_err(|e| Failure::input(path, e).hint("fit it again with `planish fit`")),
    }
}

pub fn part(session: &Session, args: &ReliefPart) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["planish"])?;
    let (mut model, read) = open(session, &args.model)?;
    let scale = Scale { diagonal: model.mesh.bounds().diagonal(), units: model.units };
    let wavelength = args.wavelength.length(scale);
    let params = stored(&args.model, &model)?;
    let mut report = Report::new("relief part", files::model_facts(&args.model, &model, model.units));
    let before = rms(&model);
    let stages = pipeline::part_at(&mut model, wavelength, &params, &session.bars).map_err(|e| match e {
        PipelineError::Relief(ReliefError::Edit { what }) => Failure::usage("--wavelength", what)
            .hint("give a length between what the grids carry and the size of the model; mend folded patches first"),
        e => pipeline_failure(&args.model, None, e),
    })?;
    let parameters = serde_json::json!({ "wavelength": wavelength }).to_string();
    model.history.push(HistoryEntry { command: "relief part".into(), parameters });
    report.stages = std::iter::once(read).chain(stages).collect();
    folds(&model, &mut report, &args.model)?;
    let told = vec![
        ("wavelength".into(), format!("{} {}", number(wavelength), model.units)),
        ("RMS of the relief".into(), format!("{} {}, before {}", number(rms(&model)), model.units, number(before))),
    ];
    finish(session, &args.output, &model, report, told)
}

pub fn level(session: &Session, args: &ReliefLevel) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["planish"])?;
    let (mut model, read) = open(session, &args.model)?;
    let scale = Scale { diagonal: model.mesh.bounds().diagonal(), units: model.units };
    let params = args.stages.params_over(stored(&args.model, &model)?, true, session.common.seed, scale)?;
    args.stages.check_curves(&model.network)?;
    let mut report = Report::new("relief level", files::model_facts(&args.model, &model, model.units));
    let stages =
        pipeline::relevel(&mut model, &params, &session.bars).map_err(|e| pipeline_failure(&args.model, None, e))?;
    model.params = serde_json::to_string(&params).map_err(Failure::fault)?;
    let control: usize = model.surfaces.iter().map(|s| s.control.len()).sum();
    let parameters = serde_json::json!({ "control_points": control }).to_string();
    model.history.push(HistoryEntry { command: "relief level".into(), parameters });
    report.stages = std::iter::once(read).chain(stages).collect();
    folds(&model, &mut report, &args.model)?;
    let told = vec![("control points".into(), planish_io::report::count(control as u64))];
    finish(session, &args.output, &model, report, told)
}

/// Root mean square of the displacements over all texels.
fn rms(model: &Model) -> f64 {
    let all = || model.reliefs.iter().flat_map(|r| &r.vectors);
    (all().map(|d| d.length_squared()).sum::<f64>() / all().count().max(1) as f64).sqrt()
}
