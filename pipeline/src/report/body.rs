//! The parts of the report: verdict, a stage, what failed, the diagnosis.

use super::chart::Chart;
use super::charts;
use super::force_charts;
use super::geometry::Pool;
use super::html::{escaped, flatten, heading};
use super::methods::Methods;
use super::motion::{self, Motion};
use super::scene::Scene;
use super::scenes;
use super::values::Values;
use super::verdict::{self, Check, KeyFigure};
use super::warnings;
use crate::record::{Failure, Record, folder_name};
use crate::store::BuildFolder;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Map, Value, json};
use std::fmt::Write;

/// A build's part of a page, and the data that its scenes and charts draw.
pub(super) struct Body<'a> {
    pub(super) values: Values,
    folder: &'a BuildFolder,
    warnings: Vec<(String, String)>,
    /// Its key in the page's data.
    key: &'static str,
    /// With still pictures.
    stills: bool,
    pool: Pool,
    scenes: Vec<Scene>,
    charts: Map<String, Value>,
    motions: Vec<Motion>,
    /// Stages that are there.
    stages: Vec<String>,
    /// Whether the knee stands on the first screen already.
    knee_shown: bool,
}

impl<'a> Body<'a> {
    /// A body of the build in `folder`.
    pub(super) fn new(folder: &'a BuildFolder, records: &[Record], key: &'static str, stills: bool) -> Body<'a> {
        let stages: Vec<&str> = records.iter().map(|r| r.stage.as_str()).collect();
        let values = Values::read(folder, &stages);
        let pool = Pool::new(values.frames.as_ref());
        let motions = motion::motions(&values, &pool);
        let warnings = records.iter().flat_map(|r| r.warnings.iter().map(|w| (r.stage.clone(), w.clone()))).collect();
        Body {
            values,
            folder,
            warnings,
            key,
            stills,
            pool,
            scenes: vec![],
            charts: Map::new(),
            motions,
            stages: stages.into_iter().map(String::from).collect(),
            knee_shown: false,
        }
    }

    /// Name, and whether the knee is synthetic.
    pub(super) fn identity(&self) -> (String, bool) {
        self.values.identity()
    }

    /// The first screen: a sentence, three figures with their limits, the knee, what to look at next; then questions and warnings.
    pub(super) fn first(&mut self, failure: Option<&Failure>) -> String {
        let checks = verdict::checks(&self.values);
        let knee = scenes::knee(&self.values, &mut self.pool, !self.motions.is_empty());
        self.knee_shown = knee.is_some();
        let picture = knee.map_or(String::new(), |scene| self.figure(scene, "assemble"));
        let mut html = format!("<div class=\"first\"><div>{}", self.sentence(&checks, failure));
        html += &key_figures(&verdict::figures(&self.values));
        html += &self.next(&checks, failure);
        html += &format!("</div>{picture}</div>");
        html + &self.details(&checks)
    }

    /// The verdict, the questions and the warnings, without the knee.
    pub(super) fn verdict(&self, failure: Option<&Failure>) -> String {
        let checks = verdict::checks(&self.values);
        self.sentence(&checks, failure) + &self.details(&checks)
    }

    /// The verdict in a sentence.
    fn sentence(&self, checks: &[Check], failure: Option<&Failure>) -> String {
        let bad = checks.iter().filter(|c| c.good == Some(false)).count();
        let heavy = warnings::groups(&self.warnings).iter().filter(|g| g.heavy).count();
        let kinds = |n: usize| format!("{n} {} of warning", if n == 1 { "kind" } else { "kinds" });
        let (class, words) = match failure {
            Some(f) => ("failed", format!("The build stopped at {}.", heading(&f.stage))),
            None if bad > 0 => (
                "look",
                format!(
                    "Built, but {bad} of {} answers {} outside the limits.",
                    checks.len(),
                    if bad == 1 { "is" } else { "are" }
                ),
            ),
            None if heavy > 0 => {
                ("look", format!("Built, within all limits. {} may make the model wrong.", kinds(heavy)))
            }
            None => ("good", "Built, within all limits.".to_owned()),
        };
        let mut html = format!("<p class=\"verdict {class}\" id=\"verdict\"><strong>{}</strong></p>", escaped(&words));
        if let Some(f) = failure {
            let _ = write!(html, "<p class=\"failure\">{}</p>", escaped(&f.message));
        }
        html
    }

    /// What to look at next, three things at most.
    fn next(&self, checks: &[Check], failure: Option<&Failure>) -> String {
        let link =
            |stage: &str, words: &str| format!("<li><a href=\"#{}\">{}</a></li>", escaped(stage), escaped(words));
        let mut items: Vec<String> = failure.iter().map(|f| link(&f.stage, "Where it stopped, and on what")).collect();
        let bad = checks.iter().filter(|c| c.good == Some(false));
        items.extend(bad.map(|c| link(c.stage, &format!("{} {}", c.question, c.answer))));
        let groups = warnings::groups(&self.warnings);
        items.extend(groups.iter().filter(|g| g.heavy).filter_map(|g| Some(link(&g.stage, g.all.first()?))));
        for (stage, words) in [
            ("register", "Does bare bone of the scans lie on the CT bones?"),
            ("attachments", "Does every site lie where the ligament attaches?"),
            ("calibrate", "Does the model answer as the knee did?"),
        ] {
            if self.stages.iter().any(|s| s == stage) {
                items.push(link(stage, words));
            }
        }
        items.truncate(3);
        if items.is_empty() {
            return String::new();
        }
        format!("<p><b>Look at next</b></p><ol class=\"next\">{}</ol>", items.concat())
    }

    fn details(&self, checks: &[Check]) -> String {
        questions(checks) + &warnings::html(&self.warnings)
    }

    /// A stage's warnings, scenes, charts, tables and figures.
    pub(super) fn stage(&mut self, record: &Record) -> String {
        let mine: Vec<(String, String)> = self.warnings.iter().filter(|(s, _)| *s == record.stage).cloned().collect();
        let mut html = warnings::html(&mine);
        if record.stage == "assemble" && self.knee_shown {
            html += "<p>The knee in 3D stands <a href=\"#verdict\">at the top</a>.</p>";
        }
        html += &self.scenes(&record.stage);
        html += &self.charts(&record.stage);
        if record.stage == "validate" {
            html += &self.paper();
        }
        if record.stage == "diagnose" {
            html += &self.diagnosis();
        }
        html + &metrics_table(record)
    }

    /// Versions, options and digests.
    pub(super) fn methods(&self, records: &[Record]) -> String {
        let run = self.folder.read_file("run.toml").unwrap_or_default();
        Methods::read(&run, records).map_or(String::new(), |m| m.html())
    }

    /// The scenes of a stage with their stills.
    pub(super) fn scenes(&mut self, stage: &str) -> String {
        let warnings: Vec<String> = self.warnings.iter().filter(|(s, _)| s == stage).map(|(_, w)| w.clone()).collect();
        let mut new = scenes::scenes(stage, &warnings, &self.values, &mut self.pool);
        if stage == "assemble" && !self.knee_shown {
            new.extend(scenes::knee(&self.values, &mut self.pool, !self.motions.is_empty()));
        }
        new.into_iter().map(|scene| self.figure(scene, stage)).collect()
    }

    /// A scene with the stills of its stage.
    fn figure(&mut self, scene: Scene, stage: &str) -> String {
        let stills: String =
            if self.stills { self.values.pictures(stage).iter().map(still).collect() } else { String::new() };
        let html = format!(
            "<figure data-scene=\"{0}/{1}\" id=\"scene-{0}-{1}\"><h3>{2}</h3><div class=\"still\">{stills}</div><figcaption id=\"text-{0}-{1}\">{3}</figcaption></figure>",
            self.key,
            scene.id,
            escaped(&scene.title),
            escaped(&scene.text)
        );
        self.scenes.push(scene);
        html
    }

    /// The charts of a stage.
    pub(super) fn charts(&mut self, stage: &str) -> String {
        let mut all = charts::charts(stage, &self.values);
        if stage == "calibrate" {
            all.extend(force_charts::charts(self.folder));
        }
        if all.is_empty() {
            return String::new();
        }
        let mut html = "<div class=\"charts\">".to_owned();
        for Chart { id, title, text, plot } in all {
            let _ = write!(
                html,
                "<figure><h3>{0}</h3><div class=\"chart\" role=\"img\" aria-label=\"{0}. {1}\" data-chart=\"{2}/{3}\"></div><figcaption>{1}</figcaption></figure>",
                escaped(&title),
                escaped(&text),
                self.key,
                escaped(&id)
            );
            self.charts.insert(id, serde_json::from_str(&plot).unwrap_or_default());
        }
        html + "</div>"
    }

    /// The paper's tables and figures for this knee.
    fn paper(&self) -> String {
        let Some(v) = &self.values.validation else { return String::new() };
        let mut html = String::new();
        let files = self.folder.read_folder(&folder_name("validate")).unwrap_or_default();
        for (name, bytes) in files.iter().filter(|(name, _)| name.ends_with(".svg")) {
            let title = name.trim_end_matches(".svg").replace('_', ", ").replace("figure", "Figure ");
            let _ = write!(
                html,
                "<figure data-svg=\"{0}\"><h3>{0}</h3><img class=\"paper\" alt=\"{0} of the paper, drawn for this knee; the tables below hold its numbers\" src=\"data:image/svg+xml;base64,{1}\"></figure>",
                escaped(&title),
                STANDARD.encode(bytes)
            );
        }
        let tables = validation::tables::tables(&v.sources);
        for t in tables.iter().chain([&validation::tables::differences(&v.differences)]) {
            let row = |cells: &[String], tag: &str| {
                cells.iter().map(|c| format!("<{tag}>{}</{tag}>", escaped(c))).collect::<String>()
            };
            let rows: String = t.rows.iter().map(|r| format!("<tr>{}</tr>", row(r, "td"))).collect();
            let _ = write!(
                html,
                "<details><summary>{}</summary><div class=\"wide\" tabindex=\"0\"><table><thead><tr>{}</tr></thead><tbody>{rows}</tbody></table></div></details>",
                escaped(&t.title),
                row(&t.header, "th")
            );
        }
        html
    }

    /// What stopped the build: the message, the places it names on what the stage was given.
    pub(super) fn failed(&mut self, failure: &Failure) -> String {
        let mut html = format!(
            "<section id=\"{0}\"><h2>{1}: stopped here</h2><p class=\"failure\">{2}</p>",
            escaped(&failure.stage),
            escaped(&heading(&failure.stage)),
            escaped(&failure.message)
        );
        if let Some(scene) = scenes::failed(failure, &self.values, &mut self.pool) {
            let _ = write!(
                html,
                "<figure data-scene=\"{0}/{1}\" id=\"scene-{0}-{1}\"><h3>{2}</h3><div class=\"still\"></div><figcaption id=\"text-{0}-{1}\">{3}</figcaption></figure>",
                self.key,
                scene.id,
                escaped(&scene.title),
                escaped(&scene.text)
            );
            self.scenes.push(scene);
        }
        html + "</section>"
    }

    /// The page of the diagnosis.
    fn diagnosis(&self) -> String {
        let Some(bytes) = self.folder.read_file("12-diagnose/report.html") else { return String::new() };
        let page = String::from_utf8_lossy(&bytes);
        let between = |from: &str, to: &str| {
            let rest = page.split_once(from).map_or("", |(_, rest)| rest);
            rest.split_once(to).map_or(rest, |(inside, _)| inside).to_owned()
        };
        // a tree of its own, so that neither page's style reaches the other; its headings stand below the section's
        let (style, body) = (between("<style>", "</style>"), between("<body>", "</body>"));
        let style = style.replace("h2{", "h4{").replace("h1{", "h3{");
        let body = [("<h2>", "<h4>"), ("</h2>", "</h4>"), ("<h1>", "<h3>"), ("</h1>", "</h3>")]
            .iter()
            .fold(body, |text, (from, to)| text.replace(from, to));
        format!(
            "<div class=\"diagnosis\"><template shadowrootmode=\"open\"><style>{style}</style>{body}</template></div>"
        )
    }

    /// What the page's scenes and charts draw.
    pub(super) fn data(self) -> Value {
        json!({"meshes": self.pool.json(), "scenes": self.scenes, "charts": self.charts, "motions": self.motions})
    }
}

