//! Scoring: answers against sealed truths, with intervals.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What an answer said, reduced to what is scored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Said {
    /// The verdict's name.
    pub verdict: String,
    /// Each rival answer's effects with their scopes, best first.
    pub answers: Vec<Vec<(String, String)>>,
    /// Value and standard deviation of the first answer's parameters, by effect and key.
    pub sizes: BTreeMap<(String, String), (f64, f64)>,
    /// Share of the gap closed.
    pub closed: f64,
    /// Effects that it was not allowed to name.
    pub without: Vec<String>,
    /// Log Bayes factor of each rival answer [nats].
    pub evidence: Vec<f64>,
    /// Log Bayes factor of the best that was found, whether it is an answer or not [nats].
    pub best: Option<f64>,
}

impl Said {
    /// By how much a hidden effect's own name explains more [nats], where it may be named (`whole`), than the best that was found without it does; none
    /// where it is in no answer even then.
    fn loses(&self, whole: &Said, effect: &str) -> Option<f64> {
        let named = whole.answers.iter().zip(&whole.evidence).filter(|(a, _)| a.iter().any(|e| e.0 == effect));
        let own = named.map(|(_, e)| *e).max_by(f64::total_cmp)?;
        Some(own - self.best?.max(0.0))
    }
}

/// A share of cases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Share {
    /// Hits.
    pub hits: usize,
    /// Cases.
    pub of: usize,
}

impl Share {
    fn count(&mut self, hit: bool) {
        self.of += 1;
        self.hits += usize::from(hit);
    }

    /// 95 % interval [wilson1927].
    pub fn interval(&self) -> (f64, f64) {
        if self.of == 0 {
            return (0.0, 1.0);
        }
        let (n, z) = (self.of as f64, 1.96f64);
        let p = self.hits as f64 / n;
        let middle = p + z * z / (2.0 * n);
        let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
        let scale = 1.0 + z * z / n;
        (((middle - half) / scale).max(0.0), ((middle + half) / scale).min(1.0))
    }
}

/// A table of scores.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Shares by what they are of.
    pub shares: BTreeMap<String, Share>,
    /// Relative errors of sizes.
    pub size_errors: Vec<f64>,
    /// Shares of the gap closed, strong effects.
    pub closed: Vec<f64>,
    /// Cases that went wrong.
    pub failures: Vec<String>,
}

/// Strata of expected evidence: strong from 10, moderate from 3.
fn stratum(evidence: f64) -> &'static str {
    if evidence >= 10.0 {
        "strong"
    } else if evidence >= 3.0 {
        "moderate"
    } else {
        "weak"
    }
}

/// Evidence that is left where trials that jump are set aside.
fn settled(evidence: f64) -> &'static str {
    match evidence {
        e if e < 10.0 => "below 10 without jumps",
        e if e < 20.0 => "10 to 20 without jumps",
        _ => "from 20 without jumps",
    }
}

/// Family of an effect: misreadings, loads, tissues, muscles, history.
fn family(effect: &str) -> char {
    match effect {
        "femur_frame" | "tibia_frame" | "flexion_offset" | "origin_shift" => 'M',
        "load_bias"
        | "load_gain"
        | "load_sign"
        | "load_misalign"
        | "joint_compression"
        | "apparatus_compliance"
        | "cuff_softening"
        | "gravity" => 'L',
        "quad_passive" | "ham_tone" | "gastroc_tone" | "itb" | "guarding_reflex" => 'U',
        "friction" | "viscoelastic" | "preconditioning" | "drift" => 'H',
        _ => 'T',
    }
}

/// Scores answers against truths; of cases whose effect was struck from the catalogue also by what the catalogue lost with it, where `whole` has an
/// answer that might name it.
pub fn score(cases: &[(crate::laboratory::Truth, Said)], whole: &BTreeMap<String, Said>) -> Score {
    let mut out = Score::default();
    for (truth, said) in cases {
        one(&mut out, truth, said);
        let hidden = truth.effects.first().filter(|e| said.without.contains(&e.0) && said.best.is_some());
        if let (Some((effect, _, _)), Some(whole)) = (hidden, whole.get(&truth.case)) {
            let lost = lost(said.loses(whole, effect));
            let share = out.shares.entry(format!("struck, {lost}: flagged")).or_default();
            share.count(said.verdict == "unnamed");
        }
    }
    out
}

