//! The header of a PLY file: which elements follow, with which properties.

use crate::text::{Lines, Words, shown};
use crate::{Place, ReadError};

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a number in the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    pub fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    pub fn is_real(self) -> bool {
        matches!(self, Scalar::F32 | Scalar::F64)
    }

    fn named(word: &[u8]) -> Option<Scalar> {
        Some(match word {
            b"char" | b"int8" => Scalar::I8,
            b"uchar" | b"uint8" => Scalar::U8,
            b"short" | b"int16" => Scalar::I16,
            b"ushort" | b"uint16" => Scalar::U16,
            b"int" | b"int32" => Scalar::I32,
            b"uint" | b"uint32" => Scalar::U32,
            b"float" | b"float32" => Scalar::F32,
            b"double" | b"float64" => Scalar::F64,
            _ => return None,
        })
    }
}

/// What stands for one property: a number, or a count and that many numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    pub name: String,
    pub kind: Kind,
}

#[derive(Clone, Debug)]
pub(super) struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

impl Element {
    /// Bytes that one element takes at least.
    pub fn least_bytes(&self, encoding: Encoding) -> u64 {
        let binary = |p: &Property| match p.kind {
            Kind::One(scalar) => scalar.size() as u64,
            Kind::List { count, .. } => count.size() as u64,
        };
        match encoding {
            // A digit and a blank or an end of line each; the last one of the file may lack it.
            Encoding::Ascii => 2 * self.properties.len() as u64,
            _ => self.properties.iter().map(binary).sum(),
        }
    }

    /// Bytes of one element if it has no lists.
    pub fn fixed_bytes(&self) -> Option<usize> {
        self.properties.iter().try_fold(0, |sum, p| match p.kind {
            Kind::One(scalar) => Some(sum + scalar.size()),
            Kind::List { .. } => None,
        })
    }
}

#[derive(Debug)]
pub(super) struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// Byte and line at which the body begins.
    pub body: usize,
    pub body_line: usize,
}

fn wrong(what: String, line: usize, hint: &'static str) -> ReadError {
    ReadError::Header { what, place: Place::Line(line), hint }
}

const REWRITE: &str = "the header is damaged; write the file again from its source";

/// Reads the header of `bytes`, which begin with `ply`.
pub(super) fn header(bytes: &[u8]) -> Result<Header, ReadError> {
    let mut lines = Lines::new(bytes, 0, 1);
    lines.next_line();
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let Some(mut words) = lines.next_words() else {
            return Err(wrong("the header has no end_header".into(), lines.number(), REWRITE));
        };
        let line = lines.number();
        match words.next().unwrap_or_default() {
            b"comment" | b"obj_info" => {}
            b"format" => {
                encoding = Some(match words.next().unwrap_or_default() {
                    b"ascii" => Encoding::Ascii,
                    b"binary_little_endian" => Encoding::LittleEndian,
                    b"binary_big_endian" => Encoding::BigEndian,
                    other => return Err(wrong(format!("unknown encoding \"{}\"", shown(other)), line, REWRITE)),
                });
                // A missing version is let pass: it says nothing else.
                if let Some(version) = words.next().filter(|v| *v != b"1.0") {
                    let what = format!("version \"{}\" of PLY is unknown", shown(version));
                    return Err(wrong(what, line, "write the file as PLY 1.0"));
                }
            }
            b"element" => elements.push(element(words, line)?),
            b"property" => {
                let Some(element) = elements.last_mut() else {
                    return Err(wrong("a property stands before the first element".into(), line, REWRITE));
                };
                let property = property(words, line)?;
                if element.properties.iter().any(|p| p.name == property.name) {
                    return Err(wrong(format!("property \"{}\" stands twice", property.name), line, REWRITE));
                }
                element.properties.push(property);
            }
            b"end_header" => break,
            other => {
                return Err(wrong(format!("\"{}\" is no word of a PLY header", shown(other)), line, REWRITE));
            }
        }
    }
    let Some(encoding) = encoding else {
        return Err(wrong("the header has no format line".into(), lines.number(), REWRITE));
    };
    Ok(Header { encoding, elements, body: lines.at(), body_line: lines.number() + 1 })
}

fn element(mut words: Words, line: usize) -> Result<Element, ReadError> {
    let (name, count) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    match std::str::from_utf8(count).ok().and_then(|text| text.parse().ok()) {
        Some(count) => Ok(Element { name: shown(name), count, properties: Vec::new() }),
        None => Err(wrong(format!("\"{}\" is no count of elements", shown(count)), line, REWRITE)),
    }
}

fn property(mut words: Words, line: usize) -> Result<Property, ReadError> {
    let scalar = |words: &mut Words| {
        let word = words.next().unwrap_or_default();
        Scalar::named(word).ok_or_else(|| {
            let hint = "the types are char, uchar, short, ushort, int, uint, float and double";
            wrong(format!("unknown property type \"{}\"", shown(word)), line, hint)
        })
    };
    let mut ahead = words.clone();
    let kind = if ahead.next() == Some(b"list") {
        words = ahead;
        let (count, item) = (scalar(&mut words)?, scalar(&mut words)?);
        if count.is_real() {
            return Err(wrong("a list is counted by a real number".into(), line, REWRITE));
        }
        Kind::List { count, item }
    } else {
        Kind::One(scalar(&mut words)?)
    };
    match words.next() {
        // Names are kept whole up to a length that no program writes.
        Some(name) => Ok(Property { name: String::from_utf8_lossy(&name[..name.len().min(256)]).into_owned(), kind }),
        None => Err(wrong("a property has no name".into(), line, REWRITE)),
    }
}
