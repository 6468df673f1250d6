//! The difference that is told is the true one, with its place.
use super::*;
use meshes::frame::{AnatomicalFrame, Side};
use meshes::{Point, Vector};
use sim::coordinate::{AP, Free, Load};
use sim::laxity::{LaxityTrial, Test};
use sim::spec::{BodySpec, BundleSpec, ContactSpec, FibreSpec, FramesSpec, Law, ModelSpec, PoseSpec, Units};
use std::collections::BTreeMap;

fn row(step: &str, ap_mm: f64, ie_deg: f64, force: f64) -> TrialResult {
    TrialResult {
        trial: LaxityTrial::asked(step.into(), Test::Anterior, 30.0, Load::compression(20.0)),
        pose: PoseSpec { fe_deg: 30.0, ie_deg, ap_mm, ..PoseSpec::default() },
        forces_n: vec![force, 1.0],
        outputs: vec![],
        flags: vec![],
        bands: vec![],
    }
}

#[test]
fn the_largest_difference_of_each_unit_is_told_with_its_place_and_sign() {
    let bundles = ["ACL_AM", "LCL"].map(String::from);
    let place = Place { protocol: "ap_laxity", cut: "ACL" };
    let both =
        [[row("a", 1.0, 2.0, 50.0), row("a", 1.1, 2.0, 50.0)], [row("b", 1.0, 2.5, 45.0), row("b", 1.05, 2.0, 50.0)]];
    let may = Agreement::default();
    let all: Vec<Apart> = both.iter().flat_map(|[e, q]| place.differences(e, q, &bundles, &may)).collect();
    let told = ["mm", "deg", "N"].map(|unit| most(&all, unit).unwrap());
    let read = |a: &Apart| (a.step.clone(), a.column.clone(), a.cut.clone());
    assert_eq!(read(&told[0]), ("a".into(), AP.column(), "ACL".into()));
    assert_eq!(read(&told[1]), ("b".into(), "ie_deg".into(), "ACL".into()));
    assert_eq!(read(&told[2]), ("b".into(), force_column("ACL_AM"), "ACL".into()));
    let difference = told.each_ref().map(Apart::difference);
    assert!((difference[0] + 0.1).abs() < 1e-12 && (difference[1] - 0.5).abs() < 1e-12);
    assert!((difference[2] + 5.0).abs() < 1e-12);
    assert!(told[0].share() < 1.0 && told[1].share() > 1.0 && told[2].share() > 1.0);
    // no larger difference stands anywhere in the rows
    for ([e, q], unit) in both.iter().zip(["mm", "deg"]) {
        let here: Free<f64> = e.predicted();
        let largest = FREE.into_iter().filter(|c| c.unit() == unit).map(|c| (here[c] - q.predicted()[c]).abs());
        let told = told.iter().find(|a| a.unit == unit).unwrap();
        assert!(largest.fold(0.0, f64::max) <= told.difference().abs() + 1e-12);
    }
}

