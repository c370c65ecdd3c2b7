//! The server as a page meets it: who comes in, what is refused, two pages on one project, jobs that are stopped, and work that
//! is still there after a restart.

mod common;

use common::*;
use futures_util::SinkExt;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;
use tokio_tungstenite::tungstenite::Message;

#[test]
fn other_tokens_origins_and_hosts_are_refused_and_uploads_keep_to_their_folder() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), None);
    let Server { host, token, .. } = &server;
    let page = format!("GET /nothing HTTP/1.1\nHost: {host}\n\n");
    assert_eq!(server.status(&page), 404);
    assert_eq!(server.status("GET / HTTP/1.1\nHost: evil.example\n\n"), 421);
    assert_eq!(server.status(&format!("GET /nothing HTTP/1.1\nHost: {host}\nOrigin: http://evil.example\n\n")), 403);
    let post = |query: &str| format!("POST /upload?{query} HTTP/1.1\nHost: {host}\nContent-Length: 1\n\nx");
    assert_eq!(server.status(&post("token=wrong&name=a.ply")), 403);
    assert_eq!(server.status(&post(&format!("token={token}&name=..%2Fa.ply"))), 400);
    assert_eq!(server.status(&post(&format!("token={token}&name=.hidden"))), 400);
    assert_eq!(server.status(&format!("GET /files/1 HTTP/1.1\nHost: {host}\n\n")), 403);
    assert_eq!(server.status(&format!("GET /files/1?token={token} HTTP/1.1\nHost: {host}\n\n")), 404);
    run(async {
        let own = format!("http://{host}");
        assert_eq!(server.connect_as("wrong", &own).await.err(), Some(403));
        assert_eq!(server.connect_as(token, "http://evil.example").await.err(), Some(403));
        assert!(server.connect_as(token, &own).await.is_ok());
    });
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    server.end();
}

#[test]
fn malformed_messages_are_told_and_frames_of_more_than_a_megabyte_end_the_connection() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), None);
    run(async {
        let mut page = server.connect().await;
        for text in ["", "{", "[]", "{\"type\":\"edit\",\"id\":7}", "{\"type\":\"no_such\",\"id\":7}", "\u{0}"] {
            page.socket.send(Message::Text(text.into())).await.unwrap();
            let told = page.until(|v| v["type"] == "refused").await;
            assert!(told["why"]["message"].as_str().unwrap().contains("no request"), "{text}: {told}");
        }
        page.socket.send(Message::Binary(vec![0; 100].into())).await.unwrap();
        page.until(|v| v["type"] == "refused").await;
        // What is well formed and cannot be done is refused as well.
        for request in [
            json!({ "type": "fit" }),
            json!({ "type": "get", "layer": "mesh" }),
            json!({ "type": "open", "file": "../secret.planish" }),
            json!({ "type": "open", "file": "missing.planish" }),
            json!({ "type": "cancel", "job": 9 }),
            json!({ "type": "export", "format": "step" }),
            json!({ "type": "edit", "edit": { "edit": "undo" } }),
            json!({ "type": "setting", "resolution": { "control": [1, 8] }, "live": true }),
            json!({ "type": "setting", "resolution": { "tolerance": -1.0 }, "live": true }),
        ] {
            assert_eq!(page.ask(request.clone()).await["type"], "refused", "{request}");
        }
        let large = Message::Text("x".repeat((1 << 20) + 1).into());
        let _ = page.socket.send(large).await;
        while page.next().await.is_some() {}
        // Others are still served.
        assert_eq!(server.connect().await.next().await.unwrap()["type"], "welcome");
    });
    server.end();
}

