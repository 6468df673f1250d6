//! Suspects that are no effects of the catalogue: bones of another size than in the CT, cruciates that press on each other, trackers that sway with the load,
//! pulls along lines of no name.

use super::kinds::{Bone, Kind, LOADS, Part};
use crate::effect::{Situation, fibre_pull, pull, turned};
use crate::fit::Fit;
use crate::problem::Problem;
use nalgebra::Vector3;
use rayon::prelude::*;
use sim::contact::Nearby;
use sim::coordinate::{AP, FE, IE, ML, SI, Six, VV};
use sim::ligament::Fibre;

/// By how much bones are larger [-].
pub const SHARE: f64 = 0.02;
/// Turn of a swaying frame under a load that counts as one [deg].
pub const SWAY: f64 = 2.0;
/// A pull along a line of no name [N], and how far from the middle its line may pass [mm].
pub(super) const PULL: f64 = 60.0;
pub(super) const BESIDE: f64 = 25.0;
/// Stiffness of cruciates that press on each other [N/mm].
const CORD: f64 = 30.0;

/// The generalised forces of a suspect, a component each, in the trials of a fit where it acts.
pub(super) fn acting(
    problem: &Problem,
    fit: &Fit,
    kind: &Kind,
    forces: &(dyn Fn(&Situation) -> Vec<Six> + Sync),
) -> Vec<Part> {
    // a fit whose model cannot be made has been told of before its fields are asked for
    let Ok(models) = problem.models_at(&fit.unknowns) else { return vec![] };
    let at = |(trial, rest): (&inference::trial::Trial, &sim::equilibrium::Equilibrium)| -> Vec<Six> {
        let acts = if problem.acts(kind.scope, trial.source) { 1.0 } else { 0.0 };
        let forces = forces(&problem.place.situation(models.of(trial.source), trial, &trial.load(), &rest.q));
        // flexion is prescribed: no force moves it
        forces.iter().map(|f| Six::from_fn(|c, _| if c == FE.index() { 0.0 } else { acts * f[c] })).collect()
    };
    let each: Vec<Vec<Six>> = problem.trials.par_iter().zip(&fit.linear.rests).map(at).collect();
    let components = each.first().map_or(0, Vec::len);
    (0..components).map(|k| each.iter().map(|forces| forces[k]).collect()).collect()
}

/// What bones larger by [`SHARE`] would add to the generalised force [N mm, N]: ends of fibres and surfaces grow about the frames' origins; reference
/// strains stay those of the CT pose, where the bones stand as they do or, `apart`, farther apart by the same share.
pub fn larger(here: &Situation, apart: bool) -> Six {
    let h = 0.2 * SHARE;
    (force_of_larger(here, apart, h) - force_of_larger(here, apart, -h)) * (SHARE / (2.0 * h))
}

fn force_of_larger(here: &Situation, apart: bool, share: f64) -> Six {
    let grown = |p: &Vector3<f64>, about: &meshes::Point| about.coords + (p - about.coords) * (1.0 + share);
    let place = here.place;
    let fibres = here.model.fibres.iter().map(|f| {
        let (femur, tibia) = (grown(&f.femur, &place.femur.origin), grown(&f.tibia, &place.tibia.origin));
        let mut moved = f.with_ends(femur, tibia);
        let in_ct = if apart { f.initial_length * (1.0 + share) } else { moved.initial_length };
        // the slack length grows with the length in the CT
        let more = here.model.bundles[f.bundle].initial_stretch() * (in_ct / f.initial_length - 1.0);
        moved.initial_length = in_ct - more;
        fibre_pull(here, &moved)
    });
    let pull = fibres.fold(Six::zeros(), |sum, f| sum + f);
    // surfaces larger by a share touch as they are where the bones are nearer by it; springs of a stiffness give as much more, and levers are longer
    let joint = &here.model.joint;
    let mut gs = joint.grood_suntay(&here.q);
    [ML, AP, SI].into_iter().for_each(|c| gs[c] /= 1.0 + share);
    let Ok(q) = joint.coordinates(&gs) else { return pull };
    let mut contact = -here.model.contact_near(&joint.pose(&q), &mut Nearby::once()).gradient * (1.0 + share);
    [FE, VV, IE].into_iter().for_each(|j| contact[j] *= 1.0 + share);
    pull + contact
}

