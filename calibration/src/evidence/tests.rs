use super::*;
use crate::samples;
use crate::shared::SharedPrior;
use crate::unknown::{Unknown, Unknowns};
use inference::parameter::Prior;
use inference::random::{normal, normals, stream};
use notices::Kind;
use sim::spec::ModelSpec;

const STRAIN: Prior = Prior::Truncated { mean: 1.06, sd: 0.05, lower: 0.95, upper: 1.25 };
const STIFFNESS: Prior = Prior::Uniform { lower: 50.0, upper: 150.0 };

fn parameter(name: &str, quantity: Quantity, prior: Prior) -> Parameter<Quantity> {
    Parameter { name: name.into(), quantity, prior }
}

/// Two bundles of one ligament, a stiffness of another, contact, and a turn of a frame.
fn parameters() -> Vec<Parameter<Quantity>> {
    vec![
        parameter("ACL_AM.reference_strain", Quantity::ReferenceStrain(vec![0]), STRAIN),
        parameter("femur.medial.turn_deg", Quantity::Frame(None, 0), Prior::Normal { mean: 0.0, sd: 2.0 }),
        parameter("ACL_PL.reference_strain", Quantity::ReferenceStrain(vec![1]), STRAIN),
        parameter("LCL.stiffness_n_per_mm", Quantity::Stiffness(vec![2]), STIFFNESS),
        parameter("contact.scale", Quantity::ContactScale, Prior::LogNormal { median: 1.0, log_sd: 0.3 }),
    ]
}

/// Samples of standard normal numbers.
fn before(seed: u64) -> Vec<DVector<f64>> {
    (0..200).map(|s| normals(&mut stream(seed, s), 5)).collect()
}

/// The same where all but the fourth were measured: near 1, to 0.3. The fourth is as it was.
fn after(seed: u64) -> Vec<DVector<f64>> {
    let one = |(z, old): (DVector<f64>, DVector<f64>)| {
        DVector::from_fn(5, |k, _| if k == 3 { old[k] } else { 1.0 + 0.3 * z[k] })
    };
    before(seed).into_iter().zip(before(seed + 1000)).map(one).collect()
}

fn knee(name: &str, seed: u64) -> Evidence {
    Evidence::between(name.into(), &parameters(), (&after(seed), &before(seed + 1000)))
}

fn line<'a>(of: &'a Shared, name: &str) -> Option<&'a SharedNumber> {
    of.numbers.iter().find(|n| n.name == name)
}

#[test]
fn knees_tell_each_other_what_was_measured_and_no_more() {
    let all: Vec<Evidence> = [1, 2, 3, 4, 5].map(|k| knee(&format!("K{k} left"), k)).into();
    assert!(all.iter().all(|e| e.informed() == 3 && e.numbers.len() == 4), "{:?}", all[0].measured);
    let found = priors(&all);
    assert_eq!(found.priors.len(), 6);
    for (k, prior) in found.priors.iter().enumerate() {
        for name in ["ACL_AM.reference_strain", "ACL_PL.reference_strain", "contact.scale"] {
            let n = line(prior, name).unwrap();
            assert!((0.2..1.3).contains(&n.mean) && n.sd < 0.95, "{n:?}");
            assert!(n.after[1] > n.before[1] && n.after[2] - n.after[0] < n.before[2] - n.before[0], "{n:?}");
        }
        assert!(line(prior, "LCL.stiffness_n_per_mm").is_none() && line(prior, "femur.medial.turn_deg").is_none());
        assert_eq!(prior.knee, all.get(k).map(|e| e.knee.clone()));
        let others = if k < 5 { 4 } else { 5 };
        assert!(prior.from.len() == others && !prior.from.contains(&format!("K{} left", k + 1)));
        assert_eq!(prior.clone().checked().as_ref(), Ok(prior), "what is written is read");
    }
    let informed: Vec<usize> = found.informed.iter().map(|of| of.iter().map(|i| i.1).sum()).collect();
    assert_eq!(informed, [12, 12, 12, 12, 12, 15], "a knee's own data do not inform it: {:?}", found.informed);
    // one knee alone has nothing told, and neither has a pair of which the other measured nothing
    assert!(priors(&all[..1]).priors[0].numbers.is_empty());
    let open = Evidence::between("open left".into(), &parameters(), (&before(7), &before(7)));
    let pair = priors(&[all[0].clone(), open]);
    assert!(pair.priors[0].numbers.is_empty() && pair.priors[1].numbers.len() == 3, "{:?}", pair.priors[0]);
}

