//! The fast way: operators as masks over packed states, run without evidence.
//!
//! Three forms. `Word`: at most 64 facts, plain STRIPS; a step is two tests and two masks. `Wide`: plain STRIPS over more
//! facts; each operator keeps only the words that it touches. `General`: conditional effects, disjunctions or axioms; the
//! task itself is run.

use crate::task::{FactId, GroundCondition, Operator, State, Task};

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    Valid,
    /// No such operator; the step, from 1.
    Unknown(usize),
    /// The step, from 1.
    Inapplicable(usize),
    /// The plan's length + 1.
    GoalNotReached(usize),
}

/// A task's operators and goal, compiled.
pub(super) enum Program {
    Word { init: u64, goal: Test, operators: Vec<WordOperator> },
    Wide { goal: Vec<(u32, Test)>, starts: Vec<u32>, changes: Vec<(u32, WordOperator)> },
    General,
}

/// Facts of one word that must be true, and that must be false.
#[derive(Clone, Copy, Default)]
pub(super) struct Test {
    positive: u64,
    negative: u64,
}

/// What an operator asks of one word and does to it.
#[derive(Clone, Copy, Default)]
pub(super) struct WordOperator {
    test: Test,
    add: u64,
    delete: u64,
}

impl Test {
    fn holds(self, word: u64) -> bool {
        (word & self.positive) == self.positive && word & self.negative == 0
    }
}

impl WordOperator {
    fn apply(self, word: u64) -> u64 {
        word & !self.delete | self.add
    }
}

impl Program {
    pub(super) fn new(task: &Task) -> Self {
        let plain = task.axioms.derived.is_empty() && task.goal.clauses.is_empty();
        if !plain || !task.operators.iter().all(is_plain) {
            return Self::General;
        }
        let goal = words_of(&task.goal);
        if task.facts.len() <= 64 {
            let one = |operator: &Operator| changes_of(operator).first().map(|&(_, change)| change).unwrap_or_default();
            let goal = goal.first().map(|&(_, test)| test).unwrap_or_default();
            let init = task.init.0.first().copied().unwrap_or(0);
            return Self::Word { init, goal, operators: task.operators.iter().map(one).collect() };
        }
        let (mut starts, mut changes) = (vec![0], Vec::new());
        for operator in task.operators.iter() {
            changes.extend(changes_of(operator));
            starts.push(changes.len() as u32);
        }
        Self::Wide { goal, starts, changes }
    }

    /// Runs the operators from the initial state.
    pub(super) fn run(&self, task: &Task, operators: impl Iterator<Item = u32>) -> End {
        match self {
            Self::Word { init, goal, operators: compiled } => run_word(*init, *goal, compiled, operators),
            Self::Wide { goal, starts, changes } => {
                let mut state = task.init.clone();
                run_wide(&mut state.0, goal, starts, changes, operators)
            }
            Self::General => run_general(task, operators),
        }
    }
}

fn run_word(init: u64, goal: Test, compiled: &[WordOperator], operators: impl Iterator<Item = u32>) -> End {
    let (mut state, mut steps) = (init, 0);
    for id in operators {
        steps += 1;
        let Some(operator) = compiled.get(id as usize) else { return End::Unknown(steps) };
        if !operator.test.holds(state) {
            return End::Inapplicable(steps);
        }
        state = operator.apply(state);
    }
    if goal.holds(state) { End::Valid } else { End::GoalNotReached(steps + 1) }
}

fn run_wide(
    state: &mut [u64],
    goal: &[(u32, Test)],
    starts: &[u32],
    changes: &[(u32, WordOperator)],
    operators: impl Iterator<Item = u32>,
) -> End {
    let mut steps = 0;
    for id in operators {
        steps += 1;
        let id = id as usize;
        if id + 1 >= starts.len() {
            return End::Unknown(steps);
        }
        let touched = &changes[starts[id] as usize..starts[id + 1] as usize];
        if !touched.iter().all(|(word, change)| change.test.holds(state[*word as usize])) {
            return End::Inapplicable(steps);
        }
        for (word, change) in touched {
            state[*word as usize] = change.apply(state[*word as usize]);
        }
    }
    let reached = goal.iter().all(|(word, test)| test.holds(state[*word as usize]));
    if reached { End::Valid } else { End::GoalNotReached(steps + 1) }
}

fn run_general(task: &Task, operators: impl Iterator<Item = u32>) -> End {
    let (mut state, mut steps): (State, usize) = (task.init.clone(), 0);
    for id in operators {
        steps += 1;
        let Some(operator) = task.operators.get(id as usize) else { return End::Unknown(steps) };
        if !operator.applicable(&state) {
            return End::Inapplicable(steps);
        }
        state = task.apply(operator, &state);
    }
    if task.goal.holds(&state) { End::Valid } else { End::GoalNotReached(steps + 1) }
}

/// Whether the operator is plain STRIPS: a conjunction of literals, one effect without a condition.
fn is_plain(operator: &Operator) -> bool {
    let single = operator.effects.len() <= 1 && operator.effects.iter().all(|effect| effect.condition.is_empty());
    single && operator.precondition.clauses.is_empty()
}

fn words_of(condition: &GroundCondition) -> Vec<(u32, Test)> {
    let operator = Operator {
        action: 0usize.into(),
        args: Vec::new(),
        precondition: condition.clone(),
        effects: Vec::new(),
        cost: 0.0,
    };
    changes_of(&operator).into_iter().map(|(word, change)| (word, change.test)).collect()
}

/// The words that the operator touches, ascending.
fn changes_of(operator: &Operator) -> Vec<(u32, WordOperator)> {
    let mut words = std::collections::BTreeMap::<u32, WordOperator>::new();
    let mut enter = |facts: &[FactId], field: fn(&mut WordOperator) -> &mut u64| {
        for fact in facts {
            *field(words.entry(fact.0 / 64).or_default()) |= 1 << (fact.0 % 64);
        }
    };
    enter(&operator.precondition.positive, |word| &mut word.test.positive);
    enter(&operator.precondition.negative, |word| &mut word.test.negative);
    for effect in &operator.effects {
        enter(&effect.del_effects, |word| &mut word.delete);
        enter(&effect.add_effects, |word| &mut word.add);
    }
    words.into_iter().collect()
}
