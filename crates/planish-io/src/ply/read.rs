//! Vertices, faces and vertex attributes out of a PLY file.

use super::body::Body;
use super::header::{Element, Encoding, Header, Kind, Scalar, header};
use crate::polygon::{Polygons, checked};
use crate::{Place, ReadError};
use glam::DVec3;
use planish::mesh::{Attribute, TriMesh};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};

/// Reads a mesh. `nx ny nz` become `"normal"`; `red green blue [alpha]` become `"color"`, whole numbers scaled
/// to 0..1; `name_0 .. name_k` become one attribute of width `k + 1`; every other number per vertex becomes an
/// attribute of its own. Elements other than `vertex`, `face` and `tristrips` and lists per vertex are skipped.
///
/// The second result are the edges of an element `edge` with `vertex1` and `vertex2`.
pub(crate) fn read(bytes: &[u8]) -> Result<(TriMesh, Vec<[u32; 2]>), ReadError> {
    let head = header(bytes)?;
    let Some(vertex) = head.elements.iter().find(|e| e.name == "vertex") else {
        return Err(ReadError::Header {
            what: "there is no element \"vertex\"".into(),
            place: Place::Line(head.body_line - 1),
            hint: "the file holds no mesh",
        });
    };
    let layout = Layout::of(vertex, &head)?;
    let mut mesh = TriMesh::default();
    let mut polygons = Polygons::default();
    let mut edges = Vec::new();
    let mut body = Body::new(bytes, head.encoding, head.body, head.body_line);
    let mut seen = false;
    for element in &head.elements {
        check_room(element, &head, body.left(bytes.len()), body.place())?;
        if element.properties.is_empty() {
            continue;
        }
        match element.name.as_str() {
            "vertex" if !seen => {
                seen = true;
                if element.count >= u32::MAX as u64 {
                    let limit = u32::MAX as u64 - 1;
                    let (count, place) = (element.count, body.place());
                    return Err(ReadError::TooLarge { what: "vertices", count, limit, place });
                }
                layout.read(element, &mut body, &mut mesh, bytes.len())?;
            }
            "face" | "tristrips" => {
                faces(element, &mut body, &mut polygons, vertex.count as usize, bytes.len())?;
            }
            "edge" if edges.is_empty() => edges = read_edges(element, &mut body, vertex.count, bytes.len())?,
            _ => skip(element, &mut body, bytes.len())?,
        }
    }
    if let Body::Ascii { lines, .. } = &mut body
        && let Some(mut words) = lines.next_words()
    {
        let what = super::body::unexpected(words.next().unwrap_or_default());
        return Err(ReadError::Syntax { what, place: Place::Line(lines.number()) });
    }
    mesh.triangles = polygons.triangulate(&mesh.points, Place::Face)?;
    Ok((checked(mesh, polygons.count())?, edges))
}

/// True if the file is a PLY whose header has vertices and no faces.
pub(crate) fn is_points(file: &mut BufReader<File>) -> bool {
    beginning(file).is_ok_and(|bytes| {
        header(&bytes).is_ok_and(|head| {
            let some = |name: &str| head.elements.iter().any(|e| e.name == name && e.count > 0);
            some("vertex") && !some("face") && !some("tristrips")
        })
    })
}

/// How many vertices the header tells of.
pub(crate) fn told(file: &mut BufReader<File>) -> Result<u64, ReadError> {
    let head = header(&beginning(file)?)?;
    Ok(head.elements.iter().find(|e| e.name == "vertex").map_or(0, |e| e.count))
}

/// The bytes of a file up to the end of its header, about.
fn beginning(file: &mut BufReader<File>) -> Result<Vec<u8>, ReadError> {
    let mut bytes = Vec::new();
    while bytes.len() < HEADER_MOST && !bytes.windows(HEADER_END.len()).any(|w| w == HEADER_END) {
        // An end of line follows the last word.
        if file.by_ref().take(HEADER_PIECE).read_to_end(&mut bytes)? == 0 {
            break;
        }
    }
    Ok(bytes)
}

