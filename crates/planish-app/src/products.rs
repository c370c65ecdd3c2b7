//! Products appear whole or not at all: each is written into a staging folder on the same file system and renamed at the end.
//!
//! A staging folder holds a lock for as long as its process lives. What a killed process has left is found by its free lock
//! and removed by the next run that writes there.

use crate::failure::Failure;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use tempfile::TempDir;

/// Staging folders of this process, and the folders made for them, so that an interrupt that cannot wait can still remove them.
static STAGING: Mutex<Vec<Place>> = Mutex::new(Vec::new());

/// How staging folders begin.
const PREFIX: &str = ".planish-partial-";
/// How often a staging folder is made anew that another process swept before it had its lock.
const TRIES: usize = 10;
/// The file in a staging folder that its process keeps locked.
const LOCK: &str = ".lock";

struct Place {
    staging: PathBuf,
    /// Folders that were made for it, the outermost first.
    made: Vec<PathBuf>,
}

impl Place {
    /// Removes the folders that were made, as far as they are empty.
    fn unmake(&self) {
        self.made.iter().rev().for_each(|folder| _ = fs::remove_dir(folder));
    }
}

/// What is being written for one target: a single file or a folder of products.
pub struct Staged {
    // Before the registry is told, so that the folder is gone before it is forgotten.
    staging: Option<TempDir>,
    target: PathBuf,
    kind: Kind,
    _lock: Option<File>,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    File,
    Folder,
}

impl Staged {
    /// A single file. Its folder must exist; a file of that name is replaced, of a link what it leads to.
    /// # Errors
    /// If nothing can be written there.
    pub fn file(target: &Path) -> Result<Staged, Failure> {
        if target.is_dir() {
            return Err(Failure::usage(target, "is a folder, not a file").hint("give a file name to -o"));
        }
        if target.file_name().is_none() {
            return Err(Failure::usage(target, "is not a file name").hint("give a file name to -o"));
        }
        let whole = if target.is_symlink() { fs::canonicalize(target).ok() } else { None };
        let target = whole.unwrap_or_else(|| target.to_path_buf());
        Staged::open(parent(&target), &target, Kind::File, Vec::new())
    }

    /// A folder of products. Missing folders are made; products of the same name in it are replaced and
    /// everything else in it stays.
    /// # Errors
    /// If nothing can be written there.
    pub fn folder(target: &Path) -> Result<Staged, Failure> {
        if target.exists() && !target.is_dir() {
            return Err(Failure::usage(target, "is a file, not a folder").hint("give a folder to -o"));
        }
        let missing = target.ancestors().take_while(|p| !p.as_os_str().is_empty() && !p.exists());
        let mut made: Vec<PathBuf> = missing.map(Path::to_path_buf).collect();
        made.reverse();
        fs::create_dir_all(target).map_err(|e| unwritable(target, &e))?;
        // Inside the target, which may be a file system of its own, or all that the user may write to.
        Staged::open(target, target, Kind::Folder, made)
    }

    /// A folder for files that live as long as this command; nothing of it goes anywhere.
    /// # Errors
    /// If there is no room for it.
    pub fn scratch() -> Result<Staged, Failure> {
        let folder = std::env::temp_dir();
        Staged::open(&folder, &folder, Kind::Folder, Vec::new())
    }

    fn open(beside: &Path, target: &Path, kind: Kind, made: Vec<PathBuf>) -> Result<Staged, Failure> {
        sweep(beside);
        let open = || -> io::Result<(TempDir, Option<File>)> {
            let mut tries = 0..TRIES;
            let (staging, lock) = loop {
                let staging = tempfile::Builder::new().prefix(PREFIX).tempdir_in(beside)?;
                match File::create(staging.path().join(LOCK)) {
                    // Another process took the empty folder for one that was left.
                    Err(e) if e.kind() == io::ErrorKind::NotFound && tries.next().is_some() => {}
                    lock => break (staging, lock?),
                }
            };
            // A file system without locks keeps what killed runs leave.
            let held = lock.try_lock().is_ok();
            Ok((staging, held.then_some(lock)))
        };
        let place = |staging: PathBuf| Place { staging, made: made.clone() };
        match open() {
            Ok((staging, lock)) => {
                registry().push(place(staging.path().to_owned()));
                Ok(Staged { staging: Some(staging), target: target.to_owned(), kind, _lock: lock })
            }
            Err(e) => {
                place(PathBuf::new()).unmake();
                Err(unwritable(target, &e))
            }
        }
    }

    fn staging(&self) -> &Path {
        self.staging.as_ref().map_or(Path::new("."), |s| s.path())
    }

    /// Where the file, or the folder's product `name`, is written meanwhile. The name stays, so that a
    /// format is found from the extension.
    pub fn path(&self, name: &str) -> PathBuf {
        self.staging().join(name)
    }

    /// Where the single file is written meanwhile.
    pub fn file_path(&self) -> PathBuf {
        self.staging().join(self.target.file_name().unwrap_or_default())
    }

    /// Moves everything to its place.
    /// # Errors
    /// If a rename fails.
    pub fn commit(self) -> Result<(), Failure> {
        // Held throughout: an interrupt waits until either nothing or everything is in place.
        let mut registered = registry();
        self.move_all().map_err(|e| unwritable(&self.target, &e))?;
        registered.retain(|p| p.staging != self.staging());
        Ok(())
    }

