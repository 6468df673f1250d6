//! A bone of the phantom: its solid with cartilage, its pose, and how CT and scanner see it.

use super::shape::{self, Cover};
use super::site::{self, Recipe as SiteRecipe};
use super::{Recipe, unit_cube};
use meshes::frame::Side;
use meshes::query::SurfaceQuery;
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::surface_net::surface_net;
use meshes::topology::Topology;
use meshes::{Isometry, Point, Vector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// Grid of the scan, and of the CT surface [mm].
const SCAN_SPACING: f64 = 0.85;
const CT_SPACING: f64 = 1.3;
/// Standard deviation and correlation length of the CT surface's error [mm].
pub(super) const CT_NOISE: (f64, f64) = (0.1, 8.0);
/// Standard deviation of the scanner's error [mm].
pub(super) const SCAN_NOISE: f64 = 0.058;

/// What makes a bone.
pub(super) struct Plan {
    pub name: &'static str,
    field: fn(&Point) -> f64,
    cover: fn(&Point, &Vector) -> (f64, Cover),
    low: [f64; 3],
    high: [f64; 3],
    /// The scan ends here: keeps points of positive sign * (z - cut).
    scan_cut: (f64, f64),
    /// Whether a point of the shape, with its outer normal, may bear at the joint.
    bears: fn(&Point, &Vector) -> bool,
    sites: &'static [SiteRecipe],
    screws: [[f64; 3]; 4],
    stickers: [[f64; 3]; 2],
    holes: [[f64; 3]; 2],
    pub landmarks: [[f64; 3]; 5],
}

pub(super) const FEMUR: Plan = Plan {
    name: "femur",
    field: shape::femur,
    cover: shape::femur_cover,
    low: [-50.0, -30.0, -36.0],
    high: [50.0, 58.0, 77.0],
    scan_cut: (shape::FEMUR_CUT - 4.0, -1.0),
    bears: |p, _| p.z < 30.0,
    sites: &site::FEMUR,
    screws: [[6.0, 45.0, 58.0], [5.0, 45.0, 40.0], [40.0, 5.0, 24.0], [-4.0, 0.0, 34.0]],
    stickers: [[-12.0, 30.0, 60.0], [3.0, 8.0, 55.0]],
    holes: [[-8.0, 40.0, 42.0], [34.0, 20.0, 26.0]],
    landmarks: [[-44.0, 2.0, 0.0], [44.0, 0.0, 2.0], [0.0, 45.0, 30.0], [-38.0, -8.0, 20.0], [10.0, 8.0, 48.0]],
};

pub(super) const TIBFIB: Plan = Plan {
    name: "tibfib",
    field: shape::tibfib,
    cover: shape::tibia_cover,
    low: [-46.0, -36.0, -96.0],
    high: [60.0, 38.0, 18.0],
    scan_cut: (shape::TIBIA_CUT + 4.0, 1.0),
    // the plateaus and the spines' flanks
    bears: |p, normal| p.z > -12.0 && normal.z > 0.2,
    sites: &site::TIBFIB,
    screws: [[-26.0, 20.0, -10.0], [-22.0, 22.0, -26.0], [-8.0, -20.0, -48.0], [44.0, -2.0, -26.0]],
    stickers: [[22.0, 26.0, -18.0], [-30.0, -14.0, -24.0]],
    holes: [[12.0, 14.0, -70.0], [-30.0, 10.0, -40.0]],
    landmarks: [
        [3.0, 30.0, -42.0],
        [-38.0, 0.0, -10.0],
        [50.0, -14.0, -28.0],
        [-12.0, -12.0, -75.0],
        [36.0, 10.0, -10.0],
    ],
};

/// A site on the bone, knee coordinates.
pub(super) struct PlacedSite {
    pub ligament: &'static str,
    pub marked: bool,
    pub centroid: Point,
    pub points: Vec<Point>,
    /// Vertices of the outline.
    outline: Vec<usize>,
}

/// A bone with its cartilage, knee coordinates: left, behind, up [mm].
pub(super) struct Solid {
    pub plan: &'static Plan,
    /// The bone alone, finely meshed; the same vertices in the shape's own coordinates; the outer normals.
    pub bone: TriMesh,
    pub shape: Vec<Point>,
    normals: Vec<Vector>,
    /// Cartilage thickness at the vertices [mm], 0 where bare.
    thickness: Vec<f64>,
    coarse: TriMesh,
    pub cartilage: Vec<(Cover, TriMesh)>,
    pub sites: Vec<PlacedSite>,
    pub ct_from_knee: Isometry,
    scale: Vector,
    side: Side,
}

/// What CT and scanner give.
pub(super) struct Measured {
    pub ct: TriMesh,
    pub scan: ColouredMesh,
    pub ct_from_scan: Isometry,
}

impl Solid {
    /// Knee coordinates of a point of the shape.
    pub(super) fn knee(&self, p: &Point) -> Point {
        to_knee(p, &self.scale, self.side)
    }

    /// The vertex nearest to a point of the shape.
    pub(super) fn vertex(&self, p: [f64; 3]) -> usize {
        let p = Point::from(p);
        let far = |q: &Point| (q - p).norm_squared();
        (0..self.shape.len()).min_by(|&a, &b| far(&self.shape[a]).total_cmp(&far(&self.shape[b]))).unwrap_or(0)
    }

    /// The bone's surface as it is, CT frame.
    pub(super) fn in_ct(&self) -> TriMesh {
        self.coarse.moved(&self.ct_from_knee)
    }

    /// The outer surface of bone and cartilage where it may bear, CT frame: also beyond the rim of the cartilage, where bone bears on.
    pub(super) fn bearing(&self) -> TriMesh {
        let outer = self.outer();
        let bears = |v: u32| (self.plan.bears)(&self.shape[v as usize], &self.normals[v as usize]);
        outer.submesh(|t| outer.triangles[t].iter().all(|&v| bears(v))).0.moved(&self.ct_from_knee)
    }

    fn outer(&self) -> TriMesh {
        let lifted = (0..self.shape.len()).map(|v| self.bone.vertices[v] + self.normals[v] * self.thickness[v]);
        TriMesh { vertices: lifted.collect(), triangles: self.bone.triangles.clone() }
    }
}

fn to_knee(p: &Point, scale: &Vector, side: Side) -> Point {
    let left = if side == Side::Left { 1.0 } else { -1.0 };
    Point::new(left * scale.x * p.x, -scale.y * p.y, scale.z * p.z)
}

/// Meshes a bone and lays its cartilage and sites on it; `None` if a surface is empty.
pub(super) fn solid(recipe: &Recipe, plan: &'static Plan) -> Option<Solid> {
    let scale = Vector::from(recipe.scale);
    let mean = scale.mean();
    let meshed = |spacing: f64| {
        // A cell that two sheets cross pinches the net; a slightly finer grid cuts elsewhere.
        let net = (0..8).find_map(|k| {
            let spacing = spacing / mean * (1.0 - 0.013 * f64::from(k));
            let net = surface_net(&plan.field, Point::from(plan.low), Point::from(plan.high), spacing)?;
            Topology::of(&net).is_closed().then_some(net)
        })?;
        let vertices = net.vertices.iter().map(|p| to_knee(p, &scale, recipe.side)).collect();
        let mesh = TriMesh { vertices, triangles: net.triangles.clone() };
        Some((net, if recipe.side == Side::Left { mesh.flipped() } else { mesh }))
    };
    let (net, bone) = meshed(SCAN_SPACING)?;
    let (_, coarse) = meshed(CT_SPACING)?;
    let normals = bone.vertex_normals();
    let covers: Vec<(f64, Cover)> =
        net.vertices.iter().zip(net.vertex_normals()).map(|(p, n)| (plan.cover)(p, &n)).collect();
    let mut made = Solid {
        plan,
        thickness: vec![0.0; bone.vertices.len()],
        bone,
        shape: net.vertices,
        normals,
        coarse,
        cartilage: Vec::new(),
        sites: Vec::new(),
        ct_from_knee: Isometry::identity(),
        scale,
        side: recipe.side,
    };
    for (cover, full) in [Cover::Femur, Cover::Medial, Cover::Lateral].into_iter().zip(recipe.thickness) {
        lay(&mut made, &covers, cover, full);
    }
    made.sites = plan.sites.iter().map(|s| placed(&made, s)).collect();
    Some(made)
}

/// Lays one cartilage on the bone: the largest piece of where it covers, thinning to a rim of 0.35 mm over 5 mm.
fn lay(made: &mut Solid, covers: &[(f64, Cover)], cover: Cover, full: f64) {
    let covered = |v: u32| covers[v as usize].1 == cover && covers[v as usize].0 > 0.0;
    let (all, old_of_all) = made.bone.submesh(|t| made.bone.triangles[t].iter().all(|&v| covered(v)));
    if all.triangles.is_empty() {
        return;
    }
    let topology = Topology::of(&all);
    let (base, old) = all.submesh(|t| topology.component_of_triangle[t] == 0);
    let old: Vec<usize> = old.iter().map(|&v| old_of_all[v as usize] as usize).collect();
    for &v in &old {
        let t = (covers[v].0 / 5.0).clamp(0.0, 1.0);
        made.thickness[v] = 0.35 + (full - 0.35) * t * t * (3.0 - 2.0 * t);
    }
    let n = old.len() as u32;
    let mut solid = TriMesh { vertices: base.vertices.clone(), triangles: Vec::new() };
    solid.vertices.extend(old.iter().map(|&v| made.bone.vertices[v] + made.normals[v] * made.thickness[v]));
    let mut edges: BTreeMap<(u32, u32), (u32, u32)> = BTreeMap::new();
    for &[a, b, c] in &base.triangles {
        solid.triangles.extend([[a, c, b], [a + n, b + n, c + n]]);
        for (p, q) in [(a, b), (b, c), (c, a)] {
            if edges.remove(&(p.min(q), p.max(q))).is_none() {
                edges.insert((p.min(q), p.max(q)), (p, q));
            }
        }
    }
    for &(a, b) in edges.values() {
        solid.triangles.extend([[b + n, a + n, a], [b + n, a, b]]);
    }
    made.cartilage.push((cover, solid));
}

fn placed(made: &Solid, &(ligament, place, [half_height, half_width], marked): &SiteRecipe) -> PlacedSite {
    let centre = made.vertex(place);
    let (at, normal) = (made.bone.vertices[centre], made.normals[centre]);
    let along = |d: Vector| (d - normal * d.dot(&normal)).try_normalize(0.3);
    let up = along(Vector::z()).or_else(|| along(Vector::y())).unwrap_or_else(Vector::x);
    let side = normal.cross(&up);
    let measure = |v: usize| {
        let d = made.bone.vertices[v] - at;
        if d.norm() > 14.0 || made.normals[v].dot(&normal) < 0.2 {
            return f64::INFINITY;
        }
        (d.dot(&up) / half_height).hypot(d.dot(&side) / half_width)
    };
    let rings: Vec<f64> = (0..made.shape.len()).map(measure).collect();
    let areas = made.bone.vertex_areas();
    let (mut sum, mut weight) = (Vector::zeros(), 0.0);
    for v in (0..rings.len()).filter(|&v| rings[v] < 1.0) {
        sum += (made.bone.vertices[v] - at) * areas[v];
        weight += areas[v];
    }
    let centroid = at + sum / weight.max(1e-9);
    let nearest = |p: Point| {
        let far = |v: usize| (made.bone.vertices[v] - p).norm_squared();
        made.bone.vertices[(0..rings.len()).min_by(|&a, &b| far(a).total_cmp(&far(b))).unwrap_or(centre)]
    };
    let points = [up * half_height, -up * half_height, side * half_width, -side * half_width];
    let points = points.iter().map(|d| nearest(centroid + d * 0.6)).collect();
    let outline = (0..rings.len()).filter(|&v| (rings[v] - 1.0).abs() < 0.7 / half_height.min(half_width)).collect();
    PlacedSite { ligament, marked, centroid, points, outline }
}

/// The motion of the tibia that brings its cartilages to touch the femur's, both 0.1 mm deep.
pub(super) fn contact(femur: &Solid, tibfib: &Solid) -> Isometry {
    let mut motion = Isometry::translation(0.0, 0.0, -45.0);
    let covered: Vec<Point> =
        femur.outer().vertices.into_iter().zip(&femur.thickness).filter(|(_, t)| **t > 0.0).map(|(p, _)| p).collect();
    let Some(query) = SurfaceQuery::new(&tibfib.outer()) else { return motion };
    for _ in 0..6 {
        // The least gap on each side and where it is.
        let mut least = [(f64::INFINITY, 0.0); 2];
        let back = motion.inverse();
        for p in &covered {
            let lifted = back * (p + Vector::z() * 8.0);
            if let Some(hit) = query.ray(&lifted, &(back * -Vector::z()), 60.0) {
                let slot = &mut least[usize::from(p.x > 0.0)];
                if hit.distance - 8.0 < slot.0 {
                    *slot = (hit.distance - 8.0, p.x);
                }
            }
        }
        let [(g0, x0), (g1, x1)] = least;
        if !(g0.is_finite() && g1.is_finite()) || x1 - x0 < 5.0 {
            break;
        }
        let slope = ((g1 - g0) / (x1 - x0)).clamp(-0.05, 0.05);
        let rise = g0 - slope * x0 + 0.1;
        motion = Isometry::new(Vector::z() * rise, -Vector::y() * slope) * motion;
    }
    motion
}

pub(super) fn normal_deviate(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random_range(1e-12..1.0), rng.random_range(0.0..1.0));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// Measures a bone by CT and by scanner.
pub(super) fn measure(made: &Solid, rng: &mut ChaCha8Rng) -> Measured {
    let clean = made.coarse.moved(&made.ct_from_knee);
    let normals = clean.vertex_normals();
    // A stationary Gaussian field of squared-exponential correlation, by random waves.
    let waves: Vec<(Vector, f64)> = (0..160)
        .map(|_| {
            let wave = Vector::from_fn(|_, _| normal_deviate(rng)) / CT_NOISE.1;
            (wave, rng.random_range(0.0..std::f64::consts::TAU))
        })
        .collect();
    let size = CT_NOISE.0 * (2.0 / waves.len() as f64).sqrt();
    let noise = |p: &Point| size * waves.iter().map(|(k, phase)| (k.dot(&p.coords) + phase).cos()).sum::<f64>();
    let vertices = clean.vertices.iter().zip(&normals).map(|(p, n)| p + n * noise(p)).collect();
    let ct = TriMesh { vertices, triangles: clean.triangles };
    let ct_from_scan = Isometry::new(200.0 * unit_cube(rng), 1.7 * unit_cube(rng));
    let scan = scanned(made, rng);
    let mesh = scan.mesh.moved(&(ct_from_scan.inverse() * made.ct_from_knee));
    Measured { ct, scan: ColouredMesh { mesh, colours: scan.colours }, ct_from_scan }
}

fn scanned(made: &Solid, rng: &mut ChaCha8Rng) -> ColouredMesh {
    let mut mesh = made.outer();
    let at = |place: [f64; 3]| made.bone.vertices[made.vertex(place)];
    let screws = made.plan.screws.map(at);
    let stickers = made.plan.stickers.map(at);
    let holes = made.plan.holes.map(at);
    let mut colours = Vec::with_capacity(mesh.vertices.len());
    for v in 0..mesh.vertices.len() {
        let p = made.bone.vertices[v];
        let far = |places: &[Point]| places.iter().map(|c| (c - p).norm()).fold(f64::INFINITY, f64::min);
        let mut colour = if made.thickness[v] > 0.0 { [232.0, 232.0, 226.0] } else { [221.0, 199.0, 166.0] };
        let head = far(&screws);
        let mut lift = SCAN_NOISE * normal_deviate(rng);
        if head < 3.0 {
            lift += (9.0 - head * head).sqrt();
            colour = [152.0, 153.0, 158.0];
        } else if far(&stickers) < 3.2 {
            lift += 0.1;
            colour = [34.0, 62.0, 196.0];
        }
        mesh.vertices[v] += made.normals[v] * lift;
        colours.push(colour.map(|x: f64| (x + 6.0 * normal_deviate(rng)).round().clamp(0.0, 255.0) as u8));
    }
    for site in made.sites.iter().filter(|s| s.marked) {
        site.outline.iter().filter(|&&v| made.thickness[v] == 0.0).for_each(|&v| colours[v] = [16, 15, 14]);
    }
    let (cut, sign) = made.plan.scan_cut;
    let kept = |v: u32| {
        let v = v as usize;
        sign * (made.shape[v].z - cut) > 0.0 && holes.iter().all(|h| (made.bone.vertices[v] - h).norm() > 1.9)
    };
    let (part, old) = mesh.submesh(|t| mesh.triangles[t].iter().all(|&v| kept(v)));
    ColouredMesh { mesh: part, colours: old.iter().map(|&v| colours[v as usize]).collect() }
}
