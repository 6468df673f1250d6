//! From keyword blocks to the tables of a deck: nodes, elements, sets, ties, connectors, contact.

use super::keyword::{Block, DeckText};
use super::place::{self, Scoped, Scopes};
use crate::DeckError;
use meshes::{Isometry, Point};
use notices::{Kind, Notice};
use std::collections::{BTreeMap, BTreeSet};

/// An element.
#[derive(Clone, Debug, PartialEq)]
pub struct Element {
    /// Type, upper case.
    pub kind: String,
    /// Node labels.
    pub nodes: Vec<u64>,
    /// Where the deck defines it: its file's number and the line.
    pub at: (usize, usize),
}

/// A connector section.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Connector {
    /// Element set, lower case.
    pub elset: String,
    /// Connection type, lower case.
    pub kind: String,
    /// Orientation's name, lower case.
    pub orientation: Option<String>,
    /// Behaviour's name, lower case.
    pub behaviour: Option<String>,
    /// Where the deck defines it: its file's number and the line.
    pub at: (usize, usize),
    /// Whether it is a set of springs (SPRINGA) and no connector.
    pub spring: bool,
}

/// A connector behaviour along its first component.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Behaviour {
    /// Force [N], displacement [mm].
    pub elastic: Vec<[f64; 2]>,
    /// Damping [N s/mm].
    pub damping: f64,
}

/// A surface interaction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Interaction {
    /// Pressure [MPa], overclosure [mm].
    pub table: Vec<[f64; 2]>,
    /// Coulomb friction [-].
    pub friction: f64,
    /// Contact damping.
    pub damping: f64,
}

/// A node that is defined twice within this is the same [mm]: rounding of the text.
const SAME_PLACE_MM: f64 = 1e-6;

/// The interaction of deformable menisci in a deck that this crate writes.
pub(crate) const MENISCI: &str = "MENISCUS_INTERACT";

/// A contact pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Surfaces, lower case.
    pub surfaces: [String; 2],
    /// Interaction's name, lower case.
    pub interaction: String,
    /// Where the deck defines it: its file's number and the line.
    pub at: (usize, usize),
}

/// A deck's tables; set, surface and behaviour names in lower case.
#[derive(Clone, Debug, Default)]
pub struct DeckModel {
    /// First line of *HEADING.
    pub heading: Option<String>,
    /// Node positions by label [mm].
    pub nodes: BTreeMap<u64, Point>,
    /// Elements in order.
    pub elements: Vec<Element>,
    /// Element numbers (places in `elements`) by scope and label, the last of a label.
    pub(super) labels: BTreeMap<(usize, u64), usize>,
    /// Node sets; a set of a part goes by `instance.set`, and by `set` where no other has this name.
    pub nsets: BTreeMap<String, Vec<u64>>,
    /// Element sets, as numbers into `elements`.
    pub elsets: BTreeMap<String, Vec<usize>>,
    /// Surfaces: element sets and faces.
    pub surfaces: BTreeMap<String, Vec<(String, String)>>,
    /// Rigid bodies: element set and reference node.
    pub rigid: Vec<(String, u64)>,
    /// Pairs of nodes tied by beams (multi-point constraints).
    pub ties: Vec<[u64; 2]>,
    /// Mass by element set [tonne].
    pub mass: BTreeMap<String, f64>,
    /// Rotary inertia by element set [tonne mm2].
    pub inertia: BTreeMap<String, f64>,
    /// Connector sections.
    pub connectors: Vec<Connector>,
    /// Orientations by nodes.
    pub orientations: BTreeMap<String, [u64; 3]>,
    /// Connector behaviours.
    pub behaviours: BTreeMap<String, Behaviour>,
    /// Surface interactions.
    pub interactions: BTreeMap<String, Interaction>,
    /// Contact pairs.
    pub pairs: Vec<Pair>,
    /// Nodes held in all directions.
    pub fixed: Vec<u64>,
    /// Whether the deck has a step: one without was cut short.
    pub(super) has_step: bool,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// The assembly and its instances.
    pub(super) scopes: Scopes,
    /// Names of files.
    files: Vec<String>,
    /// Members listed in sets so far.
    pub(super) listed: u64,
    /// Names that several instances give to sets or surfaces.
    pub(super) ambiguous: BTreeSet<String>,
    /// Nodes, elements and rows that were told of, by kind and place of the first.
    odd: BTreeMap<String, (usize, String)>,
}

