//! What the finished stages of a build left, read back for the report.

use crate::calibrate::Calibration;
use crate::options::BuildOptions;
use crate::record::folder_name;
use crate::run_log::value_name;
use crate::store::BuildFolder;
use crate::validate::Validation;
use serde::de::DeserializeOwned;
use stages::assemble::Assembled;
use stages::attachments::Attachments;
use stages::bones::Bones;
use stages::cartilage::Cartilage;
use stages::contact_law::ContactLaw;
use stages::frames::Frames;
use stages::hexmesh::HexCartilage;
use stages::overclosure::Separated;
use stages::register::Registration;
use stages::specimen::Specimen;

/// The values of the finished stages.
pub(super) struct Values {
    /// The build's own options.
    pub(super) options: BuildOptions,
    pub(super) specimen: Option<Specimen>,
    pub(super) registration: Option<Registration>,
    pub(super) bones: Option<Bones>,
    pub(super) cartilage: Option<Cartilage>,
    pub(super) frames: Option<Frames>,
    pub(super) attachments: Option<Attachments>,
    pub(super) hexes: Option<HexCartilage>,
    pub(super) separated: Option<Separated>,
    pub(super) contact_law: Option<ContactLaw>,
    pub(super) assembled: Option<Assembled>,
    pub(super) calibration: Option<Calibration>,
    pub(super) validation: Option<Validation>,
}

impl Values {
    /// The values of the stages in `stages`; a stage that is not there, or was kept by another version, gives none.
    pub(super) fn read(folder: &BuildFolder, stages: &[&str]) -> Values {
        Values {
            options: options(folder).unwrap_or_default(),
            specimen: value(folder, "ingest", stages),
            registration: value(folder, "register", stages),
            bones: value(folder, "bones", stages),
            cartilage: value(folder, "cartilage", stages),
            frames: value(folder, "frames", stages),
            attachments: value(folder, "attachments", stages),
            hexes: value(folder, "hexmesh", stages),
            separated: value(folder, "overclosure", stages),
            contact_law: value(folder, "contact-law", stages),
            assembled: value(folder, "assemble", stages),
            calibration: value(folder, "calibrate", stages),
            validation: value(folder, "validate", stages),
        }
    }

    /// Name, and whether the knee is synthetic.
    pub(super) fn identity(&self) -> (String, bool) {
        self.specimen.as_ref().map_or(("a knee".into(), false), |s| {
            (s.identity.id.clone(), s.identity.provenance.as_deref() == Some("synthetic"))
        })
    }
}

/// The options in force, as run.toml has them; `None` where another version wrote it.
fn options(folder: &BuildFolder) -> Option<BuildOptions> {
    let run: toml::Table = String::from_utf8(folder.read_file("run.toml")?).ok()?.parse().ok()?;
    run.get("options")?.clone().try_into().ok()
}

fn value<T: DeserializeOwned>(folder: &BuildFolder, stage: &str, stages: &[&str]) -> Option<T> {
    if !stages.contains(&stage) {
        return None;
    }
    let bytes = folder.read_file(&format!("{}/{}", folder_name(stage), value_name()))?;
    ciborium::from_reader(bytes.as_slice()).ok()
}
