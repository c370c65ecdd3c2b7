//! The page, sockets, uploads and downloads, on the loopback interface.
//!
//! 1. who may come in - `access`      2. the page - `page`      3. sockets - `socket`, `hub`      4. files - `files`

mod access;
mod files;
pub mod hub;
mod page;
mod socket;

use crate::StudioError;
use crate::desk::{Desk, Exports, Letter};
use access::Access;
use axum::Router;
use axum::routing::{get, post};
use hub::Hub;
use planish::model::Units;
use serde::Deserialize;
use std::future::IntoFuture;
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

/// How the studio is served.
pub struct Options {
    /// The file to begin with.
    pub file: Option<PathBuf>,
    /// Where projects are that have no place of their own yet.
    pub folder: PathBuf,
    /// The interface.
    pub host: IpAddr,
    /// The port; 0 for any free one.
    pub port: u16,
    /// The user's own token.
    pub token: Option<String>,
    /// Unit of what does not tell its own.
    pub units: Option<Units>,
}

/// Where the studio is served.
pub struct Place {
    /// What a browser is to open: with the token after `#`, which browsers send to nobody.
    pub address: String,
}

/// How often the server looks whether it is to end.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// True if the program has the page inside.
pub fn has_page() -> bool {
    page::has_page()
}

/// What requests work with.
#[derive(Clone)]
struct Shared {
    access: Arc<Access>,
    hub: Hub,
    exports: Arc<Exports>,
    post: Sender<Letter>,
}

/// What requests bring along.
#[derive(Deserialize)]
struct Asked {
    #[serde(default)]
    token: String,
}

/// Serves the studio until `stop` tells to end. Everything that was done is in the project file or its journal then.
/// * `ready` - hears where it is served
/// # Errors
/// [`StudioError`] if it cannot be served.
pub fn serve(options: Options, ready: impl FnOnce(&Place), stop: impl Fn() -> bool) -> Result<(), StudioError> {
    let token = access::token(options.token.as_deref(), options.host)?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(|e| StudioError::System(e.to_string()))?;
    let wanted = SocketAddr::new(options.host, options.port);
    let listen = |e: std::io::Error| StudioError::Listen { address: wanted, why: e.to_string() };
    let listener = runtime.block_on(tokio::net::TcpListener::bind(wanted)).map_err(listen)?;
    let address = listener.local_addr().map_err(listen)?;
    let access = Arc::new(Access::new(token, address));
    let (post, inbox) = channel();
    let hub = Hub::default();
    let exports = Arc::new(Exports::default());
    let desk = Desk::new(hub.clone(), (post.clone(), inbox), (options.folder, options.units), exports.clone())?;
    let file = options.file;
    let desk = std::thread::spawn(move || desk.run(file));
    let shared = Shared { access: access.clone(), hub: hub.clone(), exports, post: post.clone() };
    ready(&Place { address: access.address() });
    runtime.block_on(async move {
        let serving = axum::serve(listener, router(shared));
        tokio::select! {
            _ = serving.into_future() => {}
            () = ended(stop) => {}
        }
    });
    hub.close();
    // The desk writes what is not written yet. Without one there is nothing left to write.
    let _ = post.send(Letter::Stop);
    let _ = desk.join();
    runtime.shutdown_timeout(LOOK_EVERY);
    Ok(())
}

async fn ended(stop: impl Fn() -> bool) {
    while !stop() {
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

fn router(shared: Shared) -> Router {
    Router::new()
        .route("/ws", get(socket::connect))
        .route("/upload", post(files::upload))
        .route("/files/{number}", get(files::download))
        .fallback(get(page::page))
        .layer(axum::middleware::from_fn_with_state(shared.clone(), access::guard))
        .with_state(shared)
}
