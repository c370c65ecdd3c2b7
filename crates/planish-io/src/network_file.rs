//! `NETWORK.json`: corners, curves and patches on a mesh, one of them per line, so that a network can be read,
//! compared and edited with ordinary tools.
//!
//! Places are `{"face": f, "bary": [a, b, c]}` on the mesh as repair leaves it; how many vertices and triangles
//! that one has is in the head, so that a network is not taken for that of another mesh.

use crate::{WriteError, atomic};
use planish::mesh::{FacePoint, TriMesh};
use planish::network::{Corner, Curve, Network, Patch};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;

/// What the file says it is.
const FORMAT: &str = "planish network";
/// Version of the format: raised when a reader of the old one would misread the new.
const VERSION: u32 = 1;
/// Barycentric coordinates written with fewer digits than `f64` has still sum to one within this.
const BARY_SLACK: f64 = 1e-6;

/// Why a network could not be read. Shown as `what is wrong (where) - hint: what to do`.
#[derive(Debug, thiserror::Error)]
pub enum NetworkFileError {
    /// The operating system does not give the file.
    #[error("cannot read it: {0} - hint: check the name and the permissions")]
    Io(#[from] std::io::Error),
    /// Not JSON, or not of this shape.
    #[error("is no network: {what} (line {line}, column {column}) - hint: `planish layout` writes one to start from")]
    Syntax {
        /// What is wrong.
        what: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
    },
    /// Another kind of file, or a newer version.
    #[error(
        "is \"{format}\" version {version}, not \"{FORMAT}\" version {VERSION} - hint: write it with this version of planish"
    )]
    Format {
        /// Format found.
        format: String,
        /// Version found.
        version: u32,
    },
    /// Made for another mesh.
    #[error(
        "was made for a mesh of {found} {what}, this one has {wanted} - hint: use it with the mesh that it was made for"
    )]
    OtherMesh {
        /// `triangles` or `vertices`.
        what: &'static str,
        /// Number in the file.
        found: usize,
        /// Number of the mesh.
        wanted: usize,
    },
    /// A part refers to something that is not there, or parts do not join.
    #[error("{what} ({place}) - hint: {hint}")]
    Part {
        /// What is wrong.
        what: String,
        /// The corner, curve or patch.
        place: String,
        /// What to do.
        hint: &'static str,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default = "usual_format")]
    format: String,
    #[serde(default = "usual_version")]
    version: u32,
    mesh: Option<Head>,
    corners: Vec<Corner>,
    curves: Vec<Curve>,
    patches: Vec<Patch>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    vertices: usize,
    triangles: usize,
}

fn usual_format() -> String {
    FORMAT.into()
}

fn usual_version() -> u32 {
    VERSION
}

/// Writes `network` on `mesh`. The file appears whole or not at all.
/// # Errors
/// If the file cannot be written.
pub fn write_network(path: impl AsRef<Path>, network: &Network, mesh: &TriMesh) -> Result<(), WriteError> {
    atomic::write(path.as_ref(), |out| Ok(out.write_all(network_json(network, mesh).as_bytes())?))
}

/// The text that [`write_network`] writes.
pub fn network_json(network: &Network, mesh: &TriMesh) -> String {
    let head = Head { vertices: mesh.points.len(), triangles: mesh.triangles.len() };
    let mut text = format!("{{\n\"format\": \"{FORMAT}\",\n\"version\": {VERSION},\n\"mesh\": {},\n", line(&head));
    list(&mut text, "corners", &network.corners, ",");
    list(&mut text, "curves", &network.curves, ",");
    list(&mut text, "patches", &network.patches, "");
    text += "}\n";
    text
}

fn list<T: Serialize>(text: &mut String, name: &str, items: &[T], after: &str) {
    *text += &format!("\"{name}\": [\n");
    for (i, item) in items.iter().enumerate() {
        *text += &line(item);
        *text += if i + 1 < items.len() { ",\n" } else { "\n" };
    }
    *text += &format!("]{after}\n");
}

