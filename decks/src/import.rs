//! The model a knee deck holds: specification, meshes as values, and what is odd.

use super::bodies::{Bodies, frame};
use super::contact::{rigid_surface, solid};
use super::held;
use super::keyword::{ReadFile, read_blocks};
use super::ligaments::{Ligaments, ligaments};
use super::model::{DeckModel, Interaction};
use super::{DeckError, steps, usual};
use meshes::Vector;
use meshes::frame::{AnatomicalFrame, Side};
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use notices::{Kind, Notice};
use sim::joint::Joint;
use sim::mesh::{MeshValue, TetMesh};
use sim::spec::{BodySpec, ContactSpec, FramesSpec, ModelSpec, PairSpec, PoseSpec, Units};
use std::collections::BTreeMap;
use std::io::{self, Write};

/// Width of a knee [mm], the middle extent of a bone along the axes.
const KNEE_WIDTH_MM: f64 = 85.0;
/// How wide knees of adults are, as messages say it [mm].
const ADULTS: &str = "60 to 110 mm";
/// Narrower and wider bones are no knee in mm: no unit's knee lies between these. Ours.
const NARROWEST_MM: f64 = 15.0;
const WIDEST_MM: f64 = 600.0;

/// A deck as a model. `meshes` is keyed by the paths that `spec` names.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedDeck {
    /// model.json.
    pub spec: ModelSpec,
    /// Its meshes by path relative to model.json.
    pub meshes: BTreeMap<String, MeshValue>,
    /// Odd but not fatal; also in `spec.warnings`.
    pub warnings: Vec<Notice>,
}

/// Imports the deck that begins in file `main`; `read` hands over a file by the name the deck gives it.
///
/// The fixed body is the tibia; three CYLINDRICAL connectors lead from it to the femur; node set `ref_frames` holds the two
/// frames; AXIAL connectors are fibres, tied to the bones by beams; contact pairs name cartilage surfaces.
///
/// # Errors
/// The file and line that cannot be read, or what the deck lacks of the above.
pub fn import(main: &str, read: &mut ReadFile) -> Result<ImportedDeck, DeckError> {
    import_whole(main, read).map_err(|e| e.of_deck(main))
}

fn import_whole(main: &str, read: &mut ReadFile) -> Result<ImportedDeck, DeckError> {
    let deck = read_blocks(main, read)?;
    let model = DeckModel::new(&deck)?;
    let bodies = Bodies::of(&model)?;
    let stem = main.rsplit(['/', '\\']).next().unwrap_or(main);
    let stem = stem.strip_suffix(".inp").unwrap_or(stem);
    let Ligaments { bundles, fibres, toe_end_multiple, mut warnings, .. } =
        ligaments(&model, &bodies, &deck.parameters)?;
    let mut meshes = BTreeMap::new();
    let (body_specs, contact) = geometry(&model, &bodies, &mut meshes, &mut warnings)?;
    let bone = |k: usize| match body_specs.get(k).and_then(|b| meshes.get(&b.bone)) {
        Some(MeshValue::Surface(mesh)) => Some(mesh),
        _ => None,
    };
    warnings.extend(held::ends(&fibres, [bone(0), bone(1)]));
    warnings.extend(held::copies(&fibres));
    warnings.extend(usual::strains(&bundles));
    usual::wide(&contact, &meshes)?;
    warnings.extend(usual::other_laws(&model));
    warnings.extend(usual::told(&contact, &body_specs));
    let frames = frames(&model, &bodies)?;
    let side = side(&frames, &fibres)?;
    let protocol = steps::protocol(&deck, &bodies, stem)?;
    let mut spec = ModelSpec {
        schema: "model/1".into(),
        id: model.heading.clone().unwrap_or_else(|| stem.split('_').next().unwrap_or(stem).to_owned()),
        side,
        units: Units { length: "mm".into(), force: "N".into(), pressure: "MPa".into(), angle: "deg".into() },
        frames,
        bodies: body_specs,
        contact,
        bundles,
        fibres,
        wrap: None,
        menisci: Vec::new(),
        toe_end_multiple,
        protocols: protocol.into_iter().collect(),
        components: Vec::new(),
        calibrated: None,
        uncertainty: None,
        patella: None,
        warnings: Vec::new(),
    };
    let across = fibre_sides(&spec.fibres)?;
    orient(&mut spec, &across);
    warnings.extend(usual::sides(&spec.frames, &meshes, &across));
    spec.frames.gs_ct_pose = ct_pose(&spec)?;
    spec.warnings = notices::texts(&warnings);
    Ok(ImportedDeck { spec, meshes, warnings })
}

