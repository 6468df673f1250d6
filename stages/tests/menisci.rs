//! Menisci from a segmentation, with a truth: the atlas' menisci of a phantom, voxelised as a label map has them.
#![expect(clippy::unwrap_used, reason = "a test may fail by panicking")]
#![expect(clippy::print_stdout, reason = "figures for the reader of the log")]

use crate::common::phantoms::made;
use crate::common::{bytes, shared};
use meshes::frame::AnatomicalFrame;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::volume::outline::{Part, border, outline};
use meshes::volume::{Grid, Labels};
use meshes::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Rotation3};
use needs_shared::needs_shared;
use sim::coordinate::Load;
use sim::mesh::MeshValue;
use sim::spec::{MeniscusSpec, ModelSpec};
use sim::trials::{TrialOptions, solve};
use stages::PerCartilage;
use stages::assemble::{AssembleOptions, Assembled, assemble};
use stages::attachments::{AttachmentsOptions, attachments};
use stages::bones::{BonesOptions, bones};
use stages::cartilage::{Cartilage, CartilageOptions, cartilage};
use stages::frames::{Frames, FramesOptions, frames};
use stages::hexmesh::{HexmeshOptions, hexmesh};
use stages::ingest::ingest;
use stages::menisci::{Laid, Menisci, menisci};
use stages::overclosure::{OverclosureOptions, overclosure};
use stages::phantom::MRI_PHANTOM;
use stages::register::Registration;
use stages::specimen::{IngestOptions, RawSpecimen};
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// Slope of the contact law [MPa/mm].
const SLOPE: f64 = 6.466_806;

struct Knee {
    frames: Frames,
    cartilage: Cartilage,
    atlas: Assembled,
}

fn knee(raw: &RawSpecimen, options: &AssembleOptions) -> Knee {
    let specimen = ingest(raw, &IngestOptions::default()).unwrap();
    let out = Registration::left_out();
    let bones = bones(&specimen, &BonesOptions::default()).unwrap();
    let cartilage = cartilage(&specimen, &out, &bones, &CartilageOptions::default()).unwrap();
    let frames = frames(&specimen, &bones, &FramesOptions::default()).unwrap();
    let sites = attachments(&specimen, &out, &bones, &cartilage, &frames, &AttachmentsOptions::default()).unwrap();
    let hexes = hexmesh(&cartilage, &HexmeshOptions::default()).unwrap();
    let separated = overclosure(&hexes, &OverclosureOptions::default()).unwrap();
    let atlas = assemble((&specimen, &bones, &cartilage), &frames, &sites, &separated, None, options).unwrap();
    Knee { frames, cartilage, atlas }
}

/// The phantom of MRI with the atlas' menisci.
static KNEE: LazyLock<Knee> = LazyLock::new(|| {
    let mut raw = RawSpecimen::default();
    for (name, bytes) in made(MRI_PHANTOM).files.clone() {
        if name == "specimen.toml" {
            raw.toml = String::from_utf8(bytes).unwrap();
        } else {
            raw.files.insert(name, bytes);
        }
    }
    // on: nothing is segmented, so the atlas gives the shape
    knee(&raw, &AssembleOptions { menisci: Menisci::On, ..AssembleOptions::default() })
});

/// The closed surface of a meniscus, section by section.
fn surface(m: &MeniscusSpec) -> TriMesh {
    let points = m.sections[0].lower.len() as u32;
    let mut mesh = TriMesh { vertices: Vec::new(), triangles: Vec::new() };
    for s in &m.sections {
        mesh.vertices.extend(s.lower.iter().chain(s.upper.iter().rev()).copied());
    }
    let ring = 2 * points;
    let mut quad = |[a, b, c, d]: [u32; 4]| mesh.triangles.extend([[a, b, c], [a, c, d]]);
    for s in 0..m.sections.len() as u32 - 1 {
        for k in 0..ring {
            let at = |s: u32, k: u32| s * ring + k % ring;
            quad([at(s, k), at(s, k + 1), at(s + 1, k + 1), at(s + 1, k)]);
        }
    }
    let last = (m.sections.len() as u32 - 1) * ring;
    for k in 0..points - 1 {
        quad([k, ring - 1 - k, ring - 2 - k, k + 1]);
        quad([last + k, last + k + 1, last + ring - 2 - k, last + ring - 1 - k]);
    }
    mesh
}

