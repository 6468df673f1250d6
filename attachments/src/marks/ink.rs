//! Which vertices of a scan carry ink: dark against the bone's own colour around them.

use meshes::Point;
use meshes::surface::ColouredMesh;

/// Darkest reflectance that is never ink, and lightest that always is [-].
const INK_MAX: f64 = 0.65;
const INK_MIN: f64 = 0.45;
/// Reflectance below which a vertex tells how dark the ink is [-].
const SURELY_INK: f64 = 0.6;
/// A neighbourhood darker than this share of the whole scan's colour (a clamp, a burnt cut end) is not taken for bone [-].
const DARKEST_BONE: f64 = 0.6;
/// One brighter than this share of it is cartilage, beside which brown bone is not ink [-].
const BRIGHTEST_BONE: f64 = 1.25;

/// Whether each vertex carries ink.
///
/// The reflectance of a vertex is that of its brightest channel relative to the median colour within `radius` [mm], so that a blue
/// sticker and a grey screw are not dark, brown bone is not darker than white, and the exposure cancels. The threshold
/// lies half way between bone and this scan's ink.
pub fn ink(scan: &ColouredMesh, radius: f64) -> Vec<bool> {
    let reflectance = reflectance(scan, radius);
    let mut dark: Vec<f64> = reflectance.iter().copied().filter(|&r| r < SURELY_INK).collect();
    let middle = dark.len() / 2;
    let Some(&mut level) = (!dark.is_empty()).then(|| dark.select_nth_unstable_by(middle, f64::total_cmp).1) else {
        return vec![false; reflectance.len()];
    };
    let threshold = f64::midpoint(1.0, level).clamp(INK_MIN, INK_MAX);
    reflectance.iter().map(|&r| r < threshold).collect()
}

/// Brightest channel of each vertex relative to the bone's around it [-]; 1 is bare bone.
pub fn reflectance(scan: &ColouredMesh, radius: f64) -> Vec<f64> {
    let points = &scan.mesh.vertices;
    let whole = median_colour(scan.colours.iter());
    let centres = cover(points, radius / 1.5);
    let bones: Vec<[f64; 3]> = centres
        .iter()
        .map(|c| {
            let near = points.iter().zip(&scan.colours).filter(|(p, _)| (*p - c).norm_squared() < radius * radius);
            let local = median_colour(near.map(|(_, colour)| colour));
            std::array::from_fn(|k| local[k].clamp(DARKEST_BONE * whole[k], BRIGHTEST_BONE * whole[k]))
        })
        .collect();
    points.iter().zip(&scan.colours).map(|(p, colour)| relative(colour, &blend(p, &centres, &bones, radius))).collect()
}

/// The brightest channel against a mean of the bone's own channel and its brightest: a dark grey is dark on brown bone too.
fn relative(colour: &[u8; 3], bone: &[f64; 3]) -> f64 {
    let brightest = bone.iter().copied().fold(1.0, f64::max);
    (0..3).map(|k| f64::from(colour[k]) / f64::midpoint(bone[k], brightest)).fold(0.0, f64::max)
}

fn median_colour<'a>(colours: impl Iterator<Item = &'a [u8; 3]>) -> [f64; 3] {
    let mut counts = [[0usize; 256]; 3];
    let mut total = 0;
    for colour in colours {
        total += 1;
        for k in 0..3 {
            counts[k][usize::from(colour[k])] += 1;
        }
    }
    counts.map(|channel| {
        let mut seen = 0;
        channel
            .iter()
            .position(|&n| {
                seen += n;
                2 * seen >= total
            })
            .unwrap_or(0) as f64
    })
}

/// Some of `points`, no two closer than `spacing`, every point within it of one.
fn cover(points: &[Point], spacing: f64) -> Vec<Point> {
    let mut centres: Vec<Point> = Vec::new();
    for p in points {
        if centres.iter().all(|c| (c - p).norm_squared() >= spacing * spacing) {
            centres.push(*p);
        }
    }
    centres
}

fn blend(p: &Point, centres: &[Point], bones: &[[f64; 3]], radius: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    let mut total = 0.0;
    for (c, bone) in centres.iter().zip(bones) {
        let w = (1.0 - (p - c).norm_squared() / (radius * radius)).max(0.0).powi(2);
        total += w;
        for k in 0..3 {
            sum[k] += w * bone[k];
        }
    }
    sum.map(|s| if total > 0.0 { s / total } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::shapes::icosphere;

    /// A ball of `bone` with a dot of `dot` at the top.
    fn ball(bone: [u8; 3], dot: [u8; 3]) -> (ColouredMesh, Vec<bool>) {
        let mesh = icosphere(20.0, 5);
        let inside: Vec<bool> = mesh.vertices.iter().map(|p| p.z > 19.8).collect();
        let colours = inside.iter().map(|&i| if i { dot } else { bone }).collect();
        (ColouredMesh { mesh, colours }, inside)
    }

    #[test]
    fn black_is_ink_on_white_yellow_and_brown_bone_in_any_exposure() {
        for bone in [[235, 230, 225], [222, 200, 165], [120, 85, 55], [80, 55, 35]] {
            for exposure in [1.0, 0.6] {
                let shade = |c: [u8; 3]| c.map(|v| (f64::from(v) * exposure) as u8);
                let (scan, dot) = ball(shade(bone), shade([25, 25, 28]));
                assert_eq!(ink(&scan, 12.0), dot, "{bone:?} x {exposure}");
            }
        }
    }

    #[test]
    fn stickers_screws_and_cartilage_are_not_ink() {
        for dot in [[32, 64, 192], [145, 145, 145], [235, 232, 228], [180, 40, 40]] {
            assert!(ink(&ball([222, 200, 165], dot).0, 12.0).iter().all(|i| !i), "{dot:?}");
        }
    }
}
