//! A model: everything one project holds, from the mesh to the reliefs, and how it came to be.

use crate::curve::symmetry::Plane;
use crate::grid::{FeatureCurve, Grid, Sections};
use crate::mesh::TriMesh;
use crate::network::Network;
use crate::relief::layers::{Layer, Layers};
use crate::relief::{self, Displaced, Relief, ReliefError};
use crate::surface::Surface;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Mesh, network, grids, surfaces, reliefs and history: the content of one project file.
///
/// `grids`, `surfaces` and `reliefs` are empty until their stage has run; after it they have one entry per
/// patch of the network, in its order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Model {
    /// The mesh that everything lies on.
    pub mesh: TriMesh,
    /// Corners, curves and patches on the mesh.
    pub network: Network,
    /// One spring grid per patch.
    pub grids: Vec<Grid>,
    /// One B-spline surface per patch.
    pub surfaces: Vec<Surface>,
    /// One displacement map per patch: the sum of the layers, where there are any.
    pub reliefs: Vec<Relief>,
    /// Edits of the relief.
    pub layers: Layers,
    /// What one unit of a coordinate is.
    pub units: Units,
    /// What brings the coordinates back to their place: a model that is far from the origin lies near it here.
    pub shift: DVec3,
    /// Parameters of the stages that made the model, as one JSON object (empty: unknown).
    pub params: String,
    /// What the studio keeps besides, as one JSON object (empty: nothing): steps by hand to the mesh, edits of the relief.
    pub studio: String,
    /// The commands that led here, oldest first.
    pub history: Vec<HistoryEntry>,
    /// What is drawn besides the network.
    pub sketch: Sketch,
    /// Edits that can be taken back, oldest first; their commands are the last ones of `history`.
    pub undo: Vec<Step>,
    /// Edits taken back that can be made again, the next one last.
    pub redo: Vec<Step>,
}

/// What is drawn on the mesh besides the network.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sketch {
    /// Feature curves of the patches.
    pub features: Vec<FeatureCurve>,
    /// Numbers of grid cells between the feature curves of a patch, where they are given: `(patch, cells)`.
    pub sections: Vec<(u32, Sections)>,
    /// The plane of symmetry, if one is given or was found.
    pub symmetry: Option<Plane>,
}

/// Everything that edits change.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Drawing {
    /// Corners, curves and patches.
    pub network: Network,
    /// What is drawn besides.
    pub sketch: Sketch,
}

/// An edit with the drawing on its other side: that before it where it can be taken back, that after it where it can
/// be made again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// The edit.
    pub entry: HistoryEntry,
    /// The drawing on its other side.
    pub other: Drawing,
}

impl Model {
    /// The drawing as it is.
    pub fn drawing(&self) -> Drawing {
        Drawing { network: self.network.clone(), sketch: self.sketch.clone() }
    }

    fn exchange(&mut self, drawing: Drawing) -> Drawing {
        // Whatever was made from the network is no longer of it.
        (self.grids, self.surfaces, self.reliefs) = Default::default();
        self.layers = Layers::default();
        let network = std::mem::replace(&mut self.network, drawing.network);
        Drawing { network, sketch: std::mem::replace(&mut self.sketch, drawing.sketch) }
    }

    /// Takes over an edited drawing as one entry of the history. Grids, surfaces and reliefs are dropped; edits that
    /// were taken back can no longer be made again.
    pub fn record(&mut self, entry: HistoryEntry, edited: Drawing) {
        let other = self.exchange(edited);
        self.history.push(entry.clone());
        self.undo.push(Step { entry, other });
        self.redo.clear();
    }

    /// Takes over surfaces with the reliefs that were baked on them. Edits of the relief stay, on the shapes that they have;
    /// what was taken back before belongs to the older surfaces and is forgotten.
    /// # Errors
    /// If surfaces and reliefs do not fit together.
    pub fn set_baked(&mut self, surfaces: Vec<Surface>, baked: Vec<Relief>) -> Result<(), ReliefError> {
        if self.layers.stack.is_empty() {
            (self.surfaces, self.reliefs) = (surfaces, baked);
            return Ok(());
        }
        let shapes: Vec<[usize; 2]> = self.reliefs.iter().map(|r| [r.rows, r.cols]).collect();
        let displaced = Displaced { network: &self.network, surfaces: &surfaces, reliefs: &baked };
        self.layers.rebake(relief::resample_all(&displaced, &shapes)?);
        self.reliefs = self.layers.sum().unwrap_or_default();
        self.surfaces = surfaces;
        Ok(())
    }

