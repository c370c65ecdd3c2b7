//! What the user can say: commands in the order of the pipeline, and their options.

pub mod examples;
pub mod groups;
pub mod relief;
pub mod stages;
pub mod steps;

pub use groups::{Common, FromArgs, HoleArgs, Policy, ScanArgs, SeamArgs, ToArgs};
pub use stages::AllStages;
pub use steps::{Step, Steps};

use crate::failure::Failure;
use crate::options::StageOptions;
use crate::tolerance::Tolerance;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use planish::DVec3;
use planish::cloud::{CleanParams, ProjectParams};
use planish::contour::ContourParams;
use planish::field;
use planish::geom::Aabb;
use planish::layout::LayoutParams;
use planish::mesh::{DecimateParams, SmoothParams};
use planish::pipeline::ScanParams;
use planish::synthetic::ScannerParams;
use planish_io::Up;
use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// Turns raw scans and dense triangle meshes into smooth B-spline patches with displacement maps.
#[derive(Parser, Debug)]
#[command(name = "planish", version, max_term_width = 110)]
#[command(after_help = "\
The way of the data:
  scan -> samples -> mesh -> repair -> layout -> grids -> surfaces -> seams -> relief -> files
  `run` goes all the way; `layout` stops at the network; `fit` goes on from there; `edit` changes the curves.

Exit status:
  0 done   1 a demanded tolerance is missed (the result is written)   2 wrong usage   3 unusable input
  4 internal fault   130 interrupted

Start with `planish demo`: it needs no input.")]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands, in the order of the pipeline.
#[derive(Subcommand, Debug)]
pub enum Command {
    /// Scan a synthetic part with sharp edges and fine detail, and run everything on the noisy scan
    #[command(after_help = examples::DEMO)]
    Demo(Demo),
    /// Everything: scan or mesh in; surfaces, displacement maps and a report out
    #[command(after_help = examples::RUN)]
    Run(Run),
    /// Scan -> denoised, oriented points with outliers and features flagged
    #[command(after_help = examples::CLEAN)]
    Clean(Clean),
    /// Scan, mesh, solid script, milling job or volume -> a closed mesh with sharp edges
    #[command(after_help = examples::MESH)]
    Mesh(Mesh),
    /// Take noise off a mesh; sharp edges stay
    #[command(after_help = examples::SMOOTH)]
    Smooth(Smooth),
    /// Make a mesh of fewer triangles; sharp edges stay
    #[command(after_help = examples::DECIMATE)]
    Decimate(Decimate),
    /// Mesh -> a network of four-sided patches to start from
    #[command(after_help = examples::LAYOUT)]
    Layout(Layout),
    /// Mesh and network -> grids, surfaces, seams and relief in one model file
    #[command(after_help = examples::FIT)]
    Fit(Fit),
    /// Model and script -> the model with curves, corners and feature curves edited
    #[command(after_help = examples::EDIT)]
    Edit(Edit),
    /// Control points moved or loaded; the relief goes along
    #[command(after_help = examples::DEFORM)]
    Deform(relief::Deform),
    /// Displacement maps: export, import, edit, part, level, transfer
    Relief(relief::Relief),
    /// Model -> STEP, IGES, USD, mesh, network or displacement maps; the format comes from the extension
    #[command(after_help = examples::EXPORT)]
    Export(Export),
    /// Distances between any two scans, meshes or models: signed, in figures, columns and pictures
    #[command(after_help = examples::COMPARE)]
    Compare(Compare),
    /// Move, turn, scale, mirror or crop a mesh or a scan, or fit it on another
    #[command(after_help = examples::TRANSFORM)]
    Transform(Transform),
    /// What is in a file, and what is wrong with it
    #[command(after_help = examples::INFO)]
    Info(Info),
    /// Draw patches on a scan or a mesh in the browser, and watch the surface follow
    #[command(after_help = examples::STUDIO)]
    Studio(Studio),
    /// Words that a shell completes after `planish`
    #[command(after_help = examples::COMPLETIONS)]
    Completions(Completions),
    /// Pages of the manual
    #[command(after_help = examples::MAN)]
    Man(Man),
}

