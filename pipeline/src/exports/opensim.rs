//! OpenSim: three cylindrical joints, a Blankevoort1991Ligament a fibre, elastic-foundation contact or JAM's. Metres, newtons, radians.
//!
//! The tibia is ground. Coordinates are the model's: clinical displacements from the CT pose. A fibre's slack length and stiffness are set so that its
//! force is the model's at every length. Both faces of a contact pair carry springs and OpenSim halves their areas, which is the model's mean of both
//! passes. Contact meshes must be closed there: the faces are thickened away from
//! the contact, by more than twice the deepest overclosure that is to be expected.

use super::{File, OpensimContact, bent, contact_name, contact_stiffness, law_of, named, thickened};
use crate::error::BuildError;
use crate::model_file::LoadedModel;
use crate::report::html::escaped;
use decks::Imposed;
use decks::opensim::ANATOMICAL;
use meshes::frame::{AnatomicalFrame, Side};
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use nalgebra::{Matrix3, Rotation3};
use notices::{Kind, Notice};
use sim::coordinate::{AP, FE, IE, ML, SI, Six, VV};
use sim::joint::Joint;
use sim::spec::BundleSpec;
use std::fmt::Write;
use steps::Driven;
pub(super) use steps::ENDING;

/// How far the back of a contact mesh lies behind its face [mm]; a point deeper than half of it would be pushed out at the back.
const THICKENED_MM: f64 = 4.0;
/// Mass of a link between two joints [kg]: OpenSim asks for one.
const LINK_KG: f64 = 0.01;

mod jam;
mod patella;
mod steps;

/// What the file does otherwise than the model.
pub(super) fn warnings(model: &LoadedModel, contact: OpensimContact) -> Vec<Notice> {
    let table = contact == OpensimContact::Elastic || model.spec.contact.layer.is_none();
    let mut out: Vec<Notice> = bent(model).into_iter().filter(|_| table).collect();
    if contact == OpensimContact::Jam && model.spec.contact.friction > 0.0 {
        out.push(Kind::NotInFormat.notice("contact is without friction there"));
    }
    out.extend(other_laws(model).map(|text| Kind::NotInFormat.notice(text)));
    out
}

/// OpenSim's ligament is a toe and a line: what that makes of other laws.
fn other_laws(model: &LoadedModel) -> Option<String> {
    let off = |b: &BundleSpec| law_of(model, b, 1).map_or(0.0, |law| law.off_toe_and_line(COMPARED_TOES));
    let of = model.spec.bundles.iter().map(|b| (off(b), &b.name));
    let (most, name) = of.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(off, _)| *off > 0.0)?;
    Some(format!(
        "ligaments of another law become a toe and a line, as OpenSim has them: {name} differs by up to {most:.2} N up to {COMPARED_TOES} toe strains"
    ))
}

/// Stretch up to which laws are compared, in toe strains [-]: ligaments fail soon after.
const COMPARED_TOES: f64 = 4.0;

/// model.osim and Geometry/, and a model a protocol or trial with the script that takes them through.
pub(super) fn files(
    model: &LoadedModel,
    contact: OpensimContact,
    imposed: &[Imposed],
) -> Result<Vec<File>, BuildError> {
    let fault = |e: sim::SimError| BuildError::in_file(&model.folder, e);
    let joint = Joint::new(&model.spec.frames, model.spec.side).map_err(fault)?;
    let patella = patella::parts(model, contact);
    let written = |driven: &Driven| document(model, &joint, (contact, &patella), driven);
    let mut files = vec![("model.osim".to_owned(), written(&Driven::default())?.into_bytes())];
    for i in imposed {
        files.push((format!("{}{ENDING}", i.stem), written(&Driven::of(i))?.into_bytes()));
    }
    files.push((steps::SCRIPT.0.to_owned(), steps::SCRIPT.1.as_bytes().to_vec()));
    files.extend(patella.files);
    if contact == OpensimContact::Jam {
        files.extend(jam::backs(model).map(|(name, mesh)| (format!("Geometry/{name}"), obj(mesh).into_bytes())));
    }
    for n in named(model) {
        let open = n.bone || contact == OpensimContact::Jam;
        let mesh = if open { n.mesh.clone() } else { thickened(n.mesh, THICKENED_MM) };
        files.push((format!("Geometry/{}.obj", n.name), obj(&mesh).into_bytes()));
    }
    Ok(files)
}

