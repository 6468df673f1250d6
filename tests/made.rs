//! Pages say which code made their figures: docs/words/made.py names those whose code changed since.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, clippy::print_stderr, reason = "tests")]

use crate::common::write;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

/// What the script prints of the pages of `root`.
fn said(root: &Path, words: &[&str]) -> Option<String> {
    let run = run(root, words)?;
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    Some(String::from_utf8_lossy(&run.stdout).into_owned())
}

fn run(root: &Path, words: &[&str]) -> Option<Output> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/words/made.py");
    Command::new("python3").arg(script).args(words).arg("--root").arg(root).output().ok()
}

#[test]
fn a_page_is_stale_where_the_code_that_made_it_changed_and_a_comment_changes_nothing() {
    let folder = TempDir::new().unwrap();
    let root = folder.path();
    for crate_of_ours in ["one", "two"] {
        std::fs::create_dir_all(root.join(crate_of_ours).join("src")).unwrap();
        write(&root.join(crate_of_ours).join("src/lib.rs"), "const A: f64 = 1.0;\n");
    }
    std::fs::create_dir_all(root.join("docs")).unwrap();
    let page = |name: &str, of: &str| {
        write(&root.join("docs").join(name), "a figure: 1.0\n");
        format!("[[page]]\nname = \"docs/{name}\"\nby = \"make it\"\ncrates = [{of}]\ndigests = {{}}\n")
    };
    let table = page("a.md", "\"one\"") + &page("b.md", "\"one\", \"two\"");
    write(&root.join("docs/made.toml"), table);
    let Some(before) = said(root, &["--check"]) else {
        eprintln!("made: skipped, python3 is not there");
        return;
    };
    assert!(before.contains("2 of 2 pages"), "{before}");
    let kept = said(root, &["--made", "docs/a.md", "docs/b.md"]).unwrap();
    assert!(kept.contains("0 of 2 pages"), "{kept}");
    write(&root.join("two/src/lib.rs"), "// a remark\n\nconst A: f64 = 1.0;\n");
    assert!(said(root, &["--check"]).unwrap().contains("0 of 2 pages"));
    write(&root.join("two/src/lib.rs"), "const A: f64 = 1.1;\n");
    let told = said(root, &["--check"]).unwrap();
    assert!(
        told.contains("docs/a.md: as its crates are") && told.contains("docs/b.md: stale: two changed since"),
        "{told}"
    );
    let again = said(root, &["--made", "docs/b.md"]).unwrap();
    assert!(again.contains("0 of 2 pages"), "{again}");
}

/// What makes no figure leaves a page as it is; where that is not plain, the page is called stale.
#[test]
fn a_crates_own_tests_change_no_figure_and_code_beside_them_does() {
    let folder = TempDir::new().unwrap();
    let root = folder.path();
    let code = "pub fn a() -> f64 {\n    1.0\n}\n\n";
    let tests =
        "#[cfg(test)]\nmod tests {\n    #[test]\n    fn a() {\n        assert!(super::a() > 0.5);\n    }\n}\n\n";
    let one =
        "#[cfg(test)]\n#[allow(dead_code)]\n// why\npub(crate) fn ids(\n    a: u8,\n) -> Vec<u8> {\n    vec![a]\n}\n\n";
    let apart = "#[cfg(test)]\nmod toy;\n\n";
    let last = "pub fn z() -> f64 {\n    2.0\n}\n";
    let (library, toy, data) =
        (root.join("one/src/lib.rs"), root.join("one/src/toy/inner.rs"), root.join("one/data/table.toml"));
    let base = format!("{code}{last}");
    for (path, text) in
        [(&library, base.as_str()), (&data, "# a remark\na = 1\n"), (&root.join("docs/a.md"), "1.0\n"), (&toy, "")]
    {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        write(path, text);
    }
    std::fs::remove_file(&toy).unwrap();
    let table = "[[page]]\nname = \"docs/a.md\"\nby = \"make it\"\ncrates = [\"one\"]\ndigests = {}\n";
    write(&root.join("docs/made.toml"), table);
    if said(root, &["--made", "docs/a.md"]).is_none() {
        eprintln!("made: skipped, python3 is not there");
        return;
    }
    let is_stale = |source: &str| {
        write(&library, source);
        said(root, &["--check"]).unwrap().contains("1 of 1 pages")
    };
    for same in [
        base.clone(),
        format!("{code}{last}\n{tests}"),
        format!("{code}{one}{last}"),
        format!("{code}{tests}{one}{last}"),
        format!("{code}{apart}{last}"),
    ] {
        assert!(!is_stale(&same), "{same}");
    }
    for other in [
        base.replace("2.0", "3.0"),
        format!("{code}{tests}{one}{}", last.replace("2.0", "3.0")),
        format!("{code}#[cfg(test)]\nconst A: f64 =\n    1.0;\npub const B: f64 = 1.0;\n{last}"),
        format!("{code}#[cfg(any(test, feature = \"x\"))]\n{one}{last}"),
        format!("{code}mod toy;\n\n{last}"),
    ] {
        assert!(is_stale(&other), "{other}");
    }
    // a file is of the tests where its module is declared so
    write(&toy, "pub const TOY: f64 = 1.0;\n");
    assert!(!is_stale(&format!("{code}{apart}{last}")) && is_stale(&base));
    std::fs::remove_file(&toy).unwrap();
    for (text, stale) in [("\na = 1\n", false), ("a = 2\n", true), ("b = \"\"\"\n# data\n\"\"\"\na = 1\n", true)] {
        write(&data, text);
        assert_eq!(is_stale(&base), stale, "{text}");
    }
}

