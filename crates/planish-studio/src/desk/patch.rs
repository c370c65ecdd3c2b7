//! What is asked of single patches and curves: sizes tried on one patch, control vertices of a curve, displacement maps.

use super::Table;
use super::beside::Shown;
use super::jobs::Outcome;
use super::project::NO_PROJECT;
use crate::protocol::{Message, Why};
use crate::web::hub::Client;
use planish::DVec3;
use planish::edit::{CurveName, handles};
use planish::grid::Grid;
use planish::observe::Observer;
use planish::relief::{Displaced, Relief, layers};
use planish::surface::{self, FitError, deviation_of};
use std::sync::Arc;

/// Texels along a side of a map that is sent, at most: as many as a panel has pixels.
const MOST_TEXELS: usize = 257;
const NO_PATCH: &str = "there is no surface of this patch yet - hint: fit surfaces first";

/// One patch fitted alone.
struct Alone {
    control: [usize; 2],
    rms: f64,
    max: f64,
}

fn alone(grid: &Grid, [u, v]: [usize; 2]) -> Result<Alone, FitError> {
    let fitted = surface::fit(&grid.points, grid.rows, grid.cols, [v.min(grid.rows), u.min(grid.cols)])?;
    let found = deviation_of(&fitted, grid);
    Ok(Alone { control: [fitted.cols, fitted.rows], rms: found.rms, max: found.max })
}

/// The fewest control points, as many more along one side as along the other, that keep a tolerance.
fn fewest(grid: &Grid, tolerance: f64) -> Result<Alone, FitError> {
    let mut control = [4, 4];
    loop {
        let now = alone(grid, control)?;
        let most = [grid.cols, grid.rows];
        if now.rms <= tolerance || control == most {
            return Ok(now);
        }
        // The direction that gains more goes on; each step adds about a quarter, as the ladder of a fit does.
        let more = |k: usize| {
            let mut next = control;
            next[k] = (control[k] + control[k].div_ceil(4)).min(most[k]);
            next
        };
        let tried = [alone(grid, more(0))?, alone(grid, more(1))?];
        let better = usize::from(tried[1].rms < tried[0].rms);
        control = if more(better) == control { more(1 - better) } else { more(better) };
    }
}

impl<'env> Table<'_, '_, 'env> {
    /// Tries numbers of control points on one patch.
    pub(super) fn try_patch(
        &mut self,
        client: &Client,
        id: u32,
        patch: u32,
        control: Option<[usize; 2]>,
        tolerance: Option<f64>,
    ) {
        let fit = self.project.as_ref().and_then(|p| p.fit.as_ref()).map(|f| f.model.clone());
        let Some(grid) = fit.as_ref().and_then(|m| m.grids.get(patch as usize)) else {
            return self.refuse(client, id, Why::of(NO_PATCH));
        };
        let tried = match (control, tolerance) {
            (Some(control), _) => alone(grid, control),
            (None, Some(tolerance)) => fewest(grid, tolerance),
            (None, None) => return self.refuse(client, id, Why::of("neither numbers nor a tolerance are given")),
        };
        match tried {
            Ok(Alone { control, rms, max }) => {
                self.desk.hub.tell(client, &Message::TriedPatch { id, control, rms, max });
            }
            Err(why) => self.refuse(client, id, Why::of(why)),
        }
    }

    /// Sends the control vertices of a curve.
    pub(super) fn handles(&mut self, client: &Client, id: u32, curve: &CurveName, control: usize) {
        let (Some(project), Some(ground)) = (&*self.project, self.ground) else {
            return self.refuse(client, id, Why::of(NO_PROJECT));
        };
        match handles(&project.model.drawing(), curve, control, ground) {
            Ok(points) => {
                let points = points.iter().map(|p| p.to_array()).collect();
                self.desk.hub.tell(client, &Message::Handles { id, points });
            }
            Err(why) => self.refuse(client, id, Why::of(why)),
        }
    }

