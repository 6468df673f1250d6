use super::*;
use crate::joint::Joint;
use crate::spec::{AxisSpec, ChainSpec, FramesSpec, LayerLaw, LayerSpec, PairSpec};
use meshes::frame::{AnatomicalFrame, Side as Knee};
use meshes::shapes::icosphere;

fn frame() -> AnatomicalFrame {
    let (medial, anterior) = (-Vector::x(), -Vector::y());
    AnatomicalFrame { origin: meshes::Point::origin(), medial, anterior, superior: Vector::z() }
}

fn joint() -> Joint {
    let axis = |direction| AxisSpec { point: meshes::Point::origin(), direction };
    let chain = ChainSpec { si: axis(Vector::z()), ap: axis(Vector::y()), ml: axis(Vector::x()) };
    let frames =
        FramesSpec { femur: frame(), tibia: frame(), gs_ct_pose: Default::default(), chain: Some(chain), grid: None };
    Joint::new(&frames, Knee::Left).unwrap()
}

/// A flat open patch of the tibia, z = 0, facing up.
fn plate(half: i32) -> TriMesh {
    let n = 2 * half + 1;
    let mut mesh = TriMesh::default();
    for j in 0..n {
        for i in 0..n {
            mesh.vertices.push(meshes::Point::new(f64::from(i - half) * 0.5, f64::from(j - half) * 0.5, 0.0));
        }
    }
    for j in 0..n - 1 {
        for i in 0..n - 1 {
            let a = (j * n + i) as u32;
            mesh.triangles.push([a, a + 1, a + n as u32 + 1]);
            mesh.triangles.push([a, a + n as u32 + 1, a + n as u32]);
        }
    }
    mesh
}

/// A sphere of 20 mm on a plate, elastic foundation of 5 MPa/mm, friction 0.1, 0.3 mm deep.
fn sphere_on_plate(spacing_mm: f64) -> Contact {
    let sphere = icosphere(20.0, 5).moved(&Isometry::translation(0.0, 0.0, 19.7));
    let side = |mesh: &TriMesh, name: &str| {
        let at = field::bone_frame(&frame());
        let (nodes, field) = (Nodes::new(mesh, &[], &at, spacing_mm), Field::new(mesh, at, name).unwrap());
        Arc::new(Side { nodes, field, rim: super::rim::RimEdge::of(mesh) })
    };
    let pair = Pair { femur: side(&sphere, "sphere"), tibia: side(&plate(24), "plate") };
    let law = PressureLaw::new(&[0.0, 1.0], &[0.0, 5.0]).unwrap();
    Contact { pairs: vec![pair], law, layer: None, friction: 0.1, damping: 0.0, scale: 1.0, tibial_only: false }
}

/// The sphere's layer is 1.5 to 2.5 mm thick, the plate's 1 to 3.4 mm.
fn layered_sphere_on_plate(law: LayerLaw, edge_spread: f64, spacing_mm: f64) -> Contact {
    let sphere = icosphere(20.0, 5).moved(&Isometry::translation(0.0, 0.0, 19.7));
    let bone = icosphere(18.0, 5).moved(&Isometry::translation(0.3, 0.0, 19.7));
    let below = Isometry::new(Vector::new(0.0, 0.0, -2.2), Vector::new(0.0, 0.1, 0.0));
    let surfaces = [("sphere", sphere), ("plate", plate(24)), ("bone", bone), ("below", plate(48).moved(&below))];
    let pair = PairSpec { femur: "sphere".into(), tibia: "plate".into() };
    let faces = [("sphere", "bone"), ("plate", "below")].map(|(a, b)| (a.to_owned(), b.to_owned()));
    let layer = LayerSpec {
        law,
        youngs_modulus_mpa: 6.0,
        poissons_ratio: 0.4,
        edge_spread,
        least_thickness_mm: 0.5,
        bony_faces: faces.into(),
    };
    let (overclosure_mm, pressure_mpa) = (vec![0.0, 1.0], vec![0.0, 5.0]);
    let spec = ContactSpec {
        overclosure_mm,
        pressure_mpa,
        friction: 0.1,
        damping: 0.0,
        pairs: vec![pair],
        layer: Some(layer),
    };
    let frames = FramesSpec { femur: frame(), tibia: frame(), gs_ct_pose: Default::default(), chain: None, grid: None };
    let surfaces = surfaces.into_iter().map(|(name, mesh)| (name.to_owned(), mesh)).collect();
    Contact::between(&frames, &spec, &surfaces, &ContactOptions { spacing_mm }).unwrap()
}

