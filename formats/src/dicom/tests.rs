use super::*;

fn short(group: u16, element: u16, kind: &[u8; 2], value: &[u8]) -> Vec<u8> {
    let mut padded = value.to_vec();
    if padded.len() % 2 == 1 {
        padded.push(b' ');
    }
    let head = [&group.to_le_bytes()[..], &element.to_le_bytes(), kind, &(padded.len() as u16).to_le_bytes()].concat();
    [head, padded].concat()
}

/// Slice `k` of a stack 3 x 2, as explicit little-endian, its place moved by `shift`.
pub(super) fn file(k: usize, shift: [f64; 3], series: &str) -> Vec<u8> {
    let mut out = vec![0; 128];
    out.extend(b"DICM");
    out.extend(short(2, 0x10, b"UI", b"1.2.840.10008.1.2.1\0"));
    out.extend(short(8, 0x60, b"CS", b"CT"));
    // A sequence of unknown length with an item of unknown length, as scanners write.
    out.extend([8, 0, 0x40, 0x11, b'S', b'Q', 0, 0, 255, 255, 255, 255, 0xFE, 0xFF, 0, 0xE0, 255, 255, 255, 255]);
    out.extend(short(8, 0x50, b"SH", b"x"));
    out.extend([0xFE, 0xFF, 0x0D, 0xE0, 0, 0, 0, 0, 0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0]);
    out.extend(short(0x20, 0x0E, b"UI", series.as_bytes()));
    let z = 0.5 * k as f64;
    let place = format!("{}\\{}\\{}", 10.0 + shift[0], -20.0 + shift[1], z + shift[2]);
    out.extend(short(0x20, 0x32, b"DS", place.as_bytes()));
    out.extend(short(0x20, 0x37, b"DS", b"1\\0\\0\\0\\1\\0"));
    out.extend(short(0x28, 0x10, b"US", &2u16.to_le_bytes()));
    out.extend(short(0x28, 0x11, b"US", &3u16.to_le_bytes()));
    out.extend(short(0x28, 0x30, b"DS", b"0.8\\0.7"));
    out.extend(short(0x28, 0x100, b"US", &16u16.to_le_bytes()));
    out.extend(short(0x28, 0x101, b"US", &12u16.to_le_bytes()));
    out.extend(short(0x28, 0x102, b"US", &11u16.to_le_bytes()));
    out.extend(short(0x28, 0x103, b"US", &1u16.to_le_bytes()));
    out.extend(short(0x28, 0x1052, b"DS", b"-1024"));
    out.extend(short(0x28, 0x1053, b"DS", b"2"));
    out.extend([0xE0, 0x7F, 0x10, 0, b'O', b'W', 0, 0, 12, 0, 0, 0]);
    out.extend((0..6).flat_map(|i| ((100 * k + i) as u16).to_le_bytes()));
    out
}

fn stack(n: usize) -> Vec<(String, Vec<u8>)> {
    (0..n).map(|k| (format!("ct/{:03}", (k * 7) % n), file(k, [0.0; 3], "1.2"))).collect()
}

/// Reads a series, and sees that its headers alone tell the same, or refuse with the same words.
fn read(files: &[(String, Vec<u8>)]) -> Result<Series, FormatError> {
    let files: Vec<(&str, &[u8])> = files.iter().map(|(n, b)| (n.as_str(), b.as_slice())).collect();
    let read = read_series(&files);
    let seen = survey(&files).map(|s| (s.grid, s.tilt_deg, s.warnings)).map_err(|e| e.0);
    assert_eq!(seen, read.clone().map(|s| (s.volume.grid, s.tilt_deg, s.warnings)).map_err(|e| e.0));
    read
}

#[test]
fn a_series_is_sorted_rescaled_and_placed() {
    let mut files = stack(9);
    files.reverse();
    files.push(("ct/readme.txt".into(), b"hello".to_vec()));
    let series = read(&files).unwrap();
    let grid = &series.volume.grid;
    assert_eq!(grid.size, [3, 2, 9]);
    assert_eq!(grid.origin, Point::new(10.0, -20.0, 0.0));
    assert!((grid.axes - Matrix3::from_diagonal(&Vector::new(0.7, 0.8, 0.5))).norm() < 1e-9);
    assert_eq!(series.volume.values[grid.at([2, 1, 4])], 2.0 * 405.0 - 1024.0);
    assert_eq!(series.warnings.len(), 1);
    assert!(series.tilt_deg < 1e-9);
}

#[test]
fn negative_pixels_keep_their_sign() {
    let mut files = stack(4);
    for (_, bytes) in &mut files {
        let n = bytes.len();
        bytes[n - 2..].copy_from_slice(&0x0FFFu16.to_le_bytes());
    }
    assert_eq!(read(&files).unwrap().volume.values[5], -1026.0);
}

