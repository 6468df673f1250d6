//! Stage 8, overclosure: femoral and tibial cartilage pushed apart until no gap is below the wanted one.

mod feet;

use crate::hexmesh::HexQuality;
use crate::hexmesh::{HexCartilage, quality};
use crate::{PerCartilage, StageError};
use meshes::gap::{ContactFace, probes};
use meshes::hex::HexMesh;
use meshes::{Point, Vector, grnn};
use notices::{Kind, Notice};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How the cartilages are pushed apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OverclosureOptions {
    /// Gap wanted everywhere between femoral and tibial cartilage [mm].
    pub gap_mm: f64,
    /// Share of the move that the femur takes where both cartilages are equally thick [-]; elsewhere the thicker takes more, in
    /// proportion; the tibia takes the rest. The paper of the method shares evenly [andreassen2024].
    pub femur_share: f64,
    /// Standard deviation of the kernel at the first iteration [mm]: about an element's edge, so that only what overlaps moves;
    /// the paper of the method starts near 10 [andreassen2024].
    pub spread_mm: f64,
    /// Factor on the spread from one iteration to the next [-].
    pub spread_reduction: f64,
    /// The spread shrinks no further than this [mm].
    pub least_spread_mm: f64,
    /// Share of the last move added to the next [-].
    pub momentum: f64,
    /// Iterations at most [-].
    pub max_iterations: usize,
    /// Bony faces stay, and the cartilage gets thinner, while that changes the elements' volumes by no more than this in the mean [-]. Ours.
    pub volume_change_max: f64,
    /// Bony faces stay while that takes no more than this from any cartilage's least scaled Jacobian [-]. Ours.
    pub scaled_jacobian_fall_max: f64,
    /// Share of its height that a column keeps at least; beyond it the foot gives way [-]. Ours.
    pub height_kept: f64,
    /// Where bony faces cannot stay they move with their cartilage by no more than this [mm]; beyond it the cartilage gets thinner.
    pub max_bony_lift_mm: f64,
}

impl Default for OverclosureOptions {
    fn default() -> Self {
        OverclosureOptions {
            gap_mm: 0.05,
            femur_share: 0.5,
            spread_mm: 1.0,
            spread_reduction: 0.8,
            least_spread_mm: 0.8,
            momentum: 0.1,
            max_iterations: 40,
            volume_change_max: 0.028,
            scaled_jacobian_fall_max: 0.04,
            height_kept: 0.3,
            max_bony_lift_mm: 2.0,
        }
    }
}

/// The separated cartilages, CT frame; connectivity as in stage 7.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Separated {
    /// The meshes.
    pub meshes: PerCartilage<HexMesh>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: OverclosureMetrics,
}

/// Figures of the separated cartilages, for metrics.json.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OverclosureMetrics {
    /// The meshes.
    #[serde(flatten)]
    pub meshes: PerCartilage<HexQuality>,
    /// How deep cartilages lay in each other before [mm].
    pub max_overclosure_before_mm: f64,
    /// And after [mm].
    pub max_overclosure_after_mm: f64,
    /// Smallest gap after [mm]; none where no cartilage is near another.
    pub gap_min_mm: Option<f64>,
    /// Rounds it took.
    pub iterations: usize,
    /// Farthest that a node of an articular face moved [mm].
    pub largest_move_mm: f64,
    /// Farthest that a node of a bony face was lifted [mm].
    pub largest_bony_lift_mm: f64,
    /// Change of an element's volume, mean of sizes [-].
    pub volume_change_mean: f64,
    /// Largest share of a column's thickness that was taken [-].
    pub largest_thinning: f64,
}

