//! FreeSurfer's volumes: .mgh, and .mgz, which is the same packed.

use super::FormatError;
use super::raw::{Number, Raw, broken, count, placed, refuse, take};
use flate2::read::MultiGzDecoder;
use meshes::volume::Grid;
use meshes::{Point, Vector};
use nalgebra::Matrix3;
use std::io::{self, Read};

/// Where the voxels begin [byte].
const START: usize = 284;
/// Length of what the header says before its unused space [byte].
const HEADER: usize = 90;

/// Whether a file is FreeSurfer's, by its name or its first number.
pub(super) fn looks_mgh(name: &str, bytes: &[u8]) -> bool {
    let lower = name.to_ascii_lowercase();
    lower.ends_with(".mgz") || lower.ends_with(".mgh") || bytes.starts_with(&[0, 0, 0, 1])
}

/// Reads the one volume of a file; everything in it is big-endian.
///
/// # Errors
/// A header that is none, several frames, a kind of number that is not known, fewer voxels than announced.
pub(super) fn read(bytes: &[u8]) -> Result<Raw, FormatError> {
    let zipped = bytes.starts_with(&[0x1f, 0x8b]);
    let mut source: Box<dyn Read + '_> = if zipped { Box::new(MultiGzDecoder::new(bytes)) } else { Box::new(bytes) };
    let mut head = Vec::with_capacity(HEADER);
    source.by_ref().take(HEADER as u64).read_to_end(&mut head).map_err(broken)?;
    if head.len() < HEADER {
        return refuse("the file is shorter than a header of FreeSurfer (.mgz)");
    }
    let four = |at: usize| [head[at], head[at + 1], head[at + 2], head[at + 3]];
    let int = |at: usize| i32::from_be_bytes(four(at));
    let real = |at: usize| f64::from(f32::from_be_bytes(four(at)));
    if int(0) != 1 {
        return refuse("no header of FreeSurfer (.mgz): its version is not 1");
    }
    if int(16) != 1 {
        return refuse(format!("the file holds {} volumes; expected one", int(16)));
    }
    let number = match int(20) {
        0 => Number::U8,
        1 => Number::I32,
        3 => Number::F32,
        4 => Number::I16,
        other => return refuse(format!("voxels are of FreeSurfer's type {other}; expected 0, 1, 3 or 4")),
    };
    let size = [4, 8, 12].map(|at| usize::try_from(int(at)).unwrap_or(0));
    let bytes_there = count(size)? * number.bytes();
    let placed_by_file = i16::from_be_bytes([head[28], head[29]]) > 0;
    if !placed_by_file {
        return refuse("the header says not where its voxels lie (goodRASFlag is 0); save the volume with its place");
    }
    let grid = grid(size, &real)?;
    let skip = (START - HEADER) as u64;
    io::copy(&mut source.by_ref().take(skip), &mut io::sink()).map_err(broken)?;
    // frames' parameters may follow the voxels
    let data = take(source, bytes_there, size)?;
    Ok(Raw { grid, number, big: true, scale: (1.0, 0.0), data })
}

/// The grid in our frame, from FreeSurfer's right, anterior, superior about the volume's middle.
fn grid(size: [usize; 3], real: &dyn Fn(usize) -> f64) -> Result<Grid, FormatError> {
    let spacing = [30, 34, 38].map(real);
    let axes = Matrix3::from_fn(|r, c| real(42 + 12 * c + 4 * r) * spacing[c]);
    let middle = Vector::from_fn(|r, _| real(78 + 4 * r));
    let half = Vector::from_fn(|k, _| size[k] as f64 / 2.0);
    let turn = Matrix3::from_diagonal(&Vector::new(-1.0, -1.0, 1.0));
    placed(Grid { size, origin: Point::from(turn * (middle - axes * half)), axes: turn * axes })
}
