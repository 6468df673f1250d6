//! Regret in a bench: by how much the search of an answer stays behind the truth.

use crate::error::BuildError;
use crate::store;
use blindbench::asked::Hidden as Made;
use blindbench::laboratory::Truth;
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::search::regret::{Hidden, Regret};
use std::path::Path;

/// The file beside an answer.
const FILE: &str = "regret.json";

/// What is hidden in a case, as a diagnosis tells it; nothing where the catalogue lacks part of it, since no search could find that.
pub(super) fn hidden(truth: &Truth, catalogue: &Catalogue) -> Vec<Hidden> {
    if truth.effects.iter().any(|(effect, _, _)| catalogue.find(effect).is_err()) {
        return vec![];
    }
    let told = |(effect, scope, values): &(String, String, std::collections::BTreeMap<String, f64>)| {
        let made = Made { effect: effect.clone(), parameters: values.clone() };
        Hidden {
            effect: effect.clone(),
            variant: made.variant().map(str::to_owned),
            scope: scope.clone(),
            values: values.clone(),
        }
    };
    truth.effects.iter().map(told).collect()
}

/// Writes it beside an answer, where there is one.
pub(super) fn write(answer: &Path, regret: Option<&Regret>) -> Result<(), BuildError> {
    let Some(regret) = regret else { return Ok(()) };
    let bytes = serde_json::to_vec_pretty(regret).map_err(|e| BuildError::File(e.to_string()))?;
    store::write(&answer.join(FILE), &bytes)
}

/// By how much the search of an answer stayed behind [nats]; none where nobody asked.
pub(super) fn read(answer: &Path) -> Result<Option<f64>, BuildError> {
    let path = answer.join(FILE);
    if !store::exists(&path) {
        return Ok(None);
    }
    let regret: Regret = serde_json::from_slice(&store::read(&path)?).map_err(|e| BuildError::in_file(&path, e))?;
    Ok(Some(regret.short()))
}

/// By how much searches stay behind the truth [nats], in words; nothing where nobody asked.
pub(super) fn words(regrets: &[f64]) -> String {
    if regrets.is_empty() {
        return String::new();
    }
    let [half, most, all] = [0.5, 0.9, 1.0].map(|part| middle(regrets, part));
    format!("regret of {} searches: median {half:.1} nats, nine of ten to {most:.1}, most {all:.1}\n", regrets.len())
}

/// The value below which a part of some values lies.
pub(super) fn middle(v: &[f64], part: f64) -> f64 {
    let mut v = v.to_vec();
    v.sort_by(f64::total_cmp);
    v.get(((v.len() as f64 - 1.0) * part).max(0.0) as usize).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(effects: serde_json::Value) -> Truth {
        let text = serde_json::json!({
            "case": "a", "kind": "a", "effects": effects, "ligaments": {}, "contact_scale": 1.0, "signature": [],
            "strength": {"raw_rms_sd": 1.0}
        });
        serde_json::from_value(text).unwrap()
    }

    #[test]
    fn what_a_laboratory_hides_is_told_with_its_structure_and_its_data_set() {
        let catalogue = Catalogue::shipped();
        let made = truth(serde_json::json!([
            ["structure_loss", "both", {"loss": 0.6, "structure": 2.0}],
            ["load_sign", "rks", {"turned": 1.0, "axis": 1.0}],
        ]));
        let told = hidden(&made, &catalogue);
        let short: Vec<_> = told.iter().map(|h| (h.variant.as_deref(), h.scope.as_str())).collect();
        assert_eq!(short, [(Some("sMCL"), "both"), (Some("rotation"), "rks")]);
        assert_eq!(told[0].values["loss"], 0.6);
        // of two effects the catalogue has one: no search could find both
        let beyond = truth(serde_json::json!([["itb", "kla", {"force_n": 90.0}], ["x_adhesion", "kla", {"k": 40.0}]]));
        assert!(hidden(&beyond, &catalogue).is_empty());
    }

    #[test]
    fn what_is_written_beside_an_answer_is_read_again_and_else_nobody_asked() {
        let folder = tempfile::TempDir::new().unwrap();
        assert_eq!(read(folder.path()).unwrap(), None);
        write(folder.path(), None).unwrap();
        assert_eq!(read(folder.path()).unwrap(), None);
        let regret = Regret { found: 12.0, truth: 15.5, information: 14.0, leaves: 1.1 };
        write(folder.path(), Some(&regret)).unwrap();
        assert_eq!(read(folder.path()).unwrap(), Some(3.5));
    }

    #[test]
    fn regrets_of_a_bench_are_told_by_their_order_and_nothing_where_nobody_asked() {
        let told = words(&[0.0, 7.5, 0.4, 0.0, 0.1, 0.2, 0.3, 0.5, 0.6, 0.7, 2.0]);
        assert_eq!(told, "regret of 11 searches: median 0.4 nats, nine of ten to 2.0, most 7.5\n");
        assert_eq!(words(&[]), "");
    }
}
