//! `fetch` against a server that breaks connections, lies about lengths and serves wrong bytes: a correct file or a clear error,
//! never half a one.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests look at what was fetched")]

use crate::common::build_model;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use tempfile::TempDir;

/// What the server does to the file's bytes.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// Cuts each answer after this many bytes.
    Breaks(usize),
    /// As Breaks, and knows no ranges.
    BreaksWithoutRanges(usize, usize),
    /// Announces more than it sends.
    TooLong,
    /// Announces less than it sends; sends more than the record says.
    TooMuch,
    /// Turns a bit.
    WrongBytes,
    /// Sends the start where the rest was asked for, and says so.
    WrongRange,
    /// Breaks, then sends the start where the rest was asked for, without end.
    NeverTheRest,
    /// Sends a little, then nothing, and keeps the connection.
    Stalls,
    /// Has no such file.
    Gone,
    /// Always fails.
    Broken,
    /// A record that is no JSON.
    NoRecord,
    /// A name that climbs out of the folder.
    Climbs,
}

const NAME: &str = "S192803_femur_CT.stl";

fn content() -> Vec<u8> {
    (0..200_000u32).flat_map(|i| (i.wrapping_mul(2_654_435_761) >> 13).to_le_bytes()).collect()
}

/// MD5 of [`content`], by another program.
const SUM: &str = "0644659137d04073cdab6769034e4ceb";

struct Server {
    address: String,
    requests: Arc<Mutex<Vec<String>>>,
}

fn serve(fault: Fault) -> Server {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let requests = Arc::new(Mutex::new(Vec::new()));
    let (log, count) = (requests.clone(), AtomicUsize::new(0));
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            // A client that goes away is no fault of the server's.
            let _ = answer(stream, fault, &log, &count);
        }
    });
    Server { address, requests }
}

fn answer(mut stream: TcpStream, fault: Fault, log: &Mutex<Vec<String>>, count: &AtomicUsize) -> std::io::Result<()> {
    let mut reader = BufReader::new(stream.try_clone()?);
    let (mut line, mut range) = (String::new(), None);
    reader.read_line(&mut line)?;
    let path = line.split(' ').nth(1).unwrap_or_default().to_string();
    loop {
        let mut header = String::new();
        reader.read_line(&mut header)?;
        let lower = header.to_ascii_lowercase();
        if let Some(from) = lower.strip_prefix("range: bytes=") {
            range = from.trim().trim_end_matches('-').parse::<usize>().ok();
        }
        if header.trim().is_empty() {
            break;
        }
    }
    log.lock().unwrap().push(format!("{path} {range:?}"));
    if path.starts_with("/api/records/") {
        let record = if path.ends_with("10416664") { record(fault) } else { r#"{"metadata":{},"files":[]}"#.into() };
        return write!(
            stream,
            "HTTP/1.1 200 OK\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{record}",
            record.len()
        );
    }
    file(stream, fault, range, count.fetch_add(1, Ordering::Relaxed))
}

fn record(fault: Fault) -> String {
    if fault == Fault::NoRecord {
        return "<html>busy</html>".into();
    }
    let name = if fault == Fault::Climbs { "../../S192803.stl" } else { NAME };
    format!(
        r#"{{"metadata":{{"title":"Knees","license":{{"id":"cc-by-4.0"}}}},"files":[{{"key":"{name}","size":800000,"checksum":"md5:{SUM}","links":{{"self":"https://zenodo.org/api/files/x/{NAME}"}}}},
        {{"key":"S193761_femur_CT.stl","size":5,"checksum":"md5:{SUM}","links":{{"self":"https://zenodo.org/nowhere"}}}}]}}"#
    )
}

