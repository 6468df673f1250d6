//! Ligament fibres: straight or wrapping over bone ([`crate::wrap`]), tension only, toe then linear [blankevoort1991], with a dashpot.
//!
//! The stretch of fibre i is measured from the CT pose: `x = (l_i - l_i,CT) + L_bundle - L0`, `L0 = L_bundle / e`; so every fibre of a bundle has
//! the same strain in the CT pose, whatever its own length. A bundle's force is shared equally by its fibres.
//!
//! [`Bundle::response`] and [`Bundle::bends`] are the only places that know a law: exports, scatter and imports sample them. A law is a shape in multiples of
//! the toe's length, times stiffness and toe; its last line points at one toe. A new one is an entry of [`Law`] and its two arms here.

use crate::coordinate::Six;
use crate::error::SimError;
use crate::joint::{Pose, comes_first};
use crate::mesh::MeshValue;
use crate::spec::{BundleSpec, Law, ModelSpec};
pub use crate::wrap::Line;
use crate::wrap::{self, Bones, Laid, Path, Wrap};
use meshes::Vector;
use nalgebra::Matrix6;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Where the tabular law's last point lies unless the specification says otherwise, in multiples of the toe's end.
const TABLE_END: f64 = 10.0;

/// A bundle's force law, shared by its fibres.
#[derive(Clone, Debug, PartialEq)]
pub struct Bundle {
    /// Bundle name.
    pub name: String,
    /// Ratio of length to slack length in the CT pose [-].
    pub reference_strain: f64,
    /// Of the whole bundle [N/mm].
    pub stiffness: f64,
    /// Length the slack length derives from [mm].
    pub reference_length: f64,
    /// Toe strain [-].
    pub toe_strain: f64,
    /// Smooth, or interpolated in the deck's table.
    pub law: Law,
    /// Multiple of the toe strain beyond which the tabular force stays constant [-].
    pub table_end: f64,
    /// Number of fibres.
    pub fibres: usize,
    /// Dashpot of each fibre [N s/mm].
    pub damping: f64,
}

/// A fibre: ends in the CT pose [mm].
#[derive(Clone, Debug, PartialEq)]
pub struct Fibre {
    /// Index of its bundle.
    pub bundle: usize,
    /// Femoral end.
    pub femur: Vector,
    /// Tibial end.
    pub tibia: Vector,
    /// Length in the CT pose.
    pub initial_length: f64,
    /// How it wraps over bone, where it does.
    pub(crate) wrap: Option<Arc<Wrap>>,
}

/// A force law at one stretch, for one fibre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Response {
    /// Strain energy [N mm].
    pub energy: f64,
    /// Tension [N].
    pub force: f64,
    /// Derivative of the tension by the stretch [N/mm].
    pub stiffness: f64,
}

impl Bundle {
    /// Slack length `L0` [mm].
    pub fn slack_length(&self) -> f64 {
        self.reference_length / self.reference_strain
    }

    /// Tension, energy and stiffness of one fibre at stretch `x` [mm].
    pub fn response(&self, x: f64) -> Response {
        let share = 1.0 / self.fibres as f64;
        let toe = self.toe_strain * self.slack_length();
        let r = match self.law {
            Law::Smooth => toe_then_line(self.stiffness, toe, x),
            Law::Tabular => tabular(self.stiffness, toe, self.table_end, x),
        };
        Response { energy: r.energy * share, force: r.force * share, stiffness: r.stiffness * share }
    }

    /// Where the law bends, in toes from slack [-]: ascending, with as many steps between as a curve needs to be followed by chords. Beyond the last the
    /// force is a line.
    fn bends(&self) -> Vec<f64> {
        match self.law {
            Law::Smooth => (0..=CHORDS).map(|n| 2.0 * n as f64 / CHORDS as f64).collect(),
            Law::Tabular => table(self.table_end).map(|p| p.0).to_vec(),
        }
    }

    /// Length of the toe [mm].
    pub fn toe_mm(&self) -> f64 {
        self.toe_strain * self.slack_length()
    }

    /// The law of one fibre as another program's table takes it: stretch in toes [-] and force over stiffness times toe [-], from slack to the last bend.
    /// Chords between the rows follow the law; both columns stay as they are while stiffness and slack length change.
    pub fn shape(&self) -> Vec<[f64; 2]> {
        let unit = self.stiffness * self.toe_mm() / self.fibres as f64;
        self.bends().into_iter().map(|x| [x, self.response(x * self.toe_mm()).force / unit]).collect()
    }