/// Aimed for beyond the wanted gap, so that the last hundredths need no iterations of their own [mm].
const MARGIN_MM: f64 = 0.02;
/// Kernels tried where the one told cannot keep bony faces in place, in its widths [-].
const WIDER: [f64; 2] = [3.0, 6.0];
/// Iterations that a wider kernel gets to separate the cartilages.
const WIDER_ITERATIONS: usize = 10;
/// Nodes with gaps above this take no part [mm].
const NEAR_MM: f64 = 12.0;
/// A lift off the bone above this is told [mm].
const NOTABLE_LIFT_MM: f64 = 0.05;
/// Cartilages farther apart than this at their nearest are told [mm]. In two published knees, their phantoms and the phantom of a living knee
/// they touch or overlap, by 0.03 to 0.24 mm; bones drawn on CT, thicknesses and registration together are known to less than 1. Ours.
const APART_MM: f64 = 2.0;
/// Cartilages this deep in each other in the CT pose are told [mm]: in two published knees and two phantoms they are 0.03 to 0.24. Ours.
const DEEP_MM: f64 = 1.0;
/// An overclosure that remains above this is an error [mm].
const REMAINING_MM: f64 = 0.05;

/// Pushes femoral and tibial cartilage apart until every gap is at least `gap_mm`, either way a quadrilateral is split.
///
/// Method: kernel regression of the displacements wanted at the articular nodes [andreassen2024]. Ours differs: the kernel is as
/// narrow as an element, a column of nodes moves with its articular node, its foot stays on the bone wherever that is possible
/// ([`feet`]), and gaps are also kept at the middles of edges and diagonals. Connectivity is unchanged.
pub fn overclosure(hexes: &HexCartilage, options: &OverclosureOptions) -> Result<Separated, StageError> {
    check(options)?;
    let knee = Knee::new(hexes)?;
    let before = knee.measure(options)?;
    let mut best = trial(knee, before.clone(), hexes, options.spread_mm, options)?;
    for wider in WIDER {
        // What narrow kernels tear at a rim, wide ones keep whole.
        if best.lift == 0.0 && best.good {
            break;
        }
        let few =
            OverclosureOptions { max_iterations: options.max_iterations.min(WIDER_ITERATIONS), ..options.clone() };
        let other = trial(Knee::new(hexes)?, before.clone(), hexes, wider * options.spread_mm, &few)?;
        if (!other.good, other.lift) < (!best.good, best.lift) {
            best = other;
        }
    }
    report(hexes, best, smallest(&before), options)
}

/// The knee as one kernel's width has separated it.
struct Trial {
    knee: Knee,
    meshes: PerCartilage<HexMesh>,
    /// Most that bony faces may lift [mm], and whether volumes and shapes are within bounds then.
    lift: f64,
    good: bool,
    gap: f64,
    iterations: usize,
}

fn trial(
    mut knee: Knee,
    mut gaps: Vec<Measured>,
    hexes: &HexCartilage,
    start_mm: f64,
    options: &OverclosureOptions,
) -> Result<Trial, StageError> {
    let (mut spread, mut iterations) = (start_mm.max(options.least_spread_mm), 0);
    while smallest(&gaps) < options.gap_mm && iterations < options.max_iterations {
        knee.step(&gaps, spread, options);
        spread = (spread * options.spread_reduction).max(options.least_spread_mm);
        gaps = knee.measure(options)?;
        iterations += 1;
    }
    let (lift, good) = feet::least_lift(&knee, hexes, options);
    let meshes = feet::placed(&knee, hexes, lift, options);
    let gap = smallest(&gaps);
    Ok(Trial { knee, meshes, lift, good: good && gap >= options.gap_mm, gap, iterations })
}

