//! `blind answer`: every case of a bench is diagnosed, without its truth.

use super::bench::{BEFORE, bench};
use super::{Ablation, AnswerArgs, regret};
use crate::error::BuildError;
use crate::which_model::WhichModel;
use crate::{diagnose, store};
use blindbench::laboratory::Truth;
use diagnosis::problem::covariance::Floor;
use diagnosis::search::DiagnosisOptions;
use std::path::{Path, PathBuf};

impl Ablation {
    fn options(self) -> DiagnosisOptions {
        let mut out = DiagnosisOptions::default();
        match self {
            Ablation::FrozenLigaments => out.frozen_ligaments = true,
            Ablation::NoFloor => out.floor = Floor::none(),
            Ablation::NoWildcard => out.wildcard = false,
            Ablation::ByError => out.by_error = true,
        }
        out
    }
}

pub(super) fn answer(args: &AnswerArgs) -> Result<String, BuildError> {
    let (cases, sources, manifest) = bench(&args.bench)?;
    let has_before = manifest["before"].as_bool().unwrap_or(false);
    let options = match args.ablation {
        Some(_) if !args.overrides.is_empty() => {
            return Err(BuildError::Usage("--ablation and --set cannot be joined".into()));
        }
        Some(ablation) => ablation.options(),
        None => diagnose::options(&args.overrides)?,
    };
    let (mut kept, mut passed) = (0, 0);
    for case in &cases {
        let out = args.out.join(case);
        if store::exists(&out.join("diagnosis.json")) {
            kept += 1;
            continue;
        }
        let without_effect = if args.struck { hidden_alone(&args.bench, case)? } else { vec![] };
        if args.struck && without_effect.is_empty() {
            passed += 1;
            continue;
        }
        let folder = args.bench.join(case);
        let files = |ending: &str| -> Vec<(String, PathBuf)> {
            sources.iter().map(|s| (s.clone(), folder.join(format!("{s}{ending}.csv")))).collect()
        };
        let question = diagnose::DiagnoseArgs {
            which: WhichModel::default(),
            model: args.model.clone(),
            measured: files(""),
            before: if has_before { files(BEFORE) } else { vec![] },
            out,
            atlas: false,
            without_effect,
            overrides: args.overrides.clone(),
            jobs: None,
        };
        let truth = if args.regret { truth_of(&args.bench, case)? } else { vec![] };
        let (_, behind) = diagnose::run_beside(&question, &options, &truth)?;
        regret::write(&question.out, behind.as_ref())?;
    }
    let answers = cases.len() - passed;
    Ok(format!("{answers} answers in {}, {kept} of them there before\n", args.out.display()))
}

/// A case's truth, its seal not asked.
fn unsealed(bench: &Path, case: &str) -> Result<Truth, BuildError> {
    serde_json::from_slice(&store::read(&bench.join(format!("{case}.truth.json")))?)
        .map_err(|e| BuildError::File(format!("{case}: {e}")))
}

/// What is hidden in a case, as the search is held against it.
fn truth_of(bench: &Path, case: &str) -> Result<Vec<diagnosis::search::regret::Hidden>, BuildError> {
    Ok(regret::hidden(&unsealed(bench, case)?, &diagnosis::effect::catalogue::Catalogue::shipped()))
}

/// The name of a case's effect, where the catalogue has it and nothing else is hidden.
fn hidden_alone(bench: &Path, case: &str) -> Result<Vec<String>, BuildError> {
    let truth = unsealed(bench, case)?;
    let catalogue = diagnosis::effect::catalogue::Catalogue::shipped();
    Ok(match &truth.effects[..] {
        // sites of one ligament are struck with those of all
        [(effect, _, _)] => catalogue.find(effect).map(|(known, _)| known.id.clone()).into_iter().collect(),
        _ => vec![],
    })
}
