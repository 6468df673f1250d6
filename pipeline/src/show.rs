//! What each stage leaves in its folder, in formats that ParaView, MeshLab and a text editor open.

use crate::record::json;
use meshes::format::{nifti, ply, stl, vtu};
use meshes::hex::HexMesh;
use meshes::surface::{ColouredMesh, TriMesh};
use serde_json::{Value, json as object};
use stages::PerCartilage;
use stages::assemble::Assembled;
use stages::attachments::Attachments;
use stages::bones::Bones;
use stages::cartilage::Cartilage;
use stages::contact_law::{ContactLaw, SolidFields};
use stages::frames::Frames;
use stages::hexmesh::HexCartilage;
use stages::overclosure::Separated;
use stages::register::Registration;
use stages::segment::Segmented;
use stages::specimen::Specimen;
use std::io;

/// Files by name, to be written to the stage's folder.
pub type Files = io::Result<Vec<(String, Vec<u8>)>>;

/// What every stage's value tells of itself.
pub trait Reported {
    /// For metrics.json.
    fn metrics(&self) -> Value;
    /// What is odd but not fatal.
    fn warnings(&self) -> &[String];
}

macro_rules! reported {
    ($($type:ty),*) => {$(
        impl Reported for $type {
            fn metrics(&self) -> Value {
                self.metrics.clone()
            }
            fn warnings(&self) -> &[String] {
                &self.warnings
            }
        }
    )*};
}
reported!(
    Segmented,
    Specimen,
    Registration,
    Bones,
    Cartilage,
    Frames,
    Attachments,
    HexCartilage,
    Separated,
    ContactLaw,
    Assembled
);

/// 00-segment: the bones' surfaces, and the label map for 3D Slicer or ITK-SNAP.
pub fn segmented(s: &Segmented) -> Files {
    let mut files = Vec::new();
    let bones = [("femur", Some(&s.femur)), ("tibfib", Some(&s.tibfib)), ("patella", s.patella.as_ref())];
    for (name, mesh) in bones.into_iter().filter_map(|(name, mesh)| Some((name, mesh?))) {
        let mut bytes = Vec::new();
        stl::write(&mut bytes, mesh)?;
        files.push((format!("{name}.stl"), bytes));
    }
    let mut labels = Vec::new();
    nifti::write_labels(&mut labels, &s.labels)?;
    files.push(("labels.nii.gz".into(), labels));
    Ok(files)
}

/// 01-ingest: the surfaces as the program understood them, the points, who it is.
pub fn specimen(s: &Specimen) -> Files {
    let mut files = vec![("identity.json".into(), json(&s.identity))];
    for (name, mesh) in s.ct.named() {
        files.push((format!("ct_{name}.ply"), surface(mesh, &[])?));
    }
    let shown = if s.mri.is_some() { "mri" } else { "scan" };
    for (name, scan) in s.scans.named() {
        files.push((format!("{shown}_{name}.ply"), scan_bytes(scan)?));
    }
    for (name, cover) in s.mri.iter().flat_map(|m| m.covers.named()) {
        files.push((format!("mri_cartilage_{name}.ply"), surface(cover, &[])?));
    }
    if let Some(patella) = &s.patella {
        files.push(("ct_patella.ply".into(), surface(&patella.ct, &[])?));
        if let Some(scan) = &patella.scan {
            files.push(("scan_patella.ply".into(), scan_bytes(scan)?));
        }
    }
    files.push(("points.json".into(), json(&object!({"landmarks": s.landmarks, "marks": s.marks}))));
    Ok(files)
}

/// 02-register: transforms.json, and each scan on its bone with its distance to it (the residual map).
pub fn registration(s: &Specimen, r: &Registration) -> Files {
    let mut transforms = serde_json::Map::new();
    let mut files = Vec::new();
    let patella = r.patella.as_ref().zip(s.patella.as_ref().and_then(|p| p.scan.as_ref()));
    let bones = r.bones.named().into_iter().zip(s.scans.named()).map(|((name, bone), (_, scan))| (name, bone, scan));
    for (name, bone, scan) in bones.chain(patella.map(|(bone, scan)| ("patella", bone, scan))) {
        let matrix = bone.ct_from_scan.motion().to_homogeneous();
        let rows: Vec<Vec<f64>> = matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
        transforms.insert(
            name.into(),
            object!({
                "ct_from_scan": rows,
                "rms_bare_bone_mm": bone.rms_bare_bone_mm,
                "inlier_fraction": bone.inlier_fraction,
                "held_out_rms_mm": bone.held_out_rms_mm,
                "predicted_error_mm": bone.predicted_error_mm,
            }),
        );
        let bare: Vec<f64> = bone.bare_bone.iter().map(|b| f64::from(u8::from(*b))).collect();
        let moved = bone.ct_from_scan.mesh(&scan.mesh);
        let scalars: [(&str, &[f64]); 2] = [("residual_mm", &bone.residual_mm), ("bare_bone", &bare)];
        files.push((format!("{name}_residual.ply"), surface(&moved, &scalars)?));
    }
    files.push(("transforms.json".into(), json(&transforms)));
    Ok(files)
}

