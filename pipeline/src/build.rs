//! The page that shows the order of the work: a line a stage, each with what it is given. It calls; it never computes.

use crate::error::BuildError;
use crate::given::{geometry, measured, picture};
use crate::run_log::RunLog;
use crate::stage::list::{
    Assemble, AssignFrames, Attach, Calibrate, Diagnose, FitContactLaw, Hexmesh, Ingest, MakeCartilage, Overclosure,
    Register, RigidBones, Segment, Validate,
};
use stages::specimen::{RawSpecimen, SpecimenFile};

/// Builds the knee of one specimen, of which specimen.toml is parsed already.
pub fn build_model(file: &SpecimenFile, raw: &RawSpecimen, log: &mut RunLog) -> Result<(), BuildError> {
    // A table that cannot be read is told before hours are spent on what it is for.
    let (laxity, passive) = measured(file, raw)?;
    log.read_warnings.clone_from(&laxity.warnings);
    let picture = picture(file, raw)?;
    let given = geometry(file, raw)?;
    let segmented = picture.as_ref().map(|p| log.stage::<Segment>((p,))).transpose()?;
    let specimen = log.stage::<Ingest>((&given, segmented.as_ref()))?;
    // cartilage of MRI that lies where its bones lie needs no registration
    let apart = specimen.mri.as_ref().is_none_or(|m| !m.in_ct);
    let registration = apart.then(|| log.stage::<Register>((&specimen,))).transpose()?;
    let bones = log.stage::<RigidBones>((&specimen,))?;
    let cartilage = log.stage::<MakeCartilage>((&specimen, registration.as_ref(), &bones))?;
    let frames = log.stage::<AssignFrames>((&specimen, &bones))?;
    let attachments = log.stage::<Attach>((&specimen, registration.as_ref(), &bones, &cartilage, &frames))?;
    let hexes = log.stage::<Hexmesh>((&cartilage,))?;
    let separated = log.stage::<Overclosure>((&hexes,))?;
    let fit = log.options().contact_law.fit;
    let law = fit.then(|| log.stage::<FitContactLaw>((&specimen, &frames, &separated))).transpose()?;
    let assembled =
        log.stage::<Assemble>((&specimen, &bones, &cartilage, &frames, &attachments, &separated, law.as_ref()))?;
    if laxity.laxity.is_empty() {
        return Ok(());
    }
    let calibration = log.stage::<Calibrate>((&assembled, &bones, &cartilage, &laxity))?;
    log.stage::<Validate>((&assembled, &bones, &cartilage, &calibration, &passive))?;
    if log.options().diagnose.run {
        log.stage::<Diagnose>((&assembled, &bones, &cartilage, &calibration, &laxity))?;
    }
    Ok(())
}
