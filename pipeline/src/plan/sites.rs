//! Where a graft leaves the bones: native footprints, points, the quadrant method, percentages of the plateau.

use super::file::SiteFile;
use meshes::frame::AnatomicalFrame;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use sim::mesh::MeshValue;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// The notch's roof is looked for so near the midline [mm]; ours: a notch is 15 to 25 mm wide.
const STRIP_MM: f64 = 4.0;
/// It lies so near the transepicondylar axis [mm]; ours.
const ROOF_NEAR_MM: f64 = 30.0;
/// It looks downwards and backwards by at least these parts of its normal [-]; ours: it leans by some 40 deg.
const ROOF_FACES: [f64; 2] = [0.3, 0.2];
/// A condyle begins so far lateral of the midline [mm]; ours.
const CONDYLE_FROM_MM: f64 = 8.0;
/// The notch's lateral wall lies no further lateral of the midline [mm]; ours: it is 4 to 15 mm from it.
const WALL_MM: f64 = 20.0;
/// The plateau's edges are those of the bone so near its origin's level [mm]; ours.
const PLATEAU_BAND_MM: f64 = 6.0;
/// A point may lie so far off the bone [mm]; ours.
const OFF_BONE_MM: f64 = 5.0;
/// A ray across a knee [mm].
const REACH_MM: f64 = 200.0;
/// A place moves along the bone by steps of at most this [mm]; ours: below the edges of a bone's triangles.
const STEP_MM: f64 = 0.5;
/// Where less than this share of a direction lies along the bone, the bone goes no further that way [-]; ours: 18 deg off a right angle.
const ALONG: f64 = 0.3;
/// Where dissected footprints of the ACL lie by the quadrant method: depth, height [%] [bernard1997].
pub(super) const ACL_PERCENT: [f64; 2] = [24.8, 28.5];
/// What the quadrant method knows as the inner wall of the lateral condyle: its grid, depth and height alike [%] [bernard1997].
pub(super) const WALL_PERCENT: std::ops::RangeInclusive<f64> = 0.0..=100.0;

/// A bone with its frame.
pub(super) struct Bone<'a> {
    pub(super) name: &'static str,
    pub(super) frame: &'a AnatomicalFrame,
    mesh: &'a TriMesh,
    query: SurfaceQuery,
    /// Found once: a sweep asks for them a thousand times.
    grid: OnceLock<Result<Quadrant, String>>,
    plateau: OnceLock<[[f64; 2]; 2]>,
}

/// The grid of the quadrant method: origin, axes deep to shallow and roof to below, and what 100 % is of each [mm].
struct Quadrant {
    origin: Point,
    axes: [Vector; 2],
    size: [f64; 2],
}

/// Femur and tibia of a model.
pub(super) fn bones<'a>(
    spec: &'a ModelSpec,
    surfaces: &'a BTreeMap<String, MeshValue>,
) -> Result<[Bone<'a>; 2], String> {
    let bone = |name: &'static str, frame: &'a AnatomicalFrame| {
        let body = spec.bodies.iter().find(|b| b.name == name).ok_or(format!("the model has no {name}"))?;
        let Some(MeshValue::Surface(mesh)) = surfaces.get(&body.bone) else {
            return Err(format!("the model's bone {} is no surface", body.bone));
        };
        let query = SurfaceQuery::new(mesh).ok_or(format!("the model's bone {} has no triangles", body.bone))?;
        Ok(Bone { name, frame, mesh, query, grid: OnceLock::new(), plateau: OnceLock::new() })
    };
    Ok([bone("femur", &spec.frames.femur)?, bone("tibia", &spec.frames.tibia)?])
}

