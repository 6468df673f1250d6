//! From files to keyword blocks: includes followed, parameters evaluated and put in, comments dropped.

use super::expression::{evaluate, lacks_its_letter, lookup, number};
use crate::DeckError;
use std::collections::BTreeMap;

/// Includes nest no deeper than this.
const DEEPEST_INCLUDE: usize = 16;
/// All files of a deck together are no larger than this [bytes]; each inclusion counts, with 4096 on top.
const LARGEST_DECK: usize = 512 << 20;

/// Hands over the bytes of a file by the name the deck gives it, or says why not.
pub type ReadFile<'a> = dyn FnMut(&str) -> Result<Vec<u8>, String> + 'a;

/// A keyword line and its data lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// The keyword without its star, upper case, single spaces.
    pub keyword: String,
    /// Its parameters, names in upper case; a flag has an empty value.
    pub options: BTreeMap<String, String>,
    /// Number of its file among the deck's.
    pub file: usize,
    /// Line of the keyword, from 1.
    pub line: usize,
    /// Data lines with their line numbers, parameters put in.
    pub data: Vec<(usize, String)>,
}

/// A deck as blocks, in order.
#[derive(Clone, Debug, Default)]
pub struct DeckText {
    /// File names, the main one first.
    pub files: Vec<String>,
    /// The blocks.
    pub blocks: Vec<Block>,
    /// Parameters at the end.
    pub parameters: BTreeMap<String, f64>,
}

impl Block {
    /// An option's value, lower case for matching.
    pub fn option(&self, name: &str) -> Option<String> {
        self.options.get(name).map(|v| v.to_lowercase())
    }

    /// The cells of each data line, blank cells at the end dropped.
    pub fn rows(&self) -> impl Iterator<Item = (usize, Vec<&str>)> {
        self.data.iter().map(|(line, text)| {
            let mut cells: Vec<&str> = text.split(',').map(str::trim).collect();
            while cells.last().is_some_and(|c| c.is_empty()) {
                cells.pop();
            }
            (*line, cells)
        })
    }
}

impl DeckText {
    /// A complaint about a line of a block.
    pub fn error(&self, block: &Block, line: usize, message: impl Into<String>) -> DeckError {
        DeckError {
            file: self.files.get(block.file).cloned().unwrap_or_default(),
            line,
            message: format!("*{}: {}", block.keyword, message.into()),
        }
    }

    /// Where a block stands: `file:line`.
    pub fn place(&self, block: &Block) -> String {
        format!("{}:{}", self.files.get(block.file).map_or("", String::as_str), block.line)
    }

    /// The number in a cell; arithmetic left by a substitution (`--20`) is done.
    pub fn number(&self, block: &Block, line: usize, cell: &str) -> Result<f64, DeckError> {
        if cell.is_empty() {
            return Ok(0.0);
        }
        match number(cell) {
            Some(value) => Ok(value),
            None if lacks_its_letter(cell) => {
                Err(self.error(block, line, format!("\"{cell}\" lacks the letter of its exponent; write it with E")))
            }
            None => evaluate(cell, &self.parameters)
                .map_err(|e| self.error(block, line, format!("\"{cell}\" is not a number: {e}"))),
        }
    }

    /// The numbers of a row.
    pub fn numbers(&self, block: &Block, line: usize, cells: &[&str]) -> Result<Vec<f64>, DeckError> {
        cells.iter().map(|c| self.number(block, line, c)).collect()
    }
}

/// Reads the deck that begins in file `main`.
///
/// # Errors
/// A file the caller does not hand over, an INCLUDE that leads back to itself, nesting or size beyond reason, a
/// parameter that cannot be evaluated, data before any keyword.
pub fn read_blocks(main: &str, read: &mut ReadFile) -> Result<DeckText, DeckError> {
    let mut reader = Reader { deck: DeckText::default(), read, stack: Vec::new(), size: 0 };
    reader.file(main, &mut None, ("deck".into(), 0))?;
    Ok(reader.deck)
}

