//! Effects that can be hidden, in forms of their own: not the catalogue's.

use crate::asked::{Asked, Hidden, Size};
use crate::further::{self, AXES};
use crate::pose::{Five, about, pose};
use crate::unknown;
use nalgebra::Vector3;

/// What may be hidden: name, parameter, typical size, whether only positive. Draws of earlier sets take turns among these; the other kinds of the
/// catalogue are [`crate::further::FURTHER`].
pub const KINDS: [(&str, &[Size]); 15] = [
    ("femur_frame", &[("vv_deg", 3.5, false), ("ie_deg", 5.0, false)]),
    ("tibia_frame", &[("vv_deg", 3.5, false), ("ie_deg", 5.0, false)]),
    ("flexion_offset", &[("fe_deg", 5.0, false)]),
    ("origin_shift", &[("ml_mm", 2.0, false), ("ap_mm", 2.0, false), ("si_mm", 1.0, false)]),
    ("load_misalign", &[("arm_mm", 18.0, false)]),
    ("load_bias", &[("ap_n", 25.0, false), ("ie_nm", 0.4, false)]),
    ("load_gain", &[("gain", 0.25, false)]),
    ("joint_compression", &[("si_n", 150.0, true)]),
    ("quad_passive", &[("force_n", 100.0, true)]),
    ("ham_tone", &[("med_n", 90.0, true), ("lat_n", 60.0, true)]),
    ("gastroc_tone", &[("force_n", 100.0, true)]),
    ("itb", &[("force_n", 90.0, true)]),
    ("meniscus", &[("k", 15.0, true)]),
    ("capsule_envelope", &[("ap", 8.0, true), ("ie", 18_000.0, true), ("vv", 50_000.0, true)]),
    ("extra_bundle", &[("k", 60.0, true)]),
];

/// Structures that may be cut, whole or in part, in the order of their numbers in a truth. A kind is `cut_` and one of these; its size is the share lost.
pub const CUT: [&str; 4] = ["ACL", "PCL", "sMCL", "LCL"];

/// Name of a cut in a truth, as catalogues have it.
pub(crate) const CUT_EFFECT: &str = "structure_loss";

/// Whether a kind takes stiffness from a ligament: `cut_ACL`, or one that is drawn.
pub fn is_cut(kind: &str) -> bool {
    kind == CUT_EFFECT || cut(kind, 1.0).is_some()
}

/// A cut of the kind `cut_ACL`; none where a kind is no cut.
pub(crate) fn cut(kind: &str, share: f64) -> Option<Hidden> {
    let structure = CUT.iter().position(|s| kind.strip_prefix("cut_") == Some(s))?;
    let parameters = [("loss".to_owned(), share.clamp(0.0, 1.0)), ("structure".to_owned(), structure as f64)];
    Some(Hidden { effect: CUT_EFFECT.into(), parameters: parameters.into() })
}

/// The tibial tuberosity: lateral, anterior, superior [mm].
const TUBEROSITY: [f64; 3] = [-3.0, 33.0, -32.0];

/// Where the hamstrings begin: medial, anterior, superior of the femur's origin [mm].
const ISCHIUM: Vector3<f64> = Vector3::new(25.0, -45.0, 370.0);
/// Where the medial and the lateral ones end on the shank [mm].
const HAMSTRINGS: [[f64; 3]; 2] = [[24.0, -12.0, -25.0], [-36.0, -18.0, -20.0]];

/// Drawer load that wakes the muscles [N], and the load over which they wake [N].
const WAKES_N: [f64; 2] = [40.0, 15.0];

/// Where the patellar tendon leaves the patella, which rolls round the trochlea as the knee flexes [mm].
fn patella(flexion: f64) -> Vector3<f64> {
    let rolled = 0.09 + 1.17 * flexion;
    Vector3::new(0.0, 8.0 + 42.0 * rolled.cos(), 10.0 - 42.0 * rolled.sin())
}

impl Hidden {
    /// The structure that it takes a share of the stiffness from, where it is a cut.
    pub(crate) fn cuts(&self) -> Option<(&'static str, f64)> {
        let structure = CUT.get(self.value("structure") as usize)?;
        (self.effect == CUT_EFFECT).then_some((*structure, self.value("loss")))
    }

