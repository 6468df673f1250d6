//! The published deck of Specimen 1 and what Abaqus answered to it.
#![expect(clippy::disallowed_methods, reason = "reads ../shared where it is there")]
#![expect(clippy::print_stdout, reason = "figures for the reader of the log")]

use crate::common::shared;
use decks::{ImportedDeck, export, import};
use meshes::surface::TriMesh;
use needs_shared::needs_shared;
use sim::coordinate::Six;
use sim::deck::{ChainCoordinate, ControlKind};
use sim::joint::Joint;
use sim::mesh::MeshValue;
use std::path::Path;

const MAIN: &str = "S192803_MAIN_LAXITY_Anterior_30deg_10.inp";

fn deck(dir: &Path, main: &str) -> ImportedDeck {
    import(main, &mut |name: &str| std::fs::read(dir.join(name)).map_err(|e| e.to_string())).expect("the deck is read")
}

fn surface<'a>(deck: &'a ImportedDeck, path: &str) -> &'a TriMesh {
    match &deck.meshes[path] {
        MeshValue::Surface(m) => m,
        other => panic!("{path}: {other:?}"),
    }
}

#[needs_shared]
fn the_published_deck_is_read_as_it_is_described() {
    let Some(dir) = shared("published deck", "published/S192803/deck") else { return };
    let deck = deck(&dir, MAIN);
    let spec = &deck.spec;
    assert_eq!((spec.id.as_str(), spec.side), ("S192803", meshes::frame::Side::Left));
    assert_eq!((spec.bundles.len(), spec.fibres.len()), (14, 31));
    let bundle = |name: &str| spec.bundles.iter().find(|b| b.name == name).unwrap();
    assert_eq!(bundle("ACL_AM").reference_strain, 1.061052630287);
    assert_eq!(bundle("ACL_AM").stiffness_n_per_mm, 63.986473003082);
    assert_eq!(bundle("sMCL_P").reference_length_mm, 101.92526);
    assert_eq!(bundle("PCL_PM").reference_length_mm, 30.928615);
    assert_eq!((spec.toe_end_multiple["ACL_AM"], spec.toe_end_multiple["LCL"]), (50.0, 10.0));
    let gs = spec.frames.gs_ct_pose;
    let truth = [-6.12548473, 0.80496413, 2.17024262, 0.77235644, 0.37804099, -22.19989239];
    for (ours, abaqus) in [gs.fe_deg, gs.vv_deg, gs.ie_deg, gs.ml_mm, gs.ap_mm, gs.si_mm].iter().zip(truth) {
        assert!((ours - abaqus).abs() < 1e-4, "{ours} {abaqus}");
    }
    let contact = &spec.contact;
    assert_eq!((contact.friction, contact.damping, contact.pairs.len()), (0.03, 0.001, 2));
    assert!((contact.pressure_mpa[4] - 1.3390379).abs() < 1e-6);
    let protocol = &spec.protocols[0];
    assert_eq!(
        protocol.steps.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(),
        ["OFFSET", "DISP_CONTROL", "LAXITY"]
    );
    assert_eq!(protocol.steps.iter().map(|s| s.contact).collect::<Vec<_>>(), [false, true, true]);
    assert_eq!(protocol.quirks.len(), 5, "{:?}", protocol.quirks);
    let find = |c: ChainCoordinate| protocol.steps[2].controls.iter().find(|x| x.coordinate == c).unwrap();
    assert!((find(ChainCoordinate::Fe).at(1.5) + 0.0174 * 21.483299).abs() < 1e-12);
    assert_eq!((find(ChainCoordinate::Ap).kind, find(ChainCoordinate::Ap).at(1.5)), (ControlKind::Load, 44.4822));
    assert_eq!(find(ChainCoordinate::Si).at(0.0), -20.0);
    let files = deck.files().unwrap();
    let json = files.iter().find(|(path, _)| path == "model.json").unwrap();
    let back: sim::spec::ModelSpec = serde_json::from_slice(&json.1).unwrap();
    assert_eq!((back.fibres.len(), &back.protocols[0].name), (31, &protocol.name));
    assert_eq!(files.len(), 9, "bones, cartilages, contact faces and the model");
}

