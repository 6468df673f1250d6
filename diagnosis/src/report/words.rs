//! The verdict in sentences for a researcher who has read no manual.

use crate::criteria::{ANOTHER, discrepancy};
use crate::discrepancy::Discrepancy;
use crate::effect::catalogue::Catalogue;
use crate::fit::share_at_whole;
use crate::problem::Problem;
use crate::report::{Absorbed, Answer, Carried, Diagnosis, Gap, Named, Verdict};
use crate::search::Search;
use crate::search::map::Cell;
use std::fmt::Write;

/// The description of a diagnosis; `aside` are the trials that were set aside, each in words.
pub(crate) fn description(
    problem: &Problem,
    d: &Diagnosis,
    field: &Discrepancy,
    search: &Search,
    aside: &[String],
) -> String {
    let mut out = String::new();
    match d.verdict {
        Verdict::None => {
            out += if d.map.iter().any(|c| c.significant) {
                "The model disagrees with the data in places, but no effect of the catalogue explains it better than chance would."
            } else {
                "No disagreement beyond measurement noise and the declared floor of the model."
            };
            out += &nearest(problem, d, search);
            out += " Smaller effects may hide: the page lists the sizes that would have been missed.";
        }
        Verdict::Unnamed if d.exchanged.as_ref().is_some_and(|e| e.log_bayes_factor > field.log_bayes_factor) => {
            out += "What disagrees is nothing that the catalogue has.";
        }
        Verdict::Unnamed => out += &unnamed(problem, d, field, search),
        _ => {
            let how = match d.verdict {
                Verdict::Decisive => "Decisive",
                Verdict::Probable => "Probable",
                _ => "One of several, the likeliest",
            };
            if let Some(a) = d.answers.first() {
                let _ = write!(out, "{how}: {}.", answer(&problem.catalogue, d, a));
            }
            for rival in d.answers.iter().skip(1) {
                let _ = write!(out, " Or: {} (weight {:.2}).", answer(&problem.catalogue, d, rival), rival.weight);
            }
            out += &shrunk(&d.gap.held_out);
            if d.wildcard > discrepancy() {
                let (what, gain) = (field.words(problem), d.wildcard);
                let _ = write!(
                    out,
                    " Something else may be missing beside it. {what} That earns a log Bayes factor of {gain:.1}."
                );
            }
        }
    }
    let before = from_before(d);
    if !before.is_empty() {
        let _ = write!(out, " {before}");
    }
    out += &to_tell(d);
    out += &mixed_up(d);
    out += &set_aside(problem, aside);
    out += &worst(&d.map);
    out += &shifts(d);
    out += &unburdened(&problem.catalogue, d);
    out += " This is a hypothesis to be checked at the bench, not a finding.";
    out
}

/// What is missing where no effect of the catalogue is it.
fn unnamed(problem: &Problem, d: &Diagnosis, field: &Discrepancy, search: &Search) -> String {
    let mut out = String::from("Something is missing that the catalogue does not have. ");
    out += &field.words(problem);
    let mut near: Vec<&str> = Vec::new();
    for (c, _) in &search.screened {
        if near.len() < 3 && !near.contains(&c.effect.title.as_str()) {
            near.push(&c.effect.title);
        }
    }
    let _ = write!(out, " Its nearest relatives in the catalogue: {}.", near.join(", "));
    out + &not_enough(problem, d)
}

/// What came nearest where nothing is named, refitted where the screen asked for it.
fn nearest(problem: &Problem, d: &Diagnosis, search: &Search) -> String {
    let sources = problem.asked().len();
    let earned =
        |f: &crate::fit::Fit| crate::search::weighed(f, sources) - crate::search::weighed(&search.base, sources);
    // a tear that no effect is ahead of
    let tear = d.not_excluded.iter().find_map(|state| state.tear_ahead());
    let nearest = tear.filter(|(_, log_odds)| d.best_log_bayes_factor.is_none_or(|earned| earned <= *log_odds));
    if let Some((structure, log_odds)) = nearest {
        return torn_nearest(structure, log_odds);
    }
    match (search.rivals.first(), search.screened.first()) {
        (Some(best), _) if !d.best.is_empty() => {
            let names: Vec<String> = d.best.iter().map(|e| named(&problem.catalogue, d, e)).collect();
            short_of_a_name(&names.join("; together with "), earned(best), d.threshold)
        }
        (_, Some((c, gain))) => {
            let what = format!("{}{}", c.effect.title, about(c.variant_name().as_deref()));
            short_of_a_name(&what, *gain, d.threshold)
        }
        _ => String::new(),
    }
}

