//! Every reader of the program with files that it reads, and seeded corruption of them.
#![allow(dead_code, reason = "each binary uses its part")]

use formats::{dicom, nifti, picture, ply, read_surface, stl};
use meshes::shapes::icosphere;
use meshes::surface::ColouredMesh;
use meshes::volume::{Grid, Labels, Volume};
use std::collections::BTreeMap;

/// A small deterministic generator [steele2014].
pub(crate) struct Dice(pub u64);

impl Dice {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number below `n`.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// Numbers that readers stumble over.
const TEXTS: [&[u8]; 18] = [
    b"0",
    b"-1",
    b"4294967295",
    b"99999999999999999999",
    b"1e308",
    b"-1e-320",
    b"nan",
    b"inf",
    b"\n",
    b",",
    b"\"",
    b"\0",
    b" ",
    b"\xff\xfe",
    b"{",
    b"]",
    b"*",
    b"18446744073709551616",
];

/// `bytes` with one to four things done to them: bits turned, bytes set, cut, doubled, moved, numbers put in.
pub(crate) fn corrupted(bytes: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..=dice.below(4) {
        let (n, at) = (out.len(), dice.below(out.len()));
        match dice.below(9) {
            0 if n > 0 => out[at] ^= 1 << dice.below(8),
            1 if n > 0 => out[at] = dice.next() as u8,
            2 => out.truncate(at),
            3 if n > 0 => {
                let end = (at + 1 + dice.below(200)).min(n);
                out.drain(at..end);
            }
            4 if n > 0 => {
                let part = out[at..(at + 1 + dice.below(200)).min(n)].to_vec();
                let to = dice.below(n);
                out.splice(to..to, part);
            }
            5 => {
                let text = TEXTS[dice.below(TEXTS.len())];
                out.splice(at..at, text.iter().copied());
            }
            6 if n > 0 => {
                // A number in place of the one there.
                let digit = |b: &u8| b.is_ascii_digit();
                if let Some(start) = out[at..].iter().position(digit).map(|k| at + k) {
                    let end = out[start..].iter().position(|b| !digit(b)).map_or(n, |k| start + k);
                    let text = TEXTS[dice.below(8)];
                    out.splice(start..end, text.iter().copied());
                }
            }
            7 if n >= 4 => {
                let words = [0u32, 1, u32::MAX, i32::MAX as u32, 0x8000_0000, 0xFFFF, 0x7FC0_0000, 0x7F80_0000];
                let at = at.min(n - 4);
                out[at..at + 4].copy_from_slice(&words[dice.below(8)].to_le_bytes());
            }
            // In a header more often than elsewhere.
            _ if n > 0 => {
                let at = dice.below(n.min(400));
                out[at] = [0, 1, 0x7F, 0x80, 0xFF, b'9', b'-', b'.'][dice.below(8)];
            }
            _ => {}
        }
    }
    out
}

/// A reader by name: files it reads, and what it does with any bytes; whether it took them.
pub(crate) struct Reader {
    pub name: &'static str,
    pub corpus: Vec<Vec<u8>>,
    pub read: fn(&[u8]) -> bool,
}

fn none() -> BTreeMap<String, Vec<u8>> {
    BTreeMap::new()
}

/// An OBJ, its MTL and a texture, where `bytes` stands for the one of that ending.
fn textured(ending: &str, bytes: &[u8]) -> bool {
    let mut files: BTreeMap<String, Vec<u8>> = [
        ("m.ply".to_string(), PLY.to_vec()),
        ("m.mtl".into(), MTL.to_vec()),
        ("t.png".into(), png()),
        ("m.obj".into(), OBJ.to_vec()),
    ]
    .into();
    for (name, content) in &mut files {
        if name.ends_with(ending) {
            *content = bytes.to_vec();
        }
    }
    let obj = files["m.obj"].clone();
    let mtl = files["m.mtl"].clone();
    let _ = (formats::companions("m.obj", &obj), formats::companions("m.mtl", &mtl));
    if ending == ".ply" {
        return read_surface("m.ply", bytes, &files).is_ok();
    }
    read_surface("m.obj", &obj, &files).is_ok()
}

const OBJ: &[u8] = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nusemtl a\nf 1/1/1 2/2/1 3/3/1\nf -4/1 -2/3 -1/4\ng x\nusemtl b\nf 1 2 4 3\n";
const PLY: &[u8] = b"ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float s\nproperty float t\nelement face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\nend_header\n0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n3 0 1 2 6 0 0 1 0 1 1 0\n3 0 2 3 0 0\n";
const MTL: &[u8] = b"newmtl a\nKd 1 0.5 0.25\nmap_Kd t.png\nnewmtl b\nKd 0 0 1\n";

/// A grey-level PNG of 4 x 4.
fn png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = image::RgbImage::from_fn(4, 4, |x, y| image::Rgb([x as u8 * 60, y as u8 * 60, 9]));
    let _ = picture.write_to(&mut bytes, image::ImageFormat::Png);
    bytes.into_inner()
}

