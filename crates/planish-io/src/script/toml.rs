//! TOML values with the line each stands on.

use super::ScriptError;
use planish::{DVec3, Units};
use toml_edit::{Document, Item, TableLike};

/// A parsed text.
pub struct Source<'a> {
    text: &'a str,
    document: Document<&'a str>,
}

/// A table.
#[derive(Clone, Copy)]
pub struct Table<'a> {
    text: &'a str,
    table: &'a dyn TableLike,
    at: usize,
}

/// A value and its key.
#[derive(Clone, Copy)]
pub struct Value<'a> {
    text: &'a str,
    item: &'a Item,
    name: &'a str,
    at: usize,
}

fn line_of(text: &str, at: usize) -> usize {
    1 + text.as_bytes()[..at.min(text.len())].iter().filter(|&&b| b == b'\n').count()
}

impl<'a> Source<'a> {
    pub fn new(text: &'a str) -> Result<Source<'a>, ScriptError> {
        let document = Document::parse(text).map_err(|e| {
            let line = line_of(text, e.span().map_or(0, |s| s.start));
            let what = e.message().lines().next().unwrap_or("it is no TOML").to_owned();
            ScriptError::Fault { what, line, hint: "the file must be TOML".into() }
        })?;
        Ok(Source { text, document })
    }

    pub fn root(&self) -> Table<'_> {
        Table { text: self.text, table: self.document.as_table(), at: 0 }
    }
}

impl<'a> Table<'a> {
    pub fn fault(&self, what: impl Into<String>, hint: impl Into<String>) -> ScriptError {
        ScriptError::Fault { what: what.into(), line: line_of(self.text, self.at), hint: hint.into() }
    }

    pub fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// All values in the order of the file.
    pub fn values(&self) -> Vec<Value<'a>> {
        self.table.iter().map(|(name, item)| self.value(name, item)).collect()
    }

    fn value(&self, name: &'a str, item: &'a Item) -> Value<'a> {
        let own = item.span().map(|s| s.start);
        let key = self.table.key(name).and_then(|k| k.span()).map(|s| s.start);
        Value { text: self.text, item, name, at: key.or(own).unwrap_or(self.at) }
    }

    pub fn optional(&self, key: &str) -> Option<Value<'a>> {
        let (name, item) = self.table.iter().find(|(name, _)| *name == key)?;
        Some(self.value(name, item))
    }

    pub fn required(&self, key: &str) -> Result<Value<'a>, ScriptError> {
        self.optional(key).ok_or_else(|| self.fault(format!("\"{key}\" is missing"), format!("add {key} = ...")))
    }

    /// Refuses keys that are not among `known`.
    pub fn only(&self, known: &[&str]) -> Result<(), ScriptError> {
        match self.values().into_iter().find(|v| !known.contains(&v.name)) {
            Some(v) => {
                Err(v.fault(format!("unknown key \"{}\"", v.name), format!("keys here are {}", known.join(", "))))
            }
            None => Ok(()),
        }
    }

    /// A length above zero.
    pub fn positive(&self, key: &str) -> Result<f64, ScriptError> {
        self.required(key)?.positive()
    }
}

impl<'a> Value<'a> {
    pub fn name(&self) -> &'a str {
        self.name
    }

    pub fn line(&self) -> usize {
        line_of(self.text, self.at)
    }

    pub fn fault(&self, what: impl Into<String>, hint: impl Into<String>) -> ScriptError {
        ScriptError::Fault { what: what.into(), line: self.line(), hint: hint.into() }
    }

    fn wrong(&self, need: &str) -> ScriptError {
        self.fault(format!("\"{}\" must be {need}", self.name), format!("write {} as {need}", self.name))
    }

    pub fn table(&self) -> Result<Table<'a>, ScriptError> {
        let table = self.item.as_table_like().ok_or_else(|| self.wrong("a table"))?;
        Ok(Table { text: self.text, table, at: self.at })
    }

    /// An array of tables, or one table.
    pub fn tables(&self) -> Result<Vec<Table<'a>>, ScriptError> {
        if let Some(tables) = self.item.as_array_of_tables() {
            let at = |t: &toml_edit::Table| t.span().map_or(self.at, |s| s.start);
            return Ok(tables.iter().map(|t| Table { text: self.text, table: t, at: at(t) }).collect());
        }
        Ok(vec![self.table()?])
    }

    pub fn text(&self) -> Result<&'a str, ScriptError> {
        self.item.as_str().ok_or_else(|| self.wrong("a text in quotes"))
    }

    pub fn number(&self) -> Result<f64, ScriptError> {
        number(self.item.as_value()).ok_or_else(|| self.wrong("a number"))
    }

    pub fn positive(&self) -> Result<f64, ScriptError> {
        self.number().ok().filter(|x| *x > 0.0).ok_or_else(|| self.wrong("a number above 0"))
    }

    /// As many numbers as asked for.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N], ScriptError> {
        let wrong = || self.wrong(&format!("{N} numbers in brackets"));
        let array = self.item.as_array().filter(|a| a.len() == N).ok_or_else(wrong)?;
        let mut out = [0.0; N];
        for (o, v) in out.iter_mut().zip(array) {
            *o = number(Some(v)).ok_or_else(wrong)?;
        }
        Ok(out)
    }

    pub fn vector(&self) -> Result<DVec3, ScriptError> {
        Ok(DVec3::from_array(self.numbers::<3>()?))
    }

    /// A list of points of `N` numbers.
    pub fn points<const N: usize>(&self) -> Result<Vec<[f64; N]>, ScriptError> {
        let wrong = || self.wrong(&format!("a list of points of {N} numbers each"));
        let array = self.item.as_array().ok_or_else(wrong)?;
        let point = |v: &toml_edit::Value| {
            let at = v.span().map_or(self.at, |s| s.start);
            let fault = || Value { at, ..*self }.wrong(&format!("a list of points of {N} numbers each"));
            let one = v.as_array().filter(|a| a.len() == N).ok_or_else(fault)?;
            let mut out = [0.0; N];
            for (o, v) in out.iter_mut().zip(one) {
                *o = number(Some(v)).ok_or_else(fault)?;
            }
            Ok(out)
        };
        array.iter().map(point).collect()
    }

    /// A list of names.
    pub fn names(&self) -> Result<Vec<&'a str>, ScriptError> {
        let wrong = || self.wrong("a list of names in quotes");
        let array = self.item.as_array().filter(|a| !a.is_empty()).ok_or_else(wrong)?;
        array.iter().map(|v| v.as_str().ok_or_else(wrong)).collect()
    }

    pub fn units(&self) -> Result<Units, ScriptError> {
        let word = self.text()?;
        word.parse().map_err(|_| self.fault(format!("unknown unit \"{word}\""), "units are mm, cm, m and in"))
    }
}

/// A finite number, whole or not.
fn number(value: Option<&toml_edit::Value>) -> Option<f64> {
    let value = value?;
    value.as_float().or_else(|| value.as_integer().map(|n| n as f64)).filter(|x| x.is_finite())
}
