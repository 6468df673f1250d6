//! How likely a planned knee is like the intact one, and the test in which it is so least often.

use super::file::{GraftFile, PlanFile};
use super::knee::Asked;
use super::numbers::Numbers;
use super::sampled::Sampled;
use schemars::JsonSchema;
use serde::Serialize;
use sim::coordinate::{AP, Coordinate, IE, VV};
use sim::names::is_of;

/// A chance.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ChanceTold {
    /// What must hold, in words.
    pub of: String,
    /// Share of the samples in which it holds, of those whose intact knee stays on the plateau [-]; absent without samples.
    pub chance: Option<f64>,
    /// In how many samples it holds, and of how many; absent without samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub counts: Option<[usize; 2]>,
    /// Whether it holds in the most probable knee.
    pub most_probable: bool,
    /// Where it fails most often; none where it fails nowhere.
    pub fails: Option<FailTold>,
    /// Whether it is of the test that a cut ligament other than the ACL resists, or a graft in its place: such are told first.
    #[serde(skip)]
    pub is_own: bool,
}

/// The test in which a knee is most often unlike the intact one.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FailTold {
    /// What is done.
    pub test: String,
    /// Flexion [deg].
    pub flexion_deg: f64,
    /// In how many samples it fails there, and of how many whose intact knee stays on the plateau there. Absent without samples: the most probable
    /// knee is furthest off there, in units of the limits, or the first without equilibrium.
    pub samples: Option<[usize; 2]>,
    /// Whether it is a test in which the most probable knee has no equilibrium, and none was asked but that.
    #[serde(skip)]
    pub is_lost: bool,
}

/// What must hold: in these tests each of these coordinates lies within its limit of the intact knee's.
struct Wanted<'a> {
    numbers: &'a Numbers,
    tests: Vec<usize>,
    limits: Vec<(Coordinate, f64)>,
}

impl Wanted<'_> {
    /// How far the most probable knee is off in a test, in units of the limits [-]; none where it has no equilibrium.
    fn off(&self, test: usize) -> Option<f64> {
        let one = |(c, most): &(Coordinate, f64)| {
            let off = self.numbers.best_change(*c, [0, test], [2, test])?.abs();
            // a limit of 0 mm holds where nothing is off
            Some(if off > 0.0 { off / most } else { 0.0 })
        };
        self.limits.iter().map(one).try_fold(0.0, |a: f64, x| Some(a.max(x?)))
    }

    /// Whether a sample holds in a test. One whose intact knee is off the plateau says nothing; one that is off it only with its graft does not hold.
    fn holds(&self, sampled: &Sampled, sample: usize, test: usize) -> Option<bool> {
        let [intact, operated] = [0, 2].map(|state| sampled.reached(sample, [state, test]));
        let is_left_out = intact.is_some() && !sampled.staying(&[[0, test]]).here.contains(&sample);
        let near = |(c, most): &(Coordinate, f64)| {
            let both = intact.zip(operated).filter(|(_, b)| !b.leaves_the_plateau);
            both.is_some_and(|(a, b)| (b.pose[*c] - a.pose[*c]).abs() <= *most)
        };
        (!is_left_out).then(|| self.limits.iter().all(near))
    }

    /// The chance, and where it fails.
    fn told(&self, of: String, asked: &[Asked]) -> ChanceTold {
        let fail = |test: usize, samples: Option<[usize; 2]>| FailTold {
            test: asked[test].kind.to_owned(),
            flexion_deg: asked[test].trial.fe_deg,
            samples,
            is_lost: samples.is_none() && self.off(test).is_none(),
        };
        let best: Vec<f64> = self.tests.iter().map(|t| self.off(*t).unwrap_or(f64::INFINITY)).collect();
        let most_probable = best.iter().all(|x| *x <= 1.0);
        let Some(sampled) = &self.numbers.sampled else {
            let beyond = self.tests.iter().zip(&best).filter(|(_, x)| **x > 1.0);
            // the first of those that are as far off, or have no equilibrium
            let furthest = beyond.max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(a.0)));
            let fails = furthest.map(|(t, _)| fail(*t, None));
            return ChanceTold { of, chance: None, counts: None, most_probable, fails, is_own: false };
        };
        let all: Vec<usize> = (0..sampled.len()).collect();
        let by_test: Vec<Vec<Option<bool>>> =
            self.tests.iter().map(|t| all.iter().map(|s| self.holds(sampled, *s, *t)).collect()).collect();
        let count = |row: &[Option<bool>], wanted: bool| row.iter().filter(|h| **h == Some(wanted)).count();
        // left out of one test, left out of all
        let sum = |s: &usize| {
            let each: Option<Vec<bool>> = by_test.iter().map(|row| row[*s]).collect();
            each.map(|holds| holds.into_iter().all(|h| h))
        };
        let sums: Vec<Option<bool>> = all.iter().map(sum).collect();
        let holding = count(&sums, true);
        let n = holding + count(&sums, false);
        let failing = self.tests.iter().zip(&by_test).map(|(t, row)| (*t, count(row, false), count(row, true)));
        // the first of those in which as many fail
        let worst = failing.filter(|f| f.1 > 0).max_by_key(|f| (f.1, std::cmp::Reverse(f.0)));
        ChanceTold {
            of,
            chance: (n > 0).then(|| holding as f64 / n as f64),
            counts: Some([holding, n]),
            most_probable,
            fails: worst.map(|(t, fails, holds)| fail(t, Some([fails, fails + holds]))),
            is_own: false,
        }
    }
}

