//! Plans as text in bulk: every operator's line is written once, and plans copy them.

use crate::plan::EMPTY_PLAN;
use crate::task::{OperatorId, Task};

/// The line of each operator, end of line included.
#[derive(Clone, Debug)]
pub(super) struct OperatorLines {
    text: String,
    ends: Vec<usize>,
}

impl OperatorLines {
    /// Writes the lines of a task's operators.
    pub fn new(task: &Task) -> Self {
        let (mut text, mut ends) = (String::new(), Vec::with_capacity(task.operators.len()));
        for operator in 0..task.operators.len() {
            text.push_str(&task.operator_name(OperatorId::from(operator)));
            text.push('\n');
            ends.push(text.len());
        }
        Self { text, ends }
    }

    fn line(&self, operator: u32) -> &str {
        let first = if operator == 0 { 0 } else { self.ends[operator as usize - 1] };
        &self.text[first..self.ends[operator as usize]]
    }

    /// Plans of one length, given row after row, as blocks with a blank line between.
    pub fn blocks(&self, rows: &[u32], length: usize) -> String {
        if length == 0 {
            return EMPTY_PLAN.to_owned();
        }
        let mut text = String::with_capacity(rows.len() * self.text.len() / self.ends.len().max(1) * 5 / 4);
        for (plan, row) in rows.chunks_exact(length).enumerate() {
            if plan > 0 {
                text.push('\n');
            }
            for &operator in row {
                text.push_str(self.line(operator));
            }
        }
        text
    }
}
