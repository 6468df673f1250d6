//! graft.toml: what a surgeon cuts, what is put in, and how the knee is tested.

use super::spelled;
use crate::error::{BuildError, Place};
use crate::store;
use attachments::bundle::LIGAMENTS;
use notices::{Kind, Notice};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sim::graft::{COMPRESSION_N, FIXED_AT_DEG, STIFFNESSES_N_PER_MM, TENSIONS_N, TOE_STRAIN};
use sim::names::is_of;
use std::path::Path;
use toml::de::DeTable;

/// An example, as `build-model plan --example` prints it.
pub const EXAMPLE: &str = include_str!("example.toml");

/// Flexions that may be asked [deg].
const FLEXIONS_DEG: [f64; 2] = [-10.0, 140.0];
/// A point may have such coordinates in the frame of the CT [mm]; ours: a scanner's table is shorter.
const POINTS_MM: [f64; 2] = [-5000.0, 5000.0];
/// A place may be moved so far along each axis [mm]; ours: no footprint lies further from another of its bone's notch or plateau, and what is moved
/// further is laid back on another part of the bone.
const MOVES_MM: [f64; 2] = [-30.0, 30.0];

/// A site's percentages lie within these [%]; ours: a tenth beyond the wall of the notch, or the plateau, is on their edge yet.
pub(super) const PERCENTS: [f64; 2] = [-10.0, 110.0];

/// What graft.toml says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanFile {
    /// What the plan is called.
    #[serde(default)]
    pub name: String,
    /// Ligaments or bundles that are torn or cut ("ACL" is both its bundles).
    #[serde(default)]
    pub cut: Vec<String>,
    /// What is put in, in the order of fixing.
    #[serde(default)]
    pub graft: Vec<GraftFile>,
    /// How the knee is tested.
    #[serde(default)]
    pub tests: TestsFile,
}

/// A graft, or one bundle of one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GraftFile {
    /// Its name.
    pub name: String,
    /// Where it leaves the femur.
    pub femur: SiteFile,
    /// Where it leaves the tibia.
    pub tibia: SiteFile,
    /// Its stiffness [N/mm]; or give `cross_section_mm2` and `modulus_mpa`.
    pub stiffness_n_per_mm: Option<f64>,
    /// Its cross-section [mm2].
    pub cross_section_mm2: Option<f64>,
    /// Its modulus [MPa].
    pub modulus_mpa: Option<f64>,
    /// The length that stretches, where it is more than that between the bones: what lies in tunnels up to the fixation [mm].
    pub free_length_mm: Option<f64>,
    /// Toe strain [-]; as of the ligaments.
    #[serde(default = "toe_strain")]
    pub toe_strain: f64,
    /// Its tension when it is fixed [N]; or give `slack_length_mm`.
    pub tension_n: Option<f64>,
    /// The flexion at which it is fixed [deg].
    #[serde(default = "fixed_at_deg")]
    pub at_flexion_deg: f64,
    /// Its slack length between the bones [mm], in place of a tension.
    pub slack_length_mm: Option<f64>,
}

/// A place on a bone: one of the first four keys.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SiteFile {
    /// Footprint of a ligament or bundle of the knee.
    pub native: Option<String>,
    /// A point on the bone's surface in the frame of the CT [mm].
    pub point_mm: Option<[f64; 3]>,
    /// Quadrant method on the lateral condyle's inner wall [%]: depth from the back along the notch's roof, height from the roof downwards [bernard1997].
    pub quadrant_percent: Option<[f64; 2]>,
    /// On the plateau [%]: from its front edge backwards (an ACL: 41 [cho2017]), from its medial edge to the lateral.
    pub plateau_percent: Option<[f64; 2]>,
    /// Then moved so far forwards, upwards and lateral [mm], and put back on the bone.
    pub move_mm: [f64; 3],
}

/// How the knee is tested.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TestsFile {
    /// Flexions of the drawers and turns [deg].
    pub flexions_deg: Vec<f64>,
    /// Flexions without load, for the graft's force [deg].
    pub passive_deg: Vec<f64>,
    /// Drawer, forwards and backwards [N]; as KT-1000 at manual maximum and robots have it.
    pub drawer_n: f64,
    /// Internal and external moment [N m].
    pub rotation_nm: f64,
    /// Varus and valgus moment [N m].
    pub varus_valgus_nm: f64,
    /// Pivot shift: flexion [deg], valgus and internal moment [N m]; [andreassen2025, section 2.6.4].
    pub pivot: [f64; 3],
    /// Compression throughout [N]; as in the published decks.
    pub compression_n: f64,
    /// A knee is restored where it lies within this of the intact one, AP [mm].
    pub restored_mm: f64,
    /// The same of IE and VV [deg].
    pub restored_deg: f64,
}

