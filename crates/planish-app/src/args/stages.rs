//! Options of the stages after the mesh, and where each parameter struct has its place in the help.

use super::groups::unknown_curves;
use crate::failure::Failure;
use crate::options::{StageOptions, StageParams, check_stored};
use crate::tolerance::{Scale, Tolerance};
use clap::Args;
use planish::Units;
use planish::cloud::{CleanParams, ProjectParams};
use planish::contour::ContourParams;
use planish::field;
use planish::grid::GridParams;
use planish::layout::LayoutParams;
use planish::mend::MendParams;
use planish::mesh::{DecimateParams, SmoothParams};
use planish::network::Network;
use planish::pipeline::{PipelineParams, RunParams, ScanParams};
use planish::surface::{FitParams, Resolution, StitchParams};
use planish::synthetic::ScannerParams;

/// Options of all stages.
#[derive(Args, Clone, Debug)]
pub struct AllStages {
    #[command(flatten)]
    mend: StageOptions<MendParams>,
    #[command(flatten)]
    layout: StageOptions<LayoutParams>,
    #[command(flatten)]
    grid: StageOptions<GridParams>,
    #[command(flatten)]
    fit: StageOptions<FitParams>,
    #[command(flatten)]
    stitch: StageOptions<StitchParams>,
}

impl AllStages {
    /// The parameters of all stages: defaults with the given options in place, for an input of unknown size.
    /// # Errors
    /// If a stage refuses a value, or two of them do not go together.
    pub fn params(&self, seed: Option<u64>) -> Result<PipelineParams, Failure> {
        self.params_suiting(PipelineParams::default(), seed, Scale::UNKNOWN)
    }

    /// The parameters for a model that is there already: `stored` with the given options in place.
    /// * `gridded` - it has grids, which are kept
    /// # Errors
    /// If an option is given for a stage that does not run again.
    pub fn params_over(
        &self,
        stored: PipelineParams,
        gridded: bool,
        seed: Option<u64>,
        scale: Scale,
    ) -> Result<PipelineParams, Failure> {
        let idle = self
            .mend
            .first_given()
            .or_else(|| self.layout.first_given())
            .or_else(|| self.grid.first_given().filter(|_| gridded));
        if let Some(flag) = idle {
            let kept = if gridded { "network and grids are" } else { "network is" };
            return Err(Failure::usage(flag, format!("does not go with this model, whose {kept} kept"))
                .hint("fit its mesh: `planish export MODEL.planish --surface mesh -o MESH.ply`"));
        }
        Ok(PipelineParams {
            mend: stored.mend.clone(),
            layout: stored.layout.clone(),
            ..self.params_suiting(stored, seed, scale)?
        })
    }

    /// The parameters of all stages: `suited` with the given options in place.
    /// # Errors
    /// If a stage refuses a value, or two of them do not go together.
    pub fn params_suiting(
        &self,
        suited: PipelineParams,
        seed: Option<u64>,
        scale: Scale,
    ) -> Result<PipelineParams, Failure> {
        let params = PipelineParams {
            mend: self.mend.params_at(suited.mend, seed, scale)?,
            layout: self.layout.params_at(suited.layout, seed, scale)?,
            grid: self.grid.params_at(suited.grid, seed, scale)?,
            fit: self.fit.params_at(suited.fit, seed, scale)?,
            stitch: self.stitch.params_at(suited.stitch, seed, scale)?,
        };
        if let Resolution::Control([a, b]) = params.fit.resolution
            && a.max(b) > params.grid.max_side
        {
            let what =
                format!("{a}x{b} are more control points than the {} grid points of a side", params.grid.max_side);
            return Err(Failure::usage("--control", what).hint("lower it, or raise --max-side"));
        }
        Ok(params)
    }