/// Which definition the sub-keywords belong to.
#[derive(Default)]
struct Context {
    behaviour: String,
    interaction: String,
}

impl DeckModel {
    /// Collects the tables: nodes, then elements, then sets, then what names these.
    ///
    /// # Errors
    /// A keyword that is refused; a data line that does not hold what its keyword needs, or names what is not there.
    pub fn new(deck: &DeckText) -> Result<DeckModel, DeckError> {
        let warnings = super::known::judge(deck)?;
        let (blocks, scopes) = place::flat(deck)?;
        let has_step = deck.blocks.iter().any(|b| b.keyword == "STEP");
        let mut model = DeckModel { has_step, warnings, scopes, files: deck.files.clone(), ..DeckModel::default() };
        model.read_nodes(deck, &blocks)?;
        for at in blocks.iter().filter(|at| at.block.keyword == "ELEMENT") {
            model.read_elements(deck, at)?;
        }
        model.read_sets(deck, &blocks)?;
        for at in blocks.iter().filter(|at| at.block.keyword == "SURFACE") {
            model.read_surface(deck, at)?;
        }
        model.short_names();
        let mut context = Context::default();
        for at in &blocks {
            model.block(deck, at, &mut context)?;
        }
        let odd = std::mem::take(&mut model.odd);
        model.warnings.extend(
            odd.into_iter()
                .map(|(what, (count, place))| Kind::DeckOdd.notice(format!("{place}: {count} {what}")).count(count)),
        );
        Ok(model)
    }

