//! `planish relief`: the whole way of a map through files, and what garbage is told.

mod common;

use common::*;
use std::fs;
use std::path::Path;

/// A model of a small box with a dent, made once per test.
fn model(folder: &Path) {
    write_box(&folder.join("box.ply"), 8);
    let output = planish(&["fit", "box.ply", "-q", "-o", "box.planish", "--control", "5x5"], folder);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
}

fn script(folder: &Path, text: &str) {
    fs::write(folder.join("edits.toml"), text).unwrap();
}

#[test]
fn strokes_become_layers_that_are_undone_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    model(at);
    script(
        at,
        "[[step]]\nedit = \"stroke\"\npath = [{ patch = 0, u = 0.5, v = 0.5 }, { patch = 1, u = 0.5, v = 0.5 }]\nradius = 0.2\n\
         height = 0.05\n\n[[step]]\nedit = \"scale\"\nlayer = \"stroke\"\nfactor = -0.5\n",
    );
    let told = ok(&["relief", "edit", "box.planish", "edits.toml", "-o", "a.planish"], at);
    assert!(told.contains("baked, stroke x -0.5") && told.contains("2 to take back"), "{told}");
    assert!(ok(&["info", "a.planish"], at).contains("stroke, scale"));
    script(at, "[[step]]\nedit = \"undo\"\ncount = 2\n");
    let told = ok(&["relief", "edit", "a.planish", "edits.toml", "-o", "b.planish"], at);
    assert!(told.contains("0 to take back, 2 to make again"), "{told}");
    ok(&["export", "box.planish", "-q", "-o", "before.ply"], at);
    ok(&["export", "b.planish", "-q", "-o", "after.ply"], at);
    assert_eq!(fs::read(at.join("before.ply")).unwrap(), fs::read(at.join("after.ply")).unwrap());
    ok(&["export", "a.planish", "-q", "-o", "edited.ply"], at);
    assert_ne!(fs::read(at.join("before.ply")).unwrap(), fs::read(at.join("edited.ply")).unwrap());
    // Maps of an edited model read back, too.
    ok(&["export", "a.planish", "-q", "-o", "maps"], at);
    for (text, words) in [
        ("[[step]]\nedit = \"undo\"\ncount = 9\n", "step 1 (line 1): there is nothing left to take back"),
        ("[[step]]\nedit = \"erase\"\n[[step]]\nedit = \"hair\"\n", "step 2: unknown variant `hair`"),
        (
            "[[step]]\nedit = \"stroke\"\npath = []\nradius = 1\nheight = 1\n",
            "step 1 (stroke, line 1): a stroke needs places",
        ),
        (
            "[[step]]\nedit = \"stamp\"\nimage = \"no.png\"\nat = [0, 0, 0]\nup = [0, 1, 0]\nwidth = 1\nheight = 1\n",
            "no.png",
        ),
        (
            "[[step]]\nedit = \"erase\"\nregion = { image = \"no.png\", at = [0, 0, 0], up = [0, 1, 0], width = 1 }\n",
            "no.png",
        ),
        ("[[step]]\nedit = \"erase\"\nregion = { image = \"no.png\" }\n", "needs at, up and width"),
    ] {
        script(at, text);
        let output = planish(&["relief", "edit", "a.planish", "edits.toml", "-o", "c.planish"], at);
        assert_eq!(status(&output), 3);
        assert!(error_line(&output).contains(words), "{}", stderr(&output));
        assert!(!at.join("c.planish").exists());
    }
}

