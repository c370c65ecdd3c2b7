//! Files that are damaged, lie or are something else: always one line that says what, where and what to do.

mod common;

use common::{coloured_cube, file, folder};
use planish_io::{ReadError, WriteOptions, read_mesh, write_mesh};
use proptest::prelude::*;

const HEAD: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement \
                    face 1\nproperty list uchar int vertex_indices\nend_header\n";
const POINTS: &str = "0 0 0\n1 0 0\n0 1 0\n";

fn ply(head: &str, body: &str) -> Vec<u8> {
    format!("{head}{body}").into_bytes()
}

fn stl(claimed: u32, triangles: usize) -> Vec<u8> {
    [&[b'x'; 80][..], &claimed.to_le_bytes(), &vec![0u8; 50 * triangles]].concat()
}

/// Name, content, what the message must contain.
fn table() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let with = |from: &str, to: &str| HEAD.replace(from, to);
    let good = || format!("{POINTS}3 0 1 2\n");
    let binary = |extra: &str| HEAD.replace("ascii", "binary_little_endian").replace("element vertex 3", extra);
    vec![
        ("empty.ply", vec![], "the file is empty (byte 0)"),
        ("a.xyz", b"1 2 3".to_vec(), "unknown extension \"xyz\""),
        ("noextension", b"1 2 3".to_vec(), "unknown extension \"\""),
        ("a.ply", b"PLY\nformat ascii 1.0\n".to_vec(), "the content is something else"),
        ("b.obj", ply(HEAD, &good()), "the name says OBJ but the content is PLY"),
        ("c.ply", b"glTF\x02\0\0\0\x0c\0\0\0".to_vec(), "rename it to .glb"),
        ("d.ply", stl(1, 1), "the content is STL"),
        ("nan.ply", ply(HEAD, "0 0 0\nnan 0 0\n0 1 0\n3 0 1 2\n"), "coordinate NaN cannot be computed with (vertex 1)"),
        ("inf.ply", ply(HEAD, "0 0 0\n1 0 0\n0 -inf 0\n3 0 1 2\n"), "coordinate -inf cannot be computed with (vertex 2)"),
        ("huge.ply", ply(&HEAD.replace("float", "double"), "0 0 0\n1e200 0 0\n0 1 0\n3 0 1 2\n"), "(vertex 1)"),
        ("index.ply", ply(HEAD, &format!("{POINTS}3 0 1 3\n")), "vertex index 3 is outside the 3 vertices (face 0)"),
        ("negative.ply", ply(HEAD, &format!("{POINTS}3 0 1 -1\n")), "vertex index -1 is outside the 3 vertices (face 0)"),
        ("word.ply", ply(HEAD, &format!("{POINTS}3 0 one 2\n")), "\"one\" is not a whole number (line 13)"),
        ("short.ply", ply(HEAD, "0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), "fewer numbers than the header says (line 10)"),
        ("rest.ply", ply(HEAD, &format!("{}3 0 1 2\n", good())), "\"3\" follows the last element (line 14)"),
        ("list.ply", ply(&with("uchar int", "char int"), &format!("{POINTS}-3 0 1 2\n")), "a list has the count -3"),
        ("two.ply", ply(HEAD, &format!("{POINTS}2 0 1\n")), "a face has 2 corners (face 0)"),
        ("none.ply", ply(&with("element face 1", "element face 0"), POINTS), "no triangle with area (0 faces)"),
        ("flat.ply", ply(HEAD, &format!("{POINTS}3 0 1 1\n")), "no triangle with area (1 faces)"),
        ("type.ply", ply(&with("float y", "quad y"), &good()), "unknown property type \"quad\" (line 5)"),
        ("noz.ply", ply(&with("property float z\n", ""), "0 0\n1 0\n0 1\n3 0 1 2\n"), "the vertices have no \"z\""),
        ("twice.ply", ply(&with("float z", "float x"), &good()), "property \"x\" stands twice (line 6)"),
        ("encoding.ply", ply(&with("ascii", "morse"), &good()), "unknown encoding \"morse\" (line 2)"),
        ("count.ply", ply(&with("vertex 3", "vertex -3"), &good()), "\"-3\" is no count of elements (line 3)"),
        ("version.ply", ply("ply\nformat ascii 7.0\n", ""), "version \"7.0\" of PLY is unknown (line 2)"),
        ("orphan.ply", ply("ply\nformat ascii 1.0\nproperty float x\n", ""), "before the first element (line 3)"),
        ("endless.ply", ply("ply\nformat ascii 1.0\n", ""), "the header has no end_header"),
        ("novertex.ply", ply("ply\nformat ascii 1.0\nend_header\n", ""), "there is no element \"vertex\""),
        ("nolist.ply", ply(&with("list uchar int", "int"), &good()), "has no list \"vertex_indices\""),
        ("floatlist.ply", ply(&with("list uchar", "list float"), &good()), "a list is counted by a real number"),
        ("lie.ply", ply(&with("vertex 3", "vertex 4000000000"), &good()), "\"element vertex 4000000000\" needs"),
        ("lie2.ply", ply(&with("face 1", "face 4000000000"), &good()), "\"element face 4000000000\" needs"),
        ("lie3.ply", ply(&binary("element vertex 4000000000"), &good()), "\"element vertex 4000000000\" needs"),
        (
            "lie4.ply",
            ply(&HEAD.replace("element vertex", "element void 99999999999\nelement vertex"), &good()),
            // An element without properties takes no bytes: it is no lie.
            "",
        ),
        ("lie5.ply", ply(&with("vertex 3", "vertex 18446744073709551615"), &good()), "needs 18446744073709551615"),
        (
            "lie6.ply",
            [ply(&binary("element vertex 0").replace("uchar int", "uint int"), ""), vec![255; 4]].concat(),
            "a list of 4294967295 numbers needs 17179869180 bytes but 0 are left",
        ),
        ("garbage.obj", vec![0xff, 0xfe, 0x00, 0x80, b'\n', 0xc3, 0x28], "is no word of an OBJ file (line 1)"),
        ("empty.obj", b"# nothing\n".to_vec(), "0 vertices and no triangle"),
        ("before.obj", b"f -1 -2 -3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n".to_vec(), "vertex index -1 is outside the 0 vertices (line 1)"),
        ("zero.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n".to_vec(), "vertex index 0 is outside the 3 vertices (line 4)"),
        ("far.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n".to_vec(), "vertex index 8 is outside the 3 vertices (line 4)"),
        ("two.obj", b"v 0 0 0\nv 1 0 0\nf 1 2\n".to_vec(), "a face has 2 corners (line 3)"),
        ("flat.obj", b"v 0 0\n".to_vec(), "2 numbers stand where 3 are needed (line 1)"),
        ("nan.obj", b"v 0 0 0\nv NaN 0 0\nv 0 1 0\nf 1 2 3\n".to_vec(), "(vertex 1)"),
        ("huge.obj", b"v 0 0 0\nf 99999999999999999999 1 1\n".to_vec(), "is not a whole number (line 2)"),
        ("tiny.stl", b"abc".to_vec(), "the header of a binary STL needs 84 bytes but 3 are left"),
        ("lie.stl", stl(4_000_000_000, 20), "the claimed 4000000000 triangles needs 200000000000 bytes but 1000 are left"),
        ("none.stl", stl(0, 0), "no triangle with area (0 faces)"),
        ("collapsed.stl", stl(3, 3), "no triangle with area (3 faces)"),
        ("cut.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n".to_vec(), "the solid, which has no \"endsolid\""),
        ("four.stl", b"solid a\nfacet\nvertex 0 0 0\nendfacet\nendsolid\n".to_vec(), "a facet has 1 vertices instead of 3 (line 4)"),
        ("json.gltf", b"{\"asset\": 1,\n \"nodes\": 3}".to_vec(), "the document is not glTF"),
        ("empty.gltf", b"{}".to_vec(), "0 vertices and no triangle"),
        ("ring.gltf", b"{\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"children\":[0]}]}".to_vec(), "the node has two parents (node 0)"),
        (
            "draco.gltf",
            b"{\"extensionsRequired\":[\"KHR_draco_mesh_compression\"]}".to_vec(),
            "the extension KHR_draco_mesh_compression cannot be read",
        ),
        (
            "lie.gltf",
            br#"{"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"accessors":[{"bufferView":0,
            "componentType":5126,"count":90000000,"type":"VEC3"}],"bufferViews":[{"buffer":0,"byteLength":3}],"buffers":[
            {"byteLength":3,"uri":"data:;base64,AAAA"}]}"#
                .to_vec(),
            "90000000 items needs 1080000000 bytes but 3 are left (accessor 0)",
        ),
        (
            "lie2.gltf",
            br#"{"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"accessors":[{
            "componentType":5126,"count":4000000000,"type":"VEC3"}]}"#
                .to_vec(),
            "4000000000 vertices are more than",
        ),
        ("missing.gltf", br#"{"buffers":[{"byteLength":3,"uri":"none.bin"}]}"#.to_vec(), "the file \"none.bin\" that it refers to"),
        ("old.glb", b"glTF\x01\0\0\0\x14\0\0\0".to_vec(), "version 1 of glTF cannot be read (byte 4)"),
    ]
}

