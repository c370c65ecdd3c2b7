//! Who may come in: requests to this very address, from this very page, with the token.
//!
//! The host check keeps pages out that reach the loopback interface under a name of their own (DNS rebinding), the origin
//! check pages of other servers, the token other users of the machine.

use super::Shared;
use crate::StudioError;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::net::{IpAddr, SocketAddr};

/// Random bytes of a token.
const TOKEN_BYTES: usize = 16;
/// Letters and digits of a token of the user's, at least.
const LEAST: usize = 16;

/// What is let in.
pub struct Access {
    token: String,
    address: SocketAddr,
}

/// The token: the user's, or a random one.
/// # Errors
/// A token that is too short, or none where other machines see the server.
pub fn token(own: Option<&str>, host: IpAddr) -> Result<String, StudioError> {
    match own {
        Some(own) if own.len() >= LEAST && own.bytes().all(|b| b.is_ascii_alphanumeric()) => Ok(own.into()),
        Some(_) => Err(StudioError::Token { least: LEAST }),
        None if !host.is_loopback() => Err(StudioError::Open { host, least: LEAST }),
        None => {
            let mut bytes = [0u8; TOKEN_BYTES];
            getrandom::fill(&mut bytes).map_err(|e| StudioError::System(e.to_string()))?;
            Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
        }
    }
}

impl Access {
    /// Lets in what comes to `address` with `token`.
    pub fn new(token: String, address: SocketAddr) -> Access {
        Access { token, address }
    }

    /// What a browser is to open.
    pub fn address(&self) -> String {
        format!("http://{}/#{}", self.address, self.token)
    }

    /// True for the token; the time that this takes does not tell where another one differs.
    pub fn is_token(&self, given: &str) -> bool {
        let differ = |(a, b): (u8, u8)| a ^ b;
        let sum = self.token.bytes().zip(given.bytes()).map(differ).fold(0, |sum, d| sum | d);
        given.len() == self.token.len() && sum == 0
    }

    /// True if the request was meant for this server: on the loopback interface by its address or `localhost`, elsewhere by
    /// an address of the machine, which is not a name that somebody else gave.
    fn is_host(&self, host: &str) -> bool {
        let Some((name, port)) = host.rsplit_once(':') else { return false };
        let name = name.trim_start_matches('[').trim_end_matches(']');
        let is_own = match name.parse::<IpAddr>() {
            Ok(ip) if self.address.ip().is_loopback() => ip.is_loopback(),
            Ok(_) => true,
            Err(_) => name == "localhost",
        };
        is_own && port == self.address.port().to_string()
    }

    /// True for a request of this server's own page, or of a program that is no browser.
    fn is_origin(&self, headers: &HeaderMap) -> bool {
        let Some(origin) = headers.get(header::ORIGIN) else { return true };
        let host = headers.get(header::HOST).and_then(|h| h.to_str().ok()).unwrap_or_default();
        origin.to_str().is_ok_and(|o| o.strip_prefix("http://") == Some(host))
    }
}

/// Refuses what does not belong here, and tells browsers to keep the page to itself.
pub async fn guard(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let host = headers.get(header::HOST).and_then(|h| h.to_str().ok()).unwrap_or_default();
    if !shared.access.is_host(host) {
        return (StatusCode::MISDIRECTED_REQUEST, "this server is not of that name").into_response();
    }
    if !shared.access.is_origin(headers) {
        return (StatusCode::FORBIDDEN, "another page asks").into_response();
    }
    let mut response = next.run(request).await;
    let own = [
        (
            header::CONTENT_SECURITY_POLICY,
            "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; worker-src 'self' blob:; \
             object-src 'none'; base-uri 'none'; frame-ancestors 'none'",
        ),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    for (name, value) in own {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_names_ports_and_tokens_stay_outside() {
        let access = Access::new("0123456789abcdef".into(), "127.0.0.1:8123".parse().unwrap());
        for (host, own) in [
            ("127.0.0.1:8123", true),
            ("localhost:8123", true),
            ("[::1]:8123", true),
            ("127.0.0.1:8124", false),
            ("127.0.0.1", false),
            ("evil.example:8123", false),
            ("192.168.1.5:8123", false),
            ("", false),
        ] {
            assert_eq!(access.is_host(host), own, "{host}");
        }
        assert!(access.is_token("0123456789abcdef"));
        assert!(!access.is_token("0123456789abcdeg") && !access.is_token("0123456789abcde") && !access.is_token(""));
    }

    #[test]
    fn other_machines_need_a_token_of_the_users_and_random_ones_differ() {
        let [home, wide] = ["127.0.0.1", "0.0.0.0"].map(|h| h.parse().unwrap());
        assert!(matches!(token(None, wide), Err(StudioError::Open { .. })));
        assert!(matches!(token(Some("short"), home), Err(StudioError::Token { .. })));
        assert_eq!(token(Some("abcdefgh12345678"), wide).unwrap(), "abcdefgh12345678");
        assert_ne!(token(None, home).unwrap(), token(None, home).unwrap());
    }
}