#[test]
fn a_page_that_a_program_writes_is_held_to_it() {
    let folder = TempDir::new().unwrap();
    let root = folder.path();
    for (name, text) in
        [("one/src/lib.rs", "const A: f64 = 1.0;\n"), ("make.rs", "fn main() {}\n"), ("docs/a.md", "1.0\n")]
    {
        std::fs::create_dir_all(root.join(name).parent().unwrap()).unwrap();
        write(&root.join(name), text);
    }
    write(
        &root.join("docs/made.toml"),
        "[[page]]\nname = \"docs/a.md\"\nby = \"make it\"\nwhole = true\ncrates = [\"one\"]\nmakers = [\"make.rs\"]\ndigests = {}\n",
    );
    let Some(made) = said(root, &["--made", "docs/a.md"]) else {
        eprintln!("made: skipped, python3 is not there");
        return;
    };
    assert!(made.contains("0 of 1 pages"), "{made}");
    write(&root.join("make.rs"), "fn main() { panic!() }\n");
    assert!(said(root, &["--check"]).unwrap().contains("what makes it changed since"));
    write(&root.join("make.rs"), "fn main() {}\n");
    write(&root.join("docs/a.md"), "1.1\n");
    let refused = run(root, &["--check"]).unwrap();
    assert!(!refused.status.success() && String::from_utf8_lossy(&refused.stderr).contains("by hand: docs/a.md"));
    let nowhere = run(root, &["--made", "docs/a.md", "--at", "nosuchcommit"]).unwrap();
    assert!(!nowhere.status.success() && String::from_utf8_lossy(&nowhere.stderr).contains("no sources of one"));
}

#[test]
fn a_number_typed_into_a_table_is_told_and_words_are_not() {
    let folder = TempDir::new().unwrap();
    let root = folder.path();
    for (name, text) in [("one/src/lib.rs", "const A: f64 = 1.0;\n"), ("docs/a.md", "Words.\n| what | 1.0 mm |\n")] {
        std::fs::create_dir_all(root.join(name).parent().unwrap()).unwrap();
        write(&root.join(name), text);
    }
    let table = "[[page]]\nname = \"docs/a.md\"\nby = \"make it\"\ncrates = [\"one\"]\ndigests = {}\n";
    write(&root.join("docs/made.toml"), table);
    let Some(made) = said(root, &["--made", "docs/a.md"]) else {
        eprintln!("made: skipped, python3 is not there");
        return;
    };
    assert!(made.contains("0 of 1 pages"), "{made}");
    write(&root.join("docs/a.md"), "Other words.\n| which | 1.0 mm |\n");
    assert!(run(root, &["--check"]).unwrap().status.success());
    write(&root.join("docs/a.md"), "Other words.\n| which | 1.1 mm |\n");
    let refused = run(root, &["--check"]).unwrap();
    assert!(!refused.status.success() && String::from_utf8_lossy(&refused.stderr).contains("by hand: docs/a.md"));
    // typed on purpose: which code made the rest is as it was known
    write(&root.join("one/src/lib.rs"), "const A: f64 = 1.1;\n");
    let kept = said(root, &["--typed", "docs/a.md"]).unwrap();
    assert!(kept.contains("stale: one changed since"), "{kept}");
}
