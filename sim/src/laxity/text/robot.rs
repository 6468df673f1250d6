//! Laxity from a file of channels (.tdms).
//!
//! Robots of Open Knee(s) write it with the names of simVITRO: the loads asked for rise in steps and are held, and the end of each hold is a reading. Of
//! other files every channel is a column, for `[laxity_format.NAME]` to name.

use super::tdms::{self, Channel};
use crate::coordinate::{AP, Coordinate, FE, FREE, Free, IE, Load, ML, SI, VV};
use crate::laxity::columns::{LaxityError, required_columns};
use crate::laxity::units::{standard_unit, unit};
use crate::laxity::usual_tests::test_of;
use crate::laxity::{Branch, Test};
use notices::{Kind, Notice};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::Range;

/// The groups of poses, in the order in which they are looked for; of loads; and of the loads asked for.
const POSES: [&str; 2] = ["State.Knee JCS", "State.JCS"];
const LOADS: &str = "State.JCS Load";
const ASKED: &str = "Kinetics.JCS.Desired";
/// What a channel's name says of its coordinate, and the sense in which it counts: poses and loads of the tibia.
const SENSES: [(&str, Coordinate, f64); 14] = [
    ("valgus", VV, 1.0),
    ("varus", VV, -1.0),
    ("external", IE, 1.0),
    ("internal", IE, -1.0),
    ("lateral", ML, 1.0),
    ("medial", ML, -1.0),
    ("anterior", AP, 1.0),
    ("posterior", AP, -1.0),
    ("superior", SI, 1.0),
    ("inferior", SI, -1.0),
    ("compression", SI, 1.0),
    ("distraction", SI, -1.0),
    ("flexion", FE, 1.0),
    ("extension", FE, -1.0),
];
/// A load asked for that changes by less from sample to sample is held [N, N m]. Ramps of 1 N or N m a second change by as much at 1000 Hz.
const STEADY: f64 = 1e-3;
/// Samples from which on a held load is a hold [-]: Open Knee(s) holds for seconds, at 100 Hz and more.
const LEAST_HELD: usize = 20;
/// The last share of a hold, whose mean is the reading [-]: the knee has crept to where it stays, and noise averages out. Ours.
const READ_SHARE: f64 = 0.25;
/// Steps of nominal flexion [deg]: tests are made at tens.
const NOMINAL_DEG: f64 = 10.0;
/// A load asked for below this is none [N, N m]: the least step of the published tests is 1 N m.
const NO_LOAD: f64 = 0.05;

/// The table of a file, cells between tabs; `declared` are the columns that a format names.
///
/// # Errors
/// No such file; neither a robot's names nor a declaration of the columns.
pub(super) fn table(bytes: &[u8], declared: &[String], warnings: &mut Vec<Notice>) -> Result<String, LaxityError> {
    let file = tdms::read(bytes).map_err(|what| LaxityError::File(format!("a TDMS file: {what}")))?;
    if file.is_cut {
        warnings.push(Kind::RowInPart.notice("the TDMS file ends within its data; what is whole is read"));
    }
    if !declared.is_empty() {
        return Ok(every_channel(&file.channels));
    }
    match Robot::of(&file.channels)? {
        Some(robot) => Ok(robot.table(warnings)),
        None => {
            let names: Vec<String> = file.channels.iter().map(called).collect();
            Err(LaxityError::File(format!(
                "a TDMS file without loads held for {LEAST_HELD} samples in the groups {ASKED}, {LOADS} and {}; name its channels in [laxity_format.NAME.columns]; it has {}",
                POSES[0],
                names.join(", ")
            )))
        }
    }
}

/// A channel as a column: group, name and unit.
fn called(channel: &Channel) -> String {
    let name = format!("{}/{}", channel.group, channel.name).replace(['\t', '\n', '\r', '"'], " ");
    channel.unit.as_ref().map_or(name.clone(), |unit| format!("{name} [{unit}]"))
}

/// All channels side by side; where one is shorter its cells are empty.
fn every_channel(channels: &[Channel]) -> String {
    let names: Vec<String> = channels.iter().map(called).collect();
    let mut out = names.join("\t");
    for row in 0..channels.iter().map(|c| c.values.len()).max().unwrap_or(0) {
        let cell = |c: &Channel| c.values.get(row).filter(|x| x.is_finite()).map_or(String::new(), f64::to_string);
        let cells: Vec<String> = channels.iter().map(cell).collect();
        let _ = write!(out, "\n{}", cells.join("\t"));
    }
    out
}

/// Samples of each coordinate, in the standard units and signs.
type Series = BTreeMap<Coordinate, Vec<f64>>;