    /// The parameters of a run: those that suit the input, with the given options in place. That the stages accept these is
    /// known from [`AllStages::params`]: no stage refuses a value for what stands beside it.
    pub fn run_params(&self, scan: ScanParams, seed: Option<u64>, units: Units) -> RunParams<'_> {
        let stages = move |suited: PipelineParams, diagonal: f64| {
            self.params_suiting(suited.clone(), seed, Scale { diagonal, units }).unwrap_or(suited)
        };
        RunParams { scan, stages: Box::new(stages) }
    }

    /// The parameters that a project holds, checked as those of a command are.
    /// # Errors
    /// What is wrong with them.
    pub fn stored(json: &str) -> Result<PipelineParams, String> {
        let params: PipelineParams =
            serde_json::from_str(json).map_err(|e| format!("has parameters of another version ({e})"))?;
        let checked = check_stored(&params.mend)
            .and_then(|()| check_stored(&params.layout))
            .and_then(|()| check_stored(&params.grid))
            .and_then(|()| check_stored(&params.fit))
            .and_then(|()| check_stored(&params.stitch));
        checked.map_err(|e| format!("has parameters that cannot be: {}", e.trim()))?;
        Ok(params)
    }

    /// Refuses a list of counts for each curve where nobody knows the curves.
    /// # Errors
    /// If there is one and `known` is false.
    pub fn check_curves_known(&self, known: bool) -> Result<(), Failure> {
        if known || self.per_curve().is_none() {
            return Ok(());
        }
        Err(unknown_curves("--per-curve"))
    }

    /// Refuses a list of counts for each curve that is not as long as the network has curves.
    /// # Errors
    /// With both numbers.
    pub fn check_curves(&self, network: &Network) -> Result<(), Failure> {
        let curves = network.curves.len();
        match self.per_curve() {
            Some(found) if found != curves => {
                let what = format!("has {found} numbers for the {curves} curves of the network");
                Err(Failure::usage("--per-curve", what).hint("give one number for each curve"))
            }
            _ => Ok(()),
        }
    }

    fn per_curve(&self) -> Option<usize> {
        self.fit.given("resolution", "per_curve")?.as_array().map(Vec::len)
    }

    /// Number of patches that the user asked for, if it is not left to the form.
    pub fn wanted_patches(&self) -> Option<u64> {
        self.layout.asked("patches").filter(|n| *n > 0)
    }

    /// True if no option of any stage is given.
    pub fn none_given(&self) -> bool {
        self.mend.first_given().is_none()
            && self.layout.first_given().is_none()
            && self.grid.first_given().is_none()
            && self.fit.first_given().is_none()
            && self.stitch.first_given().is_none()
    }

    /// The tolerance of the fit, if the user demanded one.
    pub fn demanded_tolerance(&self) -> Option<Tolerance> {
        self.fit.given_tolerance("resolution")
    }

    /// The tolerance of the angle along smooth seams in degrees, if the user demanded one.
    pub fn demanded_angle(&self) -> Option<f64> {
        self.stitch.number("angle_tolerance")
    }
}

impl StageParams for ContourParams {
    const STAGE: &'static str = "contour";
    const HEADING: &'static str = "Extraction";
}

impl StageParams for field::GridParams {
    const STAGE: &'static str = "volume";
    const HEADING: &'static str = "Volumes: how their numbers are read";
}

impl StageParams for SmoothParams {
    const STAGE: &'static str = "smooth";
    const HEADING: &'static str = "Smoothing";
}

impl StageParams for DecimateParams {
    const STAGE: &'static str = "decimate";
    const HEADING: &'static str = "Decimation: one target";
}

impl StageParams for CleanParams {
    const STAGE: &'static str = "clean";
    const HEADING: &'static str = "Samples of a scan";
}

impl StageParams for ScanParams {
    const STAGE: &'static str = "scan";
    const HEADING: &'static str = "Cells";
}

impl StageParams for ScannerParams {
    const STAGE: &'static str = "scanner";
    const HEADING: &'static str = "The synthetic scan; lengths as shares of the diagonal of the part";
}

impl StageParams for ProjectParams {
    const STAGE: &'static str = "points";
    const HEADING: &'static str = "Points that are written";
}

impl StageParams for MendParams {
    const STAGE: &'static str = "mend";
    const HEADING: &'static str = "Borders of open surfaces";
}

impl StageParams for LayoutParams {
    const STAGE: &'static str = "layout";
    const HEADING: &'static str = "Layout: the automatic network";
}

impl StageParams for GridParams {
    const STAGE: &'static str = "grid";
    const HEADING: &'static str = "Grids: patches resampled";

    fn validate(&self) -> Result<(), String> {
        GridParams::validate(self).map_err(|e| e.to_string())
    }
}

impl StageParams for FitParams {
    const STAGE: &'static str = "fit";
    const HEADING: &'static str = "Surfaces: give one of these";
}

impl StageParams for StitchParams {
    const STAGE: &'static str = "stitch";
    const HEADING: &'static str = "Seams between the surfaces";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_of_a_project_are_checked_as_those_of_a_command_are() {
        let usual = serde_json::to_string(&PipelineParams::default()).unwrap();
        assert!(AllStages::stored(&usual).is_ok());
        // As models of earlier versions have it.
        assert!(AllStages::stored(r#"{"stitch":{"stiffness":30.0}}"#).is_ok());
        for (json, words) in [
            (r#"{"grid":{"miss":0.0}}"#, "invalid value '0.0' for '--miss': a number from 0.000001 to 1 is needed"),
            (r#"{"grid":{"min_side":1000,"max_side":10}}"#, "at least 1000 and at most 10 points"),
            (r#"{"layout":{"patches":100001}}"#, "'--patches': a whole number from 0 to 100000 is needed"),
            (r#"{"fit":{"resolution":{"tolerance":-1.0}}}"#, "'--tolerance': a number above 0"),
            (r#"{"fit":{"resolution":{"control":[3,3]}}}"#, "'--control': 2 whole numbers from 4 to 8193"),
            (r#"{"fit":{"colour":1}}"#, "of another version"),
        ] {
            let told = AllStages::stored(json).unwrap_err();
            assert!(told.contains(words), "{json}: {told}");
        }
    }
}
