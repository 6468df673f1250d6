//! Rows that contradict each other, in plain words: where they stand, and which to repeat first.

use crate::report::words::with_unit;
use crate::search::contradiction::{Contradiction, Witness};
use sim::coordinate::{AP, Coordinate, IE, ML, VV};
use std::fmt::Write;

/// Forces and moments that are none: VV, IE [N m], ML, AP [N]; what a robot leaves where it is asked for nothing.
const NO_LOAD: [(Coordinate, f64); 4] = [(VV, 1.0), (IE, 1.0), (ML, 10.0), (AP, 10.0)];
/// Contradictions in the head, at most [-].
const IN_HEAD: usize = 3;

/// Which trial to repeat first: of the clearest contradiction the row that stands against most of those near it, or both where that does not tell.
pub(super) fn to_repeat(of: &[Contradiction]) -> String {
    let Some(first) = of.first() else { return String::new() };
    let place = |w: &Witness| if w.row.is_some() { format!("{} ({})", row(w), w.trial) } else { row(w) };
    let [one, other] = first.readings.each_ref().map(place);
    match first.outlier().zip(first.contradicts) {
        Some((outlier, counts)) => format!(
            "\nTo do first: repeat {}. It contradicts {} readings near it, {} contradicts {}.",
            place(&first.readings[outlier]),
            counts[outlier],
            row(&first.readings[1 - outlier]),
            counts[1 - outlier]
        ),
        None if first.readings[0].source == first.readings[1].source => {
            format!("\nTo do first: repeat both {one} and {other}. These data do not tell which of them is off.")
        }
        None => format!(
            "\nTo do first: repeat both {one} and {other} on one knee, with the same load. These data do not tell which of them is off. \
             Compare how the two apparatuses load the knee, where their zeros lie, and what was cut between them."
        ),
    }
}

/// The contradictions as sentences; nothing where there is none.
pub(crate) fn contradictions(of: &[Contradiction]) -> String {
    told(of, "Look at these rows first")
}

/// The same beside an answer, which comes first; then what to do.
pub(crate) fn contradictions_beside(of: &[Contradiction]) -> String {
    if of.is_empty() {
        return String::new();
    }
    let rows = told(of, "These rows do not go together, even with the answer");
    format!(
        "{rows}\nRepeat the trials of these rows: one may be misread, or the knee may rest in two places under one load. \
         Then the map has both near 0."
    )
}

/// The contradictions, `first` before the clearest. How many standard deviations off a reading is comes from fitted knees.
fn told(of: &[Contradiction], first: &str) -> String {
    let mut out = String::new();
    for (k, c) in of.iter().take(IN_HEAD).enumerate() {
        let [one, other] = &c.readings;
        let unit = Coordinate::named(&c.dof).map_or("", Coordinate::unit);
        let place = |w: &Witness| format!("{} ({}, {:.0} deg)", row(w), load(w), w.flexion_deg);
        let lead = if k == 0 { first } else { "Then these" };
        let _ = write!(
            out,
            "\n{lead}: {} reads {} of {}, {} reads {}. A knee of the model that reads the first would read {} in the second, \
             whatever its ligaments, if it rests in one place. The second is {} off: {:.1} sd.",
            place(one),
            with_unit(one.value, unit),
            c.dof.to_uppercase(),
            place(other),
            with_unit(other.value, unit),
            with_unit(c.expected, unit),
            with_unit((other.value - c.expected).abs(), unit),
            c.deviations()
        );
    }
    out
}

/// A reading's place: "row 12 of kla".
pub fn row(w: &Witness) -> String {
    w.row.map_or_else(|| format!("{} of {}", w.trial, w.source), |row| format!("row {row} of {}", w.source))
}

/// The load of a reading: "178 N of AP".
pub fn load(w: &Witness) -> String {
    let of = |c: Coordinate| w.loads.get(&c.load_column()).copied().unwrap_or(0.0);
    let felt = NO_LOAD.into_iter().filter(|(c, none)| of(*c).abs() > *none);
    let most = felt.max_by(|(a, s), (b, t)| (of(*a).abs() / s).total_cmp(&(of(*b).abs() / t)));
    most.map_or("unloaded".into(), |(c, _)| {
        format!("{} of {}", with_unit(of(c), c.load_unit()), c.name().to_uppercase())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::FREE;

    fn witness(source: &str, row: Option<usize>, ap: f64, value: f64) -> Witness {
        let loads = FREE.into_iter().map(|c| (c.load_column(), if c == AP { ap } else { 0.0 })).collect();
        Witness { source: source.into(), row, trial: "Anterior_90deg_40".into(), flexion_deg: 74.1, loads, value }
    }

    #[test]
    fn a_contradiction_names_both_rows_what_was_read_and_what_a_knee_would_read() {
        let readings = [witness("kla", Some(11), 178.0, 4.8), witness("rks", None, 0.0, 14.4)];
        let told = contradictions(&[contradiction(readings)]);
        for part in [
            "row 11 of kla (178 N of AP, 74 deg) reads 4.80 mm of AP",
            "Anterior_90deg_40 of rks (unloaded",
            "6.25 mm in the second",
            "8.15 mm off: 7.7 sd",
        ] {
            assert!(told.contains(part), "{told}");
        }
        // the sd of a straight line does not go into the deviations, which are of fitted knees: side by side they would differ
        assert!(!told.contains("1.10"), "{told}");
        assert_eq!([contradictions(&[]), contradictions_beside(&[])], ["", ""]);
    }

    fn contradiction(readings: [Witness; 2]) -> Contradiction {
        let (dof, noise, z, contradicts) = ("ap".into(), Some([0.4, 0.2]), None, None);
        Contradiction { dof, readings, expected: 6.25, sd: 1.1, surprise: 30.0, noise, z, contradicts }
    }

    #[test]
    fn a_head_has_three_contradictions_and_says_first_what_to_repeat() {
        let readings = |k: usize| [witness("kla", Some(k), 178.0, 4.8), witness("rks", Some(10 + k), 178.0, 14.4)];
        let all: Vec<Contradiction> = (2..8).map(|k| contradiction(readings(k))).collect();
        let told = contradictions(&all);
        assert_eq!(told.lines().filter(|line| !line.is_empty()).count(), IN_HEAD, "{told}");
        // where neither stands out, both are to be repeated, and two apparatuses are to be held against each other
        let both = to_repeat(&all);
        assert!(
            both.contains("row 2 of kla") && both.contains("row 12 of rks") && both.contains("apparatuses"),
            "{both}"
        );
        // beside an answer they come second, and what to do last
        let beside = contradictions_beside(&all);
        assert!(beside.starts_with("\nThese rows do not go together, even with the answer: row 2 of kla"), "{beside}");
        assert!(!beside.contains("first:") && beside.contains("\nRepeat the trials of these rows: "), "{beside}");
        let one_set = contradiction([witness("rks", Some(3), 178.0, 4.8), witness("rks", Some(4), 178.0, 14.4)]);
        assert!(!to_repeat(&[one_set]).contains("apparatuses"));
        // that which contradicts most others is to be repeated, whichever of the two it is
        for (contradicts, outlier) in [([1, 5], "repeat row 12 of rks"), ([5, 1], "repeat row 2 of kla")] {
            let told = to_repeat(&[Contradiction { contradicts: Some(contradicts), ..all[0].clone() }]);
            assert!(
                told.contains(outlier) && told.contains("contradicts 5 readings") && !told.contains("both"),
                "{told}"
            );
        }
        assert_eq!(to_repeat(&[]), "");
    }
}
