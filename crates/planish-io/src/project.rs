//! The project file `*.planish`: one SQLite database with everything of a model.
//!
//! A file is written whole beside its name and then takes its place; it carries the application id of planish and
//! the version of its schema. Arrays are little-endian blobs, compressed with zstd and guarded by a CRC-32 (the
//! library that PNG and EXR already bring along; it guards against damage, not against forgery).
//!
//! The database is left in rollback mode, so a finished file needs neither a `-wal` nor a `-shm` beside it and
//! can be read where nothing can be written. What another program left beside a file that is replaced is
//! removed with it, since SQLite would play it into the new one.

mod array;
mod layers;
mod schema;
mod steps;

use crate::atomic;
use planish::Model;
use rusqlite::{Connection, OpenFlags};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// `plan` in ASCII: marks a SQLite database as a planish project.
pub const APPLICATION_ID: u32 = 0x706C_616E;
/// Version of the schema that is written, and the newest that is read.
pub const SCHEMA_VERSION: u32 = 3;

/// Why a project file could not be read or written. Shown as `what is wrong (where) - hint: what to do`.
#[derive(Debug, thiserror::Error)]
pub enum ProjectError {
    /// The operating system refuses.
    #[error("cannot read or write it: {0} - hint: check the name, the permissions and the room on the disk")]
    Io(#[from] io::Error),
    /// No SQLite database at all.
    #[error("it is not a planish project (byte 0) - hint: name a .planish file")]
    NotAProject,
    /// A SQLite database of another program.
    #[error("it is a database of another program (application id {0:#010x}) - hint: name a .planish file")]
    OtherProgram(u32),
    /// Written by a newer planish.
    #[error(
        "its schema is version {found}, newer than {SCHEMA_VERSION} that this planish knows - hint: update planish"
    )]
    Newer {
        /// Version found.
        found: u32,
    },
    /// Shorter than its header says.
    #[error("the file is cut off: {left} of {needed} bytes are there (byte {left}) - hint: copy it again")]
    Truncated {
        /// Bytes by the header.
        needed: u64,
        /// Bytes found.
        left: u64,
    },
    /// An array is not what was written.
    #[error("the checksum does not match (array {array}) - hint: the file is damaged; take a copy of it")]
    Checksum {
        /// Number of the array.
        array: i64,
    },
    /// The content does not fit together.
    #[error("{what} ({place}) - hint: the file is damaged; take a copy of it")]
    Damaged {
        /// What is wrong.
        what: String,
        /// Table and row.
        place: String,
    },
    /// The disk has no room left.
    #[error("the disk is full - hint: make room on it, or name another place")]
    Full,
    /// SQLite refuses.
    #[error("the database is damaged or in use: {0} - hint: close other programs that use it, or take a copy of it")]
    Database(rusqlite::Error),
}

impl From<rusqlite::Error> for ProjectError {
    fn from(e: rusqlite::Error) -> ProjectError {
        match e.sqlite_error_code() {
            Some(rusqlite::ErrorCode::DiskFull) => ProjectError::Full,
            _ => ProjectError::Database(e),
        }
    }
}

/// Writes a model as one project file, whole or not at all. The same model gives the same bytes.
/// # Errors
/// [`ProjectError::Io`], [`ProjectError::Full`] or [`ProjectError::Database`] if the file cannot be written.
pub fn write_model(path: impl AsRef<Path>, model: &Model) -> Result<(), ProjectError> {
    let path = path.as_ref();
    atomic::write_at(path, |temporary| {
        let mut connection = Connection::open(temporary)?;
        // The file is not the project until it is renamed: a journal would guard nothing.
        connection.pragma_update(None, "page_size", 8192)?;
        connection.pragma_update_and_check(None, "journal_mode", "OFF", |_| Ok(()))?;
        connection.pragma_update(None, "synchronous", "OFF")?;
        connection.pragma_update(None, "application_id", APPLICATION_ID)?;
        connection.pragma_update(None, "user_version", SCHEMA_VERSION)?;
        let transaction = connection.transaction()?;
        schema::write(&transaction, model)?;
        transaction.commit()?;
        connection.close().map_err(|(_, e)| e)?;
        for leftover in leftovers(path) {
            match std::fs::remove_file(leftover) {
                Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e.into()),
                _ => {}
            }
        }
        Ok(())
    })
}

/// Reads a project file.
/// # Errors
/// [`ProjectError::NotAProject`], [`ProjectError::OtherProgram`], [`ProjectError::Newer`],
/// [`ProjectError::Truncated`], [`ProjectError::Checksum`], [`ProjectError::Damaged`] as their names say.
pub fn read_model(path: impl AsRef<Path>) -> Result<Model, ProjectError> {
    let path = path.as_ref();
    let mut head = [0u8; 100];
    // Before it is opened: that alone waits for ever at a pipe that nobody writes to.
    let metadata = std::fs::metadata(path)?;
    if !metadata.is_file() || metadata.len() < head.len() as u64 {
        return Err(if metadata.is_dir() {
            ProjectError::Io(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"))
        } else {
            ProjectError::NotAProject
        });
    }
    std::fs::File::open(path)?.read_exact(&mut head)?;
    if !head.starts_with(b"SQLite format 3\0") {
        return Err(ProjectError::NotAProject);
    }
    let word = |at: usize| u32::from_be_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    // Pages that are still in the write-ahead log are not in the file: only a file alone can be measured.
    if leftovers(path).iter().all(|p| !p.exists()) {
        let page = match u16::from_be_bytes([head[16], head[17]]) {
            1 => 65536,
            size => size as u64,
        };
        let needed = page * word(28) as u64;
        if metadata.len() < needed {
            return Err(ProjectError::Truncated { needed, left: metadata.len() });
        }
    }
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(path, flags)?;
    let pragma = |name: &str| connection.pragma_query_value(None, name, |row| row.get::<_, i32>(0));
    let application = pragma("application_id")? as u32;
    if application != APPLICATION_ID {
        return Err(ProjectError::OtherProgram(application));
    }
    let found = pragma("user_version")? as u32;
    if found > SCHEMA_VERSION {
        return Err(ProjectError::Newer { found });
    }
    schema::read(&connection, found, metadata.len())
}

/// What SQLite keeps beside a database while it is open, and leaves there after a crash.
fn leftovers(path: &Path) -> Vec<PathBuf> {
    let with = |suffix: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(suffix);
        PathBuf::from(name)
    };
    ["-wal", "-shm", "-journal"].map(with).to_vec()
}
