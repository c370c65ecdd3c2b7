//! Files that are dropped on a page, and files that a page fetches.

use super::{Asked, Shared};
use crate::desk::{Letter, Upload};
use axum::body::Body;
use axum::extract::{Path, Query, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use serde::Deserialize;
use tokio::io::AsyncWriteExt;

/// Bytes of a file at most: what the readers of scans take on a usual machine.
const LARGEST: u64 = 8 << 30;

#[derive(Deserialize)]
pub struct Sent {
    #[serde(default)]
    token: String,
    #[serde(default)]
    name: String,
}

/// A file is dropped on a page.
pub async fn upload(State(shared): State<Shared>, Query(sent): Query<Sent>, body: Body) -> Response {
    if !shared.access.is_token(&sent.token) {
        return (StatusCode::FORBIDDEN, "the token is wrong").into_response();
    }
    let is_bare = std::path::Path::new(&sent.name).file_name() == Some(sent.name.as_ref());
    if !is_bare || sent.name.starts_with('.') {
        return (StatusCode::BAD_REQUEST, "the name is not one of a file").into_response();
    }
    match take(&sent.name, body).await {
        Ok(Some(file)) => {
            let _ = shared.post.send(Letter::Dropped(Upload { file, name: sent.name }));
            (StatusCode::OK, "taken").into_response()
        }
        Ok(None) => (StatusCode::PAYLOAD_TOO_LARGE, "the file is larger than 8 GB").into_response(),
        Err(e) => (StatusCode::INSUFFICIENT_STORAGE, format!("the file cannot be kept: {e}")).into_response(),
    }
}

/// Writes what comes into a temporary file of the same extension; nothing if it is too large.
async fn take(name: &str, body: Body) -> std::io::Result<Option<tempfile::TempPath>> {
    let extension = std::path::Path::new(name).extension().map(|e| format!(".{}", e.to_string_lossy()));
    let (file, path) = tempfile::Builder::new()
        .prefix("planish-")
        .suffix(extension.as_deref().unwrap_or_default())
        .tempfile()?
        .into_parts();
    let mut file = tokio::fs::File::from_std(file);
    let (mut stream, mut taken) = (body.into_data_stream(), 0u64);
    while let Some(piece) = stream.next().await {
        let piece = piece.map_err(std::io::Error::other)?;
        taken += piece.len() as u64;
        if taken > LARGEST {
            return Ok(None);
        }
        file.write_all(&piece).await?;
    }
    file.flush().await?;
    Ok(Some(path))
}

/// A page fetches a file that was made for it.
pub async fn download(State(shared): State<Shared>, Path(number): Path<u32>, Query(asked): Query<Asked>) -> Response {
    if !shared.access.is_token(&asked.token) {
        return (StatusCode::FORBIDDEN, "the token is wrong").into_response();
    }
    let missing = || (StatusCode::NOT_FOUND, "there is no such file").into_response();
    let Some((path, name)) = shared.exports.get(number) else { return missing() };
    let Ok(bytes) = tokio::fs::read(path).await else { return missing() };
    let plain: String = name.chars().filter(|c| c.is_ascii_graphic() && !matches!(c, '"' | '\\')).collect();
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_string()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{plain}\"")),
    ];
    (headers, Body::from(bytes)).into_response()
}
