//! A knee whose ligaments wrap: the laws that every knee keeps.

use super::rig::Rig;
use meshes::frame::Side;
use meshes::shapes::icosphere;
use meshes::{Isometry, Point, Vector};
use sim::Model;
use sim::coordinate::{FE, Load, Six};
use sim::mesh::MeshValue;
use sim::spec::WrapSpec;
use sim::trials::{TrialOptions, solve};

/// The rig's knee with bones: a ball in each collateral's way. Both of its collaterals wrap.
fn knee() -> Rig {
    let mut rig = Rig::knee();
    let ball = |x: f64, y: f64, z: f64, r: f64| icosphere(r, 4).moved(&Isometry::translation(x, y, z));
    let mut femur = ball(-36.0, 0.3, 6.0, 9.0);
    let other = ball(37.0, 9.0, 8.0, 8.0);
    let first = femur.vertices.len() as u32;
    femur.vertices.extend(other.vertices);
    femur.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
    rig.meshes.insert("femur.ply".into(), MeshValue::Surface(femur));
    rig.meshes.insert("tibia.ply".into(), MeshValue::Surface(ball(-30.0, -1.0, -14.0, 7.0)));
    let bundles = rig.spec.bundles.iter().take(2).map(|b| b.name.clone()).collect();
    rig.spec.wrap = Some(WrapSpec { over: vec!["femur".into(), "tibia".into()], bundles });
    rig
}

fn flexed(model: &Model) -> sim::trials::Answer {
    solve(model, 25.0, &Load::new(2.0, 1.0, 0.0, 20.0, 50.0), &TrialOptions::default()).unwrap()
}

#[test]
fn bones_in_the_way_lengthen_fibres_and_cost_no_steps() {
    let rig = knee();
    let wrapped = rig.compiled();
    let mut straight = rig.spec.clone();
    straight.wrap = None;
    let straight = sim::compile(&straight, &rig.meshes).unwrap();
    for f in 0..2 {
        assert!(wrapped.fibres[f].initial_length > straight.fibres[f].initial_length + 0.2, "fibre {f}");
    }
    for f in 2..4 {
        assert_eq!(wrapped.fibres[f], straight.fibres[f]);
    }
    let [a, b] = [&wrapped, &straight].map(flexed);
    // a tangent that is not that of the force would take Newton's method many more steps
    assert!(a.evaluations < b.evaluations + 25, "{} evaluations, straight {}", a.evaluations, b.evaluations);
    println!("evaluations of a trial: {} with wrapping, {} without", a.evaluations, b.evaluations);
}

#[test]
fn the_wrench_is_the_gradient_of_the_energy() {
    let model = knee().compiled();
    for q in [Six::zeros(), Six::new(0.3, 0.02, -0.05, 0.6, 1.4, -0.2)] {
        let here = model.evaluate(&q);
        for j in 0..6 {
            let h = if j < 3 { 1e-5 } else { 1e-4 };
            let side = |s: f64| {
                let mut q = q;
                q[j] += s * h;
                model.evaluate(&q)
            };
            let slope = (side(1.0).energy - side(-1.0).energy) / (2.0 * h);
            let size = 1.0 + here.gradient.amax();
            assert!((slope - here.gradient[j]).abs() < 1e-4 * size, "{j}: {slope}, told {}", here.gradient[j]);
        }
    }
}

#[test]
fn left_mirrors_right_and_moving_all_moves_nothing() {
    let rig = knee();
    let here = flexed(&rig.compiled());
    let motion = Isometry::new(Vector::new(40.0, -20.0, 7.0), Vector::new(0.4, -0.3, 0.8));
    let mirrored = rig.mapped(Side::Right, |p| Point::new(-p.x, p.y, p.z)).compiled();
    let moved = rig.mapped(Side::Left, |p| motion * p).compiled();
    for (what, model) in [("mirrored", mirrored), ("moved", moved)] {
        let there = flexed(&model);
        let off = (there.state.q - here.state.q).amax();
        assert!(off < 1e-4, "{what}: {off}, flexion {}", here.state.q[FE]);
    }
}

#[test]
fn what_wraps_needs_its_bone_and_its_bundle() {
    let error = |rig: Rig| sim::compile(&rig.spec, &rig.meshes).unwrap_err().to_string();
    let mut rig = knee();
    rig.meshes.remove("tibia.ply");
    assert!(error(rig).contains("wrap over tibia.ply, which is not among"));
    let mut rig = knee();
    rig.spec.wrap.as_mut().unwrap().bundles.push("sMCL".into());
    assert!(error(rig).contains("no bundle is named \"sMCL\""));
    let mut rig = knee();
    rig.spec.wrap.as_mut().unwrap().over.push("patella".into());
    assert!(error(rig).contains("wrap.over names \"patella\""));
}
