//! A meniscus of the literature's size: along the rim of its plateau, on the tibial cartilage, under the femur brought down until it nearly touches.
//!
//! The upper face is the femoral cartilage's, no higher than menisci are. So a meniscus fits the condyle in the pose of CT, which is near extension.

use super::Between;
use super::sizes::{SIZES, Size};
use crate::StageError;
use meshes::query::SurfaceQuery;
use meshes::{Point, Vector};
use sim::spec::SectionSpec;
use std::f64::consts::{FRAC_PI_2, PI};

/// Gaps between sections, a wedge [-], and points across a section [-].
pub(super) const GAPS_PER_WEDGE: usize = 2;
pub(super) const POINTS: usize = 6;
/// Height of the inner edge [mm]: where cartilages are nearer to each other there is no room for one.
pub(super) const EDGE_MM: f64 = 0.5;
/// Least width [mm], and widest share of the way from the rim to the plateau's centre [-].
const LEAST_WIDTH_MM: f64 = 3.0;
const WIDEST: f64 = 0.8;
/// Angle between a root and the end of its horn, seen from the plateau's centre [rad]: the horn's ligament is some millimetres long.
const ROOT_ANGLE: f64 = 0.25;
/// A horn ends no further round its plateau than this [rad]: there it leaves the cartilage for its root.
const FURTHEST: f64 = 2.1;
/// Angles at which the rim is read, and terms by which it is smoothed [-].
const READINGS: usize = 120;
const TERMS: usize = 4;
/// Step in which a face is felt for room [mm], and reach of a ray [mm].
const STEP_MM: f64 = 0.25;
const REACH_MM: f64 = 60.0;

/// Sections from the anterior to the posterior horn.
pub(super) fn sections(plateau: &Plateau, size: &Size, roots: [Point; 2]) -> Vec<SectionSpec> {
    // the anterior root lies to the front, the posterior one to the back, wherever a turn begins
    let [from, to] = roots.map(|root| plateau.angle(&root));
    let ends = [
        (from.rem_euclid(2.0 * PI) - ROOT_ANGLE).clamp(FRAC_PI_2, FURTHEST),
        (-(-to).rem_euclid(2.0 * PI) + ROOT_ANGLE).clamp(-FURTHEST, -FRAC_PI_2),
    ];
    let scale = plateau.scale(size, ends);
    let gaps = GAPS_PER_WEDGE * super::WEDGES;
    let sections = plateau.spaced(ends, gaps).into_iter().map(|angle| plateau.section(size, scale, angle));
    sections.collect()
}

/// A plateau seen from above, and the femur over it.
pub(super) struct Plateau<'a> {
    between: &'a Between<'a>,
    tibia: SurfaceQuery,
    femur: SurfaceQuery,
    /// Its middle.
    pub(super) centre: Point,
    /// Seen from above [mm2].
    pub(super) area: f64,
    /// Distance of the rim from the centre [mm]: terms of a Fourier series by the angle.
    rim: [[f64; 2]; TERMS],
    /// Least gap between both cartilages [mm].
    touch: f64,
}

