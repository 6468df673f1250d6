//! Regions of the plane as pixels: exact distance maps, opening, holes, components.

use crate::parametrise::Flat;
use nalgebra::Vector2;

/// Pixels of the plane, `width` x `height`, pixel (i, j) centred at `origin + pitch (i, j)` [mm].
#[derive(Clone, Debug)]
pub struct Raster {
    /// Centre of pixel (0, 0) [mm].
    pub origin: Flat,
    /// Distance between pixels [mm].
    pub pitch: f64,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// No raster has more pixels than this.
const MOST_PIXELS: f64 = 16e6;

impl Raster {
    /// A raster around `points` with `margin` [mm] on all sides; `None` when empty, not finite or unreasonably large.
    pub fn around(points: &[Flat], pitch: f64, margin: f64) -> Option<Raster> {
        let first = points.first()?.coords;
        let (lo, hi) = points.iter().fold((first, first), |(lo, hi), p| (lo.inf(&p.coords), hi.sup(&p.coords)));
        let size = (hi - lo).add_scalar(2.0 * margin) / pitch;
        let fits = size.iter().all(|s| s.is_finite()) && size.x * size.y < MOST_PIXELS;
        fits.then(|| Raster {
            origin: Flat::from(lo.add_scalar(-margin)),
            pitch,
            width: size.x.ceil() as usize + 1,
            height: size.y.ceil() as usize + 1,
        })
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.width * self.height
    }

    /// Whether there is no pixel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sets every pixel whose centre lies in the triangle to the value interpolated from its corners.
    pub fn paint(&self, pixels: &mut [f64], corners: &[Flat; 3], values: [f64; 3]) {
        let [a, b, c] = corners.map(|p| (p - self.origin) / self.pitch);
        let area = (b - a).perp(&(c - a));
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let (lo, hi) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
        let clamp = |x: f64, n: usize| x.clamp(0.0, (n - 1) as f64) as usize;
        for j in clamp(lo.y.ceil(), self.height)..=clamp(hi.y.floor(), self.height) {
            for i in clamp(lo.x.ceil(), self.width)..=clamp(hi.x.floor(), self.width) {
                let p = Vector2::new(i as f64, j as f64);
                let weights =
                    [(b - p).perp(&(c - p)), (c - p).perp(&(a - p)), (a - p).perp(&(b - p))].map(|w| w / area);
                if weights.iter().all(|w| *w >= -1e-12) {
                    pixels[j * self.width + i] = (0..3).map(|k| weights[k] * values[k]).sum();
                }
            }
        }
    }

    /// Bilinear value at `p`, the border's beyond it.
    pub fn sample(&self, pixels: &[f64], p: &Flat) -> f64 {
        let q = (p - self.origin) / self.pitch;
        let x = q.x.clamp(0.0, (self.width - 1) as f64 - 1e-9).max(0.0);
        let y = q.y.clamp(0.0, (self.height - 1) as f64 - 1e-9).max(0.0);
        let (i, j) = (x as usize, y as usize);
        let (u, v) = (x - i as f64, y - j as f64);
        let at = |i: usize, j: usize| pixels[j.min(self.height - 1) * self.width + i.min(self.width - 1)];
        (1.0 - v) * ((1.0 - u) * at(i, j) + u * at(i + 1, j)) + v * ((1.0 - u) * at(i, j + 1) + u * at(i + 1, j + 1))
    }

    /// Signed distance [mm] to the border of a region: positive inside.
    pub fn signed_distance(&self, inside: &[bool]) -> Vec<f64> {
        let out = self.distance_to(&inside.iter().map(|i| !i).collect::<Vec<_>>());
        let into = self.distance_to(inside);
        let half = 0.5 * self.pitch;
        (0..self.len()).map(|k| if inside[k] { out[k] - half } else { half - into[k] }).collect()
    }

