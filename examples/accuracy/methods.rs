//! The thickness field and the Boolean difference on the same knees.

use crate::built::cartilages;
use crate::cartilage::{middle, off, outline};
use crate::knees::{Knee, user_seconds};
use crate::page::{Limit, Section};
use meshes::boolean::difference;
use meshes::holes::boundary_loops;
use meshes::query::SurfaceQuery;
use meshes::repair::solidify;
use meshes::shapes::cuboid;
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::topology::Topology;
use meshes::{Isometry, Point, Vector};
use stages::bones::Bones;
use stages::cartilage::{Cartilage, CartilageMethod, CartilageOptions, cartilage};
use stages::hexmesh::{HexmeshOptions, hexmesh};
use stages::register::Registration;
use stages::specimen::Specimen;

const METHODS: [(&str, CartilageMethod); 2] =
    [("thickness field", CartilageMethod::ThicknessField), ("Boolean", CartilageMethod::Boolean)];

/// Widths of the gap under a flap [mm].
const GAPS: [f64; 3] = [0.8, 1.4, 2.2];
/// Thickness of a flap and its radius [mm].
const FLAP: (f64, f64) = (1.5, 5.0);

pub(crate) fn section(knees: &[Knee]) -> Result<Section, String> {
    let mut page = Section::new(
        "Cartilage by two methods",
        "`cartilage.method` is `thickness_field` (the default) or `boolean`. Same registration, same bones. Surface distance: all vertices of the made solid to \
         the true one and back, by area. Tunnels: holes through a body where it is thin. Failed: no cartilage, or no hexahedra of it. \
         Flap: a plate of cartilage, 1.5 mm thick and 10 mm wide, is added to the scan at the femoral rim, and stands off the bone by the width told; \
         the figure is the share of its volume that the method finds. Specimens alone have a rim high enough to bear it.",
    );
    for (k, knee) in knees.iter().enumerate() {
        for error in
            ["as given", "0.3 mm large", "0.3 mm small", "smooth error"].iter().take(if k == 0 { 4 } else { 1 })
        {
            let given = *error == "as given";
            let specimen = if given { knee.specimen.clone() } else { off(&knee.specimen, error) };
            let (registration, bones, _) =
                cartilages(&specimen, CartilageMethod::ThicknessField).map_err(|e| format!("{}: {e}", knee.name))?;
            for (name, method) in METHODS {
                let which = if given { name.to_string() } else { format!("{name}, CT off by 0.3 mm") };
                let start = user_seconds();
                let made = remade(&specimen, &registration, &bones, method);
                let case = format!("{} {error}", knee.name);
                page.add(&format!("time of stage 4 [s], {which}"), Limit::Most(10.0), &case, user_seconds() - start);
                judge(&mut page, &which, &case, knee, made);
            }
            if given && knee.is_specimen() {
                flaps(&mut page, knee, &registration, &bones)?;
            }
        }
    }
    Ok(page)
}

fn judge(page: &mut Section, which: &str, case: &str, knee: &Knee, made: Result<Cartilage, String>) {
    let made = made.and_then(|made| match hexmesh(&made, &HexmeshOptions::default()) {
        Ok(hexes) => Ok((made, hexes)),
        Err(e) => Err(e.to_string()),
    });
    let failed = format!("failed, {which}");
    let (made, hexes) = match made {
        Ok(made) => made,
        Err(e) => {
            eprintln!("{case}, {which}: {e}");
            page.add(&failed, Limit::Most(0.0), case, 1.0);
            return;
        }
    };
    page.add(&failed, Limit::Most(0.0), case, 0.0);
    for (name, part) in made.solids.named() {
        let truth = truth(knee, name);
        let case = format!("{case} {name}");
        let volume = 100.0 * (part.solid.volume() / truth.volume() - 1.0);
        let (kind, most) = if name == "femur" { ("femur", 3.5) } else { ("plateau", 7.0) };
        page.add(&format!("volume, {kind} [%], {which}"), Limit::Most(most), &case, volume.abs());
        let (mean, p95) = distances(&part.solid, &truth);
        page.add(&format!("surface distance, mean [mm], {which}"), Limit::Most(0.15), &case, mean);
        page.add(&format!("surface distance, p95 [mm], {which}"), Limit::Most(0.45), &case, p95);
        let tunnels = 1 - Topology::of(&part.solid).euler_characteristic / 2;
        page.add(&format!("tunnels, {which}"), Limit::Most(0.0), &case, tunnels as f64);
        let Some(shape) = hexes.metrics.get(name) else { continue };
        let least = shape.scaled_jacobian_min.unwrap_or(f64::NAN);
        page.add(&format!("hexahedra inverted, {which}"), Limit::Most(0.0), &case, shape.inverted as f64);
        page.add(&format!("scaled Jacobian, least, {which}"), Limit::Least(0.3), &case, least);
        eprintln!("{case}, {which}: volume {volume:.2} % mean {mean:.3} p95 {p95:.3} tunnels {tunnels}");
    }
}