#[test]
fn every_malformed_file_gives_one_line_with_what_where_and_a_hint() {
    let folder = folder();
    for (name, content, wanted) in table() {
        let found = read_mesh(file(&folder, name, content));
        if wanted.is_empty() {
            assert!(found.is_ok(), "{name}: {found:?}");
            continue;
        }
        let message = found.expect_err(name).to_string();
        assert!(message.contains(wanted), "{name}: {message}");
        assert!(message.contains(" - hint: ") && !message.contains('\n'), "{name}: {message}");
    }
}

#[test]
fn a_folder_and_a_missing_file_are_refused() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("a.ply")).unwrap();
    assert!(matches!(read_mesh(folder.path().join("a.ply")), Err(ReadError::NotAFile("a folder"))));
    assert!(matches!(read_mesh(folder.path().join("b.ply")), Err(ReadError::Io(_))));
}

/// A small valid file of each format, made once.
fn valid() -> &'static [(&'static str, Vec<u8>)] {
    static FILES: std::sync::OnceLock<Vec<(&str, Vec<u8>)>> = std::sync::OnceLock::new();
    FILES.get_or_init(make_valid)
}

fn make_valid() -> Vec<(&'static str, Vec<u8>)> {
    let folder = folder();
    let mut files: Vec<(&str, Vec<u8>)> = ["a.ply", "a.obj", "a.stl", "a.glb"]
        .into_iter()
        .map(|name| {
            let path = folder.path().join(name);
            write_mesh(&path, &coloured_cube(), &WriteOptions::default()).unwrap();
            (name, std::fs::read(path).unwrap())
        })
        .collect();
    files.push(("b.ply", ply(HEAD, &format!("{POINTS}3 0 1 2\n"))));
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    files.push(("b.stl", format!("solid a\n{facet}endsolid a\n").into_bytes()));
    files
}

