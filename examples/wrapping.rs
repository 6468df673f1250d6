//! Prints what wrapping changes of knees: `cargo run --release --example wrapping -- MODEL...`, each a model.json or a build.
//!
//! A model is asked twice, with straight ligaments and with all of them wrapping over femur and tibia; its other numbers stay. docs/theory/wrapping.md has the table.
#![expect(clippy::disallowed_methods, reason = "reads the clock of its thread")]
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "it prints a table, and says what is wrong")]

#[path = "../benches/common/clock.rs"]
mod clock;

use clock::Clock;
use genu::model_file::{self, LoadedModel};
use meshes::query::SurfaceQuery;
use meshes::{Isometry, Point};
use sim::Model;
use sim::coordinate::Load;
use sim::mesh::MeshValue;
use sim::spec::{ModelSpec, WrapSpec};
use sim::trials::{TrialOptions, solve};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

/// Flexions of a passive motion [deg].
const FLEXIONS_DEG: [f64; 7] = [0.0, 20.0, 40.0, 60.0, 80.0, 100.0, 120.0];
/// Compression in it [N].
const COMPRESSION_N: f64 = 20.0;
/// Loads of the trials that are timed: VV, IE [N m], ML, AP, SI [N].
const TIMED: [[f64; 5]; 4] =
    [[0.0, 0.0, 0.0, 0.0, 20.0], [0.0, 0.0, 0.0, 133.0, 20.0], [8.0, -4.0, 0.0, 0.0, 20.0], [0.0, 5.0, 0.0, 0.0, 20.0]];
/// Times that each is solved; the processor's clock ticks in 4 ms.
const REPEATS: usize = 6;
/// Steps along a piece of a path at which its depth is measured.
const STEPS: usize = 12;

