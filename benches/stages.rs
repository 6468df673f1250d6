//! User time of each geometry stage at real size, with its ratio to the last run of another commit:
//! `cargo bench --bench stages [SPECIMEN]`.
//!
//! Without a specimen, `../shared/specimens/S192803`, or the phantom where that is not there. Each stage runs three times;
//! the least counts. target/bench-stages.json keeps the times of each commit in the order of their first runs; a run
//! again on the same commit replaces them. User time of all threads: little moved by what else the machine does.
#![expect(clippy::disallowed_methods, reason = "a benchmark asks the system for its time")]
#![expect(clippy::print_stdout, reason = "a benchmark prints")]

use serde::{Deserialize, Serialize};
use stages::StageError;
use stages::assemble::{AssembleOptions, assemble};
use stages::attachments::{AttachmentsOptions, attachments};
use stages::bones::{BonesOptions, bones};
use stages::cartilage::{CartilageOptions, cartilage};
use stages::frames::{FramesOptions, frames};
use stages::hexmesh::{HexmeshOptions, hexmesh};
use stages::ingest::ingest;
use stages::overclosure::{OverclosureOptions, overclosure};
use stages::register::{RegisterOptions, register};
use stages::specimen::{IngestOptions, RawSpecimen};
use std::path::Path;

const RUNS: usize = 3;

/// Times of the stages at one commit.
#[derive(Serialize, Deserialize)]
struct Times {
    commit: String,
    specimen: String,
    seconds: Vec<(String, f64)>,
}

/// User time of the process so far, all threads [s].
fn user_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Fields after the name in brackets; user time is the twelfth, in hundredths.
    let after = text.rsplit(')').next().unwrap_or_default();
    after.split_whitespace().nth(11).and_then(|t| t.parse::<f64>().ok()).map_or(f64::NAN, |t| t / 100.0)
}

fn timed<T>(
    into: &mut Vec<(String, f64)>,
    name: &str,
    work: impl Fn() -> Result<T, StageError>,
) -> Result<T, StageError> {
    let mut least = f64::INFINITY;
    let mut last = None;
    for _ in 0..RUNS {
        let start = user_seconds();
        last = Some(work()?);
        least = least.min(user_seconds() - start);
    }
    into.push((name.into(), least));
    last.ok_or_else(|| StageError::Knee("no run".into()))
}

fn run(raw: &RawSpecimen) -> Result<Vec<(String, f64)>, StageError> {
    let mut t = Vec::new();
    let s = timed(&mut t, "ingest", || ingest(raw, &IngestOptions::default()))?;
    let r = timed(&mut t, "register", || register(&s, &RegisterOptions::default()))?;
    let mut bare = s.clone();
    bare.landmarks.clear();
    timed(&mut t, "register, no landmarks", || register(&bare, &RegisterOptions::default()))?;
    let b = timed(&mut t, "bones", || bones(&s, &BonesOptions::default()))?;
    let c = timed(&mut t, "cartilage", || cartilage(&s, &r, &b, &CartilageOptions::default()))?;
    let f = timed(&mut t, "frames", || frames(&s, &b, &FramesOptions::default()))?;
    let a = timed(&mut t, "attachments", || attachments(&s, &r, &b, &c, &f, &AttachmentsOptions::default()))?;
    let h = timed(&mut t, "hexmesh", || hexmesh(&c, &HexmeshOptions::default()))?;
    let o = timed(&mut t, "overclosure", || overclosure(&h, &OverclosureOptions::default()))?;
    timed(&mut t, "assemble", || assemble((&s, &b, &c), &f, &a, &o, None, &AssembleOptions::default()))?;
    Ok(t)
}

fn specimen() -> Result<(String, RawSpecimen), String> {
    let given = std::env::args().skip(1).find(|a| !a.starts_with('-')).map(std::path::PathBuf::from);
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/specimens/S192803");
    if given.is_none() && !shared.exists() {
        let made = stages::phantom::phantom(stages::phantom::PHANTOMS[0], 1).map_err(|e| e.to_string())?;
        let mut raw = RawSpecimen { files: made.files.into_iter().collect(), ..RawSpecimen::default() };
        raw.toml = String::from_utf8_lossy(&raw.files.remove("specimen.toml").unwrap_or_default()).into_owned();
        return Ok((made.id, raw));
    }
    let path = given.unwrap_or(shared);
    let (_, raw) = genu::store::read_specimen(&path).map_err(|e| e.to_string())?;
    Ok((path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()), raw))
}

fn commit() -> String {
    let said = std::process::Command::new("git").args(["rev-parse", "--short", "HEAD"]).output();
    said.map_or_else(|_| "unknown".into(), |o| String::from_utf8_lossy(&o.stdout).trim().to_string())
}

fn main() -> Result<(), String> {
    let (specimen, raw) = specimen()?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/bench-stages.json");
    let mut kept: Vec<Times> =
        std::fs::read(&path).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
    let now = Times { commit: commit(), specimen, seconds: run(&raw).map_err(|e| e.to_string())? };
    let before = kept.iter().rev().find(|t| t.specimen == now.specimen && t.commit != now.commit);
    println!("{} at {}; ratio to {}", now.specimen, now.commit, before.map_or("nothing yet", |b| &b.commit));
    for (stage, seconds) in &now.seconds {
        let old = before.and_then(|b| b.seconds.iter().find(|s| s.0 == *stage)).map(|s| s.1);
        let ratio = old.filter(|s| *s > 0.0).map_or_else(String::new, |s| format!("{:8.2}", seconds / s));
        println!("{stage:24} {seconds:8.2} s {ratio}");
    }
    kept.retain(|t| t.specimen != now.specimen || t.commit != now.commit);
    kept.push(now);
    let bytes = serde_json::to_vec_pretty(&kept).map_err(|e| e.to_string())?;
    std::fs::write(&path, bytes).map_err(|e| format!("{}: {e}", path.display()))
}
