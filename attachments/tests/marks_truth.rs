//! Outlines on the shared specimens' scans against their truth.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use attachments::marks::{MarkOptions, find_outlines, project::project};
use formats::{ply, stl};
use meshes::query::SurfaceQuery;
use meshes::{Isometry, Point};
use nalgebra::{Matrix4, Rotation3, Translation3, UnitQuaternion};
use needs_shared::needs_shared;

#[expect(clippy::disallowed_methods, reason = "reads the shared test data")]
fn shared(test: &str, path: &str) -> Option<Vec<u8>> {
    Some(std::fs::read(crate::shared::shared(test, path)?).unwrap())
}

fn pose(value: &serde_json::Value) -> Isometry {
    let m = Matrix4::from_fn(|r, c| value[r][c].as_f64().unwrap());
    let rotation = Rotation3::from_matrix(&m.fixed_view::<3, 3>(0, 0).into_owned());
    Isometry::from_parts(
        Translation3::new(m[(0, 3)], m[(1, 3)], m[(2, 3)]),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

#[needs_shared]
fn every_marked_site_is_found_within_1_2_mm_and_nothing_else() {
    let test = "every_marked_site_is_found_within_1_2_mm_and_nothing_else";
    for id in ["S192803", "S193761"] {
        let Some(truth) = shared(test, &format!("specimens/{id}/truth/truth.json")) else { return };
        let truth: serde_json::Value = serde_json::from_slice(&truth).unwrap();
        for bone in ["femur", "tibfib"] {
            let scan = ply::read(&shared(test, &format!("specimens/{id}/scans/{bone}.ply")).unwrap()).unwrap();
            let ct = stl::read(&shared(test, &format!("specimens/{id}/ct/{bone}.stl")).unwrap()).unwrap();
            let query = SurfaceQuery::new(&ct).unwrap();
            let motion = pose(&truth["scan_to_ct"][bone]);
            let found: Vec<_> = find_outlines(&scan, &MarkOptions::default())
                .iter()
                .map(|r| {
                    let f = project(r, &motion, &query);
                    println!(
                        "  {:?} area {:.1} on bone {:.1} line {:.2} gap {:.2} projection {:.2} raw {:?}",
                        f.centroid,
                        r.area_mm2,
                        f.area_mm2,
                        r.line_width_mm,
                        r.gap_fraction,
                        f.projection_mm,
                        motion * r.centroid
                    );
                    f
                })
                .collect();
            let sites = truth["sites_ct"].as_object().unwrap();
            let marked: Vec<_> =
                sites.iter().filter(|(k, v)| k.ends_with(&format!("@{bone}")) && v["marked"] == true).collect();
            for (name, site) in &marked {
                let centre = Point::from_slice(&[0, 1, 2].map(|k| site["centroid"][k].as_f64().unwrap()));
                let nearest = found.iter().map(|f| (f.centroid - centre).norm()).fold(f64::INFINITY, f64::min);
                println!("{id} {name}: {nearest:.2} mm, off bone {:.2}", query.nearest(&centre).distance);
                assert!(nearest < 1.2, "{id} {name}: nearest outline {nearest:.2} mm away");
            }
            assert_eq!(found.len(), marked.len(), "{id} {bone}: outlines that are none");
        }
    }
}
