//! How often intervals of bundle forces hold the truth, and how far point values are off: calibrations of one model to many data sets whose ligaments are
//! known.
//!
//! `coverage MODEL.json CASE...`: each CASE is a folder of a bench (`case_0001`) with kla.csv and rks.csv; `case_0001.truth.json` beside it has `forces_n`.
//! `--beyond`: intervals of poses and forces in the pivot shift and in passive flexion, which no trial of the bench has; the truths hold them under `beyond`.
//! `--terms` with it: of what the width of the intervals of poses is made, by holding kinds of unknowns at their most probable values in turn.
//! Shares of intervals that hold are told with a 90 % interval, by drawing knees again.
//! `--displaced`: kla.csv is asked as an arthrometer would read it: drawer at 30 deg, rotation at 30 and 90 deg, one coordinate each, from the trial
//! without load; without stated noise. `--rig SEED`: with offset, compliance and noise of an apparatus drawn from the program's priors.
#![expect(clippy::disallowed_methods, reason = "reads and prints")]
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "an example")]

use calibration::inferred::DRAWER_N;
use calibration::knee::Knee;
use calibration::options::CalibrateOptions;
use calibration::posterior::{ends, mean};
use calibration::rig::RigOptions;
use calibration::samples::{Bands, Question, Samples};
use calibration::session::{Joint, Outcome, Session};
use calibration::unknowns::KnownFrames;
use inference::knee::Quantity;
use inference::random::{normal, stream};
use rand::RngExt;
use sim::coordinate::{AP, Coordinate, FREE, Free, IE, Load};
use sim::laxity::{LaxityTrial, Reference, Test, force_column};
use sim::mesh::MeshValue;
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, solve_trials};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

type Forces = BTreeMap<String, BTreeMap<String, f64>>;

/// Errors of group sums, intervals that hold and that count, squared errors over variances.
#[derive(Default)]
struct Tally {
    errors: Vec<f64>,
    held: usize,
    counted: usize,
    z: Vec<f64>,
    sds: Vec<f64>,
    bundle_errors: Vec<f64>,
    /// Intervals that hold and that count, by knee.
    by_knee: Vec<[usize; 2]>,
    /// Errors of group sums with nothing measured, by knee, beside those of `errors`.
    knees: Vec<[f64; 2]>,
    /// Shares of the variance that data and beliefs removed.
    shares: Vec<[f64; 2]>,
}

/// A knee and its surfaces.
fn knee(path: &Path, options: &CalibrateOptions) -> (Knee, BTreeMap<String, MeshValue>) {
    let spec: ModelSpec = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let folder = path.parent().unwrap();
    let mut meshes = BTreeMap::new();
    let bones = spec.bodies.iter().map(|b| &b.bone);
    for name in bones.chain(spec.contact.meshes()) {
        let bytes = std::fs::read(folder.join(name)).unwrap();
        let read = formats::read_surface(name, &bytes, &BTreeMap::new()).unwrap();
        meshes.insert(name.clone(), MeshValue::Surface(read.mesh));
    }
    (Knee::new(spec, &meshes, &options.search).unwrap(), meshes)
}

/// A truth of the bench beyond its trials.
#[derive(serde::Deserialize)]
struct Beyond {
    flexion_deg: f64,
    load: [f64; 5],
    pose: [f64; 5],
    forces_n: BTreeMap<String, f64>,
}

/// Bands of a calibrated knee in trials, about what the final mechanics tell of its most probable values; unknowns of which `held` is true stay at
/// their most probable values.
fn bands_of(
    out: &Outcome,
    (spec, meshes): (&ModelSpec, &BTreeMap<String, MeshValue>),
    trials: &[LaxityTrial],
    held: &dyn Fn(&Quantity) -> bool,
) -> Bands {
    let (schema, model) = (calibration::samples::SCHEMA.to_owned(), String::new());
    let mut samples = Samples { schema, model, counted_from: spec.clone(), of: out.found.unknowns.clone() };
    for u in samples.of.unknowns.iter_mut().filter(|u| held(&u.quantity)) {
        u.samples.fill(u.most_probable);
    }
    let model = sim::compile(&out.spec, meshes).unwrap();
    let (answers, bundles) = (solve_trials(&model, trials, &TrialOptions::default()), model.bundle_names());
    let told = answers.into_iter().zip(trials).map(|(a, t)| a.map_or(vec![], |a| a.result(t).columns(&bundles)));
    let values: Vec<Vec<(String, f64)>> = told.collect();
    let (most, values) = (usize::MAX, Some(&values[..]));
    samples
        .bands(meshes, &Question { trials, without: &[], source: None, most, dislocation_ap_mm: None, values })
        .unwrap()
}

