//! Cartilage solids against the true ones, with the stages' own registration.

use crate::built::{Built, cartilages};
use crate::knees::Knee;
use crate::page::{Limit, Section};
use crate::registration::{Noise, noisy, seeded};
use meshes::measure::percentile;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Point, Vector};
use stages::cartilage::{Cartilage, CartilageMethod, CartilageSolid};
use stages::specimen::Specimen;
use std::collections::BTreeMap;

pub(crate) fn section(knees: &[(&Knee, Built)]) -> Section {
    let mut page = Section::new(
        "Cartilage",
        "Own registration. Thickness: volume over the bony face's area, alike for both. Distance of the solid: the larger of both \
         ways' p95; of the articular face: from the true one, which is what looks away from the bone and lies 0.3 mm off it. Rim: from the foot of our wall to the \
         edge of what the true solid has 0.3 mm off the bone, so that a wall that stands steep or overhangs counts with its height. Outline over the bone: where the cartilage ends seen \
         along the bone's normal, told alike for both solids, projected onto the bone; the larger of both ways. False sheet: bony face more than 2 mm from any true cartilage. \
         Segmentation errors: both CT bones 0.3 mm too large or too small, or off by a smooth error (sd 0.15 mm, 15 mm long, at most 0.3 mm).",
    );
    for (knee, built) in knees {
        judge(&mut page, &knee.name, "", knee, &built.cartilage);
    }
    for (knee, _) in knees.iter().take(3) {
        for error in ["0.3 mm large", "0.3 mm small", "smooth error"] {
            let case = format!("{} {error}", knee.name);
            match cartilages(&off(&knee.specimen, error), CartilageMethod::ThicknessField) {
                Ok((_, _, made)) => judge(&mut page, &case, ", CT off by 0.3 mm", knee, &made),
                Err(e) => {
                    eprintln!("{case}: {e}");
                    page.add("bodies beside each cartilage's one", Limit::Most(0.0), &case, f64::NAN);
                }
            }
        }
    }
    page
}

/// The specimen with an error of segmentation on both its bones.
pub(crate) fn off(specimen: &Specimen, error: &str) -> Specimen {
    let mut specimen = specimen.clone();
    for (k, bone) in [&mut specimen.ct.femur, &mut specimen.ct.tibfib].into_iter().enumerate() {
        let by: Vec<f64> = match error {
            "0.3 mm large" => vec![0.3; bone.vertices.len()],
            "0.3 mm small" => vec![-0.3; bone.vertices.len()],
            _ => {
                let moved = noisy(bone, Noise::Smooth(0.15, 15.0), &mut seeded(11 + k as u64));
                let normals = bone.vertex_normals();
                let along = moved.vertices.iter().zip(&bone.vertices).zip(&normals).map(|((q, p), n)| (q - p).dot(n));
                along.map(|d| d.clamp(-0.3, 0.3)).collect()
            }
        };
        let normals = bone.vertex_normals();
        bone.vertices.iter_mut().zip(normals).zip(by).for_each(|((p, n), d)| *p += n * d);
    }
    specimen
}

/// Holds the solids against the true ones; `off` ends the names of figures that are for a CT with an error of its own.
fn judge(page: &mut Section, case: &str, off: &str, knee: &Knee, made: &Cartilage) {
    for (name, part) in made.solids.named() {
        let (file, bone) = match name {
            "femur" => ("femur.stl".into(), &knee.specimen.ct.femur),
            _ => (format!("{}.stl", name.replace("tibia", "tibfib")), &knee.specimen.ct.tibfib),
        };
        let truth = formats::stl::read(knee.truth_file(&file)).unwrap_or_default();
        let queries = (SurfaceQuery::new(bone), SurfaceQuery::new(&truth), SurfaceQuery::new(&part.solid));
        let (Some(to_bone), Some(to_truth), Some(to_made)) = queries else {
            page.add("volume, femur [%]", Limit::Most(3.5), case, f64::NAN);
            continue;
        };
        let faces = Faces::of(&truth, &to_bone);
        let solids = Solids { part, truth, faces, to_bone, to_truth, to_made, off };
        one(page, &format!("{case} {name}"), &solids);
    }
}

