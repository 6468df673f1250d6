//! A tidy table, as CSV and as Parquet.

use crate::error::BuildError;
#[cfg(feature = "parquet")]
use parquet::{
    column::writer::ColumnWriter,
    data_type::ByteArray,
    errors::ParquetError,
    file::{properties::WriterProperties, writer::SerializedFileWriter},
    schema::parser::parse_message_type,
};

/// The values of a column; `None` is an empty cell.
#[derive(Clone, Debug)]
pub(super) enum Column {
    Text(Vec<String>),
    Number(Vec<Option<f64>>),
}

/// A table: its name, and columns of one length.
#[derive(Clone, Debug)]
pub(super) struct Table {
    pub(super) name: &'static str,
    pub(super) columns: Vec<(&'static str, Column)>,
}

impl Table {
    /// Number of rows.
    pub(super) fn rows(&self) -> usize {
        match self.columns.first() {
            Some((_, Column::Text(v))) => v.len(),
            Some((_, Column::Number(v))) => v.len(),
            None => 0,
        }
    }

    /// A header, a line a row.
    pub(super) fn csv(&self) -> Result<Vec<u8>, BuildError> {
        let wrong = |e: &dyn std::fmt::Display| BuildError::File(format!("{}.csv: {e}", self.name));
        let mut out = csv::Writer::from_writer(Vec::new());
        out.write_record(self.columns.iter().map(|(name, _)| name)).map_err(|e| wrong(&e))?;
        for row in 0..self.rows() {
            let cells = self.columns.iter().map(|(_, column)| match column {
                Column::Text(v) => v[row].clone(),
                Column::Number(v) => v[row].map(|x| x.to_string()).unwrap_or_default(),
            });
            out.write_record(cells).map_err(|e| wrong(&e))?;
        }
        out.into_inner().map_err(|e| wrong(&e))
    }

    /// The files of this table by name: CSV, and Parquet where the program was built with it.
    pub(super) fn files(&self) -> Result<Vec<(String, Vec<u8>)>, BuildError> {
        Ok(vec![
            (format!("{}.csv", self.name), self.csv()?),
            #[cfg(feature = "parquet")]
            (format!("{}.parquet", self.name), self.parquet()?),
        ])
    }

    /// One row group, not compressed; text is UTF-8, an empty number is null.
    #[cfg(feature = "parquet")]
    fn parquet(&self) -> Result<Vec<u8>, BuildError> {
        self.write_parquet().map_err(|e| BuildError::File(format!("{}.parquet: {e}", self.name)))
    }

    #[cfg(feature = "parquet")]
    fn write_parquet(&self) -> Result<Vec<u8>, ParquetError> {
        let fields: String = self
            .columns
            .iter()
            .map(|(name, column)| match column {
                Column::Text(_) => format!("required binary {name} (UTF8);"),
                Column::Number(_) => format!("optional double {name};"),
            })
            .collect();
        let schema = std::sync::Arc::new(parse_message_type(&format!("message {} {{{fields}}}", self.name))?);
        let mut bytes = Vec::new();
        let mut file =
            SerializedFileWriter::new(&mut bytes, schema, std::sync::Arc::new(WriterProperties::builder().build()))?;
        let mut group = file.next_row_group()?;
        for (_, column) in &self.columns {
            let Some(mut writer) = group.next_column()? else { break };
            match (writer.untyped(), column) {
                (ColumnWriter::ByteArrayColumnWriter(w), Column::Text(values)) => {
                    let values: Vec<ByteArray> = values.iter().map(|v| ByteArray::from(v.as_str())).collect();
                    w.write_batch(&values, None, None)?;
                }
                (ColumnWriter::DoubleColumnWriter(w), Column::Number(values)) => {
                    let there: Vec<f64> = values.iter().flatten().copied().collect();
                    let levels: Vec<i16> = values.iter().map(|v| i16::from(v.is_some())).collect();
                    w.write_batch(&there, Some(&levels), None)?;
                }
                _ => return Err(ParquetError::General("a column of another type than its values".into())),
            }
            writer.close()?;
        }
        group.close()?;
        file.close()?;
        Ok(bytes)
    }
}

#[cfg(all(test, feature = "parquet"))]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};

    #[test]
    fn parquet_reads_back_with_its_empty_cells() {
        let columns = vec![
            ("knee", Column::Text(vec!["a".into(), "b, \"c\"".into(), String::new()])),
            ("value", Column::Number(vec![Some(1.5), None, Some(-2.0)])),
        ];
        let table = Table { name: "knees", columns };
        assert_eq!(table.csv().unwrap(), b"knee,value\na,1.5\n\"b, \"\"c\"\"\",\n,-2\n");
        let reader = SerializedFileReader::new(bytes::Bytes::from(table.parquet().unwrap())).unwrap();
        let rows: Vec<String> = reader.get_row_iter(None).unwrap().map(|r| r.unwrap().to_string()).collect();
        assert_eq!(rows.len(), 3);
        assert!(rows[0].contains("1.5") && rows[1].contains("null") && rows[2].contains("-2"), "{rows:?}");
    }
}
