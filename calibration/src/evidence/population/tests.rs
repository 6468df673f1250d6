//! Linear toys whose joint posterior is known: all knees and their mean as one normal distribution.

use super::*;
use inference::random::{normal, normals, stream};

/// What the others say of each of the first `knees` knees in turn, then, last, all of them of a knee that is not among them.
fn averaged(groups: &[Group], knees: usize) -> Vec<Averaged> {
    let whom: Vec<Option<usize>> = (0..knees).map(Some).chain([None]).collect();
    told_to(groups, &whom)
}

const SORTS: [Sort; 2] = [Sort::Strain, Sort::Stiffness];

/// Messages of knees that measured one combination of two numbers each, better or worse.
fn made(knees: usize, seed: u64) -> Group {
    let message = |k: usize| {
        let mut random = stream(seed, k as u64);
        let along = normals(&mut random, 2).normalize();
        let (precision, reading) = (4.0 * normal(&mut random).powi(2), 0.8 + normal(&mut random));
        Message { precision: &along * along.transpose() * precision, shift: along * precision * reading }
    };
    Group { sorts: SORTS.to_vec(), messages: (0..knees).map(message).collect() }
}

fn shares(strain: f64, stiffness: f64) -> Shares {
    let mut out = [0.0; Sort::ALL.len()];
    (out[Sort::Strain.place()], out[Sort::Stiffness.place()]) = (strain, stiffness);
    out
}

/// Mean and covariance of all: the shared mean, then every knee. Its precision is written down term by term.
fn jointly(group: &Group, shares: &Shares) -> (DVector<f64>, DMatrix<f64>) {
    let n = group.sorts.len();
    let all = n * (group.messages.len() + 1);
    let (mut precision, mut shift) = (DMatrix::zeros(all, all), DVector::zeros(all));
    for k in 0..n {
        let share = shares[group.sorts[k].place()];
        precision[(k, k)] += 1.0 / share;
        for knee in 1..=group.messages.len() {
            let own = 1.0 / (1.0 - share);
            let at = n * knee + k;
            precision[(k, k)] += own;
            precision[(at, at)] += own;
            precision[(k, at)] -= own;
            precision[(at, k)] -= own;
        }
    }
    for (knee, m) in group.messages.iter().enumerate() {
        let at = n * (knee + 1);
        let mut block = precision.view_mut((at, at), (n, n));
        block += &m.precision;
        shift.rows_mut(at, n).copy_from(&m.shift);
    }
    let covariance = precision.try_inverse().unwrap();
    (&covariance * shift, covariance)
}

/// What the others say of a knee, times what its own data say.
fn with_its_own(told: &Told, own: &Message) -> (DVector<f64>, DMatrix<f64>) {
    let prior = told.covariance.clone().try_inverse().unwrap();
    let covariance = (&prior + &own.precision).try_inverse().unwrap();
    (&covariance * (prior * &told.mean + &own.shift), covariance)
}

#[test]
fn what_the_others_say_times_its_own_data_is_a_knees_part_of_the_joint_posterior() {
    for (seed, knees) in [(1, 2), (2, 3), (3, 9), (4, 30)] {
        for shares in [shares(0.2, 0.9), shares(0.5, 0.5), shares(0.95, 0.2)] {
            let group = made(knees, seed);
            let (mean, covariance) = jointly(&group, &shares);
            for (k, own) in group.messages.iter().enumerate() {
                let at = 2 * (k + 1);
                let (m, c) = with_its_own(&group.others(Some(k), &shares), own);
                assert!((m - mean.rows(at, 2)).amax() < 1e-9, "{knees} knees, knee {k}");
                assert!((c - covariance.view((at, at), (2, 2))).amax() < 1e-9, "{knees} knees, knee {k}");
            }
            // one more knee, not measured: the mean's posterior and a deviation
            let more = Group { messages: [&group.messages[..], &[Message::nothing(2)]].concat(), ..group.clone() };
            let (mean, covariance) = jointly(&more, &shares);
            let (told, at) = (group.others(None, &shares), 2 * (knees + 1));
            assert!((told.mean - mean.rows(at, 2)).amax() < 1e-9);
            assert!((told.covariance - covariance.view((at, at), (2, 2))).amax() < 1e-9);
        }
    }
}