fn jpeg() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = image::RgbImage::from_fn(16, 16, |x, y| image::Rgb([x as u8 * 15, y as u8 * 15, 9]));
    let _ = picture.write_to(&mut bytes, image::ImageFormat::Jpeg);
    bytes.into_inner()
}

fn surfaces(write: impl Fn(&mut Vec<u8>, &ColouredMesh)) -> Vec<Vec<u8>> {
    let mesh = icosphere(30.0, 2);
    let colours = mesh.vertices.iter().map(|p| [p.x as u8, 100, 7]).collect();
    let mut bytes = Vec::new();
    write(&mut bytes, &ColouredMesh { mesh, colours });
    vec![bytes]
}

fn picture() -> Volume {
    let grid = Grid { size: [6, 5, 4], ..Grid::default() };
    let values = (0..grid.count()).map(|i| (i * 17 % 300) as f32).collect();
    Volume { grid, values }
}

fn labels() -> Vec<u8> {
    let grid = picture().grid;
    let values = (0..grid.count()).map(|i| (i % 5) as u8).collect();
    let mut bytes = Vec::new();
    let _ = nifti::write_labels(&mut bytes, &Labels { grid, values });
    bytes
}

/// The labels as NRRD: attached and raw, gzipped, ASCII.
fn nrrds() -> Vec<Vec<u8>> {
    let values: Vec<u8> = (0..120u32).map(|i| (i % 5) as u8).collect();
    let head = |encoding: &str| {
        format!("NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: 6 5 4\nspace directions: (0.4,0,0) (0,0.4,0) (0,0.1,0.7)\nkinds: domain domain domain\nencoding: {encoding}\nspace origin: (1,2,3)\nSegment0_Name:=Femur\nSegment0_LabelValue:=1\n\n").into_bytes()
    };
    let text: Vec<u8> = values.iter().flat_map(|v| format!("{v} ").into_bytes()).collect();
    let mut zipped = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    let _ = std::io::Write::write_all(&mut zipped, &values);
    let zipped = zipped.finish().unwrap_or_default();
    vec![[head("raw"), values].concat(), [head("gzip"), zipped].concat(), [head("ascii"), text].concat()]
}

fn metaimage() -> Vec<u8> {
    let head = b"ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 1 2 3\nElementSpacing = 0.4 0.4 0.7\nDimSize = 6 5 4\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
    let values: Vec<u8> = (0..120u32).map(|i| (i % 5) as u8).collect();
    [head.to_vec(), values].concat()
}

const VTK: &[u8] = b"# vtk DataFile Version 5.1\ntitle\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0 1 1 0 0 1 0.5\nPOLYGONS 3 6\nOFFSETS vtktypeint64\n0 3 6\nCONNECTIVITY vtktypeint64\n0 1 2 0 2 3\n";
const VTP: &[u8] = b"<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\">\n<PolyData><Piece><Points><DataArray type=\"Float32\" Name=\"Points\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 1 1 0 0 1 0.5</DataArray></Points><Polys><DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 1 2 0 2 3</DataArray><DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">3 6</DataArray></Polys></Piece></PolyData></VTKFile>\n";
const MARKUPS: &[u8] = b"{\"markups\":[{\"type\":\"Fiducial\",\"coordinateSystem\":\"LPS\",\"coordinateUnits\":\"mm\",\"controlPoints\":[{\"id\":\"1\",\"label\":\"a\",\"position\":[1.0,2.0,3.0],\"positionStatus\":\"defined\"}]}]}";
const FIDUCIALS: &[u8] = b"# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n1,1,2,3,0,0,0,1,1,1,0,a,,\n";

