//! The page that shows the order of the work. It calls; it never computes.

use crate::calibrate::{self, calibrate_all};
use crate::diagnose::{self, diagnose_built};
use crate::error::BuildError;
use crate::model_file::LoadedModel;
use crate::options::BuildOptions;
use crate::record::hash;
use crate::run_log::{Kept, RunLog};
use crate::show;
use crate::validate::{self, read_passive, validate_all};
use sim::laxity::LaxityTrial;
use sim::mesh::MeshValue;
use stages::StageError;
use stages::anatomy::check_anatomy;
use stages::assemble::{AssembleOptions, Assembled, assemble};
use stages::attachments::attachments;
use stages::bones::Bones;
use stages::bones::bones;
use stages::cartilage::{Cartilage, cartilage};
use stages::contact_law::{ContactLaw, contact_law};
use stages::frames::frames;
use stages::hexmesh::hexmesh;
use stages::ingest::ingest;
use stages::ingest::{parse_specimen_file, paths_named_in};
use stages::overclosure::overclosure;
use stages::register::{Registration, register};
use stages::segment::{segment_specimen, with_surfaces};
use stages::specimen::{CtPaths, RawSpecimen, Specimen};
use std::collections::BTreeMap;
use std::path::PathBuf;
use validation::validate::Passive;

/// Builds the knee of one specimen.
pub fn build_model(raw: &RawSpecimen, o: &BuildOptions, log: &mut RunLog) -> Result<(), BuildError> {
    // A table that cannot be read is told before hours are spent on what it is for.
    let measured = measured(raw)?;
    let segmented = segmented(raw, o, log)?;
    let raw = segmented.as_ref().unwrap_or(raw);
    let raw_digest = digest(raw);
    let specimen =
        log.stage("ingest", &[&raw_digest], &o.ingest, || ingest(raw, &o.ingest).and_then(checked), show::specimen)?;
    let s = specimen.digest.as_str();
    let registered = registered(&specimen, s, o, log)?;
    let r = registered.as_ref().map_or("left out", |r| r.digest.as_str());
    let left_out = Registration::left_out();
    let registration: &Registration = registered.as_deref().unwrap_or(&left_out);
    let bones = log.stage("bones", &[s], &o.bones, || bones(&specimen, &o.bones), show::bones)?;
    let b = bones.digest.as_str();
    let cartilage = log.stage(
        "cartilage",
        &[s, r, b],
        &o.cartilage,
        || cartilage(&specimen, registration, &bones, &o.cartilage),
        show::cartilage,
    )?;
    let c = cartilage.digest.as_str();
    let frames = log.stage("frames", &[s, b], &o.frames, || frames(&specimen, &bones, &o.frames), show::frames)?;
    let f = frames.digest.as_str();
    let attachments = log.stage(
        "attachments",
        &[s, r, b, c, f],
        &o.attachments,
        || attachments(&specimen, registration, &bones, &cartilage, &frames, &o.attachments),
        show::attachments,
    )?;
    let a = attachments.digest.as_str();
    let hexes = log.stage("hexmesh", &[c], &o.hexmesh, || hexmesh(&cartilage, &o.hexmesh), show::hexmesh)?;
    let h = hexes.digest.as_str();
    let separated =
        log.stage("overclosure", &[h], &o.overclosure, || overclosure(&hexes, &o.overclosure), show::overclosure)?;
    let own_law = || contact_law(&specimen, &frames, &separated, &o.contact_law);
    let inputs = [s, f, separated.digest.as_str()];
    let fit = o.contact_law.fit;
    let law = fit.then(|| log.stage("contact-law", &inputs, &o.contact_law, own_law, show::contact_law)).transpose()?;
    let fitted = assemble_options(&o.assemble, law.as_deref());
    let assembled = log.stage(
        "assemble",
        &[s, f, a, &separated.digest],
        &fitted,
        || assemble(&specimen, &frames, &attachments, &separated, &fitted),
        show::assembled,
    )?;
    if measured.laxity.is_empty() {
        return Ok(());
    }
    let m = assembled.digest.as_str();
    let model = loaded(&assembled, &bones, &cartilage);
    let (folder, tell) = (log.folder(), log.teller());
    let calibration = log.stage(
        "calibrate",
        &[m, b, &measured.digest],
        &o.calibrate,
        || calibrate_all(&model, &measured.laxity, &o.calibrate, folder, &tell),
        calibrate::show,
    )?;
    log.stage(
        "validate",
        &[m, b, &calibration.digest, &measured.digest],
        &o.validate,
        || validate_all(&model.meshes, &calibration, &measured.passive, &o.validate),
        |v| validate::show(v, Some(&calibration)),
    )?;
    if o.diagnose.run {
        log.stage(
            "diagnose",
            &[m, b, &calibration.digest, &measured.digest],
            &o.diagnose,
            || diagnose_built(&model, &calibration, &measured.laxity, &measured.digests, &o.diagnose),
            diagnose::show,
        )?;
    }
    Ok(())
}

/// The registration of scans, or of bones of MRI; `None` for cartilage that lies where its bones lie.
fn registered(
    specimen: &Specimen,
    digest: &str,
    o: &BuildOptions,
    log: &mut RunLog,
) -> Result<Option<Kept<Registration>>, BuildError> {
    if specimen.mri.as_ref().is_some_and(|m| m.in_ct) {
        return Ok(None);
    }
    let run = || register(specimen, &o.register);
    log.stage("register", &[digest], &o.register, run, |r| show::registration(specimen, r)).map(Some)
}

