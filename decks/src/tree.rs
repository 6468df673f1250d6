//! A model's file as a tree of XML whose faults name file and line.

use crate::DeckError;
use roxmltree::{Document, Node};

/// A model is no larger than this [bytes]: the largest published one has 9 MB. Ours.
const LARGEST: usize = 128 << 20;
/// Elements nest no deeper than this; OpenSim's reach about 20, FEBio's 10. Ours.
const DEEPEST: usize = 200;

/// The file and what is in it.
pub(crate) struct Tree<'a> {
    /// The file's name.
    pub(crate) file: &'a str,
    /// What stands between numbers beside blanks.
    between: Option<char>,
    document: Document<'a>,
}

impl<'a> Tree<'a> {
    /// Parses a file's text; `what` is the model that is expected, `between` what stands between numbers beside blanks.
    ///
    /// Errors: no XML, and where; nested too deep; too large.
    pub(crate) fn new(file: &'a str, text: &'a str, what: &str, between: Option<char>) -> Result<Tree<'a>, DeckError> {
        let fault = |line: usize, message: String| DeckError { file: file.to_owned(), line, message };
        if text.len() > LARGEST {
            return Err(fault(0, format!("the file has {} bytes, more than {LARGEST}", text.len())));
        }
        if let Some(offset) = too_deep(text) {
            let line = 1 + text[..offset].matches('\n').count();
            return Err(fault(line, format!("elements nest more than {DEEPEST} deep")));
        }
        let document = Document::parse(text).map_err(|e| {
            fault(e.pos().row as usize, format!("this is no XML that can be read ({e}); expected {what}"))
        })?;
        Ok(Tree { file, between, document })
    }

    /// The outermost element.
    pub(crate) fn root(&self) -> Node<'_, 'a> {
        self.document.root_element()
    }

    /// Line of an element, from 1.
    pub(crate) fn line(&self, node: Node<'_, '_>) -> usize {
        self.document.text_pos_at(node.range().start).row as usize
    }

    /// A fault of an element.
    pub(crate) fn error(&self, node: Node<'_, '_>, message: impl Into<String>) -> DeckError {
        let message = format!("{}: {}", shown(node), message.into());
        DeckError { file: self.file.to_owned(), line: self.line(node), message }
    }

    /// The numbers of a property, or `usual` where the element lacks it.
    pub(crate) fn numbers<const N: usize>(
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
    pub(crate) fn list(&self, node: Node<'_, '_>, name: &str) -> Result<Vec<f64>, DeckError> {
        let Some(given) = child(node, name) else { return Ok(Vec::new()) };
        self.numbers_in(given)
    }

    /// All numbers in an element's text.
    pub(crate) fn numbers_in(&self, node: Node<'_, '_>) -> Result<Vec<f64>, DeckError> {
        let number = |word: &str| {
            let read = word.parse::<f64>().ok().filter(|x| x.is_finite());
            read.ok_or_else(|| {
                let of = node.parent_element().unwrap_or(node);
                self.error(node, format!("\"{}\" of {} is no finite number", brief(word), shown(of)))
            })
        };
        let words = node.text().unwrap_or("").split(|c: char| c.is_whitespace() || Some(c) == self.between);
        words.filter(|w| !w.is_empty()).map(number).collect()
    }

    /// One number of a property.
    pub(crate) fn number(&self, node: Node<'_, '_>, name: &str, usual: f64) -> Result<f64, DeckError> {
        Ok(self.numbers(node, name, [usual])?[0])
    }

    /// A property that is true or false.
    pub(crate) fn flag(&self, node: Node<'_, '_>, name: &str, usual: bool) -> Result<bool, DeckError> {
        match text(node, name).map(|t| t.to_lowercase()).as_deref() {
            None | Some("") => Ok(usual),
            Some("true") => Ok(true),
            Some("false") => Ok(false),
            Some(other) => Err(self.error(node, format!("<{name}> is \"{}\", expected true or false", brief(other)))),
        }
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
pub(crate) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|c| c.is_element() && c.tag_name().name() == name)
}

/// The text of the first child of that name, trimmed.
pub(crate) fn text<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    child(node, name).map(|c| c.text().unwrap_or("").trim())
}

/// The name of an object; empty where it has none.
pub(crate) fn name_of<'a>(node: Node<'a, '_>) -> &'a str {
    node.attribute("name").unwrap_or("")
}

/// An element as messages show it.
pub(crate) fn shown(node: Node<'_, '_>) -> String {
    match name_of(node) {
        "" => format!("<{}>", node.tag_name().name()),
        name => format!("<{} name=\"{}\">", node.tag_name().name(), brief(name)),
    }
}

/// The beginning of a text that may be long.
pub(crate) fn brief(text: &str) -> String {
    const SHOWN: usize = 60;
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
