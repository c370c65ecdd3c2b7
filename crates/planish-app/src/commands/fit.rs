//! `planish fit`: mesh and network to a model.

use super::run::{Job, fitted, summary, verdict};
use super::{Session, commit_report};
use crate::args::Fit;
use crate::failure::{Failure, Status};
use crate::files;
use crate::products::Staged;
use planish_io::Up;

pub fn fit(session: &Session, args: &Fit) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["planish"])?;
    let staged = Staged::file(&args.output)?;
    let own_report = session.stage_report()?;
    let params = args.stages.params(session.common.seed)?;
    let (input, read) = session.step("read", || files::mesh(&args.mesh))?;
    let network = files::optional_network(args.network.as_deref(), &input)?;
    let demanded = args.stages.demanded_tolerance();
    let job = Job {
        command: "fit",
        path: &args.mesh,
        input: &input,
        network: network.zip(args.network.as_deref()),
        params,
        demanded,
        output: &args.output,
        up: Up::default(),
    };
    let (mut report, model) = fitted(session, job, vec![read])?;
    let write = || planish_io::write_model(staged.file_path(), &model).map_err(|e| Failure::usage(&args.output, e));
    let ((), record) = session.step("write", write)?;
    report.stages.push(record);
    staged.commit()?;
    commit_report(own_report, &report)?;
    if !session.common.quiet {
        session.tell_warnings(&report);
        let mut table = summary(&report, demanded);
        table.row("model", args.output.display().to_string());
        table.print();
    }
    Ok(verdict(&report, demanded))
}
