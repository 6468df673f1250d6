//! What may be odd about an answer, as a value. Its sentence is for people; whoever decides reads the value.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

/// Share of samples off the plateau, or of another kind, from which on a row is odd [-]: then an end of its 90 % interval is of such a knee.
const MOST_ODD: f64 = 0.05;

/// What is odd about an answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Flag {
    /// One compartment bears at its rim, the other within; or one bears next to nothing, and the tibia lies half a plateau off the CT pose.
    Subluxed,
    /// The femur has left the plateau: what bears, bears at a rim.
    Dislocated,
    /// Turned further than knees turn.
    Rotated,
    /// Another equilibrium was found beside it.
    Several,
    /// Under the same loads the knee is elsewhere within a degree of flexion.
    Jumps,
    /// This ligament bears more than it can.
    Torn(String),
    /// The patella's forces do not balance.
    PatellaUnbalanced,
    /// The patella lies beside its groove, or in the notch.
    PatellaOffGroove,
    /// The patella rests elsewhere within a degree of flexion, or where it is sought from the other side.
    PatellaSnaps,
    /// The patellar tendon bears far more than the quadriceps pull: the retinacula hold the patella.
    PatellaHeld,
    /// Explicit dynamics that ended before they were at rest.
    Moving,
    /// Explicit dynamics that were stopped on the way: the answer is the quasi-static one.
    Stopped,
    /// The two solvers lie further apart than they may.
    Apart(Cause),
    /// So many samples of the posterior leave the plateau.
    SamplesLeave {
        /// How many.
        count: usize,
        /// Of how many.
        of: usize,
    },
    /// So many samples of the posterior have no equilibrium.
    SamplesLost {
        /// How many.
        count: usize,
        /// Of how many.
        of: usize,
    },
    /// So many samples of the posterior rest in another way than the most probable knee.
    SamplesDiffer {
        /// In which way.
        how: Difference,
        /// How many.
        count: usize,
        /// Of how many.
        of: usize,
    },
    /// No equilibrium was found.
    NoEquilibrium,
    /// The single most probable model lies outside its own interval in these columns.
    OutsideInterval(Vec<String>),
    /// Of the unloaded trial from which the readings count.
    Unloaded(Box<Flag>),
}

/// In which way samples rest that do not rest as the most probable knee does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Difference {
    /// They are subluxed, and it is not.
    Subluxed,
    /// It is subluxed, and they are not.
    NotSubluxed,
    /// They are turned further than knees turn, and it is not.
    Rotated,
    /// A gap parts their poses from its own: they rest in another equilibrium.
    Elsewhere,
    /// It has left the plateau, and they have not: mean and interval are of them, and its own value is not.
    OnPlateau,
}

impl Difference {
    /// In words, of one sample or of several.
    pub fn words(self, of_one: bool) -> &'static str {
        match (self, of_one) {
            (Difference::Subluxed, false) => "are subluxed",
            (Difference::Subluxed, true) => "is subluxed",
            (Difference::NotSubluxed, false) => "are not subluxed",
            (Difference::NotSubluxed, true) => "is not subluxed",
            (Difference::Rotated, false) => "are rotated beyond any knee",
            (Difference::Rotated, true) => "is rotated beyond any knee",
            (Difference::Elsewhere, false) => "rest elsewhere",
            (Difference::Elsewhere, true) => "rests elsewhere",
            (Difference::OnPlateau, false) => "stay on the plateau",
            (Difference::OnPlateau, true) => "stays on the plateau",
        }
    }
}

/// Why two solvers lie apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// Without friction both come to the same rest: friction holds them on different places of their ways.
    Friction,
    /// Without friction each stays near where it was: there is more than one equilibrium.
    Equilibria,
    /// In one of them the femur has left the plateau.
    OffPlateau,
    /// The explicit one is not at rest.
    Moving,
    /// Friction is no cause, and no rest without friction was found.
    Unknown,
}

impl Cause {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Cause::Friction => "friction keeps another place of the way",
            Cause::Equilibria => "several equilibria",
            Cause::OffPlateau => "the femur leaves the plateau",
            Cause::Moving => "the explicit one is not at rest",
            Cause::Unknown => "cause not found",
        }
    }
}

impl Flag {
    /// Whether it makes a row odd. A few samples do not, nor that one knee is no middle of all, nor what friction keeps of a way.
    pub fn is_odd(&self) -> bool {
        match self {
            Flag::OutsideInterval(_) | Flag::Apart(Cause::Friction) => false,
            Flag::SamplesLeave { count, of } | Flag::SamplesDiffer { count, of, .. } => {
                *count as f64 > MOST_ODD * *of as f64
            }
            _ => true,
        }
    }

    /// Whether it speaks of the single most probable model alone, as beside its interval.
    pub fn is_of_the_single_model(&self) -> bool {
        matches!(self, Flag::OutsideInterval(_))
    }
}

