//! Why the studio does not start.

use std::net::SocketAddr;

/// Why the studio does not start, or ends.
#[derive(Debug, thiserror::Error)]
pub enum StudioError {
    /// The program was built without the page.
    #[error(
        "this program was built without the studio's page - hint: build the page with `make studio`, which needs Node 20, and then the program again"
    )]
    NoPage,
    /// The port is taken, or the interface is not there.
    #[error("{address} cannot be listened at ({why}) - hint: leave --port away for any free port")]
    Listen {
        /// Where.
        address: SocketAddr,
        /// What the operating system says.
        why: String,
    },
    /// Another interface than the loopback one without a token of the user's.
    #[error(
        "{host} is seen by other machines - hint: give --token with {least} letters or digits at least, and a trusted network"
    )]
    Open {
        /// The interface.
        host: std::net::IpAddr,
        /// Letters and digits at least.
        least: usize,
    },
    /// A token that can be guessed, or that an address does not hold.
    #[error(
        "the token is too short or has other signs than letters and digits - hint: give {least} letters or digits at least"
    )]
    Token {
        /// Letters and digits at least.
        least: usize,
    },
    /// The file cannot be used.
    #[error("{0}")]
    File(String),
    /// The operating system refuses something else.
    #[error("the system refuses: {0} - hint: try again")]
    System(String),
}
