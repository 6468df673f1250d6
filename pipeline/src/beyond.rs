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
        "{count} {rows} {ask} for what the knee was not calibrated to: {}. Nothing was measured there: forces and poses of those rows are extrapolated",
        each.join("; ")
    );
    (count > 0).then(|| Kind::BeyondCalibration.notice(text).count(count))
}

/// "flexion of 120 deg (trials reach 92 deg)"; of less than any trial had, "a load along SI of 20 N (trials have 50 N or more)".
fn words(b: &Beyond) -> String {
    let (what, unit) = match b.coordinate {
        FE => ("flexion".to_owned(), "deg"),
        c => (format!("a load along {}", c.name().to_uppercase()), c.load_unit()),
    };
    let trials = match b.asked.abs() < b.reached.abs() {
        true => format!("trials have {:.0} {unit} or more", b.reached),
        false => format!("trials reach {:.0} {unit}", b.reached),
    };
    format!("{what} of {:.0} {unit} ({trials})", b.asked)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::{AP, SI};

    #[test]
    fn what_is_asked_and_what_was_measured_do_not_contradict_each_other() {
        let told = |coordinate, asked, reached| words(&Beyond { coordinate, asked, reached });
        assert_eq!(told(FE, 120.0, 92.0), "flexion of 120 deg (trials reach 92 deg)");
        assert_eq!(told(AP, -250.0, -133.0), "a load along AP of -250 N (trials reach -133 N)");
        assert_eq!(told(SI, 20.0, 50.0), "a load along SI of 20 N (trials have 50 N or more)");
        assert_eq!(told(FE, 0.0, 30.0), "flexion of 0 deg (trials have 30 deg or more)");
    }
}
