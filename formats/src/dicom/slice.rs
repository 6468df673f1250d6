//! One slice, or the frames of a file that holds several.

use super::element::{Element, Packing, Reader, Syntax, data, items, text};
use super::{Pixels, frames, point, refuse};
use crate::FormatError;
use meshes::{Point, Vector};
use std::borrow::Cow;

/// One slice of a series.
pub(super) struct Slice<'a> {
    pub name: &'a str,
    /// Centre of the first pixel [mm].
    pub position: Point,
    /// Directions along a row and along a column.
    pub along_row: Vector,
    pub along_column: Vector,
    /// Distance of rows and of columns [mm].
    pub pixel: [f64; 2],
    pub rows: usize,
    pub columns: usize,
    /// Kind of picture.
    pub modality: String,
    series: String,
    slope: f64,
    intercept: f64,
    bits: Bits,
    pixels: Cow<'a, [u8]>,
}

#[derive(Clone, Copy, PartialEq)]
struct Bits {
    bytes: usize,
    stored: u32,
    shift: u32,
    signed: bool,
    big: bool,
}

/// The values of a header that matter, as they come.
#[derive(Clone, Default)]
struct Found {
    series: String,
    kind: String,
    position: Vec<f64>,
    orientation: Vec<f64>,
    pixel: Vec<f64>,
    numbers: [Option<u16>; 7],
    frames: String,
    slope: Option<f64>,
    intercept: Option<f64>,
    /// Photometric interpretation.
    shades: String,
    /// What is said of each frame of an enhanced file.
    each: Vec<Found>,
}

/// What holds for all frames of an enhanced file, and for each.
const SHARED_GROUPS: u32 = 0x5200_9229;
const FRAME_GROUPS: u32 = 0x5200_9230;
/// Deepest nesting of functional groups.
const DEEPEST_GROUP: usize = 4;
/// Most frames of one file.
const MOST_FRAMES: usize = 20_000;

const SHORTS: [u32; 7] = [0x0028_0010, 0x0028_0011, 0x0028_0100, 0x0028_0101, 0x0028_0102, 0x0028_0103, 0x0028_0002];

/// Reads the slices of a file; none for a DICOM file that is no picture.
pub(super) fn read<'a>(name: &'a str, bytes: &'a [u8], want: Pixels) -> Result<Vec<Slice<'a>>, FormatError> {
    let (data, syntax) = data(bytes)?;
    match data {
        Cow::Borrowed(own) => slices(name, own, syntax, want),
        // A deflated slice's own bytes live only here, so its pixels are copied out.
        Cow::Owned(own) => {
            let made = slices(name, &own, syntax, want)?;
            Ok(made.into_iter().map(|s| s.owned(name)).collect())
        }
    }
}

fn slices<'a>(name: &'a str, bytes: &'a [u8], syntax: Syntax, want: Pixels) -> Result<Vec<Slice<'a>>, FormatError> {
    let mut reader = Reader { bytes, at: 0, syntax };
    let mut found = Found::default();
    let mut shared = Vec::new();
    let pixels = loop {
        match reader.next()? {
            Some(element) if element.tag == 0x7FE0_0010 => break element,
            Some(Element { tag: SHARED_GROUPS, sequence: Some(own), .. }) => shared = items(own, syntax)?,
            Some(Element { tag: FRAME_GROUPS, sequence: Some(own), .. }) => {
                for item in items(own, syntax)?.into_iter().take(MOST_FRAMES) {
                    let mut each = Found::default();
                    each.take_groups(item, syntax, 0)?;
                    found.each.push(each);
                }
            }
            Some(Element { tag, value: Some(value), .. }) => found.take(tag, value, syntax.big),
            Some(_) => {}
            None => return Ok(Vec::new()),
        }
    };
    for item in shared {
        found.take_groups(item, syntax, 0)?;
    }
    let count = match found.frames.parse::<usize>() {
        Ok(n) if (1..=MOST_FRAMES).contains(&n) => n,
        Err(_) if found.frames.is_empty() => 1,
        _ => return refuse(format!("{} frames in one file; expected 1 to {MOST_FRAMES}", found.frames)),
    };
    if count > 1 && found.each.len() != count {
        return refuse(format!(
            "{count} frames in one file, of which {} have a place; expected enhanced CT, or one file a slice",
            found.each.len()
        ));
    }
    let (rows, columns, bits) = (found.short(0)?, found.short(1)?, found.short(2)?);
    let shape = frames::Shape { rows: rows.into(), columns: columns.into(), bytes: usize::from(bits).div_ceil(8) };
    let packed = syntax.packing != Packing::None;
    let parts = match want {
        Pixels::AsTheyAre if packed => frames::fragments(&pixels.fragments, count)?,
        _ => frames::frames(pixels, syntax.packing, &shape, count)?,
    };
    let whole_pixels = want == Pixels::Unpacked || !packed;
    // Unpacked pixels are little-endian whatever the file is.
    let big = syntax.big && syntax.packing == Packing::None;
    let one = |(k, own): (usize, Cow<'a, [u8]>)| {
        let whole = match found.each.get(k) {
            Some(each) => found.with(each),
            None => found.clone(),
        };
        slice(name, whole, own, (big, whole_pixels))
    };
    parts.into_iter().enumerate().map(one).collect()
}

