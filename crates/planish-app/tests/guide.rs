//! Pages and program agree: every option that a page names is there, and every option is in the guide.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn help(args: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_planish")).args(args).output().expect("the program starts");
    String::from_utf8(output.stdout).unwrap()
}

/// The options of every command, as its help has them.
fn options() -> BTreeMap<String, BTreeSet<String>> {
    let commands = commands(&["--help"]);
    let of = |command: &str| {
        let told = help(&[command, "--help"]);
        let lines = told.lines().map(str::trim_start).filter(|l| l.starts_with('-'));
        lines.flat_map(|l| named(l.split("  ").next().unwrap_or_default())).collect()
    };
    // Those of a family stand together: `planish relief export`.
    let inner = |command: &str, word: &str| {
        let told = help(&[command, word, "--help"]);
        let lines = told.lines().map(str::trim_start).filter(|l| l.starts_with('-'));
        lines.flat_map(|l| named(l.split("  ").next().unwrap_or_default())).collect::<Vec<String>>()
    };
    let all = |c: &String| {
        let mut own: BTreeSet<String> = of(c);
        commands_of(c).iter().for_each(|word| own.extend(inner(c, word)));
        own
    };
    commands.iter().map(|c| (c.clone(), all(c))).collect()
}

fn commands_of(command: &str) -> Vec<String> {
    commands(&[command, "--help"])
}

/// The commands that a help lists.
fn commands(args: &[&str]) -> Vec<String> {
    help(args)
        .lines()
        .skip_while(|l| !l.starts_with("Commands:"))
        .skip(1)
        .map_while(|l| l.split_whitespace().next().map(str::to_owned))
        .filter(|c| c != "help")
        .collect()
}

#[test]
fn the_guide_tells_of_every_key_of_a_report() {
    let text = fs::read_to_string(root().join("docs/guide/report.md")).unwrap();
    let has = |word: &str| text.contains(&format!("`{word}`"));
    // Keys of one family stand together, `mesh.area`, `.volume`, and those of the stages, `truth.mesh_rms`, by their parts. A second
    // key that is the same as a share of the diagonal is told once for all.
    let is_told = |name: &str| {
        let (_, last) = name.split_once('.').expect("a family and a name");
        let by_parts = || last.split_once('_').is_some_and(|(stage, rest)| has(&format!("{stage}_")) && has(rest));
        has(name) || has(&format!(".{last}")) || has(last) || by_parts()
    };
    let names = planish::pipeline::key::ALL.iter().map(|key| key.name).filter(|name| !name.ends_with("_rel"));
    let missing: Vec<&str> = names.filter(|name| !is_told(name)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// The options in a piece of text.
fn named(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices("--") {
        let is_part = |c: char| c.is_ascii_alphanumeric() || c == '-';
        if text[..at].chars().next_back().is_some_and(is_part) {
            continue;
        }
        let name: String = text[at + 2..].chars().take_while(|c| is_part(*c)).collect();
        if name.starts_with(|c: char| c.is_ascii_lowercase()) {
            found.push(format!("--{name}"));
        }
    }
    found
}

/// Code and text of a file in pieces that belong together: a line of code, a code span, what is between spans.
fn pieces(path: &Path) -> Vec<String> {
    let text = fs::read_to_string(path).unwrap();
    if path.extension().is_none_or(|e| e != "md") {
        return text.lines().map(str::to_owned).collect();
    }
    let (mut pieces, mut paragraph, mut fenced) = (Vec::new(), String::new(), false);
    for line in text.lines().chain([""]) {
        let fence = line.starts_with("```");
        fenced ^= fence;
        let code = fenced || line.starts_with("    ");
        if code || fence || line.is_empty() {
            pieces.extend(std::mem::take(&mut paragraph).split('`').map(str::to_owned));
        }
        if code {
            pieces.push(line.to_owned());
        } else if !fence {
            paragraph += line;
            paragraph.push(' ');
        }
    }
    pieces
}

fn files(folder: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(root().join(folder)).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&format!("{folder}/{}", path.file_name().unwrap().to_string_lossy())));
        } else if path.extension().is_some_and(|e| ["md", "sh", "toml", "py"].iter().any(|x| e == *x)) {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn every_option_that_a_page_or_an_example_names_is_one_of_that_command() {
    let options = options();
    let any: BTreeSet<String> = options.values().flatten().cloned().chain(["--version".into()]).collect();
    assert!(options.len() >= 12 && any.len() > 50, "{options:?}");
    let mut wrong = Vec::new();
    let mut checked = 0;
    for path in [vec![root().join("README.md")], files("docs"), files("examples")].concat() {
        for piece in pieces(&path) {
            let piece = piece.replace("\"$planish\"", "planish");
            let words: Vec<&str> = piece.split_whitespace().collect();
            let first = words.first().copied().unwrap_or_default();
            let after = words.windows(2).find(|w| w[0] == "planish").map(|w| w[1]);
            let known = match after.and_then(|c| options.get(c)).or_else(|| options.get(first)) {
                Some(own) => own,
                // Options of other programs.
                None if ["cargo", "python3", "pip", "git"].contains(&first) => continue,
                None => &any,
            };
            for option in named(&piece) {
                checked += 1;
                if !known.contains(&option) {
                    wrong.push(format!("{}: {option} in \"{}\"", path.display(), piece.trim()));
                }
            }
        }
    }
    assert!(checked > 100, "{checked}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_option_of_every_command_is_in_the_guide() {
    let text: Vec<String> = files("docs/guide").iter().flat_map(|p| pieces(p)).collect();
    let told: BTreeSet<String> = text.iter().flat_map(|p| named(p)).collect();
    let mut missing = Vec::new();
    for (command, own) in options() {
        missing.extend(own.into_iter().filter(|o| !told.contains(o)).map(|o| format!("planish {command} {o}")));
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}
