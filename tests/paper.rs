//! The paper's tables from its own parameters, and the page that shows them.

#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "tests")]

use crate::common::{build_model, json, shared, text};
use genu::{paper, stale};
use needs_shared::needs_shared;
use std::path::Path;
use tempfile::TempDir;
use validation::paper::{Scores, poses, scores};
use validation::validate::compare;

/// Two numbers are fitted to Table 5 (the plateaus' heights); the rest is told.
#[needs_shared]
fn tables_5_and_section_3_follow_from_table_4() {
    let Some(data) = shared("tables_5_and_section_3_follow", "published/S192803") else { return };
    let data = data.parent().unwrap().parent().unwrap().to_path_buf();
    let knee = paper::knee(&data, paper::FITTED_MM, 0.0).unwrap();
    let Scores { table5_n, directions, .. } = scores(&knee.sources);
    for (source, miss) in &table5_n {
        assert!(*miss <= 10.0, "Table 5, {source}: {miss:.1} N");
    }
    assert!(directions.1 == 10 && directions.0 >= 7, "{directions:?}");
    let all = compare(&knee.sources, &[]);
    let near = |protocol: &str, quantity: &str, most: f64| {
        let d = all.iter().find(|d| d.protocol == protocol && d.quantity == quantity).unwrap();
        let off = (d.rmsd - d.published.unwrap()).abs();
        assert!(off <= most, "{protocol} {quantity}: {:.2}, published {:.2}", d.rmsd, d.published.unwrap());
    };
    near("ap_laxity", "anterior_ap", 0.2);
    near("ap_laxity", "posterior_ap", 0.2);
    near("ap_laxity", "ligament_forces", 3.0);
    near("passive_flexion", "ie", 0.4);
    near("passive_flexion", "vv", 0.4);
}

/// Printed poses are rounded to 0.1 mm and deg, which moves a fibre of 120 N/mm by up to 6 N.
#[needs_shared]
fn table_7_follows_from_the_poses_of_table_6_without_a_fitted_number() {
    let Some(data) = shared("table_7_follows", "published/S192803") else { return };
    let data = data.parent().unwrap().parent().unwrap().to_path_buf();
    let knee = paper::knee(&data, [0.0, 0.0], 0.0).unwrap();
    let [printed, exact] = paper::poses(&data, &knee).unwrap();
    let (of_log, of_table) = (poses(&exact).1, poses(&printed).1);
    assert!(exact.len() == 4 && of_log < 2.0, "{of_log} N");
    // Table 4's strains have two decimals: 0.005 of 46 mm at 120 N/mm is 28 N
    assert!(of_table < 10.0, "{of_table} N");
}

#[needs_shared]
fn the_page_says_what_the_program_says() {
    let Some(data) = shared("the_page_says", "published/S192803") else { return };
    let data = data.parent().unwrap().parent().unwrap().to_path_buf();
    let page = text(&Path::new(env!("CARGO_MANIFEST_DIR")).join(paper::PAGE));
    let written = page.split_once(paper::BUILDS).map_or(page.as_str(), |(first, _)| first);
    let told = stale::differences(written, &paper::published_part(&data).unwrap().0);
    assert!(told.is_empty(), "write it anew with `cargo run --release --example paper`:\n{}", told.join("\n"));
}

/// docs/decisions/2026-11-pages-in-step.md: what takes minutes to write is held to what it was made with.
#[test]
fn the_page_of_results_was_made_with_these_options() {
    let page = text(&Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/results.md"));
    let told = page.lines().find_map(|l| l.strip_prefix(genu::options::MADE_WITH)).expect("the page tells a digest");
    let now = genu::options::digest().unwrap();
    assert_eq!(told, now, "docs/results.md is old: `cargo run --release --example results`");
}

#[needs_shared]
fn another_variant_is_imported_and_told() {
    let Some(deck) = shared("another_variant", "published/S192803/deck/S192803_MAIN_LAXITY_Anterior_30deg_0.inp")
    else {
        return;
    };
    let table = deck.parent().unwrap().parent().unwrap().join("ligament_fibres.csv");
    let out = TempDir::new().unwrap();
    let import = |more: &[&str]| {
        let mut command = build_model();
        command.arg("import-abaqus").arg(&deck).arg("--out").arg(out.path()).args(more);
        command
    };
    let fibres = ["--fibres", table.to_str().unwrap(), "--variant"];
    import(&[&fibres[..], &["CTS", "--parameters", "RKS", "--lower", "tibia_medial=5.5"]].concat()).assert().success();
    let model = json(&out.path().join("model.json"));
    assert_eq!(model["fibres"].as_array().unwrap().len(), 31);
    let bundle = |name: &str| {
        let all = model["bundles"].as_array().unwrap();
        all.iter().find(|b| b["name"] == name).unwrap().clone()
    };
    assert_eq!(bundle("ALS")["reference_strain"], 0.9952);
    assert!(model["warnings"].to_string().contains("tibia_medial: cartilage lowered by 5.5 mm"));
    let refused = |more: &[&str], why: &str| import(more).assert().failure().stderr(predicates::str::contains(why));
    refused(&[&fibres[..], &["XYZ"]].concat(), "there are: CTS, MRI");
    refused(&["--lower", "patella=1"], "tibia_lateral, tibia_medial");
    refused(&["--lower", "tibia_medial"], "PART=MM was expected");
}
