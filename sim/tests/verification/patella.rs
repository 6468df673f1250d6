//! The laws of the other files, kept by a knee with a patella under tension of the quadriceps.
use crate::verification::laws::{finished, reversed_returns, trial};
use crate::verification::quasistatic::{answer, explicit_apart};
use crate::verification::rig::Rig;
use meshes::frame::Side;
use meshes::{Isometry, Point, Vector};
use sim::Model;
use sim::coordinate::{AP, FE, Six};
use sim::explicit::ExplicitOptions;
use sim::flags::Flag;
use sim::model::Evaluation;
use sim::trials::TrialOptions;

/// Tension of the quadriceps [N].
const TENSION: f64 = 120.0;

fn pulled(rig: &Rig) -> Model {
    rig.compiled().with_quadriceps(TENSION).unwrap()
}

fn output(model: &Model, q: &Six, name: &str) -> f64 {
    let all = model.outputs(&model.evaluate(q));
    all.iter().find(|(n, _)| n == name).unwrap_or_else(|| panic!("{name} in {all:?}")).1
}

/// Poses from the CT pose to deep flexion, in which quadriceps wrap.
fn poses() -> [Six; 4] {
    [
        Six::zeros(),
        Six::new(0.5, 0.02, -0.05, 0.4, 0.7, 0.1),
        Six::new(1.2, -0.02, 0.1, -0.6, 1.7, -0.3),
        Six::new(1.9, 0.01, 0.15, 0.3, -1.0, 0.2),
    ]
}

#[test]
fn energy_gradient_and_stiffness_are_derivatives_of_one_another() {
    let model = pulled(&Rig::patellar_knee());
    let bare = Rig::patellar_knee().compiled();
    let part = |q: &Six| {
        let (with, without) = (model.evaluate(q), bare.evaluate(q));
        (with.energy - without.energy, with.gradient - without.gradient, with.hessian - without.hessian)
    };
    for q in poses() {
        let (_, gradient, hessian) = part(&q);
        let (mut worst, mut worst_tangent): (f64, f64) = (0.0, 0.0);
        for j in 0..6 {
            let mut h = Six::zeros();
            h[j] = if j < 3 { 1e-4 } else { 2e-3 };
            let (up, down) = (part(&(q + h)), part(&(q - h)));
            worst = worst.max(((up.0 - down.0) / (2.0 * h[j]) - gradient[j]).abs() / gradient.amax());
            let curve = (up.1 - down.1) / (2.0 * h[j]);
            let column = hessian.column(j);
            worst_tangent = worst_tangent.max((curve - column).amax() / hessian.amax());
        }
        println!(
            "patella at {:.0} deg: wrench {worst:.1e}, stiffness {worst_tangent:.1e} of the largest against finite differences; {:?}",
            q[FE].to_degrees(),
            model.outputs(&model.evaluate(&q))
        );
        assert!(worst < 1e-5 && worst_tangent < 1e-3);
        assert!(output(&model, &q, "patella_unbalanced_n") < 1e-4 * TENSION);
    }
}

#[test]
fn the_patella_rests_alike_however_the_pose_was_reached() {
    let model = pulled(&Rig::patellar_knee());
    let mut near = sim::contact::Nearby::default();
    for k in 0..=40 {
        model.evaluate_near(&(poses()[3] * (f64::from(k) / 40.0)), &mut near);
    }
    let (warm, cold) = (model.evaluate_near(&poses()[3], &mut near), model.evaluate(&poses()[3]));
    let miss = (warm.gradient - cold.gradient).amax() / cold.gradient.amax();
    println!("patella: gradient by way of 40 steps and at once {miss:.1e} apart");
    assert!(miss < 1e-7 && (warm.energy - cold.energy).abs() < 1e-7 * cold.energy.abs());
}

fn is_of_the_patella(flag: &Flag) -> bool {
    matches!(flag, Flag::PatellaUnbalanced | Flag::PatellaOffGroove | Flag::PatellaSnaps)
}

