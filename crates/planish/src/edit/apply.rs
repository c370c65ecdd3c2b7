//! One edit made on a drawing, whole or not at all, or tried on a copy of it.
//!
//! See `docs/methods/curves.md`, "Networks", and `docs/guide/edit.md`.

use super::work::{Ground, Work};
use super::{ApplyError, Edit, Made, Others, keep};
use crate::edit::network::Editor;
use crate::model::Drawing;
use crate::observe::{Cancelled, Observer};

/// Makes one edit, and tells what it did. On an error the drawing is what it was. Patches are those of the curves
/// afterwards.
/// * `others` - models that [`Edit::Carry`] names
/// # Errors
/// See [`ApplyError`].
pub fn apply(
    drawing: &mut Drawing,
    edit: &Edit,
    ground: &Ground,
    others: &Others,
    observer: &dyn Observer,
) -> Result<Made, ApplyError> {
    let command = edit.command();
    command.check()?;
    let before = drawing.clone();
    let mut work = Work { ground, drawing, others, observer, relaxed: Vec::new(), images: None };
    let made = command.apply(&mut work);
    let (images, relaxed) = (work.images.take(), std::mem::take(&mut work.relaxed));
    if observer.cancelled() || made.is_err() {
        *drawing = before;
        return Err(made.err().unwrap_or(Cancelled.into()));
    }
    let canvas = &ground.canvas;
    let moved = drawing.network.corners != before.network.corners || drawing.network.curves != before.network.curves;
    let mut faults = None;
    if moved || images.is_some() {
        let mut editor = Editor::new(canvas.mesh, &canvas.adjacency, std::mem::take(&mut drawing.network));
        faults = Some(editor.diagnose().faults);
        drawing.network = editor.network;
        match &images {
            Some((plane, images)) => keep::mirror(ground, drawing, &before, plane, images),
            None => keep::keep(command.only_moves(), drawing, &before),
        }
    }
    Ok(Made { relaxed, faults, ..Made::between(&before, drawing) })
}

/// What an edit would make of a drawing: the drawing and what differs, without a word on what is left to put right. It leaves out
/// what takes time on the whole mesh, so that it follows a hand.
/// * `others` - models that [`Edit::Carry`] names
/// # Errors
/// See [`ApplyError`].
pub fn preview(
    drawing: &Drawing,
    edit: &Edit,
    ground: &Ground,
    others: &Others,
    observer: &dyn Observer,
) -> Result<(Drawing, Made), ApplyError> {
    let command = edit.command();
    command.check()?;
    let mut tried = drawing.clone();
    let mut work = Work { ground, drawing: &mut tried, others, observer, relaxed: Vec::new(), images: None };
    command.apply(&mut work)?;
    observer.check()?;
    let relaxed = std::mem::take(&mut work.relaxed);
    let made = Made { relaxed, ..Made::between(drawing, &tried) };
    Ok((tried, made))
}
