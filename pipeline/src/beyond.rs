//! Trials that ask for more than a knee was calibrated to: what is told of them.

use notices::{Kind, Notice};
use sim::coordinate::{Coordinate, FE};
use sim::laxity::LaxityTrial;
use sim::reach::Beyond;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

/// One notice of all trials that go beyond the model's calibration; none of a model that does not know its reach.
pub(crate) fn calibration<'a>(spec: &ModelSpec, trials: impl Iterator<Item = &'a LaxityTrial>) -> Option<Notice> {
    let reach = spec.calibrated.as_ref()?.reach?;
    let mut farthest: BTreeMap<(Coordinate, bool), Beyond> = BTreeMap::new();
    let mut count = 0;
    let over = |b: &Beyond| (b.asked - b.reached).abs();
    for trial in trials {
        let beyond = reach.beyond(trial);
        count += usize::from(!beyond.is_empty());
        for b in beyond {
            let most = farthest.entry((b.coordinate, b.asked > b.reached)).or_insert(b);
            *most = if over(&b) > over(most) { b } else { *most };
        }
    }
    let each: Vec<String> = farthest.values().map(words).collect();
    let (rows, ask) = if count == 1 { ("row", "asks") } else { ("rows", "ask") };
    let text = format!(
        "{count} {rows} {ask} for more than the knee was calibrated to: {}. Nothing was measured there: forces and poses of those rows are extrapolated",
        each.join("; ")
    );
    (count > 0).then(|| Kind::BeyondCalibration.notice(text).count(count))
}

/// "flexion of 120 deg (trials reach 92 deg)".
fn words(b: &Beyond) -> String {
    let (what, unit) = match b.coordinate {
        FE => ("flexion".to_owned(), "deg"),
        c => (format!("a load along {}", c.name().to_uppercase()), c.load_unit()),
    };
    format!("{what} of {:.0} {unit} (trials reach {:.0} {unit})", b.asked, b.reached)
}
