//! Files of National Instruments' programs (.tdms): channels of numbers in groups, in segments, as NI publishes their layout.
//!
//! A segment has a lead-in, a description of its channels and their raw data. A description may say "as before". Data may lie channel after channel
//! or sample after sample, in either order of bytes.

use std::collections::BTreeMap;

/// What a file begins with, and each of its segments.
const TAG: &[u8] = b"TDSm";
/// Length of a lead-in [bytes].
const LEAD_IN: usize = 28;
/// What a segment has, by the bits of its lead-in.
const META: u32 = 1 << 1;
const NEW_LIST: u32 = 1 << 2;
const RAW: u32 = 1 << 3;
const INTERLEAVED: u32 = 1 << 5;
const BIG_ENDIAN: u32 = 1 << 6;
const DAQMX: u32 = 1 << 7;
/// In place of the length of a description: no data in this segment, or those of the segment before.
const NO_DATA: u32 = u32::MAX;
const AS_BEFORE: u32 = 0;
/// Lengths of a description: of numbers, and of texts [bytes].
const DESCRIPTIONS: [u32; 2] = [20, 28];
/// The type of texts.
const TEXT: u32 = 0x20;
/// Groups and channels beyond these are no measurement's [-]. Ours.
const MOST_OBJECTS: usize = 10_000;

/// A channel of numbers.
#[derive(Debug, PartialEq)]
pub(super) struct Channel {
    pub(super) group: String,
    pub(super) name: String,
    /// The unit that the file states.
    pub(super) unit: Option<String>,
    pub(super) values: Vec<f64>,
}

/// The channels of a file.
#[derive(Debug, PartialEq)]
pub(super) struct Tdms {
    pub(super) channels: Vec<Channel>,
    /// Whether the last values of a segment are lost: the program that wrote them was stopped.
    pub(super) is_cut: bool,
}

/// Whether a file is one.
pub(super) fn is_tdms(bytes: &[u8]) -> bool {
    bytes.starts_with(TAG)
}

/// Reads the channels that hold numbers, in the order in which the file first names them.
///
/// # Errors
/// A segment that is none, types that are not known, raw data of DAQmx.
pub(super) fn read(bytes: &[u8]) -> Result<Tdms, String> {
    let mut file = File::default();
    let mut start = 0;
    while start < bytes.len() {
        if bytes.len() - start < LEAD_IN {
            file.is_cut = true;
            break;
        }
        let segment = Segment::at(bytes, start)?;
        file.is_cut |= segment.is_cut;
        file.take(bytes, &segment)?;
        start = segment.end;
    }
    Ok(file.finished())
}

/// Where the parts of a segment lie.
struct Segment {
    has: u32,
    meta: usize,
    data: usize,
    end: usize,
    is_cut: bool,
}

impl Segment {
    fn at(bytes: &[u8], start: usize) -> Result<Segment, String> {
        let mut lead = Cursor { bytes, at: start, is_big: false };
        if lead.take(TAG.len())? != TAG {
            return Err(format!("a segment is expected at byte {start}, but does not begin with TDSm"));
        }
        // the bits are little-endian in every file
        let has = lead.u32()?;
        lead.is_big = has & BIG_ENDIAN != 0;
        lead.u32()?;
        let (next, raw) = (lead.u64()?, lead.u64()?);
        let from = |offset: u64| usize::try_from(offset).ok().and_then(|o| lead.at.checked_add(o));
        let wanted = from(next).filter(|end| *end <= bytes.len());
        let (end, is_cut) = (wanted.unwrap_or(bytes.len()), wanted.is_none());
        let data = from(raw).filter(|data| *data <= end);
        let data = data.ok_or_else(|| format!("the segment at byte {start} ends before its data begin"))?;
        if has & DAQMX != 0 {
            return Err(
                "the file holds raw data of DAQmx, which need the scales of its hardware; save it with scaled values"
                    .into(),
            );
        }
        Ok(Segment { has, meta: lead.at, data, end, is_cut })
    }

    fn has(&self, what: u32) -> bool {
        self.has & what != 0
    }
}

/// What a segment holds of an object.
#[derive(Clone, Copy)]
struct Layout {
    kind: u32,
    /// Of all its values in a chunk.
    bytes: usize,
}

/// A group or channel.
#[derive(Default)]
struct Object {
    path: String,
    properties: BTreeMap<String, String>,
    layout: Option<Layout>,
    values: Vec<f64>,
}

