//! Laws of the hexahedral stages on phantoms.

use super::*;
use crate::overclosure::{OverclosureOptions, overclosure};
use meshes::Isometry;
use meshes::topology::Topology;
use std::collections::BTreeMap;

/// A closed shell over an oval of half axes `half` [mm], bent to `radius` [mm] about the y axis, with side walls; the
/// articular face is at the larger radius. `bump` waves the bony face [mm].
fn shell(half: [f64; 2], radius: f64, thickness: f64, bump: f64) -> CartilageSolid {
    let (rings, spokes) = (16u32, 72u32);
    let place = |ring: u32, spoke: u32, height: f64| {
        let (r, a) = (f64::from(ring) / f64::from(rings), std::f64::consts::TAU * f64::from(spoke) / f64::from(spokes));
        let (x, y) = (half[0] * r * a.cos(), half[1] * r * a.sin());
        let wave = if height == 0.0 { bump * (1.7 * x).sin() * (1.3 * y).cos() } else { 0.0 };
        let (level, angle) = (radius + height + wave, x / radius);
        Point::new(level * angle.sin(), y, level * angle.cos() - radius)
    };
    let mut solid = CartilageSolid { solid: TriMesh::default(), articular: Vec::new(), thickness_mm: Vec::new() };
    let per_face = 1 + rings * spokes;
    for (height, thick) in [(0.0, thickness), (thickness, thickness)] {
        solid.solid.vertices.push(place(0, 0, height));
        solid.thickness_mm.push(thick);
        for ring in 1..=rings {
            for spoke in 0..spokes {
                solid.solid.vertices.push(place(ring, spoke, height));
                solid.thickness_mm.push(if ring == rings && height == 0.0 { 0.0 } else { thick });
            }
        }
    }
    let node = |face: u32, ring: u32, spoke: u32| {
        face * per_face + if ring == 0 { 0 } else { 1 + (ring - 1) * spokes + spoke % spokes }
    };
    let mut add = |t: [u32; 3], articular: bool| {
        solid.solid.triangles.push(t);
        solid.articular.push(articular);
    };
    for spoke in 0..spokes {
        for ring in 0..rings {
            let corners = |f| {
                [node(f, ring, spoke), node(f, ring + 1, spoke), node(f, ring + 1, spoke + 1), node(f, ring, spoke + 1)]
            };
            let ([a, b, c, d], [e, f, g, h]) = (corners(0), corners(1));
            add([a, c, b], false);
            add([e, f, g], true);
            if ring > 0 {
                add([a, d, c], false);
                add([e, g, h], true);
            }
        }
        let [a, b, c, d] =
            [node(0, rings, spoke), node(0, rings, spoke + 1), node(1, rings, spoke + 1), node(1, rings, spoke)];
        add([a, b, c], true);
        add([a, c, d], true);
    }
    solid
}

fn turned(solid: &CartilageSolid, pose: &Isometry) -> CartilageSolid {
    CartilageSolid { solid: solid.solid.moved(pose), ..solid.clone() }
}

/// A bent femoral shell above two flat plates, `gap` mm apart.
fn knee(gap: f64) -> Cartilage {
    let over = Isometry::rotation(Vector::new(std::f64::consts::PI, 0.0, 0.0));
    let lift = Isometry::translation(0.0, 0.0, 2.0 * 2.0 + gap);
    let plate = shell([9.0, 8.0], 300.0, 2.0, 0.0);
    let solids = PerCartilage {
        femur: turned(&shell([16.0, 24.0], 25.0, 2.0, 0.0), &(lift * over)),
        tibia_medial: turned(&plate, &Isometry::translation(0.0, -12.0, 0.0)),
        tibia_lateral: turned(&plate, &Isometry::translation(0.0, 12.0, 0.0)),
    };
    Cartilage { solids, bodies: Default::default(), warnings: Vec::new(), metrics: Default::default() }
}

/// Faces of elements that no other element shares, as triangles.
fn hull(mesh: &HexMesh) -> TriMesh {
    let mut faces: BTreeMap<[u32; 4], Vec<[u32; 4]>> = BTreeMap::new();
    for e in &mesh.elements {
        for f in meshes::hex::FACES {
            let face = f.map(|k| e[k]);
            let mut key = face;
            key.sort_unstable();
            faces.entry(key).or_default().push(face);
        }
    }
    assert!(faces.values().all(|f| f.len() <= 2));
    let outer = faces.values().filter(|f| f.len() == 1).map(|f| f[0]);
    let triangles = outer.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh { vertices: mesh.nodes.clone(), triangles }
}

