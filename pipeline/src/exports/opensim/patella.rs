//! The patella: a body of its own behind the femur, with its tendon, retinacula, contact and the heads of the quadriceps.
//!
//! In the model it acts under a pull of the quadriceps alone. So its coordinates are locked and its forces switched off: the knee is the same with it
//! and without. Who pulls unlocks the six coordinates and switches the forces on. The control of every head is then the tension of the whole quadriceps
//! [N]: its optimal force is its share.

use super::super::File;
use super::{OpensimContact, THICKENED_MM, angles, jam, metres, obj, thickened, turned};
use crate::model_file::LoadedModel;
use crate::report::html::escaped;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use nalgebra::Matrix3;
use sim::mesh::MeshValue;
use sim::patella::NAME;
use sim::spec::{BandSpec, HeadSpec, PatellaSpec};
use std::fmt::Write;

/// Its mass and inertia where the model has no such body [kg, kg m2]: OpenSim asks for some.
const MASS: [f64; 2] = [0.01, 1e-5];
/// Length of the cylinder that the quadriceps wrap over [m]: more than any femur is wide.
const WRAP_M: f64 = 0.4;
/// Largest control of a head, the tension of the quadriceps [N]; more than they pull in a stumble.
const MOST_N: f64 = 10_000.0;
/// Its contact faces, by the names of their files.
const FACES: [&str; 2] = ["trochlea", "patella_contact"];

/// What it is in each section of the file.
#[derive(Default)]
pub(super) struct Parts {
    pub(super) body: String,
    /// Within the femur.
    pub(super) wraps: String,
    pub(super) joint: String,
    pub(super) geometry: String,
    pub(super) forces: String,
    pub(super) files: Vec<File>,
}

/// The patella of a model, where one acts.
pub(super) fn parts(model: &LoadedModel, law: OpensimContact) -> Parts {
    let Some(own) = &model.spec.patella else { return Parts::default() };
    let mut out = Parts { wraps: wraps(model, own), joint: joint(model, own), ..Parts::default() };
    let body = model.spec.bodies.iter().find(|b| b.name == NAME);
    let [mass, inertia] = body.map_or(MASS, |b| [b.mass_tonne * 1e3, b.inertia_tonne_mm2 * 1e-3]);
    let shown = body.and_then(|b| surface(model, &b.bone)).map_or(String::new(), |mesh| {
        out.files.push(("Geometry/patella_bone.obj".into(), obj(mesh).into_bytes()));
        "<Mesh name=\"patella_bone\"><socket_frame>/bodyset/patella</socket_frame><scale_factors>1 1 1</scale_factors><Appearance><color>0.88 0.83 0.74</color></Appearance><mesh_file>patella_bone.obj</mesh_file></Mesh>".to_owned()
    });
    let _ = writeln!(
        out.body,
        "<Body name=\"{NAME}\"><mass>{mass:?}</mass><mass_center>{}</mass_center><inertia>{inertia:?} {inertia:?} {inertia:?} 0 0 0</inertia><attached_geometry>{shown}</attached_geometry></Body>",
        metres(&own.frame.origin)
    );
    out.forces += &band(&own.tendon, "/ground");
    own.retinacula.iter().for_each(|b| out.forces += &band(b, "/bodyset/femur"));
    own.quadriceps.heads.iter().for_each(|h| out.forces += &head(h));
    contact(model, own, law, &mut out);
    out
}

fn surface<'a>(model: &'a LoadedModel, path: &str) -> Option<&'a TriMesh> {
    match model.meshes.get(path) {
        Some(MeshValue::Surface(mesh)) => Some(mesh),
        _ => None,
    }
}

/// Six locked coordinates against the femur: turns about forwards, upwards and rightwards of the patella, and shifts along them.
fn joint(model: &LoadedModel, own: &PatellaSpec) -> String {
    let [x, y, z] = angles(&turned(&own.frame, model.spec.side));
    let frame = |which: &str, body: &str| {
        format!(
            "<PhysicalOffsetFrame name=\"patella_{which}\"><socket_parent>{body}</socket_parent><translation>{}</translation><orientation>{x:?} {y:?} {z:?}</orientation></PhysicalOffsetFrame>",
            metres(&own.frame.origin)
        )
    };
    let coordinate = |kind: &str, axis: &str, most: f64| {
        format!(
            "<Coordinate name=\"patella_{kind}_{axis}\"><default_value>0</default_value><range>{:?} {most:?}</range><locked>true</locked></Coordinate>",
            -most
        )
    };
    let coordinates: String = [("rotation", 3.2), ("translation", 0.2)]
        .iter()
        .flat_map(|(kind, most)| ["x", "y", "z"].map(|axis| coordinate(kind, axis, *most)))
        .collect();
    format!(
        "<FreeJoint name=\"patellofemoral\"><socket_parent_frame>patella_parent</socket_parent_frame><socket_child_frame>patella_child</socket_child_frame>\
         <coordinates>{coordinates}</coordinates><frames>{}{}</frames></FreeJoint>\n",
        frame("parent", "/bodyset/femur"),
        frame("child", "/bodyset/patella")
    )
}

