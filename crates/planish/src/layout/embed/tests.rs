use super::*;
use crate::Silent;
use crate::layout::map::polycube::{Charted, cuboid, flat, solid, torus};
use crate::layout::map::quarter_turn;
use crate::layout::proxy::even;
use crate::layout::recut::Bench;
use crate::layout::strips;
use crate::layout::strips::chords::{self, Order};
use crate::mesh::sharp_edges;
use crate::network::imprint::imprint;
use crate::synthetic::shapes;
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, BTreeSet};

/// The map in units in which each side of a voxel, `fine` small squares wide, has `squares` unit squares a side.
fn scaled(made: &Charted, fine: i32, squares: i32) -> SeamlessMap {
    let scale = f64::from(squares) / f64::from(fine);
    SeamlessMap { uv: made.map.uv.iter().map(|t| t.map(|p| p * scale)).collect(), jump: made.map.jump.clone() }
}

/// The complex of a made mesh, checked: embedded, four-sided, of the Euler number of the mesh.
fn checked(made: &Charted, map: &SeamlessMap) -> Complex {
    let complex = embed(&made.mesh, &made.adjacency, &made.lines, map).expect("a complex");
    let edges = (0..made.map.jump.len())
        .filter(|&h| made.adjacency.opposite[h] == NONE || h as u32 > made.adjacency.opposite[h]);
    let euler = made.mesh.points.len() as i64 - edges.count() as i64 + made.mesh.triangles.len() as i64;
    let (nodes, arcs, cells) = (complex.nodes.len(), complex.arcs.len(), complex.cells.len());
    assert_eq!(nodes as i64 - arcs as i64 + cells as i64, euler);
    let bench = Bench::new(&made.mesh, &made.adjacency, complex).expect("every cell where it should be");
    let shapes = bench.shapes();
    let area: f64 = shapes.iter().flatten().map(|s| s.area).sum();
    let whole: f64 = (0..made.mesh.triangles.len()).map(|f| made.mesh.area(f)).sum();
    assert!(shapes.iter().all(Option::is_some) && (area - whole).abs() < 1e-9 * whole);
    bench.complex
}

/// Numbers of arcs of each kind: smooth, feature, boundary.
fn kinds(complex: &Complex) -> [usize; 3] {
    let mut count = [0; 3];
    complex.live_arcs().for_each(|a| count[complex.arc(2 * a).kind as usize] += 1);
    count
}

#[test]
fn a_cube_with_n_by_n_squares_a_side_has_6_n_squared_cells_and_12_n_feature_arcs() {
    for shake in [false, true] {
        for n in 1..=3 {
            let mut cube = solid(&cuboid([1, 1, 1]), 8);
            if shake {
                cube = cube.shaken(n as u64).reordered(5);
            }
            let complex = checked(&cube, &scaled(&cube, 8, n as i32));
            assert_eq!((complex.nodes.len(), complex.cells.len()), (6 * n * n + 2, 6 * n * n));
            assert_eq!(kinds(&complex), [12 * n * n - 12 * n, 12 * n, 0]);
            assert_eq!(complex.nodes.iter().filter(|n| n.stays).count(), 8);
        }
    }
}

#[test]
fn stars_of_a_bent_solid_have_three_to_five_arcs_and_a_bore_keeps_its_euler_number() {
    let bent = [[0, 0, 0], [1, 0, 0], [0, 1, 0]];
    let bored: Vec<[i32; 3]> = cuboid([3, 3, 1]).into_iter().filter(|v| v[0] != 1 || v[1] != 1).collect();
    // Corners that point out have three sides, those that point in have five.
    for (voxels, out, inwards) in [(&bent[..], 10, 2), (&bored[..], 8, 8)] {
        for n in 1..=2 {
            let made = solid(voxels, 7).shaken(11);
            let complex = checked(&made, &scaled(&made, 7, n));
            assert_eq!(complex.cells.len(), made.sides * (n * n) as usize);
            let mut count: BTreeMap<usize, usize> = BTreeMap::new();
            complex.stars().iter().for_each(|s| *count.entry(s.len()).or_default() += 1);
            assert_eq!((count[&3], count[&5], count.len()), (out, inwards, 3));
        }
    }
}

