//! Text on its way to a terminal: one line, nothing that steers the terminal, numbers and quotations short.

use std::path::PathBuf;
use std::sync::OnceLock;

/// Letters of a quotation at most.
const QUOTED: usize = 60;
/// Significant digits of a number with a fraction at most.
const DIGITS: usize = 6;
/// Whole numbers of more digits than this are no counts of anything, and are told as numbers with a fraction are.
const COUNT_DIGITS: usize = 15;

/// What stands for a standard stream on the command line.
pub const DASH: &str = "-";

/// The folder whose files stand for standard streams, if there is one.
static SCRATCH: OnceLock<PathBuf> = OnceLock::new();

/// Makes [`told`] tell of files in this folder as `-`.
pub fn hide(folder: PathBuf) {
    let _ = SCRATCH.set(folder);
}

/// A text in which files that stand for streams are told as `-`.
pub fn told(text: &str) -> String {
    let Some(scratch) = SCRATCH.get() else { return text.to_owned() };
    let mut rest = text;
    let mut told = String::new();
    let prefix = format!("{}{}", scratch.display(), std::path::MAIN_SEPARATOR);
    while let Some(at) = rest.find(&prefix) {
        told += &rest[..at];
        told += DASH;
        rest = &rest[at + prefix.len()..];
        let name = ["stdin.", "stdout."].into_iter().find_map(|n| rest.strip_prefix(n)).unwrap_or(rest);
        rest = name.trim_start_matches(|c: char| c.is_ascii_alphanumeric());
    }
    told + rest
}

/// A text without what steers a terminal: control characters (but for spaces, which become one) and those that turn the
/// direction of writing.
pub fn plain(text: &str) -> String {
    let steers = |c: char| {
        c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    text.chars().map(|c| if steers(c) { '\u{fffd}' } else { c }).collect()
}

/// An error of the library as the user reads it: the way out that it ends with becomes its hint.
pub fn with_hint(text: &str) -> String {
    match text.rsplit_once("; ") {
        Some((what, hint)) if !text.contains(" - hint: ") => format!("{what} - hint: {hint}"),
        _ => text.to_owned(),
    }
}

/// A text that is quoted: at most 60 letters of it.
pub fn quoted(text: &str) -> String {
    let text = plain(text);
    match text.char_indices().nth(QUOTED) {
        Some((at, _)) => format!("{}...", &text[..at]),
        None => text,
    }
}

/// A message as it is told: on one line, its quotations and its numbers short.
pub fn message(text: &str) -> String {
    let text = plain(&text.split_whitespace().collect::<Vec<_>>().join(" "));
    let mut told = String::with_capacity(text.len());
    let mut rest = text.as_str();
    while let Some(open) = rest.find(['"', '`']) {
        let mark = &rest[open..=open];
        let Some(length) = rest[open + 1..].find(mark) else { break };
        told += &numbers(&rest[..open]);
        told += &format!("{mark}{}{mark}", quoted(&rest[open + 1..open + 1 + length]));
        rest = &rest[open + 2 + length..];
    }
    told + &numbers(rest)
}

/// A text with its numbers written in six digits.
fn numbers(text: &str) -> String {
    let is_part = |c: char| c.is_alphanumeric() || matches!(c, '.' | '-' | '+' | '_');
    let mut told = String::with_capacity(text.len());
    let mut rest = text;
    while !rest.is_empty() {
        let end = rest.find(|c| is_part(c) != is_part(rest.chars().next().unwrap_or(' '))).unwrap_or(rest.len());
        let (word, after) = rest.split_at(end);
        let stop = word.trim_end_matches('.');
        told += &short(stop).unwrap_or_else(|| stop.to_owned());
        told += &word[stop.len()..];
        rest = after;
    }
    told
}

/// A number of too many digits in six; `None` for anything else.
fn short(word: &str) -> Option<String> {
    if !word.trim_start_matches(['-', '+']).starts_with(|c: char| c.is_ascii_digit() || c == '.') {
        return None;
    }
    let digits = word.bytes().filter(u8::is_ascii_digit).count();
    let is_whole = word.trim_start_matches('-').bytes().all(|b| b.is_ascii_digit());
    if digits <= if is_whole { COUNT_DIGITS } else { DIGITS } {
        return None;
    }
    let x: f64 = word.parse().ok()?;
    let size = x.abs();
    if size != 0.0 && !(1e-4..1e9).contains(&size) {
        let text = format!("{x:.*e}", DIGITS - 1);
        let (mantissa, power) = text.split_once('e')?;
        return Some(format!("{}e{power}", trimmed(mantissa)));
    }
    let before = if size < 1.0 { 0 } else { size.log10() as usize + 1 };
    Some(trimmed(&format!("{x:.*}", DIGITS.saturating_sub(before))).to_owned())
}

fn trimmed(number: &str) -> &str {
    if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_has_no_more_than_60_letters_of_a_quotation_and_6_digits_of_a_number() {
        let long = "x".repeat(200);
        let told = message(&format!("\"{long}\" is not a number (line 7)"));
        assert_eq!(told, format!("\"{}...\" is not a number (line 7)", "x".repeat(60)));
        assert_eq!(message(&format!("coordinate {} cannot be", 1e308)), "coordinate 1e308 cannot be");
        assert_eq!(message(&format!("at {} of {}.", -1.0 / 3.0, 123456.789)), "at -0.333333 of 123457.");
        assert_eq!(message("(0.123456789, 1e-300, 12.5)"), "(0.123456, 1e-300, 12.5)".replace("0.123456", "0.123457"));
        // Counts, versions, names and what is quoted stay as they are.
        for text in ["vertex 123456789012 of 4294967295", "planish 0.1.0", "part-2024-11-23.ply", "\"0.123456789.bin\""]
        {
            assert_eq!(message(text), text);
        }
    }

    #[test]
    fn nothing_that_steers_a_terminal_is_told() {
        assert_eq!(message("a\u{1b}[31m\nb\t\u{202e}c"), "a\u{fffd}[31m b \u{fffd}c");
    }
}
