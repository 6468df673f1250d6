//! The fit: slopes of the rigid law's segments, none negative, by least squares.

use super::pose::{Rigid, Start};
use super::{ContactLawOptions, Curve, PUBLISHED, fault};
use crate::StageError;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use sim::contact::Contact;

/// The rigid law at one flexion, at the deformable model's approaches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigidCurve {
    /// Flexion [deg].
    pub flexion_deg: f64,
    /// Approach [mm].
    pub approach_mm: Vec<f64>,
    /// Force with the fitted law [N].
    pub force_n: Vec<f64>,
    /// Force with the published law [N].
    pub published_force_n: Vec<f64>,
    /// Contact area of the rigid cartilages [mm2].
    pub area_mm2: Vec<f64>,
}

/// The result.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// Pressures at the law's overclosures [MPa].
    pub pressure_mpa: Vec<f64>,
    /// Largest and root mean square difference of force [%], and of area at equal force [%].
    pub worst_percent: f64,
    /// As told.
    pub rms_percent: f64,
    /// As told.
    pub area_percent: f64,
    /// The curves of the fitted law.
    pub curves: Vec<RigidCurve>,
}

/// Steps of the table of approaches.
const STEPS: usize = 120;
/// Rounds in which the area's part is made linear anew.
const ROUNDS: usize = 8;

/// Weight that draws the slopes of neighbouring segments together, of a level's [-].
const EVEN: f64 = 0.05;

/// What the segments of the law carry at each approach of a fine table, at one flexion.
struct Table {
    step_mm: f64,
    /// By approach: force of each segment at unit slope [N per MPa/mm].
    force: Vec<Vec<f64>>,
    area: Vec<f64>,
}

impl Table {
    fn at<T>(&self, approach_mm: f64, value: impl Fn(usize) -> T) -> (T, T, f64) {
        let x = (approach_mm / self.step_mm).clamp(0.0, (self.area.len() - 1) as f64);
        let n = (x as usize).min(self.area.len() - 2);
        (value(n), value(n + 1), x - n as f64)
    }

    fn forces(&self, approach_mm: f64) -> Vec<f64> {
        let (a, b, t) = self.at(approach_mm, |n| &self.force[n]);
        a.iter().zip(b).map(|(a, b)| a + (b - a) * t).collect()
    }

    fn area(&self, approach_mm: f64) -> f64 {
        let (a, b, t) = self.at(approach_mm, |n| self.area[n]);
        a + (b - a) * t
    }

    fn force(&self, approach_mm: f64, slopes: &[f64]) -> f64 {
        self.forces(approach_mm).iter().zip(slopes).map(|(g, s)| g * s).sum()
    }

    /// Approach at which the law carries a force.
    fn approach(&self, force_n: f64, slopes: &[f64]) -> f64 {
        let (mut low, mut high) = (0.0, self.step_mm * (self.area.len() - 1) as f64);
        for _ in 0..50 {
            let middle = f64::midpoint(low, high);
            if self.force(middle, slopes) < force_n { low = middle } else { high = middle }
        }
        f64::midpoint(low, high)
    }
}

/// Fits the law to all flexions together.
pub(super) fn fit(
    rigid: &Rigid,
    starts: &[Start],
    curves: &[Curve],
    o: &ContactLawOptions,
) -> Result<Fitted, StageError> {
    let segments = segments(&rigid.contact, &o.overclosure_mm)?;
    let tables: Vec<Table> = starts.iter().zip(curves).map(|(s, c)| table(rigid, s, c, &segments)).collect();
    let rows: Vec<Row> = curves
        .iter()
        .enumerate()
        .flat_map(|(n, c)| c.levels.iter().map(move |l| (n, l)))
        .filter(|(_, l)| l.force_n >= o.least_force_n && l.force_n > 0.0)
        .map(|(flexion, l)| Row { flexion, approach: l.shift_mm, force: l.force_n, area: l.area_mm2 })
        .collect();
    if rows.len() < o.overclosure_mm.len() - 1 {
        return Err(StageError::Knee(format!(
            "{} levels above {} N, at least {} were expected: raise levels",
            rows.len(),
            o.least_force_n,
            o.overclosure_mm.len() - 1
        )));
    }
    let mut slopes = least_squares(&tables, &rows, &[], 0.0);
    if o.area_weight > 0.0 {
        for _ in 0..ROUNDS {
            slopes = least_squares(&tables, &rows, &slopes, o.area_weight);
        }
    }
    Ok(told(rigid, starts, (&tables, &rows, curves), &slopes, o))
}

