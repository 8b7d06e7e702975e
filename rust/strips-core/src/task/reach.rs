//! Relaxed reachability: runs the rules until they derive nothing new.
//!
//! Semi-naive, a tuple at a time: each new tuple sets off the rules that mention its relation and is joined with the
//! tuples before it through indexes, so that an instance of a rule is found once, when its youngest atom arrives. Price:
//! proportional to the partial joins, which the order chosen in `plan` keeps small.

use std::sync::Arc;

use super::limits::{LimitError, Watch};
use super::normal::{Normal, Pattern, Quantified, Slot};
use super::plan::{Age, Column, Plan, Planner, Step};
use super::program::{Filter, Program, Rule};
use super::relation::Relation;

/// How many steps pass between two looks at the clock.
const STEPS_PER_CHECK: u32 = 1 << 14;

/// What a relation counts towards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Facts,
    Operators,
    Other,
}

/// The state of the computation.
pub(super) struct Reach {
    pub relations: Vec<Relation>,
    growing: Vec<bool>,
    kinds: Vec<Kind>,
    rules: Arc<[Rule]>,
    plans: Arc<[Plan]>,
    /// The plans that each relation's tuples set off.
    triggers: Vec<Vec<usize>>,
    /// The relations of the tuples that arrived, in order.
    queue: Vec<u32>,
    /// Instances (rule, binding) whose tests have not come true yet.
    pending: Vec<(usize, Box<[u32]>)>,
    counts: [usize; 3],
    /// Room for the values of any rule's variables.
    binding: Vec<u32>,
    /// Room for a key.
    scratch: Vec<u32>,
    steps: u32,
    watch: Watch,
}

impl Reach {
    /// Prepares a run from the tuples that hold at the start.
    pub fn new(program: Program, kinds: Vec<Kind>, start: &[(usize, Vec<u32>)], watch: Watch) -> Self {
        let variables = program.rules.iter().map(|rule| rule.scope.len()).max().unwrap_or(0);
        let relations = program.arities.iter().map(|&arity| Relation::new(arity)).collect();
        let mut reach = Self {
            relations,
            triggers: vec![Vec::new(); program.arities.len()],
            growing: program.growing,
            kinds,
            rules: program.rules.into(),
            plans: Arc::new([]),
            queue: Vec::new(),
            pending: Vec::new(),
            counts: [0; 3],
            binding: vec![0; variables],
            scratch: Vec::new(),
            steps: 0,
            watch,
        };
        for (relation, tuple) in start {
            reach.relations[*relation].tuples.insert(tuple);
        }
        reach.make_plans();
        reach
    }

    /// A plan for each growing atom of each rule, or one for the start where a rule has none.
    fn make_plans(&mut self) {
        let mut plans = Vec::new();
        for (number, rule) in self.rules.iter().enumerate() {
            let growing = (0..rule.body.len()).filter(|&atom| self.growing[rule.body[atom].relation]);
            let mut triggers: Vec<Option<usize>> = growing.map(Some).collect();
            if triggers.is_empty() {
                triggers.push(None);
            }
            for trigger in triggers {
                if let Some(atom) = trigger {
                    self.triggers[rule.body[atom].relation].push(plans.len());
                }
                plans.push(Planner::new(rule, &mut self.relations, &self.growing).plan(number, trigger));
            }
        }
        self.plans = plans.into();
    }

    /// Runs to the end.
    ///
    /// # Errors
    /// When a limit is reached.
    pub fn run(&mut self) -> Result<(), LimitError> {
        self.admit_fixed();
        self.enqueue_start();
        self.run_startless()?;
        let mut next = 0;
        loop {
            while next < self.queue.len() {
                let relation = self.queue[next] as usize;
                next += 1;
                self.arrive(relation)?;
            }
            if !self.recheck()? {
                return self.check();
            }
        }
    }

    fn admit_fixed(&mut self) {
        for (relation, _) in self.relations.iter_mut().zip(&self.growing).filter(|(_, growing)| !**growing) {
            for _ in 0..relation.tuples.len() {
                relation.admit(&mut self.scratch);
            }
        }
    }

    fn enqueue_start(&mut self) {
        for relation in 0..self.relations.len() {
            let rows = self.relations[relation].tuples.len();
            self.counts[self.kinds[relation] as usize] += rows;
            if self.growing[relation] {
                self.queue.extend(std::iter::repeat_n(relation as u32, rows));
            }
        }
    }

    fn run_startless(&mut self) -> Result<(), LimitError> {
        let plans = Arc::clone(&self.plans);
        for plan in plans.iter() {
            let rule = &self.rules[plan.rule];
            if !rule.body.iter().any(|atom| self.growing[atom.relation]) {
                let mut binding = self.binding.clone();
                self.extend(plan, &plan.steps, &mut binding)?;
            }
        }
        Ok(())
    }

