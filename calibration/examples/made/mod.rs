//! Made knees: truths from the prior times the beliefs, for programs that calibrate them.
#![allow(dead_code, reason = "each example uses its part")]

use calibration::inferred::Posed;
use calibration::knee::Knee;
use calibration::options::CalibrateOptions;
use calibration::targets::{Targets, targets};
use inference::knee::{Answers, Belief, Trials};
use inference::posterior::Forward;
use inference::random::{normals, stream, uniform};
use inference::trial::Trial;
use nalgebra::DVector;
use rayon::prelude::*;
use sim::coordinate::Free;
use sim::laxity::LaxityTrial;
use sim::mesh::MeshValue;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

/// Chains of truths: independent, so that they run side by side [-].
const CHAINS: usize = 10;
/// Slices before a chain's first truth [-].
const BURN_IN: usize = 150;
/// Slices between truths [-].
const THIN: usize = 40;
/// Length of an undulation of a plateau [mm].
const WAVE_MM: f64 = 20.0;
/// Stream of random numbers of the first chain.
const STREAM: u64 = 5_000_000;

/// A knee; its plateaus lean and undulate.
pub(crate) fn knee(path: &str, (lean_deg, form_mm): (f64, f64), options: &CalibrateOptions) -> Knee {
    let path = Path::new(path);
    let spec: ModelSpec = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let mut meshes = BTreeMap::new();
    for name in spec.bodies.iter().map(|b| &b.bone).chain(spec.contact.meshes()) {
        let bytes = std::fs::read(path.parent().unwrap().join(name)).unwrap();
        let mut mesh = formats::read_surface(name, &bytes, &BTreeMap::new()).unwrap().mesh;
        if spec.contact.pairs.iter().any(|p| &p.tibia == name) {
            let centre = mesh.vertices.iter().map(|v| v.coords).sum::<meshes::Vector>() / mesh.vertices.len() as f64;
            let wave = |x: f64| (TAU * x / WAVE_MM).sin();
            for v in &mut mesh.vertices {
                v.z += lean_deg.to_radians().tan() * (v.x - centre.x) + form_mm * wave(v.x) * wave(v.y);
            }
        }
        meshes.insert(name.clone(), MeshValue::Surface(mesh));
    }
    Knee::new(spec, &meshes, &options.search).unwrap()
}

/// A data set as an inference has it.
pub(crate) fn targets_of(spec: &ModelSpec, trials: &[LaxityTrial], options: &CalibrateOptions) -> Targets {
    targets(trials, &spec.frames.gs_ct_pose, &options.cost, &options.targets).unwrap()
}

/// Laxity of a file.
pub(crate) fn laxity(file: &str) -> Vec<LaxityTrial> {
    sim::laxity::read(&std::fs::read(file).unwrap()).unwrap().trials
}

/// The trials that nobody measured, with what is believed of them.
pub(crate) fn imagined(posed: &Posed) -> (Vec<Trial>, Vec<Belief>) {
    let asked = posed.asked[posed.measured..].iter().filter(|t| t.from.is_none() && t.source.is_none());
    let asked = asked.map(|t| Trial { reads: Free::all(false), ..t.clone() }).collect();
    let moved = |b: &Belief| Belief { trial: b.trial - posed.measured, ..b.clone() };
    (asked, posed.beliefs.iter().map(moved).collect())
}

/// Where truths are drawn before beliefs are heard: numbers are normal, of these means and standard deviations.
pub(crate) struct Population {
    pub(crate) mean: DVector<f64>,
    pub(crate) sd: DVector<f64>,
}

/// Truths of one chain: numbers of a population times what is believed.
fn chain(trials: &Trials, (seed, chain): (u64, u64), count: usize, of: &Population) -> Vec<DVector<f64>> {
    let mut random = stream(seed, STREAM + chain);
    let n = trials.size();
    // slices go about the mean
    let believed = |from_mean: &DVector<f64>, near: Option<(&DVector<f64>, &Answers)>| {
        let z = &of.mean + from_mean;
        let near = near.map(|(other, answers)| (&of.mean + other, answers));
        let near = near.as_ref().map(|(other, answers)| (other, *answers));
        let point = trials.at(&z, near).or_else(|| trials.at(&z, None))?;
        let heard = point.belief.iter().zip(&point.one_side).map(|(r, one)| if *one { r.max(0.0) } else { *r });
        Some((-0.5 * heard.map(|r| r * r).sum::<f64>(), point.state))
    };
    let mut z = normals(&mut random, n).component_mul(&of.sd);
    let mut last = believed(&z, None);
    let mut out = Vec::new();
    for slice in 0..BURN_IN + count * THIN {
        let other = normals(&mut random, n).component_mul(&of.sd);
        let least = last.as_ref().map_or(f64::NEG_INFINITY, |l| l.0) + uniform(&mut random).ln();
        let mut angle = TAU * uniform(&mut random);
        let (mut low, mut high) = (angle - TAU, angle);
        loop {
            let tried = &z * angle.cos() + &other * angle.sin();
            let found = believed(&tried, last.as_ref().map(|l| (&z, &l.1)));
            if found.as_ref().is_some_and(|f| f.0 >= least) {
                (z, last) = (tried, found);
                break;
            }
            if high - low < 1e-9 {
                break;
            }
            if angle < 0.0 {
                low = angle
            } else {
                high = angle
            }
            angle = low + (high - low) * uniform(&mut random);
        }
        if slice >= BURN_IN && (slice + 1 - BURN_IN).is_multiple_of(THIN) {
            out.push(&of.mean + &z);
        }
    }
    out
}

/// Truths of a question, `count` of them; numbers `wide` times as wide as the prior's.
pub(crate) fn truths(posed: &Posed, (seed, count, wide): (u64, usize, f64)) -> Vec<DVector<f64>> {
    let n = posed.parameters.len();
    truths_of(posed, (seed, count), &Population { mean: DVector::zeros(n), sd: DVector::from_element(n, wide) })
}

/// Truths of a population, `count` of them or a few more.
pub(crate) fn truths_of(posed: &Posed, (seed, count): (u64, usize), of: &Population) -> Vec<DVector<f64>> {
    let (asked, beliefs) = imagined(posed);
    let of_beliefs = Trials { trials: &asked, beliefs: &beliefs, ..posed.trials(None) };
    let each = count.div_ceil(CHAINS);
    let each_of = |c| chain(&of_beliefs, (seed, c), each, of);
    (0..CHAINS as u64).into_par_iter().flat_map(each_of).collect()
}