/// The cylinder that the quadriceps wrap over: its z is the axis, and they lie on the side of x.
fn wraps(model: &LoadedModel, own: &PatellaSpec) -> String {
    let (wrap, anterior) = (&own.quadriceps.wrap, model.spec.frames.femur.anterior);
    let axis = wrap.direction.normalize();
    let front: Vector = (anterior - axis * axis.dot(&anterior)).normalize();
    let [x, y, z] = angles(&Matrix3::from_columns(&[front, axis.cross(&front), axis]));
    format!(
        "<WrapObjectSet name=\"wrapobjectset\"><objects><WrapCylinder name=\"quadriceps_wrap\"><xyz_body_rotation>{x:?} {y:?} {z:?}</xyz_body_rotation>\
         <translation>{}</translation><quadrant>+x</quadrant><radius>{:?}</radius><length>{WRAP_M:?}</length></WrapCylinder></objects></WrapObjectSet>",
        metres(&wrap.point),
        own.quadriceps.wrap_radius_mm * 1e-3
    )
}

/// A path from another body to the patella.
fn path(far: (&str, &Point), patella: &Point, more: &str) -> String {
    let point = |name: &str, frame: &str, p: &Point| {
        format!(
            "<PathPoint name=\"{name}\"><socket_parent_frame>{frame}</socket_parent_frame><location>{}</location></PathPoint>",
            metres(p)
        )
    };
    format!(
        "<GeometryPath name=\"path\"><PathPointSet name=\"PathPointSet\"><objects>{}{}</objects></PathPointSet>{more}</GeometryPath>",
        point("far", far.0, far.1),
        point("patella", "/bodyset/patella", patella)
    )
}

/// Tendon or retinaculum: a ligament a fibre, each stretched alike in the CT pose.
fn band(band: &BandSpec, far: &str) -> String {
    let count = band.fibres.len() as f64;
    let lengths: Vec<f64> = band.fibres.iter().map(|f| (f.patella - f.far).norm()).collect();
    let mean = lengths.iter().sum::<f64>() / count;
    let mean_slack = mean / band.reference_strain;
    let mut out = String::new();
    for (n, (fibre, length)) in band.fibres.iter().zip(&lengths).enumerate() {
        let slack = length - (mean - mean_slack);
        let _ = writeln!(
            out,
            "<Blankevoort1991Ligament name=\"{}_{}\"><appliesForce>false</appliesForce><linear_stiffness>{:?}</linear_stiffness><transition_strain>{:?}</transition_strain>\
             <damping_coefficient>0</damping_coefficient><slack_length>{:?}</slack_length><path>{}</path></Blankevoort1991Ligament>",
            escaped(&band.name),
            n + 1,
            band.stiffness_n_per_mm / count * slack,
            2.0 * band.toe_strain * mean_slack / slack,
            slack * 1e-3,
            path((far, &fibre.far), &fibre.patella, "")
        );
    }
    out
}

/// A head of the quadriceps: an actuator whose control is the tension of all heads.
fn head(head: &HeadSpec) -> String {
    let wrapped = "<PathWrapSet name=\"PathWrapSet\"><objects><PathWrap name=\"wrap\"><wrap_object>quadriceps_wrap</wrap_object><method>hybrid</method></PathWrap></objects></PathWrapSet>";
    format!(
        "<PathActuator name=\"{}\"><appliesForce>false</appliesForce><min_control>0</min_control><max_control>{MOST_N:?}</max_control><optimal_force>{:?}</optimal_force>{}</PathActuator>\n",
        escaped(&head.name),
        head.share,
        path(("/bodyset/femur", &head.femur), &head.patella, wrapped)
    )
}

/// Contact of patella and trochlea; the bone beside the trochlea is left out.
fn contact(model: &LoadedModel, own: &PatellaSpec, law: OpensimContact, out: &mut Parts) {
    let (d, p) = (&own.contact.overclosure_mm, &own.contact.pressure_mpa);
    let stiffness = match (d.as_slice(), p.as_slice()) {
        ([.., d0, d1], [.., p0, p1]) if d1 > d0 => (p1 - p0) / (d1 - d0),
        _ => 0.0,
    };
    let of = [(&own.contact.femur, "/bodyset/femur"), (&own.contact.patella, "/bodyset/patella")];
    for ((face, frame), name) in of.into_iter().zip(FACES) {
        let Some(mesh) = surface(model, face) else { continue };
        let (written, geometry) = match law {
            OpensimContact::Jam => (mesh.clone(), jam::by_table(name, frame, stiffness)),
            OpensimContact::Elastic => (
                thickened(mesh, THICKENED_MM),
                format!(
                    "<ContactMesh name=\"{name}\"><socket_frame>{frame}</socket_frame><location>0 0 0</location><orientation>0 0 0</orientation><filename>Geometry/{name}.obj</filename></ContactMesh>\n"
                ),
            ),
        };
        out.files.push((format!("Geometry/{name}.obj"), obj(&written).into_bytes()));
        out.geometry += &geometry;
    }
    let force = match law {
        OpensimContact::Jam => {
            jam::force("patella_on_trochlea", FACES, ("linear", "<appliesForce>false</appliesForce>"))
        }
        OpensimContact::Elastic => {
            let parameters = FACES.map(|name| format!("<ElasticFoundationForce::ContactParameters><geometry>{name}</geometry><stiffness>{:?}</stiffness><dissipation>1</dissipation><static_friction>0</static_friction><dynamic_friction>0</dynamic_friction><viscous_friction>0</viscous_friction></ElasticFoundationForce::ContactParameters>", stiffness * 1e9));
            format!(
                "<ElasticFoundationForce name=\"patella_on_trochlea\"><appliesForce>false</appliesForce><ElasticFoundationForce::ContactParametersSet name=\"contact_parameters\"><objects>{}</objects></ElasticFoundationForce::ContactParametersSet><transition_velocity>0.01</transition_velocity></ElasticFoundationForce>\n",
                parameters.concat()
            )
        }
    };
    out.forces += &force;
}
