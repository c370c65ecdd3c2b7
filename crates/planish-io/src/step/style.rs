//! Colours of the faces of a STEP file, as CAD programs exchange them: one chain of styles for each colour, one `STYLED_ITEM` for
//! each face (CAx-IF, *Recommended practices for styling and organization*, "Colors of faces").

use super::text::{Entities, list, real};
use planish::render;
use std::collections::BTreeMap;

/// Gives each face of `faces` the colour that its patch has in the pictures of a report.
/// * `context` - of the representation that the faces are in
pub(super) fn color(e: &mut Entities, faces: &[usize], context: usize) {
    let mut styles = BTreeMap::new();
    let mut items = Vec::new();
    for (face, color) in faces.iter().zip(render::even_colors(faces.len())) {
        let style = *styles.entry(color).or_insert_with(|| style(e, color));
        items.push(e.add(format!("STYLED_ITEM('',(#{style}),#{face})")));
    }
    let items = list(&items);
    e.add(format!("MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',{items},#{context})"));
}

/// Both sides of a surface filled with an sRGB colour.
fn style(e: &mut Entities, color: [u8; 3]) -> usize {
    let [r, g, b] = color.map(|byte| real(f64::from(byte) / 255.0));
    let mut last = e.add(format!("COLOUR_RGB('',{r},{g},{b})"));
    for (before, after) in [
        ("FILL_AREA_STYLE_COLOUR('',#", ")"),
        ("FILL_AREA_STYLE('',(#", "))"),
        ("SURFACE_STYLE_FILL_AREA(#", ")"),
        ("SURFACE_SIDE_STYLE('',(#", "))"),
        ("SURFACE_STYLE_USAGE(.BOTH.,#", ")"),
        ("PRESENTATION_STYLE_ASSIGNMENT((#", "))"),
    ] {
        last = e.add(format!("{before}{last}{after}"));
    }
    last
}
