//! Frames: against published axes, raters and phantoms; moved, mirrored and cropped.

use crate::built::Built;
use crate::knees::{Knee, shared};
use crate::page::{Limit, Section};
use crate::register::far;
use meshes::frame::{AnatomicalFrame, Side};
use meshes::plane::clipped;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use stages::PerBone;
use stages::anatomy::rough_axes;
use stages::bones::Bones;
use stages::frames::{Frames, FramesOptions, frames};
use stages::specimen::{PointFrame, Specimen};

pub(crate) fn section(knees: &[(&Knee, Built)]) -> Result<Section, String> {
    let mut page = Section::new(
        "Frames",
        "Consensus: the mean of five raters' epicondyles on femur z013. Axes of the specimens are the published ones (the tibia's construction is not told), \
         of the phantoms their truth. Without landmarks: all of them taken away.",
    );
    for (knee, built) in knees {
        published(&mut page, knee, &built.frames, 3.0, "");
        let mut bare = knee.specimen.clone();
        bare.landmarks.clear();
        published(&mut page, knee, &made(&bare)?, 10.0, " without landmarks");
        for (specimen, words) in [(&knee.specimen, ""), (&bare, " without landmarks")] {
            let case = format!("{}{words}", knee.name);
            page.add("moved knee against moved frame [mm, 1]", Limit::Most(1e-6), &case, moved(specimen)?);
            page.add("mirrored knee against mirrored frame [mm, 1]", Limit::Most(1e-6), &case, mirrored(specimen)?);
        }
    }
    raters(&mut page, knees)?;
    Ok(page)
}

fn made(specimen: &Specimen) -> Result<Frames, String> {
    let bones =
        Bones { surfaces: specimen.ct.clone(), patella: None, warnings: Vec::new(), metrics: Default::default() };
    frames(specimen, &bones, &FramesOptions::default()).map_err(|e| e.to_string())
}

fn degrees(a: &Vector, b: &Vector) -> f64 {
    a.cross(b).norm().atan2(a.dot(b)).to_degrees()
}

fn published(page: &mut Section, knee: &Knee, made: &Frames, superior: f64, words: &str) {
    let truth = |bone: &str| serde_json::from_value::<AnatomicalFrame>(knee.truth["frames_ct"][bone].clone());
    let (Ok(femur), Ok(tibia)) = (truth("femur"), truth("tibia")) else { return };
    let head = if superior < 5.0 { "head centre given" } else { "no landmarks" };
    let case = format!("{}{words}", knee.name);
    page.add("femoral medial axis [deg]", Limit::Most(4.0), &case, degrees(&made.femur.medial, &femur.medial));
    page.add(
        &format!("femoral superior axis, {head} [deg]"),
        Limit::Most(superior),
        &case,
        degrees(&made.femur.superior, &femur.superior),
    );
    let apart = |a: &AnatomicalFrame, b: &AnatomicalFrame| (a.origin - b.origin).norm();
    page.add("femoral origin [mm]", Limit::Most(5.0), &case, apart(&made.femur, &femur));
    page.add("tibial origin [mm]", Limit::Most(5.0), &case, apart(&made.tibia, &tibia));
    page.add("tibial medial axis [deg]", Limit::Most(10.0), &case, degrees(&made.tibia.medial, &tibia.medial));
    page.add("tibial superior axis [deg]", Limit::Most(12.0), &case, degrees(&made.tibia.superior, &tibia.superior));
}

fn changed(specimen: &Specimen, point: impl Fn(&Point) -> Point, mirror: bool) -> Specimen {
    let mut s = specimen.clone();
    for bone in [&mut s.ct.femur, &mut s.ct.tibfib] {
        bone.vertices.iter_mut().for_each(|p| *p = point(p));
        if mirror {
            *bone = std::mem::take(bone).flipped();
        }
    }
    s.landmarks.iter_mut().filter(|l| l.frame == PointFrame::Ct).for_each(|l| l.point = point(&l.point));
    if mirror {
        s.identity.side = if s.identity.side == Side::Left { Side::Right } else { Side::Left };
    }
    s
}

