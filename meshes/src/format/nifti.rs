//! NIfTI-1, one file, plain or gzipped [cox2004].
//!
//! Our frame of a volume is the patient's as in DICOM (left, posterior, superior); NIfTI's (right, anterior, superior) is turned into
//! it and back. The placement is the sform where there is one, else the qform, else the spacing alone.

use super::FormatError;
use crate::volume::{Grid, Labels, Volume};
use crate::{Point, Vector};
use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use nalgebra::Matrix3;
use std::io::{self, Read, Write};

/// Length of the header.
const HEADER: usize = 348;
/// Most voxels of a volume: 1000 slices of 1024 x 1024.
pub const MOST_VOXELS: usize = 1 << 30;

fn refuse<T>(what: impl Into<String>) -> Result<T, FormatError> {
    Err(FormatError(what.into()))
}

/// Reads a CT volume: one value a voxel, slope and intercept applied.
///
/// Memory is bounded by the data present: a header that claims more is refused after what is there.
pub fn read(bytes: &[u8]) -> Result<Volume, FormatError> {
    let (header, data) = open(bytes)?;
    let (slope, intercept) = header.scale;
    let values = header.values(&data, |_, x| Ok((x * slope + intercept) as f32))?;
    Ok(Volume { grid: header.grid, values })
}

/// Reads a label map: whole numbers from 0 to 255.
pub fn read_labels(bytes: &[u8]) -> Result<Labels, FormatError> {
    let (header, data) = open(bytes)?;
    let (slope, intercept) = header.scale;
    let label = |i: usize, x: f64| {
        let label = x * slope + intercept;
        if label.fract() != 0.0 || !(0.0..256.0).contains(&label) {
            return refuse(format!(
                "voxel {:?} has the value {label}; expected a label map: whole numbers from 0 to 255",
                header.grid.voxel(i)
            ));
        }
        Ok(label as u8)
    };
    let values = header.values(&data, label)?;
    Ok(Labels { grid: header.grid, values })
}

/// Writes a volume gzipped, in whole numbers of 16 bits where all values are such, else in f32.
pub fn write(out: impl Write, volume: &Volume) -> io::Result<()> {
    let whole = volume.values.iter().all(|x| x.fract() == 0.0 && x.abs() < 32768.0);
    let mut gz = GzEncoder::new(out, Compression::fast());
    gz.write_all(&header(&volume.grid, if whole { 4 } else { 16 }, if whole { 16 } else { 32 }))?;
    for part in volume.values.chunks(1 << 16) {
        let bytes: Vec<u8> = if whole {
            part.iter().flat_map(|x| (*x as i16).to_le_bytes()).collect()
        } else {
            part.iter().flat_map(|x| x.to_le_bytes()).collect()
        };
        gz.write_all(&bytes)?;
    }
    gz.finish().map(|_| ())
}

/// Writes a label map gzipped, a byte a voxel, as 3D Slicer and ITK-SNAP read it.
pub fn write_labels(out: impl Write, labels: &Labels) -> io::Result<()> {
    let mut gz = GzEncoder::new(out, Compression::fast());
    gz.write_all(&header(&labels.grid, 2, 8))?;
    gz.write_all(&labels.values)?;
    gz.finish().map(|_| ())
}

struct Header {
    grid: Grid,
    datatype: i16,
    big: bool,
    scale: (f64, f64),
}

/// The header and the bytes of the voxels.
fn open(bytes: &[u8]) -> Result<(Header, Vec<u8>), FormatError> {
    if bytes.is_empty() {
        return refuse("the file is empty");
    }
    let zipped = bytes.starts_with(&[0x1f, 0x8b]);
    let mut source: Box<dyn Read + '_> = if zipped { Box::new(MultiGzDecoder::new(bytes)) } else { Box::new(bytes) };
    let mut head = Vec::with_capacity(HEADER);
    let broken = |e: io::Error| FormatError(format!("the file cannot be unpacked: {e}; it is damaged or cut short"));
    source.by_ref().take(HEADER as u64).read_to_end(&mut head).map_err(broken)?;
    let (header, start, size) = parse(&head)?;
    let skipped =
        io::copy(&mut source.by_ref().take(start.saturating_sub(HEADER as u64)), &mut io::sink()).map_err(broken)?;
    let mut data = Vec::new();
    // Not by what the header claims: the list grows by what is there.
    // One byte more, so that a packed file's end is read and its checksum held against the data.
    source.take(size as u64 + 1).read_to_end(&mut data).map_err(broken)?;
    let whole = data.len().min(size);
    if data.len() < size || skipped + (HEADER as u64) < start {
        return refuse(format!(
            "the header announces {:?} voxels, {size} bytes, but only {} are there; the file is cut short or its header wrong",
            header.grid.size,
            data.len()
        ));
    }
    data.truncate(whole);
    Ok((header, data))
}

