//! Of the page of a diagnosis: rows that contradict each other, what each effect of the catalogue explains where none is enough, noise other than stated.

use super::html::escaped;
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::report::plain_unnamed::{did_not_converge, load, row};
use diagnosis::report::words::{fixed, signed, sizes};
use diagnosis::report::{Against, Diagnosis, Left, Named, Tried};
use diagnosis::search::contradiction::Witness;
use std::fmt::Write;

/// Readings that no one knee gives.
pub(super) fn contradicting(out: &mut String, d: &Diagnosis) {
    if d.contradictions.is_empty() {
        return;
    }
    *out += "<h2>Rows that contradict each other</h2><p class=\"note\">Near the same load and flexion, and yet of no one knee of the model, whatever its ligaments, sites and frames; but for a knee that rests in two places under one load, of which the map has both near 0. Expected: what a knee that gives the first reading gives in the second trial, with its standard deviation. Off: by how much the second differs from that. z: by how many standard deviations, from one knee fitted to both readings; half its square is the surprise in nats. The one beside the expected reading is of a straight line, so off over it may be another number. Noise: of either reading. Contradicts: how many readings near it each row contradicts; the row that contradicts most others is the odd one. Look at the records of these rows: their signs, their loads, the order of their labels, what was done to the knee between them.</p><table class=\"words\"><tr><th>coordinate</th><th>first</th><th>reads</th><th>second</th><th>reads</th><th>expected</th><th>off</th><th>z</th><th>noise</th><th>contradicts</th></tr>";
    for c in &d.contradictions {
        let place = |w: &Witness| escaped(&format!("{}, {}: {}, {:.1} deg", row(w), w.trial, load(w), w.flexion_deg));
        let [one, other] = &c.readings;
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{} (sd {:.1})</td><td>{}</td><td>{:.1}</td><td>{}</td><td>{}</td></tr>",
            c.dof.to_uppercase(),
            place(one),
            fixed(one.value, 1),
            place(other),
            fixed(other.value, 1),
            fixed(c.expected, 1),
            c.sd,
            fixed(other.value - c.expected, 1),
            c.deviations(),
            c.noise.map_or(String::new(), |[a, b]| format!("{a:.2}; {b:.2}")),
            c.contradicts.map_or(String::new(), |[a, b]| format!("{a}; {b}"))
        );
    }
    *out += "</table>";
}

/// Where nothing is named: whether the data sets agree, and what each effect by itself explains.
pub(super) fn why_unnamed(out: &mut String, d: &Diagnosis) {
    let Some(why) = &d.unexplained else { return };
    if !why.data_sets.is_empty() {
        *out += "<h2>One knee, or one for each data set</h2><p class=\"note\">Sum of squares over the number of readings: about 1 where a knee of the model fits.</p><table><tr><th>data set</th><th>readings</th><th>by a knee of its own</th><th>what that knee costs by its priors</th><th>by the knee of all</th><th>by the best answer</th></tr>";
        for s in &why.data_sets {
            let _ = write!(
                out,
                "<tr><td>{}</td><td>{}</td><td>{:.2}</td><td>{:.2}</td><td>{:.2}</td><td>{}</td></tr>",
                escaped(&s.source),
                s.readings,
                s.alone,
                s.cost,
                s.together,
                s.with_best.map_or(String::new(), |x| format!("{x:.2}"))
            );
        }
        *out += "</table>";
        if let Some(odds) = why.two_knees {
            let odds = fixed(odds, 0);
            let _ = write!(out, "<p>Log odds for a knee of its own in each data set, against one knee: {odds}.</p>");
        }
    }
    each_effect(out, why, d.misfit[0]);
    left(out, &why.left);
}

/// The readings that even the best answer leaves most of.
fn left(out: &mut String, of: &[Left]) {
    if of.is_empty() {
        return;
    }
    *out += "<h2>What even the best of them leaves</h2><p class=\"note\">The readings that are furthest off, one a trial. z: what is left over its standard deviation, noise and floor.</p><table class=\"words\"><tr><th>coordinate</th><th>row</th><th>reads</th><th>the best answer gives</th><th>z</th></tr>";
    for l in of {
        let w = &l.reading;
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            l.dof.to_uppercase(),
            escaped(&format!("{}, {}: {}, {:.1} deg", row(w), w.trial, load(w), w.flexion_deg)),
            fixed(w.value, 1),
            fixed(l.expected, 1),
            signed(l.z, 1)
        );
    }
    *out += "</table>";
}

/// What stands against a row; of one that did not converge, that it is no part of the proof.
fn against(row: &Tried, nothing: f64) -> String {
    let lost = did_not_converge(row, nothing).then(|| "did not converge: left out of the proof".to_owned());
    let told = lost.into_iter().chain(Some(stands_against(&row.against)).filter(|words| !words.is_empty()));
    told.collect::<Vec<_>>().join("; ")
}

/// What stands against it as an answer, in words.
fn stands_against(of: &[Against]) -> String {
    let words = |a: &Against| match a {
        Against::EarnsTooLittle => "earns too little",
        Against::LeavesTooMuch => "leaves too much",
        Against::FieldBeside => "something of no name beside it",
        Against::FieldInItsPlace => "not enough better than something of no name",
        Against::RecordsMixedUp => "two records exchanged",
    };
    of.iter().map(words).collect::<Vec<_>>().join("; ")
}

