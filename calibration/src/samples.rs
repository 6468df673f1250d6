//! Samples of the posterior with all their unknowns, and what they say of loads that nobody measured.
//!
//! A sample is a knee: ligaments, sites, frames, contact. Its equilibria under other loads are sought from those of the most probable knee.

use crate::changed::{Changed, Fixed};
use crate::error::CalibrationError;
use crate::inferred::MODEL_DISCREPANCY;
use crate::kinds::Kinds;
use crate::mechanics::Mechanics;
use crate::plateau::Staying;
use crate::posterior::{ends, mean};
use crate::unknown::{UNLIKE_STREAM, Unknown, Unknowns};
use crate::unmeasured::force_sd;
use attachments::groups::GROUPS;
use inference::discrepancy::DrawnDiscrepancy;
use inference::knee::predict::Prediction;
use inference::knee::{Answers, Quantity, Trials, models_at};
use inference::parameter::{Parameter, Prior};
use inference::posterior::Forward;
use inference::random::{normals, stream};
use inference::trial::Trial;
use nalgebra::DVector;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::contact::ContactOptions;
use sim::coordinate::{Coordinate, FREE, Free, Load};
use sim::graft::{as_fixed, strains, with_grafts};
use sim::laxity::{Band, LaxityTrial, force_column};
use sim::mesh::MeshValue;
use sim::model::{Model, compile_with};
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

/// Version of the file of samples.
pub const SCHEMA: &str = "samples/1";
/// Seed of the loads that the model lacks, beside the calibration's own.
const DISCREPANCY_SEED: u64 = 0x6c61_636b;
/// The same of the noise of readings.
const READING_SEED: u64 = 0x7265_6164;

/// The file of samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Samples {
    /// [`SCHEMA`].
    pub schema: String,
    /// blake3 digest of the model.json beside it.
    pub model: String,
    /// The model that sites, frames and contact are counted from.
    pub counted_from: ModelSpec,
    /// The unknowns.
    #[serde(flatten)]
    pub of: Unknowns,
}

/// Bands of results, a row each, and how many samples had no answer in some row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bands {
    /// Bands by column, of the samples whose femur stays on the plateau ([`crate::plateau`]).
    pub rows: Vec<Vec<(String, Band)>>,
    /// Samples whose femur leaves the plateau, by row.
    pub leaving: Vec<usize>,
    /// Of the others, those that rest in another way than the most probable knee, by row.
    pub kinds: Vec<Kinds>,
    /// Samples asked.
    pub asked: usize,
    /// Largest number of samples without an equilibrium in a row.
    pub lost: usize,
}

/// What samples are asked.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// The trials.
    pub trials: &'a [LaxityTrial],
    /// Cut bundles or ligaments.
    pub without: &'a [String],
    /// In the frames of which data set, by its place; none: in those that all share.
    pub source: Option<usize>,
    /// How many samples at most.
    pub most: usize,
    /// AP from the CT pose beyond which the femur has left the plateau [mm]; none: as in a laxity trial.
    pub dislocation_ap_mm: Option<f64>,
    /// What the most probable model answers by the final mechanics (friction, its own mesh), by trial and column; the samples' answers are moved by what
    /// that differs from the search's. None: they stay as the search has them.
    pub values: Option<&'a [Vec<(String, f64)>]>,
}

/// What the samples answer to trials.
struct Drawn {
    /// Bundles.
    names: Vec<String>,
    /// Answers of the most probable knee.
    own: Vec<Option<Prediction>>,
    /// Answers of each sample, a trial each.
    found: Vec<Vec<Option<Prediction>>>,
    /// Poses of each sample under the loads that the model lacks, too, a trial each; `None` without equilibrium or off the plateau.
    pushed: Vec<Vec<Option<Free<f64>>>>,
}

/// What a sample answers to a trial, moved to the final mechanics: with friction, with all contact nodes, along the path of loading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// VV, IE [deg], ML, AP, SI [mm].
    pub pose: Free<f64>,
    /// The same under the loads that the model lacks, too; none without equilibrium or off the plateau.
    pub pushed: Option<Free<f64>>,
    /// Whether the femur has left the plateau.
    pub leaves_the_plateau: bool,
}

