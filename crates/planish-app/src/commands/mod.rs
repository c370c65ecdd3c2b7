//! One file per command, and what they share.

mod batch;
mod clean;
mod compare;
mod demo;
mod edit;
mod export;
mod fit;
mod info;
mod layout;
mod manual;
mod mesh;
mod missed;
mod relief;
mod run;
mod studio;
mod transform;

use crate::args::{Cli, Command, Common};
use crate::check;
use crate::failure::{Failure, Status};
use crate::files;
use crate::outputs;
use crate::products::{self, Staged};
use crate::progress::{self, Bars};
use crate::stdout::{self, Carries};
use crate::streams;
use crate::words;
pub use crate::words::with_hint;
pub use batch::folder_names;
use planish::grid::Grid;
use planish::mesh::{Adjacency, Diagnosis, TriMesh, folded_back, self_intersections};
use planish::model::{Model, Units};
use planish::observe::{Cancelled, Observer};
use planish::pipeline::key;
use planish::pipeline::{Figure, PipelineError, Quality, StageRecord, Warning};
use planish::relief::{Relief, ReliefError};
use planish::surface::Surface;
use planish_io::report::{Report, number};
use planish_io::{FileUnits, WriteError};
use std::ffi::OsString;
use std::io::Write;
use std::path::Path;

/// Runs the command.
/// * `program` - how this program is started anew
/// # Errors
/// What the user is to be told.
pub fn run(cli: Cli, program: &[OsString]) -> Result<Status, Failure> {
    progress::watch_interrupts();
    let mut command = cli.command;
    if command.common().is_some_and(|common| common.json) {
        stdout::carry(Carries::Json)?;
    }
    if command.common().is_some_and(|common| common.tied) {
        progress::watch_input();
    }
    check::check(&command)?;
    let streams = streams::open(&mut command)?;
    outputs::check(&command)?;
    let status = carry_out(command, program)?;
    streams.close()?;
    Ok(status)
}

fn carry_out(command: Command, program: &[OsString]) -> Result<Status, Failure> {
    match command {
        Command::Demo(args) => demo::demo(&Session::new(&args.common)?, &args),
        Command::Run(args) if args.is_batch() => batch::run(&Session::new(&args.common)?, &args, program),
        Command::Run(args) => run::run(&Session::new(&args.common)?, &args),
        Command::Clean(args) => clean::clean(&Session::new(&args.common)?, &args),
        Command::Mesh(args) => mesh::mesh(&Session::new(&args.common)?, &args),
        Command::Smooth(args) => mesh::smooth(&Session::new(&args.common)?, &args),
        Command::Decimate(args) => mesh::decimate(&Session::new(&args.common)?, &args),
        Command::Layout(args) => layout::layout(&Session::new(&args.common)?, &args),
        Command::Fit(args) => fit::fit(&Session::new(&args.common)?, &args),
        Command::Edit(args) => edit::edit(&Session::new(&args.common)?, &args),
        Command::Deform(args) => relief::deform(&Session::new(&args.common)?, &args),
        Command::Relief(args) => relief::relief(&args),
        Command::Export(args) => export::export(&Session::new(&args.common)?, &args),
        Command::Compare(args) => compare::compare(&Session::new(&args.common)?, &args),
        Command::Transform(args) => transform::transform(&Session::new(&args.common)?, &args),
        Command::Info(args) if info::is_several(&args) => info::several(&Session::new(&args.common)?, args),
        Command::Info(args) => info::info(&Session::new(&args.common)?, &args),
        Command::Studio(args) => studio::studio(&Session::new(&args.common)?, &args),
        Command::Completions(args) => manual::completions(&args),
        Command::Man(args) => manual::man(&args),
    }
}

/// A shape that is smaller than this in millimetres is rather one in metres.
const TINY: f64 = 1.0;
/// Threads for each core of the machine, at most.
const THREADS_PER_CORE: usize = 4;

/// What the common options make of a command.
struct Session {
    common: Common,
    bars: Bars,
}

impl Session {
    fn new(common: &Common) -> Result<Session, Failure> {
        if let Some(report) = &common.report {
            files::check_extension(report, &["json"])?;
        }
        // More threads than that only wait for each other.
        let most = THREADS_PER_CORE * std::thread::available_parallelism().map_or(1, |n| n.get());
        let threads = common.threads.map_or(0, |n| n.get().min(most));
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().map_err(Failure::fault)?;
        Ok(Session { common: common.clone(), bars: Bars::new(common.quiet, common.verbose) })
    }

