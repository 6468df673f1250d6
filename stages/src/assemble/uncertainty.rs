//! What a built model does not know of its knee: the numbers of [`sim::uncertainty`], each with where it was measured.

use crate::attachments::Attachments;
use crate::specimen::{PointFrame, Specimen};
use attachments::bundle::BUNDLES;
use attachments::site::{Bone, Source};
use sim::uncertainty::{FrameUncertainty, FramesUncertainty, SiteUncertainty, Uncertainty};

/// Each component of the end of a bundle whose site was outlined [mm]: centroids of outlines lie within 0.7 mm of the truth (docs/accuracy.md); how
/// bundles share an outline is not seen on it.
const MARKED_MM: f64 = 1.0;
/// The same where fibres are given by hand [mm]: a point probed on bone.
const GIVEN_MM: f64 = 1.0;
/// The same by the literature [mm]: 8.2 mm root mean square off the published sites of S192803 and S193761, 12 sites each, over three components.
const LITERATURE_MM: f64 = 4.7;

/// Turns of the femur's frame with the femoral head's centre given [deg]: the mediolateral axis lies 1.0 to 2.3 deg off published frames and raters.
const FEMUR_TURN_DEG: [f64; 3] = [1.5, 1.5, 1.5];
/// Turn about the medial and the anterior axis without that centre [deg]: the shaft alone shows the long axis.
const SHAFT_TURN_DEG: f64 = 3.0;
/// Shifts of the femur's frame [mm]: 0.7, 2.1 and 1.5 mm off the published origins.
const FEMUR_SHIFT_MM: [f64; 3] = [2.0, 2.0, 2.0];
/// Turns of the tibia's frame [deg]: axes lie 2.8 to 4.2 deg off the published ones.
const TIBIA_TURN_DEG: [f64; 3] = [2.5, 2.5, 3.0];
/// Shifts of the tibia's frame [mm]: 2.4, 2.3 and 1.0 mm off the published origins.
const TIBIA_SHIFT_MM: [f64; 3] = [2.5, 2.5, 2.0];
/// Turns [deg] and shifts [mm] of frames that the laboratory gives: repeated probing of landmarks [most2004].
const GIVEN_FRAME: [f64; 2] = [1.0, 1.0];

/// Natural logarithm of the contact pressure's scale where the law is another knee's [-]: moduli of cartilage differ by about a third from knee to knee. Ours.
const OTHER_LAW: f64 = 0.3;
/// The same where the law was fitted to this knee's own deformable cartilage [-]: the fit's worst error is 20 %.
const OWN_LAW: f64 = 0.15;
/// Thickness of a compartment's two cartilages together [mm]: surfaces lie 0.1 to 0.2 mm off the truth in the mean (docs/accuracy.md).
const CARTILAGE_MM: f64 = 0.2;

/// The standard deviations of this build. `own_law`: the contact law was fitted to this knee.
pub(super) fn uncertainty(specimen: &Specimen, attachments: &Attachments, own_law: bool) -> Uncertainty {
    let sites = BUNDLES.iter().map(|b| (b.name.clone(), site(b, specimen, attachments))).collect();
    let law = if own_law { "fitted to this knee" } else { "another knee's law" };
    let (contact_log_scale, cartilage_mm) = (if own_law { OWN_LAW } else { OTHER_LAW }, CARTILAGE_MM);
    Uncertainty {
        sites,
        frames: frame_uncertainty(specimen),
        contact_log_scale,
        cartilage_mm,
        ligaments: Default::default(),
        sources: [("contact_log_scale", law), ("cartilage_mm", "surfaces against the truth, docs/accuracy.md")]
            .map(|(k, v)| (k.to_owned(), v.to_owned()))
            .into(),
    }
}

fn site(bundle: &attachments::bundle::Bundle, specimen: &Specimen, attachments: &Attachments) -> SiteUncertainty {
    let given = specimen.given_fibres.iter().any(|f| f.bundle == bundle.name);
    let of = |bone: Bone| {
        let site = attachments.sites.iter().find(|s| s.ligament == bundle.ligament && s.bone == bone);
        match (given, site.map(|s| s.source)) {
            (true, _) | (_, Some(Source::Given)) => (GIVEN_MM, "given"),
            (_, Some(Source::Marked)) => (MARKED_MM, "marked"),
            (_, Some(Source::Literature) | None) => (LITERATURE_MM, "literature"),
        }
    };
    let ((femur_mm, femur), (tibia_mm, tibia)) = (of(Bone::Femur), of(Bone::Tibfib));
    SiteUncertainty { femur_mm, tibia_mm, source: format!("femur {femur}, tibia {tibia}") }
}

fn frame_uncertainty(specimen: &Specimen) -> FramesUncertainty {
    let frame = |turn_deg, shift_mm, source: &str| FrameUncertainty { turn_deg, shift_mm, source: source.to_owned() };
    if specimen.given_frames.is_some() {
        let given = || frame([GIVEN_FRAME[0]; 3], [GIVEN_FRAME[1]; 3], "given by the laboratory");
        return FramesUncertainty { femur: given(), tibia: given() };
    }
    let head = specimen.landmarks.iter().any(|l| l.frame == PointFrame::Ct && l.name == "femoral_head_center");
    let femur = match head {
        true => frame(FEMUR_TURN_DEG, FEMUR_SHIFT_MM, "bone shape and femoral head centre"),
        false => {
            let [_, _, axial] = FEMUR_TURN_DEG;
            frame([SHAFT_TURN_DEG, SHAFT_TURN_DEG, axial], FEMUR_SHIFT_MM, "bone shape")
        }
    };
    FramesUncertainty { femur, tibia: frame(TIBIA_TURN_DEG, TIBIA_SHIFT_MM, "bone shape") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literature_is_less_certain_than_marks_and_given_frames_more_than_found_ones() {
        const { assert!(LITERATURE_MM > MARKED_MM) };
        for k in 0..3 {
            assert!(GIVEN_FRAME[0] < FEMUR_TURN_DEG[k] && GIVEN_FRAME[1] < TIBIA_SHIFT_MM[k]);
        }
    }
}