/// A knee whose data are unlike those of the others: nothing was measured, or the same lies elsewhere and is better known.
fn unlike(name: &str, is_open: bool, seed: u64) -> Evidence {
    let elsewhere = |z: DVector<f64>| z.map(|x| 0.1 * x - 2.0);
    let after: Vec<DVector<f64>> = match is_open {
        true => before(seed),
        false => before(seed).into_iter().map(elsewhere).collect(),
    };
    Evidence::between(name.into(), &parameters(), (&after, &before(seed + 1000)))
}

#[test]
fn what_a_knee_is_told_does_not_depend_on_its_own_data() {
    // one sender, other receivers
    let sender = knee("S left", 1);
    let receivers = [knee("R left", 2), unlike("R left", true, 3), unlike("R left", false, 4)];
    let told = |receiver: &Evidence| priors(&[receiver.clone(), sender.clone()]);
    let first = told(&receivers[0]);
    assert_eq!(
        first.priors[0].numbers.len(),
        sender.informed(),
        "and it is told all that its one other says by itself"
    );
    for receiver in &receivers[1..] {
        let other = told(receiver);
        assert_eq!(other.priors[0].numbers, first.priors[0].numbers);
        let turned = priors(&[sender.clone(), receiver.clone()]);
        assert_eq!(turned.priors[1].numbers, first.priors[0].numbers, "in the other order");
    }
    // many senders
    let all: Vec<Evidence> = [1, 2, 3, 4].map(|k| knee(&format!("K{k} left"), k)).into();
    let usual = priors(&all);
    for k in 0..all.len() {
        for is_open in [true, false] {
            let mut others = all.clone();
            others[k] = unlike(&all[k].knee, is_open, 70);
            let found = priors(&others);
            assert_eq!(found.priors[k], usual.priors[k], "knee {k}");
            assert_eq!((&found.shares[k], &found.informed[k]), (&usual.shares[k], &usual.informed[k]), "knee {k}");
            let changed = (0..=all.len()).filter(|i| found.priors[*i] != usual.priors[*i]).count();
            assert_eq!(changed, all.len(), "all others are told something else");
        }
    }
}

#[test]
fn every_line_is_informed_by_some_of_the_others_and_no_more_than_there_are() {
    let mut all: Vec<Evidence> = [1, 2, 3].map(|k| knee(&format!("K{k} left"), k)).into();
    all.push(unlike("open left", true, 9));
    for count in 2..=all.len() {
        let found = priors(&all[..count]);
        for (prior, informed) in found.priors.iter().zip(&found.informed) {
            for (name, knees) in informed {
                assert_eq!(*knees > 0, line(prior, name).is_some(), "{name}: {knees} of {:?}", prior.from);
                assert!(*knees <= prior.from.len(), "{name}: {knees} of {:?}", prior.from);
            }
        }
    }
}

/// Squares of how far two numbers of a knee that is not among `knees` lie from what these say, in its standard deviations, in the mean over such
/// knees. The numbers are of two ligaments, the data show their sum alone, and half of the variance is in common.
fn squares_where_a_sum_is_measured(knees: usize, seed: u64) -> f64 {
    let prior = Prior::Normal { mean: 0.0, sd: 1.0 };
    let names = ["ACL_AM.reference_strain", "LCL.reference_strain"];
    let parameters = names.map(|name| parameter(name, Quantity::ReferenceStrain(vec![0]), prior));
    let (share, precision) = (0.5_f64, 10.0_f64);
    let (left, along) = (1.0 / (1.0 + precision), DVector::from_element(2, 0.5_f64.sqrt()));
    let mut random = stream(seed, 0);
    let mean = normals(&mut random, 2) * share.sqrt();
    let mut one = |k: usize| {
        let z = &mean + normals(&mut random, 2) * (1.0 - share).sqrt();
        let reading = along.dot(&z) + normal(&mut random) / precision.sqrt();
        let before: Vec<DVector<f64>> = (0..48).map(|_| normals(&mut random, 2)).collect();
        let mut measured = || {
            let z = normals(&mut random, 2);
            // less of it along the sum, about what was read
            &z + &along * ((left.sqrt() - 1.0) * along.dot(&z) + reading * precision * left)
        };
        let after: Vec<DVector<f64>> = (0..48).map(|_| measured()).collect();
        Evidence::between(format!("K{k} left"), &parameters, (&after, &before))
    };
    let all: Vec<Evidence> = (0..knees).map(&mut one).collect();
    let told = priors(&all).priors.remove(knees);
    let square = |k: usize| {
        // a number without a line keeps its prior
        let [middle, sd] = line(&told, names[k]).map_or([0.0, 1.0], |n| [n.mean, n.sd]);
        ((mean[k] - middle).powi(2) + 1.0 - share) / (sd * sd)
    };
    square(0) + square(1)
}

