use super::*;
use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use meshes::{Point, Vector};
use std::io::Write;

fn none() -> BTreeMap<String, Vec<u8>> {
    BTreeMap::new()
}

/// Labels 0 to 4 of a grid of 4 x 3 x 2 voxels.
fn voxels() -> Vec<u8> {
    (0..24).map(|i| (i % 5) as u8).collect()
}

fn packed_gzip(bytes: &[u8]) -> Vec<u8> {
    let mut gz = GzEncoder::new(Vec::new(), Compression::fast());
    gz.write_all(bytes).unwrap();
    gz.finish().unwrap()
}

const NRRD: &str = "NRRD0004\n# a comment\ntype: unsigned char\ndimension: 3\nsizes: 4 3 2\nkinds: domain domain domain\nspace directions: (0.5,0,0) (0,0.1,0.4) (0,-0.4,0.1)\nspace origin: (1,2,3)\n";

fn nrrd(space: &str, encoding: &str, more: &str, body: &[u8]) -> Vec<u8> {
    [format!("{NRRD}space: {space}\nencoding: {encoding}\n{more}\n").as_bytes(), body].concat()
}

#[test]
fn nrrd_in_each_encoding_and_frame_is_one_picture() {
    let voxels = voxels();
    let text: Vec<u8> = voxels.iter().flat_map(|v| format!("{v} ").into_bytes()).collect();
    let plain = read_labels("a.nrrd", &nrrd("left-posterior-superior", "raw", "", &voxels), &none()).unwrap();
    assert_eq!(plain.labels.values, voxels);
    let grid = &plain.labels.grid;
    assert!((grid.origin - Point::new(1.0, 2.0, 3.0)).norm() < 1e-12);
    assert!((grid.axes.column(1) - Vector::new(0.0, 0.1, 0.4)).norm() < 1e-12);
    for (encoding, body) in [("gzip", packed_gzip(&voxels)), ("ascii", text)] {
        let read = read_labels("a.nrrd", &nrrd("left-posterior-superior", encoding, "", &body), &none()).unwrap();
        assert_eq!(read, plain, "{encoding}");
    }
    let ras = read_labels("a.nrrd", &nrrd("RAS", "raw", "", &voxels), &none()).unwrap().labels.grid;
    assert!((ras.origin - Point::new(-1.0, -2.0, 3.0)).norm() < 1e-12);
    assert!((ras.axes.column(1) - Vector::new(0.0, -0.1, 0.4)).norm() < 1e-12);
    let header = format!("{NRRD}space: LPS\nencoding: raw\ndata file: b.raw\n");
    let files = BTreeMap::from([("mri/b.raw".to_string(), voxels.clone())]);
    assert_eq!(read_labels("mri/a.nhdr", header.as_bytes(), &files).unwrap(), plain);
    assert_eq!(crate::companions("mri/a.nhdr", header.as_bytes()), ["mri/b.raw"]);
    let told = read_labels("mri/a.nhdr", header.as_bytes(), &none()).unwrap_err().0;
    assert!(told.contains("b.raw"), "{told}");
}

#[test]
fn segments_names_and_layers_are_read() {
    let named = "Segment0_Name:=Femur\nSegment0_LabelValue:=3\nSegment0_Layer:=0\n";
    let read = read_labels("a.seg.nrrd", &nrrd("LPS", "raw", named, &voxels()), &none()).unwrap();
    assert_eq!(read.names, [("Femur".to_string(), 3)]);
    // two layers, voxel by voxel, that overlap in one
    let head = "NRRD0004\ntype: uint8\ndimension: 4\nsizes: 2 2 1 1\nkinds: list domain domain domain\nspace: LPS\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: raw\n";
    let names = "Segment0_Name:=a\nSegment0_LabelValue:=1\nSegment0_Layer:=0\nSegment1_Name:=b\nSegment1_LabelValue:=1\nSegment1_Layer:=1\n\n";
    let bytes = [head.as_bytes(), names.as_bytes(), &[1, 1, 0, 1]].concat();
    let read = read_labels("a.seg.nrrd", &bytes, &none()).unwrap();
    assert_eq!((read.labels.values, read.overlapping), (vec![1, 2], 1));
    assert_eq!(read.names, [("a".to_string(), 1), ("b".to_string(), 2)]);
}

