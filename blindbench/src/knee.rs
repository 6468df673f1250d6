//! The laboratory's knee: bones' frames, fibres of its own, cartilage as it lies.

use crate::BenchError;
use crate::frames::Frames;
use crate::over::Over;
use crate::pose::{Five, Pose, components, pose, read};
use meshes::Point;
use meshes::frame::AnatomicalFrame;
use meshes::query::{Nearest, SurfaceQuery};
use meshes::surface::TriMesh;
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

mod changed;

/// A bundle as a model describes it.
#[derive(Clone, Debug)]
pub struct BundleInput {
    /// Its name.
    pub name: String,
    /// Reference strain [-].
    pub reference_strain: f64,
    /// Stiffness [N/mm].
    pub stiffness: f64,
    /// Length its slack length derives from [mm].
    pub reference_length: f64,
    /// Femoral and tibial ends of its fibres, CT pose [mm].
    pub fibres: Vec<(Point, Point)>,
}

/// What a knee is made from.
#[derive(Clone, Debug)]
pub struct KneeInput {
    /// Anatomical frames, CT pose.
    pub frames: (AnatomicalFrame, AnatomicalFrame),
    /// Bundles.
    pub bundles: Vec<BundleInput>,
    /// Femoral articular surface and the tibial ones, outward normals, CT pose.
    pub femur: TriMesh,
    /// The tibial surfaces.
    pub tibia: Vec<TriMesh>,
    /// Slope of the pressure-overclosure law [MPa/mm].
    pub contact_slope: f64,
}

/// How far a laboratory's knee may be from the one that it is copied from, as standard deviations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unlike {
    /// Femoral and tibial ends of each bundle, along each axis [mm].
    pub sites_mm: BTreeMap<String, [f64; 2]>,
    /// Turns of the femur's and the tibia's frame about their medial, anterior and superior axes [deg].
    pub turn_deg: [[f64; 3]; 2],
    /// Shifts of their origins along those [mm].
    pub shift_mm: [[f64; 3]; 2],
    /// Height of each tibial cartilage [mm].
    pub cartilage_mm: f64,
    /// Mean and standard deviation of reference strains, in place of the copied ones [-].
    pub strains: BTreeMap<String, [f64; 2]>,
}

/// How widely the laws of a knee are drawn about those of the one that it is copied from, as standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Of the logarithm of a bundle's stiffness [-].
    pub stiffness: f64,
    /// Of a bundle's reference strain [-].
    pub strain: f64,
    /// Of the logarithm of the contact's stiffness [-].
    pub contact: f64,
    /// Factor on the standard deviations of [`Unlike::strains`] [-].
    pub stated: f64,
    /// Standard deviations beyond which no strain of [`Unlike::strains`] is drawn [-].
    pub farthest: f64,
}

impl Default for Spread {
    /// Narrower than the analysis supposes. A strain beyond two of its stated standard deviations is nobody's.
    fn default() -> Spread {
        Spread { stiffness: 0.15, strain: 0.022, contact: 0.2, stated: 1.0, farthest: 2.0 }
    }
}

impl Spread {
    /// One and a half times as wide as the analysis supposes, which is 0.2, 0.03 and 0.3, and without an end. Stated strains have a deviation of 0.05
    /// or so: 1.2 of it, and `strain` beside it, are 1.5 of it in all.
    pub fn wide() -> Spread {
        Spread { stiffness: 0.3, strain: 0.045, contact: 0.45, stated: 1.2, farthest: f64::INFINITY }
    }
}

impl KneeInput {
    /// A knee that differs from this one as the build of a model may differ from the knee.
    pub fn unlike(&self, by: &Unlike, spread: &Spread, seed: u64) -> KneeInput {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut three = |sd: [f64; 3]| Vector3::from_fn(|k, _| sd[k] * normal(&mut random));
        let mut out = self.clone();
        let up = self.frames.1.superior;
        for (k, frame) in [&mut out.frames.0, &mut out.frames.1].into_iter().enumerate() {
            let own = axes(frame);
            let turn = own * three(by.turn_deg[k]).map(f64::to_radians);
            let turn = nalgebra::Rotation3::new(turn);
            frame.origin += own * three(by.shift_mm[k]);
            (frame.medial, frame.anterior, frame.superior) =
                (turn * frame.medial, turn * frame.anterior, turn * frame.superior);
        }
        for b in &mut out.bundles {
            let sds = by.sites_mm.get(&b.name).copied().unwrap_or_default();
            let [femur, tibia] = sds.map(|sd| three([sd; 3]));
            for fibre in &mut b.fibres {
                *fibre = (fibre.0 + femur, fibre.1 + tibia);
            }
            if let Some([mean, sd]) = by.strains.get(&b.name) {
                let drawn = (spread.stated * three([1.0; 3]).x).clamp(-spread.farthest, spread.farthest);
                b.reference_strain = mean + sd * drawn;
            }
        }
        for part in &mut out.tibia {
            let by = up * three([by.cartilage_mm; 3]).x;
            part.vertices.iter_mut().for_each(|p| *p += by);
        }
        out
    }
}

