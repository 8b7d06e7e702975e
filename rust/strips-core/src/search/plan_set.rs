//! The set of all plans of at most so many steps: counted, indexed and listed, never held.
//!
//! Plans are ordered by length, then lexicographically by operator id. Building costs one exploration of the states on
//! which plans can lie and one table of (states × steps) counts; after that a plan of any rank costs its length times
//! the operators to choose from, and listing costs a few nanoseconds a plan.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use num_bigint::BigUint;
use num_traits::{ToPrimitive, Zero};
use rayon::prelude::*;

use super::counts::{Columns, Count, Table, with_columns};
use super::cursor::Cursor;
use super::plan::{Plan, Plans};
use super::plan_graph::{PlanGraph, WalkGraph};
use super::plan_text::OperatorLines;
use super::simple::simple_graph;
use super::state_space::{Reach, StateSpace};
use super::successor_generator::SuccessorGenerator;
use crate::task::{LimitError, Limits, OperatorId, Task, Watch};

/// Which sequences of operators count as plans. The counts differ, so every output names which it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Semantics {
    /// The state after the last step satisfies the goal, and no earlier one does.
    #[default]
    FirstGoal,
    /// The last state satisfies the goal; it may have been reached before, and states may repeat.
    Any,
    /// As `FirstGoal`, and no state repeats.
    Simple,
}

impl Semantics {
    /// The name that the command line and Python use.
    pub fn name(self) -> &'static str {
        match self {
            Self::FirstGoal => "first-goal",
            Self::Any => "any",
            Self::Simple => "simple",
        }
    }

    /// The semantics of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::FirstGoal, Self::Any, Self::Simple].into_iter().find(|semantics| semantics.name() == name)
    }
}

/// All plans of a task of at most `horizon` steps.
#[derive(Clone, Debug)]
pub struct PlanSet {
    task: Arc<Task>,
    horizon: usize,
    semantics: Semantics,
    pub(super) graph: PlanGraph,
    pub(super) table: Table,
    counts: Vec<BigUint>,
    /// For each length, how many plans are shorter; and then how many there are.
    starts: Vec<BigUint>,
    lines: OnceLock<OperatorLines>,
}

impl PlanSet {
    /// Compiles the plan set of a task.
    ///
    /// # Errors
    /// When a budget of `limits` is spent.
    pub fn new(task: Arc<Task>, horizon: usize, semantics: Semantics, limits: &Limits) -> Result<Self, LimitError> {
        let watch = limits.start();
        let mut walks = walks(&task, horizon, semantics, &watch)?;
        let mut table = Table::of_walks(&walks, &watch)?;
        walks.graph.live = table.live();
        let solvable = |steps: usize| !walks.depths.is_empty() && walks.graph.is_live(0, steps);
        walks.graph.roots = (0..=horizon).map(|steps| solvable(steps).then_some(0)).collect();
        if semantics == Semantics::Simple {
            let (graph, goals) = simple_graph(&walks, &watch)?;
            table = Table::of_nodes(&graph, goals, &watch)?;
            walks.graph = graph;
        }
        Ok(Self::assemble(task, horizon, semantics, walks.graph, table))
    }

    fn assemble(task: Arc<Task>, horizon: usize, semantics: Semantics, graph: PlanGraph, table: Table) -> Self {
        let count =
            |(steps, root): (usize, &Option<u32>)| root.map_or_else(BigUint::zero, |root| table.get(root, steps));
        let counts: Vec<BigUint> = graph.roots.iter().enumerate().map(count).collect();
        let mut starts = vec![BigUint::zero()];
        for (steps, count) in counts.iter().enumerate() {
            starts.push(&starts[steps] + count);
        }
        Self { task, horizon, semantics, graph, table, counts, starts, lines: OnceLock::new() }
    }

    /// The task.
    pub fn task(&self) -> &Arc<Task> {
        &self.task
    }

    /// Most steps of a plan.
    pub fn horizon(&self) -> usize {
        self.horizon
    }

    /// Which sequences count.
    pub fn semantics(&self) -> Semantics {
        self.semantics
    }

    /// How many plans there are of each length from 0 to the horizon.
    pub fn counts(&self) -> &[BigUint] {
        &self.counts
    }

    /// How many plans there are.
    pub fn count(&self) -> BigUint {
        self.starts[self.horizon + 1].clone()
    }

    /// Whether there is no plan.
    pub fn is_empty(&self) -> bool {
        self.shortest_length().is_none()
    }

    /// Steps of the shortest plans.
    pub fn shortest_length(&self) -> Option<usize> {
        self.counts.iter().position(|count| !count.is_zero())
    }

    /// The first of the shortest plans, which is the first plan of all.
    pub fn shortest(&self) -> Option<Plan> {
        let cursor = Cursor::first(&self.graph, self.shortest_length()?)?;
        Some(Plan::from_numbers(cursor.operators()))
    }

