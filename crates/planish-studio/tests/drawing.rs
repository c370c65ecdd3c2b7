//! What a page can do besides edits: points looked at and left out, holes closed, sizes tried, handles, maps, ways of the history,
//! networks of other projects.

mod common;

use common::*;
use planish::DVec3;
use planish::relief::layers::{Layers, ReliefEdit};
use planish::synthetic::shapes;
use planish_io::WriteOptions;
use serde_json::{Value, json};

/// A ball of radius 1 as points, with 20 far ones beside it.
fn points(folder: &std::path::Path) -> std::path::PathBuf {
    let count = 6000;
    let on = |k: usize| {
        let (z, a) = (1.0 - 2.0 * (k as f64 + 0.5) / count as f64, 2.4 * k as f64);
        let r = (1.0f64 - z * z).sqrt() * (1.0 + 0.002 * planish::geom::random::unit(3, k as u64));
        format!("{} {} {}\n", r * a.cos(), r * a.sin(), z)
    };
    let far = |k: usize| format!("3 {} 0\n", 0.05 * k as f64);
    let path = folder.join("ball.xyz");
    std::fs::write(&path, (0..count).map(on).chain((0..20).map(far)).collect::<String>()).unwrap();
    path
}

/// The view along z without perspective, which sees all that is nearer than `reach`.
fn view(reach: f64) -> Value {
    let mut m = [0.0; 16];
    [0, 5, 10].iter().for_each(|&k| m[k] = 1.0 / reach);
    m[15] = 1.0;
    json!(m)
}

#[test]
fn points_are_looked_at_left_out_and_taken_in_and_make_a_mesh_of_a_given_cell() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), Some(points(folder.path())));
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["layers"]["points"].is_string()).await;
        let first = page.state["layers"]["points"].clone();
        assert_eq!(page.ask(json!({ "type": "clean" })).await["type"], "done");
        page.state_with(|s| s["cleaned"].is_object()).await;
        assert_ne!(page.state["layers"]["points"], first, "the points have colours now");
        assert!(page.state["cleaned"]["spacing"].as_f64().unwrap() < 0.1, "{}", page.state["cleaned"]);
        // All within the ball's box are kept; the far ones go. Geometry is relative to the middle of the box.
        let center: Vec<f64> =
            page.state["project"]["center"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        let at = |x: f64, y: f64| [(x - center[0]) / 10.0, (y - center[1]) / 10.0];
        let line = json!([at(2.0, -0.5), at(4.0, -0.5), at(4.0, 2.0), at(2.0, 2.0)]);
        let lasso = json!({ "type": "lasso", "view": view(10.0), "line": line });
        assert_eq!(page.ask(lasso.clone()).await["type"], "done");
        page.state_with(|s| s["left_out"] == 20).await;
        assert_eq!(page.state["project"]["center"], json!(center), "what is shown stays where it is");
        assert_eq!(page.state["cleaned"], Value::Null);
        assert_eq!(page.ask(lasso.clone()).await["type"], "refused");
        page.edit(json!({ "edit": "undo" })).await;
        page.state_with(|s| s["left_out"] == 0).await;
        assert_eq!(page.ask(lasso).await["type"], "done");
        assert_eq!(page.ask(json!({ "type": "mesh", "voxel": -1.0 })).await["type"], "refused");
        let mut triangles = Vec::new();
        let mut name = Value::Null;
        for voxel in [0.24, 0.12] {
            assert_eq!(page.ask(json!({ "type": "mesh", "close": true, "voxel": voxel })).await["type"], "done");
            page.state_with(|s| s["layers"]["mesh"].is_string() && s["layers"]["mesh"] != name).await;
            name = page.state["layers"]["mesh"].clone();
            triangles.push(page.state["project"]["triangles"].as_f64().unwrap());
        }
        let ratio = triangles[1] / triangles[0];
        assert!((2.5..5.0).contains(&ratio), "half the cell, {ratio} times the triangles");
        assert_eq!(page.state["holes"], json!([]));
    });
    server.end();
}

