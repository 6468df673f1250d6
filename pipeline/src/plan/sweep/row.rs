//! A plan of a sweep as a row of numbers, and how the rows are ranked.

use super::file::Sweep;
use super::subject::Subject;
use crate::plan::astray::briefly;
use crate::plan::chances::asked_of;
use crate::plan::file::PlanFile;
use crate::plan::knee::Placed;
use crate::plan::knee::main_coordinate;
use crate::plan::numbers::Value;
use crate::plan::outcome::borne::among;
use crate::plan::outcome::{Left, Outcome, TestTold};
use crate::plan::table::fixed;
use notices::Kind;
use sim::flags::{Flag, each_once};
use std::cmp::Ordering;

/// What follows the name of a number of the most probable knee: that number, mean and interval of the samples.
const ENDS: [&str; 4] = ["", "_mean", "_lower", "_upper"];
/// Of so many of the first plans it is counted whose graft bears too much [-]; ours: what a reader of ranks looks at.
const FIRST: usize = 10;
/// The most that the graft bears unloaded.
const FORCE: &str = "unloaded_force_n";

/// What came of a plan: its numbers, samples that say less than others, and what is odd in few words.
pub(super) type Came = (Outcome, Left, Vec<String>);

/// A plan of a sweep.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// Its number, from 1 on, in the order of the values of the choices.
    pub(super) plan: usize,
    /// Its place among all, from 1 on; none where it could not be done.
    pub(super) rank: Option<usize>,
    /// Values of the choices.
    pub(super) values: Vec<f64>,
    /// Every number by its column.
    pub(super) numbers: Vec<(String, Option<f64>)>,
    /// What is odd.
    pub(super) flags: Vec<String>,
    /// The same in few words.
    pub(super) brief: Vec<String>,
    /// Whether a graft bears too much.
    pub(super) beyond: bool,
    /// Why it could not be done.
    pub(super) fault: Option<String>,
    /// By which test it is ranked, after all tests.
    pub(super) subject: Subject,
}

impl Row {
    /// Of what came of a plan.
    pub(super) fn of(
        plan: usize,
        values: Vec<f64>,
        found: Result<Came, String>,
        (graft, subject): (usize, Subject),
    ) -> Row {
        let (numbers, flags, brief, beyond, fault) = match found {
            Ok((out, left, brief)) => (numbers(&out, left, graft), flags(&out), brief, is_beyond(&out), None),
            Err(why) => (vec![], vec![], vec![], false, Some(why)),
        };
        let mut row = Row { plan, rank: None, values, numbers, flags, brief, beyond, fault, subject };
        let outside = row.outside();
        if !outside.is_empty() {
            row.flags.push(format!("outside its interval: {}", outside.join(" ")));
        }
        if outside.iter().any(|column| column == FORCE) {
            row.brief.push("graft force outside its interval".into());
        }
        row
    }

    /// Columns in which the most probable knee lies outside its own interval: of poses and of the graft's force, as for results.
    fn outside(&self) -> Vec<String> {
        let columns = self.numbers.iter().filter_map(|(name, _)| name.strip_suffix("_lower"));
        let held = columns.filter(|column| column.ends_with("_off_mm") || *column == FORCE);
        held.filter(|column| self.value(column).is_some_and(|v| v.is_outside())).map(str::to_owned).collect()
    }

    /// A chance in words: "33 % (4 of 12)"; none without samples that tell it.
    pub(super) fn share(&self, column: &str) -> Option<String> {
        let chance = self.number(column)?;
        let percent = fixed(100.0 * chance, 0);
        Some(match self.number(&format!("{column}_of")) {
            Some(all) => format!("{percent} % ({:.0} of {all:.0})", chance * all),
            None => format!("{percent} %"),
        })
    }

    /// A number by its column.
    pub(super) fn number(&self, column: &str) -> Option<f64> {
        self.numbers.iter().find(|(name, _)| name == column).and_then(|(_, x)| *x)
    }

    /// A number with what the samples say of it.
    pub(super) fn value(&self, column: &str) -> Option<Value> {
        let [value, mean, lower, upper] = ENDS.map(|end| self.number(&format!("{column}{end}")));
        Some(Value { value: value?, mean, lower, upper })
    }

    /// What it is ranked by, the more the better: the chance that every test is like the intact knee, that of the test which it is about, and how near that is.
    fn worth(&self) -> [f64; 3] {
        let or_best = |chance: &str, best: &str| self.number(chance).or(self.number(best)).unwrap_or(-1.0);
        let of = self.subject;
        let far = self.number(&of.most_off()).unwrap_or(f64::INFINITY);
        [or_best("chance", "restored"), or_best(&of.chance(), &of.restored()), -far]
    }
}

