//! What a sweep may vary of a graft.

use crate::plan::file::{GraftFile, SiteFile};

/// A bone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bone {
    Femur,
    Tibia,
}

/// What a choice is of a graft.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum What {
    /// A percentage of the bone's own method: the first or the second.
    Percent(Bone, usize),
    /// A way along the bone: forwards, upwards, lateral.
    Move(Bone, usize),
    Tension,
    Flexion,
    Stiffness,
}

/// A choice: its key in sweep.toml, which is its column in sweep.csv; its name on a page, with its unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Choice {
    pub(super) key: &'static str,
    pub(super) label: &'static str,
    pub(super) what: What,
}

const fn choice(key: &'static str, label: &'static str, what: What) -> Choice {
    Choice { key, label, what }
}

/// All choices, in the order of their columns.
pub(super) const CHOICES: [Choice; 13] = [
    choice("femur_depth_percent", "femur: depth from the back, %", What::Percent(Bone::Femur, 0)),
    choice("femur_height_percent", "femur: height downwards, %", What::Percent(Bone::Femur, 1)),
    choice("tibia_front_percent", "tibia: from the front, %", What::Percent(Bone::Tibia, 0)),
    choice("tibia_medial_percent", "tibia: from medial, %", What::Percent(Bone::Tibia, 1)),
    choice("femur_forwards_mm", "femur: forwards, mm", What::Move(Bone::Femur, 0)),
    choice("femur_upwards_mm", "femur: upwards, mm", What::Move(Bone::Femur, 1)),
    choice("femur_lateral_mm", "femur: lateral, mm", What::Move(Bone::Femur, 2)),
    choice("tibia_forwards_mm", "tibia: forwards, mm", What::Move(Bone::Tibia, 0)),
    choice("tibia_upwards_mm", "tibia: upwards, mm", What::Move(Bone::Tibia, 1)),
    choice("tibia_lateral_mm", "tibia: lateral, mm", What::Move(Bone::Tibia, 2)),
    choice("tension_n", "tension, N", What::Tension),
    choice("at_flexion_deg", "fixed at flexion, deg", What::Flexion),
    choice("stiffness_n_per_mm", "stiffness, N/mm", What::Stiffness),
];

impl Bone {
    fn site(self, graft: &mut GraftFile) -> &mut SiteFile {
        match self {
            Bone::Femur => &mut graft.femur,
            Bone::Tibia => &mut graft.tibia,
        }
    }

    /// The place of a graft on this bone by its own percentages, where it is given by them [%].
    pub(super) fn percent(self, graft: &GraftFile) -> Option<[f64; 2]> {
        match self {
            Bone::Femur => graft.femur.quadrant_percent,
            Bone::Tibia => graft.tibia.plateau_percent,
        }
    }
}

impl Choice {
    /// Puts a value into a graft, in place of what it had of it.
    pub(super) fn put(&self, graft: &mut GraftFile, x: f64) {
        match self.what {
            What::Percent(bone, k) => {
                let mut both = bone.percent(graft).unwrap_or_default();
                both[k] = x;
                let site = bone.site(graft);
                let move_mm = site.move_mm;
                *site = match bone {
                    Bone::Femur => SiteFile { quadrant_percent: Some(both), move_mm, ..SiteFile::default() },
                    Bone::Tibia => SiteFile { plateau_percent: Some(both), move_mm, ..SiteFile::default() },
                };
            }
            What::Move(bone, k) => bone.site(graft).move_mm[k] = x,
            What::Tension => (graft.tension_n, graft.slack_length_mm) = (Some(x), None),
            What::Flexion => graft.at_flexion_deg = x,
            What::Stiffness => {
                (graft.stiffness_n_per_mm, graft.cross_section_mm2, graft.modulus_mpa) = (Some(x), None, None);
            }
        }
    }

    /// What a graft has of it, where it says so.
    pub(super) fn of(&self, graft: &GraftFile) -> Option<f64> {
        match self.what {
            What::Percent(bone, k) => bone.percent(graft).map(|both| both[k]),
            What::Move(Bone::Femur, k) => Some(graft.femur.move_mm[k]),
            What::Move(Bone::Tibia, k) => Some(graft.tibia.move_mm[k]),
            What::Tension => graft.tension_n,
            What::Flexion => graft.tension_n.map(|_| graft.at_flexion_deg),
            What::Stiffness => graft.stiffness_n_per_mm,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::file::{EXAMPLE, parsed};

    #[test]
    fn what_is_put_in_is_what_is_read_and_makes_a_plan_whatever_the_plan_had() {
        let mut plan = parsed(EXAMPLE).unwrap();
        let own = &mut plan.graft[0];
        own.femur = SiteFile { native: Some("ACL".into()), move_mm: [1.0, 0.0, 0.0], ..SiteFile::default() };
        own.tibia = SiteFile { native: Some("ACL".into()), ..SiteFile::default() };
        (own.stiffness_n_per_mm, own.cross_section_mm2, own.modulus_mpa) = (None, Some(50.0), Some(100.0));
        (own.tension_n, own.slack_length_mm) = (None, Some(30.0));
        for (k, choice) in CHOICES.iter().enumerate() {
            let x = 11.0 + k as f64;
            choice.put(&mut plan.graft[0], x);
            let read = choice.of(&plan.graft[0]);
            assert!(read == Some(x) || choice.what == What::Flexion, "{}: {read:?}", choice.key);
            assert!(plan.check().is_ok(), "{}: {:?}", choice.key, plan.check());
        }
        // the way along the bone stays where a percentage takes the place of another site
        assert!(plan.graft[0].femur.native.is_none() && plan.graft[0].femur.move_mm[0] == 15.0);
        assert_eq!(CHOICES[11].of(&plan.graft[0]), Some(22.0));
    }
}
