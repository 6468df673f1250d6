//! Stage 4, cartilage: registered scan minus CT bone, made usable.

mod boolean;
mod field;
mod mri;
mod parting;
mod region;
pub mod regions;
mod solid;
mod thin_rim;
mod vertices;

use crate::PerBone;
use crate::bones::Bones;
use crate::register::{BoneRegistration, Registration};
use crate::specimen::Specimen;
use crate::{PerCartilage, StageError};
use field::Domain;
use meshes::frame::Side;
use meshes::measure::{edge_quality, percentile};
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::{Point, Vector};
use notices::{Kind, Notice};
use region::Patch;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A closed cartilage solid, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CartilageSolid {
    /// The closed surface, outward normals.
    pub solid: TriMesh,
    /// Per triangle: true on the articular face (side walls included), false on the bony face.
    pub articular: Vec<bool>,
    /// Thickness at each vertex, along the bone's normal [mm]; 0 on the rim.
    pub thickness_mm: Vec<f64>,
}

/// The three cartilages.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cartilage {
    /// The solids.
    pub solids: PerCartilage<CartilageSolid>,
    /// Menisci, the patella's cartilage and what else MRI shows: carried along, CT frame.
    #[serde(default)]
    pub bodies: BTreeMap<String, TriMesh>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: CartilageMetrics,
}

/// Figures of the cartilages, for metrics.json.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CartilageMetrics {
    /// The solids.
    #[serde(flatten)]
    pub solids: PerCartilage<SolidMetrics>,
    /// Scatter of the scan about bare bone [mm]; none where MRI shows the cartilage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bare_bone_sd_mm: Option<PerBone<f64>>,
    /// Volumes of what else MRI shows [mm3].
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub bodies_volume_mm3: BTreeMap<String, f64>,
}

/// Figures of a cartilage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SolidMetrics {
    /// Volume [mm3].
    pub volume_mm3: f64,
    /// Volume as the file gives it [mm3], where it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub given_volume_mm3: Option<f64>,
    /// Mean thickness over the bony face [mm].
    pub thickness_mean_mm: f64,
    /// 95 % of the vertices of the bony face have less [mm].
    pub thickness_p95_mm: f64,
    /// Area of the articular face [mm2].
    pub area_articular_mm2: f64,
    /// Area of the bony face [mm2].
    pub area_bony_mm2: f64,
    /// Triangles.
    pub triangles: usize,
    /// Median edge [mm].
    pub edge_p50_mm: f64,
    /// Smallest angle [deg].
    pub min_angle_deg: f64,
}

/// How scan and bone are made cartilage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CartilageMethod {
    /// What the scan has above each vertex of the bone, thresholded above the noise of bare bone.
    #[default]
    ThicknessField,
    /// The closed scan minus the bone, cleaned [andreassen2025, sec. 2.3].
    Boolean,
}

/// How cartilage is told from bone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CartilageOptions {
    /// Thickness field, or Boolean difference; cartilage of MRI is a field whatever stands here.
    pub method: CartilageMethod,
    /// Least thickness that is cartilage [mm]; CT segmentation errs by up to 0.47 mm (Wang 2009).
    pub least_thickness_mm: f64,
    /// The same as a multiple of the noise on bare bone, where that is more [-]; our own choice.
    pub least_thickness_sd: f64,
    /// The same for the rim of what is cartilage without doubt; half of it where the scan itself steps down from the rim [mm]; our own trials.
    pub rim_thickness_mm: f64,
    /// How many vertices wide such a rim is looked for, edges of about 0.7 mm [-]; our own trials.
    pub rim_rings: usize,
    /// Thickness a patch must reach over a quarter of its area to be cartilage at all [mm]; our own choice.
    pub seed_thickness_mm: f64,
    /// Largest thickness looked for [mm]; patellar cartilage, the thickest, stays below.
    pub reach_mm: f64,
    /// Widest cleft between bone and cartilage that is bridged [mm]; overhanging rims of the published solids.
    pub cleft_mm: f64,
    /// Least area of a cartilage [mm2]; well above a screw or sticker, well below a plateau.
    pub least_area_mm2: f64,
    /// Largest bare island within cartilage that is taken for a hole of the scan or a defect and covered [mm2].
    pub island_area_mm2: f64,
    /// Thickness at which cartilage of MRI ends [mm]; its bare bone has no noise. Our own trials, by volumes.
    pub mri_least_thickness_mm: f64,
    /// Rounds of smoothing of the thickness field before its rim is drawn [-]; our own trials.
    pub rim_smoothing_rounds: usize,
    /// Wanted edge length of the solids [mm]; below the hexahedra's.
    pub edge_mm: f64,
}

