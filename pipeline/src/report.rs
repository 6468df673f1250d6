//! report.html: one self-contained page with what the build made, to look at and to turn about; and two builds side by side.

use crate::error::BuildError;
use crate::inspect;
use crate::record::{self, Failure, Record};
use crate::stage::list::heading;
use crate::store::{self, BuildFolder};
use crate::told::{Told, schemas};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::json;
use std::path::Path;

mod body;
mod cards;
pub(crate) mod chart;
pub(crate) mod check;
mod compare;
mod diagnosis_curves;
pub(crate) mod diagnosis_page;
mod diagnosis_unnamed;
mod failed;
pub(crate) mod geometry;
pub(crate) mod html;
pub(crate) mod live;
pub(crate) mod live_model;
mod methods;
mod motion;
pub(crate) mod number;
pub(crate) mod picture;
pub(crate) mod scene;
mod sheet;
mod warnings;

use body::Body;
pub(crate) use html::escaped;
use html::{SKIP_TO_KNEE, foot};
pub(crate) use html::{head, plotly_js};

/// What other pages of the program are made of too.
pub(crate) mod page_parts {
    pub(crate) use super::chart::{COLOURS, layout};
    pub(crate) use super::html::escaped;
    pub(crate) use super::{head, plotly_js};
}

/// `report --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ReportTold {
    /// report/1
    pub schema: &'static str,
    /// The build's folder.
    pub build: String,
    /// The page that was written: report.html, report-stopped.html beside the report of a whole build, or compare.html.
    pub page: String,
    /// The other build's folder, where two are compared.
    pub compared_with: Option<String>,
    /// The text with versions, options and digests that belongs to the page; null of a comparison.
    pub methods: Option<String>,
    /// What stopped the build; null where nothing did.
    pub failed: Option<Failure>,
    /// The stages that the page shows, in order.
    pub stages: Vec<ShownStage>,
}

/// A stage on the page.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ShownStage {
    /// Its name.
    pub stage: String,
    /// Digest of its value.
    pub digest: String,
    /// How many warnings it has.
    pub warnings: usize,
}

/// Writes the report of the build in or below `dir` again, or with `other` the comparison of the two builds.
pub fn rewrite(dir: &Path, other: Option<&Path>) -> Result<Told, BuildError> {
    let build = inspect::build_folder(dir)?;
    let folder = BuildFolder::open(&build)?;
    let records = inspect::records(&build)?;
    let failure = inspect::failure(&build);
    let other = other.map(inspect::build_folder).transpose()?;
    let name = match &other {
        None => {
            let whole = !store::exists(&build.join(STOPPED));
            write(&folder, &records, failure.as_ref(), whole)?
        }
        Some(other) => {
            let second = BuildFolder::open(other)?;
            let page = compare::page(
                [(&folder, &record::current(&records)), (&second, &record::current(&inspect::records(other)?))],
                [&build, other],
            )?;
            folder.write_file("compare.html", page.as_bytes())?;
            "compare.html"
        }
    };
    let place = |name: &str| build.join(name).display().to_string();
    let shown =
        |r: &Record| ShownStage { stage: r.stage.clone(), digest: r.digest.clone(), warnings: r.warnings.len() };
    let data = ReportTold {
        schema: schemas::REPORT,
        build: build.display().to_string(),
        page: place(name),
        methods: other.is_none().then(|| place(METHODS[usize::from(name == STOPPED)])),
        compared_with: other.map(|o| o.display().to_string()),
        failed: failure,
        stages: record::current(&records).iter().map(shown).collect(),
    };
    Ok(Told::words(format!("{}\n", place(name))).with(&data))
}

/// The report of a build.
pub const REPORT: &str = "report.html";
/// What a run that came less far writes beside it.
pub const STOPPED: &str = "report-stopped.html";
const FAILURE: &str = "failure.json";
/// The methods that belong to either.
const METHODS: [&str; 2] = ["methods.md", "methods-stopped.md"];

/// Writes the report with its methods, and what stopped the build; gives the report's name. A report is replaced by that of a `whole` run, by one that is
/// as complete, or where it was one of a build that stopped; else the new one stands beside it.
pub fn write(
    folder: &BuildFolder,
    records: &[Record],
    failure: Option<&Failure>,
    whole: bool,
) -> Result<&'static str, BuildError> {
    let there = |name: &str| store::exists(&folder.path().join(name));
    let good = there(REPORT) && (there(STOPPED) || !there(FAILURE));
    let beside = good && !whole && records.iter().any(|r| r.outdated);
    match failure {
        Some(failure) => folder.write_file(FAILURE, &record::json(failure))?,
        None => store::discard(&folder.path().join(FAILURE)),
    }
    if !beside {
        [STOPPED, METHODS[1]].iter().for_each(|name| store::discard(&folder.path().join(name)));
    }
    let name = if beside { STOPPED } else { REPORT };
    let current = record::current(records);
    folder.write_file(METHODS[usize::from(beside)], methods(folder, &current).as_bytes())?;
    folder.write_file(name, page(folder, &current, failure)?.as_bytes())?;
    Ok(name)
}

/// methods.md: versions, options and digests as plain text; empty where run.toml cannot be read.
fn methods(folder: &BuildFolder, records: &[Record]) -> String {
    let run = folder.read_file("run.toml").unwrap_or_default();
    methods::Methods::read(&run, records).map_or(String::new(), |m| m.markdown())
}

/// The page. It holds no times, so that the same build gives the same bytes.
fn page(folder: &BuildFolder, records: &[Record], failure: Option<&Failure>) -> Result<String, BuildError> {
    let mut body = Body::new(folder, records, "a", true);
    let (id, synthetic) = body.identity();
    let mut html = format!(
        "<header><h1>{}</h1><p>From raw measurements to a model of the knee, stage by stage.</p>",
        escaped(&id)
    );
    if synthetic {
        html += "<p class=\"synthetic\">This knee is synthetic: made by the program, not measured.</p>";
    }
    html += "<button type=\"button\" class=\"print\" hidden>Print one page</button>";
    html += "<button type=\"button\" class=\"print\" data-whole hidden>Print the whole report</button></header>";
    html += &body.sheet(failure);
    html += &body.first(failure);
    html += &body.live();
    html += &contents(records, failure, body.is_live());
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
    let live = body.live_scripts();
    let skip = if body.is_live() { SKIP_TO_KNEE } else { "" };
    Ok(head(&id) + skip + &html + &foot(json!({"a": body.data()}), &live))
}

fn contents(records: &[Record], failure: Option<&Failure>, live: bool) -> String {
    let stages = records.iter().map(|r| r.stage.as_str()).chain(failure.map(|f| f.stage.as_str()));
    let mut links: Vec<String> =
        stages.map(|s| format!("<li><a href=\"#{0}\">{1}</a></li>", escaped(s), escaped(&heading(s)))).collect();
    links.dedup();
    if live {
        links.insert(0, "<li><a href=\"#live\">pull at the knee</a></li>".into());
    }
    links.push("<li><a href=\"#methods\">methods</a></li>".into());
    format!("<nav aria-label=\"Stages\"><ul>{}</ul></nav>", links.concat())
}
