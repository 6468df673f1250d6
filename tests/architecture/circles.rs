//! Which files of a crate use each other in a circle, told from their sources.
//!
//! A file in a folder may use the file of the folder, and that one may use it: a folder's file declares what its files share. What the folder's file
//! takes from elsewhere counts as used by those of its files that use it, and a name that it brings in counts as used where it is defined.

use std::collections::{BTreeMap, BTreeSet};

/// Texts by module path; the crate's root is "".
pub(super) type Sources = BTreeMap<String, String>;

/// A module path, part by part.
type Path = Vec<String>;

/// A crate's files as they are compiled for users.
struct Files {
    code: Sources,
    /// Of each file the names that its `use` brings in, with what they mean.
    imports: BTreeMap<String, BTreeMap<String, Path>>,
}

/// What a file uses.
struct Used {
    /// Files elsewhere.
    others: BTreeSet<String>,
    /// Files of the folders that it lies in.
    above: BTreeSet<String>,
}

/// Groups of files of which each leads to each other one, in the order of their names.
pub(super) fn circles(sources: &Sources) -> BTreeSet<Vec<String>> {
    let files = Files::of(sources);
    let own: BTreeMap<&String, Used> = files.code.keys().map(|name| (name, files.used(name))).collect();
    let uses = |name: &String| {
        let mut found = own[name].others.clone();
        for above in &own[name].above {
            let outside = |m: &&String| *m != name && !is_below(m, above) && !is_below(name, m);
            found.extend(own[above].others.iter().filter(outside).cloned());
        }
        found
    };
    let uses: BTreeMap<&String, BTreeSet<String>> = own.keys().map(|name| (*name, uses(name))).collect();
    let reached = |from: &String| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(at) = open.pop() {
            open.extend(uses[&at].iter().filter(|m| seen.insert((*m).clone())).cloned());
        }
        seen
    };
    let all: BTreeMap<&String, BTreeSet<String>> = uses.keys().map(|name| (*name, reached(name))).collect();
    let circle = |name: &String| -> Vec<String> {
        all[name].iter().filter(|other| all[*other].contains(name)).cloned().collect()
    };
    uses.keys().map(|name| circle(name)).filter(|files| !files.is_empty()).collect()
}

/// Whether a file lies in the folder of another.
fn is_below(name: &str, folder: &str) -> bool {
    name.strip_prefix(folder).is_some_and(|rest| rest.starts_with("::"))
}

fn parts(name: &str) -> Path {
    name.split("::").filter(|p| !p.is_empty()).map(str::to_owned).collect()
}

fn is_of_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

impl Files {
    fn of(sources: &Sources) -> Files {
        let code = sources.iter().map(|(name, text)| (name.clone(), without_tests(&bare(text)))).collect();
        let mut files = Files { code, imports: BTreeMap::new() };
        files.imports = files.code.iter().map(|(name, text)| (name.clone(), files.brought_in(name, text))).collect();
        files
    }

    /// A path from the crate's root; none of another crate's.
    fn absolute(&self, own: &[String], path: &[String]) -> Option<Path> {
        let ups = path.iter().take_while(|p| *p == "super").count();
        match path.first()?.as_str() {
            "crate" => Some(path[1..].to_vec()),
            "super" => Some([&own[..own.len().saturating_sub(ups)], &path[ups..]].concat()),
            "self" => Some([own, &path[1..]].concat()),
            child => {
                let is_ours = self.code.contains_key(&[own, &[child.to_owned()]].concat().join("::"));
                is_ours.then(|| [own, path].concat())
            }
        }
    }

    /// Names that a file brings in by `use`, with what they mean in this crate.
    fn brought_in(&self, name: &str, text: &str) -> BTreeMap<String, Path> {
        let (own, mut found) = (parts(name), Vec::new());
        for (at, _) in text.match_indices("use ").filter(|(at, _)| !text[..*at].ends_with(is_of_word)) {
            paths(&text[at + 4..], &[], &mut found);
        }
        let ours = found.iter().filter_map(|path| self.absolute(&own, path));
        let named = ours.map(|mut path| {
            path.pop_if(|last| last == "self");
            (path.last().cloned().unwrap_or_default(), path)
        });
        named.collect()
    }

