//! Whether what the program said names a trait: by whole words of its sentences, without names of files, keys and stages.

/// The sentences of what was said, line by line: warnings, refusals, and what `check` would have looked at.
pub(super) fn sentences(said: &str) -> String {
    let told = |line: &&str| {
        ["warning", "build-model:", "LOOK", "FAULT"].iter().any(|start| line.trim_start().starts_with(start))
    };
    said.lines().filter(told).map(|line| sentence(line) + "\n").collect()
}

/// A line without what stands before its sentence, and without names of files and keys.
fn sentence(line: &str) -> String {
    let before = |word: &&str| word.ends_with(':') || ["LOOK", "FAULT"].contains(word);
    line.split_whitespace().skip_while(before).filter(|word| !is_name(word)).collect::<Vec<_>>().join(" ")
}

/// Whether a word is a file's name or a key: a slash in it, or a point between letters.
fn is_name(word: &str) -> bool {
    let letters: Vec<char> = word.chars().collect();
    let inner = |w: &[char]| w[1] == '.' && (w[0].is_alphanumeric() || w[0] == '_') && w[2].is_alphabetic();
    word.contains('/') || letters.windows(3).any(inner)
}

/// Whether a sentence has a phrase, word by word; a last `*` stands for any ending of its word.
pub(super) fn has(sentences: &str, phrase: &str) -> bool {
    let words = |text: &str| -> Vec<String> {
        let lower = text.to_lowercase();
        let parts = lower.split(|c: char| !c.is_alphanumeric() && c != '_' && c != '*');
        parts.filter(|w| !w.is_empty()).map(str::to_owned).collect()
    };
    let wanted = words(phrase);
    let same = |(word, wanted): (&String, &String)| match wanted.strip_suffix('*') {
        Some(start) => word.starts_with(start),
        None => word == wanted,
    };
    let in_line = |line: &str| words(line).windows(wanted.len()).any(|w| w.iter().zip(&wanted).all(same));
    !wanted.is_empty() && sentences.lines().any(in_line)
}

#[test]
fn a_trait_is_named_by_whole_words_and_not_by_a_file_or_a_stage() {
    let said = "warning: ingest: scans/label_colour.ply: 3 of the points (ct.side) lie inside the scan's radius\nLOOK    laxity.k    its sign is turned\nok      exchanged";
    let told = sentences(said);
    for by_accident in ["label", "colour", "side", "rad", "ingest", "warning", "laxity", "exchanged", "ply"] {
        assert!(!has(&told, by_accident), "{by_accident}: {told}");
    }
    for named in ["inside", "points", "rad*", "lie inside", "sign is turned", "Scan"] {
        assert!(has(&told, named), "{named}: {told}");
    }
}
