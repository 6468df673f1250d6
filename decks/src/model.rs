//! From keyword blocks to the tables of a deck: nodes, elements, sets, ties, connectors, contact.

use super::keyword::{Block, DeckText};
use crate::DeckError;
use meshes::Point;
use std::collections::BTreeMap;

/// All sets of a deck together list no more members than this.
const MOST_MEMBERS: u64 = 20_000_000;

/// An element.
#[derive(Clone, Debug, PartialEq)]
pub struct Element {
    /// Type, upper case.
    pub kind: String,
    /// Node labels.
    pub nodes: Vec<u64>,
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

/// The interaction of deformable menisci in a deck that this crate writes.
pub(crate) const MENISCI: &str = "MENISCUS_INTERACT";

/// A contact pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Surfaces, lower case.
    pub surfaces: [String; 2],
    /// Interaction's name, lower case.
    pub interaction: String,
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
    /// Element numbers (places in `elements`) by label, the last of a label.
    labels: BTreeMap<u64, usize>,
    /// Element sets, as places in `elements`.
    pub elsets: BTreeMap<String, Vec<usize>>,
    /// Node sets, as labels.
    pub nsets: BTreeMap<String, Vec<u64>>,
    /// Surfaces: element set and face label.
    pub surfaces: BTreeMap<String, Vec<(String, String)>>,
    /// Rigid bodies: element set, reference node.
    pub rigid: Vec<(String, u64)>,
    /// Nodes tied by beams (multi-point constraints).
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
    /// Members listed in sets so far.
    listed: u64,
    /// Keywords that were passed over.
    pub ignored: BTreeMap<String, usize>,
}

/// Which definition the sub-keywords belong to.
#[derive(Default)]
struct Context {
    behaviour: String,
    interaction: String,
}

impl DeckModel {
    /// Collects the tables.
    ///
    /// # Errors
    /// A data line that does not hold what its keyword needs.
    pub fn new(deck: &DeckText) -> Result<DeckModel, DeckError> {
        let mut model = DeckModel::default();
        let mut context = Context::default();
        for block in &deck.blocks {
            model.block(deck, block, &mut context)?;
        }
        Ok(model)
    }

    fn block(&mut self, deck: &DeckText, block: &Block, context: &mut Context) -> Result<(), DeckError> {
        match block.keyword.as_str() {
            "HEADING" => self.heading = block.data.first().map(|(_, t)| t.clone()),
            "NODE" => self.read_nodes(deck, block)?,
            "ELEMENT" => self.read_elements(deck, block)?,
            "NSET" | "ELSET" => self.read_set(deck, block)?,
            "SURFACE" => self.read_surface(block),
            "RIGID BODY" => self.read_rigid(deck, block)?,
            "MPC" => self.read_ties(deck, block)?,
            "MASS" | "ROTARY INERTIA" => self.read_mass(deck, block)?,
            "BOUNDARY" => self.read_boundary(deck, block)?,
            "CONTACT PAIR" => self.read_pair(deck, block)?,
            "CONNECTOR SECTION" => self.connectors.push(connector(block)),
            "ORIENTATION" => self.read_orientation(deck, block)?,
            "CONNECTOR BEHAVIOR" => context.behaviour = name_of(deck, block)?,
            "SURFACE INTERACTION" => context.interaction = name_of(deck, block)?,
            "CONNECTOR ELASTICITY" | "CONNECTOR DAMPING" => self.read_behaviour(deck, block, &context.behaviour)?,
            "SURFACE BEHAVIOR" | "FRICTION" | "CONTACT DAMPING" => {
                self.read_interaction(deck, block, &context.interaction)?;
            }
            "PARAMETER" | "AMPLITUDE" | "STEP" | "END STEP" | "DYNAMIC" | "CONNECTOR MOTION" | "CONNECTOR LOAD" => {}
            other => *self.ignored.entry(other.to_owned()).or_default() += 1,
        }
        Ok(())
    }

    fn read_nodes(&mut self, deck: &DeckText, block: &Block) -> Result<(), DeckError> {
        let set = block.option("NSET");
        for (line, cells) in block.rows() {
            let id = label(deck, block, line, cells.first())?;
            let mut p = [0.0; 3];
            for (x, cell) in p.iter_mut().zip(cells.iter().skip(1)) {
                *x = deck.number(block, line, cell)?;
            }
            self.nodes.insert(id, Point::from(p));
            if let Some(set) = &set {
                self.nsets.entry(set.clone()).or_default().push(id);
            }
        }
        Ok(())
    }

