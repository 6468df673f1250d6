//! `next-tests`: which laxity tests would narrow a named quantity of a calibrated knee most, done together.

use crate::bands;
use crate::error::BuildError;
use crate::model_file::{self, LoadedModel};
use crate::numbers::{between, count};
use crate::simulate::SAMPLES;
use crate::store;
use crate::told::{ModelTold, Told};
use crate::which_model::WhichModel;
use attachments::groups::{GROUPS, ligament_called};
use calibration::error::CalibrationError;
use calibration::targets::TargetOptions;
use calibration::test_set::{Asking, Candidate, Chosen, LEAST_SAMPLES, TestSet, Wanted, test_set};
use clap::Args;
use notices::{Kind, Notice};
use schemars::JsonSchema;
use serde::Serialize;
use sim::coordinate::{Coordinate, FREE, Free, Load, SI};
use sim::laxity::{LaxityTrial, Test, trials_csv};
use sim::names::{did_you_mean, is_of};
use sim::protocols::COMPRESSION_N;
use std::fmt::Write;
use std::path::PathBuf;

/// Version of `next-tests --json`.
pub const SCHEMA: &str = "next-tests/1";

/// `build-model next-tests`.
#[derive(Args, Clone, Debug)]
pub struct NextTestsArgs {
    /// model.json, or the folder of a build or specimen: then its joint calibrated model, else that of its one data set
    pub model: PathBuf,
    /// Which model of a build
    #[command(flatten)]
    pub which: WhichModel,
    /// What is wanted: the force of a ligament or bundle in the drawers of 133 N, or drawer, or pivot-shift
    #[arg(long = "for", value_name = "QUANTITY")]
    pub wanted: String,
    /// Cut there a bundle or a ligament; the tests are done on the knee as it is; may be given more than once
    #[arg(long, value_name = "LIGAMENT", value_delimiter = ',')]
    pub without: Vec<String>,
    /// Most tests
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u8).range(1..=12))]
    pub count: u8,
    /// One load a test; without it two may act at once
    #[arg(long)]
    pub single: bool,
    /// Noise of a measured angle, one standard deviation [deg] [default: that of laxity files which state none]
    #[arg(long, value_name = "DEG")]
    pub noise_deg: Option<f64>,
    /// Noise of a measured shift, one standard deviation [mm] [default: that of laxity files which state none]
    #[arg(long, value_name = "MM")]
    pub noise_mm: Option<f64>,
    /// Compression of the joint in the tests [N]
    #[arg(long, value_name = "N", default_value_t = 20.0, value_parser = between(COMPRESSION_N))]
    pub compression: f64,
    /// Where the tests go as a table of trials, which `simulate --trials` reads
    #[arg(long, value_name = "TRIALS.csv")]
    pub out: Option<PathBuf>,
    /// Samples of the posterior
    #[arg(long, value_name = "N", default_value_t = SAMPLES, value_parser = count)]
    pub samples: usize,
    /// Threads; the result does not depend on it [default: all]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
}

/// `next-tests --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct NextTestsTold {
    /// next-tests/1
    pub schema: &'static str,
    /// The model.
    pub model: ModelTold,
    /// What is wanted.
    pub wanted: String,
    /// What is cut there.
    pub without: Vec<String>,
    /// The tests, the most telling first.
    pub tests: Vec<TestTold>,
    /// What is wanted, number by number.
    pub spread: Vec<SpreadTold>,
    /// Samples of the posterior that count.
    pub samples: usize,
    /// Tests thought of.
    pub thought_of: usize,
    /// The file of trials; null where none was asked.
    pub file: Option<String>,
    /// What is odd, in sentences.
    pub warnings: Vec<String>,
    /// The same as values.
    pub notices: Vec<Notice>,
}

/// A test.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TestTold {
    /// "anterior", or "anterior with internal".
    pub test: String,
    /// At which flexion [deg].
    pub flexion_deg: f64,
    /// Loads on the tibia: VV, IE [N m], ML, AP, SI [N].
    pub load: Vec<f64>,
    /// Coordinates that it reads, from the unloaded pose, with their units.
    pub reads: Vec<String>,
    /// Share of the standard deviation of what is wanted that is left with it and those before it [-].
    pub left: f64,
}

/// How well a wanted number is known.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SpreadTold {
    /// The number, with its unit.
    pub quantity: String,
    /// Standard deviation now.
    pub now: f64,
    /// Expected with the tests.
    pub then: f64,
}

