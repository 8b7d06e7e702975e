//! The reachable states, numbered, with their exact distances to the goal.

use std::collections::VecDeque;

use super::exploration::{Explored, Links, NOWHERE, Scope, explore};
use super::goal_bound::GoalBound;
use super::plan::Plan;
use super::state_table::{hash_words, shard_of};
use super::successor_generator::SuccessorGenerator;
use crate::pddl::ast::index;
use crate::task::{LimitError, Limits, OperatorId, State, Task, Watch};

index!(/** A state's number: by layer, then by the first parent's number, then by operator. */ StateId);

/// Blocks with fewer candidate successors are not worth handing to threads.
pub(super) const SERIAL_BELOW: usize = 1 << 13;

/// How far a [`StateSpace`] reaches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reach {
    /// Most steps from the initial state; `None` for all reachable states. With a horizon, states from which the goal
    /// is out of reach in the steps that remain may be left out.
    pub horizon: Option<usize>,
    /// Whether a state that satisfies the goal ends the search there, as in first-goal plan sets.
    pub stop_at_goals: bool,
}

/// The states reachable from the initial one, numbered as a breadth-first search on one thread would.
///
/// Holds for each state its packed words, 11 to 21 bytes of look-up table and 4 bytes of distance.
#[derive(Clone, Debug)]
pub struct StateSpace {
    pub(super) width: usize,
    facts: usize,
    pub(super) explored: Explored,
    pub(super) distances: Vec<u32>,
    horizon: Option<usize>,
}

impl StateSpace {
    /// Explores the states of a task.
    ///
    /// # Errors
    /// When a budget of `limits` is spent.
    pub fn explore(task: &Task, reach: Reach, limits: &Limits) -> Result<Self, LimitError> {
        let (generator, watch) = (SuccessorGenerator::new(task), limits.start());
        let mut space = Self::with_links(task, &generator, reach, &watch)?;
        space.explored.links = Links::default();
        Ok(space)
    }

    /// As [`Self::explore`], and keeps what leads where.
    pub(super) fn with_links(
        task: &Task,
        generator: &SuccessorGenerator,
        reach: Reach,
        watch: &Watch,
    ) -> Result<Self, LimitError> {
        let (bound, width) = (GoalBound::new(task), generator.width());
        let scope = scope(reach, true);
        let explored = explore(generator, &bound, &padded(&task.init, width), scope, watch)?;
        let distances = distances(&explored, &bound, width, watch)?;
        Ok(Self { width, facts: task.facts.len(), explored, distances, horizon: reach.horizon })
    }

    /// Explores from several packed states at once, none of which needs to be reachable from the initial one. The depth
    /// of a state is its distance from the nearest of them; with a horizon, all that matters to the distances of the
    /// given states to the goal is there.
    pub(super) fn around(
        task: &Task,
        (generator, bound): (&SuccessorGenerator, &GoalBound),
        states: &[u64],
        horizon: Option<usize>,
        watch: &Watch,
    ) -> Result<Self, LimitError> {
        let (reach, width) = (Reach { horizon, stop_at_goals: true }, generator.width());
        let explored = explore(generator, bound, states, scope(reach, true), watch)?;
        let distances = distances(&explored, bound, width, watch)?;
        Ok(Self { width, facts: task.facts.len(), explored, distances, horizon })
    }

    /// Numbers the reachable states without their distances to the goal, for counting and measuring.
    ///
    /// # Errors
    /// When a budget of `limits` is spent.
    pub fn reachable(task: &Task, reach: Reach, limits: &Limits) -> Result<Self, LimitError> {
        let (generator, bound, watch) = (SuccessorGenerator::new(task), GoalBound::new(task), limits.start());
        let width = generator.width();
        let explored = explore(&generator, &bound, &padded(&task.init, width), scope(reach, false), &watch)?;
        Ok(Self { width, facts: task.facts.len(), explored, distances: Vec::new(), horizon: reach.horizon })
    }

    /// How many states there are.
    pub fn len(&self) -> usize {
        self.explored.states.len() / self.width
    }

    /// Whether there is no state, because the goal is out of reach within the horizon.
    pub fn is_empty(&self) -> bool {
        self.explored.states.is_empty()
    }

    /// The number of states of each layer: those whose shortest path from the initial state has that many steps.
    pub fn layer_sizes(&self) -> Vec<usize> {
        self.explored.layers.windows(2).map(|pair| (pair[1] - pair[0]) as usize).collect()
    }

    /// Steps of a shortest path from the initial state.
    pub fn depth(&self, state: StateId) -> usize {
        self.explored.layers.partition_point(|&first| first <= state.0) - 1
    }

    /// The state with this number.
    pub fn state(&self, state: StateId) -> State {
        let words = &self.words(state)[..self.facts.div_ceil(64)];
        State(words.into())
    }

    /// The number of a state, if it is there.
    pub fn find(&self, state: &State) -> Option<StateId> {
        self.find_words(&padded(state, self.width))
    }

