//! A meniscus as a segmentation shows it: wedges across the centreline of the segmented body, from the end of one horn to that of the other.
//!
//! Widths, heights and both faces are the body's. A face that lies about a voxel off a cartilage is laid on it, since segmentations tell gaps no finer.

use super::Between;
use super::atlas::{EDGE_MM, GAPS_PER_WEDGE, POINTS, Plateau};
use super::centreline::{Centreline, Column, Flat, centreline};
use crate::StageError;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use sim::spec::SectionSpec;

/// Smallest body [mm3]; menisci have 1000 to 4000.
const LEAST_MM3: f64 = 300.0;
/// Furthest that the middle of a body lies from that of its plateau [mm].
const FURTHEST_MM: f64 = 25.0;
/// Distance of columns [mm].
const GRID_MM: f64 = 0.5;
/// Step across a section [mm], and furthest edge from the centreline [mm].
const STEP_MM: f64 = 0.1;
const MOST_HALF_WIDTH_MM: f64 = 14.0;
/// A section ends at its periphery where it falls below the second of these shares of its height [-]. Beyond where it falls below the first its faces go on
/// level: the wall of a voxelised body is round.
const WALL: [f64; 2] = [0.75, 0.25];
/// First and last section, from the ends of the body, and from where on a section is taken as the body has it [mm]: its ends are round.
const END_MM: [f64; 2] = [0.5, 1.5];
/// Places beside a section, in gaps of sections [-], whose faces are averaged with it: a voxel's steps even out.
const BESIDE: [f64; 5] = [-0.5, -0.25, 0.0, 0.25, 0.5];
/// A face is laid on a cartilage wholly up to the first distance, and not at all beyond the second [mm]: about a voxel of a coarse picture.
const SEAT_MM: [f64; 2] = [0.75, 1.5];

/// The shape of a segmented meniscus.
pub(super) struct Own {
    /// From the anterior to the posterior horn.
    pub(super) sections: Vec<SectionSpec>,
    /// Ends of the horns, at the height of the centreline's plane.
    pub(super) roots: [Point; 2],
}

/// The meniscus that `body` shows, a closed surface in CT coordinates.
///
/// Errors: a body that is too small, lies elsewhere, or is no ring open inwards.
pub(super) fn own(between: &Between, plateau: &Plateau, body: &TriMesh) -> Result<Own, StageError> {
    shape(between, plateau, body).map_err(|what| {
        StageError::part(
            between.name(),
            format_args!(
                "{what}; mend its label, leave it out of [segmentation], or build with assemble.menisci=atlas"
            ),
        )
    })
}

fn shape(between: &Between, plateau: &Plateau, body: &TriMesh) -> Result<Own, String> {
    let seen = Seen::new(between, plateau, body)?;
    let columns = seen.columns(body);
    let line = centreline(&columns)?;
    let gaps = GAPS_PER_WEDGE * super::WEDGES;
    let [from, to] = [line.ends[0] + END_MM[0], line.ends[1] - END_MM[0]];
    let gap = (to - from) / gaps as f64;
    let places: Vec<f64> = (0..=gaps).map(|n| from + gap * n as f64).collect();
    let mut edges = Vec::new();
    for t in &places {
        let edge = seen.edges(&line, *t);
        edges.push(
            edge.ok_or_else(|| format!("it is broken {:.0} mm from the end of its anterior horn", t - line.ends[0]))?,
        );
    }
    uncrossed(&line, &places, &mut edges);
    let sections = places.iter().zip(&edges).map(|(t, e)| seen.section(&line, (*t, gap), *e)).collect();
    let roots = line.ends.map(|t| seen.place(&line.at(t).0));
    Ok(Own { sections, roots })
}

/// The body over its plateau.
struct Seen<'a> {
    plateau: &'a Plateau<'a>,
    body: SurfaceQuery,
    out: Vector,
    front: Vector,
    up: Vector,
}

