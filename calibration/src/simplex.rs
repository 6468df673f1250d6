//! Nelder and Mead's simplex [nelder1965] in a unit box: points beyond it are moved onto it; coefficients for many variables by Gao
//! and Han [gao2012].

use serde::{Deserialize, Serialize};

/// A simplex between two iterations: costs and corners, lowest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Simplex {
    corners: Vec<(f64, Vec<f64>)>,
}

impl Simplex {
    /// A simplex at a point of known cost, `size` along each axis (inwards near a wall); evaluates one corner an axis.
    pub fn new(start: (f64, Vec<f64>), size: f64, evaluate: &mut dyn FnMut(&[Vec<f64>]) -> Vec<f64>) -> Simplex {
        let points: Vec<Vec<f64>> = (0..start.1.len())
            .map(|k| {
                let mut p = start.1.clone();
                p[k] = if p[k] + size <= 1.0 { p[k] + size } else { p[k] - size };
                p
            })
            .collect();
        let mut corners = vec![start];
        corners.extend(evaluate(&points).into_iter().zip(points));
        let mut simplex = Simplex { corners };
        simplex.sort();
        simplex
    }

    /// The lowest corner.
    pub fn best(&self) -> Option<&(f64, Vec<f64>)> {
        self.corners.first()
    }

    /// Largest distance of a corner from the lowest along any axis [-].
    pub fn size(&self) -> f64 {
        let Some(best) = self.best() else { return 0.0 };
        let far = |c: &(f64, Vec<f64>)| c.1.iter().zip(&best.1).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        self.corners.iter().map(far).fold(0.0, f64::max)
    }

    /// One iteration: reflection, expansion, contraction or shrinking.
    pub fn advance(&mut self, evaluate: &mut dyn FnMut(&[Vec<f64>]) -> Vec<f64>) {
        let n = self.corners.len().saturating_sub(1);
        if n == 0 {
            return;
        }
        let dim = n.max(2) as f64;
        let (expand, contract, shrink) = (1.0 + 2.0 / dim, 0.75 - 0.5 / dim, 1.0 - 1.0 / dim);
        let middle: Vec<f64> =
            (0..n).map(|k| self.corners[..n].iter().map(|c| c.1[k]).sum::<f64>() / n as f64).collect();
        let worst = self.corners[n].clone();
        let along = |t: f64| -> Vec<f64> {
            middle.iter().zip(&worst.1).map(|(m, w)| (m + t * (m - w)).clamp(0.0, 1.0)).collect()
        };
        let mut try_at = |t: f64| {
            let p = along(t);
            (evaluate(std::slice::from_ref(&p)).first().copied().unwrap_or(f64::INFINITY), p)
        };
        let reflected = try_at(1.0);
        let (lowest, second) = (self.corners[0].0, self.corners[n - 1].0);
        let better = if reflected.0 < lowest {
            let expanded = try_at(expand);
            Some(if expanded.0 < reflected.0 { expanded } else { reflected })
        } else if reflected.0 < second {
            Some(reflected)
        } else {
            let (limit, t) = if reflected.0 < worst.0 { (reflected.0, contract) } else { (worst.0, -contract) };
            let contracted = try_at(t);
            (contracted.0 < limit).then_some(contracted)
        };
        match better {
            Some(corner) => self.corners[n] = corner,
            None => self.shrink(shrink, evaluate),
        }
        self.sort();
    }

    /// Draws all corners towards the lowest.
    fn shrink(&mut self, share: f64, evaluate: &mut dyn FnMut(&[Vec<f64>]) -> Vec<f64>) {
        let best = self.corners[0].1.clone();
        let draw = |c: &(f64, Vec<f64>)| best.iter().zip(&c.1).map(|(b, x)| b + share * (x - b)).collect::<Vec<f64>>();
        let points: Vec<Vec<f64>> = self.corners[1..].iter().map(draw).collect();
        for (corner, new) in self.corners[1..].iter_mut().zip(evaluate(&points).into_iter().zip(points)) {
            *corner = new;
        }
    }

    fn sort(&mut self) {
        self.corners.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(f: &dyn Fn(&[f64]) -> f64, start: &[f64], iterations: usize) -> (f64, Vec<f64>) {
        let mut evaluate = |points: &[Vec<f64>]| -> Vec<f64> {
            assert!(points.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
            points.iter().map(|p| f(p)).collect()
        };
        let mut simplex = Simplex::new((f(start), start.to_vec()), 0.1, &mut evaluate);
        for _ in 0..iterations {
            simplex.advance(&mut evaluate);
        }
        simplex.best().unwrap().clone()
    }

    #[test]
    fn finds_the_floor_of_rosenbrocks_valley() {
        let valley = |x: &[f64]| {
            let (a, b) = (4.0 * x[0] - 2.0, 4.0 * x[1] - 2.0);
            (1.0 - a).powi(2) + 100.0 * (b - a * a).powi(2)
        };
        let (cost, x) = run(&valley, &[0.2, 0.7], 300);
        assert!(cost < 1e-8 && (x[0] - 0.75).abs() < 1e-4, "{cost} {x:?}");
    }

    #[test]
    fn finds_a_minimum_at_a_wall() {
        let slope = |x: &[f64]| x[0] + (x[1] - 0.4).powi(2) - x[2];
        let (cost, x) = run(&slope, &[0.5, 0.9, 0.5], 300);
        assert!((cost + 1.0).abs() < 1e-6, "{cost} {x:?}");
    }
}
