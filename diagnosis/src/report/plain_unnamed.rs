//! What `unnamed` means, in plain words: whether the data agree with each other, which rows do not, and that no effect of the catalogue is enough.

mod noise;

use crate::criteria::{NAMED, TEMPER, told_apart};
use crate::report::words::{figures, with_unit};
use crate::report::{Against, DataSetAlone, Diagnosis, Left, Named, Tried, Unexplained};
use crate::search::contradiction::{Contradiction, Witness};
use sim::coordinate::{AP, Coordinate, IE, ML, VV};
use std::fmt::Write;

pub(crate) use noise::noise;

/// Sum of squares over the number of readings up to which a knee fits a data set [-]. Ours: twice what noise and floor leave.
const FITS: f64 = 2.0;
/// Share by which a fit may leave more than the fit of nothing missing, and still have converged [-]. Ours: each effect can be nothing, so that a
/// converged fit leaves no more; ends of one search part by less than this.
const CONVERGED: f64 = 0.001;
/// Share of a gap from which a row closes all of it [-]: it rounds to 100 %.
const ALL_OF_IT: f64 = 0.995;
/// Forces and moments that are none: VV, IE [N m], ML, AP [N]; what a robot leaves where it is asked for nothing.
const NO_LOAD: [(Coordinate, f64); 4] = [(VV, 1.0), (IE, 1.0), (ML, 10.0), (AP, 10.0)];

/// Contradictions in the head, at most [-].
const IN_HEAD: usize = 3;
/// Readings that the nearest leaves most of, in the head [-].
const LEFT_IN_HEAD: usize = 3;
/// Rows in the head that would be answers if they stood first, at most [-].
const OPEN_IN_HEAD: usize = 3;

/// What `unnamed` means: first that, then what to do, then what it rests on.
pub(crate) fn meaning(d: &Diagnosis) -> String {
    let missing = if is_between(d) {
        "Something is missing from the model: what comes nearest below, or something that no effect of the catalogue explains. These data do not tell which."
    } else {
        "Something is missing from the model that no effect of the catalogue explains."
    };
    let Some(why) = &d.unexplained else { return missing.into() };
    let agreement = agreement(&why.data_sets, why.two_knees);
    let first = if agreement.is_empty() { missing.into() } else { agreement };
    first + &to_repeat(&d.contradictions) + &contradictions(&d.contradictions) + &best(why, d.misfit[0])
}

/// Whether the best that was found and a field of no name in its place are not told apart, and nothing else stands against it. The field may be the likelier
/// of the two, so there is no name; but it does not exclude one that earns as much to within the odds that tell answers apart.
fn is_between(d: &Diagnosis) -> bool {
    let alone_against = best_row(d).is_some_and(|t| t.against == [Against::FieldInItsPlace]);
    let ahead = d.wildcard_alone.zip(d.best_log_bayes_factor).map(|(field, name)| field - name);
    alone_against && ahead.is_some_and(|nats| nats < told_apart() * TEMPER)
}

/// Whether each data set is a knee's, and all are one knee's; nothing where the data sets say nothing of it, or one knee does for all.
/// `two_knees`: log odds for a knee each.
fn agreement(sets: &[DataSetAlone], two_knees: Option<f64>) -> String {
    let (fitted, odd): (Vec<&DataSetAlone>, Vec<&DataSetAlone>) = sets.iter().partition(|s| s.alone + s.cost <= FITS);
    let list = |of: &[&DataSetAlone]| {
        let each: Vec<String> = of.iter().map(|s| format!("{} {}", s.source, figures(s.alone))).collect();
        each.join(", ")
    };
    let together = || {
        let each: Vec<String> = sets.iter().map(|s| format!("{} {}", s.source, figures(s.together))).collect();
        each.join(", ")
    };
    match (fitted.is_empty(), odd.is_empty()) {
        (true, true) => String::new(),
        (false, true) => apart(sets, two_knees).map_or(String::new(), |apart| {
            format!(
                "The data sets contradict each other. Each alone is a knee of the model (left over, in units of what noise leaves: {}), \
                 but {apart} ({}).",
                list(&fitted),
                together()
            )
        }),
        _ => format!(
            "No knee of the model gives all readings of {}, even alone (left over, in units of what noise leaves: {}; with all data sets: {}).{}",
            odd.iter().map(|s| s.source.as_str()).collect::<Vec<_>>().join(" or of "),
            list(&odd),
            together(),
            odd.iter().map(|s| scatter_asked(s)).collect::<String>()
        ),
    }
}

