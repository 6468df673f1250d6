//! Scoring of cuts: whether the structure that was cut is among what an answer reports as possible, and what of whole knees is.

use crate::asked::Hidden;
use crate::hidden::{CUT, CUT_EFFECT};
use crate::laboratory::Truth;
use crate::said::{Said, Score};

/// Whether a state has a loss of a structure among its effects.
fn is_loss_of(state: &[(String, Option<String>)], structure: &str) -> bool {
    state.iter().any(|(effect, about)| effect == CUT_EFFECT && about.as_deref() == Some(structure))
}

/// Counts a case that is a cut of one structure, or a whole knee; another case counts nothing here.
pub(crate) fn count(out: &mut Score, truth: &Truth, said: &Said) {
    let reports = |structure: &str| said.reported.iter().any(|state| is_loss_of(state, structure));
    match &truth.effects[..] {
        [] if truth.kind == "null" => {
            for structure in CUT {
                let key = format!("whole knee: a torn {structure} in what is reported");
                out.shares.entry(key).or_default().count(reports(structure));
            }
            out.beside.push(said.reported.len() as f64);
        }
        [(effect, _, parameters)] if effect == CUT_EFFECT => {
            let hidden = Hidden { effect: effect.clone(), parameters: parameters.clone() };
            let Some((structure, _)) = hidden.cuts() else { return };
            of_a_cut(out, structure, said);
            let others = said.reported.iter().filter(|state| !is_loss_of(state, structure));
            out.beside.push(others.count() as f64);
        }
        _ => {}
    }
}

/// The rows of a cut: its structure's own, and those of all.
fn of_a_cut(out: &mut Score, structure: &str, said: &Said) {
    let is_it = |state: &Vec<(String, Option<String>)>| is_loss_of(state, structure);
    let is_reported = said.reported.iter().any(is_it);
    let rows = [
        ("in what is reported", is_reported),
        ("first of what is reported", said.reported.first().is_some_and(is_it)),
        ("named first", !said.answers.is_empty() && said.reported.first().is_some_and(is_it)),
        ("unnamed without it", said.verdict == "unnamed" && !is_reported),
    ];
    for of in [structure, "all"] {
        for (what, is_so) in rows {
            out.shares.entry(format!("cut, {of}: {what}")).or_default().count(is_so);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hidden::cut;
    use crate::laboratory::Strength;
    use crate::share::Share;
    use std::collections::BTreeMap;

    fn truth(kind: &str) -> Truth {
        let effects: Vec<_> = cut(kind, 1.0).into_iter().map(|h| (h.effect, "both".to_owned(), h.parameters)).collect();
        Truth {
            case: "a".into(),
            kind: kind.into(),
            effects,
            ligaments: BTreeMap::new(),
            contact_scale: 1.0,
            forces_n: BTreeMap::new(),
            beyond: BTreeMap::new(),
            frames: BTreeMap::new(),
            differs: None,
            signature: vec![],
            strength: Strength::default(),
            out_of_joint: vec![],
        }
    }

    fn said(verdict: &str, reported: &[(&str, Option<&str>)]) -> Said {
        let state = |(effect, about): &(&str, Option<&str>)| vec![((*effect).to_owned(), about.map(str::to_owned))];
        let names = |e: &(&str, Option<&str>)| vec![(e.0.to_owned(), "both".to_owned())];
        let is_named = !["none", "unnamed"].contains(&verdict);
        Said {
            verdict: verdict.into(),
            answers: if is_named { reported.iter().take(1).map(names).collect() } else { vec![] },
            reported: reported.iter().map(state).collect(),
            ..Said::default()
        }
    }

    fn counted(cases: &[(&str, Said)]) -> Score {
        let mut out = Score::default();
        cases.iter().for_each(|(kind, said)| count(&mut out, &truth(kind), said));
        out
    }

    #[test]
    fn a_cut_is_in_what_is_reported_by_its_own_structure_alone() {
        let (pcl, acl) = (("structure_loss", Some("PCL")), ("structure_loss", Some("ACL")));
        let score = counted(&[
            ("cut_PCL", said("decisive", &[pcl])),
            ("cut_PCL", said("none", &[acl, pcl])),
            ("cut_PCL", said("unnamed", &[acl])),
            ("cut_PCL", said("none", &[])),
            ("cut_ACL", said("unnamed", &[acl])),
        ]);
        let share = |name: &str| score.shares.get(name).map(|s| (s.hits, s.of));
        assert_eq!(share("cut, PCL: in what is reported"), Some((2, 4)));
        assert_eq!(share("cut, PCL: first of what is reported"), Some((1, 4)));
        assert_eq!(share("cut, PCL: named first"), Some((1, 4)));
        assert_eq!(share("cut, PCL: unnamed without it"), Some((1, 4)));
        assert_eq!(share("cut, ACL: unnamed without it"), Some((0, 1)));
        // not named, though first of what is not excluded
        assert_eq!(share("cut, ACL: named first"), Some((0, 1)));
        assert_eq!(share("cut, all: in what is reported"), Some((3, 5)));
        assert_eq!(score.beside, [0.0, 1.0, 1.0, 0.0, 0.0]);
    }

    #[test]
    fn of_a_whole_knee_each_tear_that_is_reported_counts_and_other_kinds_count_nothing() {
        let tear = |structure| ("structure_loss", Some(structure));
        let score =
            counted(&[("null", said("none", &[tear("LCL"), tear("POL")])), ("gravity", said("none", &[tear("LCL")]))]);
        assert_eq!(score.shares.len(), CUT.len());
        for structure in CUT {
            let of = score.shares[&format!("whole knee: a torn {structure} in what is reported")];
            assert_eq!(of, Share { hits: usize::from(structure == "LCL"), of: 1 }, "{structure}");
        }
        assert_eq!(score.beside, [2.0]);
    }
}