    /// Lets the next row of the relation take part in joins, and joins it.
    fn arrive(&mut self, relation: usize) -> Result<(), LimitError> {
        let row = self.relations[relation].admit(&mut self.scratch);
        let plans = Arc::clone(&self.plans);
        let mut binding = std::mem::take(&mut self.binding);
        for nth in 0..self.triggers[relation].len() {
            let plan = &plans[self.triggers[relation][nth]];
            let is_ready = plan.needs.iter().all(|&relation| self.relations[relation].admitted > 0);
            if is_ready && self.matches(plan, relation, row, &plan.trigger, &mut binding) {
                self.extend(plan, &plan.steps, &mut binding)?;
            }
        }
        self.binding = binding;
        Ok(())
    }

    /// Binds the columns of a row; false where they do not fit.
    fn matches(&self, plan: &Plan, relation: usize, row: usize, columns: &[Column], binding: &mut [u32]) -> bool {
        let tuple = self.relations[relation].tuples.row(row);
        let scope = &self.rules[plan.rule].scope;
        columns.iter().all(|column| match *column {
            Column::Bind(column, variable) => {
                binding[variable] = tuple[column];
                scope[variable].contains(tuple[column])
            }
            Column::Equal(column, slot) => slot.value(binding) == tuple[column],
        })
    }

    /// Takes the remaining steps of a join in every possible way.
    fn extend(&mut self, plan: &Plan, steps: &[Step], binding: &mut [u32]) -> Result<(), LimitError> {
        self.tick()?;
        let Some((step, rest)) = steps.split_first() else { return self.finish(plan.rule, binding) };
        match step {
            Step::Join { relation, index, key, columns, age } => {
                let find = |key: &[u32]| self.relations[*relation].group(*index, key);
                let Some(group) = with_tuple(key, binding, find) else { return Ok(()) };
                let end = self.end(*relation, *age);
                let mut nth = 0;
                while let Some(row) = self.relations[*relation].member(*index, group, nth).filter(|&row| row < end) {
                    nth += 1;
                    if self.matches(plan, *relation, row, columns, binding) {
                        self.extend(plan, rest, binding)?;
                    }
                }
                Ok(())
            }
            Step::Enumerate(variable, candidates) => candidates.list.iter().try_for_each(|&object| {
                binding[*variable] = object;
                self.extend(plan, rest, binding)
            }),
            _ if self.passes(plan, step, binding) => self.extend(plan, rest, binding),
            _ => Ok(()),
        }
    }

    /// Whether a step that binds nothing lets the binding through.
    fn passes(&self, plan: &Plan, step: &Step, binding: &[u32]) -> bool {
        match step {
            Step::Member { relation, key, age } => {
                self.find(*relation, key, binding).is_some_and(|row| row < self.end(*relation, *age))
            }
            Step::Check(filter) => self.filter(filter, binding),
            Step::NewHead => {
                let head = &self.rules[plan.rule].head;
                self.find(head.relation, &head.slots, binding).is_none()
            }
            Step::Join { .. } | Step::Enumerate(..) => true,
        }
    }

    /// One past the last row that a step may use.
    fn end(&self, relation: usize, age: Age) -> usize {
        self.relations[relation].admitted - usize::from(age == Age::Older)
    }

    fn find(&self, relation: usize, slots: &[Slot], binding: &[u32]) -> Option<usize> {
        with_tuple(slots, binding, |tuple| self.relations[relation].tuples.find(tuple))
    }

    fn filter(&self, filter: &Filter, binding: &[u32]) -> bool {
        match filter {
            Filter::Equal(left, right, wanted) => (left.value(binding) == right.value(binding)) == *wanted,
            Filter::Absent(pattern) => self.find(pattern.relation, &pattern.slots, binding).is_none(),
        }
    }

    /// Derives the head of a rule whose body holds, or puts it off until its tests hold.
    fn finish(&mut self, rule: usize, binding: &[u32]) -> Result<(), LimitError> {
        let rules = Arc::clone(&self.rules);
        if let Some(test) = self.failing_test(&rules[rule], binding)? {
            if self.may_come_true(test) {
                self.pending.push((rule, binding.into()));
            }
            return Ok(());
        }
        self.derive(&rules[rule].head, binding)
    }

    fn derive(&mut self, head: &Pattern, binding: &[u32]) -> Result<(), LimitError> {
        let relation = head.relation;
        let (_, is_new) = with_tuple(&head.slots, binding, |tuple| self.relations[relation].tuples.insert(tuple));
        if is_new {
            self.queue.push(relation as u32);
            self.counts[self.kinds[relation] as usize] += 1;
            self.watch.facts(self.counts[Kind::Facts as usize])?;
            self.watch.operators(self.counts[Kind::Operators as usize])?;
        }
        Ok(())
    }

