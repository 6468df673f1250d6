use super::*;
use meshes::shapes::{cuboid, icosphere};
use meshes::surface::TriMesh;
use proptest::prelude::*;
use std::io::Cursor;

fn none() -> BTreeMap<String, Vec<u8>> {
    BTreeMap::new()
}

fn read_any(name: &str, bytes: &[u8]) -> Result<ColouredMesh, FormatError> {
    read_surface(name, bytes, &none())
}

fn ascii_stl(mesh: &TriMesh, name: &str) -> String {
    let mut text = format!("solid {name}\n");
    for t in 0..mesh.triangles.len() {
        text += "facet normal 0 0 0\n outer loop\n";
        for p in mesh.corners(t) {
            text += &format!("  vertex {:e} {} {}\n", p.x, p.y, p.z);
        }
        text += " endloop\nendfacet\n";
    }
    text + &format!("endsolid {name}\n")
}

fn binary_stl(mesh: &TriMesh) -> Vec<u8> {
    let mut bytes = Vec::new();
    stl::write(&mut bytes, mesh).unwrap();
    bytes
}

fn coloured() -> ColouredMesh {
    let mesh = icosphere(20.0, 2);
    let colours = (0..mesh.vertices.len()).map(|i| [i as u8, 255 - i as u8, 7]).collect();
    ColouredMesh { mesh, colours }
}

fn binary_ply() -> Vec<u8> {
    let mut bytes = Vec::new();
    ply::write_coloured(&mut bytes, &coloured()).unwrap();
    bytes
}