fn truth(knee: &Knee, name: &str) -> TriMesh {
    let file = format!("{}.stl", name.replace("tibia", "tibfib"));
    let truth = formats::stl::read(knee.truth_file(&file)).unwrap_or_default();
    if truth.volume() < 0.0 { truth.flipped() } else { truth }
}

/// Mean and 95th percentile, by area, of both ways' distances [mm].
fn distances(made: &TriMesh, truth: &TriMesh) -> (f64, f64) {
    let mut samples: Vec<(f64, f64)> = Vec::new();
    for (from, to) in [(made, truth), (truth, made)] {
        let Some(to) = SurfaceQuery::new(to) else { return (f64::NAN, f64::NAN) };
        let whole = from.area();
        let ways = (0..from.triangles.len())
            .map(|t| (to.nearest(&middle(from, t)).distance, from.area_vector(t).norm() / whole));
        samples.extend(ways);
    }
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = samples.iter().map(|s| s.1).sum();
    let mean = samples.iter().map(|s| s.0 * s.1).sum::<f64>() / total;
    let mut passed = 0.0;
    let p95 = samples.iter().find(|s| {
        passed += s.1;
        passed >= 0.95 * total
    });
    (mean, p95.map_or(f64::NAN, |s| s.0))
}

/// How much of a flap at the femoral rim each method finds.
fn flaps(page: &mut Section, knee: &Knee, registration: &Registration, bones: &Bones) -> Result<(), String> {
    let specimen = &knee.specimen;
    let fail = |e: &dyn std::fmt::Display| format!("{}: {e}", knee.name);
    let mut plain = Vec::new();
    for (_, method) in METHODS {
        plain.push(remade(specimen, registration, bones, method).map_err(|e| fail(&e))?);
    }
    let truth = solidify(&truth(knee, "femur"), 0.01).mesh;
    let bone = &specimen.ct.femur;
    let Some(centre) = high_rim(&truth, bone) else { return Err(fail(&"no rim")) };
    let fit = registration.bones.femur.ct_from_scan;
    let scan = solidify(&fit.mesh(&specimen.scans.femur.mesh), 0.01).mesh;
    for gap in GAPS {
        let flap = plate(bone, &centre, gap);
        let added = union(&truth, &flap)?.volume() - truth.volume();
        let mut with = specimen.clone();
        with.scans.femur = uncoloured(union(&scan, &flap)?.moved(&fit.motion().inverse()));
        for ((name, method), without) in METHODS.iter().zip(&plain) {
            let what = format!("share of a flap found, {name}");
            let case = format!("{} gap {gap} mm", knee.name);
            let found = match remade(&with, registration, bones, *method) {
                Ok(made) => {
                    let hexes = hexmesh(&made, &HexmeshOptions::default());
                    let usable = hexes.is_ok_and(|h| h.metrics.femur.inverted == 0);
                    page.add(&format!("flap without hexahedra, {name}"), Limit::Most(0.0), &case, f64::from(!usable));
                    let share = (made.solids.femur.solid.volume() - without.solids.femur.solid.volume()) / added;
                    eprintln!("{case}, {name}: {added:.1} mm3 added, {share:.2} found, hexahedra {usable}");
                    share
                }
                Err(e) => {
                    eprintln!("{case}, {name}: {e}");
                    f64::NAN
                }
            };
            page.add(&what, Limit::Least(0.8), &case, found);
        }
    }
    Ok(())
}

