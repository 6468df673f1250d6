//! The page that shows the order of the work. It calls; it never computes.

use crate::error::BuildError;
use crate::options::BuildOptions;
use crate::run_log::{Kept, RunLog};
use crate::show;
use stages::StageError;
use stages::anatomy::check_anatomy;
use stages::assemble::{Assembled, assemble};
use stages::attachments::attachments;
use stages::bones::bones;
use stages::cartilage::cartilage;
use stages::frames::frames;
use stages::hexmesh::hexmesh;
use stages::ingest::{RawSpecimen, Specimen, ingest};
use stages::overclosure::overclosure;
use stages::register::register;

/// Builds the knee of one specimen.
pub fn build_model(raw: &RawSpecimen, o: &BuildOptions, log: &mut RunLog) -> Result<Kept<Assembled>, BuildError> {
    let raw_digest = digest(raw);
    let specimen =
        log.stage("ingest", &[&raw_digest], &o.ingest, || ingest(raw, &o.ingest).and_then(checked), show::specimen)?;
    let s = specimen.digest.as_str();
    let registration = log.stage(
        "register",
        &[s],
        &o.register,
        || register(&specimen, &o.register),
        |r| show::registration(&specimen, r),
    )?;
    let r = registration.digest.as_str();
    let bones = log.stage("bones", &[s], &o.bones, || bones(&specimen, &o.bones), show::bones)?;
    let b = bones.digest.as_str();
    let cartilage = log.stage(
        "cartilage",
        &[s, r, b],
        &o.cartilage,
        || cartilage(&specimen, &registration, &bones, &o.cartilage),
        show::cartilage,
    )?;
    let c = cartilage.digest.as_str();
    let frames = log.stage("frames", &[s, b], &o.frames, || frames(&specimen, &bones, &o.frames), show::frames)?;
    let f = frames.digest.as_str();
    let attachments = log.stage(
        "attachments",
        &[s, r, b, c, f],
        &o.attachments,
        || attachments(&specimen, &registration, &bones, &cartilage, &frames, &o.attachments),
        show::attachments,
    )?;
    let a = attachments.digest.as_str();
    let hexes = log.stage("hexmesh", &[c], &o.hexmesh, || hexmesh(&cartilage, &o.hexmesh), show::hexmesh)?;
    let h = hexes.digest.as_str();
    let separated =
        log.stage("overclosure", &[h], &o.overclosure, || overclosure(&hexes, &o.overclosure), show::overclosure)?;
    log.stage(
        "assemble",
        &[s, f, a, &separated.digest],
        &o.assemble,
        || assemble(&specimen, &frames, &attachments, &separated, &o.assemble),
        show::assembled,
    )
}

/// The specimen, unless its bones are plainly not what it says.
fn checked(specimen: Specimen) -> Result<Specimen, StageError> {
    check_anatomy(&specimen).map(|_| specimen)
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