fn message(result: Result<ColouredMesh, FormatError>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn binary_stl_agrees_with_stl_io_and_welds() {
    let bytes = binary_stl(&icosphere(10.0, 3));
    let mesh = read_any("a.stl", &bytes).unwrap().mesh;
    let oracle = stl_io::read_stl(&mut Cursor::new(&bytes)).unwrap();
    assert_eq!(mesh.vertices.len(), oracle.vertices.len());
    assert_eq!(mesh.triangles.len(), oracle.faces.len());
    for (t, face) in oracle.faces.iter().enumerate() {
        let corners = face.vertices.map(|v| oracle.vertices[v]);
        for (p, q) in mesh.corners(t).iter().zip(corners) {
            assert_eq!([p.x, p.y, p.z], [f64::from(q[0]), f64::from(q[1]), f64::from(q[2])]);
        }
    }
}

#[test]
fn every_ascii_dialect_reads_the_same() {
    let mesh = cuboid([1.0, 2.0, 3.5]);
    let plain = ascii_stl(&mesh, "knee");
    let bare = ascii_stl(&mesh, "").replace("solid \n", "solid\n");
    let crlf = plain.replace('\n', "\r\n");
    let mac = plain.replace('\n', "\r");
    let dialects = [
        plain.clone(),
        bare,
        plain.to_uppercase(),
        format!("\n\n  \n{plain}"),
        format!("\u{feff}{plain}"),
        crlf,
        mac,
        plain.replace(' ', "\t"),
        plain.replace("normal 0 0 0", "normal nan nan nan"),
    ];
    let expected = read_any("a.stl", plain.as_bytes()).unwrap().mesh;
    assert_eq!((expected.vertices.len(), expected.triangles.len()), (8, 12));
    for text in dialects {
        assert_eq!(read_any("a.stl", text.as_bytes()).unwrap().mesh, expected, "{text}");
    }
}

#[test]
fn all_solids_of_an_ascii_stl_are_read() {
    let apart = TriMesh {
        vertices: cuboid([1.0; 3]).vertices.iter().map(|p| p + Vector::new(5.0, 0.0, 0.0)).collect(),
        ..cuboid([1.0; 3])
    };
    let text = ascii_stl(&cuboid([1.0; 3]), "a") + &ascii_stl(&apart, "b");
    assert_eq!(read_any("a.stl", text.as_bytes()).unwrap().mesh.triangles.len(), 24);
}

#[test]
fn a_binary_header_may_begin_with_solid() {
    let mut bytes = binary_stl(&cuboid([1.0; 3]));
    bytes[..16].copy_from_slice(b"solid made by me");
    assert_eq!(read_any("a.stl", &bytes).unwrap().mesh.triangles.len(), 12);
    bytes.truncate(300);
    assert!(message(read_any("a.stl", &bytes)).contains("the header counts 12 triangles, which take 684 bytes"));
}

#[test]
fn an_stl_that_lies_is_refused_with_the_place() {
    let mut bytes = binary_stl(&cuboid([1.0; 3]));
    for count in [1u32, 4_000_000_000, 0] {
        bytes[80..84].copy_from_slice(&count.to_le_bytes());
        assert!(message(read_any("a.stl", &bytes)).contains(&format!("counts {count} triangles")));
    }
    let appended = [binary_stl(&cuboid([1.0; 3])), vec![0; 100]].concat();
    assert!(message(read_any("a.stl", &appended)).contains("wrote more behind the triangles"));
    assert!(message(read_any("a.stl", &appended[..600])).contains("cut short"));
    let mut bytes = binary_stl(&cuboid([1.0; 3]));
    bytes[84 + 12..84 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(message(read_any("a.stl", &bytes)).contains("vertex 1 has a coordinate that is not a finite number"));
    let text = ascii_stl(&cuboid([1.0; 3]), "a");
    let cases = [
        (text.replacen("vertex 0e0 0 0", "vertex 0 0", 1), "line 4: expected `vertex x y z`"),
        (text.replacen("vertex 0e0", "vertex 0,5", 1), "line 4: expected `vertex x y z`"),
        (text.replacen("vertex 0e0", "vertex nan", 1), "not a finite number"),
        (text.replacen("  vertex 0e0 0 0\n", "", 1), "line 7: a facet of 2 vertices"),
        (text.replacen("endloop", "endlop", 1), "line 7: unexpected `endlop`"),
        (text[..text.len() / 2].to_string(), ""),
        (text.replace("endsolid a", ""), "without `endsolid`"),
    ];
    for (text, expected) in cases {
        let said = message(read_any("a.stl", text.as_bytes()));
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn a_ply_with_capital_coordinates_is_read_and_a_packed_surface_named() {
    let scan = ColouredMesh { mesh: cuboid([1.0, 2.0, 3.0]), colours: Vec::new() };
    let mut plain = Vec::new();
    ply::write(&mut plain, &scan.mesh, &[]).unwrap();
    let header = plain.windows(10).position(|w| w == b"end_header").unwrap();
    let capital = String::from_utf8(plain[..header].to_vec()).unwrap();
    let capital = ["x", "y", "z"]
        .iter()
        .fold(capital, |text, axis| text.replacen(&format!(" {axis}\n"), &format!(" {}\n", axis.to_uppercase()), 1));
    assert!(capital.contains(" X\n") && capital.contains(" Z\n"), "{capital}");
    let bytes = [capital.as_bytes(), &plain[header..]].concat();
    assert_eq!(read_any("a.ply", &bytes).unwrap().mesh, read_any("a.ply", &plain).unwrap().mesh);
    assert!(message(read_any("a.stl.gz", b"\x1f\x8b\x08\x00")).contains("packed (gzip): unpack it"));
}

#[test]
fn ply_of_every_encoding_and_type_reads_the_same() {
    let expected = ply::read(&binary_ply()).unwrap();
    assert_eq!(expected.colours, coloured().colours);
    for (big, list) in [(false, "uint"), (true, "int"), (true, "ushort"), (false, "short")] {
        assert_eq!(ply::read(&ply_bytes(&expected, big, list)).unwrap(), expected, "{list}");
    }
    let ascii = ply_ascii(&expected);
    assert_eq!(ply::read(ascii.as_bytes()).unwrap(), expected);
    assert_eq!(ply::read(ascii.replace('\n', "\r\n").as_bytes()).unwrap(), expected);
    assert_eq!(read_any("a.stl", ascii.as_bytes()).unwrap(), expected, "content decides");
}

fn ply_header(scan: &ColouredMesh, format: &str, list: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment by hand\nobj_info none\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nproperty float quality\nproperty float red\nproperty float green\nproperty float blue\nelement face {}\nproperty list uchar float texcoord\nproperty list uchar {list} vertex_index\nend_header\n",
        scan.mesh.vertices.len(),
        scan.mesh.triangles.len()
    )
}

fn ply_ascii(scan: &ColouredMesh) -> String {
    let mut text = ply_header(scan, "ascii", "int");
    for (p, c) in scan.mesh.vertices.iter().zip(&scan.colours) {
        let c = c.map(|x| f32::from(x) / 255.0);
        text += &format!("{} {} {} 1.5 {} {} {}\n", p.x, p.y, p.z, c[0], c[1], c[2]);
    }
    for t in &scan.mesh.triangles {
        text += &format!("0 3 {} {} {}\n", t[0], t[1], t[2]);
    }
    text
}

fn ply_bytes(scan: &ColouredMesh, big: bool, list: &str) -> Vec<u8> {
    let mut bytes = ply_header(scan, if big { "binary_big_endian" } else { "binary_little_endian" }, list).into_bytes();
    let mut put = |number: &[u8]| {
        if big { bytes.extend(number.iter().rev()) } else { bytes.extend(number) }
    };
    for (p, c) in scan.mesh.vertices.iter().zip(&scan.colours) {
        p.coords.iter().for_each(|x| put(&x.to_le_bytes()));
        put(&1.5f32.to_le_bytes());
        c.iter().for_each(|x| put(&(f32::from(*x) / 255.0).to_le_bytes()));
    }
    for t in &scan.mesh.triangles {
        put(&[0]);
        put(&[3]);
        for v in t {
            if list.contains("short") { put(&(*v as u16).to_le_bytes()) } else { put(&v.to_le_bytes()) }
        }
    }
    bytes
}

#[test]
fn a_ply_that_lies_is_refused_with_the_place() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    assert_eq!(read_any("a.ply", text.as_bytes()).unwrap().mesh.triangles, [[0, 1, 2]]);
    let cases = [
        (text.replace("3 0 1 2", "3 0 1 3"), "face 1 names vertex 3, but vertices are numbered 0 to 2"),
        (text.replace("3 0 1 2", "3 0 1 -2"), "face 1 names vertex -2"),
        (text.replace("3 0 1 2", "2 0 1"), "face 1: a face with 2 corners"),
        (text.replace("1 0 0", "nan 0 0"), "line"),
        (text.replace("vertex 3", "vertex 20000000"), "counts 20000000 of `vertex`"),
        (text.replace("face 1", "face 2"), "Unexpected end of file"),
        (text.replace("element vertex", "element empty 99999999999\nelement vertex"), "counts 99999999999 of `empty`"),
        (text.replace("float z", "float w"), "no property `z`"),
        (text.replace("vertex_indices", "corners"), "no list `vertex_indices`"),
        (text.replace("vertex 3", "vertex -3"), "header"),
        (text.replace("int vertex", "float vertex"), "unsupported"),
    ];
    for (text, expected) in cases {
        let said = message(read_any("a.ply", text.as_bytes()));
        assert!(said.contains(expected), "{said} / {expected}");
    }
}

const OBJ: &str = "# a pyramid\nmtllib skin\\my look.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1 1.0 # apex\nvt 0.25 0.25\nvt 0.75 0.25\nvt 0.75 0.75\nvt 0.25 0.75\nusemtl skin\nf 1/1 4/4 3/3 2/2\nusemtl plain\nf 1 2 5\nf -4 -3 -1\nf 3//1 4//1 \\\n 5//1\nf 4 1 5\n";

#[test]
fn obj_agrees_with_tobj_and_polygons_are_cut() {
    let mesh = read_any("scans/a.obj", OBJ.as_bytes()).unwrap().mesh;
    assert!(meshes::topology::Topology::of(&mesh).is_closed());
    assert!((mesh.volume() - 1.0 / 3.0).abs() < 1e-12);
    let sphere = icosphere(7.0, 2);
    let mut text = String::new();
    sphere.vertices.iter().for_each(|p| text += &format!("v {} {} {}\n", p.x, p.y, p.z));
    sphere.triangles.iter().for_each(|t| text += &format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1));
    assert_eq!(read_any("a.obj", text.as_bytes()).unwrap().mesh, sphere);
    let options = tobj::LoadOptions { single_index: false, ..Default::default() };
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(&text), &options, |_| Ok(Default::default())).unwrap();
    let oracle = &models[0].mesh;
    assert_eq!(oracle.indices.len(), 3 * sphere.triangles.len());
    for (mine, theirs) in sphere.triangles.iter().flatten().zip(&oracle.indices) {
        let at = 3 * *theirs as usize;
        let place = Point::from([at, at + 1, at + 2].map(|k| f64::from(oracle.positions[k])));
        assert!((sphere.vertices[*mine as usize] - place).norm() < 1e-6);
    }
}