#[needs_shared]
fn the_decks_cartilage_gives_the_published_contact_faces() {
    let Some(dir) = shared("contact faces", "published/S192803") else { return };
    let deck = deck(&dir.join("deck"), MAIN);
    for (ours, theirs) in
        [("femur", "femur_cart"), ("tibia_medial", "tibia_cart_med"), ("tibia_lateral", "tibia_cart_lat")]
    {
        let mesh = surface(&deck, &format!("meshes/articular_{ours}.ply"));
        let bytes = std::fs::read(dir.join(format!("geometry/{theirs}_articular_mri.ply"))).unwrap();
        let published = formats::ply::read(&bytes).unwrap().mesh;
        println!(
            "{ours}: {} triangles {:.0} mm2, published {} {:.0} mm2",
            mesh.triangles.len(),
            mesh.area(),
            published.triangles.len(),
            published.area()
        );
        assert!((mesh.area() / published.area() - 1.0).abs() < 0.1);
        let query = meshes::query::SurfaceQuery::new(&published).unwrap();
        let normals = mesh.triangle_normals();
        let same = (0..mesh.triangles.len())
            .filter(|&t| {
                let [a, b, c] = mesh.corners(t);
                let near = query.nearest(&(nalgebra::center(&nalgebra::center(&a, &b), &c)));
                near.distance < 0.5 && normals[t].dot(&query.normal(near.triangle)) > 0.0
            })
            .count();
        assert!(same as f64 > 0.9 * mesh.triangles.len() as f64, "{ours}: {same} of {}", mesh.triangles.len());
    }
    let MeshValue::Hex(hex) = &deck.meshes["meshes/cartilage_femur.vtu"] else { panic!("hexahedra expected") };
    let inverted = (0..hex.elements.len()).filter(|&e| hex.scaled_jacobian(e) <= 0.0).count();
    println!(
        "femoral hexahedra {}, inverted {inverted}, articular quads {}",
        hex.elements.len(),
        hex.articular_quads.len()
    );
    assert!(inverted <= 1 && hex.articular_quads.len() > 4000);
}

#[needs_shared]
fn every_published_trial_is_read() {
    let Some(dir) = shared("all decks", "published/S192803/deck") else { return };
    for main in
        ["S192803_MAIN_TEST.inp", "S192803_MAIN_LAXITY_Passive_Flex.inp", "S192803_MAIN_LAXITY_Internal_90deg_20.inp"]
    {
        let deck = deck(&dir, main);
        assert_eq!(deck.spec.protocols.len(), 1, "{main}");
    }
}

/// A row of Abaqus' own trajectories as name and value.
fn trajectories(dir: &Path) -> Vec<std::collections::BTreeMap<String, String>> {
    let bytes = std::fs::read(dir.join("abaqus_trajectories.csv")).expect("beside the deck");
    csv::Reader::from_reader(&bytes[..]).deserialize().map(|row| row.expect("a row of numbers")).collect()
}

#[needs_shared]
fn chain_and_angles_are_those_of_abaqus() {
    let Some(dir) = shared("chain", "published/S192803") else { return };
    let spec = deck(&dir.join("deck"), MAIN).spec;
    let joint = Joint::new(&spec.frames, spec.side).unwrap();
    let (mut worst_gs, mut worst_node, mut frames) = (0.0_f64, 0.0_f64, 0);
    for row in trajectories(&dir) {
        let x = |k: &str| row[k].parse::<f64>().unwrap();
        let deck_q = [x("q_FE_rad"), x("q_VV_rad"), x("q_IE_rad"), x("q_ML_mm"), x("q_AP_mm"), x("q_SI_mm")];
        let q = Six::from_iterator(deck_q.iter().zip([-1.0, 1.0, -1.0, -1.0, 1.0, -1.0]).map(|(v, s)| v * s));
        let gs = joint.grood_suntay(&q);
        for (i, k) in ["GS_FE", "GS_VV", "GS_IE", "GS_ML", "GS_AP", "GS_SI"].iter().enumerate() {
            let ours = if i < 3 { gs[i].to_degrees() } else { gs[i] };
            worst_gs = worst_gs.max((ours - x(k)).abs());
        }
        let o = joint.pose(&q).femur * spec.frames.femur.origin;
        let node = meshes::Point::new(x("femur_O_x"), x("femur_O_y"), x("femur_O_z"));
        worst_node = worst_node.max((o - node).norm());
        frames += 1;
    }
    println!("{frames} frames: Grood-Suntay within {worst_gs:.2e}, femoral origin within {worst_node:.2e} mm");
    assert_eq!(frames, 228);
    assert!(worst_node < 1e-4 && worst_gs < 1e-4, "{worst_node} {worst_gs}");
}

