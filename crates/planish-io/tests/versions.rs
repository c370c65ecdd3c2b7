//! Minimum versions are stated once and held, and what is linked has a licence and a source that `deny.toml` allows.

use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn text(name: &str) -> String {
    std::fs::read_to_string(root().join(name)).unwrap()
}

/// What stands between quotes after `key` in a file.
fn stated(text: &str, key: &str) -> String {
    let rest = text.split_once(key).unwrap_or_else(|| panic!("{key}")).1;
    rest.split('"').nth(1).unwrap().to_owned()
}

#[test]
fn the_page_on_trust_states_the_minimum_versions_that_the_manifests_ask_for() {
    let (cargo, python, page) = (text("Cargo.toml"), text("pyproject.toml"), text("docs/trust.md"));
    let rust = stated(&cargo, "rust-version");
    let python = stated(&python, "requires-python").trim_start_matches(">=").to_owned();
    assert!(page.contains(&format!("Rust {rust}")) && page.contains(&format!("Python {python}")), "{rust} {python}");
    // The wheel's binary interface is that of the same version.
    assert!(cargo.contains(&format!("abi3-py{}", python.replace('.', ""))), "{python}");
    // This test is compiled by some version: the least one, or a later one.
    let found = Command::new(env!("CARGO")).arg("--version").output().unwrap();
    let found = String::from_utf8(found.stdout).unwrap();
    let numbers = |v: &str| -> Vec<u32> { v.split('.').take(2).map(|n| n.parse().unwrap()).collect() };
    assert!(numbers(found.split(' ').nth(1).unwrap()) >= numbers(&rust), "{found} is older than {rust}");
}

#[test]
fn every_crate_that_is_linked_comes_from_the_public_registry_under_a_licence_of_deny_toml() {
    let allowed = text("deny.toml");
    let lock = text("Cargo.lock");
    let sources = lock.lines().filter_map(|l| l.strip_prefix("source = "));
    for source in sources {
        assert_eq!(source, "\"registry+https://github.com/rust-lang/crates.io-index\"");
    }
    let mut command = Command::new(env!("CARGO"));
    command.args(["metadata", "--format-version", "1", "--locked"]).current_dir(root());
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 100);
    for package in packages {
        let licence = package["license"].as_str().unwrap_or_default().replace('/', " OR ");
        let is_allowed = |part: &str| allowed.contains(&format!("\"{}\"", part.trim_matches(['(', ')', ' '])));
        // Every part of an `AND`, any part of an `OR`.
        let suits = licence.split(" AND ").all(|all| all.split(" OR ").any(is_allowed));
        assert!(suits, "{} has the licence \"{licence}\"", package["name"]);
    }
}
