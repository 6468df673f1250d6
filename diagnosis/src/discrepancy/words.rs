//! A field in words: which coordinate, at which flexion, at which load, where, and how large.

use super::Discrepancy;
use super::kinds::{Bone, Course, FIELD, LOADS, amplitude};
use super::suspects::{BESIDE, PULL, SHARE};
use crate::effect::candidate::Scope;
use crate::problem::Problem;
use sim::coordinate::{Coordinate, FE, IE, VV};

/// Names of the coordinates, in the order of [`sim::coordinate::Six`].
const NAMES: [&str; 6] =
    ["flexion", "varus-valgus", "internal-external rotation", "medial-lateral", "anterior-posterior", "axial"];

impl Discrepancy {
    /// In words.
    pub fn words(&self, problem: &Problem) -> String {
        let acts = |i: usize| problem.acts(self.scope, problem.trials[i].source);
        let place = match self.scope {
            Scope::Both => "in every data set".to_owned(),
            Scope::Only(s) => format!("in {} only", problem.sources[s]),
        };
        let c = self.largest(&acts);
        let kind = if self.is_force { "acts like a force on the tibia" } else { "acts like a misreading" };
        let start = format!("It {kind} in {} {place}", NAMES[c.index()]);
        match self.course {
            Course::Constant => {
                let (per, unit) = unit(self.is_force, c);
                let mean = self.mean_of(&acts, c) * per;
                format!("{start}: {mean:+.1} {unit}, the same at all flexions and loads.")
            }
            Course::Load => format!("{start}: {} along it.", self.per_load(problem, &acts, (c, c))),
            Course::Across(d) => format!("{start}: {} in {}.", self.per_load(problem, &acts, (c, d)), NAMES[d.index()]),
            Course::Scale => {
                let most = self.farthest(&acts, c);
                format!("{start}: in proportion to the motion, {most} where that is farthest.")
            }
            Course::Flexion | Course::Motion => self.by_flexion(problem, &acts, c, &start),
            _ => self.suspect((&start, &place), &self.farthest(&acts, c), NAMES[c.index()]),
        }
    }

    /// A suspect, `most` of which is felt in a coordinate, and how to check it at the bench.
    fn suspect(&self, (start, place): (&str, &str), most: &str, coordinate: &str) -> String {
        let (what, check) = match self.course {
            Course::Stop { sign, from } => {
                let way = if sign > 0.0 { "positive" } else { "negative" };
                let share = 100.0 * from;
                let stops = format!("{start}: up to {most} beyond {share:.0} % of the farthest motion the {way} way");
                (stops, "look for what the knee or the apparatus runs against")
            }
            Course::Pull(bone) => {
                let pulled = format!("It acts as if something of no name {} {place}", self.pull(bone));
                (pulled, "look for a strap, a cable or a tissue along such a line, and let it go")
            }
            Course::Near { bent: false } => (
                format!("{start}: {most} at extension, nothing beyond 45 deg"),
                "move the detached knee by hand through its last degrees of extension",
            ),
            Course::Near { bent: true } => (
                format!("{start}: {most} at deep flexion, nothing up to 45 deg"),
                "move the detached knee by hand through its last degrees of flexion",
            ),
            Course::Larger { apart } => {
                let what = if apart { "the scale of the CT were another" } else { "the bones were of another size" };
                let share = 100.0 * SHARE * self.amounts.first().copied().unwrap_or(0.0);
                let larger = format!("It acts as if {what} than the model has it: by {share:+.1} %");
                (larger, "measure on the specimen a length that the CT shows")
            }
            Course::Impinging(from) => (
                format!(
                    "It acts as if the cruciates pressed on each other where their lines are nearer than {from} mm"
                ),
                "watch them through the notch while the unloaded knee is turned",
            ),
            Course::Sway(bone) => {
                let bone = if bone == Bone::Femur { "femur" } else { "tibia" };
                let sways = format!("the {bone}'s tracker swayed with the size of the load {place}");
                let felt = format!("It acts as if {sways}: up to {most} in {coordinate}");
                (felt, "track the bone by a second tracker, fixed elsewhere on it, under load")
            }
            _ => return start.to_owned(),
        };
        format!("{what}. To check it, {check}.")
    }