impl Default for CartilageOptions {
    fn default() -> Self {
        CartilageOptions {
            method: CartilageMethod::ThicknessField,
            least_thickness_mm: 0.5,
            least_thickness_sd: 4.0,
            rim_thickness_mm: 0.3,
            rim_rings: 3,
            seed_thickness_mm: 1.0,
            reach_mm: 9.0,
            cleft_mm: 1.5,
            least_area_mm2: 150.0,
            island_area_mm2: 80.0,
            mri_least_thickness_mm: 0.3,
            rim_smoothing_rounds: 4,
            edge_mm: 0.9,
        }
    }
}

/// Makes the three cartilage solids: what the registered scan has on top of the bone.
///
/// A plain Boolean difference of the two surfaces is exact and useless: outside the cartilage they nearly coincide, and their noise
/// leaves hundreds of specks; `options.method` has it on a bone that was moved first. By default each
/// vertex of the bone looks along its normal for the scan's outermost wall (clefts bridged); that thickness field is thresholded above the noise found on bare bone, with hysteresis by patch, smoothed,
/// cut along its level line, extruded, and fitted to the scan. Colours are not used.
/// Where MRI shows the cartilage, it is the field between bone and cover, or up to the surface given, that is cut and extruded.
///
/// Errors: no cartilage of the expected size on a bone; a solid that cannot be closed.
pub fn cartilage(
    specimen: &Specimen,
    registration: &Registration,
    bones: &Bones,
    options: &CartilageOptions,
) -> Result<Cartilage, StageError> {
    check(options)?;
    let options = &for_size(options, &specimen.ct.femur);
    let mut made = match &specimen.mri {
        Some(shown) => mri::of_mri(specimen, shown, registration, bones, options)?,
        None => of_scans(specimen, registration, bones, options)?,
    };
    made.warnings.extend(too_thick(&made.metrics.solids));
    made.warnings.extend(one_condyle(&made.solids));
    Ok(made)
}

/// A condyle with less than this share of the femur's cartilage is bare [-]: 40 to 50 % is usual, a worn one keeps its back. Ours.
const LEAST_SHARE: f64 = 0.2;

/// Names a condyle that is as good as bare.
fn one_condyle(solids: &PerCartilage<CartilageSolid>) -> Option<Notice> {
    let middle = |s: &CartilageSolid| {
        let sum = s.solid.vertices.iter().map(|p| p.coords).sum::<Vector>();
        Point::from(sum / s.solid.vertices.len().max(1) as f64)
    };
    let (medial, lateral) = (middle(&solids.tibia_medial), middle(&solids.tibia_lateral));
    let centre = nalgebra::center(&medial, &lateral);
    let femoral = &solids.femur.solid;
    let [mut of_medial, mut whole] = [0.0; 2];
    for triangle in 0..femoral.triangles.len() {
        let [a, b, c] = femoral.corners(triangle);
        let area = (b - a).cross(&(c - a)).norm();
        whole += area;
        if ((a.coords + b.coords + c.coords) / 3.0 - centre.coords).dot(&(medial - lateral)) > 0.0 {
            of_medial += area;
        }
    }
    let share = of_medial / whole;
    let (least, name) = if share < 0.5 { (share, "medial") } else { (1.0 - share, "lateral") };
    (least < LEAST_SHARE).then(|| {
        Kind::OneCondyle.notice(format!(
            "femur: {:.0} % of its cartilage lies on the {name} side, expected {:.0} % or more: a label or surface is missing (some programs give each condyle its own; name both), or that condyle is worn to the bone",
            100.0 * least, 100.0 * LEAST_SHARE
        )).of("femur")
    })
}