/// The options of `assemble` with the fitted law in place of theirs.
fn assemble_options(given: &AssembleOptions, law: Option<&ContactLaw>) -> AssembleOptions {
    let mut options = given.clone();
    if let Some(law) = law {
        (options.overclosure_mm, options.pressure_mpa) = (law.overclosure_mm.clone(), law.pressure_mpa.clone());
        options.own_law = true;
    }
    options
}

/// The specimen with the surfaces found in its CT volume; `None` where it has surfaces.
fn segmented(raw: &RawSpecimen, o: &BuildOptions, log: &mut RunLog) -> Result<Option<RawSpecimen>, BuildError> {
    let ct = parse_specimen_file(&raw.toml).map_err(|e| BuildError::stage("ingest", e))?.ct;
    if ct.volume.is_none() {
        return Ok(None);
    }
    let picture = picture_digest(&ct, raw);
    let found =
        log.stage("segment", &[&picture], &o.segment, || segment_specimen(&ct, raw, &o.segment), show::segmented)?;
    with_surfaces(&ct, raw, &found).map(Some).map_err(|e| BuildError::stage("segment", e))
}

/// What was measured of the knee's motion.
struct Measured {
    laxity: BTreeMap<String, Vec<LaxityTrial>>,
    passive: Vec<Passive>,
    /// Of each laxity file, by data set.
    digests: BTreeMap<String, String>,
    /// Of all.
    digest: String,
}

/// Reads laxity and passive flexion.
fn measured(raw: &RawSpecimen) -> Result<Measured, BuildError> {
    let file = parse_specimen_file(&raw.toml).map_err(|e| BuildError::stage("ingest", e))?;
    let mut out =
        Measured { laxity: BTreeMap::new(), passive: vec![], digests: BTreeMap::new(), digest: String::new() };
    let (mut digests, mut formats) = (String::new(), String::new());
    let mut bytes = |table: &str, name: &str, path: &str| {
        let found = raw.files.get(path).ok_or_else(|| {
            BuildError::File(format!("specimen.toml [{table}] {name}: no file {path} in the specimen's folder"))
        })?;
        digests += &format!("{table} {name} {}\n", hash(found));
        Ok::<&Vec<u8>, BuildError>(found)
    };
    for (name, path) in &file.laxity {
        let found = bytes("laxity", name, path)?;
        let format = file.laxity_format.get(name).cloned().unwrap_or_default();
        let table = sim::laxity::read_as(found, &format, file.specimen.side)
            .map_err(|e| BuildError::File(format!("{path}: {e}")))?;
        out.digests.insert(name.clone(), hash(found));
        out.laxity.insert(name.clone(), table.trials);
        formats += &format!("{name} {format:?} {:?}\n", file.specimen.side);
    }
    for (name, path) in &file.passive {
        out.passive.push(read_passive(name, path, bytes("passive", name, path)?)?);
    }
    out.digest = hash((digests + &formats).as_bytes());
    Ok(out)
}

/// The assembled model as it would be read back.
fn loaded(assembled: &Assembled, bones: &Bones, cartilage: &Cartilage) -> LoadedModel {
    let contact = assembled.contact.named().map(|(name, mesh)| (format!("contact/{name}.ply"), mesh));
    let patella = bones.patella.as_ref();
    let bones = bones.surfaces.named().map(|(name, mesh)| (format!("../03-bones/{name}.ply"), mesh));
    let patella = patella.map(|mesh| ("../03-bones/patella.ply".to_string(), mesh));
    let carried = cartilage.bodies.iter().map(|(name, mesh)| (format!("../04-cartilage/{name}.ply"), mesh));
    let meshes = contact
        .into_iter()
        .chain(carried)
        .chain(bones)
        .chain(patella)
        .map(|(name, mesh)| (name, MeshValue::Surface(mesh.clone())))
        .collect();
    LoadedModel { spec: assembled.spec.clone(), meshes, folder: PathBuf::from("09-assemble") }
}

/// The specimen, unless its bones are plainly not what it says.
fn checked(specimen: Specimen) -> Result<Specimen, StageError> {
    check_anatomy(&specimen).map(|_| specimen)
}

/// One digest of the CT volume and label map.
fn picture_digest(ct: &CtPaths, raw: &RawSpecimen) -> String {
    let volume = ct.volume.as_deref().unwrap_or_default().trim_end_matches('/');
    let folder = format!("{volume}/");
    let named = [Some(volume), ct.labels.as_deref()];
    let beside: Vec<String> = named
        .into_iter()
        .flatten()
        .flat_map(|name| raw.files.get(name).map(|bytes| paths_named_in(name, bytes)).unwrap_or_default())
        .collect();
    let shown = |name: &str| {
        named.contains(&Some(name)) || name.starts_with(&folder) || beside.iter().any(|other| other == name)
    };
    let of_files: Vec<String> = raw
        .files
        .iter()
        .filter(|(name, _)| shown(name))
        .map(|(name, bytes)| format!("{name} {}", hash(bytes)))
        .collect();
    hash(format!("{ct:?}\n{}", of_files.join("\n")).as_bytes())
}

/// One digest of the specimen's description and every file it names.
pub fn digest(raw: &RawSpecimen) -> String {
    let mut hasher = blake3::Hasher::new();
    for (name, bytes) in std::iter::once((&String::new(), raw.toml.as_bytes()))
        .chain(raw.files.iter().map(|(name, bytes)| (name, bytes.as_slice())))
    {
        hasher.update(&(name.len() as u64).to_le_bytes());
        hasher.update(name.as_bytes());
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    }
    hasher.finalize().to_hex().to_string()
}
