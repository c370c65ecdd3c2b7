//! Scripts of solids and of milling jobs, as TOML: read into parts and milling fields.
//!
//! `docs/guide/solids.md` and `docs/guide/milling.md` describe the language. Every key is checked; a fault is told with
//! its line.

mod gcode;
mod job;
mod part;
mod toml;

use crate::ReadError;
use planish::Units;
use planish::field::{Milling, Part};
use std::path::Path;

/// What a script describes.
pub enum Script {
    /// A part of solids and meshes.
    Part(Part),
    /// Stock and what a tool takes away.
    Job(Milling),
}

/// A script as read.
pub struct ScriptFile {
    /// What it describes.
    pub script: Script,
    /// Its unit, if it names one.
    pub units: Option<Units>,
    /// Named solids, or moves of the tool.
    pub count: usize,
}

/// Why a script cannot be used. Shown as `what is wrong (where) - hint: what to do`.
#[derive(Debug, thiserror::Error)]
pub enum ScriptError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Something in it is wrong.
    #[error("{what} (line {line}) - hint: {hint}")]
    Fault {
        /// What is wrong.
        what: String,
        /// Line, from 1.
        line: usize,
        /// What to do.
        hint: String,
    },
    /// Something in a file that it names is wrong.
    #[error("the file \"{name}\" that it names cannot be used: {fault} (line {line}) - hint: mend that file")]
    Companion {
        /// The name as written.
        name: String,
        /// What is wrong with it.
        fault: String,
        /// Line of the script, from 1.
        line: usize,
    },
}

/// Largest script that is read, bytes: a polygon of a million points is smaller.
const LARGEST: u64 = 64 << 20;