#[test]
fn a_concave_polygon_keeps_its_area() {
    let text = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 0.5 0\nv 0 4 0\nf 1 2 3 4 5\n";
    let mesh = read_any("a.obj", text.as_bytes()).unwrap().mesh;
    assert!((mesh.area() - (16.0 - 7.0)).abs() < 1e-12);
    assert!(mesh.triangle_normals().iter().all(|n| n.z > 0.99));
}

#[test]
fn obj_colours_come_from_vertices_or_textures() {
    let text = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.5\nf 1 2 3\n";
    assert_eq!(read_any("a.obj", text.as_bytes()).unwrap().colours, [[255, 0, 0], [0, 255, 0], [0, 0, 128]]);
    let half = text.replace(" 0 1 0\nv 0 1", "\nv 0 1");
    assert!(read_any("a.obj", half.as_bytes()).unwrap().colours.is_empty());
    let files = textured_files();
    assert_eq!(companions("scans/a.obj", OBJ.as_bytes()), ["scans/skin/my look.mtl"]);
    let library = "scans/skin/my look.mtl";
    assert_eq!(companions(library, &files[library]), ["scans/wood grain.png"]);
    let scan = read_surface("scans/a.obj", OBJ.as_bytes(), &files).unwrap();
    // Quadrants of the texture: red bottom left, green bottom right, blue top right, white top left; the sides are grey.
    let mixed = |c: [f64; 3], faces: f64| c.map(|x| ((x + faces * 127.5) / (1.0 + faces)).round() as u8);
    assert_eq!(scan.colours[0], mixed([255.0, 0.0, 0.0], 1.0));
    assert_eq!(scan.colours[2], mixed([0.0, 0.0, 255.0], 1.0));
    assert_eq!(scan.colours[4], [128, 128, 128]);
}