    /// The part of a region that a disc of `radius` [mm] can sweep.
    pub fn opened(&self, inside: &[bool], radius: f64) -> Vec<bool> {
        let core: Vec<bool> = self.signed_distance(inside).into_iter().map(|d| d >= radius).collect();
        let core = self.largest_part(&core);
        self.distance_to(&core).into_iter().map(|d| d <= radius).collect()
    }

    /// The largest 4-connected part of a region.
    pub fn largest_part(&self, inside: &[bool]) -> Vec<bool> {
        let (part, sizes) = self.parts(inside);
        let largest = (1..sizes.len()).max_by_key(|&k| (sizes[k], std::cmp::Reverse(k)));
        part.into_iter().map(|p| Some(p as usize) == largest).collect()
    }

    /// The region with its holes of at most `area` [mm2] filled, and how many were.
    pub fn holes_filled(&self, inside: &[bool], area: f64) -> (Vec<bool>, usize) {
        let (part, sizes) = self.parts(&inside.iter().map(|i| !i).collect::<Vec<_>>());
        let mut touches = vec![false; sizes.len()];
        for (k, &p) in part.iter().enumerate() {
            let (i, j) = (k % self.width, k / self.width);
            if i == 0 || j == 0 || i + 1 == self.width || j + 1 == self.height {
                touches[p as usize] = true;
            }
        }
        let fill = |p: u32| !touches[p as usize] && sizes[p as usize] as f64 * self.pitch * self.pitch <= area;
        let count = (1..sizes.len() as u32).filter(|&p| fill(p)).count();
        (part.iter().zip(inside).map(|(&p, &i)| i || fill(p)).collect(), count)
    }

    /// A map blurred by a Gaussian of standard deviation `sigma` [mm] (three box passes).
    pub fn blurred(&self, pixels: &[f64], sigma: f64) -> Vec<f64> {
        let half = ((4.0 * (sigma / self.pitch).powi(2) + 1.0).sqrt() / 2.0).round().max(0.0) as usize;
        let mut map = pixels.to_vec();
        for _ in 0..3 {
            map = self.box_rows(&map, half);
            map = self.box_columns(&map, half);
        }
        map
    }

    fn box_rows(&self, map: &[f64], half: usize) -> Vec<f64> {
        map.chunks(self.width).flat_map(|row| box_mean(row, half)).collect()
    }

    fn box_columns(&self, map: &[f64], half: usize) -> Vec<f64> {
        let mut out = vec![0.0; map.len()];
        for i in 0..self.width {
            let column: Vec<f64> = (0..self.height).map(|j| map[j * self.width + i]).collect();
            for (j, value) in box_mean(&column, half).into_iter().enumerate() {
                out[j * self.width + i] = value;
            }
        }
        out
    }

    /// Part number of each pixel (0 outside the region) and the size of each part.
    fn parts(&self, inside: &[bool]) -> (Vec<u32>, Vec<usize>) {
        let (mut part, mut sizes, mut stack) = (vec![0u32; self.len()], vec![0], Vec::new());
        for start in 0..self.len() {
            if !inside[start] || part[start] != 0 {
                continue;
            }
            let number = sizes.len() as u32;
            sizes.push(0);
            part[start] = number;
            stack.push(start);
            while let Some(k) = stack.pop() {
                sizes[number as usize] += 1;
                let (i, j) = (k % self.width, k / self.width);
                let around = [
                    (i > 0).then(|| k - 1),
                    (i + 1 < self.width).then(|| k + 1),
                    (j > 0).then(|| k - self.width),
                    (j + 1 < self.height).then(|| k + self.width),
                ];
                for next in around.into_iter().flatten() {
                    if inside[next] && part[next] == 0 {
                        part[next] = number;
                        stack.push(next);
                    }
                }
            }
        }
        (part, sizes)
    }

