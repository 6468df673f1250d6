//! Commands that a message suggests: pasted as they stand, they run, and mean the same path.

use std::ffi::OsStr;
use std::path::Path;

/// A command that is suggested: the program, its verb, and then its words, each quoted where a shell asks for it.
///
/// A path belongs into it as it is. A placeholder does not: who reads the message would have to know what stands for what.
pub fn command<I: IntoIterator>(verb: &str, words: I) -> String
where
    I::Item: AsRef<OsStr>,
{
    let mut out = format!("build-model {verb}");
    for one in words {
        out.push(' ');
        out += &word(&one.as_ref().to_string_lossy());
    }
    out
}

/// [`command`] of a verb and the folder it is about.
pub fn command_on(verb: &str, folder: &Path) -> String {
    command(verb, [folder])
}

/// The path as one word of a command line; in quotes where it has a space or another character that a shell takes for its own.
pub fn quoted(path: &Path) -> String {
    word(&path.display().to_string())
}

/// A word of a command line likewise.
pub fn word(text: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c) || (cfg!(windows) && c == '\\');
    match (!text.is_empty() && text.chars().all(plain), cfg!(windows)) {
        (true, _) => text.to_owned(),
        (false, true) => format!("\"{text}\""),
        (false, false) => format!("'{}'", text.replace('\'', "'\\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(not(windows))]
    fn only_what_a_shell_would_part_or_change_is_quoted() {
        for (path, wanted) in
            [("a/b-1.c", "a/b-1.c"), ("my knee", "'my knee'"), ("it's", "'it'\\''s'"), ("", "''"), ("$HOME", "'$HOME'")]
        {
            assert_eq!(quoted(Path::new(path)), wanted);
            assert_eq!(command_on("open", Path::new(path)), format!("build-model open {wanted}"));
        }
        assert_eq!(command("options", [] as [&str; 0]), "build-model options");
    }
}
