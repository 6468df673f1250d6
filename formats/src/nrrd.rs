//! NRRD, attached or detached (.nrrd, .nhdr, .seg.nrrd) [nrrd2004].
//!
//! Raw, gzip and ASCII encodings; a data file of its own beside a .nhdr. The frame is what `space` says; it is turned to ours
//! (left, posterior, superior). 3D Slicer's segment names come with the labels.

use super::raw::{Number, Raw, broken, count, placed, refuse, take};
use super::{FormatError, beside};
use flate2::read::MultiGzDecoder;
use meshes::volume::Grid;
use meshes::{Point, Vector};
use nalgebra::Matrix3;
use std::collections::BTreeMap;
use std::io::Read;

/// Most bytes of a header: 3D Slicer writes some hundred a segment.
const MOST_HEADER: usize = 1 << 20;

/// Whether a file says that it is NRRD.
pub(super) fn looks_nrrd(bytes: &[u8]) -> bool {
    bytes.starts_with(b"NRRD000")
}

/// The data file that a detached header names.
pub(super) fn data_file(bytes: &[u8]) -> Option<String> {
    let (fields, _) = fields(bytes).ok()?;
    fields.get("data file").or(fields.get("datafile")).cloned()
}

/// A segment of 3D Slicer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Segment {
    /// Its name.
    pub(super) name: String,
    /// Its label, in its layer.
    pub(super) label: u8,
    /// Whether the file states the label.
    pub(super) stated: bool,
    /// Its layer; segments that overlap lie in several.
    pub(super) layer: usize,
}

/// A picture and its layers: what is read of a file.
pub(super) struct Nrrd {
    /// One picture a layer; several where 3D Slicer's segments overlap.
    pub(super) layers: Vec<Raw>,
    /// 3D Slicer's segments.
    pub(super) segments: Vec<Segment>,
}

/// Reads a picture; `files` holds the data file of a detached header, by its path beside `name`.
pub(super) fn read(name: &str, bytes: &[u8], files: &BTreeMap<String, Vec<u8>>) -> Result<Nrrd, FormatError> {
    let (fields, start) = fields(bytes)?;
    let number = number(need(&fields, "type")?)?;
    let (grid, layers) = grid(&fields)?;
    let packed: &[u8] = match fields.get("data file").or(fields.get("datafile")) {
        Some(file) => detached(name, file, files)?,
        None => bytes.get(start..).unwrap_or_default(),
    };
    let each = count(grid.size)?;
    let size = count([each, layers, 1])? * number.bytes();
    let encoding = need(&fields, "encoding")?.to_ascii_lowercase();
    let skip = whole(&fields, "byte skip")?;
    let lines = whole(&fields, "line skip")?;
    let body = match lines {
        0 => packed,
        n => packed.splitn(n as usize + 1, |&b| b == b'\n').nth(n as usize).unwrap_or_default(),
    };
    let data = match encoding.as_str() {
        "raw" if skip == -1 => {
            body.get(body.len().saturating_sub(size)..).map(|b| take(b, size, grid.size)).unwrap_or(Ok(Vec::new()))?
        }
        "raw" => take(body.get(skip.max(0) as usize..).unwrap_or_default(), size, grid.size)?,
        "gzip" | "gz" => {
            let mut source = MultiGzDecoder::new(body);
            std::io::copy(&mut source.by_ref().take(skip.max(0) as u64), &mut std::io::sink()).map_err(broken)?;
            take(source, size, grid.size)?
        }
        "ascii" | "text" | "txt" => return ascii(body, grid, layers, each, &fields),
        other => return refuse(format!("encoding is `{other}`; expected raw, gzip or ascii: save it as one of these")),
    };
    let big = match fields.get("endian").map(|e| e.to_ascii_lowercase()).as_deref() {
        Some("big") => true,
        Some("little") => false,
        None if number.bytes() == 1 => false,
        other => return refuse(format!("endian is {}; expected little or big", other.unwrap_or("missing"))),
    };
    // Layers of a list run fastest, as 3D Slicer writes them.
    let bytes = number.bytes();
    let layer = |k: usize| -> Vec<u8> {
        if layers == 1 {
            return data.clone();
        }
        data.chunks_exact(layers * bytes).flat_map(|v| v[k * bytes..(k + 1) * bytes].iter().copied()).collect()
    };
    let raw = |k| Raw { grid: grid.clone(), number, big, scale: (1.0, 0.0), data: layer(k) };
    Ok(Nrrd { layers: (0..layers).map(raw).collect(), segments: segments(&fields, layers) })
}

