//! Messages: one short line with a way out, the status of whose fault it is, and nothing that steers the terminal.

mod common;

use common::*;
use std::fs;
use std::time::{Duration, Instant};

#[test]
fn a_fault_of_the_input_is_status_3_whatever_the_output_is_called() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_box(&at("box.ply"), 4);
    fs::write(at("lines.toml"), "[[step]]\nedit = \"feature_lines\"\nangle_deg = 40.0\n").unwrap();
    let output = planish(&["edit", "box.ply", "lines.toml", "-q", "--no-fit", "-o", "bare.planish"], folder.path());
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    for name in ["x.step", "maps"] {
        let output = planish(&["export", "bare.planish", "-o", name], folder.path());
        assert_eq!(status(&output), 3, "{name}: {}", stderr(&output));
        assert!(error_line(&output).starts_with("error: bare.planish: "), "{}", stderr(&output));
        assert!(!at(name).exists());
    }
}

#[test]
fn texts_that_are_not_utf_8_or_long_or_steer_the_terminal_are_told_in_a_short_plain_line() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_box(&at("box.ply"), 2);
    fs::write(at("latin.toml"), b"[[step]]\nedit = \"paint\" # \xe9\n").unwrap();
    fs::write(at("long.toml"), format!("[[step]]\nedit = \"{}\"\n", "x".repeat(5000))).unwrap();
    fs::write(at("escape.toml"), "[[step]]\nedit = \"\\u001b[31mred\"\n").unwrap();
    fs::write(at("\u{1b}[31m.ply"), "not a mesh").unwrap();
    fs::write(at("huge.obj"), format!("v {} 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "9".repeat(400))).unwrap();
    for (args, words) in [
        (
            &["edit", "box.ply", "latin.toml", "-o", "m.planish"][..],
            "is no text in UTF-8 (line 2) - hint: save it as UTF-8",
        ),
        (&["edit", "box.ply", "long.toml", "-o", "m.planish"], "xxx..."),
        (&["edit", "box.ply", "escape.toml", "-o", "m.planish"], "[31mred"),
        (&["info", "\u{1b}[31m.ply"], "[31m.ply"),
        (&["info", "huge.obj"], "huge.obj"),
    ] {
        let output = planish(args, folder.path());
        assert_eq!(status(&output), 3, "{args:?}: {}", stderr(&output));
        let line = error_line(&output);
        assert!(line.contains(words) && line.contains(" - hint: "), "{args:?}: {line}");
        assert!(!line.contains('\u{1b}'), "{line:?}");
    }
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused_at_once_wherever_a_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_box(&at("box.ply"), 2);
    for name in ["p.ply", "p.planish", "p.toml", "p.json", "p.xyz", "p.nrrd"] {
        let made = std::process::Command::new("mkfifo").arg(at(name)).status();
        assert!(made.is_ok_and(|s| s.success()));
    }
    fs::write(
        at("job.toml"),
        "[stock]\nfrom = [0,0,0]\nto = [1,1,1]\n[[tool]]\nname = \"a\"\nkind = \"ball\"\nradius = 0.1\n[[path]]\ntool = \"a\"\ngcode = \"/dev/zero\"\n",
    )
    .unwrap();
    for args in [
        &["info", "p.ply"][..],
        &["info", "p.planish"],
        &["info", "p.xyz"],
        &["run", "p.ply", "-o", "out"],
        &["fit", "p.planish", "-o", "m.planish"],
        &["fit", "box.ply", "--network", "p.json", "-o", "m.planish"],
        &["edit", "box.ply", "p.toml", "-o", "m.planish"],
        &["mesh", "p.nrrd", "-o", "m.ply"],
        &["mesh", "p.toml", "-o", "m.ply"],
        &["mesh", "job.toml", "-o", "m.ply"],
    ] {
        let since = Instant::now();
        let output = planish(args, folder.path());
        assert_eq!(status(&output), 3, "{args:?}: {}", stderr(&output));
        assert!(error_line(&output).contains(" - hint: "), "{}", stderr(&output));
        assert!(since.elapsed() < Duration::from_secs(2), "{args:?}: {:?}", since.elapsed());
    }
}