#[test]
fn metaimage_is_read_as_itk_writes_it() {
    let head = |tail: &str| {
        format!(
            "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n{tail}TransformMatrix = 1 0 0 0 0 1 0 -1 0\nOffset = 1 2 3\nCenterOfRotation = 0 0 0\nAnatomicalOrientation = RAI\nElementSpacing = 0.5 0.4 0.7\nDimSize = 4 3 2\nElementType = MET_SHORT\n"
        )
    };
    let body: Vec<u8> = voxels().iter().flat_map(|v| i16::from(*v).to_le_bytes()).collect();
    let local = [head("").as_bytes(), b"ElementDataFile = LOCAL\n", &body].concat();
    let plain = read_labels("a.mha", &local, &none()).unwrap();
    assert_eq!(plain.labels.values, voxels());
    assert!((plain.labels.grid.axes.column(1) - Vector::new(0.0, 0.0, 0.4)).norm() < 1e-12);
    assert!((plain.labels.grid.axes.column(2) - Vector::new(0.0, -0.7, 0.0)).norm() < 1e-12);
    let mut z = ZlibEncoder::new(Vec::new(), Compression::fast());
    z.write_all(&body).unwrap();
    let beside = [head("CompressedData = True\n").as_bytes(), b"ElementDataFile = a.zraw\n"].concat();
    let files = BTreeMap::from([("a.zraw".to_string(), z.finish().unwrap())]);
    assert_eq!(read_labels("a.mhd", &beside, &files).unwrap(), plain);
}

#[test]
fn a_metaimage_without_the_size_of_its_voxels_or_with_words_for_numbers_is_refused() {
    let head = "ObjectType = Image\nNDims = 3\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 1 2 3\nElementSpacing = 0.5 0.4 0.7\nDimSize = 4 3 2\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
    let read = |head: &str| read_labels("a.mha", &[head.as_bytes(), &voxels()].concat(), &none());
    assert!(read(head).is_ok(), "{:?}", read(head).err());
    for (from, to, word) in [
        ("ElementSpacing = 0.5 0.4 0.7\n", "", "no ElementSpacing"),
        // as a program writes them where commas are decimal
        ("0.5 0.4 0.7", "0,5 0,4 0,7", "ElementSpacing = 0,5"),
        ("0.5 0.4 0.7", "nan 0.4 0.7", "ElementSpacing = nan"),
        ("Offset = 1 2 3", "Offset = 1,5 2,5 3,5", "Offset = 1,5"),
        ("1 0 0 0 1 0 0 0 1", "1 0 0 0 1 0 0 0 x", "TransformMatrix"),
    ] {
        let told = read(&head.replacen(from, to, 1)).unwrap_err().0;
        assert!(told.contains(word), "{word}: {told}");
    }
}

#[test]
fn headers_that_lie_and_cut_files_are_refused() {
    let whole = nrrd("LPS", "gzip", "", &packed_gzip(&voxels()));
    for n in 0..whole.len() {
        assert!(read_labels("a.nrrd", &whole[..n], &none()).is_err(), "{n}");
    }
    for (bytes, word) in [
        (nrrd("3D-right-handed", "raw", "", &voxels()), "space"),
        (nrrd("LPS", "bzip2", "", &voxels()), "encoding"),
        (nrrd("LPS", "raw", "", &voxels()[..20]), "only 20"),
        (
            String::from_utf8(nrrd("LPS", "raw", "", b"")).unwrap().replace("4 3 2", "40000 30000 20000").into_bytes(),
            "announces",
        ),
        (b"PK\x03\x04".to_vec(), "zip"),
        (Vec::new(), "empty"),
        (b"hello".to_vec(), "NIfTI"),
    ] {
        let told = read_labels("a.nrrd", &bytes, &none()).unwrap_err().0;
        assert!(told.contains(word), "{word}: {told}");
    }
}

#[test]
fn a_nifti_header_with_two_placements_is_told_with_their_distance() {
    use std::io::Read as _;
    let grid = Grid { size: [4, 3, 2], origin: Point::new(0.0, 0.0, 0.0), axes: nalgebra::Matrix3::identity() };
    let mut packed = Vec::new();
    nifti::write_labels(&mut packed, &Labels { grid, values: voxels() }).unwrap();
    let mut bytes = Vec::new();
    flate2::read::GzDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
    let said = |bytes: &[u8]| notices::texts(&read_labels("a.nii", bytes, &none()).unwrap().notes).join("\n");
    // a qform beside the sform: half a turn about the superior axis, as our frame lies in NIfTI's
    bytes[252] = 1;
    bytes[264..268].copy_from_slice(&1f32.to_le_bytes());
    assert_eq!(said(&bytes), "");
    bytes[268..272].copy_from_slice(&5f32.to_le_bytes());
    assert!(said(&bytes).contains("sform and qform place its voxels up to 5 mm apart"), "{}", said(&bytes));
}
