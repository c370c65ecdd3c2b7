//! What standard output carries: a table for people, the report for programs, or a product.

use crate::failure::Failure;
use planish_io::report::Report;
use std::io::Write;
use std::sync::OnceLock;

/// What a command writes to standard output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carries {
    /// A table.
    Table,
    /// A line of JSON for each report.
    Json,
    /// A product; the table goes to standard error.
    Product,
}

static CARRIES: OnceLock<Carries> = OnceLock::new();

/// Decides it, once for the process.
/// # Errors
/// If it is to carry two things.
pub fn carry(what: Carries) -> Result<(), Failure> {
    if *CARRIES.get_or_init(|| what) == what {
        return Ok(());
    }
    Err(Failure::usage("--json", "and a product on standard output exclude each other")
        .hint("write the report to a file with --report"))
}

/// What was decided.
pub fn carries() -> Carries {
    CARRIES.get().copied().unwrap_or(Carries::Table)
}

/// Writes a line of a table to where tables go. False where nobody reads it any more.
pub fn table_line(line: &str) -> bool {
    match carries() {
        Carries::Table => writeln!(std::io::stdout().lock(), "{line}").is_ok(),
        Carries::Product => writeln!(std::io::stderr().lock(), "{line}").is_ok(),
        Carries::Json => false,
    }
}

/// Writes a line of JSON, if that is what standard output carries. A closed pipe is no error.
pub fn json_line(value: &serde_json::Value) {
    if carries() == Carries::Json {
        let _ = writeln!(std::io::stdout().lock(), "{value}");
    }
}

/// Writes a report, if that is what standard output carries.
pub fn report(report: &Report) {
    if carries() == Carries::Json {
        let value = serde_json::from_str(&report.to_json()).unwrap_or_default();
        json_line(&value);
    }
}