struct Reader<'a, 'b> {
    deck: DeckText,
    read: &'a mut ReadFile<'b>,
    stack: Vec<String>,
    size: usize,
}

impl Reader<'_, '_> {
    /// Reads a file; `current` is the block that data lines go to.
    fn file(&mut self, name: &str, current: &mut Option<Block>, from: (String, usize)) -> Result<(), DeckError> {
        let refuse = |message: String| DeckError { file: from.0.clone(), line: from.1, message };
        if self.stack.iter().any(|s| s == name) {
            return Err(refuse(format!("INCLUDE of \"{name}\" leads back to itself: {}", self.stack.join(" -> "))));
        }
        if self.stack.len() >= DEEPEST_INCLUDE {
            return Err(refuse(format!("INCLUDE nested more than {DEEPEST_INCLUDE} deep")));
        }
        let bytes = (self.read)(name).map_err(|e| refuse(format!("cannot read \"{name}\": {e}")))?;
        self.size += bytes.len() + 4096;
        if self.size > LARGEST_DECK {
            return Err(refuse(format!("the deck's files exceed {} MB together", LARGEST_DECK >> 20)));
        }
        let file = self.deck.files.len();
        self.deck.files.push(name.to_owned());
        self.stack.push(name.to_owned());
        let (text, _) = sim::text::decoded(&bytes);
        // an old Macintosh ends lines by a carriage return alone
        let text = if text.contains('\n') { text.into_owned() } else { text.replace('\r', "\n") };
        let mut lines = text.lines().enumerate().peekable();
        while let Some((i, line)) = lines.next() {
            let mut line = line.trim().to_owned();
            if line.starts_with("**") {
                continue;
            }
            if line.is_empty() {
                self.blank(current, i + 1);
                continue;
            }
            if line.starts_with('*') {
                while line.ends_with(',') {
                    match lines.next_if(|(_, next)| !next.trim().is_empty() && !next.trim().starts_with('*')) {
                        Some((_, next)) => line += next.trim(),
                        None => break,
                    }
                }
                self.keyword(&line, file, i + 1, current)?;
            } else {
                self.data(line, file, i + 1, current)?;
            }
        }
        self.stack.pop();
        if self.stack.is_empty() {
            self.deck.blocks.extend(current.take());
        }
        Ok(())
    }

    /// A blank line: none but the first of *SPRING means something, no degrees of freedom.
    fn blank(&self, current: &mut Option<Block>, number: usize) {
        if let Some(block) = current.as_mut().filter(|b| b.keyword == "SPRING" && b.data.is_empty()) {
            block.data.push((number, String::new()));
        }
    }

    fn keyword(
        &mut self,
        line: &str,
        file: usize,
        number: usize,
        current: &mut Option<Block>,
    ) -> Result<(), DeckError> {
        self.deck.blocks.extend(current.take());
        let line = self.substituted(line, file, number)?;
        let mut parts = line[1..].split(',');
        let keyword = parts.next().unwrap_or("").split_whitespace().collect::<Vec<_>>().join(" ").to_uppercase();
        let mut options = BTreeMap::new();
        for part in parts {
            let (key, value) = part.split_once('=').unwrap_or((part, ""));
            let key = key.split_whitespace().collect::<Vec<_>>().join(" ").to_uppercase();
            if key.contains('*') {
                return Err(self.error(
                    file,
                    number,
                    format!("*{keyword}: \"{key}\" holds a second keyword; expected each on a line of its own, as *END ASSEMBLY, *END PART and *END INSTANCE are: where *PART and *INSTANCE end cannot be told"),
                ));
            }
            if !key.is_empty() {
                options.insert(key, value.trim().trim_matches('"').to_owned());
            }
        }
        let input = options.get("INPUT").cloned();
        if keyword == "INCLUDE" {
            let Some(input) = input else {
                return Err(self.error(file, number, "*INCLUDE without INPUT=file".into()));
            };
            let from = (self.deck.files[file].clone(), number);
            return self.file(&input, current, from);
        }
        *current = Some(Block { keyword, options, file, line: number, data: Vec::new() });
        if let Some(input) = input {
            let from = (self.deck.files[file].clone(), number);
            self.file(&input, current, from)?;
        }
        Ok(())
    }

