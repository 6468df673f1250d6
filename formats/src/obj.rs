//! Wavefront OBJ: positions, polygons, vertex colours, and colour from MTL materials and their textures.
//!
//! Own parser (tobj is the oracle of its tests): tobj reads positions as f32, gives no line in its errors, and refuses a
//! file in which only some vertices are coloured.

use super::detail::{Patch, painted};
use super::texture::{Library, Paint};
use super::{FormatError, beside, cut_polygon, full_scale, refuse_not_finite};
use meshes::Point;
use meshes::surface::{ColouredMesh, TriMesh};
use notices::{Kind, Notice};
use std::collections::BTreeMap;

/// Reads an OBJ. Colours: of the vertices where each has one, else of the materials' textures at each vertex's texture
/// coordinates (the mean over its seams), else none. Where a texture is used, triangles are cut finer until their corners can
/// hold it, and vertices that lie on each other become one. Vertices of one colour hide no texture.
pub fn read(name: &str, bytes: &[u8], files: &BTreeMap<String, Vec<u8>>) -> Result<ColouredMesh, FormatError> {
    read_told(name, bytes, files).map(|(scan, _)| scan)
}

/// As [`read`], with what is odd about the colours.
pub(super) fn read_told(
    name: &str,
    bytes: &[u8],
    files: &BTreeMap<String, Vec<u8>>,
) -> Result<(ColouredMesh, Vec<Notice>), FormatError> {
    let obj = parse(bytes)?;
    let mut notes = Vec::new();
    refuse_not_finite(&obj.positions)?;
    let mut mesh = TriMesh { vertices: obj.positions.clone(), triangles: Vec::with_capacity(obj.faces.len()) };
    let mut face_of = Vec::with_capacity(obj.faces.len());
    for (k, face) in obj.faces.iter().enumerate() {
        let polygon = &obj.corners[face.corners.clone()];
        let polygon: Vec<u32> = polygon.iter().map(|c| c.0).collect();
        cut_polygon(&mesh.vertices, &polygon, &mut mesh.triangles)
            .map_err(|e| FormatError(format!("line {}: {e}", face.line)))?;
        face_of.resize(mesh.triangles.len(), k);
    }
    let coloured = obj.colours.iter().flatten().count();
    let own = if coloured == obj.colours.len() { obj.vertex_colours(&mut notes) } else { Vec::new() };
    if coloured > 0 && own.is_empty() {
        notes.push(Kind::ColoursUnused.notice(format!(
            "{coloured} of {} vertices have a colour; colours of vertices are not used",
            obj.colours.len()
        )));
    }
    if !own.is_empty() && own.iter().any(|c| *c != own[0]) {
        return Ok((ColouredMesh { mesh, colours: own }, notes));
    }
    let paints = paints(name, &obj, files)?;
    for material in obj.materials.iter().filter(|m| !obj.libraries.is_empty() && !paints.contains_key(*m)) {
        notes.push(
            Kind::NoTexture
                .notice(format!("the material {material} has no texture or colour that is there"))
                .of(material),
        );
    }
    let scan = textured(&obj, mesh, &face_of, &paints);
    Ok(match (scan.colours.is_empty(), own.is_empty()) {
        (true, true) => (scan, notes),
        (true, false) => (ColouredMesh { colours: own, ..scan }, notes),
        (false, _) => (scan.welded(), notes),
    })
}

/// Material libraries an OBJ names, as written.
pub(super) fn material_libraries(bytes: &[u8]) -> Vec<String> {
    let mut names = Vec::new();
    for line in bytes.split(|&b| b == b'\n') {
        let line = String::from_utf8_lossy(line);
        if let Some(("mtllib", rest)) = line.trim().split_once(char::is_whitespace) {
            names.push(rest.trim().to_string());
        }
    }
    names
}

struct ParsedFace {
    corners: std::ops::Range<usize>,
    material: Option<usize>,
    line: usize,
}

#[derive(Default)]
struct Parsed {
    positions: Vec<Point>,
    /// As the file has them.
    colours: Vec<Option<[f64; 3]>>,
    texture_coordinates: Vec<[f64; 2]>,
    /// Position and texture coordinate of each face's corners.
    corners: Vec<(u32, Option<u32>)>,
    faces: Vec<ParsedFace>,
    materials: Vec<String>,
    libraries: Vec<String>,
}

fn parse(bytes: &[u8]) -> Result<Parsed, FormatError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut obj = Parsed::default();
    let mut material = None;
    let mut held = String::new();
    for (number, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let text = String::from_utf8_lossy(line);
        let text = uncommented(&text);
        if let Some(start) = text.strip_suffix('\\') {
            held.push_str(start);
            held.push(' ');
            continue;
        }
        held.push_str(text);
        let whole = std::mem::take(&mut held);
        let Some((keyword, rest)) = whole.split_once(char::is_whitespace) else {
            continue;
        };
        let refuse = |what: String| FormatError(format!("line {}: {what}", number + 1));
        match keyword {
            "v" => obj
                .vertex(rest)
                .ok_or_else(|| refuse(format!("expected `v x y z`, found `{}`{}", short(&whole), odd_numbers(rest))))?,
            "vt" => match numbers(rest).as_deref() {
                Some(&[u, v] | &[u, v, _]) => obj.texture_coordinates.push([u, v]),
                Some(&[u]) => obj.texture_coordinates.push([u, 0.0]),
                _ => return Err(refuse(format!("expected `vt u v`, found `{}`", short(&whole)))),
            },
            "f" => {
                let start = obj.corners.len();
                for word in rest.split_whitespace() {
                    let corner = obj.corner(word).map_err(&refuse)?;
                    obj.corners.push(corner);
                }
                obj.faces.push(ParsedFace { corners: start..obj.corners.len(), material, line: number + 1 });
            }
            "usemtl" => {
                let known = obj.materials.iter().position(|m| m == rest.trim());
                material = known.or_else(|| {
                    obj.materials.push(rest.trim().to_string());
                    Some(obj.materials.len() - 1)
                });
            }
            "mtllib" => obj.libraries.push(rest.trim().to_string()),
            _ => {}
        }
    }
    if obj.positions.is_empty() {
        return Err(FormatError("no line `v x y z`: this is no OBJ surface".into()));
    }
    Ok(obj)
}