/// What a catalogue lost with a name: strong evidence starts at 10.
fn lost(nats: Option<f64>) -> &'static str {
    match nats {
        None => "not found by its own name either",
        Some(e) if e < 2.3 => "another does as well (to 2.3 nats)",
        Some(e) if e < 10.0 => "another does nearly as well (to 10)",
        Some(_) => "none does nearly as well (from 10)",
    }
}

fn one(out: &mut Score, truth: &crate::laboratory::Truth, said: &Said) {
    let mut hit = |key: String, ok: bool| out.shares.entry(key).or_default().count(ok);
    let first: Vec<&String> = said.answers.first().map(|a| a.iter().map(|e| &e.0).collect()).unwrap_or_default();
    let has = |e: &String| said.answers.iter().flatten().any(|a| a.0 == *e);
    let sure = said.verdict == "decisive";
    let mut wrong = false;
    match truth.kind.as_str() {
        "null" => {
            wrong = said.verdict != "none";
            hit("null: alarmed".into(), wrong);
        }
        // drawn among all of them, or made by its own name: no catalogue has it
        kind if kind == "unknown" || kind.starts_with("x_") => {
            let flagged = said.verdict == "unnamed";
            hit("not in the catalogue: flagged".into(), flagged);
            hit("not in the catalogue: misnamed".into(), sure);
            hit(format!("{}, not in the catalogue: flagged", stratum(truth.strength.expected_evidence)), flagged);
            wrong = sure;
        }
        "compound" => {
            let right = truth.effects.iter().filter(|e| has(&e.0)).count();
            hit("compound: one right".into(), right >= 1);
            hit("compound: both right".into(), right >= 2);
        }
        _ => {
            let Some((effect, scope, parameters)) = truth.effects.first() else { return };
            let s = stratum(truth.strength.expected_evidence);
            if said.without.contains(effect) {
                hit(format!("{s}, struck from the catalogue: flagged"), said.verdict == "unnamed");
                hit(format!("{s}, struck from the catalogue: misnamed"), sure);
                return;
            }
            let named = first.contains(&effect);
            wrong = sure && !named;
            hit(format!("{s}: named first"), named);
            hit(format!("{s}, {}: named first", settled(truth.strength.settled_evidence)), named);
            hit(format!("{s}: family first"), first.iter().any(|e| family(e) == family(effect)));
            if !said.answers.is_empty() {
                hit(format!("{s}: in the set, where one is reported"), has(effect));
            }
            hit(format!("{s}: confidently wrong"), wrong);
            if named {
                let right = said.answers[0].iter().any(|a| a.0 == *effect && a.1 == *scope);
                hit(format!("{s}: scope right"), right);
                for (key, true_value) in parameters {
                    if let Some((value, sd)) = said.sizes.get(&(effect.clone(), key.clone())) {
                        out.size_errors.push((value - true_value).abs() / true_value.abs().max(1e-9));
                        hit(format!("{s}: 90 % interval covers"), (value - true_value).abs() <= 1.645 * sd);
                    }
                }
                if s == "strong" {
                    out.closed.push(said.closed);
                }
            }
        }
    }
    if wrong {
        out.failures.push(format!(
            "{}: {} answered {} {:?}",
            truth.case,
            truth.kind,
            said.verdict,
            said.answers.first()
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laboratory::{Strength, Truth};

    #[test]
    fn an_effect_that_may_not_be_named_is_to_be_flagged() {
        let truth = Truth {
            case: "a".into(),
            kind: "itb".into(),
            effects: vec![("itb".into(), "kla".into(), BTreeMap::new())],
            ligaments: BTreeMap::new(),
            contact_scale: 1.0,
            forces_n: BTreeMap::default(),
            beyond: BTreeMap::new(),
            frames: BTreeMap::new(),
            signature: vec![],
            strength: Strength { expected_evidence: 30.0, settled_evidence: 12.0, ..Strength::default() },
        };
        let unnamed = Said { verdict: "unnamed".into(), ..Said::default() };
        let struck = Said { without: vec!["itb".into()], ..unnamed.clone() };
        let score = score(&[(truth.clone(), struck), (truth, unnamed)], &BTreeMap::new());
        let share = |key: &str| score.shares.get(key).copied();
        assert_eq!(share("strong, struck from the catalogue: flagged"), Some(Share { hits: 1, of: 1 }));
        assert_eq!(share("strong, struck from the catalogue: misnamed"), Some(Share { hits: 0, of: 1 }));
        // the same answer where the name was free is a miss
        assert_eq!(share("strong: named first"), Some(Share { hits: 0, of: 1 }));
        assert_eq!(share("strong, 10 to 20 without jumps: named first"), Some(Share { hits: 0, of: 1 }));
    }

    #[test]
    fn what_no_catalogue_has_is_to_be_flagged_however_it_was_asked_for() {
        let strength = |e: f64| Strength { expected_evidence: e, ..Strength::default() };
        let truth = |kind: &str, evidence: f64| Truth {
            case: "a".into(),
            kind: kind.into(),
            effects: vec![("x_adhesion".into(), "kla".into(), BTreeMap::new())],
            ligaments: BTreeMap::new(),
            contact_scale: 1.0,
            forces_n: BTreeMap::default(),
            beyond: BTreeMap::new(),
            frames: BTreeMap::new(),
            signature: vec![],
            strength: strength(evidence),
        };
        let said = |verdict: &str| Said { verdict: verdict.into(), ..Said::default() };
        let score = score(
            &[
                (truth("unknown", 30.0), said("unnamed")),
                (truth("x_adhesion", 30.0), said("none")),
                (truth("x_adhesion", 2.0), said("decisive")),
            ],
            &BTreeMap::new(),
        );
        let share = |key: &str| score.shares.get(key).copied();
        assert_eq!(share("not in the catalogue: flagged"), Some(Share { hits: 1, of: 3 }));
        assert_eq!(share("strong, not in the catalogue: flagged"), Some(Share { hits: 1, of: 2 }));
        assert_eq!(share("not in the catalogue: misnamed"), Some(Share { hits: 1, of: 3 }));
        assert_eq!(share("strong: named first"), None);
    }

    #[test]
    fn a_struck_effect_counts_by_what_the_catalogue_lost_with_it() {
        let truth = |case: &str| Truth {
            case: case.into(),
            kind: "itb".into(),
            effects: vec![("itb".into(), "kla".into(), BTreeMap::new())],
            ligaments: BTreeMap::new(),
            contact_scale: 1.0,
            forces_n: BTreeMap::default(),
            beyond: BTreeMap::new(),
            frames: BTreeMap::new(),
            signature: vec![],
            strength: Strength::default(),
        };
        let struck = |verdict: &str, best: f64| Said {
            verdict: verdict.into(),
            without: vec!["itb".into()],
            best: Some(best),
            ..Said::default()
        };
        let name = |effect: &str| vec![(effect.to_owned(), "kla".to_owned())];
        let whole = |own: f64| Said {
            answers: vec![name("ham_tone"), name("itb")],
            evidence: vec![own + 1.0, own],
            ..Said::default()
        };
        let silent = Said { verdict: "none".into(), ..Said::default() };
        let wholes = [("a", whole(30.0)), ("b", whole(30.0)), ("c", whole(9.0)), ("d", silent)];
        let wholes = wholes.into_iter().map(|(case, said)| (case.to_owned(), said)).collect();
        let answers = [struck("unnamed", 12.0), struck("probable", 25.0), struck("none", -3.0), struck("none", -3.0)];
        let cases: Vec<_> =
            ["a", "b", "c", "d", "e"].into_iter().map(truth).zip(answers.iter().cloned().cycle()).collect();
        let score = score(&cases, &wholes);
        let share = |key: &str| score.shares.get(&format!("struck, {key}: flagged")).copied();
        assert_eq!(share("none does nearly as well (from 10)"), Some(Share { hits: 1, of: 1 }));
        // 5 nats of the name; 9 of it, since what explains less than nothing is no rival
        assert_eq!(share("another does nearly as well (to 10)"), Some(Share { hits: 0, of: 2 }));
        assert_eq!(share("not found by its own name either"), Some(Share { hits: 0, of: 1 }));
        // nobody has answered e with the whole catalogue
        assert_eq!(score.shares.keys().filter(|k| k.starts_with("struck, ")).count(), 3);
    }

    #[test]
    fn intervals_hold_the_share_and_widen_for_few() {
        let few = Share { hits: 3, of: 4 };
        let many = Share { hits: 300, of: 400 };
        assert!(few.interval().0 < 0.75 && few.interval().1 > 0.75);
        assert!(many.interval().1 - many.interval().0 < few.interval().1 - few.interval().0);
    }
}
