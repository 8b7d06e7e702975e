//! Many packed states at once: what applies in each, where it leads, and how far the goal is.
//!
//! A batch of `n` states is one flat array of `n × width` words, in which bit `i` of a state is fact `i` of the task.
//! What comes from outside is checked and its derived facts are computed anew, so that every answer is exact for any
//! state of the task's facts, reachable or not. For callers that walk step by step, such as decoders; whoever wants all
//! plans is better served by a [`PlanSet`](super::PlanSet), and a whole state space by a [`StateSpace`].

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::condition::{position, satisfied};
use super::goal_bound::GoalBound;
use super::state_space::{StateId, StateSpace, padded};
use super::successor_generator::SuccessorGenerator;
use crate::task::{FactId, GroundCondition, LimitError, Limits, State, Task};

/// States that a thread takes at a time.
const CHUNK: usize = 1 << 10;

/// The transition system of a task: its states, and what its operators do to them.
#[derive(Debug)]
pub struct TransitionSystem {
    task: Arc<Task>,
    generator: SuccessorGenerator,
    bound: GoalBound,
    /// Every atom that holds in some state by its name; without a number, it holds in all of them.
    atoms: OnceLock<HashMap<String, Option<FactId>>>,
}

/// The operators of several states: those of state `i` are `operators[offsets[i]..offsets[i + 1]]`, ascending.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Applicable {
    /// Operator ids, state after state.
    pub operators: Vec<u32>,
    /// Where each state's operators begin, and where the last one's end.
    pub offsets: Vec<u64>,
}

/// Why a batch cannot be answered. Rows count from 0.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BatchError {
    /// The words are not those of whole states.
    #[error("{words} words are no states of {width} words each")]
    Shape {
        /// Words given.
        words: usize,
        /// Words a state.
        width: usize,
    },
    /// As many operators as states are needed.
    #[error("{operators} operators for {states} states")]
    Lengths {
        /// States given.
        states: usize,
        /// Operators given.
        operators: usize,
    },
    /// A bit is set that stands for no fact.
    #[error("state {row} has a bit beyond the task's {facts} facts")]
    Bits {
        /// The state.
        row: usize,
        /// Facts of the task.
        facts: usize,
    },
    /// An atom that no state of the task has.
    #[error("{atom} is true in no state that the task can reach")]
    Atom {
        /// The atom as it was given.
        atom: String,
    },
    /// There is no such operator, or it may not be applied.
    #[error("operator {operator} is not applicable in state {row}")]
    Inapplicable {
        /// The state.
        row: usize,
        /// The operator.
        operator: u32,
    },
    /// A budget was spent.
    #[error(transparent)]
    Limit(#[from] LimitError),
}

impl TransitionSystem {
    /// Compiles a task; linear in its operators.
    pub fn new(task: Arc<Task>) -> Self {
        let (generator, bound) = (SuccessorGenerator::new(&task), GoalBound::new(&task));
        Self { task, generator, bound, atoms: OnceLock::new() }
    }

    /// Words of a packed state.
    pub fn width(&self) -> usize {
        self.generator.width()
    }

    /// The initial state's words.
    pub fn init(&self) -> Vec<u64> {
        padded(&self.task.init, self.width())
    }

    /// The state in which these atoms are true and no other ones; atoms that can never become false may be left out.
    ///
    /// # Errors
    /// [`BatchError::Atom`].
    pub fn state_of<A: AsRef<str>>(&self, atoms: &[A]) -> Result<Vec<u64>, BatchError> {
        let names = self.atoms.get_or_init(|| atom_names(&self.task));
        let mut words = vec![0; self.width()];
        for atom in atoms {
            let known = names.get(&normal_name(atom.as_ref()));
            let fact = known.ok_or_else(|| BatchError::Atom { atom: atom.as_ref().to_owned() })?;
            if let Some((word, bit)) = fact.map(position) {
                words[word as usize] |= bit;
            }
        }
        self.derive(&mut words);
        Ok(words)
    }

    /// The atoms of each state by name, those that never change and derived ones included; ascending.
    ///
    /// # Errors
    /// When the words are no states, or a budget of `limits` is spent.
    pub fn atoms(&self, words: &[u64], limits: &Limits) -> Result<Vec<Vec<String>>, BatchError> {
        let (words, watch) = (self.read(words)?, limits.start());
        let names = |state: &[u64]| {
            let is_true = |&fact: &FactId| state[position(fact).0 as usize] & position(fact).1 != 0;
            let changing = (0..self.task.facts.len()).map(FactId::from).filter(is_true);
            let mut facts: Vec<_> = changing.map(|fact| &self.task.facts[fact.index()]).collect();
            facts.extend(&self.task.static_facts);
            facts.sort_unstable();
            watch.check()?;
            Ok(facts.into_iter().map(|fact| self.task.atom_name(fact)).collect())
        };
        words.par_chunks_exact(self.width()).map(names).collect()
    }

    /// Whether each state satisfies the goal.
    ///
    /// # Errors
    /// When the words are no states.
    pub fn are_goals(&self, words: &[u64]) -> Result<Vec<bool>, BatchError> {
        let words = self.read(words)?;
        Ok(words.chunks_exact(self.width()).map(|state| self.bound.is_goal(state)).collect())
    }