/// The chance that a knee is like the intact one in a single test, by all limits; none without samples.
pub(super) fn chance_of(file: &PlanFile, asked: &[Asked], test: usize, numbers: &Numbers) -> Option<ChanceTold> {
    let wanted = Wanted { numbers, tests: vec![test], limits: limits(file).to_vec() };
    numbers.sampled.as_ref()?;
    Some(wanted.told(String::new(), asked))
}

/// How far off a knee may be that is like the intact one.
fn limits(file: &PlanFile) -> [(Coordinate, f64); 3] {
    let (mm, deg) = (file.tests.restored_mm, file.tests.restored_deg);
    [(AP, mm), (IE, deg), (VV, deg)]
}

/// The chances in the order in which they are told.
pub(super) fn in_order(all: &[ChanceTold]) -> impl Iterator<Item = &ChanceTold> {
    all.iter().filter(|c| c.is_own).chain(all.iter().filter(|c| !c.is_own))
}

/// The chances of a plan: of the forward drawer alone, of the pivot shift, of every test, and of what other ligaments than an ACL resist.
pub(super) fn chances(file: &PlanFile, asked: &[Asked], numbers: &Numbers) -> Vec<ChanceTold> {
    let (mm, deg) = (file.tests.restored_mm, file.tests.restored_deg);
    let limits = limits(file);
    let chance = |of: String, limits: &[(Coordinate, f64)], is_meant: &dyn Fn(&Asked) -> bool| {
        let tests = (0..asked.len()).filter(|t| is_meant(&asked[*t])).collect();
        Wanted { numbers, tests, limits: limits.to_vec() }.told(of, asked)
    };
    let own = asked_of(file).into_iter().map(|kind| {
        let (k, unit) = if kind == "posterior drawer" { (0, mm) } else { (2, deg) };
        let of = format!("{kind} within {unit} {} of the intact knee at every flexion", limits[k].0.unit());
        ChanceTold { is_own: true, ..chance(of, &limits[k..=k], &|a| a.kind == kind) }
    });
    let mut all = vec![
        chance(format!("anterior drawer within {mm} mm of the intact knee at every flexion"), &limits[..1], &|a| {
            a.kind == "anterior drawer"
        }),
        chance(format!("pivot shift within {mm} mm and {deg} deg"), &limits, &|a| a.kind == "pivot shift"),
        chance(format!("every loaded test within {mm} mm and {deg} deg"), &limits, &|a| a.kind != "unloaded"),
    ];
    all.extend(own);
    all
}

