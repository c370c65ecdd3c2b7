//! Paints a feature curve of a patch ([K98] §5.10.1).

use super::forget_cells;
use crate::curve::PaintMode;
use crate::edit::check;
use crate::edit::stroke::Brush;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Magnetism, Spot};
use crate::grid::{Family, FeatureCurve, family_of};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A feature curve of a patch, painted through picks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Feature {
    /// The picks, from side to side; the patch is that of the middle one.
    pub picks: Vec<Spot>,
    /// Which iso-curves it is one of; absent to tell it by the sides that its ends lie nearest to.
    #[serde(default)]
    pub family: Option<Family>,
    /// How the way between picks is found.
    #[serde(default)]
    pub mode: PaintMode,
    /// What a magnetic stroke is drawn to.
    #[serde(default)]
    pub magnet: Option<Magnetism>,
}

impl Command for Feature {
    fn check(&self) -> Result<(), ApplyError> {
        check::picks(&self.picks)?;
        check::magnetism(self.magnet.as_ref(), self.mode)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let brush = Brush { mode: self.mode, magnet: self.magnet.as_ref(), snap: 0.0 };
        let curve = work.stroke(&self.picks, false, &brush)?;
        let middle = curve.points[curve.points.len() / 2];
        let (patch, cut) = work.patch_at(&middle)?;
        let family = self.family.unwrap_or_else(|| family_of(work.mesh(), &cut, &curve.points));
        let sketch = &mut work.drawing.sketch;
        sketch.features.push(FeatureCurve { patch, family, points: curve.points });
        forget_cells(&mut sketch.sections, patch, family);
        work.check_features(patch, &cut)
    }
}
