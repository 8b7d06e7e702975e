//! The slow obvious meaning of PDDL: lifted conditions evaluated on sets of atoms, no grounding, no sharing.

use std::collections::BTreeSet;

use strips_core::pddl::ast::{
    ActionId, Atom, Condition, Domain, Effect, GroundAtom, Object, ObjectId, Parameter, Problem, Term, TypeId,
};

/// The atoms that are true, without derived ones.
pub type Atoms = BTreeSet<GroundAtom>;

/// A domain and a problem, read literally.
pub struct Naive<'a> {
    pub domain: &'a Domain,
    pub problem: &'a Problem,
}

/// Every well-typed list of objects for the parameters, in ascending order.
pub fn bindings(domain: &Domain, objects: &[Object], parameters: &[Parameter]) -> Vec<Vec<ObjectId>> {
    let mut lists = vec![Vec::new()];
    for parameter in parameters {
        let fits = |object: &usize| {
            objects[*object]
                .types
                .iter()
                .any(|&kind| parameter.types.iter().any(|&wanted| is_kind(domain, kind, wanted)))
        };
        let extended = |list: &Vec<ObjectId>| {
            (0..objects.len())
                .filter(fits)
                .map(|object| [list.as_slice(), &[object.into()]].concat())
                .collect::<Vec<_>>()
        };
        lists = lists.iter().flat_map(extended).collect();
    }
    lists
}

fn is_kind(domain: &Domain, kind: TypeId, wanted: TypeId) -> bool {
    kind == wanted
        || wanted == TypeId::OBJECT
        || domain.types[kind.index()].parents.iter().any(|&parent| is_kind(domain, parent, wanted))
}

fn ground(atom: &Atom, binding: &[ObjectId]) -> GroundAtom {
    GroundAtom { predicate: atom.predicate, args: atom.terms.iter().map(|&term| value(term, binding)).collect() }
}

fn value(term: Term, binding: &[ObjectId]) -> ObjectId {
    match term {
        Term::Variable(variable) => binding[variable.index()],
        Term::Object(object) => object,
    }
}

impl Naive<'_> {
    /// The initial state.
    pub fn init(&self) -> Atoms {
        self.problem.init.iter().cloned().collect()
    }

    /// The state with derived atoms added.
    pub fn with_derived(&self, atoms: &Atoms) -> Atoms {
        let mut full = atoms.clone();
        for predicate in 0..self.domain.predicates.len() {
            // In random tasks a derived predicate depends only on those before it and, positively, on itself.
            let rules: Vec<_> =
                self.domain.axioms.iter().filter(|axiom| axiom.predicate.index() == predicate).collect();
            loop {
                let before = full.len();
                for axiom in &rules {
                    for binding in bindings(self.domain, &self.problem.objects, &axiom.parameters) {
                        if self.holds(&axiom.condition, &binding, &full) {
                            full.insert(GroundAtom { predicate: axiom.predicate, args: binding });
                        }
                    }
                }
                if full.len() == before {
                    break;
                }
            }
        }
        full
    }

    /// Whether the condition is true; `full` includes derived atoms.
    pub fn holds(&self, condition: &Condition, binding: &[ObjectId], full: &Atoms) -> bool {
        let under = |parameters: &[Parameter]| {
            let lists = bindings(self.domain, &self.problem.objects, parameters);
            lists.into_iter().map(|list| [binding, &list].concat()).collect::<Vec<_>>()
        };
        match condition {
            Condition::And(parts) => parts.iter().all(|part| self.holds(part, binding, full)),
            Condition::Or(parts) => parts.iter().any(|part| self.holds(part, binding, full)),
            Condition::Not(part) => !self.holds(part, binding, full),
            Condition::Imply(left, right) => !self.holds(left, binding, full) || self.holds(right, binding, full),
            Condition::Forall(parameters, body) => under(parameters).iter().all(|list| self.holds(body, list, full)),
            Condition::Exists(parameters, body) => under(parameters).iter().any(|list| self.holds(body, list, full)),
            Condition::Atom(atom) => full.contains(&ground(atom, binding)),
            Condition::Equals(left, right) => value(*left, binding) == value(*right, binding),
        }
    }

    /// Whether the goal is true in the state.
    pub fn is_goal(&self, atoms: &Atoms) -> bool {
        self.holds(&self.problem.goal, &[], &self.with_derived(atoms))
    }

    /// The state after the action, if it is applicable.
    pub fn apply(&self, action: ActionId, args: &[ObjectId], atoms: &Atoms) -> Option<Atoms> {
        self.apply_in(action, args, atoms, &self.with_derived(atoms))
    }

    /// The same, where the derived atoms are known already.
    pub fn apply_in(&self, action: ActionId, args: &[ObjectId], atoms: &Atoms, full: &Atoms) -> Option<Atoms> {
        let action = &self.domain.actions[action.index()];
        if !self.holds(&action.precondition, args, full) {
            return None;
        }
        let (mut adds, mut deletes) = (Atoms::new(), Atoms::new());
        self.collect(&action.effect, args, full, &mut adds, &mut deletes);
        Some(atoms.difference(&deletes).cloned().chain(adds).collect())
    }

    fn collect(&self, effect: &Effect, binding: &[ObjectId], full: &Atoms, adds: &mut Atoms, deletes: &mut Atoms) {
        match effect {
            Effect::And(parts) => parts.iter().for_each(|part| self.collect(part, binding, full, adds, deletes)),
            Effect::Add(atom) => {
                adds.insert(ground(atom, binding));
            }
            Effect::Delete(atom) => {
                deletes.insert(ground(atom, binding));
            }
            Effect::When(condition, inner) if self.holds(condition, binding, full) => {
                self.collect(inner, binding, full, adds, deletes);
            }
            Effect::Forall(parameters, inner) => {
                for list in bindings(self.domain, &self.problem.objects, parameters) {
                    self.collect(inner, &[binding, &list].concat(), full, adds, deletes);
                }
            }
            Effect::When(..) | Effect::IncreaseCost(_) => {}
        }
    }
}
