//! The tables of a cohort: long, a value a row, so that a filter and a pivot answer any question.

use super::knee::{Knee, Rows, Status};
use super::outliers::Outlier;
use super::shared;
use super::table::{Column, Table};

/// The unit at the end of a quantity's name.
fn unit(name: &str) -> &'static str {
    const ENDS: [(&str, &str); 5] = [("_mm3", "mm3"), ("_mm2", "mm2"), ("_mm", "mm"), ("_deg", "deg"), ("_n", "N")];
    ENDS.iter().find(|(end, _)| name.ends_with(end)).map_or("-", |(_, unit)| unit)
}

/// All tables; those without a row too, so that a program finds the columns it expects.
pub(super) fn tables(knees: &[Knee], outliers: &[Outlier]) -> Vec<Table> {
    vec![
        of_knees(knees, outliers),
        of_stages(knees),
        of_warnings(knees),
        of_quantities(knees),
        of_outliers(outliers),
        joined(knees, "parameters", |k| &k.parameters, &["bundle", "kind"], &["value", "lower", "upper", "determined"]),
        joined(knees, "forces", |k| &k.forces, &["trial", "bundle"], &["value_n", "lower_n", "upper_n", "determined"]),
        joined(
            knees,
            "laxity",
            |k| &k.laxity,
            &["step"],
            &["fe_deg", "vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm", "load_vv_nm", "load_ie_nm", "load_ap_n"],
        ),
    ]
}

fn text<T>(of: &[T], cell: impl Fn(&T) -> &str) -> Column {
    Column::Text(of.iter().map(|x| cell(x).to_owned()).collect())
}

fn number<T>(of: &[T], cell: impl Fn(&T) -> f64) -> Column {
    Column::Number(of.iter().map(|x| Some(cell(x))).collect())
}

fn of_knees(knees: &[Knee], outliers: &[Outlier]) -> Table {
    let odd = |k: &Knee| super::of(outliers, k).len() as f64;
    let failed = |k: &Knee, message: bool| match &k.status {
        Status::Failed { stage, message: words } => if message { words } else { stage }.clone(),
        Status::Built => String::new(),
    };
    let place = |k: &Knee| k.folder.as_ref().map(|f| f.display().to_string()).unwrap_or_default();
    Table {
        name: "knees",
        columns: vec![
            ("knee", text(knees, |k| &k.name)),
            ("specimen", text(knees, |k| &k.specimen)),
            ("side", text(knees, |k| &k.side)),
            ("status", text(knees, |k| k.status.name())),
            ("failed_stage", Column::Text(knees.iter().map(|k| failed(k, false)).collect())),
            ("message", Column::Text(knees.iter().map(|k| failed(k, true)).collect())),
            ("last_stage", text(knees, |k| k.last_stage().unwrap_or_default())),
            ("warnings", number(knees, |k| k.warnings().count() as f64)),
            ("outliers", number(knees, odd)),
            ("seconds", number(knees, Knee::seconds)),
            ("peak_memory_mib", number(knees, Knee::memory_mib)),
            ("size_bytes", number(knees, |k| k.bytes as f64)),
            ("program", text(knees, |k| &k.program)),
            ("shared_prior", text(knees, |k| k.shared_prior.as_ref().map_or("", shared::name))),
            ("build", Column::Text(knees.iter().map(place).collect())),
        ],
    }
}

fn of_stages(knees: &[Knee]) -> Table {
    let all: Vec<_> = knees.iter().flat_map(|k| k.records.iter().map(move |r| (k, r))).collect();
    Table {
        name: "stages",
        columns: vec![
            ("knee", text(&all, |(k, _)| &k.name)),
            ("stage", text(&all, |(_, r)| &r.stage)),
            ("seconds", number(&all, |(_, r)| r.seconds)),
            ("peak_memory_mib", number(&all, |(_, r)| r.peak_memory_mib)),
            ("warnings", number(&all, |(_, r)| r.warnings.len() as f64)),
            ("digest", text(&all, |(_, r)| &r.digest)),
        ],
    }
}

fn of_warnings(knees: &[Knee]) -> Table {
    let all: Vec<_> = knees.iter().flat_map(|k| k.warnings().map(move |w| (k, w))).collect();
    Table {
        name: "warnings",
        columns: vec![
            ("knee", text(&all, |(k, _)| &k.name)),
            ("stage", text(&all, |(_, (stage, _))| stage)),
            ("warning", text(&all, |(_, (_, words))| words)),
        ],
    }
}

fn of_quantities(knees: &[Knee]) -> Table {
    let all: Vec<_> = knees.iter().flat_map(|k| k.quantities.iter().map(move |q| (k, q))).collect();
    Table {
        name: "quantities",
        columns: vec![
            ("knee", text(&all, |(k, _)| &k.name)),
            ("stage", text(&all, |(_, q)| q.stage)),
            ("quantity", text(&all, |(_, q)| &q.name)),
            ("part", text(&all, |(_, q)| &q.part)),
            ("value", number(&all, |(_, q)| q.value)),
            ("unit", text(&all, |(_, q)| unit(&q.name))),
        ],
    }
}

fn of_outliers(outliers: &[Outlier]) -> Table {
    Table {
        name: "outliers",
        columns: vec![
            ("knee", text(outliers, |o| &o.knee)),
            ("stage", text(outliers, |o| o.quantity.stage)),
            ("quantity", text(outliers, |o| &o.quantity.name)),
            ("part", text(outliers, |o| &o.quantity.part)),
            ("value", number(outliers, |o| o.quantity.value)),
            ("median", number(outliers, |o| o.median)),
            ("z", number(outliers, |o| o.z)),
        ],
    }
}

/// Files of one kind of all builds, one below the other, with the knee and the source in front.
fn joined(
    knees: &[Knee],
    name: &'static str,
    rows: impl Fn(&Knee) -> &Vec<Rows>,
    texts: &[&'static str],
    numbers: &[&'static str],
) -> Table {
    let all: Vec<(&Knee, &Rows)> = knees.iter().flat_map(|k| rows(k).iter().map(move |r| (k, r))).collect();
    let repeated = |cell: &dyn Fn(&Knee, &Rows) -> String| {
        Column::Text(all.iter().flat_map(|(k, r)| vec![cell(k, r); r.len()]).collect())
    };
    let mut columns = vec![
        ("knee", repeated(&|k, _| k.name.clone())),
        ("source", repeated(&|_, r| r.source.clone())),
        ("file", repeated(&|_, r| r.kind.clone())),
    ];
    columns.extend(texts.iter().map(|c| (*c, Column::Text(all.iter().flat_map(|(_, r)| r.cells(c)).collect()))));
    columns.extend(numbers.iter().map(|c| (*c, Column::Number(all.iter().flat_map(|(_, r)| r.numbers(c)).collect()))));
    Table { name, columns }
}
