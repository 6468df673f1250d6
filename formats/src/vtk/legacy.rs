//! VTK's legacy files.

use super::{Cells, index, surface};
use crate::FormatError;
use crate::raw::refuse;
use meshes::surface::TriMesh;

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    binary: bool,
}

pub(super) fn read(bytes: &[u8]) -> Result<TriMesh, FormatError> {
    let mut cursor = Cursor { bytes, at: 0, binary: false };
    // Version and title.
    cursor.line();
    cursor.line();
    cursor.binary = match cursor.line().trim().to_ascii_uppercase().as_str() {
        "ASCII" => false,
        "BINARY" => true,
        other => return refuse(format!("line 3 is `{other:.30}`; expected ASCII or BINARY")),
    };
    let mut coordinates = Vec::new();
    let mut cells: Vec<Cells> = Vec::new();
    while let Some(word) = cursor.keyword() {
        match word.to_ascii_uppercase().as_str() {
            "DATASET" => {
                let kind = cursor.word()?;
                if !["POLYDATA", "UNSTRUCTURED_GRID"].contains(&kind.to_ascii_uppercase().as_str()) {
                    return refuse(format!("the data set is {kind}; expected POLYDATA: export a surface"));
                }
            }
            "POINTS" => {
                let count = cursor.count()?;
                let kind = cursor.word()?;
                coordinates = cursor.numbers(count.saturating_mul(3), &kind)?;
            }
            "POLYGONS" | "CELLS" => cells.push(cursor.cells(false)?),
            "TRIANGLE_STRIPS" => cells.push(cursor.cells(true)?),
            "VERTICES" | "LINES" => {
                cursor.cells(false)?;
            }
            "CELL_TYPES" => {
                let count = cursor.count()?;
                let kinds = cursor.numbers(count, "int")?;
                if let Some(last) = cells.last_mut() {
                    last.kinds = kinds.iter().map(|k| *k as u8).collect();
                }
            }
            "METADATA" => cursor.skip_metadata(),
            // What follows are values at points and cells.
            "POINT_DATA" | "CELL_DATA" | "FIELD" => break,
            other => return refuse(format!("`{other:.30}` was met; expected POINTS, POLYGONS or TRIANGLE_STRIPS")),
        }
    }
    surface(&coordinates, &cells)
}

impl Cursor<'_> {
    fn line(&mut self) -> String {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += end + 1;
        String::from_utf8_lossy(&rest[..end.min(1000)]).into_owned()
    }

    /// The next word; `None` at the end.
    fn keyword(&mut self) -> Option<String> {
        while self.bytes.get(self.at)?.is_ascii_whitespace() {
            self.at += 1;
        }
        let rest = self.bytes.get(self.at..)?;
        let end = rest.iter().position(|b| b.is_ascii_whitespace()).unwrap_or(rest.len());
        self.at += end;
        Some(String::from_utf8_lossy(&rest[..end.min(100)]).into_owned())
    }

    fn word(&mut self) -> Result<String, FormatError> {
        self.keyword().ok_or_else(|| FormatError("the file ends early; it is cut short".into()))
    }

    fn count(&mut self) -> Result<usize, FormatError> {
        let word = self.word()?;
        word.parse().map_err(|_| FormatError(format!("`{word:.30}` was met; expected a count")))
    }

    /// `count` numbers of a type, from text or big-endian bytes. The list grows by what is there.
    fn numbers(&mut self, count: usize, kind: &str) -> Result<Vec<f64>, FormatError> {
        let short = |found: usize| {
            FormatError(format!("{count} numbers are announced, {found} are there; the file is cut short"))
        };
        if !self.binary {
            let mut out = Vec::new();
            while out.len() < count {
                let Some(word) = self.keyword() else { return Err(short(out.len())) };
                match word.parse() {
                    Ok(x) => out.push(x),
                    Err(_) => return refuse(format!("`{word:.30}` was met; expected a number")),
                }
            }
            return Ok(out);
        }
        self.line();
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        macro_rules! read {
            ($type:ty) => {{
                const N: usize = size_of::<$type>();
                let Some(own) = count.checked_mul(N).and_then(|n| rest.get(..n)) else {
                    return Err(short(rest.len() / N));
                };
                self.at += own.len();
                let one = |b: &[u8]| <$type>::from_be_bytes(std::array::from_fn(|k| b[k])) as f64;
                own.chunks_exact(N).map(one).collect()
            }};
        }
        Ok(match kind.to_ascii_lowercase().as_str() {
            "float" => read!(f32),
            "double" => read!(f64),
            "char" | "unsigned_char" => read!(u8),
            "short" => read!(i16),
            "unsigned_short" => read!(u16),
            "int" => read!(i32),
            "unsigned_int" => read!(u32),
            "long" | "vtktypeint64" | "vtkidtype" => read!(i64),
            "unsigned_long" => read!(u64),
            other => return refuse(format!("numbers are of type `{other:.30}`; expected float, double or int")),
        })
    }

    /// Cells as versions to 4.2 write them (a count before each list), or with OFFSETS and CONNECTIVITY.
    fn cells(&mut self, strips: bool) -> Result<Cells, FormatError> {
        let (first, size) = (self.count()?, self.count()?);
        let mut cells = Cells { strips, ..Cells::default() };
        let at = self.at;
        if self.keyword().is_some_and(|w| w.eq_ignore_ascii_case("OFFSETS")) {
            let kind = self.word()?;
            let ends = self.numbers(first, &kind)?;
            let word = self.word()?;
            if !word.eq_ignore_ascii_case("CONNECTIVITY") {
                return refuse(format!("`{word:.30}` was met; expected CONNECTIVITY"));
            }
            let kind = self.word()?;
            cells.points = self.numbers(size, &kind)?.into_iter().map(index).collect::<Result<_, _>>()?;
            cells.ends = ends.into_iter().skip(1).map(|x| index(x).map(|x| x as usize)).collect::<Result<_, _>>()?;
            return Ok(cells);
        }
        self.at = at;
        let list = self.numbers(size, "int")?;
        let mut next = 0;
        while let Some(&n) = list.get(next) {
            let n = index(n)? as usize;
            let Some(own) = list.get(next + 1..next + 1 + n) else {
                return refuse("a cell is longer than the list of cells");
            };
            for &x in own {
                cells.points.push(index(x)?);
            }
            cells.ends.push(cells.points.len());
            next += 1 + n;
        }
        Ok(cells)
    }

    /// To the empty line that ends it.
    fn skip_metadata(&mut self) {
        self.line();
        while self.at < self.bytes.len() && !self.line().trim().is_empty() {}
    }
}
