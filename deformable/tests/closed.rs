//! Closed answers.

use super::*;
use deformable::press::{PressOptions, press};
use deformable::{Ramp, State, compile, fields};

#[test]
fn patch_of_distorted_elements_is_exact() {
    let mesh = distorted(block([3, 3, 3], [3.0; 3]), 0.2, true);
    let outer = |p: &Point| (0..3).any(|a| p[a] < 1e-9 || p[a] > 3.0 - 1e-9);
    for law in [Law::Linear, Law::NeoHookean] {
        let assembly = Assembly {
            bodies: vec![fixed()],
            solids: vec![solid(mesh.clone(), material(law, 12.0, 0.45))],
            rigid_faces: vec![],
            pairs: vec![],
        };
        let model = compile(assembly, &relaxed()).unwrap();
        let mut state = State::new(&model);
        let f = nalgebra::Matrix3::new(1.1, 0.07, -0.04, 0.02, 0.93, 0.05, -0.03, 0.06, 0.98);
        for (n, p) in mesh.nodes.iter().enumerate() {
            state.set(n, Point::from(f * p.coords), Vector::zeros());
        }
        let forces = state.internal_forces(&model).unwrap();
        let at_rest = mesh.nodes.iter().zip(&forces).filter(|(p, _)| !outer(p)).map(|(_, f)| f.norm());
        let inner = at_rest.fold(0.0, f64::max);
        let size = forces.iter().map(|f| f.norm()).fold(0.0, f64::max);
        let stress = fields(&model, &state, 0).stress_mpa;
        let spread = stress.iter().flat_map(|s| (0..6).map(|k| (s[k] - stress[0][k]).abs())).fold(0.0, f64::max);
        println!("patch {law:?}: inner forces {:.1e} of the outer, stress uniform to {spread:.1e} MPa", inner / size);
        assert!(inner < 1e-13 * size && spread < 1e-12);
    }
}

/// Presses a cube on rollers, or confined, down by a plate; gives force, area, height.
fn compressed(confined: bool, law: Law) -> (f64, f64, f64) {
    let (mut assembly, m) = {
        let cube = distorted(block([2, 2, 4], [2.0; 3]), 0.1, true);
        let m = material(law, 12.0, 0.45);
        (under_plate(on_rollers(cube, m), 2.0, 2.0, 2.0), m)
    };
    if confined {
        let nodes = assembly.solids[0].mesh.nodes.len() as u32;
        assembly.solids[0].rollers =
            (0..nodes).map(|n| (n, [true, true, assembly.solids[0].mesh.nodes[n as usize].z < 1e-9])).collect();
    }
    let model = compile(assembly, &Options { penalty_mpa_per_mm: 3000.0, ..relaxed() }).unwrap();
    let mut state = State::new(&model);
    let down = -Vector::z();
    let options =
        PressOptions { imbalance: 1e-6, kinetic_share: 1e-10, settle_increments: 20000, ..PressOptions::default() };
    for k in 0..4 {
        let (from, to) = (0.05 * f64::from(k), 0.05 * f64::from(k + 1));
        let level = press((&model, &mut state), (1, &down), (from, to), &options).unwrap();
        assert!(level.at_rest, "{level:?}");
    }
    let force = -state.reaction(1).0.dot(&down);
    let places = fields(&model, &state, 0).places;
    let top = model.solids()[0].mesh.articular_nodes.iter().map(|&n| places[n as usize]);
    let (high, z) = top.fold((0f64, 0f64), |m, p| (m.0.max(p.x), m.1.max(p.z)));
    let _ = m;
    (force, high * high, z)
}