impl Cli {
    /// Reads a command line, the program's name first.
    /// # Errors
    /// What clap says; help and version are errors, too.
    pub fn read(args: impl IntoIterator<Item = OsString>) -> Result<Cli, clap::Error> {
        let mut program = Cli::command();
        let matches = program.try_get_matches_from_mut(args)?;
        let mut cli = Cli::from_arg_matches(&matches).map_err(|e| e.format(&mut program))?;
        if let (Command::Run(run), Some((name, matches))) = (&mut cli.command, matches.subcommand()) {
            run.given = given(program.find_subcommand(name), matches);
        }
        Ok(cli)
    }
}

/// The options that were given, as they are written on the command line, in the order of the help.
fn given(command: Option<&clap::Command>, matches: &ArgMatches) -> Vec<OsString> {
    let mut all = Vec::new();
    for arg in command.into_iter().flat_map(|c| c.get_arguments()) {
        let (id, Some(long)) = (arg.get_id().as_str(), arg.get_long()) else { continue };
        if matches.value_source(id) != Some(ValueSource::CommandLine) {
            continue;
        }
        let flag = format!("--{long}");
        if !arg.get_action().takes_values() {
            all.push(flag.into());
            continue;
        }
        for value in matches.get_raw(id).into_iter().flatten() {
            let mut text = OsString::from(format!("{flag}="));
            text.push(value);
            all.push(text);
        }
    }
    all
}

impl Command {
    /// The options that all commands have which read or write something.
    pub fn common(&self) -> Option<&Common> {
        Some(match self {
            Command::Demo(a) => &a.common,
            Command::Run(a) => &a.common,
            Command::Clean(a) => &a.common,
            Command::Mesh(a) => &a.common,
            Command::Smooth(a) => &a.common,
            Command::Decimate(a) => &a.common,
            Command::Layout(a) => &a.common,
            Command::Fit(a) => &a.common,
            Command::Edit(a) => &a.common,
            Command::Deform(a) => &a.common,
            Command::Relief(a) => a.command.common(),
            Command::Export(a) => &a.common,
            Command::Compare(a) => &a.common,
            Command::Transform(a) => &a.common,
            Command::Info(a) => &a.common,
            Command::Studio(a) => &a.common,
            Command::Completions(_) | Command::Man(_) => return None,
        })
    }
}

/// `planish completions`
#[derive(Args, Debug)]
pub struct Completions {
    /// The shell
    pub shell: Shell,
}

/// Shells that complete words.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Shell {
    /// GNU Bash
    Bash,
    /// The Z shell
    Zsh,
    /// The friendly interactive shell
    Fish,
    /// PowerShell
    Powershell,
}

/// `planish man`
#[derive(Args, Debug)]
pub struct Man {
    /// The command, such as `run` or `relief export` [default: the program itself]
    pub command: Vec<String>,
    /// Folder for the pages of all commands; made if missing
    #[arg(short, long, value_name = "DIR", conflicts_with = "command")]
    pub output: Option<PathBuf>,
}

/// An axis that points up.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum UpWord {
    /// Y, as in most animation programs
    Y,
    /// Z, as in most CAD programs and scanners
    Z,
}

impl From<UpWord> for Up {
    fn from(word: UpWord) -> Up {
        match word {
            UpWord::Y => Up::Y,
            UpWord::Z => Up::Z,
        }
    }
}

/// `planish demo`
#[derive(Args, Debug)]
pub struct Demo {
    /// Folder for the products; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "planish-demo")]
    pub output: PathBuf,
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub scanner: StageOptions<ScannerParams>,
    #[command(flatten)]
    pub meshing: MeshingArgs,
}

