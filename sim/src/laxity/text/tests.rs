//! TDMS files written here by the published layout, and one by another program; a robot's file as laxity.

use super::tdms::{Channel, read};
use crate::coordinate::{AP, IE, SI, VV};
use crate::laxity::{self, Branch, LaxityFormat, LaxityTrial, Test};
use meshes::frame::Side;
use std::collections::BTreeSet;
use std::time::Instant;

const META: u32 = 1 << 1;
const NEW_LIST: u32 = 1 << 2;
const RAW: u32 = 1 << 3;
const INTERLEAVED: u32 = 1 << 5;
const BIG_ENDIAN: u32 = 1 << 6;
/// Types: whole numbers of 16 bits, numbers of 32 and 64 bits, text.
const I16: u32 = 2;
const F32: u32 = 9;
const F64: u32 = 10;
const TEXT: u32 = 0x20;

/// A channel to be written: path, type, unit, values.
type Written = (&'static str, u32, &'static str, Vec<f64>);

/// How a segment describes its data.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Says {
    Everything,
    AsBefore,
    Nothing,
}

#[derive(Clone, Copy, Debug)]
struct Order {
    is_big: bool,
    is_interleaved: bool,
}

impl Order {
    fn bytes<const N: usize>(self, little: [u8; N]) -> Vec<u8> {
        let mut out = little.to_vec();
        if self.is_big {
            out.reverse();
        }
        out
    }

    fn u32(self, x: u32) -> Vec<u8> {
        self.bytes(x.to_le_bytes())
    }

    fn text(self, x: &str) -> Vec<u8> {
        [self.u32(x.len() as u32), x.as_bytes().to_vec()].concat()
    }

    fn value(self, kind: u32, x: f64) -> Vec<u8> {
        match kind {
            I16 => self.bytes((x as i16).to_le_bytes()),
            F32 => self.bytes((x as f32).to_le_bytes()),
            _ => self.bytes(x.to_le_bytes()),
        }
    }

    fn description(self, channels: &[Written], says: Says) -> Vec<u8> {
        let mut out = self.u32(channels.len() as u32);
        for (path, kind, unit, values) in channels {
            out.extend(self.text(path));
            if says == Says::AsBefore {
                out.extend(self.u32(0));
            } else {
                out.extend([20, *kind, 1].map(|x| self.u32(x)).concat());
                out.extend(self.bytes((values.len() as u64).to_le_bytes()));
            }
            out.extend(self.u32(1));
            out.extend([self.text("unit_string"), self.u32(TEXT), self.text(unit)].concat());
        }
        out
    }

    /// A chunk of data.
    fn raw(self, channels: &[Written]) -> Vec<u8> {
        let cell = |c: &Written, row: usize| self.value(c.1, c.3[row]);
        let rows = channels[0].3.len();
        match self.is_interleaved {
            true => (0..rows).flat_map(|row| channels.iter().flat_map(move |c| cell(c, row))).collect(),
            false => channels.iter().flat_map(|c| (0..rows).flat_map(move |row| cell(c, row))).collect(),
        }
    }

    /// A segment, its data in so many chunks alike.
    fn segment(self, channels: &[Written], says: Says, chunks: usize) -> Vec<u8> {
        let meta = if says == Says::Nothing { vec![] } else { self.description(channels, says) };
        let raw = self.raw(channels).repeat(chunks);
        let mut has = RAW;
        for (bit, is_so) in [
            (META, says != Says::Nothing),
            (NEW_LIST, says == Says::Everything),
            (INTERLEAVED, self.is_interleaved),
            (BIG_ENDIAN, self.is_big),
        ] {
            has |= if is_so { bit } else { 0 };
        }
        let offsets = [meta.len() + raw.len(), meta.len()].map(|x| self.bytes((x as u64).to_le_bytes())).concat();
        [b"TDSm".to_vec(), has.to_le_bytes().to_vec(), self.u32(4713), offsets, meta, raw].concat()
    }
}

const ORDERS: [Order; 4] = [
    Order { is_big: false, is_interleaved: false },
    Order { is_big: false, is_interleaved: true },
    Order { is_big: true, is_interleaved: false },
    Order { is_big: true, is_interleaved: true },
];

