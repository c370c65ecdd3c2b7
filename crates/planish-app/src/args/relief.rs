//! `planish relief` and `planish deform`: what the user can say of displacement maps.

use super::examples;
use super::groups::Common;
use super::stages::AllStages;
use crate::options::{StageOptions, StageParams};
use crate::tolerance::Tolerance;
use clap::{Args, Subcommand, ValueEnum};
use planish::relief::Agreement;
use planish::relief::maps::MapParams;
use planish_io::maps::MapFile;
use std::path::PathBuf;

impl StageParams for MapParams {
    const STAGE: &'static str = "maps";
    const HEADING: &'static str = "Maps";
}

/// `planish relief`
#[derive(Args, Debug)]
pub struct Relief {
    #[command(subcommand)]
    pub command: ReliefCommand,
}

/// What is done with the relief of a model.
#[derive(Subcommand, Debug)]
pub enum ReliefCommand {
    /// Model -> a folder of images: displacement, heights or normals, for any renderer
    #[command(after_help = examples::RELIEF_EXPORT)]
    Export(ReliefExport),
    /// Images that were edited elsewhere -> the model, as a layer
    #[command(after_help = examples::RELIEF_IMPORT)]
    Import(ReliefImport),
    /// Model and script -> the model with strokes, stamps, filters ... as layers
    #[command(after_help = examples::RELIEF_EDIT)]
    Edit(ReliefEdit),
    /// Part surface and map at a wavelength: what is longer goes to the surface, what is shorter to the map
    #[command(after_help = examples::RELIEF_PART)]
    Part(ReliefPart),
    /// The same shape on other numbers of control points, with all edits
    #[command(after_help = examples::RELIEF_LEVEL)]
    Level(ReliefLevel),
    /// Detail of another model, or of other patches, onto this model
    #[command(after_help = examples::RELIEF_TRANSFER)]
    Transfer(ReliefTransfer),
}

impl ReliefCommand {
    /// The common options.
    pub fn common(&self) -> &Common {
        match self {
            ReliefCommand::Export(a) => &a.common,
            ReliefCommand::Import(a) => &a.common,
            ReliefCommand::Edit(a) => &a.common,
            ReliefCommand::Part(a) => &a.common,
            ReliefCommand::Level(a) => &a.common,
            ReliefCommand::Transfer(a) => &a.common,
        }
    }
}

/// Kinds of image files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FileWord {
    /// OpenEXR, 32-bit float: exact
    Exr,
    /// OpenEXR, 16-bit float
    #[value(alias = "exr_half")]
    ExrHalf,
    /// PNG, 16 bit; 8 where displacements rounded by --max-error have no more steps
    Png,
    /// TIFF, 16 bit
    Tiff,
}

impl From<FileWord> for MapFile {
    fn from(word: FileWord) -> MapFile {
        match word {
            FileWord::Exr => MapFile::Exr,
            FileWord::ExrHalf => MapFile::ExrHalf,
            FileWord::Png => MapFile::Png,
            FileWord::Tiff => MapFile::Tiff,
        }
    }
}

/// Programs with settings of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PresetWord {
    /// Autodesk Arnold: vectors in tangent space, UDIM, EXR
    Arnold,
    /// Blender: vectors in tangent space, UDIM, EXR
    Blender,
    /// glTF: a normal map in one PNG
    Gltf,
    /// Autodesk Mudbox: vectors in absolute tangent space, UDIM, EXR
    Mudbox,
    /// RenderMan: vectors in object space, UDIM, EXR
    Renderman,
    /// Unreal Engine: heights in one PNG
    Unreal,
    /// USD: heights along the normal, UDIM, EXR, with relief.usda
    Usd,
    /// ZBrush: heights in one TIFF, upside down
    Zbrush,
}

impl PresetWord {
    /// Its name in the table of presets.
    pub fn name(self) -> &'static str {
        match self {
            PresetWord::Arnold => "arnold",
            PresetWord::Blender => "blender",
            PresetWord::Gltf => "gltf",
            PresetWord::Mudbox => "mudbox",
            PresetWord::Renderman => "renderman",
            PresetWord::Unreal => "unreal",
            PresetWord::Usd => "usd",
            PresetWord::Zbrush => "zbrush",
        }
    }
}

/// `planish relief export`
#[derive(Args, Debug)]
pub struct ReliefExport {
    /// The model
    #[arg(value_name = "MODEL.planish")]
    pub model: PathBuf,
    /// Folder for the images and their sidecar relief.json; made if missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Settings for a program: kind, frame, order, file and sheets; other options go before them
    #[arg(long, value_name = "WORD")]
    pub preset: Option<PresetWord>,
    /// Kind of the image files [default: exr]
    #[arg(long, value_name = "WORD")]
    pub file: Option<FileWord>,
    /// Round displacements, by at most so much, so that files get smaller: a length (0.05 in units of the model, 0.05mm) or a
    /// share of the diagonal (0.01%). Smallest with --file png --sheets atlas --gutter 0
    #[arg(long, value_name = "LENGTH|%", allow_negative_numbers = true)]
    pub max_error: Option<Tolerance>,
    /// Also write colours and other vertex attributes of the mesh in the same layout
    #[arg(long)]
    pub attributes: bool,
    /// Also write the base mesh that the maps belong to, with its texture coordinates: base.obj
    #[arg(long)]
    pub base: bool,
    /// Also write relief.mtlx, a MaterialX file that wires the maps
    #[arg(long)]
    pub materialx: bool,
    /// Also write relief.usda, the base mesh in USD with a material that reads the maps
    #[arg(long)]
    pub usd: bool,
    #[command(flatten)]
    pub maps: StageOptions<MapParams>,
    #[command(flatten)]
    pub common: Common,
}