#[test]
fn a_flat_corner_and_a_torus_without_lines_are_cut_into_their_squares() {
    let corner = flat(&[[0, 0], [1, 0], [0, 1]], 6).shaken(2);
    let complex = checked(&corner, &scaled(&corner, 6, 2));
    assert_eq!((complex.nodes.len(), complex.cells.len()), (21, 12));
    assert_eq!(kinds(&complex), [16, 0, 16]);
    let ring = torus(4, 3, 6).shaken(3);
    let complex = checked(&ring, &scaled(&ring, 6, 2));
    assert_eq!((complex.nodes.len(), kinds(&complex), complex.cells.len()), (48, [96, 0, 0], 48));
}

/// The map of the surface of a box by the coordinates of its sides, `squares` unit squares for each unit of length.
fn box_map(mesh: &TriMesh, adjacency: &Adjacency, squares: f64) -> SeamlessMap {
    let low = mesh.bounds().min;
    let chart = |f: usize| {
        let normal = mesh.normal(f);
        let axis = (0..3).find(|&k| normal[k].abs() > 0.5).expect("a side of the box");
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let (a, b) = if normal[axis] > 0.0 { (a, b) } else { (b, a) };
        mesh.corners(f).map(|p| DVec2::new(p[a] - low[a], p[b] - low[b]) * squares)
    };
    let uv: Vec<[DVec2; 3]> = (0..mesh.triangles.len()).map(chart).collect();
    let edge = |h: u32| uv[h as usize / 3][(h as usize % 3 + 1) % 3] - uv[h as usize / 3][h as usize % 3];
    let jump = (0..3 * uv.len() as u32).map(|h| {
        let back = -edge(adjacency.opposite[h as usize]);
        let miss = |j: &u8| quarter_turn(edge(h), *j).distance(back);
        (0..4u8).min_by(|a, b| miss(a).total_cmp(&miss(b))).unwrap_or(0)
    });
    SeamlessMap { jump: jump.collect(), uv }
}

#[test]
fn squares_drawn_on_proxies_that_get_vertices_back_where_they_need_them_are_disks_of_the_fine_box_with_its_12_lines_whole()
 {
    let mesh = shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), 58);
    let sharp = sharp_edges(&mesh, &Adjacency::new(&mesh), 40.0);
    assert!(mesh.triangles.len() > 40_000);
    // The last proxy has fewer vertices than there are corners.
    for (triangles, squares) in [(3_000, 1.0), (3_000, 2.0), (300, 3.0)] {
        let coarse = even(&mesh, &sharp, triangles);
        assert!((29 * triangles / 30..=triangles).contains(&coarse.mesh.triangles.len()));
        let map = box_map(&coarse.mesh, &coarse.adjacency, squares);
        let (proxy, complex) = embed_on(&coarse, &map).expect("a complex");
        assert_eq!(Rc::ptr_eq(&proxy, &coarse), triangles == 3_000);
        let sides = 22 * (squares * squares) as usize;
        assert_eq!((complex.cells.len(), kinds(&complex)[1]), (sides, 24 * squares as usize));
        let (fine, adjacency) = proxy.fine();
        let back = proxy.back(&complex).expect("a way back");
        let length = |a: u32| {
            let places = back.arc(2 * a).chain.iter().map(|p| p.position(fine)).collect::<Vec<_>>();
            places.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>()
        };
        let lines: f64 = back.live_arcs().filter(|&a| back.arc(2 * a).kind == CurveKind::Feature).map(length).sum();
        assert!((lines - 24.0).abs() < 1e-9, "{lines}");
        let along = |a: u32| back.arc(2 * a).chain.iter().all(|p| matches!(p, Place::Vertex(_)));
        assert!(back.live_arcs().filter(|&a| back.arc(2 * a).kind == CurveKind::Feature).all(along));
        let bench = Bench::new(fine, adjacency, back).expect("every cell where it should be");
        let network = proxy.network(&bench.complex);
        let patches = imprint(&mesh, &network, &Silent).expect("every patch a disk");
        assert_eq!(patches.len(), sides);
        let area: f64 = patches.iter().flat_map(|p| (0..p.mesh.triangles.len()).map(|f| p.mesh.area(f))).sum();
        assert!((area - 22.0).abs() < 1e-9);
    }
}

