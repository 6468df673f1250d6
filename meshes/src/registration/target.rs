//! The bone's surface made ready for questions: exact ones by triangle, quick ones by sample point.

use super::sample::{Samples, spread};
use crate::query::SurfaceQuery;
use crate::surface::TriMesh;
use crate::{Point, Vector};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// The bone's surface, prepared.
pub struct Target {
    /// Exact closest points.
    pub query: SurfaceQuery,
    /// Points spread evenly over it.
    pub samples: Samples,
    /// Mean point of the samples [mm].
    pub centre: Point,
    /// Root mean square distance of the samples from their mean [mm]: the size of the bone.
    pub size: f64,
    tree: ImmutableKdTree<f64, 3>,
}

/// A kd-tree over points; `None` when there are none or one is not finite.
pub fn tree_of(points: &[Point]) -> Option<ImmutableKdTree<f64, 3>> {
    if points.is_empty() || points.iter().any(|p| !p.coords.iter().all(|x| x.is_finite())) {
        return None;
    }
    ImmutableKdTree::new_from_slice(&points.iter().map(|p| [p.x, p.y, p.z]).collect::<Vec<_>>()).ok()
}

/// Index of the nearest point of a tree, and the squared distance to it [mm2].
pub fn nearest_in(tree: &ImmutableKdTree<f64, 3>, p: &Point) -> (usize, f64) {
    let found = tree.query(&[p.x, p.y, p.z]).nearest_one::<SquaredEuclidean<f64>>().execute();
    (found.item as usize, found.distance)
}

/// Mean and root mean square distance from it.
pub fn spread_of(points: &[Point]) -> (Point, f64) {
    let n = points.len().max(1) as f64;
    let centre = Point::from(points.iter().map(|p| p.coords).sum::<Vector>() / n);
    let size = (points.iter().map(|p| (p - centre).norm_squared()).sum::<f64>() / n).sqrt();
    (centre, size)
}

impl Target {
    /// Prepares a surface with `count` samples; `None` without area or with a coordinate that is not finite.
    pub fn new(mesh: &TriMesh, count: usize) -> Option<Target> {
        let samples = spread(mesh, count);
        let tree = tree_of(&samples.points)?;
        let (centre, size) = spread_of(&samples.points);
        Some(Target { query: SurfaceQuery::new(mesh)?, samples, centre, size, tree })
    }

    /// Nearest sample: its index and distance [mm].
    pub fn nearest_sample(&self, p: &Point) -> (usize, f64) {
        let (k, squared) = nearest_in(&self.tree, p);
        (k, squared.sqrt())
    }
}