    /// The file in which what a path means is defined; names that a file brings in lead on, at most so often.
    fn defined_in(&self, path: &[String], most: usize) -> String {
        let known = |n: &usize| self.code.contains_key(&path[..*n].join("::"));
        let of = (0..=path.len()).rev().find(known).unwrap_or(0);
        let file = path[..of].join("::");
        let imported = path.get(of).and_then(|name| self.imports.get(&file)?.get(name));
        match imported.filter(|_| most > 0) {
            Some(meant) => self.defined_in(&[meant, &path[of + 1..]].concat(), most - 1),
            None => file,
        }
    }

    /// What a file's text uses of its crate.
    fn used(&self, name: &str) -> Used {
        let (own, mut found) = (parts(name), Vec::new());
        let mut rest = self.code[name].as_str();
        while let Some(start) = rest.find(is_of_word) {
            let led = rest[..start].ends_with("::");
            rest = &rest[start..];
            let end = rest.find(|c| !is_of_word(c)).unwrap_or(rest.len());
            let begins =
                !led && rest[end..].starts_with("::") && self.absolute(&own, &[rest[..end].to_owned()]).is_some();
            rest = if begins { paths(rest, &[], &mut found) } else { &rest[end..] };
        }
        let ours = found.iter().filter_map(|path| self.absolute(&own, path));
        let all = ours.map(|path| self.defined_in(&path, MOST_STEPS)).filter(|file| !file.is_empty() && file != name);
        let (above, others) = all.partition(|file| is_below(name, file));
        Used { others, above }
    }
}

/// Most names that lead from one to the next [-]: more than any crate has.
const MOST_STEPS: usize = 20;

/// Reads a path from `text` after `prefix`; a group in braces gives several. What is left of the text comes back.
fn paths<'a>(text: &'a str, prefix: &[String], out: &mut Vec<Path>) -> &'a str {
    let mut path = prefix.to_vec();
    let mut rest = text;
    loop {
        rest = rest.trim_start();
        if let Some(group) = rest.strip_prefix('{') {
            rest = group;
            while !rest.is_empty() && !rest.starts_with('}') {
                let before = rest.len();
                rest = paths(rest, &path, out).trim_start();
                rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
                if rest.len() == before {
                    rest = &rest[rest.chars().next().map_or(0, char::len_utf8)..];
                }
            }
            return rest.strip_prefix('}').unwrap_or(rest);
        }
        let end = rest.find(|c| !is_of_word(c)).unwrap_or(rest.len());
        if end == 0 {
            break;
        }
        path.push(rest[..end].to_owned());
        rest = &rest[end..];
        match rest.strip_prefix("::") {
            Some(more) => rest = more,
            None => break,
        }
    }
    out.push(path);
    rest
}

/// Code without comments, and without what stands in quotation marks.
fn bare(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let length = match c {
            '/' if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
            '/' if rest.starts_with("/*") => rest.find("*/").map_or(rest.len(), |n| n + 2),
            '"' => quoted(rest),
            'r' | 'b' if !out.ends_with(is_of_word) => raw(rest).unwrap_or(0),
            '\'' => letter(rest).unwrap_or(0),
            _ => 0,
        };
        if length == 0 {
            out.push(c);
        }
        rest = &rest[length.max(c.len_utf8())..];
    }
    out
}

/// The length of a text in quotation marks.
fn quoted(text: &str) -> usize {
    let mut escaped = false;
    let end = text.char_indices().skip(1).find(|(_, c)| {
        let ends = *c == '"' && !escaped;
        escaped = *c == '\\' && !escaped;
        ends
    });
    end.map_or(text.len(), |(n, _)| n + 1)
}

/// The length of a raw text: r"...", r#"..."#, br"...".
fn raw(text: &str) -> Option<usize> {
    let marks = text.strip_prefix('b').unwrap_or(text).strip_prefix('r')?;
    let hashes = &marks[..marks.find(|c| c != '#').unwrap_or(marks.len())];
    let inner = marks[hashes.len()..].strip_prefix('"')?;
    let end = format!("\"{hashes}");
    let begin = text.len() - inner.len();
    Some(inner.find(&end).map_or(text.len(), |n| begin + n + end.len()))
}

/// The length of a letter in single marks; none of a lifetime.
fn letter(text: &str) -> Option<usize> {
    let mut letters = text.char_indices().skip(1);
    let (_, first) = letters.next()?;
    let (second, _) = letters.next()?;
    match first {
        // past the letter that is escaped, which may be a mark itself
        '\\' => text[second + 1..].find('\'').map(|n| second + 1 + n + 1),
        _ => text[second..].starts_with('\'').then_some(second + 1),
    }
}