/// Reads the vertices alone, as points: coordinates that are not numbers stay, faces are stepped over.
pub(crate) fn read_points(bytes: &[u8]) -> Result<TriMesh, ReadError> {
    let head = header(bytes)?;
    let Some(at) = head.elements.iter().position(|e| e.name == "vertex") else {
        return Err(ReadError::NoPoints);
    };
    let layout = Layout::of(&head.elements[at], &head)?;
    let mut mesh = TriMesh::default();
    let mut body = Body::new(bytes, head.encoding, head.body, head.body_line);
    for element in &head.elements[..=at] {
        check_room(element, &head, body.left(bytes.len()), body.place())?;
        if element.name == "vertex" {
            layout.read(element, &mut body, &mut mesh, bytes.len())?;
        } else if !element.properties.is_empty() {
            skip(element, &mut body, bytes.len())?;
        }
    }
    Ok(mesh)
}

/// Reads the vertices alone, so many at once, if they are the first element, binary and without lists; else all at once.
pub(crate) fn pieces(
    mut file: BufReader<File>,
    at_once: usize,
    take: &mut dyn FnMut(TriMesh) -> Result<(), ReadError>,
) -> Result<(), ReadError> {
    let mut bytes = beginning(&mut file)?;
    let head = header(&bytes);
    let size = file.get_ref().metadata()?.len();
    let first = head.as_ref().ok().filter(|h| h.encoding != Encoding::Ascii).and_then(|h| h.elements.first());
    let fixed = first.filter(|e| e.name == "vertex").and_then(Element::fixed_bytes).filter(|&size| size > 0);
    let (Ok(head), Some(vertex), Some(record)) = (&head, first, fixed) else {
        file.read_to_end(&mut bytes)?;
        return take(read_points(&bytes)?);
    };
    let layout = Layout::of(vertex, head)?;
    check_room(vertex, head, size - head.body as u64, Place::Byte(head.body))?;
    file.seek(SeekFrom::Start(head.body as u64))?;
    let mut left = vertex.count as usize;
    while left > 0 {
        let count = at_once.min(left);
        bytes.resize(count * record, 0);
        file.read_exact(&mut bytes)?;
        let mut mesh = TriMesh::default();
        let some = Element { count: count as u64, ..vertex.clone() };
        layout.read(&some, &mut Body::new(&bytes, head.encoding, 0, 1), &mut mesh, bytes.len())?;
        take(mesh)?;
        left -= count;
    }
    Ok(())
}

const HEADER_END: &[u8] = b"end_header";
/// Bytes of a header that are read at once, and at most: a longer one is read with the rest of the file.
const HEADER_PIECE: u64 = 1 << 12;
const HEADER_MOST: usize = 1 << 17;

/// Refuses an element that the rest of a file has no room for.
fn check_room(element: &Element, head: &Header, left: u64, place: Place) -> Result<(), ReadError> {
    let needed = element.count.saturating_mul(element.least_bytes(head.encoding));
    // The last number of an ascii file needs no blank after it, hence the one byte.
    if needed > left + 1 {
        let what = format!("\"element {} {}\"", element.name, element.count);
        return Err(ReadError::Truncated { what, needed, left, place });
    }
    Ok(())
}