/// Gives rows their ranks: the best first, and of equals the one with the lesser values.
pub(super) fn rank(rows: &mut [Row]) {
    let mut order: Vec<usize> = (0..rows.len()).filter(|k| rows[*k].fault.is_none()).collect();
    let compared = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne());
    order.sort_by(|a, b| {
        let (a, b) = (&rows[*a], &rows[*b]);
        let by_worth = compared(&b.worth(), &a.worth());
        by_worth.or_else(|| compared(&a.values, &b.values)).unwrap_or(Ordering::Equal)
    });
    for (place, k) in order.into_iter().enumerate() {
        rows[k].rank = Some(place + 1);
    }
}

/// The rows in the order of their ranks; those without one are left out.
pub(super) fn ranked(rows: &[Row]) -> Vec<&Row> {
    let mut out: Vec<&Row> = rows.iter().filter(|r| r.rank.is_some()).collect();
    out.sort_by_key(|r| r.rank);
    out
}

/// How many of the first plans have a graft that bears too much, in a sentence without its stop; none where no plan could be done.
pub(super) fn beyond_among_first(rows: &[Row]) -> Option<String> {
    let first: Vec<bool> = ranked(rows).iter().take(FIRST).map(|r| r.beyond).collect();
    among(&first)
}

/// Every number of a plan by its column.
fn numbers(out: &Outcome, left: Left, graft: usize) -> Vec<(String, Option<f64>)> {
    let mut all: Vec<(String, Option<f64>)> = Vec::new();
    let own = out.grafts.get(graft);
    let percent = |of: Option<[f64; 2]>, k: usize| of.map(|both| both[k]);
    let (quadrant, plateau) = (own.and_then(|g| g.quadrant_percent), own.and_then(|g| g.plateau_percent));
    all.push(("quadrant_depth_percent".into(), percent(quadrant, 0)));
    all.push(("quadrant_height_percent".into(), percent(quadrant, 1)));
    all.push(("plateau_front_percent".into(), percent(plateau, 0)));
    all.push(("plateau_medial_percent".into(), percent(plateau, 1)));
    all.push(("length_mm".into(), own.map(|g| g.length_mm)));
    all.push(("slack_length_mm".into(), own.map(|g| g.slack_length_mm)));
    let of = |counts: Option<[usize; 2]>| counts.map(|[_, all]| all as f64);
    // the chances of a plan come in this order, those of what other ligaments than an ACL resist last
    let own_kinds = asked_of(&out.planned);
    let usual = ["_drawer", "_pivot_shift", ""].map(str::to_owned);
    let names = usual.into_iter().chain(own_kinds.iter().map(|kind| format!("_{}", kind.replace(' ', "_"))));
    for (name, c) in names.zip(&out.chances) {
        all.push((format!("restored{name}"), Some(f64::from(u8::from(c.most_probable)))));
        all.push((format!("chance{name}"), c.chance));
        all.push((format!("chance{name}_of"), of(c.counts)));
    }
    let loaded = || out.tests.iter().filter(|t| t.test != "unloaded");
    for t in loaded() {
        all.push((format!("chance_{}", called(t)), t.chance));
        all.push((format!("chance_{}_of", called(t)), of(t.counts)));
    }
    let drawers = || loaded().filter(|t| t.test.ends_with("drawer"));
    let turning = own_kinds.into_iter().filter(|kind| !kind.ends_with("drawer"));
    for kind in ["anterior drawer", "posterior drawer"].into_iter().chain(turning) {
        let (column, unit) = (main_coordinate(kind).column(), main_coordinate(kind).unit());
        let mine = loaded().filter(|t| t.test == kind);
        let off = mine.map(|t| t.off.get(&column).map(|v| v.mean.unwrap_or(v.value).abs()));
        // one without equilibrium is far off, however far that is
        let most = off.collect::<Option<Vec<f64>>>().and_then(|all| all.into_iter().reduce(f64::max));
        all.push((format!("{}_most_off_{unit}", kind.replace(' ', "_")), most));
    }
    for t in drawers() {
        push(&mut all, &format!("{}_off_mm", called(t)), t.off.get("ap_mm"));
    }
    let force = own.map(|g| format!("graft_{}_n", g.name)).unwrap_or_default();
    let [graft, medial, lateral] =
        [force.as_str(), "contact_medial_force_n", "contact_lateral_force_n"].map(|q| most(out, q));
    push(&mut all, FORCE, graft.map(|(_, v)| v));
    all.push(("unloaded_force_at_deg".into(), graft.map(|(t, _)| t.flexion_deg)));
    push(&mut all, "unloaded_medial_contact_n", medial.map(|(_, v)| v));
    push(&mut all, "unloaded_lateral_contact_n", lateral.map(|(_, v)| v));
    let counts =
        [("samples", out.samples), ("samples_leaving", left.leaving), ("samples_without_equilibrium", left.lost)];
    let counts = counts.into_iter().chain([("samples_not_operated", left.not_operated)]);
    all.extend(counts.map(|(name, n)| (name.to_owned(), Some(n as f64))));
    all
}

