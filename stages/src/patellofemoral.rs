//! The patellofemoral joint of a knee: the patella, its articular face, the trochlea's groove, patellar tendon, retinacula, quadriceps.
//!
//! Lengths of what CT and MRI do not show are shares of the transepicondylar width. The model and its sources: docs/theory/patellofemoral.md.

mod generic;
mod measured;
mod trochlea;

use crate::StageError;
use crate::bones::Bones;
use crate::cartilage::Cartilage;
use crate::frames::Frames;
use crate::specimen::{PointFrame, Specimen};
use meshes::Point;
use meshes::frame::AnatomicalFrame;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use sim::spec::{
    AxisSpec, BandSpec, EndsSpec, HeadSpec, PatellaContactSpec, PatellaSource, PatellaSpec, QuadricepsSpec,
};
use trochlea::Trochlea;

/// Which patella a model gets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PatellaChoice {
    /// None that acts.
    #[default]
    Off,
    /// The knee's own, as CT or MRI shows it.
    On,
    /// One of mean shape, scaled to the knee and laid on its trochlea.
    Generic,
}

/// Numbers of the patellofemoral joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PatellaOptions {
    /// Stiffness of the patellar tendon [N/mm] [obrien2010].
    pub tendon_n_per_mm: f64,
    /// Stiffness of the medial patellofemoral ligament [N/mm]; ours.
    pub mpfl_n_per_mm: f64,
    /// Stiffness of the lateral retinaculum [N/mm]; ours.
    pub lateral_n_per_mm: f64,
    /// Ratio of length to slack length of both in the CT pose [-]; ours: they are slack in the middle.
    pub retinacular_strain: f64,
    /// Toe strain of tendon and retinacula [-]; as that of every bundle.
    pub toe_strain: f64,
    /// Thickness of the patella's cartilage where only its bone is seen, at its thickest [mm] [saoa2013].
    pub cartilage_mm: f64,
}

impl Default for PatellaOptions {
    fn default() -> Self {
        PatellaOptions {
            tendon_n_per_mm: 1050.0,
            mpfl_n_per_mm: 20.0,
            lateral_n_per_mm: 20.0,
            retinacular_strain: 0.98,
            toe_strain: 0.03,
            cartilage_mm: 4.1,
        }
    }
}

/// The patella of a model and the surfaces it names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Patellofemoral {
    /// As model.json has it.
    pub spec: PatellaSpec,
    /// Its articular face: open patch, outward normals, CT frame.
    pub face: TriMesh,
    /// The bone above the trochlea that it lies on in extension.
    pub ground: TriMesh,
    /// A closed surface to be seen, where the knee's own is not there.
    pub seen: Option<TriMesh>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: PatellaMetrics,
}

/// What a patella's geometry tells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PatellaMetrics {
    /// Whether it is the knee's own.
    pub source: PatellaSource,
    /// Its width [mm].
    pub width_mm: f64,
    /// Its height [mm].
    pub height_mm: f64,
    /// Mean length of the patellar tendon's fibres [mm].
    pub tendon_mm: f64,
    /// That length over the height [-].
    pub insall_salvati: f64,
    /// Area of the articular face [mm2].
    pub articular_area_mm2: f64,
    /// Least distance to the trochlea in the CT pose [mm]; below 0 they overlap.
    pub gap_min_mm: f64,
    /// Radius of the trochlea's groove [mm].
    pub groove_radius_mm: f64,
}

/// A patella laid on a knee.
pub(crate) struct Shape {
    pub(crate) frame: AnatomicalFrame,
    /// Articular face.
    pub(crate) face: TriMesh,
    /// Closed surface to be seen, where the knee's own is not there.
    pub(crate) seen: Option<TriMesh>,
    /// Width and height [mm].
    pub(crate) size: [f64; 2],
    /// Its front at the middle, ahead of the frame's origin [mm].
    pub(crate) front: f64,
    pub(crate) source: PatellaSource,
}

/// What the patella is laid on.
pub(crate) struct Ground<'a> {
    pub(crate) frames: &'a Frames,
    /// Articular face of the femur.
    pub(crate) trochlear_face: &'a TriMesh,
    pub(crate) trochlea: Trochlea,
    /// Transepicondylar width [mm].
    pub(crate) width: f64,
    /// The middle of the tibial tuberosity.
    pub(crate) tuberosity: Point,
    /// Whether the femur's frame points to the femoral head; else along the shaft.
    pub(crate) mechanical: bool,
}

