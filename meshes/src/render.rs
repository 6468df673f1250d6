//! Pictures of surfaces: an orthographic z-buffer with one headlight, enough to look at what was made.

use crate::surface::TriMesh;
use crate::{Point, Vector};

/// Where the eye is and which way is up.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Unit vector from the object towards the eye.
    pub towards_eye: Vector,
    /// Unit vector that is up in the picture.
    pub up: Vector,
}

/// A surface with its colours: one for all or one a vertex.
pub struct Painted<'a> {
    /// The surface.
    pub mesh: &'a TriMesh,
    /// Red, green, blue: one, or as many as vertices.
    pub colours: &'a [[u8; 3]],
}

/// A picture, rows from the top, 3 bytes a pixel.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Red, green, blue of each pixel.
    pub pixels: Vec<u8>,
}

/// Draws the surfaces so that all of them fit; both sides of a triangle are lit.
pub fn render(surfaces: &[Painted], view: &View, width: usize, height: usize) -> Picture {
    let across = view.up.cross(&view.towards_eye).normalize();
    let up = view.towards_eye.cross(&across).normalize();
    let axes = [across, up, view.towards_eye.normalize()];
    let (scale, middle) = fit(surfaces, &axes, width, height);
    let mut canvas = Canvas {
        picture: Picture { width, height, pixels: vec![255; 3 * width * height] },
        depth: vec![f64::NEG_INFINITY; width * height],
    };
    for surface in surfaces {
        let normals = surface.mesh.vertex_normals();
        let corner = |v: u32| {
            let p = surface.mesh.vertices[v as usize].coords;
            let colour = if surface.colours.len() == 1 { surface.colours[0] } else { surface.colours[v as usize] };
            let light = 0.25 + 0.75 * normals[v as usize].dot(&axes[2]).abs();
            Corner {
                x: (p.dot(&axes[0]) - middle[0]) * scale + width as f64 / 2.0,
                y: height as f64 / 2.0 - (p.dot(&axes[1]) - middle[1]) * scale,
                z: p.dot(&axes[2]),
                colour: colour.map(|c| f64::from(c) * light),
            }
        };
        for t in &surface.mesh.triangles {
            canvas.triangle(&t.map(corner));
        }
    }
    canvas.picture
}

/// A small sphere to mark a point.
pub fn ball(centre: &Point, radius: f64) -> TriMesh {
    let mut mesh = crate::shapes::icosphere(radius, 2);
    for p in &mut mesh.vertices {
        *p += centre.coords;
    }
    mesh
}

/// A thin closed tube from `a` to `b` to mark a line.
pub fn tube(a: &Point, b: &Point, radius: f64) -> TriMesh {
    const SIDES: u32 = 8;
    let Some(axis) = (b - a).try_normalize(1e-12) else { return ball(a, radius) };
    let helper = if axis.x.abs() < 0.9 { Vector::x() } else { Vector::y() };
    let u = axis.cross(&helper).normalize();
    let v = axis.cross(&u);
    let mut mesh = TriMesh::default();
    for end in [a, b] {
        for k in 0..SIDES {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(SIDES);
            mesh.vertices.push(end + (u * angle.cos() + v * angle.sin()) * radius);
        }
    }
    for k in 0..SIDES {
        let next = (k + 1) % SIDES;
        mesh.triangles.push([k, next, SIDES + k]);
        mesh.triangles.push([next, SIDES + next, SIDES + k]);
    }
    mesh
}

struct Corner {
    x: f64,
    y: f64,
    z: f64,
    colour: [f64; 3],
}

struct Canvas {
    picture: Picture,
    depth: Vec<f64>,
}

impl Canvas {
    fn triangle(&mut self, [a, b, c]: &[Corner; 3]) {
        let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if !area.is_normal() {
            return;
        }
        let bound = |lo: f64, hi: f64, size: usize| {
            (lo.floor().clamp(0.0, size as f64) as usize, (hi.ceil() + 1.0).clamp(0.0, size as f64) as usize)
        };
        let (x0, x1) = bound(a.x.min(b.x).min(c.x), a.x.max(b.x).max(c.x), self.picture.width);
        let (y0, y1) = bound(a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y), self.picture.height);
        for y in y0..y1 {
            for x in x0..x1 {
                let (px, py) = (x as f64 + 0.5, y as f64 + 0.5);
                let u = ((b.x - px) * (c.y - py) - (b.y - py) * (c.x - px)) / area;
                let v = ((c.x - px) * (a.y - py) - (c.y - py) * (a.x - px)) / area;
                let w = 1.0 - u - v;
                let z = u * a.z + v * b.z + w * c.z;
                let pixel = y * self.picture.width + x;
                if u < 0.0 || v < 0.0 || w < 0.0 || z <= self.depth[pixel] {
                    continue;
                }
                self.depth[pixel] = z;
                for k in 0..3 {
                    let value = u * a.colour[k] + v * b.colour[k] + w * c.colour[k];
                    self.picture.pixels[3 * pixel + k] = value.clamp(0.0, 255.0) as u8;
                }
            }
        }
    }
}

fn fit(surfaces: &[Painted], axes: &[Vector; 3], width: usize, height: usize) -> (f64, [f64; 2]) {
    let mut lo = [f64::INFINITY; 2];
    let mut hi = [f64::NEG_INFINITY; 2];
    for p in surfaces.iter().flat_map(|s| &s.mesh.vertices) {
        for k in 0..2 {
            lo[k] = lo[k].min(p.coords.dot(&axes[k]));
            hi[k] = hi[k].max(p.coords.dot(&axes[k]));
        }
    }
    if lo[0] > hi[0] {
        return (1.0, [0.0; 2]);
    }
    let scale = (width as f64 / (hi[0] - lo[0]).max(1e-9)).min(height as f64 / (hi[1] - lo[1]).max(1e-9)) * 0.94;
    (scale, [f64::midpoint(lo[0], hi[0]), f64::midpoint(lo[1], hi[1])])
}

/// A colour for `value` between `lo` and `hi`: blue, white, red where `lo < 0 < hi` is meant, dark to bright otherwise.
pub fn colour(value: f64, lo: f64, hi: f64) -> [u8; 3] {
    let t = ((value - lo) / (hi - lo).max(1e-300)).clamp(0.0, 1.0);
    let stops: [[f64; 3]; 5] =
        [[49.0, 54.0, 149.0], [116.0, 173.0, 209.0], [255.0, 255.0, 191.0], [244.0, 109.0, 67.0], [165.0, 0.0, 38.0]];
    let at = t * 4.0;
    let k = (at as usize).min(3);
    let f = at - k as f64;
    [0, 1, 2].map(|c| (stops[k][c] * (1.0 - f) + stops[k + 1][c] * f) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::icosphere;

    #[test]
    fn a_sphere_fills_its_disc() {
        let sphere = icosphere(1.0, 3);
        let view = View { towards_eye: Vector::y(), up: Vector::z() };
        let picture = render(&[Painted { mesh: &sphere, colours: &[[200, 0, 0]] }], &view, 100, 100);
        let drawn = picture.pixels.chunks(3).filter(|p| p[1] != 255).count() as f64;
        let disc = std::f64::consts::PI * 47.0 * 47.0;
        assert!((drawn / disc - 1.0).abs() < 0.05, "{drawn} of {disc}");
    }
}
