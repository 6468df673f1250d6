//! Cartilages that have run together are parted.

use super::CartilageOptions;
use super::field::Domain;
use super::vertices::bodies;
use std::collections::BinaryHeap;

/// Steps by which the threshold is raised in search of two cores [mm], and how many.
const STEP_MM: f64 = 0.1;
const STEPS: usize = 20;

/// Parts the largest body of `cover` (bodies of vertices, their areas beside them, largest first) where it is thinnest between its two
/// thickest places, and returns whether it did.
///
/// Two plateaus run together where CT is too coarse to show the ridge between them, or where the ridge is worn. It is parted only if that
/// leaves a smaller part larger than the next body, so a whole plateau beside its neighbour stays whole. A line of vertices between the
/// parts gets the level `-bare`.
pub(super) fn part(
    domain: &Domain,
    level: &mut [f64],
    cover: &[(f64, Vec<u32>)],
    bare: f64,
    options: &CartilageOptions,
) -> bool {
    let Some((_, body)) = cover.first() else { return false };
    let next = cover.get(1).map_or(0.0, |c| c.0).max(options.least_area_mm2);
    let Some(label) = cores(domain, body, level.len(), options).map(|cores| flooded(domain, body, &cores, level.len()))
    else {
        return false;
    };
    let area = domain.bone.vertex_areas();
    let size = |part: u8| body.iter().filter(|&&v| label[v as usize] == part).map(|&v| area[v as usize]).sum::<f64>();
    if size(1).min(size(2)) <= next {
        return false;
    }
    let between: Vec<u32> = body
        .iter()
        .copied()
        .filter(|&v| label[v as usize] == 2 && domain.neighbours[v as usize].iter().any(|&w| label[w as usize] == 1))
        .collect();
    between.into_iter().for_each(|v| level[v as usize] = -bare);
    true
}

/// The two largest bodies that are left of `body` at the lowest threshold that leaves two of the least area.
fn cores(domain: &Domain, body: &[u32], count: usize, options: &CartilageOptions) -> Option<[Vec<u32>; 2]> {
    let area = domain.bone.vertex_areas();
    let mut member = vec![false; count];
    body.iter().for_each(|&v| member[v as usize] = true);
    (1..=STEPS).find_map(|step| {
        let over = options.least_thickness_mm + STEP_MM * step as f64;
        let large = |core: &Vec<u32>| core.iter().map(|&v| area[v as usize]).sum::<f64>() >= options.least_area_mm2;
        let left = bodies(&domain.neighbours, |v| member[v as usize] && domain.thickness(v as usize) > over);
        let mut left = left.into_iter().filter(large);
        Some([left.next()?, left.next()?])
    })
}

/// Which core, 1 or 2, each vertex of `body` belongs to, 0 elsewhere: the cores grow over the thickest first (a watershed), so they meet
/// where cartilage is thinnest.
fn flooded(domain: &Domain, body: &[u32], cores: &[Vec<u32>; 2], count: usize) -> Vec<u8> {
    let mut open = vec![false; count];
    body.iter().for_each(|&v| open[v as usize] = true);
    let mut label = vec![0; count];
    let mut front: BinaryHeap<(i64, std::cmp::Reverse<u32>)> = BinaryHeap::new();
    // thickness in whole nanometres, to be ordered
    let rank = |v: u32| ((domain.thickness(v as usize) * 1e6) as i64, std::cmp::Reverse(v));
    for (k, core) in cores.iter().enumerate() {
        core.iter().for_each(|&v| label[v as usize] = k as u8 + 1);
        front.extend(core.iter().map(|&v| rank(v)));
    }
    while let Some((_, std::cmp::Reverse(v))) = front.pop() {
        for &w in &domain.neighbours[v as usize] {
            if open[w as usize] && label[w as usize] == 0 {
                label[w as usize] = label[v as usize];
                front.push(rank(w));
            }
        }
    }
    label
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::Point;
    use meshes::surface::TriMesh;

    /// A flat bone of 60 x 30 mm with two heaps of cartilage 2 mm thick, 0.7 mm thick between them.
    fn joined(valley: f64) -> Domain {
        let at = |k: u32| Point::new(f64::from(k % 61), f64::from(k / 61), 0.0);
        let squares = (0..60 * 30u32).map(|k| k / 60 * 61 + k % 60);
        let triangles = squares.flat_map(|a| [[a, a + 1, a + 62], [a, a + 62, a + 61]]).collect();
        let bone = TriMesh { vertices: (0..61 * 31).map(at).collect(), triangles };
        let thick = |x: f64| if (x - 30.0).abs() < 5.0 { valley } else { 2.0 };
        let outer = bone.vertices.iter().map(|p| thick(p.x)).collect();
        Domain {
            neighbours: meshes::topology::vertex_neighbours(&bone),
            normals: bone.vertex_normals(),
            inner: vec![0.0; bone.vertices.len()],
            outer,
            bare_sd: 0.0,
            thin_rim: vec![false; bone.vertices.len()],
            bone,
        }
    }

    fn cover(domain: &Domain, level: &[f64]) -> Vec<(f64, Vec<u32>)> {
        let area = domain.bone.vertex_areas();
        let size = |b: &Vec<u32>| b.iter().map(|&v| area[v as usize]).sum::<f64>();
        bodies(&domain.neighbours, |v| level[v as usize] > 0.0).into_iter().map(|b| (size(&b), b)).collect()
    }

    #[test]
    fn heaps_part_along_the_valley_and_one_heap_stays_whole() {
        let options = CartilageOptions::default();
        let domain = joined(0.7);
        let mut level = vec![0.2; domain.bone.vertices.len()];
        let whole = cover(&domain, &level);
        assert_eq!(whole.len(), 1);
        assert!(part(&domain, &mut level, &whole, 0.5, &options));
        let parts = cover(&domain, &level);
        assert_eq!(parts.len(), 2);
        assert!(parts.iter().all(|p| p.0 > 700.0), "{} {}", parts[0].0, parts[1].0);
        let line = (0..level.len()).filter(|&v| level[v] < 0.0);
        assert!(line.into_iter().all(|v| (domain.bone.vertices[v].x - 30.0).abs() <= 6.0));

        let domain = joined(2.0);
        let mut level = vec![0.2; domain.bone.vertices.len()];
        let whole = cover(&domain, &level);
        assert!(!part(&domain, &mut level, &whole, 0.5, &options));
        assert!(level.iter().all(|l| *l > 0.0));
    }
}