/// A femur hung in springs, without cartilage: both solvers have one answer, and no friction.
fn hung() -> (ModelSpec, Model) {
    let frame = AnatomicalFrame {
        origin: Point::origin(),
        medial: -Vector::x(),
        anterior: -Vector::y(),
        superior: Vector::z(),
    };
    let body = |name: &str| BodySpec {
        name: name.into(),
        bone: format!("{name}.ply"),
        cartilage: vec![],
        mass_tonne: 2e-4,
        inertia_tonne_mm2: 0.5,
    };
    let mut spec = ModelSpec {
        schema: "model/1".into(),
        id: "hung".into(),
        side: Side::Left,
        units: Units { length: "mm".into(), force: "N".into(), pressure: "MPa".into(), angle: "deg".into() },
        frames: FramesSpec { femur: frame, tibia: frame, gs_ct_pose: PoseSpec::default(), chain: None },
        bodies: vec![body("femur"), body("tibia")],
        contact: ContactSpec {
            overclosure_mm: vec![0.0, 1.0],
            pressure_mpa: vec![0.0, 5.0],
            friction: 0.0,
            damping: 0.0,
            pairs: vec![],
            layer: None,
        },
        bundles: vec![],
        fibres: vec![],
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
    let (a, far) = (20.0, 40.0);
    for (x, y) in [(a, a), (a, -a), (-a, a), (-a, -a)] {
        for z in [-far, far] {
            spring(&mut spec, [Point::new(x, y, 0.0), Point::new(x, y, z)]);
        }
    }
    for (s, by) in [(a, far), (a, -far), (-a, far), (-a, -far)] {
        spring(&mut spec, [Point::new(s, 0.0, 0.0), Point::new(s, by, 0.0)]);
        spring(&mut spec, [Point::new(0.0, s, 0.0), Point::new(by, s, 0.0)]);
    }
    let model = sim::compile(&spec, &BTreeMap::new()).unwrap();
    (spec, model)
}

/// A spring of 30 N/mm, stretched by 3 mm; the first two are the ACL.
fn spring(spec: &mut ModelSpec, [femur, tibia]: [Point; 2]) {
    let length = (femur - tibia).norm();
    let name =
        ["ACL_AM", "ACL_PL"].get(spec.bundles.len()).map_or(format!("S{}", spec.bundles.len()), |n| n.to_string());
    spec.bundles.push(BundleSpec {
        name: name.clone(),
        reference_strain: length / (length - 3.0),
        stiffness_n_per_mm: 30.0,
        reference_length_mm: length,
        toe_strain: 1e-6,
        law: Law::Smooth,
        damping_n_s_per_mm: 0.05,
    });
    spec.fibres.push(FibreSpec { bundle: name, femur, tibia });
}

fn few_rows() -> ProtocolOptions {
    ProtocolOptions {
        ap_flexions_deg: vec![5.0],
        ap_load_n: 50.0,
        ap_rows: 2,
        to_flexion_deg: 5.0,
        pivot_flexion_deg: 5.0,
        pivot_valgus_nm: 1.0,
        pivot_internal_nm: 0.5,
        ..ProtocolOptions::default()
    }
}

#[test]
fn both_solvers_agree_on_a_hung_femur_and_the_difference_told_is_the_true_one() {
    let (spec, model) = hung();
    let options = few_rows();
    let (quasi, _) = Source::simulated("hung", &spec, &model, &options).unwrap();
    let (mut source, told) = explicit(&quasi, &model, &options).unwrap();
    assert!(told.is_empty(), "{told:?}");
    let told = hold_against(&mut source, &quasi, &model, &options).unwrap();
    assert!(told.is_empty(), "{told:?}");
    let check = source.check.clone().unwrap();
    assert_eq!(check.largest.len(), 12, "three units in each of four protocols");
    for ((protocol, rows), beside) in source.protocols().into_iter().zip(&check.quasistatic) {
        assert!(!rows.is_empty() && rows.len() == beside.len(), "{protocol}");
        let far = |r: &TrialResult, q: &TrialResult| {
            FREE.into_iter().map(move |c| (c, r.predicted()[c] - q.predicted()[c])).collect::<Vec<_>>()
        };
        let all: Vec<_> = rows.iter().zip(beside).flat_map(|(r, q)| far(r, q)).collect();
        for unit in ["mm", "deg"] {
            let most = all.iter().filter(|(c, _)| c.unit() == unit).map(|(_, d)| d.abs()).fold(0.0, f64::max);
            let told = check.largest.iter().find(|a| a.protocol == protocol && a.unit == unit).unwrap();
            assert!((told.difference().abs() - most).abs() < 1e-12, "{protocol} {unit}");
            assert!(most < 5e-3, "{protocol}: {most} {unit} apart");
        }
        let moved = rows.iter().any(|r| r.predicted().iter().any(|x| x.abs() > 0.1));
        // flexed without a load, the springs hold it in its middle
        assert_eq!(moved, protocol != "passive_flexion", "{protocol}");
    }
}

#[test]
fn rows_that_the_explicit_solver_is_stopped_in_are_flagged_and_quasi_static() {
    let (spec, model) = hung();
    let mut options = few_rows();
    options.explicit.most_increments = 50;
    let (quasi, _) = Source::simulated("hung", &spec, &model, &options).unwrap();
    let (mut source, told) = explicit(&quasi, &model, &options).unwrap();
    assert_eq!(told.len(), 4);
    assert!(told.iter().all(|n| n.kind == Kind::ExplicitStopped && n.count > Some(0)), "{told:?}");
    hold_against(&mut source, &quasi, &model, &options).unwrap();
    for ((protocol, rows), (_, beside)) in source.protocols().into_iter().zip(quasi.protocols()) {
        for (row, quasi) in rows.iter().zip(beside) {
            assert!(row.flags.contains(&Flag::Stopped) && row.pose == quasi.pose, "{protocol}");
        }
    }
    assert!(source.check.unwrap().largest.is_empty(), "nothing was told by both");
}

#[test]
fn rows_further_apart_than_they_may_are_flagged_with_the_cause() {
    let (spec, model) = hung();
    let options = few_rows();
    let (quasi, _) = Source::simulated("hung", &spec, &model, &options).unwrap();
    let mut source = quasi.clone();
    source.passive_flexion[1].pose.ap_mm += 0.5;
    source.passive_flexion[1].flags.clear();
    let mut beside = quasi.clone();
    beside.passive_flexion[1].flags.clear();
    let told = hold_against(&mut source, &beside, &model, &options).unwrap();
    assert!(told.len() == 1 && told[0].kind == Kind::SolversApart && told[0].count == Some(1), "{told:?}");
    // without friction both come to rest where the springs hold them
    assert_eq!(source.passive_flexion[1].flags, [Flag::Apart(Cause::Friction)]);
    let check = source.check.unwrap();
    let worst = check.worst("mm").unwrap();
    assert_eq!(
        (worst.protocol.as_str(), worst.quantity.as_str(), worst.cause),
        ("passive_flexion", "AP", Some(Cause::Friction))
    );
    assert!((worst.difference() - 0.5).abs() < 1e-12);
}
