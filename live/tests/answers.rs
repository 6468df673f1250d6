//! A knee that was packed and opened answers as the solver does, bit for bit.
#![allow(clippy::unwrap_used, reason = "tests")]

#[path = "../../sim/tests/verification/rig.rs"]
#[allow(dead_code, reason = "this test uses its part")]
mod rig;

use live::pack::unpack;
use live::{Asked, Knee, Packed, answer, pack};
use meshes::{Isometry, Point, Vector};
use rig::Rig;
use serde_json::{Value, json};
use sim::coordinate::Load;
use sim::graft::{COMPRESSION_N, Drawn, Graft};
use sim::laxity::{LaxityTrial, Test};
use sim::mesh::MeshValue;
use sim::spec::{BundleSpec, FibreSpec, Law, fibre_damping};
use sim::trials::{Answer, TrialOptions, solve_trial};

/// A knee of springs on a plate, in axes of a page that lie askew.
fn packed() -> Packed {
    let rig = Rig::knee();
    let tibia = &rig.spec.contact.pairs[0].tibia;
    let MeshValue::Surface(mesh) = &rig.meshes[tibia] else { panic!("a surface") };
    Packed {
        faces: vec![("contact tibia".into(), mesh.vertices.clone())],
        spec: rig.spec,
        samples: None,
        meshes: rig.meshes,
        axes: Isometry::new(Vector::new(3.0, -2.0, 7.0), Vector::new(0.2, 0.5, -0.1)),
    }
}

fn opened() -> Knee {
    Knee::open(&pack(&packed()).unwrap()).unwrap()
}

fn loads() -> Vec<(f64, Load)> {
    vec![
        (0.0, Load::compression(20.0)),
        (10.0, Load::new(0.0, 0.0, 0.0, 20.0, 20.0)),
        (20.0, Load::new(0.2, -0.3, 2.0, -10.0, 40.0)),
    ]
}

/// What the solver says, without pack and without page.
fn by_solver(flexion_deg: f64, load: Load, cut: &[String]) -> Answer {
    let knee = packed();
    let model = sim::compile(&knee.spec, &knee.meshes).unwrap().without(cut).unwrap();
    let trial = LaxityTrial::asked("direct".into(), Test::Neutral, flexion_deg, load);
    solve_trial(&model, &trial, &TrialOptions::default()).unwrap()
}

#[test]
fn the_answer_is_the_solvers_bit_for_bit_whole_and_cut() {
    let knee = opened();
    let first = knee.about().bundles[0].name.clone();
    for cut in [vec![], vec![first]] {
        for (flexion_deg, load) in loads() {
            let told = knee.told(&Asked { flexion_deg, load, cut: cut.clone(), ..Asked::default() }).unwrap();
            let direct = by_solver(flexion_deg, load, &cut);
            assert_eq!(
                (told.pose, &told.forces_n, &told.flags),
                (direct.pose, &direct.forces_n, &sim::flags::sentences(&direct.flags))
            );
            assert_eq!(told.outputs[..direct.outputs.len()], direct.outputs[..]);
            let fibres: Vec<f64> = direct.evaluation.fibres.iter().map(|f| f.response.force).collect();
            assert_eq!(told.fibres_n, fibres);
        }
    }
}

#[test]
fn a_pack_opens_to_the_same_bits_and_a_broken_one_is_refused() {
    let knee = packed();
    let bytes = pack(&knee).unwrap();
    let back = unpack(&bytes).unwrap();
    assert_eq!((&back.spec, &back.faces, back.axes), (&knee.spec, &knee.faces, knee.axes));
    for (name, mesh) in &back.meshes {
        assert_eq!(mesh, &knee.meshes[name]);
    }
    assert!(knee.spec.contact.meshes().all(|name| back.meshes.contains_key(name)));
    for end in (0..bytes.len()).step_by(bytes.len() / 50) {
        assert!(unpack(&bytes[..end]).is_err(), "cut at {end}");
    }
    assert!(unpack(&[&bytes[..], &[0]].concat()).unwrap_err().contains("1 bytes too many"));
    let lost = Packed { meshes: Default::default(), ..packed() };
    assert!(pack(&lost).unwrap_err().contains("no surface of its own"));
}

