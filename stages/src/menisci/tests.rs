//! The atlas' menisci on plateaus and condyles of known shape.

use super::*;
use meshes::frame::AnatomicalFrame;
use meshes::shapes::icosphere;

/// A left knee's tibial frame.
fn frame() -> AnatomicalFrame {
    AnatomicalFrame { origin: Point::origin(), medial: -Vector::x(), anterior: -Vector::y(), superior: Vector::z() }
}

/// A round flat plateau about `x`.
fn plateau(x: f64) -> TriMesh {
    let (rings, around) = (12, 60);
    let mut mesh = TriMesh { vertices: vec![Point::new(x, 0.0, -2.0)], triangles: Vec::new() };
    for r in 1..=rings {
        for a in 0..around {
            let (sin, cos) = (f64::from(a) * std::f64::consts::TAU / f64::from(around)).sin_cos();
            let radius = 18.0 * f64::from(r) / f64::from(rings);
            mesh.vertices.push(Point::new(x + radius * cos, 1.3 * radius * sin, -2.0));
        }
    }
    let at = |r: i32, a: i32| (1 + (r - 1) * around + a % around) as u32;
    for a in 0..around {
        mesh.triangles.push([0, at(1, a), at(1, a + 1)]);
        for r in 1..rings {
            mesh.triangles.push([at(r, a), at(r + 1, a), at(r + 1, a + 1)]);
            mesh.triangles.push([at(r, a), at(r + 1, a + 1), at(r, a + 1)]);
        }
    }
    mesh
}

fn cartilages() -> PerCartilage<TriMesh> {
    let condyle = |x: f64| icosphere(24.0, 4).moved(&meshes::Isometry::translation(x, 0.0, 22.3));
    PerCartilage {
        femur: TriMesh::joined([&condyle(-24.0), &condyle(24.0)]),
        tibia_medial: plateau(-24.0),
        tibia_lateral: plateau(24.0),
    }
}

fn of_atlas(c: &PerCartilage<TriMesh>, frame: &AnatomicalFrame) -> Result<Vec<MeniscusSpec>, StageError> {
    menisci(c, frame, 6.5, &BTreeMap::new()).map(|laid| laid.menisci)
}

#[test]
fn menisci_run_from_horn_to_horn_on_the_tibia_and_under_the_condyle() {
    let both = of_atlas(&cartilages(), &frame()).unwrap();
    assert_eq!(both.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["meniscus_medial", "meniscus_lateral"]);
    for (m, x) in both.iter().zip([-24.0, 24.0]) {
        let centre = Point::new(x, 0.0, 22.3);
        for s in &m.sections {
            assert!(s.lower.iter().all(|p| (p.z + 2.0).abs() < 1e-9));
            // the condyle's gap of 0.3 mm is the clearance: it stays where it is
            assert!(s.upper.iter().all(|p| (p - centre).norm() > 24.0 - 0.15), "{s:?}");
            let heights: Vec<f64> = s.lower.iter().zip(&s.upper).map(|(l, u)| u.z - l.z).collect();
            assert!(heights.iter().all(|h| (0.5..=7.0).contains(h)) && heights.windows(2).all(|w| w[1] >= w[0] - 1e-9));
        }
        let (first, last) = (&m.sections[0], &m.sections[m.sections.len() - 1]);
        assert!(first.lower[5].y < -10.0 && last.lower[5].y > 10.0, "anterior is -y");
        let body = &m.sections[m.sections.len() / 2];
        assert!((body.lower[5].x - x) * x.signum() > 12.0, "its body lies away from the middle of the knee");
        let area: f64 = m
            .sections
            .windows(2)
            .map(|w| 0.5 * (w[1].lower[5] - w[0].lower[0]).cross(&(w[1].lower[0] - w[0].lower[5])).norm())
            .sum();
        let plateau = std::f64::consts::PI * 18.0 * 1.3 * 18.0;
        let wanted = SIZES.of(if x < 0.0 { Compartment::Medial } else { Compartment::Lateral }).coverage;
        assert!((area / plateau / wanted - 1.0).abs() < 0.05, "{} of {wanted}", area / plateau);
    }
}