    /// The law of one fibre as stretch [mm] and force [N], from slack to `beyond_mm` behind the last bend.
    pub fn table(&self, beyond_mm: f64) -> Vec<[f64; 2]> {
        let mut stretch: Vec<f64> = self.bends().into_iter().map(|x| x * self.toe_mm()).collect();
        stretch.extend(stretch.last().map(|last| last + beyond_mm));
        stretch.into_iter().map(|x| [x, self.response(x).force]).collect()
    }

    /// How far the bundle's force departs from a parabola and its tangent [N], up to a stretch of `toes` [-]; for programs that know no other law.
    pub fn off_toe_and_line(&self, toes: f64) -> f64 {
        let toe = self.toe_mm();
        let stretch = (0..=SAMPLES).map(|n| toes * toe * n as f64 / SAMPLES as f64);
        let off =
            |x: f64| (self.response(x).force * self.fibres as f64 - toe_then_line(self.stiffness, toe, x).force).abs();
        stretch.map(off).fold(0.0, f64::max)
    }

    /// What a fibre gains in tension at stretch `x` [mm] as its toe becomes wider by a share of itself, about the root of its last line, which stays [N].
    pub fn gain_by_wider_toe(&self, x: f64) -> f64 {
        let r = self.response(x);
        if x > 0.0 { r.force - (x - self.toe_mm()) * r.stiffness } else { 0.0 }
    }

    /// Stretch in the CT pose [mm], negative when slack.
    pub fn initial_stretch(&self) -> f64 {
        self.reference_length - self.slack_length()
    }

    /// Derivatives of one fibre's tension at length increase `u` [mm] by reference strain [N] and by stiffness [mm].
    pub fn parameter_derivatives(&self, u: f64) -> [f64; 2] {
        let x = u + self.initial_stretch();
        let (slack, e) = (self.slack_length(), self.reference_strain);
        let r = self.response(x);
        // the force is K toe f(x / toe): of degree one in (x, toe), so dF/dtoe = (F - x dF/dx) / toe
        let toe = self.toe_strain * slack;
        let by_slack = -r.stiffness + self.toe_strain * (r.force - x * r.stiffness) / toe;
        [by_slack * -slack / e, r.force / self.stiffness]
    }
}

/// Chords of an exported parabola [-]: it departs from them by a sixteen-hundredth of stiffness times toe.
const CHORDS: usize = 20;
/// Stretches at which two laws are compared [-].
const SAMPLES: usize = 400;

/// Quadratic up to twice the toe, then linear.
pub(crate) fn toe_then_line(k: f64, toe: f64, x: f64) -> Response {
    if x <= 0.0 {
        Response::default()
    } else if x <= 2.0 * toe {
        let c = k / (4.0 * toe);
        Response { energy: c * x.powi(3) / 3.0, force: c * x * x, stiffness: 2.0 * c * x }
    } else {
        let (y, a) = (x - 2.0 * toe, k * toe);
        Response { energy: a * toe * 2.0 / 3.0 + a * y + k * y * y / 2.0, force: a + k * y, stiffness: k }
    }
}

/// The tabular law's points: stretch in toes, force over stiffness times toe.
fn table(end: f64) -> [(f64, f64); 7] {
    [(0.0, 0.0), (0.5, 0.0625), (1.0, 0.25), (1.5, 0.5625), (2.0, 1.0), (4.0, 3.0), (end, end - 1.0)]
}

/// Linear between the smooth law's values at 0, 0.5, 1, 1.5, 2, 4 and `end` toes; constant beyond.
fn tabular(k: f64, toe: f64, end: f64, x: f64) -> Response {
    let table = table(end);
    if x <= 0.0 {
        return Response::default();
    }
    let mut energy = 0.0;
    for pair in table.windows(2) {
        let [(x0, f0), (x1, f1)] = [pair[0], pair[1]].map(|(s, f)| (s * toe, f * k * toe));
        if x <= x1 {
            let slope = (f1 - f0) / (x1 - x0);
            let force = f0 + slope * (x - x0);
            return Response { energy: energy + (x - x0) * (f0 + force) / 2.0, force, stiffness: slope };
        }
        energy += (x1 - x0) * (f0 + f1) / 2.0;
    }
    let force = (end - 1.0) * k * toe;
    Response { energy: energy + force * (x - end * toe), force, stiffness: 0.0 }
}

