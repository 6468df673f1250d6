//! Pixels packed by run lengths (DICOM PS3.5, annex G).

use crate::FormatError;

/// Unpacks a frame of `pixels` numbers of `bytes` bytes each into little-endian numbers.
pub(super) fn unpacked(packed: &[u8], pixels: usize, bytes: usize) -> Result<Vec<u8>, FormatError> {
    let damaged = || FormatError("run-length packed pixels are damaged".into());
    let word = |k: usize| -> Result<usize, FormatError> {
        let b = packed.get(4 * k..4 * k + 4).ok_or_else(damaged)?;
        Ok(u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize)
    };
    if word(0)? != bytes {
        return Err(damaged());
    }
    // A run of 128 takes two bytes.
    if pixels > packed.len().saturating_mul(64) {
        return Err(damaged());
    }
    let mut planes = Vec::with_capacity(bytes);
    for s in 0..bytes {
        let end = if s + 1 < bytes { word(s + 2)? } else { packed.len() };
        let segment = packed.get(word(s + 1)?..end).ok_or_else(damaged)?;
        planes.push(plane(segment, pixels).ok_or_else(damaged)?);
    }
    // The most significant plane comes first.
    Ok((0..pixels).flat_map(|i| planes.iter().rev().map(move |p| p[i])).collect())
}

fn plane(segment: &[u8], pixels: usize) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    let mut at = 0;
    while out.len() < pixels {
        let n = *segment.get(at)? as i8;
        at += 1;
        match n {
            0.. => {
                let count = n as usize + 1;
                out.extend_from_slice(segment.get(at..at + count)?);
                at += count;
            }
            -128 => {}
            _ => {
                let value = *segment.get(at)?;
                out.extend(std::iter::repeat_n(value, 1 + usize::from(n.unsigned_abs())));
                at += 1;
            }
        }
    }
    out.truncate(pixels);
    Some(out)
}
