//! The rules that say which atoms, operators and effects can be reached, with deletes and negation ignored.
//!
//! Every predicate, action, axiom and conditional effect is a relation; a rule derives tuples of one from joins over
//! others. Disjunctions and existential conditions become relations of their own (guards), so that they join like
//! atoms and no operator is split. What no join can express (universal conditions, disjunctions that leave a variable
//! free) stays with the rule as a test, repeated as long as it may still come true.

use super::normal::{LiftedEffect, Normal, Pattern, Slot, Variables};
use super::universe::Candidates;

/// A condition that only reads what is known before the joins begin.
#[derive(Clone, Debug)]
pub(super) enum Filter {
    Equal(Slot, Slot, bool),
    /// The tuple is not in the relation, which no rule derives.
    Absent(Pattern),
}

impl Filter {
    pub fn variables(&self) -> Variables {
        match self {
            Self::Equal(left, right, _) => [left, right].into_iter().filter_map(|slot| slot.variable()).collect(),
            Self::Absent(pattern) => pattern.variables().collect(),
        }
    }
}

/// `head` holds for every binding for which all of `body`, `filters` and `tests` do.
#[derive(Clone, Debug)]
pub(super) struct Rule {
    pub head: Pattern,
    pub body: Vec<Pattern>,
    pub filters: Vec<Filter>,
    pub tests: Vec<Normal>,
    /// What each variable ranges over, by number.
    pub scope: Vec<Candidates>,
}

impl Rule {
    /// The variables that the body gives values to.
    fn bound(&self) -> Variables {
        self.body.iter().flat_map(Pattern::variables).collect()
    }

    /// Every variable that needs a value.
    pub fn variables(&self) -> Variables {
        let mut variables = self.bound();
        variables.extend(self.head.variables());
        variables.extend(self.filters.iter().flat_map(Filter::variables));
        variables.extend(self.tests.iter().flat_map(Normal::free));
        variables
    }
}

/// Relations (by arity) and the rules that fill them.
#[derive(Default)]
pub(super) struct Program {
    /// The arity of each relation; predicates come first, in the domain's order.
    pub arities: Vec<usize>,
    /// Which relations some rule or the initial state's changes may extend; the others are fixed by the initial state.
    pub growing: Vec<bool>,
    pub rules: Vec<Rule>,
}

impl Program {
    /// A program over predicates of these arities, of which those that are not `growing` are fixed.
    pub fn new(arities: Vec<usize>, growing: Vec<bool>) -> Self {
        Self { arities, growing, rules: Vec::new() }
    }

    /// A relation that holds the bindings of `scope` for which all of the conditions can be true.
    pub fn instances(&mut self, scope: &[Candidates], conditions: &[Normal]) -> usize {
        let columns: Vec<usize> = (0..scope.len()).collect();
        let head = self.relation(&columns);
        let relation = head.relation;
        self.rule(head, Vec::new(), conditions, scope);
        relation
    }

    /// A relation that holds the instances of a conditional effect of the operators in `operators`.
    pub fn effect_instances(&mut self, operators: usize, effect: &LiftedEffect) -> usize {
        let columns: Vec<usize> = (0..effect.scope.len()).collect();
        let head = self.relation(&columns);
        let relation = head.relation;
        let parameters = (0..self.arities[operators]).map(Slot::Variable).collect();
        let mut body = vec![Pattern { relation: operators, slots: parameters }];
        if effect.add_effects.is_empty() && effect.del_effects.len() == 1 {
            body.push(effect.del_effects[0].clone()); // deleting what is never true changes nothing
        }
        self.rule(head, body, &effect.condition, &effect.scope);
        relation
    }

    /// `heads` hold for each tuple of `instances`.
    pub fn consequences(&mut self, instances: usize, heads: &[Pattern], scope: &[Candidates]) {
        let slots = (0..self.arities[instances]).map(Slot::Variable).collect();
        let body = Pattern { relation: instances, slots };
        for head in heads {
            self.rule(head.clone(), vec![body.clone()], &[], scope);
        }
    }

