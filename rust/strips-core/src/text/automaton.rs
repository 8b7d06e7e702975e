//! Constrained decoding: which canonical words may come next if every step is to be executable.
//!
//! After the prompt come `<ACTION>`, the words of an operator that is applicable and leads to a state not yet visited,
//! `<STATE>` and the words of the true next state, and so on; `<|endoftext|>` may come where the goal holds. A [`Walk`]
//! follows one text. It is told the words that were chosen and answers with those that are forced after them (the whole
//! state, and whatever has no alternative), so that a generator feeds these in one go and asks its model only where
//! there is a choice.
//!
//! Knows words and the oracle, no model and no logits. Operators about an object that the prompt does not name cannot
//! be said, and are left out. Price of a step: the applicable operators and their successors, once.

mod batch;

use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHashSet};

pub use batch::{MaskError, MaskedDecoder};

use super::canonical::{Codec, Layout, Legend, Marker, Packed, Sign, Wanted, Word, mention, sign_of_change};
use crate::search::SuccessorGenerator;
use crate::task::{Fact, OperatorId, State, Task};

/// How many words [`Walk::advance`] forces at once at most; where a task leaves no choice, a text may have no end.
const MOST_FORCED: usize = 1024;

/// A task, said in the words of one prompt.
#[derive(Debug)]
pub struct SpokenTask {
    task: Arc<Task>,
    generator: Arc<SuccessorGenerator>,
    codec: Arc<Codec>,
    domain: usize,
    /// By operator: its action's word and its arguments' slots, each perhaps after its type; empty where it cannot be said.
    operators: Vec<Vec<Word>>,
    /// By object.
    slots: Vec<Option<u16>>,
    /// By slot, as in the legend.
    kinds: Vec<Word>,
    /// As in the legend.
    wanted: Option<Wanted>,
    /// By fact; `None` for derived facts and what cannot be said.
    facts: Vec<Option<Packed>>,
    stop_at_goal: bool,
}

/// A word that may not come where it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("word {0} may not come here")]
pub struct NotAllowed(pub Word);

/// Where a [`Walk`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// Before `<ACTION>` or the end.
    BetweenSteps,
    /// After this many words of an operator.
    InOperator(usize),
    /// After the end.
    Ended,
}

/// One text in the making.
#[derive(Clone, Debug)]
pub struct Walk {
    spoken: Arc<SpokenTask>,
    state: State,
    /// Every state that the walk has come to, those that it backtracked from included.
    visited: FxHashSet<State>,
    plan: Vec<OperatorId>,
    /// The states before `state`, one for each operator of the plan.
    before: Vec<State>,
    place: Place,
    /// The operators that the words so far may become, with their successors.
    candidates: Vec<(OperatorId, State)>,
}

impl SpokenTask {
    /// The task in the words that `legend`, from encoding its prompt, gives. `names` are the prompt's names of the task's
    /// objects where they are not the problem's own. With `stop_at_goal` the end is the only word where the goal holds.
    pub fn new(
        task: Arc<Task>,
        generator: Arc<SuccessorGenerator>,
        codec: Arc<Codec>,
        legend: &Legend,
        names: Option<&[String]>,
        stop_at_goal: bool,
    ) -> Self {
        let own = |object: usize| &task.problem.objects[object].name;
        let name = |object: usize| names.map_or_else(|| own(object), |names| &names[object]);
        let slot = |object: usize| legend.names.iter().position(|known| known == name(object));
        let objects = 0..task.problem.objects.len();
        let slots = objects.map(|object| slot(object).and_then(|slot| u16::try_from(slot).ok())).collect();
        let (domain, kinds, wanted) = (legend.domain, legend.kinds.clone(), legend.wanted.clone());
        let mut spoken = Self {
            operators: Vec::new(),
            slots,
            kinds,
            wanted,
            facts: Vec::new(),
            task,
            generator,
            codec,
            domain,
            stop_at_goal,
        };
        spoken.operators = (0..spoken.task.operators.len()).map(|number| spoken.say_operator(number)).collect();
        spoken.facts = spoken.task.facts.iter().map(|fact| spoken.pack(fact)).collect();
        spoken
    }

    /// The task.
    pub fn task(&self) -> &Arc<Task> {
        &self.task
    }

    fn say_operator(&self, number: usize) -> Vec<Word> {
        let operator = &self.task.operators[number];
        let mut words = vec![self.codec.tables(self.domain).1.action_words[operator.action.index()]];
        for arg in &*operator.args {
            let Some(slot) = self.slots[arg.index()] else { return Vec::new() };
            self.mention(slot, &mut words);
        }
        words
    }

    /// Appends an object's slot, after its type where that is said.
    fn mention(&self, slot: u16, words: &mut Vec<Word>) {
        mention(self.codec.vocabulary(), &self.kinds, slot, words);
    }

