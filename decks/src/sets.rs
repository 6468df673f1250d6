//! Sets of a deck, and names looked up: in the instance where they stand, in the assembly, in any one instance.

use super::keyword::{Block, DeckText};
use super::model::{DeckModel, label};
use super::place::{Scoped, Scopes};
use crate::DeckError;
use std::collections::{BTreeMap, BTreeSet};

/// All sets of a deck together list no more members than this.
const MOST_MEMBERS: u64 = 20_000_000;

impl DeckModel {
    /// Reads the sets; one that names a set defined further below waits for it.
    pub(super) fn read_sets(&mut self, deck: &DeckText, blocks: &[Scoped]) -> Result<(), DeckError> {
        let mut waiting: Vec<Scoped> =
            blocks.iter().filter(|at| ["NSET", "ELSET"].contains(&at.block.keyword.as_str())).copied().collect();
        while !waiting.is_empty() {
            let before = waiting.len();
            let mut still = Vec::new();
            for at in waiting {
                match self.missing(&at) {
                    Some(_) => still.push(at),
                    None => self.read_set(deck, &at)?,
                }
            }
            if still.len() == before {
                let at = &still[0];
                let (line, name) = self.missing(at).unwrap_or_default();
                let what = format!("the set \"{name}\" is not defined in this deck");
                return Err(deck.error(at.block, line, what));
            }
            waiting = still;
        }
        Ok(())
    }

    /// The first set that a set names and that is not there, with its line.
    fn missing(&self, at: &Scoped) -> Option<(usize, String)> {
        let block = at.block;
        let scope = self.scope_of(at);
        let nodes = block.keyword == "NSET";
        let there = |name: &str, nodes: bool| match nodes {
            true => self.found(&self.nsets, scope, name).is_some(),
            false => self.found(&self.elsets, scope, name).is_some(),
        };
        if let Some(of) = block.option("ELSET").filter(|of| nodes && !there(of, false)) {
            return Some((block.line, of));
        }
        if block.options.contains_key("GENERATE") {
            return None;
        }
        let rows = block.rows().flat_map(|(line, cells)| cells.into_iter().map(move |c| (line, c)));
        let mut names = rows.filter(|(_, c)| !c.is_empty() && c.parse::<u64>().is_err());
        names.find(|(_, c)| !there(c, nodes) && self.scoped_label(c).is_none()).map(|(line, c)| (line, c.to_owned()))
    }

    /// The scope that a block's labels and names are of: its own, or that of its INSTANCE=.
    fn scope_of(&self, at: &Scoped) -> usize {
        at.block.option("INSTANCE").and_then(|name| self.scopes.find(&name)).unwrap_or(at.scope)
    }

    fn read_set(&mut self, deck: &DeckText, at: &Scoped) -> Result<(), DeckError> {
        let block = at.block;
        let nodes = block.keyword == "NSET";
        let Some(name) = block.option(&block.keyword) else {
            return Err(deck.error(block, block.line, format!("{}= is missing", block.keyword)));
        };
        let name = self.scopes.name(at.scope, &name);
        let scope = self.scope_of(at);
        let mut members: Vec<u64> = Vec::new();
        if let Some(set) = block.option("ELSET").filter(|_| nodes).and_then(|s| self.found(&self.elsets, scope, &s)) {
            let elements = self.elsets.get(&set).into_iter().flatten();
            members.extend(elements.flat_map(|&e| self.elements[e].nodes.iter().copied()));
            members.sort_unstable();
            members.dedup();
            self.count(deck, block, block.line, members.len() as u64)?;
        }
        let mut places: Vec<usize> = Vec::new();
        for (line, cells) in block.rows() {
            let mut own: Vec<u64> = Vec::new();
            if block.options.contains_key("GENERATE") {
                own = self.generated(deck, block, line, &cells)?;
            } else {
                for cell in cells.iter().filter(|c| !c.is_empty()) {
                    match cell.parse::<u64>() {
                        Ok(id) => own.push(id),
                        Err(_) => self.member(deck, (block, line, scope), cell, &mut members, &mut places)?,
                    }
                }
            }
            if nodes {
                members.extend(own.into_iter().filter_map(|id| self.known_node(scope, id)));
            } else {
                places.extend(own.iter().filter_map(|id| self.known_element(scope, *id)));
            }
        }
        if nodes {
            add(self.nsets.entry(name).or_default(), members);
        } else {
            add(self.elsets.entry(name).or_default(), places);
        }
        Ok(())
    }

