//! Where the knee comes to rest: least energy by a quasi-Newton descent [nocedal2006, algorithm 6.1], following the load.

use crate::asked::{Asked, Hidden};
use crate::further::following;
use crate::knee::Knee;
use crate::pose::{Five, components, pose, read};
use nalgebra::{Matrix5, Vector5};

/// Rotations count as millimetres at this lever [mm].
const LEVER: f64 = 30.0;

/// Unloaded rests along flexion, from which trials start: flexion [rad] and components.
pub(crate) struct Path(Vec<(f64, Five)>);

impl Path {
    /// Flexes the knee from the CT pose to `last` under a compression [N], a step a tenth of a radian.
    pub(crate) fn new(knee: &Knee, last: f64, compression: f64) -> Path {
        let squeeze = [0.0, 0.0, 0.0, 0.0, compression];
        let steps = ((last - knee.ct[0]).abs() / 0.1).ceil().max(1.0) as usize;
        let mut at = components(&knee.ct);
        let each = (0..=steps).map(|k| {
            let flexion = knee.ct[0] + (last - knee.ct[0]) * k as f64 / steps as f64;
            at = least(knee, &[], &Asked { flexion, load: squeeze }, at, &at, &mut soft());
            (flexion, at)
        });
        Path(each.collect())
    }

    fn start(&self, flexion: f64) -> Five {
        let near = self.0.iter().min_by(|a, b| (a.0 - flexion).abs().total_cmp(&(b.0 - flexion).abs()));
        near.map_or([0.0; 5], |n| n.1)
    }
}

/// Rest under a load with an effect, from the path by compression and load; as read.
pub(crate) fn rest(knee: &Knee, hidden: &[Hidden], asked: &Asked, path: &Path) -> [f64; 6] {
    let squeeze = [0.0, 0.0, 0.0, 0.0, asked.load[4]];
    let flexion = asked.flexion;
    let at = path.start(flexion);
    // what is learnt of the stiffness on the way serves the next step
    let mut inverse = soft();
    let neutral = least(knee, &[], &Asked { flexion, load: squeeze }, at, &at, &mut inverse);
    let mut at = neutral;
    for part in [0.34, 0.67, 1.0] {
        let load = std::array::from_fn(|j| squeeze[j] + (asked.load[j] - squeeze[j]) * part);
        at = least(knee, hidden, &Asked { flexion, load }, at, &neutral, &mut inverse);
    }
    read(&pose(flexion, &at))
}

/// ML, AP and SI further than this from the CT pose are out of the joint [mm]. Ours. AP: the depth of a plateau. ML: half the width of a compartment. SI: in
/// trials of the published knee it moves by 13 from extension to 90 deg; a knee that fell out of its joint moved by 34 there.
const OUT_MM: [f64; 3] = [15.0, 38.0, 20.0];

/// Whether a knee that rests at a reading has come out of its joint: it lies far off, or no cartilage of the tibia bears.
pub(crate) fn is_out_of_joint(knee: &Knee, lies: &[f64; 6]) -> bool {
    let at = components(lies);
    is_far(knee, &at) || !knee.bears(lies[0], &at)
}

/// Whether the tibia of a knee that is cut lies too far from the CT pose to be in its joint. One that is whole is followed wherever it goes.
fn is_far(knee: &Knee, at: &Five) -> bool {
    let ct = components(&knee.ct);
    knee.is_weakened() && (0..3).any(|k| (at[2 + k] - ct[2 + k]).abs() > OUT_MM[k])
}

/// Rounds in which a load that turns with the shank and the knee's rest under it are found in turn [-], and the rotation at which they agree [rad].
const ROUNDS: usize = 8;
const AGREED: f64 = 1e-4;

/// [`rest`] under a load that may turn with the shank.
pub(crate) fn rest_followed(knee: &Knee, hidden: &[Hidden], asked: &Asked, path: &Path) -> [f64; 6] {
    let mut at = rest(knee, hidden, asked, path);
    for _ in 0..ROUNDS {
        let Some(load) = following(hidden, asked, &at) else { break };
        let next = rest(knee, hidden, &Asked { load, ..*asked }, path);
        let moved = (next[2] - at[2]).abs();
        at = next;
        if moved < AGREED {
            break;
        }
    }
    at
}

/// A first guess of the inverse stiffness.
fn soft() -> Matrix5<f64> {
    Matrix5::identity() * 0.005
}

