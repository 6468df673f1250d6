//! Knees built in memory, stage by stage, and what becomes of their sites and hexahedra.

use crate::knees::{Knee, user_seconds};
use crate::page::{Limit, Section};
use attachments::site::Source;
use meshes::Point;
use meshes::query::SurfaceQuery;
use stages::StageError;
use stages::assemble::{AssembleOptions, assemble};
use stages::attachments::{Attachments, AttachmentsOptions, attachments};
use stages::bones::{Bones, BonesOptions, bones};
use stages::cartilage::{Cartilage, CartilageMethod, CartilageOptions, cartilage};
use stages::frames::{Frames, FramesOptions, frames};
use stages::hexmesh::{HexCartilage, HexmeshOptions, hexmesh};
use stages::ingest::ingest;
use stages::overclosure::{OverclosureOptions, Separated, overclosure};
use stages::register::{RegisterOptions, Registration, register};
use stages::specimen::{IngestOptions, Specimen};

/// A knee with what the stages made of it.
pub(crate) struct Built {
    pub(crate) cartilage: Cartilage,
    pub(crate) frames: Frames,
    attachments: Attachments,
    hexes: HexCartilage,
    separated: Separated,
    seconds: f64,
}

/// Stages 1 to 9.
pub(crate) fn build(knee: &Knee) -> Result<Built, StageError> {
    let start = user_seconds();
    let specimen = ingest(&knee.raw, &IngestOptions::default())?;
    let (registration, bones, cartilage) = cartilages(&specimen, CartilageMethod::ThicknessField)?;
    let frames = frames(&specimen, &bones, &FramesOptions::default())?;
    let options = AttachmentsOptions::default();
    let attachments = attachments(&specimen, &registration, &bones, &cartilage, &frames, &options)?;
    let hexes = hexmesh(&cartilage, &HexmeshOptions::default())?;
    let separated = overclosure(&hexes, &OverclosureOptions::default())?;
    assemble((&specimen, &bones, &cartilage), &frames, &attachments, &separated, None, &AssembleOptions::default())?;
    let seconds = user_seconds() - start;
    Ok(Built { cartilage, frames, attachments, hexes, separated, seconds })
}

/// Stages 2 to 4.
pub(crate) fn cartilages(
    specimen: &Specimen,
    method: CartilageMethod,
) -> Result<(Registration, Bones, Cartilage), StageError> {
    let registration = register(specimen, &RegisterOptions::default())?;
    let bones = bones(specimen, &BonesOptions::default())?;
    let options = CartilageOptions { method, ..CartilageOptions::default() };
    let made = cartilage(specimen, &registration, &bones, &options)?;
    Ok((registration, bones, made))
}

/// Sites of the literature.
pub(crate) fn literature(knees: &[(&Knee, Built)]) -> Section {
    let mut page =
        Section::new("Literature sites", "Centroids of the sites that nobody marked, against the published ones.");
    for (knee, built) in knees.iter().filter(|k| k.0.is_specimen()) {
        let errors = site_errors(knee, built, Source::Literature);
        let mean = errors.iter().map(|e| e.1).sum::<f64>() / errors.len().max(1) as f64;
        page.add("mean over a knee's sites [mm]", Limit::Most(8.0), &knee.name, mean);
        for (site, error) in errors {
            page.add("site [mm]", Limit::Most(15.0), &format!("{} {site}", knee.name), error);
        }
    }
    page
}

/// Distance of the centroids of a source's sites from the truth [mm], by ligament and bone; none for a site that is not there.
pub(crate) fn site_errors(knee: &Knee, built: &Built, source: Source) -> Vec<(String, f64)> {
    let Some(sites) = knee.truth["sites_ct"].as_object() else { return Vec::new() };
    let wanted = sites.iter().filter(|(_, s)| (s["marked"] == true) == (source == Source::Marked));
    wanted
        .map(|(key, site)| {
            let truth = Point::from([0, 1, 2].map(|k| site["centroid"][k].as_f64().unwrap_or(f64::NAN)));
            let (ligament, bone) = key.split_once('@').unwrap_or((key, ""));
            let ours = built
                .attachments
                .sites
                .iter()
                .find(|s| s.ligament == ligament && serde_json::json!(s.bone) == bone && s.source == source);
            (key.clone(), ours.map_or(f64::NAN, |s| (s.centroid - truth).norm()))
        })
        .collect()
}

