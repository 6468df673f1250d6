//! The published and the synthetic specimens' laxity data as targets.

use calibration::cost::CostOptions;
use calibration::targets::{TargetOptions, TargetSet, targets};
use needs_shared::needs_shared;
use sim::laxity;
use sim::spec::PoseSpec;

#[expect(clippy::disallowed_methods, reason = "tests read the shared data")]
fn read(test: &str, path: &str) -> Option<Vec<laxity::LaxityTrial>> {
    let bytes = std::fs::read(crate::common::shared(test, path)?).expect("readable");
    Some(laxity::read(&bytes).expect("laxity data").trials)
}

#[needs_shared]
fn measured_scatter_is_data_and_the_sets_have_the_papers_sizes() {
    let ct = PoseSpec { fe_deg: -6.1, vv_deg: 0.8, ie_deg: 2.2, ml_mm: 0.8, ap_mm: 0.4, si_mm: -22.2 };
    for specimen in ["S192803", "S193761"] {
        for (name, set, count) in [("kla", TargetSet::Kla, 31), ("rks", TargetSet::Rks, 25)] {
            let path = format!("specimens/{specimen}/laxity/{name}.csv");
            let Some(trials) = read("measured_scatter_is_data", &path) else { return };
            for set in [set, TargetSet::All] {
                let options = TargetOptions { set, ..TargetOptions::default() };
                let t = targets(&trials, &ct, &CostOptions::default(), &options).unwrap();
                assert_eq!(t.trials.len(), count, "{path}");
                assert!(t.warnings.len() <= 3, "{path}: {:?}", t.warnings);
            }
        }
    }
}
