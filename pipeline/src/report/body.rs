//! The parts of the report: verdict, a stage, what failed, the diagnosis.

use super::cards;
use super::chart::Chart;
use super::check::{Check, KeyFigure};
use super::failed;
use super::geometry::Pool;
use super::html::{escaped, flatten};
use super::live::{Begin, LiveKnee};
use super::methods::Methods;
use super::motion::{self, Motion};
use super::scene::{Scene, named_places};
use super::sheet::Sheet;
use super::warnings::{self, Group};
use crate::cohort::shared;
use crate::options::BuildOptions;
use crate::record::{Failure, Record};
use crate::stage::list::{Assemble, Calibration, STAGES, Validate, folder_name, heading, named};
use crate::stage::{Answer, Stage, Standing, Values, View, answers, on_paper};
use crate::store::BuildFolder;
use crate::which_model::JOINT;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use meshes::Point;
use notices::Notice;
use serde_json::{Map, Value, json};
use stages::frames::Frames;
use stages::specimen::Specimen;
use std::fmt::Write;

/// A build's part of a page, and the data that its scenes and charts draw.
pub(super) struct Body<'a> {
    values: Values<'a>,
    warnings: Vec<Notice>,
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
    /// The knee that the reader pulls at.
    live: Option<LiveKnee>,
}

