//! The knee that the reader pulls at: the calibrated model in the page, with the module that solves it.

use super::geometry::Pool;
use super::html::escaped;
use super::motion::corners;
use super::scene::Scene;
use crate::calibrate::samples;
use crate::model_file::assembled_model;
use crate::stage::list::{Assemble, Calibration};
use crate::stage::{Values, View};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use live::{Asked, Packed, pack};
use stages::assemble::Assembled;
use stages::bones::Bones;
use stages::cartilage::Cartilage;
use std::io::Write;

/// What runs on the page beside its viewer, in this order: the last uses the others.
const SCRIPTS: [&str; 5] = [
    include_str!("live_words.js"),
    include_str!("live_hand.js"),
    include_str!("live_draft.js"),
    include_str!("live_graft.js"),
    include_str!("live.js"),
];

/// What the reader of a page begins with.
#[derive(Clone, Copy)]
pub(crate) enum Begin<'a> {
    /// The knee as it was calibrated.
    Calibrated,
    /// A plan's cuts and grafts.
    Plan(&'a Asked),
    /// The model that a diagnosis leaves.
    Diagnosed {
        /// Whether an answer was added to it.
        added: bool,
    },
}

impl Begin<'_> {
    /// What it is; and what stands in its place where a browser cannot solve it.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Begin::Calibrated => (
                "Cut a ligament and read what changes.",
                "the motions that were stored with the report show the knee: <a href=\"#scene-a-knee\">the knee in 3D</a>",
            ),
            Begin::Plan(_) => (
                "The plan's cuts and grafts are in it; Undo and Reset come back to them.",
                "the tables of the plan stand above",
            ),
            Begin::Diagnosed { added: true } => (
                "The first answer is added to it and the ligaments are recalibrated: the model.json beside this page. What belongs to one data set alone does not act here. It has no intervals yet: calibrate it for them.",
                "the tables of the diagnosis stand above",
            ),
            Begin::Diagnosed { added: false } => {
                ("Nothing was added to it: the model as it was given.", "the tables of the diagnosis stand above")
            }
        }
    }
}

/// A knee in a page.
pub(super) struct LiveKnee {
    /// The packed knee, compressed.
    knee: Vec<u8>,
    /// Which of its models.
    name: String,
}

impl LiveKnee {
    /// The knee of a build that was calibrated; `None` of others, and of one whose values another version kept.
    pub(super) fn of(v: &Values, pool: &Pool) -> Option<LiveKnee> {
        let (name, outcome) = v.of::<Calibration>()?.main()?;
        let assembled = v.of::<Assembled>()?;
        let loaded = assembled_model(assembled, v.of::<Bones>()?, v.of::<Cartilage>()?);
        let packed = Packed {
            spec: outcome.spec.clone(),
            samples: samples(outcome, &assembled.spec),
            meshes: loaded.meshes,
            faces: corners(&assembled.contact),
            axes: pool.axes(),
        };
        LiveKnee::packed(&packed, name)
    }

    /// A knee of a name; `None` where a surface that it needs is missing.
    pub(super) fn packed(knee: &Packed, name: &str) -> Option<LiveKnee> {
        Some(LiveKnee { knee: gzip(&pack(knee).ok()?)?, name: name.to_owned() })
    }

    /// What its scene shows.
    pub(super) fn caption(&self) -> String {
        format!(
            "The femur moves on the tibia, which stands still, as the model \"{}\" answers. Fibres are coloured by force, cartilage by contact pressure. The tables say the same in numbers.",
            self.name
        )
    }

    /// The scene that it moves.
    pub(super) fn scene(&self, v: &Values, pool: &mut Pool) -> Option<Scene> {
        let mut scene = Assemble.scene(v, pool)?;
        scene.layers.retain(|l| l.moves != Some("measured"));
        scene.id = "live".into();
        scene.title = "The knee under your loads".into();
        scene.text = self.caption();
        Some(scene)
    }

    /// The section; `figure` is the scene's. The page's script fills what needs an answer.
    pub(super) fn section(&self, figure: &str, begin: Begin) -> String {
        let (told, without) = begin.words();
        let start = match begin {
            Begin::Plan(asked) => serde_json::to_string(asked).ok(),
            Begin::Calibrated | Begin::Diagnosed { .. } => None,
        };
        let start = start.map_or(String::new(), |s| format!(" data-start=\"{}\"", escaped(&s)));
        format!(
            "<section id=\"live\" data-name=\"{0}\"{start}><h2>Pull at the knee</h2>\
             <p>Choose a test, move a slider, or pull at the tibia in the picture. The page itself solves the model \"{0}\", without network. {told}</p>\
             <p class=\"live-note\" role=\"status\"><span>This needs JavaScript with WebAssembly.</span> Without them {without}.</p>\
             <div class=\"live-grid\"><div class=\"live-controls\"></div><div class=\"live-seen\">{figure}</div></div><div class=\"live-answer\"></div></section>",
            escaped(&self.name)
        )
    }

    /// The module and the knee, and the scripts that ask it; they come after the viewer.
    pub(super) fn scripts(&self) -> String {
        let part = |id: &str, bytes: &[u8]| {
            format!("<script type=\"application/gzip\" id=\"{id}\">{}</script>", STANDARD.encode(bytes))
        };
        part("live-module", live::MODULE)
            + &part("live-knee", &self.knee)
            + &format!("<script type=\"text/plain\" id=\"live-worker\">{}</script>", include_str!("live_worker.js"))
            + &SCRIPTS.map(|script| format!("<script>{script}</script>")).concat()
    }
}

/// Compressed, without time or name: the same bytes give the same bytes.
fn gzip(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut out = GzEncoder::new(Vec::new(), Compression::best());
    out.write_all(bytes).ok()?;
    out.finish().ok()
}
