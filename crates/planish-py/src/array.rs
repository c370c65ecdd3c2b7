//! NumPy arrays in and out.
//!
//! In: C-contiguous, aligned `float64` (or `uint32` for triangles) is read where it lies; other layouts and dtypes of numbers are
//! converted once; what is no array of numbers, or has another shape, is refused with its name, shape and dtype.
//! Out: results are moved to NumPy; arrays that an object keeps are shown as read-only views (`view`).

use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use planish::DVec3;
use planish::geom::{Aabb, FacePoint};
use planish::mesh::Attribute;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// An array that is read where it lies, or its one conversion.
pub struct Read<'py, T: Element> {
    array: PyReadonlyArrayDyn<'py, T>,
}

impl<T: Element> Read<'_, T> {
    /// The numbers.
    pub fn flat(&self) -> &[T] {
        // Contiguous and aligned by `read`.
        self.array.as_slice().unwrap_or_default()
    }

    /// Rows of `N` numbers.
    pub fn rows<const N: usize>(&self) -> &[[T; N]] {
        self.flat().as_chunks().0
    }

    /// Numbers along each axis.
    pub fn shape(&self) -> &[usize] {
        self.array.shape()
    }
}

impl Read<'_, f64> {
    /// Vectors.
    pub fn vectors(&self) -> Vec<DVec3> {
        self.rows().iter().map(|&p| DVec3::from_array(p)).collect()
    }
}

/// Reads an array.
/// * `name` - of the argument
/// * `shape` - wanted; 0 is any number
/// * `dtype` - the one that `T` is
/// * `kinds` - kinds of dtypes that may be converted
fn read<'py, T: Element>(
    any: &Bound<'py, PyAny>,
    name: &str,
    shape: &[usize],
    dtype: &str,
    kinds: &str,
) -> PyResult<Read<'py, T>> {
    let py = any.py();
    let numpy = || py.import("numpy");
    let fits = |found: &[usize]| {
        found.len() == shape.len() && found.iter().zip(shape).all(|(&n, &wanted)| wanted == 0 || n == wanted)
    };
    let array = match any.cast::<PyArrayDyn<T>>() {
        Ok(array) if array.is_c_contiguous() && aligned(array)? => array.clone(),
        _ => {
            let raw = numpy()?
                .call_method1("asarray", (any,))
                .map_err(|e| PyTypeError::new_err(format!("{name}: an array of numbers is needed ({e})")))?;
            let kind: String = raw.getattr("dtype")?.getattr("kind")?.extract()?;
            // An empty list is an array of floats to NumPy.
            let empty: bool = raw.getattr("size")?.extract::<usize>()? == 0;
            if !kinds.contains(&kind) && !empty {
                let found = raw.getattr("dtype")?.str()?;
                let what = if kinds.contains('f') { "numbers" } else { "whole numbers" };
                return Err(PyTypeError::new_err(format!("{name}: an array of {what} is needed, not of {found}")));
            }
            let found: Vec<usize> = raw.getattr("shape")?.extract()?;
            if !fits(&found) {
                return Err(wrong_shape(name, &found, shape));
            }
            numpy()?.call_method1("require", (raw, dtype, ["C", "A"]))?.cast_into::<PyArrayDyn<T>>()?
        }
    };
    if !fits(array.shape()) {
        return Err(wrong_shape(name, array.shape(), shape));
    }
    Ok(Read { array: array.try_readonly()? })
}

/// Whether each number lies where the processor wants it: a view of bytes, or an array sent by another process, may lie between.
fn aligned<T: Element>(array: &Bound<'_, PyArrayDyn<T>>) -> PyResult<bool> {
    array.getattr("flags")?.getattr("aligned")?.extract()
}

fn wrong_shape(name: &str, found: &[usize], wanted: &[usize]) -> PyErr {
    let written = |shape: &[usize]| {
        let words: Vec<String> = shape.iter().map(|&n| if n == 0 { "n".into() } else { n.to_string() }).collect();
        format!("({}{})", words.join(", "), if words.len() == 1 { "," } else { "" })
    };
    // A found length of 0 is a number, not a name.
    let seen = format!("{found:?}").replace('[', "(").replace(']', if found.len() == 1 { ",)" } else { ")" });
    PyValueError::new_err(format!("{name}: an array of shape {} is needed, not {seen}", written(wanted)))
}

/// Numbers of a shape, any for 0.
/// # Errors
/// TypeError, ValueError with the argument's name.
pub fn reals<'py>(any: &Bound<'py, PyAny>, name: &str, shape: &[usize]) -> PyResult<Read<'py, f64>> {
    read(any, name, shape, "float64", "fiu")
}

/// Numbers in single precision.
/// # Errors
/// TypeError, ValueError with the argument's name.
pub fn singles<'py>(any: &Bound<'py, PyAny>, name: &str, shape: &[usize]) -> PyResult<Read<'py, f32>> {
    read(any, name, shape, "float32", "fiub")
}

/// Positions `(n, 3)`, all of them finite.
/// # Errors
/// TypeError, ValueError with the argument's name, and the first position that is not finite.
pub fn points<'py>(any: &Bound<'py, PyAny>, name: &str) -> PyResult<Read<'py, f64>> {
    let read = reals(any, name, &[0, 3])?;
    finite(read.flat(), name, 3)?;
    Ok(read)
}

/// Refuses numbers that are not finite.
/// * `width` - numbers of one item
/// # Errors
/// ValueError with the first item that has one.
pub fn finite(values: &[f64], name: &str, width: usize) -> PyResult<()> {
    match values.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(at) => {
            let item = &values[at / width * width..][..width];
            Err(PyValueError::new_err(format!("{name}[{}]: {item:?} is not finite", at / width)))
        }
    }
}

