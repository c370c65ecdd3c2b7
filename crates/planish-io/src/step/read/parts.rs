//! The shells of a STEP file in their places: alone, or as parts of assemblies.
//!
//! A representation lists solids and shells. One that is only related to another describes the same part; one that is related to
//! it with a transformation, or mapped into it, is a part of it.

use super::entities::Entities;
use super::exchange::{Value, fault};
use super::shape::Frame;
use crate::{Place, ReadError};
use glam::DAffine3;
use std::collections::{BTreeMap, BTreeSet};

/// Parts in parts at most.
const MOST_DEEP: usize = 32;
/// Places of parts at most.
const MOST_PLACES: usize = 100_000;

/// Shells of one part in one place; with each, whether it is turned inside out, as those around voids are in their solid.
pub(super) struct Part {
    pub shells: Vec<(u64, bool)>,
    pub placement: DAffine3,
}

#[derive(Default)]
struct Assembly {
    /// What each representation lists.
    items: BTreeMap<u64, Vec<u64>>,
    /// Representations of the same part.
    same: BTreeMap<u64, Vec<u64>>,
    /// For each representation its parts, and where they are.
    parts: BTreeMap<u64, Vec<(u64, DAffine3)>>,
}

/// All parts of a file.
/// # Errors
/// Damaged records, parts in parts without end or in too many places.
pub(super) fn parts(entities: &Entities) -> Result<Vec<Part>, ReadError> {
    let assembly = Assembly::new(entities)?;
    let inner: BTreeSet<u64> = assembly.parts.values().flatten().map(|(part, _)| *part).collect();
    let mut seen = BTreeSet::new();
    let mut found = Vec::new();
    for &representation in assembly.items.keys() {
        let group = assembly.group(representation);
        let is_new = group.iter().all(|r| seen.insert(*r));
        if is_new && !group.iter().any(|r| inner.contains(r)) {
            assembly.place(entities, representation, DAffine3::IDENTITY, 0, &mut found)?;
        }
    }
    found.retain(|part: &Part| !part.shells.is_empty());
    if found.is_empty() {
        // No representation has any: those that are there.
        let shells = entities.file.of_type(|name| matches!(name, "CLOSED_SHELL" | "OPEN_SHELL"));
        found.push(Part { shells: shells.into_iter().map(|id| (id, false)).collect(), placement: DAffine3::IDENTITY });
    }
    Ok(found)
}

impl Assembly {
    fn new(entities: &Entities) -> Result<Assembly, ReadError> {
        let file = entities.file;
        let mut assembly = Assembly::default();
        for id in file.of_type(|name| name.ends_with("SHAPE_REPRESENTATION")) {
            let record = file.record(id)?;
            // The other kinds name places of representations.
            if let Ok(Value::List(_)) = record.value(1) {
                assembly.items.insert(id, record.references(record.value(1)?)?);
            }
        }
        for (&id, items) in &assembly.items {
            for &item in items {
                let record = file.record(item)?;
                if record.name() == "MAPPED_ITEM" {
                    let map = file.record(record.reference(record.value(1)?)?)?;
                    let [origin, mapped] = [0, 1].map(|k| map.reference(map.of("REPRESENTATION_MAP", k)?));
                    let placement = between(entities, origin?, record.reference(record.value(2)?)?)?;
                    assembly.parts.entry(id).or_default().push((mapped?, placement));
                }
            }
        }
        for id in
            file.of_type(|name| matches!(name, "REPRESENTATION_RELATIONSHIP" | "SHAPE_REPRESENTATION_RELATIONSHIP"))
        {
            let record = file.record(id)?;
            let own =
                if record.is("REPRESENTATION_RELATIONSHIP") { "REPRESENTATION_RELATIONSHIP" } else { record.name() };
            let [first, second] = [2, 3].map(|k| record.reference(record.of(own, k)?));
            let (first, second) = (first?, second?);
            const MOVED: &str = "REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION";
            if record.is(MOVED) {
                let by = file.record(record.reference(record.of(MOVED, 0)?)?)?;
                let [from, to] = [2, 3].map(|k| by.reference(by.of("ITEM_DEFINED_TRANSFORMATION", k)?));
                assembly.parts.entry(second).or_default().push((first, between(entities, from?, to?)?));
            } else {
                assembly.same.entry(first).or_default().push(second);
                assembly.same.entry(second).or_default().push(first);
            }
        }
        Ok(assembly)
    }

    /// The representations of the same part.
    fn group(&self, representation: u64) -> BTreeSet<u64> {
        let mut group = BTreeSet::from([representation]);
        let mut waiting = vec![representation];
        while let Some(next) = waiting.pop() {
            let same = self.same.get(&next).into_iter().flatten();
            waiting.extend(same.filter(|r| group.insert(**r)));
        }
        group
    }

    fn place(
        &self,
        entities: &Entities,
        representation: u64,
        placement: DAffine3,
        depth: usize,
        found: &mut Vec<Part>,
    ) -> Result<(), ReadError> {
        if depth > MOST_DEEP {
            return Err(fault(representation, "parts hold parts without end"));
        }
        let group = self.group(representation);
        let mut shells = Vec::new();
        for item in group.iter().filter_map(|r| self.items.get(r)).flatten() {
            shells_of(entities, *item, &mut shells)?;
        }
        if found.len() >= MOST_PLACES {
            let (count, limit) = (MOST_PLACES as u64 + 1, MOST_PLACES as u64);
            let place = Place::Item("entity", representation as usize);
            return Err(ReadError::TooLarge { what: "places of parts", count, limit, place });
        }
        found.push(Part { shells, placement });
        for (part, inside) in group.iter().filter_map(|r| self.parts.get(r)).flatten() {
            self.place(entities, *part, placement * *inside, depth + 1, found)?;
        }
        Ok(())
    }
}

/// What brings one placement onto another.
fn between(entities: &Entities, from: u64, to: u64) -> Result<DAffine3, ReadError> {
    let affine = |frame: Frame| DAffine3::from_mat3_translation(frame.axes, frame.origin);
    Ok(affine(entities.frame(to)?) * affine(entities.frame(from)?).inverse())
}

/// Adds the shells of an item of a representation; items of other kinds have none.
fn shells_of(entities: &Entities, item: u64, shells: &mut Vec<(u64, bool)>) -> Result<(), ReadError> {
    let record = entities.file.record(item)?;
    match record.name() {
        "MANIFOLD_SOLID_BREP" | "FACETED_BREP" => shells.push(oriented(entities, record.reference(record.value(1)?)?)?),
        "BREP_WITH_VOIDS" => {
            shells.push(oriented(entities, record.reference(record.value(1)?)?)?);
            for void in record.references(record.value(2)?)? {
                shells.push(oriented(entities, void)?);
            }
        }
        "SHELL_BASED_SURFACE_MODEL" | "FACE_BASED_SURFACE_MODEL" => {
            for shell in record.references(record.value(1)?)? {
                shells.push(oriented(entities, shell)?);
            }
        }
        _ => {}
    }
    Ok(())
}

/// A shell, or that which another one turns.
fn oriented(entities: &Entities, id: u64) -> Result<(u64, bool), ReadError> {
    let record = entities.file.record(id)?;
    match record.name() {
        "ORIENTED_CLOSED_SHELL" | "ORIENTED_OPEN_SHELL" => {
            Ok((record.reference(record.value(2)?)?, !record.flag(record.value(3)?)?))
        }
        _ => Ok((id, false)),
    }
}
