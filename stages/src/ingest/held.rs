//! Given points and bodies held against the bones: unit, frame, exchanged columns, shift.

use super::space::{self, TURNS};
use crate::specimen::{NamedPoint, Patella, PointFrame};
use crate::{PerBone, StageError};
use attachments::site::Fibre;
use meshes::measure::percentile;
use meshes::query::SurfaceQuery;
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::{Point, Vector};
use notices::{Kind, Notice};
use std::collections::BTreeSet;

/// Width of the knee that the lengths below are meant for [mm]; they grow with the femur's.
pub(super) const WIDTH_MM: f64 = 85.0;
/// Points this far off their bone in the median lie elsewhere [mm]: half as far again as a rough point, both beyond the thickest cartilage. Ours.
const OFF_MM: f64 = 15.0;
/// Ends of fibres this far off their bone in the median are told [mm]: the format's 4 mm of a rough point.
const TOLD_MM: f64 = 4.0;
/// Ends of fibres this far off one of the bones in the median are told [mm]: sites that three people mark differ by 2. Ours.
const ONE_BONE_MM: f64 = 2.5;
/// A change of unit, frame or columns is the cause where it brings points this near [mm], and to this share of how far they were [-]. Ours.
const MENDED_MM: f64 = 6.0;
const MENDED_SHARE: f64 = 0.3;
/// Fewer points than these fit another unit or frame by chance, so they are told and not refused [-]. Ours: three make a triangle.
const FEWEST: usize = 3;
/// Fibres, or the spread of landmarks, of less than this are of another unit [mm]: the shortest ligament of a knee is 8 mm long.
const SHORTEST_MM: f64 = 2.0;
/// That ligament, as the message says it [mm].
const SHORTEST_LIGAMENT_MM: f64 = 8.0;
/// A patella farther than this from the femur is not where it belongs [mm]; the widest gap of a knee at rest is a few millimetres.
const PATELLA_MM: f64 = 25.0;
/// Share of a patella's corners that may lie inside the femur without a word [-].
const PATELLA_INSIDE: f64 = 0.05;
/// Units in which a point may be given, and their length [mm].
const UNITS: [(&str, f64); 4] = [("metres", 1000.0), ("inches", 25.4), ("centimetres", 10.0), ("micrometres", 0.001)];
/// Orders in which the three columns of a point may be exchanged.
const ORDERS: [([usize; 3], &str); 5] = [
    ([1, 0, 2], "y, x, z"),
    ([2, 1, 0], "z, y, x"),
    ([0, 2, 1], "x, z, y"),
    ([1, 2, 0], "y, z, x"),
    ([2, 0, 1], "z, x, y"),
];

/// The bones as what points are held against.
pub(super) struct Bones {
    femur: SurfaceQuery,
    tibfib: SurfaceQuery,
    /// The knee's size over that of an adult's [-].
    pub(super) scale: f64,
}

impl Bones {
    /// Of the bones of CT or MRI; none where one has no triangle.
    pub(super) fn of(ct: &PerBone<TriMesh>) -> Option<Bones> {
        let scale = super::middle_extent(&ct.femur) / WIDTH_MM;
        Some(Bones { femur: SurfaceQuery::new(&ct.femur)?, tibfib: SurfaceQuery::new(&ct.tibfib)?, scale })
    }

    /// The femur, 0, or the tibia with the fibula.
    pub(super) fn own(&self, bone: usize) -> &SurfaceQuery {
        if bone == 0 { &self.femur } else { &self.tibfib }
    }

    fn nearest(&self, p: &Point) -> f64 {
        self.femur.nearest(p).distance.min(self.tibfib.nearest(p).distance)
    }
}

/// How far points lie off their surface in the median, after a change.
pub(super) fn off(points: &[Point], change: impl Fn(&Point) -> Point, distance: impl Fn(usize, &Point) -> f64) -> f64 {
    let mut all: Vec<f64> = points.iter().enumerate().map(|(i, p)| distance(i, &change(p))).collect();
    percentile(&mut all, 0.5)
}