fn textured_files() -> BTreeMap<String, Vec<u8>> {
    let mut image = image::RgbImage::from_pixel(8, 8, image::Rgb([255, 0, 0]));
    for (x, y, pixel) in image.enumerate_pixels_mut() {
        pixel.0 = match (x < 4, y < 4) {
            (true, false) => [255, 0, 0],
            (false, false) => [0, 255, 0],
            (false, true) => [0, 0, 255],
            (true, true) => [255, 255, 255],
        };
    }
    let mut png = Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let library =
        "newmtl skin\r\nKd 1 1 1\r\nmap_Kd -s 1 1 1 -clamp on ../wood grain.png\r\nnewmtl plain\nKd 0.5 0.5 0.5\n";
    BTreeMap::from([
        ("scans/skin/my look.mtl".to_string(), library.as_bytes().to_vec()),
        ("scans/wood grain.png".to_string(), png.into_inner()),
    ])
}

#[test]
fn a_textured_ply_reads_as_the_obj_of_the_same_surface() {
    let mut files = textured_files();
    files.insert("m.mtl".into(), b"newmtl skin\nmap_Kd scans/wood grain.png\n".to_vec());
    let obj = "mtllib m.mtl\nv 0 0 0\nv 20 0 0\nv 20 10 0\nv 0 10 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl skin\nf 1/1 2/2 3/3 4/4\n";
    let right = read_surface("a.obj", obj.as_bytes(), &files).unwrap();
    assert!(right.colours.len() > 8);
    let ply = |vertex: &str, face: &str, rows: [&str; 4], end: &str| {
        let rows: String =
            ["0 0 0", "20 0 0", "20 10 0", "0 10 0"].iter().zip(rows).map(|(p, r)| format!("{p} {r}\n")).collect();
        format!(
            "ply\nformat ascii 1.0\ncomment TextureFile wood grain.png\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n{vertex}element face 1\nproperty list uchar int vertex_indices\n{face}end_header\n{rows}4 0 1 2 3{end}\n"
        )
    };
    let plain = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let by_face = ply(plain, "property list uchar float texcoord\n", ["9 9 9"; 4], " 8 0 0 1 0 1 1 0 1");
    let by_vertex = ply("property float s\nproperty float t\n", "", ["0 0", "1 0", "1 1", "0 1"], "");
    for text in [&by_face, &by_vertex] {
        assert_eq!(companions("scans/a.ply", text.as_bytes()), ["scans/wood grain.png"]);
        assert_eq!(read_surface("scans/a.ply", text.as_bytes(), &files).unwrap(), right);
    }
    // Without the picture, or with too few places, the vertices' own colours stay.
    assert_eq!(read_any("a.ply", by_face.as_bytes()).unwrap().colours, [[9; 3]; 4]);
    let short = by_face.replace(" 8 0 0 1 0 1 1 0 1", " 1 0");
    assert!(read_surface("scans/a.ply", short.as_bytes(), &files).is_ok());
}

