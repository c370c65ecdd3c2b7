//! PLY, OBJ, STL and glTF: what is written is read back, and what other programs write is read rightly.

#![allow(clippy::print_stdout)] // figures and skipped tests are told to who runs them

mod common;

use common::{coloured_cube, cube, data, file, folder, volume6};
use planish::mesh::TriMesh;
use planish::{DVec3, Units};
use planish_io::{Up, WriteOptions, read_mesh, write_mesh};

fn written(name: &str, mesh: &TriMesh) -> TriMesh {
    let folder = folder();
    let path = folder.path().join(name);
    write_mesh(&path, mesh, &WriteOptions { units: Units::M, ..Default::default() }).unwrap();
    read_mesh(&path).unwrap()
}

#[test]
fn ply_gives_back_every_bit_of_points_triangles_and_attributes() {
    let mesh = coloured_cube();
    assert_eq!(written("a.ply", &mesh), mesh);
    let mut fine = mesh.clone();
    for p in &mut fine.points {
        *p = *p * 0.1 + DVec3::splat(1.0 / 3.0);
    }
    assert_eq!(written("a.ply", &fine), fine);
}

#[test]
fn ply_chooses_float_when_it_is_exact_and_double_otherwise() {
    let folder = folder();
    let path = folder.path().join("a.ply");
    let head = |mesh: &TriMesh| {
        write_mesh(&path, mesh, &WriteOptions::default()).unwrap();
        String::from_utf8_lossy(&std::fs::read(&path).unwrap()).into_owned()
    };
    let mut mesh = cube();
    assert!(head(&mesh).contains("property float x\n"));
    mesh.points[3].x = 0.1;
    assert!(head(&mesh).contains("property double x\n"));
}

#[test]
fn ply_keeps_an_attribute_of_width_5_and_colours_between_the_steps() {
    let mut mesh = coloured_cube();
    mesh.attributes[1].values[4] = 0.123_456;
    mesh.attributes[2].name = "moment".into();
    mesh.attributes[2].width = 5;
    mesh.attributes[2].values = (0..40).map(|k| (k as f32).sin()).collect();
    assert_eq!(written("a.ply", &mesh), mesh);
}

#[test]
fn obj_gives_back_every_bit_of_points_colours_and_normals() {
    let mut mesh = coloured_cube();
    mesh.attributes.truncate(2);
    mesh.points.iter_mut().for_each(|p| *p = *p * 0.1 + DVec3::splat(1.0 / 3.0));
    assert_eq!(written("a.obj", &mesh), mesh);
}

#[test]
fn stl_is_welded_to_the_8_vertices_of_the_cube() {
    let back = written("a.stl", &cube());
    assert_eq!((back.points.len(), back.triangles.len()), (8, 12));
    assert!((volume6(&back) - 6.0).abs() < 1e-12);
}

#[test]
fn glb_gives_back_points_triangles_normals_and_colours() {
    let mut mesh = coloured_cube();
    mesh.attributes.truncate(2);
    let back = written("a.glb", &mesh);
    assert_eq!((&back.points, &back.triangles), (&mesh.points, &mesh.triangles));
    assert_eq!(back.attributes[1], mesh.attributes[1]);
    let error = |(a, b): (&f32, &f32)| (a - b).abs();
    let worst = back.attributes[0].values.iter().zip(&mesh.attributes[0].values).map(error).fold(0.0, f32::max);
    assert!(worst < 1e-6, "{worst}");
}

#[test]
fn glb_in_millimetres_with_z_up_is_read_in_metres_with_y_up() {
    let folder = folder();
    let path = folder.path().join("a.glb");
    let mut mesh = cube();
    mesh.points.iter_mut().for_each(|p| *p *= DVec3::new(1000.0, 2000.0, 3000.0));
    write_mesh(&path, &mesh, &WriteOptions { units: Units::Mm, up: Up::Z, ..Default::default() }).unwrap();
    let back = read_mesh(&path).unwrap();
    let box_ = back.bounds();
    assert!((box_.max - DVec3::new(1.0, 3.0, 0.0)).length() < 1e-9, "{:?}", box_.max);
    assert!((box_.min - DVec3::new(0.0, 0.0, -2.0)).length() < 1e-9, "{:?}", box_.min);
    assert!((volume6(&back) - 36.0).abs() < 1e-6);
}