#[test]
fn maps_go_out_and_come_back_as_a_layer_and_wrong_ones_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    model(at);
    for (maps, options) in [
        ("plain", &[][..]),
        ("png", &["--kind", "scalar", "--file", "png", "--sheets", "atlas"]),
        (
            "udim",
            &["--frame", "tangent", "--order", "tnb", "--sheets", "udim", "--tile", "64", "--texels", "20", "--base"],
        ),
        ("arnold", &["--preset", "arnold", "--tile", "128"]),
        ("wired", &["--materialx", "--attributes", "--max-error", "0.01%"]),
        ("unreal", &["--preset", "unreal", "--max-error", "0.01%"]),
        ("usd", &["--preset", "usd", "--tile", "64"]),
        ("stage", &["--frame", "tangent", "--usd"]),
        ("blender", &["--preset", "blender", "--tile", "128", "--usd", "--materialx"]),
    ] {
        ok(&[&["relief", "export", "box.planish", "-o", maps], options].concat(), at);
        let told = ok(&["relief", "import", "box.planish", maps, "-o", "same.planish"], at);
        assert!(told.contains("nothing was changed"), "{maps}: {told}");
    }
    assert!(at.join("udim/relief.1001.exr").exists() && at.join("udim/base.obj").exists());
    assert!(fs::read_to_string(at.join("wired/relief.mtlx")).unwrap().contains("patch_0000.exr"));
    let usd = |maps: &str| fs::read_to_string(at.join(maps).join("relief.usda")).unwrap();
    assert!(usd("usd").contains("@./relief.<UDIM>.exr@") && usd("usd").contains("UsdPreviewSurface"));
    assert!(usd("stage").contains("ND_displacement_vector3") && usd("stage").contains("@./patch_0005.exr@"));
    assert!(fs::read_to_string(at.join("arnold/relief.json")).unwrap().contains("order XZY"));
    assert!(usd("blender").contains("ND_combine3_vector3"));
    assert!(fs::read_to_string(at.join("blender/relief.mtlx")).unwrap().contains("<combine3"));
    // A stroke goes through the files of a second export into the first model.
    script(at, "[[step]]\nedit = \"stroke\"\npath = [{ patch = 0, u = 0.5, v = 0.5 }]\nradius = 0.3\nheight = 0.05\n");
    ok(&["relief", "edit", "box.planish", "edits.toml", "-q", "-o", "a.planish"], at);
    ok(&["relief", "export", "a.planish", "-q", "-o", "plain"], at);
    let told = ok(&["relief", "import", "box.planish", "plain", "-o", "b.planish"], at);
    assert!(told.contains("changed texels") && told.contains("baked, import"), "{told}");
    let compared = ok(&["compare", "a.planish", "b.planish", "--surface", "displaced", "--tolerance", "0.0001%"], at);
    assert!(!compared.is_empty());
    // Rounded maps of a relief that is some hundred steps high.
    for options in [&["--file", "png", "--sheets", "atlas", "--gutter", "0"][..], &["--file", "exr_half"], &[]] {
        let told =
            ok(&[&["relief", "export", "a.planish", "-o", "small", "--max-error", "0.01%"], options].concat(), at);
        assert!(told.contains("a triangle of the mesh") && told.contains("part by"), "{told}");
        let told = ok(&["relief", "import", "a.planish", "small", "-o", "same.planish"], at);
        assert!(told.contains("nothing was changed"), "{options:?}: {told}");
    }
    // Wrong model, half a file, nothing.
    write_box(&at.join("other.ply"), 6);
    ok(&["fit", "other.ply", "-q", "-o", "other.planish", "--control", "6x6"], at);
    let wrong = |maps: &str, model: &str, words: &str| {
        let output = planish(&["relief", "import", model, maps, "-o", "c.planish"], at);
        assert_eq!(status(&output), 3, "{}", stderr(&output));
        assert!(error_line(&output).contains(words), "{}", stderr(&output));
    };
    wrong("plain", "other.planish", "has maps of other surfaces than this model's");
    wrong("none", "box.planish", "relief.json");
    wrong("plain", "plain/relief.json", "not a planish project");
    ok(&["relief", "export", "box.planish", "-q", "-o", "normals", "--kind", "normal", "--preset", "gltf"], at);
    wrong("normals", "box.planish", "holds no displacements");
    ok(&["export", "box.planish", "-q", "-o", "first"], at);
    wrong("first", "box.planish", "version 1 of relief.json");
    let whole = fs::read(at.join("plain/patch_0000.exr")).unwrap();
    fs::write(at.join("plain/patch_0000.exr"), &whole[..whole.len() / 2]).unwrap();
    wrong("plain", "box.planish", "patch_0000.exr");
    for (args, words) in [
        (&["--tile", "16", "--sheets", "udim", "--texels", "40"][..], "do not fit on a tile of 16"),
        (&["--texels", "1"], "two texels"),
        (&["--kind", "normal", "--max-error", "1mm"], "does not go with normals"),
        (&["--file", "png", "--max-error", "1e-12"], "--max-error: 16-bit whole numbers cannot keep an error of 1e-12"),
        (&["--frame", "object", "--materialx"], "cannot wire vectors in object space"),
        (&["--kind", "length", "--usd"], "cannot wire lengths"),
        (&["--preset", "renderman", "--usd", "--tile", "64"], "add --frame tangent"),
    ] {
        let output = planish(&[&["relief", "export", "a.planish", "-o", "bad"], args].concat(), at);
        assert_eq!(status(&output), 2);
        assert!(error_line(&output).contains(words), "{}", stderr(&output));
        assert!(!at.join("bad").exists());
    }
}