/// By what data sets that are each a knee's are not one knee's: what one knee leaves of them, else the odds for a knee each.
/// None where neither tells.
fn apart(sets: &[DataSetAlone], two_knees: Option<f64>) -> Option<String> {
    let over: Vec<&str> = sets.iter().filter(|s| s.together > FITS).map(|s| s.source.as_str()).collect();
    if !over.is_empty() {
        return Some(format!("no one knee is both: it leaves too much of {}", over.join(" and of ")));
    }
    let odds = two_knees.filter(|odds| *odds >= NAMED)?;
    Some(format!("a knee each is likelier than one knee, by {} nats, though that leaves little", figures(odds)))
}

/// How much more a data set would have to scatter before a knee of its own fits it: what it leaves is a square.
fn scatter_asked(set: &DataSetAlone) -> String {
    let by = ((set.alone + set.cost) / FITS).sqrt();
    let (source, by) = (&set.source, figures(by));
    format!(" A knee would fit {source} if its readings scattered {by} times as widely as noise and floor say.")
}

/// Which trial to repeat first: of the clearest contradiction the row that stands against most of those near it, or both where that does not tell.
fn to_repeat(of: &[Contradiction]) -> String {
    let Some(first) = of.first() else { return String::new() };
    let place = |w: &Witness| if w.row.is_some() { format!("{} ({})", row(w), w.trial) } else { row(w) };
    let [one, other] = first.readings.each_ref().map(place);
    match first.odd_one().zip(first.contradicts) {
        Some((odd, counts)) => format!(
            "\nTo do first: repeat {}. It contradicts {} readings near it, {} contradicts {}.",
            place(&first.readings[odd]),
            counts[odd],
            row(&first.readings[1 - odd]),
            counts[1 - odd]
        ),
        None if first.readings[0].source == first.readings[1].source => {
            format!("\nTo do first: repeat both {one} and {other}. These data do not tell which of them is off.")
        }
        None => format!(
            "\nTo do first: repeat both {one} and {other} on one knee, with the same load. These data do not tell which of them is off. \
             Compare how the two apparatuses load the knee, where their zeros lie, and what was cut between them."
        ),
    }
}

/// The contradictions as sentences; nothing where there is none.
pub(crate) fn contradictions(of: &[Contradiction]) -> String {
    let mut out = String::new();
    for (k, c) in of.iter().take(IN_HEAD).enumerate() {
        let [one, other] = &c.readings;
        let unit = Coordinate::named(&c.dof).map_or("", Coordinate::unit);
        let place = |w: &Witness| format!("{} ({}, {:.0} deg)", row(w), load(w), w.flexion_deg);
        let lead = if k == 0 { "\nLook at these rows first: " } else { "\nThen at these: " };
        let _ = write!(
            out,
            "{lead}{} reads {} of {}, {} reads {}. A knee of the model that gives the first gives {} (sd {}) in the second, whatever its ligaments. \
             It is {} off: {:.1} sd.",
            place(one),
            with_unit(one.value, unit),
            c.dof.to_uppercase(),
            place(other),
            with_unit(other.value, unit),
            with_unit(c.expected, unit),
            figures(c.sd),
            with_unit((other.value - c.expected).abs(), unit),
            c.deviations()
        );
    }
    out
}

