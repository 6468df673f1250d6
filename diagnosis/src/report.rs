//! The values of a report: diagnosis.json.

pub(crate) mod against;
pub mod carried;
pub mod component;
pub mod detection;
pub mod excluded;
pub mod not_excluded;
pub(crate) mod plain;
pub mod plain_unnamed;
pub mod predict;
pub mod preparation;
pub(crate) mod set_aside;
pub(crate) mod unexplained;
pub(crate) mod verdict;
pub mod words;

use crate::criteria::{INTERVAL_90, NAMED};
use crate::effect::candidate::{Candidate, Scope};
use crate::effect::catalogue::Parameter;
use crate::fit::Fit;
use crate::fit::next_test::NextTest;
use crate::problem::Problem;
use crate::problem::trial::NoiseScale;
use crate::search::contradiction::{Contradiction, Witness};
use crate::search::curves::Curve;
use crate::search::map::Cell;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

pub use not_excluded::NotExcluded;

/// How sure the answer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// One answer, weight 0.95 and more, and it predicts trials it has not seen.
    Decisive,
    /// One answer, weight 0.75 and more.
    Probable,
    /// One of several.
    OneOf,
    /// Something is missing that the catalogue does not have.
    Unnamed,
    /// Nothing beyond noise and floor.
    None,
}

/// What an answer was found with: the same model, data, catalogue and program find it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Version of the program.
    pub program: String,
    /// Version of the catalogue.
    pub catalogue: String,
    /// Digest of the model and its surfaces, before anything was added.
    pub model: String,
    /// Digest of each data set's file.
    pub data: BTreeMap<String, String>,
}

/// What a ligament carries in a test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Carried {
    /// The ligament, as in the paper's tables.
    pub ligament: String,
    /// The test in words.
    pub test: String,
    /// With ligaments alone recalibrated [N].
    pub without_n: f64,
    /// With the answer [N].
    pub with_n: f64,
}

/// Force that a structure must have carried in some trial to be missed there [N]. Declared: less is within what calibrations of one knee differ by.
const CARRIED_N: f64 = 40.0;

/// A structure that may be torn, by these trials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MayBeTorn {
    /// The structure.
    pub structure: String,
    /// Log odds of the data for a tear against nothing missing, both refitted, before any prior of a tear [nats].
    pub log_odds: f64,
    /// The most that it carries in a trial in the model as given [N].
    pub given_n: f64,
    /// The most that it carries with the ligaments recalibrated [N].
    pub now_n: f64,
    /// How much slacker its bundles are than in the model as given, the largest change of a reference strain [-].
    pub slack: f64,
    /// What the data hold against the structure as it was given [nats].
    pub against_given: f64,
    /// Whether these data speak against the tear, by odds that tell answers apart.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fits_worse_torn: bool,
    /// Log Bayes factor that a whole tear would earn in such trials, told without noise; of the structures that injuries take most, alone [nats].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub would_earn: Option<f64>,
}

impl MayBeTorn {
    /// Whether the data want it slacker than the model as given, in which it carries what these trials feel, and a tear fits as well. Where a tear fits
    /// worse, calibrations of one knee differ as much: two whole knees of three had such a structure, slack by 1 and 2 %.
    pub fn is_slackened(&self) -> bool {
        !self.fits_worse_torn && self.given_n >= CARRIED_N && self.now_n < self.given_n && self.against_given >= NAMED
    }

    /// Whether such trials would miss a whole tear of it: it earns less than a name takes (`threshold`).
    pub fn would_be_missed(&self, threshold: f64) -> bool {
        self.would_earn.is_some_and(|earns| earns < threshold)
    }
}

/// Trials whose readings lie out of the joint, of which no hypothesis is asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LeftOut {
    /// Data set and name of each.
    pub trials: Vec<String>,
    /// Trials that there are, these included [-].
    pub of: usize,
}

/// The trials that a question was asked without; none where it was asked with all.
pub(crate) fn left_out(problem: &Problem) -> Option<LeftOut> {
    let trials = problem.astray.clone();
    let of = problem.trials.len() + trials.len();
    (!trials.is_empty()).then_some(LeftOut { trials, of })
}

/// A size below which an effect would more often have been missed than named.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DetectionLimit {
    /// The effect.
    pub effect: String,
    /// The structure it is about, where it may be about several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variant: Option<String>,
    /// A data set, or "both".
    pub scope: String,
    /// Its parameter, the others being nothing.
    pub parameter: String,
    /// The size.
    pub size: f64,
    /// Its unit.
    pub unit: String,
}

/// A parameter's value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Value {
    /// Most probable.
    pub value: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Unit.
    pub unit: String,
}

impl Value {
    /// Its 90 % interval, no further than its parameter can be.
    pub fn interval(&self, of: Option<&Parameter>) -> (f64, f64) {
        let [least, most] = of.map_or([f64::NEG_INFINITY, f64::INFINITY], Parameter::can_be);
        let end = |deviations: f64| (self.value + deviations * self.sd).clamp(least, most);
        (end(-INTERVAL_90), end(INTERVAL_90))
    }
}

