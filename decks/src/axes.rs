//! The knee's anatomical frames and side, where a file states them, its joints show them, or its ligaments.

use meshes::frame::{AnatomicalFrame, Side};
use meshes::{Point, Vector};
use notices::Notice;
use sim::spec::FibreSpec;

/// Cosine above which two axes of the joint are one [-].
pub(crate) const ONE_AXIS: f64 = 0.9;

/// What names of bodies and contact meshes say.
pub(crate) const FEMORAL: [&str; 3] = ["femur", "femoral", "thigh"];
pub(crate) const TIBIAL: [&str; 3] = ["tibia", "tibial", "shank"];

/// Frames, side, and what is odd about them.
pub(crate) struct Axes {
    pub(crate) femur: AnatomicalFrame,
    pub(crate) tibia: AnatomicalFrame,
    pub(crate) side: Side,
    pub(crate) told: Vec<Notice>,
}

/// Directions that ligaments show.
pub(crate) struct Shown {
    pub(crate) superior: Vector,
    pub(crate) medial: Option<Vector>,
    pub(crate) anterior: Option<Vector>,
}

impl Shown {
    pub(crate) fn by(fibres: &[FibreSpec]) -> Shown {
        let mean = |of: Vec<Vector>| (!of.is_empty()).then(|| of.iter().sum::<Vector>() / of.len() as f64);
        let named = |fits: &dyn Fn(&str) -> bool| fibres.iter().filter(|f| fits(&f.bundle.to_uppercase())).collect();
        let middle =
            |fibres: Vec<&FibreSpec>| mean(fibres.iter().map(|f| (f.femur.coords + f.tibia.coords) / 2.0).collect());
        let end = |fibres: Vec<&FibreSpec>| mean(fibres.iter().map(|f| f.tibia.coords).collect());
        let apart = |a: Option<Vector>, b: Option<Vector>| a.zip(b).map(|(a, b)| a - b);
        Shown {
            superior: mean(fibres.iter().map(|f| f.femur - f.tibia).collect()).unwrap_or_else(Vector::y),
            medial: apart(middle(named(&|n| n.contains("MCL"))), middle(named(&|n| n.starts_with("LCL")))),
            anterior: apart(end(named(&|n| n.starts_with("ACL"))), end(named(&|n| n.starts_with("PCL")))),
        }
    }
}

/// Origin and directions, their signs not settled: medial-lateral, anterior-posterior, superior-inferior.
pub(crate) struct Raw {
    pub(crate) origin: Point,
    pub(crate) axes: [Vector; 3],
}

/// Axes at right angles: of the femur the medial-lateral one is kept, of the tibia the superior one.
pub(crate) fn square(origin: Point, ml: Vector, si: Vector, keep_ml: bool) -> Raw {
    let (ml, si) = (ml.normalize(), si.normalize());
    let unit = |v: Vector, usual: Vector| v.try_normalize(1e-9).unwrap_or(usual);
    let (ml, si) = if keep_ml { (ml, unit(si - ml * ml.dot(&si), si)) } else { (unit(ml - si * si.dot(&ml), ml), si) };
    Raw { origin, axes: [ml, ml.cross(&si), si] }
}

/// The side, by what ligaments show, else by what is given or named.
pub(crate) fn side(tibia: &Raw, shown: &Shown, given: Option<Side>, by_name: Option<Side>) -> Result<Side, String> {
    let [ml, ap, si] = tibia.axes;
    let sign = |axis: &Vector, way: &Vector| if axis.dot(way) < 0.0 { -*axis } else { *axis };
    let by_ligaments = shown.medial.zip(shown.anterior).map(|(medial, anterior)| {
        let (m, a, s) = (sign(&ml, &medial), sign(&ap, &anterior), sign(&si, &shown.superior));
        if m.cross(&a).dot(&s) > 0.0 { Side::Left } else { Side::Right }
    });
    match (by_ligaments, given) {
        (Some(found), Some(given)) if found != given => Err(format!(
            "--side says {}, but MCL, LCL, ACL and PCL lie as in a {} knee; check the names of the ligaments",
            side_word(given),
            side_word(found)
        )),
        (Some(found), _) => Ok(found),
        (None, given) => given.or(by_name).ok_or_else(|| {
            "the knee's side cannot be told: not all of MCL, LCL, ACL and PCL are there, and the bodies' names end neither in _r nor in _l; say it: --side left or --side right".into()
        }),
    }
}

/// The frame with its signs: superior to the femur, medial and anterior as ligaments show, the rest by the side.
pub(crate) fn turned(raw: &Raw, shown: &Shown, side: Side) -> AnatomicalFrame {
    let [ml, ap, si] = raw.axes;
    let sign = |axis: Vector, way: &Vector| if axis.dot(way) < 0.0 { -axis } else { axis };
    let superior = sign(si, &shown.superior);
    let hand = if side == Side::Left { 1.0 } else { -1.0 };
    let (medial, anterior) = match (shown.medial, shown.anterior) {
        (Some(m), _) => {
            let medial = sign(ml, &m);
            (medial, superior.cross(&medial) * hand)
        }
        (None, Some(a)) => {
            let anterior = sign(ap, &a);
            (anterior.cross(&superior) * hand, anterior)
        }
        (None, None) => (ml, superior.cross(&ml) * hand),
    };
    AnatomicalFrame { origin: raw.origin, medial, anterior, superior }
}

pub(crate) fn side_by_name(body: &str) -> Option<Side> {
    let body = body.to_lowercase();
    let ends = |words: &[&str]| words.iter().any(|w| body.ends_with(w));
    match (ends(&["_r", "_right"]), ends(&["_l", "_left"])) {
        (true, false) => Some(Side::Right),
        (false, true) => Some(Side::Left),
        _ => None,
    }
}

pub(crate) fn side_word(side: Side) -> &'static str {
    match side {
        Side::Left => "left",
        Side::Right => "right",
    }
}
