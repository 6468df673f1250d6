//! Stage 6, attachments: sites of the ligaments and the fibres between them.

use super::layers::bone_layers;
use super::{Files, Stage, Values, Work, reported};
use crate::kept::Kept;
use crate::options::BuildOptions;
use crate::record::json;
use crate::report::check::Check;
use crate::report::geometry::Pool;
use crate::report::picture::{BONE, Picture, picture};
use crate::report::scene::{Layer, Scene, at, plain, word};
use attachments::site::Source;
use meshes::render::{Painted, tube};
use meshes::surface::TriMesh;
use serde_json::{Value, json as object};
use stages::StageError;
use stages::attachments::{Attachments, AttachmentsOptions, attachments};
use stages::bones::Bones;
use stages::cartilage::Cartilage;
use stages::frames::Frames;
use stages::register::Registration;
use stages::specimen::Specimen;
use std::collections::BTreeSet;
use std::io;

reported!(Attachments);

/// The stage.
pub(crate) struct Attach;

impl Stage for Attach {
    const NUMBER: &'static str = "06";
    const NAME: &'static str = "attachments";
    const TELLING: &'static [&'static str] = &["sites_marked", "sites_literature", "sites_given", "fibres"];
    const LOOK: Option<&'static str> = Some("Does every site lie where the ligament attaches?");
    /// The registration is left out for cartilage that lies where its bones lie.
    type Inputs<'a> =
        (&'a Kept<Specimen>, Option<&'a Kept<Registration>>, &'a Kept<Bones>, &'a Kept<Cartilage>, &'a Kept<Frames>);
    type Options = AttachmentsOptions;
    type Value = Attachments;
    type Fault = StageError;

    fn options(all: &BuildOptions) -> &AttachmentsOptions {
        &all.attachments
    }

    fn run(
        (s, r, b, c, f): Self::Inputs<'_>,
        options: &AttachmentsOptions,
        _: &Work,
    ) -> Result<Attachments, StageError> {
        match r {
            Some(r) => attachments(s, r, b, c, f, options),
            None => attachments(s, &Registration::left_out(), b, c, f, options),
        }
    }

    /// sites.json, fibres.csv.
    fn artifacts(a: &Attachments, _: Self::Inputs<'_>) -> Files {
        let sites: Vec<Value> = a
            .sites
            .iter()
            .map(|s| {
                object!({"ligament": s.ligament, "bone": s.bone, "centroid": s.centroid, "area_mm2": s.area_mm2,
                         "source": s.source, "projection_mm": s.projection_mm, "region": s.region})
            })
            .collect();
        let mut out = csv::Writer::from_writer(Vec::new());
        let header = "bundle,fibre,femur_x_mm,femur_y_mm,femur_z_mm,tibia_x_mm,tibia_y_mm,tibia_z_mm,source";
        out.write_record(header.split(','))?;
        for f in &a.fibres {
            let mut row = vec![f.bundle.clone(), f.fibre.to_string()];
            row.extend(f.femur.iter().chain(f.tibia.iter()).map(|x| format!("{x:.4}")));
            row.push(serde_json::to_value(f.source)?.as_str().unwrap_or_default().into());
            out.write_record(&row)?;
        }
        let table = out.into_inner().map_err(|e| io::Error::other(e.to_string()))?;
        Ok(vec![("sites.json".into(), json(&sites)), ("fibres.csv".into(), table)])
    }

    fn scene(v: &Values, pool: &mut Pool) -> Option<Scene> {
        let a = v.of::<Attachments>()?;
        let mut layers = bone_layers(v, pool, 1.0);
        let names: std::collections::BTreeSet<&str> = a.fibres.iter().map(|f| f.bundle.as_str()).collect();
        for name in names {
            let of_bundle: Vec<_> = a.fibres.iter().filter(|f| f.bundle == name).collect();
            let source = of_bundle[0].source;
            layers.push(Layer {
                name: format!("{name} ({})", word(source)),
                colour: match source {
                    Source::Marked => "#c8102e",
                    Source::Literature => "#1f4fd8",
                    Source::Given => "#1a7f37",
                },
                lines: of_bundle.iter().flat_map(|f| [at(pool, &f.femur), at(pool, &f.tibia)]).collect(),
                opacity: 1.0,
                on: true,
                ..Layer::default()
            });
        }
        layers.push(Layer {
            name: "sites: regions".into(),
            colour: "#111111",
            points: a.sites.iter().flat_map(|s| s.region.iter().map(|p| at(pool, p)).collect::<Vec<_>>()).collect(),
            opacity: 1.0,
            on: true,
            ..Layer::default()
        });
        layers.push(Layer {
            name: "sites: middles, named".into(),
            colour: "#e69f00",
            points: a.sites.iter().map(|s| at(pool, &s.centroid)).collect(),
            labels: a
                .sites
                .iter()
                .map(|s| {
                    format!("{} {} ({})", s.ligament, plain(&format!("{:?}", s.bone).to_lowercase()), word(s.source))
                })
                .collect(),
            opacity: 1.0,
            on: true,
            ..Layer::default()
        });
        layers.extend(marks(v, pool));
        let count = |source| a.sites.iter().filter(|s| s.source == source).count();
        Some(Scene {
            id: "attachments".into(),
            title: "Marks, sites and fibres".into(),
            text: format!(
                "{} fibres between {} sites: {} marked on the specimen (red), {} placed from the literature (blue), {} given (green). Every region must lie on its mark. No fibre may pass through bone.",
                a.fibres.len(),
                a.sites.len(),
                count(Source::Marked),
                count(Source::Literature),
                count(Source::Given)
            ),
            from: "behind",
            layers,
            moves: false,
        })
    }

    fn stills(v: &Values) -> Option<Vec<Picture>> {
        let (bones, frames, attachments) = (v.of::<Bones>()?, v.of::<Frames>()?, v.of::<Attachments>()?);
        let mut parts: Vec<(TriMesh, [u8; 3])> =
            bones.surfaces.named().map(|(_, mesh)| (mesh.clone(), BONE)).into_iter().collect();
        parts.extend(fibre_tubes(attachments));
        let painted: Vec<Painted> =
            parts.iter().map(|(mesh, c)| Painted { mesh, colours: std::slice::from_ref(c) }).collect();
        let f = &frames.tibia;
        Some(
            [
                ("the front", f.anterior),
                ("behind", -f.anterior),
                ("the medial side", f.medial),
                ("the lateral side", -f.medial),
            ]
            .map(|(from, eye)| {
                picture(
                    &painted,
                    eye,
                    f.superior,
                    format!("Ligament fibres from {from}: marked red, literature blue, given green"),
                )
            })
            .into_iter()
            .collect(),
        )
    }

    fn checks(v: &Values) -> Vec<Check> {
        let Some(a) = v.of::<Attachments>() else { return vec![] };
        let count = |source| a.sites.iter().filter(|s| s.source == source).count();
        let mut out = vec![Check {
            question: "Where do the ligament sites come from?",
            answer: format!(
                "{} marked on the specimen, {} literature, {} given",
                count(Source::Marked),
                count(Source::Literature),
                count(Source::Given)
            ),
            good: None,
            reaches: None,
            model: None,
            stage: Self::NAME,
        }];
        out.extend(through_bone(a, v.options.attachments.crossing_limit_mm));
        out
    }
}

