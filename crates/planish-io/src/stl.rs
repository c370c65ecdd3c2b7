//! STL: loose triangles, ascii or binary.
//!
//! Own reader instead of a crate's: messages with line or byte, exact welding that no input makes slow, and the
//! count of a binary header checked against the file.

use crate::polygon::{Polygons, checked};
use crate::text::{Lines, real, shown};
use crate::weld::weld;
use crate::{Place, ReadError, WriteError};
use glam::DVec3;
use planish::mesh::TriMesh;
use std::io::Write;

/// Bytes before the first triangle of a binary file: 80 of free text and the count.
const HEAD: usize = 84;
/// Bytes of a triangle: normal, three corners, two bytes more.
const RECORD: usize = 50;

/// Reads a mesh; corners at exactly the same place become one vertex. The facets' own normals are not kept:
/// the corners say the same more exactly.
pub(crate) fn read(bytes: &[u8]) -> Result<TriMesh, ReadError> {
    let corners = if is_binary(bytes) { binary(bytes)? } else { ascii(bytes)? };
    if corners.len() >= u32::MAX as usize {
        let (count, limit) = (corners.len() as u64, u32::MAX as u64 - 1);
        return Err(ReadError::TooLarge { what: "corners", count, limit, place: Place::Byte(0) });
    }
    let (merged, source) = weld(&corners);
    let points: Vec<DVec3> = source.iter().map(|&v| corners[v as usize]).collect();
    let mut polygons = Polygons::with_capacity(corners.len() / 3);
    for triangle in merged.chunks_exact(3) {
        polygons.corners.extend(triangle);
        polygons.close();
    }
    let triangles = polygons.triangulate(&points, Place::Face)?;
    checked(TriMesh::new(points, triangles), polygons.count())
}

fn claimed(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(80..HEAD)?;
    Some(u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as u64)
}

/// True if the count of a binary header fits the length of the file exactly: then the free text may be
/// anything, also "solid", which begins an ascii file.
pub(crate) fn fits_binary(bytes: &[u8]) -> bool {
    claimed(bytes).is_some_and(|n| HEAD as u64 + n * RECORD as u64 == bytes.len() as u64)
}

fn is_binary(bytes: &[u8]) -> bool {
    // An ascii file has no zero byte; nearly every record of a binary one has two.
    fits_binary(bytes) || !bytes.trim_ascii_start().starts_with(b"solid") || bytes.contains(&0)
}

fn binary(bytes: &[u8]) -> Result<Vec<DVec3>, ReadError> {
    let truncated = |what: String, needed: u64, left: usize, at: usize| ReadError::Truncated {
        what,
        needed,
        left: left as u64,
        place: Place::Byte(at),
    };
    let Some(count) = claimed(bytes) else {
        return Err(truncated("the header of a binary STL".into(), HEAD as u64, bytes.len(), 0));
    };
    let body = &bytes[HEAD..];
    if count * RECORD as u64 > body.len() as u64 {
        return Err(truncated(format!("the claimed {count} triangles"), count * RECORD as u64, body.len(), 80));
    }
    let number = |r: &[u8], k: usize| f32::from_le_bytes([r[k], r[k + 1], r[k + 2], r[k + 3]]) as f64;
    let corner = |r: &[u8], k: usize| DVec3::new(number(r, k), number(r, k + 4), number(r, k + 8));
    let records = body.chunks_exact(RECORD).take(count as usize);
    Ok(records.flat_map(|r| [corner(r, 12), corner(r, 24), corner(r, 36)]).collect())
}

fn ascii(bytes: &[u8]) -> Result<Vec<DVec3>, ReadError> {
    let mut corners = Vec::new();
    let mut in_facet = 0;
    let mut lines = Lines::new(bytes, 0, 1);
    let mut closed = true;
    while let Some(mut words) = lines.next_words() {
        let place = || Place::Line(lines.number());
        match words.next().unwrap_or_default().to_ascii_lowercase().as_slice() {
            b"solid" => closed = false,
            b"endsolid" => closed = true,
            b"facet" => in_facet = 0,
            b"outer" | b"endloop" => {}
            b"vertex" => {
                let mut p = DVec3::ZERO;
                for k in 0..3 {
                    p[k] = real(words.next().unwrap_or_default(), place)?;
                }
                in_facet += 1;
                corners.push(p);
            }
            b"endfacet" => {
                if in_facet != 3 {
                    let what = format!("a facet has {in_facet} vertices instead of 3");
                    return Err(ReadError::Syntax { what, place: place() });
                }
                in_facet = 0;
            }
            other => {
                let what = format!("\"{}\" is no word of an ascii STL file", shown(other));
                return Err(ReadError::Syntax { what, place: place() });
            }
        }
    }
    if in_facet != 0 || !closed {
        let what = if closed { "the last facet" } else { "the solid, which has no \"endsolid\"," };
        let place = Place::Line(lines.number());
        return Err(ReadError::Truncated { what: what.into(), needed: 1, left: 0, place });
    }
    Ok(corners)
}

/// Writes a binary file. Its coordinates are `f32`: what they do not hold exactly is rounded.
pub(crate) fn write<W: Write>(out: &mut W, mesh: &TriMesh, generator: &str) -> Result<(), WriteError> {
    let Ok(count) = u32::try_from(mesh.triangles.len()) else {
        return Err(WriteError::Value {
            value: format!("{} triangles", mesh.triangles.len()),
            place: Place::Byte(80),
            hint: "an STL file holds at most 4294967295; write PLY",
        });
    };
    // Free text, which must not begin with "solid".
    let mut head = [b' '; 80];
    for (to, from) in head.iter_mut().zip(format!("binary STL, {generator}").bytes()) {
        *to = from;
    }
    out.write_all(&head)?;
    out.write_all(&count.to_le_bytes())?;
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t);
        let mut record = [0u8; RECORD];
        for (k, vector) in [mesh.normal(t), a, b, c].into_iter().enumerate() {
            for (j, x) in vector.to_array().into_iter().enumerate() {
                let at = 12 * k + 4 * j;
                record[at..at + 4].copy_from_slice(&(x as f32).to_le_bytes());
            }
        }
        out.write_all(&record)?;
    }
    Ok(())
}
