//! Looking things up in a task by name or arguments, and writing its parts as PDDL.

use super::{Fact, FactId, Operator, OperatorId, State, Task};
use crate::pddl::ast::{ActionId, ObjectId};

impl Task {
    /// The operator of an action with these arguments, if the task has it; by binary search.
    pub fn operator(&self, action: ActionId, args: &[ObjectId]) -> Option<OperatorId> {
        let order = |operator: &Operator| (operator.action, operator.args.as_slice()).cmp(&(action, args));
        self.operators.binary_search_by(order).ok().map(OperatorId::from)
    }

    /// The id of a fact, if it can change; by binary search.
    pub fn fact(&self, fact: &Fact) -> Option<FactId> {
        self.facts.binary_search(fact).ok().map(FactId::from)
    }

    /// The operator as a plan writes it: `(pick cup)`.
    pub fn operator_name(&self, operator: OperatorId) -> String {
        let operator = &self.operators[operator.index()];
        self.application(&self.domain.actions[operator.action.index()].name, &operator.args)
    }

    /// The fact as PDDL writes it: `(on cup table)`.
    pub fn fact_name(&self, fact: FactId) -> String {
        self.atom_name(&self.facts[fact.index()])
    }

    /// Any atom as PDDL writes it.
    pub fn atom_name(&self, fact: &Fact) -> String {
        self.application(&self.domain.predicates[fact.predicate.index()].name, &fact.args)
    }

    /// A name applied to objects, in PDDL.
    fn application(&self, name: &str, args: &[ObjectId]) -> String {
        let mut text = format!("({name}");
        for &arg in args {
            text.push(' ');
            text.push_str(&self.problem.objects[arg.index()].name);
        }
        text.push(')');
        text
    }

    /// Every atom that is true in the state, static ones included and derived ones not, ascending by (predicate,
    /// arguments).
    pub fn atoms(&self, state: &State) -> Vec<Fact> {
        self.atoms_of(state).cloned().collect()
    }

    /// What [`Task::atoms`] gives, without copying the facts.
    pub fn atoms_by_reference(&self, state: &State) -> Vec<&Fact> {
        let mut atoms = Vec::with_capacity(self.static_facts.len() + state.count());
        atoms.extend(self.atoms_of(state));
        atoms
    }

    /// The same, one after the other. Linear in the words of the state and in its atoms.
    pub fn atoms_of<'t>(&'t self, state: &State) -> impl Iterator<Item = &'t Fact> {
        let derived = |fact: &Fact| self.domain.predicates[fact.predicate.index()].derived;
        let mut changing =
            state.facts().map(|id| &self.facts[id.index()]).filter(move |fact| !derived(fact)).peekable();
        let mut constant = self.static_facts.iter().peekable();
        std::iter::from_fn(move || match changing.peek() {
            Some(fact) => constant.next_if(|known| known < fact).or_else(|| changing.next()),
            None => constant.next(),
        })
    }
}
