//! USD as text (`.usda`): the patches as `NurbsPatch` and, beside them, a mesh that renderers draw.
//!
//! Pixar, *OpenUSD* schemas UsdGeom: `NurbsPatch` has the points with `u` fastest, `count + order` knots and the ranges of
//! the parameters; `Mesh` with subdivision scheme `none`, primvars for normals and `st`, and a `GeomSubset` per patch.
//!
//! Points have single precision in this format. Those of a model far from the origin are written near it, and the transform
//! of the model, which has double precision, puts it in its place.

use crate::mapped::patch_name;
use crate::usd_material::{self, UsdMaterial};
use crate::{MappedMesh, Place, Up, WriteError, WriteOptions, atomic};
use planish::DVec3;
use planish::surface::Surface;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// What a USD file is made of.
#[derive(Clone, Copy, Debug)]
pub struct UsdInput<'a> {
    /// The surfaces, near the origin.
    pub surfaces: &'a [Surface],
    /// A mesh of them and its name in the file, near the origin.
    pub mesh: Option<(&'a str, &'a MappedMesh)>,
    /// What brings them to their place.
    pub shift: DVec3,
    /// Materials of the mesh; with one, surfaces may be left away.
    pub materials: &'a [UsdMaterial],
    /// Units, axis and name.
    pub options: &'a WriteOptions,
}

/// Writes patches, and their mesh, as one model with its unit (`metersPerUnit`) and axis (`upAxis`). The patches have the
/// purpose `guide`, for programs that draw both would draw the surface twice. The file appears whole or not at all.
/// # Errors
/// `WriteError::Nothing` without surfaces; `WriteError::Inconsistent` for a surface that cannot be evaluated;
/// `WriteError::Value` for a coordinate that single precision cannot hold.
pub fn write_usd(path: impl AsRef<Path>, input: &UsdInput) -> Result<(), WriteError> {
    if input.surfaces.is_empty() && input.materials.is_empty() {
        return Err(WriteError::Nothing("the model has no surfaces"));
    }
    for (p, surface) in input.surfaces.iter().enumerate() {
        let what = |e: planish::surface::FitError| WriteError::Inconsistent {
            what: e.to_string(),
            place: Place::Item("patch", p),
        };
        surface.check().map_err(what)?;
        held(&surface.control, |_| Place::Item("patch", p))?;
    }
    if let Some((_, mesh)) = input.mesh {
        held(&mesh.patched.mesh.points, Place::Vertex)?;
    }
    atomic::write(path.as_ref(), |out: &mut BufWriter<File>| write(out, input))
}

/// Refuses what single precision cannot hold.
fn held(points: &[DVec3], place: impl Fn(usize) -> Place) -> Result<(), WriteError> {
    match points.iter().position(|p| !p.as_vec3().is_finite()) {
        None => Ok(()),
        Some(k) => Err(WriteError::Value {
            value: format!("point {}", points[k]),
            place: place(k),
            hint: "USD has single precision; write STEP",
        }),
    }
}

fn write<W: Write>(out: &mut W, input: &UsdInput) -> Result<(), WriteError> {
    let UsdInput { surfaces, mesh, shift, materials, options } = input;
    let name = identifier(&options.name);
    let up = if options.up == Up::Y { "Y" } else { "Z" };
    writeln!(out, "#usda 1.0\n(\n    defaultPrim = \"{name}\"\n    doc = \"{}\"", options.generator())?;
    writeln!(out, "    metersPerUnit = {}\n    upAxis = \"{up}\"\n)\n", options.units.metres())?;
    writeln!(
        out,
        "def Xform \"{name}\" (\n    displayName = {}\n    kind = \"component\"\n)\n{{",
        quoted(&options.name)
    )?;
    if *shift != DVec3::ZERO {
        writeln!(out, "    double3 xformOp:translate = ({}, {}, {})", shift.x, shift.y, shift.z)?;
        writeln!(out, "    uniform token[] xformOpOrder = [\"xformOp:translate\"]\n")?;
    }
    if !surfaces.is_empty() {
        writeln!(out, "    def Scope \"surfaces\"\n    {{\n        uniform token purpose = \"guide\"")?;
        for (p, surface) in surfaces.iter().enumerate() {
            write_patch(out, &patch_name(p), surface)?;
        }
        writeln!(out, "    }}")?;
    }
    if !materials.is_empty() {
        out.write_all(usd_material::scope(&name, materials).as_bytes())?;
    }
    let bound = Bound { root: &name, materials };
    if let Some((name, mesh)) = mesh {
        write_mesh(out, &identifier(name), mesh, &bound)?;
    }
    writeln!(out, "}}")?;
    Ok(())
}