#[needs_shared]
fn an_exported_deck_reads_back_as_the_same_model() {
    let Some(dir) = shared("round trip", "published/S192803/deck") else { return };
    let first = deck(&dir, MAIN);
    let exported = export(&first.spec, &first.meshes).unwrap();
    assert!(exported.warnings.is_empty(), "{:?}", exported.warnings);
    let files: std::collections::BTreeMap<_, _> = exported.files.into_iter().collect();
    let read =
        &mut |name: &str| files.get(name).map(|t| t.clone().into_bytes()).ok_or_else(|| "no such file".to_owned());
    let second = import(&exported.mains[0], read).unwrap();
    assert_eq!(first.meshes.keys().collect::<Vec<_>>(), second.meshes.keys().collect::<Vec<_>>());
    for (path, mesh) in &first.meshes {
        assert!(*mesh == second.meshes[path], "{path} differs");
    }
    let [a, b] = [&first.spec, &second.spec].map(|s| serde_json::to_value(s).unwrap());
    let mut worst = 0.0;
    same("", &a, &b, &mut worst);
    println!("round trip: largest relative difference {worst:.1e}");
}

/// Equal but for numbers within 1e-9.
fn same(at: &str, a: &serde_json::Value, b: &serde_json::Value, worst: &mut f64) {
    use serde_json::Value;
    match (a, b) {
        (Value::Object(x), Value::Object(y)) => {
            assert_eq!(x.keys().collect::<Vec<_>>(), y.keys().collect::<Vec<_>>(), "{at}");
            x.iter().filter(|(k, _)| *k != "warnings").for_each(|(k, v)| same(&format!("{at}/{k}"), v, &y[k], worst));
        }
        (Value::Array(x), Value::Array(y)) => {
            assert_eq!(x.len(), y.len(), "{at}");
            x.iter().zip(y).enumerate().for_each(|(i, (v, w))| same(&format!("{at}/{i}"), v, w, worst));
        }
        (Value::Number(x), Value::Number(y)) => {
            let (x, y) = (x.as_f64().unwrap_or(f64::NAN), y.as_f64().unwrap_or(f64::NAN));
            let off = (x - y).abs() / x.abs().max(y.abs()).max(1e-6);
            *worst = worst.max(off);
            assert!(off < 1e-9, "{at}: {x} {y}");
        }
        _ => assert_eq!(a, b, "{at}"),
    }
}

/// A fibre's force from the bundle's numbers by the deck's eight points.
fn tabular(b: &sim::spec::BundleSpec, fibres: usize, multiple: f64, longer: f64) -> f64 {
    let l0 = b.reference_length_mm / b.reference_strain;
    let toe = b.toe_strain * l0;
    let slope = b.stiffness_n_per_mm / fibres as f64;
    let x = (longer + b.reference_length_mm - l0) / toe;
    let exact = |x: f64| slope * toe * if x < 2.0 { x * x / 4.0 } else { x - 1.0 };
    let points = [0.0, 0.5, 1.0, 1.5, 2.0, 4.0, multiple];
    let Some(i) = points.iter().position(|p| x < *p) else { return exact(multiple) };
    if i == 0 {
        return 0.0;
    }
    let (a, c) = (points[i - 1], points[i]);
    exact(a) + (exact(c) - exact(a)) * (x - a) / (c - a)
}

