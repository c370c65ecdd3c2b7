//! The page: one self-contained HTML file without scripts and without anything from outside.

use super::gallery::{Picture, gallery};
use super::verdict::{State, state_of, verdict};
use super::words::{count, escape, number, percent};
use super::{Report, SeamRow};
use planish::pipeline::Figure;
use planish::pipeline::key::{self, Key, Reading};
use std::fmt::Write;

/// Rows of the table of seams; the rest are in `report.json`.
const SEAMS_SHOWN: usize = 15;
/// Gaps below this fraction of the diagonal are rounding: the boundary is shared.
const ROUNDING: f64 = 1e-12;
/// An end whose normals turn by so much more than those of the rest, degrees, has a patch without a normal of its own there.
const END_DEG: f64 = 10.0;
const STYLE: &str = include_str!("style.css");

/// Figures of a scan.
const SCAN_FIGURES: [&str; 16] = [
    key::SCAN_NOISE,
    key::SCAN_SPACING,
    key::SCAN_SAMPLES,
    key::SCAN_SEGMENTS,
    key::SCAN_CONFIDENCE,
    key::SCAN_NORMAL_NOISE_DEG,
    key::SCAN_OUTLIERS,
    key::SCAN_MOVED_RMS,
    key::SCAN_CLOSED,
    key::SCAN_LIDS,
    key::SCAN_BRICKS,
    key::SCAN_SPECKS,
    key::SCAN_TO_MESH_RMS,
    key::SCAN_TO_MESH_MEAN,
    key::TRUTH_NOISE_REL,
    key::TRUTH_OUTLIERS,
];

/// Figures of a result against a known truth.
const TRUTH_FIGURES: [&str; 12] = [
    key::TRUTH_MESH_RMS,
    key::TRUTH_MESH_MAX,
    key::TRUTH_MESH_NORMAL_DEG,
    key::TRUTH_SURFACE_RMS,
    key::TRUTH_SURFACE_NORMAL_DEG,
    key::TRUTH_DISPLACED_RMS,
    key::TRUTH_DISPLACED_MAX,
    key::TRUTH_DISPLACED_NORMAL_DEG,
    key::TRUTH_SHARP_LENGTH,
    key::TRUTH_SHARP_FOUND,
    key::TRUTH_SHARP_MET,
    key::TRUTH_SHARP_FALSE,
];

