//! How far the goal seems: the length of a plan in which nothing that was ever true becomes false.
//!
//! The heuristic of FF (Hoffmann and Nebel 2001), its relaxed plan read off the cheapest ways to reach each literal, costs
//! added up (Keyder and Geffner 2008). A fact and its negation are two literals, and in the relaxed world both may
//! hold; so negative conditions count, too. Each conditional effect and each axiom is a rule of its own. Disjunctions
//! and negated derived facts are taken to hold, which makes the estimate an underestimate there, never a wrong answer.
//!
//! Price: one pass over the rules that the state sets off.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::task::{FactId, GroundCondition, OperatorId, State, Task};

/// A fact or its negation: twice the fact's id, one more for the negation.
type Literal = usize;

/// No rule, or a literal that is out of reach.
const NONE: u32 = u32::MAX;

/// If the preconditions hold, so do the effects; for one step where it is an operator's.
#[derive(Clone, Debug)]
struct Rule {
    operator: Option<OperatorId>,
    preconditions: Vec<Literal>,
    effects: Vec<Literal>,
}

/// A task without deletes, and a goal.
#[derive(Clone, Debug)]
pub(super) struct Relaxation {
    rules: Vec<Rule>,
    /// For each literal the rules that need it.
    needed_by: Vec<Vec<u32>>,
    goal: Vec<Literal>,
    /// Literals that are taken to hold in every state.
    granted: Vec<Literal>,
}

/// What the relaxed world says of a state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Estimate {
    /// Steps of the relaxed plan.
    pub steps: usize,
    /// Its operators that can be applied at once, ascending.
    pub preferred: Vec<OperatorId>,
}

impl Relaxation {
    /// The relaxation of the task with this goal instead of its own; linear in the operators.
    pub fn new(task: &Task, goal: &GroundCondition) -> Self {
        let literals = 2 * task.facts.len();
        let goal = conjunction(&[goal]);
        let granted = task.axioms.derived.iter().map(|&fact| negative(fact)).collect();
        let mut relaxation = Self { rules: Vec::new(), needed_by: vec![Vec::new(); literals], goal, granted };
        relaxation.add_rules(task);
        relaxation.drop_useless_effects();
        for (number, rule) in relaxation.rules.iter().enumerate() {
            rule.preconditions.iter().for_each(|&literal| relaxation.needed_by[literal].push(number as u32));
        }
        relaxation
    }

    fn add_rules(&mut self, task: &Task) {
        for (number, operator) in task.operators.iter().enumerate() {
            for effect in &operator.effects {
                let adds = effect.add_effects.iter().map(|&fact| positive(fact));
                let effects = adds.chain(effect.del_effects.iter().map(|&fact| negative(fact))).collect();
                let preconditions = conjunction(&[&operator.precondition, &effect.condition]);
                self.rules.push(Rule { operator: Some(OperatorId::from(number)), preconditions, effects });
            }
        }
        for (head, body) in task.axioms.layers.iter().flatten() {
            self.rules.push(Rule {
                operator: None,
                preconditions: conjunction(&[body]),
                effects: vec![positive(*head)],
            });
        }
    }

    /// Forgets effects that neither a rule nor the goal asks for: in most domains, all negations.
    fn drop_useless_effects(&mut self) {
        let mut asked = vec![false; self.needed_by.len()];
        let preconditions = self.rules.iter().flat_map(|rule| &rule.preconditions);
        preconditions.chain(&self.goal).for_each(|&literal| asked[literal] = true);
        self.rules.iter_mut().for_each(|rule| rule.effects.retain(|&literal| asked[literal]));
    }

    /// How far the goal seems from the state; `None` where even the relaxed world has no plan.
    pub fn estimate(&self, state: &State) -> Option<Estimate> {
        let mut spread = Spread::new(self);
        let holds = |fact: usize| 2 * fact + usize::from(!state.holds(FactId::from(fact)));
        let true_now = (0..self.needed_by.len() / 2).map(holds);
        true_now.chain(self.granted.iter().copied()).for_each(|literal| spread.reach(literal, 0, NONE));
        (0..self.rules.len())
            .filter(|&rule| self.rules[rule].preconditions.is_empty())
            .for_each(|rule| spread.fire(rule));
        spread.run();
        let in_reach = self.goal.iter().all(|&literal| spread.costs[literal] != NONE);
        in_reach.then(|| spread.relaxed_plan())
    }
}

