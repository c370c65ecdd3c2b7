//! Files that were made for pages and wait to be fetched.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Mutex;

/// A file that was made.
pub struct Ready {
    /// It is in this folder, which goes with it.
    pub folder: tempfile::TempDir,
    /// Its name.
    pub name: String,
}

/// Files that wait to be fetched; they go with the server.
#[derive(Default)]
pub struct Exports {
    files: Mutex<BTreeMap<u32, Ready>>,
}

/// Files that are kept; older ones go.
const KEPT: usize = 8;

impl Exports {
    /// Keeps a file: its address, its name and its size.
    pub fn keep(&self, ready: Ready) -> (String, String, u64) {
        let mut files = self.files.lock().unwrap_or_else(|e| e.into_inner());
        let number = files.last_key_value().map_or(1, |(n, _)| n + 1);
        let bytes = std::fs::metadata(ready.folder.path().join(&ready.name)).map_or(0, |m| m.len());
        let name = ready.name.clone();
        files.insert(number, ready);
        while files.len() > KEPT {
            files.pop_first();
        }
        (format!("/files/{number}"), name, bytes)
    }

    /// A file with its name.
    pub fn get(&self, number: u32) -> Option<(PathBuf, String)> {
        let files = self.files.lock().unwrap_or_else(|e| e.into_inner());
        files.get(&number).map(|ready| (ready.folder.path().join(&ready.name), ready.name.clone()))
    }
}