/// Frames with the deck's own directions; medial and side are settled by [`orient`].
fn frames(model: &DeckModel, bodies: &Bodies) -> Result<FramesSpec, DeckError> {
    let read = |femur: bool| -> Result<AnatomicalFrame, DeckError> {
        let (origin, [medial, anterior, superior]) = frame(model, bodies, femur)?;
        Ok(AnatomicalFrame { origin, medial, anterior, superior })
    };
    Ok(FramesSpec {
        femur: read(true)?,
        tibia: read(false)?,
        gs_ct_pose: PoseSpec::default(),
        chain: Some(bodies.chain),
        grid: None,
    })
}

/// The direction from the lateral to the medial collateral ligament [mm].
fn fibre_sides(fibres: &[sim::spec::FibreSpec]) -> Result<Vector, DeckError> {
    let centre = |medial: bool| {
        let of: Vec<Vector> = fibres
            .iter()
            .filter(|f| if medial { f.bundle.contains("MCL") } else { f.bundle == "LCL" })
            .map(|f| (f.femur.coords + f.tibia.coords) / 2.0)
            .collect();
        (!of.is_empty()).then(|| of.iter().sum::<Vector>() / of.len() as f64)
    };
    match (centre(true), centre(false)) {
        (Some(m), Some(l)) => Ok(m - l),
        _ => Err(DeckError::whole(
            "no LCL or no MCL fibres: the knee's side cannot be told; expected AXIAL connectors or *SPRING, NONLINEAR in element sets named after the bundles (LCL, sMCL_A, ...)",
        )),
    }
}

/// Left or right from the handedness of (medial, anterior, superior).
fn side(frames: &FramesSpec, fibres: &[sim::spec::FibreSpec]) -> Result<Side, DeckError> {
    let across = fibre_sides(fibres)?;
    let f = &frames.femur;
    let medial = if f.medial.dot(&across) < 0.0 { -f.medial } else { f.medial };
    Ok(if medial.cross(&f.anterior).dot(&f.superior) > 0.0 { Side::Left } else { Side::Right })
}

/// Turns the medial axes towards the medial side.
fn orient(spec: &mut ModelSpec, across: &Vector) {
    for frame in [&mut spec.frames.femur, &mut spec.frames.tibia] {
        if frame.medial.dot(across) < 0.0 {
            frame.medial = -frame.medial;
        }
    }
}

pub(crate) fn ct_pose(spec: &ModelSpec) -> Result<PoseSpec, DeckError> {
    let joint = Joint::new(&spec.frames, spec.side).map_err(|e| DeckError::whole(e.to_string()))?;
    let q = joint.ct_pose();
    Ok(PoseSpec {
        fe_deg: q[0].to_degrees(),
        vv_deg: q[1].to_degrees(),
        ie_deg: q[2].to_degrees(),
        ml_mm: q[3],
        ap_mm: q[4],
        si_mm: q[5],
    })
}

