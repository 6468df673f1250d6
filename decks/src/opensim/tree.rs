//! An OpenSim file as a tree of XML whose faults name file and line.

use crate::DeckError;
use meshes::{Isometry, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use roxmltree::{Document, Node};

/// A model is no larger than this [bytes]: the largest published one has 9 MB. Ours.
const LARGEST: usize = 128 << 20;
/// Elements nest no deeper than this; OpenSim's reach about 20. Ours.
const DEEPEST: usize = 200;
/// Oldest version of the file format that is read: that of OpenSim 4.0.
const OLDEST_VERSION: u64 = 40_000;

/// The file and what is in it.
pub(super) struct Tree<'a> {
    /// The file's name.
    pub(super) file: &'a str,
    document: Document<'a>,
}

impl<'a> Tree<'a> {
    /// Parses a file's text.
    ///
    /// Errors: no XML, and where; nested too deep; too large.
    pub(super) fn new(file: &'a str, text: &'a str) -> Result<Tree<'a>, DeckError> {
        let fault = |line: usize, message: String| DeckError { file: file.to_owned(), line, message };
        if text.len() > LARGEST {
            return Err(fault(0, format!("the file has {} bytes, more than {LARGEST}", text.len())));
        }
        if let Some(offset) = too_deep(text) {
            let line = 1 + text[..offset].matches('\n').count();
            return Err(fault(line, format!("elements nest more than {DEEPEST} deep")));
        }
        let document = Document::parse(text).map_err(|e| {
            fault(e.pos().row as usize, format!("this is no XML that can be read ({e}); expected an OpenSim model"))
        })?;
        Ok(Tree { file, document })
    }

    /// The model's element.
    ///
    /// Errors: another kind of file, or one older than OpenSim 4.
    pub(super) fn model(&self) -> Result<Node<'_, 'a>, DeckError> {
        let root = self.document.root_element();
        if root.tag_name().name() != "OpenSimDocument" {
            let what = format!("the file is a <{}>; expected an <OpenSimDocument>", root.tag_name().name());
            return Err(self.error(root, what));
        }
        let version = root.attribute("Version").and_then(|v| v.trim().parse::<u64>().ok());
        if version.is_none_or(|v| v < OLDEST_VERSION) {
            let what = format!(
                "the format is of version {}; expected {OLDEST_VERSION} or later: open the model in OpenSim 4 and save it",
                root.attribute("Version").unwrap_or("none")
            );
            return Err(self.error(root, what));
        }
        child(root, "Model").ok_or_else(|| self.error(root, "there is no <Model>; expected an OpenSim model"))
    }

    /// Line of an element, from 1.
    pub(super) fn line(&self, node: Node<'_, '_>) -> usize {
        self.document.text_pos_at(node.range().start).row as usize
    }

    /// A fault of an element.
    pub(super) fn error(&self, node: Node<'_, '_>, message: impl Into<String>) -> DeckError {
        let message = format!("{}: {}", shown(node), message.into());
        DeckError { file: self.file.to_owned(), line: self.line(node), message }
    }

    /// The numbers of a property, or `usual` where the element lacks it.
    pub(super) fn numbers<const N: usize>(
        &self,
        node: Node<'_, '_>,
        name: &str,
        usual: [f64; N],
    ) -> Result<[f64; N], DeckError> {
        let Some(given) = child(node, name) else { return Ok(usual) };
        let found = self.list(node, name)?;
        <[f64; N]>::try_from(found.as_slice()).map_err(|_| {
            let what = format!("<{name}> of {} has {} numbers, expected {N}", shown(node), found.len());
            self.error(given, what)
        })
    }

    /// All numbers of a property; none where the element lacks it.
    pub(super) fn list(&self, node: Node<'_, '_>, name: &str) -> Result<Vec<f64>, DeckError> {
        let Some(given) = child(node, name) else { return Ok(Vec::new()) };
        let number = |word: &str| {
            let read = word.parse::<f64>().ok().filter(|x| x.is_finite());
            read.ok_or_else(|| self.error(given, format!("\"{}\" of {} is no finite number", brief(word), shown(node))))
        };
        given.text().unwrap_or("").split_whitespace().map(number).collect()
    }

    /// One number of a property.
    pub(super) fn number(&self, node: Node<'_, '_>, name: &str, usual: f64) -> Result<f64, DeckError> {
        Ok(self.numbers(node, name, [usual])?[0])
    }

    /// A property that is true or false.
    pub(super) fn flag(&self, node: Node<'_, '_>, name: &str, usual: bool) -> Result<bool, DeckError> {
        match text(node, name).map(|t| t.to_lowercase()).as_deref() {
            None | Some("") => Ok(usual),
            Some("true") => Ok(true),
            Some("false") => Ok(false),
            Some(other) => Err(self.error(node, format!("<{name}> is \"{}\", expected true or false", brief(other)))),
        }
    }

    /// A displacement and a turn, the frame-fixed x-y-z angles of OpenSim, as a motion in mm.
    pub(super) fn motion(&self, node: Node<'_, '_>, shift: &str, turn: &str) -> Result<Isometry, DeckError> {
        let shift = Vector::from(self.numbers(node, shift, [0.0; 3])?) * super::MM_PER_M;
        let [x, y, z] = self.numbers(node, turn, [0.0; 3])?;
        let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
        let turn = about(Vector::x_axis(), x) * about(Vector::y_axis(), y) * about(Vector::z_axis(), z);
        Ok(Isometry::from_parts(Translation3::from(shift), turn))
    }
}

/// Where elements nest too deep: counted before the tree is made, so that no parser meets it.
fn too_deep(text: &str) -> Option<usize> {
    let (mut depth, bytes) = (0usize, text.as_bytes());
    let mut at = 0;
    while let Some(open) = text[at..].find('<').map(|n| at + n) {
        let skip = |end: &str| text[open..].find(end).map_or(text.len(), |n| open + n + end.len());
        at = match bytes.get(open + 1) {
            Some(b'!') if text[open..].starts_with("<!--") => skip("-->"),
            Some(b'!') if text[open..].starts_with("<![CDATA[") => skip("]]>"),
            Some(b'!' | b'?') => skip(">"),
            Some(b'/') => {
                depth = depth.saturating_sub(1);
                skip(">")
            }
            _ => {
                let end = skip(">");
                let closes = end >= 2 && text.as_bytes().get(end - 2) == Some(&b'/');
                depth += usize::from(!closes);
                end
            }
        };
        if depth > DEEPEST {
            return Some(open);
        }
    }
    None
}

/// The first child element of that name.
pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|c| c.is_element() && c.tag_name().name() == name)
}

/// The text of the first child of that name, trimmed.
pub(super) fn text<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    child(node, name).map(|c| c.text().unwrap_or("").trim())
}

/// The name of an object; empty where it has none.
pub(super) fn name_of<'a>(node: Node<'a, '_>) -> &'a str {
    node.attribute("name").unwrap_or("")
}

/// An element as messages show it.
pub(super) fn shown(node: Node<'_, '_>) -> String {
    match name_of(node) {
        "" => format!("<{}>", node.tag_name().name()),
        name => format!("<{} name=\"{}\">", node.tag_name().name(), brief(name)),
    }
}

/// The beginning of a text that may be long.
pub(super) fn brief(text: &str) -> String {
    const SHOWN: usize = 60;
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
