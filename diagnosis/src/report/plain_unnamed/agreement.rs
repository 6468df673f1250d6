//! Whether each data set is a knee's, and all are one knee's, in plain words.

use crate::criteria::NAMED;
use crate::report::DataSetAlone;
use crate::report::words::figures;

/// Sum of squares over the number of readings up to which a knee fits a data set [-]. Ours: twice what noise and floor leave.
pub(super) const FITS: f64 = 2.0;

/// Whether each data set is a knee's, and all are one knee's; nothing where the data sets say nothing of it, or one knee does for all.
/// `two_knees`: log odds for a knee each.
pub(super) fn agreement(sets: &[DataSetAlone], two_knees: Option<f64>) -> String {
    let (fitted, misfitting): (Vec<&DataSetAlone>, Vec<&DataSetAlone>) =
        sets.iter().partition(|s| s.alone + s.cost <= FITS);
    let list = |of: &[&DataSetAlone]| {
        let each: Vec<String> = of.iter().map(|s| format!("{} {}", s.source, figures(s.alone))).collect();
        each.join(", ")
    };
    let together = || {
        let each: Vec<String> = sets.iter().map(|s| format!("{} {}", s.source, figures(s.together))).collect();
        each.join(", ")
    };
    match (fitted.is_empty(), misfitting.is_empty()) {
        (true, true) => String::new(),
        (false, true) => apart(sets, two_knees).map_or(String::new(), |apart| {
            format!(
                "The data sets contradict each other. Each alone is a knee of the model (left over, in units of what noise leaves: {}), \
                 but {apart} ({}).",
                list(&fitted),
                together()
            )
        }),
        _ => format!(
            "No knee of the model gives all readings of {}, even alone (left over, in units of what noise leaves: {}; with all data sets: {}).{}",
            misfitting.iter().map(|s| s.source.as_str()).collect::<Vec<_>>().join(" or of "),
            list(&misfitting),
            together(),
            misfitting.iter().map(|s| scatter_asked(s)).collect::<String>()
        ),
    }
}

/// By what data sets that are each a knee's are not one knee's: what one knee leaves of them, else the odds for a knee each.
/// None where neither tells.
fn apart(sets: &[DataSetAlone], two_knees: Option<f64>) -> Option<String> {
    let over: Vec<&str> = sets.iter().filter(|s| s.together > FITS).map(|s| s.source.as_str()).collect();
    if !over.is_empty() {
        return Some(format!("no one knee is both: it leaves too much of {}", over.join(" and of ")));
    }
    let odds = two_knees.filter(|odds| *odds >= NAMED)?;
    Some(format!("a knee each is likelier than one knee, by {} nats, though that leaves little", figures(odds)))
}

/// How much more a data set would have to scatter before a knee of its own fits it: what it leaves is a square.
fn scatter_asked(set: &DataSetAlone) -> String {
    let by = ((set.alone + set.cost) / FITS).sqrt();
    let (source, by) = (&set.source, figures(by));
    format!(" A knee would fit {source} if its readings scattered {by} times as widely as noise and floor say.")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_sets_that_one_knee_does_not_fit_are_told_from_one_that_no_knee_fits() {
        let set = |source: &str, alone, together| DataSetAlone {
            source: source.into(),
            readings: 100,
            alone,
            cost: 0.2,
            together,
            with_best: None,
        };
        let told = agreement(&[set("kla", 1.1, 1.5), set("rks", 1.3, 6.0)], None);
        assert!(told.contains("Each alone is a knee") && told.contains("too much of rks (kla 1.50"), "{told}");
        let misfitting = agreement(&[set("kla", 1.1, 4.0), set("rks", 5.0, 6.0)], None);
        assert!(
            misfitting.contains("all readings of rks, even alone") && !misfitting.contains("of kla,"),
            "{misfitting}"
        );
        // what is left is a square: at twice the bar a knee fits data that scatter by a root of two more
        let asked = scatter_asked(&DataSetAlone { cost: 0.0, ..set("rks", 2.0 * FITS, 6.0) });
        assert!(asked.contains("scattered 1.41 times"), "{asked}");
        assert!(misfitting.contains("fit rks if") && !misfitting.contains("fit kla if"), "{misfitting}");
        assert_eq!(agreement(&[], None), "");
    }

    /// The head never says the opposite of the odds and of what one knee leaves, which stand beside it.
    #[test]
    fn data_sets_contradict_each_other_only_where_the_odds_or_what_one_knee_leaves_say_so() {
        let set = |source: &str, together| DataSetAlone {
            source: source.into(),
            readings: 100,
            alone: 0.9,
            cost: 0.1,
            together,
            with_best: None,
        };
        for odds in [None, Some(-16.0), Some(0.9 * NAMED), Some(1.1 * NAMED)] {
            for (one, other) in [(0.97, 1.22), (0.97, 1.1 * FITS), (1.1 * FITS, 1.1 * FITS)] {
                let told = agreement(&[set("kla", one), set("rks", other)], odds);
                let (likelier, over) = (odds.is_some_and(|x| x >= NAMED), other > FITS);
                assert_eq!(told.contains("contradict each other"), likelier || over, "{odds:?} {other}: {told}");
                assert_eq!(told.contains("no one knee is both"), over, "{odds:?} {other}: {told}");
                assert_eq!(told.contains("too much of kla"), one > FITS, "{odds:?} {one}: {told}");
                assert_eq!(told.is_empty(), !likelier && !over, "{told}");
            }
        }
    }
}