/// That a tear comes nearest: its log odds stand before any prior of one, so those of a name are no bar to hold them against.
fn torn_nearest(structure: &str, log_odds: f64) -> String {
    format!(
        " What comes nearest is a torn {structure}. The data are likelier with it, but not by enough for a name (log odds {}, before any prior of a tear).",
        fixed(log_odds, 1)
    )
}

/// That an effect comes nearest and is not enough for a name: first what that means, then its log odds and those that a name takes.
fn short_of_a_name(what: &str, log_odds: f64, needed: f64) -> String {
    let means = if log_odds > 0.0 { "likelier with it, but not by enough for a name" } else { "no likelier with it" };
    // two decimals: with one, what falls short by little would read as if it did not
    let [has, takes] = [log_odds, needed].map(|x| fixed(x, 2));
    format!(" What comes nearest is {what}. The data are {means} (log odds {has}; a name takes {takes}).")
}

/// By how much the error on unseen trials falls, and how much of what it could fall that is; or that it does not fall.
fn shrunk(g: &Gap) -> String {
    if g.after >= g.before {
        let [before, after] = [g.before, g.after].map(|x| fixed(x, 2));
        return format!(
            " On trials that no calibration had seen the error does not fall: {before} without the answer, {after} with it. So those trials do not speak for it."
        );
    }
    let [by, before, after, floor] = [g.before - g.after, g.before, g.after, g.floor].map(|x| fixed(x, 2));
    let falls = format!(" On trials that no calibration had seen the error falls by {by}, from {before} to {after}");
    // a floor is cut off at the error with the answer
    if g.floor >= g.after {
        return format!("{falls}. Noise alone would leave as much or more, so it falls by all that it could.");
    }
    format!("{falls}; noise alone leaves {floor}, so that is {} % of what it could fall.", fixed(100.0 * g.closed, 0))
}

/// How data from before count; nothing where there are none.
pub(crate) fn from_before(d: &Diagnosis) -> String {
    if d.before.is_empty() {
        return String::new();
    }
    format!(
        "The data from before ({}) are fitted with the same ligaments, and with no effect: what is told is of the data since.",
        d.before.join(", ")
    )
}

fn answer(catalogue: &Catalogue, d: &Diagnosis, a: &Answer) -> String {
    a.effects.iter().map(|e| named(catalogue, d, e)).collect::<Vec<_>>().join("; together with ")
}

/// What the next tests are to tell.
pub fn next_tells(d: &Diagnosis) -> String {
    let torn = d.may_be_torn.iter().find(|t| t.is_slackened()).or(d.may_be_torn.first());
    match (torn, d.verdict) {
        (Some(t), Verdict::None) => format!("whether the {} is torn", t.structure),
        (None, Verdict::None) => "whether what comes nearest is there".into(),
        (_, Verdict::Unnamed) => "which effect comes nearest".into(),
        _ => "the answers apart".into(),
    }
}

/// Names as a list: "ACL, PCL or POL".
pub fn listed(names: &[&str], last: &str) -> String {
    match names.split_last() {
        Some((end, others)) if !others.is_empty() => format!("{} {last} {end}", others.join(", ")),
        _ => names.concat(),
    }
}

/// The test that would tell the answers apart best, where there are several or none.
fn to_tell(d: &Diagnosis) -> String {
    let is_open = d.answers.len() > 1 || d.verdict == Verdict::Unnamed;
    let Some(best) = d.next_tests.first().filter(|_| is_open) else { return String::new() };
    let load = match best.test.as_str() {
        "anterior" | "posterior" => format!(", {}", with_unit(best.load.abs(), "N")),
        "neutral" => String::new(),
        _ => format!(", {}", with_unit(best.load.abs(), "N m")),
    };
    format!(" The test that would tell most: {}{load}, at {:.0} deg in {}.", best.test, best.flexion_deg, best.source)
}

/// The structure or axis that an effect is about, as its title goes on: " of PCL", " about the unloaded pose".
fn about(variant: Option<&str>) -> String {
    variant.map_or(String::new(), |v| if v.starts_with("about ") { format!(" {v}") } else { format!(" of {v}") })
}