/// No cartilage of a tibia or femur is so thick over a twentieth of its area [mm]: the thickest plateaus reach 5 to 6 at one spot. Ours.
const THICKEST_MM: f64 = 6.0;

/// Names cartilages that are none by their thickness.
fn too_thick(solids: &PerCartilage<SolidMetrics>) -> Vec<Notice> {
    let named =
        [("femur", &solids.femur), ("tibia_medial", &solids.tibia_medial), ("tibia_lateral", &solids.tibia_lateral)];
    let thick = named.into_iter().filter(|(_, m)| m.thickness_p95_mm > THICKEST_MM);
    thick
        .map(|(name, m)| {
            Kind::TooThick.notice(format!(
                "{name}: {:.1} mm thick over a twentieth of its area, where cartilage is at most {THICKEST_MM}: an implant's insert, a meniscus, or a label of more than cartilage",
                m.thickness_p95_mm
            )).of(name)
        })
        .collect()
}

/// The solids of a dissected knee.
fn of_scans(
    specimen: &Specimen,
    registration: &Registration,
    bones: &Bones,
    options: &CartilageOptions,
) -> Result<Cartilage, StageError> {
    let femur = Covered {
        name: "femur",
        count: 1,
        facing: None,
        scan: &specimen.scans.femur,
        ct: &specimen.ct.femur,
        fit: &registration.bones.femur,
        bone: &bones.surfaces.femur,
    };
    let tibfib = Covered {
        name: "tibfib",
        count: 2,
        // plateaus face the femur; what else lies on the tibia (the fibula, a stump) does not
        facing: towards_femur(bones),
        scan: &specimen.scans.tibfib,
        ct: &specimen.ct.tibfib,
        fit: &registration.bones.tibfib,
        bone: &bones.surfaces.tibfib,
    };
    let one = match options.method {
        CartilageMethod::ThicknessField => of_bone,
        CartilageMethod::Boolean => boolean::of_bone,
    };
    let (femur, tibfib) = rayon::join(|| one(&femur, options), || one(&tibfib, options));
    let (femur, tibfib) = (femur?, tibfib?);
    let noise = PerBone { femur: femur.bare_sd, tibfib: tibfib.bare_sd };
    let warnings: Vec<Notice> = femur.warnings.into_iter().chain(tibfib.warnings).collect();
    let made: Vec<(CartilageSolid, Point)> = femur.solids.into_iter().chain(tibfib.solids).collect();
    let [femur, first, second]: [(CartilageSolid, Point); 3] =
        made.try_into().map_err(|_| StageError::part("cartilage", "not three solids"))?;
    let lateral = lateral(specimen.identity.side, bones, &femur.0.solid, &first.1, &second.1).ok_or_else(|| {
        StageError::part("cartilage", "medial and lateral cannot be told: check that both bones are of one knee and lie in one frame, none shifted or turned against the other")
    })?;
    let turned = (first.1 - second.1).dot(&lateral) > 0.0;
    let (medial, outer) = if turned { (second.0, first.0) } else { (first.0, second.0) };
    let solids = PerCartilage { femur: femur.0, tibia_medial: medial, tibia_lateral: outer };
    let metrics = CartilageMetrics {
        solids: solids.map(grades),
        bare_bone_sd_mm: Some(noise),
        bodies_volume_mm3: BTreeMap::new(),
    };
    Ok(Cartilage { solids, bodies: BTreeMap::new(), warnings, metrics })
}

