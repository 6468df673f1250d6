//! The pixels of each frame, unpacked.

use super::element::{Element, Packing};
use super::{refuse, rle};
use crate::FormatError;
use std::borrow::Cow;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Rows and columns of a frame and bytes of a pixel.
pub(super) struct Shape {
    pub rows: usize,
    pub columns: usize,
    pub bytes: usize,
}

impl Shape {
    fn pixels(&self) -> usize {
        self.rows * self.columns
    }
}

/// The pixels of `count` frames, little-endian where they were packed.
pub(super) fn frames<'a>(
    pixels: Element<'a>,
    packing: Packing,
    shape: &Shape,
    count: usize,
) -> Result<Vec<Cow<'a, [u8]>>, FormatError> {
    let size = shape.pixels() * shape.bytes;
    match (pixels.value, packing) {
        (Some(plain), Packing::None) => {
            if count == 1 {
                return Ok(vec![Cow::Borrowed(plain)]);
            }
            if size == 0 || plain.len() / size < count {
                return refuse(format!(
                    "{count} frames take {} bytes, {} are there; the file is cut short",
                    count.saturating_mul(size),
                    plain.len()
                ));
            }
            Ok(plain.chunks_exact(size).take(count).map(Cow::Borrowed).collect())
        }
        (None, Packing::Runs | Packing::Jpeg | Packing::Jpeg2000) => {
            let unpacked = |own: Cow<[u8]>| -> Result<Cow<'a, [u8]>, FormatError> {
                Ok(Cow::Owned(match packing {
                    Packing::Jpeg => jpeg(&own, shape)?,
                    Packing::Jpeg2000 => jpeg_2000(&own, shape)?,
                    _ => rle::unpacked(&own, shape.pixels(), shape.bytes)?,
                }))
            };
            fragments(&pixels.fragments, count)?.into_iter().map(unpacked).collect()
        }
        _ => refuse("the pixels are not written as the file says; it is damaged"),
    }
}

/// The packed bytes of each frame: a fragment each, or by the table of offsets.
pub(super) fn fragments<'a>(all: &[&'a [u8]], count: usize) -> Result<Vec<Cow<'a, [u8]>>, FormatError> {
    let Some((table, parts)) = all.split_first() else { return refuse("the file has no pixels; it is cut short") };
    if count == 1 {
        return Ok(vec![Cow::Owned(parts.concat())]);
    }
    if parts.len() == count {
        return Ok(parts.iter().map(|p| Cow::Borrowed(*p)).collect());
    }
    let offsets: Vec<usize> =
        table.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize).collect();
    if offsets.len() != count {
        return refuse(format!("{count} frames in {} fragments; the file is damaged", parts.len()));
    }
    let mut frames = vec![Vec::new(); count];
    let mut at = 0;
    for part in parts {
        let frame = offsets.partition_point(|&o| o <= at).saturating_sub(1);
        frames[frame].extend_from_slice(part);
        at += part.len() + 8;
    }
    Ok(frames.into_iter().map(Cow::Owned).collect())
}

fn other_size<T>(rows: usize, columns: usize, shape: &Shape) -> Result<T, FormatError> {
    refuse(format!(
        "the packed picture is {columns} x {rows}, the header says {} x {}; the file is damaged",
        shape.columns, shape.rows
    ))
}

/// Sizes in the header of a packed picture, so that nothing is unpacked that is larger than the file says.
fn jpeg_size(bytes: &[u8]) -> Option<(usize, usize)> {
    let mut at = 2;
    loop {
        let [0xff, marker] = *bytes.get(at..at + 2)? else { return None };
        let word = |k: usize| Some(usize::from(u16::from_be_bytes([*bytes.get(k)?, *bytes.get(k + 1)?])));
        match marker {
            0xff => at += 1,
            0xc0..=0xc3 | 0xc5..=0xc7 | 0xc9..=0xcb | 0xcd..=0xcf => return Some((word(at + 5)?, word(at + 7)?)),
            _ => at += 2 + word(at + 2)?,
        }
    }
}

/// JPEG baseline, extended and lossless.
fn jpeg(bytes: &[u8], shape: &Shape) -> Result<Vec<u8>, FormatError> {
    let broken = |e: String| FormatError(format!("the JPEG picture cannot be unpacked: {e}; the file is damaged"));
    match jpeg_size(bytes) {
        Some((rows, columns)) if (rows, columns) == (shape.rows, shape.columns) => {}
        Some((rows, columns)) => return other_size(rows, columns, shape),
        None => return Err(broken("it has no frame".into())),
    }
    let decoded = catch_unwind(AssertUnwindSafe(|| {
        let mut decoder = jpeg_decoder::Decoder::new(bytes);
        decoder.set_max_decoding_buffer_size(shape.pixels() * 8);
        let pixels = decoder.decode().map_err(|e| e.to_string())?;
        Ok((pixels, decoder.info().map(|i| i.pixel_format)))
    }));
    let (pixels, kind) = decoded.unwrap_or_else(|_| Err("the decoder gave up".to_string())).map_err(broken)?;
    let bytes_each = match kind {
        Some(jpeg_decoder::PixelFormat::L8) => 1,
        Some(jpeg_decoder::PixelFormat::L16) => 2,
        _ => return refuse("a picture in colour; expected CT"),
    };
    let values = pixels.chunks_exact(bytes_each).map(|p| match *p {
        [a] => u32::from(a),
        [a, b] => u32::from(u16::from_ne_bytes([a, b])),
        _ => 0,
    });
    Ok(little(values, shape))
}

/// Size of a JPEG 2000 code stream, in a file or bare.
fn jpeg_2000_size(bytes: &[u8]) -> Option<(usize, usize)> {
    let at = bytes.windows(4).position(|w| w == [0xff, 0x4f, 0xff, 0x51])?;
    let long = |k: usize| Some(u32::from_be_bytes(bytes.get(at + k..at + k + 4)?.try_into().ok()?) as usize);
    Some((long(12)?.checked_sub(long(20)?)?, long(8)?.checked_sub(long(16)?)?))
}

/// JPEG 2000, lossless or not.
fn jpeg_2000(bytes: &[u8], shape: &Shape) -> Result<Vec<u8>, FormatError> {
    let broken = |e: String| FormatError(format!("the JPEG 2000 picture cannot be unpacked: {e}; the file is damaged"));
    match jpeg_2000_size(bytes) {
        Some((rows, columns)) if (rows, columns) == (shape.rows, shape.columns) => {}
        Some((rows, columns)) => return other_size(rows, columns, shape),
        None => return Err(broken("it has no code stream".into())),
    }
    let decoded = catch_unwind(|| {
        let image = jpeg2k::Image::from_bytes(bytes).map_err(|e| e.to_string())?;
        match image.components() {
            [one] => Ok(one.data().iter().map(|x| *x as u32).collect::<Vec<u32>>()),
            _ => Err("it has several colours".to_string()),
        }
    });
    let values = decoded.unwrap_or_else(|_| Err("the decoder gave up".to_string())).map_err(broken)?;
    if values.len() < shape.pixels() {
        return Err(broken(format!("{} of {} pixels", values.len(), shape.pixels())));
    }
    Ok(little(values.into_iter(), shape))
}

/// Pixels in as many little-endian bytes as the header says.
fn little(values: impl Iterator<Item = u32>, shape: &Shape) -> Vec<u8> {
    values.flat_map(|v| v.to_le_bytes().into_iter().take(shape.bytes)).collect()
}
