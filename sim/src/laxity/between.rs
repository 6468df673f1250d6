//! Whether the data sets of one knee are two, and agree about its sides and zeros.

use super::{LaxityTrial, SignDoubt, Test};
use crate::coordinate::{AP, Coordinate, Free, IE, ML, SI, VV};
use std::collections::{BTreeMap, BTreeSet};

/// A data set: its name and its trials.
pub type Named<'a> = (&'a str, &'a [LaxityTrial]);

/// Means of a coordinate by test and nominal flexion [deg].
type Means = BTreeMap<(Test, i64), f64>;

/// Tests at a flexion that both sets hold, from which on they are compared. Ours: fewer agree by chance.
const LEAST_SHARED: usize = 5;
/// Correlation of a coordinate over shared tests below which one set is turned [-]. Ours: noise alone gives less than half of that of a turn.
const TURNED: f64 = -0.4;
/// A coordinate that moves by less shows no side [mm]: the noise of a good apparatus is 0.2.
const LEAST_SPREAD_MM: f64 = 0.25;
/// Zeros of two apparatuses on one knee lie nearer than these: VV, IE [deg], ML, AP, SI [mm]. Digitised axes agree within 2 mm and 3 deg,
/// and a foot's zero is set by eye; three times these. Ours.
const MOST_OFFSET: [(Coordinate, f64); 5] = [(VV, 4.0), (IE, 10.0), (ML, 3.5), (AP, 6.0), (SI, 3.5)];
/// Rotations per load of two apparatuses on one knee differ by less than this factor [-]; a hand-held one and a robot differ by 1.5 on a published knee. Ours.
const MOST_LOOSER: f64 = 1.7;
/// Forward drawers per load of two apparatuses on one knee differ by less than this factor [-]. Ours: of two published knees and three phantoms by 1.6.
const MOST_LOOSER_DRAWER: f64 = 1.9;
/// A force of less along AP is none, as a robot's that tests another coordinate [N].
const NO_DRAWER_N: f64 = 10.0;
/// A drawer of less in all shows no factor [mm].
const LEAST_DRAWER_MM: f64 = 0.5;
/// Share of the larger load that the smaller one must be for ranges to be compared: a knee stiffens [-]. Ours.
const COMPARABLE_LOAD: f64 = 0.6;
/// Flexions from which on one can go to the other side than the others.
const LEAST_FLEXIONS_OF_ONE: usize = 3;
/// The correlation of one flexion with the others below which it is turned [-]. In 164 flexions of published and simulated files it is 0.27 and more.
/// Five tests of noise have one below -0.4 in a quarter of all flexions. Ours.
const TURNED_THERE: f64 = -0.6;
/// ML of one flexion, and of the others in the mean, moves by more than this [mm]: twice the noise of a hand-held apparatus. Ours.
const LEAST_SPREAD_THERE_MM: f64 = 0.8;
/// Flexions at which an offset must be the same way. Ours: at one alone the knee may differ.
const LEAST_FLEXIONS: usize = 2;

/// Readings, flexions and loads that differ by less are the same [deg, mm, N m, N]: one file by coordinates and by poses differs in the last digits
/// that were written. Ours.
const SAME: f64 = 1e-3;

/// The first two data sets that hold the same measurements: one file was given twice. Names of trials may differ.
pub fn repeated<'a>(sets: &[Named<'a>]) -> Option<[&'a str; 2]> {
    let near = |x: f64, y: f64| (x - y).abs() < SAME;
    let same = |a: &LaxityTrial, b: &LaxityTrial| {
        let loads = a.load.iter().zip(b.load.iter()).all(|(x, y)| near(*x, *y));
        let readings = a.measured.iter().zip(b.measured.iter()).all(|both| match both {
            (Some(x), Some(y)) => near(*x, *y),
            (x, y) => x.is_none() && y.is_none(),
        });
        a.test == b.test && near(a.fe_deg, b.fe_deg) && loads && readings
    };
    let told = |trials: &[LaxityTrial]| trials.iter().any(|t| t.measured.iter().any(|m| m.is_some_and(|x| x != 0.0)));
    let mut pairs = sets.iter().enumerate().flat_map(|(k, a)| sets[k + 1..].iter().map(move |b| (a, b)));
    pairs
        .find(|(a, b)| told(a.1) && a.1.len() == b.1.len() && a.1.iter().zip(b.1).all(|(s, t)| same(s, t)))
        .map(|(a, b)| [a.0, b.0])
}

