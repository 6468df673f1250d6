//! The region to be meshed: a smooth function that is the distance inside its outline.

use super::Raster;
use crate::parametrise::Flat;
use nalgebra::Vector2;

/// A flat region as a smooth map of the distance inside its outline [mm], positive within.
pub struct Outline {
    raster: Raster,
    inside_mm: Vec<f64>,
}

impl Outline {
    /// The region where a disc of radius `opening` [mm] fits, drawn in by `inset` [mm], its outline smoothed over `smoothing` [mm].
    pub fn new(raster: Raster, inside: &[bool], opening: f64, inset: f64, smoothing: f64) -> Outline {
        let opened = raster.opened(inside, opening);
        let sharp: Vec<f64> = raster.signed_distance(&opened).into_iter().map(|d| d - inset).collect();
        let inside_mm = raster.blurred(&sharp, smoothing);
        Outline { raster, inside_mm }
    }

    /// Distance inside the outline at `p` [mm].
    pub fn depth(&self, p: &Flat) -> f64 {
        self.raster.sample(&self.inside_mm, p)
    }

    /// Inward direction at `p`, length about 1.
    pub fn inward(&self, p: &Flat) -> Vector2<f64> {
        let e = self.raster.pitch;
        let x = Vector2::new(e, 0.0);
        let y = Vector2::new(0.0, e);
        Vector2::new(self.depth(&(p + x)) - self.depth(&(p - x)), self.depth(&(p + y)) - self.depth(&(p - y)))
            / (2.0 * e)
    }

    /// The point of the outline near `p`.
    pub fn foot(&self, p: &Flat) -> Flat {
        let mut q = *p;
        for _ in 0..8 {
            let (depth, inward) = (self.depth(&q), self.inward(&q));
            let slope = inward.norm_squared();
            if depth.abs() < 1e-6 || slope < 1e-4 {
                break;
            }
            q -= inward * (depth / slope.max(0.25));
        }
        q
    }

    /// The turn [rad] that brings most of the outline parallel to the axes.
    pub fn main_angle(&self) -> f64 {
        let mut sum = Vector2::zeros();
        for k in 0..self.raster.len() {
            if self.inside_mm[k].abs() < self.raster.pitch {
                let (i, j) = (k % self.raster.width, k / self.raster.width);
                let n = self.inward(&(self.raster.origin + Vector2::new(i as f64, j as f64) * self.raster.pitch));
                let angle = 4.0 * n.y.atan2(n.x);
                sum += Vector2::new(angle.cos(), angle.sin());
            }
        }
        -sum.y.atan2(sum.x) / 4.0
    }

    /// Corners of the box around the region [mm].
    pub fn bounds(&self) -> (Flat, Flat) {
        let size = Vector2::new(self.raster.width as f64, self.raster.height as f64) * self.raster.pitch;
        (self.raster.origin, self.raster.origin + size)
    }
}