/// The header, where the voxels start, how many bytes they take.
fn parse(head: &[u8]) -> Result<(Header, u64, usize), FormatError> {
    if head.len() < HEADER {
        return refuse("the file is shorter than a NIfTI header of 348 bytes");
    }
    let big = match (i32::from_le_bytes(four(head, 0)), i32::from_be_bytes(four(head, 0))) {
        (348, _) => false,
        (_, 348) => true,
        (540, _) | (_, 540) => return refuse("NIfTI-2 is not read; export NIfTI-1 (.nii or .nii.gz)"),
        _ => return refuse("no NIfTI header; expected a volume as .nii or .nii.gz"),
    };
    match &head[344..348] {
        b"n+1\0" => {}
        b"ni1\0" => {
            return refuse("a NIfTI header without its voxels (.hdr and .img); export one file, .nii or .nii.gz");
        }
        _ => return refuse("no NIfTI-1 header (its last bytes are not n+1); expected a volume as .nii or .nii.gz"),
    }
    let word = |at: usize| if big { i16::from_be_bytes(two(head, at)) } else { i16::from_le_bytes(two(head, at)) };
    let real = |at: usize| {
        f64::from(if big { f32::from_be_bytes(four(head, at)) } else { f32::from_le_bytes(four(head, at)) })
    };
    let axes = word(40);
    let dims: Vec<i16> = (0..7).map(|k| word(42 + 2 * k)).collect();
    if !(3..=7).contains(&axes) || dims[..3].iter().any(|n| *n < 1) || dims[3..axes as usize].iter().any(|n| *n != 1) {
        return refuse(format!("the volume has axes {axes} and sizes {dims:?}; expected one volume of three axes"));
    }
    let size = [0, 1, 2].map(|k| dims[k] as usize);
    let datatype = word(70);
    let Some(bytes) = bytes_of(datatype) else {
        return refuse(format!("voxels are of NIfTI type {datatype}; expected whole numbers or reals of one channel"));
    };
    let count = size.iter().product::<usize>();
    if count > MOST_VOXELS {
        return refuse(format!(
            "the header announces {size:?} voxels, more than {MOST_VOXELS}; crop the picture to the knee"
        ));
    }
    let start = real(108);
    if !(0.0..=1e6).contains(&start) {
        return refuse(format!("the header says that voxels start at byte {start}; expected 352"));
    }
    let scale = match (real(112), real(116)) {
        (slope, intercept) if slope != 0.0 && slope.is_finite() && intercept.is_finite() => (slope, intercept),
        _ => (1.0, 0.0),
    };
    let unit = match head[123] & 7 {
        1 => 1000.0,
        3 => 0.001,
        _ => 1.0,
    };
    let grid = Grid { size, ..placement(unit, &word, &real)? };
    Ok((Header { grid, datatype, big, scale }, (start as u64).max(HEADER as u64), count * bytes))
}

fn bytes_of(datatype: i16) -> Option<usize> {
    match datatype {
        2 | 256 => Some(1),
        4 | 512 => Some(2),
        8 | 16 | 768 => Some(4),
        64 | 1024 | 1280 => Some(8),
        _ => None,
    }
}

fn two(bytes: &[u8], at: usize) -> [u8; 2] {
    [bytes[at], bytes[at + 1]]
}

fn four(bytes: &[u8], at: usize) -> [u8; 4] {
    [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]
}

