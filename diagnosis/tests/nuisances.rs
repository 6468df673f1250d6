//! What is not known of a knee built from raw data: derivatives of readings by every parameter, and where frames belong.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::shared;
use calibration::options::CalibrateOptions;
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::Problem;
use diagnosis::problem::trial::Source;
use inference::knee::Quantity;
use inference::parameter::Prior;
use needs_shared::needs_shared;
use sim::coordinate::Free;
use sim::equilibrium::starts_of;
use sim::uncertainty::{FrameUncertainty, FramesUncertainty, SiteUncertainty, Uncertainty};

/// The published deck as if it had been built from raw data, measured in two data sets.
fn built(test: &str) -> Option<Problem> {
    built_and_calibrated(test, &CalibrateOptions::default(), &[])
}

/// The same of a knee that was calibrated so, and was cut before the second data set.
#[expect(clippy::disallowed_methods, reason = "published data")]
fn built_and_calibrated(test: &str, calibrate: &CalibrateOptions, cut: &[&str]) -> Option<Problem> {
    let folder = shared(test, "published/S192803/deck")?;
    let mut read = |name: &str| std::fs::read(folder.join(name)).map_err(|e| e.to_string());
    let mut deck = decks::import("S192803_MAIN_LAXITY_Anterior_0deg_0.inp", &mut read).unwrap();
    deck.spec.frames.chain = None;
    let frame = || FrameUncertainty { turn_deg: [2.0; 3], shift_mm: [2.0; 3], source: String::new() };
    let site = || SiteUncertainty { femur_mm: 2.0, tibia_mm: 2.0, source: String::new() };
    deck.spec.uncertainty = Some(Uncertainty {
        sites: deck.spec.bundles.iter().map(|b| (b.name.clone(), site())).collect(),
        frames: FramesUncertainty { femur: frame(), tibia: frame() },
        contact_log_scale: 0.3,
        cartilage_mm: 0.2,
        ligaments: Default::default(),
        sources: Default::default(),
    });
    let model = sim::compile(&deck.spec, &deck.meshes).unwrap();
    let text = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,\
                fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n\
                a,varus,30,8,0,0,0,50,30,0,0,0,0,0\n\
                b,internal,60,0,-5,0,0,50,60,0,0,0,0,0\n";
    let source = |name: &str| Source::new(name, sim::laxity::read(text.as_bytes()).unwrap().trials);
    let mut sources = [source("kla"), source("rks")];
    sources[1].trials.iter_mut().for_each(|t| t.without = cut.iter().map(|name| (*name).to_owned()).collect());
    Some(Problem::new(&model, &deck.spec, &sources, &Catalogue::shipped(), calibrate).unwrap())
}

#[needs_shared]
fn readings_change_with_each_parameter_as_their_derivatives_say() {
    let Some(problem) = built("derivatives") else { return };
    let off = derivatives_that_are_off(&problem, 0.05);
    assert!(off.is_empty(), "{}", off.join("\n"));
}

/// The whole knee is the first data set's, the cut one the second's: what was cut is felt in the first alone.
#[needs_shared]
fn so_they_do_where_one_data_set_is_of_a_cut_knee_and_what_was_cut_is_not_felt_there() {
    let cut = &["ACL"];
    let Some(problem) = built_and_calibrated("cut derivatives", &CalibrateOptions::default(), cut) else { return };
    let off = derivatives_that_are_off(&problem, 0.02);
    assert!(off.is_empty(), "{}", off.join("\n"));
    let here = vec![0.0; problem.nuisances()];
    let linear = problem.linear_at(&[], &here, problem.rests(&[], &here, &[]).unwrap()).unwrap();
    let bundles = problem.model.bundle_names();
    let of_cut = |b: &usize| cut.iter().any(|name| bundles[*b].starts_with(name));
    let (mut whole, mut parameters) = (0.0_f64, 0);
    for (k, p) in problem.nuisance.list.iter().enumerate() {
        let is_cut = match &p.quantity {
            Quantity::ReferenceStrain(of) | Quantity::Stiffness(of) => of.iter().all(of_cut),
            Quantity::Site(bundle, ..) => of_cut(bundle),
            _ => false,
        };
        if is_cut {
            parameters += 1;
            for (i, trial) in problem.trials.iter().enumerate() {
                let felt = linear.jacobian.view((5 * i, k), (5, 1)).amax();
                whole = if trial.source == Some(0) { whole.max(felt) } else { whole };
                assert!(trial.source == Some(0) || felt == 0.0, "{} in {}", p.name, trial.record.trial);
            }
        }
    }
    assert!(parameters > 10 && whole > 0.05, "{parameters} parameters, {whole}");
}