/// What two data sets of one knee contradict each other in: a side that is turned, a zero that is shifted. Displacements have no zero, and are
/// left out. A knee that was cut is no measure of the whole one.
pub fn between(sets: &[Named]) -> Vec<SignDoubt> {
    let pairs = sets.iter().enumerate().flat_map(|(k, a)| sets[k + 1..].iter().map(move |b| (*a, *b)));
    let pairs = pairs.filter(|(a, b)| state(a) == state(b));
    let of_pair = |(a, b): (Named, Named)| {
        let drawer = looser_drawer(a, b);
        // a column in another unit lies off as well
        let explained = |d: &SignDoubt| drawer.as_ref().is_none_or(|known| known.column != d.column);
        let offsets: Vec<SignDoubt> = offsets(a, b).into_iter().filter(explained).collect();
        side(a, b).into_iter().chain(offsets).chain(drawer).chain(looser(a, b)).collect::<Vec<_>>()
    };
    pairs.flat_map(of_pair).collect()
}

/// What was cut in a data set.
fn state<'a>(set: &Named<'a>) -> &'a [String] {
    set.1.first().map_or(&[], |t| &t.without)
}

/// A coordinate's means in both sets, where both have them.
fn shared(a: Named, b: Named, c: Coordinate) -> Vec<((Test, i64), [f64; 2])> {
    let [of_a, of_b] = [means(a.1, c), means(b.1, c)];
    of_a.into_iter().filter_map(|(key, x)| of_b.get(&key).map(|y| (key, [x, *y]))).collect()
}