impl<'a> Plateau<'a> {
    /// Errors: cartilages that do not lie over one another.
    pub(super) fn new(between: &'a Between<'a>) -> Result<Plateau<'a>, StageError> {
        Plateau::under(between).ok_or_else(|| {
            StageError::part(between.name(), "the cartilages do not lie over one another, so that it has no room")
        })
    }

    fn under(between: &'a Between<'a>) -> Option<Plateau<'a>> {
        let (tibia, femur) = (SurfaceQuery::new(between.tibia)?, SurfaceQuery::new(between.femur)?);
        let up = between.frame.superior;
        let (mut sum, mut area) = (Vector::zeros(), 0.0);
        for t in 0..between.tibia.triangles.len() {
            let flat = 0.5 * between.tibia.area_vector(t).dot(&up).max(0.0);
            let [a, b, c] = between.tibia.corners(t);
            sum += (a.coords + b.coords + c.coords) * (flat / 3.0);
            area += flat;
        }
        if area.is_nan() || area <= 0.0 {
            return None;
        }
        let centre = Point::from(sum / area);
        let mut out = Plateau { between, tibia, femur, centre, area, rim: [[0.0; 2]; TERMS], touch: 0.0 };
        out.rim = out.outline();
        let gaps = between.tibia.vertices.iter().filter_map(|p| out.femur_above(p));
        out.touch = gaps.min_by(f64::total_cmp)?;
        Some(out)
    }

    /// Angle of a point seen from the centre: 0 outwards, a quarter turn forwards.
    fn angle(&self, p: &Point) -> f64 {
        let d = p - self.centre;
        let (out, front) = (d.dot(&self.between.outwards()), d.dot(&self.between.frame.anterior));
        front.atan2(out)
    }

    fn way(&self, angle: f64) -> Vector {
        self.between.outwards() * angle.cos() + self.between.frame.anterior * angle.sin()
    }

    /// The rim's distance at an angle.
    fn radius(&self, angle: f64) -> f64 {
        self.rim
            .iter()
            .enumerate()
            .map(|(n, [c, s])| {
                let (sin, cos) = (n as f64 * angle).sin_cos();
                c * cos + s * sin
            })
            .sum()
    }

    /// The furthest of the cartilage in each direction, smoothed.
    fn outline(&self) -> [[f64; 2]; TERMS] {
        let mut furthest = [0.0f64; READINGS];
        let width = 2.0 * PI / READINGS as f64;
        let up = self.between.frame.superior;
        for t in 0..self.between.tibia.triangles.len() {
            let corners = self.between.tibia.corners(t);
            for k in 0..3 {
                // points along an edge, so that a coarse mesh leaves no angle empty
                for share in [0.0, 0.25, 0.5, 0.75] {
                    let p = corners[k] + (corners[(k + 1) % 3] - corners[k]) * share;
                    let d = p - self.centre;
                    let flat = (d - up * d.dot(&up)).norm();
                    let slot = ((self.angle(&p) + PI) / width) as usize % READINGS;
                    furthest[slot] = furthest[slot].max(flat);
                }
            }
        }
        let mut terms = [[0.0; 2]; TERMS];
        for (slot, r) in furthest.iter().enumerate() {
            let angle = (slot as f64 + 0.5) * width - PI;
            for (n, term) in terms.iter_mut().enumerate() {
                let share = if n == 0 { 1.0 } else { 2.0 } / READINGS as f64;
                let (sin, cos) = (n as f64 * angle).sin_cos();
                *term = [term[0] + share * r * cos, term[1] + share * r * sin];
            }
        }
        terms
    }

    /// Height of the femoral cartilage above a point [mm].
    fn femur_above(&self, p: &Point) -> Option<f64> {
        let up = self.between.frame.superior;
        // from below, so that cartilages that touch are found too
        const BELOW: f64 = 2.0;
        let hit = self.femur.ray(&(p - up * BELOW), &up, REACH_MM)?;
        Some((hit.point - p).dot(&up))
    }

    /// The tibial cartilage below a place.
    pub(super) fn on_tibia(&self, place: &Point) -> Option<Point> {
        let up = self.between.frame.superior;
        self.tibia.ray(&(place + up * (0.5 * REACH_MM)), &-up, REACH_MM).map(|h| h.point)
    }

    /// Room between tibia and femur, when the femur is brought down until it bears on the menisci [mm].
    pub(super) fn room(&self, p: &Point) -> f64 {
        self.femur_above(p).map_or(f64::INFINITY, |gap| gap - self.touch + SIZES.fit.clearance_mm)
    }

    /// Of a size at the anterior horn, the body and the posterior horn, that at an angle.
    fn along([front, body, back]: [f64; 3], angle: f64) -> f64 {
        let horn = if angle > 0.0 { front } else { back };
        let share = if angle.abs() >= FRAC_PI_2 { 1.0 } else { angle.sin().powi(2) };
        body + (horn - body) * share
    }

    fn width(&self, size: &Size, scale: f64, angle: f64) -> f64 {
        let radius = self.radius(angle);
        (scale * Self::along(size.width_mm, angle)).clamp(LEAST_WIDTH_MM.min(WIDEST * radius), WIDEST * radius)
    }

    /// Factor on the widths with which the plateau is covered as menisci cover it.
    fn scale(&self, size: &Size, ends: [f64; 2]) -> f64 {
        let covered = |scale: f64| {
            let step = (ends[0] - ends[1]) / READINGS as f64;
            let at = |n: usize| ends[1] + (n as f64 + 0.5) * step;
            let ring = (0..READINGS).map(at).map(|angle| {
                let (outer, width) = (self.radius(angle), self.width(size, scale, angle));
                0.5 * (outer * outer - (outer - width).powi(2)) * step
            });
            ring.sum::<f64>() / self.area
        };
        let (mut low, mut high) = (0.5, 2.0);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if covered(middle) < size.coverage { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// Angles from end to end at which sections are about equally far apart along the rim.
    fn spaced(&self, [from, to]: [f64; 2], gaps: usize) -> Vec<f64> {
        let fine = 20 * gaps;
        let angle = |n: usize| from + (to - from) * n as f64 / fine as f64;
        let mut sums = vec![0.0];
        for n in 0..fine {
            let sum = sums[n] + self.radius(0.5 * (angle(n) + angle(n + 1)));
            sums.push(sum);
        }
        let whole = sums[fine];
        (0..=gaps)
            .map(|k| angle(sums.partition_point(|s| *s < whole * k as f64 / gaps as f64 - 1e-9).min(fine)))
            .collect()
    }

    /// The section at an angle.
    fn section(&self, size: &Size, scale: f64, angle: f64) -> SectionSpec {
        let (way, up) = (self.way(angle), self.between.frame.superior);
        let rim = self.radius(angle);
        // inwards from the last of the cartilage, as far as there is room
        let at = |r: f64| self.on_tibia(&(self.centre + way * r));
        let outer = (0..40).map(|n| rim - STEP_MM * f64::from(n)).find(|r| at(*r).is_some()).unwrap_or(rim);
        let wanted = self.width(size, scale, angle);
        let steps = (wanted / STEP_MM) as usize;
        let roomy = |n: &usize| at(outer - STEP_MM * *n as f64).is_some_and(|p| self.room(&p) >= EDGE_MM);
        let free = (0..=steps).take_while(roomy).count().saturating_sub(1) as f64 * STEP_MM;
        let width = free.max(LEAST_WIDTH_MM.min(wanted));
        let most = Self::along(size.height_mm, angle);
        let mut level = self.centre;
        let (mut lower, mut upper) = (Vec::new(), Vec::new());
        for k in (0..POINTS).rev() {
            let r = outer - width * (1.0 - k as f64 / (POINTS - 1) as f64);
            let place = self.centre + way * r;
            let on = at(r).unwrap_or(place + up * (level - place).dot(&up));
            level = on;
            lower.insert(0, on);
            upper.insert(0, on + up * self.room(&on).clamp(EDGE_MM, most));
        }
        SectionSpec { lower, upper }
    }
}
