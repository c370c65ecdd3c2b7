//! The text of a STEP file: records by number, parsed when they are asked for.

use crate::{Place, ReadError};
use std::collections::BTreeMap;
use std::ops::Range;

/// Lists in lists of a record at most.
const MOST_NESTED: usize = 16;

/// A parameter of a record.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Number(f64),
    /// `.WORD.`, without the dots.
    Word(&'a str),
    /// As written between its quotes.
    Text(&'a str),
    Reference(u64),
    List(Vec<Value<'a>>),
    /// `NAME(...)`.
    Typed(&'a str, Vec<Value<'a>>),
    /// `$` or `*`.
    Absent,
}

/// An entity: one part, or several where it is of several types at once.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Record<'a> {
    pub id: u64,
    parts: Vec<(&'a str, Vec<Value<'a>>)>,
}

/// All records of a file.
pub(super) struct Exchange<'a> {
    text: &'a [u8],
    places: BTreeMap<u64, Range<usize>>,
}

/// That something is wrong with an entity.
pub(super) fn fault(id: u64, what: impl Into<String>) -> ReadError {
    ReadError::Syntax { what: what.into(), place: Place::Item("entity", id as usize) }
}

impl<'a> Exchange<'a> {
    /// Finds the records of a file.
    pub fn new(text: &'a [u8]) -> Result<Exchange<'a>, ReadError> {
        let mut scanner = Scanner { text, at: 0 };
        let mut places = BTreeMap::new();
        while let Some(statement) = scanner.statement() {
            let mut inner = Scanner { text: &text[..statement.end], at: statement.start };
            inner.blank();
            if inner.take(b'#') {
                let line = || Place::Line(1 + text[..statement.start].iter().filter(|&&b| b == b'\n').count());
                let wrong = |what: &str| ReadError::Syntax { what: what.into(), place: line() };
                let id = inner.integer().ok_or_else(|| wrong("an entity has no number"))?;
                inner.blank();
                if !inner.take(b'=') {
                    return Err(wrong("an entity has no \"=\" behind its number"));
                }
                if places.insert(id, inner.at..statement.end).is_some() {
                    return Err(wrong(&format!("entity {id} stands in the file twice")));
                }
            }
        }
        if !text.trim_ascii_end().ends_with(b"END-ISO-10303-21;") {
            let (left, place) = (0, Place::Byte(text.len()));
            return Err(ReadError::Truncated { what: "END-ISO-10303-21;".into(), needed: 17, left, place });
        }
        Ok(Exchange { text, places })
    }

    /// The record of this number.
    pub fn record(&self, id: u64) -> Result<Record<'a>, ReadError> {
        let place =
            self.places.get(&id).ok_or_else(|| fault(id, format!("entity {id} is referred to and not there")))?;
        let mut scanner = Scanner { text: &self.text[..place.end], at: place.start };
        let parts = scanner.parts().ok_or_else(|| fault(id, "the entity cannot be understood"))?;
        Ok(Record { id, parts })
    }

    /// Numbers of the records of which a part has such a name; in order.
    pub fn of_type(&self, is_wanted: impl Fn(&str) -> bool) -> Vec<u64> {
        let is = |(_, place): &(&u64, &Range<usize>)| {
            let mut scanner = Scanner { text: &self.text[..place.end], at: place.start };
            scanner.blank();
            if scanner.peek() != Some(b'(') {
                return scanner.name().is_some_and(&is_wanted);
            }
            scanner.parts().is_some_and(|parts| parts.iter().any(|(name, _)| is_wanted(name)))
        };
        self.places.iter().filter(is).map(|(id, _)| *id).collect()
    }
}

