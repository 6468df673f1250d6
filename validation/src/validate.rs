//! The comparison of models of one knee, calibrated from different sources, or of several knees: AP laxity, passive flexion, pivot shift with and without ACL
//! [andreassen2025, section 2.6].

use crate::apart::Checked;
use crate::sensitivity::Moved;
use crate::{parameters, published};
use attachments::groups::group_forces;
use calibration::design::Design;
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use sim::SimError;
use sim::coordinate::{AP, FREE, Free, IE, ML, SI, VV};
use sim::flags::Flag;
use sim::laxity::{Test, TrialResult};
use sim::model::Model;
use sim::protocols::{Protocol, ProtocolOptions, run};
use sim::spec::{ModelSpec, PoseSpec};

/// A calibrated model and what it answers to the protocols.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Its name: that of the data it was calibrated to.
    pub name: String,
    /// Whose knee it is.
    pub specimen: String,
    /// The model in one line, as its files name it; empty where nobody said.
    #[serde(default)]
    pub model: String,
    /// Bundle names, in the order of the forces.
    pub bundles: Vec<String>,
    /// Samples of the posterior by which its results have intervals; 0 where none were asked.
    #[serde(default)]
    pub samples: usize,
    /// Values of the design variables X1 to X26 that it has, by number.
    pub parameters: Vec<(u32, f64)>,
    /// AP laxity, all steps.
    pub ap_laxity: Vec<TrialResult>,
    /// Passive flexion, a step an angle.
    pub passive_flexion: Vec<TrialResult>,
    /// Pivot shift, all steps; the last is the end.
    pub pivot_shift: Vec<TrialResult>,
    /// The same without ACL.
    pub pivot_shift_no_acl: Vec<TrialResult>,
    /// Where its rows are by explicit dynamics: the quasi-static ones beside them. None: they are quasi-static.
    #[serde(default)]
    pub check: Option<Checked>,
    /// How far its tests move with what a calibration does not settle; empty where that was not asked.
    #[serde(default)]
    pub sensitivity: Vec<Moved>,
}

impl Source {
    /// A source without protocols yet.
    pub fn new(name: &str, spec: &ModelSpec) -> Source {
        let design = Design::of_model(spec).unwrap_or(Design { variables: vec![] });
        let values = design.values(spec);
        Source {
            name: name.to_owned(),
            specimen: spec.id.clone(),
            model: String::new(),
            bundles: spec.bundles.iter().map(|b| b.name.clone()).collect(),
            samples: 0,
            parameters: design.variables.iter().map(|v| v.number).zip(values).collect(),
            ap_laxity: vec![],
            passive_flexion: vec![],
            pivot_shift: vec![],
            pivot_shift_no_acl: vec![],
            check: None,
            sensitivity: vec![],
        }
    }

    /// A model's answers to the protocols, and what is odd about them.
    ///
    /// A row without equilibrium has no answer: a warning names it.
    ///
    /// # Errors
    /// Options out of range; a protocol without equilibrium in any row, other than without ACL, which is told as a warning.
    pub fn simulated(
        name: &str,
        spec: &ModelSpec,
        model: &Model,
        options: &ProtocolOptions,
    ) -> Result<(Source, Vec<Notice>), SimError> {
        let mut warnings = Vec::new();
        let without = model.without(&["ACL".to_owned()]);
        let (pairs, rest) = rayon::join(
            || [Protocol::ApLaxity, Protocol::PivotShift].map(|p| run(model, p, options)),
            || {
                (
                    run(model, Protocol::PassiveFlexion, options),
                    without.and_then(|m| run(&m, Protocol::PivotShift, options)),
                )
            },
        );
        let [ap_laxity, pivot_shift] = pairs;
        let pivot_shift_no_acl = rest.1.unwrap_or_else(|e| {
            warnings.push(Kind::NoPivotShift.notice(format!("{name}: no pivot shift without ACL: {e}")).of(name));
            vec![]
        });
        let source = Source {
            ap_laxity: ap_laxity?,
            passive_flexion: rest.0?,
            pivot_shift: pivot_shift?,
            pivot_shift_no_acl,
            ..Source::new(name, spec)
        };
        for (protocol, rows) in source.protocols() {
            warnings.extend(lost_rows(name, protocol, rows));
            warnings.extend(rows.iter().any(Source::is_dislocated).then(|| leaves_plateau(name, protocol)));
        }
        Ok((source, warnings))
    }

