use super::*;
use crate::figures;
use crate::tables;
use sim::coordinate::{Free, Load};
use sim::laxity::LaxityTrial;

/// Five anterior trials at 30 deg.
fn trials() -> Vec<LaxityTrial> {
    let trial = |k: u32| LaxityTrial {
        measured: Free::all(Some(0.0)),
        ..LaxityTrial::asked(
            format!("anterior_30_{k}"),
            Test::Anterior,
            30.0,
            Load::new(0.0, 0.0, 0.0, 45.0 * f64::from(k), 20.0),
        )
    };
    (0..5).map(trial).collect()
}

fn result(test: Test, fe: f64, load: Load, pose: Free<f64>, acl: f64) -> TrialResult {
    let trial = LaxityTrial { test, load, nominal_flexion_deg: fe, fe_deg: fe, ..trials()[0].clone() };
    let pose = PoseSpec { fe_deg: fe, ..PoseSpec::default() }.moved(&pose);
    TrialResult {
        trial,
        pose,
        forces_n: vec![0.6 * acl, 0.4 * acl, 3.0],
        outputs: vec![],
        flags: vec![],
        bands: vec![],
    }
}

/// A source of `specimen` whose AP is `ap` further than another's.
fn source_of(specimen: &str, name: &str, ap: f64) -> Source {
    let mut s = Source {
        name: name.into(),
        specimen: specimen.into(),
        model: name.into(),
        samples: 0,
        bundles: ["ACL_AM", "ACL_PL", "LCL"].map(String::from).to_vec(),
        parameters: vec![(1, 1.1 + 0.01 * ap), (15, 80.0 + ap)],
        ap_laxity: vec![],
        passive_flexion: vec![],
        pivot_shift: vec![],
        pivot_shift_no_acl: vec![],
        check: None,
        sensitivity: vec![],
    };
    for fe in [30.0, 60.0, 90.0] {
        for load in [66.0, 133.0, -133.0, 133.0] {
            let test = if load > 0.0 { Test::Anterior } else { Test::Posterior };
            let at = Free([0.0, 0.0, 0.0, load / 20.0 + ap, -20.0]);
            s.ap_laxity.push(result(test, fe, Load::new(0.0, 0.0, 0.0, load, 20.0), at, load.max(0.0) + 10.0 * ap));
        }
    }
    for k in 0..=18 {
        let fe = 5.0 * f64::from(k);
        s.passive_flexion.push(result(
            Test::Neutral,
            fe,
            Load::default(),
            Free([0.1 * ap, 0.2 * fe, 0.0, ap, -20.0]),
            0.0,
        ));
    }
    s.pivot_shift.push(result(Test::Valgus, 30.0, Load::new(8.0, -4.0, 0.0, 0.0, 20.0), Free::all(ap), 50.0));
    s.pivot_shift_no_acl.push(result(
        Test::Valgus,
        30.0,
        Load::new(8.0, -4.0, 0.0, 0.0, 20.0),
        Free::all(2.0 * ap),
        0.0,
    ));
    s.pivot_shift_no_acl[0].flags.push(Flag::Dislocated);
    s
}

/// A source of Specimen 1.
fn source(name: &str, ap: f64) -> Source {
    source_of("S192803", name, ap)
}

fn find<'a>(all: &'a [Difference], protocol: &str, quantity: &str) -> &'a Difference {
    all.iter().find(|d| d.protocol == protocol && d.quantity == quantity).unwrap()
}

#[test]
fn differences_of_known_sources() {
    let all = compare(&[source("kla", 0.0), source("rks", 2.0)], &[]);
    let ap = find(&all, "ap_laxity", "anterior_ap");
    assert!((ap.rmsd - 2.0).abs() < 1e-12 && ap.count == 3 && ap.published == Some(2.38));
    assert!((find(&all, "ap_laxity", "ligament_forces").rmsd - (20.0_f64.powi(2) / 9.0).sqrt()).abs() < 1e-12);
    assert!((find(&all, "passive_flexion", "ap").rmsd - 2.0).abs() < 1e-12);
    assert_eq!(find(&all, "passive_flexion", "ie").rmsd, 0.0);
    assert_eq!(find(&all, "pivot_shift", "ie").published, Some(1.6999999999999993));
    assert!(find(&all, "pivot_shift_no_acl", "ie").note.contains("dislocated"));
    assert!((find(&all, "parameters", "stiffness").rmsd - 100.0 * 2.0 / 82.0).abs() < 1e-9);
    let others = [source_of("X", "kla", 0.0), source_of("X", "rks", 2.0)];
    assert!(compare(&others, &[]).iter().all(|d| d.published.is_none()));
}

