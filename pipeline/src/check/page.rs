//! check.html: load against displacement, so that a sign that is turned round shows.

use super::{Item, State};
use crate::report::escaped;
use sim::coordinate::{AP, IE, VV};
use sim::laxity::LaxityTrial;
use std::collections::{BTreeMap, BTreeSet};
use validation::plot::{Series, colour, draw, panel};

/// Size of a source's plots [pixels].
const SIZE: (u32, u32) = (960, 340);

/// The page: a row of plots a source, and what there is to look at.
pub(super) fn page(id: &str, measured: &BTreeMap<String, Vec<LaxityTrial>>, items: &[Item]) -> String {
    let mut html = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <link rel=\"icon\" href=\"data:,\"><title>{0}: inputs</title><style>{1}</style></head><body><main><h1>{0}: measured laxity</h1>\
         <p>Every knee goes where it is pushed: each line must rise from left to right. A line that falls has a sign turned round.</p>",
        escaped(id),
        include_str!("page.css")
    );
    for item in items.iter().filter(|i| i.input.starts_with("laxity") && i.state != State::Ok) {
        html += &format!("<p class=\"look\"><b>{}</b>: {}</p>", escaped(&item.input), escaped(&item.found));
    }
    for (name, trials) in measured {
        html += &format!("<h2>{}</h2><figure>{}</figure>", escaped(name), plots(trials));
    }
    html + "</main></body></html>\n"
}

/// AP, IE and VV of a source, a line a flexion.
fn plots(trials: &[LaxityTrial]) -> String {
    let flexions: BTreeSet<i64> = trials.iter().map(|t| t.nominal_flexion_deg.round() as i64).collect();
    let panels = [
        (AP, "Anterior + / posterior -", "AP load (N)", "AP (mm)"),
        (IE, "External + / internal -", "IE load (N m)", "IE (deg)"),
        (VV, "Valgus + / varus -", "VV load (N m)", "VV (deg)"),
    ];
    draw(SIZE, |root| {
        for (k, (area, (c, title, x, y))) in root.split_evenly((1, 3)).iter().zip(panels).enumerate() {
            let of = |(i, flexion): (usize, &i64)| {
                let mut points: Vec<(f64, f64)> = trials
                    .iter()
                    .filter(|t| t.nominal_flexion_deg.round() as i64 == *flexion)
                    .filter(|t| t.test.coordinate().is_none_or(|own| own == c))
                    .filter_map(|t| Some((t, t.measured[c]?)))
                    .flat_map(|(t, value)| {
                        let zero = t.reference.as_ref().map(|r| (r.load[c], 0.0));
                        std::iter::once((t.load[c], value)).chain(zero)
                    })
                    .collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                Series {
                    name: format!("{flexion} deg"),
                    points,
                    spread: vec![],
                    colour: colour(i),
                    line: true,
                    thin: false,
                }
            };
            let series: Vec<Series> = flexions.iter().enumerate().map(of).collect();
            panel(area, (title, x, y), &series, k == 0)?;
        }
        Ok(())
    })
}