#[test]
fn a_model_is_parted_leveled_and_gets_detail_from_another() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    model(at);
    script(at, "[[step]]\nedit = \"stroke\"\npath = [{ patch = 0, u = 0.5, v = 0.5 }]\nradius = 0.3\nheight = 0.05\n");
    ok(&["relief", "edit", "box.planish", "edits.toml", "-q", "-o", "a.planish"], at);
    // The same shape on another level of control points.
    ok(&["relief", "level", "a.planish", "-q", "-o", "fine.planish", "--control", "9x9"], at);
    let far = ["compare", "a.planish", "fine.planish", "--surface", "displaced", "--tolerance", "0.01%"];
    ok(&far, at);
    ok(&["relief", "part", "fine.planish", "-q", "-o", "parted.planish", "--wavelength", "20%"], at);
    ok(&["relief", "transfer", "box.planish", "a.planish", "-q", "-o", "t.planish"], at);
    ok(&["compare", "a.planish", "t.planish", "--surface", "displaced", "--tolerance", "0.01%"], at);
    ok(&["relief", "transfer", "a.planish", "-q", "-o", "p.planish", "--pairs", "0:1,0:2@1"], at);
    for (args, words) in [
        (&["relief", "transfer", "box.planish", "-o", "x.planish"][..], "needs FROM.planish"),
        (&["relief", "transfer", "box.planish", "-o", "x.planish", "--pairs", "0:99"], "no patch 99 among"),
        (&["relief", "transfer", "box.planish", "-o", "x.planish", "--pairs", "0-1"], "two patches are needed"),
    ] {
        let output = planish(args, at);
        assert_eq!(status(&output), 2);
        assert!(error_line(&output).contains(words), "{}", stderr(&output));
    }
}