impl Object {
    fn extend(&mut self, raw: &[u8], kind: u32, is_big: bool) {
        if let Some(size) = size(kind).filter(|_| is_number(kind)) {
            self.values.extend(raw.chunks_exact(size).map(|cell| number(kind, cell, is_big)));
        }
    }
}

/// What has been read so far.
#[derive(Default)]
struct File {
    objects: Vec<Object>,
    /// Places of objects by their paths.
    places: BTreeMap<String, usize>,
    /// The objects of a segment in order, with what each holds there.
    list: Vec<(usize, Option<Layout>)>,
    is_cut: bool,
}

impl File {
    fn take(&mut self, bytes: &[u8], segment: &Segment) -> Result<(), String> {
        let is_big = segment.has(BIG_ENDIAN);
        if segment.has(NEW_LIST) {
            self.list.clear();
        }
        if segment.has(META) {
            self.describe(&mut Cursor { bytes: &bytes[..segment.data], at: segment.meta, is_big })?;
        }
        if segment.has(RAW) {
            self.values(&bytes[segment.data..segment.end], is_big, segment.has(INTERLEAVED))?;
        }
        Ok(())
    }

    fn place(&mut self, path: String) -> Result<usize, String> {
        if let Some(place) = self.places.get(&path) {
            return Ok(*place);
        }
        if self.objects.len() >= MOST_OBJECTS {
            return Err(format!("more than {MOST_OBJECTS} groups and channels; expected those of one measurement"));
        }
        self.places.insert(path.clone(), self.objects.len());
        self.objects.push(Object { path, ..Object::default() });
        Ok(self.objects.len() - 1)
    }

    /// The description of a segment's objects.
    fn describe(&mut self, from: &mut Cursor) -> Result<(), String> {
        for _ in 0..from.u32()? {
            let path = from.text()?;
            let place = self.place(path)?;
            let layout = match from.u32()? {
                NO_DATA => None,
                AS_BEFORE => Some(self.objects[place].layout.ok_or_else(|| {
                    format!("{} has data \"as before\", but none stand before", self.objects[place].path)
                })?),
                length if DESCRIPTIONS.contains(&length) => Some(from.layout()?),
                length => return Err(format!("a description of data of {length} bytes; expected 20 or 28")),
            };
            self.objects[place].layout = layout.or(self.objects[place].layout);
            match self.list.iter_mut().find(|(other, _)| *other == place) {
                Some(known) => known.1 = layout,
                None => self.list.push((place, layout)),
            }
            for _ in 0..from.u32()? {
                let key = from.text()?;
                if let Some(value) = from.property()? {
                    self.objects[place].properties.insert(key, value);
                }
            }
        }
        Ok(())
    }

    /// The raw data of a segment: chunks, each with the values of every object.
    fn values(&mut self, raw: &[u8], is_big: bool, is_interleaved: bool) -> Result<(), String> {
        let active: Vec<(usize, Layout)> = self.list.iter().filter_map(|(o, l)| Some((*o, (*l)?))).collect();
        let widths: Vec<usize> = match is_interleaved {
            false => active.iter().map(|(_, l)| l.bytes).collect(),
            true => {
                let sizes = active.iter().map(|(_, l)| size(l.kind).ok_or("texts among numbers, sample after sample"));
                sizes.collect::<Result<_, _>>()?
            }
        };
        let chunk = widths.iter().try_fold(0usize, |sum, w| sum.checked_add(*w)).filter(|c| *c > 0);
        let Some(chunk) = chunk else { return Ok(()) };
        self.is_cut |= !raw.len().is_multiple_of(chunk);
        for block in raw.chunks_exact(chunk) {
            let mut rest = block;
            for ((object, layout), width) in active.iter().zip(&widths) {
                let (own, after) = rest.split_at(*width);
                self.objects[*object].extend(own, layout.kind, is_big);
                rest = after;
            }
        }
        Ok(())
    }

    fn finished(self) -> Tdms {
        let channel = |object: Object| {
            let [group, name] = <[String; 2]>::try_from(names(&object.path)).ok()?;
            let unit = ["unit_string", "NI_UnitDescription"].iter().find_map(|key| object.properties.get(*key));
            let unit = unit.map(|u| u.trim().to_owned()).filter(|u| !u.is_empty());
            (!object.values.is_empty()).then_some(Channel { group, name, unit, values: object.values })
        };
        Tdms { channels: self.objects.into_iter().filter_map(channel).collect(), is_cut: self.is_cut }
    }
}

