//! Every source that is cited stands in docs/bibliography.bib, once, and every entry there is cited.
#![expect(clippy::disallowed_methods, reason = "looks at the sources")]
#![allow(clippy::unwrap_used, reason = "tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

fn texts(folder: &Path, into: &mut Vec<PathBuf>) {
    let mut paths: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() && name != "target" && !name.starts_with('.') {
            texts(&path, into);
        } else if ["rs", "md", "toml"].iter().any(|e| path.extension().is_some_and(|x| x == *e)) {
            into.push(path);
        }
    }
}

/// A key: letters, then a year, then perhaps a letter.
fn is_key(word: &str) -> bool {
    let letters = word.chars().take_while(char::is_ascii_lowercase).count();
    let rest = &word[letters..];
    let digits = rest.chars().take_while(char::is_ascii_digit).count();
    letters >= 3 && digits == 4 && rest.len() <= 5 && rest[digits..].chars().all(|c| c.is_ascii_lowercase())
}

/// Keys in square brackets: `[key]`, `[key, sec. 2]`, `[key; other]`; and in lists of quoted keys.
fn cited(text: &str) -> BTreeSet<String> {
    let mut keys = BTreeSet::new();
    for part in text.split('[').skip(1).filter_map(|p| p.split(']').next()) {
        for word in part.split([',', ';', ' ']).map(|w| w.trim_matches('"')) {
            if is_key(word) {
                keys.insert(word.to_owned());
            }
        }
    }
    keys
}

#[test]
fn what_is_cited_is_listed_and_what_is_listed_is_cited() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    texts(&root, &mut files);
    let mut where_cited: BTreeMap<String, String> = BTreeMap::new();
    for file in files {
        for key in cited(&fs::read_to_string(&file).unwrap()) {
            where_cited.entry(key).or_insert_with(|| file.display().to_string());
        }
    }
    let listed: Vec<String> = fs::read_to_string(root.join("docs/bibliography.bib"))
        .unwrap()
        .lines()
        .filter_map(|l| Some(l.strip_prefix('@')?.split_once('{')?.1.split(',').next()?.to_owned()))
        .collect();
    let once: BTreeSet<&String> = listed.iter().collect();
    assert_eq!(once.len(), listed.len(), "a key is listed twice");
    for (key, file) in &where_cited {
        assert!(once.contains(key), "[{key}], cited in {file}, is not in docs/bibliography.bib");
    }
    let idle: Vec<_> = listed.iter().filter(|k| !where_cited.contains_key(*k)).collect();
    assert!(idle.is_empty(), "listed and never cited: {idle:?}");
}
