//! The data elements of a DICOM file, as far as a CT slice needs them.

use crate::FormatError;
use flate2::read::DeflateDecoder;
use std::borrow::Cow;
use std::io::Read;

/// How values are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Syntax {
    pub explicit: bool,
    pub big: bool,
    /// How pixels are packed.
    pub packing: Packing,
}

/// How pixels are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    None,
    Runs,
    /// JPEG: baseline, extended or lossless.
    Jpeg,
    Jpeg2000,
}

/// Deepest nesting of sequences that is followed.
const DEEPEST: usize = 32;
/// A length that says: until a delimiter.
const OPEN: u32 = u32::MAX;

const ITEM: u32 = 0xFFFE_E000;
const ITEM_END: u32 = 0xFFFE_E00D;
const SEQUENCE_END: u32 = 0xFFFE_E0DD;

pub(super) fn cut_short<T>() -> Result<T, FormatError> {
    Err(FormatError("the file ends in the middle of an element; it is cut short or damaged".into()))
}

/// Bytes read in order.
pub(super) struct Reader<'a> {
    pub bytes: &'a [u8],
    pub at: usize,
    pub syntax: Syntax,
}

/// An element: its tag and bytes; `None` bytes for a sequence, which has been passed over.
pub(super) struct Element<'a> {
    pub tag: u32,
    pub value: Option<&'a [u8]>,
    /// A sequence's items and what delimits them.
    pub sequence: Option<&'a [u8]>,
    /// Pixel data in fragments, the table of offsets first.
    pub fragments: Vec<&'a [u8]>,
}

/// The bodies of a sequence's items.
pub(super) fn items(sequence: &[u8], syntax: Syntax) -> Result<Vec<&[u8]>, FormatError> {
    let mut reader = Reader { bytes: sequence, at: 0, syntax };
    let mut items = Vec::new();
    while reader.at < sequence.len() {
        let (tag, length) = (reader.tag()?, reader.u32()?);
        match tag {
            ITEM if length != OPEN => items.push(reader.take(length as usize)?),
            ITEM => {
                let start = reader.at;
                while reader.element(1)?.tag != ITEM_END {}
                items.push(&sequence[start..reader.at - 8]);
            }
            SEQUENCE_END => break,
            _ => return Err(FormatError(format!("byte {}: no item of a sequence; the file is damaged", reader.at))),
        }
    }
    Ok(items)
}

impl<'a> Reader<'a> {
    pub(super) fn take(&mut self, n: usize) -> Result<&'a [u8], FormatError> {
        match self.at.checked_add(n).and_then(|end| self.bytes.get(self.at..end)) {
            Some(part) => {
                self.at += n;
                Ok(part)
            }
            None => cut_short(),
        }
    }

    fn u16(&mut self) -> Result<u16, FormatError> {
        let b = self.take(2)?;
        Ok(if self.syntax.big { u16::from_be_bytes([b[0], b[1]]) } else { u16::from_le_bytes([b[0], b[1]]) })
    }

    fn u32(&mut self) -> Result<u32, FormatError> {
        let b = self.take(4)?;
        let b = [b[0], b[1], b[2], b[3]];
        Ok(if self.syntax.big { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) })
    }

    fn tag(&mut self) -> Result<u32, FormatError> {
        Ok(u32::from(self.u16()?) << 16 | u32::from(self.u16()?))
    }

    /// The next element; `None` at the end of the bytes.
    pub(super) fn next(&mut self) -> Result<Option<Element<'a>>, FormatError> {
        if self.at >= self.bytes.len() {
            return Ok(None);
        }
        self.element(0).map(Some)
    }

    fn element(&mut self, depth: usize) -> Result<Element<'a>, FormatError> {
        let tag = self.tag()?;
        if tag >> 16 == 0xFFFE {
            let length = self.u32()?;
            return Ok(Element {
                tag,
                value: Some(self.take(length.min(OPEN - 1) as usize * usize::from(length != OPEN))?),
                sequence: None,
                fragments: vec![],
            });
        }
        let (sequence, length) = self.length()?;
        if tag == 0x7FE0_0010 && length == OPEN {
            return Ok(Element { tag, value: None, sequence: None, fragments: self.fragments()? });
        }
        if sequence || length == OPEN {
            let start = self.at;
            self.pass_sequence(length, depth + 1)?;
            return Ok(Element { tag, value: None, sequence: self.bytes.get(start..self.at), fragments: vec![] });
        }
        Ok(Element { tag, value: Some(self.take(length as usize)?), sequence: None, fragments: vec![] })
    }

    /// Whether a sequence follows, and the length.
    fn length(&mut self) -> Result<(bool, u32), FormatError> {
        if !self.syntax.explicit {
            return Ok((false, self.u32()?));
        }
        let kind = self.take(2)?;
        if !kind.iter().all(u8::is_ascii_uppercase) {
            return Err(FormatError(format!("byte {}: no DICOM element; the file is damaged", self.at - 2)));
        }
        Ok(match kind {
            b"OB" | b"OD" | b"OF" | b"OL" | b"OV" | b"OW" | b"SQ" | b"SV" | b"UC" | b"UN" | b"UR" | b"UT" | b"UV" => {
                self.take(2)?;
                (kind == b"SQ", self.u32()?)
            }
            _ => (false, u32::from(self.u16()?)),
        })
    }

    /// Passes over the items of a sequence.
    fn pass_sequence(&mut self, length: u32, depth: usize) -> Result<(), FormatError> {
        if length != OPEN {
            self.take(length as usize)?;
            return Ok(());
        }
        if depth > DEEPEST {
            return Err(FormatError(format!("sequences nested more than {DEEPEST} deep; the file is damaged")));
        }
        loop {
            let (tag, length) = (self.tag()?, self.u32()?);
            match tag {
                SEQUENCE_END => return Ok(()),
                ITEM if length != OPEN => {
                    self.take(length as usize)?;
                }
                ITEM => while self.element(depth)?.tag != ITEM_END {},
                _ => return Err(FormatError(format!("byte {}: no item of a sequence; the file is damaged", self.at))),
            }
        }
    }

    /// The fragments of packed pixels, the table of offsets first.
    fn fragments(&mut self) -> Result<Vec<&'a [u8]>, FormatError> {
        let mut fragments = Vec::new();
        loop {
            let (tag, length) = (self.tag()?, self.u32()?);
            match tag {
                SEQUENCE_END => return Ok(fragments),
                ITEM if length != OPEN => fragments.push(self.take(length as usize)?),
                _ => return Err(FormatError(format!("byte {}: no fragment of pixels; the file is damaged", self.at))),
            }
        }
    }
}