    fn block(&mut self, deck: &DeckText, at: &Scoped, context: &mut Context) -> Result<(), DeckError> {
        let block = at.block;
        match block.keyword.as_str() {
            "HEADING" => self.heading = block.data.first().map(|(_, t)| t.clone()),
            "RIGID BODY" => self.read_rigid(deck, at)?,
            "MPC" => self.read_ties(deck, at)?,
            "MASS" | "ROTARY INERTIA" => self.read_mass(deck, at)?,
            "BOUNDARY" => self.read_boundary(deck, at)?,
            "CONTACT PAIR" => self.read_pair(deck, at)?,
            "CONNECTOR SECTION" => self.read_connector(deck, at)?,
            "SPRING" => self.read_spring(deck, at)?,
            "ORIENTATION" => self.read_orientation(deck, at)?,
            "CONNECTOR BEHAVIOR" => context.behaviour = name_of(deck, block)?,
            "SURFACE INTERACTION" => context.interaction = name_of(deck, block)?,
            "CONNECTOR ELASTICITY" | "CONNECTOR DAMPING" => self.read_behaviour(deck, block, &context.behaviour)?,
            "SURFACE BEHAVIOR" | "FRICTION" | "CONTACT DAMPING" => {
                self.read_interaction(deck, block, &context.interaction)?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Counts something odd, told of once with the place of the first.
    pub(super) fn tell(&mut self, deck: &DeckText, block: &Block, line: usize, what: String) {
        let place = || format!("{}:{line}", deck.files.get(block.file).map_or("", String::as_str));
        self.odd.entry(what).or_insert_with(|| (0, place())).0 += 1;
    }

    /// A complaint about what a line of the deck defined.
    pub(super) fn error(&self, (file, line): (usize, usize), message: impl Into<String>) -> DeckError {
        DeckError { file: self.files.get(file).cloned().unwrap_or_default(), line, message: message.into() }
    }

    /// Reads the nodes of all scopes, each where its system and its instance put it.
    fn read_nodes(&mut self, deck: &DeckText, blocks: &[Scoped]) -> Result<(), DeckError> {
        let (mut system, mut scope) = (Isometry::identity(), 0);
        for at in blocks {
            if at.scope != scope {
                (system, scope) = (Isometry::identity(), at.scope);
            }
            match at.block.keyword.as_str() {
                "SYSTEM" => system = place::system(deck, at.block)?,
                "NODE" => self.read_node(deck, at, &system)?,
                _ => {}
            }
        }
        Ok(())
    }

    fn read_node(&mut self, deck: &DeckText, at: &Scoped, system: &Isometry) -> Result<(), DeckError> {
        let block = at.block;
        let set = block.option("NSET").map(|set| self.scopes.name(at.scope, &set));
        for (line, cells) in block.rows() {
            let id = label(deck, block, line, cells.first())?;
            let Some(id) = Scopes::node(at.scope, id) else {
                return Err(deck.error(block, line, format!("label {id} is larger than Abaqus' largest")));
            };
            let mut p = [0.0; 3];
            for (x, cell) in p.iter_mut().zip(cells.iter().skip(1)) {
                *x = deck.number(block, line, cell)?;
            }
            let further = cells.get(4..).unwrap_or(&[]);
            if let Some(what) = not_a_normal(further, &deck.numbers(block, line, further)?) {
                return Err(deck.error(block, line, what));
            }
            let p = self.scopes.place(at.scope, &(system * place::cartesian(deck, block, p)?));
            if self.nodes.insert(id, p).is_some_and(|old| (old - p).norm() > SAME_PLACE_MM) {
                let what = "nodes are defined a second time at another place; the last one is taken, as Abaqus does";
                self.tell(deck, block, line, what.into());
            }
            if let Some(set) = &set {
                self.nsets.entry(set.clone()).or_default().push(id);
            }
        }
        Ok(())
    }

    fn read_elements(&mut self, deck: &DeckText, at: &Scoped) -> Result<(), DeckError> {
        let block = at.block;
        let Some(kind) = block.options.get("TYPE").map(|k| k.to_uppercase()) else {
            return Err(deck.error(block, block.line, "TYPE= is missing"));
        };
        let set = block.option("ELSET").map(|set| self.scopes.name(at.scope, &set));
        let wanted = node_count(&kind);
        let (mut own, mut nodes): (Option<u64>, Vec<u64>) = (None, Vec::new());
        let last = block.data.last().map_or(0, |(line, _)| *line);
        for ((line, cells), (_, text)) in block.rows().zip(&block.data) {
            for cell in &cells {
                match own {
                    None => own = Some(label(deck, block, line, Some(cell))?),
                    Some(_) => nodes.push(self.element_node(deck, at, line, cell)?),
                }
            }
            let continues = match wanted {
                Some(n) => nodes.len() < n,
                None => text.ends_with(','),
            };
            if continues && line != last {
                continue;
            }
            let Some(id) = own.take().filter(|_| !nodes.is_empty() && wanted.is_none_or(|n| nodes.len() == n)) else {
                let expected = wanted.map_or("nodes".to_owned(), |n| format!("{n} nodes"));
                let found = nodes.len();
                let what = format!("element of type {kind} with {found} nodes, expected {expected}");
                return Err(deck.error(block, line, what));
            };
            if self.labels.insert((at.scope, id), self.elements.len()).is_some() {
                self.tell(deck, block, line, "elements have the label of another; both are kept".into());
            }
            if let Some(set) = &set {
                self.elsets.entry(set.clone()).or_default().push(self.elements.len());
            }
            let at = (block.file, line);
            self.elements.push(Element { kind: kind.clone(), nodes: std::mem::take(&mut nodes), at });
        }
        Ok(())
    }

    fn read_surface(&mut self, deck: &DeckText, at: &Scoped) -> Result<(), DeckError> {
        let block = at.block;
        let Some(name) = block.option("NAME") else { return Ok(()) };
        let mut parts = Vec::new();
        let of_nodes = block.option("TYPE").as_deref() == Some("node");
        for (line, cells) in block.rows() {
            if let Some(set) = cells.first() {
                let face = cells.get(1).map_or(String::new(), |f| f.to_uppercase());
                let known = self.found(&self.elsets, at.scope, set);
                parts.push((known.unwrap_or_else(|| set.to_lowercase()), face));
                if !of_nodes && parts.len() > 1 && parts[0].0 != parts[parts.len() - 1].0 {
                    let what = "surfaces list several element sets; only the first makes the contact face";
                    self.tell(deck, block, line, what.into());
                }
            }
        }
        self.surfaces.entry(self.scopes.name(at.scope, &name)).or_default().extend(parts);
        Ok(())
    }

    fn read_rigid(&mut self, deck: &DeckText, at: &Scoped) -> Result<(), DeckError> {
        let block = at.block;
        let Some(node) = block.option("REF NODE") else {
            return Err(deck.error(block, block.line, "ELSET= and REF NODE= expected"));
        };
        let node = self.node(deck, at, block.line, &node)?;
        for (line, cells) in block.rows() {
            if deck.numbers(block, line, &cells)?.first().is_some_and(|thickness| *thickness != 0.0) {
                let what = "rigid bodies have a thickness, half of which Abaqus puts before their surface in contact; here they have none";
                self.tell(deck, block, line, what.into());
            }
        }
        let mut named = false;
        if let Some(set) = block.option("ELSET") {
            let set = self.element_set(deck, at, block.line, &set)?;
            self.rigid.push((set, node));
            named = true;
        }
        for set in ["TIE NSET", "PIN NSET"].iter().filter_map(|o| block.option(o)) {
            let set = self.node_set(deck, at, block.line, &set)?;
            self.ties.extend(self.nsets.get(&set).into_iter().flatten().map(|n| [*n, node]));
            named = true;
        }
        match named {
            true => Ok(()),
            false => Err(deck.error(block, block.line, "ELSET= and REF NODE= expected")),
        }
    }

    fn read_ties(&mut self, deck: &DeckText, at: &Scoped) -> Result<(), DeckError> {
        let block = at.block;
        for (line, cells) in block.rows() {
            if cells.first().is_some_and(|c| c.eq_ignore_ascii_case("beam") || c.eq_ignore_ascii_case("tie")) {
                if let [_, a, b, ..] = cells[..] {
                    let tie = [self.node(deck, at, line, a)?, self.node(deck, at, line, b)?];
                    self.ties.push(tie);
                } else {
                    return Err(deck.error(block, line, "two nodes expected"));
                }
            } else {
                let kind = cells.first().unwrap_or(&"").to_uppercase();
                self.tell(deck, block, line, format!("rows of *MPC are of type {kind}; only BEAM and TIE are read"));
            }
        }
        Ok(())
    }

    fn read_mass(&mut self, deck: &DeckText, at: &Scoped) -> Result<(), DeckError> {
        let block = at.block;
        let Some(set) = block.option("ELSET") else {
            return Err(deck.error(block, block.line, "ELSET= is missing"));
        };
        let set = self.element_set(deck, at, block.line, &set)?;
        if let Some((line, cells)) = block.rows().next() {
            let value = deck.number(block, line, cells.first().unwrap_or(&""))?;
            let table = if block.keyword == "MASS" { &mut self.mass } else { &mut self.inertia };
            if table.insert(set, value).is_some_and(|old| old.to_bits() != value.to_bits()) {
                let what = format!("sets have a second *{}; the last one is taken", block.keyword);
                self.tell(deck, block, line, what);
            }
        }
        Ok(())
    }

    fn read_boundary(&mut self, deck: &DeckText, at: &Scoped) -> Result<(), DeckError> {
        let block = at.block;
        for (line, cells) in block.rows() {
            let whole = cells.get(1).is_some_and(|c| c.eq_ignore_ascii_case("encastre"))
                || (cells.get(1) == Some(&"1") && cells.get(2) == Some(&"6"));
            if whole {
                let node = self.node(deck, at, line, cells[0])?;
                if !self.fixed.contains(&node) {
                    self.fixed.push(node);
                }
            } else if !cells.is_empty() {
                let what = "rows of *BOUNDARY hold less than all six directions; only ENCASTRE (1 to 6) is read";
                self.tell(deck, block, line, what.into());
            }
        }
        Ok(())
    }

    fn read_pair(&mut self, deck: &DeckText, at: &Scoped) -> Result<(), DeckError> {
        let block = at.block;
        // a model has no deformable menisci to make of these
        if block.option("INTERACTION").is_some_and(|name| name.eq_ignore_ascii_case(MENISCI)) {
            return Ok(());
        }
        for (line, cells) in block.rows() {
            let [a, b, ..] = cells[..] else {
                return Err(deck.error(block, line, "two surfaces expected"));
            };
            let surface = |name: &str| self.surface_name(deck, at, line, name);
            let pair = Pair {
                surfaces: [surface(a)?, surface(b)?],
                interaction: block.option("INTERACTION").unwrap_or_default(),
                at: (block.file, line),
            };
            if !self.pairs.contains(&pair) {
                self.pairs.push(pair);
            }
        }
        Ok(())
    }

    /// A connector section: its kind, and its orientation in the scope where it stands.
    fn read_connector(&mut self, deck: &DeckText, at: &Scoped) -> Result<(), DeckError> {
        let block = at.block;
        let Some(set) = block.option("ELSET") else {
            return Err(deck.error(block, block.line, "ELSET= is missing"));
        };
        let elset = self.element_set(deck, at, block.line, &set)?;
        if let Some((line, cells)) = block.rows().next()
            && let Some(second) = cells.get(1).filter(|c| !c.is_empty())
        {
            let what = format!(
                "connector sections have a second type of connection, {}; only the first is read",
                second.to_uppercase()
            );
            self.tell(deck, block, line, what);
        }
        let mut rows = block.rows();
        let mut first = || rows.next().and_then(|(_, c)| c.first().map(|s| s.to_lowercase()));
        let kind = first().unwrap_or_default();
        let orientation = first().map(|name| self.scopes.name(at.scope, &name));
        let behaviour = block.option("BEHAVIOR");
        self.connectors.push(Connector {
            elset,
            kind,
            orientation,
            behaviour,
            at: (block.file, block.line),
            spring: false,
        });
        Ok(())
    }

    /// A set of springs between two nodes, force against the change of their distance: an axial connector by another name.
    fn read_spring(&mut self, deck: &DeckText, at: &Scoped) -> Result<(), DeckError> {
        let block = at.block;
        let Some(set) = block.option("ELSET") else {
            return Err(deck.error(block, block.line, "ELSET= is missing"));
        };
        let elset = self.element_set(deck, at, block.line, &set)?;
        let mut elastic = Vec::new();
        // the first line holds degrees of freedom: none for springs along the line of two nodes
        let blank = block.data.first().is_none_or(|(_, text)| text.trim().is_empty());
        let rows = block.rows().filter(|_| block.options.contains_key("NONLINEAR"));
        for (line, cells) in rows.skip(usize::from(blank)) {
            let row = deck.numbers(block, line, &cells)?;
            match row[..] {
                [force, change, ..] => elastic.push([force, change]),
                _ => return Err(deck.error(block, line, "a force and a change of length expected")),
            }
        }
        let behaviour = format!("*spring {elset}");
        self.behaviours.insert(behaviour.clone(), Behaviour { elastic, damping: 0.0 });
        let (at, kind) = ((block.file, block.line), "axial".to_owned());
        self.connectors.push(Connector {
            elset,
            kind,
            orientation: None,
            behaviour: Some(behaviour),
            at,
            spring: true,
        });
        Ok(())
    }

    fn read_orientation(&mut self, deck: &DeckText, at: &Scoped) -> Result<(), DeckError> {
        let block = at.block;
        if block.option("DEFINITION").as_deref() != Some("nodes") {
            return Ok(());
        }
        if let Some((line, cells)) = block.rows().next() {
            let [a, b, c] = cells[..] else {
                return Err(deck.error(block, line, "three nodes expected"));
            };
            let nodes = [a, b, c].map(|n| self.node(deck, at, line, n));
            let [a, b, c] = nodes;
            let name = self.scopes.name(at.scope, &name_of(deck, block)?);
            self.orientations.insert(name, [a?, b?, c?]);
        }
        Ok(())
    }

    fn read_behaviour(&mut self, deck: &DeckText, block: &Block, name: &str) -> Result<(), DeckError> {
        if block.options.get("COMPONENT").is_some_and(|c| c != "1") {
            let what = format!("*{} act on other components than 1 and are passed over", block.keyword);
            self.tell(deck, block, block.line, what);
            return Ok(());
        }
        if block.keyword == "CONNECTOR ELASTICITY" && block.options.contains_key("RIGID") {
            return Err(deck.error(block, block.line, "RIGID is not read; expected a table, NONLINEAR"));
        }
        let mut rows = Vec::new();
        for (line, cells) in block.rows() {
            rows.push(deck.numbers(block, line, &cells)?);
        }
        if rows.iter().any(|r| r.len() > 2) {
            let what =
                format!("*{} depend on temperature or fields (further columns), which is not read", block.keyword);
            self.tell(deck, block, block.line, what);
        }
        let behaviour = self.behaviours.entry(name.to_owned()).or_default();
        let before = behaviour.clone();
        if block.keyword == "CONNECTOR DAMPING" {
            behaviour.damping = rows.first().and_then(|r| r.first()).copied().unwrap_or(0.0);
        } else {
            // a linear elasticity is no table, and its second number a temperature
            let table = rows.iter().filter(|r| r.len() >= 2 && block.options.contains_key("NONLINEAR"));
            behaviour.elastic = table.map(|r| [r[0], r[1]]).collect();
        }
        if before.elastic != behaviour.elastic && !before.elastic.is_empty() {
            self.tell(deck, block, block.line, second_time("tables of a connector behavior"));
        }
        Ok(())
    }

    fn read_interaction(&mut self, deck: &DeckText, block: &Block, name: &str) -> Result<(), DeckError> {
        let mut rows = Vec::new();
        for (line, cells) in block.rows() {
            rows.push(deck.numbers(block, line, &cells)?);
        }
        let first = rows.first().and_then(|r| r.first()).copied().unwrap_or(0.0);
        let columns = if block.keyword == "SURFACE BEHAVIOR" { 2 } else { 1 };
        let further = |r: &Vec<f64>| r.iter().skip(columns).any(|x| *x != 0.0);
        if rows.iter().any(further) || columns == 1 && rows.len() > 1 {
            let what = format!(
                "*{} depend on further numbers (slip, pressure, temperature), which are not read",
                block.keyword
            );
            self.tell(deck, block, block.line, what);
        }
        let interaction = self.interactions.entry(name.to_owned()).or_default();
        let before = interaction.clone();
        match block.keyword.as_str() {
            "FRICTION" | "CONTACT DAMPING" if first < 0.0 => {
                let line = block.rows().next().map_or(block.line, |(line, _)| line);
                return Err(deck.error(block, line, format!("{first} is negative; expected 0 or more")));
            }
            "FRICTION" => interaction.friction = first,
            "CONTACT DAMPING" => interaction.damping = first,
            _ if block.option("PRESSURE-OVERCLOSURE").as_deref() == Some("tabular") => {
                interaction.table = rows.iter().filter(|r| r.len() >= 2).map(|r| [r[0], r[1]]).collect();
            }
            _ => return Err(deck.error(block, block.line, "only PRESSURE-OVERCLOSURE=TABULAR is understood")),
        }
        if before.table != interaction.table && !before.table.is_empty() {
            self.tell(deck, block, block.line, second_time("tables of a surface interaction"));
        }
        Ok(())
    }
}

/// What is said of a definition that stands in the deck already, otherwise.
fn second_time(what: &str) -> String {
    format!("{what} are given a second time, otherwise; the last one is taken for the whole deck")
}

/// What is said of cells behind a node's coordinates that are no normal. Halves of numbers with decimal commas are digits alone, and some are above 1. Abaqus
/// takes normals of any length.
fn not_a_normal(cells: &[&str], further: &[f64]) -> Option<String> {
    let is_whole = |cell: &&str| cell.trim().chars().all(|c| c.is_ascii_digit() || c == '-' || c == '+');
    let are_halves = cells.iter().all(is_whole) && further.iter().any(|x| x.abs() > 1.0);
    are_halves.then(|| {
        format!(
            "the node has {} numbers behind its coordinates, which are whole and no direction: are they decimal commas? Write decimal points; expected label, x, y, z",
            further.len()
        )
    })
}

pub(super) fn name_of(deck: &DeckText, block: &Block) -> Result<String, DeckError> {
    block.option("NAME").ok_or_else(|| deck.error(block, block.line, "NAME= is missing"))
}

pub(super) fn label(deck: &DeckText, block: &Block, line: usize, cell: Option<&&str>) -> Result<u64, DeckError> {
    let cell = cell.copied().unwrap_or("");
    cell.parse::<u64>().map_err(|_| deck.error(block, line, format!("\"{cell}\" is not a label (a whole number)")))
}

/// Nodes of an element type; `None` for an unknown one.
fn node_count(kind: &str) -> Option<usize> {
    Some(match kind {
        k if k.starts_with("C3D8") => 8,
        k if k.starts_with("C3D4") => 4,
        k if k.starts_with("C3D6") => 6,
        "R3D3" | "S3" | "S3R" | "SFM3D3" => 3,
        "R3D4" | "S4" | "S4R" | "SFM3D4" => 4,
        "CONN3D2" | "SPRINGA" | "T3D2" | "DASHPOTA" => 2,
        "MASS" | "ROTARYI" => 1,
        _ => return None,
    })
}
