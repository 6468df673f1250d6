//! Paths over shapes whose shortest path is known, and derivatives against differences.

use super::*;
use crate::joint::Joint;
use crate::ligament::Fibre;
use crate::spec::{FramesSpec, PoseSpec};
use meshes::frame::{AnatomicalFrame, Side};
use meshes::shapes::icosphere;
use meshes::surface::TriMesh;

/// Radius of the ball and of the bar [mm].
const RADIUS: f64 = 20.0;

fn frames() -> FramesSpec {
    let frame = AnatomicalFrame {
        origin: Point::origin(),
        medial: -Vector::x(),
        anterior: -Vector::y(),
        superior: Vector::z(),
    };
    FramesSpec { femur: frame, tibia: frame, gs_ct_pose: PoseSpec::default(), chain: None, grid: None }
}

fn obstacle(mesh: &TriMesh) -> Obstacle {
    Obstacle::new(mesh, bone_frame(&frames().femur), [-200.0, 200.0], "a bone").unwrap()
}

/// A closed bar along x.
fn bar(radius: f64) -> TriMesh {
    let (around, along, half) = (96_u32, 60_u32, 60.0);
    let mut mesh = TriMesh::default();
    for i in 0..=along {
        let x = (f64::from(i) / f64::from(along) * 2.0 - 1.0) * half;
        for j in 0..around {
            let (sin, cos) = (f64::from(j) / f64::from(around) * std::f64::consts::TAU).sin_cos();
            mesh.vertices.push(Point::new(x, radius * cos, radius * sin));
        }
    }
    for i in 0..along {
        for j in 0..around {
            let (a, b) = (i * around + j, i * around + (j + 1) % around);
            mesh.triangles.push([a, b, b + around]);
            mesh.triangles.push([a, b + around, a + around]);
        }
    }
    for (ring, x) in [(0, -half), (along, half)] {
        let centre = mesh.vertices.len() as u32;
        mesh.vertices.push(Point::new(x, 0.0, 0.0));
        for j in 0..around {
            let (a, b) = (ring * around + j, ring * around + (j + 1) % around);
            mesh.triangles.push(if ring == 0 { [b, a, centre] } else { [a, b, centre] });
        }
    }
    if mesh.volume() < 0.0 { mesh.flipped() } else { mesh }
}

fn at_rest() -> Pose {
    Joint::new(&frames(), Side::Left).unwrap().pose(&Six::zeros())
}

fn over_femur(mesh: &TriMesh) -> Arc<Bones> {
    Arc::new(Bones { tibia: None, femur: Some(obstacle(mesh)) })
}

fn fibre(bones: &Arc<Bones>, femur: [f64; 3], tibia: [f64; 3]) -> Fibre {
    let (femur, tibia) = (Vector::from(femur), Vector::from(tibia));
    Fibre::straight(0, femur, tibia, (femur - tibia).norm()).over(bones)
}

/// Shortest way round a circle between two points of its plane outside it.
fn round(a: [f64; 2], b: [f64; 2], radius: f64) -> f64 {
    let [da, db] = [a, b].map(|p| p[0].hypot(p[1]));
    let angle = ((a[0] * b[0] + a[1] * b[1]) / (da * db)).acos();
    let tangents = (da * da - radius * radius).sqrt() + (db * db - radius * radius).sqrt();
    let arc = angle - (radius / da).acos() - (radius / db).acos();
    if arc > 0.0 { tangents + radius * arc } else { (a[0] - b[0]).hypot(a[1] - b[1]) }
}

/// Ends above and below that are pulled over the front by degrees; half of them take it by more than a hand's breadth.
const HEIGHTS: [f64; 5] = [4.0, 9.0, 14.0, 18.0, 24.0];

