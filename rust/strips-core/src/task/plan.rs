//! In which order a rule's atoms are joined, once some tuple sets it off.
//!
//! Greedy: after each step the atom that is expected to match the fewest tuples comes next, tests and filters as soon
//! as their variables are known, variables that no atom binds last of all.

use super::normal::{Pattern, Slot, Variables};
use super::program::{Filter, Rule};
use super::relation::Relation;
use super::universe::Candidates;

/// What to do with a column of a tuple that matches.
#[derive(Clone, Debug)]
pub(super) enum Column {
    /// The value becomes the variable's, if it is in its range.
    Bind(usize, usize),
    /// The value must be the slot's.
    Equal(usize, Slot),
}

/// Which rows of a relation a step may use, so that every instance is found exactly once: from its youngest atom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Age {
    /// All that are admitted.
    Any,
    /// All but the one that set the rule off, which is the youngest.
    Older,
}

/// One step of a join.
#[derive(Clone, Debug)]
pub(super) enum Step {
    /// Goes through the rows of the relation whose indexed columns equal the key.
    Join { relation: usize, index: usize, key: Vec<Slot>, columns: Vec<Column>, age: Age },
    /// The tuple must be in the relation.
    Member { relation: usize, key: Vec<Slot>, age: Age },
    /// Goes through all values of a variable.
    Enumerate(usize, Candidates),
    /// Something that only reads what is known.
    Check(Filter),
    /// Goes no further if the rule's head is known already.
    NewHead,
}

/// How a rule is joined when the `trigger` (or, without one, the start) sets it off.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub rule: usize,
    /// How the columns of the tuple that sets it off are matched.
    pub trigger: Vec<Column>,
    pub steps: Vec<Step>,
    /// The relations of the other atoms: while one is empty, nothing can match.
    pub needs: Vec<usize>,
}

/// Orders the atoms of a rule.
pub(super) struct Planner<'a> {
    rule: &'a Rule,
    relations: &'a mut [Relation],
    growing: &'a [bool],
    bound: Variables,
    /// Whether several bindings may derive the same head.
    projects: bool,
    filters: Vec<Filter>,
    steps: Vec<Step>,
}

impl<'a> Planner<'a> {
    pub fn new(rule: &'a Rule, relations: &'a mut [Relation], growing: &'a [bool]) -> Self {
        let projects = rule.variables() != rule.head.variables().collect();
        let filters = rule.filters.clone();
        Self { rule, relations, growing, bound: Variables::new(), projects, filters, steps: Vec::new() }
    }

    /// The plan for the rule with this number, set off by the atom at `trigger` or by nothing.
    pub fn plan(mut self, number: usize, trigger: Option<usize>) -> Plan {
        let mut atoms: Vec<usize> = (0..self.rule.body.len()).filter(|&atom| Some(atom) != trigger).collect();
        let mut needs: Vec<usize> = atoms.iter().map(|&atom| self.rule.body[atom].relation).collect();
        needs.sort_unstable();
        needs.dedup();
        let columns = trigger.map(|atom| self.columns(&self.rule.body[atom], &[])).unwrap_or_default();
        self.bound.extend(trigger.iter().flat_map(|&atom| self.rule.body[atom].variables()));
        self.add_ready();
        while !atoms.is_empty() {
            let costs: Vec<f64> = atoms.iter().map(|&atom| self.expected_matches(&self.rule.body[atom])).collect();
            let best = (0..atoms.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).expect("some atom is left");
            self.add_atom(atoms.remove(best), trigger);
        }
        self.add_enumerations();
        Plan { rule: number, trigger: columns, steps: self.steps, needs }
    }

    /// How many rows a join with the atom should find.
    fn expected_matches(&mut self, atom: &Pattern) -> f64 {
        let is_bound = |slot: &Slot| slot.variable().is_none_or(|variable| self.bound.contains(&variable));
        if atom.slots.iter().all(is_bound) {
            return 0.0;
        }
        if self.growing[atom.relation] {
            let open: Variables = atom.variables().filter(|variable| !self.bound.contains(variable)).collect();
            return open.iter().map(|&variable| self.rule.scope[variable].list.len() as f64).product();
        }
        let relation = &mut self.relations[atom.relation];
        let bound = (0..atom.slots.len()).filter(|&column| is_bound(&atom.slots[column]));
        bound.fold(relation.tuples.len() as f64, |rows, column| rows / relation.distinct(column).max(1) as f64)
    }

    fn add_atom(&mut self, atom: usize, trigger: Option<usize>) {
        let pattern = &self.rule.body[atom];
        let relation = pattern.relation;
        let same = trigger.is_some_and(|trigger| self.rule.body[trigger].relation == relation && atom < trigger);
        let age = if same { Age::Older } else { Age::Any };
        let is_bound = |slot: &Slot| slot.variable().is_none_or(|variable| self.bound.contains(&variable));
        let keyed: Vec<usize> = (0..pattern.slots.len()).filter(|&column| is_bound(&pattern.slots[column])).collect();
        let key = keyed.iter().map(|&column| pattern.slots[column]).collect();
        if keyed.len() == pattern.slots.len() {
            self.steps.push(Step::Member { relation, key, age });
        } else {
            let columns = self.columns(pattern, &keyed);
            let index = self.relations[relation].index_on(keyed);
            self.steps.push(Step::Join { relation, index, key, columns, age });
        }
        self.bound.extend(pattern.variables());
        self.add_ready();
    }

    /// How to match the columns that are not part of the key.
    fn columns(&self, pattern: &Pattern, keyed: &[usize]) -> Vec<Column> {
        let mut seen = self.bound.clone();
        let open = (0..pattern.slots.len()).filter(|column| !keyed.contains(column));
        open.map(|column| match pattern.slots[column] {
            Slot::Variable(variable) if seen.insert(variable) => Column::Bind(column, variable),
            slot => Column::Equal(column, slot),
        })
        .collect()
    }

    fn add_enumerations(&mut self) {
        let mut open: Vec<usize> = (&self.rule.variables() - &self.bound).into_iter().collect();
        open.sort_by_key(|&variable| self.rule.scope[variable].list.len());
        for variable in open {
            self.steps.push(Step::Enumerate(variable, self.rule.scope[variable].clone()));
            self.bound.insert(variable);
            self.add_ready();
        }
    }

    /// Adds the filters whose variables are all known, and a look at the head once that is.
    fn add_ready(&mut self) {
        let is_ready = |filter: &Filter| filter.variables().is_subset(&self.bound);
        let (ready, waiting) = std::mem::take(&mut self.filters).into_iter().partition::<Vec<_>, _>(is_ready);
        self.filters = waiting;
        self.steps.extend(ready.into_iter().map(Step::Check));
        let looked = self.steps.iter().any(|step| matches!(step, Step::NewHead));
        if self.projects && !looked && self.rule.head.variables().all(|variable| self.bound.contains(&variable)) {
            self.steps.push(Step::NewHead);
        }
    }
}