/// Three channels of different types: no value is another's.
fn three(from: usize) -> Vec<Written> {
    let values = |times: f64| (from..from + 4).map(|k| times * (k as f64 - 5.0)).collect();
    vec![
        ("/'one'/'a'", F64, "N", values(1.125)),
        ("/'one'/'b''s'", F32, "mm", values(-0.25)),
        ("/'two'/'a'", I16, "deg", values(7.0)),
    ]
}

/// A file of three segments and four chunks, by each way of saying what is in the later ones.
fn file(order: Order, later: Says) -> Vec<u8> {
    let first = order.segment(&three(0), Says::Everything, 1);
    [first, order.segment(&three(4), later, 2), order.segment(&three(8), later, 1)].concat()
}

#[test]
fn every_order_of_bytes_and_samples_gives_the_same_channels() {
    for order in ORDERS {
        for later in [Says::Everything, Says::AsBefore, Says::Nothing] {
            let found = read(&file(order, later)).unwrap();
            assert!(!found.is_cut, "{order:?} {later:?}");
            let names: Vec<(&str, &str)> = found.channels.iter().map(|c| (&*c.group, &*c.name)).collect();
            assert_eq!(names, [("one", "a"), ("one", "b's"), ("two", "a")]);
            for (k, channel) in found.channels.iter().enumerate() {
                let parts = [0, 4, 4, 8].map(|from| three(from)[k].3.clone());
                assert_eq!(channel.values, parts.concat(), "{order:?} {later:?} {k}");
                assert_eq!(channel.unit.as_deref(), Some(three(0)[k].2));
            }
        }
    }
}

#[test]
fn a_file_that_is_cut_or_damaged_gives_what_is_whole_or_an_error() {
    for order in ORDERS {
        let bytes = file(order, Says::AsBefore);
        let whole = read(&bytes).unwrap().channels;
        let starts_as = |c: &Channel| {
            whole.iter().any(|w| w.name == c.name && w.group == c.group && w.values.starts_with(&c.values))
        };
        let mut told = 0;
        for end in 1..bytes.len() {
            if let Ok(part) = read(&bytes[..end]) {
                assert!(part.channels.iter().all(starts_as), "{order:?}, cut at {end}");
                told += usize::from(part.is_cut);
            }
        }
        // wherever data are cut: four chunks of four values of 8, 4 and 2 bytes, but for where a segment ends
        assert!(told > 4 * 4 * 14 - 4, "{told} of {}", bytes.len());
        for k in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[k] ^= 0xff;
            let _ = read(&damaged);
        }
    }
}

/// What npTDMS 1.13 writes: three segments, of which the last has one channel; a quote in the group's name; a root and a group without data.
const WRITTEN_ELSEWHERE: [&str; 7] = [
    "5444536d0e00000068120000a1000000000000008d0000000000000004000000010000002fffffffff00000000080000002f27497427277327ffffffff000000",
    "000c0000002f274974272773272f276127140000000a000000010000000200000000000000010000000b000000756e69745f737472696e672000000001000000",
    "4e0c0000002f274974272773272f276227140000000200000001000000020000000000000000000000000000000000f83f00000000000000c00300fcff544453",
    "6d0e0000006812000068000000000000005400000000000000020000000c0000002f274974272773272f276127140000000a0000000100000002000000000000",
    "00000000000c0000002f274974272773272f2762271400000002000000010000000200000000000000000000000000000000001c400000000000002040050006",
    "005444536d0e000000681200002e000000000000002c00000000000000010000000c0000002f274974272773272f276227140000000200000001000000010000",
    "0000000000000000000900",
];

#[test]
fn a_file_of_another_program_is_read() {
    let digits = WRITTEN_ELSEWHERE.concat();
    let bytes: Vec<u8> =
        (0..digits.len() / 2).map(|k| u8::from_str_radix(&digits[2 * k..2 * k + 2], 16).unwrap()).collect();
    let found = read(&bytes).unwrap();
    let channel = |name: &str, unit: Option<&str>, values: &[f64]| Channel {
        group: "It's".into(),
        name: name.into(),
        unit: unit.map(str::to_owned),
        values: values.to_vec(),
    };
    let expected = [channel("a", Some("N"), &[1.5, -2.0, 7.0, 8.0]), channel("b", None, &[3.0, -4.0, 5.0, 6.0, 9.0])];
    assert_eq!((found.channels, found.is_cut), (expected.into(), false));
}