    fn pack(&self, fact: &Fact) -> Option<Packed> {
        if self.task.domain.predicates[fact.predicate.index()].derived || fact.args.len() > Packed::MAX_ARITY {
            return None;
        }
        let mut packed = Packed::new(fact.predicate.0 as u16);
        for (position, arg) in fact.args.iter().enumerate() {
            packed = packed.with_arg(position, self.slots[arg.index()]?);
        }
        Some(packed)
    }

    /// The words of a plan from the initial state, each step and the end.
    fn say_plan(&self, plan: &[OperatorId]) -> Vec<Word> {
        let (mut state, mut words) = (self.task.init.clone(), Vec::new());
        for &operator in plan {
            let next = self.generator.successor(&state, operator);
            words.push(Marker::Action as Word);
            words.extend(&self.operators[operator.index()]);
            self.say_state(&state, &next, &mut words);
            state = next;
        }
        words.push(Marker::End as Word);
        words
    }

    /// Appends the words for `next` after `before`.
    fn say_state(&self, before: &State, next: &State, words: &mut Vec<Word>) {
        words.push(Marker::State as Word);
        if self.codec.layout() == Layout::Report {
            let atoms = self.task.atoms(next);
            return atoms.iter().filter_map(|atom| self.pack(atom)).for_each(|atom| self.say(Sign::Plain, atom, words));
        }
        self.say_difference(true, next, before, words);
        self.say_difference(false, before, next, words);
    }

    /// Appends the facts that `some` has and `other` lacks: they become true, or false.
    fn say_difference(&self, added: bool, some: &State, other: &State, words: &mut Vec<Word>) {
        let mut atoms = Vec::new();
        for (number, (&a, &b)) in some.0.iter().zip(&other.0).enumerate() {
            let mut bits = a & !b;
            while bits != 0 {
                atoms.extend(self.facts[number * 64 + bits.trailing_zeros() as usize]);
                bits &= bits - 1;
            }
        }
        atoms.sort_unstable();
        for atom in atoms {
            self.say(sign_of_change(self.wanted.as_ref(), atom, added), atom, words);
        }
    }

    fn say(&self, sign: Sign, atom: Packed, words: &mut Vec<Word>) {
        let (signature, tables) = self.codec.tables(self.domain);
        words.push(tables.predicate_word(sign, atom.predicate()));
        let arity = signature.predicates[usize::from(atom.predicate())].arity;
        for position in 0..arity {
            self.mention(atom.arg(position), words);
        }
    }
}

impl Walk {
    /// The walk that begins after the prompt, and the words that are forced there.
    pub fn start(spoken: Arc<SpokenTask>) -> (Self, Vec<Word>) {
        let state = spoken.task.init.clone();
        let mut walk = Self {
            spoken,
            state: state.clone(),
            visited: FxHashSet::default(),
            plan: Vec::new(),
            before: Vec::new(),
            place: Place::BetweenSteps,
            candidates: Vec::new(),
        };
        walk.enter(state);
        let mut forced = Vec::new();
        walk.force(&mut forced);
        (walk, forced)
    }

    /// The task that is walked through.
    pub fn task(&self) -> &Task {
        &self.spoken.task
    }

    /// The operators so far.
    pub fn plan(&self) -> &[OperatorId] {
        &self.plan
    }

    /// Whether the end has come: the plan is valid.
    pub fn has_ended(&self) -> bool {
        self.place == Place::Ended
    }

    /// Whether nothing may come: the goal does not hold, and no operator leads to a state not yet visited.
    pub fn is_stuck(&self) -> bool {
        !self.has_ended() && self.options().is_empty()
    }

    /// The words that may come next, ascending.
    pub fn options(&self) -> Vec<Word> {
        let mut options = match self.place {
            Place::Ended => Vec::new(),
            Place::BetweenSteps => {
                let end = self.goal_holds().then_some(Marker::End as Word);
                let action = (!self.candidates.is_empty()).then_some(Marker::Action as Word);
                end.into_iter().chain(action).collect()
            }
            Place::InOperator(said) => {
                self.candidates.iter().map(|candidate| self.spoken.operators[candidate.0.index()][said]).collect()
            }
        };
        options.sort_unstable();
        options.dedup();
        options
    }

    /// Takes a word, and gives back those that are forced after it, which are taken as well.
    ///
    /// # Errors
    /// [`NotAllowed`] where the word is not among the [`Walk::options`]; the walk stays where it is.
    pub fn advance(&mut self, word: Word) -> Result<Vec<Word>, NotAllowed> {
        let mut forced = Vec::new();
        self.take(word, &mut forced)?;
        self.force(&mut forced);
        Ok(forced)
    }