#[test]
fn two_pages_have_one_history_and_a_restart_has_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = sphere(folder.path(), 4);
    let server = Server::start(folder.path(), Some(file.clone()));
    let mut before = Value::Null;
    run(async {
        let (mut a, mut b) = (server.connect().await, server.connect().await);
        a.state_with(|s| s["layers"]["mesh"].is_string()).await;
        b.state_with(|s| s["layers"]["mesh"].is_string()).await;
        a.ask(json!({ "type": "setting", "resolution": { "tolerance": 0.001 }, "live": false })).await;
        for (k, (normal, through)) in CIRCLES.into_iter().enumerate() {
            let page = if k == 1 { &mut b } else { &mut a };
            assert_eq!(page.edit(cut(normal, through)).await["type"], "done");
        }
        a.state_with(|s| counts(s)[2] == 3).await;
        b.state_with(|s| counts(s)[2] == 3).await;
        assert_eq!(a.state["curves"], b.state["curves"]);
        // Circles meet in six places; each has a corner of its own besides where it begins elsewhere.
        assert!(counts(&a.state)[0] >= 12, "{} curves", counts(&a.state)[0]);
        assert_eq!(a.state["patches"].as_array().unwrap().len() + a.state["faults"].as_array().unwrap().len(), 8);
        // What the other one did is taken back, and what is tried changes nothing.
        assert_eq!(b.edit(json!({ "edit": "undo" })).await["type"], "done");
        let tried = a.ask(json!({ "type": "try", "edit": cut([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]) })).await;
        assert_eq!(tried["type"], "tried");
        // The circle in its pieces, and none of those that it divides.
        let pieces = tried["curves"].as_array().unwrap();
        let height = |curve: &Value| {
            curve.as_array().unwrap().chunks(3).map(|p| p[2].as_f64().unwrap().abs()).fold(0.0, f64::max)
        };
        assert!(pieces.len() >= 4 && pieces.iter().all(|c| height(c) < 1e-6), "{tried}");
        a.state_with(|s| counts(s)[2] == 2).await;
        assert_eq!(b.edit(json!({ "edit": "redo" })).await["type"], "done");
        a.state_with(|s| counts(s)[2] == 3).await;
        before = a.state["curves"].clone();
        let script = a.ask(json!({ "type": "script" })).await;
        assert_eq!(script["text"].as_str().unwrap().matches("edit = \"cut\"").count(), 3);
        assert_eq!(a.ask(json!({ "type": "get", "layer": "mesh" })).await["type"], "done");
        while a.bytes == 0 {
            tokio::select! {
                _ = a.next() => {}
                () = tokio::time::sleep(Duration::from_millis(20)) => { a.begin(json!({ "type": "script" })).await; }
            }
        }
    });
    server.end();
    assert!(!folder.path().join("sphere.planish-edits").exists());
    let again = Server::start(folder.path(), Some(file));
    run(async {
        let mut page = again.connect().await;
        page.state_with(|s| counts(s)[2] == 3).await;
        assert_eq!(page.state["curves"], before);
        assert_eq!(page.edit(json!({ "edit": "undo", "count": 3 })).await["type"], "done");
        page.state_with(|s| counts(s) == [0, 0, 0]).await;
        assert_eq!(page.edit(json!({ "edit": "undo" })).await["type"], "refused");
    });
    again.end();
}