/// Refuses options that mean nothing, before any work.
///
/// # Errors
/// The option, its value and what is expected.
pub fn check(options: &OverclosureOptions) -> Result<(), StageError> {
    let o = options;
    let lengths = [o.gap_mm, o.max_bony_lift_mm, o.volume_change_max, o.scaled_jacobian_fall_max];
    let good = lengths.iter().all(|x| x.is_finite() && *x >= 0.0)
        && (0.0..=1.0).contains(&o.femur_share)
        && (0.05..=100.0).contains(&o.spread_mm)
        && (0.05..=100.0).contains(&o.least_spread_mm)
        && (0.0..=1.0).contains(&o.spread_reduction)
        && (0.0..=1.0).contains(&o.height_kept)
        && (0.0..1.0).contains(&o.momentum);
    let what = "overclosure options: lengths must not be negative, shares and momentum 0 to 1, spreads 0.05 to 100 mm";
    good.then_some(()).ok_or_else(|| StageError::Knee(what.into()))
}

/// A probe that was measured: where, and the displacement of the tibia against the femur that would bring the wanted gap.
#[derive(Clone, Debug)]
struct Measured {
    place: Point,
    gap: f64,
    away: Vector,
    of_tibia: bool,
    is_node: bool,
    /// Share of the move that the femur takes here.
    femur_share: f64,
}

/// One cartilage on its way.
struct Body {
    nodes: Vec<Point>,
    start: Vec<Point>,
    quads: Vec<[u32; 4]>,
    probes: Vec<(u32, u32)>,
    articular: Vec<u32>,
    /// Height of the column below each articular node at the start [mm]; 0 elsewhere.
    thickness: Vec<f64>,
    /// For each articular node its column, from foot to head.
    columns: Vec<Vec<u32>>,
    /// Displacement of each column so far, and in the last step [mm].
    moved: Vec<Vector>,
    last: Vec<Vector>,
}

struct Knee {
    femur: Body,
    tibiae: [Body; 2],
}

impl Knee {
    fn new(hexes: &HexCartilage) -> Result<Knee, StageError> {
        let body = |name: &str, mesh: &HexMesh| {
            Body::new(mesh).ok_or_else(|| {
                StageError::part(
                    format_args!("cartilage {name}"),
                    format_args!("elements do not form columns from bony to articular face"),
                )
            })
        };
        let m = &hexes.meshes;
        Ok(Knee {
            femur: body("femur", &m.femur)?,
            tibiae: [body("tibia_medial", &m.tibia_medial)?, body("tibia_lateral", &m.tibia_lateral)?],
        })
    }

    /// Gaps of every probe near the other side: the tibiae's to the femur, the femur's to each tibia.
    fn measure(&self, options: &OverclosureOptions) -> Result<Vec<Measured>, StageError> {
        let femur = self.femur.face()?;
        let share = options.femur_share;
        let mut all = Vec::new();
        for tibia in &self.tibiae {
            all.extend(tibia.gaps_to(&self.femur, &femur, share, true));
            all.extend(self.femur.gaps_to(tibia, &tibia.face()?, share, false));
        }
        Ok(all)
    }

    fn step(&mut self, gaps: &[Measured], spread: f64, options: &OverclosureOptions) {
        // Nodes that need no move hold the field back; other probes speak only where a gap lacks.
        let sample = |m: &Measured, share: f64| {
            let lack = (options.gap_mm + MARGIN_MM - m.gap).max(0.0);
            let push = m.away * if m.of_tibia { lack } else { -lack };
            (m.is_node || lack > 0.0).then_some((m.place, push * share))
        };
        let of_femur: Vec<(Point, Vector)> = gaps.iter().filter_map(|m| sample(m, -m.femur_share)).collect();
        let of_tibia: Vec<(Point, Vector)> = gaps.iter().filter_map(|m| sample(m, 1.0 - m.femur_share)).collect();
        self.femur.step(&of_femur, spread, options.momentum);
        for tibia in &mut self.tibiae {
            tibia.step(&of_tibia, spread, options.momentum);
        }
    }
}

