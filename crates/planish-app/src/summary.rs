//! The one table that a command writes to stdout.

use crate::words;
use std::io::Write;

/// Lines of a name and a value, in the order of adding.
#[derive(Default)]
pub struct Summary {
    rows: Vec<(String, String)>,
}

impl Summary {
    /// Adds a line.
    pub fn row(&mut self, name: impl Into<String>, value: impl Into<String>) -> &mut Summary {
        self.rows.push((name.into(), value.into()));
        self
    }

    /// Writes the table to stdout. A closed pipe is not an error.
    pub fn print(&self) {
        let width = self.rows.iter().map(|(n, _)| n.chars().count()).max().unwrap_or(0);
        let mut out = std::io::stdout().lock();
        for (name, value) in &self.rows {
            // Thin spaces are for pages; a terminal shows them as nothing.
            let value = words::plain(&value.replace('\u{202f}', " "));
            if writeln!(out, "{name:width$}  {value}").is_err() {
                return;
            }
        }
    }
}
