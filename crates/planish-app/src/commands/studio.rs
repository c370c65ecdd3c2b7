//! `planish studio`: the page that edits a project, served until Ctrl-C.

use super::Session;
use crate::args::Studio;
use crate::failure::{Failure, Status};
use crate::progress;
use planish_studio::{Options, Place, StudioError, has_page, serve};
use std::io::Write;
use std::process::{Command, Stdio};

pub fn studio(session: &Session, args: &Studio) -> Result<Status, Failure> {
    if let Some(report) = &session.common.report {
        return Err(Failure::usage(report, "the studio writes its report from the page").hint("leave --report out"));
    }
    if let Some(file) = args.file.as_ref().filter(|f| !f.is_file()) {
        return Err(
            Failure::usage(file, "is no file").hint("check the name, or leave it out and drop a file on the page")
        );
    }
    if !has_page() {
        return Err(told(StudioError::NoPage));
    }
    let options = Options {
        file: args.file.clone(),
        folder: std::env::current_dir().map_err(Failure::fault)?,
        host: args.host,
        port: args.port,
        token: args.token.clone(),
        units: session.common.units.map(Into::into),
    };
    let ready = |place: &Place| {
        if !session.common.quiet {
            let _ = writeln!(std::io::stdout(), "studio: {}\nCtrl-C ends it; all work is kept.", place.address);
            let _ = std::io::stdout().flush();
        }
        if !args.no_open {
            open(&place.address);
        }
    };
    serve(options, ready, progress::interrupted).map_err(told)?;
    Ok(Status::Done)
}

/// Opens the browser; where there is none, the address is printed all the same.
fn open(address: &str) {
    let programs: &[(&str, &[&str])] = if cfg!(target_os = "macos") {
        &[("open", &[])]
    } else if cfg!(windows) {
        &[("cmd", &["/C", "start", ""])]
    } else {
        &[("xdg-open", &[]), ("wslview", &[]), ("sensible-browser", &[])]
    };
    for (program, before) in programs {
        let started = Command::new(program)
            .args(*before)
            .arg(address)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        if started.is_ok() {
            return;
        }
    }
}

fn told(error: StudioError) -> Failure {
    let text = error.to_string();
    let (what, hint) = text.split_once(" - hint: ").unwrap_or((&text, ""));
    let failure = Failure::usage("studio", what);
    if hint.is_empty() { failure } else { failure.hint(hint) }
}
