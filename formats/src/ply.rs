//! PLY: read with vertex colours or a texture, written little-endian with double coordinates and optional per-vertex scalars.

use super::detail::{Patch, painted};
use super::texture::{Paint, texture};
use super::{FormatError, beside, cut_polygon, full_scale, refuse_not_finite};
use meshes::Point;
use meshes::surface::{ColouredMesh, TriMesh};
use notices::{Kind, Notice};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType};
use std::collections::BTreeMap;
use std::io::{self, Write};

/// Reads a PLY surface as [`read`] does. Where it names textures (`comment TextureFile NAME`) that are among `files`, and its faces have a
/// list `texcoord` or its vertices texture coordinates, the colours are the textures', and triangles are cut finer until their corners
/// can hold them.
pub fn read_textured(name: &str, bytes: &[u8], files: &BTreeMap<String, Vec<u8>>) -> Result<ColouredMesh, FormatError> {
    read_told(name, bytes, files).map(|(scan, _)| scan)
}

/// As [`read_textured`], with what is odd about the colours.
pub(super) fn read_told(
    name: &str,
    bytes: &[u8],
    files: &BTreeMap<String, Vec<u8>>,
) -> Result<(ColouredMesh, Vec<Notice>), FormatError> {
    let parsed = parse(bytes)?;
    let mut paints = Vec::new();
    for path in textures(bytes).iter().filter_map(|t| beside(name, t)) {
        paints.push(texture(&path, files)?);
    }
    let scan = parsed.surface()?;
    let mut notes = parsed.notes();
    if !paints.iter().all(Option::is_none) && !parsed.has_places() {
        notes.push(
            Kind::TextureUnplaced.notice("it names a texture and has no texture coordinates: the texture is not used"),
        );
    }
    if paints.iter().all(Option::is_none) || !parsed.has_places() {
        return Ok((scan, notes));
    }
    let painted = painted(scan.mesh.vertices.clone(), parsed.patches(&scan, &paints));
    Ok((if painted.colours.is_empty() { scan } else { painted.welded() }, notes))
}

/// Textures that a PLY names, as written.
pub(super) fn textures(bytes: &[u8]) -> Vec<String> {
    let mut names = Vec::new();
    for line in bytes.split(|&b| b == b'\n').take(1000) {
        let line = String::from_utf8_lossy(line);
        let line = line.trim();
        if line == "end_header" {
            break;
        }
        if let Some(name) = line.strip_prefix("comment TextureFile") {
            names.push(name.trim().to_string());
        }
    }
    names
}

/// Reads a PLY surface, ASCII or binary of either byte order: `vertex` with x, y, z of any number type and, where there,
/// red, green, blue (or r, g, b; 0..1, 0..255 or 0..65535 as their type and their largest number say), else those of the faces; `face` with `vertex_indices` (or `vertex_index`) of any whole-number type.
/// Polygons are cut into triangles; other elements and properties are passed over.
pub fn read(bytes: &[u8]) -> Result<ColouredMesh, FormatError> {
    parse(bytes)?.surface()
}

/// What a PLY holds.
#[derive(Default)]
struct Parsed {
    vertices: Vec<Vertex>,
    /// Type of the vertices' colours; none where they have none.
    coloured: Option<ScalarType>,
    faces: Vec<Face>,
    /// Type of the faces' colours.
    faces_coloured: Option<ScalarType>,
}

fn parse(bytes: &[u8]) -> Result<Parsed, FormatError> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<Row>::new().read_header(&mut reader).map_err(|e| FormatError(format!("PLY header: {e}")))?;
    let mut parsed = Parsed::default();
    for (name, element) in &header.elements {
        check_claim(element, &header, bytes.len())?;
        match name.as_str() {
            "vertex" => {
                check_vertex(element)?;
                parsed.vertices = rows(&mut reader, element, &header)?;
                parsed.coloured = colour_type(element);
            }
            "face" => {
                if !element.properties.keys().any(|k| is_corner_list(k)) {
                    return Err(FormatError("the PLY's faces have no list `vertex_indices`".into()));
                }
                parsed.faces = rows::<Face>(&mut reader, element, &header)?;
                parsed.faces_coloured = colour_type(element);
            }
            "tristrips" => {
                return Err(FormatError("the PLY holds triangle strips; export it with plain faces".into()));
            }
            _ => {
                rows::<Row>(&mut reader, element, &header)?;
            }
        }
    }
    Ok(parsed)
}

