//! Grounding: a domain and a problem become a [`Task`].
//!
//! In three passes. `reach` finds which operators and atoms can be reached when deletes and negation are ignored
//! (negated atoms that nothing changes are taken exactly); `facts` tells those that can change from those that cannot;
//! and here every operator's conditions are folded against them. Only operators whose precondition is thereby known to be
//! false in every reachable state are left out, so each that is applicable in some reachable state is there.
//!
//! Price: the first pass is proportional to the joins' partial results, the others to the size of the task.
//! Source of the idea: Helmert, Concise finite-domain representations for PDDL planning tasks (2009).

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::cost::Costs;
use super::facts::Facts;
use super::lifted::{Lifted, LiftedAction};
use super::limits::{LimitError, Limits, Watch};
use super::normal::{LiftedEffect, Pattern};
use super::reach::{Kind, Reach};
use super::relation::{Relation, TupleSet};
use super::simplify::{Frame, Simplifier, Status};
use super::{AxiomLayers, FactId, Formula, GroundCondition, GroundEffect, Operator, State, Task};
use crate::pddl::ast::{ActionId, Domain, ObjectId, Problem};

/// How many operators one thread takes at a time.
const CHUNK: usize = 1024;

/// Grounds a problem.
///
/// # Errors
/// When a limit is reached; no more memory than [`Limits::bytes`] is used, by estimate.
pub fn ground(domain: Arc<Domain>, problem: Arc<Problem>, limits: &Limits) -> Result<Task, LimitError> {
    let watch = limits.start();
    let mut lifted = Lifted::new(&domain, &problem);
    let start = start(&domain, &problem);
    let reach = reach(&mut lifted, &start, &watch)?;
    let initial = initial_rows(&start, domain.predicates.len());
    let bytes = AtomicUsize::new(reach.bytes());
    let facts = Facts::new(&domain, &lifted, &reach.relations, &initial, (&watch, &bytes))?;
    let grounder = Grounder {
        lifted: &lifted,
        relations: &reach.relations,
        simplifier: Simplifier { relations: &reach.relations, status: &facts.status, watch: &watch, bytes: &bytes },
        costs: Costs::new(&domain, &problem),
        watch: &watch,
    };
    let operators = grounder.operators()?.into();
    let axioms = grounder.axioms(&domain)?;
    let goal = grounder.goal()?;
    let static_facts = facts.constant(&domain, &reach.relations);
    let init = grounder.init(&initial, facts.facts.len());
    let mut task = Task { domain, problem, facts: facts.facts, static_facts, init, goal, operators, axioms };
    let mut init = task.init.clone();
    task.derive(&mut init);
    task.init = init;
    Ok(task)
}

/// The atoms that hold at the start, by relation. Derived ones are left to their axioms.
fn start(domain: &Domain, problem: &Problem) -> Vec<(usize, Vec<u32>)> {
    let basic = problem.init.iter().filter(|atom| !domain.predicates[atom.predicate.index()].derived);
    basic.map(|atom| (atom.predicate.index(), atom.args.iter().map(|object| object.0).collect())).collect()
}

/// Runs the rules from the initial state.
fn reach(lifted: &mut Lifted, start: &[(usize, Vec<u32>)], watch: &Watch) -> Result<Reach, LimitError> {
    let kinds: Vec<Kind> = lifted.kinds();
    let program = std::mem::take(&mut lifted.program);
    let mut reach = Reach::new(program, kinds, start, watch.clone());
    reach.run()?;
    Ok(reach)
}

/// How many different atoms of each predicate hold at the start; their rows come first.
fn initial_rows(start: &[(usize, Vec<u32>)], predicates: usize) -> Vec<usize> {
    let distinct: rustc_hash::FxHashSet<_> = start.iter().collect();
    let mut rows = vec![0; predicates];
    for (predicate, _) in distinct {
        rows[*predicate] += 1;
    }
    rows
}

/// Turns instances into operators, axioms and the goal.
struct Grounder<'a> {
    lifted: &'a Lifted,
    relations: &'a [Relation],
    simplifier: Simplifier<'a>,
    costs: Costs<'a>,
    watch: &'a Watch,
}

