//! What the build comes to, in a sentence and a table of questions.

use super::values::Values;
use stages::register::RegisterOptions;

/// An answer to a question one asks of a build first.
pub(super) struct Check {
    pub(super) question: &'static str,
    pub(super) answer: String,
    /// True where it is as it should be; `None` where there is no bound to hold it to.
    pub(super) good: Option<bool>,
    /// The stage that tells more.
    pub(super) stage: &'static str,
}

/// The questions, as far as the build has come.
pub(super) fn checks(v: &Values) -> Vec<Check> {
    let mut out = Vec::new();
    if let Some(r) = &v.registration {
        let worst = r.bones.named().into_iter().map(|(_, b)| b.predicted_error_mm).fold(0.0, f64::max);
        out.push(Check {
            question: "Do the scans lie on their bones?",
            answer: format!(
                "predicted error at most {worst:.2} mm (limit {:.2})",
                RegisterOptions::default().error_limit_mm
            ),
            good: Some(worst <= RegisterOptions::default().error_limit_mm),
            stage: "register",
        });
    }
    if let Some(c) = &v.cartilage {
        let words = c.solids.named().map(|(name, s)| format!("{} {:.0} mm3", name.replace('_', " "), s.solid.volume()));
        out.push(Check {
            question: "How much cartilage is there?",
            answer: words.join(", "),
            good: None,
            stage: "cartilage",
        });
    }
    if let Some(a) = &v.attachments {
        let count = |source| a.sites.iter().filter(|s| s.source == source).count();
        out.push(Check {
            question: "Where do the ligament sites come from?",
            answer: format!(
                "{} marked on the specimen, {} literature, {} given",
                count(attachments::site::Source::Marked),
                count(attachments::site::Source::Literature),
                count(attachments::site::Source::Given)
            ),
            good: None,
            stage: "attachments",
        });
    }
    if let Some(h) = &v.separated {
        let all = h.meshes.named().into_iter().flat_map(|(_, m)| (0..m.elements.len()).map(|e| m.scaled_jacobian(e)));
        let worst = all.fold(1.0, f64::min);
        out.push(Check {
            question: "Are the hexahedra sound?",
            answer: format!(
                "smallest scaled Jacobian {worst:.2} after the overlap is taken out (0 or less is inverted)"
            ),
            good: Some(worst > 0.0),
            stage: "overclosure",
        });
        if let Some(gap) = h.metrics["gap_min_mm"].as_f64() {
            let before = h.metrics["max_overclosure_before_mm"].as_f64().unwrap_or(0.0);
            out.push(Check {
                question: "Is the cartilage free of overlap?",
                answer: format!("largest overlap {before:.2} mm before, smallest gap {gap:.3} mm after"),
                good: Some(gap >= 0.0),
                stage: "overclosure",
            });
        }
    }
    out.extend(calibration(v));
    out
}

fn calibration(v: &Values) -> Vec<Check> {
    let mut out = Vec::new();
    for (name, outcome) in v.calibration.iter().flat_map(|c| &c.sources) {
        let found = &outcome.found;
        let units = ["deg VV", "deg IE", "mm ML", "mm AP", "mm SI"];
        let rms: Vec<String> =
            found.rms.iter().zip(units).filter_map(|(r, u)| r.map(|r| format!("{r:.1} {u}"))).collect();
        let worst = found.noise_scale.iter().copied().fold(0.0, f64::max);
        let ligaments: Vec<_> = found.parameters.iter().filter(|p| p.number < calibration::frames::FIRST).collect();
        let determined = ligaments.iter().filter(|p| p.determined > 0.5).count();
        out.push(Check {
            question: "Does the model answer as the knee did?",
            answer: format!(
                "{name}: misses by {} (root mean square of {} trials), up to {worst:.1} times the noise stated; {determined} of {} ligament parameters determined by the data",
                rms.join(", "),
                outcome.trials.len(),
                ligaments.len()
            ),
            good: Some(worst < 2.0),
            stage: "calibrate",
        });
    }
    for source in v.validation.iter().flat_map(|v| &v.sources) {
        let odd: Vec<&str> = source
            .protocols()
            .into_iter()
            .filter(|(_, rows)| rows.iter().any(|r| !r.flags.is_empty()))
            .map(|(p, _)| p)
            .collect();
        out.push(Check {
            question: "Do the protocols run to their end?",
            answer: if odd.is_empty() {
                format!("{}: all of them", source.name)
            } else {
                format!("{}: look at {}", source.name, odd.join(", "))
            },
            good: Some(odd.is_empty()),
            stage: "validate",
        });
    }
    out
}