/// Loads asked for [N] in a drawer test: up and down on either side; each is ramped to in 50 samples and held for 1060.
const ASKED: [f64; 9] = [0.0, 50.0, 100.0, 50.0, 0.0, -50.0, -100.0, -50.0, 0.0];
const RAMP: usize = 50;
const HELD: usize = 1060;
/// Motion for a load [mm/N], what unloading lags behind [mm], and what creeps away within a hold [mm].
const COMPLIANCE: f64 = 0.05;
const LAG: f64 = 0.4;
const CREEP: f64 = 0.5;
/// Noise from sample to sample, of which the mean over a hold leaves a hundredth and less [N, mm].
const NOISE: f64 = 0.2;

/// Sample by sample: load asked for, load, and anterior motion.
fn drawer() -> [Vec<f64>; 3] {
    let [mut asked, mut load, mut ap] = [vec![], vec![], vec![]];
    for (n, to) in ASKED.iter().enumerate() {
        let from = if n == 0 { 0.0 } else { ASKED[n - 1] };
        for k in 0..RAMP + HELD {
            let share = ((k + 1) as f64 / RAMP as f64).min(1.0);
            let noise = if k % 2 == 0 { NOISE } else { -NOISE };
            asked.push(from + (to - from) * share);
            load.push(asked[asked.len() - 1] + noise);
            let lag = if to.abs() < from.abs() { LAG * from.signum() } else { 0.0 };
            ap.push(4.0 + COMPLIANCE * to + lag + noise - CREEP * to.signum() * (-(k as f64) / 100.0).exp());
        }
    }
    [asked, load, ap]
}