#[test]
fn a_pipe_is_closed_at_one_end_and_stays_open_at_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let mut pipe = shapes::cylinder(1.0, 3.0, 32);
    let side = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| pipe.points[v as usize]);
        (b - a).cross(c - a).normalize().dot(DVec3::Z).abs() < 0.5
    };
    let sides = pipe.triangles.iter().copied().filter(side).collect();
    pipe.triangles = sides;
    let path = folder.path().join("pipe.ply");
    planish_io::write_mesh(&path, &pipe, &WriteOptions::default()).unwrap();
    let server = Server::start(folder.path(), Some(path));
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["holes"].as_array().is_some_and(|h| h.len() == 2)).await;
        let open = page.state["project"]["triangles"].clone();
        let around = page.state["holes"][0]["around"].as_f64().unwrap();
        assert!((around - std::f64::consts::TAU).abs() < 0.1, "{around}");
        assert_eq!(page.ask(json!({ "type": "close_hole", "hole": 0 })).await["type"], "done");
        page.state_with(|s| s["holes"].as_array().is_some_and(|h| h.len() == 1)).await;
        assert_eq!(page.ask(json!({ "type": "close_hole", "hole": 7 })).await["type"], "refused");
        page.edit(json!({ "edit": "boundaries" })).await;
        page.state_with(|s| counts(s)[0] > 0).await;
        let refused = page.ask(json!({ "type": "close_hole", "hole": 0 })).await;
        assert!(refused["why"]["message"].as_str().unwrap().contains("curves are drawn"), "{refused}");
        // Back to the pipe with both ends open, and on again.
        let corners = counts(&page.state)[0];
        page.edit(json!({ "edit": "undo", "count": 2 })).await;
        page.state_with(|s| names(&s["undone"]) == ["boundaries", "close_hole"]).await;
        assert_eq!((names(&page.state["done"]), &page.state["project"]["triangles"]), (vec![], &open));
        assert_eq!(page.state["holes"].as_array().map(Vec::len), Some(2));
        page.edit(json!({ "edit": "redo", "count": 2 })).await;
        page.state_with(|s| counts(s)[0] == corners).await;
        assert_eq!(names(&page.state["done"]), ["close_hole", "boundaries"]);
    });
    server.end();
}

/// Names of steps of the history.
fn names(steps: &Value) -> Vec<&str> {
    steps.as_array().into_iter().flatten().map(|s| s["edit"].as_str().unwrap()).collect()
}

/// A copy of a folder as it is on the disk: what a kill leaves.
fn copied(folder: &std::path::Path) -> tempfile::TempDir {
    let copy = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap).filter(|e| e.path().is_file()) {
        std::fs::copy(entry.path(), copy.path().join(entry.file_name())).unwrap();
    }
    copy
}

