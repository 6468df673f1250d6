//! FEBio, format version 4.0 <https://help.febio.org>: rigid bones and cartilage faces, fibres as nonlinear springs, sliding contact by penalty. mm, N, MPa.
//!
//! The tibia is fixed. In model.feb the femur does not turn and 20 N of compression press it on, a start on which loads of one's own are put. Protocols and
//! trials are files beside it, which take the knee from it.

mod menisci;
mod steps;

use super::{File, bent, contact_name, contact_stiffness, law_of, named};
use crate::error::BuildError;
use crate::model_file::LoadedModel;
use crate::report::html::escaped;
use decks::Imposed;
use meshes::Point;
use notices::{Kind, Notice};
use sim::spec::BundleSpec;
use std::fmt::Write;
pub(super) use steps::ENDING;

/// Compression that presses the femur on [N].
const COMPRESSION_N: f64 = 20.0;
/// How far from the origin the points lie that show a bone's axes [mm]: coordinates have six decimals, so directions have eight.
const AXIS_MM: f64 = 100.0;
/// How far a fibre's curve reaches into slack and along its last line [mm]; FEBio goes on straight from there.
const FAR_SLACK_MM: f64 = 100.0;
const FAR_LINE_MM: f64 = 50.0;

/// What the file does otherwise than the model.
pub(super) fn warnings(model: &LoadedModel) -> Vec<Notice> {
    let mut out: Vec<Notice> = bent(model).into_iter().collect();
    out.push(Kind::NotInFormat.notice(
        "bones are rigid shells; contact is FEBio's sliding-elastic by penalty; not run here, as FEBio is not at hand",
    ));
    if !model.spec.menisci.is_empty() {
        out.push(Kind::NotInFormat.notice("menisci are deformable there, and their coronary ligament is left out"));
    }
    out
}

/// What FEBio writes of the knee.
const OUTPUT: &str = "<Output><logfile><rigid_body_data data=\"x;y;z;qx;qy;qz;qw;Fx;Fy;Fz;Mx;My;Mz\"/></logfile>\
     <plotfile type=\"febio\"><var type=\"displacement\"/><var type=\"contact pressure\"/></plotfile></Output>";

/// The file of the knee itself.
const KNEE: &str = "model.feb";

/// model.feb, and a file a protocol or trial.
pub(super) fn files(model: &LoadedModel, imposed: &[Imposed]) -> Result<Vec<File>, BuildError> {
    let mut out = vec![(KNEE.to_owned(), knee(model)?.into_bytes())];
    out.extend(steps::files(model, imposed)?);
    Ok(out)
}

fn knee(model: &LoadedModel) -> Result<String, BuildError> {
    let (mut nodes, mut elements, mut surfaces) = (String::new(), String::new(), String::new());
    let mut domains = String::new();
    let (mut node, mut element) = (0, 0);
    for n in named(model) {
        let first: usize = node;
        let _ = writeln!(nodes, "<Nodes name=\"{}\">", n.name);
        for p in &n.mesh.vertices {
            node += 1;
            let _ = writeln!(nodes, "<node id=\"{node}\">{}</node>", place(p));
        }
        nodes += "</Nodes>\n";
        let _ = writeln!(elements, "<Elements type=\"tri3\" name=\"{}_part\">", n.name);
        let _ = writeln!(surfaces, "<Surface name=\"{}_surface\">", n.name);
        for t in &n.mesh.triangles {
            element += 1;
            let [a, b, c] = t.map(|v| v as usize + first + 1);
            let _ = writeln!(elements, "<elem id=\"{element}\">{a},{b},{c}</elem>");
            let _ = writeln!(surfaces, "<tri3 id=\"{element}\">{a},{b},{c}</tri3>");
        }
        elements += "</Elements>\n";
        surfaces += "</Surface>\n";
        let material = if n.femur { "femur" } else { "tibia" };
        let _ = writeln!(
            domains,
            "<ShellDomain name=\"{}_part\" mat=\"{material}\"><shell_thickness>0.01</shell_thickness></ShellDomain>",
            n.name
        );
    }
    let fibres = fibres(model, node)?;
    let count = model.spec.fibres.len();
    let frames = frames(model, node + 2 * count);
    let between = menisci::menisci(model, (node + 2 * count + FRAME_NODES, element, count));
    let mut pairs = String::new();
    for pair in &model.spec.contact.pairs {
        let (f, t) = (contact_name(model, &pair.femur, true), contact_name(model, &pair.tibia, false));
        let _ = writeln!(
            pairs,
            "<SurfacePair name=\"{f}_on_{t}\"><primary>{f}_surface</primary><secondary>{t}_surface</secondary></SurfacePair>"
        );
    }
    Ok(format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<febio_spec version=\"4.0\">\n<!-- {}{} -->\n<Module type=\"solid\"/>\n\
         <Control><analysis>STATIC</analysis><time_steps>20</time_steps><step_size>0.05</step_size><solver type=\"solid\"><symmetric_stiffness>non-symmetric</symmetric_stiffness></solver></Control>\n\
         <Globals><Constants><T>0</T><R>0</R><Fc>0</Fc></Constants></Globals>\n\
         <Material>{}{}</Material>\n<Mesh>\n{nodes}{}{}{}{elements}{}{surfaces}{}{}{}{}{pairs}{}</Mesh>\n<MeshDomains>\n{domains}{}</MeshDomains>\n\
         <Boundary>{}{}{}</Boundary>\n<Rigid>{}</Rigid>\n<Contact>{}{}</Contact>\n<Discrete>{}{}{}</Discrete>\n<LoadData>\n{}</LoadData>\n\
         {OUTPUT}\n</febio_spec>\n",
        decks::febio::MODEL,
        // two hyphens end a comment of XML
        model.spec.id.replace("--", "- -").replace(['\n', '\r'], " "),
        materials(model),
        between.materials,
        fibres.nodes,
        frames.nodes,
        between.nodes,
        between.elements,
        between.surfaces,
        frames.sets,
        fibres.sets,
        between.sets,
        between.pairs,
        between.domains,
        fibres.boundary,
        frames.boundary,
        between.boundary,
        rigid(model),
        contact(model),
        between.contact,
        between.springs,
        fibres.discrete,
        between.discrete,
        fibres.curves
    ))
}

