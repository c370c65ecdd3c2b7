//! Exit statuses and the one line that a user reads when something is wrong:
//! `error: FILE: what is wrong (where) - hint: what to do`.

use crate::words;
use std::fmt;
use std::io::Write;
use std::path::Path;

/// How the program ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Done.
    Done = 0,
    /// The result was written but misses a tolerance that the user demanded.
    Missed = 1,
    /// Wrong usage: options, or an output that cannot be written.
    Usage = 2,
    /// Unusable input.
    Input = 3,
    /// A fault of the program.
    Fault = 4,
    /// Ended by Ctrl-C; the shell's convention for SIGINT.
    Interrupted = 130,
}

/// A failure that ends the program.
#[derive(Debug)]
pub struct Failure {
    /// The exit status.
    pub status: Status,
    subject: String,
    what: String,
    hint: Option<String>,
}

impl Failure {
    fn new(status: Status, subject: impl fmt::Display, what: impl fmt::Display) -> Failure {
        Failure { status, subject: subject.to_string(), what: what.to_string(), hint: None }
    }

    /// An input that cannot be used.
    pub fn input(file: impl AsRef<Path>, what: impl fmt::Display) -> Failure {
        Failure::new(Status::Input, file.as_ref().display(), what)
    }

    /// An output that cannot be written, or options that do not go together.
    pub fn usage(subject: impl AsRef<Path>, what: impl fmt::Display) -> Failure {
        Failure::new(Status::Usage, subject.as_ref().display(), what)
    }

    /// A fault of the program itself.
    pub fn fault(what: impl fmt::Display) -> Failure {
        Failure::new(Status::Fault, "internal fault", what)
            .hint("this is a defect of planish; please report it with the command line and, if you may, the input")
    }

    /// Ended by the user.
    pub fn interrupted() -> Failure {
        Failure::new(Status::Interrupted, "planish", "interrupted; nothing was written")
    }

    /// Adds what to do.
    pub fn hint(mut self, hint: impl fmt::Display) -> Failure {
        self.hint = Some(hint.to_string());
        self
    }

    /// Writes the line to stderr.
    pub fn print(&self) {
        let _ = writeln!(std::io::stderr(), "{self}");
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let subject = words::told(&self.subject);
        write!(f, "error: {}: {}", words::plain(&subject), words::message(&words::told(&self.what)))?;
        // Library errors may already end in their own way out.
        match &self.hint {
            Some(hint) if !self.what.contains(" - hint: ") => write!(f, " - hint: {}", words::plain(hint)),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_names_file_fault_and_way_out() {
        let line = Failure::input("a.ply", "ends early\n (vertex 7 of 9)").hint("copy it again").to_string();
        assert_eq!(line, "error: a.ply: ends early (vertex 7 of 9) - hint: copy it again");
    }
}