#[test]
fn many_knees_that_measured_a_sum_of_two_ligaments_are_no_surer_than_they_are_near() {
    let seeds = 20;
    for knees in [9, 30] {
        let sum: f64 = (0..seeds).map(|seed| squares_where_a_sum_is_measured(knees, 900 + seed)).sum();
        let off = (sum / (2.0 * seeds as f64)).sqrt();
        // each ligament by itself: 1.4 and 2.4
        assert!((0.8..1.25).contains(&off), "{knees} knees: {off} standard deviations");
    }
}

#[test]
fn a_number_of_another_prior_is_not_shared() {
    let wider = Prior::Truncated { mean: 1.06, sd: 0.08, lower: 0.95, upper: 1.25 };
    let mut other = knee("B left", 2);
    other.numbers.iter_mut().filter(|p| p.prior == STRAIN).for_each(|p| p.prior = wider);
    let found = priors(&[knee("A left", 1), other]);
    let names: Vec<&str> = found.priors[0].numbers.iter().map(|n| n.name.as_str()).collect();
    assert_eq!(names, ["contact.scale"]);
}

#[test]
fn a_shared_prior_stands_in_place_of_the_same_prior_alone_and_what_is_not_used_is_told() {
    let found = priors(&[knee("A left", 1), knee("B left", 2)]);
    let shared = &found.priors[0];
    let own = parameters();
    let mut now = own.clone();
    shared.applied(&mut now);
    for (p, q) in own.iter().zip(&now) {
        let told = line(shared, &p.name);
        assert_eq!(p.prior != q.prior, told.is_some(), "{}", p.name);
        if let Some(n) = told {
            let off = (q.prior.at(0.0).0 - n.after[1]).abs();
            assert!(off < 1e-9 * n.after[1].abs(), "{}: {off}", p.name);
        }
    }
    assert!(shared.unused(&own).is_none());
    // a knee without contact to infer, with another prior of one bundle
    let mut lacking = own.clone();
    lacking.retain(|p| p.quantity != Quantity::ContactScale);
    lacking[0].prior = Prior::Uniform { lower: 0.95, upper: 1.25 };
    let told = shared.unused(&lacking).unwrap();
    assert_eq!(told.kind, Kind::PriorUnused);
    let words = told.to_string();
    assert!(words.contains("contact.scale") && words.contains("ACL_AM") && !words.contains("ACL_PL"), "{words}");
    let mut now = lacking.clone();
    shared.applied(&mut now);
    assert_eq!(now[0].prior, lacking[0].prior);
}

#[test]
fn options_keep_a_shared_prior_as_text_and_a_malformed_one_says_what_is_wrong() {
    let shared = priors(&[knee("A left", 1), knee("B left", 2)]).priors.remove(0);
    for prior in [SharedPrior::File("a/b c.json".into()), SharedPrior::Read(Box::new(shared.clone()))] {
        let options = CalibrateOptions { shared_prior: Some(prior), ..Default::default() };
        let text = toml::to_string(&options).unwrap();
        assert_eq!(toml::from_str::<CalibrateOptions>(&text).unwrap(), options);
        let json = serde_json::to_string(&options).unwrap();
        assert_eq!(serde_json::from_str::<CalibrateOptions>(&json).unwrap(), options);
    }
    assert!(!toml::to_string(&CalibrateOptions::default()).unwrap().contains("shared_prior"));
    let other = |change: &dyn Fn(&mut Shared)| {
        let mut other = shared.clone();
        change(&mut other);
        other.checked().unwrap_err()
    };
    assert!(other(&|s| s.schema = "samples/1".into()).contains(SCHEMA));
    for value in [f64::NAN, 60.0] {
        let told = other(&|s| s.numbers[1].mean = value);
        assert!(told.contains("numbers[1]") && told.contains("mean") && told.contains("expected"), "{told}");
    }
    for value in [0.0, -1.0, f64::NAN, 20.0] {
        let told = other(&|s| s.numbers[0].sd = value);
        assert!(told.contains("numbers[0]") && told.contains("sd is"), "{told}");
    }
    assert!(other(&|s| s.numbers.push(s.numbers[0].clone())).contains("twice"));
}

