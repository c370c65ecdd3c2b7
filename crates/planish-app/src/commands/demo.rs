//! `planish demo`: a synthetic part, and everything on it.

use super::Session;
use super::run::{Job, produce};
use crate::args::Demo;
use crate::failure::{Failure, Status};
use crate::products::Staged;
use planish::mesh::shapes;
use planish::pipeline::PipelineParams;
use planish_io::{Up, WriteOptions};
use std::path::Path;

/// Name of the synthetic part among the products.
const PART: &str = "demo.ply";

pub fn demo(session: &Session, args: &Demo) -> Result<Status, Failure> {
    let staged = Staged::folder(&args.output)?;
    let part = shapes::demo(session.common.seed.unwrap_or(0), args.triangles as usize);
    let options = WriteOptions { units: session.units(), up: Up::Z, name: "demo".into() };
    planish_io::write_mesh(staged.path(PART), &part, &options)
        .map_err(|e| Failure::usage(args.output.join(PART), e))?;
    let job = Job {
        command: "demo",
        path: Path::new(PART),
        input: &part,
        tags: None,
        network: None,
        params: PipelineParams::default(),
        demanded: None,
        output: &args.output,
        up: Up::Z,
        scan: None,
    };
    produce(session, job, staged, Vec::new())
}