fn document(
    model: &LoadedModel,
    joint: &Joint,
    (law, patella): (OpensimContact, &patella::Parts),
    driven: &Driven,
) -> Result<String, BuildError> {
    let id: String = model.spec.id.chars().map(|c| if is_of_a_name(c) { c } else { '_' }).collect();
    let id = escaped(&id);
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<OpenSimDocument Version=\"40600\">\n<Model name=\"{id}\">\n\
         <gravity>0 0 0</gravity><length_units>meters</length_units><force_units>N</force_units>\n\
         <Ground name=\"ground\">{}<attached_geometry>{}</attached_geometry></Ground>\n<BodySet name=\"bodyset\"><objects>\n",
        anatomical(&model.spec.frames.tibia, model.spec.side, "/ground"),
        geometry(model, false, "/ground")
    );
    let femur = model.spec.bodies.iter().find(|b| b.name == "femur");
    let (mass, inertia) = femur.map_or((1.0, 1e-3), |b| (b.mass_tonne * 1e3, b.inertia_tonne_mm2 * 1e-3));
    for (name, mass, inertia) in
        [("link_tibial", LINK_KG, 1e-6), ("link_floating", LINK_KG, 1e-6), ("femur", mass, inertia)]
    {
        let is_femur = name == "femur";
        let shown = if is_femur { geometry(model, true, "/bodyset/femur") } else { String::new() };
        let frame = |name: &str| anatomical(&model.spec.frames.femur, model.spec.side, name);
        let frame = if is_femur { frame("/bodyset/femur") } else { String::new() };
        let wraps = if is_femur { patella.wraps.as_str() } else { "" };
        let _ = writeln!(
            out,
            "<Body name=\"{name}\">{frame}<mass>{mass:?}</mass><mass_center>0 0 0</mass_center><inertia>{inertia:?} {inertia:?} {inertia:?} 0 0 0</inertia>{wraps}<attached_geometry>{shown}</attached_geometry></Body>"
        );
    }
    out += &patella.body;
    out += "</objects></BodySet>\n<JointSet name=\"jointset\"><objects>\n";
    out += &joints(joint, &driven.flexion);
    out += &patella.joint;
    out += "</objects></JointSet>\n<ContactGeometrySet name=\"contactgeometryset\"><objects>\n";
    for n in named(model).iter().filter(|n| !n.bone) {
        let frame = if n.femur { "/bodyset/femur" } else { "/ground" };
        if law == OpensimContact::Jam {
            out += &jam::mesh(model, n, frame);
            continue;
        }
        let _ = writeln!(
            out,
            "<ContactMesh name=\"{0}\"><socket_frame>{frame}</socket_frame><location>0 0 0</location><orientation>0 0 0</orientation><filename>Geometry/{0}.obj</filename></ContactMesh>",
            n.name
        );
    }
    out += &patella.geometry;
    out += "</objects></ContactGeometrySet>\n<ForceSet name=\"forceset\"><objects>\n";
    out += &ligaments(model)?;
    out += &match law {
        OpensimContact::Elastic => contact(model),
        OpensimContact::Jam => jam::forces(model),
    };
    out += &patella.forces;
    out += &driven.forces;
    let _ = write!(out, "</objects></ForceSet>\n{}</Model>\n</OpenSimDocument>\n", driven.controllers);
    Ok(out)
}

/// Whether a name of OpenSim may have a letter: these part its paths, or are refused.
fn is_of_a_name(c: char) -> bool {
    !c.is_whitespace() && !c.is_control() && !"\\/*+".contains(c)
}

/// A frame as OpenSim has one: x forwards, y to the head, z to the right.
fn anatomical(frame: &AnatomicalFrame, side: Side, body: &str) -> String {
    let [x, y, z] = angles(&turned(frame, side));
    format!(
        "<components><PhysicalOffsetFrame name=\"{ANATOMICAL}\"><socket_parent>{body}</socket_parent><translation>{}</translation><orientation>{x:?} {y:?} {z:?}</orientation></PhysicalOffsetFrame></components>",
        metres(&frame.origin)
    )
}

