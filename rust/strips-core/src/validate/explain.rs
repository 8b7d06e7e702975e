//! The slow way to a verdict: step by step, with all its evidence.

use super::blame::last_changes;
use super::lifted::{Lifted, Missing, TaskTruth};
use super::lookup::{Lookup, Resolved, Unresolved};
use super::{Outcome, Verdict};
use crate::pddl::ast::{Condition, GroundAtom, ObjectId};
use crate::plan::{PlanStep, parse_plan};
use crate::task::{OperatorId, State, Task};

/// How many missing literals a sentence names.
const NAMED: usize = 4;

/// The verdict on a plan text.
pub(super) fn explain_text(task: &Task, lookup: &Lookup, text: &str) -> Verdict {
    match parse_plan(text) {
        Ok(steps) => explain_steps(task, lookup, &steps),
        Err(error) => Verdict { line: Some(error.line), ..Verdict::wrong(Outcome::Syntax, error.to_string()) },
    }
}

fn explain_steps(task: &Task, lookup: &Lookup, steps: &[PlanStep]) -> Verdict {
    let mut run = Run::new(task);
    for step in steps {
        let verdict = match lookup.resolve(task, step.name(), step.args()) {
            Ok(resolved) => run.step(&resolved),
            Err(error) => Some(unresolved(&run, &step.to_string(), &error)),
        };
        if let Some(verdict) = verdict {
            return Verdict { line: Some(step.line), ..verdict };
        }
    }
    run.finish()
}

/// The verdict on a sequence of operators.
pub(super) fn explain_operators(task: &Task, operators: &[OperatorId]) -> Verdict {
    let mut run = Run::new(task);
    for &id in operators {
        let Some(operator) = task.operators.get(id.index()) else {
            let reason = format!("the task has no operator number {}", id.0);
            return unresolved(&run, "", &Unresolved { outcome: Outcome::UnknownAction, reason });
        };
        let resolved = Resolved { action: operator.action, args: operator.args.clone(), operator: Some(id) };
        if let Some(verdict) = run.step(&resolved) {
            return verdict;
        }
    }
    run.finish()
}

fn unresolved(run: &Run, step: &str, error: &Unresolved) -> Verdict {
    let number = run.applied.len() + 1;
    let step = if step.is_empty() { String::new() } else { format!(", {step}") };
    let reason = format!("step {number}{step}: {}", error.reason);
    Verdict { step: Some(number), ..Verdict::wrong(error.outcome, reason) }
}

/// A plan under way.
pub(super) struct Run<'t> {
    task: &'t Task,
    /// The state that the steps so far lead to.
    pub(super) state: State,
    applied: Vec<OperatorId>,
}

impl<'t> Run<'t> {
    pub(super) fn new(task: &'t Task) -> Self {
        Self { task, state: task.init.clone(), applied: Vec::new() }
    }

    /// Applies the step; the verdict if it cannot be.
    pub(super) fn step(&mut self, step: &Resolved) -> Option<Verdict> {
        let operator = step.operator.map(|id| (id, &self.task.operators[id.index()]));
        match operator.filter(|(_, operator)| operator.applicable(&self.state)) {
            Some((id, operator)) => {
                self.state = self.task.apply(operator, &self.state);
                self.applied.push(id);
                None
            }
            None => Some(self.inapplicable(step)),
        }
    }

    fn inapplicable(&self, step: &Resolved) -> Verdict {
        let action = &self.task.domain.actions[step.action.index()];
        let evidence = self.evidence(&action.precondition, &step.args);
        let number = self.applied.len() + 1;
        let reason = format!("step {number}, {}, cannot be applied: {}", self.name(step), evidence.sentence);
        let missing = evidence.missing;
        Verdict { step: Some(number), missing, ..Verdict::wrong(Outcome::Inapplicable, reason) }
    }

    /// The verdict when all steps have been applied.
    pub(super) fn finish(&self) -> Verdict {
        if self.task.goal.holds(&self.state) {
            return Verdict::valid(self.applied.len(), plan_cost(self.task, &self.applied));
        }
        let evidence = self.evidence(&self.task.problem.goal, &[]);
        let steps = self.applied.len();
        let plural = if steps == 1 { "" } else { "s" };
        let reason = format!("the goal is not reached after {steps} step{plural}: {}", evidence.sentence);
        let missing = evidence.missing;
        Verdict { step: Some(steps + 1), missing, ..Verdict::wrong(Outcome::GoalNotReached, reason) }
    }

