//! What is finished: one file beside the folders, replaced as a whole after each run.

use crate::outputs;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Bytes that are read of a file at a time.
const BLOCK: usize = 1 << 20;
/// A file that names others is smaller.
const LARGEST_LIST: u64 = 1 << 26;
/// Kinds of inputs that name files beside them.
const LISTS: [&str; 3] = ["conf", "gltf", "obj"];
/// Options that change no product.
const NO_MATTER: [&str; 5] = ["--threads=", "--force", "--no-clobber", "--in-place", "--jobs="];
/// The product that only scans have.
const OF_SCANS: &str = "points.ply";

/// A finished run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Entry {
    /// What its products depend on.
    pub key: String,
    /// The input.
    pub source: String,
    /// Wall-clock time, seconds.
    pub seconds: f64,
    /// A demanded tolerance is missed.
    pub missed: bool,
}

#[derive(Serialize, Deserialize)]
struct Content {
    planish: String,
    runs: BTreeMap<String, Entry>,
}

/// The finished runs of a folder.
pub struct Manifest {
    path: PathBuf,
    runs: Mutex<BTreeMap<String, Entry>>,
}

impl Manifest {
    /// Reads the manifest; one that is not there, or that a crash of the machine cut off, has no runs.
    pub fn open(path: &Path) -> Manifest {
        Manifest { path: path.to_owned(), runs: Mutex::new(read(path)) }
    }

    /// The entry of a folder, if its products are those of this key and all there.
    pub fn finished(&self, folder: &Path, key: &str) -> Option<Entry> {
        let runs = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = runs.get(&name(folder)).filter(|entry| entry.key == key)?.clone();
        let whole = outputs::PRODUCTS.iter().filter(|p| **p != OF_SCANS).all(|p| folder.join(p).exists());
        whole.then_some(entry)
    }

    /// Adds an entry and writes the file, with what other processes have added meanwhile.
    pub fn add(&self, folder: &Path, entry: Entry) -> io::Result<()> {
        let mut runs = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        let lock = File::create(self.path.with_file_name(".planish-manifest.lock"))?;
        // A file system without locks has no batches beside each other.
        let _ = lock.lock();
        *runs = read(&self.path);
        runs.insert(name(folder), entry);
        let content = Content { planish: env!("CARGO_PKG_VERSION").into(), runs: runs.clone() };
        let text = serde_json::to_string_pretty(&content)?;
        planish_io::atomic::write(&self.path, |out| writeln!(out, "{text}"))
    }
}

fn read(path: &Path) -> BTreeMap<String, Entry> {
    let text = fs::read_to_string(path).unwrap_or_default();
    serde_json::from_str(&text).map_or_else(|_| BTreeMap::new(), |content: Content| content.runs)
}

fn name(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// What the products of a run depend on: the content of the input and of the files that it names, the options, the version.
/// # Errors
/// If a file cannot be read.
pub fn key(source: &Path, network: Option<&Path>, options: &[OsString]) -> io::Result<String> {
    let mut digest = Sha256::new();
    let extension = source.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let mut words = vec![env!("CARGO_PKG_VERSION").to_owned(), extension.clone()];
    let told = options.iter().map(|o| o.to_string_lossy().into_owned());
    words.extend(told.filter(|o| !NO_MATTER.iter().any(|n| o.starts_with(n)) && !o.starts_with("--network=")));
    words[2..].sort();
    for word in &words {
        digest.update(word.as_bytes());
        digest.update([0]);
    }
    let mut files = vec![source.to_owned()];
    files.extend(network.map(Path::to_owned));
    if LISTS.contains(&extension.as_str()) && fs::metadata(source)?.len() <= LARGEST_LIST {
        files.extend(named(source)?);
    }
    for file in files {
        let mut file = File::open(&file)?;
        digest.update([1]);
        let mut block = vec![0; BLOCK];
        loop {
            match file.read(&mut block)? {
                0 => break,
                n => digest.update(&block[..n]),
            }
        }
    }
    Ok(digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}

/// The files beside a list whose names stand in it.
fn named(list: &Path) -> io::Result<Vec<PathBuf>> {
    let bytes = fs::read(list)?;
    let text = String::from_utf8_lossy(&bytes);
    let folder = list.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let is_named = path.file_name().and_then(|n| n.to_str()).is_some_and(|name| text.contains(name));
        if is_named && path.is_file() && path.file_name() != list.file_name() {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_tell_content_options_network_and_named_files_and_not_what_changes_no_product() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str, text: &str| {
            let path = folder.path().join(name);
            fs::write(&path, text).unwrap();
            path
        };
        let (a, b, net) = (path("a.ply", "one"), path("b.ply", "two"), path("n.json", "{}"));
        let options = |all: &[&str]| all.iter().map(OsString::from).collect::<Vec<_>>();
        let of = |file: &Path, all: &[&str]| key(file, None, &options(all)).unwrap();
        let mut keys = vec![of(&a, &[]), of(&b, &[]), of(&a, &["--patches=6"]), of(&a, &["--patches=7"])];
        keys.push(key(&a, Some(&net), &options(&["--network=n.json"])).unwrap());
        fs::write(&net, "{ }").unwrap();
        keys.push(key(&a, Some(&net), &options(&["--network=n.json"])).unwrap());
        let list = path("views.conf", "bmesh part.ply 0 0 0 0 0 0 1");
        path("part.ply", "1");
        keys.push(of(&list, &[]));
        path("part.ply", "2");
        keys.push(of(&list, &[]));
        let all = keys.len();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), all);
        assert_eq!(of(&a, &["--threads=2", "--force"]), of(&a, &[]));
        assert_eq!(of(&a, &["--units=m", "--patches=6"]), of(&a, &["--patches=6", "--units=m"]));
    }

    #[test]
    fn a_manifest_of_nonsense_has_no_runs_and_one_that_is_written_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("manifest.json");
        fs::write(&path, "{\"runs\": [").unwrap();
        let manifest = Manifest::open(&path);
        let part = folder.path().join("part");
        let entry = Entry { key: "k".into(), source: "part.ply".into(), seconds: 1.5, missed: false };
        let other = Manifest::open(&path);
        manifest.add(&part, entry.clone()).unwrap();
        other.add(&folder.path().join("another"), entry).unwrap();
        assert_eq!(read(&path).len(), 2);
        // Its products are not there.
        assert!(Manifest::open(&path).finished(&part, "k").is_none());
        fs::create_dir_all(part.join(outputs::RELIEF)).unwrap();
        for product in outputs::PRODUCTS.iter().filter(|p| **p != OF_SCANS && **p != outputs::RELIEF) {
            fs::write(part.join(product), "x").unwrap();
        }
        assert_eq!(Manifest::open(&path).finished(&part, "k").unwrap().seconds, 1.5);
        assert!(Manifest::open(&path).finished(&part, "other").is_none());
    }
}
