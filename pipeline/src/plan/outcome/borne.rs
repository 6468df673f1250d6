//! Grafts that bear too much: more than the ligament in whose place they run fails at, or much while nothing loads the knee.

use crate::plan::file::{GraftFile, SiteFile};
use crate::plan::numbers::Value;
use sim::flags::{FAILURE_N, Flag};
use sim::names::is_of;
use std::collections::BTreeMap;

/// A graft that bears more than this while nothing loads the knee is marked [N]; ours: some three times what a hand pulls when it is fixed.
const MOST_UNLOADED_N: f64 = 250.0;

/// The ligament whose place percentages of a site tell.
const BY_PERCENT: &str = "ACL";

/// The tension at which a ligament fails, by its name or that of one of its bundles [N]; none where no source was read.
fn failure_n(name: &str) -> Option<f64> {
    FAILURE_N.iter().find(|(ligament, _)| is_of(name, ligament)).map(|(_, most)| *most)
}

/// The tension at which the ligament fails in whose place a graft runs [N]; none where both of its sites are points.
fn replaced_n(graft: &GraftFile) -> Option<f64> {
    let of = |site: &SiteFile| match &site.native {
        Some(name) => failure_n(name),
        None => site.quadrant_percent.or(site.plateau_percent).and_then(|_| failure_n(BY_PERCENT)),
    };
    of(&graft.femur).or_else(|| of(&graft.tibia))
}

/// What is odd about what the grafts bear in a test, in few words. `values` are those of a state; without its grafts it has none of these.
pub(super) fn too_much(grafts: &[GraftFile], test: &str, values: &BTreeMap<String, Value>) -> Vec<String> {
    let mut out = Vec::new();
    for graft in grafts {
        let Some(force) = values.get(&format!("graft_{}_n", graft.name)) else { continue };
        if replaced_n(graft).is_some_and(|most| force.value > most) {
            out.push(Flag::Torn(graft.name.clone()).to_string());
        }
        if test == "unloaded" && force.value > MOST_UNLOADED_N {
            out.push(format!("{} beyond {MOST_UNLOADED_N} N unloaded", graft.name));
        }
    }
    out
}

/// How many of the first plans have such a graft, in a sentence without its stop; none where there is no plan.
pub(in crate::plan) fn among(first: &[bool]) -> Option<String> {
    let (marked, all) = (first.iter().filter(|is| **is).count(), first.len());
    let who = match (marked, all) {
        (_, 0) => return None,
        (0, 1) => "The plan has no graft".to_owned(),
        (_, 1) => "The plan has a graft".to_owned(),
        (0, _) => format!("None of the first {all} plans has a graft"),
        (1, _) => format!("1 of the first {all} plans has a graft"),
        _ => format!("{marked} of the first {all} plans have a graft"),
    };
    Some(format!("{who} beyond its failure load or beyond {MOST_UNLOADED_N} N unloaded"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::file::{EXAMPLE, parsed};

    fn graft(name: &str, femur: SiteFile) -> GraftFile {
        let tibia = SiteFile { point_mm: Some([0.0; 3]), ..SiteFile::default() };
        GraftFile { name: name.into(), femur, tibia, ..parsed(EXAMPLE).unwrap().graft.remove(0) }
    }

    fn native(name: &str) -> SiteFile {
        SiteFile { native: Some(name.into()), ..SiteFile::default() }
    }

    #[test]
    fn a_graft_is_marked_beyond_either_limit_and_not_at_it() {
        let by_percent = SiteFile { quadrant_percent: Some([25.0, 28.0]), ..SiteFile::default() };
        let at_a_point = SiteFile { point_mm: Some([1.0; 3]), ..SiteFile::default() };
        let taut = "g beyond 250 N unloaded";
        let torn = "g beyond its failure load";
        for (femur, test, force, words) in [
            (native("ACL_AM"), "unloaded", 250.0, vec![]),
            (native("ACL_AM"), "unloaded", 250.1, vec![taut]),
            (native("ACL_AM"), "anterior drawer", 2160.0, vec![]),
            (native("ACL_AM"), "anterior drawer", 2160.1, vec![torn]),
            (by_percent, "unloaded", 2200.0, vec![torn, taut]),
            (native("ALS"), "unloaded", 220.0, vec![torn]),
            (native("sMCL_A"), "valgus", 499.0, vec![torn]),
            // of these no failure load is known
            (native("dMCL"), "valgus", 9000.0, vec![]),
            (at_a_point, "unloaded", 9000.0, vec![taut]),
        ] {
            let force = Value { value: force, mean: None, lower: None, upper: None };
            let values = BTreeMap::from([("graft_g_n".to_owned(), force)]);
            let grafts = [graft("g", femur.clone()), graft("not in", native("ACL"))];
            assert_eq!(too_much(&grafts, test, &values), words, "{femur:?} {test} {force:?}");
        }
    }

    #[test]
    fn few_words_say_how_many_of_the_first_are_marked() {
        let end = "beyond its failure load or beyond 250 N unloaded";
        for (first, who) in [
            (&[true, false, true][..], "2 of the first 3 plans have a graft"),
            (&[false, true], "1 of the first 2 plans has a graft"),
            (&[false, false], "None of the first 2 plans has a graft"),
            (&[true], "The plan has a graft"),
            (&[false], "The plan has no graft"),
        ] {
            assert_eq!(among(first).unwrap(), format!("{who} {end}"));
        }
        assert!(among(&[]).is_none());
    }
}
