//! Which triangle each sample sees.

use super::camera::Frame;
use crate::mesh::TriMesh;
use rayon::prelude::*;

/// No triangle.
pub(super) const NOTHING: u32 = u32::MAX;

/// What each sample sees, row by row.
pub(super) struct Seen {
    /// Triangle, or [`NOTHING`].
    pub face: Vec<u32>,
    /// Depth along the viewing direction, infinite where nothing is seen.
    pub depth: Vec<f32>,
}

/// Rows of one unit of parallel work.
const BAND: usize = 64;

/// Scan-converts all triangles with a depth buffer; the nearest wins, ties by index.
pub(super) fn see(mesh: &TriMesh, frame: &Frame) -> Seen {
    let projected: Vec<(f64, f64, f64)> = mesh.points.par_iter().map(|&p| frame.project(p)).collect();
    let (width, height) = (frame.width, frame.height);
    // Triangles of each band, in order.
    let mut bands: Vec<Vec<u32>> = vec![Vec::new(); height.div_ceil(BAND)];
    for (t, tri) in mesh.triangles.iter().enumerate() {
        let corners = tri.map(|v| projected[v as usize]);
        if !corners.iter().all(|c| c.2 > 0.0 && c.0.is_finite() && c.1.is_finite()) {
            continue;
        }
        let low = corners.iter().map(|c| c.1).fold(f64::INFINITY, f64::min);
        let high = corners.iter().map(|c| c.1).fold(f64::NEG_INFINITY, f64::max);
        if high < 0.0 || low >= height as f64 {
            continue;
        }
        let (first, last) = (low.max(0.0) as usize / BAND, (high.max(0.0) as usize).min(height - 1) / BAND);
        bands[first..=last].iter_mut().for_each(|b| b.push(t as u32));
    }
    let parts: Vec<(Vec<u32>, Vec<f32>)> = bands
        .par_iter()
        .enumerate()
        .map(|(b, triangles)| {
            let rows = b * BAND..((b + 1) * BAND).min(height);
            let mut face = vec![NOTHING; rows.len() * width];
            let mut depth = vec![f32::INFINITY; rows.len() * width];
            for &t in triangles {
                fill(t, mesh.triangles[t as usize].map(|v| projected[v as usize]), &rows, width, &mut face, &mut depth);
            }
            (face, depth)
        })
        .collect();
    let mut seen = Seen { face: Vec::with_capacity(width * height), depth: Vec::with_capacity(width * height) };
    for (face, depth) in parts {
        seen.face.extend(face);
        seen.depth.extend(depth);
    }
    seen
}

fn fill(
    t: u32,
    [a, b, c]: [(f64, f64, f64); 3],
    rows: &std::ops::Range<usize>,
    width: usize,
    face: &mut [u32],
    depth: &mut [f32],
) {
    let area = (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0);
    if area == 0.0 {
        return;
    }
    let (low, high) = (a.1.min(b.1).min(c.1), a.1.max(b.1).max(c.1));
    // Sample centres lie at half numbers.
    let first = ((low - 0.5).ceil().max(rows.start as f64)) as usize;
    let last = (high - 0.5).floor().min(rows.end as f64 - 1.0);
    if last < first as f64 {
        return;
    }
    // Over the picture 1/depth is linear.
    let w = [1.0 / a.2, 1.0 / b.2, 1.0 / c.2];
    for row in first..=last as usize {
        let y = row as f64 + 0.5;
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        for (p, q) in [(a, b), (b, c), (c, a)] {
            // Always from the upper end, so that two triangles find the same place on a shared edge.
            let (p, q) = if p.1 < q.1 || (p.1 == q.1 && p.0 < q.0) { (p, q) } else { (q, p) };
            if p.1 <= y && y <= q.1 && p.1 < q.1 {
                let x = p.0 + (q.0 - p.0) * ((y - p.1) / (q.1 - p.1));
                from = from.min(x);
                to = to.max(x);
            }
        }
        let begin = (from - 0.5).ceil().max(0.0);
        let end = (to - 0.5).floor().min(width as f64 - 1.0);
        if begin > end {
            continue;
        }
        for column in begin as usize..=end as usize {
            let x = column as f64 + 0.5;
            let v = ((x - a.0) * (c.1 - a.1) - (y - a.1) * (c.0 - a.0)) / area;
            let s = ((b.0 - a.0) * (y - a.1) - (b.1 - a.1) * (x - a.0)) / area;
            let d = (1.0 / (w[0] + v * (w[1] - w[0]) + s * (w[2] - w[0]))) as f32;
            let at = (row - rows.start) * width + column;
            if d < depth[at] {
                depth[at] = d;
                face[at] = t;
            }
        }
    }
}