    /// The number of a packed state, if it is there.
    pub(super) fn find_words(&self, words: &[u64]) -> Option<StateId> {
        let hash = hash_words(words);
        let same = |number| self.words(StateId(number)) == words;
        self.explored.table.shards[shard_of(hash)].find(hash, same).ok().map(StateId)
    }

    /// Steps of a shortest path to a goal state; `None` where there is none, or where it does not fit between this
    /// state's depth and the horizon.
    pub fn distance_to_goal(&self, state: StateId) -> Option<usize> {
        let distance = *self.distances.get(state.index())?;
        let fits = |horizon: usize| self.depth(state) + distance as usize <= horizon;
        (distance != u32::MAX && self.horizon.is_none_or(fits)).then_some(distance as usize)
    }

    /// Bytes held beside the packed states.
    pub fn bytes_beside_states(&self) -> usize {
        self.explored.table.bytes() + self.distances.len() * 4 + self.explored.layers.len() * 4
    }

    fn words(&self, state: StateId) -> &[u64] {
        &self.explored.states[state.index() * self.width..][..self.width]
    }
}

/// The lexicographically first of the shortest plans of at most `horizon` steps, without building a plan set.
///
/// # Errors
/// When a budget of `limits` is spent.
pub fn shortest_plan(task: &Task, horizon: Option<usize>, limits: &Limits) -> Result<Option<Plan>, LimitError> {
    let (generator, bound, watch) = (SuccessorGenerator::new(task), GoalBound::new(task), limits.start());
    let scope = Scope { stop_at_goal: true, ..scope(Reach { horizon, stop_at_goals: true }, false) };
    let explored = explore(&generator, &bound, &padded(&task.init, generator.width()), scope, &watch)?;
    Ok(explored.goal.map(|goal| path_to(goal, &explored, &generator)))
}

/// Follows first parents back; between two states the first operator that leads there is the one.
fn path_to(goal: u32, explored: &Explored, generator: &SuccessorGenerator) -> Plan {
    let words = |state: u32| &explored.states[state as usize * generator.width()..][..generator.width()];
    let (mut operators, mut state) = (Vec::new(), goal);
    while state != 0 {
        let parent = explored.parents[state as usize];
        operators.push(generator.operator_between(words(parent), words(state)));
        state = parent;
    }
    operators.reverse();
    Plan(operators.into_iter().map(OperatorId).collect())
}

fn scope(reach: Reach, links: bool) -> Scope {
    let Reach { horizon, stop_at_goals } = reach;
    Scope { horizon, expand_goals: !stop_at_goals, links, stop_at_goal: false, serial_below: SERIAL_BELOW }
}

/// The state's words, at least one of them.
pub(super) fn padded(state: &State, width: usize) -> Vec<u64> {
    let mut words = state.0.to_vec();
    words.resize(width, 0);
    words
}

/// Backward breadth-first search from the goal states over the reversed links; `u32::MAX` for no path.
fn distances(explored: &Explored, bound: &GoalBound, width: usize, watch: &Watch) -> Result<Vec<u32>, LimitError> {
    let start = |words: &[u64]| if bound.is_goal(words) { 0 } else { u32::MAX };
    let mut distances: Vec<u32> = explored.states.chunks_exact(width).map(start).collect();
    let mut queue: VecDeque<u32> = (0..distances.len() as u32).filter(|&n| distances[n as usize] == 0).collect();
    if queue.is_empty() {
        return Ok(distances);
    }
    let (ends, sources) = reversed(&explored.links, distances.len(), watch)?;
    watch.check()?;
    while let Some(state) = queue.pop_front() {
        if state % 4096 == 0 {
            watch.check()?;
        }
        let first = if state == 0 { 0 } else { ends[state as usize - 1] };
        for &source in &sources[first as usize..ends[state as usize] as usize] {
            if distances[source as usize] == u32::MAX {
                distances[source as usize] = distances[state as usize] + 1;
                queue.push_back(source);
            }
        }
    }
    Ok(distances)
}

/// For each state, where its sources end, and the sources.
fn reversed(links: &Links, states: usize, watch: &Watch) -> Result<(Vec<u64>, Vec<u32>), LimitError> {
    let mut ends = vec![0u64; states + 1];
    let kept = |&&target: &&u32| target != NOWHERE;
    for targets in links.targets.chunks(1 << 20) {
        watch.check()?;
        targets.iter().filter(kept).for_each(|&target| ends[target as usize + 1] += 1);
    }
    (0..states).for_each(|state| ends[state + 1] += ends[state]);
    let mut sources = vec![0; ends[states] as usize];
    for source in 0..links.ends.len() {
        if source % 65_536 == 0 {
            watch.check()?;
        }
        for &target in links.of(source).iter().filter(kept) {
            let place = &mut ends[target as usize];
            sources[*place as usize] = source as u32;
            *place += 1;
        }
    }
    Ok((ends, sources))
}
