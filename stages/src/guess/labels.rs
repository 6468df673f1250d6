//! Which label of a map is which structure of the knee: by the names that the file gives, else by volume, place and contact.

use formats::picture::LabelMap;
use meshes::Point;
use meshes::frame::Side;
use std::collections::BTreeMap;

/// What was guessed of a label map.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelGuesses {
    /// Labels by their keys of `[segmentation]`.
    pub labels: BTreeMap<&'static str, u8>,
    /// Which knee, where the fibula has a label: it lies laterally. Without it, medial and lateral may be exchanged.
    pub side: Option<Side>,
    /// Whether the structures have names, which decide what is medial.
    named: bool,
    /// Whether the medial plateau's cartilage lies to the left of the lateral one's.
    medial_is_left: bool,
}

impl LabelGuesses {
    /// The guesses of a knee whose side is known: the lateral plateau of a left knee lies to the left.
    pub fn of_side(mut self, side: Side) -> LabelGuesses {
        if !self.named && self.medial_is_left == (side == Side::Left) {
            exchange(&mut self.labels, "tibial_cartilage_medial", "tibial_cartilage_lateral");
            exchange(&mut self.labels, "meniscus_medial", "meniscus_lateral");
            self.medial_is_left = !self.medial_is_left;
        }
        LabelGuesses { side: Some(side), ..self }
    }
}

/// Labels with less than this are specks [mm3]; the smallest structure, patellar cartilage, has about 2000.
const SPECK_MM3: f64 = 100.0;
/// The patella's middle lies in front of the femur's by more than this, and no other small structure does [mm].
const IN_FRONT_MM: f64 = 15.0;
/// The fibula's middle lies below the tibial cartilages by more than this, the menisci about level [mm].
const BELOW_MM: f64 = 10.0;

/// The label of a structure, its volume [mm3] and its middle.
struct Label {
    label: u8,
    volume: f64,
    middle: Point,
}

/// Guesses what the labels of a map are; `None` where it does not show two bones and three cartilages.
///
/// The map's axes are those of DICOM: x to the left, y to the back, z up.
pub fn guess_labels(map: &LabelMap) -> Option<LabelGuesses> {
    let (all, touching) = measured(map);
    let touch = |a: u8, b: u8| touching.get(&(a.min(b), a.max(b))).copied().unwrap_or(0);
    let mut found = named(map);
    let mut left: Vec<&Label> = all.iter().filter(|l| !found.values().any(|f| *f == l.label)).collect();
    let middle = |label: u8| all.iter().find(|l| l.label == label).map(|l| l.middle);

    if !found.contains_key("femur") || !found.contains_key("tibia") {
        let [a, b, ..] = left[..] else { return None };
        let (upper, lower) = if a.middle.z > b.middle.z { (a, b) } else { (b, a) };
        found.insert("femur", upper.label);
        found.insert("tibia", lower.label);
        left.retain(|l| l.label != a.label && l.label != b.label);
    }
    let (femur, tibia) = (found["femur"], found["tibia"]);
    // takes the label that scores highest above 0
    let mut take = |key: &'static str, found: &mut BTreeMap<&'static str, u8>, score: &dyn Fn(&Label) -> f64| {
        if found.contains_key(key) {
            return;
        }
        let best = left.iter().max_by(|a, b| score(a).total_cmp(&score(b))).filter(|l| score(l) > 0.0);
        if let Some(label) = best.map(|l| l.label) {
            left.retain(|l| l.label != label);
            found.insert(key, label);
        }
    };
    take("femoral_cartilage", &mut found, &|l| touch(l.label, femur) as f64);
    take("tibial_cartilage_medial", &mut found, &|l| touch(l.label, tibia) as f64);
    take("tibial_cartilage_lateral", &mut found, &|l| touch(l.label, tibia) as f64);
    let [femoral, one, other] =
        ["femoral_cartilage", "tibial_cartilage_medial", "tibial_cartilage_lateral"].map(|key| found.get(key).copied());
    let (femoral, one, other) = (femoral?, one?, other?);
    let (front, plateau) = (middle(femur)?.y, 0.5 * (middle(one)?.z + middle(other)?.z));
    take("patella", &mut found, &|l| if l.middle.y < front - IN_FRONT_MM { l.volume } else { 0.0 });
    take("fibula", &mut found, &|l| if l.middle.z < plateau - BELOW_MM { l.volume } else { 0.0 });
    if let Some(patella) = found.get("patella").copied() {
        take("patellar_cartilage", &mut found, &|l| touch(l.label, patella) as f64);
    }
    for (meniscus, cartilage) in [("meniscus_medial", one), ("meniscus_lateral", other)] {
        take(meniscus, &mut found, &|l| (touch(l.label, cartilage).min(touch(l.label, femoral))) as f64);
    }

    let side = found
        .get("fibula")
        .and_then(|f| Some(middle(*f)?.x - middle(tibia)?.x))
        .map(|left| if left > 0.0 { Side::Left } else { Side::Right });
    let medial_is_left = middle(one)?.x > middle(other)?.x;
    let guesses = LabelGuesses { labels: found, side: None, named: !map.names.is_empty(), medial_is_left };
    Some(match side {
        Some(side) => guesses.of_side(side),
        None => guesses,
    })
}

fn exchange(found: &mut BTreeMap<&'static str, u8>, a: &'static str, b: &'static str) {
    let (at_a, at_b) = (found.remove(a), found.remove(b));
    found.extend(at_b.map(|label| (a, label)));
    found.extend(at_a.map(|label| (b, label)));
}