fn write_patch<W: Write>(out: &mut W, name: &str, surface: &Surface) -> Result<(), WriteError> {
    const INDENT: &str = "            ";
    writeln!(out, "\n        def NurbsPatch \"{name}\"\n        {{")?;
    for (axis, count, knots) in [("u", surface.cols, &surface.knots_u), ("v", surface.rows, &surface.knots_v)] {
        writeln!(out, "{INDENT}int {axis}VertexCount = {count}\n{INDENT}int {axis}Order = 4")?;
        write!(out, "{INDENT}double[] {axis}Knots = ")?;
        list(out, knots.iter(), |out, t| write!(out, "{t}"))?;
        let (low, high) = (knots[3], knots[count]);
        writeln!(out, "{INDENT}double2 {axis}Range = ({low}, {high})\n{INDENT}uniform token {axis}Form = \"open\"")?;
    }
    write_points(out, INDENT, &surface.control)?;
    writeln!(out, "        }}")?;
    Ok(())
}

/// The points and their box.
fn write_points<W: Write>(out: &mut W, indent: &str, points: &[DVec3]) -> Result<(), WriteError> {
    let singles = || points.iter().map(|p| p.as_vec3());
    let (low, high) = singles().fold((glam::Vec3::MAX, glam::Vec3::MIN), |(a, b), p| (a.min(p), b.max(p)));
    write!(out, "{indent}float3[] extent = ")?;
    list(out, [low, high].iter(), |out, p| triple(out, p.to_array()))?;
    write!(out, "{indent}point3f[] points = ")?;
    list(out, singles(), |out, p| triple(out, p.to_array()))
}

/// Which patch has which material.
struct Bound<'a> {
    root: &'a str,
    materials: &'a [UsdMaterial],
}

impl Bound<'_> {
    /// What follows the name of a prim that has the material, and the line that names it; nothing without one.
    fn words(&self, material: Option<&UsdMaterial>, indent: &str) -> [String; 2] {
        let Some(material) = material else { return Default::default() };
        let head = format!(" (\n{indent}    prepend apiSchemas = [\"MaterialBindingAPI\"]\n{indent})");
        let line = format!("{indent}    rel material:binding = </{}/materials/{}>\n", self.root, material.name);
        [head, line]
    }

    /// The one material of all patches.
    fn whole(&self) -> Option<&UsdMaterial> {
        self.materials.first().filter(|_| self.materials.len() == 1)
    }

    /// The material of one patch, where patches have their own.
    fn of(&self, patch: usize) -> Option<&UsdMaterial> {
        self.materials.iter().find(|m| self.materials.len() > 1 && m.patches.contains(&patch))
    }
}