    /// Euclidean distance [mm] from each pixel to the nearest of `set` [felzenszwalb2012]; the
    /// raster's extent for an empty set.
    fn distance_to(&self, set: &[bool]) -> Vec<f64> {
        if !set.contains(&true) {
            return vec![(self.width + self.height) as f64 * self.pitch; self.len()];
        }
        let mut map: Vec<f64> = set.iter().map(|s| if *s { 0.0 } else { f64::INFINITY }).collect();
        for row in map.chunks_mut(self.width) {
            lower_envelope(row);
        }
        let mut column = vec![0.0; self.height];
        for i in 0..self.width {
            for (j, c) in column.iter_mut().enumerate() {
                *c = map[j * self.width + i];
            }
            lower_envelope(&mut column);
            for (j, c) in column.iter().enumerate() {
                map[j * self.width + i] = c.sqrt() * self.pitch;
            }
        }
        map
    }
}

fn box_mean(values: &[f64], half: usize) -> Vec<f64> {
    let n = values.len() as isize;
    let at = |k: isize| values[k.clamp(0, n - 1) as usize];
    let half = half as isize;
    let mut sum: f64 = (-half..=half).map(at).sum();
    (0..n)
        .map(|k| {
            let mean = sum / (2 * half + 1) as f64;
            sum += at(k + half + 1) - at(k - half);
            mean
        })
        .collect()
}

/// Replaces f by min over q of f(q) + (p - q)^2, in linear time.
fn lower_envelope(f: &mut [f64]) {
    let n = f.len();
    let (mut vertex, mut from): (Vec<usize>, Vec<f64>) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for q in 0..n {
        if !f[q].is_finite() {
            continue;
        }
        let meet = |v: usize| ((f[q] + (q * q) as f64) - (f[v] + (v * v) as f64)) / (2.0 * (q as f64 - v as f64));
        while let (Some(&v), Some(&start)) = (vertex.last(), from.last()) {
            if meet(v) > start {
                break;
            }
            vertex.pop();
            from.pop();
        }
        from.push(vertex.last().map_or(f64::NEG_INFINITY, |&v| meet(v)));
        vertex.push(q);
    }
    if vertex.is_empty() {
        return;
    }
    let old = f.to_vec();
    let mut k = 0;
    for (p, value) in f.iter_mut().enumerate() {
        while k + 1 < vertex.len() && from[k + 1] < p as f64 {
            k += 1;
        }
        let v = vertex[k];
        *value = old[v] + (p as f64 - v as f64).powi(2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(radius: f64) -> (Raster, Vec<bool>) {
        let raster = Raster { origin: Flat::new(-12.0, -12.0), pitch: 0.2, width: 121, height: 121 };
        let inside = (0..raster.len())
            .map(|k| {
                let p = Vector2::new((k % 121) as f64 * 0.2 - 12.0, (k / 121) as f64 * 0.2 - 12.0);
                p.norm() < radius
            })
            .collect();
        (raster, inside)
    }

    #[test]
    fn distance_of_a_disc_is_radial() {
        let (raster, inside) = disc(8.0);
        let map = raster.signed_distance(&inside);
        for p in [Flat::new(0.0, 0.0), Flat::new(3.0, 4.0), Flat::new(-6.0, 8.0), Flat::new(11.0, 0.0)] {
            assert!((raster.sample(&map, &p) - (8.0 - p.coords.norm())).abs() < 0.2);
        }
    }

    #[test]
    fn opening_cuts_a_whisker_and_filling_closes_a_hole() {
        let (raster, mut inside) = disc(8.0);
        let plain = raster.opened(&inside, 1.0);
        for i in 60..121 {
            inside[60 * 121 + i] = true;
        }
        assert_eq!(raster.opened(&inside, 1.0), plain);
        inside[50 * 121 + 60] = false;
        assert_eq!(raster.holes_filled(&inside, 1.0).1, 1);
        assert_eq!(raster.holes_filled(&inside, 0.01).1, 0);
    }
}
