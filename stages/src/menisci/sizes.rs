//! stages/data/menisci.toml.

use super::Compartment;
use serde::Deserialize;
use std::sync::LazyLock;

/// The table shipped with the program.
pub(super) static SIZES: LazyLock<Sizes> = LazyLock::new(|| {
    #[expect(clippy::expect_used, reason = "the table is part of the program, and a test reads it")]
    toml::from_str(include_str!("../../data/menisci.toml")).expect("the table shipped with the program parses")
});

/// Sizes and material.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sizes {
    meniscus_medial: Size,
    meniscus_lateral: Size,
    pub(super) tibia: Tibia,
    pub(super) fit: Fit,
    pub(super) material: Material,
}

/// Of one meniscus: anterior horn, body, posterior horn [mm].
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Size {
    pub(super) width_mm: [f64; 3],
    pub(super) height_mm: [f64; 3],
    /// Share of the plateau that it covers [-].
    pub(super) coverage: f64,
    #[expect(dead_code, reason = "for the reader of the table")]
    read: String,
    /// Anterior and medial of the compartment's eminence [mm].
    pub(super) anterior_root_mm: [f64; 2],
    pub(super) posterior_root_mm: [f64; 2],
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Tibia {
    /// Half of the distance between both eminences [mm].
    pub(super) eminence_mm: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Fit {
    /// Distance of both cartilages when menisci begin to bear [mm].
    pub(super) clearance_mm: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Material {
    pub(super) circumferential_modulus_mpa: f64,
    pub(super) transverse_modulus_mpa: f64,
    pub(super) horn_n_per_mm: f64,
    pub(super) shear_modulus_mpa: f64,
    pub(super) periphery_n_per_mm2: f64,
}

impl Sizes {
    /// Of a compartment's meniscus.
    pub(super) fn of(&self, compartment: Compartment) -> &Size {
        if compartment == Compartment::Medial { &self.meniscus_medial } else { &self.meniscus_lateral }
    }
}
