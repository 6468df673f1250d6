//! Stage 11, validate: the protocols on the calibrated models, and their comparison.

mod charts;
mod predictions;
mod tables;

pub(crate) use predictions::{BETWEEN_TEAMS, predictions};

use super::calibrate::Calibration;
use super::{Files, Stage, Values, View, Work, reported};
use crate::calibrate::samples;
use crate::error::BuildError;
use crate::given::PassiveFlexion;
use crate::kept::Kept;
use crate::model_file::{LoadedModel, assembled_model, calibrated_model};
use crate::options::BuildOptions;
use crate::report::chart::Chart;
use crate::report::check::Check;
use crate::report::html::escaped;
use crate::validate::{Validation, band, files_of, is_the_knee, source};
use crate::which_model::JOINT;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use calibration::cost::CostFunction;
use calibration::samples::Change;
use notices::{Kind, Notice};
use sim::flags::{Flag, each_once};
use sim::laxity::TrialResult;
use sim::protocols::ProtocolOptions;
use stages::assemble::Assembled;
use stages::bones::Bones;
use stages::cartilage::Cartilage;
use std::borrow::Cow;
use std::fmt::Write;
use validation::apart::Apart;
use validation::cross::{CrossPrediction, Range, ranges};
use validation::figures;
use validation::validate::Source;

reported!(Validation);

/// The question whether the protocols could be run.
pub(crate) const PROTOCOLS_END: &str = "Do the protocols run to their end?";

/// The stage.
pub(crate) struct Validate;

impl Stage for Validate {
    const NUMBER: &'static str = "11";
    const NAME: &'static str = "validate";
    const TELLING: &'static [&'static str] = &["anterior_ap", "posterior_ap"];
    type Inputs<'a> =
        (&'a Kept<Assembled>, &'a Kept<Bones>, &'a Kept<Cartilage>, &'a Kept<Calibration>, &'a Kept<PassiveFlexion>);
    type Options = ProtocolOptions;
    type Value = Validation;
    type Fault = BuildError;

    fn options(all: &BuildOptions) -> &ProtocolOptions {
        &all.validate
    }

    fn heard(all: &BuildOptions) -> Cow<'_, ProtocolOptions> {
        Cow::Owned(all.validate.heard())
    }

    fn run(
        (assembled, bones, cartilage, calibration, passive): Self::Inputs<'_>,
        options: &ProtocolOptions,
        work: &Work,
    ) -> Result<Validation, BuildError> {
        let model = assembled_model(assembled, bones, cartilage);
        let (mut sources, mut warnings) = (Vec::new(), Vec::new());
        for (name, outcome) in calibration.main_first() {
            (work.tell)(&format!("validate {name}"));
            let (found, told) = work.part(name, || {
                let mut told = Vec::new();
                let is_knee = is_the_knee(name == JOINT, calibration.joint.is_some());
                let mut found = source(name, (&outcome.spec, &model.meshes), (is_knee, options), &mut told)?;
                found.model = calibrated_model(&model, &outcome.spec, name).label();
                if let Some(samples) = samples(outcome, &model.spec) {
                    band(&mut found, &samples, &model, options, &mut told);
                }
                Ok((found, told))
            })?;
            sources.push(found);
            warnings.extend(told);
        }
        let cross = if calibration.data_sets().len() > 1 {
            (work.tell)("validate across data sets");
            work.part("cross-prediction", || Ok(cross(calibration, &model, options, &mut warnings)))?
        } else {
            vec![]
        };
        Ok(Validation::new(sources, passive.0.clone(), warnings).with_cross(cross))
    }

    /// A folder a source, the comparison, tables and figures of the models and of the targets.
    fn artifacts(v: &Validation, (_, _, _, calibration, _): Self::Inputs<'_>) -> Files {
        let mut files = files_of(v).map_err(|e| std::io::Error::other(e.to_string()))?;
        files.extend(figures_of_targets(calibration));
        Ok(files)
    }

    /// Forces of the knee, the first of the models, against flexion.
    fn charts(v: &Values) -> Vec<Chart> {
        v.of::<Validation>().and_then(|v| v.sources.first()).map_or(vec![], charts::charts)
    }

    /// The knee's forces, then the paper's tables and figures, all models side by side.
    fn more(v: &Values) -> String {
        let Some(validation) = v.of::<Validation>() else { return String::new() };
        let mut html = String::new();
        let files = v.folder.read_folder(&Validate.folder()).unwrap_or_default();
        for (name, bytes) in files.iter().filter(|(name, _)| name.ends_with(".svg")) {
            let title = name.trim_end_matches(".svg").replace('_', ", ").replace("figure", "Figure ");
            let _ = write!(
                html,
                "<figure data-svg=\"{0}\"><h3>{0}</h3><img class=\"paper\" alt=\"{0} of the paper, drawn for this knee; the tables below hold its numbers\" src=\"data:image/svg+xml;base64,{1}\"></figure>",
                escaped(&title),
                STANDARD.encode(bytes)
            );
        }
        let own = validation.sources.first().map_or(vec![], tables::tables);
        let all = validation::tables::tables(&validation.sources);
        let differences = validation::tables::differences(&validation.differences);
        let cross = (!validation.cross.is_empty()).then(|| validation::tables::cross_predictions(&validation.cross));
        let sources = &validation.sources;
        let of_knee = [validation::tables::solvers(sources), validation::tables::sensitivity(sources)];
        let of_knee: Vec<_> = of_knee.into_iter().filter(|t| !t.rows.is_empty()).collect();
        let open = own.iter().chain(&cross).chain(&of_knee).map(|t| tables::html(t, true));
        open.chain(all.iter().chain([&differences]).map(|t| tables::html(t, false))).collect::<String>() + &html
    }

    fn checks(v: &Values) -> Vec<Check> {
        let mut out = Vec::new();
        for source in v.of::<Validation>().into_iter().flat_map(|v| &v.sources) {
            let told: Vec<(bool, String)> =
                source.protocols().into_iter().filter_map(|(p, rows)| flagged(p, rows)).collect();
            let words: Vec<&str> = told.iter().map(|(_, words)| words.as_str()).collect();
            let odd = told.iter().any(|(odd, _)| *odd);
            out.push(Check {
                question: PROTOCOLS_END,
                answer: match (told.is_empty(), odd) {
                    (true, _) => "all of them".to_owned(),
                    (_, true) => format!("look at {}", words.join("; ")),
                    (_, false) => format!("all of them; {}", words.join("; ")),
                },
                good: Some(!odd),
                reaches: None,
                model: Some(source.name.clone()),
                stage: Self::NAME,
            });
            out.extend(agreement(source));
        }
        out
    }
}

