//! The line along the middle of a ring that is open on one side, seen from above: a principal curve [hastie1989] from the front horn to the back one.
//!
//! Places are outwards and forwards of the middle of a plateau [mm]; the ring opens inwards.

use nalgebra::Vector2;
use std::f64::consts::{PI, TAU};

/// A place seen from above [mm]: outwards, forwards.
pub(super) type Flat = Vector2<f64>;

/// A column of a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column {
    /// Where it stands.
    pub(super) at: Flat,
    /// How high it is [mm].
    pub(super) height: f64,
}

/// Angles by which a ring is looked round, and share of their mean below which one counts as open [-].
const ANGLES: usize = 120;
const OPEN: f64 = 0.05;
/// A ring goes round the middle of its hull at least this far [deg]: menisci go round 210 to 340.
const LEAST_ROUND_DEG: f64 = 180.0;
/// A ring has no column nearer to the middle of its hull than this [mm].
const FREE_MM: f64 = 1.0;
/// Distance of knots [mm], about half as far apart as a ring is wide: a line through nearer ones winds from edge to edge. And how many there are.
const KNOT_MM: f64 = 6.0;
const KNOTS: [usize; 2] = [6, 16];
/// Rounds of the principal curve.
const ROUNDS: usize = 4;
/// An end grows by at most this in a round [mm], so that it does not reach the other horn.
const GROWTH_MM: f64 = 3.0;

/// The line.
#[derive(Clone, Debug)]
pub(super) struct Centreline {
    knots: Vec<Flat>,
    /// Length of the way from the first knot to each [mm].
    along: Vec<f64>,
    /// Where the ring begins and ends on it [mm]; it runs on straight beyond its knots.
    pub(super) ends: [f64; 2],
}

/// The line along the middle of `columns`. Errors say what is no ring, and of what.
pub(super) fn centreline(columns: &[Column]) -> Result<Centreline, String> {
    let (centre, from, round) = ring(columns)?;
    let width = round / KNOTS[1] as f64;
    let mut line = Centreline::through(&means(columns, KNOTS[1], |p| {
        let d = p - centre;
        // from the horn in front backwards, by way of outwards
        (from - d.y.atan2(d.x)).rem_euclid(TAU) / width
    }));
    for _ in 0..ROUNDS {
        let places: Vec<f64> = columns.iter().map(|c| line.project(&c.at)).collect();
        line.ends = places.iter().fold([f64::MAX, f64::MIN], |[a, b], t| [a.min(*t), b.max(*t)]);
        let (begin, whole) = (line.ends[0], line.ends[1] - line.ends[0]);
        let count = ((whole / KNOT_MM) as usize).clamp(KNOTS[0], KNOTS[1]);
        let slot = |p: &Flat| (line.project(p) - begin) / whole * count as f64;
        line = Centreline::through(&means(columns, count, slot));
    }
    let places = columns.iter().map(|c| line.project(&c.at));
    line.ends = places.fold([f64::MAX, f64::MIN], |[a, b], t| [a.min(t), b.max(t)]);
    Ok(line)
}

