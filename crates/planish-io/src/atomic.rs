//! Files that are written whole or not at all.
//!
//! The bytes go to a temporary file in the same folder, which is flushed to the disk and then renamed over
//! the target. After an error the temporary file is removed; after a crash or Ctrl-C the target still is what
//! it was.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Bytes gathered before a system call: large enough that a file of many short lines costs few calls.
const BUFFER: usize = 1 << 18;

/// Writes `path` whole or not at all: `fill` writes the content into a temporary file beside it, which then
/// takes its place.
/// # Errors
/// Whatever `fill` returns, or the operating system's refusal to create, flush or rename the file.
pub fn write<E: From<io::Error>>(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    let temporary = beside(path)?;
    let mut out = BufWriter::with_capacity(BUFFER, temporary.as_file().try_clone()?);
    fill(&mut out)?;
    out.flush()?;
    drop(out);
    persist(temporary, path)?;
    Ok(())
}

/// Writes `path` whole or not at all, through a program that wants a path and not a stream (SQLite, EXR):
/// `fill` gets the path of an empty temporary file beside the target.
/// # Errors
/// Whatever `fill` returns, or the operating system's refusal to create, flush or rename the file.
pub fn write_at<E: From<io::Error>>(path: &Path, fill: impl FnOnce(&Path) -> Result<(), E>) -> Result<(), E> {
    let temporary = beside(path)?;
    fill(temporary.path())?;
    persist(temporary, path)?;
    Ok(())
}

/// A temporary file in the folder of `path`, so that the rename stays on one file system.
fn beside(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    if path.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
    }
    tempfile::Builder::new().prefix(".planish-").suffix(".part").tempfile_in(folder(path))
}

/// The folder that holds `path`.
fn folder(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

/// Flushes the temporary file to the disk and lets it take the place of `path`, with the permissions of the
/// file that it replaces or those of a newly created file.
fn persist(temporary: tempfile::NamedTempFile, path: &Path) -> io::Result<()> {
    let permissions = match std::fs::metadata(path) {
        Ok(old) => Some(old.permissions()),
        Err(_) => usual_permissions(),
    };
    if let Some(permissions) = permissions {
        temporary.as_file().set_permissions(permissions)?;
    }
    temporary.as_file().sync_all()?;
    temporary.persist(path).map_err(|failed| failed.error)?;
    // The rename itself reaches the disk with the folder; a system that cannot open folders does without.
    if let Ok(folder) = File::open(folder(path)) {
        let _ = folder.sync_all();
    }
    Ok(())
}

/// Read by all, written by the owner: a temporary file is created for its owner alone.
#[cfg(unix)]
fn usual_permissions() -> Option<std::fs::Permissions> {
    use std::os::unix::fs::PermissionsExt;
    Some(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn usual_permissions() -> Option<std::fs::Permissions> {
    None
}
