//! Colours: the sRGB curve, an even colour scale, and colours that are easy to tell apart.
//!
//! Evenness is that of Oklab (Ottosson, *A perceptual color space for image processing*, 2020).

use std::sync::LazyLock;

/// sRGB byte to linear light.
pub(super) fn linear(byte: u8) -> f32 {
    static TABLE: LazyLock<[f32; 256]> = LazyLock::new(|| {
        std::array::from_fn(|byte| {
            let x = byte as f32 / 255.0;
            if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
        })
    });
    TABLE[byte as usize]
}

/// Linear light to sRGB byte.
pub(super) fn encoded(x: f32) -> u8 {
    let x = x.clamp(0.0, 1.0);
    let y = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (255.0 * y + 0.5) as u8
}

/// Linear red, green, blue of an Oklab colour.
fn from_oklab(lightness: f64, a: f64, b: f64) -> [f64; 3] {
    let l = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let m = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let s = (lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ]
}

/// The most colourful sRGB colour of that lightness and hue, up to `chroma`.
fn colorful(lightness: f64, chroma: f64, hue_deg: f64) -> [u8; 3] {
    let (sin, cos) = hue_deg.to_radians().sin_cos();
    let at = |c: f64| from_oklab(lightness, c * cos, c * sin);
    let fits = |c: f64| at(c).iter().all(|x| (0.0..=1.0).contains(x));
    let (mut low, mut high) = (0.0, chroma);
    if fits(chroma) {
        low = chroma;
    } else {
        for _ in 0..20 {
            let middle = (low + high) / 2.0;
            if fits(middle) { low = middle } else { high = middle }
        }
    }
    at(low).map(|x| encoded(x as f32))
}

/// The colour scale of fields, `x` from 0 to 1: from deep blue over teal and green to pale yellow; lightness and
/// hue change evenly, so equal steps of a number look equal, also in grey.
pub fn field_color(x: f64) -> [u8; 3] {
    if x.is_nan() {
        return [160, 160, 160];
    }
    let x = x.clamp(0.0, 1.0);
    colorful(0.30 + 0.65 * x, 0.08 + 0.28 * x * (1.0 - x) + 0.06 * x, 285.0 - 185.0 * x)
}

/// The colour scale of numbers with a side, `x` from 0 to 1 with zero in the middle: blue, pale, red. Both ends are equally
/// dark and equally far from the middle, so neither side looks larger.
pub fn signed_color(x: f64) -> [u8; 3] {
    if x.is_nan() {
        return [160, 160, 160];
    }
    let side = 2.0 * x.clamp(0.0, 1.0) - 1.0;
    let (away, hue) = (side.abs(), if side < 0.0 { 255.0 } else { 27.0 });
    colorful(0.95 - 0.45 * away, 0.19 * away, hue)
}

/// `n` soft colours of equal lightness; neighbours in the list are far apart in hue (golden angle).
pub fn even_colors(n: usize) -> Vec<[u8; 3]> {
    (0..n).map(|k| colorful([0.80, 0.72, 0.86][k % 3], 0.09, 40.0 + 137.507_764 * k as f64)).collect()
}
