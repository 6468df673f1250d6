//! Laws that hold with menisci, as without.
use crate::verification::laws::finished;
use crate::verification::quasistatic::answer;
use crate::verification::rig::Rig;
use meshes::frame::Side;
use meshes::{Isometry, Point, Vector};
use sim::compile;
use sim::coordinate::{FE, FREE, Load, Six};
use sim::explicit::ExplicitOptions;
use sim::spec::{HornSpec, MeniscusMaterial, MeniscusSpec, SectionSpec};
use sim::trials::{TrialOptions, solve};

/// A meniscus that fills the gap about a condyle of the rig, open towards the middle.
fn meniscus(name: &str, n: usize, x: f64, depth: f64) -> MeniscusSpec {
    let outwards = x.signum();
    let section = |k: usize| {
        let angle = -2.3 + 4.6 * k as f64 / 24.0;
        let at =
            |r: f64, z: f64| Point::new(x + 0.0713 + outwards * r * angle.cos(), 0.0437 + r * angle.sin(), z + 0.0137);
        let radii = (0..6).map(|i| 6.0 + 1.6 * f64::from(i));
        let gap = |r: f64| 20.0 - depth - (400.0 - r * r).sqrt();
        SectionSpec {
            lower: radii.clone().map(|r| at(r, 0.0)).collect(),
            upper: radii.map(|r| at(r, gap(r))).collect(),
        }
    };
    let horn = |y: f64| HornSpec { tibia: Point::new(x - outwards * 12.0, y, -0.5), stiffness_n_per_mm: 2000.0 };
    MeniscusSpec {
        name: name.into(),
        femur: format!("femur{n}"),
        tibia: format!("tibia{n}"),
        source: "rig".into(),
        sections: (0..25).map(section).collect(),
        wedges: 12,
        material: MeniscusMaterial {
            circumferential_modulus_mpa: 150.0,
            transverse_modulus_mpa: 20.0,
            shear_modulus_mpa: 2.0,
            cartilage_mpa_per_mm: 10.0,
        },
        anterior_horn: horn(-14.0),
        posterior_horn: horn(14.0),
        periphery_n_per_mm2: 0.5,
    }
}

fn knee() -> Rig {
    let mut rig = Rig::knee();
    rig.spec.menisci = vec![meniscus("meniscus_medial", 0, -22.0, 0.05), meniscus("meniscus_lateral", 1, 22.0, 0.03)];
    rig
}

/// A pose in which condyles press menisci and cartilage, flexed and turned.
fn pressed() -> Six {
    Six::new(0.25, 0.012, -0.04, 0.3, 0.8, 0.25)
}

#[test]
fn energy_force_and_stiffness_are_derivatives_of_one_another() {
    let model = knee().compiled();
    for q in [pressed(), Six::new(-0.1, 0.01, 0.05, -0.5, -1.5, 0.4)] {
        let here = model.evaluate(&q);
        let share: f64 = here.bodies.iter().map(|b| b.energy).sum();
        let (mut force, mut stiff): (f64, f64) = (0.0, 0.0);
        let of = |q: &Six| {
            let bodies = model.evaluate(q).bodies;
            let gradient: Six = bodies.iter().map(|b| b.gradient).sum();
            (bodies.iter().map(|b| b.energy).sum::<f64>(), gradient)
        };
        let (gradient, hessian) = here
            .bodies
            .iter()
            .fold((Six::zeros(), nalgebra::Matrix6::zeros()), |(g, h), b| (g + b.gradient, h + b.hessian));
        for c in sim::coordinate::ALL {
            let mut h = Six::zeros();
            h[c] = if c.turns() { 1e-6 } else { 3e-5 };
            let (up, down) = (of(&(q + h)), of(&(q - h)));
            force = force.max(((up.0 - down.0) / (2.0 * h[c]) - gradient[c]).abs() / gradient.amax());
            let slope = (up.1 - down.1) / (2.0 * h[c]);
            stiff = stiff.max((slope - hessian.column(c.index())).amax() / hessian.amax());
        }
        println!(
            "menisci: {share:.1} N mm; against finite differences force {force:.1e}, stiffness {stiff:.1e} of the largest"
        );
        assert!(share > 1.0 && force < 1e-5 && stiff < 1e-4);
    }
}

#[test]
fn rest_does_not_depend_on_where_the_search_began() {
    let model = knee().compiled();
    let (mut near, q) = (sim::contact::Nearby::default(), pressed());
    for k in 1..=8 {
        model.evaluate_near(&(q * (f64::from(k) / 8.0)), &mut near);
    }
    let (warm, cold) = (model.evaluate_near(&q, &mut near), model.evaluate(&q));
    let (de, dg) = ((warm.energy - cold.energy).abs(), (warm.gradient - cold.gradient).amax());
    println!("menisci: searched from close by and from afar, energy {de:.1e} N mm, gradient {dg:.1e}");
    assert!(de < 1e-6 && dg < 1e-4);
    let evaluations: Vec<usize> = warm.bodies.iter().chain(&cold.bodies).map(|b| b.evaluations).collect();
    println!("menisci: evaluations from close by, from afar {evaluations:?}");
}

#[test]
fn left_and_right_rest_alike_and_the_ct_frame_does_not_matter() {
    let rig = knee();
    let here = answer(&rig.compiled()).state.q;
    let mirror = (answer(&rig.mapped(Side::Right, |p| Point::new(-p.x, p.y, p.z)).compiled()).state.q - here).amax();
    let motion = Isometry::new(Vector::new(120.0, -340.0, 55.0), Vector::new(0.4, -1.1, 2.0));
    let frame = (answer(&rig.mapped(Side::Left, |p| motion * p).compiled()).state.q - here).amax();
    println!("menisci: mirror {mirror:.1e}; moved CT frame {frame:.1e} mm or rad");
    assert!(mirror < 1e-5 && frame < 1e-5);
}

