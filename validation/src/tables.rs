//! The paper's Tables 4 to 7 for the specimen at hand, with the published values beside where it is one of the paper's, and compare.csv.

use crate::cross::CrossPrediction;
use crate::published;
use crate::validate::{Difference, Source};
use attachments::groups::GROUPS;
use calibration::cost::{Cost, CostFunction};
use calibration::design::Design;
use sim::coordinate::Free;
use sim::flags::Flag;
use sim::laxity::Test;
use sim::laxity::{WITHOUT_COLUMN, cut_cell};
use sim::spec::PoseSpec;

/// A table as text.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// The name of its files, without ending.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// Column names.
    pub header: Vec<String>,
    /// Cells.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    fn new(name: &str, title: &str, header: &[&str]) -> Table {
        let header = header.iter().map(|h| (*h).to_owned()).collect();
        Table { name: name.into(), title: title.into(), header, rows: vec![] }
    }

    /// As CSV.
    pub fn csv(&self) -> String {
        let line = |cells: &[String]| {
            let quoted: Vec<String> = cells
                .iter()
                .map(|c| if c.contains([',', '"']) { format!("\"{}\"", c.replace('"', "\"\"")) } else { c.clone() })
                .collect();
            quoted.join(",") + "\n"
        };
        line(&self.header) + &self.rows.iter().map(|r| line(r)).collect::<String>()
    }

    /// As Markdown.
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule = format!("|{}\n", "---|".repeat(self.header.len()));
        format!(
            "## {}\n\n{}{rule}{}",
            self.title,
            line(&self.header),
            self.rows.iter().map(|r| line(r)).collect::<String>()
        )
    }
}

/// Tables 4 to 7.
pub fn tables(sources: &[Source]) -> Vec<Table> {
    vec![table4(sources), table5(sources), table6(sources), table7(sources)]
}

/// What models of single data sets predict of the others' laxity. Column `without` is there where a knee was cut.
pub fn cross_predictions(all: &[CrossPrediction]) -> Table {
    let told = ["model", "data", "change of", "flexion [deg]", "from", "to", "measured", "predicted", "lower", "upper"];
    let cut = all.iter().any(|p| !p.without.is_empty());
    let header: Vec<&str> = told.into_iter().chain(["inside"]).chain(cut.then_some(WITHOUT_COLUMN)).collect();
    let mut t = Table::new(
        "cross_prediction",
        "Laxity of one data set as predicted by the knee calibrated to another",
        &header,
    );
    for p in all {
        let (unit, load) = if p.coordinate == "ap" { ("mm", "N") } else { ("deg", "N m") };
        let [from, to] = p.loads.map(|l| format!("{l:.1} {load}"));
        let mut row = vec![
            p.model.clone(),
            p.data.clone(),
            format!("{} [{unit}]", p.coordinate),
            format!("{:.0}", p.flexion_deg),
            from,
            to,
        ];
        row.extend([p.measured, p.predicted.mean, p.predicted.lower, p.predicted.upper].map(|x| format!("{x:.1}")));
        row.push(yes(p.is_inside()));
        row.extend(cut.then(|| cut_cell(&p.without)));
        t.rows.push(row);
    }
    t
}

/// The largest differences of explicit dynamics and the quasi-static solver, of every source that was told by both.
pub fn solvers(sources: &[Source]) -> Table {
    let header = [
        "source",
        "protocol",
        "cut",
        "step",
        "flexion_deg",
        "quantity",
        "unit",
        "explicit",
        "quasistatic",
        "difference",
        "limit",
        "within",
        "cause",
    ];
    let mut out =
        Table::new("solvers", "Explicit dynamics against the quasi-static solver: largest differences", &header);
    for s in sources {
        for a in s.check.iter().flat_map(|c| &c.largest) {
            let mut row = vec![s.label(sources), a.protocol.clone(), a.cut.clone(), a.step.clone()];
            row.extend([format!("{:.0}", a.flexion_deg), a.column.clone(), a.unit.clone()]);
            row.extend([a.explicit, a.quasistatic, a.difference()].map(|x| format!("{x:.3}")));
            row.extend([format!("{}", a.limit), if a.share() <= 1.0 { "yes" } else { "no" }.into()]);
            row.push(a.cause.map_or("", |c| c.words()).to_owned());
            out.rows.push(row);
        }
    }
    out
}

fn yes(is: bool) -> String {
    if is { "yes" } else { "no" }.to_owned()
}

