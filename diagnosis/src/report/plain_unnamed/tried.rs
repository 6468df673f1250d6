//! That no effect of the catalogue is enough, in plain words: what stands against each, and what none closes.

use super::agreement::FITS;
use super::nearest::MOST_OF_IT;
use crate::criteria::NAMED;
use crate::report::words::figures;
use crate::report::{Against, Named, Tried, Unexplained};
use std::fmt::Write;

/// Share by which a fit may leave more than the fit of nothing missing, and still have converged [-]. Ours: each effect can be nothing, so that a
/// converged fit leaves no more; ends of one search part by less than this.
const CONVERGED: f64 = 0.001;
/// Share of a gap from which a row closes all of it [-]: it rounds to 100 %.
const ALL_OF_IT: f64 = 0.995;
/// Rows in the head that would be answers if they stood first, at most [-].
const OPEN_IN_HEAD: usize = 3;

/// That none of the catalogue is enough, what stands against each, and what the best of them closes.
/// `nothing`: what is left where nothing is missing.
pub(super) fn best(why: &Unexplained, nothing: f64) -> String {
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
    let twice = if sound.iter().any(|t| t.against.len() > 1) { "; some for more than one reason" } else { "" };
    let against = stands_against(&sound).join("; ") + twice;
    if lost.is_empty() {
        return format!(", and none is enough: {against}");
    }
    let names: Vec<String> =
        lost.iter().map(|t| t.effects.iter().map(about).collect::<Vec<_>>().join(" with ")).collect();
    let (lost, sound) = (lost.len(), sound.len());
    format!(
        ", and none is enough of the {sound} fits that converged: {against}. Left out of the proof, since they did not converge: {lost} ({})",
        names.join(", ")
    )
}

/// An effect as the table has it, with the structure or axis that it is about: "structure_loss (PCL)".
fn about(e: &Named) -> String {
    format!("{}{}", e.effect, e.variant.as_ref().map(|v| format!(" ({v})")).unwrap_or_default())
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
    let place = |e: &Named| {
        let scope = if e.scope == "both" { "all data sets" } else { &e.scope };
        format!("{} in {scope}", about(e))
    };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::DataSetAlone;
    use std::collections::BTreeMap;

    fn named(effect: &str) -> Named {
        Named { effect: effect.into(), scope: "kla".into(), variant: None, parameters: BTreeMap::new() }
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
    fn a_row_says_which_structure_it_is_about_and_where() {
        let of = |against: Vec<Against>| {
            let mut lost = tried("structure_loss", 1.0, &against);
            lost.effects[0].variant = Some("PCL".into());
            lost.effects[0].scope = "both".into();
            lost
        };
        let table = |rows: Vec<Tried>| Unexplained { data_sets: vec![], two_knees: None, tried: rows, left: vec![] };
        let other = tried("itb", 1.0, &[Against::EarnsTooLittle]);
        let open = best(&table(vec![of(vec![]), other.clone()]), NOTHING);
        assert!(open.contains("against structure_loss (PCL) in all data sets, but"), "{open}");
        let mut apart = of(vec![Against::EarnsTooLittle]);
        apart.leaves = Some(2.0 * NOTHING);
        let lost = best(&table(vec![apart, other]), NOTHING);
        assert!(lost.contains("did not converge: 1 (structure_loss (PCL))"), "{lost}");
    }
}