#[test]
fn measured_passive_flexion_is_compared_where_it_overlaps() {
    let poses =
        [10.0, 20.0].map(|fe_deg| PoseSpec { fe_deg, ie_deg: 0.2 * fe_deg + 1.0, ..PoseSpec::default() }).to_vec();
    let measured = [Passive { name: "rks".into(), poses }];
    let all = compare(&[source("kla", 0.0)], &measured);
    let ie = all.iter().find(|d| d.quantity == "ie" && d.b == "measured rks").unwrap();
    assert!((ie.rmsd - 1.0).abs() < 1e-12 && ie.count == 3, "{ie:?}");
}

#[test]
fn tables_have_a_row_a_test_and_the_papers_values_beside() {
    let both = |id: &str| [source_of(id, "kla", 0.0), source_of(id, "rks", 2.0)];
    let of = |id: &str| tables::tables(&both(id));
    let t = of("S193761");
    assert_eq!(t.iter().map(|t| t.rows.len()).collect::<Vec<_>>(), [26, 24, 8, 8]);
    assert_eq!(of("own").iter().map(|t| t.rows.len()).collect::<Vec<_>>(), [26, 12, 4, 4]);
    assert!(t[0].csv().starts_with("design_variable,bundle,kind,kla,kla_published,rks,rks_published\nX1,ACL_AM,reference_strain,1.100,1.160,1.120,1.140\n"));
    assert!(t[1].csv().contains("anterior,30,kla,computed,133.0,-,-"), "{}", t[1].csv());
    assert!(t[1].csv().contains("anterior,30,rks,published,246.9,-,60.1"));
    let page = tables::page("S193761", &t, &tables::differences(&compare(&both("S193761"), &[])));
    assert!(page.contains("Specimen 2") && page.matches("\n## ").count() == 5);
    assert!(page.lines().filter(|l| l.starts_with('|')).all(|l| l.ends_with('|')));
}

#[test]
fn figures_are_drawn_with_every_source() {
    let sources = [source("kla", 0.0), source("rks", 2.0)];
    let measured = [Passive { name: "rks".into(), poses: vec![PoseSpec::default(); 3] }];
    let trials = trials();
    let ct = PoseSpec { si_mm: -20.0, ..PoseSpec::default() };
    let mut spread = trials.clone();
    spread.iter_mut().enumerate().for_each(|(i, t)| t.measured = Free::all(Some(i as f64)));
    let cost = calibration::cost::CostFunction::new(&spread, &ct, &calibration::cost::CostOptions::default()).unwrap();
    let predicted = vec![Some(Free::all(1.0)); trials.len()];
    for (svg, words) in [
        (figures::figure5(&[("kla".into(), trials)]), "AP load"),
        (figures::figure6("kla", &cost, &predicted), "anterior 30 deg, 5 trials: AP (100)"),
        (figures::figure7(&sources), "rks posterior"),
        (figures::figure8(&sources, &measured), "rks experiment"),
    ] {
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>") && svg.contains(words), "{words}");
    }
    assert!(figures::figure8(&[], &[]).contains("</svg>"));
}

