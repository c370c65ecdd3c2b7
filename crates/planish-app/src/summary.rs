//! The one table that a command writes.

use crate::{stdout, words};

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

    /// Writes the table to where tables go. A closed pipe is not an error.
    pub fn print(&self) {
        let width = self.rows.iter().map(|(n, _)| n.chars().count()).max().unwrap_or(0);
        for (name, value) in &self.rows {
            // Thin spaces are for pages; a terminal shows them as nothing.
            let value = words::plain(&words::told(&value.replace('\u{202f}', " ")));
            if !stdout::table_line(&format!("{name:width$}  {value}")) {
                return;
            }
        }
    }
}
