//! Closed forms: boxes, flat pieces, tori; and what holds of every integer-grid map.

use super::*;
use crate::layout::map::polycube::{Charted, cuboid, flat, random_union, solid, torus};
use crate::layout::map::quarter_turn;
use crate::mesh::next;
use crate::observe::Silent;
use glam::I64Vec2;
use std::collections::HashSet;

/// The map of a made mesh, after a look at everything that must hold of it.
fn squares_of(made: &Charted, lines: &[bool], scale: Scale) -> IntegerMap {
    let found = quantize(&made.mesh, &made.adjacency, &made.map, lines, scale, &Silent).unwrap();
    let at = |h: u32| found.uv[h as usize / 3][h as usize % 3];
    for h in 0..made.map.jump.len() as u32 {
        let o = made.adjacency.opposite[h as usize];
        let along = at(next(h)) - at(h);
        if o != NONE {
            let jump = made.map.jump[h as usize];
            let shift = at(next(o)) - quarter_turn(at(h), jump);
            assert_eq!(shift, shift.round(), "shift over {h}");
            assert_eq!(at(o) - quarter_turn(at(next(h)), jump), shift, "seam at {h}");
        }
        if o == NONE || lines.get(h as usize) == Some(&true) {
            let across = if along.x.abs() > along.y.abs() { (along.y, at(h).y) } else { (along.x, at(h).x) };
            assert_eq!(across, (0.0, across.1.round()), "line at {h}");
        }
        if found.kept.binary_search(&made.mesh.origin(h)).is_ok() {
            assert_eq!(at(h), at(h).round());
        }
    }
    let area: f64 = found.uv.iter().map(|[a, b, c]| (*b - *a).perp_dot(*c - *a) / 2.0).sum();
    assert!((area - found.squares as f64).abs() < 1e-6 * area, "{area} {}", found.squares);
    found
}

/// Triangles of a map that are not counter-clockwise.
fn turned_over(map: &IntegerMap) -> usize {
    map.uv.iter().filter(|[a, b, c]| (*b - *a).perp_dot(*c - *a) <= 0.0).count()
}

#[test]
fn a_cube_keeps_its_8_corners_and_has_6_24_or_54_squares_as_asked_with_and_without_lines() {
    let made = solid(&cuboid([1, 1, 1]), 8).shaken(1);
    for lines in [&made.lines[..], &[]] {
        for (asked, squares) in [(Scale::Coarsest, 6), (Scale::Squares(24), 24), (Scale::Squares(54), 54)] {
            let found = squares_of(&made, lines, asked);
            assert_eq!((found.squares, found.kept.len(), turned_over(&found)), (squares, 8, 0), "{asked:?}");
        }
    }
}

#[test]
fn an_l_of_3_cells_with_a_concave_corner_has_3_12_or_27_squares() {
    let made = flat(&[[0, 0], [1, 0], [0, 1]], 8).shaken(2);
    for (asked, squares) in [(Scale::Coarsest, 3), (Scale::Squares(12), 12), (Scale::Squares(27), 27)] {
        let found = squares_of(&made, &made.lines, asked);
        assert_eq!((found.squares, found.kept.len(), turned_over(&found)), (squares, 6, 0), "{asked:?}");
    }
}

#[test]
fn a_torus_without_cones_keeps_1_vertex_and_has_1_square_or_the_6_or_96_of_its_sides() {
    let made = torus(3, 2, 8).shaken(5);
    for (asked, squares) in [(Scale::Coarsest, 1), (Scale::Squares(6), 6), (Scale::Squares(96), 96)] {
        let found = squares_of(&made, &[], asked);
        assert_eq!((found.squares, found.kept.len()), (squares, 1), "{asked:?}");
    }
}

#[test]
fn a_box_of_1_by_2_by_5_has_6_squares_at_least_and_34_or_136_even_ones_as_asked() {
    let made = solid(&cuboid([1, 2, 5]), 8).shaken(1);
    for lines in [&made.lines[..], &[]] {
        for (asked, squares) in [(Scale::Coarsest, 6), (Scale::Squares(34), 34), (Scale::Squares(136), 136)] {
            let found = squares_of(&made, lines, asked);
            assert_eq!((found.squares, found.kept.len()), (squares, 8), "{asked:?}");
        }
    }
}