    fn read_elements(&mut self, deck: &DeckText, block: &Block) -> Result<(), DeckError> {
        let Some(kind) = block.options.get("TYPE").map(|k| k.to_uppercase()) else {
            return Err(deck.error(block, block.line, "TYPE= is missing"));
        };
        let set = block.option("ELSET");
        let wanted = node_count(&kind);
        let mut row: Vec<u64> = Vec::new();
        let last = block.data.last().map_or(0, |(line, _)| *line);
        for ((line, cells), (_, text)) in block.rows().zip(&block.data) {
            for cell in &cells {
                row.push(label(deck, block, line, Some(cell))?);
            }
            let continues = match wanted {
                Some(n) => row.len() < n + 1,
                None => text.ends_with(','),
            };
            if continues && line != last {
                continue;
            }
            if row.len() < 2 || wanted.is_some_and(|n| row.len() != n + 1) {
                let expected = wanted.map_or("nodes".to_owned(), |n| format!("{n} nodes"));
                return Err(deck.error(
                    block,
                    line,
                    format!("element of type {kind} with {} nodes, expected {expected}", row.len().saturating_sub(1)),
                ));
            }
            self.labels.insert(row[0], self.elements.len());
            if let Some(set) = &set {
                self.elsets.entry(set.clone()).or_default().push(self.elements.len());
            }
            self.elements.push(Element { kind: kind.clone(), nodes: row[1..].to_vec() });
            row.clear();
        }
        Ok(())
    }

