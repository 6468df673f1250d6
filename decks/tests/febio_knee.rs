//! A knee as FEBio has it, made in words.

use crate::common::knees::{self, Ligament, ball, points, quads};
use std::fmt::Write;

/// A right knee as FEBio's format 4.0 has it: a ball of 30 mm on a flat plateau, six springs. x forwards, y to the head, z to the right.
pub(crate) struct Knee {
    pub(crate) materials: String,
    pub(crate) mesh: String,
    pub(crate) domains: String,
    pub(crate) boundary: String,
    pub(crate) contact: String,
    pub(crate) discrete: String,
    pub(crate) more: String,
    node: usize,
    element: usize,
    springs: usize,
}

/// Name, femoral and tibial end [mm], lengthening at which it begins to pull [mm].
pub(crate) const LIGAMENTS: [Ligament; 6] = [
    ("ACLam1", [-15.0, 5.0, 5.0], [15.0, -31.0, 0.0], -1.0),
    ("ACLpl1", [-16.0, 0.0, 6.0], [8.0, -31.0, 2.0], -1.4),
    ("PCLal1", [5.0, 0.0, -5.0], [-22.0, -35.0, 0.0], -0.3),
    ("MCLs1", [0.0, 0.0, -40.0], [5.0, -80.0, -30.0], -0.7),
    ("MCLs2", [0.0, 1.0, -40.0], [1.0, -78.0, -30.0], -0.4),
    ("LCL1", [0.0, 0.0, 40.0], [-10.0, -60.0, 35.0], -0.5),
];
pub(crate) const STIFFNESS: f64 = 70.0;
pub(crate) const TOE_MM: f64 = 1.5;
/// MPa/mm.
pub(crate) const PENALTY: f64 = 4.0;
pub(crate) const CONTACT: &str = "<contact name=\"tf\" type=\"sliding-elastic\" surface_pair=\"tf\"><laugon>PENALTY</laugon><penalty>4.0</penalty><auto_penalty>0</auto_penalty><two_pass>0</two_pass><search_radius>5</search_radius></contact>";
pub(crate) const FRAMES: [(&str, [f64; 3]); 2] = [("femur", [0.0, 0.0, 0.0]), ("tibia", [0.0, -30.0, 0.0])];

/// Half the side of the plateau [mm].
const HALF_MM: f64 = 30.0;

pub(crate) fn plateau(height: f64, u: f64, v: f64) -> [f64; 3] {
    knees::plateau(HALF_MM, height, u, v)
}

pub(crate) fn list(nodes: &[usize]) -> String {
    nodes.iter().map(|n| n.to_string()).collect::<Vec<_>>().join(",")
}

impl Knee {
    fn nodes(&mut self, name: &str, points: impl IntoIterator<Item = [f64; 3]>) -> usize {
        let first = self.node + 1;
        let _ = writeln!(self.mesh, "<Nodes name=\"{name}\">");
        for [x, y, z] in points {
            self.node += 1;
            let _ = writeln!(self.mesh, "<node id=\"{}\">{x:?},{y:?},{z:?}</node>", self.node);
        }
        self.mesh += "</Nodes>\n";
        first
    }

    /// A face as quads of a shell of that material, and as the surface `NAME_surface`.
    pub(crate) fn face(&mut self, name: &str, at: impl Fn(f64, f64) -> [f64; 3], turned: bool) {
        let first = self.nodes(&format!("{name}_nodes"), points(at));
        let (mut elements, mut faces) = (String::new(), String::new());
        for q in quads(first, turned) {
            self.element += 1;
            let _ = writeln!(elements, "<elem id=\"{}\">{}</elem>", self.element, list(&q));
            let _ = writeln!(faces, "<quad4 id=\"{}\">{}</quad4>", self.element, list(&q));
        }
        let _ = writeln!(self.mesh, "<Elements type=\"quad4\" name=\"{name}_part\">\n{elements}</Elements>");
        let _ = writeln!(self.mesh, "<Surface name=\"{name}_surface\">\n{faces}</Surface>");
        let _ = writeln!(
            self.domains,
            "<ShellDomain name=\"{name}_part\" mat=\"{name}\"><shell_thickness>0.01</shell_thickness></ShellDomain>"
        );
    }

    /// A layer of one hexahedron in depth, its inner nodes fixed to the bone of that material.
    fn layer(&mut self, name: &str, at: impl Fn(f64, f64, bool) -> [f64; 3], turned: bool) {
        let outer = self.nodes(&format!("{name}_outer"), points(|u, v| at(u, v, true)));
        let inner = self.nodes(&format!("{name}_inner"), points(|u, v| at(u, v, false)));
        let (mut elements, mut faces) = (String::new(), String::new());
        for (top, low) in quads(outer, turned).into_iter().zip(quads(inner, turned)) {
            self.element += 1;
            let hex: Vec<usize> = low.into_iter().chain(top).collect();
            let _ = writeln!(elements, "<elem id=\"{}\">{}</elem>", self.element, list(&hex));
            let _ = writeln!(faces, "<quad4 id=\"{}\">{}</quad4>", self.element, list(&top));
        }
        let _ = writeln!(self.mesh, "<Elements type=\"hex8\" name=\"{name}_cartilage\">\n{elements}</Elements>");
        let _ = writeln!(self.mesh, "<Surface name=\"{name}_surface\">\n{faces}</Surface>");
        let _ = writeln!(self.domains, "<SolidDomain name=\"{name}_cartilage\" mat=\"cartilage\"/>");
        let _ = write!(self.boundary, "<bc type=\"rigid\" node_set=\"{name}_inner\"><rb>{name}</rb></bc>");
    }

