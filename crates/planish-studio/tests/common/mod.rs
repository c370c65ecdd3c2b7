//! A server in this process, and a page that is connected to it.

#![allow(dead_code)] // each test file uses a part

use futures_util::{SinkExt, StreamExt};
use planish::synthetic::shapes;
use planish_io::WriteOptions;
use planish_studio::{Options, serve};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::Duration;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::{self, Message};

pub type Socket = tokio_tungstenite::WebSocketStream<tokio_tungstenite::MaybeTlsStream<tokio::net::TcpStream>>;

/// A server in this process.
pub struct Server {
    pub host: String,
    pub token: String,
    stop: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Server {
    pub fn start(folder: &Path, file: Option<PathBuf>) -> Server {
        let stop = Arc::new(AtomicBool::new(false));
        let (seen, place) = (stop.clone(), channel());
        let options = Options {
            file,
            folder: folder.to_owned(),
            host: "127.0.0.1".parse().unwrap(),
            port: 0,
            token: None,
            units: None,
        };
        let thread = std::thread::spawn(move || {
            let ready = |p: &planish_studio::Place| place.0.send(p.address.clone()).unwrap();
            serve(options, ready, || seen.load(Ordering::Relaxed)).unwrap();
        });
        let address = place.1.recv_timeout(Duration::from_secs(30)).unwrap();
        let (host, token) = address.strip_prefix("http://").unwrap().split_once("/#").unwrap();
        Server { host: host.into(), token: token.into(), stop, thread: Some(thread) }
    }

    pub fn end(mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap();
    }

    /// The status of a plain request with its own headers.
    pub fn status(&self, head: &str) -> u16 {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        stream.write_all(head.replace('\n', "\r\n").as_bytes()).unwrap();
        let mut answer = [0; 64];
        let read = stream.read(&mut answer).unwrap();
        let text = String::from_utf8_lossy(&answer[..read]).into_owned();
        text.split(' ').nth(1).and_then(|s| s.parse().ok()).unwrap_or_else(|| panic!("{text}"))
    }

    pub async fn connect(&self) -> Page {
        self.connect_as(&self.token, &format!("http://{}", self.host)).await.unwrap()
    }

    pub async fn connect_as(&self, token: &str, origin: &str) -> Result<Page, u16> {
        let mut request = format!("ws://{}/ws?token={token}", self.host).into_client_request().unwrap();
        request.headers_mut().insert("origin", origin.parse().unwrap());
        match tokio_tungstenite::connect_async(request).await {
            Ok((socket, _)) => Ok(Page { socket, last: 0, state: Value::Null, bytes: 0 }),
            Err(tungstenite::Error::Http(answer)) => Err(answer.status().as_u16()),
            Err(e) => panic!("{e}"),
        }
    }
}

/// A connected page.
pub struct Page {
    pub socket: Socket,
    pub last: u64,
    /// The newest state.
    pub state: Value,
    /// Bytes of geometry so far.
    pub bytes: usize,
}

impl Page {
    /// The next message; nothing once the connection is cut.
    pub async fn next(&mut self) -> Option<Value> {
        loop {
            let message = tokio::time::timeout(Duration::from_secs(60), self.socket.next()).await.expect("an answer");
            match message {
                Some(Ok(Message::Text(text))) => {
                    let value: Value = serde_json::from_str(&text).unwrap();
                    if value["type"] == "state" {
                        self.state = value.clone();
                    }
                    return Some(value);
                }
                Some(Ok(Message::Binary(bytes))) => self.bytes += bytes.len(),
                Some(Ok(Message::Ping(_) | Message::Pong(_) | Message::Frame(_))) => {}
                Some(Ok(Message::Close(_)) | Err(_)) | None => return None,
            }
        }
    }

    pub async fn until(&mut self, wanted: impl Fn(&Value) -> bool) -> Value {
        loop {
            let value = self.next().await.expect("the connection holds");
            if wanted(&value) {
                return value;
            }
        }
    }

    pub async fn state_with(&mut self, wanted: impl Fn(&Value) -> bool) {
        while !wanted(&self.state) {
            self.next().await.expect("the connection holds");
        }
    }

    pub async fn begin(&mut self, mut request: Value) -> u64 {
        self.last += 1;
        request["id"] = json!(self.last);
        self.socket.send(Message::Text(request.to_string().into())).await.unwrap();
        self.last
    }

    /// Asks, and returns the answer.
    pub async fn ask(&mut self, request: Value) -> Value {
        let id = self.begin(request).await;
        self.until(|v| v["id"] == id && v["type"] != "state").await
    }

    pub async fn edit(&mut self, edit: Value) -> Value {
        self.ask(json!({ "type": "edit", "edit": edit })).await
    }
}

pub fn run(test: impl Future<Output = ()>) {
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap().block_on(test);
}

/// A sphere as a file.
pub fn sphere(folder: &Path, level: usize) -> PathBuf {
    let path = folder.join("sphere.ply");
    planish_io::write_mesh(&path, &shapes::sphere(1.0, level), &WriteOptions::default()).unwrap();
    path
}

pub fn cut(normal: [f64; 3], through: [f64; 3]) -> Value {
    json!({ "edit": "cut", "through": through, "normal": normal })
}

/// Three great circles part a sphere into eight regions of three sides.
pub const CIRCLES: [([f64; 3], [f64; 3]); 3] =
    [([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0]), ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0])];

pub fn counts(state: &Value) -> [usize; 3] {
    ["curves", "patches", "done"].map(|key| state[key].as_array().map_or(0, Vec::len))
}