/// `planish run`
#[derive(Args, Debug)]
pub struct Run {
    /// A mesh (PLY, OBJ, STL, GLB, glTF, STEP) or a scan (E57, LAS, LAZ, PLY without faces, PCD, XYZ, TXT, CSV, ASC, PTS,
    /// NPY, NPZ, CONF); `-` is standard input. Several files, or a pattern such as 'scans/*.e57', get a folder each below DIR, with
    /// a table and a report of all
    #[arg(required = true, value_name = "INPUT")]
    pub inputs: Vec<PathBuf>,
    /// Folder for the products; made if missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Of several inputs, so many at once; a single one gets a folder below DIR, too. What an earlier run has finished is left
    /// out, as far as content, options and version are the same
    #[arg(long, value_name = "N")]
    pub jobs: Option<NonZeroUsize>,
    /// Name of the folder below DIR, for the only input: one of a batch that another program has parted.
    #[arg(long, hide = true, value_name = "DIR", requires = "jobs")]
    pub folder: Option<String>,
    #[command(flatten)]
    pub from: FromArgs,
    /// The options as they were given, for the runs of a batch.
    #[arg(skip)]
    pub given: Vec<OsString>,
    #[command(flatten)]
    pub scan: ScanArgs,
    /// Network to use instead of an automatic one
    #[arg(long, value_name = "NETWORK.json")]
    pub network: Option<PathBuf>,
    #[command(flatten)]
    pub seams: SeamArgs,
    /// Axis of the input that points up, for pictures and GLB
    #[arg(long, value_name = "AXIS", default_value = "y")]
    pub up: UpWord,
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub stages: AllStages,
    #[command(flatten)]
    pub meshing: MeshingArgs,
    #[command(flatten)]
    pub points: StageOptions<ProjectParams>,
}

impl Run {
    /// True if a folder for each input is meant.
    pub fn is_batch(&self) -> bool {
        self.inputs.len() > 1 || self.jobs.is_some() || self.inputs.iter().any(|path| is_pattern(path))
    }
}

/// True for what is no file by itself and has a letter of a pattern: `*`, `?` or `[`. Shells that expand patterns leave none.
pub fn is_pattern(path: &Path) -> bool {
    path.to_str().is_some_and(|text| text.contains(['*', '?', '['])) && !path.exists()
}

/// `planish clean`
#[derive(Args, Debug)]
pub struct Clean {
    /// The scan: E57, LAS, LAZ, PLY, PCD, XYZ, TXT, CSV, ASC, PTS, NPY, NPZ or CONF
    pub scan: PathBuf,
    /// The points: .ply or .xyz (all columns), .las, .laz or .e57; `-` is standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    #[command(flatten)]
    pub from: FromArgs,
    #[command(flatten)]
    pub to: ToArgs,
    /// Also write each segment into a file of its own beside the output
    #[arg(long)]
    pub segment: bool,
    /// Also write sharp lines as polylines
    #[arg(long, value_name = "FILE.obj")]
    pub lines: Option<PathBuf>,
    #[command(flatten)]
    pub options: ScanArgs,
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub clean: StageOptions<CleanParams>,
    #[command(flatten)]
    pub project: StageOptions<ProjectParams>,
}

/// `planish mesh`
#[derive(Args, Debug)]
pub struct Mesh {
    /// A scan (see `clean`); a mesh (PLY, OBJ, STL, GLB, glTF, STEP), also one with holes and intersections; a script of
    /// solids or a milling job (.toml); a volume (.nrrd, .npy); or with --formula a formula. `-` is standard input
    pub input: PathBuf,
    /// The mesh: .ply (with feature tags), .obj, .stl or .glb; or the field itself as a volume, .nrrd or .npy: distances below
    /// zero inside. `-` is standard output. With --tiles a folder
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Write the mesh in tiles: a PLY for each cube of this side, a length (5, 5m) or a share of the diagonal (10%), into the
    /// folder -o, with a list, tiles.json
    #[arg(long, value_name = "LENGTH|%", conflicts_with = "to")]
    pub tiles: Option<Tolerance>,
    /// The input is a formula of x, y and z, negative inside, such as 'x^2 + y^2 - 1'
    #[arg(long, requires = "bounds")]
    pub formula: bool,
    /// Where the body of a formula ends: x0,y0,z0,x1,y1,z1, or two numbers for all axes
    #[arg(long, value_name = "FROM,TO", requires = "formula", allow_negative_numbers = true, value_parser = bounds)]
    pub bounds: Option<Aabb>,
    #[command(flatten)]
    pub from: FromArgs,
    #[command(flatten)]
    pub to: ToArgs,
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub meshing: MeshingArgs,
    #[command(flatten)]
    pub volume: StageOptions<field::GridParams>,
    #[command(flatten)]
    pub scan: ScanArgs,
}