impl Default for TestsFile {
    fn default() -> Self {
        TestsFile {
            flexions_deg: vec![0.0, 30.0, 60.0, 90.0],
            passive_deg: vec![0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0],
            drawer_n: 134.0,
            rotation_nm: 5.0,
            varus_valgus_nm: 10.0,
            pivot: [30.0, 8.0, 4.0],
            compression_n: COMPRESSION_N,
            restored_mm: 2.0,
            restored_deg: 3.0,
        }
    }
}

fn toe_strain() -> f64 {
    TOE_STRAIN
}

fn fixed_at_deg() -> f64 {
    FIXED_AT_DEG
}

/// Reads a plan.
///
/// # Errors
/// A file that cannot be read, a key that is unknown, absent or out of range: file, key, what was expected.
pub fn read(path: &Path) -> Result<PlanFile, BuildError> {
    let (text, name) = (store::read_text(path)?, path.display().to_string());
    parsed(&text).map_err(|(row, what)| {
        let line = row.map_or(String::new(), |n| format!(" line {n}"));
        BuildError::At { place: Place { row, ..Place::of(path) }, told: format!("{name}{line}: {what}") }
    })
}

/// A plan from its text; else the line at fault, where one is known, and what is wrong.
pub fn parsed(text: &str) -> Result<PlanFile, (Option<usize>, String)> {
    let unread = |e: toml::de::Error| {
        let row = e.span().map(|s| spelled::line(text, s.start));
        (row, format!("{}; expected what `build-model plan --example` prints", e.message().trim()))
    };
    let plan = DeTable::parse(text).map_err(unread)?.into_inner();
    spelled::refuse(text, &plan)?;
    let file: PlanFile = toml::from_str(text).map_err(unread)?;
    file.check().map_err(|wrong| (spelled::line_of(text, &plan, &wrong.key), wrong.told))?;
    Ok(file)
}

/// What means nothing in a plan.
#[derive(Debug)]
pub(super) struct Wrong {
    /// Where: `graft.0.femur`.
    key: String,
    /// In a sentence.
    pub(super) told: String,
}

impl Wrong {
    fn at(key: impl Into<String>, told: impl Into<String>) -> Wrong {
        Wrong { key: key.into(), told: told.into() }
    }

    /// The same in the plan's `place`, told with `whose` before it.
    fn within(self, place: &str, whose: &str) -> Wrong {
        let key = if self.key.is_empty() { place.to_owned() } else { format!("{place}.{}", self.key) };
        Wrong { key, told: format!("{whose}{}", self.told) }
    }
}

/// Refuses a number outside a range; `name` is what it is called, `key` where it stands.
fn within(key: &str, name: &str, x: f64, [least, most]: [f64; 2]) -> Result<(), Wrong> {
    let ok = x >= least && x <= most;
    if ok { Ok(()) } else { Err(Wrong::at(key, format!("{name} is {x}, expected {least} to {most}"))) }
}

impl PlanFile {
    /// Refuses what means nothing.
    pub(super) fn check(&self) -> Result<(), Wrong> {
        self.tests.check().map_err(|wrong| wrong.within("tests", "tests."))?;
        for (k, g) in self.graft.iter().enumerate() {
            let place = format!("graft.{k}");
            if g.name.trim().is_empty() || self.graft[..k].iter().any(|o| o.name == g.name) {
                let told = format!("graft[{k}].name is {:?}, expected a name that no other graft has", g.name);
                return Err(Wrong::at(format!("{place}.name"), told));
            }
            g.check().map_err(|wrong| wrong.within(&place, &format!("graft {:?}: ", g.name)))?;
        }
        if self.cut.is_empty() && self.graft.is_empty() {
            let told =
                "nothing is planned: it cuts nothing and puts nothing in; expected cut = [\"ACL\"], or a [[graft]]";
            return Err(Wrong::at("cut", told));
        }
        Ok(())
    }

    /// What is unusual about a plan that means something.
    pub(super) fn odd(&self) -> Vec<Notice> {
        let is_uncut = self.cut.is_empty() && !self.graft.is_empty();
        let text = "nothing is cut: what is put in stands beside all of the knee's own ligaments; expected cut = [\"ACL\"], or what it replaces";
        let uncut = is_uncut.then(|| Kind::NothingCut.notice(text));
        let lists = [("flexions_deg", &self.tests.flexions_deg), ("passive_deg", &self.tests.passive_deg)];
        let radians = lists.into_iter().filter(|(_, list)| are_like_radians(list)).map(|(key, list)| {
            Kind::GivenFar.notice(format!("tests.{key} is {list:?}: radians? They are read as degrees"))
        });
        uncut.into_iter().chain(radians).chain(self.odd_numbers()).chain(self.beside_their_own()).collect()
    }

