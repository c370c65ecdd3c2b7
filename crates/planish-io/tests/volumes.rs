//! NumPy volumes of every number type, either order of memory and either order of bytes.

mod common;

use common::folder;
use planish_io::read_grid;

const SIZE: [usize; 3] = [5, 7, 37];

/// What stands at a node: small whole numbers, which every type holds.
fn number(x: usize, y: usize, z: usize) -> u8 {
    ((3 * x + 11 * y + 5 * z) % 120) as u8
}

#[test]
fn npy_volumes_of_every_type_byte_order_and_memory_order_hold_the_same_numbers() {
    let folder = folder();
    let path = folder.path().join("v.npy");
    let [nx, ny, nz] = SIZE;
    let bytes = |word: &str, big: bool, n: u8| -> Vec<u8> {
        let mut bytes = match word {
            "i1" | "u1" => vec![n],
            "i2" | "u2" => (n as u16).to_le_bytes().into(),
            "i4" | "u4" => (n as u32).to_le_bytes().into(),
            "i8" | "u8" => (n as u64).to_le_bytes().into(),
            "f4" => (n as f32).to_le_bytes().into(),
            _ => (n as f64).to_le_bytes().to_vec(),
        };
        if big {
            bytes.reverse();
        }
        bytes
    };
    for word in ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"] {
        for (order, big) in [("<", false), (">", true)] {
            for fortran in [false, true] {
                let places: Vec<[usize; 3]> = (0..nx * ny * nz)
                    .map(|n| match fortran {
                        true => [n % nx, n / nx % ny, n / nx / ny],
                        false => [n / nz / ny, n / nz % ny, n % nz],
                    })
                    .collect();
                let flag = if fortran { "True" } else { "False" };
                let head =
                    format!("{{'descr': '{order}{word}', 'fortran_order': {flag}, 'shape': ({nx}, {ny}, {nz}), }}\n");
                let mut file = b"\x93NUMPY\x01\x00".to_vec();
                file.extend((head.len() as u16).to_le_bytes());
                file.extend(head.as_bytes());
                places.iter().for_each(|&[x, y, z]| file.extend(bytes(word, big, number(x, y, z))));
                std::fs::write(&path, file).unwrap();
                let grid = read_grid(&path).unwrap();
                assert_eq!(grid.size, SIZE);
                for (n, &value) in grid.values.iter().enumerate() {
                    let wanted = number(n % nx, n / nx % ny, n / nx / ny) as f32;
                    assert_eq!(value, wanted, "{order}{word} {flag} {n}");
                }
            }
        }
    }
}

#[test]
fn a_numpy_volume_whose_type_begins_with_a_byte_of_no_text_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    let mut bytes =
        b"\x93NUMPY\x01\x00\x3e\x00{'descr': '\xb3f8', 'fortran_order': False, 'shape': (2, 2, 2), }".to_vec();
    bytes.extend([0u8; 64]);
    std::fs::write(&path, bytes).unwrap();
    let error = planish_io::read_grid(&path).unwrap_err();
    assert!(error.to_string().contains("are not read"), "{error}");
}