/// An enhanced series, packed by JPEG 2000, that another program wrote.
fn enhanced(bytes: &[u8]) -> bool {
    dicom::read_series(&[("a", bytes)]).is_ok()
}

fn unzipped(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let _ = std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(bytes), &mut out);
    out
}

/// A slice as a scanner writes it, explicit little-endian.
fn slice(k: usize) -> Vec<u8> {
    let element = |group: u16, number: u16, kind: &[u8; 2], value: &[u8]| {
        let value = if value.len() % 2 == 1 { [value, b" "].concat() } else { value.to_vec() };
        let (g, e, n) = (group.to_le_bytes(), number.to_le_bytes(), (value.len() as u16).to_le_bytes());
        [&g[..], &e, kind, &n, &value].concat()
    };
    let mut out = [vec![0; 128], b"DICM".to_vec()].concat();
    out.extend(element(2, 0x10, b"UI", b"1.2.840.10008.1.2.1\0"));
    out.extend([8, 0, 0x40, 0x11, b'S', b'Q', 0, 0, 255, 255, 255, 255, 0xFE, 0xFF, 0, 0xE0, 255, 255, 255, 255]);
    out.extend(element(8, 0x50, b"SH", b"x"));
    out.extend([0xFE, 0xFF, 0x0D, 0xE0, 0, 0, 0, 0, 0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0]);
    out.extend(element(0x20, 0x32, b"DS", format!("1\\2\\{}", 0.5 * k as f64).as_bytes()));
    out.extend(element(0x20, 0x37, b"DS", b"1\\0\\0\\0\\1\\0"));
    for (number, value) in [(0x10, 4u16), (0x11, 3), (0x100, 16), (0x101, 12), (0x102, 11), (0x103, 1)] {
        out.extend(element(0x28, number, b"US", &value.to_le_bytes()));
    }
    out.extend(element(0x28, 0x30, b"DS", b"0.8\\0.7"));
    out.extend(element(0x28, 0x1052, b"DS", b"-1024"));
    out.extend(element(0x28, 0x1053, b"DS", b"1"));
    out.extend([0xE0, 0x7F, 0x10, 0, b'O', b'W', 0, 0, 24, 0, 0, 0]);
    out.extend((0..12).flat_map(|i| ((100 * k + i) as u16).to_le_bytes()));
    out
}

/// A slice with its pixels packed by run lengths.
fn packed_slice() -> Vec<u8> {
    let plain = slice(2);
    let at = plain.windows(20).position(|w| w == b"1.2.840.10008.1.2.1\0").unwrap_or(0);
    let mut out = plain[..plain.len() - 24 - 12].to_vec();
    out[at..at + 20].copy_from_slice(b"1.2.840.10008.1.2.5\0");
    let mut packed = vec![0u8; 64];
    (packed[0], packed[4], packed[8]) = (2, 64, 66);
    packed.extend([245, 1, 245, 7]);
    out.extend([0xE0, 0x7F, 0x10, 0, b'O', b'B', 0, 0, 255, 255, 255, 255]);
    out.extend([0xFE, 0xFF, 0, 0xE0, 0, 0, 0, 0, 0xFE, 0xFF, 0, 0xE0, packed.len() as u8, 0, 0, 0]);
    out.extend(packed);
    out.extend([0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0]);
    out
}

fn series(bytes: &[u8]) -> bool {
    let others: Vec<Vec<u8>> = [0, 1, 3, 4].map(slice).into();
    let mut files: Vec<(&str, &[u8])> =
        ["a", "b", "d", "e"].into_iter().zip(others.iter().map(Vec::as_slice)).collect();
    files.push(("c", bytes));
    dicom::read_series(&files).is_ok()
}

