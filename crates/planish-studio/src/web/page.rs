//! The page inside the program: what `make studio` has built, if it was there when the program was compiled.

use axum::body::Body;
use axum::http::{StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use rust_embed::Embed;

#[derive(Embed)]
#[folder = "../../studio/dist"]
#[allow_missing = true]
struct Built;

/// True if the program has the page inside.
pub fn has_page() -> bool {
    Built::get("index.html").is_some()
}

/// A file of the page.
pub async fn page(uri: Uri) -> Response {
    let path = match uri.path().trim_start_matches('/') {
        "" => "index.html",
        path => path,
    };
    let Some(file) = Built::get(path) else {
        return (StatusCode::NOT_FOUND, "there is no such file").into_response();
    };
    ([(header::CONTENT_TYPE, content_type(path))], Body::from(file.data.into_owned())).into_response()
}

fn content_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map(|(_, e)| e) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        _ => "application/octet-stream",
    }
}