/// Origin and axes in our frame, from sform, qform or spacing.
fn placement(mm: f64, word: &impl Fn(usize) -> i16, real: &impl Fn(usize) -> f64) -> Result<Grid, FormatError> {
    let pixel = [1, 2, 3].map(|k| real(76 + 4 * k));
    let (axes, origin) = if word(254) > 0 {
        let row = |r: usize, c: usize| real(280 + 16 * r + 4 * c);
        (Matrix3::from_fn(row), Vector::from_fn(|r, _| row(r, 3)))
    } else if word(252) > 0 {
        let [b, c, d] = [256, 260, 264].map(real);
        let a = (1.0 - b * b - c * c - d * d).max(0.0).sqrt();
        let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(a, b, c, d));
        let flip = if real(76) < 0.0 { -1.0 } else { 1.0 };
        let scale = Vector::new(pixel[0], pixel[1], flip * pixel[2]);
        (turn.to_rotation_matrix().matrix() * Matrix3::from_diagonal(&scale), Vector::from([268, 272, 276].map(real)))
    } else {
        (Matrix3::from_diagonal(&Vector::from(pixel)), Vector::zeros())
    };
    let turned = Matrix3::from_diagonal(&Vector::new(-mm, -mm, mm));
    let (axes, origin) = (turned * axes, turned * origin);
    if !axes.iter().chain(origin.iter()).all(|x| x.is_finite() && x.abs() < 1e6) || axes.determinant().abs() < 1e-9 {
        return refuse("the header places the voxels nowhere: its axes are flat or not finite; export the volume anew");
    }
    Ok(Grid { size: [0; 3], origin: Point::from(origin), axes })
}

impl Header {
    /// What `value` makes of the voxels' numbers as they are in the file.
    fn values<T>(
        &self,
        data: &[u8],
        value: impl Fn(usize, f64) -> Result<T, FormatError>,
    ) -> Result<Vec<T>, FormatError> {
        macro_rules! numbers {
            ($type:ty) => {{
                const N: usize = size_of::<$type>();
                let one = |(i, b): (usize, &[u8])| {
                    let mut bytes = [0; N];
                    bytes.copy_from_slice(b);
                    let x =
                        (if self.big { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) }) as f64;
                    if x.is_finite() {
                        value(i, x)
                    } else {
                        refuse(format!("voxel {:?} is not a finite number", self.grid.voxel(i)))
                    }
                };
                data.chunks_exact(N).enumerate().map(one).collect()
            }};
        }
        match self.datatype {
            2 => numbers!(u8),
            256 => numbers!(i8),
            4 => numbers!(i16),
            512 => numbers!(u16),
            8 => numbers!(i32),
            768 => numbers!(u32),
            16 => numbers!(f32),
            64 => numbers!(f64),
            1024 => numbers!(i64),
            _ => numbers!(u64),
        }
    }
}

