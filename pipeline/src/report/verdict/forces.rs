//! What is asked of the ligament forces of a calibrated knee.

use super::super::values::Values;
use super::Check;
use calibration::calibrate::Calibrated;
use calibration::posterior::FORCE_DETERMINED_N;

/// Tension of all ligaments without load that a knee may have, 0 to 90 deg [N]. Published parameters on a knee give 9 to 109 N.
const MOST_REST_N: f64 = 250.0;
/// Force of a cruciate under the drawer that its antagonist holds [N]. The paper has none [andreassen2025, table 5].
const MOST_ANTAGONIST_N: f64 = 20.0;

/// Tension at rest, cruciates against each other, forces that laxity leaves open.
pub(super) fn checks(name: &str, found: &Calibrated, v: &Values) -> Vec<Check> {
    let mut out = Vec::new();
    if let Some(most) = found.rest.iter().max_by(|a, b| a.value_n.total_cmp(&b.value_n)) {
        out.push(Check {
            question: "How tense are the ligaments without load?",
            answer: format!(
                "{name}: at most {:.0} N in all, at {:.0} deg (90 % interval {:.0} to {:.0} N; limit {MOST_REST_N:.0} N)",
                most.value_n, most.fe_deg, most.lower_n, most.upper_n
            ),
            good: Some(most.value_n <= MOST_REST_N),
            stage: "calibrate",
        });
    }
    let Some(bundles) = v.assembled.as_ref().map(|a| &a.spec.bundles) else { return out };
    let forces = found.forces.iter().filter_map(|f| Some((f, bundles.get(f.bundle)?.name.as_str(), f.value_n?)));
    let antagonist = forces.clone().filter(|(f, bundle, _)| {
        let against = if f.trial.starts_with("anterior") { "PCL" } else { "ACL" };
        bundle.starts_with(against)
    });
    if let Some((f, bundle, most)) = antagonist.max_by(|a, b| a.2.total_cmp(&b.2)) {
        out.push(Check {
            question: "Does a cruciate pull against a drawer that the other holds?",
            answer: format!("{name}: at most {most:.0} N, {bundle} under {} (limit {MOST_ANTAGONIST_N:.0} N)", f.trial),
            good: Some(most <= MOST_ANTAGONIST_N),
            stage: "calibrate",
        });
    }
    let open = forces.clone().filter(|(f, ..)| f.upper_n > FORCE_DETERMINED_N && !f.is_determined()).count();
    let all = forces.count();
    if all > 0 {
        let next = found.next_tests.first().map_or(String::new(), |t| format!("; {}", t.words()));
        out.push(Check {
            question: "Which ligament forces does laxity leave open?",
            answer: format!(
                "{name}: {open} of {all} bundle forces under drawers have a 90 % interval that reaches more than {FORCE_DETERMINED_N:.0} N from the value{next}"
            ),
            good: None,
            stage: "calibrate",
        });
    }
    out
}
