//! Problems of the suite `large`: too many states to see them all, so the goal is where a random walk led.
//!
//! The reference plan is the better of two that are there to be had: the walk itself, and what a greedy best-first
//! search finds, both without their detours. It is valid, but nothing says that it is a shortest one. How many steps a
//! shortest plan has is recorded only where it is proven: the goal lies among the states seen around the start, or the
//! reference plan is no longer than all goals beyond them must be.

use std::sync::Arc;

use super::exploration::Exploration;
use super::problems::{Workshop, open_task};
use super::random_problems::some_changes;
use super::shape::{Shape, Source, hash_of};
use crate::augment::Template;
use crate::negative::Goal;
use crate::pddl::ast::Problem;
use crate::random::Random;
use crate::search::{SuccessorGenerator, greedy_plan, without_detours};
use crate::task::{LimitError, OperatorId, State, Task};

/// States seen around each start, about; layers are seen whole or not at all.
const STATES: usize = 300;
/// States that the search for one reference plan opens.
const OPENED: usize = 600;
/// Goals for each start.
pub(super) const GOALS: usize = 5;

/// A start, and what all its goals share.
struct Ground {
    task: Arc<Task>,
    generator: SuccessorGenerator,
    around: Exploration,
}

/// The problems from the start with this number, drawn from a template without a goal.
///
/// # Errors
/// When grounding passes the limits, or the work is interrupted.
pub(super) fn shapes(workshop: &Workshop, template: &Template, number: usize) -> Result<Vec<Shape>, LimitError> {
    let mut random = workshop.random(&format!("large {number}"));
    let ground = start(workshop, template, &mut random)?;
    let mut shapes = Vec::new();
    for _ in 0..GOALS {
        workshop.limits.start().check()?;
        shapes.extend(draw(workshop, &ground, &mut random));
    }
    Ok(shapes)
}

/// A problem of the template, its initial state where a random walk leads.
fn start(workshop: &Workshop, template: &Template, random: &mut Random) -> Result<Ground, LimitError> {
    let problem = template.draw(&workshop.domain, (0, 0), random);
    let task = open_task(workshop, problem)?;
    let steps = random.below(2 * workshop.config.large_walk.1 + 1);
    let (_, state) = walk(&task, &SuccessorGenerator::new(&task), steps, random);
    let problem = Problem { init: task.atoms(&state), ..(*task.problem).clone() };
    let task = open_task(workshop, problem)?;
    let around = Exploration::new(&task, (workshop.config.large_walk.1, STATES), |_| false, &workshop.limits)?;
    Ok(Ground { generator: SuccessorGenerator::new(&task), task: Arc::new(task), around })
}

/// A walk of so many operators from the initial state, fewer where it is stuck, that undoes nothing at once.
fn walk(task: &Task, generator: &SuccessorGenerator, steps: usize, random: &mut Random) -> (Vec<OperatorId>, State) {
    let (mut before, mut state, mut plan) = (task.init.clone(), task.init.clone(), Vec::new());
    for _ in 0..steps {
        let mut choices = generator.applicable(&state);
        choices.retain(|&operator| ![&before, &state].contains(&&generator.successor(&state, operator)));
        if choices.is_empty() {
            choices = generator.applicable(&state);
        }
        if choices.is_empty() {
            break;
        }
        let operator = *random.choice(&choices);
        let next = generator.successor(&state, operator);
        before = std::mem::replace(&mut state, next);
        plan.push(operator);
    }
    (plan, state)
}

/// A goal at the end of a walk, with its reference plan; none where the walk led nowhere.
fn draw(workshop: &Workshop, ground: &Ground, random: &mut Random) -> Option<Shape> {
    let Ground { task, generator, around } = ground;
    let (least, most) = workshop.config.large_walk;
    let (walk, end) = walk(task, generator, least + random.below(most - least + 1), random);
    let goal = if random.chance(workshop.config.state_goal_share) {
        Goal::State(end)
    } else {
        some_changes(task, &end, usize::MAX, random)
    };
    let hash = hash_of(task, &goal);
    let shape = |plans, plan_count, shortest| {
        let (source, task, goal) = (Source::Large, task.clone(), goal.clone());
        Some(Shape { source, task, goal, plans, plan_count, shortest, hash, family: hash })
    };
    if let Some((steps, states)) = around.nearest(|state| goal.holds(task, state)) {
        let plans = around.shortest_plans(&states, workshop.config.plans_per_problem, random);
        return if steps > 0 { shape(plans, around.count(&states), Some(steps)) } else { None };
    }
    let plan = reference(ground, &goal, &walk);
    // Every state within `depth` steps was seen, so no plan is shorter than one step more.
    let proven = (plan.len() == around.depth() + 1).then_some(plan.len());
    shape(vec![plan], 1, proven)
}

/// The shorter of the walk and the plan that a search finds, both without detours.
fn reference(ground: &Ground, goal: &Goal, walk: &[OperatorId]) -> Vec<OperatorId> {
    let Ground { task, generator, .. } = ground;
    let condition = goal.condition(task);
    let walked = without_detours(task, generator, &condition, walk);
    let found = greedy_plan(task, generator, &condition, OPENED);
    let found = found.map(|plan| without_detours(task, generator, &condition, &plan));
    found.into_iter().fold(walked, |best, plan| if plan.len() < best.len() { plan } else { best })
}