#[test]
fn squares_drawn_on_a_proxy_of_a_sheet_come_back_with_its_whole_boundary() {
    // The last sheet has fewer vertices than there are corners even when it is refined.
    for (cells, triangles, squares) in [(60, 1_000, 4), (60, 40, 6), (4, 40, 20)] {
        let mesh = shapes::rectangle(1.0, 1.0, cells, cells);
        let none = vec![false; 3 * mesh.triangles.len()];
        let coarse = even(&mesh, &none, triangles);
        let chart = |f: usize| coarse.mesh.corners(f).map(|p| p.truncate() * squares as f64);
        let uv = (0..coarse.mesh.triangles.len()).map(chart).collect();
        let map = SeamlessMap { uv, jump: vec![0; coarse.lines.len()] };
        let (proxy, complex) = embed_on(&coarse, &map).expect("a complex");
        assert_eq!(Rc::ptr_eq(&proxy, &coarse), triangles == 1_000);
        let cells = squares * squares;
        assert_eq!(complex.nodes.len(), (squares + 1) * (squares + 1));
        assert_eq!((kinds(&complex), complex.cells.len()), ([2 * cells - 2 * squares, 0, 4 * squares], cells));
        let back = proxy.back(&complex).expect("a way back");
        let (fine, adjacency) = proxy.fine();
        let boundary = back.live_arcs().filter(|&a| back.arc(2 * a).kind == CurveKind::Boundary);
        let vertices: usize = boundary.map(|a| back.arc(2 * a).chain.len() - 1).sum();
        assert_eq!(vertices, adjacency.opposite.iter().filter(|&&o| o == NONE).count());
        assert!(Bench::new(fine, adjacency, back.clone()).is_some());
        assert_eq!(imprint(&mesh, &proxy.network(&back), &Silent).map(|p| p.len()), Ok(cells));
    }
}

#[test]
fn a_mesh_with_fewer_vertices_than_integer_points_is_told_to_be_too_coarse() {
    let cube = solid(&cuboid([1, 1, 1]), 2);
    let map = scaled(&cube, 2, 3);
    let told = embed(&cube.mesh, &cube.adjacency, &cube.lines, &map);
    assert!(matches!(told, Err(EmbedError::Crowded { .. })), "{told:?}");
}

#[test]
fn a_map_of_upright_triangles_that_winds_twice_around_a_vertex_is_told_as_such() {
    let at = |k: u32, turns: f64| DVec2::from_angle(turns * std::f64::consts::TAU * f64::from(k) / 7.0);
    // The middle comes first, for the rim is no line of the grid either.
    let points = [DVec3::ZERO].into_iter().chain((0..7).map(|k| at(k, 1.0).extend(0.0))).collect();
    let mesh = TriMesh::new(points, (0..7).map(|k| [0, 1 + k, 1 + (k + 1) % 7]).collect());
    let uv = (0..7).map(|k| [DVec2::ZERO, at(k, 2.0), at(k + 1, 2.0)]).collect();
    let told = embed(&mesh, &Adjacency::new(&mesh), &[false; 21], &SeamlessMap { uv, jump: vec![0; 21] });
    assert_eq!(told.err(), Some(EmbedError::Wound { vertex: 0 }));
}

#[test]
fn rows_of_arcs_that_no_cone_needs_go_until_a_cube_has_6_cells_and_a_torus_4() {
    let bent = [[0, 0, 0], [1, 0, 0], [0, 1, 0]];
    let bored: Vec<[i32; 3]> = cuboid([3, 3, 1]).into_iter().filter(|v| v[0] != 1 || v[1] != 1).collect();
    let made = [
        (solid(&cuboid([1, 1, 1]), 8), 3, [6, 8, 12]),
        (solid(&bent, 8), 2, [14, 16, 28]),
        (solid(&bored, 8), 3, [32, 32, 64]),
        (flat(&[[0, 0], [1, 0], [0, 1]], 8), 3, [3, 8, 10]),
        (torus(2, 1, 12), 4, [4, 4, 8]),
    ];
    for (made, squares, expected) in made {
        let fine = if made.sides == 2 { 12 } else { 8 };
        let mut complex = checked(&made, &scaled(&made, fine, squares));
        strips::join(&mut complex, |_, _, _| Some(0.0));
        let count = [complex.live_cells().count(), complex.nodes.len(), complex.arcs.len()];
        assert_eq!(count, expected);
        assert!(Bench::new(&made.mesh, &made.adjacency, complex).is_some());
    }
}