#[test]
fn a_cut_bundle_bears_nothing_and_what_is_undone_is_as_before() {
    let knee = opened();
    let (flexion_deg, load) = loads()[1];
    let whole = knee.told(&Asked { flexion_deg, load, ..Asked::default() }).unwrap();
    let taut = (0..whole.forces_n.len()).max_by(|a, b| whole.forces_n[*a].total_cmp(&whole.forces_n[*b])).unwrap();
    assert!(whole.forces_n[taut] > 1.0, "{:?}", whole.forces_n);
    let name = knee.about().bundles[taut].name.clone();
    let cut = knee.told(&Asked { flexion_deg, load, cut: vec![name.clone()], ..Asked::default() }).unwrap();
    assert_eq!((cut.forces_n[taut], cut.strains[taut]), (0.0, None));
    assert_ne!(cut.pose, whole.pose);
    // a stiffer bundle lets the knee move less far from where it has no load
    let rest = knee.told(&Asked { flexion_deg, load: Load::compression(20.0), ..Asked::default() }).unwrap();
    let all = |factor: f64| knee.about().bundles.iter().map(|b| (b.name.clone(), factor)).collect();
    let stiff = knee.told(&Asked { flexion_deg, load, stiffness: all(4.0), ..Asked::default() }).unwrap();
    let far = |told: &live::knee::Told| (told.pose.ap_mm - rest.pose.ap_mm).abs();
    assert!(far(&stiff) < far(&whole), "{} {}", far(&stiff), far(&whole));
    // a bundle that is longer than before is less strained in CT, by as much as was asked
    let slack = knee.told(&Asked { flexion_deg, load, strain: [(name, -0.02)].into(), ..Asked::default() }).unwrap();
    assert!(slack.strains[taut].unwrap() < whole.strains[taut].unwrap());
    let again = knee.told(&Asked { flexion_deg, load, ..Asked::default() }).unwrap();
    assert_eq!((again.pose, again.forces_n), (whole.pose, whole.forces_n));
}

/// A graft between the ends of the rig's first fibre, a little aside, drawn to a tension.
fn graft() -> Graft {
    let f = &packed().spec.fibres[0];
    let aside = Vector::new(1.0, -2.0, 0.5);
    Graft {
        name: "g".into(),
        ends: vec![[f.femur + aside, f.tibia - aside]],
        stiffness_n_per_mm: 90.0,
        toe_strain: 0.03,
        like: None,
        drawn: Drawn::Tension { tension_n: 25.0, at_flexion_deg: 10.0, compression_n: COMPRESSION_N },
    }
}

#[test]
fn a_graft_in_a_packed_knee_is_the_same_bundle_in_an_edited_model() {
    let knee = opened();
    let (flexion_deg, load) = loads()[1];
    let cut = vec![knee.about().bundles[0].name.clone()];
    let asked =
        |flexion_deg, load| Asked { flexion_deg, load, cut: cut.clone(), grafts: vec![graft()], ..Asked::default() };
    let told = knee.told(&asked(flexion_deg, load)).unwrap();
    // the same bundle by hand, as an edited model.json has it
    let mut edited = packed();
    let [end] = graft().ends[..] else { panic!("one fibre") };
    let length = (end[0] - end[1]).norm();
    edited.spec.bundles.push(BundleSpec {
        name: "graft0".into(),
        reference_strain: length / told.grafts[0].slack_length_mm,
        stiffness_n_per_mm: 90.0,
        reference_length_mm: length,
        toe_strain: 0.03,
        law: Law::Smooth,
        damping_n_s_per_mm: fibre_damping(),
    });
    edited.spec.fibres.push(FibreSpec { bundle: "graft0".into(), femur: end[0], tibia: end[1] });
    let model = sim::compile(&edited.spec, &edited.meshes).unwrap().without(&cut).unwrap();
    for (flexion_deg, load) in loads() {
        let told = knee.told(&asked(flexion_deg, load)).unwrap();
        let trial = LaxityTrial::asked("edited".into(), Test::Neutral, flexion_deg, load);
        let direct = solve_trial(&model, &trial, &TrialOptions::default()).unwrap();
        assert_eq!(told.forces_n.len(), direct.forces_n.len());
        for (a, b) in told.forces_n.iter().zip(&direct.forces_n) {
            assert!((a - b).abs() < 1e-6, "{:?} {:?}", told.forces_n, direct.forces_n);
        }
        for (a, b) in told.pose.six().iter().zip(direct.pose.six().iter()) {
            assert!((a - b).abs() < 1e-6, "{:?} {:?}", told.pose, direct.pose);
        }
    }
    // it bears its tension where it was fixed; taken out, the knee is as before
    let fixed = knee.told(&asked(10.0, Load::compression(COMPRESSION_N))).unwrap();
    assert!((fixed.forces_n.last().unwrap() - 25.0).abs() < 0.3, "{:?}", fixed.forces_n);
    let without = knee.told(&Asked { flexion_deg, load, cut: cut.clone(), ..Asked::default() }).unwrap();
    assert_eq!(without.forces_n.len() + 1, told.forces_n.len());
    assert!((without.pose.ap_mm - told.pose.ap_mm).abs() > 1e-3, "the graft does nothing");
    assert!(without.grafts.is_empty());
}

