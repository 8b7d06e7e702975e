//! The objects of a problem, by type: what each variable ranges over.

use std::sync::Arc;

use crate::pddl::ast::{Domain, Parameter, Problem, TypeId};

/// The objects that a variable may be bound to.
#[derive(Clone, Debug)]
pub(super) struct Candidates {
    /// The object ids, ascending.
    pub list: Arc<[u32]>,
    member: Arc<[bool]>,
}

impl Candidates {
    /// Whether the variable may be bound to the object.
    pub fn contains(&self, object: u32) -> bool {
        self.member[object as usize]
    }
}

/// Answers which objects belong to a type.
pub(super) struct Universe<'a> {
    problem: &'a Problem,
    /// For each type, itself and everything that it is a kind of.
    ancestors: Vec<Vec<TypeId>>,
}

impl<'a> Universe<'a> {
    pub fn new(domain: &Domain, problem: &'a Problem) -> Self {
        Self { problem, ancestors: (0..domain.types.len()).map(|index| ancestors(domain, index.into())).collect() }
    }

    /// The objects that belong to at least one of the types.
    pub fn candidates(&self, wanted: &[TypeId]) -> Candidates {
        let is_wanted = |kind: &TypeId| self.ancestors[kind.index()].iter().any(|ancestor| wanted.contains(ancestor));
        let member: Arc<[bool]> =
            self.problem.objects.iter().map(|object| object.types.iter().any(is_wanted)).collect();
        let list = (0..member.len() as u32).filter(|&object| member[object as usize]).collect();
        Candidates { list, member }
    }

    /// What each of the parameters ranges over.
    pub fn scope(&self, parameters: &[Parameter]) -> Vec<Candidates> {
        parameters.iter().map(|parameter| self.candidates(&parameter.types)).collect()
    }
}

/// The type itself and all it is a kind of; `object` is one of them whatever the file says.
fn ancestors(domain: &Domain, kind: TypeId) -> Vec<TypeId> {
    let mut found = vec![kind];
    let mut next = 0;
    while next < found.len() {
        for &parent in &domain.types[found[next].index()].parents {
            if !found.contains(&parent) {
                found.push(parent);
            }
        }
        next += 1;
    }
    if !found.contains(&TypeId::OBJECT) {
        found.push(TypeId::OBJECT);
    }
    found
}
