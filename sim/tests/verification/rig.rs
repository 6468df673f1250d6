//! Test rigs: a left knee's frames with axes along the coordinates, and what a test hangs on them.

use meshes::frame::{AnatomicalFrame, Side};
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use sim::coordinate::{ALL, Coordinate, Six};
use sim::explicit::{Course, Drive, Program, Step};
use sim::mesh::MeshValue;
use sim::spec::*;
use sim::{Model, compile};
use std::collections::BTreeMap;

/// Mass of the femur [tonne].
pub(crate) const MASS: f64 = 2e-4;
/// Its inertia [tonne mm2].
const INERTIA: f64 = 0.5;

/// A model to be: fibres of the same kind, and contact surfaces.
pub(crate) struct Rig {
    pub(crate) spec: ModelSpec,
    pub(crate) meshes: BTreeMap<String, MeshValue>,
}

impl Rig {
    /// Femur and tibia without anything between them; all axes through the origin.
    pub(crate) fn new() -> Rig {
        let frame = AnatomicalFrame {
            origin: Point::origin(),
            medial: -Vector::x(),
            anterior: -Vector::y(),
            superior: Vector::z(),
        };
        let body = |name: &str| BodySpec {
            name: name.into(),
            bone: format!("{name}.ply"),
            cartilage: Vec::new(),
            mass_tonne: MASS,
            inertia_tonne_mm2: INERTIA,
        };
        let spec = ModelSpec {
            schema: "model/1".into(),
            id: "rig".into(),
            side: Side::Left,
            units: Units { length: "mm".into(), force: "N".into(), pressure: "MPa".into(), angle: "deg".into() },
            frames: FramesSpec { femur: frame, tibia: frame, gs_ct_pose: PoseSpec::default(), chain: None, grid: None },
            bodies: vec![body("femur"), body("tibia")],
            contact: ContactSpec {
                overclosure_mm: vec![0.0, 1.0],
                pressure_mpa: vec![0.0, 5.0],
                friction: 0.0,
                damping: 0.0,
                pairs: Vec::new(),
                layer: None,
            },
            bundles: Vec::new(),
            fibres: Vec::new(),
            wrap: None,
            menisci: Vec::new(),
            toe_end_multiple: BTreeMap::new(),
            protocols: Vec::new(),
            components: Vec::new(),
            calibrated: None,
            uncertainty: None,
            patella: None,
            warnings: Vec::new(),
        };
        Rig { spec, meshes: BTreeMap::new() }
    }

    /// A fibre of its own bundle: a spring of `stiffness` with a toe so small that it is linear, stretched by `stretch` in the CT pose.
    pub(crate) fn spring(mut self, ends: [Point; 2], stiffness: f64, stretch: f64) -> Rig {
        let [femur, tibia] = ends;
        let length = (femur - tibia).norm();
        let name = format!("spring{}", self.spec.bundles.len());
        self.spec.bundles.push(BundleSpec {
            name: name.clone(),
            reference_strain: length / (length - stretch),
            stiffness_n_per_mm: stiffness,
            reference_length_mm: length,
            toe_strain: 1e-6,
            law: Law::Smooth,
            damping_n_s_per_mm: 0.0,
        });
        self.spec.fibres.push(FibreSpec { bundle: name, femur, tibia });
        self
    }

    /// A contact pair.
    pub(crate) fn pair(mut self, femur: TriMesh, tibia: TriMesh) -> Rig {
        let n = self.spec.contact.pairs.len();
        let names = [format!("femur{n}"), format!("tibia{n}")];
        self.meshes.insert(names[0].clone(), MeshValue::Surface(femur));
        self.meshes.insert(names[1].clone(), MeshValue::Surface(tibia));
        self.spec.contact.pairs.push(PairSpec { femur: names[0].clone(), tibia: names[1].clone() });
        self
    }

    /// Two condyles of 20 mm on flat plateaus, two collaterals and two crossing cruciates, with dashpots and friction.
    pub(crate) fn knee() -> Rig {
        let mut rig = Rig::new();
        for (x, depth) in [(-22.0, 0.05), (22.0, 0.03)] {
            // off the round numbers, so that no node lies on a border of the contact's cells
            let at = |z: f64| meshes::Isometry::translation(x + 0.0713, 0.0437, z + 0.0137);
            let ball = meshes::shapes::icosphere(20.0, 4).moved(&at(20.0 - depth));
            rig = rig.pair(ball, plate(18.0, 36, true).moved(&at(0.0)));
        }
        let p = Point::new;
        for (femur, tibia, stiffness, stretch) in [
            (p(-45.0, 3.0, 20.0), p(-35.0, -4.0, -30.0), 60.0, 0.8),
            (p(44.0, 6.0, 21.0), p(40.0, 15.0, -20.0), 50.0, 0.6),
            (p(8.0, 8.0, 22.0), p(-4.0, -12.0, 1.0), 90.0, 0.3),
            (p(-8.0, 1.0, 18.0), p(2.0, 18.0, -6.0), 80.0, 0.4),
        ] {
            rig = rig.spring([femur, tibia], stiffness, stretch);
        }
        rig.spec.bundles.iter_mut().for_each(|b| (b.toe_strain, b.damping_n_s_per_mm) = (0.03, 0.2));
        rig.spec.contact.friction = 0.03;
        rig.spec.contact.damping = 0.001;
        rig
    }