#[test]
fn detail_goes_along_with_pairs_of_places_and_broken_lists_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    model(at);
    script(at, "[[step]]\nedit = \"stroke\"\npath = [{ patch = 0, u = 0.5, v = 0.5 }]\nradius = 0.3\nheight = 0.05\n");
    ok(&["relief", "edit", "box.planish", "edits.toml", "-q", "-o", "a.planish"], at);
    let pair = |p: u32| {
        let place = format!("{{ patch = {p}, u = 0.4, v = 0.6 }}");
        format!("[[pair]]\nfrom = {place}\nto = {place}\n")
    };
    fs::write(at.join("pairs.toml"), (0..6).map(pair).collect::<String>()).unwrap();
    let transfer = ["relief", "transfer", "box.planish", "a.planish", "--points"];
    let told = ok(&[&transfer[..], &["pairs.toml", "-o", "t.planish"]].concat(), at);
    assert!(told.contains("6 pairs; an affine map leaves"), "{told}");
    ok(&["compare", "a.planish", "t.planish", "--surface", "displaced", "--tolerance", "0.01%"], at);
    for (name, text, words) in [
        ("bad.toml", pair(0) + &pair(1), "2 pairs are given - hint: 3 to 2000 are needed"),
        ("bad.toml", (0..4).map(|_| pair(0)).collect(), "pairs 1 and 2 have the same place `from`"),
        ("bad.toml", pair(0) + &pair(1) + &pair(77), "pair 3, `from`: there is no patch 77 among"),
        ("bad.toml", "[[pair]]\nfrom = [0, 0]\n".into(), "(line "),
        ("bad.csv", "x,y,z,x,y,z\n0,0,0,0,0\n".into(), "six numbers are needed in line 2"),
        ("bad.csv", "0,0,0,0,0,0\nnan,0,0,1,0,0\n0,1,0,0,1,0\n".into(), "a number is not finite"),
        ("bad.csv", "900,0,0,0,0,0\n0,1,0,1,0,0\n0,1,0,0,1,0\n".into(), "away from the surface"),
        ("bad.csv", String::new(), "0 pairs are given"),
    ] {
        fs::write(at.join(name), text).unwrap();
        let output = planish(&[&transfer[..], &[name, "-o", "x.planish"]].concat(), at);
        assert_eq!(status(&output), 3, "{}", stderr(&output));
        assert!(error_line(&output).contains(words), "{}", stderr(&output));
        assert!(!at.join("x.planish").exists());
    }
    let output = planish(&["relief", "transfer", "a.planish", "--points", "pairs.toml", "-o", "x.planish"], at);
    assert_eq!(status(&output), 2);
    assert!(error_line(&output).contains("needs FROM.planish"), "{}", stderr(&output));
}

#[test]
fn detail_is_synthesised_the_same_again_with_the_seed_and_taken_back() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    model(at);
    script(
        at,
        "[[step]]\nedit = \"resample\"\ntexels = 33\n\n[[step]]\nedit = \"erase\"\n\n[[step]]\nedit = \"stroke\"\n\
         path = [{ patch = 0, u = 0.1, v = 0.3 }, { patch = 0, u = 0.9, v = 0.4 }]\nradius = 0.2\nheight = 0.05\n\
         region = { patches = [0] }\n",
    );
    ok(&["relief", "edit", "box.planish", "edits.toml", "-q", "-o", "a.planish"], at);
    let made = |name: &str, keys: &str| {
        script(at, &format!("[[step]]\nedit = \"synthesise\"\nfrom = 0\nto = [1, 2, 3, 4, 5]\n{keys}"));
        let model = format!("{name}.planish");
        let told = ok(&["relief", "edit", "a.planish", "edits.toml", "-o", &model], at);
        assert!(told.contains("stroke, synthesise"), "{told}");
        let maps = at.join(format!("{name}.maps"));
        ok(&["relief", "export", &model, "-q", "-o", maps.to_str().unwrap(), "--kind", "scalar"], at);
        (0..6).map(|p| fs::read(maps.join(format!("patch_{p:04}.exr"))).unwrap()).collect::<Vec<_>>()
    };
    let first = made("b", "seed = 1\n");
    assert!(first == made("c", "seed = 1\n"), "the same seed");
    assert!(first != made("d", "seed = 2\n"), "another seed");
    let region = made("e", "seed = 1\nregion = { patches = [1, 2] }\n");
    let plain = {
        ok(&["relief", "export", "a.planish", "-q", "-o", "a.maps", "--kind", "scalar"], at);
        (0..6).map(|p| fs::read(at.join(format!("a.maps/patch_{p:04}.exr"))).unwrap()).collect::<Vec<_>>()
    };
    assert!((1..6).all(|p| first[p] != plain[p]), "every patch that is named gets some");
    assert!(region[1] != plain[1] && region[2] != plain[2], "the region's patches get some");
    // The pattern is .05 high, and no more than that is made of it.
    let told = ok(&["compare", "a.planish", "b.planish", "--surface", "displaced", "--tolerance", "0.06"], at);
    assert!(!told.is_empty());
    script(at, "[[step]]\nedit = \"undo\"\n");
    ok(&["relief", "edit", "b.planish", "edits.toml", "-q", "-o", "back.planish"], at);
    ok(&["export", "a.planish", "-q", "-o", "before.ply"], at);
    ok(&["export", "back.planish", "-q", "-o", "after.ply"], at);
    assert_eq!(fs::read(at.join("before.ply")).unwrap(), fs::read(at.join("after.ply")).unwrap());
    for (keys, words) in [
        ("from = 77\nto = [1]\n", "there is no patch 77 among 6"),
        ("from = 0\nto = []\n", "patches to fill are needed"),
        ("from = 0\nto = [1]\nblock = 1e9\n", "blocks have sides from"),
        ("from = 0\nto = [1]\nblok = 1\n", "unknown field `blok`"),
    ] {
        script(at, &format!("[[step]]\nedit = \"synthesise\"\n{keys}"));
        let output = planish(&["relief", "edit", "a.planish", "edits.toml", "-o", "x.planish"], at);
        assert_eq!(status(&output), 3, "{}", stderr(&output));
        assert!(error_line(&output).contains(words), "{}", stderr(&output));
        assert!(!at.join("x.planish").exists());
    }
}