/// The sentence of a flag.
impl Display for Flag {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Flag::Subluxed => f.write_str("subluxed"),
            Flag::Dislocated => f.write_str("dislocated"),
            Flag::Rotated => f.write_str("rotated beyond any knee"),
            Flag::Several => f.write_str("several equilibria"),
            Flag::Jumps => f.write_str("jumps within a degree of flexion"),
            Flag::Torn(ligament) => write!(f, "{ligament} beyond its failure load"),
            Flag::PatellaUnbalanced => f.write_str("patella out of balance"),
            Flag::PatellaOffGroove => f.write_str("patella off the groove"),
            Flag::PatellaSnaps => f.write_str("patella snaps"),
            Flag::PatellaHeld => f.write_str("patellar tendon beyond the pull of the quadriceps"),
            Flag::Moving => f.write_str("still moving"),
            Flag::Stopped => f.write_str("explicit dynamics stopped early: the quasi-static answer"),
            Flag::Apart(cause) => write!(f, "solvers apart: {}", cause.words()),
            Flag::SamplesLeave { count: 1, of } => write!(f, "1 of {of} samples leaves the plateau"),
            Flag::SamplesLeave { count, of } => write!(f, "{count} of {of} samples leave the plateau"),
            Flag::SamplesLost { count: 1, of } => write!(f, "1 of {of} samples has no equilibrium"),
            Flag::SamplesLost { count, of } => write!(f, "{count} of {of} samples have no equilibrium"),
            Flag::SamplesDiffer { how, count, of } => write!(f, "{count} of {of} samples {}", how.words(*count == 1)),
            Flag::NoEquilibrium => f.write_str("no equilibrium"),
            Flag::OutsideInterval(columns) => write!(f, "outside its interval: {}", columns.join(" ")),
            Flag::Unloaded(flag) => write!(f, "unloaded: {flag}"),
        }
    }
}

/// The sentences of flags.
pub fn sentences<'a>(flags: impl IntoIterator<Item = &'a Flag>) -> Vec<String> {
    flags.into_iter().map(Flag::to_string).collect()
}

/// The sentences of rows' flags, each once; of rows that differ in a number of samples alone, the most.
pub fn each_once<'a>(flags: impl Iterator<Item = &'a Flag>) -> Vec<String> {
    let mut found: Vec<&Flag> = Vec::new();
    let mut counted: BTreeMap<Option<Difference>, Vec<(usize, &Flag)>> = BTreeMap::new();
    for flag in flags {
        match flag {
            Flag::SamplesLeave { count, .. } => counted.entry(None).or_default().push((*count, flag)),
            Flag::SamplesDiffer { how, count, .. } => counted.entry(Some(*how)).or_default().push((*count, flag)),
            _ if !found.contains(&flag) => found.push(flag),
            _ => {}
        }
    }
    let told = counted.values().filter_map(|alike| {
        let (_, most) = alike.iter().max_by_key(|(count, _)| *count)?;
        Some(match alike.iter().all(|(_, other)| other == most) {
            true => most.to_string(),
            false => format!("in one pose {most}, in others fewer"),
        })
    });
    sentences(found).into_iter().chain(told).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_differ_in_a_count_alone_are_one_flag() {
        let leave = |count| Flag::SamplesLeave { count, of: 48 };
        let flags = [leave(1), Flag::Rotated, leave(11), Flag::Rotated];
        assert_eq!(each_once(flags[..1].iter()), ["1 of 48 samples leaves the plateau"]);
        let told = each_once(flags.iter());
        assert_eq!(
            told,
            ["rotated beyond any knee", "in one pose 11 of 48 samples leave the plateau, in others fewer"]
        );
        let differ = |how, count| Flag::SamplesDiffer { how, count, of: 48 };
        let mixed = [
            differ(Difference::Elsewhere, 2),
            leave(1),
            differ(Difference::Subluxed, 3),
            differ(Difference::Subluxed, 3),
        ];
        assert_eq!(
            each_once(mixed.iter()),
            ["1 of 48 samples leaves the plateau", "3 of 48 samples are subluxed", "2 of 48 samples rest elsewhere"]
        );
        let here = |count| differ(Difference::OnPlateau, count).to_string();
        assert_eq!(
            [here(1), here(47)],
            ["1 of 48 samples stays on the plateau", "47 of 48 samples stay on the plateau"]
        );
    }

    #[test]
    fn a_row_is_odd_where_an_end_of_its_interval_is_of_a_knee_off_the_plateau() {
        let leave = |count| Flag::SamplesLeave { count, of: 40 };
        assert!(Flag::Dislocated.is_odd() && leave(3).is_odd() && !leave(2).is_odd());
        let differ = |count| Flag::SamplesDiffer { how: Difference::Subluxed, count, of: 40 };
        assert!(differ(3).is_odd() && !differ(2).is_odd());
        assert!(!Flag::OutsideInterval(vec!["ap_mm".into()]).is_odd());
        assert!(Flag::Apart(Cause::Equilibria).is_odd() && !Flag::Apart(Cause::Friction).is_odd());
    }
}