fn materials(model: &LoadedModel) -> String {
    let middle = |femur: bool| if femur { model.spec.frames.femur.origin } else { model.spec.frames.tibia.origin };
    [(1, "femur", true), (2, "tibia", false)]
        .map(|(id, name, femur)| {
            format!("<material id=\"{id}\" name=\"{name}\" type=\"rigid body\"><density>1e-9</density><center_of_mass>{}</center_of_mass></material>", place(&middle(femur)))
        })
        .concat()
}

/// The tibia stays where it is.
const FIXED: &str = "<rigid_bc name=\"tibia fixed\" type=\"rigid_fixed\"><rb>tibia</rb><Rx_dof>1</Rx_dof><Ry_dof>1</Ry_dof><Rz_dof>1</Rz_dof>\
     <Ru_dof>1</Ru_dof><Rv_dof>1</Rv_dof><Rw_dof>1</Rw_dof></rigid_bc>";

/// The tibia is fixed, the femur pressed on by the compression and kept from turning: FEBio's rigid joints are left to whoever loads it otherwise.
fn rigid(model: &LoadedModel) -> String {
    let down = -model.spec.frames.tibia.superior * COMPRESSION_N;
    let turning = "<rigid_bc name=\"femur does not turn\" type=\"rigid_fixed\"><rb>femur</rb><Rx_dof>0</Rx_dof><Ry_dof>0</Ry_dof><Rz_dof>0</Rz_dof><Ru_dof>1</Ru_dof><Rv_dof>1</Rv_dof><Rw_dof>1</Rw_dof></rigid_bc>";
    let loads: String = [("Rx", down.x), ("Ry", down.y), ("Rz", down.z)]
        .map(|(dof, n)| {
            format!("<rigid_load name=\"compression {dof}\" type=\"rigid_force\"><rb>femur</rb><dof>{dof}</dof><value lc=\"1\">{n:.6}</value><load_type>0</load_type><relative>0</relative></rigid_load>")
        })
        .concat();
    format!("{FIXED}{turning}{loads}")
}

/// Penalty by which a contact of two passes presses as the model does [MPa/mm]: each pass adds its own force.
fn penalty(model: &LoadedModel) -> f64 {
    contact_stiffness(model) / 2.0
}

fn contact(model: &LoadedModel) -> String {
    let pairs = model.spec.contact.pairs.iter().map(|pair| {
        let name = format!("{}_on_{}", contact_name(model, &pair.femur, true), contact_name(model, &pair.tibia, false));
        format!(
            "<contact name=\"{name}\" type=\"sliding-elastic\" surface_pair=\"{name}\"><laugon>PENALTY</laugon><penalty>{:.6}</penalty><auto_penalty>0</auto_penalty><two_pass>1</two_pass><search_radius>5</search_radius><symmetric_stiffness>0</symmetric_stiffness><fric_coeff>{}</fric_coeff></contact>",
            penalty(model),
            model.spec.contact.friction
        )
    });
    pairs.collect()
}

/// What the anatomical frames are in each section of the file.
struct Frames {
    nodes: String,
    sets: String,
    boundary: String,
}

/// Nodes of both frames.
const FRAME_NODES: usize = 8;

