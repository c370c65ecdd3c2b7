//! What can be wrong with a file that is read or written, each with its place and a way out.

use crate::Place;
use std::io;

/// Why a mesh could not be read. Shown as `what is wrong (where) - hint: what to do`.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The operating system does not give the file.
    #[error("cannot read it: {0} - hint: check the name and the permissions")]
    Io(#[from] io::Error),
    /// The operating system does not keep what was read of it.
    #[error("its points cannot be kept in {folder}: {error} - hint: make room there, or write the output elsewhere")]
    Kept {
        /// Where they were to lie.
        folder: String,
        /// What it says.
        error: io::Error,
    },
    /// The observer no longer wanted it.
    #[error("cancelled")]
    Cancelled(#[from] planish::observe::Cancelled),
    /// A folder, a pipe or a device.
    #[error("it is {0}, not a file - hint: name a file; save what comes through a pipe in one")]
    NotAFile(&'static str),
    /// No bytes at all.
    #[error("the file is empty (byte 0) - hint: write or download it again")]
    Empty,
    /// The extension names no format that can be read.
    #[error("unknown extension \"{extension}\" - hint: use one of {known}")]
    UnknownExtension {
        /// The extension found, without the dot.
        extension: String,
        /// The extensions that can be read.
        known: String,
    },
    /// The content is of another format than the extension says.
    #[error("the name says {expected} but the content is {found} (byte 0) - hint: {hint}")]
    WrongFormat {
        /// Format of the extension.
        expected: &'static str,
        /// What the first bytes are.
        found: &'static str,
        /// What to do.
        hint: String,
    },
    /// The header breaks the rules of its format.
    #[error("{what} ({place}) - hint: {hint}")]
    Header {
        /// What is wrong.
        what: String,
        /// Where.
        place: Place,
        /// What to do.
        hint: &'static str,
    },
    /// The content breaks the rules of its format.
    #[error("{what} ({place}) - hint: the file is damaged; write it again from its source")]
    Syntax {
        /// What is wrong.
        what: String,
        /// Where.
        place: Place,
    },
    /// The file ends too early, or its header claims more than it holds.
    #[error(
        "{what} needs {needed} bytes but {left} are left ({place}) - hint: the file is cut off or its header is wrong; copy or write it again"
    )]
    Truncated {
        /// What was to be read.
        what: String,
        /// Bytes that it takes at least.
        needed: u64,
        /// Bytes that are left.
        left: u64,
        /// Where it begins.
        place: Place,
    },
    /// A coordinate is not a number, infinite, or too large to compute with.
    #[error(
        "coordinate {value} cannot be computed with ({place}) - hint: remove this vertex in the program that wrote the file"
    )]
    Coordinate {
        /// The coordinate.
        value: f64,
        /// The vertex.
        place: Place,
    },
    /// A face refers to a vertex that is not there.
    #[error(
        "vertex index {index} is outside the {vertices} vertices ({place}) - hint: the file is damaged; write it again from its source"
    )]
    Index {
        /// The index as found.
        index: i64,
        /// Number of vertices.
        vertices: usize,
        /// The face or line.
        place: Place,
    },
    /// A face with fewer than three corners.
    #[error("a face has {corners} corners ({place}) - hint: remove faces with fewer than 3 corners")]
    SmallFace {
        /// Corners of the face.
        corners: usize,
        /// The face or line.
        place: Place,
    },
    /// There is nothing to be a mesh.
    #[error(
        "the file has {vertices} vertices and no triangle with area ({faces} faces) - hint: a mesh is wanted; points without faces are a scan"
    )]
    NoFaces {
        /// Vertices found.
        vertices: usize,
        /// Faces found, all of them without area.
        faces: usize,
    },
    /// There is nothing to be a scan.
    #[error("the file has no points (0 found) - hint: write it again from its source")]
    NoPoints,
    /// More than the 32-bit indices of a mesh can name, or than fits into memory.
    #[error(
        "{count} {what} are more than the {limit} that a mesh can hold ({place}) - hint: split or decimate the file"
    )]
    TooLarge {
        /// What there are too many of.
        what: &'static str,
        /// How many.
        count: u64,
        /// The most there may be.
        limit: u64,
        /// Where.
        place: Place,
    },
    /// The file is right but uses something that is not read.
    #[error("{what} cannot be read ({place}) - hint: {hint}")]
    Unsupported {
        /// What is used.
        what: String,
        /// Where.
        place: Place,
        /// What to do.
        hint: &'static str,
    },
    /// A file that this file refers to cannot be read.
    #[error(
        "the file \"{name}\" that it refers to cannot be read: {source} ({place}) - hint: keep the files of one model in one folder"
    )]
    Companion {
        /// The name as written.
        name: String,
        /// Why.
        source: io::Error,
        /// Where it is named.
        place: Place,
    },
}

/// Why a file could not be written. Shown as `what is wrong (where) - hint: what to do`.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The operating system refuses.
    #[error("cannot write it: {0} - hint: check that the folder exists, is writable and has room")]
    Io(#[from] io::Error),
    /// The extension names no format that can be written.
    #[error("unknown extension \"{extension}\" - hint: use one of {known}")]
    UnknownExtension {
        /// The extension found, without the dot.
        extension: String,
        /// The extensions that can be written.
        known: String,
    },
    /// There is nothing to write.
    #[error("there is nothing to write: {0} - hint: run the stage that makes it first")]
    Nothing(&'static str),
    /// A value that the format cannot hold.
    #[error("{value} cannot be written ({place}) - hint: {hint}")]
    Value {
        /// The value.
        value: String,
        /// Where it stands.
        place: Place,
        /// What to do.
        hint: &'static str,
    },
    /// Parts of the model do not belong together.
    #[error("{what} ({place}) - hint: fit the network again")]
    Inconsistent {
        /// What does not agree.
        what: String,
        /// Where.
        place: Place,
    },
    /// Rounded displacements need more digits than the kind of file has.
    #[error("{0} - hint: allow a larger error, or write EXR of 32 bits")]
    TooFine(String),
    /// The image library refuses.
    #[error("cannot write the image: {0} - hint: check that the folder is writable and has room")]
    Image(String),
}
