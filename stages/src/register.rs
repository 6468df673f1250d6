//! Stage 2, register: each scan onto its CT bone.

mod capsule;

use crate::error::Mark;
use crate::specimen::{NamedPoint, Patella, PointFrame, Specimen};
use crate::{PerBone, StageError};
use meshes::frame::{Ct, Pose, Scan};
use meshes::registration::{bare, fit, icp, sample, start, target::Target};
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::{Isometry, Point, Vector};
use nalgebra::{Matrix3, SymmetricEigen};
use notices::{Kind, Notice};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How one scan came to lie on its CT bone, with its grade.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BoneRegistration {
    /// Scan to CT.
    pub ct_from_scan: Pose<Scan, Ct>,
    /// Root mean square distance of the fitted bare-bone points [mm].
    pub rms_bare_bone_mm: f64,
    /// Share of the scan's bone-like vertices that lie on the CT bone.
    pub inlier_fraction: f64,
    /// Root mean square distance of bare-bone points kept out of the fit [mm].
    pub held_out_rms_mm: f64,
    /// Predicted mean error of the registration over the scan's vertices [mm].
    pub predicted_error_mm: f64,
    /// How far bare bone lies outside the CT bone all over [mm], where that is too much for chance: the bone was segmented too
    /// small, or too large where it is negative.
    pub level_mm: f64,
    /// Signed distance of each scan vertex to the CT bone [mm], the residual map.
    pub residual_mm: Vec<f64>,
    /// Whether each scan vertex counts as bare bone.
    pub bare_bone: Vec<bool>,
}

/// Both bones' registrations.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Registration {
    /// By bone.
    pub bones: PerBone<BoneRegistration>,
    /// The patella's, where it was scanned.
    #[serde(default)]
    pub patella: Option<BoneRegistration>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: Option<RegisterMetrics>,
}

/// Figures of the registrations, for metrics.json.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RegisterMetrics {
    /// Of the bones.
    #[serde(flatten)]
    pub bones: PerBone<FitMetrics>,
    /// Of the patella, where it has a scan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patella: Option<FitMetrics>,
    /// The capsule scan beside each bone's own, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub capsule: Option<PerBone<Option<capsule::CapsuleMetrics>>>,
}

/// How a scan lies on its bone.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FitMetrics {
    /// Distance of bare bone, root mean square [mm].
    pub rms_bare_bone_mm: f64,
    /// Share of the scan that is bare bone [-].
    pub inlier_fraction: f64,
    /// Distance of bare bone that was held out, root mean square [mm].
    pub held_out_rms_mm: f64,
    /// Expected error of the pose [mm].
    pub predicted_error_mm: f64,
    /// By how much bone was found to lie outside CT's surface [mm].
    pub level_mm: f64,
}

impl Registration {
    /// That of a specimen whose cartilage lies where its bones lie: nothing moves.
    pub fn left_out() -> Registration {
        let still = BoneRegistration {
            ct_from_scan: Pose::assume(Isometry::identity()),
            rms_bare_bone_mm: 0.0,
            inlier_fraction: 1.0,
            held_out_rms_mm: 0.0,
            predicted_error_mm: 0.0,
            level_mm: 0.0,
            residual_mm: Vec::new(),
            bare_bone: Vec::new(),
        };
        let bones = PerBone { femur: still.clone(), tibfib: still };
        Registration { bones, patella: None, warnings: Vec::new(), metrics: None }
    }
}

/// How scans are registered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegisterOptions {
    /// Seed of the search without landmarks [-].
    pub seed: u64,
    /// One of how many blocks of the scan is kept out of the fit to grade it [-].
    pub held_out_of: usize,
    /// Largest root mean square residual, of bare bone kept out of the fit, that is believed [mm]; segmented CT lies
    /// 0.21 (sd 0.12) mm from bone in the mean [wang2009].
    pub rms_limit_mm: f64,
    /// Smallest share of bone-like scan on the bone that is believed [-].
    pub inlier_limit: f64,
    /// Largest predicted mean error that is believed [mm].
    pub error_limit_mm: f64,
    /// Distance between a landmark of scan and CT after registration from which it is reported [mm].
    pub landmark_limit_mm: f64,
}

