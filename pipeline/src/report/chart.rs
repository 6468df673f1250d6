//! A chart, and how all charts look.

use plotly::Layout;
use plotly::common::Title;
use plotly::layout::Axis;

/// A chart with its words.
pub(crate) struct Chart {
    pub(crate) id: String,
    pub(crate) title: String,
    /// Its text alternative.
    pub(crate) text: String,
    /// What plotly.js draws.
    pub(crate) plot: String,
}

/// As many as there are ligaments: no two of a chart are alike.
pub(crate) const COLOURS: [&str; 9] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7b3fa0", "#777777", "#8b4513"];

pub(crate) fn layout(x: &str, y: &str) -> Layout {
    let axis = |title: &str| Axis::new().title(Title::from(title)).zero_line(true).show_line(true);
    Layout::new().x_axis(axis(x)).y_axis(axis(y)).height(360)
}
