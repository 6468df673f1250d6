//! Smith2018ArticularContactForce: which surfaces meet, and by which table they press.
//!
//! A model has one law for all its pairs.

use super::forces::{Force, Mesh};
use super::knee::Knee;
use super::{Files, MM_PER_M};
use crate::DeckError;
use crate::faces::{behind, facing, free_path, same};
use meshes::Isometry;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use notices::{Kind, Notice};
use sim::mesh::MeshValue;
use sim::spec::{ContactSpec, FramesSpec, LayerSpec, PairSpec};
use std::collections::BTreeMap;

/// Least and largest thickness that a model takes [mm].
const THINNEST_MM: f64 = 0.05;
const THICKEST_MM: f64 = 5.0;

impl Mesh {
    /// A file of it in the knee's coordinates [mm].
    fn surface(&self, knee: &Knee, files: &mut Files<'_, '_>, file: &str) -> Result<TriMesh, DeckError> {
        let place = knee.place(self.body).unwrap_or_else(Isometry::identity) * self.place;
        let mut mesh = files.surface(file).map_err(|e| files.fault(self.line, e))?;
        for p in &mut mesh.vertices {
            *p = place * meshes::Point::from(p.coords.component_mul(&self.scale) * MM_PER_M);
        }
        Ok(mesh)
    }
}

/// The contact of a knee, and its surfaces.
pub(super) struct Contact {
    pub(super) spec: ContactSpec,
    pub(super) meshes: BTreeMap<String, MeshValue>,
    pub(super) told: Vec<Notice>,
}

/// Contact between femur and tibia.
///
/// Errors: none; pairs of several laws; surfaces that cannot be read.
pub(super) fn contact(
    knee: &Knee,
    forces: &[Force],
    frames: &FramesSpec,
    files: &mut Files<'_, '_>,
) -> Result<Contact, DeckError> {
    let (own, others): (Vec<&Force>, Vec<&Force>) = forces.iter().partition(|f| knee.joins(f));
    let Some(first) = own.first() else {
        return Err(files.fault(0, "no Smith2018ArticularContactForce acts between femur and tibia".into()));
    };
    let mut out = Contact { spec: table_of(first, files)?, meshes: BTreeMap::new(), told: Vec::new() };
    let mut paths: BTreeMap<(String, usize), String> = BTreeMap::new();
    for force in &own {
        if !same(&table_of(force, files)?, &out.spec) || (force.law, force.has_back()) != (first.law, first.has_back())
        {
            let what = format!(
                "{} and {} press by different laws; expected one law between femur and tibia",
                first.name, force.name
            );
            return Err(files.fault(force.line, what));
        }
        let [mut femur, mut tibia] = [String::new(), String::new()];
        for mesh in &force.meshes {
            let femoral = knee.bone(mesh.body) == knee.femur;
            let key = (mesh.name.clone(), mesh.body);
            if !paths.contains_key(&key) {
                let path = free_path(if femoral { "femur" } else { "tibia" }, &out.meshes);
                take(&Face { force, mesh, femoral, path: &path }, knee, frames, files, &mut out)?;
                paths.insert(key.clone(), path);
            }
            *(if femoral { &mut femur } else { &mut tibia }) = paths[&key].clone();
        }
        out.spec.pairs.push(PairSpec { femur, tibia });
        if force.from > 0.0 {
            out.told.push(
                Kind::DeckOdd.notice(format!("{}: min_proximity is passed over: contact begins at 0", force.name)),
            );
        }
    }
    if !others.is_empty() {
        let names: Vec<&str> = others.iter().map(|f| f.name.as_str()).collect();
        let text = format!("contact that is not between femur and tibia is left out: {}", names.join(", "));
        out.told.push(Kind::DeckOdd.notice(text).count(others.len()));
    }
    Ok(out)
}

/// A surface of a force, on the femur or on the tibia, and where it goes among the model's meshes.
struct Face<'a> {
    force: &'a Force,
    mesh: &'a Mesh,
    femoral: bool,
    path: &'a str,
}

/// Takes a surface, and the face on bone where thickness is counted from it.
fn take(
    face: &Face<'_>,
    knee: &Knee,
    frames: &FramesSpec,
    files: &mut Files<'_, '_>,
    out: &mut Contact,
) -> Result<(), DeckError> {
    let Face { force, mesh, femoral, path } = *face;
    let mut surface = mesh.surface(knee, files, &mesh.file.clone())?;
    if Topology::of(&surface).is_closed() {
        surface = facing(&surface, femoral, frames);
        out.told.push(
            Kind::DeckOdd
                .notice(format!(
                    "{}: the surface is closed; its side towards the joint presses, {} of its triangles",
                    mesh.name,
                    surface.triangles.len()
                ))
                .of(&mesh.name),
        );
    }
    if force.has_back() {
        let bony = path.replace("articular", "bony");
        let back = match &mesh.back {
            Some(file) => mesh.surface(knee, files, file)?,
            // a layer of one thickness has its back that far behind
            None => behind(&surface, mesh.thickness),
        };
        out.meshes.insert(bony.clone(), MeshValue::Surface(back));
        let (modulus, poisson) = force.material();
        let least = force.meshes.iter().map(|m| m.least).fold(THINNEST_MM, f64::max).min(THICKEST_MM);
        let layer = out.spec.layer.get_or_insert_with(|| LayerSpec {
            law: force.law,
            youngs_modulus_mpa: modulus,
            poissons_ratio: poisson,
            edge_spread: 0.0,
            least_thickness_mm: least,
            bony_faces: BTreeMap::new(),
        });
        layer.bony_faces.insert(path.to_owned(), bony);
    }
    out.meshes.insert(path.to_owned(), MeshValue::Surface(surface));
    Ok(())
}

/// The contact of a force without its pairs.
///
/// Errors: layers of two materials, one of which has a thickness of its own at each place.
fn table_of(force: &Force, files: &Files<'_, '_>) -> Result<ContactSpec, DeckError> {
    let [a, b] = &force.meshes;
    if force.has_back() && !force.lumped && (a.modulus, a.poisson) != (b.modulus, b.poisson) {
        let what = format!(
            "{} and {} are of two materials and one has a thickness that varies; expected one material, or use_lumped_contact_model true",
            a.name, b.name
        );
        return Err(files.fault(force.line, what));
    }
    let (overclosure_mm, pressure_mpa) = force.table();
    Ok(ContactSpec { overclosure_mm, pressure_mpa, friction: 0.0, damping: 0.0, pairs: Vec::new(), layer: None })
}
