//! Factors, grades and pieces of evidence.

use super::grade::{Grade, Level};
use schemars::JsonSchema;
use serde::Serialize;

/// A credibility factor, in the order of the standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Factor {
    /// Does the code solve its equations?
    CodeVerification,
    /// Are they solved closely enough for this knee?
    CalculationVerification,
    /// Are they the right ones?
    ModelForm,
    /// Are its inputs known?
    ModelInputs,
    /// How many and which samples was it held against, under which conditions?
    Comparator,
    /// Were model and measurement asked the same?
    Equivalence,
    /// How far apart are they?
    OutputComparison,
    /// Does all this bear on what is asked?
    Applicability,
}

/// All factors, in order.
pub(super) const FACTORS: [Factor; 8] = [
    Factor::CodeVerification,
    Factor::CalculationVerification,
    Factor::ModelForm,
    Factor::ModelInputs,
    Factor::Comparator,
    Factor::Equivalence,
    Factor::OutputComparison,
    Factor::Applicability,
];

impl Factor {
    /// Its name, and what it asks.
    pub(super) fn words(self) -> (&'static str, &'static str) {
        match self {
            Factor::CodeVerification => ("Code verification", "Does the program solve its equations?"),
            Factor::CalculationVerification => ("Calculation verification", "Are they solved closely enough here?"),
            Factor::ModelForm => ("Model form", "Are they the right equations?"),
            Factor::ModelInputs => ("Model inputs", "Is what goes in known?"),
            Factor::Comparator => ("Comparator", "What was it held against: samples and conditions?"),
            Factor::Equivalence => ("Equivalence of inputs", "Were model and measurement asked the same?"),
            Factor::OutputComparison => ("Output comparison", "How far apart are they?"),
            Factor::Applicability => ("Applicability", "Does all this bear on what is asked?"),
        }
    }
}

/// One number, what made it, and what it is worth.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Evidence {
    /// Its name, for programs.
    pub id: &'static str,
    /// The factor it speaks to.
    pub factor: Factor,
    /// What was measured or counted.
    pub what: String,
    /// The number; none where there is no evidence.
    pub value: Option<f64>,
    /// Its unit; "-" for a share or a count.
    pub unit: String,
    /// From where on the grade is strong, and adequate.
    pub limits: [f64; 2],
    /// Whether more is better.
    pub more_is_better: bool,
    /// The grade.
    pub grade: Grade,
    /// Why the limits are as they are.
    pub why: String,
    /// The stage of the build that made it; none of what a test of the program made.
    pub stage: Option<String>,
    /// The test that made it; none of what the build made.
    pub test: Option<String>,
    /// blake3 of the code of that test when it made the number, without blank lines and comments; none of what the build made.
    pub test_digest: Option<String>,
    /// The file that holds it.
    pub file: String,
    /// blake3 of that file.
    pub digest: Option<String>,
    /// The day on which that file was written.
    pub date: Option<String>,
    /// Whether the file is as the stage left it; false where it is gone.
    pub as_built: Option<bool>,
    /// Flexions of the rows that it was taken from [deg]; told of what answers an open question.
    pub flexions_deg: Vec<f64>,
    /// Files that it was asked of, and that are not as their stages left them; the page has them in one list.
    #[serde(skip)]
    pub astray: Vec<String>,
}

/// A factor with its evidence.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FactorTold {
    /// The factor.
    pub factor: Factor,
    /// Its name.
    pub name: &'static str,
    /// What it asks.
    pub question: &'static str,
    /// The grade of its weakest evidence; at most weak where a piece is missing that every build makes, and at most adequate where one is missing that not
    /// every knee has. Of nothing, "no evidence".
    pub grade: Grade,
    /// Whether that is what the model risk asks for; none where no risk is stated.
    pub enough: Option<bool>,
    /// The evidence, and what there is none of.
    pub evidence: Vec<Evidence>,
}

impl FactorTold {
    pub(super) fn of(factor: Factor, evidence: Vec<Evidence>, risk: Option<Level>) -> FactorTold {
        let known = evidence.iter().any(|e| e.grade != Grade::NoEvidence);
        let grade = evidence.iter().map(worth).min().filter(|_| known).unwrap_or(Grade::NoEvidence);
        let (name, question) = factor.words();
        FactorTold { factor, name, question, grade, enough: risk.map(|r| grade >= r.asks_for()), evidence }
    }
}

/// Evidence that not every knee has: of a scan beside a CT, of stages that run where they are asked for, of a second data set, of menisci,
/// of measured passive flexion, of a question that names flexions.
const NOT_EVERY_KNEES: [&str; 16] = [
    "registration",
    "contact-law",
    "missing-effects",
    "menisci-sensitivity",
    "menisci-forces",
    "starts",
    "starts-stiffness",
    "starts-fit",
    "cross-prediction",
    "cross-prediction-width",
    "other-flexions",
    "other-flexions-width",
    "other-directions",
    "other-directions-width",
    "passive-flexion",
    "flexion-range",
];

/// The best grade that a factor can have with this piece: what is missing is never to its advantage. What was changed or taken away after the
/// build is not what this knee never had.
fn worth(piece: &Evidence) -> Grade {
    match piece.grade {
        Grade::NoEvidence if piece.as_built.is_none() && NOT_EVERY_KNEES.contains(&piece.id) => Grade::Adequate,
        Grade::NoEvidence => Grade::Weak,
        grade => grade,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(id: &'static str, grade: Grade) -> Evidence {
        Evidence {
            id,
            factor: Factor::ModelInputs,
            what: String::new(),
            value: None,
            unit: "-".into(),
            limits: [0.0, 1.0],
            more_is_better: false,
            grade,
            why: String::new(),
            stage: None,
            test: None,
            test_digest: None,
            file: String::new(),
            digest: None,
            date: None,
            as_built: None,
            flexions_deg: vec![],
            astray: vec![],
        }
    }

    #[test]
    fn what_is_missing_is_never_to_a_factors_advantage() {
        let grades = [Grade::Strong, Grade::Adequate, Grade::Weak];
        let of = |pieces: &[Evidence]| FactorTold::of(Factor::ModelInputs, pieces.to_vec(), None).grade;
        for (id, at_most) in [("fibres-in-bone", Grade::Weak), ("cross-prediction", Grade::Adequate)] {
            for (own, other) in grades.into_iter().flat_map(|own| grades.map(|other| (own, other))) {
                let with = of(&[piece(id, own), piece("sites-marked", other)]);
                let without = of(&[piece(id, Grade::NoEvidence), piece("sites-marked", other)]);
                assert_eq!(without, at_most.min(other), "{id}");
                assert!(without <= with.max(at_most), "{id}");
            }
        }
        assert_eq!(of(&[piece("fibres-in-bone", Grade::NoEvidence)]), Grade::NoEvidence);
        let ids = super::super::rows::ids();
        assert!(NOT_EVERY_KNEES.iter().all(|id| ids.contains(id)), "{ids:?}");
    }

    /// A number that speaks against the model could be struck out otherwise, by a change of its file or without it.
    #[test]
    fn what_was_changed_or_taken_away_leaves_its_factor_weak() {
        for id in NOT_EVERY_KNEES {
            let struck = Evidence { as_built: Some(false), ..piece(id, Grade::NoEvidence) };
            let all = vec![struck, piece("sites-marked", Grade::Strong)];
            assert_eq!(FactorTold::of(Factor::ModelInputs, all, None).grade, Grade::Weak, "{id}");
        }
    }
}
