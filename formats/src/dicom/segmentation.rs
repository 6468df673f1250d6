//! DICOM segmentations: frames of one segment each, binary or fractional, or a label map, placed by their functional groups [dicom2024].

use super::element::{Packing, Reader, Syntax, data, items, text};
use super::{UNEVEN, frames, point, refuse};
use crate::FormatError;
use crate::raw;
use meshes::volume::{Grid, Labels};
use meshes::{Point, Vector};
use nalgebra::Matrix3;
use notices::{Kind, Notice};
use std::collections::BTreeMap;

/// Kinds of objects: segmentations, and contours that are often taken for one.
const SEGMENTATIONS: [&str; 2] = ["1.2.840.10008.5.1.4.1.1.66.4", "1.2.840.10008.5.1.4.1.1.66.7"];
const CONTOURS: &str = "1.2.840.10008.5.1.4.1.1.481.3";
/// Most frames of one file: each segment has as many as the picture has slices.
const MOST_FRAMES: usize = 100_000;
/// Slices without a frame are background; of so many more than there are with one [-], the places are damaged.
const MOST_EMPTY: usize = 16;
/// Share of the largest fractional value from which on a voxel belongs to a segment [-].
const HALF: f64 = 0.5;
/// Deepest nesting of functional groups.
const DEEPEST: usize = 6;
/// Slices may lie this share of a pixel sideways of their stack [-].
const SIDEWAYS: f64 = 0.25;

/// A segmentation as a label map.
pub(crate) struct Segmentation {
    /// A label is its segment's number.
    pub(crate) labels: Labels,
    /// Names and numbers of the segments.
    pub(crate) names: Vec<(String, u8)>,
    /// Voxels that lay in several segments and stay in the first [-].
    pub(crate) overlapping: usize,
    /// What is odd about the file but not fatal.
    pub(crate) notes: Vec<Notice>,
}

/// What is said of a frame, or of all.
#[derive(Clone, Default)]
struct Place {
    position: Vec<f64>,
    orientation: Vec<f64>,
    pixel: Vec<f64>,
    spacing: Option<f64>,
    segment: Option<usize>,
}

/// The header.
#[derive(Default)]
struct Header {
    object: String,
    kind: String,
    count: usize,
    shorts: BTreeMap<u32, u16>,
    segments: Vec<(usize, String)>,
    shared: Place,
    each: Vec<Place>,
}

const ROWS: u32 = 0x0028_0010;
const COLUMNS: u32 = 0x0028_0011;
const ALLOCATED: u32 = 0x0028_0100;
const LARGEST: u32 = 0x0062_000E;
const BACKGROUND: u32 = 0x0028_0120;

/// Reads a segmentation as a label map: a label is its segment's number, its name the segment's label. Slices without a frame are background.
///
/// # Errors
/// Another kind of object, by its name; packed bits; frames without place or segment, or that are no even stack; more than 255 segments.
pub(crate) fn read(bytes: &[u8]) -> Result<Segmentation, FormatError> {
    let (data, syntax) = data(bytes)?;
    let mut reader = Reader { bytes: &data, at: 0, syntax };
    let mut header = Header::default();
    let pixels = loop {
        match reader.next()? {
            Some(element) if element.tag == 0x7FE0_0010 => break Some(element),
            Some(element) => match (element.sequence, element.value) {
                (Some(own), _) => header.sequence(element.tag, own, syntax)?,
                (None, Some(value)) => header.take(element.tag, value, syntax.big),
                _ => {}
            },
            None => break None,
        }
    };
    header.is_segmentation()?;
    let Some(pixels) = pixels else { return refuse("the segmentation has no pixels; the file is cut short") };
    let stack = header.stack()?;
    let shape = frames::Shape { rows: stack.grid.size[1], columns: stack.grid.size[0], bytes: 1 };
    let mut merge = Merge::of(&header, &stack);
    match header.shorts.get(&ALLOCATED) {
        Some(1) if syntax.packing == Packing::None => {
            let all = pixels.value.unwrap_or_default();
            let size = shape.rows * shape.columns;
            if all.len() < (size * header.count).div_ceil(8) {
                return refuse(format!(
                    "{} frames of {size} bits are more than the {} bytes there; the file is cut short",
                    header.count,
                    all.len()
                ));
            }
            // bits of all frames follow each other, the lowest of a byte first
            merge.all(|frame, pixel| {
                let bit = frame * size + pixel;
                u16::from(all[bit / 8] >> (bit % 8) & 1)
            })?;
        }
        Some(8) => {
            let own = frames::frames(pixels, syntax.packing, &shape, header.count)?;
            if own.iter().any(|f| f.len() < shape.rows * shape.columns) {
                return refuse("a frame is shorter than its rows and columns; the file is cut short");
            }
            merge.all(|frame, pixel| u16::from(own[frame][pixel]))?;
        }
        bits => {
            return refuse(format!(
                "a segmentation of {} bits a pixel{}, which is not read; export it uncompressed",
                bits.map_or("unknown".into(), u16::to_string),
                if syntax.packing == Packing::None { "" } else { ", packed" }
            ));
        }
    }
    Ok(merge.map(&header, stack.empty))
}