    fn read_set(&mut self, deck: &DeckText, block: &Block) -> Result<(), DeckError> {
        let nodes = block.keyword == "NSET";
        let Some(name) = block.option(&block.keyword) else {
            return Err(deck.error(block, block.line, format!("{}= is missing", block.keyword)));
        };
        let mut members: Vec<u64> = Vec::new();
        for (line, cells) in block.rows() {
            if block.options.contains_key("GENERATE") {
                let first = label(deck, block, line, cells.first())?;
                let last = label(deck, block, line, cells.get(1))?;
                let step = cells.get(2).map_or(Ok(1), |c| label(deck, block, line, Some(c)))?.max(1);
                let count = last.checked_sub(first).map_or(u64::MAX, |span| span / step);
                self.count(deck, block, line, count)?;
                members.extend((first..=last).step_by(step as usize));
                continue;
            }
            for cell in cells {
                match cell.parse::<u64>() {
                    Ok(id) => members.push(id),
                    Err(_) if nodes => {
                        let size = self.nsets.get(&cell.to_lowercase()).map_or(0, Vec::len);
                        self.count(deck, block, line, size as u64)?;
                        members.extend(self.nsets.get(&cell.to_lowercase()).into_iter().flatten().copied());
                    }
                    Err(_) => {
                        let set = self.elsets.get(&cell.to_lowercase()).cloned().unwrap_or_default();
                        self.count(deck, block, line, set.len() as u64)?;
                        self.elsets.entry(name.clone()).or_default().extend(set);
                    }
                }
            }
        }
        if nodes {
            let known = members.into_iter().filter(|id| self.nodes.contains_key(id));
            self.nsets.entry(name).or_default().extend(known);
        } else {
            let known: Vec<usize> = members.iter().filter_map(|id| self.labels.get(id).copied()).collect();
            self.elsets.entry(name).or_default().extend(known);
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

    fn read_surface(&mut self, block: &Block) {
        let Some(name) = block.option("NAME") else { return };
        let parts = self.surfaces.entry(name).or_default();
        for (_, cells) in block.rows() {
            if let Some(set) = cells.first() {
                let face = cells.get(1).map_or(String::new(), |f| f.to_uppercase());
                parts.push((set.to_lowercase(), face));
            }
        }
    }

    fn read_rigid(&mut self, deck: &DeckText, block: &Block) -> Result<(), DeckError> {
        let (Some(set), Some(node)) = (block.option("ELSET"), block.option("REF NODE")) else {
            return Err(deck.error(block, block.line, "ELSET= and REF NODE= expected"));
        };
        let node = self.node(deck, block, block.line, &node)?;
        self.rigid.push((set, node));
        Ok(())
    }

    fn read_ties(&mut self, deck: &DeckText, block: &Block) -> Result<(), DeckError> {
        for (line, cells) in block.rows() {
            if cells.first().is_some_and(|c| c.eq_ignore_ascii_case("beam") || c.eq_ignore_ascii_case("tie")) {
                if let [_, a, b, ..] = cells[..] {
                    let tie = [self.node(deck, block, line, a)?, self.node(deck, block, line, b)?];
                    self.ties.push(tie);
                } else {
                    return Err(deck.error(block, line, "two nodes expected"));
                }
            }
        }
        Ok(())
    }

    fn read_mass(&mut self, deck: &DeckText, block: &Block) -> Result<(), DeckError> {
        let set = block.option("ELSET").unwrap_or_default();
        if let Some((line, cells)) = block.rows().next() {
            let value = deck.number(block, line, cells.first().unwrap_or(&""))?;
            let table = if block.keyword == "MASS" { &mut self.mass } else { &mut self.inertia };
            table.insert(set, value);
        }
        Ok(())
    }

    fn read_boundary(&mut self, deck: &DeckText, block: &Block) -> Result<(), DeckError> {
        for (line, cells) in block.rows() {
            let whole = cells.get(1).is_some_and(|c| c.eq_ignore_ascii_case("encastre"))
                || (cells.get(1) == Some(&"1") && cells.get(2) == Some(&"6"));
            if whole {
                let node = self.node(deck, block, line, cells[0])?;
                if !self.fixed.contains(&node) {
                    self.fixed.push(node);
                }
            }
        }
        Ok(())
    }

    fn read_pair(&mut self, deck: &DeckText, block: &Block) -> Result<(), DeckError> {
        // a model has no deformable menisci to make of these
        if block.option("INTERACTION").is_some_and(|name| name.eq_ignore_ascii_case(MENISCI)) {
            return Ok(());
        }
        for (line, cells) in block.rows() {
            let [a, b, ..] = cells[..] else {
                return Err(deck.error(block, line, "two surfaces expected"));
            };
            let pair = Pair {
                surfaces: [a.to_lowercase(), b.to_lowercase()],
                interaction: block.option("INTERACTION").unwrap_or_default(),
            };
            if !self.pairs.contains(&pair) {
                self.pairs.push(pair);
            }
        }
        Ok(())
    }

    fn read_orientation(&mut self, deck: &DeckText, block: &Block) -> Result<(), DeckError> {
        if block.option("DEFINITION").as_deref() != Some("nodes") {
            return Ok(());
        }
        if let Some((line, cells)) = block.rows().next() {
            let [a, b, c] = cells[..] else {
                return Err(deck.error(block, line, "three nodes expected"));
            };
            let nodes = [a, b, c].map(|n| self.node(deck, block, line, n));
            let [a, b, c] = nodes;
            self.orientations.insert(name_of(deck, block)?, [a?, b?, c?]);
        }
        Ok(())
    }

    fn read_behaviour(&mut self, deck: &DeckText, block: &Block, name: &str) -> Result<(), DeckError> {
        if block.options.get("COMPONENT").is_some_and(|c| c != "1") {
            return Ok(());
        }
        let mut rows = Vec::new();
        for (line, cells) in block.rows() {
            rows.push(deck.numbers(block, line, &cells)?);
        }
        let behaviour = self.behaviours.entry(name.to_owned()).or_default();
        if block.keyword == "CONNECTOR DAMPING" {
            behaviour.damping = rows.first().and_then(|r| r.first()).copied().unwrap_or(0.0);
        } else {
            behaviour.elastic = rows.iter().filter(|r| r.len() >= 2).map(|r| [r[0], r[1]]).collect();
        }
        Ok(())
    }

    fn read_interaction(&mut self, deck: &DeckText, block: &Block, name: &str) -> Result<(), DeckError> {
        let mut rows = Vec::new();
        for (line, cells) in block.rows() {
            rows.push(deck.numbers(block, line, &cells)?);
        }
        let first = rows.first().and_then(|r| r.first()).copied().unwrap_or(0.0);
        let interaction = self.interactions.entry(name.to_owned()).or_default();
        match block.keyword.as_str() {
            "FRICTION" => interaction.friction = first,
            "CONTACT DAMPING" => interaction.damping = first,
            _ if block.option("PRESSURE-OVERCLOSURE").as_deref() == Some("tabular") => {
                interaction.table = rows.iter().filter(|r| r.len() >= 2).map(|r| [r[0], r[1]]).collect();
            }
            _ => return Err(deck.error(block, block.line, "only PRESSURE-OVERCLOSURE=TABULAR is understood")),
        }
        Ok(())
    }

    /// A node by label, or the one node of a set.
    fn node(&self, deck: &DeckText, block: &Block, line: usize, cell: &str) -> Result<u64, DeckError> {
        if let Ok(id) = cell.parse::<u64>() {
            return Ok(id);
        }
        match self.nsets.get(&cell.to_lowercase()).map(Vec::as_slice) {
            Some([id]) => Ok(*id),
            _ => Err(deck.error(block, line, format!("\"{cell}\" is neither a node label nor a set of one node"))),
        }
    }
}

fn connector(block: &Block) -> Connector {
    let mut rows = block.rows();
    let mut first = |_: usize| rows.next().and_then(|(_, c)| c.first().map(|s| s.to_lowercase()));
    Connector {
        elset: block.option("ELSET").unwrap_or_default(),
        kind: first(0).unwrap_or_default(),
        orientation: first(1),
        behaviour: block.option("BEHAVIOR"),
    }
}

fn name_of(deck: &DeckText, block: &Block) -> Result<String, DeckError> {
    block.option("NAME").ok_or_else(|| deck.error(block, block.line, "NAME= is missing"))
}

fn label(deck: &DeckText, block: &Block, line: usize, cell: Option<&&str>) -> Result<u64, DeckError> {
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