/// What a tracker misreads that sways with its bone by [`SWAY`] for a load that counts as one, whichever way that points: at the pose `gs`, about the bone's
/// anterior, superior and medial axis [rad, mm].
pub fn swayed(gs: &Six, load: &Six, bone: Bone) -> [Six; 3] {
    let size = [VV, IE, ML, AP].map(|c| (load[c] / LOADS[c.index()]).powi(2)).iter().sum::<f64>().sqrt();
    let (h, is_femur) = (1e-4, bone == Bone::Femur);
    let by = |turn: &dyn Fn(f64) -> Six| (turn(h) - turn(-h)) / (2.0 * h) * (SWAY.to_radians() * size);
    let mut flexed = Six::zeros();
    flexed[FE] = 1.0;
    [by(&|x| turned(gs, x, 0.0, is_femur)), by(&|x| turned(gs, 0.0, x, is_femur)), by(&|x| gs + flexed * x)]
}

/// The generalised force [N mm, N] of a pull of [`PULL`] along a line of no name past the knee: from the tibia toward the far end of the thigh (`bone` femur),
/// or from the femur toward the far end of the shank; through the middle, and what [`BESIDE`] medially and anteriorly make of it.
pub fn pulls(here: &Situation, bone: Bone) -> [Six; 3] {
    let along = |medial: f64, anterior: f64| match bone {
        Bone::Femur => pull(here, [medial, anterior - 15.0, 350.0], [medial, anterior, -25.0]),
        Bone::Tibia => pull(here, [medial, anterior - 15.0, 10.0], [medial, anterior - 30.0, -370.0]),
    };
    let middle = along(0.0, 0.0) * PULL;
    let beside = |medial: f64, anterior: f64| (along(medial, anterior) - along(-medial, -anterior)) * (0.5 * PULL);
    [middle, beside(BESIDE, 0.0), beside(0.0, BESIDE)]
}

/// What cruciates would add to the generalised force [N mm, N] that press on each other where their lines are nearer than `from` [mm].
pub fn impinging(here: &Situation, from: f64) -> Six {
    let Some(now) = between(here) else { return Six::zeros() };
    let over = (from - now).max(0.0);
    if over == 0.0 {
        return Six::zeros();
    }
    Six::from_fn(|j, _| {
        let h = if j <= IE.index() { 1e-5 } else { 1e-3 };
        let side = |s: f64| {
            let mut q = here.q;
            q[j] += s * h;
            between(&here.place.situation(here.model, here.trial, &here.load, &q)).unwrap_or(now)
        };
        CORD * over * (side(1.0) - side(-1.0)) / (2.0 * h)
    })
}

/// Distance of the lines of the cruciates, positive as they lie in the CT pose [mm]; none where the model lacks one.
fn between(here: &Situation) -> Option<f64> {
    let lines = |moved: bool| {
        let ends = |structure: &str| {
            let of = |f: &&Fibre| here.model.bundles[f.bundle].name.starts_with(structure);
            let fibres: Vec<&Fibre> = here.model.fibres.iter().filter(of).collect();
            let mean = |point: &dyn Fn(&Fibre) -> Vector3<f64>| {
                fibres.iter().map(|f| point(f)).sum::<Vector3<f64>>() / fibres.len() as f64
            };
            let femur = mean(&|f| if moved { f.line(&here.pose).femur } else { f.femur });
            (!fibres.is_empty()).then(|| (femur, mean(&|f| f.tibia)))
        };
        let (acl, pcl) = (ends("ACL")?, ends("PCL")?);
        let across = (acl.1 - acl.0).cross(&(pcl.1 - pcl.0));
        Some((pcl.0 - acl.0).dot(&across) / across.norm().max(1e-9))
    };
    let given = lines(false)?;
    Some(lines(true)? * given.signum())
}