impl Header {
    fn take(&mut self, tag: u32, value: &[u8], big: bool) {
        match tag {
            0x0008_0016 => self.object = text(value),
            0x0062_0001 => self.kind = text(value),
            0x0028_0008 => self.count = text(value).parse().unwrap_or(0),
            ROWS | COLUMNS | ALLOCATED | LARGEST | BACKGROUND => {
                if let Some(n) = short(value, big) {
                    self.shorts.insert(tag, n);
                }
            }
            _ => {}
        }
    }

    fn sequence(&mut self, tag: u32, own: &[u8], syntax: Syntax) -> Result<(), FormatError> {
        let place = |item: &[u8]| {
            let mut place = Place::default();
            groups(item, syntax, 0, &mut |tag, value| place.take(tag, value, syntax.big))?;
            Ok(place)
        };
        match tag {
            0x5200_9229 => {
                for item in items(own, syntax)? {
                    self.shared = place(item)?;
                }
            }
            0x5200_9230 => {
                for item in items(own, syntax)?.into_iter().take(MOST_FRAMES) {
                    self.each.push(place(item)?);
                }
            }
            0x0062_0002 => {
                for item in items(own, syntax)? {
                    let (mut number, mut name) = (None, String::new());
                    groups(item, syntax, DEEPEST, &mut |tag, value| match tag {
                        0x0062_0004 => number = short(value, syntax.big),
                        0x0062_0005 => name = text(value),
                        _ => {}
                    })?;
                    // a label map names its background, too
                    let own = number.filter(|n| *n > 0 || self.kind != "LABELMAP");
                    self.segments.extend(own.map(|n| (usize::from(n), name)));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn is_segmentation(&self) -> Result<(), FormatError> {
        let expected = "expected a DICOM segmentation (SEG), NIfTI, NRRD or MetaImage";
        if self.object == CONTOURS {
            return refuse(format!("it is an RT structure set, contours without voxels; {expected}"));
        }
        if !SEGMENTATIONS.contains(&self.object.as_str()) {
            return refuse(format!("it is no segmentation (kind {}); {expected}", self.object));
        }
        if !["BINARY", "FRACTIONAL", "LABELMAP"].contains(&self.kind.as_str()) {
            return refuse(format!("a segmentation of type `{}`; expected BINARY, FRACTIONAL or LABELMAP", self.kind));
        }
        if let Some((n, name)) = self.segments.iter().find(|(n, _)| !(1..=255).contains(n)) {
            return refuse(format!(
                "segment {n} ({name}); expected numbers from 1 to 255: export the knee's segments alone"
            ));
        }
        if self.count == 0 || self.count > MOST_FRAMES || self.each.len() != self.count {
            return refuse(format!(
                "{} frames, of which {} have a place; expected 1 to {MOST_FRAMES}, each with its functional groups",
                self.count,
                self.each.len()
            ));
        }
        Ok(())
    }

    /// Where the frames lie: the grid about all, and the slice of each.
    fn stack(&self) -> Result<Stack, FormatError> {
        let size = |tag| self.shorts.get(&tag).map(|n| usize::from(*n)).filter(|n| *n > 0);
        let (Some(rows), Some(columns)) = (size(ROWS), size(COLUMNS)) else {
            return refuse("no rows or columns; the file is damaged");
        };
        let wrong = |what: &str| {
            FormatError(format!(
                "{what} is missing or no number, or differs from frame to frame; expected a segmentation with its place in the patient"
            ))
        };
        let one = |own: fn(&Place) -> &Vec<f64>| {
            let first = self.each.iter().map(own).find(|v| !v.is_empty()).unwrap_or(own(&self.shared));
            let same = self
                .each
                .iter()
                .map(own)
                .all(|v| v.is_empty() || v.iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-4));
            same.then(|| first.clone())
        };
        let orientation =
            one(|p| &p.orientation).filter(|o| o.len() == 6).ok_or_else(|| wrong("the image orientation"))?;
        let direction = |x: &[f64]| point(x).and_then(|p| p.coords.try_normalize(0.5));
        let axes =
            direction(&orientation[..3]).zip(direction(&orientation[3..])).filter(|(a, b)| a.dot(b).abs() < 0.01);
        let (along_row, along_column) = axes.ok_or_else(|| wrong("the image orientation"))?;
        let pixel = match one(|p| &p.pixel).as_deref() {
            Some(&[a, b]) if [a, b].iter().all(|x| (1e-3..1e3).contains(x)) => [a, b],
            _ => return Err(wrong("the pixel spacing")),
        };
        let mut places = Vec::new();
        for each in &self.each {
            let own = if each.position.is_empty() { &self.shared.position } else { &each.position };
            places.push(point(own).ok_or_else(|| wrong("the image position"))?);
        }
        let normal = along_row.cross(&along_column).normalize();
        let spacing = self.shared.spacing.or(self.each[0].spacing).filter(|s| s.is_finite() && *s > 1e-3);
        let (step, first, slices) = even(&places, &normal, spacing, pixel[0].min(pixel[1]))?;
        let depth = slices.iter().max().map_or(1, |n| n + 1);
        let mut with = slices.clone();
        with.sort_unstable();
        with.dedup();
        if depth > MOST_EMPTY * (with.len() + 1) {
            return refuse(format!(
                "{} slices have a frame, {depth} lie between the first and the last; the places are damaged",
                with.len()
            ));
        }
        let grid = Grid {
            size: [columns, rows, depth],
            origin: first,
            axes: Matrix3::from_columns(&[along_row * pixel[1], along_column * pixel[0], step]),
        };
        raw::count(grid.size)?;
        Ok(Stack { grid, slices, empty: depth - with.len() })
    }
}

/// The step from slice to slice, the first slice's place, and each frame's slice.
fn even(
    places: &[Point],
    normal: &Vector,
    spacing: Option<f64>,
    pixel: f64,
) -> Result<(Vector, Point, Vec<usize>), FormatError> {
    let along: Vec<f64> = places.iter().map(|p| normal.dot(&p.coords)).collect();
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|a, b| along[*a].total_cmp(&along[*b]));
    let (low, high) = (order[0], order[order.len() - 1]);
    let gaps = order.windows(2).map(|w| along[w[1]] - along[w[0]]).filter(|g| *g > super::SAME_PLACE);
    let least = gaps.fold(f64::INFINITY, f64::min);
    let fits = |step: f64| {
        let off = |x: &f64| ((x - along[low]) / step - ((x - along[low]) / step).round()).abs();
        along.iter().all(|x| off(x) < UNEVEN)
    };
    let found = spacing.filter(|s| fits(*s)).or(Some(least).filter(|s| s.is_finite() && fits(*s)));
    let Some(step) = found else {
        return refuse(match least.is_finite() {
            true => {
                "the frames are no even stack: their slices lie at uneven distances; export the segmentation on one grid"
            }
            false => "all frames lie in one slice; expected a segmentation of the whole knee",
        });
    };
    let count = ((along[high] - along[low]) / step).round();
    let step = if count > 0.0 { (places[high] - places[low]) / count } else { normal * step };
    let mut slices = Vec::new();
    for (place, x) in places.iter().zip(&along) {
        let k = ((x - along[low]) / normal.dot(&step)).round();
        let off: Vector = place - (places[low] + step * k);
        if (off - normal * normal.dot(&off)).norm() > SIDEWAYS * pixel {
            return refuse(
                "frames lie sideways of each other; expected slices in one line: export the segmentation on one grid",
            );
        }
        slices.push(k as usize);
    }
    Ok((step, places[low], slices))
}

/// The grid, each frame's slice, and how many slices have no frame.
struct Stack {
    grid: Grid,
    slices: Vec<usize>,
    empty: usize,
}

/// Frames made one label map.
struct Merge<'a> {
    header: &'a Header,
    stack: &'a Stack,
    values: Vec<u8>,
    overlapping: usize,
}

impl<'a> Merge<'a> {
    fn of(header: &'a Header, stack: &'a Stack) -> Merge<'a> {
        Merge { header, stack, values: Vec::new(), overlapping: 0 }
    }

