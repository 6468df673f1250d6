//! Stage 8b, contact-law: a law of rigid contact fitted to the deformable cartilage of the knee at hand.

mod charts;

use super::{Files, Stage, Values, Work, reported};
use crate::kept::Kept;
use crate::options::BuildOptions;
use crate::record::json;
use crate::report::chart::Chart;
use formats::vtu;
use meshes::hex::HexMesh;
use serde_json::json as object;
use stages::contact_law::{ContactLaw, ContactLawOptions, SolidFields, contact_law};
use stages::frames::Frames;
use stages::overclosure::Separated;
use stages::specimen::Specimen;
use stages::{PerCartilage, StageError};
use std::io;

reported!(ContactLaw);

/// The stage.
pub(crate) struct FitContactLaw;

impl Stage for FitContactLaw {
    const NUMBER: &'static str = "08b";
    const NAME: &'static str = "contact-law";
    const TELLING: &'static [&'static str] = &["fit_error_percent", "fit_rms_percent", "area_error_percent"];
    type Inputs<'a> = (&'a Kept<Specimen>, &'a Kept<Frames>, &'a Kept<Separated>);
    type Options = ContactLawOptions;
    type Value = ContactLaw;
    type Fault = StageError;

    fn options(all: &BuildOptions) -> &ContactLawOptions {
        &all.contact_law
    }

    fn run(
        (specimen, frames, separated): Self::Inputs<'_>,
        options: &ContactLawOptions,
        _: &Work,
    ) -> Result<ContactLaw, StageError> {
        contact_law(specimen, frames, separated, options)
    }

    /// law.json, the curves it was fitted to, and stress and pressure of each snapshot with the .pvd that lists them.
    fn artifacts(c: &ContactLaw, _: Self::Inputs<'_>) -> Files {
        let mut law = object!({"overclosure_mm": c.overclosure_mm, "pressure_mpa": c.pressure_mpa, "fit_error_percent": c.fit_error_percent,
                           "fit_rms_percent": c.fit_rms_percent, "area_error_percent": c.area_error_percent});
        if let Some(layer) = &c.layer {
            law["layer"] = serde_json::json!(layer.told());
            law["rules"] = object!(c.rules);
        }
        let mut files = vec![("law.json".into(), json(&law)), ("curves.csv".into(), curves(c)?)];
        let mut list =
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\"><Collection>\n".to_owned();
        for (step, s) in c.snapshots.iter().enumerate() {
            for (part, (cartilage, mesh)) in c.meshes.named().into_iter().enumerate() {
                let name = format!("fields/{cartilage}_{:03.0}deg_{:02}.vtu", s.flexion_deg, s.level);
                list += &format!("<DataSet timestep=\"{step}\" part=\"{part}\" file=\"{name}\"/>\n");
                files.push((name, snapshot(mesh, of_cartilage(&s.fields, cartilage))?));
            }
        }
        list += "</Collection></VTKFile>\n";
        files.push(("fields.pvd".into(), list.into_bytes()));
        Ok(files)
    }

    fn charts(v: &Values) -> Vec<Chart> {
        v.of().map_or(vec![], charts::charts)
    }
}

fn of_cartilage<'a>(fields: &'a PerCartilage<SolidFields>, name: &str) -> &'a SolidFields {
    fields.named().into_iter().find(|(n, _)| *n == name).map_or(&fields.femur, |(_, f)| f)
}

/// curves.csv: a row a level.
fn curves(c: &ContactLaw) -> io::Result<Vec<u8>> {
    let mut out = csv::Writer::from_writer(Vec::new());
    let header = "flexion_deg,approach_mm,force_n,area_mm2,peak_pressure_mpa,rigid_force_n,rigid_published_force_n,rigid_area_mm2";
    let layer = c.layer.as_ref();
    out.write_record(header.split(',').chain(layer.map(|_| "layer_force_n")).chain(layer.map(|_| "layer_area_mm2")))?;
    for (k, (curve, rigid)) in c.curves.iter().zip(&c.rigid).enumerate() {
        for (n, l) in curve.levels.iter().enumerate() {
            let at = |list: &[f64]| list.get(n).copied().unwrap_or(f64::NAN);
            let row = [curve.flexion_deg, l.shift_mm, l.force_n, l.area_mm2, l.peak_pressure_mpa];
            let beside = [at(&rigid.force_n), at(&rigid.published_force_n), at(&rigid.area_mm2)];
            let layer = layer.map(|l| [at(&l.force_n[k]), at(&l.area_mm2[k])]);
            out.write_record(row.iter().chain(&beside).chain(layer.iter().flatten()).map(|x| format!("{x:.5}")))?;
        }
    }
    out.into_inner().map_err(|e| io::Error::other(e.to_string()))
}

/// A cartilage as it lies at a level, with its stress and pressures.
fn snapshot(mesh: &HexMesh, fields: &SolidFields) -> io::Result<Vec<u8>> {
    let places = fields.places.iter().map(|p| meshes::Point::new(p[0].into(), p[1].into(), p[2].into())).collect();
    let deformed = HexMesh { nodes: places, ..mesh.clone() };
    // VTK's order of a symmetric tensor: xx, yy, zz, xy, yz, xz
    let order = [0, 3, 5, 1, 4, 2];
    let stress: Vec<f64> = fields.stress_mpa.iter().flat_map(|s| order.map(|k| f64::from(s[k]))).collect();
    let pressure: Vec<f64> = fields.stress_mpa.iter().map(|s| -f64::from(s[0] + s[3] + s[5]) / 3.0).collect();
    let mises: Vec<f64> = fields.stress_mpa.iter().map(von_mises).collect();
    let contact: Vec<f64> = fields.contact_pressure_mpa.iter().map(|p| f64::from(*p)).collect();
    let mut bytes = Vec::new();
    vtu::write_hex_fields(
        &mut bytes,
        &deformed,
        &[("contact_pressure_mpa", 1, &contact)],
        &[("stress_mpa", 6, &stress), ("pressure_mpa", 1, &pressure), ("von_mises_mpa", 1, &mises)],
    )?;
    Ok(bytes)
}

fn von_mises(s: &[f32; 6]) -> f64 {
    let [xx, xy, xz, yy, yz, zz] = s.map(f64::from);
    let normal = (xx - yy).powi(2) + (yy - zz).powi(2) + (zz - xx).powi(2);
    (normal / 2.0 + 3.0 * (xy * xy + xz * xz + yz * yz)).sqrt()
}
