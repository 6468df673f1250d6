//! How a meniscus lies on its plateau: how far it stands out over the rim, and how much of the cartilage it covers.

use super::Between;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use sim::spec::MeniscusSpec;

/// The meniscus' body: what lies within this share of the plateau's half length in front of its middle and behind it [-]. Ours: extrusion is read in
/// coronal pictures through the middle of the plateau; towards the horns the rim turns away.
const BODY_SHARE: f64 = 0.35;

/// How far the body of a meniscus stands out over the rim of its plateau's cartilage, away from the middle of the knee [mm]; negative where it ends
/// within. None where no section of it lies there.
pub(super) fn extrusion_mm(m: &MeniscusSpec, between: &Between) -> Option<f64> {
    let (out, front) = (between.outwards(), between.frame.anterior);
    let along = |p: &Point, way: &Vector| (p - between.frame.origin).dot(way);
    let fronts: Vec<f64> = between.tibia.vertices.iter().map(|p| along(p, &front)).collect();
    let back = fronts.iter().copied().fold(f64::INFINITY, f64::min);
    let fore = fronts.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (middle, reach) = (0.5 * (back + fore), 0.5 * BODY_SHARE * (fore - back));
    m.sections
        .iter()
        .flat_map(|s| s.lower.iter().chain(&s.upper))
        .filter(|&p| (along(p, &front) - middle).abs() <= reach)
        .filter_map(|p| Some(along(p, &out) - rim(between.tibia, &along, (&out, &front), along(p, &front))?))
        .max_by(f64::total_cmp)
}

/// How far out the cartilage reaches at a place along the plateau [mm]: the outermost of its edges there.
fn rim(
    tibia: &TriMesh,
    along: &impl Fn(&Point, &Vector) -> f64,
    (out, front): (&Vector, &Vector),
    at: f64,
) -> Option<f64> {
    let edges = (0..tibia.triangles.len()).flat_map(|t| {
        let c = tibia.corners(t);
        [(c[0], c[1]), (c[1], c[2]), (c[2], c[0])]
    });
    let crossing = |(a, b): (Point, Point)| {
        let (from, to) = (along(&a, front) - at, along(&b, front) - at);
        let crosses = from * to <= 0.0 && from != to;
        crosses.then(|| {
            let share = from / (from - to);
            (1.0 - share) * along(&a, out) + share * along(&b, out)
        })
    };
    edges.filter_map(crossing).max_by(f64::total_cmp)
}

/// Share of the plateau's cartilage that lies under the meniscus, seen from above [-]; what stands out over the rim covers none.
pub(super) fn coverage(m: &MeniscusSpec, between: &Between) -> f64 {
    let (out, front, up) = (between.outwards(), between.frame.anterior, between.frame.superior);
    let flat = |p: &Point| {
        let d = p - between.frame.origin;
        [d.dot(&out), d.dot(&front)]
    };
    let corners = m.sections.windows(2).filter_map(|w| {
        let [first, second] = [&w[0].lower, &w[1].lower];
        Some([flat(first.first()?), flat(first.last()?), flat(second.last()?), flat(second.first()?)])
    });
    let parts: Vec<[[f64; 2]; 3]> = corners.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let (mut under, mut whole) = (0.0, 0.0);
    for t in 0..between.tibia.triangles.len() {
        let area = between.tibia.area_vector(t).dot(&up).max(0.0);
        let corners = between.tibia.corners(t);
        // the middles of four parts of a triangle, so that the meniscus' edge does not take or leave it as a whole
        let centre = corners.iter().map(|p| p.coords).sum::<Vector>() / 3.0;
        let middles = corners.iter().map(|p| (p.coords + centre) / 2.0).chain([centre]);
        let places = middles.map(|p| flat(&Point::from(p)));
        let inside = places.filter(|p| parts.iter().any(|part| holds(part, *p))).count();
        whole += area;
        under += area * inside as f64 / 4.0;
    }
    under / whole
}

/// Whether a triangle holds a point, either way round.
fn holds([a, b, c]: &[[f64; 2]; 3], p: [f64; 2]) -> bool {
    let side = |a: &[f64; 2], b: &[f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let sides = [side(a, b), side(b, c), side(c, a)];
    sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0)
}