/// An effect in words: its title, where, and its sizes.
fn named(catalogue: &Catalogue, d: &Diagnosis, e: &Named) -> String {
    let title = catalogue.find(&e.effect).map_or(e.effect.clone(), |(f, _)| f.title.clone());
    let about = about(e.variant.as_deref());
    let all = if d.before.is_empty() { "in all data sets" } else { "in all data sets since" };
    let place = if e.scope == "both" { all.to_owned() } else { format!("in {}", e.scope) };
    format!("{title}{about} {place}, {}", sizes(catalogue, e, "90 % ").join(", "))
}

/// Each parameter of an effect with its 90 % interval, told as such by `label`. Of what may be whole the interval is that of a part, and the share of
/// the whole stands beside it.
pub fn sizes(catalogue: &Catalogue, e: &Named, label: &str) -> Vec<String> {
    let found = catalogue.find(&e.effect).ok().map(|(f, _)| f);
    let one = |(k, v): (&String, &crate::report::Value)| {
        let of = found.and_then(|f| f.parameter.iter().find(|p| p.key == *k));
        let (low, high) = v.interval(of);
        let size = with_unit(v.value, &v.unit);
        let is_open = |p: &&crate::effect::catalogue::Parameter| p.whole.is_some_and(|whole| high >= whole);
        let share = of.filter(is_open).and_then(|p| share_at_whole((v.value, v.sd), p));
        let all = share.map_or(String::new(), |w| format!("; all of it with weight {w:.2}"));
        format!("{} {size} ({label}{} to {}{all})", parameter_of_effect(k), figures(low), figures(high))
    };
    e.parameters.iter().map(one).collect()
}

/// Endings of the keys of parameters that are units: these stand behind the number.
const UNITS: [&str; 7] = ["_mm_per_100n", "_deg_per_nm", "_percent", "_deg", "_mm", "_nm", "_n"];

/// A parameter of an effect in words, without its unit: "femur AP" of `femur_ap_mm`.
pub fn parameter_of_effect(key: &str) -> String {
    let bare = UNITS.iter().filter_map(|unit| key.strip_suffix(*unit)).min_by_key(|left| left.len()).unwrap_or(key);
    let word = |part: &str| match part {
        "vv" | "ie" | "ml" | "ap" | "si" => part.to_uppercase(),
        "fe" => "flexion".into(),
        "in" => "inwards".into(),
        "out" => "outwards".into(),
        "k" => "stiffness".into(),
        "lat" => "lateral".into(),
        "med" => "medial".into(),
        other => other.into(),
    };
    bare.split('_').map(word).collect::<Vec<String>>().join(" ")
}

/// A number with its unit.
pub fn with_unit(x: f64, unit: &str) -> String {
    if unit == "-" { figures(x) } else { format!("{} {unit}", figures(x)) }
}

/// A number to three figures or so.
pub(crate) fn figures(x: f64) -> String {
    match x.abs() {
        a if a >= 100.0 => fixed(x, 0),
        a if a >= 10.0 => fixed(x, 1),
        0.0 => "0".into(),
        a if a >= 1.0 => fixed(x, 2),
        _ => fixed(x, 3),
    }
}

/// A number with so many decimals, never "-0.0".
pub fn fixed(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    match text.strip_prefix('-') {
        Some(size) if reads_nothing(size) => size.to_owned(),
        _ => text,
    }
}

/// The same with the sign of what is above 0, too: "+0.3"; what rounds to nothing has no sign.
pub fn signed(x: f64, decimals: usize) -> String {
    let text = fixed(x, decimals);
    if x > 0.0 && !reads_nothing(&text) { format!("+{text}") } else { text }
}

/// Whether all digits are 0.
fn reads_nothing(text: &str) -> bool {
    text.chars().all(|c| matches!(c, '0' | '.'))
}

/// A ligament's parameter in words, with its unit.
pub fn parameter(name: &str) -> &str {
    match name {
        "reference_strain" => "reference strain",
        "stiffness_n_per_mm" => "stiffness [N/mm]",
        other => other,
    }
}