/// The patellofemoral joint of a knee; `None` where none is asked for. The law is that of the knee's contact.
///
/// # Errors
/// A patella that is asked for and was not seen; a trochlea without cartilage.
pub fn patellofemoral(
    choice: PatellaChoice,
    (specimen, frames, bones): (&Specimen, &Frames, &Bones),
    (cartilage, trochlear_face): (&Cartilage, &TriMesh),
    law: (&[f64], &[f64]),
    options: &PatellaOptions,
) -> Result<Option<Patellofemoral>, StageError> {
    if choice == PatellaChoice::Off {
        return Ok(None);
    }
    let [medial, lateral] = frames.epicondyles;
    let width = (medial - lateral).norm();
    let trochlea = trochlea::trochlea(trochlear_face, &frames.femur, width)?;
    let tuberosity = tuberosity(specimen, &bones.surfaces.tibfib, &frames.tibia, width)?;
    let mechanical = specimen.landmarks.iter().any(|l| l.name == "femoral_head_center");
    let ground = Ground { frames, trochlear_face, trochlea, width, tuberosity, mechanical };
    let shape = match choice {
        PatellaChoice::Generic => generic::shape(&ground)?,
        _ => {
            let bone = bones.patella.as_ref().or(cartilage.bodies.get("patella"));
            let bone = bone.ok_or_else(|| {
                StageError::Knee(
                    "assemble.patella is on, but neither CT nor MRI shows a patella: give ct.patella or the label patella, or choose assemble.patella = \"generic\", one of mean shape scaled to this knee".into(),
                )
            })?;
            measured::shape(bone, cartilage.bodies.get("patellar_cartilage"), &ground, options)?
        }
    };
    laid(shape, &ground, &bones.surfaces.femur, law, options).map(Some)
}

/// The specification of a patella that lies on its ground.
fn laid(
    shape: Shape,
    ground: &Ground,
    femur: &TriMesh,
    (overclosure, pressure): (&[f64], &[f64]),
    options: &PatellaOptions,
) -> Result<Patellofemoral, StageError> {
    let tendon = tendon(&shape, ground, options);
    let spec = PatellaSpec {
        source: shape.source,
        frame: shape.frame,
        contact: PatellaContactSpec {
            femur: "contact/femur.ply".into(),
            patella: "contact/patella.ply".into(),
            bone: Some("contact/patella_ground.ply".into()),
            overclosure_mm: overclosure.to_vec(),
            pressure_mpa: pressure.to_vec(),
        },
        retinacula: retinacula(&shape, ground, options),
        quadriceps: quadriceps(&shape, ground),
        tendon,
    };
    let gap = gap(&shape.face, &shape.frame, ground)?;
    let mean =
        |b: &BandSpec| b.fibres.iter().map(|f| (f.patella - f.far).norm()).sum::<f64>() / b.fibres.len().max(1) as f64;
    let length = mean(&spec.tendon);
    let metrics = PatellaMetrics {
        source: spec.source,
        width_mm: shape.size[0],
        height_mm: shape.size[1],
        tendon_mm: length,
        insall_salvati: length / shape.size[1],
        articular_area_mm2: shape.face.area(),
        gap_min_mm: gap,
        groove_radius_mm: ground.trochlea.radius,
    };
    Ok(Patellofemoral {
        warnings: warnings(gap, length / shape.size[1]),
        spec,
        face: shape.face,
        ground: support(femur, ground),
        seen: shape.seen,
        metrics,
    })
}

/// How far ahead of a patella's face its gap is sought from [mm].
const AHEAD_MM: f64 = 20.0;

/// Least distance from the patella's face to the trochlea, backwards [mm]; infinite where it lies before no cartilage.
pub(crate) fn gap(face: &TriMesh, frame: &AnatomicalFrame, ground: &Ground) -> Result<f64, StageError> {
    let query = SurfaceQuery::new(ground.trochlear_face)
        .ok_or_else(|| StageError::part("patella", "the femur's articular face has no triangles"))?;
    let behind = |p: &Point| {
        let hit = query.ray(&(p + frame.anterior * AHEAD_MM), &-frame.anterior, 2.0 * AHEAD_MM);
        hit.map(|hit| hit.distance - AHEAD_MM)
    };
    Ok(face.vertices.iter().filter_map(behind).fold(f64::INFINITY, f64::min))
}

/// Least cosine at which bone looks forwards [-].
const LOOKS_FORWARD: f64 = 0.3;