#[derive(Clone, Copy)]
struct Fibre {
    bundle: usize,
    /// In the femur's frame.
    femur: Vector3<f64>,
    /// In the tibia's.
    tibia: Vector3<f64>,
    /// Its straight length in the CT pose [mm].
    initial: f64,
    /// Bone that it runs over.
    over: Option<Over>,
}

impl Fibre {
    /// By how much it is longer than straight [mm].
    fn longer(&self, p: &Pose) -> f64 {
        self.over.map_or(0.0, |over| over.longer(p, &self.femur, &self.tibia))
    }
}

/// Strain, stiffness of a bundle and its share of fibres.
#[derive(Clone, Debug)]
pub(crate) struct Bundle {
    pub(crate) name: String,
    pub(crate) strain: f64,
    pub(crate) stiffness: f64,
    length: f64,
    count: f64,
}

/// A knee that can be put to tests.
pub struct Knee {
    pub(crate) bundles: Vec<Bundle>,
    fibres: Vec<Fibre>,
    contact: Contact,
    pub(crate) contact_scale: f64,
    /// The CT pose, as read.
    pub(crate) ct: [f64; 6],
    /// Whether a structure has lost stiffness: such a knee may come out of its joint.
    is_weakened: bool,
}

struct Contact {
    femur: SurfaceQuery,
    /// The femur's surface, in its frame.
    mesh: TriMesh,
    /// Nodes in the tibia's frame and their areas.
    nodes: Vec<(Vector3<f64>, f64)>,
    slope: f64,
}

pub(crate) fn axes(f: &AnatomicalFrame) -> Matrix3<f64> {
    Matrix3::from_columns(&[f.medial, f.anterior, f.superior])
}

/// A point of the CT in a frame.
pub(crate) fn local(f: &AnatomicalFrame, p: &Point) -> Vector3<f64> {
    axes(f).transpose() * (p - f.origin)
}

/// Deepest overclosure that still counts as contact [mm]: beyond lies the other side.
const DEEPEST: f64 = 6.0;
/// Nodes further from the femur than this take no part in a search for a rest [mm].
const REACH: f64 = 5.0;
/// Nodes within a cell of this edge are one [mm].
const CELL: f64 = 1.2;

impl Knee {
    /// A knee with strains, stiffnesses, contact and attachments drawn about the given ones.
    ///
    /// Errors: an empty surface, a bundle without fibres.
    pub fn drawn(input: &KneeInput, seed: u64) -> Result<Knee, BenchError> {
        Knee::drawn_within(input, &Spread::default(), seed)
    }

