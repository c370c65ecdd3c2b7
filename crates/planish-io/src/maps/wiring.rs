//! Materials of USD, and a MaterialX document, that wire displacement or normal maps (MaterialX 1.38: `displacement` takes a float along the normal,
//! or a vector3 in tangent space `(T, B, N)`).

use super::sidecar::Sidecar;
use crate::{UsdMaterial, UsdTexture};
use planish::relief::maps::{AxisOrder, MapFrame, MapKind, SheetKind};
use std::fmt::Write;

/// The materials of USD for the maps; `None` for maps that it has no input for: lengths, vectors and normals in another frame than
/// tangent space, and normals in another order than tangent, bitangent, normal.
pub fn usd_materials(sidecar: &Sidecar) -> Option<Vec<UsdMaterial>> {
    let texture = match sidecar.params.kind {
        MapKind::Scalar | MapKind::Height => UsdTexture::Height,
        MapKind::Normal => UsdTexture::Normal,
        MapKind::Vector => UsdTexture::Vector(sidecar.params.order),
        MapKind::Length => return None,
    };
    let in_tangent_space = sidecar.params.frame == MapFrame::Tangent;
    let in_order = texture != UsdTexture::Normal || sidecar.params.order == AxisOrder::Tbn;
    if texture != UsdTexture::Height && !(in_tangent_space && in_order) {
        return None;
    }
    let (scale, bias) = (sidecar.scale, -sidecar.mid_level * sidecar.scale);
    let material = |name: &str, file: &str, patches: Vec<usize>| UsdMaterial {
        name: name.into(),
        patches,
        file: file.into(),
        texture,
        scale,
        bias: if bias == 0.0 { 0.0 } else { bias },
    };
    if sidecar.params.sheets == SheetKind::Udim {
        let file = sidecar.images.first()?.file.replace(".1001.", ".<UDIM>.");
        return Some(vec![material("relief", &file, (0..sidecar.patches.len()).collect())]);
    }
    let one = |(k, image): (usize, &super::ImageEntry)| {
        let name = image.file.rsplit_once('.').map_or(image.file.as_str(), |(stem, _)| stem);
        let patches = sidecar.patches.iter().enumerate().filter(|(_, p)| p.image == k).map(|(p, _)| p).collect();
        material(name, &image.file, patches)
    };
    Some(sidecar.images.iter().enumerate().map(one).collect())
}

/// The document; `None` for maps that MaterialX has no node for: vectors in object space.
pub fn materialx(sidecar: &Sidecar) -> Option<String> {
    if sidecar.params.kind == MapKind::Vector && sidecar.params.frame == MapFrame::Object {
        return None;
    }
    let mut out = String::from("<?xml version=\"1.0\"?>\n");
    let _ = writeln!(out, "<!-- {} -->\n<materialx version=\"1.38\" colorspace=\"none\">", sidecar.generator);
    match sidecar.params.sheets {
        SheetKind::Udim => {
            let name = sidecar.images.first()?.file.replace(".1001.", ".<UDIM>.");
            material(&mut out, "relief", &name, sidecar);
        }
        _ => {
            for image in &sidecar.images {
                let name = image.file.rsplit_once('.').map_or(image.file.as_str(), |(stem, _)| stem);
                material(&mut out, name, &image.file, sidecar);
            }
        }
    }
    out += "</materialx>\n";
    Some(out)
}

/// A node or a material of the document.
/// * `indent` - blanks before it
fn node(out: &mut String, indent: usize, category: &str, [name, kind]: [&str; 2], inputs: &[String]) {
    let blanks = " ".repeat(indent);
    let _ = writeln!(out, "{blanks}<{category} name=\"{name}\" type=\"{kind}\">");
    for input in inputs {
        let _ = writeln!(out, "{blanks}  <input {input} />");
    }
    let _ = writeln!(out, "{blanks}</{category}>");
}

/// An input that another node feeds.
fn fed(name: &str, kind: &str, node: &str) -> String {
    format!("name=\"{name}\" type=\"{kind}\" nodename=\"{node}\"")
}

/// An input with a value of its own.
fn fixed(name: &str, kind: &str, value: impl std::fmt::Display) -> String {
    format!("name=\"{name}\" type=\"{kind}\" value=\"{value}\"")
}

/// The node that has the vectors of `from` as tangent, bitangent, normal; other nodes are added for it as they are needed.
fn in_order(out: &mut String, order: AxisOrder, from: &'static str) -> &'static str {
    match order {
        AxisOrder::Tbn => return from,
        AxisOrder::TbnDown => {
            let inputs = [fed("in1", "vector3", from), fixed("in2", "vector3", "1, -1, 1")];
            node(out, 4, "multiply", ["ordered", "vector3"], &inputs);
        }
        AxisOrder::Tnb => {
            node(out, 4, "separate3", ["parts", "multioutput"], &[fed("in", "vector3", from)]);
            let part = |input: &str, output: &str| {
                format!("name=\"{input}\" type=\"float\" nodename=\"parts\" output=\"{output}\"")
            };
            let inputs = [part("in1", "outx"), part("in2", "outz"), part("in3", "outy")];
            node(out, 4, "combine3", ["ordered", "vector3"], &inputs);
        }
    }
    "ordered"
}

fn material(out: &mut String, name: &str, file: &str, sidecar: &Sidecar) {
    let (kind, order) = (sidecar.params.kind, sidecar.params.order);
    let word = if kind.channels() == 3 { "vector3" } else { "float" };
    let file = file.replace('<', "&lt;").replace('>', "&gt;");
    let (scale, mid) = (sidecar.scale, sidecar.mid_level);
    let graph = format!("{name}_map");
    let result =
        |name: &str, kind: &str| format!("name=\"{name}\" type=\"{kind}\" nodegraph=\"{graph}\" output=\"out\"");
    let _ = writeln!(out, "  <nodegraph name=\"{graph}\">");
    let image = format!("{} colorspace=\"none\"", fixed("file", "filename", file));
    node(out, 4, "image", ["image", word], &[image]);
    node(out, 4, "subtract", ["signed", word], &[fed("in1", word, "image"), fixed("in2", "float", mid)]);
    let last = if word == "vector3" { in_order(out, order, "signed") } else { "signed" };
    if kind != MapKind::Normal {
        let _ = writeln!(out, "    <output name=\"out\" type=\"{word}\" nodename=\"{last}\" />\n  </nodegraph>");
        let (part, shader) = (format!("{name}_displacement"), "displacementshader");
        node(out, 2, "displacement", [&part, shader], &[result("displacement", word), fixed("scale", "float", scale)]);
        node(out, 2, "surfacematerial", [name, "material"], &[fed(shader, shader, &part)]);
        return;
    }
    // `normalmap` wants numbers from 0 to 1.
    let half = [fed("in1", word, last), fixed("in2", "float", scale / 2.0)];
    node(out, 4, "multiply", ["half", word], &half);
    node(out, 4, "add", ["coded", word], &[fed("in1", word, "half"), fixed("in2", "float", 0.5)]);
    let space = if sidecar.params.frame == MapFrame::Object { "object" } else { "tangent" };
    node(out, 4, "normalmap", ["normal", word], &[fed("in", word, "coded"), fixed("space", "string", space)]);
    let _ = writeln!(out, "    <output name=\"out\" type=\"{word}\" nodename=\"normal\" />\n  </nodegraph>");
    let (part, shader) = (format!("{name}_surface"), "surfaceshader");
    node(out, 2, "standard_surface", [&part, shader], &[result("normal", word)]);
    node(out, 2, "surfacematerial", [name, "material"], &[fed(shader, shader, &part)]);
}
