//! `export`: a model as other programs read it.

use crate::error::BuildError;
use crate::model_file::{LoadedModel, left_out, load_which};
use crate::store;
use crate::told::{ExportTold, ModelTold, Told, schemas};
use crate::which_model::WhichModel;
use decks::opensim::thickened;
use meshes::Isometry;
use meshes::surface::TriMesh;
use notices::{Kind, Notice};
use sim::ligament::{Bundle, of_fibres};
use sim::mesh::MeshValue;
use sim::spec::BundleSpec;
use std::path::Path;

mod abaqus;
mod beside;
mod edited;
mod febio;
mod gltf;
mod opensim;
mod series;
mod steps;

/// What a model can be exported as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// An Abaqus/Explicit deck.
    Abaqus,
    /// A FEBio model, format version 4.0.
    Febio,
    /// An OpenSim model (.osim) with its geometry, for OpenSim 4.6.
    Opensim,
    /// VTK: PolyData for ParaView, or with --poses a time series (.pvd, .vtu).
    Vtk,
    /// The surfaces as STL.
    Stl,
    /// The surfaces as PLY.
    Ply,
    /// Surfaces and fibres as one binary glTF.
    Glb,
}

/// What presses in an exported OpenSim model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum OpensimContact {
    /// ElasticFoundationForce, which OpenSim itself has.
    #[default]
    Elastic,
    /// Smith2018ArticularContactForce, for OpenSim with JAM; import-opensim reads it.
    Jam,
}

/// What is said of a patella that acts, in an OpenSim model.
const PATELLA_OFF: &str = "the patella is a body there, locked and with its forces switched off, as it acts under a pull of the quadriceps alone: unlock its coordinates, set appliesForce of its forces, and give each head the whole tension as its control; the bone beside the trochlea is left out";

/// A file name and what is in it.
type File = (String, Vec<u8>);

/// `export`: a model as other programs read it, in `out`. `poses` (results of `simulate`) make a time series of VTK files, or a file a row of a deck, of
/// FEBio and of OpenSim. Files there that were changed since an export wrote them are written over by `force` alone.
pub fn export(
    (model, which): (&Path, &WhichModel),
    (format, contact): (Format, Option<OpensimContact>),
    poses: Option<&Path>,
    out: &Path,
    force: bool,
) -> Result<Told, BuildError> {
    if poses.is_some() && ![Format::Vtk, Format::Abaqus, Format::Febio, Format::Opensim].contains(&format) {
        return Err(BuildError::Usage("--poses goes with --format vtk, abaqus, febio or opensim".into()));
    }
    if contact.is_some() && format != Format::Opensim {
        return Err(BuildError::Usage("--contact goes with --format opensim".into()));
    }
    let contact = contact.unwrap_or_default();
    let mut loaded = load_which(model, which)?;
    let left = left_out(&loaded.spec, "export");
    let (mut files, mut warnings) = written(&mut loaded, model, (format, contact), poses)?;
    warnings.splice(0..0, left);
    if [Format::Abaqus, Format::Febio, Format::Opensim].contains(&format) {
        let carried = carried(&loaded)?;
        warnings.extend(left_behind(&loaded, (format, contact), !carried.is_empty()));
        files.extend(carried);
    }
    files.iter_mut().for_each(|file| beside::label(file, &loaded));
    // before the answers beside them, which take long
    edited::looked_at(out, &files, &beside::ANSWERS, force)?;
    let (answers, missing) = beside::files(&loaded)?;
    files.extend(answers);
    warnings.extend(missing);
    let earlier = edited::guarded(out, &mut files, force)?;
    store::write_all(out, &files)?;
    earlier.removed(out);
    let went = earlier.line();
    warnings.extend(earlier.notices);
    let names: Vec<String> = files.into_iter().map(|(name, _)| name).collect();
    let words = format!("{}{} in {}\n{went}", loaded.line(), names.join(", "), out.display());
    let data = ExportTold {
        schema: schemas::EXPORT,
        model: ModelTold::of(&loaded),
        folder: out.display().to_string(),
        files: names,
        warnings: notices::texts(&warnings),
        notices: warnings.clone(),
    };
    Ok(Told::words(words).odd(warnings).with(&data))
}