#[test]
fn uniaxial_and_confined_compression_are_exact() {
    let m = material(Law::Linear, 12.0, 0.45);
    let (force, area, height) = compressed(false, Law::Linear);
    let expected = -12.0 * (height / 2.0).ln() * area;
    println!("uniaxial: {force:.6} N, E ln(stretch) A = {expected:.6} N, off by {:.1e}", force / expected - 1.0);
    assert!((force / expected - 1.0).abs() < 1e-4);
    let wide: f64 = (height / 2.0).powf(-0.45);
    assert!((area - 4.0 * wide * wide).abs() < 1e-4, "{area}");
    let (force, area, height) = compressed(true, Law::Linear);
    let expected = -m.confined() * (height / 2.0).ln() * area;
    println!("confined: {force:.6} N, M ln(stretch) A = {expected:.6} N, off by {:.1e}", force / expected - 1.0);
    assert!((force / expected - 1.0).abs() < 1e-4);
    let (force, area, height) = compressed(true, Law::NeoHookean);
    let (j, bulk): (f64, f64) = (height / 2.0, m.lambda() + 2.0 * m.mu() / 3.0);
    let expected = -(bulk * (j - 1.0) + 2.0 / 3.0 * m.mu() * j.powf(-5.0 / 3.0) * (j * j - 1.0)) * area;
    println!("confined, neo-Hookean: {force:.6} N, closed {expected:.6} N, off by {:.1e}", force / expected - 1.0);
    assert!((force / expected - 1.0).abs() < 1e-4);
}

/// Tip force of a beam 20 x 1 x 2 mm whose ends stay parallel, over that of Timoshenko's beam.
fn bending(layers: usize, kappa: f64) -> f64 {
    let (length, wide, high) = (20.0, 1.0, 2.0);
    let n = [5 * layers.max(2), 1, layers];
    let mut mesh = block(n, [length, wide, high]);
    let end = |x: f64| {
        (0..mesh.nodes.len() as u32).filter(|&k| (mesh.nodes[k as usize].x - x).abs() < 1e-9).collect::<Vec<_>>()
    };
    let (root, tip) = (end(0.0), end(length));
    mesh.bony_nodes = root;
    let m = material(Law::Linear, 12.0, 0.0);
    // the tip is pushed down by all its nodes alike: ends stay parallel
    let bodies = vec![fixed(), moved(Vector::zeros())];
    let second = HexMesh { bony_nodes: tip, ..mesh.clone() };
    let joined =
        Solid { rollers: second.bony_nodes.iter().map(|&k| (k, [true, true, false])).collect(), ..solid(mesh, m) };
    let assembly = Assembly { bodies, solids: vec![joined], rigid_faces: vec![], pairs: vec![] };
    let options = Options { hourglass_stiffness: kappa, ..relaxed() };
    let model = compile(assembly, &options).unwrap();
    let mut state = State::new(&model);
    let down = 0.02;
    for &k in &second.bony_nodes {
        let p = second.nodes[k as usize];
        state.set(k as usize, p - Vector::z() * down, Vector::zeros());
    }
    // tip nodes are held where they were put
    let held: Vec<(usize, Point)> =
        second.bony_nodes.iter().map(|&k| (k as usize, second.nodes[k as usize] - Vector::z() * down)).collect();
    for _ in 0..60_000 {
        state.advance(&model).unwrap();
        held.iter().for_each(|(k, p)| state.set(*k, *p, Vector::zeros()));
        if state.increments > 1000 && state.energy.kinetic < 1e-13 {
            break;
        }
    }
    let force = -state.reaction(0).0.z;
    let (area, second_moment) = (wide * high, wide * high.powi(3) / 12.0);
    let compliance = length.powi(3) / (12.0 * 12.0 * second_moment) + length / (5.0 / 6.0 * 6.0 * area);
    force.abs() * compliance / down
}

#[test]
fn bending_converges_with_layers_and_hourglass_control_holds_one_layer() {
    let mut errors = Vec::new();
    for layers in [1, 2, 4, 8] {
        let ratio = bending(layers, 0.05);
        println!("bending, {layers} layers: {ratio:.4} of Timoshenko's force");
        errors.push((ratio - 1.0).abs());
    }
    let order = (errors[2] / errors[3]).log2();
    println!("bending: order {order:.2}");
    assert!(errors[3] < 0.02 && order > 1.6);
    let free = bending(1, 0.001);
    println!("bending, 1 layer with kappa 0.001: {free:.4}");
    assert!(free < 0.2, "without control one layer has no stiffness in bending");
}