/// Width of the knee that areas and thicknesses of the options are meant for [mm], and the least that an adult's has: `ingest` has both.
const KNEE_WIDTH_MM: f64 = 85.0;
const LEAST_ADULT_MM: f64 = 60.0;

/// The options for a knee smaller than any adult's: areas and thicknesses shrink with it, as what they tell apart does.
fn for_size(options: &CartilageOptions, femur: &TriMesh) -> CartilageOptions {
    let width = crate::ingest::middle_extent(femur);
    let size = if width < LEAST_ADULT_MM { width / KNEE_WIDTH_MM } else { 1.0 };
    CartilageOptions {
        least_area_mm2: options.least_area_mm2 * size * size,
        island_area_mm2: options.island_area_mm2 * size * size,
        seed_thickness_mm: (options.seed_thickness_mm * size)
            .max(options.least_thickness_mm.min(options.seed_thickness_mm)),
        ..options.clone()
    }
}

/// Cartilages of a bone.
struct Made {
    /// Each with its middle, the largest first.
    solids: Vec<(CartilageSolid, Point)>,
    /// Scatter of the scan about bare bone [mm].
    bare_sd: f64,
    warnings: Vec<Notice>,
}

/// A bone with its cartilages.
struct Covered<'a> {
    name: &'static str,
    /// How many cartilages it has.
    count: usize,
    /// The direction that theirs look in.
    facing: Option<Vector>,
    scan: &'a ColouredMesh,
    /// As CT gave it.
    ct: &'a TriMesh,
    fit: &'a BoneRegistration,
    /// As the model has it.
    bone: &'a TriMesh,
}

/// The largest cartilages of a bone.
fn of_bone(of: &Covered, options: &CartilageOptions) -> Result<Made, StageError> {
    let Covered { name, count, facing, .. } = *of;
    let mut warnings = Vec::new();
    let scan = of.fit.ct_from_scan.mesh(&of.scan.mesh);
    let edge_mm = edge_quality(of.ct).edge_p50_mm;
    let domain = Domain::new(of.bone, &scan, edge_mm, options).ok_or_else(|| {
        StageError::part("cartilage", format_args!("the bone or the scan of the {name} has no triangles"))
    })?;
    let least = options.least_thickness_mm.max(options.least_thickness_sd * domain.bare_sd);
    let (patches, parted) = region::patches(&domain, least, facing, options);
    if parted {
        let what = "the cartilages of both plateaus had run together and were parted where they are thinnest";
        warnings.push(Kind::PlateausParted.notice(format!("{name}: {what}")).of(name));
    }
    if patches.len() < count {
        return Err(StageError::Knee(format!(
            "cartilage: {} found on the {name}, expected {count}: no further patch of at least {} mm2 lies {least:.2} mm \
             to {} mm above the bone; check the registration and that the scan shows cartilage, not an implant",
            patches.len(),
            options.least_area_mm2,
            options.reach_mm
        )));
    }
    if patches.len() > count {
        warnings.push(
            Kind::SmallerPatches
                .notice(format!("{name}: {} smaller patches above the bone left out", patches.len() - count))
                .of(name),
        );
    }
    let solid = |p: &_| Ok((solid::solid(name, p, &scan, options)?, p.centre()));
    let solids = patches[..count].iter().map(solid).collect::<Result<_, StageError>>()?;
    Ok(Made { solids, bare_sd: domain.bare_sd, warnings })
}

/// Refuses options that mean nothing, before any work.
///
/// # Errors
/// The option, its value and what is expected.
pub fn check(options: &CartilageOptions) -> Result<(), StageError> {
    for (name, value, least) in [
        ("least_thickness_mm", options.least_thickness_mm, 0.01),
        ("reach_mm", options.reach_mm, 1.0),
        ("edge_mm", options.edge_mm, 0.2),
    ] {
        if !(value >= least && value.is_finite()) {
            return Err(StageError::option(
                format_args!("cartilage.{name}"),
                value,
                format_args!("{least} mm or more"),
            ));
        }
    }
    Ok(())
}