#[test]
fn steps_to_a_mesh_are_taken_back_and_made_again_after_an_end_and_after_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    let scan = points(folder.path());
    let file = |folder: &std::path::Path, name: &str| folder.join(name).exists();
    let server = Server::start(folder.path(), Some(scan.clone()));
    let lasso = |center: &Value| {
        let at = |x: f64, y: f64| {
            json!([(x - center[0].as_f64().unwrap()) / 10.0, (y - center[1].as_f64().unwrap()) / 10.0])
        };
        let line = json!([at(2.0, -0.5), at(4.0, -0.5), at(4.0, 2.0), at(2.0, 2.0)]);
        json!({ "type": "lasso", "view": view(10.0), "line": line })
    };
    // Points left out, and no mesh yet: a kill and an end both leave them out.
    let mut killed = None;
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["layers"]["points"].is_string()).await;
        let request = lasso(&page.state["project"]["center"]);
        assert_eq!(page.ask(request).await["told"], "20 points left out.");
        killed = Some(copied(folder.path()));
    });
    server.end();
    let killed = killed.unwrap();
    let server = Server::start(killed.path(), Some(killed.path().join("ball.xyz")));
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["left_out"] == 20).await;
        page.edit(json!({ "edit": "undo" })).await;
        page.state_with(|s| names(&s["undone"]) == ["leave_out"]).await;
        assert_eq!(page.state["left_out"], 0);
    });
    server.end();
    // A mesh and an edit on it; then the project holds the steps.
    let server = Server::start(folder.path(), Some(scan.clone()));
    let mut triangles = Value::Null;
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["left_out"] == 20).await;
        page.ask(json!({ "type": "mesh", "close": true, "voxel": 0.24 })).await;
        page.state_with(|s| s["layers"]["mesh"].is_string()).await;
        triangles = page.state["project"]["triangles"].clone();
        assert_eq!(page.edit(json!({ "edit": "add_corner", "at": [0.0, 0.0, 1.0] })).await["type"], "done");
    });
    server.end();
    assert!(file(folder.path(), "ball.planish") && !file(folder.path(), "ball.planish-steps"));
    // All of it taken back, which reads the scan again; a kill; and made again.
    let server = Server::start(folder.path(), Some(folder.path().join("ball.planish")));
    let mut killed = None;
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| names(&s["done"]) == ["leave_out", "mesh", "add_corner"]).await;
        let far = page.ask(json!({ "type": "mesh" })).await;
        assert!(far["why"]["hint"].as_str().unwrap().contains("take them back"), "{far}");
        page.edit(json!({ "edit": "undo", "count": 3 })).await;
        page.state_with(|s| names(&s["undone"]) == ["add_corner", "mesh", "leave_out"]).await;
        assert_eq!((&page.state["left_out"], page.state["layers"]["points"].is_string()), (&json!(0), true));
        page.edit(json!({ "edit": "redo" })).await;
        page.state_with(|s| names(&s["done"]) == ["leave_out"]).await;
        assert_eq!(page.state["left_out"], 20);
        killed = Some(copied(folder.path()));
    });
    server.end();
    let killed = killed.unwrap();
    let server = Server::start(killed.path(), Some(killed.path().join("ball.planish")));
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["left_out"] == 20).await;
        assert_eq!(names(&page.state["undone"]), ["add_corner", "mesh"]);
        page.edit(json!({ "edit": "redo", "count": 2 })).await;
        page.state_with(|s| names(&s["done"]) == ["leave_out", "mesh", "add_corner"]).await;
        assert_eq!(page.state["project"]["triangles"], triangles);
        assert_eq!(page.state["corners"].as_array().map(Vec::len), Some(1));
        // A step of its own ends what could be made again.
        page.edit(json!({ "edit": "undo", "count": 2 })).await;
        page.state_with(|s| names(&s["undone"]).len() == 2).await;
        page.ask(json!({ "type": "mesh", "close": true, "voxel": 0.3 })).await;
        page.state_with(|s| names(&s["done"]) == ["leave_out", "mesh"]).await;
        assert_eq!(names(&page.state["undone"]), [""; 0]);
        // The scan is needed for what is before its mesh, and told where it is missing.
        std::fs::remove_file(killed.path().join("ball.xyz")).unwrap();
    });
    server.end();
    let server = Server::start(killed.path(), Some(killed.path().join("ball.planish")));
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["layers"]["mesh"].is_string()).await;
        let refused = page.edit(json!({ "edit": "undo" })).await;
        assert!(refused["why"]["message"].as_str().unwrap().starts_with("ball.xyz: "), "{refused}");
        assert!(page.state["layers"]["mesh"].is_string());
    });
    server.end();
}