    /// [`Knee::drawn`], as widely as told.
    ///
    /// # Errors
    /// As [`Knee::drawn`].
    pub fn drawn_within(input: &KneeInput, spread: &Spread, seed: u64) -> Result<Knee, BenchError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (femur, tibia) = &input.frames;
        let (mut bundles, mut fibres) = (Vec::new(), Vec::new());
        let mut shared: Option<f64> = None;
        for b in &input.bundles {
            if b.fibres.is_empty() {
                return Err(BenchError::Knee(format!("bundle {} has no fibres", b.name)));
            }
            let mut stretch = (spread.stiffness * normal(&mut random)).exp();
            if b.name.starts_with("sMCL") {
                stretch = *shared.get_or_insert(stretch);
            }
            let count = 5 + (random.random::<f64>() * 3.0) as usize;
            bundles.push(Bundle {
                name: b.name.clone(),
                strain: b.reference_strain + spread.strain * normal(&mut random),
                stiffness: b.stiffness * stretch,
                length: b.reference_length,
                count: count as f64,
            });
            for k in 0..count {
                let along = k as f64 / (count - 1) as f64 * (b.fibres.len() - 1) as f64;
                let (low, part) = (along.floor() as usize, along.fract());
                let high = (low + 1).min(b.fibres.len() - 1);
                let mut end = |i: usize, f: &AnatomicalFrame| {
                    let pick = |n: usize| if i == 0 { b.fibres[n].0 } else { b.fibres[n].1 };
                    let middle = local(f, &pick(low)) * (1.0 - part) + local(f, &pick(high)) * part;
                    middle + Vector3::from_fn(|_, _| 0.6 * normal(&mut random))
                };
                let (f, t) = (end(0, femur), end(1, tibia));
                fibres.push(Fibre { bundle: bundles.len() - 1, femur: f, tibia: t, initial: 0.0, over: None });
            }
        }
        let ct = Pose {
            turn: axes(femur).transpose() * axes(tibia),
            origin: axes(femur).transpose() * (tibia.origin - femur.origin),
        };
        for f in &mut fibres {
            f.initial = (ct.turn * f.tibia + ct.origin - f.femur).norm();
        }
        let contact = Contact::new(input)?;
        let contact_scale = (spread.contact * normal(&mut random)).exp();
        Ok(Knee { bundles, fibres, contact, contact_scale, ct: read(&ct), is_weakened: false })
    }

    /// The same knee, read in other frames.
    pub(crate) fn in_frames(&self, frames: &Frames) -> Result<Knee, BenchError> {
        let moved = |f: &Fibre| Fibre {
            femur: frames.point(0, &f.femur),
            tibia: frames.point(1, &f.tibia),
            over: f.over.map(|over| over.in_frames(frames)),
            ..*f
        };
        let mut mesh = self.contact.mesh.clone();
        mesh.vertices.iter_mut().for_each(|p| *p = Point::from(frames.point(0, &p.coords)));
        let femur =
            SurfaceQuery::new(&mesh).ok_or_else(|| BenchError::Knee("the femoral surface is empty".to_owned()))?;
        let nodes = self.contact.nodes.iter().map(|(p, area)| (frames.point(1, p), *area)).collect();
        Ok(Knee {
            bundles: self.bundles.clone(),
            fibres: self.fibres.iter().map(moved).collect(),
            contact: Contact { femur, mesh, nodes, slope: self.contact.slope },
            contact_scale: self.contact_scale,
            ct: read(&frames.pose(&pose(self.ct[0], &components(&self.ct)))),
            is_weakened: self.is_weakened,
        })
    }

    /// The nodes that may come into contact near a pose, and how far each is from the femur.
    pub(crate) fn near(&self, flexion: f64, c: &Five) -> Vec<(usize, f64)> {
        let p = pose(flexion, c);
        let at = |k: usize| Point::from(p.turn * self.contact.nodes[k].0 + p.origin);
        let all = (0..self.contact.nodes.len()).map(|k| {
            let (point, near) = (at(k), self.contact.femur.nearest(&at(k)));
            let outside = (point - near.point).dot(&self.contact.femur.smooth_normal(&near)) > 0.0;
            (k, if outside { near.distance } else { 0.0 })
        });
        all.filter(|(_, d)| *d < REACH).collect()
    }

    /// Energy of ligaments and of the contact at nodes `near` [N mm], and its slope by the five components; no node has moved further than `moved`
    /// [mm] since they were listed.
    pub(crate) fn energy(&self, flexion: f64, c: &Five, near: &[(usize, f64)], moved: f64) -> (f64, Five) {
        let p = pose(flexion, c);
        let moves = moves(flexion, c, &p);
        let (mut energy, mut slope) = self.stretched((flexion, c), &p, &moves);
        for (node, area) in near.iter().filter(|n| n.1 <= moved).map(|n| &self.contact.nodes[n.0]) {
            let arm = p.turn * node;
            let at = Point::from(arm + p.origin);
            let Some((near, normal)) = self.contact.pressed(&at) else { continue };
            let depth = near.distance;
            let out = if depth > 1e-9 { (near.point - at) / depth } else { normal };
            let k = self.contact.slope * self.contact_scale * area;
            energy += k * (0.4 * depth * depth + 0.07 * depth.powi(3));
            let force = k * (0.8 * depth + 0.21 * depth * depth);
            for (s, (turning, shift)) in slope.iter_mut().zip(&moves) {
                *s -= force * out.dot(&(turning.cross(&arm) + shift));
            }
        }
        (energy, slope)
    }

    /// Whether any cartilage of the tibia bears at a pose.
    pub(crate) fn bears(&self, flexion: f64, c: &Five) -> bool {
        let p = pose(flexion, c);
        let is_pressed =
            |(node, _): &(Vector3<f64>, f64)| self.contact.pressed(&Point::from(p.turn * node + p.origin)).is_some();
        self.contact.nodes.iter().any(is_pressed)
    }

    /// Energy of ligaments [N mm], and its slope by the five components.
    fn stretched(
        &self,
        (flexion, c): (f64, &Five),
        p: &Pose,
        moves: &[(Vector3<f64>, Vector3<f64>); 5],
    ) -> (f64, Five) {
        let beside = self.fibres.iter().any(|f| f.over.is_some()).then(|| beside(flexion, c));
        let (mut energy, mut slope) = (0.0, [0.0; 5]);
        for f in &self.fibres {
            let b = &self.bundles[f.bundle];
            let arm = p.turn * f.tibia;
            let way = arm + p.origin - f.femur;
            let length = way.norm().max(1e-9);
            let slack = b.length / b.strain;
            let longer = f.longer(p);
            let (e, force) = toe(length + longer - f.initial + b.length - slack, slack, b.stiffness / b.count);
            energy += e;
            for (s, (turning, shift)) in slope.iter_mut().zip(moves) {
                *s += force * way.dot(&(turning.cross(&arm) + shift)) / length;
            }
            if let (Some(beside), true) = (&beside, longer > 0.0 && force > 0.0) {
                for ((s, [up, down]), step) in slope.iter_mut().zip(beside).zip(STEPS) {
                    *s += force * (f.longer(up) - f.longer(down)) / (2.0 * step);
                }
            }
        }
        (energy, slope)
    }
}

