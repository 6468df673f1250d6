//! What diagnose added to a model, in the predictions of the other verbs.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::shared;
use diagnosis::diagnosis::Value;
use diagnosis::report::carried::carried;
use diagnosis::report::component::Component;
use diagnosis::report::predict::{acting, apply, taken_off};
use needs_shared::needs_shared;
use sim::coordinate::AP;
use sim::laxity::{LaxityTrial, TrialResult};
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

fn deck() -> Option<(ModelSpec, sim::Model)> {
    let folder = shared("components", "published/S192803/deck")?;
    #[expect(clippy::disallowed_methods, reason = "published data")]
    let mut read = |name: &str| std::fs::read(folder.join(name)).map_err(|e| e.to_string());
    let deck = decks::import("S192803_MAIN_LAXITY_Anterior_0deg_0.inp", &mut read).unwrap();
    let model = sim::compile(&deck.spec, &deck.meshes).unwrap();
    Some((deck.spec, model))
}

fn component(effect: &str, kept: &str, scope: &str, values: &[(&str, f64)]) -> serde_json::Value {
    let parameters: BTreeMap<String, Value> =
        values.iter().map(|(k, v)| ((*k).to_owned(), Value { value: *v, sd: 1.0, unit: "-".into() })).collect();
    serde_json::to_value(Component {
        schema: "component/1".into(),
        effect: effect.into(),
        variant: None,
        scope: scope.into(),
        kept: kept.into(),
        status: "proposed".into(),
        catalogue: "1".into(),
        log_bayes_factor: 10.0,
        closed: None,
        parameters,
        provenance: None,
    })
    .unwrap()
}

fn trials() -> Vec<LaxityTrial> {
    let text = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n\
        a,anterior,30,0,0,0,100,20,30,0,0,0,9,-21\nb,internal,60,0,-5,0,0,20,60,0,-5,0,14,-18\n";
    sim::laxity::read(text.as_bytes()).unwrap().trials
}

#[needs_shared]
fn an_added_effect_of_no_size_changes_no_bit_and_one_of_some_size_moves_the_knee() {
    let Some((mut spec, model)) = deck() else { return };
    let trials = trials();
    let pose = spec.frames.gs_ct_pose;
    let plain: Vec<TrialResult> = trials
        .iter()
        .map(|t| TrialResult {
            trial: t.clone(),
            pose,
            forces_n: vec![],
            outputs: vec![],
            flags: vec![],
            bands: vec![],
        })
        .collect();
    let zero = [("ap", 0.0), ("ie", 0.0), ("vv", 0.0), ("hardening", 0.0)];
    spec.components = vec![component("capsule_envelope", "specimen", "both", &zero)];
    let mut out = plain.clone();
    apply(&model, &spec, None, &mut out).unwrap();
    assert_eq!(out, plain);

    let some = [("ap", 20.0), ("ie", 0.0), ("vv", 0.0), ("hardening", 0.0)];
    spec.components = vec![component("capsule_envelope", "specimen", "both", &some)];
    apply(&model, &spec, None, &mut out).unwrap();
    // held back against the anterior load
    assert!(out[0].pose.ap_mm < plain[0].pose.ap_mm - 0.2, "{:?}", out[0].pose);
    let targets = taken_off(&model, &spec, Some("kla"), &trials).unwrap();
    let moved = out[0].pose.ap_mm - plain[0].pose.ap_mm;
    assert!((trials[0].measured[AP].unwrap() - targets[0].measured[AP].unwrap() - moved).abs() < 1e-9);
}

#[needs_shared]
fn what_belongs_to_an_apparatus_stays_with_it() {
    let Some((mut spec, model)) = deck() else { return };
    let shift = [("ml_mm", 0.0), ("ap_mm", 2.0), ("si_mm", 0.0)];
    spec.components = vec![component("origin_shift", "apparatus", "kla", &shift)];
    assert!(acting(&spec, None).unwrap().is_empty());
    assert!(acting(&spec, Some("rks")).unwrap().is_empty());
    let pose = spec.frames.gs_ct_pose;
    let mut out: Vec<TrialResult> = trials()
        .into_iter()
        .map(|trial| TrialResult { trial, pose, forces_n: vec![], outputs: vec![], flags: vec![], bands: vec![] })
        .collect();
    apply(&model, &spec, Some("kla"), &mut out).unwrap();
    assert!((out[0].pose.ap_mm - pose.ap_mm - 2.0).abs() < 1e-9, "{:?}", out[0].pose);
}

#[needs_shared]
fn hamstrings_take_load_off_the_acl_and_what_belongs_to_an_apparatus_off_none() {
    let Some((spec, model)) = deck() else { return };
    let with = |effect: &str, kept: &str, values: &[(&str, f64)]| {
        let mut other = spec.clone();
        other.components = vec![component(effect, kept, "both", values)];
        carried([(&model, &spec), (&model, &other)]).unwrap()
    };
    let pulled = with("ham_tone", "session", &[("med_n", 80.0), ("lat_n", 80.0)]);
    let acl: Vec<_> = pulled.iter().filter(|c| c.ligament == "ACL" && c.test.contains("forward")).collect();
    assert_eq!(acl.len(), 3, "{pulled:?}");
    assert!(acl.iter().all(|c| c.with_n < c.without_n - 20.0), "{acl:?}");
    for same in
        [with("load_bias", "apparatus", &[("ap_n", 60.0), ("ie_nm", 0.0)]), carried([(&model, &spec); 2]).unwrap()]
    {
        assert!(same.len() > 4 && same.iter().all(|c| c.with_n == c.without_n), "{same:?}");
    }
}

#[needs_shared]
fn a_ligament_that_is_lost_carries_nothing_under_any_test() {
    let Some((spec, model)) = deck() else { return };
    let acl = |loss: f64| {
        let mut other = spec.clone();
        let mut torn = component("structure_loss", "specimen", "both", &[("loss", loss)]);
        torn["variant"] = "ACL".into();
        other.components = vec![torn];
        let all = carried([(&model, &spec), (&model, &other)]).unwrap();
        all.into_iter().filter(|c| c.ligament == "ACL").collect::<Vec<_>>()
    };
    assert!(acl(1.0).len() > 1 && acl(1.0).iter().all(|c| c.without_n > 20.0 && c.with_n < 1e-6), "{:?}", acl(1.0));
    // half of it carries less than all of it did, and more than nothing
    assert!(acl(0.5).iter().all(|c| c.with_n > 1.0 && c.with_n < c.without_n), "{:?}", acl(0.5));
}
