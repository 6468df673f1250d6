//! Every piece of evidence: which number, from which file, and from where on it speaks for the model. With [`super::questions`] the one table of limits.

use super::context::Context;
use super::evidence::{Evidence, Factor};
use super::figures::{
    cell, detectable, half_width, kinds, metrics, odd, of_model, passive, sensitive, stopped, strains_of_starts, table,
};
use super::of_program::of_program;
use super::questions::QUESTIONS;
use super::read::{Build, largest, numbers, share, smallest};
use super::row::Row;
use crate::cohort::shared::the_rest;
use crate::stage::{MOST_NOISE, PARTLY_NOISE};
use crate::which_model::JOINT;
use sim::spec::SharedPriorSpec;
use std::collections::BTreeMap;

/// All numbers of a build. Limits that are not of a source are ours.
static ROWS: [Row; 35] = [
    Row {
        id: "element-quality",
        factor: Factor::CalculationVerification,
        what: "least scaled Jacobian of the cartilage's elements",
        unit: "-",
        limits: [0.5, 0.2],
        why: "1 is a cube, 0 is inverted; elements from 0.5 on are usual in finite elements [stimpson2007]; ours",
        take: |b, _| metrics(b, "overclosure", &PARTS.map(|p| [p, "scaled_jacobian_min"]), smallest),
    },
    Row {
        id: "cartilage-gap",
        factor: Factor::CalculationVerification,
        what: "least gap between the cartilages after overclosure is taken out",
        unit: "mm",
        limits: [0.0, -0.05],
        why: "an overlap in the CT pose is force that nobody measured; 0.05 mm is a sixtieth of the layer",
        take: |b, _| metrics(b, "overclosure", &[["gap_min_mm", ""]], smallest),
    },
    Row {
        id: "bone-surface",
        factor: Factor::CalculationVerification,
        what: "distance of the bones as meshed from CT, 95th percentile",
        unit: "mm",
        limits: [0.05, 0.2],
        why: "a registration errs by 0.03 to 0.1 mm: below that the mesh adds nothing; 0.2 mm is a voxel's part",
        take: |b, _| metrics(b, "bones", &BONES.map(|p| [p, "surface_distance_p95_mm"]), largest),
    },
    Row {
        id: "protocols-run",
        factor: Factor::CalculationVerification,
        what: "rows of the drawers that end oddly",
        unit: "-",
        limits: [0.0, 0.1],
        why: "a row that dislocates or finds no rest is no answer; a tenth of them may be beyond what the knee bears",
        take: |b, _| table(b, "validate", "MODEL/ap_laxity.csv", odd),
    },
    Row {
        id: "passive-run",
        factor: Factor::CalculationVerification,
        what: "rows of passive flexion that end oddly",
        unit: "-",
        limits: [0.0, 0.1],
        why: "as for the drawers",
        take: |b, _| table(b, "validate", "MODEL/passive_flexion.csv", odd),
    },
    Row {
        id: "pivot-run",
        factor: Factor::CalculationVerification,
        what: "rows of the pivot shift with the intact knee that end oddly",
        unit: "-",
        limits: [0.0, 0.1],
        why: "as for the drawers",
        take: |b, _| table(b, "validate", "MODEL/pivot_shift.csv", odd),
    },
    Row {
        id: "solvers-agree",
        factor: Factor::CalculationVerification,
        what: "explicit dynamics against the quasi-static solver on this knee's protocols, worst, in times what they may differ",
        unit: "-",
        limits: [1.0, 2.0],
        why: "0.2 mm, 0.3 deg and 3 N are a tenth of what a laxity test tells; ours",
        take: |b, _| {
            table(b, "validate", "solvers.csv", |rows| {
                let limit = |r: &BTreeMap<String, String>| Some(cell(r, "difference")?.abs() / cell(r, "limit")?);
                largest(rows.iter().filter_map(limit))
            })
        },
    },
    Row {
        id: "explicit-runs",
        factor: Factor::CalculationVerification,
        what: "rows of the drawers that explicit dynamics were stopped in, of all",
        unit: "-",
        limits: [0.0, 0.1],
        why: "a row that was stopped is the quasi-static answer, which then nothing checks",
        take: |b, _| table(b, "validate", "MODEL/ap_laxity.csv", stopped),
    },
    Row {
        id: "explicit-passive",
        factor: Factor::CalculationVerification,
        what: "rows of passive flexion that explicit dynamics were stopped in, of all",
        unit: "-",
        limits: [0.0, 0.1],
        why: "as for the drawers",
        take: |b, _| table(b, "validate", "MODEL/passive_flexion.csv", stopped),
    },
    Row {
        id: "explicit-pivot",
        factor: Factor::CalculationVerification,
        what: "rows of the pivot shift with the intact knee that explicit dynamics were stopped in, of all",
        unit: "-",
        limits: [0.0, 0.1],
        why: "as for the drawers",
        take: |b, _| table(b, "validate", "MODEL/pivot_shift.csv", stopped),
    },
    Row {
        id: "misfit",
        factor: Factor::ModelForm,
        what: "misfit of the calibration, in times the noise that was stated, or taken where none is",
        unit: "-",
        limits: [MOST_NOISE, PARTLY_NOISE],
        why: "the report's own limits: beyond the first the model lacks something, beyond the second it is calibrated only in part",
        take: |b, _| of_model(b, "noise_scale", largest),
    },
    Row {
        id: "fibres-in-bone",
        factor: Factor::ModelForm,
        what: "deepest straight run of a bundle through bone",
        unit: "mm",
        limits: [1.0, 5.0],
        why: "fibres are straight and do not wrap; 1 mm is within the noise of a site, 5 mm shortens a 40 mm ligament by about 2 %",
        take: |b, _| metrics(b, "attachments", &[["through_bone_mm", "*"]], largest),
    },
    Row {
        id: "contact-law",
        factor: Factor::ModelForm,
        what: "contact force against the deformable cartilage of this knee, worst",
        unit: "%",
        limits: [5.0, 15.0],
        why: "5 % is what the solver's check against the published contact asks for; there is none unless the stage contact-law was run",
        take: |b, _| metrics(b, "contact-law", &[["fit_error_percent", ""]], largest),
    },
    Row {
        id: "missing-effects",
        factor: Factor::ModelForm,
        what: "effects that the diagnosis says the model lacks",
        unit: "-",
        limits: [0.0, 0.5],
        why: "an effect that is named is one that the model has not; there is none unless the stage diagnose was run",
        take: |b, _| {
            let read = b.file("diagnose", "metrics.json")?;
            let named = read.json().get("effects")?.as_array()?.len();
            Some((named as f64, read))
        },
    },
    Row {
        id: "registration",
        factor: Factor::ModelInputs,
        what: "scan on CT: bare bone kept out of the fit, root mean square",
        unit: "mm",
        limits: [0.15, 0.35],
        why: "0.35 mm is where the stage refuses; 0.15 mm is a scan's noise and a CT surface's together",
        take: |b, _| metrics(b, "register", &BONES.map(|p| [p, "held_out_rms_mm"]), largest),
    },
    Row {
        id: "sites-marked",
        factor: Factor::ModelInputs,
        what: "attachment sites marked or given on this knee, of all",
        unit: "-",
        limits: [0.8, 0.4],
        why: "sites of the literature are about 5 mm off on another knee; ours",
        take: |b, _| {
            let read = b.file("attachments", "metrics.json")?;
            let count = |key: &str| read.json()[key].as_f64();
            let own = count("sites_marked")? + count("sites_given")?;
            let value = own / (own + count("sites_literature")?);
            Some((value, read))
        },
    },
    Row {
        id: DETERMINED,
        factor: Factor::ModelInputs,
        what: "ligament parameters of which the data removed more than half of the variance",
        unit: "-",
        limits: [0.5, 0.2],
        // all() says it of the knee at hand: other knees may have given its prior
        why: "the rest lean on the literature; ours",
        take: |b, _| {
            table(b, "calibrate", "MODEL/parameters.csv", |rows| {
                share(rows, |r| cell(r, "determined").is_some_and(|d| d > 0.5))
            })
        },
    },
    Row {
        id: "strain-sensitivity",
        factor: Factor::ModelInputs,
        what: "AP of the drawers by reference strains that are 4.6 % other, as two calibrations of one knee are, worst",
        unit: "mm",
        limits: LAXITY_MM,
        why: LAXITY_WHY,
        take: |b, _| sensitive(b, "reference_strain"),
    },
    Row {
        id: "stiffness-sensitivity",
        factor: Factor::ModelInputs,
        what: "AP of the drawers by stiffnesses that are 14.3 % other, as two calibrations of one knee are, worst",
        unit: "mm",
        limits: LAXITY_MM,
        why: LAXITY_WHY,
        take: |b, _| sensitive(b, "stiffness"),
    },
    Row {
        id: "contact-sensitivity",
        factor: Factor::ModelForm,
        what: "AP of the drawers by half and twice the contact's pressure, worst",
        unit: "mm",
        limits: LAXITY_MM,
        why: LAXITY_WHY,
        take: |b, _| sensitive(b, "contact_law"),
    },
    Row {
        id: "menisci-sensitivity",
        factor: Factor::ModelForm,
        what: "AP of the drawers with the menisci taken out, worst",
        unit: "mm",
        limits: LAXITY_MM,
        why: "3 mm side to side are taken for a torn ACL [milano2022]; there is none where the model has no menisci",
        take: |b, _| sensitive(b, "menisci"),
    },
    Row {
        id: "starts",
        factor: Factor::CalculationVerification,
        what: "reference strains at the ends of the search's starts that fit within the noise, largest spread",
        unit: "%",
        limits: [2.0, 4.6],
        why: "4.6 % is what two data sets of one knee differ by [andreassen2025, table 4]; there is none of one end alone",
        take: |b, _| strains_of_starts(b),
    },
    Row {
        id: "measured",
        factor: Factor::Comparator,
        what: "comparator measured on a specimen (1) or made by a program (0)",
        unit: "-",
        limits: [1.0, 1.0],
        why: "what a program made says how the method works, not how a knee does",
        take: |b, _| {
            let read = b.file("ingest", "identity.json").filter(|_| b.model.is_some())?;
            let made = read.json()["provenance"] == "synthetic";
            Some((if made { 0.0 } else { 1.0 }, read))
        },
    },
    Row {
        id: "data-sets",
        factor: Factor::Comparator,
        what: "data sets of laxity of this knee",
        unit: "-",
        limits: [2.0, 1.0],
        why: "one apparatus alone cannot show its own frame's error; a second can",
        take: |b, _| {
            let read = b.file("calibrate", "metrics.json")?;
            let sets = read.json().as_object()?.keys().filter(|name| *name != JOINT).count();
            Some((sets as f64, read))
        },
    },
    Row {
        id: "trials",
        factor: Factor::Comparator,
        what: "measured loads that the model is held against",
        unit: "-",
        limits: [40.0, 15.0],
        why: "the paper's two sets have 56 together; 15 are five directions at three flexions",
        take: |b, _| of_model(b, "trials", largest),
    },
    Row {
        id: "flexions",
        factor: Factor::Comparator,
        what: "nominal flexions with a measurement",
        unit: "-",
        limits: [4.0, 2.0],
        why: "laxity and which ligament carries it change with flexion; 0, 30, 60, 90 deg are usual",
        take: |b, _| table(b, "calibrate", "MODEL/fit.csv", |rows| kinds(rows, "nominal_flexion_deg")),
    },
    Row {
        id: "tests",
        factor: Factor::Comparator,
        what: "kinds of tests: anterior, posterior, internal, external, varus, valgus and more",
        unit: "-",
        limits: [6.0, 3.0],
        why: "a direction that was not loaded leaves its ligaments to the literature",
        take: |b, _| table(b, "calibrate", "MODEL/fit.csv", |rows| kinds(rows, "test")),
    },
    Row {
        id: "stated-noise",
        factor: Factor::Equivalence,
        what: "scatter of the measurement as found, in times what its file states",
        unit: "-",
        limits: [1.5, 3.0],
        why: "readings that scatter by more than is stated were not taken as the model is asked: frames, creep, repositioning; 1.5 is what a calibration warns of",
        take: |b, _| {
            table(b, "calibrate", "MODEL/noise.csv", |rows| {
                largest(rows.iter().filter_map(|r| Some(cell(r, "inferred")? / cell(r, "stated")?)))
            })
        },
    },
    Row {
        id: "detectable-change",
        factor: Factor::Equivalence,
        what: "smallest change that the measurement can tell, in spreads between teams (6.2 mm AP, 14.9 deg IE, 6.8 deg VV), the worst",
        unit: "-",
        limits: [0.5, 1.0],
        why: "two readings differ by 2.77 times the scatter of one before they are two [weir2005]; where that is what models of one knee differ by, a comparison parts none of them; half is ours",
        take: |b, _| table(b, "calibrate", "MODEL/noise.csv", detectable),
    },
    Row {
        id: "frames",
        factor: Factor::Equivalence,
        what: "largest turn of the laboratory's frames against the bones', as found",
        unit: "deg",
        limits: [2.0, 5.0],
        why: "raters place a femoral axis 1 to 2 deg apart; beyond 5 deg pose and load mean other directions",
        take: |b, _| {
            table(b, "calibrate", "MODEL/frames.csv", |rows| {
                let turns = rows.iter().filter(|r| r.get("name").is_some_and(|n| n.ends_with("turn_deg")));
                largest(turns.filter_map(|r| Some(cell(r, "value")?.abs())))
            })
        },
    },
    Row {
        id: "fit",
        factor: Factor::OutputComparison,
        what: "predicted minus measured pose, root mean square, the worst coordinate; seen by the calibration",
        unit: "deg or mm",
        limits: [2.0, 4.0],
        why: "4 deg or 4 mm is what a team of KneeHub calls excessive of its own calibration; half of it is strong; ours",
        take: |b, _| of_model(b, "rms", largest),
    },
    Row {
        id: "cross-prediction",
        factor: Factor::OutputComparison,
        what: "ranges of laxity within the 90 % interval of a knee that has not seen them",
        unit: "-",
        limits: [0.8, 0.5],
        why: "nine of ten are due; eight of ten cannot be told from it by a dozen ranges; half are a coin",
        take: |b, _| {
            table(b, "validate", "cross_prediction.csv", |rows| {
                share(rows, |r| r.get("inside").is_some_and(|i| i == "yes"))
            })
        },
    },
    Row {
        id: "cross-prediction-width",
        factor: Factor::OutputComparison,
        what: "half the width of those intervals, in times the range that was measured, median",
        unit: "-",
        limits: [0.25, 0.5],
        why: "an interval as wide as the range itself (0.5) holds nearly any knee; half of that is ours",
        take: |b, _| table(b, "validate", "cross_prediction.csv", half_width),
    },
    Row {
        id: "passive-flexion",
        factor: Factor::OutputComparison,
        what: "passive flexion against what was measured, in spreads between teams (6.2 mm AP, 14.9 deg IE, 6.8 deg VV), the worst",
        unit: "-",
        limits: [0.25, 0.5],
        why: "the spread of five teams' models of one knee (doi 10.1115/1.4063627); half of it tells a model from the others",
        take: |b, _| table(b, "validate", "compare.csv", passive),
    },
    Row {
        id: "forces-determined",
        factor: Factor::Applicability,
        what: "share of the variance of ligament forces under drawers that the measurements removed, mean",
        unit: "-",
        limits: [0.5, 0.25],
        why: "laxity was measured and forces are asked for: what laxity does not settle is not validated by it; ours",
        take: |b, _| {
            table(b, "calibrate", "MODEL/forces.csv", |rows| {
                let all = numbers(rows, "determined");
                (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
            })
        },
    },
];

/// What depends on the stated context, too.
static RANGE: Row = Row {
    id: "flexion-range",
    factor: Factor::Applicability,
    what: "share of the flexions asked about (flexion_deg of the context) that were measured",
    unit: "-",
    limits: [1.0, 0.75],
    why: "beyond what was measured the model extrapolates",
    take: |b, c| {
        let [from, to] = c.flexion_deg?;
        table(b, "calibrate", "MODEL/fit.csv", |rows| {
            let at = numbers(rows, "fe_deg");
            let (least, most) = (smallest(at.iter().copied())?, largest(at)?);
            // one flexion alone is within what was measured, or it is not
            let both = to.min(most) - from.max(least);
            Some(if to > from { both.max(0.0) / (to - from) } else { f64::from(both >= 0.0) })
        })
    },
};

/// Moves of AP that are strong and adequate [mm].
const LAXITY_MM: [f64; 2] = [1.0, 3.0];
const LAXITY_WHY: &str =
    "3 mm side to side are taken for a torn ACL [milano2022]; 1 mm is what an arthrometer reads; ours";

const BONES: [&str; 2] = ["femur", "tibfib"];
const PARTS: [&str; 3] = ["femur", "tibia_medial", "tibia_lateral"];

/// The number whose reason depends on what gave the prior.
const DETERMINED: &str = "parameters-determined";

/// All evidence of a build, and of the program that built it. `prior`: what other knees gave the calibration, where they did.
pub(super) fn all(build: &Build, context: &Context, prior: Option<&SharedPriorSpec>) -> Vec<Evidence> {
    let mut out = of_program();
    out.extend(every().map(|row| row.evidence(build, context)));
    for evidence in out.iter_mut().filter(|e| e.id == DETERMINED) {
        evidence.why = format!("{}; ours", the_rest(prior));
    }
    out
}

/// Every row.
fn every() -> impl Iterator<Item = &'static Row> {
    ROWS.iter().chain(&QUESTIONS).chain([&RANGE])
}

