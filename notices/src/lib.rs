//! What is odd but not fatal, as values. The sentence is for people; programs read the other fields.
//!
//! ```
//! use notices::{Kind, Weight};
//!
//! let hole = Kind::HoleFilled.notice("femur: a hole was filled").of("femur").at([1.0, 2.0, 3.0]);
//! assert_eq!(hole.weight, Weight::Light);
//! assert_eq!(hole.to_string(), "femur: a hole was filled");
//! ```

mod kind;
mod number;

pub use kind::{Kind, Weight};
pub use number::plain;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display};
use std::ops::Deref;

/// Something odd. It reads as its text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Notice {
    /// Which finding it is: notices of one kind differ in names and numbers alone.
    pub kind: Kind,
    /// How much it weighs, by its kind.
    pub weight: Weight,
    /// The stage of a build that tells it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage: Option<String>,
    /// The file that it is about, as it was named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Its row, the header being row 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row: Option<usize>,
    /// Its column, by the name in the header.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// What it is about: a bone, a bundle, a data set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub element: Option<String>,
    /// Where in CT [mm].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<[f64; 3]>,
    /// How many of what it counts: triangles, rows, samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
    /// The sentence for a person.
    pub text: String,
}

impl Kind {
    /// A notice of this kind.
    pub fn notice(self, text: impl Into<String>) -> Notice {
        let (stage, file, column, element) = (None, None, None, None);
        let text = text.into();
        Notice {
            kind: self,
            weight: self.weight(),
            stage,
            file,
            row: None,
            column,
            element,
            places: vec![],
            count: None,
            text,
        }
    }
}

impl Notice {
    /// About this file, which its text names already.
    pub fn file(self, file: &str) -> Notice {
        Notice { file: Some(file.to_owned()), ..self }
    }

    /// About this row.
    pub fn row(self, row: usize) -> Notice {
        Notice { row: Some(row), ..self }
    }

    /// About this column.
    pub fn column(self, column: &str) -> Notice {
        Notice { column: Some(column.to_owned()), ..self }
    }

    /// About this element, which its text names already.
    pub fn of(self, element: &str) -> Notice {
        Notice { element: Some(element.to_owned()), ..self }
    }

    /// At this place in CT [mm].
    pub fn at(mut self, place: [f64; 3]) -> Notice {
        self.places.push(place);
        self
    }

    /// Of so many.
    pub fn count(self, count: usize) -> Notice {
        Notice { count: Some(count), ..self }
    }

    /// Told by this stage.
    pub fn told_by(self, stage: &str) -> Notice {
        Notice { stage: Some(stage.to_owned()), ..self }
    }

    /// About this file, and its text begins with its name.
    pub fn in_file(self, file: &str) -> Notice {
        let text = format!("{file}: {}", self.text);
        Notice { file: self.file.or_else(|| Some(file.to_owned())), text, ..self }
    }

    /// Of an element, and its text begins with the name: a data set, a cartilage.
    pub fn whose(self, name: &str) -> Notice {
        let text = format!("{name}: {}", self.text);
        Notice { element: self.element.or_else(|| Some(name.to_owned())), text, ..self }
    }
}

impl Deref for Notice {
    type Target = str;
    fn deref(&self) -> &str {
        &self.text
    }
}

impl Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// The texts alone.
pub fn texts(notices: &[Notice]) -> Vec<String> {
    notices.iter().map(|n| n.text.clone()).collect()
}

/// The first of each kind, in their order, and how many more there are of it.
pub fn firsts(notices: &[Notice]) -> Vec<(&Notice, usize)> {
    let mut found: Vec<(&Notice, usize)> = Vec::new();
    for notice in notices {
        match found.iter_mut().find(|(first, _)| first.kind == notice.kind) {
            Some((_, more)) => *more += 1,
            None => found.push((notice, 0)),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_outlives_a_file_and_an_empty_one_takes_no_room() {
        let whole = Kind::Spikes.notice("damaged").file("a.ply").row(3).column("x").of("femur").at([1.0, 2.0, 3.0]);
        let whole = whole.count(4).told_by("ingest");
        let text = serde_json::to_string(&whole).unwrap();
        assert_eq!(serde_json::from_str::<Notice>(&text).unwrap(), whole);
        let bare = serde_json::to_string(&Kind::Spikes.notice("damaged")).unwrap();
        assert_eq!(bare, r#"{"kind":"spikes","weight":"heavy","text":"damaged"}"#);
    }

    #[test]
    fn a_kind_of_another_version_is_read() {
        let read: Notice = serde_json::from_str(r#"{"kind":"of-tomorrow","weight":"heavy","text":"x"}"#).unwrap();
        assert_eq!((read.kind, read.weight), (Kind::Other, Weight::Heavy));
    }

    #[test]
    fn like_notices_are_those_of_one_kind_whatever_they_say() {
        let all = [
            Kind::ThroughBone.notice("ACL_AM runs deep"),
            Kind::BundleLeftOut.notice("LCL is left out"),
            Kind::ThroughBone.notice("another wording"),
        ];
        let found: Vec<(Kind, usize)> = firsts(&all).into_iter().map(|(n, more)| (n.kind, more)).collect();
        assert_eq!(found, [(Kind::ThroughBone, 1), (Kind::BundleLeftOut, 0)]);
    }
}