struct Row {
    flexion: usize,
    approach: f64,
    force: f64,
    area: f64,
}

/// A contact law for each segment: unit slope within it, constant beyond.
fn segments(contact: &Contact, x: &[f64]) -> Result<Vec<Contact>, StageError> {
    let last = x.len() - 2;
    (0..=last)
        .map(|k| {
            let mut over = vec![0.0];
            let mut pressure = vec![0.0];
            if k > 0 {
                over.push(x[k]);
                pressure.push(0.0);
            }
            over.push(x[k + 1]);
            pressure.push(x[k + 1] - x[k]);
            if k < last {
                over.push(x[k + 1] + 1.0);
                pressure.push(x[k + 1] - x[k]);
            }
            contact.with_law(&over, &pressure).map_err(fault)
        })
        .collect()
}

fn table(rigid: &Rigid, start: &Start, curve: &Curve, segments: &[Contact]) -> Table {
    let furthest = curve.levels.iter().map(|l| l.shift_mm).fold(0.1, f64::max);
    let step_mm = 1.5 * furthest / STEPS as f64;
    let rows: Vec<(Vec<f64>, f64)> = (0..=STEPS)
        .map(|n| {
            let d = step_mm * n as f64;
            let force = segments.iter().map(|c| rigid.force(c, &start.pose, d).0).collect();
            (force, rigid.force(&rigid.contact, &start.pose, d).1)
        })
        .collect();
    let (force, area) = rows.into_iter().unzip();
    Table { step_mm, force, area }
}

/// Slopes by least squares of relative differences: of force, and of area at equal force made linear about `about`.
fn least_squares(tables: &[Table], rows: &[Row], about: &[f64], weight: f64) -> Vec<f64> {
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for row in rows {
        let table = &tables[row.flexion];
        a.push(table.forces(row.approach).iter().map(|g| g / row.force).collect::<Vec<_>>());
        b.push(1.0);
        if weight > 0.0 && row.area > 0.0 {
            let area = |s: &[f64]| table.area(table.approach(row.force, s)) / row.area;
            let now = area(about);
            let size = about.iter().copied().fold(0.0, f64::max).max(1e-3);
            let slope: Vec<f64> = (0..about.len())
                .map(|k| {
                    let mut other = about.to_vec();
                    other[k] += 0.02 * size;
                    (area(&other) - now) / (0.02 * size)
                })
                .collect();
            let linear: f64 = slope.iter().zip(about).map(|(d, s)| d * s).sum();
            b.push(weight * (1.0 - now + linear));
            a.push(slope.iter().map(|d| weight * d).collect());
        }
    }
    // above the least force hardly any node overcloses by less than the first overclosures: neighbours are drawn together
    let one: Vec<[f64; 2]> = a.iter().zip(&b).map(|(row, b)| [row.iter().sum(), *b]).collect();
    let mean = one.iter().map(|[x, b]| x * b).sum::<f64>() / one.iter().map(|[x, _]| x * x).sum::<f64>().max(1e-30);
    let pull = EVEN * (rows.len() as f64).sqrt() / mean.max(1e-9);
    for k in 1..a.first().map_or(0, Vec::len) {
        let mut row = vec![0.0; a[0].len()];
        (row[k - 1], row[k]) = (-pull, pull);
        a.push(row);
        b.push(0.0);
    }
    not_negative(&a, &b)
}

