//! Charts of the contact law: force and area of the rigid law over those of the deformable model, and the law itself.

use crate::report::chart::{COLOURS, Chart, layout};
use plotly::common::{DashType, Line, Marker, MarkerSymbol, Mode};
use plotly::{Plot, Scatter};
use stages::contact_law::{ContactLaw, Curve, FittedLayer, PUBLISHED, RigidCurve};

pub(super) fn charts(law: &ContactLaw) -> Vec<Chart> {
    vec![force(law), area(law), table(law)]
}

/// Draws a quantity of both models, a colour a flexion.
fn both(
    law: &ContactLaw,
    plot: &mut Plot,
    deformable: impl Fn(&Curve) -> (Vec<f64>, Vec<f64>),
    rigid: impl Fn(usize, &RigidCurve) -> Vec<(&'static str, Vec<f64>, Vec<f64>, DashType)>,
) {
    for (k, ((curve, other), colour)) in law.curves.iter().zip(&law.rigid).zip(COLOURS.iter().cycle()).enumerate() {
        let (x, y) = deformable(curve);
        let marker = Marker::new().color(*colour).size(9).symbol(MarkerSymbol::CircleOpen);
        let name = format!("{:.0} deg deformable", curve.flexion_deg);
        plot.add_trace(Scatter::new(x, y).mode(Mode::Markers).name(name).marker(marker));
        for (what, x, y, dash) in rigid(k, other) {
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
        |k, r| {
            let layer = law.layer.as_ref().and_then(|l| l.force_n.get(k));
            let layer = layer.map(|f| ("rigid, by thickness", r.approach_mm.clone(), f.clone(), DashType::Solid));
            let table = if layer.is_some() { DashType::Dash } else { DashType::Solid };
            let own = ("rigid, fitted table", r.approach_mm.clone(), r.force_n.clone(), table);
            let published = ("rigid, published law", r.approach_mm.clone(), r.published_force_n.clone(), DashType::Dot);
            layer.into_iter().chain([own, published]).collect()
        },
    );
    plot.set_layout(layout("approach [mm]", "force [N]"));
    Chart {
        id: "law-force".into(),
        title: "Force over approach".into(),
        text: format!(
            "The deformable model (circles) and the rigid laws fitted to it (lines). The table: largest difference {:.1} %, root mean square {:.1} %.{} Dotted: the published law of S192803.",
            law.fit_error_percent,
            law.fit_rms_percent,
            law.layer.as_ref().map_or(String::new(), by_thickness)
        ),
        plot: plot.to_json(),
    }
}

fn by_thickness(layer: &FittedLayer) -> String {
    let m = &layer.material;
    format!(
        " Layers of the cartilages' own thickness, {:.1} MPa, Poisson's ratio {}, edge spread {:.2}: {:.1} %, {:.1} %.",
        m.youngs_modulus_mpa, m.poissons_ratio, m.edge_spread, layer.fit_error_percent, layer.fit_rms_percent
    )
}

fn area(law: &ContactLaw) -> Chart {
    let mut plot = Plot::new();
    both(
        law,
        &mut plot,
        |c| c.levels.iter().map(|l| (l.force_n, l.area_mm2)).unzip(),
        |k, r| {
            let layer = law.layer.as_ref().and_then(|l| Some((l.force_n.get(k)?, l.area_mm2.get(k)?)));
            let layer = layer.map(|(f, a)| ("rigid, by thickness", f.clone(), a.clone(), DashType::Solid));
            let table = if layer.is_some() { DashType::Dash } else { DashType::Solid };
            layer.into_iter().chain([("rigid, fitted table", r.force_n.clone(), r.area_mm2.clone(), table)]).collect()
        },
    );
    plot.set_layout(layout("force [N]", "contact area [mm2]"));
    Chart {
        id: "law-area".into(),
        title: "Contact area over force".into(),
        text: format!(
            "Both models; root mean square difference at equal force {:.1} %{}.",
            law.area_error_percent,
            law.layer.as_ref().map_or(String::new(), |l| format!(", by thickness {:.1} %", l.area_error_percent))
        ),
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
