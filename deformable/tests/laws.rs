//! Laws: rotation, energy, threads.

use super::*;
use deformable::press::{PressOptions, press};
use deformable::{Ramp, State, compile, fields};
use nalgebra::Rotation3;

#[test]
fn a_rotation_leaves_no_stress_and_turns_what_there_is() {
    let mesh = distorted(block([3, 3, 3], [3.0; 3]), 0.15, false);
    for law in [Law::Linear, Law::NeoHookean] {
        let assembly = Assembly {
            bodies: vec![fixed()],
            solids: vec![solid(mesh.clone(), material(law, 12.0, 0.45))],
            rigid_faces: vec![],
            pairs: vec![],
        };
        let model = compile(assembly, &Options::default()).unwrap();
        let turn = Rotation3::from_scaled_axis(Vector::new(1.0, -0.7, 2.1));
        let bent = |p: &Point| p + Vector::new(0.1 * (p.z).sin(), 0.05 * p.x * p.y, -0.04 * p.z * p.x);
        let forces = |place: &dyn Fn(&Point) -> Point| {
            let mut state = State::new(&model);
            for (n, p) in mesh.nodes.iter().enumerate() {
                state.set(n, place(p), Vector::zeros());
            }
            state.internal_forces(&model).unwrap()
        };
        let turned = forces(&|p| turn * p);
        let (straight, both) = (forces(&|p| bent(p)), forces(&|p| turn * bent(p)));
        let largest = straight.iter().map(|f| f.norm()).fold(0.0, f64::max);
        let left = turned.iter().map(|f| f.norm()).fold(0.0, f64::max);
        let off = straight.iter().zip(&both).map(|(a, b)| (turn * a - b).norm()).fold(0.0, f64::max);
        println!("rotation {law:?}: {left:.1e} N left of {largest:.2} N; forces turn with it to {:.1e}", off / largest);
        assert!(left < 1e-12 * largest.max(1.0) && off < 1e-12 * largest);
    }
}

/// Two blocks pressed and rubbed together as they swing, real masses.
fn rubbed() -> (Assembly, Options) {
    let below = solid(block([6, 6, 3], [6.0, 6.0, 3.0]), material(Law::NeoHookean, 12.0, 0.45));
    let mut upper = block([4, 4, 3], [4.0, 4.0, 3.0]);
    // upside down, a little above, not node over node
    upper.nodes.iter_mut().for_each(|p| *p = Point::new(p.x + 0.93, 5.1 - p.y, 6.02 - p.z));
    let upper = Solid { name: "upper".into(), body: 1, ..solid(upper, material(Law::NeoHookean, 12.0, 0.45)) };
    let motion = Motion::Prescribed {
        turn: Vector::zeros(),
        about: Point::origin(),
        shift: Vector::new(0.5, 0.0, -0.35),
        ramp: Ramp::over(6e-4),
    };
    let assembly = Assembly {
        bodies: vec![fixed(), Body { name: "press".into(), motion }],
        solids: vec![below, upper],
        rigid_faces: vec![],
        pairs: vec![[Face::Articular(0), Face::Articular(1)]],
    };
    (assembly, Options { friction: 0.3, hourglass_viscosity: 0.02, ..Options::default() })
}

#[test]
fn energy_is_booked_to_the_end() {
    let (assembly, options) = rubbed();
    let run = |safety: f64| {
        let model = compile(assembly.clone(), &Options { safety, ..options.clone() }).unwrap();
        let mut state = State::new(&model);
        while state.time < 1e-3 {
            state.advance(&model).unwrap();
        }
        // energies are those of the last increment's start; the closed one of its end
        let closed = state.neo_hookean_energy(&model);
        (state.energy, closed)
    };
    let (e, closed) = run(0.4);
    println!("{e}; strain energy closed {closed:.3e}; balance {:.1e}", e.balance_error());
    assert!(e.friction > 0.01 * e.external && e.kinetic > 0.0 && e.hourglass_viscous > 0.0);
    assert!(e.balance_error() < 5e-3 && (e.strain / closed - 1.0).abs() < 0.02);
}

