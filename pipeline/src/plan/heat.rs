//! Heat maps of a plan's page: a field a choice, the darker the more, with its number in it.

use super::map::{Cell, Map};
use crate::report::escaped;
use std::fmt::Write;

/// Width and height of a field [pixels].
const FIELD: [f64; 2] = [76.0, 40.0];
/// Room for the axes left of the fields and below them [pixels].
const ROOM: [f64; 2] = [84.0, 48.0];
/// A letter of an axis' name takes so much of its line [pixels]; ours: half of the type's size and a little more.
const LETTER: f64 = 7.0;
/// Colour of the most, as the first of a figure's colours [okabe2008]; the least is white.
const MOST: [f64; 3] = [0.0, 114.0, 178.0];
/// From this share of the most on a number is white on its field [-]: there white has the larger contrast, above 4.5 on either side.
const DARK: f64 = 0.93;

/// The section of the maps; nothing where there are none.
pub(super) fn section(maps: &[Map]) -> String {
    let Some(first) = maps.first() else { return String::new() };
    let mut text = format!(
        "<h2>Other sites and tensions</h2><p>What the most probable knee would do if the graft {} left the femur elsewhere, or were fixed otherwise. \
         All else is as planned. These numbers have no intervals. The framed field is the plan. The stronger the colour, the more.</p><div class=\"charts\">",
        escaped(&first.graft)
    );
    for map in maps {
        let off = ("furthest from the intact knee in the anterior drawers, AP, mm", 1, 0);
        let force = ("most that the graft bears unloaded, N", 0, 1);
        for (what, digits, which) in [off, force] {
            let title = format!("{}: {what}", map.of);
            let svg = heat(map, &title, digits, |c| c.found.map(|f| f[which]));
            let _ = write!(text, "<figure class=\"paper\">{svg}<figcaption>{title}</figcaption></figure>");
        }
    }
    text + "</div>"
}

/// A map as SVG.
pub(super) fn heat(map: &Map, title: &str, digits: usize, value: impl Fn(&Cell) -> Option<f64>) -> String {
    let [across, up] = [0, 1].map(|k| values(map, k));
    let (width, height) = (FIELD[0] * across.len() as f64, FIELD[1] * up.len() as f64);
    // a name may be longer than its axis
    let [wide, tall] = [map.axes[0], map.axes[1]].map(|name| LETTER * name.chars().count() as f64);
    let size = [(ROOM[0] + width + 2.0).max(wide), (height + ROOM[1] + 2.0).max(tall)];
    let all: Vec<f64> = map.cells.iter().filter_map(&value).collect();
    let [least, most] = [all.iter().copied().fold(f64::INFINITY, f64::min), all.iter().copied().fold(0.0, f64::max)];
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0} {:.0}\" role=\"img\" aria-label=\"{}\" font-family=\"sans-serif\" \
         font-size=\"13\" text-anchor=\"middle\">",
        size[0],
        size[1],
        escaped(title)
    );
    let middle = |k: usize, size: f64| (k as f64 + 0.5) * size;
    for c in &map.cells {
        let [Some(x), Some(y)] = [index(&across, c.at[0]), index(&up, c.at[1])] else { continue };
        let corner = [ROOM[0] + x as f64 * FIELD[0], (up.len() - 1 - y) as f64 * FIELD[1]];
        text += &field(corner, value(c).map(|v| (format!("{v:.digits$}"), share(v, [least, most]))));
    }
    if let [Some(x), Some(y)] = [index(&across, map.planned[0]), index(&up, map.planned[1])] {
        let corner = [ROOM[0] + x as f64 * FIELD[0], (up.len() - 1 - y) as f64 * FIELD[1]];
        let _ = write!(
            text,
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#000\" stroke-width=\"3\"/>",
            corner[0] + 1.5,
            corner[1] + 1.5,
            FIELD[0] - 3.0,
            FIELD[1] - 3.0
        );
    }
    for (k, x) in across.iter().enumerate() {
        let _ = write!(text, "<text x=\"{}\" y=\"{}\">{x}</text>", ROOM[0] + middle(k, FIELD[0]), height + 17.0);
    }
    for (k, y) in up.iter().rev().enumerate() {
        let _ = write!(text, "<text x=\"{}\" y=\"{}\">{y}</text>", ROOM[0] - 24.0, middle(k, FIELD[1]) + 4.0);
    }
    let (below, beside) = (escaped(map.axes[0]), escaped(map.axes[1]));
    let [x, y] = [within(ROOM[0] + width / 2.0, wide, size[0]), within(height / 2.0, tall, size[1])];
    let _ = write!(text, "<text x=\"{x}\" y=\"{}\">{below}</text>", height + 38.0);
    let _ = write!(text, "<text transform=\"translate(16 {y}) rotate(-90)\">{beside}</text></svg>");
    text
}

/// The middle of a name that is so long, next to where it is wanted, so that all of it is in the picture [pixels].
fn within(wanted: f64, long: f64, size: f64) -> f64 {
    wanted.max(0.5 * long).min(size - 0.5 * long)
}