#[test]
fn a_sphere_on_thin_layers_presses_as_in_closed_form() {
    let contact = layered_sphere_on_plate(LayerLaw::Linear, 0.0, 0.0);
    let out = contact.evaluate(&joint().pose(&Six::zeros()));
    // F = pi M R d^2 / h with layers of 2 and 2.2 mm
    let exact = std::f64::consts::PI * layer::confined_modulus(6.0, 0.4) * 20.0 * 0.3f64.powi(2) / 4.2;
    assert!((out.wrench[0].0.z / exact - 1.0).abs() < 0.03, "{} {exact}", out.wrench[0].0.z);
    // a patch keeps y / (1 + y) of the energy: a paraboloid's V and W give the radius sqrt(16 / 27) of its own
    let soft = layered_sphere_on_plate(LayerLaw::Linear, 0.5, 0.0).evaluate(&joint().pose(&Six::zeros()));
    let y = (2.0 * 20.0 * 0.3 * 16.0 / 27.0f64).sqrt() / (0.5 * 4.2);
    assert!((soft.energy / out.energy / (y / (1.0 + y)) - 1.0).abs() < 0.03, "{} {}", soft.energy, out.energy);
}

#[test]
fn layers_press_by_the_slope_of_their_energy() {
    for (law, spread) in [(LayerLaw::Linear, 0.0), (LayerLaw::Logarithmic, 0.0), (LayerLaw::Linear, 0.4)] {
        let (joint, contact) = (joint(), layered_sphere_on_plate(law, spread, 0.8));
        let contact = Contact { scale: 1.3, ..contact.with_law(&[-0.05, 1.0], &[0.0, 5.0]).unwrap() };
        let q = Six::new(0.2, -0.03, 0.1, 0.4, 0.7, 0.3);
        let at = |q: &Six| contact.evaluate(&joint.pose(q));
        let here = at(&q);
        for j in 0..6 {
            let mut h = Six::zeros();
            h[j] = if j < 3 { 1e-6 } else { 1e-5 };
            let (up, down) = (at(&(q + h)), at(&(q - h)));
            let slope = (up.energy - down.energy) / (2.0 * h[j]);
            assert!((slope - here.gradient[j]).abs() < 1e-5 * here.gradient.amax(), "{j} {slope} {}", here.gradient[j]);
            let curve = (up.gradient - down.gradient) / (2.0 * h[j]);
            let miss = (curve - here.hessian.column(j)).amax();
            assert!(miss < 1e-3 * here.hessian.column(j).amax(), "{j} {curve} {}", here.hessian.column(j));
        }
        let (pose, press) = (joint.pose(&q), contact.press(&joint.pose(&q)));
        assert!((press.energy / here.energy - 1.0).abs() < 1e-12 && (press.area / here.area[0] - 1.0).abs() < 1e-12);
        for j in 0..6 {
            let work = pose.screws[j].linear.dot(&press.force) + pose.screws[j].angular.dot(&press.moment);
            assert!((work + here.gradient[j]).abs() < 1e-9 * here.gradient.amax(), "{j} {work}");
        }
    }
}

#[test]
fn layers_bear_however_deep_they_are_pressed() {
    let contact = layered_sphere_on_plate(LayerLaw::Logarithmic, 0.4, 0.8);
    let force = |depth: f64| contact.evaluate(&joint().pose(&Six::new(0.0, 0.0, 0.0, 0.0, 0.0, depth))).wrench[0].0.z;
    let forces: Vec<f64> = (0..30).map(|n| force(f64::from(n) * 0.15)).collect();
    assert!(forces.windows(2).all(|w| w[1] > w[0] && w[1].is_finite()), "{forces:?}");
}

