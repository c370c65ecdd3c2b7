//! Scan formats: there and back, and files that are damaged.

use glam::DVec3;
use planish::cloud::Cloud;
use planish::mesh::Attribute;
use planish_io::{Place, ReadError, ScanOptions, is_scan, read_scan, write_scan};
use std::path::PathBuf;

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn column(name: &str, width: usize, values: Vec<f32>) -> Attribute {
    Attribute { name: name.into(), width, values }
}

/// Points with large coordinates, colour and intensity.
fn scan(count: usize) -> Cloud {
    let points = (0..count)
        .map(|i| {
            DVec3::new(515_380.25 + 0.001 * i as f64, 4_918_360.5 - 0.002 * i as f64, 2_330.0 + (i % 7) as f64 * 0.01)
        })
        .collect();
    let color = (0..3 * count).map(|k| (k % 256) as f32 / 255.0).collect();
    let intensity = (0..count).map(|k| (k % 100) as f32 / 100.0).collect();
    Cloud { attributes: vec![column("color", 3, color), column("intensity", 1, intensity)], ..Cloud::new(points) }
}

fn read(path: &PathBuf) -> Result<Cloud, ReadError> {
    read_scan(path, &ScanOptions::default())
}

#[test]
fn large_coordinates_survive_every_written_format_within_1e_6_and_leave_with_their_shift() {
    let folder = folder();
    let given = scan(500);
    for extension in ["ply", "las", "e57", "xyz"] {
        let path = folder.path().join(format!("a.{extension}"));
        write_scan(&path, &given).unwrap();
        assert!(is_scan(&path), "{extension}");
        let back = read(&path).unwrap();
        assert!(back.shift.length() > 1e6, "{extension}");
        assert_eq!(back.points.len(), 500);
        for (p, q) in given.points.iter().zip(&back.points) {
            assert!((*p - (*q + back.shift)).length() < 1e-6, "{extension}: {p} {q}");
        }
        let again = folder.path().join(format!("b.{extension}"));
        write_scan(&again, &back).unwrap();
        let twice = read(&again).unwrap();
        assert!(twice.points.iter().zip(&back.points).all(|(p, q)| (*p - *q).length() < 1e-6), "{extension}");
        let color = back.attribute("color", 3).unwrap();
        assert!((color.values[3 * 20] - 60.0 / 255.0).abs() < 0.003, "{extension}");
        let intensity = back.attribute("intensity", 1).unwrap();
        assert!((intensity.values[42] - 0.42).abs() < 0.003, "{extension}");
    }
}

#[test]
fn text_columns_come_from_the_header_the_option_or_a_guess() {
    let folder = folder();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let header = read(&write("a.csv", "intensity,x,y,z\n0.5,1,2,3\n0.7,4,5,6\n")).unwrap();
    assert_eq!(header.points, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)]);
    assert_eq!(header.attribute("intensity", 1).unwrap().values, [0.5, 0.7]);
    let guess = read(&write("a.xyz", "# made by hand\n1 2 3 0 0 1\n4 5 6 0 1 0\n")).unwrap();
    assert_eq!(guess.attribute("normal", 3).unwrap().values, [0.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
    let pts = read(&write("a.pts", "2\n1 2 3 -1000 255 0 51\n4 5 6 12 0 255 0\n")).unwrap();
    assert_eq!(pts.points.len(), 2);
    assert_eq!(pts.attribute("color", 3).unwrap().values[..3], [1.0, 0.0, 0.2]);
    let options = ScanOptions { columns: Some("_yxz".into()), ..ScanOptions::default() };
    let named = read_scan(write("b.txt", "9;2;1;3\n9;5;4;6\n"), &options).unwrap();
    assert_eq!(named.points[0], DVec3::new(1.0, 2.0, 3.0));
    let wrong = ScanOptions { columns: Some("ab".into()), ..ScanOptions::default() };
    assert!(matches!(read_scan(write("c.txt", "1 2 3\n"), &wrong), Err(ReadError::Header { .. })));
    assert!(matches!(read(&write("d.xyz", "1 2 3\n4 five 6\n")), Err(ReadError::Syntax { .. })));
    assert!(matches!(read(&write("e.xyz", "1 2 3\n4 5\n")), Err(ReadError::Syntax { .. })));
    assert!(matches!(read(&write("f.xyz", "# nothing\n")), Err(ReadError::NoPoints)));
    assert!(matches!(read(&write("g.xyz", "")), Err(ReadError::Empty)));
}

fn pcd(data: &str, body: &[u8]) -> Vec<u8> {
    let mut bytes = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA {data}\n"
    )
    .into_bytes();
    bytes.extend_from_slice(body);
    bytes
}

