//! Stage 4, cartilage: closed solids between scan and bone.

use super::artifacts::surface;
use super::layers::bone_layers;
use super::{Files, Stage, Values, Work, reported};
use crate::kept::Kept;
use crate::options::BuildOptions;
use crate::report::check::Check;
use crate::report::geometry::{Pool, packed_values, thinned};
use crate::report::picture::{Picture, picture};
use crate::report::scene::{Layer, Scalar, Scene, plain};
use meshes::render::{Painted, colour};
use stages::StageError;
use stages::bones::Bones;
use stages::cartilage::{Cartilage, CartilageOptions, cartilage};
use stages::frames::Frames;
use stages::register::Registration;
use stages::specimen::Specimen;

reported!(Cartilage);

/// Colour of menisci and what else is carried along.
const SOFT: &str = "#966ea0";

/// The stage.
pub(crate) struct MakeCartilage;

impl Stage for MakeCartilage {
    const NUMBER: &'static str = "04";
    const NAME: &'static str = "cartilage";
    const TELLING: &'static [&'static str] = &["volume_mm3"];
    /// The registration is left out for cartilage that lies where its bones lie.
    type Inputs<'a> = (&'a Kept<Specimen>, Option<&'a Kept<Registration>>, &'a Kept<Bones>);
    type Options = CartilageOptions;
    type Value = Cartilage;
    type Fault = StageError;

    fn options(all: &BuildOptions) -> &CartilageOptions {
        &all.cartilage
    }

    fn run((s, r, b): Self::Inputs<'_>, options: &CartilageOptions, _: &Work) -> Result<Cartilage, StageError> {
        match r {
            Some(r) => cartilage(s, r, b, options),
            None => cartilage(s, &Registration::left_out(), b, options),
        }
    }

    /// Closed solids with thickness; menisci and what else MRI shows.
    fn artifacts(c: &Cartilage, _: Self::Inputs<'_>) -> Files {
        let solids = c.solids.named().into_iter();
        let solids = solids
            .map(|(name, s)| Ok((format!("{name}.ply"), surface(&s.solid, &[("thickness_mm", &s.thickness_mm)])?)));
        let carried = c.bodies.iter().map(|(name, mesh)| Ok((format!("{name}.ply"), surface(mesh, &[])?)));
        solids.chain(carried).collect()
    }

    fn scene(v: &Values, pool: &mut Pool) -> Option<Scene> {
        let cartilage = v.of::<Cartilage>()?;
        let (mut layers, mut words) = (bone_layers(v, pool, 1.0), String::new());
        layers.iter_mut().for_each(|l| l.on = false);
        for (name, s) in cartilage.solids.named() {
            let key = format!("cartilage {name}");
            let (mesh, means) = thinned(&s.solid, &[&s.thickness_mm], 0.7);
            pool.keep(&key, &mesh);
            let most = s.thickness_mm.iter().copied().fold(0.0, f64::max);
            words += &format!(" {}: {:.0} mm3, at most {most:.1} mm thick.", plain(name), s.solid.volume());
            layers.push(Layer {
                name: format!("{} cartilage", plain(name)),
                mesh: Some(key),
                opacity: 1.0,
                scalar: Some(Scalar {
                    values: packed_values(&means[0], 0.0, 4.0),
                    low: 0.0,
                    high: 4.0,
                    title: "thickness mm",
                    scale: "thickness",
                    cells: false,
                }),
                on: true,
                ..Layer::default()
            });
        }
        for (name, mesh) in &cartilage.bodies {
            let key = format!("body {name}");
            pool.keep(&key, &thinned(mesh, &[], 0.7).0);
            words += &format!(" {}, carried along: {:.0} mm3.", plain(name), mesh.volume());
            layers.push(Layer {
                name: plain(name).into(),
                mesh: Some(key),
                colour: SOFT,
                opacity: 1.0,
                on: true,
                ..Layer::default()
            });
        }
        Some(Scene {
            id: "cartilage".into(),
            title: "Cartilage thickness".into(),
            text: format!(
                "Closed cartilage solids coloured by thickness, 0 to 4 mm.{words} It must be thickest in the middle of the contact areas and thin out to the rim, without holes."
            ),
            from: "front",
            layers,
            moves: false,
        })
    }

    fn stills(v: &Values) -> Option<Vec<Picture>> {
        let (cartilage, frames) = (v.of::<Cartilage>()?, v.of::<Frames>()?);
        let paints = cartilage
            .solids
            .named()
            .map(|(_, s)| s.thickness_mm.iter().map(|t| colour(*t, 0.0, 4.0)).collect::<Vec<_>>());
        let painted: Vec<Painted> = cartilage
            .solids
            .named()
            .into_iter()
            .zip(&paints)
            .map(|((_, s), paint)| Painted { mesh: &s.solid, colours: paint })
            .collect();
        let (f, t) = (&frames.femur, &frames.tibia);
        let scale = "thickness from 0 (blue) to 4 mm (red)";
        Some(vec![
            picture(&painted[..1], f.anterior, f.superior, format!("Femoral cartilage from the front: {scale}")),
            picture(&painted[..1], -f.superior, f.anterior, format!("Femoral cartilage from below: {scale}")),
            picture(&painted[1..], t.superior, t.anterior, format!("Tibial cartilage from above: {scale}")),
        ])
    }

    fn checks(v: &Values) -> Vec<Check> {
        let Some(c) = v.of::<Cartilage>() else { return vec![] };
        let words = c.solids.named().map(|(name, s)| format!("{} {:.0} mm3", name.replace('_', " "), s.solid.volume()));
        vec![Check {
            question: "How much cartilage is there?",
            answer: words.join(", "),
            good: None,
            reaches: None,
            model: None,
            stage: Self::NAME,
        }]
    }
}
