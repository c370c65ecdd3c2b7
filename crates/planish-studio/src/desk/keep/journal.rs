//! The journal: edits that are done but not yet in the project file, one line each, so that a crash loses none.
//!
//! An edit is the same on the same drawing, so a line holds the edit and a fingerprint of the drawing before it and after it.
//! After a crash the edits from the drawing of the file on are made again.

use planish::edit::Edit;
use planish::model::Drawing;
use planish::network::CurveKind;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A line of the journal.
#[derive(Serialize, Deserialize)]
struct Line {
    before: u64,
    after: u64,
    edit: Edit,
}

/// The journal of a project.
pub struct Journal {
    path: PathBuf,
}

/// The journal beside a project file. Names that SQLite gives to files of its own would not do: it takes `x.planish-journal` for the
/// rest of an unfinished transaction of `x.planish`, and refuses to read that or removes it.
pub fn path_of(file: &Path) -> PathBuf {
    file.with_extension("planish-edits")
}

impl Journal {
    /// The journal beside a project file.
    pub fn new(file: &Path) -> Journal {
        Journal { path: path_of(file) }
    }

    /// Edits that came after a state, oldest first.
    pub fn lost(&self, state: u64) -> Vec<Edit> {
        let text = std::fs::read_to_string(&self.path).unwrap_or_default();
        // The last line may be cut off by the crash.
        let lines: Vec<Line> = text.lines().map_while(|l| serde_json::from_str(l).ok()).collect();
        match lines.iter().position(|l| l.before == state) {
            Some(first) => lines.into_iter().skip(first).map(|l| l.edit).collect(),
            None => Vec::new(),
        }
    }

    /// Adds an edit; when this returns it is on the disk. A journal that cannot be written does not stop the work: the file
    /// itself is written next, and tells why it cannot be.
    pub fn add(&self, edit: &Edit, before: u64, after: u64) {
        let line = Line { before, after, edit: edit.clone() };
        let Ok(mut text) = serde_json::to_string(&line) else { return };
        text.push('\n');
        let file = std::fs::OpenOptions::new().create(true).append(true).open(&self.path);
        let _ = file.and_then(|mut file| {
            file.write_all(text.as_bytes())?;
            file.sync_data()
        });
    }

    /// Empties it: the file holds everything.
    pub fn clear(&self) {
        self.remove();
    }

    /// Removes it.
    pub fn remove(&self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// A fingerprint (FNV-1a, 64 bit) of a drawing and the length of its history.
pub fn state_of(drawing: &Drawing, undo: usize, redo: usize) -> u64 {
    let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
    hash.add(undo as u64);
    hash.add(redo as u64);
    for corner in &drawing.network.corners {
        hash.place(&corner.place);
    }
    for curve in &drawing.network.curves {
        hash.add(match curve.kind {
            CurveKind::Smooth => 0,
            CurveKind::Feature => 1,
            CurveKind::Boundary => 2,
            CurveKind::Rounded => 3,
        });
        curve.points.iter().for_each(|p| hash.place(p));
    }
    for feature in &drawing.sketch.features {
        hash.add(feature.patch as u64);
        feature.points.iter().for_each(|p| hash.place(p));
    }
    hash.add(drawing.sketch.sections.len() as u64);
    if let Some(plane) = &drawing.sketch.symmetry {
        plane.point.to_array().iter().chain(&plane.normal.to_array()).for_each(|x| hash.add(x.to_bits()));
    }
    hash.0
}

struct Fnv(u64);

impl Fnv {
    fn add(&mut self, value: u64) {
        for byte in value.to_le_bytes() {
            self.0 = (self.0 ^ byte as u64).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn place(&mut self, place: &planish::mesh::FacePoint) {
        self.add(place.face as u64);
        place.bary.iter().for_each(|b| self.add(b.to_bits()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use planish::Model;

    #[test]
    fn edits_after_the_state_of_the_file_come_back_and_a_line_cut_off_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let journal = Journal::new(&folder.path().join("a.planish"));
        let edit = |k: usize| -> Edit { serde_json::from_str(&format!(r#"{{"edit":"undo","count":{k}}}"#)).unwrap() };
        for k in 1..4 {
            journal.add(&edit(k), k as u64, k as u64 + 1);
        }
        assert_eq!(journal.lost(2), [edit(2), edit(3)]);
        assert_eq!(journal.lost(4), []);
        let text = std::fs::read_to_string(path_of(&folder.path().join("a.planish"))).unwrap();
        std::fs::write(path_of(&folder.path().join("a.planish")), &text[..text.len() - 9]).unwrap();
        assert_eq!(journal.lost(1), [edit(1), edit(2)]);
    }

    #[test]
    fn regress_the_journal_outlives_the_writing_and_reading_of_its_project_file() {
        // It was named as SQLite names a journal of its own: each save removed it, and a file beside it could not be read.
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.planish");
        let model = Model { mesh: planish::synthetic::shapes::sphere(1.0, 2), ..Model::default() };
        planish_io::write_model(&file, &model).unwrap();
        let (journal, edit) = (Journal::new(&file), serde_json::from_str(r#"{"edit":"undo"}"#).unwrap());
        journal.add(&edit, 1, 2);
        assert_eq!(planish_io::read_model(&file).unwrap().mesh, model.mesh);
        planish_io::write_model(&file, &model).unwrap();
        assert_eq!(journal.lost(1), [edit]);
    }
}