#[test]
fn a_face_of_bare_bone_does_not_give_way_and_one_of_a_pair_must() {
    let contact = layered_sphere_on_plate(LayerLaw::Linear, 0.0, 0.8);
    let spec = |faces: &[(&str, &str)]| ContactSpec {
        overclosure_mm: vec![0.0, 1.0],
        pressure_mpa: vec![0.0, 5.0],
        friction: 0.0,
        damping: 0.0,
        pairs: vec![PairSpec { femur: "sphere".into(), tibia: "plate".into() }],
        layer: Some(LayerSpec {
            law: LayerLaw::Linear,
            youngs_modulus_mpa: 6.0,
            poissons_ratio: 0.4,
            edge_spread: 0.0,
            least_thickness_mm: 0.5,
            bony_faces: faces.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect(),
        }),
    };
    let frames = FramesSpec { femur: frame(), tibia: frame(), gs_ct_pose: Default::default(), chain: None, grid: None };
    let sphere = icosphere(20.0, 5).moved(&Isometry::translation(0.0, 0.0, 19.7));
    let surfaces: BTreeMap<String, TriMesh> =
        [("sphere", sphere), ("plate", plate(24)), ("below", plate(24).moved(&Isometry::translation(0.0, 0.0, -2.2)))]
            .into_iter()
            .map(|(name, mesh)| (name.to_owned(), mesh))
            .collect();
    let made = |faces: &[(&str, &str)]| Contact::between(&frames, &spec(faces), &surfaces, &ContactOptions::default());
    let pose = joint().pose(&Six::zeros());
    let (both, bare) = (contact.evaluate(&pose), made(&[("plate", "below")]).unwrap().evaluate(&pose));
    assert!((bare.wrench[0].0.z / both.wrench[0].0.z / (4.2 / 2.2) - 1.0).abs() < 0.03);
    assert!(made(&[]).unwrap_err().to_string().contains("nothing of this pair gives way"));
    assert!(made(&[("plate", "above")]).unwrap_err().to_string().contains("no surface above"));
}

#[test]
fn a_sphere_on_an_elastic_foundation_presses_as_in_closed_form() {
    let contact = sphere_on_plate(0.0);
    let out = contact.evaluate(&joint().pose(&Six::zeros()));
    // F = pi k R d^2 to first order in d / R
    let exact = std::f64::consts::PI * 5.0 * 20.0 * 0.3f64.powi(2);
    assert!((out.wrench[0].0.z / exact - 1.0).abs() < 0.03, "{} {exact}", out.wrench[0].0.z);
    assert!(out.wrench[0].0.xy().norm() < 0.1);
}

#[test]
fn gradient_and_hessian_match_finite_differences_of_the_energy() {
    let (joint, contact) = (joint(), sphere_on_plate(0.8));
    let q = Six::new(0.2, -0.03, 0.1, 0.4, 0.7, 0.1);
    let at = |q: &Six| contact.evaluate(&joint.pose(q));
    let here = at(&q);
    for j in 0..6 {
        let mut h = Six::zeros();
        h[j] = if j < 3 { 1e-5 } else { 1e-4 };
        let (up, down) = (at(&(q + h)), at(&(q - h)));
        let slope = (up.energy - down.energy) / (2.0 * h[j]);
        assert!((slope - here.gradient[j]).abs() < 2e-4 * here.gradient.amax(), "{j} {slope} {}", here.gradient[j]);
        let curve = (up.gradient - down.gradient) / (2.0 * h[j]);
        let miss = (curve - here.hessian.column(j)).amax();
        assert!(miss < 0.02 * here.hessian.column(j).amax(), "{j} {curve} {}", here.hessian.column(j));
    }
    let pose = joint.pose(&q);
    let (force, moment) = here.wrench[0];
    for j in 0..6 {
        let work = pose.screws[j].linear.dot(&force) + pose.screws[j].angular.dot(&moment);
        assert!((work + here.gradient[j]).abs() < 1e-6 * here.gradient.amax().max(1.0), "{j} {work}");
    }
}