/// The trials of the truths beyond the bench's.
fn trials_beyond(truth: &BTreeMap<String, Beyond>) -> Vec<LaxityTrial> {
    let asked = |(name, b): (&String, &Beyond)| {
        let [vv, ie, ml, ap, si] = b.load;
        LaxityTrial::asked(name.clone(), Test::Neutral, b.flexion_deg, Load::new(vv, ie, ml, ap, si))
    };
    truth.iter().map(asked).collect()
}

/// A kind of unknowns, and which belong to it.
type Kind = (&'static str, fn(&Quantity) -> bool);

/// Kinds of unknowns; of none, what the model lacks is left.
const KINDS: [Kind; 6] = [
    ("none", |_| false),
    ("frames", |q| matches!(q, Quantity::Frame(..))),
    ("sites", |q| matches!(q, Quantity::Site(..))),
    ("ligaments", |q| matches!(q, Quantity::ReferenceStrain(_) | Quantity::Stiffness(_))),
    ("cartilage and its lean", |q| matches!(q, Quantity::Cartilage | Quantity::ContactScale | Quantity::Lean(..))),
    ("all", |_| true),
];

/// Width of the intervals of poses by trial, with kinds of unknowns held in turn.
fn terms(out: &Outcome, of: (&ModelSpec, &BTreeMap<String, MeshValue>), truth: &BTreeMap<String, Beyond>) {
    let trials = trials_beyond(truth);
    for (name, held) in KINDS {
        let bands = bands_of(out, of, &trials, &held);
        for (trial, row) in truth.keys().zip(&bands.rows) {
            let width = |c: Coordinate| {
                let band = row.iter().find(|x| x.0 == c.column());
                format!("{} {:.2}", c.column(), band.map_or(f64::NAN, |(_, b)| b.upper - b.lower))
            };
            println!("    held {name}, {trial}: width {}", FREE.map(width).join(", "));
        }
    }
}

/// How many intervals of a knee hold, of how many: of poses, and of forces of bundles that carry anything.
fn beyond(
    out: &Outcome,
    (spec, meshes): (&ModelSpec, &BTreeMap<String, MeshValue>),
    truth: &BTreeMap<String, Beyond>,
    more: bool,
) -> [[usize; 2]; 2] {
    let trials = trials_beyond(truth);
    let bands = bands_of(out, (spec, meshes), &trials, &|_| false);
    let mut count = [[0; 2]; 2];
    for ((trial, b), row) in truth.iter().zip(&bands.rows) {
        let band = |name: &str| row.iter().find(|r| r.0 == name).map(|r| r.1);
        for (c, pose) in FREE.into_iter().zip(b.pose) {
            let Some(band) = band(&c.column()) else { continue };
            let inside = band.lower <= pose && pose <= band.upper;
            count[0][0] += usize::from(inside);
            count[0][1] += 1;
            if more && !inside {
                println!("    {trial} {}: {pose:.2}, told {:.2} to {:.2}", c.column(), band.lower, band.upper);
            }
        }
        for (name, force) in &b.forces_n {
            let Some(band) = band(&force_column(&ours(name))) else { continue };
            if force.max(band.upper) > 5.0 {
                let inside = band.lower - 1.0 <= *force && *force <= band.upper + 1.0;
                count[1][0] += usize::from(inside);
                count[1][1] += 1;
                if more && !inside {
                    println!("    {trial} {name}: {force:.0}, told {:.0} to {:.0}", band.lower, band.upper);
                }
            }
        }
    }
    count
}

/// How many intervals of the sums of ACL and PCL in the drawers hold, of how many that carry anything.
fn cruciates(
    out: &Outcome,
    (spec, meshes): (&ModelSpec, &BTreeMap<String, MeshValue>),
    truth: &Forces,
    more: bool,
) -> [usize; 2] {
    let asked = |name: &String| {
        let (test, flexion) = name.split_once('_').unwrap();
        let ap = if test == "anterior" { DRAWER_N } else { -DRAWER_N };
        let load = Load::new(0.0, 0.0, 0.0, ap, COMPRESSION_N);
        LaxityTrial::asked(name.clone(), Test::Neutral, flexion.parse().unwrap(), load)
    };
    let drawers: Vec<&String> =
        truth.keys().filter(|k| k.starts_with("anterior") || k.starts_with("posterior")).collect();
    let trials: Vec<LaxityTrial> = drawers.iter().map(|n| asked(n)).collect();
    let bands = bands_of(out, (spec, meshes), &trials, &|_| false);
    let mut count = [0; 2];
    for (name, row) in drawers.iter().zip(&bands.rows) {
        for group in ["ACL", "PCL"] {
            let sum: f64 = truth[*name].iter().filter(|b| ours(b.0).starts_with(group)).map(|b| b.1).sum();
            let Some(band) = row.iter().find(|r| r.0 == format!("group_{group}_n")).map(|r| r.1) else { continue };
            if sum.max(band.upper) > 5.0 {
                let inside = band.lower - 1.0 <= sum && sum <= band.upper + 1.0;
                count[0] += usize::from(inside);
                count[1] += 1;
                if more && !inside {
                    println!("    {name} {group}: {sum:.0}, told {:.0} to {:.0}", band.lower, band.upper);
                }
            }
        }
    }
    count
}

/// Axial load of the bench's drawers [N].
const COMPRESSION_N: f64 = 20.0;

fn laxity(path: &Path) -> Vec<LaxityTrial> {
    sim::laxity::read(&std::fs::read(path).unwrap()).unwrap().trials
}

/// What an arthrometer would read of these poses: drawer at 30 deg and rotation at 30 and 90 deg, from the trial of the same test without load.
fn displaced(poses: &[LaxityTrial], rig: Option<u64>) -> Vec<LaxityTrial> {
    let zero = |t: &LaxityTrial| {
        let same = |r: &&LaxityTrial| {
            r.test == t.test && r.nominal_flexion_deg == t.nominal_flexion_deg && r.load[IE] == 0.0 && r.load[AP] == 0.0
        };
        poses.iter().find(same).cloned()
    };
    let wanted = |t: &&LaxityTrial| {
        let (drawer, turn) = (t.test == Test::Anterior, matches!(t.test, Test::Internal | Test::External));
        (drawer && t.nominal_flexion_deg == 30.0) || (turn && [30.0, 90.0].contains(&t.nominal_flexion_deg))
    };
    let defaults = RigOptions::default();
    let (noise, mut random) = (CalibrateOptions::default().targets.noise_of_displacements, stream(rig.unwrap_or(0), 9));
    let yields = defaults.compliance.map(|sd| (sd * normal(&mut random)).abs());
    let mut offsets: BTreeMap<(Test, i64), f64> = BTreeMap::new();
    let mut out = Vec::new();
    for t in poses.iter().filter(wanted) {
        let (Some(zero), Some(c)) = (zero(t).filter(|z| z.trial != t.trial), t.test.coordinate()) else { continue };
        let (Some(here), Some(there)) = (t.measured[c], zero.measured[c]) else { continue };
        let mut one = t.clone();
        one.reference = Some(Reference { trial: zero.trial.clone(), load: zero.load, fe_deg: zero.fe_deg });
        (one.measured, one.sd) = (Free::all(None), Free::all(None));
        let mut value = here - there;
        if rig.is_some() {
            let condition = (t.test, t.nominal_flexion_deg.round() as i64);
            value += *offsets.entry(condition).or_insert_with(|| defaults.offset[c] * normal(&mut random));
            value += yields[c] * one.load_step(c) + noise[c] * normal(&mut random);
        }
        one.measured[c] = Some(value);
        out.push(one);
    }
    out
}

/// The bench's name of a bundle, in ours.
fn ours(name: &str) -> String {
    let known = [
        ("ACLam", "ACL_AM"),
        ("ACLpl", "ACL_PL"),
        ("MCLa", "sMCL_A"),
        ("MCLm", "sMCL_M"),
        ("MCLp", "sMCL_P"),
        ("PCAPl", "PCAP_L"),
        ("PCAPm", "PCAP_M"),
        ("PCLal", "PCL_AL"),
        ("PCLpm", "PCL_PM"),
    ];
    known.iter().find(|k| k.0 == name).map_or(name, |k| k.1).to_owned()
}

fn judge(found: &calibration::session::Outcome, truth: &Forces, tally: &mut Tally, more: bool) -> (f64, usize, usize) {
    let names: Vec<&str> = found.spec.bundles.iter().map(|b| b.name.as_str()).collect();
    let mut sums: BTreeMap<(String, String), [f64; 3]> = BTreeMap::new();
    let (mut held, mut counted) = (0, 0);
    for f in &found.found.forces {
        let name = names[f.bundle];
        let Some(t) = truth.get(&f.trial).and_then(|t| t.iter().find(|(n, _)| ours(n) == name)) else { continue };
        let Some([lower, upper]) = f.interval_n else { continue };
        let (t, v) = (*t.1, f.value_n.unwrap_or(0.0));
        let group = name.split('_').next().unwrap().to_owned();
        let sum = sums.entry((f.trial.clone(), group)).or_default();
        *sum = [sum[0] + t, sum[1] + v, sum[2] + f.unmeasured.map_or(0.0, |u| u[0])];
        tally.shares.push([f.determined, f.believed]);
        if t.max(upper) > 5.0 {
            counted += 1;
            let inside = lower - 1.0 <= t && t <= upper + 1.0;
            held += usize::from(inside);
            let sd = (upper - lower) / 3.29;
            tally.z.push((v - t) / sd.max(1.0));
            tally.sds.push(sd);
            tally.bundle_errors.push(v - t);
            if more && (!inside || (v - t).abs() > 60.0) {
                println!("    {} {name}: {t:.0}, told {v:.0} ({lower:.0} to {upper:.0})", f.trial);
            }
        }
    }
    let carries = |s: &&[f64; 3]| s[0].max(s[1]) > 5.0;
    let errors: Vec<f64> = sums.values().filter(carries).map(|s| s[1] - s[0]).collect();
    let unmeasured: Vec<f64> = sums.values().filter(carries).map(|s| s[2] - s[0]).collect();
    tally.knees.push([rms(&errors), rms(&unmeasured)]);
    tally.by_knee.push([held, counted]);
    let rms = rms(&errors);
    tally.errors.extend(errors);
    (tally.held, tally.counted) = (tally.held + held, tally.counted + counted);
    (rms, held, counted)
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64).sqrt()
}

