//! Directed fields on one lattice, combined.
//!
//! [K01] §3: the greatest or least of the directed distances, component by component; the normal travels
//! with the winner. On hits that reads: on an edge whose ends differ after the combination, from its inside end, an
//! intersection is left at the first exit of either body and a union at the last. Where both ends of an edge come out
//! alike its hits go. That is exact as long as each body passes an edge once.

use super::directed::{Directed, Hit, Hits, Placed, Sides, changes_of};
use rayon::prelude::*;

/// How two bodies are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// Both together.
    Union,
    /// What they share.
    Intersection,
    /// The first without the second.
    Difference,
}

/// Combines two fields on the same lattice. What one of them does not know is unknown.
/// # Panics
/// If the lattices differ.
pub fn combine(a: &Directed, b: &Directed, operation: Operation) -> Directed {
    assert_eq!(a.lattice, b.lattice, "fields on one lattice");
    let lattice = a.lattice;
    let (words, nodes) = (lattice.words(), lattice.nodes(0));
    let rows: Vec<Vec<u32>> = (0..lattice.rows())
        .into_par_iter()
        .with_min_len(64)
        .map(|row| {
            let mut bits = [(); 4].map(|()| vec![0u64; words]);
            let [ia, ka, ib, kb] = &mut bits;
            a.sides.bits(row, ia, ka);
            b.sides.bits(row, ib, kb);
            for w in 0..words {
                ia[w] = match operation {
                    Operation::Union => ia[w] | ib[w],
                    Operation::Intersection => ia[w] & ib[w],
                    Operation::Difference => ia[w] & !ib[w],
                };
                ka[w] &= kb[w];
            }
            changes_of(ia, ka, nodes)
        })
        .collect();
    let sides = Sides::from_rows(rows);
    let axes = [0, 1, 2].map(|axis| merge(a, b, axis, operation));
    let missing = |_: usize, _: [usize; 3]| Hit { t: 0.5, normal: glam::DVec3::X };
    let mut combined = Directed::assemble(lattice, sides, axes, &missing);
    combined.noise_deg = a.noise_deg.max(b.noise_deg);
    combined.mended += a.mended + b.mended;
    combined
}

/// One hit for every edge on which either has one.
fn merge(a: &Directed, b: &Directed, axis: usize, operation: Operation) -> Hits {
    let rows = a.lattice.rows();
    let placed: Vec<Placed> = (0..rows)
        .into_par_iter()
        .with_min_len(64)
        .flat_map_iter(|row| {
            let ((pa, fa), (pb, fb)) = (a.axes[axis].row(row), b.axes[axis].row(row));
            let (mut m, mut n) = (0, 0);
            let mut out = Vec::with_capacity(pa.len() + pb.len());
            while m < pa.len() || n < pb.len() {
                let at = pa.get(m).copied().unwrap_or(u32::MAX).min(pb.get(n).copied().unwrap_or(u32::MAX));
                let ha = (pa.get(m) == Some(&at)).then(|| a.axes[axis].hits[fa + m]);
                let hb = (pb.get(n) == Some(&at)).then(|| b.axes[axis].hits[fb + n]);
                m += ha.is_some() as usize;
                n += hb.is_some() as usize;
                let hb = match operation {
                    Operation::Difference => hb.map(|h| Hit { normal: -h.normal, ..h }),
                    _ => hb,
                };
                let hit = match (ha, hb) {
                    (Some(x), Some(y)) => {
                        // From inside to outside along the axis, both the same way: else no end differs.
                        let outward = x.normal[axis] + y.normal[axis] > 0.0;
                        let first = if (x.t <= y.t) == outward { x } else { y };
                        let last = if (x.t <= y.t) == outward { y } else { x };
                        if operation == Operation::Union { last } else { first }
                    }
                    (x, y) => x.or(y).unwrap_or(Hit { t: 0.5, normal: glam::DVec3::X }),
                };
                out.push(Placed { row: row as u32, at, hit });
            }
            out
        })
        .collect();
    Hits::sorted(rows, placed)
}

/// The field of everything that is outside: its sides and normals turned.
pub fn complement(a: &Directed) -> Directed {
    let mut all = a.clone();
    let lattice = a.lattice;
    let (words, nodes) = (lattice.words(), lattice.nodes(0));
    all.sides = Sides::from_rows((0..lattice.rows()).map(|row| {
        let (mut inside, mut known) = (vec![0; words], vec![0; words]);
        a.sides.bits(row, &mut inside, &mut known);
        inside.iter_mut().for_each(|w| *w = !*w);
        changes_of(&inside, &known, nodes)
    }));
    for hit in all.axes.iter_mut().chain(&mut all.twice).flat_map(|hits| &mut hits.hits) {
        hit.normal = -hit.normal;
    }
    all.values = None;
    all
}