#[test]
fn the_origin_is_the_viewpoint_of_a_pcd_whose_points_lie_before_it() {
    let folder = folder();
    let path = folder.path().join("a.pcd");
    for (points, seen) in
        [("1 2 3 0\n4 5 6 0\n", true), ("-1 2 3 0\n4 -5 -6 0\n", false), ("1e6 0 0 0\n1e6 1 1 0\n", false)]
    {
        std::fs::write(&path, pcd("ascii", points.as_bytes())).unwrap();
        let cloud = read(&path).unwrap();
        assert_eq!(cloud.scanners.len(), usize::from(seen), "{points}");
        assert_eq!(cloud.seen_by.len(), 2 * usize::from(seen), "{points}");
    }
}

#[test]
fn a_pcd_whose_fields_hold_no_numbers_is_refused() {
    let folder = folder();
    let text = String::from_utf8(pcd("ascii", b"1\n2\n")).unwrap().replace("COUNT 1 1 1 1", "COUNT 1 0 0 0");
    let path = folder.path().join("a.pcd");
    std::fs::write(&path, text).unwrap();
    assert!(matches!(read(&path), Err(ReadError::Header { place: Place::Line(6), .. })));
}

#[test]
fn pcd_is_read_as_text_binary_and_compressed() {
    let folder = folder();
    let rgb = f32::from_bits(0x00ff_8000);
    let rows = [[1.0f32, 2.0, 3.0, rgb], [4.0, 5.0, 6.0, rgb]];
    let binary: Vec<u8> = rows.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let columns: Vec<u8> = (0..4).flat_map(|k| rows.map(|r| r[k].to_le_bytes())).flatten().collect();
    // LZF with plain runs only.
    let packed: Vec<u8> = columns.chunks(32).flat_map(|c| [&[c.len() as u8 - 1], c].concat()).collect();
    let mut compressed = [(packed.len() as u32).to_le_bytes(), (columns.len() as u32).to_le_bytes()].concat();
    compressed.extend(packed);
    let text = format!("1 2 3 {rgb:e}\n4 5 6 {rgb:e}\n").into_bytes();
    for (data, body) in [("ascii", text), ("binary", binary), ("binary_compressed", compressed)] {
        let path = folder.path().join(format!("{data}.pcd"));
        let bytes = pcd(data, &body);
        std::fs::write(&path, &bytes).unwrap();
        let cloud = read(&path).unwrap();
        assert_eq!(cloud.points, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)], "{data}");
        assert_eq!(cloud.attribute("color", 3).unwrap().values[..3], [1.0, 128.0 / 255.0, 0.0]);
        // Cut anywhere: an error, never a panic. What is left of a last number in text is still a number.
        let end = if data == "ascii" { bytes.iter().rposition(|&b| b == b' ').unwrap() } else { bytes.len() - 2 };
        for cut in 1..end {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            assert!(read(&path).is_err(), "{data} cut at {cut}");
        }
    }
}

fn npy(shape: &str, values: &[f64]) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
    bytes
}

#[test]
fn numpy_rows_are_points_and_volumes_are_not() {
    let folder = folder();
    let path = folder.path().join("a.npy");
    std::fs::write(&path, npy("(2, 3)", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])).unwrap();
    assert!(is_scan(&path));
    assert_eq!(read(&path).unwrap().points[1], DVec3::new(4.0, 5.0, 6.0));
    std::fs::write(&path, npy("(2, 2, 2)", &[0.0; 8])).unwrap();
    assert!(!is_scan(&path));
    std::fs::write(&path, npy("(20000000, 3)", &[0.0; 6])).unwrap();
    assert!(matches!(read(&path), Err(ReadError::Truncated { .. })));
}

