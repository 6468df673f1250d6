//! The model as the laboratory copies it: geometry, numbers, trials, and how far the knee may be from them.

use crate::error::BuildError;
use crate::model_file;
use blindbench::knee::{BundleInput, KneeInput, Unlike};
use blindbench::laboratory::Planned;
use calibration::priors::PRIORS;
use calibration::targets::TargetOptions;
use sim::coordinate::FREE;
use sim::laxity::LaxityTrial;
use sim::mesh::MeshValue;
use sim::uncertainty::{LigamentUncertainty, ParameterPrior};

/// How far the laboratory's knee may be from a built one; `None` where the model states no such thing.
pub(super) fn unlike(spec: &sim::spec::ModelSpec) -> Option<Unlike> {
    let u = spec.uncertainty.as_ref()?;
    let frames = [&u.frames.femur, &u.frames.tibia];
    if frames.iter().all(|f| f.turn_deg == [0.0; 3] && f.shift_mm == [0.0; 3]) {
        return None;
    }
    let strain = |l: &LigamentUncertainty| match l.reference_strain {
        Some(ParameterPrior::Normal { mean, sd, .. }) => Some([mean, sd]),
        _ => None,
    };
    let stated = |name: &String| u.ligaments.get(name).and_then(strain);
    let usual = |name: &String| PRIORS.reference_strain.get(name).map(|p| [p.mean, p.sd]);
    Some(Unlike {
        sites_mm: u.sites.iter().map(|(b, s)| (b.clone(), [s.femur_mm, s.tibia_mm])).collect(),
        turn_deg: frames.map(|f| f.turn_deg),
        shift_mm: frames.map(|f| f.shift_mm),
        cartilage_mm: u.cartilage_mm,
        strains: spec
            .bundles
            .iter()
            .filter_map(|b| Some((b.name.clone(), stated(&b.name).or_else(|| usual(&b.name))?)))
            .collect(),
    })
}

/// A trial as the laboratory plans it.
pub(crate) fn planned(source: &str, t: &LaxityTrial) -> Planned {
    let usual = TargetOptions::default().noise;
    Planned {
        source: source.to_owned(),
        condition: format!("{} {}", t.test.name(), t.nominal_flexion_deg),
        flexion_deg: t.fe_deg,
        load: t.load.0.0,
        sd: FREE.map(|c| t.sd[c].unwrap_or(usual[c])),
    }
}

/// The model as the laboratory sees it: geometry and numbers, none of its code.
pub(super) fn knee(loaded: &model_file::LoadedModel) -> Result<KneeInput, BuildError> {
    let spec = &loaded.spec;
    let surface = |name: &String| match loaded.meshes.get(name) {
        Some(MeshValue::Surface(mesh)) => Ok(mesh.clone()),
        _ => Err(BuildError::File(format!("the model's surface {name} is missing"))),
    };
    let bundles = spec
        .bundles
        .iter()
        .map(|b| BundleInput {
            name: b.name.clone(),
            reference_strain: b.reference_strain,
            stiffness: b.stiffness_n_per_mm,
            reference_length: b.reference_length_mm,
            fibres: spec.fibres.iter().filter(|f| f.bundle == b.name).map(|f| (f.femur, f.tibia)).collect(),
        })
        .collect();
    let (x, p) = (&spec.contact.overclosure_mm, &spec.contact.pressure_mpa);
    let slope = match (x.as_slice(), p.as_slice()) {
        ([.., x0, x1], [.., p0, p1]) if x1 > x0 => (p1 - p0) / (x1 - x0),
        _ => return Err(BuildError::File("the model's contact table has fewer than two points".into())),
    };
    let femur = spec.contact.pairs.first().map(|p| surface(&p.femur));
    Ok(KneeInput {
        frames: (spec.frames.femur, spec.frames.tibia),
        bundles,
        femur: femur.unwrap_or_else(|| Err(BuildError::File("the model has no contact pair".into())))?,
        tibia: spec.contact.pairs.iter().map(|p| surface(&p.tibia)).collect::<Result<_, _>>()?,
        contact_slope: slope,
    })
}