#[test]
fn a_sphere_is_laid_out_fitted_and_exported_and_a_stopped_job_leaves_all_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), Some(sphere(folder.path(), 5)));
    run(async {
        let mut page = server.connect().await;
        page.state_with(|s| s["layers"]["mesh"].is_string()).await;
        page.ask(json!({ "type": "setting", "resolution": { "control": [6, 6] }, "live": false })).await;
        let complete = json!({ "type": "edit", "edit": { "edit": "complete", "patches": 6 } });
        let id = page.begin(complete.clone()).await;
        page.state_with(|s| s["jobs"].as_array().is_some_and(|j| !j.is_empty())).await;
        let job = page.state["jobs"][0]["job"].clone();
        let cancel = page.begin(json!({ "type": "cancel", "job": job })).await;
        let (mut stopped, mut told) = (Value::Null, Value::Null);
        while stopped.is_null() || told.is_null() {
            match page.next().await.unwrap() {
                v if v["id"] == id => stopped = v,
                v if v["id"] == cancel => told = v,
                _ => {}
            }
        }
        assert_eq!(stopped["type"], "refused", "{stopped}");
        page.state_with(|s| s["jobs"].as_array().is_some_and(Vec::is_empty)).await;
        assert_eq!(counts(&page.state), [0, 0, 0]);
        assert_eq!(page.ask(complete).await["type"], "done");
        assert_eq!(page.ask(json!({ "type": "fit" })).await["type"], "done");
        page.state_with(|s| s["layers"]["surfaces"].is_string()).await;
        let [_, patches, _] = counts(&page.state);
        assert!(patches >= 6, "{patches} patches");
        assert_eq!(page.state["patches"][0]["fitted"]["control"], json!([6, 6]));
        // Surfaces are there first, their figures follow.
        page.state_with(|s| s["figures"]["seam.gap_max"].is_number()).await;
        assert!(page.state["figures"]["seam.gap_max"].as_f64().unwrap() < 1e-9);
        for (format, begins) in [("step", "ISO-10303-21;"), ("glb", "glTF"), ("report", "<!")] {
            let made = page.ask(json!({ "type": "export", "format": format })).await;
            assert_eq!(made["type"], "exported", "{made}");
            let head = format!(
                "GET {}?token={} HTTP/1.1\nHost: {}\nConnection: close\n\n",
                made["url"].as_str().unwrap(),
                server.token,
                server.host
            );
            let mut stream = TcpStream::connect(&server.host).unwrap();
            stream.write_all(head.replace('\n', "\r\n").as_bytes()).unwrap();
            let mut bytes = Vec::new();
            stream.read_to_end(&mut bytes).unwrap();
            let body = bytes.windows(4).position(|w| w == b"\r\n\r\n").unwrap() + 4;
            assert!(bytes[body..].starts_with(begins.as_bytes()), "{format}");
            assert_eq!((bytes.len() - body) as u64, made["bytes"].as_u64().unwrap());
        }
        // An edit leaves the surfaces for what they are: of earlier curves.
        page.edit(json!({ "edit": "continuity", "curves": [0], "seam": "sharp" })).await;
        page.state_with(|s| s["stages"][4]["is"] == "stale").await;
        assert_eq!(page.ask(json!({ "type": "export", "format": "step" })).await["type"], "refused");
    });
    server.end();
}

#[test]
fn a_hundred_pages_all_hear_of_an_edit() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), Some(sphere(folder.path(), 3)));
    run(async {
        let mut pages = Vec::new();
        for _ in 0..100 {
            pages.push(server.connect().await);
        }
        pages[0].state_with(|s| s["layers"]["mesh"].is_string()).await;
        let (normal, through) = CIRCLES[0];
        assert_eq!(pages[99].edit(cut(normal, through)).await["type"], "done");
        for page in &mut pages {
            page.state_with(|s| counts(s)[2] == 1).await;
        }
    });
    server.end();
}

#[test]
fn a_dropped_mesh_becomes_a_project_of_its_own_and_one_that_is_no_mesh_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let away = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), None);
    let bytes = std::fs::read(sphere(away.path(), 3)).unwrap();
    let send = |name: &str, bytes: &[u8]| {
        let head = format!(
            "POST /upload?token={}&name={name} HTTP/1.1\r\nHost: {}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
            server.token,
            server.host,
            bytes.len()
        );
        let mut stream = TcpStream::connect(&server.host).unwrap();
        stream.write_all(head.as_bytes()).unwrap();
        stream.write_all(bytes).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    };
    run(async {
        let mut page = server.connect().await;
        page.until(|v| v["type"] == "state").await;
        send("broken.ply", b"ply\nformat ascii 1.0\nelement vertex 3\n");
        let told = page.until(|v| v["type"] == "refused").await;
        assert!(told["why"]["message"].as_str().unwrap().contains("broken.ply"), "{told}");
        send("ball.ply", &bytes);
        page.state_with(|s| s["project"]["triangles"].as_u64().is_some_and(|n| n > 0)).await;
        assert_eq!(page.state["project"]["name"], "ball");
        page.state_with(|s| s["project"]["saved"] == true).await;
        assert!(folder.path().join("ball.planish").is_file());
        assert_eq!(page.ask(json!({ "type": "close" })).await["type"], "done");
        page.state_with(|s| s["project"].is_null()).await;
        assert_eq!(page.state["files"], json!(["ball.planish"]));
        assert_eq!(page.ask(json!({ "type": "open", "file": "ball.planish" })).await["type"], "done");
        page.state_with(|s| s["project"]["name"] == "ball").await;
    });
    server.end();
}