/// The test that each ligament resists first.
const RESISTS: [(&str, &str); 6] = [
    ("PCL", "posterior drawer"),
    ("sMCL", "valgus"),
    ("dMCL", "valgus"),
    ("POL", "valgus"),
    ("LCL", "varus"),
    ("PFL", "varus"),
];

/// The tests that a plan is about beside an ACL's, each once: by what is cut, and by what a graft has both footprints of.
pub(super) fn asked_of(file: &PlanFile) -> Vec<&'static str> {
    let is_cut = |ligament: &str| file.cut.iter().any(|name| is_of(name, ligament));
    let is_put_in = |ligament: &str| {
        let ends =
            |g: &GraftFile| [&g.femur, &g.tibia].map(|site| site.native.as_ref().is_some_and(|n| is_of(n, ligament)));
        file.graft.iter().any(|g| ends(g) == [true; 2])
    };
    let is_meant = |ligament: &str| is_cut(ligament) || is_put_in(ligament);
    let mut out: Vec<&str> = RESISTS.iter().filter(|(ligament, _)| is_meant(ligament)).map(|(_, test)| *test).collect();
    out.dedup();
    out
}

#[cfg(test)]
mod tests {
    use super::super::file::{EXAMPLE, parsed};
    use super::super::knee::{Found, tests};
    use super::super::sampled::tests::{pose, sampled};
    use super::*;

    #[test]
    fn the_test_that_fails_most_often_is_named_and_left_out_samples_count_nowhere() {
        let file = parsed(EXAMPLE).unwrap();
        let asked: Vec<Asked> =
            tests(&file.tests).into_iter().filter(|a| a.kind == "anterior drawer").take(1).collect();
        let best =
            |off: f64| [0.0, 0.0, off].map(|ap| vec![Some(Found { pose: pose(ap), told: vec![], flags: vec![] })]);
        // of ten samples the graft leaves the last four 5 mm off; the intact knee of the last is off the plateau
        let at = |state: usize, s: usize| pose(if state == 2 && s >= 6 { 5.0 } else { 0.0 });
        let of = sampled(10, &at, &|state, s| state == 0 && s == 9);
        let told = |sampled: Option<Sampled>, off: f64| {
            chances(&file, &asked, &Numbers { best: best(off), sampled }).remove(0)
        };
        let by_samples = told(Some(of), 0.0);
        assert!(by_samples.most_probable && (by_samples.chance.unwrap() - 6.0 / 9.0).abs() < 1e-12, "{by_samples:?}");
        assert_eq!(by_samples.counts, Some([6, 9]));
        let fails = by_samples.fails.unwrap();
        assert_eq!((fails.test.as_str(), fails.flexion_deg, fails.samples), ("anterior drawer", 0.0, Some([3, 9])));
        // without samples it is the most probable knee that fails, or nothing does
        let alone = told(None, 5.0);
        assert!(!alone.most_probable && alone.chance.is_none() && alone.fails.unwrap().samples.is_none());
        assert!(told(None, 1.0).fails.is_none() && told(None, 1.0).most_probable);
    }

    #[test]
    fn a_test_without_equilibrium_is_not_called_furthest_off() {
        let file = parsed(EXAMPLE).unwrap();
        let asked: Vec<Asked> =
            tests(&file.tests).into_iter().filter(|a| a.kind == "anterior drawer").take(3).collect();
        let told = |operated: [Option<f64>; 3]| {
            let found = |ap: f64| Found { pose: pose(ap), told: vec![], flags: vec![] };
            let intact = vec![Some(found(0.0)); 3];
            let best = [intact.clone(), intact, operated.map(|ap| ap.map(found)).to_vec()];
            let fails = chances(&file, &asked, &Numbers { best, sampled: None }).remove(0).fails.unwrap();
            (fails.flexion_deg, fails.is_lost)
        };
        let flexion = |test: usize| asked[test].trial.fe_deg;
        assert_eq!(told([Some(5.0), Some(9.0), Some(9.0)]), (flexion(1), false));
        assert_eq!(told([Some(9.0), None, None]), (flexion(1), true));
    }
}
