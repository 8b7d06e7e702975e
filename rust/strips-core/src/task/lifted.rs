//! A domain and problem made ready for grounding: normal forms, and the relation that will hold each part's instances.

use super::normal::{LiftedEffect, Normal, Pattern, effects};
use super::program::Program;
use super::reach::Kind;
use super::strata::{Dependency, strata};
use super::universe::{Candidates, Universe};
use crate::pddl::ast::{Action, Axiom, Domain, Effect, Problem};

/// An action in normal form.
pub(super) struct LiftedAction {
    /// The relation whose tuples are the arguments of its operators.
    pub relation: usize,
    pub precondition: Vec<Normal>,
    /// Without condition and quantifier.
    pub effect: LiftedEffect,
    /// The others, each with the relation of its instances: the action's arguments, then the quantified variables.
    pub conditional_effects: Vec<(usize, LiftedEffect)>,
}

/// A derived predicate's rule in normal form.
pub(super) struct LiftedAxiom {
    /// The relation whose tuples are the values of the head's parameters.
    pub relation: usize,
    pub head: Pattern,
    pub condition: Vec<Normal>,
}

/// Everything that grounding starts from.
pub(super) struct Lifted {
    pub actions: Vec<LiftedAction>,
    pub axioms: Vec<LiftedAxiom>,
    pub goal: Normal,
    /// Which predicates some action or axiom may change.
    pub growing: Vec<bool>,
    /// The stratum of each predicate.
    pub strata: Vec<usize>,
    pub program: Program,
}

impl Lifted {
    pub fn new(domain: &Domain, problem: &Problem) -> Self {
        let universe = Universe::new(domain, problem);
        let growing = growing(domain);
        let arities = domain.predicates.iter().map(|predicate| predicate.parameters.len()).collect();
        let mut program = Program::new(arities, growing.clone());
        let actions = domain.actions.iter().map(|action| lift_action(action, &universe, &mut program)).collect();
        let axioms: Vec<_> = domain.axioms.iter().map(|axiom| lift_axiom(axiom, &universe, &mut program)).collect();
        let goal = Normal::new(&problem.goal, true, 0, &universe);
        let derived: Vec<bool> = domain.predicates.iter().map(|predicate| predicate.derived).collect();
        let depend = |axiom: &'_ LiftedAxiom| (axiom.head.relation, Normal::And(axiom.condition.clone()));
        let rules: Vec<_> = axioms.iter().map(depend).collect();
        let rules: Vec<_> = rules.iter().map(|(head, condition)| Dependency { head: *head, condition }).collect();
        let strata = strata(growing.len(), &derived, &rules);
        Self { actions, axioms, goal, growing, strata, program }
    }

    /// What each relation counts towards.
    pub fn kinds(&self) -> Vec<Kind> {
        let mut kinds = vec![Kind::Other; self.program.arities.len()];
        for (kind, _) in kinds.iter_mut().zip(&self.growing).filter(|(_, growing)| **growing) {
            *kind = Kind::Facts;
        }
        self.actions.iter().for_each(|action| kinds[action.relation] = Kind::Operators);
        kinds
    }
}

/// Which predicates are derived or occur in some effect.
fn growing(domain: &Domain) -> Vec<bool> {
    let mut growing: Vec<bool> = domain.predicates.iter().map(|predicate| predicate.derived).collect();
    domain.actions.iter().for_each(|action| mark_changed(&action.effect, &mut growing));
    growing
}

fn mark_changed(effect: &Effect, growing: &mut [bool]) {
    match effect {
        Effect::And(parts) => parts.iter().for_each(|part| mark_changed(part, growing)),
        Effect::Add(atom) | Effect::Delete(atom) => growing[atom.predicate.index()] = true,
        Effect::When(_, inner) | Effect::Forall(_, inner) => mark_changed(inner, growing),
        Effect::IncreaseCost(_) => {}
    }
}

fn lift_action(action: &Action, universe: &Universe, program: &mut Program) -> LiftedAction {
    let precondition = vec![Normal::new(&action.precondition, true, action.parameters.len(), universe)];
    let mut list = effects(action, universe);
    let effect = list.remove(0);
    let relation = program.instances(&effect.scope, &precondition);
    program.consequences(relation, &effect.add_effects, &effect.scope);
    let lift_effect = |effect: LiftedEffect| {
        let instances = program.effect_instances(relation, &effect);
        program.consequences(instances, &effect.add_effects, &effect.scope);
        (instances, effect)
    };
    let conditional_effects = list.into_iter().map(lift_effect).collect();
    LiftedAction { relation, precondition, effect, conditional_effects }
}

fn lift_axiom(axiom: &Axiom, universe: &Universe, program: &mut Program) -> LiftedAxiom {
    let scope: Vec<Candidates> = universe.scope(&axiom.parameters);
    let condition = vec![Normal::new(&axiom.condition, true, scope.len(), universe)];
    let relation = program.instances(&scope, &condition);
    let slots = (0..scope.len()).map(super::normal::Slot::Variable).collect();
    let head = Pattern { relation: axiom.predicate.index(), slots };
    program.consequences(relation, std::slice::from_ref(&head), &scope);
    LiftedAxiom { relation, head, condition }
}
