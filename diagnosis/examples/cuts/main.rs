//! Cuts: does a diagnosis find the ligament that was cut, and how far does its search stay behind the truth?
//!
//! `cuts MODEL.json KLA.csv RKS.csv LIGAMENT[=LOSS]|none|read SEED...`: with `read` the trials are taken as they were read. Else the model answers the trials
//! of both plans with the ligament cut (or a share of it lost), noise is added, and the model as it was is diagnosed. A row a seed: verdict, the first answer,
//! what else is in the set, the loss found. Then, in nats: what these trials tell of the cut without noise (little: `none` is right), what a fit earns that
//! starts at the truth, what the best earns, and the regret. With the variable `CUTS_BEFORE` set the diagnosis also has what the whole knee answered to the
//! same plan, on another day. With `CUTS_TEXT` set the words of the diagnosis follow.
//!
//! `cuts bench RESULTS.tsv COUNT MODEL.json KLA.csv RKS.csv [MODEL.json KLA.csv RKS.csv]...`: so many cuts of each of ACL, PCL, sMCL and LCL of each knee,
//! without and with what the whole knee read before. A table of shares with their intervals is printed at the end. `RESULTS.tsv` has a line a set; the same
//! command goes on after it.
#![expect(clippy::disallowed_methods, reason = "reads and prints")]
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "an example")]

mod bench;
mod knee;
mod row;

use diagnosis::search::regret::Hidden;
use knee::Specimen;
use std::path::Path;
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    match args[..] {
        ["bench", results, count, ref knees @ ..] if !knees.is_empty() && knees.len().is_multiple_of(3) => {
            let knees: Vec<[&str; 3]> = knees.chunks_exact(3).map(|k| [k[0], k[1], k[2]]).collect();
            bench::run(Path::new(results), count.parse().unwrap(), &knees);
        }
        [model, kla, rks, cut, ref seeds @ ..] if model != "bench" => {
            let seeds: Vec<u64> = seeds.iter().map(|s| s.parse().unwrap()).collect();
            rows(&Specimen::read(model, [kla, rks]), cut, &seeds);
        }
        _ => println!(
            "cuts MODEL KLA RKS LIGAMENT[=LOSS]|none|read SEED...\ncuts bench RESULTS COUNT MODEL KLA RKS [MODEL KLA RKS]..."
        ),
    }
}

/// A row of each seed.
fn rows(specimen: &Specimen, cut: &str, seeds: &[u64]) {
    let (ligament, loss) = cut.split_once('=').map_or((cut, 1.0), |(l, s)| (l, s.parse().unwrap()));
    let loss = if ["none", "read"].contains(&ligament) { 0.0 } else { loss };
    let has_before = std::env::var_os("CUTS_BEFORE").is_some();
    println!("{}", row::HEAD);
    for &seed in seeds {
        let begun = Instant::now();
        let sources = if ligament == "read" { specimen.as_read() } else { specimen.cut((ligament, loss), seed) };
        let before = if has_before { specimen.before(seed) } else { vec![] };
        let truth = if loss > 0.0 { vec![Hidden::of_all("structure_loss", ligament, ("loss", loss))] } else { vec![] };
        let said = specimen.diagnosed(sources, before, &truth);
        let d = &said.diagnosis;
        println!("{}", row::row((ligament, loss, seed), said.trials, d, said.regret, begun.elapsed().as_secs_f64()));
        if std::env::var_os("CUTS_TEXT").is_some() {
            println!("{}\n{}\n{:?}\n{}", d.plain, d.description, d.may_be_torn, serde_json::to_string(d).unwrap());
        }
    }
}
