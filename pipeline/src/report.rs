//! report.html: one self-contained page with what the build made, to look at and to turn about; and two builds side by side.

use crate::error::BuildError;
use crate::inspect;
use crate::run_log::{Record, STAGES};
use crate::store::{self, BuildFolder};
use plotly::Plot;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::Path;

mod body;
mod cartilage_scenes;
mod charts;
mod compare;
mod force_charts;
mod geometry;
mod law_charts;
mod methods;
mod motion;
mod pictures;
mod scene;
mod scenes;
mod values;
mod verdict;
mod warnings;

use body::Body;
pub(crate) use body::escaped;

/// What other pages of the program are made of too.
pub(crate) mod page_parts {
    pub(crate) use super::body::escaped;
    pub(crate) use super::charts::{COLOURS, layout};
    pub(crate) use super::{head, plotly_js};
}

/// What stopped a build; kept as failure.json until a build goes through.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Failure {
    /// The stage.
    pub stage: String,
    /// Why, and what to do.
    pub message: String,
}

/// Writes the report of the build in or below `dir` again, or with `other` the comparison of the two builds.
pub fn rewrite(dir: &Path, other: Option<&Path>) -> Result<String, BuildError> {
    let build = inspect::build_folder(dir)?;
    let folder = BuildFolder::open(&build)?;
    let records = inspect::records(&build)?;
    let name = match other {
        None => {
            folder.write_file("report.html", page(&folder, &records, failure(&build).as_ref())?.as_bytes())?;
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

/// What stopped the build in `build`, if anything did.
pub fn failure(build: &Path) -> Option<Failure> {
    let path = build.join("failure.json");
    if !store::exists(&path) {
        return None;
    }
    serde_json::from_str(&store::read_text(&path).ok()?).ok()
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
    html += "</header>";
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

/// `04 cartilage`.
fn heading(stage: &str) -> String {
    let number = STAGES.iter().find(|(_, s)| *s == stage).map_or("", |(n, _)| n);
    format!("{number} {stage}")
}

fn contents(records: &[Record], failure: Option<&Failure>) -> String {
    let stages = records.iter().map(|r| r.stage.as_str()).chain(failure.map(|f| f.stage.as_str()));
    let mut links: Vec<String> =
        stages.map(|s| format!("<li><a href=\"#{0}\">{1}</a></li>", escaped(s), escaped(&heading(s)))).collect();
    links.dedup();
    links.push("<li><a href=\"#methods\">methods</a></li>".into());
    format!("<nav aria-label=\"Stages\"><ul>{}</ul></nav>", links.concat())
}

pub(crate) fn head(title: &str) -> String {
    format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <link rel=\"icon\" href=\"data:,\"><title>{}</title><style>{}</style></head><body><a class=\"skip\" href=\"#stages\">To the stages</a>",
        escaped(title),
        include_str!("report/style.css")
    )
}

/// The data, plotly.js and what draws with it. A page without JavaScript shows the still pictures.
fn foot(data: Value) -> String {
    // a `</` inside a string would end the script
    let data = data.to_string().replace("</", "<\\/");
    format!(
        "<script type=\"application/json\" id=\"data\">{data}</script>{}<script>{}</script></body></html>\n",
        plotly_js(),
        include_str!("report/viewer.js")
    )
}

/// The script element of plotly.js alone: the crate's sources also hold MathJax, for which the report has no use.
pub(crate) fn plotly_js() -> String {
    let sources = Plot::offline_js_sources();
    let end = sources.find("</script>").map_or(sources.len(), |at| at + "</script>".len());
    sources[..end].to_owned()
}
