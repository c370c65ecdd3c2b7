//! STEP (ISO 10303-21, application protocol 242): B-spline patches as solids and shells with shared edges.
//!
//! 1. the sides of all patches are held against each other: every curve has one row of control points
//! 2. patches joined by curves form components; one without a free curve is a solid, the others open shells
//! 3. one face per patch, one edge per curve, one vertex per corner, shared by all that meet there
//! 4. every edge brings its curve in the parameters of both surfaces (PCURVE), so no kernel has to project it
//! 5. faces, edges and components have the numbers of the report as names, and faces the colours of its picture
//!
//! The edge's curve is the boundary row of control points of the first patch along it, so a seam whose two
//! rows are equal has no gap at all, and no kernel has to sew or to loosen a tolerance.

use super::style;
use super::text::{Entities, list, real, text};
use crate::topology::{self, Component, Topology};
use crate::{Place, WriteError, atomic};
use planish::Units;
use planish::geom::Aabb;
use planish::network::Network;
use planish::surface::Surface;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Accuracy that the file claims at least, as a fraction of the diagonal: what CAD kernels work with.
const ACCURACY: f64 = 1e-7;

/// What a STEP file is made of.
#[derive(Clone, Copy, Debug)]
pub struct StepInput<'a> {
    /// Which patch meets which along which curve.
    pub network: &'a Network,
    /// One surface per patch of the network.
    pub surfaces: &'a [Surface],
    /// What one unit of a coordinate is; the numbers are written as they are.
    pub units: Units,
    /// Name of the product.
    pub name: &'a str,
    /// Time for the header as `2026-01-31T12:00:00`; without one a fixed time, so that the same model gives
    /// the same bytes.
    pub time: Option<&'a str>,
}

/// What was written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepSummary {
    /// Closed components, each a solid.
    pub solids: usize,
    /// Components with a free curve, each an open shell.
    pub shells: usize,
    /// Faces: the patches.
    pub faces: usize,
    /// Edges: the curves that patches use.
    pub edges: usize,
    /// Largest distance between the control points of the two sides of a seam, input units.
    pub gap_max: f64,
}

/// Writes patches as AP242: a `MANIFOLD_SOLID_BREP` per closed component, a `SHELL_BASED_SURFACE_MODEL` for the
/// open ones. Faces are named `patch 17`, edges `curve 12`, by their numbers in the network, solids and shells `piece 1`, in the
/// order of their first patch; faces have the colours of [`planish::render::even_colors`]. Normals point outside. The file
/// appears whole or not at all.
/// # Errors
/// `WriteError::Nothing` without surfaces; `WriteError::Inconsistent` if surfaces and network do not belong
/// together, a curve has more than two sides, its two patches run along it in the same direction, or they have
/// different numbers of control points there; `WriteError::Value` for a control point that is not finite.
pub fn write_step(path: impl AsRef<Path>, input: &StepInput) -> Result<StepSummary, WriteError> {
    let topology = Topology::new(input.network, input.surfaces)?;
    let (text, summary) = document(input, &topology)?;
    atomic::write(path.as_ref(), |out: &mut BufWriter<File>| -> Result<(), WriteError> {
        Ok(out.write_all(text.as_bytes())?)
    })?;
    Ok(summary)
}