/// The likely cause of points that lie off: another unit, frame, or order of columns; with what mends it. The one that brings them nearest.
pub(super) fn cause(points: &[Point], far: f64, scale: f64, distance: impl Fn(usize, &Point) -> f64) -> Option<String> {
    let mut best: Option<(f64, String)> = None;
    let mut consider = |left: f64, what: String| {
        let mends = left < MENDED_MM * scale && left < MENDED_SHARE * far;
        if mends && best.as_ref().is_none_or(|(least, _)| left < *least) {
            best = Some((left, what));
        }
    };
    for (unit, mm) in UNITS {
        let left = off(points, |p| p * mm, &distance);
        consider(left, format!("they fit in {unit}; expected mm: multiply them by {mm}"));
    }
    for (signs, what) in TURNS {
        let left = off(points, |p| Point::from(p.coords.component_mul(&Vector::from(signs))), &distance);
        consider(left, format!("they are {what}"));
    }
    for (order, words) in ORDERS {
        let left = off(points, |p| Point::new(p[order[0]], p[order[1]], p[order[2]]), &distance);
        consider(
            left,
            format!(
                "they fit where their columns are read in the order {words}: name the columns in their order, or those of the bones if they are exchanged"
            ),
        );
    }
    best.map(|(_, what)| what)
}

/// The cause of points that lie in one place: the unit in which they lie on their surface.
fn shrunk(points: &[Point], scale: f64, distance: impl Fn(usize, &Point) -> f64) -> String {
    let best = UNITS.iter().map(|(unit, mm)| (off(points, |p| p * *mm, &distance), unit, mm)).filter(|u| *u.2 > 1.0);
    match best.min_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((left, unit, mm)) if left < OFF_MM * scale => {
            format!("they fit in {unit}; expected mm: multiply them by {mm}")
        }
        _ => "check their unit; mm is expected".into(),
    }
}

/// Holds the fibres of attachments.csv against the bones.
///
/// # Errors
/// Fibres in another unit or frame, with columns exchanged, or far off the bones.
pub(super) fn fibres(
    path: &str,
    fibres: &[Fibre],
    bones: &Bones,
    warnings: &mut Vec<Notice>,
) -> Result<(), StageError> {
    if fibres.is_empty() {
        return Ok(());
    }
    let refuse = |what: String| Err(StageError::file(path, what));
    warnings.extend(coarse(path, fibres));
    warnings.extend(copies(path, fibres));
    let ends: Vec<Point> = fibres.iter().map(|f| f.femur).chain(fibres.iter().map(|f| f.tibia)).collect();
    let count = fibres.len();
    let on = |i: usize, p: &Point| {
        if i < count { bones.femur.nearest(p).distance } else { bones.tibfib.nearest(p).distance }
    };
    let crossed = |i: usize, p: &Point| on((i + count) % (2 * count), p);
    let mut lengths: Vec<f64> = fibres.iter().map(|f| (f.femur - f.tibia).norm()).collect();
    let length = percentile(&mut lengths, 0.5);
    if length < SHORTEST_MM * bones.scale {
        return refuse(format!(
            "its fibres are {length:.3} mm long in the median as their numbers stand, where the shortest ligament of a knee is {SHORTEST_LIGAMENT_MM:.0} mm; {}",
            shrunk(&ends, bones.scale, on)
        ));
    }
    let far = off(&ends, |p| *p, on);
    let swapped = off(&ends, |p| *p, crossed);
    if far > TOLD_MM * bones.scale && swapped < MENDED_SHARE * far {
        return refuse(format!(
            "the ends on the femur lie on the tibia, and the reverse ({far:.0} mm off their own bone in the median): the columns femur_* and tibia_* are exchanged; exchange their names"
        ));
    }
    let mended = (far > TOLD_MM * bones.scale).then(|| cause(&ends, far, bones.scale, on)).flatten();
    if let Some(what) = mended.filter(|_| far > OFF_MM * bones.scale || count >= 10) {
        return refuse(format!("its points lie {far:.0} mm off their bones in the median; {what}"));
    }
    if far > 2.0 * OFF_MM * bones.scale {
        return refuse(format!(
            "its points lie {far:.0} mm off their bones in the median, expected within {:.0}; check that they are in the frame of [ct], in mm",
            TOLD_MM * bones.scale
        ));
    }
    if far > TOLD_MM * bones.scale {
        warnings.push(Kind::FibresOffBones.notice(format!(
            "{path}: its points lie {far:.1} mm off their bones in the median, expected within {:.1}: check their frame (a shift?) and unit",
            TOLD_MM * bones.scale
        )).file(path));
    } else {
        warnings.extend(on_one_bone(path, &ends, bones));
    }
    single(path, fibres, bones, warnings);
    Ok(())
}