/// How far the tests of a knee move with what a calibration does not settle.
pub fn sensitivity(sources: &[Source]) -> Table {
    let header =
        ["source", "changed", "by", "test", "flexion_deg", "ap_mm", "ie_deg", "vv_deg", "force_n", "bundle", "drawer"];
    let title = "What moves the knee: size of the change of each test";
    let mut out = Table::new("sensitivity", title, &header);
    for s in sources {
        for m in &s.sensitivity {
            let texts = [&s.label(sources), m.changed.name(), m.changed.by(), &m.step];
            let mut row = texts.map(str::to_owned).to_vec();
            row.push(format!("{:.0}", m.flexion_deg));
            row.extend([m.ap_mm, m.ie_deg, m.vv_deg].map(|x| format!("{x:.3}")));
            row.extend([format!("{:.1}", m.force_n), m.bundle.clone(), yes(m.drawer)]);
            out.rows.push(row);
        }
    }
    out
}

/// All tables and the differences on one page.
pub fn page(specimen: &str, tables: &[Table], differences: &Table) -> String {
    let whose = published::title(specimen).map_or(String::new(), |t| {
        format!(
            "{specimen} is {t} of the paper [andreassen2025]; rows of origin \"published\" are its figures. They were most likely computed under 150 N of compression at 30.9, 60.8 and 90.7 deg.\n\n"
        )
    });
    let all: Vec<String> = tables.iter().chain([differences]).map(Table::markdown).collect();
    format!("# {specimen}: calibrated models compared\n\n{whose}{}", all.join("\n"))
}

/// What each group of targets adds to the cost of one evaluation, as the spreadsheet of the paper's supplement: error, range, weight, share.
pub fn cost_table(cost: &CostFunction, predicted: &[Option<Free<f64>>]) -> Table {
    let header = ["test", "flexion_deg", "coordinate", "trials", "error", "range", "unit", "weight", "cost", "percent"];
    let mut out = Table::new("cost", "What the cost is made of", &header);
    let Cost { errors, sum, .. } = cost.cost(predicted);
    for (t, error) in cost.terms.iter().zip(errors) {
        let share = t.weight * error / t.range;
        out.rows.push(vec![
            t.in_words(),
            format!("{:.0}", t.nominal_flexion_deg),
            t.coordinate.name().to_owned(),
            t.trials.len().to_string(),
            format!("{error:.3}"),
            format!("{:.3}", t.range),
            t.coordinate.unit().to_owned(),
            format!("{:.0}", t.weight),
            format!("{share:.2}"),
            format!("{:.1}", 100.0 * share / sum.max(f64::MIN_POSITIVE)),
        ]);
    }
    out
}

/// compare.csv.
pub fn differences(all: &[Difference]) -> Table {
    let header =
        ["source_a", "source_b", "protocol", "quantity", "unit", "rmsd", "count", "published", "note", "against"];
    let mut out = Table::new("compare", "Differences between models (root mean square)", &header);
    for d in all {
        let published = d.published.map_or(String::new(), |p| format!("{p:.2}"));
        let texts = [&d.a, &d.b, &d.protocol, &d.quantity, &d.unit];
        let mut row: Vec<String> = texts.iter().map(|t| (*t).clone()).collect();
        row.extend([format!("{:.4}", d.rmsd), d.count.to_string(), published, d.note.clone()]);
        row.push(if d.measured { "measurement" } else { "model" }.into());
        out.rows.push(row);
    }
    out
}

fn table4(sources: &[Source]) -> Table {
    let mut out = Table::new("table4", "Table 4: ligament parameters", &["design_variable", "bundle", "kind"]);
    for s in sources {
        let name = s.label(sources);
        out.header.push(name.clone());
        if published::parameters(&s.specimen, &s.name).is_some() {
            out.header.push(format!("{name}_published"));
        }
    }
    for v in Design::table3().variables {
        let mut row = vec![format!("X{}", v.number), v.bundle(), v.kind.name().to_owned()];
        for s in sources {
            let value = s.parameters.iter().find(|(n, _)| *n == v.number);
            row.push(value.map_or(String::new(), |(n, x)| decimals(*n, *x)));
            if let Some(p) = published::parameters(&s.specimen, &s.name) {
                row.push(decimals(v.number, p[v.number as usize - 1]));
            }
        }
        out.rows.push(row);
    }
    out
}