impl Found {
    fn take(&mut self, tag: u32, value: &[u8], big: bool) {
        let numbers = || text(value).split('\\').map(|x| x.trim().parse().unwrap_or(f64::NAN)).collect::<Vec<f64>>();
        match tag {
            0x0020_000E => self.series = text(value),
            0x0008_0060 => self.kind = text(value),
            0x0020_0032 => self.position = numbers(),
            0x0020_0037 => self.orientation = numbers(),
            0x0028_0030 => self.pixel = numbers(),
            0x0028_0008 => self.frames = text(value),
            0x0028_0004 => self.shades = text(value),
            0x0028_1052 => self.intercept = numbers().first().copied(),
            0x0028_1053 => self.slope = numbers().first().copied(),
            _ => {
                if let (Some(k), [a, b, ..]) = (SHORTS.iter().position(|t| *t == tag), value) {
                    self.numbers[k] =
                        Some(if big { u16::from_be_bytes([*a, *b]) } else { u16::from_le_bytes([*a, *b]) });
                }
            }
        }
    }

    /// Takes the elements of a functional group and of the groups in it.
    fn take_groups(&mut self, bytes: &[u8], syntax: Syntax, depth: usize) -> Result<(), FormatError> {
        let mut reader = Reader { bytes, at: 0, syntax };
        while let Some(element) = reader.next()? {
            match element {
                Element { sequence: Some(own), .. } if depth < DEEPEST_GROUP => {
                    for item in items(own, syntax)? {
                        self.take_groups(item, syntax, depth + 1)?;
                    }
                }
                Element { tag, value: Some(value), .. } => self.take(tag, value, syntax.big),
                _ => {}
            }
        }
        Ok(())
    }

    /// What holds for all frames, and for one.
    fn with(&self, each: &Found) -> Found {
        let either = |own: &Vec<f64>, all: &Vec<f64>| if own.is_empty() { all.clone() } else { own.clone() };
        Found {
            position: either(&each.position, &self.position),
            orientation: either(&each.orientation, &self.orientation),
            pixel: either(&each.pixel, &self.pixel),
            slope: each.slope.or(self.slope),
            intercept: each.intercept.or(self.intercept),
            each: Vec::new(),
            ..self.clone()
        }
    }

    fn short(&self, k: usize) -> Result<u16, FormatError> {
        let names = ["rows", "columns", "bits allocated", "bits stored", "high bit", "pixel representation", "samples"];
        self.numbers[k].ok_or_else(|| FormatError(format!("no number of {}; expected a CT slice", names[k])))
    }
}

