//! A case of a knee that is drawn until it holds together. A knee that is cut has to hold together while it is whole.

use super::copied::unlike;
use super::hard::Hard;
use crate::error::BuildError;
use blindbench::hidden::is_cut;
use blindbench::knee::KneeInput;
use blindbench::laboratory::{Case, Planned, Ways, make_by};
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

/// Tells the noise of the day before from that of the day of a case.
const OTHER_DAY: u64 = 0x27d4_eb2f;
/// Tells the draws of the laboratory's knee from those of its day.
const UNLIKE: u64 = 0x5bd1_e995;
/// Tells one draw of a case's knee from the next.
const AGAIN: u64 = 0x9e37_79b9_7f4a_7c15;
/// Most draws of a case's knee, and of one of wide laws or other surfaces [-].
const DRAWS: [u64; 2] = [50, 300];
/// A knee that opens further than this in varus or valgus in a laxity test is torn or dislocated [deg]; intact knees open by 3 to 8.
const INTACT_DEG: f64 = 20.0;
/// Knees, whole while they are not cut, of which a cut is tried [-]. Ours: a few.
const CUT_DRAWS: usize = 3;
/// Share of a data set's trials out of their joint from which a cut knee is no test [-]. Ours: a diagnosis keeps such trials, as if frames were off.
const APART: f64 = 0.5;
/// A bundle that carries more than this in a drawer of 133 N is nobody's [N]: the cruciates carry about the drawer itself.
const INTACT_N: f64 = 300.0;

/// What is drawn: the name of the case, the trials, the kind with its size, the laboratory.
pub(super) struct Asked<'a> {
    pub(super) name: &'a str,
    pub(super) plan: &'a [Planned],
    pub(super) kind: (&'a str, f64),
    pub(super) hard: &'a Hard,
}

/// A case as it was drawn.
pub(super) struct Drawn {
    pub(super) case: Case,
    /// What the same knee read before, where that was asked for.
    pub(super) first: Option<Case>,
    /// Knees before this one that were no test, since they came out of their joint once they were cut [-].
    pub(super) apart: usize,
}

/// What came of one knee.
enum Tried {
    /// It is no knee.
    NoKnee,
    /// A knee once, and out of its joint once it was cut: trials of each data set, and how many there are.
    Apart(Vec<(String, [usize; 2])>),
    Holds(Box<Case>),
}

/// A case of the model's knee. A model that says what it does not know is not its knee: the laboratory's differs from it by that much. Such a knee, and one
/// of wide laws or other surfaces, is drawn until it is one that holds together. One that is out of its joint once it is cut is no test: another is drawn,
/// a few times.
///
/// Errors: no such knee; `Ok(Err(..))` where every cut knee is no test, with the reason.
pub(super) fn drawn(
    (spec, input): (&ModelSpec, &KneeInput),
    asked: &Asked,
    seed: u64,
) -> Result<Result<Drawn, String>, BuildError> {
    let by = unlike(spec);
    let ways = asked.hard.ways(by.is_some());
    let is_copy = by.is_none() && !asked.hard.draws_knees();
    let draws = DRAWS[usize::from(asked.hard.draws_knees())];
    let mut apart = 0;
    for draw in 0..draws {
        let seed = seed.wrapping_add(draw.wrapping_mul(AGAIN));
        let knee = by.as_ref().map_or_else(|| input.clone(), |by| input.unlike(by, &ways.spread, seed ^ UNLIKE));
        let knee = asked.hard.surfaces_of(knee, seed);
        match asked.tried(&knee, is_copy, (seed, &ways))? {
            Tried::NoKnee => {}
            Tried::Holds(case) => {
                let first = asked.before(&knee, (seed, &ways))?;
                return Ok(Ok(Drawn { case: *case, first, apart }));
            }
            Tried::Apart(of) => {
                apart += 1;
                if apart == CUT_DRAWS {
                    return Ok(Err(no_test(asked, &of)));
                }
            }
        }
    }
    Err(BuildError::File(format!(
        "{}: none of {draws} knees that were drawn holds together (varus and valgus within {INTACT_DEG} deg, bundles below {INTACT_N} N)",
        asked.name
    )))
}

