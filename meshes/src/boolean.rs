//! Boolean difference of closed surfaces, by manifold-rust.

use crate::Point;
use crate::surface::TriMesh;
use manifold_rust::manifold::Manifold;
use manifold_rust::types::{Error, MeshGL64};

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

/// What `first` has and `second` has not. Both must be closed and outward.
///
/// # Errors
/// An operand that is open or not finite: the library would answer such a one with an empty body and no error.
pub fn difference(first: &TriMesh, second: &TriMesh) -> Result<Difference, BooleanError> {
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
    let given = MeshGL64 {
        num_prop: 3,
        vert_properties: mesh.vertices.iter().flat_map(|p| [p.x, p.y, p.z]).collect(),
        tri_verts: mesh.triangles.iter().flatten().map(|v| u64::from(*v)).collect(),
        ..Default::default()
    };
    let body = Manifold::from_mesh_gl64(&given);
    if body.status() != Error::NoError || body.is_empty() {
        return Err(BooleanError(format!(
            "the {which} body is open, crosses itself in its triangles or is empty ({:?}); expected a closed surface",
            body.status()
        )));
    }
    Ok(body.as_original())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::icosphere;
    use crate::topology::Topology;

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
    fn an_open_body_is_refused() {
        let ball = icosphere(10.0, 2);
        let open = ball.submesh(|t| t > 3).0;
        assert!(difference(&open, &ball).unwrap_err().0.contains("first"));
        assert!(difference(&ball, &open).unwrap_err().0.contains("second"));
    }
}