/// How deep bundles run in bone, against the limit.
fn through_bone(a: &Attachments, limit: f64) -> Option<Check> {
    let depths = &a.metrics.through_bone_mm;
    let (bundle, most) = depths.iter().max_by(|a, b| a.1.total_cmp(b.1))?;
    let deep = depths.values().filter(|d| **d > limit).count();
    let bundles: BTreeSet<&str> = a.fibres.iter().map(|f| f.bundle.as_str()).collect();
    Some(Check {
        question: "Do the fibres keep clear of bone?",
        answer: format!(
            "{deep} of {} bundles run deeper in bone than {limit:.1} mm; the deepest is {bundle}, {most:.2} mm",
            bundles.len()
        ),
        good: Some(deep == 0),
        reaches: None,
        model: None,
        stage: Attach::NAME,
    })
}

/// The marks as they were measured, on the registered bones.
fn marks(v: &Values, pool: &Pool) -> Option<Layer> {
    let (specimen, registration) = (v.of::<Specimen>()?, v.of::<Registration>()?);
    if specimen.marks.is_empty() {
        return None;
    }
    let place = |m: &stages::specimen::NamedPoint| match m.frame {
        stages::specimen::PointFrame::Ct => m.point,
        stages::specimen::PointFrame::ScanFemur => registration.bones.femur.ct_from_scan.point(&m.point),
        stages::specimen::PointFrame::ScanTibfib => registration.bones.tibfib.ct_from_scan.point(&m.point),
    };
    Some(Layer {
        name: "marks as measured".into(),
        colour: "#e69f00",
        points: specimen.marks.iter().map(|m| at(pool, &place(m))).collect(),
        labels: specimen.marks.iter().map(|m| m.name.clone()).collect(),
        opacity: 1.0,
        on: false,
        ..Layer::default()
    })
}

/// Fibres as tubes, each in the colour of its source.
pub(super) fn fibre_tubes(attachments: &Attachments) -> Vec<(TriMesh, [u8; 3])> {
    attachments
        .fibres
        .iter()
        .map(|f| {
            let c = match f.source {
                Source::Marked => [200, 40, 40],
                Source::Literature => [40, 90, 200],
                Source::Given => [40, 150, 60],
            };
            (tube(&f.femur, &f.tibia, 0.7), c)
        })
        .collect()
}
