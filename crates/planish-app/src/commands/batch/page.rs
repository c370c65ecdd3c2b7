//! All rows of a batch as a table: for a terminal, and as a page with the report of each.

use super::{Outcome, Row};
use planish::pipeline::key;
use planish_io::report::table_page;
use std::path::Path;

/// A column of figures: heading, key of the report, how a value is written.
type Column = (&'static str, &'static str, fn(f64) -> String);

const COLUMNS: [Column; 4] = [
    ("patches", key::PATCHES_COUNT, |x| format!("{x:.0}")),
    ("RMS %", key::SURFACE_RMS_REL, |x| format!("{:.4}", x * 100.0)),
    ("max %", key::SURFACE_MAX_REL, |x| format!("{:.4}", x * 100.0)),
    ("seam deg", key::SEAM_INNER_ANGLE_MAX_DEG, |x| format!("{x:.2}")),
];

/// The heading and a list of texts for each row.
fn cells(rows: &[Row]) -> Vec<Vec<String>> {
    let heads = ["part", "status", "time s"].into_iter().chain(COLUMNS.iter().map(|c| c.0)).chain(["remark"]);
    let mut all = vec![heads.map(str::to_owned).collect::<Vec<_>>()];
    for row in rows {
        let name = row.source.file_name().unwrap_or(row.source.as_os_str()).to_string_lossy().into_owned();
        let mut line = vec![name, row.status.word().to_owned(), format!("{:.1}", row.seconds)];
        let figure = |key: &str| row.quality.get(key).and_then(serde_json::Value::as_f64);
        line.extend(COLUMNS.iter().map(|(_, key, form)| figure(key).map(form).unwrap_or_default()));
        line.push(row.error.as_deref().map(|e| e.trim_start_matches("error: ").to_owned()).unwrap_or_default());
        all.push(line);
    }
    all
}

/// The table in lines of text.
pub fn lines(rows: &[Row]) -> Vec<String> {
    let cells = cells(rows);
    let widths: Vec<usize> =
        (0..cells[0].len()).map(|k| cells.iter().map(|row| row[k].chars().count()).max().unwrap_or(0)).collect();
    let line = |row: &Vec<String>| {
        let padded = row.iter().zip(&widths).map(|(text, &width)| format!("{text:width$}")).collect::<Vec<_>>();
        crate::words::plain(padded.join("  ").trim_end())
    };
    cells.iter().map(line).collect()
}

/// The table as a page; each part leads to its own report.
pub fn html(rows: &[Row], folder: &Path) -> String {
    let mut cells = cells(rows).into_iter();
    let heads = cells.next().unwrap_or_default();
    let linked = |(row, texts): (&Row, Vec<String>)| {
        let own = row.folder.strip_prefix(folder).unwrap_or(&row.folder).join("report.html");
        let parts: Vec<String> =
            own.iter().map(|p| p.to_string_lossy().replace('%', "%25").replace('#', "%23")).collect();
        let link = (row.status != Outcome::Failed).then(|| parts.join("/"));
        let mut cells: Vec<(String, Option<String>)> = texts.into_iter().map(|text| (text, None)).collect();
        cells[0].1 = link;
        cells
    };
    let body: Vec<_> = rows.iter().zip(cells).map(linked).collect();
    let failed = rows.iter().filter(|r| r.status == Outcome::Failed).count();
    let lead = match failed {
        0 => format!("{} parts. Each name leads to the report of its part.", rows.len()),
        n => format!("{} parts, {n} of them failed. Each name leads to the report of its part.", rows.len()),
    };
    table_page("Many parts", &lead, &heads, &body)
}