    /// Units of something made here: the user's, else millimetres.
    fn units(&self) -> Units {
        self.common.units.map_or(Units::default(), Units::from)
    }

    /// Units of an input: the user's, else its format's, else millimetres.
    fn units_of(&self, input: &Path) -> Units {
        match (self.common.units, planish_io::file_units(input)) {
            (Some(units), _) => units.into(),
            (None, FileUnits::Standard(units) | FileUnits::Usual(units)) => units,
            (None, FileUnits::Unknown) => Units::default(),
        }
    }

    /// What to tell of the unit of an input, where it is a guess that may be wrong.
    /// * `diagonal` - of the input's box
    /// * `far` - it has the coordinates of a map
    fn guessed_units(&self, input: &Path, diagonal: f64, far: bool) -> Option<Warning> {
        let text = match (self.common.units, planish_io::file_units(input)) {
            (Some(_), _) | (None, FileUnits::Standard(_)) => return None,
            (None, FileUnits::Usual(units)) => {
                format!(
                    "The file does not tell its unit; {units} is taken, as usual in its format. --units says otherwise."
                )
            }
            (None, FileUnits::Unknown) if far || diagonal < TINY => format!(
                "The file does not tell its unit; mm is taken, which makes it {} mm across{}. If it is in metres, say --units m.",
                number(diagonal),
                if far { ", with the coordinates of a map" } else { "" }
            ),
            _ => return None,
        };
        Some(Warning::new("units_guessed", text, ""))
    }

    /// Where `--report` goes, claimed before the work so that a wrong place is told at once.
    fn stage_report(&self) -> Result<Option<Staged>, Failure> {
        self.common.report.as_deref().map(Staged::file).transpose()
    }

    /// Moves what was written and the report to their places, and tells the warnings. Returns whether a summary is wanted as well.
    fn hand_over(
        &self,
        written: impl IntoIterator<Item = Staged>,
        own_report: Option<Staged>,
        report: &Report,
    ) -> Result<bool, Failure> {
        written.into_iter().try_for_each(Staged::commit)?;
        commit_report(own_report, report)?;
        self.tell_warnings(report);
        Ok(!self.common.quiet)
    }

    /// Writes a model into its staged file, and returns how long that took; `output` is where it goes in the end.
    fn write_model(&self, staged: &Staged, model: &Model, output: &Path) -> Result<StageRecord, Failure> {
        let write = || planish_io::write_model(staged.file_path(), model).map_err(|e| Failure::usage(output, e));
        Ok(self.step("write", write)?.1)
    }

    /// Tells the warnings on stderr.
    fn tell_warnings(&self, report: &Report) {
        if self.common.quiet {
            return;
        }
        for warning in &report.warnings {
            let place = if warning.place.is_empty() { String::new() } else { format!(" ({})", warning.place) };
            let text = words::message(&warning.message.replace('\u{202f}', " "));
            // A step of a script has lines of its own: it stands in the report.
            let try_it =
                if warning.step.starts_with("--") { format!(" - hint: try {}", warning.step) } else { String::new() };
            let text = text.trim_end_matches('.');
            let _ = writeln!(std::io::stderr(), "warning: {text}{}{try_it}", words::plain(&place));
        }
    }

    /// Runs a step that is not a stage of the pipeline, under a bar of its own.
    fn step<T>(
        &self,
        name: &'static str,
        work: impl FnOnce() -> Result<T, Failure>,
    ) -> Result<(T, StageRecord), Failure> {
        self.watched(name, |_| work())
    }

    /// The same with work that looks whether it is still wanted.
    fn watched<T>(
        &self,
        name: &'static str,
        work: impl FnOnce(&dyn Observer) -> Result<T, Failure>,
    ) -> Result<(T, StageRecord), Failure> {
        let (result, record) = self.bars.step(name, work);
        if progress::interrupted() {
            return Err(Failure::interrupted());
        }
        Ok((result?, record))
    }
}