/// What a calibration told, at length.
fn tell(name: &str, out: &calibration::session::Outcome) {
    println!("  {name}: rms {:?}", out.found.rms.map(|r| r.map(|r| (100.0 * r).round() / 100.0)));
    for n in &out.found.noise {
        println!(
            "    noise {} {}: {:.2} stated {:.2} ({:.2} to {:.2})",
            n.source, n.coordinate, n.inferred, n.stated, n.lower, n.upper
        );
    }
    for o in &out.found.others {
        println!(
            "    {}: {:.2} ({:.2} to {:.2}), prior {:.2} to {:.2}",
            o.name, o.value, o.lower, o.upper, o.prior[0], o.prior[1]
        );
    }
    for r in &out.found.rest {
        println!("    rest at {}: {:.0} N ({:.0?}), model {:.0}", r.fe_deg, r.value_n, r.interval_n, r.mode_n);
    }
    out.warnings.iter().for_each(|w| println!("    warning: {w}"));
    println!(
        "    modes {:?} samples {}",
        out.found.rivals.iter().map(|r| r.0.round()).collect::<Vec<_>>(),
        out.found.samples.len()
    );
}

fn main() {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let more = args.iter().any(|a| a == "--more");
    args.retain(|a| a != "--more");
    let rig = args.iter().position(|a| a == "--rig").map(|at| args.drain(at..at + 2).nth(1).unwrap().parse().unwrap());
    let as_displacements = rig.is_some() || args.iter().any(|a| a == "--displaced");
    args.retain(|a| a != "--displaced");
    let options = CalibrateOptions::default();
    let asks_beyond = args.iter().any(|a| a == "--beyond");
    args.retain(|a| a != "--beyond");
    let asks_terms = args.iter().any(|a| a == "--terms");
    args.retain(|a| a != "--terms");
    let (knee, meshes) = knee(Path::new(&args[0]), &options);
    let mut all_beyond: Vec<[[usize; 2]; 3]> = Vec::new();
    let mut all: BTreeMap<&str, Tally> = BTreeMap::new();
    for (number, case) in args[1..].iter().enumerate() {
        let truth: serde_json::Value = match std::fs::read(format!("{case}.truth.json")) {
            Ok(bytes) => serde_json::from_slice(&bytes).unwrap(),
            Err(_) => serde_json::Value::Null,
        };
        let truth_beyond: BTreeMap<String, Beyond> =
            serde_json::from_value(truth["beyond"].clone()).unwrap_or_default();
        let truth: Forces = serde_json::from_value(truth["forces_n"].clone()).unwrap_or_default();
        let sources: Vec<(String, Vec<LaxityTrial>)> =
            ["kla", "rks"].map(|s| (s.to_owned(), laxity(&Path::new(case).join(format!("{s}.csv"))))).to_vec();
        let mut line = format!("{case}:");
        let mut run = |name: &'static str, sources: &[(String, Vec<LaxityTrial>)], joint| {
            let mut session = Session::new(&knee.spec, "", sources, &options).unwrap();
            if let Some(joint) = joint {
                session = session.after(joint);
            }
            let begun = std::time::Instant::now();
            let out = session.run(&knee, session.begin(None).unwrap(), &mut |_| ControlFlow::Continue(())).unwrap();
            let seconds = begun.elapsed().as_secs_f64();
            if more {
                tell(name, &out);
            }
            let (rms, held, counted) = judge(&out, &truth, all.entry(name).or_default(), more);
            line += &format!(" {name} {rms:.0} N {held}/{counted} {seconds:.1} s");
            out
        };
        if as_displacements {
            let trials = displaced(&sources[0].1, rig.map(|seed: u64| seed + number as u64));
            run("displaced", &[("rig".to_owned(), trials)], None);
            println!("{line}");
            continue;
        }
        let joint = run("joint", &sources, None);
        if asks_beyond {
            let [poses, forces] = beyond(&joint, (&knee.spec, &meshes), &truth_beyond, more);
            let sums = cruciates(&joint, (&knee.spec, &meshes), &truth, more);
            println!(
                "{line} beyond: poses {}/{}, forces {}/{}; cruciate sums in drawers {}/{}",
                poses[0], poses[1], forces[0], forces[1], sums[0], sums[1]
            );
            all_beyond.push([poses, forces, sums]);
            if asks_terms {
                terms(&joint, (&knee.spec, &meshes), &truth_beyond);
            }
            continue;
        }
        for (s, source) in sources.iter().enumerate() {
            let name = if s == 0 { "kla" } else { "rks" };
            let of = |frames: &KnownFrames| Joint { frames: frames.clone(), values: joint.found.mode.clone() };
            run(name, std::slice::from_ref(source), joint.frames.get(s).map(of));
        }
        println!("{line}");
    }
    summed_up(&all_beyond, &all);
}