/// Bones, cartilages and contact faces.
fn geometry(
    model: &DeckModel,
    bodies: &Bodies,
    meshes: &mut BTreeMap<String, MeshValue>,
    warnings: &mut Vec<Notice>,
) -> Result<(Vec<BodySpec>, ContactSpec), DeckError> {
    let mut specs = Vec::new();
    let mut faces: BTreeMap<String, TriMesh> = BTreeMap::new();
    for femur in [true, false] {
        let root = if femur { bodies.femur } else { bodies.tibia };
        let sets: Vec<&String> =
            model.rigid.iter().filter(|(_, node)| bodies.groups.root(*node) == root).map(|(set, _)| set).collect();
        let paired = |set: &str| model.pairs.iter().flat_map(|p| &p.surfaces).any(|s| element_set(model, s) == set);
        let solid_set = |set: &str| {
            let first = model.elsets.get(set).and_then(|e| e.first());
            first.is_some_and(|&e| model.elements[e].kind.starts_with("C3D"))
        };
        let name = if femur { "femur" } else { "tibfib" };
        let Some(bone) = sets.iter().find(|s| !solid_set(s) && !paired(s)) else {
            return Err(DeckError::whole(format!("no rigid bone surface (R3D3) is tied to the {name}")));
        };
        let surface = rigid_surface(model, bone)?;
        check_unit(name, &surface).map_err(|e| {
            let first = model.elsets.get(*bone).and_then(|set| set.first());
            match first.map(|&e| model.elements[e].at) {
                Some(at) => {
                    model.error(at, format!("{} (this line holds the first element of its set {bone})", e.message))
                }
                None => e,
            }
        })?;
        let query =
            SurfaceQuery::new(&surface).ok_or_else(|| DeckError::whole(format!("the {name} has no triangle")))?;
        let mut cartilage = Vec::new();
        for set in &sets {
            let part = cartilage_name(set, femur);
            if solid_set(set) {
                let solid = solid(model, set, &query)?;
                if matches!(solid.mesh, MeshValue::Tet(_)) {
                    warnings.push(
                        Kind::Tetrahedra
                            .notice(format!(
                                "{part}: tetrahedra where hexahedra are usual; contact uses their outer faces"
                            ))
                            .of(&part),
                    );
                }
                if paired(set) {
                    faces.insert((*set).clone(), solid.articular(&query));
                }
                cartilage.push(format!("meshes/{part}.vtu"));
                meshes.insert(format!("meshes/{part}.vtu"), solid.mesh);
            } else if paired(set) {
                let face = rigid_surface(model, set)?;
                let turned = is_turned(model, set);
                faces.insert((*set).clone(), if turned { face.flipped() } else { face });
            }
        }
        let path = format!("meshes/{name}.ply");
        meshes.insert(path.clone(), MeshValue::Surface(surface));
        let (mass_tonne, inertia_tonne_mm2) = masses(model, bodies, root);
        let name = if femur { "femur" } else { "tibia" }.to_owned();
        specs.push(BodySpec { name, bone: path, cartilage, mass_tonne, inertia_tonne_mm2 });
    }
    let contact = contact(model, bodies, faces, meshes)?;
    Ok((specs, contact))
}

/// Refuses a bone whose size is a knee's in another unit.
pub(crate) fn check_unit(name: &str, bone: &TriMesh) -> Result<(), DeckError> {
    let Some((low, high)) = bone.bounds() else { return Ok(()) };
    let mut extents: Vec<f64> = (high - low).iter().copied().collect();
    extents.sort_by(f64::total_cmp);
    let width = extents[1];
    if (NARROWEST_MM..=WIDEST_MM).contains(&width) {
        return Ok(());
    }
    let units = [("metres", 1000.0), ("inches", 25.4), ("centimetres", 10.0), ("micrometres", 0.001)];
    let knee = |mm: f64| (KNEE_WIDTH_MM / 3.0..KNEE_WIDTH_MM * 3.0).contains(&(width * mm));
    Err(DeckError::whole(match units.iter().find(|(_, mm)| knee(*mm)) {
        Some((unit, mm)) => format!(
            "the {name} is {width:.3} mm wide as its numbers stand, where a knee is {ADULTS} wide: they are in {unit}; expected mm, N, s, tonne, MPa: multiply the nodes by {mm}, and put forces, tables and masses into these units too"
        ),
        None => format!(
            "the {name} is {width:.3} mm wide as its numbers stand, where a knee is {ADULTS} wide; expected {NARROWEST_MM} to {WIDEST_MM} mm: check the unit"
        ),
    }))
}

/// Whether a contact surface is the other side of its elements: `SNEG`, against their normals.
fn is_turned(model: &DeckModel, elset: &str) -> bool {
    let mut parts = model.pairs.iter().flat_map(|p| &p.surfaces).filter_map(|name| model.surfaces.get(name)).flatten();
    parts.any(|(set, face)| set == elset && face == "SNEG")
}

/// The first element set of a surface, or the set of that name.
fn element_set<'a>(model: &'a DeckModel, surface: &'a str) -> &'a str {
    model.surfaces.get(surface).and_then(|parts| parts.first()).map_or(surface, |(set, _)| set)
}

fn cartilage_name(set: &str, femur: bool) -> String {
    let part = match (femur, set.contains("med"), set.contains("lat")) {
        (true, true, _) => "femur_medial",
        (true, _, true) => "femur_lateral",
        (true, ..) => "femur",
        (_, true, _) => "tibia_medial",
        (_, _, true) => "tibia_lateral",
        _ => return format!("cartilage_{}", set.replace(|c: char| !c.is_alphanumeric(), "_")),
    };
    format!("cartilage_{part}")
}

