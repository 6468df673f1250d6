//! What the published knees left open, as numbers of a build: forces of ligaments, ends of the search, loads that no calibration targeted.

use super::evidence::Factor;
use super::figures::{ends_that_fit, force_moved, stiffnesses_of_starts};
use super::row::Row;
use super::untargeted::{at_other_flexions, in_other_directions, width_at_other_flexions, width_in_other_directions};

/// Changes of a bundle's force that are strong and adequate [N].
const FORCE_N: [f64; 2] = [15.0, 30.0];
const FORCE_WHY: &str = "15 N on either side is what an interval of a force is asked for; twice that is about a quarter of the drawers' load; ours";

/// The rows.
pub(super) static QUESTIONS: [Row; 10] = [
    Row {
        id: "strain-forces",
        factor: Factor::ModelInputs,
        what: "force of a bundle in drawers and pivot shift by reference strains that are 4.6 % other, worst",
        unit: "N",
        limits: FORCE_N,
        why: FORCE_WHY,
        take: |b, _| force_moved(b, "reference_strain"),
    },
    Row {
        id: "stiffness-forces",
        factor: Factor::ModelInputs,
        what: "force of a bundle in drawers and pivot shift by stiffnesses that are 14.3 % other, worst",
        unit: "N",
        limits: FORCE_N,
        why: FORCE_WHY,
        take: |b, _| force_moved(b, "stiffness"),
    },
    Row {
        id: "contact-forces",
        factor: Factor::ModelForm,
        what: "force of a bundle in drawers and pivot shift by half and twice the contact's pressure, worst",
        unit: "N",
        limits: FORCE_N,
        why: FORCE_WHY,
        take: |b, _| force_moved(b, "contact_law"),
    },
    Row {
        id: "menisci-forces",
        factor: Factor::ModelForm,
        what: "force of a bundle in drawers and pivot shift with the menisci taken out, worst",
        unit: "N",
        limits: FORCE_N,
        why: "as for the contact's pressure; there is none where the model has no menisci",
        take: |b, _| force_moved(b, "menisci"),
    },
    Row {
        id: "starts-stiffness",
        factor: Factor::CalculationVerification,
        what: "stiffnesses at the ends of the search's starts that fit within the noise, largest spread",
        unit: "%",
        limits: [7.0, 14.3],
        why: "14.3 % is what two data sets of one knee differ by [andreassen2025, table 4], and half of it is ours; there is none of one end alone",
        take: |b, _| stiffnesses_of_starts(b),
    },
    Row {
        id: "starts-fit",
        factor: Factor::CalculationVerification,
        what: "ends of the search that fit as well as the best within the noise, itself among them, of all that differ",
        unit: "-",
        limits: [1.0, 0.5],
        why: "a best fit beside which other starts end in worse ones may not be the best there is; half is ours; there is none of one end alone",
        take: |b, _| ends_that_fit(b),
    },
    Row {
        id: "other-flexions",
        factor: Factor::Applicability,
        what: "share within its 90 % interval of the ranges at flexions that the predicting knee's own data did not load",
        unit: "-",
        limits: [0.8, 0.5],
        why: "as for all ranges; there is none where both data sets have the same flexions",
        take: |b, _| at_other_flexions(b),
    },
    Row {
        id: "other-flexions-width",
        factor: Factor::Applicability,
        what: "half the width of those intervals, in times the range that was measured, median",
        unit: "-",
        limits: [0.25, 0.5],
        why: "as for all ranges",
        take: |b, _| width_at_other_flexions(b),
    },
    Row {
        id: "other-directions",
        factor: Factor::Applicability,
        what: "share within its 90 % interval of the ranges in directions that the predicting knee's own data did not load",
        unit: "-",
        limits: [0.8, 0.5],
        why: "as for all ranges; there is none where both data sets have the same directions",
        take: |b, _| in_other_directions(b),
    },
    Row {
        id: "other-directions-width",
        factor: Factor::Applicability,
        what: "half the width of those intervals, in times the range that was measured, median",
        unit: "-",
        limits: [0.25, 0.5],
        why: "as for all ranges",
        take: |b, _| width_in_other_directions(b),
    },
];