/// A reading's place: "row 12 of kla".
pub fn row(w: &Witness) -> String {
    w.row.map_or_else(|| format!("{} of {}", w.trial, w.source), |row| format!("row {row} of {}", w.source))
}

/// The load of a reading: "178 N of AP".
pub fn load(w: &Witness) -> String {
    let of = |c: Coordinate| w.loads.get(&c.load_column()).copied().unwrap_or(0.0);
    let felt = NO_LOAD.into_iter().filter(|(c, none)| of(*c).abs() > *none);
    let most = felt.max_by(|(a, s), (b, t)| (of(*a).abs() / s).total_cmp(&(of(*b).abs() / t)));
    most.map_or("unloaded".into(), |(c, _)| {
        format!("{} of {}", with_unit(of(c), c.load_unit()), c.name().to_uppercase())
    })
}

/// That none of the catalogue is enough, what stands against each, and what the best of them closes.
/// `nothing`: what is left where nothing is missing.
fn best(why: &Unexplained, nothing: f64) -> String {
    let (single, several): (Vec<&Tried>, Vec<&Tried>) = why.tried.iter().partition(|t| t.effects.len() == 1);
    if single.is_empty() {
        return String::new();
    }
    let pairs = if several.is_empty() { "" } else { ", and the likeliest two by two" };
    let mut out =
        format!("\nEach of {} effects of the catalogue was fitted from its own best start{pairs}", single.len());
    if why.is_proven(nothing) {
        out += &proof(&why.tried, nothing);
    } else if single.iter().chain(&several).all(|t| did_not_converge(t, nothing)) {
        out += ". None of these fits converged, so they prove nothing";
    }
    out += ".";
    if let Some(most) = most_unseen(&single) {
        let together = most_unseen(&several).map_or(String::new(), |most| format!(", and no pair more than {most}"));
        let _ = write!(
            out,
            " Of the likeliest, none alone closes more than {most} of the gap on trials that it was not fitted to{together}."
        );
    }
    out + &open(&why.tried) + &between(why)
}

/// That none is enough, by the fits that converged; of the others that they prove nothing.
fn proof(tried: &[Tried], nothing: f64) -> String {
    let (lost, sound): (Vec<&Tried>, Vec<&Tried>) = tried.iter().partition(|t| did_not_converge(t, nothing));
    let against = stands_against(&sound).join("; ");
    if lost.is_empty() {
        return format!(", and none is enough: {against}");
    }
    let names: Vec<String> =
        lost.iter().map(|t| t.effects.iter().map(|e| e.effect.as_str()).collect::<Vec<_>>().join(" with ")).collect();
    let (lost, sound) = (lost.len(), sound.len());
    format!(
        ", and none is enough of the {sound} fits that converged: {against}. Left out of the proof, since they did not converge: {lost} ({})",
        names.join(", ")
    )
}

/// Whether a row leaves more than the fit of nothing missing (`nothing`) does. It had that fit to fall back on, so it did not converge.
/// An answer of an earlier version does not tell.
pub fn did_not_converge(row: &Tried, nothing: f64) -> bool {
    row.leaves.is_some_and(|leaves| leaves > nothing * (1.0 + CONVERGED))
}

/// How much of what the data sets differ by the likeliest row explains with one knee; nothing where one knee does as well as one for each.
fn between(why: &Unexplained) -> String {
    let Some(differ) = why.two_knees.filter(|odds| *odds >= NAMED) else { return String::new() };
    let most = why.tried.iter().map(|t| t.log_bayes_factor).fold(0.0, f64::max).min(differ);
    let (all, own, share) = (figures(differ), figures(most), 100.0 * most / differ);
    let rest = why.data_sets.iter().filter(|s| s.alone + s.cost > FITS).map(|s| s.source.as_str()).collect::<Vec<_>>();
    let beyond = if rest.is_empty() || most < MOST_OF_IT * differ {
        String::new()
    } else {
        format!(" Beyond that stands what {} leaves even with a knee of its own.", rest.join(" and "))
    };
    format!(
        "\nThe data sets are likelier a knee each than one knee. The likeliest of these effects explains {share:.0} % of that with one knee \
         ({own} of {all} nats).{beyond}"
    )
}