#[test]
fn the_page_moves_the_femur_in_its_own_axes() {
    let (knee, axes) = (opened(), packed().axes);
    let (flexion_deg, load) = loads()[2];
    let told = knee.told(&Asked { flexion_deg, load, ..Asked::default() }).unwrap();
    let direct = by_solver(flexion_deg, load, &[]);
    let femoral = Point::new(4.0, 9.0, -3.0);
    let (here, there) = (axes * femoral, axes * (direct.evaluation.pose.femur * femoral));
    for r in 0..3 {
        let m = &told.femur[4 * r..4 * r + 4];
        let moved = m[0] * here.x + m[1] * here.y + m[2] * here.z + m[3];
        assert!((moved - there[r]).abs() < 1e-9, "{moved} {}", there[r]);
    }
    let pressed: f64 = told.pressure["contact tibia"].iter().map(|p| p.1).fold(0.0, f64::max);
    assert!(pressed > 0.0);
}

#[test]
fn requests_and_replies_are_json_that_keeps_every_bit() {
    let knee = opened();
    let asked = Asked { flexion_deg: 10.0, load: loads()[1].1, ..Asked::default() };
    let request = json!({"trial": asked}).to_string();
    let reply: Value = serde_json::from_slice(&answer(&knee, request.as_bytes())).unwrap();
    let told = knee.told(&asked).unwrap();
    assert_eq!(reply["pose"]["ap_mm"].as_f64(), Some(told.pose.ap_mm));
    let forces: Vec<f64> = reply["forces_n"].as_array().unwrap().iter().map(|f| f.as_f64().unwrap()).collect();
    assert_eq!(forces, told.forces_n);
    let about: Value = serde_json::from_slice(&answer(&knee, br#"{"about":{}}"#)).unwrap();
    assert_eq!(about["bundles"].as_array().unwrap().len(), told.forces_n.len());
}

#[test]
fn what_cannot_be_answered_is_said_in_one_sentence() {
    let knee = opened();
    let fault = |request: &str| {
        let reply: Value = serde_json::from_slice(&answer(&knee, request.as_bytes())).unwrap();
        reply["fault"].as_str().unwrap_or_else(|| panic!("{request} is answered: {reply}")).to_owned()
    };
    let asks = [
        ("", "the request"),
        (r#"{"trial":{"flexion_deg":30}}"#, "load"),
        (r#"{"trial":{"flexion_deg":900,"load":[0,0,0,0,20]}}"#, "flexion 900 deg is impossible"),
        (r#"{"trial":{"flexion_deg":30,"load":[0,0,0,0,20],"cut":["ABC"]}}"#, "no bundle is named"),
        (r#"{"trial":{"flexion_deg":30,"load":[0,0,0,0,20],"strain":{"ABC":1}}}"#, "no bundle is named"),
        (r#"{"trial":{"flexion_deg":30,"load":[0,0,0,0,20],"stiffness":{"spring0":-1}}}"#, "out of range"),
        (
            r#"{"trial":{"flexion_deg":30,"load":[0,0,0,0,20],"grafts":[{"name":"g","ends":[],"stiffness_n_per_mm":200,"drawn":{"slack_length_mm":30}}]}}"#,
            "has no fibres",
        ),
        (r#"{"bands":{"trial":{"flexion_deg":30,"load":[0,0,0,0,20]},"most":8}}"#, "no samples"),
    ];
    for (request, says) in asks {
        assert!(fault(request).contains(says), "{request}: {}", fault(request));
    }
    assert!(Knee::open(b"nonsense").is_err_and(|e| e.contains("packed knee")));
}
