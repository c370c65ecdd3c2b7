//! `planish completions` and `planish man`: from the definitions that the parser itself has.

use super::write_text;
use crate::args::{Cli, Completions, Man, Shell};
use crate::failure::{Failure, Status};
use crate::products::{self, Staged};
use clap::CommandFactory;
use clap_complete::{Generator, shells};
use clap_mangen::Man as Page;
use std::io::{self, Write};
use std::path::Path;

/// Words that a shell completes.
pub fn completions(args: &Completions) -> Result<Status, Failure> {
    let text = match args.shell {
        Shell::Bash => generated(shells::Bash),
        Shell::Zsh => generated(shells::Zsh),
        Shell::Fish => generated(shells::Fish),
        Shell::Powershell => generated(shells::PowerShell),
    };
    to_stdout(&text)
}

fn generated(shell: impl Generator) -> Vec<u8> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "planish", &mut text);
    text
}

/// A page of the manual, or all of them into a folder.
pub fn man(args: &Man) -> Result<Status, Failure> {
    let mut program = Cli::command().disable_help_subcommand(true);
    program.build();
    if let Some(folder) = &args.output {
        let staged = Staged::folder(folder)?;
        let mut pages = Vec::new();
        collect(&program, &mut pages)?;
        for (name, page) in pages {
            write_text(&staged.path(&format!("{name}.1")), &String::from_utf8_lossy(&page))?;
        }
        staged.commit()?;
        return Ok(Status::Done);
    }
    let mut command = &program;
    for word in &args.command {
        let Some(inner) = command.find_subcommand(word) else {
            let known: Vec<&str> = command.get_subcommands().map(|c| c.get_name()).collect();
            return Err(Failure::usage(word, "is no command").hint(format!("commands are {}", known.join(", "))));
        };
        command = inner;
    }
    to_stdout(&page(command)?)
}

/// The pages of a command and of those below it, each with its name.
fn collect(command: &clap::Command, pages: &mut Vec<(String, Vec<u8>)>) -> Result<(), Failure> {
    pages.push((name(command), page(command)?));
    command.get_subcommands().try_for_each(|inner| collect(inner, pages))
}

/// The name of a command's page: `planish-relief-export`.
fn name(command: &clap::Command) -> String {
    command.get_bin_name().unwrap_or(command.get_name()).replace(' ', "-")
}

fn page(command: &clap::Command) -> Result<Vec<u8>, Failure> {
    let mut text = Vec::new();
    let whole = command.clone().name(name(command));
    Page::new(whole).render(&mut text).map_err(Failure::fault)?;
    Ok(text)
}

/// A closed pipe is no error.
fn to_stdout(text: &[u8]) -> Result<Status, Failure> {
    match io::stdout().lock().write_all(text) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(products::unwritable(Path::new("standard output"), &e)),
        _ => Ok(Status::Done),
    }
}