/// The largest share of the gap that any of some rows closes on unseen trials, in words; none where nobody asked, or where it is all.
fn most_unseen(of: &[&Tried]) -> Option<String> {
    let shares = of.iter().filter_map(|t| t.closes_held_out);
    let most = shares.max_by(f64::total_cmp).filter(|most| *most < ALL_OF_IT)?;
    Some(format!("{:.0} %", 100.0 * most.max(0.0)))
}

/// What stands against the rows of a table, each with how many they are; a row may have several.
fn stands_against(tried: &[&Tried]) -> Vec<String> {
    let of = |what: Against| tried.iter().filter(move |t| t.against.contains(&what));
    let least = of(Against::LeavesTooMuch).filter_map(|t| t.leaves).min_by(f64::total_cmp);
    let least = least.map_or(String::new(), |x| format!(", {x:.1} times what noise leaves at the least"));
    let all = [
        (Against::EarnsTooLittle, "earns less than a name takes".to_owned()),
        (Against::LeavesTooMuch, format!("leaves too much and closes too little on other trials{least}")),
        (Against::FieldBeside, "leaves something that has no name".to_owned()),
        (Against::FieldInItsPlace, "is not enough better than something that has no name".to_owned()),
        (Against::RecordsMixedUp, "does worse than an exchange of two records".to_owned()),
    ];
    let told = |(what, words): (Against, String)| {
        let count = of(what).count();
        (count > 0).then(|| format!("{words} ({count} of them)"))
    };
    all.into_iter().filter_map(told).collect()
}

/// Rows against which nothing stands: each would be an answer if it were the likeliest. An answer of an earlier version does not tell.
fn open(tried: &[Tried]) -> String {
    if tried.iter().all(|t| t.against.is_empty()) {
        return String::new();
    }
    let place = |e: &Named| format!("{} in {}", e.effect, e.scope);
    let names = |t: &Tried| t.effects.iter().map(place).collect::<Vec<_>>().join(" with ");
    let open: Vec<String> = tried.iter().filter(|t| t.against.is_empty()).take(OPEN_IN_HEAD).map(names).collect();
    if open.is_empty() {
        return String::new();
    }
    format!(
        " No proof that nothing of the catalogue is enough: nothing stands against {}, but that others are likelier.",
        open.join("; or ")
    )
}

/// Where even the best that was found leaves most; nothing where nobody asked.
pub(crate) fn leaves_most(d: &Diagnosis) -> String {
    let is_too_much = best_row(d).is_some_and(|t| t.against.contains(&Against::LeavesTooMuch));
    d.unexplained.as_ref().map_or(String::new(), |why| leaves_most_of(why, is_too_much))
}

/// The row of the best that was found, where it was tried.
fn best_row(d: &Diagnosis) -> Option<&Tried> {
    let is_best =
        |t: &&Tried| t.effects.iter().map(|e| (&e.effect, &e.scope)).eq(d.best.iter().map(|e| (&e.effect, &e.scope)));
    d.unexplained.iter().flat_map(|why| &why.tried).find(is_best)
}