#[test]
fn a_plate_with_a_square_hole_keeps_16_corners_and_has_its_32_squares() {
    let ring: Vec<[i32; 3]> = cuboid([3, 3, 1]).into_iter().filter(|v| *v != [1, 1, 0]).collect();
    let made = solid(&ring, 8).shaken(1);
    for asked in [Scale::Coarsest, Scale::Squares(32)] {
        let found = squares_of(&made, &made.lines, asked);
        assert_eq!((found.squares, found.kept.len(), turned_over(&found)), (32, 16, 0), "{asked:?}");
    }
}

#[test]
fn corners_of_lines_ask_for_the_6_squares_of_a_cube_16_of_32_of_a_plate_with_a_hole_and_2_of_3_of_an_l() {
    let least = |made: &Charted| least_squares(&made.mesh, &made.adjacency, &made.map, &made.lines);
    let ring: Vec<[i32; 3]> = cuboid([3, 3, 1]).into_iter().filter(|v| *v != [1, 1, 0]).collect();
    assert_eq!(least(&solid(&cuboid([1, 1, 1]), 8).shaken(1)), 6);
    assert_eq!(least(&solid(&ring, 8).shaken(1)), 16);
    assert_eq!(least(&flat(&[[0, 0], [1, 0], [0, 1]], 8).shaken(2)), 2);
    assert_eq!(least(&torus(3, 2, 8)), 0);
}

#[test]
fn components_are_counted_together_and_one_without_a_cone_is_kept_too() {
    let made = solid(&cuboid([1, 1, 1]), 6).beside(&torus(3, 2, 6)).beside(&flat(&[[0, 0], [1, 0]], 6));
    let found = squares_of(&made, &made.lines, Scale::Coarsest);
    assert_eq!((found.squares, found.kept.len()), (6 + 1 + 1, 8 + 1 + 4));
    // Squares are as large on all surfaces; those of the torus are uneven.
    let found = squares_of(&made, &made.lines, Scale::Squares(14)).squares;
    assert!((12..=16).contains(&found), "{found}");
}

#[test]
fn uneven_unions_of_10_to_40_voxels_meet_3_and_5_times_their_sides_within_20_percent_and_keep_all_cones() {
    for (seed, voxels) in [(2, 10), (3, 20), (4, 40)] {
        let made = solid(&random_union(seed, voxels), 5).shaken(seed).stretched();
        for lines in [&made.lines[..], &[]] {
            for asked in [3 * made.sides, 5 * made.sides] {
                let found = squares_of(&made, lines, Scale::Squares(asked));
                let off = found.squares as f64 / asked as f64;
                assert!((0.8..1.2).contains(&off), "{} of {asked}, {voxels} voxels", found.squares);
                assert_eq!(found, squares_of(&made, lines, Scale::Squares(asked)));
            }
            let coarsest = squares_of(&made, lines, Scale::Coarsest);
            assert!(coarsest.squares <= made.sides, "{} of {} sides", coarsest.squares, made.sides);
            let kept: HashSet<u32> = coarsest.kept.iter().copied().collect();
            let inner =
                |v: &u32| made.adjacency.fan(*v).map(|h| made.map.jump[h as usize] as usize).sum::<usize>() % 4 != 0;
            assert!((0..made.mesh.points.len() as u32).filter(inner).all(|v| kept.contains(&v)));
        }
    }
}

#[test]
fn another_order_of_the_triangles_changes_the_number_of_squares_by_less_than_15_percent() {
    let made = solid(&random_union(7, 20), 5).shaken(7).stretched();
    for scale in [Scale::Coarsest, Scale::Squares(2 * made.sides)] {
        let one = squares_of(&made, &[], scale).squares as f64;
        for seed in 0..3 {
            let other = squares_of(&made.reordered(seed), &[], scale).squares as f64;
            assert!((other / one - 1.0).abs() < 0.15, "{other} for {one}");
        }
    }
}

#[test]
fn charts_turned_and_shifted_at_will_with_seams_that_fit_to_rounding_give_the_same_squares() {
    let made = solid(&cuboid([1, 2, 5]), 8).shaken(1).recharted(4);
    for lines in [&made.lines[..], &[]] {
        for (asked, squares) in [(Scale::Coarsest, 6), (Scale::Squares(34), 34)] {
            let found = squares_of(&made, lines, asked);
            assert_eq!((found.squares, found.kept.len()), (squares, 8), "{asked:?}");
        }
    }
    let made = solid(&random_union(9, 20), 6).shaken(9).stretched().recharted(5);
    let found = squares_of(&made, &made.lines, Scale::Squares(3 * made.sides));
    assert!((found.squares as f64 / (3 * made.sides) as f64 - 1.0).abs() < 0.2);
}

