//! Hostile scripts: solids, formulas, milling, edits of curves, of the relief and of control points.

use super::dice::Dice;
use std::fmt::Write;

/// A number as TOML has it, ordinary ones four times out of five.
fn number(dice: &mut Dice) -> String {
    let x = if dice.is(0.2) { dice.odd() } else { (dice.unit() * 20.0).round() / 10.0 };
    match x {
        x if x.is_nan() => "nan".to_owned(),
        x if x.is_infinite() => "inf".to_owned(),
        x => format!("{x:?}"),
    }
}

fn numbers(n: usize, dice: &mut Dice) -> String {
    let list: Vec<String> = (0..n).map(|_| number(dice)).collect();
    format!("[{}]", list.join(", "))
}

fn shape(before: usize, dice: &mut Dice) -> String {
    let mut n = || number(dice);
    let usual = [
        format!("sphere = {{ radius = {} }}", n()),
        format!("cylinder = {{ radius = {}, height = {} }}", n(), n()),
        format!("cone = {{ bottom = {}, top = {}, height = {} }}", n(), n(), n()),
        format!("torus = {{ major = {}, minor = {} }}", n(), n()),
    ];
    let triple = [0; 4].map(|_| numbers(3, dice));
    match dice.below(10) {
        k @ 0..=3 => usual[k].clone(),
        4 => format!("box = {{ size = {}, round = {} }}", triple[0], number(dice)),
        5 => format!("plane = {{ normal = {}, offset = {} }}", triple[0], number(dice)),
        6 => format!("capsule = {{ from = {}, to = {}, radius = {} }}", triple[0], triple[1], number(dice)),
        7 => {
            let corners: Vec<String> = (0..dice.below(9)).map(|_| numbers(2, dice)).collect();
            format!("extrusion = {{ points = [{}], height = {} }}", corners.join(", "), number(dice))
        }
        8 => format!("formula = {{ text = \"{}\", from = {}, to = {} }}", formula(4, dice), triple[2], triple[3]),
        _ if before == 0 => usual[0].clone(),
        _ => {
            // Now and then the solid itself, or one that is not there.
            let members: Vec<String> =
                (0..1 + dice.below(4)).map(|_| format!("\"s{}\"", dice.below(before + 1).min(before))).collect();
            format!("{} = [{}]", dice.one(&["union", "intersection", "difference"]), members.join(", "))
        }
    }
}

/// A script of solids.
pub fn solids(dice: &mut Dice) -> String {
    let mut text = String::new();
    for k in 0..1 + dice.below(12) {
        let shape = shape(k, dice);
        let _ = writeln!(text, "[solid.s{k}]\n{shape}");
        if dice.is(0.2) {
            let _ = writeln!(text, "offset = {}", number(dice));
        }
        if dice.is(0.2) {
            let _ = writeln!(text, "scale = {}", number(dice));
        }
        if dice.is(0.2) {
            let _ = writeln!(text, "rotate = {{ axis = {}, angle_deg = {} }}", numbers(3, dice), number(dice));
        }
        if dice.is(0.4) {
            let _ = writeln!(text, "move = {}", numbers(3, dice));
        }
    }
    text
}

/// A formula, nested up to `depth`; not always one.
pub fn formula(depth: usize, dice: &mut Dice) -> String {
    if depth == 0 || dice.is(0.15) {
        return match dice.below(8) {
            0..=2 => "x".to_owned(),
            3 => "y".to_owned(),
            4 => "z".to_owned(),
            5 => "1e300".to_owned(),
            6 => "0".to_owned(),
            _ => format!("{:.2}", dice.unit() * 3.0),
        };
    }
    let (a, b) = (formula(depth - 1, dice), formula(depth - 1, dice));
    let word = dice.one(&["sqrt", "exp", "log", "sin", "tan", "asin", "abs", "cosh"]);
    match dice.below(9) {
        0 => format!("({a} + {b})"),
        1 => format!("({a} - {b})"),
        2 => format!("({a} * {b})"),
        3 => format!("({a} / {b})"),
        4 => format!("({a})^{}", dice.one(&["2", "3", "0.5", "-1", "1e9"])),
        5 => format!("min({a}, {b})"),
        6 => format!("max({a}, {b})"),
        _ => format!("{word}({a})"),
    }
}

/// A milling job.
pub fn job(dice: &mut Dice) -> String {
    let mut text = format!("[stock]\nfrom = {}\nto = {}\n", numbers(3, dice), numbers(3, dice));
    for k in 0..1 + dice.below(3) {
        let kind = dice.one(&["flat", "ball", "bull"]);
        let _ = write!(text, "[[tool]]\nname = \"t{k}\"\nkind = \"{kind}\"\nradius = {}\n", number(dice));
        if *kind == "bull" {
            let _ = writeln!(text, "corner = {}", number(dice));
        }
        let points: Vec<String> = (0..dice.below(30)).map(|_| numbers(3, dice)).collect();
        let _ = write!(text, "[[path]]\ntool = \"t{}\"\npoints = [{}]\n", dice.below(k + 2).min(k), points.join(", "));
    }
    text
}