    /// The same knee in contact by the thickness of its layers, which vary.
    pub(crate) fn layered_knee() -> Rig {
        let mut rig = Rig::knee();
        let mut bony_faces = BTreeMap::new();
        for (n, x) in [-22.0, 22.0].into_iter().enumerate() {
            // the bones are a little off the faces' centres and directions
            let bone = meshes::shapes::icosphere(17.6, 4).moved(&meshes::Isometry::translation(x + 0.3, 0.1, 20.0));
            let tilt = meshes::Isometry::new(Vector::new(x, 0.0, -2.0), Vector::new(0.03, 0.02, 0.0));
            for (name, mesh) in [(format!("femur{n}"), bone), (format!("tibia{n}"), plate(24.0, 36, true).moved(&tilt))]
            {
                let bony = format!("{name}_bony");
                rig.meshes.insert(bony.clone(), MeshValue::Surface(mesh));
                bony_faces.insert(name, bony);
            }
        }
        rig.spec.contact.layer = Some(LayerSpec {
            law: LayerLaw::Logarithmic,
            youngs_modulus_mpa: 5.0,
            poissons_ratio: 0.45,
            edge_spread: 0.35,
            least_thickness_mm: 0.5,
            bony_faces,
        });
        rig
    }

    /// The same knee with a patella on a groove round the femur's axis: a ball in a saddle.
    pub(crate) fn patellar_knee() -> Rig {
        let mut rig = Rig::knee();
        let p = Point::new;
        rig.spec.frames.femur.origin = p(0.0, 0.0, 20.0);
        rig.meshes.insert("trochlea".into(), MeshValue::Surface(groove()));
        // off the round numbers, so that no node lies on a border of the contact's cells
        let ball = meshes::shapes::icosphere(12.0, 4).moved(&meshes::Isometry::translation(0.4713, -37.8563, 22.0137));
        rig.meshes.insert("patella".into(), MeshValue::Surface(ball));
        let mut frame = rig.spec.frames.femur;
        frame.origin = p(0.4, -37.9, 22.0);
        let band = |name: &str, stiffness: f64, strain: f64, ends: &[(Point, Point)]| BandSpec {
            name: name.into(),
            stiffness_n_per_mm: stiffness,
            reference_strain: strain,
            toe_strain: 0.02,
            fibres: ends.iter().map(|&(patella, far)| EndsSpec { patella, far }).collect(),
        };
        let tendon = [-10.0, 0.0, 10.0].map(|x| (p(x, -42.0, 4.0), p(0.7 * x + 4.0, -36.0, -38.0)));
        let head = |name: &str, share: f64, x: f64, far: Point| HeadSpec {
            name: name.into(),
            share,
            patella: p(x, -43.0, 39.0),
            femur: far,
        };
        rig.spec.patella = Some(PatellaSpec {
            source: PatellaSource::Generic,
            frame,
            contact: PatellaContactSpec {
                femur: "trochlea".into(),
                patella: "patella".into(),
                bone: None,
                overclosure_mm: vec![0.0, 1.0],
                pressure_mpa: vec![0.0, 5.0],
            },
            tendon: band("patellar_tendon", 1000.0, 1.0, &tendon),
            retinacula: vec![
                band("mpfl", 20.0, 0.99, &[(p(-15.0, -38.0, 26.0), p(-40.0, 0.0, 22.0))]),
                band("lpfl", 20.0, 1.01, &[(p(15.0, -38.0, 26.0), p(38.0, 2.0, 21.0))]),
            ],
            quadriceps: QuadricepsSpec {
                heads: vec![
                    head("vastus_lateralis", 0.35, 8.0, p(30.0, -20.0, 230.0)),
                    head("rectus_femoris", 0.4, 0.0, p(8.0, -25.0, 320.0)),
                    head("vastus_medialis", 0.25, -9.0, p(-30.0, -22.0, 160.0)),
                ],
                wrap: AxisSpec { point: p(0.0, 0.0, 20.0), direction: Vector::x() },
                wrap_radius_mm: 25.0,
            },
        });
        rig
    }

