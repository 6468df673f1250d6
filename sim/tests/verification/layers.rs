//! The laws of the other files, kept by contact through layers of uneven thickness.
use crate::verification::laws::{finished, reversed_returns, trial};
use crate::verification::quasistatic::{answer, explicit_apart};
use crate::verification::rig::Rig;
use meshes::frame::Side;
use meshes::{Isometry, Point, Vector};
use sim::coordinate::Six;
use sim::explicit::ExplicitOptions;

#[test]
fn energy_balances_and_a_frictionless_motion_reversed_returns() {
    let model = Rig::layered_knee().compiled();
    let state = finished(&model, &trial(&model), &ExplicitOptions::default());
    println!("layers: balance {:.1e}", state.energies.balance_error());
    assert!(state.energies.balance_error() < 0.01 && state.energies.contact > 0.0);
    reversed_returns("layers", Rig::layered_knee(), Rig::compiled);
}

#[test]
fn left_and_right_answer_alike_and_the_ct_frame_does_not_matter() {
    let rig = Rig::layered_knee();
    let motion = Isometry::new(Vector::new(120.0, -340.0, 55.0), Vector::new(0.4, -1.1, 2.0));
    let models = [
        rig.compiled(),
        rig.mapped(Side::Right, |p| Point::new(-p.x, p.y, p.z)).compiled(),
        rig.mapped(Side::Left, |p| motion * p).compiled(),
    ];
    let still = models.each_ref().map(|m| answer(m).state.q);
    let moving = models.each_ref().map(|m| finished(m, &trial(m), &ExplicitOptions::default()).q);
    for (name, q, most) in [("quasi-static", still, 1e-5), ("explicit", moving, 1e-4)] {
        let [mirror, frame] = [1, 2].map(|n| (q[n] - q[0]).amax());
        println!("layers, {name}: mirror {mirror:.1e}; moved CT frame {frame:.1e} mm or rad");
        assert!(mirror < most && frame < most && q[0].amax() > 0.3);
    }
}

#[test]
fn contact_forces_are_the_slope_of_the_energy_and_those_of_the_quasi_static_solver() {
    let model = Rig::layered_knee().compiled();
    let q = Six::new(0.1, 0.004, -0.03, 0.4, 0.7, 0.1);
    let at = |q: &Six| model.contact.press(&model.joint.pose(q));
    let (pose, here) = (model.joint.pose(&q), at(&q));
    let whole = model.contact.evaluate(&pose);
    assert!((here.energy - whole.energy).abs() < 1e-9 * whole.energy && whole.energy > 1.0);
    let (mut worst, mut worst_tangent): (f64, f64) = (0.0, 0.0);
    for j in 0..6 {
        let force = pose.screws[j].linear.dot(&here.force) + pose.screws[j].angular.dot(&here.moment);
        assert!((force + whole.gradient[j]).abs() < 1e-9 * whole.gradient.amax());
        let mut h = Six::zeros();
        h[j] = if j < 3 { 1e-6 } else { 1e-5 };
        let slope = (at(&(q + h)).energy - at(&(q - h)).energy) / (2.0 * h[j]);
        worst = worst.max((slope + force).abs() / whole.gradient.amax());
        let gradient = |q: Six| model.contact.evaluate(&model.joint.pose(&q)).gradient;
        let curve = (gradient(q + h) - gradient(q - h)) / (2.0 * h[j]);
        let column = whole.hessian.column(j);
        worst_tangent = worst_tangent.max((curve - column).amax() / column.amax());
    }
    println!("layers: forces {worst:.1e}, stiffness {worst_tangent:.1e} of the largest against finite differences");
    assert!(worst < 1e-4 && worst_tangent < 1e-2);
}

#[test]
fn explicit_dynamics_end_where_the_quasi_static_path_does() {
    // friction remembers a path, so that the two end apart with it, by the table as well
    for (name, rig, friction) in [
        ("layers", Rig::layered_knee(), 0.0),
        ("layers, friction", Rig::layered_knee(), 0.03),
        ("table, friction", Rig::knee(), 0.03),
    ] {
        let model = rig.compiled().with_friction(friction).unwrap();
        let miss = explicit_apart(&model);
        println!("{name}: explicit and quasi-static {miss:.1e} mm or deg apart");
        assert!(miss < if friction > 0.0 { 0.05 } else { 1e-4 });
    }
}

#[test]
fn layers_that_cannot_be_are_refused() {
    let error = |spoil: &dyn Fn(&mut sim::spec::LayerSpec)| {
        let mut rig = Rig::layered_knee();
        spoil(rig.spec.contact.layer.as_mut().unwrap());
        sim::compile(&rig.spec, &rig.meshes).unwrap_err().to_string()
    };
    assert!(error(&|l| l.youngs_modulus_mpa = 5e6).contains("check its unit"));
    assert!(error(&|l| l.poissons_ratio = 0.5).contains("poissons_ratio is 0.5"));
    assert!(error(&|l| l.edge_spread = f64::NAN).contains("edge_spread"));
    assert!(error(&|l| l.least_thickness_mm = 0.0).contains("least_thickness_mm"));
    assert!(error(&|l| l.bony_faces.clear()).contains("nothing of this pair gives way"));
    assert!(error(&|l| drop(l.bony_faces.insert("femur0".into(), "none".into()))).contains("none, which is not among"));
    assert!(
        error(&|l| drop(l.bony_faces.insert("femur0".into(), "tibia1".into()))).contains("are both of one cartilage?")
    );
}
