//! Figures of whether the surfaces of a model are sound: none turns over, none crosses another or itself.
//!
//! See `docs/methods/surfaces.md`, "Sound surfaces".

use super::hint::{across, few, in_script, relax_near};
use super::{Figure, PipelineError, Quality, Warning, key};
use crate::grid::Grid;
use crate::model::Model;
use crate::observe::{Cancelled, Observer, counted};
use crate::relief;
use crate::surface::{self, Crossing, Surface, Turning};
use rayon::prelude::*;

/// Facets that stand for all surfaces, about: as many as meet each other in a fraction of a second.
const FACETS: usize = 300_000;
/// Facets of a knot span along each direction, at most: a cubic with a turn of 30 degrees leaves their chords by less than 1/3000 of
/// the length of the span.
const CUTS_PER_SPAN: usize = 16;

/// Looks for surfaces that turn over or cross.
pub(super) fn figures(
    model: &Model,
    quality: &mut Quality,
    warnings: &mut Vec<Warning>,
    observer: &dyn Observer,
) -> Result<(), PipelineError> {
    let one = |(s, g): (&Surface, &Grid)| {
        observer.check()?;
        Ok(surface::turning(s, g))
    };
    let turns: Result<Vec<Turning>, Cancelled> = model.surfaces.par_iter().zip(&model.grids).map(one).collect();
    let turns = turns?;
    let count = |is: fn(&Turning) -> bool| Figure::Count(turns.iter().filter(|t| is(t)).count() as u64);
    quality.insert(key::SURFACE_TURNED.into(), count(|t| !t.over.is_empty()));
    quality.insert(key::SURFACE_UNPROVEN.into(), count(|t| t.over.is_empty() && !t.open.is_empty()));
    warnings.extend(turned(model, &turns));
    let spans = super::span_count(model).max(1);
    let cuts = (FACETS / 2 / spans).isqrt().clamp(1, CUTS_PER_SPAN);
    let shapes = relief::span_shapes(&model.surfaces, cuts);
    let patched = relief::surface_patches(&model.network, &model.surfaces, &shapes, observer)?;
    let found = surface::crossings(&model.surfaces, &patched.mesh, &patched.facets(), observer)?;
    let off = model.surfaces.par_iter().zip(&shapes).map(|(s, shape)| surface::facet_error(s, *shape));
    let off = off.collect::<Vec<_>>().into_iter().fold(0.0, f64::max);
    quality.insert(key::SURFACE_CROSSINGS.into(), Figure::Count(found.len() as u64));
    quality.insert(key::SURFACE_CROSSING_DEPTH.into(), Figure::Number(2.0 * off));
    warnings.extend(crossing(model, &found));
    Ok(())
}

/// Which patches turn over, with a place in each.
fn turned(model: &Model, turns: &[Turning]) -> Option<Warning> {
    let over: Vec<usize> = (0..turns.len()).filter(|&p| !turns[p].over.is_empty()).collect();
    // The first of those with the most places.
    let worst = *over.iter().max_by_key(|&&p| (turns[p].over.len(), std::cmp::Reverse(p)))?;
    let text = format!(
        "{} over against the grid somewhere. An iso-curve through the middle of the patch helps.",
        counted(over.len(), "surface turns", "surfaces turn")
    );
    let places: Vec<String> = over.iter().map(|&p| format!("patch {p} at {}", in_script(turns[p].over[0]))).collect();
    Some(Warning::new("surface_turned", text, few(&places)).with_step(across(&model.grids[worst])))
}

/// Which patches cross, with a place for each pair.
fn crossing(model: &Model, found: &[Crossing]) -> Option<Warning> {
    let first = found.first()?;
    let text = format!(
        "{} each other or themselves: programs that want a solid refuse them.",
        counted(found.len(), "pair of surfaces crosses", "pairs of surfaces cross")
    );
    let place = |c: &Crossing| match c.patches {
        [a, b] if a == b => format!("patch {a} itself at {}", in_script(c.place)),
        [a, b] => format!("patches {a} and {b} at {}", in_script(c.place)),
    };
    let places: Vec<String> = found.iter().map(place).collect();
    let [a, b] = first.patches;
    let step = if a == b { across(&model.grids[a as usize]) } else { relax_near(first.place) };
    Some(Warning::new("surface_crossings", text, few(&places)).with_step(step))
}
