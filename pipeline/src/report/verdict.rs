//! What the build comes to, in a sentence and a table of questions.

mod forces;

use super::values::Values;
use stages::assemble::AssembleOptions;

/// An answer to a question one asks of a build first.
pub(super) struct Check {
    pub(super) question: &'static str,
    pub(super) answer: String,
    /// True where it is as it should be; `None` where there is no bound to hold it to.
    pub(super) good: Option<bool>,
    /// The stage that tells more.
    pub(super) stage: &'static str,
}

/// One of the three figures that matter most.
pub(super) struct KeyFigure {
    pub(super) name: &'static str,
    pub(super) value: String,
    pub(super) limit: String,
    /// True within its limit; `None` where there is none, or nothing to hold it to.
    pub(super) good: Option<bool>,
}

/// Largest misfit of a calibration, in times the stated noise, that counts as an answer. Ours: beyond it the model lacks something.
const MOST_NOISE: f64 = 2.0;

/// Where the scans lie, whether the mesh is sound, how well the knee is answered; as far as the build has come.
pub(super) fn figures(v: &Values) -> Vec<KeyFigure> {
    let mut out = Vec::new();
    if let Some(r) = &v.registration {
        let limit = v.options.register.error_limit_mm;
        let worst = r.bones.named().into_iter().map(|(_, b)| b.predicted_error_mm).fold(0.0, f64::max);
        out.push(KeyFigure {
            name: "predicted error of the registration",
            value: format!("{worst:.2} mm"),
            limit: format!("limit {limit:.2} mm"),
            good: Some(worst <= limit),
        });
    }
    if let Some(worst) = smallest_jacobian(v) {
        let limit = v.options.hexmesh.least_scaled_jacobian;
        out.push(KeyFigure {
            name: "smallest scaled Jacobian of an element",
            value: format!("{worst:.2}"),
            limit: format!("must exceed {limit:.1}; 1 is a cube"),
            good: Some(worst > limit),
        });
    }
    let misfits = v.calibration.iter().flat_map(|c| &c.sources);
    let worst = misfits.map(|(_, o)| o.found.noise_scale.iter().copied().fold(0.0, f64::max)).fold(0.0, f64::max);
    if v.calibration.is_some() {
        out.push(KeyFigure {
            name: "largest misfit to measured laxity",
            value: format!("{worst:.1} times the noise"),
            limit: format!("limit {MOST_NOISE:.0} times the stated noise"),
            good: Some(worst < MOST_NOISE),
        });
    } else if v.assembled.is_some() {
        out.push(KeyFigure {
            name: "ligaments have the literature's parameters",
            value: "not calibrated".into(),
            limit: "measured laxity calibrates them".into(),
            good: None,
        });
    }
    out
}

/// The smallest scaled Jacobian of all elements after the overlap is taken out.
fn smallest_jacobian(v: &Values) -> Option<f64> {
    let h = v.separated.as_ref()?;
    let all = h.meshes.named().into_iter().flat_map(|(_, m)| (0..m.elements.len()).map(|e| m.scaled_jacobian(e)));
    Some(all.fold(1.0, f64::min))
}

/// The questions, as far as the build has come.
pub(super) fn checks(v: &Values) -> Vec<Check> {
    let mut out = Vec::new();
    if let Some(r) = &v.registration {
        let worst = r.bones.named().into_iter().map(|(_, b)| b.predicted_error_mm).fold(0.0, f64::max);
        out.push(Check {
            question: "Do the scans lie on their bones?",
            answer: format!("predicted error at most {worst:.2} mm (limit {:.2})", v.options.register.error_limit_mm),
            good: Some(worst <= v.options.register.error_limit_mm),
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
    out.extend(law(v));
    if let Some(h) = &v.separated {
        let worst = smallest_jacobian(v).unwrap_or(1.0);
        out.push(Check {
            question: "Are the hexahedra sound?",
            answer: format!(
                "smallest scaled Jacobian {worst:.2} after the overlap is taken out (0 or less is inverted)"
            ),
            good: Some(worst > v.options.hexmesh.least_scaled_jacobian),
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

/// Whose cartilage the contact law is.
fn law(v: &Values) -> Option<Check> {
    let contact = &v.assembled.as_ref()?.spec.contact;
    let published = &AssembleOptions::default();
    let answer = if let Some(l) = &v.contact_law {
        format!("this knee's: fitted to its own cartilage, forces within {:.1} %", l.fit_error_percent)
    } else if (&contact.overclosure_mm, &contact.pressure_mpa) == (&published.overclosure_mm, &published.pressure_mpa) {
        "that published of S192803; contact-law.fit=true fits one to the knee at hand".to_owned()
    } else {
        "the one given in the options".to_owned()
    };
    Some(Check { question: "Whose contact law is it?", answer, good: None, stage: "assemble" })
}

fn calibration(v: &Values) -> Vec<Check> {
    let mut out = Vec::new();
    for (name, outcome) in v.calibration.iter().flat_map(|c| c.all()) {
        let found = &outcome.found;
        let units = ["deg VV", "deg IE", "mm ML", "mm AP", "mm SI"];
        let rms: Vec<String> =
            found.rms.iter().zip(units).filter_map(|(r, u)| r.map(|r| format!("{r:.1} {u}"))).collect();
        let worst = found.noise_scale.iter().copied().fold(0.0, f64::max);
        let ligaments = &found.parameters;
        let determined = ligaments.iter().filter(|p| p.determined > 0.5).count();
        out.push(Check {
            question: "Does the model answer as the knee did?",
            answer: format!(
                "{name}: misses by {} (root mean square of {} trials), up to {worst:.1} times the noise stated; {determined} of {} ligament parameters determined by the data",
                rms.join(", "),
                outcome.trials.len(),
                ligaments.len()
            ),
            good: Some(worst < MOST_NOISE),
            stage: "calibrate",
        });
        out.extend(forces::checks(name, found, v));
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