    /// Lays every frame on the map; `value` is a frame's pixel. Of segments that overlap the first stays.
    fn all(&mut self, value: impl Fn(usize, usize) -> u16) -> Result<(), FormatError> {
        let (header, stack) = (self.header, self.stack);
        self.values = vec![0; stack.grid.count()];
        let size = stack.grid.size[0] * stack.grid.size[1];
        let background = header.shorts.get(&BACKGROUND).copied().unwrap_or(0);
        let largest = header.shorts.get(&LARGEST).copied().unwrap_or(255).max(1);
        let least = (HALF * f64::from(largest)).ceil().max(1.0) as u16;
        let mut order: Vec<(usize, usize)> = Vec::new();
        for frame in 0..header.count {
            let segment = header.each[frame].segment.or(header.shared.segment);
            match segment {
                _ if header.kind == "LABELMAP" => order.push((0, frame)),
                Some(n) if header.segments.iter().any(|(s, _)| *s == n) => order.push((n, frame)),
                _ => {
                    return refuse(format!(
                        "frame {} belongs to no segment that the file names; it is damaged",
                        frame + 1
                    ));
                }
            }
        }
        order.sort_unstable();
        for (segment, frame) in order {
            let start = stack.slices[frame] * size;
            for pixel in 0..size {
                let seen = value(frame, pixel);
                let own = match header.kind.as_str() {
                    "LABELMAP" => {
                        if seen == background {
                            0
                        } else {
                            seen as u8
                        }
                    }
                    "FRACTIONAL" => {
                        if seen >= least {
                            segment as u8
                        } else {
                            0
                        }
                    }
                    _ => {
                        if seen > 0 {
                            segment as u8
                        } else {
                            0
                        }
                    }
                };
                let there = &mut self.values[start + pixel];
                if own != 0 && *there == 0 {
                    *there = own;
                } else if own != 0 && *there != own {
                    self.overlapping += 1;
                }
            }
        }
        Ok(())
    }

