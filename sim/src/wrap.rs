//! Ligaments that wrap over bone: fibres whose path is the shortest that stays out of femur and tibia.

mod band;
mod chain;
mod obstacle;

use crate::contact::field::bone_frame;
use crate::coordinate::Six;
use crate::error::SimError;
use crate::joint::{Pose, Screw};
use crate::mesh::MeshValue;
use crate::spec::ModelSpec;
use band::{Seen, Taut, Way};
use meshes::{Isometry, Point, Vector};
use nalgebra::Matrix6;
use obstacle::Obstacle;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Depth in bone that is allowed anywhere [mm]: about how far a site lies off the sampled surface.
const ALLOWED: f64 = 0.1;
/// Way from a site that lies deeper over which its fibre comes up to the surface [mm]; ours.
const RISE: f64 = 10.0;
/// Length of a piece of a path [mm]: over a condyle of 20 mm it cuts in by 0.2 mm.
const PIECE: f64 = 6.0;
/// Fewest and most pieces of a path.
const PIECES: [usize; 2] = [6, 18];
/// Beyond the highest and lowest site nothing is in a fibre's way [mm]; sites of a posterior move by less.
const BEYOND: f64 = 15.0;

/// Which end of a fibre.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum End {
    /// On the femur.
    Femur,
    /// On the tibia.
    Tibia,
}

/// Length of a fibre and how it changes.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// Length [mm].
    pub length: f64,
    /// Unit vector along which the femoral end goes away: from the tibial end, or from where the fibre leaves bone.
    pub direction: Vector,
    /// Femoral end [mm].
    pub femur: Vector,
    /// Derivative of the length by each coordinate.
    pub gradient: Six,
}

/// The bones that fibres wrap over.
#[derive(Debug, PartialEq)]
pub(crate) struct Bones {
    tibia: Option<Obstacle>,
    femur: Option<Obstacle>,
}

/// How a fibre wraps.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Wrap {
    bones: Arc<Bones>,
    /// How deep each inner node may lie in tibia and femur [mm].
    allowed: Vec<[f64; 2]>,
    /// Derivative of the length in the CT pose by the place of the tibial and of the femoral end.
    initial: [Vector; 2],
}

/// Where a fibre lay at the last pose: where its path is sought from.
#[derive(Clone, Debug, Default)]
pub(crate) struct Laid {
    ends: [Vector; 2],
    nodes: Vec<Vector>,
}

/// A path that touches bone.
pub(crate) struct Path(Taut);

/// The bones that a specification names as obstacles; none where its ligaments are straight.
///
/// # Errors
/// A body or a bundle that is not there, a bone whose mesh is not given.
pub(crate) fn bones(spec: &ModelSpec, meshes: &BTreeMap<String, MeshValue>) -> Result<Option<Arc<Bones>>, SimError> {
    let Some(wrap) = &spec.wrap else { return Ok(None) };
    if let Some(name) = wrap.bundles.iter().find(|name| spec.bundles.iter().all(|b| b.name != **name)) {
        return Err(SimError::Spec(format!("wrap.bundles: no bundle is named {name:?}")));
    }
    if let Some(name) = wrap.over.iter().find(|name| !["femur", "tibia"].contains(&name.as_str())) {
        return Err(SimError::Spec(format!("wrap.over names {name:?}, expected \"femur\", \"tibia\"")));
    }
    let along = spec.frames.tabulated();
    let bone = |name: &str| -> Result<Option<Obstacle>, SimError> {
        let of = |b: &&crate::spec::BodySpec| b.name == name && wrap.over.iter().any(|o| o == name);
        let Some(body) = spec.bodies.iter().find(of) else { return Ok(None) };
        let Some(MeshValue::Surface(mesh)) = meshes.get(&body.bone) else {
            let told = format!("ligaments wrap over {}, which is not among the model's meshes", body.bone);
            return Err(SimError::Spec(told));
        };
        let frame = bone_frame(if name == "femur" { &along.femur } else { &along.tibia });
        let wrapped = spec.fibres.iter().filter(|f| wrap.bundles.contains(&f.bundle));
        let mut heights = [f64::INFINITY, f64::NEG_INFINITY];
        for z in wrapped.flat_map(|f| [f.femur, f.tibia]).map(|p| (frame * p).z) {
            heights = [heights[0].min(z - BEYOND), heights[1].max(z + BEYOND)];
        }
        (heights[0] < heights[1]).then(|| Obstacle::new(mesh, frame, heights, &body.bone)).transpose()
    };
    Ok(Some(Arc::new(Bones { tibia: bone("tibia")?, femur: bone("femur")? })))
}

