//! The quasi-static solver on the published deck of Specimen 1.
#![expect(clippy::disallowed_methods, reason = "reads ../shared where it is there")]
#![expect(clippy::print_stdout, reason = "figures for the reader of the log")]

mod common;

use common::shared;
use sim::joint::Six;
use sim::model::{BundleParameters, Model};
use sim::quasistatic::{Goal, SolverOptions, State, increment};
use sim::sensitivity::{End, Parameter, all_parameters, sensitivities};
use sim::trials::{Answer, TrialOptions, generalised, pose_spec, solve};

fn model(test: &str) -> Option<Model> {
    let dir = shared(test, "published/S192803/deck")?;
    let read = &mut |name: &str| std::fs::read(dir.join(name)).map_err(|e| e.to_string());
    let deck = sim::abaqus::import("S192803_MAIN_LAXITY_Anterior_30deg_10.inp", read).expect("the deck is read");
    Some(sim::compile(&deck.spec, &deck.meshes).expect("a model"))
}

/// The model with a parameter moved by `by`, and the loads' change [N mm, N].
fn moved(model: &Model, parameter: Parameter, by: f64) -> (Model, Six, f64) {
    let mut parameters: Vec<BundleParameters> = model.parameters();
    let (mut load, mut flexion) = (Six::zeros(), 0.0);
    let changed = match parameter {
        Parameter::ReferenceStrain(b) => {
            parameters[b].reference_strain += by;
            model.with_parameters(&parameters)
        }
        Parameter::Stiffness(b) => {
            parameters[b].stiffness_n_per_mm += by;
            model.with_parameters(&parameters)
        }
        Parameter::Attachment(fibre, end, axis) => {
            let f = &model.fibres[fibre];
            let (mut femur, mut tibia) = (meshes::Point::from(f.femur), meshes::Point::from(f.tibia));
            if end == End::Femur {
                femur[axis] += by
            } else {
                tibia[axis] += by
            }
            model.with_fibre_ends(fibre, femur, tibia)
        }
        Parameter::Load(c) => {
            let mut l = [0.0; 5];
            l[c] = by;
            load = generalised(&l);
            Ok(model.clone())
        }
        Parameter::Flexion => {
            flexion = by.to_radians();
            Ok(model.clone())
        }
        Parameter::ContactScale => model.with_contact_scale(1.0 + by),
    };
    (changed.expect("a small change"), load, flexion)
}

/// Equilibrium near an answer with friction's forces held: pose and bundle forces.
fn nearby(model: &Model, answer: &Answer, load: &Six, flexion: f64) -> Vec<f64> {
    let held = load - answer.state.friction_gradient;
    let from = State::at(answer.state.q);
    let goal = Goal { flexion: answer.state.q[0] + flexion, load: held, flow: None };
    let options = SolverOptions { step_at_the_end_mm: 1e-11, iterations: 200, ..SolverOptions::default() };
    let solved = increment(&model.with_friction(0.0).unwrap(), &from, &goal, &options, true).unwrap();
    let p = pose_spec(&model.joint.grood_suntay(&solved.state.q));
    let mut out = vec![p.vv_deg, p.ie_deg, p.ml_mm, p.ap_mm, p.si_mm];
    out.extend(model.bundle_forces(&solved.evaluation.fibres));
    out
}

#[test]
fn sensitivities_agree_with_finite_differences() {
    let Some(model) = model("sensitivities") else { return };
    for (fe, load) in [(21.0, [0.0, 0.0, 0.0, 133.0, 20.0]), (88.0, [1.0, -8.0, 5.0, 30.0, 60.0])] {
        let answer = solve(&model, fe, &load, &TrialOptions::default()).unwrap();
        let parameters = all_parameters(&model);
        let s = sensitivities(&model, &answer, &parameters).unwrap();
        let base = generalised(&load);
        let mut worst = (0.0_f64, Parameter::Flexion);
        for (column, parameter) in parameters.iter().enumerate().step_by(5).chain([(214, &parameters[214])]) {
            let h = if matches!(parameter, Parameter::ReferenceStrain(_)) { 1e-7 } else { 1e-5 };
            let at = |by: f64| {
                let (m, l, f) = moved(&model, *parameter, by);
                nearby(&m, &answer, &(base + l), f)
            };
            let (hi, lo) = (at(h), at(-h));
            let ours: Vec<f64> =
                s.pose.column(column).iter().chain(s.forces_n.column(column).iter()).copied().collect();
            let size = ours.iter().fold(1e-3_f64, |m, x| m.max(x.abs()));
            for (i, x) in ours.iter().enumerate() {
                let off = ((hi[i] - lo[i]) / (2.0 * h) - x).abs() / size;
                if off > worst.0 {
                    worst = (off, *parameter);
                }
            }
        }
        println!(
            "{fe} deg: least stiffness {:.2} N/mm, sensitivities within {:.1e} ({:?})",
            s.least_stiffness, worst.0, worst.1
        );
        assert!(worst.0 < 1e-5 && s.least_stiffness > 0.0);
    }
}