/// Steps of differences by VV, IE [rad], ML, AP, SI [mm].
const STEPS: Five = [1e-5, 1e-5, 1e-4, 1e-4, 1e-4];

/// Poses a step up and a step down each component.
fn beside(flexion: f64, c: &Five) -> [[Pose; 2]; 5] {
    std::array::from_fn(|j| {
        [1.0, -1.0].map(|sign| {
            let mut there = *c;
            there[j] += sign * STEPS[j];
            pose(flexion, &there)
        })
    })
}

impl Knee {
    /// Tension of each bundle at a pose [N].
    pub(crate) fn tensions(&self, flexion: f64, c: &Five) -> BTreeMap<String, f64> {
        let p = pose(flexion, c);
        let mut out: BTreeMap<String, f64> = self.bundles.iter().map(|b| (b.name.clone(), 0.0)).collect();
        for f in &self.fibres {
            let b = &self.bundles[f.bundle];
            let length = (p.turn * f.tibia + p.origin - f.femur).norm();
            let slack = b.length / b.strain;
            let stretch = length + f.longer(&p) - f.initial + b.length - slack;
            let force = toe(stretch, slack, b.stiffness / b.count).1;
            *out.entry(b.name.clone()).or_default() += force;
        }
        out
    }
}

/// Turning and shift of the tibia for each component.
pub(crate) fn moves(flexion: f64, c: &Five, p: &Pose) -> [(Vector3<f64>, Vector3<f64>); 5] {
    let floating = Vector3::new(0.0, flexion.cos(), -flexion.sin());
    let long: Vector3<f64> = p.turn.column(2).into();
    // turning about the floating axis carries the tibial axis, along which SI is measured
    [
        (floating, floating.cross(&long) * c[4]),
        (long, Vector3::zeros()),
        (Vector3::zeros(), -Vector3::x()),
        (Vector3::zeros(), floating),
        (Vector3::zeros(), long),
    ]
}

/// Energy and force of a fibre with an exponential toe that meets the line of slope `k` whose root is a strain of 0.03.
fn toe(x: f64, slack: f64, k: f64) -> (f64, f64) {
    const SHARP: f64 = 3.0;
    let end = 0.03 * slack / (1.0 - (1.0 - (-SHARP).exp()) / SHARP);
    if x <= 0.0 {
        return (0.0, 0.0);
    }
    let scale = k * end / (SHARP * SHARP.exp());
    if x <= end {
        let grown = (SHARP * x / end).exp();
        (scale * (end / SHARP * (grown - 1.0) - x), scale * (grown - 1.0))
    } else {
        let at_end = (scale * (end / SHARP * (SHARP.exp() - 1.0) - end), scale * (SHARP.exp() - 1.0));
        let y = x - end;
        (at_end.0 + at_end.1 * y + 0.5 * k * y * y, at_end.1 + k * y)
    }
}

impl Contact {
    /// Where a point that is pressed into the femur is nearest to its surface, and the normal there; none where it is not pressed.
    fn pressed(&self, at: &Point) -> Option<(Nearest, Vector3<f64>)> {
        let near = self.femur.nearest(at);
        let normal = self.femur.smooth_normal(&near);
        let depth = -(at - near.point).dot(&normal);
        // beyond the rim the nearest point lies sideways: no contact there
        let is_pressed = depth > 0.0 && near.distance <= DEEPEST && depth >= 0.7 * near.distance;
        is_pressed.then_some((near, normal))
    }