impl<'a> Seen<'a> {
    fn new(between: &Between, plateau: &'a Plateau<'a>, body: &TriMesh) -> Result<Seen<'a>, String> {
        let volume = body.volume();
        if volume < LEAST_MM3 {
            return Err(format!("its segmented body has {volume:.0} mm3, expected at least {LEAST_MM3:.0}"));
        }
        let (query, middle) =
            SurfaceQuery::new(body).zip(body.centroid()).ok_or("its segmented body has no surface")?;
        let (out, up) = (between.outwards(), between.frame.superior);
        if (middle - between.frame.origin).dot(&out) < 0.0 {
            return Err("its segmented body lies on the other plateau: the labels of both menisci are exchanged, or the side is wrong".into());
        }
        let off = (middle - plateau.centre).norm();
        if off > FURTHEST_MM {
            return Err(format!(
                "its segmented body lies {off:.0} mm from its plateau, expected at most {FURTHEST_MM:.0}"
            ));
        }
        Ok(Seen { plateau, body: query, out, front: between.frame.anterior, up })
    }

    /// A place seen from above, as a point level with the plateau's centre.
    fn place(&self, p: &Flat) -> Point {
        self.plateau.centre + self.out * p.x + self.front * p.y
    }

    /// Lower and upper end of the body at a place, above the plateau's centre [mm].
    fn column(&self, p: &Flat) -> Option<[f64; 2]> {
        const REACH_MM: f64 = 60.0;
        let place = self.place(p);
        let below = self.body.ray(&(place - self.up * REACH_MM), &self.up, 2.0 * REACH_MM)?;
        let above = self.body.ray(&(place + self.up * REACH_MM), &-self.up, 2.0 * REACH_MM)?;
        Some([below.distance - REACH_MM, REACH_MM - above.distance])
    }

    fn height(&self, p: &Flat) -> f64 {
        self.column(p).map_or(0.0, |[l, u]| u - l)
    }

    /// Columns on a grid about the body.
    fn columns(&self, body: &TriMesh) -> Vec<Column> {
        let flat = body.vertices.iter().map(|p| {
            let d = p - self.plateau.centre;
            Flat::new(d.dot(&self.out), d.dot(&self.front))
        });
        let none = (Flat::repeat(f64::MAX), Flat::repeat(f64::MIN));
        let (low, high) = flat.fold(none, |(lo, hi), p| (lo.inf(&p), hi.sup(&p)));
        let count = (high - low).map(|x| (x / GRID_MM) as usize);
        let at = |i: usize, j: usize| low + Flat::new(i as f64 + 0.5, j as f64 + 0.5) * GRID_MM;
        (0..=count.x)
            .flat_map(|i| (0..=count.y).map(move |j| at(i, j)))
            .map(|at| Column { at, height: self.height(&at) })
            .filter(|c| c.height > 0.0)
            .collect()
    }

    /// Inner edge, outer edge and wall of the section at a length along the centreline, from it outwards [mm].
    fn edges(&self, line: &Centreline, t: f64) -> Option<[f64; 3]> {
        let (at, normal) = across(line, within(line, t));
        let steps = (MOST_HALF_WIDTH_MM / STEP_MM) as i32;
        let height = |n: i32| self.height(&(at + normal * (STEP_MM * f64::from(n))));
        let start = (0..=steps / 4).flat_map(|n| [n, -n]).find(|n| height(*n) > 0.0)?;
        let inner = (start - steps..=start).rev().take_while(|n| height(*n) > 0.0).last()?;
        let outer = (start..=start + steps).take_while(|n| height(*n) > 0.0).last()?;
        let most = (inner..=outer).map(height).fold(0.0, f64::max);
        let [wall, outer] = WALL.map(|share| (inner..=outer).rev().find(|n| height(*n) >= share * most));
        let edges = [inner, outer?, wall?];
        (edges[2] > inner).then(|| edges.map(|n| STEP_MM * f64::from(n)))
    }

    /// Lower and upper end at a place beside the centreline, averaged along it.
    fn faces(&self, line: &Centreline, (t, gap): (f64, f64), r: f64) -> Option<[f64; 2]> {
        let columns = BESIDE.iter().filter_map(|b| {
            let (at, normal) = across(line, within(line, t + b * gap));
            self.column(&(at + normal * r))
        });
        let (sum, count) = columns.fold(([0.0; 2], 0), |([l, u], n), c| ([l + c[0], u + c[1]], n + 1));
        (count > 0).then(|| sum.map(|x| x / f64::from(count)))
    }

    fn section(&self, line: &Centreline, at: (f64, f64), [inner, outer, wall]: [f64; 3]) -> SectionSpec {
        let (middle, normal) = across(line, at.0);
        let point = |r: f64| self.place(&(middle + normal * r));
        let faces = |r: f64| {
            let [low, high] = self.faces(line, at, r.min(wall)).unwrap_or([0.0; 2]);
            self.seated(&(point(r) + self.up * low), high - low)
        };
        // between cartilages that nearly touch there is no room for the inner edge
        let steps = ((outer - inner) / STEP_MM) as usize;
        let roomy = |n: &usize| self.plateau.room(&faces(inner + STEP_MM * *n as f64).0) >= EDGE_MM;
        let inner = inner + STEP_MM * (0..steps / 2).find(roomy).unwrap_or(0) as f64;
        let (lower, upper) =
            (0..POINTS).map(|k| faces(inner + (outer - inner) * k as f64 / (POINTS - 1) as f64)).unzip();
        SectionSpec { lower, upper }
    }

    /// A column's ends laid on the cartilages that they lie about a voxel from, and never within the femur's.
    fn seated(&self, lower: &Point, height: f64) -> (Point, Point) {
        let low = self.plateau.on_tibia(lower).map_or(0.0, |on| (on - lower).dot(&self.up));
        let seat = lower + self.up * (low * held(low));
        let own = height + (lower - seat).dot(&self.up);
        let room = self.plateau.room(&seat);
        let spare = room - own;
        let high = if spare < 0.0 {
            room
        } else if spare.is_finite() {
            own + spare * held(spare)
        } else {
            own
        };
        (seat, seat + self.up * high.max(EDGE_MM))
    }
}

