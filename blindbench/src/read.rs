//! How each data set reads a knee: in frames of its own, or in those of the knee.

use crate::BenchError;
use crate::frames::{Frames, Repeat};
use crate::knee::{Knee, normal};
use crate::rest::Path;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// Tells the draws of frames from all others.
const FRAMED: u64 = 0x2545_f491;

impl Repeat {
    /// Frames of each data set; none where all share them.
    pub(crate) fn drawn(&self, sources: &[String], seed: u64) -> BTreeMap<String, Frames> {
        if *self == Repeat::default() {
            return BTreeMap::new();
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ FRAMED);
        let mut three = |sd: f64| std::array::from_fn(|_| sd * normal(&mut random));
        let mut one = || {
            let turn_deg = [three(self.turn_deg), three(self.turn_deg)];
            Frames { turn_deg, shift_mm: [three(self.shift_mm), three(self.shift_mm)] }
        };
        sources.iter().map(|s| (s.clone(), one())).collect()
    }
}

/// A knee and its unloaded rests, as each data set reads it.
pub(crate) struct Read<'a> {
    shared: (&'a Knee, &'a Path),
    own: BTreeMap<String, (Knee, Path)>,
}

impl<'a> Read<'a> {
    /// A knee read in each data set's `frames`, or in its own.
    pub(crate) fn new(
        shared: (&'a Knee, &'a Path),
        frames: &BTreeMap<String, Frames>,
        path: &dyn Fn(&Knee) -> Path,
    ) -> Result<Read<'a>, BenchError> {
        let of = |(source, frames): (&String, &Frames)| {
            let knee = shared.0.in_frames(frames)?;
            let path = path(&knee);
            Ok((source.clone(), (knee, path)))
        };
        Ok(Read { shared, own: frames.iter().map(of).collect::<Result<_, BenchError>>()? })
    }

    /// As a data set reads it.
    pub(crate) fn by(&self, source: &str) -> (&Knee, &Path) {
        self.own.get(source).map_or(self.shared, |(knee, path)| (knee, path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flat;
    use crate::pose::{Five, components, pose, read};

    fn knee() -> Knee {
        Knee::drawn(&flat::input(), 5).unwrap()
    }

    /// The same with a structure over the tibia's rim and one over the condyles.
    fn wrapped() -> Knee {
        let mut out = knee();
        out.lay_over_rim("LCL", 4.0);
        out.lay_over_condyles("ACL", 5.0);
        out
    }

    #[test]
    fn a_cut_takes_its_share_of_one_structure() {
        let (whole, at) = (knee(), [0.01, 0.05, 0.4, 1.0, -13.0]);
        let before = whole.tensions(0.0, &at);
        assert!(before.values().all(|t| *t > 1.0), "{before:?}");
        for (structure, share) in [("ACL", 0.4), ("ACL", 1.0), ("LCL", 0.25), ("CL", 0.5), ("AC", 0.5)] {
            let mut cut = knee();
            cut.weaken(structure, share);
            for (name, tension) in cut.tensions(0.0, &at) {
                let left = if name.split('_').next() == Some(structure) { 1.0 - share } else { 1.0 };
                assert!((tension - left * before[&name]).abs() < 1e-9 * before[&name], "{structure} {share}: {name}");
            }
        }
    }

    #[test]
    fn a_knee_read_in_other_frames_is_the_same_knee() {
        let drawn = Repeat { turn_deg: 4.0, shift_mm: 3.0 }.drawn(&["kla".into(), "rks".into()], 3);
        assert_ne!(drawn["kla"], drawn["rks"]);
        assert!(Repeat::default().drawn(&["kla".into()], 3).is_empty());
        [knee(), wrapped()].iter().for_each(|knee| same_in_frames(knee, &drawn["kla"]));
    }

    fn same_in_frames(knee: &Knee, frames: &Frames) {
        let framed = knee.in_frames(frames).unwrap();
        let mut pressed = 0;
        for (flexion, c) in [(0.0, [0.01, 0.05, 0.4, 1.0, -9.6]), (0.3, [-0.02, -0.1, 1.0, -2.0, -9.5])] {
            let there = read(&frames.pose(&pose(flexion, &c)));
            let (turned, own) = (there[0], components(&there));
            for (a, b) in knee.tensions(flexion, &c).values().zip(framed.tensions(turned, &own).values()) {
                assert!((a - b).abs() < 1e-9 * (1.0 + a), "{a} {b}");
            }
            let energy = |k: &Knee, f: f64, c| k.energy(f, c, &k.near(f, c), 1.0).0;
            let (a, b) = (energy(knee, flexion, &c), energy(&framed, turned, &own));
            assert!((a - b).abs() < 1e-7 * (1.0 + a.abs()), "{a} {b}");
            pressed += usize::from(knee.near(flexion, &c).iter().any(|n| n.1 == 0.0));
            assert!((there[2] - c[1]).abs() > 1e-3, "it reads otherwise");
        }
        assert!(pressed > 0, "contact is among what is compared");
    }

    #[test]
    fn fibres_over_bone_pull_more_and_their_force_is_the_slope_of_their_energy() {
        let (straight, wrapped) = (knee(), wrapped());
        for c in [[0.01, 0.05, 0.4, 1.0, -9.6], [-0.03, -0.1, -0.5, 2.0, -8.5]] {
            let near = wrapped.near(0.1, &c);
            let at = |c: &Five| wrapped.energy(0.1, c, &near, 1.0);
            let (_, slope) = at(&c);
            for j in 0..5 {
                let h = if j < 2 { 1e-5 } else { 1e-4 };
                let side = |sign: f64| {
                    let mut there = c;
                    there[j] += sign * h;
                    at(&there).0
                };
                let is = (side(1.0) - side(-1.0)) / (2.0 * h);
                assert!((is - slope[j]).abs() < 1e-3 * (1.0 + is.abs()), "{j}: {is} against {}", slope[j]);
            }
            let [a, b] = [&straight, &wrapped].map(|k| k.tensions(0.1, &c).values().sum::<f64>());
            assert!(b > a, "{b} N over bone, {a} N straight");
        }
    }
}
