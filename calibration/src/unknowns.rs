//! What is not known of a knee, as parameters with priors: ligaments, attachment sites, frames, contact.

use crate::design::{Design, Kind};
use crate::options::{CalibrateOptions, FrameOptions};
use crate::priors::PriorTable;
use crate::shared::SharedPrior;
use inference::frames::term_name;
use inference::knee::{KNOTS, Quantity};
use inference::parameter::{Parameter, Prior};
use serde::{Deserialize, Serialize};
use sim::coordinate::{AP, ML};
use sim::sensitivity::End;
use sim::spec::ModelSpec;
use sim::uncertainty::{LigamentUncertainty, ParameterPrior, Uncertainty};

/// Frames as another inference left them: of each shared term, and of one data set's own terms, mean and standard deviation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KnownFrames {
    /// Of all.
    pub shared: Vec<Option<(f64, f64)>>,
    /// Of the data set.
    pub own: Vec<Option<(f64, f64)>>,
}

/// The parameters of a knee measured in `sources` data sets. `frames`, where given, are of the one data set there is. What other knees say of a number, where
/// the options have it, stands in place of its own prior.
pub fn parameters(
    spec: &ModelSpec,
    design: &Design,
    sources: &[String],
    options: &CalibrateOptions,
    frames: Option<&KnownFrames>,
) -> Vec<Parameter<Quantity>> {
    let names: Vec<String> = spec.bundles.iter().map(|b| b.name.clone()).collect();
    let uncertainty = spec.uncertainty.clone().unwrap_or_else(|| Uncertainty::of_deck(&names));
    let mut out = ligaments(&names, design, &uncertainty, options);
    match frames {
        Some(known) => known_frames(known, sources, &mut out),
        None => all_frames(&uncertainty, sources, &options.frames, &mut out),
    }
    for (b, name) in names.iter().enumerate() {
        let Some(site) = uncertainty.sites.get(name) else { continue };
        for (end, sd, bone) in [(End::Femur, site.femur_mm, "femur"), (End::Tibia, site.tibia_mm, "tibia")] {
            for axis in (0..3).filter(|_| sd > 0.0) {
                let name = format!("{name}.{bone}.{}", ["x", "y", "z"][axis]);
                out.push(normal(name, Quantity::Site(b, end, axis), 0.0, sd));
            }
        }
    }
    if uncertainty.contact_log_scale > 0.0 {
        let prior = Prior::LogNormal { median: 1.0, log_sd: uncertainty.contact_log_scale };
        out.push(Parameter { name: "contact.scale".into(), quantity: Quantity::ContactScale, prior });
    }
    if uncertainty.cartilage_mm > 0.0 {
        out.push(normal("cartilage.thickness_mm".into(), Quantity::Cartilage, 0.0, uncertainty.cartilage_mm));
        for coordinate in [ML, AP] {
            for (knot, at) in KNOTS.iter().enumerate() {
                let name = format!("lean.{coordinate}.{at}");
                let sd = uncertainty.cartilage_mm / LEAN_OVER_MM;
                out.push(normal(name, Quantity::Lean(coordinate, knot), 0.0, sd));
            }
        }
    }
    if let Some(SharedPrior::Read(shared)) = &options.shared_prior {
        shared.applied(&mut out);
    }
    out
}

/// Distance over which cartilage is as much off at one place as at another [mm]: about half a plateau's depth. The bearing surface leans by as much over
/// that distance.
const LEAN_OVER_MM: f64 = 12.0;

fn normal(name: String, quantity: Quantity, mean: f64, sd: f64) -> Parameter<Quantity> {
    Parameter { name, quantity, prior: Prior::Normal { mean, sd } }
}

/// Reference strains and stiffnesses: the model's own prior, else the usual one within Table 3, else Table 3.
fn ligaments(
    names: &[String],
    design: &Design,
    uncertainty: &Uncertainty,
    options: &CalibrateOptions,
) -> Vec<Parameter<Quantity>> {
    let of = |v: &crate::design::Variable| {
        let own = v.bundles.first().and_then(|b| uncertainty.ligaments.get(b));
        let strain = v.kind == Kind::ReferenceStrain;
        let pick = |l: &LigamentUncertainty| if strain { l.reference_strain } else { l.stiffness_n_per_mm };
        let (lower, upper) = (v.lower, v.upper);
        let general = || match v.bundles.first().and_then(|b| options.priors.reference_strain(b)) {
            Some(p) if strain => Prior::Truncated { mean: p.mean, sd: p.sd, lower, upper },
            _ => Prior::Uniform { lower, upper },
        };
        let prior = match own.and_then(pick) {
            _ if options.priors == PriorTable::None => Prior::Uniform { lower, upper },
            Some(ParameterPrior::Uniform { lower, upper }) => Prior::Uniform { lower, upper },
            Some(ParameterPrior::Normal { mean, sd, lower: l, upper: u }) => {
                Prior::Truncated { mean, sd, lower: l.unwrap_or(lower), upper: u.unwrap_or(upper) }
            }
            None => general(),
        };
        Parameter { name: v.name(), quantity: v.quantity(names), prior }
    };
    design.variables.iter().map(of).collect()
}

