//! Damaged files of every format that is read, made by a mutator from a corpus that our own writers make: every one is read or
//! refused, none makes a reader panic, and the process stays below a bound of memory.
//!
//! `PLANISH_FUZZ_SECONDS` is the time for each format (`make fuzz` gives more), `PLANISH_FUZZ_SEED` the beginning. What is found is kept in the folder
//! `fuzz-findings` under the temporary folder, whose files become cases of `malformed_meshes.rs` and its neighbours.

#![allow(clippy::print_stdout)] // counts are told to who runs them

mod common;

use common::{coloured_cube, folder, torus};
use planish::cloud::Cloud;
use planish::geom::random;
use planish::mesh::Attribute;
use planish::{DVec3, Model, Units};
use planish_io::{ScanOptions, WriteOptions};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Most memory that the whole process may ever hold, for files of some kilobytes.
const MEMORY: u64 = 1 << 30;
/// Mutations of one file at most: more leave nothing of it.
const MUTATIONS: u64 = 6;
/// Numbers that readers stumble over, as text.
const WORDS: [&str; 14] = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "4294967295",
    "4294967296",
    "18446744073709551616",
    "99999999999",
    "0.0000000000000000000000000001",
    "\u{202e}",
    "\"",
];
/// The same as four bytes.
const BYTES: [u32; 8] = [0, 1, 0x7f, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 0x7f80_0000, 0x7fc0_0000];

/// A stream of random numbers.
struct Dice {
    seed: u64,
    count: u64,
}

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.count += 1;
        (random::bits(self.seed, self.count) % n.max(1) as u64) as usize
    }
}

/// One file, damaged.
fn mutated(from: &[Vec<u8>], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = from[dice.below(from.len())].clone();
    for _ in 0..=dice.below(MUTATIONS as usize) {
        let at = dice.below(bytes.len());
        let length = 1 + dice.below(64).min(bytes.len().saturating_sub(at + 1));
        let end = (at + length).min(bytes.len());
        match dice.below(9) {
            0 if !bytes.is_empty() => bytes[at] ^= 1 << dice.below(8),
            1 if !bytes.is_empty() => bytes[at] = dice.below(256) as u8,
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..end)),
            4 => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            5 => {
                let other = &from[dice.below(from.len())];
                let start = dice.below(other.len());
                let piece = other[start..(start + length).min(other.len())].to_vec();
                bytes.splice(at..end, piece);
            }
            6 if end - at >= 4 => bytes[at..at + 4].copy_from_slice(&BYTES[dice.below(BYTES.len())].to_le_bytes()),
            7 => number(&mut bytes, at, dice),
            _ => bytes.extend_from_slice(WORDS[dice.below(WORDS.len())].as_bytes()),
        }
    }
    bytes
}

/// Puts a hostile number in place of the next one.
fn number(bytes: &mut Vec<u8>, at: usize, dice: &mut Dice) {
    let Some(start) = (at..bytes.len()).find(|&i| bytes[i].is_ascii_digit()) else { return };
    let length = bytes[start..].iter().take_while(|b| b.is_ascii_digit() || **b == b'.').count();
    bytes.splice(start..start + length, WORDS[dice.below(WORDS.len())].bytes());
}

/// Most memory that this process has held, where the system tells.
fn peak() -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches(" kB").trim().parse::<u64>().ok()).map_or(0, |kb| kb << 10)
}

fn env(name: &str, usual: f64) -> f64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(usual)
}

/// A folder in memory where the system has one: on a disk writing takes ten times as long as reading.
fn memory_folder() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").unwrap_or_else(|_| folder())
}

