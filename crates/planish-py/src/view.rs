//! Read-only NumPy views of arrays that a planish object owns: no copy, and the object lives as long as its views.
//!
//! This is the one file with `unsafe`: NumPy is handed a pointer into a `Vec`. It is sound because every class of this
//! package is frozen (a `Vec` that a view shows is never changed nor moved while its object lives), the object is the
//! base of the array (so it outlives it), and the array is not writeable.
#![allow(unsafe_code)]

use numpy::ndarray::{ArrayView, Dimension, Ix1, Ix2, Ix3};
use numpy::{Element, PyArray, PyArrayMethods};
use planish::DVec3;
use pyo3::prelude::*;

// A vector is three numbers and nothing else.
const _: () = assert!(size_of::<DVec3>() == 3 * size_of::<f64>() && align_of::<DVec3>() == align_of::<f64>());

/// Positions as an array of shape `(n, 3)`.
pub fn vectors<'py>(vectors: &[DVec3], owner: Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray<f64, Ix2>>> {
    show(flat(vectors), Ix2(vectors.len(), 3), owner)
}

/// Positions at the nodes of a grid as an array of shape `(rows, cols, 3)`.
pub fn nodes<'py>(
    vectors: &[DVec3],
    [rows, cols]: [usize; 2],
    owner: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray<f64, Ix3>>> {
    show(flat(vectors), Ix3(rows, cols, 3), owner)
}

/// Rows of so many numbers as an array of shape `(n, width)`.
pub fn rows<'py, T: Element>(
    values: &[T],
    width: usize,
    owner: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray<T, Ix2>>> {
    show(values, Ix2(values.len() / width.max(1), width), owner)
}

/// Numbers as an array of shape `(n,)`.
pub fn numbers<'py, T: Element>(values: &[T], owner: Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray<T, Ix1>>> {
    show(values, Ix1(values.len()), owner)
}

fn flat(vectors: &[DVec3]) -> &[f64] {
    // SAFETY: DVec3 is `repr(C)` of three f64, which the assertion above holds it to; the slice is as long in bytes.
    unsafe { std::slice::from_raw_parts(vectors.as_ptr().cast(), 3 * vectors.len()) }
}

/// * `values` - owned by `owner`, a frozen object
pub fn show<'py, T: Element, D: Dimension>(
    values: &[T],
    shape: D,
    owner: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    let view = ArrayView::from_shape(shape, values)
        .map_err(|e| crate::error::class::InternalError::new_err(format!("an array has another shape: {e}")))?;
    // SAFETY: see the head of this file.
    let array = unsafe { PyArray::borrow_from_array(&view, owner) };
    array.try_readwrite()?.make_nonwriteable();
    Ok(array)
}