/// Derivatives by the parameters that are not those of differences over steps of `h`, in words. Steps are wide enough that the tolerance of an equilibrium
/// does not count; a bundle may become taut on the way.
fn derivatives_that_are_off(problem: &Problem, h: f64) -> Vec<String> {
    let here = vec![0.0; problem.nuisances()];
    let linear = problem.linear_at(&[], &here, problem.rests(&[], &here, &[]).unwrap()).unwrap();
    let starts = starts_of(&linear.rests);
    let mut off = Vec::new();
    let at = |k: usize, by: f64| {
        let mut x = here.clone();
        x[k] = by;
        let rests = problem.rests(&[], &x, &starts).unwrap();
        rests.iter().flat_map(diagnosis::problem::reading).collect::<Vec<f64>>()
    };
    for (k, p) in problem.nuisance.list.iter().enumerate() {
        let (up, down) = (at(k, h), at(k, -h));
        for r in 0..up.len() {
            let numeric = (up[r] - down[r]) / (2.0 * h);
            let slope = linear.jacobian[(r, k)];
            if (slope - numeric).abs() > 0.05 + 0.05 * numeric.abs() {
                off.push(format!("{} row {r}: {slope:.3}, {numeric:.3}", p.name));
            }
        }
    }
    off
}

#[needs_shared]
fn the_frames_of_a_data_set_change_its_own_readings_alone() {
    let Some(problem) = built("own frames") else { return };
    let here = vec![0.0; problem.nuisances()];
    let linear = problem.linear_at(&[], &here, problem.rests(&[], &here, &[]).unwrap()).unwrap();
    let mut own = 0;
    for (k, p) in problem.nuisance.list.iter().enumerate() {
        let Quantity::Frame(Some(source), _) = p.quantity else { continue };
        own += 1;
        for (i, trial) in problem.trials.iter().enumerate().filter(|(_, t)| t.source != Some(source)) {
            assert_eq!(linear.jacobian.view((5 * i, k), (5, 1)).amax(), 0.0, "{} in {}", p.name, trial.record.trial);
        }
    }
    assert_eq!(own, 24);
}

/// The prior of the first parameter that is this.
fn prior_of(problem: &Problem, is_it: impl Fn(&Quantity) -> bool) -> Prior {
    problem.nuisance.list.iter().find(|p| is_it(&p.quantity)).unwrap().prior
}

#[needs_shared]
fn a_diagnosis_hears_the_priors_ranges_frames_and_noise_of_the_calibration() {
    let usual = CalibrateOptions::default();
    let mut other = usual.clone();
    other.priors = calibration::priors::PriorTable::None;
    other.ranges.insert("X1".into(), [0.9, 1.0]);
    (other.frames.turn_sd_deg, other.frames.offset_turn_deg, other.frames.offset_shift_mm) = (Some(0.25), 0.1, 3.0);
    other.targets.noise = Free([0.1, 0.2, 0.3, 0.6, 0.7]);
    let Some(before) = built_and_calibrated("options", &usual, &[]) else { return };
    let Some(after) = built_and_calibrated("options", &other, &[]) else { return };
    let both = |is_it: &dyn Fn(&Quantity) -> bool| [prior_of(&before, is_it), prior_of(&after, is_it)];
    let normal = |sd: f64| Prior::Normal { mean: 0.0, sd };
    let [strain, even] = both(&|q| matches!(q, Quantity::ReferenceStrain(_)));
    assert!(matches!(strain, Prior::Truncated { .. }), "{strain:?}");
    assert_eq!(even, Prior::Uniform { lower: 0.9, upper: 1.0 });
    assert_eq!(both(&|q| *q == Quantity::Frame(None, 0)), [normal(2.0), normal(0.25)]);
    // frames of a data set: less than a good laboratory's scatter is heard, more has a name
    assert_eq!(both(&|q| *q == Quantity::Frame(Some(0), 0)), [normal(0.5), normal(0.1)]);
    assert_eq!(both(&|q| *q == Quantity::Frame(Some(0), 3)), [normal(1.0), normal(1.0)]);
    assert_eq!([&before, &after].map(|p| p.trials[0].sd), [usual.targets.noise, other.targets.noise]);
}