#[test]
fn knees_are_compared_under_their_own_names_with_mean_differences_of_parameters() {
    let knee = |id: &str, ap: f64| [source_of(id, "kla", ap), source_of(id, "rks", ap + 2.0)];
    let sources = [knee("S192803", 0.0), knee("S193761", 4.0)].concat();
    let poses = vec![PoseSpec { fe_deg: 10.0, ..PoseSpec::default() }];
    let measured = [Passive { name: "S193761-rks".into(), poses }];
    let all = compare(&sources, &measured);
    let ap = |a: &str, b: &str| {
        all.iter().find(|d| (d.a.as_str(), d.b.as_str(), d.quantity.as_str()) == (a, b, "anterior_ap")).unwrap()
    };
    assert_eq!(ap("S192803-kla", "S192803-rks").published, Some(2.38));
    assert_eq!((ap("S192803-kla", "S193761-rks").published, ap("S192803-kla", "S193761-rks").rmsd), (None, 6.0));
    let against: Vec<&str> = all.iter().filter(|d| d.b.starts_with("measured")).map(|d| d.a.as_str()).collect();
    assert!(!against.is_empty() && against.iter().all(|a| a.starts_with("S193761-")), "{against:?}");
    let mean = all.iter().find(|d| d.b == "knees, same data" && d.quantity == "stiffness").unwrap();
    assert_eq!(mean.published, Some(55.8));
    assert!((mean.rmsd - 50.0 * (4.0 / 84.0 + 4.0 / 86.0)).abs() < 1e-9);
    assert!(tables::tables(&sources)[1].csv().contains("anterior,30,S193761-kla,published,248.5"));
}

#[test]
fn the_cost_table_adds_up_to_the_cost() {
    let ct = PoseSpec { si_mm: -20.0, ..PoseSpec::default() };
    let mut given = trials();
    given.iter_mut().enumerate().for_each(|(i, t)| t.measured = Free::all(Some(i as f64)));
    let cost = calibration::cost::CostFunction::new(&given, &ct, &calibration::cost::CostOptions::default()).unwrap();
    let predicted = vec![Some(Free([1.0, 2.0, 0.0, 3.0, -20.0])); given.len()];
    let table = tables::cost_table(&cost, &predicted);
    let column = |k: usize| table.rows.iter().map(|r| r[k].parse::<f64>().unwrap()).sum::<f64>();
    assert!((column(8) - cost.cost(&predicted).sum).abs() < 0.01 * table.rows.len() as f64);
    assert!((column(9) - 100.0).abs() < 0.1 * table.rows.len() as f64);
}

#[test]
fn a_row_without_equilibrium_has_no_number_in_any_table_and_they_say_so() {
    let lose = |r: &mut TrialResult| *r = TrialResult::without_equilibrium(&r.trial, 3);
    let mut lost = source("rks", 2.0);
    let is_full = |r: &&mut TrialResult| r.trial.fe_deg == 60.0 && r.trial.load[AP] > 100.0;
    lost.ap_laxity.iter_mut().filter(is_full).take(1).for_each(lose);
    assert!(lost.ap_end(Test::Anterior, 60.0).is_some(), "the other row of the same load has an answer");
    lost.ap_laxity.iter_mut().filter(is_full).for_each(lose);
    lose(&mut lost.passive_flexion[3]);
    lost.pivot_shift.iter_mut().for_each(lose);
    assert!(lost.ap_end(Test::Anterior, 60.0).is_none() && lost.pivot_end(true).is_none());
    assert!(lost.ap_end(Test::Posterior, 60.0).is_some() && lost.pivot_end(false).is_some());
    let poses = [0.0, 90.0].map(|fe_deg| PoseSpec { fe_deg, ..PoseSpec::default() }).to_vec();
    let measured = [Passive { name: "rks".into(), poses }];
    let sources = [lost, source("kla", 0.0)];
    let all = compare(&sources, &measured);
    assert!(all.iter().all(|d| d.rmsd.is_finite() && d.protocol != "pivot_shift"));
    assert_eq!(find(&all, "ap_laxity", "anterior_ap").count, 2);
    assert_eq!(all.iter().find(|d| d.protocol == "passive_flexion" && d.quantity == "ap").unwrap().count, 18);
    let tables = tables::tables(&sources);
    assert!(tables[1].csv().contains("anterior,60,rks,computed,no equilibrium,"), "{}", tables[1].csv());
    assert!(tables[2].csv().contains("intact,rks,computed,,30.0,no equilibrium,"), "{}", tables[2].csv());
    assert!(tables.iter().all(|t| !t.csv().contains("NaN")));
    assert_eq!(
        lost_rows("rks", "pivot_shift", &sources[0].pivot_shift).unwrap().count,
        Some(1),
        "{:?}",
        sources[0].pivot_shift
    );
    assert!(lost_rows("kla", "pivot_shift", &sources[1].pivot_shift).is_none());
}
