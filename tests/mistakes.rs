//! Natural mistakes: each message names the file or option, says what was expected, and what to do next.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests prepare files")]

use crate::common::{build_model, phantom};
use formats::{read_surface, stl};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Mistake {
    what: String,
    edit: Option<Edit>,
    remove: Option<String>,
    write: Option<Write>,
    scale: Option<Scale>,
    run: Vec<String>,
    status: i32,
    names: String,
    expected: String,
    next: String,
}

#[derive(Deserialize)]
struct Edit {
    file: String,
    from: String,
    to: String,
}

#[derive(Deserialize)]
struct Write {
    file: String,
    text: String,
}

#[derive(Deserialize)]
struct Scale {
    file: String,
    by: f64,
}

const LAXITY: &str = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n\
    neutral_30,neutral,30,0,0,0,0,20,30.0,0.5,1.2,4.0,-1.0,-21.0\n\
    anterior_30,anterior,30,0,0,0,133,20,30.2,-1.0,-0.8,3.5,4.6,-21.3\n";

/// A phantom called `knee` with a laxity file, in a folder of its own.
fn specimen() -> TempDir {
    let (from, folder) = (phantom("S193761-phantom"), TempDir::new().unwrap());
    let knee = folder.path().join("knee");
    fs::rename(from.path(), &knee).unwrap();
    fs::create_dir_all(knee.join("laxity")).unwrap();
    fs::write(knee.join("laxity/kla.csv"), LAXITY).unwrap();
    let toml = fs::read_to_string(knee.join("specimen.toml")).unwrap();
    fs::write(knee.join("specimen.toml"), toml + "\n[laxity]\nkla = \"laxity/kla.csv\"\n").unwrap();
    folder
}

impl Mistake {
    fn make(&self, knee: &Path) {
        if let Some(e) = &self.edit {
            let text = fs::read_to_string(knee.join(&e.file)).unwrap();
            assert!(text.contains(&e.from), "{}: {} is not in {}", self.what, e.from, e.file);
            fs::write(knee.join(&e.file), text.replacen(&e.from, &e.to, 1)).unwrap();
        }
        if let Some(file) = &self.remove {
            fs::remove_file(knee.join(file)).unwrap();
        }
        if let Some(w) = &self.write {
            fs::write(knee.join(&w.file), &w.text).unwrap();
        }
        if let Some(s) = &self.scale {
            let bytes = fs::read(knee.join(&s.file)).unwrap();
            let mut mesh = read_surface(&s.file, &bytes, &BTreeMap::new()).unwrap().mesh;
            mesh.vertices.iter_mut().for_each(|p| *p *= s.by);
            let mut out = Vec::new();
            stl::write(&mut out, &mesh).unwrap();
            fs::write(knee.join(&s.file), out).unwrap();
        }
    }

    /// What is wrong with the answer, if anything is.
    fn fault(&self, folder: &Path) -> Option<String> {
        let knee = folder.join("knee").display().to_string();
        let arguments = self.run.iter().map(|a| a.replace("DIR", &knee));
        let run = build_model().args(arguments).output().unwrap();
        let said = String::from_utf8_lossy(&[run.stdout, run.stderr].concat()).into_owned();
        let missing: Vec<&String> =
            [&self.names, &self.expected, &self.next].into_iter().filter(|w| !said.contains(*w)).collect();
        let right = run.status.code() == Some(self.status) && missing.is_empty() && !said.contains("panicked");
        (!right).then(|| {
            format!(
                "{}: status {:?}, expected {}; not said: {missing:?}; said:\n{said}",
                self.what,
                run.status.code(),
                self.status
            )
        })
    }
}

#[test]
fn each_mistake_is_told_with_its_place_what_was_expected_and_what_to_do() {
    #[derive(Deserialize)]
    struct List {
        mistake: Vec<Mistake>,
    }
    let list: List = toml::from_str(include_str!("mistakes/mistakes.toml")).unwrap();
    assert!(list.mistake.len() >= 25);
    let faults: Vec<String> = list
        .mistake
        .iter()
        .filter_map(|m| {
            let folder = specimen();
            m.make(&folder.path().join("knee"));
            m.fault(folder.path())
        })
        .collect();
    assert!(faults.is_empty(), "{} of {} mistakes:\n{}", faults.len(), list.mistake.len(), faults.join("\n"));
}