#[test]
fn moved_control_points_carry_the_relief_along() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    model(at);
    script(at, "[[step]]\nedit = \"stroke\"\npath = [{ patch = 0, u = 0.5, v = 0.5 }]\nradius = 0.3\nheight = 0.05\n");
    ok(&["relief", "edit", "box.planish", "edits.toml", "-q", "-o", "a.planish"], at);
    // Surfaces that go out and in again move nothing.
    ok(&["export", "a.planish", "--surface", "spline", "-q", "-o", "s.obj"], at);
    let told = ok(&["deform", "a.planish", "s.obj", "-o", "same.planish"], at);
    assert!(told.contains("apart by 0 mm") && told.contains("baked, stroke"), "{told}");
    ok(&["compare", "a.planish", "same.planish", "--surface", "displaced", "--tolerance", "0.0001%"], at);
    assert!(ok(&["info", "same.planish"], at).contains("deform"));
    ok(&["export", "a.planish", "-q", "-o", "s.step"], at);
    let told = ok(&["deform", "a.planish", "s.step", "-o", "same.planish", "--force"], at);
    assert!(told.contains("apart by 0 mm"), "{told}");
    ok(&["compare", "a.planish", "same.planish", "--surface", "displaced", "--tolerance", "0.0001%"], at);
    // A corner of the box is pulled out: all patches there stay together.
    fs::write(at.join("moves.toml"), "[[move]]\npatch = 0\ni = 0\nj = 0\nby = [0.1, 0.2, 0.3]\n").unwrap();
    ok(&["deform", "a.planish", "moves.toml", "-q", "-o", "pulled.planish"], at);
    ok(&["export", "pulled.planish", "-q", "-o", "pulled.ply"], at);
    let told = ok(&["info", "pulled.ply"], at);
    assert!(told.contains("closed") || told.contains("watertight"), "{told}");
    let output =
        planish(&["compare", "a.planish", "pulled.planish", "--surface", "displaced", "--tolerance", "1%"], at);
    assert_eq!(status(&output), 1, "it moved");
    ok(&["deform", "a.planish", "pulled.planish", "-q", "-o", "again.planish"], at);
    ok(&["compare", "pulled.planish", "again.planish", "--surface", "displaced", "--tolerance", "0.0001%"], at);
    // What was deformed is a model like any other.
    ok(&["relief", "export", "pulled.planish", "-q", "-o", "maps", "--kind", "height"], at);
    ok(&["fit", "pulled.planish", "-q", "-o", "refit.planish", "--control", "6x6"], at);
    for (name, text, words) in [
        ("bad.toml", "[[move]]\npatch = 0\ni = 99\nj = 0\nby = [0, 0, 0]\n", "no control point 99, 0"),
        ("bad.toml", "[[move]]\npatch = 0\n", "missing field"),
        ("bad.obj", "v 0 0 0\nf 1 1 1\n", "without B-spline surfaces"),
        ("bad.obj", "v 0 0 0\ncstype bspline\ndeg 3 3\nsurf 0 1 0 1 1 2\nend\n", "vertex 2 is not there (line 4)"),
        ("bad.obj", "cstype bezier\n", "only surfaces of the kind bspline"),
        ("bad.step", "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n", "no triangle with area"),
    ] {
        fs::write(at.join(name), text).unwrap();
        let output = planish(&["deform", "a.planish", name, "-o", "x.planish"], at);
        assert_eq!(status(&output), 3, "{}", stderr(&output));
        assert!(error_line(&output).contains(words), "{}", stderr(&output));
    }
}

