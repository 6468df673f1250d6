//! Decks made here: a right knee with both laws goes out and comes back; mutated decks are refused, never a panic.

use decks::{ImportedDeck, export, import, lower_cartilage, replace_fibres};
use meshes::frame::{AnatomicalFrame, Side};
use meshes::shapes::icosphere;
use meshes::{Isometry, Point, Vector};
use proptest::prelude::*;
use sim::coordinate::Six;
use sim::joint::Joint;
use sim::mesh::MeshValue;
use sim::spec::*;
use std::collections::BTreeMap;

pub(crate) fn knee() -> (ModelSpec, BTreeMap<String, MeshValue>) {
    let frame = |z: f64| AnatomicalFrame {
        origin: Point::new(0.5, 0.25, z),
        medial: Vector::new(1.0, 0.0, 0.0),
        anterior: Vector::new(0.0, -1.0, 0.0),
        superior: Vector::new(0.0, 0.0, 1.0),
    };
    let mut frames = FramesSpec {
        femur: frame(20.0),
        tibia: frame(-20.0),
        gs_ct_pose: PoseSpec::default(),
        chain: None,
        grid: None,
    };
    // A right knee in LPS: medial is +x, anterior -y, superior +z, a left-handed set.
    frames.tibia.anterior = Vector::new(0.0, -(0.1_f64.cos()), 0.1_f64.sin());
    frames.tibia.superior = Vector::new(0.0, 0.1_f64.sin(), 0.1_f64.cos());
    let bundle = |name: &str, law| BundleSpec {
        name: name.into(),
        reference_strain: 1.037,
        stiffness_n_per_mm: 91.7,
        reference_length_mm: 39.3,
        toe_strain: 0.03,
        law,
        damping_n_s_per_mm: sim::spec::fibre_damping(),
    };
    let fibre = |name: &str, x: f64| FibreSpec {
        bundle: name.into(),
        femur: Point::new(x, 1.0 / 3.0, 19.0),
        tibia: Point::new(x, 0.7, -21.1),
    };
    let ball = |z: f64, r: f64| MeshValue::Surface(icosphere(r, 1).moved(&Isometry::translation(0.0, 0.0, z)));
    let patch = |z: f64| {
        let ball = icosphere(10.0, 1);
        let (part, _) = ball.submesh(|t| ball.triangle_normals()[t].z * z < -0.5 * z.abs());
        MeshValue::Surface(part.moved(&Isometry::translation(0.0, 0.0, z)))
    };
    let body = |name: &str, bone: &str| BodySpec {
        name: name.into(),
        bone: bone.into(),
        cartilage: vec![],
        mass_tonne: 1e-5,
        inertia_tonne_mm2: 0.1,
    };
    let meshes = BTreeMap::from([
        ("meshes/femur.ply".to_owned(), ball(20.0, 15.0)),
        ("meshes/tibfib.ply".to_owned(), ball(-20.0, 15.0)),
        ("meshes/articular_femur.ply".to_owned(), patch(10.0)),
        ("meshes/articular_tibia_medial.ply".to_owned(), patch(-10.0)),
    ]);
    let pair =
        PairSpec { femur: "meshes/articular_femur.ply".into(), tibia: "meshes/articular_tibia_medial.ply".into() };
    let spec = ModelSpec {
        schema: "model/1".into(),
        id: "made".into(),
        side: Side::Right,
        units: Units { length: "mm".into(), force: "N".into(), pressure: "MPa".into(), angle: "deg".into() },
        frames,
        bodies: vec![body("femur", "meshes/femur.ply"), body("tibia", "meshes/tibfib.ply")],
        contact: ContactSpec {
            overclosure_mm: vec![0.0, 0.05, 0.2],
            pressure_mpa: vec![0.0, 0.3, 1.3],
            friction: 0.03,
            damping: 0.001,
            pairs: vec![pair],
            layer: None,
        },
        bundles: vec![bundle("LCL", Law::Smooth), bundle("sMCL_A", Law::Tabular)],
        fibres: vec![fibre("LCL", -30.0), fibre("LCL", -31.0), fibre("sMCL_A", 30.0)],
        wrap: None,
        menisci: vec![],
        toe_end_multiple: BTreeMap::new(),
        protocols: vec![],
        components: vec![],
        calibrated: None,
        uncertainty: None,
        patella: None,
        warnings: vec![],
    };
    (spec, meshes)
}

pub(crate) fn read_back(files: &BTreeMap<String, String>, main: &str) -> Result<ImportedDeck, decks::DeckError> {
    import(main, &mut |name: &str| {
        files.get(name).map(|t| t.clone().into_bytes()).ok_or_else(|| "no such file".to_owned())
    })
}

