//! Random tasks made directly in grounded form: negation, disjunction, conditional effects, axioms, equal operators,
//! operators that change nothing, and states of more than one word.

use std::sync::Arc;

use proptest::prelude::*;
use strips_core::pddl::ast::{Action, ActionId, Condition, Domain, Effect, Predicate, PredicateId, Problem};
use strips_core::span::Span;
use strips_core::task::{AxiomLayers, Fact, FactId, Formula, GroundCondition, GroundEffect, Operator, State, Task};

/// Facts lie this far apart in the numbering, so that states take one to five words.
const STRIDES: [usize; 4] = [1, 1, 13, 40];

/// A task of up to seven basic facts, one derived fact and six operators.
pub fn random_task() -> impl Strategy<Value = Arc<Task>> {
    let facts = 1usize..=7;
    facts.prop_flat_map(|facts| {
        let stride = prop::sample::select(STRIDES.to_vec());
        let operators = prop::collection::vec(operator(facts), 0..=6);
        let axiom = prop::option::weighted(0.2, condition(facts, false));
        (stride, any::<u32>(), operators, condition(facts, true), axiom).prop_map(
            move |(stride, init, operators, goal, axiom)| build(facts, stride, init, &operators, &goal, axiom.as_ref()),
        )
    })
}

type Literals = Vec<(usize, bool)>;

#[derive(Clone, Debug)]
struct Draft {
    literals: Literals,
    clause: Option<Literals>,
    derived: Option<bool>,
}

#[derive(Clone, Debug)]
struct DraftOperator {
    precondition: Draft,
    effects: Vec<(Draft, Literals)>,
}

fn literals(facts: usize, most: usize) -> impl Strategy<Value = Literals> {
    prop::collection::vec((0..facts, prop::bool::weighted(0.6)), 0..=most)
}

fn condition(facts: usize, derived: bool) -> impl Strategy<Value = Draft> {
    let clause = prop::option::weighted(0.15, literals(facts, 3));
    let derived = prop::option::weighted(0.1, any::<bool>()).prop_map(move |value| value.filter(|_| derived));
    (literals(facts, 2), clause, derived).prop_map(|(literals, clause, derived)| Draft { literals, clause, derived })
}

fn operator(facts: usize) -> impl Strategy<Value = DraftOperator> {
    let sure =
        literals(facts, 3).prop_map(|changes| (Draft { literals: vec![], clause: None, derived: None }, changes));
    let conditional = (condition(facts, true), literals(facts, 2));
    let effects = prop_oneof![
        4 => sure.prop_map(|effect| vec![effect]),
        1 => prop::collection::vec(conditional, 0..=3),
    ];
    (condition(facts, true), effects).prop_map(|(precondition, effects)| DraftOperator { precondition, effects })
}

fn build(
    facts: usize,
    stride: usize,
    init: u32,
    operators: &[DraftOperator],
    goal: &Draft,
    axiom: Option<&Draft>,
) -> Arc<Task> {
    let derived = facts * stride;
    let spread = Spread { stride, derived: axiom.is_some().then_some(FactId::from(derived)) };
    let operators: Arc<[Operator]> =
        operators.iter().enumerate().map(|(number, draft)| spread.operator(number, draft)).collect();
    let mut task = Task {
        domain: Arc::new(domain(derived + 1, operators.len())),
        problem: Arc::new(problem()),
        facts: (0..=derived).map(|fact| Fact { predicate: PredicateId::from(fact), args: vec![] }).collect(),
        static_facts: vec![],
        init: State::empty(derived + 1),
        goal: spread.condition(goal),
        operators,
        axioms: spread.axioms(axiom),
    };
    (0..facts).for_each(|fact| task.init.set(FactId::from(fact * stride), init >> fact & 1 == 1));
    let mut start = task.init.clone();
    task.derive(&mut start);
    task.init = start;
    Arc::new(task)
}