/// What a robot wrote, sample by sample.
struct Robot {
    pose: Series,
    load: Series,
    asked: Series,
    holds: Vec<Range<usize>>,
    /// Where loads stand still for too short a time to be read.
    short: Vec<Range<usize>>,
}

/// A reading: the mean over the end of a hold.
struct Reading {
    asked: Load,
    load: Load,
    fe_deg: f64,
    pose: Free<f64>,
}

impl Robot {
    /// Of a file that has the groups and holds its loads.
    fn of(channels: &[Channel]) -> Result<Option<Robot>, LaxityError> {
        let [load, asked] = [LOADS, ASKED].map(|group| series(channels, group, Coordinate::load_column));
        let (load, asked) = (load?, asked?);
        let mut pose = Series::new();
        for group in POSES {
            if pose.is_empty() {
                pose = series(channels, group, Coordinate::column)?;
            }
        }
        let whole = |s: &Series| FREE.iter().all(|c| s.contains_key(c));
        if !whole(&pose) || !pose.contains_key(&FE) || !whole(&load) || asked.is_empty() {
            return Ok(None);
        }
        let samples = [&pose, &load, &asked].into_iter().flat_map(BTreeMap::values).map(Vec::len).min().unwrap_or(0);
        let still = still(&asked, samples);
        let short = short(&still);
        let holds: Vec<Range<usize>> = still.into_iter().filter(|hold| hold.len() >= LEAST_HELD).collect();
        Ok((!holds.is_empty()).then_some(Robot { pose, load, asked, holds, short }))
    }

    /// The mean over the end of a hold, without samples that miss a number; none where all do.
    fn reading(&self, hold: &Range<usize>) -> Option<Reading> {
        let read = ((hold.len() as f64 * READ_SHARE).ceil() as usize).clamp(1, hold.len());
        let at = |s: &Series, c: Coordinate, k: usize| s.get(&c).map_or(0.0, |values| values[k]);
        let is_whole = |k: &usize| self.pose.values().chain(self.load.values()).all(|values| values[*k].is_finite());
        let samples: Vec<usize> = (hold.end - read..hold.end).filter(is_whole).collect();
        let mean = |s: &Series, c: Coordinate| samples.iter().map(|k| at(s, c, *k)).sum::<f64>() / samples.len() as f64;
        (!samples.is_empty()).then(|| Reading {
            asked: Load::from_fn(|c| at(&self.asked, c, hold.end - 1)),
            load: Load::from_fn(|c| mean(&self.load, c)),
            fe_deg: mean(&self.pose, FE),
            pose: Free::from_fn(|c| mean(&self.pose, c)),
        })
    }

    /// A row a hold, in the standard columns, with displacements from the first unloaded hold of its flexion.
    fn table(&self, warnings: &mut Vec<Notice>) -> String {
        let readings: Vec<Reading> = self.holds.iter().filter_map(|hold| self.reading(hold)).collect();
        let mut columns = required_columns();
        columns.extend(["branch", "reference"].map(String::from));
        let mut out = columns.join("\t");
        let nominal = |r: &Reading| NOMINAL_DEG * (r.fe_deg / NOMINAL_DEG).round() + 0.0;
        let unloaded = |r: &Reading| readings.iter().position(|o| nominal(o) == nominal(r) && test(o) == Test::Neutral);
        let name = |k: usize| format!("hold{}_{}_{}", k + 1, test(&readings[k]).name(), nominal(&readings[k]));
        let (mut alone, mut again) = (0, 0);
        for (k, r) in readings.iter().enumerate() {
            let from = unloaded(r);
            alone += usize::from(from.is_none());
            if test(r) == Test::Neutral && from != Some(k) {
                again += 1;
                continue;
            }
            let zero = from.map_or(Free::all(0.0), |o| readings[o].pose);
            let reference = from.filter(|o| *o != k).map_or(String::new(), &name);
            let loads: Vec<String> = FREE.map(|c| format!("{:.6}", r.load[c])).into();
            let pose: Vec<String> = FREE.map(|c| format!("{:.6}", r.pose[c] - zero[c])).into();
            let cells = [name(k), test(r).name().to_owned(), nominal(r).to_string()];
            let end = [branch(&readings[..k], r).map_or("", branch_name).to_owned(), reference];
            let all = cells.into_iter().chain(loads).chain([format!("{:.6}", r.fe_deg)]).chain(pose).chain(end);
            let _ = write!(out, "\n{}", all.collect::<Vec<_>>().join("\t"));
        }
        warnings.extend(told(self, readings.len(), [alone, again]));
        out
    }
}

