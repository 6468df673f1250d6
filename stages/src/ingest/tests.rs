use super::*;
use crate::specimen::PointFrame;
use formats::{ply, stl};
use meshes::Point;
use meshes::shapes::icosphere;

const TOML: &str = "[specimen]\nid = \"T1\"\nside = \"left\"\n\n[ct]\nfemur = \"ct/femur.stl\"\ntibfib = \"ct/tibfib.stl\"\n\n[scans]\nfemur = \"scans/femur.ply\"\ntibfib = \"scans/tibfib.ply\"\n\n[points]\nlandmarks = \"landmarks.csv\"\nmarks = \"marks.csv\"\n";

fn ball(radius: f64) -> TriMesh {
    icosphere(radius, 3)
}

fn stl_of(mesh: &TriMesh) -> Vec<u8> {
    let mut bytes = Vec::new();
    stl::write(&mut bytes, mesh).unwrap();
    bytes
}

fn raw() -> RawSpecimen {
    let mesh = ball(42.0);
    let scan = ColouredMesh { colours: vec![[1, 2, 3]; mesh.vertices.len()], mesh: mesh.clone() };
    let mut coloured = Vec::new();
    ply::write_coloured(&mut coloured, &scan).unwrap();
    let files = [
        ("ct/femur.stl", stl_of(&mesh)),
        ("ct/tibfib.stl", stl_of(&mesh)),
        ("scans/femur.ply", coloured.clone()),
        ("scans/tibfib.ply", coloured),
        ("landmarks.csv", b"name,frame,x_mm,y_mm,z_mm\na,ct,1,2,3\na,scan_femur,1,2,3\n".to_vec()),
        ("marks.csv", b"frame,ligament,x_mm,y_mm,z_mm\nscan_femur,ACL,1,2,3\n".to_vec()),
    ];
    RawSpecimen { toml: TOML.into(), files: files.map(|(n, b)| (n.to_string(), b)).into() }
}

fn refusal(raw: &RawSpecimen) -> String {
    ingest(raw, &IngestOptions::default()).unwrap_err().to_string()
}

fn with_file(name: &str, bytes: &[u8]) -> RawSpecimen {
    let mut raw = raw();
    raw.files.insert(name.into(), bytes.to_vec());
    raw
}

#[test]
fn a_sound_specimen_passes_and_names_its_files() {
    let specimen = ingest(&raw(), &IngestOptions::default()).unwrap();
    assert_eq!(specimen.landmarks.len(), 2);
    assert_eq!(specimen.marks[0].name, "ACL");
    assert_eq!(specimen.marks[0].frame, PointFrame::ScanFemur);
    assert_eq!(specimen.scans.femur.colours.len(), specimen.scans.femur.mesh.vertices.len());
    let mut paths = paths_named_by(TOML).unwrap();
    paths.sort();
    assert_eq!(paths, raw().files.into_keys().collect::<Vec<_>>());
}

#[test]
fn a_scan_without_colours_is_told() {
    let mut plain = Vec::new();
    ply::write(&mut plain, &ball(40.0), &[]).unwrap();
    let specimen = ingest(&with_file("scans/femur.ply", &plain), &IngestOptions::default()).unwrap();
    assert!(specimen.warnings.iter().any(|w| w.starts_with("scans.femur has no colours")), "{:?}", specimen.warnings);
}