/// The files of a format, and what they cannot have.
fn written(
    loaded: &mut LoadedModel,
    model: &Path,
    (format, contact): (Format, OpensimContact),
    poses: Option<&Path>,
) -> Result<(Vec<File>, Vec<Notice>), BuildError> {
    Ok(match (format, poses) {
        (Format::Abaqus, asked) => abaqus::files(loaded, model, asked)?,
        (Format::Febio, asked) => {
            let (imposed, mut warnings) = steps::by_flexion(loaded, asked)?;
            let mut files = febio::files(loaded, &imposed)?;
            files.push(steps::list(&imposed, febio::ENDING, asked));
            warnings.extend(febio::warnings(loaded));
            (files, warnings)
        }
        (Format::Opensim, asked) => {
            let (imposed, mut warnings) = steps::by_flexion(loaded, asked)?;
            let mut files = opensim::files(loaded, contact, &imposed)?;
            files.push(steps::list(&imposed, opensim::ENDING, asked));
            warnings.extend(opensim::warnings(loaded, contact));
            (files, warnings)
        }
        (Format::Vtk, None) => {
            (texts(sim::vtk::export(&loaded.spec, &loaded.meshes, &Isometry::identity(), &[])), Vec::new())
        }
        (Format::Vtk, Some(poses)) => series::files(loaded, poses, &store::read(poses)?)?,
        (Format::Stl, _) => (surfaces(loaded, "stl")?, Vec::new()),
        (Format::Ply, _) => (surfaces(loaded, "ply")?, Vec::new()),
        (Format::Glb, _) => (vec![("model.glb".to_owned(), gltf::glb(loaded))], Vec::new()),
    })
}

/// What a solver's files leave out of the model.
fn left_behind(loaded: &LoadedModel, (format, contact): (Format, OpensimContact), is_carried: bool) -> Vec<Notice> {
    let mut warnings = Vec::new();
    if is_carried {
        let but = if loaded.spec.menisci.is_empty() { "" } else { "; the menisci that act are parts of their own" };
        let known = if loaded.spec.patella.is_some() { "" } else { "; no contact or ligament of the model knows them" };
        let text = format!("patella and menisci lie in carried/ as surfaces in the model's frame{known}{but}");
        warnings.push(Kind::NotInFormat.notice(text));
    }
    if loaded.spec.patella.is_some() {
        warnings.push(Kind::NotInFormat.notice(match format {
            Format::Opensim => PATELLA_OFF,
            _ => "the patella acts in the model under a pull of the quadriceps; here it is left out",
        }));
    }
    if let Some(wraps) = loaded.wraps() {
        warnings.push(Kind::NotInFormat.notice(format!("{wraps} in the model; they are straight lines here")));
    }
    let by_thickness = format == Format::Opensim && contact == OpensimContact::Jam;
    if loaded.spec.contact.layer.is_some() && !by_thickness {
        warnings.push(
            Kind::NotInFormat.notice("contact is that of the table: no such format knows the model's law by thickness"),
        );
    }
    warnings
}

fn texts(files: Vec<(String, String)>) -> Vec<File> {
    files.into_iter().map(|(name, text)| (name, text.into_bytes())).collect()
}

/// A surface of the model: its name, whether it moves with the femur, whether it is a bone.
struct Named<'a> {
    name: String,
    mesh: &'a TriMesh,
    femur: bool,
    bone: bool,
}

/// Bones, then contact faces, each once: `femur_bone`, `tibia_bone`, `femur_contact`, `tibia_contact_1`, ...
fn named(model: &LoadedModel) -> Vec<Named<'_>> {
    let surface = |path: &String| match model.meshes.get(path) {
        Some(MeshValue::Surface(mesh)) => Some(mesh),
        _ => None,
    };
    let mut out = Vec::new();
    for body in model.spec.bodies.iter().filter(|b| b.acts()) {
        if let Some(mesh) = surface(&body.bone) {
            out.push(Named { name: format!("{}_bone", body.name), mesh, femur: body.name == "femur", bone: true });
        }
    }
    let mut done: Vec<&String> = Vec::new();
    for (path, femur) in model.spec.contact.pairs.iter().flat_map(|p| [(&p.femur, true), (&p.tibia, false)]) {
        let (Some(mesh), false) = (surface(path), done.contains(&path)) else { continue };
        done.push(path);
        let stem = if femur { "femur_contact" } else { "tibia_contact" };
        let number = out.iter().filter(|n| n.name.starts_with(stem)).count() + 1;
        out.push(Named { name: format!("{stem}_{number}"), mesh, femur, bone: false });
    }
    out
}

