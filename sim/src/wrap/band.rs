//! The shortest path between two sites that stays out of the bones, as a rubber band: springs of no length in a row, whose nodes the bones hold off.
//!
//! With N springs and ends A and B the band is the least point of `U = 1/2 sum |x_(i+1) - x_i|^2 + c/2 sum d_i^2` over its inner nodes, where `d_i` is how deep
//! node i is in a bone. Its length is `sqrt(2 N U)`: that of the straight line where it touches nothing, and else of a chain of equal steps over the bone. A bone
//! pushes along its normal alone, so the tension is the same all along. As U is at its least, the length changes with the pose by what the pose moves
//! directly: the femoral end and the femur's surface at fixed nodes. So force and tangent are exact derivatives of one energy, wherever a node comes to lie.

use super::chain::Chain;
use super::obstacle::Obstacle;
use crate::coordinate::Six;
use crate::joint::{Pose, Screw, comes_first};
use meshes::Vector;
use nalgebra::{Matrix3, Matrix3x6, Matrix6};

/// How much stiffer than a spring a bone is [-]: a node that the band bends by 20 deg sinks in by a hundredth of a spring's length.
const STIFFER: f64 = 40.0;
/// Furthest that a node may move in a step [mm].
const LONGEST_STEP: f64 = 6.0;
/// A step below this ends the search [mm]; what is left is of its square.
const LAST_STEP: f64 = 3e-4;
/// Share of its distance from a bone that a point may surely move without touching it [-]: the spline falls a little more than the distance.
const NEARER: f64 = 0.9;
/// Most steps; a search that has not ended then stands where it is.
const MOST_STEPS: usize = 40;
/// A step that does not lower U is halved this often at most.
const MOST_HALVINGS: usize = 12;

/// A bone as a band sees it at a pose.
pub(super) struct Seen<'a> {
    obstacle: &'a Obstacle,
    /// World to grid.
    turn: Matrix3<f64>,
    shift: Vector,
    /// Whether it is the femur's, which moves.
    moves: bool,
}

impl<'a> Seen<'a> {
    /// The bone of a body that moves with `pose`, or stands still.
    pub(super) fn new(obstacle: &'a Obstacle, pose: Option<&Pose>) -> Seen<'a> {
        let to = &obstacle.local_from_ct;
        let m = pose.map_or(*to, |p| to * p.femur.inverse());
        let turn = *m.rotation.to_rotation_matrix().matrix();
        Seen { obstacle, turn, shift: m.translation.vector, moves: pose.is_some() }
    }

    fn local(&self, x: &Vector) -> Vector {
        self.turn * x + self.shift
    }
}

/// A node in a bone.
#[derive(Clone, Copy, Debug)]
struct Touch {
    node: usize,
    moves: bool,
    depth: f64,
    normal: Vector,
    /// Second derivatives of the distance [1/mm].
    curve: Matrix3<f64>,
}

impl Touch {
    /// How U curves by the node's place; without what the bone's own curvature adds where not `curved`.
    fn stiffness(&self, curved: bool) -> Matrix3<f64> {
        let bent = if curved { self.curve * self.depth } else { Matrix3::zeros() };
        (self.normal * self.normal.transpose() - bent) * STIFFER
    }

    /// What U changes by as the node goes along, turned round.
    fn push(&self) -> Vector {
        self.normal * (STIFFER * self.depth)
    }
}

/// A band's way.
pub(super) struct Way<'a> {
    pub(super) bones: &'a [Seen<'a>],
    /// Tibial and femoral end.
    pub(super) ends: [Vector; 2],
    /// How deep each inner node may lie in the tibia and in the femur [mm].
    pub(super) allowed: &'a [[f64; 2]],
}

/// A band at rest.
pub(super) struct Taut {
    ends: [Vector; 2],
    /// Its inner nodes.
    pub(super) nodes: Vec<Vector>,
    touches: Vec<Touch>,
    /// U at rest [mm2].
    u: f64,
}

