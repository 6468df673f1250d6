//! What one asks of a knee first, four questions apart: is the geometry sound, is it calibrated, does it predict what it has not seen, what is missing.

use super::calibrate::{Calibrate, Calibration, MISFIT, MOST_NOISE, PARTLY_NOISE, worst_misfit};
use super::diagnose::{Diagnose, Diagnosed, both_hold};
use super::list::{STAGES, heading};
use super::validate::{PROTOCOLS_END, Validate, predictions};
use super::{Stage, Values};
use crate::cohort::shared::the_rest;
use crate::record::Failure;
use crate::report::check::{Check, at_most};
use calibration::calibrate::Calibrated;
use calibration::posterior::NoiseEstimate;
use diagnosis::report::Verdict;
use stages::assemble::Assembled;

/// How an answer stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Standing {
    /// As it should be.
    Good,
    /// To be looked at.
    Look,
    /// It failed.
    Failed,
    /// Nobody has asked or tested.
    Open,
}

/// A question with its answer in a word and in a sentence.
#[derive(Clone, Debug)]
pub(crate) struct Answer {
    /// The question.
    pub(crate) question: &'static str,
    /// How it stands.
    pub(crate) standing: Standing,
    /// The answer in a word or two.
    pub(crate) word: String,
    /// The answer in sentences that need no manual.
    pub(crate) words: String,
    /// The stage that tells more.
    pub(crate) stage: &'static str,
}

/// Stages that calibrate, predict and diagnose; all before them are geometry.
const LATER: [&str; 3] = [Calibrate::NAME, Validate::NAME, Diagnose::NAME];

/// The four answers. `heavy` are the stages with warnings by which the model may be wrong.
pub(crate) fn answers(v: &Values, checks: &[Check], heavy: &[&str], failure: Option<&Failure>) -> [Answer; 4] {
    [
        geometry(v, checks, heavy, failure),
        calibrated(v, checks, failure),
        predicts(v, checks, failure),
        missing(v, failure),
    ]
}

/// The answer of a stage that failed.
fn failed(question: &'static str, stage: &'static str, failure: Option<&Failure>) -> Option<Answer> {
    let failure = failure.filter(|f| f.stage == stage)?;
    let words = format!("The build stopped at {}; its message stands above.", heading(&failure.stage));
    Some(Answer { question, standing: Standing::Failed, word: "Stopped".into(), words, stage })
}

fn geometry(v: &Values, checks: &[Check], heavy: &[&str], failure: Option<&Failure>) -> Answer {
    let question = "Is the geometry sound?";
    let before = STAGES.iter().map(|s| s.name()).filter(|s| !LATER.contains(s));
    if let Some(answer) = before.clone().find_map(|stage| failed(question, stage, failure)) {
        return answer;
    }
    let bad: Vec<&Check> =
        checks.iter().filter(|c| c.good == Some(false) && before.clone().any(|s| s == c.stage)).collect();
    let warned: Vec<&str> = before.filter(|s| heavy.contains(s) && bad.iter().all(|c| c.stage != *s)).collect();
    let stage = bad.first().map(|c| c.stage).or(warned.first().copied()).unwrap_or("register");
    let answer = |standing, word: &str, words: String| Answer { question, standing, word: word.into(), words, stage };
    if v.of::<Assembled>().is_none() {
        let words = "The build has not come to a whole knee yet.".to_owned();
        return answer(Standing::Open, "Not finished", words);
    }
    if bad.is_empty() && warned.is_empty() {
        let words = "Bones, cartilage and ligament sites are built, and every check of them is within its limit.";
        return answer(Standing::Good, "Yes", words.into());
    }
    let mut words = "Bones, cartilage and ligament sites are built, but not all is as it should be.".to_owned();
    bad.iter().for_each(|c| words += &format!(" {} No: {}.", c.question, c.answer));
    if !warned.is_empty() {
        words += &format!(" Warnings by which the model may be wrong: {}.", warned.join(", "));
    }
    answer(Standing::Look, "Look at it", words)
}

