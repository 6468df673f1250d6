//! NIfTI-1 and -2, one file, plain or gzipped [cox2004].
//!
//! Our frame of a volume is the patient's as in DICOM (left, posterior, superior); NIfTI's (right, anterior, superior) is turned into
//! it and back. The placement is the sform where there is one, else the qform, else the spacing alone. Where they contradict each
//! other in size or handedness the picture is refused.

use super::FormatError;
use super::raw::{Number, Raw, broken, count, placed, refuse, take};
use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use meshes::volume::{Grid, Labels, Volume};
use meshes::{Point, Vector};
use nalgebra::Matrix3;
use std::io::{self, Read, Write};

/// Length of a NIfTI-1 header, and of a NIfTI-2 header.
const HEADER: usize = 348;
const HEADER_2: usize = 540;
/// Voxel sizes of one file may differ by this share [-]: single precision, and millimetres written with three digits.
const SAME_SIZE: f64 = 0.01;
pub use super::raw::MOST_VOXELS;

/// Reads a CT volume: one value a voxel, slope and intercept applied.
///
/// Memory is bounded by the data present: a header that claims more is refused after what is there.
pub fn read(bytes: &[u8]) -> Result<Volume, FormatError> {
    open(bytes)?.volume()
}

/// Reads a label map: whole numbers from 0 to 255.
pub fn read_labels(bytes: &[u8]) -> Result<Labels, FormatError> {
    open(bytes)?.labels()
}

/// Whether the header says where its voxels lie, by qform or sform.
pub fn says_place(bytes: &[u8]) -> bool {
    header_of(bytes).is_none_or(|header| header.qform || header.sform)
}

/// How far apart the header's sform and qform place one corner of the picture, at most [mm]; none where it has not both.
pub fn places_apart(bytes: &[u8]) -> Option<f64> {
    let header = header_of(bytes).filter(|h| h.sform && h.qform)?;
    let pixel = Vector::from_fn(|k, _| header.pixdim[k + 1]);
    let by_sform = Matrix3::from_fn(|r, c| header.rows[4 * r + c]);
    let turn = by_sform - qform(&header, &pixel);
    let shift = Vector::from_fn(|r, _| header.rows[4 * r + 3]) - Vector::from(header.offset);
    let last: [f64; 3] = [1, 2, 3].map(|k| header.dims.get(k).map_or(0.0, |n| (n - 1).max(0) as f64));
    let corner = |bits: usize| Vector::from_fn(|k, _| if (bits >> k) & 1 == 1 { last[k] } else { 0.0 });
    let far = (0..8).map(|bits| (turn * corner(bits) + shift).norm()).fold(0.0, f64::max);
    let mm = match header.units {
        1 => 1000.0,
        3 => 0.001,
        _ => 1.0,
    };
    (mm * far).is_finite().then_some(mm * far)
}

