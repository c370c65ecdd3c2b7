//! Where in a file something is wrong.

use std::fmt;

/// A place in a file, counted as its format is read: lines from 1, everything else from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a text file, from 1.
    Line(usize),
    /// Byte of a binary file, from 0.
    Byte(usize),
    /// Vertex, from 0.
    Vertex(usize),
    /// Face, from 0.
    Face(usize),
    /// An item of a list of the format (`accessor 3`), from 0.
    Item(&'static str, usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Line(n) => write!(f, "line {n}"),
            Place::Byte(n) => write!(f, "byte {n}"),
            Place::Vertex(n) => write!(f, "vertex {n}"),
            Place::Face(n) => write!(f, "face {n}"),
            Place::Item(what, n) => write!(f, "{what} {n}"),
        }
    }
}
