//! What `unnamed` means, in plain words: whether the data agree with each other, which rows do not, and that no effect of the catalogue is enough.

use crate::contradiction::{Contradiction, Witness};
use crate::report::Diagnosis;
use crate::report::{DataSetAlone, Named, Tried, Unexplained};
use crate::trial::NoiseScale;
use crate::words::{figures, with_unit};
use sim::coordinate::{AP, Coordinate, IE, ML, VV};
use std::fmt::Write;

/// Sum of squares over the number of readings up to which a knee fits a data set [-]. Ours: twice what noise and floor leave.
const FITS: f64 = 2.0;
/// Forces and moments that are none: VV, IE [N m], ML, AP [N]; what a robot leaves where it is asked for nothing.
const NO_LOAD: [(Coordinate, f64); 4] = [(VV, 1.0), (IE, 1.0), (ML, 10.0), (AP, 10.0)];

/// What `unnamed` means.
pub(crate) fn meaning(d: &Diagnosis) -> String {
    let Some(why) = &d.unexplained else {
        return "Something is missing from the model that no effect of the catalogue explains.".into();
    };
    let mut out = agreement(&why.data_sets);
    if out.is_empty() {
        out = "Something is missing from the model that no effect of the catalogue explains.".into();
    }
    out + &contradictions(&d.contradictions) + &best(why)
}

/// Whether each data set is a knee's, and all are one knee's; nothing where the data sets say nothing of it.
fn agreement(sets: &[DataSetAlone]) -> String {
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
        (false, true) => format!(
            "The data sets contradict each other. Each alone is a knee of the model (left over, in units of what noise leaves: {}), but no one knee is both ({}).",
            list(&fitted),
            together()
        ),
        _ => format!(
            "No knee of the model gives all readings of {}, even alone (left over, in units of what noise leaves: {}; with all data sets: {}).",
            odd.iter().map(|s| s.source.as_str()).collect::<Vec<_>>().join(" or of "),
            list(&odd),
            together()
        ),
    }
}