/// Names of the numbers of a build.
#[cfg(test)]
pub(super) fn ids() -> Vec<&'static str> {
    every().map(|row| row.id).collect()
}

#[cfg(test)]
mod tests {
    use super::super::evidence::FactorTold;
    use super::super::grade::{Grade, grade, more_is_better};
    use super::*;

    #[test]
    fn a_number_beyond_a_limit_loses_a_grade_and_one_that_is_none_has_none() {
        for row in every() {
            let [strong, adequate] = row.limits;
            let worse = if more_is_better(row.limits) { -1.0 } else { 1.0 };
            let step = 1e-6 * (1.0 + strong.abs());
            assert_eq!(grade(strong, row.limits), Grade::Strong, "{}", row.id);
            assert!(grade(strong + worse * step, row.limits) < Grade::Strong, "{}", row.id);
            assert_eq!(grade(adequate + worse * step, row.limits), Grade::Weak, "{}", row.id);
            assert_eq!(grade(f64::NAN, row.limits), Grade::NoEvidence);
        }
        let (mut ids, count) = (ids(), every().count());
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), count);
    }

    #[test]
    fn every_factor_has_a_row() {
        for factor in super::super::evidence::FACTORS {
            let here = of_program().iter().any(|e| e.factor == factor) || every().any(|r| r.factor == factor);
            assert!(here, "{factor:?}");
        }
    }

    /// Evidence of a factor, each number on its own limit for strong.
    fn at_their_limits(factor: Factor) -> Vec<Evidence> {
        let program = of_program().into_iter().filter(|e| e.factor == factor);
        let build = every().filter(|r| r.factor == factor).map(|r| r.told(None, None, false));
        let at = |e: Evidence| Evidence { value: Some(e.limits[0]), grade: grade(e.limits[0], e.limits), ..e };
        program.chain(build).map(at).collect()
    }

    #[test]
    fn one_tolerance_that_is_tightened_takes_its_factor_down() {
        for factor in super::super::evidence::FACTORS {
            let pieces = at_their_limits(factor);
            let of = |all: Vec<Evidence>| FactorTold::of(factor, all, None).grade;
            assert_eq!(of(pieces.clone()), Grade::Strong, "{factor:?}");
            for (k, piece) in pieces.iter().enumerate() {
                let [strong, adequate] = piece.limits;
                let step = 1e-6 * (1.0 + strong.abs()) * if piece.more_is_better { 1.0 } else { -1.0 };
                let with = |limits: [f64; 2]| {
                    let mut all = pieces.clone();
                    all[k].grade = grade(strong, limits);
                    of(all)
                };
                assert!(with([strong + step, adequate]) < Grade::Strong, "{}", piece.id);
                assert_eq!(with([strong + 2.0 * step, strong + step]), Grade::Weak, "{}", piece.id);
            }
        }
    }
}