/// A segmentation of two segments on 4 x 3 pixels: four frames, of which the second slice of segment 2 is left out; binary, or one byte a pixel.
pub(crate) fn segmentation(kind: &str) -> Vec<u8> {
    let long = |group: u16, number: u16, kind: &[u8; 2], value: &[u8]| {
        let (g, e, n) = (group.to_le_bytes(), number.to_le_bytes(), (value.len() as u32).to_le_bytes());
        [&g[..], &e, kind, &[0, 0], &n, value].concat()
    };
    let short = |group: u16, number: u16, kind: &[u8; 2], value: &[u8]| {
        let value = if value.len() % 2 == 1 { [value, b" "].concat() } else { value.to_vec() };
        let (g, e, n) = (group.to_le_bytes(), number.to_le_bytes(), (value.len() as u16).to_le_bytes());
        [&g[..], &e, kind, &n, &value].concat()
    };
    let item = |body: Vec<u8>| [&[0xFE, 0xFF, 0x00, 0xE0][..], &(body.len() as u32).to_le_bytes(), &body].concat();
    let sequence = |group: u16, number: u16, items: Vec<Vec<u8>>| long(group, number, b"SQ", &items.concat());
    let word = |n: u16| n.to_le_bytes();
    let mut out = [vec![0; 128], b"DICM".to_vec()].concat();
    out.extend(short(2, 0x10, b"UI", b"1.2.840.10008.1.2.1\0"));
    out.extend(short(8, 0x16, b"UI", b"1.2.840.10008.5.1.4.1.1.66.4\0\0"));
    out.extend(short(0x28, 8, b"IS", b"3"));
    let bits = if kind == "BINARY" { 1 } else { 8 };
    for (number, value) in [(0x10, 3), (0x11, 4), (0x100, bits)] {
        out.extend(short(0x28, number, b"US", &word(value)));
    }
    out.extend(short(0x62, 1, b"CS", kind.as_bytes()));
    let segment =
        |n: u16, name: &str| item([short(0x62, 4, b"US", &word(n)), short(0x62, 5, b"LO", name.as_bytes())].concat());
    out.extend(sequence(0x62, 2, vec![segment(1, "Femur"), segment(2, "Tibia")]));
    out.extend(short(0x62, 0xE, b"US", &word(200)));
    let orientation = short(0x20, 0x37, b"DS", b"1\\0\\0\\0\\1\\0");
    let measures = [short(0x18, 0x88, b"DS", b"0.5"), short(0x28, 0x30, b"DS", b"0.8\\0.7")].concat();
    let shared =
        [sequence(0x20, 0x9116, vec![item(orientation)]), sequence(0x28, 0x9110, vec![item(measures)])].concat();
    out.extend(sequence(0x5200, 0x9229, vec![item(shared)]));
    let frame = |segment: u16, slice: usize| {
        let place = short(0x20, 0x32, b"DS", format!("1\\2\\{}", 0.5 * slice as f64).as_bytes());
        let own = short(0x62, 0xB, b"US", &word(segment));
        item([sequence(0x20, 0x9113, vec![item(place)]), sequence(0x62, 0xA, vec![item(own)])].concat())
    };
    out.extend(sequence(0x5200, 0x9230, vec![frame(1, 0), frame(1, 3), frame(2, 0)]));
    // of the first frame pixels 0 to 7, of the second all, of the third the last six, of which two lie in segment 1, too
    let pixels: Vec<bool> = (0..36)
        .map(|k| match k / 12 {
            0 => k % 12 < 8,
            1 => true,
            _ => k % 12 >= 6,
        })
        .collect();
    let packed: Vec<u8> = match bits {
        1 => pixels.chunks(8).map(|c| c.iter().enumerate().map(|(k, on)| u8::from(*on) << k).sum()).collect(),
        _ => pixels.iter().map(|on| if *on { 150 } else { 40 }).collect(),
    };
    let packed = if packed.len() % 2 == 1 { [packed, vec![0]].concat() } else { packed };
    out.extend(long(0x7FE0, 0x10, b"OB", &packed));
    out
}