impl<'a> Record<'a> {
    /// The name of its first part.
    pub fn name(&self) -> &'a str {
        self.parts[0].0
    }

    /// True if it has a part of this name.
    pub fn is(&self, name: &str) -> bool {
        self.parts.iter().any(|(n, _)| *n == name)
    }

    /// Parameter `k` of the part of this name.
    pub fn of(&self, name: &str, k: usize) -> Result<&Value<'a>, ReadError> {
        let part = self.parts.iter().find(|(n, _)| *n == name);
        let (_, values) = part.ok_or_else(|| fault(self.id, format!("the entity has no part {name}")))?;
        values.get(k).ok_or_else(|| fault(self.id, format!("parameter {k} of {name} is not there")))
    }

    /// Parameter `k` of its first part.
    pub fn value(&self, k: usize) -> Result<&Value<'a>, ReadError> {
        self.of(self.name(), k)
    }

    fn wrong(&self, wanted: &str) -> ReadError {
        fault(self.id, format!("{} has no {wanted} where it needs one", self.name()))
    }

    pub fn number(&self, value: &Value) -> Result<f64, ReadError> {
        match value {
            Value::Number(x) if x.is_finite() => Ok(*x),
            // A measure: LENGTH_MEASURE(25.4).
            Value::Typed(_, inner) if inner.len() == 1 => self.number(&inner[0]),
            _ => Err(self.wrong("number")),
        }
    }

    pub fn count(&self, value: &Value) -> Result<usize, ReadError> {
        let x = self.number(value)?;
        (x >= 0.0 && x.fract() == 0.0 && x < 1e9).then_some(x as usize).ok_or_else(|| self.wrong("whole number"))
    }

    pub fn reference(&self, value: &Value) -> Result<u64, ReadError> {
        match value {
            Value::Reference(id) => Ok(*id),
            _ => Err(self.wrong("reference")),
        }
    }

    pub fn list<'v>(&self, value: &'v Value<'a>) -> Result<&'v [Value<'a>], ReadError> {
        match value {
            Value::List(values) => Ok(values),
            _ => Err(self.wrong("list")),
        }
    }

    pub fn references(&self, value: &Value<'a>) -> Result<Vec<u64>, ReadError> {
        self.list(value)?.iter().map(|v| self.reference(v)).collect()
    }

    pub fn numbers(&self, value: &Value<'a>) -> Result<Vec<f64>, ReadError> {
        self.list(value)?.iter().map(|v| self.number(v)).collect()
    }

    pub fn flag(&self, value: &Value) -> Result<bool, ReadError> {
        match value {
            Value::Word("T") => Ok(true),
            Value::Word("F") => Ok(false),
            _ => Err(self.wrong("flag")),
        }
    }
}

struct Scanner<'a> {
    text: &'a [u8],
    at: usize,
}

impl<'a> Scanner<'a> {
    fn peek(&self) -> Option<u8> {
        self.text.get(self.at).copied()
    }

    fn take(&mut self, byte: u8) -> bool {
        let is = self.peek() == Some(byte);
        self.at += usize::from(is);
        is
    }

    /// Over blanks and remarks.
    fn blank(&mut self) {
        while let Some(byte) = self.peek() {
            if byte.is_ascii_whitespace() {
                self.at += 1;
            } else if self.text[self.at..].starts_with(b"/*") {
                let end = self.text[self.at + 2..].windows(2).position(|w| w == b"*/");
                self.at = end.map_or(self.text.len(), |end| self.at + 4 + end);
            } else {
                break;
            }
        }
    }

