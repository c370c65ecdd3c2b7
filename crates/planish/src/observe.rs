//! How a long stage tells what it does and learns that it is no longer wanted.

/// Watches a running stage.
///
/// Every long stage has the shape `stage(input, &Params, &dyn Observer) -> Result<Output, StageError>`; it
/// reports a fraction of itself and asks [`Observer::cancelled`] at least every 200 ms.
pub trait Observer: Sync {
    /// The stage has done `fraction` (0 to 1) of its own work.
    fn progress(&self, fraction: f64);
    /// True when the result is no longer wanted; the stage then returns its `Cancelled` error.
    fn cancelled(&self) -> bool;
}

/// An observer that does nothing.
pub struct Silent;

impl Observer for Silent {
    fn progress(&self, _fraction: f64) {}
    fn cancelled(&self) -> bool {
        false
    }
}
