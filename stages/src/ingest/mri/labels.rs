//! A label map becomes surfaces.

use super::Read;
use super::clean::{Mended, clean};
use super::gaps;
use crate::guess::key_of;
use crate::ingest::surfaces;
use crate::specimen::MriMetrics;
use crate::specimen::{IngestOptions, RawSpecimen};
use crate::specimen::{LabelName, Mri, SegmentationPaths};
use crate::{PerBone, PerCartilage, StageError};
use formats::picture::{LabelMap, read_labels};
use meshes::frame::Side;
use meshes::surface::TriMesh;
use meshes::volume::Labels;
use meshes::volume::outline::{Part, border, outline};
use notices::{Kind, Notice};
use std::collections::BTreeMap;

/// A second piece of a bone above this share of the first is a second knee [-]; a fibula in a short field of view has a tenth of
/// its tibia.
const SECOND_KNEE: f64 = 0.3;
/// Pieces of a bone below this share of it are specks [-]; a fibular head alone has 3 %.
const SPECK_SHARE: f64 = 0.02;
/// Pieces of cartilage below this share of it are specks [-]; worn cartilage may be in several pieces.
const CARTILAGE_SPECK_SHARE: f64 = 0.05;
/// Largest volume of a part over that of the femur or tibia beside it [-]: a patella has 0.3 of a tibia that the picture cuts off early. Ours.
const LARGEST_PART: f64 = 0.7;
/// More specks of one structure than these are of a picture that was resampled, or of noise [-]: drawn by hand or by a net a structure has a few dozen. Ours.
const MOST_SPECKS: usize = 500;
/// The structures that are larger than every other.
const BONES: [&str; 2] = ["femur", "tibia"];
/// Smallest cartilage [mm3]; a worn plateau's has 500.
const LEAST_CARTILAGE_MM3: f64 = 100.0;

/// The labels of one structure.
struct Structure<'a> {
    key: &'a str,
    labels: Vec<u8>,
}

/// Reads the label map that `[segmentation]` names and makes its surfaces.
///
/// # Errors
/// As the reader; a name or label that the file has not; two knees; voxels of no usable size.
pub(in crate::ingest) fn from_labels(
    table: &SegmentationPaths,
    raw: &RawSpecimen,
    options: &IngestOptions,
    (beside_ct, side): (bool, Side),
    warnings: &mut Vec<Notice>,
) -> Result<Read, StageError> {
    let path = &table.labels;
    let fail = |what: String| StageError::named(path, "segmentation.labels", what);
    let bytes = raw.files.get(path).ok_or_else(|| fail("the file is not there".into()))?;
    let mut map = read_labels(path, bytes, &raw.files).map_err(|e| fail(e.0))?;
    check_grid(&map.labels).map_err(fail)?;
    warnings.extend(map.notes.drain(..).map(|note| note.in_file(path)));
    if map.overlapping > 0 {
        warnings.push(
            Kind::OverlappingSegments
                .notice(format!("{path}: {} voxels lie in several segments and stay in the first", map.overlapping))
                .file(path)
                .count(map.overlapping),
        );
    }
    let labels = structures(table, &map, warnings).map_err(fail)?;
    let one =
        (labels.get("tibial_cartilage_medial") == labels.get("tibial_cartilage_lateral")).then_some(labels.clone());
    let mut found = Found { path, labels, map: &map.labels, options };
    tell_unnamed(&found, &map, warnings);
    let parted;
    if one.is_some() {
        let (label, values) = found.parted(side, warnings)?;
        parted = Labels { grid: map.labels.grid.clone(), values };
        found.map = &parted;
        found.labels.insert("tibial_cartilage_lateral", label);
    }
    found.surfaces(beside_ct, warnings)
}

fn check_grid(labels: &Labels) -> Result<(), String> {
    let spacing = labels.grid.spacing();
    let [fine, coarse] =
        [f64::min as fn(f64, f64) -> f64, f64::max].map(|f| spacing.into_iter().reduce(f).unwrap_or(0.0));
    let fits = |factor: f64| factor * fine >= 0.05 && factor * coarse <= 5.0;
    if fits(1.0) {
        return Ok(());
    }
    let units = [("centimetres", 10.0), ("metres", 1000.0), ("micrometres", 0.001)];
    let unit =
        units.into_iter().find(|(_, factor)| fits(*factor)).map_or("check its unit".to_owned(), |(name, factor)| {
            format!("as {name} they would fit; multiply spacing, directions and origin by {factor}")
        });
    Err(format!(
        "voxels are {:.3} x {:.3} x {:.3} mm; expected 0.2 to 3 mm: {unit}",
        spacing[0], spacing[1], spacing[2]
    ))
}