#[test]
fn phantoms_are_closed() {
    let solid = shell([16.0, 24.0], 25.0, 2.0, 0.1).solid;
    assert!(Topology::of(&solid).is_closed());
    assert!(solid.volume() > 0.0);
}

#[test]
fn meshes_are_closed_conforming_and_well_shaped_at_any_edge_length() {
    for edge_length_mm in [0.5, 0.75, 0.9, 1.0] {
        for bump in [0.0, 0.1] {
            let solid = shell([12.0, 17.0], 22.0, 2.0, bump);
            let options = HexmeshOptions { edge_length_mm, ..Default::default() };
            let (mesh, notes) = mesh_solid(&solid, &options).unwrap();
            assert!(notes.is_empty(), "{notes:?}");
            let hull = hull(&mesh);
            assert!(Topology::of(&hull).is_closed());
            assert_eq!(Topology::of(&hull).components, 1);
            let share = hull.volume() / solid.solid.volume();
            assert!((0.9..1.01).contains(&share), "volume share {share}");
            let q = quality(&mesh);
            assert!(q.scaled_jacobian_min.unwrap() > 0.3, "{q:?}");
            assert!(q.scaled_jacobian_p05.unwrap() > 0.75, "{q:?}");
            assert!(q.scaled_jacobian_mean > 0.92, "{q:?}");
            assert!((q.edge_median_mm.unwrap() / edge_length_mm - 1.0).abs() < 0.15, "{q:?}");
        }
    }
}

#[test]
fn nodes_of_both_faces_lie_on_the_faces_of_the_solid() {
    let solid = shell([12.0, 17.0], 22.0, 2.0, 0.1);
    let (mesh, _) = mesh_solid(&solid, &HexmeshOptions::default()).unwrap();
    for (wanted, nodes) in [(false, &mesh.bony_nodes), (true, &mesh.articular_nodes)] {
        let query = SurfaceQuery::new(&solid.solid.submesh(|t| solid.articular[t] == wanted).0).unwrap();
        assert!(nodes.iter().all(|&n| query.nearest(&mesh.nodes[n as usize]).distance < 1e-6));
    }
    let used: usize = mesh.bony_quads.len();
    assert_eq!(mesh.elements.len(), 3 * used);
    assert_eq!(mesh.articular_quads.len(), used);
}