/// Chooses tests and tells them.
pub fn next_tests(args: &NextTestsArgs) -> Result<Told, BuildError> {
    if let Some(jobs) = args.jobs {
        // A second call in one process keeps the first pool; results do not depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(jobs.into()).build_global();
    }
    let noise = noise(args)?;
    is_asked_for(args)?;
    let loaded = model_file::load_which(&args.model, &args.which)?;
    let (samples, mut notices) = bands::of(&loaded)?;
    let Some(samples) = samples else {
        let what =
            "it has no samples of a posterior; expected a calibrated knee (build-model calibrate, or a whole build)";
        return Err(BuildError::in_file(&loaded.file, what));
    };
    let fault = |e: CalibrationError| BuildError::in_file(&loaded.file, e);
    let searched = samples.searched(&loaded.meshes).map_err(fault)?;
    let asking = Asking {
        wanted: wanted(&args.wanted, &searched.bundle_names())?,
        without: &args.without,
        count: args.count.into(),
        combined: !args.single,
        noise,
        compression_n: args.compression,
        most: args.samples,
    };
    let mut found = test_set(&samples, &searched, &asking).map_err(fault)?;
    notices.extend(left_out(&found));
    if is_settled(&found) {
        found.tests.clear();
    }
    if let Some(out) = &args.out {
        store::write(out, trials_csv(&trials(&found)).as_bytes())?;
    }
    let data = NextTestsTold {
        schema: SCHEMA,
        model: ModelTold::of(&loaded),
        wanted: args.wanted.clone(),
        without: args.without.clone(),
        tests: found.tests.iter().map(told).collect(),
        spread: found.spread.iter().map(|s| SpreadTold { quantity: s.0.clone(), now: s.1, then: s.2 }).collect(),
        samples: found.samples,
        thought_of: found.thought_of,
        file: args.out.as_ref().map(|o| o.display().to_string()),
        warnings: notices::texts(&notices),
        notices: notices.clone(),
    };
    Ok(Told::words(words(&found, &loaded, args)).odd(notices).with(&data))
}

/// Refuses too few samples, and the force of what is cut.
fn is_asked_for(args: &NextTestsArgs) -> Result<(), BuildError> {
    if args.samples < LEAST_SAMPLES {
        return Err(BuildError::Usage(format!("--samples {}: at least {LEAST_SAMPLES} tell a spread", args.samples)));
    }
    let name = ligament_called(&args.wanted);
    match args.without.iter().find(|cut| is_of(name, ligament_called(cut))) {
        Some(cut) => Err(BuildError::Usage(format!(
            "--for {}: --without {cut} cuts it, so it bears nothing; ask for another force, for drawer or for pivot-shift",
            args.wanted
        ))),
        None => Ok(()),
    }
}

/// The noise of a reading, coordinate by coordinate.
fn noise(args: &NextTestsArgs) -> Result<Free<f64>, BuildError> {
    let mut noise = TargetOptions::default().noise;
    for (name, given, is_angle) in [("--noise-deg", args.noise_deg, true), ("--noise-mm", args.noise_mm, false)] {
        let Some(sd) = given else { continue };
        if !(sd > 0.0 && sd < 100.0) {
            return Err(BuildError::Usage(format!("{name} is {sd}; a number above 0 and below 100 was expected")));
        }
        FREE.into_iter().filter(|c| (c.unit() == "deg") == is_angle).for_each(|c| noise[c] = sd);
    }
    Ok(noise)
}

/// What a word asks for.
fn wanted(word: &str, bundles: &[String]) -> Result<Wanted, BuildError> {
    match word {
        "drawer" => return Ok(Wanted::Drawer),
        "pivot-shift" => return Ok(Wanted::PivotShift),
        _ => {}
    }
    let name = ligament_called(word);
    let members = GROUPS.iter().find(|(group, _)| *group == name).map_or(&[][..], |(_, members)| members);
    let of: Vec<usize> =
        (0..bundles.len()).filter(|b| bundles[*b] == name || members.contains(&bundles[*b].as_str())).collect();
    if of.is_empty() {
        let known: Vec<&str> = ["drawer", "pivot-shift"]
            .into_iter()
            .chain(GROUPS.iter().map(|g| g.0))
            .chain(bundles.iter().map(String::as_str))
            .collect();
        return Err(BuildError::Usage(format!(
            "--for {word}: no such quantity{}; expected drawer, pivot-shift, a ligament ({}) or a bundle",
            did_you_mean(word, known.iter().copied()),
            GROUPS.map(|g| g.0).join(", ")
        )));
    }
    Ok(Wanted::Force(of))
}

fn told(chosen: &Chosen) -> TestTold {
    let test = &chosen.test;
    TestTold {
        test: test.name(),
        flexion_deg: test.flexion_deg,
        load: test.load.iter().copied().collect(),
        reads: test.reads.iter().map(|c| c.column()).collect(),
        left: chosen.left,
    }
}

/// A standard deviation below this reads as none [N, mm, deg]: of a force, that of a ligament that is slack in all samples.
const NO_SPREAD: f64 = 5e-3;

/// Whether there is nothing to narrow.
fn is_settled(found: &TestSet) -> bool {
    found.spread.iter().all(|(_, now, _)| *now < NO_SPREAD)
}

/// "134 N AP, -5 N m IE".
fn loads(chosen: &Chosen) -> String {
    let of = |c: &Coordinate| format!("{} {} {}", chosen.test.load[*c], c.load_unit(), c.name().to_uppercase());
    chosen.test.reads.iter().map(of).collect::<Vec<_>>().join(", ")
}

