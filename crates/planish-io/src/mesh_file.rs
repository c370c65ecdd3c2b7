//! Meshes from and to files: the format by the extension, checked against the content.

use crate::{MappedMesh, Place, ReadError, WriteError, atomic, gltf, obj, ply, step, stl};
use planish::Units;
use planish::mesh::{FeatureTags, TriMesh};
use std::fs::File;
use std::io::{BufWriter, Read};
use std::path::Path;

/// A mesh format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Stanford polygon format, `.ply`.
    Ply,
    /// Wavefront, `.obj`.
    Obj,
    /// Loose triangles, `.stl`.
    Stl,
    /// glTF as text, `.gltf`; read only.
    Gltf,
    /// glTF as one binary file, `.glb`.
    Glb,
    /// Faces of CAD, `.step` or `.stp`, as triangles; read only.
    Step,
}

impl MeshFormat {
    /// All formats that are read.
    pub const ALL: [MeshFormat; 6] =
        [MeshFormat::Ply, MeshFormat::Obj, MeshFormat::Stl, MeshFormat::Gltf, MeshFormat::Glb, MeshFormat::Step];

    /// Its extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            MeshFormat::Ply => "ply",
            MeshFormat::Obj => "obj",
            MeshFormat::Stl => "stl",
            MeshFormat::Gltf => "gltf",
            MeshFormat::Glb => "glb",
            MeshFormat::Step => "step",
        }
    }

    fn name(self) -> &'static str {
        match self {
            MeshFormat::Ply => "PLY",
            MeshFormat::Obj => "OBJ",
            MeshFormat::Stl => "STL",
            MeshFormat::Gltf => "glTF",
            MeshFormat::Glb => "GLB",
            MeshFormat::Step => "STEP",
        }
    }

    /// The format that the extension of `path` names, in capitals or not.
    pub fn of(path: &Path) -> Option<MeshFormat> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        let extension = if extension == "stp" { "step" } else { &extension };
        MeshFormat::ALL.into_iter().find(|f| f.extension() == extension)
    }

    /// The format whose mark `bytes` begin with, if they begin with one.
    fn marked(bytes: &[u8]) -> Option<MeshFormat> {
        let start = bytes.trim_ascii_start();
        // A binary STL may begin with anything: its length tells.
        if stl::fits_binary(bytes) {
            Some(MeshFormat::Stl)
        } else if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            Some(MeshFormat::Ply)
        } else if bytes.starts_with(b"glTF") {
            Some(MeshFormat::Glb)
        } else if start.starts_with(b"ISO-10303-21;") {
            Some(MeshFormat::Step)
        } else if start.starts_with(b"{") {
            Some(MeshFormat::Gltf)
        } else if start.starts_with(b"solid") && start.windows(5).take(1024).any(|w| w == b"facet") {
            Some(MeshFormat::Stl)
        } else {
            None
        }
    }
}

/// Which axis of a mesh points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// Y, as in glTF.
    #[default]
    Y,
    /// Z, as in most CAD programs and scans.
    Z,
}

/// What the writers of meshes are told.
#[derive(Clone, Debug)]
pub struct WriteOptions {
    /// What one unit of a coordinate is (GLB is in metres; the other formats carry no unit).
    pub units: Units,
    /// Which axis points up (GLB has Y up; the other formats do not say).
    pub up: Up,
    /// Name of the object.
    pub name: String,
}

impl Default for WriteOptions {
    fn default() -> WriteOptions {
        WriteOptions { units: Units::default(), up: Up::default(), name: "planish".into() }
    }
}

impl WriteOptions {
    /// What wrote the file.
    pub(crate) fn generator(&self) -> String {
        format!("planish {}", env!("CARGO_PKG_VERSION"))
    }
}

/// Reads a mesh: PLY, OBJ, STL, glTF, GLB, or the faces of a STEP file as triangles.
///
/// The extension names the format and the content must agree. Polygons are cut into triangles; triangles that
/// name a vertex twice are left out; unused vertices stay. Attributes per vertex come along as
/// [`planish::mesh::Attribute`]s. Coordinates are as in the file, without regard to its unit or axes (glTF: as
/// its transforms give them). Triangles of STEP are within 2e-5 of the diagonal of their surfaces.
/// # Errors
/// Everything that [`ReadError`] lists. No file makes it panic or take much more memory than its own size.
pub fn read_mesh(path: impl AsRef<Path>) -> Result<TriMesh, ReadError> {
    read_with_edges(path.as_ref()).map(|(mesh, _)| mesh)
}