fn document(input: &StepInput, topology: &Topology) -> Result<(String, StepSummary), WriteError> {
    let diagonal = Aabb::of(input.surfaces.iter().flat_map(|s| &s.control)).diagonal();
    let mut e = Entities::default();
    let product = product(&mut e, input.name);
    // The control rows of a seam may differ by rounding: the accuracy covers it.
    let context = context(&mut e, input.units, (ACCURACY * diagonal).max(2.0 * topology.gap_max));
    let axis = placement(&mut e);
    let vertices: Vec<Option<usize>> = topology
        .corners
        .iter()
        .map(|corner| {
            corner.map(|p| {
                let point = e.point(p);
                e.add(format!("VERTEX_POINT('',#{point})"))
            })
        })
        .collect();
    let surfaces: Vec<usize> = input.surfaces.iter().map(|s| surface(&mut e, s)).collect();
    let lines = side_lines(&mut e);
    let uses = input.network.uses();
    let mut edges = vec![None; topology.curves.len()];
    for (c, curve) in topology.curves.iter().enumerate() {
        let Some(curve) = curve.as_ref().filter(|curve| !curve.collapsed) else { continue };
        let ends = input.network.curves[c].corners.map(|corner| vertices[corner as usize]);
        let [Some(start), Some(end)] = ends else {
            let (what, place) = ("the curve ends at a corner without a patch".into(), Place::Item("curve", c));
            return Err(WriteError::Inconsistent { what, place });
        };
        let points = e.points(&curve.control);
        let (knots, times) = multiplicities(&curve.knots);
        let closed = if curve.is_closed() { ".T." } else { ".F." };
        let spline = e.add(format!(
            "B_SPLINE_CURVE_WITH_KNOTS('',3,{points},.UNSPECIFIED.,{closed},.F.,{times},{knots},.UNSPECIFIED.)"
        ));
        let on_surfaces: Vec<usize> = uses[c]
            .iter()
            .map(|&(patch, k)| {
                let side = input.network.patches[patch as usize].sides[k as usize];
                let line = lines[k as usize][usize::from(side.reversed)];
                e.add(format!("PCURVE('',#{},#{line})", surfaces[patch as usize]))
            })
            .collect();
        let kind = if uses[c].len() == 2 && uses[c][0].0 == uses[c][1].0 { "SEAM_CURVE" } else { "SURFACE_CURVE" };
        let curve = e.add(format!("{kind}('',#{spline},{},.CURVE_3D.)", list(&on_surfaces)));
        edges[c] = Some(e.add(format!("EDGE_CURVE('curve {c}',#{start},#{end},#{curve},.T.)")));
    }
    let faces: Vec<usize> = (0..surfaces.len()).map(|p| face(&mut e, input.network, p, surfaces[p], &edges)).collect();
    let mut pieces = Pieces { solids: Vec::new(), shells: Vec::new() };
    for (number, Component { patches, closed }) in (1..).zip(&topology.components) {
        let ids: Vec<usize> = patches.iter().map(|&p| faces[p]).collect();
        if *closed {
            let shell = e.add(format!("CLOSED_SHELL('',{})", list(&ids)));
            pieces.solids.push(e.add(format!("MANIFOLD_SOLID_BREP('piece {number}',#{shell})")));
        } else {
            pieces.shells.push(e.add(format!("OPEN_SHELL('piece {number}',{})", list(&ids))));
        }
    }
    style::color(&mut e, &faces, context);
    let summary = StepSummary {
        solids: pieces.solids.len(),
        shells: pieces.shells.len(),
        faces: faces.len(),
        edges: edges.iter().flatten().count(),
        gap_max: topology.gap_max,
    };
    represent(&mut e, input.name, product, context, axis, &pieces);
    Ok((format!("{}DATA;\n{}ENDSEC;\nEND-ISO-10303-21;\n", head(input), e.finish()), summary))
}

fn head(input: &StepInput) -> String {
    let (name, time) = (text(input.name), text(input.time.unwrap_or("1970-01-01T00:00:00")));
    let program = text(concat!("planish ", env!("CARGO_PKG_VERSION")));
    format!(
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('B-spline patches'),'2;1');\n\
         FILE_NAME({name},{time},(''),(''),{program},{program},'');\n\
         FILE_SCHEMA(('AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF {{ 1 0 10303 442 1 1 4 }}'));\nENDSEC;\n"
    )
}

/// The product and its shape; returns the `PRODUCT_DEFINITION_SHAPE`.
fn product(e: &mut Entities, name: &str) -> usize {
    let name = text(name);
    let application = e.add("APPLICATION_CONTEXT('managed model based 3d engineering')".into());
    e.add(format!(
        "APPLICATION_PROTOCOL_DEFINITION('international standard','ap242_managed_model_based_3d_engineering',2014,\
         #{application})"
    ));
    let context = e.add(format!("PRODUCT_CONTEXT('',#{application},'mechanical')"));
    let product = e.add(format!("PRODUCT({name},{name},'',(#{context}))"));
    e.add(format!("PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#{product}))"));
    let formation = e.add(format!("PRODUCT_DEFINITION_FORMATION('','',#{product})"));
    let context = e.add(format!("PRODUCT_DEFINITION_CONTEXT('part definition',#{application},'design')"));
    let definition = e.add(format!("PRODUCT_DEFINITION('design','',#{formation},#{context})"));
    e.add(format!("PRODUCT_DEFINITION_SHAPE('','',#{definition})"))
}

/// Units and accuracy.
fn context(e: &mut Entities, units: Units, accuracy: f64) -> usize {
    let si = |prefix: &str| format!("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({prefix},.METRE.))");
    let length = match units {
        Units::Mm => e.add(si(".MILLI.")),
        Units::Cm => e.add(si(".CENTI.")),
        Units::M => e.add(si("$")),
        Units::In => {
            let millimetre = e.add(si(".MILLI."));
            let inch = e.add(format!("LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#{millimetre})"));
            let dimension = e.add("DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)".into());
            e.add(format!("(CONVERSION_BASED_UNIT('INCH',#{inch})LENGTH_UNIT()NAMED_UNIT(#{dimension}))"))
        }
    };
    let angle = e.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))".into());
    let solid_angle = e.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())".into());
    let accuracy = e.add(format!(
        "UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({}),#{length},'distance_accuracy_value','')",
        real(accuracy)
    ));
    e.add(format!(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{accuracy}))\
         GLOBAL_UNIT_ASSIGNED_CONTEXT((#{length},#{angle},#{solid_angle}))REPRESENTATION_CONTEXT('',''))"
    ))
}

fn placement(e: &mut Entities) -> usize {
    let origin = e.add("CARTESIAN_POINT('',(0.,0.,0.))".into());
    let z = e.add("DIRECTION('',(0.,0.,1.))".into());
    let x = e.add("DIRECTION('',(1.,0.,0.))".into());
    e.add(format!("AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})"))
}