/// One item; numbers and names always become text.
fn line<T: Serialize>(item: &T) -> String {
    serde_json::to_string(item).unwrap_or_default()
}

/// Reads a network on `mesh` and checks that its parts exist and join.
/// # Errors
/// Everything that [`NetworkFileError`] lists.
pub fn read_network(path: impl AsRef<Path>, mesh: &TriMesh) -> Result<Network, NetworkFileError> {
    parse_network(&crate::mesh_file::bytes_of(path.as_ref())?, mesh)
}

/// Reads a network from the text of its file, as [`read_network`].
/// # Errors
/// Everything that [`NetworkFileError`] lists but `Io`.
pub fn parse_network(text: &[u8], mesh: &TriMesh) -> Result<Network, NetworkFileError> {
    let file: File = serde_json::from_slice(text).map_err(|e| {
        let what = e.to_string();
        let what = what.rsplit_once(" at line ").map_or(what.as_str(), |(what, _)| what).to_owned();
        NetworkFileError::Syntax { what, line: e.line(), column: e.column() }
    })?;
    if file.format != FORMAT || file.version > VERSION {
        return Err(NetworkFileError::Format { format: file.format, version: file.version });
    }
    if let Some(head) = &file.mesh {
        let counts =
            [("triangles", head.triangles, mesh.triangles.len()), ("vertices", head.vertices, mesh.points.len())];
        if let Some(&(what, found, wanted)) = counts.iter().find(|(_, found, wanted)| found != wanted) {
            return Err(NetworkFileError::OtherMesh { what, found, wanted });
        }
    }
    let network = Network { corners: file.corners, curves: file.curves, patches: file.patches };
    check(&network, mesh)?;
    Ok(network)
}

fn part(what: String, place: String, hint: &'static str) -> NetworkFileError {
    NetworkFileError::Part { what, place, hint }
}

/// Checks that all parts exist and join: whatever later stages index is there.
fn check(network: &Network, mesh: &TriMesh) -> Result<(), NetworkFileError> {
    if network.patches.is_empty() {
        return Err(part("it has no patch".into(), "patches".into(), "`planish layout` writes one to start from"));
    }
    for (c, corner) in network.corners.iter().enumerate() {
        check_place(&corner.place, mesh, || format!("corner {c}"))?;
    }
    for (c, curve) in network.curves.iter().enumerate() {
        if let Some(missing) = curve.corners.iter().find(|&&k| k as usize >= network.corners.len()) {
            let what = format!("corner {missing} is not among the {} corners", network.corners.len());
            return Err(part(what, format!("curve {c}"), "name a corner that exists"));
        }
        if curve.points.len() < 2 {
            let what = format!("it has {} points", curve.points.len());
            return Err(part(what, format!("curve {c}"), "give its points from corner to corner, both included"));
        }
        for (i, point) in curve.points.iter().enumerate() {
            check_place(point, mesh, || format!("curve {c}, point {i}"))?;
        }
    }
    for (p, patch) in network.patches.iter().enumerate() {
        for (k, side) in patch.sides.iter().enumerate() {
            if side.curve as usize >= network.curves.len() {
                let what = format!("curve {} is not among the {} curves", side.curve, network.curves.len());
                return Err(part(what, format!("patch {p}, side {k}"), "name a curve that exists"));
            }
        }
        for k in 0..4 {
            let side = patch.sides[k];
            let end = network.curves[side.curve as usize].corners[!side.reversed as usize];
            let start = network.corner(p, (k + 1) % 4);
            if end != start {
                let what = format!("it ends at corner {end} but the next side starts at corner {start}");
                let hint = "list the four sides counter-clockwise and mark those that run against their curve";
                return Err(part(what, format!("patch {p}, side {k}"), hint));
            }
        }
    }
    Ok(())
}