impl Default for RegisterOptions {
    fn default() -> Self {
        RegisterOptions {
            seed: 1,
            held_out_of: 10,
            rms_limit_mm: 0.35,
            inlier_limit: 0.8,
            error_limit_mm: 0.4,
            landmark_limit_mm: 8.0,
        }
    }
}

/// Registers each scan onto its CT bone, from landmarks where scan and CT share names, else by a search over the whole surface.
///
/// Errors say which bone, by what figures, and where the scan fits worst.
pub fn register(specimen: &Specimen, options: &RegisterOptions) -> Result<Registration, StageError> {
    let one = |name: &str, ct, scan, frame| {
        let mut warnings = Vec::new();
        let pairs = landmark_pairs(&specimen.landmarks, frame);
        let points: Vec<(Point, Point)> = pairs.iter().map(|p| (p.1, p.2)).collect();
        let bone = register_bone(ct, scan, &points, options).map_err(|e| e.of_part(name))?;
        if bone.level_mm != 0.0 {
            let (by, size) = (bone.level_mm.abs(), if bone.level_mm > 0.0 { "small" } else { "large" });
            warnings.push(Kind::CtSize.notice(format!("{name}: the CT bone is about {by:.2} mm too {size} all over: look at the threshold it was segmented with")).of(name));
        }
        for (landmark, from, to) in &pairs {
            let apart = (bone.ct_from_scan.point(from) - to).norm();
            if apart > options.landmark_limit_mm {
                warnings.push(Kind::LandmarkMisplaced.notice(format!("{name}: landmark {landmark} of scan and CT lie {apart:.1} mm apart after registration: misplaced in one of them")).of(landmark));
            }
        }
        Ok::<_, StageError>((bone, warnings))
    };
    let (femur, tibfib) = rayon::join(
        || one("femur", &specimen.ct.femur, &specimen.scans.femur, PointFrame::ScanFemur),
        || one("tibfib", &specimen.ct.tibfib, &specimen.scans.tibfib, PointFrame::ScanTibfib),
    );
    let ((femur, mut warnings), (tibfib, more)) = (femur?, tibfib?);
    warnings.extend(more);
    let figures = |b: &BoneRegistration| FitMetrics {
        rms_bare_bone_mm: b.rms_bare_bone_mm,
        inlier_fraction: b.inlier_fraction,
        held_out_rms_mm: b.held_out_rms_mm,
        predicted_error_mm: b.predicted_error_mm,
        level_mm: b.level_mm,
    };
    let patella = specimen.patella.as_ref().and_then(|p| patella(p, options, &mut warnings));
    let bones = PerBone { femur, tibfib };
    let check = |scan| capsule::check(scan, specimen, &bones, options.seed, &mut warnings);
    let metrics = RegisterMetrics {
        bones: PerBone { femur: figures(&bones.femur), tibfib: figures(&bones.tibfib) },
        patella: patella.as_ref().map(figures),
        capsule: specimen.capsule.as_ref().map(check),
    };
    Ok(Registration { bones, patella, warnings, metrics: Some(metrics) })
}

/// The patella's scan on its CT surface; a warning where it does not fit, since no simulation needs it.
fn patella(patella: &Patella, options: &RegisterOptions, warnings: &mut Vec<Notice>) -> Option<BoneRegistration> {
    match register_bone(&patella.ct, patella.scan.as_ref()?, &[], options) {
        Ok(found) => Some(found),
        Err(e) => {
            warnings.push(Kind::PatellaUnfit.notice(format!("patella: its scan is left out: {e}")).of("patella"));
            None
        }
    }
}