    /// Its name among `all`: with the knee's where there are several knees.
    pub fn label(&self, all: &[Source]) -> String {
        if all.iter().any(|s| s.specimen != self.specimen) {
            format!("{}-{}", self.specimen, self.name)
        } else {
            self.name.clone()
        }
    }

    /// Every protocol with its rows.
    pub fn protocols(&self) -> [(&'static str, &[TrialResult]); 4] {
        [
            ("ap_laxity", &self.ap_laxity),
            ("passive_flexion", &self.passive_flexion),
            ("pivot_shift", &self.pivot_shift),
            ("pivot_shift_no_acl", &self.pivot_shift_no_acl),
        ]
    }

    /// The same to be changed.
    pub fn protocols_mut(&mut self) -> [(&'static str, &mut Vec<TrialResult>); 4] {
        [
            ("ap_laxity", &mut self.ap_laxity),
            ("passive_flexion", &mut self.passive_flexion),
            ("pivot_shift", &mut self.pivot_shift),
            ("pivot_shift_no_acl", &mut self.pivot_shift_no_acl),
        ]
    }

    /// The answer under the full anterior or posterior load at a flexion; of equals the first. None where it has no equilibrium.
    pub fn ap_end(&self, test: Test, flexion_deg: f64) -> Option<&TrialResult> {
        self.ap_row(test, flexion_deg).filter(|r| Source::has_answer(r))
    }

    /// The row under the full anterior or posterior load at a flexion; of equals the first that has an answer, else the first.
    pub(crate) fn ap_row(&self, test: Test, flexion_deg: f64) -> Option<&TrialResult> {
        let sign = if test == Test::Posterior { -1.0 } else { 1.0 };
        let there = |r: &&TrialResult| (r.pose.fe_deg - flexion_deg).abs() < 1.5 && r.trial.load[AP] * sign > 0.0;
        let mut found: Option<&TrialResult> = None;
        for r in self.ap_laxity.iter().filter(there) {
            let is_better = |f: &TrialResult| {
                let more = r.trial.load[AP].abs() - f.trial.load[AP].abs();
                more > 1e-9 || (more > -1e-9 && Source::has_answer(r) && !Source::has_answer(f))
            };
            if found.is_none_or(is_better) {
                found = Some(r);
            }
        }
        found
    }

    /// The flexions of its AP tests [deg], ascending.
    pub fn ap_flexions(&self) -> Vec<f64> {
        let mut all: Vec<f64> = self.ap_laxity.iter().map(|r| r.trial.nominal_flexion_deg).collect();
        all.sort_by(f64::total_cmp);
        all.dedup_by(|a, b| (*a - *b).abs() < 0.5);
        all
    }

    /// Force of each of the paper's ligaments [N].
    pub fn groups(&self, result: &TrialResult) -> [f64; 9] {
        group_forces(&self.bundles, &result.forces_n)
    }

    /// The end of the pivot shift, with or without ACL. None where it has no equilibrium.
    pub fn pivot_end(&self, acl: bool) -> Option<&TrialResult> {
        self.pivot_row(acl).filter(|r| Source::has_answer(r))
    }

    /// The row of the end of the pivot shift, with or without ACL.
    pub(crate) fn pivot_row(&self, acl: bool) -> Option<&TrialResult> {
        if acl { self.pivot_shift.last() } else { self.pivot_shift_no_acl.last() }
    }

    /// True where a result has an equilibrium; else all that it predicts is NaN.
    pub fn has_answer(result: &TrialResult) -> bool {
        !result.flags.contains(&Flag::NoEquilibrium)
    }

    /// True where a result says that the femur left the plateau.
    pub fn is_dislocated(result: &TrialResult) -> bool {
        result.flags.contains(&Flag::Dislocated)
    }
}

/// What is said of a protocol in which the femur leaves the plateau.
pub(crate) fn leaves_plateau(name: &str, protocol: &str) -> Notice {
    let what = format!("{name}: {protocol}: the femur leaves the plateau; its rows are unreliable");
    Kind::LeavesPlateau.notice(what).of(name)
}

/// What is said of a protocol's rows without equilibrium.
fn lost_rows(name: &str, protocol: &str, rows: &[TrialResult]) -> Option<Notice> {
    let lost: Vec<&str> = rows.iter().filter(|r| !Source::has_answer(r)).map(|r| r.trial.trial.as_str()).collect();
    let (n, of) = (lost.len(), rows.len());
    let have = if n == 1 { "has" } else { "have" };
    let what = format!("{name}: {protocol}: {n} of {of} rows {have} no quasi-static equilibrium: {}", lost.join(", "));
    (n > 0).then(|| Kind::RowFlagged.notice(what).of(name).count(n))
}

/// How far two sources differ in a quantity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// The one.
    pub a: String,
    /// The other: a source, or measured passive flexion.
    pub b: String,
    /// What was simulated.
    pub protocol: String,
    /// What is compared.
    pub quantity: String,
    /// Its unit.
    pub unit: String,
    /// Root mean square difference; of one number its size.
    pub rmsd: f64,
    /// Numbers compared.
    pub count: usize,
    /// The paper's figure for it.
    pub published: Option<f64>,
    /// Why not to rely on it; empty where nothing is known against it.
    pub note: String,
    /// Whether `b` was measured; else it is a model.
    #[serde(default)]
    pub measured: bool,
}

/// Measured passive flexion of one origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Passive {
    /// Its name in specimen.toml.
    pub name: String,
    /// Poses.
    pub poses: Vec<PoseSpec>,
}