fn calibrated(v: &Values, checks: &[Check], failure: Option<&Failure>) -> Answer {
    let (question, stage) = ("Is it calibrated to this knee?", Calibrate::NAME);
    if let Some(answer) = failed(question, stage, failure) {
        return answer;
    }
    let answer = |standing, word: &str, words: String| Answer { question, standing, word: word.into(), words, stage };
    let Some(calibration) = v.of::<Calibration>() else {
        if v.of::<Assembled>().is_none() {
            return answer(Standing::Open, "Not yet", "There is no model to calibrate yet.".into());
        }
        let words = "The knee is only assembled. No laxity was used, so its ligaments have stiffness and tension from the literature, not those of this knee. Its shape is this knee's; its laxity and ligament forces are not.";
        return Answer { stage: "assemble", ..answer(Standing::Look, "No, only assembled", words.into()) };
    };
    let Some((name, main)) = calibration.main() else {
        let words = "Each data set has a calibration of its own, and there is no joint one: the models below are rivals, none is the knee.";
        return answer(Standing::Look, "Each by itself", words.into());
    };
    let found = &main.found;
    let worst = worst_misfit(found);
    let units = ["deg varus-valgus", "deg rotation", "mm mediolateral", "mm anteroposterior", "mm proximal-distal"];
    let rms: Vec<String> = found.rms.iter().zip(units).filter_map(|(r, u)| r.map(|r| format!("{r:.1} {u}"))).collect();
    let determined = found.parameters.iter().filter(|p| p.determined > 0.5).count();
    let told = main.in_words();
    let rest = the_rest(main.spec.calibrated.as_ref().and_then(|c| c.shared_prior.as_ref()));
    let mut words = format!(
        "One set of ligaments was fitted to {} measured loads ({told}). The model misses the measured positions by {} on average, up to {worst:.1} times the noise that was taken (limit {MOST_NOISE:.0}). The data settle {determined} of {} ligament parameters; {rest}.",
        main.trials.len(),
        rms.join(", "),
        found.parameters.len()
    );
    if !found.elsewhere.is_empty() {
        words += &format!(
            " Under {} of these loads ({}) the model ends in another equilibrium, far from the measured position; they are not in this figure.",
            found.elsewhere.len(),
            found.elsewhere.iter().map(|&i| main.name_of(i)).collect::<Vec<_>>().join(", ")
        );
    }
    let bad: Vec<&Check> = checks
        .iter()
        .filter(|c| {
            c.stage == stage && c.good == Some(false) && c.question != MISFIT && c.model.as_deref() == Some(name)
        })
        .collect();
    bad.iter().for_each(|c| words += &format!(" {} {}.", c.question, c.answer));
    let (standing, word) = match (at_most(worst, MOST_NOISE, 1), at_most(worst, PARTLY_NOISE, 1)) {
        // what no reading settles was not calibrated, however well it fits
        (true, _) if bad.is_empty() && determined > 0 && found.elsewhere.is_empty() => (Standing::Good, "Yes"),
        (true, _) => (Standing::Look, "Yes, but look"),
        (false, true) => (Standing::Look, "Yes, with a misfit"),
        (false, false) => (Standing::Look, "Only partly"),
    };
    if word == "Only partly" {
        words = format!("{} {words}", why_partly(found));
    }
    answer(standing, word, words)
}

/// Coordinates in plain words, by their columns.
const COORDINATES: [(&str, &str); 5] = [
    ("vv_deg", "varus-valgus"),
    ("ie_deg", "rotation"),
    ("ml_mm", "mediolateral position"),
    ("ap_mm", "anteroposterior position"),
    ("si_mm", "proximal-distal position"),
];

/// Why a calibration is only in part one: what it misses most, and what that may come from.
fn why_partly(found: &Calibrated) -> String {
    let share = |n: &&NoiseEstimate| n.inferred / n.stated.max(f64::MIN_POSITIVE);
    let plain = |n: &NoiseEstimate| {
        let named = COORDINATES.iter().find(|(column, _)| *column == n.coordinate);
        named.map_or(n.coordinate.as_str(), |(_, words)| words).to_owned()
    };
    let worst = found.noise.iter().max_by(|a, b| share(a).total_cmp(&share(b)));
    let beyond = found.noise.iter().filter(|n| !at_most(share(n), PARTLY_NOISE, 1)).count();
    let what = match (worst, beyond) {
        (Some(n), 2..) => format!(
            "{beyond} of {} coordinates of the data sets are missed by more than {PARTLY_NOISE:.0} times the noise that was taken, most of all {} in {}",
            found.noise.len(),
            plain(n),
            n.source
        ),
        (Some(n), _) => {
            format!(
                "In {}, {} is missed by more than {PARTLY_NOISE:.0} times the noise that was taken",
                n.source,
                plain(n)
            )
        }
        (None, _) => format!("A coordinate is missed by more than {PARTLY_NOISE:.0} times the noise that was taken"),
    };
    format!(
        "{what}: the model lacks something, the data sets contradict each other, or more noise is in them than was taken."
    )
}

