//! `planish transform`: a mesh or a scan moved, turned, scaled, mirrored, cropped, or fitted on another.

use super::{Session, write_failure};
use crate::args::{Step, SurfaceWord, Transform};
use crate::failure::{Failure, Status};
use crate::files;
use crate::placed;
use crate::products::Staged;
use crate::progress;
use crate::shapes::{self, Located};
use crate::summary::Summary;
use glam::DMat3;
use planish::DVec3;
use planish::geom::Aabb;
use planish::model::Units;
use planish::observe::Observer;
use planish::pipeline::key;
use planish::pipeline::{Figure, Warning};
use planish::register::{self, AlignError, AlignParams, HalfSpace, Placement, Shape};
use planish_io::WriteOptions;
use planish_io::report::{Report, count, number};
use std::path::Path;

pub fn transform(session: &Session, args: &Transform) -> Result<Status, Failure> {
    let formats = ["ply", "obj", "stl", "glb", "las", "laz", "e57", "xyz"];
    files::check_extension(&args.output, &formats)?;
    if args.steps.0.is_empty() {
        return Err(Failure::usage("transform", "no step is given").hint("give --move, --turn, --up ...; see --help"));
    }
    let staged = Staged::file(&args.output)?;
    let own_report = session.stage_report()?;
    if files::is_model(&args.input) {
        let hint = "write a mesh of it with `planish export`, or its surfaces as STEP";
        return Err(Failure::input(&args.input, "is a model, whose network and maps would not move along").hint(hint));
    }
    let (located, read) = session.step("read", || shapes::read(&args.input, &args.scan, SurfaceWord::Base))?;
    let units = session.units_of(&args.input);
    check_format(&located.shape, &args.output)?;
    let mut report = Report::new("transform", shapes::facts(&args.input, &located.shape, units));
    let mut work = Work { session, args, located, units, about: Some(DVec3::ZERO), told: Vec::new() };
    let (made, record) = session.bars.step("transform", |o| work.run(o));
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    made?;
    let Work { located, told, .. } = work;
    let left = located.shape.points().len();
    let bounds = Aabb::of(located.shape.points().iter().filter(|p| p.is_finite()));
    let moved = write(&staged.file_path(), args, located, units)?;
    report.warnings.extend(moved);
    report.stages = vec![read, record];
    let is_scan = report.input.kind == "scan";
    let what = if is_scan { key::SCAN_POINTS } else { key::MESH_VERTICES };
    report.quality.insert(what.into(), Figure::Count(left as u64));
    if session.hand_over([staged], own_report, &report)? {
        let mut table = Summary::default();
        table.row("input", report.input.path.clone());
        told.into_iter().for_each(|(name, text)| _ = table.row(name, text));
        table.row(if is_scan { "points" } else { "vertices" }, count(left as u64));
        let size = bounds.size().to_array().map(number).join(" x ");
        table.row("size", format!("{size} {}", report.input.units));
        table.row("written", args.output.display().to_string());
        table.print();
    }
    Ok(Status::Done)
}

/// Refuses formats that hold nothing of this kind.
fn check_format(shape: &Shape, output: &Path) -> Result<(), Failure> {
    if shape.is_scan() {
        files::check_extension(output, &planish_io::WRITTEN_SCANS)
    } else {
        files::check_extension(output, &["ply", "obj", "stl", "glb"])
    }
}

/// The shape on its way through the steps.
struct Work<'a> {
    session: &'a Session,
    args: &'a Transform,
    located: Located,
    units: Units,
    /// What turns leave where it is, in the coordinates of the file; none for the middle of the box.
    about: Option<DVec3>,
    /// Lines of the table.
    told: Vec<(&'static str, String)>,
}

