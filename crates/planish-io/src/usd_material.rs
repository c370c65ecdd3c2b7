//! Materials in USD that read displacement or normal maps.
//!
//! Pixar, *UsdPreviewSurface Specification* 2.6: `UsdUVTexture` gives `texel * scale + bias`, `displacement` is a distance along the
//! normal in units of the scene, `normal` a vector in tangent space. It has no input for vectors of displacement: those are wired with
//! the nodes of MaterialX 1.38 that UsdMtlx names, for renderers that take the output `mtlx:displacement`.

use planish::relief::maps::AxisOrder;
use std::fmt::Write;

/// What a texture is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UsdTexture {
    /// A height along the normal.
    Height,
    /// A normal in tangent space.
    Normal,
    /// A displacement in tangent space, its parts in this order.
    Vector(AxisOrder),
}

/// A material that reads one texture.
#[derive(Clone, Debug, PartialEq)]
pub struct UsdMaterial {
    /// Its name in the file.
    pub name: String,
    /// The patches that have it.
    pub patches: Vec<usize>,
    /// File of the texture beside that of USD, with `<UDIM>` in place of the number of a tile.
    pub file: String,
    /// What the texture is for.
    pub texture: UsdTexture,
    /// What is meant is `texel * scale + bias`.
    pub scale: f64,
    /// See `scale`.
    pub bias: f64,
}

/// The scope `materials` of a model.
/// * `root` - name of the model's prim
pub(crate) fn scope(root: &str, materials: &[UsdMaterial]) -> String {
    let mut out = String::from("\n    def Scope \"materials\"\n    {\n");
    for material in materials {
        one(&mut out, &format!("/{root}/materials/{}", material.name), material);
    }
    out += "    }\n";
    out
}

fn one(out: &mut String, path: &str, material: &UsdMaterial) {
    let UsdMaterial { name, file, texture, scale, bias, .. } = material;
    let _ = writeln!(out, "        def Material \"{name}\"\n        {{");
    let _ = writeln!(out, "            token outputs:surface.connect = <{path}/preview.outputs:surface>");
    match texture {
        UsdTexture::Height => {
            let _ =
                writeln!(out, "            token outputs:displacement.connect = <{path}/preview.outputs:displacement>");
        }
        UsdTexture::Normal => {}
        UsdTexture::Vector(_) => {
            let _ = writeln!(
                out,
                "            token outputs:mtlx:displacement.connect = <{path}/displacement.outputs:out>"
            );
        }
    }
    let preview = match texture {
        UsdTexture::Height => format!("float inputs:displacement.connect = <{path}/map.outputs:r>"),
        UsdTexture::Normal => format!("normal3f inputs:normal.connect = <{path}/map.outputs:rgb>"),
        UsdTexture::Vector(_) => "float inputs:roughness = 0.5".into(),
    };
    shader(out, "preview", "UsdPreviewSurface", &[&preview, "token outputs:surface", "token outputs:displacement"]);
    if let UsdTexture::Vector(order) = texture {
        vector(out, path, material, *order);
    } else {
        let four = |x: f64, last: f64| format!("({x}, {x}, {x}, {last})");
        let result = if *texture == UsdTexture::Height { "float outputs:r" } else { "float3 outputs:rgb" };
        let lines = [
            format!("asset inputs:file = @./{file}@"),
            format!("float2 inputs:st.connect = <{path}/st.outputs:result>"),
            format!("float4 inputs:scale = {}", four(*scale, 1.0)),
            format!("float4 inputs:bias = {}", four(*bias, 0.0)),
            "token inputs:sourceColorSpace = \"raw\"".into(),
            "token inputs:wrapS = \"clamp\"".into(),
            "token inputs:wrapT = \"clamp\"".into(),
            result.into(),
        ];
        shader(out, "map", "UsdUVTexture", &lines.each_ref().map(String::as_str));
        let lines = ["string inputs:varname = \"st\"", "float2 outputs:result"];
        shader(out, "st", "UsdPrimvarReader_float2", &lines);
    }
    *out += "        }\n";
}

/// The nodes of MaterialX for a displacement by vectors.
fn vector(out: &mut String, path: &str, material: &UsdMaterial, order: AxisOrder) {
    let UsdMaterial { file, scale, bias, .. } = material;
    shader(out, "st", "ND_geompropvalue_vector2", &["string inputs:geomprop = \"st\"", "float2 outputs:out"]);
    let lines = [
        format!("asset inputs:file = @./{file}@"),
        format!("float2 inputs:texcoord.connect = <{path}/st.outputs:out>"),
        "float3 outputs:out".into(),
    ];
    shader(out, "map", "ND_image_vector3", &lines.each_ref().map(String::as_str));
    let lines = [
        format!("float3 inputs:in1.connect = <{path}/map.outputs:out>"),
        format!("float inputs:in2 = {}", -bias / scale),
        "float3 outputs:out".into(),
    ];
    shader(out, "signed", "ND_subtract_vector3FA", &lines.each_ref().map(String::as_str));
    let ordered = match order {
        AxisOrder::Tbn => "signed",
        AxisOrder::TbnDown => {
            let from = format!("float3 inputs:in1.connect = <{path}/signed.outputs:out>");
            let lines = [&from, "float3 inputs:in2 = (1, -1, 1)", "float3 outputs:out"];
            shader(out, "ordered", "ND_multiply_vector3", &lines);
            "ordered"
        }
        AxisOrder::Tnb => {
            let from = format!("float3 inputs:in.connect = <{path}/signed.outputs:out>");
            let lines = [&from, "float outputs:outx", "float outputs:outy", "float outputs:outz"];
            shader(out, "parts", "ND_separate3_vector3", &lines);
            let part = |k: u32, axis: char| format!("float inputs:in{k}.connect = <{path}/parts.outputs:out{axis}>");
            let lines = [part(1, 'x'), part(2, 'z'), part(3, 'y'), "float3 outputs:out".into()];
            shader(out, "ordered", "ND_combine3_vector3", &lines.each_ref().map(String::as_str));
            "ordered"
        }
    };
    let lines = [
        format!("float3 inputs:displacement.connect = <{path}/{ordered}.outputs:out>"),
        format!("float inputs:scale = {scale}"),
        "token outputs:out".into(),
    ];
    shader(out, "displacement", "ND_displacement_vector3", &lines.each_ref().map(String::as_str));
}

fn shader(out: &mut String, name: &str, id: &str, lines: &[&str]) {
    let _ = writeln!(
        out,
        "\n            def Shader \"{name}\"\n            {{\n                uniform token info:id = \"{id}\""
    );
    for line in lines {
        let _ = writeln!(out, "                {line}");
    }
    *out += "            }\n";
}
