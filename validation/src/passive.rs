//! Measured passive flexion: `fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm`, clinical signs.

use calibration::CalibrationError;
use sim::spec::PoseSpec;

/// The columns, in order.
pub const COLUMNS: [&str; 6] = ["fe_deg", "vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"];

/// Reads a passive flexion CSV.
///
/// # Errors
/// Another header, a row of another length, a cell that is no finite number, no row; by row.
pub fn read(bytes: &[u8]) -> Result<Vec<PoseSpec>, CalibrationError> {
    let refuse =
        |row: usize, what: String| Err(CalibrationError::Targets(format!("passive flexion, row {row}: {what}")));
    let table = match sim::text::table(bytes, &COLUMNS.map(String::from)) {
        Ok(table) => table,
        Err(kind) => return refuse(1, format!("{kind}; expected a table: an Excel workbook (.xlsx) or CSV UTF-8")),
    };
    let separator = table.separator.unwrap_or(',');
    let mut lines = table.text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty());
    let header: Vec<&str> = lines.next().map_or(vec![], |(_, l)| l.split(separator).map(str::trim).collect());
    if header != COLUMNS {
        return refuse(1, format!("columns {}, expected {}", header.join(","), COLUMNS.join(",")));
    }
    let mut out = Vec::new();
    for (i, line) in lines {
        let cells: Vec<&str> = line.split(separator).map(str::trim).collect();
        let mut values = [0.0; 6];
        if cells.len() != 6 {
            return refuse(i + 1, format!("{} cells, expected 6", cells.len()));
        }
        for ((value, cell), name) in values.iter_mut().zip(&cells).zip(COLUMNS) {
            match cell.parse::<f64>() {
                Ok(x) if x.is_finite() && x.abs() < 1000.0 => *value = x,
                _ => return refuse(i + 1, format!("{name} is {cell:?}, expected a number in deg or mm")),
            }
        }
        let [fe_deg, vv_deg, ie_deg, ml_mm, ap_mm, si_mm] = values;
        out.push(PoseSpec { fe_deg, vv_deg, ie_deg, ml_mm, ap_mm, si_mm });
    }
    if out.is_empty() { refuse(2, "no pose below the header".into()) } else { Ok(out) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_read_and_faults_named_by_row() {
        let header = COLUMNS.join(",");
        let poses = read(format!("{header}\n1,2,3,4,5,6\n\n7,8,9,10,11,12\n").as_bytes()).unwrap();
        assert_eq!((poses.len(), poses[1].si_mm), (2, 12.0));
        let error = |text: String| read(text.as_bytes()).unwrap_err().to_string();
        assert!(error(header.clone()).contains("no pose"));
        assert!(error(format!("{header}\n1,2,3,4,5\n")).contains("row 2: 5 cells"));
        assert!(error(format!("{header}\n1,2,3,4,5,6\n1,2,nan,4,5,6\n")).contains("row 3: ie_deg"));
        assert!(error("fe,vv\n".into()).contains("expected fe_deg"));
        assert!(read(&[0xff, 0xfe]).is_err());
    }
}