#[test]
fn landmarks_are_known_in_any_writing_and_told_where_only_nearly() {
    let of = |rows: &str| {
        let table = format!("name,frame,x_mm,y_mm,z_mm\na,ct,1,2,3\n{rows}\n");
        ingest(&with_file("landmarks.csv", table.as_bytes()), &IngestOptions::default())
    };
    for name in ["FEMORAL_HEAD_CENTER", "Femoral head center", "femoral-head-center", "Femoral_Head_Center"] {
        let specimen = of(&format!("{name},ct,0,0,400")).unwrap();
        assert!(specimen.landmarks.iter().any(|l| l.name == "femoral_head_center"), "{name}");
        assert!(specimen.warnings.iter().all(|w| !w.contains("femoral_head")), "{name}: {:?}", specimen.warnings);
    }
    for (name, meant) in [
        ("hip centre", "femoral_head_center"),
        ("femoral_head_centre", "femoral_head_center"),
        ("medial_epicondyle", "epicondyle_medial"),
        ("femur_lat_epicondyle", "epicondyle_lateral"),
        ("ankle", "ankle_center"),
    ] {
        let told = of(&format!("{name},ct,0,0,400")).unwrap().warnings;
        assert!(told.iter().any(|w| w.contains(name) && w.contains(&format!("mean {meant}?"))), "{name}: {told:?}");
    }
    // a pair of frames is for the registration
    let pair = of("hip bolt,ct,0,0,4\nhip bolt,scan_femur,0,0,4").unwrap().warnings;
    assert!(pair.iter().all(|w| !w.contains("hip bolt")), "{pair:?}");
    let twice = of("femoral_head_center,ct,0,0,400\nFemoral head center,ct,0,0,401").unwrap_err().to_string();
    assert!(twice.contains("one landmark"), "{twice}");
}

#[test]
fn a_table_of_landmarks_without_the_femoral_head_is_told() {
    let told = |text: &str| {
        let specimen = ingest(&with_file("landmarks.csv", text.as_bytes()), &IngestOptions::default()).unwrap();
        specimen.warnings.iter().any(|w| w.contains("landmarks.csv gives no femoral_head_center"))
    };
    let table = "name,frame,x_mm,y_mm,z_mm\na,ct,1,2,3\n";
    assert!(told(table));
    assert!(!told(&format!("{table}femoral_head_center,ct,0,0,400\n")));
    let mut none = raw();
    none.toml = none.toml.replace("landmarks = \"landmarks.csv\"\n", "");
    none.files.remove("landmarks.csv");
    assert!(ingest(&none, &IngestOptions::default()).unwrap().warnings.iter().all(|w| !w.contains("femoral_head")));
}