const BYTE: u8 = 0xC0;

/// A tetrahedron as PLY with extra elements, an extra list, properties out of order, in three encodings.
fn tetrahedron(encoding: &str) -> Vec<u8> {
    let head = format!(
        "ply\r\nformat {encoding} 1.0\r\ncomment made by a test\r\nobj_info x\r\nelement camera 1\r\nproperty list uchar \
         float view\r\nelement vertex 4\r\nproperty uchar red\r\nproperty double z\r\nproperty uchar green\r\nproperty \
         float x\r\nproperty uchar blue\r\nproperty short y\r\nproperty list uint ushort used\r\nproperty int \
         label\r\nelement face 4\r\nproperty uchar flag\r\nproperty list ushort uint vertex_index\r\nelement edge \
         1\r\nproperty int vertex1\r\nend_header\r\n"
    )
    .replace("\r\n", "\n");
    let mut out = head.into_bytes();
    let big = encoding == "binary_big_endian";
    let ascii = encoding == "ascii";
    let mut put = |little: &[u8], text: String| {
        if ascii {
            out.extend(text.bytes());
        } else if big {
            out.extend(little.iter().rev());
        } else {
            out.extend(little);
        }
    };
    let end = |put: &mut dyn FnMut(&[u8], String)| {
        if ascii {
            put(&[], "\n".into());
        }
    };
    put(&[2], "2 ".into());
    put(&1.5f32.to_le_bytes(), "1.5 ".into());
    put(&2.5f32.to_le_bytes(), "2.5".into());
    end(&mut put);
    for (x, y, z) in [(0.0f32, 0i16, 0.0f64), (1.0, 0, 0.0), (0.0, 1, 0.0), (0.0, 0, 0.1)] {
        put(&[BYTE], format!("{BYTE} "));
        put(&z.to_le_bytes(), format!("{z} "));
        put(&[0], "0 ".into());
        put(&x.to_le_bytes(), format!("{x} "));
        put(&[255], "255 ".into());
        put(&y.to_le_bytes(), format!("{y} "));
        put(&1u32.to_le_bytes(), "1 ".into());
        put(&9u16.to_le_bytes(), "9 ".into());
        put(&(-7i32).to_le_bytes(), "-7".into());
        end(&mut put);
    }
    for face in [[0u32, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] {
        put(&[1], "1 ".into());
        put(&3u16.to_le_bytes(), "3 ".into());
        face.iter().for_each(|v| put(&v.to_le_bytes(), format!("{v} ")));
        end(&mut put);
    }
    put(&5i32.to_le_bytes(), "5".into());
    end(&mut put);
    out
}

#[test]
fn ply_of_all_three_encodings_with_extra_elements_and_lists_gives_one_mesh() {
    let folder = folder();
    let read = |encoding: &str| read_mesh(file(&folder, "a.ply", tetrahedron(encoding))).unwrap();
    let ascii = read("ascii");
    assert_eq!(ascii.points[3], DVec3::new(0.0, 0.0, 0.1));
    assert_eq!(ascii.triangles, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]);
    assert_eq!(ascii.attributes[0].values[..3], [BYTE as f32 / 255.0, 0.0, 1.0]);
    assert_eq!((ascii.attributes[1].name.as_str(), ascii.attributes[1].values[0]), ("label", -7.0));
    assert_eq!(read("binary_little_endian"), ascii);
    assert_eq!(read("binary_big_endian"), ascii);
}

#[test]
fn ply_tristrips_with_restarts_become_3_triangles_of_one_side() {
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement \
                tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n8 0 1 2 3 -1 0 1 3\n";
    let folder = folder();
    let mesh = read_mesh(file(&folder, "a.ply", text)).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3], [0, 1, 3]]);
    assert!((0..3).all(|t| mesh.normal(t).z > 0.5));
}

/// A concave "L" of area 3 in the plane `z = 2x`, as one polygon.
const L: [[f64; 2]; 6] = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];

#[test]
fn concave_polygon_from_any_first_corner_is_cut_into_triangles_of_its_own_area() {
    let folder = folder();
    for first in 0..6 {
        let mut text = String::new();
        for k in 0..6 {
            let [x, y] = L[(k + first) % 6];
            text += &format!("v {x} {y} {}\n", 2.0 * x);
        }
        let mesh = read_mesh(file(&folder, "l.obj", text + "f 1 2 3 4 5 6\n")).unwrap();
        assert_eq!(mesh.triangles.len(), 4);
        let area: f64 = (0..4).map(|t| mesh.area(t)).sum();
        assert!((area - 3.0 * 5f64.sqrt()).abs() < 1e-12, "corner {first}: {area}");
        assert!((0..4).all(|t| mesh.normal(t).z > 0.0));
    }
}