/// A closed surface as voxels of an oblique picture, and these as a segmentation's surface.
fn voxelised(mesh: &TriMesh, voxel_mm: f64) -> TriMesh {
    let query = SurfaceQuery::new(mesh).unwrap();
    let (low, high) = mesh.bounds().unwrap();
    let axes = Rotation3::new(Vector::new(0.06, -0.09, 0.12)).matrix() * Matrix3::from_diagonal_element(voxel_mm);
    let reach = 0.6 * (high - low).norm();
    let count = (2.0 * reach / voxel_mm) as usize;
    let origin = nalgebra::center(&low, &high) - axes * Vector::repeat(0.5 * count as f64);
    let grid = Grid { size: [count; 3], origin, axes };
    let way = Vector::new(0.31, 0.57, 0.76).normalize();
    let inside = |p: &Point| {
        let (mut from, mut odd) = (*p, false);
        while let Some(hit) = query.ray(&from, &way, 200.0) {
            (from, odd) = (hit.point + way * 1e-6, !odd);
        }
        odd
    };
    let at = |i: usize| grid.point(&Vector::from(grid.voxel(i).map(|x| x as f64)));
    let near = |p: &Point| (0..3).all(|k| (low[k]..=high[k]).contains(&p[k]));
    let values = (0..grid.count()).map(|i| u8::from(near(&at(i)) && inside(&at(i)))).collect();
    let labels = Labels { grid, values };
    let sigma = IngestOptions::default().label_blur * voxel_mm;
    let part = Part::new(&labels, border(&labels.grid, sigma), |l| l == 1).unwrap();
    outline(&part, sigma, IngestOptions::default().label_edge_mm).unwrap()
}

fn laid(knee: &Knee, bodies: &BTreeMap<String, TriMesh>) -> Laid {
    menisci(&knee.atlas.contact, &knee.frames.tibia, SLOPE, bodies).unwrap()
}

/// Share of 1000 N in extension that each meniscus bears of its compartment, and both of the whole [-].
fn shares(knee: &Knee, menisci: &[MeniscusSpec]) -> [f64; 3] {
    let spec = ModelSpec { menisci: menisci.to_vec(), ..knee.atlas.spec.clone() };
    let meshes = knee
        .atlas
        .contact
        .named()
        .map(|(name, mesh)| (format!("contact/{name}.ply"), MeshValue::Surface(mesh.clone())));
    let model = sim::compile(&spec, &meshes.into_iter().collect()).unwrap();
    let answer = solve(&model, 0.0, &Load::compression(1000.0), &TrialOptions::default()).unwrap();
    let told = model.outputs(&answer.evaluation);
    let borne: Vec<f64> = told.iter().filter(|(n, _)| n.ends_with("load_n")).map(|(_, x)| *x).collect();
    let direct: Vec<f64> = answer.evaluation.contact.wrench.iter().map(|(f, _)| f.norm()).collect();
    let share = |m: f64, d: f64| m / (m + d);
    [share(borne[0], direct[0]), share(borne[1], direct[1]), share(borne.iter().sum(), direct.iter().sum())]
}

#[test]
fn voxelised_menisci_come_back_in_shape_and_in_what_they_bear() {
    let knee = &*KNEE;
    let truth = laid(knee, &BTreeMap::new());
    assert_eq!(truth.menisci, knee.atlas.spec.menisci);
    let expected = shares(knee, &truth.menisci);
    println!("truth: {:?} shares {expected:.3?}", truth.metrics);
    // The front third has edges half a millimetre high, which no picture of 1 mm shows; so it may be narrower than the others.
    for (voxel, volume, width, height, coverage, share) in
        [(0.5, 0.11, [2.0, 0.9, 0.9], 1.5, 0.05, 0.01), (1.0, 0.17, [3.0, 1.8, 0.9], 2.1, 0.11, 0.1)]
    {
        let bodies: BTreeMap<String, TriMesh> =
            truth.menisci.iter().map(|m| (m.name.clone(), voxelised(&surface(m), voxel))).collect();
        let back = laid(knee, &bodies);
        let bear = shares(knee, &back.menisci);
        println!("{voxel} mm: {:?} shares {bear:.3?}; {:?}", back.metrics, back.warnings);
        for (a, b) in truth.metrics.iter().zip(&back.metrics) {
            assert_eq!((a.source.as_str(), b.source.as_str()), ("atlas", "segmentation"));
            assert!((b.volume_mm3 / a.volume_mm3 - 1.0).abs() < volume, "{voxel}: {a:?} {b:?}");
            for (k, width) in width.iter().enumerate() {
                assert!((a.width_mm[k] - b.width_mm[k]).abs() < *width, "{voxel}: {a:?} {b:?}");
                assert!((a.height_mm[k] - b.height_mm[k]).abs() < height, "{voxel}: {a:?} {b:?}");
            }
            assert!((a.coverage - b.coverage).abs() < coverage, "{voxel}: {a:?} {b:?}");
        }
        for (a, b) in expected.iter().zip(bear) {
            assert!((a - b).abs() < share, "{voxel}: {expected:?} {bear:?}");
        }
    }
}

#[test]
fn a_moved_or_mirrored_knee_has_its_segmented_menisci_moved_or_mirrored() {
    let knee = &*KNEE;
    let bodies: BTreeMap<String, TriMesh> =
        knee.atlas.spec.menisci.iter().map(|m| (m.name.clone(), voxelised(&surface(m), 0.7))).collect();
    let here = laid(knee, &bodies);
    let motion = Isometry::new(Vector::new(40.0, -90.0, 15.0), Vector::new(0.4, -0.7, 1.1));
    mapped(knee, &bodies, &here, |p| motion * p, false);
    mapped(knee, &bodies, &here, |p| Point::new(-p.x, p.y, p.z), true);
}