#[test]
fn a_right_knee_with_both_laws_goes_out_and_comes_back() {
    let (spec, meshes) = knee();
    let out = export(&spec, &meshes).unwrap();
    let back = read_back(&out.files.into_iter().collect(), &out.mains[0]).unwrap();
    assert_eq!((back.spec.side, back.spec.bundles, &back.spec.fibres), (Side::Right, spec.bundles, &spec.fibres));
    assert_eq!((back.spec.contact, back.spec.bodies), (spec.contact, spec.bodies));
    assert!(back.meshes == meshes, "meshes differ");
    assert_eq!(back.spec.protocols[0].steps.len(), 2);
    let q = Six::new(0.5, 0.1, -0.2, 1.0, 2.0, 3.0);
    let [ours, theirs] = [&spec.frames, &back.spec.frames].map(|f| Joint::new(f, Side::Right).unwrap());
    assert!((ours.grood_suntay(&q) - theirs.grood_suntay(&q)).amax() < 1e-9);
    assert!((ours.pose(&q).femur * Point::origin() - theirs.pose(&q).femur * Point::origin()).norm() < 1e-9);
}

/// A law that the reader does not know would come back as another: here it is found.
#[test]
fn each_law_goes_out_and_comes_back_wherever_its_table_ends() {
    for law in Law::ALL {
        for end in [None, Some(4.5), Some(10.0), Some(50.0)] {
            let (mut spec, meshes) = knee();
            spec.bundles.iter_mut().for_each(|b| b.law = law);
            spec.toe_end_multiple = spec.bundles.iter().filter_map(|b| Some((b.name.clone(), end?))).collect();
            let out = export(&spec, &meshes).unwrap();
            let back = read_back(&out.files.into_iter().collect(), &out.mains[0]).unwrap();
            assert_eq!(back.spec.bundles, spec.bundles, "{law:?} {end:?}");
            let [ours, theirs] = [&spec, &back.spec].map(|s| sim::ligament::compile(s).unwrap().0);
            for (a, b) in ours.iter().zip(&theirs) {
                for toes in [-1.0, 0.3, 1.2, 2.5, 4.2, 4.8, 9.0, 60.0] {
                    let [a, b] = [a, b].map(|bundle| bundle.response(toes * bundle.toe_mm()).force);
                    assert!((a - b).abs() < 1e-6 * (1.0 + a), "{law:?} {end:?} at {toes} toes: {a} N, {b} N");
                }
            }
        }
    }
}

/// Cartilage that a calibration made thicker or thinner than its surfaces begins to press before they touch, or after.
#[test]
fn a_law_that_begins_before_surfaces_touch_goes_out_and_comes_back() {
    let back = |begin: f64| {
        let (mut spec, meshes) = knee();
        spec.contact.overclosure_mm.iter_mut().for_each(|mm| *mm += begin);
        let out = export(&spec, &meshes).unwrap();
        let back = read_back(&out.files.into_iter().collect(), &out.mains[0]).unwrap();
        assert_eq!(back.spec.contact, spec.contact, "{begin}");
        back.warnings
    };
    let plain = back(0.0);
    // up to three standard deviations of the thickness nothing is odd; pressure where they touch is 0.13 MPa and more
    for begin in [-0.0246, -0.1, -0.19, 0.02] {
        assert_eq!(back(begin), plain, "{begin}");
    }
}

/// More than that is no cartilage's: another sign or unit, most likely.
#[test]
fn a_law_that_begins_long_before_surfaces_touch_is_told() {
    for (begin, told) in [(-0.1, false), (-0.6, false), (-0.61, true), (-5.0, true)] {
        let (mut spec, meshes) = knee();
        spec.contact.overclosure_mm = vec![begin, 0.05, 0.2];
        let out = export(&spec, &meshes).unwrap();
        let back = read_back(&out.files.into_iter().collect(), &out.mains[0]).unwrap();
        let words = notices::texts(&back.warnings).join("\n");
        assert_eq!(
            words.contains(&format!("presses from {} mm before surfaces touch", -begin)),
            told,
            "{begin}: {words}"
        );
        assert_eq!(back.spec.contact, spec.contact, "{begin}");
    }
}