fn key_figures(figures: &[KeyFigure]) -> String {
    if figures.is_empty() {
        return String::new();
    }
    let item = |f: &KeyFigure| {
        let class = match f.good {
            Some(true) => "good",
            Some(false) => "look",
            None => "open",
        };
        format!(
            "<li class=\"{class}\"><b>{}</b>{}<span>{}</span></li>",
            escaped(&f.value),
            escaped(f.name),
            escaped(&f.limit)
        )
    };
    format!("<ul class=\"figures\">{}</ul>", figures.iter().map(item).collect::<String>())
}

fn questions(checks: &[Check]) -> String {
    if checks.is_empty() {
        return String::new();
    }
    let rows: String = checks
        .iter()
        .map(|c| {
            let sign = match c.good {
                Some(true) => "within",
                Some(false) => "<strong>outside</strong>",
                None => "no limit",
            };
            format!(
                "<tr><th scope=\"row\"><a href=\"#{}\">{}</a></th><td class=\"sign\">{sign}</td><td>{}</td></tr>",
                c.stage,
                escaped(c.question),
                escaped(&c.answer)
            )
        })
        .collect();
    format!("<table id=\"questions\"><tbody>{rows}</tbody></table>")
}

fn still(picture: &super::pictures::Figure) -> String {
    format!(
        "<figure><img alt=\"{0}\" width=\"{1}\" src=\"data:image/png;base64,{2}\"><figcaption>{0}</figcaption></figure>",
        escaped(&picture.caption),
        picture.width,
        STANDARD.encode(&picture.png)
    )
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