/// Centre of a ring, the angle at which it begins in front, and how far it goes round [rad].
fn ring(columns: &[Column]) -> Result<(Flat, f64, f64), String> {
    let centre = hull_centre(columns).ok_or("it has no extent")?;
    let mut round = [0.0; ANGLES];
    for c in columns {
        let d = c.at - centre;
        if d.norm() < FREE_MM {
            return Err("its middle is filled: it is a part of a ring alone, or a discoid meniscus".into());
        }
        round[((d.y.atan2(d.x) + PI) / TAU * ANGLES as f64) as usize % ANGLES] += c.height;
    }
    let mean = round.iter().sum::<f64>() / ANGLES as f64;
    let open = |n: usize| round[n % ANGLES] < OPEN * mean;
    let gap = |n: usize| (0..ANGLES).take_while(|k| open(n + k)).count();
    let (first, longest) = (0..ANGLES).map(|n| (n, gap(n))).fold((0, 0), |best, x| if x.1 > best.1 { x } else { best });
    let width = TAU / ANGLES as f64;
    let covered = TAU - longest as f64 * width;
    if longest == 0 {
        return Err("its ring is closed, where a meniscus is open towards the middle of the knee".into());
    }
    if covered.to_degrees() < LEAST_ROUND_DEG {
        return Err(format!(
            "its ring goes round {:.0} deg, expected at least {LEAST_ROUND_DEG:.0}",
            covered.to_degrees()
        ));
    }
    let middle = (first as f64 + 0.5 * longest as f64) * width - PI;
    if middle.cos() > 0.0 {
        return Err("its ring is open outwards, where a meniscus is open towards the middle of the knee".into());
    }
    Ok((centre, first as f64 * width - PI, covered))
}

/// The middle of the columns' convex hull: it lies in the opening, also of a ring that goes half way round.
fn hull_centre(columns: &[Column]) -> Option<Flat> {
    let mut points: Vec<Flat> = columns.iter().map(|c| c.at).collect();
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut hull: Vec<Flat> = Vec::new();
    // one side from left to right, then the other back
    for pass in 0..2 {
        let base = hull.len() + 1;
        let ordered: Vec<&Flat> = if pass == 0 { points.iter().collect() } else { points.iter().rev().collect() };
        for p in ordered {
            while hull.len() > base
                && (hull[hull.len() - 1] - hull[hull.len() - 2]).perp(&(p - hull[hull.len() - 1])) <= 0.0
            {
                hull.pop();
            }
            hull.push(*p);
        }
        hull.pop();
    }
    let first = *hull.first()?;
    let (mut sum, mut area) = (Flat::zeros(), 0.0);
    for pair in hull.windows(2) {
        let part = 0.5 * (pair[0] - first).perp(&(pair[1] - first));
        sum += (first + pair[0] + pair[1]) * (part / 3.0);
        area += part;
    }
    (area > 1.0).then(|| sum / area)
}

/// Mean place of the columns in each of `count` slots along a way; empty slots are left out.
fn means(columns: &[Column], count: usize, slot: impl Fn(&Flat) -> f64) -> Vec<Flat> {
    let mut sums = vec![(Flat::zeros(), 0.0); count];
    for c in columns {
        let sum = &mut sums[(slot(&c.at).max(0.0) as usize).min(count - 1)];
        *sum = (sum.0 + c.at * c.height, sum.1 + c.height);
    }
    sums.into_iter().filter(|s| s.1 > 0.0).map(|(sum, height)| sum / height).collect()
}

impl Centreline {
    fn through(knots: &[Flat]) -> Centreline {
        let mut along = vec![0.0];
        for pair in knots.windows(2) {
            along.push(along[along.len() - 1] + (pair[1] - pair[0]).norm());
        }
        let whole = along[along.len() - 1];
        Centreline { knots: knots.to_vec(), along, ends: [0.0, whole] }
    }

    /// Unit direction at a knot: that of a parabola through it and two beside it.
    fn tangent(&self, n: usize) -> Flat {
        let (k, last) = (&self.knots, self.knots.len() - 1);
        let d = match n {
            _ if last < 2 => k[last] - k[0],
            0 => k[1] * 4.0 - k[0] * 3.0 - k[2],
            _ if n == last => k[n] * 3.0 - k[n - 1] * 4.0 + k[n - 2],
            _ => k[n + 1] - k[n - 1],
        };
        d.try_normalize(0.0).unwrap_or(-Flat::y())
    }

