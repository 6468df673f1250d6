//! What a calibration's tables and words say of forces.

use super::*;
use crate::unknown::Unknowns;

fn force(bundle: usize, determined: f64, removed: Option<f64>, believed: f64) -> ForceEstimate {
    ForceEstimate {
        trial: "anterior_30".into(),
        bundle,
        value_n: Some(40.0),
        mean_n: Some(40.0),
        mode_n: Some(38.0),
        interval_n: Some([10.0, 80.0]),
        leaving: 0,
        determined,
        removed,
        believed,
        unmeasured: Some([50.0, 0.0, 120.0]),
    }
}

/// A calibration of which nothing but its forces and so many samples is known.
fn calibrated(method: Method, forces: Vec<ForceEstimate>, samples: usize) -> Calibrated {
    let interval = if method == Method::Posterior { 0.9 } else { 0.0 };
    Calibrated {
        method,
        values: vec![],
        cost: 1.0,
        lowest_cost: (1.0, vec![]),
        parameters: vec![],
        others: vec![],
        forces,
        rest: vec![],
        next_tests: vec![],
        noise: vec![],
        noise_scale: Free::all(1.0),
        rms: Free::all(None),
        predicted: vec![],
        elsewhere: vec![],
        rivals: vec![],
        samples: vec![vec![]; samples],
        unknowns: Unknowns { interval, ..Unknowns::default() },
        weighed: None,
        evaluations: 1,
        history: vec![],
        mode: BTreeMap::new(),
        warnings: vec![],
    }
}

#[test]
fn a_share_of_zero_that_is_a_variance_grown_is_told_apart_in_its_own_column() {
    let all = vec![force(0, 0.6, Some(0.6), 0.5), force(1, 0.0, Some(-0.7), 0.5), force(2, 0.0, None, 0.0)];
    let text = forces(&calibrated(Method::Posterior, all, 48), &["ACL_AM".into(), "ACL_PL".into(), "LCL".into()]);
    let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
    let place = |name: &str| rows[0].iter().position(|h| *h == name).unwrap();
    assert_eq!(rows[0].last(), Some(&"removed"), "columns that were there before keep their places");
    assert!(rows.iter().all(|r| r.len() == rows[0].len()));
    let of = |name: &str| rows[1..].iter().map(|r| r[place(name)]).collect::<Vec<_>>();
    assert_eq!(of("determined"), ["0.600", "0.000", "0.000"]);
    assert_eq!(of("removed"), ["0.600", "-0.700", ""]);
}

#[test]
fn words_tell_the_shares_of_data_and_of_beliefs_and_how_far_an_end_errs() {
    let all = || vec![force(0, 0.6, Some(0.6), 0.7), force(1, 0.0, Some(-0.7), 0.1)];
    let text = words_of_forces(&calibrated(Method::Posterior, all(), 48));
    assert!(
        text.contains("measurements removed 30 % of") && text.contains("beliefs about forces had removed 40 %"),
        "{text}"
    );
    assert!(text.contains("errs by 19 % of half of it, by 48 samples"), "{text}");
    let fewer = words_of_forces(&calibrated(Method::Posterior, all(), LEAST));
    assert!(fewer.contains("errs by 37 %"), "fewer samples err by more: {fewer}");
    let few = words_of_forces(&calibrated(Method::Posterior, all(), LEAST - 1));
    assert!(few.contains("11 samples do not tell") && !few.contains("removed 30 %"), "{few}");
    // a recipe has no samples with nothing measured
    let recipe = all().into_iter().map(|f| ForceEstimate { unmeasured: None, ..f }).collect();
    assert_eq!(words_of_forces(&calibrated(Method::SwarmSimplex, recipe, 48)), "");
}
