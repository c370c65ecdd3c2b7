//! Groups of options that many commands have.

use crate::failure::Failure;
use clap::{Args, ValueEnum};
use planish::model::Units;
use planish::network::{CurveKind, Network, Seam};
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// Options of every command.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Write the report to FILE.json
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Write the report to stdout as one line of JSON, in place of the table
    #[arg(long)]
    pub json: bool,
    /// Number of threads, at most four for each core; the result does not depend on it [default: one for each core]
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// Seed of everything random
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// What one unit of the input is; carried into every export [default: the file's own, else mm]
    #[arg(long)]
    pub units: Option<UnitsWord>,
    /// Replace files that planish did not write, too
    #[arg(long)]
    pub force: bool,
    /// Replace no file that is there
    #[arg(long, conflicts_with = "force")]
    pub no_clobber: bool,
    /// Allow the output to take the place of the input
    #[arg(long)]
    pub in_place: bool,
    /// Write nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
    /// End as on Ctrl-C when standard input ends: with what has started this program.
    #[arg(long, hide = true)]
    pub tied: bool,
    /// Tell each stage with its time
    #[arg(short, long, conflicts_with = "quiet")]
    pub verbose: bool,
}

/// What may happen to files that are there.
#[derive(Clone, Copy, Debug)]
pub struct Policy {
    /// Replace also what this program did not write.
    pub force: bool,
    /// Replace nothing.
    pub no_clobber: bool,
    /// An output may be the input.
    pub in_place: bool,
}

impl Common {
    /// What may happen to files that are there.
    pub fn policy(&self) -> Policy {
        Policy { force: self.force, no_clobber: self.no_clobber, in_place: self.in_place }
    }
}

/// A unit of length by its symbol.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum UnitsWord {
    /// Millimetres
    Mm,
    /// Centimetres
    Cm,
    /// Metres
    M,
    /// Inches
    In,
}

impl From<UnitsWord> for Units {
    fn from(word: UnitsWord) -> Units {
        match word {
            UnitsWord::Mm => Units::Mm,
            UnitsWord::Cm => Units::Cm,
            UnitsWord::M => Units::M,
            UnitsWord::In => Units::In,
        }
    }
}

/// What standard input is.
#[derive(Args, Clone, Debug, Default)]
pub struct FromArgs {
    /// What standard input is, where the input is `-`: the extension that its file would have [default: told by its
    /// first bytes]
    #[arg(long, value_name = "FORMAT")]
    pub from: Option<String>,
}

/// What standard output is to be.
#[derive(Args, Clone, Debug, Default)]
pub struct ToArgs {
    /// What goes to standard output, where the output is `-`: the extension that its file would have
    #[arg(long, value_name = "FORMAT")]
    pub to: Option<String>,
}

/// That an option names curves, and there is no network to have them.
pub fn unknown_curves(flag: &str) -> Failure {
    Failure::usage(flag, "needs a network: nobody knows the curves of an automatic one beforehand")
        .hint("make one with `planish layout` and give it with --network")
}

/// What single seams are to be.
#[derive(Args, Clone, Debug, Default)]
pub struct SeamArgs {
    /// Curves whose seams are to be smooth, whatever the mesh has there: an edge under one is rounded
    #[arg(long, value_name = "CURVE,...", value_delimiter = ',')]
    smooth_curves: Vec<u32>,
    /// Curves whose seams are to be sharp: both patches keep their own angle there
    #[arg(long, value_name = "CURVE,...", value_delimiter = ',')]
    sharp_curves: Vec<u32>,
}

impl SeamArgs {
    fn asked(&self) -> impl Iterator<Item = (&'static str, Seam, u32)> + '_ {
        let smooth = self.smooth_curves.iter().map(|&curve| ("--smooth-curves", Seam::Smooth, curve));
        smooth.chain(self.sharp_curves.iter().map(|&curve| ("--sharp-curves", Seam::Sharp, curve)))
    }

    /// Checks the numbers of curves against each other.
    /// # Errors
    /// If there are some and nobody knows the curves (`known` is false), or one is to be smooth and sharp.
    pub fn check(&self, known: bool) -> Result<(), Failure> {
        let Some((flag, ..)) = self.asked().next() else { return Ok(()) };
        if !known {
            return Err(unknown_curves(flag));
        }
        match self.smooth_curves.iter().find(|curve| self.sharp_curves.contains(curve)) {
            Some(curve) => {
                let what = format!("has curve {curve}, which --sharp-curves has, too");
                Err(Failure::usage("--smooth-curves", what).hint("leave it out of one of them"))
            }
            None => Ok(()),
        }
    }

    /// Makes the seams of a network what they are to be.
    /// # Errors
    /// If it has no such curve, or one on the boundary.
    pub fn apply(&self, network: &mut Network) -> Result<(), Failure> {
        let curves = network.curves.len();
        for (flag, seam, curve) in self.asked() {
            match network.curves.get_mut(curve as usize) {
                None => {
                    let what = format!("has curve {curve}, and the network has {curves} curves, from 0 on");
                    return Err(Failure::usage(flag, what).hint("report.json has the numbers"));
                }
                Some(found) if found.kind == CurveKind::Boundary => {
                    let what = format!("has curve {curve}, which follows the boundary of the mesh and has no seam");
                    return Err(Failure::usage(flag, what).hint("leave it out"));
                }
                Some(found) => found.kind = seam.into(),
            }
        }
        Ok(())
    }
}

/// How a scan is read.
#[derive(Args, Clone, Debug, Default)]
pub struct ScanArgs {
    /// Columns of a text scan: letters (xyzirgb, n for a normal, _ skips) or names parted by commas
    #[arg(long, value_name = "NAMES")]
    pub columns: Option<String>,
    /// Classes of a LAS scan that are kept, e.g. 2,6
    #[arg(long, value_name = "N", value_delimiter = ',')]
    pub classes: Vec<u8>,
}

/// Holes of a scan.
#[derive(Args, Clone, Debug, Default)]
pub struct HoleArgs {
    /// Leave all holes of a scan open, also those that only noise and shadows made
    #[arg(long, conflicts_with = "close")]
    pub open: bool,
    /// Close all holes of a scan [default: all of a closed shape, the small ones of an open one]
    #[arg(long)]
    pub close: bool,
}

impl HoleArgs {
    /// What the user decided.
    pub fn choice(&self) -> Option<bool> {
        if self.open || self.close { Some(self.close) } else { None }
    }

    /// Refuses the options for an input that is no scan.
    /// # Errors
    /// If one of them is given.
    pub fn refuse(&self, hint: &'static str) -> Result<(), Failure> {
        let Some(close) = self.choice() else { return Ok(()) };
        let flag = if close { "--close" } else { "--open" };
        Err(Failure::usage(flag, "is for holes of a scan, and the input is none").hint(hint))
    }
}