#[test]
fn three_squares_in_a_row_become_three_two_or_one_as_the_area_allowed_for_a_cell_says() {
    let sheet = flat(&[[0, 0], [1, 0], [2, 0]], 6).shaken(4);
    for (most, cells) in [(1.5, 3), (2.5, 2), (3.5, 1)] {
        let mut complex = checked(&sheet, &scaled(&sheet, 6, 1));
        let area = |complex: &Complex, c: u32| -> f64 {
            let bench = Bench::new(&sheet.mesh, &sheet.adjacency, complex.clone()).expect("an embedding");
            bench.shapes()[c as usize].as_ref().map_or(0.0, |s| s.area)
        };
        strips::join(&mut complex, |complex, pairs, _| {
            let size = pairs.iter().map(|&[a, b]| area(complex, a) + area(complex, b)).fold(0.0, f64::max);
            (size < most).then_some(size)
        });
        assert_eq!(complex.live_cells().count(), cells);
        assert!(Bench::new(&sheet.mesh, &sheet.adjacency, complex).is_some());
    }
}

/// Number of cells.
fn cells(bench: &Bench) -> usize {
    bench.complex.live_cells().count()
}

#[test]
fn chords_are_closed_until_a_cube_has_6_cells_an_l_14_and_a_torus_4_while_a_bored_plate_keeps_its_32() {
    let bent = [[0, 0, 0], [1, 0, 0], [0, 1, 0]];
    let bored: Vec<[i32; 3]> = cuboid([3, 3, 1]).into_iter().filter(|v| v[0] != 1 || v[1] != 1).collect();
    let made = [
        (solid(&cuboid([1, 1, 1]), 8), 3, 6),
        (solid(&bent, 8), 2, 14),
        // Each of its chords lies between two corners.
        (solid(&bored, 8), 1, 32),
        (torus(2, 1, 12), 4, 4),
    ];
    for (made, squares, expected) in made {
        let fine = if made.sides == 2 { 12 } else { 8 };
        for order in [Order::ByGain, Order::RingsLast] {
            let complex = checked(&made, &scaled(&made, fine, squares));
            let mut bench = Bench::new(&made.mesh, &made.adjacency, complex).expect("an embedding");
            let corners = |bench: &Bench| -> BTreeSet<u32> {
                let is_live = |n: &usize| {
                    bench.complex.live_arcs().any(|a| bench.complex.arc(2 * a).nodes.contains(&(*n as u32)))
                };
                let nodes = (0..bench.complex.nodes.len()).filter(is_live).map(|n| bench.complex.nodes[n]);
                nodes.filter(|n| n.stays).map(|n| n.vertex).collect()
            };
            let before = corners(&bench);
            chords::close(&mut bench, (order, 1), |_, _| Ok::<(), ()>(()), cells).unwrap();

            assert_eq!((bench.complex.live_cells().count(), corners(&bench)), (expected, before));
        }
    }
}

#[test]
fn no_chord_is_closed_below_the_number_of_cells_that_is_asked_for_nor_where_nothing_gets_better() {
    let cube = solid(&cuboid([1, 1, 1]), 8);
    let left = |fewest: usize, price: fn(&Bench) -> usize| {
        let complex = checked(&cube, &scaled(&cube, 8, 3));
        let mut bench = Bench::new(&cube.mesh, &cube.adjacency, complex).expect("an embedding");
        chords::close(&mut bench, (Order::ByGain, fewest), |_, _| Ok::<(), ()>(()), price).unwrap();
        bench.complex.live_cells().count()
    };
    // The first chord has 12 cells.
    assert_eq!([left(1, cells), left(40, cells), left(43, cells), left(1, |_| 0)], [6, 42, 54, 54]);
}