/// The contradictions as sentences; nothing where there is none.
pub(crate) fn contradictions(of: &[Contradiction]) -> String {
    let mut out = String::new();
    for (k, c) in of.iter().enumerate() {
        let [one, other] = &c.readings;
        let unit = Coordinate::named(&c.dof).map_or("", Coordinate::unit);
        let place = |w: &Witness| format!("{} ({}, {:.0} deg)", row(w), load(w), w.flexion_deg);
        let lead = if k == 0 { "\nLook at these rows first: " } else { "\nThen at these: " };
        let _ = write!(
            out,
            "{lead}{} reads {} of {}, {} reads {}. A knee of the model that gives the first gives {} (sd {}) in the second, whatever its ligaments.",
            place(one),
            with_unit(one.value, unit),
            c.dof.to_uppercase(),
            place(other),
            with_unit(other.value, unit),
            with_unit(c.expected, unit),
            figures(c.sd)
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

/// That none of the catalogue is enough, and which comes nearest.
fn best(why: &Unexplained) -> String {
    let single = why.tried.iter().filter(|t| t.effects.len() == 1);
    let unseen = |t: &&Tried| t.closes_held_out.is_some();
    let most = single.clone().filter(unseen).max_by(|a, b| share(a).total_cmp(&share(b)));
    let Some(most) = most else { return String::new() };
    let pairs = if single.clone().count() < why.tried.len() { ", and the likeliest two by two" } else { "" };
    format!(
        "\nEach of {} effects of the catalogue was fitted from both ends{pairs}: of the likeliest, none alone closes more than {:.0} % of the gap on trials that it was not fitted to.",
        single.count(),
        100.0 * share(most).max(0.0)
    )
}

/// What the best that was found closes on trials that it was not fitted to; nothing where nobody asked.
pub(crate) fn closing(d: &Diagnosis) -> String {
    let of_best =
        |t: &&Tried| t.effects.iter().map(|e| (&e.effect, &e.scope)).eq(d.best.iter().map(|e| (&e.effect, &e.scope)));
    let found = d.unexplained.iter().flat_map(|why| &why.tried).find(of_best);
    let Some(unseen) = found.and_then(|t| t.closes_held_out) else { return String::new() };
    format!("; it closes {:.0} % of that gap", 100.0 * unseen.max(0.0))
}

/// Share of the gap on unseen trials that is most of it [-].
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

fn share(t: &Tried) -> f64 {
    t.closes_held_out.unwrap_or(t.closes)
}

/// What scatters more than its file states, as a finding; nothing where all is as stated, or less.
pub(crate) fn noise(of: &[NoiseScale]) -> String {
    let mut out = String::new();
    let mut told: Vec<&str> = Vec::new();
    let is_more = |n: &&NoiseScale| n.taken && n.inferred > n.stated;
    for set in of.iter().filter(is_more) {
        if told.contains(&set.source.as_str()) {
            continue;
        }
        told.push(&set.source);
        let own = of.iter().filter(is_more).filter(|n| n.source == set.source);
        let each: Vec<String> = own.map(scatter).collect();
        let _ = write!(
            out,
            "\n{} scatters between neighbouring loads more than its file states: {}.",
            set.source,
            each.join(", ")
        );
    }
    out
}

/// "VV by 3.18 deg (stated: 0.500)".
fn scatter(n: &NoiseScale) -> String {
    let unit = Coordinate::named(&n.coordinate).map_or("", Coordinate::unit);
    format!("{} by {} (stated: {})", n.coordinate.to_uppercase(), with_unit(n.inferred, unit), figures(n.stated))
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
        let told =
            contradictions(&[Contradiction { dof: "ap".into(), readings, expected: 6.25, sd: 1.1, surprise: 30.0 }]);
        for part in [
            "row 11 of kla (178 N of AP, 74 deg) reads 4.80 mm of AP",
            "Anterior_90deg_40 of rks (unloaded",
            "6.25 mm (sd 1.10)",
        ] {
            assert!(told.contains(part), "{told}");
        }
        assert_eq!(contradictions(&[]), "");
    }

    #[test]
    fn data_sets_that_one_knee_does_not_fit_are_told_from_one_that_no_knee_fits() {
        let set = |source: &str, alone, together| DataSetAlone {
            source: source.into(),
            readings: 100,
            alone,
            cost: 0.2,
            together,
        };
        assert!(agreement(&[set("kla", 1.1, 4.0), set("rks", 1.3, 6.0)]).contains("Each alone is a knee"));
        let odd = agreement(&[set("kla", 1.1, 4.0), set("rks", 5.0, 6.0)]);
        assert!(odd.contains("all readings of rks, even alone") && !odd.contains("of kla,"), "{odd}");
        assert_eq!(agreement(&[]), "");
    }

    #[test]
    fn what_single_effects_close_is_told_apart_from_what_two_close() {
        let tried = |names: &[&str], unseen: f64| Tried {
            effects: names.iter().map(|name| named(name)).collect(),
            closes: 0.3,
            closes_held_out: Some(unseen),
            log_bayes_factor: 10.0,
        };
        let told = |tried: Vec<Tried>| best(&Unexplained { data_sets: vec![], two_knees: None, tried });
        let alone = vec![tried(&["gravity"], 0.56), tried(&["itb"], 0.2)];
        let both = [alone.clone(), vec![tried(&["gravity", "itb"], 0.67)]].concat();
        let (alone, both) = (told(alone), told(both));
        assert!(alone.contains("Each of 2 effects") && !alone.contains("two by two"), "{alone}");
        assert!(both.contains("Each of 2 effects") && both.contains("two by two"), "{both}");
        assert!(both.contains("none alone closes more than 56 %"), "{both}");
    }

    #[test]
    fn noise_other_than_stated_is_a_finding_and_noise_as_stated_is_none() {
        let of = |coordinate: &str, inferred, taken| NoiseScale {
            source: "kla".into(),
            coordinate: coordinate.into(),
            stated: 0.5,
            inferred,
            lower: 0.8 * inferred,
            upper: 1.2 * inferred,
            taken,
        };
        let told = noise(&[of("vv", 4.0, true), of("ml", 0.52, false), of("ap", 0.2, true)]);
        assert!(
            told.contains("kla scatters")
                && told.contains("VV by 4.00 deg (stated: 0.500)")
                && !told.contains("ML")
                && !told.contains("AP")
        );
        assert_eq!(noise(&[of("ml", 0.52, false)]), "");
    }
}
