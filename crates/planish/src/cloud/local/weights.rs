//! Weights of points in a fit: by their distance from the middle of the support ([X03] §4.1, theta), and by their
//! residual (Tukey).

/// Points closer to zero than this many noise levels keep their weight (Tukey's biweight, 95 % efficiency).
const TUKEY: f64 = 4.685;

/// Weight of a point at squared distance `t2` of the support (1 at its rim).
#[inline]
pub(crate) fn kernel(t2: f64) -> f64 {
    (1.0 - t2 * t2).max(0.0)
}

/// Tukey's biweight of a residual in noise levels.
#[inline]
pub(crate) fn tukey(t: f64) -> f64 {
    let s = (t / TUKEY) * (t / TUKEY);
    if s < 1.0 { (1.0 - s) * (1.0 - s) } else { 0.0 }
}