/// Forwards, to the head and to the right: what a frame's axes are for OpenSim.
fn turned(frame: &AnatomicalFrame, side: Side) -> Matrix3<f64> {
    let right = if side == Side::Left { frame.medial } else { -frame.medial };
    Matrix3::from_columns(&[frame.anterior, frame.superior, right])
}

/// The x-y-z angles of a rotation [rad]; the first is taken off before the others are read, so that they are exact where the second is a right angle.
fn angles(turn: &Matrix3<f64>) -> [f64; 3] {
    let x = (-turn[(1, 2)]).atan2(turn[(2, 2)]);
    let rest = Rotation3::from_axis_angle(&Vector::x_axis(), -x).into_inner() * turn;
    [x, rest[(0, 2)].atan2(rest[(2, 2)]), rest[(1, 0)].atan2(rest[(1, 1)])]
}

/// The chain: the axes' rotations and shifts turned so that coordinates have clinical signs; `flexion` is what stands in the coordinate of that name.
fn joints(joint: &Joint, flexion: &str) -> String {
    let screws = joint.pose(&Six::zeros()).screws;
    let links = [
        ("tibial_axis", "/ground", "/bodyset/link_tibial", IE, SI, ["external", "superior"]),
        ("floating_axis", "/bodyset/link_tibial", "/bodyset/link_floating", VV, AP, ["valgus", "anterior"]),
        ("femoral_axis", "/bodyset/link_floating", "/bodyset/femur", FE, ML, ["flexion", "lateral"]),
    ];
    let mut out = String::new();
    for ((name, parent, child, turn, shift, coordinates), axis) in links.into_iter().zip(joint.axes()) {
        let frame = |which: &str, body: &str| {
            format!(
                "<PhysicalOffsetFrame name=\"{name}_{which}\"><socket_parent>{body}</socket_parent><translation>{}</translation><orientation>0 0 0</orientation></PhysicalOffsetFrame>",
                metres(&axis.point)
            )
        };
        let _ = writeln!(
            out,
            "<CustomJoint name=\"{name}\"><socket_parent_frame>{name}_parent</socket_parent_frame><socket_child_frame>{name}_child</socket_child_frame>\
             <coordinates><Coordinate name=\"{0}\"><range>-3.2 3.2</range>{6}</Coordinate><Coordinate name=\"{1}\"><range>-0.2 0.2</range></Coordinate></coordinates>\
             <frames>{2}{3}</frames>\n<SpatialTransform>{4}{5}</SpatialTransform></CustomJoint>",
            coordinates[0],
            coordinates[1],
            frame("parent", parent),
            frame("child", child),
            axes("rotation", coordinates[0], &screws[turn.index()].angular),
            axes("translation", coordinates[1], &screws[shift.index()].linear),
            if turn == FE { flexion } else { "" }
        );
    }
    out
}

/// Three axes: the first is moved by the coordinate, the others stand still.
fn axes(kind: &str, coordinate: &str, along: &Vector) -> String {
    let helper = if along.x.abs() < 0.7 { Vector::x() } else { Vector::y() };
    let second = along.cross(&helper).normalize();
    let third = along.cross(&second);
    let vector = |v: &Vector| format!("{:?} {:?} {:?}", v.x, v.y, v.z);
    let still = |n: usize, v: &Vector| {
        format!(
            "<TransformAxis name=\"{kind}{n}\"><coordinates></coordinates><axis>{}</axis><Constant name=\"function\"><value>0</value></Constant></TransformAxis>\n",
            vector(v)
        )
    };
    format!(
        "<TransformAxis name=\"{kind}1\"><coordinates>{coordinate}</coordinates><axis>{}</axis><LinearFunction name=\"function\"><coefficients>1 0</coefficients></LinearFunction></TransformAxis>\n{}{}",
        vector(along),
        still(2, &second),
        still(3, &third)
    )
}