/// Least energy near `start`, with a guess of the inverse stiffness that is bettered. A tibia that has left its joint is followed no further: how it falls
/// is no test.
fn least(
    knee: &Knee,
    hidden: &[Hidden],
    asked: &Asked,
    start: Five,
    neutral: &Five,
    inverse: &mut Matrix5<f64>,
) -> Five {
    if is_far(knee, &start) {
        return start;
    }
    let near = knee.near(asked.flexion, &start);
    let scale = [1.0 / LEVER, 1.0 / LEVER, 1.0, 1.0, 1.0];
    let place = |y: &Vector5<f64>| -> Five { std::array::from_fn(|j| y[j] * scale[j]) };
    let evaluate = |y: &Vector5<f64>| {
        let c = place(y);
        let (mut energy, mut slope) = knee.energy(asked.flexion, &c, &near, moved(&start, &c));
        for j in 0..5 {
            energy -= asked.load[j] * c[j];
            slope[j] -= asked.load[j];
        }
        for h in hidden {
            let (e, s) = h.energy(asked, &c, neutral);
            energy += e;
            (0..5).for_each(|j| slope[j] += s[j]);
        }
        (energy, Vector5::from_fn(|j, _| slope[j] * scale[j]))
    };
    let mut y = Vector5::from_fn(|j, _| start[j] / scale[j]);
    let (mut energy, mut slope) = evaluate(&y);
    for _ in 0..80 {
        if slope.amax() < 0.05 || is_far(knee, &place(&y)) {
            break;
        }
        let mut way = -(*inverse * slope);
        if way.dot(&slope) >= 0.0 {
            *inverse = soft();
            way = -(*inverse * slope);
        }
        let longest = way.amax();
        if longest > 1.5 {
            way *= 1.5 / longest;
        }
        let mut size = 1.0;
        let mut next = evaluate(&(y + way));
        while next.0 > energy + 1e-4 * size * way.dot(&slope) && size > 1e-4 {
            size *= 0.4;
            next = evaluate(&(y + way * size));
        }
        let (step, change) = (way * size, next.1 - slope);
        y += step;
        (energy, slope) = next;
        let curve = step.dot(&change);
        if curve > 1e-12 {
            let (r, i) = (1.0 / curve, Matrix5::identity());
            *inverse = (i - step * change.transpose() * r) * *inverse * (i - change * step.transpose() * r)
                + step * step.transpose() * r;
        }
        if step.amax() < 1e-6 {
            break;
        }
    }
    place(&y)
}

/// The furthest that a node of the plateaus can have moved between two poses of one flexion [mm].
fn moved(a: &Five, b: &Five) -> f64 {
    let turned: f64 = (0..2).map(|j| (a[j] - b[j]).abs()).sum();
    let shifted: f64 = (2..5).map(|j| (a[j] - b[j]).abs()).sum();
    // nodes lie within 60 mm of the tibia's axis and origin; the long axis carries SI along when it turns
    shifted + turned * (60.0 + a[4].abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flat;

    /// A knee of no ligaments slides as far as its drawer pulls it. It is followed to where it leaves its joint, and not beyond.
    #[test]
    fn a_knee_that_leaves_its_joint_is_followed_no_further_and_one_that_stays_is_in_it() {
        let mut knee = Knee::drawn(&flat::input(), 5).unwrap();
        let path = Path::new(&knee, knee.ct[0], 20.0);
        let lies = |knee: &Knee, path: &Path, drawer: f64| {
            rest(knee, &[], &Asked { flexion: knee.ct[0], load: [0.0, 0.0, 0.0, drawer, 20.0] }, path)
        };
        assert!(!is_out_of_joint(&knee, &lies(&knee, &path, 20.0)));
        for structure in ["ACL", "LCL"] {
            knee.weaken(structure, 1.0);
        }
        let gone = lies(&knee, &path, 400.0);
        assert!(is_out_of_joint(&knee, &gone), "{gone:?}");
        // a step is 1.5 mm or less
        let off = (0..3).map(|k| (components(&gone)[2 + k] - components(&knee.ct)[2 + k]).abs() - OUT_MM[k]);
        let most = off.fold(f64::NEG_INFINITY, f64::max);
        assert!((0.0..2.0).contains(&most), "{most} mm beyond");
    }
}