    /// The labels of a GENERATE row.
    fn generated(
        &mut self,
        deck: &DeckText,
        block: &Block,
        line: usize,
        cells: &[&str],
    ) -> Result<Vec<u64>, DeckError> {
        let first = label(deck, block, line, cells.first())?;
        let last = label(deck, block, line, cells.get(1))?;
        let step = cells.get(2).map_or(Ok(1), |c| label(deck, block, line, Some(c)))?.max(1);
        let count = last.checked_sub(first).map_or(u64::MAX, |span| span / step);
        self.count(deck, block, line, count)?;
        Ok((first..=last).step_by(step as usize).collect())
    }

    /// Adds what a name, or `instance.label`, in a set stands for.
    fn member(
        &mut self,
        deck: &DeckText,
        (block, line, scope): (&Block, usize, usize),
        cell: &str,
        members: &mut Vec<u64>,
        places: &mut Vec<usize>,
    ) -> Result<(), DeckError> {
        let nodes = block.keyword == "NSET";
        if let Some((scope, label)) = self.scoped_label(cell) {
            members.extend(Scopes::node(scope, label).filter(|id| nodes && self.nodes.contains_key(id)));
            places.extend(self.known_element(scope, label).filter(|_| !nodes));
            return Ok(());
        }
        let size = match nodes {
            true => self.found(&self.nsets, scope, cell).and_then(|s| self.nsets.get(&s)).map_or(0, Vec::len),
            false => self.found(&self.elsets, scope, cell).and_then(|s| self.elsets.get(&s)).map_or(0, Vec::len),
        };
        self.count(deck, block, line, size as u64)?;
        if nodes {
            let set = self.found(&self.nsets, scope, cell).unwrap_or_default();
            members.extend(self.nsets.get(&set).into_iter().flatten());
        } else {
            let set = self.found(&self.elsets, scope, cell).unwrap_or_default();
            places.extend(self.elsets.get(&set).into_iter().flatten());
        }
        Ok(())
    }

    /// Counts members listed in sets; refuses what no deck needs.
    fn count(&mut self, deck: &DeckText, block: &Block, line: usize, more: u64) -> Result<(), DeckError> {
        self.listed = self.listed.saturating_add(more);
        if self.listed > MOST_MEMBERS {
            return Err(deck.error(block, line, format!("the deck's sets list more than {MOST_MEMBERS} members")));
        }
        Ok(())
    }

    /// Gives sets and surfaces of instances their short names too, where only one has it.
    pub(super) fn short_names(&mut self) {
        let mut ambiguous = std::mem::take(&mut self.ambiguous);
        short(&mut self.nsets, &mut ambiguous);
        short(&mut self.elsets, &mut ambiguous);
        short(&mut self.surfaces, &mut ambiguous);
        self.ambiguous = ambiguous;
    }

    /// The full name of a set or surface, as seen from a scope.
    pub(super) fn found<T>(&self, map: &BTreeMap<String, T>, scope: usize, name: &str) -> Option<String> {
        let own = self.scopes.name(scope, name);
        if map.contains_key(&own) {
            return Some(own);
        }
        let plain = name.to_lowercase();
        if map.contains_key(&plain) {
            return Some(plain);
        }
        let mut others = self.scopes.instances().map(|k| self.scopes.name(k, name)).filter(|n| map.contains_key(n));
        others.next().filter(|_| others.next().is_none())
    }

    fn looked_up<T>(
        &self,
        map: &BTreeMap<String, T>,
        what: &str,
        (deck, at, line): (&DeckText, &Scoped, usize),
        name: &str,
    ) -> Result<String, DeckError> {
        self.found(map, at.scope, name).ok_or_else(|| {
            let why = match self.ambiguous.contains(&name.to_lowercase()) {
                true => "is in several instances; write INSTANCE.NAME",
                false => "is not defined in this deck",
            };
            deck.error(at.block, line, format!("the {what} \"{name}\" {why}"))
        })
    }

    /// The full name of an element set.
    pub(super) fn element_set(
        &self,
        deck: &DeckText,
        at: &Scoped,
        line: usize,
        name: &str,
    ) -> Result<String, DeckError> {
        self.looked_up(&self.elsets, "element set", (deck, at, line), name)
    }

