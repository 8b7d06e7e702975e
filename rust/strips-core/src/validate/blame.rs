//! Which earlier step made a fact what it is.

use crate::pddl::ast::GroundAtom;
use crate::task::{OperatorId, Task};

/// For each atom, the last of the steps (from 0) that changed its truth; none where it never changed.
///
/// The steps must be applicable one after another. One replay, whatever the number of atoms.
pub(super) fn last_changes(task: &Task, steps: &[OperatorId], atoms: &[GroundAtom]) -> Vec<Option<usize>> {
    let facts: Vec<_> = atoms.iter().map(|atom| task.fact(atom)).collect();
    let mut changes = vec![None; atoms.len()];
    let mut state = task.init.clone();
    for (step, operator) in steps.iter().enumerate() {
        let next = task.apply(&task.operators[operator.index()], &state);
        for (change, fact) in changes.iter_mut().zip(&facts) {
            if fact.is_some_and(|fact| state.holds(fact) != next.holds(fact)) {
                *change = Some(step);
            }
        }
        state = next;
    }
    changes
}