fn predicts(v: &Values, checks: &[Check], failure: Option<&Failure>) -> Answer {
    let (question, stage) = ("Does it predict what it has not seen?", Validate::NAME);
    if let Some(answer) = failed(question, stage, failure) {
        return answer;
    }
    let found = predictions(v);
    let answer = |standing, word: &str, words: String| Answer { question, standing, word: word.into(), words, stage };
    let tested: Vec<bool> = found.iter().filter_map(|p| p.good).collect();
    let words = found.iter().map(|p| p.words.as_str()).collect::<Vec<_>>().join(" ");
    if tested.is_empty() {
        let why = if v.of::<Calibration>().is_some() {
            "Every measurement that there is was used to calibrate it. Measured passive flexion, or a diagnosis (which leaves trials out in turn), would test it."
        } else {
            "Nothing that was measured stands beside what the model says."
        };
        return answer(Standing::Open, "Not tested", format!("{why} {words}").trim().to_owned());
    }
    let bad = tested.iter().filter(|good| !**good).count();
    // what the knee's own protocols could not be run to, or not with all samples, is no prediction
    let main = v.of::<Calibration>().and_then(Calibration::main).map(|(name, _)| name);
    let cut_off = |c: &&Check| c.stage == stage && c.good == Some(false) && c.model.as_deref() == main;
    let odd: Vec<String> = checks.iter().filter(cut_off).map(unsure).collect();
    let words = match odd.as_slice() {
        [] => words,
        all => format!("{words} It is not sure everywhere: {}. Stage {} tells where.", all.join("; "), heading(stage)),
    };
    let (standing, word) = match (tested.len(), bad) {
        (_, 0) if !odd.is_empty() => (Standing::Look, "Yes, but look"),
        (_, 0) => (Standing::Good, "Yes"),
        (all, bad) if bad < all => (Standing::Look, "In part"),
        _ => (Standing::Look, "Not well"),
    };
    answer(standing, word, words)
}

/// What a check of the protocols found, for a reader who has a minute.
fn unsure(check: &Check) -> String {
    match check.question {
        PROTOCOLS_END => "not all protocols run to their end with all samples".to_owned(),
        _ => format!("the two solvers stand {}", check.answer),
    }
}

fn missing(v: &Values, failure: Option<&Failure>) -> Answer {
    let (question, stage) = ("What is missing?", Diagnose::NAME);
    if let Some(answer) = failed(question, stage, failure) {
        return answer;
    }
    let Some(diagnosed) = v.of::<Diagnosed>() else {
        if v.of::<Calibration>().is_none() {
            let words = "What it lacks shows where it is held against measured laxity, which this knee has none of. With a laxity file in specimen.toml the knee is calibrated, and a diagnosis can be asked.";
            return Answer {
                question,
                standing: Standing::Open,
                word: "Cannot be asked".into(),
                words: words.into(),
                stage,
            };
        }
        let words = "A build with --to diagnose asks whether the model or the measurement lacks something, and names it where the data can tell.";
        return Answer { question, standing: Standing::Open, word: "Not asked".into(), words: words.into(), stage };
    };
    let d = &diagnosed.diagnosis;
    let (standing, word) = match d.verdict {
        Verdict::Decisive => (Standing::Look, "Named"),
        Verdict::Probable => (Standing::Look, "Probably named"),
        Verdict::OneOf => (Standing::Look, "One of several"),
        Verdict::Unnamed => (Standing::Look, "Something unnamed"),
        Verdict::None => (Standing::Good, "Nothing that shows"),
    };
    let first = [d.plain.as_str(), &d.description].into_iter().find(|text| !text.is_empty()).unwrap_or_default();
    let sentences = first.lines().flat_map(|line| line.split_inclusive(". ")).map(str::trim);
    let words = sentences.take(2).collect::<Vec<_>>().join(" ") + &both_hold(v, d.verdict).unwrap_or_default();
    Answer { question, standing, word: word.into(), words, stage }
}