fn check_place(point: &FacePoint, mesh: &TriMesh, name: impl Fn() -> String) -> Result<(), NetworkFileError> {
    if point.face as usize >= mesh.triangles.len() {
        let what = format!("face {} is not among the {} faces of the mesh", point.face, mesh.triangles.len());
        return Err(part(what, name(), "use the network with the mesh that it was made for"));
    }
    let sum: f64 = point.bary.iter().sum();
    if !point.bary.iter().all(|b| *b >= 0.0) || (sum - 1.0).abs() > BARY_SLACK {
        let what = format!("barycentric coordinates {:?} are not three weights that sum to 1", point.bary);
        return Err(part(what, name(), "give weights from 0 to 1 that sum to 1"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use planish::network::{CurveKind, Side};

    /// Two triangles and the four-sided patch that they are.
    fn square() -> (TriMesh, Network) {
        let points = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
        let mesh = TriMesh::new(points.into(), vec![[0, 1, 2], [0, 2, 3]]);
        let places = [(0, 0), (0, 1), (0, 2), (1, 2)].map(|(face, k)| FacePoint::corner(face, k));
        let curve = |a: usize, b: usize, points: [FacePoint; 2]| Curve {
            corners: [a as u32, b as u32],
            kind: CurveKind::Boundary,
            points: points.into(),
        };
        let on = FacePoint::corner;
        let network = Network {
            corners: places.iter().map(|&place| Corner { place }).collect(),
            curves: vec![
                curve(0, 1, [on(0, 0), on(0, 1)]),
                curve(1, 2, [on(0, 1), on(0, 2)]),
                curve(2, 3, [on(1, 1), on(1, 2)]),
                curve(0, 3, [on(1, 0), on(1, 2)]),
            ],
            patches: vec![Patch { sides: [0, 1, 2, 3].map(|c| Side { curve: c, reversed: c == 3 }) }],
        };
        (mesh, network)
    }

    #[test]
    fn a_network_reads_back_bit_for_bit() {
        let (mesh, mut network) = square();
        network.corners[0].place.bary = [1.0 / 3.0, 0.1, 1.0 - 1.0 / 3.0 - 0.1];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("n.json");
        write_network(&path, &network, &mesh).unwrap();
        assert_eq!(read_network(&path, &mesh).unwrap(), network);
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 4 + (4 + 4 + 1) + 2 * 3 + 1);
    }

    #[test]
    fn parts_that_do_not_exist_or_do_not_join_are_named() {
        let (mesh, good) = square();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("n.json");
        type Spoil = fn(&mut Network);
        let faults: [(&str, Spoil); 6] = [
            ("corner 1", |n| n.corners[1].place.face = 2),
            ("curve 2, point 0", |n| n.curves[2].points[0].bary = [0.5, 0.0, 0.0]),
            ("curve 3", |n| n.curves[3].corners[1] = 4),
            ("curve 0", |n| n.curves[0].points.truncate(1)),
            ("patch 0, side 1", |n| n.patches[0].sides[1].curve = 9),
            ("patch 0, side 2", |n| n.patches[0].sides[3].reversed = false),
        ];
        for (place, spoil) in faults {
            let mut network = good.clone();
            spoil(&mut network);
            write_network(&path, &network, &mesh).unwrap();
            let text = read_network(&path, &mesh).unwrap_err().to_string();
            assert!(text.contains(&format!("({place})")), "{place}: {text}");
        }
    }

    #[test]
    fn a_network_for_a_mesh_of_3_triangles_is_refused_on_one_of_2() {
        let (mesh, network) = square();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("n.json");
        let mut other = mesh.clone();
        other.triangles.push([0, 1, 3]);
        write_network(&path, &network, &other).unwrap();
        let error = read_network(&path, &mesh).unwrap_err();
        assert!(matches!(error, NetworkFileError::OtherMesh { what: "triangles", found: 3, wanted: 2 }), "{error}");
    }
}
