//! What a heap of files is, by geometry: which surface is which bone, CT or scan, of which knee; in which frame points lie.

mod labels;

pub(crate) use labels::key_of;
pub use labels::{LabelGuesses, guess_labels};

use crate::anatomy::{SideEvidence, detect_side, looks_swapped};
use crate::register::{RegisterOptions, register_bone};
use crate::specimen::PointFrame;
use meshes::Point;
use meshes::query::SurfaceQuery;
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::topology::Topology;
use rayon::prelude::*;

/// What a surface is in a specimen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// The femur in CT.
    CtFemur,
    /// The tibia with the fibula in CT.
    CtTibfib,
    /// The patella in CT.
    CtPatella,
    /// The femur's scan.
    ScanFemur,
    /// The scan of the tibia with the fibula.
    ScanTibfib,
}

impl Role {
    /// Its key in specimen.toml: table and name.
    pub fn key(self) -> (&'static str, &'static str) {
        match self {
            Role::CtFemur => ("ct", "femur"),
            Role::CtTibfib => ("ct", "tibfib"),
            Role::CtPatella => ("ct", "patella"),
            Role::ScanFemur => ("scans", "femur"),
            Role::ScanTibfib => ("scans", "tibfib"),
        }
    }
}

/// What was guessed of a surface, and from what.
#[derive(Clone, Debug, PartialEq)]
pub struct Guess {
    /// What it is; `None` where nothing tells.
    pub role: Option<Role>,
    /// The evidence, in words.
    pub why: String,
    /// Whether it is a bone of CT beside which no other was found.
    pub lone_bone: bool,
}

/// What was guessed of all.
#[derive(Clone, Debug)]
pub struct Guesses {
    /// A guess a surface, in the order given.
    pub surfaces: Vec<Guess>,
    /// Which knee, where both CT bones are there.
    pub side: Option<SideEvidence>,
}

/// A bone whose middle extent is below this is taken for a patella [mm]: patellae are 40 to 55 mm wide, the joint ends of femur and
/// tibia 60 to 110 (see [`crate::specimen::IngestOptions::least_width_mm`]).
const PATELLA_MM: f64 = 55.0;

/// Twice its volume over its area, below which a closed surface is a sheet or a meniscus and no bone [mm]: patellae have 7, cartilages and menisci 2 to 4.
const SHEET_MM: f64 = 5.0;

/// A surface as wide as this is a bone, however hollow [mm]: femoral cartilage is about 60 wide.
const BONE_MM: f64 = 70.0;