impl Parsed {
    fn surface(&self) -> Result<ColouredMesh, FormatError> {
        let vertices: Vec<Point> = self.vertices.iter().map(|v| Point::from(v.position)).collect();
        refuse_not_finite(&vertices)?;
        let triangles = triangles(&vertices, &self.faces)?;
        let colours = match (&self.coloured, &self.faces_coloured) {
            (Some(kind), _) => bytes_of(kind, self.vertices.iter().map(|v| v.colour)),
            (None, Some(kind)) => self.of_faces(kind),
            (None, None) => Vec::new(),
        };
        Ok(ColouredMesh { mesh: TriMesh { vertices, triangles }, colours })
    }

    /// Each vertex the mean of the colours of its faces.
    fn of_faces(&self, kind: &ScalarType) -> Vec<[u8; 3]> {
        let own = bytes_of(kind, self.faces.iter().map(|f| f.colour));
        let mut sums = vec![([0u32; 3], 0u32); self.vertices.len()];
        for (face, colour) in self.faces.iter().zip(&own) {
            for corner in &face.corners {
                let Some((sum, count)) = usize::try_from(*corner).ok().and_then(|v| sums.get_mut(v)) else { continue };
                (0..3).for_each(|k| sum[k] += u32::from(colour[k]));
                *count += 1;
            }
        }
        sums.into_iter().map(|(sum, count)| sum.map(|x| (x / count.max(1)) as u8)).collect()
    }

    /// What is odd about the colours.
    fn notes(&self) -> Vec<Notice> {
        let faces = self.coloured.is_none() && self.faces_coloured.is_some();
        faces
            .then(|| Kind::FaceColours.notice("its colours lie on the faces: each vertex gets the mean of its faces"))
            .into_iter()
            .collect()
    }

    /// Whether anything has texture coordinates.
    fn has_places(&self) -> bool {
        self.faces.iter().any(|f| !f.texture.is_empty()) || self.vertices.iter().any(|v| v.texture.is_some())
    }

    /// The surface's triangles with their places on the textures; a face's own before its vertices'.
    fn patches<'a>(&self, scan: &ColouredMesh, paints: &'a [Option<Paint>]) -> Vec<Patch<'a>> {
        // Each face gave two triangles fewer than it has corners.
        let owners = self.faces.iter().flat_map(|f| std::iter::repeat_n(f, f.corners.len().saturating_sub(2)));
        let place = |face: &Face, v: u32| {
            let own = face.corners.iter().position(|c| *c == i64::from(v)).and_then(|k| {
                let [s, t] = face.texture.get(2 * k..2 * k + 2)? else { return None };
                Some([*s, *t])
            });
            own.or(self.vertices.get(v as usize).and_then(|v| v.texture))
        };
        scan.mesh
            .triangles
            .iter()
            .zip(owners)
            .map(|(corners, face)| Patch {
                corners: *corners,
                uv: corners.map(|v| place(face, v)),
                material: Some(face.number),
                paint: paints.get(face.number).and_then(Option::as_ref),
            })
            .collect()
    }
}

fn rows<E: PropertyAccess>(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &Header,
) -> Result<Vec<E>, FormatError> {
    Parser::<E>::new().read_payload_for_element(reader, element, header).map_err(|e| {
        let text: String = e.to_string().split_whitespace().collect::<Vec<_>>().join(" ").chars().take(300).collect();
        FormatError(format!("PLY element `{}`: {text}", element.name))
    })
}

/// A row takes at least a byte a property, so no honest count exceeds the bytes there are.
fn check_claim(element: &ElementDef, header: &Header, bytes: usize) -> Result<(), FormatError> {
    let row: usize = match header.encoding {
        Encoding::Ascii => 2 * element.properties.len(),
        _ => element.properties.values().map(|p| least_bytes(&p.data_type)).sum(),
    };
    if element.count > 0 && (row == 0 || element.count.saturating_mul(row) > bytes.saturating_add(row)) {
        return Err(FormatError(format!(
            "the PLY header counts {} of `{}`, at least {row} bytes each, but the file has {bytes}: it was cut short; export or copy it again",
            element.count, element.name
        )));
    }
    Ok(())
}

