//! `planish info` of every kind of file that the program reads and writes.

mod common;

use common::*;
use std::fs;

#[test]
fn info_knows_every_kind_of_file_that_the_program_reads_and_writes() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_box(&at("box.ply"), 4);
    let ball = |k: usize| {
        let (z, a) = (1.0 - 2.0 * (k as f64 + 0.5) / 2000.0, 2.4 * k as f64);
        let r = (1.0f64 - z * z).sqrt();
        format!("{} {} {z}\n", r * a.cos(), r * a.sin())
    };
    fs::write(at("a.xyz"), (0..2000).map(ball).collect::<String>()).unwrap();
    fs::write(at("part.toml"), "units = \"cm\"\n[solid.a]\nbox = { size = [2, 2, 2] }\n[solid.b]\nsphere = { radius = 1 }\n[solid.c]\nunion = [\"a\", \"b\"]\n").unwrap();
    fs::write(at("job.toml"), "[stock]\nfrom = [0,0,0]\nto = [10,20,30]\n[[tool]]\nname = \"a\"\nkind = \"ball\"\nradius = 2\n[[path]]\ntool = \"a\"\npoints = [[0,0,9],[9,9,9],[9,0,9]]\n").unwrap();
    fs::write(at("edits.toml"), "[[step]]\nedit = \"feature_lines\"\nangle_deg = 40.0\n").unwrap();
    let volume: Vec<u8> = (0..24).flat_map(|k| (k as f32).to_le_bytes()).collect();
    let head = "NRRD0004\ntype: float\ndimension: 3\nsizes: 2 3 4\nendian: little\nencoding: raw\nspacings: 1 1 2\n\n";
    fs::write(at("v.nrrd"), [head.as_bytes(), &volume].concat()).unwrap();
    for args in [
        "layout box.ply -q -o n.json --patches 6 --report r.json",
        "fit box.ply -q --network n.json -o m.planish",
        "export m.planish -q -o m.step",
        "export m.planish -q -o maps",
        "export m.planish -q -o m.glb",
        "export m.planish -q -o m.obj",
        "export m.planish -q -o m.stl",
        "clean a.xyz -q -o c.las",
        "clean a.xyz -q -o c.laz",
        "clean a.xyz -q -o c.e57",
    ] {
        let output = planish(&args.split(' ').collect::<Vec<_>>(), folder.path());
        assert_eq!(status(&output), 0, "{args}: {}", stderr(&output));
    }
    for (name, words) in [
        ("box.ply", &["from 0 0 0 mm", "to 1 1 1 mm", "crossings 0", "attributes none", "mm, assumed"][..]),
        ("m.obj", &["triangles", "watertight"]),
        ("m.stl", &["triangles", "watertight"]),
        ("m.glb", &["m, as the format has it", "normal"]),
        ("a.xyz", &["points 2 000", "mm, assumed"]),
        ("c.las", &["m, assumed"]),
        ("c.laz", &["m, assumed"]),
        ("c.e57", &["m, as the format has it"]),
        ("m.planish", &["patches", "folds 0 cells of grids, 0 places of surfaces", "history"]),
        ("part.toml", &["solid script", "solids 3", "-1 -1 -1 cm"]),
        ("job.toml", &["milling job", "moves 2", "10 20 30 mm"]),
        ("edits.toml", &["script of edits", "feature_lines"]),
        ("v.nrrd", &["2 x 3 x 4", "0 to 23", "1 2 6 mm"]),
        ("n.json", &["network", "curves 12", "patches 6", "12 on sharp edges"]),
        ("r.json", &["report", "`planish layout`", "box.ply"]),
        ("m.step", &["solids 1", "faces 6", "B-spline surfaces 6", "0 0 0 mm", "1 1 1 mm"]),
        ("maps", &["displacement maps", "maps 6"]),
        ("maps/relief.json", &["displacement maps", "maps 6"]),
        ("maps/patch_0000.exr", &["EXR image", "B, G, R"]),
    ] {
        let output = planish(&["info", name], folder.path());
        assert_eq!(status(&output), 0, "{name}: {}", stderr(&output));
        // However wide the columns are.
        let table = stdout(&output).split_whitespace().collect::<Vec<_>>().join(" ");
        for words in words {
            assert!(table.contains(words), "{name}: no \"{words}\" in\n{table}");
        }
    }
    fs::write(at("other.json"), "{}").unwrap();
    fs::write(at("part.docx"), "PK").unwrap();
    for (args, words) in [
        (&["info", "other.json"][..], "is a JSON file of another program"),
        (&["info", "part.docx"], "is of no kind that planish knows - hint: meshes are .ply"),
        (
            &["layout", "c.e57", "-o", "x.json"],
            "is a scan, not a mesh - hint: make a mesh of it with `planish mesh` first",
        ),
    ] {
        let output = planish(args, folder.path());
        assert_eq!(status(&output), 3, "{args:?}: {}", stderr(&output));
        assert!(error_line(&output).contains(words), "{}", stderr(&output));
    }
}

#[test]
fn triangles_that_cross_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let text = "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0.5 0.5 -1\nv 0.5 0.5 1\nv 1.5 1.5 1\nf 1 2 3\nf 4 5 6\n";
    fs::write(folder.path().join("cross.obj"), text).unwrap();
    let output = planish(&["info", "cross.obj"], folder.path());
    assert!(stderr(&output).contains("pairs of triangles cross each other"), "{}", stderr(&output));
}