#[test]
fn over_a_ball_the_length_is_that_of_tangents_and_arc() {
    let bones = over_femur(&icosphere(RADIUS, 5));
    for y in HEIGHTS {
        // the ball's centre is not in the plane of the coordinates: three axes take part
        let fibre = fibre(&bones, [6.0, -y, 45.0], [-8.0, -y, -38.0]);
        let (a, b) = (Vector::new(6.0, -y, 45.0), Vector::new(-8.0, -y, -38.0));
        let across = a.normalize();
        let beside = (b - across * across.dot(&b)).normalize();
        let flat = |p: &Vector| [p.dot(&across), p.dot(&beside)];
        // a node may lie a little deep, and a chord deeper
        let [low, high] = [RADIUS - 3.0 * ALLOWED, RADIUS].map(|r| round(flat(&a), flat(&b), r));
        let length = fibre.initial_length;
        assert!(length > low - 0.02 && length < high + 0.02, "{y}: {length}, expected {low} to {high}");
    }
}

#[test]
fn over_a_bar_the_length_is_that_of_the_unrolled_surface() {
    let bones = over_femur(&bar(RADIUS));
    for y in HEIGHTS {
        for along in [0.0, 15.0, 40.0] {
            let fibre = fibre(&bones, [along / 2.0, -y, 45.0], [-along / 2.0, -y, -38.0]);
            let flat = |r: f64| round([-y, 45.0], [-y, -38.0], r).hypot(along);
            let (low, high) = (flat(RADIUS - 3.0 * ALLOWED), flat(RADIUS));
            let length = fibre.initial_length;
            assert!(length > low - 0.02 && length < high + 0.02, "{y}, {along}: {length}, expected {low} to {high}");
        }
    }
}

#[test]
fn a_larger_bone_makes_a_longer_path_and_one_out_of_the_way_none() {
    let mut last = 0.0;
    for radius in [8.0, 12.0, 16.0, 19.0, 22.0, 25.0] {
        let fibre = fibre(&over_femur(&icosphere(radius, 5)), [3.0, -10.0, 45.0], [0.0, -10.0, -38.0]);
        let straight = (fibre.femur - fibre.tibia).norm();
        let length = fibre.initial_length;
        assert!(length >= straight - 1e-9 && length >= last - 1e-9, "{radius}: {length} after {last}");
        assert!(radius > 9.0 || length == straight, "a ball of {radius} mm is out of the way");
        assert!(radius < 15.0 || length > straight + 0.5, "{radius}: {length}");
        last = length;
    }
}

#[test]
fn a_path_stays_out_of_the_bone() {
    let mesh = icosphere(RADIUS, 5);
    let bones = over_femur(&mesh);
    for y in HEIGHTS {
        let way = fibre(&bones, [6.0, -y, 45.0], [-8.0, -y, -38.0]).way(&at_rest());
        for pair in way.windows(2) {
            for k in 0..10 {
                let p = pair[0] + (pair[1] - pair[0]) * (f64::from(k) / 10.0);
                assert!(RADIUS - p.coords.norm() < 0.5, "{y}: {} mm deep", RADIUS - p.coords.norm());
            }
        }
    }
}

/// A fibre over a ball of the femur that leans on a ball of the tibia, too, and coordinates away from CT.
fn between_two() -> (Joint, Fibre, Vec<Six>) {
    let joint = Joint::new(&frames(), Side::Left).unwrap();
    let low = icosphere(15.0, 5).moved(&Isometry::translation(2.0, -3.0, -40.0));
    let bones = Arc::new(Bones { tibia: Some(obstacle(&low)), femur: Some(obstacle(&icosphere(RADIUS, 5))) });
    let fibre = fibre(&bones, [5.0, -8.0, 35.0], [-6.0, -9.0, -70.0]);
    let poses = vec![
        Six::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        Six::new(0.15, 0.03, -0.1, 1.0, 2.0, 0.5),
        Six::new(0.4, -0.05, 0.2, -2.0, 4.0, -1.0),
    ];
    (joint, fibre, poses)
}