struct Spread {
    stride: usize,
    derived: Option<FactId>,
}

impl Spread {
    fn fact(&self, fact: usize) -> FactId {
        FactId::from(fact * self.stride)
    }

    fn chosen(&self, literals: &Literals, wanted: bool) -> Vec<FactId> {
        let mut facts: Vec<_> =
            literals.iter().filter(|&&(_, value)| value == wanted).map(|&(fact, _)| self.fact(fact)).collect();
        facts.sort_unstable();
        facts.dedup();
        facts
    }

    fn condition(&self, draft: &Draft) -> GroundCondition {
        let literal = |&(fact, value): &(usize, bool)| Formula::Literal(self.fact(fact), value);
        let clause = |literals: &Literals| Formula::Or(vec![Formula::And(literals.iter().map(literal).collect())]);
        let mut condition = GroundCondition {
            positive: self.chosen(&draft.literals, true),
            negative: self.chosen(&draft.literals, false),
            clauses: draft.clause.iter().map(clause).collect(),
        };
        match (draft.derived, self.derived) {
            (Some(true), Some(fact)) => condition.positive.push(fact),
            (Some(false), Some(fact)) => condition.negative.push(fact),
            _ => {}
        }
        condition
    }

    fn operator(&self, number: usize, draft: &DraftOperator) -> Operator {
        let effect = |(condition, changes): &(Draft, Literals)| {
            let add_effects = self.chosen(changes, true);
            let mut del_effects = self.chosen(changes, false);
            del_effects.retain(|fact| !add_effects.contains(fact));
            GroundEffect { condition: self.condition(condition), add_effects, del_effects }
        };
        Operator {
            action: ActionId::from(number),
            args: vec![],
            precondition: self.condition(&draft.precondition),
            effects: draft.effects.iter().map(effect).collect(),
            cost: 1.0,
        }
    }

    fn axioms(&self, body: Option<&Draft>) -> AxiomLayers {
        let (Some(body), Some(head)) = (body, self.derived) else { return AxiomLayers::default() };
        AxiomLayers { derived: vec![head], layers: vec![vec![(head, self.condition(body))]] }
    }
}

fn domain(predicates: usize, actions: usize) -> Domain {
    let predicate = |number: usize| Predicate {
        name: format!("p{number}"),
        parameters: vec![],
        derived: false,
        span: Span::default(),
    };
    let action = |number: usize| Action {
        name: format!("a{number}"),
        parameters: vec![],
        precondition: Condition::And(vec![]),
        effect: Effect::And(vec![]),
        span: Span::default(),
    };
    Domain {
        name: "random".into(),
        requirements: vec![],
        types: vec![],
        constants: vec![],
        pending: vec![],
        predicates: (0..predicates).map(predicate).collect(),
        axioms: vec![],
        actions: (0..actions).map(action).collect(),
        has_total_cost: false,
        cost_functions: vec![],
        warnings: vec![],
    }
}

fn problem() -> Problem {
    Problem {
        name: "random".into(),
        objects: vec![],
        init: vec![],
        costs: vec![],
        goal: Condition::And(vec![]),
        minimizes_cost: false,
        goal_span: Span::default(),
        requirements: vec![],
        warnings: vec![],
    }
}

/// Switches that can be turned on and off at any time, all of which must be on; their facts lie `spread` apart.
pub fn switches(switches: usize, spread: usize) -> Arc<Task> {
    let nothing = Draft { literals: vec![], clause: None, derived: None };
    let turn = |(switch, value)| DraftOperator {
        precondition: nothing.clone(),
        effects: vec![(nothing.clone(), vec![(switch, value)])],
    };
    let operators: Vec<_> = (0..switches).flat_map(|switch| [(switch, true), (switch, false)]).map(turn).collect();
    let goal = Draft { literals: (0..switches).map(|switch| (switch, true)).collect(), ..nothing.clone() };
    build(switches, spread, 0, &operators, &goal, None)
}
