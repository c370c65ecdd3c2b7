//! Hostile networks and projects: those of a box, damaged in a few places.

use super::dice::Dice;
use planish::{DVec3, Model};
use serde_json::{Value, json};

/// A place of a value, the same chance for each branch on the way.
fn somewhere<'a>(mut value: &'a mut Value, dice: &mut Dice) -> &'a mut Value {
    loop {
        let children = match &value {
            Value::Array(list) => list.len(),
            Value::Object(map) => map.len(),
            _ => 0,
        };
        if children == 0 || dice.is(0.1) {
            return value;
        }
        let k = dice.below(children);
        value = match value {
            Value::Array(list) => &mut list[k],
            Value::Object(map) => map.values_mut().nth(k).expect("below their number"),
            _ => unreachable!("it has children"),
        };
    }
}

fn damage(value: &mut Value, dice: &mut Dice) {
    let odd = json!(dice.odd());
    let at = somewhere(value, dice);
    match at {
        Value::Array(list) if !list.is_empty() => {
            let k = dice.below(list.len());
            match dice.below(4) {
                0 => drop(list.remove(k)),
                1 => list.push(list[k].clone()),
                2 => list.reverse(),
                _ => list.swap(0, k),
            }
        }
        Value::Number(n) if n.is_u64() => {
            *at = dice.one(&[json!(0), json!(1), json!(3), json!(7), json!(4_294_967_295u64), odd]).clone()
        }
        Value::Number(_) => *at = dice.one(&[json!(0.0), json!(1.0), json!(0.5), json!(-0.25), odd]).clone(),
        Value::Bool(b) => *b = !*b,
        Value::String(s) => *s = dice.one(&["sharp", "smooth", "boundary", "", "\u{202e}"]).to_string(),
        _ => *at = dice.one(&[json!(null), json!([]), json!({}), json!("x")]).clone(),
    }
}

/// A network, damaged.
pub fn network(of: &str, dice: &mut Dice) -> String {
    let mut value: Value = serde_json::from_str(of).expect("what the program writes is JSON");
    (0..=dice.below(4)).for_each(|_| damage(&mut value, dice));
    value.to_string()
}

fn wild(points: &mut [DVec3], dice: &mut Dice) {
    if points.is_empty() {
        return;
    }
    let k = dice.below(points.len());
    let size = dice.power(-30, 30);
    match dice.below(4) {
        0 => points[k] = DVec3::from_array([0; 3].map(|_| dice.odd())),
        1 => points.iter_mut().for_each(|p| *p *= size),
        2 => points[k] = DVec3::from_array(dice.place()) * size,
        _ => points.fill(points[k]),
    }
}

/// A model, damaged.
pub fn model(of: &Model, dice: &mut Dice) -> Model {
    let mut model = of.clone();
    for _ in 0..=dice.below(3) {
        let p = dice.below(model.surfaces.len().max(1));
        match dice.below(16) {
            0 => wild(&mut model.mesh.points, dice),
            1 => {
                let (t, v) = (dice.below(model.mesh.triangles.len()), dice.below(model.mesh.points.len() + 1));
                model.mesh.triangles[t][dice.below(3)] = v as u32;
            }
            2 => wild(&mut model.surfaces[p].control, dice),
            3 => {
                let knots = &mut model.surfaces[p].knots_u;
                let k = dice.below(knots.len());
                knots[k] = dice.odd();
            }
            4 => model.surfaces[p].rows = *dice.one(&[0, 3, 4, 1_000_000_000]),
            5 => wild(&mut model.reliefs[p].vectors, dice),
            6 => model.reliefs[p].cols = *dice.one(&[0, 1, 1_000_000_000]),
            7 => wild(&mut model.grids[p].points, dice),
            8 => drop(model.grids.pop()),
            9 => {
                let c = dice.below(model.network.curves.len());
                model.network.curves[c].corners[dice.below(2)] = *dice.one(&[0, 1, u32::MAX]);
            }
            10 => {
                let c = dice.below(model.network.curves.len());
                let points = &mut model.network.curves[c].points;
                let k = dice.below(points.len());
                points[k].face = *dice.one(&[0, 5, u32::MAX]);
                points[k].bary = [0; 3].map(|_| dice.odd());
            }
            11 => {
                let c = dice.below(model.network.curves.len());
                model.network.curves[c].points.reverse();
            }
            12 => model.network.patches[p].sides.swap(0, 2),
            13 => {
                let mut params: Value = serde_json::from_str(&model.params).unwrap_or_default();
                (0..3).for_each(|_| damage(&mut params, dice));
                model.params = params.to_string();
            }
            14 => model.shift = DVec3::from_array([0; 3].map(|_| dice.odd())),
            _ => model.network.corners.truncate(dice.below(8)),
        }
        // Nothing is left to damage.
        if model.network.corners.is_empty() || model.grids.is_empty() {
            break;
        }
    }
    model
}
