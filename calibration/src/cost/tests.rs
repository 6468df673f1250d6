use super::*;
use sim::coordinate::{Free, IE, VV};
use sim::laxity;

const PAGE: &str = include_str!("../../../docs/theory/cost.md");

/// The n-th CSV block of the page.
fn block(n: usize) -> &'static str {
    PAGE.split("```csv\n").nth(n + 1).unwrap().split("```").next().unwrap()
}

fn page() -> (Vec<LaxityTrial>, Vec<Option<Free<f64>>>) {
    let trials = laxity::read(block(0).as_bytes()).unwrap().trials;
    let numbers = |line: &str| -> Free<f64> {
        let cells: Vec<f64> = line.split(',').skip(1).map(|c| c.parse().unwrap()).collect();
        Free(cells.try_into().unwrap())
    };
    (trials, block(1).lines().map(|l| Some(numbers(l))).collect())
}

const CT: PoseSpec = PoseSpec { fe_deg: -6.0, vv_deg: 0.0, ie_deg: 0.0, ml_mm: 0.0, ap_mm: 0.0, si_mm: -22.0 };

#[test]
fn the_worked_example_of_the_page_comes_out() {
    let (trials, mut predicted) = page();
    let f = CostFunction::new(&trials, &CT, &CostOptions::default()).unwrap();
    let cost = f.cost(&predicted);
    assert!((cost.value - 71.25).abs() < 1e-12, "{cost:?}");
    assert!(PAGE.contains("**Cost 71.25.**") && PAGE.contains("5076.5625"));
    // the rows of the page's table, with the page's own numbers
    for (term, error) in f.terms.iter().zip(&cost.errors) {
        let row = PAGE
            .lines()
            .find(|l| {
                let name = format!(
                    "| {} {} | {} |",
                    term.test.name(),
                    term.nominal_flexion_deg,
                    term.coordinate.name().to_uppercase()
                );
                l.starts_with(&name)
            })
            .unwrap();
        let last: f64 = row.trim_end_matches('|').rsplit('|').next().unwrap().trim().parse().unwrap();
        assert!((term.weight * error / term.range - last).abs() < 1e-12, "{row}");
    }
    predicted[3].as_mut().unwrap()[SI] = -42.0;
    assert!((f.cost(&predicted).value - 5076.5625).abs() < 1e-9);
    assert_eq!(f.cost(&predicted).at_limit, [3]);
    predicted[0] = None;
    assert_eq!((f.cost(&predicted).value, f.cost(&predicted).unanswered), (FAILED, vec![0]));
}

#[test]
fn percentiles_are_matlabs() {
    // prctile([1 2 3 4 5], 75) = 4.25; prctile([1 2 3 4 5], [5 10 50 95]) = 1 1 3 5
    let five = [3.0, 1.0, 5.0, 4.0, 2.0];
    assert_eq!([75.0, 5.0, 10.0, 50.0, 95.0].map(|p| percentile(&five, p)), [4.25, 1.0, 1.0, 3.0, 5.0]);
    assert_eq!(percentile(&[7.0], 75.0), 7.0);
}

#[test]
fn what_was_not_measured_does_not_count_and_constant_coordinates_are_refused() {
    let (mut trials, mut predicted) = page();
    let f = CostFunction::new(&trials, &CT, &CostOptions::default()).unwrap();
    let before = f.cost(&predicted).value;
    trials[5].measured[VV] = None;
    predicted[5].as_mut().unwrap()[VV] = 99.0;
    let f = CostFunction::new(&trials, &CT, &CostOptions::default()).unwrap();
    assert!((f.cost(&predicted).value - (before - 20.0)).abs() < 1e-12);
    for t in &mut trials {
        t.measured[IE] = Some(4.0);
    }
    let error = CostFunction::new(&trials, &CT, &CostOptions::default()).unwrap_err().to_string();
    assert!(error.contains("ie_deg is 4 in every trial"), "{error}");
    let bad = CostOptions { percentile: 175.0, ..CostOptions::default() };
    assert!(CostFunction::new(&trials, &CT, &bad).unwrap_err().to_string().contains("cost.percentile"));
}

#[test]
fn a_trial_that_ends_elsewhere_is_not_in_the_misfit() {
    let (trials, mut predicted) = page();
    let whole = rms(&trials, &predicted, &[]);
    [0, 3].iter().for_each(|&i| predicted[i].as_mut().unwrap()[VV] += 40.0);
    assert!(rms(&trials, &predicted, &[]) != whole);
    let left = rms(&trials, &predicted, &[0, 3]);
    predicted[0] = None;
    predicted[3] = None;
    assert_eq!(left, rms(&trials, &predicted, &[]), "as if neither had been asked");
}