#[test]
fn truncated_and_flipped_binary_scans_give_an_error_or_a_result_and_never_hang() {
    std::panic::set_hook(Box::new(|_| {}));
    let folder = folder();
    for extension in ["las", "e57"] {
        let path = folder.path().join(format!("a.{extension}"));
        write_scan(&path, &scan(300)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for part in [1, 10, 100, bytes.len() / 3, bytes.len() / 2, bytes.len() - 40] {
            std::fs::write(&path, &bytes[..part]).unwrap();
            assert!(read(&path).is_err(), "{extension} cut at {part}");
        }
        for k in 0..120 {
            let mut damaged = bytes.clone();
            let at = (k * 7919 + 5) % bytes.len();
            damaged[at] ^= 0xff;
            std::fs::write(&path, &damaged).unwrap();
            let result = read(&path);
            // Every page of E57 carries a checksum.
            assert!(extension != "e57" || result.is_err(), "{extension} flipped at {at}");
        }
    }
    let path = folder.path().join("b.las");
    std::fs::write(&path, b"this is no scan").unwrap();
    assert!(matches!(read(&path), Err(ReadError::WrongFormat { .. })));
}

#[test]
fn an_e57_grid_without_a_pose_was_seen_from_its_origin_and_a_heap_of_points_from_nowhere() {
    use e57::{E57Writer, Record, RecordDataType, RecordName, RecordValue};
    let folder = folder();
    for grid in [true, false] {
        let path = folder.path().join(format!("{grid}.e57"));
        let mut file = E57Writer::from_file(&path, "a file").unwrap();
        let mut prototype = vec![Record::CARTESIAN_X_F64, Record::CARTESIAN_Y_F64, Record::CARTESIAN_Z_F64];
        if grid {
            prototype
                .push(Record { name: RecordName::RowIndex, data_type: RecordDataType::Integer { min: 0, max: 100 } });
        }
        let mut scan = file.add_pointcloud("a scan", prototype).unwrap();
        for i in 0..30 {
            let mut point: Vec<RecordValue> =
                [f64::from(i), f64::from(i * i), 5.0].into_iter().map(RecordValue::Double).collect();
            if grid {
                point.push(RecordValue::Integer(i64::from(i)));
            }
            scan.add_point(point).unwrap();
        }
        scan.finalize().unwrap();
        file.finalize().unwrap();
        let cloud = read(&path).unwrap();
        assert_eq!(cloud.points.len(), 30);
        let seen: Vec<DVec3> = cloud.scanners.iter().map(|s| *s + cloud.shift).collect();
        assert_eq!(seen, if grid { vec![DVec3::ZERO] } else { vec![] });
    }
}

/// A view of four points, the last at z 2.
const VIEW: &str = "ply\nformat ascii 1.0\nobj_info num_cols 2\nelement vertex 4\nproperty float x\nproperty float y\n\
    property float z\nproperty float confidence\nelement range_grid 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0 .5\n1 0 0 .5\n0 1 0 .5\n0 0 2 .5\n1 0\n";

#[test]
fn views_with_poses_become_one_scan_with_a_scanner_each() {
    let folder = folder();
    std::fs::write(folder.path().join("a.ply"), VIEW).unwrap();
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut packed, VIEW.as_bytes()).unwrap();
    std::fs::write(folder.path().join("b.ply.gz"), packed.finish().unwrap()).unwrap();
    // The second view was taken a quarter turn about y: its z axis is x of the scan. The quaternion is the inverse.
    let half = 0.5f64.sqrt();
    let conf = format!(
        "camera 0 0 1\nmesh none 0 0 0 0 0 0 1\nbmesh a.ply 0 0 0 0 0 0 1\nbmesh b.ply 1 0 0 0 {} 0 {half}\n",
        -half
    );
    let path = folder.path().join("all.conf");
    std::fs::write(&path, conf).unwrap();
    assert!(is_scan(&path));
    let scan = read(&path).unwrap();
    assert_eq!(scan.seen_by, [0, 0, 0, 0, 1, 1, 1, 1]);
    assert!((scan.points[3] - DVec3::new(0.0, 0.0, 2.0)).length() < 1e-12);
    assert!((scan.points[7] - DVec3::new(3.0, 0.0, 0.0)).length() < 1e-12, "{}", scan.points[7]);
    assert!(scan.scanners[0].z > 10.0 && scan.scanners[1].x > 10.0, "{:?}", scan.scanners);
    assert_eq!(scan.attribute("confidence", 1).unwrap().values, [0.5; 8]);
}

#[test]
fn wrong_sets_of_views_are_told_with_the_line() {
    let folder = folder();
    std::fs::write(folder.path().join("a.ply"), VIEW).unwrap();
    std::fs::write(folder.path().join("cut.ply"), &VIEW[..VIEW.len() - 20]).unwrap();
    let path = folder.path().join("all.conf");
    for (conf, told) in [
        ("", "the file is empty"),
        ("camera 0 0 1\n", "no line names a view"),
        ("bmesh a.ply 0 0 0 0 0 0 1\nbmesh b.ply 0 0 0 0 0 0 1\n", "\"b.ply\" that it refers to cannot be read"),
        ("bmesh ../a.ply 0 0 0 0 0 0 1\n", "outside the folder of the file"),
        ("bmesh a.ply 0 0 0 0 0 0\n", "no name with a translation and a quaternion (line 1)"),
        ("\nbmesh a.ply 0 0 x 0 0 0 0 1\n", "no name with a translation and a quaternion (line 2)"),
        ("bmesh a.ply 0 0 0 0 0 0 0\n", "is no pose (line 1)"),
        ("bmesh a.ply 0 0 nan 0 0 0 1\n", "is no pose (line 1)"),
        ("bmesh cut.ply 0 0 0 0 0 0 1\n", "\"cut.ply\" that it refers to cannot be read"),
    ] {
        std::fs::write(&path, conf).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains(told), "{conf:?}: {error}");
    }
}

