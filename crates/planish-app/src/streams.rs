//! Standard input and output in the place of files: `-`.
//!
//! Readers and writers work on files by their extension. What comes in is put into a file of a scratch folder first, and what
//! goes out is made in one and copied at the end, so that a product appears whole or not at all there, too. The user is told of
//! `-`, never of these files.

use crate::args::Command;
use crate::failure::Failure;
use crate::products::Staged;
use crate::stdout::{self, Carries};
use crate::words::{self, DASH};
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Bytes at the beginning by which a format is told.
const HEAD: usize = 1 << 12;

/// The streams that a command uses.
pub struct Streams {
    scratch: Option<Staged>,
    output: Option<PathBuf>,
}

/// Puts files in the places of `-`, and reads standard input.
/// # Errors
/// If a command cannot use a stream there, if nobody knows what standard input is, or if it cannot be read.
pub fn open(command: &mut Command) -> Result<Streams, Failure> {
    let (inputs, from, output, to) = places(command);
    let dashes: Vec<&mut PathBuf> = inputs.into_iter().filter(|p| p.as_os_str() == DASH).collect();
    let output = output.filter(|p| p.as_os_str() == DASH);
    if let (true, Some(format)) = (dashes.is_empty(), &from) {
        return Err(Failure::usage("--from", format!("tells that standard input is {format}, and no input is -"))
            .hint("leave it out, or name - as the input"));
    }
    if let (None, Some(format)) = (&output, &to) {
        return Err(Failure::usage("--to", format!("asks for {format} on standard output, and no output is -"))
            .hint("leave it out, or say -o -"));
    }
    if dashes.is_empty() && output.is_none() {
        return Ok(Streams { scratch: None, output: None });
    }
    if dashes.len() > 1 {
        return Err(Failure::usage(DASH, "is two inputs at once").hint("name a file for one of them"));
    }
    let scratch = Staged::scratch()?;
    words::hide(scratch.path("").components().collect());
    for input in dashes {
        let path = read(&scratch, from.as_deref())?;
        *input = path;
    }
    let mut made = None;
    if let Some(output) = output {
        let Some(format) = to.as_deref().map(extension) else {
            return Err(Failure::usage("-o -", "does not tell the format").hint("say --to, such as --to ply"));
        };
        *output = scratch.path(&format!("stdout.{format}"));
        made = Some(output.clone());
        stdout::carry(Carries::Product)?;
    }
    Ok(Streams { scratch: Some(scratch), output: made })
}

impl Streams {
    /// Copies the product to standard output.
    /// # Errors
    /// If it cannot be written there; a closed pipe is none.
    pub fn close(self) -> Result<(), Failure> {
        if let Some(path) = &self.output {
            let copied = File::open(path).and_then(|mut file| {
                let mut out = io::stdout().lock();
                io::copy(&mut file, &mut out)?;
                out.flush()
            });
            match copied {
                Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
                    return Err(crate::products::unwritable(Path::new(DASH), &e));
                }
                _ => {}
            }
        }
        drop(self.scratch);
        Ok(())
    }
}

/// Inputs, what standard input is, the output, and what standard output is to be, of commands that can use them.
type Places<'a> = (Vec<&'a mut PathBuf>, Option<String>, Option<&'a mut PathBuf>, Option<String>);

fn places(command: &mut Command) -> Places<'_> {
    match command {
        Command::Run(a) => (a.inputs.iter_mut().collect(), a.from.from.clone(), None, None),
        Command::Clean(a) => (vec![&mut a.scan], a.from.from.clone(), Some(&mut a.output), a.to.to.clone()),
        Command::Mesh(a) => {
            // A formula is no file.
            let inputs = if a.formula { Vec::new() } else { vec![&mut a.input] };
            (inputs, a.from.from.clone(), Some(&mut a.output), a.to.to.clone())
        }
        Command::Smooth(a) => (vec![&mut a.mesh], a.from.from.clone(), Some(&mut a.output), a.to.to.clone()),
        Command::Decimate(a) => (vec![&mut a.mesh], a.from.from.clone(), Some(&mut a.output), a.to.to.clone()),
        Command::Transform(a) => (vec![&mut a.input], a.from.from.clone(), Some(&mut a.output), a.to.to.clone()),
        Command::Export(a) => (vec![&mut a.model], a.from.from.clone(), Some(&mut a.output), a.to.to.clone()),
        // These write one format each.
        Command::Layout(a) => {
            let to = (a.output.as_os_str() == DASH).then(|| "json".to_owned());
            (vec![&mut a.mesh], a.from.from.clone(), Some(&mut a.output), to)
        }
        Command::Fit(a) => {
            let to = (a.output.as_os_str() == DASH).then(|| "planish".to_owned());
            (vec![&mut a.input], a.from.from.clone(), Some(&mut a.output), to)
        }
        Command::Compare(a) => (vec![&mut a.a, &mut a.b], a.from.from.clone(), None, None),
        Command::Info(a) => (a.files.iter_mut().collect(), a.from.from.clone(), None, None),
        _ => (Vec::new(), None, None, None),
    }
}