impl Bone<'_> {
    /// Anterior, superior, lateral of the frame's origin [mm].
    fn placed(&self, p: &Point) -> [f64; 3] {
        let v = p - self.frame.origin;
        [v.dot(&self.frame.anterior), v.dot(&self.frame.superior), -v.dot(&self.frame.medial)]
    }

    /// A point of those coordinates.
    fn at(&self, [a, s, l]: [f64; 3]) -> Point {
        self.frame.origin + self.frame.anterior * a + self.frame.superior * s - self.frame.medial * l
    }

    /// The place that a file's site means, and how far it was moved [mm]; `native` gives the footprint's centre of a ligament on this bone.
    pub(super) fn place(
        &self,
        site: &SiteFile,
        native: impl Fn(&str) -> Result<Point, String>,
    ) -> Result<(Point, f64), String> {
        let on = match (&site.native, site.point_mm, site.quadrant_percent, site.plateau_percent) {
            (Some(name), ..) => native(name)?,
            (_, Some(p), ..) => {
                let p = Point::from(p);
                let near = self.query.nearest(&p);
                if near.distance > OFF_BONE_MM {
                    return Err(format!(
                        "{}.point_mm lies {:.1} mm off the bone; expected a point on it in the frame of the CT",
                        self.name, near.distance
                    ));
                }
                near.point
            }
            (_, _, Some(percent), _) => self.by_quadrant(percent)?,
            (_, _, _, Some(percent)) => self.on_plateau(percent)?,
            _ => return Err(format!("{} has no place", self.name)),
        };
        Ok(self.moved(on, site.move_mm))
    }

    /// A place moved along the bone: forwards, upwards, lateral, as far as a ruler on it measures [mm]. It ends where the bone turns away.
    /// Beside it stands how far it went [mm].
    pub(super) fn moved(&self, p: Point, by: [f64; 3]) -> (Point, f64) {
        let way = self.frame.anterior * by[0] + self.frame.superior * by[1] - self.frame.medial * by[2];
        let far = way.norm();
        if far == 0.0 {
            return (p, 0.0);
        }
        let (way, steps) = (way / far, (far / STEP_MM).ceil());
        let (mut near, mut went) = (self.query.nearest(&p), 0.0);
        for _ in 0..steps as usize {
            let normal = self.query.smooth_normal(&near);
            let along = way - normal * way.dot(&normal);
            let share = along.norm();
            if share < ALONG {
                break;
            }
            let next = self.query.nearest(&(near.point + along * (far / steps / share)));
            went += (next.point - near.point).norm();
            near = next;
        }
        (near.point, went)
    }

    /// The inner wall of the lateral condyle at a place's depth and height; none where the midline is within the bone there, or nothing lies lateral.
    fn wall(&self, p: &Point) -> Option<Point> {
        let [a, s, _] = self.placed(p);
        let hit = self.query.ray(&self.at([a, s, 0.0]), &-self.frame.medial, REACH_MM)?;
        // a ray that begins within the bone comes out at its other side
        (self.query.normal(hit.triangle).dot(&self.frame.medial) > 0.0).then_some(hit.point)
    }

    /// The way from the centre of an ACL's footprint to where dissected ones lie on the wall; none on a femur that shows no such wall.
    pub(super) fn to_the_wall(&self, centre: &Point) -> Option<Vector> {
        Some(self.by_quadrant(ACL_PERCENT).ok()? - centre)
    }

    /// A point of a footprint after this way, laid on the wall; beyond the wall's edges, on the bone.
    pub(super) fn on_the_wall(&self, p: Point, way: Vector) -> Point {
        let p = p + way;
        self.wall(&p).unwrap_or_else(|| self.query.nearest(&p).point)
    }

    /// The grid of the quadrant method on this femur.
    ///
    /// The roof of the notch is the line through what looks downwards and backwards in the midline; depth and height are the extents of the lateral
    /// condyle below it, along and across it [bernard1997].
    fn quadrant(&self) -> Result<&Quadrant, String> {
        self.grid.get_or_init(|| self.measured_quadrant()).as_ref().map_err(Clone::clone)
    }

    fn measured_quadrant(&self) -> Result<Quadrant, String> {
        let normals = self.mesh.triangle_normals();
        let (mut weight, mut mean, mut spread) = (0.0, [0.0; 2], [0.0; 3]);
        for (t, n) in normals.iter().enumerate() {
            let [p, q, r] = self.mesh.corners(t);
            let [a, s, l] = self.placed(&Point::from((p.coords + q.coords + r.coords) / 3.0));
            let faces = -n.dot(&self.frame.superior) > ROOF_FACES[0] && -n.dot(&self.frame.anterior) > ROOF_FACES[1];
            if l.abs() < STRIP_MM && s.abs() < ROOF_NEAR_MM && faces {
                let area = (q - p).cross(&(r - p)).norm() / 2.0;
                weight += area;
                (mean[0], mean[1]) = (mean[0] + area * a, mean[1] + area * s);
                spread = [spread[0] + area * a * a, spread[1] + area * s * s, spread[2] + area * a * s];
            }
        }
        if weight <= 0.0 {
            return Err("the femur shows no roof of its notch; give the site as point_mm or native".into());
        }
        let [a, s] = mean.map(|x| x / weight);
        let [aa, ss, cross] = [spread[0] / weight - a * a, spread[1] / weight - s * s, spread[2] / weight - a * s];
        // the long axis of the strip, from deep to shallow
        // half the angle whose cosine and sine are these over r; along is never negative
        let (d, x) = (aa - ss, 2.0 * cross);
        let r = (d * d + x * x).sqrt().max(1e-12);
        let (along, up) = ((0.5 + 0.5 * d / r).max(0.0).sqrt(), (0.5 - 0.5 * d / r).max(0.0).sqrt() * x.signum());
        // across it, away from the shaft
        let axes = [
            self.frame.anterior * along + self.frame.superior * up,
            self.frame.anterior * up - self.frame.superior * along,
        ];
        let roof = self.at([a, s, 0.0]);
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for p in &self.mesh.vertices {
            let v = p - roof;
            let [depth, height] = [v.dot(&axes[0]), v.dot(&axes[1])];
            if self.placed(p)[2] > CONDYLE_FROM_MM && height > 0.0 {
                ends[0] = [ends[0][0].min(depth), ends[0][1].max(depth)];
                ends[1] = [0.0, ends[1][1].max(height)];
            }
        }
        let size = ends.map(|[low, high]| high - low);
        if !(size[0] > 0.0 && size[1] > 0.0 && size[0].is_finite()) {
            return Err("the femur shows no lateral condyle below its notch's roof; give the site as point_mm".into());
        }
        Ok(Quadrant { origin: roof + axes[0] * ends[0][0], axes, size })
    }

    /// The lateral condyle's inner wall at depth and height [%].
    fn by_quadrant(&self, percent: [f64; 2]) -> Result<Point, String> {
        let q = self.quadrant()?;
        let flat =
            q.origin + q.axes[0] * (q.size[0] * percent[0] / 100.0) + q.axes[1] * (q.size[1] * percent[1] / 100.0);
        self.wall(&flat).ok_or(format!(
            "femur.quadrant_percent [{}, {}] meets no wall of the notch lateral of the midline; expected about [25, 28] for an ACL",
            percent[0], percent[1]
        ))
    }

    /// The plateau at percentages of its breadth from front to back and from medial to lateral.
    fn on_plateau(&self, percent: [f64; 2]) -> Result<Point, String> {
        let [front, medial] = self.edges();
        let [a, l] = [
            front[1] + (front[0] - front[1]) * percent[0] / 100.0,
            medial[0] + (medial[1] - medial[0]) * percent[1] / 100.0,
        ];
        let hit = self.query.ray(&self.at([a, REACH_MM / 2.0, l]), &-self.frame.superior, REACH_MM);
        hit.map(|h| h.point).ok_or(format!(
            "tibia.plateau_percent [{}, {}] meets no bone; expected about [43, 48] for an ACL",
            percent[0], percent[1]
        ))
    }

    /// Ends of the plateau [mm]: back and front, medial and lateral.
    fn edges(&self) -> [[f64; 2]; 2] {
        *self.plateau.get_or_init(|| self.measured_edges())
    }

    fn measured_edges(&self) -> [[f64; 2]; 2] {
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for p in &self.mesh.vertices {
            let [a, s, l] = self.placed(p);
            if s.abs() < PLATEAU_BAND_MM {
                ends[0] = [ends[0][0].min(a), ends[0][1].max(a)];
                ends[1] = [ends[1][0].min(l), ends[1][1].max(l)];
            }
        }
        ends
    }

    /// How far lateral of the bone's midline a place lies [mm]; medial is negative.
    pub(super) fn lateral_mm(&self, p: &Point) -> f64 {
        self.placed(p)[2]
    }

    /// Whether a place of the femur lies where its notch's lateral wall does, of which alone the quadrant method tells.
    pub(super) fn is_by_the_wall(&self, p: &Point) -> bool {
        (0.0..=WALL_MM).contains(&self.lateral_mm(p))
    }

    /// Where a place lies by the bone's own percentages: quadrant of the femur, plateau of the tibia.
    pub(super) fn percent(&self, p: &Point) -> Option<[f64; 2]> {
        if self.name == "femur" {
            let q = self.quadrant().ok()?;
            let v = p - q.origin;
            return Some([0, 1].map(|k| 100.0 * v.dot(&q.axes[k]) / q.size[k]));
        }
        let ([front, medial], [a, _, l]) = (self.edges(), self.placed(p));
        Some([100.0 * (front[1] - a) / (front[1] - front[0]), 100.0 * (l - medial[0]) / (medial[1] - medial[0])])
    }
}
