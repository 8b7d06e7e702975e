//! Problems that a user gives, with their own goals.

use std::sync::Arc;

use rayon::prelude::*;

use super::problems::{Workshop, open_task};
use super::shape::{Shape, Source, hash_of};
use super::stream::RecordError;
use super::template_problems::solve;
use crate::negative::Goal;
use crate::pddl::ast::{Domain, Problem};
use crate::pddl::{PddlError, PddlErrorKind, Source as File, parse_problem};
use crate::task::{Fact, LimitError};
use crate::text::goal_literals;

/// Most states in which a given problem's plans are looked for.
const STATES: usize = 300_000;

/// A problem and where it was read from.
pub(super) struct Given {
    file: String,
    /// The problem, its objects called by their slots.
    pub problem: Problem,
    /// Its goal's literals, or that it is no conjunction of literals, as prompts need it.
    goal: Result<Vec<(Fact, bool)>, PddlError>,
}

impl Given {
    /// Reads one file.
    pub fn read(file: &File, domain: &Domain, domain_file: &File) -> Result<Self, PddlError> {
        let problem = slots(domain, parse_problem(file, domain, Some(domain_file))?);
        let refused = || {
            let (expected, found) = ("a conjunction of literals, as prompts say goals", "another condition".to_owned());
            PddlError::new(PddlErrorKind::Expected { expected, found }, problem.goal_span, file)
        };
        let goal = goal_literals(domain, &problem).ok_or_else(refused);
        Ok(Self { file: file.name().to_owned(), problem, goal })
    }
}

/// The problems solved, and a line for each that is left out.
///
/// # Errors
/// A goal that no prompt can say, unless random goals are asked for, or a limit.
pub(super) fn shapes(workshop: &Workshop, given: &[Given]) -> Result<(Vec<Shape>, Vec<String>), RecordError> {
    let refused = given.iter().find_map(|given| given.goal.as_ref().err());
    if let Some(error) = refused.filter(|_| !workshop.config.random_goals) {
        return Err(RecordError::Goal(error.clone()));
    }
    let solved = given.par_iter().map(|given| one(workshop, given)).collect::<Result<Vec<_>, _>>()?;
    let steps = workshop.config.max_steps;
    let empty = given.iter().zip(&solved).filter(|(_, shapes)| shapes.is_empty());
    let line = |(given, _): (&Given, _)| {
        format!("{}: its own goal is left out: no plan of 1 to {steps} steps within {STATES} states", given.file)
    };
    let left_out = empty.map(line).collect();
    Ok((solved.into_iter().flatten().collect(), left_out))
}

fn one(workshop: &Workshop, given: &Given) -> Result<Vec<Shape>, LimitError> {
    let Ok(literals) = &given.goal else { return Ok(Vec::new()) };
    let (task, goal) = (open_task(workshop, given.problem.clone())?, Goal::Literals(literals.clone()));
    let hash = hash_of(&task, &goal);
    let random = workshop.random(&format!("plans {hash:x}"));
    solve(workshop, (Source::Given, STATES), &Arc::new(task), &goal, hash, random)
}

/// The problem with its objects called by their slots, as all problems of a data set have them.
fn slots(domain: &Domain, mut problem: Problem) -> Problem {
    let fixed = domain.constants.len() + domain.pending.len();
    for (slot, object) in problem.objects[fixed..].iter_mut().enumerate() {
        object.name = format!("o{slot}");
    }
    problem
}