fn remade(
    specimen: &Specimen,
    registration: &Registration,
    bones: &Bones,
    method: CartilageMethod,
) -> Result<Cartilage, String> {
    let options = CartilageOptions { method, ..CartilageOptions::default() };
    cartilage(specimen, registration, bones, &options).map_err(|e| e.to_string())
}

fn uncoloured(mesh: TriMesh) -> ColouredMesh {
    ColouredMesh { mesh, ..ColouredMesh::default() }
}

/// The point of the outline about which cartilage stands highest.
fn high_rim(truth: &TriMesh, bone: &TriMesh) -> Option<Point> {
    let (to_bone, to_truth) = (SurfaceQuery::new(bone)?, SurfaceQuery::new(truth)?);
    let line = outline(truth, &to_bone);
    let height = |p: &Point| {
        let normal = to_bone.smooth_normal(&to_bone.nearest(p));
        // from outside back to the cartilage's outer wall
        let out = p + normal * 8.0;
        to_truth.ray(&out, &-normal, 8.0).map_or(0.0, |h| 8.0 - h.distance)
    };
    let heights: Vec<f64> = line.iter().map(height).collect();
    let mean = |p: &Point| {
        let near: Vec<f64> =
            line.iter().zip(&heights).filter(|(q, _)| (*q - p).norm() < 4.0).map(|(_, h)| *h).collect();
        near.iter().sum::<f64>() / near.len().max(1) as f64
    };
    line.iter().step_by(10).max_by(|a, b| mean(a).total_cmp(&mean(b))).copied()
}

/// A plate over the bone about `centre`, its underside `gap` off the bone.
fn plate(bone: &TriMesh, centre: &Point, gap: f64) -> TriMesh {
    let patch = bone.submesh(|t| (middle(bone, t) - centre).norm() < FLAP.1).0;
    let parts = Topology::of(&patch).component_of_triangle;
    let nearest = (0..parts.len()).min_by(|a, b| {
        let far = |t: usize| (middle(&patch, t) - centre).norm();
        far(*a).total_cmp(&far(*b))
    });
    let own = nearest.map_or(0, |t| parts[t]);
    let patch = patch.submesh(|t| parts[t] == own).0;
    // one normal for all: no fold over a hollow
    let normal: Vector = (0..patch.triangles.len()).map(|t| patch.area_vector(t)).sum::<Vector>().normalize();
    let count = patch.vertices.len() as u32;
    let at = |height: f64| patch.vertices.iter().map(move |p| p + normal * height);
    let mut mesh = TriMesh { vertices: at(gap).chain(at(gap + FLAP.0)).collect(), triangles: Vec::new() };
    for &[a, b, c] in &patch.triangles {
        mesh.triangles.extend([[a, c, b], [a + count, b + count, c + count]]);
    }
    for rim in boundary_loops(&patch) {
        for (i, &a) in rim.iter().enumerate() {
            let b = rim[(i + 1) % rim.len()];
            mesh.triangles.extend([[a, b, b + count], [a, b + count, a + count]]);
        }
    }
    solidify(&mesh, 0.01).mesh
}

/// Both bodies in one, by what a box around them lacks of them.
fn union(a: &TriMesh, b: &TriMesh) -> Result<TriMesh, String> {
    let (low, high) = TriMesh::joined([a, b]).bounds().ok_or("nothing to unite")?;
    let size = high - low;
    let about = cuboid([size.x + 20.0, size.y + 20.0, size.z + 20.0]);
    let (from, _) = about.bounds().ok_or("no box")?;
    let shift = low - Vector::repeat(10.0) - from;
    let about = about.moved(&Isometry::translation(shift.x, shift.y, shift.z));
    let less = |x: &TriMesh, y: &TriMesh| difference(x, y).map(|d| d.mesh).map_err(|e| e.to_string());
    less(&about, &less(&less(&about, a)?, b)?)
}