    /// Adds the rule `head` ← `body` and all of `conditions`.
    fn rule(&mut self, head: Pattern, body: Vec<Pattern>, conditions: &[Normal], scope: &[Candidates]) {
        let mut rule = Rule { head, body, filters: Vec::new(), tests: Vec::new(), scope: scope.to_vec() };
        for condition in conditions {
            self.require(&mut rule, condition);
        }
        self.bind_by_tests(&mut rule);
        self.rules.push(rule);
    }

    /// Adds a condition to the rule's body.
    fn require(&mut self, rule: &mut Rule, condition: &Normal) {
        match condition {
            _ if self.is_always_possible(condition) => {}
            Normal::And(parts) => parts.iter().for_each(|part| self.require(rule, part)),
            Normal::Literal(pattern, true) => rule.body.push(pattern.clone()),
            Normal::Literal(pattern, false) => rule.filters.push(Filter::Absent(pattern.clone())),
            Normal::Equal(left, right, wanted) => rule.filters.push(Filter::Equal(*left, *right, *wanted)),
            Normal::Or(_) | Normal::Exists(_) if condition.free() == condition.binding() => {
                let guard = self.guard(condition, &condition.binding(), &rule.scope);
                rule.body.push(guard);
            }
            Normal::Or(_) | Normal::Exists(_) | Normal::Forall(_) => rule.tests.push(condition.clone()),
        }
    }

    /// Whether the condition can be true whatever is reached, as it only asks for atoms to be false that may become so.
    fn is_always_possible(&self, condition: &Normal) -> bool {
        match condition {
            Normal::Literal(pattern, wanted) => !wanted && self.growing[pattern.relation],
            Normal::Equal(..) => false,
            Normal::And(parts) => parts.iter().all(|part| self.is_always_possible(part)),
            Normal::Or(parts) => parts.iter().any(|part| self.is_always_possible(part)),
            Normal::Forall(inner) => self.is_always_possible(&inner.body),
            Normal::Exists(inner) => inner.is_inhabited() && self.is_always_possible(&inner.body),
        }
    }

    /// Where a test implies atoms over variables that the body leaves open, joins with a guard that gives them values.
    fn bind_by_tests(&mut self, rule: &mut Rule) {
        for test in rule.tests.clone() {
            let binding = test.binding();
            if !binding.is_subset(&rule.bound()) {
                let guard = self.guard(&test, &binding, &rule.scope);
                rule.body.push(guard);
            }
        }
    }

    /// A relation over `columns` that holds wherever the disjunction or existential condition can be true.
    fn guard(&mut self, condition: &Normal, columns: &Variables, scope: &[Candidates]) -> Pattern {
        let hidden = &condition.free() - columns;
        let columns: Vec<usize> = columns.iter().copied().collect();
        let head = self.relation(&columns);
        match condition {
            Normal::Or(parts) => parts.iter().for_each(|part| self.guard_rule(&head, part, &hidden, scope)),
            Normal::Exists(inner) if inner.is_inhabited() => {
                let mut inside = scope[..inner.first].to_vec();
                inside.extend(inner.ranges.iter().cloned());
                self.guard_rule(&head, &inner.body, &hidden, &inside);
            }
            Normal::Exists(_) => {} // nothing exists
            _ => unreachable!("only disjunctions and existential conditions have guards"),
        }
        head
    }

    /// One way for a guard to hold. What asks about hidden variables that the body leaves open is left out.
    fn guard_rule(&mut self, head: &Pattern, condition: &Normal, hidden: &Variables, scope: &[Candidates]) {
        self.rule(head.clone(), Vec::new(), std::slice::from_ref(condition), scope);
        let mut rule = self.rules.pop().expect("a rule was added last");
        let open = hidden - &rule.bound();
        rule.filters.retain(|filter| filter.variables().is_disjoint(&open));
        rule.tests.retain(|test| test.free().is_disjoint(&open));
        self.rules.push(rule);
    }

    /// A new relation with these variables as columns.
    fn relation(&mut self, columns: &[usize]) -> Pattern {
        self.arities.push(columns.len());
        self.growing.push(true);
        Pattern {
            relation: self.arities.len() - 1,
            slots: columns.iter().map(|&column| Slot::Variable(column)).collect(),
        }
    }
}
