//! The answer in plain words, before any number of statistics: what it means, and what would tell.

mod clauses;
mod none;

use crate::criteria::WORTH_TELLING;
use crate::effect::catalogue::Catalogue;
use crate::fit::next_test::NextTest;
use crate::report::not_excluded::in_words;
use crate::report::plain_unnamed::{
    closing, closing_most, contradictions, contradictions_beside, leaves_most, meaning, noise,
};
use crate::report::set_aside::in_words as trial_in_words;
use crate::report::words::{figures, from_before, next_tells};
use crate::report::{Answer, Carried, Diagnosis, LeftOut, SetAside, Verdict};
use clauses::{bare, capital, effect};
use none::{nearest, nothing, open_tears};
use std::fmt::Write;

/// Flexion up to which a forward drawer is a Lachman test [deg].
const LACHMAN_DEG: f64 = 30.0;
/// Ligament force in the report's tests from which it is told as unlikely [N]: twice the drawer of 133 N. Ours: in cadavers the ACL carries about the load of a
/// drawer [sakane1997].
const UNLIKELY_N: f64 = 267.0;

/// Trials that are told by their rows in the head, at most [-].
const ROWS_IN_HEAD: usize = 3;

/// The head of a diagnosis in plain words: what it means first; then a line for each thing to know or to do.
pub(crate) fn plain(catalogue: &Catalogue, d: &Diagnosis) -> String {
    let mut out = match d.verdict {
        // what to do comes second: a record that jumped before all else
        Verdict::None => nothing(d) + &line(&set_aside(&d.set_aside)) + &line(&nearest(catalogue, d)),
        Verdict::Unnamed => unnamed(catalogue, d),
        _ => named(catalogue, d),
    };
    let is_unnamed = d.verdict == Verdict::Unnamed;
    let to_tell = line(&test(d));
    // what to do comes second; of `unnamed` that is which rows to repeat, in its own sentences
    if !is_unnamed {
        out += &to_tell;
    }
    match d.verdict {
        Verdict::None => out += &(open_tears(d) + &contradictions(&d.contradictions)),
        Verdict::Unnamed => {}
        _ => out += &contradictions_beside(&d.contradictions),
    }
    if d.verdict != Verdict::None {
        out += &line(&set_aside(&d.set_aside));
    }
    // beside an answer, what is rough may be the answer's own
    if d.answers.is_empty() {
        out += &noise(&d.noise);
    }
    out += &line(&not_excluded(d));
    if is_unnamed {
        out += &to_tell;
    }
    let aside = d.left_out.as_ref().map_or(String::new(), left_out);
    out + &[unlikely(&d.ligament_forces), from_before(d), aside].map(|more| line(&more)).concat()
}

/// A text as a line of its own; nothing where there is none.
fn line(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!("\n{text}") }
}

/// What the data do not exclude beside what the head says already; nothing where no tear is among it.
fn not_excluded(d: &Diagnosis) -> String {
    if d.not_excluded.iter().all(|n| n.torn.is_none()) {
        return String::new();
    }
    let list = in_words(&d.not_excluded);
    let beside = if d.answers.is_empty() { "" } else { " either" };
    // of `none` no other state was held against the knee that lacks nothing
    let asked = if d.verdict == Verdict::None { " Effects other than whole tears are not in this list." } else { "" };
    format!("These trials do not exclude{beside}: {list}.{asked}")
}

fn named(catalogue: &Catalogue, d: &Diagnosis) -> String {
    let answers: Vec<String> = d.answers.iter().map(|a| answer(catalogue, a)).collect();
    let Some((first, others)) = answers.split_first() else { return String::new() };
    let mut out = match d.verdict {
        Verdict::Decisive => format!("{}.", capital(first)),
        Verdict::Probable => format!("Most likely {first}."),
        _ => format!("{}.", capital(first)),
    };
    if !others.is_empty() {
        let how = if d.verdict == Verdict::OneOf { "Or" } else { "These data alone would not exclude that" };
        let _ = write!(out, " {how} {}.", others.join(", or "));
    }
    out + &at_the_bench(catalogue, d)
}