/// What samples answer, by sample and trial; `None` where a sample has no equilibrium.
pub type Each = Vec<Vec<Option<Reached>>>;

/// A change of a coordinate from one trial to another, as an apparatus reads it: no zero of its frame counts.
#[derive(Clone, Debug)]
pub struct Change {
    /// From which trial to which.
    pub trials: [LaxityTrial; 2],
    /// Of what.
    pub coordinate: Coordinate,
    /// Standard deviation of its reading [deg, mm].
    pub noise: f64,
}

/// Names and sums of the ligament groups that have several bundles, `group_ACL_n` and so on [N].
pub fn group_sums(bundles: &[String], forces_n: &[f64]) -> Vec<(String, f64)> {
    let sum = |members: &[&str]| {
        let own: Vec<f64> =
            bundles.iter().zip(forces_n).filter(|(b, _)| members.contains(&b.as_str())).map(|(_, f)| *f).collect();
        (own.len() > 1).then(|| own.iter().sum::<f64>())
    };
    GROUPS.iter().filter_map(|(name, members)| Some((format!("group_{name}_n"), sum(members)?))).collect()
}

impl Bands {
    /// Of trials that no sample was asked.
    fn nothing(trials: usize) -> Bands {
        Bands {
            rows: vec![vec![]; trials],
            leaving: vec![0; trials],
            kinds: vec![Kinds::default(); trials],
            ..Bands::default()
        }
    }
}

