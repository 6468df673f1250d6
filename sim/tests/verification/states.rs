//! Trials of a knee in which ligaments were cut.
use crate::verification::rig::Rig;
use sim::coordinate::{FREE, Load};
use sim::laxity::{LaxityTrial, Test, TrialResult, read, results_csv};
use sim::trials::{TrialOptions, solve_trial, solve_trials};

/// A trial of a cut knee is the same trial of the model without the ligament, beside trials of the whole one, and its file says so.
#[test]
fn a_trial_of_a_cut_knee_is_that_of_the_model_without_the_ligament() {
    let (model, options) = (Rig::knee().compiled(), TrialOptions::default());
    let asked = |name: &str, without: &[String]| LaxityTrial {
        without: without.to_vec(),
        ..LaxityTrial::asked(name.into(), Test::Anterior, 0.0, Load::new(0.0, 0.0, 0.0, 20.0, 50.0))
    };
    let whole = solve_trial(&model, &asked("whole", &[]), &options).unwrap();
    let most = (0..whole.forces_n.len()).max_by(|a, b| whole.forces_n[*a].total_cmp(&whole.forces_n[*b])).unwrap();
    let cut = [model.bundle_names()[most].clone()];
    let trials = [asked("whole", &[]), asked("cut", &cut), asked("again", &[])];
    let all: Vec<_> = solve_trials(&model, &trials, &options).into_iter().map(Result::unwrap).collect();
    let other = model.without(&cut).unwrap();
    assert_eq!(all[1].pose, solve_trial(&other, &trials[0], &options).unwrap().pose);
    assert_eq!(all[1].pose, solve_trial(&model, &trials[1], &options).unwrap().pose);
    assert_eq!([&all[0].pose, &all[2].pose], [&whole.pose; 2]);
    assert!(whole.forces_n[most] > 1.0 && all[1].forces_n[most] == 0.0, "{} N", whole.forces_n[most]);
    assert!(FREE.into_iter().any(|c| (whole.predicted()[c] - all[1].predicted()[c]).abs() > 0.05));
    let (trial, pose) = (trials[1].clone(), all[1].pose);
    let result = TrialResult { trial, pose, forces_n: vec![], outputs: vec![], flags: vec![], bands: vec![] };
    assert_eq!(read(results_csv(&[], &[result]).as_bytes()).unwrap().trials[0].without, cut);
    let told = solve_trial(&model, &asked("x", &["ACXL".into()]), &options).unwrap_err().to_string();
    assert!(told.contains("trial x: column \"without\": no bundle is named \"ACXL\""), "{told}");
}