/// What each effect of the catalogue explains; `nothing`: what is left where nothing is missing.
fn each_effect(out: &mut String, why: &diagnosis::report::Unexplained, nothing: f64) {
    let catalogue = Catalogue::shipped();
    *out += "<h2>What each effect of the catalogue would explain</h2><p class=\"note\">Each was fitted with the ligaments from both ends: beside recalibrated ligaments, and from the force that is out of balance at the measured poses. Its best end counts. The likeliest were also fitted two by two; of these the best stand here. Each row is asked as if it were the answer: the last column says what stands against it. Leaves: in units of what noise leaves, the cost of ligaments, sites and frames included; an answer leaves about 1. A fit that leaves more than one with nothing added did not converge. Closes: share of what recalibrated ligaments leave beyond noise, on the trials that were fitted, and for the likeliest on trials that were not.</p><table><tr><th>effect</th><th>where</th><th>size (90 % interval)</th><th>closes</th><th>on other trials</th><th>leaves</th><th>log Bayes factor</th><th>against it</th></tr>";
    for t in &why.tried {
        let name = |e: &Named| {
            let about = e.variant.as_ref().map(|v| format!(" ({v})")).unwrap_or_default();
            escaped(&format!("{}{about}", e.effect))
        };
        let all =
            |of: &dyn Fn(&Named) -> String, between: &str| t.effects.iter().map(of).collect::<Vec<_>>().join(between);
        let size = |e: &Named| sizes(&catalogue, e, "").iter().map(|s| escaped(s)).collect::<Vec<_>>().join("<br>");
        let unseen = t.closes_held_out.map_or(String::new(), on_other_trials);
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{} %</td><td>{unseen}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            all(&name, " + "),
            all(&|e| escaped(&e.scope), " + "),
            all(&size, "<br>"),
            fixed(100.0 * t.closes, 0),
            t.leaves.map_or(String::new(), |x| format!("{x:.1}")),
            fixed(t.log_bayes_factor, 1),
            against(t, nothing)
        );
    }
    *out += "</table>";
}

/// A share that an effect closes on trials that it was not fitted to, in words: one below nothing is no share.
fn on_other_trials(share: f64) -> String {
    if share < 0.0 { "none: they fit worse with it".to_owned() } else { format!("{:.0} %", 100.0 * share) }
}

/// Noise as stated and as the data have it, where they differ.
pub(super) fn noise(out: &mut String, d: &Diagnosis) {
    if !d.noise.iter().any(|n| n.taken) {
        return;
    }
    *out += "<h2>Noise other than its file states</h2><p class=\"note\">From what is rough between neighbouring loads of one condition; the diagnosis takes it in place of the stated one. What is missing may pass for part of it. Look for trials that were read before the knee had settled, for loose markers, and for a noise that was copied from another apparatus.</p><table><tr><th>data set</th><th>coordinate</th><th>stated</th><th>found</th><th>90 % interval</th></tr>";
    for n in d.noise.iter().filter(|n| n.taken) {
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{:.2}</td><td>{:.2}</td><td>{:.2} to {:.2}</td></tr>",
            escaped(&n.source),
            n.coordinate.to_uppercase(),
            n.stated,
            n.inferred,
            n.lower,
            n.upper
        );
    }
    *out += "</table>";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_against_a_row_has_words_of_its_own() {
        let all = [
            Against::EarnsTooLittle,
            Against::LeavesTooMuch,
            Against::FieldBeside,
            Against::FieldInItsPlace,
            Against::RecordsMixedUp,
        ];
        let mut told: Vec<String> = all.iter().map(|a| stands_against(&[*a])).collect();
        assert_eq!(stands_against(&all), told.join("; "));
        told.sort();
        told.dedup();
        assert_eq!(told.len(), all.len());
        assert_eq!(stands_against(&[]), "");
    }

    /// Whatever stands against it, a row that leaves more than nothing added does is told as such, and no other row is.
    #[test]
    fn a_row_that_did_not_converge_says_so() {
        for reasons in [vec![], vec![Against::EarnsTooLittle], vec![Against::LeavesTooMuch, Against::FieldBeside]] {
            for (leaves, is_lost) in
                [(None, false), (Some(1.05), false), (Some(1.10), false), (Some(1.12), true), (Some(3.3), true)]
            {
                let row = Tried {
                    effects: vec![],
                    closes: 0.0,
                    closes_held_out: None,
                    leaves,
                    log_bayes_factor: -5.0,
                    against: reasons.clone(),
                };
                let told = against(&row, 1.10);
                assert_eq!(told.contains("did not converge: left out of the proof"), is_lost, "{leaves:?}: {told}");
                assert!(told.ends_with(&stands_against(&reasons)) && !told.ends_with("; "), "{told}");
            }
        }
    }

    #[test]
    fn an_effect_that_makes_other_trials_worse_closes_no_share_of_them() {
        assert_eq!(on_other_trials(0.557), "56 %");
        assert_eq!(on_other_trials(0.0), "0 %");
        assert!(
            [-0.02, -1.0].iter().all(|x| on_other_trials(*x).starts_with("none") && !on_other_trials(*x).contains('-'))
        );
    }
}
