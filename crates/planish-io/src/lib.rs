//! Everything that enters or leaves planish.

pub mod report;
