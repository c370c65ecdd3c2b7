//! Volumes written: NRRD (raw, attached) and NumPy arrays.

use crate::{WriteError, atomic};
use planish::field::ScalarGrid;
use std::io::Write;
use std::path::Path;

/// Bytes at the beginning of a NumPy file that its header fills up to a multiple of.
const ALIGNED: usize = 64;

/// Writes a volume: `.nrrd` with spacing and origin, or `.npy`, an array indexed `[x, y, z]` that carries neither. Numbers are
/// `f32`, x fastest. The file appears whole or not at all.
/// # Errors
/// [`WriteError::UnknownExtension`], [`WriteError::Nothing`] for a volume without numbers.
pub fn write_grid(path: impl AsRef<Path>, grid: &ScalarGrid) -> Result<(), WriteError> {
    let path = path.as_ref();
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if grid.values.is_empty() {
        return Err(WriteError::Nothing("the volume has no numbers"));
    }
    let head = match extension.as_str() {
        "nrrd" => nrrd(grid),
        "npy" => npy(grid),
        _ => return Err(WriteError::UnknownExtension { extension, known: ".nrrd, .npy".into() }),
    };
    atomic::write(path, |out| {
        out.write_all(&head)?;
        grid.values.iter().try_for_each(|v| out.write_all(&v.to_le_bytes()))?;
        Ok(())
    })
}

fn nrrd(grid: &ScalarGrid) -> Vec<u8> {
    let ([x, y, z], s, o) = (grid.size, grid.spacing, grid.origin);
    format!(
        "NRRD0004\n# written by planish\ntype: float\ndimension: 3\nspace dimension: 3\nsizes: {x} {y} {z}\n\
         space directions: ({},0,0) (0,{},0) (0,0,{})\nspace origin: ({},{},{})\nendian: little\nencoding: raw\n\n",
        s.x, s.y, s.z, o.x, o.y, o.z
    )
    .into_bytes()
}

fn npy(grid: &ScalarGrid) -> Vec<u8> {
    let [x, y, z] = grid.size;
    // The remark is one to Python, too, which reads the header.
    let dict = format!("{{'descr': '<f4', 'fortran_order': True, 'shape': ({x}, {y}, {z}), }} # planish");
    let fixed = 10;
    let length = (fixed + dict.len() + 1).next_multiple_of(ALIGNED) - fixed;
    let mut head = b"\x93NUMPY\x01\x00".to_vec();
    head.extend((length as u16).to_le_bytes());
    head.extend(format!("{dict:<width$}\n", width = length - 1).into_bytes());
    head
}

#[cfg(test)]
mod tests {
    use super::*;
    use planish::DVec3;

    #[test]
    fn volumes_come_back_bit_for_bit_with_spacing_and_origin_where_the_format_has_them() {
        let folder = tempfile::tempdir().unwrap();
        let values = (0..3 * 4 * 5).map(|n| if n == 7 { f32::NAN } else { n as f32 / 7.0 }).collect::<Vec<_>>();
        let (spacing, origin) = (DVec3::new(0.1, 0.25, 1.0 / 3.0), DVec3::new(-1.0, 2.5e-7, 1e6));
        let grid = ScalarGrid { size: [3, 4, 5], origin, spacing, values: values.clone().into() };
        for name in ["a.nrrd", "a.npy"] {
            let path = folder.path().join(name);
            write_grid(&path, &grid).unwrap();
            let back = crate::read_grid(&path).unwrap();
            assert_eq!(back.size, grid.size);
            let bits = |all: &[f32]| all.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&back.values), bits(&values), "{name}");
            if name == "a.nrrd" {
                assert_eq!((back.spacing, back.origin), (spacing, origin));
            }
        }
        assert!(write_grid(folder.path().join("a.tif"), &grid).unwrap_err().to_string().contains(".nrrd, .npy"));
    }
}