/// Hexahedra, overclosure and time.
pub(crate) fn meshes(knees: &[(&Knee, Built)]) -> [Section; 3] {
    let mut hexahedra =
        Section::new("Hexahedra", "Element size 0.9 mm (the default) on every knee, 0.5, 0.75 and 1 mm on the first.");
    let mut apart = Section::new("Overclosure", "From the cartilage as built.");
    let mut time = Section::new(
        "Time",
        "Stages 1 to 9 in memory, without writing and pictures: user time of all threads; 45 s on two cores is 90 s of it.",
    );
    for (k, (knee, built)) in knees.iter().enumerate() {
        let mut sizes = vec![0.9];
        if k == 0 {
            sizes.extend([0.5, 0.75, 1.0]);
        }
        for size in sizes {
            let options = HexmeshOptions { edge_length_mm: size, ..HexmeshOptions::default() };
            match hexmesh(&built.cartilage, &options) {
                Ok(made) => shapes(&mut hexahedra, &format!("{} {size} mm", knee.name), built, &made),
                Err(_) => {
                    hexahedra.add("inverted elements", Limit::Most(0.0), &format!("{} {size} mm", knee.name), f64::NAN)
                }
            }
        }
        let metrics = &built.separated.metrics;
        apart.add(
            "least gap [mm]",
            Limit::Least(OverclosureOptions::default().gap_mm),
            &knee.name,
            told(metrics.gap_min_mm),
        );
        apart.add("iterations", Limit::Most(10.0), &knee.name, metrics.iterations as f64);
        apart.add(
            "mean change of an element's volume [%]",
            Limit::Most(0.5),
            &knee.name,
            100.0 * metrics.volume_change_mean,
        );
        for ((name, before), (_, after)) in built.hexes.metrics.named().into_iter().zip(metrics.meshes.named()) {
            let fall = told(before.scaled_jacobian_min) - told(after.scaled_jacobian_min);
            apart.add("fall of the least scaled Jacobian", Limit::Most(0.05), &format!("{} {name}", knee.name), fall);
        }
        time.add("stages 1 to 9, user time [s]", Limit::Most(90.0), &knee.name, built.seconds);
    }
    [hexahedra, apart, time]
}

fn told(figure: Option<f64>) -> f64 {
    figure.unwrap_or(f64::NAN)
}

fn shapes(page: &mut Section, case: &str, built: &Built, made: &HexCartilage) {
    let each = made.meshes.named().into_iter().zip(made.metrics.named()).zip(built.cartilage.solids.named());
    for (((name, mesh), (_, shape)), (_, solid)) in each {
        let case = format!("{case} {name}");
        page.add("inverted elements", Limit::Most(0.0), &case, shape.inverted as f64);
        page.add("scaled Jacobian, least", Limit::Least(0.3), &case, told(shape.scaled_jacobian_min));
        page.add("scaled Jacobian, 5th percentile", Limit::Least(0.75), &case, told(shape.scaled_jacobian_p05));
        page.add("scaled Jacobian, mean", Limit::Least(0.92), &case, shape.scaled_jacobian_mean);
        let Some(query) = SurfaceQuery::new(&solid.solid) else { continue };
        let nodes = mesh.articular_quads.iter().flatten().map(|&n| query.nearest(&mesh.nodes[n as usize]).distance);
        page.add("articular node off the solid, farthest [mm]", Limit::Most(0.05), &case, nodes.fold(0.0, f64::max));
    }
}
