//! Products appear whole or not at all: each is written beside its place and renamed at the end.

use crate::failure::Failure;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use tempfile::TempDir;

/// Staging folders of this process, so that an interrupt that cannot wait can still remove them.
static STAGING: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// What is being written for one target: a single file or a folder of products.
pub struct Staged {
    // Before `registered`, so that the folder is gone before it is forgotten.
    staging: TempDir,
    target: PathBuf,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    File,
    Folder,
}

impl Staged {
    /// A single file. Its folder must exist; a file of that name is replaced.
    /// # Errors
    /// If nothing can be written there.
    pub fn file(target: &Path) -> Result<Staged, Failure> {
        if target.is_dir() {
            return Err(Failure::usage(target, "is a folder, not a file").hint("give a file name to -o"));
        }
        if target.file_name().is_none() {
            return Err(Failure::usage(target, "is not a file name").hint("give a file name to -o"));
        }
        Staged::open(target, Kind::File)
    }

    /// A folder of products. Missing folders are made; products of the same name in it are replaced and
    /// everything else in it stays.
    /// # Errors
    /// If nothing can be written there.
    pub fn folder(target: &Path) -> Result<Staged, Failure> {
        if target.exists() && !target.is_dir() {
            return Err(Failure::usage(target, "is a file, not a folder").hint("give a folder to -o"));
        }
        fs::create_dir_all(parent(target)).map_err(|e| unwritable(target, &e))?;
        Staged::open(target, Kind::Folder)
    }

    fn open(target: &Path, kind: Kind) -> Result<Staged, Failure> {
        let staging = tempfile::Builder::new()
            .prefix(".planish-partial-")
            .tempdir_in(parent(target))
            .map_err(|e| unwritable(target, &e))?;
        registry().push(staging.path().to_owned());
        Ok(Staged { staging, target: target.to_owned(), kind })
    }

    /// Where the file, or the folder's product `name`, is written meanwhile. The name stays, so that a
    /// format is found from the extension.
    pub fn path(&self, name: &str) -> PathBuf {
        self.staging.path().join(name)
    }

    /// Where the single file is written meanwhile.
    pub fn file_path(&self) -> PathBuf {
        self.staging.path().join(self.target.file_name().unwrap_or_default())
    }

    /// Moves everything to its place.
    /// # Errors
    /// If a rename fails.
    pub fn commit(self) -> Result<(), Failure> {
        // Held throughout: an interrupt waits until either nothing or everything is in place.
        let mut registered = registry();
        let target = self.target.clone();
        self.move_all().map_err(|e| unwritable(&target, &e))?;
        registered.retain(|p| p != self.staging.path());
        Ok(())
    }

    fn move_all(&self) -> io::Result<()> {
        let folder = if self.kind == Kind::Folder { self.target.as_path() } else { parent(&self.target) };
        fs::create_dir_all(folder)?;
        let mut entries: Vec<_> = fs::read_dir(self.staging.path())?.collect::<Result<_, _>>()?;
        entries.sort_by_key(|e| e.file_name());
        for entry in entries {
            let place = folder.join(entry.file_name());
            if place.is_dir() {
                // A folder product (relief) is replaced as a whole: maps of an older run must not stay in it.
                fs::remove_dir_all(&place)?;
            }
            fs::rename(entry.path(), &place)?;
        }
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        registry().retain(|p| p != self.staging.path());
    }
}

/// Removes what is unfinished and ends the process; for an interrupt that a stage did not answer in time.
pub fn abandon_and_exit(status: u8) -> ! {
    let registered = registry();
    for folder in registered.iter() {
        // The stage may still be writing: a folder can gain a file while it is being emptied.
        for _ in 0..20 {
            if fs::remove_dir_all(folder).is_ok() || !folder.exists() {
                break;
            }
        }
    }
    std::process::exit(status as i32)
}

fn registry() -> std::sync::MutexGuard<'static, Vec<PathBuf>> {
    STAGING.lock().unwrap_or_else(|e| e.into_inner())
}

fn parent(target: &Path) -> &Path {
    match target.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    }
}

fn unwritable(target: &Path, error: &io::Error) -> Failure {
    let hint = match error.kind() {
        io::ErrorKind::NotFound => "make its folder first",
        io::ErrorKind::PermissionDenied => "choose a folder that you may write to",
        io::ErrorKind::StorageFull => "make room on the disk",
        _ => "choose another place with -o",
    };
    Failure::usage(target, format!("cannot be written ({})", plain(error))).hint(hint)
}

/// An operating system's message without its number, beginning small.
pub fn plain(error: &io::Error) -> String {
    let text = error.to_string();
    let text = text.split(" (os error").next().unwrap_or_default();
    let mut letters = text.chars();
    letters.next().map(|c| c.to_lowercase().chain(letters).collect()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_uncommitted_product_leaves_nothing_and_a_committed_one_replaces_the_old() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("a.txt");
        fs::write(&target, "old").unwrap();
        let staged = Staged::file(&target).unwrap();
        fs::write(staged.file_path(), "half").unwrap();
        drop(staged);
        assert_eq!(fs::read_to_string(&target).unwrap(), "old");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);

        let staged = Staged::file(&target).unwrap();
        fs::write(staged.file_path(), "new").unwrap();
        staged.commit().unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "new");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_keeps_strange_files_and_loses_old_maps() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("deep/out");
        fs::create_dir_all(target.join("relief")).unwrap();
        fs::write(target.join("relief/patch-9.exr"), "old").unwrap();
        fs::write(target.join("notes.txt"), "mine").unwrap();
        let staged = Staged::folder(&target).unwrap();
        fs::create_dir(staged.path("relief")).unwrap();
        fs::write(staged.path("relief/patch-0.exr"), "new").unwrap();
        staged.commit().unwrap();
        assert!(target.join("notes.txt").exists() && target.join("relief/patch-0.exr").exists());
        assert!(!target.join("relief/patch-9.exr").exists());
    }
}