/// The name that [`named`] gives to the contact face at `path`.
fn contact_name(model: &LoadedModel, path: &str, femur: bool) -> String {
    let mut done: Vec<&String> = Vec::new();
    for p in &model.spec.contact.pairs {
        let own = if femur { &p.femur } else { &p.tibia };
        if !done.contains(&own) {
            done.push(own);
        }
    }
    let number = done.iter().position(|p| *p == path).map_or(0, |n| n + 1);
    format!("{}_contact_{number}", if femur { "femur" } else { "tibia" })
}

/// Bodies that no solver knows, as STL: patella, its cartilage, menisci.
fn carried(model: &LoadedModel) -> Result<Vec<File>, BuildError> {
    let bodies = model.spec.bodies.iter().filter(|b| !b.acts());
    bodies
        .filter_map(|b| match model.meshes.get(&b.bone) {
            Some(MeshValue::Surface(mesh)) => Some((&b.name, mesh)),
            _ => None,
        })
        .map(|(name, mesh)| {
            let mut bytes = Vec::new();
            formats::stl::write(&mut bytes, mesh).map_err(|e| BuildError::File(format!("{name}: {e}")))?;
            Ok((format!("carried/{name}.stl"), bytes))
        })
        .collect()
}

fn surfaces(model: &LoadedModel, ending: &str) -> Result<Vec<File>, BuildError> {
    let carried = model.spec.bodies.iter().filter(|b| !b.acts()).filter_map(|b| match model.meshes.get(&b.bone) {
        Some(MeshValue::Surface(mesh)) => {
            let name = if b.name == "patella" { "patella_bone".to_string() } else { b.name.clone() };
            Some(Named { name, mesh, femur: false, bone: true })
        }
        _ => None,
    });
    named(model)
        .into_iter()
        .chain(carried)
        .map(|n| {
            let mut bytes = Vec::new();
            let wrote = match ending {
                "stl" => formats::stl::write(&mut bytes, n.mesh),
                _ => formats::ply::write(&mut bytes, n.mesh, &[]),
            };
            wrote.map_err(|e| BuildError::File(format!("{}: {e}", n.name)))?;
            Ok((format!("{}.{ending}", n.name), bytes))
        })
        .collect()
}

/// The force law of a bundle of so many fibres.
fn law_of(model: &LoadedModel, bundle: &BundleSpec, fibres: usize) -> Result<Bundle, BuildError> {
    let end = model.spec.toe_end_multiple.get(&bundle.name).copied();
    of_fibres(bundle, fibres, end).map_err(|e| BuildError::File(format!("{}: {e}", model.folder.display())))
}

/// Pressure per overclosure by which the model continues its contact table [MPa/mm]: the slope of the table's end.
fn contact_stiffness(model: &LoadedModel) -> f64 {
    let (d, p) = (&model.spec.contact.overclosure_mm, &model.spec.contact.pressure_mpa);
    match (d.as_slice(), p.as_slice()) {
        ([.., d0, d1], [.., p0, p1]) if d1 > d0 => (p1 - p0) / (d1 - d0),
        _ => 0.0,
    }
}

/// How far the contact table bends from the straight line of its end's slope, as a sentence; none where it is straight.
fn bent(model: &LoadedModel) -> Option<Notice> {
    let (c, k) = (&model.spec.contact, contact_stiffness(model));
    let off = |(d, p): &(&f64, &f64)| (k * **d - **p).abs();
    let points = c.overclosure_mm.iter().zip(&c.pressure_mpa).filter(|(d, _)| **d > 0.0);
    let worst = points.max_by(|a, b| off(a).total_cmp(&off(b)))?;
    let largest = c.pressure_mpa.last().copied().unwrap_or(0.0);
    (off(&worst) > 1e-6 * largest).then(|| {
        let (d, p) = worst;
        Kind::NotInFormat.notice(format!(
            "contact is linear there: {k:.3} MPa/mm, at most {:.3} MPa off the model's table, at {d:.2} mm of overclosure ({:.3} MPa for {p:.3}); the table ends at {largest:.2} MPa",
            off(&worst), k * d
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::shapes::icosphere;
    use meshes::topology::Topology;

    #[test]
    fn a_thickened_cap_is_closed_and_turned_outwards() {
        let ball = icosphere(20.0, 4);
        let (half, _) = ball.submesh(|t| ball.corners(t).iter().all(|p| p.z > 0.0));
        assert!(!Topology::of(&half).is_closed());
        let solid = thickened(&half, 2.0);
        assert!(Topology::of(&solid).is_closed());
        let expected = half.area() * 2.0 * 0.9;
        assert!((solid.volume() / expected - 1.0).abs() < 0.1, "{} {expected}", solid.volume());
    }
}