impl Bones {
    /// How a fibre with these ends wraps, and its length in the CT pose.
    pub(crate) fn wrap(self: &Arc<Bones>, femur: &Vector, tibia: &Vector) -> (Wrap, f64) {
        let length = (femur - tibia).norm();
        let pieces = ((length / PIECE).round() as usize).clamp(PIECES[0], PIECES[1]);
        let depth = |bone: &Option<Obstacle>, site: &Vector| {
            let out = bone.as_ref().map_or(0.0, |o| o.distance(&(o.local_from_ct * Point::from(*site)).coords));
            (-out - ALLOWED).max(0.0)
        };
        let deep = [depth(&self.tibia, tibia), depth(&self.femur, femur)];
        let allowed = (1..pieces).map(|i| {
            let way = length * i as f64 / pieces as f64;
            let near = [way, length - way].map(|w| (1.0 - w / RISE).max(0.0));
            [ALLOWED + deep[0] * near[0], ALLOWED + deep[1] * near[1]]
        });
        let straight = (femur - tibia) / length.max(1e-9);
        let mut wrap = Wrap { bones: self.clone(), allowed: allowed.collect(), initial: [-straight, straight] };
        let in_ct = Pose { femur: Isometry::identity(), screws: [Screw::default(); 6] };
        match wrap.path([*tibia, *femur], &in_ct, &mut Laid::default(), 0.0) {
            Some(Path(taut)) => {
                wrap.initial = [taut.pull(0), taut.pull(1)];
                (wrap, taut.length())
            }
            None => (wrap, length),
        }
    }
}

impl Wrap {
    /// The fibre's bones.
    pub(crate) fn bones(&self) -> &Arc<Bones> {
        &self.bones
    }

    /// Change of the length in the CT pose as an end moves [mm per mm].
    pub(crate) fn initial(&self, end: End) -> &Vector {
        &self.initial[usize::from(end == End::Femur)]
    }

    /// The path between a tibial and a femoral end, where it touches bone; of a fibre that is surely shorter than `slack` [mm] an upper bound.
    pub(crate) fn path(&self, ends: [Vector; 2], pose: &Pose, laid: &mut Laid, slack: f64) -> Option<Path> {
        let femur = self.bones.femur.iter().map(|o| Seen::new(o, Some(pose)));
        let seen: Vec<Seen> = self.bones.tibia.iter().map(|o| Seen::new(o, None)).chain(femur).collect();
        let way = Way { bones: &seen, ends, allowed: &self.allowed };
        let straight = way.straight();
        if way.is_free(&straight) {
            laid.nodes.clear();
            return None;
        }
        let start = if laid.nodes.len() == straight.len() { laid.carried(&ends) } else { straight };
        let taut = way.taut(start, slack);
        (laid.ends, laid.nodes) = (ends, taut.nodes.clone());
        taut.touches().then_some(Path(taut))
    }
}

impl Laid {
    /// The nodes, each carried along by what the ends moved.
    fn carried(&self, ends: &[Vector; 2]) -> Vec<Vector> {
        let by = [ends[0] - self.ends[0], ends[1] - self.ends[1]];
        let n = self.nodes.len() as f64 + 1.0;
        let share = |i: usize| (i as f64 + 1.0) / n;
        self.nodes.iter().enumerate().map(|(i, x)| x + by[0] * (1.0 - share(i)) + by[1] * share(i)).collect()
    }
}

impl Path {
    /// Length, pull on the femoral end and derivative.
    pub(crate) fn line(&self, pose: &Pose, femur: Vector) -> Line {
        let direction = self.0.pull(1).normalize();
        Line { length: self.0.length(), direction, femur, gradient: self.0.by_pose(pose) }
    }

    /// Second derivative of the length by the coordinates.
    pub(crate) fn curve(&self, pose: &Pose) -> Matrix6<f64> {
        self.0.by_pose_twice(pose)
    }

    /// Change of the length as an end moves along `by` [mm per mm].
    pub(crate) fn by_end(&self, end: End, by: &Vector) -> f64 {
        self.0.pull(usize::from(end == End::Femur)).dot(by)
    }

    /// Change of the length's derivative as an end moves along `by`.
    pub(crate) fn curve_by_end(&self, pose: &Pose, end: End, by: &Vector) -> Six {
        self.0.by_pose_and_end(pose, usize::from(end == End::Femur), by)
    }

    /// Its inner nodes, from the tibia on.
    pub(crate) fn nodes(&self) -> &[Vector] {
        &self.0.nodes
    }
}

#[cfg(test)]
mod tests;