#[test]
fn evidence_of_a_share_is_that_of_all_readings_together() {
    // of readings y = z + noise the evidence is a normal density: its covariance has the share between knees and one on the diagonal
    let (knees, noise) = (5, 0.4);
    let readings = normals(&mut stream(11, 0), knees) + DVector::from_element(knees, 0.7);
    let one = |y: &f64| Message {
        precision: DMatrix::from_element(1, 1, 1.0 / noise),
        shift: DVector::from_element(1, y / noise),
    };
    let group = Group { sorts: vec![Sort::Strain], messages: readings.iter().map(one).collect() };
    let told = |share: f64| {
        let shares = shares(share, 0.0);
        group.told(&group.of_mean(&shares), None, &shares).1
    };
    let exact = |share: f64| {
        let covariance = DMatrix::from_fn(knees, knees, |i, k| if i == k { 1.0 + noise } else { share });
        let inverse = covariance.clone().try_inverse().unwrap();
        -0.5 * (readings.dot(&(inverse * &readings)) + covariance.determinant().ln())
    };
    for share in SHARES {
        let (a, b) = (told(share) - told(0.0), exact(share) - exact(0.0));
        assert!((a - b).abs() < 1e-9, "{share}: {a} {b}");
    }
}

#[test]
fn one_knee_alone_keeps_its_prior_and_its_own_data_are_not_told_to_it() {
    let alone = averaged(&[made(1, 5)], 1);
    assert!(alone[0].groups[0].iter().all(|[mean, sd]| *mean == 0.0 && (sd - 1.0).abs() < 1e-12), "{alone:?}");
    let group = made(6, 5);
    let before = averaged(std::slice::from_ref(&group), 6);
    let mut other = group.clone();
    other.messages[2] = Message { precision: DMatrix::identity(2, 2) * 50.0, shift: DVector::from_element(2, -80.0) };
    let after = averaged(&[other], 6);
    assert_eq!(before[2], after[2], "its own data, told back to it");
    assert!((0..6).filter(|k| *k != 2).all(|k| before[k] != after[k]), "and to the others they are");
}

#[test]
fn the_order_of_knees_changes_nothing() {
    let (group, turned) = (made(7, 6), 3);
    let mut other = group.clone();
    other.messages.rotate_left(turned);
    let (here, there) = (averaged(&[group], 7), averaged(&[other], 7));
    for k in 0..7 {
        let same = &there[(k + 7 - turned) % 7];
        for (a, b) in here[k].groups[0].iter().flatten().zip(same.groups[0].iter().flatten()) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }
}

#[test]
fn numbers_that_no_knee_informs_keep_their_prior() {
    let only_first = |k: usize| {
        let reading = 1.0 + 0.1 * k as f64;
        Message {
            precision: DMatrix::from_diagonal(&DVector::from_vec(vec![5.0, 0.0])),
            shift: DVector::from_vec(vec![5.0 * reading, 0.0]),
        }
    };
    let group = Group { sorts: SORTS.to_vec(), messages: (0..8).map(only_first).collect() };
    for told in averaged(&[group], 8) {
        let [[mean, sd], [open, wide]] = [told.groups[0][0], told.groups[0][1]];
        assert!(mean > 0.3 && sd < 0.9, "{mean} {sd}");
        assert!(open == 0.0 && (wide - 1.0).abs() < 1e-12, "{open} {wide}");
    }
}

/// Knees whose numbers are drawn with this share in common, each number measured to this standard deviation.
fn population(knees: usize, numbers: usize, share: f64, sd: f64, seed: u64) -> Vec<Group> {
    let of = |g: usize| {
        let mut random = stream(seed, g as u64);
        let mean = share.sqrt() * normal(&mut random);
        let one = |_| {
            let z = mean + (1.0 - share).sqrt() * normal(&mut random) + sd * normal(&mut random);
            Message {
                precision: DMatrix::from_element(1, 1, sd.powi(-2)),
                shift: DVector::from_element(1, z * sd.powi(-2)),
            }
        };
        Group { sorts: vec![Sort::Strain], messages: (0..knees).map(one).collect() }
    };
    (0..numbers).map(of).collect()
}

#[test]
fn how_much_is_shared_is_found_and_nothing_shared_tells_nothing() {
    let found = |share: f64| averaged(&population(30, 14, share, 0.5, 21), 30);
    let strain = Sort::Strain.place();
    let shares = [0.0, 0.6, 0.9].map(|s| found(s)[30].shares[strain]);
    assert!(shares[0] < 0.15 && (0.3..0.85).contains(&shares[1]) && shares[2] > 0.7, "{shares:?}");
    // without anything in common the priors stay as they were, all but a little
    for told in found(0.0) {
        for [mean, sd] in told.groups.iter().flatten() {
            assert!(mean.abs() < 0.3 && (0.9..1.05).contains(sd), "{mean} {sd}");
        }
    }
}
