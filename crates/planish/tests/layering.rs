//! The house is built in one direction: a room uses the rooms before it and none after it, no two files of a crate need each
//! other in a circle, and no room is too large to be seen through.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Rooms of the library and the floor each stands on; a room may use its own and lower floors.
const FLOORS: [(&str, u32); 21] = [
    ("observe", 0),
    ("linalg", 0),
    ("geom", 0),
    ("mesh", 1),
    ("mend", 2),
    ("sharp", 2),
    ("cloud", 2),
    ("register", 3),
    ("field", 3),
    ("contour", 4),
    ("synthetic", 5),
    ("curve", 5),
    ("network", 6),
    ("layout", 7),
    ("grid", 8),
    ("surface", 9),
    ("relief", 10),
    ("model", 11),
    ("render", 11),
    ("edit", 12),
    ("pipeline", 12),
];

/// The crates whose files are read.
const CRATES: [&str; 5] = ["planish", "planish-io", "planish-studio", "planish-app", "planish-py"];
/// Crates of the house that each other one may use.
const MAY_USE: [(&str, &[&str]); 5] = [
    ("planish", &["planish_sparse"]),
    ("planish-io", &["planish"]),
    ("planish-studio", &["planish", "planish_io"]),
    ("planish-app", &["planish", "planish_io", "planish_studio"]),
    ("planish-py", &["planish", "planish_io", "planish_app"]),
];
/// Lines that a file may have.
const CEILING: usize = 800;
/// Files and folders that a room may hold.
const ROOM: usize = 17;

/// A source file: its module (`mesh::tags`; empty for the root of the crate), and its text.
struct Source {
    module: String,
    path: PathBuf,
    text: String,
}

fn src(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name).join("src")
}

fn sources(name: &str) -> Vec<Source> {
    fn walk(root: &Path, folder: &Path, into: &mut Vec<Source>) {
        let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
        entries.sort();
        for path in entries {
            if path.is_dir() {
                walk(root, &path, into);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let below = path.strip_prefix(root).unwrap().with_extension("");
                let mut parts: Vec<&str> = below.iter().map(|p| p.to_str().unwrap()).collect();
                if ["mod", "lib", "main"].contains(parts.last().unwrap()) {
                    parts.pop();
                }
                let text = std::fs::read_to_string(&path).unwrap();
                into.push(Source { module: parts.join("::"), path: path.clone(), text });
            }
        }
    }
    let mut found = Vec::new();
    walk(&src(name), &src(name), &mut found);
    found
}

/// Code without tests, which may use any room, and without comments, whose links may point anywhere.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// The leaves of a use tree: `a::{b, c::d}` gives `a::b` and `a::c::d`.
fn leaves(tree: &str) -> Vec<String> {
    let Some(open) = tree.find('{') else {
        let path = tree.split(" as ").next().unwrap_or_default();
        return vec![path.split_whitespace().collect()];
    };
    let inside = &tree[open + 1..tree.rfind('}').unwrap_or(tree.len())];
    let (mut depth, mut from, mut parts) = (0, 0, Vec::new());
    for (i, c) in inside.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&inside[from..i]);
                from = i + 1;
            }
            _ => {}
        }
    }
    parts.push(&inside[from..]);
    let prefix: String = tree[..open].split_whitespace().collect();
    parts.iter().filter(|p| !p.trim().is_empty()).flat_map(|p| leaves(p)).map(|l| format!("{prefix}{l}")).collect()
}

/// Paths that a file names: those of its `use` lines, and those that begin with `crate`, `super` or `self` anywhere.
fn paths(code: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut lines = code.lines();
    while let Some(line) = lines.next() {
        let Some((before, tree)) = line.trim_start().split_once("use ") else { continue };
        let public = before.starts_with("pub") && before.ends_with(' ') && !before.contains('"');
        if !before.is_empty() && !public {
            continue;
        }
        let mut tree = tree.to_string();
        while !tree.contains(';') {
            let Some(more) = lines.next() else { break };
            tree.push_str(more);
        }
        found.extend(leaves(tree.split(';').next().unwrap_or_default()));
    }
    for word in ["crate::", "super::", "self::"] {
        for (at, _) in code.match_indices(word) {
            let before = code[..at].chars().next_back();
            if before.is_none_or(|c| !c.is_alphanumeric() && c != '_' && c != ':' && c != '$') {
                let path: String =
                    code[at..].chars().take_while(|&c| c.is_alphanumeric() || "_:".contains(c)).collect();
                found.push(path.trim_end_matches(':').to_string());
            }
        }
    }
    found
}

/// A path as it reads from the root of the crate; `None` if it leads out of the crate.
fn absolute(path: &str, module: &str, modules: &BTreeSet<String>) -> Option<String> {
    let mut base: Vec<&str> = module.split("::").filter(|p| !p.is_empty()).collect();
    let mut parts = path.split("::").peekable();
    match parts.peek() {
        Some(&"crate") => {
            parts.next();
            base.clear();
        }
        Some(&"self") => {
            parts.next();
        }
        Some(&"super") => {}
        Some(first) if modules.contains(&[&base[..], &[first]].concat().join("::")) => {}
        _ => return None,
    }
    while parts.next_if_eq(&"super").is_some() {
        base.pop();
    }
    base.extend(parts);
    Some(base.join("::"))
}

