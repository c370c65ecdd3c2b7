//! The part of a glTF document that a mesh needs, and its buffers.

use crate::{Place, ReadError};
use base64::Engine;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Component, Path};
use std::rc::Rc;

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Document {
    pub extensions_required: Vec<String>,
    pub scene: Option<usize>,
    pub scenes: Vec<Scene>,
    pub nodes: Vec<Node>,
    pub meshes: Vec<Mesh>,
    pub accessors: Vec<Accessor>,
    pub buffer_views: Vec<View>,
    pub buffers: Vec<Buffer>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub nodes: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub children: Vec<usize>,
    pub mesh: Option<usize>,
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub primitives: Vec<Primitive>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub attributes: BTreeMap<String, usize>,
    pub indices: Option<usize>,
    pub mode: Option<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Accessor {
    pub buffer_view: Option<usize>,
    pub byte_offset: usize,
    pub component_type: u32,
    pub normalized: bool,
    pub count: usize,
    #[serde(rename = "type")]
    pub shape: String,
    pub sparse: Option<serde::de::IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct View {
    pub buffer: usize,
    pub byte_offset: usize,
    pub byte_length: usize,
    pub byte_stride: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Buffer {
    pub uri: Option<String>,
    pub byte_length: usize,
}

const REWRITE: &str = "the file is damaged; write it again from its source";

pub(super) fn syntax(what: String, place: Place) -> ReadError {
    ReadError::Syntax { what, place }
}

/// The document and the binary chunk of a `.glb`, or the document of a `.gltf`.
pub(super) fn parse(bytes: &[u8]) -> Result<(Document, Option<&[u8]>), ReadError> {
    let (json, offset, binary) = if bytes.starts_with(b"glTF") { chunks(bytes)? } else { (bytes, 0, None) };
    let document: Document = serde_json::from_slice(json).map_err(|e| match offset {
        0 => syntax(format!("the document is not glTF: {}", reason(&e)), Place::Line(e.line())),
        _ => syntax(format!("the document is not glTF: {}", reason(&e)), Place::Byte(offset)),
    })?;
    if let Some(extension) = document.extensions_required.iter().find(|e| !is_known(e)) {
        return Err(ReadError::Unsupported {
            what: format!("the extension {extension}"),
            place: Place::Byte(offset),
            hint: "export it without compression",
        });
    }
    Ok((document, binary))
}

/// Extensions that change nothing about where the vertices are, or only the types of their numbers.
fn is_known(extension: &str) -> bool {
    extension.starts_with("KHR_materials") || ["KHR_mesh_quantization", "KHR_texture_transform"].contains(&extension)
}

/// What is wrong with the JSON, without the place that [`ReadError`] shows.
fn reason(e: &serde_json::Error) -> String {
    let text = e.to_string();
    text.split(" at line ").next().unwrap_or(&text).to_string()
}

type Chunks<'a> = (&'a [u8], usize, Option<&'a [u8]>);

fn chunks(bytes: &[u8]) -> Result<Chunks<'_>, ReadError> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let cut = |what: &str, needed: usize, at: usize| ReadError::Truncated {
        what: what.into(),
        needed: needed as u64,
        left: bytes.len().saturating_sub(at) as u64,
        place: Place::Byte(at),
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else { return Err(cut("the GLB header", 12, 0)) };
    if version != 2 {
        let what = format!("version {version} of glTF");
        return Err(ReadError::Unsupported { what, place: Place::Byte(4), hint: "export it as glTF 2.0" });
    }
    if length as usize > bytes.len() {
        return Err(cut("the claimed length", length as usize, 0));
    }
    let chunk = |at: usize, kind: u32, name: &str| {
        let (Some(size), Some(found)) = (word(at), word(at + 4)) else { return Err(cut(name, 8, at)) };
        if found != kind {
            let (what, place) = (format!("{name} is missing"), Place::Byte(at));
            return Err(ReadError::Header { what, place, hint: REWRITE });
        }
        let end = (at + 8).checked_add(size as usize);
        end.and_then(|end| bytes.get(at + 8..end)).ok_or_else(|| cut(name, size as usize, at + 8))
    };
    let json = chunk(12, 0x4E4F_534A, "the JSON chunk")?;
    let next = 20 + json.len().next_multiple_of(4);
    let binary = if next < length as usize { Some(chunk(next, 0x004E_4942, "the binary chunk")?) } else { None };
    Ok((json, 20, binary))
}

/// The buffers of a document; those that several name by the same file are read once.
pub(super) fn buffers<'a>(
    document: &Document,
    binary: Option<&'a [u8]>,
    folder: &Path,
) -> Result<Vec<Data<'a>>, ReadError> {
    let mut files: BTreeMap<&str, Rc<Vec<u8>>> = BTreeMap::new();
    let mut found = Vec::new();
    for (k, buffer) in document.buffers.iter().enumerate() {
        let place = Place::Item("buffer", k);
        let data = match (&buffer.uri, binary) {
            (None, Some(binary)) if k == 0 => Data::Chunk(binary),
            (None, _) => return Err(syntax("the buffer has neither a file nor a binary chunk".into(), place)),
            (Some(uri), _) => match files.get(uri.as_str()) {
                Some(data) => Data::Owned(data.clone()),
                None => {
                    let data = Rc::new(load(uri, folder, &place)?);
                    files.insert(uri, data.clone());
                    Data::Owned(data)
                }
            },
        };
        let (needed, left) = (buffer.byte_length as u64, data.bytes().len() as u64);
        if needed > left {
            return Err(ReadError::Truncated { what: format!("buffer {k}"), needed, left, place });
        }
        found.push(data);
    }
    Ok(found)
}

pub(super) enum Data<'a> {
    Chunk(&'a [u8]),
    Owned(Rc<Vec<u8>>),
}

impl Data<'_> {
    pub fn bytes(&self) -> &[u8] {
        match self {
            Data::Chunk(bytes) => bytes,
            Data::Owned(bytes) => bytes,
        }
    }
}

fn load(uri: &str, folder: &Path, place: &Place) -> Result<Vec<u8>, ReadError> {
    if let Some(rest) = uri.strip_prefix("data:") {
        let Some((_, text)) = rest.split_once(";base64,") else {
            return Err(syntax("a data address is not base64".into(), place.clone()));
        };
        let decoded = base64::engine::general_purpose::STANDARD.decode(text.trim_end());
        return decoded.map_err(|e| syntax(format!("the base64 text is damaged: {e}"), place.clone()));
    }
    let name = percent_decoded(uri);
    let path = Path::new(&name);
    if name.contains("://") || !path.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir)) {
        return Err(ReadError::Unsupported {
            what: format!("the buffer \"{}\" outside the folder of the file", crate::text::shown(name.as_bytes())),
            place: place.clone(),
            hint: "put the buffer beside the file, or export it as one .glb",
        });
    }
    let failed = |source| ReadError::Companion { name: name.clone(), source, place: place.clone() };
    let path = folder.join(path);
    if !std::fs::metadata(&path).map_err(failed)?.is_file() {
        return Err(failed(std::io::Error::other("it is not a file")));
    }
    std::fs::read(&path).map_err(failed)
}

fn percent_decoded(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let hex = |at: usize| bytes.get(at).and_then(|&b| (b as char).to_digit(16));
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        match (bytes[at], hex(at + 1), hex(at + 2)) {
            (b'%', Some(high), Some(low)) => {
                out.push((16 * high + low) as u8);
                at += 3;
            }
            (byte, ..) => {
                out.push(byte);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}