/// 03-bones: the rigid surfaces.
pub fn bones(b: &Bones) -> Files {
    let bones = b.surfaces.named().into_iter().chain(b.patella.as_ref().map(|mesh| ("patella", mesh)));
    bones.map(|(name, mesh)| Ok((format!("{name}.ply"), surface(mesh, &[])?))).collect()
}

/// 04-cartilage: closed solids with thickness; menisci and what else MRI shows.
pub fn cartilage(c: &Cartilage) -> Files {
    let solids = c.solids.named().into_iter();
    let solids =
        solids.map(|(name, s)| Ok((format!("{name}.ply"), surface(&s.solid, &[("thickness_mm", &s.thickness_mm)])?)));
    let carried = c.bodies.iter().map(|(name, mesh)| Ok((format!("{name}.ply"), surface(mesh, &[])?)));
    solids.chain(carried).collect()
}

/// 05-frames: frames.json.
pub fn frames(f: &Frames) -> Files {
    let value = object!({
        "femur": f.femur,
        "tibia": f.tibia,
        "gs_ct_pose": f.gs_ct_pose,
        "epicondyles": {"medial": f.epicondyles[0], "lateral": f.epicondyles[1]},
        "condylar_axis": {"point": f.condylar_axis.0, "direction": f.condylar_axis.1, "radius_mm": f.condylar_radius_mm,
                          "angle_to_tea_axial_deg": f.condylar_angle_deg},
    });
    Ok(vec![("frames.json".into(), json(&value))])
}

/// 06-attachments: sites.json, fibres.csv.
pub fn attachments(a: &Attachments) -> Files {
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

/// 07-hexmesh: hexahedra with their scaled Jacobian.
pub fn hexmesh(h: &HexCartilage) -> Files {
    hexes(h.meshes.named())
}

/// 08-overclosure: hexahedra with their scaled Jacobian.
pub fn overclosure(s: &Separated) -> Files {
    hexes(s.meshes.named())
}

/// 08b-contact-law: law.json, the curves it was fitted to, and stress and pressure of each snapshot with the .pvd that lists them.
pub fn contact_law(c: &ContactLaw) -> Files {
    let law = object!({"overclosure_mm": c.overclosure_mm, "pressure_mpa": c.pressure_mpa, "fit_error_percent": c.fit_error_percent,
                       "fit_rms_percent": c.fit_rms_percent, "area_error_percent": c.area_error_percent});
    let mut files = vec![("law.json".into(), json(&law)), ("curves.csv".into(), curves(c)?)];
    let mut list = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\"><Collection>\n".to_owned();
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

fn of_cartilage<'a>(fields: &'a PerCartilage<SolidFields>, name: &str) -> &'a SolidFields {
    fields.named().into_iter().find(|(n, _)| *n == name).map_or(&fields.femur, |(_, f)| f)
}

/// curves.csv: a row a level.
fn curves(c: &ContactLaw) -> io::Result<Vec<u8>> {
    let mut out = csv::Writer::from_writer(Vec::new());
    let header = "flexion_deg,approach_mm,force_n,area_mm2,peak_pressure_mpa,rigid_force_n,rigid_published_force_n,rigid_area_mm2";
    out.write_record(header.split(','))?;
    for (curve, rigid) in c.curves.iter().zip(&c.rigid) {
        for (n, l) in curve.levels.iter().enumerate() {
            let at = |list: &[f64]| list.get(n).copied().unwrap_or(f64::NAN);
            let row = [curve.flexion_deg, l.shift_mm, l.force_n, l.area_mm2, l.peak_pressure_mpa];
            let beside = [at(&rigid.force_n), at(&rigid.published_force_n), at(&rigid.area_mm2)];
            out.write_record(row.iter().chain(&beside).map(|x| format!("{x:.5}")))?;
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

/// 09-assemble: model.json and the contact surfaces it names.
pub fn assembled(a: &Assembled) -> Files {
    let mut files = vec![("model.json".into(), json(&a.spec))];
    for (name, mesh) in a.contact.named() {
        files.push((format!("contact/{name}.ply"), surface(mesh, &[])?));
    }
    Ok(files)
}

fn hexes(meshes: [(&'static str, &HexMesh); 3]) -> Files {
    meshes
        .into_iter()
        .map(|(name, mesh)| {
            let mut bytes = Vec::new();
            vtu::write_hex(&mut bytes, mesh)?;
            Ok((format!("{name}.vtu"), bytes))
        })
        .collect()
}

fn surface(mesh: &TriMesh, scalars: &[(&str, &[f64])]) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    ply::write(&mut bytes, mesh, scalars)?;
    Ok(bytes)
}

fn scan_bytes(scan: &ColouredMesh) -> io::Result<Vec<u8>> {
    if scan.colours.is_empty() {
        return surface(&scan.mesh, &[]);
    }
    let mut bytes = Vec::new();
    ply::write_coloured(&mut bytes, scan)?;
    Ok(bytes)
}