/// A sheet of laxity: shared strings, strings of its own, a formula with its value.
pub(crate) const SHEET: &[u8] = br#"<worksheet><sheetData><row r="1"><c r="A1" t="s"><v>0</v></c><c r="B1" t="inlineStr"><is><t>test</t></is></c><c r="C1" t="str"><v>nominal_flexion_deg</v></c><c r="D1" t="str"><v>load_vv_nm</v></c><c r="E1" t="str"><v>load_ie_nm</v></c><c r="F1" t="str"><v>load_ml_n</v></c><c r="G1" t="str"><v>load_ap_n</v></c><c r="H1" t="str"><v>load_si_n</v></c><c r="I1" t="str"><v>fe_deg</v></c><c r="J1" t="str"><v>vv_deg</v></c><c r="K1" t="str"><v>ie_deg</v></c><c r="L1" t="str"><v>ml_mm</v></c><c r="M1" t="str"><v>ap_mm</v></c><c r="N1" t="str"><v>si_mm</v></c></row><row r="3"><c r="A3" t="str"><v>a1</v></c><c r="B3" t="str"><v>anterior</v></c><c r="C3"><v>30</v></c><c r="D3"><v>0</v></c><c r="E3"><v>0</v></c><c r="F3"><v>0</v></c><c r="G3"><f>50*2</f><v>100</v></c><c r="H3"><v>20</v></c><c r="I3"><v>3.05E1</v></c><c r="J3"><v>0.2</v></c><c r="K3"><v>-3.1</v></c><c r="L3"><v>1.2</v></c><c r="M3"><v>6.4</v></c><c r="N3"><v>-0.3</v></c></row></sheetData></worksheet>"#;

/// A workbook about a sheet.
pub(crate) fn workbook(sheet: &[u8]) -> Vec<u8> {
    zipped(&[
        (
            "xl/workbook.xml",
            br#"<workbook><workbookPr/><sheets><sheet name="a" sheetId="1" r:id="rId1"/></sheets></workbook>"#,
        ),
        (
            "xl/_rels/workbook.xml.rels",
            br#"<Relationships><Relationship Id="rId1" Target="worksheets/sheet1.xml"/></Relationships>"#,
        ),
        ("xl/sharedStrings.xml", b"<sst><si><t>trial</t></si></sst>"),
        ("xl/worksheets/sheet1.xml", sheet),
    ])
}

/// A zip archive of files that are not packed.
pub(crate) fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut out, mut table) = (Vec::new(), Vec::new());
    for (name, bytes) in files {
        let at = (out.len() as u32).to_le_bytes();
        let (size, names) = ((bytes.len() as u32).to_le_bytes(), (name.len() as u16).to_le_bytes());
        let about = [&[20, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0][..], &size, &size, &names, &[0, 0]].concat();
        out.extend([&b"PK\x03\x04"[..], &about, name.as_bytes(), bytes].concat());
        table.extend([&b"PK\x01\x02\x14\x00"[..], &about, &[0; 10], &at, name.as_bytes()].concat());
    }
    let (count, size, at) =
        ((files.len() as u16).to_le_bytes(), (table.len() as u32).to_le_bytes(), (out.len() as u32).to_le_bytes());
    let end = [&b"PK\x05\x06\0\0\0\0"[..], &count, &count, &size, &at, &[0, 0]].concat();
    [out, table, end].concat()
}

const PICKED: &[u8] = b"<!DOCTYPE PickedPoints>\n<PickedPoints>\n <DocumentData><User name=\"a\"/></DocumentData>\n <point x=\"1.5\" y=\"2\" z=\"-3\" name=\"a\" active=\"1\"/>\n <point x=\"4\" y=\"5\" z=\"6\" name=\"b\" active=\"1\"/>\n</PickedPoints>\n";

/// As [`points`], from a file of MeshLab's.
fn picked(bytes: &[u8]) -> bool {
    landmarks("a.pp", bytes)
}

const TOML: &[u8] = b"[specimen]\nid = \"K\"\nside = \"left\"\nage_years = 29\n\n[ct]\nfemur = \"ct/femur.stl\"\ntibfib = \"ct/tibfib.stl\"\n\n[scans]\nfemur = \"scans/femur.ply\"\ntibfib = \"scans/tibfib.ply\"\n\n[ligaments.ACL_AM]\nreference_strain = 1.07\n\n[options.bones]\nedge_mm = 2\n";
const POINTS: &[u8] = b"name,frame,x_mm,y_mm,z_mm\na,ct,1.5,2.5,-3\na,scan_femur,4,5,6e1\n\"b, c\",scan_tibfib,7,8,9\n";

