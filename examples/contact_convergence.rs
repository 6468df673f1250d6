//! The fitted contact law by the size of the elements: `cargo run --release --example contact_convergence -- SPECIMEN OUT [EDGE_MM:LAYERS]...`
//!
//! Builds SPECIMEN to the stage contact-law with each edge length and number of layers (default 1:3 0.75:4 0.5:5), each in a folder of OUT (what is
//! there and unchanged is taken up), and prints law, forces at equal approach, peak pressure, time.
#![expect(clippy::print_stderr, clippy::print_stdout, reason = "a table for the reader")]

use genu::build_args::BuildArgs;
use genu::error::BuildError;
use genu::options::parse_override;
use genu::{run, store};
use serde_json::Value;
use std::path::Path;
use std::process::ExitCode;

/// Share of the largest approach that all meshes reached at which they are compared.
const SHARES: [f64; 3] = [0.4, 0.7, 1.0];

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [specimen, out, meshes @ ..] = args.as_slice() else {
        eprintln!("usage: contact_convergence SPECIMEN OUT [EDGE_MM:LAYERS]...");
        return ExitCode::from(2);
    };
    let default = ["1:3", "0.75:4", "0.5:5"].map(String::from);
    let meshes = if meshes.is_empty() { &default } else { meshes };
    match table(Path::new(specimen), Path::new(out), meshes) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("{e}");
            ExitCode::FAILURE
        }
    }
}

/// What a mesh gave: its name, law.json, metrics, seconds, and rows of curves.csv.
struct Built {
    mesh: String,
    law: Value,
    elements: u64,
    seconds: f64,
    rows: Vec<[f64; 5]>,
}

fn table(specimen: &Path, out: &Path, meshes: &[String]) -> Result<(), BuildError> {
    let built = meshes.iter().map(|m| build(specimen, out, m)).collect::<Result<Vec<_>, _>>()?;
    println!("| edge : layers | elements | pressures [MPa] | fit error | seconds |\n|---|---|---|---|---|");
    for b in &built {
        let list: Vec<String> = b.law["pressure_mpa"]
            .as_array()
            .into_iter()
            .flatten()
            .map(|p| format!("{:.4}", p.as_f64().unwrap_or(0.0)))
            .collect();
        let error = b.law["fit_error_percent"].as_f64().unwrap_or(f64::NAN);
        println!("| {} | {} | {} | {error:.1} % | {:.0} |", b.mesh, b.elements, list[1..].join(" / "), b.seconds);
    }
    println!("\n| flexion, approach | {} |\n|---{}|", meshes.join(" | "), "|---".repeat(meshes.len()));
    let mut flexions: Vec<f64> = built.first().into_iter().flat_map(|b| &b.rows).map(|r| r[0]).collect();
    flexions.dedup();
    for flexion in flexions {
        let of = |b: &Built| b.rows.iter().filter(|r| r[0] == flexion).copied().collect::<Vec<_>>();
        let reached = built.iter().filter_map(|b| of(b).last().map(|r| r[1])).fold(f64::INFINITY, f64::min);
        for share in SHARES {
            let cells: Vec<String> = built
                .iter()
                .map(|b| {
                    let at = |k: usize| between(&of(b), share * reached, k);
                    format!("{:.0} N, {:.0} mm2, {:.2} MPa", at(2), at(3), at(4))
                })
                .collect();
            println!("| {flexion} deg, {:.3} mm | {} |", share * reached, cells.join(" | "));
        }
    }
    Ok(())
}

/// Column `k` at an approach, linear between rows.
fn between(rows: &[[f64; 5]], approach: f64, k: usize) -> f64 {
    let mut before = [0.0; 5];
    for row in rows {
        if row[1] >= approach {
            let t = (approach - before[1]) / (row[1] - before[1]).max(1e-12);
            return before[k] + (row[k] - before[k]) * t;
        }
        before = *row;
    }
    before[k]
}

fn build(specimen: &Path, out: &Path, mesh: &str) -> Result<Built, BuildError> {
    let (edge, layers) =
        mesh.split_once(':').ok_or_else(|| BuildError::Usage(format!("{mesh}: EDGE_MM:LAYERS was expected")))?;
    let folder = out.join(mesh.replace(':', "x"));
    eprintln!("{mesh}");
    let set = |text: String| parse_override(&text).map_err(BuildError::Usage);
    run::run(&BuildArgs {
        out: Some(folder.clone()),
        to: Some("contact-law".into()),
        quiet: true,
        overrides: vec![
            set(format!("hexmesh.edge_length_mm={edge}"))?,
            set(format!("hexmesh.layers={layers}"))?,
            set("contact-law.fit=true".into())?,
        ],
        ..BuildArgs::of(specimen.to_path_buf())
    })?;
    let parse = |name: &str| -> Result<Value, BuildError> {
        serde_json::from_str(&store::read_text(&folder.join(name))?)
            .map_err(|e| BuildError::File(format!("{name}: {e}")))
    };
    let log = store::read_text(&folder.join("log.jsonl"))?;
    let of_stage = |stage: &str| {
        log.lines()
            .filter_map(|l| serde_json::from_str::<Value>(l).ok())
            .find(|r| r["stage"] == stage)
            .unwrap_or_default()
    };
    let hexes = of_stage("hexmesh");
    let count = |name: &str| hexes["metrics"][name]["elements"].as_u64().unwrap_or(0);
    let text = store::read_text(&folder.join("08b-contact-law/curves.csv"))?;
    let number = |w: &str| w.parse::<f64>().unwrap_or(f64::NAN);
    let rows = text
        .lines()
        .skip(1)
        .map(|l| {
            let words: Vec<f64> = l.split(',').map(number).collect();
            std::array::from_fn(|k| words.get(k).copied().unwrap_or(f64::NAN))
        })
        .collect();
    Ok(Built {
        mesh: mesh.into(),
        law: parse("08b-contact-law/law.json")?,
        elements: count("femur") + count("tibia_medial") + count("tibia_lateral"),
        seconds: of_stage("contact-law")["seconds"].as_f64().unwrap_or(f64::NAN),
        rows,
    })
}
