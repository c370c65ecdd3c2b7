//! Hostile scans: points of a shape, or of none, with wrong returns.

use super::dice::Dice;

/// So many in any format are less than 200 kB: a number has 23 letters at most.
const MOST_POINTS: usize = 2_700;

fn on(shape: usize, dice: &mut Dice) -> [f64; 3] {
    let (a, t) = (std::f64::consts::TAU * dice.unit(), dice.signed());
    let r = (1.0 - t * t).sqrt();
    match shape {
        0 => [r * a.cos(), r * a.sin(), t],
        1 => [a.cos(), a.sin(), 2.0 * t],
        2 => [t, dice.signed(), 0.0],
        3 => {
            let mut p = dice.place();
            p[dice.below(3)] = if dice.is(0.5) { 1.0 } else { -1.0 };
            p
        }
        4 => [t, 2.0 * t, 3.0 * t],
        5 => [(9.0 * t).cos(), (9.0 * t).sin(), t],
        6 => dice.place(),
        7 => [(5.0 * t).round() / 5.0, (5.0 * dice.signed()).round() / 5.0, 0.1 * t],
        _ => [1.0, 2.0, 3.0],
    }
}

fn damage(points: &mut Vec<[f64; 3]>, dice: &mut Dice) {
    match dice.below(10) {
        0 => (0..1 + dice.below(9)).for_each(|_| points.push([0; 3].map(|_| dice.signed() * 1e12))),
        1 => (0..points.len() / 10).for_each(|_| points.push([0.0; 3])),
        2 => {
            let size = dice.power(-300, 300);
            points.iter_mut().flatten().for_each(|x| *x *= size);
        }
        3 => {
            let far = dice.power(3, 15);
            points.iter_mut().for_each(|p| *p = p.map(|x| x + far));
        }
        4 => {
            let share = dice.unit();
            points.retain(|_| !dice.is(share));
        }
        5 => points.extend_from_within(..),
        6 => {
            let noise = dice.power(-6, 0);
            points.iter_mut().flatten().for_each(|x| *x += noise * dice.signed());
        }
        7 => {
            let size = dice.power(-9, 4);
            points.iter_mut().for_each(|p| p[2] *= size);
        }
        8 => points.iter_mut().for_each(|p| *p = if dice.is(0.01) { [0; 3].map(|_| dice.odd()) } else { *p }),
        _ => points.truncate(dice.below(12)),
    }
}

/// A scan of a seed with its extension.
pub fn drawn(dice: &mut Dice) -> (&'static str, String) {
    let (shape, count) = (dice.below(9), 20 + dice.below(1500));
    let mut points: Vec<[f64; 3]> = (0..count).map(|_| on(shape, dice)).collect();
    (0..dice.below(4)).for_each(|_| damage(&mut points, dice));
    points.truncate(MOST_POINTS);
    let row = |p: &[f64; 3], between: &str| format!("{:e}{between}{:e}{between}{:e}\n", p[0], p[1], p[2]);
    match dice.below(4) {
        0 => ("csv", "x,y,z\n".to_owned() + &points.iter().map(|p| row(p, ",")).collect::<String>()),
        1 => {
            let head = format!(
                "VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n\
                 POINTS {n}\nDATA ascii\n",
                n = points.len()
            );
            ("pcd", head + &points.iter().map(|p| row(p, " ")).collect::<String>())
        }
        _ => ("xyz", points.iter().map(|p| row(p, " ")).collect()),
    }
}
