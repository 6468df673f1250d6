//! Nodes that may touch, kept from pose to pose while the bones move little. What is left out would add nothing, so that results do not depend
//! on what was kept.

use super::{cells::earliest, field::Field, nodes::Nodes};
use crate::condensed::Rest;
use crate::wrap::Laid;
use meshes::Isometry;
use std::sync::Arc;

/// Motion over which a list of nodes holds [mm]: about that from one sample's knee to the next. Counted: a list costs two evaluations.
const REACH: f64 = 1.5;
/// The same of nodes far from the other surface [mm].
const FAR: f64 = 2.0;

/// Lists of nodes near contact, one a pass, and where bodies in between rested and fibres lay. It belongs to one contact (and its copies with other parameters).
/// A copy shares the lists until it makes its own.
#[derive(Clone, Debug, Default)]
pub struct Nearby {
    passes: Vec<Kept>,
    rests: Vec<Rest>,
    laid: Vec<Laid>,
    once: bool,
    on_the_way: bool,
}

/// The list of a pass.
#[derive(Clone, Debug, Default)]
pub(super) struct Kept {
    listed_at: Option<Isometry>,
    extent: [[f64; 3]; 2],
    /// Overclosure from which the list counts [mm]: of every law that begins there or later.
    start: f64,
    nodes: Arc<Vec<Candidate>>,
    once: bool,
    /// Nodes in contact at the last pose, for room to be made.
    pub(super) touching: usize,
}

#[derive(Clone, Copy, Debug)]
struct Candidate {
    position: [f64; 3],
    area: f64,
    thickness: f64,
    /// Motion without which it cannot touch [mm].
    clear: f64,
}

impl Nearby {
    /// Lists for one pose only, which are quicker made.
    pub fn once() -> Nearby {
        Nearby { once: true, ..Nearby::default() }
    }

    /// The lists alone, shared: for a knee close by, whose bodies in between rest elsewhere.
    pub fn lists(&self) -> Nearby {
        Nearby { passes: self.passes.clone(), ..Nearby::default() }
    }

    /// Says that poses are those on the way of a path, where bodies in between need not be quite at rest.
    pub(crate) fn set_on_the_way(&mut self, on_the_way: bool) {
        self.on_the_way = on_the_way;
    }

    /// The list of the `n`-th pass.
    pub(super) fn pass(&mut self, n: usize) -> &mut Kept {
        if self.passes.len() <= n {
            self.passes.resize_with(n + 1, || Kept { once: self.once, ..Kept::default() });
        }
        &mut self.passes[n]
    }

    /// Where the `n`-th fibre lay.
    pub(crate) fn laid(&mut self, n: usize) -> &mut Laid {
        if self.laid.len() <= n {
            self.laid.resize_with(n + 1, Laid::default);
        }
        &mut self.laid[n]
    }

    /// Where the `n`-th body in between rested last.
    pub(crate) fn rest(&mut self, n: usize) -> &mut Rest {
        if self.rests.len() <= n {
            self.rests.resize_with(n + 1, Rest::default);
        }
        self.rests[n].on_the_way = self.on_the_way;
        &mut self.rests[n]
    }
}

/// A motion as a matrix and a shift.
type Affine = ([[f64; 3]; 3], [f64; 3]);

fn affine(m: &Isometry) -> Affine {
    let r = m.rotation.to_rotation_matrix();
    let (r, t) = (r.matrix(), m.translation.vector);
    (std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)])), [t.x, t.y, t.z])
}

#[inline]
fn map((m, t): &Affine, p: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| m[i][0] * p[0] + m[i][1] * p[1] + m[i][2] * p[2] + t[i])
}

impl Kept {
    /// Calls `visit` with the field's coordinates, the area and the layer's thickness of each node that may overclose by more than `start`, in the order of the nodes.
    #[inline]
    pub(super) fn for_each(
        &mut self,
        (nodes, field): (&Nodes, &Field),
        to_field: &Isometry,
        start: f64,
        mut visit: impl FnMut(&[f64; 3], f64, f64),
    ) {
        let now = affine(to_field);
        let moved = match self.moved(nodes, &now, start) {
            Some(moved) => moved,
            None => {
                self.list((nodes, field), (to_field, &now), earliest(start));
                0.0
            }
        };
        for node in self.nodes.iter().filter(|n| n.clear <= moved) {
            visit(&map(&now, &node.position), node.area, node.thickness);
        }
    }

    /// The furthest a listed node can have moved since the list was made [mm]; `None` where the list holds no more, or contact now begins earlier.
    fn moved(&self, nodes: &Nodes, now: &Affine, start: f64) -> Option<f64> {
        let then = affine(&self.listed_at.filter(|_| start >= self.start)?);
        let change: Affine = (
            std::array::from_fn(|i| std::array::from_fn(|j| now.0[i][j] - then.0[i][j])),
            std::array::from_fn(|i| now.1[i] - then.1[i]),
        );
        // the displacement is affine in the node's place: it is longest at a corner
        let furthest = |extent: &[[f64; 3]; 2]| {
            let corners = (0..8).map(|c| std::array::from_fn(|a| extent[c >> a & 1][a]));
            corners.map(|p| map(&change, &p).iter().map(|x| x * x).sum::<f64>()).fold(0.0, f64::max).sqrt()
        };
        let near = furthest(&self.extent);
        (near <= REACH && furthest(&nodes.extent) <= FAR).then_some(near + 1e-9)
    }

    /// Lists the nodes that a motion of [`REACH`] may bring into contact.
    fn list(&mut self, (nodes, field): (&Nodes, &Field), (at, affine): (&Isometry, &Affine), start: f64) {
        (self.listed_at, self.start) = (Some(*at), start);
        self.extent = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        // the memory is taken again where nobody else has the list
        let mut listed = Arc::get_mut(&mut self.nodes).map(std::mem::take).unwrap_or_default();
        listed.clear();
        let (reach, far) = if self.once { (0.0, 0.0) } else { (REACH, FAR) };
        for cluster in &nodes.clusters {
            if field.apart(&map(affine, &cluster.centre), start) > cluster.radius + far {
                continue;
            }
            for a in 0..3 {
                self.extent[0][a] = self.extent[0][a].min(cluster.centre[a] - cluster.radius);
                self.extent[1][a] = self.extent[1][a].max(cluster.centre[a] + cluster.radius);
            }
            for i in cluster.range.clone() {
                let position = nodes.position[i];
                let clear = field.clearance(&map(affine, &position), start);
                if clear <= reach {
                    listed.push(Candidate { position, area: nodes.area[i], thickness: nodes.thickness[i], clear });
                }
            }
        }
        self.nodes = Arc::new(listed);
    }
}
