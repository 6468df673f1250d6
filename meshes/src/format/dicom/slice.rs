//! One slice.

use super::super::FormatError;
use super::element::{Element, Reader, Syntax, data, text};
use super::{point, refuse, rle};
use crate::{Point, Vector};
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
#[derive(Default)]
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
}

const SHORTS: [u32; 7] = [0x0028_0010, 0x0028_0011, 0x0028_0100, 0x0028_0101, 0x0028_0102, 0x0028_0103, 0x0028_0002];

/// Reads a slice; `None` for a DICOM file that is no picture.
pub(super) fn read<'a>(name: &'a str, bytes: &'a [u8]) -> Result<Option<Slice<'a>>, FormatError> {
    let (data, syntax) = data(bytes)?;
    // A deflated slice's own bytes live only here, so its pixels are copied out.
    let borrowed = match data {
        Cow::Borrowed(b) => b,
        Cow::Owned(ref b) => {
            let Some((found, pixels, big)) = elements(b, syntax)? else { return Ok(None) };
            return slice(name, found, Cow::Owned(pixels.into_owned()), big).map(Some);
        }
    };
    let Some((found, pixels, big)) = elements(borrowed, syntax)? else { return Ok(None) };
    slice(name, found, pixels, big).map(Some)
}

/// Header values, pixels as numbers one after the other, whether big-endian.
type Elements<'a> = (Found, Cow<'a, [u8]>, bool);

fn elements(bytes: &[u8], syntax: Syntax) -> Result<Option<Elements<'_>>, FormatError> {
    let mut reader = Reader { bytes, at: 0, syntax };
    let mut found = Found::default();
    let pixels = loop {
        match reader.next()? {
            Some(element) if element.tag == 0x7FE0_0010 => break element,
            Some(Element { tag, value: Some(value), .. }) => found.take(tag, value, syntax.big),
            Some(_) => {}
            None => return Ok(None),
        }
    };
    let Element { value, fragments, .. } = pixels;
    let pixels = match value {
        Some(plain) if !syntax.packed => Cow::Borrowed(plain),
        None if syntax.packed => {
            let (rows, columns, bits) = (found.short(0)?, found.short(1)?, found.short(2)?);
            let packed = fragments.concat();
            Cow::Owned(rle::unpacked(&packed, usize::from(rows) * usize::from(columns), usize::from(bits) / 8)?)
        }
        _ => return refuse("the pixels are not written as the file says; it is damaged"),
    };
    // Unpacked runs are little-endian whatever the file is.
    Ok(Some((found, pixels, syntax.big && !syntax.packed)))
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

    fn short(&self, k: usize) -> Result<u16, FormatError> {
        let names = ["rows", "columns", "bits allocated", "bits stored", "high bit", "pixel representation", "samples"];
        self.numbers[k].ok_or_else(|| FormatError(format!("no number of {}; expected a CT slice", names[k])))
    }
}

fn slice<'a>(name: &'a str, found: Found, pixels: Cow<'a, [u8]>, big: bool) -> Result<Slice<'a>, FormatError> {
    if !["", "CT"].contains(&found.kind.as_str()) {
        return refuse(format!("a picture of kind {}; expected CT", found.kind));
    }
    if !["", "1"].contains(&found.frames.as_str()) {
        return refuse(format!(
            "{} frames in one file; expected one file a slice: export classic CT, not enhanced",
            found.frames
        ));
    }
    if found.short(6).unwrap_or(1) != 1 {
        return refuse("a picture in colour; expected CT");
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
    if rows == 0 || columns == 0 || pixels.len() < wanted {
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
    let series = found.series;
    Ok(Slice { name, position, along_row, along_column, pixel, rows, columns, series, slope, intercept, bits, pixels })
}

impl Slice<'_> {
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
