//! A knee with its grafts: put in, fixed, tested intact, deficient and reconstructed.

use super::file::{GraftFile, PlanFile, TestsFile};
use super::sites::{Bone, bones};
use meshes::Point;
use sim::SimError;
use sim::contact::{ContactOptions, Nearby};
use sim::coordinate::{AP, FE, FREE, Free, IE, Load, Six, VV};
use sim::flags::Flag;
use sim::graft::{Drawn, FIXED_AT_DEG, Graft, TENSION_N, bundle_name, with_grafts};
use sim::laxity::{LaxityTrial, Test};
use sim::ligament::mean_length;
use sim::mesh::MeshValue;
use sim::model::{Model, compile_with};
use sim::quasistatic::{Goal, State, increment_near};
use sim::spec::{BundleSpec, ModelSpec};
use sim::trials::{Answer, TrialOptions, chain_flexion, flags, pose_spec, solve, solve_trials};
use std::collections::BTreeMap;

/// The states of a plan, in their order.
pub(super) const STATES: [&str; 3] = ["intact", "deficient", "reconstructed"];

/// Where a graft runs and what it is, in one knee.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    /// Femoral and tibial ends, CT frame.
    pub(super) ends: Vec<[Point; 2]>,
    /// [N/mm].
    pub(super) stiffness: f64,
    /// The bundle whose place it takes fibre by fibre, where it does.
    whole: Option<String>,
}

/// A test: its name, flexion, loads.
#[derive(Clone, Debug)]
pub(super) struct Asked {
    pub(super) trial: LaxityTrial,
    /// What kind, for tables: neutral, anterior, pivot shift.
    pub(super) kind: &'static str,
    /// The unloaded test of the same flexion.
    pub(super) rest: Option<usize>,
}

/// A knee ready to be asked.
pub(super) struct Knee {
    /// In the order of [`STATES`].
    pub(super) models: [Model; 3],
    /// Slack length of each graft as it was fixed [mm].
    pub(super) slack_mm: Vec<f64>,
    /// Numbers of the grafts' bundles.
    grafts: Vec<usize>,
}

/// What one test gave: columns in the order of [`columns`], and flags.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) gs: Six,
    pub(super) values: Vec<f64>,
    pub(super) flags: Vec<Flag>,
}

impl Found {
    /// Whether the femur has left the plateau.
    pub(super) fn leaves_the_plateau(&self) -> bool {
        self.flags.contains(&Flag::Dislocated)
    }
}

/// The answers of a knee: by state and test.
pub(super) type Answers = [Vec<Option<Found>>; 3];

/// Names of the columns: pose, contact, grafts.
pub(super) fn columns(file: &PlanFile) -> Vec<String> {
    let pose = FREE.map(|c| c.column()).into_iter();
    let contact = ["contact_medial_force_n", "contact_lateral_force_n"].map(str::to_owned);
    pose.chain(contact).chain(file.graft.iter().map(|g| format!("graft_{}_n", g.name))).collect()
}

/// The tests of a plan.
pub(super) fn tests(t: &TestsFile) -> Vec<Asked> {
    let mut flexions: Vec<f64> = t.flexions_deg.iter().chain(&t.passive_deg).copied().chain([t.pivot[0]]).collect();
    flexions.sort_by(f64::total_cmp);
    flexions.dedup();
    let asked = |kind: &'static str, test: Test, fe: f64, [vv, ie, ap]: [f64; 3], rest: Option<usize>| {
        let load = Load::new(vv, ie, 0.0, ap, t.compression_n);
        Asked { trial: LaxityTrial::asked(format!("{kind}, {fe} deg"), test, fe, load), kind, rest }
    };
    let mut out: Vec<Asked> = flexions.iter().map(|fe| asked("unloaded", Test::Neutral, *fe, [0.0; 3], None)).collect();
    let rest = |fe: f64| flexions.iter().position(|f| *f == fe);
    let (n, r, v) = (t.drawer_n, t.rotation_nm, t.varus_valgus_nm);
    for (kind, test, load) in [
        ("anterior drawer", Test::Anterior, [0.0, 0.0, n]),
        ("posterior drawer", Test::Posterior, [0.0, 0.0, -n]),
        ("internal rotation", Test::Internal, [0.0, -r, 0.0]),
        ("external rotation", Test::External, [0.0, r, 0.0]),
        ("varus", Test::Varus, [-v, 0.0, 0.0]),
        ("valgus", Test::Valgus, [v, 0.0, 0.0]),
    ] {
        out.extend(t.flexions_deg.iter().map(|fe| asked(kind, test, *fe, load, rest(*fe))));
    }
    let [fe, valgus, internal] = t.pivot;
    out.push(asked("pivot shift", Test::Valgus, fe, [valgus, -internal, 0.0], rest(fe)));
    out
}