/// A start from landmark pairs (scan, CT), else from a search over the whole bone.
pub(crate) fn rough(
    target: &Target,
    source: &sample::Samples,
    pairs: &[(Point, Point)],
    seed: u64,
) -> Option<start::Start> {
    let chosen = start::best(target, source, &start::from_landmarks(pairs));
    if chosen.is_some_and(|s| s.agreement >= 0.7) {
        return chosen;
    }
    let searched = start::best(target, source, &start::search(target, source, seed));
    [chosen, searched].into_iter().flatten().max_by(|a, b| a.agreement.total_cmp(&b.agreement))
}

/// Names and places (scan, CT) of the landmarks that stand in both frames.
fn landmark_pairs(landmarks: &[NamedPoint], frame: PointFrame) -> Vec<(&str, Point, Point)> {
    landmarks
        .iter()
        .filter(|l| l.frame == frame)
        .filter_map(|scan| {
            let ct = landmarks.iter().find(|l| l.frame == PointFrame::Ct && l.name == scan.name)?;
            Some((scan.name.as_str(), scan.point, ct.point))
        })
        .collect()
}

/// Registers one scan onto its CT bone; `pairs` are rough landmarks (scan, CT), perhaps none.
pub fn register_bone(
    ct: &TriMesh,
    scan: &ColouredMesh,
    pairs: &[(Point, Point)],
    options: &RegisterOptions,
) -> Result<BoneRegistration, StageError> {
    let target = Target::new(ct, 6000)
        .ok_or_else(|| StageError::Knee("the CT surface has no area or a coordinate that is not finite".into()))?;
    let prepared = bare::prepare(scan);
    let source = sample::spread(&scan.mesh, 4000);
    if source.points.is_empty() || scan.mesh.vertices.iter().any(|p| !p.coords.iter().all(|x| x.is_finite())) {
        return Err(StageError::Knee("the scan has no area or a coordinate that is not finite".into()));
    }
    let chosen = rough(&target, &source, pairs, options.seed)
        .ok_or_else(|| StageError::Knee("the scan does not resemble the CT bone anywhere".into()))?;
    let fine = start::thinned(&source, 1500);
    let pose = icp::refine(&target, &fine, &chosen.pose, &[2.0, 1.5, 1.0, 0.8, 0.6, 0.5]);
    let mut fitted = settled(&target, &prepared, &fine.points, &pose, options.held_out_of.max(2)).ok_or_else(|| {
        StageError::Knee("too little bare bone lies on the CT bone to fix the pose of the scan".into())
    })?;
    if let Err(refused) = believe(&fitted, &prepared, options) {
        fitted = turned(&target, &prepared, &fine.points, &fitted, options).ok_or(refused)?;
    }
    Ok(BoneRegistration {
        ct_from_scan: Pose::assume(fitted.pose),
        rms_bare_bone_mm: fitted.rms,
        inlier_fraction: fitted.inlier_fraction,
        held_out_rms_mm: fitted.held_out_rms,
        predicted_error_mm: fitted.predicted_error,
        level_mm: fitted.classified.level,
        residual_mm: fitted.classified.standing.iter().map(|s| s.residual.signum() * s.distance).collect(),
        bare_bone: fitted.classified.bare,
    })
}

/// Fits again from where a fit ended, at most ten times, until it moves the scan's `points` by less than 0.3 mm in the mean: a
/// scan that is mostly cartilage may start a few mm off.
fn settled(
    target: &Target,
    scan: &bare::Scan,
    points: &[Point],
    start: &Isometry,
    held_out: usize,
) -> Option<fit::Fitted> {
    let mut fitted = fit::fit(target, scan, start, held_out)?;
    let mut before = *start;
    for _ in 0..9 {
        let moved: f64 = points.iter().map(|p| (fitted.pose * p - before * p).norm()).sum();
        if moved < 0.3 * points.len() as f64 {
            break;
        }
        before = fitted.pose;
        fitted = fit::fit(target, scan, &before, held_out)?;
    }
    Some(fitted)
}