impl Samples {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.of.unknowns.first().map_or(0, |u| u.samples.len())
    }

    /// True where there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The samples `which` alone, in that order.
    pub fn only(&self, which: &[usize]) -> Samples {
        let mut out = self.clone();
        for u in &mut out.of.unknowns {
            u.samples = which.iter().filter_map(|s| u.samples.get(*s).copied()).collect();
        }
        out
    }

    /// The model that samples are asked of: merged contact nodes, no friction.
    ///
    /// # Errors
    /// A model that does not compile.
    pub fn searched(&self, meshes: &BTreeMap<String, MeshValue>) -> Result<Model, CalibrationError> {
        let coarse = ContactOptions { spacing_mm: self.of.search.contact_spacing_mm };
        Ok(compile_with(&self.counted_from, meshes, &coarse)?.with_friction(0.0)?)
    }

    /// Bands of what the knee does in trials.
    ///
    /// # Errors
    /// A model that does not compile; a most probable knee without equilibrium in any trial.
    pub fn bands(&self, meshes: &BTreeMap<String, MeshValue>, question: &Question) -> Result<Bands, CalibrationError> {
        if question.trials.is_empty() || self.is_empty() || question.most == 0 {
            return Ok(Bands::nothing(question.trials.len()));
        }
        self.bands_of(&self.searched(meshes)?, question)
    }

    /// [`Samples::bands`] by the model of [`Samples::searched`], for whoever asks more than once.
    ///
    /// # Errors
    /// A name of no bundle; a most probable knee without equilibrium in any trial.
    pub fn bands_of(&self, searched: &Model, question: &Question) -> Result<Bands, CalibrationError> {
        self.bands_changed(searched, question, (&Changed::default(), &Fixed::default()))
    }

    /// [`Samples::bands_of`] a knee that was changed, with its grafts as [`Samples::fixed`] has them, of as many samples or more.
    ///
    /// # Errors
    /// As [`Samples::bands_of`].
    pub fn bands_changed(
        &self,
        searched: &Model,
        question: &Question,
        change: (&Changed, &Fixed),
    ) -> Result<Bands, CalibrationError> {
        Ok(self.bands_and_each(searched, question, change)?.0)
    }

    /// [`Samples::bands_changed`], and what each sample answers: for whoever counts differences and shares of the samples.
    ///
    /// # Errors
    /// As [`Samples::bands_of`].
    pub fn bands_and_each(
        &self,
        searched: &Model,
        question: &Question,
        change: (&Changed, &Fixed),
    ) -> Result<(Bands, Each), CalibrationError> {
        let trials = question.trials;
        if trials.is_empty() || self.is_empty() || question.most == 0 {
            return Ok((Bands::nothing(trials.len()), vec![]));
        }
        let (each, place) = different(trials);
        let Drawn { names, own, found, pushed } =
            self.drawn(searched, &Question { trials: &each, ..*question }, change)?;
        let mechanics = |i: usize| match (question.values.and_then(|v| v.get(i)), &own[place[i]]) {
            (Some(last), Some(p)) => Mechanics::between(&told(&names, p), last),
            _ => Mechanics::default(),
        };
        let mechanics: Vec<Mechanics> = (0..trials.len()).map(mechanics).collect();
        let leaves = |f: &Vec<Option<Prediction>>, i: usize| f[place[i]].as_ref().map(|p| p.leaves_the_plateau);
        let staying: Vec<Staying> =
            (0..trials.len()).map(|i| Staying::of(found.iter().map(|f| leaves(f, i)))).collect();
        let row = |(i, staying): (usize, &Staying)| {
            let here: Vec<(usize, &Prediction)> =
                staying.here.iter().filter_map(|s| Some((*s, found[*s][place[i]].as_ref()?))).collect();
            let pushed: Vec<Option<Free<f64>>> = pushed.iter().map(|p| p[place[i]]).collect();
            self.row(&names, &here, &pushed, &mechanics[i])
        };
        let rows = staying.iter().enumerate().map(row).collect();
        let leaving = staying.iter().map(|s| s.leaving).collect();
        // where the most probable knee has no equilibrium no sample was asked: there none is lost
        let is_asked = |i: &usize| own[place[*i]].is_some();
        let lost = (0..trials.len()).filter(is_asked).map(|i| staying[i].lost).max().unwrap_or(0);
        let stays = |p: &&Prediction| !p.leaves_the_plateau;
        let kinds = place.iter().map(|i| {
            let here = found.iter().filter_map(|f| f[*i].as_ref()).filter(stays);
            Kinds::of(own[*i].as_ref().map(|p| &p.pose), here.map(|p| (p.pose, [p.is_subluxed, p.is_rotated])))
        });
        let kinds = kinds.collect();
        let of_sample = |(found, pushed): (&Vec<Option<Prediction>>, &Vec<Option<Free<f64>>>)| {
            place.iter().zip(&mechanics).map(|(i, m)| reached(found, pushed, *i, m)).collect()
        };
        let each: Each = found.iter().zip(&pushed).map(of_sample).collect();
        Ok((Bands { rows, leaving, kinds, asked: found.len(), lost }, each))
    }

    /// Bands of readings of changes, an entry each, of the samples that stay on the plateau at both ends; `None` where fewer than two do.
    ///
    /// # Errors
    /// As [`Samples::bands`].
    pub fn changes(
        &self,
        meshes: &BTreeMap<String, MeshValue>,
        changes: &[Change],
        most: usize,
    ) -> Result<Vec<Option<Band>>, CalibrationError> {
        if changes.is_empty() || self.is_empty() || most == 0 {
            return Ok(vec![None; changes.len()]);
        }
        let trials: Vec<LaxityTrial> = changes.iter().flat_map(|c| c.trials.clone()).collect();
        let question =
            Question { trials: &trials, without: &[], source: None, most, dislocation_ap_mm: None, values: None };
        let unchanged = (&Changed::default(), &Fixed::default());
        let Drawn { found, pushed, .. } = self.drawn(&self.searched(meshes)?, &question, unchanged)?;
        let band = |(k, change): (usize, &Change)| {
            let c = change.coordinate;
            let leaves = |all: &Vec<Option<Prediction>>| {
                ends_of(all, k).map(|(from, to)| from.leaves_the_plateau || to.leaves_the_plateau)
            };
            let by = |s: &usize| {
                let (s, (from, to)) = (*s, ends_of(&found[*s], k)?);
                let noise = normals(&mut stream(self.of.seed ^ READING_SEED, s as u64), changes.len())[k];
                let drawn = pushed[s][2 * k + 1]?[c] - pushed[s][2 * k]?[c];
                Some((to.pose[c] - from.pose[c], drawn + change.noise * noise))
            };
            let staying = Staying::of(found.iter().map(leaves));
            let (plain, drawn): (Vec<f64>, Vec<f64>) = staying.here.iter().filter_map(by).unzip();
            band_of(&plain, &drawn, self.of.interval)
        };
        Ok(changes.iter().enumerate().map(band).collect())
    }

    /// What each sample answers to trials, by sample and trial; `None` where it has no equilibrium. `searched` is the model of [`Samples::searched`].
    ///
    /// # Errors
    /// A name of no bundle; a most probable knee without equilibrium in any trial.
    pub fn answers(
        &self,
        searched: &Model,
        question: &Question,
    ) -> Result<Vec<Vec<Option<Prediction>>>, CalibrationError> {
        Ok(self.drawn(searched, question, (&Changed::default(), &Fixed::default()))?.found)
    }

    /// Fixes the grafts of a change in the most probable knee and in the first samples, at most `most`, while `cut` is cut. `searched` is the model of
    /// [`Samples::searched`].
    ///
    /// # Errors
    /// A graft that cannot be fixed in the most probable knee.
    pub fn fixed(
        &self,
        searched: &Model,
        (changed, cut): (&Changed, &[String]),
        most: usize,
    ) -> Result<Fixed, CalibrationError> {
        if changed.grafts.is_empty() {
            return Ok(Fixed::default());
        }
        let tuned = changed.tuned(searched)?;
        let unknowns = changed.unknowns(&self.of.unknowns, &searched.bundle_names());
        let parameters: Vec<Parameter<Quantity>> = unknowns.iter().map(as_it_stands).collect();
        let at = |of: &dyn Fn(&Unknown) -> f64, near: Option<&[f64]>| {
            let values: Vec<f64> = unknowns.iter().map(of).collect();
            let models = models_at(&tuned, &self.counted_from, &parameters, &values)?;
            let fixed = with_grafts(models.shared(), &changed.grafts, cut, near)?;
            Ok::<_, sim::SimError>(strains(&fixed, changed.grafts.len()))
        };
        let own = at(&|u| u.most_probable, None)?;
        let one = |s: usize| at(&|u: &Unknown| u.samples[s], Some(&own)).ok();
        let samples = (0..self.len().min(most)).into_par_iter().map(one).collect();
        Ok(Fixed { own, samples })
    }

    /// What the samples answer to trials, asked of the model of [`Samples::searched`] with what was changed.
    fn drawn(
        &self,
        searched: &Model,
        question: &Question,
        (changed, fixed): (&Changed, &Fixed),
    ) -> Result<Drawn, CalibrationError> {
        let with = |strains: &[f64]| {
            let model = changed.tuned(searched)?;
            as_fixed(&model, &changed.grafts, strains)?.without(question.without)
        };
        let model = with(&fixed.own)?;
        let unknowns = changed.unknowns(&self.of.unknowns, &searched.bundle_names());
        let parameters: Vec<Parameter<Quantity>> = unknowns.iter().map(as_it_stands).collect();
        let asked: Vec<Trial> = question.trials.iter().map(|t| imagined(t, question.source)).collect();
        let mut options = self.of.search.trials();
        options.dislocation_ap_mm = question.dislocation_ap_mm.unwrap_or(options.dislocation_ap_mm);
        let knee = Trials {
            model: &model,
            spec: &self.counted_from,
            parameters: &parameters,
            trials: &asked,
            beliefs: &[],
            options: &options,
            load_sd: Load::default(),
            discrepancy: MODEL_DISCREPANCY,
            on_fit: None,
        };
        let mode = DVector::from_iterator(parameters.len(), unknowns.iter().map(|u| u.most_probable));
        let (able, answers) = answered(&knee, &mode);
        if able.is_empty() {
            let why = "without friction, as samples are asked, the most probable knee has no equilibrium in any row";
            return Err(CalibrationError::Targets(why.into()));
        }
        let used = self.len().min(question.most);
        let near = (&mode, &answers);
        let lacking: Vec<DrawnDiscrepancy> =
            (0..used).map(|s| knee.discrepancy.drawn(self.of.seed ^ DISCREPANCY_SEED, s)).collect();
        let of_able: Vec<Trial> = able.iter().map(|i| asked[*i].clone()).collect();
        let knee = Trials { trials: &of_able, ..knee };
        let all = asked.len();
        let at = |s: usize| {
            let z = DVector::from_iterator(parameters.len(), unknowns.iter().map(|u| u.samples[s]));
            // a graft is fixed in each sample's own knee
            let own = fixed.samples.get(s).and_then(Option::as_deref).and_then(|strains| with(strains).ok());
            if own.is_none() && !changed.grafts.is_empty() {
                return (vec![None; all], vec![None; all]);
            }
            let knee = Trials { model: own.as_ref().unwrap_or(&model), ..knee };
            let of = |knee: &Trials| knee.predicted(&z, near).unwrap_or_else(|_| vec![None; of_able.len()]);
            let pushed: Vec<Trial> = of_able.iter().map(|t| under(t, &lacking[s].in_trial(&t.record))).collect();
            let stays = |p: &Prediction| (!p.leaves_the_plateau).then_some(p.pose);
            let poses: Vec<Option<Free<f64>>> =
                of(&Trials { trials: &pushed, ..knee }).iter().map(|p| p.as_ref().and_then(stays)).collect();
            (spread(of(&knee), &able, all), spread(poses, &able, all))
        };
        let (found, pushed) = (0..used).into_par_iter().map(at).unzip();
        let own = spread(knee.predicted(&mode, near)?, &able, all);
        Ok(Drawn { names: model.bundle_names(), own, found, pushed })
    }

    /// The bands of one trial, of the samples `found` in it by number; `pushed` has every sample's pose under the loads that the model lacks, too.
    fn row(
        &self,
        bundles: &[String],
        found: &[(usize, &Prediction)],
        pushed: &[Option<Free<f64>>],
        mechanics: &Mechanics,
    ) -> Vec<(String, Band)> {
        let mut columns: Vec<(String, Vec<f64>, Vec<f64>)> = Vec::new();
        for (s, p) in found {
            let p = mechanics.moved(bundles, p);
            let unlike = normals(&mut stream(self.of.seed, UNLIKE_STREAM + *s as u64), bundles.len());
            let off = p.forces_n.iter().zip(unlike.iter()).map(|(f, z)| (f + force_sd(*f) * z).max(0.0)).collect();
            let pose = pushed[*s].map(|pose| Free::from_fn(|c| mechanics.of(&c.column(), pose[c])));
            let drawn = Prediction { pose: pose.unwrap_or(p.pose), forces_n: off, ..p.clone() };
            for (k, ((name, value), (_, drawn))) in told(bundles, &p).into_iter().zip(told(bundles, &drawn)).enumerate()
            {
                // the poses come first; one that no load could push to says nothing of the ends
                let drawn = (k >= FREE.len() || pose.is_some()).then_some(drawn);
                match columns.iter_mut().find(|c| c.0 == name) {
                    Some(c) => {
                        c.1.push(value);
                        c.2.extend(drawn);
                    }
                    None => columns.push((name, vec![value], drawn.into_iter().collect())),
                }
            }
        }
        let band = |(name, values, drawn): (String, Vec<f64>, Vec<f64>)| {
            Some((name, band_of(&values, &drawn, self.of.interval)?))
        };
        columns.into_iter().filter_map(band).collect()
    }
}