#[test]
fn waves_travel_at_their_speed() {
    let (n, length) = (200, 100.0);
    let mesh = block([1, 1, n], [0.5, 0.5, length]);
    let nodes = mesh.nodes.len() as u32;
    let m = material(Law::Linear, 12.0, 0.45);
    let rollers = (0..nodes).map(|k| (k, [true, true, false])).collect();
    let mut bar = Solid { rollers, ..solid(mesh, m) };
    let last = bar.mesh.articular_nodes.clone();
    bar.body = 0;
    let velocity = 10.0;
    let push = Motion::Prescribed {
        turn: Vector::zeros(),
        about: Point::origin(),
        shift: Vector::z() * velocity,
        ramp: Ramp::constant(0.0),
    };
    let assembly = Assembly {
        bodies: vec![Body { name: "end".into(), motion: push }],
        solids: vec![bar],
        rigid_faces: vec![],
        pairs: vec![],
    };
    let options = Options { damping: Damping::Mass(0.0), safety: 0.9, ..Options::default() };
    let model = compile(assembly, &options).unwrap();
    let mut state = State::new(&model);
    let (quarter, dt) = (4 * 50, model.masses().increment_s);
    let mut arrival = [None; 2];
    for _ in 0..100_000 {
        let now = state.time + dt;
        // the end moves at a constant velocity from the start
        let shift = Vector::z() * velocity * now;
        state.motions[0] =
            Motion::Prescribed { turn: Vector::zeros(), about: Point::origin(), shift, ramp: Ramp::constant(1.0) };
        let before: Vec<Point> = state.places().collect();
        state.advance(&model).unwrap();
        let after: Vec<Point> = state.places().collect();
        for (slot, node) in arrival.iter_mut().zip([quarter, 3 * quarter]) {
            if slot.is_none() && (after[node].z - before[node].z) / dt > velocity / 2.0 {
                *slot = Some(state.time);
            }
        }
        if arrival[1].is_some() {
            break;
        }
    }
    let speed = 50.0 / (arrival[1].unwrap() - arrival[0].unwrap());
    println!(
        "wave speed {speed:.1} mm/s, sqrt(M / density) {:.1}, off by {:.2e}",
        m.wave_speed(),
        speed / m.wave_speed() - 1.0
    );
    assert!((speed / m.wave_speed() - 1.0).abs() < 0.01);
    assert_eq!(last.len(), 4);
}

#[test]
fn increments_are_of_second_order() {
    let end = |safety: f64| {
        let mesh = block([1, 1, 8], [1.0, 1.0, 8.0]);
        let nodes = mesh.nodes.len() as u32;
        let m = material(Law::NeoHookean, 12.0, 0.45);
        let rollers = (0..nodes).map(|k| (k, [true, true, false])).collect();
        let bar = Solid { rollers, ..solid(mesh, m) };
        let assembly = Assembly { bodies: vec![fixed()], solids: vec![bar], rigid_faces: vec![], pairs: vec![] };
        let options = Options { damping: Damping::Mass(0.0), safety, ..Options::default() };
        let model = compile(assembly, &options).unwrap();
        let mut state = State::new(&model);
        let z = |p: &Point| Vector::z() * (0.1 * (p.z * std::f64::consts::PI / 16.0).sin());
        let start: Vec<Point> = state.places().collect();
        for (n, p) in start.iter().enumerate().skip(4) {
            state.set(n, p + z(p), Vector::zeros());
        }
        // velocities lie half an increment back: of an even motion they are those of half an increment on, turned round
        let dt = model.masses().increment_s;
        let forces = state.internal_forces(&model).unwrap();
        let mass = 1.81e-8 / 4.0;
        for (n, p) in start.iter().enumerate().skip(4) {
            let m = if n >= 32 { mass / 2.0 } else { mass };
            let back = Vector::new(0.0, 0.0, forces[n].z) * (-0.5 * dt / m);
            state.set(n, p + z(p), back);
        }
        let count = (64.0 * 0.8 / safety).round() as usize;
        (0..count).for_each(|_| state.advance(&model).unwrap());
        (state.places().last().unwrap().z, state.time)
    };
    // increments that divide the same time
    let dt = |safety: f64| end(safety);
    let (a, b, c) = (dt(0.8), dt(0.4), dt(0.2));
    assert!((a.1 - b.1).abs() < 1e-12 && (b.1 - c.1).abs() < 1e-12, "{a:?} {b:?} {c:?}");
    let order = ((a.0 - b.0) / (b.0 - c.0)).abs().log2();
    println!(
        "increments halved: tip moves by {:.2e}, then {:.2e} mm: order {order:.2}",
        (a.0 - b.0).abs(),
        (b.0 - c.0).abs()
    );
    assert!((order - 2.0).abs() < 0.2);
}