fn extension(word: &str) -> String {
    word.trim_start_matches('.').to_ascii_lowercase()
}

/// Reads standard input into a file whose extension tells what it is.
fn read(scratch: &Staged, from: Option<&str>) -> Result<PathBuf, Failure> {
    let unreadable = |e: io::Error| Failure::input(DASH, format!("cannot be read ({})", crate::products::plain(&e)));
    let mut input = io::stdin().lock();
    let mut head = Vec::new();
    input.by_ref().take(HEAD as u64).read_to_end(&mut head).map_err(unreadable)?;
    if head.is_empty() {
        return Err(Failure::input(DASH, "nothing comes from standard input").hint("lead a file or a program into it"));
    }
    let format = match from.map(extension).or_else(|| sniffed(&head).map(str::to_owned)) {
        Some(format) => format,
        None => {
            return Err(
                Failure::input(DASH, "is of no kind that its first bytes tell").hint("say --from, such as --from stl")
            );
        }
    };
    let path = scratch.path(&format!("stdin.{format}"));
    let mut write = || -> io::Result<()> {
        let mut file = File::create(&path)?;
        file.write_all(&head)?;
        io::copy(&mut input, &mut file).map(drop)
    };
    write().map_err(unreadable)?;
    Ok(path)
}

/// The extension of a format that begins like this.
fn sniffed(head: &[u8]) -> Option<&'static str> {
    let marks: [(&[u8], &str); 13] = [
        (b"ply\n", "ply"),
        (b"ply\r", "ply"),
        (b"glTF", "glb"),
        (b"ASTM-E57", "e57"),
        // LAZ differs in a bit that the reader looks at.
        (b"LASF", "las"),
        (b"# .PCD", "pcd"),
        (b"NRRD", "nrrd"),
        (b"\x93NUMPY", "npy"),
        (b"PK\x03\x04", "npz"),
        (b"SQLite format 3", "planish"),
        (b"ISO-10303-21", "step"),
        (b"solid", "stl"),
        (b"\x76\x2f\x31\x01", "exr"),
    ];
    if let Some((_, format)) = marks.iter().find(|(mark, _)| head.starts_with(mark)) {
        return Some(format);
    }
    if head.contains(&0) {
        // A binary STL has 80 letters of anything, and a count.
        return (head.len() > 84).then_some("stl");
    }
    let text = String::from_utf8_lossy(head);
    let first = text.lines().map(str::trim).find(|l| !l.is_empty() && !l.starts_with('#'))?;
    let word = first.split_whitespace().next()?;
    match word {
        "v" | "vn" | "vt" | "o" | "g" | "mtllib" | "s" | "usemtl" => Some("obj"),
        _ if first.starts_with('[') || first.contains(" = ") => Some("toml"),
        _ if first.split([' ', '\t', ',', ';']).filter(|w| !w.is_empty()).take(3).all(|w| w.parse::<f64>().is_ok()) => {
            Some("xyz")
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_by_their_first_bytes() {
        let binary = [&[b'x'; 80][..], &12u32.to_le_bytes(), &[0; 60]].concat();
        for (head, wanted) in [
            (&b"ply\nformat ascii 1.0\n"[..], Some("ply")),
            (b"# comment\nv 1 2 3\n", Some("obj")),
            (b"solid part\n facet normal", Some("stl")),
            (&binary, Some("stl")),
            (b"1.5, 2, 3\n4,5,6\n", Some("xyz")),
            (b"[solid.a]\n", Some("toml")),
            (b"units = \"mm\"\n", Some("toml")),
            (b"hello there\n", None),
        ] {
            assert_eq!(sniffed(head), wanted, "{}", String::from_utf8_lossy(head));
        }
    }
}