impl Grounder<'_> {
    fn operators(&self) -> Result<Vec<Operator>, LimitError> {
        let mut operators = Vec::new();
        for number in 0..self.lifted.actions.len() {
            operators.append(&mut self.operators_of(number)?);
        }
        Ok(operators)
    }

    /// The operators of one action, ascending by arguments.
    fn operators_of(&self, number: usize) -> Result<Vec<Operator>, LimitError> {
        let action = &self.lifted.actions[number];
        let table = &self.relations[action.relation].tuples;
        let rows = sorted_rows(table);
        let effects: Vec<(&LiftedEffect, &TupleSet, Vec<u32>)> = action
            .conditional_effects
            .iter()
            .map(|(relation, effect)| (effect, &self.relations[*relation].tuples))
            .map(|(effect, instances)| (effect, instances, sorted_rows(instances)))
            .collect();
        let chunk = |rows: &[u32]| -> Result<Vec<Operator>, LimitError> {
            self.watch.check()?;
            let ground = |&row: &u32| {
                let operator = self.operator(number, action, table.row(row as usize), &effects)?;
                self.hold(operator.as_ref().map_or(0, bytes_of))?;
                Ok(operator)
            };
            rows.iter().filter_map(|row| ground(row).transpose()).collect()
        };
        let chunks: Vec<Vec<Operator>> = if rows.len() > CHUNK {
            rows.par_chunks(CHUNK).map(chunk).collect::<Result<_, _>>()?
        } else {
            vec![chunk(&rows)?]
        };
        Ok(chunks.into_iter().flatten().collect())
    }

    /// Counts bytes of the task.
    fn hold(&self, bytes: usize) -> Result<(), LimitError> {
        self.watch.bytes(self.simplifier.bytes.fetch_add(bytes, Ordering::Relaxed) + bytes)
    }

    /// The operator with these arguments, unless its precondition is never true.
    fn operator(
        &self,
        number: usize,
        action: &LiftedAction,
        args: &[u32],
        conditional: &[(&LiftedEffect, &TupleSet, Vec<u32>)],
    ) -> Result<Option<Operator>, LimitError> {
        let Some(precondition) = self.simplifier.conjunction(&action.precondition, &mut Frame::new(args))? else {
            return Ok(None);
        };
        let mut always = GroundEffect::default();
        self.collect(&action.effect, args, &mut always);
        let mut effects = Vec::new();
        for (effect, instances, rows) in conditional {
            for row in with_prefix(instances, rows, args) {
                self.add_conditional(effect, row, &mut always, &mut effects)?;
            }
        }
        tidy(&mut always);
        if effects.is_empty() || !changes_nothing(&always) {
            effects.insert(0, always);
        }
        Ok(Some(Operator {
            action: ActionId::from(number),
            args: args.iter().map(|&object| ObjectId(object)).collect(),
            precondition,
            effects,
            cost: self.costs.of(number, args),
        }))
    }

    /// Adds an instance of a conditional effect: to `always` if its condition holds whenever the operator applies.
    fn add_conditional(
        &self,
        effect: &LiftedEffect,
        row: &[u32],
        always: &mut GroundEffect,
        effects: &mut Vec<GroundEffect>,
    ) -> Result<(), LimitError> {
        let Some(condition) = self.simplifier.conjunction(&effect.condition, &mut Frame::new(row))? else {
            return Ok(());
        };
        if condition.is_empty() {
            self.collect(effect, row, always);
            return Ok(());
        }
        let mut ground = GroundEffect { condition, ..GroundEffect::default() };
        self.collect(effect, row, &mut ground);
        tidy(&mut ground);
        if !changes_nothing(&ground) {
            effects.push(ground);
        }
        Ok(())
    }

    /// Adds the facts that the effect changes under the binding.
    fn collect(&self, effect: &LiftedEffect, binding: &[u32], ground: &mut GroundEffect) {
        let fact = |atom: &Pattern| match self.simplifier.status(atom, binding) {
            Status::Fact(fact) => Some(fact),
            Status::True | Status::False => None,
        };
        ground.add_effects.extend(effect.add_effects.iter().filter_map(fact));
        ground.del_effects.extend(effect.del_effects.iter().filter_map(fact));
    }

    fn goal(&self) -> Result<GroundCondition, LimitError> {
        let goal = self.simplifier.conjunction(std::slice::from_ref(&self.lifted.goal), &mut Frame::new(&[]))?;
        let never = || GroundCondition { clauses: vec![Formula::Or(Vec::new())], ..GroundCondition::default() };
        Ok(goal.unwrap_or_else(never))
    }

    fn axioms(&self, domain: &Domain) -> Result<AxiomLayers, LimitError> {
        if self.lifted.axioms.is_empty() {
            return Ok(AxiomLayers::default());
        }
        let highest = self.lifted.strata.iter().copied().max().unwrap_or(0);
        let mut layers = vec![Vec::new(); highest + 1];
        for axiom in &self.lifted.axioms {
            let table = &self.relations[axiom.relation].tuples;
            for row in sorted_rows(table) {
                let binding = table.row(row as usize);
                let Status::Fact(head) = self.simplifier.status(&axiom.head, binding) else { continue };
                if let Some(body) = self.simplifier.conjunction(&axiom.condition, &mut Frame::new(binding))? {
                    layers[self.lifted.strata[axiom.head.relation]].extend(alternatives(head, body));
                }
            }
        }
        layers.retain(|layer| !layer.is_empty());
        Ok(AxiomLayers { derived: self.derived(domain), layers })
    }

    fn derived(&self, domain: &Domain) -> Vec<FactId> {
        let predicates = (0..domain.predicates.len()).filter(|&predicate| domain.predicates[predicate].derived);
        let mut derived: Vec<FactId> = predicates
            .flat_map(|predicate| &self.simplifier.status[predicate])
            .filter_map(|status| if let Status::Fact(fact) = status { Some(*fact) } else { None })
            .collect();
        derived.sort_unstable();
        derived
    }

    /// The initial state, before axioms.
    fn init(&self, initial: &[usize], facts: usize) -> State {
        let mut init = State::empty(facts);
        for (status, &rows) in self.simplifier.status.iter().zip(initial) {
            for status in &status[..rows] {
                if let Status::Fact(fact) = status {
                    init.set(*fact, true);
                }
            }
        }
        init
    }
}