/// Costs spreading from a state's literals over the rules.
struct Spread<'r> {
    relaxation: &'r Relaxation,
    /// By literal: the steps that its cheapest support costs, those of the preconditions added up.
    costs: Vec<u32>,
    /// By literal: the rule that supports it.
    support: Vec<u32>,
    /// By rule: how many preconditions are not yet reached, and what the others cost together.
    open: Vec<(u32, u32)>,
    queue: BinaryHeap<Reverse<(u32, usize)>>,
}

impl<'r> Spread<'r> {
    fn new(relaxation: &'r Relaxation) -> Self {
        let literals = relaxation.needed_by.len();
        let open = relaxation.rules.iter().map(|rule| (rule.preconditions.len() as u32, 0)).collect();
        let (costs, support) = (vec![NONE; literals], vec![NONE; literals]);
        Self { relaxation, costs, support, open, queue: BinaryHeap::new() }
    }

    fn reach(&mut self, literal: Literal, cost: u32, rule: u32) {
        if cost < self.costs[literal] {
            self.costs[literal] = cost;
            self.support[literal] = rule;
            self.queue.push(Reverse((cost, literal)));
        }
    }

    fn fire(&mut self, number: usize) {
        let rule = &self.relaxation.rules[number];
        let cost = self.open[number].1.saturating_add(u32::from(rule.operator.is_some())).min(NONE - 1);
        rule.effects.iter().for_each(|&literal| self.reach(literal, cost, number as u32));
    }

    /// Settles literals, the cheapest first, until every literal of the goal is settled or nothing is left.
    fn run(&mut self) {
        let relaxation = self.relaxation;
        let mut wanted = vec![false; self.costs.len()];
        relaxation.goal.iter().for_each(|&literal| wanted[literal] = true);
        let mut missing = relaxation.goal.len();
        while let Some(Reverse((cost, literal))) = self.queue.pop() {
            if cost > self.costs[literal] {
                continue;
            }
            missing -= usize::from(wanted[literal]);
            if missing == 0 {
                return;
            }
            for &rule in &relaxation.needed_by[literal] {
                let open = &mut self.open[rule as usize];
                *open = (open.0 - 1, open.1.saturating_add(cost));
                if open.0 == 0 {
                    self.fire(rule as usize);
                }
            }
        }
    }

    /// The rules that support the goal, and what supports these, each operator once.
    fn relaxed_plan(&self) -> Estimate {
        let (mut marked, mut open) = (vec![false; self.costs.len()], self.relaxation.goal.clone());
        let (mut operators, mut preferred) = (Vec::new(), Vec::new());
        while let Some(literal) = open.pop() {
            if self.support[literal] == NONE || std::mem::replace(&mut marked[literal], true) {
                continue;
            }
            let rule = &self.relaxation.rules[self.support[literal] as usize];
            open.extend(&rule.preconditions);
            operators.extend(rule.operator);
            if rule.preconditions.iter().all(|&literal| self.support[literal] == NONE) {
                preferred.extend(rule.operator);
            }
        }
        for list in [&mut operators, &mut preferred] {
            list.sort_unstable();
            list.dedup();
        }
        Estimate { steps: operators.len(), preferred }
    }
}

fn positive(fact: FactId) -> Literal {
    2 * fact.index()
}

fn negative(fact: FactId) -> Literal {
    2 * fact.index() + 1
}

/// The literals of some conditions, each once; disjunctions are left out.
fn conjunction(conditions: &[&GroundCondition]) -> Vec<Literal> {
    let literals = |condition: &&GroundCondition| {
        let true_ones = condition.positive.iter().map(|&fact| positive(fact));
        true_ones.chain(condition.negative.iter().map(|&fact| negative(fact))).collect::<Vec<_>>()
    };
    let mut literals: Vec<Literal> = conditions.iter().flat_map(literals).collect();
    literals.sort_unstable();
    literals.dedup();
    literals
}