    fn map(self, header: &Header, empty: usize) -> Segmentation {
        let names = header.segments.iter().map(|(n, name)| (name.clone(), *n as u8)).collect();
        let mut notes = Vec::new();
        if empty > 0 {
            notes.push(
                Kind::EmptySlices
                    .notice(format!("{empty} slices between the first and the last have no frame and are background"))
                    .count(empty),
            );
        }
        if header.kind == "FRACTIONAL" {
            notes.push(
                Kind::FractionalLabels
                    .notice("the segmentation is fractional; voxels of half or more belong to a segment"),
            );
        }
        let labels = Labels { grid: self.stack.grid.clone(), values: self.values };
        Segmentation { labels, names, overlapping: self.overlapping, notes }
    }
}

impl Place {
    fn take(&mut self, tag: u32, value: &[u8], big: bool) {
        let numbers = || text(value).split('\\').map(|x| x.trim().parse().unwrap_or(f64::NAN)).collect::<Vec<f64>>();
        match tag {
            0x0020_0032 => self.position = numbers(),
            0x0020_0037 => self.orientation = numbers(),
            0x0028_0030 => self.pixel = numbers(),
            0x0018_0088 => self.spacing = numbers().first().copied(),
            0x0062_000B => self.segment = short(value, big).map(usize::from),
            _ => {}
        }
    }
}

fn short(value: &[u8], big: bool) -> Option<u16> {
    let b = [*value.first()?, *value.get(1)?];
    Some(if big { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) })
}

/// Gives every element of an item and, above the deepest nesting, of the groups in it.
fn groups(bytes: &[u8], syntax: Syntax, depth: usize, give: &mut dyn FnMut(u32, &[u8])) -> Result<(), FormatError> {
    let mut reader = Reader { bytes, at: 0, syntax };
    while let Some(element) = reader.next()? {
        match (element.sequence, element.value) {
            (Some(own), _) if depth < DEEPEST => {
                for item in items(own, syntax)? {
                    groups(item, syntax, depth + 1, give)?;
                }
            }
            (None, Some(value)) => give(element.tag, value),
            _ => {}
        }
    }
    Ok(())
}
