//! The page: one self-contained HTML file without scripts and without anything from outside.

use super::gallery::{Picture, gallery};
use super::verdict::{State, state_of, verdict};
use super::words::{count, escape, number, percent};
use super::{Report, SeamRow};
use planish::pipeline::Figure;
use std::fmt::Write;

/// Rows of the table of seams; the rest are in `report.json`.
const SEAMS_SHOWN: usize = 15;
/// Gaps below this fraction of the diagonal are rounding: the boundary is shared.
const ROUNDING: f64 = 1e-12;
/// An end whose normals turn by so much more than those of the rest, degrees, has a patch without a normal of its own there.
const END_DEG: f64 = 10.0;
const STYLE: &str = include_str!("style.css");

/// Figures of a scan in words: key, meaning, and how the value is read.
const SCAN_FIGURES: [(&str, &str, Reading); 16] = [
    ("scan.noise", "Noise of the points, standard deviation", Reading::Length),
    ("scan.spacing", "Distance of neighbouring points", Reading::Length),
    ("scan.samples", "Samples fitted to them", Reading::Plain),
    ("scan.segments", "Connected parts", Reading::Plain),
    ("scan.confidence", "Evidence that agrees with the orientation", Reading::Fraction),
    ("scan.normal_noise_deg", "Typical error of the normals", Reading::Degrees),
    ("scan.outliers", "Outliers left out", Reading::Plain),
    ("scan.moved_rms", "Points moved onto the surface by, root mean square", Reading::Length),
    ("scan.closed", "Holes were closed", Reading::Plain),
    ("scan.lids", "Small holes of an open scan that were closed", Reading::Plain),
    ("scan.bricks", "Bricks that the scan was meshed in", Reading::Plain),
    ("scan.specks", "Specks of noise left out", Reading::Plain),
    ("scan.to_mesh_rms", "Raw points to the mesh, root mean square", Reading::Length),
    ("scan.to_mesh_mean", "Raw points to the mesh, mean", Reading::Length),
    ("truth.noise_rel", "True noise along the rays", Reading::Fraction),
    ("truth.outliers", "True number of wrong ranges", Reading::Plain),
];

/// Figures of a result against a known truth.
const TRUTH_FIGURES: [(&str, &str, Reading); 12] = [
    ("truth.mesh_rms", "Mesh to truth, root mean square", Reading::Length),
    ("truth.mesh_max", "Mesh to truth, largest", Reading::Length),
    ("truth.mesh_normal_deg", "Normals of the mesh, mean error", Reading::Degrees),
    ("truth.surface_rms", "Surfaces to truth, root mean square", Reading::Length),
    ("truth.surface_normal_deg", "Normals of the surfaces, mean error", Reading::Degrees),
    ("truth.displaced_rms", "Displaced surfaces to truth, root mean square", Reading::Length),
    ("truth.displaced_max", "Displaced surfaces to truth, largest", Reading::Length),
    ("truth.displaced_normal_deg", "Normals of the displaced surfaces, mean error", Reading::Degrees),
    ("truth.sharp_length", "Length of the true edges above 40°", Reading::Length),
    ("truth.sharp_found", "Of that with a seam on it", Reading::Fraction),
    ("truth.sharp_met", "Of that with the true angle within 3°", Reading::Fraction),
    ("truth.sharp_false", "Sharp seams where the truth is smooth", Reading::Fraction),
];