#[test]
fn obj_with_negative_indices_continued_lines_and_split_uvs_keeps_4_vertices() {
    let text = "# hi\nmtllib none.mtl\no thing\nv 0 0 0\nv 1 0 0 # end\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt .5 .5\n\
                vn 0 0 1\ns off\nf -4/1/1 -3/2/1 \\\n -2/3/1\nf 1/4/1 3/3/1 4/1/1\n";
    let folder = folder();
    let mesh = read_mesh(file(&folder, "a.OBJ", text)).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    // Vertex 0 has two texture coordinates: only the normals are per vertex.
    assert_eq!(mesh.attributes.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(), ["normal"]);
}

#[test]
fn obj_faces_may_stand_before_their_vertices() {
    let folder = folder();
    let mesh = read_mesh(file(&folder, "a.obj", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n")).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn binary_stl_that_begins_with_solid_and_ascii_stl_agree() {
    let folder = folder();
    let path = folder.path().join("a.stl");
    write_mesh(&path, &cube(), &WriteOptions::default()).unwrap();
    let plain = read_mesh(&path).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[..14].copy_from_slice(b"solid facet \n ");
    assert_eq!(read_mesh(file(&folder, "b.stl", bytes)).unwrap(), plain);
    let mut text = "solid cube\n".to_string();
    for t in 0..12 {
        text += "facet normal 0 0 0\n outer loop\n";
        for p in cube().corners(t) {
            text += &format!("  vertex {:e} {} {}\n", p.x, p.y, p.z);
        }
        text += " endloop\nendfacet\n";
    }
    assert_eq!(read_mesh(file(&folder, "c.stl", text + "endsolid cube\n")).unwrap(), plain);
}

#[test]
fn gltf_with_data_address_instances_and_a_mirror_gives_outward_triangles() {
    use base64::Engine;
    let points: Vec<u8> =
        cube().points.iter().flat_map(|p| p.as_vec3().to_array()).flat_map(f32::to_le_bytes).collect();
    let corners: Vec<u8> = cube().triangles.iter().flatten().map(|&v| v as u8).collect();
    let bytes = [points, corners].concat();
    let document = |uri: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"children":[1,2],"scale":[2,2,2]}},{{"mesh":0,"translation":[5,0,0]}},
            {{"mesh":0,"matrix":[-1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},
            "indices":1}},{{"attributes":{{"POSITION":0}},"mode":0}}]}}],"accessors":[{{"bufferView":0,"componentType":5126,
            "count":8,"type":"VEC3"}},{{"bufferView":0,"byteOffset":96,"componentType":5121,"count":36,"type":"SCALAR"}}],
            "bufferViews":[{{"buffer":0,"byteLength":132}}],"buffers":[{{"byteLength":132,"uri":"{uri}"}}]}}"#
        )
    };
    let folder = folder();
    let text = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let inside = read_mesh(file(&folder, "a.gltf", document(&format!("data:application/octet-stream;base64,{text}"))));
    let inside = inside.unwrap();
    assert_eq!((inside.points.len(), inside.triangles.len()), (16, 24));
    assert!((volume6(&inside) - 96.0).abs() < 1e-9, "{}", volume6(&inside));
    assert_eq!((inside.bounds().min.x, inside.bounds().max.x), (-2.0, 12.0));
    file(&folder, "my buffer.bin", &bytes);
    assert_eq!(read_mesh(file(&folder, "b.gltf", document("my%20buffer.bin"))).unwrap(), inside);
    let outside = read_mesh(file(&folder, "c.gltf", document("../my%20buffer.bin"))).unwrap_err().to_string();
    assert!(outside.contains("outside the folder"), "{outside}");
}

