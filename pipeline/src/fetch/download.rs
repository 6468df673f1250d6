//! Downloads that end in a whole file or an error.

use super::record::RecordFile;
use crate::error::BuildError;
use crate::store;
use crate::store::part::{PartFile, pieces};
use md5::{Digest, Md5};
use std::io::Read;
use std::path::Path;
use std::time::Duration;
use ureq::Agent;

/// Attempts that bring nothing worth while before giving up.
const ATTEMPTS: u32 = 4;
/// What an answer must bring to be worth while, unless it brings the rest [bytes].
const WORTH_WHILE: u64 = 64 << 10;
/// Longest description of a record [bytes].
const LONGEST_TEXT: u64 = 8 << 20;

/// A client that waits for `patience` [s] for the end of an answer; a download that is cut off goes on where it was.
pub(super) fn agent(patience: u64) -> Agent {
    Agent::config_builder()
        .http_status_as_error(false)
        .timeout_connect(Some(Duration::from_secs(30)))
        .timeout_recv_response(Some(Duration::from_secs(patience.min(60))))
        .timeout_recv_body(Some(Duration::from_secs(patience)))
        .user_agent(concat!("build-model/", env!("CARGO_PKG_VERSION")))
        .build()
        .into()
}

/// The sum as records write it. MD5 tells damage, not forgery.
fn hex(sum: Md5) -> String {
    sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

fn wait(attempt: u32) {
    std::thread::sleep(Duration::from_millis(200 << attempt.min(4)));
}

/// A short text, such as a record's description.
pub(super) fn text(agent: &Agent, url: &str) -> Result<Vec<u8>, BuildError> {
    let mut last = String::new();
    for attempt in 0..ATTEMPTS {
        match agent.get(url).call() {
            Ok(answer) if answer.status() == 200 => {
                let mut bytes = Vec::new();
                match answer.into_body().into_reader().take(LONGEST_TEXT + 1).read_to_end(&mut bytes) {
                    Ok(_) if bytes.len() as u64 > LONGEST_TEXT => last = "an answer of many megabytes".into(),
                    Ok(_) => return Ok(bytes),
                    Err(e) => last = e.to_string(),
                }
            }
            Ok(answer) if answer.status().is_client_error() => {
                return Err(BuildError::File(format!("{url}: the server answers {}", answer.status())));
            }
            Ok(answer) => last = format!("the server answers {}", answer.status()),
            Err(e) => last = e.to_string(),
        }
        wait(attempt);
    }
    Err(BuildError::File(format!("{url}: {last}; check the connection and try again")))
}

/// Brings a file to `target`, going on where an earlier attempt stopped; `false` where it was there already.
pub(super) fn file(agent: &Agent, file: &RecordFile, url: &str, target: &Path) -> Result<bool, BuildError> {
    if store::exists(target) {
        let mut sum = Md5::new();
        pieces(target, |part| sum.update(part))?;
        if hex(sum) == file.md5 {
            return Ok(false);
        }
        // Damaged since, or of an older record: it must not pass for the record's file, whatever comes of the download.
        store::discard(target);
    }
    let wrong = |why: String| BuildError::File(format!("{} ({url}): {why}", file.name));
    let mut part = PartFile::take_up(target)?;
    let mut fresh = part.length() == 0;
    loop {
        if part.length() > file.size {
            part.restart()?;
            fresh = true;
        }
        complete(agent, file.size, url, &mut part).map_err(wrong)?;
        let mut sum = Md5::new();
        part.each(|piece| sum.update(piece))?;
        let found = hex(sum);
        if found == file.md5 {
            part.finish()?;
            return Ok(true);
        }
        if fresh {
            part.discard();
            return Err(wrong(format!(
                "the bytes have the checksum {found}, the record says {}; try again later",
                file.md5
            )));
        }
        // What was there from before may have been of another file.
        part.restart()?;
        fresh = true;
    }
}

/// Downloads until the part has its size.
fn complete(agent: &Agent, size: u64, url: &str, part: &mut PartFile) -> Result<(), String> {
    let mut attempt = 0;
    let mut last = String::from("no answer");
    // Against the most that ever was there: a server that makes us begin anew each time would else be asked for ever.
    let mut most = part.length();
    while part.length() < size {
        if let Err(why) = more(agent, size, url, part)? {
            last = why;
        }
        attempt = if part.length() >= most + WORTH_WHILE { 0 } else { attempt + 1 };
        most = most.max(part.length());
        if attempt >= ATTEMPTS {
            return Err(format!("{last}; {} of {size} bytes are here: run the command again to go on", part.length()));
        }
        if part.length() < size {
            wait(attempt);
        }
    }
    Ok(())
}

/// One request for what is missing. The outer error ends the download, the inner one is worth another attempt.
fn more(agent: &Agent, size: u64, url: &str, part: &mut PartFile) -> Result<Result<(), String>, String> {
    let from = part.length();
    let request = agent.get(url);
    let request = if from > 0 { request.header("Range", format!("bytes={from}-")) } else { request };
    let answer = match request.call() {
        Ok(answer) => answer,
        Err(e) => return Ok(Err(e.to_string())),
    };
    let status = answer.status();
    match status.as_u16() {
        206 => {
            let range = answer.headers().get("Content-Range").and_then(|r| r.to_str().ok()).unwrap_or_default();
            let start = range.strip_prefix("bytes ").and_then(|r| r.split('-').next()).and_then(|n| n.parse().ok());
            if start != Some(from) {
                part.restart().map_err(|e| e.to_string())?;
                return Ok(Err(format!("asked for the rest, the server sends another part ({range:?})")));
            }
        }
        // The whole file, whatever was asked for.
        200 => part.restart().map_err(|e| e.to_string())?,
        416 => {
            part.restart().map_err(|e| e.to_string())?;
            return Ok(Err("the server has no such part".into()));
        }
        400..=499 => return Err(format!("the server answers {status}")),
        _ => return Ok(Err(format!("the server answers {status}"))),
    }
    let mut reader = answer.into_body().into_reader();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match reader.read(&mut buffer) {
            Ok(0) => return Ok(Err("the connection ended early".into())),
            Ok(n) => {
                if part.length() + n as u64 > size {
                    part.restart().map_err(|e| e.to_string())?;
                    return Err(format!("the server sends more than the {size} bytes that the record announces"));
                }
                part.add(&buffer[..n]).map_err(|e| e.to_string())?;
                if part.length() == size {
                    return Ok(Ok(()));
                }
            }
            Err(e) => return Ok(Err(e.to_string())),
        }
    }
}
