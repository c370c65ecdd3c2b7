//! Geometry on its way to the page: arrays with a header, cut into pieces.
//!
//! A frame is the length of its header (four bytes, little-endian), the header as JSON, blanks up to a multiple of four
//! bytes, and a piece of the arrays. Pieces let messages pass in between.

use super::Layer;
use axum::body::Bytes;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Bytes of arrays in a frame at most.
const PIECE: usize = 1 << 20;

/// What a frame holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Which geometry.
    pub layer: Layer,
    /// Its name: the same name is the same geometry.
    pub name: String,
    /// Where in all its bytes this piece begins.
    pub offset: u64,
    /// All its bytes.
    pub total: u64,
    /// The arrays, one after the other, each from a multiple of four bytes on.
    pub arrays: Vec<Array>,
}

/// An array of a layer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Array {
    /// What it holds: `position`, `normal`, `index`, `offset` ...
    pub name: String,
    /// Type of its numbers.
    pub kind: Kind,
    /// Numbers per item.
    pub width: u32,
    /// Items.
    pub count: u64,
}

/// Type of the numbers of an array, little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Single precision.
    F32,
    /// Whole numbers.
    U32,
}

/// Arrays of a layer.
#[derive(Default)]
pub struct Arrays {
    arrays: Vec<Array>,
    bytes: Vec<u8>,
}

impl Arrays {
    /// Adds numbers of single precision.
    pub fn floats(&mut self, name: &str, width: u32, values: impl IntoIterator<Item = f32>) {
        let from = self.bytes.len();
        values.into_iter().for_each(|x| self.bytes.extend_from_slice(&x.to_le_bytes()));
        self.add(name, Kind::F32, width, from);
    }

    /// Adds whole numbers.
    pub fn numbers(&mut self, name: &str, width: u32, values: impl IntoIterator<Item = u32>) {
        let from = self.bytes.len();
        values.into_iter().for_each(|x| self.bytes.extend_from_slice(&x.to_le_bytes()));
        self.add(name, Kind::U32, width, from);
    }

    fn add(&mut self, name: &str, kind: Kind, width: u32, from: usize) {
        let count = ((self.bytes.len() - from) / 4) as u64 / width as u64;
        self.arrays.push(Array { name: name.into(), kind, width, count });
    }

    /// The frames that carry the arrays.
    pub fn frames(self, layer: Layer, name: &str) -> Vec<Bytes> {
        let total = self.bytes.len() as u64;
        let pieces: Vec<&[u8]> = if self.bytes.is_empty() { vec![&[]] } else { self.bytes.chunks(PIECE).collect() };
        let mut offset = 0;
        let mut frames = Vec::with_capacity(pieces.len());
        for piece in pieces {
            let header = Header { layer, name: name.into(), offset, total, arrays: self.arrays.clone() };
            let mut text = serde_json::to_vec(&header).unwrap_or_default();
            text.resize(text.len().next_multiple_of(4), b' ');
            let mut frame = Vec::with_capacity(4 + text.len() + piece.len());
            frame.extend_from_slice(&(text.len() as u32).to_le_bytes());
            frame.extend_from_slice(&text);
            frame.extend_from_slice(piece);
            frames.push(Bytes::from(frame));
            offset += piece.len() as u64;
        }
        frames
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_million_bytes_of_arrays_come_in_two_frames_that_join_again() {
        let mut arrays = Arrays::default();
        arrays.floats("position", 3, (0..300_000).map(|k| k as f32));
        arrays.numbers("index", 1, 0..200_000);
        let frames = arrays.frames(Layer::Mesh, "m1");
        assert_eq!(frames.len(), 2);
        let mut joined = Vec::new();
        for frame in &frames {
            let head = u32::from_le_bytes(frame[..4].try_into().unwrap()) as usize;
            assert_eq!(head % 4, 0);
            let header: Header = serde_json::from_slice(&frame[4..4 + head]).unwrap();
            assert_eq!((header.offset, header.total), (joined.len() as u64, 2_000_000));
            assert_eq!(header.arrays[0].count, 100_000);
            joined.extend_from_slice(&frame[4 + head..]);
        }
        assert_eq!(joined.len(), 2_000_000);
        assert_eq!(f32::from_le_bytes(joined[4 * 299_999..4 * 300_000].try_into().unwrap()), 299_999.0);
        assert_eq!(u32::from_le_bytes(joined[1_999_996..].try_into().unwrap()), 199_999);
    }
}
