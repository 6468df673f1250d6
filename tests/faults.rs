//! Bad input: one clear sentence on standard error, exit status 1, nothing left that a later run trusts. A machine that does not give what is needed: 3.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests prepare broken files")]

use crate::common::{build_model, built, copy, phantom, read, text, write};
use std::fs;
use std::path::Path;
use std::sync::OnceLock;
use tempfile::TempDir;

fn good() -> &'static Path {
    static GOOD: OnceLock<TempDir> = OnceLock::new();
    GOOD.get_or_init(|| phantom("S193761-phantom")).path()
}

/// Builds a copy of the phantom that `spoil` broke; the error must hold every one of `words`.
fn refused(spoil: impl FnOnce(&Path), words: &[&str]) {
    let folder = TempDir::new().unwrap();
    copy(good(), folder.path());
    spoil(folder.path());
    let result = build_model().arg(folder.path()).timeout(std::time::Duration::from_secs(120)).output().unwrap();
    let error = String::from_utf8_lossy(&result.stderr);
    assert_eq!(result.status.code(), Some(1), "{error}");
    assert_eq!(error.trim_end().lines().count(), 1, "one sentence: {error}");
    for word in words {
        assert!(error.contains(word), "{word:?} is not in: {error}");
    }
    assert!(!folder.path().join("build/09-assemble").exists(), "a model was left");
}

fn replace(file: &Path, from: &str, to: &str) {
    let changed = text(file).replace(from, to);
    assert_ne!(changed, text(file), "{from} is not in {}", file.display());
    write(file, changed);
}

/// The binary STL with every coordinate changed.
fn map_stl(file: &Path, change: impl Fn(usize, f32) -> f32) {
    let mut bytes = read(file);
    for facet in 0..(bytes.len() - 84) / 50 {
        for i in 0..9 {
            let at = 84 + 50 * facet + 12 + 4 * i;
            let value = f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            bytes[at..at + 4].copy_from_slice(&change(9 * facet + i, value).to_le_bytes());
        }
    }
    write(file, bytes);
}

#[test]
fn no_specimen() {
    let folder = TempDir::new().unwrap();
    build_model()
        .arg(folder.path().join("nowhere"))
        .assert()
        .code(1)
        .stderr(predicates::str::contains("no such folder"));
    build_model().arg(folder.path()).assert().code(1).stderr(predicates::str::contains("specimen.toml"));
}

#[test]
fn missing_empty_truncated_and_garbage_files() {
    refused(|d| fs::remove_file(d.join("ct/femur.stl")).unwrap(), &["ct/femur.stl", "ct.femur"]);
    refused(|d| fs::remove_file(d.join("scans/tibfib.ply")).unwrap(), &["scans/tibfib.ply"]);
    refused(|d| write(&d.join("ct/femur.stl"), b""), &["ct/femur.stl", "empty"]);
    refused(|d| write(&d.join("scans/femur.ply"), b""), &["scans/femur.ply", "empty"]);
    for file in ["ct/tibfib.stl", "scans/femur.ply"] {
        refused(
            |d| {
                let b = read(&d.join(file));
                write(&d.join(file), &b[..b.len() / 2])
            },
            &[file],
        );
        refused(|d| write(&d.join(file), [0x5a; 4096]), &[file]);
    }
}