fn slice<'a>(
    name: &'a str,
    found: Found,
    pixels: Cow<'a, [u8]>,
    (big, whole): (bool, bool),
) -> Result<Slice<'a>, FormatError> {
    if !["", "CT"].contains(&found.kind.as_str()) {
        return refuse(format!("a picture of kind {}; expected CT", found.kind));
    }
    if found.short(6).unwrap_or(1) != 1 {
        return refuse("a picture in colour; expected CT");
    }
    if found.shades == "PALETTE COLOR" {
        return refuse("a picture with a palette; expected CT");
    }
    let (rows, columns) = (usize::from(found.short(0)?), usize::from(found.short(1)?));
    let allocated = found.short(2)?;
    let stored = found.short(3).unwrap_or(allocated);
    let high = found.short(4).unwrap_or(stored.wrapping_sub(1));
    if ![8, 16].contains(&allocated) || stored == 0 || stored > allocated || high >= allocated || high + 1 < stored {
        return refuse(format!("pixels of {stored} bits up to bit {high} in {allocated}; expected 8 or 16"));
    }
    let bits = Bits {
        bytes: usize::from(allocated) / 8,
        stored: u32::from(stored),
        shift: u32::from(high + 1 - stored),
        signed: found.short(5).unwrap_or(0) == 1,
        big,
    };
    let wanted = rows * columns * bits.bytes;
    if rows == 0 || columns == 0 || (whole && pixels.len() < wanted) {
        return refuse(format!(
            "{rows} x {columns} pixels take {wanted} bytes, {} are there; the file is cut short",
            pixels.len()
        ));
    }
    let wrong = |what: &str| FormatError(format!("{what} is missing or no number; expected a CT slice with its place"));
    let position = point(&found.position).ok_or_else(|| wrong("the image position"))?;
    let rest = if found.orientation.len() == 6 { found.orientation.split_at(3) } else { (&[][..], &[][..]) };
    let direction = |x: &[f64]| point(x).and_then(|p| p.coords.try_normalize(0.5));
    let axes = direction(rest.0).zip(direction(rest.1)).filter(|(a, b)| a.dot(b).abs() < 0.01);
    let (along_row, along_column) = axes.ok_or_else(|| wrong("the image orientation"))?;
    let pixel = match found.pixel[..] {
        [a, b] if [a, b].iter().all(|x| (1e-3..1e3).contains(x)) => [a, b],
        _ => return Err(wrong("the pixel spacing")),
    };
    let (slope, intercept) = (found.slope.unwrap_or(1.0), found.intercept.unwrap_or(0.0));
    if !(slope.is_finite() && intercept.is_finite() && slope != 0.0) {
        return Err(wrong("the rescale slope or intercept"));
    }
    let (series, modality) = (found.series, found.kind);
    Ok(Slice {
        name,
        position,
        along_row,
        along_column,
        pixel,
        rows,
        columns,
        modality,
        series,
        slope,
        intercept,
        bits,
        pixels,
    })
}

impl Slice<'_> {
    /// The slice with pixels of its own.
    fn owned(self, name: &str) -> Slice<'_> {
        Slice {
            name,
            position: self.position,
            along_row: self.along_row,
            along_column: self.along_column,
            pixel: self.pixel,
            rows: self.rows,
            columns: self.columns,
            modality: self.modality,
            series: self.series,
            slope: self.slope,
            intercept: self.intercept,
            bits: self.bits,
            pixels: Cow::Owned(self.pixels.into_owned()),
        }
    }

    pub(super) fn normal(&self) -> Vector {
        self.along_row.cross(&self.along_column).normalize()
    }

    /// Whether two slices are of one stack.
    pub(super) fn goes_with(&self, other: &Slice) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-4;
        self.series == other.series
            && (self.rows, self.columns) == (other.rows, other.columns)
            && (0..2).all(|k| near(self.pixel[k], other.pixel[k]))
            && (self.along_row - other.along_row).norm() < 1e-3
            && (self.along_column - other.along_column).norm() < 1e-3
    }

    pub(super) fn same_picture(&self, other: &Slice) -> bool {
        self.bits == other.bits
            && (self.slope, self.intercept) == (other.slope, other.intercept)
            && self.pixels == other.pixels
    }

    /// Appends the rescaled values.
    pub(super) fn values(&self, into: &mut Vec<f32>) -> Result<(), FormatError> {
        let Bits { bytes, stored, shift, signed, big } = self.bits;
        let count = self.rows * self.columns;
        into.reserve(count);
        for pixel in self.pixels.chunks_exact(bytes).take(count) {
            let raw = match (pixel, big) {
                ([a], _) => u32::from(*a),
                ([a, b], false) => u32::from(u16::from_le_bytes([*a, *b])),
                ([a, b], true) => u32::from(u16::from_be_bytes([*a, *b])),
                _ => return refuse("pixels are neither of 8 nor of 16 bits"),
            };
            let bits = raw >> shift & ((1 << stored) - 1);
            let value = if signed && bits >> (stored - 1) == 1 {
                f64::from(bits) - f64::from(1u32 << stored)
            } else {
                f64::from(bits)
            };
            into.push((value * self.slope + self.intercept) as f32);
        }
        Ok(())
    }
}