fn least_bytes(data_type: &PropertyType) -> usize {
    let scalar = match data_type {
        PropertyType::Scalar(s) | PropertyType::List(s, _) => s,
    };
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

fn check_vertex(element: &ElementDef) -> Result<(), FormatError> {
    for key in ["x", "y", "z"] {
        if !element.properties.keys().any(|name| name.eq_ignore_ascii_case(key)) {
            return Err(FormatError(format!("the PLY's vertices have no property `{key}`")));
        }
    }
    Ok(())
}

/// Which of the three channels a property is, as programs name them.
fn channel(name: &str) -> Option<usize> {
    let name = name.to_ascii_lowercase();
    let name = name.strip_prefix("diffuse_").unwrap_or(&name);
    [["red", "r"], ["green", "g"], ["blue", "b"]].iter().position(|names| names.contains(&name))
}

/// The type of an element's colours; none where a channel is missing.
fn colour_type(element: &ElementDef) -> Option<ScalarType> {
    let [red, green, blue] = [0, 1, 2].map(|k| {
        element.properties.iter().find(|(name, _)| channel(name) == Some(k)).and_then(|(_, p)| match &p.data_type {
            PropertyType::Scalar(s) => Some(s.clone()),
            PropertyType::List(..) => None,
        })
    });
    red.filter(|_| green.is_some() && blue.is_some())
}

/// Colours as bytes: a byte's are 0 to 255; of wider numbers the largest tells what they run to.
fn bytes_of(kind: &ScalarType, colours: impl Iterator<Item = [f64; 3]> + Clone) -> Vec<[u8; 3]> {
    let largest = colours.clone().flatten().fold(0.0f64, f64::max);
    let full = match kind {
        ScalarType::Char | ScalarType::UChar => 255.0,
        ScalarType::Float | ScalarType::Double => full_scale(largest),
        _ => full_scale(largest.max(2.0)),
    };
    colours.map(|c| c.map(|x| (x / full * 255.0).round().clamp(0.0, 255.0) as u8)).collect()
}

fn is_corner_list(name: &str) -> bool {
    name == "vertex_indices" || name == "vertex_index"
}

fn triangles(vertices: &[Point], faces: &[Face]) -> Result<Vec<[u32; 3]>, FormatError> {
    let mut triangles = Vec::with_capacity(faces.len());
    let mut polygon = Vec::new();
    for (f, face) in faces.iter().enumerate() {
        polygon.clear();
        for &corner in &face.corners {
            match u32::try_from(corner) {
                Ok(v) if (v as usize) < vertices.len() => polygon.push(v),
                _ => {
                    return Err(FormatError(format!(
                        "face {} names vertex {corner}, but vertices are numbered 0 to {}",
                        f + 1,
                        vertices.len() as i64 - 1
                    )));
                }
            }
        }
        cut_polygon(vertices, &polygon, &mut triangles).map_err(|e| FormatError(format!("face {}: {e}", f + 1)))?;
    }
    Ok(triangles)
}

/// An element that keeps nothing.
struct Row;

impl PropertyAccess for Row {
    fn new() -> Self {
        Row
    }
}

struct Vertex {
    position: [f64; 3],
    /// As the file has it.
    colour: [f64; 3],
    texture: Option<[f64; 2]>,
}

impl Vertex {
    fn set(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        match name {
            "x" | "X" => self.position[0] = value,
            "y" | "Y" => self.position[1] = value,
            "z" | "Z" => self.position[2] = value,
            "s" | "u" | "texture_u" => self.texture.get_or_insert([0.0; 2])[0] = value,
            "t" | "v" | "texture_v" => self.texture.get_or_insert([0.0; 2])[1] = value,
            _ => {
                let Some(channel) = channel(name) else { return PropertyAccessResult::Ignored };
                self.colour[channel] = value;
            }
        }
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Vertex { position: [f64::NAN; 3], colour: [0.0; 3], texture: None }
    }
    fn set_char(&mut self, name: &str, value: i8) -> PropertyAccessResult {
        self.set(name, f64::from(value))
    }
    fn set_uchar(&mut self, name: &str, value: u8) -> PropertyAccessResult {
        self.set(name, f64::from(value))
    }
    fn set_short(&mut self, name: &str, value: i16) -> PropertyAccessResult {
        self.set(name, f64::from(value))
    }
    fn set_ushort(&mut self, name: &str, value: u16) -> PropertyAccessResult {
        self.set(name, f64::from(value))
    }
    fn set_int(&mut self, name: &str, value: i32) -> PropertyAccessResult {
        self.set(name, f64::from(value))
    }
    fn set_uint(&mut self, name: &str, value: u32) -> PropertyAccessResult {
        self.set(name, f64::from(value))
    }
    fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        self.set(name, f64::from(value))
    }
    fn set_double(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        self.set(name, value)
    }
}

struct Face {
    corners: Vec<i64>,
    /// Two a corner.
    texture: Vec<f64>,
    /// Which texture.
    number: usize,
    /// As the file has it.
    colour: [f64; 3],
}

