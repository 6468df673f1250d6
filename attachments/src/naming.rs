//! Names for outlined regions: by rough points given by hand, else by their place on the bone.

use crate::site::Bone;
use meshes::Point;
use meshes::frame::AnatomicalFrame;

/// A place where an outline of a ligament is expected.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Ligament name.
    pub name: String,
    /// Its point [mm].
    pub point: Point,
}

/// Ligaments that laboratories outline, where on the bone: medial, anterior, superior of the frame's origin, in epicondylar widths.
///
/// Epicondylar sites follow [laprade2003] and [laprade2007], cruciates the walls of the notch and the intercondylar area; rounded by us, since
/// they only tell outlines apart that lie a quarter of a width from each other. The patellar tendon is known in order to be left out.
const ROUGH: [(Bone, &str, [f64; 3]); 9] = [
    (Bone::Femur, "ACL", [-0.15, -0.10, 0.0]),
    (Bone::Femur, "PCL", [0.10, 0.0, -0.14]),
    (Bone::Femur, "LCL", [-0.5, -0.04, 0.02]),
    (Bone::Femur, "sMCL", [0.5, -0.05, 0.04]),
    (Bone::Tibfib, "ACL", [0.0, 0.16, -0.03]),
    (Bone::Tibfib, "PCL", [0.0, -0.17, -0.12]),
    (Bone::Tibfib, "LCL", [-0.58, -0.05, -0.42]),
    (Bone::Tibfib, "sMCL", [0.16, 0.05, -0.75]),
    (Bone::Tibfib, PATELLAR_TENDON, [-0.10, 0.42, -0.40]),
];

/// An outline that is recognised and carries no bundle.
pub const PATELLAR_TENDON: &str = "patellar tendon";

/// Where outlines are expected on `bone` by their usual place in its frame; `width` is the distance of the epicondyles [mm].
pub fn usual_places(bone: Bone, frame: &AnatomicalFrame, width: f64) -> Vec<Place> {
    let at =
        |c: &[f64; 3]| frame.origin + width * (c[0] * frame.medial + c[1] * frame.anterior + c[2] * frame.superior);
    ROUGH
        .iter()
        .filter(|(b, ..)| *b == bone)
        .map(|(_, name, c)| Place { name: (*name).to_owned(), point: at(c) })
        .collect()
}

/// Most places that can be assigned at once.
const PLACES: usize = 16;

/// The place of each centroid: of all ways to give every place to one centroid at most, none farther than `reach` [mm], the one with the
/// smallest sum of squared distances, where a centroid without a place counts `reach` squared. Places beyond sixteen are not used.
pub fn assign(centroids: &[Point], places: &[Place], reach: f64) -> Vec<Option<usize>> {
    let places = &places[..places.len().min(PLACES)];
    let masks = 1usize << places.len();
    let mut cost = vec![f64::INFINITY; masks];
    cost[0] = 0.0;
    let mut choices: Vec<Vec<Option<usize>>> = Vec::with_capacity(centroids.len());
    for c in centroids {
        let mut next: Vec<f64> = cost.iter().map(|k| k + reach * reach).collect();
        let mut choice = vec![None; masks];
        for (j, place) in places.iter().enumerate() {
            let d2 = (place.point - c).norm_squared();
            if d2 > reach * reach {
                continue;
            }
            for mask in (0..masks).filter(|m| m >> j & 1 == 1) {
                let total = cost[mask & !(1 << j)] + d2;
                if total < next[mask] {
                    next[mask] = total;
                    choice[mask] = Some(j);
                }
            }
        }
        cost = next;
        choices.push(choice);
    }
    let mut mask = (0..masks).min_by(|&a, &b| cost[a].total_cmp(&cost[b])).unwrap_or(0);
    let mut found = vec![None; centroids.len()];
    for (i, choice) in choices.iter().enumerate().rev() {
        found[i] = choice[mask];
        if let Some(j) = found[i] {
            mask &= !(1 << j);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(x: f64) -> Place {
        Place { name: format!("{x}"), point: Point::new(x, 0.0, 0.0) }
    }

    #[test]
    fn the_sum_decides_not_the_nearest_pair() {
        let centroids = [Point::new(4.0, 0.0, 0.0), Point::new(-3.0, 0.0, 0.0)];
        assert_eq!(assign(&centroids, &[place(0.0), place(10.0)], 8.0), [Some(1), Some(0)]);
    }

    #[test]
    fn far_and_surplus_centroids_stay_without_a_name() {
        let centroids = [Point::new(50.0, 0.0, 0.0), Point::new(1.0, 0.0, 0.0), Point::new(2.0, 0.0, 0.0)];
        assert_eq!(assign(&centroids, &[place(0.0)], 8.0), [None, Some(0), None]);
        assert_eq!(assign(&centroids, &[], 8.0), [None, None, None]);
    }
}