    fn data(&mut self, line: String, file: usize, number: usize, current: &mut Option<Block>) -> Result<(), DeckError> {
        let Some(block) = current else {
            return Err(self.error(
                file,
                number,
                "data before any keyword line; expected a line that begins with *".into(),
            ));
        };
        if block.keyword == "PARAMETER" {
            let Some((name, text)) = line.split_once('=') else {
                return Err(self.error(file, number, format!("\"{line}\" is no NAME=expression")));
            };
            let value = evaluate(text, &self.deck.parameters)
                .map_err(|e| self.error(file, number, format!("parameter {}: {e}", name.trim())))?;
            self.deck.parameters.insert(name.trim().to_owned(), value);
            return Ok(());
        }
        let line = if line.contains('<') { self.substituted(&line, file, number)? } else { line };
        block.data.push((number, line));
        Ok(())
    }

    /// The line with each `<name>` replaced by its value.
    fn substituted(&self, line: &str, file: usize, number: usize) -> Result<String, DeckError> {
        let mut out = String::with_capacity(line.len());
        let mut rest = line;
        while let Some((before, after)) = rest.split_once('<') {
            let Some((name, tail)) = after.split_once('>') else {
                break;
            };
            let Some(value) = lookup(name.trim(), &self.deck.parameters) else {
                return Err(self.error(file, number, format!("parameter <{}> is not defined above", name.trim())));
            };
            out += before;
            out += &format!("{value:?}");
            rest = tail;
        }
        Ok(out + rest)
    }

    fn error(&self, file: usize, line: usize, message: String) -> DeckError {
        DeckError { file: self.deck.files.get(file).cloned().unwrap_or_default(), line, message }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn deck(files: &[(&str, &str)]) -> Result<DeckText, DeckError> {
        let files: BTreeMap<&str, &str> = files.iter().copied().collect();
        read_blocks("main", &mut |name: &str| {
            files.get(name).map(|t| t.as_bytes().to_vec()).ok_or_else(|| "no such file".to_owned())
        })
    }

    #[test]
    fn includes_parameters_comments_and_case() {
        let text = "** c\n*parameter\nA = 2\nb=A**2\n\t*Include, input = sub \n*NODE,\n nset=x\n 1, <B>, -<A>,\n";
        let d = deck(&[("main", text), ("sub", "*Connector  Load, OP = new\n*** no\n<A>\n")]).unwrap();
        assert_eq!(d.blocks[1].keyword, "CONNECTOR LOAD");
        assert_eq!(d.blocks[1].data[0].1, "2.0");
        assert_eq!(d.blocks[2].option("NSET").unwrap(), "x");
        let (line, cells) = d.blocks[2].rows().next().unwrap();
        assert_eq!(d.numbers(&d.blocks[2], line, &cells).unwrap(), [1.0, 4.0, -2.0]);
    }

    #[test]
    fn faults_name_file_and_line() {
        let e = deck(&[("main", "*INCLUDE, INPUT=a\n"), ("a", "**\n*INCLUDE, INPUT=main\n")]).unwrap_err();
        assert_eq!((e.file.as_str(), e.line), ("a", 2));
        assert!(e.message.contains("leads back"));
        assert!(
            deck(&[("main", "*INCLUDE, INPUT=b\n")]).unwrap_err().to_string().contains("main:1: cannot read \"b\"")
        );
        assert!(deck(&[("main", "1, 2\n")]).unwrap_err().message.contains("data before"));
        assert!(deck(&[("main", "*NODE\n<x>, 2\n")]).unwrap_err().message.contains("<x>"));
    }
}
