//! What happens to project files when things go wrong: a killed edit, two at once, a damaged page, a file that is taken away.
//!
//! `PLANISH_KILLS` is the number of sessions that are killed (`make fuzz` kills 300).

#![cfg(unix)]
#![allow(clippy::print_stdout)] // counts are told to who runs them

mod common;

use common::*;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A fitted box, and a script of two strokes.
fn project(folder: &Path) {
    write_box(&folder.join("box.ply"), 6);
    let output = planish(&["fit", "box.ply", "-q", "-o", "m.planish", "--patches", "6"], folder);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let stroke = |z: f64| format!("[[step]]\nedit = \"paint\"\npicks = [[0.0, 0.5, {z}], [0.0, 0.9, {z}]]\n");
    fs::write(folder.join("s.toml"), stroke(0.4) + &stroke(0.6)).unwrap();
}

fn edit(folder: &Path) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_planish"));
    command.args(["edit", "m.planish", "s.toml", "--no-fit", "-q", "--threads", "1"]).current_dir(folder);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Edits of the history, as `info` tells them; the file is whole.
fn history(folder: &Path) -> usize {
    let output = planish(&["info", "m.planish"], folder);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let table = stdout(&output);
    let line = table.lines().find(|l| l.starts_with("history")).unwrap_or_default();
    line.matches("paint").count()
}

#[test]
fn a_session_that_is_killed_leaves_the_project_whole_with_the_history_before_it_or_after_it() {
    let count: u64 = std::env::var("PLANISH_KILLS").ok().and_then(|v| v.parse().ok()).unwrap_or(12);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    project(path);
    let first = fs::read(path.join("m.planish")).unwrap();
    // How long a session takes, and that it does something.
    let since = Instant::now();
    assert!(edit(path).wait().unwrap().success());
    let whole = since.elapsed();
    assert_eq!(history(path), 2);
    let mut killed = 0;
    for k in 0..count {
        fs::write(path.join("m.planish"), &first).unwrap();
        let mut child = edit(path);
        let share = planish::geom::random::unit(5, k) * 1.1;
        std::thread::sleep(Duration::from_secs_f64(whole.as_secs_f64() * share));
        child.kill().unwrap();
        killed += usize::from(!child.wait().unwrap().success());
        let found = history(path);
        assert!(found == 0 || found == 2, "session {k}: {found} edits of 2");
        if found == 0 {
            assert_eq!(fs::read(path.join("m.planish")).unwrap(), first, "session {k}");
        }
    }
    println!("killed: {killed} of {count} sessions before their end");
    // What the killed have left is swept by the next that ends.
    fs::write(path.join("m.planish"), &first).unwrap();
    assert!(edit(path).wait().unwrap().success());
    assert_eq!(names(path), ["box.ply", "m.planish", "s.toml"]);
}

#[test]
fn two_sessions_at_once_leave_one_whole_history() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    project(path);
    let mut both = [edit(path), edit(path)];
    both.iter_mut().for_each(|child| _ = child.wait().unwrap());
    let found = history(path);
    assert!(found == 2 || found == 4, "{found}");
    assert_eq!(names(path), ["box.ply", "m.planish", "s.toml"]);
}

#[test]
fn a_damaged_page_a_cut_file_and_a_file_that_is_gone_are_told_in_a_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    project(path);
    let whole = fs::read(path.join("m.planish")).unwrap();
    let mut told = 0;
    for k in 0..40 {
        let mut bytes = whole.clone();
        let at = 100 + (planish::geom::random::bits(7, k) % (bytes.len() as u64 - 200)) as usize;
        (at..at + 64).for_each(|i| bytes[i] = !bytes[i]);
        fs::write(path.join("d.planish"), &bytes).unwrap();
        let output = planish(&["export", "d.planish", "-q", "--force", "-o", "d.json"], path);
        // A page that nobody uses may be damaged without harm.
        if status(&output) != 0 {
            assert_eq!(status(&output), 3, "{}", stderr(&output));
            error_line(&output);
            told += 1;
        }
    }
    assert!(told > 10, "{told}");
    fs::write(path.join("d.planish"), &whole[..whole.len() / 2]).unwrap();
    assert_eq!(status(&planish(&["info", "d.planish"], path)), 3);
    // Taken away while it is edited: what is there afterwards is whole, unless the edit was done before.
    let mut child = edit(path);
    std::thread::sleep(Duration::from_millis(30));
    let _ = fs::remove_file(path.join("m.planish"));
    if child.wait().unwrap().success() && path.join("m.planish").exists() {
        assert!(history(path) == 2);
    }
    assert!(names(path).iter().all(|name| !name.starts_with(".planish")), "{:?}", names(path));
}