/// Which surface is what. CT surfaces have no colours and are closed, or two open ones are all that there are; a scan is laid on both bones, and
/// belongs to the one it fits.
pub fn guess(surfaces: &[ColouredMesh]) -> Guesses {
    let unknown = |why: &str| Guess { role: None, why: why.into(), lone_bone: false };
    let mut found: Vec<Guess> = surfaces.iter().map(|_| unknown("")).collect();
    let (mut ct, mut scans, mut bare) = (Vec::new(), Vec::new(), Vec::new());
    for (i, s) in surfaces.iter().enumerate() {
        let open = Topology::of(&s.mesh).boundary_edges;
        let extent = crate::ingest::middle_extent(&s.mesh);
        if !s.colours.is_empty() || open > 0 {
            scans.push(i);
            if s.colours.is_empty() && extent >= PATELLA_MM {
                bare.push(i);
            }
            found[i].why =
                if s.colours.is_empty() { format!("{open} open edges: a scan") } else { "coloured: a scan".into() };
        } else if extent < BONE_MM && 2.0 * s.mesh.volume().abs() / s.mesh.area() < SHEET_MM {
            found[i].why = "closed and thin: a cartilage or a meniscus, no bone".into();
        } else if extent < PATELLA_MM {
            let why = format!("closed, {extent:.0} mm wide: a patella in CT");
            found[i] = Guess { role: Some(Role::CtPatella), why, lone_bone: false };
        } else {
            ct.push(i);
            found[i].why = "closed, no colours: a bone in CT".into();
        }
    }
    // a bone of CT may be open where it was cut
    if ct.len() < 2 && ct.len() + bare.len() == 2 {
        for i in bare {
            found[i].why = "open, but the only other one without colours: a bone in CT, cut".into();
            scans.retain(|s| *s != i);
            ct.push(i);
        }
    }
    let [a, b] = ct[..] else {
        for i in ct.iter().chain(&scans) {
            found[*i].why += &format!("; {} bones in CT were found where two are needed to tell more", ct.len());
        }
        if let [lone] = ct[..] {
            found[lone].lone_bone = true;
        }
        // a patella alone is no CT
        found.iter_mut().for_each(|g| g.role = None);
        return Guesses { surfaces: found, side: None };
    };
    let (femur, tibfib) = if looks_swapped(&surfaces[a].mesh, &surfaces[b].mesh) { (b, a) } else { (a, b) };
    for (i, role, why) in [
        (femur, Role::CtFemur, "; condyles and no fibula: the femur"),
        (tibfib, Role::CtTibfib, "; plateau or fibula: the tibia"),
    ] {
        found[i].role = Some(role);
        found[i].why += why;
    }
    let sides = detect_side(&surfaces[femur].mesh, &surfaces[tibfib].mesh);
    let fits: Vec<[Option<(f64, f64)>; 2]> =
        scans.par_iter().map(|&i| [femur, tibfib].map(|bone| fit(&surfaces[bone].mesh, &surfaces[i]))).collect();
    for (&i, fit) in scans.iter().zip(&fits) {
        let better = |a: &(f64, f64), b: &(f64, f64)| a.0 > b.0;
        let role = match fit {
            [Some(f), Some(t)] => Some(if better(f, t) { Role::ScanFemur } else { Role::ScanTibfib }),
            [Some(_), None] => Some(Role::ScanFemur),
            [None, Some(_)] => Some(Role::ScanTibfib),
            [None, None] => None,
        };
        let told = |name: &str, f: &Option<(f64, f64)>| match f {
            Some((share, rms)) => format!("{name} {:.0} % of bare bone, {rms:.2} mm", 100.0 * share),
            None => format!("{name} not at all"),
        };
        found[i].role = role;
        found[i].why += &format!("; fits {}, {}", told("femur", &fit[0]), told("tibia", &fit[1]));
    }
    Guesses { surfaces: found, side: sides }
}

/// Share of a scan's bare bone that lies on a bone, and how far off [mm]; `None` where the registration is not to be believed.
fn fit(bone: &TriMesh, scan: &ColouredMesh) -> Option<(f64, f64)> {
    let options = RegisterOptions::default();
    let r = register_bone(bone, scan, &[], &options).ok()?;
    (r.inlier_fraction >= options.inlier_limit).then_some((r.inlier_fraction, r.rms_bare_bone_mm))
}

/// Points of a frame lie at most this far from its surface [mm]: landmarks are rough by 4.5, the femoral head lies off.
const NEAR_MM: f64 = 15.0;

/// The frame in which each point of a table lies: that of the surface it lies nearest to. Frames may overlap by chance; a point near surfaces of
/// several takes one that points near a single frame have, if there is such a one.
pub fn frames_of(points: &[Point], surfaces: &[(PointFrame, &TriMesh)]) -> Vec<Option<PointFrame>> {
    let queries: Vec<_> = surfaces.iter().filter_map(|(f, mesh)| Some((*f, SurfaceQuery::new(mesh)?))).collect();
    let near = |p: &Point| {
        let mut near: Vec<(PointFrame, f64)> =
            queries.iter().map(|(f, q)| (*f, q.nearest(p).distance)).filter(|n| n.1 < NEAR_MM).collect();
        near.sort_by(|a, b| a.1.total_cmp(&b.1));
        near
    };
    let all: Vec<_> = points.iter().map(near).collect();
    let alone: Vec<PointFrame> =
        all.iter().filter(|n| n.iter().all(|m| m.0 == n[0].0)).filter_map(|n| Some(n.first()?.0)).collect();
    let frame = |n: &Vec<(PointFrame, f64)>| n.iter().find(|m| alone.contains(&m.0)).or(n.first()).map(|m| m.0);
    all.iter().map(frame).collect()
}