#[test]
fn decimal_commas_and_quoted_columns_are_read_as_they_are_meant() {
    let folder = folder();
    let points = [DVec3::new(1.5, -20.25, 3e-3), DVec3::new(1e3, 0.0, 7.0)];
    for (name, text) in [
        ("semicolon.csv", "X;Y;Z\n1,5;-20,25;0,003\n1000;0;7,0\n"),
        ("semicolon_point.csv", "X;Y;Z\n1.5;-20.25;3e-3\n1000;0;7.0\n"),
        ("tab.txt", "1,5\t-20,25\t0,003\n1000\t0\t7,0\n"),
        ("blank.xyz", "1,5 -20,25 3,0e-3\n1e3 0 7,0\n"),
        ("quoted.csv", "\"X\",\"Y\",\"Z\"\n\"1.5\",\"-20.25\",\"0.003\"\n\"1000\",\"0\",\"7.0\"\n"),
        ("both.csv", "\"x [m]\",\"y [m]\",\"z [m]\"\n\"1,5\",\"-20,25\",\"0,003\"\n\"1000\",\"0\",\"7,0\"\n"),
        ("excel.csv", "id;name;East;North;Height (m)\n1;a;1,5;-20,25;0,003\n2;b;1000;0;7\n"),
        ("comma.csv", "x,y,z\n1.5,-20.25,3e-3\n1000, 0, 7.0\n"),
        ("mixed.asc", "1.5 -20.25,0.003\n1000 0,7.0\n"),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let columns = (name == "excel.csv").then(|| "_,_,x,y,z".to_owned());
        let found = read_scan(&path, &ScanOptions { columns, ..ScanOptions::default() });
        if name == "excel.csv" {
            // A name is no number: told, not skipped.
            assert!(found.unwrap_err().to_string().contains("\"a\" is not a number (line 2)"));
            continue;
        }
        assert_eq!(found.unwrap_or_else(|e| panic!("{name}: {e}")).points, points, "{name}");
    }
}

#[test]
fn columns_that_nobody_knows_are_refused_with_their_names_and_empty_ones_are_told() {
    let folder = folder();
    for (name, text, words) in [
        (
            "geo.csv",
            "id,longitude,latitude,height\n1,7.1,46.2,530\n2,7.2,46.3,531\n",
            "id, longitude, latitude, height",
        ),
        ("words.txt", "a b c\n1 2 3\n", "a, b, c"),
        ("empty.csv", "x;y;z\n1;;3\n", "\"\" is not a number (line 2)"),
        ("thousands.csv", "x;y;z\n1.234,5;2;3\n", "\"1.234,5\" is not a number (line 2)"),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let told = read(&path).unwrap_err().to_string();
        assert!(told.contains(words) && told.contains(" - hint: "), "{name}: {told}");
    }
    // A title is no header: it has more words than there are columns. What is meant can be said.
    for (name, text, columns) in [
        ("title.xyz", "made by hand on a rainy day\n1 2 3\n4 5 6\n", None),
        ("geo.csv", "id,e,n,h\n1,7.1,46.2,530\n2,7.2,46.3,531\n", Some("_,x,y,z".to_owned())),
        ("survey.csv", "id,east,north,height\n1,7.1,46.2,530\n2,7.2,46.3,531\n", None),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let cloud = read_scan(&path, &ScanOptions { columns, ..ScanOptions::default() }).unwrap();
        assert_eq!(cloud.points.len(), 2, "{name}");
        if name != "title.xyz" {
            let first = cloud.points[0] + cloud.shift;
            assert!((first - DVec3::new(7.1, 46.2, 530.0)).length() < 1e-9, "{name}: {first}");
        }
    }
}

#[test]
fn compressed_points_whose_table_names_four_billion_chunks_are_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    let points = (0..40).map(|k| DVec3::new(k as f64, (k % 3) as f64, (k % 7) as f64)).collect();
    write_scan(&path, &Cloud::new(points)).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let data = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
    let table = i64::from_le_bytes(bytes[data..data + 8].try_into().unwrap()) as usize;
    bytes[table + 4..table + 8].copy_from_slice(&u32::MAX.to_le_bytes());
    std::fs::write(&path, bytes).unwrap();
    let error = read_scan(&path, &ScanOptions::default()).unwrap_err();
    assert!(matches!(error, ReadError::Truncated { .. }), "{error}");
}

#[test]
fn a_numpy_array_whose_type_begins_with_a_byte_of_no_text_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    let mut bytes = b"\x93NUMPY\x01\x00\x3b\x00{'descr': '\xb3f8', 'fortran_order': False, 'shape': (2, 3), }".to_vec();
    bytes.extend([0u8; 48]);
    std::fs::write(&path, bytes).unwrap();
    let error = read_scan(&path, &ScanOptions::default()).unwrap_err();
    assert!(error.to_string().contains("are not read"), "{error}");
}