    /// Takes steps back, at least one, to the last state from which an operator leads to one that was never visited; the
    /// steps that are left, and the words that are forced after them. What was visited stays visited, so that a walk
    /// which goes on until it is stuck and then backtracks, again and again, is a depth-first search: it comes to every state
    /// that can be reached. `None`, and the walk where it was, if there is no such state.
    pub fn backtrack(&mut self) -> Option<(usize, Vec<Word>)> {
        if self.has_ended() {
            return None;
        }
        let (steps, candidates) = self.before.iter().enumerate().rev().find_map(|(steps, state)| {
            let candidates = self.fresh_successors(state);
            (!candidates.is_empty()).then_some((steps, candidates))
        })?;
        self.state = self.before.swap_remove(steps);
        self.before.truncate(steps);
        self.plan.truncate(steps);
        (self.place, self.candidates) = (Place::BetweenSteps, candidates);
        let mut forced = Vec::new();
        self.force(&mut forced);
        Some((steps, forced))
    }

    /// The words of a shorter plan, where there is one that goes through no other states than the walk came to, those that it
    /// backtracked from included: of these the shortest. Only of a walk that has ended.
    pub fn shortened(&self) -> Option<Vec<Word>> {
        let plan = self.has_ended().then(|| self.shortest_among_visited())?;
        (plan.len() < self.plan.len()).then(|| self.spoken.say_plan(&plan))
    }

    /// A shortest plan, breadth first, through states that were visited.
    fn shortest_among_visited(&self) -> Vec<OperatorId> {
        let task = &self.spoken.task;
        let mut origins: FxHashMap<State, Option<(usize, OperatorId)>> =
            FxHashMap::from_iter([(task.init.clone(), None)]);
        let mut reached = vec![task.init.clone()];
        let mut number = 0;
        while number < reached.len() && !task.goal.holds(&reached[number]) {
            let state = reached[number].clone();
            for (operator, next) in self.sayable_successors(&state) {
                if self.visited.contains(&next) && !origins.contains_key(&next) {
                    origins.insert(next.clone(), Some((number, operator)));
                    reached.push(next);
                }
            }
            number += 1;
        }
        let origin = |state: usize| origins[&reached[state]];
        let back = std::iter::successors(origin(number), |&(before, _)| origin(before));
        let mut plan: Vec<OperatorId> = back.map(|(_, operator)| operator).collect();
        plan.reverse();
        plan
    }

    /// Takes words as long as there is no choice.
    fn force(&mut self, forced: &mut Vec<Word>) {
        while forced.len() < MOST_FORCED {
            let [only] = self.options()[..] else { return };
            forced.push(only);
            self.take(only, forced).expect("an option may be taken");
        }
    }

    /// Takes one word; where it completes an operator, the words of the next state are appended.
    fn take(&mut self, word: Word, forced: &mut Vec<Word>) -> Result<(), NotAllowed> {
        if self.options().binary_search(&word).is_err() {
            return Err(NotAllowed(word));
        }
        match self.place {
            Place::InOperator(said) => self.take_in_operator(word, said, forced),
            _ if word == Marker::End as Word => self.place = Place::Ended,
            _ => self.place = Place::InOperator(0),
        }
        Ok(())
    }

    fn take_in_operator(&mut self, word: Word, said: usize, forced: &mut Vec<Word>) {
        let operators = &self.spoken.operators;
        self.candidates.retain(|candidate| operators[candidate.0.index()][said] == word);
        self.place = Place::InOperator(said + 1);
        if operators[self.candidates[0].0.index()].len() == said + 1 {
            let (operator, next) = self.candidates.swap_remove(0);
            self.spoken.say_state(&self.state, &next, forced);
            self.plan.push(operator);
            self.before.push(self.state.clone());
            self.enter(next);
        }
    }

    /// Comes to a state: finds the operators that may follow.
    fn enter(&mut self, state: State) {
        self.visited.insert(state.clone());
        self.state = state;
        self.place = Place::BetweenSteps;
        self.candidates.clear();
        if !(self.spoken.stop_at_goal && self.goal_holds()) {
            self.candidates = self.fresh_successors(&self.state);
        }
    }

    fn fresh_successors(&self, state: &State) -> Vec<(OperatorId, State)> {
        self.sayable_successors(state).filter(|successor| !self.visited.contains(&successor.1)).collect()
    }

    /// The operators that may follow a state, those that cannot be said left out, and where they lead.
    fn sayable_successors(&self, state: &State) -> impl Iterator<Item = (OperatorId, State)> {
        let (spoken, generator) = (&self.spoken, &self.spoken.generator);
        let sayable = generator.applicable(state).into_iter();
        let sayable = sayable.filter(|operator| !spoken.operators[operator.index()].is_empty());
        sayable.map(|operator| (operator, generator.successor(state, operator)))
    }

    fn goal_holds(&self) -> bool {
        self.spoken.task.goal.holds(&self.state)
    }
}

#[cfg(test)]
mod tests;