impl Body {
    fn new(mesh: &HexMesh) -> Option<Body> {
        let mut below = vec![u32::MAX; mesh.nodes.len()];
        for e in &mesh.elements {
            for k in 0..4 {
                *below.get_mut(e[k + 4] as usize)? = e[k];
            }
        }
        let column = |&head: &u32| {
            let mut path = vec![head];
            while let Some(&next) = below.get(*path.last()? as usize).filter(|n| **n != u32::MAX) {
                path.push(next);
                if path.len() > mesh.nodes.len() {
                    return None;
                }
            }
            path.reverse();
            mesh.bony_nodes.binary_search(&path[0]).ok().map(|_| path)
        };
        let columns: Vec<Vec<u32>> = mesh.articular_nodes.iter().map(column).collect::<Option<_>>()?;
        let still = vec![Vector::zeros(); columns.len()];
        let mut thickness = vec![0.0; mesh.nodes.len()];
        for column in &columns {
            let (foot, head) = (*column.first()? as usize, *column.last()? as usize);
            thickness[head] = (mesh.nodes[head] - mesh.nodes[foot]).norm();
        }
        Some(Body {
            nodes: mesh.nodes.clone(),
            start: mesh.nodes.clone(),
            quads: mesh.articular_quads.clone(),
            probes: probes(&mesh.articular_quads),
            articular: mesh.articular_nodes.clone(),
            thickness,
            columns,
            moved: still.clone(),
            last: still,
        })
    }

    fn face(&self) -> Result<ContactFace, StageError> {
        ContactFace::new(&self.nodes, &self.quads).ok_or_else(|| StageError::Knee("an articular face is empty".into()))
    }

    fn gaps_to(&self, other: &Body, face: &ContactFace, femur_share: f64, of_tibia: bool) -> Vec<Measured> {
        let measure = |&(a, b): &(u32, u32)| {
            let place = nalgebra::center(&self.nodes[a as usize], &self.nodes[b as usize]);
            let gap = face.gap(&place).filter(|g| g.gap < NEAR_MM)?;
            let own = f64::midpoint(self.thickness[a as usize], self.thickness[b as usize]);
            let across = other.quads[gap.quad].iter().map(|&n| other.thickness[n as usize]).sum::<f64>() / 4.0;
            let [femur, tibia] = if of_tibia { [across, own] } else { [own, across] };
            let [femur, tibia] = [femur_share * femur, (1.0 - femur_share) * tibia];
            let femur_share = femur / (femur + tibia).max(f64::MIN_POSITIVE);
            Some(Measured { place, gap: gap.gap, away: gap.away, of_tibia, is_node: a == b, femur_share })
        };
        self.probes.par_iter().filter_map(measure).collect()
    }

    /// Moves every articular node by the field of the samples, and by `momentum` of the last step.
    fn step(&mut self, samples: &[(Point, Vector)], spread: f64, momentum: f64) {
        let heads: Vec<Point> = self.articular.iter().map(|&n| self.nodes[n as usize]).collect();
        let field = grnn::displacements(samples, spread, &heads);
        for (c, &n) in self.articular.iter().enumerate() {
            let step = field[c] + self.last[c] * momentum;
            self.last[c] = step;
            self.moved[c] += step;
            self.nodes[n as usize] = self.start[n as usize] + self.moved[c];
        }
    }
}

fn smallest(gaps: &[Measured]) -> f64 {
    gaps.iter().map(|m| m.gap).fold(f64::INFINITY, f64::min)
}

/// What is said of cartilages that do not meet in the CT pose, `gap` [mm] apart at their nearest.
fn apart(gap: f64) -> Option<Notice> {
    let by = if gap.is_finite() { format!("{gap:.1} mm") } else { format!("more than {NEAR_MM} mm") };
    (gap > APART_MM).then(|| {
        Kind::CartilagesApart.notice(format!(
            "femoral and tibial cartilage lie {by} apart at their nearest in the CT pose, expected within {APART_MM} mm: bones of different scans or poses, a bone drawn too thin, or cartilage too thin; ligaments are longer by that gap. Look at both bones of ct together, and at the registration of the scans"
        ))
    })
}

