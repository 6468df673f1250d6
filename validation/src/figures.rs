//! The paper's Figures 5 to 8 for the specimen at hand, as SVG.

use crate::plot::{Series, colour, draw, panel};
use crate::validate::{Passive, Source};
use calibration::cost::CostFunction;
use plotters::prelude::*;
use sim::coordinate::{AP, Free, IE, VV};
use sim::laxity::{LaxityTrial, Test};

/// Figure 5: the targets, loads against flexion, a panel a coordinate.
pub fn figure5(targets: &[(String, Vec<LaxityTrial>)]) -> String {
    draw((960, 340), |root| {
        let panels = [
            (AP, "Anterior +, posterior -", "AP load (N)"),
            (IE, "External +, internal -", "IE load (N m)"),
            (VV, "Valgus +, varus -", "VV load (N m)"),
        ];
        for (k, (area, (c, title, y))) in root.split_evenly((1, 3)).iter().zip(panels).enumerate() {
            let of = |(s, (name, trials)): (usize, &(String, Vec<LaxityTrial>))| Series {
                name: name.clone(),
                points: trials
                    .iter()
                    .filter(|t| t.test.coordinate() == Some(c) || (t.test == Test::Neutral && c == AP))
                    .map(|t| (t.fe_deg, t.load[c]))
                    .collect(),
                spread: vec![],
                colour: colour(s),
                line: false,
                thin: false,
            };
            let series: Vec<Series> = targets.iter().enumerate().map(of).collect();
            panel(area, (title, "Flexion (deg)", y), &series, k == 0)?;
        }
        Ok(())
    })
}

/// Figure 6: the groups of a source's targets, their weights, and what each adds to the cost of the calibrated model.
pub fn figure6(name: &str, cost: &CostFunction, predicted: &[Option<Free<f64>>]) -> String {
    let errors = cost.cost(predicted).errors;
    let rows: Vec<(String, f64)> = cost
        .terms
        .iter()
        .enumerate()
        .map(|(k, t)| {
            let (axis, unit) = (t.coordinate.name().to_uppercase(), t.coordinate.unit());
            let error = errors.get(k).copied();
            let text = format!(
                "{} {:.0} deg, {} trial{}: {axis} ({:.0}){}",
                t.in_words(),
                t.nominal_flexion_deg,
                t.trials.len(),
                if t.trials.len() == 1 { "" } else { "s" },
                t.weight,
                error.map_or(String::new(), |e| format!(", misses by {e:.1} {unit}"))
            );
            (text, error.map_or(0.0, |e| e * t.weight / t.range))
        })
        .collect();
    let most = rows.iter().map(|r| r.1).fold(1e-9, f64::max);
    draw((860, 60 + 20 * rows.len() as u32), |root| {
        let ink = ("sans-serif", 13).into_font();
        root.draw(&Text::new(
            format!("{name}: groups of targets (weight in brackets) and their share of the cost"),
            (12, 10),
            ("sans-serif", 16).into_font(),
        ))?;
        for (k, (text, share)) in rows.iter().enumerate() {
            let y = 42 + 20 * k as i32;
            root.draw(&Text::new(text.clone(), (12, y), ink.clone()))?;
            let length = (340.0 * share / most).round() as i32;
            root.draw(&Rectangle::new([(430, y), (430 + length, y + 13)], colour(0).filled()))?;
            root.draw(&Text::new(format!("{share:.1}"), (438 + length, y), ink.clone()))?;
        }
        Ok(())
    })
}

/// Figure 7: AP position under the anterior (top) and posterior (bottom) load against flexion.
pub fn figure7(sources: &[Source]) -> String {
    draw((560, 420), |root| {
        let mut series = Vec::new();
        for (k, s) in sources.iter().enumerate() {
            for (test, name) in [(Test::Anterior, "anterior"), (Test::Posterior, "posterior")] {
                let points: Vec<(f64, f64)> = s
                    .ap_flexions()
                    .iter()
                    .filter_map(|&fe| s.ap_end(test, fe).map(|r| (r.pose.fe_deg, r.pose.ap_mm)))
                    .collect();
                let thin = test == Test::Posterior;
                series.push(Series {
                    name: format!("{} {name}", s.label(sources)),
                    points,
                    spread: vec![],
                    colour: colour(k),
                    line: true,
                    thin,
                });
            }
        }
        panel(root, ("AP position under AP load", "Flexion (deg)", "Anterior (mm)"), &series, true)
    })
}

/// Figure 8: passive flexion of every source, and as measured.
pub fn figure8(sources: &[Source], measured: &[Passive]) -> String {
    draw((1020, 360), |root| {
        let panels = [(AP, "AP", "Anterior (mm)"), (IE, "IE", "External (deg)"), (VV, "VV", "Valgus (deg)")];
        for (n, (area, (c, title, y))) in root.split_evenly((1, 3)).iter().zip(panels).enumerate() {
            let simulated = sources.iter().enumerate().map(|(k, s)| Series {
                name: s.label(sources),
                points: s.passive_flexion.iter().map(|r| (r.pose.fe_deg, r.predicted()[c])).collect(),
                spread: vec![],
                colour: colour(k),
                line: true,
                thin: false,
            });
            let experiments = measured.iter().enumerate().map(|(k, m)| Series {
                name: format!("{} experiment", m.name),
                points: m.poses.iter().map(|p| (p.fe_deg, p.free()[c])).collect(),
                spread: vec![],
                colour: colour(sources.iter().position(|s| s.name == m.name).unwrap_or(sources.len() + k)),
                line: false,
                thin: true,
            });
            let series: Vec<Series> = simulated.chain(experiments).collect();
            panel(area, (title, "Flexion (deg)", y), &series, n == 0)?;
        }
        Ok(())
    })
}