#[needs_shared]
fn imported_ligaments_pull_as_in_abaqus_at_rest() {
    let Some(dir) = shared("fibre forces", "published/S192803") else { return };
    let spec = deck(&dir.join("deck"), MAIN).spec;
    let joint = Joint::new(&spec.frames, spec.side).unwrap();
    // Element labels by bundle in the deck's own order.
    let elements = [
        ("ACL_AM", "20000 20001"),
        ("ACL_PL", "20002 20003"),
        ("ALS", "30000 30001 30002"),
        ("LCL", "40000 40001 40002"),
        ("sMCL_A", "50000"),
        ("sMCL_M", "50001"),
        ("sMCL_P", "50002"),
        ("dMCL", "50006 50008 50010"),
        ("POL", "50012 50014"),
        ("PCAP_L", "60000 60001 60002"),
        ("PCAP_M", "60003 60004 60005"),
        ("PCL_AL", "70000 70001"),
        ("PCL_PM", "70002 70003"),
        ("PFL", "80003 80004 80005"),
    ];
    let rows: Vec<_> = trajectories(&dir).into_iter().filter(|r| r["model"].contains("MRI")).collect();
    let value = |row: &std::collections::BTreeMap<String, String>, k: &str| row[k].parse::<f64>().unwrap();
    let (mut worst, mut at_knee, mut frames, mut largest) = (0.0_f64, 0.0_f64, 0, 0.0_f64);
    for w in rows.windows(3) {
        let length = |row: &_, f: &sim::spec::FibreSpec| {
            let deck_q = ["q_FE_rad", "q_VV_rad", "q_IE_rad", "q_ML_mm", "q_AP_mm", "q_SI_mm"].map(|k| value(row, k));
            let q = Six::from_iterator(deck_q.iter().zip([-1.0, 1.0, -1.0, -1.0, 1.0, -1.0]).map(|(v, s)| v * s));
            (joint.pose(&q).femur * f.femur - f.tibia).norm()
        };
        // At rest: no fibre changes its length by more than 1e-3 mm in 40 ms, so that its damper pulls less than 2e-3 N.
        let still = spec.fibres.iter().all(|f| (length(&w[2], f) - length(&w[0], f)).abs() < 2e-3);
        if w[0]["trial"] != w[2]["trial"] || !still {
            continue;
        }
        frames += 1;
        for b in &spec.bundles {
            let labels = elements.iter().find(|(n, _)| *n == b.name).unwrap().1.split(' ');
            let fibres: Vec<_> = spec.fibres.iter().filter(|f| f.bundle == b.name).collect();
            for (f, label) in fibres.iter().zip(labels) {
                let longer = length(&w[1], f) - (f.femur - f.tibia).norm();
                let ours = tabular(b, fibres.len(), spec.toe_end_multiple[&b.name], longer);
                let abaqus = value(&w[1], &format!("F_{label}"));
                largest = largest.max(abaqus);
                // One fibre lies beside a knee of its table, where Abaqus' own regularised table departs from the deck's.
                let miss = if label == "70001" { &mut at_knee } else { &mut worst };
                *miss = miss.max((ours - abaqus).abs());
            }
        }
    }
    println!(
        "{frames} frames at rest: fibre forces within {worst:.3} N, {at_knee:.3} N at a knee, of up to {largest:.0} N"
    );
    assert!(frames > 0 && worst < 0.05 && at_knee < 0.3, "{frames} frames, {worst} N, {at_knee} N");
}

#[needs_shared]
fn vtk_files_hold_every_surface_and_fibre() {
    let Some(dir) = shared("vtk", "published/S192803/deck") else { return };
    let deck = deck(&dir, MAIN);
    let files = sim::vtk::export(&deck.spec, &deck.meshes, &meshes::Isometry::identity(), &[]);
    let names: Vec<&str> = files.iter().map(|(n, _)| n.as_str()).collect();
    assert_eq!(
        names,
        [
            "femur.vtp",
            "tibfib.vtp",
            "articular_femur.vtp",
            "articular_tibia_medial.vtp",
            "articular_tibia_lateral.vtp",
            "fibres.vtp",
        ]
    );
    assert!(files[5].1.contains("NumberOfLines=\"31\""));
    if let Ok(out) = std::env::var("GENU_VTK_OUT") {
        files
            .iter()
            .for_each(|(name, text)| std::fs::write(Path::new(&out).join(name), text).expect("a writable folder"));
    }
}
