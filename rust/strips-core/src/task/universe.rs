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
    /// For each type, those that name it as their supertype.
    children: Vec<Vec<TypeId>>,
}

impl<'a> Universe<'a> {
    pub fn new(domain: &Domain, problem: &'a Problem) -> Self {
        let mut children = vec![Vec::new(); domain.types.len()];
        for (index, kind) in domain.types.iter().enumerate() {
            for parent in &kind.parents {
                children[parent.index()].push(index.into());
            }
        }
        Self { problem, children }
    }

    /// The objects that belong to at least one of the types; to `object` all do, whatever the file says.
    pub fn candidates(&self, wanted: &[TypeId]) -> Candidates {
        let kinds = self.kinds(wanted);
        let is_wanted = |kind: &TypeId| kinds[kind.index()];
        let member: Arc<[bool]> =
            self.problem.objects.iter().map(|object| object.types.iter().any(is_wanted)).collect();
        let list = (0..member.len() as u32).filter(|&object| member[object as usize]).collect();
        Candidates { list, member }
    }

    /// Which types are one of those or below it. Linear in the number of types: a chain of them may be long.
    fn kinds(&self, wanted: &[TypeId]) -> Vec<bool> {
        let mut kinds = vec![wanted.contains(&TypeId::OBJECT); self.children.len()];
        let mut open = wanted.to_vec();
        while let Some(kind) = open.pop() {
            if !std::mem::replace(&mut kinds[kind.index()], true) {
                open.extend(&self.children[kind.index()]);
            }
        }
        kinds
    }

    /// What each of the parameters ranges over.
    pub fn scope(&self, parameters: &[Parameter]) -> Vec<Candidates> {
        parameters.iter().map(|parameter| self.candidates(&parameter.types)).collect()
    }
}