    fn name(&self, step: &Resolved) -> String {
        applied(&self.task.domain.actions[step.action.index()].name, &step.args, self.task)
    }

    fn evidence(&self, condition: &Condition, args: &[ObjectId]) -> Evidence {
        let lifted = Lifted::of(self.task);
        let (mut binding, mut missing) = (args.to_vec(), Vec::new());
        if self.task.domain.axioms.is_empty() {
            let truth = TaskTruth { task: self.task, state: &self.state };
            lifted.missing(condition, true, &mut binding, &truth, &mut missing);
        } else {
            let world = lifted.world(self.task, &self.state);
            lifted.missing(condition, true, &mut binding, &world, &mut missing);
        }
        self.describe(missing)
    }

    fn describe(&self, missing: Vec<Missing>) -> Evidence {
        let mut named: Vec<(String, Missing)> =
            missing.into_iter().map(|one| (literal_text(&one, self.task), one)).collect();
        named.sort_by(|a, b| a.0.cmp(&b.0));
        named.dedup_by(|a, b| a.0 == b.0);
        let atoms: Vec<GroundAtom> = named.iter().take(NAMED).filter_map(|(_, one)| literal(one)).cloned().collect();
        let mut changes = last_changes(self.task, &self.applied, &atoms).into_iter();
        let clauses = named.iter().take(NAMED).map(|(text, one)| match one {
            Missing::Formula(_) => format!("{text} does not hold"),
            Missing::Literal(atom, wanted) => self.clause(atom, *wanted, changes.next().flatten()),
        });
        let more = (named.len() > NAMED).then(|| format!("and {} more", named.len() - NAMED));
        let sentence = clauses.chain(more).collect::<Vec<_>>().join("; ");
        Evidence { missing: named.into_iter().map(|(text, _)| text).collect(), sentence }
    }

    /// "(clear b) does not hold, since step 2, (stack a b), made it false".
    fn clause(&self, atom: &GroundAtom, wanted: bool, change: Option<usize>) -> String {
        let text = atom_text(atom, self.task);
        let verb = if wanted { "does not hold" } else { "holds" };
        match change {
            Some(step) => {
                let name = self.task.operator_name(self.applied[step]);
                format!("{text} {verb}, since step {}, {name}, made it {}", step + 1, !wanted)
            }
            None if wanted && !self.applied.is_empty() => format!("{text} {verb}: no step before made it true"),
            None if !wanted && !self.applied.is_empty() => format!("{text} {verb}: no step before made it false"),
            None => format!("{text} {verb} at the start"),
        }
    }
}

struct Evidence {
    missing: Vec<String>,
    sentence: String,
}

fn literal(missing: &Missing) -> Option<&GroundAtom> {
    match missing {
        Missing::Literal(atom, _) => Some(atom),
        Missing::Formula(_) => None,
    }
}

fn literal_text(missing: &Missing, task: &Task) -> String {
    match missing {
        Missing::Literal(atom, true) => atom_text(atom, task),
        Missing::Literal(atom, false) => format!("(not {})", atom_text(atom, task)),
        Missing::Formula(text) => text.clone(),
    }
}

/// What the plan raises `total-cost` by where the problem minimizes that, else its length.
pub(super) fn plan_cost(task: &Task, operators: &[OperatorId]) -> f64 {
    if task.problem.minimizes_cost {
        operators.iter().map(|id| task.operators[id.index()].cost).sum()
    } else {
        operators.len() as f64
    }
}

/// The atom as PDDL.
pub(super) fn atom_text(atom: &GroundAtom, task: &Task) -> String {
    applied(&task.domain.predicates[atom.predicate.index()].name, &atom.args, task)
}

fn applied(name: &str, args: &[ObjectId], task: &Task) -> String {
    let args = args.iter().map(|id| task.problem.objects[id.index()].name.as_str());
    format!("({})", std::iter::once(name).chain(args).collect::<Vec<_>>().join(" "))
}
