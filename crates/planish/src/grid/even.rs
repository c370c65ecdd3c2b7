//! Even spacing along every iso-curve, measured on the surface along the curve.
//!
//! The arc-length force F_arc of [K98] eq. 5.1 in its limit: each point of a curve goes part of the way to its
//! place at equal arc length. Lines and columns take turns.

use super::Fault;
use super::net::Net;
use glam::DVec2;

/// Rounds over lines and columns, and the part of the way that a round goes.
const ROUNDS: usize = 12;
const SHARE: f64 = 0.6;

/// Evens the spacing of `net`.
pub fn even<'a>(mut net: Net<'a>, cancelled: &(dyn Fn() -> bool + Sync)) -> Result<Net<'a>, Fault> {
    for round in 0..2 * ROUNDS {
        if cancelled() {
            return Err(Fault::Cancelled);
        }
        let along_u = round % 2 == 0;
        let (curves, count) = if along_u { (net.rows, net.cols) } else { (net.cols, net.rows) };
        let mut target = net.uv.clone();
        for curve in 1..curves - 1 {
            let node = |k: usize| if along_u { curve * net.cols + k } else { k * net.cols + curve };
            even_curve(&net, count, &node, &mut target);
        }
        net = net.moved(&|k, fraction| net.chart.locate(net.uv[k].lerp(target[k], fraction), net.spots[k].triangle));
    }
    Ok(net)
}

fn even_curve(net: &Net, count: usize, node: &dyn Fn(usize) -> usize, target: &mut [DVec2]) {
    // Arc length and place in the square at every edge of the chart that the curve crosses.
    let mut arc = vec![0.0];
    let mut places = vec![net.uv[node(0)]];
    let mut at_node = vec![0.0];
    for k in 0..count - 1 {
        let (a, b) = (node(k), node(k + 1));
        let (p, q) = (net.uv[a], net.uv[b]);
        let mut last = net.points[a];
        let mut sum = arc[arc.len() - 1];
        net.chart.trace(p, net.spots[a].triangle, q, &mut |fraction, position| {
            sum += last.distance(position);
            last = position;
            arc.push(sum);
            places.push(p.lerp(q, fraction));
        });
        sum += last.distance(net.points[b]);
        arc.push(sum);
        places.push(q);
        at_node.push(sum);
    }
    let total = arc[arc.len() - 1];
    for k in 1..count - 1 {
        let goal = total * k as f64 / (count - 1) as f64;
        let s = at_node[k] + SHARE * (goal - at_node[k]);
        let i = arc.partition_point(|x| *x <= s).clamp(1, arc.len() - 1);
        let span = arc[i] - arc[i - 1];
        let t = if span > 0.0 { ((s - arc[i - 1]) / span).clamp(0.0, 1.0) } else { 0.0 };
        target[node(k)] = places[i - 1].lerp(places[i], t);
    }
}
