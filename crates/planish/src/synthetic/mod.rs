//! Made input: meshes of known shape, the demonstration part, and a scanner that sees them with all the faults of a real one.

mod demo;
mod rings;
mod scanner;
pub mod shapes;

pub use demo::demo;
pub use scanner::{ScannerParams, VirtualScan, virtual_scan};