/// A meniscus of three sections, on the first pair.
fn meniscus(spec: &ModelSpec) -> MeniscusSpec {
    let section = |x: f64| SectionSpec {
        lower: [0.0, 4.0, 8.0].map(|y| Point::new(x, y, 0.0)).into(),
        upper: [0.0, 4.0, 8.0].map(|y| Point::new(x, y, 1.0 + 0.5 * y)).into(),
    };
    let horn = |x: f64| HornSpec { tibia: Point::new(x, 4.0, 0.0), stiffness_n_per_mm: 2000.0 };
    MeniscusSpec {
        name: "meniscus_medial".into(),
        femur: spec.contact.pairs[0].femur.clone(),
        tibia: spec.contact.pairs[0].tibia.clone(),
        source: "test".into(),
        sections: [0.0, 5.0, 10.0].map(section).into(),
        wedges: 2,
        material: MeniscusMaterial {
            circumferential_modulus_mpa: 150.0,
            transverse_modulus_mpa: 20.0,
            shear_modulus_mpa: 2.0,
            cartilage_mpa_per_mm: 13.0,
        },
        anterior_horn: horn(-5.0),
        posterior_horn: horn(15.0),
        periphery_n_per_mm2: 0.5,
    }
}

#[test]
fn menisci_go_out_as_hexahedra_and_the_rest_comes_back_as_it_was() {
    let (mut spec, meshes) = knee();
    spec.menisci = vec![meniscus(&spec)];
    let out = export(&spec, &meshes).unwrap();
    assert!(out.warnings.iter().any(|w| w.contains("menisci")));
    let files: BTreeMap<String, String> = out.files.into_iter().collect();
    let text = &files["menisci.inp"];
    let rows = |keyword: &str| {
        let block = text.split('*').filter(|b| b.starts_with(keyword)).collect::<Vec<_>>();
        let cells = |l: &str| -> Vec<String> { l.split(", ").map(str::to_owned).collect() };
        block.iter().flat_map(|b| b.lines().skip(1)).map(cells).collect::<Vec<_>>()
    };
    let [nodes, hexes, springs] = ["NODE", "ELEMENT, TYPE=C3D8R", "ELEMENT, TYPE=SPRINGA"].map(rows);
    // 3 sections of 6 points and 2 roots; 2 x 2 hexahedra; 6 springs a horn
    assert_eq!((nodes.len(), hexes.len(), springs.len()), (20, 4, 12));
    assert!(hexes.iter().chain(&springs).flat_map(|e| &e[1..]).all(|n| nodes.iter().any(|row| row[0] == *n)));
    assert!(text.contains("150.0, 20.0, 20.0, 0.3, 0.3, 0.2") && files["menisci_contact.inp"].contains("SURF-ART"));
    let back = read_back(&files, &out.mains[0]).unwrap();
    spec.menisci.clear();
    assert_eq!((back.spec.contact, back.spec.bodies, back.spec.menisci), (spec.contact, spec.bodies, vec![]));
    assert!(back.meshes == meshes, "meshes differ");
}

#[test]
fn hexahedra_of_a_meniscus_are_sound_left_and_right() {
    let (spec, _) = knee();
    let here = meniscus(&spec);
    let mut there = here.clone();
    there.sections.iter_mut().flat_map(|s| s.lower.iter_mut().chain(&mut s.upper)).for_each(|p| p.x = -p.x);
    for m in [&here, &there] {
        let mesh = sim::menisci::hexahedra(m);
        assert!((0..mesh.elements.len()).all(|e| mesh.scaled_jacobian(e) > 0.5));
        let along = mesh.nodes[mesh.elements[0][1] as usize] - mesh.nodes[mesh.elements[0][0] as usize];
        assert!(along.x.abs() > 4.9 && along.y == 0.0, "the first edge runs along the ring");
    }
}