/// The coordinate that a kind of test is about.
pub(super) fn main_coordinate(kind: &str) -> sim::coordinate::Coordinate {
    match kind {
        "internal rotation" | "external rotation" => IE,
        "varus" | "valgus" => VV,
        _ => AP,
    }
}

/// The bundles of a model that a name of a ligament or bundle means.
fn meant<'a>(spec: &'a ModelSpec, name: &str) -> Result<Vec<&'a BundleSpec>, String> {
    let own = |b: &&BundleSpec| b.name == name || b.name.strip_prefix(name).is_some_and(|r| r.starts_with('_'));
    let found: Vec<&BundleSpec> = spec.bundles.iter().filter(own).collect();
    if found.is_empty() {
        let mut known: Vec<String> = spec.bundles.iter().map(|b| b.name.clone()).collect();
        let have = known.join(", ");
        known.extend(spec.bundles.iter().filter_map(|b| Some(b.name.split_once('_')?.0.to_owned())));
        let near = sim::names::did_you_mean(name, &known);
        return Err(format!("no ligament or bundle is named {name:?}{near}; the model has {have}"));
    }
    Ok(found)
}

/// Bundles that a plan cuts.
pub(super) fn cut(spec: &ModelSpec, file: &PlanFile) -> Result<Vec<String>, String> {
    let mut out = Vec::new();
    for name in &file.cut {
        let own = meant(spec, name).map_err(|e| format!("cut: {e}"))?;
        out.extend(own.iter().map(|b| b.name.clone()).filter(|n| !out.contains(n)).collect::<Vec<_>>());
    }
    Ok(out)
}

/// Ends of the fibres of bundles, femoral or tibial.
fn ends<'a>(spec: &'a ModelSpec, bundles: &'a [&BundleSpec], end: usize) -> impl Iterator<Item = Point> + 'a {
    let own = spec.fibres.iter().filter(move |f| bundles.iter().any(|b| b.name == f.bundle));
    own.map(move |f| [f.femur, f.tibia][end])
}

/// Places a graft in a knee.
pub(super) fn placed(spec: &ModelSpec, bones: &[Bone; 2], graft: &GraftFile) -> Result<Placed, String> {
    let fault = |e: String| format!("graft {:?}: {e}", graft.name);
    let sites = [&graft.femur, &graft.tibia];
    let whole = match (&sites[0].native, &sites[1].native) {
        (Some(a), Some(b)) if a == b => match meant(spec, a).map_err(fault)?[..] {
            [one] => Some(one),
            _ => None,
        },
        _ => None,
    };
    let lines = if let Some(one) = whole {
        let all = [one];
        let moved =
            |end: usize| ends(spec, &all, end).map(|p| bones[end].moved(p, sites[end].move_mm)).collect::<Vec<_>>();
        moved(0).into_iter().zip(moved(1)).map(|(a, b)| [a, b]).collect()
    } else {
        let at = |end: usize| {
            bones[end].place(sites[end], |name| {
                let own = meant(spec, name)?;
                let all: Vec<Point> = ends(spec, &own, end).collect();
                Ok(Point::from(all.iter().map(|p| p.coords).sum::<meshes::Vector>() / all.len() as f64))
            })
        };
        vec![[at(0).map_err(fault)?, at(1).map_err(fault)?]]
    };
    let length = mean_length(&lines);
    let stiffness = match (graft.stiffness_n_per_mm, graft.cross_section_mm2, graft.modulus_mpa) {
        (Some(k), ..) => k,
        (_, Some(area), Some(modulus)) => area * modulus / graft.free_length_mm.unwrap_or(length),
        _ => return Err(fault("it has no stiffness".into())),
    };
    Ok(Placed { ends: lines, stiffness, whole: whole.map(|b| b.name.clone()) })
}

/// A graft for the solver.
pub(super) fn for_solver(graft: &GraftFile, at: &Placed, compression_n: f64) -> Graft {
    Graft {
        name: graft.name.clone(),
        ends: at.ends.clone(),
        stiffness_n_per_mm: at.stiffness,
        toe_strain: graft.toe_strain,
        like: at.whole.clone(),
        drawn: match (graft.slack_length_mm, graft.tension_n) {
            (Some(slack_length_mm), _) => Drawn::Slack { slack_length_mm },
            // a file without either is refused before
            (None, tension) => {
                let tension_n = tension.unwrap_or(TENSION_N);
                Drawn::Tension { tension_n, at_flexion_deg: graft.at_flexion_deg, compression_n }
            }
        },
    }
}

/// What a plan does to a knee, for a page that goes on from there: unloaded, at the flexion where the first graft is fixed.
pub(super) fn begun(
    spec: &ModelSpec,
    surfaces: &BTreeMap<String, MeshValue>,
    file: &PlanFile,
) -> Result<live::Asked, String> {
    let bones = bones(spec, surfaces)?;
    let one = |g| placed(spec, &bones, g).map(|p| for_solver(g, &p, file.tests.compression_n));
    Ok(live::Asked {
        flexion_deg: file.graft.first().map_or(FIXED_AT_DEG, |g| g.at_flexion_deg),
        load: Load::compression(file.tests.compression_n),
        cut: cut(spec, file)?,
        grafts: file.graft.iter().map(one).collect::<Result<_, _>>()?,
        ..live::Asked::default()
    })
}