/// Figures of quality in words: key, meaning, and how the value is read.
const FIGURES: [(&str, &str, Reading); 35] = [
    ("mesh.triangles", "Triangles of the mesh after repair", Reading::Plain),
    ("mesh.watertight", "The mesh is closed", Reading::Plain),
    ("mesh.manifold", "The mesh is manifold", Reading::Plain),
    ("mesh.feature_edges", "Sharp edges found", Reading::Plain),
    ("patches.count", "Four-sided patches", Reading::Plain),
    ("patches.irregular_corners", "Corners where not four patches meet", Reading::Plain),
    ("layout.cones", "Cones of the directions it follows", Reading::Plain),
    ("layout.deviation_deg", "Patches off these directions, mean", Reading::Degrees),
    ("layout.along_form_share", "Area whose patches follow the form", Reading::Fraction),
    ("grid.points", "Points of all grids", Reading::Plain),
    ("grid.folds", "Folded grid cells", Reading::Plain),
    ("grid.spacing_cv", "Unevenness of grid spacing (deviation over mean)", Reading::Fraction),
    ("surface.control_points", "Control points of all surfaces", Reading::Plain),
    ("surface.rms", "Surface to input, root mean square", Reading::Length),
    ("surface.p95", "Surface to input, 95 of 100 places are closer", Reading::Length),
    ("surface.max", "Surface to input, largest", Reading::Length),
    ("displaced.rms", "Displaced surface to input, root mean square", Reading::Length),
    ("displaced.p95", "Displaced surface to input, 95 of 100 places are closer", Reading::Length),
    ("displaced.max", "Displaced surface to input, largest", Reading::Length),
    ("seam.count", "Seams between two patches", Reading::Plain),
    ("seam.gap_max", "Largest gap along a seam", Reading::Length),
    ("seam.gap_bound", "What no gap exceeds, between samples neither", Reading::Length),
    ("seam.folded", "Smooth seams that are folded over", Reading::Plain),
    ("seam.inner_angle_max_deg", "Largest angle across a smooth seam, its ends left out", Reading::Degrees),
    ("seam.angle_max_deg", "The same with ends, which may have no normal of their own", Reading::Degrees),
    (
        "seam.regular_angle_max_deg",
        "The same without the first knot span beside corners of less than 25 or more than 150 degrees",
        Reading::Degrees,
    ),
    ("seam.regular_angle_bound_deg", "What that angle nowhere exceeds, between samples neither", Reading::Degrees),
    ("seam.odd_ends", "Ends of smooth seams in such corners", Reading::Plain),
    ("seam.angle_rms_deg", "Angle across smooth seams, root mean square", Reading::Degrees),
    ("seam.angle_p95_deg", "Angle that 95 of 100 of the length of smooth seams do not exceed", Reading::Degrees),
    ("seam.edges", "Pieces of smooth seams at which the grids meet at an edge: they keep its angle", Reading::Plain),
    ("seam.edges_share", "Share of the length of smooth seams in such pieces", Reading::Fraction),
    ("relief.texels", "Texels of all displacement maps", Reading::Plain),
    ("relief.max", "Largest displacement", Reading::Length),
    (
        "relief.roundtrip_max",
        "Surface plus displacement, read back from the files, to the grid, largest",
        Reading::Length,
    ),
];

#[derive(Clone, Copy, PartialEq)]
enum Reading {
    Plain,
    Fraction,
    Length,
    Degrees,
}

/// The page for `report`, with `pictures` in their order.
pub fn html(report: &Report, pictures: &[Picture]) -> String {
    let mut page = String::new();
    let name = report.input.path.rsplit(['/', '\\']).next().unwrap_or_default();
    let _ = write!(
        page,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{} - planish report</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n",
        escape(name)
    );
    header(&mut page, report, name);
    judged(&mut page, report);
    lead(&mut page, report);
    tiles(&mut page, report);
    warnings(&mut page, report);
    gallery(&mut page, pictures);
    seams(&mut page, report);
    figures(&mut page, report, "Scan", &SCAN_FIGURES);
    figures(&mut page, report, "Against the truth", &TRUTH_FIGURES);
    figures(&mut page, report, "Figures", &FIGURES);
    stages(&mut page, report);
    let _ = write!(
        page,
        "<footer>Made by planish {} (<code>planish {}</code>). Distances are measured in both directions, from the \
         surface to the input mesh and back. The same figures are in <code>report.json</code>.</footer>\n\
         </main>\n</body>\n</html>\n",
        escape(&report.planish),
        escape(&report.command)
    );
    page
}