impl Asked<'_> {
    fn tried(&self, knee: &KneeInput, is_copy: bool, by: (u64, &Ways)) -> Result<Tried, BuildError> {
        let is_cut = is_cut(self.kind.0);
        // of a knee that is cut all is asked while it is whole: that costs less, and cut it may open wide
        if !is_copy && (is_cut || self.hard.draws_knees()) && self.carries_too_much(knee, by)? {
            return Ok(Tried::NoKnee);
        }
        if !is_copy && is_cut && !holds(&self.whole(knee, self.plan, by)?) {
            return Ok(Tried::NoKnee);
        }
        let case = self.made(knee, (self.plan, self.kind), by)?;
        Ok(match apart(&case, self.plan) {
            Some(of) => Tried::Apart(of),
            None if is_copy || is_cut || holds(&case) => Tried::Holds(Box::new(case)),
            None => Tried::NoKnee,
        })
    }

    /// What the same knee read before, whole, on another day; none where nobody asked.
    fn before(&self, knee: &KneeInput, (seed, ways): (u64, &Ways)) -> Result<Option<Case>, BuildError> {
        let day = Ways { day: OTHER_DAY, ..ways.clone() };
        self.hard.has_before().then(|| self.whole(knee, self.plan, (seed, &day))).transpose()
    }

    /// Whether one trial tells already that a knee carries too much, as many do that are drawn widely.
    fn carries_too_much(&self, knee: &KneeInput, by: (u64, &Ways)) -> Result<bool, BuildError> {
        let one = self.plan.get(..1).unwrap_or(self.plan);
        Ok(carries(&self.whole(knee, one, by)?) > INTACT_N)
    }

    fn whole(&self, knee: &KneeInput, plan: &[Planned], by: (u64, &Ways)) -> Result<Case, BuildError> {
        self.made(knee, (plan, ("null", 1.0)), by)
    }

    fn made(
        &self,
        knee: &KneeInput,
        (plan, kind): (&[Planned], (&str, f64)),
        (seed, ways): (u64, &Ways),
    ) -> Result<Case, BuildError> {
        make_by(knee, plan, self.name, kind, (seed, ways)).map_err(|e| BuildError::File(e.to_string()))
    }
}

/// Whether a case is of a knee that holds together.
fn holds(case: &Case) -> bool {
    let opens = case.readings.iter().map(|r| r[0].abs()).fold(0.0, f64::max);
    opens <= INTACT_DEG && carries(case) <= INTACT_N
}

/// The most that a bundle of a case's knee carries in a drawer, without effects [N].
fn carries(case: &Case) -> f64 {
    case.truth.forces_n.values().flat_map(|t| t.values().copied()).fold(0.0, f64::max)
}

/// Trials of each data set in which a knee lies out of its joint, and how many there are; none where that leaves a test.
pub(crate) fn apart(case: &Case, plan: &[Planned]) -> Option<Vec<(String, [usize; 2])>> {
    let mut of: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for (k, trial) in plan.iter().enumerate() {
        let [out, all] = of.entry(&trial.source).or_default();
        *out += usize::from(case.truth.out_of_joint.contains(&k));
        *all += 1;
    }
    let is_lost = of.values().any(|[out, all]| *out as f64 >= APART * *all as f64);
    is_lost.then(|| of.into_iter().map(|(source, counts)| (source.to_owned(), counts)).collect())
}

/// Why a case is no test.
fn no_test(asked: &Asked, of: &[(String, [usize; 2])]) -> String {
    let each: Vec<String> =
        of.iter().map(|(source, [out, all])| format!("{out} of {all} trials of {source}")).collect();
    format!(
        "{} ({}) is no test: each of {CUT_DRAWS} knees lies out of its joint once it is cut, the last in {}. Take smaller loads, or cut a share (--size).",
        asked.name,
        asked.kind.0,
        each.join(" and ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A case of four trials, two a data set, of which some are out of joint.
    fn case(out_of_joint: &[usize]) -> (Case, Vec<Planned>) {
        let truth = serde_json::json!({
            "case": "a", "kind": "cut_ACL", "effects": [], "ligaments": {}, "contact_scale": 1.0, "signature": [],
            "strength": {"raw_rms_sd": 1.0}, "out_of_joint": out_of_joint
        });
        let trial = |source: &str| Planned {
            source: source.into(),
            condition: "anterior 30".into(),
            flexion_deg: 30.0,
            load: [0.0; 5],
            sd: [0.5, 0.5, 0.4, 0.4, 0.4],
        };
        let plan = ["kla", "kla", "kla", "rks", "rks", "rks"].map(trial).to_vec();
        (Case { readings: vec![[0.0; 5]; plan.len()], truth: serde_json::from_value(truth).unwrap() }, plan)
    }

    #[test]
    fn a_cut_knee_is_no_test_where_half_of_a_data_set_or_more_lies_out_of_its_joint() {
        for (out, is_test) in [(vec![], true), (vec![0, 3], true), (vec![0, 2], false), (vec![3, 4, 5], false)] {
            let (case, plan) = case(&out);
            assert_eq!(apart(&case, &plan).is_none(), is_test, "{out:?}");
        }
        let (case, plan) = case(&[0, 1, 3]);
        let of = apart(&case, &plan).unwrap();
        assert_eq!(of, [("kla".to_owned(), [2, 3]), ("rks".to_owned(), [1, 3])]);
    }
}
