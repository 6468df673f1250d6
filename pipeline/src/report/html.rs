//! What every page of the program is made of: text for HTML, head and foot, tables of values.

use super::number::fixed;
use plotly::Plot;
use serde_json::Value;

pub(crate) fn head(title: &str) -> String {
    format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <link rel=\"icon\" href=\"data:,\"><title>{}</title><style>{}</style></head><body><a class=\"skip\" href=\"#stages\">To the stages</a>",
        escaped(title),
        include_str!("style.css")
    )
}

/// The second link of a page with a knee to pull at. A hand on the keyboard is there by two presses, however much stands before the knee.
pub(crate) const SKIP_TO_KNEE: &str = "<a class=\"skip\" href=\"#live\">To the knee</a>";

/// The parts of a page in which its reader pulls at a model.
pub(crate) struct LivePart {
    /// The section.
    pub(crate) section: String,
    /// The end of the page, with all scripts.
    pub(crate) foot: String,
}

/// The data, plotly.js and what draws with it; then `more`, scripts of a section of the page's own. A page without JavaScript shows the still pictures.
pub(super) fn foot(data: Value, more: &str) -> String {
    // a `</` inside a string would end the script
    let data = data.to_string().replace("</", "<\\/");
    format!(
        "<script type=\"application/json\" id=\"data\">{data}</script>{}<script>{}</script><script>{}</script>{more}</body></html>\n",
        plotly_js(),
        include_str!("geometry.js"),
        include_str!("viewer.js")
    )
}

/// The script element of plotly.js alone: the crate's sources also hold MathJax, for which the report has no use.
pub(crate) fn plotly_js() -> String {
    let sources = Plot::offline_js_sources();
    let end = sources.find("</script>").map_or(sources.len(), |at| at + "</script>".len());
    sources[..end].to_owned()
}

/// The numbers and words of a value by their paths.
pub(super) fn flatten(prefix: &str, value: &Value, rows: &mut Vec<(String, String)>) {
    let join = |key: &str| if prefix.is_empty() { key.to_string() } else { format!("{prefix}.{key}") };
    match value {
        Value::Object(map) => map.iter().for_each(|(k, v)| flatten(&join(k), v, rows)),
        Value::Array(items) if items.len() <= 6 => {
            items.iter().enumerate().for_each(|(i, v)| flatten(&join(&i.to_string()), v, rows));
        }
        Value::Array(items) => rows.push((prefix.into(), format!("{} values", items.len()))),
        Value::Number(n) => {
            let x = n.as_f64().unwrap_or(f64::NAN);
            rows.push((prefix.into(), if x.fract() == 0.0 { format!("{}", x + 0.0) } else { fixed(x, 4) }));
        }
        other => rows.push((prefix.into(), other.to_string().trim_matches('"').to_string())),
    }
}

/// Text for HTML.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
