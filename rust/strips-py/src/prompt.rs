//! `render_prompt`: a problem as the text that models are asked with.

use pyo3::prelude::*;
use strips_core::text::{self, Goal, Naming, Style};

use crate::error::DataError;
use crate::task::Task;

/// The prompt of a task: its objects with their types where `style` is `typed`, its goal as literals, its initial state.
///
/// `words` has one for each action, then perhaps one for each predicate.
///
/// Raises `DataError` where the goal is no conjunction of literals or `style` is none.
#[pyfunction]
#[pyo3(signature = (task, style = "typed", words = None))]
pub fn render_prompt(task: &Task, style: &str, words: Option<Vec<String>>) -> PyResult<String> {
    let style = Style::from_name(style).ok_or_else(|| DataError::new_err(format!("no style `{style}`")))?;
    let (domain, problem) = (&task.core.domain, &task.core.problem);
    let Some(goal) = text::goal_literals(domain, problem) else {
        return Err(DataError::new_err("the goal is no conjunction of literals, which is all that a prompt can say"));
    };
    let (actions, predicates) = (domain.actions.len(), domain.predicates.len());
    let words = words.unwrap_or_default();
    if ![0, actions, actions + predicates].contains(&words.len()) {
        let needed = format!("{actions} actions and {predicates} predicates");
        return Err(DataError::new_err(format!("{} words, but the domain has {needed}", words.len())));
    }
    let naming = Naming { names: None, ..Naming::new(domain, &problem.objects, &[], &words) };
    let mut prompt = String::new();
    text::render_prompt(&naming, style, Goal::Problem(&goal), &task.core.atoms(&task.core.init), &mut prompt);
    Ok(prompt)
}
