//! All connected pages, and what is said to them.

use crate::protocol::Message;
use axum::body::Bytes;
use axum::extract::ws;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use tokio::sync::mpsc::{Receiver, Sender, channel};

/// Pages at once.
const MOST: usize = 128;
/// Messages that wait for a page; one that is further behind is cut off, and takes up again where it was.
const WAITING: usize = 1024;

/// A connected page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Client(u64);

#[derive(Default)]
struct Pages {
    last: u64,
    closed: bool,
    pages: BTreeMap<u64, Sender<ws::Message>>,
}

/// All connected pages.
#[derive(Clone, Default)]
pub struct Hub {
    pages: Arc<Mutex<Pages>>,
}

impl Hub {
    fn lock(&self) -> std::sync::MutexGuard<'_, Pages> {
        self.pages.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// A page more; nothing if there are too many.
    pub fn join(&self) -> Option<(Client, Receiver<ws::Message>)> {
        let mut pages = self.lock();
        if pages.closed || pages.pages.len() >= MOST {
            return None;
        }
        let (sender, receiver) = channel(WAITING);
        pages.last += 1;
        let number = pages.last;
        pages.pages.insert(number, sender);
        Some((Client(number), receiver))
    }

    /// A page less.
    pub fn leave(&self, client: &Client) {
        self.lock().pages.remove(&client.0);
    }

    /// All pages are cut off.
    pub fn close(&self) {
        let mut pages = self.lock();
        pages.closed = true;
        pages.pages.clear();
    }

    /// Says something to one page.
    pub fn tell(&self, client: &Client, message: &Message) {
        self.pass(client, text(message));
    }

    /// Says something to all pages.
    pub fn tell_all(&self, message: &Message) {
        let text = text(message);
        self.lock().pages.retain(|_, page| page.try_send(text.clone()).is_ok());
    }

    /// Sends frames to one page.
    pub fn send(&self, client: &Client, frames: &[Bytes]) {
        frames.iter().for_each(|frame| self.pass(client, ws::Message::Binary(frame.clone())));
    }

    fn pass(&self, client: &Client, message: ws::Message) {
        let mut pages = self.lock();
        if pages.pages.get(&client.0).is_some_and(|page| page.try_send(message).is_err()) {
            pages.pages.remove(&client.0);
        }
    }
}

fn text(message: &Message) -> ws::Message {
    ws::Message::Text(serde_json::to_string(message).unwrap_or_default().into())
}
