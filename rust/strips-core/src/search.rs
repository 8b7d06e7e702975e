//! Search over the grounded task: successors, reachable states, and the exact set of all plans up to a horizon.
//!
//! [`SuccessorGenerator`] finds the operators that a packed state allows, [`TransitionSystem`] those of many states at
//! once, with their successors and distances to the goal; [`StateSpace`] numbers the reachable states by
//! parallel breadth-first search; [`greedy_plan`] finds some plan where there are too many states for that; [`PlanSet`] counts, lists, indexes and samples plans without ever holding them.
//! Knows no PDDL text and no learning. Every number and order here is the same for any number of threads.

mod block;
mod condition;
mod counts;
mod cursor;
mod exploration;
mod goal_bound;
mod greedy;
mod plan;
mod plan_graph;
mod plan_set;
mod plan_text;
mod relaxation;
mod sampling;
mod simple;
mod state_graph;
mod state_space;
mod state_table;
mod successor_generator;
mod transition_system;

pub use greedy::{greedy_plan, without_detours};
pub use plan::{Plan, Plans};
pub use plan_set::{PlanIter, PlanSet, Semantics};
pub use sampling::SampleError;
pub use state_graph::StateGraph;
pub use state_space::{Reach, StateId, StateSpace, shortest_plan};
pub use successor_generator::SuccessorGenerator;
pub use transition_system::{Applicable, BatchError, TransitionSystem};
