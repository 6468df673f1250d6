//! Maps of a plan: what other femoral sites, and other tensions and flexions of fixing, do to the most probable knee.

use super::file::{GraftFile, PlanFile};
use super::knee::{Surfaces, cut, for_solver, placed, tests};
use super::sites::{Bone, bones};
use meshes::{Point, Vector};
use rayon::prelude::*;
use sim::coordinate::AP;
use sim::graft::{Graft, TENSIONS_N, with_grafts};
use sim::laxity::LaxityTrial;
use sim::model::{Model, compile};
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, solve_trials};
use std::fmt::Write;

/// Sites of the map lie so far from the planned one, forwards and upwards [mm]; ours: about a footprint to each side.
const MOVED_MM: [f64; 5] = [-6.0, -3.0, 0.0, 3.0, 6.0];
/// Tensions of the map, in parts of the planned one [-]; ours.
const TENSIONS: [f64; 4] = [0.25, 0.5, 1.0, 1.5];
/// Flexions of fixing of the map, beside the planned one [deg]; ours: what surgeons choose, and the ends of the tests.
const FIXED_AT_DEG: [f64; 4] = [0.0, 20.0, 45.0, 90.0];

/// One choice, and what it does.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    /// Along the map's two axes.
    pub(super) at: [f64; 2],
    /// The femoral site by the quadrant method: depth, height [%].
    pub(super) quadrant_percent: Option<[f64; 2]>,
    /// Most that the reconstructed knee lies from the intact one in AP, over the anterior drawers [mm]; and most that the graft bears unloaded [N].
    /// None where the graft cannot be fixed, or a test has no equilibrium.
    pub(super) found: Option<[f64; 2]>,
}