/// What a command that succeeds tells beside its table.
fn warned(args: &[&str], folder: &Path) -> String {
    let output = planish(args, folder);
    assert_eq!(status(&output), 0, "{args:?}: {}", stderr(&output));
    stderr(&output)
}

#[test]
fn regress_maps_of_an_older_relief_are_told_and_info_reads_folders_of_maps() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    model(at);
    ok(&["relief", "export", "box.planish", "-q", "-o", "maps", "--file", "png", "--sheets", "atlas"], at);
    let told = ok(&["info", "maps"], at);
    assert!(told.contains("maps of a relief") && told.contains("surface, tbn") && told.contains("png"), "{told}");
    assert_eq!(ok(&["info", "maps/relief.json"], at), told);
    ok(&["export", "box.planish", "-q", "-o", "plain"], at);
    assert!(ok(&["info", "plain"], at).contains("displacement maps"));
    script(at, "[[step]]\nedit = \"stroke\"\npath = [{ patch = 0, u = 0.5, v = 0.5 }]\nradius = 0.3\nheight = 0.05\n");
    ok(&["relief", "edit", "box.planish", "edits.toml", "-q", "-o", "a.planish"], at);
    let told = warned(&["relief", "import", "a.planish", "maps", "-o", "b.planish"], at);
    assert!(told.contains("edited after these maps were exported"), "{told}");
    let told = warned(&["relief", "import", "box.planish", "maps", "-o", "b.planish"], at);
    assert!(!told.contains("edited after"), "{told}");
    // A vector of an image that was blown up.
    ok(&["relief", "export", "a.planish", "-q", "-o", "far", "--file", "png", "--sheets", "atlas"], at);
    let sidecar = fs::read_to_string(at.join("far/relief.json")).unwrap();
    let scale = sidecar.lines().find(|l| l.trim_start().starts_with("\"scale\":")).unwrap();
    fs::write(at.join("far/relief.json"), sidecar.replace(scale, "  \"scale\": 1e30,")).unwrap();
    let output = planish(&["relief", "import", "a.planish", "far", "-o", "c.planish"], at);
    assert_eq!(status(&output), 3);
    assert!(error_line(&output).contains("would be displaced by"), "{}", stderr(&output));
}

#[test]
fn regress_heights_of_an_edited_relief_have_the_edits() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    model(at);
    script(at, "[[step]]\nedit = \"stroke\"\npath = [{ patch = 0, u = 0.5, v = 0.5 }]\nradius = 0.3\nheight = 0.1\n");
    ok(&["relief", "edit", "box.planish", "edits.toml", "-q", "-o", "a.planish"], at);
    let largest = |model: &str, kind: &str| {
        ok(&["relief", "export", model, "-q", "--force", "-o", "maps", "--kind", kind], at);
        let sidecar: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(at.join("maps/relief.json")).unwrap()).unwrap();
        sidecar["largest"].as_f64().unwrap()
    };
    let (height, scalar) = (largest("a.planish", "height"), largest("a.planish", "scalar"));
    assert!(height > 0.08 && (height - scalar).abs() < 0.01, "{height} {scalar}");
    assert!(largest("box.planish", "height") < 0.05);
    let told = ok(&["relief", "import", "a.planish", "maps", "--force", "-o", "same.planish"], at);
    assert!(told.contains("changed texels"), "maps of the model before the stroke: {told}");
    largest("a.planish", "height");
    assert!(
        ok(&["relief", "import", "a.planish", "maps", "--force", "-o", "same.planish"], at).contains("nothing was")
    );
}