impl Way<'_> {
    fn springs(&self) -> usize {
        self.allowed.len() + 1
    }

    /// Inner nodes of the straight line.
    pub(super) fn straight(&self) -> Vec<Vector> {
        let [a, b] = self.ends;
        let n = self.springs() as f64;
        (1..self.springs()).map(|i| a + (b - a) * (i as f64 / n)).collect()
    }

    /// Whether the straight line touches no bone at its nodes. Nodes nearer to one another than to the bone are not looked at.
    pub(super) fn is_free(&self, straight: &[Vector]) -> bool {
        let step = (self.ends[1] - self.ends[0]).norm() / self.springs() as f64;
        self.bones.iter().all(|bone| {
            let mut i = 0;
            while i < straight.len() {
                let height =
                    bone.obstacle.distance(&bone.local(&straight[i])) + self.allowed[i][usize::from(bone.moves)];
                if height < 0.0 {
                    return false;
                }
                // the distance falls by no more than the way, the spline by a little more; off the grid nothing is known of the next node
                let known = if height.is_finite() { NEARER * height / step } else { 0.0 };
                i += 1 + known as usize;
            }
            true
        })
    }

    fn look(&self, nodes: Vec<Vector>) -> Taut {
        let mut touches = Vec::new();
        let mut u = 0.0;
        for bone in self.bones {
            // nodes nearer to one another than to the bone are not looked at
            let (mut clear, mut from) = (0.0, nodes[0]);
            for (node, x) in nodes.iter().enumerate() {
                if (x - from).norm_squared() < clear {
                    continue;
                }
                let local = bone.local(x);
                let allowed = self.allowed[node][usize::from(bone.moves)];
                let height = bone.obstacle.distance(&local);
                if height + allowed >= 0.0 {
                    let known = if height.is_finite() { (NEARER * height).max(0.0) } else { 0.0 };
                    (clear, from) = (known * known, *x);
                    continue;
                }
                clear = 0.0;
                let Some(s) = bone.obstacle.sample(&local) else { continue };
                let back = bone.turn.transpose();
                let depth = -(s.distance + allowed);
                let (normal, curve) = (back * s.gradient, back * s.hessian * bone.turn);
                touches.push(Touch { node, moves: bone.moves, depth, normal, curve });
                u += 0.5 * STIFFER * depth * depth;
            }
        }
        let mut last = self.ends[0];
        for x in nodes.iter().chain(std::iter::once(&self.ends[1])) {
            u += 0.5 * (x - last).norm_squared();
            last = *x;
        }
        Taut { ends: self.ends, nodes, touches, u }
    }

    /// The band at rest that is found from `start`; one that is surely no longer than `slack` [mm] is left as it lies. Newton's method.
    pub(super) fn taut(&self, start: Vec<Vector>, slack: f64) -> Taut {
        let mut at = self.look(start);
        for _ in 0..MOST_STEPS {
            if at.length() < slack {
                return at;
            }
            let mut step = at.gradient();
            step.iter_mut().for_each(|x| *x = -*x);
            at.chain().solve(&mut step);
            let size = step.iter().map(Vector::norm).fold(0.0, f64::max);
            let mut share = (LONGEST_STEP / size).min(1.0);
            let moved = |share: f64| at.nodes.iter().zip(&step).map(|(x, by)| x + by * share).collect();
            let mut tried = self.look(moved(share));
            for _ in 0..MOST_HALVINGS {
                if tried.u <= at.u * (1.0 + 1e-13) {
                    break;
                }
                share *= 0.5;
                tried = self.look(moved(share));
            }
            at = tried;
            if size < LAST_STEP {
                break;
            }
        }
        at
    }
}

impl Taut {
    fn springs(&self) -> f64 {
        self.nodes.len() as f64 + 1.0
    }

    /// Length [mm].
    pub(super) fn length(&self) -> f64 {
        (2.0 * self.springs() * self.u).sqrt().max(1e-9)
    }

    /// Whether it touches a bone.
    pub(super) fn touches(&self) -> bool {
        !self.touches.is_empty()
    }

    /// The node before, or the end there.
    fn next_to(&self, end: usize) -> Vector {
        let node = if end == 0 { self.nodes.first() } else { self.nodes.last() };
        node.copied().unwrap_or(self.ends[1 - end])
    }

    /// Derivative of the length by the place of the tibial (0) or femoral (1) end: about the unit vector along its last piece.
    pub(super) fn pull(&self, end: usize) -> Vector {
        (self.ends[end] - self.next_to(end)) * (self.springs() / self.length())
    }

    /// Derivative of U by each node.
    fn gradient(&self) -> Vec<Vector> {
        let n = self.nodes.len();
        let at = |i: usize| match i {
            0 => self.ends[0],
            i if i > n => self.ends[1],
            i => self.nodes[i - 1],
        };
        let mut out: Vec<Vector> = (1..=n).map(|i| at(i) * 2.0 - at(i - 1) - at(i + 1)).collect();
        self.touches.iter().for_each(|t| out[t.node] -= t.push());
        out
    }

    /// The system of the nodes; the bones' own curvature is left out where it would let the band slip.
    fn chain(&self) -> Chain {
        let held = |curved: bool| {
            let mut blocks: Vec<Option<Matrix3<f64>>> = vec![None; self.nodes.len()];
            for t in &self.touches {
                *blocks[t.node].get_or_insert_with(Matrix3::zeros) += t.stiffness(curved);
            }
            Chain::new(self.nodes.len(), |i| blocks[i])
        };
        held(true).or_else(|| held(false)).expect("springs held by positive blocks have a least point")
    }

