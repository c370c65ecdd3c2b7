//! What a command will write, checked before its work: no file is lost that this program did not write, and no two files
//! of one command are one.
//!
//! A file bears the mark of the program if its head or its tail names it; every writer leaves that mark. What does not
//! bear it belongs to somebody else.

use crate::args::relief::ReliefCommand;
use crate::args::{Command, Policy, Step};
use crate::failure::Failure;
use planish_io::ExportKind;
use std::fs;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Products of `planish run` in its folder.
pub const PRODUCTS: [&str; 8] =
    ["mesh.ply", "model.planish", "surface.step", "preview.glb", "report.json", "report.html", "points.ply", "relief"];
/// What a batch has in its folder beside the folders of its runs: what is finished, and all rows for programs and for people.
pub const BATCH_PRODUCTS: [&str; 3] = ["manifest.json", "batch.json", "batch.html"];
/// What `planish demo` adds to them.
pub const DEMO_PRODUCTS: [&str; 2] = ["scan.e57", "truth.ply"];
/// The product that is a folder.
pub const RELIEF: &str = "relief";

/// Bytes at either end of a file in which the mark is looked for: headers of all formats, and the XML at the end of an E57.
const MARKED: u64 = 1 << 16;

/// Checks the files of a command that are known before its work.
/// # Errors
/// The first output that may not be written, with the way out.
pub fn check(command: &Command) -> Result<(), Failure> {
    let Some(common) = command.common() else { return Ok(()) };
    let (inputs, mut outputs) = files(command);
    outputs.extend(common.report.clone());
    let inputs: Vec<&Path> = inputs.iter().map(|p| p.as_path()).collect();
    allow(&inputs, &outputs, common.policy())?;
    match command {
        Command::Export(a) if is_folder_of_maps(&a.output) => allow_maps(&a.output, common.policy()),
        Command::Mesh(a) if a.tiles.is_some() => {
            allow_named(&a.output, planish_io::tile_names(&a.output), planish_io::is_tile_name, common.policy())
        }
        Command::Relief(a) => match &a.command {
            ReliefCommand::Export(a) => allow_maps(&a.output, common.policy()),
            _ => Ok(()),
        },
        _ => Ok(()),
    }
}

/// True if the maps of a model go there, and no single file.
fn is_folder_of_maps(output: &Path) -> bool {
    planish_io::export_kind(output).is_ok_and(|kind| kind == ExportKind::Relief)
}

/// What a command reads and what it writes.
fn files(command: &Command) -> (Vec<PathBuf>, Vec<PathBuf>) {
    let products = |folder: &Path, more: &[&str]| PRODUCTS.iter().chain(more).map(|p| folder.join(p)).collect();
    match command {
        Command::Demo(a) => (Vec::new(), products(&a.output, &DEMO_PRODUCTS)),
        // Each run of a batch looks after its own products.
        Command::Run(a) if a.is_batch() => (Vec::new(), BATCH_PRODUCTS.iter().map(|p| a.output.join(p)).collect()),
        Command::Run(a) => (a.inputs.iter().cloned().chain(a.network.clone()).collect(), products(&a.output, &[])),
        Command::Clean(a) => {
            (vec![a.scan.clone()], [Some(a.output.clone()), a.lines.clone()].into_iter().flatten().collect())
        }
        Command::Mesh(a) if a.tiles.is_some() => (vec![a.input.clone()], Vec::new()),
        Command::Mesh(a) => (vec![a.input.clone()], vec![a.output.clone()]),
        Command::Smooth(a) => (vec![a.mesh.clone()], vec![a.output.clone()]),
        Command::Decimate(a) => (vec![a.mesh.clone()], vec![a.output.clone()]),
        Command::Layout(a) => (vec![a.mesh.clone()], vec![a.output.clone()]),
        Command::Fit(a) => {
            (std::iter::once(a.input.clone()).chain(a.network.clone()).collect(), vec![a.output.clone()])
        }
        // Without -o the model is edited where it is, with its history: that is asked for by the command itself.
        Command::Edit(a) => (vec![a.input.clone(), a.script.clone()], a.output.iter().cloned().collect()),
        Command::Deform(a) => (vec![a.model.clone(), a.to.clone()], vec![a.output.clone()]),
        Command::Relief(a) => {
            let (inputs, outputs) = relief_files(&a.command);
            (inputs, outputs)
        }
        Command::Export(a) => {
            let is_folder = is_folder_of_maps(&a.output);
            (vec![a.model.clone()], if is_folder { Vec::new() } else { vec![a.output.clone()] })
        }
        Command::Compare(a) => {
            (vec![a.a.clone(), a.b.clone()], [a.output.clone(), a.picture.clone()].into_iter().flatten().collect())
        }
        Command::Transform(a) => {
            let named = a.steps.0.iter().filter_map(|step| match step {
                Step::Align(path) | Step::Pairs(path) => Some(path.clone()),
                _ => None,
            });
            (std::iter::once(a.input.clone()).chain(named).collect(), vec![a.output.clone()])
        }
        Command::Info(a) => (a.files.clone(), Vec::new()),
        // A project is worked on where it is; that of a mesh or a scan gets a name that no file has.
        Command::Studio(a) => (a.file.iter().cloned().collect(), Vec::new()),
        Command::Completions(_) | Command::Man(_) => (Vec::new(), Vec::new()),
    }
}

