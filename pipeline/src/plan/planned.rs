//! The part of the page that says what was planned: places, laws and fixing of the grafts, loads of the tests.

use super::file::{GraftFile, PlanFile, SiteFile, TestsFile};
use super::html::{table, words};
use super::knee::unloaded_deg;
use super::outcome::Outcome;

/// How a graft answers in this knee: its stiffness [N/mm], and the bundle whose fibres and law it takes over, if one.
pub(super) type Law<'a> = (f64, Option<&'a str>);

/// The section of a plan's page.
pub(super) fn planned(out: &Outcome) -> String {
    let laws: Vec<Law> = out.grafts.iter().map(|g| (g.stiffness_n_per_mm, g.like.as_deref())).collect();
    section(&out.planned, &laws)
}

/// The section, of a plan and the laws of its grafts.
pub(super) fn section(file: &PlanFile, laws: &[Law]) -> String {
    let mut text = String::from("<h2>What was planned</h2>");
    if !file.graft.is_empty() {
        let rows = file
            .graft
            .iter()
            .zip(laws)
            .map(|(g, own)| vec![g.name.clone(), site(&g.femur), site(&g.tibia), law(g, *own), fixing(g, file)]);
        text += &table(&words(&["graft", "femur", "tibia", "stiffness and law", "fixed"]), rows);
    }
    text + &table(&words(&["test", "load", "flexion, deg"]), loads(&file.tests).into_iter())
}

/// Numbers side by side.
fn list(all: &[f64]) -> String {
    all.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
}

/// A place as it was asked for.
fn site(s: &SiteFile) -> String {
    let place = match (&s.native, s.point_mm, s.quadrant_percent, s.plateau_percent) {
        (Some(name), ..) => format!("native {name}"),
        (_, Some(p), ..) => format!("point {} mm in the frame of the CT", list(&p)),
        (_, _, Some(p), _) => format!("quadrant: depth from the back and height downwards {} %", list(&p)),
        (_, _, _, Some(p)) => format!("plateau: from the front and from medial {} %", list(&p)),
        _ => "none".into(),
    };
    match s.move_mm == [0.0; 3] {
        true => place,
        false => format!("{place}, moved {} mm (forwards, upwards, lateral)", list(&s.move_mm)),
    }
}

/// How a graft answers to being stretched.
fn law(g: &GraftFile, (stiffness, like): Law) -> String {
    let stiffness = match (g.stiffness_n_per_mm, g.cross_section_mm2, g.modulus_mpa) {
        (None, Some(area), Some(modulus)) => {
            let length = g.free_length_mm.map_or("its length between the bones".into(), |l| format!("{l} mm"));
            format!("{stiffness:.0} N/mm: {area} mm2 with {modulus} MPa over {length}")
        }
        _ => format!("{stiffness:.0} N/mm"),
    };
    match like {
        Some(bundle) => format!("{stiffness}; fibres and law of {bundle}, toe strain {}", g.toe_strain),
        None => format!("{stiffness}; toe up to a strain of {}, then straight", 2.0 * g.toe_strain),
    }
}

/// How a graft is fixed.
fn fixing(g: &GraftFile, file: &PlanFile) -> String {
    match (g.slack_length_mm, g.tension_n) {
        (Some(mm), _) => format!("slack length {mm} mm"),
        (None, Some(n)) => {
            format!("with {n} N at {} deg, under {} N of compression", g.at_flexion_deg, file.tests.compression_n)
        }
        // a file without either is refused before
        (None, None) => "none".into(),
    }
}

/// The tests: what is done, its load, its flexions.
pub(super) fn loads(t: &TestsFile) -> Vec<Vec<String>> {
    let flexions = list(&t.flexions_deg);
    let [fe, valgus, internal] = t.pivot;
    let row = |test: &str, load: String, flexions: &str| vec![test.to_owned(), load, flexions.to_owned()];
    vec![
        row("every test", format!("{} N of compression", t.compression_n), ""),
        row("anterior and posterior drawer", format!("{} N", t.drawer_n), &flexions),
        row("internal and external rotation", format!("{} N m", t.rotation_nm), &flexions),
        row("varus and valgus", format!("{} N m", t.varus_valgus_nm), &flexions),
        row("pivot shift", format!("{valgus} N m valgus with {internal} N m internal"), &fe.to_string()),
        row("unloaded", "none".into(), &list(&unloaded_deg(t))),
        row(
            "like the intact knee",
            format!("within {} mm of AP, {} deg of IE and VV", t.restored_mm, t.restored_deg),
            "",
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::file::{EXAMPLE, parsed};
    use super::*;

    #[test]
    fn every_number_of_a_plan_stands_on_its_page() {
        let file = parsed(EXAMPLE).unwrap();
        let g = &file.graft[0];
        let own: Law = (200.0, None);
        let words = [site(&g.femur), site(&g.tibia), law(g, own), fixing(g, &file)].join("; ");
        let tests = loads(&file.tests).concat().join("; ");
        for number in
            ["24.8, 28.5 %", "41, 48 %", "200 N/mm", "strain of 0.06", "80 N at 20 deg", "20 N of compression"]
        {
            assert!(words.contains(number), "{number}: {words}");
        }
        for number in ["134 N", "5 N m", "10 N m", "8 N m valgus with 4 N m internal", "0, 30, 60, 90", "2 mm", "3 deg"]
        {
            assert!(tests.contains(number), "{number}: {tests}");
        }
        // unloaded it is asked at the flexions of the other tests, too: from there these count
        let few = TestsFile { passive_deg: vec![45.0], ..file.tests.clone() };
        assert_eq!(loads(&few)[5], ["unloaded", "none", "0, 30, 45, 60, 90"]);
        let thick = GraftFile {
            stiffness_n_per_mm: None,
            cross_section_mm2: Some(50.0),
            modulus_mpa: Some(120.0),
            tension_n: None,
            slack_length_mm: Some(31.0),
            femur: SiteFile { native: Some("ACL".into()), move_mm: [2.0, 0.0, 0.0], ..SiteFile::default() },
            ..g.clone()
        };
        assert!(law(&thick, own).contains("50 mm2 with 120 MPa over its length"));
        assert_eq!(fixing(&thick, &file), "slack length 31 mm");
        assert!(site(&thick.femur).starts_with("native ACL, moved 2, 0, 0 mm"));
    }
}
