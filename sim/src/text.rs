//! The text of a file in the encodings that programs write, and files that are no text.

use crate::workbook;
use notices::{Kind, Notice};
use std::borrow::Cow;

/// A table as text.
#[derive(Debug)]
pub struct Table<'a> {
    /// The rows.
    pub text: Cow<'a, str>,
    /// What stands between cells, where it is known.
    pub separator: Option<char>,
    /// What is told of how it was read.
    pub notes: Vec<Notice>,
}

/// The text of a table: of text in any encoding, or of a workbook's sheet with names of `known` (in lower case) in its header.
///
/// # Errors
/// Another kind of file, by its name; a damaged workbook.
pub fn table<'a>(bytes: &'a [u8], known: &[String]) -> Result<Table<'a>, String> {
    if workbook::looks_zipped(bytes) {
        let sheet = workbook::sheet(bytes, known)?;
        return Ok(Table { text: Cow::Owned(sheet.text), separator: Some(';'), notes: sheet.notes });
    }
    if let Some(kind) = other_kind(bytes) {
        return Err(kind.to_owned());
    }
    let (text, told) = decoded(bytes);
    Ok(Table { text, separator: None, notes: told.map(|what| Kind::Encoding.notice(what)).into_iter().collect() })
}

/// Share of zero bytes from which on bytes without a mark are UTF-16 [-]: text in Latin letters has one in two.
const WIDE: f64 = 0.3;
/// Share of zero bytes from which on they are UTF-32 [-]: text in Latin letters has three in four.
const WIDEST: f64 = 0.7;
/// Bytes of a file that are looked at for it.
const HEAD: usize = 1000;

/// What a file is that is no table of text, in words; none where it may be one.
fn other_kind(bytes: &[u8]) -> Option<&'static str> {
    let kinds: [(&[u8], &str); 8] = [
        (&[0xd0, 0xcf, 0x11, 0xe0], "the file is an Excel workbook of before 2007 (.xls), or one with a password"),
        (b"%PDF", "the file is a PDF"),
        (b"MATLAB 5.0", "the file is MATLAB's (.mat)"),
        (b"\x89HDF", "the file is HDF5 (MATLAB's, or another program's)"),
        (b"PAR1", "the file is Parquet"),
        (&[0x1f, 0x8b], "the file is packed (gzip)"),
        (b"version https://git-lfs", "the file is a Git LFS pointer, not the data"),
        (b"<!DOCTYPE", "the file is a web page"),
    ];
    let known = kinds.iter().find(|(start, _)| bytes.starts_with(start)).map(|(_, what)| *what);
    known.or_else(|| match bytes.trim_ascii() {
        [] => Some("the file is empty"),
        [b'{', ..] => Some(JSON),
        [b'[', rest @ ..] if matches!(rest.trim_ascii_start(), [b'{' | b'[', ..]) => Some(JSON),
        _ => None,
    })
}

/// What is said of JSON: an object, or a list of objects or of lists.
const JSON: &str = "the file is JSON";

/// The text of UTF-8, of UTF-16 or UTF-32 with or without a mark, else of Latin-1, which is told.
pub fn decoded(bytes: &[u8]) -> (Cow<'_, str>, Option<&'static str>) {
    if let Some(text) = widest(bytes) {
        return (Cow::Owned(text), None);
    }
    let wide = |rest: &[u8], of: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = rest.as_chunks::<2>().0.iter().map(|pair| of(*pair)).collect();
        (Cow::Owned(String::from_utf16_lossy(&units)), None)
    };
    if let Some(rest) = bytes.strip_prefix(&[0xff, 0xfe]) {
        return wide(rest, u16::from_le_bytes);
    }
    if let Some(rest) = bytes.strip_prefix(&[0xfe, 0xff]) {
        return wide(rest, u16::from_be_bytes);
    }
    let head = &bytes[..bytes.len().min(HEAD)];
    if head.iter().filter(|b| **b == 0).count() as f64 > WIDE * head.len() as f64 {
        return wide(bytes, if head.first() == Some(&0) { u16::from_be_bytes } else { u16::from_le_bytes });
    }
    let plain = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match std::str::from_utf8(plain) {
        Ok(text) => (Cow::Borrowed(text), None),
        Err(_) => (
            Cow::Owned(plain.iter().map(|b| char::from(*b)).collect()),
            Some("the file is not UTF-8; it is read as Latin-1: save it as UTF-8"),
        ),
    }
}

/// The text of UTF-32, by its mark or its zeros; none of another encoding. The mark of UTF-16 begins that of UTF-32, so this comes first.
fn widest(bytes: &[u8]) -> Option<String> {
    let head = &bytes[..bytes.len().min(HEAD)];
    let zeros = head.iter().filter(|b| **b == 0).count() as f64;
    let (rest, little) = match bytes {
        [0xff, 0xfe, 0, 0, rest @ ..] => (rest, true),
        [0, 0, 0xfe, 0xff, rest @ ..] => (rest, false),
        [first, ..] if bytes.len().is_multiple_of(4) && zeros > WIDEST * head.len() as f64 => (bytes, *first != 0),
        _ => return None,
    };
    let of = if little { u32::from_le_bytes } else { u32::from_be_bytes };
    let words = rest.as_chunks::<4>().0.iter();
    Some(words.map(|w| char::from_u32(of(*w)).unwrap_or(char::REPLACEMENT_CHARACTER)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encodings_are_read_and_told() {
        let wide = |text: &str, mark: bool| -> Vec<u8> {
            let mark = if mark { vec![0xff, 0xfe] } else { vec![] };
            mark.into_iter().chain(text.encode_utf16().flat_map(u16::to_le_bytes)).collect()
        };
        for bytes in [b"\xef\xbb\xbfa,b".to_vec(), wide("a,b", true), wide("a,b", false), b"a,b".to_vec()] {
            assert_eq!(decoded(&bytes).0, "a,b");
        }
        let widest = |of: fn(u32) -> [u8; 4]| -> Vec<u8> { "a,b".chars().flat_map(|c| of(u32::from(c))).collect() };
        let marked = [&[0xff, 0xfe, 0, 0][..], &widest(u32::to_le_bytes)].concat();
        for bytes in [widest(u32::to_le_bytes), widest(u32::to_be_bytes), marked] {
            assert_eq!(decoded(&bytes).0, "a,b");
        }
        let (text, told) = decoded(b"Winkel [\xb0]");
        assert_eq!(text, "Winkel [\u{b0}]");
        assert!(told.is_some_and(|t| t.contains("Latin-1")));
        assert!(table(b"PK\x03\x04...", &[]).is_err_and(|k| k.contains("workbook")));
        assert!(table(b"%PDF-1.7", &[]).is_err_and(|k| k.contains("PDF")));
        for (bytes, kind) in
            [(&b" \n"[..], "empty"), (b"{\"a\": 1}", "JSON"), (b"[\n  {\"a\": 1}]", "JSON"), (b"[[1, 2]]", "JSON")]
        {
            assert!(table(bytes, &[]).is_err_and(|k| k.contains(kind)), "{kind}");
        }
        assert!(other_kind(b"trial,test").is_none() && other_kind(b"[Header]\ntrial,test").is_none());
    }
}