/// Every difference between every two sources, of each source from measured passive flexion, and where there are several knees the mean differences
/// of their parameters. Measured passive flexion called `KNEE-...` is that of this knee alone.
pub fn compare(sources: &[Source], measured: &[Passive]) -> Vec<Difference> {
    let mut out = Vec::new();
    for (i, a) in sources.iter().enumerate() {
        for b in &sources[i + 1..] {
            Pair { a, b, names: [a, b].map(|s| s.label(sources)) }.all(&mut out);
        }
        let whose = |m: &Passive| sources.iter().find(|s| m.name.starts_with(&format!("{}-", s.specimen)));
        for m in measured.iter().filter(|m| whose(m).is_none_or(|s| s.specimen == a.specimen)) {
            against_measured(a, &a.label(sources), m, &mut out);
        }
    }
    means(sources, &mut out);
    out
}

/// Two sources, of one knee or of two.
struct Pair<'a> {
    a: &'a Source,
    b: &'a Source,
    names: [String; 2],
}

impl Pair<'_> {
    /// The published figures, where these are the paper's two models of a knee.
    fn published(&self) -> Option<&'static published::Rmsd> {
        let names = [self.a.name.as_str(), self.b.name.as_str()];
        let both = self.a.specimen == self.b.specimen && names.contains(&"kla") && names.contains(&"rks");
        both.then(|| published::rmsd(&self.a.specimen)).flatten()
    }

    fn push(
        &self,
        out: &mut Vec<Difference>,
        what: (&str, &str, &str),
        d: &[f64],
        published: Option<f64>,
    ) -> Option<usize> {
        let d: Vec<f64> = d.iter().copied().filter(|x| x.is_finite()).collect();
        if d.is_empty() {
            return None;
        }
        let rmsd = (d.iter().map(|x| x * x).sum::<f64>() / d.len() as f64).sqrt();
        let (protocol, quantity, unit) = (what.0.into(), what.1.into(), what.2.into());
        let [a, b] = self.names.clone();
        out.push(Difference {
            a,
            b,
            protocol,
            quantity,
            unit,
            rmsd,
            count: d.len(),
            published,
            note: String::new(),
            measured: false,
        });
        Some(out.len() - 1)
    }

    fn all(&self, out: &mut Vec<Difference>) {
        self.ap_laxity(out);
        self.passive(out);
        self.pivot(out, true);
        self.pivot(out, false);
        self.parameters(out);
    }

    fn ap_laxity(&self, out: &mut Vec<Difference>) {
        let known = self.published();
        let mut forces = Vec::new();
        for (test, figure) in
            [(Test::Anterior, known.map(|k| k.anterior_ap_mm)), (Test::Posterior, known.map(|k| k.posterior_ap_mm))]
        {
            let mut d: Free<Vec<f64>> = Free::default();
            for fe in self.a.ap_flexions() {
                let (Some(a), Some(b)) = (self.a.ap_end(test, fe), self.b.ap_end(test, fe)) else { continue };
                let (x, y) = (a.predicted(), b.predicted());
                FREE.into_iter().for_each(|c| d[c].push(x[c] - y[c]));
                forces.extend(self.a.groups(a).iter().zip(self.b.groups(b)).map(|(f, g)| f - g));
            }
            for c in [AP, VV, IE, ML, SI] {
                let quantity = format!("{}_{c}", test.name());
                self.push(out, ("ap_laxity", &quantity, c.unit()), &d[c], figure.filter(|_| c == AP));
            }
        }
        self.push(out, ("ap_laxity", "ligament_forces", "n"), &forces, known.map(|k| k.ap_forces_n));
    }

    fn passive(&self, out: &mut Vec<Difference>) {
        let known = self.published();
        let figures =
            known.map(|k| Free([Some(k.passive_vv_deg), Some(k.passive_ie_deg), None, Some(k.passive_ap_mm), None]));
        let answered = self.b.passive_flexion.iter().filter(|r| Source::has_answer(r));
        let curve: Vec<PoseSpec> = answered.map(|r| r.pose).collect();
        let d = along(&self.a.passive_flexion, &curve);
        for c in FREE {
            let figure = figures.and_then(|f| f[c]);
            self.push(out, ("passive_flexion", c.name(), c.unit()), &d[c], figure);
        }
    }

    fn pivot(&self, out: &mut Vec<Difference>, acl: bool) {
        let (Some(a), Some(b)) = (self.a.pivot_end(acl), self.b.pivot_end(acl)) else { return };
        let protocol = if acl { "pivot_shift" } else { "pivot_shift_no_acl" };
        let known = |s: &Source| published::pivot_shift(&s.specimen, &s.name, acl);
        let first = out.len();
        let (x, y) = (a.predicted(), b.predicted());
        for c in FREE {
            let figure = known(self.a).zip(known(self.b)).map(|(p, q)| (p.pose().free()[c] - q.pose().free()[c]).abs());
            self.push(out, (protocol, c.name(), c.unit()), &[x[c] - y[c]], figure);
        }
        let d: Vec<f64> = self.a.groups(a).iter().zip(self.b.groups(b)).map(|(f, g)| f - g).collect();
        let figure = known(self.a).zip(known(self.b)).map(|(p, q)| {
            let of = |p: &published::PivotShift, g: &str| p.forces_n.get(g).copied().unwrap_or(0.0);
            let d = attachments::groups::GROUPS.map(|(g, _)| of(p, g) - of(q, g));
            (d.iter().map(|x| x * x).sum::<f64>() / 9.0).sqrt()
        });
        self.push(out, (protocol, "ligament_forces", "n"), &d, figure);
        if Source::is_dislocated(a) || Source::is_dislocated(b) {
            out[first..].iter_mut().for_each(|d| d.note = "dislocated: unreliable".into());
        }
    }

    fn parameters(&self, out: &mut Vec<Difference>) {
        let known = |s: &Source| published::parameters(&s.specimen, &s.name).map(parameters::numbered);
        let known = known(self.a).zip(known(self.b));
        for kind in parameters::KINDS {
            let d = parameters::percent(&self.a.parameters, &self.b.parameters, kind);
            let figure = known.as_ref().and_then(|(p, q)| parameters::mean(&parameters::percent(p, q, kind)));
            let value = parameters::mean(&d).unwrap_or(f64::NAN);
            if let Some(k) = self.push(out, ("parameters", kind.name, "percent"), &[value], figure) {
                out[k].count = d.len();
                out[k].note = parameters::NOTE.into();
            }
        }
    }
}

