//! Points to samples.
mod dense;
mod fit;
mod front;
mod moments;
mod quadric;
mod sites;
mod survey;
pub use quadric::Quadric;

use crate::geom::KdTree;
use glam::DVec3;
use rayon::prelude::*;
/// probe
pub fn probe(points: &[DVec3]) -> (Vec<(DVec3, DVec3, u8)>, Vec<(DVec3, DVec3, f64, f64, f64, u8)>) {
    let t = std::time::Instant::now();
    let tree = KdTree::new(points);
    let points: Vec<DVec3> = tree.order().iter().map(|&i| points[i as usize]).collect();
    let tree = KdTree::new(&points);
    eprintln!("tree {:?}", t.elapsed());
    let t = std::time::Instant::now();
    let sites = sites::choose(&points, &tree, &crate::Silent).unwrap();
    eprintln!("sites {} {:?}", sites.point.len(), t.elapsed());
    let t = std::time::Instant::now();
    let fits = front::grow(&points, &tree, &sites, &crate::Silent).unwrap();
    eprintln!("fits {} multi {} {:?}", fits.len(), fits.iter().filter(|f| f.sheets > 1).count(), t.elapsed());
    let centers: Vec<DVec3> = fits.iter().map(|f| f.center).collect();
    let ft = KdTree::new(&centers);
    (points.par_iter().map(|&p| {
        let mut near = Vec::new();
        ft.nearest(p, 8, &mut near);
        let b = near.iter().min_by(|a, b| {
            let s = |x: &(f64, u32)| { let f = &fits[x.1 as usize]; (f.quadric.distance(p).0 / f.noise).powi(2) + 4.0 * x.0 / (f.radius * f.radius) };
            s(a).total_cmp(&s(b))
        }).unwrap();
        let f = &fits[b.1 as usize];
        let (q, n) = f.quadric.project(p);
        (q, n, f.sheets)
    }).collect(), fits.iter().map(|f| (f.center, f.normal, f.radius, f.noise, f.error, f.class + 10 * f.sheets)).collect())
}
