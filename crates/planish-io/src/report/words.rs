//! Numbers as people read them.

/// A distance with its unit and its fraction of the diagonal.
pub fn distance(value: f64, diagonal: f64, unit: &str) -> String {
    if diagonal > 0.0 {
        format!("{} {unit} ({} of the diagonal)", number(value), percent(value / diagonal))
    } else {
        format!("{} {unit}", number(value))
    }
}

/// A fraction in percent, three significant digits.
pub fn percent(fraction: f64) -> String {
    format!("{} %", number(fraction * 100.0))
}

/// A number with three significant digits; counts of units below a million are not rounded.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".into();
    }
    if !size.is_finite() {
        return "-".into();
    }
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:.1e}");
    }
    let digits = (2 - size.log10().floor() as i32).max(0) as usize;
    format!("{value:.digits$}")
}

/// A count with thin spaces between groups of three: `12 946`.
pub fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(c);
    }
    text
}

/// Text as HTML.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_significant_digits() {
        let texts: Vec<String> = [0.0, 0.012345, 1.0, 12.345, 123456.0, 1e-9].map(number).into();
        assert_eq!(texts, ["0", "0.0123", "1.00", "12.3", "123456", "1.0e-9"]);
        assert_eq!(count(1234567), "1\u{202f}234\u{202f}567");
        assert_eq!(distance(0.5, 200.0, "mm"), "0.500 mm (0.250 % of the diagonal)");
    }
}
