//! The part of the state graph on which plans lie.
//!
//! Nodes are states from which the goal can be reached in the steps that remain when they are first reached, in
//! breadth-first order; edges are the operator applications between them that a plan can use, ascending by operator.
//! A plan of length `L` is a walk of `L` edges from the root to a goal node. The same graph form, with a node for each
//! (state, steps left, states not to visit again), holds the simple plans; see `simple`.

use rayon::prelude::*;

use super::state_space::StateSpace;
use super::successor_generator::SuccessorGenerator;
use crate::task::{LimitError, Watch};

/// One operator application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    pub operator: u32,
    pub target: u32,
}

/// Nodes with their outgoing edges.
#[derive(Clone, Debug, Default)]
pub(super) struct PlanGraph {
    /// Where each node's edges end.
    pub ends: Vec<u64>,
    pub edges: Vec<Edge>,
    /// For each length, the node where plans of that length start, if there are any.
    pub roots: Vec<Option<u32>>,
    /// Which nodes have a plan of exactly so many steps.
    pub live: Live,
}

/// Whether walks of exactly so many steps lead from a node to a goal.
#[derive(Clone, Debug, Default)]
pub(super) enum Live {
    /// Every edge lies on a plan of the length at hand.
    #[default]
    Everywhere,
    /// For each number of steps, a bit a node.
    Bits(Vec<Vec<u64>>),
}

impl PlanGraph {
    /// Positions of a node's edges.
    #[inline]
    pub fn edges_of(&self, node: u32) -> std::ops::Range<usize> {
        let first = if node == 0 { 0 } else { self.ends[node as usize - 1] };
        first as usize..self.ends[node as usize] as usize
    }

    /// Whether a walk of exactly `steps` edges leads from the node to a goal.
    #[inline]
    pub fn is_live(&self, node: u32, steps: usize) -> bool {
        match &self.live {
            Live::Everywhere => true,
            Live::Bits(columns) => columns[steps][node as usize / 64] >> (node % 64) & 1 == 1,
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.ends.len() * 8 + self.edges.len() * 8
    }
}

/// The graph of all walks that stay on the way to the goal, and what is known of each node.
#[derive(Clone, Debug)]
pub(super) struct WalkGraph {
    pub graph: PlanGraph,
    /// Steps from the initial state, ascending.
    pub depths: Vec<u32>,
    /// Steps to the nearest goal.
    pub distances: Vec<u32>,
    pub horizon: usize,
}

impl WalkGraph {
    /// Keeps of a state space what plans of at most `horizon` steps can use.
    pub fn new(
        space: &StateSpace,
        generator: &SuccessorGenerator,
        horizon: usize,
        watch: &Watch,
    ) -> Result<Self, LimitError> {
        let depths = depths(space);
        let numbers = numbers(&depths, &space.distances, horizon);
        let (ends, edges) = edges(space, generator, &Kept { depths: &depths, numbers: &numbers, horizon }, watch)?;
        let kept = |values: &[u32]| -> Vec<u32> {
            let chosen = values.iter().zip(&numbers).filter(|&(_, &number)| number != DROPPED);
            chosen.map(|(&value, _)| value).collect()
        };
        let (depths, distances) = (kept(&depths), kept(&space.distances));
        let graph = PlanGraph { ends, edges, roots: Vec::new(), live: Live::Everywhere };
        watch.bytes(graph.bytes())?;
        Ok(Self { graph, depths, distances, horizon })
    }

    /// Nodes that can have `steps` steps left: a prefix, as nodes ascend by depth.
    pub fn width(&self, steps: usize) -> usize {
        self.depths.partition_point(|&depth| depth as usize + steps <= self.horizon)
    }
}

/// The new number of a state that is not kept.
const DROPPED: u32 = u32::MAX;

struct Kept<'a> {
    depths: &'a [u32],
    numbers: &'a [u32],
    horizon: usize,
}

fn depths(space: &StateSpace) -> Vec<u32> {
    let layers = space.layer_sizes();
    layers.iter().enumerate().flat_map(|(depth, &size)| std::iter::repeat_n(depth as u32, size)).collect()
}

/// Numbers the states that lie on some plan, in their order.
fn numbers(depths: &[u32], distances: &[u32], horizon: usize) -> Vec<u32> {
    let mut next = 0;
    let number = |(&depth, &distance): (&u32, &u32)| {
        if u64::from(depth) + u64::from(distance) > horizon as u64 {
            return DROPPED;
        }
        next += 1;
        next - 1
    };
    depths.iter().zip(distances).map(number).collect()
}

/// All edges, by runs of states in parallel.
fn edges(
    space: &StateSpace,
    generator: &SuccessorGenerator,
    kept: &Kept,
    watch: &Watch,
) -> Result<(Vec<u64>, Vec<Edge>), LimitError> {
    const RUN: usize = 2048;
    let run = |first: usize| {
        watch.check()?;
        Ok(edges_of_run(space, generator, kept, first..space.len().min(first + RUN)))
    };
    let starts: Vec<usize> = (0..space.len()).step_by(RUN).collect();
    let runs = if starts.len() > 1 {
        starts.par_iter().map(|&first| run(first)).collect::<Result<Vec<_>, LimitError>>()?
    } else {
        starts.iter().map(|&first| run(first)).collect::<Result<Vec<_>, LimitError>>()?
    };
    let (mut ends, mut edges) = (Vec::new(), Vec::with_capacity(runs.iter().map(|run| run.1.len()).sum()));
    for (run_ends, run_edges) in runs {
        ends.extend(run_ends.into_iter().map(|end| end + edges.len() as u64));
        edges.extend(run_edges);
    }
    Ok((ends, edges))
}

fn edges_of_run(
    space: &StateSpace,
    generator: &SuccessorGenerator,
    kept: &Kept,
    run: std::ops::Range<usize>,
) -> (Vec<u64>, Vec<Edge>) {
    let (mut ends, mut edges, mut applicable) = (Vec::new(), Vec::new(), Vec::new());
    for state in run.filter(|&state| kept.numbers[state] != DROPPED) {
        let targets = space.explored.links.of(state);
        if !targets.is_empty() {
            let words = &space.explored.states[state * space.width..][..space.width];
            generator.applicable_in(words, &mut applicable);
            let useful = |&(_, &target): &(&u32, &u32)| kept.leads_on(kept.depths[state], target, space);
            let edge = |(&operator, &target)| Edge { operator, target: kept.numbers[target as usize] };
            edges.extend(applicable.iter().zip(targets).filter(useful).map(edge));
        }
        ends.push(edges.len() as u64);
    }
    (ends, edges)
}

impl Kept<'_> {
    /// Whether a goal can be reached in time through `target` from a state at `depth`.
    #[inline]
    fn leads_on(&self, depth: u32, target: u32, space: &StateSpace) -> bool {
        target != super::exploration::NOWHERE
            && self.numbers[target as usize] != DROPPED
            && depth as usize + 1 + space.distances[target as usize] as usize <= self.horizon
    }
}
