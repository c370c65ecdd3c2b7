//! Reliefs as images whose pixels have one length on every patch, and how they go on over a side.

use super::super::ground::Texel;
use super::super::transfer::turned;
use crate::network::Patch;
use crate::relief::Relief;
use glam::DVec3;

/// Fewest pixels along a side.
const FEWEST: usize = 2;

/// How nodes of a patch and pixels of its image lie to each other, along `u` and along `v`: even in mean length.
pub(super) struct Chart {
    /// Pixels from border to border.
    pub pixels: [usize; 2],
    /// For each node its pixel.
    along: [Vec<f64>; 2],
}

/// Mean lengths from the first column (or row) of nodes to each.
pub(super) fn lengths(nodes: &[Texel], [rows, cols]: [usize; 2]) -> [Vec<f64>; 2] {
    let measure = |n: usize, across: usize, at: &dyn Fn(usize, usize) -> usize| {
        let mut sum = 0.0;
        let step = |i: usize| {
            let far = (0..across).map(|j| nodes[at(i, j)].0.distance(nodes[at(i - 1, j)].0)).sum::<f64>();
            sum += far / across as f64;
            sum
        };
        std::iter::once(0.0).chain((1..n).map(step)).collect::<Vec<f64>>()
    };
    [measure(cols, rows, &|i, j| j * cols + i), measure(rows, cols, &|i, j| i * cols + j)]
}

impl Chart {
    /// * `pixel` - wanted length of a pixel; it gives way so that the borders are pixels
    pub fn new(nodes: &[Texel], shape: [usize; 2], pixel: f64) -> Chart {
        let lengths = lengths(nodes, shape);
        let whole = lengths.each_ref().map(|l| l[l.len() - 1]);
        let pixels = whole.map(|l| ((l / pixel).round() as usize + 1).max(FEWEST));
        let scaled = |k: usize| {
            let (last, n) = (lengths[k].len() - 1, (pixels[k] - 1) as f64);
            let even =
                |(i, l): (usize, &f64)| if whole[k] > 0.0 { l / whole[k] * n } else { i as f64 / last as f64 * n };
            lengths[k].iter().enumerate().map(even).collect()
        };
        Chart { pixels, along: [scaled(0), scaled(1)] }
    }

    /// Pixel of a node, which may lie between two.
    pub fn pixel(&self, axis: usize, node: f64) -> f64 {
        let along = &self.along[axis];
        let i = (node.max(0.0) as usize).min(along.len() - 2);
        along[i] + (along[i + 1] - along[i]) * (node - i as f64)
    }

    /// Node of a pixel, which may lie between two.
    fn node(&self, axis: usize, pixel: f64) -> f64 {
        let along = &self.along[axis];
        let i = along.partition_point(|&x| x <= pixel).clamp(1, along.len() - 1) - 1;
        let step = along[i + 1] - along[i];
        i as f64 + if step > 0.0 { ((pixel - along[i]) / step).clamp(0.0, 1.0) } else { 0.0 }
    }

    fn nodes(&self, axis: usize) -> usize {
        self.along[axis].len()
    }
}

/// What is known of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pixel {
    /// Nothing.
    Open,
    /// A value that may give way.
    Filled,
    /// A value that stays.
    Fixed,
}

/// An image of displacements `(t, b, n)`, row-major, with a margin around the patch.
#[derive(Clone, Debug)]
pub(super) struct Canvas {
    pub width: usize,
    pub height: usize,
    pub margin: usize,
    pub values: Vec<DVec3>,
    pub known: Vec<Pixel>,
}

impl Canvas {
    pub fn open(pixels: [usize; 2], margin: usize) -> Canvas {
        let [width, height] = pixels.map(|n| n + 2 * margin);
        let count = width * height;
        Canvas { width, height, margin, values: vec![DVec3::ZERO; count], known: vec![Pixel::Open; count] }
    }

    /// The relief of a patch, without a margin.
    pub fn of(relief: &Relief, chart: &Chart) -> Canvas {
        let mut canvas = Canvas::open(chart.pixels, 0);
        let nodes = Canvas {
            width: relief.cols,
            height: relief.rows,
            margin: 0,
            values: relief.vectors.clone(),
            known: vec![Pixel::Fixed; relief.vectors.len()],
        };
        for k in 0..canvas.values.len() {
            let (i, j) = (k % canvas.width, k / canvas.width);
            let at = [chart.node(0, i as f64), chart.node(1, j as f64)];
            canvas.values[k] = nodes.sample(at).unwrap_or_default();
        }
        canvas.known.fill(Pixel::Fixed);
        canvas
    }