/// Choices along two axes.
#[derive(Clone, Debug)]
pub(super) struct Map {
    /// What is chosen.
    pub(super) of: &'static str,
    /// The graft.
    pub(super) graft: String,
    /// Names of its axes with their units, across and up.
    pub(super) axes: [&'static str; 2],
    /// The planned choice.
    pub(super) planned: [f64; 2],
    /// Row by row, each from the least across; the least up comes first.
    pub(super) cells: Vec<Cell>,
}

/// The knee of a plan, ready for other grafts.
struct Mapped<'a> {
    bones: [Bone<'a>; 2],
    spec: &'a ModelSpec,
    file: &'a PlanFile,
    asked: Asking,
}

/// All grafts of a choice, and the femoral site of the first by the quadrant method [%].
type PutIn = (Vec<Graft>, Option<[f64; 2]>);

/// What each choice is asked.
struct Asking {
    model: Model,
    cut: Vec<String>,
    trials: Vec<LaxityTrial>,
    /// AP of the intact knee where a trial is a drawer [mm].
    intact_mm: Vec<Option<f64>>,
}

impl Asking {
    /// What the knee does with these grafts, as [`Cell::found`].
    fn found(&self, grafts: &[Graft]) -> Option<[f64; 2]> {
        let first = self.model.bundles.len();
        let knee = with_grafts(&self.model, grafts, &self.cut, None).and_then(|knee| knee.without(&self.cut)).ok()?;
        let mut most = [0.0_f64; 2];
        let answers = solve_trials(&knee, &self.trials, &TrialOptions::default());
        for (answer, intact) in answers.into_iter().zip(&self.intact_mm) {
            let answer = answer.ok()?;
            match intact {
                Some(mm) => most[0] = most[0].max((answer.predicted()[AP] - mm).abs()),
                None => most[1] = most[1].max(answer.forces_n[first]),
            }
        }
        Some(most)
    }
}

impl<'a> Mapped<'a> {
    fn new(spec: &'a ModelSpec, surfaces: &'a Surfaces, file: &'a PlanFile) -> Result<Mapped<'a>, String> {
        let model = compile(spec, surfaces).map_err(|e| e.to_string())?;
        let asked = tests(&file.tests).into_iter().filter(|a| ["unloaded", "anterior drawer"].contains(&a.kind));
        let (kinds, trials): (Vec<&str>, Vec<LaxityTrial>) = asked.map(|a| (a.kind, a.trial)).unzip();
        let mut intact_mm = Vec::new();
        let answers = solve_trials(&model, &trials, &TrialOptions::default());
        for (answer, kind) in answers.into_iter().zip(kinds) {
            let ap = answer.map_err(|e| format!("no map: the intact knee: {e}"))?.predicted()[AP];
            intact_mm.push((kind != "unloaded").then_some(ap));
        }
        let asked = Asking { model, cut: cut(spec, file)?, trials, intact_mm };
        Ok(Mapped { bones: bones(spec, surfaces)?, spec, file, asked })
    }

    /// The grafts with `first` in place of the first one; none where it has no place.
    fn grafts(&self, first: &GraftFile) -> Option<PutIn> {
        let mut all = Vec::new();
        for graft in std::iter::once(first).chain(&self.file.graft[1..]) {
            let at = placed(self.spec, &self.bones, graft).ok()?;
            all.push(for_solver(graft, &at, self.file.tests.compression_n));
        }
        let ends = &all.first()?.ends;
        let sum: Vector = ends.iter().map(|e| e[0].coords).sum();
        let percent = self.bones[0].percent(&Point::from(sum / ends.len().max(1) as f64));
        Some((all, percent))
    }

    /// What `choice` makes of the first graft at each pair of values.
    fn cells(&self, across: &[f64], up: &[f64], choice: impl Fn(&mut GraftFile, [f64; 2])) -> Vec<Cell> {
        let all = up.iter().flat_map(|y| across.iter().map(move |x| [*x, *y]));
        let put_in = |at: [f64; 2]| {
            let mut first = self.file.graft[0].clone();
            choice(&mut first, at);
            (at, self.grafts(&first))
        };
        let all: Vec<_> = all.map(put_in).collect();
        let asked = &self.asked;
        let cell = |(at, put_in): ([f64; 2], Option<PutIn>)| Cell {
            at,
            quadrant_percent: put_in.as_ref().and_then(|(_, percent)| *percent),
            found: put_in.and_then(|(grafts, _)| asked.found(&grafts)),
        };
        all.into_par_iter().map(cell).collect()
    }
}

/// The maps of a plan's first graft: its femoral site; and, where it is fixed by a tension, that tension and its flexion. Other grafts stay.
///
/// # Errors
/// A plan without a graft, an intact knee without equilibrium: a sentence.
pub(super) fn maps(spec: &ModelSpec, surfaces: &Surfaces, file: &PlanFile) -> Result<Vec<Map>, String> {
    let Some(first) = file.graft.first() else {
        return Err("there is no graft to map; expected a [[graft]], or no --map".into());
    };
    let mapped = Mapped::new(spec, surfaces, file)?;
    let sites = mapped.cells(&MOVED_MM, &MOVED_MM, |graft, [forwards, upwards]| {
        graft.femur.move_mm[0] += forwards;
        graft.femur.move_mm[1] += upwards;
    });
    let (graft, axes) = (first.name.clone(), ["forwards of the planned site, mm", "upwards, mm"]);
    let mut out = vec![Map { of: "femoral site", graft: graft.clone(), axes, planned: [0.0; 2], cells: sites }];
    if let (Some(tension), None) = (first.tension_n, first.slack_length_mm) {
        let up = levels(TENSIONS.iter().map(|part| (part * tension).clamp(TENSIONS_N[0], TENSIONS_N[1])), tension);
        let across = levels(FIXED_AT_DEG.into_iter(), first.at_flexion_deg);
        let cells = mapped.cells(&across, &up, |graft, [flexion, tension]| {
            graft.at_flexion_deg = flexion;
            graft.tension_n = Some(tension);
        });
        let axes = ["fixed at flexion, deg", "tension, N"];
        out.push(Map { of: "tension", graft, axes, planned: [first.at_flexion_deg, tension], cells });
    }
    Ok(out)
}

/// Values in ascending order, each once, with the planned one among them.
fn levels(all: impl Iterator<Item = f64>, planned: f64) -> Vec<f64> {
    let mut out: Vec<f64> = all.chain([planned]).collect();
    out.sort_by(f64::total_cmp);
    out.dedup();
    out
}

/// map.csv: a row a choice. A map leaves the columns of the other empty.
pub(super) fn csv(maps: &[Map]) -> String {
    let mut text = String::from(
        "map,forwards_mm,upwards_mm,at_flexion_deg,tension_n,quadrant_depth_percent,quadrant_height_percent,drawer_off_mm,unloaded_force_n\n",
    );
    let cell = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:.4}"));
    for map in maps {
        for c in &map.cells {
            let at = if map.of == "tension" {
                format!(",,{},{}", c.at[0], c.at[1])
            } else {
                format!("{},{},,", c.at[0], c.at[1])
            };
            let [depth, height] = [0, 1].map(|k| cell(c.quadrant_percent.map(|p| p[k])));
            let [off, force] = [0, 1].map(|k| cell(c.found.map(|f| f[k])));
            let _ = writeln!(text, "{},{at},{depth},{height},{off},{force}", map.of);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_ascend_and_hold_the_planned_one_once() {
        assert_eq!(levels(FIXED_AT_DEG.into_iter(), 30.0), [0.0, 20.0, 30.0, 45.0, 90.0]);
        assert_eq!(levels(FIXED_AT_DEG.into_iter(), 45.0), FIXED_AT_DEG);
        assert_eq!(levels([500.0, 500.0, 80.0].into_iter(), 400.0), [80.0, 400.0, 500.0]);
    }

    #[test]
    fn a_row_of_the_file_has_a_cell_for_each_column() {
        let cell = |found| Cell { at: [3.0, -6.0], quadrant_percent: found, found };
        let map = |of| Map {
            of,
            graft: "g, \"h\"".into(),
            axes: ["x", "y"],
            planned: [0.0; 2],
            cells: vec![cell(None), cell(Some([1.5, 80.0]))],
        };
        let text = csv(&[map("femoral site"), map("tension")]);
        let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        assert!(rows.iter().all(|r| r.len() == rows[0].len()), "{text}");
        assert_eq!(rows[1][..5], ["femoral site", "3", "-6", "", ""]);
        assert_eq!(rows[4][..5], ["tension", "", "", "3", "-6"]);
        assert!(rows[1][5..].iter().all(|c| c.is_empty()) && rows[4][7..] == ["1.5000", "80.0000"], "{text}");
    }
}
