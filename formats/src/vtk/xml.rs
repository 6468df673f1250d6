//! VTK's XML files.

use super::{Cells, index, surface};
use crate::FormatError;
use crate::raw::{broken, refuse};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;
use meshes::surface::TriMesh;
use std::borrow::Cow;
use std::io::Read;

/// Most bytes that compressed data may unpack to, as a multiple of their own: zlib's limit.
const MOST_UNPACKED: usize = 1032;

/// How the file keeps its numbers.
struct Layout<'a> {
    big: bool,
    long_header: bool,
    zlib: bool,
    /// What follows the appended section's underscore, and whether it is base64.
    appended: Option<(&'a [u8], bool)>,
}

pub(super) fn read(bytes: &[u8]) -> Result<TriMesh, FormatError> {
    let (coordinates, cells) = parsed(bytes)?;
    surface(&coordinates, &cells)
}

/// Coordinates of the points, three numbers each, and the cells by kind.
pub(super) fn parsed(bytes: &[u8]) -> Result<(Vec<f64>, [Cells; 3]), FormatError> {
    let (text, appended) = match find(bytes, b"<AppendedData") {
        Some(at) => {
            let tag = element(&bytes[at..])?;
            let data = bytes[at..].iter().position(|&b| b == b'_').map(|u| &bytes[at + u + 1..]).unwrap_or_default();
            (&bytes[..at], Some((data, attribute(&tag, "encoding").as_deref() != Some("raw"))))
        }
        None => (bytes, None),
    };
    let Some(root) = find(text, b"<VTKFile") else { return refuse("no <VTKFile> element; expected .vtp") };
    let root = element(&text[root..])?;
    match attribute(&root, "type").as_deref() {
        Some("PolyData" | "UnstructuredGrid") => {}
        other => return refuse(format!("the file is of type {}; expected PolyData", other.unwrap_or("none"))),
    }
    if find(bytes, b"</VTKFile").is_none() {
        return refuse("the file ends before </VTKFile>; it is cut off: copy it again");
    }
    let zlib = match attribute(&root, "compressor").as_deref() {
        None => false,
        Some("vtkZLibDataCompressor") => true,
        Some(other) => return refuse(format!("the compressor is {other}; expected vtkZLibDataCompressor or none")),
    };
    let layout = Layout {
        big: attribute(&root, "byte_order").as_deref() == Some("BigEndian"),
        long_header: attribute(&root, "header_type").as_deref() == Some("UInt64"),
        zlib,
        appended,
    };
    let points = layout.arrays(text, b"<Points>", b"</Points>")?;
    let Some((_, coordinates)) = points.into_iter().next() else {
        return refuse("the file has no <Points>; it is cut short, or holds no surface");
    };
    let mut all = [false, true, false].map(|strips| Cells { strips, ..Cells::default() });
    for (cells, (open, close)) in all.iter_mut().zip([
        (b"<Polys>".as_slice(), b"</Polys>".as_slice()),
        (b"<Strips>", b"</Strips>"),
        (b"<Cells>", b"</Cells>"),
    ]) {
        for (name, values) in layout.arrays(text, open, close)? {
            match name.as_str() {
                "connectivity" => cells.points = values.into_iter().map(index).collect::<Result<_, _>>()?,
                "offsets" => {
                    cells.ends = values.into_iter().map(|x| index(x).map(|x| x as usize)).collect::<Result<_, _>>()?;
                }
                "types" => cells.kinds = values.into_iter().map(|x| x as u8).collect(),
                _ => {}
            }
        }
    }
    Ok((coordinates, all))
}

fn find(bytes: &[u8], what: &[u8]) -> Option<usize> {
    bytes.windows(what.len()).position(|w| w == what)
}

/// An element's opening tag, from its `<` to its `>`, as long as its bytes.
fn element(bytes: &[u8]) -> Result<String, FormatError> {
    let Some(end) = bytes.iter().take(4000).position(|&b| b == b'>') else {
        return refuse("an element has no end; the file is cut short");
    };
    match std::str::from_utf8(&bytes[..=end]) {
        Ok(tag) => Ok(tag.to_owned()),
        Err(_) => refuse("an element is no UTF-8 text; the file is damaged"),
    }
}

fn attribute(tag: &str, name: &str) -> Option<String> {
    let after = tag.split(&format!(" {name}=")).nth(1)?;
    let quote = after.chars().next().filter(|q| ['"', '\''].contains(q))?;
    after[1..].split(quote).next().map(str::to_string)
}

