//! report.html: one self-contained page with what the build made, to look at and to turn about; and two builds side by side.

use crate::error::BuildError;
use crate::inspect;
use crate::record::{Failure, Record};
use crate::stage::list::heading;
use crate::store::BuildFolder;
use serde_json::json;
use std::path::Path;

mod body;
mod cards;
pub(crate) mod chart;
pub(crate) mod check;
mod compare;
mod diagnosis_curves;
pub(crate) mod diagnosis_page;
mod failed;
pub(crate) mod geometry;
pub(crate) mod html;
mod methods;
mod motion;
pub(crate) mod picture;
mod pressure;
pub(crate) mod scene;
mod sheet;
mod warnings;

use body::Body;
pub(crate) use html::escaped;
use html::foot;
pub(crate) use html::{head, plotly_js};

/// What other pages of the program are made of too.
pub(crate) mod page_parts {
    pub(crate) use super::chart::{COLOURS, layout};
    pub(crate) use super::html::escaped;
    pub(crate) use super::{head, plotly_js};
}

/// Writes the report of the build in or below `dir` again, or with `other` the comparison of the two builds.
pub fn rewrite(dir: &Path, other: Option<&Path>) -> Result<String, BuildError> {
    let build = inspect::build_folder(dir)?;
    let folder = BuildFolder::open(&build)?;
    let records = inspect::records(&build)?;
    let name = match other {
        None => {
            folder.write_file("report.html", page(&folder, &records, inspect::failure(&build).as_ref())?.as_bytes())?;
            "report.html"
        }
        Some(other) => {
            let other = inspect::build_folder(other)?;
            let second = BuildFolder::open(&other)?;
            let page = compare::page([(&folder, &records), (&second, &inspect::records(&other)?)], [&build, &other])?;
            folder.write_file("compare.html", page.as_bytes())?;
            "compare.html"
        }
    };
    Ok(format!("{}\n", build.join(name).display()))
}

/// methods.md: versions, options and digests as plain text; empty where run.toml cannot be read.
pub fn methods(folder: &BuildFolder, records: &[Record]) -> String {
    let run = folder.read_file("run.toml").unwrap_or_default();
    methods::Methods::read(&run, records).map_or(String::new(), |m| m.markdown())
}

/// The page. It holds no times, so that the same build gives the same bytes.
pub fn page(folder: &BuildFolder, records: &[Record], failure: Option<&Failure>) -> Result<String, BuildError> {
    let mut body = Body::new(folder, records, "a", true);
    let (id, synthetic) = body.identity();
    let mut html = head(&id);
    html += &format!(
        "<header><h1>{}</h1><p>From raw measurements to a model of the knee, stage by stage.</p>",
        escaped(&id)
    );
    if synthetic {
        html += "<p class=\"synthetic\">This knee is synthetic: made by the program, not measured.</p>";
    }
    html += "<button type=\"button\" class=\"one-page\" hidden>Print one page</button></header>";
    html += &body.sheet(failure);
    html += &body.first(failure);
    html += &contents(records, failure);
    html += "<main id=\"stages\">";
    for record in records {
        html += &format!("<section id=\"{}\"><h2>{}</h2>", record.stage, heading(&record.stage));
        html += &body.stage(record);
        html += "</section>";
    }
    if let Some(failure) = failure.filter(|f| records.iter().all(|r| r.stage != f.stage)) {
        html += &body.failed(failure);
    }
    html += &body.methods(records);
    html += "</main>";
    Ok(html + &foot(json!({"a": body.data()})))
}

fn contents(records: &[Record], failure: Option<&Failure>) -> String {
    let stages = records.iter().map(|r| r.stage.as_str()).chain(failure.map(|f| f.stage.as_str()));
    let mut links: Vec<String> =
        stages.map(|s| format!("<li><a href=\"#{0}\">{1}</a></li>", escaped(s), escaped(&heading(s)))).collect();
    links.dedup();
    links.push("<li><a href=\"#methods\">methods</a></li>".into());
    format!("<nav aria-label=\"Stages\"><ul>{}</ul></nav>", links.concat())
}