/// Feeds damaged files of one extension to `read` for a while; every file of the corpus is read whole first.
fn fuzz(extension: &str, corpus: &[Vec<u8>], read: impl Fn(&Path)) {
    let seconds = env("PLANISH_FUZZ_SECONDS", 3.0);
    let mut dice = Dice { seed: env("PLANISH_FUZZ_SEED", 1.0) as u64, count: 0 };
    let folder = memory_folder();
    let path = folder.path().join(format!("a.{extension}"));
    let since = Instant::now();
    let mut runs = 0u64;
    std::panic::set_hook(Box::new(|_| {}));
    let mut failed: Option<PathBuf> = None;
    while since.elapsed().as_secs_f64() < seconds && failed.is_none() {
        let bytes =
            if (runs as usize) < corpus.len() { corpus[runs as usize].clone() } else { mutated(corpus, &mut dice) };
        std::fs::write(&path, &bytes).unwrap();
        let one = Instant::now();
        let held = catch_unwind(AssertUnwindSafe(|| read(&path))).is_ok();
        if !held || peak() > MEMORY || one.elapsed() > Duration::from_secs(20) {
            let kept = std::env::temp_dir().join("fuzz-findings");
            std::fs::create_dir_all(&kept).unwrap();
            let file = kept.join(format!("{}-{runs}.{extension}", dice.seed));
            std::fs::write(&file, &bytes).unwrap();
            failed = Some(file);
        }
        runs += 1;
    }
    let _ = std::panic::take_hook();
    println!("fuzz: {runs} damaged .{extension} in {seconds} s, {} MB at most", peak() >> 20);
    assert!(failed.is_none(), "a reader panicked, took 1 GB or 20 s: {}", failed.unwrap().display());
    assert!(runs > corpus.len() as u64, "{runs} runs");
}

/// What a writer makes of something, as bytes.
fn written(name: &str, write: impl FnOnce(&Path)) -> Vec<u8> {
    let folder = folder();
    let path = folder.path().join(name);
    write(&path);
    std::fs::read(path).unwrap()
}

fn cloud() -> Cloud {
    let points: Vec<DVec3> = (0..40).map(|k| DVec3::new((k % 7) as f64, (k * 3 % 5) as f64, k as f64 / 9.0)).collect();
    let mut cloud = Cloud::new(points);
    cloud.attributes = vec![
        Attribute { name: "normal".into(), width: 3, values: [0.0, 0.0, 1.0].repeat(40) },
        Attribute { name: "intensity".into(), width: 1, values: vec![0.5; 40] },
        Attribute { name: "color".into(), width: 3, values: vec![0.25; 120] },
    ];
    cloud.scanners = vec![DVec3::new(0.0, 0.0, 100.0)];
    cloud.seen_by = vec![0; 40];
    cloud
}

fn mesh(extension: &str) -> Vec<u8> {
    written(&format!("a.{extension}"), |p| {
        planish_io::write_mesh(p, &coloured_cube(), &WriteOptions::default()).unwrap()
    })
}

fn scan(extension: &str) -> Vec<u8> {
    written(&format!("a.{extension}"), |p| planish_io::write_scan(p, &cloud()).unwrap())
}

/// Compressed points whose header tells of 32 767 records of 65 535 bytes: two gigabytes, were they unpacked at once.
fn long_records() -> Vec<u8> {
    let mut bytes = scan("laz");
    bytes[105..107].copy_from_slice(&u16::MAX.to_le_bytes());
    bytes[107..111].copy_from_slice(&32_767u32.to_le_bytes());
    bytes
}

fn read_any_scan(path: &Path) {
    let _ = planish_io::is_scan(path);
    let _ = planish_io::read_scan(path, &ScanOptions::default());
}