/// Fields and key/value pairs by name, and where the data begin.
fn fields(bytes: &[u8]) -> Result<(BTreeMap<String, String>, usize), FormatError> {
    let mut fields = BTreeMap::new();
    let mut at = 0;
    let head = &bytes[..bytes.len().min(MOST_HEADER)];
    while let Some(rest) = head.get(at..).filter(|r| !r.is_empty()) {
        let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        let line = String::from_utf8_lossy(&rest[..end]);
        let line = line.trim_end_matches('\r');
        at += end + 1;
        if line.is_empty() {
            return Ok((fields, at));
        }
        if line.starts_with('#') || line.starts_with("NRRD000") {
            continue;
        }
        match line.split_once(":=").or(line.split_once(':')) {
            Some((key, value)) => fields.insert(key.trim().to_string(), value.trim().to_string()),
            None => return refuse(format!("NRRD header: `{line:.60}` is no field; expected `name: value`")),
        };
    }
    // A detached header may end without an empty line.
    if fields.contains_key("data file") || fields.contains_key("datafile") {
        return Ok((fields, at));
    }
    refuse("the NRRD header has no end (an empty line); the file is cut short")
}

fn need<'a>(fields: &'a BTreeMap<String, String>, name: &str) -> Result<&'a String, FormatError> {
    fields.get(name).ok_or_else(|| FormatError(format!("the NRRD header has no field `{name}`")))
}

fn whole(fields: &BTreeMap<String, String>, name: &str) -> Result<i64, FormatError> {
    match fields.get(name).map(|x| x.parse::<i64>()) {
        None => Ok(0),
        Some(Ok(n)) if (-1..=1 << 30).contains(&n) => Ok(n),
        _ => refuse(format!("the NRRD header's `{name}` is no number")),
    }
}

fn number(text: &str) -> Result<Number, FormatError> {
    Ok(match text.to_ascii_lowercase().as_str() {
        "signed char" | "int8" | "int8_t" => Number::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Number::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Number::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Number::U16,
        "int" | "signed int" | "int32" | "int32_t" => Number::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Number::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Number::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Number::U64,
        "float" => Number::F32,
        "double" => Number::F64,
        other => return refuse(format!("voxels are of type `{other}`; expected whole numbers or reals")),
    })
}

/// The grid in our frame, and how many layers there are.
fn grid(fields: &BTreeMap<String, String>) -> Result<(Grid, usize), FormatError> {
    let sizes: Vec<usize> = need(fields, "sizes")?.split_whitespace().filter_map(|n| n.parse().ok()).collect();
    let listed = fields.get("kinds").is_some_and(|k| k.split_whitespace().next() == Some("list"));
    let (layers, size) = match sizes[..] {
        [a, b, c] => (1, [a, b, c]),
        [n, a, b, c] if listed || n == 1 => (n, [a, b, c]),
        _ => return refuse(format!("the header's sizes are {sizes:?}; expected one volume of three axes")),
    };
    let signs = match fields.get("space").map(|s| s.to_ascii_lowercase()).as_deref() {
        Some("left-posterior-superior" | "lps") => [1.0, 1.0, 1.0],
        Some("right-anterior-superior" | "ras") => [-1.0, -1.0, 1.0],
        Some("left-anterior-superior" | "las") => [1.0, -1.0, 1.0],
        Some(other) => {
            return refuse(format!(
                "space is `{other}`; expected left-posterior-superior, right-anterior-superior or left-anterior-superior: save the file with one of these"
            ));
        }
        None => {
            return refuse(
                "the header has no `space`, so no one knows which way is left; expected left-posterior-superior or right-anterior-superior: save the file with one of these",
            );
        }
    };
    let mm = match fields.get("space units").and_then(|u| u.split_whitespace().next()).map(|u| u.trim_matches('"')) {
        None | Some("mm" | "") => 1.0,
        Some("cm") => 10.0,
        Some("m") => 1000.0,
        Some("um" | "µm") => 0.001,
        Some(other) => return refuse(format!("space units are `{other}`; expected mm")),
    };
    let turn = Matrix3::from_diagonal(&Vector::from(signs)) * mm;
    let columns = match fields.get("space directions") {
        Some(text) => vectors(text)?,
        None => return refuse("the header has no `space directions`; save the volume with its directions"),
    };
    let [x, y, z] = columns[..] else {
        return refuse(format!("space directions name {} axes; expected three", columns.len()));
    };
    let origin = match fields.get("space origin") {
        Some(text) => vectors(text)?.first().copied().unwrap_or_else(Vector::zeros),
        None => Vector::zeros(),
    };
    let axes = turn * Matrix3::from_columns(&[x, y, z]);
    Ok((placed(Grid { size, origin: Point::from(turn * origin), axes })?, layers))
}

