//! Lines drawn around places on a bone, whose region is known.
#![allow(dead_code, reason = "each user takes its part")]

use meshes::surface::{ColouredMesh, TriMesh};
use meshes::{Point, Vector};
use std::fmt::Write;
use std::io::Cursor;

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Style {
    /// Of this width all around [mm].
    Even(f64),
    /// A quarter of it is missing, in three gaps.
    Broken(f64),
    /// Wiped outwards over a quarter of the way round, inwards over a ninth.
    Smeared(f64),
}

/// What the line is drawn on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Ground {
    /// Bone that has gone brown.
    pub(crate) brown: bool,
    /// A blue sticker and a grey screw right beside the line.
    pub(crate) clutter: bool,
}

/// A closed line about a place: an ellipse with three waves in the plane that touches there.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    pub(crate) centre: Point,
    normal: Vector,
    axes: [Vector; 2],
    half: [f64; 2],
}

const INK: [f64; 3] = [24.0, 23.0, 26.0];
const STICKER: [f64; 3] = [34.0, 62.0, 196.0];
const SCREW: [f64; 3] = [150.0, 151.0, 156.0];

impl Line {
    pub(crate) fn new(centre: Point, normal: Vector, half: [f64; 2]) -> Line {
        let least = Vector::ith(normal.iamin(), 1.0);
        let across = normal.cross(&least).normalize();
        Line { centre, normal, axes: [across, normal.cross(&across)], half }
    }

    /// Angle around the middle, how far it is to the line's middle there, and how far outside the line a point lies [mm].
    fn stand(&self, p: &Point) -> (f64, f64, f64) {
        let d = p - self.centre;
        let (x, y) = (d.dot(&self.axes[0]), d.dot(&self.axes[1]));
        let angle = y.atan2(x);
        let ellipse = (angle.cos() / self.half[0]).hypot(angle.sin() / self.half[1]).recip();
        let radius = ellipse * (1.0 + 0.06 * (3.0 * angle + 0.7).cos());
        (angle, radius, x.hypot(y) - radius)
    }

    fn faces(&self, p: &Point, normal: &Vector) -> bool {
        (p - self.centre).norm() < 20.0 && normal.dot(&self.normal) > 0.2
    }

    /// How much ink lies at a point, 0 to 1.
    pub(crate) fn ink(&self, style: Style, p: &Point, normal: &Vector) -> f64 {
        if !self.faces(p, normal) {
            return 0.0;
        }
        let (angle, _, off) = self.stand(p);
        let line = |width: f64| ((width / 2.0 - off.abs()) / 0.3 + 0.5).clamp(0.0, 1.0);
        match style {
            Style::Even(width) => line(width),
            Style::Broken(width) => {
                let gap = (3.0 * angle / std::f64::consts::TAU).rem_euclid(1.0) < 0.25;
                if gap { 0.0 } else { line(width) }
            }
            Style::Smeared(width) => {
                let outward = (0.3..1.9).contains(&angle) && (0.0..4.0).contains(&off);
                let inward = (-2.4..-1.7).contains(&angle) && (-2.0..0.0).contains(&off);
                let wiped =
                    if outward || inward { 0.8 * (1.0 - off.abs() / if outward { 4.0 } else { 2.0 }) } else { 0.0 };
                line(width).max(wiped)
            }
        }
    }

    /// The colour at a point whose bone has the colour `bare`.
    pub(crate) fn colour(&self, bare: [f64; 3], style: Style, ground: Ground, p: &Point, normal: &Vector) -> [f64; 3] {
        let mut under = bare;
        if ground.clutter && self.faces(p, normal) {
            for (colour, turn, size) in [(STICKER, 0.9, 3.2), (SCREW, 3.6, 2.8)] {
                let (angle, radius, off) = self.stand(p);
                let (x, y) = ((radius + off) * (angle - turn).cos(), (radius + off) * (angle - turn).sin());
                let rim = self.half[0].max(self.half[1]) + 2.0;
                if (x - rim - size).hypot(y) < size {
                    under = colour;
                }
            }
        }
        let ink = self.ink(style, p, normal);
        std::array::from_fn(|k| under[k] + ink * (INK[k] - under[k]))
    }

    /// Area [mm2] and centroid of what the middle of the line encloses on a surface.
    pub(crate) fn region(&self, mesh: &TriMesh) -> (f64, Point) {
        let normals = mesh.vertex_normals();
        let level = |v: u32| {
            let (p, n) = (&mesh.vertices[v as usize], &normals[v as usize]);
            if self.faces(p, n) { self.stand(p).2 } else { f64::INFINITY }
        };
        let (mut area, mut moment) = (0.0, Vector::zeros());
        for triangle in &mesh.triangles {
            let levels = triangle.map(level);
            if levels.iter().all(|l| *l >= 0.0) || levels.iter().any(|l| l.is_infinite()) {
                continue;
            }
            let mut polygon: Vec<Point> = Vec::new();
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                let (p, q, l, m) =
                    (mesh.vertices[a as usize], mesh.vertices[b as usize], levels[k], levels[(k + 1) % 3]);
                if l < 0.0 {
                    polygon.push(p);
                }
                if (l < 0.0) != (m < 0.0) {
                    polygon.push(p + (q - p) * (l / (l - m)));
                }
            }
            for pair in polygon.windows(2).skip(1) {
                let piece = (pair[0] - polygon[0]).cross(&(pair[1] - polygon[0])).norm() / 2.0;
                area += piece;
                moment += piece * (polygon[0].coords + pair[0].coords + pair[1].coords) / 3.0;
            }
        }
        (area, Point::from(moment / area))
    }
}