/// Labels, largest first, and how many pairs of neighbouring voxels two labels share.
fn measured(map: &LabelMap) -> (Vec<Label>, BTreeMap<(u8, u8), usize>) {
    let grid = &map.labels.grid;
    let mut sums = vec![(0usize, [0.0f64; 3]); 256];
    let mut touching = BTreeMap::new();
    let strides = grid.strides();
    for (at, &label) in map.labels.values.iter().enumerate().filter(|(_, l)| **l > 0) {
        let voxel = grid.voxel(at);
        let (count, sum) = &mut sums[usize::from(label)];
        *count += 1;
        (0..3).for_each(|k| sum[k] += voxel[k] as f64);
        for k in (0..3).filter(|&k| voxel[k] + 1 < grid.size[k]) {
            let next = map.labels.values[at + strides[k]];
            if next > 0 && next != label {
                *touching.entry((label.min(next), label.max(next))).or_insert(0) += 1;
            }
        }
    }
    let label = |(label, (count, sum)): (usize, (usize, [f64; 3]))| {
        let mean = nalgebra::Vector3::from(sum.map(|s| s / count.max(1) as f64));
        Label { label: label as u8, volume: count as f64 * grid.voxel_mm3(), middle: grid.point(&mean) }
    };
    let mut all: Vec<Label> = sums.into_iter().enumerate().map(label).filter(|l| l.volume > SPECK_MM3).collect();
    all.sort_by(|a, b| b.volume.total_cmp(&a.volume));
    (all, touching)
}

/// What the names of segments say.
fn named(map: &LabelMap) -> BTreeMap<&'static str, u8> {
    let mut found = BTreeMap::new();
    for (name, label) in &map.names {
        if let Some(key) = key_of(name) {
            found.entry(key).or_insert(*label);
        }
    }
    found
}

/// The key of `[segmentation]` that a segment's name means; none where it means none, or may mean two.
pub(crate) fn key_of(name: &str) -> Option<&'static str> {
    let name = name.to_lowercase();
    let has = |part: &str| name.contains(part);
    let (medial, lateral) = (has("med"), has("lat"));
    Some(match (has("cart"), has("menis"), has("fem"), has("tib"), has("pat"), has("fib")) {
        (true, _, true, _, _, _) => "femoral_cartilage",
        (true, _, _, true, _, _) if medial => "tibial_cartilage_medial",
        (true, _, _, true, _, _) if lateral => "tibial_cartilage_lateral",
        (true, _, _, _, true, _) => "patellar_cartilage",
        (_, true, ..) if medial => "meniscus_medial",
        (_, true, ..) if lateral => "meniscus_lateral",
        (false, false, true, ..) => "femur",
        (false, false, _, true, ..) => "tibia",
        (false, false, _, _, _, true) => "fibula",
        (false, false, _, _, true, _) => "patella",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::{MRI_PHANTOM, phantom};
    use crate::specimen::LabelName;

    /// The phantom's label map, and what its specimen.toml says of it.
    fn phantoms() -> (LabelMap, BTreeMap<&'static str, u8>, Side) {
        let files: BTreeMap<String, Vec<u8>> = phantom(MRI_PHANTOM, 1).unwrap().files.into_iter().collect();
        let toml = String::from_utf8(files["specimen.toml"].clone()).unwrap();
        let said = crate::ingest::parse_specimen_file(&toml).unwrap();
        let s = said.segmentation.unwrap();
        let map = formats::picture::read_labels("labels", &files[&s.labels], &files).unwrap();
        let number = |name: &LabelName| match name {
            LabelName::Number(n) => *n,
            LabelName::Name(name) => panic!("{name}"),
        };
        let keys = [
            ("femur", Some(&s.femur)),
            ("tibia", Some(&s.tibia)),
            ("fibula", s.fibula.as_ref()),
            ("femoral_cartilage", Some(&s.femoral_cartilage)),
            ("tibial_cartilage_medial", Some(&s.tibial_cartilage_medial)),
            ("tibial_cartilage_lateral", Some(&s.tibial_cartilage_lateral)),
        ];
        let truth = keys.into_iter().filter_map(|(key, name)| Some((key, number(name?)))).collect();
        (map, truth, said.specimen.side)
    }

    #[test]
    fn labels_are_known_by_geometry_whatever_their_numbers() {
        let (map, truth, side) = phantoms();
        // 17 and 40 are prime to 256 or not zero: labels keep apart
        for turn in [|l: u8| l, |l: u8| if l == 0 { 0 } else { l.wrapping_mul(17).wrapping_add(40) }] {
            let mut turned = map.clone();
            turned.labels.values.iter_mut().for_each(|l| *l = turn(*l));
            let found = guess_labels(&turned).unwrap().of_side(side);
            for (key, label) in &truth {
                assert_eq!(found.labels.get(key), Some(&turn(*label)), "{key}: {:?}", found.labels);
            }
        }
    }

    #[test]
    fn a_map_without_cartilage_is_none() {
        let (mut map, truth, _) = phantoms();
        let bones = [truth["femur"], truth["tibia"]];
        map.labels.values.iter_mut().filter(|l| !bones.contains(l)).for_each(|l| *l = 0);
        assert_eq!(guess_labels(&map), None);
    }

    #[test]
    fn names_decide() {
        let (mut map, truth, _) = phantoms();
        map.names = vec![("Lateral tibial cartilage".into(), truth["tibial_cartilage_medial"])];
        let found = guess_labels(&map).unwrap();
        assert_eq!(found.labels["tibial_cartilage_lateral"], truth["tibial_cartilage_medial"]);
    }
}