/// How a scan becomes a mesh.
#[derive(Args, Clone, Debug)]
pub struct MeshingArgs {
    #[command(flatten)]
    scan: StageOptions<ScanParams>,
    #[command(flatten)]
    clean: StageOptions<CleanParams>,
    #[command(flatten)]
    contour: StageOptions<ContourParams>,
    #[command(flatten)]
    pub holes: HoleArgs,
    /// Memory that may be used, GB [default: three quarters of the machine's]
    #[arg(long, value_name = "GB", value_parser = positive)]
    memory: Option<f64>,
}

impl MeshingArgs {
    /// The parameters, with the given options in place.
    /// # Errors
    /// If a stage refuses a value.
    pub fn params(&self) -> Result<ScanParams, Failure> {
        let memory = self.memory.map_or_else(default_memory, |gb| (gb * (1u64 << 30) as f64) as u64);
        Ok(ScanParams {
            clean: self.clean.params(None)?,
            contour: self.contour.params(None)?,
            close: self.holes.choice(),
            memory,
            ..self.scan.params(None)?
        })
    }

    /// Refuses options of scans for an input that is none.
    /// # Errors
    /// If one of them is given.
    pub fn refuse(&self, hint: &'static str) -> Result<(), Failure> {
        let first = self.scan.first_given().or_else(|| self.clean.first_given()).or_else(|| self.contour.first_given());
        match first {
            Some(flag) => Err(Failure::usage(flag, "is for scans, and the input is none").hint(hint)),
            None => self.holes.refuse(hint),
        }
    }

    /// Refuses what only scans have: cleaning, and holes.
    /// # Errors
    /// If one of them is given.
    pub fn refuse_cleaning(&self, hint: &'static str) -> Result<(), Failure> {
        match self.clean.first_given() {
            Some(flag) => Err(Failure::usage(flag, "is for scans, and the input is none").hint("leave it out")),
            None => self.holes.refuse(hint),
        }
    }
}

/// Share of the machine's memory that may be used unless the user says.
const MEMORY_SHARE: f64 = 0.75;
/// What a machine has if nobody knows.
const MEMORY_GUESS: u64 = 8 << 30;