impl Fibre {
    /// A straight fibre between a femoral and a tibial end, of a length in the CT pose [mm].
    pub fn straight(bundle: usize, femur: Vector, tibia: Vector, initial_length: f64) -> Fibre {
        Fibre { bundle, femur, tibia, initial_length, wrap: None }
    }

    /// The fibre with other ends in the CT pose, over the same bones.
    pub fn with_ends(&self, femur: Vector, tibia: Vector) -> Fibre {
        let straight = Fibre::straight(self.bundle, femur, tibia, (femur - tibia).norm());
        match &self.wrap {
            Some(wrap) => straight.over(wrap.bones()),
            None => straight,
        }
    }

    /// The fibre as it wraps over bones.
    pub(crate) fn over(mut self, bones: &Arc<Bones>) -> Fibre {
        let (wrap, length) = bones.wrap(&self.femur, &self.tibia);
        (self.wrap, self.initial_length) = (Some(Arc::new(wrap)), length);
        self
    }

    /// Whether it wraps over bone where bone is in its way.
    pub fn wraps(&self) -> bool {
        self.wrap.is_some()
    }

    /// The fibre at a pose of the femur.
    pub fn line(&self, pose: &Pose) -> Line {
        match self.path(pose, &mut Laid::default(), 0.0) {
            Some(path) => path.line(pose, (pose.femur * meshes::Point::from(self.femur)).coords),
            None => self.straight_line(pose),
        }
    }

    /// Its path where it touches bone, sought from where it lay; of a fibre that is surely shorter than `slack` [mm] an upper bound.
    pub(crate) fn path(&self, pose: &Pose, laid: &mut Laid, slack: f64) -> Option<Path> {
        let femur = (pose.femur * meshes::Point::from(self.femur)).coords;
        self.wrap.as_ref()?.path([self.tibia, femur], pose, laid, slack)
    }

    /// The straight line between its ends.
    pub(crate) fn straight_line(&self, pose: &Pose) -> Line {
        let femur = (pose.femur * meshes::Point::from(self.femur)).coords;
        let v = femur - self.tibia;
        let length = v.norm().max(1e-9);
        let direction = v / length;
        let gradient = Six::from_fn(|j, _| direction.dot(&pose.screws[j].at(&femur)));
        Line { length, direction, femur, gradient }
    }
}

impl Fibre {
    /// Its path at a pose, from the tibial to the femoral end: a straight line, or where it wraps, over bone.
    pub fn way(&self, pose: &Pose) -> Vec<meshes::Point> {
        let femur = (pose.femur * meshes::Point::from(self.femur)).coords;
        let path = self.path(pose, &mut Laid::default(), 0.0);
        let inner = path.iter().flat_map(|p| p.nodes()).copied();
        std::iter::once(self.tibia).chain(inner).chain(std::iter::once(femur)).map(meshes::Point::from).collect()
    }
}

/// Length of each fibre of a specification in the CT pose [mm], over bone where it wraps.
///
/// # Errors
/// A body or a bundle that is not there, a bone whose mesh is not given, a fibre without length.
pub fn lengths(spec: &ModelSpec, meshes: &BTreeMap<String, MeshValue>) -> Result<Vec<f64>, SimError> {
    let (_, mut fibres) = compile(spec)?;
    lay(spec, meshes, &mut fibres)?;
    Ok(fibres.iter().map(|f| f.initial_length).collect())
}

/// Lays the fibres that a specification lets wrap over its bones.
///
/// # Errors
/// As of [`crate::wrap`]: a body or a bundle that is not there, a bone whose mesh is not given.
pub(crate) fn lay(
    spec: &ModelSpec,
    meshes: &BTreeMap<String, MeshValue>,
    fibres: &mut [Fibre],
) -> Result<(), SimError> {
    let (Some(bones), Some(named)) = (wrap::bones(spec, meshes)?, &spec.wrap) else { return Ok(()) };
    for (fibre, own) in fibres.iter_mut().zip(&spec.fibres) {
        if named.bundles.contains(&own.bundle) {
            *fibre = fibre.clone().over(&bones);
        }
    }
    Ok(())
}

/// Adds `force x second derivative of the length + stiffness x gradient x gradient` to a Hessian.
pub fn add_hessian(hessian: &mut Matrix6<f64>, line: &Line, pose: &Pose, force: f64, stiffness: f64) {
    let v: [Vector; 6] = std::array::from_fn(|j| pose.screws[j].at(&line.femur));
    for j in 0..6 {
        for k in j..6 {
            let (first, last) = if comes_first(j, k) { (j, k) } else { (k, j) };
            let second = line.direction.dot(&pose.screws[first].angular.cross(&v[last]));
            let across = (v[j].dot(&v[k]) - line.gradient[j] * line.gradient[k]) / line.length;
            let h = force * (across + second) + stiffness * line.gradient[j] * line.gradient[k];
            hessian[(j, k)] += h;
            if j != k {
                hessian[(k, j)] += h;
            }
        }
    }
}