/// The rows in the order of their tuples.
fn sorted_rows(table: &TupleSet) -> Vec<u32> {
    let mut rows: Vec<u32> = (0..table.len() as u32).collect();
    rows.sort_unstable_by_key(|&row| table.row(row as usize));
    rows
}

/// Those of the sorted rows whose tuples begin with `prefix`.
fn with_prefix<'a>(table: &'a TupleSet, rows: &'a [u32], prefix: &'a [u32]) -> impl Iterator<Item = &'a [u32]> {
    let start = rows.partition_point(|&row| &table.row(row as usize)[..prefix.len()] < prefix);
    rows[start..].iter().map(|&row| table.row(row as usize)).take_while(move |tuple| tuple.starts_with(prefix))
}

/// One rule for each part of a body that is a single disjunction, which makes them cheaper to apply.
fn alternatives(head: FactId, body: GroundCondition) -> Vec<(FactId, GroundCondition)> {
    match body {
        GroundCondition { positive, negative, mut clauses }
            if positive.is_empty() && negative.is_empty() && clauses.len() == 1 =>
        {
            match clauses.remove(0) {
                Formula::Or(parts) => parts.into_iter().map(|part| (head, condition(part))).collect(),
                other => vec![(head, condition(other))],
            }
        }
        body => vec![(head, body)],
    }
}

/// A formula as a condition.
fn condition(formula: Formula) -> GroundCondition {
    let mut condition = GroundCondition::default();
    let parts = if let Formula::And(parts) = formula { parts } else { vec![formula] };
    for part in parts {
        match part {
            Formula::Literal(fact, true) => condition.positive.push(fact),
            Formula::Literal(fact, false) => condition.negative.push(fact),
            clause => condition.clauses.push(clause),
        }
    }
    condition.positive.sort_unstable();
    condition.negative.sort_unstable();
    condition
}

/// Puts the facts into order, each once, adds winning over deletes.
fn tidy(effect: &mut GroundEffect) {
    effect.add_effects.sort_unstable();
    effect.add_effects.dedup();
    effect.del_effects.sort_unstable();
    effect.del_effects.dedup();
    effect.del_effects.retain(|fact| effect.add_effects.binary_search(fact).is_err());
}

fn changes_nothing(effect: &GroundEffect) -> bool {
    effect.add_effects.is_empty() && effect.del_effects.is_empty()
}

/// Bytes that the operator holds, approximately.
fn bytes_of(operator: &Operator) -> usize {
    let condition = |condition: &GroundCondition| {
        let clauses: usize = condition.clauses.iter().map(bytes_of_formula).sum();
        72 + 4 * (condition.positive.len() + condition.negative.len()) + clauses
    };
    let effect = |effect: &GroundEffect| {
        48 + 4 * (effect.add_effects.len() + effect.del_effects.len()) + condition(&effect.condition)
    };
    64 + 4 * operator.args.len()
        + condition(&operator.precondition)
        + operator.effects.iter().map(effect).sum::<usize>()
}

fn bytes_of_formula(formula: &Formula) -> usize {
    match formula {
        Formula::Literal(..) => 32,
        Formula::And(parts) | Formula::Or(parts) => 32 + parts.iter().map(bytes_of_formula).sum::<usize>(),
    }
}