/// Answers of the most probable knee at `mode`, and the places of the trials that have one.
fn answered(knee: &Trials, mode: &DVector<f64>) -> (Vec<usize>, Answers) {
    let all = knee.trials;
    if let Some(found) = knee.at(mode, None) {
        return ((0..all.len()).collect(), found.state);
    }
    let one = |i: usize| {
        let alone = Trials { trials: &all[i..=i], ..*knee };
        Some((i, alone.at(mode, None)?.state.pop()?))
    };
    (0..all.len()).into_par_iter().filter_map(one).unzip()
}

/// Answers at their places among all trials; `None` at the others.
fn spread<T: Clone>(answers: Vec<Option<T>>, places: &[usize], all: usize) -> Vec<Option<T>> {
    let mut out = vec![None; all];
    places.iter().zip(answers).for_each(|(i, answer)| out[*i] = answer);
    out
}

/// Trials without repeats, and the place among them of each: samples have no friction, so a load answers alike on its way there and back.
fn different(trials: &[LaxityTrial]) -> (Vec<LaxityTrial>, Vec<usize>) {
    let mut each: Vec<LaxityTrial> = Vec::new();
    let place = trials.iter().map(|t| {
        each.iter().position(|e| e.imposed() == t.imposed()).unwrap_or_else(|| {
            each.push(t.clone());
            each.len() - 1
        })
    });
    let place = place.collect();
    (each, place)
}