    /// The operators that may be applied in each state; in parallel.
    ///
    /// # Errors
    /// When the words are no states, or a budget of `limits` is spent.
    pub fn applicable(&self, words: &[u64], limits: &Limits) -> Result<Applicable, BatchError> {
        let (words, watch) = (self.read(words)?, limits.start());
        let batch = |states: &[u64]| {
            watch.check()?;
            let (mut operators, mut counts, mut found) = (Vec::new(), Vec::with_capacity(CHUNK), Vec::new());
            for state in states.chunks_exact(self.width()) {
                self.generator.applicable_in(state, &mut found);
                operators.extend_from_slice(&found);
                counts.push(found.len() as u64);
            }
            watch.bytes(operators.len() * 4 * words.len().div_ceil(states.len()))?;
            Ok((operators, counts))
        };
        let parts = words.par_chunks(CHUNK * self.width()).map(batch).collect::<Result<Vec<_>, LimitError>>()?;
        let mut all = Applicable { operators: Vec::new(), offsets: vec![0] };
        for (operators, counts) in parts {
            all.operators.extend(operators);
            let mut end = all.offsets[all.offsets.len() - 1];
            all.offsets.extend(counts.into_iter().map(|count| {
                end += count;
                end
            }));
        }
        Ok(all)
    }

    /// The state after each operator in the state of the same row; in parallel.
    ///
    /// # Errors
    /// When the words are no states, the lengths differ, an operator is not applicable (the first such row is named),
    /// or a budget of `limits` is spent.
    pub fn successors(&self, words: &[u64], operators: &[u32], limits: &Limits) -> Result<Vec<u64>, BatchError> {
        let (words, watch, width) = (self.read(words)?, limits.start(), self.width());
        let states = words.len() / width;
        if states != operators.len() {
            return Err(BatchError::Lengths { states, operators: operators.len() });
        }
        let allowed = |row: usize| {
            let operator = self.task.operators.get(operators[row] as usize);
            operator.is_some_and(|operator| holds(&operator.precondition, &words[row * width..][..width]))
        };
        if let Some(row) = (0..states).into_par_iter().find_first(|&row| !allowed(row)) {
            return Err(BatchError::Inapplicable { row, operator: operators[row] });
        }
        let mut next = words.clone();
        let rows = next.par_chunks_exact_mut(width).zip(words.par_chunks_exact(width)).zip(operators);
        rows.for_each(|((next, state), &operator)| self.generator.apply(operator, state, next));
        watch.check()?;
        Ok(next)
    }

    /// The fewest steps from each state to the goal; `None` where more than `most` are needed or there is no way.
    ///
    /// Searches once from all the states together: costs as much as the states within `most` steps of any of them.
    ///
    /// # Errors
    /// When the words are no states, or a budget of `limits` is spent.
    pub fn distances_to_goal(
        &self,
        words: &[u64],
        most: Option<usize>,
        limits: &Limits,
    ) -> Result<Vec<Option<usize>>, BatchError> {
        let (words, watch) = (self.read(words)?, limits.start());
        let space = StateSpace::around(&self.task, (&self.generator, &self.bound), &words, most, &watch)?;
        let distance = |state: &[u64]| {
            let number: Option<StateId> = space.find_words(state);
            number.and_then(|number| space.distance_to_goal(number))
        };
        Ok(words.par_chunks_exact(self.width()).map(distance).collect())
    }

    /// Checks that the words are states, and computes their derived facts.
    fn read(&self, words: &[u64]) -> Result<Vec<u64>, BatchError> {
        let (width, facts) = (self.width(), self.task.facts.len());
        if !words.len().is_multiple_of(width) {
            return Err(BatchError::Shape { words: words.len(), width });
        }
        let unused = u64::MAX.checked_shl((facts - (width - 1).min(facts) * 64) as u32).unwrap_or(0);
        if let Some(row) = words.chunks_exact(width).position(|state| state[width - 1] & unused != 0) {
            return Err(BatchError::Bits { row, facts });
        }
        let mut words = words.to_vec();
        if !self.task.axioms.derived.is_empty() {
            words.par_chunks_exact_mut(width).for_each(|state| self.derive(state));
        }
        Ok(words)
    }

    fn derive(&self, words: &mut [u64]) {
        let mut state = State(words.into());
        self.task.derive(&mut state);
        words.copy_from_slice(&state.0);
    }
}

/// Whether the condition is true in the packed state.
fn holds(condition: &GroundCondition, words: &[u64]) -> bool {
    let is_true = |fact: FactId| words[position(fact).0 as usize] & position(fact).1 != 0;
    condition.positive.iter().all(|&fact| is_true(fact))
        && !condition.negative.iter().any(|&fact| is_true(fact))
        && condition.clauses.iter().all(|clause| satisfied(clause, words))
}

fn atom_names(task: &Task) -> HashMap<String, Option<FactId>> {
    let constant = task.static_facts.iter().map(|fact| (task.atom_name(fact), None));
    let changing = (0..task.facts.len()).map(FactId::from).map(|fact| (task.fact_name(fact), Some(fact)));
    constant.chain(changing).collect()
}

/// An atom as [`Task::fact_name`] writes it: lower case, single spaces.
fn normal_name(atom: &str) -> String {
    let inner = atom.trim().trim_start_matches('(').trim_end_matches(')');
    let words: Vec<&str> = inner.split_whitespace().collect();
    format!("({})", words.join(" ")).to_lowercase()
}
