//! The library is built in one direction: a room uses the rooms before it and none after it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Rooms and the floor each stands on; a room may use its own and lower floors. The ground floor also speaks of
/// meshes in its queries, and those are plain types.
const FLOORS: [(&str, u32); 17] = [
    ("observe", 0),
    ("linalg", 0),
    ("geom", 1),
    ("mesh", 1),
    ("cloud", 2),
    ("field", 3),
    ("contour", 4),
    ("synthetic", 5),
    ("curve", 5),
    ("network", 6),
    ("grid", 7),
    ("surface", 8),
    ("relief", 9),
    ("model", 10),
    ("render", 10),
    ("edit", 11),
    ("pipeline", 11),
];

/// Lines that a file of the library may have.
const CEILING: usize = 800;

fn sources() -> Vec<(PathBuf, String)> {
    fn walk(folder: &Path, into: &mut Vec<(PathBuf, String)>) {
        let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
        entries.sort();
        for path in entries {
            if path.is_dir() {
                walk(&path, into);
            } else if path.extension().is_some_and(|e| e == "rs") {
                into.push((path.clone(), std::fs::read_to_string(&path).unwrap()));
            }
        }
    }
    let mut found = Vec::new();
    walk(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut found);
    found
}

/// The room of a file: the first part of its path below `src`.
fn room(path: &Path) -> String {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let first = path.strip_prefix(src).unwrap().components().next().unwrap().as_os_str().to_string_lossy().into_owned();
    first.trim_end_matches(".rs").to_string()
}

/// Rooms that a line of code names after `crate::`, also inside braces.
fn named(text: &str) -> Vec<String> {
    let mut rooms = Vec::new();
    for (at, _) in text.match_indices("crate::") {
        let rest = &text[at + "crate::".len()..];
        let word =
            |s: &str| s.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
        match rest.strip_prefix('{') {
            None => rooms.push(word(rest)),
            Some(inside) => {
                let mut depth = 1;
                let mut fresh = true;
                for (i, c) in inside.char_indices() {
                    if depth == 1 && fresh && (c.is_alphanumeric() || c == '_') {
                        rooms.push(word(&inside[i..]));
                        fresh = false;
                    }
                    match c {
                        '{' => depth += 1,
                        '}' => depth -= 1,
                        ',' => fresh = true,
                        _ => {}
                    }
                    if depth == 0 {
                        break;
                    }
                }
            }
        }
    }
    rooms
}

/// Code without comments, whose links may point anywhere.
fn code(text: &str) -> String {
    text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

#[test]
fn no_room_uses_a_later_room() {
    let floors: BTreeMap<&str, u32> = FLOORS.into_iter().collect();
    let mut wrong = Vec::new();
    for (path, text) in sources() {
        let own = room(&path);
        if own == "lib" {
            continue;
        }
        let Some(&floor) = floors.get(own.as_str()) else {
            wrong.push(format!("{} is in a room without a floor: {own}", path.display()));
            continue;
        };
        for other in named(&code(&text)) {
            if floors.get(other.as_str()).is_some_and(|&f| f > floor) {
                wrong.push(format!("{} uses the later room {other}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_file_of_the_library_has_more_than_800_lines() {
    for (path, text) in sources() {
        let lines = text.lines().count();
        assert!(lines <= CEILING, "{} has {lines} lines", path.display());
    }
}

#[test]
fn rooms_are_read_from_plain_and_braced_paths() {
    assert_eq!(named("use crate::mesh::TriMesh; crate::grid::f()"), ["mesh", "grid"]);
    assert_eq!(named("use crate::{geom::{Aabb, Bvh}, relief};"), ["geom", "relief"]);
}
