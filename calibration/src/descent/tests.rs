use super::*;
use crate::cost::{CostFunction, CostOptions};
use crate::design::Design;
use crate::toy;
use sim::spec::PoseSpec;

const CT: PoseSpec = PoseSpec { fe_deg: 0.0, vv_deg: 0.0, ie_deg: 0.0, ml_mm: 0.0, ap_mm: 0.0, si_mm: -20.0 };

#[test]
fn the_descent_reaches_the_truth_and_stays_in_the_box() {
    let design = Design::table3();
    let mut trials = toy::trials();
    let truth: Vec<f64> = (0..26).map(|k| 0.1 + 0.8 * f64::from(k * 7 % 26) / 25.0).collect();
    let blank = trials.clone();
    for (i, t) in trials.iter_mut().enumerate() {
        t.measured = toy::answer(&design, &blank, &design.at(&truth), i).unwrap().predicted.map(Some);
    }
    let simulate = |values: &[f64], _: bool| toy::answers(&design, &blank, values);
    let experiment = Experiment { design: &design, simulate: &simulate, trials: trials.len() };
    let cost = CostFunction::new(&trials, &CT, &CostOptions::default()).unwrap();
    let trust = Trust { radius: 0.2, least: 1e-5, evaluations: 60 };
    let found = descend(&experiment, &cost, &[0.5; 26], trust).unwrap();
    assert!(found.cost < 0.02 * found.history[0], "{:?}", found.history);
    assert!(found.point.iter().all(|x| (0.0..=1.0).contains(x)));
    assert_eq!(found.history.len(), found.history.iter().filter(|c| c.is_finite()).count());
}

#[test]
fn the_toys_slopes_are_those_of_differences() {
    let (design, trials) = (Design::table3(), toy::trials());
    let values = design.at(&[0.4; 26]);
    let simulate = |values: &[f64], _: bool| toy::answers(&design, &trials, values);
    let differences = crate::experiment::with_differences(&simulate, &design, 1e-5);
    let (exact, near) =
        (simulate(&values, true).swap_remove(7).unwrap(), differences(&values, true).swap_remove(7).unwrap());
    for (a, b) in exact.slopes.unwrap().predicted.iter().zip(near.slopes.unwrap().predicted) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6 * a.abs().max(1.0)));
    }
}
