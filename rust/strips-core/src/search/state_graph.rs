//! A small state space spelled out, for people to look at: every state's atoms, every edge's operator.

use super::state_space::{Reach, StateId, StateSpace};
use super::successor_generator::SuccessorGenerator;
use crate::task::{LimitError, Limits, OperatorId, State, Task};

/// The states on the ways from the initial state to the goal within a horizon, and what leads where.
///
/// States are numbered as in [`StateSpace`]: the initial one is 0, then by distance from it. Goal states have no edges.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StateGraph {
    /// The atoms of each state in PDDL, static ones left out.
    pub states: Vec<Vec<String>>,
    /// Steps of a shortest path from the initial state.
    pub depths: Vec<usize>,
    /// Whether the state satisfies the goal.
    pub goals: Vec<bool>,
    /// (from, to, operator), ascending.
    pub edges: Vec<(usize, usize, OperatorId)>,
}

impl StateGraph {
    /// Spells out the states that lie on plans of at most `horizon` steps.
    ///
    /// # Errors
    /// When a budget of `limits` is spent.
    pub fn new(task: &Task, horizon: usize, limits: &Limits) -> Result<Self, LimitError> {
        let space = StateSpace::explore(task, Reach { horizon: Some(horizon), stop_at_goals: true }, limits)?;
        let kept: Vec<StateId> =
            (0..space.len()).map(StateId::from).filter(|&state| space.distance_to_goal(state).is_some()).collect();
        let generator = SuccessorGenerator::new(task);
        let mut graph = Self::default();
        for &state in &kept {
            graph.push(task, &space, state);
        }
        for (from, &state) in kept.iter().enumerate().filter(|&(from, _)| !graph.goals[from]) {
            graph.edges.extend(edges(&space, &generator, &kept, from, &space.state(state)));
        }
        Ok(graph)
    }

    fn push(&mut self, task: &Task, space: &StateSpace, id: StateId) {
        let state = space.state(id);
        let true_facts = (0..task.facts.len()).map(crate::task::FactId::from).filter(|&fact| state.holds(fact));
        self.states.push(true_facts.map(|fact| task.fact_name(fact)).collect());
        self.depths.push(space.depth(id));
        self.goals.push(space.distance_to_goal(id) == Some(0));
    }
}

/// The edges that leave a state, to states that are kept.
fn edges(
    space: &StateSpace,
    generator: &SuccessorGenerator,
    kept: &[StateId],
    from: usize,
    state: &State,
) -> Vec<(usize, usize, OperatorId)> {
    let to = |operator: &OperatorId| {
        let next = space.find(&generator.successor(state, *operator))?;
        kept.binary_search(&next).ok()
    };
    let mut found: Vec<_> = generator
        .applicable(state)
        .into_iter()
        .filter_map(|operator| to(&operator).map(|target| (from, target, operator)))
        .collect();
    found.sort_unstable();
    found
}
