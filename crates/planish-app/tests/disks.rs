//! Full and read-only disks: what cannot be written is told in a line, and what was there before stays.
//!
//! A small file system in memory needs the rights of root; without them the tests say so and pass.

#![cfg(target_os = "linux")]
#![allow(clippy::print_stdout)] // skipped tests are told to who runs them

mod common;

use common::*;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A small file system of its own, taken away at the end.
struct Disk {
    folder: tempfile::TempDir,
}

impl Disk {
    /// A disk of `size` bytes, or `None` where nobody but root may make one.
    fn new(size: usize) -> Option<Disk> {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("disk")).unwrap();
        let disk = Disk { folder };
        disk.mount(&["-t", "tmpfs", "-o", &format!("size={size}"), "planish-test"]).then_some(disk)
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("disk")
    }

    fn mount(&self, args: &[&str]) -> bool {
        let mut command = Command::new("mount");
        command.args(args).arg(self.path()).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|s| s.success())
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.path()).stderr(Stdio::null()).status();
    }
}

/// Inputs beside the disk: a mesh, a cloud and a model.
fn inputs(folder: &Path) {
    write_box(&folder.join("box.ply"), 6);
    let point = |k: usize| {
        let (z, a) = (1.0 - 2.0 * (k as f64 + 0.5) / 2000.0, 2.4 * k as f64);
        let r = (1.0f64 - z * z).sqrt();
        format!("{} {} {z}\n", r * a.cos(), r * a.sin())
    };
    fs::write(folder.join("a.xyz"), (0..2000).map(point).collect::<String>()).unwrap();
    let output = planish(&["fit", "box.ply", "-q", "-o", "m.planish", "--patches", "6"], folder);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
}

/// Every way to write, and the file or folder on the disk that it writes.
const WRITES: [(&[&str], &str); 15] = [
    (&["clean", "a.xyz", "-o"], "x.laz"),
    (&["clean", "a.xyz", "-o"], "x.las"),
    (&["clean", "a.xyz", "-o"], "x.e57"),
    (&["clean", "a.xyz", "-o"], "x.xyz"),
    (&["clean", "a.xyz", "-o"], "x.ply"),
    (&["smooth", "box.ply", "-o"], "x.stl"),
    (&["smooth", "box.ply", "-o"], "x.obj"),
    (&["smooth", "box.ply", "-o"], "x.glb"),
    (&["layout", "box.ply", "--patches", "6", "-o"], "x.json"),
    (&["info", "box.ply", "--report"], "x.json"),
    (&["fit", "box.ply", "--patches", "6", "-o"], "x.planish"),
    (&["export", "m.planish", "-o"], "x.step"),
    (&["export", "m.planish", "-o"], "maps"),
    (&["mesh", "box.ply", "--resolution", "20", "-o"], "y.ply"),
    (&["run", "box.ply", "--patches", "6", "-o"], "out"),
];

#[test]
fn a_full_disk_is_told_in_a_line_of_status_2_and_what_was_there_stays() {
    let Some(disk) = Disk::new(1 << 16) else { return println!("skipped: no file system can be mounted here") };
    inputs(disk.folder.path());
    fs::write(disk.path().join("x.json"), "{\"generator\": \"planish\"}").unwrap();
    // All pages are taken: folders and empty files can be made, and nothing written.
    fs::write(disk.path().join("filler"), vec![0; (1 << 16) - 4096]).unwrap();
    for (args, name) in WRITES {
        let output = planish(&[args, &[&format!("disk/{name}")]].concat(), disk.folder.path());
        assert_eq!(status(&output), 2, "{args:?} {name}: {}", stderr(&output));
        let line = error_line(&output);
        assert!(line.contains("room") && line.contains(name), "{name}: {line}");
        assert_eq!(names(&disk.path()), ["filler", "x.json"], "{args:?} {name}");
    }
    assert_eq!(fs::read_to_string(disk.path().join("x.json")).unwrap(), "{\"generator\": \"planish\"}");
}

#[test]
fn a_read_only_disk_is_told_before_the_work() {
    let Some(disk) = Disk::new(1 << 20) else { return println!("skipped: no file system can be mounted here") };
    inputs(disk.folder.path());
    fs::write(disk.path().join("x.json"), "{\"generator\": \"planish\"}").unwrap();
    assert!(disk.mount(&["-o", "remount,ro"]));
    for (args, name) in WRITES {
        let output = planish(&[args, &[&format!("disk/{name}"), "-v"]].concat(), disk.folder.path());
        assert_eq!(status(&output), 2, "{args:?} {name}: {}", stderr(&output));
        // One line alone: no stage has told its time.
        assert!(error_line(&output).contains("read-only"), "{name}: {}", stderr(&output));
        assert_eq!(names(&disk.path()), ["x.json"], "{args:?} {name}");
    }
}