/// Reads a mesh with its feature tags: those of a PLY with the vertex property `feature` and an element `edge`.
/// # Errors
/// As [`read_mesh`].
pub fn read_tagged_mesh(path: impl AsRef<Path>) -> Result<(TriMesh, Option<FeatureTags>), ReadError> {
    let (mesh, mut edges) = read_with_edges(path.as_ref())?;
    edges.iter_mut().for_each(|e| e.sort_unstable());
    edges.retain(|[a, b]| a != b);
    edges.sort_unstable();
    edges.dedup();
    let tags = FeatureTags::of(&mesh, edges);
    Ok((mesh, tags))
}

fn read_with_edges(path: &Path) -> Result<(TriMesh, Vec<[u32; 2]>), ReadError> {
    let bytes = content(path)?;
    let Some(format) = MeshFormat::of(path) else {
        return Err(ReadError::UnknownExtension { extension: extension(path), known: known(&MeshFormat::ALL) });
    };
    if bytes.is_empty() {
        return Err(ReadError::Empty);
    }
    check(format, MeshFormat::marked(&bytes))?;
    let mesh = match format {
        MeshFormat::Ply => return ply::read(&bytes),
        MeshFormat::Obj => obj::read(&bytes),
        MeshFormat::Stl => stl::read(&bytes),
        MeshFormat::Gltf | MeshFormat::Glb => gltf::read(&bytes, path.parent().unwrap_or(Path::new(""))),
        MeshFormat::Step => step::read(&bytes),
    };
    Ok((mesh?, Vec::new()))
}

/// Writes a mesh: `.ply`, `.obj`, `.stl` or `.glb`. The file appears whole or not at all.
///
/// PLY keeps everything exactly; OBJ positions, colours, normals and texture coordinates; STL positions as
/// `f32`; GLB positions as `f32`, normals, colours and texture coordinates, in metres.
/// # Errors
/// [`WriteError::UnknownExtension`], [`WriteError::Nothing`] for a mesh without triangles, [`WriteError::Value`]
/// for coordinates that are not finite or that `f32` cannot hold where the format needs it.
pub fn write_mesh(path: impl AsRef<Path>, mesh: &TriMesh, options: &WriteOptions) -> Result<(), WriteError> {
    write_with_edges(path.as_ref(), mesh, &[], options)
}

/// Writes a mesh with its feature tags: in PLY as the vertex property `feature` (0 none, 1 edge, 2 corner) and an element
/// `edge`; the other formats have no place for them.
/// # Errors
/// As [`write_mesh`].
pub fn write_tagged_mesh(
    path: impl AsRef<Path>,
    mesh: &TriMesh,
    tags: &FeatureTags,
    options: &WriteOptions,
) -> Result<(), WriteError> {
    let mut marked = mesh.clone();
    tags.mark(&mut marked);
    write_with_edges(path.as_ref(), &marked, &tags.edges, options)
}

/// Writes a mesh of patches as [`write_mesh`] does. OBJ gets a group and GLB a primitive with a material for each patch, named
/// after its displacement map, with normals and with texture coordinates that fit the map. The vertices of OBJ are shared between
/// patches; those of GLB, which has one normal and one place in the map for each of its vertices, are at the same place.
/// # Errors
/// As [`write_mesh`].
pub fn write_patches(path: impl AsRef<Path>, mesh: &MappedMesh, options: &WriteOptions) -> Result<(), WriteError> {
    let path = path.as_ref();
    let format = format_for(path, &mesh.patched.mesh)?;
    if mesh.patched.patches.is_empty() || !matches!(format, MeshFormat::Obj | MeshFormat::Glb) {
        return write_mesh(path, &mesh.patched.mesh, options);
    }
    let generator = options.generator();
    atomic::write(path, |out: &mut BufWriter<File>| match format {
        MeshFormat::Obj => obj::write_patches(out, mesh, &generator),
        _ => gltf::write_patches(out, mesh, options),
    })
}

