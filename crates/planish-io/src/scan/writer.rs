//! Scans written piece by piece. Of PLY one piece is in memory at a time; other formats are written as a whole at the end.

use super::{PIECE, append, check, lower, write_scan_in, written_extension};
use crate::{Place, WriteError, atomic, ply};
use glam::DVec3;
use planish::Units;
use planish::cloud::Cloud;
use planish::mesh::Attribute;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// A scan on its way to a file, which appears at the end, with the same bytes as of [`super::write_scan_in`].
pub struct ScanWriter {
    path: PathBuf,
    units: Units,
    body: Body,
}

enum Body {
    /// Nothing came yet.
    Empty,
    /// PLY: how a point is written follows from all of them, so they wait in a file without a name.
    Waiting(Waiting),
    Whole(Cloud),
}

struct Waiting {
    file: BufWriter<File>,
    rows: ply::Rows,
    /// Name and width of the attributes.
    columns: Vec<(String, usize)>,
    count: usize,
}

impl ScanWriter {
    /// A scan without points.
    /// # Errors
    /// [`WriteError::UnknownExtension`].
    pub fn create(path: &Path, units: Units) -> Result<ScanWriter, WriteError> {
        written_extension(path)?;
        Ok(ScanWriter { path: path.to_path_buf(), units, body: Body::Empty })
    }

    /// Adds points; all pieces have the same attributes, scanners and shift.
    /// # Errors
    /// [`WriteError::Value`] for coordinates that are no numbers, or if there is no room for them.
    pub fn add(&mut self, piece: Cloud) -> Result<(), WriteError> {
        if piece.points.is_empty() {
            return Ok(());
        }
        check(&piece)?;
        if matches!(self.body, Body::Empty) {
            self.body = if lower(&self.path) == "ply" {
                let folder = self.path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
                let file = BufWriter::with_capacity(1 << 18, tempfile::tempfile_in(folder)?);
                let columns: Vec<(String, usize)> =
                    piece.attributes.iter().map(|a| (a.name.clone(), a.width)).collect();
                let rows = ply::Rows::new(columns.iter().map(|c| (&c.0[..], c.1)));
                Body::Waiting(Waiting { file, rows, columns, count: 0 })
            } else {
                Body::Whole(Cloud::default())
            };
        }
        match &mut self.body {
            Body::Empty => {}
            Body::Waiting(waiting) => waiting.add(&piece)?,
            Body::Whole(cloud) => append(cloud, piece),
        }
        Ok(())
    }

    /// Writes the file.
    /// # Errors
    /// [`WriteError::Nothing`] for no points, or if it cannot be written.
    pub fn finish(self) -> Result<(), WriteError> {
        match self.body {
            Body::Empty => Err(WriteError::Nothing("the scan has no points")),
            Body::Waiting(waiting) => atomic::write(&self.path, |out| waiting.write(out)),
            Body::Whole(cloud) => write_scan_in(&self.path, &cloud, self.units),
        }
    }
}

impl Waiting {
    fn add(&mut self, piece: &Cloud) -> Result<(), WriteError> {
        if !piece.attributes.iter().map(|a| (&a.name, a.width)).eq(self.columns.iter().map(|c| (&c.0, c.1))) {
            let what = "a piece of the scan has other attributes than the first one".into();
            return Err(WriteError::Inconsistent { what, place: Place::Vertex(self.count) });
        }
        let world: Vec<DVec3> = piece.points.iter().map(|&p| p + piece.shift).collect();
        self.rows.see(&world, &piece.attributes)?;
        ply::Rows::wide(self.columns.iter().map(|c| (&c.0[..], c.1))).write(
            &mut self.file,
            &world,
            &piece.attributes,
        )?;
        self.count += world.len();
        Ok(())
    }

    fn write(self, out: &mut impl Write) -> Result<(), WriteError> {
        let Waiting { file, rows, columns, count } = self;
        let mut file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
        file.rewind()?;
        let mut file = BufReader::with_capacity(1 << 18, file);
        rows.begin(out, count, super::GENERATOR)?;
        writeln!(out, "end_header")?;
        for from in (0..count).step_by(PIECE) {
            let (points, attributes) = next(&mut file, &columns, PIECE.min(count - from))?;
            rows.write(out, &points, &attributes)?;
        }
        Ok(())
    }
}

/// The next points that wait.
fn next(file: &mut impl Read, columns: &[(String, usize)], count: usize) -> io::Result<(Vec<DVec3>, Vec<Attribute>)> {
    let mut points = Vec::with_capacity(count);
    let column = |c: &(String, usize)| Attribute { name: c.0.clone(), width: c.1, values: Vec::new() };
    let mut attributes: Vec<Attribute> = columns.iter().map(column).collect();
    let (mut long, mut short) = ([0; 8], [0; 4]);
    for _ in 0..count {
        let mut p = [0.0; 3];
        for x in &mut p {
            file.read_exact(&mut long)?;
            *x = f64::from_le_bytes(long);
        }
        points.push(DVec3::from_array(p));
        for a in &mut attributes {
            for _ in 0..a.width {
                file.read_exact(&mut short)?;
                a.values.push(f32::from_le_bytes(short));
            }
        }
    }
    Ok((points, attributes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use planish::synthetic::{demo, even_scan};

    #[test]
    fn a_scan_in_pieces_has_the_bytes_of_the_whole_in_ply_and_las() {
        let mut scan = even_scan(&demo(1, 20_000), 40_000, 0.004, 1);
        scan.shift = DVec3::new(1000.0, 0.0, -3.0);
        let values = |k: usize, of: &dyn Fn(usize) -> f32| (0..k * scan.points.len()).map(of).collect();
        // Colours that are bytes up to the last point, and such that are.
        for last in [0.5, 1.0] {
            let mut colors: Vec<f32> = values(3, &|k| (k % 256) as f32 / 255.0);
            *colors.last_mut().unwrap() = last;
            scan.attributes = vec![
                Attribute { name: "color".into(), width: 3, values: colors },
                Attribute { name: "noise".into(), width: 1, values: values(1, &|k| (k as f32).sin()) },
            ];
            let room = tempfile::tempdir().unwrap();
            for extension in ["ply", "las"] {
                let [whole, pieces] = ["whole", "pieces"].map(|name| room.path().join(name).with_extension(extension));
                write_scan_in(&whole, &scan, Units::Mm).unwrap();
                let mut writer = ScanWriter::create(&pieces, Units::Mm).unwrap();
                for from in (0..scan.points.len() as u32).step_by(17_000) {
                    let ids: Vec<u32> = (from..(from + 17_000).min(scan.points.len() as u32)).collect();
                    writer.add(scan.select(&ids)).unwrap();
                }
                assert!(!pieces.exists());
                writer.finish().unwrap();
                assert!(std::fs::read(&whole).unwrap() == std::fs::read(&pieces).unwrap());
            }
        }
    }

    #[test]
    fn pieces_without_points_or_with_wild_ones_are_refused() {
        let room = tempfile::tempdir().unwrap();
        let path = room.path().join("scan.ply");
        let mut writer = ScanWriter::create(&path, Units::Mm).unwrap();
        writer.add(Cloud::default()).unwrap();
        let wild = writer.add(Cloud::new(vec![DVec3::NAN]));
        assert!(matches!(wild, Err(WriteError::Value { .. })));
        assert!(matches!(writer.finish(), Err(WriteError::Nothing(_))) && !path.exists());
        assert!(ScanWriter::create(&room.path().join("scan.pcd"), Units::Mm).is_err());
    }
}
