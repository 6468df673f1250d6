use super::*;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::io::Write;

const POINTS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 2.0, 0.5]];

fn expected(mesh: &TriMesh) -> bool {
    mesh.vertices.len() == 4 && mesh.triangles.len() == 2 && (mesh.area() - 4.15).abs() < 0.1
}

fn old(body: &str) -> Vec<u8> {
    format!("# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 2 0 0\n2 2 0 0 2 0.5\n{body}\nPOINT_DATA 4\nSCALARS a float 1\n").into_bytes()
}

#[test]
fn legacy_files_of_each_age_are_read() {
    for body in [
        "POLYGONS 2 8\n3 0 1 2\n3 0 2 3",
        "POLYGONS 1 5\n4 0 1 2 3",
        "TRIANGLE_STRIPS 1 5\n4 0 1 3 2",
        "METADATA\nINFORMATION 0\n\nVERTICES 1 2\n1 0\nPOLYGONS 3 6\nOFFSETS vtktypeint64\n0 3 6\nCONNECTIVITY vtktypeint64\n0 1 2 0 2 3",
    ] {
        let mesh = read(&old(body)).unwrap();
        assert!(expected(&mesh), "{body}: {mesh:?}");
    }
    let mut binary = b"# vtk DataFile Version 5.1\nvtk output\nBINARY\nDATASET POLYDATA\nPOINTS 4 float\n".to_vec();
    binary.extend(POINTS.iter().flatten().flat_map(|x| x.to_be_bytes()));
    binary.extend(b"\nPOLYGONS 3 6\nOFFSETS vtktypeint64\n");
    binary.extend([0i64, 3, 6].iter().flat_map(|x| x.to_be_bytes()));
    binary.extend(b"\nCONNECTIVITY vtktypeint64\n");
    binary.extend([0i64, 1, 2, 0, 2, 3].iter().flat_map(|x| x.to_be_bytes()));
    assert!(expected(&read(&binary).unwrap()));
    for n in 0..binary.len() - 1 {
        assert!(read(&binary[..n]).is_err(), "{n}");
    }
}

fn xml(zlib: bool, raw: bool) -> Vec<u8> {
    let block = |bytes: Vec<u8>| -> Vec<u8> {
        if !zlib {
            return [(bytes.len() as u64).to_le_bytes().to_vec(), bytes].concat();
        }
        let mut z = ZlibEncoder::new(Vec::new(), Compression::default());
        z.write_all(&bytes).unwrap();
        let packed = z.finish().unwrap();
        let head: Vec<u8> =
            [1, bytes.len() as u64, 0, packed.len() as u64].iter().flat_map(|x| x.to_le_bytes()).collect();
        [head, packed].concat()
    };
    let code = |bytes: Vec<u8>| -> Vec<u8> {
        let block = block(bytes);
        if raw {
            return block;
        }
        let head = if zlib { 32 } else { 0 };
        [STANDARD.encode(&block[..head]), STANDARD.encode(&block[head..])].concat().into_bytes()
    };
    let points = code(POINTS.iter().flatten().flat_map(|x| x.to_le_bytes()).collect());
    let list = code([0i64, 1, 2, 0, 2, 3].iter().flat_map(|x| x.to_le_bytes()).collect());
    let ends = code([3i64, 6].iter().flat_map(|x| x.to_le_bytes()).collect());
    let compressor = if zlib { " compressor=\"vtkZLibDataCompressor\"" } else { "" };
    let array = |name: &str, kind: &str, at: usize, body: &[u8]| -> String {
        if raw {
            format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"appended\" offset=\"{at}\"/>")
        } else {
            format!(
                "<DataArray type=\"{kind}\" Name=\"{name}\" format=\"binary\">\n{}\n</DataArray>",
                String::from_utf8_lossy(body)
            )
        }
    };
    let (a, b) = (points.len(), points.len() + list.len());
    let text = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\"{compressor}>\n<PolyData><Piece><Points>{}</Points><Polys>{}{}</Polys></Piece></PolyData>",
        array("Points", "Float32", 0, &points),
        array("connectivity", "Int64", a, &list),
        array("offsets", "Int64", b, &ends)
    );
    let tail =
        if raw { [b"<AppendedData encoding=\"raw\">\n_".to_vec(), points, list, ends].concat() } else { Vec::new() };
    [text.into_bytes(), tail, b"</VTKFile>".to_vec()].concat()
}

#[test]
fn xml_files_of_each_encoding_are_read() {
    for (zlib, raw) in [(false, false), (true, false), (false, true), (true, true)] {
        let bytes = xml(zlib, raw);
        let mesh = read(&bytes).unwrap_or_else(|e| panic!("{zlib} {raw}: {e}"));
        assert!(expected(&mesh), "{zlib} {raw}: {mesh:?}");
        for n in (0..bytes.len() - 20).step_by(7) {
            assert!(read(&bytes[..n]).is_err(), "{zlib} {raw} {n}");
        }
    }
}

#[test]
fn what_is_no_surface_is_named_and_slicers_frame_is_minded() {
    let solid = "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10";
    assert!(read(&old(solid)).unwrap_err().0.contains("solid"));
    assert!(read(&old("POLYGONS 1 4\n3 0 1 9")).unwrap_err().0.contains("point 9"));
    assert!(read(&old("")).unwrap_err().0.contains("no faces"));
    assert!(
        read(b"# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\n").unwrap_err().0.contains("POLYDATA")
    );
    let files = std::collections::BTreeMap::new();
    let plain = old("POLYGONS 2 8\n3 0 1 2\n3 0 2 3");
    let ras = String::from_utf8(plain.clone()).unwrap().replace("title", "3D Slicer output. SPACE=RAS").into_bytes();
    let [a, b] = [plain, ras].map(|bytes| crate::read_surface("a.vtk", &bytes, &files).unwrap().mesh);
    assert!(a.vertices.iter().zip(&b.vertices).all(|(p, q)| *q == Point::new(-p.x, -p.y, p.z)));
}

#[test]
fn hexahedra_are_read_as_they_were_written() {
    let nodes = (0..12).map(|k| Point::new((k % 2) as f64, (k / 2 % 2) as f64, (k / 4) as f64 + 1.0 / 3.0)).collect();
    let elements = vec![[0, 1, 3, 2, 4, 5, 7, 6], [4, 5, 7, 6, 8, 9, 11, 10]];
    let mesh = meshes::hex::HexMesh { nodes, elements, ..Default::default() };
    let mut bytes = Vec::new();
    crate::vtu::write_hex(&mut bytes, &mesh).unwrap();
    let read = read_solids(&bytes).unwrap();
    assert_eq!((read.nodes, read.hexahedra, read.tetrahedra.len()), (mesh.nodes, mesh.elements, 0));
    for n in (0..bytes.len() - 20).step_by(7) {
        assert!(read_solids(&bytes[..n]).is_err(), "{n}");
    }
    let text = String::from_utf8(bytes).unwrap();
    assert!(read_solids(text.replace("4 5 7 6 8", "4 5 7 6 88").as_bytes()).unwrap_err().0.contains("point 88"));
    assert!(read_solids(text.replace("12\n12", "12\n13").as_bytes()).unwrap_err().0.contains("kind 13"));
}