/// An effect in an answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Named {
    /// Its name.
    pub effect: String,
    /// A data set, or "both".
    pub scope: String,
    /// The structure it is about, where it may be about several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variant: Option<String>,
    /// Its parameters.
    pub parameters: BTreeMap<String, Value>,
}

/// An answer: one effect, or several that act together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Answer {
    /// Its effects.
    pub effects: Vec<Named>,
    /// Share of belief [-].
    pub weight: f64,
    /// Log Bayes factor against nothing missing [-].
    pub log_bayes_factor: f64,
    /// Gain of the held-out log score over nothing missing [-].
    pub held_out_gain: f64,
}

/// The gap on held-out trials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gap {
    /// Mean whitened square of the error with ligaments alone recalibrated [-].
    pub before: f64,
    /// With the effect too [-].
    pub after: f64,
    /// What noise and floor leave; never more than with the effect, though they may leave more [-].
    pub floor: f64,
    /// Share of the gap that is closed [-].
    pub closed: f64,
    /// Root mean square errors before, by coordinate.
    pub rmse_before: BTreeMap<String, f64>,
    /// And after.
    pub rmse_after: BTreeMap<String, f64>,
}

/// The same with an effect that should not help.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Control {
    /// Which.
    pub effect: String,
    /// Share of the gap that it closes [-].
    pub closed: f64,
}

/// Held-out trials and control.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GapReport {
    /// The answer's.
    pub held_out: Gap,
    /// The control's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub control: Option<Control>,
}

/// An effect that these data cannot test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NotTestable {
    /// Its name.
    pub effect: String,
    /// Why.
    pub why: String,
}

/// A trial that jumped: it was set aside.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SetAside {
    /// The trial, with its reading that is furthest off.
    pub at: Witness,
    /// The coordinate of that reading: vv, ie, ml, ap or si.
    pub dof: String,
    /// What the best hypothesis reads there [deg or mm].
    pub expected: f64,
    /// Standard deviation of such readings, noise and floor [deg or mm].
    pub sd: f64,
}

/// Two trials that may have been mixed up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Exchanged {
    /// Data set and name of each.
    pub trials: [String; 2],
    /// Log Bayes factor against the records as they are [-].
    pub log_bayes_factor: f64,
}

/// What the ligaments had taken up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Absorbed {
    /// Bundle or ligament.
    pub bundle: String,
    /// "reference_strain" or "stiffness_n_per_mm".
    pub parameter: String,
    /// Of the model as given.
    pub given: f64,
    /// Recalibrated without the effect.
    pub without: f64,
    /// Recalibrated with it.
    pub with: f64,
    /// Standard deviation with it.
    pub sd: f64,
}

/// What a knee leaves of one data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DataSetAlone {
    /// Data set.
    pub source: String,
    /// Its readings [-].
    pub readings: usize,
    /// Sum of squares that a knee of its own leaves of it, over the number of readings: 1 or less where it fits [-].
    pub alone: f64,
    /// What the ligaments, sites and frames of that knee cost, by their priors, over the same number [-].
    pub cost: f64,
    /// What the one knee of all data sets leaves of it [-].
    pub together: f64,
    /// What the best answer that was found leaves of it [-]; answers of earlier versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub with_best: Option<f64>,
}

/// What stands against a fit as an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// It earns less than a name takes.
    EarnsTooLittle,
    /// It leaves more than noise does, and closes too little of the gap on trials that it was not fitted to.
    LeavesTooMuch,
    /// Beside it something of no name is missing too.
    FieldBeside,
    /// It is not enough better than something of no name in its place.
    FieldInItsPlace,
    /// Two records seem to be exchanged.
    RecordsMixedUp,
}

/// A reading that the best answer that was found leaves most of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Left {
    /// Coordinate: vv, ie, ml, ap or si.
    pub dof: String,
    /// The reading with its place.
    pub reading: Witness,
    /// What that answer gives there [deg or mm].
    pub expected: f64,
    /// What is left over its standard deviation, noise and floor [-].
    pub z: f64,
}

/// What the best fit of an effect, or of several, explains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tried {
    /// The effects.
    pub effects: Vec<Named>,
    /// Share that it closes of what recalibrated ligaments leave beyond noise [-].
    pub closes: f64,
    /// The same on trials that it was not fitted to; of the likeliest, and of all that earn a name [-].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closes_held_out: Option<f64>,
    /// Sum of squares that it leaves, ligaments and frames included, over the number of readings; answers of earlier versions have none [-].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leaves: Option<f64>,
    /// Log Bayes factor against nothing missing [-].
    pub log_bayes_factor: f64,
    /// What stands against it, asked as if it were the answer; empty where nothing does, and in answers of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub against: Vec<Against>,
}

/// Why nothing is named.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Unexplained {
    /// What a knee leaves of each data set; empty where there is one alone.
    pub data_sets: Vec<DataSetAlone>,
    /// Log odds for a knee of its own in each data set against one knee in all [nats].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub two_knees: Option<f64>,
    /// Each effect of the catalogue, fitted from both ends, and the best that was found together; the likeliest first.
    pub tried: Vec<Tried>,
    /// What the best that was found leaves most of, a reading a trial; answers of earlier versions have none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left: Vec<Left>,
}

