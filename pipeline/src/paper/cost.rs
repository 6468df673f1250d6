//! The cost of Table 4's parameters, group by group, with Figures 5 and 6.

use super::{Drawn, Knee, SOURCES, SPECIMEN, fault};
use crate::error::BuildError;
use crate::{calibrate, store};
use calibration::cost::{CostFunction, CostOptions};
use calibration::targets::{TargetOptions, TargetSet, targets};
use sim::coordinate::Free;
use sim::laxity::LaxityTrial;
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, solve_trials};
use std::fmt::Write;
use std::path::Path;
use validation::figures::{figure5, figure6};
use validation::tables::cost_table;

/// Which of a machine's trials are targets.
pub(super) const SETS: [TargetSet; 2] = [TargetSet::Kla, TargetSet::Rks];

/// Specimen 1's measured laxity by a machine.
pub(super) fn measured_trials(shared: &Path, name: &str) -> Result<Vec<LaxityTrial>, BuildError> {
    let path = shared.join(format!("specimens/{SPECIMEN}/laxity/{name}.csv"));
    Ok(calibrate::read_laxity(&path.display().to_string(), &store::read(&path)?)?.0)
}

fn target_trials(shared: &Path, name: &str, set: TargetSet, spec: &ModelSpec) -> Result<Vec<LaxityTrial>, BuildError> {
    let trials = measured_trials(shared, name)?;
    let options = TargetOptions { set, ..TargetOptions::default() };
    Ok(targets(&trials, &spec.frames.gs_ct_pose, &CostOptions::default(), &options).map_err(fault)?.trials)
}

/// The supplement's spreadsheet: what the cost of one evaluation is made of.
pub(super) fn costs(shared: &Path, knee: &Knee) -> Result<(String, Vec<Drawn>), BuildError> {
    let mut text = "\n## The cost of one evaluation, Figures 5 and 6\n\n\
        Table 4's parameters against the measured laxity of Specimen 1, by group, as the spreadsheet of the paper's supplement: error is the 75th percentile over the group's trials; \
        cost = weight x error / range. A worked example: [cost](theory/cost.md). KLA's trials stand at the flexion that was measured, where the decks flexed 6 deg less.\n"
        .to_owned();
    let (mut all, mut drawn) = (vec![], vec![]);
    for ((name, spec), set) in SOURCES.iter().zip(&knee.specs).zip(SETS) {
        let trials = target_trials(shared, name, set, spec)?;
        let cost = CostFunction::new(&trials, &spec.frames.gs_ct_pose, &CostOptions::default()).map_err(fault)?;
        let model = sim::compile(spec, &knee.meshes).map_err(fault)?;
        let answers = solve_trials(&model, &trials, &TrialOptions::default());
        let predicted: Vec<Option<Free<f64>>> =
            answers.iter().map(|a| a.as_ref().ok().map(sim::trials::Answer::predicted)).collect();
        let picture = format!("paper-figure6-{name}.svg");
        drawn.push((picture.clone(), figure6(name, &cost, &predicted).into_bytes()));
        let total = cost.cost(&predicted).value;
        let table = cost_table(&cost, &predicted).markdown();
        let body = table.split_once("\n\n").map_or(table.as_str(), |(_, body)| body);
        let _ = write!(
            text,
            "\n**{}**, {} trials, cost {total:.0}:\n\n{body}\n![Figure 6, {name}](pictures/{picture})\n",
            name.to_uppercase(),
            trials.len()
        );
        all.push(((*name).to_owned(), trials));
    }
    text += "\n![Figure 5](pictures/paper-figure5.svg)\n";
    drawn.push(("paper-figure5.svg".to_owned(), figure5(&all).into_bytes()));
    Ok((text, drawn))
}