impl Knee {
    /// Cuts, puts in and fixes. `friction` and `contact` are those of the whole plan's knee.
    ///
    /// # Errors
    /// A site that is none, a tension that is out of reach, a knee without equilibrium: a sentence.
    pub(super) fn new(
        spec: &ModelSpec,
        surfaces: &BTreeMap<String, MeshValue>,
        file: &PlanFile,
        (contact, friction): (&ContactOptions, Option<f64>),
    ) -> Result<(Knee, Vec<Placed>), String> {
        let told = |e: SimError| e.to_string();
        let bones = bones(spec, surfaces)?;
        let placed = file.graft.iter().map(|g| placed(spec, &bones, g)).collect::<Result<Vec<_>, _>>()?;
        let mut model = compile_with(spec, surfaces, contact).map_err(told)?;
        if let Some(friction) = friction {
            model = model.with_friction(friction).map_err(told)?;
        }
        let names: Vec<String> = (0..file.graft.len()).map(bundle_name).collect();
        let cut = cut(spec, file)?;
        let grafts: Vec<Graft> =
            file.graft.iter().zip(&placed).map(|(g, p)| for_solver(g, p, file.tests.compression_n)).collect();
        let model = with_grafts(&model, &grafts, &cut, None).map_err(told)?;
        let [intact, deficient, reconstructed] =
            [names.clone(), [names.clone(), cut.clone()].concat(), cut].map(|out| model.without(&out).map_err(told));
        let first = spec.bundles.len();
        let knee = Knee {
            models: [intact?, deficient?, reconstructed?],
            slack_mm: model.bundles[first..].iter().map(|b| b.slack_length()).collect(),
            grafts: (first..first + names.len()).collect(),
        };
        Ok((knee, placed))
    }

    /// Asks every state every test, along the paths of loading.
    pub(super) fn answers(&self, asked: &[Asked]) -> Answers {
        let trials: Vec<LaxityTrial> = asked.iter().map(|a| a.trial.clone()).collect();
        [0, 1, 2].map(|state| {
            let model = &self.models[state];
            let answers = solve_trials(model, &trials, &TrialOptions::default());
            answers.into_iter().map(|a| a.ok().map(|a| self.found(model, &a))).collect()
        })
    }

    /// The same from the answers of a knee that is nearly this one; where there is no equilibrium close by, along the path.
    pub(super) fn answers_near(&self, asked: &[Asked], near: &Answers) -> Answers {
        let options = TrialOptions::default();
        [0, 1, 2].map(|state| {
            let model = &self.models[state];
            let of = |(a, from): (&Asked, &Option<Found>)| {
                let close = from.as_ref().and_then(|f| close_by(model, &a.trial, &f.gs, &options).ok());
                let answer = close.or_else(|| solve(model, a.trial.fe_deg, &a.trial.load, &options).ok());
                answer.map(|answer| self.found(model, &answer))
            };
            asked.iter().zip(&near[state]).map(of).collect()
        })
    }

    /// The columns of an answer.
    fn found(&self, model: &Model, answer: &Answer) -> Found {
        let mut values: Vec<f64> = answer.pose.free().iter().copied().collect();
        let contact = model.contact.compartments(&answer.evaluation.pose, model.joint.tibia());
        values.extend(contact.iter().map(|c| c.force.norm()));
        values.extend(self.grafts.iter().map(|g| answer.forces_n[*g]));
        Found { gs: model.joint.grood_suntay(&answer.state.q), values, flags: answer.flags.clone() }
    }
}

/// An equilibrium sought from a pose close by.
fn close_by(model: &Model, trial: &LaxityTrial, gs: &Six, options: &TrialOptions) -> Result<Answer, SimError> {
    let flexion = chain_flexion(model, trial.fe_deg, options)?;
    let mut from = State::at(model.joint.coordinates(gs)?);
    from.q[FE] = flexion;
    let goal = Goal { flexion, load: trial.load.generalised(), flow: None };
    let solved = increment_near(model, &from, &goal, &options.solver, true, &mut Nearby::default())?;
    let gs = model.joint.grood_suntay(&solved.state.q);
    Ok(Answer {
        pose: pose_spec(&gs),
        forces_n: model.bundle_forces(&solved.evaluation.fibres),
        outputs: vec![],
        flags: flags(model, &gs, &solved.evaluation, options),
        state: solved.state,
        evaluation: solved.evaluation,
        evaluations: solved.evaluations,
    })
}

/// Poses of the free coordinates, as five columns.
pub(super) fn pose_of(found: &Found) -> Free<f64> {
    Free::from_fn(|c| found.values[c.free_index()])
}