/// Steps that are told, the coarsest first [mm]: a site is known to 1 mm, and half a step is lost. Ours.
const STEPS_MM: [f64; 3] = [10.0, 5.0, 2.0];

/// Fibres whose numbers are all whole multiples of a coarse step: rounded, or written in whole centimetres.
fn coarse(path: &str, fibres: &[Fibre]) -> Option<Notice> {
    let numbers = || fibres.iter().flat_map(|f| f.femur.iter().chain(f.tibia.iter()).copied().collect::<Vec<f64>>());
    let whole = |step: f64| numbers().all(|x| ((x / step).round() * step - x).abs() < 1e-6);
    let step = STEPS_MM.into_iter().find(|step| fibres.len() >= FEWEST && whole(*step))?;
    Some(
        Kind::CoarseNumbers
            .notice(format!(
                "{path}: all its coordinates come in steps of {step} mm: rounded, or written in whole cm? A site is a few millimetres large; expected tenths of a millimetre"
            ))
            .file(path),
    )
}

/// Fibres that stand at the same two points as one above them: one line, given several times.
fn copies(path: &str, fibres: &[Fibre]) -> Option<Notice> {
    let mut seen = BTreeSet::new();
    let place = |f: &Fibre| [f.femur, f.tibia].map(|p| [p.x, p.y, p.z].map(f64::to_bits));
    let again: Vec<&Fibre> = fibres.iter().filter(|f| !seen.insert(place(f))).collect();
    let first = again.first()?;
    Some(
        Kind::FibreCount
            .notice(format!(
                "{path}: {} of its fibres stand at the same two points as one above them, the first {} {}: was a line copied? Expected each fibre at its own place in the site",
                again.len(),
                first.bundle,
                first.fibre
            ))
            .file(path)
            .count(again.len()),
    )
}

/// An end lies off its bone alone where it is so many times as far off as most ends of its table are, and so many mm: a slip in one number. Ours.
const ALONE: f64 = 5.0;
const ALONE_MM: f64 = 6.0;
/// Most ends: this share of them [-].
const MOST_ENDS: f64 = 0.8;

/// The bone off whose surface its ends of fibres lie, though the other's lie on theirs; `ends` are those on the femur, then those on the tibia.
fn on_one_bone(path: &str, ends: &[Point], bones: &Bones) -> Option<Notice> {
    let (femur, tibia) = ends.split_at(ends.len() / 2);
    let far = |on: &SurfaceQuery, of: &[Point]| off(of, |p| *p, |_, p| on.nearest(p).distance);
    let both = [("femur", far(&bones.femur, femur)), ("tibia", far(&bones.tibfib, tibia))];
    let (bone, mm) = both.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (mm > ONE_BONE_MM * bones.scale && femur.len() >= FEWEST).then(|| {
        Kind::FibresOffBones
            .notice(format!(
                "{path}: its points on the {bone} lie {mm:.1} mm off that bone's surface in the median, expected within {:.1}: a shift, or points of another surface?",
                ONE_BONE_MM * bones.scale
            ))
            .file(path)
            .of(bone)
    })
}

