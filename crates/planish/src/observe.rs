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

/// A part of a stage that is itself a long step: its progress runs over `share` of the stage's, from `start` on.
pub struct Part<'a> {
    whole: &'a dyn Observer,
    start: f64,
    share: f64,
}

impl<'a> Part<'a> {
    /// The part of `whole` from `start` to `start + share`.
    pub fn new(whole: &'a dyn Observer, start: f64, share: f64) -> Part<'a> {
        Part { whole, start, share }
    }
}

impl Observer for Part<'_> {
    fn progress(&self, fraction: f64) {
        self.whole.progress(self.start + self.share * fraction);
    }
    fn cancelled(&self) -> bool {
        self.whole.cancelled()
    }
}