fn file(mut stream: TcpStream, fault: Fault, range: Option<usize>, nth: usize) -> std::io::Result<()> {
    let mut bytes = content();
    let (status, length, mut from) = match (fault, range) {
        (Fault::Gone, _) => {
            return write!(stream, "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
        }
        (Fault::Broken, _) => {
            return write!(stream, "HTTP/1.1 503 Busy\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
        }
        (Fault::BreaksWithoutRanges(..), _) | (_, None) => ("200 OK", bytes.len(), 0),
        (_, Some(from)) => ("206 Partial Content", bytes.len() - from, from),
    };
    let mut said = from;
    match fault {
        Fault::WrongBytes => bytes[400_000] ^= 4,
        Fault::TooMuch => bytes.extend([0; 500]),
        Fault::WrongRange if nth > 0 => (from, said) = (0, 0),
        Fault::NeverTheRest => (from, said) = (0, 0),
        _ => {}
    }
    let announced = match fault {
        Fault::TooLong => length + 1000,
        Fault::TooMuch => bytes.len() - from,
        _ => length,
    };
    said = said.min(bytes.len());
    write!(stream, "HTTP/1.1 {status}\r\nContent-Length: {announced}\r\nConnection: close\r\n")?;
    if status.starts_with("206") {
        write!(stream, "Content-Range: bytes {said}-{}/{}\r\n", content().len() - 1, content().len())?;
    }
    write!(stream, "\r\n")?;
    let most = match fault {
        Fault::Breaks(n) => n,
        Fault::BreaksWithoutRanges(n, times) if nth < times => n,
        Fault::WrongRange if nth == 0 => 300_000,
        Fault::NeverTheRest => 300_000,
        Fault::Stalls => 1000,
        _ => usize::MAX,
    };
    stream.write_all(&bytes[from..bytes.len().min(from.saturating_add(most))])?;
    if fault == Fault::Stalls {
        std::thread::sleep(std::time::Duration::from_secs(30));
    }
    Ok(())
}

fn fetch(server: &Server, dir: &Path) -> (Option<i32>, String) {
    let mut command = build_model();
    // the server is on this machine: no proxy of the environment stands between
    for name in ["ALL_PROXY", "HTTP_PROXY", "HTTPS_PROXY", "all_proxy", "http_proxy", "https_proxy"] {
        command.env_remove(name);
    }
    let out = command
        .args(["fetch", "S192803"])
        .arg(dir)
        .args(["--mirror", &server.address, "--patience", "2"])
        .timeout(std::time::Duration::from_secs(60))
        .output()
        .unwrap();
    (out.status.code(), String::from_utf8_lossy(&[out.stdout, out.stderr].concat()).into_owned())
}

fn here(dir: &Path) -> std::path::PathBuf {
    dir.join("records/10416664").join(NAME)
}

#[test]
fn a_whole_file_comes_with_its_licence_and_is_not_fetched_twice() {
    let (server, dir) = (serve(Fault::None), TempDir::new().unwrap());
    let (code, words) = fetch(&server, dir.path());
    assert_eq!(code, Some(0), "{words}");
    assert_eq!(std::fs::read(here(dir.path())).unwrap(), content());
    assert!(words.contains("cc-by-4.0") && crate::common::text(&dir.path().join("LICENCE.txt")).contains("cc-by-4.0"));
    assert!(!dir.path().join("records/10416664/S193761_femur_CT.stl").exists(), "the other specimen's file");
    assert!(words.contains("scans.femur: no file fits"), "{words}");
    let before = server.requests.lock().unwrap().iter().filter(|r| r.contains(NAME)).count();
    let (code, words) = fetch(&server, dir.path());
    assert!(code == Some(0) && words.contains("have "), "{words}");
    assert_eq!(server.requests.lock().unwrap().iter().filter(|r| r.contains(NAME)).count(), before);
}

#[test]
fn broken_connections_are_taken_up_where_they_broke() {
    for fault in [Fault::Breaks(150_000), Fault::BreaksWithoutRanges(150_000, 2), Fault::WrongRange, Fault::TooLong] {
        let (server, dir) = (serve(fault), TempDir::new().unwrap());
        let (code, words) = fetch(&server, dir.path());
        assert_eq!(code, Some(0), "{words}");
        assert_eq!(std::fs::read(here(dir.path())).unwrap(), content());
        if let Fault::Breaks(n) = fault {
            let log = server.requests.lock().unwrap().join("\n");
            assert!(log.contains(&format!("Some({n})")), "{log}");
        }
    }
}

#[test]
fn what_cannot_be_had_is_an_error_and_no_file() {
    let cases = [
        (Fault::WrongBytes, "checksum"),
        (Fault::TooMuch, "more than"),
        (Fault::NeverTheRest, "run the command again"),
        (Fault::Stalls, "run the command again"),
        (Fault::Gone, "404"),
        (Fault::Broken, "503"),
        (Fault::NoRecord, "JSON"),
        (Fault::Climbs, "leads out"),
    ];
    for (fault, word) in cases {
        let (server, dir) = (serve(fault), TempDir::new().unwrap());
        let (code, words) = fetch(&server, dir.path());
        assert_eq!(code, Some(1), "{words}");
        assert!(words.contains(word), "{word:?} is not in: {words}");
        assert!(!here(dir.path()).exists() && !dir.path().join("specimen.toml").exists(), "{word}");
        assert!(!dir.path().parent().unwrap().join("S192803.stl").exists());
    }
}

#[test]
fn an_interrupted_download_goes_on_and_a_stranger_s_part_does_not_spoil_it() {
    for start in [content()[..300_000].to_vec(), vec![7; 300_000], vec![7; 900_000]] {
        let (server, dir) = (serve(Fault::None), TempDir::new().unwrap());
        std::fs::create_dir_all(here(dir.path()).parent().unwrap()).unwrap();
        std::fs::write(here(dir.path()).with_file_name(format!("{NAME}.part")), &start).unwrap();
        let (code, words) = fetch(&server, dir.path());
        assert_eq!(code, Some(0), "{words}");
        assert_eq!(std::fs::read(here(dir.path())).unwrap(), content());
    }
}

#[test]
fn a_file_damaged_since_is_fetched_anew_or_gone() {
    for (fault, code) in [(Fault::None, 0), (Fault::Broken, 1)] {
        let (server, dir) = (serve(fault), TempDir::new().unwrap());
        std::fs::create_dir_all(here(dir.path()).parent().unwrap()).unwrap();
        std::fs::write(here(dir.path()), &content()[..1000]).unwrap();
        assert_eq!(fetch(&server, dir.path()).0, Some(code));
        assert_eq!(std::fs::read(here(dir.path())).ok(), (code == 0).then(content));
    }
}

#[test]
fn an_unknown_set_is_wrong_use() {
    build_model().args(["fetch", "X", "/tmp/x"]).assert().code(2).stderr(predicates::str::contains("S193761"));
}