/// From the tibia's centroid to the femur's, unit.
fn towards_femur(bones: &Bones) -> Option<Vector> {
    (bones.surfaces.femur.centroid()? - bones.surfaces.tibfib.centroid()?).try_normalize(1e-9)
}

/// Lateral, as far as it tells two plateaus with centres `first` and `second` apart; needs no fibula.
///
/// Forwards is where the femoral cartilage crosses the plane between the plateaus: the trochlea does, behind it lies the notch.
/// Up is from tibia to femur; the declared side then says which way is lateral.
fn lateral(side: Side, bones: &Bones, femoral: &TriMesh, first: &Point, second: &Point) -> Option<Vector> {
    let across = (first - second).try_normalize(1e-9)?;
    let middle = nalgebra::center(first, second);
    let superior = towards_femur(bones)?;
    let whole = femoral.centroid()?;
    let halfway = (first - second).norm() / 4.0;
    let between = |t: usize| femoral.corners(t).iter().all(|p| (p - middle).dot(&across).abs() < halfway);
    let forwards = femoral.submesh(between).0.centroid()? - whole;
    let flat = forwards - across * forwards.dot(&across);
    let anterior = (flat - superior * flat.dot(&superior)).try_normalize(1e-6)?;
    Some(match side {
        Side::Right => anterior.cross(&superior),
        Side::Left => superior.cross(&anterior),
    })
}

fn grades(part: &CartilageSolid) -> SolidMetrics {
    let bony = part.solid.submesh(|t| !part.articular[t]);
    let weight = bony.0.vertex_areas();
    let mut thickness: Vec<f64> = bony.1.iter().map(|&v| part.thickness_mm[v as usize]).collect();
    let mean = thickness.iter().zip(&weight).map(|(t, w)| t * w).sum::<f64>() / weight.iter().sum::<f64>().max(1e-12);
    let quality = edge_quality(&part.solid);
    SolidMetrics {
        volume_mm3: part.solid.volume(),
        given_volume_mm3: None,
        thickness_mean_mm: mean,
        thickness_p95_mm: percentile(&mut thickness, 0.95),
        area_articular_mm2: part.solid.submesh(|t| part.articular[t]).0.area(),
        area_bony_mm2: bony.0.area(),
        triangles: part.solid.triangles.len(),
        edge_p50_mm: quality.edge_p50_mm,
        min_angle_deg: quality.min_angle_deg,
    }
}

impl Patch {
    /// Mean of its vertices.
    fn centre(&self) -> Point {
        let sum: Vector = self.bone.vertices.iter().map(|p| p.coords).sum();
        Point::from(sum / self.bone.vertices.len().max(1) as f64)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use meshes::shapes::icosphere;

    #[test]
    fn a_condyle_without_cartilage_is_told_on_its_side() {
        let at = |centres: &[f64]| {
            let mut solid = TriMesh::default();
            for x in centres {
                let ball = icosphere(15.0, 2);
                let n = solid.vertices.len() as u32;
                solid.vertices.extend(ball.vertices.iter().map(|p| p + Vector::new(*x, 0.0, 0.0)));
                solid.triangles.extend(ball.triangles.iter().map(|t| t.map(|v| v + n)));
            }
            CartilageSolid { solid, articular: Vec::new(), thickness_mm: Vec::new() }
        };
        let told = |femur: &[f64]| {
            let solids = PerCartilage { femur: at(femur), tibia_medial: at(&[22.0]), tibia_lateral: at(&[-22.0]) };
            one_condyle(&solids).map(|n| n.text)
        };
        assert_eq!(told(&[22.0, -22.0]), None);
        assert_eq!(told(&[22.0, 0.0, -22.0]), None);
        assert!(told(&[22.0]).unwrap().contains("on the lateral side"));
        assert!(told(&[-22.0]).unwrap().contains("on the medial side"));
    }
}