/// A page with one table: a heading, a line above it, the heads of its columns, and its rows. A cell is a text and where it
/// leads to, if anywhere.
pub fn table_page(name: &str, lead: &str, heads: &[String], rows: &[Vec<(String, Option<String>)>]) -> String {
    let mut page = String::new();
    let _ = write!(
        page,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{0} - planish report</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n\
         <header>\n<p class=\"mark\">planish report</p>\n<h1>{0}</h1>\n</header>\n<p class=\"lead\">{1}</p>\n<table>\n<tr>",
        escape(name),
        escape(lead)
    );
    heads.iter().for_each(|head| _ = write!(page, "<th>{}</th>", escape(head)));
    page.push_str("</tr>\n");
    for row in rows {
        page.push_str("<tr>");
        for (text, link) in row {
            let text = escape(text);
            let _ = match link {
                Some(link) => write!(page, "<td><a href=\"{}\">{text}</a></td>", escape(link)),
                None => write!(page, "<td>{text}</td>"),
            };
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table>\n</main>\n</body>\n</html>\n");
    page
}

fn header(page: &mut String, report: &Report, name: &str) {
    let input = &report.input;
    let mut facts: Vec<String> = input.counts.iter().map(|(what, &n)| format!("{} {what}", count(n))).collect();
    facts.push(format!("{} {} across", number(input.diagonal), input.units));
    let _ = write!(
        page,
        "<header>\n<p class=\"mark\">planish report</p>\n<h1>{}</h1>\n<p class=\"facts\">{}</p>\n</header>\n",
        escape(name),
        escape(&facts.join(" \u{b7} "))
    );
}

/// The result in one or two sentences.
fn lead(page: &mut String, report: &Report) {
    let Some(patches) = report.figure("patches.count") else { return };
    let mut text = format!("{} four-sided B-spline patches", count(patches as u64));
    if let (Some(rms), Some(max)) = (report.figure("surface.rms_rel"), report.figure("surface.max_rel")) {
        text += &format!(
            " follow the input to {} of its diagonal (RMS) and {} at the worst place",
            percent(rms),
            percent(max)
        );
    }
    text += ".";
    if let (Some(noise), Some(sure)) = (report.figure("scan.noise_rel"), report.figure("scan.confidence")) {
        text += &format!(
            " The points scatter by {} of the diagonal; {} of the evidence agrees on which side is outside.",
            percent(noise),
            percent(sure)
        );
    }
    if let (Some(rms), Some(found)) = (report.figure("truth.displaced_rms_rel"), report.figure("truth.sharp_found")) {
        text += &format!(
            " From the true shape the result is {} of the diagonal away; {} of its sharp edges have a seam.",
            percent(rms),
            percent(found)
        );
    }
    if let Some(rms) = report.figure("displaced.rms_rel") {
        text += &format!(" With the displacement maps applied the average is {}.", percent(rms));
    }
    if let (Some(gap), Some(angle)) = (report.figure("seam.gap_max"), report.figure("seam.inner_angle_max_deg")) {
        let closed = if gap <= ROUNDING * report.input.diagonal {
            "Neighbours share their boundaries exactly".to_owned()
        } else {
            format!("Neighbours meet within {} {}", number(gap), report.input.units)
        };
        text += &format!(" {closed}; across smooth seams the normals turn by {}° at most.", number(angle));
    }
    let _ = writeln!(page, "<p class=\"lead\">{}</p>", escape(&text));
}

/// The verdict, where there is a result to judge.
fn judged(page: &mut String, report: &Report) {
    if report.figure("patches.count").is_none() {
        return;
    }
    let (state, reasons) = verdict(report);
    let _ = write!(page, "<div class=\"verdict {}\"><b>{}</b>", state.class(), state.word());
    if reasons.is_empty() {
        page.push_str("<span>Nothing speaks against it: no folds, no gaps, no bent seams.</span>");
    } else {
        page.push_str("<ol>");
        for (state, reason) in &reasons {
            let _ = write!(page, "<li class=\"{}\">{}</li>", state.class(), escape(reason));
        }
        page.push_str("</ol>");
    }
    page.push_str("</div>\n");
}

fn tiles(page: &mut String, report: &Report) {
    let unit = report.input.units.as_str();
    let length = |key: &str| {
        let rel = report.figure(&format!("{key}_rel"))?;
        Some((number(rel * 100.0), "%", format!("{} {unit}", number(report.figure(key)?))))
    };
    let seconds: f64 = report.stages.iter().map(|s| s.seconds).sum();
    let state = |key: &str| state_of(report, key).unwrap_or(State::Good);
    let mut row: Vec<(String, &str, &str, String, State)> = Vec::new();
    let control = report.figure("surface.control_points");
    if let Some(n) = report.figure("patches.count") {
        let detail = control.map(|c| format!("{} control points", count(c as u64))).unwrap_or_default();
        row.push((count(n as u64), "", "Patches", detail, State::Good));
    }
    for (key, name) in [
        ("surface.rms", "Deviation, RMS"),
        ("surface.max", "Largest deviation"),
        ("displaced.rms", "With displacement, RMS"),
    ] {
        if let Some((value, small, detail)) = length(key) {
            row.push((value, small, name, detail, state(key)));
        }
    }
    let angle = report.figure("seam.inner_angle_max_deg").or(report.figure("seam.angle_max_deg"));
    if let Some(angle) = angle {
        let gap = match gap_of(report, report.figure("seam.gap_max").unwrap_or(0.0)) {
            0.0 => "no gaps".to_owned(),
            gap => format!("gap {} {unit}", number(gap)),
        };
        let worst = ["seam.folded", "seam.inner_angle_max_deg", "seam.gap_max"].map(state).into_iter().max();
        row.push((number(angle), "°", "Smooth seams bend, most", gap, worst.unwrap_or(State::Good)));
    }
    if let Some(folds) = report.figure("grid.folds") {
        let cells = report.figure("grid.points").unwrap_or(0.0);
        let detail = format!("of {}", count(cells as u64));
        row.push((count(folds as u64), "", "Folded cells", detail, state("grid.folds")));
    }
    if let Some(closed) = report.flag("mesh.watertight") {
        let word = if closed { "closed" } else { "open" };
        row.push((word.to_owned(), "", "Shape", format!("{} s", number(seconds)), state("mesh.watertight")));
    }
    if row.is_empty() {
        return;
    }
    page.push_str("<div class=\"tiles\">\n");
    for (value, small, name, detail, state) in row {
        let _ = writeln!(
            page,
            "<div class=\"tile {}\"><b>{}{}<small>{small}</small></b><span>{name}</span><i>{}</i></div>",
            state.class(),
            escape(&value),
            if small.is_empty() || small == "°" { "" } else { "\u{202f}" },
            escape(&detail)
        );
    }
    page.push_str("</div>\n");
}

fn warnings(page: &mut String, report: &Report) {
    if report.warnings.is_empty() {
        return;
    }
    let title = match report.warnings.len() {
        1 => "One thing to know".to_owned(),
        n => format!("{n} things to know"),
    };
    let _ = write!(page, "<div class=\"warnings\"><b>{title}</b>\n<ul>\n");
    for warning in &report.warnings {
        let _ = write!(page, "<li>{}", escape(&warning.message));
        if !warning.place.is_empty() {
            let _ = write!(page, " <span class=\"where\">({})</span>", escape(&warning.place));
        }
        if !warning.step.is_empty() {
            let to = if warning.step.starts_with("[[") { "A step for <code>planish edit</code>" } else { "Try" };
            let _ = write!(page, "<div class=\"step\">{to}:<pre>{}</pre></div>", escape(&warning.step));
        }
        page.push_str("</li>\n");
    }
    page.push_str("</ul></div>\n");
}

fn seams(page: &mut String, report: &Report) {
    if report.seams.is_empty() {
        return;
    }
    let mut smooth: Vec<&SeamRow> = report.seams.iter().filter(|s| !s.feature).collect();
    smooth.sort_by(|a, b| b.inner_angle_max_deg.total_cmp(&a.inner_angle_max_deg));
    let sharp = report.seams.len() - smooth.len();
    let mut note = format!(
        "Across a smooth seam the surface should not bend: the angle is that between the two normals. {} smooth seams",
        smooth.len()
    );
    if sharp > 0 {
        note += &format!("; {sharp} more follow sharp edges, where the angle is wanted");
    }
    note += ".";
    if smooth.len() > SEAMS_SHOWN {
        note += &format!(" The worst {SEAMS_SHOWN}:");
    }
    let _ = write!(
        page,
        "<h2>Seams</h2>\n<p class=\"note\">{}</p>\n<table class=\"stack\"><thead><tr><th>Curve</th>\
         <th>Between patches</th><th class=\"n\">Bends, most</th><th class=\"n\">Bends, RMS</th>\
         <th class=\"n\">Gap</th><th class=\"n\">Length</th><th></th></tr></thead><tbody>\n",
        escape(&note)
    );
    for seam in smooth.iter().take(SEAMS_SHOWN) {
        let gap = match gap_of(report, seam.gap_max) {
            0.0 => "none".to_owned(),
            gap => format!("{} {}", number(gap), escape(&report.input.units)),
        };
        let (class, word) = match seam {
            seam if seam.folded => ("broken", "folded"),
            seam if seam.angle_max_deg > END_DEG + seam.inner_angle_max_deg => ("", "an end has no normal"),
            _ => ("", ""),
        };
        let _ = writeln!(
            page,
            "<tr class=\"{class}\"><td data-label=\"Curve\">{}</td><td data-label=\"Between patches\">{} and {}</td>\
             <td class=\"n\" data-label=\"Bends, most\">{}°</td><td class=\"n\" data-label=\"Bends, RMS\">{}°</td>\
             <td class=\"n\" data-label=\"Gap\">{gap}</td><td class=\"n\" data-label=\"Length\">{} {}</td><td>{word}</td></tr>",
            seam.curve,
            seam.patches[0],
            seam.patches[1],
            number(seam.inner_angle_max_deg),
            number(seam.angle_rms_deg),
            number(seam.length),
            escape(&report.input.units)
        );
    }
    page.push_str("</tbody></table>\n");
}

/// A gap without what is rounding.
fn gap_of(report: &Report, gap: f64) -> f64 {
    if gap <= ROUNDING * report.input.diagonal { 0.0 } else { gap }
}

fn figures(page: &mut String, report: &Report, title: &str, list: &[(&str, &str, Reading)]) {
    if !list.iter().any(|f| report.quality.contains_key(f.0)) {
        return;
    }
    let _ = write!(
        page,
        "<h2>{title}</h2>\n<p class=\"note\">Each with its key in <code>report.json</code>.</p>\n\
         <table class=\"stack\"><tbody>\n",
    );
    for &(key, words, reading) in list {
        let Some(figure) = report.quality.get(key) else { continue };
        let value = match (figure, reading) {
            (Figure::Flag(yes), _) => if *yes { "yes" } else { "no" }.to_owned(),
            (Figure::Count(n), _) => count(*n),
            (Figure::Number(_), Reading::Length) => report.length(key),
            (Figure::Number(x), Reading::Degrees) => format!("{}°", number(*x)),
            (Figure::Number(x), Reading::Fraction) => percent(*x),
            (Figure::Number(x), Reading::Plain) => number(*x),
        };
        let _ = writeln!(
            page,
            "<tr class=\"{}\"><td>{}</td><td class=\"n\">{}</td><td class=\"key\"><code>{key}</code></td></tr>",
            state_of(report, key).filter(|s| *s != State::Good).map_or("", State::class),
            escape(words),
            escape(&value)
        );
    }
    page.push_str("</tbody></table>\n");
}

fn stages(page: &mut String, report: &Report) {
    if report.stages.is_empty() {
        return;
    }
    let longest = report.stages.iter().map(|s| s.seconds).fold(0.0, f64::max);
    let total: f64 = report.stages.iter().map(|s| s.seconds).sum();
    page.push_str(
        "<h2>Stages</h2>\n<table class=\"stack\"><thead><tr><th>Stage</th><th class=\"n\">Time</th><th></th>\
         <th>Made</th><th class=\"n\">Memory</th></tr></thead><tbody>\n",
    );
    for stage in &report.stages {
        let made: Vec<String> = stage.counts.iter().map(|(what, &n)| format!("{} {what}", count(n))).collect();
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td class=\"n\" data-label=\"Time\">{} s</td><td class=\"bar\"><div style=\"width:{:.1}%\"></div></td>\
             <td data-label=\"Made\">{}</td><td class=\"n\" data-label=\"Memory\">{}</td></tr>",
            escape(&stage.name),
            number(stage.seconds),
            100.0 * stage.seconds / longest.max(f64::MIN_POSITIVE),
            escape(&made.join(", ").replace('_', " ")),
            memory(stage.peak_bytes)
        );
    }
    let _ = writeln!(
        page,
        "</tbody><tfoot><tr><td>All</td><td class=\"n\">{} s</td><td></td><td></td><td></td></tr></tfoot></table>",
        number(total)
    );
}

fn memory(bytes: u64) -> String {
    if bytes == 0 { "-".into() } else { format!("{} MiB", bytes >> 20) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Input;
    use crate::report::gallery::{Place, Scale};
    use planish::pipeline::Warning;

    fn report() -> Report {
        let mut report =
            Report::new("run", Input { path: "parts/<b>.ply".into(), diagonal: 200.0, ..Default::default() });
        report.input.units = "mm".into();
        report.quality.insert("patches.count".into(), Figure::Count(12));
        report.quality.insert("surface.rms".into(), Figure::Number(0.5));
        report.quality.insert("surface.rms_rel".into(), Figure::Number(0.0025));
        report.warnings.push(Warning::new("open", "5 holes & cracks", "patch 3"));
        report
    }

    #[test]
    fn names_from_outside_are_escaped_and_nothing_is_fetched() {
        let page = html(&report(), &[]);
        assert!(page.contains("<h1>&lt;b&gt;.ply</h1>") && page.contains("5 holes &amp; cracks"));
        for outside in ["http:", "https:", "<script", "<link", "@import", "url("] {
            assert!(!page.contains(outside), "{outside}");
        }
    }

    #[test]
    fn a_figure_of_half_a_millimetre_on_200_is_shown_with_its_quarter_percent() {
        assert!(html(&report(), &[]).contains("0.500 mm (0.250 % of the diagonal)"));
    }

    #[test]
    fn json_keeps_keys_and_reads_back_equal() {
        let report = report();
        let text = report.to_json();
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(value["quality"]["patches.count"], 12);
        assert_eq!(value["warnings"][0]["where"], "patch 3");
        assert_eq!(serde_json::from_str::<Report>(&text).unwrap(), report);
    }

    #[test]
    fn pictures_are_embedded() {
        let picture = Picture {
            title: "Deviation".into(),
            caption: "Blue is close.".into(),
            png: vec![1, 2, 3],
            place: Place::Gallery,
            scale: Some(Scale { colors: vec![[0, 0, 255], [255, 0, 0]], labels: vec!["0".into(), "1 mm".into()] }),
        };
        let page = html(&report(), &[picture]);
        assert!(page.contains("data:image/png;base64,AQID") && page.contains("rgb(0,0,255),rgb(255,0,0)"));
    }

    #[test]
    fn the_verdict_stands_above_the_tiles_folded_seams_are_told_from_ends_without_a_normal_and_steps_can_be_pasted() {
        let mut report = report();
        report.quality.insert("seam.folded".into(), Figure::Count(1));
        report.quality.insert("seam.inner_angle_max_deg".into(), Figure::Number(178.0));
        let seam = |curve, inner_angle_max_deg, folded| SeamRow {
            curve,
            patches: [0, 1],
            feature: false,
            length: 3.0,
            gap_max: 0.0,
            angle_max_deg: 180.0,
            angle_rms_deg: 0.5,
            inner_angle_max_deg,
            folded,
        };
        report.seams = vec![seam(4, 0.7, false), seam(9, 178.0, true)];
        report.warnings[0] = report.warnings[0].clone().with_step("[[step]]\nedit = \"relax\"");
        let page = html(&report, &[]);
        let at = |text: &str| page.find(text).unwrap_or_else(|| panic!("{text}"));
        assert!(at("class=\"verdict broken\"><b>Broken</b>") < at("class=\"tiles\""));
        assert!(at(">folded</td>") < at(">an end has no normal</td>"));
        assert!(page.contains("<pre>[[step]]\nedit = &quot;relax&quot;</pre>") && page.contains("tile broken"));
        // Cells carry their own names where the head of the table is not shown.
        assert!(page.contains("data-label=\"Gap\">none"));
    }

    #[test]
    fn pictures_are_enlarged_and_compared_without_scripts() {
        let picture = |title: &str, place| Picture {
            title: title.into(),
            caption: "Seen.".into(),
            png: vec![1, 2, 3],
            scale: None,
            place,
        };
        let all = [
            picture("Input", Place::Gallery),
            picture("Surfaces", Place::Slider),
            picture("Displaced", Place::Slider),
            picture("Front", Place::Side),
        ];
        let page = html(&report(), &all);
        for part in ["href=\"#picture-0\"", "class=\"slider\"", "Displaced and surfaces", "From six sides"] {
            assert!(page.contains(part), "{part}");
        }
    }
}