#[test]
fn strokes_on_the_relief_stay_on_new_surfaces_go_back_and_come_again_after_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), Some(sphere(folder.path(), 4)));
    /// The largest displacement of all patches.
    async fn most(page: &mut Page) -> f64 {
        let mut most = 0f64;
        for patch in 0..page.state["patches"].as_array().unwrap().len() {
            let map = page.ask(json!({ "type": "map", "patch": patch })).await;
            most = most.max(map["most"].as_f64().unwrap());
        }
        most
    }
    let stroke = |radius: f64| {
        let edit = json!({ "edit": "stroke", "path": [[0, 0, 1], [0.1, 0, 0.99]], "radius": radius, "height": 0.05 });
        json!({ "type": "sculpt", "edit": edit })
    };
    let mut killed = None;
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["layers"]["mesh"].is_string()).await;
        let refused = page.ask(stroke(0.3)).await;
        assert!(refused["why"]["message"].as_str().unwrap().contains("no relief yet"), "{refused}");
        page.ask(json!({ "type": "setting", "resolution": { "control": [8, 8] }, "live": false })).await;
        assert_eq!(page.edit(json!({ "edit": "complete", "patches": 6 })).await["type"], "done");
        assert_eq!(page.ask(json!({ "type": "fit" })).await["type"], "done");
        page.state_with(|s| s["stages"][4]["is"] == "fresh").await;
        let bare = most(&mut page).await;
        assert!(bare < 0.01, "{bare}");
        assert_eq!(page.ask(stroke(0.3)).await["type"], "done");
        page.state_with(|s| s["relief_done"] == json!(["stroke"])).await;
        let raised = most(&mut page).await;
        assert!((raised - 0.05).abs() < bare + 1e-3, "{raised}");
        killed = Some(copied(folder.path()));
        // What cannot be meant leaves the list as it was.
        let refused = page.ask(stroke(0.0)).await;
        assert!(refused["why"]["message"].as_str().unwrap().contains("radius above 0"), "{refused}");
        page.state_with(|s| s["relief_done"] == json!(["stroke"])).await;
        // Taken back and made again.
        assert_eq!(page.ask(json!({ "type": "unsculpt", "count": 1 })).await["type"], "done");
        page.state_with(|s| s["relief_undone"] == json!(["stroke"])).await;
        assert!(most(&mut page).await < 0.01);
        assert_eq!(page.ask(json!({ "type": "unsculpt", "count": 1 })).await["type"], "refused");
        assert_eq!(page.ask(json!({ "type": "resculpt", "count": 1 })).await["type"], "done");
        page.state_with(|s| s["relief_undone"] == json!([])).await;
        assert_eq!(most(&mut page).await, raised);
        // As a script of `planish relief edit`.
        let script = page.ask(json!({ "type": "script", "relief": true })).await;
        let script: toml::Table = script["text"].as_str().unwrap().parse().unwrap();
        let step: ReliefEdit = script["step"].as_array().unwrap()[0].clone().try_into().unwrap();
        assert_eq!(serde_json::to_value(&step).unwrap()["radius"], stroke(0.3)["edit"]["radius"]);
        // New surfaces get it again.
        assert_eq!(page.edit(json!({ "edit": "relax" })).await["type"], "done");
        assert_eq!(page.ask(json!({ "type": "fit" })).await["type"], "done");
        page.state_with(|s| s["stages"][4]["is"] == "fresh").await;
        let again = most(&mut page).await;
        assert!((again - 0.05).abs() < 0.01, "{again}");
        assert_eq!(page.state["relief_done"], json!(["stroke"]));
    });
    server.end();
    let killed = killed.unwrap();
    let file = std::fs::read_dir(killed.path()).unwrap().map(|e| e.unwrap().path());
    let file = file.into_iter().find(|p| p.extension().is_some_and(|e| e == "planish")).unwrap();
    let server = Server::start(killed.path(), Some(file.clone()));
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["relief_done"] == json!(["stroke"])).await;
        // Surfaces that were not in the file yet are fitted when somebody asks for them.
        if page.state["stages"][4]["is"] != "fresh" {
            page.ask(json!({ "type": "setting", "resolution": { "control": [8, 8] }, "live": true })).await;
        }
        page.state_with(|s| s["stages"][4]["is"] == "fresh" && s["jobs"] == json!([])).await;
        let raised = most(&mut page).await;
        assert!((raised - 0.05).abs() < 0.01, "{raised}");
    });
    server.end();
    // One of three edits cannot be made any more: it goes, and the others stay.
    let mut model = planish_io::read_model(&file).unwrap();
    let mut kept: Value = serde_json::from_str(&model.studio).unwrap();
    let list = [stroke(0.3), stroke(0.0), stroke(0.2)].map(|s| s["edit"].clone());
    kept["relief"] = json!(list);
    (model.studio, model.layers) = (kept.to_string(), Layers::default());
    planish_io::write_model(&file, &model).unwrap();
    let server = Server::start(killed.path(), Some(file.clone()));
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["relief_done"] == json!(["stroke", "stroke"]) && s["jobs"] == json!([])).await;
    });
    server.end();
    let layers = planish_io::read_model(&file).unwrap().layers;
    let radii: Vec<Value> =
        layers.undo.iter().map(|p| serde_json::from_str::<Value>(&p.parameters).unwrap()["radius"].clone()).collect();
    assert_eq!(radii, [0.3, 0.2]);
}

