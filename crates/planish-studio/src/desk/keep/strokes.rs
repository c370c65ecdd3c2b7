//! Edits of the relief as a list that a relief follows: strokes of a brush, smoothing, erasing.

use planish::model::{HistoryEntry, Model};
use planish::observe::Observer;
use planish::relief::Relief;
use planish::relief::layers::{self, Layers, Picture, ReliefEdit};
use std::path::Path;

/// A relief with edits.
pub struct Sculpted {
    /// The edits that it has.
    pub edits: Vec<ReliefEdit>,
    /// What they lie above, and they.
    pub layers: Layers,
    /// All of it together.
    pub reliefs: Vec<Relief>,
    /// Why the edit that comes next in the list cannot be made.
    pub trouble: Option<String>,
}

/// Makes the relief of a model follow a list of edits: takes those back that it has and the list has not, and makes the others. The
/// first that cannot be made ends it; those before it are made.
/// * `has` - the edits that it has, and has afterwards
/// * `folder` - where images of stamps are
///
/// # Errors
/// Why an edit cannot be made: the one of the list at the number of those that it has.
pub fn follow(
    model: &mut Model,
    has: &mut Vec<ReliefEdit>,
    list: &[ReliefEdit],
    folder: &Path,
    observer: &dyn Observer,
) -> Result<(), String> {
    let shared = has.iter().zip(list).take_while(|(a, b)| a == b).count();
    while has.len() > shared {
        model.undo_relief();
        has.pop();
    }
    let pictures = |name: &str| -> Result<Picture, String> {
        match Path::new(name).file_name() == Some(name.as_ref()) {
            true => planish_io::maps::read_picture(&folder.join(name)).map_err(|e| format!("{name}: {e}")),
            false => Err(format!("{name} is not a file of the project's folder")),
        }
    };
    for edit in &list[shared..] {
        let Model { layers, reliefs, network, surfaces, .. } = &mut *model;
        layers.begin(reliefs);
        let made = layers::edit(layers, (network, surfaces), edit, &pictures, observer).map_err(|e| e.to_string())?;
        model.record_relief(entry_of(edit), made.stack);
        has.push(edit.clone());
    }
    Ok(())
}

/// What the history of a model has of an edit.
pub fn entry_of(edit: &ReliefEdit) -> HistoryEntry {
    HistoryEntry { command: edit.name().into(), parameters: serde_json::to_string(edit).unwrap_or_default() }
}

/// The edits that the relief of a model has; none if some are not of a script.
pub fn edits_of(layers: &Layers) -> Vec<ReliefEdit> {
    let edit = |past: &layers::Past| serde_json::from_str(&past.parameters).ok();
    layers.undo.iter().map(edit).collect::<Option<_>>().unwrap_or_default()
}
