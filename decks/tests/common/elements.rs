//! The law of a table of elements: each is told, without effect or refused as the table says.
#![allow(clippy::unwrap_used, reason = "tests")]

use super::knees::told;
use decks::known::{Class, Known};
use decks::{DeckError, ImportedDeck};
use std::collections::BTreeMap;

/// A table, and how a file is made of its elements and read.
pub(crate) struct Law<'a> {
    /// The table.
    pub(crate) table: &'a BTreeMap<&'static str, Known>,
    /// The file's name.
    pub(crate) file: &'a str,
    /// An element of a name, as the file has it.
    pub(crate) element: &'a dyn Fn(&str) -> String,
    /// A knee with elements in it, and one without any (`None`).
    pub(crate) with: &'a dyn Fn(Option<&str>) -> String,
    /// Reads a file.
    pub(crate) read: &'a dyn Fn(&str) -> Result<ImportedDeck, DeckError>,
}

/// Holds every row of the table against what comes of its element; gives how many are told, harmless and refused.
pub(crate) fn each_is_what_the_table_says(law: &Law<'_>) -> [usize; 3] {
    let Law { file, element, with, read, .. } = law;
    let of = |class: Class| law.table.iter().filter(move |(_, e)| e.class == class).map(|(name, e)| (*name, e.why));
    let line = |text: &str, part: &str| 1 + text[..text.find(part).unwrap()].matches('\n').count();
    // all that are told, a line each, in one file
    let all = with(Some(&of(Class::Told).map(|(name, _)| element(name) + "\n").collect::<String>()));
    let said = told(&read(&all).unwrap());
    for (name, why) in of(Class::Told) {
        let at = line(&all, &element(name));
        let named = name.replacen(':', " ", 1);
        assert!(said.contains(&format!("{file}:{at}: {named} is passed over: {why}")), "{name}: {said}");
    }
    let harmless = with(Some(&of(Class::Harmless).map(|(name, _)| element(name)).collect::<String>()));
    assert_eq!(told(&read(&harmless).unwrap()), told(&read(&with(None)).unwrap()));
    for (name, why) in of(Class::Refused) {
        let text = with(Some(&element(name)));
        let e = read(&text).unwrap_err();
        assert!(e.line == line(&text, &element(name)) && e.message.contains(why), "{name}: {e}");
    }
    [Class::Told, Class::Harmless, Class::Refused].map(|class| of(class).count())
}