    /// The structure or the axis that it is about, by its name in catalogues, where an effect of that name may be about several.
    pub fn variant(&self) -> Option<&'static str> {
        match self.effect.as_str() {
            "load_sign" => AXES.get(self.value("axis") as usize).map(|axis| axis.0),
            _ => self.cuts().map(|(structure, _)| structure),
        }
    }

    /// What it changes of the load or flexion that the knee truly gets.
    pub(crate) fn true_load(&self, asked: &Asked) -> Asked {
        let mut out = *asked;
        match self.effect.as_str() {
            "flexion_offset" => out.flexion += self.value("fe_deg").to_radians(),
            "load_misalign" => out.load[1] += self.value("arm_mm") * asked.load[3],
            "load_bias" => {
                out.load[3] += self.value("ap_n");
                out.load[1] += 1000.0 * self.value("ie_nm");
            }
            "load_gain" => out.load.iter_mut().for_each(|l| *l *= 1.0 + self.value("gain")),
            "joint_compression" => out.load[4] += self.value("si_n"),
            _ => out = further::true_load(self, asked),
        }
        out
    }

    /// What is read of a true reading FE, VV, IE [rad], ML, AP, SI [mm].
    pub(crate) fn misread(&self, asked: &Asked, true_reading: &[f64; 6]) -> [f64; 6] {
        let mut out = unknown::misread(self, asked, true_reading);
        match self.effect.as_str() {
            "origin_shift" => {
                out[3] += self.value("ml_mm");
                out[4] += self.value("ap_mm");
                out[5] += self.value("si_mm");
            }
            "flexion_offset" => out[0] -= self.value("fe_deg").to_radians(),
            "femur_frame" | "tibia_frame" => {
                let mut p = pose(true_reading[0], &crate::pose::components(true_reading));
                // landmarks moved: one turn about one slanted axis
                let turn =
                    about(Vector3::new(0.0, self.value("vv_deg").to_radians(), self.value("ie_deg").to_radians()), 1.0);
                if self.effect == "femur_frame" {
                    p.turn = turn.transpose() * p.turn;
                    p.origin = turn.transpose() * p.origin;
                } else {
                    p.turn *= turn;
                }
                out = crate::pose::read(&p);
            }
            _ => out = further::misread(self, asked, &out),
        }
        out
    }

    /// Energy that it adds at components `c`, and its slope, by differences.
    pub(crate) fn energy(&self, asked: &Asked, c: &Five, neutral: &Five) -> (f64, Five) {
        let at = |c: &Five| self.stored(asked, c, neutral);
        let slope = std::array::from_fn(|j| {
            let h = if j < 2 { 1e-5 } else { 1e-4 };
            let (mut up, mut down) = (*c, *c);
            up[j] += h;
            down[j] -= h;
            (at(&up) - at(&down)) / (2.0 * h)
        });
        (at(c), slope)
    }

    fn stored(&self, asked: &Asked, c: &Five, neutral: &Five) -> f64 {
        let p = pose(asked.flexion, c);
        let d: Five = std::array::from_fn(|j| c[j] - neutral[j]);
        let tibial = |[x, y, z]: [f64; 3]| p.turn * Vector3::new(x, y, z) + p.origin;
        let length = |femur: Vector3<f64>, tibia: Vector3<f64>| (femur - tibia).norm();
        // a pull that grows a little with length, as a muscle's tone does
        let tone = |force: f64, l: f64, usual: f64| force * (l + 0.5 * (l - usual).powi(2) * 0.008);
        match self.effect.as_str() {
            "quad_passive" => self.value("force_n") * length(patella(asked.flexion), tibial(TUBEROSITY)),
            "ham_tone" => {
                tone(self.value("med_n"), length(ISCHIUM, tibial(HAMSTRINGS[0])), 400.0)
                    + tone(self.value("lat_n"), length(ISCHIUM, tibial(HAMSTRINGS[1])), 400.0)
            }
            "gastroc_tone" => {
                let heads = [22.0, -20.0].map(|x| length(Vector3::new(x, -24.0, 12.0), tibial([0.0, -45.0, -360.0])));
                self.value("force_n") * 0.5 * (heads[0] + heads[1])
            }
            "itb" => tone(
                self.value("force_n"),
                length(Vector3::new(-50.0, 5.0, 330.0), tibial([-32.0, 20.0, -15.0])),
                350.0,
            ),
            "meniscus" => self.springs(&d),
            "capsule_envelope" => {
                let hard = |a: f64, x: f64, scale: f64| 0.5 * a * x * x * (1.0 + 0.3 * (x / scale).powi(2));
                hard(self.value("ap"), d[3], 8.0)
                    + hard(self.value("ie"), d[1], 0.25)
                    + hard(self.value("vv"), d[0], 0.1)
            }
            "extra_bundle" => {
                let (femur, tibia) = (Vector3::new(-40.0, -6.0, 8.0), tibial([-31.0, 7.0, -12.0]));
                let stretch = length(femur, tibia) - 38.0;
                0.5 * self.value("k") * stretch.max(0.0).powi(2)
            }
            "guarding_reflex" => {
                let hamstrings =
                    0.55 * length(ISCHIUM, tibial(HAMSTRINGS[0])) + 0.45 * length(ISCHIUM, tibial(HAMSTRINGS[1]));
                self.answer(asked.load[3]) * (length(patella(asked.flexion), tibial(TUBEROSITY)) + hamstrings)
            }
            _ => unknown::stored(self, asked, (&p, c, &d)) + further::stored(self, &p),
        }
    }

    /// Pull of the muscles that answer a drawer load [N]: hardly any below the load that wakes them, in proportion to what is beyond it above.
    fn answer(&self, drawer: f64) -> f64 {
        let [wakes, over] = WAKES_N;
        let beyond = |load: f64| 0.5 * (load - wakes + (load - wakes).hypot(over));
        self.value("share") * (beyond(drawer.abs()) - beyond(0.0))
    }

    /// Ten springs on the rim of each compartment, each resisting what slides outward past a millimetre; the half of them that a slide
    /// presses make up the stiffness of the compartment, as `k` is meant: their squared cosines sum to 2.5.
    fn springs(&self, d: &Five) -> f64 {
        let mut sum = 0.0;
        for side in [22.0, -22.0] {
            for k in 0..10 {
                let angle = 2.0 * std::f64::consts::PI * k as f64 / 10.0;
                let (x, y) = (side + 18.0 * angle.cos(), 18.0 * angle.sin());
                let moved = [-d[2] - d[1] * y, d[3] + d[1] * x];
                let out = (moved[0] * angle.cos() + moved[1] * angle.sin() - 1.0).max(0.0);
                sum += 0.5 * self.value("k") / 2.5 * out * out;
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_is_of_the_structure_that_its_kind_names() {
        for structure in CUT {
            let hidden = cut(&format!("cut_{structure}"), 0.6).unwrap();
            assert_eq!(hidden.cuts(), Some((structure, 0.6)));
        }
        assert!(cut("cut_XYZ", 1.0).is_none() && cut("meniscus", 1.0).is_none());
        assert_eq!(Hidden { effect: "meniscus".into(), parameters: [("k".to_string(), 12.0)].into() }.cuts(), None);
    }

    #[test]
    fn a_compartment_of_the_menisci_is_as_stiff_as_told() {
        let hidden = Hidden { effect: "meniscus".into(), parameters: [("k".to_string(), 12.0)].into() };
        let slid = |ap: f64| hidden.springs(&[0.0, 0.0, 0.0, ap, 0.0]);
        for ap in [-8.0, 8.0] {
            let stiffness = slid(ap + 1.0) - 2.0 * slid(ap) + slid(ap - 1.0);
            assert!((stiffness - 24.0).abs() < 1e-9, "two compartments of 12 N/mm, and {stiffness}");
        }
    }

    #[test]
    fn muscles_answer_a_drawer_once_it_wakes_them() {
        let hidden = Hidden { effect: "guarding_reflex".into(), parameters: [("share".to_string(), 0.5)].into() };
        let at = |n: f64| hidden.answer(n);
        assert!(at(0.0) == 0.0 && at(20.0) < 2.0 && (at(133.0) - 46.5).abs() < 2.0, "{} {}", at(20.0), at(133.0));
        assert_eq!(at(133.0), at(-133.0));
        // they press the joint together, and pull the shank back in flexion
        let c = [0.0, 0.0, 0.0, 0.0, -21.0];
        let pull = |load: f64, flexion: f64, j: usize| {
            -hidden.energy(&Asked { flexion, load: [0.0, 0.0, 0.0, load, 0.0] }, &c, &c).1[j]
        };
        assert!(pull(133.0, 0.5, 4) > 60.0 && pull(0.0, 0.5, 4).abs() < 1e-6, "{}", pull(133.0, 0.5, 4));
        assert!(pull(133.0, 1.5, 3) < -20.0, "{}", pull(133.0, 1.5, 3));
    }

    #[test]
    fn the_patellar_tendon_pulls_forward_near_extension_and_backward_in_deep_flexion() {
        // against the shaft of the tibia, as measured in knees [riener1999]
        for (flexion, angle) in [(0.0, 20.0), (30.0, 11.0), (60.0, 1.0), (90.0, -8.0f64)] {
            let flexion = f64::to_radians(flexion);
            let p = pose(flexion, &[0.0, 0.0, 0.0, 0.0, -21.0]);
            let pull = p.turn.transpose() * (patella(flexion) - p.origin) - Vector3::from(TUBEROSITY);
            let is = pull.y.atan2(pull.z).to_degrees();
            assert!((is - angle).abs() < 5.0, "{is} against {angle} deg");
        }
    }
}