/// One cartilage as made and as it is.
struct Solids<'a> {
    part: &'a CartilageSolid,
    truth: TriMesh,
    faces: Faces,
    to_bone: SurfaceQuery,
    to_truth: SurfaceQuery,
    to_made: SurfaceQuery,
    off: &'a str,
}

/// Triangles nearer to the bone than this are not taken for articular: folds of the published solids' undersides [mm].
const UNDERSIDE: f64 = 0.3;

/// Which triangles of a solid look away from the bone and lie off it, and the area it covers [mm2].
struct Faces {
    outer: Vec<bool>,
    covered: f64,
}

impl Faces {
    fn of(solid: &TriMesh, bone: &SurfaceQuery) -> Faces {
        let seen = (0..solid.triangles.len()).map(|t| {
            let near = bone.nearest(&middle(solid, t));
            (bone.smooth_normal(&near).dot(&solid.area_vector(t)), near.distance)
        });
        let seen: Vec<(f64, f64)> = seen.collect();
        Faces {
            outer: seen.iter().map(|(facing, off)| *facing > 0.0 && *off > UNDERSIDE).collect(),
            covered: -seen.iter().map(|(facing, _)| facing.min(0.0)).sum::<f64>(),
        }
    }
}

pub(crate) fn middle(mesh: &TriMesh, t: usize) -> Point {
    Point::from(mesh.corners(t).iter().map(|p| p.coords).sum::<Vector>() / 3.0)
}

fn one(page: &mut Section, case: &str, s: &Solids) {
    let femur = case.ends_with("femur");
    let (volume, true_volume) = (s.part.solid.volume(), s.truth.volume().abs());
    let thickness = volume / Faces::of(&s.part.solid, &s.to_bone).covered - true_volume / s.faces.covered;
    let (which, most, thick) = if femur { ("femur", 3.5, 0.12) } else { ("plateau", 7.0, 0.2) };
    let all = |mesh: &TriMesh, to: &SurfaceQuery| p95(mesh, to, |_| true);
    let solid = all(&s.truth, &s.to_made).max(all(&s.part.solid, &s.to_truth));
    let articular = SurfaceQuery::new(&s.part.solid.submesh(|t| s.part.articular[t]).0);
    let face = articular.map_or(f64::NAN, |to| p95(&s.truth, &to, |t| s.faces.outer[t]));
    let bodies = Topology::of(&s.part.solid).components;
    let rim = rim_distances(s);
    let [ours, theirs] = outline_distances(s);
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
    let bony = (0..s.part.solid.triangles.len()).filter(|&t| !s.part.articular[t]);
    let far = bony.filter(|&t| s.to_truth.nearest(&middle(&s.part.solid, t)).distance > 2.0);
    let sheet: f64 = far.map(|t| s.part.solid.area_vector(t).norm()).sum();
    for (what, most, value) in [
        (format!("volume, {which} [%]"), most, 100.0 * (volume / true_volume - 1.0).abs()),
        (format!("mean thickness, {which} [mm]"), thick, thickness.abs()),
        ("p95 distance, whole solid [mm]".into(), 0.45, solid),
        ("p95 distance, articular face [mm]".into(), 0.25, face),
        ("bodies beside each cartilage's one".into(), 0.0, bodies as f64 - 1.0),
        ("rim, mean distance [mm]".into(), 1.0, mean(&rim)),
        ("rim, p95 distance [mm]".into(), 1.0, percentile(&mut rim.clone(), 0.95)),
        ("outline over the bone, mean distance [mm]".into(), 1.0, mean(&ours).max(mean(&theirs))),
        (
            "outline over the bone, p95 distance [mm]".into(),
            1.0,
            percentile(&mut ours.clone(), 0.95).max(percentile(&mut theirs.clone(), 0.95)),
        ),
        ("false sheet [mm2]".into(), 5.0, sheet),
    ] {
        page.add(&format!("{what}{}", s.off), Limit::Most(most), case, value);
    }
}

