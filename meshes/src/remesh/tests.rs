use super::*;
use crate::measure::edge_quality;
use crate::shapes::{cuboid, icosphere};
use crate::topology::Topology;

#[test]
fn a_noisy_sphere_reaches_the_quality_of_the_best_known_crate() {
    let mut sphere = icosphere(20.0, 5);
    for (i, p) in sphere.vertices.iter_mut().enumerate() {
        let noise = (((i * 7919) % 2000) as f64 / 1000.0 - 1.0) * 0.01;
        *p = Point::from(p.coords * (1.0 + noise / 20.0));
    }
    let (mesh, _) = remesh(&sphere, &[], &RemeshOptions { edge_mm: 1.0, rounds: 8 }).unwrap();
    assert!(Topology::of(&mesh).is_closed());
    let quality = edge_quality(&mesh);
    assert!(quality.edge_p01_mm > 0.7 && quality.edge_p99_mm < 1.38, "{quality:?}");
    assert!(quality.min_angle_deg > 30.0, "{quality:?}");
    let worst = mesh.vertices.iter().map(|p| (p.coords.norm() - 20.0).abs()).fold(0.0, f64::max);
    assert!(worst < 0.02, "{worst}");
}

#[test]
fn labelled_edges_stay_sharp_and_sizes_change_both_ways() {
    let cube = cuboid([20.0, 20.0, 20.0]);
    let labels: Vec<u32> = (0..12).map(|t| t / 2).collect();
    for edge_mm in [1.0, 4.0] {
        let (mesh, labels) = remesh(&cube, &labels, &RemeshOptions { edge_mm, rounds: 8 }).unwrap();
        assert!(Topology::of(&mesh).is_closed());
        assert_eq!(labels.len(), mesh.triangles.len());
        assert!((mesh.volume() - 8000.0).abs() < 1e-6, "{}", mesh.volume());
        let (coarse, _) = remesh(&mesh, &labels, &RemeshOptions { edge_mm: 3.0, rounds: 8 }).unwrap();
        assert!((coarse.volume() - 8000.0).abs() < 1e-6);
        assert!(edge_quality(&coarse).min_angle_deg > 20.0, "{:?}", edge_quality(&coarse));
    }
}

#[test]
fn an_open_surface_is_an_error() {
    let mut mesh = icosphere(1.0, 1);
    mesh.triangles.pop();
    assert_eq!(remesh(&mesh, &[], &RemeshOptions::default()), Err(RemeshError::NotClosed));
    assert_eq!(
        remesh(&icosphere(1.0, 1), &[], &RemeshOptions { edge_mm: f64::NAN, rounds: 1 }),
        Err(RemeshError::EdgeLength)
    );
}
