//! Traits of label maps: unit, axes, labels, crop, order of layers.

use super::{Dice, Trait};
use crate::common::{read, text, write};
use formats::nifti;
use meshes::volume::{Grid, Labels, crop};
use std::path::Path;

pub(super) const MAP: &str = "mri/labels.nii.gz";

fn map(folder: &Path) -> Labels {
    nifti::read_labels(&read(&folder.join(MAP))).unwrap()
}

fn save(folder: &Path, labels: &Labels) {
    let mut bytes = Vec::new();
    nifti::write_labels(&mut bytes, labels).unwrap();
    write(&folder.join(MAP), bytes);
}

/// Every second voxel, so that a build is fast.
pub(super) fn coarse(folder: &Path) {
    let whole = map(folder);
    let size = whole.grid.size.map(|n| n / 2);
    let grid = Grid { size, origin: whole.grid.origin, axes: whole.grid.axes * 2.0 };
    let at = |i: usize| whole.values[whole.grid.at(grid.voxel(i).map(|x| 2 * x))];
    let values = (0..grid.count()).map(at).collect();
    save(folder, &Labels { grid, values });
}

/// The map with its voxels in another order along the axes, the header as it was.
fn reordered(labels: &Labels, size: [usize; 3], from: impl Fn([usize; 3]) -> [usize; 3]) -> Labels {
    let grid = Grid { size, ..labels.grid.clone() };
    let values = (0..grid.count()).map(|i| labels.values[labels.grid.at(from(grid.voxel(i)))]).collect();
    Labels { grid, values }
}

fn changed(change: impl Fn(Labels) -> Labels + 'static) -> Box<dyn Fn(&Path)> {
    Box::new(move |folder| save(folder, &change(map(folder))))
}

/// The structures of the map: their label, and their name in a segmentation of 3D Slicer.
const SEGMENTS: [(u8, &str); 6] =
    [(1, "Femoral cartilage"), (2, "Medial"), (3, "Lateral"), (5, "Femur"), (6, "Tibia"), (7, "Patella")];
/// Orders of layers: another one that the header states; another one, with the header as it was; the layers one after the other and not
/// beside each other at each voxel.
const LAYER_ORDERS: [(&str, &[&str]); 3] = [
    ("in another order", &["layer*"]),
    ("exchanged under their header", &["label", "layer*"]),
    ("one after the other", &["axes", "layer*"]),
];

/// The map as a segmentation of 3D Slicer, a layer a structure. The layers are turned round by so many places, in one of the orders.
fn layers(by: usize, order: usize) -> Trait {
    let (name, words) = LAYER_ORDERS[order];
    let apply = move |folder: &Path| {
        let map = map(folder);
        let turned = |k: usize| (k + by) % SEGMENTS.len();
        // the structure of layer k is that of segment turned(k)
        let layers: Vec<Vec<u8>> = (0..SEGMENTS.len())
            .map(|k| {
                let label = SEGMENTS[turned(k)].0;
                map.values.iter().map(|v| if *v == label { label } else { 0 }).collect()
            })
            .collect();
        let layer_of = |segment: usize| match order {
            1 => segment,
            _ => (0..SEGMENTS.len()).find(|k| turned(*k) == segment).unwrap(),
        };
        write(&folder.join("mri/labels.seg.nrrd"), nrrd(&map, &layers, layer_of, order == 2));
        let toml = text(&folder.join("specimen.toml")).replace(MAP, "mri/labels.seg.nrrd");
        write(&folder.join("specimen.toml"), toml);
        std::fs::remove_file(folder.join(MAP)).unwrap();
    };
    Trait { name: format!("layers {name} of {MAP}, by {by}"), words, apply: Box::new(apply) }
}

/// An NRRD of layers: beside each other at each voxel, or one `after` the other.
fn nrrd(map: &Labels, layers: &[Vec<u8>], layer_of: impl Fn(usize) -> usize, after: bool) -> Vec<u8> {
    let g = &map.grid;
    let axis = |k: usize| format!("({},{},{})", g.axes[(0, k)], g.axes[(1, k)], g.axes[(2, k)]);
    let in_order =
        |list: String, space: String| if after { format!("{space} {list}") } else { format!("{list} {space}") };
    let sizes = in_order(layers.len().to_string(), g.size.map(|n| n.to_string()).join(" "));
    let directions = in_order("none".into(), [0, 1, 2].map(axis).join(" "));
    let kinds = in_order("list".into(), "domain domain domain".into());
    let mut head = format!(
        "NRRD0004\ntype: uchar\ndimension: 4\nspace: left-posterior-superior\nsizes: {sizes}\nspace directions: {directions}\nkinds: {kinds}\nencoding: raw\nspace origin: ({},{},{})\n",
        g.origin.x, g.origin.y, g.origin.z
    );
    for (k, (label, name)) in SEGMENTS.iter().enumerate() {
        head +=
            &format!("Segment{k}_Name:={name}\nSegment{k}_LabelValue:={label}\nSegment{k}_Layer:={}\n", layer_of(k));
    }
    head.push('\n');
    let voxels: Vec<u8> = match after {
        true => layers.concat(),
        false => (0..map.values.len()).flat_map(|v| layers.iter().map(move |layer| layer[v])).collect(),
    };
    [head.into_bytes(), voxels].concat()
}

