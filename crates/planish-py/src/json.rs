//! Plain Python values to JSON and back: dicts, lists, texts, numbers.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyString};
use serde::Serialize;
use serde_json::{Map, Number, Value};

/// A Python value as JSON. NumPy's scalars and arrays are numbers and lists.
/// # Errors
/// TypeError for what JSON has no word for, ValueError for numbers that are not finite.
pub fn of(any: &Bound<PyAny>) -> PyResult<Value> {
    if any.is_none() {
        return Ok(Value::Null);
    }
    if let Ok(flag) = any.cast::<PyBool>() {
        return Ok(Value::Bool(flag.is_true()));
    }
    if let Ok(whole) = any.cast::<PyInt>() {
        let negative = || whole.extract::<i64>().map(Value::from);
        return whole.extract::<u64>().map(Value::from).or_else(|_| negative());
    }
    if let Ok(real) = any.cast::<PyFloat>() {
        let x = real.value();
        let number = Number::from_f64(x).ok_or_else(|| PyValueError::new_err(format!("{x} is not a finite number")))?;
        return Ok(Value::Number(number));
    }
    if let Ok(text) = any.cast::<PyString>() {
        return Ok(Value::String(text.to_str()?.to_owned()));
    }
    if let Ok(dict) = any.cast::<PyDict>() {
        let one = |(key, value): (Bound<PyAny>, Bound<PyAny>)| Ok((key.extract::<String>()?, of(&value)?));
        return dict.iter().map(one).collect::<PyResult<Map<_, _>>>().map(Value::Object);
    }
    // NumPy's arrays and scalars.
    if let Ok(plain) = any.call_method0("tolist") {
        return of(&plain);
    }
    if let Ok(items) = any.try_iter() {
        return items.map(|item| of(&item?)).collect::<PyResult<Vec<_>>>().map(Value::Array);
    }
    Err(PyTypeError::new_err(format!("{} is no number, text, list or dict", any.get_type().name()?)))
}

/// What serde can write as plain Python values.
/// # Errors
/// If Python has no memory for it.
pub fn to<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let wrong = |e: serde_json::Error| crate::error::class::InternalError::new_err(e.to_string());
    let text = serde_json::to_string(value).map_err(wrong)?;
    py.import("json")?.call_method1("loads", (text,))
}
