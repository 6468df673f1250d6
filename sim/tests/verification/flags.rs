//! Flags: a knee at its rim, one turned too far, a ligament that bears too much, an answer that is not the only one.
use crate::verification::rig::{Rig, plate};
use meshes::frame::Side;
use meshes::{Isometry, Point};
use sim::Model;
use sim::coordinate::{AP, FE, IE, Load, ML, Six, VV};
use sim::flags::{Flag, HALF_PLATEAU_MM};
use sim::mesh::MeshValue;
use sim::trials::{TrialOptions, flags, solve};

/// Flags of the rig knee at chain coordinates.
fn at(model: &Model, set: &[(sim::coordinate::Coordinate, f64)]) -> Vec<Flag> {
    let mut q = Six::zeros();
    set.iter().for_each(|(c, x)| q[*c] = *x);
    flags(model, &model.joint.grood_suntay(&q), &model.evaluate(&q), &TrialOptions::default())
}

/// The rig knee: condyles 22 mm to either side, over plateaus that end 18 mm before and behind them.
fn knee() -> Rig {
    let mut rig = Rig::knee();
    // slack: places are looked at, not forces
    rig.spec.bundles.iter_mut().for_each(|b| b.reference_strain = 0.5);
    rig
}

#[test]
fn a_knee_is_told_by_where_it_bears_on_its_plateaus() {
    let model = knee().compiled();
    let none: Vec<Flag> = vec![];
    for far in [0.0, 8.0, 14.0] {
        assert_eq!((at(&model, &[(AP, far)]), at(&model, &[(AP, -far)])), (none.clone(), none.clone()), "{far}");
    }
    for off in [17.0, 18.5, 25.0] {
        for sign in [-1.0, 1.0] {
            assert_eq!(at(&model, &[(AP, sign * off)]), [Flag::Dislocated], "{off}");
        }
    }
    // turned about one plateau, so that the other bears at its rim
    let turn = (17.0_f64 / 44.0).asin();
    for sign in [-1.0, 1.0] {
        assert_eq!(at(&model, &[(IE, turn), (AP, sign * 8.5)]), [Flag::Subluxed]);
        // sideways one compartment goes over its outer rim, the other towards the eminence
        assert_eq!(at(&model, &[(ML, sign * 17.0)]), [Flag::Subluxed]);
    }
}

/// The rig knee on plateaus that end so far before and behind its condyles [mm]; as wide as the rig's.
fn on_plateaus_of(half: f64) -> Model {
    let mut rig = knee();
    for (name, x) in [("tibia0", -22.0), ("tibia1", 22.0)] {
        let mut longer = plate(half, 2 * half as usize, true);
        longer.vertices.iter_mut().for_each(|v| v.x *= 18.0 / half);
        let place = Isometry::translation(x + 0.0713, 0.0437, 0.0137);
        rig.meshes.insert(name.into(), MeshValue::Surface(longer.moved(&place)));
    }
    rig.compiled()
}

#[test]
fn a_knee_on_one_plateau_is_subluxed_half_a_plateau_off_the_ct_pose_and_no_sooner() {
    let (long, short) = (on_plateaus_of(45.0), on_plateaus_of(30.0));
    let (below, beyond) = (HALF_PLATEAU_MM - 0.5, HALF_PLATEAU_MM + 0.5);
    let none: Vec<Flag> = vec![];
    // a tilt that lifts one condyle by more than it lies in its plateau
    for tilt in [-0.004, 0.004] {
        for sign in [-1.0, 1.0] {
            let flagged = |model: &Model, ap: f64| at(model, &[(AP, sign * ap), (VV, tilt)]);
            assert_eq!((flagged(&long, 8.0), flagged(&long, below)), (none.clone(), none.clone()), "{tilt} {sign}");
            assert_eq!((flagged(&long, beyond), flagged(&long, 30.0)), (vec![Flag::Subluxed], vec![Flag::Subluxed]));
            // at the rim, and beyond the depth of a plateau, it is dislocated
            assert_eq!((flagged(&short, 25.0), flagged(&short, 29.5)), (vec![Flag::Subluxed], vec![Flag::Dislocated]));
            assert_eq!(flagged(&long, 39.0), [Flag::Dislocated]);
            // where both bear, it is as far and no flag
            assert_eq!(at(&long, &[(AP, sign * 30.0)]), none);
        }
    }
}

