//! `planish run` for many inputs: a folder for each, one table, what is finished is skipped.

mod common;

use common::{names, planish, status, stderr, stdout, write_box};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// The states of the rows, by their names.
fn states(folder: &Path) -> Vec<(String, String)> {
    let rows = json(&folder.join("batch.json"))["runs"].as_array().unwrap().clone();
    let text = |v: &Value| v.as_str().unwrap().to_owned();
    rows.iter().map(|r| (text(&r["source"]), text(&r["status"]))).collect()
}

#[test]
fn of_three_parts_one_fails_two_get_the_products_of_a_single_run_and_the_second_time_only_what_changed_is_run() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("parts")).unwrap();
    write_box(&at("parts/a.ply"), 3);
    write_box(&at("parts/c.ply"), 4);
    fs::write(at("parts/b.ply"), "this is no mesh").unwrap();
    let all = ["run", "parts/*.ply", "-o", "out", "--jobs", "2", "--patches", "6"];
    let first = planish(&all, folder.path());
    assert_eq!(status(&first), 3, "{}", stderr(&first));
    let table = stdout(&first);
    assert!(table.starts_with("part ") && table.contains("b.ply  failed") && table.contains("look at"), "{table}");
    assert!(stderr(&first).contains("error: parts/b.ply: "), "{}", stderr(&first));
    assert_eq!(
        names(&at("out")).iter().filter(|n| !n.starts_with('.')).collect::<Vec<_>>(),
        ["a", "batch.html", "batch.json", "c", "manifest.json"]
    );
    let wanted =
        |b: &str| ["a", "b", "c"].map(|n| (format!("parts/{n}.ply"), if n == "b" { "failed" } else { b }.to_owned()));
    assert_eq!(states(&at("out")), wanted("done"));
    let alone = planish(&["run", "parts/a.ply", "-o", "alone", "--patches", "6"], folder.path());
    assert_eq!(status(&alone), 0);
    for product in ["mesh.ply", "surface.step", "preview.glb"] {
        assert_eq!(
            fs::read(at("alone").join(product)).unwrap(),
            fs::read(at("out/a").join(product)).unwrap(),
            "{product}"
        );
    }
    let page = fs::read_to_string(at("out/batch.html")).unwrap();
    assert!(page.contains("href=\"a/report.html\"") && !page.contains("href=\"b/"), "{page}");

    // The order of the options, and how many run at once, change nothing.
    let again = planish(&["run", "--patches=6", "parts/*.ply", "-o", "out", "--threads", "1"], folder.path());
    assert_eq!(status(&again), 3);
    assert_eq!(states(&at("out")), wanted("skipped"));
    write_box(&at("parts/a.ply"), 5);
    fs::remove_file(at("out/c/surface.step")).unwrap();
    planish(&all, folder.path());
    assert_eq!(states(&at("out")), wanted("done"));
    fs::remove_file(at("parts/b.ply")).unwrap();
    let fewer = planish(&["run", "parts/a.ply", "parts/c.ply", "-o", "out", "--json", "--patches", "6"], folder.path());
    assert_eq!(status(&fewer), 0);
    let lines: Vec<Value> = stdout(&fewer).lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert!(lines.len() == 2 && lines.iter().all(|l| l["status"] == "skipped" && l["quality"]["patches.count"] == 6));
}

#[test]
fn a_missed_tolerance_is_status_1_for_a_batch_too_and_a_pattern_without_a_file_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("a.ply"), 3);
    let one = planish(&["run", "a.ply", "-o", "out", "--jobs", "1", "--tolerance", "1e-17"], folder.path());
    assert!([0, 1].contains(&status(&one)), "{}", stderr(&one));
    let rows = json(&folder.path().join("out/batch.json"));
    assert_eq!(rows["runs"][0]["status"], if status(&one) == 1 { "missed" } else { "done" });
    let none = planish(&["run", "*.e57", "-o", "none"], folder.path());
    assert!(status(&none) == 3 && stderr(&none).contains("no file has a name like this"), "{}", stderr(&none));
    assert!(!folder.path().join("none").exists());
    // What is wrong with the options is told once, before anything is made.
    let wrong = planish(&["run", "a.ply", "a.ply", "-o", "none", "--density", "many"], folder.path());
    assert!(status(&wrong) == 2 && stderr(&wrong).lines().count() == 1, "{}", stderr(&wrong));
}
