//! Words and sizes that several calls take.

use planish::Units;
use planish::contour::Sampling;
use planish::field::Spacing;
use planish_io::Up;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A unit of length by its symbol.
/// # Errors
/// ValueError for another word.
pub fn units(word: &str) -> PyResult<Units> {
    word.parse().map_err(|e: planish::UnknownUnit| PyValueError::new_err(e.to_string()))
}

/// The axis that points up, by its word.
/// # Errors
/// ValueError for another word.
pub fn up(word: &str) -> PyResult<Up> {
    match word {
        "y" => Ok(Up::Y),
        "z" => Ok(Up::Z),
        _ => Err(PyValueError::new_err(format!("up={word:?}: \"y\" or \"z\" is needed"))),
    }
}

/// Cells along the longest side unless the caller says: as on the command line.
const RESOLUTION: usize = 129;
/// Memory that a lattice may take unless the caller says, GB.
const MEMORY: f64 = 8.0;

/// Where a lattice lies: `voxel` or `resolution`, else 129 cells along the longest side.
pub fn sampling(spacing: Option<Spacing>, memory: Option<f64>) -> PyResult<Sampling> {
    let memory = bytes(memory)?;
    Ok(Sampling { spacing: spacing.unwrap_or(Spacing::Resolution(RESOLUTION)), memory })
}

/// Bytes of so many gigabytes.
pub fn bytes(gigabytes: Option<f64>) -> PyResult<u64> {
    let gigabytes = gigabytes.unwrap_or(MEMORY);
    if !(gigabytes > 0.0 && gigabytes.is_finite()) {
        return Err(PyValueError::new_err(format!("memory={gigabytes}: a number of gigabytes above 0 is needed")));
    }
    Ok((gigabytes * (1u64 << 30) as f64) as u64)
}
