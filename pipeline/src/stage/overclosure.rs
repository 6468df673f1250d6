//! Stage 8, overclosure: overlap of the cartilages taken out.

use super::artifacts::hexes;
use super::{Files, Stage, Values, Work, hexahedra, reported};
use crate::kept::Kept;
use crate::options::BuildOptions;
use crate::report::check::{self, Check, KeyFigure};
use crate::report::geometry::{Pool, packed_values};
use crate::report::picture::Picture;
use crate::report::scene::{Layer, Scalar, Scene, plain};
use meshes::gap::ContactFace;
use meshes::surface::TriMesh;
use stages::StageError;
use stages::hexmesh::HexCartilage;
use stages::overclosure::{OverclosureOptions, Separated, overclosure};

reported!(Separated);

/// The stage.
pub(crate) struct Overclosure;

impl Stage for Overclosure {
    const NUMBER: &'static str = "08";
    const NAME: &'static str = "overclosure";
    const TELLING: &'static [&'static str] = &["max_overclosure_before_mm", "gap_min_mm", "iterations"];
    type Inputs<'a> = (&'a Kept<HexCartilage>,);
    type Options = OverclosureOptions;
    type Value = Separated;
    type Fault = StageError;

    fn options(all: &BuildOptions) -> &OverclosureOptions {
        &all.overclosure
    }

    fn run((hexes,): Self::Inputs<'_>, options: &OverclosureOptions, _: &Work) -> Result<Separated, StageError> {
        overclosure(hexes, options)
    }

    /// Hexahedra with their scaled Jacobian.
    fn artifacts(s: &Separated, _: Self::Inputs<'_>) -> Files {
        hexes(s.meshes.named())
    }

    fn scene(v: &Values, pool: &mut Pool) -> Option<Scene> {
        let (before, after) = (v.of::<HexCartilage>()?, v.of::<Separated>()?);
        let (mut layers, mut words) = (Vec::new(), String::new());
        for (when, meshes) in [("before", &before.meshes), ("after", &after.meshes)] {
            let femur = ContactFace::new(&meshes.femur.nodes, &meshes.femur.articular_quads)?;
            for (name, mesh) in [("tibia_medial", &meshes.tibia_medial), ("tibia_lateral", &meshes.tibia_lateral)] {
                let triangles = mesh.articular_quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
                let (face, _) = TriMesh { vertices: mesh.nodes.clone(), triangles }.submesh(|_| true);
                let gaps: Vec<f64> = face.vertices.iter().map(|p| femur.gap(p).map_or(2.0, |g| g.gap)).collect();
                let least = gaps.iter().copied().fold(2.0, f64::min);
                words += &format!(" {} {when}: {least:.2} mm.", plain(name));
                let key = format!("gap {when} {name}");
                pool.keep(&key, &face);
                layers.push(Layer {
                    name: format!("{}: gap {when}", plain(name)),
                    mesh: Some(key),
                    opacity: 1.0,
                    scalar: Some(Scalar {
                        values: packed_values(&gaps, -2.0, 2.0),
                        low: -2.0,
                        high: 2.0,
                        title: "gap mm",
                        scale: "gap",
                        cells: false,
                    }),
                    on: when == "after",
                    one_of: Some(if name == "tibia_medial" { "medial" } else { "lateral" }),
                    ..Layer::default()
                });
            }
        }
        layers.extend(hexahedra::scene(Self::NAME, &after.meshes, pool).layers.into_iter().map(|l| Layer {
            on: false,
            name: format!("{} after", l.name),
            ..l
        }));
        Some(Scene {
            id: "overclosure".into(),
            title: "Overclosure before and after".into(),
            text: format!(
                "Tibial articular faces coloured by the gap to the femoral face: red where they overlap (below 0), blue where they are apart; 2 mm stands for farther. Smallest gaps:{words} Nothing may be red after."
            ),
            from: "above",
            layers,
            moves: false,
        })
    }

    fn stills(v: &Values) -> Option<Vec<Picture>> {
        hexahedra::stills(v, v.of::<Separated>()?.meshes.named())
    }

    fn key_figure(v: &Values) -> Option<KeyFigure> {
        let (worst, limit) = (smallest_jacobian(v.of()?), v.options.hexmesh.least_scaled_jacobian);
        Some(KeyFigure {
            name: "smallest scaled Jacobian of an element",
            value: format!("{worst:.2}"),
            limit: format!("must exceed {limit:.1}; 1 is a cube"),
            good: Some(!check::at_most(worst, limit, 2)),
        })
    }

    fn checks(v: &Values) -> Vec<Check> {
        let Some(h) = v.of::<Separated>() else { return vec![] };
        let worst = smallest_jacobian(h);
        let mut out = vec![Check {
            question: "Are the hexahedra sound?",
            answer: format!(
                "smallest scaled Jacobian {worst:.2} after the overlap is taken out (0 or less is inverted)"
            ),
            good: Some(!check::at_most(worst, v.options.hexmesh.least_scaled_jacobian, 2)),
            reaches: None,
            model: None,
            stage: Self::NAME,
        }];
        if let Some(gap) = h.metrics.gap_min_mm {
            let before = h.metrics.max_overclosure_before_mm;
            out.push(Check {
                question: "Is the cartilage free of overlap?",
                answer: format!("largest overlap {before:.2} mm before, smallest gap {gap:.3} mm after"),
                good: Some(check::at_least(gap, 0.0, 3)),
                reaches: None,
                model: None,
                stage: Self::NAME,
            });
        }
        out
    }
}

/// The smallest scaled Jacobian of all elements after the overlap is taken out.
fn smallest_jacobian(h: &Separated) -> f64 {
    let all = h.meshes.named().into_iter().flat_map(|(_, m)| (0..m.elements.len()).map(|e| m.scaled_jacobian(e)));
    all.fold(1.0, f64::min)
}
