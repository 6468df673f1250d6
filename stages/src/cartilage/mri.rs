//! Cartilage as MRI shows it: about bone and cartilage, or cartilage alone, on the model's bone.

use super::field::Domain;
use super::vertices::mean;
use super::{Cartilage, CartilageOptions, CartilageSolid, grades, lateral, region, solid};
use super::{CartilageMetrics, SolidMetrics};
use crate::bones::Bones;
use crate::register::{BoneRegistration, Registration};
use crate::specimen::{Mri, Specimen};
use crate::{PerCartilage, StageError};
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Isometry, Point};
use notices::{Kind, Notice};
use std::collections::BTreeMap;

/// A solid whose volume differs by more than this share from what was given is told [-].
const VOLUME_SHARE: f64 = 0.1;

/// A cartilage with its bone and how both lie.
struct Shown<'a> {
    name: &'static str,
    key: &'static str,
    cover: &'a TriMesh,
    /// The bone as MRI shows it, where the cover goes about it.
    bare: Option<&'a TriMesh>,
    pose: Isometry,
    bone: &'a TriMesh,
    given_mm3: f64,
}

/// Makes the three solids from what MRI shows.
pub(super) fn of_mri(
    specimen: &Specimen,
    mri: &Mri,
    registration: &Registration,
    bones: &Bones,
    options: &CartilageOptions,
) -> Result<Cartilage, StageError> {
    let pose = |fit: &BoneRegistration| *fit.ct_from_scan.motion();
    let [femur, tibia] = [pose(&registration.bones.femur), pose(&registration.bones.tibfib)];
    let shown = |name, key, cover, given_mm3| {
        let of_femur = name == "femur";
        let bare = if of_femur { &specimen.scans.femur.mesh } else { &specimen.scans.tibfib.mesh };
        Shown {
            name,
            key,
            cover,
            bare: mri.with_bone.then_some(bare),
            pose: if of_femur { femur } else { tibia },
            bone: if of_femur { &bones.surfaces.femur } else { &bones.surfaces.tibfib },
            given_mm3,
        }
    };
    let (covers, given) = (&mri.covers, &mri.given_mm3);
    let parts = [
        shown("femur", "femoral cartilage", &covers.femur, given.femur),
        shown("tibfib", "medial tibial cartilage", &covers.tibia_medial, given.tibia_medial),
        shown("tibfib", "lateral tibial cartilage", &covers.tibia_lateral, given.tibia_lateral),
    ];
    let [(f, (m, l))] = [rayon::join(
        || one(&parts[0], options),
        || rayon::join(|| one(&parts[1], options), || one(&parts[2], options)),
    )];
    let mut warnings = Vec::new();
    let mut take = |made: Result<(CartilageSolid, Point, Vec<Notice>), StageError>| {
        let (solid, centre, notes) = made?;
        warnings.extend(notes);
        Ok::<_, StageError>((solid, centre))
    };
    let (femur_solid, medial, outer) = (take(f)?, take(m)?, take(l)?);
    check_sides(specimen, bones, &femur_solid.0.solid, &medial.1, &outer.1)?;
    let solids = PerCartilage { femur: femur_solid.0, tibia_medial: medial.0, tibia_lateral: outer.0 };
    let bodies: BTreeMap<String, TriMesh> = mri
        .bodies
        .iter()
        .map(|(name, mesh)| (name.clone(), mesh.moved(if name.starts_with("meniscus") { &tibia } else { &femur })))
        .collect();
    let of = |solid, given: &f64| SolidMetrics { given_volume_mm3: Some(*given), ..grades(solid) };
    let metrics = CartilageMetrics {
        solids: PerCartilage {
            femur: of(&solids.femur, &given.femur),
            tibia_medial: of(&solids.tibia_medial, &given.tibia_medial),
            tibia_lateral: of(&solids.tibia_lateral, &given.tibia_lateral),
        },
        bare_bone_sd_mm: None,
        bodies_volume_mm3: bodies.iter().map(|(name, mesh)| (name.clone(), mesh.volume())).collect(),
    };
    Ok(Cartilage { solids, bodies, warnings, metrics })
}

/// Refuses cartilages of which the one called medial lies laterally.
fn check_sides(
    specimen: &Specimen,
    bones: &Bones,
    femoral: &TriMesh,
    medial: &Point,
    outer: &Point,
) -> Result<(), StageError> {
    let Some(lateral) = lateral(specimen.identity.side, bones, femoral, medial, outer) else {
        return Err(StageError::part(
            "cartilage",
            "medial and lateral cannot be told: check that both bones are of one knee and lie in one frame, none shifted or turned against the other",
        ));
    };
    if (outer - medial).dot(&lateral) > 0.0 {
        return Ok(());
    }
    Err(StageError::part("cartilage", format!("what is given as the medial tibial cartilage lies on the lateral side of a {:?} knee: the side in specimen.toml is wrong, the two are exchanged, or the picture is a mirror image",
        specimen.identity.side
    ).to_lowercase()))
}

