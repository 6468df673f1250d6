//! Benches that are hard: knees and laboratories that differ from what the analysis supposes.

use super::MakeArgs;
use blindbench::frames::Repeat;
use blindbench::knee::{KneeInput, Spread};
use blindbench::laboratory::{Noise, Ways};
use blindbench::surfaces::Surfaces;
use calibration::options::CalibrateOptions;
use diagnosis::problem::trial::Source;
use sim::coordinate::{AP, IE, ML, VV};

/// Who measures.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Laboratory {
    /// Loads and order as in the protocol, noise as stated
    First,
    /// Moments of 0.8 and forces of 0.75 of the protocol's, from deep flexion to extension, rotations twice as noisy as stated, a slow drift
    Second,
}

/// Loads of the second laboratory over those of the protocol: moments, forces [-]. Declared.
const LEVELS: [f64; 2] = [0.8, 0.75];

impl Laboratory {
    /// A data set's trials as this laboratory plans them.
    pub(super) fn plans(self, source: Source) -> Source {
        match self {
            Laboratory::First => source,
            Laboratory::Second => second(source),
        }
    }
}

/// Smaller loads in another order; names and numbers of the trials follow it. Branches and times of the protocol mean nothing then. Poses are read.
fn second(mut source: Source) -> Source {
    source.trials.reverse();
    source.trials.sort_by(|a, b| b.nominal_flexion_deg.total_cmp(&a.nominal_flexion_deg));
    for (k, t) in source.trials.iter_mut().enumerate() {
        for (axes, level) in [[VV, IE], [ML, AP]].into_iter().zip(LEVELS) {
            axes.into_iter().for_each(|axis| t.load[axis] *= level);
        }
        t.trial = format!("{:03}_{}_{}deg", k + 1, t.test.name(), t.nominal_flexion_deg);
        t.order = t.order.map(|_| k as i64 + 1);
        (t.row, t.branch, t.time_s, t.reference) = (None, None, None, None);
    }
    source
}

/// In what knees and laboratory differ from what the analysis supposes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hard {
    repeat: Repeat,
    wide: bool,
    surfaces: bool,
    laboratory: Laboratory,
    before: bool,
}

/// Tells the draws of surfaces from all others.
const SURFACES: u64 = 0xc2b2_ae35;

impl Hard {
    /// What was asked for.
    pub(super) fn of(args: &MakeArgs) -> Hard {
        let believed = CalibrateOptions::default().frames;
        let own = Repeat { turn_deg: believed.offset_turn_deg, shift_mm: believed.offset_shift_mm };
        Hard {
            repeat: if args.own_frames { own } else { Repeat::default() },
            wide: args.wide,
            surfaces: args.surfaces,
            laboratory: args.laboratory,
            before: args.before,
        }
    }

    /// Whether a case also has what the knee read before.
    pub(super) fn has_before(&self) -> bool {
        self.before
    }

    /// Whether a knee is drawn that may not hold together.
    pub(super) fn draws_knees(&self) -> bool {
        self.wide || self.surfaces
    }

    /// How the laboratory works, and what the truth tells of it; `is_unlike`: the knee is drawn from what its model does not know.
    pub(super) fn ways(&self, is_unlike: bool) -> Ways {
        let second = self.laboratory == Laboratory::Second;
        let all = [(is_unlike, "unlike"), (self.wide, "wide"), (self.surfaces, "surfaces"), (second, "laboratory")];
        Ways {
            repeat: self.repeat,
            spread: if self.wide { Spread::wide() } else { Spread::default() },
            noise: if second { Noise::SECOND } else { Noise::default() },
            differs: Some(all.into_iter().filter(|d| d.0).map(|d| d.1.to_owned()).collect()),
            day: 0,
        }
    }

    /// A knee with other surfaces, where they were asked for.
    pub(super) fn surfaces_of(&self, knee: KneeInput, seed: u64) -> KneeInput {
        if self.surfaces { Surfaces::OTHER.of(&knee, seed ^ SURFACES) } else { knee }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::{Load, SI};
    use sim::laxity::{Branch, LaxityTrial, Test};

    fn source() -> Source {
        let load = Load::new(10.0, 5.0, 8.0, 100.0, 20.0);
        let trial = |k: i64, flexion: f64| LaxityTrial {
            order: Some(k),
            branch: Some(Branch::Loading),
            time_s: Some(k as f64),
            ..LaxityTrial::asked(format!("t{k}"), Test::Anterior, flexion, load)
        };
        Source::new("kla", vec![trial(1, 30.0), trial(2, 30.0), trial(3, 90.0), trial(4, 60.0)])
    }

    #[test]
    fn the_second_laboratory_loads_less_and_begins_with_the_deepest_flexion() {
        assert_eq!(Laboratory::First.plans(source()), source());
        let told = Laboratory::Second.plans(source()).trials;
        let flexions: Vec<f64> = told.iter().map(|t| t.nominal_flexion_deg).collect();
        assert_eq!(flexions, [90.0, 60.0, 30.0, 30.0]);
        assert_eq!(told.iter().map(|t| t.order).collect::<Vec<_>>(), [Some(1), Some(2), Some(3), Some(4)]);
        for (t, name) in told.iter().zip(["001", "002", "003", "004"]) {
            assert!(t.trial.starts_with(name) && t.branch.is_none() && t.time_s.is_none(), "{}", t.trial);
            let told = [VV, IE, ML, AP, SI].map(|c| t.load[c]);
            for (is, expected) in told.into_iter().zip([8.0, 4.0, 6.0, 75.0, 20.0]) {
                assert!((is - expected).abs() < 1e-9, "{told:?}");
            }
        }
    }

    #[test]
    fn a_truth_tells_in_what_its_bench_differs() {
        let plain = Hard {
            repeat: Repeat::default(),
            wide: false,
            surfaces: false,
            laboratory: Laboratory::First,
            before: false,
        };
        assert_eq!(plain.ways(false), Ways { differs: Some(vec![]), ..Ways::default() });
        let hard = Hard { wide: true, surfaces: true, laboratory: Laboratory::Second, ..plain };
        let ways = hard.ways(true);
        assert_eq!(ways.differs, Some(["unlike", "wide", "surfaces", "laboratory"].map(String::from).to_vec()));
        assert_eq!((ways.spread, ways.noise), (Spread::wide(), Noise::SECOND));
        assert!(hard.draws_knees() && !plain.draws_knees());
    }
}