/// Indices of shape `(m, N)`, each below `count`.
/// # Errors
/// TypeError, ValueError with the argument's name and the first index that names nothing.
pub fn indices<const N: usize>(any: &Bound<PyAny>, name: &str, count: usize) -> PyResult<Vec<[u32; N]>> {
    let check = |row: usize, index: i64| -> PyResult<u32> {
        u32::try_from(index).ok().filter(|&i| (i as usize) < count).ok_or_else(|| {
            PyValueError::new_err(format!("{name}[{row}]: {index} names none of the {count} that are there"))
        })
    };
    if any.cast::<PyArrayDyn<u32>>().is_ok() {
        let read = read::<u32>(any, name, &[0, N], "uint32", "iu")?;
        for (row, &index) in read.flat().iter().enumerate() {
            check(row / N, i64::from(index))?;
        }
        return Ok(read.rows().to_vec());
    }
    let read = read::<i64>(any, name, &[0, N], "int64", "iu")?;
    let rows = read.rows::<N>().iter().enumerate();
    rows.map(|(row, indices)| {
        let mut checked = [0; N];
        for (to, &from) in checked.iter_mut().zip(indices) {
            *to = check(row, from)?;
        }
        Ok(checked)
    })
    .collect()
}

/// One vector.
/// # Errors
/// TypeError, ValueError with the argument's name.
pub fn vector(any: &Bound<PyAny>, name: &str) -> PyResult<DVec3> {
    let read = reals(any, name, &[3])?;
    finite(read.flat(), name, 3)?;
    Ok(DVec3::from_slice(read.flat()))
}

/// A box, `(2, 3)`: its least and its greatest corner.
/// # Errors
/// TypeError, ValueError with the argument's name.
pub fn bounds(any: &Bound<PyAny>, name: &str) -> PyResult<Aabb> {
    let read = reals(any, name, &[2, 3])?;
    finite(read.flat(), name, 3)?;
    let [min, max] = [0, 1].map(|k| DVec3::from_array(read.rows()[k]));
    if !(min.cmplt(max).all()) {
        return Err(PyValueError::new_err(format!(
            "{name}: the first corner must lie below the second along each axis"
        )));
    }
    Ok(Aabb { min, max })
}

/// Vectors as an array `(n, 3)`, moved.
pub fn vectors(py: Python, vectors: Vec<DVec3>) -> PyResult<Bound<PyArray2<f64>>> {
    let count = vectors.len();
    moved(py, vectors).reshape([count, 3])
}

/// Vectors at the nodes of a grid as an array `(rows, cols, 3)`, moved.
pub fn nodes(py: Python, vectors: Vec<DVec3>, [rows, cols]: [usize; 2]) -> PyResult<Bound<PyArray3<f64>>> {
    moved(py, vectors).reshape([rows, cols, 3])
}

/// A list of rows as an array `(n, N)`, moved.
pub fn rows<T: Element, const N: usize>(py: Python, rows: Vec<[T; N]>) -> PyResult<Bound<PyArray2<T>>> {
    let count = rows.len();
    PyArray1::from_vec(py, rows.into_flattened()).reshape([count, N])
}

/// The numbers in the memory in which they are: collecting a `Vec` of items of the same size keeps its allocation.
fn moved(py: Python, vectors: Vec<DVec3>) -> Bound<PyArray1<f64>> {
    let flat: Vec<[f64; 3]> = vectors.into_iter().map(|v| v.to_array()).collect();
    PyArray1::from_vec(py, flat.into_flattened())
}

/// A box as an array `(2, 3)`.
pub fn corners(py: Python, bounds: Aabb) -> PyResult<Bound<PyArray2<f64>>> {
    vectors(py, vec![bounds.min, bounds.max])
}

/// Places on a mesh as a dict of `face` `(n,)` and `bary` `(n, 3)`.
pub fn places<'py>(py: Python<'py>, places: &[FacePoint], into: &Bound<'py, PyDict>) -> PyResult<()> {
    into.set_item("face", PyArray1::from_iter(py, places.iter().map(|p| p.face)))?;
    into.set_item("bary", rows(py, places.iter().map(|p| p.bary).collect())?)
}

/// Named quantities per vertex or point, from a dict of arrays `(n,)` or `(n, width)`.
/// # Errors
/// TypeError, ValueError with the attribute's name.
pub fn attributes(given: Option<&Bound<PyDict>>, count: usize) -> PyResult<Vec<Attribute>> {
    let mut all = Vec::new();
    for (name, values) in given.into_iter().flatten() {
        let name: String = name.extract()?;
        let named = format!("attributes[{name:?}]");
        let axes = values.py().import("numpy")?.call_method1("ndim", (&values,));
        let flat = axes.and_then(|n| n.extract::<usize>()).is_ok_and(|n| n <= 1);
        let read = singles(&values, &named, if flat { &[0] } else { &[0, 0] })?;
        if read.shape()[0] != count {
            let found = read.shape()[0];
            return Err(PyValueError::new_err(format!("{named}: {found} entries for {count} points; give one each")));
        }
        all.push(Attribute { name, width: read.shape().get(1).copied().unwrap_or(1), values: read.flat().to_vec() });
    }
    Ok(all)
}

/// The quantities as a dict of read-only views `(n, width)`, or `(n,)` where the width is 1.
pub fn attribute_views<'py>(all: &[Attribute], owner: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(owner.py());
    for a in all {
        match a.width {
            1 => dict.set_item(&a.name, crate::view::numbers(&a.values, owner.clone())?)?,
            width => dict.set_item(&a.name, crate::view::rows(&a.values, width, owner.clone())?)?,
        }
    }
    Ok(dict)
}
