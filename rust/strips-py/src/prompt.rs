//! `render_prompt`: a problem as the text that models are asked with.

use pyo3::prelude::*;
use strips_core::text::{self, Goal, Naming, Style};

use crate::error::DataError;
use crate::task::Task;

/// The prompt of a task: its objects with their types where `style` is `typed`, its goal as literals, its initial state.
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
    if words.as_ref().is_some_and(|words| words.len() != domain.actions.len()) {
        return Err(DataError::new_err(format!("the domain has {} actions, each needs a word", domain.actions.len())));
    }
    let naming = Naming { domain, objects: &problem.objects, names: None, words: words.as_deref() };
    let mut prompt = String::new();
    text::render_prompt(&naming, style, Goal::Problem(&goal), &task.core.atoms(&task.core.init), &mut prompt);
    Ok(prompt)
}
