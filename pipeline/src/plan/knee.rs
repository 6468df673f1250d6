//! A knee and what a plan does to it: what is cut, where grafts run, which tests it is put to.

use super::file::{GraftFile, PlanFile, TestsFile};
use super::sites::{Bone, WALL_PERCENT, bones};
use meshes::{Point, Vector};
use sim::coordinate::{AP, FREE, Free, IE, Load, VV};
use sim::flags::Flag;
use sim::graft::{Drawn, FIXED_AT_DEG, Graft, TENSION_N, bundle_name};
use sim::laxity::{LaxityTrial, Test, force_column};
use sim::ligament::mean_length;
use sim::mesh::MeshValue;
use sim::names::is_of;
use sim::spec::{BundleSpec, ModelSpec};
use std::collections::BTreeMap;

/// The surfaces of a model by name.
pub type Surfaces = BTreeMap<String, MeshValue>;

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
    pub(super) whole: Option<String>,
    /// Where the knee's own ACL lies by the quadrant method [%], where that is not on the wall of the notch: the graft was laid there.
    pub(super) off_the_wall: Option<[f64; 2]>,
    /// How far its femoral and its tibial site were moved along the bone; of several fibres the least [mm].
    pub(super) went_mm: [f64; 2],
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

/// What one test gave.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// VV, IE [deg], ML, AP, SI [mm].
    pub(super) pose: Free<f64>,
    /// Every number by the name of its column in results.
    pub(super) told: Vec<(String, f64)>,
    pub(super) flags: Vec<Flag>,
}

impl Found {
    /// A number by the name of its column in results.
    pub(super) fn value(&self, column: &str) -> Option<f64> {
        self.told.iter().find(|(name, _)| name == column).map(|(_, x)| *x)
    }
}

/// The answers of a knee: by state and test.
pub(super) type Answers = [Vec<Option<Found>>; 3];

/// Names of the columns that a plan tells: its own, and that of results.
pub(super) fn columns(file: &PlanFile) -> Vec<[String; 2]> {
    let pose = FREE.map(|c| c.column()).into_iter();
    let contact = ["contact_medial_force_n", "contact_lateral_force_n"].map(str::to_owned);
    let same = pose.chain(contact).map(|name| [name.clone(), name]);
    let grafts = file.graft.iter().enumerate();
    same.chain(grafts.map(|(k, g)| [format!("graft_{}_n", g.name), force_column(&bundle_name(k))])).collect()
}

/// Flexions of the unloaded tests, ascending [deg]: those of the file, and those of the loaded tests, which count from rest.
pub(super) fn unloaded_deg(t: &TestsFile) -> Vec<f64> {
    let mut flexions: Vec<f64> = t.flexions_deg.iter().chain(&t.passive_deg).copied().chain([t.pivot[0]]).collect();
    flexions.sort_by(f64::total_cmp);
    flexions.dedup();
    flexions
}

/// The tests of a plan.
pub(super) fn tests(t: &TestsFile) -> Vec<Asked> {
    let flexions = unloaded_deg(t);
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
    let found: Vec<&BundleSpec> = spec.bundles.iter().filter(|b| is_of(&b.name, name)).collect();
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

/// The middle of points.
fn centre(points: &[Point]) -> Point {
    Point::from(points.iter().map(|p| p.coords).sum::<Vector>() / points.len().max(1) as f64)
}

/// The cruciate that a graft on the wall of the notch stands for.
const ACL: &str = "ACL";

/// Whether a ligament's or bundle's name is of the ACL.
pub(super) fn is_acl(name: &str) -> bool {
    is_of(name, ACL)
}

/// The way of the whole ACL's footprint on the femur to the wall of the notch, and its percentages by the quadrant method: where `native` is of the
/// ACL, and its footprint not on that wall. The literature's place falls on the back of some femurs, and a mark may be wrong.
fn off_the_wall(spec: &ModelSpec, femur: &Bone, native: Option<&String>) -> Option<(Vector, [f64; 2])> {
    native.filter(|name| is_acl(name))?;
    let own: Vec<Point> = ends(spec, &meant(spec, ACL).ok()?, 0).collect();
    let centre = (!own.is_empty()).then(|| centre(&own))?;
    let percent = femur.percent(&centre)?;
    let is_off = percent.iter().any(|p| !WALL_PERCENT.contains(p));
    if is_off { Some((femur.to_the_wall(&centre)?, percent)) } else { None }
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
    let off = off_the_wall(spec, &bones[0], sites[0].native.as_ref());
    let native = |end: usize, p: Point| match off {
        Some((way, _)) if end == 0 => bones[0].on_the_wall(p, way),
        _ => p,
    };
    let (lines, went_mm) = if let Some(one) = whole {
        let all = [one];
        let moved = |end: usize| {
            let own = ends(spec, &all, end).map(|p| native(end, p));
            own.map(|p| bones[end].moved(p, sites[end].move_mm)).collect::<Vec<_>>()
        };
        let (femur, tibia) = (moved(0), moved(1));
        let least = |own: &[(Point, f64)]| own.iter().map(|(_, went)| *went).reduce(f64::min).unwrap_or(0.0);
        let went = [least(&femur), least(&tibia)];
        (femur.into_iter().zip(tibia).map(|((a, _), (b, _))| [a, b]).collect::<Vec<_>>(), went)
    } else {
        let at = |end: usize| {
            bones[end].place(sites[end], |name| {
                let own: Vec<Point> = ends(spec, &meant(spec, name)?, end).collect();
                Ok(native(end, centre(&own)))
            })
        };
        let ((femur, from), (tibia, to)) = (at(0).map_err(fault)?, at(1).map_err(fault)?);
        (vec![[femur, tibia]], [from, to])
    };
    let length = mean_length(&lines);
    let stiffness = match (graft.stiffness_n_per_mm, graft.cross_section_mm2, graft.modulus_mpa) {
        (Some(k), ..) => k,
        (_, Some(area), Some(modulus)) => area * modulus / graft.free_length_mm.unwrap_or(length),
        _ => return Err(fault("it has no stiffness".into())),
    };
    let off_the_wall = off.map(|(_, percent)| percent);
    Ok(Placed { ends: lines, stiffness, whole: whole.map(|b| b.name.clone()), off_the_wall, went_mm })
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
