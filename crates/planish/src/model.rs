//! A model: everything one project holds, from the mesh to the reliefs, and how it came to be.

use crate::grid::Grid;
use crate::mesh::TriMesh;
use crate::network::Network;
use crate::relief::Relief;
use crate::surface::Surface;
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
    /// One displacement map per patch.
    pub reliefs: Vec<Relief>,
    /// What one unit of a coordinate is.
    pub units: Units,
    /// Parameters of the stages that made the model, as one JSON object (empty: unknown).
    pub params: String,
    /// The commands that led here, oldest first.
    pub history: Vec<HistoryEntry>,
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