    /// Takes over an edited stack of layers as one entry of the history.
    pub fn record_relief(&mut self, entry: HistoryEntry, stack: Vec<Layer>) {
        self.layers.record(&entry.command, &entry.parameters, stack);
        self.reliefs = self.layers.sum().unwrap_or_default();
        self.history.push(entry);
    }

    /// Takes back the last edit of the relief. False if there is none.
    pub fn undo_relief(&mut self) -> bool {
        let Some(past) = self.layers.undo.last() else { return false };
        let is_it = |h: &HistoryEntry| (&h.command, &h.parameters) == (&past.command, &past.parameters);
        if let Some(at) = self.history.iter().rposition(is_it) {
            self.history.remove(at);
        }
        self.layers.undo();
        self.reliefs = self.layers.sum().unwrap_or_default();
        true
    }

    /// Makes the last edit of the relief that was taken back again. False if there is none.
    pub fn redo_relief(&mut self) -> bool {
        let Some(past) = self.layers.redo.last() else { return false };
        self.history.push(HistoryEntry { command: past.command.clone(), parameters: past.parameters.clone() });
        self.layers.redo();
        self.reliefs = self.layers.sum().unwrap_or_default();
        true
    }

    /// Takes back the last edit. False if there is none.
    pub fn undo(&mut self) -> bool {
        let Some(Step { entry, other }) = self.undo.pop() else { return false };
        let other = self.exchange(other);
        // Fits in between stay in the history: they did happen.
        if let Some(at) = self.history.iter().rposition(|h| *h == entry) {
            self.history.remove(at);
        }
        self.redo.push(Step { entry, other });
        true
    }

    /// Makes the last edit that was taken back again. False if there is none.
    pub fn redo(&mut self) -> bool {
        let Some(Step { entry, other }) = self.redo.pop() else { return false };
        let other = self.exchange(other);
        self.history.push(entry.clone());
        self.undo.push(Step { entry, other });
        true
    }
}

/// One command of a model's history.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HistoryEntry {
    /// What was done, by the command's name (`fit`, `move_corner` ...).
    pub command: String,
    /// Its parameters as one JSON object.
    pub parameters: String,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Units {
    /// Millimetre.
    #[default]
    Mm,
    /// Centimetre.
    Cm,
    /// Metre.
    M,
    /// Inch.
    In,
}

impl Units {
    /// Length of one unit in metres.
    pub fn metres(self) -> f64 {
        match self {
            Units::Mm => 1e-3,
            Units::Cm => 1e-2,
            Units::M => 1.0,
            Units::In => 0.0254,
        }
    }

    /// Its symbol: `mm`, `cm`, `m`, `in`.
    pub fn symbol(self) -> &'static str {
        match self {
            Units::Mm => "mm",
            Units::Cm => "cm",
            Units::M => "m",
            Units::In => "in",
        }
    }
}

impl std::fmt::Display for Units {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.symbol())
    }
}

/// The text is no unit of length.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown unit \"{0}\" - hint: use mm, cm, m or in")]
pub struct UnknownUnit(pub String);

impl std::str::FromStr for Units {
    type Err = UnknownUnit;

    fn from_str(text: &str) -> Result<Units, UnknownUnit> {
        match text {
            "mm" => Ok(Units::Mm),
            "cm" => Ok(Units::Cm),
            "m" => Ok(Units::M),
            "in" => Ok(Units::In),
            _ => Err(UnknownUnit(text.to_string())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_reads_its_own_symbol_and_one_inch_is_25_4_mm() {
        for unit in [Units::Mm, Units::Cm, Units::M, Units::In] {
            assert_eq!(unit.symbol().parse::<Units>(), Ok(unit));
            assert_eq!(serde_json::to_string(&unit).unwrap(), format!("\"{unit}\""));
        }
        assert!((Units::In.metres() / Units::Mm.metres() - 25.4).abs() < 1e-12);
        assert!("ft".parse::<Units>().unwrap_err().to_string().contains("hint: use mm, cm, m or in"));
    }
}
