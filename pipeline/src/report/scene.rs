//! What a scene of the report is made of.

use super::geometry::{Pool, rounded};
use meshes::Point;
use serde::Serialize;

/// A scene: what it shows, in words and in layers.
#[derive(Serialize)]
pub(crate) struct Scene {
    pub(crate) id: String,
    pub(crate) title: String,
    /// Its text alternative: what it shows, the figures, what to look for.
    pub(crate) text: String,
    /// Where the eye is at first: front, behind, above, below.
    pub(crate) from: &'static str,
    pub(crate) layers: Vec<Layer>,
    /// True where a slider moves it.
    pub(crate) moves: bool,
}

/// A part of a scene that can be hidden.
#[derive(Serialize, Default)]
pub(crate) struct Layer {
    pub(crate) name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) mesh: Option<String>,
    pub(crate) colour: &'static str,
    pub(crate) opacity: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) scalar: Option<Scalar>,
    /// Ends of lines, two points each, or points; mm.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) lines: Vec<[f64; 3]>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) points: Vec<[f64; 3]>,
    /// Words at the points.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) labels: Vec<String>,
    /// Shown at first.
    pub(crate) on: bool,
    /// Of the layers with the same word one is shown at a time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) one_of: Option<&'static str>,
    /// Drawn as the edges of the quads that pairs of its mesh's triangles make.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(crate) edges: bool,
    /// Coloured by contact pressure as the knee moves; "with scale" where the colour bar is its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) presses: Option<&'static str>,
    /// Moves with the femur: the whole of it ("femur"; "measured" to where it was measured), or ("fibres") the first end of each line;
    /// "names" are words in the middle of each line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) moves: Option<&'static str>,
}

/// Values by which a surface is coloured.
#[derive(Serialize, Clone)]
pub(crate) struct Scalar {
    pub(crate) values: String,
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) title: &'static str,
    pub(crate) scale: &'static str,
    /// One a triangle, not a corner.
    pub(crate) cells: bool,
}

pub(crate) fn at(pool: &Pool, p: &Point) -> [f64; 3] {
    let p = pool.point(p);
    [p.x, p.y, p.z].map(|x| rounded(x, 100.0))
}

pub(crate) fn plain(name: &str) -> &str {
    match name {
        "tibia_medial" => "medial tibia",
        "tibia_lateral" => "lateral tibia",
        other => other,
    }
}

pub(crate) fn word(source: attachments::site::Source) -> &'static str {
    match source {
        attachments::site::Source::Marked => "marked",
        attachments::site::Source::Literature => "literature",
        attachments::site::Source::Given => "given",
    }
}

pub(crate) fn named_places(name: &str, places: &[Point], pool: &Pool) -> Layer {
    Layer {
        name: name.into(),
        colour: "#c8102e",
        points: places.iter().map(|p| at(pool, p)).collect(),
        labels: places.iter().map(|p| format!("({:.1}, {:.1}, {:.1}) in CT", p.x, p.y, p.z)).collect(),
        opacity: 1.0,
        on: true,
        ..Layer::default()
    }
}
