//! Evidence that tests of the program made: data/credibility.toml, and the pages that have its figures.

use super::evidence::{Evidence, Factor};
use super::grade::{Grade, grade, more_is_better};
use serde::Deserialize;

/// What tests of the program found: data/credibility.toml.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfProgram {
    evidence: Vec<Found>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Found {
    id: String,
    factor: String,
    what: String,
    value: f64,
    /// As the page has it.
    told: String,
    unit: String,
    strong: f64,
    adequate: f64,
    why: String,
    page: String,
    test: String,
    /// Of the code of the test when it made the value.
    test_digest: String,
    date: String,
}

/// The table, and the pages that its figures stand on.
const OF_PROGRAM: &str = include_str!("../../../data/credibility.toml");
const PAGES: [(&str, &str); 2] = [
    ("docs/verification.md", include_str!("../../../docs/verification.md")),
    ("docs/convergence.md", include_str!("../../../docs/convergence.md")),
];

fn found() -> Vec<Found> {
    toml::from_str::<OfProgram>(OF_PROGRAM).map(|t| t.evidence).unwrap_or_default()
}

pub(super) fn of_program() -> Vec<Evidence> {
    let page = |name: &str| PAGES.iter().find(|(n, _)| *n == name).map(|(_, text)| *text);
    let one = |f: Found| {
        let limits = [f.strong, f.adequate];
        let (id, factor) = known(&f.id, &f.factor)?;
        let text = page(&f.page)?;
        // a figure that its page does not have is no evidence
        let stands = text.contains(&f.told);
        Some(Evidence {
            id,
            factor,
            what: f.what,
            value: Some(f.value),
            unit: f.unit,
            limits,
            more_is_better: more_is_better(limits),
            grade: if stands { grade(f.value, limits) } else { Grade::NoEvidence },
            why: f.why,
            stage: None,
            test: Some(f.test),
            test_digest: Some(f.test_digest),
            digest: Some(crate::record::hash(text.as_bytes())),
            date: Some(f.date),
            as_built: Some(stands),
            flexions_deg: vec![],
            file: f.page,
            astray: vec![],
        })
    };
    found().into_iter().filter_map(one).collect()
}

/// The ids of the program's evidence with their factors.
const IDS: [(&str, &str, Factor); 6] = [
    ("closed-answers", "code-verification", Factor::CodeVerification),
    ("order", "code-verification", Factor::CodeVerification),
    ("energy", "code-verification", Factor::CodeVerification),
    ("two-solvers", "code-verification", Factor::CodeVerification),
    ("published-frames", "code-verification", Factor::CodeVerification),
    ("mesh-convergence", "calculation-verification", Factor::CalculationVerification),
];

fn known(id: &str, factor: &str) -> Option<(&'static str, Factor)> {
    IDS.iter().find(|(i, f, _)| *i == id && *f == factor).map(|(id, _, factor)| (*id, *factor))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_the_program_stand_on_their_pages() {
        let told = of_program();
        assert_eq!(told.len(), IDS.len());
        for e in &told {
            assert_eq!(e.as_built, Some(true), "{}: {} does not have its figure", e.id, e.file);
            assert!(e.grade > Grade::Weak, "{}", e.id);
        }
        for f in found() {
            assert!(
                f.told.contains(&format!("{}", f.value)) || f.told.contains(&format!("{:e}", f.value)),
                "{}: {} told as {}",
                f.id,
                f.value,
                f.told
            );
        }
    }
}
