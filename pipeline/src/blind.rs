//! `blind`: data with hidden effects from an independent laboratory, answers to them, and their scores.

mod answer;
mod bench;
mod copied;
mod drawn;
mod hard;
mod make;
mod regret;
mod score;
mod table;

use crate::diagnose;
use crate::error::BuildError;
use crate::options::{Override, parse_override};
use clap::{Args, Subcommand};
use std::path::PathBuf;

pub(crate) use copied::planned;
pub(crate) use drawn::apart;
pub use hard::Laboratory;
pub(crate) use make::kept;

/// `build-model blind`.
#[derive(Subcommand, Clone, Debug)]
pub enum BlindVerb {
    /// Make cases: a folder each, its truth sealed beside it
    Make(MakeArgs),
    /// Diagnose every case of a bench, without its truths
    Answer(AnswerArgs),
    /// Open the truths and score the answers
    Score(ScoreArgs),
}

/// `blind make`.
#[derive(Args, Clone, Debug)]
pub struct MakeArgs {
    /// model.json of the knee that is copied into the laboratory
    pub model: PathBuf,
    /// A protocol: loads, flexions and noise of its trials; measured poses are not looked at
    #[arg(long, value_name = "NAME=LAXITY.csv", required = true, value_parser = diagnose::named_file)]
    pub like: Vec<(String, PathBuf)>,
    /// A new folder for the cases
    #[arg(long)]
    pub out: PathBuf,
    /// How many
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub count: u32,
    /// Seed of the first
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Only this kind: null, compound, unknown, or an effect's name. cut_ACL takes away a ligament, or the share of it that --size says; attachment_ACL
    /// moves its sites (ACL, PCL, sMCL, LCL); structure_loss and attachment draw the ligament
    #[arg(long)]
    pub kind: Option<String>,
    /// Every kind of the catalogue takes its turn, also those that earlier benches left out, with a null before each five
    #[arg(long, conflicts_with = "kind")]
    pub every_kind: bool,
    /// So many cuts of each of ACL, PCL, sMCL and LCL, in turn, and as many whole knees; --size is the share that is lost
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["kind", "every_kind", "count"], value_parser = clap::value_parser!(u32).range(1..=20_000))]
    pub cuts: Option<u32>,
    /// Each case also has what the same knee read before, with nothing hidden in it, on another day; answer takes that as --before
    #[arg(long)]
    pub before: bool,
    /// Factor on the sizes of effects: below 1 for weak ones
    #[arg(long, default_value_t = 1.0)]
    pub size: f64,
    /// Each data set reads poses in frames of its own, as far from the knee's as calibrate.frames believes: sensors are calibrated anew, points probed again
    #[arg(long)]
    pub own_frames: bool,
    /// Ligaments and contact differ from the model's one and a half times as widely as the analysis supposes: strains by 0.045, stiffness by 30 %,
    /// contact by 45 %, one standard deviation, with no strain too far off
    #[arg(long)]
    pub wide: bool,
    /// The knee has other surfaces than the model: plateaus tilted by 2 deg, cartilage of another form by 0.5 mm, one standard deviation
    #[arg(long)]
    pub surfaces: bool,
    /// Which laboratory measures
    #[arg(long, value_enum, default_value_t = Laboratory::First)]
    pub laboratory: Laboratory,
}

/// `blind answer`.
#[derive(Args, Clone, Debug)]
pub struct AnswerArgs {
    /// model.json that is diagnosed
    pub model: PathBuf,
    /// The bench's folder
    pub bench: PathBuf,
    /// Where the answers go, a folder a case; answers that are there already are kept
    #[arg(long)]
    pub out: PathBuf,
    /// Override an option of the diagnosis or of the knee's calibration
    #[arg(long = "set", value_name = "diagnose.key=value", value_parser = parse_override)]
    pub overrides: Vec<Override>,
    /// A part of the method taken away, to see what it is worth: into a folder of its own
    #[arg(long, value_enum)]
    pub ablation: Option<Ablation>,
    /// Strike from the catalogue what is hidden in each case, and answer cases of a single effect alone: the truth is opened for its name, no more
    #[arg(long)]
    pub struck: bool,
    /// Tell beside each new answer by how much its search stayed behind a fit that starts at the truth (regret.json). The search does not see the truth
    #[arg(long, conflicts_with = "struck")]
    pub regret: bool,
}

/// A part of the method taken away.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ablation {
    /// Ligaments and contact held at the model's own, instead of marginalised
    FrozenLigaments,
    /// Tracking noise alone, no declared floor
    NoFloor,
    /// An answer outside the catalogue is not allowed
    NoWildcard,
    /// Rivals ranked by the error that they leave, not by evidence
    ByError,
}

/// `blind score`.
#[derive(Args, Clone, Debug)]
pub struct ScoreArgs {
    /// The model that was diagnosed
    pub model: PathBuf,
    /// The bench's folder
    pub bench: PathBuf,
    /// Folders of answers: one, or several to compare (ablations). Cases without an answer are left out
    #[arg(required = true)]
    pub answers: Vec<PathBuf>,
}

/// Runs a verb of the bench; gives the words to print.
pub fn run(verb: &BlindVerb) -> Result<String, BuildError> {
    match verb {
        BlindVerb::Make(args) => make::make(args),
        BlindVerb::Answer(args) => answer::answer(args),
        BlindVerb::Score(args) => score::score_answers(args),
    }
}