#[test]
fn missing_doubled_and_strange_slices_are_told() {
    let mut missing = stack(9);
    missing.remove(4);
    let error = read(&missing).unwrap_err().0;
    assert!(error.contains("1 slices are missing") && error.contains("ct/"), "{error}");
    let mut doubled = stack(9);
    doubled.push(("ct/again".into(), doubled[3].1.clone()));
    let series = read(&doubled).unwrap();
    assert_eq!(series.volume.grid.size[2], 9);
    assert!(series.warnings[0].contains("repeats"));
    let mut other = doubled[3].1.clone();
    *other.last_mut().unwrap() ^= 1;
    doubled.push(("ct/other".into(), other));
    assert!(read(&doubled).unwrap_err().0.contains("same place"));
    let mut two = stack(9);
    two.extend((0..9).map(|k| (format!("b/{k}"), file(k, [0.0; 3], "1.3"))));
    assert!(read(&two).unwrap_err().0.contains("several series"));
    let mut sideways = stack(9);
    sideways[4].1 = file(4, [0.6, 0.0, 0.0], "1.2");
    assert!(read(&sideways).unwrap_err().0.contains("sideways"));
    let mut uneven = stack(9);
    uneven[4].1 = file(4, [0.0, 0.0, 0.2], "1.2");
    assert!(read(&uneven).is_err());
}

#[test]
fn a_tilted_gantry_shears_the_grid() {
    let tilted: Vec<_> = (0..9).map(|k| (format!("{k}"), file(k, [0.0, 0.1 * k as f64, 0.0], "1.2"))).collect();
    let series = read(&tilted).unwrap();
    assert!((series.tilt_deg - 0.2f64.atan().to_degrees()).abs() < 1e-6);
    assert!((series.volume.grid.axes.column(2) - Vector::new(0.0, 0.1, 0.5)).norm() < 1e-9);
    assert!(series.warnings[0].contains("tilted"));
}

#[test]
fn compressed_and_cut_files_are_refused_by_name() {
    let mut files = stack(5);
    let at = files[2].1.windows(20).position(|w| w == b"1.2.840.10008.1.2.1\0").unwrap();
    files[2].1[at..at + 20].copy_from_slice(b"1.2.840.10008.1.2.4\0");
    let error = read(&files).unwrap_err().0;
    assert!(error.contains(&files[2].0) && error.contains("compressed"), "{error}");
    let whole = stack(5);
    for n in 132..whole[2].1.len() {
        let mut cut = whole.clone();
        cut[2].1.truncate(n);
        // Cut before the pixels begin it is no picture, and then missing.
        let error = read(&cut).unwrap_err().0;
        assert!(error.contains("ct/"), "{error}");
    }
}

#[test]
fn runs_are_unpacked() {
    // Two planes of five pixels, high bytes first: a run of 5 x 1, then literals.
    let mut packed = vec![0u8; 64];
    packed[0] = 2;
    packed[4] = 64;
    packed[8] = 66;
    packed.extend([252, 1, 4, 10, 20, 30, 40, 50]);
    assert_eq!(rle::unpacked(&packed, 5, 2).unwrap(), [10, 1, 20, 1, 30, 1, 40, 1, 50, 1]);
    assert!(rle::unpacked(&packed, 6, 2).is_err());
    assert!(rle::unpacked(&packed[..40], 5, 2).is_err());
}

/// One volume, written by pydicom (enhanced) and by GDCM (slices), in each packing.
#[test]
fn packed_and_enhanced_files_of_other_programs_are_the_plain_volume() {
    macro_rules! corpus {
        ($name:literal) => {
            include_bytes!(concat!("../../../tests/corpus/dicom/", $name)).as_slice()
        };
    }
    let plain = read_series(&[("plain", corpus!("enhanced-plain.dcm"))]).unwrap().volume;
    assert_eq!(plain.grid.size, [40, 48, 3]);
    assert!((plain.grid.axes.column(2) - Vector::new(0.0, 0.0, 0.5)).norm() < 1e-9);
    let spread = plain.values.iter().fold(f32::NEG_INFINITY, |a, b| a.max(*b));
    assert!(spread > 500.0);
    for (name, bytes) in [("runs", corpus!("enhanced-rle.dcm")), ("JPEG 2000", corpus!("enhanced-j2k.dcm"))] {
        assert_eq!(read_series(&[(name, bytes)]).unwrap().volume, plain, "{name}");
        for n in (200..bytes.len() - 8).step_by(97) {
            assert!(read_series(&[(name, &bytes[..n])]).is_err(), "{name} cut at {n}");
        }
    }
    for bytes in [corpus!("enhanced-plain.dcm"), corpus!("enhanced-rle.dcm"), corpus!("enhanced-j2k.dcm")] {
        let seen = survey(&[("a", bytes)]).unwrap();
        assert_eq!((&seen.grid, seen.cut, seen.modality.as_str()), (&plain.grid, "axial", "CT"));
    }
    let slices = [("0", corpus!("lossless-0.dcm")), ("1", corpus!("lossless-1.dcm")), ("2", corpus!("lossless-2.dcm"))];
    let lossless = read_series(&slices).unwrap().volume;
    assert_eq!(lossless.grid.size, plain.grid.size);
    assert_eq!(lossless.values, plain.values);
}