/// Times that knees are drawn again for an interval [-].
const DRAWS: usize = 2000;

/// A share of intervals that hold with its 90 % interval, by drawing knees again, and the least and the mean of the knees.
fn by_knee(knees: &[[usize; 2]]) -> String {
    let share = |of: &mut dyn Iterator<Item = [usize; 2]>| {
        let [held, counted] = of.fold([0, 0], |sum, k| [sum[0] + k[0], sum[1] + k[1]]);
        100.0 * held as f64 / counted.max(1) as f64
    };
    let mut random = stream(1, 1);
    let mut again = || share(&mut (0..knees.len()).map(|_| knees[random.random_range(0..knees.len())]));
    let drawn: Vec<f64> = (0..DRAWS).map(|_| again()).collect();
    let (lower, upper) = ends(&drawn, 0.9).unwrap_or_default();
    let each: Vec<f64> = knees.iter().filter(|k| k[1] > 0).map(|k| share(&mut std::iter::once(*k))).collect();
    let least = each.iter().copied().fold(f64::INFINITY, f64::min);
    let (all, middle) = (share(&mut knees.iter().copied()), mean(&each));
    format!("{all:.0} % ({lower:.0} to {upper:.0} by knee); lowest knee {least:.0}, mean of knees {middle:.0}")
}

