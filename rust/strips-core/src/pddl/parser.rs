//! From the tree of parentheses to the checked syntax tree.
//!
//! Sections are read in the order in which they depend on one another, whatever the order of writing. Linear time;
//! recursion is bounded by the tree's depth cap.

mod axiom;
mod condition;
mod domain;
mod effect;
mod names;
mod objects;
mod problem;
mod requirements;
mod sections;
mod typed_list;
mod types;

use super::ast::{Domain, Problem};
use super::error::PddlError;
use super::source::Source;
use super::tree::Tree;

/// Reads a domain.
///
/// # Errors
/// The first mistake, with its place; [`super::PddlErrorKind`] lists them.
///
/// ```
/// use strips_core::pddl::{Source, parse_domain};
/// let text = "(define (domain d) (:predicates (p)) (:action a :precondition (q)))";
/// let error = parse_domain(&Source::new("d.pddl", text)).unwrap_err();
/// assert!(error.to_string().starts_with("d.pddl:1:64: undeclared predicate `q`"));
/// ```
pub fn parse_domain(source: &Source) -> Result<Domain, PddlError> {
    Tree::read(source.text()).and_then(|tree| domain::read(&tree)).map_err(|fault| fault.within(source))
}

/// Reads a problem of `domain`. An object that the domain names and nothing declares is an error in `domain_source`,
/// where that is given.
///
/// # Errors
/// The first mistake, with its place; [`super::PddlErrorKind`] lists them.
pub fn parse_problem(source: &Source, domain: &Domain, domain_source: Option<&Source>) -> Result<Problem, PddlError> {
    let tree = Tree::read(source.text()).map_err(|fault| fault.within(source))?;
    problem::read(&tree, domain).map_err(|error| match (error.in_domain, domain_source) {
        (Some(span), Some(domain_source)) => PddlError::new(error.fault.kind, span, domain_source),
        _ => error.fault.within(source),
    })
}