#[test]
fn damaged_meshes_are_read_or_refused() {
    let ascii = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\nproperty uchar \
                 feature\nelement face 2\nproperty list uchar int vertex_indices\nelement edge 1\nproperty int vertex1\nproperty int \
                 vertex2\nend_header\n0 0 0 1\n1 0 0 1\n0 1 0 0\n0 0 1 0\n3 0 1 2\n3 0 1 3\n0 1\n";
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2//1 -1/-1 \\\n 1\n";
    let stl = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    let read = |path: &Path| {
        let _ = planish_io::read_tagged_mesh(path);
    };
    fuzz("ply", &[ascii.into(), mesh("ply")], read);
    fuzz("obj", &[obj.into(), mesh("obj")], read);
    fuzz("stl", &[stl.into(), mesh("stl")], read);
    fuzz("glb", &[mesh("glb")], read);
    let glb = mesh("glb");
    // The text of a GLB is a glTF without its buffer.
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    fuzz("gltf", &[glb[20..20 + length].to_vec()], read);
    let (network, surfaces) = common::ball(5, DVec3::ZERO);
    let input =
        planish_io::StepInput { network: &network, surfaces: &surfaces, units: Units::Mm, name: "a", time: None };
    let splines = written("a.step", |p| {
        planish_io::write_step(p, &input).unwrap();
    });
    fuzz("step", &[splines, common::step_text::can(true).text().into()], read);
}

#[test]
fn damaged_scans_are_read_or_refused() {
    let pcd = "VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 \
               0\nPOINTS 2\nDATA ascii\n0 0 0 1\n1 2 3 0.5\n";
    let csv = "\"X\";\"Y\";\"Z\";\"Intensity\"\n1,5;2,5;3,5;7\n2,5;2,5;3,5;7\n";
    let npy = {
        let head = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }";
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((head.len() as u16).to_le_bytes());
        bytes.extend(head.as_bytes());
        bytes.extend((0..6).flat_map(|k| (k as f64).to_le_bytes()));
        bytes
    };
    fuzz("xyz", &[scan("xyz"), b"1 2 3\n4 5 6\n".to_vec()], read_any_scan);
    fuzz("csv", &[csv.into()], read_any_scan);
    fuzz("ply", &[scan("ply")], read_any_scan);
    fuzz("las", &[scan("las")], read_any_scan);
    fuzz("laz", &[scan("laz"), long_records()], read_any_scan);
    fuzz("e57", &[scan("e57")], read_any_scan);
    fuzz("pcd", &[pcd.into()], read_any_scan);
    fuzz("npy", &[npy], read_any_scan);
}

#[test]
fn damaged_volumes_networks_scripts_and_images_are_read_or_refused() {
    let mut nrrd =
        b"NRRD0004\ntype: float\ndimension: 3\nsizes: 2 2 2\nspacings: 1 1 1\nencoding: raw\nendian: little\n\n"
            .to_vec();
    nrrd.extend((0..8).flat_map(|k| (k as f32 - 3.5).to_le_bytes()));
    fuzz("nrrd", &[nrrd], |path| {
        let _ = planish_io::read_grid(path);
    });
    let (network, surfaces) = torus(5);
    let cube = coloured_cube();
    let text = planish_io::network_json(&network, &cube);
    fuzz("json", &[text.into_bytes()], |path| {
        let _ = planish_io::read_network(path, &coloured_cube());
    });
    let example =
        |name: &str| std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)).unwrap();
    fuzz("toml", &[example("letters.toml"), example("pocket.toml")], |path| {
        let _ = planish_io::script::read_script(path);
    });
    let reliefs = common::flat_maps(&surfaces, 5, 5);
    let folder = folder();
    planish_io::write_relief(folder.path(), &reliefs, Units::Mm).unwrap();
    let image = std::fs::read(folder.path().join("patch_0000.exr")).unwrap();
    fuzz("exr", &[image], |path| {
        let _ = planish_io::image_facts(path);
    });
}

#[test]
fn damaged_projects_are_read_or_refused() {
    let (network, surfaces) = torus(5);
    let model = Model { mesh: coloured_cube(), network, surfaces, ..Model::default() };
    let project = written("a.planish", |p| planish_io::write_model(p, &model).unwrap());
    fuzz("planish", &[project], |path| {
        let _ = planish_io::read_model(path);
    });
}