#[test]
fn regress_edits_that_do_nothing_or_too_much_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    model(at);
    for (text, words) in [
        ("", "The script has no steps"),
        (
            "[[step]]\nedit = \"stroke\"\npath = [{ patch = 0, u = 0.51, v = 0.51 }]\nradius = 1e-5\nheight = 0.1\n",
            "The stroke of step 1 moves no texel",
        ),
    ] {
        script(at, text);
        let told = warned(&["relief", "edit", "box.planish", "edits.toml", "--force", "-o", "a.planish"], at);
        assert!(told.contains(words), "{told}");
    }
    // A side of the box bulges out or in; one way or the other the stroke goes to its hollow.
    fs::write(at.join("moves.toml"), "[[move]]\npatch = 0\ni = 2\nj = 2\nby = [0.3, 0.3, 0.3]\n").unwrap();
    ok(&["deform", "box.planish", "moves.toml", "-q", "-o", "bulged.planish"], at);
    let beyond = |height: f64| {
        let stroke = "[[step]]\nedit = \"stroke\"\npath = [{ patch = 0, u = 0.5, v = 0.5 }]\nradius = 0.5\nheight = ";
        script(at, &format!("{stroke}{height}\n"));
        let edit = ["relief", "edit", "bulged.planish", "edits.toml", "--force", "-o", "a.planish"];
        let told = warned(&[&edit[..], &["--picture", "a.png"]].concat(), at);
        assert_eq!(told.contains("focal"), warned(&["info", "a.planish"], at).contains("focal"), "{told}");
        told.contains("beyond its focal radius")
    };
    assert!(beyond(0.7) || beyond(-0.7));
    for (text, words) in [
        ("edit = \"erase\"\nregion = { radius = 5 }\n", "step 1 (erase, line 1): radius and feather of a region"),
        ("edit = \"sharpen\"\nradius = 0.1\namount = 1e300\n", "would be displaced by"),
        ("edit = \"stroke\"\npath = [[99, 99, 9]]\nradius = 1\nheight = 1\n", "further than the model is long"),
    ] {
        script(at, &format!("[[step]]\n{text}"));
        let output = planish(&["relief", "edit", "box.planish", "edits.toml", "-o", "x.planish"], at);
        assert_eq!(status(&output), 3, "{}", stderr(&output));
        assert!(error_line(&output).contains(words), "{}", stderr(&output));
    }
    let output = planish(&["relief", "part", "box.planish", "-o", "x.planish", "--wavelength", "1e-9"], at);
    assert_eq!(status(&output), 2, "{}", stderr(&output));
    assert!(error_line(&output).contains("--wavelength: waves of 1e-9 are too short"), "{}", stderr(&output));
    // What other options change the program of the preset is not told to do.
    for (more, is_told) in [(&[][..], true), (&["--frame", "object"], false), (&["--kind", "scalar"], false)] {
        let args = [&["relief", "export", "box.planish", "-q", "--force", "-o", "wired", "--preset", "blender"], more]
            .concat();
        ok(&args, at);
        let sidecar = fs::read_to_string(at.join("wired/relief.json")).unwrap();
        assert_eq!(sidecar.contains("Vector Displacement"), is_told, "{more:?}");
    }
    // STEP has the splines whatever is said.
    ok(&["export", "box.planish", "-q", "--surface", "spline", "-o", "x.step"], at);
    let told = warned(&["relief", "transfer", "box.planish", "box.planish", "--reach", "1e-12", "-o", "t.planish"], at);
    assert!(!told.contains("No texel"), "{told}");
    write_box(&at.join("far.ply"), 6);
    ok(&["transform", "far.ply", "-q", "-o", "moved.ply", "--move", "50,0,0"], at);
    ok(&["fit", "moved.ply", "-q", "-o", "far.planish", "--control", "5x5"], at);
    let told = warned(&["relief", "transfer", "box.planish", "far.planish", "--force", "-o", "t.planish"], at);
    assert!(told.contains("No texel got anything"), "{told}");
}
