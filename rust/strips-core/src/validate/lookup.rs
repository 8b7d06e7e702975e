//! From the words of a step to an action and its arguments.

use rustc_hash::FxHashMap;

use super::Outcome;
use crate::pddl::ast::{ActionId, ObjectId};
use crate::pddl::nearest;
use crate::task::{OperatorId, Task};

/// Actions and objects by name.
pub(super) struct Lookup {
    actions: FxHashMap<Box<str>, ActionId>,
    objects: FxHashMap<Box<str>, ObjectId>,
}

/// A step whose names are all known and of the right types.
#[derive(Clone, Debug)]
pub(super) struct Resolved {
    pub(super) action: ActionId,
    pub(super) args: Vec<ObjectId>,
    /// None where grounding found that nothing can make the step applicable.
    pub(super) operator: Option<OperatorId>,
}

/// Why a step denotes nothing.
#[derive(Debug)]
pub(super) struct Unresolved {
    pub(super) outcome: Outcome,
    pub(super) reason: String,
}

impl Lookup {
    pub(super) fn new(task: &Task) -> Self {
        let actions = task.domain.actions.iter().enumerate();
        let objects = task.problem.objects.iter().enumerate();
        Self {
            actions: actions.map(|(id, action)| (action.name.as_str().into(), ActionId::from(id))).collect(),
            objects: objects.map(|(id, object)| (object.name.as_str().into(), ObjectId::from(id))).collect(),
        }
    }

    /// The object of that name, in any case.
    pub(super) fn object(&self, name: &str) -> Option<ObjectId> {
        let exact = self.objects.get(name).copied();
        exact.or_else(|| self.objects.get(name.to_ascii_lowercase().as_str()).copied())
    }

    /// The action of that name, in any case.
    fn action(&self, name: &str) -> Option<ActionId> {
        let exact = self.actions.get(name).copied();
        exact.or_else(|| self.actions.get(name.to_ascii_lowercase().as_str()).copied())
    }

    /// What the words denote.
    pub(super) fn resolve<'w>(
        &self,
        task: &Task,
        name: &str,
        args: impl Iterator<Item = &'w str> + Clone,
    ) -> Result<Resolved, Unresolved> {
        let action = self.action(name).ok_or_else(|| unknown_action(task, name))?;
        let parameters = task.domain.actions[action.index()].parameters.len();
        let found = args.clone().count();
        if found != parameters {
            return Err(wrong_arity(name, parameters, found));
        }
        let args = args
            .map(|arg| self.object(arg).ok_or_else(|| unknown_object(task, name, arg)))
            .collect::<Result<Vec<_>, _>>()?;
        check_types(task, action, &args)?;
        let operator = task.operator(action, &args);
        Ok(Resolved { action, args, operator })
    }
}

fn unknown_action(task: &Task, name: &str) -> Unresolved {
    let name = name.to_ascii_lowercase();
    let suggestion = nearest(&name, task.domain.actions.iter().map(|action| action.name.as_str()));
    let reason = format!("the domain has no action `{name}`{}", hint(suggestion));
    Unresolved { outcome: Outcome::UnknownAction, reason }
}

fn unknown_object(task: &Task, action: &str, name: &str) -> Unresolved {
    let (action, name) = (action.to_ascii_lowercase(), name.to_ascii_lowercase());
    let suggestion = nearest(&name, task.problem.objects.iter().map(|object| object.name.as_str()));
    let reason = format!("the problem has no object `{name}`, an argument of `{action}`{}", hint(suggestion));
    Unresolved { outcome: Outcome::UnknownObject, reason }
}

fn hint(suggestion: Option<String>) -> String {
    suggestion.map(|name| format!("; did you mean `{name}`?")).unwrap_or_default()
}

fn wrong_arity(name: &str, expected: usize, found: usize) -> Unresolved {
    let plural = if expected == 1 { "" } else { "s" };
    let reason = format!("`{}` takes {expected} argument{plural}, not {found}", name.to_ascii_lowercase());
    Unresolved { outcome: Outcome::Arity, reason }
}

fn check_types(task: &Task, action: ActionId, args: &[ObjectId]) -> Result<(), Unresolved> {
    let (domain, action) = (&task.domain, &task.domain.actions[action.index()]);
    for (parameter, arg) in action.parameters.iter().zip(args) {
        let object = &task.problem.objects[arg.index()];
        if !domain.accepts(&parameter.types, object) {
            let names = |ids: &[crate::pddl::ast::TypeId]| {
                ids.iter().map(|id| domain.types[id.index()].name.as_str()).collect::<Vec<_>>().join(" or ")
            };
            let (found, wanted) = (names(&object.types), names(&parameter.types));
            let reason = format!(
                "`{}` is of type {found}, but `{}` takes {wanted} as its ?{}",
                object.name, action.name, parameter.name
            );
            return Err(Unresolved { outcome: Outcome::Type, reason });
        }
    }
    Ok(())
}