fn write_with_edges(path: &Path, mesh: &TriMesh, edges: &[[u32; 2]], options: &WriteOptions) -> Result<(), WriteError> {
    let format = format_for(path, mesh)?;
    let generator = options.generator();
    atomic::write(path, |out: &mut BufWriter<File>| match format {
        MeshFormat::Ply => ply::write(out, mesh, edges, &generator),
        MeshFormat::Obj => obj::write(out, mesh, &generator),
        MeshFormat::Stl => stl::write(out, mesh, &generator),
        _ => gltf::write(out, mesh, options),
    })
}

/// The format that the name asks for, if it is written and can hold the mesh.
fn format_for(path: &Path, mesh: &TriMesh) -> Result<MeshFormat, WriteError> {
    let written = [MeshFormat::Ply, MeshFormat::Obj, MeshFormat::Stl, MeshFormat::Glb];
    let Some(format) = MeshFormat::of(path).filter(|f| written.contains(f)) else {
        return Err(WriteError::UnknownExtension { extension: extension(path), known: known(&written) });
    };
    if mesh.triangles.is_empty() {
        return Err(WriteError::Nothing("the mesh has no triangles"));
    }
    let single = matches!(format, MeshFormat::Stl | MeshFormat::Glb);
    let most = if single { f32::MAX as f64 } else { f64::MAX };
    for (v, p) in mesh.points.iter().enumerate() {
        if let Some(x) = p.to_array().into_iter().find(|x| x.is_nan() || x.abs() > most) {
            return Err(WriteError::Value {
                value: format!("coordinate {x}"),
                place: Place::Vertex(v),
                hint: "repair the mesh first; .ply and .obj hold every finite number",
            });
        }
    }
    if let Some(t) = mesh.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= mesh.points.len())) {
        let what = format!("a triangle names a vertex outside the {}", mesh.points.len());
        return Err(WriteError::Inconsistent { what, place: Place::Face(t) });
    }
    Ok(format)
}

/// The whole file, if it is one.
/// # Errors
/// As of [`opened`].
pub fn content(path: &Path) -> Result<Vec<u8>, ReadError> {
    let mut file = opened(path)?;
    let mut bytes = Vec::with_capacity(file.metadata()?.len() as usize);
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// A file to read: folders, pipes and devices are refused before they are opened.
/// # Errors
/// [`ReadError::Io`] or [`ReadError::NotAFile`].
pub(crate) fn opened(path: &Path) -> Result<File, ReadError> {
    // Before it is opened: that alone waits for ever at a pipe that nobody writes to.
    let metadata = std::fs::metadata(path)?;
    if metadata.is_dir() {
        return Err(ReadError::NotAFile("a folder"));
    }
    if !metadata.is_file() {
        return Err(ReadError::NotAFile("a pipe or a device"));
    }
    Ok(File::open(path)?)
}

/// The bytes of a file that another one names or that is no mesh; as [`content`], for errors of other kinds.
/// # Errors
/// The operating system's, or that it is no file.
pub(crate) fn bytes_of(path: &Path) -> std::io::Result<Vec<u8>> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(std::io::Error::other("it is a folder, a pipe or a device"));
    }
    std::fs::read(path)
}

/// Refuses content that carries another format's mark, or lacks the mark of its own.
fn check(expected: MeshFormat, found: Option<MeshFormat>) -> Result<(), ReadError> {
    use MeshFormat::{Glb, Gltf, Obj, Ply, Step, Stl};
    match (expected, found) {
        // GLB under the name .gltf and the reverse are read alike.
        (Gltf | Glb, Some(Gltf | Glb)) => Ok(()),
        (expected, Some(found)) if expected != found => Err(ReadError::WrongFormat {
            expected: expected.name(),
            found: found.name(),
            hint: format!("rename it to .{}", found.extension()),
        }),
        (Ply | Gltf | Glb | Step, None) => Err(ReadError::WrongFormat {
            expected: expected.name(),
            found: "something else",
            hint: format!("name a mesh file: {}", known(&MeshFormat::ALL)),
        }),
        (Ply | Obj | Stl | Gltf | Glb | Step, _) => Ok(()),
    }
}

pub(crate) fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default()
}

fn known(formats: &[MeshFormat]) -> String {
    formats.iter().map(|f| format!(".{}", f.extension())).collect::<Vec<_>>().join(", ")
}