fn ligaments(model: &LoadedModel) -> Result<String, BuildError> {
    let mut out = String::new();
    let mut number = std::collections::BTreeMap::new();
    let names = decks::written_names(&model.spec, is_of_a_name);
    for fibre in &model.spec.fibres {
        let Some(bundle) = model.spec.bundles.iter().find(|b| b.name == fibre.bundle) else {
            return Err(BuildError::File(format!(
                "a fibre is of the bundle {}, which the model does not have",
                fibre.bundle
            )));
        };
        let count = model.spec.fibres.iter().filter(|f| f.bundle == fibre.bundle).count() as f64;
        let n: &mut usize = number.entry(&fibre.bundle).or_default();
        *n += 1;
        let bundle_slack = bundle.reference_length_mm / bundle.reference_strain;
        // the model counts stretch from the CT pose: the same stretch for every fibre of a bundle
        let slack = (fibre.femur - fibre.tibia).norm() - (bundle.reference_length_mm - bundle_slack);
        if slack <= 0.0 {
            return Err(BuildError::File(format!(
                "fibre {n} of {} is stretched by more than its length; OpenSim has no such ligament",
                bundle.name
            )));
        }
        let transition = 2.0 * bundle.toe_strain * bundle_slack / slack;
        let stiffness = bundle.stiffness_n_per_mm / count * slack;
        let point = |name: &str, frame: &str, p: &Point| {
            format!(
                "<PathPoint name=\"{name}\"><socket_parent_frame>{frame}</socket_parent_frame><location>{}</location></PathPoint>",
                metres(p)
            )
        };
        let _ = writeln!(
            out,
            "<Blankevoort1991Ligament name=\"{0}_{n}\"><linear_stiffness>{stiffness:?}</linear_stiffness><transition_strain>{transition:?}</transition_strain>\
             <damping_coefficient>0</damping_coefficient><slack_length>{1:?}</slack_length>\
             <path><GeometryPath name=\"path\"><PathPointSet name=\"PathPointSet\"><objects>{2}{3}</objects></PathPointSet></GeometryPath></path></Blankevoort1991Ligament>",
            escaped(&names[&bundle.name]),
            slack * 1e-3,
            point("tibia", "/ground", &fibre.tibia),
            point("femur", "/bodyset/femur", &fibre.femur)
        );
    }
    Ok(out)
}

fn contact(model: &LoadedModel) -> String {
    let stiffness = contact_stiffness(model) * 1e9;
    let mut out = String::new();
    for (k, pair) in model.spec.contact.pairs.iter().enumerate() {
        let parameters: String = [contact_name(model, &pair.femur, true), contact_name(model, &pair.tibia, false)]
            .map(|name| {
                format!(
                    "<ElasticFoundationForce::ContactParameters><geometry>{name}</geometry><stiffness>{stiffness:?}</stiffness><dissipation>1</dissipation><static_friction>{0:?}</static_friction><dynamic_friction>{0:?}</dynamic_friction><viscous_friction>0</viscous_friction></ElasticFoundationForce::ContactParameters>",
                    model.spec.contact.friction
                )
            })
            .concat();
        let _ = writeln!(
            out,
            "<ElasticFoundationForce name=\"contact_{}\"><ElasticFoundationForce::ContactParametersSet name=\"contact_parameters\"><objects>{parameters}</objects></ElasticFoundationForce::ContactParametersSet><transition_velocity>0.01</transition_velocity></ElasticFoundationForce>",
            k + 1
        );
    }
    out
}

fn geometry(model: &LoadedModel, femur: bool, frame: &str) -> String {
    named(model)
        .iter()
        .filter(|n| n.femur == femur)
        .map(|n| {
            let colour = if n.bone { "0.88 0.83 0.74" } else { "0.5 0.69 0.85" };
            format!(
                "<Mesh name=\"{0}\"><socket_frame>{frame}</socket_frame><scale_factors>1 1 1</scale_factors><Appearance><color>{colour}</color></Appearance><mesh_file>{0}.obj</mesh_file></Mesh>",
                n.name
            )
        })
        .collect()
}

fn metres(p: &Point) -> String {
    format!("{:?} {:?} {:?}", p.x * 1e-3, p.y * 1e-3, p.z * 1e-3)
}

/// Wavefront OBJ in metres.
fn obj(mesh: &TriMesh) -> String {
    let mut out = String::new();
    for p in &mesh.vertices {
        let _ = writeln!(out, "v {:.9} {:.9} {:.9}", p.x * 1e-3, p.y * 1e-3, p.z * 1e-3);
    }
    for [a, b, c] in &mesh.triangles {
        let _ = writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    out
}