/// Bundles and fibres of a specification.
///
/// Errors: a number out of range, a fibre of no bundle, a bundle without fibres, a fibre without length.
pub fn compile(spec: &ModelSpec) -> Result<(Vec<Bundle>, Vec<Fibre>), SimError> {
    let mut bundles: Vec<Bundle> = spec
        .bundles
        .iter()
        .map(|b| bundle(b, spec.toe_end_multiple.get(&b.name).copied()))
        .collect::<Result<_, _>>()?;
    let mut fibres = Vec::with_capacity(spec.fibres.len());
    for (i, f) in spec.fibres.iter().enumerate() {
        let Some(bundle) = bundles.iter().position(|b| b.name == f.bundle) else {
            return Err(SimError::Spec(format!("fibres[{i}]: no bundle is named {:?}", f.bundle)));
        };
        bundles[bundle].fibres += 1;
        fibres.push(
            fibre(bundle, &[f.femur, f.tibia])
                .map_err(|length| SimError::Spec(format!("fibres[{i}] of {}: length {length} mm", f.bundle)))?,
        );
    }
    match bundles.iter().find(|b| b.fibres == 0) {
        Some(b) => Err(SimError::Spec(format!("bundle {} has no fibres", b.name))),
        None => Ok((bundles, fibres)),
    }
}

/// A fibre between its femoral and its tibial end; else the length that none has [mm].
pub(crate) fn fibre(bundle: usize, [femur, tibia]: &[meshes::Point; 2]) -> Result<Fibre, f64> {
    let initial_length = (femur - tibia).norm();
    if !(initial_length > 1e-3 && initial_length < 1e4) {
        return Err(initial_length);
    }
    Ok(Fibre::straight(bundle, femur.coords, tibia.coords, initial_length))
}

/// Mean length of lines [mm].
pub fn mean_length(lines: &[[meshes::Point; 2]]) -> f64 {
    lines.iter().map(|[a, b]| (a - b).norm()).sum::<f64>() / lines.len().max(1) as f64
}

/// A bundle of so many fibres, its numbers checked; `table_end` as in [`Bundle`], where the specification says it.
///
/// # Errors
/// A number out of range.
pub fn of_fibres(b: &BundleSpec, fibres: usize, table_end: Option<f64>) -> Result<Bundle, SimError> {
    Ok(Bundle { fibres: fibres.max(1), ..bundle(b, table_end)? })
}