/// Reads a script; files that it names are looked for beside it.
/// # Errors
/// [`ScriptError`] with the line of the fault.
pub fn read_script(path: impl AsRef<Path>) -> Result<ScriptFile, ScriptError> {
    let path = path.as_ref();
    let bytes = crate::mesh_file::content(path)?;
    if bytes.is_empty() {
        return Err(ReadError::Empty.into());
    }
    if bytes.len() as u64 > LARGEST {
        let fault = format!("{} bytes are more than the {LARGEST} that a script may have", bytes.len());
        return Err(ScriptError::Fault { what: fault, line: 1, hint: "name large meshes as files".into() });
    }
    let text = String::from_utf8(bytes).map_err(|e| {
        let line = 1 + e.as_bytes()[..e.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count();
        ScriptError::Fault { what: "the text is not UTF-8".into(), line, hint: "save it as UTF-8".into() }
    })?;
    parse(&text, path.parent().unwrap_or(Path::new("")))
}

/// Reads a script from its text.
/// * `folder` - where files that it names are
/// # Errors
/// [`ScriptError`] with the line of the fault.
pub fn parse(text: &str, folder: &Path) -> Result<ScriptFile, ScriptError> {
    let source = toml::Source::new(text)?;
    let root = source.root();
    let units = root.optional("units").map(|u| u.units()).transpose()?;
    if root.has("stock") || root.has("tool") || root.has("path") {
        let (milling, count) = job::read(&root, folder, units)?;
        return Ok(ScriptFile { script: Script::Job(milling), units, count });
    }
    let (part, count) = part::read(&root, folder)?;
    Ok(ScriptFile { script: Script::Part(part), units, count })
}

#[cfg(test)]
mod tests {
    use super::*;
    use planish::DVec3;
    use planish::field::Field;

    fn part(text: &str) -> Result<Part, String> {
        match parse(text, Path::new("")).map_err(|e| e.to_string())?.script {
            Script::Part(part) => Ok(part),
            Script::Job(_) => Err("a job".into()),
        }
    }

    #[test]
    fn block_with_a_bore_has_the_values_of_its_formulas() {
        let text = r#"
units = "mm"
[solid.block]
box = { size = [40, 30, 10] }
[solid.bore]
cylinder = { radius = 4, height = 20 }
move = [5, 0, 0]
[solid.part]
difference = ["block", "bore"]
"#;
        let part = part(text).unwrap();
        assert_eq!(part.value(DVec3::new(5.0, 0.0, 0.0)), 4.0);
        assert_eq!(part.value(DVec3::new(-19.0, 0.0, 0.0)), -1.0);
        assert_eq!(part.bounds().size(), DVec3::new(40.0, 30.0, 10.0));
    }

    #[test]
    fn a_formula_is_a_solid_that_ends_at_its_box() {
        let text = "[solid.a]\nformula = { text = \"x^2 + y^2 - 1\", from = [-2, -2, -3], to = [2, 2, 3] }\nmove = [1, 0, 0]\n";
        let part = part(text).unwrap();
        assert_eq!(part.value(DVec3::new(3.0, 0.0, 0.0)), 3.0);
        assert_eq!(part.value(DVec3::new(1.0, 0.0, 3.5)), 0.5);
        assert_eq!(part.bounds().size(), DVec3::new(4.0, 4.0, 6.0));
    }

    #[test]
    fn faults_are_told_with_their_line() {
        let cases = [
            ("[solid.a]\nsphere = { radius = 1 }\ncolour = 3\n", "unknown key \"colour\"", "line 3"),
            ("units = \"furlong\"\n[solid.a]\nsphere = { radius = 1 }\n", "furlong", "line 1"),
            ("[solid.a]\nsphere = { radius = -1 }\n", "radius", "line 2"),
            ("[solid.a]\nunion = [\"b\"]\n", "\"b\"", "line 2"),
            ("[solid.a]\nformula = { text = \"x +* y\", from = [0,0,0], to = [1,1,1] }\n", "column 4", "line 2"),
            ("[solid.a]\nformula = { text = \"x\", from = [0,0,0], to = [1,1,0] }\n", "beyond", "line 2"),
            (
                "[solid.a]\nformula = { text = \"x\", from = [0,0,0], to = [1,1,1] }\noffset = 1\n",
                "distances",
                "line 3",
            ),
            ("[solid.a]\nunion = [\"a\"]\n", "itself", "line 2"),
            ("[solid.a]\nbox = { size = [1, 2] }\n", "3 numbers", "line 2"),
            ("[solid.a\nsphere = 1", "", "line 1"),
            ("", "empty", "line 1"),
            ("[solid.a]\nmove = [1,2,3]\n", "no shape", "line 1"),
            ("[solid.a]\nextrusion = { points = [[0,0],[1,1],[1,0],[0,1]], height = 1 }\n", "meet", "line 2"),
            ("[stock]\nfrom = [0,0,0]\nto = [1,1,1]\n[[path]]\ntool = \"x\"\npoints = [[0,0,0]]\n", "\"x\"", "line 5"),
        ];
        for (text, what, line) in cases {
            let told = match parse(text, Path::new("")) {
                Ok(_) => panic!("accepted: {text}"),
                Err(e) => e.to_string(),
            };
            assert!(told.contains(what) && told.contains(line) && told.contains(" - hint: "), "{text}: {told}");
        }
    }

    #[test]
    fn lines_that_use_the_one_before_twice_do_not_double_the_part() {
        let start = "[solid.s0]\nsphere = { radius = 2 }\n";
        let lines = |word: &str, count: usize| -> String {
            (1..=count).map(|k| format!("[solid.s{k}]\n{word} = [\"s{0}\", \"s{0}\"]\n", k - 1)).collect()
        };
        for word in ["union", "intersection"] {
            let part = part(&format!("{start}{}", lines(word, 150))).unwrap();
            assert_eq!(part.value(DVec3::new(3.0, 0.0, 0.0)), 1.0, "{word}");
        }
        // What really are a million shapes is refused.
        let told = part(&format!("{start}{}", lines("difference", 20))).err().unwrap();
        assert!(told.contains("more than 20000 shapes") && told.contains(" - hint: "), "{told}");
    }
}