/// Draws a trait of the label map.
pub(super) fn draw(dice: &mut Dice) -> Trait {
    let axis = dice.below(3);
    let pairs = [(1, 2), (2, 3), (1, 3), (5, 6), (5, 7), (1, 5), (3, 6)];
    let (a, b) = pairs[dice.below(pairs.len())];
    let (low, high) = (dice.below(12), dice.below(12));
    let scaled = |name: &str, factor: f64, words: &'static [&'static str]| Trait {
        name: format!("{name} of {MAP}"),
        words,
        apply: changed(move |mut m| {
            m.grid.axes *= factor;
            m.grid.origin = (m.grid.origin.coords * factor).into();
            m
        }),
    };
    match dice.below(13) {
        0 => scaled("metres", 1e-3, &["metres"]),
        1 => scaled("centimetres", 0.1, &["centimetres"]),
        2 => scaled("spacing of another picture", 1.4, &["adults", "unit"]),
        3 => Trait {
            name: format!("axis {axis} flipped in {MAP}"),
            words: &["mirror*", "side", "flip*"],
            apply: changed(move |m| {
                let n = m.grid.size;
                reordered(&m, n, |mut v| {
                    v[axis] = n[axis] - 1 - v[axis];
                    v
                })
            }),
        },
        4 => Trait {
            name: format!("axes {axis} and {} exchanged in {MAP}", (axis + 1) % 3),
            words: &["mirror*", "side", "transposed", "axes", "adults"],
            apply: changed(move |m| {
                let mut size = m.grid.size;
                size.swap(axis, (axis + 1) % 3);
                reordered(&m, size, |mut v| {
                    v.swap(axis, (axis + 1) % 3);
                    v
                })
            }),
        },
        5 => Trait {
            name: format!("labels {a} and {b} exchanged in {MAP}"),
            words: &["exchange*", "label", "labels"],
            apply: changed(move |mut m| {
                let other = |l: u8| {
                    if l == a {
                        b
                    } else if l == b {
                        a
                    } else {
                        l
                    }
                };
                m.values.iter_mut().for_each(|l| *l = other(*l));
                m
            }),
        },
        6 => Trait {
            name: format!("{low} and {high} slices cropped along {axis} of {MAP}"),
            words: &["cut", "crop*", "border*"],
            apply: changed(move |m| {
                let (mut from, mut to) = ([0; 3], m.grid.size.map(|n| n - 1));
                from[axis] += low;
                to[axis] -= high;
                Labels { grid: m.grid.part(from, to), values: crop(&m.grid, &m.values, from, to) }
            }),
        },
        7 => {
            // a stretch forwards keeps the femur's proportions that are looked at
            let stretched = [0, 2][axis % 2];
            Trait {
                name: format!("spacing along {stretched} of another picture in {MAP}"),
                words: &["spacing", "stretched"],
                apply: changed(move |mut m| {
                    m.grid.axes.column_mut(stretched).scale_mut(1.43);
                    m
                }),
            }
        }
        8 => Trait {
            name: format!("one condyle's cartilage missing in {MAP}"),
            words: &["condyle*"],
            apply: changed(move |mut m| {
                let all: Vec<usize> = (0..m.values.len()).filter(|i| m.values[*i] == 1).collect();
                let middle = all.iter().map(|i| m.grid.voxel(*i)[0]).sum::<usize>() / all.len();
                all.iter().filter(|i| m.grid.voxel(**i)[0] < middle).for_each(|i| m.values[*i] = 0);
                m
            }),
        },
        9..12 => layers(1 + dice.below(SEGMENTS.len() - 1), dice.below(LAYER_ORDERS.len())),
        _ => Trait {
            name: "side of the living knee".into(),
            words: &["side"],
            apply: Box::new(|folder| {
                let toml = text(&folder.join("specimen.toml"));
                let [left, right] = ["side = \"left\"", "side = \"right\""];
                let (from, to) = if toml.contains(left) { (left, right) } else { (right, left) };
                write(&folder.join("specimen.toml"), toml.replace(from, to));
            }),
        },
    }
}
