//! MetaImage (.mha, .mhd): ITK's own format [metaio2006]. Its frame is ITK's: left, posterior, superior.

use super::raw::{Number, Raw, count, placed, refuse, take};
use super::{FormatError, beside};
use flate2::read::ZlibDecoder;
use meshes::volume::Grid;
use meshes::{Point, Vector};
use nalgebra::Matrix3;
use std::collections::BTreeMap;

/// Most lines of a header; ITK writes about fifteen.
const MOST_LINES: usize = 200;

/// Whether a file looks like a MetaImage: its first line is a field that such a header begins with.
pub(super) fn looks_metaimage(bytes: &[u8]) -> bool {
    [b"ObjectType".as_slice(), b"NDims", b"Comment"].iter().any(|word| bytes.starts_with(word))
}

/// The data file that a header names; `None` where the data follow in the same file.
pub(super) fn data_file(bytes: &[u8]) -> Option<String> {
    let (fields, _) = fields(bytes).ok()?;
    fields.get("ElementDataFile").filter(|f| !f.eq_ignore_ascii_case("LOCAL")).cloned()
}

/// Reads a picture; `files` holds the data file that a .mhd names, by its path beside `name`.
pub(super) fn read(name: &str, bytes: &[u8], files: &BTreeMap<String, Vec<u8>>) -> Result<Raw, FormatError> {
    let (fields, start) = fields(bytes)?;
    let field = |name: &str| fields.get(name).map(String::as_str);
    let yes = |name: &str| field(name).is_some_and(|x| x.eq_ignore_ascii_case("true"));
    if field("ElementNumberOfChannels").is_some_and(|n| n != "1") {
        return refuse("the picture has several channels; expected one number a voxel");
    }
    let number = number(field("ElementType").unwrap_or_default())?;
    let grid = grid(&fields)?;
    let packed: &[u8] = match field("ElementDataFile") {
        Some(file) if file.eq_ignore_ascii_case("LOCAL") => bytes.get(start..).unwrap_or_default(),
        Some(file) if file.starts_with("LIST") || file.contains('%') => {
            return refuse("the voxels lie in several files; expected one: save the volume as one .mha");
        }
        Some(file) => beside(name, file).and_then(|path| files.get(&path)).map(Vec::as_slice).ok_or_else(|| {
            FormatError(format!(
                "the header names the voxels' file {file}, which is not there: put it beside the header"
            ))
        })?,
        None => return refuse("the MetaImage header names no ElementDataFile; the file is cut short"),
    };
    let size = count(grid.size)? * number.bytes();
    let data = if yes("CompressedData") {
        take(ZlibDecoder::new(packed), size, grid.size)?
    } else if field("BinaryData").is_some_and(|x| x.eq_ignore_ascii_case("false")) {
        return refuse("the voxels are written as text (BinaryData = False); save the volume in binary");
    } else {
        let skip = field("HeaderSize").and_then(|x| x.parse::<i64>().ok()).unwrap_or(0);
        let body = match skip {
            -1 => packed.get(packed.len().saturating_sub(size)..),
            n => packed.get(n.max(0) as usize..),
        };
        take(body.unwrap_or_default(), size, grid.size)?
    };
    let big = yes("BinaryDataByteOrderMSB") || yes("ElementByteOrderMSB");
    Ok(Raw { grid, number, big, scale: (1.0, 0.0), data })
}

/// Fields by name, and where the data begin.
fn fields(bytes: &[u8]) -> Result<(BTreeMap<String, String>, usize), FormatError> {
    let mut fields = BTreeMap::new();
    let mut at = 0;
    for _ in 0..MOST_LINES {
        let Some(rest) = bytes.get(at..).filter(|r| !r.is_empty()) else { break };
        let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        let line = String::from_utf8_lossy(&rest[..end.min(4096)]).trim().to_string();
        at += end + 1;
        let Some((key, value)) = line.split_once('=') else {
            if line.is_empty() {
                continue;
            }
            return refuse(format!("MetaImage header: `{line:.60}` is no field; expected `Name = value`"));
        };
        let (key, value) = (key.trim().to_string(), value.trim().to_string());
        let last = key == "ElementDataFile";
        fields.insert(key, value);
        if last {
            return Ok((fields, at));
        }
    }
    refuse("the MetaImage header has no ElementDataFile; the file is cut short")
}

fn number(text: &str) -> Result<Number, FormatError> {
    Ok(match text {
        "MET_CHAR" => Number::I8,
        "MET_UCHAR" => Number::U8,
        "MET_SHORT" => Number::I16,
        "MET_USHORT" => Number::U16,
        "MET_INT" | "MET_LONG" => Number::I32,
        "MET_UINT" | "MET_ULONG" => Number::U32,
        "MET_LONG_LONG" => Number::I64,
        "MET_ULONG_LONG" => Number::U64,
        "MET_FLOAT" => Number::F32,
        "MET_DOUBLE" => Number::F64,
        other => return refuse(format!("ElementType is `{other}`; expected whole numbers or reals")),
    })
}

fn grid(fields: &BTreeMap<String, String>) -> Result<Grid, FormatError> {
    let numbers = |names: &[&str]| -> Result<Option<Vec<f64>>, FormatError> {
        let Some((name, text)) = names.iter().find_map(|n| Some((*n, fields.get(*n)?))) else { return Ok(None) };
        let all: Option<Vec<f64>> =
            text.split_whitespace().map(|x| x.parse::<f64>().ok().filter(|x| x.is_finite())).collect();
        match all {
            Some(all) => Ok(Some(all)),
            None => {
                refuse(format!("{name} = {text:.60} has no numbers; expected them with decimal points, spaces between"))
            }
        }
    };
    let dims = numbers(&["DimSize"])?.unwrap_or_default();
    if dims.len() != 3 || dims.iter().any(|n| n.fract() != 0.0 || !(1.0..1e6).contains(n)) {
        return refuse(format!("DimSize is {dims:?}; expected one volume of three axes"));
    }
    let Some(spacing) = numbers(&["ElementSpacing", "ElementSize"])? else {
        return refuse(
            "the header has no ElementSpacing, so no one knows how large a voxel is; save the volume with it",
        );
    };
    let turn = numbers(&["TransformMatrix", "Orientation", "Rotation"])?
        .unwrap_or_else(|| vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let origin = numbers(&["Offset", "Position", "Origin"])?.unwrap_or_else(|| vec![0.0; 3]);
    if spacing.len() != 3 || turn.len() != 9 || origin.len() != 3 {
        return refuse("ElementSpacing, TransformMatrix or Offset have not 3, 9 and 3 numbers");
    }
    // Each row of the header's matrix is an axis.
    let axes = Matrix3::from_fn(|r, c| turn[3 * c + r] * spacing[c]);
    let size = [0, 1, 2].map(|k| dims[k] as usize);
    placed(Grid { size, origin: Point::from(Vector::new(origin[0], origin[1], origin[2])), axes })
}
