//! Inputs from patterns, and the names of their folders.

use crate::args::is_pattern;
use crate::failure::Failure;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// The inputs, those of patterns in the order of their names.
/// # Errors
/// If a pattern is none, or finds nothing.
pub fn expanded(inputs: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut all = Vec::new();
    for input in inputs {
        let Some(pattern) = input.to_str().filter(|_| is_pattern(input)) else {
            all.push(input.clone());
            continue;
        };
        let wrong = |e: &dyn std::fmt::Display| Failure::usage(input, format!("is no pattern ({e})"));
        let found = glob::glob(pattern).map_err(|e| wrong(&e))?;
        let before = all.len();
        for path in found {
            all.push(path.map_err(|e| wrong(&e))?);
        }
        if all.len() == before {
            return Err(
                Failure::input(input, "no file has a name like this").hint("look at the folder and the pattern")
            );
        }
        all[before..].sort();
    }
    Ok(all)
}

/// A name of a folder for each input: its stem; with its extension where two have one stem, and a number where two have one
/// name.
pub fn folder_names(sources: &[PathBuf]) -> Vec<String> {
    let text = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    let stems: Vec<String> = sources.iter().map(|path| text(path.file_stem())).collect();
    let mut taken = BTreeSet::new();
    let one = |(path, stem): (&PathBuf, &String)| {
        let is_alone = stems.iter().filter(|s| *s == stem).count() == 1;
        let plain = if is_alone { stem.clone() } else { text(path.file_name()).replace('.', "-") };
        let mut name = plain.clone();
        let mut number = 2;
        while !taken.insert(name.clone()) {
            name = format!("{plain}-{number}");
            number += 1;
        }
        name
    };
    sources.iter().zip(&stems).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_inputs_of_one_stem_get_folders_of_their_own() {
        let sources = ["a/x.ply", "b/x.ply", "x.stl", "y.stl"].map(PathBuf::from);
        assert_eq!(folder_names(&sources), ["x-ply", "x-ply-2", "x-stl", "y"]);
    }

    #[test]
    fn a_pattern_finds_its_files_in_order_and_a_file_with_brackets_is_a_file() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.ply", "a.ply", "c.stl", "odd[1].ply"] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        let path = |name: &str| folder.path().join(name);
        let found = expanded(&[path("[a-c].*"), path("odd[1].ply")]).unwrap();
        assert_eq!(found, ["a.ply", "b.ply", "c.stl", "odd[1].ply"].map(path));
        assert!(expanded(&[path("*.e57")]).unwrap_err().to_string().contains("no file"));
    }
}