/// A header for values of a NIfTI type, and the four bytes after it.
fn header(grid: &Grid, datatype: i16, bits: i16) -> Vec<u8> {
    let mut head = vec![0u8; HEADER + 4];
    let mut put = |at: usize, bytes: &[u8]| head[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348i32.to_le_bytes());
    put(40, &3i16.to_le_bytes());
    for k in 0..7 {
        let n = grid.size.get(k).copied().unwrap_or(1) as i16;
        put(42 + 2 * k, &n.to_le_bytes());
    }
    put(70, &datatype.to_le_bytes());
    put(72, &bits.to_le_bytes());
    put(76, &1f32.to_le_bytes());
    for (k, s) in grid.spacing().into_iter().enumerate() {
        put(80 + 4 * k, &(s as f32).to_le_bytes());
    }
    put(108, &352f32.to_le_bytes());
    put(112, &1f32.to_le_bytes());
    // Millimetres; the sform holds, in scanner coordinates.
    put(123, &[2]);
    put(254, &1i16.to_le_bytes());
    let signs = [-1.0, -1.0, 1.0];
    for (r, sign) in signs.iter().enumerate() {
        for c in 0..4 {
            let x = sign * if c < 3 { grid.axes[(r, c)] } else { grid.origin[r] };
            put(280 + 16 * r + 4 * c, &(x as f32).to_le_bytes());
        }
    }
    put(344, b"n+1\0");
    head
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume() -> Volume {
        let axes = Matrix3::new(0.75, 0.01, 0.0, 0.0, -0.75, 0.05, 0.0, 0.0, 0.6);
        let grid = Grid { size: [4, 3, 5], origin: Point::new(-12.5, 7.25, 103.0), axes };
        let values = (0..60).map(|i| (i * 37 % 500) as f32 - 200.0).collect();
        Volume { grid, values }
    }

    fn close(a: &Grid, b: &Grid) -> bool {
        a.size == b.size && (a.origin - b.origin).norm() < 1e-4 && (a.axes - b.axes).norm() < 1e-6
    }

    #[test]
    fn what_is_written_is_read() {
        let volume = volume();
        let mut bytes = Vec::new();
        write(&mut bytes, &volume).unwrap();
        let again = read(&bytes).unwrap();
        assert!(close(&again.grid, &volume.grid), "{:?}", again.grid);
        assert_eq!(again.values, volume.values);
        let mut half = volume.clone();
        half.values[3] += 0.5;
        let mut bytes = Vec::new();
        write(&mut bytes, &half).unwrap();
        assert_eq!(read(&bytes).unwrap().values, half.values);
        let labels = Labels { grid: volume.grid.clone(), values: (0..60).map(|i| (i % 5) as u8).collect() };
        let mut bytes = Vec::new();
        write_labels(&mut bytes, &labels).unwrap();
        let again = read_labels(&bytes).unwrap();
        assert!(close(&again.grid, &labels.grid) && again.values == labels.values);
        assert!(
            read_labels(&{
                let mut b = Vec::new();
                write(&mut b, &half).unwrap();
                b
            })
            .is_err()
        );
    }

    /// The file unpacked.
    fn plain(volume: &Volume) -> Vec<u8> {
        let mut packed = Vec::new();
        write(&mut packed, volume).unwrap();
        let mut bytes = Vec::new();
        MultiGzDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
        bytes
    }

    #[test]
    fn slope_intercept_byte_order_and_qform_are_minded() {
        let volume = volume();
        let mut bytes = plain(&volume);
        bytes[112..116].copy_from_slice(&2f32.to_le_bytes());
        bytes[116..120].copy_from_slice(&(-10f32).to_le_bytes());
        assert_eq!(read(&bytes).unwrap().values[7], 2.0 * volume.values[7] - 10.0);
        // No sform: a quarter turn about the superior axis.
        bytes[254] = 0;
        bytes[252] = 1;
        let s = 0.5f32.sqrt();
        bytes[264..268].copy_from_slice(&s.to_le_bytes());
        bytes[268..272].copy_from_slice(&5f32.to_le_bytes());
        let grid = read(&bytes).unwrap().grid;
        // Right, anterior, superior: the first axis runs anterior, which is minus our second.
        assert!((grid.axes.column(0) - Vector::new(0.0, -0.75, 0.0)).norm() < 1e-6, "{:?}", grid.axes);
        assert!((grid.origin - Point::new(-5.0, 0.0, 0.0)).norm() < 1e-6);
    }

    #[test]
    fn headers_that_lie_and_cut_files_are_refused() {
        let bytes = plain(&volume());
        assert!(read(&bytes).is_ok());
        let mut lie = bytes.clone();
        lie[42..44].copy_from_slice(&30000i16.to_le_bytes());
        lie[44..46].copy_from_slice(&30000i16.to_le_bytes());
        assert!(read(&lie).unwrap_err().0.contains("more than"));
        lie[44..46].copy_from_slice(&300i16.to_le_bytes());
        assert!(read(&lie).unwrap_err().0.contains("only"));
        for n in 0..bytes.len() {
            assert!(read(&bytes[..n]).is_err());
        }
        let mut packed = Vec::new();
        write(&mut packed, &volume()).unwrap();
        for n in 0..packed.len() {
            assert!(read(&packed[..n]).is_err(), "{n} of {}", packed.len());
        }
    }
}
