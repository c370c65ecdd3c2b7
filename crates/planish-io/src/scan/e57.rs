//! E57: scans with poses (ASTM E2807). All scans of a file become one cloud, and a cloud of several stations becomes as
//! many scans, each in the coordinates of its scanner.

use super::{Ending, PIECE, Take, check_mark, column, foreign, guarded};
use crate::{Place, ReadError, WriteError};
use e57::{
    CartesianCoordinate, E57Reader, E57Writer, Quaternion, Record, RecordName, RecordValue, Transform, Translation,
};
use glam::DVec3;
use planish::cloud::Cloud;
use std::fs::File;
use std::io::{BufReader, Seek};
use std::path::Path;

/// How many points the scans of the file have by its header.
pub(super) fn told(file: BufReader<File>) -> Result<u64, ReadError> {
    guarded(move || Ok(E57Reader::new(file).map_err(foreign)?.pointclouds().iter().map(|scan| scan.records).sum()))
}

pub(super) fn pieces(mut file: BufReader<File>, take: &mut Take) -> Result<Ending, ReadError> {
    check_mark(&mut file, "E57", "ASTM-E57")?;
    let size = file.get_ref().metadata()?.len();
    file.rewind()?;
    guarded(move || {
        E57Reader::validate_crc(&mut file).map_err(|e| foreign(format!("a page is damaged: {e}")))?;
        file.rewind()?;
        let mut file = E57Reader::new(file).map_err(foreign)?;
        let mut scanners = Vec::new();
        let (mut has_color, mut has_intensity) = (false, false);
        for (k, scan) in file.pointclouds().into_iter().enumerate() {
            // A point takes at least one bit.
            if scan.records / 8 > size {
                let (what, needed) = (format!("scan {k} with {} points", scan.records), scan.records / 8);
                return Err(ReadError::Truncated { what, needed, left: size, place: Place::Item("scan", k) });
            }
            let origin = scan.transform.as_ref().map(|t| &t.translation).map(|t| DVec3::new(t.x, t.y, t.z));
            // Rows and columns are those of a station, which is its own origin where no pose moves it. Without either nobody
            // knows where the scanner stood.
            let grid =
                scan.prototype.iter().any(|r| r.name == RecordName::RowIndex || r.name == RecordName::ColumnIndex);
            let origin = origin.or(grid.then_some(DVec3::ZERO));
            let station = origin.map_or(u32::MAX, |o| {
                scanners.push(o);
                scanners.len() as u32 - 1
            });
            let mut points = file.pointcloud_simple(&scan).map_err(foreign)?;
            points.apply_pose(true);
            points.spherical_to_cartesian(true);
            let mut rest = points.peekable();
            while rest.peek().is_some() {
                let mut piece = Cloud { scanners: scanners.clone(), ..Cloud::default() };
                let (mut color, mut intensity) = (Vec::new(), Vec::new());
                for point in rest.by_ref().take(PIECE) {
                    let p = point.map_err(foreign)?;
                    let CartesianCoordinate::Valid { x, y, z } = p.cartesian else { continue };
                    piece.points.push(DVec3::new(x, y, z));
                    piece.seen_by.push(station);
                    has_color |= p.color.is_some();
                    has_intensity |= p.intensity.is_some();
                    color.extend(p.color.map_or([0.0; 3], |c| [c.red, c.green, c.blue]));
                    intensity.push(p.intensity.unwrap_or(0.0));
                }
                piece.attributes = vec![column("color", 3, color), column("intensity", 1, intensity)];
                take(piece)?;
            }
        }
        let bare = [("color", has_color), ("intensity", has_intensity)];
        Ok(Ending { bare: bare.into_iter().filter(|b| !b.1).map(|b| b.0).collect(), ..Ending::default() })
    })
}

/// Identifiers in a file written here: the content decides, so that the same cloud gives the same bytes.
fn guid(name: &str, count: usize) -> String {
    format!("{{planish-{name}-{count}}}")
}

/// * `metres` - what one unit of the cloud is
pub(super) fn write(path: &Path, world: &[DVec3], cloud: &Cloud, metres: f64) -> Result<(), WriteError> {
    let fault = |e: e57::Error| WriteError::Io(std::io::Error::other(e));
    let mut file = E57Writer::from_file(path, &guid("file", world.len())).map_err(fault)?;
    let color = cloud.attribute("color", 3);
    let intensity = cloud.attribute("intensity", 1);
    let mut prototype = vec![Record::CARTESIAN_X_F64, Record::CARTESIAN_Y_F64, Record::CARTESIAN_Z_F64];
    if color.is_some() {
        prototype.extend([Record::COLOR_RED_U8, Record::COLOR_GREEN_U8, Record::COLOR_BLUE_U8]);
    }
    if intensity.is_some() {
        prototype.push(Record::INTENSITY_UNIT_F32);
    }
    // Points of no known scanner are a scan without a pose.
    let station = |i: usize| match cloud.seen_by.get(i) {
        Some(&k) => Some(k as usize).filter(|&k| k < cloud.scanners.len()),
        None => (cloud.scanners.len() == 1).then_some(0),
    };
    let mut scans: Vec<(Option<usize>, Vec<usize>)> = (0..cloud.scanners.len()).map(|k| (Some(k), vec![])).collect();
    scans.push((None, Vec::new()));
    for i in 0..world.len() {
        scans[station(i).unwrap_or(cloud.scanners.len())].1.push(i);
    }
    for (number, (station, members)) in scans.into_iter().filter(|s| !s.1.is_empty()).enumerate() {
        let name = format!("scan-{number}");
        let mut scan = file.add_pointcloud(&guid(&name, members.len()), prototype.clone()).map_err(fault)?;
        scan.set_name(Some(format!("planish {name}")));
        let eye = station.map(|k| (cloud.scanners[k] + cloud.shift) * metres);
        if let Some(DVec3 { x, y, z }) = eye {
            let translation = Translation { x, y, z };
            scan.set_transform(Some(Transform { rotation: Quaternion::default(), translation }));
        }
        for i in members {
            let p = world[i] * metres - eye.unwrap_or(DVec3::ZERO);
            let mut values: Vec<RecordValue> = p.to_array().map(RecordValue::Double).into();
            if let Some(a) = color {
                let byte = |x: f32| RecordValue::Integer((x.clamp(0.0, 1.0) * 255.0).round() as i64);
                values.extend(a.values[3 * i..3 * i + 3].iter().map(|&x| byte(x)));
            }
            if let Some(a) = intensity {
                values.push(RecordValue::Single(a.values[i].clamp(0.0, 1.0)));
            }
            scan.add_point(values).map_err(fault)?;
        }
        scan.finalize().map_err(fault)?;
    }
    file.finalize().map_err(fault)
}