/// Turns about a scan's principal axes from which a fit is tried again [deg].
const TURN_DEG: f64 = 5.0;

/// The best believable fit from poses turned off one that was refused though the scan lies near the bone: where much of the scan is
/// missing, cartilage alone can hold it turned by some degrees.
fn turned(
    target: &Target,
    scan: &bare::Scan,
    points: &[Point],
    refused: &fit::Fitted,
    options: &RegisterOptions,
) -> Option<fit::Fitted> {
    if refused.inlier_fraction <= options.inlier_limit {
        return None;
    }
    let centre = Point::from(points.iter().fold(Vector::zeros(), |s, p| s + p.coords) / points.len().max(1) as f64);
    let spread = points.iter().fold(Matrix3::zeros(), |s, p| s + (p - centre) * (p - centre).transpose());
    let axes = SymmetricEigen::new(spread).eigenvectors;
    let about = |k: usize| {
        let turn = Isometry::rotation(axes.column(k % 3) * if k < 3 { 1.0 } else { -1.0 } * TURN_DEG.to_radians());
        let pose = refused.pose
            * (Isometry::translation(centre.x, centre.y, centre.z)
                * turn
                * Isometry::translation(-centre.x, -centre.y, -centre.z));
        settled(target, scan, points, &pose, options.held_out_of.max(2))
    };
    let fits: Vec<fit::Fitted> = (0..6).into_par_iter().filter_map(about).collect();
    let believed = fits.into_iter().filter(|f| believe(f, scan, options).is_ok());
    believed.min_by(|a, b| a.held_out_rms.total_cmp(&b.held_out_rms))
}

/// A length in words; where no bare bone was left to measure there is none.
fn length(mm: f64) -> String {
    if mm.is_finite() { format!("{mm:.2} mm") } else { "too far to be measured".into() }
}

/// Refuses what cannot be trusted.
fn believe(fitted: &fit::Fitted, scan: &bare::Scan, options: &RegisterOptions) -> Result<(), StageError> {
    let trusted = fitted.held_out_rms < options.rms_limit_mm
        && fitted.rms < options.rms_limit_mm
        && fitted.inlier_fraction > options.inlier_limit
        && fitted.predicted_error < options.error_limit_mm;
    if trusted {
        return Ok(());
    }
    let worst = fitted.worst_place(scan);
    let place = worst.as_ref().map_or(String::new(), |w| {
        format!(
            "; worst in the third {}, about ({:.0}, {:.0}, {:.0}) mm of the scan, {:.1} mm {} the CT bone",
            ["nearest the cut end", "midway", "farthest from the cut end"][w.third],
            w.point.x,
            w.point.y,
            w.point.z,
            w.residual.abs(),
            if w.residual > 0.0 { "outside" } else { "inside" }
        )
    });
    let what = format!(
        "the scan does not fit the CT bone: bare bone kept out of the fit lies {} from it and that of the fit {} (rms, limit {:.2}), {:.0} % \
         of the bone-like scan lies on it (limit {:.0} %), predicted mean error {} (limit {:.2}){place}; \
         check that scan and CT are the same bone of the same knee, in mm, at one scale (the distance of slices counts, too) and not mirrored (two columns exchanged mirror a bone)",
        length(fitted.held_out_rms),
        length(fitted.rms),
        options.rms_limit_mm,
        100.0 * fitted.inlier_fraction,
        100.0 * options.inlier_limit,
        length(fitted.predicted_error),
        options.error_limit_mm,
    );
    // told in the scan's frame, marked in that of CT
    let mark = |p: &Point| Mark { name: String::new(), place: (fitted.pose * p).into() };
    Err(StageError::At { what, marks: worst.iter().map(|w| mark(&w.point)).collect() })
}
