//! Writes docs/convergence.md: what a built knee answers, by the size of its cartilage's elements, as the paper's supplement asks [andreassen2025, section 2.4.3].
//!
//! `cargo run --release --example convergence -- SPECIMEN OUT`: builds SPECIMEN to assemble with elements of 2, 1, 0.75 and 0.5 mm, each in a folder of OUT (what is
//! there and unchanged is taken up), gives each the paper's parameters for RKS, and compares laxity, pivot shift and ligament forces.
#![expect(clippy::print_stderr, reason = "says what is wrong")]

use calibration::design::Design;
use genu::build_args::BuildArgs;
use genu::error::BuildError;
use genu::options::parse_override;
use genu::{model_file, run, store};
use sim::coordinate::Load;
use sim::laxity::{LaxityTrial, Test};
use sim::protocols::ProtocolOptions;
use sim::trials::{TrialOptions, solve_trials};
use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;
use validation::published;
use validation::validate::Source;

/// Edge length [mm] and layers of each mesh, coarse to fine.
const MESHES: [(f64, u32); 4] = [(2.0, 2), (1.0, 3), (0.75, 4), (0.5, 5)];
/// What moves by less between the meshes is the scatter of their edges, and has no order [deg, mm; of forces, N].
const SCATTER: [(&str, f64); 3] = [("deg", 0.05), ("mm", 0.05), ("N", 5.0)];
/// Moments of the IE tests [N m].
const IE_NM: f64 = 4.0;
const PAGE: &str = "docs/convergence.md";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [specimen, out] = args.as_slice() else {
        eprintln!("usage: convergence SPECIMEN OUT");
        return ExitCode::from(2);
    };
    let written =
        page(Path::new(specimen), Path::new(out)).and_then(|text| store::write(Path::new(PAGE), text.as_bytes()));
    match written {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("{e}");
            ExitCode::FAILURE
        }
    }
}

/// A number that a knee answers with.
struct Answer {
    what: String,
    unit: &'static str,
    value: f64,
}

fn page(specimen: &Path, out: &Path) -> Result<String, BuildError> {
    let mut all = Vec::new();
    for (edge, layers) in MESHES {
        eprintln!("{edge} mm");
        all.push(answers(specimen, &out.join(edge.to_string()), edge, layers)?);
    }
    let mut text = "# Convergence with the cartilage's mesh\n\n\
        Written by `cargo run --release --example convergence -- SPECIMEN OUT`, here with S192803. The same knee is built with elements of 2 mm in 2 layers, 1 mm in 3, 0.75 mm in 4 \
        and 0.5 mm in 5. Cartilage is rigid under its pressure-overclosure law. Parameters: the paper's Table 4, RKS. Compression: 20 N.\n\n\
        Order: the p of a + b h^p through the values at 2, 1 and 0.5 mm. There is none where they do not go one way. There is none to observe where all four lie within 0.1 deg, 0.1 mm or \
        10 N of each other: the meshes' edges scatter as much. \
        An order above 2 says no more than that the finer two agree within that scatter.\n\n\
        | answer | unit | 2 mm | 1 mm | 0.75 mm | 0.5 mm | 1 to 0.5 mm | order |\n|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for (k, Answer { what, unit, .. }) in all[0].iter().enumerate() {
        let values: Vec<f64> = all.iter().filter_map(|a| a.get(k)).map(|a| a.value).collect();
        let [coarse, one, middle, fine] = values[..] else { continue };
        let change = match *unit {
            "N" => format!("{:+.2} %", 100.0 * (fine - one) / one),
            _ => format!("{:+.2}", fine - one),
        };
        let order = order(&values, unit);
        let _ = writeln!(
            text,
            "| {what} | {unit} | {coarse:.2} | {one:.2} | {middle:.2} | {fine:.2} | {change} | {order} |"
        );
    }
    Ok(text)
}

