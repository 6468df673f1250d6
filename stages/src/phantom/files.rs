//! The files of a phantom: what a laboratory would hand over, and the truth.

use super::bone::{CT_NOISE, Measured, SCAN_NOISE, Solid};
use super::shape::{self, Cover};
use super::volume::{Scanner, ct_volume};
use super::{Recipe, unit_cube};
use crate::StageError;
use formats::{nifti, ply, stl};
use meshes::frame::Side;
use meshes::surface::TriMesh;
use meshes::{Isometry, Point, Vector};
use rand_chacha::ChaCha8Rng;
use serde_json::{Map, Value, json};
use std::fmt::Write;

type Files = Vec<(String, Vec<u8>)>;

/// Every file of the specimen.
pub(super) fn specimen(
    recipe: &Recipe,
    bones: [&Solid; 2],
    measured: &[Measured; 2],
    rng: &mut ChaCha8Rng,
) -> Result<Files, StageError> {
    let fail = |e: &dyn std::fmt::Display| StageError::Knee(format!("phantom {}: {e}", recipe.id));
    let mut files: Files = vec![("specimen.toml".into(), specimen_toml(recipe).into_bytes())];
    for (bone, seen) in bones.iter().zip(measured) {
        let name = bone.plan.name;
        files.push((format!("ct/{name}.stl"), stl_bytes(&seen.ct).map_err(|e| fail(&e))?));
        let mut scan = Vec::new();
        ply::write_coloured(&mut scan, &seen.scan).map_err(|e| fail(&e))?;
        files.push((format!("scans/{name}.ply"), scan));
    }
    files.push(("landmarks.csv".into(), landmarks(bones, measured, rng).into_bytes()));
    files.push(("marks.csv".into(), marks(bones, measured, rng).into_bytes()));
    for bone in bones {
        for (cover, solid) in &bone.cartilage {
            let solid = solid.moved(&bone.ct_from_knee);
            files.push((format!("truth/{}.stl", cover_name(*cover)), stl_bytes(&solid).map_err(|e| fail(&e))?));
        }
    }
    let truth = serde_json::to_vec_pretty(&truth(recipe, bones, measured)).map_err(|e| fail(&e))?;
    files.push(("truth/truth.json".into(), truth));
    Ok(files)
}

/// Puts a CT volume in place of the CT surfaces; the true surfaces, and a patella's, go to `truth/`.
pub(super) fn with_volume(files: &mut Files, bones: [&Solid; 2], seed: u64) -> Result<(), StageError> {
    let [femur, tibfib] = bones.map(Solid::in_ct);
    let patella = shape::patella();
    let place = |p: &Point| bones[0].ct_from_knee * bones[0].knee(p);
    let mut patella = TriMesh { vertices: patella.vertices.iter().map(place).collect(), triangles: patella.triangles };
    if patella.volume() < 0.0 {
        patella = patella.flipped();
    }
    let fail = |e: &dyn std::fmt::Display| StageError::Knee(format!("phantom: {e}"));
    let volume = ct_volume(&[&femur, &tibfib, &patella], &Scanner::default(), seed)
        .ok_or_else(|| fail(&"the picture came out empty"))?;
    let mut bytes = Vec::new();
    nifti::write(&mut bytes, &volume).map_err(|e| fail(&e))?;
    files.retain(|(name, _)| !name.starts_with("ct/"));
    files.push(("ct/knee.nii.gz".into(), bytes));
    for (name, mesh) in [("femur", &femur), ("tibfib", &tibfib), ("patella", &patella)] {
        files.push((format!("truth/ct_{name}.stl"), stl_bytes(mesh).map_err(|e| fail(&e))?));
    }
    if let Some((_, bytes)) = files.iter_mut().find(|(name, _)| name == "specimen.toml") {
        let text = String::from_utf8_lossy(bytes);
        let surfaces = "femur = \"ct/femur.stl\"\ntibfib = \"ct/tibfib.stl\"";
        *bytes = text.replace(surfaces, "volume = \"ct/knee.nii.gz\"").into_bytes();
    }
    Ok(())
}

pub(super) fn cover_name(cover: Cover) -> &'static str {
    match cover {
        Cover::Femur => "femur",
        Cover::Medial => "tibfib_medial",
        Cover::Lateral => "tibfib_lateral",
    }
}

pub(super) fn stl_bytes(mesh: &TriMesh) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    stl::write(&mut bytes, mesh)?;
    Ok(bytes)
}

fn specimen_toml(recipe: &Recipe) -> String {
    let side = if recipe.side == Side::Left { "left" } else { "right" };
    format!(
        "[specimen]\nid = \"{}\"\nside = \"{side}\"\nprovenance = \"synthetic\"\nnote = \"A phantom: smooth implicit bones with cartilage, measured with noise, screws, stickers, holes and marks. It is nobody's knee. truth/ holds the answers.\"\n\n[ct]\nfemur = \"ct/femur.stl\"\ntibfib = \"ct/tibfib.stl\"\n\n[scans]\nfemur = \"scans/femur.ply\"\ntibfib = \"scans/tibfib.ply\"\n\n[points]\nlandmarks = \"landmarks.csv\"\nmarks = \"marks.csv\"\n",
        recipe.id
    )
}

/// A displacement no longer than `reach` [mm].
fn rough(reach: f64, rng: &mut ChaCha8Rng) -> Vector {
    unit_cube(rng) * (reach / 3f64.sqrt())
}

