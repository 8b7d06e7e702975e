//! The ways in which a completion is made wrong.

use super::check::{Fault, Goal, check};
use super::{Step, trace};
use crate::pddl::ast::ObjectId;
use crate::random::Random;
use crate::task::{Fact, OperatorId, Task};

/// How many tries one kind gets, and how many kinds are drawn, before the plainest one ends the search.
const TRIES: usize = 6;

/// A way to make a completion wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Corruption {
    /// The actions permuted, the states as they were (the report's).
    ShuffleActions,
    /// The states permuted, the actions as they were (the report's).
    ShuffleStates,
    /// Both permuted, each in its own way (the report's).
    ShuffleBoth,
    /// One step left out.
    DropStep,
    /// One step done twice.
    RepeatStep,
    /// Two steps exchanged.
    SwapSteps,
    /// One argument replaced by another object of the problem.
    WrongArgument,
    /// One atom taken from one state.
    MissingAtom,
    /// One atom put into one state.
    InventedAtom,
    /// An applicable plan for another goal, with its true states.
    OtherGoal,
    /// The plan stops early.
    Prefix,
}

impl Corruption {
    /// Every kind, in the order of the configuration's weights.
    pub const ALL: [Corruption; 11] = [
        Self::ShuffleActions,
        Self::ShuffleStates,
        Self::ShuffleBoth,
        Self::DropStep,
        Self::RepeatStep,
        Self::SwapSteps,
        Self::WrongArgument,
        Self::MissingAtom,
        Self::InventedAtom,
        Self::OtherGoal,
        Self::Prefix,
    ];

    /// The kind's name in configurations and data sets.
    pub fn name(self) -> &'static str {
        match self {
            Self::ShuffleActions => "shuffle-actions",
            Self::ShuffleStates => "shuffle-states",
            Self::ShuffleBoth => "shuffle-both",
            Self::DropStep => "drop-step",
            Self::RepeatStep => "repeat-step",
            Self::SwapSteps => "swap-steps",
            Self::WrongArgument => "wrong-argument",
            Self::MissingAtom => "missing-atom",
            Self::InventedAtom => "invented-atom",
            Self::OtherGoal => "other-goal",
            Self::Prefix => "prefix",
        }
    }
}

/// A completion that is proven wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Negative<'t> {
    /// How it was made.
    pub kind: Corruption,
    /// Its steps.
    pub steps: Vec<Step<'t>>,
    /// What is wrong with it.
    pub fault: Fault,
    /// How many corruptions turned out right or could not be made before this one.
    pub redrawn: usize,
}

/// Draws a negative for the positive `steps`, which must not be empty, its kind by `weights` (as in [`Corruption::ALL`]).
///
/// Where the drawn kind cannot be made wrong (one step cannot be permuted) another is drawn.
///
/// # Panics
/// When no weight is positive.
pub fn draw_negative<'t>(
    task: &'t Task,
    goal: &Goal,
    steps: &[Step<'t>],
    weights: &[f64],
    random: &mut Random,
) -> Negative<'t> {
    let mut redrawn = 0;
    for _ in 0..TRIES {
        let kind = Corruption::ALL[random.weighted(weights)];
        for _ in 0..TRIES {
            let corrupted = corrupt(kind, task, steps, random);
            let found = corrupted.and_then(|steps| Some((check(task, goal, &steps)?, steps)));
            if let Some((fault, steps)) = found {
                return Negative { kind, steps, fault, redrawn };
            }
            redrawn += 1;
        }
    }
    missing_last_state(task, goal, steps, redrawn)
}

