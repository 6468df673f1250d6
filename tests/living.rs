//! A living knee: a label map, the literature's sites, and displacements as devices read them in vivo. Needs no shared data.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use crate::common::{build_model, json, text};
use tempfile::TempDir;

/// An interval is judged where the truth or its upper end passes this [N].
const TELLING_N: f64 = 5.0;

/// Intervals of 90 % hold the truth of some 55 forces that belong to one knee: fewer than four in five would say that they promise too much.
/// The two sides of an interval are rounded to 1 N.
#[test]
fn displacements_in_vivo_give_forces_whose_intervals_hold_the_truth() {
    let folder = TempDir::new().unwrap();
    let knee = folder.path().join("knee");
    build_model().args(["phantom", "mri-phantom"]).arg(&knee).assert().success();
    let readings = text(&knee.join("laxity/arthrometer.csv"));
    assert!(readings.contains("reference") && readings.lines().skip(1).all(|l| !l.contains(",20.000000,")));
    // cartilage of MRI that lies where its bones lie is not registered: what comes after that stage waits all the same
    build_model().arg(&knee).args(["--to", "register", "--quiet"]).assert().success();
    let done = std::fs::read_dir(knee.join("build")).unwrap().filter(|e| e.as_ref().unwrap().path().is_dir()).count();
    assert_eq!(done, 1, "ingest alone");
    build_model().arg(&knee).args(["--to", "calibrate", "--quiet"]).assert().success();
    let truth = json(&knee.join("truth/laxity.json"));
    let joint = knee.join("build/10-calibrate/joint");
    let (mut held, mut counted) = (0, 0);
    for line in text(&joint.join("forces.csv")).lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let [lower, upper] = [3, 4].map(|k| cells[k].parse::<f64>().unwrap());
        let force = truth["forces_n"][cells[0]][cells[1]].as_f64().unwrap();
        if force.max(upper) > TELLING_N {
            counted += 1;
            held += i32::from((lower - 1.0..=upper + 1.0).contains(&force));
        }
    }
    assert!(counted >= 40 && 5 * held >= 4 * counted, "{held} of {counted}");
    for line in text(&joint.join("parameters.csv")).lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let of = |k: usize| cells[k].parse::<f64>().unwrap();
        let (value, range) = (of(3), [of(6), of(7)]);
        assert!(value > range[0] && value < range[1], "no bound is hit: {line}");
    }
    let next = text(&joint.join("next_tests.csv"));
    let gains: Vec<[f64; 2]> = next
        .lines()
        .skip(1)
        .map(|l| l.split(',').skip(4).map(|x| x.parse().unwrap()).collect::<Vec<f64>>().try_into().unwrap())
        .collect();
    assert!(gains.len() == 5 && gains.iter().all(|[now, after]| after <= now));
    assert!(gains.windows(2).all(|w| w[0][1] <= w[1][1]), "the best first");
}