/// The same of a table; `is_too_much` where that stands against the best.
fn leaves_most_of(why: &Unexplained, is_too_much: bool) -> String {
    if why.left.is_empty() {
        return String::new();
    }
    let one = |l: &Left| {
        let unit = Coordinate::named(&l.dof).map_or("", Coordinate::unit);
        let (read, given) = (with_unit(l.reading.value, unit), with_unit(l.expected, unit));
        format!("{} reads {read} of {}, it gives {given}", row(&l.reading), l.dof.to_uppercase())
    };
    let told: Vec<String> = why.left.iter().take(LEFT_IN_HEAD).map(one).collect();
    let of_set = |s: &DataSetAlone| Some(format!("{} {}", s.source, figures(s.with_best?)));
    let by_set: Vec<String> = why.data_sets.iter().filter_map(of_set).collect();
    let units = "in units of what noise leaves";
    let sets = if by_set.is_empty() { String::new() } else { format!(" ({}, {units})", by_set.join(", ")) };
    let told = told.join("; ");
    if is_too_much {
        format!("\nEven it leaves too much{sets}, most in these rows: {told}.")
    } else {
        format!("\nWhat it leaves{sets} is most in these rows: {told}.")
    }
}

/// What the best that was found closes on trials that it was not fitted to; nothing where nobody asked.
pub(crate) fn closing(d: &Diagnosis) -> String {
    let Some(unseen) = best_row(d).and_then(|t| t.closes_held_out) else { return String::new() };
    format!("; it closes {:.0} % of that gap", 100.0 * unseen.max(0.0))
}

/// Share of the gap on unseen trials, or of what data sets differ by, that is most of it [-].
const MOST_OF_IT: f64 = 0.5;
/// Answers beside the best that are told as closing most of it, at most [-].
const OTHERS: usize = 2;

