//! Scoring: answers against sealed truths, with intervals.

use crate::asked::Hidden;
use crate::cuts;
use crate::laboratory::Truth;
use crate::reliability::{bins, calibration_error};
use std::collections::BTreeMap;

pub use crate::said::{Said, Score};
pub use crate::share::Share;

/// Regret up to which a search has found what there is [nats]. Declared: a fit ends where a step gains less than a twentieth of a nat, and starts of two
/// fits of one hypothesis leave up to a nat between them.
const FOUND: f64 = 2.0;

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
        | "strap_tissue"
        | "foot_turn"
        | "load_axis"
        | "gravity" => 'L',
        "quad_passive" | "ham_tone" | "gastroc_tone" | "itb" | "guarding_reflex" => 'U',
        "friction" | "viscoelastic" | "preconditioning" | "drift" => 'H',
        _ => 'T',
    }
}

/// Scores answers against truths; of cases whose effect was struck from the catalogue also by what the catalogue lost with it, where `whole` has an
/// answer that might name it.
pub fn score(cases: &[(Truth, Said)], whole: &BTreeMap<String, Said>) -> Score {
    let mut out = Score::default();
    let believed: Vec<(f64, bool)> = cases.iter().flat_map(|(truth, said)| said.believed(truth)).collect();
    out.reliability = bins(&believed);
    out.calibration_error = calibration_error(&out.reliability);
    for (truth, said) in cases {
        one(&mut out, truth, said);
        cuts::count(&mut out, truth, said);
        if let Some(regret) = said.regret {
            let strength = stratum(truth.strength.expected_evidence);
            for of in ["regret".to_owned(), format!("{strength}: regret")] {
                out.shares.entry(format!("{of} of {FOUND:.0} nats or less")).or_default().count(regret <= FOUND);
            }
            out.regrets.push(regret);
        }
        let hidden = truth.effects.first().filter(|e| said.is_struck(&e.0) && said.best.is_some());
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

/// Whether a bench's knee and laboratory are what the analysis supposes.
fn class(truth: &Truth) -> Option<&'static str> {
    let differs = truth.differs.as_ref()?;
    Some(if differs.is_empty() { "if the model is right" } else { "when it is not" })
}

/// One effect of the catalogue, or one that was struck from it; whether the answer is confidently wrong.
fn single(out: &mut Score, truth: &Truth, said: &Said) -> bool {
    let mut hit = |key: String, ok: bool| out.shares.entry(key).or_default().count(ok);
    let first: Vec<&String> = said.answers.first().map(|a| a.iter().map(|e| &e.0).collect()).unwrap_or_default();
    let has = |e: &String| said.answers.iter().flatten().any(|a| a.0 == *e);
    let sure = said.verdict == "decisive";
    let Some((effect, scope, parameters)) = truth.effects.first() else { return false };
    let s = stratum(truth.strength.expected_evidence);
    if said.is_struck(effect) {
        hit(format!("{s}, struck from the catalogue: flagged"), said.verdict == "unnamed");
        hit(format!("{s}, struck from the catalogue: misnamed"), sure);
        return false;
    }
    let named = first.contains(&effect);
    let wrong = sure && !named;
    hit(format!("{s}: named first"), named);
    hit(format!("{s}: in the first three"), said.answers.iter().take(3).flatten().any(|a| a.0 == *effect));
    if s == "strong" {
        hit(format!("strong, {effect}: named first"), named);
    }
    hit(format!("{s}, {}: named first", settled(truth.strength.settled_evidence)), named);
    hit(format!("{s}: family first"), first.iter().any(|e| family(e) == family(effect)));
    if !said.answers.is_empty() {
        hit(format!("{s}: in the set, where one is reported"), has(effect));
    }
    hit(format!("{s}: confidently wrong"), wrong);
    if let Some(class) = class(truth) {
        hit(format!("{class}: confidently wrong"), wrong);
    }
    if named {
        let hidden = Hidden { effect: effect.clone(), parameters: parameters.clone() };
        if let (Some(of), Some(told)) = (hidden.variant(), said.variants.get(effect)) {
            hit(format!("{s}: structure or axis right"), of == told);
        }
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
    wrong
}

fn one(out: &mut Score, truth: &Truth, said: &Said) {
    let mut hit = |key: String, ok: bool| out.shares.entry(key).or_default().count(ok);
    let has = |e: &String| said.answers.iter().flatten().any(|a| a.0 == *e);
    let sure = said.verdict == "decisive";
    let mut wrong = false;
    match truth.kind.as_str() {
        "null" => {
            wrong = said.verdict != "none";
            hit("null: alarmed".into(), wrong);
            if let Some(class) = class(truth) {
                hit(format!("null, {class}: alarmed"), wrong);
            }
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
        _ => wrong = single(out, truth, said),
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
    use crate::laboratory::Strength;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

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
            differs: None,
            signature: vec![],
            strength: Strength { expected_evidence: 30.0, settled_evidence: 12.0, ..Strength::default() },
            out_of_joint: vec![],
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
            differs: None,
            signature: vec![],
            strength: strength(evidence),
            out_of_joint: vec![],
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
            differs: None,
            signature: vec![],
            strength: Strength::default(),
            out_of_joint: vec![],
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

    /// A truth: name, kind, hidden effects with scopes, expected evidence, and in what its bench differs.
    fn truth(kind: &str, effects: &[(&str, &str)], evidence: f64, differs: &[&str]) -> Truth {
        let hidden = |(e, s): &(&str, &str)| ((*e).to_owned(), (*s).to_owned(), BTreeMap::new());
        Truth {
            case: kind.into(),
            kind: kind.into(),
            effects: effects.iter().map(hidden).collect(),
            ligaments: BTreeMap::new(),
            contact_scale: 1.0,
            forces_n: BTreeMap::default(),
            beyond: BTreeMap::new(),
            frames: BTreeMap::new(),
            differs: Some(differs.iter().map(|d| (*d).to_owned()).collect()),
            signature: vec![],
            strength: Strength { expected_evidence: evidence, ..Strength::default() },
            out_of_joint: vec![],
        }
    }

    /// An answer: verdict, and rivals of one effect each with their weights.
    fn said(verdict: &str, rivals: &[(&str, &str, f64)]) -> Said {
        Said {
            verdict: verdict.into(),
            answers: rivals.iter().map(|(e, s, _)| vec![((*e).to_owned(), (*s).to_owned())]).collect(),
            weights: rivals.iter().map(|r| r.2).collect(),
            ..Said::default()
        }
    }

    /// A list whose figures are counted from how it is made: of each ten single effects, right ones are first, second and fourth; of nulls, each fifth
    /// alarms where the model is right and each second where it is not. A seed shuffles them.
    #[test]
    fn every_figure_of_a_made_list_of_answers_is_as_it_was_made() {
        let itb = |scope: &str, evidence: f64| truth("itb", &[("itb", scope)], evidence, &[]);
        let right = ("itb", "kla", 0.85);
        let rival = |name: &'static str, weight: f64| (name, "kla", weight);
        let mut list = Vec::new();
        for k in 0..40 {
            let rivals = match k % 10 {
                0..=5 => vec![right, rival("ham_tone", 0.15)],
                6 | 7 => vec![rival("ham_tone", 0.55), ("itb", "kla", 0.45)],
                8 => vec![rival("a", 0.3), rival("b", 0.3), rival("c", 0.2), ("itb", "kla", 0.2)],
                _ => vec![rival("gravity", 0.96)],
            };
            let verdict = match k % 10 {
                0..=5 => "probable",
                9 => "decisive",
                _ => "one_of",
            };
            list.push((itb("kla", 20.0), said(verdict, &rivals)));
        }
        for k in 0..20 {
            for (differs, every) in [(&[][..], 5), (&["wide"][..], 2)] {
                let answer = if k % every == 0 { said("probable", &[("itb", "rks", 0.75)]) } else { said("none", &[]) };
                list.push((truth("null", &[], 0.0, differs), answer));
            }
        }
        let mut random = ChaCha8Rng::seed_from_u64(9);
        for k in (1..list.len()).rev() {
            list.swap(k, (random.random::<f64>() * (k + 1) as f64) as usize);
        }
        let score = score(&list, &BTreeMap::new());
        let expected = [
            ("strong: named first", 24, 40),
            ("strong, itb: named first", 24, 40),
            ("strong: in the first three", 32, 40),
            ("strong: in the set, where one is reported", 36, 40),
            ("strong: confidently wrong", 4, 40),
            ("strong: scope right", 24, 24),
            ("null: alarmed", 14, 40),
            ("null, if the model is right: alarmed", 4, 20),
            ("null, when it is not: alarmed", 10, 20),
            ("if the model is right: confidently wrong", 4, 40),
        ];
        for (name, hits, of) in expected {
            assert_eq!(score.shares.get(name), Some(&Share { hits, of }), "{name}");
        }
        // all answers by tenths of weight: tenth, weight, right, all
        let bins =
            [(1, 0.15, 0, 24), (2, 0.2, 4, 8), (3, 0.3, 0, 8), (4, 0.45, 8, 8), (5, 0.55, 0, 8), (7, 0.75, 0, 14)];
        let bins: Vec<_> = bins.into_iter().chain([(8, 0.85, 24, 24), (9, 0.96, 0, 4)]).collect();
        assert_eq!(score.reliability.len(), bins.len());
        for (bin, (tenth, weight, hits, of)) in score.reliability.iter().zip(&bins) {
            assert!(
                (bin.from - f64::from(*tenth) / 10.0).abs() < 1e-9 && (bin.weight - weight).abs() < 1e-9,
                "{bin:?}"
            );
            assert_eq!(bin.right, Share { hits: *hits, of: *of }, "{bin:?}");
        }
        let apart: f64 = bins.iter().map(|(_, w, hits, of)| (w * *of as f64 - *hits as f64).abs()).sum();
        let all: usize = bins.iter().map(|b| b.3).sum();
        assert!((score.calibration_error.unwrap() - apart / all as f64).abs() < 1e-9);
        // Wilson's interval of 4 in 20, from a table
        let (low, high) = score.shares["null, if the model is right: alarmed"].interval();
        assert!((low - 0.0807).abs() < 5e-4 && (high - 0.4160).abs() < 5e-4, "{low} {high}");
    }

    #[test]
    fn a_search_that_stays_behind_the_truth_is_counted_where_that_was_asked() {
        let of = |evidence: f64| truth("itb", &[("itb", "kla")], evidence, &[]);
        let behind = |regret: Option<f64>| Said { regret, ..said("probable", &[("itb", "kla", 0.8)]) };
        let list = [(20.0, Some(0.0)), (20.0, Some(2.5)), (5.0, Some(1.9)), (20.0, None)];
        let list: Vec<_> = list.into_iter().map(|(evidence, regret)| (of(evidence), behind(regret))).collect();
        let score = score(&list, &BTreeMap::new());
        let share = |name: &str| score.shares.get(name).copied();
        assert_eq!(share("regret of 2 nats or less"), Some(Share { hits: 2, of: 3 }));
        assert_eq!(share("strong: regret of 2 nats or less"), Some(Share { hits: 1, of: 2 }));
        assert_eq!(score.regrets, [0.0, 2.5, 1.9]);
        // nobody asked: no row of it
        let silent = super::score(&list[3..], &BTreeMap::new());
        assert!(silent.regrets.is_empty() && silent.shares.keys().all(|name| !name.contains("regret")));
    }

    #[test]
    fn a_cut_of_one_ligament_that_is_told_as_anothers_is_counted() {
        let mut of = truth("cut_PCL", &[("structure_loss", "both")], 30.0, &[]);
        of.effects[0].2 = [("loss".to_owned(), 1.0), ("structure".to_owned(), 1.0)].into();
        let named = |structure: &str| Said {
            variants: [("structure_loss".to_owned(), structure.to_owned())].into(),
            ..said("decisive", &[("structure_loss", "both", 0.99)])
        };
        let score = score(&[(of.clone(), named("PCL")), (of, named("ACL"))], &BTreeMap::new());
        assert_eq!(score.shares["strong: structure or axis right"], Share { hits: 1, of: 2 });
    }

    #[test]
    fn an_answer_is_right_where_it_says_what_is_hidden_and_nothing_beside() {
        let of = truth("compound", &[("itb", "kla"), ("meniscus", "both")], 30.0, &[]);
        let pair = |e: &str, s: &str| (e.to_owned(), s.to_owned());
        assert!(Said::is_right(&[pair("meniscus", "both"), pair("itb", "kla")], &of));
        for wrong in [
            vec![pair("itb", "kla")],
            vec![pair("itb", "rks"), pair("meniscus", "both")],
            vec![pair("itb", "kla"), pair("meniscus", "both"), pair("gravity", "kla")],
        ] {
            assert!(!Said::is_right(&wrong, &of), "{wrong:?}");
        }
        let struck = Said { without: vec!["itb".into()], ..said("probable", &[("gravity", "kla", 0.8)]) };
        assert!(struck.believed(&of).is_empty());
        let sites = Said { without: vec!["attachment".into()], ..Said::default() };
        assert!(sites.is_struck("attachment_ACL") && sites.is_struck("attachment") && !sites.is_struck("itb"));
    }
}