impl Layout<'_> {
    /// Names and numbers of the arrays between two tags; none where the tags are absent.
    fn arrays(&self, text: &[u8], open: &[u8], close: &[u8]) -> Result<Vec<(String, Vec<f64>)>, FormatError> {
        let Some(start) = find(text, open) else { return Ok(Vec::new()) };
        let inner = &text[start..];
        let Some(end) = find(inner, close) else { return refuse("an element has no end; the file is cut short") };
        let mut inner = &inner[..end];
        let mut out = Vec::new();
        while let Some(at) = find(inner, b"<DataArray") {
            let tag = element(&inner[at..])?;
            let body = &inner[at + tag.len()..];
            let stop = if tag.ends_with("/>") { 0 } else { find(body, b"<").unwrap_or(body.len()) };
            let values = self.numbers(&tag, &body[..stop])?;
            out.push((attribute(&tag, "Name").unwrap_or_default(), values));
            inner = &body[stop..];
        }
        Ok(out)
    }

    fn numbers(&self, tag: &str, body: &[u8]) -> Result<Vec<f64>, FormatError> {
        let kind = attribute(tag, "type").unwrap_or_default();
        match attribute(tag, "format").as_deref() {
            None | Some("ascii") => String::from_utf8_lossy(body)
                .split_whitespace()
                .map(|w| w.parse().or_else(|_| refuse(format!("`{w:.30}` was met; expected a number"))))
                .collect(),
            Some("binary") => self.decoded(&kind, body, true),
            Some("appended") => {
                let offset = attribute(tag, "offset").and_then(|o| o.parse::<usize>().ok());
                match (offset, self.appended) {
                    (Some(offset), Some((data, base64))) if offset <= data.len() => {
                        self.decoded(&kind, &data[offset..], base64)
                    }
                    _ => refuse("an array's appended data are not there; the file is cut short"),
                }
            }
            Some(other) => refuse(format!("an array is of format {other}; expected ascii, binary or appended")),
        }
    }

    /// Numbers of a block with VTK's header before it.
    fn decoded(&self, kind: &str, body: &[u8], base64: bool) -> Result<Vec<f64>, FormatError> {
        let word = if self.long_header { 8 } else { 4 };
        let mut stream = Stream { body, base64 };
        let header = |bytes: &[u8]| -> usize {
            let wide: [u8; 8] = std::array::from_fn(|k| match (self.big, bytes.len()) {
                (true, n) => {
                    if k >= 8 - n {
                        bytes[k + n - 8]
                    } else {
                        0
                    }
                }
                (false, n) => {
                    if k < n {
                        bytes[k]
                    } else {
                        0
                    }
                }
            });
            usize::try_from(if self.big { u64::from_be_bytes(wide) } else { u64::from_le_bytes(wide) })
                .unwrap_or(usize::MAX)
        };
        if !self.zlib {
            // Header and data are one run of base64.
            let size = header(&stream.peek(word)?);
            let bytes = stream.take(word.saturating_add(size))?;
            return self.converted(kind, &bytes[word..]);
        }
        let blocks = header(&stream.peek(word)?);
        let table = stream.take(word.saturating_mul(blocks.saturating_add(3)))?;
        let mut unpacked = Vec::new();
        let sizes: Vec<usize> = table.chunks_exact(word).skip(3).map(header).collect();
        let packed = stream.take(sizes.iter().fold(0usize, |n, s| n.saturating_add(*s)))?;
        let mut start = 0;
        for size in sizes {
            let own = &packed[start..start + size];
            start += size;
            ZlibDecoder::new(own).take((MOST_UNPACKED * size) as u64).read_to_end(&mut unpacked).map_err(broken)?;
        }
        self.converted(kind, &unpacked)
    }

    fn converted(&self, kind: &str, bytes: &[u8]) -> Result<Vec<f64>, FormatError> {
        macro_rules! read {
            ($type:ty) => {{
                const N: usize = size_of::<$type>();
                let one = |b: &[u8]| {
                    let own = std::array::from_fn(|k| b[k]);
                    (if self.big { <$type>::from_be_bytes(own) } else { <$type>::from_le_bytes(own) }) as f64
                };
                bytes.chunks_exact(N).map(one).collect()
            }};
        }
        Ok(match kind {
            "Float32" => read!(f32),
            "Float64" => read!(f64),
            "Int8" => read!(i8),
            "UInt8" => read!(u8),
            "Int16" => read!(i16),
            "UInt16" => read!(u16),
            "Int32" => read!(i32),
            "UInt32" => read!(u32),
            "Int64" => read!(i64),
            "UInt64" => read!(u64),
            other => return refuse(format!("an array is of type `{other:.30}`; expected Float32 or Int64")),
        })
    }
}

/// A run of bytes, perhaps in base64 of which each part is padded for itself.
struct Stream<'a> {
    body: &'a [u8],
    base64: bool,
}

impl<'a> Stream<'a> {
    fn peek(&self, n: usize) -> Result<Vec<u8>, FormatError> {
        Stream { body: self.body, base64: self.base64 }.take(n).map(Cow::into_owned)
    }

    fn take(&mut self, n: usize) -> Result<Cow<'a, [u8]>, FormatError> {
        let short = || FormatError("an array is shorter than its header says; the file is cut short".into());
        if !self.base64 {
            let (own, rest) = self.body.split_at_checked(n).ok_or_else(short)?;
            self.body = rest;
            return Ok(Cow::Borrowed(own));
        }
        let start = self.body.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(self.body.len());
        let length = n.div_ceil(3).checked_mul(4).ok_or_else(short)?;
        let (own, rest) = self.body[start..].split_at_checked(length).ok_or_else(short)?;
        let bytes = STANDARD.decode(own).or_else(|_| {
            // The head of a longer run has no padding and need not end on a byte.
            STANDARD.decode(own.get(..own.len() / 4 * 4).unwrap_or_default())
        });
        let mut bytes = bytes.map_err(|_| FormatError("an array is no base64; the file is damaged".into()))?;
        if bytes.len() < n {
            return Err(short());
        }
        bytes.truncate(n);
        self.body = rest;
        Ok(Cow::Owned(bytes))
    }
}