fn means(trials: &[LaxityTrial], c: Coordinate) -> Means {
    let mut groups: BTreeMap<(Test, i64), Vec<f64>> = BTreeMap::new();
    for t in trials.iter().filter(|t| t.reference.is_none()) {
        if let Some(value) = t.measured[c] {
            groups.entry((t.test, t.nominal_flexion_deg.round() as i64)).or_default().push(value);
        }
    }
    groups.into_iter().map(|(key, values)| (key, mean(&values))).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Whether the tibia goes to the other side in one set. No test loads ML, so that its own loads do not show its sign.
fn side(a: Named, b: Named) -> Option<SignDoubt> {
    let all = shared(a, b, ML);
    turned(&all, LEAST_SPREAD_MM, TURNED).map(|r| SignDoubt {
        column: ML.column(),
        words: format!(
            "laxity.{} and laxity.{}: in the {} tests that both hold ml_mm goes to the other side in one of them (correlation {r:.2}): its sign is turned there. Expected lateral +: {} for that file",
            a.0,
            b.0,
            all.len(),
            DECLARE_MEDIAL
        ),
    })
}

/// What to declare of an ML that is turned.
const DECLARE_MEDIAL: &str = "declare columns.ml_mm = { name = \"...\", positive = \"medial\" }";

/// Whether the tibia goes to the other side than a model's does: `answers` to the trials of one set, in their order. Where ML is turned in every
/// set of a knee, only its bones show it.
pub fn against_model(trials: &[LaxityTrial], answers: &[Option<Free<f64>>]) -> Option<SignDoubt> {
    let both = trials.iter().zip(answers).filter_map(|(t, a)| Some((t, a.as_ref()?)));
    let answered = |(t, a): (&LaxityTrial, &Free<f64>)| {
        let predicted = LaxityTrial { measured: Free::from_fn(|c| t.measured[c].map(|_| a[c])), ..t.clone() };
        (t.clone(), predicted)
    };
    let (measured, predicted): (Vec<LaxityTrial>, Vec<LaxityTrial>) = both.map(answered).unzip();
    let all = shared(("", &measured), ("", &predicted), ML);
    turned(&all, LEAST_SPREAD_MM, TURNED).map(|r| SignDoubt {
        column: ML.column(),
        words: format!(
            "ml_mm goes to the other side than the calibrated model's in {} tests (correlation {r:.2}): its sign is turned, or the side of the knee. Expected lateral +: {DECLARE_MEDIAL}",
            all.len()
        ),
    })
}

/// Whether the tibia goes to the other side at one flexion than at the others of the same data set.
pub(super) fn side_of_a_flexion(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let all = means(trials, ML);
    let flexions: BTreeSet<i64> = all.keys().filter(|(test, _)| *test != Test::Neutral).map(|(_, at)| *at).collect();
    let beside = |at: i64| {
        let one = |(test, here): (&(Test, i64), &f64)| {
            let others = flexions.iter().filter(|other| **other != at).map(|other| all.get(&(test.0, *other)).copied());
            Some((*test, [*here, mean(&others.collect::<Option<Vec<f64>>>()?)]))
        };
        all.iter().filter(|((_, there), _)| *there == at).filter_map(one).collect::<Vec<_>>()
    };
    let there = |at: &i64| Some((*at, turned(&beside(*at), LEAST_SPREAD_THERE_MM, TURNED_THERE)?));
    let found = flexions.iter().filter(|_| flexions.len() >= LEAST_FLEXIONS_OF_ONE).filter_map(there);
    // one that is turned makes the mean of the others small beside each of the rest
    let (at, r) = found.min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(SignDoubt {
        column: ML.column(),
        words: format!(
            "ml_mm goes to the other side at {at} deg than at the other flexions (correlation {r:.2} over the tests): was its sign turned there? Expected lateral + throughout"
        ),
    })
}

/// The correlation of two sets about the mean of each flexion, where both spread by more than `least` [mm] and it is below `most`: one is turned.
fn turned(all: &[((Test, i64), [f64; 2])], least: f64, most: f64) -> Option<f64> {
    let centred: Vec<[f64; 2]> = all
        .iter()
        .map(|((_, flexion), values)| {
            let here = |k: usize| all.iter().filter(|g| g.0.1 == *flexion).map(|g| g.1[k]).collect::<Vec<_>>();
            [0, 1].map(|k| values[k] - mean(&here(k)))
        })
        .collect();
    let product = |i: usize, j: usize| centred.iter().map(|v| v[i] * v[j]).sum::<f64>();
    let spread = [0, 1].map(|k| (product(k, k) / all.len().max(1) as f64).sqrt());
    let r = product(0, 1) / (product(0, 0) * product(1, 1)).sqrt();
    (all.len() >= LEAST_SHARED && spread.iter().all(|s| *s > least) && r < most).then_some(r)
}

/// Coordinates whose zeros differ alike at every flexion.
fn offsets(a: Named, b: Named) -> Vec<SignDoubt> {
    let one = |(c, most): (Coordinate, f64)| {
        let all = shared(a, b, c);
        let mut by_flexion: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
        all.iter().for_each(|((_, flexion), [x, y])| by_flexion.entry(*flexion).or_default().push(x - y));
        let steps: Vec<f64> = by_flexion.values().map(|v| mean(v)).collect();
        let alike = steps.iter().all(|s| *s > most) || steps.iter().all(|s| *s < -most);
        (all.len() >= LEAST_SHARED && steps.len() >= LEAST_FLEXIONS && alike).then(|| SignDoubt {
            column: c.column(),
            words: format!(
                "laxity.{} and laxity.{}: {} of the first lies {:+.1} {unit} from that of the second in the mean, by more than {most} {unit} at every flexion: one of them has an offset, counted from another zero or a shifted frame. Expected poses of one tibia in one frame of the femur",
                a.0,
                b.0,
                c.column(),
                mean(&steps),
                unit = c.unit()
            ),
        })
    };
    MOST_OFFSET.into_iter().filter_map(one).collect()
}

/// Rotations that both sets test both ways: one set's are far larger for their loads at every flexion.
fn looser(a: Named, b: Named) -> Vec<SignDoubt> {
    let one = |c: Coordinate| {
        let [of_a, of_b] = [both_ways(a.1, c), both_ways(b.1, c)];
        let shared = of_a.iter().filter_map(|(flexion, x)| of_b.get(flexion).map(|y| (*x, *y)));
        let alike = |[_, x]: [f64; 2], [_, y]: [f64; 2]| x.min(y) >= COMPARABLE_LOAD * x.max(y);
        let pairs: Vec<([f64; 2], [f64; 2])> = shared.filter(|(x, y)| alike(*x, *y)).collect();
        let factors: Vec<f64> = pairs.iter().map(|(x, y)| (x[0] / x[1]) / (y[0] / y[1])).collect();
        let (more, less) = (factors.iter().all(|f| *f > MOST_LOOSER), factors.iter().all(|f| f * MOST_LOOSER < 1.0));
        let (x, y) = pairs.first().filter(|_| more || less)?;
        Some(SignDoubt {
            column: c.column(),
            words: format!(
                "laxity.{} and laxity.{}: {} moves by {:.0} {unit} under {:.1} {load} both ways in the first and by {:.0} {unit} under {:.1} {load} in the second, and differs so at every flexion: is one of them in another unit, or counted twice, or of another knee?",
                a.0,
                b.0,
                c.column(),
                x[0],
                x[1],
                y[0],
                y[1],
                unit = c.unit(),
                load = c.load_unit()
            ),
        })
    };
    [IE, VV].into_iter().filter_map(one).collect()
}

/// Forward drawers that are far larger for their loads in one set, over all flexions that both test.
fn looser_drawer(a: Named, b: Named) -> Option<SignDoubt> {
    let [of_a, of_b] = [drawers(a.1), drawers(b.1)];
    let shared = of_a.iter().filter_map(|(flexion, x)| of_b.get(flexion).map(|y| [*x, *y]));
    let alike = |[[_, p], [_, q]]: &[[f64; 2]; 2]| p.min(*q) >= COMPARABLE_LOAD * p.max(*q);
    let pairs: Vec<[[f64; 2]; 2]> = shared.filter(alike).collect();
    let sum = |set: usize, of: usize| pairs.iter().map(|pair| pair[set][of]).sum::<f64>();
    let [(x, p), (y, q)] = [0, 1].map(|set| (sum(set, 0), sum(set, 1)));
    let factor = (x / p) / (y / q);
    let shown = x > LEAST_DRAWER_MM && y > LEAST_DRAWER_MM;
    (shown && factor.max(factor.recip()) > MOST_LOOSER_DRAWER).then(|| {
        let n = pairs.len() as f64;
        let words = format!(
            "laxity.{} and laxity.{}: ap_mm moves forwards by {:.1} mm under {:.0} N in the first and by {:.1} mm under {:.0} N in the second, in the mean of {n} flexions: is one of them in another unit (in, cm), or counted twice, or of another knee?",
            a.0,
            b.0,
            x / n,
            p / n,
            y / n,
            q / n
        );
        SignDoubt { column: AP.column(), words }
    })
}

/// The largest forward drawer [mm] from the middle of the trials without one, and its force [N], by nominal flexion [deg].
fn drawers(trials: &[LaxityTrial]) -> BTreeMap<i64, [f64; 2]> {
    let mut positions: BTreeMap<i64, Vec<[f64; 2]>> = BTreeMap::new();
    for t in trials.iter().filter(|t| t.reference.is_none()) {
        if let Some(x) = t.measured[AP] {
            positions.entry(t.nominal_flexion_deg.round() as i64).or_default().push([t.load[AP], x]);
        }
    }
    let drawer = |(flexion, of): (i64, Vec<[f64; 2]>)| {
        let [force, end] = of.iter().copied().max_by(|a, b| a[0].total_cmp(&b[0])).filter(|f| f[0] > NO_DRAWER_N)?;
        let mut rest: Vec<f64> = of.iter().filter(|p| p[0].abs() < NO_DRAWER_N).map(|p| p[1]).collect();
        rest.sort_by(f64::total_cmp);
        Some((flexion, [end - rest.get(rest.len() / 2)?, force]))
    };
    positions.into_iter().filter_map(drawer).collect()
}

/// Range of a coordinate in its own tests and the lesser of the largest loads both ways, by nominal flexion [deg], where both ways are loaded.
fn both_ways(trials: &[LaxityTrial], c: Coordinate) -> BTreeMap<i64, [f64; 2]> {
    let mut ends: BTreeMap<i64, [Option<(f64, f64)>; 2]> = BTreeMap::new();
    for t in trials.iter().filter(|t| t.reference.is_none() && t.test.coordinate() == Some(c) && t.load[c] != 0.0) {
        let Some(x) = t.measured[c] else { continue };
        let way = usize::from(t.load[c] > 0.0);
        let end = &mut ends.entry(t.nominal_flexion_deg.round() as i64).or_default()[way];
        if end.is_none_or(|(load, _)| t.load[c].abs() > load) {
            *end = Some((t.load[c].abs(), x));
        }
    }
    let both = |(flexion, [low, high]): (i64, [Option<(f64, f64)>; 2])| {
        let ((p, x), (q, y)) = (low?, high?);
        (y != x).then_some((flexion, [(y - x).abs(), p.min(q)]))
    };
    ends.into_iter().filter_map(both).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coordinate::{FREE, Load};

    /// A drawer at some flexions.
    fn made() -> Vec<LaxityTrial> {
        let one = |fe: f64| {
            let load = Load::from_fn(|c| if c == AP { 60.0 } else { 0.0 });
            let mut trial = LaxityTrial::asked(format!("at_{fe}"), Test::Anterior, fe, load);
            trial.measured = Free::from_fn(|c| Some(fe / 10.0 + c.index() as f64));
            trial
        };
        [0.0, 30.0, 60.0].map(one).to_vec()
    }

    /// Last digits make no other measurement; what an apparatus can tell apart does.
    #[test]
    fn one_file_is_found_again_whatever_its_last_digits_are() {
        let a = made();
        let found = |change: &dyn Fn(&mut LaxityTrial)| {
            let mut b = a.clone();
            change(&mut b[1]);
            repeated(&[("one", &a), ("other", &b)]).is_some()
        };
        for sign in [-1.0, 1.0] {
            assert!(found(&|t| t.fe_deg += sign * SAME / 2.0) && !found(&|t| t.fe_deg += sign * SAME * 2.0));
            for c in FREE {
                let moved = |by: f64| found(&|t| t.measured[c] = t.measured[c].map(|x| x + sign * by));
                assert!(moved(SAME / 2.0) && !moved(SAME * 2.0), "{c}");
                assert!(!found(&|t| t.load[c] += sign), "{c}");
                assert!(!found(&|t| t.measured[c] = None), "{c}");
            }
        }
    }
}