    /// Numbers that look like those of another unit, and tests without load, which any knee passes.
    fn odd_numbers(&self) -> Vec<Notice> {
        let fixed = self.graft.iter().map(|g| (format!("graft {:?}: at_flexion_deg", g.name), g.at_flexion_deg));
        let flexions = fixed.chain([("tests.pivot, flexion".to_owned(), self.tests.pivot[0])]);
        let radians = flexions.filter(|(_, x)| are_like_radians(&[*x]));
        let radians = radians.map(|(key, x)| format!("{key} is {x}: radians? It is read as degrees"));
        let t = &self.tests;
        let pivot = t.pivot[1].max(t.pivot[2]);
        let loads = [
            ("tests.drawer_n", t.drawer_n, LEAST_DRAWER_N, "N", "drawers"),
            ("tests.rotation_nm", t.rotation_nm, LEAST_MOMENT_NM, "N m", "rotations"),
            ("tests.varus_valgus_nm", t.varus_valgus_nm, LEAST_MOMENT_NM, "N m", "varus and valgus"),
            ("tests.pivot", pivot, LEAST_MOMENT_NM, "N m", "the pivot shift"),
        ];
        let weak = loads.into_iter().filter(|(_, x, least, ..)| x < least).map(|(key, x, least, unit, tests)| {
            format!("{key} is {x} {unit}: {tests} then hardly load a knee, so they tell nothing of it; expected {least} {unit} or more")
        });
        radians.chain(weak).map(|text| Kind::GivenFar.notice(text)).collect()
    }

    /// Grafts in the place of a ligament that is not cut, where another is.
    fn beside_their_own(&self) -> Vec<Notice> {
        let is_cut = |name: &str| self.cut.iter().any(|cut| is_of(name, cut) || is_of(cut, name));
        let beside = self.graft.iter().filter(|_| !self.cut.is_empty());
        let beside = beside.filter_map(|g| Some((g, g.replaces()?))).filter(|(_, own)| !is_cut(own));
        let text = |(g, own): (&GraftFile, &str)| {
            format!(
                "graft {:?} runs in the place of {own}, which is not cut: it stands beside it; expected {own} in cut",
                g.name
            )
        };
        beside.map(|one| Kind::NothingCut.notice(text(one))).collect()
    }
}

/// A drawer below this is in another unit, or none [N]; ours: an arthrometer begins with 67.
const LEAST_DRAWER_N: f64 = 30.0;
/// The same of a moment [N m]; ours: a hand turns a foot by 2.
const LEAST_MOMENT_NM: f64 = 1.0;

/// Whether flexions look like radians: none beyond a bent knee's, and one of no whole number.
fn are_like_radians(list: &[f64]) -> bool {
    list.iter().all(|x| x.abs() <= FLEXIONS_DEG[1].to_radians()) && list.iter().any(|x| x.fract() != 0.0)
}

impl GraftFile {
    /// The ligament in whose place it runs, by both its sites; none of one that runs from elsewhere.
    fn replaces(&self) -> Option<&'static str> {
        let of = |site: &SiteFile, is_by_percent: bool| match &site.native {
            Some(name) => LIGAMENTS.iter().copied().find(|ligament| is_of(name, ligament)),
            None => is_by_percent.then_some("ACL"),
        };
        let femur = of(&self.femur, self.femur.quadrant_percent.is_some())?;
        let tibia = of(&self.tibia, self.tibia.plateau_percent.is_some())?;
        (femur == tibia).then_some(femur)
    }

    fn check(&self) -> Result<(), Wrong> {
        let ranged = |key: &str, x: f64, range: [f64; 2]| within(key, key, x, range);
        match (self.stiffness_n_per_mm, self.cross_section_mm2, self.modulus_mpa) {
            (Some(k), None, None) => ranged("stiffness_n_per_mm", k, STIFFNESSES_N_PER_MM)?,
            (None, Some(a), Some(e)) => {
                ranged("cross_section_mm2", a, [0.1, 1000.0])?;
                ranged("modulus_mpa", e, [0.1, 10_000.0])?;
            }
            _ => return Err(Wrong::at("", "expected stiffness_n_per_mm, or cross_section_mm2 with modulus_mpa")),
        }
        match (self.tension_n, self.slack_length_mm) {
            (Some(t), None) => ranged("tension_n", t, TENSIONS_N)?,
            (None, Some(l)) => ranged("slack_length_mm", l, [1.0, 300.0])?,
            _ => return Err(Wrong::at("", "expected one of tension_n and slack_length_mm")),
        }
        ranged("at_flexion_deg", self.at_flexion_deg, FLEXIONS_DEG)?;
        ranged("toe_strain", self.toe_strain, [1e-6, 0.2])?;
        self.free_length_mm.map_or(Ok(()), |l| ranged("free_length_mm", l, [1.0, 500.0]))?;
        self.femur.check("femur", "plateau_percent", self.femur.plateau_percent.is_some())?;
        self.tibia.check("tibia", "quadrant_percent", self.tibia.quadrant_percent.is_some())
    }
}

