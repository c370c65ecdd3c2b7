//! More of a patch's relief on other patches, without repeats: blocks of it are laid side by side and joined where they are alike.
//!
//! [EF01] Efros, Freeman, *Image Quilting for Texture Synthesis and Transfer*, SIGGRAPH 2001.
//! [K03] Kwatra, Schödl, Essa, Turk, Bobick, *Graphcut Textures: Image and Video Synthesis Using Graph Cuts*, SIGGRAPH 2003.
//! 1. patches as images of one pixel length - `canvas`      2. blocks chosen and laid - `fill`, [EF01] §2
//! 3. where two blocks part - `cut`, [K03] §3      4. both sides of a seam one - here
//!
//! Departs from [EF01]: the patches are filled one after the other, and each begins with what its neighbours would have beyond
//! their borders; blocks overlap such strips in any shape, so they part along a cut of a graph, not along a path.

mod canvas;
mod cut;
mod fill;

use super::super::Relief;
use super::super::ReliefError;
use super::ground::Ground;
use super::region::{Region, fade};
use crate::observe::Observer;
use crate::surface::node;
use canvas::{Canvas, Chart, Joint, Pixel, joints, lengths};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Overlap of two blocks as a share of their side ([EF01] §2.1 takes a sixth; here strips of this width join patches, too).
const OVERLAP: f64 = 0.25;
/// Pixels along a side of a block at least: below, an overlap has nothing to compare.
const SMALLEST: usize = 8;
/// Block unless it is given, share of the shorter side of the source.
const BLOCK: f64 = 1.0 / 3.0;
/// Texels of a target are no finer against a pixel than this: finer pixels would not be seen.
const PIXEL: f64 = 0.5;
/// Pixels of all patches at most, 16 patches of 2048 x 2048: they take 25 bytes each.
const MOST_PIXELS: f64 = 6.8e7;

/// `synthesise`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Synthesise {
    /// The patch whose relief is the pattern.
    pub from: u32,
    /// The patches that get more of it instead of their own.
    pub to: Vec<u32>,
    /// Side of the blocks that are joined, units of the model: about twice what recurs in the pattern [default: a third of the shorter
    /// side of the patch].
    #[serde(default)]
    pub block: Option<f64>,
    /// Another number gives another choice of blocks.
    #[serde(default)]
    pub seed: u64,
    /// Only here.
    #[serde(default)]
    pub region: Region,
}

/// What is laid out where.
struct Plan {
    charts: Vec<Chart>,
    joints: Vec<Vec<Joint>>,
    /// Patches to fill, each after a neighbour if one is filled, with the quarters by which the pattern is turned there.
    order: Vec<(usize, u32)>,
    /// Pixels along a side of a block, and across an overlap.
    block: usize,
    overlap: usize,
}

/// The layer that puts synthesised relief in the place of what is there.
/// # Errors
/// [`ReliefError::Edit`] for what cannot be meant, [`ReliefError::Cancelled`].
pub(super) fn synthesised(
    ground: &Ground,
    now: &[Relief],
    edit: &Synthesise,
    observer: &dyn Observer,
) -> Result<Vec<Relief>, ReliefError> {
    let plan = plan(ground, edit)?;
    let source = edit.from as usize;
    let mut turned = vec![Canvas::of(&now[source], &plan.charts[source])];
    for k in 0..3 {
        turned.push(turned[k].quarter());
    }
    let mut canvases: Vec<Option<Canvas>> = vec![None; now.len()];
    if !edit.to.contains(&edit.from) {
        canvases[source] = Some(turned[0].clone());
    }
    let mut filled = ground.nothing();
    for (number, &(p, quarters)) in plan.order.iter().enumerate() {
        let mut canvas = begun(&plan, &canvases, p);
        let image = &turned[quarters as usize];
        let seed = edit.seed.wrapping_add(crate::geom::random::bits(edit.seed, number as u64));
        fill::fill(&mut canvas, image, plan.block, seed, observer)?;
        filled[p].vectors = at_nodes(&canvas, &plan.charts[p], ground.shapes[p]);
        canvases[p] = Some(canvas);
        observer.progress((number + 1) as f64 / plan.order.len() as f64);
    }
    join(ground, now, &mut filled, &plan);
    for (map, old) in filled.iter_mut().zip(now) {
        map.vectors.iter_mut().zip(&old.vectors).for_each(|(new, old)| *new -= *old);
    }
    ground.agree(&mut filled);
    Ok(filled)
}