/// What to do first: the bench check of each effect of the first answer.
fn at_the_bench(catalogue: &Catalogue, d: &Diagnosis) -> String {
    let mut checks: Vec<&str> = Vec::new();
    for e in d.answers.iter().take(1).flat_map(|a| &a.effects) {
        let Ok((found, _)) = catalogue.find(&e.effect) else { continue };
        if !checks.contains(&found.bench.as_str()) {
            checks.push(&found.bench);
        }
    }
    if checks.is_empty() { String::new() } else { format!("\nTo do first, at the bench: {}", checks.join(" ")) }
}

fn unnamed(catalogue: &Catalogue, d: &Diagnosis) -> String {
    let near: Vec<String> = d.best.iter().map(|e| bare(catalogue, e)).collect();
    let mut out = meaning(d);
    if !near.is_empty() {
        let _ = write!(out, "\nThe nearest, though not good enough: {}{}.", near.join(", with "), closing(d));
        out += &leaves_most(d);
    }
    let others: Vec<String> = closing_most(d)
        .into_iter()
        .map(|(effects, share)| {
            let names: Vec<String> = effects.iter().map(|e| bare(catalogue, e)).collect();
            format!("{} ({:.0} %)", names.join(", with "), 100.0 * share)
        })
        .collect();
    if !others.is_empty() {
        let _ = write!(out, "\nOf what is less likely, these close most of that gap: {}.", others.join("; or "));
    }
    out
}

/// Trials that jumped, with what to do: so many by their rows.
fn set_aside(of: &[SetAside]) -> String {
    if of.is_empty() {
        return String::new();
    }
    let told: Vec<String> = of.iter().take(ROWS_IN_HEAD).map(trial_in_words).collect();
    let more = match of.len() - told.len() {
        0 => String::new(),
        n => format!("; and {n} more"),
    };
    format!("Set aside, as if they had jumped: {}{more}. Look at their records, or repeat them.", told.join("; "))
}

/// That trials were left out, and how many.
fn left_out(of: &LeftOut) -> String {
    let (out, all) = (of.trials.len(), of.of);
    let were = if out == 1 { "was" } else { "were" };
    format!(
        "{out} of {all} trials {were} left out: as read, the knee lies out of its joint there, or a frame or an origin is off."
    )
}

fn answer(catalogue: &Catalogue, a: &Answer) -> String {
    a.effects.iter().map(|e| effect(catalogue, e)).collect::<Vec<_>>().join(", and ")
}

/// The test that would tell, where an answer is open.
fn test(d: &Diagnosis) -> String {
    let is_open = d.answers.len() > 1 || matches!(d.verdict, Verdict::Unnamed) || !d.may_be_torn.is_empty();
    let Some(best) = d.next_tests.first().filter(|_| is_open) else { return String::new() };
    let what = next_tells(d);
    if best.expected_gain < WORTH_TELLING {
        // log odds are no words for a head: so many to one
        return format!(
            "No single test of usual load would tell {what}. The best, {}, makes one at most {} times as likely against the other as it is now.",
            told(best),
            figures(best.expected_gain.exp())
        );
    }
    let careful = if best.gives_way { " The knee may give way in it: begin with less load." } else { "" };
    format!("{} would tell {what}.{careful}", capital(&told(best)))
}

/// A test as a clinician calls it.
fn told(t: &NextTest) -> String {
    let load = t.load.abs();
    let name = match t.test.as_str() {
        "anterior" if t.flexion_deg <= LACHMAN_DEG => format!("a Lachman test ({load:.0} N forward"),
        "anterior" => format!("an anterior drawer ({load:.0} N"),
        "posterior" => format!("a posterior drawer ({load:.0} N"),
        "internal" | "external" => format!("an {} rotation ({load:.0} N m", t.test),
        "varus" | "valgus" => format!("a {} test ({load:.0} N m", t.test),
        other => format!("a {other} trial (unloaded"),
    };
    format!("{name} at {:.0} deg, in {})", t.flexion_deg, t.source)
}

