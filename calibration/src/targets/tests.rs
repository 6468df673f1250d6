use super::*;
use sim::coordinate::{AP, Free, IE, VV};
use sim::laxity;

const HEADER: &str = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm";
const CT: PoseSpec = PoseSpec { fe_deg: -6.0, vv_deg: 0.8, ie_deg: 2.0, ml_mm: 0.7, ap_mm: 0.3, si_mm: -22.0 };

fn read(rows: &str) -> Vec<LaxityTrial> {
    laxity::read(format!("{HEADER}\n{rows}\n").as_bytes()).unwrap().trials
}

fn run(rows: &str) -> Result<Targets, String> {
    targets(&read(rows), &CT, &CostOptions::default(), &TargetOptions::default()).map_err(|e| e.to_string())
}

const GOOD: &str = "a0,anterior,30,0,0,0,0,20,30,1,2,0,1,-20\na1,anterior,30,0,0,0,133,20,30,1,-2,0,6,-20";

#[test]
fn good_rows_pass_and_keep_their_numbers() {
    let t = run(GOOD).unwrap();
    assert_eq!((t.trials.iter().map(row).collect::<Vec<_>>(), t.warnings.len()), (vec![2, 3], 0));
    assert_eq!(t.noise(&t.trials[0]).0, [0.5, 0.5, 0.4, 0.4, 0.4]);
}

#[test]
fn one_trial_is_refused() {
    let error = run("a0,anterior,30,0,0,0,0,20,30,1,2,0,1,-20").unwrap_err();
    assert!(error.contains("1 usable trial [row 2 (a0)]"), "{error}");
}

#[test]
fn contradicting_rows_are_refused_scatter_is_not() {
    let error = run(&format!("{GOOD}\nb1,anterior,30,0,0,0,132,20,30.5,1,-2,0,-9,-20")).unwrap_err();
    assert!(error.contains("rows 3 and 4 (a1, b1)") && error.contains("ap_mm"), "{error}");
    let scatter = run(&format!("{GOOD}\nb1,anterior,30,0,0,0,132,20,30.5,1,-2,0,4.5,-20")).unwrap();
    assert!(scatter.warnings.is_empty(), "{:?}", scatter.warnings);
    let doubt = run(&format!("{GOOD}\nb1,anterior,30,0,0,0,132,20,30.5,1,-2,0,2,-20")).unwrap();
    assert!(doubt.warnings[0].contains("rows 3 and 4"), "{:?}", doubt.warnings);
    // another load, branch or flexion is no repeat
    assert!(run(&format!("{GOOD}\nb1,anterior,30,0,0,0,-133,20,30,1,-2,0,-9,-20")).is_ok());
    assert!(run(&format!("{GOOD}\nb1,anterior,30,0,0,0,133,20,40,1,-2,0,-9,-20")).is_ok());
}

#[test]
fn other_units_are_refused() {
    let radians = "i,internal,30,0,-4,0,0,20,30,0.01,-0.3,0,1,-20\ne,external,30,0,4,0,0,20,30,0.02,0.25,0,1,-20";
    assert!(run(radians).unwrap_err().contains("ie_deg stays within 0.7 deg"));
    let metres = GOOD.replace(",1,-20", ",0.001,-0.020").replace(",6,-20", ",0.006,-0.020");
    let error = run(&metres).unwrap_err();
    assert!(error.contains("metres") && error.contains("si_mm"), "{error}");
    let centimetres = GOOD.replace(",-20\n", ",-2.0\n").replace("6,-20", "6,-2.1");
    assert!(run(&centimetres).unwrap_err().contains("centimetres"));
}

#[test]
fn flexion_beyond_the_model_is_refused_by_row() {
    let error = run(&format!("{GOOD}\nz,anterior,150,0,0,0,133,20,151,1,-2,0,6,-20")).unwrap_err();
    assert!(error.contains("row 4 (z): fe_deg 151 is beyond the model"), "{error}");
}

#[test]
fn missing_coordinates_are_warned_of_by_row() {
    let t = run(&format!("{GOOD}\nx,anterior,30,0,0,0,90,20,30,1,,0,4,-20\ny,anterior,30,0,0,0,50,20,30,1,,0,,-20"))
        .unwrap();
    assert_eq!(t.trials.iter().map(row).collect::<Vec<_>>(), [2, 3, 4]);
    assert!(t.warnings.iter().any(|w| w.contains("row 4 (x): ie_deg not measured")), "{:?}", t.warnings);
    assert!(t.warnings.iter().any(|w| w.contains("row 5 (y): left out")), "{:?}", t.warnings);
}

#[test]
fn a_wrong_sign_is_warned_of() {
    let rows = "i0,internal,30,0,0,0,0,20,30,1,2,0,1,-20\ni1,internal,30,0,-6,0,0,20,30,1,14,0,1,-20";
    assert!(run(rows).unwrap().warnings[0].contains("is a sign wrong?"));
}

#[test]
fn the_sets_take_what_the_paper_took() {
    let mut rows = "n,neutral,0,0,0,0,0,20,0,0.1,0.2,0,0.3,-22".to_owned();
    let tests = [
        ("anterior", AP, 190.0),
        ("posterior", AP, -190.0),
        ("internal", IE, -7.0),
        ("external", IE, 7.0),
        ("varus", VV, -9.0),
    ];
    for fe in [0, 30, 60, 90] {
        for (test, coordinate, full) in tests.iter().chain(&[("valgus", VV, 9.0)]) {
            for share in [0.0, 0.5, 1.0] {
                let mut load = Free::all(0.0);
                load[*coordinate] = share * full;
                let loads = load.map(|l| l.to_string()).0.join(",");
                let (vv, ie, ap) = (load[VV], load[IE], load[AP]);
                rows += &format!("\n{test}{fe}_{share},{test},{fe},{loads},{fe},{vv},{},0,{},-20", 2.0 * ie, ap / 30.0);
            }
        }
    }
    let trials = read(&rows);
    let count = |set| {
        let options = TargetOptions { set, ..TargetOptions::default() };
        targets(&trials, &CT, &CostOptions::default(), &options).unwrap().trials.len()
    };
    assert_eq!(count(TargetSet::Kla), 3 * 2 * 3 + 1);
    assert_eq!(count(TargetSet::Rks), 6 * 4 + 1);
    assert_eq!(count(TargetSet::All), 6 * 4 * 3 + 1);
}
