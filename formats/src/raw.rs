//! Voxels as a file holds them: numbers of one kind in a row, and where they lie.

use super::FormatError;
use meshes::volume::{Grid, Labels, Volume};
use std::io::{self, Read};

/// Most voxels of a volume: 1000 slices of 1024 x 1024.
pub const MOST_VOXELS: usize = 1 << 30;

/// A label this near to a whole number is it [-]: resampling in single precision leaves less, and no average of two labels is so near. Ours.
const WHOLE: f64 = 1e-3;

pub(super) fn refuse<T>(what: impl Into<String>) -> Result<T, FormatError> {
    Err(FormatError(what.into()))
}

/// The kind of number of a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl Number {
    pub(super) fn bytes(self) -> usize {
        match self {
            Number::U8 | Number::I8 => 1,
            Number::U16 | Number::I16 => 2,
            Number::U32 | Number::I32 | Number::F32 => 4,
            Number::U64 | Number::I64 | Number::F64 => 8,
        }
    }
}

/// A picture: its grid, its numbers' kind and byte order, what they are scaled by, and their bytes.
pub(super) struct Raw {
    pub(super) grid: Grid,
    pub(super) number: Number,
    pub(super) big: bool,
    /// Slope and intercept.
    pub(super) scale: (f64, f64),
    pub(super) data: Vec<u8>,
}

impl Raw {
    /// The picture as a volume, slope and intercept applied.
    pub(super) fn volume(self) -> Result<Volume, FormatError> {
        let values = self.values(|_, x| Ok(x as f32))?;
        Ok(Volume { grid: self.grid, values })
    }

    /// The picture as a label map: whole numbers from 0 to 255.
    pub(super) fn labels(self) -> Result<Labels, FormatError> {
        let values = self.values(|i, label| {
            let near = label.round();
            let label = if (label - near).abs() <= WHOLE { near } else { label };
            if label.fract() != 0.0 || !(0.0..256.0).contains(&label) {
                return refuse(format!(
                    "voxel {:?} has the value {label}; expected a label map: whole numbers from 0 to 255",
                    self.grid.voxel(i)
                ));
            }
            Ok(label as u8)
        })?;
        Ok(Labels { grid: self.grid, values })
    }

    /// What `value` makes of each voxel's place in the list and scaled number.
    fn values<T>(&self, value: impl Fn(usize, f64) -> Result<T, FormatError>) -> Result<Vec<T>, FormatError> {
        let (slope, intercept) = self.scale;
        macro_rules! numbers {
            ($type:ty) => {{
                const N: usize = size_of::<$type>();
                let one = |(i, b): (usize, &[u8])| {
                    let mut bytes = [0; N];
                    bytes.copy_from_slice(b);
                    let x =
                        (if self.big { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) }) as f64;
                    if x.is_finite() {
                        value(i, x * slope + intercept)
                    } else {
                        refuse(format!("voxel {:?} is not a finite number", self.grid.voxel(i)))
                    }
                };
                self.data.chunks_exact(N).enumerate().map(one).collect()
            }};
        }
        match self.number {
            Number::U8 => numbers!(u8),
            Number::I8 => numbers!(i8),
            Number::U16 => numbers!(u16),
            Number::I16 => numbers!(i16),
            Number::U32 => numbers!(u32),
            Number::I32 => numbers!(i32),
            Number::U64 => numbers!(u64),
            Number::I64 => numbers!(i64),
            Number::F32 => numbers!(f32),
            Number::F64 => numbers!(f64),
        }
    }
}

/// Refuses a picture of more than [`MOST_VOXELS`]; else the number of its voxels.
pub(super) fn count(size: [usize; 3]) -> Result<usize, FormatError> {
    match size.iter().try_fold(1usize, |n, &k| n.checked_mul(k)) {
        Some(n) if n > 0 && n <= MOST_VOXELS => Ok(n),
        _ => refuse(format!(
            "the header announces {size:?} voxels; expected 1 to {MOST_VOXELS}: crop the picture to the knee"
        )),
    }
}

/// The first `size` bytes of `source`. The list grows by what is there, not by what a header claims.
pub(super) fn take(source: impl Read, size: usize, of: [usize; 3]) -> Result<Vec<u8>, FormatError> {
    let mut data = Vec::new();
    // One byte more, so that a packed file's end is read and its checksum held against the data.
    source.take(size as u64 + 1).read_to_end(&mut data).map_err(broken)?;
    if data.len() < size {
        return refuse(format!(
            "the header announces {of:?} voxels, {size} bytes, but only {} are there; the file is cut short or its header wrong",
            data.len()
        ));
    }
    data.truncate(size);
    Ok(data)
}

pub(super) fn broken(e: io::Error) -> FormatError {
    FormatError(format!("the file cannot be unpacked: {e}; it is damaged or cut short"))
}

/// Voxels smaller than this are of another unit, or flat [mm3]: a thousandth of a millimetre a side.
const LEAST_VOXEL_MM3: f64 = 1e-9;
/// A voxel of this share of the box of its edges is not flat [-]. Ours.
const SQUARE: f64 = 0.1;

/// Refuses a grid that lies nowhere, or in metres.
pub(super) fn placed(grid: Grid) -> Result<Grid, FormatError> {
    let finite = grid.axes.iter().chain(grid.origin.iter()).all(|x| x.is_finite() && x.abs() < 1e6);
    let volume = grid.axes.determinant().abs();
    let spacing = grid.spacing();
    if finite && volume < LEAST_VOXEL_MM3 && volume > SQUARE * spacing.iter().product::<f64>() {
        return refuse(format!(
            "voxels are {:.6} x {:.6} x {:.6} mm, which is a picture in metres: multiply spacing, directions and origin by 1000",
            spacing[0], spacing[1], spacing[2]
        ));
    }
    if !finite || volume < LEAST_VOXEL_MM3 {
        return refuse("the header places the voxels nowhere: its axes are flat or not finite; export the volume anew");
    }
    Ok(grid)
}