/// What is said of how the file was read.
fn told(robot: &Robot, readings: usize, [alone, again]: [usize; 2]) -> Vec<Notice> {
    let samples = robot.holds.last().map_or(0, |hold| hold.end);
    let averaged = format!(
        "{samples} samples of a TDMS file become {} readings: the mean over the last {:.0} % of each hold of the loads asked for; poses are displacements from the first unloaded hold of a flexion, since they count from a pose of the robot's own, as flexion does; {again} further unloaded holds are left out",
        readings - again,
        100.0 * READ_SHARE
    );
    let mut out = vec![Kind::Averaged.notice(averaged).count(samples)];
    let lacking = robot.holds.len() - readings;
    if lacking > 0 {
        let text = format!("{lacking} holds have no sample with all numbers, and are left out");
        out.push(Kind::RowLeftOut.notice(text).count(lacking));
    }
    if let Some(first) = robot.short.first() {
        let count = robot.short.len();
        let text = format!(
            "{count} holds of the loads asked for are shorter than {LEAST_HELD} samples, and are left out; the first begins at sample {}",
            first.start + 1
        );
        out.push(Kind::RowLeftOut.notice(text).count(count));
    }
    if alone > 0 {
        let text = format!(
            "{alone} holds are at a flexion without an unloaded hold; their poses count from a pose of the robot's own, not from the CT's frames"
        );
        out.push(Kind::RowInPart.notice(text).count(alone));
    }
    out
}

/// The test that the loads asked for make; compression alone is none.
fn test(r: &Reading) -> Test {
    let asked = Load::from_fn(|c| if r.asked[c].abs() < NO_LOAD { 0.0 } else { r.asked[c] });
    test_of(&asked)
}

/// Loading where the load asked for has grown since the hold before, unloading where it has fallen; none without a load.
fn branch(before: &[Reading], r: &Reading) -> Option<Branch> {
    let axis = test(r).coordinate()?;
    let last = before.last().map_or(0.0, |b| b.asked[axis]);
    // the other way round starts from no load
    let last = if last * r.asked[axis] < 0.0 { 0.0 } else { last.abs() };
    Some(if r.asked[axis].abs() >= last { Branch::Loading } else { Branch::Unloading })
}

fn branch_name(branch: Branch) -> &'static str {
    match branch {
        Branch::Loading => "loading",
        Branch::Unloading => "unloading",
    }
}

/// The channels of a group by their coordinates, in the unit of the standard column and its sign.
fn series(channels: &[Channel], group: &str, column: impl Fn(Coordinate) -> String) -> Result<Series, LaxityError> {
    let mut out = Series::new();
    for channel in channels.iter().filter(|c| c.group == group) {
        let name = channel.name.to_lowercase();
        let Some((_, coordinate, sense)) = SENSES.iter().find(|(word, ..)| name.contains(word)) else { continue };
        let wanted = column(*coordinate);
        let wanted = standard_unit(&wanted);
        let factor = match channel.unit.as_deref() {
            None => 1.0,
            Some(text) => match unit(text) {
                Some((quantity, factor)) if Some(quantity) == wanted => factor,
                _ => {
                    let (name, wanted) = (called(channel), wanted.unwrap_or("a number"));
                    return Err(LaxityError::File(format!(
                        "channel {name}: unit \"{text}\"; expected one for {wanted}"
                    )));
                }
            },
        };
        let values = channel.values.iter().map(|x| x * factor * sense).collect();
        out.entry(*coordinate).or_insert(values);
    }
    Ok(out)
}

/// Where all loads asked for stand still, each sample of a ramp by itself.
fn still(asked: &Series, samples: usize) -> Vec<Range<usize>> {
    let differ = |a: f64, b: f64| (a - b).abs() >= STEADY || a.is_nan() || b.is_nan();
    let moves = |k: usize| asked.values().any(|values| differ(values[k], values[k - 1]));
    let mut out = Vec::new();
    let mut start = 0;
    for k in 1..=samples {
        if k == samples || moves(k) {
            out.push(start..k);
            start = k;
        }
    }
    out
}

/// Of these those that are too short to be read, yet twice as long as what is beside them: a ramp in steps has stands alike.
fn short(still: &[Range<usize>]) -> Vec<Range<usize>> {
    let stands_out = |k: usize| {
        let mut beside = [k.checked_sub(1), Some(k + 1)].into_iter().flatten().filter_map(|n| still.get(n));
        beside.all(|other| 2 * other.len() <= still[k].len())
    };
    let is_short = |k: &usize| (2..LEAST_HELD).contains(&still[*k].len()) && stands_out(*k);
    (0..still.len()).filter(is_short).map(|k| still[k].clone()).collect()
}