    /// The same with every point mapped; `side` says which knee it then is.
    pub(crate) fn mapped(&self, side: Side, point: impl Fn(Point) -> Point) -> Rig {
        let mut rig = Rig { spec: self.spec.clone(), meshes: BTreeMap::new() };
        let origin = point(Point::origin());
        let vector = |v: Vector| point(Point::from(v)) - origin;
        let turned = side != self.spec.side;
        rig.spec.side = side;
        for frame in [&mut rig.spec.frames.femur, &mut rig.spec.frames.tibia] {
            *frame = AnatomicalFrame {
                origin: point(frame.origin),
                medial: vector(frame.medial),
                anterior: vector(frame.anterior),
                superior: vector(frame.superior),
            };
        }
        for f in &mut rig.spec.fibres {
            (f.femur, f.tibia) = (point(f.femur), point(f.tibia));
        }
        for m in &mut rig.spec.menisci {
            for s in &mut m.sections {
                s.lower.iter_mut().chain(&mut s.upper).for_each(|p| *p = point(*p));
            }
            for horn in [&mut m.anterior_horn, &mut m.posterior_horn] {
                horn.tibia = point(horn.tibia);
            }
        }
        if let Some(patella) = &mut rig.spec.patella {
            let frame = &mut patella.frame;
            *frame = AnatomicalFrame {
                origin: point(frame.origin),
                medial: vector(frame.medial),
                anterior: vector(frame.anterior),
                superior: vector(frame.superior),
            };
            for f in std::iter::once(&mut patella.tendon).chain(&mut patella.retinacula).flat_map(|b| &mut b.fibres) {
                (f.patella, f.far) = (point(f.patella), point(f.far));
            }
            for h in &mut patella.quadriceps.heads {
                (h.patella, h.femur) = (point(h.patella), point(h.femur));
            }
            let wrap = &mut patella.quadriceps.wrap;
            (wrap.point, wrap.direction) = (point(wrap.point), vector(wrap.direction));
        }
        for (name, mesh) in &self.meshes {
            let MeshValue::Surface(mesh) = mesh else { continue };
            let mut mesh = mesh.clone();
            mesh.vertices.iter_mut().for_each(|v| *v = point(*v));
            let mesh = if turned { mesh.flipped() } else { mesh };
            rig.meshes.insert(name.clone(), MeshValue::Surface(mesh));
        }
        rig
    }

    pub(crate) fn compiled(&self) -> Model {
        compile(&self.spec, &self.meshes).unwrap()
    }
}

/// A step in which the coordinates of `held` stay where they are and the rest are under constant loads.
pub(crate) fn step(duration_s: f64, held: &[Coordinate], load: Six) -> Step {
    let drive = ALL.map(|c| {
        if held.contains(&c) { Drive::Motion(Course::constant(0.0)) } else { Drive::Load(Course::constant(load[c])) }
    });
    Step {
        name: "step".into(),
        duration_s,
        increment_s: None,
        contact: true,
        drive,
        damping: Six::zeros(),
        fail: Vec::new(),
    }
}

pub(crate) fn program(steps: impl IntoIterator<Item = Step>) -> Program {
    Program { steps: steps.into_iter().collect() }
}

/// A flat square patch, `cells` wide, facing up or down.
pub(crate) fn plate(half: f64, cells: usize, up: bool) -> TriMesh {
    let mut mesh = TriMesh::default();
    let n = cells + 1;
    for j in 0..n {
        for i in 0..n {
            let at = |k: usize| (2.0 * k as f64 / cells as f64 - 1.0) * half;
            mesh.vertices.push(Point::new(at(i), at(j), 0.0));
        }
    }
    for j in 0..cells {
        for i in 0..cells {
            let a = (j * n + i) as u32;
            let m = n as u32;
            mesh.triangles.push([a, a + 1, a + m + 1]);
            mesh.triangles.push([a, a + m + 1, a + m]);
        }
    }
    if up { mesh } else { mesh.flipped() }
}

/// A groove round the femur's axis, from above its front to behind: a surface of revolution, narrowest in the middle.
fn groove() -> TriMesh {
    let (rows, columns) = (120_u32, 40_u32);
    let mut mesh = TriMesh::default();
    for j in 0..=rows {
        // 0 to the front, downwards
        let angle = (f64::from(j) / f64::from(rows) * 170.0 - 60.0).to_radians();
        for i in 0..=columns {
            let x = (f64::from(i) / f64::from(columns) - 0.5) * 40.0;
            let r = 26.0 + 0.025 * x * x;
            mesh.vertices.push(Point::new(x, -r * angle.cos(), 20.0 - r * angle.sin()));
        }
    }
    let n = columns + 1;
    for j in 0..rows {
        for i in 0..columns {
            let a = j * n + i;
            mesh.triangles.push([a, a + n, a + n + 1]);
            mesh.triangles.push([a, a + n + 1, a + 1]);
        }
    }
    let outwards = mesh.area_vector(0).dot(&Vector::new(0.0, -0.5, 0.8)) > 0.0;
    if outwards { mesh } else { mesh.flipped() }
}