/// Why a range has no interval though the knee has its equilibria.
const FEW_SAMPLES: &str = "fewer than two of its samples stay on the plateau at both loads";

/// What each data set's knee predicts of the ranges that the others measured. Where it has no equilibrium under their loads, that is told.
fn cross(
    calibration: &Calibration,
    model: &LoadedModel,
    options: &ProtocolOptions,
    warnings: &mut Vec<Notice>,
) -> Vec<CrossPrediction> {
    let mut out = Vec::new();
    for (name, outcome) in &calibration.sources {
        let Some(samples) = samples(outcome, &model.spec) else { continue };
        let others = calibration.data_sets().into_iter().filter(|(other, _)| other != name);
        for (data, trials) in others {
            let ranges = ranges(&trials, &calibration.options.targets);
            let changes: Vec<Change> = ranges.iter().map(|r| r.change.clone()).collect();
            let predict = |of: &[Change]| samples.changes(&model.meshes, of, options.samples);
            let mut lost = Vec::new();
            let bands = predict(&changes).unwrap_or_else(|_| {
                // one pose that cannot be found must not take the others with it
                let mut alone = |(c, r): (&Change, &Range)| match predict(std::slice::from_ref(c)) {
                    Ok(band) => band.into_iter().next().flatten(),
                    Err(e) => {
                        lost.push((r.in_words(), e.to_string()));
                        None
                    }
                };
                changes.iter().zip(&ranges).map(&mut alone).collect()
            });
            for (r, _) in ranges.iter().zip(&bands).filter(|(_, band)| band.is_none()) {
                if lost.iter().all(|(place, _)| *place != r.in_words()) {
                    lost.push((r.in_words(), FEW_SAMPLES.to_owned()));
                }
            }
            if let Some((_, why)) = lost.first() {
                let places: Vec<&str> = lost.iter().map(|(place, _)| place.as_str()).collect();
                let text = format!(
                    "the knee of {name} does not predict {} of {} ranges that {data} measured ({}): {why}",
                    lost.len(),
                    ranges.len(),
                    places.join(", ")
                );
                warnings.push(Kind::CrossLeftOut.notice(text).whose(name).count(lost.len()));
            }
            out.extend(ranges.iter().zip(bands).filter_map(|(r, predicted)| {
                Some(CrossPrediction {
                    model: name.clone(),
                    data: data.clone(),
                    coordinate: r.change.coordinate.name().to_owned(),
                    without: r.without().to_vec(),
                    flexion_deg: r.flexion_deg,
                    loads: r.loads(),
                    measured: r.measured,
                    predicted: predicted?,
                })
            }));
        }
    }
    out
}

