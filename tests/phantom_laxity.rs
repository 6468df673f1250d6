//! The phantoms have the laxity of plausible intact knees, whatever ligaments the laboratory draws for them.

#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "tests")]

use crate::common::phantoms::made;
use blindbench::knee::KneeInput;
use blindbench::laboratory::{Planned, make};
use meshes::Point;
use stages::phantom::PHANTOMS;
use std::collections::BTreeMap;

/// Seeds of the laboratory's draws. The shape and the ligaments were chosen while seeds 1 to 12 were looked at; the ranges were there before.
const SEEDS: std::ops::RangeInclusive<u64> = 1..=3;

const FLEXIONS: [f64; 4] = [0.0, 30.0, 60.0, 90.0];

/// Compression of the joint in every trial, as in the paper's first data set [andreassen2025] [N].
const COMPRESSION_N: f64 = 20.0;

/// A test: component of the reading (VV, IE [deg], ML, AP, SI [mm]), load in both directions [N m or N], least and most that an intact knee
/// gives way in each direction.
///
/// AP: 134 N move intact knees by 2 to 10 mm each way, most at 30 deg [markolf1978; sakane1997; fox1998]. IE: 5 N m turn them by 8 to 30
/// deg, least in extension [grood1988]. VV: 10 N m open them by up to 8 deg, in extension hardly, so half a degree is the least here [markolf1978; grood1988].
const TESTS: [(&str, usize, f64, [f64; 2]); 3] =
    [("AP", 3, 134.0, [2.0, 10.0]), ("IE", 1, 5.0, [8.0, 30.0]), ("VV", 0, 10.0, [0.5, 8.0])];

fn plan() -> Vec<Planned> {
    let at = |flexion: f64, axis: usize, size: f64| {
        let mut load = [0.0, 0.0, 0.0, 0.0, COMPRESSION_N];
        load[axis] += size;
        let condition = format!("{flexion} {axis} {size}");
        // a tracker without noise: the knee is looked at, not its measurement
        Planned { source: "all".into(), condition, flexion_deg: flexion, load, sd: [1e-6; 5] }
    };
    let loaded = |flexion: f64| TESTS.map(|(_, axis, size, _)| [at(flexion, axis, size), at(flexion, axis, -size)]);
    FLEXIONS.iter().flat_map(|&f| [at(f, 3, 0.0)].into_iter().chain(loaded(f).into_iter().flatten())).collect()
}

fn readings(knee: &KneeInput, seed: u64) -> Vec<[f64; 5]> {
    make(knee, &plan(), "phantom", ("null", 1.0), seed).unwrap().readings
}

fn knee(id: &str) -> KneeInput {
    genu::phantom::knee(made(id)).unwrap()
}

/// Most that the tibia shifts sideways: unloaded, and under the loads above [mm]. The measured knee of the paper shifts by up to 6.7 mm; nobody
/// states a limit, so 10 mm stands, a quarter of a plateau.
const MOST_ML_MM: [f64; 2] = [5.0, 10.0];

/// Most that it is turned when nothing loads it: VV, IE [deg].
const MOST_TURN_DEG: [f64; 2] = [5.0, 15.0];

/// Figures of one drawn knee by kind, and what of them lies outside its range, in words.
fn outside(readings: &[[f64; 5]]) -> (Vec<String>, Vec<(String, f64)>) {
    let (mut told, mut figures) = (Vec::new(), Vec::new());
    let mut check = |what: String, flexion: f64, value: f64, [least, most]: [f64; 2]| {
        if !(least..=most).contains(&value) {
            told.push(format!("{what} at {flexion} deg: {value:.1}, expected {least} to {most}"));
        }
        figures.push((what, value));
    };
    for (&flexion, rows) in FLEXIONS.iter().zip(readings.chunks(1 + 2 * TESTS.len())) {
        let rest = rows[0];
        check("VV unloaded".into(), flexion, rest[0].abs(), [0.0, MOST_TURN_DEG[0]]);
        check("IE unloaded".into(), flexion, rest[1].abs(), [0.0, MOST_TURN_DEG[1]]);
        check("ML unloaded".into(), flexion, rest[2].abs(), [0.0, MOST_ML_MM[0]]);
        for (k, (name, component, size, range)) in TESTS.into_iter().enumerate() {
            for (row, sign) in [(rows[1 + 2 * k], 1.0), (rows[2 + 2 * k], -1.0)] {
                check(
                    format!("{name} under {}", sign * size),
                    flexion,
                    sign * (row[component] - rest[component]),
                    range,
                );
                check("ML loaded".into(), flexion, row[2].abs(), [0.0, MOST_ML_MM[1]]);
            }
        }
    }
    (told, figures)
}

#[test]
fn phantoms_are_as_lax_as_intact_knees() {
    // least and most over all, by kind: the table of docs/stages/phantom.md
    let mut over: BTreeMap<String, [f64; 2]> = BTreeMap::new();
    for id in PHANTOMS {
        let knee = knee(id);
        for seed in SEEDS {
            let (told, figures) = outside(&readings(&knee, seed));
            for (what, value) in figures {
                let range = over.entry(what).or_insert([f64::MAX, f64::MIN]);
                *range = [range[0].min(value), range[1].max(value)];
            }
            assert!(told.is_empty(), "{id}, seed {seed}:\n{}", told.join("\n"));
        }
    }
    eprintln!("{over:.1?}");
}

#[test]
fn a_knee_and_its_mirror_image_give_the_same_readings() {
    let left = knee(PHANTOMS[0]);
    let mut right = left.clone();
    let turned = |p: &mut Point| p.x = -p.x;
    for mesh in right.tibia.iter_mut().chain([&mut right.femur]) {
        mesh.vertices.iter_mut().for_each(turned);
        *mesh = std::mem::take(mesh).flipped();
    }
    right.bundles.iter_mut().flat_map(|b| &mut b.fibres).for_each(|(a, b)| [a, b].into_iter().for_each(turned));
    for frame in [&mut right.frames.0, &mut right.frames.1] {
        turned(&mut frame.origin);
        [&mut frame.medial, &mut frame.anterior, &mut frame.superior].into_iter().for_each(|v| v.x = -v.x);
    }
    // where two points of a surface are equally near, the mirror image may choose the other
    for (a, b) in readings(&left, 1).iter().flatten().zip(readings(&right, 1).iter().flatten()) {
        assert!((a - b).abs() < 0.02, "{a} {b}");
    }
}