fn one(of: &Shown, options: &CartilageOptions) -> Result<(CartilageSolid, Point, Vec<Notice>), StageError> {
    let mut notes = Vec::new();
    let cover = of.cover.moved(&of.pose);
    let domain = match of.bare {
        Some(bare) => covered(of.bone, &bare.moved(&of.pose), &cover, options),
        None => layered(of.bone, &cover, options),
    }
    .ok_or_else(|| StageError::part("cartilage", format_args!("the bone or the {} has no triangles", of.key)))?;
    let least = options.mri_least_thickness_mm;
    // Bare bone is bare to the last digit here, so no margin is needed against its noise.
    let limits = CartilageOptions { rim_thickness_mm: least, rim_smoothing_rounds: 1, ..options.clone() };
    let (patches, _) = region::patches(&domain, least, None, &limits);
    let Some(patch) = patches.first() else {
        return Err(StageError::part(
            "cartilage",
            format_args!(
                "no {} of {} mm2 or more and at most {} mm thick lies on the {}; check which label or surface it is (an implant's insert is none), and that bone and cartilage touch",
                of.key, options.least_area_mm2, options.reach_mm, of.name
            ),
        ));
    };
    if patches.len() > 1 {
        notes.push(
            Kind::SmallerPieces
                .notice(format!("{}: {} smaller pieces left out: a solid is one piece", of.key, patches.len() - 1))
                .of(of.key)
                .count(patches.len() - 1),
        );
    }
    let solid = solid::solid(of.name, patch, &cover, options)?;
    let volume = solid.solid.volume();
    if of.given_mm3 > 0.0 && (volume / of.given_mm3 - 1.0).abs() > VOLUME_SHARE {
        notes.push(Kind::CartilageVolume.notice(format!(
            "{}: {volume:.0} mm3 on the bone, {:.0} mm3 were given: look for cartilage off the bone, or a hole in it",
            of.key, of.given_mm3
        )).of(of.key));
    }
    Ok((solid, patch.centre(), notes))
}

/// The field between the bone as MRI shows it and the surface about bone and cartilage.
fn covered(bone: &TriMesh, bare: &TriMesh, cover: &TriMesh, options: &CartilageOptions) -> Option<Domain> {
    let (walls, bare) = (SurfaceQuery::new(cover)?, SurfaceQuery::new(bare)?);
    Domain::above(bone, options, |p, n, reach| {
        let [cleft, outer] = super::field::extent(&walls, p, n, reach, options.cleft_mm)?;
        let inner = super::field::extent(&bare, p, n, reach, options.cleft_mm).map_or(0.0, |x| x[1]);
        Some([cleft.max(inner), outer.max(inner)])
    })
}

/// The field up to a surface of cartilage alone, closed or open.
fn layered(bone: &TriMesh, cover: &TriMesh, options: &CartilageOptions) -> Option<Domain> {
    let walls = SurfaceQuery::new(cover)?;
    let closed = Topology::of(cover).is_closed();
    Domain::above(bone, options, |p, n, reach| {
        let mut from = -1.0;
        let mut begin = None;
        let mut end = None;
        for _ in 0..8 {
            let Some(hit) = walls.ray(&(p + n * from), n, reach - from) else { break };
            let height = from + hit.distance;
            from = height + 1e-6;
            if begin.is_none() && height > options.cleft_mm && closed {
                break;
            }
            begin.get_or_insert(height);
            if !closed || walls.normal(hit.triangle).dot(n) > 0.0 {
                end = Some(height);
            }
        }
        Some([0.0, end.unwrap_or(0.0).max(0.0)])
    })
}

impl Domain {
    /// The field of `heights` above each vertex of the bone: from where to where cartilage goes [mm], within a reach.
    fn above(
        bone: &TriMesh,
        options: &CartilageOptions,
        heights: impl Fn(&Point, &meshes::Vector, f64) -> Option<[f64; 2]> + Sync,
    ) -> Option<Domain> {
        use rayon::prelude::*;
        let (bone, neighbours, normals, reach) = super::field::looking_out(bone, options.reach_mm)?;
        let seen: Vec<[f64; 2]> = (0..bone.vertices.len())
            .into_par_iter()
            .map(|v| heights(&bone.vertices[v], &normals[v], reach[v]).unwrap_or([0.0; 2]))
            .collect();
        let inner: Vec<f64> = seen.iter().map(|s| s[0]).collect();
        // The bony face follows the bone, not the triangles of the surface above it.
        let inner = (0..inner.len()).map(|v| 0.5 * inner[v] + 0.5 * mean(&inner, &neighbours[v], inner[v])).collect();
        let outer = seen.iter().map(|s| s[1]).collect();
        let thin_rim = vec![false; bone.vertices.len()];
        Some(Domain { bone, neighbours, normals, inner, outer, bare_sd: 0.0, thin_rim })
    }
}
