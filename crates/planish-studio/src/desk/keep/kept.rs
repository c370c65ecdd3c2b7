//! What the studio keeps of a project besides its drawing: steps to the mesh, and edits of the relief. The project file has it;
//! until that is written, a file beside it.

use super::preparation::Preparation;
use planish::DVec3;
use planish::relief::layers::ReliefEdit;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// What is kept.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kept {
    /// Steps to the mesh.
    pub preparation: Preparation,
    /// Edits of the relief, oldest first. Their places lie in space: surfaces that are fitted anew get them again.
    #[serde(default)]
    pub relief: Vec<ReliefEdit>,
    /// Those that were taken back, the next one last.
    #[serde(default)]
    pub relief_undone: Vec<ReliefEdit>,
}

/// The file beside a project file.
pub fn path_of(file: &Path) -> PathBuf {
    file.with_extension("planish-steps")
}

impl Kept {
    /// Nothing done yet on these points.
    /// * `scan` - its name, if it lies beside the project
    pub fn on(points: &[DVec3], scan: Option<String>) -> Kept {
        Kept { preparation: Preparation::on(points, scan), ..Kept::default() }
    }

    /// What a project file has; none if it has nothing, or is of another version.
    pub fn of(json: &str) -> Option<Kept> {
        serde_json::from_str(json).ok()
    }

    /// True if there is nothing to keep.
    pub fn is_empty(&self) -> bool {
        self.preparation.is_empty() && self.relief.is_empty() && self.relief_undone.is_empty()
    }

    /// For the project file; empty if there is nothing.
    pub fn json(&self) -> String {
        if self.is_empty() { String::new() } else { serde_json::to_string(self).unwrap_or_default() }
    }

    /// Writes it beside a project file: when this returns it is on the disk. Where there is nothing to keep there is no such
    /// file. One that cannot be written does not stop the work: the project file is written next, and tells why it cannot be.
    pub fn write(&self, file: &Path) {
        if self.is_empty() {
            return remove(file);
        }
        let partial = file.with_extension("planish-steps-partial");
        let written = std::fs::File::create(&partial).and_then(|mut f| {
            f.write_all(self.json().as_bytes())?;
            f.sync_data()
        });
        let _ = written.and_then(|()| std::fs::rename(&partial, path_of(file)));
    }

    /// What is kept beside a project file, if it is of these points and not of before the file was written.
    pub fn read(file: &Path, origin: u64) -> Option<Kept> {
        let path = path_of(file);
        let time = |path: &Path| path.metadata().and_then(|m| m.modified()).ok();
        if time(file).is_some_and(|saved| time(&path).is_none_or(|t| t < saved)) {
            return None;
        }
        Kept::of(&std::fs::read_to_string(path).ok()?).filter(|k| k.preparation.origin == origin)
    }
}

/// Removes the file beside a project file, which has it all.
pub fn remove(file: &Path) {
    let _ = std::fs::remove_file(path_of(file));
}

#[cfg(test)]
mod tests {
    use super::super::preparation::PrepStep;
    use super::*;
    use planish::field::Spacing;

    #[test]
    fn what_is_beside_a_project_is_taken_up_if_it_is_of_its_points_and_newer() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.planish");
        let start = Preparation::on(&[DVec3::X], Some("a.xyz".into()));
        let preparation = start.with(PrepStep::Mesh { close: Some(true), cells: Some(Spacing::Voxel(0.1)) });
        let stroke = r#"{"edit":"stroke","path":[[0,0,1]],"radius":0.1,"height":0.01}"#;
        let kept = Kept { preparation, relief: vec![serde_json::from_str(stroke).unwrap()], relief_undone: Vec::new() };
        kept.write(&file);
        assert_eq!(Kept::read(&file, start.origin), Some(kept.clone()));
        assert_eq!(Kept::of(&kept.json()), Some(kept));
        assert_eq!(Kept::read(&file, Preparation::on(&[DVec3::Y], None).origin), None);
        std::fs::write(&file, "newer").unwrap();
        let later = std::time::SystemTime::now() + std::time::Duration::from_secs(1);
        std::fs::File::options().write(true).open(&file).unwrap().set_modified(later).unwrap();
        assert_eq!(Kept::read(&file, start.origin), None);
        // Where nothing is to keep nothing stays beside the project.
        Kept::on(&[DVec3::X], None).write(&file);
        assert!(!path_of(&file).exists());
    }
}