/// Frames shared by all data sets and each one's own; of a single data set one term, as uncertain as both.
fn all_frames(
    uncertainty: &Uncertainty,
    sources: &[String],
    options: &FrameOptions,
    out: &mut Vec<Parameter<Quantity>>,
) {
    let bones = [&uncertainty.frames.femur, &uncertainty.frames.tibia];
    for term in 0..12 {
        let (bone, turn) = (bones[term / 6], term % 6 < 3);
        let model = if turn { bone.turn_deg[term % 3] } else { bone.shift_mm[term % 3] };
        let sd = if turn { options.turn_sd_deg } else { options.shift_sd_mm }.unwrap_or(model);
        if sd <= 0.0 {
            continue;
        }
        let own = if turn { options.offset_turn_deg } else { options.offset_shift_mm };
        let name = term_name(term);
        if sources.len() < 2 || own <= 0.0 {
            out.push(normal(name, Quantity::Frame(None, term), 0.0, sd.hypot(own)));
            continue;
        }
        out.push(normal(name.clone(), Quantity::Frame(None, term), 0.0, sd));
        for (s, source) in sources.iter().enumerate() {
            out.push(normal(format!("{source}.{name}"), Quantity::Frame(Some(s), term), 0.0, own));
        }
    }
}

/// Frames as they are known already.
fn known_frames(known: &KnownFrames, sources: &[String], out: &mut Vec<Parameter<Quantity>>) {
    let source = sources.first().map_or("", String::as_str);
    for (term, (shared, own)) in known.shared.iter().zip(&known.own).enumerate() {
        let name = term_name(term);
        if let Some((mean, sd)) = shared {
            out.push(normal(name.clone(), Quantity::Frame(None, term), *mean, *sd));
        }
        if let Some((mean, sd)) = own {
            out.push(normal(format!("{source}.{name}"), Quantity::Frame(Some(0), term), *mean, *sd));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn prior_of(name: &str, priors: PriorTable, own: Option<ParameterPrior>) -> Prior {
        let design = Design::table3();
        let names: Vec<String> = design.variables.iter().flat_map(|v| v.bundles.clone()).collect();
        let mut uncertainty = Uncertainty::of_deck(&names);
        let of_bundle = LigamentUncertainty { reference_strain: own, ..Default::default() };
        uncertainty.ligaments.insert("ACL_AM".into(), of_bundle);
        let options = CalibrateOptions { priors, ..Default::default() };
        let all = ligaments(&names, &design, &uncertainty, &options);
        all.into_iter().find(|p| p.name.contains(name)).expect("a parameter").prior
    }

    #[test]
    fn each_table_of_priors_is_heard_in_the_strains() {
        let strain = |priors| match prior_of("ACL_AM.reference_strain", priors, None) {
            Prior::Truncated { mean, .. } => Some(mean),
            Prior::Uniform { .. } => None,
            other => panic!("{other:?}"),
        };
        let of = |table: PriorTable| table.reference_strain("ACL_AM").map(|p| p.mean);
        let tables = [PriorTable::Usual, PriorTable::None, PriorTable::Published];
        let heard = tables.map(strain);
        assert_eq!(heard, tables.map(of));
        assert!(heard[0].is_some() && heard[1].is_none() && heard[2].is_some() && heard[0] != heard[2]);
    }

    #[test]
    fn a_bundle_that_a_table_does_not_hold_is_even_over_table_3_and_a_models_own_prior_goes_first() {
        let als = |priors| prior_of("ALS.reference_strain", priors, None);
        assert!(matches!(als(PriorTable::Usual), Prior::Truncated { .. }));
        assert!(matches!(als(PriorTable::Published), Prior::Uniform { .. }));
        let own = ParameterPrior::Normal { mean: 1.01, sd: 0.02, lower: None, upper: None };
        for table in [PriorTable::Usual, PriorTable::Published] {
            let told = prior_of("ACL_AM.reference_strain", table, Some(own));
            assert!(matches!(told, Prior::Truncated { sd: 0.02, .. }), "{table:?}: {told:?}");
        }
    }
}