/// The header of a file, packed or not; none of another file.
fn header_of(bytes: &[u8]) -> Option<Header> {
    let mut head = Vec::with_capacity(HEADER_2);
    let read = match bytes.starts_with(&[0x1f, 0x8b]) {
        true => MultiGzDecoder::new(bytes).take(HEADER_2 as u64).read_to_end(&mut head),
        false => bytes.take(HEADER_2 as u64).read_to_end(&mut head),
    };
    read.ok().and_then(|_| parse(&head).ok())
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

/// What a header says, of either version.
struct Header {
    big: bool,
    dims: Vec<i64>,
    datatype: i16,
    /// Sizes of a voxel; the first is the handedness of the qform.
    pixdim: [f64; 4],
    /// Byte at which the voxels start.
    start: f64,
    scale: (f64, f64),
    units: u8,
    qform: bool,
    sform: bool,
    quaternion: [f64; 3],
    offset: [f64; 3],
    rows: [f64; 12],
}

fn open(bytes: &[u8]) -> Result<Raw, FormatError> {
    if bytes.is_empty() {
        return refuse("the file is empty");
    }
    let zipped = bytes.starts_with(&[0x1f, 0x8b]);
    let mut source: Box<dyn Read + '_> = if zipped { Box::new(MultiGzDecoder::new(bytes)) } else { Box::new(bytes) };
    let mut head = Vec::with_capacity(HEADER_2);
    source.by_ref().take(HEADER as u64).read_to_end(&mut head).map_err(broken)?;
    if is_second(&head) {
        source.by_ref().take((HEADER_2 - HEADER) as u64).read_to_end(&mut head).map_err(broken)?;
    }
    let header = parse(&head)?;
    let Some(number) = number_of(header.datatype) else {
        return refuse(format!(
            "voxels are of NIfTI type {}; expected whole numbers or reals of one channel",
            header.datatype
        ));
    };
    let axes = header.dims[0];
    let rest = header.dims.get(4..=axes.clamp(3, 7) as usize).unwrap_or_default();
    if !(3..=7).contains(&axes) || header.dims[1..4].iter().any(|n| *n < 1) || rest.iter().any(|n| *n != 1) {
        return refuse(format!(
            "the volume has axes {axes} and sizes {:?}; expected one volume of three axes (a structure a volume, one-hot or in probabilities: write them as numbers of one label map)",
            &header.dims[1..]
        ));
    }
    let size = [1, 2, 3].map(|k| usize::try_from(header.dims[k]).unwrap_or(usize::MAX));
    let bytes_there = count(size)? * number.bytes();
    if !(0.0..=1e6).contains(&header.start) {
        return refuse(format!(
            "the header says that voxels start at byte {}; expected {}",
            header.start,
            head.len() + 4
        ));
    }
    let skip = (header.start as u64).saturating_sub(head.len() as u64);
    let skipped = io::copy(&mut source.by_ref().take(skip), &mut io::sink()).map_err(broken)?;
    if skipped < skip {
        return refuse("the file ends before its voxels begin; it is cut short");
    }
    let grid = Grid { size, ..placement(&header)? };
    let data = take(source, bytes_there, size)?;
    Ok(Raw { grid, number, big: header.big, scale: header.scale, data })
}

fn is_second(head: &[u8]) -> bool {
    head.len() >= 4 && (i32::from_le_bytes(four(head, 0)) == 540 || i32::from_be_bytes(four(head, 0)) == 540)
}

/// Reads the header's fields.
fn parse(head: &[u8]) -> Result<Header, FormatError> {
    if head.len() < HEADER {
        return refuse("the file is shorter than a NIfTI header of 348 bytes");
    }
    let big = match (i32::from_le_bytes(four(head, 0)), i32::from_be_bytes(four(head, 0))) {
        (348 | 540, _) => false,
        (_, 348 | 540) => true,
        _ => return refuse("no NIfTI header; expected a volume as .nii or .nii.gz"),
    };
    let second = is_second(head);
    let magic = if second { &head[4..8] } else { &head[344..348] };
    match magic {
        b"n+1\0" | b"n+2\0" => {}
        b"ni1\0" | b"ni2\0" => {
            return refuse("a NIfTI header without its voxels (.hdr and .img); export one file, .nii or .nii.gz");
        }
        _ => return refuse("no NIfTI header (its magic is not n+1 or n+2); expected a volume as .nii or .nii.gz"),
    }
    if !second {
        return Ok(first(head, big));
    }
    if head.len() < HEADER_2 {
        return refuse("the file is shorter than a NIfTI-2 header of 540 bytes");
    }
    Ok(self::second(head, big))
}

/// The fields of a NIfTI-1 header.
fn first(head: &[u8], big: bool) -> Header {
    let word = |at: usize| if big { i16::from_be_bytes(two(head, at)) } else { i16::from_le_bytes(two(head, at)) };
    let real = |at: usize| {
        f64::from(if big { f32::from_be_bytes(four(head, at)) } else { f32::from_le_bytes(four(head, at)) })
    };
    Header {
        big,
        dims: (0..8).map(|k| i64::from(word(40 + 2 * k))).collect(),
        datatype: word(70),
        pixdim: [0, 1, 2, 3].map(|k| real(76 + 4 * k)),
        start: real(108),
        scale: scale(real(112), real(116)),
        units: head[123] & 7,
        qform: word(252) > 0,
        sform: word(254) > 0,
        quaternion: [256, 260, 264].map(real),
        offset: [268, 272, 276].map(real),
        rows: std::array::from_fn(|k| real(280 + 4 * k)),
    }
}

/// The fields of a NIfTI-2 header.
fn second(head: &[u8], big: bool) -> Header {
    let eight = |at: usize| -> [u8; 8] { std::array::from_fn(|k| head[at + k]) };
    let real = |at: usize| if big { f64::from_be_bytes(eight(at)) } else { f64::from_le_bytes(eight(at)) };
    let long = |at: usize| if big { i64::from_be_bytes(eight(at)) } else { i64::from_le_bytes(eight(at)) };
    let int = |at: usize| if big { i32::from_be_bytes(four(head, at)) } else { i32::from_le_bytes(four(head, at)) };
    Header {
        big,
        dims: (0..8).map(|k| long(16 + 8 * k)).collect(),
        datatype: if big { i16::from_be_bytes(two(head, 12)) } else { i16::from_le_bytes(two(head, 12)) },
        pixdim: [0, 1, 2, 3].map(|k| real(104 + 8 * k)),
        start: long(168) as f64,
        scale: scale(real(176), real(184)),
        units: (int(500) & 7) as u8,
        qform: int(344) > 0,
        sform: int(348) > 0,
        quaternion: [352, 360, 368].map(real),
        offset: [376, 384, 392].map(real),
        rows: std::array::from_fn(|k| real(400 + 8 * k)),
    }
}

fn scale(slope: f64, intercept: f64) -> (f64, f64) {
    if slope != 0.0 && slope.is_finite() && intercept.is_finite() { (slope, intercept) } else { (1.0, 0.0) }
}

fn number_of(datatype: i16) -> Option<Number> {
    Some(match datatype {
        2 => Number::U8,
        256 => Number::I8,
        4 => Number::I16,
        512 => Number::U16,
        8 => Number::I32,
        768 => Number::U32,
        16 => Number::F32,
        64 => Number::F64,
        1024 => Number::I64,
        1280 => Number::U64,
        _ => return None,
    })
}

fn two(bytes: &[u8], at: usize) -> [u8; 2] {
    [bytes[at], bytes[at + 1]]
}

fn four(bytes: &[u8], at: usize) -> [u8; 4] {
    [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]
}

/// Origin and axes in our frame, from sform, qform or spacing; refused where the header says two things.
fn placement(header: &Header) -> Result<Grid, FormatError> {
    let mm = match header.units {
        1 => 1000.0,
        3 => 0.001,
        _ => 1.0,
    };
    let pixel = Vector::from_fn(|k, _| header.pixdim[k + 1]);
    let sform = header.sform.then(|| Matrix3::from_fn(|r, c| header.rows[4 * r + c]));
    let qform = header.qform.then(|| qform(header, &pixel));
    if let Some(axes) = &sform {
        agree(axes, &pixel, qform.as_ref())?;
    }
    let (axes, origin) = match (sform, qform) {
        (Some(axes), _) => (axes, Vector::from_fn(|r, _| header.rows[4 * r + 3])),
        (None, Some(axes)) => (axes, Vector::from(header.offset)),
        (None, None) => (Matrix3::from_diagonal(&pixel), Vector::zeros()),
    };
    let turned = Matrix3::from_diagonal(&Vector::new(-mm, -mm, mm));
    placed(Grid { size: [0; 3], origin: Point::from(turned * origin), axes: turned * axes })
}

fn qform(header: &Header, pixel: &Vector) -> Matrix3<f64> {
    let [b, c, d] = header.quaternion;
    let a = (1.0 - b * b - c * c - d * d).max(0.0).sqrt();
    let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(a, b, c, d));
    let flip = if header.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
    turn.to_rotation_matrix().matrix() * Matrix3::from_diagonal(&Vector::new(pixel.x, pixel.y, flip * pixel.z))
}