/// Reads a specimen whose landmarks are `bytes`, as far as the points.
fn points(bytes: &[u8]) -> bool {
    landmarks("landmarks.csv", bytes)
}

/// As [`points`], from a file of 3D Slicer's.
fn markups(bytes: &[u8]) -> bool {
    landmarks("a.mrk.json", bytes)
}

fn fiducials(bytes: &[u8]) -> bool {
    landmarks("a.fcsv", bytes)
}

fn landmarks(name: &str, bytes: &[u8]) -> bool {
    let toml = format!("{}[points]\nlandmarks = \"{name}\"\n", String::from_utf8_lossy(TOML));
    let mut stl_bytes = Vec::new();
    let _ = stl::write(&mut stl_bytes, &icosphere(40.0, 2));
    let mut files: BTreeMap<String, Vec<u8>> = ["ct/femur.stl", "ct/tibfib.stl", "scans/femur.ply", "scans/tibfib.ply"]
        .map(|f| (f.into(), stl_bytes.clone()))
        .into();
    files.insert(name.into(), bytes.to_vec());
    let raw = stages::specimen::RawSpecimen { toml, files };
    stages::ingest::ingest(&raw, &Default::default()).is_ok()
}

/// A cap of a ball of 30 mm whose lowest point, and a plane whose middle, lies 30 mm below the origin, as OBJ [m].
fn bowl(round: bool) -> Vec<u8> {
    const SIDE: usize = 9;
    let mut out = String::new();
    for i in 0..SIDE * SIDE {
        let [u, v] = [i % SIDE, i / SIDE].map(|k| 0.02 * (k as f64 / (SIDE - 1) as f64 * 2.0 - 1.0));
        let y = if round { -(0.03_f64.powi(2) - u * u - v * v).sqrt() } else { -0.03 };
        out += &format!("v {u} {y} {v}\n");
    }
    for i in (0..SIDE * (SIDE - 1)).filter(|i| i % SIDE != SIDE - 1) {
        let [a, b, c, d] = [i + 1, i + 2, i + SIDE + 2, i + SIDE + 1];
        out +=
            &if round { format!("f {a} {b} {c}\nf {a} {c} {d}\n") } else { format!("f {a} {c} {b}\nf {a} {d} {c}\n") };
    }
    out.into_bytes()
}

/// Readers of decks, tables, lists of points and what a specimen says in words.
fn tables() -> Vec<Reader> {
    vec![
        Reader {
            name: "inp",
            corpus: vec![
                include_bytes!("../corpus/knee.inp").to_vec(),
                include_bytes!("../corpus/keywords.inp").to_vec(),
            ],
            read: |b| {
                let mut give = |name: &str| {
                    if name == "main.inp" { Ok(b.to_vec()) } else { Err("not there".to_string()) }
                };
                decks::import("main.inp", &mut give).is_ok()
            },
        },
        Reader {
            name: "osim",
            corpus: vec![include_bytes!("../corpus/ball.osim").to_vec()],
            read: |b| {
                let mut give = |name: &str| match name.rsplit('/').next() {
                    Some("femur.obj") => Ok(bowl(true)),
                    Some("tibia.obj") => Ok(bowl(false)),
                    _ => Err("not there".to_string()),
                };
                decks::opensim::import("main.osim", b, &mut give, &Default::default()).is_ok()
            },
        },
        Reader {
            name: "feb",
            corpus: vec![include_bytes!("../corpus/ball.feb").to_vec()],
            read: |b| decks::febio::import("main.feb", b, &Default::default()).is_ok(),
        },
        Reader {
            name: "laxity",
            corpus: vec![include_bytes!("../corpus/laxity.csv").to_vec()],
            read: |b| sim::laxity::read(b).is_ok(),
        },
        Reader {
            name: "passive",
            corpus: vec![include_bytes!("../corpus/passive.csv").to_vec()],
            read: |b| validation::passive::read(b).is_ok(),
        },
        Reader { name: "points", corpus: vec![POINTS.to_vec()], read: points },
        Reader {
            name: "toml",
            corpus: vec![TOML.to_vec()],
            read: |b| String::from_utf8(b.to_vec()).is_ok_and(|t| stages::ingest::parse_specimen_file(&t).is_ok()),
        },
        Reader {
            name: "json",
            corpus: vec![include_bytes!("../corpus/model.json").to_vec()],
            read: |b| serde_json::from_slice::<sim::spec::ModelSpec>(b).is_ok(),
        },
        Reader { name: "picked points", corpus: vec![PICKED.to_vec()], read: picked },
        Reader {
            name: "workbook",
            corpus: vec![include_bytes!("../corpus/laxity.xlsx").to_vec()],
            read: |b| sim::laxity::read(b).is_ok(),
        },
        Reader {
            name: "workbook's sheet",
            corpus: vec![SHEET.to_vec()],
            read: |b| sim::laxity::read(&workbook(b)).is_ok(),
        },
    ]
}