/// What both sides of a seam agree on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SeamWord {
    /// The mean of all patches there
    Average,
    /// The patch of the lowest number
    First,
    /// The patch of the highest number
    Last,
}

impl From<SeamWord> for Agreement {
    fn from(word: SeamWord) -> Agreement {
        match word {
            SeamWord::Average => Agreement::Average,
            SeamWord::First => Agreement::First,
            SeamWord::Last => Agreement::Last,
        }
    }
}

/// `planish relief import`
#[derive(Args, Debug)]
pub struct ReliefImport {
    /// The model that the maps were exported from
    #[arg(value_name = "MODEL.planish")]
    pub model: PathBuf,
    /// Folder with the edited images and relief.json
    #[arg(value_name = "DIR")]
    pub maps: PathBuf,
    /// Where the model goes
    #[arg(short, long, value_name = "MODEL.planish")]
    pub output: PathBuf,
    /// What both sides of a seam get where they were edited differently
    #[arg(long, value_name = "WORD", default_value = "average")]
    pub seams: SeamWord,
    #[command(flatten)]
    pub common: Common,
}

/// `planish relief edit`
#[derive(Args, Debug)]
pub struct ReliefEdit {
    /// The model
    #[arg(value_name = "MODEL.planish")]
    pub model: PathBuf,
    /// The edits, one after the other: `[[step]]` tables, each with an `edit`. docs/guide/relief.md has them all
    #[arg(value_name = "SCRIPT.toml")]
    pub script: PathBuf,
    /// Where the edited model goes
    #[arg(short, long, value_name = "MODEL.planish")]
    pub output: PathBuf,
    /// Also draw the displaced surface with its seams
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
    #[command(flatten)]
    pub common: Common,
}

/// `planish relief part`
#[derive(Args, Debug)]
pub struct ReliefPart {
    /// The model
    #[arg(value_name = "MODEL.planish")]
    pub model: PathBuf,
    /// Where the model goes
    #[arg(short, long, value_name = "MODEL.planish")]
    pub output: PathBuf,
    /// Waves longer than this go to the surface: a length (5 in units of the model, 5mm) or a share of the diagonal (2%)
    #[arg(long, value_name = "LENGTH|%", allow_negative_numbers = true)]
    pub wavelength: Tolerance,
    #[command(flatten)]
    pub common: Common,
}

/// `planish relief level`
#[derive(Args, Debug)]
pub struct ReliefLevel {
    /// The model
    #[arg(value_name = "MODEL.planish")]
    pub model: PathBuf,
    /// Where the model goes
    #[arg(short, long, value_name = "MODEL.planish")]
    pub output: PathBuf,
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub stages: AllStages,
}

/// A patch and where its detail goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The patch.
    pub from: u32,
    /// The patch that gets its detail.
    pub to: u32,
    /// Quarters by which it is turned against the clock.
    pub turns: u32,
}

fn pair(text: &str) -> Result<Pair, String> {
    let parts = || {
        let (from, to) = text.trim().split_once(':')?;
        let (to, turns) = to.split_once('@').unwrap_or((to, "0"));
        let turns = turns.trim().parse().ok().filter(|t| *t < 4)?;
        Some(Pair { from: from.trim().parse().ok()?, to: to.trim().parse().ok()?, turns })
    };
    parts().ok_or_else(|| "two patches are needed, 3:7, and turned by quarters 3:7@1".into())
}

/// `planish relief transfer`
#[derive(Args, Debug)]
pub struct ReliefTransfer {
    /// The model that gets the detail
    #[arg(value_name = "MODEL.planish")]
    pub model: PathBuf,
    /// The model that has it [default: the same]
    #[arg(value_name = "FROM.planish")]
    pub from: Option<PathBuf>,
    /// Where the model goes
    #[arg(short, long, value_name = "MODEL.planish")]
    pub output: PathBuf,
    /// Patches and where their detail goes, instead of the closest points in space: 3:7,3:8@1 puts that of patch 3 on 7, and
    /// on 8 turned by a quarter
    #[arg(long, value_name = "PAIRS", value_parser = pair, value_delimiter = ',')]
    pub pairs: Vec<Pair>,
    /// Places that belong together, for models of a similar, not equal shape: a TOML file with [[pair]] tables of `from` and `to`, or
    /// a CSV file with x, y, z on FROM and x, y, z on MODEL in each line
    #[arg(long, value_name = "PAIRS.toml|PAIRS.csv", conflicts_with = "pairs")]
    pub points: Option<PathBuf>,
    /// Take nothing over from further away than this: a length or a share of the diagonal [default: 2%, with --points 10%]
    #[arg(long, value_name = "LENGTH|%", allow_negative_numbers = true)]
    pub reach: Option<Tolerance>,
    #[command(flatten)]
    pub common: Common,
}

/// `planish deform`
#[derive(Args, Debug)]
pub struct Deform {
    /// The model
    #[arg(value_name = "MODEL.planish")]
    pub model: PathBuf,
    /// Where its control points go: an OBJ or a STEP file with B-spline surfaces of the same network, another model of it, or a list
    /// of `[[move]]` tables
    #[arg(value_name = "SURFACES.obj|SURFACES.step|MODEL.planish|MOVES.toml")]
    pub to: PathBuf,
    /// Where the deformed model goes
    #[arg(short, long, value_name = "MODEL.planish")]
    pub output: PathBuf,
    #[command(flatten)]
    pub common: Common,
}