/// A test as it stands in the name of a column: `anterior_drawer_30`.
fn called(t: &TestTold) -> String {
    format!("{}_{}", t.test.replace(' ', "_"), t.flexion_deg)
}

/// A number with mean and interval.
fn push(all: &mut Vec<(String, Option<f64>)>, name: &str, value: Option<&Value>) {
    let four =
        [value.map(|v| v.value), value.and_then(|v| v.mean), value.and_then(|v| v.lower), value.and_then(|v| v.upper)];
    all.extend(ENDS.iter().zip(four).map(|(end, x)| (format!("{name}{end}"), x)));
}

/// The unloaded test in which a quantity of the reconstructed knee is the most; of equals the first. None where one has no equilibrium: it might be
/// there.
fn most<'a>(out: &'a Outcome, quantity: &str) -> Option<(&'a TestTold, &'a Value)> {
    let unloaded = out.tests.iter().filter(|t| t.test == "unloaded");
    let all: Option<Vec<_>> = unloaded.map(|t| Some((t, t.states.get("reconstructed")?.get(quantity)?))).collect();
    all?.into_iter().reduce(|best, one| if one.1.value > best.1.value { one } else { best })
}

/// What is odd of a plan: of its grafts, and of the reconstructed knee by test. What is odd without a graft is the same of all plans.
fn flags(out: &Outcome) -> Vec<String> {
    let of_plan = out.notices.iter().filter(|n| n.kind != Kind::RowFlagged).map(ToString::to_string);
    let of_test = |t: &TestTold| {
        let own = t.flags.get("reconstructed").filter(|f| !f.is_empty())?;
        Some(format!("{}, {} deg: {}", t.test, t.flexion_deg, own.join(", ")))
    };
    of_plan.chain(out.tests.iter().filter_map(of_test)).collect()
}

/// Whether a graft of a plan bears too much in any test.
fn is_beyond(out: &Outcome) -> bool {
    out.tests.iter().any(|t| !t.beyond.is_empty())
}

/// What is odd of a plan in few words: its sites, the reconstructed knee, and what its grafts bear. Samples that leave the plateau or are lost have
/// columns of their own.
pub(super) fn brief(plan: &PlanFile, placed: &[Placed], out: &Outcome) -> Vec<String> {
    let mut all = Vec::new();
    for ((graft, at), told) in plan.graft.iter().zip(placed).zip(&out.grafts) {
        let whose = if plan.graft.len() > 1 { format!("{}, ", graft.name) } else { String::new() };
        all.extend(briefly(graft, at, told.percents()).into_iter().map(|words| format!("{whose}{words}")));
    }
    let lacks_column =
        |f: &&Flag| !matches!(f, Flag::OutsideInterval(_) | Flag::SamplesLeave { .. } | Flag::SamplesLost { .. });
    all.extend(each_once(out.tests.iter().flat_map(|t| &t.odd).filter(lacks_column)));
    for words in out.tests.iter().flat_map(|t| &t.beyond) {
        if !all.contains(words) {
            all.push(words.clone());
        }
    }
    all.extend(out.notices.iter().any(|n| n.kind == Kind::NoIntervals).then(|| "no intervals".to_owned()));
    all
}

/// Whether a column counts something: samples, or yes and no.
fn counts(column: &str) -> bool {
    let is_of = column.starts_with("chance") && column.ends_with("_of");
    is_of || ["samples", "restored"].iter().any(|head| column.starts_with(*head))
}

/// A number as the table has it.
fn written(column: &str, x: f64) -> String {
    if counts(column) { format!("{x:.0}") } else { format!("{x:.4}") }
}