/// Mean of what samples answer, and the interval of what they answer under the loads that the model lacks, too; `share` of them lie in it. None of fewer
/// than two.
pub fn band_of(plain: &[f64], drawn: &[f64], share: f64) -> Option<Band> {
    let (lower, upper) = ends(drawn, share).filter(|_| plain.len() > 1)?;
    let mean = mean(plain);
    Some(Band { mean, lower: lower.min(mean), upper: upper.max(mean) })
}

/// A sample's answer to the trial at `place`, by the final mechanics.
fn reached(
    found: &[Option<Prediction>],
    pushed: &[Option<Free<f64>>],
    place: usize,
    mechanics: &Mechanics,
) -> Option<Reached> {
    let p = found[place].as_ref()?;
    let moved = |pose: &Free<f64>| Free::from_fn(|c| mechanics.of(&c.column(), pose[c]));
    Some(Reached {
        pose: moved(&p.pose),
        pushed: pushed[place].as_ref().map(moved),
        leaves_the_plateau: p.leaves_the_plateau,
    })
}

/// Both ends of a change, by its number.
fn ends_of(all: &[Option<Prediction>], change: usize) -> Option<(&Prediction, &Prediction)> {
    Some((all[2 * change].as_ref()?, all[2 * change + 1].as_ref()?))
}