/// 95th percentile, by area, of the distance of the triangles asked for [mm].
fn p95(mesh: &TriMesh, to: &SurfaceQuery, of: impl Fn(usize) -> bool) -> f64 {
    let mut samples: Vec<(f64, f64)> = (0..mesh.triangles.len())
        .filter(|&t| of(t))
        .map(|t| (to.nearest(&middle(mesh, t)).distance, mesh.area_vector(t).norm()))
        .collect();
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = samples.iter().map(|s| s.1).sum();
    let mut passed = 0.0;
    for (distance, area) in samples {
        passed += area;
        if passed >= 0.95 * total {
            return distance;
        }
    }
    f64::NAN
}

/// Edges between triangles of two kinds.
fn between(mesh: &TriMesh, kind: &[bool]) -> Vec<[Point; 2]> {
    let mut sides: BTreeMap<(u32, u32), [bool; 2]> = BTreeMap::new();
    for (triangle, kind) in mesh.triangles.iter().zip(kind) {
        for k in 0..3 {
            let (p, q) = (triangle[k], triangle[(k + 1) % 3]);
            sides.entry((p.min(q), p.max(q))).or_default()[usize::from(*kind)] = true;
        }
    }
    let between = sides.iter().filter(|(_, s)| s[0] && s[1]);
    between.map(|((p, q), _)| [*p, *q].map(|v| mesh.vertices[v as usize])).collect()
}

/// Middles of the edges between triangles of two kinds.
fn rim(mesh: &TriMesh, kind: &[bool]) -> Vec<Point> {
    between(mesh, kind).iter().map(|[p, q]| nalgebra::center(p, q)).collect()
}

/// Folds of an underside that look away from the bone are smaller than this [mm2].
const FOLD_MM2: f64 = 20.0;

/// Where a solid ends over its bone: points of the bone below the edge of what looks away from it, 0.2 mm apart or so.
pub(crate) fn outline(solid: &TriMesh, bone: &SurfaceQuery) -> Vec<Point> {
    let away = |t: usize| bone.smooth_normal(&bone.nearest(&middle(solid, t))).dot(&solid.area_vector(t)) > 0.0;
    let mut kind: Vec<bool> = (0..solid.triangles.len()).map(away).collect();
    for side in [true, false] {
        let of: Vec<usize> = (0..kind.len()).filter(|&t| kind[t] == side).collect();
        let part = Topology::of(&solid.submesh(|t| kind[t] == side).0).component_of_triangle;
        let mut area = vec![0.0; part.iter().max().map_or(0, |m| *m as usize + 1)];
        of.iter().zip(&part).for_each(|(&t, &p)| area[p as usize] += solid.area_vector(t).norm() / 2.0);
        of.iter().zip(&part).filter(|(_, p)| area[**p as usize] < FOLD_MM2).for_each(|(&t, _)| kind[t] = !side);
    }
    let along = [0.1, 0.3, 0.5, 0.7, 0.9];
    let points = between(solid, &kind).into_iter().flat_map(|[p, q]| along.map(|s| p + (q - p) * s));
    points.map(|p| bone.nearest(&p).point).collect()
}

/// Distances between our outline and the true one, each from the other [mm].
fn outline_distances(s: &Solids) -> [Vec<f64>; 2] {
    let lines = [outline(&s.part.solid, &s.to_bone), outline(&s.truth, &s.to_bone)];
    [0, 1].map(|k| {
        let nearest = |p: &Point| lines[1 - k].iter().map(|q| (p - q).norm_squared()).fold(f64::INFINITY, f64::min);
        lines[k].iter().map(|p| nearest(p).sqrt()).collect()
    })
}

/// Distances from our rim to the true one [mm].
fn rim_distances(s: &Solids) -> Vec<f64> {
    let truth = rim(&s.truth, &s.faces.outer);
    let nearest = |p: &Point| truth.iter().map(|q| (p - q).norm_squared()).fold(f64::INFINITY, f64::min).sqrt();
    rim(&s.part.solid, &s.part.articular).iter().map(nearest).collect()
}