/// Label numbers by the table's keys.
fn structures(
    table: &SegmentationPaths,
    map: &LabelMap,
    warnings: &mut Vec<Notice>,
) -> Result<BTreeMap<&'static str, u8>, String> {
    let wanted: [(&'static str, Option<&LabelName>); 10] = [
        ("femur", Some(&table.femur)),
        ("tibia", Some(&table.tibia)),
        ("fibula", table.fibula.as_ref()),
        ("patella", table.patella.as_ref()),
        ("femoral_cartilage", Some(&table.femoral_cartilage)),
        ("tibial_cartilage_medial", Some(&table.tibial_cartilage_medial)),
        ("tibial_cartilage_lateral", Some(&table.tibial_cartilage_lateral)),
        ("patellar_cartilage", table.patellar_cartilage.as_ref()),
        ("meniscus_medial", table.meniscus_medial.as_ref()),
        ("meniscus_lateral", table.meniscus_lateral.as_ref()),
    ];
    let mut counts = [0usize; 256];
    map.labels.values.iter().for_each(|l| counts[usize::from(*l)] += 1);
    let name = |l: usize| map.names.iter().find(|(_, n)| usize::from(*n) == l).map(|(name, _)| name.as_str());
    let there: Vec<String> = (1..256)
        .filter(|&l| counts[l] > 0)
        .map(|l| name(l).map_or(l.to_string(), |name| format!("{l} ({name})")))
        .collect();
    let there = if there.is_empty() { "no label at all".to_string() } else { there.join(", ") };
    let optional = ["fibula", "patella", "patellar_cartilage", "meniscus_medial", "meniscus_lateral"];
    let mut found: BTreeMap<&'static str, u8> = BTreeMap::new();
    for (key, label) in wanted {
        let Some(label) = label else { continue };
        let number = match label {
            LabelName::Number(0) => return Err(format!("segmentation.{key} is 0, which is the background")),
            LabelName::Number(n) => own_number(map, key, *n)?,
            LabelName::Name(name) => own_name(map, key, name, &there)?,
        };
        let tibial = |k: &str| k.starts_with("tibial_cartilage");
        if let Some((other, _)) = found.iter().find(|(k, n)| **n == number && !(tibial(k) && tibial(key))) {
            return Err(format!("segmentation.{key} and segmentation.{other} are both label {number}"));
        }
        if counts[usize::from(number)] == 0 {
            if optional.contains(&key) {
                warnings.push(
                    Kind::UnnamedLabels
                        .notice(format!(
                            "segmentation.{key} = {number}: no voxel of {} has this label, so it is left out; the file has {there}",
                            table.labels
                        ))
                        .of(key),
                );
                continue;
            }
            return Err(format!("segmentation.{key}: no voxel has label {number}; the file has {there}"));
        }
        warnings.extend(called_otherwise(map, (key, label), number));
        found.insert(key, number);
    }
    Ok(found)
}

/// What is told of a number of the table whose segment has another structure's name in the file.
fn called_otherwise(map: &LabelMap, (key, label): (&str, &LabelName), number: u8) -> Option<Notice> {
    let LabelName::Number(n) = label else { return None };
    let (name, _) = map.names.iter().find(|(_, own)| *own == number)?;
    let other = key_of(name).filter(|other| *other != key)?;
    Some(
        Kind::UnnamedLabels
            .notice(format!(
                "segmentation.{key} = {n}, but the file calls this segment \"{name}\", which is {other}: were two numbers exchanged, or two names? Look at the segment, and name it in place of its number"
            ))
            .of(key),
    )
}

/// The label of the one segment that is called so.
fn own_name(map: &LabelMap, key: &str, name: &str, there: &str) -> Result<u8, String> {
    let mut of: Vec<u8> = map.names.iter().filter(|(own, _)| own == name).map(|(_, number)| *number).collect();
    of.sort_unstable();
    of.dedup();
    match of[..] {
        [number] => Ok(number),
        [] => Err(format!("segmentation.{key}: no segment is called \"{name}\"; the file has {there}")),
        _ => Err(format!(
            "segmentation.{key}: {} segments are called \"{name}\", so that the name does not tell which is meant; the file has {there}. Give each segment a name of its own",
            of.len()
        )),
    }
}