/// The observed order of convergence, in words where there is none: the first mesh's edges are twice the second's, those twice the last's.
fn order(values: &[f64], unit: &str) -> String {
    let [a, b, _, c] = *values else { return String::new() };
    let (low, high) = values.iter().fold((a, a), |(l, h), v| (v.min(l), v.max(h)));
    let scatter = SCATTER.iter().find(|s| s.0 == unit).map_or(0.0, |s| s.1);
    if high - low < 2.0 * scatter {
        return "scatter".to_owned();
    }
    let p = ((a - b) / (b - c)).log2();
    if p.is_finite() { format!("{p:.1}") } else { "none".to_owned() }
}

fn answers(specimen: &Path, folder: &Path, edge: f64, layers: u32) -> Result<Vec<Answer>, BuildError> {
    let set = |text: String| parse_override(&text).map_err(BuildError::Usage);
    run::run(&BuildArgs {
        out: Some(folder.to_path_buf()),
        to: Some("assemble".into()),
        quiet: true,
        overrides: vec![set(format!("hexmesh.edge_length_mm={edge}"))?, set(format!("hexmesh.layers={layers}"))?],
        ..BuildArgs::of(specimen.to_path_buf())
    })?;
    let fault = |e: String| BuildError::File(format!("{edge} mm: {e}"));
    let built = model_file::load(&folder.join("09-assemble"))?;
    let design = Design::of_model(&built.spec).map_err(|e| fault(e.to_string()))?;
    let table4 = published::parameters(&built.spec.id, "rks").unwrap_or_default();
    let known: Vec<f64> = design.variables.iter().filter_map(|v| table4.get(v.number as usize - 1)).copied().collect();
    let spec = if known.is_empty() { built.spec.clone() } else { design.apply(&built.spec, &known) };
    let model = sim::compile(&spec, &built.meshes).map_err(|e| fault(e.to_string()))?;
    let source =
        Source::simulated("rks", &spec, &model, &ProtocolOptions::default()).map_err(|e| fault(e.to_string()))?.0;
    let mut out = Vec::new();
    let mut forces = 0.0;
    for fe in source.ap_flexions() {
        let [a, p] = [Test::Anterior, Test::Posterior].map(|test| source.ap_end(test, fe));
        let (Some(a), Some(p)) = (a, p) else { continue };
        out.push(Answer {
            what: format!("AP laxity, 133 N either way, {fe} deg"),
            unit: "mm",
            value: a.pose.ap_mm - p.pose.ap_mm,
        });
        forces += source.groups(a).iter().chain(&source.groups(p)).sum::<f64>();
    }
    let moments = ie_trials();
    let turned = solve_trials(&model, &moments, &TrialOptions::default());
    for (pair, trials) in turned.chunks(2).zip(moments.chunks(2)) {
        if let [Ok(external), Ok(internal)] = pair {
            let what = format!("IE laxity, {IE_NM} N m either way, {} deg", trials[0].fe_deg);
            out.push(Answer { what, unit: "deg", value: external.pose.ie_deg - internal.pose.ie_deg });
        }
    }
    if let Some(end) = source.pivot_end(true) {
        let p = end.pose;
        for (axis, unit, value) in [("VV", "deg", p.vv_deg), ("IE", "deg", p.ie_deg), ("AP", "mm", p.ap_mm)] {
            out.push(Answer { what: format!("pivot shift, {axis}"), unit, value });
        }
        out.push(Answer {
            what: "pivot shift, all ligament forces".into(),
            unit: "N",
            value: source.groups(end).iter().sum(),
        });
    }
    out.push(Answer { what: "AP tests, all ligament forces".into(), unit: "N", value: forces });
    Ok(out)
}

/// External, then internal, at 30 and 90 deg.
fn ie_trials() -> Vec<LaxityTrial> {
    let mut out = Vec::new();
    for fe_deg in [30.0, 90.0] {
        for (test, sign) in [(Test::External, 1.0), (Test::Internal, -1.0)] {
            let load = Load::new(0.0, sign * IE_NM, 0.0, 0.0, 20.0);
            out.push(LaxityTrial::asked(format!("{} {fe_deg}", test.name()), test, fe_deg, load));
        }
    }
    out
}