    /// Place and unit direction at a length along the line [mm].
    pub(super) fn at(&self, t: f64) -> (Flat, Flat) {
        let last = self.knots.len() - 1;
        if t <= 0.0 || last == 0 {
            return (self.knots[0] + self.tangent(0) * t, self.tangent(0));
        }
        if t >= self.along[last] {
            return (self.knots[last] + self.tangent(last) * (t - self.along[last]), self.tangent(last));
        }
        let n = (self.along.partition_point(|a| *a <= t) - 1).min(last - 1);
        let share = (t - self.along[n]) / (self.along[n + 1] - self.along[n]).max(1e-9);
        let tangent = self.tangent(n) * (1.0 - share) + self.tangent(n + 1) * share;
        let place = self.knots[n] * (1.0 - share) + self.knots[n + 1] * share;
        (place, tangent.try_normalize(0.0).unwrap_or_else(|| self.tangent(n)))
    }

    /// Length along the line [mm] at which it is nearest to a place.
    fn project(&self, p: &Flat) -> f64 {
        let last = self.knots.len() - 1;
        let (mut best, mut nearest) = (0.0, f64::MAX);
        for n in 0..last {
            let (a, d) = (self.knots[n], self.knots[n + 1] - self.knots[n]);
            let length = d.norm().max(1e-9);
            let mut t = (p - a).dot(&d) / length;
            let low = if n == 0 { -GROWTH_MM } else { 0.0 };
            let high = if n + 1 == last { length + GROWTH_MM } else { length };
            t = t.clamp(low, high);
            let off = (p - a - d * (t / length)).norm_squared();
            if off < nearest {
                (best, nearest) = (self.along[n] + t, off);
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of a ring of mean radius 15 mm and width 8 mm about a place, open inwards.
    fn arc(middle: Flat, half_round: f64) -> Vec<Column> {
        let grid = (-60..=60).flat_map(|i| (-60..=60).map(move |j| Flat::new(0.5 * f64::from(i), 0.5 * f64::from(j))));
        let inside = |d: &Flat| (11.0..19.0).contains(&d.norm()) && d.y.atan2(d.x).abs() < half_round;
        grid.filter(inside).map(|d| Column { at: middle + d, height: d.norm() - 9.0 }).collect()
    }

    #[test]
    fn the_line_runs_along_the_middle_from_horn_to_horn() {
        let middle = Flat::new(2.0, -3.0);
        for half in [1.4, 2.0, 2.7] {
            let line = centreline(&arc(middle, half)).unwrap();
            let round = 2.0 * half * 15.6;
            assert!(((line.ends[1] - line.ends[0]) / round - 1.0).abs() < 0.05, "{half}: {:?} of {round}", line.ends);
            let begin = line.at(line.ends[0]).0 - middle;
            assert!((begin.y.atan2(begin.x) - half).abs() < 0.12, "{half}: begins at {begin}");
            for share in [0.1, 0.3, 0.5, 0.7, 0.9] {
                let (p, way) = line.at(line.ends[0] + share * (line.ends[1] - line.ends[0]));
                let d = p - middle;
                assert!(
                    (d.norm() - 15.7).abs() < 0.3 && way.dot(&d).abs() < 0.15 * d.norm(),
                    "{half} {share}: {d} {way}"
                );
            }
        }
    }

    #[test]
    fn what_is_no_open_ring_is_told() {
        let of = |half: f64| centreline(&arc(Flat::zeros(), half)).unwrap_err();
        assert!(of(3.2).contains("closed"), "{}", of(3.2));
        assert!(of(0.9).contains("a part of a ring"), "{}", of(0.9));
        let turned: Vec<Column> = arc(Flat::zeros(), 2.0).iter().map(|c| Column { at: -c.at, ..*c }).collect();
        assert!(centreline(&turned).unwrap_err().contains("open outwards"));
        let mut filled = arc(Flat::zeros(), 2.0);
        filled.extend((-20..=20).map(|i| Column { at: Flat::new(0.5 * f64::from(i), 0.0), height: 3.0 }));
        assert!(centreline(&filled).unwrap_err().contains("discoid"));
    }
}
