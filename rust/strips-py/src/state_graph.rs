//! `state_graph`: a small state space spelled out, for drawing.

use pyo3::prelude::*;
use strips_core::search::StateGraph;
use strips_core::task::OperatorId;
use strips_core::task::limits::Limits;

use crate::interrupt;
use crate::task::Task;

/// Atoms, depth and goal of each state, and the edges (from, to, operator).
type Drawn = (Vec<Vec<String>>, Vec<usize>, Vec<bool>, Vec<(usize, usize, String)>);

/// The states on plans of at most `horizon` steps: their atoms, depths and goals, and the edges between them.
///
/// Raises `LimitError` where there are more than `max_states`.
#[pyfunction]
#[pyo3(signature = (task, horizon, *, max_states = 1000))]
pub fn state_graph(py: Python<'_>, task: &Task, horizon: usize, max_states: usize) -> PyResult<Drawn> {
    let (limits, core) = (Limits { states: max_states, ..Limits::default() }, task.core.clone());
    let name = |operator: OperatorId| task.core.operator_name(operator);
    let graph = interrupt::run(py, &limits, |limits| StateGraph::new(&core, horizon, limits))?;
    let edges = graph.edges.into_iter().map(|(from, to, operator)| (from, to, name(operator))).collect();
    Ok((graph.states, graph.depths, graph.goals, edges))
}
