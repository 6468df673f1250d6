//! Stage 8, overclosure: femoral and tibial cartilage pushed apart until no gap is below the wanted one.

use crate::hexmesh::{HexCartilage, quality};
use crate::{PerCartilage, StageError};
use meshes::gap::{ContactFace, probes};
use meshes::hex::HexMesh;
use meshes::{Point, Vector, grnn};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How the cartilages are pushed apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OverclosureOptions {
    /// Gap wanted everywhere between femoral and tibial cartilage [mm].
    pub gap_mm: f64,
    /// Share of the move that the femur takes [-]; the tibia takes the rest [andreassen2024].
    pub femur_share: f64,
    /// Standard deviation of the kernel at the first iteration [mm]; [andreassen2024] starts near 10.
    pub spread_mm: f64,
    /// Factor on the spread from one iteration to the next [-].
    pub spread_reduction: f64,
    /// The spread shrinks no further than this [mm].
    pub least_spread_mm: f64,
    /// Share of the last move added to the next [-].
    pub momentum: f64,
    /// Iterations at most [-].
    pub max_iterations: usize,
    /// While cartilages overlap by no more than this at first [mm], bony faces stay and the cartilage gets thinner: so much
    /// the errors of CT and registration explain, our own choice.
    pub bony_stays_to_mm: f64,
    /// From deeper starts bony faces move with their cartilage by no more than this [mm]; beyond it the cartilage gets thinner.
    pub max_bony_lift_mm: f64,
}

