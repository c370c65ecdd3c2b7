//! Range images with their poses: the `.conf` files of Stanford's scans, PLY views beside them, packed by gzip or not.
//!
//! `bmesh NAME tx ty tz qx qy qz qw` names a view; the quaternion is the inverse of the rotation of its points. A view is
//! seen along its own z axis, from above. Lines `mesh` count where no view is named `bmesh`; `camera` and others do not.

use super::column;
use crate::text::{Lines, shown};
use crate::{Place, ReadError, ply};
use glam::{DQuat, DVec3};
use planish::cloud::Cloud;
use planish::geom::Aabb;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

/// The scanner is this many sizes of the view away: how far it was is not told, and only directions matter.
const AWAY: f64 = 10.0;
/// Unpacked bytes of a view at most.
const LARGEST: u64 = 1 << 34;

/// A view that a line names.
struct View {
    name: String,
    rotation: DQuat,
    translation: DVec3,
    place: Place,
}

/// Reads all views beside a file that names them.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Cloud, ReadError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut cloud = Cloud::default();
    for view in &named(bytes)? {
        let mesh = ply::read_points(&content(view, folder)?).map_err(|e| companion(view, std::io::Error::other(e)))?;
        let place = |p: DVec3| view.rotation * p + view.translation;
        let bounds = Aabb::of(mesh.points.iter().filter(|p| p.is_finite()));
        if mesh.points.is_empty() {
            continue;
        }
        let first = cloud.scanners.is_empty();
        cloud.seen_by.extend(std::iter::repeat_n(cloud.scanners.len() as u32, mesh.points.len()));
        cloud.scanners.push(place(bounds.center() + AWAY * bounds.diagonal() * DVec3::Z));
        cloud.points.extend(mesh.points.iter().map(|&p| place(p)));
        let turned = mesh.attributes.into_iter().map(|mut a| {
            if a.name == "normal" && a.width == 3 {
                for n in a.values.chunks_exact_mut(3) {
                    let turned = view.rotation * DVec3::new(n[0].into(), n[1].into(), n[2].into());
                    n.copy_from_slice(&turned.as_vec3().to_array());
                }
            }
            a
        });
        // What not all views have is no attribute of the scan.
        let fresh: Vec<_> = turned.collect();
        if first {
            cloud.attributes = fresh;
            continue;
        }
        cloud.attributes = std::mem::take(&mut cloud.attributes)
            .into_iter()
            .filter_map(|a| {
                let more = fresh.iter().find(|f| f.name == a.name && f.width == a.width)?;
                Some(column(&a.name, a.width, [a.values, more.values.clone()].concat()))
            })
            .collect();
    }
    Ok(cloud)
}

/// The views of the lines `bmesh`, or of the lines `mesh`.
fn named(bytes: &[u8]) -> Result<Vec<View>, ReadError> {
    let (mut lines, mut views) = (Lines::new(bytes, 0, 1), Vec::new());
    while let Some(line) = lines.next_line() {
        let words: Vec<&[u8]> = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).collect();
        let Some(kind @ (b"bmesh" | b"mesh")) = words.first().copied() else { continue };
        let place = Place::Line(lines.number());
        let number = |w: &&[u8]| -> Option<f64> { std::str::from_utf8(w).ok()?.parse().ok() };
        let pose: Option<Vec<f64>> = words.iter().skip(2).map(number).collect();
        let Some(&[x, y, z, i, j, k, w]) = pose.as_deref() else {
            let what = format!("\"{}\" is no name with a translation and a quaternion", shown(line));
            return Err(ReadError::Syntax { what, place });
        };
        let turn = DQuat::from_xyzw(i, j, k, w);
        if !(turn.length() > 0.0 && turn.length().is_finite() && DVec3::new(x, y, z).is_finite()) {
            let what = format!("\"{}\" is no pose", shown(line));
            return Err(ReadError::Syntax { what, place });
        }
        let name = String::from_utf8_lossy(words[1]).into_owned();
        let rotation = turn.normalize().inverse();
        views.push((kind == b"bmesh", View { name, rotation, translation: DVec3::new(x, y, z), place }));
    }
    let range = views.iter().any(|v| v.0);
    let views: Vec<View> = views.into_iter().filter(|v| v.0 == range).map(|v| v.1).collect();
    if views.is_empty() {
        return Err(ReadError::Header {
            what: "no line names a view (\"bmesh NAME tx ty tz qx qy qz qw\")".into(),
            place: Place::Line(1),
            hint: "name the .conf file of a set of range images",
        });
    }
    Ok(views)
}

/// The bytes of a view, unpacked.
fn content(view: &View, folder: &Path) -> Result<Vec<u8>, ReadError> {
    let name = Path::new(&view.name);
    if !name.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir)) {
        return Err(ReadError::Unsupported {
            what: format!("the view \"{}\" outside the folder of the file", shown(view.name.as_bytes())),
            place: view.place.clone(),
            hint: "put the views beside the file",
        });
    }
    let plain = folder.join(name);
    let packed = PathBuf::from(format!("{}.gz", plain.display()));
    let bytes = crate::mesh_file::bytes_of(if plain.exists() || !packed.exists() { &plain } else { &packed });
    let bytes = bytes.map_err(|e| companion(view, e))?;
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(bytes);
    }
    let mut unpacked = Vec::new();
    let read = flate2::read::MultiGzDecoder::new(&bytes[..]).take(LARGEST).read_to_end(&mut unpacked);
    read.map_err(|e| companion(view, e))?;
    Ok(unpacked)
}

fn companion(view: &View, source: std::io::Error) -> ReadError {
    ReadError::Companion { name: view.name.clone(), source, place: view.place.clone() }
}
