//! The body of a PLY file, number by number, ascii or binary alike.

use super::header::{Encoding, Scalar};
use crate::text::{Lines, Words, real, shown, whole};
use crate::{Place, ReadError};

/// Reads the numbers of the body in order.
pub(super) enum Body<'a> {
    Ascii { lines: Lines<'a>, words: Words<'a> },
    Binary { bytes: &'a [u8], at: usize, big: bool },
}

impl<'a> Body<'a> {
    pub fn new(bytes: &'a [u8], encoding: Encoding, at: usize, line: usize) -> Body<'a> {
        match encoding {
            Encoding::Ascii => Body::Ascii { lines: Lines::new(bytes, at, line), words: Words::new(b"") },
            _ => Body::Binary { bytes, at, big: encoding == Encoding::BigEndian },
        }
    }

    /// Where the next number stands.
    pub fn place(&self) -> Place {
        match self {
            Body::Ascii { lines, .. } => Place::Line(lines.number()),
            Body::Binary { at, .. } => Place::Byte(*at),
        }
    }

    /// Bytes that are left, of the whole file of `total` bytes.
    pub fn left(&self, total: usize) -> u64 {
        match self {
            Body::Ascii { lines, .. } => (total - lines.at()) as u64,
            Body::Binary { at, .. } => (total - at) as u64,
        }
    }

    /// Begins an element: in ascii each stands on its own line.
    pub fn begin(&mut self, element: &str) -> Result<(), ReadError> {
        if let Body::Ascii { lines, words } = self {
            *words = lines.next_words().ok_or_else(|| ReadError::Truncated {
                what: format!("element \"{element}\""),
                needed: 1,
                left: 0,
                place: Place::Line(lines.number()),
            })?;
        }
        Ok(())
    }

    /// `N` bytes of a binary body, as a number's little-endian bytes.
    fn take<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let Body::Binary { bytes, at, big } = self else { return Ok([0; N]) };
        let Some(found) = bytes.get(*at..*at + N).and_then(|b| <[u8; N]>::try_from(b).ok()) else {
            let left = (bytes.len() - *at) as u64;
            return Err(ReadError::Truncated {
                what: "a number".into(),
                needed: N as u64,
                left,
                place: Place::Byte(*at),
            });
        };
        *at += N;
        let mut number = found;
        if *big {
            number.reverse();
        }
        Ok(number)
    }

    fn word(&mut self) -> Result<Option<(&'a [u8], usize)>, ReadError> {
        let Body::Ascii { lines, words } = self else { return Ok(None) };
        match words.next() {
            Some(word) => Ok(Some((word, lines.number()))),
            None => Err(ReadError::Syntax {
                what: "the line has fewer numbers than the header says".into(),
                place: Place::Line(lines.number()),
            }),
        }
    }

    /// The next number, of the given type.
    pub fn real(&mut self, scalar: Scalar) -> Result<f64, ReadError> {
        if let Some((word, line)) = self.word()? {
            return real(word, || Place::Line(line));
        }
        Ok(match scalar {
            Scalar::I8 => i8::from_le_bytes(self.take()?) as f64,
            Scalar::U8 => u8::from_le_bytes(self.take()?) as f64,
            Scalar::I16 => i16::from_le_bytes(self.take()?) as f64,
            Scalar::U16 => u16::from_le_bytes(self.take()?) as f64,
            Scalar::I32 => i32::from_le_bytes(self.take()?) as f64,
            Scalar::U32 => u32::from_le_bytes(self.take()?) as f64,
            Scalar::F32 => f32::from_le_bytes(self.take()?) as f64,
            Scalar::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    /// The next number, which must be whole.
    pub fn whole(&mut self, scalar: Scalar) -> Result<i64, ReadError> {
        if let Some((word, line)) = self.word()? {
            return whole(word, || Place::Line(line));
        }
        Ok(match scalar {
            Scalar::I8 => i8::from_le_bytes(self.take()?) as i64,
            Scalar::U8 => u8::from_le_bytes(self.take()?) as i64,
            Scalar::I16 => i16::from_le_bytes(self.take()?) as i64,
            Scalar::U16 => u16::from_le_bytes(self.take()?) as i64,
            Scalar::I32 => i32::from_le_bytes(self.take()?) as i64,
            Scalar::U32 => u32::from_le_bytes(self.take()?) as i64,
            Scalar::F32 | Scalar::F64 => {
                let place = self.place();
                let value = self.real(scalar)?;
                if value.fract() != 0.0 || value.abs() > u32::MAX as f64 {
                    return Err(ReadError::Syntax { what: format!("{value} is not a whole number"), place });
                }
                value as i64
            }
        })
    }

    /// The count of a list, which the rest of the file must have room for.
    pub fn count(&mut self, count: Scalar, item: Scalar, total: usize) -> Result<usize, ReadError> {
        let place = self.place();
        let n = self.whole(count)?;
        if n < 0 {
            return Err(ReadError::Syntax { what: format!("a list has the count {n}"), place });
        }
        // In ascii the rest of the line bounds the list: it runs out of words.
        let needed = if let Body::Ascii { .. } = self { 0 } else { (n as u64).saturating_mul(item.size() as u64) };
        let left = self.left(total);
        if needed > left {
            return Err(ReadError::Truncated { what: format!("a list of {n} numbers"), needed, left, place });
        }
        Ok(n as usize)
    }

    /// Steps over `n` numbers.
    pub fn skip(&mut self, n: usize, scalar: Scalar) -> Result<(), ReadError> {
        match self {
            Body::Ascii { .. } => {
                for _ in 0..n {
                    self.word()?;
                }
            }
            Body::Binary { bytes, at, .. } => {
                let (needed, left) = (n as u64 * scalar.size() as u64, (bytes.len() - *at) as u64);
                if needed > left {
                    let place = Place::Byte(*at);
                    return Err(ReadError::Truncated { what: format!("{n} numbers"), needed, left, place });
                }
                *at += needed as usize;
            }
        }
        Ok(())
    }

    /// The next `n` bytes of a binary body; nothing if they are not all there or the body is ascii.
    pub fn block(&mut self, n: usize) -> Option<&'a [u8]> {
        let Body::Binary { bytes, at, .. } = self else { return None };
        let block = bytes.get(*at..at.checked_add(n)?)?;
        *at += n;
        Some(block)
    }
}

/// What a word is that stands where none should.
pub(super) fn unexpected(word: &[u8]) -> String {
    format!("\"{}\" follows the last element", shown(word))
}