/// The label that a number of the table means: in a file of several layers, that of the segment with this label value.
fn own_number(map: &LabelMap, key: &str, n: u8) -> Result<u8, String> {
    if map.stated.is_empty() {
        return Ok(n);
    }
    let of: Vec<&(String, u8)> =
        map.names.iter().zip(&map.stated).filter(|(_, s)| **s == Some(n)).map(|(name, _)| name).collect();
    match of[..] {
        [(_, own)] => Ok(*own),
        _ => {
            let names: Vec<&str> = map.names.iter().map(|(name, _)| name.as_str()).collect();
            Err(format!(
                "segmentation.{key} = {n}: {} of the file's segments, which lie in several layers, state this label value; name the segment instead: {}",
                of.len(),
                names.join(", ")
            ))
        }
    }
}

fn tell_unnamed(found: &Found, map: &LabelMap, warnings: &mut Vec<Notice>) {
    let mut counts = [0usize; 256];
    map.labels.values.iter().for_each(|l| counts[usize::from(*l)] += 1);
    let unnamed: Vec<String> = (1u8..=255)
        .filter(|l| counts[usize::from(*l)] > 0 && !found.labels.values().any(|n| n == l))
        .map(|l| l.to_string())
        .collect();
    if !unnamed.is_empty() {
        warnings.push(
            Kind::UnnamedLabels
                .notice(format!(
                    "{}: labels {} are named nowhere in [segmentation] and left out",
                    found.path,
                    unnamed.join(", ")
                ))
                .file(found.path)
                .count(unnamed.len()),
        );
    }
}

/// A label map with its structures.
pub(super) struct Found<'a> {
    pub(super) path: &'a str,
    pub(super) labels: BTreeMap<&'static str, u8>,
    pub(super) map: &'a Labels,
    options: &'a IngestOptions,
}