/// Names the fibres of which one end lies far off its bone.
fn single(path: &str, fibres: &[Fibre], bones: &Bones, warnings: &mut Vec<Notice>) {
    let ends = fibres.iter().flat_map(|f| [(f, "femur", &bones.femur, f.femur), (f, "tibia", &bones.tibfib, f.tibia)]);
    let off: Vec<(&Fibre, &str, f64)> = ends.map(|(f, name, bone, p)| (f, name, bone.nearest(&p).distance)).collect();
    let mut others: Vec<f64> = off.iter().map(|(_, _, far)| *far).collect();
    let alone = (ALONE * percentile(&mut others, MOST_ENDS)).max(ALONE_MM * bones.scale);
    let limit = if fibres.len() > FEWEST { alone.min(OFF_MM * bones.scale) } else { OFF_MM * bones.scale };
    let lost: Vec<String> = off
        .iter()
        .filter(|(_, _, far)| *far > limit)
        .map(|(f, name, far)| format!("{} {} ({far:.0} mm off the {name})", f.bundle, f.fibre))
        .collect();
    if !lost.is_empty() {
        let shown = lost.iter().take(5).cloned().collect::<Vec<_>>().join(", ");
        warnings.push(
            Kind::FibreEndsOffBone
                .notice(format!("{path}: {} ends of fibres lie off their bone: {shown}", lost.len()))
                .file(path)
                .count(lost.len()),
        );
    }
}

/// Holds landmarks or marks, as `what` says, against the surfaces of their frames.
///
/// # Errors
/// Points in another unit or frame, or with columns exchanged.
pub(super) fn points(
    (path, what): (&str, &str),
    all: &[NamedPoint],
    bones: &Bones,
    scans: &PerBone<ColouredMesh>,
    warnings: &mut Vec<Notice>,
) -> Result<(), StageError> {
    let scan = |mesh: &ColouredMesh| SurfaceQuery::new(&mesh.mesh).filter(|_| !mesh.mesh.triangles.is_empty());
    let (femur, tibfib) = (scan(&scans.femur), scan(&scans.tibfib));
    let one = |query: &Option<SurfaceQuery>, p: &Point| query.as_ref().map_or(0.0, |q| q.nearest(p).distance);
    let own = |frame: PointFrame, p: &Point| match frame {
        PointFrame::Ct => bones.nearest(p),
        PointFrame::ScanFemur => one(&femur, p),
        PointFrame::ScanTibfib => one(&tibfib, p),
    };
    for (frame, name) in
        [(PointFrame::Ct, "ct"), (PointFrame::ScanFemur, "scan_femur"), (PointFrame::ScanTibfib, "scan_tibfib")]
    {
        let near: Vec<Point> =
            all.iter().filter(|p| p.frame == frame && space::of_knee(&p.name)).map(|p| p.point).collect();
        let distance = |_: usize, p: &Point| own(frame, p);
        let whose = format!("the {what} of frame {name}");
        if let Some(what) = one_place(&near, bones.scale).map(|_| shrunk(&near, bones.scale, distance)) {
            return Err(StageError::file(
                path,
                format_args!("{whose} lie within {SHORTEST_MM} mm of each other; {what}"),
            ));
        }
        let far = if near.is_empty() { 0.0 } else { off(&near, |p| *p, distance) };
        if let Some(what) = of_one_bone(&near, bones.scale, distance) {
            return Err(StageError::file(path, format_args!("of {whose} {what}")));
        }
        if far <= OFF_MM * bones.scale {
            if far > TOLD_MM * bones.scale {
                warnings.push(Kind::PointsOffSurface.notice(format!(
                    "{path}: {whose} lie {far:.1} mm off its surfaces in the median, expected within {:.1}: check their frame (a shift?) and unit",
                    TOLD_MM * bones.scale
                )).file(path));
            }
            continue;
        }
        let others = [PointFrame::Ct, PointFrame::ScanFemur, PointFrame::ScanTibfib];
        let other = others.iter().filter(|_| near.len() >= FEWEST).find(|o| {
            **o != frame && off(&near, |p| *p, |_, p| own(**o, p)) < (MENDED_SHARE * far).min(MENDED_MM * bones.scale)
        });
        let what = match other {
            Some(o) => format!("they lie on the surfaces of frame {}: correct the column frame", frame_name(*o)),
            None => match cause(&near, far, bones.scale, distance).filter(|_| near.len() >= FEWEST) {
                Some(what) => what,
                None => {
                    warnings.push(Kind::PointsOffSurface.notice(format!(
                        "{path}: {whose} lie {far:.0} mm off its surfaces in the median: check the column frame, and the unit (mm)"
                    )).file(path));
                    continue;
                }
            },
        };
        return Err(StageError::file(
            path,
            format_args!("{whose} lie {far:.0} mm off its surfaces in the median; {what}"),
        ));
    }
    Ok(())
}

