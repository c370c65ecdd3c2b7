//! Lines over the surface, and the scale bar.

use super::camera::Frame;
use super::color::linear;
use super::font::{self, draw_text};
use super::shade::Sample;
use super::visible::Seen;
use super::{FINE, Image, Look};
use glam::Vec3;

/// A line counts as on the surface if it lies at most this share of the diagonal behind it: curves of smooth
/// surfaces run a little under the facets.
const UNDER: f64 = 0.004;

pub(super) fn draw_lines(samples: &mut [Sample], look: &Look, frame: &Frame, seen: &Seen, diagonal: f64) {
    for line in &look.lines {
        let color = Vec3::from_array(line.color.map(linear));
        let radius = (line.width * FINE as f64 / 2.0).max(0.5);
        for pair in line.points.windows(2) {
            let (p, q) = (frame.project(pair[0]), frame.project(pair[1]));
            let drawable = |c: (f64, f64, f64)| c.0.is_finite() && c.1.is_finite() && c.2 > 0.0;
            // Segments far longer than the picture are cut by the bound on steps.
            if !drawable(p) || !drawable(q) {
                continue;
            }
            let length = (q.0 - p.0).hypot(q.1 - p.1);
            let steps = ((length * 2.0).ceil().max(1.0)).min(8.0 * (frame.width + frame.height) as f64) as usize;
            for k in 0..=steps {
                let s = k as f64 / steps as f64;
                let (x, y) = (p.0 + (q.0 - p.0) * s, p.1 + (q.1 - p.1) * s);
                if x < 0.0 || y < 0.0 || x >= frame.width as f64 || y >= frame.height as f64 {
                    continue;
                }
                let depth = 1.0 / (1.0 / p.2 + (1.0 / q.2 - 1.0 / p.2) * s);
                if depth <= seen.depth[y as usize * frame.width + x as usize] as f64 + UNDER * diagonal {
                    stamp(samples, frame, x, y, radius, color);
                }
            }
        }
    }
}

fn stamp(samples: &mut [Sample], frame: &Frame, x: f64, y: f64, radius: f64, color: Vec3) {
    let range = |c: f64, size: usize| {
        let low = (c - radius).floor().max(0.0) as usize;
        low..((c + radius).ceil() as usize).min(size)
    };
    for v in range(y, frame.height) {
        for u in range(x, frame.width) {
            if (u as f64 + 0.5 - x).powi(2) + (v as f64 + 0.5 - y).powi(2) <= radius * radius {
                samples[v * frame.width + u] = Some(color);
            }
        }
    }
}

/// Draws the labels whose places are seen, none over another.
pub(super) fn draw_labels(image: &mut Image, look: &Look, frame: &Frame, seen: &Seen, diagonal: f64) {
    let scale = (image.height / 450).max(1);
    let mut taken: Vec<[usize; 4]> = Vec::new();
    for label in &look.labels {
        let (x, y, depth) = frame.project(label.place);
        let inside = x >= 0.0 && y >= 0.0 && x < frame.width as f64 && y < frame.height as f64 && depth > 0.0;
        if !inside || depth > seen.depth[y as usize * frame.width + x as usize] as f64 + UNDER * diagonal {
            continue;
        }
        // A dot of air around the letters, the last of which needs no gap after it.
        let (wide, high) = ((label.text.chars().count() * font::ADVANCE + 1) * scale, (font::HEIGHT + 2) * scale);
        let left = (x as usize / FINE).saturating_sub(wide / 2).min(image.width.saturating_sub(wide));
        let top = (y as usize / FINE).saturating_sub(high / 2).min(image.height.saturating_sub(high));
        let plate = [left, top, left + wide, top + high];
        if taken.iter().any(|t| t[0] < plate[2] && plate[0] < t[2] && t[1] < plate[3] && plate[1] < t[3]) {
            continue;
        }
        for v in top..top + high {
            (left..left + wide).for_each(|u| image.put(u, v, label.color));
        }
        draw_text(image, left + scale, top + scale, scale, &label.text);
        taken.push(plate);
    }
}

/// Numbers beside the scale bar.
const TICKS: usize = 5;

/// Draws the colour scale at the right rim: bar, numbers, label. Pictures too small for it are left as they are.
pub(super) fn draw_bar(image: &mut Image, range: [f64; 2], label: &str, color_at: fn(f64) -> [u8; 3]) {
    let scale = (image.height / 450).max(1);
    let (glyph, line) = (font::ADVANCE * scale, font::HEIGHT * scale);
    let numbers: Vec<String> = (0..TICKS)
        .map(|k| written(range[0] + (range[1] - range[0]) * k as f64 / (TICKS - 1) as f64, range[1] - range[0]))
        .collect();
    let longest = numbers.iter().map(|n| n.chars().count()).max().unwrap_or(0).max(label.chars().count());
    let thick = 9 * scale;
    let (needed, tall) = (thick + 3 * glyph + longest * glyph, image.height * 3 / 5);
    if needed + glyph > image.width || tall < TICKS * 2 * line {
        return;
    }
    let left = image.width - needed;
    let top = (image.height - tall) / 2;
    for y in 0..tall {
        let color = color_at(1.0 - y as f64 / (tall - 1) as f64);
        for x in 0..thick {
            let edge = x < scale || x >= thick - scale || y < scale || y >= tall - scale;
            image.put(left + x, top + y, if edge { [40, 40, 40] } else { color });
        }
    }
    for (k, number) in numbers.iter().enumerate() {
        let y = top + (tall - 1) * (TICKS - 1 - k) / (TICKS - 1);
        for x in 0..glyph / 2 {
            for row in 0..scale {
                image.put(left + thick + x, (y + row).saturating_sub(scale / 2).min(top + tall - 1), [40, 40, 40]);
            }
        }
        draw_text(image, left + thick + glyph, y.saturating_sub(line / 2), scale, number);
    }
    draw_text(image, left, top.saturating_sub(2 * line), scale, label);
}

/// A number with the digits that matter for a scale of this span.
fn written(value: f64, span: f64) -> String {
    let size = span.abs().max(value.abs());
    if value == 0.0 || value.abs() < 1e-9 * size {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&size) {
        return format!("{value:.2e}");
    }
    let digits = (1 - span.abs().max(1e-12).log10().floor() as i32).clamp(0, 6) as usize;
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::written;

    #[test]
    fn numbers_of_a_scale_have_the_two_digits_that_its_span_needs() {
        let ticks = |low: f64, high: f64| [0.0, 0.5, 1.0].map(|x| written(low + (high - low) * x, high - low));
        assert_eq!(ticks(-1.0, 1.0), ["-1.0", "0", "1.0"]);
        assert_eq!(ticks(0.0, 0.02), ["0", "0.010", "0.020"]);
        assert_eq!(ticks(0.0, 250.0), ["0", "125", "250"]);
        assert_eq!(ticks(0.0, 2e-6), ["0", "1.00e-6", "2.00e-6"]);
        assert_eq!(written(f64::NAN, 1.0), "NaN");
    }
}