/// A left knee of one bundle without cartilage, as model.json has it.
const MODEL: &str = r#"
schema = "model/1"
id = "A"
side = "left"
units = { length = "mm", force = "N", pressure = "MPa", angle = "deg" }
bodies = [
  { name = "femur", bone = "femur.ply", cartilage = [], mass_tonne = 2e-4, inertia_tonne_mm2 = 0.5 },
  { name = "tibia", bone = "tibia.ply", cartilage = [], mass_tonne = 2e-4, inertia_tonne_mm2 = 0.5 },
]
contact = { overclosure_mm = [0, 1], pressure_mpa = [0, 5], friction = 0, damping = 0, pairs = [] }
toe_end_multiple = {}
protocols = []
components = []
warnings = []
[frames]
femur = { origin = [0, 0, 0], medial = [-1, 0, 0], anterior = [0, -1, 0], superior = [0, 0, 1] }
tibia = { origin = [0, 0, 0], medial = [-1, 0, 0], anterior = [0, -1, 0], superior = [0, 0, 1] }
gs_ct_pose = { fe_deg = 0, vv_deg = 0, ie_deg = 0, ml_mm = 0, ap_mm = 0, si_mm = 0 }
[[bundles]]
name = "ACL_AM"
reference_strain = 1.0
stiffness_n_per_mm = 100
reference_length_mm = 30
toe_strain = 0.03
law = "smooth"
[[fibres]]
bundle = "ACL_AM"
femur = [0, 0, 30]
tibia = [0, 0, 0]
"#;

/// Samples of that knee, with what was known before or without.
fn kept(with_before: bool) -> Samples {
    let counted_from: ModelSpec = toml::from_str(MODEL).unwrap();
    let values = |z: Vec<DVector<f64>>| -> Vec<f64> { z.iter().map(|z| STRAIN.at(z[0]).0).collect() };
    let unknown = Unknown {
        name: "ACL_AM.reference_strain".into(),
        quantity: Quantity::ReferenceStrain(vec![0]),
        most_probable: 1.1,
        samples: values(after(1)),
        before: if with_before { values(before(1001)) } else { vec![] },
    };
    let of = Unknowns { unknowns: vec![unknown], seed: 0, interval: 0.9, ..Unknowns::default() };
    Samples { schema: samples::SCHEMA.into(), model: String::new(), counted_from, of }
}

#[test]
fn samples_of_a_build_tell_what_its_data_say_and_those_with_other_knees_in_them_are_refused() {
    let options = CalibrateOptions::default();
    let prior = options.priors.reference_strain("ACL_AM").unwrap();
    assert_eq!((prior.mean, prior.sd), (1.06, 0.05), "the numbers above are counted from the usual prior");
    let found = Evidence::of(&kept(true), &options).unwrap();
    assert_eq!((found.knee.as_str(), found.informed()), ("A left", 1));
    let (own, message) = (found.numbers[0].prior, found.measured.as_ref().unwrap().alone());
    assert_eq!(own, STRAIN);
    // near 1, to 0.3: a precision of about 1 / 0.3^2 - 1, told as less, and a mean beyond 1
    let (precision, mean) = (message.precision[(0, 0)], message.shift[0] / message.precision[(0, 0)]);
    assert!((4.0..12.0).contains(&precision) && (0.9..1.4).contains(&mean), "{precision} {mean}");
    let refused =
        |samples: &Samples, options: &CalibrateOptions| Evidence::of(samples, options).unwrap_err().to_string();
    assert!(refused(&kept(false), &options).contains("build it again"));
    let shared = priors(&[found.clone(), knee("B left", 2)]).priors.remove(1);
    let options = CalibrateOptions { shared_prior: Some(SharedPrior::Read(Box::new(shared.clone()))), ..options };
    assert!(refused(&kept(true), &options).contains("calibrate.shared_prior"));
    // a prior that its own data are in, and one for another knee, are none for it
    let spec = kept(true).counted_from;
    let told = |prior: &Shared| prior.is_for(&spec).unwrap_err().to_string();
    assert!(told(&shared).contains("itself"));
    let other = Shared { knee: Some("B left".into()), from: vec!["C left".into()], ..shared.clone() };
    assert!(told(&other).contains("for B left") && told(&other).contains("A left"));
    let own = Shared { knee: Some("A left".into()), ..other.clone() };
    let new = Shared { knee: None, ..other };
    assert!(own.is_for(&spec).is_ok() && new.is_for(&spec).is_ok());
}