impl Work<'_> {
    fn run(&mut self, observer: &dyn Observer) -> Result<(), Failure> {
        let count = self.args.steps.0.len();
        for (k, step) in self.args.steps.0.iter().enumerate() {
            observer.check().map_err(|_| Failure::interrupted())?;
            observer.progress(k as f64 / count as f64);
            self.step(step, observer)?;
        }
        Ok(())
    }

    fn step(&mut self, step: &Step, observer: &dyn Observer) -> Result<(), Failure> {
        match step {
            Step::Move(by) => self.place(&Placement { linear: DMat3::IDENTITY, shift: *by }),
            Step::Turn(axis, degrees) => self.linear(turn(*axis, *degrees)),
            Step::Scale(by) => self.linear(DMat3::from_diagonal(*by)),
            Step::Mirror(n) => {
                let double = DMat3::from_cols(*n * n.x, *n * n.y, *n * n.z) * 2.0;
                self.linear(DMat3::IDENTITY - double)
            }
            Step::About(place) => self.about = *place,
            // Exactly: a quarter of a turn has no rounding.
            Step::Up(true) => self.place(&Placement { linear: quarter(-1.0), shift: DVec3::ZERO }),
            Step::Up(false) => self.place(&Placement { linear: quarter(1.0), shift: DVec3::ZERO }),
            Step::Crop(sides) => self.crop(sides)?,
            Step::Align(path) => self.align(path, observer)?,
            Step::Pairs(path) => {
                let placement = pairs(path, self.located.shift)?;
                self.told.push(("points", format!("turned by {} degrees", number(placement.turn_deg()))));
                // The pairs were brought near the origin, as the shape is.
                self.near(&placement);
            }
        }
        Ok(())
    }

    /// A map around the place that stays.
    fn linear(&mut self, linear: DMat3) {
        let bounds = Aabb::of(self.located.shape.points().iter().filter(|p| p.is_finite()));
        let about = self.about.unwrap_or(bounds.center() + self.located.shift);
        self.place(&Placement::about(linear, about));
    }

    /// A move in the coordinates of the file. Far shapes stay near the origin, by whole numbers.
    fn place(&mut self, placement: &Placement) {
        let far = placement.point(self.located.shift);
        let shift = if self.located.shift == DVec3::ZERO { DVec3::ZERO } else { far.round() };
        self.near(&Placement { linear: placement.linear, shift: far - shift });
        self.located.shift = shift;
    }

    /// A move in the coordinates near the origin.
    fn near(&mut self, placement: &Placement) {
        match &mut self.located.shape {
            Shape::Surface(mesh) => placement.mesh(mesh),
            Shape::Points(cloud) => placement.cloud(cloud),
        }
    }

    fn crop(&mut self, sides: &[HalfSpace]) -> Result<(), Failure> {
        for side in sides {
            let side = HalfSpace { offset: side.offset - side.normal.dot(self.located.shift), ..*side };
            match &mut self.located.shape {
                Shape::Surface(mesh) => {
                    let (cut, tags) = register::crop_mesh(mesh, self.located.tags.as_ref(), &side);
                    (*mesh, self.located.tags) = (cut, tags);
                }
                Shape::Points(cloud) => *cloud = register::crop_cloud(cloud, &side),
            }
        }
        let is_empty = match &self.located.shape {
            Shape::Surface(mesh) => mesh.triangles.is_empty(),
            Shape::Points(cloud) => cloud.points.is_empty(),
        };
        if is_empty {
            let what = "has nothing on that side of the crop";
            return Err(Failure::usage(&self.args.input, what).hint("see its box with `planish info`"));
        }
        Ok(())
    }

    fn align(&mut self, path: &Path, observer: &dyn Observer) -> Result<(), Failure> {
        let mut other = shapes::read(path, &self.args.scan, SurfaceWord::Base)?;
        let units = other.units.unwrap_or_else(|| self.session.units_of(path));
        let scale = units.metres() / self.units.metres();
        let apart = other.shift * scale - self.located.shift;
        other.shape.points_mut().iter_mut().for_each(|p| *p = *p * scale + apart);
        let params = AlignParams { seed: self.session.common.seed.unwrap_or_default(), ..AlignParams::default() };
        let found = register::align(&self.located.shape, &other.shape, &params, observer).map_err(|e| match e {
            AlignError::Cancelled(_) => Failure::interrupted(),
            e => Failure::input(path, format!("cannot be fitted on: {e}"))
                .hint("look for faults in both with `planish info`"),
        })?;
        let text = format!(
            "turned by {} degrees; median distance {} before, {} {} after",
            number(found.placement.turn_deg()),
            number(found.median[0]),
            number(found.median[1]),
            self.units
        );
        self.told.push(("best fit", text));
        self.near(&found.placement);
        Ok(())
    }
}

