//! Tracked bodies against a build: their landmarks against its bones, their frames against its frames.
//!
//! Landmarks and frames are copied by hand into a declaration. One of another CT, side or unit puts every pose of the file elsewhere.

use super::{Tracked, TrackedBone};
use meshes::frame::AnatomicalFrame;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use notices::{Kind, Notice};

/// Landmarks off their bone by more in the median are told [mm]: cartilage is up to 5 mm thick, and a probe's tip is placed within 3. Ours.
const MOST_OFF_MM: f64 = 8.0;
/// Frames further apart than this are told: their turn [deg] and the distance of their origins [mm]. A frame is copied with its digits; a degree of it is
/// up to a degree of VV or IE, and a millimetre one of AP. Ours.
const MOST_APART: (f64, f64) = (1.0, 1.0);
/// Frames no further apart than this are two of one bone [deg], [mm]: a calibration turns and shifts them by less. Ours.
const OF_ONE_BONE: (f64, f64) = (10.0, 15.0);
/// Turns by which a frame with its axes under other names or signs is off [deg].
const TURNED_DEG: [f64; 3] = [90.0, 120.0, 180.0];
/// What lengths in m, in and cm are multiplied by.
const TO_MM: [f64; 3] = [1e3, 25.4, 10.0];
/// How far beyond the cut of a shaft [mm], and beside its axis, a landmark may be one of the same bone: hip or ankle. A bone ends where its surface was cut.
const BEYOND_MM: [f64; 2] = [500.0, 80.0];
/// Signs of x, y and z that are tried, and what they mean.
const SIGNS: [([f64; 3], &str); 6] = [
    ([-1.0, -1.0, 1.0], "x and y have the other sign: another program's axes, LPS in place of RAS?"),
    ([-1.0, 1.0, -1.0], "x and z have the other sign: another program's axes?"),
    ([1.0, -1.0, -1.0], "y and z have the other sign: another program's axes?"),
    ([-1.0, 1.0, 1.0], "x has the other sign: is it mirrored, of the other side?"),
    ([1.0, -1.0, 1.0], "y has the other sign: is it mirrored, of the other side?"),
    ([1.0, 1.0, -1.0], "z has the other sign: is it mirrored, of the other side?"),
];

/// A bone as a build has it.
#[derive(Clone, Copy)]
pub struct BuiltBone<'a> {
    /// Its frame, CT frame.
    pub frame: &'a AnatomicalFrame,
    /// Its surface [mm], CT frame; the shaft may be cut short.
    pub surface: &'a TriMesh,
}

/// A bone with its name and its surface to ask.
struct Asked<'a> {
    name: &'static str,
    given: &'a TrackedBone,
    frame: &'a AnatomicalFrame,
    /// The end of the shaft [mm] along the frame's superior, upwards of the femur and downwards of the tibia; and which way that is.
    shaft: (f64, f64),
    query: Option<SurfaceQuery>,
}

