//! The curves of a diagnosis as a picture.

use diagnosis::search::curves::{Curve, Point};
use sim::coordinate::Coordinate;
use validation::plot::{INK, Series, colour, draw, panel};

/// The curves as one picture (SVG), a panel each.
pub(super) fn picture(curves: &[Curve]) -> String {
    if curves.is_empty() {
        return String::new();
    }
    draw((340 * curves.len() as u32, 340), |root| {
        for (k, (area, curve)) in root.split_evenly((1, curves.len())).iter().zip(curves).enumerate() {
            let title = format!("{} at {:.0} deg", curve.source, curve.nominal_flexion_deg);
            let load_unit = Coordinate::named(&curve.load).map_or("", Coordinate::load_unit);
            let unit = Coordinate::named(&curve.dof).map_or("", Coordinate::unit);
            let load = format!("{} load ({load_unit})", curve.load.to_uppercase());
            let read = format!("{} ({unit})", curve.dof.to_uppercase());
            panel(area, (&title, &load, &read), &series(curve), k == 0)?;
        }
        Ok(())
    })
}

fn series(curve: &Curve) -> Vec<Series> {
    let line = |name: &str, k: usize, of: &dyn Fn(&Point) -> Option<f64>| Series {
        name: name.into(),
        points: curve.points.iter().filter_map(|p| Some((p.load, of(p)?))).collect(),
        spread: vec![],
        colour: colour(k),
        line: true,
        thin: k > 1,
    };
    let mut out = vec![
        line("model as given", 3, &|p| Some(p.given)),
        line("ligaments recalibrated", 1, &|p| Some(p.without)),
        line("with the answer", 0, &|p| p.with),
        Series {
            name: "measured".into(),
            points: curve.points.iter().map(|p| (p.load, p.measured)).collect(),
            spread: curve.points.iter().map(|p| p.sd).collect(),
            colour: INK,
            line: false,
            thin: true,
        },
    ];
    out.retain(|s| !s.points.is_empty());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(with: Option<f64>) -> Curve {
        let point = |load: f64| Point {
            trial: format!("t{load}"),
            load,
            measured: 0.1 * load,
            sd: 0.4,
            given: 0.2 * load,
            without: 0.15 * load,
            with: with.map(|w| w * load),
        };
        Curve {
            source: "kla".into(),
            load: "ap".into(),
            nominal_flexion_deg: 30.0,
            dof: "ap".into(),
            points: [-100.0, 0.0, 100.0].map(point).into(),
        }
    }

    #[test]
    fn a_picture_has_a_panel_a_curve_and_a_line_for_an_answer_alone() {
        let two = picture(&[curve(Some(0.1)), curve(Some(0.1))]);
        assert_eq!(two.matches("kla at 30 deg").count(), 2);
        assert!(two.contains("AP load (N)") && two.contains("AP (mm)") && two.contains("with the answer"));
        assert!(!picture(&[curve(None)]).contains("with the answer"));
        assert_ne!(two, picture(&[curve(Some(0.1)), curve(Some(0.12))]));
        assert!(picture(&[]).is_empty());
    }
}