/// Writes the displacement maps of a model into `folder`, and tells how near they bring the surfaces to the grids again when
/// they are read back.
fn write_relief(folder: &Path, model: &Model, quality: &mut Quality) -> Result<(), WriteError> {
    planish_io::write_relief(folder, &model.reliefs, model.units)?;
    let edited = displaced_grids(model).map_err(|e| WriteError::Image(e.to_string()))?;
    let read = planish_io::relief_roundtrip(folder, &model.surfaces, edited.as_ref().unwrap_or(&model.grids));
    let away = read.map_err(|e| WriteError::Image(format!("the maps do not read back: {e}")))?;
    let diagonal = model.mesh.bounds().diagonal();
    quality.insert(key::RELIEF_ROUNDTRIP_MAX.into(), Figure::Number(away));
    quality.insert(key::RELIEF_ROUNDTRIP_MAX_REL.into(), Figure::Number(away / diagonal));
    Ok(())
}

/// The nodes that an edited relief leads to; none for one that leads to the grids.
fn displaced_grids(model: &Model) -> Result<Option<Vec<Grid>>, ReliefError> {
    if model.layers.stack.is_empty() {
        return Ok(None);
    }
    let one = |(s, r): (&Surface, &Relief)| {
        Ok(Grid { rows: r.rows, cols: r.cols, points: planish::relief::displace(s, r)?, places: Vec::new() })
    };
    model.surfaces.iter().zip(&model.reliefs).map(one).collect::<Result<_, _>>().map(Some)
}

/// What a mesh is as a whole: closed and manifold or not, its area, its volume and genus where it has them.
fn mesh_figures(facts: &Diagnosis, report: &mut Report) {
    report.quality.insert(key::MESH_WATERTIGHT.into(), Figure::Flag(facts.watertight));
    report.quality.insert(key::MESH_MANIFOLD.into(), Figure::Flag(facts.manifold));
    report.quality.insert(key::MESH_AREA.into(), Figure::Number(facts.area));
    if let Some(volume) = facts.volume {
        report.quality.insert(key::MESH_VOLUME.into(), Figure::Number(volume));
    }
    if let Some(genus) = facts.genus {
        report.quality.insert(key::MESH_GENUS.into(), Figure::Number(genus as f64));
    }
}

/// Above so many triangles crossings are not looked for: an answer is to come soon.
const MOST_LOOKED_AT: usize = 2_000_000;

/// Counts triangles that cross others, where there are not too many, and those that are folded back on their neighbours.
fn meeting_figures(mesh: &TriMesh, report: &mut Report) {
    let folded = folded_back(mesh, &Adjacency::new(mesh)).len();
    report.quality.insert(key::MESH_FOLDED_BACK.into(), Figure::Count(folded as u64));
    if mesh.triangles.len() <= MOST_LOOKED_AT {
        let pairs = self_intersections(mesh).len();
        report.quality.insert(key::MESH_SELF_INTERSECTIONS.into(), Figure::Count(pairs as u64));
    }
}

/// Writes the report into its staged file and moves it to its place; and to standard output, where that was asked for.
fn commit_report(staged: Option<Staged>, report: &Report) -> Result<(), Failure> {
    stdout::report(report);
    let Some(staged) = staged else { return Ok(()) };
    write_text(&staged.file_path(), &report.to_json())?;
    staged.commit()
}

/// Writes a text file.
fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text).map_err(|e| products::unwritable(path, &e))
}

/// What a failed pipeline is to the user: mostly a fault of the input.
fn pipeline_failure(input: &Path, network: Option<&Path>, error: PipelineError) -> Failure {
    match error {
        e if Cancelled::is_cause_of(&e) => Failure::interrupted(),
        // With a network of the user's own, what it causes is told of that file.
        PipelineError::Network(e) if network.is_some() => Failure::input(network.unwrap_or(input), e),
        e @ (PipelineError::Scan(_) | PipelineError::Cloud(_)) => Failure::input(input, with_hint(&e.to_string())),
        e => Failure::input(input, with_hint(&e.to_string())).hint("look for faults with `planish info`"),
    }
}

/// What a failed writer is to the user: a fault of the input, but where the operating system refuses the output.
fn write_failure(input: &Path, output: &Path, error: WriteError) -> Failure {
    match error {
        WriteError::Io(_) | WriteError::Image(_) | WriteError::UnknownExtension { .. } => Failure::usage(output, error),
        WriteError::TooFine(_) => Failure::usage("--max-error", error),
        WriteError::Nothing(_) | WriteError::Value { .. } | WriteError::Inconsistent { .. } => {
            Failure::input(input, error)
        }
    }
}