    fn new(input: &KneeInput) -> Result<Contact, BenchError> {
        let (femur, tibia) = &input.frames;
        let to_femur = |p: &Point| Point::from(local(femur, p));
        let mut mesh = input.femur.clone();
        mesh.vertices.iter_mut().for_each(|p| *p = to_femur(p));
        // the frame may be left-handed in a right knee: keep normals outward
        if axes(femur).determinant() < 0.0 {
            mesh = mesh.flipped();
        }
        let femur =
            SurfaceQuery::new(&mesh).ok_or_else(|| BenchError::Knee("the femoral surface is empty".to_owned()))?;
        let mut cells: BTreeMap<[i64; 4], (Vector3<f64>, f64)> = BTreeMap::new();
        for (n, part) in input.tibia.iter().enumerate() {
            for (p, area) in part.vertices.iter().zip(part.vertex_areas()) {
                let place = local(tibia, p);
                let [i, j, k] = [place.x, place.y, place.z].map(|x| (x / CELL).floor() as i64);
                let cell = cells.entry([n as i64, i, j, k]).or_insert((Vector3::zeros(), 0.0));
                *cell = (cell.0 + place * area, cell.1 + area);
            }
        }
        let nodes: Vec<(Vector3<f64>, f64)> =
            cells.into_values().filter(|c| c.1 > 0.0).map(|(sum, area)| (sum / area, area)).collect();
        if nodes.is_empty() {
            return Err(BenchError::Knee("the tibial surfaces are empty".into()));
        }
        Ok(Contact { femur, mesh, nodes, slope: input.contact_slope })
    }
}

/// A standard normal number [box1958].
pub(crate) fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - u).max(1e-300).ln()).sqrt() * (2.0 * std::f64::consts::PI * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_toe_joins_smoothly_and_its_force_is_the_slope_of_its_energy() {
        for x in [0.2, 1.0, 1.3, 1.31, 3.0] {
            let (up, down) = (toe(x + 1e-6, 30.0, 50.0), toe(x - 1e-6, 30.0, 50.0));
            let force = toe(x, 30.0, 50.0).1;
            assert!(((up.0 - down.0) / 2e-6 - force).abs() < 1e-4 * force.max(1.0), "{x}");
            assert!(up.1 >= down.1);
        }
        // far out: the line with its root at a strain of 0.03
        assert!((toe(5.0, 30.0, 50.0).1 - 50.0 * (5.0 - 0.9)).abs() < 1e-6);
    }

    /// Standard deviations of the logarithm of stiffnesses over the given ones, of strains less the given ones, and of the logarithm of the contact's
    /// stiffness, over many draws.
    fn widths(spread: &Spread) -> [f64; 3] {
        let input = crate::flat::input();
        let mut sums = [[0.0; 2]; 3];
        let mut add = |k: usize, x: f64| {
            sums[k][0] += x * x;
            sums[k][1] += 1.0;
        };
        for seed in 0..600 {
            let knee = Knee::drawn_within(&input, spread, seed).unwrap();
            for (b, given) in knee.bundles.iter().zip(&input.bundles) {
                add(0, (b.stiffness / given.stiffness).ln());
                add(1, b.strain - given.reference_strain);
            }
            add(2, knee.contact_scale.ln());
        }
        sums.map(|[squares, count]| (squares / count).sqrt())
    }

    #[test]
    fn knees_are_drawn_as_widely_as_told() {
        for spread in [Spread::default(), Spread::wide()] {
            let told = [spread.stiffness, spread.strain, spread.contact];
            for (is, told) in widths(&spread).into_iter().zip(told) {
                assert!((is / told - 1.0).abs() < 0.12, "{is} against {told}");
            }
        }
    }

    #[test]
    fn stated_strains_have_an_end_but_where_they_are_wide() {
        let by = Unlike { strains: [("LCL".to_owned(), [1.0, 0.05])].into(), ..Unlike::default() };
        let farthest = |spread: &Spread| {
            let input = crate::flat::input();
            let of = |seed: u64| (input.unlike(&by, spread, seed).bundles[1].reference_strain - 1.0).abs() / 0.05;
            (0..400).map(of).fold(0.0, f64::max)
        };
        assert!((farthest(&Spread::default()) - 2.0).abs() < 1e-9);
        assert!(farthest(&Spread::wide()) > 2.5);
    }
}