/// A place on or beside a box from 0 to 1.
fn pick(dice: &mut Dice) -> String {
    if dice.is(0.15) {
        return numbers(3, dice);
    }
    if dice.is(0.1) {
        return format!("{{ corner = {} }}", dice.below(12));
    }
    let mut p = [0; 3].map(|_| (dice.unit() * 20.0).round() / 20.0);
    p[dice.below(3)] = dice.below(2) as f64;
    format!("{p:?}")
}

fn picks(dice: &mut Dice) -> String {
    let list: Vec<String> = (0..1 + dice.below(5)).map(|_| pick(dice)).collect();
    format!("[{}]", list.join(", "))
}

fn edit(dice: &mut Dice) -> String {
    let (curve, corner) = (dice.below(16), dice.below(10));
    let (place, list, triple, n) = (pick(dice), picks(dice), numbers(3, dice), number(dice));
    match dice.below(20) {
        0..=2 => {
            let mode = dice.one(&["straight", "geodesic", "magnetic"]);
            format!("\"paint\"\nmode = \"{mode}\"\npicks = {list}\nclosed = {}", dice.is(0.2))
        }
        3 => format!("\"cut\"\nthrough = {place}\nnormal = {triple}"),
        4 => format!("\"project\"\npoints = {list}"),
        5 => format!("\"extend\"\ncurve = {curve}\npicks = {list}"),
        6 => "\"boundaries\"".to_owned(),
        7 => format!("\"feature_lines\"\nangle_deg = {n}"),
        8 => format!("\"add_corner\"\nat = {place}"),
        9 => format!("\"split_curve\"\ncurve = {curve}\nat = {n}"),
        10 => format!("\"join\"\ncorner = {corner}"),
        11 => format!("\"delete_curves\"\ncurves = [{curve}]"),
        12 => format!("\"delete_corner\"\ncorner = {corner}"),
        13 => format!("\"drag_corner\"\ncorner = {corner}\nto = {place}\nreach = {n}"),
        14 => format!("\"drag_curve\"\ncurve = {curve}\nat = {n}\nby = {triple}"),
        15 => format!("\"relax\"\ncurve = {curve}\nforces = {{ fairness = {n}, curvature = {} }}", number(dice)),
        16 => format!("\"spline\"\ncurve = {curve}\ncontrol = {}", dice.below(400)),
        17 => format!("\"split_region\"\nat = {place}"),
        18 => format!("\"complete\"\npatches = {}", *dice.one(&[0, 1, 8, 40, 1000])),
        _ => format!("\"symmetry\"\nplane = {{ point = {place}, normal = {triple} }}"),
    }
}

/// A script of edits of curves on a box from 0 to 1.
pub fn edits(dice: &mut Dice) -> String {
    (0..1 + dice.below(6)).map(|_| format!("[[step]]\nedit = {}\n\n", edit(dice))).collect()
}

fn relief(dice: &mut Dice) -> String {
    let n = [0; 3].map(|_| number(dice));
    let (a, b) = (pick(dice), pick(dice));
    let region = format!("region = {{ at = {a}, radius = {}, feather = {} }}", n[0], n[1]);
    match dice.below(9) {
        0..=2 => format!("\"stroke\"\npath = [{a}, {b}]\nradius = {}\nheight = {}\nsoftness = {}", n[0], n[1], n[2]),
        3 => format!("\"scale\"\nfactor = {}\n{region}", n[2]),
        4 => format!("\"blur\"\nradius = {}", n[2]),
        5 => format!("\"sharpen\"\nradius = {}\namount = {}", n[0], n[2]),
        6 => format!("\"threshold\"\nheight = {}", n[2]),
        7 => format!("\"resample\"\ntexels = {}", *dice.one(&["0", "1", "9", "33", "1000000000", "-4"])),
        _ => format!("\"limit\"\nshare = {}", n[2]),
    }
}

/// A script of edits of the relief.
pub fn reliefs(dice: &mut Dice) -> String {
    (0..1 + dice.below(4)).map(|_| format!("[[step]]\nedit = {}\n\n", relief(dice))).collect()
}

/// Moves of control points.
pub fn moves(dice: &mut Dice) -> String {
    let one = |dice: &mut Dice| {
        format!(
            "[[move]]\npatch = {}\ni = {}\nj = {}\nby = {}\n\n",
            dice.below(8),
            dice.below(12),
            dice.below(12),
            numbers(3, dice)
        )
    };
    (0..1 + dice.below(5)).map(|_| one(dice)).collect()
}