/// The corruption that always succeeds: the last step's state without an atom, or the plan without its last step.
fn missing_last_state<'t>(task: &'t Task, goal: &Goal, steps: &[Step<'t>], redrawn: usize) -> Negative<'t> {
    let prefix = steps[..steps.len() - 1].to_vec();
    if let Some(fault) = check(task, goal, &prefix) {
        return Negative { kind: Corruption::Prefix, steps: prefix, fault, redrawn };
    }
    let mut steps = steps.to_vec();
    let last = steps.last_mut().expect("a positive has a step");
    last.state.pop();
    let fault = check(task, goal, &steps).expect("the state lacks an atom");
    Negative { kind: Corruption::MissingAtom, steps, fault, redrawn }
}

/// The steps made wrong, or none where this kind cannot be made of them.
fn corrupt<'t>(kind: Corruption, task: &'t Task, steps: &[Step<'t>], random: &mut Random) -> Option<Vec<Step<'t>>> {
    match kind {
        Corruption::ShuffleActions => shuffled(steps, true, false, random),
        Corruption::ShuffleStates => shuffled(steps, false, true, random),
        Corruption::ShuffleBoth => shuffled(steps, true, true, random),
        Corruption::DropStep => Some(drop_step(steps, random)),
        Corruption::RepeatStep => Some(repeat_step(steps, random)),
        Corruption::SwapSteps => swap_steps(steps, random),
        Corruption::WrongArgument => wrong_argument(task, steps, random),
        Corruption::MissingAtom => missing_atom(steps, random),
        Corruption::InventedAtom => invented_atom(task, steps, random),
        Corruption::OtherGoal => other_goal(task, steps.len(), random),
        Corruption::Prefix => Some(steps[..random.below(steps.len())].to_vec()),
    }
}

fn shuffled<'t>(steps: &[Step<'t>], actions: bool, states: bool, random: &mut Random) -> Option<Vec<Step<'t>>> {
    let permutation = |moved: bool, random: &mut Random| {
        let mut order: Vec<usize> = (0..steps.len()).collect();
        if moved {
            random.shuffle(&mut order);
        }
        order
    };
    let (of_action, of_state) = (permutation(actions, random), permutation(states, random));
    let step = |(&action, &state): (&usize, &usize)| Step {
        action: steps[action].action,
        args: steps[action].args.clone(),
        state: steps[state].state.clone(),
    };
    (steps.len() > 1).then(|| of_action.iter().zip(&of_state).map(step).collect())
}

fn drop_step<'t>(steps: &[Step<'t>], random: &mut Random) -> Vec<Step<'t>> {
    let mut steps = steps.to_vec();
    steps.remove(random.below(steps.len()));
    steps
}

fn repeat_step<'t>(steps: &[Step<'t>], random: &mut Random) -> Vec<Step<'t>> {
    let mut steps = steps.to_vec();
    let at = random.below(steps.len());
    steps.insert(at, steps[at].clone());
    steps
}

fn swap_steps<'t>(steps: &[Step<'t>], random: &mut Random) -> Option<Vec<Step<'t>>> {
    if steps.len() < 2 {
        return None;
    }
    let first = random.below(steps.len() - 1);
    let second = first + 1 + random.below(steps.len() - 1 - first);
    let mut steps = steps.to_vec();
    steps.swap(first, second);
    Some(steps)
}

fn wrong_argument<'t>(task: &'t Task, steps: &[Step<'t>], random: &mut Random) -> Option<Vec<Step<'t>>> {
    let mut steps = steps.to_vec();
    let at = random.below(steps.len());
    if steps[at].args.is_empty() || task.problem.objects.len() < 2 {
        return None;
    }
    let place = random.below(steps[at].args.len());
    let other = random.below(task.problem.objects.len() - 1);
    let old = steps[at].args[place].index();
    steps[at].args.to_mut()[place] = ObjectId::from(other + usize::from(other >= old));
    Some(steps)
}

fn missing_atom<'t>(steps: &[Step<'t>], random: &mut Random) -> Option<Vec<Step<'t>>> {
    let mut steps = steps.to_vec();
    let at = random.below(steps.len());
    let state = &mut steps[at].state;
    if state.is_empty() {
        return None;
    }
    state.remove(random.below(state.len()));
    Some(steps)
}

fn invented_atom<'t>(task: &'t Task, steps: &[Step<'t>], random: &mut Random) -> Option<Vec<Step<'t>>> {
    let mut steps = steps.to_vec();
    let at = random.below(steps.len());
    if task.facts.is_empty() {
        return None;
    }
    let fact: &'t Fact = random.choice(&task.facts);
    let basic = !task.domain.predicates[fact.predicate.index()].derived;
    let place = steps[at].state.binary_search(&fact).err().filter(|_| basic)?;
    steps[at].state.insert(place, fact);
    Some(steps)
}

/// A random walk, about as long as the plan, that undoes nothing at once.
fn other_goal<'t>(task: &'t Task, length: usize, random: &mut Random) -> Option<Vec<Step<'t>>> {
    let length = 1.max(length + random.below(3) - 1);
    let (mut state, mut before, mut plan) = (task.init.clone(), task.init.clone(), Vec::new());
    for _ in 0..length {
        let open = |&id: &usize| task.operators[id].applicable(&state);
        let applicable: Vec<usize> = (0..task.operators.len()).filter(open).collect();
        if applicable.is_empty() {
            return None;
        }
        let chosen = *random.choice(&applicable);
        let next = task.apply(&task.operators[chosen], &state);
        if next == before && applicable.len() > 1 {
            continue;
        }
        before = std::mem::replace(&mut state, next);
        plan.push(OperatorId::from(chosen));
    }
    (!plan.is_empty()).then(|| trace(task, &plan).0)
}