fn row(text: &mut String, name: &str, frame: &str, p: &Point) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{name},{frame},{:.3},{:.3},{:.3}", p.x, p.y, p.z);
}

/// The femoral head's centre in the femur's shape.
const HEAD: [f64; 3] = [-8.0, 6.0, 440.0];

fn landmarks(bones: [&Solid; 2], measured: &[Measured; 2], rng: &mut ChaCha8Rng) -> String {
    let mut text = "name,frame,x_mm,y_mm,z_mm\n".to_string();
    for (bone, seen) in bones.iter().zip(measured) {
        for (k, place) in bone.plan.landmarks.iter().enumerate() {
            let p = bone.ct_from_knee * bone.bone.vertices[bone.vertex(*place)];
            let name = format!("{}_{}", bone.plan.name, k + 1);
            row(&mut text, &name, "ct", &(p + rough(2.2, rng)));
            let scan = seen.ct_from_scan.inverse() * (p + rough(2.2, rng));
            row(&mut text, &name, &format!("scan_{}", bone.plan.name), &scan);
        }
    }
    let [femur, tibfib] = bones;
    row(&mut text, "femoral_head_center", "ct", &(femur.ct_from_knee * femur.knee(&Point::from(HEAD))));
    let distal = tibfib.knee(&Point::new(0.0, 5.0, shape::TIBIA_CUT));
    row(&mut text, "tibial_shaft_distal", "ct", &(tibfib.ct_from_knee * distal));
    text
}

fn marks(bones: [&Solid; 2], measured: &[Measured; 2], rng: &mut ChaCha8Rng) -> String {
    let mut text = "ligament,frame,x_mm,y_mm,z_mm\n".to_string();
    for (bone, seen) in bones.iter().zip(measured) {
        for site in bone.sites.iter().filter(|s| s.marked) {
            let p = seen.ct_from_scan.inverse() * (bone.ct_from_knee * site.centroid);
            row(&mut text, site.ligament, &format!("scan_{}", bone.plan.name), &(p + rough(3.5, rng)));
        }
    }
    text
}

fn triple(v: &Vector) -> Value {
    json!([v.x, v.y, v.z])
}

fn truth(recipe: &Recipe, bones: [&Solid; 2], measured: &[Measured; 2]) -> Value {
    let (mut poses, mut sites, mut volumes) = (Map::new(), Map::new(), Map::new());
    for (bone, seen) in bones.iter().zip(measured) {
        let m = seen.ct_from_scan.to_homogeneous();
        let rows: Vec<Vec<f64>> = (0..4).map(|r| (0..4).map(|c| m[(r, c)]).collect()).collect();
        poses.insert(bone.plan.name.into(), json!(rows));
        for site in &bone.sites {
            let moved = |p: &Point| triple(&(bone.ct_from_knee * p).coords);
            let points: Vec<Value> = site.points.iter().map(moved).collect();
            sites.insert(
                format!("{}@{}", site.ligament, bone.plan.name),
                json!({"centroid": moved(&site.centroid), "points": points, "marked": site.marked}),
            );
        }
        for (cover, solid) in &bone.cartilage {
            volumes.insert(cover_name(*cover).into(), json!(solid.volume()));
        }
    }
    json!({
        "noise": {"ct_sd_mm": CT_NOISE.0, "ct_correlation_mm": CT_NOISE.1, "scan_sd_mm": SCAN_NOISE},
        "id": recipe.id,
        "source": "phantom: implicit bones, no person's data",
        "scan_to_ct": poses,
        "cartilage_volume_mm3": volumes,
        "sites_ct": sites,
        "frames_ct": frames(recipe.side, bones),
    })
}

fn frames(side: Side, [femur, tibfib]: [&Solid; 2]) -> Value {
    // The epicondyles: the most medial and most lateral points near the axis of the condyles.
    let near = |v: &&usize| femur.shape[**v].z.abs() < 12.0 && femur.shape[**v].y.abs() < 14.0;
    let all: Vec<usize> = (0..femur.shape.len()).collect();
    let by = |a: &&usize, b: &&usize| femur.shape[**a].x.total_cmp(&femur.shape[**b].x);
    let end = |v: Option<&usize>| v.map_or_else(Point::origin, |&v| femur.bone.vertices[v]);
    let (medial, lateral) = (end(all.iter().filter(near).min_by(by)), end(all.iter().filter(near).max_by(by)));
    let origin = nalgebra::center(&medial, &lateral);
    let head = femur.knee(&Point::from(HEAD));
    let across = if side == Side::Left { -Vector::x() } else { Vector::x() };
    json!({
        "femur": frame(side, &femur.ct_from_knee, origin, medial - lateral, head - origin),
        "tibia": frame(side, &tibfib.ct_from_knee, Point::origin(), across, Vector::z()),
    })
}

fn frame(side: Side, place: &Isometry, origin: Point, medial: Vector, up: Vector) -> Value {
    let medial = medial.normalize();
    let superior = (up - medial * up.dot(&medial)).normalize();
    let anterior = if side == Side::Left { superior.cross(&medial) } else { medial.cross(&superior) };
    json!({
        "origin": triple(&(place * origin).coords),
        "medial": triple(&(place * medial)),
        "anterior": triple(&(place * anterior)),
        "superior": triple(&(place * superior)),
    })
}