#[test]
fn a_fine_texture_on_coarse_triangles_keeps_its_detail_and_the_surface_its_shape() {
    // A board of 20 x 10 mm, two triangles, folded along a seam between materials of one texture with a black stripe 1 mm wide.
    let mut image = image::RgbImage::from_pixel(100, 100, image::Rgb([220, 200, 170]));
    (0..100).for_each(|x| (45..55).for_each(|y| image.put_pixel(x, y, image::Rgb([20, 20, 20]))));
    let mut png = Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let files = BTreeMap::from([
        ("m.mtl".to_string(), b"newmtl skin\nmap_Kd t.png\nnewmtl grey\nKd 0.5 0.5 0.5\n".to_vec()),
        ("t.png".to_string(), png.into_inner()),
    ]);
    let text = "mtllib m.mtl\nv 0 0 0\nv 20 0 0\nv 20 10 0\nv 0 10 0\nv 20 0 9\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                usemtl skin\nf 1/1 2/2 3/3 4/4\nusemtl grey\nf 1 5 2\n";
    let scan = read_surface("a.obj", text.as_bytes(), &files).unwrap();
    let topology = meshes::topology::Topology::of(&scan.mesh);
    assert_eq!((topology.components, topology.irregular_edges, topology.euler_characteristic), (1, 0, 1));
    assert!((scan.mesh.area() - 200.0 - 90.0).abs() < 1e-9);
    let dark = |t: &usize| scan.mesh.triangles[*t].iter().all(|&v| scan.colours[v as usize][0] < 120);
    let skin = (0..scan.mesh.triangles.len()).filter(|&t| scan.mesh.corners(t).iter().all(|p| p.z == 0.0));
    let stripe: f64 = skin.filter(dark).map(|t| scan.mesh.area_vector(t).norm()).sum();
    assert!((5.0..25.0).contains(&stripe), "the stripe covers 20 mm2, {stripe}");
    let longest =
        (0..scan.mesh.triangles.len()).filter(|t| scan.mesh.corners(*t).iter().all(|p| p.z == 0.0)).flat_map(|t| {
            let [a, b, c] = scan.mesh.corners(t);
            [(a - b).norm(), (b - c).norm(), (c - a).norm()]
        });
    assert!(longest.fold(0.0, f64::max) < 0.81);
}

#[test]
fn vertices_split_at_texture_seams_are_joined() {
    let text = "mtllib m.mtl\nusemtl skin\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0.25 0.25\nvt 0.75 0.75\nf 1/1 2/1 3/1\nf 4/2 6/2 5/2\n";
    let mut files = textured_files();
    let library = files["scans/skin/my look.mtl"].clone();
    files.insert("skin/m.mtl".into(), library);
    files.insert("wood grain.png".into(), files["scans/wood grain.png"].clone());
    let scan = read_surface("skin/a.obj", text.as_bytes(), &files).unwrap();
    assert_eq!(scan.mesh.vertices.len(), 4);
    assert_eq!(scan.colours, [[255, 0, 0], [128, 0, 128], [128, 0, 128], [0, 0, 255]]);
}