#[test]
fn a_patch_is_tried_alone_has_handles_a_map_and_waves_and_grids_pause_coarse() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), Some(sphere(folder.path(), 5)));
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["layers"]["mesh"].is_string()).await;
        let setting = json!({ "type": "setting", "resolution": { "control": [6, 6] }, "live": false });
        page.ask(setting).await;
        assert_eq!(page.ask(json!({ "type": "map", "patch": 0 })).await["type"], "refused");
        assert_eq!(page.edit(json!({ "edit": "complete", "patches": 6 })).await["type"], "done");
        assert_eq!(page.ask(json!({ "type": "fit", "coarse": true })).await["type"], "done");
        page.state_with(|s| s["stages"][4]["is"] == "partial").await;
        let coarse = page.state["patches"][0]["fitted"]["cells"][0].as_u64().unwrap();
        assert_eq!(page.ask(json!({ "type": "export", "format": "step" })).await["type"], "refused");
        assert_eq!(page.ask(json!({ "type": "fit" })).await["type"], "done");
        page.state_with(|s| s["stages"][4]["is"] == "fresh").await;
        let fine = page.state["patches"][0]["fitted"]["cells"][0].as_u64().unwrap();
        assert!(fine >= 3 * coarse, "{coarse} cells, then {fine}");
        let rms = |answer: &Value| answer["rms"].as_f64().unwrap_or_else(|| panic!("{answer}"));
        let tried = |control: [u32; 2]| json!({ "type": "try_patch", "patch": 0, "control": control });
        let [few, many] = [page.ask(tried([4, 4])).await, page.ask(tried([12, 12])).await];
        assert!(rms(&many) < 0.2 * rms(&few), "{few} {many}");
        let wanted = 0.5 * (rms(&few) + rms(&many));
        let found = page.ask(json!({ "type": "try_patch", "patch": 0, "tolerance": wanted })).await;
        assert!(rms(&found) <= wanted && found["control"].as_array().unwrap().iter().all(|c| c.as_u64() < Some(12)));
        assert_eq!(page.ask(tried([3, 4])).await["type"], "refused");
        let handles = page.ask(json!({ "type": "handles", "curve": 0, "control": 7 })).await;
        let places = handles["points"].as_array().unwrap_or_else(|| panic!("{handles}"));
        assert_eq!(places.len(), 7);
        let radius = |p: &Value| (0..3).map(|k| p[k].as_f64().unwrap().powi(2)).sum::<f64>().sqrt();
        assert!(places.iter().all(|p| (radius(p) - 1.0).abs() < 0.3), "{handles}");
        assert_eq!(page.ask(json!({ "type": "handles", "curve": 99, "control": 7 })).await["type"], "refused");
        let map = page.ask(json!({ "type": "map", "patch": 0 })).await;
        let texels = map["cols"].as_u64().unwrap() * map["rows"].as_u64().unwrap();
        assert_eq!(map["heights"].as_array().unwrap().len() as u64, texels);
        let name = page.state["layers"]["displaced"].clone();
        assert_eq!(page.ask(json!({ "type": "relief", "longest": 0.05 })).await["type"], "done");
        page.state_with(|s| s["longest"] == 0.05).await;
        assert_ne!(page.state["layers"]["displaced"], name);
        let short = page.ask(json!({ "type": "map", "patch": 0 })).await;
        assert!(rms(&short) <= 1.01 * rms(&map), "{} of {}", short["rms"], map["rms"]);
        assert_eq!(page.ask(json!({ "type": "relief", "longest": 0.0 })).await["type"], "refused");
        page.ask(json!({ "type": "relief" })).await;
        page.state_with(|s| s["longest"] == Value::Null).await;
    });
    server.end();
}