/// Strains with three decimals, stiffnesses with two.
fn decimals(number: u32, value: f64) -> String {
    if number <= 14 { format!("{value:.3}") } else { format!("{value:.2}") }
}

/// A force; below 5 N a dash, as in the paper.
fn force(f: f64) -> String {
    if f < 5.0 { "-".into() } else { tenth(f) }
}

fn table5(sources: &[Source]) -> Table {
    let mut header = vec!["test", "flexion_deg", "source", "origin"];
    header.extend(GROUPS.iter().map(|(g, _)| *g));
    let title = "Table 5: ligament forces under the anterior and posterior load (N; below 5 N \"-\"; computed: of the most probable model, no means)";
    let mut out = Table::new("table5", title, &header);
    let mut flexions: Vec<f64> = sources.iter().flat_map(Source::ap_flexions).collect();
    flexions.sort_by(f64::total_cmp);
    flexions.dedup_by(|a, b| (*a - *b).abs() < 0.5);
    for test in [Test::Anterior, Test::Posterior] {
        for &fe in &flexions {
            for s in sources {
                let begin = |origin: &str| {
                    vec![test.name().to_owned(), format!("{fe:.0}"), s.label(sources), origin.to_owned()]
                };
                if let Some(r) = s.ap_row(test, fe) {
                    let mut row = begin("computed");
                    row.extend(s.groups(r).iter().map(|f| force(*f)));
                    out.rows.push(row);
                }
                if let Some(p) = published::ap_forces(&s.specimen, &s.name, test, fe) {
                    let mut row = begin("published");
                    row.extend(GROUPS.iter().map(|(g, _)| force(p.forces_n.get(*g).copied().unwrap_or(0.0))));
                    out.rows.push(row);
                }
            }
        }
    }
    out
}

/// A row of Tables 6 and 7 for each source and state of the ACL: computed, then published.
fn pivot_rows(
    sources: &[Source],
    computed: &dyn Fn(&Source, &sim::laxity::TrialResult) -> Vec<String>,
    known: &dyn Fn(&published::PivotShift) -> Vec<String>,
) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for acl in [true, false] {
        for s in sources {
            let begin = |origin: &str, dislocated: bool| {
                let acl = if acl { "intact" } else { "none" };
                vec![
                    acl.to_owned(),
                    s.label(sources),
                    origin.to_owned(),
                    if dislocated { "yes".into() } else { String::new() },
                ]
            };
            if let Some(r) = s.pivot_row(acl) {
                let mut row = begin("computed", Source::is_dislocated(r));
                row.extend(computed(s, r));
                rows.push(row);
            }
            if let Some(p) = published::pivot_shift(&s.specimen, &s.name, acl) {
                let mut row = begin("published", p.dislocated);
                row.extend(known(p));
                rows.push(row);
            }
        }
    }
    rows
}

/// With one decimal, never "-0.0"; a row without equilibrium has no number, and says so.
fn tenth(x: f64) -> String {
    if x.is_nan() {
        return Flag::NoEquilibrium.to_string();
    }
    let text = format!("{x:.1}");
    if text == "-0.0" { "0.0".to_owned() } else { text }
}

fn table6(sources: &[Source]) -> Table {
    let header = ["acl", "source", "origin", "dislocated", "fe_deg", "vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"];
    let mut out = Table::new(
        "table6",
        "Table 6: kinematics of the simulated pivot shift (computed: of the most probable model)",
        &header,
    );
    let six = |p: &PoseSpec| [p.fe_deg, p.vv_deg, p.ie_deg, p.ml_mm, p.ap_mm, p.si_mm].map(tenth).to_vec();
    let known = |p: &published::PivotShift| six(&p.pose());
    out.rows = pivot_rows(sources, &|_, r| six(&r.pose), &known);
    out
}

fn table7(sources: &[Source]) -> Table {
    let mut header = vec!["acl", "source", "origin", "dislocated"];
    header.extend(GROUPS.iter().map(|(g, _)| *g));
    let mut out = Table::new(
        "table7",
        "Table 7: ligament forces in the simulated pivot shift (N; computed: of the most probable model, no means)",
        &header,
    );
    let known = |p: &published::PivotShift| {
        GROUPS.iter().map(|(g, _)| format!("{:.1}", p.forces_n.get(*g).copied().unwrap_or(0.0))).collect()
    };
    let computed = |s: &Source, r: &sim::laxity::TrialResult| s.groups(r).map(tenth).to_vec();
    out.rows = pivot_rows(sources, &computed, &known);
    out
}