impl Tracked {
    /// What is told of landmarks that lie away from the build's femur and tibia, and of frames that are not theirs: how far, and what is likely.
    pub fn held(&self, [femur, tibia]: [BuiltBone<'_>; 2]) -> Vec<Notice> {
        let bones = [Asked::of("femur", &self.femur, femur, 1.0), Asked::of("tibia", &self.tibia, tibia, -1.0)];
        let pairs = [[&bones[0], &bones[1]], [&bones[1], &bones[0]]];
        pairs.into_iter().flat_map(|[own, other]| [own.points_off(other), own.frame_off(other)]).flatten().collect()
    }
}

impl<'a> Asked<'a> {
    fn of(name: &'static str, given: &'a TrackedBone, built: BuiltBone<'a>, up: f64) -> Asked<'a> {
        let along = |p: &Point| up * (p - built.frame.origin).dot(&built.frame.superior);
        let end = built.surface.vertices.iter().map(along).fold(f64::NEG_INFINITY, f64::max);
        Asked { name, given, frame: built.frame, shaft: (end, up), query: SurfaceQuery::new(built.surface) }
    }

    /// Whether a landmark lies beyond the cut of the shaft, where the bone has no surface.
    fn is_beyond(&self, p: &Point) -> bool {
        let (offset, (end, up)) = (p - self.frame.origin, self.shaft);
        let along = offset.dot(&self.frame.superior);
        let beside = (offset - self.frame.superior * along).norm();
        (0.0..=BEYOND_MM[0]).contains(&(up * along - end)) && beside <= BEYOND_MM[1]
    }

    /// The median distance of points from the surface [mm].
    fn median_off(&self, points: impl Iterator<Item = Point>) -> Option<f64> {
        let query = self.query.as_ref()?;
        let mut all: Vec<f64> = points.map(|p| query.nearest(&p).distance).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    }

    fn points_off(&self, other: &Asked<'_>) -> Option<Notice> {
        let name = self.name;
        let all = self.given.landmarks.values().map(|p| Point::from(Vector::from(*p)));
        let points: Vec<Point> = all.filter(|p| !self.is_beyond(p)).collect();
        let off = self.median_off(points.iter().copied()).filter(|off| *off > MOST_OFF_MM)?;
        let lie = |bone: &Asked<'_>, of: &dyn Fn(&Point) -> Point| {
            bone.median_off(points.iter().map(of)).is_some_and(|off| off <= MOST_OFF_MM)
        };
        let cause = if let Some(factor) = TO_MM.into_iter().find(|f| lie(self, &|p| p * *f)) {
            format!("multiplied by {factor} they lie on it: landmarks are in mm")
        } else if lie(other, &|p| *p) {
            format!("they lie on the {}: are femur and tibia exchanged?", other.name)
        } else if let Some((_, why)) = SIGNS.into_iter().find(|(signs, _)| lie(self, &|p| signed(p, signs))) {
            format!("they lie on it where {why}")
        } else {
            "are they in the frame of a scan, or of another CT?".into()
        };
        let text = format!(
            "tracked.{name}.landmarks lie {off:.0} mm off the build's {name} in the median, more than {MOST_OFF_MM} mm; {cause}"
        );
        Some(Kind::TrackedElsewhere.notice(text).count(points.len()).of(name))
    }