#[test]
fn another_way_of_the_history_is_kept_and_gone_back_to_with_the_same_curves() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), Some(sphere(folder.path(), 4)));
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["layers"]["mesh"].is_string()).await;
        page.ask(json!({ "type": "setting", "resolution": { "control": [6, 6] }, "live": false })).await;
        let [x, y, z] = CIRCLES.map(|(normal, through)| cut(normal, through));
        for edit in [&x, &y, &z] {
            assert_eq!(page.edit(edit.clone()).await["type"], "done");
        }
        page.state_with(|s| counts(s)[2] == 3).await;
        let first = page.state["curves"].clone();
        page.edit(json!({ "edit": "undo", "count": 2 })).await;
        page.state_with(|s| counts(s)[2] == 1).await;
        assert_eq!(page.state["branches"], json!([]), "it can still be made again");
        page.edit(z).await;
        page.state_with(|s| counts(s)[2] == 2).await;
        assert_eq!(page.state["branches"], json!([{ "edits": 3, "own": ["cut", "cut"] }]));
        let second = page.state["curves"].clone();
        assert_eq!(page.ask(json!({ "type": "branch", "branch": 0 })).await["type"], "done");
        page.state_with(|s| counts(s)[2] == 3).await;
        assert_eq!(page.state["curves"], first);
        assert_eq!(page.state["branches"], json!([{ "edits": 2, "own": ["cut"] }]));
        assert_eq!(page.ask(json!({ "type": "branch", "branch": 0 })).await["type"], "done");
        page.state_with(|s| counts(s)[2] == 2).await;
        assert_eq!(page.state["curves"], second);
        assert_eq!(page.ask(json!({ "type": "branch", "branch": 5 })).await["type"], "refused");
    });
    server.end();
}

#[test]
fn the_network_of_another_project_comes_over_by_three_landmarks() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), Some(sphere(folder.path(), 4)));
    let mut curves = 0;
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["layers"]["mesh"].is_string()).await;
        page.ask(json!({ "type": "setting", "resolution": { "control": [6, 6] }, "live": false })).await;
        for (normal, through) in CIRCLES {
            page.edit(cut(normal, through)).await;
        }
        page.state_with(|s| counts(s)[2] == 3 && s["project"]["saved"] == true).await;
        curves = counts(&page.state)[0];
        assert!(curves >= 12, "{curves} curves");
    });
    server.end();
    let large = folder.path().join("large.ply");
    planish_io::write_mesh(&large, &shapes::sphere(2.0, 4), &WriteOptions::default()).unwrap();
    let server = Server::start(folder.path(), Some(large));
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["layers"]["mesh"].is_string()).await;
        assert_eq!(page.state["files"], json!(["sphere.planish"]));
        assert_eq!(page.ask(json!({ "type": "peer", "file": "../sphere.planish" })).await["type"], "refused");
        assert_eq!(page.ask(json!({ "type": "peer", "file": "sphere.planish" })).await["type"], "done");
        page.state_with(|s| s["peer"]["curves"] == curves).await;
        assert!(page.state["layers"]["peer"].is_string());
        let landmarks = json!([
            [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
            [[0.0, 1.0, 0.0], [0.0, 2.0, 0.0]],
            [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]],
            [[-1.0, 0.0, 0.0], [-2.0, 0.0, 0.0]]
        ]);
        let carried = page.edit(json!({ "edit": "carry", "from": "sphere.planish", "landmarks": landmarks })).await;
        assert_eq!(carried["type"], "done", "{carried}");
        page.state_with(|s| counts(s)[0] >= 12).await;
        page.ask(json!({ "type": "peer" })).await;
        page.state_with(|s| s["peer"] == Value::Null).await;
    });
    server.end();
}