/// All readers.
pub(crate) fn readers() -> Vec<Reader> {
    let plain_ply = surfaces(|out, mesh| ply::write_coloured(out, mesh).unwrap_or_default());
    let ascii_ply = b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 1 2 3\n3 0 1 2\n4 0 1 2 3\n".to_vec();
    let ascii_stl = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1.5e0 0\nendloop\nendfacet\nendsolid a\nsolid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 5\nvertex 1 0 5\nvertex 0 1 5\nendloop\nendfacet\nendsolid\n".to_vec();
    let mut zipped = Vec::new();
    let _ = nifti::write(&mut zipped, &picture());
    let mut all = vec![
        Reader {
            name: "stl",
            corpus: [surfaces(|out, m| stl::write(out, &m.mesh).unwrap_or_default()), vec![ascii_stl]].concat(),
            read: |b| read_surface("a.stl", b, &none()).is_ok(),
        },
        Reader {
            name: "ply",
            corpus: [plain_ply, vec![ascii_ply]].concat(),
            read: |b| read_surface("a.ply", b, &none()).is_ok(),
        },
        Reader { name: "textured", corpus: vec![PLY.to_vec()], read: |b| textured(".ply", b) },
        Reader { name: "obj", corpus: vec![OBJ.to_vec()], read: |b| textured(".obj", b) },
        Reader { name: "mtl", corpus: vec![MTL.to_vec()], read: |b| textured(".mtl", b) },
        Reader { name: "image", corpus: vec![png(), jpeg()], read: |b| textured(".png", b) },
        Reader { name: "nifti", corpus: vec![zipped.clone(), unzipped(&zipped)], read: |b| nifti::read(b).is_ok() },
        Reader { name: "labels", corpus: vec![labels(), unzipped(&labels())], read: |b| nifti::read_labels(b).is_ok() },
        Reader { name: "nrrd", corpus: nrrds(), read: |b| picture::read_labels("a.nrrd", b, &none()).is_ok() },
        Reader {
            name: "metaimage",
            corpus: vec![metaimage()],
            read: |b| picture::read_labels("a.mha", b, &none()).is_ok(),
        },
        Reader {
            name: "vtk",
            corpus: vec![VTK.to_vec(), VTP.to_vec()],
            read: |b| read_surface("a.vtk", b, &none()).is_ok(),
        },
        Reader { name: "markups", corpus: vec![MARKUPS.to_vec()], read: markups },
        Reader { name: "fiducials", corpus: vec![FIDUCIALS.to_vec()], read: fiducials },
        Reader {
            name: "enhanced",
            corpus: vec![
                include_bytes!("../corpus/dicom/enhanced-j2k.dcm").to_vec(),
                include_bytes!("../corpus/dicom/enhanced-rle.dcm").to_vec(),
            ],
            read: enhanced,
        },
        Reader {
            name: "segmentation",
            corpus: vec![segmentation("BINARY"), segmentation("FRACTIONAL")],
            read: |b| picture::read_labels("a.dcm", b, &none()).is_ok(),
        },
        Reader { name: "dicom", corpus: vec![slice(2), packed_slice()], read: series },
    ];
    all.extend(tables());
    all
}