/// The names in a path such as `/'group'/'channel'`; a quote in a name is written twice.
fn names(path: &str) -> Vec<String> {
    let mut out = Vec::new();
    let mut letters = path.chars().peekable();
    while let Some(letter) = letters.next() {
        if letter != '\'' {
            continue;
        }
        let mut name = String::new();
        while let Some(letter) = letters.next() {
            if letter == '\'' && letters.next_if_eq(&'\'').is_none() {
                break;
            }
            name.push(letter);
        }
        out.push(name);
    }
    out
}

/// Bytes of a value of a type; none of texts and of types that are not known.
fn size(kind: u32) -> Option<usize> {
    match kind {
        0x01 | 0x05 | 0x21 => Some(1),
        0x02 | 0x06 => Some(2),
        0x03 | 0x07 | 0x09 | 0x19 => Some(4),
        0x04 | 0x08 | 0x0a | 0x1a | 0x0008_000c => Some(8),
        // a point in time, and a complex number
        0x44 | 0x0010_000d => Some(16),
        _ => None,
    }
}

/// Whether a type is whole numbers, numbers of one or two words, or yes and no.
fn is_number(kind: u32) -> bool {
    matches!(kind, 0x01..=0x0a | 0x19 | 0x1a | 0x21)
}

/// A value of a type that [`is_number`].
fn number(kind: u32, cell: &[u8], is_big: bool) -> f64 {
    let mut bytes = [0; 8];
    for (to, from) in bytes.iter_mut().zip(cell) {
        *to = *from;
    }
    if is_big {
        bytes[..cell.len().min(8)].reverse();
    }
    let whole = u64::from_le_bytes(bytes);
    match kind {
        0x01 => f64::from(whole as u8 as i8),
        0x02 => f64::from(whole as u16 as i16),
        0x03 => f64::from(whole as u32 as i32),
        0x04 => whole as i64 as f64,
        0x09 | 0x19 => f64::from(f32::from_bits(whole as u32)),
        0x0a | 0x1a => f64::from_bits(whole),
        _ => whole as f64,
    }
}

/// A place in the file.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    is_big: bool,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(count).filter(|end| *end <= self.bytes.len());
        let end = end.ok_or_else(|| format!("the description of a segment ends within, at byte {}", self.at))?;
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    fn u32(&mut self) -> Result<u32, String> {
        let raw = <[u8; 4]>::try_from(self.take(4)?).unwrap_or_default();
        Ok(if self.is_big { u32::from_be_bytes(raw) } else { u32::from_le_bytes(raw) })
    }

    fn u64(&mut self) -> Result<u64, String> {
        let raw = <[u8; 8]>::try_from(self.take(8)?).unwrap_or_default();
        Ok(if self.is_big { u64::from_be_bytes(raw) } else { u64::from_le_bytes(raw) })
    }

    fn text(&mut self) -> Result<String, String> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }

    fn layout(&mut self) -> Result<Layout, String> {
        let (kind, dimension, count) = (self.u32()?, self.u32()?, self.u64()?);
        if dimension != 1 {
            return Err(format!("data of {dimension} dimensions; expected rows of numbers"));
        }
        let bytes = match (kind, size(kind)) {
            (TEXT, _) => Some(self.u64()?),
            (_, Some(size)) => count.checked_mul(size as u64),
            _ => return Err(format!("data of type {kind:#x}, which is not read; save them as numbers of 64 bits")),
        };
        let bytes = bytes.and_then(|b| usize::try_from(b).ok());
        Ok(Layout { kind, bytes: bytes.ok_or_else(|| format!("{count} values in a segment"))? })
    }

    /// A property as text; none where it is no text and no number.
    fn property(&mut self) -> Result<Option<String>, String> {
        let kind = self.u32()?;
        if kind == TEXT {
            return self.text().map(Some);
        }
        let Some(size) = size(kind) else { return Err(format!("a property of type {kind:#x}, which is not read")) };
        let (raw, is_big) = (self.take(size)?, self.is_big);
        Ok(is_number(kind).then(|| number(kind, raw, is_big).to_string()))
    }
}
