//! CT volumes of known bones, segmented without help.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use crate::common::{bytes, shared};
use formats::stl;
use meshes::query::SurfaceQuery;
use meshes::shapes::icosphere;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Point, Vector};
use nalgebra::{Matrix3, Rotation3};
use needs_shared::needs_shared;
use stages::phantom::volume::{Scanner, ct_volume};
use stages::segment::{SegmentOptions, Segmented, segment};

/// Mean and 99th percentile of the distance of `found`'s vertices from `right` [mm], and of the reverse, the worse of each.
fn apart(found: &TriMesh, right: &TriMesh) -> (f64, f64, f64) {
    let one_way = |from: &TriMesh, to: &TriMesh| {
        let query = SurfaceQuery::new(to).unwrap();
        let signed: Vec<f64> = from.vertices.iter().map(|p| query.signed_distance(p)).collect();
        let mut d: Vec<f64> = signed.iter().map(|x| x.abs()).collect();
        d.sort_by(f64::total_cmp);
        let n = d.len() as f64;
        (d.iter().sum::<f64>() / n, d[(0.99 * n) as usize], signed.iter().sum::<f64>() / n)
    };
    let ((a, b, bias), (c, d, _)) = (one_way(found, right), one_way(right, found));
    (a.max(c), b.max(d), bias)
}

fn near(name: &str, found: &TriMesh, right: &TriMesh, bodies: usize) {
    let topology = Topology::of(found);
    let (mean, p99, bias) = apart(found, right);
    println!(
        "{name}: {} triangles, mean {mean:.3} mm, p99 {p99:.3} mm, bias {bias:+.3} mm, volume {:+.2} %",
        found.triangles.len(),
        100.0 * (found.volume() / right.volume() - 1.0)
    );
    assert!(topology.is_closed() && topology.components == bodies, "{name}: {} pieces", topology.components);
    assert!(mean <= 0.25 && p99 <= 0.8, "{name}: {mean:.3} mm in the mean, p99 {p99:.3} mm");
}

/// A patella a millimetre and a half before the femur's trochlea.
fn patella(femur: &TriMesh, towards: Vector) -> TriMesh {
    let place = femur.vertices.iter().max_by(|a, b| a.coords.dot(&towards).total_cmp(&b.coords.dot(&towards))).unwrap();
    let thick = 9.5;
    let mut mesh = icosphere(1.0, 4);
    for p in &mut mesh.vertices {
        *p = Point::new(21.0 * p.x, thick * p.y, 20.0 * p.z);
    }
    // The ellipsoid is the same upside down.
    let turn = Rotation3::rotation_between(&Vector::y(), &towards).unwrap_or_else(Rotation3::identity);
    let centre = place + towards * (thick + 1.5);
    mesh.vertices.iter_mut().for_each(|p| *p = centre + turn * p.coords);
    mesh
}

fn knee(name: &str) -> Option<[TriMesh; 2]> {
    let folder = shared(name, &format!("specimens/{name}/ct"))?;
    Some(["femur", "tibfib"].map(|bone| stl::read(&bytes(&folder.join(format!("{bone}.stl")))).unwrap()))
}

fn segmented(name: &str, scanner: &Scanner) -> Option<(Segmented, [TriMesh; 3])> {
    let [femur, tibfib] = knee(name)?;
    let patella = patella(&femur, -Vector::y());
    let volume = ct_volume(&[&femur, &tibfib, &patella], scanner, 5).unwrap();
    let found = segment(&volume, None, &SegmentOptions::default()).unwrap();
    println!("{name}: {:?} voxels, threshold {}", volume.grid.size, found.metrics.threshold);
    Some((found, [femur, tibfib, patella]))
}

#[needs_shared]
fn bones_of_a_volume_lie_where_they_are() {
    for name in ["S192803", "S193761"] {
        let Some((found, [femur, tibfib, patella])) = segmented(name, &Scanner::default()) else { continue };
        near(&format!("{name} femur"), &found.femur, &femur, 1);
        near(&format!("{name} tibfib"), &found.tibfib, &tibfib, 1);
        near(&format!("{name} patella"), found.patella.as_ref().unwrap(), &patella, 1);
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    }
}

#[needs_shared]
fn bones_that_run_out_of_a_turned_picture() {
    let turn = *Rotation3::from_euler_angles(0.3, -0.2, 0.4).matrix();
    // Left-handed axes, as many a scanner writes.
    let scanner = Scanner {
        turn: turn * Matrix3::from_diagonal(&Vector::new(1.0, -1.0, 1.0)),
        margin_mm: [12.0, 12.0, -9.0],
        ..Scanner::default()
    };
    let Some((found, [femur, tibfib, _])) = segmented("S192803", &scanner) else { return };
    for (name, mesh, right) in [("femur", &found.femur, &femur), ("tibfib", &found.tibfib, &tibfib)] {
        assert!(Topology::of(mesh).is_closed() && mesh.volume() > 0.5 * right.volume(), "{name}");
        let query = SurfaceQuery::new(right).unwrap();
        // Where it ends at the picture's border it lies deep inside the bone; elsewhere on its surface.
        let mut signed: Vec<f64> = mesh.vertices.iter().map(|p| query.signed_distance(p)).collect();
        signed.sort_by(f64::total_cmp);
        let outer = signed[signed.len() * 999 / 1000];
        let share = signed.iter().filter(|d| d.abs() < 0.5).count() as f64 / signed.len() as f64;
        println!("{name}: {outer:.2} mm outside at most, {share:.3} near");
        assert!(outer < 0.8 && share > 0.9, "{name}: {outer:.2} mm, {share:.3}");
    }
}
