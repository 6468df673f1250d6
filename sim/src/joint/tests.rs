use super::*;
use nalgebra::Rotation3;

/// A left knee with slightly oblique frames, and its mirror image.
pub(crate) fn frames(side: Side) -> FramesSpec {
    let mirror = |v: Vector| if side == Side::Left { v } else { Vector::new(-v.x, v.y, v.z) };
    let frame = |origin: Vector, turn: Vector| {
        let r = Rotation3::new(turn);
        AnatomicalFrame {
            origin: Point::from(mirror(origin)),
            medial: mirror(r * -Vector::x()),
            anterior: mirror(r * -Vector::y()),
            superior: mirror(r * Vector::z()),
        }
    };
    FramesSpec {
        femur: frame(Vector::new(-2.5, 55.0, -22.0), Vector::new(0.1, 0.02, 0.03)),
        tibia: frame(Vector::new(-1.0, 54.9, -44.0), Vector::new(-0.01, 0.05, -0.06)),
        gs_ct_pose: Default::default(),
        chain: None,
        grid: None,
    }
}

#[test]
fn velocity_fields_match_finite_differences() {
    let joint = Joint::new(&frames(Side::Left), Side::Left).unwrap();
    let q = Six::new(0.7, -0.1, 0.3, 1.0, -4.0, 2.0);
    let p = Point::new(20.0, 40.0, -30.0);
    let h = 1e-6;
    let here = joint.pose(&q);
    for j in 0..6 {
        let mut step = Six::zeros();
        step[j] = h;
        let difference = (joint.pose(&(q + step)).femur * p - joint.pose(&(q - step)).femur * p) / (2.0 * h);
        assert!((difference - here.screws[j].at(&(here.femur * p).coords)).norm() < 1e-7);
    }
}

#[test]
fn angles_add_to_the_ct_pose_and_derivatives_match() {
    for side in [Side::Left, Side::Right] {
        let joint = Joint::new(&frames(side), side).unwrap();
        let q = Six::new(1.2, 0.08, -0.25, 1.5, 6.0, -2.0);
        let gs = joint.grood_suntay(&q);
        for k in [FE, VV, IE] {
            assert!((gs[k] - joint.ct_pose()[k] - q[k]).abs() < 1e-12, "{k}");
        }
        let d = joint.grood_suntay_derivative(&q);
        for j in 0..6 {
            let mut step = Six::zeros();
            step[j] = 1e-6;
            let difference = (joint.grood_suntay(&(q + step)) - joint.grood_suntay(&(q - step))) / 2e-6;
            assert!((difference - d.column(j)).amax() < 1e-7, "{j}: {difference} {}", d.column(j));
        }
        assert!((joint.coordinates(&gs).unwrap() - q).amax() < 1e-10);
    }
}

#[test]
fn translations_have_clinical_signs() {
    let joint = Joint::new(&frames(Side::Left), Side::Left).unwrap();
    let d = joint.grood_suntay_derivative(&Six::zeros());
    for k in 0..6 {
        assert!(d[(k, k)] > 0.9, "{k} {d}");
    }
    // the tibia anterior of the femur: the femur moves posterior, +y
    let femur = joint.pose(&Six::new(0.0, 0.0, 0.0, 0.0, 5.0, 0.0)).femur;
    assert!((femur.translation.vector.y - 5.0).abs() < 0.1);
}

#[test]
fn a_right_knee_is_the_mirror_image_of_a_left_one() {
    let left = Joint::new(&frames(Side::Left), Side::Left).unwrap();
    let right = Joint::new(&frames(Side::Right), Side::Right).unwrap();
    let q = Six::new(0.9, 0.1, -0.2, 2.0, 5.0, -1.0);
    assert!((left.grood_suntay(&q) - right.grood_suntay(&q)).amax() < 1e-12);
    let p = Point::new(12.0, 30.0, -40.0);
    let (a, b) = (left.pose(&q).femur * p, right.pose(&q).femur * Point::new(-p.x, p.y, p.z));
    assert!((a - Point::new(-b.x, b.y, b.z)).norm() < 1e-12);
}

#[test]
fn a_skew_frame_is_refused() {
    let mut bad = frames(Side::Left);
    bad.femur.medial *= 1.1;
    assert!(matches!(Joint::new(&bad, Side::Left), Err(SimError::Spec(m)) if m.contains("femur")));
}
