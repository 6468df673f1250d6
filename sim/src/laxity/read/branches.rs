//! Loading and unloading, told from the load in the order of the rows.

use crate::laxity::{Branch, LaxityTrial, TESTS, Test};

/// A load that turns round by less than this share of its test's largest is noise [-]: load cells are good to a hundredth. Ours.
const NOISE_SHARE: f64 = 0.02;

/// Loading while the load of a test grows from row to row at one flexion, unloading while it falls. A row alone has no branch.
pub(super) fn branches(trials: &mut [LaxityTrial]) {
    let noise = TESTS.map(|(test, _)| (test, NOISE_SHARE * largest(trials, test)));
    let mut start = 0;
    while start < trials.len() {
        let first = &trials[start];
        let of_one = |t: &LaxityTrial| t.test == first.test && t.nominal_flexion_deg == first.nominal_flexion_deg;
        let end = start + trials[start..].iter().take_while(|t| of_one(t)).count();
        let (test, axis) = (first.test, first.test.coordinate());
        if let Some(axis) = axis.filter(|_| end - start > 1) {
            let loads: Vec<f64> = trials[start..end].iter().map(|t| t.load[axis].abs()).collect();
            let noise = noise.iter().find(|(t, _)| *t == test).map_or(0.0, |(_, n)| *n);
            for (t, grows) in trials[start..end].iter_mut().zip(growing(&loads, noise)) {
                t.branch = Some(if grows { Branch::Loading } else { Branch::Unloading });
            }
        }
        start = end;
    }
}

/// The largest load of a test.
fn largest(trials: &[LaxityTrial], test: Test) -> f64 {
    let loads = trials.iter().filter(|t| t.test == test).filter_map(|t| Some(t.load[test.coordinate()?].abs()));
    loads.fold(0.0, f64::max)
}

/// Whether a load was growing, row by row, where it turns round by more than its noise. The first row was reached from below.
fn growing(loads: &[f64], noise: f64) -> Vec<bool> {
    let Some(first) = loads.first() else { return Vec::new() };
    let moved = loads.iter().find(|x| (*x - first).abs() > noise);
    let mut up = moved.is_none_or(|x| x > first);
    let mut out = vec![up; loads.len()];
    let mut furthest = 0;
    for (k, load) in loads.iter().enumerate() {
        let beyond = if up { load - loads[furthest] } else { loads[furthest] - load };
        if beyond >= 0.0 {
            furthest = k;
        } else if -beyond > noise {
            up = !up;
            out[furthest + 1..].fill(up);
            furthest = k;
        }
    }
    out[0] = true;
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coordinate::Load;

    /// Drawers up to 100 N and back, twice, in so many rows a way, under noise [N].
    fn drawers(rows: usize, noise: f64) -> (Vec<LaxityTrial>, Vec<bool>) {
        let ways = [true, false, true, false];
        let each = ways.iter().flat_map(|up| (1..=rows).map(move |k| (*up, k as f64 / rows as f64)));
        let made = each.enumerate().map(|(n, (up, share))| {
            let load = 10.0 + 90.0 * if up { share } else { 1.0 - share };
            let load = load + if n % 2 == 0 { noise } else { -noise };
            (LaxityTrial::asked(format!("r{n}"), Test::Anterior, 30.0, Load::new(0.0, 0.0, 0.0, load, 20.0)), up)
        });
        made.unzip()
    }

    #[test]
    fn noise_turns_no_branch_round() {
        // steps of 0.036 N under noise of 0.5 N: each second row goes against the way
        for (rows, noise) in [(4, 0.0), (40, 0.5), (2500, 0.5)] {
            let (mut trials, ways) = drawers(rows, noise);
            branches(&mut trials);
            let told = trials.iter().map(|t| t.branch == Some(Branch::Loading));
            let wrong = told.zip(&ways).filter(|(told, way)| told != *way).count();
            // where a way ends its last rows lie within the noise
            let at_turns = 3.0 * 2.0 * noise / (90.0 / rows as f64);
            assert!(wrong as f64 <= at_turns, "{wrong} of {} rows, {rows} a way", trials.len());
        }
    }

    #[test]
    fn branches_count_within_a_test_and_a_flexion() {
        let at = |test: Test, flexion: f64, ap: f64| {
            LaxityTrial::asked(format!("{flexion} {ap}"), test, flexion, Load::new(0.0, 0.0, 0.0, ap, 20.0))
        };
        let (a, p) = (Test::Anterior, Test::Posterior);
        let mut trials = vec![
            at(a, 30.0, 50.0),
            at(a, 30.0, 100.0),
            at(a, 30.0, 100.0),
            at(a, 30.0, 40.0),
            at(p, 30.0, -100.0),
            at(p, 30.0, -40.0),
            at(a, 60.0, 20.0),
            at(Test::Neutral, 60.0, 0.0),
        ];
        branches(&mut trials);
        let (up, down) = (Some(Branch::Loading), Some(Branch::Unloading));
        let told: Vec<Option<Branch>> = trials.iter().map(|t| t.branch).collect();
        assert_eq!(told, [up, up, up, down, up, down, None, None]);
    }
}