/// Mass and rotary inertia of the point masses tied to a body; the solids' own mass is not counted.
fn masses(model: &DeckModel, bodies: &Bodies, root: u64) -> (f64, f64) {
    let total = |table: &BTreeMap<String, f64>| {
        table
            .iter()
            .map(|(set, value)| {
                let elements = model.elsets.get(set).into_iter().flatten();
                let tied = elements.filter(|&&e| bodies.groups.root(model.elements[e].nodes[0]) == root).count();
                value * tied as f64
            })
            .sum()
    };
    (total(&model.mass), total(&model.inertia))
}

fn contact(
    model: &DeckModel,
    bodies: &Bodies,
    faces: BTreeMap<String, TriMesh>,
    meshes: &mut BTreeMap<String, MeshValue>,
) -> Result<ContactSpec, DeckError> {
    let femoral = |set: &str| {
        let root = model.rigid.iter().find(|(s, _)| s == set).map(|(_, node)| bodies.groups.root(*node));
        root == Some(bodies.femur)
    };
    let path =
        |set: &str| format!("meshes/{}.ply", cartilage_name(set, femoral(set)).replace("cartilage", "articular"));
    let mut pairs = Vec::new();
    let mut law: Option<&Interaction> = None;
    for pair in &model.pairs {
        let [a, b] = [&pair.surfaces[0], &pair.surfaces[1]].map(|s| element_set(model, s));
        let (femur, tibia) = if femoral(a) { (a, b) } else { (b, a) };
        if !femoral(femur) || femoral(tibia) || !faces.contains_key(femur) || !faces.contains_key(tibia) {
            return Err(model.error(
                pair.at,
                format!(
                    "contact pair {} / {} does not join a femoral and a tibial rigid surface",
                    pair.surfaces[0], pair.surfaces[1]
                ),
            ));
        }
        usual::law(model, pair)?;
        law = law.or_else(|| model.interactions.get(&pair.interaction));
        pairs.push(PairSpec { femur: path(femur), tibia: path(tibia) });
    }
    let Some(law) = law.filter(|l| l.table.len() >= 2) else {
        return Err(DeckError::whole(
            "no contact pair with a tabular pressure-overclosure law; expected *CONTACT PAIR of two surfaces (general contact, *CONTACT, is not read)",
        ));
    };
    if law.table.windows(2).any(|w| w[1][1] <= w[0][1]) {
        return Err(DeckError::whole("the pressure-overclosure table's overclosures do not ascend"));
    }
    for (set, mesh) in faces {
        meshes.insert(path(&set), MeshValue::Surface(mesh));
    }
    Ok(ContactSpec {
        overclosure_mm: law.table.iter().map(|p| p[1]).collect(),
        pressure_mpa: law.table.iter().map(|p| p[0]).collect(),
        friction: law.friction,
        damping: law.damping,
        pairs,
        layer: None,
    })
}

impl ImportedDeck {
    /// model.json and the mesh files, as relative paths and bytes, ready to be written.
    ///
    /// # Errors
    /// None but of the writer, which is memory.
    pub fn files(&self) -> io::Result<Vec<(String, Vec<u8>)>> {
        let json = serde_json::to_vec_pretty(&self.spec).map_err(io::Error::other)?;
        let mut files = vec![("model.json".to_owned(), json)];
        for (path, mesh) in &self.meshes {
            let mut bytes = Vec::new();
            match mesh {
                MeshValue::Surface(m) => formats::ply::write(&mut bytes, m, &[])?,
                MeshValue::Hex(m) => formats::vtu::write_hex(&mut bytes, m)?,
                MeshValue::Tet(m) => write_tet(&mut bytes, m)?,
            }
            files.push((path.clone(), bytes));
        }
        Ok(files)
    }
}

/// A tetrahedral VTU (VTK cell type 10).
fn write_tet(out: &mut dyn Write, mesh: &TetMesh) -> io::Result<()> {
    writeln!(
        out,
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">"
    )?;
    let (points, cells) = (mesh.nodes.len(), mesh.elements.len());
    writeln!(out, "<UnstructuredGrid><Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">")?;
    writeln!(out, "<Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">")?;
    for p in &mesh.nodes {
        writeln!(out, "{:?} {:?} {:?}", p.x, p.y, p.z)?;
    }
    writeln!(out, "</DataArray></Points><Cells><DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">")?;
    for e in &mesh.elements {
        writeln!(out, "{}", e.map(|n| n.to_string()).join(" "))?;
    }
    writeln!(out, "</DataArray><DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">")?;
    for i in 1..=cells {
        writeln!(out, "{}", 4 * i)?;
    }
    writeln!(out, "</DataArray><DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">")?;
    for _ in 0..cells {
        writeln!(out, "10")?;
    }
    writeln!(out, "</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>")
}