#[test]
fn headers_that_lie() {
    refused(
        |d| {
            let mut bytes = read(&d.join("ct/femur.stl"));
            bytes[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
            write(&d.join("ct/femur.stl"), bytes);
        },
        &["ct/femur.stl", "4294967295"],
    );
    refused(
        |d| {
            let file = d.join("scans/femur.ply");
            let bytes = read(&file);
            let end = bytes.windows(10).position(|w| w == b"end_header").unwrap();
            let head = String::from_utf8_lossy(&bytes[..end]).into_owned();
            let line = head.lines().find(|l| l.starts_with("element vertex")).unwrap().to_string();
            let lied = head.replace(&line, "element vertex 4000000000");
            write(&file, [lied.as_bytes(), &bytes[end..]].concat());
        },
        &["scans/femur.ply"],
    );
}

#[test]
fn coordinates_that_are_no_numbers() {
    for bad in [f32::NAN, f32::INFINITY] {
        refused(|d| map_stl(&d.join("ct/tibfib.stl"), |i, x| if i == 700 { bad } else { x }), &["ct/tibfib.stl"]);
    }
}

#[test]
fn wrong_units() {
    refused(|d| map_stl(&d.join("ct/femur.stl"), |_, x| x / 1000.0), &["ct/femur.stl", "metres"]);
    refused(|d| map_stl(&d.join("ct/femur.stl"), |_, x| x / 25.4), &["ct/femur.stl", "inches"]);
}

#[test]
fn bones_that_are_not_what_they_are_said_to_be() {
    let toml = |d: &Path| d.join("specimen.toml");
    refused(
        |d| {
            fs::rename(d.join("ct/femur.stl"), d.join("ct/x")).unwrap();
            fs::rename(d.join("ct/tibfib.stl"), d.join("ct/femur.stl")).unwrap();
            fs::rename(d.join("ct/x"), d.join("ct/tibfib.stl")).unwrap();
        },
        &["ct.femur", "ct.tibfib", "exchange"],
    );
    let side = if text(&good().join("specimen.toml")).contains("\"left\"") { "left" } else { "right" };
    let other = if side == "left" { "right" } else { "left" };
    refused(|d| replace(&toml(d), &format!("\"{side}\""), &format!("\"{other}\"")), &["side", side, other]);
    let stranger = phantom("right-phantom");
    refused(
        |d| {
            write(&d.join("scans/femur.ply"), read(&stranger.path().join("scans/femur.ply")));
            fs::remove_file(d.join("landmarks.csv")).unwrap();
            replace(&toml(d), "landmarks = \"landmarks.csv\"\n", "");
        },
        &["register", "femur"],
    );
}

#[test]
fn specimen_files_with_mistakes() {
    let toml = |d: &Path| d.join("specimen.toml");
    refused(|d| replace(&toml(d), "side =", "sied ="), &["specimen.toml", "sied"]);
    refused(
        |d| write(&toml(d), format!("{}\n[options.bones]\nedge = 1\n", text(&good().join("specimen.toml")))),
        &["bones.edge"],
    );
    refused(|d| write(&toml(d), "[specimen\n"), &["specimen.toml", "line 1"]);
    refused(|d| replace(&toml(d), "ct/femur.stl", "../femur.stl"), &["../femur.stl", "specimen directory"]);
    refused(|d| write(&d.join("landmarks.csv"), "name,frame,x_mm,y_mm,z_mm\na,ct,1,2\n"), &["landmarks.csv", "2"]);
}

#[test]
fn marks_that_lie_off_the_bone() {
    refused(
        |d| {
            let lines: Vec<String> = text(&d.join("marks.csv")).lines().map(String::from).collect();
            let first: Vec<&str> = lines[1].split(',').collect();
            let moved = format!("{},{},{},{},900.0", first[0], first[1], first[2], first[3]);
            write(&d.join("marks.csv"), [&lines[..1], &[moved], &lines[2..]].concat().join("\n"));
        },
        &["marks.csv"],
    );
}

#[test]
fn folders_that_cannot_be_written() {
    let file = good().join("specimen.toml");
    let out = file.join("build");
    build_model().arg(good()).arg("--out").arg(&out).assert().code(1).stderr(predicates::str::contains("cannot write"));
}

#[test]
#[cfg(unix)]
fn a_disk_that_fills_up() {
    // A limit on the size of a file stands for the end of a disk; tests may not mount one.
    let out = TempDir::new().unwrap();
    let program = assert_cmd::cargo::cargo_bin("build-model");
    let script = "trap '' XFSZ; ulimit -f 2000; exec \"$0\" \"$1\" --out \"$2\"";
    let run = std::process::Command::new("sh")
        .args(["-c", script])
        .arg(program)
        .arg(good())
        .arg(out.path())
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(3), "{error}");
    assert!(error.contains("cannot write"), "{error}");
    let left: Vec<String> = crate::common::files(out.path()).into_keys().filter(|f| f.contains(".tmp-")).collect();
    assert!(left.is_empty(), "{left:?}");
    build_model().arg(good()).arg("--out").arg(out.path()).args(["--to", "bones", "--quiet"]).assert().success();
}

#[test]
#[cfg(unix)]
fn a_lock_and_a_full_device_are_the_machine_s_fault() {
    let out = TempDir::new().unwrap();
    let lock = fs::File::create(out.path().join(".lock")).unwrap();
    lock.lock().unwrap();
    let build = || build_model().arg(good()).arg("--out").arg(out.path()).args(["--to", "ingest", "--quiet"]).assert();
    build().code(3).stderr(predicates::str::contains("another build-model is at work"));
    drop(lock);
    build().success();
    if Path::new("/dev/full").exists() {
        let run = build_model()
            .args(["simulate", "--out", "/dev/full"])
            .arg(model())
            .arg("--trials")
            .arg(asked())
            .assert()
            .code(3);
        run.stderr(predicates::str::contains("/dev/full"));
        assert!(!fs::metadata("/dev/full").unwrap().is_file());
    }
}

