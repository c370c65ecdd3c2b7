//! The pictures of the page: side by side, enlarged by a click, two of them under a slider, six sides in a row.

use super::words::escape;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::fmt::Write;

/// A picture of the page.
pub struct Picture {
    /// What it shows, in a few words.
    pub title: String,
    /// One or two sentences on how to read it.
    pub caption: String,
    /// The picture as a PNG file; its ground is transparent, so that it suits light and dark pages.
    pub png: Vec<u8>,
    /// Meaning of its colours, if they have one.
    pub scale: Option<Scale>,
    /// Where it stands.
    pub place: Place,
}

/// Where a picture stands on the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Beside the others.
    Gallery,
    /// By itself, as wide as the page.
    Wide,
    /// Under a slider with the next one of this kind.
    Slider,
    /// Among the six sides.
    Side,
}

/// The meaning of a picture's colours.
pub struct Scale {
    /// Colours from the least to the greatest value, evenly spaced, sRGB.
    pub colors: Vec<[u8; 3]>,
    /// Labels from the least to the greatest value, evenly spaced.
    pub labels: Vec<String>,
}

/// Writes all pictures.
pub fn gallery(page: &mut String, pictures: &[Picture]) {
    if pictures.is_empty() {
        return;
    }
    page.push_str(
        "<h2>Pictures</h2>\n<p class=\"note\">All from the same point of view; a click enlarges one, another brings it back. \
         </p>\n<div class=\"pictures\" id=\"pictures\">\n",
    );
    let of = |place: Place| pictures.iter().enumerate().filter(move |(_, p)| p.place == place);
    for (k, picture) in of(Place::Gallery) {
        figure(page, k, picture, "");
    }
    for (k, picture) in of(Place::Wide) {
        figure(page, k, picture, " class=\"wide\"");
    }
    if let [(_, below), (_, above)] = of(Place::Slider).collect::<Vec<_>>()[..] {
        slider(page, below, above);
    }
    page.push_str("</div>\n");
    if of(Place::Side).next().is_some() {
        page.push_str("<h2>From six sides</h2>\n<div class=\"pictures sides\">\n");
        of(Place::Side).for_each(|(k, picture)| figure(page, k, picture, ""));
        page.push_str("</div>\n");
    }
}

/// * `class` - attribute of the figure
fn figure(page: &mut String, k: usize, picture: &Picture, class: &str) {
    let title = escape(&picture.title);
    let _ = write!(
        page,
        "<figure{class} id=\"picture-{k}\"><a class=\"open\" href=\"#picture-{k}\"><img alt=\"{title}\" \
         src=\"data:image/png;base64,{}\"></a><a class=\"close\" href=\"#pictures\" aria-label=\"back\"></a>\n\
         <figcaption><b>{title}</b><span>{}</span>",
        STANDARD.encode(&picture.png),
        escape(&picture.caption)
    );
    if let Some(scale) = &picture.scale {
        let stops: Vec<String> = scale.colors.iter().map(|c| format!("rgb({},{},{})", c[0], c[1], c[2])).collect();
        let labels: String = scale.labels.iter().map(|l| format!("<span>{}</span>", escape(l))).collect();
        let _ = write!(
            page,
            "<div class=\"scale\"><div style=\"background:linear-gradient(90deg,{})\"></div><p>{labels}</p></div>",
            stops.join(",")
        );
    }
    page.push_str("</figcaption></figure>\n");
}

/// Two pictures over each other: the upper one in a box whose right side is drawn over the lower one. No script is needed.
fn slider(page: &mut String, below: &Picture, above: &Picture) {
    let image = |p: &Picture| {
        format!("<img alt=\"{}\" src=\"data:image/png;base64,{}\">", escape(&p.title), STANDARD.encode(&p.png))
    };
    let _ = writeln!(
        page,
        "<figure class=\"wide\"><div class=\"slider\">{}<div class=\"over\">{}</div></div>\n<figcaption><b>{} and {}</b>\
         <span>Draw the corner at the lower right of the left half: left of it {} Right of it {}</span></figcaption></figure>",
        image(below),
        image(above),
        escape(&above.title),
        escape(&below.title).to_lowercase(),
        lowered(&above.caption),
        lowered(&below.caption)
    );
}

/// A sentence that goes on after others.
fn lowered(text: &str) -> String {
    let text = escape(text);
    let mut letters = text.chars();
    letters.next().map(|c| c.to_lowercase().chain(letters).collect()).unwrap_or_default()
}
