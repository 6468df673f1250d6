//! Gives the program a digest of its own source, so that stages kept by another version are not taken for this one's; the commit it
//! was built from; and the comments of its options, so that `build-model options` says what stands in the source.
#![expect(clippy::disallowed_methods, reason = "a build script reads sources and talks to cargo")]

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    let mut hasher = blake3::Hasher::new();
    let mut files = Vec::new();
    for root in roots() {
        println!("cargo:rerun-if-changed={}", root.display());
        collect(&root, &mut files);
    }
    files.sort();
    let mut comments = Comments::default();
    for file in files {
        let bytes = std::fs::read(&file).expect("a source that was just listed can be read");
        hasher.update(file.to_string_lossy().as_bytes());
        hasher.update(&bytes);
        if file.extension().is_some_and(|e| e == "rs") {
            comments.read(&String::from_utf8_lossy(&bytes));
        }
    }
    println!("cargo:rustc-env=GENU_CODE_DIGEST={}", hasher.finalize().to_hex());
    println!("cargo:rustc-env=GENU_COMMIT={}", commit().unwrap_or_else(|| "no commit".into()));
    let out = PathBuf::from(std::env::var("OUT_DIR").expect("cargo gives a folder to build scripts"));
    // in a package of this crate alone the sources of the others are not beside it: it brings what their comments say
    let source = if Path::new("sim/src").exists() {
        comments.source()
    } else {
        std::fs::read_to_string("pipeline/option_comments.rs").expect("the package holds the comments of options")
    };
    std::fs::write(out.join("option_comments.rs"), source).expect("the build folder can be written");
}

/// The commit the sources stand at, with `+` where they were changed since; nothing outside a repository.
fn commit() -> Option<String> {
    let git = |args: &[&str]| {
        let run = Command::new("git").args(args).output().ok().filter(|r| r.status.success())?;
        Some(String::from_utf8_lossy(&run.stdout).trim().to_owned())
    };
    for name in ["HEAD", "refs/heads"] {
        let place = git(&["rev-parse", "--git-path", name])?;
        println!("cargo:rerun-if-changed={place}");
    }
    let changed = git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|s| !s.is_empty());
    let words = git(&["log", "-1", "--format=%h, %cs"])?;
    Some(if changed { format!("{words}, changed since") } else { words })
}

/// What the program is made of: `src` and `data` of every crate of the workspace, and the locked dependencies.
fn roots() -> Vec<PathBuf> {
    let mut roots = vec![PathBuf::from("Cargo.lock"), PathBuf::from("data")];
    for folder in std::fs::read_dir(".").expect("the workspace can be listed").flatten() {
        // Python's module calls the program and makes nothing itself.
        if folder.file_name() == "python" {
            continue;
        }
        let crate_of_ours = folder.path().join("Cargo.toml").exists() || folder.file_name() == "pipeline";
        let parts = ["src", "data"].map(|part| folder.path().join(part));
        roots.extend(parts.into_iter().filter(|part| crate_of_ours && part.exists()));
    }
    roots.sort();
    roots
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    if path.is_dir() {
        for entry in std::fs::read_dir(path).expect("a source folder can be listed").flatten() {
            collect(&entry.path(), files);
        }
    } else if path.exists() {
        files.push(path.to_path_buf());
    }
}

/// A field of a struct of options, or a variant of a choice.
struct Member {
    name: String,
    kind: String,
    comment: String,
}

/// Comments of public structs and enums, by name. The sources are as rustfmt leaves them, so that lines are enough to go by.
#[derive(Default)]
struct Comments {
    /// Several may have one name; of options only one may.
    structs: BTreeMap<String, Vec<Vec<Member>>>,
    /// Two enums may have one name.
    choices: Vec<(String, Vec<Member>)>,
}