    /// Derivative of the length by each coordinate.
    pub(super) fn by_pose(&self, pose: &Pose) -> Six {
        let end = self.ends[1];
        let mut force = end - self.next_to(1);
        let mut moment = end.cross(&force);
        for t in self.touches.iter().filter(|t| t.moves) {
            force += t.push();
            moment += self.nodes[t.node].cross(&t.push());
        }
        let share = self.springs() / self.length();
        Six::from_fn(|j, _| {
            let Screw { angular, linear } = &pose.screws[j];
            (linear.dot(&force) + angular.dot(&moment)) * share
        })
    }

    /// Second derivative of the length by the coordinates.
    pub(super) fn by_pose_twice(&self, pose: &Pose) -> Matrix6<f64> {
        let (end, pulled) = (self.ends[1], self.ends[1] - self.next_to(1));
        let at_end: [Vector; 6] = std::array::from_fn(|j| pose.screws[j].at(&end));
        let mut u = pair(|first, last| {
            at_end[first].dot(&at_end[last]) + pulled.dot(&pose.screws[first].angular.cross(&at_end[last]))
        });
        for t in self.touches.iter().filter(|t| t.moves) {
            let v: [Vector; 6] = std::array::from_fn(|j| pose.screws[j].at(&self.nodes[t.node]));
            let (k, push) = (t.stiffness(true), t.push());
            u += pair(|first, last| {
                v[first].dot(&(k * v[last])) - push.dot(&pose.screws[last].angular.cross(&v[first]))
            });
        }
        let mixed = self.mixed_with_all(pose);
        let moved = self.chain().solved(&mixed);
        mixed.iter().zip(&moved).for_each(|(a, b)| u -= a.transpose() * b);
        let (gradient, share) = (self.by_pose(pose), self.springs() / self.length());
        u * share - gradient * gradient.transpose() / self.length()
    }

    /// Derivative of [`Taut::by_pose`] by a place of the tibial (0) or femoral (1) end, in the direction `by` of the world; the femoral end moves with the femur.
    pub(super) fn by_pose_and_end(&self, pose: &Pose, end: usize, by: &Vector) -> Six {
        let mut moved = vec![Vector::zeros(); self.nodes.len()];
        if let Some(next) = if end == 0 { moved.first_mut() } else { moved.last_mut() } {
            *next = *by;
        }
        self.chain().solve(&mut moved);
        let pulled = self.ends[1] - self.next_to(1);
        let (gradient, share) = (self.by_pose(pose), self.springs() / self.length());
        let along = self.pull(end).dot(by);
        Six::from_fn(|j, _| {
            let mut u: f64 = self.mixed(pose, j).iter().zip(&moved).map(|(a, b)| a.dot(b)).sum();
            if end == 1 {
                let v = pose.screws[j].at(&self.ends[1]);
                u += v.dot(by) + pulled.dot(&pose.screws[j].angular.cross(by));
            }
            u * share - gradient[j] * along / self.length()
        })
    }

    /// [`Taut::mixed`] of all coordinates, a column each.
    fn mixed_with_all(&self, pose: &Pose) -> Vec<Matrix3x6<f64>> {
        let mut out = vec![Matrix3x6::zeros(); self.nodes.len()];
        for (j, screw) in pose.screws.iter().enumerate() {
            if let Some(last) = out.last_mut() {
                last.set_column(j, &-screw.at(&self.ends[1]));
            }
        }
        for t in self.touches.iter().filter(|t| t.moves) {
            let (k, push) = (t.stiffness(true), t.push());
            for (j, screw) in pose.screws.iter().enumerate() {
                let own = k * screw.at(&self.nodes[t.node]) + screw.angular.cross(&push);
                let before = out[t.node].column(j) - own;
                out[t.node].set_column(j, &before);
            }
        }
        out
    }

    /// Second derivative of U by a coordinate and each node.
    fn mixed(&self, pose: &Pose, j: usize) -> Vec<Vector> {
        let screw = &pose.screws[j];
        let mut out = vec![Vector::zeros(); self.nodes.len()];
        if let Some(last) = out.last_mut() {
            *last -= screw.at(&self.ends[1]);
        }
        for t in self.touches.iter().filter(|t| t.moves) {
            let v = screw.at(&self.nodes[t.node]);
            out[t.node] -= t.stiffness(true) * v + screw.angular.cross(&t.push());
        }
        out
    }
}

/// A symmetric matrix from its entries by the coordinate that comes first along the chain, and the other.
fn pair(entry: impl Fn(usize, usize) -> f64) -> Matrix6<f64> {
    Matrix6::from_fn(|j, k| if comes_first(j, k) { entry(j, k) } else { entry(k, j) })
}