#[test]
fn derivatives_in_all_six_coordinates_are_those_of_the_length() {
    let (joint, fibre, poses) = between_two();
    for q in poses {
        let pose = joint.pose(&q);
        let path = fibre.path(&pose, &mut Laid::default(), 0.0).expect("it touches");
        let (line, curve) = (fibre.line(&pose), path.curve(&pose));
        let straight = (line.femur - fibre.tibia).norm();
        assert!(line.length > straight + 1.0, "{} over {straight}", line.length);
        for j in 0..6 {
            let h = if j < 3 { 1e-5 } else { 1e-4 };
            let side = |s: f64| {
                let mut q = q;
                q[j] += s * h;
                fibre.line(&joint.pose(&q))
            };
            let (up, down) = (side(1.0), side(-1.0));
            let slope = (up.length - down.length) / (2.0 * h);
            let size = 1.0 + line.gradient.amax();
            assert!((slope - line.gradient[j]).abs() < 1e-5 * size, "{j}: {slope}, told {}", line.gradient[j]);
            let turned = (up.gradient - down.gradient) / (2.0 * h);
            let off = (turned - curve.column(j)).amax();
            assert!(off < 2e-3 * (1.0 + curve.amax()), "{j}: {turned:?}, told {:?}", curve.column(j));
        }
    }
}

#[test]
fn derivatives_by_the_ends_are_those_of_length_and_slope() {
    let (joint, fibre, poses) = between_two();
    let pose = joint.pose(&poses[1]);
    let path = fibre.path(&pose, &mut Laid::default(), 0.0).expect("it touches");
    for (end, axis) in [End::Tibia, End::Femur].into_iter().flat_map(|e| (0..3).map(move |a| (e, a))) {
        let h = 1e-4;
        let side = |s: f64| {
            let mut moved = fibre.clone();
            match end {
                End::Femur => moved.femur[axis] += s * h,
                End::Tibia => moved.tibia[axis] += s * h,
            }
            moved.line(&pose)
        };
        let unit = Vector::ith(axis, 1.0);
        let by = if end == End::Femur { pose.femur.rotation * unit } else { unit };
        let slope = (side(1.0).length - side(-1.0).length) / (2.0 * h);
        assert!((slope - path.by_end(end, &by)).abs() < 1e-5, "{end:?} {axis}: {slope}");
        let turned = (side(1.0).gradient - side(-1.0).gradient) / (2.0 * h);
        let told = path.curve_by_end(&pose, end, &by);
        assert!((turned - told).amax() < 2e-3 * (1.0 + told.amax()), "{end:?} {axis}: {turned:?}, told {told:?}");
    }
}

#[test]
fn where_a_path_is_sought_from_does_not_change_it() {
    let (joint, fibre, poses) = between_two();
    let mut laid = Laid::default();
    for q in &poses {
        let pose = joint.pose(q);
        let warm = fibre.path(&pose, &mut laid, 0.0).map(|p| p.line(&pose, Vector::zeros()));
        let (warm, cold) = (warm.expect("it touches"), fibre.line(&pose));
        assert!((warm.length - cold.length).abs() < 1e-9, "{} and {}", warm.length, cold.length);
        assert!((warm.gradient - cold.gradient).amax() < 1e-6);
    }
}

#[test]
fn length_has_no_step_where_a_path_begins_to_touch() {
    let joint = Joint::new(&frames(), Side::Left).unwrap();
    let fibre = fibre(&over_femur(&icosphere(RADIUS, 5)), [3.0, -15.0, 45.0], [0.0, -15.0, -38.0]);
    // the tibial end goes forwards, until the line passes before the ball
    let step = 0.125;
    let at = |k: i32| fibre.line(&joint.pose(&Six::new(0.0, 0.02, 0.05, 1.0, step * f64::from(k), 0.0)));
    let (mut last, mut touched) = (at(-200), [false; 2]);
    for k in -199..=200 {
        let line = at(k);
        let expected = 0.5 * (line.gradient + last.gradient)[crate::coordinate::AP.index()] * step;
        assert!((line.length - last.length - expected).abs() < 2e-3, "{k}: {} after {}", line.length, last.length);
        touched[usize::from(line.length > (line.femur - fibre.tibia).norm() + 1e-9)] = true;
        last = line;
    }
    assert_eq!(touched, [true; 2]);
}
