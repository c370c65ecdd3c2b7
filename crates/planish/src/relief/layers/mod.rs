//! Edits of a relief as layers: each is a relief of its own, and the sum of all is what displaces the surface.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §7.3 and 7.6: scaling, painting, thresholds,
//! compositing with an image, transfer.
//! 1. places and normals of all texels - `ground`      2. where an edit applies - `region`, `projection`
//! 3. strokes, stamps - `brush`, `chain`      4. wavelengths - `filter`, `bands`      5. the edits - `edit`
//! 6. from other patches and models - `transfer`, `warp`      7. more of a patch without repeats - `quilt`
//!
//! Departs from [K98]: edits do not change the image but lie above it, so each can be weakened or taken back; seams are
//! crossed, since distances are taken in space and both sides agree.

mod bands;
mod brush;
mod chain;
mod edit;
mod filter;
mod ground;
mod projection;
mod quilt;
mod region;
mod transfer;
mod warp;

pub use bands::{Band, split};
pub use brush::{Stamp, Stroke};
pub use edit::{
    Blur, Erase, Layered, Limit, ReliefEdit, Remove, Resample, Scale, Sharpen, Split, Threshold, Tile, edit,
};
pub use filter::Filter;
pub use ground::{Ground, Place};
pub use projection::{Picture, Pictures};
pub use quilt::Synthesise;
pub use region::Region;
pub use transfer::{paste, tile, transfer};
pub use warp::{PlacePair, Warp, warp};

use super::Relief;
use serde::{Deserialize, Serialize};

/// The layers of a model, with the stacks before and after. Maps stand once in a pool; a stack names them by number.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Layers {
    /// Maps of layers, one relief per patch; one without vectors displaces nothing.
    pub pool: Vec<Vec<Relief>>,
    /// The layers, the lowest first. Empty as long as nothing was edited.
    pub stack: Vec<Layer>,
    /// Stacks that can be gone back to, oldest first.
    pub undo: Vec<Past>,
    /// Stacks that were gone back from, the next one last.
    pub redo: Vec<Past>,
}

/// One layer.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layer {
    /// Its name.
    pub name: String,
    /// True for what was baked from the mesh (whole, or a band of it), false for an edit.
    pub baked: bool,
    /// What it is multiplied by.
    pub amount: f64,
    /// Its maps in the pool.
    pub maps: usize,
}

/// A stack of layers on the other side of an edit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Past {
    /// The edit, by its name.
    pub command: String,
    /// Its parameters as JSON.
    pub parameters: String,
    /// The stack.
    pub stack: Vec<Layer>,
}

/// Name of the lowest layer.
pub const BAKED: &str = "baked";

impl Layers {
    /// The stack of a model without layers: its relief.
    pub fn begin(&mut self, reliefs: &[Relief]) {
        if self.stack.is_empty() {
            self.stack = vec![self.added(BAKED, true, reliefs.to_vec())];
        }
    }

    /// A layer of new maps, not yet on the stack.
    pub fn added(&mut self, name: &str, baked: bool, maps: Vec<Relief>) -> Layer {
        self.pool.push(maps);
        Layer { name: name.into(), baked, amount: 1.0, maps: self.pool.len() - 1 }
    }

    /// Takes over an edited stack as one entry of the history; edits that were taken back can no longer be made again.
    pub fn record(&mut self, command: &str, parameters: &str, stack: Vec<Layer>) {
        let stack = std::mem::replace(&mut self.stack, stack);
        self.undo.push(Past { command: command.into(), parameters: parameters.into(), stack });
        self.redo.clear();
        self.prune();
    }

    /// Goes back by one edit. False if there is none.
    pub fn undo(&mut self) -> bool {
        exchange(&mut self.stack, &mut self.undo, &mut self.redo)
    }

    /// Makes the last edit that was taken back again. False if there is none.
    pub fn redo(&mut self) -> bool {
        exchange(&mut self.stack, &mut self.redo, &mut self.undo)
    }

    /// The sum of all layers; `None` if there are none.
    pub fn sum(&self) -> Option<Vec<Relief>> {
        Layers::sum_of(&self.pool, &self.stack)
    }

    /// The sum of a stack of layers whose maps stand in a pool; `None` if it is empty.
    fn sum_of(pool: &[Vec<Relief>], stack: &[Layer]) -> Option<Vec<Relief>> {
        let (first, above) = stack.split_first()?;
        let mut total = scaled(&pool[first.maps], first.amount);
        for layer in above {
            add(&mut total, &pool[layer.maps], layer.amount);
        }
        Some(total)
    }

    /// Takes a newly baked relief, of the shapes of the old one, for all layers that were baked before. Edits stay as layers; the
    /// stacks before and after belonged to other surfaces and are forgotten.
    pub fn rebake(&mut self, reliefs: Vec<Relief>) {
        let baked = self.added(BAKED, true, reliefs);
        let edits = self.stack.iter().filter(|l| !l.baked).cloned();
        self.stack = std::iter::once(baked).chain(edits).collect();
        (self.undo, self.redo) = Default::default();
        self.prune();
    }

    /// True if every stack names maps of the pool and these are one sound relief per patch: what comes from a file may not be.
    pub fn fits(&self, patches: usize) -> bool {
        let pasts = self.undo.iter().chain(&self.redo).flat_map(|p| &p.stack);
        let named = self.stack.iter().chain(pasts).all(|l| l.maps < self.pool.len() && l.amount.is_finite());
        let whole = |maps: &Vec<Relief>| {
            let sound =
                |r: &Relief| r.vectors.is_empty() || r.rows >= 2 && r.cols >= 2 && r.vectors.len() == r.rows * r.cols;
            maps.len() == patches && maps.iter().all(sound)
        };
        named && self.pool.iter().all(whole)
    }

    /// Forgets maps that no stack names.
    fn prune(&mut self) {
        let pasts = self.undo.iter().chain(&self.redo).flat_map(|p| &p.stack);
        let mut used = vec![false; self.pool.len()];
        self.stack.iter().chain(pasts).for_each(|l| used[l.maps] = true);
        let mut number = 0;
        let numbers: Vec<usize> = used.iter().map(|&u| (number, number += u as usize).0).collect();
        let mut keep = used.iter();
        self.pool.retain(|_| keep.next() == Some(&true));
        let pasts = self.undo.iter_mut().chain(&mut self.redo).flat_map(|p| &mut p.stack);
        self.stack.iter_mut().chain(pasts).for_each(|l| l.maps = numbers[l.maps]);
    }
}

fn exchange(stack: &mut Vec<Layer>, from: &mut Vec<Past>, to: &mut Vec<Past>) -> bool {
    let Some(mut past) = from.pop() else { return false };
    std::mem::swap(stack, &mut past.stack);
    to.push(past);
    true
}

fn scaled(maps: &[Relief], amount: f64) -> Vec<Relief> {
    let one = |r: &Relief| {
        let vectors = match (r.vectors.is_empty(), amount == 1.0) {
            (true, _) => vec![glam::DVec3::ZERO; r.rows * r.cols],
            (_, true) => r.vectors.clone(),
            _ => r.vectors.iter().map(|d| *d * amount).collect(),
        };
        Relief { vectors, ..*r }
    };
    maps.iter().map(one).collect()
}

/// Adds a layer to a sum of the same shapes.
pub(super) fn add(total: &mut [Relief], maps: &[Relief], amount: f64) {
    for (sum, more) in total.iter_mut().zip(maps) {
        sum.vectors.iter_mut().zip(&more.vectors).for_each(|(a, b)| *a += *b * amount);
    }
}
