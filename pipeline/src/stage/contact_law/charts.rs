//! Charts of the contact law: force and area of the rigid law over those of the deformable model, and the law itself.

use crate::report::chart::{COLOURS, Chart, layout};
use plotly::common::{DashType, Line, Marker, MarkerSymbol, Mode};
use plotly::{Plot, Scatter};
use stages::contact_law::{ContactLaw, Curve, PUBLISHED, RigidCurve};

pub(super) fn charts(law: &ContactLaw) -> Vec<Chart> {
    vec![force(law), area(law), table(law)]
}

/// Draws a quantity of both models, a colour a flexion.
fn both(
    law: &ContactLaw,
    plot: &mut Plot,
    deformable: impl Fn(&Curve) -> (Vec<f64>, Vec<f64>),
    rigid: impl Fn(&Curve, &RigidCurve) -> Vec<(&'static str, Vec<f64>, Vec<f64>, DashType)>,
) {
    for ((curve, other), colour) in law.curves.iter().zip(&law.rigid).zip(COLOURS.iter().cycle()) {
        let (x, y) = deformable(curve);
        let marker = Marker::new().color(*colour).size(9).symbol(MarkerSymbol::CircleOpen);
        let name = format!("{:.0} deg deformable", curve.flexion_deg);
        plot.add_trace(Scatter::new(x, y).mode(Mode::Markers).name(name).marker(marker));
        for (what, x, y, dash) in rigid(curve, other) {
            let name = format!("{:.0} deg {what}", curve.flexion_deg);
            plot.add_trace(Scatter::new(x, y).mode(Mode::Lines).name(name).line(Line::new().color(*colour).dash(dash)));
        }
    }
}

fn force(law: &ContactLaw) -> Chart {
    let mut plot = Plot::new();
    both(
        law,
        &mut plot,
        |c| c.levels.iter().map(|l| (l.shift_mm, l.force_n)).unzip(),
        |_, r| {
            vec![
                ("rigid, fitted", r.approach_mm.clone(), r.force_n.clone(), DashType::Solid),
                ("rigid, published law", r.approach_mm.clone(), r.published_force_n.clone(), DashType::Dot),
            ]
        },
    );
    plot.set_layout(layout("approach [mm]", "force [N]"));
    Chart {
        id: "law-force".into(),
        title: "Force over approach".into(),
        text: format!(
            "The deformable model (circles) and the rigid law fitted to it (lines): largest difference {:.1} %, root mean square {:.1} %. Dotted: the published law of S192803.",
            law.fit_error_percent, law.fit_rms_percent
        ),
        plot: plot.to_json(),
    }
}

fn area(law: &ContactLaw) -> Chart {
    let mut plot = Plot::new();
    both(
        law,
        &mut plot,
        |c| c.levels.iter().map(|l| (l.force_n, l.area_mm2)).unzip(),
        |_, r| vec![("rigid, fitted", r.force_n.clone(), r.area_mm2.clone(), DashType::Solid)],
    );
    plot.set_layout(layout("force [N]", "contact area [mm2]"));
    Chart {
        id: "law-area".into(),
        title: "Contact area over force".into(),
        text: format!("Both models; root mean square difference at equal force {:.1} %.", law.area_error_percent),
        plot: plot.to_json(),
    }
}

fn table(law: &ContactLaw) -> Chart {
    let mut plot = Plot::new();
    let published = (PUBLISHED.0.to_vec(), PUBLISHED.1.to_vec());
    let rows = [
        ("fitted", (law.overclosure_mm.clone(), law.pressure_mpa.clone()), DashType::Solid),
        ("published, S192803", published, DashType::Dot),
    ];
    for ((name, (x, y), dash), colour) in rows.into_iter().zip(COLOURS) {
        let line = Line::new().color(colour).dash(dash);
        plot.add_trace(Scatter::new(x, y).mode(Mode::LinesMarkers).name(name).line(line));
    }
    plot.set_layout(layout("overclosure [mm]", "pressure [MPa]"));
    let points: Vec<String> = law
        .overclosure_mm
        .iter()
        .zip(&law.pressure_mpa)
        .skip(1)
        .map(|(x, p)| format!("{p:.4} MPa at {x} mm"))
        .collect();
    Chart {
        id: "law".into(),
        title: "The contact law".into(),
        text: format!("Fitted: {}; the last slope is continued.", points.join(", ")),
        plot: plot.to_json(),
    }
}