#[test]
fn a_mirrored_knee_has_mirrored_menisci() {
    let turned = |m: &TriMesh| {
        let mut m = m.clone();
        m.vertices.iter_mut().for_each(|p| p.x = -p.x);
        m.flipped()
    };
    let here = of_atlas(&cartilages(), &frame()).unwrap();
    let c = cartilages();
    let other = PerCartilage {
        femur: turned(&c.femur),
        tibia_medial: turned(&c.tibia_medial),
        tibia_lateral: turned(&c.tibia_lateral),
    };
    let mirror = AnatomicalFrame { medial: Vector::x(), ..frame() };
    let figures =
        |c: &PerCartilage<TriMesh>, frame: &AnatomicalFrame| menisci(c, frame, 6.5, &BTreeMap::new()).unwrap().metrics;
    for (a, b) in figures(&c, &frame()).iter().zip(&figures(&other, &mirror)) {
        let off = [a.coverage - b.coverage, a.extrusion_mm.unwrap() - b.extrusion_mm.unwrap()];
        assert!(off.iter().all(|d| d.abs() < 1e-6), "{a:?} {b:?}");
    }
    for (a, b) in here.iter().zip(of_atlas(&other, &mirror).unwrap()) {
        for (s, t) in a.sections.iter().zip(&b.sections) {
            let off = s.upper.iter().chain(&s.lower).zip(t.upper.iter().chain(&t.lower));
            assert!(off.map(|(p, q)| (p - Point::new(-q.x, q.y, q.z)).norm()).fold(0.0, f64::max) < 1e-6);
        }
    }
}

#[test]
fn a_meniscus_moved_outwards_stands_out_by_as_much_and_covers_less() {
    let (c, frame) = (cartilages(), frame());
    let laid = menisci(&c, &frame, 6.5, &BTreeMap::new()).unwrap();
    for ((m, figures), (compartment, tibia)) in laid
        .menisci
        .iter()
        .zip(&laid.metrics)
        .zip([(Compartment::Medial, &c.tibia_medial), (Compartment::Lateral, &c.tibia_lateral)])
    {
        let between = Between { femur: &c.femur, tibia, frame: &frame, compartment };
        let own = figures.extrusion_mm.unwrap();
        assert!((-1.5..=0.01).contains(&own), "the atlas' menisci end at the rim: {figures:?}");
        assert!((figures.coverage - SIZES.of(compartment).coverage).abs() < 0.05, "{figures:?}");
        for by in [2.0, 6.0, -3.0] {
            let mut moved = m.clone();
            let points = moved.sections.iter_mut().flat_map(|s| s.lower.iter_mut().chain(&mut s.upper));
            points.for_each(|p| *p += between.outwards() * by);
            let out = lying::extrusion_mm(&moved, &between).unwrap();
            assert!((out - own - by).abs() < 1e-9, "{by}: {own} to {out}");
            let covers = lying::coverage(&moved, &between);
            assert!(by < 0.0 || covers < figures.coverage - 0.02, "{by}: {covers} of {}", figures.coverage);
        }
        // far in front of the plateau no section lies beside its middle, and none covers it
        let mut away = m.clone();
        let points = away.sections.iter_mut().flat_map(|s| s.lower.iter_mut().chain(&mut s.upper));
        points.for_each(|p| *p += frame.anterior * 100.0);
        assert_eq!((lying::extrusion_mm(&away, &between), lying::coverage(&away, &between)), (None, 0.0));
    }
}

#[test]
fn cartilages_apart_have_no_room_for_one() {
    let mut c = cartilages();
    c.femur.vertices.iter_mut().for_each(|p| p.y += 500.0);
    let error = of_atlas(&c, &frame()).unwrap_err().to_string();
    assert!(error.contains("meniscus_medial") && error.contains("no room"), "{error}");
}

#[test]
fn a_law_that_leads_in_with_next_to_nothing_has_the_slope_of_what_follows() {
    let (overclosure, pressure) = ([-0.01, 0.0, 0.05, 0.1], [0.0, 1e-7, 0.3, 0.6]);
    assert!((first_slope(&overclosure, &pressure) - 6.0).abs() < 1e-4);
    assert!((first_slope(&overclosure[1..], &[0.0, 0.3, 0.6]) - 6.0).abs() < 1e-12);
}