#[test]
fn a_wrong_specimen_file_is_refused_with_key_and_line() {
    let cases = [
        (TOML.replace("side = ", "siide = "), "specimen.toml, line 3: unknown field `siide`"),
        (TOML.replace("\"left\"", "\"middle\""), "specimen.toml, line 3: unknown variant `middle`"),
        (TOML.replace("tibfib = \"ct/", "# "), "tibfib is missing"),
        (TOML.replace("ct/femur.stl", "/data/femur.stl"), "ct.femur = \"/data/femur.stl\" is an absolute path"),
        (TOML.replace("ct/femur.stl", "../femur.stl"), "leads out of the specimen directory"),
        (TOML.replace("ct/femur.stl", "ct/femur2.stl"), "ct.femur names ct/femur2.stl, which is not there"),
        (format!("{TOML}[ligaments.ACLX]\n"), "[ligaments.ACLX] names no bundle; expected one of ACL_AM"),
        (format!("{TOML}[ligaments.ACL_AM]\nreference_strain = -1.0\n"), "must be a number above 0"),
        ("[specimen".into(), "specimen.toml, line 1"),
    ];
    for (toml, expected) in cases {
        let said = refusal(&RawSpecimen { toml, ..raw() });
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn wrong_points_are_refused_with_file_and_line() {
    let header = "name,frame,x_mm,y_mm,z_mm\n";
    let cases = [
        (format!("{header}a,ct,1,2,3\nb,scan,1,2,3\n"), "landmarks.csv, line 3: frame is `scan`"),
        (format!("{header}a,ct,1,2,x\n"), "landmarks.csv, line 2: z_mm is `x`; expected a number in mm"),
        (format!("{header}a,ct,1,2,nan\n"), "line 2: z_mm is `nan`"),
        (format!("{header}a,ct,1,2\n"), "line 2: 4 cells; expected 5"),
        (format!("{header}a,ct,1,2,3\na,ct,1,2,3\n"), "line 3: a stands twice in frame ct"),
        ("name|frame|x_mm|y_mm|z_mm\n".into(), "not separated by commas"),
        ("name,frame,x_cm,y_cm,z_cm\n".into(), "multiply it by 10 and call it x_mm"),
        ("name,frame,x_m,y_m,z_m\n".into(), "multiply it by 1000 and call it x_mm"),
        ("name,frame,x,y_mm,z_mm\n".into(), "unknown column `x`"),
        ("name,frame,x_mm,y_mm\n".into(), "no column `z_mm`"),
    ];
    for (text, expected) in cases {
        let said = refusal(&with_file("landmarks.csv", text.as_bytes()));
        assert!(said.contains(expected), "{said}");
    }
    let said = refusal(&with_file("marks.csv", b"ligament,frame,x_mm,y_mm,z_mm\nMCL,scan_femur,1,2,3\n"));
    assert!(
        said.contains(
            "marks.csv, line 2: no ligament is called `MCL`; did you mean sMCL or dMCL?; expected one of ACL"
        ),
        "{said}"
    );
    let said = refusal(&with_file("marks.csv", b"ligament,frame,x_mm,y_mm,z_mm\nFCL,scan_femur,1,2,3\n"));
    assert!(said.contains("`FCL`; it is another name of LCL; expected one of ACL"), "{said}");
    let head = "bundle,fibre,femur_x_mm,femur_y_mm,femur_z_mm,tibia_x_mm,tibia_y_mm,tibia_z_mm\n";
    let fibres = with_file("attachments.csv", format!("{head}LCL,1,0,0,42,0,42,0\n").as_bytes());
    let specimen = ingest(&fibres, &IngestOptions::default()).unwrap();
    assert_eq!(specimen.given_fibres[0].tibia, Point::new(0.0, 42.0, 0.0));
    assert!(specimen.warnings.iter().any(|w| w.contains("gives LCL 1 fibres")));
    let said = refusal(&with_file("attachments.csv", format!("{head}LCL,0,1,2,3,4,5,6\n").as_bytes()));
    assert!(said.contains("line 2: fibre is `0`"), "{said}");
}

#[test]
fn points_between_semicolons_or_tabs_are_read_with_their_decimal_commas() {
    let commas = "name,frame,x_mm,y_mm,z_mm\na,ct,1.5,-2.25,3\n";
    let right = ingest(&with_file("landmarks.csv", commas.as_bytes()), &IngestOptions::default()).unwrap().landmarks;
    assert_eq!(right[0].point, Point::new(1.5, -2.25, 3.0));
    for separator in [";", "\t"] {
        let points = commas.replace(',', separator);
        for text in [points.clone(), points.replace('.', ",")] {
            let read = ingest(&with_file("landmarks.csv", text.as_bytes()), &IngestOptions::default()).unwrap();
            assert_eq!(read.landmarks, right, "{text}");
        }
    }
    // among commas a comma is no decimal point
    let said = refusal(&with_file("landmarks.csv", b"name,frame,x_mm,y_mm,z_mm\na,ct,\"1,5\",2,3\n"));
    assert!(said.contains("decimal point"), "{said}");
}

#[test]
fn a_fibre_given_twice_is_told_and_fibres_beside_each_other_are_not() {
    let head = "bundle,fibre,femur_x_mm,femur_y_mm,femur_z_mm,tibia_x_mm,tibia_y_mm,tibia_z_mm\n";
    let rows = "LCL,1,0,0,42,0,42,0\nLCL,2,0,0,42,42,0,0\n";
    let told = |last: &str| {
        let raw = with_file("attachments.csv", format!("{head}{rows}{last}").as_bytes());
        let found = ingest(&raw, &IngestOptions::default()).unwrap().warnings;
        found.into_iter().find(|w| w.contains("at the same two points")).map(|w| w.text)
    };
    let words = told("LCL,3,0,0,42,0,42,0\n").unwrap();
    assert!(words.contains("1 of its fibres") && words.contains("the first LCL 3"), "{words}");
    assert_eq!(told("LCL,3,0,42,0,0,0,42\n"), None);
}

#[test]
fn coordinates_in_coarse_steps_are_told_with_the_step() {
    let head = "bundle,fibre,femur_x_mm,femur_y_mm,femur_z_mm,tibia_x_mm,tibia_y_mm,tibia_z_mm\n";
    let places = [[0.0, 3.7, 41.8], [41.9, -2.9, 1.3], [-5.3, 41.6, 0.0], [12.4, -40.1, 0.9]];
    for step in [10.0, 5.0, 2.0, 1.0, 0.1] {
        let round = |x: f64| (x / step).round() * step;
        let row = |(k, p): (usize, &[f64; 3])| {
            let [x, y, z] = p.map(round);
            format!("LCL,{},{x},{y},{z},{},{},{}\n", k + 1, round(-p[0]), round(-p[1]), round(-p[2]))
        };
        let text = head.to_owned() + &places.iter().enumerate().map(row).collect::<String>();
        let specimen = ingest(&with_file("attachments.csv", text.as_bytes()), &IngestOptions::default()).unwrap();
        let told = |w: &&notices::Notice| w.kind == notices::Kind::CoarseNumbers && w.contains("steps of");
        let said: Vec<&notices::Notice> = specimen.warnings.iter().filter(told).collect();
        assert_eq!(said.len(), usize::from(step > 1.0), "{step}: {said:?}");
        assert!(said.iter().all(|w| w.contains(&format!("steps of {step} mm"))), "{said:?}");
    }
}

#[test]
fn one_end_of_a_fibre_off_its_bone_is_told_whichever_it_is() {
    let head = "bundle,fibre,femur_x_mm,femur_y_mm,femur_z_mm,tibia_x_mm,tibia_y_mm,tibia_z_mm\n";
    let places = [[0.0, 3.7, 41.8], [41.9, -2.9, 1.3], [-5.3, 41.6, 0.0], [12.4, -40.1, 0.9]];
    // `out` moves one end, and `all` each, away from the ball on which they lie
    let said = |moved: usize, out: f64, all: f64| {
        let at = |k: usize, p: [f64; 3], sign: f64| {
            let by = sign * (1.0 + (all + if k == moved { out } else { 0.0 }) / 42.0);
            p.map(|x| format!("{:.3}", by * x)).join(",")
        };
        let row =
            |(k, p): (usize, &[f64; 3])| format!("LCL,{},{},{}\n", k + 1, at(2 * k, *p, 1.0), at(2 * k + 1, *p, -1.0));
        let text = head.to_owned() + &places.iter().enumerate().map(row).collect::<String>();
        let specimen = ingest(&with_file("attachments.csv", text.as_bytes()), &IngestOptions::default()).unwrap();
        let told = |w: &notices::Notice| w.kind == notices::Kind::FibreEndsOffBone;
        specimen.warnings.into_iter().filter(told).map(|w| w.text).collect::<Vec<_>>()
    };
    for moved in 0..2 * places.len() {
        let words = said(moved, 10.0, 0.0);
        let end = format!("LCL {} (10 mm off the {})", moved / 2 + 1, ["femur", "tibia"][moved % 2]);
        let named = |w: &String| w.contains("1 ends of fibres lie off their bone") && w.contains(&end);
        assert!(words.len() == 1 && words.iter().all(named), "{moved}: {words:?}");
        assert!(said(moved, 4.0, 0.0).is_empty());
        // where all lie off a little, one that lies off more is not alone
        assert!(said(moved, 5.0, 2.0).is_empty());
    }
}

#[test]
fn a_knee_in_another_unit_is_recognised() {
    for (radius, unit) in [(0.042, "metres"), (4.2, "centimetres"), (1.65, "inches"), (42000.0, "micrometres")] {
        let said = refusal(&with_file("ct/femur.stl", &stl_of(&ball(radius))));
        assert!(said.contains(&format!("a knee in {unit}; expected millimetres: multiply")), "{said}");
        assert!(said.contains(" mm wide as its numbers stand, where adults' are 60 to 110 mm"), "{said}");
    }
    assert!(refusal(&with_file("ct/femur.stl", &stl_of(&ball(900.0)))).contains("check the unit"));
}

#[test]
fn wrong_surfaces_are_refused_or_put_right_and_counted() {
    assert!(refusal(&with_file("ct/femur.stl", b"")).contains("ct/femur.stl (ct.femur): the file is empty"));
    let few = TriMesh { triangles: vec![[0, 1, 2]], ..ball(42.0) };
    assert!(refusal(&with_file("ct/femur.stl", &stl_of(&few))).contains("3 vertices and 1 triangles"));
    let mut open = ball(42.0).flipped();
    open.triangles.truncate(1200);
    let specimen = ingest(&with_file("ct/femur.stl", &stl_of(&open)), &IngestOptions::default()).unwrap();
    assert!(specimen.ct.femur.volume() > 0.0);
    assert_eq!(specimen.metrics.ct_femur.as_ref().unwrap().turned_triangles, 1200);
    assert!(specimen.metrics.ct_femur.as_ref().unwrap().boundary_edges > 0);
    assert!(specimen.warnings.iter().any(|w| w.contains("open edges in a CT surface")));
}

/// Bones off the middle, so that a half turn moves them.
fn aside(signs: [f64; 2]) -> TriMesh {
    let mut mesh = ball(42.0);
    mesh.vertices.iter_mut().for_each(|p| *p = Point::new(signs[0] * (p.x + 90.0), signs[1] * (p.y + 30.0), p.z));
    mesh
}

#[test]
fn what_is_told_to_be_in_ras_is_turned_unless_its_file_says_its_frame() {
    let lps = stl_of(&aside([1.0, 1.0]));
    let ras = stl_of(&aside([-1.0, -1.0]));
    let of = |bone: &[u8], points: &str, ras: &[&str]| {
        let mut raw = with_file("ct/femur.stl", bone);
        raw.files.insert("ct/tibfib.stl".into(), bone.to_vec());
        raw.files.insert("landmarks.csv".into(), format!("name,frame,x_mm,y_mm,z_mm\n{points}\n").into_bytes());
        let options = IngestOptions { ras: ras.iter().map(|r| (*r).to_owned()).collect(), ..IngestOptions::default() };
        ingest(&raw, &options)
    };
    let plain = of(&lps, "epicondyle_medial,ct,132,30,0\nepicondyle_medial,scan_femur,1,2,3", &[]).unwrap();
    let turned = "epicondyle_medial,ct,-132,-30,0\nepicondyle_medial,scan_femur,1,2,3";
    let told = of(&ras, turned, &["ct", "points"]).unwrap();
    let near = |a: &Point, b: &Point| (a - b).norm() < 1e-5;
    let middle = |s: &Specimen| Point::from(s.ct.femur.vertices.iter().map(|p| p.coords).sum::<meshes::Vector>());
    assert!(near(&middle(&plain), &middle(&told)));
    for (a, b) in plain.landmarks.iter().zip(&told.landmarks) {
        assert!(near(&a.point, &b.point), "{} {} {}", a.name, a.point, b.point);
    }
    // a part that is not told is refused, with the option
    assert!(of(&ras, "a,ct,132,30,0", &[]).unwrap_err().to_string().contains("options.ingest.ras"));
    // the header's word goes before the option
    let mut says = lps.clone();
    says[..9].copy_from_slice(b"SPACE=LPS");
    let heard = of(&says, "a,ct,132,30,0", &["ct"]).unwrap();
    assert!(near(&middle(&plain), &middle(&heard)));
    assert!(
        of(&lps, "a,ct,132,30,0", &["scans"])
            .unwrap_err()
            .to_string()
            .contains("expected any of ct, cartilage, points")
    );
}
