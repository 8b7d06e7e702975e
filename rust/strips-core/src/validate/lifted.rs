//! PDDL evaluated as it is written, without grounding: the source of evidence.
//!
//! Knows which atoms are true through [`Truth`]; quantifiers run over the problem's objects. The price is that of the
//! definition: every binding is tried.

use rustc_hash::FxHashSet;

use crate::pddl::ast::{Axiom, Condition, Domain, GroundAtom, ObjectId, Parameter, PredicateId, Problem, Term};
use crate::pddl::{print_condition, strata};
use crate::task::{FactId, State, Task};

/// Which atoms are true.
pub(super) trait Truth {
    /// Whether the atom is true.
    fn holds(&self, predicate: PredicateId, args: &[ObjectId]) -> bool;
}

/// Truth in a state of a task without derived predicates.
pub(super) struct TaskTruth<'t> {
    pub(super) task: &'t Task,
    pub(super) state: &'t State,
}

impl Truth for TaskTruth<'_> {
    fn holds(&self, predicate: PredicateId, args: &[ObjectId]) -> bool {
        let order = |fact: &GroundAtom| (fact.predicate, fact.args.as_slice()).cmp(&(predicate, args));
        match self.task.facts.binary_search_by(order) {
            Ok(index) => self.state.holds(FactId::from(index)),
            Err(_) => self.task.static_facts.binary_search_by(order).is_ok(),
        }
    }
}

/// A set of true atoms.
pub(super) type World = FxHashSet<GroundAtom>;

impl Truth for World {
    fn holds(&self, predicate: PredicateId, args: &[ObjectId]) -> bool {
        self.contains(&GroundAtom { predicate, args: args.to_vec() })
    }
}

/// A literal or formula that ought to be true.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Missing {
    /// The atom ought to be true, or false where the flag is not set.
    Literal(GroundAtom, bool),
    /// A disjunction or equality, as PDDL.
    Formula(String),
}

/// A domain and problem to evaluate.
#[derive(Clone, Copy)]
pub(super) struct Lifted<'d> {
    pub(super) domain: &'d Domain,
    pub(super) problem: &'d Problem,
}

impl<'d> Lifted<'d> {
    pub(super) fn of(task: &'d Task) -> Self {
        Self { domain: &task.domain, problem: &task.problem }
    }

    /// Whether the condition is true under the binding of its free variables.
    pub(super) fn holds(&self, condition: &Condition, binding: &mut Vec<ObjectId>, truth: &impl Truth) -> bool {
        match condition {
            Condition::And(parts) => parts.iter().all(|part| self.holds(part, binding, truth)),
            Condition::Or(parts) => parts.iter().any(|part| self.holds(part, binding, truth)),
            Condition::Not(part) => !self.holds(part, binding, truth),
            Condition::Imply(premise, conclusion) => {
                !self.holds(premise, binding, truth) || self.holds(conclusion, binding, truth)
            }
            Condition::Forall(parameters, body) => {
                !self.some_binding(parameters, binding, &mut |binding| !self.holds(body, binding, truth))
            }
            Condition::Exists(parameters, body) => {
                self.some_binding(parameters, binding, &mut |binding| self.holds(body, binding, truth))
            }
            Condition::Atom(atom) => truth.holds(atom.predicate, &ground(&atom.terms, binding)),
            Condition::Equals(left, right) => value(*left, binding) == value(*right, binding),
        }
    }

    /// What keeps the condition from being `wanted`: literals where it is a conjunction, formulas where it is not.
    pub(super) fn missing(
        &self,
        condition: &Condition,
        wanted: bool,
        binding: &mut Vec<ObjectId>,
        truth: &impl Truth,
        out: &mut Vec<Missing>,
    ) {
        match (condition, wanted) {
            (Condition::And(parts), true) | (Condition::Or(parts), false) => {
                for part in parts {
                    self.missing(part, wanted, binding, truth, out);
                }
            }
            (Condition::Not(part), _) => self.missing(part, !wanted, binding, truth, out),
            (Condition::Imply(premise, conclusion), false) => {
                self.missing(premise, true, binding, truth, out);
                self.missing(conclusion, false, binding, truth, out);
            }
            (Condition::Forall(parameters, body), true) | (Condition::Exists(parameters, body), false) => {
                self.some_binding(parameters, binding, &mut |binding| {
                    self.missing(body, wanted, binding, truth, out);
                    false
                });
            }
            (Condition::Atom(atom), _) => {
                let args = ground(&atom.terms, binding);
                if truth.holds(atom.predicate, &args) != wanted {
                    out.push(Missing::Literal(GroundAtom { predicate: atom.predicate, args }, wanted));
                }
            }
            _ if self.holds(condition, binding, truth) == wanted => {}
            _ => out.push(Missing::Formula(self.formula(condition, wanted, binding))),
        }
    }

    fn formula(&self, condition: &Condition, wanted: bool, binding: &[ObjectId]) -> String {
        let text = print_condition(condition, binding, self.problem, self.domain);
        if wanted { text } else { format!("(not {text})") }
    }

    /// Tries every binding of the parameters after those of `binding`; whether `found` said yes to one, which ends it.
    fn some_binding(
        &self,
        parameters: &[Parameter],
        binding: &mut Vec<ObjectId>,
        found: &mut dyn FnMut(&mut Vec<ObjectId>) -> bool,
    ) -> bool {
        let Some((first, rest)) = parameters.split_first() else { return found(binding) };
        (0..self.problem.objects.len()).any(|object| {
            if !self.domain.accepts(&first.types, &self.problem.objects[object]) {
                return false;
            }
            binding.push(ObjectId::from(object));
            let yes = self.some_binding(rest, binding, found);
            binding.pop();
            yes
        })
    }

    /// The atoms true in a state of the task, derived ones included.
    pub(super) fn world(&self, task: &Task, state: &State) -> World {
        let mut world = task.atoms(state).into_iter().collect();
        self.derive(&mut world);
        world
    }

    /// Adds the derived atoms to a world of basic ones, stratum by stratum.
    fn derive(&self, world: &mut World) {
        let strata = strata(&self.domain.predicates, &self.domain.axioms).unwrap_or_default();
        for stratum in 0..=strata.iter().copied().max().unwrap_or(0) {
            let rules = self.domain.axioms.iter().filter(|axiom| strata[axiom.predicate.index()] == stratum);
            while rules.clone().any(|axiom| self.derive_once(axiom, world)) {}
        }
    }

    /// Adds what the rule says now; whether that was anything.
    fn derive_once(&self, axiom: &Axiom, world: &mut World) -> bool {
        let mut new = Vec::new();
        self.some_binding(&axiom.parameters, &mut Vec::new(), &mut |binding| {
            if !world.holds(axiom.predicate, binding) && self.holds(&axiom.condition, binding, &*world) {
                new.push(GroundAtom { predicate: axiom.predicate, args: binding.clone() });
            }
            false
        });
        let changed = !new.is_empty();
        world.extend(new);
        changed
    }
}

/// The terms' objects under the binding.
fn ground(terms: &[Term], binding: &[ObjectId]) -> Vec<ObjectId> {
    terms.iter().map(|&term| value(term, binding)).collect()
}

fn value(term: Term, binding: &[ObjectId]) -> ObjectId {
    match term {
        Term::Object(id) => id,
        Term::Variable(id) => binding[id.index()],
    }
}