/// Refuses a header whose two placements, or placement and voxel sizes, are not of one picture.
fn agree(sform: &Matrix3<f64>, pixel: &Vector, qform: Option<&Matrix3<f64>>) -> Result<(), FormatError> {
    let sizes = Vector::from_fn(|k, _| sform.column(k).norm());
    // A sheared stack may give the distance between its slices square to them.
    let square = sform.determinant().abs() / (sizes.x * sizes.y).max(1e-12);
    let near = |a: f64, b: f64| (a - b).abs() <= SAME_SIZE * a.abs().max(b.abs());
    let same = (0..3).all(|k| near(sizes[k], pixel[k]) || k == 2 && near(square, pixel[k]));
    let by = if qform.is_some() { "qform" } else { "pixdim" };
    if !same {
        return refuse(format!(
            "the header gives voxels of {:.4} x {:.4} x {:.4} mm by its sform and {:.4} x {:.4} x {:.4} mm by its {by}; one of them is wrong and the knee would come out of another size: export the picture anew from its program",
            sizes.x, sizes.y, sizes.z, pixel.x, pixel.y, pixel.z
        ));
    }
    let hand = |m: &Matrix3<f64>| if m.determinant() > 0.0 { "right-handed" } else { "left-handed" };
    match qform {
        Some(q) if hand(q) != hand(sform) => refuse(format!(
            "the header's sform is {} and its qform {}; one of them mirrors the knee: export the picture anew from its program",
            hand(sform),
            hand(q)
        )),
        _ => Ok(()),
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
        assert!(read(&lie).unwrap_err().0.contains("expected 1 to"));
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

    #[test]
    fn a_header_that_says_two_things_is_refused_with_both() {
        let good = plain(&volume());
        assert!(read(&good).is_ok());
        // pixdim a third too large beside an sform
        let mut bytes = good.clone();
        bytes[80..84].copy_from_slice(&1f32.to_le_bytes());
        let told = read(&bytes).unwrap_err().0;
        assert!(told.contains("sform") && told.contains("pixdim") && told.contains("0.7500"), "{told}");
        // the same with a qform
        bytes[252] = 1;
        let told = read(&bytes).unwrap_err().0;
        assert!(told.contains("sform") && told.contains("qform"), "{told}");
        // right size, other hand: our own sform is left-handed or right-handed, the qform's sign turns it
        let mut bytes = good.clone();
        bytes[252] = 1;
        let sign = |b: &mut Vec<u8>, s: f32| b[76..80].copy_from_slice(&s.to_le_bytes());
        sign(&mut bytes, 1.0);
        let one = read(&bytes).is_ok();
        sign(&mut bytes, -1.0);
        let other = read(&bytes);
        assert!(one != other.is_ok());
        let told = if one { other.unwrap_err().0 } else { String::new() };
        assert!(!one || told.contains("mirrors"), "{told}");
    }

    #[test]
    fn a_volume_a_structure_is_refused_with_what_to_write() {
        let mut bytes = plain(&volume());
        (bytes[40], bytes[48]) = (4, 6);
        let told = read(&bytes).unwrap_err().0;
        assert!(told.contains("expected one volume") && told.contains("one label map"), "{told}");
    }

    #[test]
    fn two_placements_of_one_header_are_measured_against_each_other() {
        let mut bytes = plain(&volume());
        assert_eq!(places_apart(&bytes), None, "no qform");
        // a qform of the same axes, as near as a quaternion has them
        let axes = Matrix3::from_diagonal(&Vector::new(0.75, 0.75, 0.6));
        let square = Volume { grid: Grid { axes, ..volume().grid }, values: volume().values };
        let mut same = plain(&square);
        same[252] = 1;
        // half a turn about the superior axis, as our frame lies in NIfTI's
        same[264..268].copy_from_slice(&1f32.to_le_bytes());
        let offset = [12.5f32, -7.25, 103.0];
        for (k, x) in offset.into_iter().enumerate() {
            same[268 + 4 * k..272 + 4 * k].copy_from_slice(&x.to_le_bytes());
        }
        assert!(places_apart(&same).unwrap() < 1e-4, "{:?}", places_apart(&same));
        same[268..272].copy_from_slice(&32.5f32.to_le_bytes());
        assert!((places_apart(&same).unwrap() - 20.0).abs() < 1e-4, "{:?}", places_apart(&same));
        bytes[40] = 0;
        assert_eq!(places_apart(&bytes[..100]), None);
    }
}