impl Found<'_> {
    pub(super) fn fail(&self, what: String) -> StageError {
        StageError::named(self.path, "segmentation.labels", what)
    }

    fn structure(&self, keys: &[&'static str]) -> Structure<'_> {
        let labels = keys.iter().filter_map(|k| self.labels.get(k).copied()).collect();
        Structure { key: self.labels.get_key_value(keys[0]).map_or("", |(k, _)| k), labels }
    }

    fn sigma(&self) -> f64 {
        self.options.label_blur * self.map.grid.spacing().into_iter().fold(0.0, f64::max)
    }

    /// The voxels of a structure, mended; what was mended is told.
    fn part(&self, of: &Structure, most: usize, share: f64, warnings: &mut Vec<Notice>) -> Result<Part, StageError> {
        let missing = || self.fail(format!("{} has no voxel", of.key));
        let around = border(&self.map.grid, self.sigma());
        let mut part = Part::new(self.map, around, |l| of.labels.contains(&l)).ok_or_else(missing)?;
        let bone = share < CARTILAGE_SPECK_SHARE;
        let (mended, second) = clean(&mut part, most, share, bone);
        if bone && second > SECOND_KNEE {
            return Err(self.fail(format!(
                "label {} ({}) is in two pieces, the second {:.0} % of the first; expected one knee: crop the picture to it, or give each knee labels of its own. A slice that was left without labels parts a bone, too: label it",
                of.labels[0], of.key, 100.0 * second
            )));
        }
        tell(self.path, of, &mended, warnings);
        Ok(part)
    }

    fn outline(&self, key: &str, part: &Part) -> Result<TriMesh, StageError> {
        outline(part, self.sigma(), self.options.label_edge_mm)
            .ok_or_else(|| self.fail(format!("{key} has no surface: its label is a voxel thick, or none")))
    }

    /// Refuses labels that were exchanged: a patella, a cartilage or a meniscus as large as a bone.
    fn check_sizes(&self) -> Result<(), StageError> {
        let mut voxels = [0_usize; 256];
        self.map.values.iter().for_each(|l| voxels[usize::from(*l)] += 1);
        let size = |key: &str| self.labels.get(key).map(|l| voxels[usize::from(*l)] as f64 * self.map.grid.voxel_mm3());
        for bone in BONES {
            let Some(whole) = size(bone).filter(|s| *s > 0.0) else { continue };
            for key in self.labels.keys().filter(|k| !BONES.contains(k)) {
                let part = size(key).unwrap_or(0.0);
                if part > LARGEST_PART * whole {
                    return Err(self.fail(format!(
                        "{key} ({part:.0} mm3) is too large beside {bone} ({whole:.0} mm3): were their labels exchanged, or does the picture cut off the {bone}?"
                    )));
                }
            }
        }
        Ok(())
    }

    /// The surfaces of the bones alone.
    pub(super) fn bones(&self, warnings: &mut Vec<Notice>) -> Result<PerBone<TriMesh>, StageError> {
        self.check_sizes()?;
        let femur = self.part(&self.structure(&["femur"]), 1, SPECK_SHARE, warnings)?;
        let tibfib = self.part(&self.structure(&["tibia", "fibula"]), 2, SPECK_SHARE, warnings)?;
        Ok(PerBone { femur: self.outline("femur", &femur)?, tibfib: self.outline("tibia", &tibfib)? })
    }

    /// The size of the knee over an adult's; told where no adult has it.
    fn size(&self, bones: &PerBone<TriMesh>, warnings: &mut Vec<Notice>) -> Result<f64, StageError> {
        let width = surfaces::middle_extent(&bones.femur);
        surfaces::check_unit(width, self.options).map_err(|what| self.fail(what))?;
        warnings.extend(surfaces::odd_size("femur", self.path, width));
        Ok(width / surfaces::KNEE_WIDTH_MM)
    }

    /// Every surface of the map.
    fn surfaces(&self, beside_ct: bool, warnings: &mut Vec<Notice>) -> Result<Read, StageError> {
        self.check_sizes()?;
        let femur = self.part(&self.structure(&["femur"]), 1, SPECK_SHARE, warnings)?;
        let tibfib = self.part(&self.structure(&["tibia", "fibula"]), 2, SPECK_SHARE, warnings)?;
        let bones = PerBone { femur: self.outline("femur", &femur)?, tibfib: self.outline("tibia", &tibfib)? };
        let scale = self.size(&bones, warnings)?;
        let least = LEAST_CARTILAGE_MM3 * scale.powi(3).min(1.0);
        let voxel = self.map.grid.voxel_mm3();
        let mut volumes = BTreeMap::new();
        let mut given = Vec::new();
        let mut covers = Vec::new();
        let of_tibia: &[&'static str] = &["tibia", "fibula"];
        for (key, bone, names) in [
            ("femoral_cartilage", &femur, &["femur"][..]),
            ("tibial_cartilage_medial", &tibfib, of_tibia),
            ("tibial_cartilage_lateral", &tibfib, of_tibia),
        ] {
            let cartilage = self.part(&self.structure(&[key]), 50, CARTILAGE_SPECK_SHARE, warnings)?;
            let size = cartilage.inside.iter().filter(|i| **i).count() as f64 * voxel;
            volumes.insert(key.into(), size);
            if size < least {
                return Err(self.fail(format!(
                    "{key} has {size:.0} mm3; expected {least:.0} mm3 or more: check which label it is"
                )));
            }
            let [own, bones] = [self.structure(&[key]).labels, self.structure(names).labels];
            warnings.extend(gaps::apart(self.path, key, self.map, &own, &bones));
            given.push(size);
            covers.push(self.outline(key, &joined(bone, &cartilage))?);
        }
        let [femoral, medial, lateral]: [TriMesh; 3] =
            covers.try_into().map_err(|_| self.fail("not three cartilages".into()))?;
        let mut bodies = BTreeMap::new();
        for key in ["patella", "patellar_cartilage", "meniscus_medial", "meniscus_lateral"] {
            if self.labels.contains_key(key) {
                let part = self.part(&self.structure(&[key]), 1, CARTILAGE_SPECK_SHARE, warnings)?;
                volumes.insert(key.into(), part.inside.iter().filter(|i| **i).count() as f64 * voxel);
                bodies.insert(key.to_string(), self.outline(key, &part)?);
            }
        }
        let patella = if beside_ct { None } else { bodies.remove("patella") };
        let metrics = MriMetrics {
            voxels: Some(self.map.grid.size),
            spacing_mm: Some(self.map.grid.spacing()),
            label_volume_mm3: volumes,
            cartilage_volume_mm3: None,
        };
        let mri = Mri {
            in_ct: !beside_ct,
            covers: PerCartilage { femur: femoral, tibia_medial: medial, tibia_lateral: lateral },
            with_bone: true,
            bodies,
            given_mm3: PerCartilage { femur: given[0], tibia_medial: given[1], tibia_lateral: given[2] },
        };
        Ok(Read { bones, patella, mri, metrics })
    }
}

fn tell(path: &str, of: &Structure, mended: &Mended, warnings: &mut Vec<Notice>) {
    let key = of.key;
    if mended.bridged > 0 {
        warnings.push(
            Kind::BridgeCut
                .notice(format!(
                    "{path}: {} pieces of {key} that hung on by a bridge of a voxel were cut off",
                    mended.bridged
                ))
                .file(path)
                .of(key)
                .count(mended.bridged),
        );
    }
    if let [first, ..] = mended.specks_mm3[..] {
        let n = mended.specks_mm3.len();
        let resampled = if n > MOST_SPECKS {
            ": so many are no drawing's; was the map resampled with its numbers mixed (linear, not nearest neighbour), or not smoothed?"
        } else {
            ""
        };
        warnings.push(
            Kind::LoosePieces
                .notice(format!("{path}: {n} loose pieces of {key} left out, the largest of {first:.1} mm3{resampled}"))
                .file(path)
                .of(key)
                .count(n),
        );
    }
    if mended.holes_mm3 > 0.0 {
        warnings.push(
            Kind::VoidsFilled
                .notice(format!("{path}: holes of {:.1} mm3 within {key} filled", mended.holes_mm3))
                .file(path)
                .of(key),
        );
    }
}

/// The voxels of either part, on a grid about both.
fn joined(a: &Part, b: &Part) -> Part {
    let Some(to_index) = a.grid.index_from_mm() else { return a.clone() };
    let offset = (to_index * (b.grid.origin - a.grid.origin)).map(|x| x.round() as isize);
    let low: [isize; 3] = std::array::from_fn(|k| offset[k].min(0));
    let high: [isize; 3] = std::array::from_fn(|k| (a.grid.size[k] as isize).max(offset[k] + b.grid.size[k] as isize));
    let size = std::array::from_fn(|k| (high[k] - low[k]) as usize);
    let shift = nalgebra::Vector3::from(low.map(|x| x as f64));
    let grid = meshes::volume::Grid { size, origin: a.grid.point(&shift), axes: a.grid.axes };
    let mut inside = vec![false; grid.count()];
    for (part, off) in [(a, [0; 3]), (b, [offset[0], offset[1], offset[2]])] {
        for (i, _) in part.inside.iter().enumerate().filter(|(_, x)| **x) {
            let v = part.grid.voxel(i);
            inside[grid.at(std::array::from_fn(|k| (v[k] as isize + off[k] - low[k]) as usize))] = true;
        }
    }
    Part { grid, inside }
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::volume::Grid;
    use meshes::{Point, Vector};
    use nalgebra::Matrix3;

    #[test]
    fn a_number_whose_segment_has_another_structure_s_name_is_told() {
        let axes = Matrix3::from_diagonal(&Vector::new(1.0, 1.0, 1.0));
        let grid = Grid { size: [1, 1, 2], origin: Point::new(0.0, 0.0, 0.0), axes };
        let of = |names: &[(&str, u8)]| LabelMap {
            labels: Labels { grid: grid.clone(), values: vec![5, 6] },
            names: names.iter().map(|(name, label)| ((*name).to_owned(), *label)).collect(),
            overlapping: 0,
            stated: Vec::new(),
            notes: Vec::new(),
        };
        let said = |names: &[(&str, u8)], key: &str, label: LabelName| {
            called_otherwise(&of(names), (key, &label), 5).map(|notice| notice.text)
        };
        let exchanged = [("Femoral bone", 6), ("Tibia", 5)];
        let told = said(&exchanged, "femur", LabelName::Number(5)).unwrap();
        assert!(told.contains("segmentation.femur = 5") && told.contains("\"Tibia\", which is tibia"), "{told}");
        // who names the segment means it
        assert_eq!(said(&exchanged, "femur", LabelName::Name("Tibia".into())), None);
        for right in [&[("Femur", 5), ("Tibia", 6)][..], &[("Segment_5", 5)], &[("Fat pad", 5)], &[]] {
            assert_eq!(said(right, "femur", LabelName::Number(5)), None, "{right:?}");
        }
    }
}
