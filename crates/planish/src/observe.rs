//! How a long stage tells what it does and learns that it is no longer wanted.

/// Watches a running stage.
///
/// Every long stage has the shape `stage(input, &Params, &dyn Observer) -> Result<Output, StageError>`; it
/// reports a fraction of itself and asks [`Observer::check`] at least every 200 ms.
pub trait Observer: Sync {
    /// The stage has done `fraction` (0 to 1) of its own work.
    fn progress(&self, fraction: f64);
    /// True when the result is no longer wanted.
    fn cancelled(&self) -> bool;
    /// Whether the result is still wanted, for `observer.check()?`.
    /// # Errors
    /// [`Cancelled`] if it is not; each stage's error has a variant that it becomes.
    fn check(&self) -> Result<(), Cancelled> {
        if self.cancelled() { Err(Cancelled) } else { Ok(()) }
    }
}

/// So many things in words: `1 cell is`, `2 cells are`.
pub(crate) fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// The observer no longer wanted the result: the one reason of every stage that was stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

impl Cancelled {
    /// True if `error` says nothing but that its stage was stopped, in whichever stage that was.
    pub fn is_cause_of(error: &(dyn std::error::Error + 'static)) -> bool {
        let mut chain = std::iter::successors(Some(error), |e| e.source());
        chain.any(|e| e.is::<Cancelled>())
    }
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