    fn frame_off(&self, other: &Asked<'_>) -> Option<Notice> {
        let (name, given) = (self.name, &self.given.frame);
        let (turn, shift) = apart(given, self.frame);
        let is = |frame: &AnatomicalFrame| within(apart(given, frame), MOST_APART);
        if is(self.frame) {
            return None;
        }
        let scaled = |factor: f64| AnatomicalFrame { origin: given.origin * factor, ..*given };
        let cause = if is(other.frame) {
            format!("it is that of the {}: are femur and tibia exchanged?", other.name)
        } else if let Some(f) = TO_MM.into_iter().find(|f| within(apart(&scaled(*f), self.frame), MOST_APART)) {
            format!("with its origin multiplied by {f} it is that frame: the origin is in mm")
        } else if let Some((_, why)) = SIGNS.into_iter().find(|(signs, _)| is(&signed_frame(self.frame, signs))) {
            format!("it is that frame where {why}")
        } else if within((turn, shift), OF_ONE_BONE) {
            "is it of a calibrated model.json, or of another build? Take that of 05-frames/frames.json".into()
        } else if shift <= OF_ONE_BONE.1 && TURNED_DEG.iter().any(|t| (turn - t).abs() <= OF_ONE_BONE.0) {
            "are its axes under each other's names, or of the other sign?".into()
        } else {
            "is it of a scan, or of another CT? Take that of 05-frames/frames.json".into()
        };
        let (most_deg, most_mm) = MOST_APART;
        let text = format!(
            "tracked.{name}.frame is turned by {turn:.1} deg and shifted by {shift:.1} mm against the build's, more than {most_deg} deg or {most_mm} mm; {cause}"
        );
        Some(Kind::TrackedElsewhere.notice(text).of(name))
    }
}

fn within((turn, shift): (f64, f64), most: (f64, f64)) -> bool {
    turn <= most.0 && shift <= most.1
}

/// The turn between two frames [deg] and the distance of their origins [mm].
fn apart(a: &AnatomicalFrame, b: &AnatomicalFrame) -> (f64, f64) {
    let cosine = |a: &Vector, b: &Vector| a.normalize().dot(&b.normalize());
    let trace = cosine(&a.medial, &b.medial) + cosine(&a.anterior, &b.anterior) + cosine(&a.superior, &b.superior);
    (f64::midpoint(trace, -1.0).clamp(-1.0, 1.0).acos().to_degrees(), (a.origin - b.origin).norm())
}

fn signed(p: &Point, signs: &[f64; 3]) -> Point {
    Point::from(p.coords.component_mul(&Vector::from(*signs)))
}

fn signed_frame(frame: &AnatomicalFrame, signs: &[f64; 3]) -> AnatomicalFrame {
    let turned = |v: &Vector| v.component_mul(&Vector::from(*signs));
    AnatomicalFrame {
        origin: signed(&frame.origin, signs),
        medial: turned(&frame.medial),
        anterior: turned(&frame.anterior),
        superior: turned(&frame.superior),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::Isometry;
    use meshes::shapes::icosphere;
    use std::collections::BTreeMap;

    /// Middles of a femur and a tibia that are balls [mm], and their radius.
    const MIDDLES: [[f64; 3]; 2] = [[-30.0, -120.0, 40.0], [-27.0, -118.0, -45.0]];
    const RADIUS_MM: f64 = 36.0;

    fn frame(middle: [f64; 3], turn: f64) -> AnatomicalFrame {
        let turned = |v: Vector| Isometry::rotation(Vector::new(turn, 0.0, 0.0)) * v;
        AnatomicalFrame {
            origin: Point::from(Vector::from(middle)),
            medial: turned(-Vector::x()),
            anterior: turned(-Vector::y()),
            superior: turned(Vector::z()),
        }
    }

    struct Knee {
        frames: [AnatomicalFrame; 2],
        surfaces: [TriMesh; 2],
        tracked: Tracked,
    }

    fn knee() -> Knee {
        let frames = [frame(MIDDLES[0], 0.0), frame(MIDDLES[1], 0.1)];
        let ball = |m: &[f64; 3]| icosphere(RADIUS_MM, 4).moved(&Isometry::translation(m[0], m[1], m[2]));
        let ways = [[1.0, 0.0, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.6, 0.8], [0.0, -0.8, -0.6]];
        let bone = |k: usize| {
            let at =
                |way: &[f64; 3]| -> [f64; 3] { (Vector::from(MIDDLES[k]) + Vector::from(*way) * RADIUS_MM).into() };
            let points: BTreeMap<String, [f64; 3]> =
                ways.iter().enumerate().map(|(n, way)| (format!("p{n}"), at(way))).collect();
            TrackedBone { columns: vec![], probed: points.clone(), landmarks: points, frame: frames[k] }
        };
        let tracked = Tracked { unit: "mm".into(), probed_at: None, femur: bone(0), tibia: bone(1) };
        Knee { frames, surfaces: [ball(&MIDDLES[0]), ball(&MIDDLES[1])], tracked }
    }

    impl Knee {
        fn told(&self) -> Vec<String> {
            let built = |k: usize| BuiltBone { frame: &self.frames[k], surface: &self.surfaces[k] };
            notices::texts(&self.tracked.held([built(0), built(1)]))
        }

        /// What is told where the landmarks of both bones are moved so.
        fn with_landmarks(mut self, change: impl Fn(&mut [f64; 3])) -> Vec<String> {
            for bone in [&mut self.tracked.femur, &mut self.tracked.tibia] {
                bone.landmarks.values_mut().for_each(&change);
            }
            self.told()
        }

        /// The same of frames.
        fn with_frames(mut self, change: impl Fn(&mut AnatomicalFrame)) -> Vec<String> {
            change(&mut self.tracked.femur.frame);
            change(&mut self.tracked.tibia.frame);
            self.told()
        }
    }

    /// Holds that both bones are told, and why.
    fn assert_told(told: &[String], key: &str, words: &str) {
        for bone in ["femur", "tibia"] {
            let head = format!("tracked.{bone}.{key} ");
            assert!(told.iter().any(|t| t.starts_with(&head) && t.contains(words)), "{head}{words}: {told:?}");
        }
        assert_eq!(told.len(), 2, "{told:?}");
    }

    #[test]
    fn what_is_of_the_build_is_not_told() {
        assert!(knee().told().is_empty(), "{:?}", knee().told());
        // a probe's tip on cartilage, and a frame with rounded numbers
        assert!(knee().with_landmarks(|p| p[2] += 5.0).is_empty());
        let round = |x: &mut f64| *x = (*x * 100.0).round() / 100.0;
        let rounded = knee().with_frames(|f| {
            f.origin.iter_mut().for_each(round);
            [&mut f.medial, &mut f.anterior, &mut f.superior].into_iter().for_each(|v| v.iter_mut().for_each(round));
        });
        assert!(rounded.is_empty(), "{rounded:?}");
    }

    #[test]
    fn landmarks_away_from_the_bone_are_told_with_size_and_cause() {
        assert_told(&knee().with_landmarks(|p| p[0] += 150.0), "landmarks", "of a scan, or of another CT?");
        assert_told(&knee().with_landmarks(|p| *p = p.map(|x| x / 1e3)), "landmarks", "multiplied by 1000");
        assert_told(&knee().with_landmarks(|p| *p = p.map(|x| x / 10.0)), "landmarks", "multiplied by 10 ");
        let both = knee().with_landmarks(|p| *p = [-p[0], -p[1], p[2]]);
        assert_told(&both, "landmarks", "LPS in place of RAS");
        // the balls reach across the plane of x = 0: a mirrored one has to lie further from it
        let far = |k: &mut Knee| {
            for (surface, frame) in k.surfaces.iter_mut().zip(&mut k.frames) {
                *surface = surface.clone().moved(&Isometry::translation(-60.0, 0.0, 0.0));
                frame.origin.x -= 60.0;
            }
            [&mut k.tracked.femur, &mut k.tracked.tibia].into_iter().for_each(|b| b.frame.origin.x -= 60.0);
        };
        let mut mirrored = knee();
        far(&mut mirrored);
        assert_told(&mirrored.with_landmarks(|p| p[0] = 60.0 - p[0]), "landmarks", "of the other side");
    }

    #[test]
    fn bones_in_each_others_table_are_told() {
        let mut exchanged = knee();
        let Tracked { femur, tibia, .. } = &mut exchanged.tracked;
        std::mem::swap(&mut femur.landmarks, &mut tibia.landmarks);
        assert_told(&exchanged.told(), "landmarks", "are femur and tibia exchanged?");
        let mut exchanged = knee();
        let Tracked { femur, tibia, .. } = &mut exchanged.tracked;
        std::mem::swap(&mut femur.frame, &mut tibia.frame);
        assert_told(&exchanged.told(), "frame", "are femur and tibia exchanged?");
    }

    #[test]
    fn frames_that_are_not_the_builds_are_told_with_size_and_cause() {
        let turned = |deg: f64| {
            knee().with_frames(move |f| {
                let turn = Isometry::rotation(Vector::new(0.0, deg.to_radians(), 0.0));
                [&mut f.medial, &mut f.anterior, &mut f.superior].into_iter().for_each(|v| *v = turn * *v);
            })
        };
        assert!(turned(0.9).is_empty() && turned(-0.9).is_empty());
        assert_told(&turned(3.0), "frame", "turned by 3.0 deg");
        assert_told(&turned(-3.0), "frame", "of a calibrated model.json");
        assert_told(&turned(180.0), "frame", "under each other's names");
        assert!(knee().with_frames(|f| f.origin.x += 0.9).is_empty());
        assert_told(&knee().with_frames(|f| f.origin.x += 4.0), "frame", "shifted by 4.0 mm");
        assert_told(&knee().with_frames(|f| f.origin.x += 90.0), "frame", "of another CT");
        assert_told(&knee().with_frames(|f| f.origin /= 1e3), "frame", "multiplied by 1000");
        let both = knee().with_frames(|f| *f = signed_frame(f, &[-1.0, -1.0, 1.0]));
        assert_told(&both, "frame", "LPS in place of RAS");
    }

    #[test]
    fn hip_and_ankle_beyond_the_cut_of_a_shaft_are_not_asked() {
        let mut knee = knee();
        for (bone, z) in [(&mut knee.tracked.femur, 420.0), (&mut knee.tracked.tibia, -400.0)] {
            let far = |n: f64| [-30.0 + 20.0 * n, -120.0, z];
            bone.landmarks = (0..3).map(|n| (format!("far{n}"), far(f64::from(n)))).collect();
        }
        assert!(knee.told().is_empty(), "{:?}", knee.told());
        // what lies there by an error of the frame is far beside the shaft
        assert_told(&knee.with_landmarks(|p| p[1] = -p[1]), "landmarks", "lie");
    }
}
