//! Tests that ask for the shared data are marked so: none of them passes in silence where the data are absent.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// What looks for the shared data: tests/common/shared.rs.
const LOOKS: &str = "shared";
/// Tests that ask for them, at least [-]. Ours: there were 133 in November 2026; far fewer would say that this search finds nothing.
const LEAST: usize = 100;

/// A function of a file of tests.
struct Function {
    file: PathBuf,
    name: String,
    attributes: Vec<String>,
    calls: BTreeSet<String>,
}

impl Function {
    fn has(&self, attribute: &str) -> bool {
        self.attributes.iter().any(|a| a.starts_with(attribute))
    }
}

/// Whether a letter is part of a name.
fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Names before a bracket.
fn called(line: &str) -> BTreeSet<String> {
    let parts = line.split_inclusive('(').filter_map(|part| part.strip_suffix('('));
    let names = parts.filter_map(|part| part.rsplit(|c: char| !is_word(c)).next());
    names.filter(|name| !name.is_empty()).map(str::to_owned).collect()
}

/// The name of a function that begins on this line.
fn named(line: &str) -> Option<String> {
    let visible = ["pub(crate) ", "pub(super) ", "pub "];
    let line = visible.iter().find_map(|word| line.strip_prefix(word)).unwrap_or(line);
    line.strip_prefix("fn ")?.split(|c: char| !is_word(c)).next().map(str::to_owned)
}

/// The functions of a source, in order.
fn functions(file: &Path, source: &str) -> Vec<Function> {
    let (mut found, mut attributes): (Vec<Function>, Vec<String>) = (Vec::new(), Vec::new());
    for line in source.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("//")) {
        if line.starts_with("#[") {
            attributes.push(line.to_owned());
            continue;
        }
        let own = std::mem::take(&mut attributes);
        let mut calls = called(line);
        if let Some(name) = named(line) {
            calls.remove(&name);
            found.push(Function { file: file.to_owned(), name, attributes: own, calls });
        } else if let Some(last) = found.last_mut() {
            last.calls.append(&mut calls);
        }
    }
    found
}

/// Whether a helper is known to every file of its crate's tests.
fn is_common(file: &Path) -> bool {
    file.components().any(|part| part.as_os_str() == "common")
}

/// Functions that ask for the shared data, by themselves or by what they call: file and name. Helpers that all files share have no file.
fn asking(all: &[Function]) -> BTreeSet<(Option<PathBuf>, String)> {
    let mut known = BTreeSet::from([(None, LOOKS.to_owned())]);
    loop {
        let before = known.len();
        for f in all {
            let knows = |name: &String| {
                known.contains(&(None, name.clone())) || known.contains(&(Some(f.file.clone()), name.clone()))
            };
            if f.calls.iter().any(knows) {
                let place = (!is_common(&f.file)).then(|| f.file.clone());
                known.insert((place, f.name.clone()));
            }
        }
        if known.len() == before {
            return known;
        }
    }
}

/// Tests that ask for the shared data: those that say so, and those that would pass in silence.
fn parted(all: &[Function]) -> (usize, Vec<String>) {
    let asking = asking(all);
    let asks = |f: &&Function| asking.contains(&(Some(f.file.clone()), f.name.clone()));
    let marked = all.iter().filter(|f| f.has("#[needs_shared]")).count();
    let silent = all.iter().filter(|f| f.has("#[test]") && !f.has("#[ignore")).filter(asks);
    (marked, silent.map(|f| format!("{}: {}", f.file.display(), f.name)).collect())
}

fn rust_files(folder: &Path, into: &mut Vec<PathBuf>) {
    for path in std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path()) {
        if path.is_dir() {
            rust_files(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

#[test]
fn no_test_passes_in_silence_where_the_shared_data_are_absent() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut folders: Vec<PathBuf> = vec![root.join("tests")];
    let crates = std::fs::read_dir(root).unwrap().map(|entry| entry.unwrap().path());
    folders.extend(crates.filter(|path| path.join("Cargo.toml").exists()).map(|path| path.join("tests")));
    let (mut marked, mut silent) = (0, Vec::new());
    for folder in folders {
        let mut files = Vec::new();
        rust_files(&folder, &mut files);
        let of = |file: &PathBuf| functions(file, &std::fs::read_to_string(file).unwrap());
        let (own_marked, own_silent) = parted(&files.iter().flat_map(of).collect::<Vec<_>>());
        marked += own_marked;
        silent.extend(own_silent);
    }
    assert!(marked >= LEAST, "only {marked} tests are marked");
    assert!(silent.is_empty(), "#[test] in place of #[needs_shared]:\n{}", silent.join("\n"));
}

/// Where the page begins that counts the tests that run without the shared data, and how many crates it has at least [-].
const COUNTED: (&str, usize) = ("## Tests without the shared data", 6);

/// Sources of a crate's tests.
fn sources_of(root: &Path, name: &str) -> Vec<PathBuf> {
    let folders = match name {
        "genu" => ["pipeline/src".to_owned(), "tests".to_owned()],
        _ => [format!("{name}/src"), format!("{name}/tests")],
    };
    let mut files = Vec::new();
    folders.iter().for_each(|folder| rust_files(&root.join(folder), &mut files));
    files
}

/// Fails where tests that need no data are taken away, or ask for data from then on.
#[test]
fn there_are_no_fewer_tests_without_the_shared_data_than_the_page_counts() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let page = std::fs::read_to_string(root.join("docs/verification.md")).unwrap();
    let table = page.split(COUNTED.0).nth(1).and_then(|rest| rest.split("\n## ").next()).unwrap();
    let mut rows = 0;
    for line in table.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let name = cells[1].trim_matches('`');
        let of = |file: &PathBuf| functions(file, &std::fs::read_to_string(file).unwrap());
        let all: Vec<Function> = sources_of(root, name).iter().flat_map(of).collect();
        let free = all.iter().filter(|f| f.has("#[test]") && !f.has("#[ignore")).count();
        let [before, now] = [2, 3].map(|k| cells[k].parse::<usize>().unwrap());
        assert!(free >= now && now >= before, "{name}: the page counts {now}, there are {free}");
        rows += 1;
    }
    assert!(rows >= COUNTED.1, "the page counts {rows} crates");
}

#[test]
fn a_test_that_asks_is_found_through_its_helpers_and_others_are_not() {
    let common = format!("pub(crate) fn deck() {{\n    let dir = {LOOKS}(1);\n}}\n");
    let own = "fn helper() {\n    let Some(d) = deck() else { return };\n}\n\
               #[test]\nfn asks() {\n    helper();\n}\n\
               #[needs_shared]\nfn says_so() {\n    helper();\n}\n\
               #[test]\n#[ignore = \"long\"]\nfn rests() {\n    helper();\n}\n\
               #[test]\nfn does_not() {\n    other(1);\n}\n// helper();\n";
    let mut all = functions(Path::new("tests/common/mod.rs"), &common);
    all.extend(functions(Path::new("tests/a.rs"), own));
    assert_eq!(parted(&all), (1, vec!["tests/a.rs: asks".to_owned()]));
    assert!(named("pub fn a_b(x: u8) {").as_deref() == Some("a_b") && named("let x = 1;").is_none());
}
