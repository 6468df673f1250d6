//! report.html: one self-contained page with what the build made, to look at.

use crate::error::BuildError;
use crate::inspect;
use crate::run_log::{Record, STAGES, folder_name};
use crate::store::BuildFolder;
use base64::Engine;
use std::fmt::Write;
use std::path::Path;

mod pictures;

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#222}\
h1{margin-bottom:0}h2{margin-top:2.5rem;border-bottom:1px solid #ddd}figure{display:inline-block;margin:0 1rem 1rem 0;vertical-align:top}\
figcaption{max-width:26rem;font-size:.9rem;color:#555}img{border:1px solid #eee}table{border-collapse:collapse}\
td,th{padding:.15rem .8rem .15rem 0;text-align:left;vertical-align:top;font-size:.9rem}.warn{background:#fff3cd;padding:.3rem .6rem;margin:.3rem 0}\
.synthetic{background:#e2e9f7;padding:.3rem .6rem}";

/// Writes the report of the build in or below `dir` again.
pub fn rewrite(dir: &Path) -> Result<String, BuildError> {
    let build = inspect::build_folder(dir)?;
    let folder = BuildFolder::open(&build)?;
    let records = inspect::records(&build)?;
    folder.write_file("report.html", page(&folder, &records)?.as_bytes())?;
    Ok(format!("{}\n", build.join("report.html").display()))
}

/// The page. It holds no times, so that the same build gives the same bytes.
pub fn page(folder: &BuildFolder, records: &[Record]) -> Result<String, BuildError> {
    let values = pictures::Values::read(folder);
    let mut html = String::new();
    let (id, synthetic) = values.identity();
    let id = escaped(&id);
    let _ = write!(
        html,
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>{id}</title><style>{STYLE}</style><h1>{id}</h1><p>From raw measurements to an assembled knee model, stage by stage.</p>"
    );
    if synthetic {
        html += "<p class=\"synthetic\">This knee is synthetic: made by the program, not measured.</p>";
    }
    for record in records {
        let number = STAGES.iter().find(|(_, s)| *s == record.stage).map_or("", |(n, _)| n);
        let _ = write!(html, "<h2>{number} {}</h2>", record.stage);
        for warning in &record.warnings {
            let _ = write!(html, "<p class=\"warn\">{}</p>", escaped(warning));
        }
        for picture in values.pictures(&record.stage) {
            let _ = write!(
                html,
                "<figure><img alt=\"{0}\" width=\"{1}\" src=\"data:image/png;base64,{2}\"><figcaption>{0}</figcaption></figure>",
                escaped(&picture.caption),
                picture.width,
                base64::engine::general_purpose::STANDARD.encode(&picture.png)
            );
        }
        html += &metrics_table(record);
    }
    html += "</html>\n";
    Ok(html)
}

fn metrics_table(record: &Record) -> String {
    let mut rows = Vec::new();
    flatten("", &record.metrics, &mut rows);
    let mut html = format!(
        "<details><summary>{} figures; artifacts in <code>{}</code></summary><table>",
        rows.len(),
        folder_name(&record.stage)
    );
    for (name, value) in rows {
        let _ = write!(html, "<tr><td>{}</td><td>{}</td></tr>", escaped(&name), escaped(&value));
    }
    html + "</table></details>"
}

fn flatten(prefix: &str, value: &serde_json::Value, rows: &mut Vec<(String, String)>) {
    let join = |key: &str| if prefix.is_empty() { key.to_string() } else { format!("{prefix}.{key}") };
    match value {
        serde_json::Value::Object(map) => map.iter().for_each(|(k, v)| flatten(&join(k), v, rows)),
        serde_json::Value::Array(items) if items.len() <= 6 => {
            items.iter().enumerate().for_each(|(i, v)| flatten(&join(&i.to_string()), v, rows));
        }
        serde_json::Value::Array(items) => rows.push((prefix.into(), format!("{} values", items.len()))),
        serde_json::Value::Number(n) => {
            let x = n.as_f64().unwrap_or(f64::NAN);
            rows.push((prefix.into(), if x.fract() == 0.0 { format!("{x}") } else { format!("{x:.4}") }));
        }
        other => rows.push((prefix.into(), other.to_string().trim_matches('"').to_string())),
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
