//! Errors that say what is wrong.

use super::*;
use deformable::{Ramp, State, compile};

type Change = Box<dyn Fn(&mut Assembly)>;

fn refused(change: impl Fn(&mut Assembly)) -> String {
    let mut assembly = under_plate(solid(block([2, 2, 2], [2.0; 3]), material(Law::Linear, 12.0, 0.45)), 2.1, 1.0, 2.0);
    change(&mut assembly);
    compile(assembly, &Options::default()).unwrap_err().to_string()
}

#[test]
fn bad_input_is_named() {
    let cases: [(&str, Change); 12] = [
        ("element 3 is inverted", Box::new(|a| a.solids[0].mesh.elements[3].rotate_left(4))),
        ("element 0 has no thickness", Box::new(|a| a.solids[0].mesh.nodes.iter_mut().for_each(|p| p.z = 0.0))),
        ("fixed to nothing", Box::new(|a| a.solids[0].mesh.bony_nodes.clear())),
        ("E is 12000000", Box::new(|a| a.solids[0].material.youngs_modulus_mpa = 12e6)),
        ("lengths are in mm", Box::new(|a| a.solids[0].mesh.nodes.iter_mut().for_each(|p| p.coords *= 1e-3))),
        ("density is 1000", Box::new(|a| a.solids[0].material.density_tonne_mm3 = 1000.0)),
        ("Poisson's ratio is 0.5", Box::new(|a| a.solids[0].material.poissons_ratio = 0.5)),
        ("node 5", Box::new(|a| a.solids[0].mesh.nodes[5].x = f64::NAN)),
        ("not there", Box::new(|a| a.solids[0].mesh.elements[1][2] = 999)),
        ("no body 7", Box::new(|a| a.solids[0].body = 7)),
        ("no such face", Box::new(|a| a.pairs[0][1] = Face::Rigid(3))),
        ("has no face", Box::new(|a| a.solids[0].mesh.articular_quads.clear())),
    ];
    for (words, change) in cases {
        let told = refused(change);
        assert!(told.contains(words), "{words}: {told}");
    }
    let mut assembly = under_plate(solid(block([2, 2, 2], [2.0; 3]), Material::cartilage()), 2.1, 1.0, 2.0);
    assembly.bodies[1].motion = Motion::Loaded {
        mass_tonne: 0.0,
        inertia_tonne_mm2: 0.0,
        centre: Point::origin(),
        guide: None,
        force: Vector::z(),
        moment: Vector::zeros(),
        ramp: Ramp::over(1.0),
    };
    assert!(compile(assembly, &Options::default()).unwrap_err().to_string().contains("needs a mass"));
}

#[test]
fn a_blow_up_and_a_turned_element_are_told() {
    let mesh = block([2, 2, 2], [2.0; 3]);
    let assembly = Assembly {
        bodies: vec![fixed()],
        solids: vec![solid(mesh, Material::cartilage())],
        rigid_faces: vec![],
        pairs: vec![],
    };
    let model = compile(assembly, &Options::default()).unwrap();
    let mut state = State::new(&model);
    state.set(26, Point::new(2.0, 2.0, 2.0), Vector::new(0.0, 0.0, 1e9));
    let told = state.advance(&model).unwrap_err().to_string();
    assert!(told.contains("blew up at increment 1"), "{told}");
    let mut state = State::new(&model);
    for n in 18..27 {
        let p = state.places().nth(n).unwrap();
        state.set(n, p - Vector::z() * 1.5, Vector::zeros());
    }
    let told = state.advance(&model).unwrap_err().to_string();
    assert!(told.contains("element 4 turned over"), "{told}");
}
