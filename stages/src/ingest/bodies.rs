//! Bodies that are carried along, given frames, and bodies grown together, held against the bones.

use super::held::{Bones, WIDTH_MM, cause, off};
use crate::StageError;
use crate::anatomy::{RoughAxes, rough_axes};
use crate::frames::given::GivenFrames;
use crate::specimen::Mri;
use meshes::Point;
use meshes::frame::Side;
use meshes::section::section;
use meshes::surface::TriMesh;
use notices::{Kind, Notice};

/// The origin of a given frame lies this near its bone [mm]: that of the femur deep between the condyles. Ours.
const ORIGIN_MM: f64 = 40.0;
/// A carried body lies this near its bone [mm]: beyond the thickest cartilage and a fluid-filled cleft. Ours.
const CARRIED_MM: f64 = 12.0;
/// A body's middle lies this far from the joint's on its own side, or its side is not judged [mm]. Ours: a meniscus lies 20 mm off.
const SIDE_MM: f64 = 5.0;
/// Sections of the femur in which a body beside it is looked for: their distance [mm], and how far they reach from its joint end [mm].
const STEP_MM: f64 = 2.0;
const REACH_MM: f64 = 80.0;
/// A patella's section has at least this area [mm2], and at most this share of the femur's [-]. Ours.
const PATELLA_MM2: f64 = 120.0;
const PATELLA_SHARE: f64 = 0.6;
/// Its middle lies in front of the femur's within the angle of this cosine [-]: condyles lie beside each other.
const IN_FRONT: f64 = 0.7;
/// So many sections show it, that no ridge of the surface does [-].
const SECTIONS: usize = 4;

/// Rough directions of the knee, for what is told from them; none where the bones show none, which a later stage refuses.
pub(super) fn axes(femur: &TriMesh, tibfib: &TriMesh, side: Side) -> Option<RoughAxes> {
    rough_axes(femur, tibfib, side).ok()
}

/// Holds the origins of given frames against their bones.
///
/// # Errors
/// Origins in another unit or frame.
pub(super) fn frames(
    path: &str,
    given: &GivenFrames,
    bones: &Bones,
    warnings: &mut Vec<Notice>,
) -> Result<(), StageError> {
    let origins = [given.femur.origin, given.tibia.origin].map(Point::from);
    if origins.iter().any(|p| !p.coords.iter().all(|x| x.is_finite())) {
        return Ok(());
    }
    let on = |i: usize, p: &Point| bones.own(i).nearest(p).distance;
    let limit = ORIGIN_MM * bones.scale;
    let far = origins.iter().enumerate().map(|(i, p)| on(i, p)).fold(0.0, f64::max);
    if far <= limit {
        return Ok(());
    }
    // both must come near, each in its own depth
    let beyond = |i: usize, p: &Point| (on(i, p) - limit).max(0.0);
    match cause(&origins, off(&origins, |p| *p, beyond), bones.scale, beyond) {
        Some(what) => {
            Err(StageError::file(path, format_args!("an origin of [frames] lies {far:.0} mm off its bone; {what}")))
        }
        None => {
            warnings.push(Kind::FrameOriginFar.notice(format!(
                "{path}: an origin of [frames] lies {far:.0} mm off its bone, expected within {limit:.0}: check its unit (mm) and frame ([ct])"
            )).file(path));
            Ok(())
        }
    }
}

/// Holds what a label map carries along against its bones: distance, and the side of menisci.
pub(super) fn carried(mri: &Mri, bones: &Bones, axes: Option<&RoughAxes>, warnings: &mut Vec<Notice>) {
    for (name, body) in &mri.bodies {
        let (bone, whose) = match name.starts_with("meniscus") {
            true => (bones.own(1), "tibia"),
            false => (bones.own(0), "femur"),
        };
        let far = body.vertices.iter().map(|p| bone.nearest(p).distance).fold(f64::INFINITY, f64::min);
        let limit = CARRIED_MM * bones.scale;
        if far > limit {
            warnings.push(Kind::BodyFar.notice(format!(
                "segmentation.{name} lies {far:.0} mm from the {whose}, expected within {limit:.0}: check which label it is"
            )).of(name));
        }
        let (Some(axes), Some(middle)) = (axes, body.centroid()) else { continue };
        let lateral = (middle - axes.joint).dot(&axes.lateral);
        let sign = match name.as_str() {
            "meniscus_medial" => -1.0,
            "meniscus_lateral" => 1.0,
            _ => continue,
        };
        if sign * lateral < -SIDE_MM * bones.scale {
            warnings.push(Kind::SidesExchanged.notice(format!(
                "segmentation.{name} lies {:.0} mm on the other side of the joint: medial and lateral are exchanged, or the side is wrong",
                lateral.abs()
            )).of(name));
        }
    }
}

/// What is said of a femur whose surface holds a patella, too: in several sections across the bone a second piece lies in front.
pub(super) fn grown_together(femur: &TriMesh, axes: &RoughAxes, key: &str, warnings: &mut Vec<Notice>) {
    let up = axes.femur_shaft.direction;
    let heights = femur.vertices.iter().map(|p| (p - axes.joint).dot(&up));
    let low = heights.fold(f64::INFINITY, f64::min);
    if !low.is_finite() {
        return;
    }
    let scale = super::middle_extent(femur) / WIDTH_MM;
    let mut seen = 0;
    let steps = (REACH_MM / STEP_MM) as usize;
    for k in 1..steps {
        let origin = axes.joint + up * (low + k as f64 * STEP_MM * scale);
        let cut = section(femur, &origin, &up);
        let Some((bone, others)) = cut.split_first() else { continue };
        let in_front = |o: &&meshes::section::Outline| {
            let across = o.centroid - bone.centroid;
            let apart = across - up * across.dot(&up);
            o.area > PATELLA_MM2 * scale * scale
                && o.area < PATELLA_SHARE * bone.area
                && apart.dot(&axes.anterior) > IN_FRONT * apart.norm()
        };
        seen += usize::from(others.iter().any(|o| in_front(&o)));
    }
    if seen >= SECTIONS {
        warnings.push(Kind::GrownTogether.notice(format!(
            "{key}: {seen} sections across the femur show a second body in front of it: a patella that hangs on by a bridge; cut it off, or give it a label of its own"
        )));
    }
}
