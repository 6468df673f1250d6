//! Closest points and rays on a surface: the one adapter to parry (whose mathematics is glam's, ours nalgebra's).

use crate::surface::TriMesh;
use crate::{Point, Vector};
use parry3d_f64::query::{PointProjection, PointQueryWithLocation, Ray, RayCast};
use parry3d_f64::shape::{TriMesh as ParryMesh, TrianglePointLocation};

/// A bounding volume hierarchy over the triangles of a surface.
pub struct SurfaceQuery {
    parry: ParryMesh,
    normals: Vec<Vector>,
    vertex_normals: Vec<Vector>,
}

/// The point of a surface closest to a query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The closest point [mm].
    pub point: Point,
    /// Distance to it [mm].
    pub distance: f64,
    /// The triangle that holds it.
    pub triangle: u32,
    /// Its barycentric coordinates in that triangle.
    pub barycentric: [f64; 3],
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// The point [mm].
    pub point: Point,
    /// Distance along the ray [mm].
    pub distance: f64,
    /// The triangle that is hit.
    pub triangle: u32,
}

impl SurfaceQuery {
    /// Builds the hierarchy; `None` for a surface without triangles.
    pub fn new(mesh: &TriMesh) -> Option<SurfaceQuery> {
        let vertices = mesh.vertices.iter().map(|p| glamx::DVec3::new(p.x, p.y, p.z)).collect();
        let parry = ParryMesh::new(vertices, mesh.triangles.clone()).ok()?;
        Some(SurfaceQuery { parry, normals: mesh.triangle_normals(), vertex_normals: mesh.vertex_normals() })
    }

    /// The closest point of the surface.
    pub fn nearest(&self, p: &Point) -> Nearest {
        nearest_of(p, self.parry.project_local_point_and_get_location(glamx::DVec3::new(p.x, p.y, p.z), false))
    }

    /// [`SurfaceQuery::nearest`] where it is known to lie nearer than `reach` [mm], which is quicker; the same whatever is said.
    pub fn nearest_within(&self, p: &Point, reach: f64) -> Nearest {
        let at = glamx::DVec3::new(p.x, p.y, p.z);
        let found = self.parry.project_local_point_and_get_location_with_max_dist(at, false, reach);
        found.map_or_else(|| self.nearest(p), |found| nearest_of(p, found))
    }

    /// The first meeting of the ray from `origin` along unit `direction`, not farther than `reach` [mm], from either side of the surface.
    pub fn ray(&self, origin: &Point, direction: &Vector, reach: f64) -> Option<Hit> {
        let ray = Ray::new(
            glamx::DVec3::new(origin.x, origin.y, origin.z),
            glamx::DVec3::new(direction.x, direction.y, direction.z),
        );
        let hit = self.parry.cast_local_ray_and_get_normal(&ray, reach, false)?;
        let distance = hit.time_of_impact;
        Some(Hit { point: origin + direction * distance, distance, triangle: hit.subshape })
    }

    /// Unit normal of triangle `t`.
    pub fn normal(&self, t: u32) -> Vector {
        self.normals[t as usize]
    }

    /// Vertex normals interpolated at `near`, unit.
    pub fn smooth_normal(&self, near: &Nearest) -> Vector {
        let [a, b, c] = self.parry.indices()[near.triangle as usize].map(|v| self.vertex_normals[v as usize]);
        let [u, v, w] = near.barycentric;
        (a * u + b * v + c * w).try_normalize(0.0).unwrap_or(self.normals[near.triangle as usize])
    }

    /// Signed distance [mm] by the interpolated normal at the closest point: positive outside.
    /// For a surface that is smooth at the scale of the distance; near sharp edges the sign may err.
    pub fn signed_distance(&self, p: &Point) -> f64 {
        let near = self.nearest(p);
        if (p - near.point).dot(&self.smooth_normal(&near)) < 0.0 { -near.distance } else { near.distance }
    }
}

/// What parry found for a point.
fn nearest_of(
    p: &Point,
    (projection, (triangle, location)): (PointProjection, (u32, TrianglePointLocation)),
) -> Nearest {
    let point = Point::new(projection.point.x, projection.point.y, projection.point.z);
    let barycentric = location.barycentric_coordinates().unwrap_or([1.0, 0.0, 0.0]);
    Nearest { point, distance: (p - point).norm(), triangle, barycentric }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::icosphere;

    #[test]
    fn what_is_known_of_the_distance_changes_nothing() {
        let query = SurfaceQuery::new(&icosphere(10.0, 3)).unwrap();
        // some lie on planes of symmetry, as near to one triangle as to its neighbour
        let places = (0..600).map(|n| [n % 7, n / 7 % 9, n / 63].map(|k| 3.0 * f64::from(k) - 9.0));
        for p in places.map(|[x, y, z]| Point::new(x, y, z)) {
            let near = query.nearest(&p);
            for reach in [near.distance + 1e-9, near.distance * 1.5, 0.5 * near.distance, 0.0] {
                assert_eq!(query.nearest_within(&p, reach), near, "{p} {reach}");
            }
        }
    }

    #[test]
    fn nearest_ray_and_sign_agree_on_a_sphere() {
        let sphere = icosphere(10.0, 4);
        let query = SurfaceQuery::new(&sphere).unwrap();
        let near = query.nearest(&Point::new(0.0, 0.0, 15.0));
        assert!((near.distance - 5.0).abs() < 0.05);
        assert!(query.normal(near.triangle).z > 0.99);
        let hit = query.ray(&Point::new(0.0, 0.0, 15.0), &Vector::new(0.0, 0.0, -1.0), 20.0).unwrap();
        assert!((hit.distance - 5.0).abs() < 0.05);
        assert!(query.ray(&Point::new(0.0, 0.0, 15.0), &Vector::z(), 20.0).is_none());
        assert!(query.signed_distance(&Point::new(0.0, 0.0, 9.0)) < -0.9);
        assert!(query.signed_distance(&Point::new(0.0, 11.0, 0.0)) > 0.9);
    }
}