fn write_mesh<W: Write>(out: &mut W, name: &str, mesh: &MappedMesh, bound: &Bound) -> Result<(), WriteError> {
    const INDENT: &str = "        ";
    let patched = &mesh.patched;
    let [head, line] = bound.words(bound.whole(), "    ");
    writeln!(out, "\n    def Mesh \"{name}\"{head}\n    {{")?;
    write!(out, "{line}")?;
    writeln!(
        out,
        "{INDENT}uniform token subdivisionScheme = \"none\"\n{INDENT}uniform token orientation = \"rightHanded\""
    )?;
    write_points(out, INDENT, &patched.mesh.points)?;
    write!(out, "{INDENT}int[] faceVertexCounts = ")?;
    list(out, patched.mesh.triangles.iter(), |out, _| write!(out, "3"))?;
    write!(out, "{INDENT}int[] faceVertexIndices = ")?;
    list(out, patched.mesh.triangles.iter().flatten(), |out, v| write!(out, "{v}"))?;
    if patched.patches.is_empty() {
        writeln!(out, "    }}")?;
        return Ok(());
    }
    // One value per node of a patch; the corners of the triangles name them.
    let mut first = 0;
    let mut corners = Vec::with_capacity(3 * patched.mesh.triangles.len());
    for nodes in &patched.patches {
        corners.extend(nodes.triangles.iter().flatten().map(|&n| first + n as usize));
        first += nodes.vertices.len();
    }
    write!(out, "{INDENT}normal3f[] primvars:normals = ")?;
    open_list(out, mesh.normals.iter().flatten(), |out, n| triple(out, n.as_vec3().to_array()))?;
    face_varying(out, INDENT, "normals", &corners)?;
    write!(out, "{INDENT}texCoord2f[] primvars:st = ")?;
    open_list(out, mesh.uvs.iter().flatten(), |out, [u, v]| write!(out, "({u}, {v})"))?;
    face_varying(out, INDENT, "st", &corners)?;
    writeln!(out, "{INDENT}uniform token subsetFamily:materialBind:familyType = \"partition\"")?;
    let mut first = 0;
    for (p, nodes) in patched.patches.iter().enumerate() {
        let [head, line] = bound.words(bound.of(p), INDENT);
        writeln!(out, "\n{INDENT}def GeomSubset \"{}\"{head}\n{INDENT}{{", patch_name(p))?;
        write!(out, "{line}")?;
        writeln!(out, "{INDENT}    uniform token elementType = \"face\"")?;
        writeln!(out, "{INDENT}    uniform token familyName = \"materialBind\"")?;
        write!(out, "{INDENT}    int[] indices = ")?;
        list(out, first..first + nodes.triangles.len(), |out, t| write!(out, "{t}"))?;
        writeln!(out, "{INDENT}}}")?;
        first += nodes.triangles.len();
    }
    writeln!(out, "    }}")?;
    Ok(())
}

/// Ends a primvar whose values corners name.
fn face_varying<W: Write>(out: &mut W, indent: &str, name: &str, corners: &[usize]) -> Result<(), WriteError> {
    writeln!(out, " (\n{indent}    interpolation = \"faceVarying\"\n{indent})")?;
    write!(out, "{indent}int[] primvars:{name}:indices = ")?;
    list(out, corners.iter(), |out, n| write!(out, "{n}"))
}

fn triple<W: Write>(out: &mut W, [x, y, z]: [f32; 3]) -> std::io::Result<()> {
    write!(out, "({x}, {y}, {z})")
}

/// A list and the end of its line.
fn list<W: Write, T>(
    out: &mut W,
    items: impl Iterator<Item = T>,
    each: impl FnMut(&mut W, T) -> std::io::Result<()>,
) -> Result<(), WriteError> {
    open_list(out, items, each)?;
    Ok(writeln!(out)?)
}

fn open_list<W: Write, T>(
    out: &mut W,
    items: impl Iterator<Item = T>,
    mut each: impl FnMut(&mut W, T) -> std::io::Result<()>,
) -> Result<(), WriteError> {
    write!(out, "[")?;
    for (k, item) in items.enumerate() {
        if k > 0 {
            write!(out, ", ")?;
        }
        each(out, item)?;
    }
    Ok(write!(out, "]")?)
}

/// A name as prims may have: letters, digits and `_`, no digit first.
fn identifier(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    match plain.chars().next() {
        None => "model".into(),
        Some(c) if c.is_ascii_digit() => format!("_{plain}"),
        Some(_) => plain,
    }
}

/// A string of one line.
fn quoted(words: &str) -> String {
    let mut out = String::from("\"");
    for c in words.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