/// What the best of the catalogue would explain, where that is not enough for a name.
fn not_enough(problem: &Problem, d: &Diagnosis) -> String {
    let [before, after] = d.misfit;
    if d.best.is_empty() || before <= 1.0 {
        return String::new();
    }
    let title = |e: &Named| {
        let title = problem.catalogue.find(&e.effect).map_or(e.effect.clone(), |(f, _)| f.title.clone());
        let place = if e.scope == "both" { "all data sets" } else { &e.scope };
        format!("{title}{} in {place}", about(e.variant.as_deref()))
    };
    let names: Vec<String> = d.best.iter().map(title).collect();
    let explains = 100.0 * ((before - after) / (before - 1.0)).clamp(0.0, 1.0);
    let best = format!(" The best that it has, {}, would explain {explains:.0} % of the misfit", names.join(" with "));
    if after > 1.1 {
        return format!(
            "{best} and leave {after:.1} times what noise and floor allow, what ligaments and frames had to move for it counted in: not enough \
             for a name."
        );
    }
    match (d.wildcard_alone, d.best_log_bayes_factor) {
        (Some(alone), Some(own)) if d.wildcard <= discrepancy().max(ANOTHER * own) && d.exchanged.is_none() => format!(
            "{best} with a log Bayes factor of {}; what has no name explains as much, with {}, though it was chosen among more: not enough for \
             a name.",
            fixed(own, 1),
            fixed(alone, 1)
        ),
        _ => format!(
            "{best}, but fields of no name earn a log Bayes factor of {} there: not enough for a name.",
            fixed(d.wildcard, 1)
        ),
    }
}

/// Two trials whose records may have been mixed up.
fn mixed_up(d: &Diagnosis) -> String {
    d.exchanged.as_ref().map_or(String::new(), |e| {
        let [one, other] = &e.trials;
        let odds = fixed(e.log_bayes_factor, 1);
        format!(" The readings of {one} and of {other} fit each other's place (log odds {odds}): they may have been exchanged.")
    })
}

/// Trials that neither nothing missing nor the best hypothesis explains, and trials that were left out.
fn set_aside(problem: &Problem, told: &[String]) -> String {
    let aside = if told.is_empty() { String::new() } else { format!(" Set aside as outliers: {}.", told.join("; ")) };
    if problem.astray.is_empty() {
        return aside;
    }
    format!("{aside} Left out, since as read the knee lies out of its joint there: {}.", problem.astray.join(", "))
}

fn worst(map: &[Cell]) -> String {
    let mut cells: Vec<&Cell> = map.iter().filter(|c| c.significant).collect();
    cells.sort_by(|a, b| b.z.abs().total_cmp(&a.z.abs()));
    if cells.is_empty() {
        return String::new();
    }
    let list: Vec<String> = cells.iter().take(3).map(|c| format!("{} ({} sd)", place_of(c), signed(c.z, 1))).collect();
    format!(" With ligaments alone recalibrated the model misses most in {}.", list.join(", "))
}

/// A cell's coordinate and condition.
pub(crate) fn place_of(c: &Cell) -> String {
    let load = if c.load_sign == 0 { ", unloaded" } else { "" };
    format!("{} of {} {} at {} deg{load}", c.dof.to_uppercase(), c.source, c.test, c.nominal_flexion_deg)
}

/// Change of a ligament's force that is worth a sentence [N].
const TOLD: f64 = 10.0;

/// The ligament force that the answer changes most.
fn unburdened(catalogue: &Catalogue, d: &Diagnosis) -> String {
    let by = |c: &&Carried| (c.with_n - c.without_n).abs();
    let most = d.ligament_forces.iter().max_by(|a, b| by(a).total_cmp(&by(b))).filter(|c| by(c) >= TOLD);
    let Some(Carried { ligament, test, without_n, with_n }) = most else { return String::new() };
    let is_torn = d.answers.first().is_some_and(|a| a.effects.iter().any(|e| may_be_torn(catalogue, e, ligament)));
    let torn = if is_torn { ", and nothing where it is torn" } else { "" };
    format!(
        " Under {test}, {ligament} carries {with_n:.0} N with the likeliest size of the answer{torn}; without the answer {without_n:.0} N."
    )
}

/// Whether an effect may be that all of a ligament is lost.
fn may_be_torn(catalogue: &Catalogue, e: &Named, ligament: &str) -> bool {
    let Ok((found, _)) = catalogue.find(&e.effect) else { return false };
    let reaches = |p: &crate::effect::catalogue::Parameter| {
        let value = e.parameters.get(&p.key);
        p.whole.zip(value).is_some_and(|(whole, v)| v.interval(Some(p)).1 >= whole)
    };
    e.variant.as_deref() == Some(ligament) && found.parameter.iter().any(reaches)
}

fn shifts(d: &Diagnosis) -> String {
    let mut list: Vec<_> = d.ligaments.iter().filter(|l| (l.with - l.without).abs() > l.sd).collect();
    list.sort_by(|a, b| ((b.with - b.without) / b.sd).abs().total_cmp(&((a.with - a.without) / a.sd).abs()));
    if d.answers.is_empty() || list.is_empty() {
        return String::new();
    }
    let told: Vec<String> = list.iter().take(3).map(|l| shift(l)).collect();
    format!(" The ligaments had taken up part of it: {}.", told.join("; "))
}