    /// How a pull pulls, or pushes, and where its line passes.
    fn pull(&self, bone: Bone) -> String {
        let [size, medial, anterior] = [0, 1, 2].map(|k| self.amounts.get(k).copied().unwrap_or(0.0));
        let way = if size < 0.0 { "pushed" } else { "pulled" };
        let (what, whither) = if bone == Bone::Femur { ("tibia", "thigh") } else { ("femur", "shank") };
        let passes = [medial, anterior].map(|by| BESIDE * by / size);
        let force = PULL * size.abs();
        format!(
            "{way} the {what} along the {whither} with {force:.0} N, {:+.0} mm medially and {:+.0} mm anteriorly of its middle",
            passes[0], passes[1]
        )
    }

    /// The value of coordinate `c` that is farthest from nothing, with its unit.
    fn farthest(&self, acts: &dyn Fn(usize) -> bool, c: Coordinate) -> String {
        let (per, unit) = unit(self.is_force, c);
        let values = (0..self.mean.len()).filter(|&i| acts(i)).map(|i| self.mean[i][c]);
        format!("{:+.1} {unit}", values.fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a }) * per)
    }

    /// The coordinate in which it is largest, over the trials that `acts` wants.
    fn largest(&self, acts: &dyn Fn(usize) -> bool) -> Coordinate {
        let trials = || (0..self.mean.len()).filter(|&i| acts(i));
        let size =
            |c: Coordinate| trials().map(|i| (self.mean[i][c] / amplitude(self.is_force, c)).powi(2)).sum::<f64>();
        FIELD.into_iter().max_by(|&a, &b| size(a).total_cmp(&size(b))).unwrap_or(FE)
    }

    /// Mean of coordinate `c` over some trials.
    fn mean_of(&self, keep: &dyn Fn(usize) -> bool, c: Coordinate) -> f64 {
        let values: Vec<f64> = (0..self.mean.len()).filter(|&i| keep(i)).map(|i| self.mean[i][c]).collect();
        values.iter().sum::<f64>() / values.len().max(1) as f64
    }

    /// What coordinate `c` has for every unit of load along `d`.
    fn per_load(&self, problem: &Problem, acts: &dyn Fn(usize) -> bool, (c, d): (Coordinate, Coordinate)) -> String {
        let load = |i: usize| problem.trials[i].load()[d] / LOADS[d.index()];
        let most = (0..self.mean.len()).filter(|&i| acts(i)).max_by(|&a, &b| load(a).abs().total_cmp(&load(b).abs()));
        let by = most.filter(|&i| load(i) != 0.0).map_or(0.0, |i| self.mean[i][c] / load(i));
        let (per, own) = unit(self.is_force, c);
        let (size, loads) = unit(true, d);
        format!("{:+.1} {own} for every {:.0} {loads} of load", by * per, LOADS[d.index()] * size)
    }

    fn by_flexion(&self, problem: &Problem, acts: &dyn Fn(usize) -> bool, c: Coordinate, start: &str) -> String {
        let bent = |i: usize| problem.trials[i].record.nominal_flexion_deg > 45.0;
        let pushed = |i: usize| c != FE && problem.trials[i].load()[c].abs() > 1e-6;
        let mean = |keep: &dyn Fn(usize) -> bool| self.mean_of(&|i| acts(i) && keep(i), c);
        let (near, far) = (mean(&|i| !bent(i)), mean(&|i| bent(i)));
        let profile = if near * far < 0.0 {
            "changes sign with flexion"
        } else if near.abs() > 2.0 * far.abs() {
            "is largest near extension"
        } else if far.abs() > 2.0 * near.abs() {
            "is largest in flexion"
        } else {
            "is much the same at all flexions"
        };
        let (at_rest, loaded) = (mean(&|i| !pushed(i)), mean(&|i| pushed(i)));
        let load = if at_rest.abs() > 0.5 * loaded.abs() { "is there without load" } else { "comes with load" };
        let (per, unit) = unit(self.is_force, c);
        format!(
            "{start}: {:+.1} {unit} at 0 to 45 deg, {:+.1} {unit} beyond; it {profile} and {load}.",
            near * per,
            far * per
        )
    }
}

/// Factor and unit in which coordinate `c` is told.
fn unit(is_force: bool, c: Coordinate) -> (f64, &'static str) {
    match (is_force, c) {
        (true, VV | IE) => (1e-3, "N m"),
        (true, _) => (1.0, "N"),
        (false, FE | VV | IE) => (1.0, "deg"),
        (false, _) => (1.0, "mm"),
    }
}