    /// The entropy in nats of the uniform distribution over the set: the logarithm of its size; −∞ for an empty set.
    pub fn entropy(&self) -> f64 {
        let count = self.count();
        let shift = count.bits().saturating_sub(64);
        let leading = (&count >> shift).to_u64().map_or(0.0, |leading| leading as f64);
        leading.ln() + shift as f64 * std::f64::consts::LN_2
    }

    /// The plan with this rank, if there are as many.
    pub fn unrank(&self, rank: &BigUint) -> Option<Plan> {
        let (length, rest) = self.locate(rank)?;
        Some(Plan::from_numbers(self.cursor_at(length, &rest).operators()))
    }

    /// The length of the plan with this rank, and its rank among those of that length.
    pub(super) fn locate(&self, rank: &BigUint) -> Option<(usize, BigUint)> {
        let length = self.starts.partition_point(|start| start <= rank) - 1;
        (length <= self.horizon).then(|| (length, rank - &self.starts[length]))
    }

    /// A cursor at a rank among the plans of one length.
    pub(super) fn cursor_at(&self, length: usize, rank: &BigUint) -> Cursor<'_> {
        with_columns!(&self.table, columns => {
            let rank = Count::from_big(rank).expect("a rank is below a count of the same width");
            Cursor::at_rank(&self.graph, columns, length, rank)
        })
    }

    /// The plan's rank, or `None` if it is not in the set.
    pub fn rank(&self, plan: &Plan) -> Option<BigUint> {
        self.graph.roots.get(plan.len())?.as_ref()?;
        let within = with_columns!(&self.table, columns => self.rank_within(columns, plan)?);
        Some(&self.starts[plan.len()] + within)
    }

    fn rank_within<C: Count>(&self, columns: &Columns<C>, plan: &Plan) -> Option<BigUint> {
        let (mut node, mut rank) = (self.graph.roots[plan.len()]?, C::zero());
        for (step, operator) in plan.0.iter().enumerate() {
            let left = plan.len() - step - 1;
            let edges = &self.graph.edges[self.graph.edges_of(node)];
            let at = edges.binary_search_by_key(&operator.0, |edge| edge.operator).ok()?;
            for edge in &edges[..at] {
                rank = rank.checked_add(columns.get(edge.target, left)).expect("a rank is below the count");
            }
            node = self.graph.is_live(edges[at].target, left).then_some(edges[at].target)?;
        }
        Some(rank.to_big())
    }

    /// What can follow a prefix, with the number of plans for each: exactly the distribution of the next operator over
    /// the plans that begin so. `None` stands for the end, and comes first; operators ascend. Empty if no plan does.
    pub fn next_operators(&self, prefix: &[OperatorId]) -> Vec<(Option<OperatorId>, BigUint)> {
        let mut next = std::collections::BTreeMap::<Option<OperatorId>, BigUint>::new();
        for length in prefix.len()..=self.horizon {
            let Some(node) = self.follow(prefix, length) else { continue };
            if length == prefix.len() {
                next.insert(None, BigUint::from(1u32));
                continue;
            }
            for edge in &self.graph.edges[self.graph.edges_of(node)] {
                let plans = self.table.get(edge.target, length - prefix.len() - 1);
                if !plans.is_zero() {
                    *next.entry(Some(OperatorId(edge.operator))).or_default() += plans;
                }
            }
        }
        next.into_iter().collect()
    }

    /// The node that a prefix of plans of one length leads to.
    fn follow(&self, prefix: &[OperatorId], length: usize) -> Option<u32> {
        let mut node = self.graph.roots[length]?;
        for (step, operator) in prefix.iter().enumerate() {
            let edges = &self.graph.edges[self.graph.edges_of(node)];
            let at = edges.binary_search_by_key(&operator.0, |edge| edge.operator).ok()?;
            node = edges[at].target;
            if !self.graph.is_live(node, length - step - 1) {
                return None;
            }
        }
        Some(node)
    }

    /// The plans in order, one by one, in memory for one plan.
    pub fn iter(&self) -> PlanIter<'_> {
        PlanIter { set: self, length: 0, cursor: None }
    }

    /// The plans of a range of ranks, clipped to the set, in flat arrays; in parallel.
    ///
    /// # Errors
    /// When the arrays would hold more bytes than `limits` allow, or the work is interrupted.
    pub fn plans_flat(&self, range: Range<BigUint>, limits: &Limits) -> Result<Plans, LimitError> {
        let watch = limits.start();
        let segments = self.segments(range, &watch)?;
        let size = |segment: &Segment| segment.plans * segment.length;
        let mut operators = vec![0u32; segments.iter().map(size).sum()];
        let mut rest = operators.as_mut_slice();
        let mut work = Vec::with_capacity(segments.len());
        for segment in &segments {
            let (rows, after) = rest.split_at_mut(size(segment));
            work.push((segment, rows));
            rest = after;
        }
        let fill = |(segment, rows): (&Segment, &mut [u32])| {
            watch.check()?;
            self.cursor_at(segment.length, &segment.rank).fill(rows);
            Ok(())
        };
        for_each_parallel(work, fill)?;
        Ok(Plans { operators, offsets: offsets(&segments) })
    }

    /// The plans of a range of ranks, clipped to the set, as text: a line an operator, a blank line between plans, and
    /// the empty plan as a comment. In parallel.
    ///
    /// # Errors
    /// When the arrays would hold more bytes than `limits` allow, or the work is interrupted.
    pub fn text(&self, range: Range<BigUint>, limits: &Limits) -> Result<String, LimitError> {
        let watch = limits.start();
        let lines = self.lines.get_or_init(|| OperatorLines::new(&self.task));
        let render = |segment: Segment| {
            watch.check()?;
            let mut rows = vec![0; segment.plans * segment.length];
            self.cursor_at(segment.length, &segment.rank).fill(&mut rows);
            Ok(lines.blocks(&rows, segment.length))
        };
        let segments = self.segments(range, &watch)?;
        let blocks: Vec<String> = segments.into_par_iter().map(render).collect::<Result<_, LimitError>>()?;
        watch.bytes(2 * blocks.iter().map(String::len).sum::<usize>())?;
        Ok(blocks.join("\n"))
    }

    /// Any plans of the task, as [`PlanSet::text`] writes them.
    pub fn text_of<'a>(&self, plans: impl IntoIterator<Item = &'a [u32]>) -> String {
        let lines = self.lines.get_or_init(|| OperatorLines::new(&self.task));
        let mut text = String::new();
        for plan in plans {
            if !text.is_empty() {
                text.push('\n');
            }
            text.push_str(&lines.blocks(plan, plan.len()));
        }
        text
    }

    /// Cuts a range of ranks into pieces of one length and moderate size.
    fn segments(&self, range: Range<BigUint>, watch: &Watch) -> Result<Vec<Segment>, LimitError> {
        let (mut segments, mut bytes) = (Vec::new(), 0);
        for length in 0..=self.horizon {
            let first = range.start.clone().max(self.starts[length].clone());
            let end = range.end.clone().min(self.starts[length + 1].clone());
            if first < end {
                let plans = (&end - &first).to_usize().unwrap_or(usize::MAX >> 16);
                bytes += plans.saturating_mul(length * 4 + 8);
                watch.bytes(bytes)?;
                cut(&mut segments, length, &(first - &self.starts[length]), plans);
            }
        }
        Ok(segments)
    }
}

