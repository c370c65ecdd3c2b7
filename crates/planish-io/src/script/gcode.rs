//! Linear G-code moves.
//!
//! G0 and G1 with X, Y and Z, absolute or relative (G90, G91), in millimetres or inches (G21, G20). What has no bearing
//! on where the tool goes is read over: feeds, speeds, tool numbers, plane and offset selection of a plain set-up,
//! spindle and coolant. Everything else is a fault, above all arcs: a path that is silently not cut would be worse than
//! none.

use planish::DVec3;

/// One straight motion of the tip, in the unit of its file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    pub from: DVec3,
    pub to: DVec3,
    pub inches: bool,
}

/// What is not understood, and where.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{what} in its line {line}")]
pub struct GcodeError {
    pub what: String,
    pub line: usize,
}

/// Codes without a bearing on the path, in tenths.
const HARMLESS_G: [i64; 13] = [40, 170, 400, 430, 490, 540, 610, 640, 800, 930, 940, 950, 980];
const HARMLESS_M: [i64; 10] = [0, 10, 20, 30, 40, 50, 60, 80, 90, 300];

/// All motions of a program, G0 and G1 alike: a tool that moves fast cuts, too. Motions before all three coordinates
/// are known only set the place.
pub fn read(bytes: &[u8]) -> Result<Vec<Motion>, GcodeError> {
    let mut motions = Vec::new();
    let mut at = [None::<f64>; 3];
    let (mut relative, mut inches, mut moving) = (false, false, false);
    for (n, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let fault = |what: String| GcodeError { what, line: n + 1 };
        let text = String::from_utf8_lossy(line);
        let mut target = at;
        let mut moved = false;
        for (letter, value) in words(&text).map_err(fault)? {
            let tenths = (value * 10.0).round() as i64;
            let exact = (value * 10.0 - tenths as f64).abs() < 1e-9;
            match letter {
                'G' if exact => match tenths {
                    0 | 10 => moving = true,
                    200 => inches = true,
                    210 => inches = false,
                    900 => relative = false,
                    910 => relative = true,
                    20 | 30 => return Err(fault(format!("arcs (G{value}) are not understood; write straight moves"))),
                    t if HARMLESS_G.contains(&t) => {}
                    _ => return Err(fault(format!("G{value} is not understood"))),
                },
                'M' if exact && HARMLESS_M.contains(&tenths) => {}
                'X' | 'Y' | 'Z' => {
                    let axis = (letter as u8 - b'X') as usize;
                    target[axis] = match (relative, at[axis]) {
                        (false, _) => Some(value),
                        (true, Some(old)) => Some(old + value),
                        (true, None) => {
                            return Err(fault(format!("a relative {letter} comes before any absolute one")));
                        }
                    };
                    moved = true;
                }
                'F' | 'S' | 'T' | 'N' | 'H' | 'D' | 'O' => {}
                _ => return Err(fault(format!("\"{letter}{value}\" is not understood"))),
            }
        }
        if moved {
            if !moving {
                return Err(fault("a place comes before any G0 or G1".into()));
            }
            if let ([Some(a), Some(b), Some(c)], [Some(x), Some(y), Some(z)]) = (at, target) {
                motions.push(Motion { from: DVec3::new(a, b, c), to: DVec3::new(x, y, z), inches });
            }
            at = target;
        }
    }
    Ok(motions)
}

/// Words of a line: a letter and a number each. Comments in brackets and after a semicolon are left out, and so are the
/// percent signs around a program.
fn words(line: &str) -> Result<Vec<(char, f64)>, String> {
    let mut plain = String::new();
    let mut depth = 0;
    for c in line.chars() {
        match c {
            ';' if depth == 0 => break,
            '(' => depth += 1,
            ')' if depth > 0 => depth -= 1,
            _ if depth == 0 => plain.push(c.to_ascii_uppercase()),
            _ => {}
        }
    }
    if depth > 0 {
        return Err("a comment is not closed".into());
    }
    let plain: String = plain.chars().filter(|c| !c.is_whitespace()).collect();
    if plain == "%" {
        return Ok(Vec::new());
    }
    // A leading slash marks a line that may be left out: it is cut.
    let mut rest = plain.strip_prefix('/').unwrap_or(&plain);
    let mut words = Vec::new();
    while let Some(letter) = rest.chars().next() {
        let number = &rest[letter.len_utf8()..];
        let end = number.find(|c: char| !(c.is_ascii_digit() || "+-.".contains(c))).unwrap_or(number.len());
        let value = number[..end].parse::<f64>().ok().filter(|v| v.is_finite());
        let Some(value) = value.filter(|_| letter.is_ascii_alphabetic()) else {
            return Err(format!("\"{}\" is not understood", rest.chars().take(16).collect::<String>()));
        };
        words.push((letter, value));
        rest = &number[end..];
    }
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_gives_its_motions_in_its_units() {
        let text = b"%\nO100 (pocket)\nN10 G21 G90 G17\nT1 M6\nS8000 M3\nG0 X0 Y0 Z5\nG1 Z-1 F200 ; plunge\nx10.5\nG91 G1 Y2\nG90 G20\nG1 X1\nM30\n%\n";
        let motions = read(text).unwrap();
        assert_eq!(motions.len(), 4);
        assert_eq!((motions[0].from.z, motions[0].to.z), (5.0, -1.0));
        assert_eq!(motions[1].to, DVec3::new(10.5, 0.0, -1.0));
        assert_eq!(motions[2].to.y, 2.0);
        assert!(motions[3].inches && !motions[2].inches);
    }

    #[test]
    fn arcs_and_nonsense_are_faults_with_their_line() {
        for (text, line) in [("G0 X0 Y0 Z0\nG2 X1 Y1 I1", 2), ("G1 X0\nhello", 2), ("X1", 1), ("G1 X1 (open", 1)] {
            assert_eq!(read(text.as_bytes()).unwrap_err().line, line, "{text}");
        }
    }
}