    /// Looks again at the instances that were put off; true if some could be derived.
    fn recheck(&mut self) -> Result<bool, LimitError> {
        let rules = Arc::clone(&self.rules);
        let waiting = std::mem::take(&mut self.pending);
        let before = waiting.len();
        for (rule, binding) in waiting {
            match self.failing_test(&rules[rule], &binding)? {
                None => self.derive(&rules[rule].head, &binding)?,
                Some(_) => self.pending.push((rule, binding)),
            }
        }
        Ok(self.pending.len() < before)
    }

    /// The first test of the rule that is not possible yet.
    fn failing_test<'r>(&mut self, rule: &'r Rule, binding: &[u32]) -> Result<Option<&'r Normal>, LimitError> {
        let mut binding = if rule.tests.is_empty() { Vec::new() } else { binding.to_vec() };
        for test in &rule.tests {
            if !self.possible(test, &mut binding)? {
                return Ok(Some(test));
            }
        }
        Ok(None)
    }

    /// Whether the condition may become possible later, though it is not now.
    fn may_come_true(&self, test: &Normal) -> bool {
        let mut grows = false;
        test.literals(&mut |pattern, wanted| grows |= wanted && self.growing[pattern.relation]);
        grows
    }

    /// Whether the condition can be true as far as is known now. Conditions that can become false count as false-able.
    fn possible(&mut self, condition: &Normal, binding: &mut Vec<u32>) -> Result<bool, LimitError> {
        self.tick()?;
        match condition {
            Normal::Literal(pattern, true) => Ok(self.find(pattern.relation, &pattern.slots, binding).is_some()),
            Normal::Literal(pattern, false) => {
                Ok(self.growing[pattern.relation] || self.find(pattern.relation, &pattern.slots, binding).is_none())
            }
            Normal::Equal(left, right, wanted) => Ok((left.value(binding) == right.value(binding)) == *wanted),
            Normal::And(parts) => self.possible_for(parts, false, binding),
            Normal::Or(parts) => self.possible_for(parts, true, binding),
            Normal::Forall(inner) => self.possible_under(inner, false, binding),
            Normal::Exists(inner) => self.possible_under(inner, true, binding),
        }
    }

    /// Whether some part (`sought`: a possible one; else: an impossible one) decides; gives what that decides.
    fn possible_for(&mut self, parts: &[Normal], sought: bool, binding: &mut Vec<u32>) -> Result<bool, LimitError> {
        for part in parts {
            if self.possible(part, binding)? == sought {
                return Ok(sought);
            }
        }
        Ok(!sought)
    }

    /// The same over the bindings of a quantifier.
    fn possible_under(&mut self, inner: &Quantified, sought: bool, binding: &mut Vec<u32>) -> Result<bool, LimitError> {
        if !inner.is_inhabited() {
            return Ok(!sought);
        }
        self.possible_from(inner, 0, sought, binding)
    }

    fn possible_from(
        &mut self,
        inner: &Quantified,
        at: usize,
        sought: bool,
        binding: &mut Vec<u32>,
    ) -> Result<bool, LimitError> {
        if at == inner.ranges.len() {
            return self.possible(&inner.body, binding);
        }
        binding.resize(binding.len().max(inner.first + at + 1), 0);
        for &object in inner.ranges[at].list.iter() {
            binding[inner.first + at] = object;
            if self.possible_from(inner, at + 1, sought, binding)? == sought {
                return Ok(sought);
            }
        }
        Ok(!sought)
    }

    fn tick(&mut self) -> Result<(), LimitError> {
        self.steps += 1;
        if self.steps < STEPS_PER_CHECK {
            return Ok(());
        }
        self.steps = 0;
        self.check()
    }

    fn check(&self) -> Result<(), LimitError> {
        self.watch.check()?;
        self.watch.bytes(self.bytes())
    }

    /// Bytes held, approximately.
    pub fn bytes(&self) -> usize {
        let tables: usize = self.relations.iter().map(Relation::bytes).sum();
        tables + 4 * self.queue.capacity() + 64 * self.pending.len()
    }
}

/// Calls `read` with the tuple that the slots stand for, without allocating for the usual arities.
pub(super) fn with_tuple<T>(slots: &[Slot], binding: &[u32], read: impl FnOnce(&[u32]) -> T) -> T {
    let mut short = [0; 8];
    if slots.len() > short.len() {
        return read(&slots.iter().map(|slot| slot.value(binding)).collect::<Vec<_>>());
    }
    for (column, slot) in short.iter_mut().zip(slots) {
        *column = slot.value(binding);
    }
    read(&short[..slots.len()])
}