#[test]
fn a_moved_solid_gives_the_moved_mesh() {
    let solid = shell([12.0, 17.0], 22.0, 2.0, 0.1);
    let pose = Isometry::new(Vector::new(30.0, -400.0, 12.0), Vector::new(0.7, -0.4, 1.9));
    let (here, _) = mesh_solid(&solid, &HexmeshOptions::default()).unwrap();
    let (there, _) = mesh_solid(&turned(&solid, &pose), &HexmeshOptions::default()).unwrap();
    assert_eq!(here.elements, there.elements);
    let worst = here.nodes.iter().zip(&there.nodes).map(|(a, b)| (pose * a - b).norm()).fold(0.0, f64::max);
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn bad_solids_and_options_are_refused() {
    let good = shell([12.0, 17.0], 22.0, 2.0, 0.0);
    let refused = |solid: &CartilageSolid| mesh_solid(solid, &HexmeshOptions::default()).is_err();
    assert!(refused(&CartilageSolid { articular: vec![true; 3], ..good.clone() }));
    assert!(refused(&CartilageSolid { articular: vec![true; good.articular.len()], ..good.clone() }));
    assert!(refused(&CartilageSolid { thickness_mm: vec![0.0; good.thickness_mm.len()], ..good.clone() }));
    let mut broken = good.clone();
    broken.solid.vertices[5].x = f64::NAN;
    assert!(refused(&broken));
    let options = HexmeshOptions { edge_length_mm: f64::NAN, ..Default::default() };
    assert!(hexmesh(&knee(1.0), &options).is_err());
}

fn overlaps_come_apart(hexes: &HexCartilage, depth: f64, volume_limit: f64, lift_limit: f64) {
    let apart = overclosure(hexes, &OverclosureOptions::default()).unwrap();
    let m = &apart.metrics;
    assert!((m.max_overclosure_before_mm - depth).abs() < 0.05, "{m:?}");
    assert_eq!(m.max_overclosure_after_mm, 0.0);
    assert!(m.gap_min_mm.unwrap() >= 0.05);
    assert!(m.iterations <= 10, "{m:?}");
    assert!(m.volume_change_mean < volume_limit, "{m:?}");
    let lift = m.largest_bony_lift_mm;
    assert!(lift <= lift_limit, "{m:?}");
    // an overlap deeper than a millimetre, and cartilage that was lifted
    assert_eq!(apart.warnings.len(), usize::from(depth > 1.0) + usize::from(lift > 0.05), "{:?}", apart.warnings);
    for ((name, before), (_, after)) in hexes.meshes.named().into_iter().zip(apart.meshes.named()) {
        assert_eq!(before.elements, after.elements);
        let least = m.meshes.get(name).unwrap().scaled_jacobian_min;
        let fall = quality(before).scaled_jacobian_min.unwrap() - least.unwrap();
        assert!(fall < 0.05, "{name}: {fall}");
    }
}

#[test]
fn overlapping_cartilages_come_apart_and_keep_their_shape() {
    let shallow = hexmesh(&knee(-0.2), &HexmeshOptions::default()).unwrap();
    // Half of these flat plates lies under the femur, of a knee's cartilage a hundredth: the overlap alone is 1.3 % of the volume.
    overlaps_come_apart(&shallow, 0.2, 0.02, 0.0);
    // As wide as deep: with both bones where they are a third of all cartilage would have to go.
    let deep = hexmesh(&knee(-3.0), &HexmeshOptions::default()).unwrap();
    overlaps_come_apart(&deep, 3.0, 0.03, 2.0);
}

#[test]
fn the_narrower_an_overlap_the_less_bony_faces_lift() {
    // A mound about 12 mm wide over the medial plate. Shapes are so good here that it is they that bound the deeper one.
    for (height, depth, lift_limit) in [(2.0, 1.0, 0.0), (4.0, 3.0, 0.6)] {
        let mut hexes = hexmesh(&knee(1.0), &HexmeshOptions::default()).unwrap();
        let femur = &mut hexes.meshes.femur;
        for &n in &femur.articular_nodes {
            let p = &mut femur.nodes[n as usize];
            p.z -= height * (-(*p - Point::new(0.0, -12.0, 3.0)).norm_squared() / (2.0 * 3.0 * 3.0)).exp();
        }
        overlaps_come_apart(&hexes, depth, 0.03, lift_limit);
    }
}

#[test]
fn bony_faces_lift_no_further_than_told() {
    let hexes = hexmesh(&knee(-0.4), &HexmeshOptions::default()).unwrap();
    let options = OverclosureOptions { volume_change_max: 0.0, max_bony_lift_mm: 0.05, ..Default::default() };
    let apart = overclosure(&hexes, &options).unwrap();
    let lift = apart.metrics.largest_bony_lift_mm;
    assert!((0.04..=0.05 + 1e-9).contains(&lift), "{lift}");
    assert!(apart.metrics.gap_min_mm.unwrap() >= 0.05);
}

#[test]
fn cartilages_apart_stay_as_they_are() {
    let hexes = hexmesh(&knee(1.0), &HexmeshOptions::default()).unwrap();
    let apart = overclosure(&hexes, &OverclosureOptions::default()).unwrap();
    assert_eq!(apart.meshes, hexes.meshes);
    assert_eq!(apart.metrics.iterations, 0);
}

#[test]
fn cartilages_that_do_not_meet_are_told_with_their_gap() {
    for (gap, said) in
        [(-0.2, None), (0.0, None), (1.0, None), (1.8, None), (3.0, Some(3.0)), (6.0, Some(6.0)), (20.0, Some(12.0))]
    {
        let hexes = hexmesh(&knee(gap), &HexmeshOptions::default()).unwrap();
        let apart = overclosure(&hexes, &OverclosureOptions::default()).unwrap();
        let told: Vec<&str> = apart
            .warnings
            .iter()
            .filter(|w| w.kind == notices::Kind::CartilagesApart)
            .map(|w| w.text.as_str())
            .collect();
        let number = |text: &str| text.split(' ').find_map(|word| word.parse::<f64>().ok()).unwrap();
        match said {
            None => assert!(told.is_empty(), "{gap}: {told:?}"),
            Some(mm) => assert!(told.len() == 1 && (number(told[0]) - mm).abs() < 0.15, "{gap}: {told:?}"),
        }
    }
}