/// One bundle without fibres yet, its numbers checked; `table_end` as in [`Bundle`].
pub(crate) fn bundle(b: &BundleSpec, table_end: Option<f64>) -> Result<Bundle, SimError> {
    let table_end = table_end.unwrap_or(TABLE_END);
    for (key, value, least) in [
        ("reference_strain", b.reference_strain, 0.05),
        ("stiffness_n_per_mm", b.stiffness_n_per_mm, 0.0),
        ("reference_length_mm", b.reference_length_mm, 1e-3),
        ("toe_strain", b.toe_strain, 1e-6),
        ("toe_end_multiple", table_end, 4.001),
        ("damping_n_s_per_mm", b.damping_n_s_per_mm, 0.0),
    ] {
        if !(value >= least && value.is_finite()) {
            return Err(SimError::Spec(format!("bundle {}: {key} is {value}, expected at least {least}", b.name)));
        }
    }
    Ok(Bundle {
        name: b.name.clone(),
        reference_strain: b.reference_strain,
        stiffness: b.stiffness_n_per_mm.max(1e-12),
        reference_length: b.reference_length_mm,
        toe_strain: b.toe_strain,
        law: b.law,
        table_end,
        fibres: 0,
        damping: b.damping_n_s_per_mm,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_law_of_a_file_is_in_the_list_of_laws() {
        let schema = serde_json::to_value(schemars::schema_for!(Law)).unwrap();
        assert_eq!(schema["oneOf"].as_array().map(Vec::len), Some(Law::ALL.len()));
    }

    fn bundle(law: Law) -> Bundle {
        Bundle {
            name: "B".into(),
            reference_strain: 1.05,
            stiffness: 80.0,
            reference_length: 34.0,
            toe_strain: 0.03,
            law,
            table_end: 10.0,
            fibres: 2,
            damping: 0.05,
        }
    }

    #[test]
    fn force_is_the_slope_of_energy_and_stiffness_that_of_force() {
        for law in Law::ALL {
            let b = bundle(law);
            for x in [-1.0, 0.3, 0.8, 1.2, 1.7, 2.4, 5.0, 20.0] {
                let (lo, hi, r) = (b.response(x - 1e-6), b.response(x + 1e-6), b.response(x));
                let slope = (hi.energy - lo.energy) / 2e-6;
                assert!((slope - r.force).abs() < 1e-6 + 1e-8 * r.force, "{law:?} {x} {slope} {}", r.force);
                assert!(((hi.force - lo.force) / 2e-6 - r.stiffness).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn parameters_move_the_force_as_finite_differences_say() {
        for law in Law::ALL {
            for u in [-0.5, 0.4, 3.0] {
                let b = bundle(law);
                let force = |b: &Bundle| b.response(u + b.initial_stretch()).force;
                let [de, dk] = b.parameter_derivatives(u);
                let with = |e: f64, k: f64| Bundle { reference_strain: e, stiffness: k, ..b.clone() };
                let e = (force(&with(1.05 + 1e-6, 80.0)) - force(&with(1.05 - 1e-6, 80.0))) / 2e-6;
                let k = (force(&with(1.05, 80.0 + 1e-4)) - force(&with(1.05, 80.0 - 1e-4))) / 2e-4;
                assert!(
                    (e - de).abs() < 1e-5 * de.abs().max(1.0) && (k - dk).abs() < 1e-8,
                    "{law:?} {u}: {e} {de} {k} {dk}"
                );
            }
        }
    }

    #[test]
    fn a_table_follows_its_law_and_keeps_its_shape() {
        for law in Law::ALL {
            let b = bundle(law);
            let rows = b.table(40.0);
            for pair in rows.windows(2) {
                let [[x0, f0], [x1, f1]] = [pair[0], pair[1]];
                for share in [0.0, 0.3, 0.7, 1.0] {
                    let off = f0 + share * (f1 - f0) - b.response(x0 + share * (x1 - x0)).force;
                    assert!(off.abs() < 1e-3 * b.stiffness * b.toe_mm(), "{law:?} between {x0} and {x1} mm: {off} N");
                }
            }
            let stiffer = Bundle { stiffness: 130.0, reference_strain: 0.98, ..b.clone() };
            for (a, c) in b.shape().into_iter().flatten().zip(stiffer.shape().into_iter().flatten()) {
                assert!((a - c).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_wider_toe_moves_the_force_as_a_difference_says_and_keeps_the_last_line() {
        for law in Law::ALL {
            let b = bundle(law);
            let (toe, by) = (b.toe_mm(), 1e-6);
            // wider about the last line's root, one toe from slack: slack moves back
            let force = |by: f64, x: f64| {
                let wide = Bundle { toe_strain: b.toe_strain * (1.0 + by), ..b.clone() };
                wide.response(x + by * toe).force
            };
            for x in [0.2, 0.7, 1.1, 1.9, 3.0] {
                let x = x * toe;
                let slope = (force(by, x) - force(-by, x)) / (2.0 * by);
                assert!((slope - b.gain_by_wider_toe(x)).abs() < 1e-4, "{law:?} {x}: {slope}");
            }
            assert!(b.gain_by_wider_toe(3.0 * toe).abs() < 1e-9 && b.gain_by_wider_toe(-1.0) == 0.0);
        }
    }

    #[test]
    fn only_the_smooth_law_is_a_toe_and_a_line() {
        assert_eq!(bundle(Law::Smooth).off_toe_and_line(4.0), 0.0);
        assert!(bundle(Law::Tabular).off_toe_and_line(4.0) > 0.1);
    }

    #[test]
    fn the_table_runs_above_the_parabola_and_meets_it_at_the_points() {
        let (s, t) = (bundle(Law::Smooth), bundle(Law::Tabular));
        let toe = 0.03 * s.slack_length();
        for m in [0.5, 1.0, 1.5, 2.0, 4.0, 9.0] {
            assert!((s.response(m * toe).force - t.response(m * toe).force).abs() < 1e-9);
        }
        assert!(t.response(0.25 * toe).force > s.response(0.25 * toe).force);
        assert_eq!(t.response(30.0 * toe).force, t.response(10.0 * toe).force);
    }
}