/// The line without its comment: from a `#` that begins a word; within a word it is a part of a name.
fn uncommented(line: &str) -> &str {
    let starts = |(at, _): &(usize, &str)| *at == 0 || line[..*at].ends_with(char::is_whitespace);
    line.match_indices('#').find(starts).map_or(line, |(at, _)| &line[..at]).trim()
}

fn short(line: &str) -> String {
    line.chars().take(60).collect()
}

/// What is said of words that are numbers once their commas are points, or their exponents are written with E.
pub(super) fn odd_numbers(rest: &str) -> &'static str {
    if rest.contains(',') && numbers(&rest.replace(',', ".")).is_some() {
        ": decimal commas; export it with decimal points (an English locale)"
    } else if rest.contains(['d', 'D']) && numbers(&rest.replace(['d', 'D'], "E")).is_some() {
        ": exponents with D, as Fortran writes them; export it with E"
    } else {
        ""
    }
}

fn numbers(text: &str) -> Option<Vec<f64>> {
    text.split_whitespace().map(|w| w.parse().ok()).collect()
}

impl Parsed {
    fn vertex(&mut self, rest: &str) -> Option<()> {
        let values = numbers(rest)?;
        let (position, colour) = match *values.as_slice() {
            [x, y, z] | [x, y, z, _] => ([x, y, z], None),
            [x, y, z, r, g, b] | [x, y, z, r, g, b, _] => ([x, y, z], Some([r, g, b])),
            _ => return None,
        };
        self.positions.push(Point::from(position));
        self.colours.push(colour);
        Some(())
    }

    /// The vertices' colours, from 0 to 1 or from 0 to 255 as their largest number says.
    fn vertex_colours(&self, notes: &mut Vec<Notice>) -> Vec<[u8; 3]> {
        let largest = self.colours.iter().flatten().flatten().fold(0.0f64, |a, b| a.max(*b));
        let full = full_scale(largest);
        if full > 1.0 {
            notes.push(
                Kind::ColourScale
                    .notice(format!("colours of vertices are read as 0 to {full:.0}, since one is {largest}")),
            );
        }
        let byte = |x: f64| (x / full * 255.0).round().clamp(0.0, 255.0) as u8;
        self.colours.iter().flatten().map(|c| c.map(byte)).collect()
    }

    fn corner(&self, word: &str) -> Result<(u32, Option<u32>), String> {
        let mut parts = word.split('/');
        let vertex = index(parts.next().unwrap_or(""), self.positions.len(), "vertex")?;
        let texture = match parts.next() {
            None | Some("") => None,
            Some(part) => Some(index(part, self.texture_coordinates.len(), "texture coordinate")?),
        };
        Ok((vertex, texture))
    }
}

/// OBJ counts from 1, or backwards from -1.
fn index(word: &str, count: usize, what: &str) -> Result<u32, String> {
    let value: i64 = word.parse().map_err(|_| format!("expected a {what} number, found `{}`", short(word)))?;
    let zero_based = if value < 0 { count as i64 + value } else { value - 1 };
    if value == 0 || zero_based < 0 || zero_based >= count as i64 {
        let hint = if value == 0 { ": its program counts from 0; OBJ counts from 1" } else { "" };
        return Err(format!("names {what} {value}, but {count} stand above it{hint}"));
    }
    u32::try_from(zero_based).map_err(|_| format!("{what} {value} is too large"))
}

/// The paints of the materials that are there, by name.
fn paints(name: &str, obj: &Parsed, files: &BTreeMap<String, Vec<u8>>) -> Result<BTreeMap<String, Paint>, FormatError> {
    let mut paints = BTreeMap::new();
    for library in obj.libraries.iter().filter_map(|l| beside(name, l)) {
        if let Some(bytes) = files.get(&library) {
            let used = |material: &str| obj.materials.iter().any(|m| m == material);
            paints.extend(Library::parse(bytes).paints(&library, files, used)?);
        }
    }
    Ok(paints)
}

/// The surface with the colours of its materials; without colours where no material has a paint that is there.
fn textured(obj: &Parsed, mesh: TriMesh, face_of: &[usize], paints: &BTreeMap<String, Paint>) -> ColouredMesh {
    let of_material: Vec<Option<&Paint>> = obj.materials.iter().map(|m| paints.get(m)).collect();
    let patch = |(corners, &face): (&[u32; 3], &usize)| {
        let face = &obj.faces[face];
        let named = &obj.corners[face.corners.clone()];
        let uv = |v: u32| obj.texture_coordinates.get(named.iter().find(|c| c.0 == v)?.1? as usize).copied();
        let paint = face.material.and_then(|m| of_material[m]);
        Patch { corners: *corners, uv: corners.map(uv), material: face.material, paint }
    };
    let patches: Vec<Patch> = mesh.triangles.iter().zip(face_of).map(patch).collect();
    painted(mesh.vertices, patches)
}