/// The two ends of each edge; none if the element is another thing of that name.
fn read_edges(element: &Element, body: &mut Body, vertices: u64, total: usize) -> Result<Vec<[u32; 2]>, ReadError> {
    let whole = |name: &str| {
        let is = |p: &super::header::Property| p.name == name && matches!(p.kind, Kind::One(s) if !s.is_real());
        element.properties.iter().position(is)
    };
    let (Some(first), Some(second)) = (whole("vertex1"), whole("vertex2")) else {
        skip(element, body, total)?;
        return Ok(Vec::new());
    };
    let mut edges = Vec::new();
    for e in 0..element.count {
        body.begin(&element.name)?;
        let mut ends = [0u32; 2];
        for (p, property) in element.properties.iter().enumerate() {
            match property.kind {
                Kind::One(scalar) if p == first || p == second => {
                    let index = body.whole(scalar)?;
                    if !(0..vertices as i64).contains(&index) {
                        let place = Place::Item("edge", e as usize);
                        return Err(ReadError::Index { index, vertices: vertices as usize, place });
                    }
                    ends[(p == second) as usize] = index as u32;
                }
                kind => skip_one(kind, body, total)?,
            }
        }
        edges.push(ends);
    }
    Ok(edges)
}

/// Where the numbers of a vertex go.
struct Layout {
    /// For each property its target: coordinate, number of an attribute, or nowhere.
    targets: Vec<Target>,
    attributes: Vec<(String, usize)>,
}

#[derive(Clone, Copy, PartialEq)]
enum Target {
    Coordinate(usize),
    Attribute { which: usize, component: usize, scale: f64 },
    Skip,
}

impl Layout {
    fn of(vertex: &Element, head: &Header) -> Result<Layout, ReadError> {
        let find = |name: &str| vertex.properties.iter().position(|p| p.name == name && matches!(p.kind, Kind::One(_)));
        let mut layout = Layout { targets: vec![Target::Skip; vertex.properties.len()], attributes: Vec::new() };
        for (k, name) in ["x", "y", "z"].into_iter().enumerate() {
            let Some(p) = find(name) else {
                return Err(ReadError::Header {
                    what: format!("the vertices have no \"{name}\""),
                    place: Place::Line(head.body_line - 1),
                    hint: "a mesh needs the vertex properties x, y and z",
                });
            };
            layout.targets[p] = Target::Coordinate(k);
        }
        let groups: [(&str, &[&str]); 4] = [
            ("normal", &["nx", "ny", "nz"]),
            ("color", &["red", "green", "blue", "alpha"]),
            ("color", &["red", "green", "blue"]),
            ("color", &["diffuse_red", "diffuse_green", "diffuse_blue"]),
        ];
        for (name, members) in groups {
            let found: Vec<usize> = members.iter().filter_map(|m| find(m)).collect();
            if found.len() == members.len() && !layout.attributes.iter().any(|(n, _)| n == name) {
                layout.add(name, &found, vertex, name == "color");
            }
        }
        for p in 0..vertex.properties.len() {
            let name = &vertex.properties[p].name;
            if layout.targets[p] != Target::Skip || find(name) != Some(p) {
                continue;
            }
            let mut members = vec![p];
            let mut base = name.as_str();
            if let Some(stem) = name.strip_suffix("_0")
                && !stem.is_empty()
                && vertex.properties.iter().all(|other| other.name != stem)
            {
                while let Some(next) = find(&format!("{stem}_{}", members.len())) {
                    members.push(next);
                }
                if members.len() > 1 {
                    base = stem;
                }
            }
            layout.add(base, &members, vertex, false);
        }
        Ok(layout)
    }

    fn add(&mut self, name: &str, members: &[usize], vertex: &Element, color: bool) {
        for (component, &p) in members.iter().enumerate() {
            let scale = match vertex.properties[p].kind {
                Kind::One(Scalar::U8) if color => 1.0 / 255.0,
                Kind::One(Scalar::U16) if color => 1.0 / 65535.0,
                _ => 1.0,
            };
            self.targets[p] = Target::Attribute { which: self.attributes.len(), component, scale };
        }
        self.attributes.push((name.to_string(), members.len()));
    }

