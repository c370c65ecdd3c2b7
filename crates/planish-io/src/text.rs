//! Lines and numbers of text formats, over bytes that need not be UTF-8.

use crate::{Place, ReadError};

/// Lines of a text, with their number from 1. Ends of line are `\n`, `\r\n` and `\r`.
pub(crate) struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    number: usize,
}

impl<'a> Lines<'a> {
    /// Lines of `bytes` from byte `at` on, which begins line `number`.
    pub fn new(bytes: &'a [u8], at: usize, number: usize) -> Lines<'a> {
        Lines { bytes, at, number: number - 1 }
    }

    /// Number of the line given last.
    pub fn number(&self) -> usize {
        self.number
    }

    /// Byte at which the next line begins.
    pub fn at(&self) -> usize {
        self.at
    }

    /// The next line, without its end.
    pub fn next_line(&mut self) -> Option<&'a [u8]> {
        if self.at >= self.bytes.len() {
            return None;
        }
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(rest.len());
        let skip = if rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
        self.at += (end + skip).min(rest.len());
        self.number += 1;
        Some(&rest[..end])
    }

    /// The words of the next line that has any.
    pub fn next_words(&mut self) -> Option<Words<'a>> {
        loop {
            let line = self.next_line()?.trim_ascii();
            if !line.is_empty() {
                return Some(Words { rest: line });
            }
        }
    }
}

/// Words of one line, split at blanks.
#[derive(Clone)]
pub(crate) struct Words<'a> {
    rest: &'a [u8],
}

impl<'a> Words<'a> {
    /// The words of `line`.
    pub fn new(line: &'a [u8]) -> Words<'a> {
        Words { rest: line }
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let start = self.rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let rest = &self.rest[start..];
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.rest = &rest[end..];
        Some(&rest[..end])
    }
}

/// A word for a message: at most 32 characters, without control characters.
pub(crate) fn shown(word: &[u8]) -> String {
    String::from_utf8_lossy(&word[..word.len().min(32)])
        .chars()
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect()
}

/// A real number (also `nan` and `inf`, which the caller refuses where they do harm).
pub(crate) fn real(word: &[u8], place: impl FnOnce() -> Place) -> Result<f64, ReadError> {
    std::str::from_utf8(word)
        .ok()
        .and_then(|text| text.parse().ok())
        .ok_or_else(|| ReadError::Syntax { what: format!("\"{}\" is not a number", shown(word)), place: place() })
}

/// A whole number.
pub(crate) fn whole(word: &[u8], place: impl FnOnce() -> Place) -> Result<i64, ReadError> {
    std::str::from_utf8(word)
        .ok()
        .and_then(|text| text.parse().ok())
        .ok_or_else(|| ReadError::Syntax { what: format!("\"{}\" is not a whole number", shown(word)), place: place() })
}
