//! Minimum cuts of small graphs (Dinic's algorithm).

/// A directed graph with capacities; the last two nodes are source and sink.
pub(crate) struct Graph {
    first: Vec<u32>,
    /// Target, remaining capacity, next edge of the same node. The opposite of edge k is k ^ 1.
    edges: Vec<(u32, u32, u32)>,
    level: Vec<u32>,
    next: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl Graph {
    /// A graph of `nodes` nodes, source and sink not counted, without edges.
    pub(crate) fn new(nodes: usize) -> Graph {
        Graph {
            first: vec![NONE; nodes + 2],
            edges: Vec::new(),
            level: Vec::new(),
            next: Vec::new(),
        }
    }

    fn source(&self) -> u32 {
        self.first.len() as u32 - 2
    }

    fn sink(&self) -> u32 {
        self.first.len() as u32 - 1
    }

    /// An edge that costs `capacity` when `from` is on the source's side and `to` on the sink's.
    pub(crate) fn connect(&mut self, from: usize, to: usize, capacity: u32) {
        for (from, to, capacity) in [(from, to, capacity), (to, from, 0)] {
            let edge = self.edges.len() as u32;
            self.edges.push((to as u32, capacity, self.first[from]));
            self.first[from] = edge;
        }
    }

    /// What a node costs on the sink's side, or, negative, on the source's side.
    pub(crate) fn lean(&mut self, node: usize, cost: i64) {
        let amount = u32::try_from(cost.unsigned_abs()).unwrap_or(u32::MAX / 4);
        match cost {
            1.. => self.connect(self.source() as usize, node, amount),
            ..0 => self.connect(node, self.sink() as usize, amount),
            0 => {}
        }
    }

    /// Which nodes are on the sink's side of the cheapest cut.
    pub(crate) fn cut(mut self) -> Vec<bool> {
        while self.layer() {
            self.next.clone_from(&self.first);
            while self.push() {}
        }
        // What the last layering did not reach.
        let count = self.first.len() - 2;
        self.level[..count].iter().map(|l| *l == NONE).collect()
    }

    /// Distances from the source over edges with capacity left; whether the sink is reached.
    fn layer(&mut self) -> bool {
        self.level = vec![NONE; self.first.len()];
        let source = self.source() as usize;
        self.level[source] = 0;
        let mut queue = std::collections::VecDeque::from([self.source()]);
        while let Some(node) = queue.pop_front() {
            let mut edge = self.first[node as usize];
            while edge != NONE {
                let (to, left, next) = self.edges[edge as usize];
                if left > 0 && self.level[to as usize] == NONE {
                    self.level[to as usize] = self.level[node as usize] + 1;
                    queue.push_back(to);
                }
                edge = next;
            }
        }
        self.level[self.sink() as usize] != NONE
    }

    /// Sends flow along one shortest path; whether there was one.
    fn push(&mut self) -> bool {
        let mut path: Vec<u32> = Vec::new();
        let mut node = self.source();
        while node != self.sink() {
            let edge = self.next[node as usize];
            if edge == NONE {
                // A dead end: back, and not this way again.
                let Some(back) = path.pop() else { return false };
                node = self.edges[(back ^ 1) as usize].0;
                self.next[node as usize] = self.edges[back as usize].2;
                continue;
            }
            let (to, left, next) = self.edges[edge as usize];
            if left > 0 && self.level[to as usize] == self.level[node as usize] + 1 {
                path.push(edge);
                node = to;
            } else {
                self.next[node as usize] = next;
            }
        }
        let least = path
            .iter()
            .map(|e| self.edges[*e as usize].1)
            .min()
            .unwrap_or(0);
        for edge in path {
            self.edges[edge as usize].1 -= least;
            self.edges[(edge ^ 1) as usize].1 += least;
        }
        least > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cut_is_the_cheapest_of_all() {
        for seed in 0..200u32 {
            let number = |k: u32| {
                (seed
                    .wrapping_mul(2_654_435_761)
                    .wrapping_add(k.wrapping_mul(40_503))
                    >> 7)
                    % 20
            };
            let leans: Vec<i64> = (0..6).map(|k| i64::from(number(k)) - 9).collect();
            let edges: Vec<(usize, usize, u32)> = (0..12)
                .map(|k| {
                    (
                        number(50 + k) as usize % 6,
                        number(90 + k) as usize % 6,
                        number(130 + k),
                    )
                })
                .filter(|(a, b, _)| a != b)
                .collect();
            let cost = |sides: &dyn Fn(usize) -> bool| -> i64 {
                let leaning: i64 = (0..6)
                    .map(|k| {
                        if sides(k) {
                            leans[k].max(0)
                        } else {
                            (-leans[k]).max(0)
                        }
                    })
                    .sum();
                leaning
                    + edges
                        .iter()
                        .filter(|(a, b, _)| !sides(*a) && sides(*b))
                        .map(|e| i64::from(e.2))
                        .sum::<i64>()
            };
            let mut graph = Graph::new(6);
            leans
                .iter()
                .enumerate()
                .for_each(|(k, lean)| graph.lean(k, *lean));
            edges
                .iter()
                .for_each(|(a, b, capacity)| graph.connect(*a, *b, *capacity));
            let cut = graph.cut();
            let least = (0..64u32).map(|sides| cost(&|k| sides >> k & 1 == 1)).min();
            assert_eq!(Some(cost(&|k| cut[k])), least, "{seed}");
        }
    }
}