pub fn default_memory() -> u64 {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let total =
        text.lines().find_map(|l| l.strip_prefix("MemTotal:")?.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
    (total.map_or(MEMORY_GUESS, |kb| kb << 10) as f64 * MEMORY_SHARE) as u64
}

/// `planish smooth`
#[derive(Args, Debug)]
pub struct Smooth {
    /// The mesh: PLY (feature tags are respected), OBJ, STL, GLB or glTF
    pub mesh: PathBuf,
    /// The smoothed mesh: .ply, .obj, .stl or .glb; `-` is standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    #[command(flatten)]
    pub from: FromArgs,
    #[command(flatten)]
    pub to: ToArgs,
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub smooth: StageOptions<SmoothParams>,
}

/// `planish decimate`
#[derive(Args, Debug)]
pub struct Decimate {
    /// The mesh: PLY (feature tags are respected), OBJ, STL, GLB or glTF
    pub mesh: PathBuf,
    /// The decimated mesh: .ply, .obj, .stl or .glb; `-` is standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    #[command(flatten)]
    pub from: FromArgs,
    #[command(flatten)]
    pub to: ToArgs,
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub decimate: StageOptions<DecimateParams>,
}

/// `planish layout`
#[derive(Args, Debug)]
pub struct Layout {
    /// The mesh: PLY, OBJ, STL, GLB, glTF or STEP
    pub mesh: PathBuf,
    /// The network; `-` is standard output
    #[arg(short, long, value_name = "NETWORK.json")]
    pub output: PathBuf,
    #[command(flatten)]
    pub from: FromArgs,
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub layout: StageOptions<LayoutParams>,
}

/// `planish fit`
#[derive(Args, Debug)]
pub struct Fit {
    /// The mesh: PLY, OBJ, STL, GLB, glTF or STEP; or a model, whose network and grids are kept (one without grids gets them):
    /// only its surfaces, seams and relief are made anew, with its own parameters where no option says otherwise
    #[arg(value_name = "MESH|MODEL.planish")]
    pub input: PathBuf,
    /// Network on the mesh [default: an automatic one]
    #[arg(long, value_name = "NETWORK.json")]
    pub network: Option<PathBuf>,
    #[command(flatten)]
    pub seams: SeamArgs,
    /// The model; `-` is standard output
    #[arg(short, long, value_name = "MODEL.planish")]
    pub output: PathBuf,
    #[command(flatten)]
    pub from: FromArgs,
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub stages: AllStages,
}

/// `planish edit`
#[derive(Args, Debug)]
pub struct Edit {
    /// The model; or a mesh, to draw a network from nothing
    #[arg(value_name = "MODEL.planish|MESH")]
    pub input: PathBuf,
    /// The edits, one after the other: `[[step]]` tables, each with an `edit`. docs/guide/edit.md has them all
    #[arg(value_name = "SCRIPT.toml")]
    pub script: PathBuf,
    /// Where the edited model goes [default: over the input, if that is a model]
    #[arg(short, long, value_name = "MODEL.planish")]
    pub output: Option<PathBuf>,
    /// Leave surfaces away even if the network is finished: `planish fit` makes them later
    #[arg(long)]
    pub no_fit: bool,
    /// Folder for a picture after every edit; made if missing
    #[arg(long, value_name = "DIR")]
    pub pictures: Option<PathBuf>,
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub stages: AllStages,
}

/// `planish export`
#[derive(Args, Debug)]
pub struct Export {
    /// The model
    #[arg(value_name = "MODEL.planish")]
    pub model: PathBuf,
    /// Where to: .step, .stp, .igs or .iges (surfaces), .usda (surfaces and a mesh), .ply, .obj, .stl or .glb (a mesh),
    /// .json (the network), or a folder (displacement maps); `-` is standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    #[command(flatten)]
    pub from: FromArgs,
    #[command(flatten)]
    pub to: ToArgs,
    /// Which surface a mesh format gets, and the mesh of USD
    #[arg(long, value_name = "WORD", default_value = "displaced")]
    pub surface: ExportWord,
    /// Axis of the model that points up; GLB is turned accordingly, USD told
    #[arg(long, value_name = "AXIS", default_value = "y")]
    pub up: UpWord,
    #[command(flatten)]
    pub common: Common,
}

/// Which surface of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SurfaceWord {
    /// The smooth surfaces with their displacement: all detail
    Displaced,
    /// The smooth surfaces alone
    Base,
    /// The mesh that the model was fitted to
    Mesh,
}

/// Which surface of a model is exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ExportWord {
    /// The smooth surfaces with their displacement: all detail
    Displaced,
    /// The smooth surfaces alone
    Base,
    /// The mesh that the model was fitted to
    Mesh,
    /// The smooth surfaces as B-splines, without triangles: in OBJ
    Spline,
}