    /// The full name of a node set.
    pub(super) fn node_set(&self, deck: &DeckText, at: &Scoped, line: usize, name: &str) -> Result<String, DeckError> {
        self.looked_up(&self.nsets, "node set", (deck, at, line), name)
    }

    /// The full name of a surface; of an element set where no surface has the name.
    pub(super) fn surface_name(
        &self,
        deck: &DeckText,
        at: &Scoped,
        line: usize,
        name: &str,
    ) -> Result<String, DeckError> {
        let surface = self.looked_up(&self.surfaces, "surface", (deck, at, line), name);
        surface.or_else(|e| self.found(&self.elsets, at.scope, name).ok_or(e))
    }

    /// The scope and label of `instance.label`.
    fn scoped_label(&self, cell: &str) -> Option<(usize, u64)> {
        let (instance, label) = cell.rsplit_once('.')?;
        Some((self.scopes.find(instance)?, label.parse().ok()?))
    }

    /// The node of a label, as seen from a scope: its own, else the assembly's, else that of the only instance that has it.
    fn known_node(&self, scope: usize, label: u64) -> Option<u64> {
        let there = |scope| Scopes::node(scope, label).filter(|id| self.nodes.contains_key(id));
        there(scope).or_else(|| there(0)).or_else(|| {
            let mut others = self.scopes.instances().filter_map(there);
            others.next().filter(|_| others.next().is_none())
        })
    }

    /// The element of a label, as [`DeckModel::known_node`].
    fn known_element(&self, scope: usize, label: u64) -> Option<usize> {
        let there = |scope: usize| self.labels.get(&(scope, label)).copied();
        there(scope).or_else(|| there(0)).or_else(|| {
            let mut others = self.scopes.instances().filter_map(there);
            others.next().filter(|_| others.next().is_none())
        })
    }

    /// A node of an element; of one that is not defined, the label stands.
    pub(super) fn element_node(&self, deck: &DeckText, at: &Scoped, line: usize, cell: &str) -> Result<u64, DeckError> {
        if let Some((scope, own)) = self.scoped_label(cell) {
            return Scopes::node(scope, own)
                .filter(|id| self.nodes.contains_key(id))
                .ok_or_else(|| deck.error(at.block, line, format!("node {cell} is not defined in this deck")));
        }
        let own = label(deck, at.block, line, Some(&cell))?;
        self.known_node(at.scope, own).ok_or_else(|| {
            let several = self.scopes.instances().count() > 1;
            let hint = if several { ", or is in several instances: write INSTANCE.LABEL" } else { "" };
            deck.error(at.block, line, format!("node {cell} is not defined in this deck{hint}"))
        })
    }

    /// A node by label, or the one node of a set.
    pub(super) fn node(&self, deck: &DeckText, at: &Scoped, line: usize, cell: &str) -> Result<u64, DeckError> {
        if cell.parse::<u64>().is_ok() || self.scoped_label(cell).is_some() {
            return self.element_node(deck, at, line, cell);
        }
        let set = self.found(&self.nsets, at.scope, cell);
        match set.and_then(|set| self.nsets.get(&set)).map(Vec::as_slice) {
            Some([id]) => Ok(*id),
            _ => Err(deck.error(at.block, line, format!("\"{cell}\" is neither a node label nor a set of one node"))),
        }
    }
}

/// Adds members that a set has not yet: a set holds each once, however often it is listed.
fn add<T: Copy + Ord>(set: &mut Vec<T>, members: Vec<T>) {
    let mut there: BTreeSet<T> = set.iter().copied().collect();
    set.extend(members.into_iter().filter(|m| there.insert(*m)));
}

/// Copies what only one instance has to its short name; names that several have are noted.
fn short<T: Clone>(map: &mut BTreeMap<String, T>, ambiguous: &mut BTreeSet<String>) {
    let mut seen: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for full in map.keys() {
        if let Some((_, name)) = full.split_once('.') {
            seen.entry(name.to_owned()).or_default().push(full.clone());
        }
    }
    for (name, full) in seen.into_iter().filter(|(name, _)| !map.contains_key(name)).collect::<Vec<_>>() {
        if let [one] = &full[..] {
            map.extend(map.get(one).cloned().map(|value| (name, value)));
        } else {
            ambiguous.insert(name);
        }
    }
}