/// A turn; of whole quarters exactly.
fn turn(axis: DVec3, degrees: f64) -> DMat3 {
    let m = DMat3::from_axis_angle(axis, degrees.to_radians());
    let is_quarter = degrees % 90.0 == 0.0 && axis.abs().max_element() == 1.0;
    if !is_quarter {
        return m;
    }
    let exact = |v: DVec3| DVec3::from_array(v.to_array().map(f64::round));
    DMat3::from_cols(exact(m.x_axis), exact(m.y_axis), exact(m.z_axis))
}

/// A quarter of a turn around the first axis: 1 brings y to z, -1 brings z to y.
fn quarter(side: f64) -> DMat3 {
    DMat3::from_cols(DVec3::X, DVec3::Z * side, DVec3::Y * -side)
}

/// The best move of pairs of points from a file, with `shift` taken off both sides.
fn pairs(path: &Path, shift: DVec3) -> Result<Placement, Failure> {
    let bytes = planish_io::read_bytes(path).map_err(|e| Failure::input(path, e))?;
    let text = String::from_utf8(bytes)
        .map_err(|_| Failure::input(path, "is no text in UTF-8").hint("save it again as UTF-8"))?;
    let mut pairs = Vec::new();
    for (line, text) in text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty() && !l.trim().starts_with('#')) {
        let numbers: Option<Vec<f64>> = text
            .split([',', ';', ' ', '\t'])
            .filter(|w| !w.is_empty())
            .map(|w| w.parse().ok().filter(|x: &f64| x.is_finite()))
            .collect();
        let Some([a, b, c, x, y, z]) = numbers.and_then(|n| <[f64; 6]>::try_from(n).ok()) else {
            return Err(Failure::input(path, format!("is no row of six numbers (line {})", line + 1))
                .hint("write x, y, z of a place now and x, y, z of where it is to go"));
        };
        pairs.push([DVec3::new(a, b, c) - shift, DVec3::new(x, y, z) - shift]);
    }
    Placement::of_pairs(&pairs).map_err(|e| Failure::input(path, super::with_hint(&e.to_string())))
}

/// Writes the shape in its place; the warning tells of a format that cannot hold it.
fn write(staged: &Path, args: &Transform, located: Located, units: Units) -> Result<Option<Warning>, Failure> {
    let wrong = |e| write_failure(&args.input, &args.output, e);
    match located.shape {
        Shape::Surface(mut mesh) => {
            // A move may have brought it far away, or back.
            let by = planish_io::shift_of(&mesh.bounds());
            mesh.points.iter_mut().for_each(|p| *p -= by);
            let options = WriteOptions { units, ..WriteOptions::default() };
            let tags = located.tags.unwrap_or_default();
            placed::write(staged, &mesh, &tags, located.shift + by, &options).map_err(wrong)
        }
        Shape::Points(mut cloud) => {
            let ids: Vec<u32> =
                (0..cloud.points.len() as u32).filter(|&i| cloud.points[i as usize].is_finite()).collect();
            if ids.len() < cloud.points.len() {
                cloud = cloud.select(&ids);
            }
            cloud.shift = located.shift;
            planish_io::write_scan_in(staged, &cloud, units).map_err(wrong)?;
            Ok(None)
        }
    }
}
