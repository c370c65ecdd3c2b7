//! Saving: the project file is written whole beside its name, on a thread of its own, again and again while there are
//! changes. What is not in it yet is in the journal.

use crate::desk::Letter;
use planish::Model;
use std::path::{Path, PathBuf};
use std::sync::mpsc::Sender;
use std::thread::JoinHandle;

/// Writes one project.
pub struct Saver {
    file: PathBuf,
    /// Number of changes so far, and those that the file holds.
    changes: u64,
    written: u64,
    thread: Option<JoinHandle<()>>,
    /// Why the last try failed.
    pub trouble: Option<String>,
}

impl Saver {
    /// A saver without changes.
    pub fn new(file: &Path) -> Saver {
        Saver { file: file.to_owned(), changes: 0, written: 0, thread: None, trouble: None }
    }

    /// Something has changed.
    pub fn changed(&mut self) {
        self.changes += 1;
        self.trouble = None;
    }

    /// True if the file holds everything.
    pub fn is_saved(&self) -> bool {
        self.changes == self.written
    }

    /// True if it is to be written now.
    pub fn is_due(&self) -> bool {
        !self.is_saved() && self.thread.is_none() && self.trouble.is_none()
    }

    /// Begins to write.
    pub fn begin(&mut self, model: Model, post: Sender<Letter>) {
        let (file, change) = (self.file.clone(), self.changes);
        self.thread = Some(std::thread::spawn(move || {
            let result = planish_io::write_model(&file, &model).map_err(|e| e.to_string());
            // Without a desk there is nobody to tell.
            let _ = post.send(Letter::Saved(change, result));
        }));
    }

    /// It was written, or not.
    pub fn ended(&mut self, change: u64, result: Result<(), String>) {
        self.thread = None;
        match result {
            Ok(()) => self.written = change,
            Err(why) => self.trouble = Some(why),
        }
    }

    /// Writes now, after what is being written. True if the file holds everything.
    pub fn finish(&mut self, model: &Model) -> bool {
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        let done = planish_io::write_model(&self.file, model).is_ok();
        if done {
            self.written = self.changes;
        }
        done
    }
}
