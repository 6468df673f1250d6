//! Paths in commands that a message suggests: typed as they stand, they mean the same path.

use std::path::Path;

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
        }
    }
}
