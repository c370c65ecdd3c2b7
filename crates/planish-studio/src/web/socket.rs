//! Sockets: requests of a page to the desk, messages of the desk to the page.

use super::{Asked, Shared};
use crate::desk::Letter;
use crate::protocol::{Message, Request, VERSION, Why};
use axum::extract::ws::{self, WebSocket, WebSocketUpgrade};
use axum::extract::{Query, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use futures_util::{SinkExt, StreamExt};
use std::sync::OnceLock;

/// Bytes of a request at most: the longest stroke has some thousand places.
const LARGEST: usize = 1 << 20;

/// A page connects.
pub async fn connect(State(shared): State<Shared>, Query(asked): Query<Asked>, upgrade: WebSocketUpgrade) -> Response {
    if !shared.access.is_token(&asked.token) {
        return (StatusCode::FORBIDDEN, "the token is wrong").into_response();
    }
    upgrade.max_message_size(LARGEST).max_frame_size(LARGEST).on_upgrade(move |socket| talk(shared, socket))
}

/// The name of this run of the server.
fn run() -> &'static str {
    static RUN: OnceLock<String> = OnceLock::new();
    RUN.get_or_init(|| {
        let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        format!("{:x}-{:x}", std::process::id(), since.map_or(0, |d| d.as_millis()))
    })
}

async fn talk(shared: Shared, socket: WebSocket) {
    let (mut out, mut inward) = socket.split();
    let Some((client, mut waiting)) = shared.hub.join() else {
        let _ = out.send(ws::Message::Close(None)).await;
        return;
    };
    let version = env!("CARGO_PKG_VERSION").into();
    shared.hub.tell(&client, &Message::Welcome { protocol: VERSION, version, run: run().into() });
    let _ = shared.post.send(Letter::Hello(client.clone()));
    let sending = tokio::spawn(async move {
        while let Some(message) = waiting.recv().await {
            if out.send(message).await.is_err() {
                return;
            }
        }
        let _ = out.send(ws::Message::Close(None)).await;
    });
    while let Some(Ok(message)) = inward.next().await {
        match message {
            ws::Message::Text(text) => match serde_json::from_str::<Request>(&text) {
                Ok(request) => {
                    if shared.post.send(Letter::Ask(client.clone(), request)).is_err() {
                        break;
                    }
                }
                Err(e) => {
                    let why = Why::of(format!("this is no request: {e}"));
                    shared.hub.tell(&client, &Message::Refused { id: number_in(&text), why });
                }
            },
            ws::Message::Binary(_) => {
                let why = Why::of("requests are text - hint: files go to /upload");
                shared.hub.tell(&client, &Message::Refused { id: 0, why });
            }
            ws::Message::Close(_) => break,
            ws::Message::Ping(_) | ws::Message::Pong(_) => {}
        }
    }
    shared.hub.leave(&client);
    let _ = sending.await;
}

/// The number of a request that is none otherwise.
fn number_in(text: &str) -> u32 {
    let value: Option<serde_json::Value> = serde_json::from_str(text).ok();
    value.and_then(|v| v.get("id")?.as_u64()).map_or(0, |id| id as u32)
}
