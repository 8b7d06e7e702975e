//! Plans by recursion over `Task::apply`: slow, obvious, and apart from everything in `search`.

use strips_core::search::Semantics;
use strips_core::task::{OperatorId, State, Task};

/// All plans of at most `horizon` steps, by length and then lexicographically; or `None` if there are more than `most`
/// sequences to look at.
pub fn plans(task: &Task, horizon: usize, semantics: Semantics, most: usize) -> Option<Vec<Vec<u32>>> {
    let mut walk = Walk { task, semantics, path: vec![task.init.clone()], steps: Vec::new(), plans: Vec::new(), most };
    (0..=horizon).try_for_each(|length| walk.extend(length)).map(|()| walk.plans)
}

struct Walk<'a> {
    task: &'a Task,
    semantics: Semantics,
    path: Vec<State>,
    steps: Vec<u32>,
    plans: Vec<Vec<u32>>,
    most: usize,
}

impl Walk<'_> {
    /// Lists the plans that continue the steps taken by exactly `left` more.
    fn extend(&mut self, left: usize) -> Option<()> {
        self.most = self.most.checked_sub(1)?;
        let state = self.path.last().expect("the path starts at the initial state").clone();
        let at_goal = self.task.goal.holds(&state);
        if left == 0 {
            self.plans.extend(at_goal.then(|| self.steps.clone()));
            return Some(());
        }
        if at_goal && self.semantics != Semantics::Any {
            return Some(());
        }
        for (number, operator) in self.task.operators.iter().enumerate() {
            if operator.applicable(&state) {
                let next = self.task.apply(operator, &state);
                if self.semantics != Semantics::Simple || !self.path.contains(&next) {
                    self.path.push(next);
                    self.steps.push(number as u32);
                    self.extend(left - 1)?;
                    self.steps.pop();
                    self.path.pop();
                }
            }
        }
        Some(())
    }
}

/// The state after the operators, if each is applicable in turn.
pub fn replay(task: &Task, operators: &[OperatorId]) -> Option<State> {
    operators.iter().try_fold(task.init.clone(), |state, operator| {
        let operator = &task.operators[operator.index()];
        operator.applicable(&state).then(|| task.apply(operator, &state))
    })
}