fn plan(ground: &Ground, edit: &Synthesise) -> Result<Plan, ReliefError> {
    let refused = |what: String| Err(ReliefError::Edit { what });
    let count = ground.shapes.len();
    if let Some(p) = edit.to.iter().chain([&edit.from]).find(|&&p| p as usize >= count) {
        return refused(format!("there is no patch {p} among {count}"));
    }
    if edit.to.is_empty() {
        return refused("patches to fill are needed: to = [1, 2]".into());
    }
    let size = |p: usize| lengths(&ground.nodes[p], ground.shapes[p]).map(|l| l[l.len() - 1]);
    let texel = |p: usize| {
        let ([rows, cols], [wide, high]) = (ground.shapes[p], size(p));
        (wide * high / ((rows - 1) * (cols - 1)) as f64).sqrt()
    };
    let source = edit.from as usize;
    let least = edit.to.iter().map(|&p| texel(p as usize)).filter(|t| *t > 0.0).fold(f64::INFINITY, f64::min);
    let pixel = texel(source).max(PIXEL * least);
    if !(pixel > 0.0 && pixel.is_finite()) {
        return refused(format!("patch {source} has no area"));
    }
    let area: f64 = edit.to.iter().map(|&p| size(p as usize)).map(|[w, h]| w * h).sum();
    if area > MOST_PIXELS * pixel * pixel {
        return refused(
            "the patches to fill are too large against the texels of the pattern; resample to fewer texels".into(),
        );
    }
    let charts: Vec<Chart> = (0..count).map(|p| Chart::new(&ground.nodes[p], ground.shapes[p], pixel)).collect();
    let [wide, high] = charts[source].pixels;
    let side = edit.block.unwrap_or((BLOCK * wide.min(high) as f64).max(SMALLEST as f64) * pixel) / pixel;
    let most = wide.min(high);
    if !(side.round() >= SMALLEST as f64 && side.round() <= most as f64) {
        let [low, high] = [SMALLEST, most].map(|n| n as f64 * pixel);
        return refused(format!("blocks have sides from {low:.4} ({SMALLEST} texels) to {high:.4} (the patch)"));
    }
    let block = side.round() as usize;
    let overlap = ((OVERLAP * block as f64).round() as usize).max(2);
    let joints = joints(&ground.network.patches);
    let order = order(&joints, edit);
    Ok(Plan { charts, joints, order, block, overlap })
}

/// Neighbours one after the other, from the pattern's own patch on or from the first that is named, with the pattern turned as it is
/// beyond the side.
fn order(joints: &[Vec<Joint>], edit: &Synthesise) -> Vec<(usize, u32)> {
    let mut wanted = vec![false; joints.len()];
    edit.to.iter().for_each(|&p| wanted[p as usize] = true);
    let mut order = Vec::new();
    let mut queue = VecDeque::new();
    let starts = std::iter::once(edit.from as usize).chain(edit.to.iter().map(|&p| p as usize));
    for start in starts {
        if wanted[start] || order.is_empty() && queue.is_empty() && start == edit.from as usize {
            queue.push_back((start, 0));
        }
        while let Some((p, quarters)) = queue.pop_front() {
            let is_source = p == edit.from as usize && order.is_empty();
            if !wanted[p] && !is_source {
                continue;
            }
            if std::mem::take(&mut wanted[p]) {
                order.push((p, quarters));
            }
            for joint in &joints[p] {
                if wanted[joint.patch] {
                    // Directions here turn the other way to be those there.
                    queue.push_back((joint.patch, (quarters + 4 - joint.quarters()) % 4));
                }
            }
        }
    }
    order
}

/// The open canvas of a patch with what its neighbours have on both sides of their borders.
///
/// Source: Franke, Nielson, *Smooth Interpolation of Large Sets of Scattered Data*, IJNME 15, 1980, for the weights of two.
fn begun(plan: &Plan, canvases: &[Option<Canvas>], p: usize) -> Canvas {
    let here = &plan.charts[p];
    let mut canvas = Canvas::open(here.pixels, plan.overlap);
    // Where strips of two neighbours cross at a corner, both count: no step where one begins.
    let mut weights = vec![0.0; canvas.values.len()];
    for joint in plan.joints[p].iter().filter(|j| j.patch != p) {
        let Some(other) = &canvases[joint.patch] else { continue };
        for (k, sum) in weights.iter_mut().enumerate() {
            let margin = plan.overlap as f64;
            let at = [(k % canvas.width) as f64 - margin, (k / canvas.width) as f64 - margin];
            let Some((there, depth)) = joint.beyond(here, &plan.charts[joint.patch], at) else { continue };
            if depth.abs() >= margin || canvas.known[k] == Pixel::Fixed {
                continue;
            }
            let Some(d) = other.sample(there) else { continue };
            let d = super::transfer::turned(d, joint.quarters());
            if depth <= 0.0 {
                canvas.values[k] = d;
                canvas.known[k] = Pixel::Fixed;
            } else {
                let weight = ((margin - depth) / depth).powi(2);
                *sum += weight;
                canvas.values[k] = canvas.values[k].lerp(d, weight / *sum);
                canvas.known[k] = Pixel::Filled;
            }
        }
    }
    canvas
}