/// Columns of sweep.csv.
pub(super) fn columns(sweep: &Sweep, rows: &[Row]) -> Vec<String> {
    let keys = sweep.varied.iter().map(|(c, _)| c.key.to_owned());
    let numbers = rows.iter().find(|r| r.fault.is_none()).map_or(&[][..], |r| &r.numbers);
    let head = ["plan", "rank"].map(str::to_owned).into_iter().chain(keys);
    head.chain(numbers.iter().map(|(name, _)| name.clone())).chain(["flags", "fault"].map(str::to_owned)).collect()
}

/// sweep.csv: a row a plan.
pub(super) fn csv(sweep: &Sweep, rows: &[Row]) -> Vec<u8> {
    let columns = columns(sweep, rows);
    let mut text = columns.join(",") + "\n";
    let numbers = columns.len() - sweep.varied.len() - 4;
    let quoted = |words: &str| format!("\"{}\"", words.replace('"', "\"\""));
    let in_words = |words: &str| if words.contains([',', '"', '\n']) { quoted(words) } else { words.to_owned() };
    for row in rows {
        let head = [Some(row.plan), row.rank].map(|n| n.map_or(String::new(), |n| n.to_string()));
        let values = row.values.iter().map(f64::to_string);
        let own = (0..numbers).map(|k| {
            let number = row.numbers.get(k).and_then(|(name, x)| Some(written(name, (*x)?)));
            number.unwrap_or_default()
        });
        let tail = [in_words(&row.flags.join("; ")), in_words(row.fault.as_deref().unwrap_or(""))];
        let cells: Vec<String> = head.into_iter().chain(values).chain(own).chain(tail).collect();
        text += &cells.join(",");
        text.push('\n');
    }
    text.into_bytes()
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::file::parsed;
    use super::*;
    use crate::plan::file;
    use std::collections::BTreeMap;

    /// A row with a chance of a hundred samples and a distance.
    pub(in super::super) fn row(plan: usize, values: &[f64], chance: f64, off: f64) -> Row {
        let numbers =
            [("chance", chance), ("chance_of", 100.0), ("chance_drawer", 0.5), ("anterior_drawer_most_off_mm", off)];
        let numbers = numbers.map(|(name, x)| (name.to_owned(), Some(x))).to_vec();
        let (flags, brief) = (vec![], vec![]);
        let subject = Subject { kind: "anterior drawer" };
        Row { plan, rank: None, values: values.to_vec(), numbers, flags, brief, beyond: false, fault: None, subject }
    }

    #[test]
    fn the_likeliest_comes_first_then_the_nearest_and_no_order_of_rows_changes_that() {
        let lost = Row { numbers: vec![], fault: Some("none".into()), ..row(5, &[50.0], 0.0, 0.0) };
        let rows = [
            row(1, &[10.0], 0.2, 1.0),
            row(2, &[20.0], 0.9, 3.0),
            row(3, &[30.0], 0.9, 2.0),
            row(4, &[40.0], 0.2, 1.0),
            lost,
        ];
        let ranks = |order: &[usize]| {
            let mut rows: Vec<Row> = order.iter().map(|k| rows[*k].clone()).collect();
            rank(&mut rows);
            let mut ranks: Vec<_> = rows.iter().map(|r| (r.plan, r.rank)).collect();
            ranks.sort();
            ranks
        };
        let by_hand = [(1, Some(3)), (2, Some(2)), (3, Some(1)), (4, Some(4)), (5, None)];
        for order in [[0, 1, 2, 3, 4], [4, 3, 2, 1, 0], [3, 0, 4, 2, 1]] {
            assert_eq!(ranks(&order), by_hand);
        }
    }

    #[test]
    fn every_row_has_a_cell_for_each_column_and_words_with_commas_are_quoted() {
        let sweep = parsed("tension_n = [40, 80]", &file::parsed(file::EXAMPLE).unwrap()).unwrap();
        let mut odd = row(1, &[40.0], 0.25, 2.0);
        odd.flags = vec!["a, \"b\"".into(), "c".into()];
        let lost = Row { numbers: vec![], fault: Some("out of reach".into()), ..row(2, &[80.0], 0.0, 0.0) };
        let text = String::from_utf8(csv(&sweep, &[odd, lost])).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[0],
            "plan,rank,tension_n,chance,chance_of,chance_drawer,anterior_drawer_most_off_mm,flags,fault"
        );
        assert_eq!(lines[1], "1,,40,0.2500,100,0.5000,2.0000,\"a, \"\"b\"\"; c\",");
        assert_eq!(lines[2], "2,,80,,,,,,out of reach");
        // what counts is whole, what is measured is not
        assert!(["samples", "samples_leaving", "restored_drawer", "chance_varus_30_of"].into_iter().all(counts));
        assert!(!["chance", "chance_varus_30", "length_mm", "unloaded_force_at_deg"].into_iter().any(counts));
    }

    #[test]
    fn a_value_outside_its_own_interval_is_flagged_by_its_column_and_a_chance_has_its_samples() {
        let mut one = row(1, &[40.0], 0.25, 2.0);
        let ends = |name: &str, four: [f64; 4]| ENDS.map(|end| format!("{name}{end}")).into_iter().zip(four.map(Some));
        one.numbers.extend(ends(FORCE, [9.0, 15.0, 10.0, 20.0]));
        one.numbers.extend(ends("anterior_drawer_30_off_mm", [1.0, 1.0, 0.0, 2.0]));
        one.numbers.extend(ends("unloaded_medial_contact_n", [9.0, 15.0, 10.0, 20.0]));
        assert_eq!(one.outside(), [FORCE]);
        assert_eq!(one.share("chance").unwrap(), "25 % (25 of 100)");
        assert_eq!(one.share("chance_drawer").unwrap(), "50 %");
        assert!(one.share("chance_pivot_shift").is_none());
    }

    /// An unloaded test in which the graft bears so much [N]; without a force it has no equilibrium.
    fn unloaded(flexion_deg: f64, force: Option<f64>) -> TestTold {
        let value = |value: f64| Value { value, mean: None, lower: None, upper: None };
        let own: BTreeMap<String, Value> = force.map(|n| ("graft_g_n".to_owned(), value(n))).into_iter().collect();
        TestTold {
            test: "unloaded".into(),
            flexion_deg,
            load: [0.0; 5],
            states: BTreeMap::from([("reconstructed".to_owned(), own)]),
            flags: BTreeMap::new(),
            off: BTreeMap::new(),
            chance: None,
            counts: None,
            odd: if force.is_some() { vec![] } else { vec![Flag::NoEquilibrium] },
            beyond: vec![],
        }
    }

    /// What came of a plan of which these tests were asked.
    fn out(tests: Vec<TestTold>) -> Outcome {
        Outcome {
            schema: crate::plan::SCHEMA,
            plan: String::new(),
            model: None,
            planned: file::parsed(file::EXAMPLE).unwrap(),
            cut: vec![],
            grafts: vec![],
            samples: 0,
            interval: 0.9,
            tests,
            chances: vec![],
            warnings: vec![],
            notices: vec![],
        }
    }

    #[test]
    fn a_graft_that_bears_too_much_is_named_once_and_counted_among_the_first_ten() {
        let plan = file::parsed(file::EXAMPLE).unwrap();
        let words = "g beyond 250 N unloaded";
        let taut = |deg: f64| TestTold { beyond: vec![words.into()], ..unloaded(deg, Some(300.0)) };
        let marked = out(vec![unloaded(0.0, Some(3.0)), taut(30.0), taut(90.0)]);
        assert_eq!(brief(&plan, &[], &marked), [words]);
        let of = |k: usize, came: Outcome| {
            Row::of(k, vec![k as f64], Ok((came, Left::default(), vec![])), (0, Subject { kind: "anterior drawer" }))
        };
        // equal plans go by their values: the marked ones are the second and the eleventh
        let one = |k: usize| of(k, if [2, 11].contains(&k) { marked.clone() } else { out(vec![]) });
        let mut rows: Vec<Row> = (1..=12).map(one).collect();
        assert!(beyond_among_first(&rows).is_none());
        rank(&mut rows);
        let told = beyond_among_first(&rows).unwrap();
        assert!(told.starts_with("1 of the first 10 plans has a graft beyond"), "{told}");
    }

    #[test]
    fn there_is_no_most_where_a_test_has_no_equilibrium_and_few_words_say_so() {
        let plan = file::parsed(file::EXAMPLE).unwrap();
        let all = out(vec![unloaded(0.0, Some(3.0)), unloaded(30.0, Some(8.0)), unloaded(90.0, Some(8.0))]);
        assert_eq!(most(&all, "graft_g_n").map(|(t, v)| (t.flexion_deg, v.value)), Some((30.0, 8.0)));
        assert!(brief(&plan, &[], &all).is_empty());
        let lost = out(vec![unloaded(0.0, Some(3.0)), unloaded(30.0, None)]);
        assert!(most(&lost, "graft_g_n").is_none());
        assert_eq!(brief(&plan, &[], &lost), ["no equilibrium"]);
    }
}
