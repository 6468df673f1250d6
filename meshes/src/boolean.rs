//! Boolean difference of closed surfaces, by manifold-rust.

use crate::Point;
use crate::surface::TriMesh;
use crate::topology::Topology;
use manifold_rust::manifold::Manifold;
use manifold_rust::types::{Error, MeshGL64};
use std::panic::catch_unwind;

/// What a Boolean refuses.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
#[error("{0}")]
pub struct BooleanError(pub String);

/// A difference of two bodies.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Its surface, closed, outward.
    pub mesh: TriMesh,
    /// Per triangle: whether it lies on the first body's surface, not on the second's.
    pub of_first: Vec<bool>,
}

/// What `first` has and `second` has not. Both must be closed and outward; one may cross itself, and counts there as the sum of its bodies.
///
/// # Errors
/// An operand that is open, turned inside out or not finite: the library answers such a one with an empty body and no error.
pub fn difference(first: &TriMesh, second: &TriMesh) -> Result<Difference, BooleanError> {
    // the library guards its own state by assertions
    catch_unwind(|| subtract(first, second)).unwrap_or_else(|_| Err(BooleanError("the difference broke off".into())))
}

fn subtract(first: &TriMesh, second: &TriMesh) -> Result<Difference, BooleanError> {
    let (a, b) = (operand(first, "first")?, operand(second, "second")?);
    let made = a.difference(&b);
    if made.status() != Error::NoError {
        return Err(BooleanError(format!("the difference failed ({:?})", made.status())));
    }
    let out = made.get_mesh_gl64(-1);
    let stride = (out.num_prop as usize).max(3);
    let vertices = out.vert_properties.chunks_exact(stride).map(|p| Point::new(p[0], p[1], p[2])).collect();
    let mut index: Vec<u32> = (0..out.vert_properties.len() / stride).map(|v| v as u32).collect();
    for (from, to) in out.merge_from_vert.iter().zip(&out.merge_to_vert) {
        index[*from as usize] = *to as u32;
    }
    let triangles: Vec<[u32; 3]> =
        out.tri_verts.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|v| index[v as usize])).collect();
    let mut of_first = vec![false; triangles.len()];
    let own = u32::try_from(a.original_id()).ok();
    for (run, id) in out.run_original_id.iter().enumerate() {
        let bound = |k: usize| out.run_index.get(k).map_or(triangles.len(), |i| *i as usize / 3);
        for flag in of_first.iter_mut().take(bound(run + 1)).skip(bound(run)) {
            *flag = Some(*id) == own;
        }
    }
    Ok(Difference { mesh: TriMesh { vertices, triangles }.submesh(|_| true).0, of_first })
}

fn operand(mesh: &TriMesh, which: &str) -> Result<Manifold, BooleanError> {
    let refuse = |why: &str| Err(BooleanError(format!("the {which} body {why}; expected a closed surface")));
    let count = mesh.vertices.len();
    if mesh.triangles.is_empty() {
        return refuse("is empty");
    }
    if mesh.triangles.iter().flatten().any(|v| *v as usize >= count) {
        return refuse("has triangles of vertices that are not there");
    }
    if mesh.vertices.iter().any(|p| p.coords.iter().any(|x| !x.is_finite())) {
        return refuse("has vertices that are not finite");
    }
    if !Topology::of(mesh).is_closed() {
        return refuse("is open or has edges of more than two triangles");
    }
    if mesh.volume() <= 0.0 {
        return refuse("is turned inside out or encloses nothing");
    }
    let given = MeshGL64 {
        num_prop: 3,
        vert_properties: mesh.vertices.iter().flat_map(|p| [p.x, p.y, p.z]).collect(),
        tri_verts: mesh.triangles.iter().flatten().map(|v| u64::from(*v)).collect(),
        ..Default::default()
    };
    let body = Manifold::from_mesh_gl64(&given);
    if body.status() != Error::NoError || body.is_empty() {
        return refuse(&format!("is not a solid ({:?})", body.status()));
    }
    Ok(body.as_original())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::icosphere;

    #[test]
    fn a_shell_is_what_is_left_of_a_ball_and_its_faces_are_told() {
        let (large, mut small) = (icosphere(10.0, 3), icosphere(8.0, 3));
        small.vertices.iter_mut().for_each(|p| p.x += 4.0);
        let made = difference(&large, &small).unwrap();
        assert!(Topology::of(&made.mesh).is_closed());
        let middle = |t: usize| {
            let [a, b, c] = made.mesh.corners(t);
            Point::from((a.coords + b.coords + c.coords) / 3.0)
        };
        for t in 0..made.mesh.triangles.len() {
            let (outer, inner) = (middle(t).coords.norm() - 10.0, (middle(t) - Point::new(4.0, 0.0, 0.0)).norm() - 8.0);
            // where the balls cross, facets are as far from either
            if (outer.abs() - inner.abs()).abs() > 0.1 {
                assert_eq!(made.of_first[t], outer.abs() < inner.abs(), "{outer} {inner}");
            }
        }
        assert!((made.mesh.volume() - large.volume()).abs() < small.volume());
    }

    #[test]
    fn a_bad_body_is_refused_in_words() {
        let ball = icosphere(10.0, 2);
        let open = ball.submesh(|t| t > 3).0;
        let mut far = ball.clone();
        far.vertices[5].x = f64::NAN;
        let mut torn = ball.clone();
        torn.triangles[7][1] = 100_000;
        let doubled = TriMesh { triangles: [&ball.triangles[..], &ball.triangles[..]].concat(), ..ball.clone() };
        for (bad, why) in [
            (open, "open"),
            (far, "not finite"),
            (torn, "not there"),
            (doubled, "more than two"),
            (ball.clone().flipped(), "inside out"),
            (TriMesh::default(), "empty"),
        ] {
            let [first, second] = [difference(&bad, &ball), difference(&ball, &bad)].map(|d| d.unwrap_err().0);
            assert!(first.contains("first body") && first.contains(why), "{first}");
            assert!(second.contains("second body") && second.contains(why), "{second}");
        }
    }

    #[test]
    fn a_body_less_itself_or_less_one_far_off_is_nothing_or_the_body() {
        let ball = icosphere(10.0, 3);
        assert_eq!(difference(&ball, &ball).unwrap().mesh.triangles.len(), 0);
        let off = ball.moved(&crate::Isometry::translation(50.0, 0.0, 0.0));
        let whole = difference(&ball, &off).unwrap();
        assert!((whole.mesh.volume() / ball.volume() - 1.0).abs() < 1e-12);
        assert!(whole.of_first.iter().all(|f| *f));
    }

    #[test]
    fn bodies_that_cross_themselves_end_closed_or_in_an_error() {
        // each vertex thrown anywhere: hundreds of crossings with itself
        for seed in 0..20_u64 {
            let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) + 1;
            let mut next = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 40) as f64 / (1u64 << 24) as f64 - 0.5
            };
            let mut wild = icosphere(10.0, 2);
            let by = 0.5 * (seed + 1) as f64;
            wild.vertices.iter_mut().for_each(|p| *p += crate::Vector::new(next(), next(), next()) * by);
            let ball = icosphere(9.5, 2);
            for made in [difference(&wild, &ball), difference(&ball, &wild)].into_iter().flatten() {
                assert!(made.mesh.vertices.iter().all(|p| p.coords.iter().all(|x| x.is_finite())));
                assert_eq!(Topology::of(&made.mesh).boundary_edges, 0, "seed {seed}");
            }
        }
    }
}