#[test]
fn other_readers_find_the_same_cube_in_our_ply_obj_and_stl() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    for name in ["a.ply", "a.obj", "a.stl"] {
        write_mesh(path(name), &coloured_cube(), &WriteOptions::default()).unwrap();
    }
    let mut ply = std::io::BufReader::new(std::fs::File::open(path("a.ply")).unwrap());
    let found = ply_rs_bw::parser::Parser::<ply_rs_bw::ply::DefaultElement>::new().read_ply(&mut ply).unwrap();
    assert_eq!((found.payload["vertex"].len(), found.payload["face"].len()), (8, 12));
    let (models, _) = tobj::load_obj(path("a.obj"), &tobj::LoadOptions::default()).unwrap();
    assert_eq!((models[0].mesh.positions.len(), models[0].mesh.indices.len()), (24, 36));
    assert_eq!(models[0].mesh.vertex_color.len(), 24);
    let mut stl = std::fs::File::open(path("a.stl")).unwrap();
    let found = stl_io::read_stl(&mut stl).unwrap();
    assert_eq!((found.vertices.len(), found.faces.len()), (8, 12));
}

#[test]
fn nothing_is_left_behind_when_a_mesh_cannot_be_written() {
    let folder = folder();
    let path = file(&folder, "a.stl", "old");
    let mut mesh = cube();
    mesh.points[0].x = 1e300;
    assert!(write_mesh(&path, &mesh, &WriteOptions::default()).unwrap_err().to_string().contains("vertex 0"));
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    let missing = write_mesh(folder.path().join("none/a.ply"), &cube(), &WriteOptions::default()).unwrap_err();
    assert!(missing.to_string().contains("hint: check that the folder exists"), "{missing}");
    let unknown = write_mesh(folder.path().join("a.fbx"), &cube(), &WriteOptions::default()).unwrap_err().to_string();
    assert_eq!(unknown, "unknown extension \"fbx\" - hint: use one of .ply, .obj, .stl, .glb");
}

#[test]
fn real_meshes_have_the_counts_that_their_list_says() {
    let Some(data) = data() else {
        println!("skipped: no folder of real meshes");
        return;
    };
    for (name, vertices, triangles) in
        [("fandisk.ply", 6475, 12946), ("bunny.ply", 35947, 69451), ("dragon.ply", 437_645, 871_414)]
    {
        let start = std::time::Instant::now();
        let mesh = read_mesh(data.join(name)).unwrap();
        println!("{name}: {:.3} s", start.elapsed().as_secs_f64());
        assert_eq!((mesh.points.len(), mesh.triangles.len()), (vertices, triangles), "{name}");
        let folder = folder();
        for format in ["ply", "obj", "stl", "glb"] {
            let path = folder.path().join(format!("a.{format}"));
            let start = std::time::Instant::now();
            write_mesh(&path, &mesh, &WriteOptions { units: Units::M, ..Default::default() }).unwrap();
            let wrote = start.elapsed().as_secs_f64();
            let start = std::time::Instant::now();
            let back = read_mesh(&path).unwrap();
            println!("{name} as {format}: write {wrote:.3} s, read {:.3} s", start.elapsed().as_secs_f64());
            match format {
                "ply" => assert!(back == mesh),
                "obj" => assert!(back.points == mesh.points && back.triangles == mesh.triangles),
                // Welded: vertices at one place become one, triangles that collapse by it go.
                _ => assert!(back.points.len() <= vertices && back.triangles.len() > triangles * 99 / 100),
            }
            let scale = mesh.bounds().diagonal();
            assert!((back.bounds().diagonal() - scale).abs() < 1e-6 * scale);
        }
    }
}

/// Set `PLANISH_PYTHON` to a Python that has trimesh to run this one.
#[test]
fn trimesh_reads_our_glb_as_a_watertight_cube_of_volume_1e_9_cubic_metres() {
    let Some(python) = std::env::var_os("PLANISH_PYTHON") else {
        println!("skipped: PLANISH_PYTHON is not set");
        return;
    };
    let folder = folder();
    let path = folder.path().join("a.glb");
    write_mesh(&path, &coloured_cube(), &WriteOptions::default()).unwrap();
    let script = "import trimesh,sys\nm=trimesh.load(sys.argv[1],process=False).to_geometry()\n\
                  print(len(m.vertices),len(m.faces),m.is_watertight,'%.6e'%m.volume,m.visual.kind)";
    let output = std::process::Command::new(python).args(["-c", script]).arg(&path).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(text.trim(), "8 12 True 1.000000e-09 vertex", "{}", String::from_utf8_lossy(&output.stderr));
}
