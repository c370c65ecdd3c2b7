//! `planish demo`: a synthetic part is scanned with all the faults of a scanner, and everything runs on the scan.

use super::Session;
use super::run::{From, Job, Truth, produce};
use crate::args::Demo;
use crate::failure::{Failure, Status};
use crate::products::Staged;
use planish::pipeline::RunParams;
use planish::synthetic::{self, virtual_scan};
use planish_io::{Up, WriteOptions};
use std::path::Path;

/// Names of the scan and of the part that was scanned among the products.
const SCAN: &str = "scan.e57";
const TRUTH: &str = "truth.ply";
/// Triangles of the part: its facets are far below the noise.
const TRIANGLES: usize = 100_000;

pub fn demo(session: &Session, args: &Demo) -> Result<Status, Failure> {
    let staged = Staged::folder(&args.output)?;
    let seed = session.common.seed.unwrap_or(0);
    let (truth, shape) = session.step("shape", || Ok(synthetic::demo(seed, TRIANGLES)))?;
    let scanner = args.scanner.params(Some(seed))?;
    let scan_params = args.meshing.params()?;
    let (made, shot) = session.bars.step("scan", |o| virtual_scan(&truth, &scanner, o));
    if crate::progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let scan = made.map_err(Failure::fault)?;
    let options = WriteOptions { units: session.units(), up: Up::Z, name: "demo".into() };
    let wrong = |name: &str, e: &dyn std::fmt::Display| Failure::usage(args.output.join(name), e);
    planish_io::write_mesh(staged.path(TRUTH), &truth, &options).map_err(|e| wrong(TRUTH, &e))?;
    planish_io::write_scan_in(staged.path(SCAN), &scan.cloud, session.units()).map_err(|e| wrong(SCAN, &e))?;
    let truth = Truth { mesh: &truth, outliers: scan.stray.iter().filter(|&&s| s).count(), noise_rel: scanner.noise };
    let job = Job {
        command: "demo",
        path: Path::new(SCAN),
        network_path: None,
        params: RunParams { scan: scan_params, ..RunParams::default() },
        units: session.units(),
        demanded: None,
        demanded_angle: None,
        wanted_patches: None,
        output: &args.output,
        up: Up::Z,
        truth: Some(truth),
    };
    produce(session, job, From::scan(&scan.cloud), staged, vec![shape, shot])
}