    /// Over a quoted text; it begins here.
    fn quoted(&mut self) -> Option<&'a str> {
        let from = self.at + 1;
        self.at = from;
        loop {
            self.at += self.text[self.at..].iter().position(|&b| b == b'\'')? + 1;
            if !self.take(b'\'') {
                // What is not UTF-8 names nothing that is read.
                return Some(std::str::from_utf8(&self.text[from..self.at - 1]).unwrap_or_default());
            }
        }
    }

    /// The next statement without its semicolon.
    fn statement(&mut self) -> Option<Range<usize>> {
        self.blank();
        let from = self.at;
        loop {
            match self.peek()? {
                b';' => {
                    self.at += 1;
                    return Some(from..self.at - 1);
                }
                b'\'' => {
                    self.quoted()?;
                }
                b'/' => {
                    let before = self.at;
                    self.blank();
                    self.at += usize::from(self.at == before);
                }
                _ => self.at += 1,
            }
        }
    }

    fn run(&mut self, of: impl Fn(u8) -> bool) -> &'a str {
        let from = self.at;
        while self.peek().is_some_and(&of) {
            self.at += 1;
        }
        std::str::from_utf8(&self.text[from..self.at]).unwrap_or_default()
    }

    fn integer(&mut self) -> Option<u64> {
        self.run(|b| b.is_ascii_digit()).parse().ok()
    }

    fn name(&mut self) -> Option<&'a str> {
        let name = self.run(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'!');
        (!name.is_empty()).then_some(name)
    }

    /// `NAME(...)`, or `(NAME(...) NAME(...))`.
    fn parts(&mut self) -> Option<Vec<(&'a str, Vec<Value<'a>>)>> {
        self.blank();
        let several = self.take(b'(');
        let mut parts = Vec::new();
        loop {
            self.blank();
            if several && self.take(b')') {
                break;
            }
            let name = self.name()?;
            self.blank();
            parts.push((name, self.take(b'(').then(|| self.values(0))??));
            if !several {
                break;
            }
        }
        (!parts.is_empty()).then_some(parts)
    }

    /// Values up to the bracket that closes them; the one that opens them is behind.
    fn values(&mut self, depth: usize) -> Option<Vec<Value<'a>>> {
        let mut values = Vec::new();
        loop {
            self.blank();
            if self.take(b')') {
                return Some(values);
            }
            if !values.is_empty() {
                self.take(b',').then_some(())?;
                self.blank();
            }
            values.push(self.one(depth)?);
        }
    }

    fn one(&mut self, depth: usize) -> Option<Value<'a>> {
        Some(match self.peek()? {
            b'(' if depth < MOST_NESTED => {
                self.at += 1;
                Value::List(self.values(depth + 1)?)
            }
            b'\'' => Value::Text(self.quoted()?),
            b'#' => {
                self.at += 1;
                Value::Reference(self.integer()?)
            }
            b'.' => {
                self.at += 1;
                let word = self.run(|b| b.is_ascii_alphanumeric() || b == b'_');
                self.take(b'.').then_some(Value::Word(word))?
            }
            b'$' | b'*' => {
                self.at += 1;
                Value::Absent
            }
            b'"' => {
                // A binary: no geometry has one.
                self.at += 1;
                self.run(|b| b.is_ascii_hexdigit());
                self.take(b'"').then_some(Value::Absent)?
            }
            b'+' | b'-' | b'0'..=b'9' => {
                let number = self.run(|b| b.is_ascii_digit() || b"+-.eE".contains(&b));
                Value::Number(number.parse().ok()?)
            }
            _ if depth < MOST_NESTED => {
                let name = self.name()?;
                self.blank();
                Value::Typed(name, self.take(b'(').then(|| self.values(depth + 1))??)
            }
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_of_one_and_of_several_types_are_read() {
        let text = b"ISO-10303-21;\nDATA;\n#1=POINT('it''s; #2=',(1.,-2.5E-3,3),$,*,.T.);/* #7=X(); */\n\
            #20 = ( A(1) B_C((#1,#2),LENGTH_MEASURE(2.)) );\nENDSEC;\nEND-ISO-10303-21;\n";
        let file = Exchange::new(text).unwrap();
        let one = file.record(1).unwrap();
        assert_eq!((one.name(), one.value(0).unwrap()), ("POINT", &Value::Text("it''s; #2=")));
        assert_eq!(one.numbers(one.value(1).unwrap()).unwrap(), [1.0, -2.5e-3, 3.0]);
        assert!(one.flag(one.value(4).unwrap()).unwrap() && one.value(5).is_err());
        let several = file.record(20).unwrap();
        assert_eq!(several.references(several.of("B_C", 0).unwrap()).unwrap(), [1, 2]);
        assert_eq!(several.number(several.of("B_C", 1).unwrap()).unwrap(), 2.0);
        assert_eq!(["B_C", "POINT", "X"].map(|name| file.of_type(|n| n == name)), [vec![20], vec![1], vec![]]);
        assert!(file.record(7).is_err());
    }

    #[test]
    fn damaged_records_are_faults_and_nested_ones_end() {
        let file = |data: &str| format!("ISO-10303-21;\nDATA;\n{data}\nENDSEC;\nEND-ISO-10303-21;");
        let deep = format!("#1=A({}{});", "(".repeat(100_000), ")".repeat(100_000));
        for data in ["#1=A(1;", "#1=A(1 2);", "#1=;", "#1=A(1-2);", "#1=A('x);", &deep] {
            let text = file(data);
            let wrong = Exchange::new(text.as_bytes()).and_then(|file| file.record(1).map(|_| ()));
            assert!(wrong.is_err(), "{}", &data[..data.len().min(20)]);
        }
        assert!(Exchange::new(b"ISO-10303-21;\nDATA;\n#1=A();").is_err());
        assert!(Exchange::new(file("#1=A();#1=B();").as_bytes()).is_err());
    }
}