impl<'a> Body<'a> {
    /// A body of the build in `folder`.
    pub(super) fn new(folder: &'a BuildFolder, records: &[Record], key: &'static str, stills: bool) -> Body<'a> {
        let stages: Vec<&str> = records.iter().map(|r| r.stage.as_str()).collect();
        let done = STAGES.into_iter().filter(|s| stages.contains(&s.name()));
        let mut values = Values::new(folder, options(folder).unwrap_or_default(), done.collect());
        let pool = Pool::new(values.of::<Frames>());
        let motions = motion::motions(&values, &pool);
        values.moves = !motions.is_empty();
        let warnings = records.iter().flat_map(Record::told).collect();
        Body {
            values,
            warnings,
            key,
            stills,
            pool,
            scenes: vec![],
            charts: Map::new(),
            motions,
            stages: stages.into_iter().map(String::from).collect(),
            knee_shown: false,
            live: None,
        }
    }

    /// Name, and whether the knee is synthetic.
    pub(super) fn identity(&self) -> (String, bool) {
        self.values.of::<Specimen>().map_or(("a knee".into(), false), |s| {
            (s.identity.id.clone(), s.identity.provenance.as_deref() == Some("synthetic"))
        })
    }

    /// The first screen: a sentence, four answers with their figures, the knee, what to look at next; then questions and warnings.
    pub(super) fn first(&mut self, failure: Option<&Failure>) -> String {
        let checks = self.checks();
        let knee = Assemble.scene(&self.values, &mut self.pool);
        self.knee_shown = knee.is_some();
        let picture = knee.map_or(String::new(), |scene| self.figure(scene, &Assemble));
        let mut html = format!("<div class=\"first\"><div>{}", self.sentence(&checks, failure));
        html += &self.answers(&checks, failure);
        html += &self.next(&checks, failure);
        html += &format!("</div>{picture}</div>");
        html + &self.details(&checks)
    }

    /// The section in which the reader pulls at the knee; nothing of a build that was not calibrated.
    pub(super) fn live(&mut self) -> String {
        let Some(knee) = LiveKnee::of(&self.values, &self.pool) else { return String::new() };
        // the live view moves, whether or not motions were stored
        let moves = std::mem::replace(&mut self.values.moves, true);
        let scene = knee.scene(&self.values, &mut self.pool);
        self.values.moves = moves;
        let Some(scene) = scene else { return String::new() };
        // its stills stand on the first screen
        let stills = std::mem::replace(&mut self.stills, false);
        let html = knee.section(&self.figure(scene, &Assemble), Begin::Calibrated);
        self.stills = stills;
        self.live = Some(knee);
        html
    }

    /// Whether the page has such a section.
    pub(super) fn is_live(&self) -> bool {
        self.live.is_some()
    }

    /// The section's scripts; nothing where there is none.
    pub(super) fn live_scripts(&self) -> String {
        self.live.as_ref().map_or(String::new(), LiveKnee::scripts)
    }

    /// The verdict, the questions and the warnings, without the knee.
    pub(super) fn verdict(&self, failure: Option<&Failure>) -> String {
        let checks = self.checks();
        self.sentence(&checks, failure) + &self.answers(&checks, failure) + &self.details(&checks)
    }

    /// The questions, as far as the build has come.
    fn checks(&self) -> Vec<Check> {
        STAGES.iter().flat_map(|stage| stage.checks(&self.values)).collect()
    }

    /// The four answers.
    pub(super) fn four(&self, checks: &[Check], failure: Option<&Failure>) -> [Answer; 4] {
        let groups = self.groups(checks);
        let heavy: Vec<&str> = groups.iter().filter(|g| g.heavy).map(|g| g.stage.as_str()).collect();
        answers(&self.values, checks, &heavy, failure)
    }

    /// The warnings in groups; a stage whose answer is outside its limit makes its warnings heavy.
    fn groups(&self, checks: &[Check]) -> Vec<Group> {
        warnings::groups(&self.warnings, &outside(checks))
    }

    /// The four answers as cards, each with the key figures of its stages.
    fn answers(&self, checks: &[Check], failure: Option<&Failure>) -> String {
        let figures: Vec<(&str, KeyFigure)> =
            STAGES.iter().filter_map(|stage| Some((stage.name(), stage.key_figure(&self.values)?))).collect();
        cards::html(&self.four(checks, failure), &figures, &self.stages)
    }

    /// One page to print.
    pub(super) fn sheet(&self, failure: Option<&Failure>) -> String {
        let checks = self.checks();
        let (id, synthetic) = self.identity();
        let mut stills = Assemble.stills(&self.values);
        stills.truncate(3);
        let (answers, verdict) = (self.four(&checks, failure), self.built(&checks, failure).1);
        let verdict = [Some(verdict), self.shared_prior()].into_iter().flatten().collect::<Vec<_>>().join(" ");
        let forces = on_paper(&self.values);
        Sheet { id: &id, synthetic, verdict: &verdict, answers, stills, forces }.html()
    }

    /// What was built, as a class and a sentence; good only where geometry and calibration are.
    fn built(&self, checks: &[Check], failure: Option<&Failure>) -> (&'static str, String) {
        let [geometry, calibrated, ..] = self.four(checks, failure);
        let name = self.values.of::<Calibration>().and_then(Calibration::main).map(|(name, o)| match name {
            JOINT => format!("{} together", o.in_words()),
            _ => o.in_words(),
        });
        match (failure, name) {
            (Some(f), _) => ("failed", format!("The build stopped at {}.", heading(&f.stage))),
            (None, Some(data)) => {
                let sound = [&geometry, &calibrated].iter().all(|a| a.standing == Standing::Good);
                (if sound { "good" } else { "look" }, format!("Built, and calibrated to {data}."))
            }
            (None, None) => ("look", "Built, but not calibrated: the ligaments are not this knee's.".to_owned()),
        }
    }

    /// Whose data are in the prior of the knee's calibration, where other knees gave it.
    fn shared_prior(&self) -> Option<String> {
        let (_, outcome) = self.values.of::<Calibration>()?.main_first().next()?;
        shared::sentence(outcome.spec.calibrated.as_ref()?.shared_prior.as_ref()?)
    }

    /// The verdict, and what a failed build says.
    fn sentence(&self, checks: &[Check], failure: Option<&Failure>) -> String {
        let (class, words) = self.built(checks, failure);
        let mut html = format!("<p class=\"verdict {class}\" id=\"verdict\"><strong>{}</strong></p>", escaped(&words));
        if let Some(f) = failure {
            let _ = write!(html, "<p class=\"failure\">{}</p>", escaped(&f.message));
        }
        if let Some(words) = self.shared_prior() {
            let _ = write!(html, "<p id=\"shared-prior\">{}</p>", escaped(&words));
        }
        html
    }

    /// What to look at next, three things at most.
    fn next(&self, checks: &[Check], failure: Option<&Failure>) -> String {
        let link =
            |stage: &str, words: &str| format!("<li><a href=\"#{}\">{}</a></li>", escaped(stage), escaped(words));
        let mut items: Vec<String> = failure.iter().map(|f| link(&f.stage, "Where it stopped, and on what")).collect();
        // only the knee's own model is asked about here, where there is one: the others are rivals, and are told below
        let main = self.values.of::<Calibration>().and_then(Calibration::main).map(|(name, _)| name);
        let is_own = |c: &&Check| main.is_none() || c.model.is_none() || c.model.as_deref() == main;
        let mut asked: Vec<&str> = Vec::new();
        let mut is_new = |c: &&Check| {
            !asked.contains(&c.question) && {
                asked.push(c.question);
                true
            }
        };
        let bad: Vec<&Check> =
            checks.iter().filter(|c| c.good == Some(false)).filter(is_own).filter(|c| is_new(c)).collect();
        let unseen = self
            .four(checks, failure)
            .into_iter()
            .filter(|a| a.stage == Validate::NAME && a.standing == Standing::Look);
        items.extend(unseen.map(|a| link(a.stage, &format!("{} {}", a.question, a.word))));
        let short = |answer: &str| answer.split([';', '(']).next().unwrap_or_default().trim().to_owned();
        items.extend(bad.into_iter().map(|c| link(c.stage, &format!("{} {}", c.question, capital(&short(&c.told()))))));
        let groups = self.groups(checks);
        items.extend(groups.iter().filter(|g| g.heavy).filter_map(|g| Some(link(&g.stage, g.all.first()?))));
        let done = STAGES.iter().filter(|stage| self.stages.iter().any(|s| s == stage.name()));
        items.extend(done.filter_map(|stage| Some(link(stage.name(), stage.look()?))));
        items.truncate(3);
        if items.is_empty() {
            return String::new();
        }
        format!("<p><b>Look at next</b></p><ol class=\"next\">{}</ol>", items.concat())
    }

    fn details(&self, checks: &[Check]) -> String {
        let questions =
            format!("<details><summary>All {} checks</summary>{}</details>", checks.len(), questions(checks));
        questions + &warnings::html(&self.groups(checks))
    }

    /// A stage's warnings, scenes, charts, tables and figures.
    pub(super) fn stage(&mut self, record: &Record) -> String {
        let mine: Vec<Notice> = self.told_by(&record.stage).cloned().collect();
        let mut html = warnings::html(&warnings::groups(&mine, &outside(&self.checks())));
        if record.stage == Assemble::NAME && self.knee_shown {
            html += "<p>The knee in 3D stands <a href=\"#verdict\">at the top</a>.</p>";
        }
        html += &self.scenes(&record.stage);
        html += &self.charts(&record.stage);
        html += &named(&record.stage).map_or(String::new(), |stage| stage.more(&self.values));
        html + &metrics_table(record)
    }

    /// Versions, options and digests.
    pub(super) fn methods(&self, records: &[Record]) -> String {
        let run = self.values.folder.read_file("run.toml").unwrap_or_default();
        Methods::read(&run, records).map_or(String::new(), |m| m.html())
    }

    /// What a stage warns of.
    fn told_by(&self, stage: &str) -> impl Iterator<Item = &Notice> {
        self.warnings.iter().filter(move |w| w.stage.as_deref() == Some(stage))
    }

    /// The scene of a stage with its stills; places that its warnings name are marked in it.
    pub(super) fn scenes(&mut self, name: &str) -> String {
        let Some(stage) = named(name).filter(|s| s.name() != Assemble::NAME || !self.knee_shown) else {
            return String::new();
        };
        let Some(mut scene) = stage.scene(&self.values, &mut self.pool) else { return String::new() };
        let marked: Vec<Point> = self.told_by(name).flat_map(|w| &w.places).map(|p| Point::from(*p)).collect();
        if !marked.is_empty() && name != Assemble::NAME {
            scene.layers.push(named_places("places that warnings name", &marked, &self.pool));
        }
        self.figure(scene, stage)
    }

    /// A scene with the stills of its stage.
    fn figure(&mut self, scene: Scene, stage: &dyn View) -> String {
        let stills: String =
            if self.stills { stage.stills(&self.values).iter().map(still).collect() } else { String::new() };
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
        let all = named(stage).map_or(vec![], |stage| stage.charts(&self.values));
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

    /// What stopped the build: the message, the places it names on what the stage was given.
    pub(super) fn failed(&mut self, failure: &Failure) -> String {
        let mut html = format!(
            "<section id=\"{0}\"><h2>{1}: stopped here</h2><p class=\"failure\">{2}</p>",
            escaped(&failure.stage),
            escaped(&heading(&failure.stage)),
            escaped(&failure.message)
        );
        if let Some(scene) = failed::scene(failure, &self.values, &mut self.pool) {
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

    /// What the page's scenes and charts draw.
    pub(super) fn data(self) -> Value {
        json!({"meshes": self.pool.json(), "scenes": self.scenes, "charts": self.charts, "motions": self.motions})
    }
}

/// The options in force, as run.toml has them; `None` where another version wrote it.
fn options(folder: &BuildFolder) -> Option<BuildOptions> {
    let run: toml::Table = String::from_utf8(folder.read_file("run.toml")?).ok()?.parse().ok()?;
    run.get("options")?.clone().try_into().ok()
}

/// Stages with an answer outside its limit.
fn outside(checks: &[Check]) -> Vec<&'static str> {
    checks.iter().filter(|c| c.good == Some(false)).map(|c| c.stage).collect()
}

fn questions(checks: &[Check]) -> String {
    if checks.is_empty() {
        return String::new();
    }
    let rows: String = checks
        .iter()
        .map(|c| {
            let sign = match (c.good, &c.reaches) {
                (Some(true), None) => "within".to_owned(),
                (Some(true), Some(end)) => format!("within, but the interval reaches {}", escaped(end)),
                (Some(false), _) => "<strong>outside</strong>".to_owned(),
                (None, _) => "no limit".to_owned(),
            };
            format!(
                "<tr><th scope=\"row\"><a href=\"#{}\">{}</a></th><td class=\"sign\">{sign}</td><td>{}</td></tr>",
                c.stage,
                escaped(c.question),
                escaped(&c.told())
            )
        })
        .collect();
    format!("<table id=\"questions\"><tbody>{rows}</tbody></table>")
}

fn still(picture: &super::picture::Picture) -> String {
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

/// With a capital letter.
fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}