#[test]
fn files_cut_at_every_3rd_byte_never_panic_and_binary_ones_are_all_refused() {
    let folder = folder();
    for &(name, ref bytes) in valid() {
        for length in (0..bytes.len()).step_by(3) {
            let found = read_mesh(file(&folder, name, &bytes[..length]));
            // A text format can be cut where what is left is a smaller mesh, or within the last word.
            let tail = if name == "b.stl" { 3 } else { 1 };
            if ["a.ply", "a.stl", "a.glb", "b.stl"].contains(&name) && length + tail < bytes.len() {
                assert!(found.is_err(), "{name} cut at {length}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..Default::default() })]

    #[test]
    fn bytes_changed_at_random_never_panic_and_never_give_a_mesh_out_of_bounds(
        which in 0usize..6,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let (name, mut bytes) = valid()[which].clone();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let folder = folder();
        if let Ok(mesh) = read_mesh(file(&folder, name, bytes)) {
            prop_assert!(!mesh.triangles.is_empty());
            prop_assert!(mesh.points.iter().all(|p| p.is_finite()));
            prop_assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < mesh.points.len()));
            prop_assert!(mesh.attributes.iter().all(|a| a.values.len() == a.width * mesh.points.len()));
        }
    }

    #[test]
    fn any_bytes_under_any_name_never_panic(which in 0usize..5, bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let name = ["a.ply", "a.obj", "a.stl", "a.gltf", "a.glb"][which];
        let folder = folder();
        let _ = read_mesh(file(&folder, name, bytes));
    }
}