/// The relief that a canvas holds.
fn at_nodes(canvas: &Canvas, chart: &Chart, [rows, cols]: [usize; 2]) -> Vec<DVec3> {
    let one = |k: usize| {
        let at = [chart.pixel(0, (k % cols) as f64), chart.pixel(1, (k / cols) as f64)];
        canvas.sample(at).unwrap_or_default()
    };
    (0..rows * cols).map(one).collect()
}

/// Makes all that meets at a seam one vector: that of a patch which keeps its relief, else the mean. What this changes at the
/// borders is spread over a block's overlap inside, so that there is no step: [`spread`].
fn join(ground: &Ground, now: &[Relief], filled: &mut [Relief], plan: &Plan) {
    let mut changes: Vec<Vec<DVec3>> = filled.iter().map(|m| vec![DVec3::ZERO; m.vectors.len()]).collect();
    for members in ground.seams() {
        let world = |&(p, n): &(u32, u32)| {
            let (p, n) = (p as usize, n as usize);
            let kept = filled[p].vectors.is_empty();
            let d = if kept { now[p].vectors[n] } else { filled[p].vectors[n] };
            (kept, ground.nodes[p][n].1.world_from_local(d))
        };
        let told: Vec<(bool, DVec3)> = members.iter().map(world).collect();
        let is_kept = told.iter().any(|t| t.0);
        let said: Vec<DVec3> = told.iter().filter(|t| t.0 == is_kept).map(|t| t.1).collect();
        let one = said.iter().sum::<DVec3>() / said.len() as f64;
        for (&(p, n), (_, own)) in members.iter().zip(&told).filter(|(_, t)| !t.0) {
            let (p, n) = (p as usize, n as usize);
            if *own != one {
                changes[p][n] = ground.nodes[p][n].1.local_from_world(one - *own);
            }
        }
    }
    for &(p, _) in &plan.order {
        let sides = &ground.network.patches[p].sides;
        let shared = |k: usize| {
            let uses = ground.network.patches.iter().flat_map(|patch| &patch.sides);
            uses.filter(|side| side.curve == sides[k].curve).count() > 1
        };
        let change = spread(&changes[p], &plan.charts[p], ground.shapes[p], plan.overlap, std::array::from_fn(shared));
        filled[p].vectors.iter_mut().zip(change).for_each(|(d, c)| *d += c);
    }
}

/// Changes at the borders of a patch as changes of all nodes: full at the border, none from `reach` pixels inside on; Coons, *Surfaces
/// for Computer-Aided Design of Space Forms*, MIT 1967, with fading weights.
/// * `shared` - the sides that have a seam
fn spread(border: &[DVec3], chart: &Chart, [rows, cols]: [usize; 2], reach: usize, shared: [bool; 4]) -> Vec<DVec3> {
    let [wide, high] = chart.pixels.map(|n| (n - 1) as f64);
    let one = |n: usize| {
        let (i, j) = (n % cols, n / cols);
        let (x, y) = (chart.pixel(0, i as f64), chart.pixel(1, j as f64));
        let weight = |k: usize| {
            let (depth, size) = [(y, high), (wide - x, wide), (high - y, high), (x, wide)][k];
            if shared[k] { 1.0 - fade(depth.max(0.0), size.min(reach as f64)) } else { 0.0 }
        };
        // Where a side begins its corner is.
        let [at, corner]: [[usize; 4]; 2] = [
            [i, j * cols + cols - 1, (rows - 1) * cols + i, j * cols],
            std::array::from_fn(|k| node(rows, cols, k, 0, 0)),
        ];
        (0..4).map(|k| border[at[k]] * weight(k) - border[corner[k]] * (weight(k) * weight((k + 3) % 4))).sum::<DVec3>()
    };
    (0..rows * cols).map(one).collect()
}