/// Bone that has gone brown.
pub(crate) fn browned(bare: [f64; 3]) -> [f64; 3] {
    [0.55 * bare[0], 0.43 * bare[1], 0.34 * bare[2]]
}

/// Up to `count` places of a scan, 30 mm apart, where 15 mm around is bare bone that faces one way, without ink, stickers
/// or border.
pub(crate) fn free_places(scan: &ColouredMesh, count: usize) -> Vec<(Point, Vector)> {
    let (mesh, normals) = (&scan.mesh, scan.mesh.vertex_normals());
    let yellow = |c: &[u8; 3]| c[0] > 150 && c[0] > c[2].saturating_add(25);
    let mut kept: Vec<(Point, Vector)> = Vec::new();
    let mut border = vec![false; mesh.vertices.len()];
    let mut sides = std::collections::BTreeMap::<(u32, u32), u32>::new();
    for &[a, b, c] in &mesh.triangles {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            *sides.entry((p.min(q), p.max(q))).or_default() += 1;
        }
    }
    for (&(p, q), _) in sides.iter().filter(|(_, n)| **n == 1) {
        (border[p as usize], border[q as usize]) = (true, true);
    }
    for v in (0..mesh.vertices.len()).step_by(97) {
        let (p, n) = (mesh.vertices[v], normals[v]);
        if kept.iter().any(|(q, _)| (p - q).norm() < 30.0) {
            continue;
        }
        let near = (0..mesh.vertices.len()).filter(|&w| (mesh.vertices[w] - p).norm() < 15.0);
        let (mut all, mut odd) = (0, 0);
        for w in near {
            all += 1;
            let facing = (mesh.vertices[w] - p).norm() > 9.0 || normals[w].dot(&n) > 0.6;
            odd += usize::from(!yellow(&scan.colours[w]) || border[w]) + usize::from(!facing);
        }
        if all > 100 && 100 * odd < all {
            kept.push((p, n));
        }
        if kept.len() == count {
            break;
        }
    }
    kept
}

/// The scan with lines of a style drawn on it.
pub(crate) fn drawn(scan: &ColouredMesh, lines: &[Line], style: Style, ground: Ground) -> ColouredMesh {
    let normals = scan.mesh.vertex_normals();
    let yellow = |c: &[u8; 3]| c[0] > 150 && c[0] > c[2].saturating_add(25);
    let colours = (0..scan.colours.len()).map(|v| {
        let (p, n) = (&scan.mesh.vertices[v], &normals[v]);
        let own = scan.colours[v];
        let bare = own.map(f64::from);
        let bare = if ground.brown && yellow(&own) { browned(bare) } else { bare };
        lines.iter().fold(bare, |c, l| l.colour(c, style, ground, p, n)).map(|x| x.round() as u8)
    });
    ColouredMesh { mesh: scan.mesh.clone(), colours: colours.collect() }
}

/// A picture's format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Picture {
    Png,
    Jpeg,
}

/// Side of the square of a triangle in the texture [pixel].
const CELL: usize = 8;

/// The surface as an OBJ with its MTL and a texture painted by `paint` (place, normal) at eight pixels a triangle's edge,
/// by file name; the OBJ first.
pub(crate) fn textured(
    mesh: &TriMesh,
    picture: Picture,
    paint: impl Fn(&Point, &Vector) -> [f64; 3],
) -> Vec<(String, Vec<u8>)> {
    let side = (mesh.triangles.len() as f64).sqrt().ceil() as usize;
    let size = (side * CELL) as u32;
    let mut image = image::RgbImage::new(size, size);
    let normals = mesh.triangle_normals();
    let mut obj = String::from("mtllib scan.mtl\nusemtl bone\n");
    mesh.vertices.iter().for_each(|p| _ = writeln!(obj, "v {} {} {}", p.x, p.y, p.z));
    let inner = (CELL - 3) as f64;
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        let (left, top) = (t % side * CELL, t / side * CELL);
        for (i, j) in (0..CELL).flat_map(|i| (0..CELL).map(move |j| (i, j))) {
            let (u, v) = ((i as f64 - 1.0) / inner, (j as f64 - 1.0) / inner);
            let colour = paint(&(a + u * (b - a) + v * (c - a)), &normals[t]).map(|x| x.round() as u8);
            image.put_pixel((left + i) as u32, (top + j) as u32, image::Rgb(colour));
        }
        for (i, j) in [(1, 1), (CELL - 2, 1), (1, CELL - 2)] {
            let at = |k: usize| (k as f64 + 0.5) / f64::from(size);
            let _ = writeln!(obj, "vt {} {}", at(left + i), 1.0 - at(top + j));
        }
        let corner = |k: usize| format!("{}/{}", triangle[k] + 1, 3 * t + k + 1);
        let _ = writeln!(obj, "f {} {} {}", corner(0), corner(1), corner(2));
    }
    let (name, format) = match picture {
        Picture::Png => ("scan.png", image::ImageFormat::Png),
        Picture::Jpeg => ("scan.jpg", image::ImageFormat::Jpeg),
    };
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).expect("a picture in memory");
    let mtl = format!("newmtl bone\nmap_Kd {name}\n");
    vec![
        ("scan.obj".into(), obj.into_bytes()),
        ("scan.mtl".into(), mtl.into_bytes()),
        (name.into(), bytes.into_inner()),
    ]
}
