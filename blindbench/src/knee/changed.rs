//! A knee whose tissues are not as its copy has them: weaker, attached elsewhere, or run over bone.

use super::{Fibre, Knee};
use crate::over::{Over, crossing};
use crate::pose::{Pose, components, pose};
use nalgebra::Vector3;

/// How much less and more than the middle of a site its first and last fibre moves [-]: a site that is drawn wrongly is of another size, too.
const UNEVEN: f64 = 0.2;

/// Height of the tibia's rim in its frame [mm]: the medial plateau's edge lies a little below the tips of the eminence.
const RIM_MM: f64 = -6.0;

/// Whether a bundle is part of a structure.
fn belongs(bundle: &str, structure: &str) -> bool {
    bundle.strip_prefix(structure).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
}

impl Knee {
    /// Whether it has bundles of a structure.
    pub(crate) fn has(&self, structure: &str) -> bool {
        self.bundles.iter().any(|b| belongs(&b.name, structure))
    }

    /// Whether a structure has lost stiffness: such a knee may come out of its joint.
    pub(crate) fn is_weakened(&self) -> bool {
        self.is_weakened
    }

    /// Takes a share of its stiffness from a structure: all bundles of that name.
    pub(crate) fn weaken(&mut self, structure: &str, loss: f64) {
        self.is_weakened |= loss > 0.0;
        self.bundles.iter_mut().filter(|b| belongs(&b.name, structure)).for_each(|b| b.stiffness *= 1.0 - loss);
    }

    /// Moves the femoral and the tibial site of a structure, each in its bone's frame [mm]; its strain in the CT pose stays.
    pub(crate) fn move_sites(&mut self, structure: &str, [femur, tibia]: [Vector3<f64>; 2]) {
        let ct = self.ct_pose();
        let places = self.places(structure);
        let last = places.len().saturating_sub(1).max(1) as f64;
        for (k, &place) in places.iter().enumerate() {
            let share = 1.0 + UNEVEN * (2.0 * k as f64 / last - 1.0);
            let f = &mut self.fibres[place];
            f.femur += femur * share;
            f.tibia += tibia * share;
            f.initial = (ct.turn * f.tibia + ct.origin - f.femur).norm();
        }
    }

    /// Lays a structure over the tibia's rim, which stands medial of each straight fibre by `proud` in the CT pose [mm].
    pub(crate) fn lay_over_rim(&mut self, structure: &str, proud: f64) {
        let ct = self.ct_pose();
        let edge = |f: &Fibre| {
            let femur = ct.turn.transpose() * (f.femur - ct.origin);
            let at = crossing(&femur, &f.tibia, &Vector3::z(), RIM_MM - f.tibia.z) + Vector3::x() * proud;
            Over { bone: 1, at, out: Vector3::x(), along: Vector3::z() }
        };
        self.lay(structure, &edge);
    }

    /// Lays a structure over the back of the condyles, which stands behind the middle of each straight fibre by `proud` in extension [mm].
    pub(crate) fn lay_over_condyles(&mut self, structure: &str, proud: f64) {
        let straight = pose(0.0, &components(&self.ct));
        let edge = |f: &Fibre| {
            let middle = (f.femur + straight.turn * f.tibia + straight.origin) / 2.0;
            Over { bone: 0, at: middle - Vector3::y() * proud, out: -Vector3::y(), along: Vector3::zeros() }
        };
        self.lay(structure, &edge);
    }

    fn lay(&mut self, structure: &str, edge: &dyn Fn(&Fibre) -> Over) {
        for place in self.places(structure) {
            let f = &mut self.fibres[place];
            f.over = Some(edge(f));
        }
    }

    /// Places of a structure's fibres among all.
    fn places(&self, structure: &str) -> Vec<usize> {
        let of = |f: &Fibre| belongs(&self.bundles[f.bundle].name, structure);
        (0..self.fibres.len()).filter(|&k| of(&self.fibres[k])).collect()
    }

    fn ct_pose(&self) -> Pose {
        pose(self.ct[0], &components(&self.ct))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flat;

    #[test]
    fn a_moved_site_keeps_the_tension_of_the_ct_pose_and_changes_it_elsewhere() {
        let [own, mut moved] = [5, 5].map(|seed| Knee::drawn(&flat::input(), seed).unwrap());
        moved.move_sites("LCL", [Vector3::new(0.0, 5.0, 3.0), Vector3::new(0.0, -4.0, 0.0)]);
        let tension = |knee: &Knee, flexion: f64, name: &str| knee.tensions(flexion, &components(&knee.ct))[name];
        let ct = own.ct[0];
        for name in ["ACL_AM", "LCL"] {
            let [a, b] = [&own, &moved].map(|k| tension(k, ct, name));
            assert!((a - b).abs() < 1e-9 * (1.0 + a), "{name} in the CT pose: {a} and {b} N");
        }
        let [a, b] = [&own, &moved].map(|k| tension(k, ct + 0.3, "LCL"));
        assert!((a - b).abs() > 1.0, "flexed: {a} and {b} N");
        assert_eq!(tension(&own, ct + 0.3, "ACL_AM"), tension(&moved, ct + 0.3, "ACL_AM"));
        assert!(own.has("ACL") && own.has("LCL") && !own.has("CL") && !own.has("PCL"));
    }

    #[test]
    fn fibres_leave_the_condyles_as_the_knee_flexes() {
        let mut knee = Knee::drawn(&flat::input(), 5).unwrap();
        knee.lay_over_condyles("LCL", 5.0);
        let longer = |flexion: f64| {
            let p = pose(flexion, &components(&knee.ct));
            knee.fibres.iter().map(|f| f.longer(&p)).fold(0.0, f64::max)
        };
        assert!(longer(-0.1) > longer(0.0) && longer(0.0) > longer(0.2) && longer(1.2) == 0.0);
    }
}
