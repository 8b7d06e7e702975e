//! Some plan, soon: greedy best-first search for tasks whose states cannot all be seen, and plans made shorter.
//!
//! States are opened in the order of how far the goal seemed from where they were come upon (lazily: a state is
//! estimated when it is opened, not when it is found), operators of the relaxed plan before others. What is found is a
//! plan, with no claim to be a shortest one. Deterministic. Price: one estimate a state, and all opened states in memory.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rustc_hash::FxHashSet;

use super::SuccessorGenerator;
use super::relaxation::{Estimate, Relaxation};
use crate::task::{GroundCondition, OperatorId, State, Task};

/// A state that was opened, and how it was come upon.
struct Node {
    state: State,
    parent: usize,
    operator: OperatorId,
}

/// What is opened next: (distance that the parent seemed to have, whether the operator is not preferred, age), parent
/// and operator.
type Entry = Reverse<((usize, bool, usize), usize, OperatorId)>;

struct Search<'t> {
    generator: &'t SuccessorGenerator,
    relaxation: Relaxation,
    nodes: Vec<Node>,
    open: BinaryHeap<Entry>,
    seen: FxHashSet<State>,
    found: usize,
}

/// A plan that leads from the task's initial state to the goal, which need not be the task's own; `None` where about
/// `most` opened states do not lead there, or nothing does.
///
/// ```
/// use std::sync::Arc;
/// use strips_core::{pddl::{Source, parse_domain, parse_problem}, search, task::{Limits, ground}};
/// let domain = "(define (domain lamps) (:predicates (lit ?x)) (:action light :parameters (?x) :effect (lit ?x)))";
/// let problem = "(define (problem p) (:domain lamps) (:objects a b c) (:init) (:goal (and (lit a) (lit c))))";
/// let domain = Arc::new(parse_domain(&Source::new("d", domain))?);
/// let problem = Arc::new(parse_problem(&Source::new("p", problem), &domain, None)?);
/// let task = ground(domain, problem, &Limits::default())?;
/// let generator = search::SuccessorGenerator::new(&task);
/// assert_eq!(search::greedy_plan(&task, &generator, &task.goal, 100).map(|plan| plan.len()), Some(2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn greedy_plan(
    task: &Task,
    generator: &SuccessorGenerator,
    goal: &GroundCondition,
    most: usize,
) -> Option<Vec<OperatorId>> {
    if goal.holds(&task.init) {
        return Some(Vec::new());
    }
    let mut search = Search {
        generator,
        relaxation: Relaxation::new(task, goal),
        nodes: Vec::new(),
        open: BinaryHeap::new(),
        seen: FxHashSet::from_iter([task.init.clone()]),
        found: 0,
    };
    search.expand(Node { state: task.init.clone(), parent: 0, operator: OperatorId(0) });
    while search.nodes.len() < most {
        let Reverse((_, parent, operator)) = search.open.pop()?;
        let state = generator.successor(&search.nodes[parent].state, operator);
        if !search.seen.insert(state.clone()) {
            continue;
        }
        let node = Node { state, parent, operator };
        if goal.holds(&node.state) {
            return Some(search.plan(&node));
        }
        search.expand(node);
    }
    None
}

impl Search<'_> {
    /// Opens a state: all its operators wait, with the distance that the goal seems to have from here.
    fn expand(&mut self, node: Node) {
        if let Some(Estimate { steps, preferred }) = self.relaxation.estimate(&node.state) {
            for operator in self.generator.applicable(&node.state) {
                let key = (steps, preferred.binary_search(&operator).is_err(), self.found);
                self.open.push(Reverse((key, self.nodes.len(), operator)));
                self.found += 1;
            }
        }
        self.nodes.push(node);
    }

    /// The operators that lead to the node; the first node is the initial state.
    fn plan(&self, last: &Node) -> Vec<OperatorId> {
        let (mut plan, mut parent) = (vec![last.operator], last.parent);
        while parent != 0 {
            plan.push(self.nodes[parent].operator);
            parent = self.nodes[parent].parent;
        }
        plan.reverse();
        plan
    }
}

/// The plan without its detours: no state twice, and no step that can be left out together with those that need it
/// (action elimination, Nakhost and Müller 2010).
///
/// # Panics
/// When the plan is not one from the task's initial state to the goal.
pub fn without_detours(
    task: &Task,
    generator: &SuccessorGenerator,
    goal: &GroundCondition,
    plan: &[OperatorId],
) -> Vec<OperatorId> {
    let mut plan = without_loops(task, generator, plan);
    let mut at = 0;
    while at < plan.len() {
        match without_step(task, generator, goal, &plan, at) {
            // A step that was needed before need not be any more.
            Some(shorter) => (plan, at) = (without_loops(task, generator, &shorter), 0),
            None => at += 1,
        }
    }
    plan
}

fn without_loops(task: &Task, generator: &SuccessorGenerator, plan: &[OperatorId]) -> Vec<OperatorId> {
    let (mut states, mut kept) = (vec![task.init.clone()], Vec::new());
    for &operator in plan {
        let last = states.last().expect("the initial state is there");
        assert!(task.operators[operator.index()].applicable(last), "the plan can be executed");
        let next = generator.successor(last, operator);
        if let Some(before) = states.iter().position(|state| *state == next) {
            states.truncate(before + 1);
            kept.truncate(before);
        } else {
            states.push(next);
            kept.push(operator);
        }
    }
    kept
}

/// The plan without the step at `left_out` and the later ones that then cannot be applied, if it still reaches the goal.
fn without_step(
    task: &Task,
    generator: &SuccessorGenerator,
    goal: &GroundCondition,
    plan: &[OperatorId],
    left_out: usize,
) -> Option<Vec<OperatorId>> {
    let (mut state, mut kept) = (task.init.clone(), Vec::new());
    for (at, &operator) in plan.iter().enumerate() {
        if at != left_out && task.operators[operator.index()].applicable(&state) {
            state = generator.successor(&state, operator);
            kept.push(operator);
        }
    }
    goal.holds(&state).then_some(kept)
}