/// Code without the items that only tests have, wherever they stand.
fn without_tests(code: &str) -> String {
    let mut parts = code.split("#[cfg(test)]");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let mut depth = 0_usize;
        let end = part.char_indices().find(|(_, c)| {
            match c {
                '{' => depth += 1,
                '}' => depth = depth.saturating_sub(1),
                _ => {}
            }
            depth == 0 && [';', '}'].contains(c)
        });
        out.push_str(&part[end.map_or(part.len(), |(n, c)| n + c.len_utf8())..]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Files by module path and text; the root declares nothing that matters.
    fn found(files: &[(&str, &str)]) -> Vec<String> {
        let sources = files.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect();
        circles(&sources).into_iter().map(|files| files.join(" ")).collect()
    }

    #[test]
    fn a_circle_is_found_however_its_arrows_are_written() {
        for text in [
            "use crate::b::X;",
            "use super::b::X;",
            "use super::{b::{X, Y}, d};",
            "fn f() { crate::b::x() }",
            "use super::b;\nfn f() { b::x() }",
        ] {
            let files = [("a", text), ("b", "use crate::c::C;"), ("c", "use crate::a::A;")];
            assert_eq!(found(&files), ["a b c"], "{text}");
            assert!(found(&files[..2]).is_empty(), "{text}: a row is no circle");
        }
    }

    #[test]
    fn a_circle_of_one_folder_is_found_through_a_file_of_a_file() {
        // the format takes the text, whose file of its own takes the format
        let text = |before: &str| format!("{before}\nmod robot;\nfn text() {{ robot::table() }}");
        for before in ["", "#[cfg(test)]\nmod tests;", "#[cfg(test)]\nmod tests { fn f() { \"}\"; '}'; } }"] {
            let files = [
                ("laxity::format", "use super::text;\nfn read() { text::text() }".to_owned()),
                ("laxity::text", text(before)),
                ("laxity::text::robot", "use crate::laxity::format::test_of;".to_owned()),
            ];
            let files = files.each_ref().map(|(name, text)| (*name, text.as_str()));
            assert_eq!(found(&files), ["laxity::format laxity::text laxity::text::robot"], "{before}");
        }
    }

    #[test]
    fn a_name_that_a_folders_file_brings_in_leads_to_where_it_is_defined() {
        for folder in
            ["pub use signs::Doubt;", "use self::signs::{Doubt, Other};", "pub(crate) use crate::l::signs::Doubt;"]
        {
            let files =
                [("l", folder), ("l::signs", "fn f() { super::order::g() }"), ("l::order", "use super::Doubt;")];
            assert_eq!(found(&files), ["l::order l::signs"], "{folder}");
        }
    }

    #[test]
    fn what_a_folders_file_takes_from_elsewhere_is_taken_by_the_files_that_use_it() {
        let files = |given: &'static str| {
            let frames = "mod given;\nuse crate::specimen::Specimen;\npub struct Options;";
            [("frames", frames), ("frames::given", given), ("specimen", "use crate::frames::given::Given;")]
        };
        assert_eq!(found(&files("use super::Options;")), ["frames::given specimen"]);
        assert!(found(&files("pub struct Given;")).is_empty(), "it uses nothing of the folder's file");
    }

    #[test]
    fn a_folders_file_and_its_files_may_use_each_other() {
        let files = [
            ("", "mod a;\nuse a::A;"),
            ("a", "mod b;\nuse b::B;\npub struct A;"),
            ("a::b", "use super::A;\nuse crate::Root;"),
        ];
        assert!(found(&files).is_empty());
    }

    #[test]
    fn comments_texts_and_tests_use_nothing() {
        let of = |text: &str| found(&[("a", text), ("b", "use crate::a::X;")]);
        for text in [
            "// crate::b::x",
            "/* crate::b::x */",
            "const X: &str = \"crate::b::x \\\" crate::b::x\";",
            "const X: &str = r#\"\" crate::b::x\"#;",
            "#[cfg(test)]\nmod tests {\n use crate::b::X;\n fn f() { \"{\"; }\n}",
            "#[cfg(test)]\nuse crate::b::X;",
        ] {
            assert!(of(text).is_empty(), "{text}");
            // and what stands behind them is seen
            assert_eq!(
                of(&format!("{text}\nfn f<'a>(x: &'a str) {{ ['\"', '\\'', '{{']; crate::b::x() }}")),
                ["a b"],
                "{text}"
            );
        }
    }
}
