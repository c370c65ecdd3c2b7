//! Pictures by ray casting.
