//! Random problems: a drawn initial state, scrambled by a random walk, and goals from states at drawn distances.

use std::sync::Arc;

use super::exploration::Exploration;
use super::problems::{Workshop, open_task, shape, started_from};
use super::shape::{Shape, Source, hash_of};
use crate::augment::Template;
use crate::negative::Goal;
use crate::random::Random;
use crate::task::{LimitError, State, Task};

/// Most steps of the walk that scrambles an initial state.
const SCRAMBLE: usize = 12;
/// Most literals of a drawn goal that is no whole state.
const LITERALS: usize = 3;

/// What problems to draw.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    /// Names the stream of random numbers.
    pub purpose: &'static str,
    /// Added to the least and the most distractors of the start.
    pub surplus: (usize, usize),
    /// Least and most steps of a shortest plan.
    pub steps: (usize, usize),
    /// Most states explored.
    pub states: usize,
    /// Goals for each start, if no more than `states` were explored from it.
    pub goals: usize,
}

/// The solved problems from the start with this number.
///
/// # Errors
/// When grounding passes the limits.
pub(super) fn shapes(
    workshop: &Workshop,
    start: &Start,
    wanted: Wanted,
    number: usize,
) -> Result<Vec<Shape>, LimitError> {
    let mut random = workshop.random(&format!("{} {number}", wanted.purpose));
    let task = Arc::new(scrambled(workshop, start.task(workshop, wanted, &mut random)?, &mut random)?);
    let exploration = Exploration::new(&task, (wanted.steps.1, wanted.states), |_| false, &workshop.limits)?;
    let drawn = (0..start.goals(wanted, &exploration))
        .filter_map(|_| draw(workshop, &task, &exploration, wanted, &mut random).transpose());
    drawn.collect()
}

/// Where random problems start from.
pub(super) enum Start<'t> {
    /// A template without a goal.
    Template(&'t Template),
    /// Given problems, drawn from, their goals left open.
    Problems(Vec<Task>),
}

impl Start<'_> {
    fn task(&self, workshop: &Workshop, wanted: Wanted, random: &mut Random) -> Result<Task, LimitError> {
        match self {
            Start::Template(template) => open_task(workshop, template.draw(&workshop.domain, wanted.surplus, random)),
            Start::Problems(tasks) => Ok(random.choice(tasks).clone()),
        }
    }

    /// Goals to draw from an exploration: a given problem's last layer may be many times as wide as all before it, and
    /// what it cost is to give as many problems as the same work elsewhere.
    fn goals(&self, wanted: Wanted, exploration: &Exploration) -> usize {
        match self {
            Start::Template(_) => wanted.goals,
            Start::Problems(_) => wanted.goals * (exploration.states.len() / wanted.states).max(1),
        }
    }
}

/// The task whose initial state is where a random walk from the task's leads.
fn scrambled(workshop: &Workshop, task: Task, random: &mut Random) -> Result<Task, LimitError> {
    let mut state = task.init.clone();
    for _ in 0..random.below(SCRAMBLE + 1) {
        let applicable: Vec<_> = task.operators.iter().filter(|operator| operator.applicable(&state)).collect();
        if applicable.is_empty() {
            break;
        }
        state = task.apply(random.choice::<&crate::task::Operator>(&applicable), &state);
    }
    let init = task.atoms(&state);
    if init == task.problem.init {
        return Ok(task);
    }
    started_from(workshop, &task, init)
}

/// A goal at a drawn distance, solved.
fn draw(
    workshop: &Workshop,
    task: &Arc<Task>,
    exploration: &Exploration,
    wanted: Wanted,
    random: &mut Random,
) -> Result<Option<Shape>, LimitError> {
    let (least, most) = (wanted.steps.0, wanted.steps.1.min(exploration.depth()));
    if most < least {
        return Ok(None);
    }
    let layer = exploration.layer(least + random.below(most - least + 1));
    let target = layer.start + random.below(layer.len());
    let config = workshop.config;
    let goal = if random.chance(config.state_goal_share) {
        Goal::State(exploration.states[target].clone())
    } else {
        some_changes(task, &exploration.states[target], LITERALS, random)
    };
    let nearest = match goal {
        Goal::State(_) => Some((exploration.depth_of(target), vec![target])),
        Goal::Literals(_) => exploration.nearest(|state| goal.holds(task, state)),
    };
    let Some((shortest, states)) = nearest.filter(|&(shortest, _)| shortest >= least) else { return Ok(None) };
    let hash = hash_of(task, &goal);
    shape(workshop, Source::Random, task, goal, (exploration, shortest, &states), (hash, hash), random)
}

/// Some of the facts in which the state differs from the initial one, as they are there: from one to all, but no more
/// than about `most`.
pub(super) fn some_changes(task: &Task, state: &State, most: usize, random: &mut Random) -> Goal {
    let basic = |id: usize| !task.domain.predicates[task.facts[id].predicate.index()].derived;
    let differs = |&id: &usize| basic(id) && task.init.holds(id.into()) != state.holds(id.into());
    let mut changed: Vec<usize> = (0..task.facts.len()).filter(differs).collect();
    random.shuffle(&mut changed);
    let most = if most == usize::MAX { changed.len().max(1) } else { most };
    changed.truncate(1 + random.below(most));
    changed.sort_unstable();
    Goal::Literals(changed.into_iter().map(|id| (task.facts[id].clone(), state.holds(id.into()))).collect())
}