/// The elements after the file's own header, and how they are written.
pub(super) fn data(bytes: &[u8]) -> Result<(Cow<'_, [u8]>, Syntax), FormatError> {
    let plain = Syntax { explicit: true, big: false, packing: Packing::None };
    let mut reader = Reader { bytes, at: 132, syntax: plain };
    let mut name = String::new();
    loop {
        let start = reader.at;
        let group = bytes.get(start..start + 2);
        if group != Some(&[2, 0]) {
            break;
        }
        if let Some(Element { tag: 0x0002_0010, value: Some(value), .. }) = reader.next()? {
            name = text(value);
        }
    }
    let rest = bytes.get(reader.at..).unwrap_or(&[]);
    let syntax = match name.as_str() {
        "1.2.840.10008.1.2" => Syntax { explicit: false, ..plain },
        "1.2.840.10008.1.2.1" => plain,
        "1.2.840.10008.1.2.2" => Syntax { big: true, ..plain },
        "1.2.840.10008.1.2.5" => Syntax { packing: Packing::Runs, ..plain },
        "1.2.840.10008.1.2.4.50" | "1.2.840.10008.1.2.4.51" | "1.2.840.10008.1.2.4.57" | "1.2.840.10008.1.2.4.70" => {
            Syntax { packing: Packing::Jpeg, ..plain }
        }
        "1.2.840.10008.1.2.4.90" | "1.2.840.10008.1.2.4.91" => Syntax { packing: Packing::Jpeg2000, ..plain },
        "1.2.840.10008.1.2.1.99" => {
            // Slices are small; what unpacks to more is none.
            let mut unpacked = Vec::new();
            let most = (64 << 20) + 10 * rest.len() as u64;
            let read = DeflateDecoder::new(rest).take(most).read_to_end(&mut unpacked);
            read.map_err(|e| FormatError(format!("the file cannot be unpacked: {e}")))?;
            return Ok((Cow::Owned(unpacked), plain));
        }
        "" => {
            return Err(FormatError(
                "the file does not say how it is written (no transfer syntax); it is damaged".into(),
            ));
        }
        other => {
            let kind = match other {
                "1.2.840.10008.1.2.4.80" | "1.2.840.10008.1.2.4.81" => "JPEG-LS",
                "1.2.840.10008.1.2.4.201" | "1.2.840.10008.1.2.4.202" | "1.2.840.10008.1.2.4.203" => {
                    "high-throughput JPEG 2000"
                }
                _ => "a way of which no one here knows",
            };
            return Err(FormatError(format!(
                "pixels are compressed by {kind}, which is not read (transfer syntax {other}); export uncompressed DICOM, or convert it (gdcmconv --raw, dcmdjpeg)"
            )));
        }
    };
    Ok((Cow::Borrowed(rest), syntax))
}

/// Text without padding.
pub(super) fn text(value: &[u8]) -> String {
    String::from_utf8_lossy(value).trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_string()
}