/// The entity of a B-spline surface with its knots; its number.
fn surface(e: &mut Entities, surface: &Surface) -> usize {
    let columns: Vec<String> = (0..surface.cols)
        .map(|i| {
            let column: Vec<_> = (0..surface.rows).map(|j| surface.control[j * surface.cols + i]).collect();
            e.points(&column)
        })
        .collect();
    let ((knots_u, times_u), (knots_v, times_v)) = (multiplicities(&surface.knots_u), multiplicities(&surface.knots_v));
    let (closed_u, closed_v) = topology::closed(surface);
    let flag = |closed: bool| if closed { ".T." } else { ".F." };
    e.add(format!(
        "B_SPLINE_SURFACE_WITH_KNOTS('',3,3,({}),.UNSPECIFIED.,{},{},.F.,{times_u},{times_v},{knots_u},{knots_v},\
         .UNSPECIFIED.)",
        columns.join(","),
        flag(closed_u),
        flag(closed_v),
    ))
}

/// The sides of the square of parameters, each along the patch's way around and against it: readers that project the curves
/// of edges instead go astray where a surface folds or comes near itself.
fn side_lines(e: &mut Entities) -> [[usize; 2]; 4] {
    const CORNERS: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let context = e.add(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(2)PARAMETRIC_REPRESENTATION_CONTEXT()REPRESENTATION_CONTEXT('',''))".into(),
    );
    std::array::from_fn(|k| {
        let ends = [CORNERS[k], CORNERS[(k + 1) % 4]];
        [ends, [ends[1], ends[0]]].map(|[from, to]| {
            let pair = |x: [f64; 2]| format!("({},{})", real(x[0]), real(x[1]));
            let point = e.add(format!("CARTESIAN_POINT('',{})", pair(from)));
            let direction = e.add(format!("DIRECTION('',{})", pair([to[0] - from[0], to[1] - from[1]])));
            let vector = e.add(format!("VECTOR('',#{direction},1.)"));
            let line = e.add(format!("LINE('',#{point},#{vector})"));
            e.add(format!("DEFINITIONAL_REPRESENTATION('',(#{line}),#{context})"))
        })
    })
}

/// One patch as a face: its sides run counter-clockwise seen from where its normal points.
fn face(e: &mut Entities, network: &Network, patch: usize, surface: usize, edges: &[Option<usize>]) -> usize {
    let mut sides = Vec::new();
    for side in &network.patches[patch].sides {
        // A collapsed side is a point, which its neighbours already end at.
        if let Some(edge) = edges[side.curve as usize] {
            let direction = if side.reversed { ".F." } else { ".T." };
            sides.push(e.add(format!("ORIENTED_EDGE('',*,*,#{edge},{direction})")));
        }
    }
    let ring = e.add(format!("EDGE_LOOP('',{})", list(&sides)));
    let bound = e.add(format!("FACE_OUTER_BOUND('',#{ring},.T.)"));
    e.add(format!("ADVANCED_FACE('patch {patch}',(#{bound}),#{surface},.T.)"))
}

/// Distinct knots and how often each stands, as STEP lists.
fn multiplicities(knots: &[f64]) -> (String, String) {
    let runs: Vec<&[f64]> = knots.chunk_by(|a, b| a == b).collect();
    let join = |words: Vec<String>| format!("({})", words.join(","));
    (join(runs.iter().map(|run| real(run[0])).collect()), join(runs.iter().map(|run| run.len().to_string()).collect()))
}

/// The pieces of a product: closed ones, and open ones.
struct Pieces {
    solids: Vec<usize>,
    shells: Vec<usize>,
}

/// Ties solids and shells to the product: one representation, or two related to a common one if there are both.
fn represent(e: &mut Entities, name: &str, product: usize, context: usize, axis: usize, pieces: &Pieces) {
    let Pieces { solids, shells } = pieces;
    let name = text(name);
    let mut representations = Vec::new();
    if !solids.is_empty() {
        let items = list(&[&[axis], &solids[..]].concat());
        representations.push(e.add(format!("ADVANCED_BREP_SHAPE_REPRESENTATION({name},{items},#{context})")));
    }
    if !shells.is_empty() {
        let model = e.add(format!("SHELL_BASED_SURFACE_MODEL({name},{})", list(shells)));
        let items = list(&[axis, model]);
        representations.push(e.add(format!("MANIFOLD_SURFACE_SHAPE_REPRESENTATION({name},{items},#{context})")));
    }
    if let [only] = representations[..] {
        e.add(format!("SHAPE_DEFINITION_REPRESENTATION(#{product},#{only})"));
        return;
    }
    let common = e.add(format!("SHAPE_REPRESENTATION({name},(#{axis}),#{context})"));
    e.add(format!("SHAPE_DEFINITION_REPRESENTATION(#{product},#{common})"));
    for representation in representations {
        e.add(format!("SHAPE_REPRESENTATION_RELATIONSHIP('','',#{common},#{representation})"));
    }
}
