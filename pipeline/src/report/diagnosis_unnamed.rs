//! Of the page of a diagnosis: rows that contradict each other, what each effect of the catalogue explains where none is enough, noise other than stated.

use super::html::escaped;
use diagnosis::catalogue::Catalogue;
use diagnosis::contradiction::Witness;
use diagnosis::plain_unnamed::{load, row};
use diagnosis::report::{Diagnosis, Named};
use diagnosis::words::sizes;
use std::fmt::Write;

/// Readings that no one knee gives.
pub(super) fn contradicting(out: &mut String, d: &Diagnosis) {
    if d.contradictions.is_empty() {
        return;
    }
    *out += "<h2>Rows that contradict each other</h2><p class=\"note\">Near the same load and flexion, and yet of no one knee of the model, whatever its ligaments, sites and frames. Expected: what a knee that gives the first reading gives in the second trial, with its standard deviation. Surprise: half the square of the standard deviations by which the second is off, in nats. Look at the records of these rows first: their signs, their loads, the order of their labels, what was done to the knee between them.</p><table class=\"words\"><tr><th>coordinate</th><th>first</th><th>reads</th><th>second</th><th>reads</th><th>expected</th><th>surprise</th></tr>";
    for c in &d.contradictions {
        let place = |w: &Witness| escaped(&format!("{}, {}: {}, {:.1} deg", row(w), w.trial, load(w), w.flexion_deg));
        let [one, other] = &c.readings;
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{:.1}</td><td>{}</td><td>{:.1}</td><td>{:.1} (sd {:.1})</td><td>{:.0}</td></tr>",
            c.dof.to_uppercase(),
            place(one),
            one.value,
            place(other),
            other.value,
            c.expected,
            c.sd,
            c.surprise
        );
    }
    *out += "</table>";
}

/// Where nothing is named: whether the data sets agree, and what each effect by itself explains.
pub(super) fn why_unnamed(out: &mut String, d: &Diagnosis) {
    let Some(why) = &d.unexplained else { return };
    if !why.data_sets.is_empty() {
        *out += "<h2>One knee, or one for each data set</h2><p class=\"note\">Sum of squares over the number of readings: about 1 where a knee of the model fits.</p><table><tr><th>data set</th><th>readings</th><th>by a knee of its own</th><th>what that knee costs by its priors</th><th>by the knee of all</th></tr>";
        for s in &why.data_sets {
            let _ = write!(
                out,
                "<tr><td>{}</td><td>{}</td><td>{:.2}</td><td>{:.2}</td><td>{:.2}</td></tr>",
                escaped(&s.source),
                s.readings,
                s.alone,
                s.cost,
                s.together
            );
        }
        *out += "</table>";
        if let Some(odds) = why.two_knees {
            let _ = write!(out, "<p>Log odds for a knee of its own in each data set, against one knee: {odds:.0}.</p>");
        }
    }
    each_effect(out, why);
}

/// What each effect of the catalogue explains.
fn each_effect(out: &mut String, why: &diagnosis::report::Unexplained) {
    let catalogue = Catalogue::shipped();
    *out += "<h2>What each effect of the catalogue would explain</h2><p class=\"note\">Each was fitted with the ligaments from both ends: beside recalibrated ligaments, and from the force that is out of balance at the measured poses. Its best end counts. The likeliest were also fitted two by two; of these the best stands here. Closes: share of what recalibrated ligaments leave beyond noise, on the trials that were fitted, and for the likeliest on trials that were not.</p><table><tr><th>effect</th><th>where</th><th>size (90 % interval)</th><th>closes</th><th>on other trials</th><th>log Bayes factor</th></tr>";
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
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.0} %</td><td>{unseen}</td><td>{:.1}</td></tr>",
            all(&name, " + "),
            all(&|e| escaped(&e.scope), " + "),
            all(&size, "<br>"),
            100.0 * t.closes,
            t.log_bayes_factor
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
    fn an_effect_that_makes_other_trials_worse_closes_no_share_of_them() {
        assert_eq!(on_other_trials(0.557), "56 %");
        assert_eq!(on_other_trials(0.0), "0 %");
        assert!(
            [-0.02, -1.0].iter().all(|x| on_other_trials(*x).starts_with("none") && !on_other_trials(*x).contains('-'))
        );
    }
}
