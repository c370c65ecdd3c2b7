//! Materials of USD, and a MaterialX document, that wire displacement or normal maps (MaterialX 1.38: `displacement` takes a float along the normal,
//! or a vector3 in tangent space `(T, B, N)`).

use super::sidecar::Sidecar;
use crate::{UsdMaterial, UsdTexture};
use planish::relief::maps::{AxisOrder, MapFrame, MapKind, SheetKind};
use std::fmt::Write;

/// The materials of USD for the maps; `None` for maps that it has no input for: lengths, and vectors and normals in another frame or
/// order than tangent, bitangent, normal of tangent space.
pub fn usd_materials(sidecar: &Sidecar) -> Option<Vec<UsdMaterial>> {
    let texture = match sidecar.params.kind {
        MapKind::Scalar | MapKind::Height => UsdTexture::Height,
        MapKind::Normal => UsdTexture::Normal,
        MapKind::Vector => UsdTexture::Vector,
        MapKind::Length => return None,
    };
    let in_tangent_space = sidecar.params.frame == MapFrame::Tangent && sidecar.params.order == AxisOrder::Tbn;
    if texture != UsdTexture::Height && !in_tangent_space {
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

/// The document; `None` for maps that MaterialX has no node for: vectors in object space or of another order.
pub fn materialx(sidecar: &Sidecar) -> Option<String> {
    let vector = sidecar.params.kind == MapKind::Vector;
    if vector && (sidecar.params.frame == MapFrame::Object || sidecar.params.order != AxisOrder::Tbn) {
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

fn material(out: &mut String, name: &str, file: &str, sidecar: &Sidecar) {
    let kind = sidecar.params.kind;
    let word = if kind.channels() == 3 { "vector3" } else { "float" };
    let file = file.replace('<', "&lt;").replace('>', "&gt;");
    let (scale, mid) = (sidecar.scale, sidecar.mid_level);
    let _ = writeln!(out, "  <nodegraph name=\"{name}_map\">");
    let _ = writeln!(out, "    <image name=\"image\" type=\"{word}\">");
    let _ = writeln!(
        out,
        "      <input name=\"file\" type=\"filename\" value=\"{file}\" colorspace=\"none\" />\n    </image>"
    );
    if kind == MapKind::Normal {
        // `normalmap` wants numbers from 0 to 1.
        let (factor, add) = if mid == 0.0 { (0.5, 0.5) } else { (1.0, 0.0) };
        let _ = writeln!(
            out,
            "    <multiply name=\"scaled\" type=\"vector3\">\n      <input name=\"in1\" type=\"vector3\" nodename=\"image\" />\n      <input name=\"in2\" type=\"float\" value=\"{factor}\" />\n    </multiply>"
        );
        let _ = writeln!(
            out,
            "    <add name=\"coded\" type=\"vector3\">\n      <input name=\"in1\" type=\"vector3\" nodename=\"scaled\" />\n      <input name=\"in2\" type=\"float\" value=\"{add}\" />\n    </add>"
        );
        let _ = writeln!(
            out,
            "    <normalmap name=\"normal\" type=\"vector3\">\n      <input name=\"in\" type=\"vector3\" nodename=\"coded\" />\n    </normalmap>"
        );
        let _ = writeln!(out, "    <output name=\"out\" type=\"vector3\" nodename=\"normal\" />\n  </nodegraph>");
        let _ = writeln!(
            out,
            "  <standard_surface name=\"{name}_surface\" type=\"surfaceshader\">\n    <input name=\"normal\" type=\"vector3\" nodegraph=\"{name}_map\" output=\"out\" />\n  </standard_surface>"
        );
        let _ = writeln!(
            out,
            "  <surfacematerial name=\"{name}\" type=\"material\">\n    <input name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"{name}_surface\" />\n  </surfacematerial>"
        );
        return;
    }
    let _ = writeln!(
        out,
        "    <subtract name=\"signed\" type=\"{word}\">\n      <input name=\"in1\" type=\"{word}\" nodename=\"image\" />\n      <input name=\"in2\" type=\"float\" value=\"{mid}\" />\n    </subtract>"
    );
    let _ = writeln!(out, "    <output name=\"out\" type=\"{word}\" nodename=\"signed\" />\n  </nodegraph>");
    let _ = writeln!(
        out,
        "  <displacement name=\"{name}_displacement\" type=\"displacementshader\">\n    <input name=\"displacement\" type=\"{word}\" nodegraph=\"{name}_map\" output=\"out\" />\n    <input name=\"scale\" type=\"float\" value=\"{scale}\" />\n  </displacement>"
    );
    let _ = writeln!(
        out,
        "  <surfacematerial name=\"{name}\" type=\"material\">\n    <input name=\"displacementshader\" type=\"displacementshader\" nodename=\"{name}_displacement\" />\n  </surfacematerial>"
    );
}
