//! Where the knee comes to rest: least energy by a quasi-Newton descent [nocedal2006, algorithm 6.1], following the load.

use crate::hidden::Hidden;
use crate::knee::Knee;
use crate::pose::{Five, components, pose, read};
use nalgebra::{Matrix5, Vector5};

/// Rotations count as millimetres at this lever [mm].
const LEVER: f64 = 30.0;

/// Loads VV, IE [N mm], ML, AP, SI [N] at a flexion [rad].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Asked {
    pub(crate) flexion: f64,
    pub(crate) load: Five,
}

/// Rest under a load with an effect, from the CT pose by compression, flexion, load; as read, and the components.
pub(crate) fn rest(knee: &Knee, hidden: &[Hidden], asked: &Asked) -> [f64; 6] {
    let mut at = components(&knee.ct);
    let squeeze = [0.0, 0.0, 0.0, 0.0, asked.load[4]];
    let steps = ((asked.flexion - knee.ct[0]).abs() / 0.1).ceil().max(1.0) as usize;
    for k in 0..=steps {
        let flexion = knee.ct[0] + (asked.flexion - knee.ct[0]) * k as f64 / steps as f64;
        at = least(knee, &[], &Asked { flexion, load: squeeze }, &squeeze, at, &at);
    }
    let neutral = at;
    for part in [0.34, 0.67, 1.0] {
        let load = std::array::from_fn(|j| squeeze[j] + (asked.load[j] - squeeze[j]) * part);
        at = least(knee, hidden, &Asked { flexion: asked.flexion, load }, &load, at, &neutral);
    }
    read(&pose(asked.flexion, &at))
}

/// Least energy near `start`.
fn least(knee: &Knee, hidden: &[Hidden], asked: &Asked, load: &Five, start: Five, neutral: &Five) -> Five {
    let near = knee.near(asked.flexion, &start);
    let scale = [1.0 / LEVER, 1.0 / LEVER, 1.0, 1.0, 1.0];
    let evaluate = |y: &Vector5<f64>| {
        let c: Five = std::array::from_fn(|j| y[j] * scale[j]);
        let (mut energy, mut slope) = knee.energy(asked.flexion, &c, &near);
        for j in 0..5 {
            energy -= load[j] * c[j];
            slope[j] -= load[j];
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
    let mut inverse = Matrix5::identity() * 0.005;
    for _ in 0..80 {
        if slope.amax() < 0.05 {
            break;
        }
        let mut way = -(inverse * slope);
        if way.dot(&slope) >= 0.0 {
            inverse = Matrix5::identity() * 0.005;
            way = -(inverse * slope);
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
            inverse = (i - step * change.transpose() * r) * inverse * (i - change * step.transpose() * r)
                + step * step.transpose() * r;
        }
        if step.amax() < 1e-6 {
            break;
        }
    }
    std::array::from_fn(|j| y[j] * scale[j])
}
