//! STL, binary and ASCII, read; binary, written.
//!
//! Own parser, since `stl_io` refuses a bare `solid`, upper case and leading blank lines, reads the first of several
//! solids only, believes a wrong count and accepts NaN.

use super::{FormatError, refuse_not_finite};
use meshes::Point;
use meshes::surface::TriMesh;
use std::collections::BTreeMap;
use std::io::{self, Write};

const HEADER: usize = 84;
const FACET: usize = 50;

/// Reads an STL; equal corners (to the last bit) become one vertex, in order of first appearance. The winding counts,
/// the stored normals do not.
pub fn read(bytes: &[u8]) -> Result<TriMesh, FormatError> {
    let mesh = if looks_binary(bytes) {
        read_binary(bytes)
    } else if looks_ascii(bytes) {
        read_ascii(bytes)?
    } else if bytes.len() < HEADER {
        return Err(FormatError(format!(
            "{} bytes, too short for a binary STL (84 bytes and 50 a triangle), and not ASCII (it does not begin with `solid`)",
            bytes.len()
        )));
    } else {
        let (count, length) = (u64::from(count(bytes)), bytes.len() as u64);
        let counted = HEADER as u64 + FACET as u64 * count;
        let cause = if length < counted {
            "it was cut short or is no STL; export or copy it again"
        } else {
            "its program left the count unfilled or wrote more behind the triangles, or it is no STL; open it in MeshLab and export it again"
        };
        return Err(FormatError(format!(
            "the header counts {count} triangles, which take {counted} bytes, but the file has {length}: {cause}"
        )));
    };
    refuse_not_finite(&mesh.vertices)?;
    Ok(mesh)
}

/// Writes a binary STL; coordinates become floats.
pub fn write(out: &mut dyn Write, mesh: &TriMesh) -> io::Result<()> {
    let mut header = [b' '; 80];
    header[..13].copy_from_slice(b"surface in mm");
    out.write_all(&header)?;
    out.write_all(&(mesh.triangles.len() as u32).to_le_bytes())?;
    for (t, normal) in mesh.triangle_normals().iter().enumerate() {
        for x in normal.iter().chain(mesh.corners(t).iter().flat_map(|p| p.coords.iter())) {
            out.write_all(&(*x as f32).to_le_bytes())?;
        }
        out.write_all(&[0, 0])?;
    }
    Ok(())
}

fn count(bytes: &[u8]) -> u32 {
    u32::from_le_bytes([bytes[80], bytes[81], bytes[82], bytes[83]])
}

/// The length is what the count says: true for a binary STL alone, whatever its header begins with.
pub(super) fn looks_binary(bytes: &[u8]) -> bool {
    bytes.len() >= HEADER && bytes.len() as u64 == HEADER as u64 + FACET as u64 * u64::from(count(bytes))
}

/// Begins with `solid` and has no zero byte where a binary file has its count and first facet.
pub(super) fn looks_ascii(bytes: &[u8]) -> bool {
    let body = text_start(bytes);
    body.len() >= 5 && body[..5].eq_ignore_ascii_case(b"solid") && !bytes[..bytes.len().min(256)].contains(&0)
}

/// The bytes after a byte order mark and white space.
pub(super) fn text_start(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start()
}

fn read_binary(bytes: &[u8]) -> TriMesh {
    let mut welder = Welder::default();
    for facet in bytes[HEADER..].chunks_exact(FACET) {
        let number = |k: usize| {
            let at = 12 + 4 * k;
            f64::from(f32::from_le_bytes([facet[at], facet[at + 1], facet[at + 2], facet[at + 3]]))
        };
        welder.triangle([0, 3, 6].map(|k| Point::new(number(k), number(k + 1), number(k + 2))));
    }
    welder.mesh
}

fn read_ascii(bytes: &[u8]) -> Result<TriMesh, FormatError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let separator = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
    let mut welder = Welder::default();
    let mut corners: Vec<Point> = Vec::with_capacity(3);
    let mut open = false;
    for (number, line) in bytes.split(|&b| b == separator).enumerate() {
        let line = String::from_utf8_lossy(line);
        let mut words = line.split_whitespace();
        let Some(keyword) = words.next() else { continue };
        let refuse = |what: String| Err(FormatError(format!("line {}: {what}", number + 1)));
        let mut keyword = keyword.to_ascii_lowercase();
        // some programs part these words
        if keyword == "end" {
            keyword += &words.next().unwrap_or_default().to_ascii_lowercase();
        }
        match keyword.as_str() {
            "solid" => open = true,
            "endsolid" => open = false,
            "facet" if corners.is_empty() => {}
            "outer" | "endloop" => {}
            "vertex" if corners.len() < 3 => match coordinates(words) {
                Some(p) => corners.push(p),
                None => {
                    let rest = line.trim().split_once(char::is_whitespace).map_or("", |(_, rest)| rest);
                    let odd = super::obj::odd_numbers(rest);
                    return refuse(format!("expected `vertex x y z`, found `{}`{odd}", short(line.trim())));
                }
            },
            "endfacet" => match *corners.as_slice() {
                [a, b, c] => {
                    welder.triangle([a, b, c]);
                    corners.clear();
                }
                _ => return refuse(format!("a facet of {} vertices, expected 3", corners.len())),
            },
            _ => return refuse(format!("unexpected `{}` in an ASCII STL", short(line.trim()))),
        }
    }
    if open || !corners.is_empty() {
        return Err(FormatError(
            "the ASCII STL ends without `endsolid`: it was cut short; export or copy it again".into(),
        ));
    }
    Ok(welder.mesh)
}

fn short(line: &str) -> String {
    line.chars().take(60).collect()
}

fn coordinates<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Point> {
    let mut next = || words.next()?.parse::<f64>().ok();
    let point = Point::new(next()?, next()?, next()?);
    words.next().is_none().then_some(point)
}

#[derive(Default)]
struct Welder {
    mesh: TriMesh,
    index: BTreeMap<[u64; 3], u32>,
}

impl Welder {
    fn triangle(&mut self, corners: [Point; 3]) {
        let triangle = corners.map(|p| {
            // Adding zero makes -0 and 0 one.
            let key = [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits());
            *self.index.entry(key).or_insert_with(|| {
                self.mesh.vertices.push(p);
                (self.mesh.vertices.len() - 1) as u32
            })
        });
        self.mesh.triangles.push(triangle);
    }
}