/// What a command of reliefs reads, and the files that it writes.
fn relief_files(command: &ReliefCommand) -> (Vec<PathBuf>, Vec<PathBuf>) {
    match command {
        ReliefCommand::Export(a) => (vec![a.model.clone()], Vec::new()),
        ReliefCommand::Import(a) => (vec![a.model.clone()], vec![a.output.clone()]),
        ReliefCommand::Edit(a) => (
            vec![a.model.clone(), a.script.clone()],
            std::iter::once(a.output.clone()).chain(a.picture.clone()).collect(),
        ),
        ReliefCommand::Part(a) => (vec![a.model.clone()], vec![a.output.clone()]),
        ReliefCommand::Level(a) => (vec![a.model.clone()], vec![a.output.clone()]),
        ReliefCommand::Transfer(a) => {
            (std::iter::once(a.model.clone()).chain(a.from.clone()).collect(), vec![a.output.clone()])
        }
    }
}

/// Checks that every output may be written.
/// # Errors
/// The first that may not, with the way out.
pub fn allow(inputs: &[&Path], outputs: &[PathBuf], policy: Policy) -> Result<(), Failure> {
    for (i, output) in outputs.iter().enumerate() {
        if outputs[..i].iter().any(|other| is_same(other, output)) {
            let what = "is to be two outputs of this command at once";
            return Err(Failure::usage(output, what).hint("give each a name of its own"));
        }
        if inputs.iter().any(|input| is_same(input, output)) {
            if !policy.in_place {
                let what = "is an input of this command, and its output would take its place";
                return Err(Failure::usage(output, what).hint("name another file, or say --in-place"));
            }
            continue;
        }
        let Ok(found) = fs::metadata(output) else { continue };
        let is_relief = output.file_name().is_some_and(|n| n == RELIEF);
        if found.is_dir() {
            if is_relief && (policy.force || is_own_relief(output)) {
                allow_maps(output, policy)?;
                continue;
            }
            let what =
                if is_relief { "is a folder with files of its own" } else { "is a folder where a file is to go" };
            return Err(Failure::usage(output, what).hint("rename it, or name another place with -o"));
        }
        if policy.no_clobber {
            return Err(
                Failure::usage(output, "is there already").hint("name another file, or leave --no-clobber away")
            );
        }
        if policy.force || !found.is_file() {
            continue;
        }
        if found.permissions().readonly() {
            return Err(Failure::usage(output, "is write-protected").hint("name another file, or say --force"));
        }
        if found.len() > 0 && !bears_mark(output) {
            let what = "is there already and was not written by planish";
            return Err(Failure::usage(output, what).hint("name another file, or replace it with --force"));
        }
    }
    Ok(())
}

/// True if a folder of maps is empty or has the sidecar of this program.
fn is_own_relief(folder: &Path) -> bool {
    let is_empty = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    is_empty || !planish_io::relief_names(folder).is_empty()
}

/// Checks a folder that maps go to.
fn allow_maps(folder: &Path, policy: Policy) -> Result<(), Failure> {
    allow_named(folder, planish_io::relief_names(folder), planish_io::is_relief_name, policy)
}

/// Checks a folder that files of some names go to: what bears such a name there must be one that the list of this program's, which
/// lies beside, names.
fn allow_named(folder: &Path, own: Vec<String>, is_name: fn(&str) -> bool, policy: Policy) -> Result<(), Failure> {
    let names =
        fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.file_name().to_string_lossy().into_owned());
    let mut found: Vec<String> = names.filter(|name| is_name(name)).collect();
    found.sort();
    for name in found {
        let path = folder.join(&name);
        if path.is_dir() {
            return Err(Failure::usage(path, "is a folder where a file is to go")
                .hint("rename it, or name another place with -o"));
        }
        if policy.no_clobber {
            return Err(
                Failure::usage(path, "is there already").hint("name another folder, or leave --no-clobber away")
            );
        }
        if !policy.force && !own.contains(&name) {
            let what = "is there already and was not written by planish";
            return Err(Failure::usage(path, what).hint("name another folder, or replace it with --force"));
        }
    }
    Ok(())
}

/// True if this program wrote the file.
fn bears_mark(path: &Path) -> bool {
    let read = || -> std::io::Result<bool> {
        let mut file = fs::File::open(path)?;
        let length = file.metadata()?.len();
        let mut head = Vec::new();
        file.by_ref().take(MARKED).read_to_end(&mut head)?;
        let mut tail = Vec::new();
        file.seek(SeekFrom::Start(length.saturating_sub(MARKED)))?;
        file.take(MARKED).read_to_end(&mut tail)?;
        let names_it = |bytes: &[u8]| bytes.windows(7).any(|w| w.eq_ignore_ascii_case(b"planish"));
        Ok(names_it(&head) || names_it(&tail))
    };
    read().unwrap_or(false)
}

/// True if two paths lead to one file, through links and other ways of writing it, too.
fn is_same(a: &Path, b: &Path) -> bool {
    let (a, b) = (resolved(a), resolved(b));
    a == b || is_linked(&a, &b)
}

#[cfg(unix)]
fn is_linked(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (fs::metadata(a), fs::metadata(b)) {
        (Ok(a), Ok(b)) => a.is_file() && (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => false,
    }
}

#[cfg(not(unix))]
fn is_linked(_: &Path, _: &Path) -> bool {
    false
}

/// The path with links followed; of a file that is not there yet, its folder's.
fn resolved(path: &Path) -> PathBuf {
    if let Ok(whole) = fs::canonicalize(path) {
        return whole;
    }
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    match (absolute.parent().and_then(|p| fs::canonicalize(p).ok()), absolute.file_name()) {
        (Some(folder), Some(name)) => folder.join(name),
        _ => absolute,
    }
}
