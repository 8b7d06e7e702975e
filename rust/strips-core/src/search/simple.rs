//! The graph of simple plans: first-goal plans on which no state repeats.
//!
//! Which steps may follow depends on the states already visited, but only on those that can be visited again on the way
//! to the goal in the steps that are left. A node is therefore (state, steps left, visited states that still matter),
//! and histories that differ in nothing that matters share one node. A visited state `p` matters to a state `s` with
//! `n` steps left only if max(1, depth(p) − depth(s)) + distance(p) ≤ n: getting back to `p` takes at least one step and
//! at least the difference of their depths, and the goal is `distance(p)` further. On shortest plans nothing matters;
//! with much slack and many cycles nodes can grow towards the number of plans, and the budget ends it.
//!
//! Built by falling number of steps left, so that plans of different lengths share nodes; then nodes without a plan are
//! taken out, and the others numbered so that each comes after its targets.

use rustc_hash::FxHashMap;

use super::plan_graph::{Edge, Live, PlanGraph, WalkGraph};
use crate::task::{LimitError, Watch};

/// All nodes with the same number of steps left.
#[derive(Default)]
struct Level {
    states: Vec<u32>,
    /// Visited states that matter, ascending, node after node; and where each node's end.
    visited: Vec<u32>,
    visited_ends: Vec<usize>,
    /// Edges to nodes of the next level, by position there; and where each node's end.
    edges: Vec<Edge>,
    ends: Vec<usize>,
    /// The node where plans of exactly this many steps start.
    root: Option<u32>,
    free: FxHashMap<u32, u32>,
    bound: FxHashMap<Box<[u32]>, u32>,
}

/// Builds the graph of simple plans, and tells how many of its first nodes are goals.
pub(super) fn simple_graph(walks: &WalkGraph, watch: &Watch) -> Result<(PlanGraph, usize), LimitError> {
    let mut levels: Vec<Level> = Vec::with_capacity(walks.horizon + 1);
    let mut bytes = walks.graph.bytes();
    for left in (0..=walks.horizon).rev() {
        let mut level = Level::default();
        if walks.graph.roots[left].is_some() {
            level.root = Some(level.intern(0, &[]));
        }
        if let Some(above) = levels.last_mut() {
            above.expand(&mut level, walks, left, bytes, watch)?;
            bytes += above.close();
        }
        levels.push(level);
    }
    levels.reverse();
    compact(&levels, watch)
}

impl Level {
    /// The node for a state and the visited states that matter, which must ascend.
    fn intern(&mut self, state: u32, visited: &[u32]) -> u32 {
        let next = self.states.len() as u32;
        let known = if visited.is_empty() {
            *self.free.entry(state).or_insert(next)
        } else {
            let key: Box<[u32]> = std::iter::once(state).chain(visited.iter().copied()).collect();
            *self.bound.entry(key).or_insert(next)
        };
        if known == next {
            self.states.push(state);
            self.visited.extend_from_slice(visited);
            self.visited_ends.push(self.visited.len());
        }
        known
    }

    fn visited(&self, node: usize) -> &[u32] {
        let first = if node == 0 { 0 } else { self.visited_ends[node - 1] };
        &self.visited[first..self.visited_ends[node]]
    }

    /// Makes the edges of all nodes; their targets, in `below`, have `left` steps left.
    fn expand(
        &mut self,
        below: &mut Level,
        walks: &WalkGraph,
        left: usize,
        bytes: usize,
        watch: &Watch,
    ) -> Result<(), LimitError> {
        let mut kept = Vec::new();
        for node in 0..self.states.len() {
            if node % 1024 == 0 {
                watch.check()?;
                watch.bytes(bytes + self.bytes() + below.bytes())?;
            }
            for position in walks.graph.edges_of(self.states[node]) {
                let Edge { operator, target } = walks.graph.edges[position];
                if walks.graph.is_live(target, left) && self.remember(node, target, left, walks, &mut kept) {
                    self.edges.push(Edge { operator, target: below.intern(target, &kept) });
                }
            }
            self.ends.push(self.edges.len());
        }
        Ok(())
    }

    /// Collects the visited states that matter to `target`; false if it is one of the visited states itself.
    fn remember(&self, node: usize, target: u32, left: usize, walks: &WalkGraph, kept: &mut Vec<u32>) -> bool {
        let (state, visited) = (self.states[node], self.visited(node));
        if target == state || visited.binary_search(&target).is_ok() {
            return false;
        }
        kept.clear();
        let at = visited.partition_point(|&seen| seen < state);
        let all = visited[..at].iter().chain(std::iter::once(&state)).chain(&visited[at..]);
        kept.extend(all.filter(|&&seen| matters(seen, target, left, walks)));
        true
    }

    /// Frees what only building needed; the bytes that remain.
    fn close(&mut self) -> usize {
        self.free = FxHashMap::default();
        self.bound = FxHashMap::default();
        self.visited = Vec::new();
        self.visited_ends = Vec::new();
        self.bytes()
    }

    fn bytes(&self) -> usize {
        let keys = self.bound.capacity() * 40 + self.free.capacity() * 12 + self.visited.len() * 8;
        self.states.len() * 24 + self.edges.len() * 8 + keys
    }
}

/// Whether a walk of `left` steps from `state` to a goal could come back to `seen`.
fn matters(seen: u32, state: u32, left: usize, walks: &WalkGraph) -> bool {
    let back = walks.depths[seen as usize].saturating_sub(walks.depths[state as usize]).max(1);
    back as usize + walks.distances[seen as usize] as usize <= left
}

/// Numbers the nodes that have a plan, the fewest steps left first.
fn compact(levels: &[Level], watch: &Watch) -> Result<(PlanGraph, usize), LimitError> {
    const DEAD: u32 = u32::MAX;
    let mut graph = PlanGraph { live: Live::Everywhere, ..PlanGraph::default() };
    let mut below: Vec<u32> = Vec::new();
    for (left, level) in levels.iter().enumerate() {
        let mut numbers = vec![DEAD; level.states.len()];
        for (node, number) in numbers.iter_mut().enumerate() {
            if node % 65_536 == 0 {
                watch.check()?;
            }
            let first = graph.edges.len();
            let edges = if left == 0 { &[][..] } else { level.edges_of(node) };
            let live = edges.iter().map(|edge| Edge { target: below[edge.target as usize], ..*edge });
            graph.edges.extend(live.filter(|edge| edge.target != DEAD));
            if left == 0 || graph.edges.len() > first {
                *number = graph.ends.len() as u32;
                graph.ends.push(graph.edges.len() as u64);
            }
        }
        graph.roots.push(level.root.map(|root| numbers[root as usize]).filter(|&number| number != DEAD));
        below = numbers;
    }
    Ok((graph, levels[0].states.len()))
}

impl Level {
    fn edges_of(&self, node: usize) -> &[Edge] {
        let first = if node == 0 { 0 } else { self.ends[node - 1] };
        &self.edges[first..self.ends[node]]
    }
}