/// Largest difference between the frames of a knee, carried along, and those of the knee carried along.
fn difference(a: &Frames, b: &Frames, point: impl Fn(&Point) -> Point) -> f64 {
    let turned = |v: &Vector| point(&Point::from(*v)) - point(&Point::origin());
    let one = |a: &AnatomicalFrame, b: &AnatomicalFrame| {
        let axes = [(a.medial, b.medial), (a.anterior, b.anterior), (a.superior, b.superior)];
        let off = axes.iter().map(|(u, v)| (turned(u) - v).norm()).fold(0.0, f64::max);
        off.max((point(&a.origin) - b.origin).norm())
    };
    one(&a.femur, &b.femur).max(one(&a.tibia, &b.tibia))
}

fn moved(specimen: &Specimen) -> Result<f64, String> {
    let motion = far();
    let carry = |p: &Point| motion * p;
    Ok(difference(&made(specimen)?, &made(&changed(specimen, carry, false))?, carry))
}

fn mirrored(specimen: &Specimen) -> Result<f64, String> {
    let carry = |p: &Point| Point::new(-p.x, p.y, p.z);
    Ok(difference(&made(specimen)?, &made(&changed(specimen, carry, true))?, carry))
}

fn surface(path: &str) -> Result<TriMesh, String> {
    let path = shared(path);
    let bytes = genu::store::read(&path).map_err(|e| e.to_string())?;
    let read = formats::read_surface(&path.to_string_lossy(), &bytes, &Default::default());
    Ok(read.map_err(|e| e.to_string())?.welded().mesh)
}

/// Mean of the raters' picks of a landmark.
fn consensus(table: &str, name: &str) -> Vector {
    let picks: Vec<Vector> = table
        .lines()
        .filter(|l| l.contains(name))
        .map(|l| {
            let mut x = l.rsplit(',').map(|x| x.parse().unwrap_or(f64::NAN));
            let mut next = || x.next().unwrap_or(f64::NAN);
            let (z, y, x) = (next(), next(), next());
            Vector::new(x, y, z)
        })
        .collect();
    picks.iter().sum::<Vector>() / picks.len() as f64
}

fn raters(page: &mut Section, knees: &[(&Knee, Built)]) -> Result<(), String> {
    if !shared("femora/z013").exists() {
        return Ok(());
    }
    let Some((knee, _)) = knees.first() else { return Ok(()) };
    let femur = surface("femora/z013/z013_Femur_L.ply")?;
    let tibfib =
        TriMesh::joined([&surface("femora/z013/z013_Tibia_L.ply")?, &surface("femora/z013/z013_Fibula_L.ply")?]);
    let table = genu::store::read_text(&shared("femora/z013/landmarks_5raters.csv")).map_err(|e| e.to_string())?;
    let truth = consensus(&table, "Medial Epicondyle") - consensus(&table, "Lateral Epicondyle");
    let axes = rough_axes(&femur, &tibfib, Side::Left).map_err(|e| e.to_string())?;
    let cut = |bone: &TriMesh, d: &Vector, length: f64| clipped(bone, &(axes.joint + d * length), &-d);
    let mut specimen = knee.specimen.clone();
    specimen.landmarks.clear();
    specimen.identity.side = Side::Left;
    let mut seen: Vec<Vector> = Vec::new();
    for (case, length) in [
        ("whole", f64::INFINITY),
        ("cropped to 150 mm", 150.0),
        ("cropped to 120 mm", 120.0),
        ("cropped to 100 mm", 100.0),
    ] {
        specimen.ct = PerBone { femur: femur.clone(), tibfib: tibfib.clone() };
        if length.is_finite() {
            let (up, down) = (&axes.femur_shaft.direction, &axes.tibia_shaft.direction);
            specimen.ct = PerBone { femur: cut(&femur, up, length), tibfib: cut(&tibfib, down, length) };
        }
        let medial = made(&specimen)?.femur.medial;
        page.add(
            "transepicondylar axis against the consensus, z013 [deg]",
            Limit::Most(2.5),
            case,
            degrees(&medial, &truth),
        );
        if let Some(whole) = seen.first() {
            page.add("the same against the whole bone's [deg]", Limit::Most(1.5), case, degrees(&medial, whole));
        }
        seen.push(medial);
    }
    Ok(())
}