/// Figures of quality.
const FIGURES: [&str; 39] = [
    key::MESH_TRIANGLES,
    key::MESH_WATERTIGHT,
    key::MESH_MANIFOLD,
    key::MESH_FEATURE_EDGES,
    key::PATCHES_COUNT,
    key::PATCHES_IRREGULAR_CORNERS,
    key::LAYOUT_CONES,
    key::LAYOUT_DEVIATION_DEG,
    key::LAYOUT_ALONG_FORM_SHARE,
    key::GRID_POINTS,
    key::GRID_FOLDS,
    key::GRID_SPACING_CV,
    key::SURFACE_CONTROL_POINTS,
    key::SURFACE_TURNED,
    key::SURFACE_UNPROVEN,
    key::SURFACE_CROSSINGS,
    key::SURFACE_CROSSING_DEPTH,
    key::SURFACE_RMS,
    key::SURFACE_P95,
    key::SURFACE_MAX,
    key::DISPLACED_RMS,
    key::DISPLACED_P95,
    key::DISPLACED_MAX,
    key::SEAM_COUNT,
    key::SEAM_GAP_MAX,
    key::SEAM_GAP_BOUND,
    key::SEAM_FOLDED,
    key::SEAM_INNER_ANGLE_MAX_DEG,
    key::SEAM_ANGLE_MAX_DEG,
    key::SEAM_REGULAR_ANGLE_MAX_DEG,
    key::SEAM_REGULAR_ANGLE_BOUND_DEG,
    key::SEAM_ODD_ENDS,
    key::SEAM_ANGLE_RMS_DEG,
    key::SEAM_ANGLE_P95_DEG,
    key::SEAM_EDGES,
    key::SEAM_EDGES_SHARE,
    key::RELIEF_TEXELS,
    key::RELIEF_MAX,
    key::RELIEF_ROUNDTRIP_MAX,
];

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
    let Some(patches) = report.figure(key::PATCHES_COUNT) else { return };
    let mut text = format!("{} four-sided B-spline patches", count(patches as u64));
    if let (Some(rms), Some(max)) = (report.figure(key::SURFACE_RMS_REL), report.figure(key::SURFACE_MAX_REL)) {
        text += &format!(
            " follow the input to {} of its diagonal (RMS) and {} at the worst place",
            percent(rms),
            percent(max)
        );
    }
    text += ".";
    if let (Some(noise), Some(sure)) = (report.figure(key::SCAN_NOISE_REL), report.figure(key::SCAN_CONFIDENCE)) {
        text += &format!(
            " The points scatter by {} of the diagonal; {} of the evidence agrees on which side is outside.",
            percent(noise),
            percent(sure)
        );
    }
    if let (Some(rms), Some(found)) =
        (report.figure(key::TRUTH_DISPLACED_RMS_REL), report.figure(key::TRUTH_SHARP_FOUND))
    {
        text += &format!(
            " From the true shape the result is {} of the diagonal away; {} of its sharp edges have a seam.",
            percent(rms),
            percent(found)
        );
    }
    if let Some(rms) = report.figure(key::DISPLACED_RMS_REL) {
        text += &format!(" With the displacement maps applied the average is {}.", percent(rms));
    }
    if let (Some(gap), Some(angle)) = (report.figure(key::SEAM_GAP_MAX), report.figure(key::SEAM_INNER_ANGLE_MAX_DEG)) {
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
    if report.figure(key::PATCHES_COUNT).is_none() {
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
    let control = report.figure(key::SURFACE_CONTROL_POINTS);
    if let Some(n) = report.figure(key::PATCHES_COUNT) {
        let detail = control.map(|c| format!("{} control points", count(c as u64))).unwrap_or_default();
        row.push((count(n as u64), "", "Patches", detail, State::Good));
    }
    for (key, name) in [
        (key::SURFACE_RMS, "Deviation, RMS"),
        (key::SURFACE_MAX, "Largest deviation"),
        (key::DISPLACED_RMS, "With displacement, RMS"),
    ] {
        if let Some((value, small, detail)) = length(key) {
            row.push((value, small, name, detail, state(key)));
        }
    }
    let angle = report.figure(key::SEAM_INNER_ANGLE_MAX_DEG).or(report.figure(key::SEAM_ANGLE_MAX_DEG));
    if let Some(angle) = angle {
        let gap = match gap_of(report, report.figure(key::SEAM_GAP_MAX).unwrap_or(0.0)) {
            0.0 => "no gaps".to_owned(),
            gap => format!("gap {} {unit}", number(gap)),
        };
        let worst = [key::SEAM_FOLDED, key::SEAM_INNER_ANGLE_MAX_DEG, key::SEAM_GAP_MAX].map(state).into_iter().max();
        row.push((number(angle), "°", "Smooth seams bend, most", gap, worst.unwrap_or(State::Good)));
    }
    if let Some(folds) = report.figure(key::GRID_FOLDS) {
        let cells = report.figure(key::GRID_POINTS).unwrap_or(0.0);
        let detail = format!("of {}", count(cells as u64));
        row.push((count(folds as u64), "", "Folded cells", detail, state(key::GRID_FOLDS)));
    }
    if let Some(closed) = report.flag(key::MESH_WATERTIGHT) {
        let word = if closed { "closed" } else { "open" };
        row.push((word.to_owned(), "", "Shape", format!("{} s", number(seconds)), state(key::MESH_WATERTIGHT)));
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

fn figures(page: &mut String, report: &Report, title: &str, list: &[&str]) {
    if !list.iter().any(|name| report.quality.contains_key(*name)) {
        return;
    }
    let _ = write!(
        page,
        "<h2>{title}</h2>\n<p class=\"note\">Each with its key in <code>report.json</code>.</p>\n\
         <table class=\"stack\"><tbody>\n",
    );
    for &Key { name, meaning, reading } in list.iter().filter_map(|name| key::of(name)) {
        let Some(figure) = report.quality.get(name) else { continue };
        let value = match (figure, reading) {
            (Figure::Flag(yes), _) => if *yes { "yes" } else { "no" }.to_owned(),
            (Figure::Count(n), _) => count(*n),
            (Figure::Number(_), Reading::Length) => report.length(name),
            (Figure::Number(x), Reading::Degrees) => format!("{}°", number(*x)),
            (Figure::Number(x), Reading::Share) => percent(*x),
            (Figure::Number(x), Reading::Plain) => number(*x),
        };
        let _ = writeln!(
            page,
            "<tr class=\"{}\"><td>{}</td><td class=\"n\">{}</td><td class=\"key\"><code>{name}</code></td></tr>",
            state_of(report, name).filter(|s| *s != State::Good).map_or("", State::class),
            escape(meaning),
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