/// The anatomical frames as nodes that move with the bones: of each the origin, and one medial, anterior and superior of it. `import-febio` reads them, and who
/// logs them has the knee's motion.
fn frames(model: &LoadedModel, nodes: usize) -> Frames {
    let mut out =
        Frames { nodes: "<Nodes name=\"frame_points\">\n".into(), sets: String::new(), boundary: String::new() };
    let both = [("femur", &model.spec.frames.femur), ("tibia", &model.spec.frames.tibia)];
    let mut node = nodes;
    for (bone, frame) in both {
        let set = format!("{bone}{}", decks::febio::ANATOMICAL);
        let mut ids = Vec::new();
        for way in [meshes::Vector::zeros(), frame.medial, frame.anterior, frame.superior] {
            node += 1;
            ids.push(node.to_string());
            let _ = writeln!(out.nodes, "<node id=\"{node}\">{}</node>", place(&(frame.origin + way * AXIS_MM)));
        }
        let _ = writeln!(out.sets, "<NodeSet name=\"{set}\">{}</NodeSet>", ids.join(","));
        let _ =
            write!(out.boundary, "<bc name=\"frame of {bone}\" type=\"rigid\" node_set=\"{set}\"><rb>{bone}</rb></bc>");
    }
    out.nodes += "</Nodes>\n";
    out
}

/// What the fibres are in each section of the file.
struct Fibres {
    nodes: String,
    sets: String,
    boundary: String,
    discrete: String,
    curves: String,
}

/// Every fibre a spring between two nodes of its own that move with the bones; a fibre's curve is force over lengthening from the CT pose.
fn fibres(model: &LoadedModel, nodes: usize) -> Result<Fibres, BuildError> {
    let all = &model.spec.fibres;
    let mut out = Fibres { nodes: "<Nodes name=\"fibre_ends\">\n".into(), sets: String::new(), boundary: String::new(), discrete: String::new(), curves: "<load_controller id=\"1\" type=\"loadcurve\"><interpolate>LINEAR</interpolate><points><pt>0,0</pt><pt>1,1</pt></points></load_controller>\n".into() };
    for (k, p) in all.iter().flat_map(|f| [&f.femur, &f.tibia]).enumerate() {
        let _ = writeln!(out.nodes, "<node id=\"{}\">{}</node>", nodes + k + 1, place(p));
    }
    out.nodes += "</Nodes>\n";
    for (bone, offset) in [("femur", 1), ("tibia", 2)] {
        let ids: Vec<String> = (0..all.len()).map(|k| (nodes + 2 * k + offset).to_string()).collect();
        let _ = writeln!(out.sets, "<NodeSet name=\"fibre_ends_{bone}\">{}</NodeSet>", ids.join(","));
        let _ = write!(
            out.boundary,
            "<bc name=\"fibres on {bone}\" type=\"rigid\" node_set=\"fibre_ends_{bone}\"><rb>{bone}</rb></bc>"
        );
    }
    let mut springs = String::new();
    for (k, fibre) in all.iter().enumerate() {
        let Some(bundle) = model.spec.bundles.iter().find(|b| b.name == fibre.bundle) else {
            return Err(BuildError::File(format!(
                "a fibre is of the bundle {}, which the model does not have",
                fibre.bundle
            )));
        };
        let count = all.iter().filter(|f| f.bundle == fibre.bundle).count();
        let name = escaped(&format!("{}_{}", bundle.name, k + 1));
        let _ = writeln!(
            out.sets,
            "<DiscreteSet name=\"{name}\"><delem>{},{}</delem></DiscreteSet>",
            nodes + 2 * k + 1,
            nodes + 2 * k + 2
        );
        let points: String =
            curve(model, bundle, count)?.iter().map(|(x, f)| format!("<pt>{x:.6},{f:.6}</pt>")).collect();
        let _ = writeln!(
            out.discrete,
            "<discrete_material id=\"{0}\" name=\"{name}\" type=\"nonlinear spring\"><scale>1</scale><measure>elongation</measure><force type=\"point\"><interpolate>LINEAR</interpolate><extend>EXTRAPOLATE</extend><points>{points}</points></force></discrete_material>",
            k + 1
        );
        let _ = writeln!(springs, "<discrete dmat=\"{}\" discrete_set=\"{name}\"/>", k + 1);
    }
    out.discrete += &springs;
    Ok(out)
}

/// Force of a fibre over its lengthening from the CT pose: the law's own table, between a far slack and a far line.
fn curve(model: &LoadedModel, bundle: &BundleSpec, fibres: usize) -> Result<Vec<(f64, f64)>, BuildError> {
    let law = law_of(model, bundle, fibres)?;
    let first = law.slack_length() - law.reference_length;
    let rows = law.table(FAR_LINE_MM).into_iter().map(|[x, f]| (first + x, f));
    Ok([(first - FAR_SLACK_MM, 0.0)].into_iter().chain(rows).collect())
}

fn place(p: &Point) -> String {
    format!("{:.6},{:.6},{:.6}", p.x, p.y, p.z)
}