#[test]
fn a_map_with_a_triangle_turned_over_and_one_that_does_not_fit_are_refused() {
    let made = solid(&cuboid([1, 1, 1]), 4);
    let refused = |map: &SeamlessMap| {
        quantize(&made.mesh, &made.adjacency, map, &[], Scale::Coarsest, &Silent).map(|m| m.squares)
    };
    let mut over = made.map.clone();
    over.uv[17].swap(0, 1);
    assert_eq!(refused(&over), Err(QuantizeError::Flipped { triangle: 17 }));
    let mut torn = made.map.clone();
    for p in torn.uv.iter_mut().take(16).flatten() {
        p.x *= 3.0;
    }
    assert!(matches!(refused(&torn), Err(QuantizeError::Torn)), "{:?}", refused(&torn));
}

#[test]
fn a_cancelled_observer_stops_it() {
    struct Stop;
    impl Observer for Stop {
        fn progress(&self, _: f64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let made = solid(&cuboid([1, 1, 1]), 4);
    let found = quantize(&made.mesh, &made.adjacency, &made.map, &[], Scale::Coarsest, &Stop);
    assert_eq!(found, Err(QuantizeError::Cancelled(Cancelled)));
}

#[test]
fn columns_and_rows_of_an_l_get_numbers_of_squares_that_none_beats_with_one_more_or_less() {
    let (widths, heights, fine) = ([0.6, 2.7], [1.2, 1.8], 4);
    let mut made = flat(&[[0, 0], [1, 0], [0, 1]], fine);
    let along = |x: f64, sizes: [f64; 2]| sizes[0] * x.min(1.0) + sizes[1] * (x - 1.0).max(0.0);
    for p in made.map.uv.iter_mut().flatten() {
        *p /= f64::from(fine);
        *p = DVec2::new(along(p.x, widths), along(p.y, heights));
    }
    let mut thinned = Flat::new(&made.mesh, &made.adjacency, &made.map, &made.lines);
    let stays = thin::corners(&thinned);
    thin::thin(&mut thinned, &stays, &Silent).unwrap();
    let parts = vec![DVec2::ONE; made.mesh.triangles.len()];
    let mut whole = Whole::start(thinned.compact(), 3.0, &Silent).unwrap().unwrap();
    form::descend(&mut whole, &parts, 1.0, 0.0, &Silent).unwrap();
    // Edges join corners at the ends of columns and rows.
    let image = |d: f64, sizes: [f64; 2], numbers: [i64; 2]| {
        let ends =
            [(0.0, 0), (sizes[0], numbers[0]), (sizes[1], numbers[1]), (sizes[0] + sizes[1], numbers[0] + numbers[1])];
        let end = ends.into_iter().find(|end| (end.0 - d.abs()).abs() < 1e-9).expect("an end");
        if d < 0.0 { -end.1 } else { end.1 }
    };
    let vectors = |columns: [i64; 2], rows: [i64; 2]| -> Vec<I64Vec2> {
        let vector = |e: &DVec2| I64Vec2::new(image(e.x, widths, columns), image(e.y, heights, rows));
        whole.flat.edge.iter().map(vector).collect()
    };
    let form = form::Form::new(&whole, &parts, 1.0, 0.0);
    let mut other = whole.clone();
    let mut energy = |q: Vec<I64Vec2>| {
        other.q = q;
        form.sum(&other, 0..other.flat.len())
    };
    // Both numbers of columns, then those of rows.
    let with = |numbers: [i64; 4]| vectors([numbers[0], numbers[1]], [numbers[2], numbers[3]]);
    let digits = |n: usize| -> [i64; 4] { std::array::from_fn(|i| (n / 5usize.pow(i as u32) % 5) as i64 + 1) };
    let found = (0..5usize.pow(4)).map(digits).find(|&numbers| with(numbers) == whole.q).expect("1 to 5 squares");
    let least = energy(whole.q.clone());
    for (k, by) in (0..4).flat_map(|k| [(k, 1), (k, -1)]) {
        let mut numbers = found;
        numbers[k] += by;
        assert!(energy(with(numbers)) > least, "{numbers:?} for {found:?}");
    }
    assert_eq!(found[..2], [1, 3]);
}