/// The last lines: shares of intervals that hold, errors, and what was known with nothing measured.
fn summed_up(beyond: &[[[usize; 2]; 3]], all: &BTreeMap<&str, Tally>) {
    for (k, what) in ["poses", "forces", "cruciate sums in drawers"].into_iter().enumerate() {
        let own: Vec<[usize; 2]> = beyond.iter().map(|b| b[k]).filter(|n| n[1] > 0).collect();
        if !own.is_empty() {
            println!("beyond: {what}: {}", by_knee(&own));
        }
    }
    for (name, t) in all {
        println!(
            "{name}: rms {:.1} N, {} of {} intervals hold ({}), error over sd {:.2}, rms error over rms sd {:.2}",
            rms(&t.errors),
            t.held,
            t.counted,
            by_knee(&t.by_knee),
            rms(&t.z),
            rms(&t.bundle_errors) / rms(&t.sds)
        );
        let column = |k: usize| t.knees.iter().map(|e| e[k]).collect::<Vec<f64>>();
        let [data, beliefs] = [0, 1].map(|k| t.shares.iter().map(|s| s[k]).sum::<f64>() / t.shares.len().max(1) as f64);
        println!(
            "{name}: knee by knee {:.1} N, {:.1} N with nothing measured; of the variance data removed {data:.2} and beliefs {beliefs:.2}",
            rms(&column(0)),
            rms(&column(1)),
        );
    }
}