    /// The image turned by a quarter against the clock, with its vectors.
    pub fn quarter(&self) -> Canvas {
        let (width, height) = (self.height, self.width);
        let from = |k: usize| (width - 1 - k % width) * self.width + k / width;
        let values = (0..width * height).map(|k| turned(self.values[from(k)], 1)).collect();
        Canvas {
            width,
            height,
            margin: self.margin,
            values,
            known: (0..width * height).map(|k| self.known[from(k)]).collect(),
        }
    }

    /// Bilinear, at pixels of the patch; `None` where something is not known.
    pub fn sample(&self, at: [f64; 2]) -> Option<DVec3> {
        let cell = |x: f64, n: usize| {
            let x = x + self.margin as f64;
            let inside = (-1e-9..=n as f64 - 1.0 + 1e-9).contains(&x);
            let i = (x.max(0.0) as usize).min(n - 2);
            inside.then_some((i, (x - i as f64).clamp(0.0, 1.0)))
        };
        let ((i, s), (j, t)) = (cell(at[0], self.width)?, cell(at[1], self.height)?);
        let mut sum = DVec3::ZERO;
        for (di, dj, share) in
            [(0, 0, (1.0 - s) * (1.0 - t)), (1, 0, s * (1.0 - t)), (0, 1, (1.0 - s) * t), (1, 1, s * t)]
        {
            if share > 0.0 {
                let k = (j + dj) * self.width + i + di;
                if self.known[k] == Pixel::Open {
                    return None;
                }
                sum += self.values[k] * share;
            }
        }
        Some(sum)
    }
}

/// Two sides of patches that are one curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Joint {
    /// Side of the one patch.
    pub side: usize,
    /// The other patch.
    pub patch: usize,
    /// Its side.
    pub other: usize,
}

impl Joint {
    /// Quarters by which directions of the other patch turn to be those of the one: what leads out there leads in here.
    pub fn quarters(&self) -> u32 {
        ((self.side + 6 - self.other) % 4) as u32
    }

    /// The pixel of the other patch, `[x, y]`, that a pixel of the one is beyond their side, and the depth of the pixel inside the
    /// one; `None` beside the side.
    pub fn beyond(&self, here: &Chart, there: &Chart, [x, y]: [f64; 2]) -> Option<([f64; 2], f64)> {
        let [wide, high] = here.pixels.map(|n| (n - 1) as f64);
        let (along, depth) = match self.side {
            0 => (x, y),
            1 => (y, wide - x),
            2 => (x, high - y),
            _ => (y, x),
        };
        let axis = self.side % 2;
        if !(0.0..=(here.pixels[axis] - 1) as f64).contains(&along) {
            return None;
        }
        // Nodes are the same on both sides; the direction of a side falls with the axis on sides 2 and 3.
        let node = here.node(axis, along);
        let turned = if (self.side < 2) == (self.other < 2) { (here.nodes(axis) - 1) as f64 - node } else { node };
        let other = self.other % 2;
        let along = there.pixel(other, turned);
        let [wide, high] = there.pixels.map(|n| (n - 1) as f64);
        let at = match self.other {
            0 => [along, -depth],
            1 => [wide + depth, along],
            2 => [along, high + depth],
            _ => [-depth, along],
        };
        Some((at, depth))
    }
}

/// The joints of each patch; sides that come back to themselves turned over, as on a Moebius strip, are left out.
pub(super) fn joints(patches: &[Patch]) -> Vec<Vec<Joint>> {
    let mut all = vec![Vec::new(); patches.len()];
    let mut uses: std::collections::BTreeMap<u32, Vec<(usize, usize)>> = Default::default();
    for (p, patch) in patches.iter().enumerate() {
        patch.sides.iter().enumerate().for_each(|(k, side)| uses.entry(side.curve).or_default().push((p, k)));
    }
    for pair in uses.values().filter(|u| u.len() == 2) {
        let [(p, k), (q, l)] = [pair[0], pair[1]];
        if patches[p].sides[k].reversed != patches[q].sides[l].reversed {
            all[p].push(Joint { side: k, patch: q, other: l });
            all[q].push(Joint { side: l, patch: p, other: k });
        }
    }
    all
}
