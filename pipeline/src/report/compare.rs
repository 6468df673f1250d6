//! Two builds side by side: before and after a change, or two knees.

use super::body::Body;
use super::html::{escaped, flatten, foot, head};
use crate::error::BuildError;
use crate::inspect;
use crate::record::Record;
use crate::stage::list::{STAGES, heading};
use crate::store::BuildFolder;
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

type Build<'a> = (&'a BuildFolder, &'a [Record]);

/// The page of two builds that lie in the folders `places`.
pub(super) fn page(builds: [(&BuildFolder, &Vec<Record>); 2], places: [&Path; 2]) -> Result<String, BuildError> {
    let [one, two]: [Build; 2] = builds.map(|(f, r)| (f, r.as_slice()));
    let mut bodies = [Body::new(one.0, one.1, "a", false), Body::new(two.0, two.1, "b", false)];
    let names = [0, 1].map(|k| bodies[k].identity().0);
    let mut html = head(&format!("{} and {}", names[0], names[1]));
    html += "<header><h1>Two builds side by side</h1></header><div class=\"pair\">";
    for k in 0..2 {
        let _ = write!(
            html,
            "<section><h2>{}: {}</h2><p><code>{}</code></p>{}</section>",
            ["Left", "Right"][k],
            escaped(&names[k]),
            escaped(&places[k].display().to_string()),
            bodies[k].verdict(inspect::failure(places[k]).as_ref())
        );
    }
    html += "</div><main id=\"stages\">";
    for stage in STAGES.map(|s| s.name()) {
        let of = |records: &[Record]| records.iter().find(|r| r.stage == stage).cloned();
        let found = [of(one.1), of(two.1)];
        if found.iter().all(Option::is_none) {
            continue;
        }
        let _ = write!(html, "<section id=\"{stage}\"><h2>{}</h2><div class=\"pair\">", heading(stage));
        for (body, record) in bodies.iter_mut().zip(&found) {
            html += "<div>";
            html += &match record {
                Some(_) => body.scenes(stage) + &body.charts(stage),
                None => "<p>This build has not come so far.</p>".into(),
            };
            html += "</div>";
        }
        html += "</div>";
        html += &differences(&found);
        html += "</section>";
    }
    html += "</main>";
    let [a, b] = bodies;
    Ok(html + &foot(json!({"a": a.data(), "b": b.data()}), ""))
}

/// The figures of both, those that differ first.
fn differences(found: &[Option<Record>; 2]) -> String {
    let rows = [0, 1].map(|k| {
        let mut rows = Vec::new();
        if let Some(r) = &found[k] {
            flatten("", &r.metrics, &mut rows);
        }
        rows.into_iter().collect::<BTreeMap<String, String>>()
    });
    let names: std::collections::BTreeSet<&String> = rows[0].keys().chain(rows[1].keys()).collect();
    let (mut same, mut other) = (0, String::new());
    for name in names {
        let [a, b] = [0, 1].map(|k| rows[k].get(name).cloned().unwrap_or_default());
        if a == b {
            same += 1;
            continue;
        }
        let change = match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(x), Ok(y)) => format!("{:+.4}", y - x),
            _ => String::new(),
        };
        let _ = write!(
            other,
            "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{change}</td></tr>",
            escaped(name),
            escaped(&a),
            escaped(&b)
        );
    }
    if other.is_empty() {
        return format!("<p>All {same} figures are the same.</p>");
    }
    format!(
        "<details open><summary>Figures that differ ({same} are the same)</summary><div class=\"wide\"><table><thead><tr><th>figure</th><th>left</th><th>right</th><th>right less left</th></tr></thead><tbody>{other}</tbody></table></div></details>"
    )
}