/// The unlikeliest load that an answer puts into a ligament.
fn unlikely(forces: &[Carried]) -> String {
    let is_unlikely = |c: &&Carried| c.with_n >= UNLIKELY_N && c.with_n > c.without_n;
    let most = forces.iter().filter(is_unlikely).max_by(|a, b| a.with_n.total_cmp(&b.with_n));
    most.map_or(String::new(), |c| {
        format!("Beware: the answer has the {} carry {:.0} N under {}, an unlikely load.", c.ligament, c.with_n, c.test)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{MayBeTorn, Named, Tried, Unexplained, Value};
    use crate::search::contradiction::Witness;

    fn lost(structure: &str, value: f64, sd: f64) -> Named {
        let parameters = [("loss".to_owned(), Value { value, sd, unit: "-".into() })].into();
        Named { effect: "structure_loss".into(), scope: "both".into(), variant: Some(structure.into()), parameters }
    }

    #[test]
    fn a_loss_is_told_as_a_tear_only_where_all_may_be_lost() {
        let words = |value, sd| effect(&Catalogue::shipped(), &lost("ACL", value, sd));
        // of what may be all, the share of a tear stands beside the interval of a part
        assert_eq!(
            words(1.0, 0.05),
            "the ACL is torn (weight of a whole tear: 0.98), or has lost 92 % or more of what it carries"
        );
        assert_eq!(words(0.5, 0.1), "the ACL has lost 34 to 66 % of what it carries");
    }

    #[test]
    fn an_answer_comes_first_with_its_bench_check_and_nothing_named_has_none() {
        let loss = lost("PCL", 1.0, 0.01);
        let answer =
            Answer { effects: vec![loss.clone(), loss], weight: 0.99, log_bayes_factor: 14.0, held_out_gain: -1.0 };
        let told = head(&Diagnosis { verdict: Verdict::Probable, answers: vec![answer], ..none(vec![]) });
        let lines: Vec<&str> = told.lines().collect();
        assert!(lines[0].starts_with("Most likely the PCL is torn"), "{told}");
        assert_eq!(lines[1], "To do first, at the bench: Inspect and pull the ligament.");
        assert!(!head(&none(vec![])).contains("at the bench"));
    }

    fn torn(structure: &str) -> MayBeTorn {
        MayBeTorn {
            structure: structure.into(),
            log_odds: -1.0,
            given_n: 150.0,
            now_n: 150.0,
            slack: 0.067,
            against_given: 0.0,
            fits_worse_torn: false,
            would_earn: Some(1.0),
        }
    }

    fn none(may_be_torn: Vec<MayBeTorn>) -> Diagnosis {
        let gap = crate::report::Gap {
            before: 1.0,
            after: 1.0,
            floor: 1.0,
            closed: 0.0,
            rmse_before: std::collections::BTreeMap::new(),
            rmse_after: std::collections::BTreeMap::new(),
        };
        Diagnosis {
            schema: "diagnosis/1".into(),
            verdict: Verdict::None,
            answers: vec![],
            plain: String::new(),
            description: String::new(),
            added: vec![],
            gap: crate::report::GapReport { held_out: gap, control: None },
            map: vec![],
            map_after: vec![],
            map_left_out: vec![],
            curves: vec![],
            not_testable: vec![],
            without: vec![],
            missable: vec![],
            next_tests: vec![],
            noise: vec![],
            ligaments: vec![],
            ligament_forces: vec![],
            threshold: 5.0,
            wildcard: 0.0,
            wildcard_alone: None,
            exchanged: None,
            left_out: None,
            set_aside: vec![],
            before: vec![],
            contradictions: vec![],
            unexplained: None,
            may_be_torn,
            not_excluded: vec![],
            misfit: [1.0, 1.0],
            best: vec![],
            best_log_bayes_factor: None,
            provenance: None,
        }
    }

    fn head(d: &Diagnosis) -> String {
        plain(&Catalogue::shipped(), d)
    }

    #[test]
    fn a_trial_that_jumped_and_the_nearest_effect_stand_in_the_head() {
        let at = Witness {
            source: "kla".into(),
            row: Some(9),
            trial: "Posterior_60deg".into(),
            flexion_deg: 60.0,
            loads: std::collections::BTreeMap::new(),
            value: 17.6,
        };
        let jumped = SetAside { at, dof: "ap".into(), expected: 11.6, sd: 0.5 };
        let told = head(&Diagnosis { set_aside: vec![jumped.clone()], ..none(vec![]) });
        assert!(
            told.contains("\nSet aside, as if they had jumped: row 9 of kla (Posterior_60deg) reads 17.6 mm"),
            "{told}"
        );
        let many = head(&Diagnosis { set_aside: vec![jumped; 5], ..none(vec![]) });
        assert!(many.contains("; and 2 more. Look at their records"), "{many}");
        let size = [("fe_deg".to_owned(), Value { value: 4.7, sd: 1.2, unit: "deg".into() })].into();
        let offset = Named { effect: "flexion_offset".into(), scope: "rks".into(), variant: None, parameters: size };
        let nearest = |earned| {
            let (best, best_log_bayes_factor) = (vec![offset.clone()], Some(earned));
            head(&Diagnosis { best, best_log_bayes_factor, ..none(vec![]) })
        };
        let told = nearest(4.2);
        assert!(
            told.contains("\nOf all effects the nearest is: offset of recorded flexion in rks (4.70 deg)."),
            "{told}"
        );
        assert!(
            told.contains("67 to 1 likelier") && told.contains("a name takes 148 to 1. To look at, at the bench: "),
            "{told}"
        );
        // what is hardly likelier than nothing is not told
        assert!(!nearest(2.0).contains("nearest"));
    }

    #[test]
    fn where_nothing_is_named_each_tear_that_would_be_missed_is_told() {
        let open = none(["ACL", "sMCL", "POL"].map(torn).into());
        assert!(head(&open).contains("A whole tear of the ACL, sMCL or POL would not be named by these trials."));
        // as on the page: what is open for another reason stands in what is not excluded; what the readings speak against is told
        let [acl, pcl, als] = ["ACL", "PCL", "ALS"].map(torn);
        let acl = MayBeTorn { fits_worse_torn: true, ..acl };
        let told = head(&none(vec![pcl, acl, MayBeTorn { would_earn: None, ..als }]));
        assert!(told.contains("A whole tear of the PCL or ACL would not be named"), "{told}");
        assert!(told.contains("speak against a tear of the ACL all the same") && !told.contains("ALS"), "{told}");
        assert!(!head(&open).contains("speak against"));
        let closed = head(&none(vec![]));
        assert_eq!(closed, "Nothing is missing from the model that these trials show.");
    }

    #[test]
    fn a_slack_ligament_is_told_where_a_tear_of_it_fits_and_no_other() {
        let slack = MayBeTorn { now_n: 40.0, against_given: 14.0, ..torn("PCL") };
        let told = head(&none(vec![slack.clone(), MayBeTorn { structure: "LCL".into(), ..slack.clone() }]));
        assert!(
            told.contains("\nThe model fits only with a slacker PCL")
                && told.contains("\nAnd it fits only with a slacker LCL"),
            "{told}"
        );
        assert!(
            told.contains("It is torn, or slack by 7 % of its length or more; these trials cannot tell which."),
            "{told}"
        );
        // calibrations of one knee differ: less force alone is no finding where a tear fits worse
        let told = head(&none(vec![MayBeTorn { fits_worse_torn: true, would_earn: Some(1.0), ..slack }]));
        assert!(!told.contains("slacker") && told.contains("A whole tear of the PCL would not be named"), "{told}");
    }

    #[test]
    fn a_name_that_a_field_in_its_place_is_not_told_from_stays_possible_in_the_first_sentence() {
        use crate::report::Against::{FieldInItsPlace, LeavesTooMuch};
        let named = Named {
            effect: "joint_compression".into(),
            scope: "both".into(),
            variant: None,
            parameters: std::collections::BTreeMap::new(),
        };
        let first = |against: Vec<crate::report::Against>, field: f64| {
            let row = Tried {
                effects: vec![named.clone()],
                closes: 1.0,
                closes_held_out: None,
                leaves: Some(0.9),
                log_bayes_factor: 7.2,
                against,
            };
            let why = Unexplained { data_sets: vec![], two_knees: None, tried: vec![row], left: vec![] };
            let of = Diagnosis {
                verdict: Verdict::Unnamed,
                best: vec![named.clone()],
                best_log_bayes_factor: Some(7.2),
                wildcard_alone: Some(field),
                unexplained: Some(why),
                ..none(vec![])
            };
            head(&of).lines().next().unwrap_or_default().to_owned()
        };
        assert!(first(vec![FieldInItsPlace], 7.0).contains("do not tell which"));
        // a field that is far ahead, or anything else against the name, leaves it out
        assert!(!first(vec![FieldInItsPlace], 17.0).contains("do not tell which"));
        assert!(!first(vec![LeavesTooMuch, FieldInItsPlace], 7.0).contains("do not tell which"));
    }

    #[test]
    fn what_is_not_excluded_has_a_line_of_its_own_where_a_tear_is_among_it_and_else_none() {
        let state = |torn: Option<&str>, log_odds| crate::report::NotExcluded {
            effects: vec![],
            torn: torn.map(str::to_owned),
            log_odds,
        };
        let open = Diagnosis {
            not_excluded: vec![state(None, 0.0), state(Some("sMCL"), -0.2), state(Some("POL"), -1.2)],
            ..none(vec![])
        };
        let told = head(&open);
        let line = "These trials do not exclude: that nothing is missing; nor, less likely, a torn sMCL or a torn POL. \
                    Effects other than whole tears are not in this list.";
        assert!(told.lines().any(|l| l == line), "{told}");
        // a tear that is hardly likelier does not lead the head
        let hardly = Diagnosis { not_excluded: vec![state(Some("LCL"), 0.9), state(None, 0.0)], ..open.clone() };
        let told = head(&hardly);
        assert!(told.starts_with("Nothing is missing") && told.contains("not exclude: a torn LCL"), "{told}");
        // beside an answer its rivals stand there, too, whatever they are
        let answered = Diagnosis { verdict: Verdict::Probable, ..open.clone() };
        assert!(!not_excluded(&answered).contains("Effects other"), "{}", not_excluded(&answered));
        // a tear that fits better than nothing: the head never says that nothing is missing, and has the tear first
        let better = Diagnosis { not_excluded: vec![state(Some("PCL"), 4.3), state(None, 0.0)], ..open };
        let told = head(&better);
        assert!(
            told.starts_with("No effect is proven by these trials. What fits best is a torn PCL (74 to 1"),
            "{told}"
        );
        assert!(
            !told.contains("othing is missing")
                && told.contains("not exclude: a torn PCL, or a knee that lacks nothing."),
            "{told}"
        );
        let slack = MayBeTorn { now_n: 40.0, against_given: 14.0, ..torn("PCL") };
        let told = head(&Diagnosis { may_be_torn: vec![slack], ..better });
        assert!(told.contains(".\nThe model fits only with a slacker PCL"), "{told}");
        let whole = Diagnosis { not_excluded: vec![state(None, 0.0)], ..none(vec![]) };
        assert!(!head(&whole).contains("not exclude"));
    }

    #[test]
    fn the_limit_of_the_list_follows_what_the_state_leaves_that_its_odds_are_against() {
        use crate::criteria::{TEMPER, told_apart};
        use crate::report::not_excluded::least_log_odds;
        let of = |verdict, earned| {
            least_log_odds(&Diagnosis {
                verdict,
                misfit: [3.0, 2.0],
                best_log_bayes_factor: Some(earned),
                ..none(vec![])
            })
        };
        let as_loud = |misfit: f64| -told_apart() * TEMPER * misfit;
        for (verdict, earned, misfit) in
            [(Verdict::None, 3.0, 3.0), (Verdict::Unnamed, 3.0, 2.0), (Verdict::Unnamed, -1.0, 3.0)]
        {
            assert!((of(verdict, earned) - as_loud(misfit)).abs() < 1e-12, "{verdict:?} {earned}");
        }
        // data that leave less than noise speak no louder
        let quiet = Diagnosis { misfit: [0.5, 0.5], ..none(vec![]) };
        assert!((least_log_odds(&quiet) - as_loud(1.0)).abs() < 1e-12);
    }

    #[test]
    fn a_misfit_beyond_noise_is_told_before_all_else() {
        let cell = |z: f64, significant| crate::search::map::Cell {
            source: "rks".into(),
            test: "posterior".into(),
            nominal_flexion_deg: 30.0,
            load_sign: -1,
            dof: "ie".into(),
            z,
            mean: 1.0,
            significant,
        };
        let within = head(&Diagnosis { map: vec![cell(2.0, false)], ..none(vec![]) });
        assert!(within.starts_with("Nothing is missing"), "{within}");
        let beyond = head(&Diagnosis { map: vec![cell(2.0, false), cell(3.8, true)], ..none(vec![torn("PCL")]) });
        assert!(beyond.contains("IE of rks posterior at 30 deg") && !beyond.contains("Nothing is missing"), "{beyond}");
        assert!(beyond.contains("A whole tear of the PCL"), "{beyond}");
    }

    #[test]
    fn what_closes_most_of_the_gap_stands_in_the_head_beside_the_nearest() {
        let named = |effect: &&str| Named {
            effect: (*effect).into(),
            scope: "kla".into(),
            variant: None,
            parameters: std::collections::BTreeMap::new(),
        };
        let tried = |names: &[&str], unseen: f64| Tried {
            effects: names.iter().map(named).collect(),
            closes: 0.3,
            closes_held_out: Some(unseen),
            leaves: Some(3.2),
            log_bayes_factor: 10.0,
            against: vec![crate::report::Against::LeavesTooMuch],
        };
        let nearest = ["capsule_envelope", "tibia_frame"];
        let head_of = |others: Vec<Tried>| {
            let tried = [vec![tried(&nearest, 0.67)], others].concat();
            let unexplained = Some(Unexplained { data_sets: vec![], two_knees: None, tried, left: vec![] });
            let best = nearest.iter().map(named).collect();
            head(&Diagnosis { verdict: Verdict::Unnamed, best, unexplained, ..none(vec![]) })
        };
        let told = head_of(vec![
            tried(&["femur_frame"], 0.56),
            tried(&["tibia_frame", "load_gain"], 1.0),
            tried(&["gravity"], 0.13),
        ]);
        assert!(told.contains("it closes 67 % of that gap"), "{told}");
        let others = "turned tibial frame in kla, with scale of the recorded load in kla (100 %); or turned femoral frame in kla (56 %).";
        assert!(told.contains(others) && !told.contains("(13 %)"), "{told}");
        // where no other closes most of it, there is no word of others
        assert!(!head_of(vec![tried(&["gravity"], 0.13)]).contains("close most"));
    }

    #[test]
    fn trials_that_were_left_out_and_data_from_before_stand_in_the_head_of_any_verdict() {
        let trials = vec!["rks valgus_60deg_10".to_owned(), "kla anterior_90deg_89".to_owned()];
        for verdict in [Verdict::None, Verdict::Unnamed, Verdict::Decisive] {
            let left_out = Some(LeftOut { trials: trials.clone(), of: 54 });
            let told = head(&Diagnosis { verdict, left_out, before: vec!["kla0".into()], ..none(vec![]) });
            assert!(told.contains("2 of 54 trials were left out") && told.contains("before (kla0)"), "{told}");
            let told = head(&Diagnosis { verdict, ..none(vec![]) });
            assert!(!told.contains("left out") && !told.contains("before (kla0"), "{told}");
        }
    }

    #[test]
    fn a_test_says_what_it_would_tell_and_no_head_speaks_of_log_odds() {
        let best = |expected_gain| NextTest {
            test: "posterior".into(),
            flexion_deg: 75.0,
            load: -130.0,
            source: "kla".into(),
            expected_gain,
            gives_way: false,
        };
        for gain in [0.14, 5.6] {
            let told = head(&Diagnosis { next_tests: vec![best(gain)], ..none(vec![torn("PCL")]) });
            assert!(told.contains("would tell whether the PCL is torn") && !told.contains("log odds"), "{told}");
            assert_eq!(told.contains("No single test"), gain < 1.0, "{told}");
        }
    }

    #[test]
    fn tests_are_said_to_tell_answers_apart_where_there_are_answers_alone() {
        for may_be_torn in [vec![], vec![torn("LCL")]] {
            assert_ne!(next_tells(&none(may_be_torn.clone())), "the answers apart");
            let told = next_tells(&Diagnosis { verdict: Verdict::OneOf, ..none(may_be_torn) });
            assert_eq!(told, "the answers apart");
        }
    }

    #[test]
    fn a_forward_drawer_is_a_lachman_test_near_extension_alone() {
        let at = |flexion_deg| NextTest {
            test: "anterior".into(),
            flexion_deg,
            load: 130.0,
            source: "kla".into(),
            expected_gain: 4.0,
            gives_way: false,
        };
        assert_eq!(told(&at(15.0)), "a Lachman test (130 N forward at 15 deg, in kla)");
        assert_eq!(told(&at(75.0)), "an anterior drawer (130 N at 75 deg, in kla)");
    }

    #[test]
    fn a_load_that_the_answer_itself_puts_into_a_ligament_is_told_where_nobody_has_seen_it() {
        let carried = |without_n, with_n| Carried {
            ligament: "PCL".into(),
            test: "133 N forward at 30 deg".into(),
            without_n,
            with_n,
        };
        assert!(unlikely(&[carried(20.0, 361.0)]).contains("361 N under 133 N forward"));
        assert_eq!(unlikely(&[carried(20.0, 140.0), carried(400.0, 361.0)]), "");
    }
}
