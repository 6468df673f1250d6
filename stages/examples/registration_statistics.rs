//! Mean errors of the registration over many draws of CT error, pose and coverage.
//!
//! `cargo run --release -p genu-stages --example registration_statistics -- DRAWS SPECIMEN...`, each specimen a directory with
//! its truth or the id of a phantom. A row for each bone and kind of error: mean error [mm, deg], share within 0.06 mm and
//! 0.09 deg, worst, root mean square of true over predicted error, share of those from a half to two.

#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "an example says what it found, and stops where it cannot"
)]

use rayon::prelude::*;
use registration::{Case, Noise, apart, case, exact_twin, noisy, part, random_pose, seeded};
use stages::register::{RegisterOptions, register_bone};

#[path = "../tests/common/registration.rs"]
mod registration;

const KINDS: [(&str, Noise); 4] = [
    ("white 0.05 mm", Noise::White(0.05)),
    ("Matern 5/2, 0.1 mm over 7 mm", Noise::Matern(2.5, 0.1, 7.0)),
    ("Matern 3/2, 0.1 mm over 8 mm", Noise::Matern(1.5, 0.1, 8.0)),
    ("Gaussian, 0.1 mm over 8 mm", Noise::Smooth(0.1, 8.0)),
];

struct Draw {
    error: f64,
    angle: f64,
    foreseen: f64,
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let draws = arguments.next().and_then(|n| n.parse::<u64>().ok()).unwrap_or(20);
    println!(
        "| bone | error | mm | deg | within | worst mm | true / foreseen, rms | from 1/2 to 2 |\n|---|---|---|---|---|---|---|---|"
    );
    for id in arguments {
        for bone in ["femur", "tibfib"] {
            let given = load(&id, bone);
            let name = format!("{} {bone}", id.rsplit('/').next().unwrap_or_default());
            let turned = |seed: u64, mut of: Case| {
                let pose = random_pose(&mut seeded(seed));
                of.scan.mesh = of.scan.mesh.moved(&pose);
                of.truth *= pose.inverse();
                of.pairs.iter_mut().for_each(|p| p.0 = pose * p.0);
                of
            };
            row(&name, "as supplied, without landmarks, any pose", draws, |seed| Case {
                pairs: Vec::new(),
                ..turned(seed, given.clone())
            });
            row(&name, "as supplied, 40 % missing", draws, |seed| {
                let mut of = turned(seed, given.clone());
                of.scan = part(&of.scan, &nalgebra::Vector3::x(), 0.4);
                of
            });
            for (kind, noise) in KINDS {
                row(&name, kind, draws, |seed| {
                    let mut rng = seeded(1000 + seed);
                    let mut of = exact_twin(&given, 0.058, &mut rng);
                    of.ct = noisy(&of.ct, noise, &mut rng);
                    turned(seed, of)
                });
            }
        }
    }
}

fn row(name: &str, kind: &str, draws: u64, make: impl Fn(u64) -> Case + Sync) {
    let found: Vec<Option<Draw>> = (0..draws)
        .into_par_iter()
        .map(|seed| {
            let of = make(seed);
            let result = register_bone(&of.ct, &of.scan, &of.pairs, &RegisterOptions::default()).ok()?;
            let (error, angle) = apart(result.ct_from_scan.motion(), &of.truth, &of.scan.mesh);
            Some(Draw { error, angle, foreseen: result.predicted_error_mm })
        })
        .collect();
    let taken: Vec<&Draw> = found.iter().flatten().collect();
    let n = taken.len() as f64;
    let mean = |f: &dyn Fn(&Draw) -> f64| taken.iter().map(|d| f(d)).sum::<f64>() / n;
    let ratio = |d: &Draw| d.error / d.foreseen;
    let worst = taken.iter().map(|d| d.error).fold(0.0, f64::max);
    println!(
        "| {name} | {kind}{} | {:.4} | {:.4} | {:.0} % | {worst:.3} | {:.2} | {:.0} % |",
        if taken.len() < found.len() { format!(" ({} refused)", found.len() - taken.len()) } else { String::new() },
        mean(&|d| d.error),
        mean(&|d| d.angle),
        100.0 * mean(&|d| f64::from(d.error <= 0.06 && d.angle <= 0.09)),
        mean(&|d| ratio(d).powi(2)).sqrt(),
        100.0 * mean(&|d| f64::from((0.5..2.0).contains(&ratio(d)))),
    );
}

#[expect(clippy::disallowed_methods, reason = "an example reads the data it is told of")]
fn load(id: &str, bone: &str) -> Case {
    if let Ok(made) = stages::phantom::phantom(id, 1) {
        return case(|path| made.files.iter().find(|f| f.0 == path).unwrap().1.clone(), bone);
    }
    case(|path| std::fs::read(std::path::Path::new(id).join(path)).unwrap(), bone)
}
