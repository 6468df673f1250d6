//! Minimum cuts of a weighted graph, for instance the cheapest closed curve on a surface that separates two vertex sets.

use std::collections::VecDeque;

const NONE: u32 = u32::MAX;

/// An undirected edge: two nodes and the cost of parting them.
pub type WeightedEdge = (u32, u32, u64);

struct Network {
    head: Vec<u32>,
    to: Vec<u32>,
    next: Vec<u32>,
    residual: Vec<u64>,
}

impl Network {
    fn new(nodes: usize, edges: &[WeightedEdge]) -> Network {
        let mut network = Network {
            head: vec![NONE; nodes],
            to: Vec::with_capacity(2 * edges.len()),
            next: Vec::with_capacity(2 * edges.len()),
            residual: Vec::with_capacity(2 * edges.len()),
        };
        for &(a, b, cost) in edges {
            for (from, to) in [(a, b), (b, a)] {
                network.next.push(network.head[from as usize]);
                network.head[from as usize] = network.to.len() as u32;
                network.to.push(to);
                network.residual.push(cost);
            }
        }
        network
    }

    /// Steps from the source over arcs with capacity left; `NONE` where it cannot be reached.
    fn levels(&self, source: u32) -> Vec<u32> {
        let mut level = vec![NONE; self.head.len()];
        level[source as usize] = 0;
        let mut queue = VecDeque::from([source]);
        while let Some(v) = queue.pop_front() {
            let mut arc = self.head[v as usize];
            while arc != NONE {
                let w = self.to[arc as usize];
                if self.residual[arc as usize] > 0 && level[w as usize] == NONE {
                    level[w as usize] = level[v as usize] + 1;
                    queue.push_back(w);
                }
                arc = self.next[arc as usize];
            }
        }
        level
    }

    /// Saturates every shortest path (Dinic's blocking flow), without recursion.
    fn block(&mut self, source: u32, sink: u32, level: &[u32]) {
        let mut current = self.head.clone();
        let mut path: Vec<u32> = Vec::new();
        let mut v = source;
        loop {
            if v == sink {
                let push = path.iter().map(|&a| self.residual[a as usize]).min().unwrap_or(0);
                let mut first_full = 0;
                for (i, &a) in path.iter().enumerate().rev() {
                    self.residual[a as usize] -= push;
                    self.residual[(a ^ 1) as usize] += push;
                    if self.residual[a as usize] == 0 {
                        first_full = i;
                    }
                }
                v = self.to[(path[first_full] ^ 1) as usize];
                path.truncate(first_full);
                continue;
            }
            let arc = current[v as usize];
            if arc == NONE {
                let Some(back) = path.pop() else { return };
                v = self.to[(back ^ 1) as usize];
                current[v as usize] = self.next[back as usize];
            } else if self.residual[arc as usize] > 0
                && level[self.to[arc as usize] as usize] == level[v as usize].saturating_add(1)
            {
                path.push(arc);
                v = self.to[arc as usize];
            } else {
                current[v as usize] = self.next[arc as usize];
            }
        }
    }
}

/// Whether each of `nodes` nodes lies on the source's side of the cheapest set of edges that parts all of `source`
/// from all of `sink`; of several, the one with the smallest source side. Empty `source` or `sink` gives the trivial cut.
///
/// Method: Dinic's maximum flow. Costs must sum to less than 2^63; a node in both sets counts as source.
pub fn min_cut(nodes: usize, edges: &[WeightedEdge], source: &[u32], sink: &[u32]) -> Vec<bool> {
    const TIED: u64 = 1 << 62;
    let (s, t) = (nodes as u32, nodes as u32 + 1);
    let mut tied = vec![false; nodes];
    let mut all = edges.to_vec();
    for (set, terminal) in [(source, s), (sink, t)] {
        for &v in set {
            if !std::mem::replace(&mut tied[v as usize], true) {
                all.push((terminal, v, TIED));
            }
        }
    }
    let mut network = Network::new(nodes + 2, &all);
    loop {
        let level = network.levels(s);
        if level[t as usize] == NONE {
            return level[..nodes].iter().map(|&l| l != NONE).collect();
        }
        network.block(s, t, &level);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cheapest_edges_are_cut_and_the_source_side_is_smallest() {
        let chain = [(0, 1, 5), (1, 2, 2), (2, 3, 2), (3, 4, 7)];
        assert_eq!(min_cut(5, &chain, &[0], &[4]), [true, true, false, false, false]);
        let square = [(0, 1, 3), (1, 3, 1), (0, 2, 1), (2, 3, 3)];
        assert_eq!(min_cut(4, &square, &[0], &[3]), [true, true, false, false]);
    }

    #[test]
    fn the_cut_costs_as_much_as_the_best_of_all_partitions() {
        let n = 8usize;
        let edges: Vec<WeightedEdge> = (0..n as u32)
            .flat_map(|a| (a + 1..n as u32).map(move |b| (a, b, u64::from((a * 7 + b * 13 + a * b) % 11))))
            .collect();
        let cost =
            |side: &dyn Fn(u32) -> bool| -> u64 { edges.iter().filter(|e| side(e.0) != side(e.1)).map(|e| e.2).sum() };
        let best = (0..1u32 << n)
            .filter(|mask| mask & 1 == 1 && mask >> (n - 1) == 0)
            .map(|mask| cost(&|v| mask >> v & 1 == 1))
            .min()
            .unwrap();
        let cut = min_cut(n, &edges, &[0], &[n as u32 - 1]);
        assert_eq!(cost(&|v| cut[v as usize]), best);
    }
}