/// Menisci of a knee of which every point is taken elsewhere, against those of the knee itself.
fn mapped(knee: &Knee, bodies: &BTreeMap<String, TriMesh>, here: &Laid, to: impl Fn(&Point) -> Point, mirrored: bool) {
    let mesh = |m: &TriMesh| {
        let vertices = m.vertices.iter().map(&to).collect();
        let moved = TriMesh { vertices, triangles: m.triangles.clone() };
        if mirrored { moved.flipped() } else { moved }
    };
    let c = &knee.atlas.contact;
    let contact = PerCartilage {
        femur: mesh(&c.femur),
        tibia_medial: mesh(&c.tibia_medial),
        tibia_lateral: mesh(&c.tibia_lateral),
    };
    let f = &knee.frames.tibia;
    let way = |v: &Vector| to(&Point::from(*v)) - to(&Point::origin());
    let frame = AnatomicalFrame {
        origin: to(&f.origin),
        medial: way(&f.medial),
        anterior: way(&f.anterior),
        superior: way(&f.superior),
    };
    let there = bodies.iter().map(|(n, m)| (n.clone(), mesh(m))).collect();
    let there = menisci(&contact, &frame, SLOPE, &there).unwrap();
    for (a, b) in here.menisci.iter().zip(&there.menisci) {
        let points = |m: &MeniscusSpec| {
            m.sections.iter().flat_map(|s| [s.lower.clone(), s.upper.clone()].concat()).collect::<Vec<Point>>()
        };
        let off = points(a).iter().zip(points(b)).map(|(p, q)| (to(p) - q).norm()).fold(0.0, f64::max);
        println!("mirrored {mirrored}: {} {off:.1e} mm", a.name);
        // an edge is found in steps of 0.1 mm
        assert!(off < 0.15, "{}: {off} mm", a.name);
    }
}

#[test]
fn what_is_no_meniscus_is_refused_by_name() {
    let knee = &*KNEE;
    let [medial, lateral] = [0, 1].map(|n| surface(&knee.atlas.spec.menisci[n]));
    let refused = |name: &str, body: &TriMesh| {
        let bodies = [(name.to_string(), body.clone())].into();
        let error = menisci(&knee.atlas.contact, &knee.frames.tibia, SLOPE, &bodies).unwrap_err().to_string();
        println!("{error}");
        assert!(error.starts_with(name) && error.contains("assemble.menisci=atlas"), "{error}");
        error
    };
    assert!(refused("meniscus_medial", &voxelised(&lateral, 1.0)).contains("exchanged"));
    let m = &knee.atlas.spec.menisci[0];
    let torn = MeniscusSpec { sections: m.sections[12..].to_vec(), ..m.clone() };
    let told = refused("meniscus_medial", &voxelised(&surface(&torn), 0.5));
    assert!(told.contains("a part of a ring") || told.contains("goes round"), "{told}");
    let small = meshes::shapes::icosphere(3.0, 3).moved(&Isometry::translation_of(&medial));
    assert!(refused("meniscus_medial", &small).contains("mm3"));
    let ball = meshes::shapes::icosphere(9.0, 3).moved(&Isometry::translation_of(&medial));
    refused("meniscus_medial", &ball);
}

/// A shift to the middle of a surface.
trait Middle {
    fn translation_of(mesh: &TriMesh) -> Isometry;
}

impl Middle for Isometry {
    fn translation_of(mesh: &TriMesh) -> Isometry {
        let (low, high) = mesh.bounds().unwrap();
        let c = nalgebra::center(&low, &high);
        Isometry::translation(c.x, c.y, c.z)
    }
}

#[needs_shared]
fn a_real_label_map_gives_menisci_of_its_own() {
    let Some(path) = shared("a_real_label_map_gives_menisci_of_its_own", "mri/kneeB/labels.nrrd") else { return };
    let mut raw = RawSpecimen {
        toml: "[specimen]\nid = \"b\"\nside = \"right\"\n[segmentation]\nlabels = \"l.nrrd\"\nfemur = 5\ntibia = 6\nfibula = 8\nfemoral_cartilage = 1\ntibial_cartilage_medial = 2\ntibial_cartilage_lateral = 3\nmeniscus_medial = 10\nmeniscus_lateral = 9\n".into(),
        ..RawSpecimen::default()
    };
    raw.files.insert("l.nrrd".into(), bytes(&path));
    let knee = knee(&raw, &AssembleOptions { menisci: Menisci::On, ..AssembleOptions::default() });
    assert_eq!(knee.cartilage.bodies.len(), 2);
    for m in &knee.atlas.metrics.menisci {
        println!("{m:?}");
        assert_eq!(m.source, "segmentation");
        assert!((m.volume_mm3 / m.segmented_mm3.unwrap() - 1.0).abs() < 0.25, "{m:?}");
        assert!((0.3..0.9).contains(&m.coverage), "{m:?}");
    }
    let share = shares(&knee, &knee.atlas.spec.menisci);
    println!("kneeB bears {share:.2?} of 1000 N");
    assert!((0.2..0.9).contains(&share[2]));
}