/// Least squares with no unknown negative: the best of all sets of unknowns that are zero (there are few unknowns).
fn not_negative(a: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
    let n = a.first().map_or(0, Vec::len);
    let mut best = (f64::INFINITY, vec![0.0; n]);
    for set in 1u32..1 << n {
        let used: Vec<usize> = (0..n).filter(|k| set >> k & 1 == 1).collect();
        let matrix = DMatrix::from_fn(a.len(), used.len(), |i, j| a[i][used[j]]);
        let right = DVector::from_column_slice(b);
        let Ok(solution) = matrix.clone().svd(true, true).solve(&right, 1e-10) else { continue };
        if solution.iter().any(|s| *s < 0.0) {
            continue;
        }
        let miss = (matrix * &solution - right).norm_squared();
        if miss < best.0 {
            let mut slopes = vec![0.0; n];
            used.iter().zip(solution.iter()).for_each(|(k, s)| slopes[*k] = *s);
            best = (miss, slopes);
        }
    }
    best.1
}

fn told(
    rigid: &Rigid,
    starts: &[Start],
    (tables, rows, curves): (&[Table], &[Row], &[Curve]),
    slopes: &[f64],
    o: &ContactLawOptions,
) -> Fitted {
    let mut pressure_mpa = vec![0.0];
    for (w, s) in o.overclosure_mm.windows(2).zip(slopes) {
        pressure_mpa.push(pressure_mpa.last().copied().unwrap_or(0.0) + s * (w[1] - w[0]));
    }
    let percent = |x: f64| 100.0 * x;
    let force: Vec<f64> = rows.iter().map(|r| tables[r.flexion].force(r.approach, slopes) / r.force - 1.0).collect();
    let area: Vec<f64> = rows
        .iter()
        .filter(|r| r.area > 0.0)
        .map(|r| tables[r.flexion].area(tables[r.flexion].approach(r.force, slopes)) / r.area - 1.0)
        .collect();
    let rms = |x: &[f64]| (x.iter().map(|d| d * d).sum::<f64>() / x.len().max(1) as f64).sqrt();
    let published = PUBLISHED;
    let law = rigid.contact.with_law(&published.0, &published.1).ok();
    let curves = starts
        .iter()
        .zip(curves)
        .zip(tables)
        .map(|((s, c), t)| {
            let approach: Vec<f64> = c.levels.iter().map(|l| l.shift_mm).collect();
            RigidCurve {
                flexion_deg: s.flexion_deg,
                force_n: approach.iter().map(|d| t.force(*d, slopes)).collect(),
                published_force_n: law
                    .iter()
                    .flat_map(|law| approach.iter().map(|d| rigid.force(law, &s.pose, *d).0))
                    .collect(),
                area_mm2: approach.iter().map(|d| t.area(*d)).collect(),
                approach_mm: approach,
            }
        })
        .collect();
    Fitted {
        pressure_mpa,
        worst_percent: percent(force.iter().fold(0.0, |m, d| d.abs().max(m))),
        rms_percent: percent(rms(&force)),
        area_percent: percent(rms(&area)),
        curves,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_without_negative_unknowns() {
        let a = [vec![1.0, 0.0, 1.0], vec![0.0, 1.0, 1.0], vec![1.0, 1.0, 0.0], vec![1.0, 2.0, 3.0]];
        let exact = [0.5, 2.0, 1.0];
        let b: Vec<f64> = a.iter().map(|r| r.iter().zip(exact).map(|(x, y)| x * y).sum()).collect();
        assert!(not_negative(&a, &b).iter().zip(exact).all(|(x, y)| (x - y).abs() < 1e-12));
        let b = [1.0, -3.0, 1.0, 1.0];
        let found = not_negative(&a, &b);
        assert!(found.iter().all(|x| *x >= 0.0) && found[1] == 0.0, "{found:?}");
    }
}
