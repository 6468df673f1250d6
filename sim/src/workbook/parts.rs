//! The parts of a workbook: a zip archive's files, unpacked to a limit.

use flate2::read::DeflateDecoder;
use std::collections::BTreeMap;
use std::io::Read;

/// Most bytes that a part unpacks to: a sheet of some 600,000 cells.
const MOST_BYTES: u64 = 64 << 20;
/// Most parts of an archive.
const MOST_PARTS: usize = 10_000;
/// Ends of the archive's table: its mark, and the bytes of an entry.
const TABLE_END: &[u8] = b"PK\x05\x06";
const ENTRY: &[u8] = b"PK\x01\x02";
const ENTRY_BYTES: usize = 46;
const LOCAL_BYTES: usize = 30;
/// Ways of packing: none, and deflate.
const STORED: u16 = 0;
const DEFLATED: u16 = 8;

/// The parts of an archive by their names.
pub(super) struct Parts<'a> {
    bytes: &'a [u8],
    /// How each is packed, its packed size and where it begins.
    entries: BTreeMap<String, (u16, usize, usize)>,
}

fn damaged<T>(what: &str) -> Result<T, String> {
    Err(format!("the workbook is damaged or cut short: {what}; save it again"))
}

fn short(bytes: &[u8], at: usize) -> Option<usize> {
    Some(usize::from(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?)))
}

fn long(bytes: &[u8], at: usize) -> Option<usize> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize)
}

impl<'a> Parts<'a> {
    /// By the table at the archive's end.
    pub(super) fn of(bytes: &'a [u8]) -> Result<Parts<'a>, String> {
        let end = bytes.windows(4).rposition(|w| w == TABLE_END);
        let table = end.and_then(|end| long(bytes, end + 16)).filter(|at| *at < bytes.len());
        let Some(mut at) = table else { return damaged("its table of parts is not there") };
        let mut entries = BTreeMap::new();
        while bytes.get(at..at + 4) == Some(ENTRY) && entries.len() < MOST_PARTS {
            let Some((name, entry, next)) = entry(bytes, at) else { return damaged("an entry of its table") };
            entries.insert(name, entry);
            at = next;
        }
        Ok(Parts { bytes, entries })
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.entries.contains_key(name)
    }

    /// A part's text.
    pub(super) fn text(&self, name: &str) -> Result<String, String> {
        let Some((packing, size, local)) = self.entries.get(name).copied() else {
            return damaged(&format!("{name} is not there"));
        };
        let body = || {
            let start = local + LOCAL_BYTES + short(self.bytes, local + 26)? + short(self.bytes, local + 28)?;
            self.bytes.get(start..start.checked_add(size)?)
        };
        let Some(body) = body() else { return damaged(name) };
        let mut out = Vec::new();
        let unpacked = match packing {
            STORED => body.take(MOST_BYTES + 1).read_to_end(&mut out),
            DEFLATED => DeflateDecoder::new(body).take(MOST_BYTES + 1).read_to_end(&mut out),
            other => {
                return Err(format!(
                    "{name} is packed in a way that is not read ({other}); save the workbook by Excel"
                ));
            }
        };
        if unpacked.is_err() {
            return damaged(name);
        }
        if out.len() as u64 > MOST_BYTES {
            return Err(format!("{name} is larger than {} MiB; give a table of the trials alone", MOST_BYTES >> 20));
        }
        Ok(String::from_utf8_lossy(&out).into_owned())
    }
}

/// A part's name, what is said of it, and where the next entry begins.
fn entry(bytes: &[u8], at: usize) -> Option<(String, (u16, usize, usize), usize)> {
    let names = short(bytes, at + 28)?;
    let name = bytes.get(at + ENTRY_BYTES..at + ENTRY_BYTES + names)?;
    let next = at + ENTRY_BYTES + names + short(bytes, at + 30)? + short(bytes, at + 32)?;
    let packing = short(bytes, at + 10)? as u16;
    Some((String::from_utf8_lossy(name).into_owned(), (packing, long(bytes, at + 20)?, long(bytes, at + 42)?), next))
}