#[test]
fn at_rest_forces_balance_and_menisci_take_their_share() {
    let model = knee().compiled();
    let load = Load::compression(1000.0);
    let answer = solve(&model, 0.0, &load, &TrialOptions::default()).unwrap();
    let left = answer.evaluation.gradient + answer.state.friction_gradient - load.generalised();
    let miss = FREE.iter().map(|&c| left[c].abs() / if c.turns() { 30.0 } else { 1.0 }).fold(0.0, f64::max);
    let told = model.outputs(&answer.evaluation);
    let of = |end: &str| told.iter().filter(|(n, _)| n.ends_with(end)).map(|(_, x)| x).sum::<f64>();
    println!("menisci: balance to {miss:.1e} N; of 1000 N they bear {:.0} N; {told:?}", of("load_n"));
    assert!(miss < 1e-4 && of("load_n") > 100.0 && of("load_n") < 1000.0 && of("hoop_n") > 5.0);
}

#[test]
fn energy_balances_and_explicit_ends_where_quasi_static_does() {
    let model = knee().compiled().with_friction(0.0).unwrap();
    let load = Load::new(1.0, -0.8, 0.0, 20.0, 100.0);
    let steps = sim::explicit::TrialSteps { settle_s: 0.2, load_s: 0.3, ..Default::default() };
    let mut program = steps.program(&model.joint, 10.0, &load.generalised()).unwrap();
    program.steps.push(crate::verification::rig::step(1.0, &[FE], load.generalised()));
    program.steps.last_mut().unwrap().damping = Six::new(50.0, 50.0, 50.0, 1.0, 1.0, 1.0);
    let explicit = finished(&model, &program, &ExplicitOptions::default());
    println!("menisci: {}, balance {:.1e}", explicit.energies, explicit.energies.balance_error());
    let quasi = solve(&model, 10.0, &load, &TrialOptions::default()).unwrap();
    let bodies: f64 = quasi.evaluation.bodies.iter().map(|b| b.energy).sum();
    let apart = (explicit.q - quasi.state.q).amax();
    println!("menisci: explicit against quasi-static {apart:.1e} mm or rad; energy in the menisci {bodies:.1} N mm");
    assert!(explicit.energies.balance_error() < 0.01 && apart < 1e-3 && bodies > 1.0);
    assert!(quasi.state.q.amax() > 0.3);
}

#[test]
fn a_knee_that_bears_on_its_menisci_alone_is_not_dislocated() {
    let mut rig = knee();
    for m in &mut rig.spec.menisci {
        // higher by half a millimetre: under little load the cartilages stay apart
        m.sections.iter_mut().flat_map(|s| &mut s.upper).for_each(|p| p.z += 0.5);
    }
    rig.spec.bundles.iter_mut().for_each(|b| b.reference_strain = 0.95);
    let answer = solve(&rig.compiled(), 5.0, &Load::compression(10.0), &TrialOptions::default()).unwrap();
    let direct: f64 = answer.evaluation.contact.wrench.iter().map(|(f, _)| f.norm()).sum();
    println!("menisci alone bear: cartilage {direct:.1} N, flags {:?}", answer.flags);
    assert!(direct < 1e-9 && answer.flags.is_empty());
}

#[test]
fn a_meniscus_taken_out_is_as_one_that_never_was() {
    let bare = answer(&Rig::knee().compiled()).state.q;
    let both: Vec<String> = ["meniscus_medial", "meniscus_lateral"].map(String::from).into();
    let without = answer(&knee().compiled().without(&both).unwrap()).state.q;
    assert_eq!(bare, without);
}

#[test]
fn what_is_no_meniscus_is_refused() {
    let refused = |word: &str, change: &dyn Fn(&mut MeniscusSpec)| {
        let mut rig = knee();
        change(&mut rig.spec.menisci[0]);
        let error = compile(&rig.spec, &rig.meshes).unwrap_err().to_string();
        assert!(error.contains("meniscus_medial") && error.contains(word), "{error}");
    };
    refused("contact.pairs", &|m| m.tibia = "tibia1".into());
    refused("wedges", &|m| m.wedges = 30);
    refused("section 3", &|m| m.sections[3].upper.truncate(2));
    refused("section 2", &|m| m.sections[2].lower[1].x = f64::NAN);
    refused("section 4", &|m| m.sections[4].upper = m.sections[4].lower.clone());
    refused("transverse_modulus_mpa", &|m| m.material.transverse_modulus_mpa = 200.0);
    refused("anterior_horn", &|m| m.anterior_horn.tibia = Point::new(500.0, 0.0, 0.0));
}

#[test]
fn one_wedge_more_or_less_changes_little() {
    let at = |wedges: usize| {
        let mut rig = knee();
        rig.spec.menisci.iter_mut().for_each(|m| m.wedges = wedges);
        let model = rig.compiled();
        model.evaluate(&pressed()).bodies.iter().map(|b| b.energy).sum::<f64>()
    };
    let energies = [6, 12, 24].map(at);
    println!("menisci: energy with 6, 12, 24 wedges {energies:.3?} N mm");
    assert!((energies[1] / energies[2] - 1.0).abs() < 0.1);
}