/// Share of a distance by which a face is moved onto a cartilage.
fn held(distance: f64) -> f64 {
    let [all, none] = SEAT_MM;
    ((none - distance.abs()) / (none - all)).clamp(0.0, 1.0)
}

/// The nearest length along the line at which the body is not rounded off.
fn within(line: &Centreline, t: f64) -> f64 {
    t.max(line.ends[0] + END_MM[1]).min(line.ends[1] - END_MM[1])
}

/// The centreline's place at a length along it, and the way outwards across it.
fn across(line: &Centreline, t: f64) -> (Flat, Flat) {
    let (at, way) = line.at(t);
    (at, Flat::new(-way.y, way.x))
}

/// Draws edges in where neighbouring sections would cross.
fn uncrossed(line: &Centreline, places: &[f64], edges: &mut [[f64; 3]]) {
    /// Least distance of neighbours at an edge, of that at the centreline [-], and how an edge is drawn in [-].
    const LEAST: f64 = 0.1;
    const DRAWN: f64 = 0.9;
    for _ in 0..30 {
        let mut crossed = false;
        for n in 1..places.len() {
            let ((a, before), (b, normal)) = (across(line, places[n - 1]), across(line, places[n]));
            let gap = b - a;
            let (head, tail) = edges.split_at_mut(n);
            // the wall is no edge
            for (one, other) in head[n - 1].iter_mut().zip(&mut tail[0]).take(2) {
                let moved = gap + normal * *other - before * *one;
                if moved.dot(&gap) < LEAST * gap.norm_squared() {
                    crossed = true;
                    (*one, *other) = (*one * DRAWN, *other * DRAWN);
                }
            }
        }
        if !crossed {
            return;
        }
    }
}