    /// A spring with its own nodes; `material` is the inside of its discrete_material.
    pub(crate) fn spring(&mut self, name: &str, ends: [[f64; 3]; 2], kind: &str, material: &str) {
        self.springs += 1;
        let first = self.nodes(&format!("{name}_ends"), ends);
        for (bone, node) in [("femur", first), ("tibia", first + 1)] {
            let _ = writeln!(self.mesh, "<NodeSet name=\"{name}_{bone}\">{node}</NodeSet>");
            let _ = write!(self.boundary, "<bc type=\"rigid\" node_set=\"{name}_{bone}\"><rb>{bone}</rb></bc>");
        }
        let _ =
            writeln!(self.mesh, "<DiscreteSet name=\"{name}\"><delem>{},{}</delem></DiscreteSet>", first, first + 1);
        let k = self.springs;
        let _ = writeln!(
            self.discrete,
            "<discrete_material id=\"{k}\" name=\"{name}\" type=\"{kind}\">{material}</discrete_material><discrete dmat=\"{k}\" discrete_set=\"{name}\"/>"
        );
    }

    pub(crate) fn frames(&mut self) {
        for (bone, origin) in FRAMES {
            let at = |way: [f64; 3]| [0, 1, 2].map(|k| origin[k] + 50.0 * way[k]);
            // of a right knee z is lateral
            let points = [at([0.0; 3]), at([0.0, 0.0, -1.0]), at([1.0, 0.0, 0.0]), at([0.0, 1.0, 0.0])];
            self.nodes(&format!("{bone}_anatomical"), points);
        }
    }

    pub(crate) fn text(&self) -> String {
        format!(
            "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\n<febio_spec version=\"4.0\">\n<Module type=\"solid\"/>\n<Control><analysis>STATIC</analysis></Control>\n<Material>\n{}</Material>\n<Mesh>\n{}<SurfacePair name=\"tf\"><primary>femur_surface</primary><secondary>tibia_surface</secondary></SurfacePair>\n</Mesh>\n<MeshDomains>\n{}</MeshDomains>\n<Boundary>{}</Boundary>\n<Contact>{}</Contact>\n<Discrete>\n{}</Discrete>\n{}\n</febio_spec>\n",
            self.materials, self.mesh, self.domains, self.boundary, self.contact, self.discrete, self.more
        )
    }
}

/// The points of slack, toe and line.
pub(crate) fn curve(begins: f64) -> Vec<[f64; 2]> {
    let toe = |x: f64| STIFFNESS / (4.0 * TOE_MM) * x * x;
    let mut out = vec![[begins - 50.0, 0.0]];
    out.extend((0..=20).map(|k| 2.0 * TOE_MM * f64::from(k) / 20.0).map(|x| [begins + x, toe(x)]));
    out.push([begins + 2.0 * TOE_MM + 40.0, toe(2.0 * TOE_MM) + STIFFNESS * 40.0]);
    out
}

pub(crate) fn pts(points: &[[f64; 2]]) -> String {
    points.iter().map(|[x, f]| format!("<pt>{x:?},{f:?}</pt>")).collect()
}

pub(crate) fn force(points: &[[f64; 2]], extend: &str) -> String {
    format!(
        "<force type=\"point\"><interpolate>LINEAR</interpolate><extend>{extend}</extend><points>{}</points></force>",
        pts(points)
    )
}

pub(crate) fn springs(knee: &mut Knee) {
    for (name, femur, tibia, begins) in LIGAMENTS {
        let material = format!("<scale>1</scale><measure>elongation</measure>{}", force(&curve(begins), "EXTRAPOLATE"));
        knee.spring(name, [femur, tibia], "nonlinear spring", &material);
    }
}

pub(crate) fn bare() -> Knee {
    let empty = String::new;
    let rigid = |id: usize, name: &str, at: [f64; 3]| {
        format!(
            "<material id=\"{id}\" name=\"{name}\" type=\"rigid body\"><density>1e-9</density><center_of_mass>{:?},{:?},{:?}</center_of_mass></material>\n",
            at[0], at[1], at[2]
        )
    };
    let materials = rigid(1, "femur", FRAMES[0].1) + &rigid(2, "tibia", FRAMES[1].1);
    Knee {
        materials,
        mesh: empty(),
        domains: empty(),
        boundary: empty(),
        contact: CONTACT.into(),
        discrete: empty(),
        more: empty(),
        node: 0,
        element: 0,
        springs: 0,
    }
}

pub(crate) fn knee() -> Knee {
    let mut knee = bare();
    knee.face("femur", |u, v| ball(30.0, u, v), true);
    knee.face("tibia", |u, v| plateau(-30.0, u, v), false);
    springs(&mut knee);
    knee.frames();
    knee
}

/// A knee whose cartilages deform: layers of 2 and 3 mm, fixed to rigid bones behind.
pub(crate) fn layered(material: &str) -> Knee {
    let mut knee = bare();
    knee.materials += &format!("<material id=\"3\" name=\"cartilage\" {material}</material>\n");
    knee.layer("femur", |u, v, outer| ball(if outer { 30.0 } else { 28.0 }, u, v), true);
    knee.layer("tibia", |u, v, outer| plateau(if outer { -30.0 } else { -33.0 }, u, v), false);
    springs(&mut knee);
    knee.frames();
    knee
}
