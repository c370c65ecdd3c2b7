//! One cell: its corners, edges and faces, and the loops in which the surface passes its boundary.
//!
//! Corner `c` has its coordinates in its bits (x, y, z from the lowest). Edges 0..4 run along x, 4..8 along y, 8..12
//! along z; edge and face tables below follow. A face is passed counter-clockwise seen from outside the cell; where a
//! walk around it enters the body and where it leaves it again are joined by a segment. Every crossed edge is entered
//! in one of its faces and left in the other, so segments chain into closed loops, and these run counter-clockwise
//! around the patch seen from outside the body. What is done in a face depends on that face alone: the loops of two
//! neighbours fit ([K01] §4 takes the table of 1987, which does not).

pub(crate) mod caps;
pub(crate) mod crossings;
pub(crate) mod face;
pub(crate) mod feature;
pub(crate) mod patch;
pub(crate) mod topology;
pub(crate) mod twice;

/// Vertices inside a cell, and points of a face, are kept this far from its sides, as a fraction of its size.
const MARGIN: f64 = 0.004;
/// Fraction of [`MARGIN`] from which on they stay where they are.
const UNMOVED_SHARE: f64 = 1e-3;

/// Corners of each edge.
pub const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// Corners of each face (x = 0, x = 1, y = 0, y = 1, z = 0, z = 1), counter-clockwise seen from outside.
pub const FACES: [[usize; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// Edges of each face, from corner m to m + 1 of [`FACES`].
pub const FACE_EDGES: [[usize; 4]; 6] =
    [[8, 6, 10, 4], [5, 11, 7, 9], [0, 9, 2, 8], [10, 3, 11, 1], [4, 1, 5, 0], [2, 7, 3, 6]];

/// Bits of the two faces of each edge.
pub const EDGE_FACES: [u8; 12] = edge_faces();

/// Edges that are crossed, for each pattern of inside corners.
pub const CROSSED: [u16; 256] = crossed();

/// Faces whose corners alternate, for each pattern of inside corners.
pub const AMBIGUOUS: [u8; 256] = ambiguous();

/// For each pattern of inside corners the only loop, if there is one and no face is ambiguous: number of its edges, and
/// these in their order; else none.
pub const RING: [(u8, [u8; 6]); 256] = rings();

const fn rings() -> [(u8, [u8; 6]); 256] {
    let mut table = [(0, [0; 6]); 256];
    let mut config = 1;
    while config < 255 {
        if AMBIGUOUS[config] == 0 {
            let next = chain(config as u8, 0).next;
            let first = CROSSED[config].trailing_zeros() as usize;
            let (mut ring, mut count, mut e) = ([0; 6], 0, first);
            while count == 0 || e != first {
                // No face is passed twice.
                ring[count] = e as u8;
                count += 1;
                e = next[e] as usize;
            }
            if count as u32 == CROSSED[config].count_ones() {
                table[config] = (count as u8, ring);
            }
        }
        config += 1;
    }
    table
}

const fn edge_faces() -> [u8; 12] {
    let mut bits = [0; 12];
    let mut f = 0;
    while f < 6 {
        let mut m = 0;
        while m < 4 {
            bits[FACE_EDGES[f][m]] |= 1 << f;
            m += 1;
        }
        f += 1;
    }
    bits
}

const fn crossed() -> [u16; 256] {
    let mut table = [0; 256];
    let mut config = 0;
    while config < 256 {
        let mut e = 0;
        while e < 12 {
            if (config >> EDGES[e][0]) & 1 != (config >> EDGES[e][1]) & 1 {
                table[config] |= 1 << e;
            }
            e += 1;
        }
        config += 1;
    }
    table
}

const fn ambiguous() -> [u8; 256] {
    let mut table = [0; 256];
    let mut config = 0;
    while config < 256 {
        let mut f = 0;
        while f < 6 {
            let c = FACES[f];
            let (a, b) = ((config >> c[0]) & 1, (config >> c[1]) & 1);
            if a != b && (config >> c[2]) & 1 == a && (config >> c[3]) & 1 == b {
                table[config] |= 1 << f;
            }
            f += 1;
        }
        config += 1;
    }
    table
}

/// Loops of one cell, as a chain over its crossed edges.
#[derive(Clone, Copy)]
pub struct Chain {
    /// For each crossed edge the edge that follows in its loop.
    pub next: [u8; 12],
    /// The face in which the segment to it lies.
    pub face: [u8; 12],
}

/// [`chain`] with no faces joined.
static CHAINS: [Chain; 256] = {
    let mut table = [chain(0, 0); 256];
    let mut config = 1;
    while config < 256 {
        table[config] = chain(config as u8, 0);
        config += 1;
    }
    table
};

/// [`chain`], from a table where it can.
pub fn links(config: u8, joined: u8) -> Chain {
    if joined == 0 { CHAINS[config as usize] } else { chain(config, joined) }
}

/// The chain of a pattern of inside corners.
/// * `joined` - bits of the ambiguous faces in which the inside corners are joined across the face
pub const fn chain(config: u8, joined: u8) -> Chain {
    let mut chain = Chain { next: [u8::MAX; 12], face: [0; 12] };
    let open = AMBIGUOUS[config as usize];
    let mut f = 0;
    while f < 6 {
        let (c, e) = (&FACES[f], &FACE_EDGES[f]);
        let inside = [config >> c[0] & 1, config >> c[1] & 1, config >> c[2] & 1, config >> c[3] & 1];
        let mut m = 0;
        while m < 4 {
            if inside[m] == 0 && inside[(m + 1) % 4] != 0 {
                let mut leave = (m + 1) % 4;
                if open >> f & 1 == 0 {
                    while inside[leave] == 0 || inside[(leave + 1) % 4] != 0 {
                        leave = (leave + 1) % 4;
                    }
                } else if joined >> f & 1 != 0 {
                    leave = (m + 3) % 4;
                }
                chain.next[e[m]] = e[leave] as u8;
                chain.face[e[m]] = f as u8;
            }
            m += 1;
        }
        f += 1;
    }
    chain
}

/// In a face with alternating corners: true if the inside corners are joined.
///
/// The asymptotic decider (Nielson and Hamann 1991): the sign of the bilinear saddle, which the ratios of the values
/// along the four edges give without the values. `t` are the hits as fractions of the edges u at v = 0, u at v = 1,
/// v at u = 0, v at u = 1; `origin_inside` whether corner (0, 0) is inside.
pub fn joined_by_hits(t: [f64; 4], origin_inside: bool) -> bool {
    // |f00| / |f10| = t / (1 - t) and so on; the product of both estimates of |f00 f11| / |f10 f01|.
    let over = t[0] * (1.0 - t[1]) * t[2] * (1.0 - t[3]);
    let under = (1.0 - t[0]) * t[1] * (1.0 - t[2]) * t[3];
    if origin_inside { over > under } else { over < under }
}

/// [`joined_by_hits`] from the values at (0, 0), (1, 0), (0, 1), (1, 1).
pub fn joined_by_values(f: [f64; 4]) -> bool {
    let (one, other) = (f[0] * f[3], f[1] * f[2]);
    if f[0] < 0.0 { one > other } else { one < other }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pattern_and_decision_gives_closed_loops_that_use_each_crossed_edge_once() {
        for config in 0..=255u8 {
            for joined in 0..64u8 {
                if joined & !AMBIGUOUS[config as usize] != 0 {
                    continue;
                }
                let chain = chain(config, joined);
                let crossed = CROSSED[config as usize];
                let mut targets = 0u16;
                for e in (0..12).filter(|e| crossed >> e & 1 != 0) {
                    let next = chain.next[e] as usize;
                    assert!(next < 12 && crossed >> next & 1 != 0, "{config} {joined}");
                    assert_eq!(targets >> next & 1, 0);
                    targets |= 1 << next;
                    assert!(EDGE_FACES[e] & EDGE_FACES[next] & 1 << chain.face[e] != 0);
                }
                assert_eq!(targets, crossed);
            }
        }
    }

    #[test]
    fn edges_of_faces_join_their_corners() {
        for f in 0..6 {
            for m in 0..4 {
                let mut ends = [FACES[f][m], FACES[f][(m + 1) % 4]];
                ends.sort();
                assert_eq!(EDGES[FACE_EDGES[f][m]], ends);
            }
        }
    }

    #[test]
    fn one_inside_corner_gives_a_triangle_that_faces_away_from_it() {
        let chain = chain(1, 0);
        assert_eq!((chain.next[0], chain.next[4], chain.next[8]), (4, 8, 0));
    }
}