/// The bone of the femur that a patella above the trochlea lies on: what looks forwards above the groove's middle.
fn support(femur: &TriMesh, ground: &Ground) -> TriMesh {
    let frame = &ground.frames.femur;
    let normals = femur.triangle_normals();
    let above = |t: usize| femur.corners(t).iter().all(|p| (p - ground.trochlea.centre).dot(&frame.superior) > 0.0);
    femur.submesh(|t| normals[t].dot(&frame.anterior) > LOOKS_FORWARD && above(t)).0
}

/// Least gap to the trochlea that is usual, and greatest [mm]; ours.
const GAPS: [f64; 2] = [-1.5, 6.0];
/// Ratio of tendon to patella that is not unusual: patella baja to alta [-] [insall1971].
const INSALL_SALVATI: [f64; 2] = [0.7, 1.4];

/// What is odd about a patella.
fn warnings(gap: f64, ratio: f64) -> Vec<Notice> {
    let mut out = Vec::new();
    if !(GAPS[0]..=GAPS[1]).contains(&gap) {
        out.push(Kind::PatellaGap.notice(format!(
            "patella: the least gap to the trochlea is {gap:.1} mm in the CT pose, expected {} to {}: is it where the femur is?",
            GAPS[0], GAPS[1]
        )).of("patella"));
    }
    if !(INSALL_SALVATI[0]..=INSALL_SALVATI[1]).contains(&ratio) {
        out.push(Kind::TendonLength.notice(format!(
            "patella: the tendon is {ratio:.2} times as long as the patella, usual are {} to {}; a landmark tibial_tuberosity would correct a tuberosity wrongly found",
            INSALL_SALVATI[0], INSALL_SALVATI[1]
        )).of("patella"));
    }
    out
}

/// Where the tuberosity is sought below the tibial origin, of the transepicondylar width [-].
const TUBEROSITY_DEPTH: [f64; 2] = [0.2, 0.7];
/// Height of a slice of the tibia's front [mm].
const SLICE_MM: f64 = 2.0;

/// The middle of the tibial tuberosity: a landmark, or what stands out furthest from a straight line along the tibia's front.
fn tuberosity(specimen: &Specimen, tibfib: &TriMesh, tibia: &AnatomicalFrame, width: f64) -> Result<Point, StageError> {
    let named = specimen.landmarks.iter().find(|l| l.name == "tibial_tuberosity" && l.frame == PointFrame::Ct);
    if let Some(landmark) = named {
        return Ok(landmark.point);
    }
    let [least, most] = TUBEROSITY_DEPTH.map(|x| x * width);
    let ahead = |p: &Point| (p - tibia.origin).dot(&tibia.anterior);
    let mut front: Vec<Option<Point>> = vec![None; ((most - least) / SLICE_MM) as usize];
    for p in &tibfib.vertices {
        let depth = -(p - tibia.origin).dot(&tibia.superior);
        let slice = ((depth - least) / SLICE_MM).floor();
        if slice >= 0.0
            && let Some(most) = front.get_mut(slice as usize)
            && most.is_none_or(|q| ahead(p) > ahead(&q))
        {
            *most = Some(*p);
        }
    }
    let front: Vec<Point> = front.into_iter().flatten().collect();
    let (Some(high), Some(low)) = (front.first(), front.last()) else {
        return Err(StageError::part(
            "patella",
            "the tibia is cut above its tuberosity; give a landmark tibial_tuberosity in the CT frame",
        ));
    };
    let chord = (low - high).try_normalize(0.0).unwrap_or(-tibia.superior);
    let out = tibia.anterior - chord * chord.dot(&tibia.anterior);
    let above = |p: &Point| (p - high).dot(&out);
    Ok(*front.iter().max_by(|p, q| above(p).total_cmp(&above(q))).unwrap_or(high))
}

/// Half of the tendon's breadth at the outermost of its fibres, of the patella's width [-]; and at the tuberosity.
const TENDON_HALF: [f64; 2] = [0.22, 0.16];

/// Three fibres from about the apex to the tuberosity.
fn tendon(shape: &Shape, ground: &Ground, options: &PatellaOptions) -> BandSpec {
    let [width, height] = shape.size;
    let f = &shape.frame;
    let fibre = |side: f64| EndsSpec {
        patella: f.origin
            + f.superior * ((-0.5 + 0.06 * side * side) * height)
            + f.medial * (side * TENDON_HALF[0] * width),
        far: ground.tuberosity + ground.frames.tibia.medial * (side * TENDON_HALF[1] * width),
    };
    BandSpec {
        name: "patellar_tendon".into(),
        stiffness_n_per_mm: options.tendon_n_per_mm,
        reference_strain: 1.0,
        toe_strain: options.toe_strain,
        fibres: [-1.0, 0.0, 1.0].map(fibre).into(),
    }
}