/// Columns of a prediction.
fn told(bundles: &[String], p: &Prediction) -> Vec<(String, f64)> {
    let poses = FREE.into_iter().map(|c| (c.column(), p.pose[c]));
    let forces = bundles.iter().zip(&p.forces_n).map(|(b, f)| (force_column(b), *f));
    let groups = group_sums(bundles, &p.forces_n);
    poses.chain(forces).chain(groups).chain(p.outputs.iter().cloned()).collect()
}

/// A parameter whose number is its value: a sample has been drawn already.
fn as_it_stands(u: &Unknown) -> Parameter<Quantity> {
    let prior = Prior::Normal { mean: 0.0, sd: 1.0 };
    Parameter { name: u.name.clone(), quantity: u.quantity.clone(), prior }
}

/// A trial with loads beside its own.
fn under(asked: &Trial, by: &Load) -> Trial {
    let mut out = asked.clone();
    out.record.load = Load::from_fn(|c| asked.record.load[c] + by[c]);
    out
}

/// A trial all of whose coordinates are told.
fn imagined(t: &LaxityTrial, source: Option<usize>) -> Trial {
    Trial { source, reads: Free::all(true), ..Trial::alone(t.clone()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::laxity::Test;

    #[test]
    fn one_sample_has_no_interval_and_two_have_one_that_holds_their_mean() {
        assert!(band_of(&[1.0], &[0.5, 1.5], 0.9).is_none() && band_of(&[1.0, 2.0], &[], 0.9).is_none());
        let two = band_of(&[4.0, 6.0], &[1.0, 2.0], 0.9);
        assert!(two.is_some_and(|b| b.mean == 5.0 && b.lower <= 2.0 && b.upper == 5.0), "{two:?}");
        assert_eq!(spread(vec![Some(1), None, Some(3)], &[0, 2, 4], 5), [Some(1), None, None, None, Some(3)]);
    }

    #[test]
    fn a_load_on_its_way_back_is_asked_once_and_another_flexion_or_tension_by_itself() {
        let trial = |name: &str, fe: f64, ap: f64| {
            LaxityTrial::asked(name.into(), Test::Anterior, fe, Load::new(0.0, 0.0, 0.0, ap, 20.0))
        };
        let pulled = LaxityTrial { quadriceps_n: 60.0, ..trial("pulled", 30.0, 50.0) };
        let all = [
            trial("there", 30.0, 50.0),
            trial("further", 30.0, 100.0),
            trial("back", 30.0, 50.0),
            trial("bent", 60.0, 50.0),
            pulled,
        ];
        let (each, place) = different(&all);
        assert_eq!(place, [0, 1, 0, 2, 3]);
        for (t, k) in all.iter().zip(place) {
            assert_eq!((t.load, t.fe_deg, t.quadriceps_n), (each[k].load, each[k].fe_deg, each[k].quadriceps_n));
        }
    }
}
