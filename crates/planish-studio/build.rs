//! Compiles the crate anew when the page was built: its files are read while the crate is compiled. Nothing of Node is run.

use std::path::Path;

fn main() {
    let built = Path::new("../../studio/dist");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed={}", built.display());
    // A folder that is missing would have the crate compiled each time. Where none can be made it is.
    let _ = std::fs::create_dir_all(built);
}
