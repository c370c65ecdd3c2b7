//! USD: a cube to the number, the place of models far away, and what is refused.

mod common;

use common::{ball, flat_cube, flat_maps, folder, sheet};
use planish::observe::Silent;
use planish::relief::{displaced_patches, surface_patches};
use planish::surface::Surface;
use planish::{DVec3, Units};
use planish_io::{MappedMesh, Up, UsdInput, WriteError, WriteOptions, write_usd};

fn write(surfaces: &[Surface], mesh: Option<&MappedMesh>, shift: DVec3) -> Result<String, WriteError> {
    let folder = folder();
    let path = folder.path().join("a.usda");
    let options = WriteOptions { units: Units::Mm, up: Up::Z, name: "1 \"ä\"".into() };
    let mesh = mesh.map(|mesh| ("displaced", mesh));
    write_usd(&path, &UsdInput { surfaces, mesh, shift, materials: &[], options: &options })?;
    Ok(std::fs::read_to_string(path).unwrap())
}

/// What stands between the brackets behind `key`, once for each time it stands there.
fn lists<'a>(text: &'a str, key: &str) -> Vec<&'a str> {
    let key = format!("{key} = [");
    text.split(&key).skip(1).map(|part| part.split(']').next().unwrap()).collect()
}

#[test]
fn cube_of_6_flat_patches_has_bezier_knots_a_box_of_edge_2_and_texels_at_a_sixth() {
    let (network, surfaces) = flat_cube(4, DVec3::ZERO);
    let maps = flat_maps(&surfaces, 3, 3);
    let mesh = MappedMesh::new(displaced_patches(&network, &surfaces, &maps, &Silent).unwrap(), &maps);
    let text = write(&surfaces, Some(&mesh), DVec3::ZERO).unwrap();
    assert!(text.starts_with("#usda 1.0\n(\n    defaultPrim = \"_1____\"\n"));
    for (words, count) in [
        ("    metersPerUnit = 0.001\n    upAxis = \"Z\"\n", 1),
        ("displayName = \"1 \\\"ä\\\"\"", 1),
        ("xformOp", 0),
        ("def NurbsPatch", 6),
        ("int uVertexCount = 4\n", 6),
        ("double[] vKnots = [0, 0, 0, 0, 1, 1, 1, 1]", 6),
        ("double2 uRange = (0, 1)", 6),
        ("subdivisionScheme = \"none\"", 1),
        ("def GeomSubset", 6),
    ] {
        assert_eq!(text.matches(words).count(), count, "{words}");
    }
    assert_eq!(lists(&text, "extent").last(), Some(&"(-1, -1, -1), (1, 1, 1)"));
    // 3 x 3 nodes: 8 corners, 12 edges and 6 faces of one node each, 8 triangles for every face.
    assert_eq!(lists(&text, "faceVertexCounts")[0].split(", ").count(), 48);
    let points = lists(&text, "point3f[] points");
    assert_eq!(points.last().unwrap().split("), ").count(), 26);
    let subset: Vec<_> = lists(&text, "int[] indices");
    assert_eq!(subset[5], "40, 41, 42, 43, 44, 45, 46, 47");
    let st = lists(&text, "primvars:st");
    assert!(
        st[0].starts_with("(0.16666667, 0.16666667), (0.5, 0.16666667), (0.8333333, 0.16666667), (0.16666667, 0.5)")
    );
    // The edges of a cube are sharp: all normals are those of the faces.
    let normals = lists(&text, "primvars:normals")[0];
    assert_eq!(normals.split("), ").count(), 54);
    assert!(normals.starts_with("(0, 0, -1), (0, 0, -1)"), "{normals}");
}

#[test]
fn points_run_along_u_first() {
    let (_, surfaces) = sheet();
    let text = write(&surfaces[..1], None, DVec3::ZERO).unwrap();
    assert!(
        text.contains("int uVertexCount = 7") && text.contains("int vVertexCount = 5") && !text.contains("def Mesh")
    );
    let points = lists(&text, "point3f[] points")[0];
    assert!(points.starts_with("(0, 0, 0), (0.16666667, 0, "), "{points}");
}

#[test]
fn normals_of_a_ball_of_6_patches_agree_along_its_smooth_seams_and_point_outside() {
    let (network, surfaces) = ball(8, DVec3::ZERO);
    let mesh = MappedMesh::new(surface_patches(&network, &surfaces, &[[9, 9]; 6], &Silent).unwrap(), &[]);
    let mut at = vec![None; mesh.patched.mesh.points.len()];
    for (nodes, normals) in mesh.patched.patches.iter().zip(&mesh.normals) {
        for (&v, n) in nodes.vertices.iter().zip(normals) {
            assert!(n.is_normalized() && n.dot(mesh.patched.mesh.points[v as usize].normalize()) > 0.97);
            assert!(at[v as usize].replace(*n).is_none_or(|other: DVec3| other.distance(*n) < 1e-12));
        }
    }
}

#[test]
fn model_at_utm_coordinates_keeps_its_digits_by_a_transform_of_double_precision() {
    let (_, surfaces) = sheet();
    let text = write(&surfaces, None, DVec3::new(515_381.0, 4_918_362.0, 2_331.0)).unwrap();
    assert!(text.contains("double3 xformOp:translate = (515381, 4918362, 2331)"));
    assert!(text.contains("uniform token[] xformOpOrder = [\"xformOp:translate\"]"));
    assert_eq!(
        lists(&text, "point3f[] points"),
        lists(&write(&surfaces, None, DVec3::ZERO).unwrap(), "point3f[] points")
    );
}

#[test]
fn no_surfaces_folded_knots_and_points_beyond_single_precision_are_refused_with_the_place() {
    let refused = |surfaces: &[Surface], wanted: &str| {
        let message = write(surfaces, None, DVec3::ZERO).unwrap_err().to_string();
        assert!(message.contains(wanted) && message.contains(" - hint: "), "{message}");
    };
    refused(&[], "the model has no surfaces");
    let mut surfaces = sheet().1;
    surfaces[1].control[3].x = 1e39;
    refused(&surfaces, "cannot be written (patch 1)");
    surfaces[1].control[3].x = 0.0;
    surfaces[0].knots_u[5] = -1.0;
    refused(&surfaces, "(patch 0)");
}