/// A field with its number and share of the most; without them it says so.
fn field(corner: [f64; 2], told: Option<(String, f64)>) -> String {
    let (words, colour, ink) = match told {
        None => ("none".to_owned(), "#ddd".to_owned(), "#000"),
        Some((number, share)) => {
            let [r, g, b] = MOST.map(|c| (255.0 + share * (c - 255.0)).round());
            (number, format!("rgb({r},{g},{b})"), if share > DARK { "#fff" } else { "#000" })
        }
    };
    let [x, y] = corner;
    let [w, h] = FIELD;
    format!(
        "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" fill=\"{colour}\" stroke=\"#fff\"/>\
         <text x=\"{}\" y=\"{}\" fill=\"{ink}\">{words}</text>",
        x + w / 2.0,
        y + h / 2.0 + 4.0
    )
}

/// Where a value lies between the least and the most [-].
fn share(v: f64, [least, most]: [f64; 2]) -> f64 {
    if most > least { ((v - least) / (most - least)).clamp(0.0, 1.0) } else { 0.0 }
}

/// The values along an axis, ascending.
fn values(map: &Map, axis: usize) -> Vec<f64> {
    let mut out: Vec<f64> = map.cells.iter().map(|c| c.at[axis]).collect();
    out.sort_by(f64::total_cmp);
    out.dedup();
    out
}

/// Which of the values it is.
fn index(all: &[f64], x: f64) -> Option<usize> {
    all.iter().position(|y| y.total_cmp(&x).is_eq())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_choice_has_a_field_with_its_number_and_more_is_darker() {
        let at = |x: f64, y: f64, off: Option<f64>| Cell {
            at: [x, y],
            quadrant_percent: None,
            found: off.map(|mm| [mm, 10.0 * mm]),
        };
        let map = Map {
            of: "femoral site",
            graft: "<g>".into(),
            axes: ["across", "up"],
            planned: [0.0, 3.0],
            cells: vec![at(0.0, 0.0, Some(1.0)), at(3.0, 0.0, Some(2.0)), at(0.0, 3.0, Some(3.0)), at(3.0, 3.0, None)],
        };
        let page = section(std::slice::from_ref(&map));
        assert!(page.contains("graft &lt;g&gt;") && page.matches("<svg").count() == 2 && section(&[]).is_empty());
        let svg = heat(&map, "title", 1, |c| c.found.map(|f| f[0]));
        for number in [">1.0<", ">2.0<", ">3.0<", ">none<"] {
            assert_eq!(svg.matches(number).count(), 1, "{number}: {svg}");
        }
        // the least is white, the most has the full colour; the planned field is framed, at the left above
        assert!(svg.contains("rgb(255,255,255)") && svg.contains("rgb(0,114,178)"), "{svg}");
        assert!(
            svg.contains(&format!("<rect x=\"{}\" y=\"1.5\"", ROOM[0] + 1.5))
                && svg.matches("fill=\"none\"").count() == 1
        );
        assert!(page.contains("The stronger the colour, the more."));
        // a number can be read on every colour: WCAG asks for a contrast of 4.5
        let light = |c: f64| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
        for part in 0..=100 {
            let share = f64::from(part) / 100.0;
            let [r, g, b] = MOST.map(|c| light((255.0 + share * (c - 255.0)).round() / 255.0));
            let on = 0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05;
            let contrast = if share > DARK { 1.05 / on } else { on / 0.05 };
            assert!(contrast >= 4.5, "{share}: {contrast}");
        }
        let shares = [1.0, 2.0, 3.0].map(|v| share(v, [1.0, 3.0]));
        assert!(shares == [0.0, 0.5, 1.0] && share(2.0, [2.0, 2.0]) == 0.0);
    }

    #[test]
    fn a_name_longer_than_its_axis_is_in_the_picture_and_a_short_one_in_the_middle() {
        let map = |axes| Map {
            of: "sweep",
            graft: "g".into(),
            axes,
            planned: [0.0; 2],
            cells: [0.0, 20.0]
                .map(|y| Cell { at: [40.0, y], quadrant_percent: None, found: Some([1.0, 1.0]) })
                .to_vec(),
        };
        let after =
            |svg: &str, from: &str, to: char| svg.rsplit(from).next().unwrap().split(to).next().unwrap().to_owned();
        let drawn = |name: &'static str| {
            let svg = heat(&map([name; 2]), "title", 0, |c| c.found.map(|f| f[0]));
            let size = after(&svg, "viewBox=\"0 0 ", '"');
            let size: Vec<f64> = size.split(' ').map(|x| x.parse().unwrap()).collect();
            let middle = [after(&svg, "<text x=\"", '"'), after(&svg, "translate(16 ", ')')];
            (middle.map(|x| x.parse::<f64>().unwrap()), size)
        };
        for name in ["N", "fixed at flexion, deg", "femur: height downwards from the roof, %"] {
            let (middle, size) = drawn(name);
            let half = 0.5 * LETTER * name.len() as f64;
            for k in 0..2 {
                assert!(middle[k] >= half && middle[k] + half <= size[k] + 0.5, "{name}: {middle:?} of {size:?}");
            }
        }
        assert_eq!(drawn("N").0, [ROOM[0] + FIELD[0] / 2.0, FIELD[1]]);
    }
}