impl Comments {
    fn read(&mut self, source: &str) {
        let (mut comment, mut rename, mut rename_all, mut skipped) = (String::new(), None, String::new(), false);
        let mut open: Option<(bool, String, Vec<Member>)> = None;
        for line in source.lines() {
            let text = line.trim();
            if let Some(words) = text.strip_prefix("///") {
                comment = format!("{comment} {}", words.trim());
                continue;
            }
            if text.starts_with("#[") {
                rename_all = quoted(text, "rename_all = ").unwrap_or(rename_all);
                rename = quoted(text, "rename = ").or(rename);
                skipped |= text == "#[serde(skip)]";
                continue;
            }
            let start = |word: &str| text.strip_prefix(word).and_then(|t| t.strip_suffix(" {")).map(str::to_owned);
            if line == "}" {
                if let Some((is_struct, name, members)) = open.take() {
                    if is_struct {
                        self.structs.entry(name).or_default().push(members);
                    } else {
                        self.choices.push((name, members));
                    }
                }
                rename_all.clear();
            } else if let Some(name) = start("pub struct ") {
                open = Some((true, name, vec![]));
            } else if let Some(name) = start("pub enum ") {
                open = Some((false, name, vec![]));
            } else if let Some((is_struct, _, members)) = &mut open
                && line.starts_with("    ")
                && !line.starts_with("     ")
            {
                let member = text.trim_end_matches(',');
                let field = member.strip_prefix("pub ").and_then(|f| f.split_once(": "));
                let plain = member.chars().all(char::is_alphanumeric) && !member.is_empty();
                let pair = match field {
                    Some((name, kind)) if *is_struct => Some((name.to_owned(), kind.to_owned())),
                    None if !*is_struct && plain => Some((cased(member, &rename_all), String::new())),
                    _ => None,
                };
                members.extend(pair.filter(|_| !skipped).map(|(name, kind)| Member {
                    name: rename.take().unwrap_or(name),
                    kind,
                    comment: comment.trim().to_owned(),
                }));
            } else if open.is_none() && !text.is_empty() {
                rename_all.clear();
            }
            comment.clear();
            (rename, skipped) = (None, false);
        }
    }

    /// The tables as Rust: every struct within reach of `BuildOptions`, every choice.
    fn source(&self) -> String {
        let (mut reached, mut next) = (BTreeMap::new(), vec!["BuildOptions".to_owned()]);
        while let Some(name) = next.pop() {
            let Some(found) = self.structs.get(&name).filter(|_| !reached.contains_key(&name)) else { continue };
            let [members] = found.as_slice() else {
                panic!(
                    "{} structs are called {name}: the options of one would get the comments of another",
                    found.len()
                );
            };
            next.extend(members.iter().map(|m| m.kind.clone()));
            reached.insert(name, members);
        }
        let mut out = String::from(
            "/// Fields of structs of options: name, type, comment.\npub(super) static STRUCTS: &[Table] = &[\n",
        );
        for (name, members) in &reached {
            table(&mut out, name, members);
        }
        out += "];\n/// Values of choices.\npub(super) static CHOICES: &[Table] = &[\n";
        let kinds: Vec<&String> = reached.values().flat_map(|m| m.iter().map(|m| &m.kind)).collect();
        for (name, members) in self.choices.iter().filter(|(name, _)| kinds.contains(&name)) {
            table(&mut out, name, members);
        }
        out + "];\n"
    }
}

fn table(out: &mut String, name: &str, members: &[Member]) {
    let _ = writeln!(out, "({name:?}, &[");
    for m in members {
        let _ = writeln!(out, "({:?}, {:?}, {:?}),", m.name, m.kind, m.comment);
    }
    *out += "]),\n";
}

fn quoted(text: &str, key: &str) -> Option<String> {
    text.split_once(key)?.1.split('"').nth(1).map(str::to_owned)
}

/// A variant as serde writes it.
fn cased(name: &str, rule: &str) -> String {
    let parted = |by: char| {
        let mut out = String::new();
        for (i, c) in name.chars().enumerate() {
            if c.is_uppercase() && i > 0 {
                out.push(by);
            }
            out.extend(c.to_lowercase());
        }
        out
    };
    match rule {
        "kebab-case" => parted('-'),
        "snake_case" => parted('_'),
        "lowercase" => name.to_lowercase(),
        _ => name.to_owned(),
    }
}