impl SiteFile {
    /// Refuses a site that is none, two, or on the other bone.
    fn check(&self, bone: &str, others: &str, is_others: bool) -> Result<(), Wrong> {
        if is_others {
            let at = format!("{bone}.{others}");
            return Err(Wrong::at(&at, format!("{at} is a place of the other bone")));
        }
        let given = [
            self.native.is_some(),
            self.point_mm.is_some(),
            self.quadrant_percent.is_some(),
            self.plateau_percent.is_some(),
        ];
        if given.into_iter().filter(|g| *g).count() != 1 {
            let own = if bone == "femur" { "quadrant_percent" } else { "plateau_percent" };
            let has = if given.contains(&true) { "several places" } else { "no place" };
            return Err(Wrong::at(bone, format!("{bone} has {has}, expected one of native, point_mm and {own}")));
        }
        let percents = [("quadrant_percent", self.quadrant_percent), ("plateau_percent", self.plateau_percent)];
        let parts = percents.iter().filter_map(|(key, pair)| Some((key, (*pair)?)));
        let is_part = |pair: &[f64; 2]| pair.iter().all(|p| (0.0..=1.0).contains(p)) && *pair != [0.0; 2];
        if let Some((key, [a, b])) = parts.into_iter().find(|(_, pair)| is_part(pair)) {
            let told = format!(
                "{bone}.{key} is [{a}, {b}]: parts of 1? Expected percentages, such as [{:.0}, {:.0}]",
                100.0 * a,
                100.0 * b
            );
            return Err(Wrong::at(format!("{bone}.{key}"), told));
        }
        for (key, p) in percents.iter().flat_map(|(key, pair)| pair.iter().flatten().map(move |p| (key, *p))) {
            within(&format!("{bone}.{key}"), &format!("{bone}, percent"), p, PERCENTS)?;
        }
        let lengths = [("point_mm", self.point_mm, POINTS_MM), ("move_mm", Some(self.move_mm), MOVES_MM)];
        let mut all =
            lengths.iter().flat_map(|(key, three, most)| three.iter().flatten().map(move |x| (key, *x, *most)));
        all.try_for_each(|(key, x, most)| within(&format!("{bone}.{key}"), &format!("{bone}.{key}"), x, most))
    }
}

impl TestsFile {
    fn check(&self) -> Result<(), Wrong> {
        for (key, list) in [("flexions_deg", &self.flexions_deg), ("passive_deg", &self.passive_deg)] {
            if list.is_empty() || list.len() > 30 {
                return Err(Wrong::at(key, format!("{key} has {} flexions, expected 1 to 30", list.len())));
            }
            list.iter().try_for_each(|x| within(key, key, *x, FLEXIONS_DEG))?;
            if let Some(twice) = list.iter().enumerate().find(|(k, x)| list[..*k].contains(x)).map(|(_, x)| x) {
                return Err(Wrong::at(key, format!("{key} has {twice} twice, expected each flexion once")));
            }
        }
        for (key, x, most) in [
            ("drawer_n", self.drawer_n, 500.0),
            ("rotation_nm", self.rotation_nm, 50.0),
            ("varus_valgus_nm", self.varus_valgus_nm, 50.0),
            ("compression_n", self.compression_n, 3000.0),
            ("restored_mm", self.restored_mm, 50.0),
            ("restored_deg", self.restored_deg, 50.0),
        ] {
            within(key, key, x, [0.0, most])?;
        }
        within("pivot", "pivot, flexion", self.pivot[0], FLEXIONS_DEG)?;
        self.pivot[1..].iter().try_for_each(|x| within("pivot", "pivot, moment", *x, [0.0, 50.0]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_another_unit_and_grafts_beside_a_whole_ligament_are_told() {
        let usual = || parsed(EXAMPLE).unwrap();
        let told = |plan: &PlanFile| plan.odd().iter().map(ToString::to_string).collect::<Vec<_>>();
        assert!(told(&usual()).is_empty(), "{:?}", told(&usual()));
        let mut plan = usual();
        plan.graft[0].at_flexion_deg = 0.35;
        assert!(told(&plan)[0].contains("at_flexion_deg is 0.35: radians?"), "{:?}", told(&plan));
        let plan = PlanFile { tests: TestsFile { drawer_n: 0.0, ..usual().tests }, ..usual() };
        assert!(told(&plan)[0].contains("tests.drawer_n is 0 N"), "{:?}", told(&plan));
        let plan = PlanFile { cut: vec!["PCL".into()], ..usual() };
        assert!(!told(&plan).is_empty() && told(&plan).iter().all(|t| t.contains("in the place of ACL")));
    }
}