/// Answers beside the best that close most of the gap on trials that they were not fitted to, with their shares, the largest first.
pub(crate) fn closing_most(d: &Diagnosis) -> Vec<(&[Named], f64)> {
    let is_best = |t: &Tried| {
        let place = |e: &Named| (e.effect.clone(), e.scope.clone());
        t.effects.iter().map(place).eq(d.best.iter().map(place))
    };
    let rows = d.unexplained.iter().flat_map(|why| &why.tried).filter(|t| !is_best(t));
    let shares = rows.filter_map(|t| Some((t.effects.as_slice(), t.closes_held_out?)));
    let mut out: Vec<(&[Named], f64)> = shares.filter(|(_, share)| *share >= MOST_OF_IT).collect();
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out.truncate(OTHERS);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::FREE;
    use std::collections::BTreeMap;

    fn witness(source: &str, row: Option<usize>, ap: f64, value: f64) -> Witness {
        let loads = FREE.into_iter().map(|c| (c.load_column(), if c == AP { ap } else { 0.0 })).collect();
        Witness { source: source.into(), row, trial: "Anterior_90deg_40".into(), flexion_deg: 74.1, loads, value }
    }

    fn named(effect: &str) -> Named {
        Named { effect: effect.into(), scope: "kla".into(), variant: None, parameters: BTreeMap::new() }
    }

    #[test]
    fn a_contradiction_names_both_rows_what_was_read_and_what_a_knee_would_read() {
        let readings = [witness("kla", Some(11), 178.0, 4.8), witness("rks", None, 0.0, 14.4)];
        let told = contradictions(&[contradiction(readings)]);
        for part in [
            "row 11 of kla (178 N of AP, 74 deg) reads 4.80 mm of AP",
            "Anterior_90deg_40 of rks (unloaded",
            "6.25 mm (sd 1.10)",
            "8.15 mm off: 7.7 sd",
        ] {
            assert!(told.contains(part), "{told}");
        }
        assert_eq!(contradictions(&[]), "");
    }

    fn contradiction(readings: [Witness; 2]) -> Contradiction {
        let (dof, noise, z, contradicts) = ("ap".into(), Some([0.4, 0.2]), None, None);
        Contradiction { dof, readings, expected: 6.25, sd: 1.1, surprise: 30.0, noise, z, contradicts }
    }

    #[test]
    fn a_head_has_three_contradictions_and_says_first_what_to_repeat() {
        let readings = |k: usize| [witness("kla", Some(k), 178.0, 4.8), witness("rks", Some(10 + k), 178.0, 14.4)];
        let all: Vec<Contradiction> = (2..8).map(|k| contradiction(readings(k))).collect();
        let told = contradictions(&all);
        assert_eq!(told.lines().filter(|line| !line.is_empty()).count(), IN_HEAD, "{told}");
        // where neither stands out, both are to be repeated, and two apparatuses are to be held against each other
        let both = to_repeat(&all);
        assert!(
            both.contains("row 2 of kla") && both.contains("row 12 of rks") && both.contains("apparatuses"),
            "{both}"
        );
        let one_set = contradiction([witness("rks", Some(3), 178.0, 4.8), witness("rks", Some(4), 178.0, 14.4)]);
        assert!(!to_repeat(&[one_set]).contains("apparatuses"));
        // that which contradicts most others is to be repeated, whichever of the two it is
        for (contradicts, odd) in [([1, 5], "repeat row 12 of rks"), ([5, 1], "repeat row 2 of kla")] {
            let told = to_repeat(&[Contradiction { contradicts: Some(contradicts), ..all[0].clone() }]);
            assert!(told.contains(odd) && told.contains("contradicts 5 readings") && !told.contains("both"), "{told}");
        }
        assert_eq!(to_repeat(&[]), "");
    }

    #[test]
    fn data_sets_that_one_knee_does_not_fit_are_told_from_one_that_no_knee_fits() {
        let set = |source: &str, alone, together| DataSetAlone {
            source: source.into(),
            readings: 100,
            alone,
            cost: 0.2,
            together,
            with_best: None,
        };
        let told = agreement(&[set("kla", 1.1, 1.5), set("rks", 1.3, 6.0)], None);
        assert!(told.contains("Each alone is a knee") && told.contains("too much of rks (kla 1.50"), "{told}");
        let odd = agreement(&[set("kla", 1.1, 4.0), set("rks", 5.0, 6.0)], None);
        assert!(odd.contains("all readings of rks, even alone") && !odd.contains("of kla,"), "{odd}");
        // what is left is a square: at twice the bar a knee fits data that scatter by a root of two more
        let asked = scatter_asked(&DataSetAlone { cost: 0.0, ..set("rks", 2.0 * FITS, 6.0) });
        assert!(asked.contains("scattered 1.41 times"), "{asked}");
        assert!(odd.contains("fit rks if") && !odd.contains("fit kla if"), "{odd}");
        assert_eq!(agreement(&[], None), "");
    }

    /// The head never says the opposite of the odds and of what one knee leaves, which stand beside it.
    #[test]
    fn data_sets_contradict_each_other_only_where_the_odds_or_what_one_knee_leaves_say_so() {
        let set = |source: &str, together| DataSetAlone {
            source: source.into(),
            readings: 100,
            alone: 0.9,
            cost: 0.1,
            together,
            with_best: None,
        };
        for odds in [None, Some(-16.0), Some(0.9 * NAMED), Some(1.1 * NAMED)] {
            for (one, other) in [(0.97, 1.22), (0.97, 1.1 * FITS), (1.1 * FITS, 1.1 * FITS)] {
                let told = agreement(&[set("kla", one), set("rks", other)], odds);
                let (likelier, over) = (odds.is_some_and(|x| x >= NAMED), other > FITS);
                assert_eq!(told.contains("contradict each other"), likelier || over, "{odds:?} {other}: {told}");
                assert_eq!(told.contains("no one knee is both"), over, "{odds:?} {other}: {told}");
                assert_eq!(told.contains("too much of kla"), one > FITS, "{odds:?} {one}: {told}");
                assert_eq!(told.is_empty(), !likelier && !over, "{told}");
            }
        }
    }

    #[test]
    fn what_single_effects_close_is_told_apart_from_what_two_close() {
        let tried = |names: &[&str], unseen: f64| Tried {
            effects: names.iter().map(|name| named(name)).collect(),
            closes: 0.3,
            closes_held_out: Some(unseen),
            leaves: Some(3.2),
            log_bayes_factor: 10.0,
            against: vec![Against::LeavesTooMuch],
        };
        let told =
            |tried: Vec<Tried>| best(&Unexplained { data_sets: vec![], two_knees: None, tried, left: vec![] }, NOTHING);
        let alone = vec![tried(&["gravity"], 0.56), tried(&["itb"], 0.2)];
        let both = [alone.clone(), vec![tried(&["gravity", "itb"], 0.67)]].concat();
        let (alone, both) = (told(alone), told(both));
        assert!(alone.contains("Each of 2 effects") && !alone.contains("two by two"), "{alone}");
        assert!(both.contains("Each of 2 effects") && both.contains("two by two"), "{both}");
        assert!(both.contains("none alone closes more than 56 %") && both.contains("no pair more than 67 %"), "{both}");
        // that none closes more than all says nothing
        for (unseen, is_told) in [(0.99, true), (0.996, false), (1.0, false)] {
            let told = told(vec![tried(&["gravity"], unseen)]);
            assert_eq!(told.contains("none alone closes"), is_told, "{unseen}: {told}");
        }
    }

    /// What the fit of nothing missing leaves, in these tests [-]: more than any of their rows.
    const NOTHING: f64 = 5.5;

    /// A row of the table.
    fn tried(effect: &str, leaves: f64, against: &[Against]) -> Tried {
        Tried {
            effects: vec![named(effect)],
            closes: 0.3,
            closes_held_out: Some(0.2),
            leaves: Some(leaves),
            log_bayes_factor: 10.0,
            against: against.to_vec(),
        }
    }

    #[test]
    fn a_table_is_a_proof_where_something_stands_against_each_row_alone() {
        use Against::{EarnsTooLittle, FieldBeside, LeavesTooMuch};
        let of = |tried: Vec<Tried>| Unexplained { data_sets: vec![], two_knees: None, tried, left: vec![] };
        let rows = vec![
            tried("tibia_frame", 3.5, &[LeavesTooMuch, FieldBeside]),
            tried("load_gain", 3.2, &[LeavesTooMuch]),
            tried("itb", 4.9, &[EarnsTooLittle]),
        ];
        let proven = of(rows.clone());
        assert!(proven.is_proven(NOTHING));
        let told = best(&proven, NOTHING);
        let parts = [
            "none is enough: earns less than a name takes (1 of them)",
            "on other trials, 3.2 times what noise leaves at the least (2 of them)",
            "leaves something that has no name (1 of them)",
        ];
        assert!(parts.iter().all(|part| told.contains(part)), "{told}");
        assert!(!told.contains("No proof"), "{told}");
        // whichever row nothing stands against, it is no proof, and that row is named
        for k in 0..rows.len() {
            let mut open = rows.clone();
            open[k].against.clear();
            let open = of(open);
            let told = best(&open, NOTHING);
            assert!(!open.is_proven(NOTHING) && !told.contains("none is enough"), "{told}");
            assert!(told.contains("No proof") && told.contains(&rows[k].effects[0].effect), "{told}");
        }
        // a table of an earlier version tells neither
        let earlier = of(rows.into_iter().map(|t| Tried { against: vec![], ..t }).collect());
        assert!(!earlier.is_proven(NOTHING) && !best(&earlier, NOTHING).contains("No proof"));
        assert!(!of(vec![]).is_proven(NOTHING));
    }

    /// An effect may be nothing: a fit that leaves more than nothing added has not found its best end, whatever it leaves.
    #[test]
    fn a_fit_that_leaves_more_than_nothing_added_is_named_and_proves_nothing() {
        let rows = ["load_gain", "itb", "mcl_wrap"].map(|e| tried(e, 1.0, &[Against::EarnsTooLittle]));
        for lost in 0..=rows.len() {
            let mut tried = rows.to_vec();
            tried.iter_mut().take(lost).for_each(|t| t.leaves = Some(1.2));
            assert_eq!(tried.iter().filter(|t| did_not_converge(t, 1.1)).count(), lost);
            let table = Unexplained { data_sets: vec![], two_knees: None, tried, left: vec![] };
            let (told, sound) = (best(&table, 1.1), rows.len() - lost);
            assert_eq!(table.is_proven(1.1), sound > 0, "{lost}");
            assert_eq!(told.contains(&format!("earns less than a name takes ({sound} of them)")), sound > 0, "{told}");
            assert_eq!(told.contains("none is enough"), sound > 0, "{told}");
            assert_eq!(told.contains("converge"), lost > 0, "{told}");
            if (1..rows.len()).contains(&lost) {
                assert!(rows[..lost].iter().all(|t| told.contains(&t.effects[0].effect)), "{told}");
                assert!(rows[lost..].iter().all(|t| !told.contains(&t.effects[0].effect)), "{told}");
            }
        }
        assert!(!did_not_converge(&Tried { leaves: None, ..rows[0].clone() }, 1.1), "an earlier answer does not tell");
    }

    #[test]
    fn what_data_sets_differ_by_is_told_apart_from_what_one_of_them_leaves_alone() {
        let set = |source: &str, alone| DataSetAlone {
            source: source.into(),
            readings: 100,
            alone,
            cost: 0.0,
            together: 6.0,
            with_best: None,
        };
        let of = |two_knees, alone, earns| {
            let tried = vec![Tried { log_bayes_factor: earns, ..tried("tibia_frame", 3.1, &[Against::LeavesTooMuch]) }];
            between(&Unexplained {
                data_sets: vec![set("kla", 1.2), set("rks", alone)],
                two_knees,
                tried,
                left: vec![],
            })
        };
        let told = of(Some(198.0), 2.0 * FITS, 162.0);
        assert!(
            told.contains("explains 82 % of that")
                && told.contains("162 of 198 nats")
                && told.contains("what rks leaves even with a knee of its own"),
            "{told}"
        );
        // where every data set is a knee's, or little of the difference is explained, there is nothing beyond it
        assert!(
            !of(Some(198.0), 0.5 * FITS, 162.0).contains("Beyond that")
                && !of(Some(198.0), 2.0 * FITS, 40.0).contains("Beyond that")
        );
        // an effect explains no more of a difference than there is, and none where one knee does as well
        assert!(of(Some(50.0), 4.0, 162.0).contains("50.0 of 50.0 nats"));
        assert_eq!(of(Some(0.5 * NAMED), 4.0, 162.0) + &of(None, 4.0, 162.0), "");
    }

    #[test]
    fn what_even_the_best_leaves_is_told_by_its_rows_and_data_sets() {
        let left = |k: usize| Left {
            dof: "ie".into(),
            reading: witness("rks", Some(k), 0.0, -31.5),
            expected: -20.1,
            z: -9.0,
        };
        let set = DataSetAlone {
            source: "rks".into(),
            readings: 125,
            alone: 3.0,
            cost: 1.0,
            together: 5.0,
            with_best: Some(4.25),
        };
        let why =
            Unexplained { data_sets: vec![set], two_knees: None, tried: vec![], left: (9..14).map(left).collect() };
        let told = leaves_most_of(&why, true);
        assert!(
            told.contains("Even it leaves too much (rks 4.25")
                && told.contains("row 9 of rks reads -31.5 deg of IE, it gives -20.1 deg"),
            "{told}"
        );
        assert_eq!(told.matches(" reads ").count(), LEFT_IN_HEAD, "{told}");
        // where something else stands against it, what it leaves is not called too much
        let told = leaves_most_of(&why, false);
        assert!(told.contains("What it leaves (rks 4.25") && !told.contains("too much"), "{told}");
        assert_eq!(leaves_most_of(&Unexplained { left: vec![], ..why }, true), "");
    }
}
