//! A problem's goal as the literals that a prompt prints.

use std::ops::ControlFlow;

use crate::pddl::ast::{Atom, Condition, Domain, GroundAtom, Object, ObjectId, Parameter, Problem, Term};

/// The goal as a conjunction of literals in order of writing, or `None` where it is none.
///
/// `forall` is spelled out over the problem's objects; what remains must be atoms, equalities that hold, and negations
/// of those. Price: the product of the objects of each quantified variable.
pub fn goal_literals(domain: &Domain, problem: &Problem) -> Option<Vec<(GroundAtom, bool)>> {
    let mut reader = GoalReader { domain, objects: &problem.objects, bindings: Vec::new(), literals: Vec::new() };
    reader.read(&problem.goal, true).is_continue().then_some(reader.literals)
}

struct GoalReader<'a> {
    domain: &'a Domain,
    objects: &'a [Object],
    bindings: Vec<ObjectId>,
    literals: Vec<(GroundAtom, bool)>,
}

impl GoalReader<'_> {
    fn read(&mut self, condition: &Condition, positive: bool) -> ControlFlow<()> {
        match (condition, positive) {
            (Condition::And(parts), true) | (Condition::Or(parts), false) => {
                parts.iter().try_for_each(|part| self.read(part, positive))
            }
            (Condition::And(parts), false) | (Condition::Or(parts), true) if parts.len() == 1 => {
                self.read(&parts[0], positive)
            }
            (Condition::Imply(premise, conclusion), false) => {
                self.read(premise, true)?;
                self.read(conclusion, false)
            }
            (Condition::Not(part), _) => self.read(part, !positive),
            (Condition::Forall(parameters, body), true) | (Condition::Exists(parameters, body), false) => {
                self.spell_out(parameters, body, positive)
            }
            (Condition::Atom(atom), _) => self.literal(atom, positive),
            (Condition::Equals(a, b), _) if (self.object(*a) == self.object(*b)) == positive => {
                ControlFlow::Continue(())
            }
            _ => ControlFlow::Break(()),
        }
    }

    fn spell_out(&mut self, parameters: &[Parameter], body: &Condition, positive: bool) -> ControlFlow<()> {
        let Some((first, others)) = parameters.split_first() else { return self.read(body, positive) };
        for object in (0..self.objects.len()).map(ObjectId::from) {
            if self.domain.accepts(&first.types, &self.objects[object.index()]) {
                self.bindings.push(object);
                self.spell_out(others, body, positive)?;
                self.bindings.pop();
            }
        }
        ControlFlow::Continue(())
    }

    fn literal(&mut self, atom: &Atom, positive: bool) -> ControlFlow<()> {
        let args = atom.terms.iter().map(|&term| self.object(term)).collect();
        self.literals.push((GroundAtom { predicate: atom.predicate, args }, positive));
        ControlFlow::Continue(())
    }

    fn object(&self, term: Term) -> ObjectId {
        match term {
            Term::Object(object) => object,
            Term::Variable(variable) => self.bindings[variable.index()],
        }
    }
}