/// Plans of one length with consecutive ranks.
struct Segment {
    length: usize,
    /// The first one's rank among the plans of the length.
    rank: BigUint,
    plans: usize,
}

fn cut(segments: &mut Vec<Segment>, length: usize, rank: &BigUint, plans: usize) {
    const PLANS: usize = 1 << 14;
    let piece = |first: usize| Segment { length, rank: rank + first, plans: PLANS.min(plans - first) };
    segments.extend((0..plans).step_by(PLANS).map(piece));
}

/// Where each plan begins, and where the last one ends.
fn offsets(segments: &[Segment]) -> Vec<u64> {
    let mut offsets = Vec::with_capacity(1 + segments.iter().map(|segment| segment.plans).sum::<usize>());
    let mut next = 0;
    for segment in segments {
        let length = segment.length as u64;
        offsets.extend((0..segment.plans as u64).map(|plan| next + plan * length));
        next += segment.plans as u64 * length;
    }
    offsets.push(next);
    offsets
}

/// Does all the work, on threads if there is more than one piece.
fn for_each_parallel<T: Send>(
    work: Vec<T>,
    one: impl Fn(T) -> Result<(), LimitError> + Sync + Send,
) -> Result<(), LimitError> {
    if work.len() > 1 { work.into_par_iter().try_for_each(one) } else { work.into_iter().try_for_each(one) }
}

fn walks(task: &Task, horizon: usize, semantics: Semantics, watch: &Watch) -> Result<WalkGraph, LimitError> {
    let generator = SuccessorGenerator::new(task);
    let reach = Reach { horizon: Some(horizon), stop_at_goals: semantics != Semantics::Any };
    let space = StateSpace::with_links(task, &generator, reach, watch)?;
    WalkGraph::new(&space, &generator, horizon, watch)
}

/// Plans in order; see [`PlanSet::iter`].
#[derive(Clone, Debug)]
pub struct PlanIter<'a> {
    set: &'a PlanSet,
    length: usize,
    cursor: Option<Cursor<'a>>,
}

impl Iterator for PlanIter<'_> {
    type Item = Plan;

    fn next(&mut self) -> Option<Plan> {
        if let Some(cursor) = &mut self.cursor {
            if cursor.advance() {
                return Some(Plan::from_numbers(cursor.operators()));
            }
            self.length += 1;
        }
        let lengths = self.length..=self.set.horizon;
        let (length, cursor) = lengths.into_iter().find_map(|n| Some((n, Cursor::first(&self.set.graph, n)?)))?;
        self.length = length;
        Some(Plan::from_numbers(self.cursor.insert(cursor).operators()))
    }
}

impl<'a> IntoIterator for &'a PlanSet {
    type Item = Plan;
    type IntoIter = PlanIter<'a>;

    fn into_iter(self) -> PlanIter<'a> {
        self.iter()
    }
}