#[test]
fn a_right_knee_is_flagged_as_the_left() {
    let rig = knee();
    let (left, right) = (rig.compiled(), rig.mapped(Side::Right, |p| Point::new(-p.x, p.y, p.z)).compiled());
    let bear = |model: &Model, q: &Six| {
        model.contact.bearings(&model.joint.pose(q), [model.joint.femur(), model.joint.tibia()], 2.0)
    };
    for (ap, ie, ml) in [(3.0, 0.1, 0.0), (9.0, 0.38, 0.0), (-9.0, 0.38, 0.0), (0.0, 0.0, 17.0), (17.0, 0.0, 0.0)] {
        let mut q = Six::zeros();
        (q[AP], q[IE], q[ML]) = (ap, ie, ml);
        assert_eq!(at(&left, &[(AP, ap), (IE, ie), (ML, ml)]), at(&right, &[(AP, ap), (IE, ie), (ML, ml)]));
        let (a, b) = (bear(&left, &q), bear(&right, &q));
        assert!(!a.is_empty() && a.len() == b.len());
        for (a, b) in a.iter().zip(&b) {
            assert_eq!(a.compartment, b.compartment);
            assert!((a.load_n - b.load_n).abs() < 1e-6 * a.load_n && (a.inside_mm[0] - b.inside_mm[0]).abs() < 1e-3);
        }
    }
}

#[test]
fn a_rotation_is_odd_beyond_what_living_knees_turn() {
    let model = knee().compiled();
    let evaluation = model.evaluate(&Six::zeros());
    let told = |fe: f64, ie: f64| {
        let mut gs = Six::zeros();
        (gs[FE], gs[IE]) = (fe.to_radians(), ie.to_radians());
        flags(&model, &gs, &evaluation, &TrialOptions::default()) == [Flag::Rotated]
    };
    assert!(told(30.0, -66.0) && told(90.0, 66.0) && told(0.0, -35.0) && told(5.0, 57.0));
    assert!(!told(30.0, -38.0) && !told(60.0, 55.0) && !told(0.0, -25.0) && !told(0.0, 50.0));
}

#[test]
fn varus_and_valgus_are_odd_far_from_the_ct_pose() {
    let model = knee().compiled();
    let evaluation = model.evaluate(&Six::zeros());
    let told = |vv: f64| {
        let mut gs = model.joint.ct_pose();
        gs[VV] += vv.to_radians();
        flags(&model, &gs, &evaluation, &TrialOptions::default()).contains(&Flag::Rotated)
    };
    assert!(told(39.0) && told(-26.0) && !told(24.0) && !told(-24.0));
}

#[test]
fn a_ligament_is_flagged_where_all_its_bundles_together_bear_too_much() {
    let torn = |names: [&str; 2], stretch: f64| {
        let mut rig = knee();
        for (k, name) in names.into_iter().enumerate() {
            let b = &mut rig.spec.bundles[k];
            (b.name, b.stiffness_n_per_mm, b.toe_strain) = (name.into(), 60.0, 1e-6);
            b.reference_strain = b.reference_length_mm / (b.reference_length_mm - stretch);
            rig.spec.fibres[k].bundle = name.into();
        }
        at(&rig.compiled(), &[])
    };
    // 60 N/mm and 298 N: nearly 5 mm
    assert!(torn(["PFL", "other"], 4.5).is_empty());
    assert_eq!(torn(["PFL", "other"], 5.5), [Flag::Torn("PFL".into())]);
    // 498.5 N over two bundles: 4.2 mm each; a name that only begins alike is another ligament's
    assert!(torn(["sMCL_A", "sMCLX"], 4.5).is_empty());
    assert_eq!(torn(["sMCL_A", "sMCL_P"], 4.5), [Flag::Torn("sMCL".into())]);
}

#[test]
fn a_second_search_tells_an_answer_that_is_not_the_only_one() {
    let options = TrialOptions { second_search_mm: 4.0, ..TrialOptions::default() };
    // flat plateaus without ligaments hold a knee nowhere in particular
    let mut loose = knee();
    loose.spec.contact.friction = 0.0;
    let load = Load::compression(20.0);
    let told = |rig: &Rig, options: &TrialOptions| solve(&rig.compiled(), 0.0, &load, options).unwrap().flags;
    assert_eq!(told(&loose, &options), [Flag::Several]);
    assert!(told(&loose, &TrialOptions::default()).is_empty());
    let mut held = Rig::knee();
    held.spec.contact.friction = 0.0;
    assert!(told(&held, &options).is_empty());
}