#[test]
fn friction_slides_at_the_coulomb_limit_and_sticks_below_it() {
    let (joint, contact) = (joint(), sphere_on_plate(0.8));
    let pose = joint.pose(&Six::zeros());
    let normal = contact.evaluate(&pose).wrench[0].0.z;
    let patches = contact.patches(&pose, &FrictionState::default(), 0.01, &mut Nearby::default());
    let drag = |step: f64| {
        let mut g = Six::zeros();
        patches.add(&Six::new(0.0, 0.0, 0.0, 0.0, step, 0.0), &mut 0.0, &mut g, &mut Matrix6::zeros());
        g[crate::coordinate::AP]
    };
    assert!((drag(1.0) / (0.1 * normal) - 1.0).abs() < 0.02, "{} {normal}", drag(1.0));
    assert!((drag(0.001) / drag(1.0) - 0.1).abs() < 0.01);
    let held = patches.after(&Six::new(0.0, 0.0, 0.0, 0.0, 1.0, 0.0));
    let again = contact.patches(&pose, &held, 0.01, &mut Nearby::default());
    let mut g = Six::zeros();
    again.add(&Six::zeros(), &mut 0.0, &mut g, &mut Matrix6::zeros());
    assert!((g[crate::coordinate::AP] - drag(1.0)).abs() < 1e-6);
}

#[test]
fn lists_kept_from_pose_to_pose_change_no_byte() {
    change_no_byte(&sphere_on_plate(0.8));
    change_no_byte(&layered_sphere_on_plate(LayerLaw::Logarithmic, 0.4, 0.8));
}

fn change_no_byte(contact: &Contact) {
    let joint = joint();
    // cartilage that is thicker touches earlier, by the same lists
    let thicker = |by: f64| contact.with_law(&[-by, 1.0 - by], &[0.0, 5.0]).unwrap();
    let contacts = [contact.clone(), thicker(0.04), thicker(0.4), thicker(-0.3)];
    let (mut near, mut touching) = (Nearby::default(), 0);
    for k in 0..400 {
        let contact = &contacts[k as usize * 7 % 4];
        // over the rim and back, with steps from 0.01 to 2 mm
        let t = f64::from(k) * 0.05;
        let q = Six::new(
            0.3 * t.sin(),
            0.1 * (1.7 * t).cos(),
            t.cos(),
            11.0 * (0.9 * t).sin(),
            9.0 * (1.3 * t).cos(),
            0.8 * (7.0 * t).sin(),
        );
        let pose = joint.pose(&q);
        let (kept, fresh) = (contact.evaluate_near(&pose, &mut near), contact.evaluate(&pose));
        assert_eq!((kept.energy, kept.gradient, kept.hessian), (fresh.energy, fresh.gradient, fresh.hessian), "{k}");
        let (kept, fresh) = (contact.press_near(&pose, &mut near), contact.press(&pose));
        assert_eq!(
            (kept.energy, kept.force, kept.moment, kept.area),
            (fresh.energy, fresh.force, fresh.moment, fresh.area)
        );
        touching += usize::from(fresh.energy > 0.0);
    }
    assert!((100..390).contains(&touching), "{touching}");
}

/// Behind an open patch everything is deep, as far as the grid of its distance reaches.
#[test]
fn lists_hold_where_bones_are_pushed_through_each_other() {
    let (joint, contact) = (joint(), sphere_on_plate(0.8));
    // a law that begins so early has no bounds: every node is looked at
    let every = contact.with_law(&[-3.0, 0.0, 1.0], &[0.0, 0.0, 5.0]).unwrap();
    let (mut near, mut deepest) = (Nearby::default(), 0f64);
    for k in 0..600 {
        let t = f64::from(k) * 0.05;
        let q = Six::new(0.3 * t.sin(), 0.0, 0.2 * t.cos(), 25.0 * (0.9 * t).sin(), 3.0, 16.0 * (0.7 * t).sin());
        let pose = joint.pose(&q);
        let (kept, all) = (contact.evaluate_near(&pose, &mut near), every.evaluate(&pose));
        assert!((kept.energy - all.energy).abs() < 1e-9 * (1.0 + all.energy), "{k}: {} {}", kept.energy, all.energy);
        deepest = deepest.max(all.deepest);
    }
    assert!(deepest > 6.0, "{deepest}");
}