/// For each file the files that it names, itself and those above and below it in its own folders left out: a room's index
/// holds the types that its files share.
fn imports(files: &[Source]) -> BTreeMap<String, BTreeSet<String>> {
    let modules: BTreeSet<String> = files.iter().map(|f| f.module.clone()).collect();
    let within = |inner: &str, outer: &str| outer.is_empty() || format!("{inner}::").starts_with(&format!("{outer}::"));
    let mut all = BTreeMap::new();
    for file in files {
        let mut named = BTreeSet::new();
        for path in paths(&code(&file.text)) {
            let Some(mut target) = absolute(&path, &file.module, &modules) else { continue };
            while !modules.contains(&target) {
                target = target.rsplit_once("::").map_or(String::new(), |(outer, _)| outer.to_string());
            }
            if !within(&target, &file.module) && !within(&file.module, &target) {
                named.insert(target);
            }
        }
        all.insert(file.module.clone(), named);
    }
    all
}

/// A circle of imports, if there is one.
fn circle(imports: &BTreeMap<String, BTreeSet<String>>) -> Option<Vec<String>> {
    fn visit<'a>(
        at: &'a str,
        imports: &'a BTreeMap<String, BTreeSet<String>>,
        done: &mut BTreeSet<&'a str>,
        trail: &mut Vec<&'a str>,
    ) -> Option<Vec<String>> {
        if let Some(from) = trail.iter().position(|&t| t == at) {
            return Some(trail[from..].iter().map(|t| t.to_string()).collect());
        }
        if !done.insert(at) {
            return None;
        }
        trail.push(at);
        let found = imports.get(at).into_iter().flatten().find_map(|next| visit(next, imports, done, trail));
        trail.pop();
        found
    }
    let mut done = BTreeSet::new();
    imports.keys().find_map(|at| visit(at, imports, &mut done, &mut Vec::new()))
}

#[test]
fn no_room_of_the_library_uses_a_later_room() {
    let floors: BTreeMap<&str, u32> = FLOORS.into_iter().collect();
    let mut wrong = Vec::new();
    let room = |module: &str| module.split("::").next().unwrap_or_default().to_string();
    for (module, named) in imports(&sources("planish")) {
        if module.is_empty() {
            continue;
        }
        let Some(&floor) = floors.get(room(&module).as_str()) else {
            wrong.push(format!("{module} is in a room without a floor"));
            continue;
        };
        for other in named {
            if floors.get(room(&other).as_str()).is_some_and(|&f| f > floor) {
                wrong.push(format!("{module} uses {other} of a later room"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_crate_uses_one_above_it() {
    let house = ["planish", "planish_sparse", "planish_io", "planish_studio", "planish_app", "planish_py"];
    for (name, allowed) in MAY_USE {
        let own = name.replace('-', "_");
        for file in sources(name) {
            let text = code(&file.text);
            for other in house.iter().filter(|c| **c != own && !allowed.contains(c)) {
                let wrong = text.contains(&format!("{other}::"));
                assert!(!wrong, "{} uses {other}", file.path.display());
            }
        }
    }
}

#[test]
fn no_files_of_a_crate_import_each_other_in_a_circle() {
    for name in CRATES {
        let found = circle(&imports(&sources(name)));
        assert!(found.is_none(), "{name}: {} and back", found.unwrap_or_default().join(" -> "));
    }
}

#[test]
fn no_file_has_more_than_800_lines_and_no_room_more_than_17_entries() {
    for name in CRATES {
        let mut rooms: BTreeMap<PathBuf, BTreeSet<PathBuf>> = BTreeMap::new();
        for file in sources(name) {
            let lines = file.text.lines().count();
            assert!(lines <= CEILING, "{} has {lines} lines", file.path.display());
            let below = file.path.strip_prefix(src(name)).unwrap();
            for path in below.ancestors().take_while(|p| !p.as_os_str().is_empty()) {
                rooms.entry(path.parent().unwrap().to_path_buf()).or_default().insert(path.to_path_buf());
            }
        }
        // The root of the library has an entry for each stage.
        for (room, entries) in rooms.into_iter().filter(|(room, _)| !room.as_os_str().is_empty()) {
            assert!(entries.len() <= ROOM, "{name}: {} has {} entries", room.display(), entries.len());
        }
    }
}

#[test]
fn paths_are_read_from_use_trees_and_from_code() {
    let text = "use crate::{geom::{Aabb, Bvh}, relief};\nfn f() { super::grid::g(); }";
    assert_eq!(paths(text)[..3], ["crate::geom::Aabb", "crate::geom::Bvh", "crate::relief"]);
    assert!(paths(text).contains(&"super::grid::g".to_string()));
    let modules: BTreeSet<String> = ["", "a", "a::b", "a::c"].map(String::from).into();
    assert_eq!(absolute("super::c::f", "a::b", &modules).as_deref(), Some("a::c::f"));
    assert_eq!(absolute("b::f", "a", &modules).as_deref(), Some("a::b::f"));
    assert_eq!(absolute("std::f", "a", &modules), None);
}

#[test]
fn a_circle_of_three_files_is_found_and_a_tree_has_none() {
    let edges = |list: &[(&str, &str)]| {
        let mut all: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (a, b) in list {
            all.entry(a.to_string()).or_default().insert(b.to_string());
        }
        all
    };
    assert_eq!(circle(&edges(&[("a", "b"), ("b", "c"), ("c", "a")])).map(|c| c.len()), Some(3));
    assert_eq!(circle(&edges(&[("a", "b"), ("a", "c"), ("b", "c")])), None);
}