#[test]
#[cfg(target_os = "linux")]
fn what_goes_to_standard_output_is_written_or_the_machine_is_at_fault() {
    let shell = |script: &str| {
        let program = assert_cmd::cargo::cargo_bin("build-model");
        let run = std::process::Command::new("bash").args(["-c", script]).arg(program).output().unwrap();
        (run.status.code(), String::from_utf8_lossy(&run.stderr).into_owned())
    };
    for verb in ["options --json", "schema model", "completions bash", "--help"] {
        let (code, words) = shell(&format!("\"$0\" {verb} > /dev/full"));
        assert!(verb == "--help" || code == Some(3) && words.contains("standard output"), "{verb}: {code:?}, {words}");
        // a reader that has seen enough is no fault
        let (code, words) = shell(&format!("set -o pipefail; \"$0\" {verb} | head -c 1 > /dev/null"));
        assert!(code == Some(0) && words.is_empty(), "{verb}: {code:?}, {words}");
    }
}

#[test]
#[cfg(unix)]
fn folders_and_links_that_lead_nowhere_are_told() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (link, to) in [("a", "b"), ("b", "a"), ("gone", "nowhere/far")] {
        std::os::unix::fs::symlink(to, at(link)).unwrap();
    }
    let simulate = |out: &Path| {
        build_model().args(["simulate", "--out"]).arg(out).arg(model()).arg("--trials").arg(asked()).assert()
    };
    simulate(&at("a")).code(1).stderr(predicates::str::contains("lead round in a ring"));
    assert!(fs::symlink_metadata(at("a")).unwrap().is_symlink());
    let build =
        |out: &Path| build_model().arg(good()).arg("--out").arg(out).args(["--to", "ingest", "--quiet"]).assert();
    build(&at("gone").join("build")).code(1).stderr(predicates::str::contains("which is not there"));
    build(Path::new("-")).code(2).stderr(predicates::str::contains("standard output"));
    assert!(!Path::new("-").exists());
}

#[test]
#[cfg(target_os = "linux")]
fn a_folder_that_may_not_be_written_is_the_machine_s_fault() {
    // where even root may make nothing
    let out = Path::new("/sys/kernel/genu");
    let build = build_model().arg(good()).arg("--out").arg(out).args(["--to", "ingest", "--quiet"]).assert();
    build.code(3).stderr(predicates::str::contains("cannot write to /sys/kernel/genu"));
}

/// A model that is not calibrated, and a trial to ask it.
fn model() -> std::path::PathBuf {
    built().join("build/09-assemble/model.json")
}

fn asked() -> std::path::PathBuf {
    static ASKED: OnceLock<TempDir> = OnceLock::new();
    let folder = ASKED.get_or_init(|| {
        let folder = TempDir::new().unwrap();
        write(
            &folder.path().join("asked.csv"),
            "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n\
             a,anterior,30,0,0,0,50,20,30,,,,,\n",
        );
        folder
    });
    folder.path().join("asked.csv")
}

#[test]
#[cfg(unix)]
fn what_is_no_file_is_never_replaced_by_one() {
    let folder = TempDir::new().unwrap();
    let [target, link] = ["target.csv", "link.csv"].map(|n| folder.path().join(n));
    write(&target, ""); // what holds anything is kept: tests/cli.rs
    std::os::unix::fs::symlink("target.csv", &link).unwrap();
    let simulate = |out: &str| {
        build_model().args(["simulate", "--out", out]).arg(model()).arg("--trials").arg(asked()).assert().success()
    };
    simulate(link.to_str().unwrap());
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    let written = text(&target);
    assert!(written.starts_with("trial,"), "{written}");
    let said = simulate("-");
    assert_eq!(String::from_utf8_lossy(&said.get_output().stdout), written);
    assert!(!folder.path().join("-").exists() && !Path::new("-").exists());
    simulate("/dev/stdout");
    assert!(!fs::symlink_metadata("/dev/null").unwrap().is_file());
    simulate("/dev/null");
    assert!(!fs::symlink_metadata("/dev/null").unwrap().is_file());
    build_model()
        .args(["simulate", "--out"])
        .arg(folder.path())
        .arg(model())
        .arg("--trials")
        .arg(asked())
        .assert()
        .code(1)
        .stderr(predicates::str::contains("it is a folder"));
}

#[test]
fn an_edited_phantom_is_not_written_over() {
    let folder = TempDir::new().unwrap();
    let again = || build_model().args(["phantom", "S193761-phantom"]).arg(folder.path()).assert();
    again().success();
    again().success();
    let marks = folder.path().join("specimen.toml");
    write(&marks, text(&marks) + "\n# mine\n");
    again().code(1).stderr(predicates::str::contains("specimen.toml"));
    assert!(text(&marks).ends_with("# mine\n"));
}
