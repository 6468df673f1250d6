//! Files of elements held against the table of a program: what is read, passed over, told, or refused. One walk for every program.

use crate::DeckError;
use crate::known::{Class, Counted, Known, rows};
use crate::tree::{Tree, brief, name_of, shown};
use notices::Notice;
use roxmltree::Node;
use sim::names::did_you_mean;
use std::collections::{BTreeMap, BTreeSet};

/// Between the name of an element and its type in a row's name: `contact:sliding-elastic`.
const TYPE: char = ':';

/// How a program's elements are made, and what messages call them.
pub(crate) struct Program {
    /// Its name.
    pub(crate) name: &'static str,
    /// What is said of an element that is not in the table.
    pub(crate) unknown: &'static str,
    /// What its elements are made of: properties, parameters.
    pub(crate) part: &'static str,
    /// Whether the parts hold elements; else they hold numbers alone, and attributes (`@name`) are parts, too.
    pub(crate) parts_hold_elements: bool,
    /// An attribute by which an element stands in another file, and what is said of it; the file's name stands for `{}`.
    pub(crate) elsewhere: Option<(&'static str, &'static str)>,
}

/// The elements of a program.
pub(crate) struct Table {
    program: Program,
    /// By their names, with the type where the program parts the element by types.
    pub(crate) rows: BTreeMap<&'static str, Known>,
    /// Elements that are parted by their types.
    typed: BTreeSet<&'static str>,
}

/// The elements that are read, in the order of the file, and what is told of the others.
pub(crate) struct Judged<'a, 'i> {
    pub(crate) objects: Vec<Node<'a, 'i>>,
    pub(crate) told: Vec<Notice>,
}

impl Table {
    /// Of the table's text ([`rows`]).
    pub(crate) fn new(program: Program, text: &'static str) -> Table {
        let rows = rows(text, ' ');
        let typed = rows.keys().filter_map(|name| Some(name.split_once(TYPE)?.0)).collect();
        Table { program, rows, typed }
    }

    /// The name of an element in the table.
    pub(crate) fn key(&self, node: Node<'_, '_>) -> String {
        let name = node.tag_name().name();
        match node.attribute("type") {
            Some(kind) if self.typed.contains(name) => format!("{name}{TYPE}{}", kind.trim()),
            _ => name.to_owned(),
        }
    }

    /// Holds `root` and every element in it against the table.
    ///
    /// # Errors
    /// An element that is refused, or one that the program does not have and that resembles one that is read.
    pub(crate) fn judge<'a, 'i>(&self, tree: &Tree<'_>, root: Node<'a, 'i>) -> Result<Judged<'a, 'i>, DeckError> {
        let mut told = Counted::default();
        let mut objects = Vec::new();
        let mut open = vec![root];
        while let Some(object) = open.pop() {
            let key = self.key(object);
            let Some(known) = self.rows.get(key.as_str()) else {
                told.tell(tree, object, self.unknown(tree, object, &key)?);
                continue;
            };
            if let Some((file, what)) =
                self.program.elsewhere.and_then(|(by, what)| Some((object.attribute(by)?, what)))
            {
                return Err(tree.error(object, what.replace("{}", &brief(file))));
            }
            match known.class {
                Class::Refused => {
                    return Err(tree.error(object, format!("{} is not read: it {}", spoken(&key), known.why)));
                }
                Class::Told => told.tell(tree, object, format!("{} is passed over: {}", spoken(&key), known.why)),
                Class::Harmless => {}
                Class::Obeyed => {
                    objects.push(object);
                    let mut within = self.inner(tree, object, known, &mut told)?;
                    within.reverse();
                    open.extend(within);
                }
            }
        }
        Ok(Judged { objects, told: told.told(tree) })
    }

    /// The elements within an element: those of its parts, and those that have a row of their own. Its parts are held against its row.
    fn inner<'a, 'i>(
        &self,
        tree: &Tree<'_>,
        object: Node<'a, 'i>,
        known: &Known,
        told: &mut Counted,
    ) -> Result<Vec<Node<'a, 'i>>, DeckError> {
        let Program { part: of_what, parts_hold_elements, .. } = self.program;
        let (mut found, owner) = (Vec::new(), object.tag_name().name());
        if !parts_hold_elements {
            attributes(tree, object, known, told)?;
        }
        let is_bare = !parts_hold_elements && known.parts.iter().all(|p| p.starts_with('@'));
        for part in object.children().filter(Node::is_element) {
            let name = part.tag_name().name();
            if known.parts.contains(&name) {
                match parts_hold_elements {
                    true => found.extend(part.children().filter(Node::is_element)),
                    false => told_of_part(tree, owner, part, told),
                }
            } else if self.rows.contains_key(self.key(part).as_str()) {
                found.push(part);
            } else {
                let hint = did_you_mean(name, known.parts.iter().copied());
                if !hint.is_empty() {
                    return Err(tree.error(part, format!("{} has no such {of_what}{hint}", shown(object))));
                }
                if self.typed.contains(name) || is_bare {
                    found.push(part);
                } else {
                    told.tell(tree, part, format!("{owner}: the {of_what} {name} is passed over"));
                }
            }
        }
        Ok(found)
    }

    /// What is said of an element that the program does not have. Where elements have names, one without is none that was misspelt.
    fn unknown(&self, tree: &Tree<'_>, object: Node<'_, '_>, key: &str) -> Result<String, DeckError> {
        let read = self.rows.iter().filter(|(_, k)| k.class == Class::Obeyed).map(|(name, _)| *name);
        let hint = did_you_mean(key, read);
        let named = !self.program.parts_hold_elements || !name_of(object).is_empty();
        if !hint.is_empty() && named {
            let what = format!("{} has no {}{}", self.program.name, spoken(key), spoken(&hint));
            return Err(tree.error(object, what));
        }
        Ok(format!("{} is passed over: {}", spoken(key), self.program.unknown))
    }
}

/// A row's name in a message.
fn spoken(key: &str) -> String {
    key.replacen(TYPE, " ", 1)
}

/// Holds the attributes of an element against its row.
fn attributes(tree: &Tree<'_>, object: Node<'_, '_>, known: &Known, told: &mut Counted) -> Result<(), DeckError> {
    let own = || known.parts.iter().filter_map(|p| p.strip_prefix('@'));
    for name in object.attributes().map(|a| a.name()).filter(|name| !own().any(|a| a == *name)) {
        let hint = did_you_mean(name, own());
        if !hint.is_empty() {
            return Err(tree.error(object, format!("it has no attribute {name}{hint}")));
        }
        told.tell(tree, object, format!("{}: the attribute {name} is passed over", object.tag_name().name()));
    }
    Ok(())
}

/// Tells of a parameter that is more than its number.
fn told_of_part(tree: &Tree<'_>, owner: &str, part: Node<'_, '_>, told: &mut Counted) {
    let name = part.tag_name().name();
    if let Some(odd) = part.attributes().find(|a| !["type", "name", "id"].contains(&a.name())) {
        let what = match odd.name() {
            "lc" => format!("{owner}: {name} follows a load curve there; its own number is taken"),
            other => format!("{owner}: the attribute {other} of {name} is passed over"),
        };
        told.tell(tree, part, what);
    }
}