#[test]
fn without_contact_the_balance_is_of_second_order() {
    let run = |safety: f64| {
        let motion = Motion::Prescribed {
            turn: Vector::new(0.0, 0.3, 0.0),
            about: Point::origin(),
            shift: Vector::new(0.4, 0.1, 0.2),
            ramp: Ramp::over(4e-4),
        };
        let mesh = distorted(block([3, 3, 5], [3.0, 3.0, 5.0]), 0.1, false);
        let assembly = Assembly {
            bodies: vec![Body { name: "shaken".into(), motion }],
            solids: vec![solid(mesh, material(Law::NeoHookean, 12.0, 0.45))],
            rigid_faces: vec![],
            pairs: vec![],
        };
        let model = compile(assembly, &Options { safety, ..Options::default() }).unwrap();
        let mut state = State::new(&model);
        while state.time < 8e-4 {
            state.advance(&model).unwrap();
        }
        // what the ledger has as work against the mean stress, over what the places alone say
        let off = (state.energy.strain - state.neo_hookean_energy(&model)) / state.energy.largest;
        (state.energy.balance_error(), off)
    };
    let (coarse, fine) = (run(0.6), run(0.3));
    println!(
        "shaken block: balance {:.1e}, {:.1e} at half the increment; strain energy off by {:.1e}, {:.1e}",
        coarse.0, fine.0, coarse.1, fine.1
    );
    assert!(fine.0 < 1e-4 && fine.0 < 0.35 * coarse.0 && fine.1.abs() < 4e-3 && fine.1.abs() < 0.8 * coarse.1.abs());
}

#[test]
fn threads_do_not_change_a_byte() {
    let (assembly, options) = rubbed();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let model = compile(assembly.clone(), &options).unwrap();
            let mut state = State::new(&model);
            (0..300).for_each(|_| state.advance(&model).unwrap());
            (state.places().collect::<Vec<_>>(), state.energy)
        })
    };
    assert_eq!(run(1), run(2));
}

#[test]
fn forces_are_equal_and_opposite_and_move_with_the_frame() {
    let (assembly, _) = rubbed();
    let turn = nalgebra::Isometry3::new(Vector::new(20.0, -7.0, 3.0), Vector::new(0.4, 1.1, -0.6));
    let pressed = |assembly: Assembly, down: Vector| {
        let model = compile(assembly, &Options { friction: 0.03, ..relaxed() }).unwrap();
        let mut state = State::new(&model);
        let level = press((&model, &mut state), (1, &down), (0.0, 0.25), &PressOptions::default()).unwrap();
        (level, state.reaction(0).0, state.reaction(1).0)
    };
    let mut turned = assembly.clone();
    for s in &mut turned.solids {
        s.mesh.nodes.iter_mut().for_each(|p| *p = turn * *p);
    }
    let (a, low, high) = pressed(assembly, -Vector::z());
    let (b, low_turned, _) = pressed(turned, turn * -Vector::z());
    let apart = (low + high).norm() / a.force_n;
    let moved = (turn * low - low_turned).norm() / a.force_n;
    println!(
        "pressed: {:.3} N, bodies' forces differ by {apart:.1e}, moved with the frame to {moved:.1e}, kinetic share {:.1e}",
        a.force_n, a.kinetic_share
    );
    assert!(a.at_rest && b.at_rest && apart < 2e-3 && moved < 1e-6);
    assert!((a.peak_pressure_mpa / b.peak_pressure_mpa - 1.0).abs() < 1e-6);
}

#[test]
fn a_loaded_body_comes_to_rest_under_its_load() {
    let (mut assembly, options) = rubbed();
    let load = |guide| Motion::Loaded {
        mass_tonne: 1e-6,
        inertia_tonne_mm2: 1e-5,
        centre: Point::new(2.93, 3.1, 6.0),
        guide,
        force: Vector::new(0.0, 0.0, -8.0),
        moment: Vector::zeros(),
        ramp: Ramp::over(1e-3),
    };
    for guide in [Some(Vector::z()), None] {
        assembly.bodies[1].motion = load(guide);
        let options = Options { damping: Damping::Mass(4e3), friction: 0.3, ..options.clone() };
        let model = compile(assembly.clone(), &options).unwrap();
        let mut state = State::new(&model);
        while state.time < 8e-3 {
            state.advance(&model).unwrap();
        }
        let (below, above) = (state.reaction(0).0.z, state.reaction(1).0.z);
        println!(
            "loaded with 8 N, guide {guide:?}: {below:.4} and {above:.4} N, balance {:.1e}",
            state.energy.balance_error()
        );
        assert!((below + 8.0).abs() < 0.04 && (above - 8.0).abs() < 0.04);
        assert!(state.energy.balance_error() < 0.01);
        assert!(fields(&model, &state, 0).contact_pressure_mpa.iter().any(|p| *p > 0.1));
    }
}