    fn read(&self, element: &Element, body: &mut Body, mesh: &mut TriMesh, total: usize) -> Result<(), ReadError> {
        let n = element.count as usize;
        mesh.points = vec![DVec3::ZERO; n];
        let filled = |(name, width): &(String, usize)| Attribute {
            name: name.clone(),
            width: *width,
            values: vec![0.0; width * n],
        };
        mesh.attributes = self.attributes.iter().map(filled).collect();
        if let Some(size) = element.fixed_bytes()
            && let Body::Binary { big, .. } = *body
            && let Some(block) = body.block(size * n)
        {
            return self.read_block(element, block, size, big, mesh);
        }
        for v in 0..n {
            body.begin(&element.name)?;
            for (property, &target) in element.properties.iter().zip(&self.targets) {
                match (property.kind, target) {
                    (Kind::One(scalar), Target::Coordinate(k)) => mesh.points[v][k] = body.real(scalar)?,
                    (Kind::One(scalar), Target::Attribute { which, component, scale }) => {
                        let attribute = &mut mesh.attributes[which];
                        attribute.values[v * attribute.width + component] = (body.real(scalar)? * scale) as f32;
                    }
                    (Kind::One(scalar), Target::Skip) => body.skip(1, scalar)?,
                    (Kind::List { count, item }, _) => {
                        let n = body.count(count, item, total)?;
                        body.skip(n, item)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Binary vertices of fixed size: property by property, so that the type is looked at once.
    fn read_block(
        &self,
        element: &Element,
        block: &[u8],
        size: usize,
        big: bool,
        mesh: &mut TriMesh,
    ) -> Result<(), ReadError> {
        let mut at = 0;
        for (property, &target) in element.properties.iter().zip(&self.targets) {
            let Kind::One(scalar) = property.kind else { continue };
            match target {
                Target::Coordinate(k) => {
                    column(block, size, at, scalar, big, |v, x| mesh.points[v][k] = x);
                }
                Target::Attribute { which, component, scale } => {
                    let Attribute { width, values, .. } = &mut mesh.attributes[which];
                    column(block, size, at, scalar, big, |v, x| values[v * *width + component] = (x * scale) as f32);
                }
                Target::Skip => {}
            }
            at += scalar.size();
        }
        Ok(())
    }
}

/// One property of all vertices of `size` bytes each.
fn column(block: &[u8], size: usize, at: usize, scalar: Scalar, big: bool, mut put: impl FnMut(usize, f64)) {
    macro_rules! each {
        ($t:ty) => {
            for (v, record) in block.chunks_exact(size).enumerate() {
                let mut number = [0u8; std::mem::size_of::<$t>()];
                number.copy_from_slice(&record[at..at + std::mem::size_of::<$t>()]);
                let value = if big { <$t>::from_be_bytes(number) } else { <$t>::from_le_bytes(number) };
                put(v, value as f64);
            }
        };
    }
    match scalar {
        Scalar::I8 => each!(i8),
        Scalar::U8 => each!(u8),
        Scalar::I16 => each!(i16),
        Scalar::U16 => each!(u16),
        Scalar::I32 => each!(i32),
        Scalar::U32 => each!(u32),
        Scalar::F32 => each!(f32),
        Scalar::F64 => each!(f64),
    }
}

/// Faces of an element `face`, or triangle strips (`-1` ends one) of an element `tristrips`.
/// * `vertices` - number of vertices, for messages
fn faces(
    element: &Element,
    body: &mut Body,
    polygons: &mut Polygons,
    vertices: usize,
    total: usize,
) -> Result<(), ReadError> {
    let named = |name: &str| element.properties.iter().position(|p| p.name == name);
    let indices = named("vertex_indices").or_else(|| named("vertex_index"));
    let Some((indices, Kind::List { count, item })) = indices.map(|p| (p, element.properties[p].kind)) else {
        return Err(ReadError::Header {
            what: format!("the element \"{}\" has no list \"vertex_indices\"", element.name),
            place: Place::Line(1),
            hint: "faces need the property \"list uchar int vertex_indices\"",
        });
    };
    let first = polygons.count();
    if first == 0 {
        *polygons = Polygons::with_capacity(element.count as usize);
    }
    let strips = element.name == "tristrips";
    if !strips && element.properties.len() == 1 && (count, item.size(), item.is_real()) == (Scalar::U8, 4, false) {
        leading_triangles(element.count as usize, body, polygons);
    }
    let mut list = Vec::new();
    for f in polygons.count() - first..element.count as usize {
        one(element, indices, body, total, &mut list)?;
        let unknown = |v: i64| !((0..u32::MAX as i64).contains(&v) || strips && v == -1);
        if let Some(&index) = list.iter().find(|&&v| unknown(v)) {
            return Err(ReadError::Index { index, vertices, place: Place::Face(f) });
        }
        if strips {
            cut_strips(&list, polygons);
        } else {
            polygons.corners.extend(list.iter().map(|&v| v as u32));
            polygons.close();
        }
    }
    Ok(())
}

/// The usual binary faces, a byte 3 and three 32-bit indices, up to the first that differs.
fn leading_triangles(count: usize, body: &mut Body, polygons: &mut Polygons) {
    let Body::Binary { bytes, at, big } = body else { return };
    for record in bytes[*at..].chunks_exact(13).take(count) {
        if record[0] != 3 {
            break;
        }
        let corner = |k: usize| {
            let number = [record[k], record[k + 1], record[k + 2], record[k + 3]];
            if *big { u32::from_be_bytes(number) } else { u32::from_le_bytes(number) }
        };
        let triangle = [corner(1), corner(5), corner(9)];
        // Above this an index may be a negative one: the careful way gives the message.
        if triangle.iter().any(|&v| v > i32::MAX as u32) {
            break;
        }
        polygons.corners.extend(triangle);
        polygons.close();
        *at += 13;
    }
}

/// Reads one face: the numbers of property `indices` into `list`; the others are stepped over.
fn one(element: &Element, indices: usize, body: &mut Body, total: usize, list: &mut Vec<i64>) -> Result<(), ReadError> {
    list.clear();
    body.begin(&element.name)?;
    for (p, property) in element.properties.iter().enumerate() {
        match property.kind {
            Kind::One(scalar) => body.skip(1, scalar)?,
            Kind::List { count, item } => {
                let n = body.count(count, item, total)?;
                if p == indices {
                    for _ in 0..n {
                        list.push(body.whole(item)?);
                    }
                } else {
                    body.skip(n, item)?;
                }
            }
        }
    }
    Ok(())
}

/// Strips to triangles: every second one is turned round.
fn cut_strips(strip: &[i64], polygons: &mut Polygons) {
    for run in strip.split(|&v| v == -1) {
        for (k, three) in run.windows(3).enumerate() {
            let order = if k % 2 == 0 { [0, 1, 2] } else { [1, 0, 2] };
            polygons.corners.extend(order.map(|i| three[i] as u32));
            polygons.close();
        }
    }
}

/// Steps over an element that is not wanted.
fn skip(element: &Element, body: &mut Body, total: usize) -> Result<(), ReadError> {
    if let (Some(size), Body::Binary { .. }) = (element.fixed_bytes(), &*body) {
        // The element's bytes were checked against the rest of the file, but for one.
        let (needed, left) = (element.count * size as u64, body.left(total));
        return match body.block(needed as usize) {
            Some(_) => Ok(()),
            None => {
                let what = format!("element \"{}\"", element.name);
                Err(ReadError::Truncated { what, needed, left, place: body.place() })
            }
        };
    }
    for _ in 0..element.count {
        body.begin(&element.name)?;
        for property in &element.properties {
            skip_one(property.kind, body, total)?;
        }
    }
    Ok(())
}

/// Steps over one property.
fn skip_one(kind: Kind, body: &mut Body, total: usize) -> Result<(), ReadError> {
    match kind {
        Kind::One(scalar) => body.skip(1, scalar),
        Kind::List { count, item } => {
            let n = body.count(count, item, total)?;
            body.skip(n, item)
        }
    }
}
