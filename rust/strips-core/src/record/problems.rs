//! Making and solving problems: what templates and the random generator share.

use std::hash::BuildHasher;
use std::sync::{Arc, Mutex, PoisonError};

use rustc_hash::{FxBuildHasher, FxHashMap};

use super::config::{PlanChoice, RecordConfig};
use super::exploration::Exploration;
use super::shape::{Shape, Source};
use crate::negative::Goal;
use crate::pddl::ast::{Condition, Domain, Problem};
use crate::random::Random;
use crate::search::{PlanSet, SampleError, Semantics};
use crate::task::{Fact, LimitError, Limits, Operator, Task, ground};

/// What all problems are made with.
pub(super) struct Workshop<'c> {
    pub domain: Arc<Domain>,
    pub config: &'c RecordConfig,
    pub limits: Limits,
    pub operators: OperatorLists,
}

impl Workshop<'_> {
    /// The random numbers for one named purpose.
    pub fn random(&self, purpose: &str) -> Random {
        Random::new(self.config.seed, 0).fork(purpose)
    }
}

/// Grounds the problem with its goal left open, so that goals can be chosen after.
pub(super) fn open_task(workshop: &Workshop, mut problem: Problem) -> Result<Task, LimitError> {
    problem.goal = Condition::And(Vec::new());
    let mut task = ground(workshop.domain.clone(), Arc::new(problem), &workshop.limits)?;
    task.operators = workshop.operators.shared(&task);
    Ok(task)
}

/// The task from another initial state, its goal left open.
pub(super) fn started_from(workshop: &Workshop, task: &Task, init: Vec<Fact>) -> Result<Task, LimitError> {
    open_task(workshop, Problem { init, ..(*task.problem).clone() })
}

/// One copy of each list of operators. A data set has tens of thousands of initial states, and few sets of facts that
/// can be reached from them; a list may have megabytes.
#[derive(Default)]
pub(super) struct OperatorLists(Mutex<FxHashMap<u64, Vec<Arc<[Operator]>>>>);

impl OperatorLists {
    /// The task's operators, as another task may have them already.
    fn shared(&self, task: &Task) -> Arc<[Operator]> {
        let key = FxBuildHasher.hash_one((&task.facts, task.operators.len()));
        let mut lists = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let alike = lists.entry(key).or_default();
        if let Some(known) = alike.iter().find(|known| ***known == *task.operators) {
            return known.clone();
        }
        alike.push(task.operators.clone());
        task.operators.clone()
    }
}

/// States in one layer of an exploration, and their distance: what a goal is reached by.
pub(super) type Ends<'e> = (&'e Exploration, usize, &'e [usize]);

/// The nearest states that satisfy the goal, if it takes at least one step, no more than allowed, and no more than about
/// `most` states to find them.
///
/// # Errors
/// When the work is interrupted.
pub(super) fn goal_states(
    workshop: &Workshop,
    most: usize,
    task: &Task,
    goal: &Goal,
) -> Result<Option<(Exploration, usize, Vec<usize>)>, LimitError> {
    let reached = |state: &crate::task::State| goal.holds(task, state);
    let exploration = Exploration::new(task, (workshop.config.max_steps, most), reached, &workshop.limits)?;
    let nearest = exploration.nearest(reached).filter(|&(shortest, _)| shortest > 0);
    Ok(nearest.map(|(shortest, states)| (exploration, shortest, states)))
}

/// The problem with the plans that the configuration wants; none where that takes more than the limits allow.
///
/// # Errors
/// When the work is interrupted.
pub(super) fn shape(
    workshop: &Workshop,
    source: Source,
    task: &Arc<Task>,
    goal: Goal,
    (exploration, shortest, states): Ends,
    (hash, family): (u128, u128),
    random: &mut Random,
) -> Result<Option<Shape>, LimitError> {
    let config = workshop.config;
    let found = match config.plans {
        PlanChoice::Shortest => {
            let plans = exploration.shortest_plans(states, config.plans_per_problem, random);
            Ok((plans, exploration.count(states)))
        }
        // `longer` asks for more steps than training has; its problems' shortest plans are always among theirs.
        PlanChoice::All => all_plans(workshop, config.max_steps.max(shortest), task, &goal, random),
    };
    let (plans, plan_count) = match found {
        Ok(found) => found,
        Err(LimitError::Interrupted) => return Err(LimitError::Interrupted),
        Err(_) => return Ok(None),
    };
    let (task, shortest) = (task.clone(), Some(shortest));
    Ok(Some(Shape { source, task, goal, plans, plan_count, shortest, hash, family }))
}

/// All first-goal plans of at most `horizon` steps, or a uniform sample of them.
fn all_plans(
    workshop: &Workshop,
    horizon: usize,
    task: &Arc<Task>,
    goal: &Goal,
    random: &mut Random,
) -> Result<(Vec<Vec<crate::task::OperatorId>>, u128), LimitError> {
    let (limits, most) = (&workshop.limits, workshop.config.plans_per_problem);
    let aimed = Arc::new(Task { goal: goal.condition(task), ..(**task).clone() });
    let set = PlanSet::new(aimed, horizon, Semantics::FirstGoal, limits)?;
    let count = u128::try_from(set.count()).map_err(|_| LimitError::States { limit: limits.states })?;
    let replace = false;
    let plans = if count <= most as u128 {
        set.iter().map(|plan| plan.0).collect()
    } else {
        let drawn = match set.sample(most, random.bits(), replace, limits) {
            Err(SampleError::Limit(error)) => return Err(error),
            drawn => drawn.expect("there are more plans than are drawn"),
        };
        drawn.iter().map(|plan| plan.0).collect()
    };
    Ok((plans, count))
}