/// Differences of a source's passive flexion from a measured one.
fn against_measured(a: &Source, name: &str, m: &Passive, out: &mut Vec<Difference>) {
    let d = along(&a.passive_flexion, &m.poses);
    for c in FREE {
        let count = d[c].len();
        if count > 0 {
            out.push(Difference {
                a: name.to_owned(),
                b: format!("measured {}", m.name),
                protocol: "passive_flexion".into(),
                quantity: c.name().into(),
                unit: c.unit().into(),
                rmsd: (d[c].iter().map(|x| x * x).sum::<f64>() / count as f64).sqrt(),
                count,
                published: None,
                note: String::new(),
                measured: true,
            });
        }
    }
}

/// Differences of results from a curve interpolated at their flexion, a coordinate each. Flexions beyond the curve are left out, and results without
/// equilibrium.
fn along(results: &[TrialResult], curve: &[PoseSpec]) -> Free<Vec<f64>> {
    let mut sorted: Vec<&PoseSpec> = curve.iter().filter(|p| p.fe_deg.is_finite()).collect();
    sorted.sort_by(|a, b| a.fe_deg.total_cmp(&b.fe_deg));
    let mut out: Free<Vec<f64>> = Free::default();
    for r in results.iter().filter(|r| Source::has_answer(r)) {
        let fe = r.pose.fe_deg;
        let k = sorted.partition_point(|p| p.fe_deg < fe);
        let near = |k: usize| sorted.get(k).filter(|p| (p.fe_deg - fe).abs() < 0.5);
        let there = match (k.checked_sub(1).and_then(|j| sorted.get(j)), sorted.get(k)) {
            (Some(a), Some(b)) => {
                let t = (fe - a.fe_deg) / (b.fe_deg - a.fe_deg).max(1e-9);
                let (x, y) = (a.free(), b.free());
                Some(Free::from_fn(|c| x[c] + t * (y[c] - x[c])))
            }
            (None, _) => near(0).map(|p| p.free()),
            (_, None) => near(sorted.len().saturating_sub(1)).map(|p| p.free()),
        };
        if let Some(there) = there {
            let here = r.predicted();
            FREE.into_iter().for_each(|c| out[c].push(here[c] - there[c]));
        }
    }
    out
}

/// Rows of the mean differences, where there are several knees.
fn means(sources: &[Source], out: &mut Vec<Difference>) {
    if sources.windows(2).all(|w| w[0].specimen == w[1].specimen) {
        return;
    }
    let sets: Vec<_> = sources.iter().map(|s| (s.specimen.as_str(), s.name.as_str(), s.parameters.clone())).collect();
    let published = sources.iter().all(|s| published::parameters(&s.specimen, &s.name).is_some());
    for kind in parameters::KINDS {
        for (between, words) in [(false, "models of a knee"), (true, "knees, same data")] {
            let Some(rmsd) = parameters::mean_difference(&sets, kind, between) else { continue };
            out.push(Difference {
                a: "all".into(),
                b: words.into(),
                protocol: "parameters".into(),
                quantity: kind.name.into(),
                unit: "percent".into(),
                rmsd,
                count: sets.len(),
                published: published.then_some(kind.published[usize::from(between)]),
                note: parameters::NOTE.into(),
                measured: false,
            });
        }
    }
}

#[cfg(test)]
mod tests;