/// The file of a robot at 30 deg under 20 N of compression; with the names of the other senses, or in metres and radians, it says the same.
fn robot(is_turned: bool, is_si: bool) -> Vec<u8> {
    let [asked, load, ap] = drawer();
    let all = |x: f64| vec![x; asked.len()];
    let sense = if is_turned { -1.0 } else { 1.0 };
    let times = |x: &[f64], factor: f64| x.iter().map(|x| x * factor).collect::<Vec<f64>>();
    let (mm, deg) = if is_si { (1e-3, 1f64.to_radians()) } else { (1.0, 1.0) };
    let (length, angle) = if is_si { ("m", "rad") } else { ("mm", "deg") };
    let name = |names: [&'static str; 2]| names[usize::from(is_turned)];
    let zero = all(0.0);
    let order = Order { is_big: is_turned, is_interleaved: is_si };
    let channels = vec![
        (
            name(["/'Kinetics.JCS.Desired'/'Anterior'", "/'Kinetics.JCS.Desired'/'Posterior'"]),
            F64,
            "N",
            times(&asked, sense),
        ),
        (
            name(["/'Kinetics.JCS.Desired'/'Distraction'", "/'Kinetics.JCS.Desired'/'Compression'"]),
            F64,
            "N",
            all(-20.0 * sense),
        ),
        (name(["/'State.JCS Load'/'Lateral Drawer'", "/'State.JCS Load'/'Medial Drawer'"]), F64, "N", all(3.0 * sense)),
        (
            name(["/'State.JCS Load'/'Anterior Drawer'", "/'State.JCS Load'/'Posterior Drawer'"]),
            F64,
            "N",
            times(&load, sense),
        ),
        (name(["/'State.JCS Load'/'Distraction'", "/'State.JCS Load'/'Compression'"]), F64, "N", all(-20.0 * sense)),
        ("/'State.JCS Load'/'Extension Torque'", F64, "Nm", zero.clone()),
        (name(["/'State.JCS Load'/'Varus Torque'", "/'State.JCS Load'/'Valgus Torque'"]), F64, "Nm", all(-0.5 * sense)),
        (
            name(["/'State.JCS Load'/'External Rotation Torque'", "/'State.JCS Load'/'Internal Rotation Torque'"]),
            F64,
            "Nm",
            all(0.25 * sense),
        ),
        (name(["/'State.Knee JCS'/'Medial'", "/'State.Knee JCS'/'Lateral'"]), F64, length, all(2.0 * sense * mm)),
        (name(["/'State.Knee JCS'/'Posterior'", "/'State.Knee JCS'/'Anterior'"]), F64, length, times(&ap, -sense * mm)),
        (name(["/'State.Knee JCS'/'Superior'", "/'State.Knee JCS'/'Inferior'"]), F64, length, all(-20.0 * sense * mm)),
        (name(["/'State.Knee JCS'/'Flexion'", "/'State.Knee JCS'/'Extension'"]), F64, angle, all(29.0 * sense * deg)),
        (name(["/'State.Knee JCS'/'Valgus'", "/'State.Knee JCS'/'Varus'"]), F64, angle, all(1.0 * sense * deg)),
        (name(["/'State.Knee JCS'/'Internal Rotation'", "/'State.Knee JCS'/'External Rotation'"]), F64, angle, zero),
    ];
    order.segment(&channels, Says::Everything, 1)
}

/// Numbers of a table have six decimals.
const SIX_DECIMALS: f64 = 2e-6;

#[test]
fn a_robots_file_becomes_a_reading_a_hold_with_both_branches() {
    let started = Instant::now();
    let table = laxity::read(&robot(false, false)).unwrap();
    let seconds = started.elapsed().as_secs_f64();
    assert!(seconds < 5.0, "{} samples in {seconds} s", ASKED.len() * (RAMP + HELD));
    let of = |t: &LaxityTrial| (t.test, t.branch, t.load[AP].round());
    let (up, down) = (Some(Branch::Loading), Some(Branch::Unloading));
    let found: Vec<_> = table.trials.iter().map(of).collect();
    let expected = [
        (Test::Neutral, None, 0.0),
        (Test::Anterior, up, 50.0),
        (Test::Anterior, up, 100.0),
        (Test::Anterior, down, 50.0),
        (Test::Posterior, up, -50.0),
        (Test::Posterior, up, -100.0),
        (Test::Posterior, down, -50.0),
    ];
    assert_eq!(found, expected);
    for t in &table.trials[1..] {
        let lag = if t.branch == down { LAG * t.load[AP].signum() } else { 0.0 };
        let asked = COMPLIANCE * t.load[AP].round() + lag;
        let read = t.measured[AP].unwrap();
        assert!((read - asked).abs() < NOISE / 100.0, "{}: {read} mm, {asked} expected", t.trial);
        assert_eq!(
            (t.nominal_flexion_deg, t.reference.as_ref().map(|r| &r.trial)),
            (30.0, Some(&table.trials[0].trial))
        );
        assert!((t.fe_deg - 29.0).abs() < SIX_DECIMALS);
        for (c, load) in [(SI, 20.0), (VV, 0.5), (IE, 0.25)] {
            assert!((t.load[c] - load).abs() < SIX_DECIMALS, "{}: {:?}", t.trial, t.load);
        }
    }
    let samples = (ASKED.len() * (RAMP + HELD)).to_string();
    assert!(
        table.warnings.iter().any(|w| w.contains(&samples) && w.contains("2 further unloaded holds")),
        "{:?}",
        table.warnings
    );
}

/// A robot's file that holds loads [N] for so many samples each, after ramps of steps of so many samples.
fn held(holds: &[(f64, usize)], step: usize) -> Vec<u8> {
    let mut asked: Vec<f64> = Vec::new();
    for (load, samples) in holds {
        let from = asked.last().copied().unwrap_or(0.0);
        asked.extend((1..RAMP).flat_map(|k| vec![from + (load - from) * k as f64 / RAMP as f64; step]));
        asked.extend(vec![*load; *samples]);
    }
    let all = |x: f64| vec![x; asked.len()];
    let of = |path: &'static str, unit: &'static str, values: Vec<f64>| (path, F64, unit, values);
    let channels = [
        of("/'Kinetics.JCS.Desired'/'Anterior'", "N", asked.clone()),
        of("/'State.JCS Load'/'Lateral Drawer'", "N", all(0.0)),
        of("/'State.JCS Load'/'Anterior Drawer'", "N", asked.clone()),
        of("/'State.JCS Load'/'Compression'", "N", all(20.0)),
        of("/'State.JCS Load'/'Varus Torque'", "Nm", all(0.0)),
        of("/'State.JCS Load'/'External Rotation Torque'", "Nm", all(0.0)),
        of("/'State.Knee JCS'/'Medial'", "mm", all(2.0)),
        of("/'State.Knee JCS'/'Anterior'", "mm", asked.clone()),
        of("/'State.Knee JCS'/'Superior'", "mm", all(-20.0)),
        of("/'State.Knee JCS'/'Flexion'", "deg", all(30.0)),
        of("/'State.Knee JCS'/'Valgus'", "deg", all(1.0)),
        of("/'State.Knee JCS'/'External Rotation'", "deg", all(0.0)),
    ];
    ORDERS[0].segment(&channels, Says::Everything, 1)
}

#[test]
fn holds_too_short_to_be_read_are_counted_and_steps_of_a_ramp_are_none() {
    // ramps sample by sample, and as a slower program gives them
    for step in [1, 3] {
        for (short, told) in [(0, None), (1, Some(1)), (3, Some(3))] {
            let mut holds = vec![(0.0, 60), (50.0, 60)];
            holds.extend((0..short).map(|k| (80.0 + 10.0 * f64::from(k), 19)));
            holds.push((20.0, 60));
            let table = laxity::read(&held(&holds, step)).unwrap();
            assert_eq!(table.trials.len(), 3, "{step} {short}");
            let notice = table.warnings.iter().find(|w| w.contains("shorter than 20 samples"));
            assert_eq!(notice.and_then(|w| w.count), told, "{step} {short}: {:?}", table.warnings);
        }
        // from 20 samples on it is one
        let whole = laxity::read(&held(&[(0.0, 60), (50.0, 20)], step)).unwrap();
        assert_eq!(whole.trials.len(), 2);
        assert!(!whole.warnings.iter().any(|w| w.contains("shorter than")), "{:?}", whole.warnings);
    }
}

#[test]
fn names_of_the_other_sense_and_other_units_say_the_same() {
    let plain = laxity::read(&robot(false, false)).unwrap().trials;
    for (is_turned, is_si) in [(true, false), (false, true), (true, true)] {
        let other = laxity::read(&robot(is_turned, is_si)).unwrap().trials;
        assert_eq!(plain.len(), other.len());
        for (a, b) in plain.iter().zip(&other) {
            assert_eq!((&a.trial, a.test, a.branch), (&b.trial, b.test, b.branch));
            let apart = crate::coordinate::FREE.into_iter().map(|c| {
                // the unloaded trial has no readings: it is the zero
                let measured = a.measured[c].unwrap_or(0.0) - b.measured[c].unwrap_or(0.0);
                (a.load[c] - b.load[c]).abs().max(measured.abs())
            });
            let apart = apart.fold((a.fe_deg - b.fe_deg).abs(), f64::max);
            assert!(apart < SIX_DECIMALS, "{}: {apart}", a.trial);
        }
    }
}

#[test]
fn channels_of_any_names_are_columns_for_a_format_to_name() {
    let format = |text: &str| toml::from_str::<LaxityFormat>(text).unwrap();
    let named = format(
        "constants = { nominal_flexion_deg = 30 }\n[columns]\nload_ap_n = \"State.JCS Load/Anterior Drawer\"\nfe_deg = \"State.Knee JCS/Flexion\"\nap_mm = { name = \"State.Knee JCS/Posterior\", positive = \"posterior\" }",
    );
    for is_si in [false, true] {
        let table = laxity::read_as(&robot(false, is_si), &named, Side::Right).unwrap();
        let [_, load, ap] = drawer();
        assert_eq!(table.trials.len(), ap.len());
        for (t, (load, ap)) in table.trials.iter().zip(load.iter().zip(&ap)) {
            assert!((t.load[AP] - load).abs() < 1e-9 && (t.measured[AP].unwrap() - ap).abs() < 1e-9);
        }
    }
    // and without a name each is told
    let file = file(ORDERS[0], Says::Everything);
    let told = laxity::read(&file).unwrap_err().to_string();
    let names: BTreeSet<&str> = ["one/a [N]", "one/b's [mm]", "two/a [deg]"].into();
    assert!(names.iter().all(|n| told.contains(n)) && told.contains("laxity_format"), "{told}");
}
