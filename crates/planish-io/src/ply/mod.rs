//! PLY: the Stanford polygon format, ascii and binary in both byte orders.
//!
//! Own reader instead of a crate's: attributes that are known only from the header are wanted as flat arrays,
//! every error with its line or byte, and no count of the header may cost memory that the file has no bytes for.

mod body;
mod header;
mod read;
mod write;

pub(crate) use read::{is_points, pieces, read, read_points, told};
pub(crate) use write::{Rows, write, write_points};