/// `planish compare`
#[derive(Args, Debug)]
pub struct Compare {
    /// A scan, a mesh or a model: what is judged
    pub a: PathBuf,
    /// A scan, a mesh or a model: what it should be like. `-` is standard input, for one of both
    pub b: PathBuf,
    #[command(flatten)]
    pub from: FromArgs,
    /// A with its distance from B in a column for each vertex or point (below zero inside of B), and coloured by it
    #[arg(short, long, value_name = "FILE.ply")]
    pub output: Option<PathBuf>,
    /// Picture of A, coloured by the distance from B
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
    /// Bring A onto B first: the best rigid fit
    #[arg(long)]
    pub align: bool,
    /// Largest distance that is accepted: a length (0.05 in units of A, 0.05mm) or a share of A's diagonal (0.02%);
    /// beyond it the exit status is 1
    #[arg(long, value_name = "LENGTH|%", allow_negative_numbers = true)]
    pub tolerance: Option<Tolerance>,
    /// Share of the distances that must keep the tolerance, percent
    #[arg(long, value_name = "%", default_value = "100", value_parser = percent, requires = "tolerance")]
    pub within: f64,
    /// Which surface of a model is compared
    #[arg(long, value_name = "WORD", default_value = "base")]
    pub surface: SurfaceWord,
    /// Axis of A that points up, for the picture
    #[arg(long, value_name = "AXIS", default_value = "y")]
    pub up: UpWord,
    #[command(flatten)]
    pub scan: ScanArgs,
    #[command(flatten)]
    pub common: Common,
}

/// `planish transform`
#[derive(Args, Debug)]
pub struct Transform {
    /// A mesh or a scan of any format that is read
    pub input: PathBuf,
    /// The same moved: .ply, .obj, .stl or .glb for a mesh; .ply, .xyz, .las, .laz or .e57 for a scan; `-` is standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    #[command(flatten)]
    pub from: FromArgs,
    #[command(flatten)]
    pub to: ToArgs,
    #[command(flatten)]
    pub steps: Steps,
    #[command(flatten)]
    pub scan: ScanArgs,
    #[command(flatten)]
    pub common: Common,
}

/// `planish info`
#[derive(Args, Debug)]
pub struct Info {
    /// Any files that planish reads or writes: scan, mesh, model, volume, script, network, report, STEP, EXR, folder of maps.
    /// `-` is standard input
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    #[command(flatten)]
    pub from: FromArgs,
    #[command(flatten)]
    pub common: Common,
}

/// The box of a formula.
fn bounds(text: &str) -> Result<Aabb, String> {
    let wanted = "two or six numbers parted by commas are needed, the greater ones last";
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse::<f64>()).collect();
    let found = match numbers.map_err(|_| wanted)?[..] {
        [a, b] => Aabb { min: DVec3::splat(a), max: DVec3::splat(b) },
        [a, b, c, d, e, f] => Aabb { min: DVec3::new(a, b, c), max: DVec3::new(d, e, f) },
        _ => return Err(wanted.into()),
    };
    let fine = found.min.is_finite() && found.max.is_finite() && found.min.cmplt(found.max).all();
    if fine { Ok(found) } else { Err(wanted.into()) }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("a number above 0 is needed".into()),
    }
}

fn percent(text: &str) -> Result<f64, String> {
    match text.trim_end_matches('%').parse::<f64>() {
        Ok(x) if x > 0.0 && x <= 100.0 => Ok(x),
        _ => Err("a share above 0 and up to 100 percent is needed".into()),
    }
}

/// `planish studio`
#[derive(Args, Debug)]
pub struct Studio {
    /// A project (.planish), a mesh or a scan; its project file is beside it. Without one the page takes files that are
    /// dropped on it, and their projects are in the current folder
    pub file: Option<PathBuf>,
    /// Port to serve at [default: any that is free]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub port: u16,
    /// Do not open the browser; the address is printed
    #[arg(long)]
    pub no_open: bool,
    /// Interface to serve at: another one than the loopback interface shows project and files to everybody in the network who
    /// has the token, and what is sent can be read on its way
    #[arg(long, value_name = "IP", default_value = "127.0.0.1")]
    pub host: std::net::IpAddr,
    /// A token of your own, 16 letters or digits at least, for --host [default: a random one]
    #[arg(long, value_name = "TOKEN")]
    pub token: Option<String>,
    #[command(flatten)]
    pub common: Common,
}