/// A ligament's parameter without the answer and with it.
fn shift(l: &Absorbed) -> String {
    // a reference strain moves by thousandths
    let places = if l.parameter == "reference_strain" { 3 } else { 1 };
    let (bundle, parameter) = (&l.bundle, parameter(&l.parameter));
    format!("{bundle} {parameter} {:.places$} without the effect, {:.places$} with it", l.without, l.with)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Value;

    /// An effect with one parameter, in words.
    fn told(effect: &str, key: &str, value: f64, sd: f64, unit: &str) -> String {
        let parameters = [(key.to_owned(), Value { value, sd, unit: unit.into() })].into();
        let named = Named { effect: effect.into(), scope: "both".into(), variant: None, parameters };
        sizes(&Catalogue::shipped(), &named, "").concat()
    }

    #[test]
    fn an_interval_ends_where_its_parameter_does() {
        assert_eq!(
            told("structure_loss", "loss", 1.0, 0.168, "-"),
            "loss 1.00 (0.724 to 1.00; all of it with weight 0.94)"
        );
        assert_eq!(told("load_gain", "gain", -0.7, 0.2, "-"), "gain -0.700 (-0.750 to -0.371)");
        assert_eq!(told("gravity", "weight_n", 55.0, 10.0, "N"), "weight 55.0 N (38.5 to 60.0)");
        assert_eq!(told("joint_compression", "si_n", 50.0, 100.0, "N"), "SI 50.0 N (0 to 214)");
        // what nothing bounds, and what the catalogue does not know
        assert_eq!(told("flexion_offset", "fe_deg", 5.0, 10.0, "deg"), "flexion 5.00 deg (-11.4 to 21.4)");
        assert_eq!(told("ghost", "loss", 1.0, 1.0, "-"), "loss 1.00 (-0.645 to 2.65)");
    }

    #[test]
    fn a_parameter_is_told_in_words_with_its_unit_behind_the_number_alone() {
        for effect in Catalogue::shipped().effect {
            let mut told: Vec<String> = effect.parameter.iter().map(|p| parameter_of_effect(&p.key)).collect();
            for (words, p) in told.iter().zip(&effect.parameter) {
                assert!(!words.contains('_') && !words.is_empty(), "{}: {words}", p.key);
                // no unit is left in it, and no word that reads as a preposition
                let units = ["deg", "mm", "n", "nm", "percent", "in", "out", "k"];
                assert!(words.split(' ').all(|w| !units.contains(&w)), "{}: {words}", p.key);
            }
            // what an effect has several of stays several
            told.sort();
            told.dedup();
            assert_eq!(told.len(), effect.parameter.len(), "{}", effect.id);
        }
        assert_eq!(told("foot_turn", "in_deg", 5.0, 2.0, "deg"), "inwards 5.00 deg (1.71 to 8.29)");
        assert!(told("attachment", "femur_ap_mm", 5.0, 2.0, "mm").starts_with("femur AP 5.00 mm ("));
    }

    #[test]
    fn the_share_of_a_tear_is_told_where_the_interval_reaches_all_of_it_alone() {
        assert!(!told("structure_loss", "loss", 0.5, 0.1, "-").contains("weight"));
        assert!(told("structure_loss", "loss", 0.9, 0.2, "-").contains("all of it with weight 0."));
    }

    #[test]
    fn what_rounds_to_nothing_has_no_sign() {
        for (decimals, nothing) in [(0, "0"), (1, "0.0"), (2, "0.00"), (3, "0.000")] {
            let half = 0.4 * 0.1f64.powi(decimals as i32);
            for x in [half, -half, 0.0, -0.0] {
                assert_eq!([fixed(x, decimals), signed(x, decimals)], [nothing, nothing], "{x}");
            }
        }
        assert_eq!([fixed(-0.06, 1), fixed(0.06, 1)], ["-0.1", "0.1"]);
        assert_eq!([signed(-0.06, 1), signed(0.06, 1), signed(10.0, 0)], ["-0.1", "+0.1", "+10"]);
        assert_eq!(figures(-1e-4), "0.000");
        // wherever log odds are told
        for told in [short_of_a_name("gravity", -0.003, 4.95), torn_nearest("PCL", -0.003)] {
            assert!(told.contains("log odds 0.0") && !told.contains("-0.0"), "{told}");
        }
        let short = short_of_a_name("gravity", 4.93, 4.95);
        assert!(short.contains("log odds 4.93; a name takes 4.95"), "{short}");
    }

    #[test]
    fn what_came_nearest_is_told_in_words_before_its_log_odds() {
        let (for_it, against) = (short_of_a_name("gravity", 2.1, 4.95), short_of_a_name("gravity", -1.3, 4.95));
        assert!(for_it.contains("likelier with it, but not by enough") && against.contains("no likelier with it"));
        let at = |text: &str, words: &str| text.find(words).unwrap();
        assert!([for_it, against].iter().all(|text| at(text, "likelier") < at(text, "log odds")));
    }

    #[test]
    fn a_tear_that_comes_nearest_has_its_name_before_its_log_odds() {
        let told = torn_nearest("PCL", 4.315);
        assert!(
            told.contains("nearest is a torn PCL. The data are likelier with it") && told.contains("(log odds 4.3,")
        );
    }

    #[test]
    fn what_a_gap_shrinks_by_stands_beside_its_share() {
        let rmse = std::collections::BTreeMap::new;
        let (before, after, floor, closed) = (0.87, 0.81, 0.75, 0.5);
        let gap = Gap { before, after, floor, closed, rmse_before: rmse(), rmse_after: rmse() };
        let told = shrunk(&gap);
        assert!(told.contains("falls by 0.06, from 0.87 to 0.81; noise alone leaves 0.75"), "{told}");
        assert!(told.contains("50 % of what it could"), "{told}");
        // a floor is cut off at the error with the answer: how much noise leaves is then not known
        let told = shrunk(&Gap { floor: after, closed: 1.0, ..gap });
        assert!(told.contains("from 0.87 to 0.81. Noise alone would leave as much or more"), "{told}");
        assert!(!told.contains("leaves 0.81") && !told.contains('%'), "{told}");
        // what does not fall is never said to fall by less than nothing
        for (before, after) in [(0.74, 1.01), (1.0, 1.0)] {
            let told = shrunk(&Gap { before, after, floor, closed: 0.0, rmse_before: rmse(), rmse_after: rmse() });
            assert!(told.contains("does not fall") && !told.contains("falls by") && !told.contains('%'), "{told}");
        }
    }

    #[test]
    fn a_parameter_that_moved_is_told_without_the_effect_and_with_it() {
        let (bundle, parameter) = ("ACL_AM".to_owned(), "reference_strain".to_owned());
        let told = shift(&Absorbed { bundle, parameter, given: 1.06, without: 0.957, with: 1.061, sd: 0.01 });
        assert_eq!(told, "ACL_AM reference strain 0.957 without the effect, 1.061 with it");
    }

    #[test]
    fn a_torn_ligament_is_never_said_to_carry_something_without_a_word_of_the_tear() {
        let lost = |loss: f64| {
            let parameters = [("loss".to_owned(), Value { value: loss, sd: 0.1, unit: "-".into() })].into();
            Named { effect: "structure_loss".into(), scope: "both".into(), variant: Some("ACL".into()), parameters }
        };
        let catalogue = Catalogue::shipped();
        assert!(may_be_torn(&catalogue, &lost(0.99), "ACL") && !may_be_torn(&catalogue, &lost(0.99), "PCL"));
        assert!(!may_be_torn(&catalogue, &lost(0.5), "ACL"));
    }

    #[test]
    fn a_list_of_names_ends_in_its_last_word() {
        let list = ["ACL", "PCL", "POL"];
        let told = [1, 2, 3].map(|n| listed(&list[..n], "or"));
        assert_eq!(told, ["ACL", "ACL or PCL", "ACL, PCL or POL"]);
    }

    #[test]
    fn no_interval_of_the_catalogue_leaves_what_can_be() {
        for p in Catalogue::shipped().effect.iter().flat_map(|e| &e.parameter) {
            let [least, most] = p.can_be();
            for value in [least, most, 0.0].into_iter().filter(|x| x.is_finite()) {
                let (low, high) = Value { value, sd: 3.0 * p.sd, unit: p.unit.clone() }.interval(Some(p));
                assert!(least <= low && low <= value && value <= high && high <= most, "{} {low} {high}", p.key);
            }
        }
    }

    #[test]
    fn a_title_goes_on_with_what_it_is_about() {
        assert_eq!(about(Some("PCL")), " of PCL");
        assert_eq!(about(Some("about the unloaded pose")), " about the unloaded pose");
        assert_eq!(about(None), "");
    }
}