/// The cause of points of which some lie on their surface and some far off it: those of one bone, whose own columns may be exchanged.
fn of_one_bone(near: &[Point], scale: f64, distance: impl Fn(usize, &Point) -> f64) -> Option<String> {
    let lost: Vec<Point> = near.iter().filter(|p| distance(0, p) > OFF_MM * scale).copied().collect();
    let some = lost.len() >= FEWEST && lost.len() < near.len();
    let far = some.then(|| off(&lost, |p| *p, &distance))?;
    let what = cause(&lost, far, scale, &distance)?;
    Some(format!(
        "{} of {} lie {far:.0} mm off the surfaces in the median and the others on them; the {}",
        lost.len(),
        near.len(),
        what.replacen("they", "first", 1)
    ))
}

fn frame_name(frame: PointFrame) -> &'static str {
    match frame {
        PointFrame::Ct => "ct",
        PointFrame::ScanFemur => "scan_femur",
        PointFrame::ScanTibfib => "scan_tibfib",
    }
}

/// Whether several points lie in one place, as those of another unit do.
fn one_place(points: &[Point], scale: f64) -> Option<()> {
    let first = points.first().filter(|_| points.len() > 1)?;
    points.iter().all(|p| (p - first).norm() < SHORTEST_MM * scale).then_some(())
}

/// Holds the patella against the femur: near, and not inside.
///
/// # Errors
/// A patella in another frame.
pub(super) fn patella(given: &Patella, bones: &Bones, warnings: &mut Vec<Notice>) -> Result<(), StageError> {
    let vertices = &given.ct.vertices;
    let gap = |change: &dyn Fn(&Point) -> Point| {
        vertices
            .iter()
            .step_by(vertices.len() / 2000 + 1)
            .map(|p| bones.femur.nearest(&change(p)).distance)
            .fold(f64::INFINITY, f64::min)
    };
    let far = gap(&|p| *p);
    let inside = vertices.iter().filter(|p| bones.femur.signed_distance(p) < -SHORTEST_MM * bones.scale).count();
    if inside as f64 > PATELLA_INSIDE * vertices.len() as f64 {
        warnings.push(Kind::PatellaInFemur.notice(format!(
            "ct.patella: {:.0} % of it lies inside the femur: check that it is in the frame of the other bones of [ct]",
            100.0 * inside as f64 / vertices.len() as f64
        )).of("patella"));
    }
    if far <= PATELLA_MM * bones.scale {
        return Ok(());
    }
    let turned = TURNS
        .iter()
        .find(|(signs, _)| gap(&|p| Point::from(p.coords.component_mul(&Vector::from(*signs)))) < MENDED_SHARE * far);
    match turned {
        Some((_, what)) => {
            Err(StageError::Knee(format!("the patella of [ct] lies {far:.0} mm from the femur; it is {what}")))
        }
        None => {
            warnings.push(
                Kind::PatellaFar
                    .notice(format!(
                        "ct.patella lies {far:.0} mm from the femur, expected within {:.0}: check its frame and unit",
                        PATELLA_MM * bones.scale
                    ))
                    .of("patella"),
            );
            Ok(())
        }
    }
}
