//! Synthetic specimens that may be shared: a knee of smooth implicit bones with cartilage, measured the way a laboratory
//! does, with the truth beside it. No person's data went into it.

mod bone;
mod files;
mod labels;
mod shape;
mod site;
pub mod volume;

use crate::StageError;
use meshes::frame::Side;
use meshes::surface::TriMesh;
use meshes::{Isometry, Vector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The ids of the dissected knees that [`phantom`] knows.
pub const PHANTOMS: [&str; 3] = ["S192803-phantom", "S193761-phantom", "right-phantom"];

/// The id of the living knee that [`phantom`] knows: a label map of MRI in place of CT, scans and points.
pub const MRI_PHANTOM: &str = "mri-phantom";

/// A specimen directory as values.
#[derive(Clone, Debug, PartialEq)]
pub struct PhantomSpecimen {
    /// Its id.
    pub id: String,
    /// Every file by path relative to the specimen, specimen.toml first.
    pub files: Vec<(String, Vec<u8>)>,
    /// What bears at the joint, femur and tibia: the outer surface of bone and cartilage as it truly is, CT frame [mm].
    pub bearing: [TriMesh; 2],
}

/// Size and side of a phantom.
struct Recipe {
    id: &'static str,
    side: Side,
    /// Stretch along lateral, anterior, superior of the knee 88 mm wide [-].
    scale: [f64; 3],
    /// Cartilage thickness away from its rim: femur, medial, lateral [mm].
    thickness: [f64; 3],
}

const RECIPES: [Recipe; 4] = [
    Recipe { id: PHANTOMS[0], side: Side::Left, scale: [1.0, 1.0, 1.0], thickness: [2.2, 2.2, 2.8] },
    Recipe { id: PHANTOMS[1], side: Side::Left, scale: [0.96, 0.93, 0.93], thickness: [2.0, 2.1, 2.6] },
    Recipe { id: PHANTOMS[2], side: Side::Right, scale: [0.93, 0.95, 0.96], thickness: [2.1, 2.1, 2.7] },
    // A living knee: a label map of MRI, no CT, no scans, no marks.
    Recipe { id: MRI_PHANTOM, side: Side::Right, scale: [0.95, 0.96, 0.94], thickness: [2.2, 2.0, 2.6] },
];

/// Makes the phantom `id` of [`PHANTOMS`], or [`MRI_PHANTOM`]; `seed` draws its noise and the frames it is measured in, not its shape.
///
/// # Errors
/// An unknown id, with those known.
pub fn phantom(id: &str, seed: u64) -> Result<PhantomSpecimen, StageError> {
    made(id, seed, false)
}

/// As [`phantom`], with a CT volume ([`volume`]) in place of the CT surfaces, which then lie in `truth/`; with a patella.
///
/// # Errors
/// An unknown id, with those known.
pub fn phantom_volume(id: &str, seed: u64) -> Result<PhantomSpecimen, StageError> {
    made(id, seed, true)
}

fn made(id: &str, seed: u64, as_volume: bool) -> Result<PhantomSpecimen, StageError> {
    let Some(recipe) = RECIPES.iter().find(|r| r.id == id) else {
        return Err(StageError::Knee(format!(
            "no phantom is called {id}{}; expected one of {}, {MRI_PHANTOM}",
            sim::names::did_you_mean(id, PHANTOMS),
            PHANTOMS.join(", ")
        )));
    };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let fail = || StageError::Knee(format!("phantom {id}: a surface came out empty"));
    let mut femur = bone::solid(recipe, &bone::FEMUR).ok_or_else(fail)?;
    let mut tibfib = bone::solid(recipe, &bone::TIBFIB).ok_or_else(fail)?;
    let joint = bone::contact(&femur, &tibfib);
    let place = Isometry::new(150.0 * unit_cube(&mut rng), 0.1 * unit_cube(&mut rng));
    femur.ct_from_knee = place;
    tibfib.ct_from_knee = place * joint;
    let measured = [bone::measure(&femur, &mut rng), bone::measure(&tibfib, &mut rng)];
    let mut files = files::specimen(recipe, [&femur, &tibfib], &measured, &mut rng)?;
    if id == MRI_PHANTOM {
        if as_volume {
            return Err(StageError::Knee(format!("phantom {id} is a label map of MRI; it has no CT volume")));
        }
        labels::with_labels(&mut files, [&femur, &tibfib])?;
    } else if as_volume {
        files::with_volume(&mut files, [&femur, &tibfib], seed)?;
    }
    let bearing = [femur.bearing(), tibfib.bearing()];
    Ok(PhantomSpecimen { id: id.into(), files, bearing })
}

/// A vector with entries from -1 to 1.
fn unit_cube(rng: &mut ChaCha8Rng) -> Vector {
    Vector::from_fn(|_, _| rng.random_range(-1.0..1.0))
}

#[cfg(test)]
mod tests;
