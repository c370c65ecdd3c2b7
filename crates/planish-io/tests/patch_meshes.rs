//! Meshes of patches in OBJ and GLB, and free-form surfaces in OBJ: groups, texture coordinates, shared vertices.

mod common;

use common::{flat_cube, flat_maps, folder, sheet, volume6};
use planish::DVec3;
use planish::mesh::TriMesh;
use planish::observe::Silent;
use planish::relief::displaced_patches;
use planish::surface::Surface;
use planish_io::{MappedMesh, WriteError, WriteOptions, read_mesh, write_obj_surfaces, write_patches};

/// The cube of edge 2 with 3 x 3 nodes on each face.
fn cube() -> MappedMesh {
    let (network, surfaces) = flat_cube(4, DVec3::ZERO);
    let maps = flat_maps(&surfaces, 3, 3);
    MappedMesh::new(displaced_patches(&network, &surfaces, &maps, &Silent).unwrap(), &maps)
}

fn written(name: &str, mesh: &MappedMesh) -> (Vec<u8>, TriMesh) {
    let folder = folder();
    let path = folder.path().join(name);
    write_patches(&path, mesh, &WriteOptions::default()).unwrap();
    (std::fs::read(&path).unwrap(), read_mesh(&path).unwrap())
}

fn count(text: &str, keyword: &str) -> usize {
    text.lines().filter(|line| line.split(' ').next() == Some(keyword)).count()
}

#[test]
fn obj_of_a_cube_has_6_groups_of_8_triangles_26_shared_vertices_and_54_texels() {
    let (bytes, mesh) = written("a.obj", &cube());
    let text = String::from_utf8(bytes).unwrap();
    let counts = ["v", "vt", "vn", "g", "f"].map(|keyword| count(&text, keyword));
    assert_eq!(counts, [26, 54, 54, 6, 48]);
    for group in text.split("\ng ").skip(1) {
        assert_eq!(count(group, "f"), 8);
    }
    let texels: Vec<_> = text.lines().filter_map(|l| l.strip_prefix("vt ")).take(4).collect();
    assert_eq!(texels, ["0.16666667 0.16666667", "0.5 0.16666667", "0.8333333 0.16666667", "0.16666667 0.5"]);
    // The first patch lies below, its normal points down.
    assert!(text.contains("\nvn 0 0 -1\n") && text.contains("\ng patch_0005\n"));
    assert_eq!((mesh.points.len(), volume6(&mesh)), (26, 48.0));
}

#[test]
fn glb_of_a_cube_has_6_primitives_with_materials_and_counts_texels_from_above() {
    let (bytes, mesh) = written("a.glb", &cube());
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let document: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let primitives = document["meshes"][0]["primitives"].as_array().unwrap();
    let names: Vec<_> = primitives
        .iter()
        .map(|p| document["materials"][p["material"].as_u64().unwrap() as usize]["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["patch_0000", "patch_0001", "patch_0002", "patch_0003", "patch_0004", "patch_0005"]);
    let accessor = |primitive: usize, name: &str| {
        let at = &primitives[primitive]["attributes"][name];
        let accessor = &document["accessors"][at.as_u64().unwrap() as usize];
        let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let (from, size) = (view["byteOffset"].as_u64().unwrap(), view["byteLength"].as_u64().unwrap());
        let from = 28 + length + from as usize;
        let words = bytes[from..from + size as usize].chunks_exact(4);
        words.map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect::<Vec<f32>>()
    };
    for p in 0..6 {
        let uv = accessor(p, "TEXCOORD_0");
        assert_eq!(uv.len(), 18);
        // Node (0, 0) is the lower left texel of the map: the third row from above.
        assert!((uv[0] - 1.0 / 6.0).abs() < 1e-7 && (uv[1] - 5.0 / 6.0).abs() < 1e-7);
    }
    // Read back, the vertices of the seams are one again; millimetres are metres.
    assert_eq!(mesh.points.len(), 26);
    assert!((volume6(&mesh) - 48e-9).abs() < 1e-15);
}

#[test]
fn ply_and_stl_of_patches_are_the_mesh_alone_and_a_mesh_without_patches_has_no_groups() {
    let mut cube = cube();
    for name in ["a.ply", "a.stl"] {
        assert_eq!(written(name, &cube).1.points.len(), 26);
    }
    cube.patched.patches.clear();
    let (bytes, _) = written("a.obj", &cube);
    assert_eq!(count(&String::from_utf8(bytes).unwrap(), "g"), 0);
}

#[test]
fn maps_finer_than_the_mesh_have_the_texels_of_its_nodes() {
    let (network, surfaces) = flat_cube(4, DVec3::ZERO);
    let nodes = displaced_patches(&network, &surfaces, &flat_maps(&surfaces, 3, 3), &Silent).unwrap();
    let mesh = MappedMesh::new(nodes, &flat_maps(&surfaces, 9, 5));
    let half_texel = [0.5 / 5.0, 0.5 / 9.0];
    assert_eq!(mesh.uvs[0][0], half_texel.map(|x: f64| x as f32));
    assert_eq!(mesh.uvs[0][8], half_texel.map(|x| (1.0 - x) as f32));
    assert_eq!(mesh.uvs[0][4], [0.5, 0.5]);
}

fn free_form(surfaces: &[Surface]) -> Result<String, WriteError> {
    let folder = folder();
    let path = folder.path().join("a.obj");
    write_obj_surfaces(&path, surfaces)?;
    Ok(std::fs::read_to_string(path).unwrap())
}

#[test]
fn free_form_cube_of_6_bezier_patches_shares_56_vertices_and_lists_u_first() {
    let text = free_form(&flat_cube(4, DVec3::ZERO).1).unwrap();
    // 8 corners, 2 on each of 12 edges, 4 on each of 6 faces.
    assert_eq!(["v", "g", "surf", "parm", "end"].map(|keyword| count(&text, keyword)), [56, 6, 6, 12, 6]);
    assert!(
        text.contains("\ncstype bspline\ndeg 3 3\ng patch_0000\nsurf 0 1 0 1 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16\n")
    );
    assert!(text.contains("\nparm u 0 0 0 0 1 1 1 1\nparm v 0 0 0 0 1 1 1 1\nend\n"));
    let text = free_form(&sheet().1).unwrap();
    assert!(text.contains("\nv 0 0 0\nv 0.16666666666666666 0 "), "{text}");
}

#[test]
fn free_form_obj_keeps_all_17_digits_and_refuses_what_is_no_surface() {
    let mut surfaces = sheet().1;
    surfaces[0].control[8].z = 0.1 + 0.2;
    assert!(free_form(&surfaces).unwrap().contains(" 0.30000000000000004\n"));
    surfaces[1].knots_v[0] = 0.5;
    for (surfaces, wanted) in [(&surfaces[..], "(patch 1)"), (&[], "the model has no surfaces")] {
        let message = free_form(surfaces).unwrap_err().to_string();
        assert!(message.contains(wanted) && message.contains(" - hint: "), "{message}");
    }
}