/// Flags of a model at a pose, the patella moved from where it rests.
fn flags(model: &Model, q: &Six, moved: [f64; 6]) -> Vec<Flag> {
    let mut evaluation = model.evaluate(q);
    let body = evaluation.bodies.last_mut().unwrap();
    body.inner.iter_mut().zip(moved).for_each(|(u, by)| *u += by);
    let told = sim::trials::flags(model, &model.joint.grood_suntay(q), &evaluation, &TrialOptions::default());
    told.into_iter().filter(is_of_the_patella).collect()
}

#[test]
fn a_patella_off_its_groove_is_flagged_and_one_on_it_is_not() {
    let model = pulled(&Rig::patellar_knee());
    // the rig's patella is a ball: flexed further it turns in its saddle, against the way out
    for q in &poses()[..2] {
        assert_eq!(flags(&model, q, [0.0; 6]), Vec::<Flag>::new(), "{:.0} deg", q[FE].to_degrees());
    }
    // angles are in units of an arm of 20 mm
    let off = |moved| flags(&model, &poses()[0], moved).contains(&Flag::PatellaOffGroove);
    assert!(off([0.0, 0.0, 0.0, 14.0, 0.0, 0.0]) && off([0.0, 0.0, 0.0, -14.0, 0.0, 0.0]));
    assert!(off([0.0, 0.0, 0.0, 0.0, 0.0, 60.0]) && off([0.0, 0.0, 20.0, 0.0, 0.0, 0.0]));
    // patellar flexion goes along the groove
    assert!(!off([0.0, 0.0, 0.0, 4.0, 0.0, 0.0]) && !off([10.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
}

#[test]
fn no_step_of_the_patella_in_a_degree_of_flexion_goes_unflagged() {
    let names = ["flexion_deg", "spin_deg", "tilt_deg", "ml_mm", "ap_mm", "si_mm"].map(|n| format!("patella_{n}"));
    let mut steps = 0;
    for tension in [60.0, 300.0, 1200.0, 4000.0] {
        let model = Rig::patellar_knee().compiled().with_quadriceps(tension).unwrap();
        let mut near = sim::contact::Nearby::default();
        let is_flagged = |(q, evaluation): &(Six, Evaluation)| {
            let gs = model.joint.grood_suntay(q);
            let told = sim::trials::flags(&model, &gs, evaluation, &TrialOptions::default());
            told.iter().any(is_of_the_patella)
        };
        let mut last: Option<([f64; 6], (Six, Evaluation))> = None;
        for degrees in 0..=115 {
            let mut q = Six::zeros();
            q[FE] = f64::from(degrees).to_radians();
            let evaluation = model.evaluate_near(&q, &mut near);
            let all = model.outputs(&evaluation);
            let here = names.each_ref().map(|name| all.iter().find(|(n, _)| n == name).unwrap().1);
            let now = (q, evaluation);
            if let Some((before, then)) = last {
                let far = (0..6).any(|i| (here[i] - before[i]).abs() > if i < 3 { 5.0 } else { 3.0 });
                steps += usize::from(far);
                assert!(!far || is_flagged(&now) || is_flagged(&then), "{tension} N, {degrees} deg: {here:?}");
            }
            last = Some((here, now));
        }
    }
    println!("patella: {steps} steps, each flagged");
    assert!(steps > 0, "nothing was tried");
}

#[test]
fn forces_on_the_patella_balance_and_the_tendon_pulls_the_tibia() {
    let model = pulled(&Rig::patellar_knee());
    for q in poses() {
        let tendon = output(&model, &q, "patellar_tendon_n");
        let ratio = tendon / TENSION;
        println!("patella at {:.0} deg: tendon over quadriceps {ratio:.3}", q[FE].to_degrees());
        assert!(ratio > 0.1 && ratio < 1.3);
    }
    // in extension the tendon pulls the tibia forwards, in flexion less
    let bare = Rig::patellar_knee().compiled();
    let pull = |q: &Six| -(model.evaluate(q).gradient - bare.evaluate(q).gradient)[AP];
    assert!(pull(&poses()[0]) > 1.0 && pull(&poses()[3]) < 0.7 * pull(&poses()[0]));
}

#[test]
fn without_tension_nothing_changes_and_without_a_patella_tension_is_refused() {
    let slack = Rig::patellar_knee();
    let mut bare = Rig::patellar_knee();
    bare.spec.patella = None;
    let (with, without) = (answer(&slack.compiled().with_quadriceps(0.0).unwrap()), answer(&bare.compiled()));
    assert_eq!(with.state.q, without.state.q);
    let error = bare.compiled().with_quadriceps(60.0).unwrap_err().to_string();
    assert!(error.contains("load_quadriceps_n is 60") && error.contains("no patella"), "{error}");
    assert!(slack.compiled().with_quadriceps(-1.0).is_err() && slack.compiled().with_quadriceps(f64::NAN).is_err());
}

#[test]
fn energy_balances_and_a_frictionless_motion_reversed_returns() {
    let model = pulled(&Rig::patellar_knee());
    let state = finished(&model, &trial(&model), &ExplicitOptions::default());
    println!("patella: balance {:.1e}, {}", state.energies.balance_error(), state.energies);
    assert!(state.energies.balance_error() < 0.01);
    reversed_returns("patella", Rig::patellar_knee(), pulled);
}

#[test]
fn left_and_right_answer_alike_and_the_ct_frame_does_not_matter() {
    let rig = Rig::patellar_knee();
    let motion = Isometry::new(Vector::new(120.0, -340.0, 55.0), Vector::new(0.4, -1.1, 2.0));
    let models = [
        pulled(&rig),
        pulled(&rig.mapped(Side::Right, |p| Point::new(-p.x, p.y, p.z))),
        pulled(&rig.mapped(Side::Left, |p| motion * p)),
    ];
    let still = models.each_ref().map(|m| answer(m).state.q);
    let moving = models.each_ref().map(|m| finished(m, &trial(m), &ExplicitOptions::default()).q);
    for (name, q, most) in [("quasi-static", still, 1e-5), ("explicit", moving, 1e-4)] {
        let [mirror, frame] = [1, 2].map(|n| (q[n] - q[0]).amax());
        println!("patella, {name}: mirror {mirror:.1e}; moved CT frame {frame:.1e} mm or rad");
        assert!(mirror < most && frame < most && q[0].amax() > 0.3);
    }
    for name in ["patella_flexion_deg", "patella_spin_deg", "patella_tilt_deg", "patella_ml_mm", "patella_si_mm"] {
        let [a, b, c] = models.each_ref().map(|m| output(m, &poses()[1], name));
        assert!((a - b).abs() < 1e-4 && (a - c).abs() < 1e-4, "{name}: {a} {b} {c}");
    }
}

#[test]
fn explicit_dynamics_end_where_the_quasi_static_path_does() {
    let model = pulled(&Rig::patellar_knee()).with_friction(0.0).unwrap();
    let miss = explicit_apart(&model);
    println!("patella: explicit and quasi-static {miss:.1e} mm or deg apart");
    assert!(miss < 1e-3);
}

#[test]
fn a_patella_that_cannot_be_is_refused() {
    let error = |spoil: &dyn Fn(&mut sim::spec::PatellaSpec)| {
        let mut rig = Rig::patellar_knee();
        spoil(rig.spec.patella.as_mut().unwrap());
        sim::compile(&rig.spec, &rig.meshes).unwrap_err().to_string()
    };
    assert!(error(&|p| p.quadriceps.heads[0].share = 0.9).contains("shares"));
    assert!(error(&|p| p.quadriceps.wrap_radius_mm = f64::NAN).contains("wrap_radius_mm"));
    assert!(error(&|p| p.tendon.fibres.clear()).contains("patellar_tendon: no fibres"));
    assert!(error(&|p| p.tendon.stiffness_n_per_mm = -1.0).contains("stiffness_n_per_mm"));
    assert!(error(&|p| p.tendon.fibres[1].far = p.tendon.fibres[1].patella).contains("fibres[1]"));
    assert!(error(&|p| p.contact.patella = "none".into()).contains("patella.contact.patella names none"));
    assert!(error(&|p| p.frame.medial *= 2.0).contains("patella"));
    assert!(error(&|p| p.contact.pressure_mpa = vec![1.0, 0.0]).contains("contact"));
}