impl Default for OverclosureOptions {
    fn default() -> Self {
        OverclosureOptions {
            gap_mm: 0.05,
            femur_share: 0.5,
            spread_mm: 6.0,
            spread_reduction: 0.65,
            least_spread_mm: 0.8,
            momentum: 0.2,
            max_iterations: 40,
            bony_stays_to_mm: 0.5,
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
    pub warnings: Vec<String>,
    /// For metrics.json: by cartilage name as stage 7; and `max_overclosure_before_mm`, `max_overclosure_after_mm`, `gap_min_mm`, `iterations`.
    pub metrics: serde_json::Value,
}

/// Aimed for beyond the wanted gap, so that the last hundredths need no iterations of their own [mm].
const MARGIN_MM: f64 = 0.02;
/// Nodes with gaps above this take no part [mm].
const NEAR_MM: f64 = 12.0;
/// The first spread over the depth of the overlap, where that is less than the spread told [-].
const SPREAD_BY_DEPTH: f64 = 8.0;
/// A lift off the bone above this is told [mm].
const NOTABLE_LIFT_MM: f64 = 0.05;
/// An overclosure that remains above this is an error [mm].
const REMAINING_MM: f64 = 0.05;

/// Pushes femoral and tibial cartilage apart until every gap is at least `gap_mm`, either way a quadrilateral is split.
///
/// Method: kernel regression of the displacements wanted at the articular nodes [andreassen2024]. Ours differs: a column of
/// nodes moves with its articular node, its foot stays on the bone from starts shallower than `bony_stays_to_mm`, and
/// lifts by `max_bony_lift_mm` at most from deeper ones; the spread starts with the depth; and gaps are also kept at the middles of edges and diagonals. Connectivity is unchanged.
pub fn overclosure(hexes: &HexCartilage, options: &OverclosureOptions) -> Result<Separated, StageError> {
    check(options)?;
    let mut knee = Knee::new(hexes, options)?;
    let before = knee.measure()?;
    let mut gaps = before.clone();
    let depth = -smallest(&before);
    let lift = if depth > options.bony_stays_to_mm { options.max_bony_lift_mm } else { 0.0 };
    // A shallow overlap is a small patch: a wide field would move what is far from it.
    let start = options.spread_mm.min(SPREAD_BY_DEPTH * depth).max(options.least_spread_mm);
    let (mut spread, mut iterations) = (start, 0);
    while smallest(&gaps) < options.gap_mm && iterations < options.max_iterations {
        knee.step(&gaps, spread, lift, options);
        spread = (spread * options.spread_reduction).max(options.least_spread_mm);
        gaps = knee.measure()?;
        iterations += 1;
    }
    report(hexes, knee, [smallest(&before), smallest(&gaps)], iterations, options)
}

fn check(options: &OverclosureOptions) -> Result<(), StageError> {
    let o = options;
    let lengths = [o.gap_mm, o.max_bony_lift_mm, o.bony_stays_to_mm];
    let good = lengths.iter().all(|x| x.is_finite() && *x >= 0.0)
        && (0.0..=1.0).contains(&o.femur_share)
        && (0.05..=100.0).contains(&o.spread_mm)
        && (0.05..=100.0).contains(&o.least_spread_mm)
        && (0.0..=1.0).contains(&o.spread_reduction)
        && (0.0..1.0).contains(&o.momentum);
    let what = "overclosure options: lengths must not be negative, shares and momentum 0 to 1, spreads 0.05 to 100 mm";
    good.then_some(()).ok_or_else(|| StageError(what.into()))
}

/// A probe that was measured: where, and the displacement of the tibia against the femur that would bring the wanted gap.
#[derive(Clone, Debug)]
struct Measured {
    place: Point,
    gap: f64,
    away: Vector,
    of_tibia: bool,
    is_node: bool,
}

/// One cartilage on its way.
struct Body {
    nodes: Vec<Point>,
    start: Vec<Point>,
    quads: Vec<[u32; 4]>,
    probes: Vec<(u32, u32)>,
    articular: Vec<u32>,
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
    fn new(hexes: &HexCartilage, _: &OverclosureOptions) -> Result<Knee, StageError> {
        let body = |name: &str, mesh: &HexMesh| {
            Body::new(mesh).ok_or_else(|| {
                StageError(format!("cartilage {name}: elements do not form columns from bony to articular face"))
            })
        };
        let m = &hexes.meshes;
        Ok(Knee {
            femur: body("femur", &m.femur)?,
            tibiae: [body("tibia_medial", &m.tibia_medial)?, body("tibia_lateral", &m.tibia_lateral)?],
        })
    }

    /// Gaps of every probe near the other side: the tibiae's to the femur, the femur's to each tibia.
    fn measure(&self) -> Result<Vec<Measured>, StageError> {
        let femur = self.femur.face()?;
        let mut all = Vec::new();
        for tibia in &self.tibiae {
            all.extend(tibia.gaps_to(&femur, true));
            all.extend(self.femur.gaps_to(&tibia.face()?, false));
        }
        Ok(all)
    }

    fn step(&mut self, gaps: &[Measured], spread: f64, lift: f64, options: &OverclosureOptions) {
        // Nodes that need no move hold the field back; other probes speak only where a gap lacks.
        let sample = |m: &Measured| {
            let lack = (options.gap_mm + MARGIN_MM - m.gap).max(0.0);
            let push = m.away * if m.of_tibia { lack } else { -lack };
            (m.is_node || lack > 0.0).then_some((m.place, push))
        };
        let samples: Vec<(Point, Vector)> = gaps.iter().filter_map(sample).collect();
        let share = options.femur_share;
        self.femur.step(&samples, -share, [spread, lift], options);
        for tibia in &mut self.tibiae {
            tibia.step(&samples, 1.0 - share, [spread, lift], options);
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
        Some(Body {
            nodes: mesh.nodes.clone(),
            start: mesh.nodes.clone(),
            quads: mesh.articular_quads.clone(),
            probes: probes(&mesh.articular_quads),
            articular: mesh.articular_nodes.clone(),
            columns,
            moved: still.clone(),
            last: still,
        })
    }

    fn face(&self) -> Result<ContactFace, StageError> {
        ContactFace::new(&self.nodes, &self.quads).ok_or_else(|| StageError("an articular face is empty".into()))
    }

    fn gaps_to(&self, face: &ContactFace, of_tibia: bool) -> Vec<Measured> {
        let measure = |&(a, b): &(u32, u32)| {
            let place = nalgebra::center(&self.nodes[a as usize], &self.nodes[b as usize]);
            let gap = face.gap(&place).filter(|g| g.gap < NEAR_MM)?;
            Some(Measured { place, gap: gap.gap, away: gap.away, of_tibia, is_node: a == b })
        };
        self.probes.par_iter().filter_map(measure).collect()
    }

    /// Moves every column by `share` of the field of the samples, and of the last step.
    fn step(
        &mut self,
        samples: &[(Point, Vector)],
        share: f64,
        [spread, lift]: [f64; 2],
        options: &OverclosureOptions,
    ) {
        let heads: Vec<Point> = self.articular.iter().map(|&n| self.nodes[n as usize]).collect();
        let field = grnn::displacements(samples, spread, &heads);
        for (c, column) in self.columns.iter().enumerate() {
            let step = field[c] * share + self.last[c] * options.momentum;
            self.last[c] = step;
            self.moved[c] += step;
            let head = self.moved[c];
            let size = head.norm();
            let foot = if size > lift { head * (lift / size) } else { head };
            let top = (column.len() - 1).max(1) as f64;
            for (k, &n) in column.iter().enumerate() {
                self.nodes[n as usize] = self.start[n as usize] + foot + (head - foot) * (k as f64 / top);
            }
        }
    }

    fn largest(&self, which: impl Fn(&Vec<u32>) -> u32) -> f64 {
        let move_of = |c: &Vec<u32>| (self.nodes[which(c) as usize] - self.start[which(c) as usize]).norm();
        self.columns.iter().map(move_of).fold(0.0, f64::max)
    }
}

fn smallest(gaps: &[Measured]) -> f64 {
    gaps.iter().map(|m| m.gap).fold(f64::INFINITY, f64::min)
}

fn report(
    hexes: &HexCartilage,
    knee: Knee,
    [before, after]: [f64; 2],
    iterations: usize,
    options: &OverclosureOptions,
) -> Result<Separated, StageError> {
    if after < -REMAINING_MM {
        return Err(StageError(format!(
            "cartilages still overlap by {:.3} mm after {iterations} iterations (at first {:.3} mm): check that the bones lie in one frame, or raise max_iterations or spread_mm",
            -after, -before
        )));
    }
    let mut warnings = Vec::new();
    if after < options.gap_mm {
        warnings.push(format!("smallest gap {after:.3} mm after {iterations} iterations, wanted {}", options.gap_mm));
    }
    let bodies = [&knee.femur, &knee.tibiae[0], &knee.tibiae[1]];
    let largest = bodies.iter().map(|b| b.largest(|c| c[c.len() - 1])).fold(0.0, f64::max);
    let lift = bodies.iter().map(|b| b.largest(|c| c[0])).fold(0.0, f64::max);
    if lift > NOTABLE_LIFT_MM {
        warnings.push(format!(
            "cartilage was lifted off its bone by up to {lift:.2} mm to separate cartilages {:.2} mm deep in each other: check the registration, or lower max_bony_lift_mm to thin it instead",
            -before
        ));
    }
    let moved = |mesh: &HexMesh, body: &Body| HexMesh { nodes: body.nodes.clone(), ..mesh.clone() };
    let meshes = PerCartilage {
        femur: moved(&hexes.meshes.femur, &knee.femur),
        tibia_medial: moved(&hexes.meshes.tibia_medial, &knee.tibiae[0]),
        tibia_lateral: moved(&hexes.meshes.tibia_lateral, &knee.tibiae[1]),
    };
    let mut metrics = serde_json::Map::new();
    let mut changes = Vec::new();
    for ((name, mesh), (_, old)) in meshes.named().into_iter().zip(hexes.meshes.named()) {
        let inverted = (0..mesh.elements.len()).filter(|&e| mesh.scaled_jacobian(e) <= 0.0).count();
        if inverted > 0 {
            warnings.push(format!("cartilage {name}: {inverted} of {} elements are inverted", mesh.elements.len()));
        }
        metrics.insert(name.into(), quality(mesh));
        changes.extend((0..mesh.elements.len()).map(|e| (mesh.element_volume(e) / old.element_volume(e) - 1.0).abs()));
    }
    // No probe of one cartilage near the other: no gap to tell.
    let told = |gap: f64| gap.is_finite().then_some(gap);
    metrics.insert("max_overclosure_before_mm".into(), (-before).max(0.0).into());
    metrics.insert("max_overclosure_after_mm".into(), (-after).max(0.0).into());
    metrics.insert("gap_min_mm".into(), told(after).into());
    metrics.insert("iterations".into(), iterations.into());
    metrics.insert("largest_move_mm".into(), largest.into());
    metrics.insert("largest_bony_lift_mm".into(), lift.into());
    metrics.insert("volume_change_mean".into(), (changes.iter().sum::<f64>() / changes.len().max(1) as f64).into());
    Ok(Separated { meshes, warnings, metrics: metrics.into() })
}
