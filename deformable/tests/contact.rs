//! Contact against closed answers.

use super::*;
use deformable::press::{PressOptions, press};
use deformable::{State, compile};

/// A rigid sphere of radius 10 mm pressed 0.1 mm into a bonded layer of 12 mm, a quarter of it: force over that of a layer [dimitriadis2002].
#[test]
fn a_sphere_on_a_layer_presses_as_the_series_says() {
    let (radius, depth) = (10.0, 0.1);
    let mut ratios = Vec::new();
    for n in [10, 20] {
        let size = 12.0;
        // elements crowd towards the corner that the sphere touches
        let mut mesh = block([n, n, n], [1.0; 3]);
        let crowd = |t: f64| size * (0.25 * t + 0.75 * t * t * t);
        mesh.nodes.iter_mut().for_each(|p| *p = Point::new(crowd(p.x), crowd(p.y), size - crowd(1.0 - p.z)));
        let mut half = solid(mesh, material(Law::Linear, 12.0, 0.3));
        half.rollers = half
            .mesh
            .nodes
            .iter()
            .enumerate()
            .map(|(k, p)| (k as u32, [p.x < 1e-9, p.y < 1e-9, false]))
            .filter(|(_, a)| a[0] || a[1])
            .collect();
        let m = 24;
        let mut sphere = RigidFace { name: "sphere".into(), nodes: vec![], quads: vec![], body: 1 };
        for j in 0..=m {
            for i in 0..=m {
                let (x, y) = (3.0 * f64::from(i) / f64::from(m) - 0.5, 3.0 * f64::from(j) / f64::from(m) - 0.5);
                sphere.nodes.push(Point::new(x, y, size + radius - (radius * radius - x * x - y * y).sqrt()));
                if i < m && j < m {
                    let k = (j * (m + 1) + i) as u32;
                    let m = m as u32;
                    sphere.quads.push([k, k + m + 1, k + m + 2, k + 1]);
                }
            }
        }
        let assembly = Assembly {
            bodies: vec![fixed(), moved(Vector::zeros())],
            solids: vec![half],
            rigid_faces: vec![sphere],
            pairs: vec![[Face::Articular(0), Face::Rigid(0)]],
        };
        let model = compile(assembly, &Options { penalty_mpa_per_mm: 1000.0, ..relaxed() }).unwrap();
        let mut state = State::new(&model);
        let level = press((&model, &mut state), (1, &-Vector::z()), (0.0, depth), &PressOptions::default()).unwrap();
        let stiffness = 12.0 / (1.0 - 0.3f64.powi(2));
        let hertz = 4.0 / 3.0 * stiffness * radius.sqrt() * depth.powf(1.5) / 4.0;
        let (a, chi) = (-(1.2876 - 1.4678 * 0.3 + 1.3442 * 0.09) / 0.7, (radius * depth).sqrt() / size);
        let b = (0.6387 - 1.0277 * 0.3 + 1.5164 * 0.09) / 0.7;
        let pi = std::f64::consts::PI;
        let layer = 1.0 - 2.0 * a / pi * chi + 4.0 * a * a / (pi * pi) * chi * chi
            - 8.0 / pi.powi(3) * (a.powi(3) + 4.0 * pi * pi / 15.0 * b) * chi.powi(3);
        let ratio = level.force_n / (hertz * layer);
        println!(
            "sphere, {n} elements a side: {ratio:.4} of a layer's force, {:.4} of a half space's",
            level.force_n / hertz
        );
        assert!(level.at_rest, "{level:?}");
        ratios.push(ratio);
    }
    assert!((ratios[1] - 1.0).abs() < 0.02, "{ratios:?}");
}