/// What is said of samples that do not count.
fn left_out(found: &TestSet) -> Option<Notice> {
    let left = found.asked - found.samples;
    let text = format!(
        "{left} of {} samples do not count: in them the femur leaves the plateau where the quantity is wanted, or under the tests. What is told is of knees \
         that stay on it",
        found.asked
    );
    (left > 0).then(|| Kind::SamplesLost.notice(text).count(left))
}

/// Lines for a terminal.
fn words(found: &TestSet, loaded: &LoadedModel, args: &NextTestsArgs) -> String {
    let mut text = loaded.line();
    let cut = if args.without.is_empty() { String::new() } else { format!(" without {}", args.without.join(", ")) };
    if is_settled(found) {
        let _ = writeln!(text, "{}{cut} is the same in all samples, so no test narrows it", args.wanted);
    } else if found.tests.is_empty() {
        let _ = writeln!(text, "no test of {} would narrow {}{cut} by 2 % or more", found.thought_of, args.wanted);
    } else {
        let _ = writeln!(text, "tests that narrow {}{cut} most, of {} tests:", args.wanted, found.thought_of);
    }
    for (k, chosen) in found.tests.iter().enumerate() {
        let (name, flexion, left) = (chosen.test.name(), chosen.test.flexion_deg, 100.0 * chosen.left);
        let n = k + 1;
        let _ = writeln!(text, "{n}. {name} at {flexion} deg ({}): {left:.0} % of the spread is left", loads(chosen));
    }
    if (1..usize::from(args.count)).contains(&found.tests.len()) {
        text += "no further test would take 2 % of what is left\n";
    }
    for (quantity, now, then) in &found.spread {
        let _ = writeln!(text, "{quantity}: sd {now:.2} now, {then:.2} expected");
    }
    let _ = writeln!(text, "by {} samples, each predicted by the others", found.samples);
    if let Some(out) = &args.out {
        let _ = writeln!(text, "trials in {}", out.display());
    }
    text
}

/// The set as trials without readings: of each flexion the unloaded knee first.
fn trials(found: &TestSet) -> Vec<LaxityTrial> {
    let mut flexions: Vec<f64> = found.tests.iter().map(|c| c.test.flexion_deg).collect();
    flexions.sort_by(f64::total_cmp);
    flexions.dedup();
    let mut out = Vec::new();
    for fe in flexions {
        let of: Vec<&Chosen> = found.tests.iter().filter(|c| c.test.flexion_deg == fe).collect();
        let rest = Load::compression(of[0].test.load[SI]);
        out.push(LaxityTrial::asked(format!("unloaded_{fe}"), Test::Neutral, fe, rest));
        for chosen in of {
            let Candidate { tests, load, .. } = &chosen.test;
            let names: Vec<&str> = tests.iter().map(|t| t.name()).collect();
            out.push(LaxityTrial::asked(format!("{}_{fe}", names.join("_")), tests[0], fe, *load));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibration::test_set::candidates;

    #[test]
    fn a_word_asks_for_a_ligament_a_bundle_or_a_motion() {
        let bundles = ["ACL_AM", "ACL_PL", "sMCL_A", "LCL"].map(String::from);
        assert_eq!(wanted("ACL", &bundles).unwrap(), Wanted::Force(vec![0, 1]));
        assert_eq!(wanted("ACL_PL", &bundles).unwrap(), Wanted::Force(vec![1]));
        assert_eq!(wanted("MCL", &bundles).unwrap(), Wanted::Force(vec![2]));
        assert_eq!(wanted("pivot-shift", &bundles).unwrap(), Wanted::PivotShift);
        let told = wanted("pivot-shfit", &bundles).unwrap_err().to_string();
        assert!(told.contains("did you mean pivot-shift"), "{told}");
        assert!(wanted("PCL", &bundles).is_err(), "the model has none");
    }

    #[test]
    fn a_quantity_that_no_sample_varies_is_settled_and_one_that_some_do_is_not() {
        let with = |spread: &[f64]| {
            let spread = spread.iter().map(|now| ("force".to_owned(), *now, *now)).collect();
            is_settled(&TestSet { tests: vec![], spread, samples: 48, asked: 48, thought_of: 90 })
        };
        assert!(with(&[0.0, 1e-12]) && !with(&[0.0, 0.1]));
    }

    #[test]
    fn a_set_as_trials_is_read_back() {
        let tests = candidates(20.0, true).into_iter().step_by(17).map(|test| Chosen { test, left: 0.5 }).collect();
        let found = TestSet { tests, spread: vec![], samples: 48, asked: 48, thought_of: 90 };
        let read = sim::laxity::read(trials_csv(&trials(&found)).as_bytes()).unwrap().trials;
        for chosen in &found.tests {
            let same = |t: &&LaxityTrial| t.load == chosen.test.load && t.fe_deg == chosen.test.flexion_deg;
            assert_eq!(read.iter().filter(same).count(), 1, "{}", chosen.test.name());
        }
    }
}