#[test]
fn nodes_passed_over_touch_nothing() {
    let (joint, contact) = (joint(), sphere_on_plate(0.8));
    let mut touching = 0;
    for k in 0..200 {
        let t = f64::from(k) * 0.1;
        let q = Six::new(0.3 * t.sin(), 0.1 * t.cos(), t.cos(), 11.0 * (0.9 * t).sin(), 9.0 * (1.3 * t).cos(), t.sin());
        let pose = joint.pose(&q);
        let mut every = 0.0;
        for pass in contact.passes(&pose) {
            for (p, area) in pass.nodes.position.iter().zip(&pass.nodes.area) {
                let p = pass.field_from_nodes * meshes::Point::from(*p);
                let sample = pass.field.sample::<false>(&[p.x, p.y, p.z], 0.0);
                every += sample.map_or(0.0, |s| pass.share * area * contact.law.at(-s.distance).0);
            }
        }
        let listed = contact.press(&pose).energy;
        assert!((listed - every).abs() <= 1e-9 * every, "{k}: {listed} of {every}");
        touching += usize::from(every > 0.0);
    }
    assert!((50..195).contains(&touching), "{touching}");
}

#[test]
fn nothing_beyond_the_rim_is_in_contact() {
    let (joint, contact) = (joint(), sphere_on_plate(0.0));
    let out = contact.evaluate(&joint.pose(&Six::new(0.0, 0.0, 0.0, 30.0, 0.0, 0.0)));
    assert_eq!(out.energy, 0.0);
}

#[test]
fn deep_overclosure_does_not_flip() {
    let (joint, contact) = (joint(), sphere_on_plate(0.8));
    let force = |depth: f64| contact.evaluate(&joint.pose(&Six::new(0.0, 0.0, 0.0, 0.0, 0.0, depth))).wrench[0].0.z;
    assert!(force(1.5) > force(1.0) && force(1.0) > force(0.3) && force(3.0) > force(1.5));
}

#[test]
fn an_inside_out_or_broken_surface_is_refused() {
    let at = field::bone_frame(&frame());
    let fault = |mesh: &TriMesh| Field::new(mesh, at, "s").unwrap_err().to_string();
    assert!(fault(&icosphere(5.0, 2).flipped()).contains("inside out"));
    let mut twisted = plate(4);
    twisted.triangles[0].swap(0, 1);
    assert!(fault(&twisted).contains("opposite"));
    let mut nan = plate(4);
    nan.vertices[3].x = f64::NAN;
    assert!(fault(&nan).contains("vertex 3"));
}

#[test]
fn a_side_is_shared_by_equal_surfaces_alone() {
    let frame = field::bone_frame(&frame());
    let source = |mesh: TriMesh, spacing_mm: f64| compiled::Source { mesh, thickness: Vec::new(), frame, spacing_mm };
    let plate = plate(6);
    let mut moved = plate.clone();
    moved.vertices[7].z += 1e-12;
    let side = |mesh: &TriMesh, spacing_mm: f64| compiled::side(source(mesh.clone(), spacing_mm), "plate").unwrap();
    let first = side(&plate, 0.8);
    assert!(Arc::ptr_eq(&first, &side(&plate, 0.8)));
    assert!(!Arc::ptr_eq(&first, &side(&moved, 0.8)));
    assert!(!Arc::ptr_eq(&first, &side(&plate, 0.7)));
    let deeper = frame * Isometry::translation(0.0, 0.0, 1e-9);
    let turned = compiled::Source { frame: deeper, ..source(plate.clone(), 0.8) };
    assert!(!Arc::ptr_eq(&first, &compiled::side(turned, "plate").unwrap()));
    let layered = compiled::Source { thickness: vec![2.0; plate.vertices.len()], ..source(plate, 0.8) };
    assert!(!Arc::ptr_eq(&first, &compiled::side(layered, "plate").unwrap()));
}
