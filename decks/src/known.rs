//! Every keyword of Abaqus and what becomes of it: read, without effect, told, or refused. Tables of that kind are read here.

use super::DeckError;
use super::keyword::{Block, DeckText};
use super::tree::Tree;
use notices::{Kind, Notice};
use roxmltree::Node;
use sim::names::did_you_mean;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// The table, a line a keyword.
const TABLE: &str = include_str!("keywords.txt");

/// What becomes of a keyword.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Read.
    Obeyed,
    /// Changes nothing of the model.
    Harmless,
    /// Passed over, with a warning.
    Told,
    /// The deck is refused.
    Refused,
}

/// A row of a table: a keyword, or an element of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// What becomes of it.
    pub class: Class,
    /// Of an obeyed one: its parts (parameters, properties) that are read, or change nothing; of a parameter with `=` at this value alone.
    pub parts: Vec<&'static str>,
    /// Of another: why, as the message says it.
    pub why: &'static str,
}

impl Known {
    /// Whether a parameter is read or changes nothing; where the table has its values (`OP=ADD`), whether this value does.
    fn has(&self, name: &str, value: &str) -> bool {
        self.parts.iter().any(|part| match part.split_once('=') {
            Some((of, known)) => of == name && known.eq_ignore_ascii_case(value),
            None => *part == name,
        })
    }
}

static KEYWORDS: LazyLock<BTreeMap<&'static str, Known>> = LazyLock::new(|| rows(TABLE, '+'));

/// The rows of a table by their names: `class | name | parts`, or `class | name | why`. Parts stand between separators.
pub(crate) fn rows(table: &'static str, separator: char) -> BTreeMap<&'static str, Known> {
    table.lines().filter_map(|line| row(line, separator)).collect()
}

fn row(line: &'static str, separator: char) -> Option<(&'static str, Known)> {
    let mut cells = line.split('|').map(str::trim);
    let class = match cells.next()? {
        "obeyed" => Class::Obeyed,
        "harmless" => Class::Harmless,
        "told" => Class::Told,
        "refused" => Class::Refused,
        _ => return None,
    };
    let (name, rest) = (cells.next()?, cells.next()?);
    let obeyed = class == Class::Obeyed;
    let parts = rest.split(separator).map(str::trim).filter(|p| obeyed && !p.is_empty()).collect();
    Some((name, Known { class, parts, why: if obeyed { "" } else { rest } }))
}

/// The keywords of the index of Abaqus' manual, upper case.
pub fn keywords() -> &'static BTreeMap<&'static str, Known> {
    &KEYWORDS
}

/// Holds every keyword and parameter of a deck against the table: warnings, a line a kind.
///
/// # Errors
/// A keyword that is refused, or one that Abaqus does not have and that resembles one that is read.
pub(super) fn judge(deck: &DeckText) -> Result<Vec<Notice>, DeckError> {
    let mut told: BTreeMap<String, (usize, String)> = BTreeMap::new();
    for block in &deck.blocks {
        let mut tell = |what: String| {
            told.entry(what).or_insert_with(|| (0, deck.place(block))).0 += 1;
        };
        match KEYWORDS.get(block.keyword.as_str()) {
            Some(known) if known.class == Class::Refused => {
                return Err(deck.error(block, block.line, format!("is not read: it {}", known.why)));
            }
            Some(known) if known.class == Class::Told => {
                tell(format!("*{} is passed over: {}", block.keyword, known.why));
            }
            Some(_) if is_spare(deck, block) => {}
            Some(known) if known.class == Class::Obeyed => {
                let odd = block.options.iter().filter(|(name, value)| !known.has(name, value));
                odd.for_each(|(name, value)| {
                    let of_value = known.parts.iter().any(|part| part.split_once('=').is_some_and(|(n, _)| n == name));
                    let value = if of_value { format!("={value}") } else { String::new() };
                    tell(format!("*{}: the parameter {name}{value} is passed over", block.keyword));
                });
            }
            Some(_) => {}
            None => tell(unknown(deck, block)?),
        }
    }
    Ok(told.into_iter().map(|(what, (count, place))| said(&what, count, &place)).collect())
}

/// Whether a block is a surface of nodes that no contact pair names.
fn is_spare(deck: &DeckText, block: &Block) -> bool {
    let Some(name) = block.option("NAME").filter(|_| block.keyword == "SURFACE") else { return false };
    let is_name = |cell: &&str| cell.rsplit('.').next().is_some_and(|own| own.eq_ignore_ascii_case(&name));
    let mut pairs = deck.blocks.iter().filter(|b| b.keyword == "CONTACT PAIR");
    let of_nodes = block.option("TYPE").as_deref() == Some("node");
    of_nodes && !pairs.any(|pair| pair.rows().any(|(_, cells)| cells.iter().any(is_name)))
}

/// What is said of a keyword that Abaqus does not have.
fn unknown(deck: &DeckText, block: &Block) -> Result<String, DeckError> {
    let read = KEYWORDS.iter().filter(|(_, k)| k.class == Class::Obeyed).map(|(name, _)| *name);
    let hint = did_you_mean(&block.keyword, read);
    if !hint.is_empty() {
        return Err(deck.error(block, block.line, format!("Abaqus has no such keyword{hint}")));
    }
    Ok(format!("*{} is passed over: Abaqus' manual of 2024 has no such keyword", block.keyword))
}

fn said(what: &str, count: usize, place: &str) -> Notice {
    let text = if count == 1 { format!("{place}: {what}") } else { format!("{place}: {what} ({count} times)") };
    Kind::KeywordPassedOver.notice(text).count(count)
}

/// Counted notices, each with the place where it was met first.
#[derive(Default)]
pub(crate) struct Counted(BTreeMap<String, (usize, usize)>);

impl Counted {
    /// Counts what is said of an element.
    pub(crate) fn tell(&mut self, tree: &Tree<'_>, node: Node<'_, '_>, what: String) {
        self.0.entry(what).or_insert_with(|| (0, tree.line(node))).0 += 1;
    }

    /// What is told: once a kind, with the place of the first and how many there are.
    pub(crate) fn told(self, tree: &Tree<'_>) -> Vec<Notice> {
        let said = |(what, (count, line)): (String, (usize, usize))| {
            let times = if count == 1 { String::new() } else { format!(" ({count} times)") };
            let text = format!("{}:{line}: {what}{times}", tree.file);
            Kind::KeywordPassedOver.notice(text).count(count)
        };
        self.0.into_iter().map(said).collect()
    }
}