/// Whether explicit dynamics and the quasi-static solver agree; none where a source was told by one of them.
fn agreement(source: &Source) -> Option<Check> {
    let check = source.check.as_ref()?;
    let rows = || source.protocols().into_iter().flat_map(|(_, rows)| rows);
    let stopped = rows().filter(|r| r.flags.contains(&Flag::Stopped)).count();
    let apart = rows().flat_map(|r| &r.flags).any(|f| matches!(f, Flag::Apart(_)));
    let told = ["mm", "deg", "N"].into_iter().filter_map(|unit| Some(largest(check.worst(unit)?)));
    let told: Vec<String> = told.collect();
    let stop = if stopped == 0 {
        String::new()
    } else {
        format!("; in {stopped} rows the explicit one was stopped early, they are quasi-static")
    };
    let answer = if told.is_empty() {
        "no row was told by both".to_owned()
    } else {
        format!("at most {} apart", told.join(", "))
    };
    Some(Check {
        question: "Do explicit dynamics and the quasi-static solver agree?",
        answer: answer + &stop,
        good: Some(!apart && stopped == 0),
        reaches: None,
        model: Some(source.name.clone()),
        stage: Validate::NAME,
    })
}

/// The largest difference of a unit with its place, its limit and the cause where it is beyond.
fn largest(a: &Apart) -> String {
    let cause = a.cause.map_or(String::new(), |c| format!(": {}", c.words()));
    format!(
        "{:.2} {} ({} of {}, {:.0} deg; limit {}{cause})",
        a.difference().abs(),
        a.unit,
        a.quantity,
        in_words(&a.protocol),
        a.flexion_deg,
        a.limit
    )
}

/// A protocol's name for a reader.
fn in_words(protocol: &str) -> &str {
    match protocol {
        "ap_laxity" => "drawers",
        "passive_flexion" => "passive flexion",
        "pivot_shift" => "pivot shift",
        "pivot_shift_no_acl" => "pivot shift without ACL",
        other => other,
    }
}

/// A protocol with the flags of its rows, each once, and whether any makes it odd; none where there is no flag.
fn flagged(protocol: &str, rows: &[TrialResult]) -> Option<(bool, String)> {
    let all = || rows.iter().flat_map(|r| &r.flags).filter(|f| !f.is_of_the_single_model());
    let flags = each_once(all());
    (!flags.is_empty()).then(|| (all().any(Flag::is_odd), format!("{} ({})", in_words(protocol), flags.join(", "))))
}

/// The knee's forces and its passive flexion for a page of paper.
pub(crate) fn on_paper(v: &Values) -> String {
    let Some(knee) = v.of::<Validation>().and_then(|v| v.sources.first()) else { return String::new() };
    let figure = v.folder.read_file(&format!("{}/figure8.svg", Validate.folder()));
    let figure = figure.map_or(String::new(), |svg| {
        format!(
            "<p><b>Passive flexion of every model, and as measured where it was</b></p><img class=\"paper\" alt=\"Passive flexion of every model, and as measured\" src=\"data:image/svg+xml;base64,{}\">",
            STANDARD.encode(svg)
        )
    });
    tables::on_paper(knee) + &figure
}

/// Figures 5 and 6: the targets, and what misses them.
fn figures_of_targets(c: &Calibration) -> Vec<(String, Vec<u8>)> {
    let targets = c.data_sets();
    let mut files = vec![("figure5.svg".to_owned(), figures::figure5(&targets).into_bytes())];
    for (name, o) in c.main_first() {
        if let Ok(cost) = CostFunction::new(&o.trials, &o.spec.frames.gs_ct_pose, &c.options.cost) {
            files.push((format!("figure6_{name}.svg"), figures::figure6(name, &cost, &o.found.predicted).into_bytes()));
        }
    }
    files
}
