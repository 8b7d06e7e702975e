//! Looking names and types up in a checked domain.

use super::ast::{Action, ActionId, Domain, Object, ObjectId, Predicate, PredicateId, Problem, Type, TypeId};

impl Domain {
    /// The predicate of that name, in lower case. Linear in the number of predicates.
    pub fn predicate(&self, name: &str) -> Option<PredicateId> {
        self.predicates.iter().position(|predicate| predicate.name == name).map(PredicateId::from)
    }

    /// The action of that name, in lower case. Linear in the number of actions.
    pub fn action(&self, name: &str) -> Option<ActionId> {
        self.actions.iter().position(|action| action.name == name).map(ActionId::from)
    }

    /// The type of that name, in lower case. Linear in the number of types.
    pub fn type_id(&self, name: &str) -> Option<TypeId> {
        self.types.iter().position(|kind| kind.name == name).map(TypeId::from)
    }

    /// Whether every `sub` is a `sup`; each type is its own subtype. Linear in the number of `sub`'s supertypes.
    pub fn is_subtype(&self, sub: TypeId, sup: TypeId) -> bool {
        is_subtype(&self.types, sub, sup)
    }

    /// Whether the object is of one of the wanted types.
    pub fn accepts(&self, wanted: &[TypeId], object: &Object) -> bool {
        object.types.iter().any(|&sub| wanted.iter().any(|&sup| self.is_subtype(sub, sup)))
    }

    /// The predicate with that number.
    pub fn predicate_of(&self, id: PredicateId) -> &Predicate {
        &self.predicates[id.index()]
    }

    /// The action with that number.
    pub fn action_of(&self, id: ActionId) -> &Action {
        &self.actions[id.index()]
    }
}

impl Problem {
    /// The object of that name, in lower case. Linear in the number of objects.
    pub fn object(&self, name: &str) -> Option<ObjectId> {
        self.objects.iter().position(|object| object.name == name).map(ObjectId::from)
    }
}

/// Whether every `sub` is a `sup`, in a hierarchy without cycles. Iterative: a chain of types may be long.
pub(super) fn is_subtype(types: &[Type], sub: TypeId, sup: TypeId) -> bool {
    let mut open = sub;
    loop {
        if open == sup || sup == TypeId::OBJECT {
            return true;
        }
        match types[open.index()].parents.as_slice() {
            [] => return false,
            [parent] => open = *parent,
            several => return is_above_any(types, several, sup),
        }
    }
}

fn is_above_any(types: &[Type], start: &[TypeId], sup: TypeId) -> bool {
    let mut seen = vec![false; types.len()];
    let mut open = start.to_vec();
    while let Some(id) = open.pop() {
        if id == sup {
            return true;
        }
        if !std::mem::replace(&mut seen[id.index()], true) {
            open.extend(&types[id.index()].parents);
        }
    }
    false
}