#[test]
fn an_obj_that_lies_is_refused_with_the_line() {
    let cases = [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4: names vertex 4, but 3 stand above it"),
        ("v 0 0 0\nf 1 0 1\n", "line 2: names vertex 0"),
        ("v 0 0 0\nf 1 -2 1\n", "line 2: names vertex -2"),
        ("v 0 0 0\nf 1/1 1/1 1/1\n", "line 2: names texture coordinate 1"),
        ("v 0 0 x\n", "line 1: expected `v x y z`"),
        ("v 0 0 nan\n", "vertex 1 has a coordinate"),
        ("v 0 0 0\nf 1 1\n", "line 2: a face with 2 corners"),
        ("hello\n", "no line `v x y z`"),
    ];
    for (text, expected) in cases {
        let said = message(read_any("a.obj", text.as_bytes()));
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn what_is_no_surface_is_named() {
    let cases: [(&str, &[u8], &str); 6] = [
        ("a.stl", b"", "the file is empty"),
        ("a.stl", b"version https://git-lfs.github.com/spec/v1\n", "Git LFS pointer"),
        ("a.ply", b"<!DOCTYPE html>", "web page"),
        ("a.ply", b"hello", "does not begin with `ply`"),
        ("a.vtk", b"# vtk DataFile", "`.vtk`"),
        ("a.stl", b"0123456789", "too short"),
    ];
    for (name, bytes, expected) in cases {
        let said = message(read_any(name, bytes));
        assert!(said.contains(expected), "{said}");
    }
    assert_eq!(beside("scans/a.obj", "../../etc/passwd"), None);
    // a path of another machine: the file of its name beside, and nothing else
    assert_eq!(beside("scans/a.obj", "/etc/passwd").as_deref(), Some("scans/passwd"));
    assert_eq!(beside("scans/a.obj", "C:\\a.mtl").as_deref(), Some("scans/a.mtl"));
}

/// Bytes changed, cut, doubled: whatever comes, a reader answers, and what it gives is sound.
fn assault(seed: &[u8], edits: &[(usize, u8, u8)], names: &[&str], files: &BTreeMap<String, Vec<u8>>) {
    let mut bytes = seed.to_vec();
    for &(at, kind, value) in edits {
        let at = at % bytes.len().max(1);
        match kind % 5 {
            0 | 1 if at < bytes.len() => bytes[at] = value,
            2 => bytes.truncate(at),
            3 => bytes.insert(at, value),
            4 if at < bytes.len() => bytes.extend_from_within(at..(at + usize::from(value)).min(bytes.len())),
            _ => {}
        }
    }
    for name in names {
        companions(name, &bytes);
        if let Ok(scan) = read_surface(name, &bytes, files) {
            assert!(scan.colours.is_empty() || scan.colours.len() == scan.mesh.vertices.len());
            assert!(scan.mesh.triangles.iter().flatten().all(|&v| (v as usize) < scan.mesh.vertices.len()));
            assert!(scan.mesh.vertices.iter().all(|p| p.coords.iter().all(|x| x.is_finite())));
        }
    }
}

fn edits(reach: usize) -> impl Strategy<Value = Vec<(usize, u8, u8)>> {
    proptest::collection::vec((0..reach, any::<u8>(), any::<u8>()), 1..6)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn mutated_stl_never_panics(edits in edits(800)) {
        assault(&binary_stl(&cuboid([1.0; 3])), &edits, &["a.stl"], &none());
        assault(ascii_stl(&cuboid([1.0; 3]), "a").as_bytes(), &edits, &["a.stl"], &none());
    }

    #[test]
    fn mutated_ply_never_panics(edits in edits(1200)) {
        let scan = ColouredMesh { mesh: cuboid([1.0; 3]), colours: vec![[1, 2, 3]; 8] };
        assault(ply_ascii(&scan).as_bytes(), &edits, &["a.ply"], &none());
        assault(&ply_bytes(&scan, true, "int"), &edits, &["a.ply"], &none());
        assault(&ply_bytes(&scan, false, "ushort"), &edits, &["a.ply"], &none());
    }

    #[test]
    fn mutated_obj_and_its_companions_never_panic(edits in edits(400)) {
        let files = textured_files();
        assault(OBJ.as_bytes(), &edits, &["scans/a.obj", "a.mtl"], &files);
        for name in ["scans/skin/my look.mtl", "scans/wood grain.png"] {
            let mut files = files.clone();
            let bytes = files.get_mut(name).unwrap();
            for &(at, _, value) in &edits {
                let at = at % bytes.len();
                bytes[at] = value;
            }
            assault(OBJ.as_bytes(), &[], &["scans/a.obj"], &files);
        }
    }

    #[test]
    fn any_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        assault(&bytes, &[], &["a.stl", "a.ply", "a.obj", "a"], &none());
    }
}

#[test]
fn an_obj_with_decimal_commas_is_named() {
    let text = "v 0,5 1,25 2\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let error = read_surface("a.obj", text.as_bytes(), &BTreeMap::new()).unwrap_err().0;
    assert!(error.contains("line 1") && error.contains("decimal commas"), "{error}");
    assert!(read_surface("a.obj", text.replace(',', ".").as_bytes(), &BTreeMap::new()).is_ok());
    let error = read_surface("a.obj", b"v a,b c d\n", &BTreeMap::new()).unwrap_err().0;
    assert!(!error.contains("commas"), "{error}");
}

#[test]
fn an_ascii_stl_with_other_numbers_is_named_by_them() {
    let facet = |corner: &str| {
        format!(
            "solid a\nfacet normal 0 0 1\nouter loop\nvertex {corner}\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"
        )
    };
    let read = |corner: &str| read_surface("a.stl", facet(corner).as_bytes(), &BTreeMap::new());
    for (corner, words) in
        [("-7,428046e+01 0,5 1,5", "decimal commas"), ("-7.428D+01 0.5d0 1.5", "exponents with D"), ("a b c", "found")]
    {
        let error = read(corner).unwrap_err().0;
        assert!(error.contains("line 4") && error.contains(words), "{error}");
    }
    let error = read("a,b d 1").unwrap_err().0;
    assert!(!error.contains("commas") && !error.contains("exponents"), "{error}");
    assert!(read("-7.428046e+01 0.5 1.5").is_ok());
}

#[test]
fn an_obj_that_counts_from_0_is_named() {
    let told = |faces: &str| {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{faces}\n");
        read_surface("a.obj", text.as_bytes(), &BTreeMap::new()).err().map_or(String::new(), |e| e.0)
    };
    assert!(told("f 0 1 2").contains("counts from 0"), "{}", told("f 0 1 2"));
    assert!(told("f 1 2 4").contains("stand above it") && !told("f 1 2 4").contains("counts from 0"));
    assert!(told("f 1 2 3").is_empty());
}

#[test]
fn rounded_coordinates_of_a_surface_are_told_with_the_step() {
    // a sheet of 40 x 40 vertices that rises and falls
    let sheet = |step: f64| {
        let mut text = String::new();
        for (i, j) in (0..40).flat_map(|i| (0..40).map(move |j| (i, j))) {
            let p = [f64::from(i) * 2.0, f64::from(j) * 2.0, 5.0 * (0.3 * f64::from(i + j)).sin()];
            let [x, y, z] = p.map(|x| (x / step).round() * step);
            text += &format!("v {x} {y} {z}\n");
        }
        for (i, j) in (0..39).flat_map(|i| (0..39).map(move |j| (i, j))) {
            let v = 40 * i + j + 1;
            text += &format!("f {v} {} {}\n", v + 40, v + 1);
        }
        let (_, notes) = read_surface_told("a.obj", text.as_bytes(), &BTreeMap::new()).unwrap();
        notes.into_iter().map(|n| n.text).filter(|t| t.contains("steps of")).collect::<Vec<_>>()
    };
    for (step, told) in [(1.0, "steps of 1 mm"), (0.5, "steps of 0.5 mm")] {
        assert!(sheet(step).len() == 1 && sheet(step)[0].contains(told), "{:?}", sheet(step));
    }
    assert!(sheet(0.001).is_empty(), "{:?}", sheet(0.001));
}