fn main() -> ExitCode {
    let models: Vec<String> = std::env::args().skip(1).collect();
    if models.is_empty() {
        eprintln!("usage: wrapping MODEL...");
        return ExitCode::from(2);
    }
    for path in models {
        if let Err(e) = model_file::load(Path::new(&path)).map_err(|e| e.to_string()).and_then(|m| compare(&m)) {
            eprintln!("{path}: {e}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

fn compare(loaded: &LoadedModel) -> Result<(), String> {
    let fault = |e: sim::SimError| e.to_string();
    let straight = sim::compile(&ModelSpec { wrap: None, ..loaded.spec.clone() }, &loaded.meshes).map_err(fault)?;
    let start = Clock::start();
    let wrapped = sim::compile(&wrapping(loaded)?, &loaded.meshes).map_err(fault)?;
    println!("\n{}; compiled in {:.0} ms", loaded.told(), start.milliseconds());
    println!("| deg | straight: depth mm, ligaments N | wrapped: depth mm, ligaments N | evaluations |");
    println!("|---|---|---|---|");
    let bones = bones(loaded)?;
    let [mut deepest, mut last] = [BTreeMap::new(), BTreeMap::new()];
    for flexion in FLEXIONS_DEG {
        let answer = |model: &Model| solve(model, flexion, &Load::compression(COMPRESSION_N), &TrialOptions::default());
        let both = [&straight, &wrapped].map(answer);
        let mut cells = Vec::new();
        let mut counts = Vec::new();
        for (model, answer) in [&straight, &wrapped].into_iter().zip(both) {
            let answer = match answer {
                Ok(answer) => answer,
                Err(e) => {
                    cells.push(e.to_string());
                    continue;
                }
            };
            let depths = depths(model, &answer.evaluation.pose, &bones);
            let (name, most) = depths.iter().max_by(|a, b| a.1.total_cmp(b.1)).ok_or("no fibre")?;
            cells.push(format!("{most:.2} ({name}), {:.0}", answer.forces_n.iter().sum::<f64>()));
            counts.push(answer.evaluations.to_string());
            let which = if model.fibres.iter().any(|f| f.wraps()) { &mut last } else { &mut deepest };
            for (name, depth) in depths {
                let most: &mut f64 = which.entry(name).or_default();
                *most = most.max(depth);
            }
            if flexion == 120.0 {
                let of = model.bundle_names().into_iter().zip(&answer.forces_n).filter(|(_, n)| **n > 1.0);
                println!("<!-- {} -->", of.map(|(b, n)| format!("{b} {n:.0}")).collect::<Vec<_>>().join(", "));
            }
        }
        println!("| {flexion} | {} | {} |", cells.join(" | "), counts.join(" and "));
    }
    println!("deepest, straight to wrapped [mm]:");
    for (name, depth) in &deepest {
        println!("  {name}: {depth:.2} to {:.2}", last.get(name).copied().unwrap_or_default());
    }
    timed(&straight, &wrapped)
}

/// The specification with all its ligaments wrapping, each bundle's reference length that of its paths.
fn wrapping(loaded: &LoadedModel) -> Result<ModelSpec, String> {
    let mut spec = loaded.spec.clone();
    if spec.wrap.is_some() {
        return Ok(spec);
    }
    let bundles = spec.bundles.iter().map(|b| b.name.clone()).collect();
    spec.wrap = Some(WrapSpec { over: vec!["femur".into(), "tibia".into()], bundles });
    let lengths = sim::ligament::lengths(&spec, &loaded.meshes).map_err(|e| e.to_string())?;
    for b in &mut spec.bundles {
        let own: Vec<f64> =
            spec.fibres.iter().zip(&lengths).filter(|(f, _)| f.bundle == b.name).map(|(_, l)| *l).collect();
        b.reference_length_mm = own.iter().sum::<f64>() / own.len() as f64;
    }
    Ok(spec)
}

/// The bones, femur first.
fn bones(loaded: &LoadedModel) -> Result<[SurfaceQuery; 2], String> {
    let of = |name: &str| {
        let body = loaded.spec.bodies.iter().find(|b| b.name == name)?;
        let MeshValue::Surface(mesh) = loaded.meshes.get(&body.bone)? else { return None };
        SurfaceQuery::new(mesh)
    };
    Ok([of("femur").ok_or("no femur")?, of("tibia").ok_or("no tibia")?])
}

/// How deep each bundle runs in bone at a pose [mm].
fn depths(model: &Model, pose: &sim::joint::Pose, [femur, tibia]: &[SurfaceQuery; 2]) -> BTreeMap<String, f64> {
    let back: Isometry = pose.femur.inverse();
    let mut out = BTreeMap::new();
    for fibre in &model.fibres {
        let way = fibre.way(pose);
        let along = way.windows(2).flat_map(|w| (0..=STEPS).map(|k| w[0] + (w[1] - w[0]) * (k as f64 / STEPS as f64)));
        let depth = |p: Point| -femur.signed_distance(&(back * p)).min(tibia.signed_distance(&p));
        let most: &mut f64 = out.entry(model.bundles[fibre.bundle].name.clone()).or_default();
        *most = along.map(depth).fold(*most, f64::max);
    }
    out
}

/// Time of a trial with wrapping over the same without, in turns.
fn timed(straight: &Model, wrapped: &Model) -> Result<(), String> {
    let (mut sums, mut ratios) = ([0.0; 2], Vec::new());
    for (flexion, load) in FLEXIONS_DEG.iter().flat_map(|f| TIMED.map(|l| (*f, l))) {
        let load = Load(sim::coordinate::Free(load));
        let mut own = [0.0; 2];
        for _ in 0..REPEATS {
            for (model, spent) in [wrapped, straight].into_iter().zip(&mut own) {
                let start = Clock::start();
                // a knee that has no equilibrium takes its time, too
                let _ = solve(model, flexion, &load, &TrialOptions::default());
                *spent += start.milliseconds();
            }
        }
        sums = [sums[0] + own[0], sums[1] + own[1]];
        ratios.push(own[0] / own[1]);
    }
    ratios.sort_by(f64::total_cmp);
    let each = sums[1] / (ratios.len() * REPEATS) as f64;
    println!(
        "a trial: {each:.2} ms straight; with wrapping {:.2} times (median {:.2}, most {:.2})",
        sums[0] / sums[1],
        ratios[ratios.len() / 2],
        ratios[ratios.len() - 1]
    );
    Ok(())
}