/// The medial patellofemoral ligament and the lateral retinaculum: from the upper half of either border to the axis of the trochlea's groove,
/// beside the condyles. So their length hardly changes with flexion, as that of the true ones, which wrap over the condyles on their way to the
/// epicondyles [schoettle2007], and a shift aside stretches them.
fn retinacula(shape: &Shape, ground: &Ground, options: &PatellaOptions) -> Vec<BandSpec> {
    let [width, height] = shape.size;
    let (f, femur) = (&shape.frame, &ground.frames.femur);
    let beside = |side: f64| ground.trochlea.centre + femur.medial * (side * 0.5 * ground.width);
    [
        ("mpfl", options.mpfl_n_per_mm, 1.0, beside(1.0)),
        ("lateral_retinaculum", options.lateral_n_per_mm, -1.0, beside(-1.0)),
    ]
    .into_iter()
    .map(|(name, stiffness, side, far)| BandSpec {
        name: name.into(),
        stiffness_n_per_mm: stiffness,
        reference_strain: options.retinacular_strain,
        toe_strain: options.toe_strain,
        fibres: [0.05, 0.3]
            .map(|up| EndsSpec {
                patella: f.origin + f.medial * (side * 0.46 * width) + f.superior * (up * height),
                far,
            })
            .into(),
    })
    .collect()
}

/// A head of the quadriceps: name, share of the tension [-], lateral and posterior lean against the shaft [deg], and place on the patella, of
/// half its width lateral and half its height up [-]. Shares and leans in the frontal plane [farahmand1998]; the oblique heads lean backwards
/// as well [merican2009].
const HEADS: [(&str, f64, [f64; 2], [f64; 2]); 5] = [
    ("rectus_femoris_vastus_intermedius", 0.35, [0.0, 0.0], [0.0, 0.95]),
    ("vastus_lateralis_longus", 0.33, [14.0, 0.0], [0.35, 0.85]),
    ("vastus_lateralis_obliquus", 0.09, [35.0, 33.0], [0.75, 0.5]),
    ("vastus_medialis_longus", 0.14, [-15.0, 0.0], [-0.35, 0.85]),
    ("vastus_medialis_obliquus", 0.09, [-47.0, 44.0], [-0.8, 0.4]),
];
/// Length of a head's line from the patella to where the femur carries it, of the transepicondylar width [-]; the oblique ones'.
const HEAD_LENGTHS: [f64; 2] = [3.0, 1.2];

/// How far the shaft leans outwards against the axis to the femoral head [deg]; common.
const SHAFT_DEG: f64 = 6.0;

/// The middle of the quadriceps' tendon runs this far above the groove on which the tendon lies: half its thickness [mm]
/// [staeubli1999].
const HALF_TENDON_MM: f64 = 4.0;

fn quadriceps(shape: &Shape, ground: &Ground) -> QuadricepsSpec {
    let (f, frame) = (&shape.frame, &ground.frames.femur);
    let [width, height] = shape.size;
    let lean = if ground.mechanical { SHAFT_DEG.to_radians() } else { 0.0 };
    let shaft = frame.superior * lean.cos() - frame.medial * lean.sin();
    let medial = (frame.medial - shaft * frame.medial.dot(&shaft)).normalize();
    let anterior = (frame.anterior - shaft * frame.anterior.dot(&shaft)).normalize();
    let head = |(name, share, [lateral, back], [x, z]): (&str, f64, [f64; 2], [f64; 2])| {
        let (a, b) = (lateral.to_radians(), back.to_radians());
        let way = (shaft - medial * a.tan() - anterior * b.tan()).normalize();
        let length = ground.width * if back > 0.0 { HEAD_LENGTHS[1] } else { HEAD_LENGTHS[0] };
        let patella = f.origin - f.medial * (x * 0.5 * width)
            + f.superior * (z * 0.5 * height)
            + f.anterior * (0.4 * shape.front);
        HeadSpec { name: name.into(), share, patella, femur: patella + way * length }
    };
    QuadricepsSpec {
        heads: HEADS.map(head).into(),
        wrap: AxisSpec { point: ground.trochlea.centre, direction: frame.medial },
        wrap_radius_mm: ground.trochlea.radius + HALF_TENDON_MM,
    }
}