impl Unexplained {
    /// Whether no effect of the catalogue is enough: each was fitted, and something stands against each. What did not converge proves nothing: where no fit
    /// did, nothing is proven. `nothing`: what is left where nothing is missing, over the number of readings [-].
    pub fn is_proven(&self, nothing: f64) -> bool {
        let is_sound = |t: &&Tried| !plain_unnamed::did_not_converge(t, nothing);
        self.tried.iter().any(|t| is_sound(&t)) && self.tried.iter().all(|t| !t.against.is_empty())
    }
}

/// diagnosis.json.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Diagnosis {
    /// "diagnosis/1".
    pub schema: String,
    /// How sure.
    pub verdict: Verdict,
    /// Rival answers, best first; empty for none and unnamed.
    pub answers: Vec<Answer>,
    /// What the verdict means and what would tell, in plain words; answers of earlier versions have none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub plain: String,
    /// In words.
    pub description: String,
    /// Component files written.
    pub added: Vec<String>,
    /// How far the gap shrinks.
    pub gap: GapReport,
    /// Where the model disagrees, with ligaments recalibrated.
    pub map: Vec<Cell>,
    /// And with the answer added.
    pub map_after: Vec<Cell>,
    /// Where predictions of each condition by all others fail, with ligaments recalibrated.
    pub map_left_out: Vec<Cell>,
    /// Load against displacement where the model disagrees most; answers of earlier versions have none.
    #[serde(default)]
    pub curves: Vec<Curve>,
    /// What could not be tested.
    pub not_testable: Vec<NotTestable>,
    /// Effects of the shipped catalogue that were left out of it.
    #[serde(default)]
    pub without: Vec<String>,
    /// Where nothing is named: sizes of effects that would more often have been missed than named.
    #[serde(default)]
    pub missable: Vec<DetectionLimit>,
    /// Which test would tell the rivals apart.
    pub next_tests: Vec<NextTest>,
    /// Measurement noise as the data have it; answers of earlier versions have none.
    #[serde(default)]
    pub noise: Vec<NoiseScale>,
    /// What the ligaments had taken up.
    pub ligaments: Vec<Absorbed>,
    /// What ligaments carry with ligaments alone recalibrated and with the answer, where there is one; answers of earlier versions have none.
    #[serde(default)]
    pub ligament_forces: Vec<Carried>,
    /// Log Bayes factor that an answer needs here: what simulated nulls stay below, tempered [-].
    pub threshold: f64,
    /// Log Bayes factor of a smooth nameless field beside the best answer [-].
    pub wildcard: f64,
    /// Log Bayes factor of a nameless field in the place of the best answer, against nothing missing [-]; answers of earlier versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wildcard_alone: Option<f64>,
    /// Two trials whose readings fit each other's place, where there are such.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exchanged: Option<Exchanged>,
    /// Trials that were left out, where there are such.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<LeftOut>,
    /// Trials that neither nothing missing nor the best hypothesis explains, where there are such: they were set aside.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set_aside: Vec<SetAside>,
    /// Data sets that were measured before what is asked about.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub before: Vec<String>,
    /// Readings that contradict each other in any knee of the model, the clearest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contradictions: Vec<Contradiction>,
    /// Why nothing is named, where the verdict is `unnamed`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unexplained: Option<Unexplained>,
    /// Where nothing is named: structures that may be torn, or slack, or whose whole tear would be missed; those first that injuries take most.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub may_be_torn: Vec<MayBeTorn>,
    /// What these data do not exclude, the likeliest first, whatever the verdict; answers of earlier versions have none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_excluded: Vec<NotExcluded>,
    /// Whitened sum of squares of nothing missing and of the best hypothesis, over the number of readings [-].
    pub misfit: [f64; 2],
    /// The best hypothesis' effects, whether named or not.
    pub best: Vec<Named>,
    /// Its log Bayes factor against nothing missing [-]; answers of earlier versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub best_log_bayes_factor: Option<f64>,
    /// What it was found with, where the caller told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

/// The effects of a fit with their sizes, as sure as data that speak `temper` times less loud make them.
pub fn named(problem: &Problem, fit: &Fit, temper: f64) -> Vec<Named> {
    let values = fit.parameters(problem.nuisances(), temper);
    fit.hypothesis
        .iter()
        .zip(values)
        .map(|(c, values)| Named {
            effect: c.name(),
            scope: scope_name(problem, c),
            variant: c.variant_name(),
            parameters: c
                .effect
                .parameter
                .iter()
                .zip(values)
                .map(|(p, (value, sd))| (p.key.clone(), Value { value, sd, unit: p.unit.clone() }))
                .collect(),
        })
        .collect()
}

/// "both", or the data set's name.
pub fn scope_name(problem: &Problem, candidate: &Candidate) -> String {
    match candidate.scope {
        Scope::Only(s) => problem.sources[s].clone(),
        Scope::Both => match problem.asked()[..] {
            [only] => problem.sources[only].clone(),
            _ => "both".into(),
        },
    }
}