impl Face {
    fn set<T: Into<i64>>(&mut self, name: &str, value: Vec<T>) -> PropertyAccessResult {
        if !is_corner_list(name) {
            return PropertyAccessResult::Ignored;
        }
        self.corners = value.into_iter().map(Into::into).collect();
        PropertyAccessResult::Set
    }
    fn places<T: Into<f64>>(&mut self, name: &str, value: Vec<T>) -> PropertyAccessResult {
        if is_corner_list(name) {
            return PropertyAccessResult::UnsupportedType;
        }
        if name != "texcoord" {
            return PropertyAccessResult::Ignored;
        }
        self.texture = value.into_iter().map(Into::into).collect();
        PropertyAccessResult::Set
    }
    fn paint(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        let Some(channel) = channel(name) else { return PropertyAccessResult::Ignored };
        self.colour[channel] = value;
        PropertyAccessResult::Set
    }
    fn number(&mut self, name: &str, value: i64) -> PropertyAccessResult {
        if channel(name).is_some() {
            return self.paint(name, value as f64);
        }
        if name != "texnumber" {
            return PropertyAccessResult::Ignored;
        }
        self.number = usize::try_from(value).unwrap_or(usize::MAX);
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Face { corners: Vec::new(), texture: Vec::new(), number: 0, colour: [0.0; 3] }
    }
    fn set_list_char(&mut self, name: &str, value: Vec<i8>) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_list_uchar(&mut self, name: &str, value: Vec<u8>) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_list_short(&mut self, name: &str, value: Vec<i16>) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_list_ushort(&mut self, name: &str, value: Vec<u16>) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_list_int(&mut self, name: &str, value: Vec<i32>) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_list_uint(&mut self, name: &str, value: Vec<u32>) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_list_float(&mut self, name: &str, value: Vec<f32>) -> PropertyAccessResult {
        self.places(name, value)
    }
    fn set_list_double(&mut self, name: &str, value: Vec<f64>) -> PropertyAccessResult {
        self.places(name, value)
    }
    fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        self.paint(name, value.into())
    }
    fn set_double(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        self.paint(name, value)
    }
    fn set_char(&mut self, name: &str, value: i8) -> PropertyAccessResult {
        self.paint(name, value.into())
    }
    fn set_short(&mut self, name: &str, value: i16) -> PropertyAccessResult {
        self.paint(name, value.into())
    }
    fn set_ushort(&mut self, name: &str, value: u16) -> PropertyAccessResult {
        self.paint(name, value.into())
    }
    fn set_uint(&mut self, name: &str, value: u32) -> PropertyAccessResult {
        self.paint(name, value.into())
    }
    fn set_uchar(&mut self, name: &str, value: u8) -> PropertyAccessResult {
        self.number(name, value.into())
    }
    fn set_int(&mut self, name: &str, value: i32) -> PropertyAccessResult {
        self.number(name, value.into())
    }
}

/// Writes a surface with named per-vertex scalars (each as long as the vertices).
pub fn write(out: &mut dyn Write, mesh: &TriMesh, scalars: &[(&str, &[f64])]) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.vertices.len())?;
    writeln!(out, "property double x\nproperty double y\nproperty double z")?;
    for (name, _) in scalars {
        writeln!(out, "property float {name}")?;
    }
    writeln!(out, "element face {}\nproperty list uchar int vertex_indices\nend_header", mesh.triangles.len())?;
    for (i, p) in mesh.vertices.iter().enumerate() {
        for x in p.coords.iter() {
            out.write_all(&x.to_le_bytes())?;
        }
        for (_, values) in scalars {
            out.write_all(&(values[i] as f32).to_le_bytes())?;
        }
    }
    for t in &mesh.triangles {
        out.write_all(&[3])?;
        for v in t {
            out.write_all(&v.to_le_bytes())?;
        }
    }
    Ok(())
}

/// Writes a coloured surface; float coordinates, as scanners do.
pub fn write_coloured(out: &mut dyn Write, scan: &ColouredMesh) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", scan.mesh.vertices.len())?;
    writeln!(out, "property float x\nproperty float y\nproperty float z")?;
    writeln!(out, "property uchar red\nproperty uchar green\nproperty uchar blue")?;
    writeln!(out, "element face {}\nproperty list uchar int vertex_indices\nend_header", scan.mesh.triangles.len())?;
    for (p, c) in scan.mesh.vertices.iter().zip(&scan.colours) {
        for x in p.coords.iter() {
            out.write_all(&(*x as f32).to_le_bytes())?;
        }
        out.write_all(c)?;
    }
    for t in &scan.mesh.triangles {
        out.write_all(&[3])?;
        for v in t {
            out.write_all(&v.to_le_bytes())?;
        }
    }
    Ok(())
}
