//! graft.toml: what a surgeon cuts, what is put in, and how the knee is tested.

use crate::error::{BuildError, Place};
use crate::store;
use serde::{Deserialize, Serialize};
use sim::graft::{COMPRESSION_N, FIXED_AT_DEG, STIFFNESSES_N_PER_MM, TENSIONS_N, TOE_STRAIN};
use std::path::Path;

/// An example, as `build-model plan --example` prints it.
pub const EXAMPLE: &str = include_str!("example.toml");

/// Flexions that may be asked [deg].
const FLEXIONS_DEG: [f64; 2] = [-10.0, 140.0];

/// What graft.toml says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    let file: PlanFile = toml::from_str(text).map_err(|e: toml::de::Error| {
        let row = e.span().map(|s| text[..s.start.min(text.len())].matches('\n').count() + 1);
        (row, format!("{}; expected what `build-model plan --example` prints", e.message().trim()))
    })?;
    file.check().map_err(|what| (None, what))?;
    Ok(file)
}

/// Refuses a number outside a range.
fn within(key: &str, x: f64, [least, most]: [f64; 2]) -> Result<(), String> {
    let ok = x >= least && x <= most;
    if ok { Ok(()) } else { Err(format!("{key} is {x}, expected {least} to {most}")) }
}

impl PlanFile {
    /// Refuses what means nothing.
    pub(super) fn check(&self) -> Result<(), String> {
        self.tests.check()?;
        for (k, g) in self.graft.iter().enumerate() {
            if g.name.trim().is_empty() || self.graft[..k].iter().any(|o| o.name == g.name) {
                return Err(format!("graft[{k}].name is {:?}, expected a name that no other graft has", g.name));
            }
            g.check().map_err(|what| format!("graft {:?}: {what}", g.name))?;
        }
        Ok(())
    }
}

impl GraftFile {
    fn check(&self) -> Result<(), String> {
        let stiff = match (self.stiffness_n_per_mm, self.cross_section_mm2, self.modulus_mpa) {
            (Some(k), None, None) => within("stiffness_n_per_mm", k, STIFFNESSES_N_PER_MM),
            (None, Some(a), Some(e)) => {
                within("cross_section_mm2", a, [0.1, 1000.0]).and(within("modulus_mpa", e, [0.1, 10_000.0]))
            }
            _ => Err("expected stiffness_n_per_mm, or cross_section_mm2 with modulus_mpa".into()),
        };
        stiff?;
        match (self.tension_n, self.slack_length_mm) {
            (Some(t), None) => within("tension_n", t, TENSIONS_N)?,
            (None, Some(l)) => within("slack_length_mm", l, [1.0, 300.0])?,
            _ => return Err("expected one of tension_n and slack_length_mm".into()),
        }
        within("at_flexion_deg", self.at_flexion_deg, FLEXIONS_DEG)?;
        within("toe_strain", self.toe_strain, [1e-6, 0.2])?;
        self.free_length_mm.map_or(Ok(()), |l| within("free_length_mm", l, [1.0, 500.0]))?;
        self.femur.check("femur", "plateau_percent", self.femur.plateau_percent.is_some())?;
        self.tibia.check("tibia", "quadrant_percent", self.tibia.quadrant_percent.is_some())
    }
}

impl SiteFile {
    /// Refuses a site that is none, two, or on the other bone.
    fn check(&self, bone: &str, others: &str, is_others: bool) -> Result<(), String> {
        if is_others {
            return Err(format!("{bone}.{others} is a place of the other bone"));
        }
        let given = [
            self.native.is_some(),
            self.point_mm.is_some(),
            self.quadrant_percent.is_some(),
            self.plateau_percent.is_some(),
        ];
        if given.into_iter().filter(|g| *g).count() != 1 {
            let own = if bone == "femur" { "quadrant_percent" } else { "plateau_percent" };
            return Err(format!(
                "{bone} has {}, expected one of native, point_mm and {own}",
                match given.contains(&true) {
                    true => "several places",
                    false => "no place",
                }
            ));
        }
        for p in self.quadrant_percent.iter().chain(&self.plateau_percent).flatten() {
            within(&format!("{bone}, percent"), *p, [-10.0, 110.0])?;
        }
        let numbers = self.point_mm.iter().flatten().chain(&self.move_mm);
        numbers.into_iter().try_for_each(|x| within(&format!("{bone}, mm"), *x, [-5000.0, 5000.0]))
    }
}

impl TestsFile {
    fn check(&self) -> Result<(), String> {
        for (key, list) in [("flexions_deg", &self.flexions_deg), ("passive_deg", &self.passive_deg)] {
            if list.is_empty() || list.len() > 30 {
                return Err(format!("tests.{key} has {} flexions, expected 1 to 30", list.len()));
            }
            list.iter().try_for_each(|x| within(&format!("tests.{key}"), *x, FLEXIONS_DEG))?;
        }
        for (key, x, most) in [
            ("drawer_n", self.drawer_n, 500.0),
            ("rotation_nm", self.rotation_nm, 50.0),
            ("varus_valgus_nm", self.varus_valgus_nm, 50.0),
            ("compression_n", self.compression_n, 3000.0),
            ("restored_mm", self.restored_mm, 50.0),
            ("restored_deg", self.restored_deg, 50.0),
        ] {
            within(&format!("tests.{key}"), x, [0.0, most])?;
        }
        within("tests.pivot, flexion", self.pivot[0], FLEXIONS_DEG)?;
        self.pivot[1..].iter().try_for_each(|x| within("tests.pivot, moment", *x, [0.0, 50.0]))
    }
}
