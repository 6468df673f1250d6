//! The catalogue of effects: data shipped with the program, and what can be asked of it.

use crate::error::DiagnosisError;
use inference::trial::Trial;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// A parameter of an effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Its name in files.
    pub key: String,
    /// Its unit.
    pub unit: String,
    /// Scale of its prior about zero (Student's t, four degrees of freedom) [unit].
    pub sd: f64,
    /// Whether negative values mean nothing.
    #[serde(default)]
    pub one_sided: bool,
    /// Size below which it is not this effect [unit].
    #[serde(default)]
    pub least: f64,
    /// Size beyond which no knee has it [unit].
    #[serde(default)]
    pub most: Option<f64>,
    /// Size beyond which more of it changes nothing [unit].
    #[serde(default)]
    pub whole: Option<f64>,
    /// Whether it shapes the effect and is nothing by itself.
    #[serde(default)]
    pub shape: bool,
    /// Where fits of it start, in units of `sd`: 1 for sizes and 0 for shapes unless told; a shape is screened there, too.
    #[serde(default)]
    pub from: Option<f64>,
}

impl Parameter {
    /// The least and the most that it can be [unit]: nothing where negative values mean nothing, all of a whole, what no knee exceeds.
    pub fn can_be(&self) -> [f64; 2] {
        let most = self.most.unwrap_or(f64::INFINITY);
        [if self.one_sided { 0.0 } else { -most }, self.whole.map_or(most, |whole| whole.min(most))]
    }
}

/// An effect a model may lack.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Effect {
    /// Its name in files.
    pub id: String,
    /// M measurement, L load and apparatus, T tissue, U muscle, H history.
    pub family: char,
    /// "specimen", "session" or "apparatus": with what it travels.
    pub kept: String,
    /// A few words.
    pub title: String,
    /// One sentence for a reader without mechanics.
    pub words: String,
    /// What it means for the joint.
    pub clinical: String,
    /// How to check it at the bench.
    pub bench: String,
    /// Keys of the bibliography.
    pub source: String,
    /// The column the data must have: "branch", "order" or "time".
    #[serde(default)]
    pub needs: Option<String>,
    /// Whether it is anatomy that cannot differ between data sets of one specimen.
    #[serde(default)]
    pub one_knee: bool,
    /// Relative error of its size owed to a form and lines that are not this knee's own, one standard deviation [-].
    #[serde(default)]
    pub form_share: f64,
    /// Structures it may be about.
    #[serde(default)]
    pub variants: Vec<String>,
    /// Whether its variant is part of its name in answers.
    #[serde(default)]
    pub named_by_variant: bool,
    /// Why no data can test it.
    #[serde(default)]
    pub never_tested: Option<String>,
    /// Its parameters; none means that it is told of, never fitted.
    pub parameter: Vec<Parameter>,
}

/// The catalogue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Catalogue {
    /// Its version.
    pub version: String,
    /// Its effects.
    pub effect: Vec<Effect>,
}

/// The shipped text.
pub const TEXT: &str = include_str!("../../data/effects.toml");

static SHIPPED: LazyLock<Catalogue> =
    LazyLock::new(|| toml::from_str(TEXT).expect("the catalogue shipped with the program parses"));

impl Catalogue {
    /// The catalogue shipped with the program.
    pub fn shipped() -> Catalogue {
        SHIPPED.clone()
    }

    /// A catalogue without some effects.
    pub fn without(&self, ids: &[&str]) -> Catalogue {
        let mut out = self.clone();
        out.effect.retain(|e| !ids.contains(&e.id.as_str()));
        out
    }

    /// An effect by its name in answers: `attachment_ACL` is the variant ACL of `attachment`.
    ///
    /// Errors: no such effect.
    pub fn find(&self, name: &str) -> Result<(&Effect, usize), DiagnosisError> {
        for effect in &self.effect {
            for variant in 0..effect.variants.len().max(1) {
                if effect.name(variant) == name || (variant == 0 && effect.id == name) {
                    return Ok((effect, variant));
                }
            }
        }
        Err(DiagnosisError::Component(format!("the catalogue has no effect {name:?}")))
    }
}

impl Effect {
    /// Its name in answers; only sites carry their ligament in it.
    pub fn name(&self, variant: usize) -> String {
        match self.variants.get(variant) {
            Some(v) if self.named_by_variant => format!("{}_{v}", self.id),
            _ => self.id.clone(),
        }
    }

    /// Why these data cannot test it; `None` where they can.
    pub fn untestable(&self, trials: &[Trial]) -> Option<String> {
        match self.needs.as_deref() {
            Some("branch") => {
                let has = |s: f64| trials.iter().any(|t| t.branch() == Some(s));
                (!(has(1.0) && has(-1.0))).then(|| "no unloading branch in the data (column branch)".to_owned())
            }
            Some("order") => {
                trials.iter().all(|t| t.order.is_none()).then(|| "no order of testing (column order)".into())
            }
            Some("time") => {
                trials.iter().all(|t| t.time.is_none()).then(|| "no time of testing (column time_s)".into())
            }
            _ => self.never_tested.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_is_told_in_full_and_named_once() {
        let catalogue = Catalogue::shipped();
        let mut ids: Vec<&str> = catalogue.effect.iter().map(|e| e.id.as_str()).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), catalogue.effect.len());
        for e in &catalogue.effect {
            assert!("MLTUH".contains(e.family) && ["specimen", "session", "apparatus"].contains(&e.kept.as_str()));
            for text in [&e.title, &e.words, &e.clinical, &e.bench, &e.source] {
                assert!(!text.is_empty(), "{}", e.id);
            }
            assert!(e.parameter.iter().all(|p| p.sd > 0.0 && !p.unit.is_empty()), "{}", e.id);
        }
    }

    #[test]
    fn sites_are_found_by_their_ligament() {
        let catalogue = Catalogue::shipped();
        let (effect, variant) = catalogue.find("attachment_LCL").unwrap();
        assert_eq!((effect.id.as_str(), effect.variants[variant].as_str()), ("attachment", "LCL"));
        assert!(catalogue.find("poltergeist").is_err());
    }
}
