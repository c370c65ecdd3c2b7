//! Even spacing along every iso-curve, measured on the surface along the curve.
//!
//! The arc-length force F_arc of [K98] eq. 5.1 in its limit: each point of a curve goes part of the way to its
//! place at equal arc length. Lines and columns take turns.

use super::Net;
use crate::grid::Fault;
use crate::observe::Observer;
use glam::DVec2;

/// Part of the way that a round goes.
const EVEN_STEP: f64 = 0.6;

/// Evens the spacing of `net` in `rounds` rounds over lines and columns.
pub fn even<'a>(mut net: Net<'a>, rounds: usize, observer: &dyn Observer) -> Result<Net<'a>, Fault> {
    for round in 0..2 * rounds {
        observer.check()?;
        let along_u = round % 2 == 0;
        let (curves, count) = if along_u { (net.rows, net.cols) } else { (net.cols, net.rows) };
        let mut target = net.uv.clone();
        for curve in 1..curves - 1 {
            let node = |k: usize| if along_u { curve * net.cols + k } else { k * net.cols + curve };
            even_curve(&net, count, &node, &mut target);
        }
        net = net
            .moved(false, &|k, fraction| net.chart.locate(net.uv[k].lerp(target[k], fraction), net.spots[k].triangle));
    }
    Ok(net)
}

/// A curve of a net, measured on the surface.
struct Measured {
    /// Arc length and place in the square at every edge of the chart that the curve crosses and at every node.
    arc: Vec<f64>,
    places: Vec<DVec2>,
    /// Arc length at the nodes.
    at_node: Vec<f64>,
}

fn measured(net: &Net, count: usize, node: &dyn Fn(usize) -> usize) -> Measured {
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
    Measured { arc, places, at_node }
}

/// Mean square deviation of the spacing along the curves of `net`, measured on the surface, from even.
pub fn unevenness(net: &Net) -> f64 {
    let mut sum = 0.0;
    for (curves, count, along_u) in [(net.rows, net.cols, true), (net.cols, net.rows, false)] {
        for curve in 1..curves - 1 {
            let node = |k: usize| if along_u { curve * net.cols + k } else { k * net.cols + curve };
            let at_node = measured(net, count, &node).at_node;
            let mean = at_node[count - 1] / (count - 1) as f64;
            let square: f64 = at_node.windows(2).map(|w| ((w[1] - w[0]) / mean - 1.0).powi(2)).sum();
            sum += square / (count - 1) as f64;
        }
    }
    sum / ((net.rows + net.cols).saturating_sub(4)).max(1) as f64
}

fn even_curve(net: &Net, count: usize, node: &dyn Fn(usize) -> usize, target: &mut [DVec2]) {
    let Measured { arc, places, at_node } = measured(net, count, node);
    let total = arc[arc.len() - 1];
    for k in 1..count - 1 {
        let goal = total * k as f64 / (count - 1) as f64;
        let s = at_node[k] + EVEN_STEP * (goal - at_node[k]);
        let i = arc.partition_point(|x| *x <= s).clamp(1, arc.len() - 1);
        let span = arc[i] - arc[i - 1];
        let t = if span > 0.0 { ((s - arc[i - 1]) / span).clamp(0.0, 1.0) } else { 0.0 };
        target[node(k)] = places[i - 1].lerp(places[i], t);
    }
}