/// Vectors like `(1,0,0) none (0,1,0)`.
fn vectors(text: &str) -> Result<Vec<Vector>, FormatError> {
    text.split('(')
        .skip(1)
        .map(|part| {
            let inner = part.split(')').next().unwrap_or_default();
            let numbers: Vec<f64> = inner.split(',').filter_map(|x| x.trim().parse().ok()).collect();
            match numbers[..] {
                [x, y, z] => Ok(Vector::new(x, y, z)),
                _ => refuse(format!("({inner}) is no vector of three numbers")),
            }
        })
        .collect()
}

fn detached<'a>(name: &str, file: &str, files: &'a BTreeMap<String, Vec<u8>>) -> Result<&'a [u8], FormatError> {
    let first = file.split_whitespace().next().unwrap_or_default();
    if first == "LIST" || file.contains('%') {
        return refuse("the voxels lie in several files; expected one: save the volume as one .nrrd");
    }
    beside(name, file).and_then(|path| files.get(&path)).map(Vec::as_slice).ok_or_else(|| {
        FormatError(format!("the header names the voxels' file {file}, which is not there: put it beside the header"))
    })
}

fn ascii(
    body: &[u8],
    grid: Grid,
    layers: usize,
    each: usize,
    fields: &BTreeMap<String, String>,
) -> Result<Nrrd, FormatError> {
    let text = String::from_utf8_lossy(body);
    let mut data: Vec<Vec<u8>> = vec![Vec::new(); layers];
    let mut found = 0;
    for (i, word) in text.split_whitespace().take(each * layers).enumerate() {
        let Ok(x) = word.parse::<f64>() else { return refuse(format!("number {} is `{word:.20}`", i + 1)) };
        data[i % layers].extend(x.to_le_bytes());
        found += 1;
    }
    if found < each * layers {
        return refuse(format!(
            "the header announces {:?} voxels, but only {found} numbers are there; the file is cut short or its header wrong",
            grid.size
        ));
    }
    let raw = |data| Raw { grid: grid.clone(), number: Number::F64, big: false, scale: (1.0, 0.0), data };
    Ok(Nrrd { layers: data.into_iter().map(raw).collect(), segments: segments(fields, layers) })
}

/// 3D Slicer's `Segment0_Name`, `_LabelValue` and `_Layer`. Before version 4.11 each segment has a layer of its own, in their order.
fn segments(fields: &BTreeMap<String, String>, layers: usize) -> Vec<Segment> {
    let old = layers > 1 && !fields.keys().any(|k| k.starts_with("Segment") && k.ends_with("_Layer"));
    let field = |k: usize, what: &str| fields.get(&format!("Segment{k}_{what}"));
    (0..256)
        .map_while(|k| {
            Some(Segment {
                name: field(k, "Name")?.clone(),
                label: field(k, "LabelValue").and_then(|x| x.parse().ok()).unwrap_or(1),
                stated: field(k, "LabelValue").is_some(),
                layer: field(k, "Layer").and_then(|x| x.parse().ok()).unwrap_or(if old { k } else { 0 }),
            })
        })
        .collect()
}