    fn move_all(&self) -> io::Result<()> {
        let folder = if self.kind == Kind::Folder { self.target.as_path() } else { parent(&self.target) };
        fs::create_dir_all(folder)?;
        let mut entries: Vec<_> = fs::read_dir(self.staging())?.collect::<Result<_, _>>()?;
        entries.sort_by_key(|e| e.file_name());
        if entries.iter().any(|e| e.file_name() == planish_io::RELIEF_SIDECAR) {
            remove_old(folder, planish_io::relief_names(folder))?;
        }
        if entries.iter().any(|e| e.file_name() == planish_io::TILE_LIST) {
            remove_old(folder, planish_io::tile_names(folder))?;
        }
        for entry in entries.into_iter().filter(|e| e.file_name() != LOCK) {
            let place = folder.join(entry.file_name());
            if entry.file_type()?.is_dir() {
                replace_maps(&entry.path(), &place)?;
            } else {
                fs::rename(entry.path(), &place)?;
            }
        }
        Ok(())
    }
}

/// Removes the files that a list of this program's names in a folder, and nothing else.
fn remove_old(folder: &Path, names: Vec<String>) -> io::Result<()> {
    for name in names {
        match fs::remove_file(folder.join(name)) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
            _ => {}
        }
    }
    Ok(())
}

/// Puts a folder of maps in its place. Of what is there only the maps that an older sidecar names go.
fn replace_maps(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    remove_old(to, planish_io::relief_names(to))?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        fs::rename(entry.path(), to.join(entry.file_name()))?;
    }
    Ok(())
}

/// Removes the staging folders in `folder` whose processes are gone.
fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten().filter(|e| e.file_name().to_string_lossy().starts_with(PREFIX)) {
        let Ok(lock) = File::open(entry.path().join(LOCK)) else {
            // Killed before it had its lock, or after it gave it back: nothing is in it.
            let _ = fs::remove_dir(entry.path());
            continue;
        };
        if lock.try_lock().is_ok() {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        let path = self.staging().to_path_buf();
        drop(self.staging.take());
        let mut registered = registry();
        if let Some(at) = registered.iter().position(|p| p.staging == path) {
            registered.swap_remove(at).unmake();
        }
    }
}

/// Removes what is unfinished and ends the process; for an interrupt that a stage did not answer in time.
pub fn abandon_and_exit(status: u8) -> ! {
    let registered = registry();
    for place in registered.iter() {
        // The stage may still be writing: a folder can gain a file while it is being emptied.
        for _ in 0..20 {
            if fs::remove_dir_all(&place.staging).is_ok() || !place.staging.exists() {
                break;
            }
        }
    }
    // Folders that were made for one may hold what another had.
    registered.iter().for_each(Place::unmake);
    std::process::exit(status as i32)
}

fn registry() -> std::sync::MutexGuard<'static, Vec<Place>> {
    STAGING.lock().unwrap_or_else(|e| e.into_inner())
}

fn parent(target: &Path) -> &Path {
    match target.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    }
}

/// An output that the operating system refuses, with the way out.
pub fn unwritable(target: &Path, error: &io::Error) -> Failure {
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
    use crate::outputs::RELIEF;

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
    fn a_folder_keeps_the_files_of_others_and_loses_only_maps_that_an_older_sidecar_names() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("deep/out");
        let maps = target.join(RELIEF);
        fs::create_dir_all(&maps).unwrap();
        fs::write(maps.join("patch_0009.exr"), "old").unwrap();
        fs::write(maps.join("sculpt.blend"), "mine").unwrap();
        fs::write(maps.join("relief.json"), r#"{"planish_relief": 1, "patches": [{"file": "patch_0009.exr"}]}"#)
            .unwrap();
        fs::write(target.join("notes.txt"), "mine").unwrap();
        let staged = Staged::folder(&target).unwrap();
        fs::create_dir(staged.path(RELIEF)).unwrap();
        fs::write(staged.path(RELIEF).join("patch_0000.exr"), "new").unwrap();
        staged.commit().unwrap();
        assert!(target.join("notes.txt").exists() && maps.join("patch_0000.exr").exists());
        assert!(maps.join("sculpt.blend").exists() && !maps.join("patch_0009.exr").exists());
        assert_eq!(fs::read_dir(&target).unwrap().count(), 2);
    }

    #[test]
    fn an_uncommitted_folder_and_what_was_made_for_it_go_and_what_a_dead_process_left_is_swept() {
        let dir = tempfile::tempdir().unwrap();
        let left = dir.path().join(format!("{PREFIX}dead"));
        fs::create_dir(&left).unwrap();
        fs::write(left.join(LOCK), "").unwrap();
        fs::write(left.join("half.ply"), "half").unwrap();
        // And one that was killed before it had a lock.
        let early = dir.path().join(format!("{PREFIX}early"));
        fs::create_dir(&early).unwrap();
        let living = Staged::file(&dir.path().join("a.txt")).unwrap();
        assert!(!left.exists() && !early.exists());
        let folder = Staged::folder(&dir.path().join("deep/out")).unwrap();
        assert!(living.file_path().parent().unwrap().exists());
        drop(folder);
        assert!(!dir.path().join("deep").exists());
    }
}