/// What is said of cartilages that lie in each other in the CT pose, by a `gap` [mm] below 0.
fn deep(gap: f64) -> Option<Notice> {
    (gap < -DEEP_MM).then(|| {
        Kind::SmallGap.notice(format!(
            "femoral and tibial cartilage lie up to {:.1} mm in each other in the CT pose, expected within {DEEP_MM} mm: bones of different scans or poses, a shift of one bone, or cartilage too thick; they are made thinner by that overlap. Look at both bones of ct together, and at the registration of the scans",
            -gap
        ))
    })
}

fn report(
    hexes: &HexCartilage,
    trial: Trial,
    before: f64,
    options: &OverclosureOptions,
) -> Result<Separated, StageError> {
    let Trial { knee, meshes, gap: after, iterations, .. } = trial;
    if after < -REMAINING_MM {
        return Err(StageError::Knee(format!(
            "cartilages still overlap by {:.3} mm after {iterations} iterations (at first {:.3} mm): check that the bones lie in one frame, or raise max_iterations or spread_mm",
            -after, -before
        )));
    }
    let mut warnings: Vec<Notice> = apart(before).into_iter().chain(deep(before)).collect();
    if after < options.gap_mm {
        warnings.push(
            Kind::SmallGap
                .notice(format!("smallest gap {after:.3} mm after {iterations} iterations, wanted {}", options.gap_mm)),
        );
    }
    let largest = feet::moves(&meshes, hexes, |m| &m.articular_nodes).into_iter().fold(0.0, f64::max);
    let lifts = feet::moves(&meshes, hexes, |m| &m.bony_nodes);
    let lift = lifts.iter().copied().fold(0.0, f64::max);
    if lift > NOTABLE_LIFT_MM {
        let lifted = lifts.iter().filter(|l| **l > NOTABLE_LIFT_MM).count();
        warnings.push(Kind::LiftedOff.notice(format!(
            "cartilage was lifted off its bone by up to {lift:.2} mm, at {lifted} of {} bony nodes, to separate cartilages {:.2} mm deep in each other: thinning alone would change its elements by more than {:.1} % or spoil them; check the registration",
            lifts.len(),
            -before,
            100.0 * options.volume_change_max
        )).count(lifted));
    }
    for (name, mesh) in meshes.named() {
        let inverted = (0..mesh.elements.len()).filter(|&e| mesh.scaled_jacobian(e) <= 0.0).count();
        if inverted > 0 {
            warnings.push(
                Kind::InvertedElements
                    .notice(format!("cartilage {name}: {inverted} of {} elements are inverted", mesh.elements.len()))
                    .of(name)
                    .count(inverted),
            );
        }
    }
    // No probe of one cartilage near the other: no gap to tell.
    let told = |gap: f64| gap.is_finite().then_some(gap);
    let metrics = OverclosureMetrics {
        meshes: meshes.map(quality),
        max_overclosure_before_mm: (-before).max(0.0),
        max_overclosure_after_mm: (-after).max(0.0),
        gap_min_mm: told(after),
        iterations,
        largest_move_mm: largest,
        largest_bony_lift_mm: lift,
        volume_change_mean: feet::volume_change(&meshes, hexes),
        largest_thinning: feet::largest_thinning(&knee, &meshes),
    };
    Ok(Separated { meshes, warnings, metrics })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bone_that_is_shifted_up_or_down_is_told_with_the_gap_or_the_overlap() {
        let said = |gap: f64| notices::texts(&apart(gap).into_iter().chain(deep(gap)).collect::<Vec<_>>()).join("");
        for (gap, words) in [(3.0, "3.0 mm apart"), (f64::INFINITY, "apart"), (-3.0, "3.0 mm in each other")] {
            assert!(said(gap).contains(words), "{gap}: {}", said(gap));
        }
        for gap in [1.0, 0.0, -0.25] {
            assert_eq!(said(gap), "", "{gap}");
        }
    }
}
