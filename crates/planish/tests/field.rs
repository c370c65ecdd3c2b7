//! Directed fields: sources against each other, CSG on directed distances.

mod common;

use planish::contour::{ContourParams, extract};
use planish::field::csg::{Operation, combine, complement};
use planish::field::{Directed, Field, Lattice, MeshField, Part, Solid, Spacing, sample};
use planish::geom::Aabb;
use planish::mesh::{diagnose, self_intersections};
use planish::synthetic::shapes;
use planish::{DVec3, Silent};

fn lattice(n: usize) -> Lattice {
    Lattice::around(&Aabb { min: DVec3::splat(-1.2), max: DVec3::splat(1.2) }, Spacing::Resolution(n)).unwrap()
}

fn ball(x: f64) -> Solid {
    Solid::Sphere { radius: 0.7 }.moved(DVec3::new(x, 0.05, 0.0))
}

fn block() -> Solid {
    Solid::Cuboid { size: DVec3::new(1.1, 0.9, 1.4), round: 0.0 }.turned(DVec3::new(1.0, 1.0, 0.2), 20.0)
}

/// Sides of all nodes, and hits.
fn same(a: &Directed, b: &Directed) -> bool {
    a.sides.changes == b.sides.changes
        && a.sides.start == b.sides.start
        && (0..3).all(|k| a.axes[k].at == b.axes[k].at && a.axes[k].hits == b.axes[k].hits)
}

#[test]
fn a_mesh_and_its_formula_give_the_same_sides_but_where_facets_fall_short() {
    let l = lattice(40);
    let mesh = shapes::sphere(0.8, 5);
    let field = MeshField::new(&mesh).unwrap();
    let (a, b) = (field.sample(&l, &Silent).unwrap(), sample(&Solid::Sphere { radius: 0.8 }, &l, &Silent).unwrap());
    assert_eq!(a.mended, 0);
    let (m, n) = (a.hit_count() as f64, b.hit_count() as f64);
    assert!((m / n - 1.0).abs() < 0.01, "{m} {n}");
    for axis in 0..3 {
        for row in 0..l.rows() {
            let (places, first) = b.axes[axis].row(row);
            for (k, &at) in places.iter().enumerate() {
                if let Some(hit) = a.axes[axis].find(row, at as usize) {
                    let exact = b.axes[axis].hits[first + k];
                    // Near a grazing line a facet is far off along the line.
                    if exact.normal[axis].abs() > 0.3 {
                        assert!((hit.t - exact.t).abs() < 0.05, "{hit:?} {exact:?}");
                    }
                    assert!(hit.normal.dot(exact.normal) > 0.99);
                }
            }
        }
    }
}

#[test]
fn hits_of_solids_lie_on_the_surface_to_1e_12_of_the_cell() {
    let l = lattice(30);
    let tree = block().difference(ball(0.5)).union(ball(-0.9));
    let field = sample(&tree, &l, &Silent).unwrap();
    assert!(field.hit_count() > 1000);
    for axis in 0..3 {
        for row in 0..l.rows() {
            let (places, first) = field.axes[axis].row(row);
            for k in 0..places.len() {
                let p = field.position(axis, row, first + k);
                assert!(tree.value(p).abs() < 1e-9 * l.step.x, "{p}: {}", tree.value(p));
            }
        }
    }
}

#[test]
fn combining_fields_is_combining_solids_but_where_an_edge_is_passed_twice() {
    let l = lattice(48);
    let (a, b) = (sample(&block(), &l, &Silent).unwrap(), sample(&ball(0.5), &l, &Silent).unwrap());
    let both = [
        (Operation::Union, block().union(ball(0.5))),
        (Operation::Intersection, block().intersection(ball(0.5))),
        (Operation::Difference, block().difference(ball(0.5))),
    ];
    for (operation, solid) in both {
        let made = combine(&a, &b, operation);
        let exact = sample(&solid, &l, &Silent).unwrap();
        assert_eq!(made.mended, 0);
        assert_eq!(made.sides.changes, exact.sides.changes, "{operation:?}");
        for axis in 0..3 {
            assert_eq!(made.axes[axis].at, exact.axes[axis].at);
            for (x, y) in made.axes[axis].hits.iter().zip(&exact.axes[axis].hits) {
                assert!((x.t - y.t).abs() < 1e-9 && x.normal.distance(y.normal) < 1e-6, "{operation:?}: {x:?} {y:?}");
            }
        }
    }
}

#[test]
fn a_without_a_is_empty_a_with_a_is_a_and_de_morgan_holds() {
    let l = lattice(40);
    let (a, b) = (sample(&block(), &l, &Silent).unwrap(), sample(&ball(0.5), &l, &Silent).unwrap());
    assert_eq!(combine(&a, &a, Operation::Difference).hit_count(), 0);
    assert!(same(&combine(&a, &a, Operation::Union), &a));
    assert!(same(&combine(&a, &a, Operation::Intersection), &a));
    // Neither a nor b: outside the union.
    let neither = combine(&complement(&a), &complement(&b), Operation::Intersection);
    let outside = complement(&combine(&a, &b, Operation::Union));
    assert!(same(&neither, &outside));
    assert!(same(&complement(&complement(&a)), &a));
}

#[test]
fn a_mesh_less_a_solid_is_certified_and_has_the_volume_of_both() {
    let mesh = shapes::cuboid(DVec3::splat(1.6), 6);
    let part = Part::combined(
        Operation::Difference,
        vec![
            Part::Mesh(Box::new(planish::field::MeshBody::new(mesh).unwrap())),
            Part::Solid(Solid::Cylinder { radius: 0.4, height: 3.0 }),
        ],
    );
    let sampling = planish::contour::Sampling { spacing: Spacing::Resolution(60), memory: 1 << 30 };
    let made = planish::contour::from_part(&part, sampling, &ContourParams::default(), &Silent).unwrap();
    let d = diagnose(&made.extracted.mesh);
    assert!(d.watertight && d.manifold && d.genus == Some(1));
    assert!(self_intersections(&made.extracted.mesh).is_empty());
    let wanted = 1.6f64.powi(3) - std::f64::consts::PI * 0.16 * 1.6;
    assert!((d.volume.unwrap() / wanted - 1.0).abs() < 1e-3, "{:?} {wanted}", d.volume);
}

/// A ball that is known only on one side of a plane.
struct Half;

impl Field for Half {
    fn bounds(&self) -> Aabb {
        Aabb { min: DVec3::splat(-1.0), max: DVec3::ONE }
    }

    fn value(&self, p: DVec3) -> f64 {
        if p.x > 0.3 { f64::NAN } else { p.length() - 0.8 }
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        p.normalize_or_zero()
    }
}

#[test]
fn where_a_field_is_unknown_the_surface_stays_open_with_one_rim() {
    let field = sample(&Half, &lattice(30), &Silent).unwrap();
    let found = extract(&field, None, &ContourParams::default(), &Silent).unwrap();
    let d = diagnose(&found.mesh);
    assert!(!d.watertight && d.manifold && d.boundary_loops == 1 && d.unreferenced_vertices == 0, "{d:?}");
    assert!(found.mesh.points.iter().all(|p| p.x <= 0.3));
}