#[test]
fn absurd_sets_and_circles_are_refused() {
    let circle = BTreeMap::from([("a".to_owned(), "*INCLUDE, INPUT=a\n".to_owned())]);
    assert!(read_back(&circle, "a").unwrap_err().message.contains("leads back"));
    let error = |text: &str| read_back(&BTreeMap::from([("a".to_owned(), text.to_owned())]), "a").unwrap_err();
    let absurd = error("*NSET, NSET=x, GENERATE\n1, 18446744073709551615, 1\n");
    assert!(absurd.message.contains("more than"), "{absurd}");
    // a set that names itself twice does not grow: an element is in it or not
    let double = "*ELSET, ELSET=x\nx, x\n".repeat(60);
    let read = error(&format!("*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=MASS, ELSET=x\n1, 1\n{double}"));
    assert!(read.message.contains("held fixed"), "{read}");
    // Includes that fan out are stopped by the size of the whole.
    let mut files = BTreeMap::new();
    for k in 0..15 {
        files.insert(format!("f{k}"), format!("*INCLUDE, INPUT=f{}\n", k + 1).repeat(100));
    }
    files.insert("f15".into(), "** end\n".into());
    assert!(read_back(&files, "f0").unwrap_err().message.contains("MB together"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn mutated_decks_never_panic(file in 0..5_usize, edits in prop::collection::vec((any::<prop::sample::Index>(), 0..8_u8, any::<u8>()), 1..6)) {
        let (spec, meshes) = knee();
        let out = export(&spec, &meshes).unwrap();
        let mut files: BTreeMap<String, String> = out.files.iter().cloned().collect();
        let name = out.files[file].0.clone();
        let mut lines: Vec<String> = files[&name].lines().map(str::to_owned).collect();
        for (place, kind, byte) in edits {
            let i = place.index(lines.len());
            match kind {
                0 => { lines.remove(i); }
                1 => lines.insert(i, lines[i].clone()),
                2 => lines[i] = lines[i].replace(',', ""),
                3 => lines[i] = lines[i].replace(char::is_numeric, &(byte % 10).to_string()),
                4 => lines[i] = lines[i].chars().rev().collect(),
                5 => lines[i] = format!("{}{}", char::from(byte), lines[i]),
                6 => lines.truncate(i + 1),
                _ => lines[i] = "*INCLUDE, INPUT=geometry.inp".into(),
            }
            if lines.is_empty() { lines.push(String::new()); }
        }
        files.insert(name, lines.join("\n"));
        match read_back(&files, &out.mains[0]) {
            Ok(deck) => prop_assert!(serde_json::to_string(&deck.spec).is_ok()),
            Err(error) => prop_assert!(!error.message.is_empty()),
        }
    }
}

/// The made deck as it is read back.
fn made() -> ImportedDeck {
    let (spec, meshes) = knee();
    let deck = export(&spec, &meshes).expect("a deck");
    let main = deck.mains[0].clone();
    read_back(&deck.files.into_iter().collect(), &main).expect("it is read back")
}

#[test]
fn fibres_of_a_variant_take_the_place_of_the_decks() {
    let deck = made();
    let mut rows = vec!["geometry,bundle,femur_x,femur_y,femur_z,tibia_x,tibia_y,tibia_z,L_ref,A_EREF,A_K2".to_owned()];
    for b in &deck.spec.bundles {
        rows.push(format!("one,{},1,2,3,4,5,6,33.5,1.1,77", b.name));
        rows.push(format!("two,{},0,0,0,0,0,0,1,1,1", b.name));
    }
    let table = rows.join("\n");
    let mut other = deck.clone();
    replace_fibres(&mut other, &table, "one", Some("A")).unwrap();
    assert_eq!(other.spec.fibres.len(), deck.spec.bundles.len());
    assert!(other.spec.fibres.iter().all(|f| f.femur == Point::new(1.0, 2.0, 3.0)));
    let known = |b: &BundleSpec| (b.reference_length_mm, b.reference_strain, b.stiffness_n_per_mm) == (33.5, 1.1, 77.0);
    assert!(other.spec.bundles.iter().all(known) && other.warnings.last().unwrap().contains("variant one"));
    replace_fibres(&mut other, &table, "two", None).unwrap();
    assert!(other.spec.bundles.iter().all(|b| (b.reference_length_mm, b.reference_strain) == (1.0, 1.1)));
    let refuse = |table: &str, variant: &str, p: Option<&str>| {
        replace_fibres(&mut deck.clone(), table, variant, p).unwrap_err().to_string()
    };
    assert!(refuse(&table, "three", None).contains("there are: one, two"));
    assert!(refuse(&table, "one", Some("B")).contains("no column B_EREF"));
    assert!(refuse(&table.replace(",77", ",x"), "one", Some("A")).contains("A_K2 is \"x\""));
    assert!(refuse(&rows[..2].join("\n"), "one", None).contains("has no fibre of"));
    assert!(refuse(&table.replace(",LCL,", ",none,"), "one", None).contains("is not in the deck"));
}

#[test]
fn a_tibial_cartilage_is_lowered_along_the_tibia() {
    let deck = made();
    let mut lowered = deck.clone();
    lower_cartilage(&mut lowered, "tibia_medial", 2.0).unwrap();
    let top = |d: &ImportedDeck| match &d.meshes["meshes/articular_tibia_medial.ply"] {
        MeshValue::Surface(m) => m.vertices[0],
        _ => panic!("a surface"),
    };
    let moved = top(&lowered) - top(&deck);
    assert!((moved + 2.0 * deck.spec.frames.tibia.superior).norm() < 1e-9, "{moved:?}");
    assert!(lower_cartilage(&mut lowered, "tibia_nowhere", 1.0).unwrap_err().to_string().contains("tibia_medial"));
    assert!(lower_cartilage(&mut lowered, "femur", 1.0).is_err());
    assert!(lower_cartilage(&mut lowered, "tibia_medial", f64::NAN).is_err());
}