    /// Sends the displacement map of a patch.
    pub(super) fn map(&mut self, client: &Client, id: u32, patch: u32) {
        let fit = self.project.as_ref().and_then(|p| p.fit.as_ref());
        let Some(relief) = fit.and_then(|f| f.shown().get(patch as usize)) else {
            return self.refuse(client, id, Why::of(NO_PATCH));
        };
        let shown = |count: usize| super::tessellate::even(count, MOST_TEXELS);
        let (us, vs) = (shown(relief.cols), shown(relief.rows));
        let at = |i: usize, j: usize| relief.vectors[j * relief.cols + i];
        let heights = vs.iter().flat_map(|&j| us.iter().map(move |&i| at(i, j).z as f32)).collect();
        let squares: f64 = relief.vectors.iter().map(|d| d.length_squared()).sum();
        let rms = (squares / relief.vectors.len().max(1) as f64).sqrt();
        let most = relief.vectors.iter().map(|d: &DVec3| d.length()).fold(0.0, f64::max);
        let (cols, rows) = (us.len() as u32, vs.len() as u32);
        self.desk.hub.tell(client, &Message::Map { id, cols, rows, heights, rms, most });
    }

    /// Shows all waves of the reliefs, or only those shorter than `longest`.
    pub(super) fn relief(&mut self, client: &Client, id: u32, longest: Option<f64>) {
        let fit = self.project.as_mut().and_then(|p| p.fit.as_mut());
        let Some(fit) = fit else { return self.refuse(client, id, Why::of(NO_PATCH)) };
        let Some(longest) = longest else {
            fit.short = None;
            self.desk.layers.new_relief();
            self.done(client, id, String::new());
            return self.tell_state();
        };
        if !(longest > 0.0 && longest.is_finite()) {
            return self.refuse(client, id, Why::of("a wavelength is a length above 0"));
        }
        let (model, revision) = (fit.model.clone(), fit.revision);
        self.desk.jobs.stop_kind("relief");
        let job = self.desk.jobs.start(self.scope, ("relief", "Parting waves"), move |watch| {
            let observer: &dyn Observer = watch;
            let (network, surfaces, reliefs) = (&model.network, &model.surfaces[..], &model.reliefs[..]);
            let split = layers::split(&Displaced { network, surfaces, reliefs }, &[longest], observer);
            let short = split.map(|mut bands| bands.pop().map_or_else(Vec::new, |b| b.maps));
            Outcome::Parted(
                short.map_err(|e| e.to_string()).map(|maps| (revision, Shown { longest, maps: Arc::new(maps) })),
            )
        });
        self.wait_for(client, id, job);
    }

    /// Takes over parted reliefs.
    pub(super) fn parted(&mut self, revision: u64, shown: Shown) {
        if let Some(fit) = self.project.as_mut().and_then(|p| p.fit.as_mut())
            && fit.revision == revision
        {
            fit.short = Some(shown);
            self.desk.layers.new_relief();
        }
    }
}

impl super::project::Fit {
    /// Reliefs as they are shown.
    pub(super) fn shown(&self) -> &[Relief] {
        self.short.as_ref().map_or(&self.model.reliefs, |s| &s.maps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bump of a wave along u alone.
    fn wavy() -> Grid {
        let (rows, cols) = (33, 65);
        let at = |k: usize| {
            let (x, y) = ((k % cols) as f64 / (cols - 1) as f64, (k / cols) as f64 / (rows - 1) as f64);
            DVec3::new(x, y, 0.05 * (12.0 * x).sin())
        };
        Grid { rows, cols, points: (0..rows * cols).map(at).collect(), ..Grid::default() }
    }

    #[test]
    fn a_tolerance_on_one_patch_takes_points_along_the_waves_and_4_across() {
        let grid = wavy();
        let found = fewest(&grid, 1e-4).unwrap();
        assert!(found.rms <= 1e-4 && found.control[0] > 8, "{} {:?}", found.rms, found.control);
        assert_eq!(found.control[1], 4);
        let coarse = alone(&grid, [4, 4]).unwrap();
        assert!(coarse.rms > 1e-3 && coarse.max >= coarse.rms);
    }
}
