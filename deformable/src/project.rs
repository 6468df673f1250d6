//! Where a node lies over a face: the closest point of a bilinear quadrilateral, found by walking from quadrilateral to quadrilateral.

use super::face::{NONE, Surface, cross, dot, norm};

/// A node's foot on a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Foot {
    /// The quadrilateral.
    pub(super) quad: u32,
    /// Its natural coordinates there.
    pub(super) at: [f64; 2],
    /// Height above the face along `normal` [mm]; negative within.
    pub(super) height: f64,
    /// Unit normal of the face there.
    pub(super) normal: [f64; 3],
    /// Shares of the four corners.
    pub(super) weights: [f64; 4],
}

/// Quadrilaterals walked over, at most.
const WALK: usize = 12;
/// Beyond the rim of a face by no more than this, in natural coordinates, a node still lies over it [-].
const RIM: f64 = 1e-6;

/// The foot of `p`, starting from `quad` at `at`; `None` beyond the rim.
pub(super) fn foot(face: &Surface, x: &[[f64; 3]], p: &[f64; 3], (quad, at): (u32, [f64; 2])) -> Option<Foot> {
    let (mut quad, mut start, mut before) = (quad, at, NONE);
    for _ in 0..WALK {
        let corners = face.quads[quad as usize].map(|n| &x[n as usize]);
        let at = closest(&corners, p, start);
        let over = [at[0].abs() - 1.0, at[1].abs() - 1.0];
        let axis = usize::from(over[1] > over[0]);
        if over[axis] <= RIM {
            return Some(Foot { quad, ..place(&corners, p, at) });
        }
        // edges 0 and 2 bound the second coordinate, 1 and 3 the first
        let edge = match (axis, at[axis] > 0.0) {
            (0, true) => 1,
            (0, false) => 3,
            (_, true) => 2,
            (_, false) => 0,
        };
        let next = face.across[quad as usize][edge];
        if next == NONE {
            return None;
        }
        if next == before {
            // between two quadrilaterals that face away from each other: on their edge
            let at = at.map(|t| t.clamp(-1.0, 1.0));
            return Some(Foot { quad, ..place(&corners, p, at) });
        }
        (before, quad, start) = (quad, next, [0.0, 0.0]);
    }
    None
}

/// Natural coordinates of the point of a bilinear patch, continued beyond its edges, that is closest to `p`.
#[inline]
fn closest(corners: &[&[f64; 3]; 4], p: &[f64; 3], start: [f64; 2]) -> [f64; 2] {
    let c = coefficients(corners);
    let [mut s, mut t] = start;
    for _ in 0..8 {
        let r: [f64; 3] = std::array::from_fn(|a| p[a] - (c[0][a] + s * c[1][a] + t * (c[2][a] + s * c[3][a])));
        let u: [f64; 3] = std::array::from_fn(|a| c[1][a] + t * c[3][a]);
        let v: [f64; 3] = std::array::from_fn(|a| c[2][a] + s * c[3][a]);
        let (uu, vv) = (dot(&u, &u), dot(&v, &v));
        // the second derivative of the patch bends the mixed term only
        let uv = dot(&u, &v) - dot(&r, &c[3]);
        let (ru, rv) = (dot(&r, &u), dot(&r, &v));
        let det = uu * vv - uv * uv;
        let curved = det > 0.1 * uu * vv;
        let (det, uv) = if curved { (det, uv) } else { (uu * vv, 0.0) };
        let (ds, dt) = ((vv * ru - uv * rv) / det, (uu * rv - uv * ru) / det);
        (s, t) = ((s + ds).clamp(-3.0, 3.0), (t + dt).clamp(-3.0, 3.0));
        if ds * ds + dt * dt < 1e-16 {
            break;
        }
    }
    [s, t]
}

fn place(corners: &[&[f64; 3]; 4], p: &[f64; 3], [s, t]: [f64; 2]) -> Foot {
    let c = coefficients(corners);
    let r: [f64; 3] = std::array::from_fn(|a| p[a] - (c[0][a] + s * c[1][a] + t * (c[2][a] + s * c[3][a])));
    let u: [f64; 3] = std::array::from_fn(|a| c[1][a] + t * c[3][a]);
    let v: [f64; 3] = std::array::from_fn(|a| c[2][a] + s * c[3][a]);
    let n = cross(&u, &v);
    let size = norm(&n).max(f64::MIN_POSITIVE);
    let normal = n.map(|x| x / size);
    let weights = [(1.0 - s) * (1.0 - t), (1.0 + s) * (1.0 - t), (1.0 + s) * (1.0 + t), (1.0 - s) * (1.0 + t)];
    Foot { quad: NONE, at: [s, t], height: dot(&r, &normal), normal, weights: weights.map(|w| w / 4.0) }
}

/// `c0 + s c1 + t c2 + s t c3`.
#[inline(always)]
fn coefficients(p: &[&[f64; 3]; 4]) -> [[f64; 3]; 4] {
    let sum = |signs: [f64; 4]| std::array::from_fn(|a| (0..4).map(|k| signs[k] * p[k][a]).sum::<f64>() / 4.0);
    [sum([1.0, 1.0, 1.0, 1.0]), sum([-1.0, 1.0, 1.0, -1.0]), sum([-1.0, -1.0, 1.0, 1.0]), sum([1.0, -1.0, 1.0, -1.0])]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plate() -> (Surface, Vec<[f64; 3]>) {
        let mut x = Vec::new();
        for j in 0..4 {
            for i in 0..4 {
                let (i, j) = (f64::from(i), f64::from(j));
                x.push([i + 0.1 * (i * j).sin(), j + 0.1 * (i + j).cos(), 0.02 * i * j]);
            }
        }
        let quads = (0..9).map(|q| (q / 3 * 4 + q % 3) as u32).map(|n| [n, n + 1, n + 5, n + 4]).collect();
        let face = Surface::new(quads, &x);
        (face, x)
    }

    #[test]
    fn a_walk_from_anywhere_finds_the_same_foot() {
        let (face, x) = plate();
        let p = [1.7, 2.2, -0.05];
        let found: Vec<Foot> = (0..9).map(|q| foot(&face, &x, &p, (q, [0.0; 2])).unwrap()).collect();
        for f in &found {
            assert_eq!(f.quad, found[0].quad);
            assert!((f.height - found[0].height).abs() < 1e-12);
            assert!((f.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        }
        assert!(found[0].height < 0.0 && found[0].height > -0.3);
        assert!(foot(&face, &x, &[-0.5, 1.0, 0.0], (4, [0.0; 2])).is_none());
    }
}
