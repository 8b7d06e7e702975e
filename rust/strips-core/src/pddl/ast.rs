//! The checked syntax tree: every name resolved to an index, every arity and type checked by the parser.
//!
//! Lifted words only (Domain, Action, Atom, …); the grounded ones live in `task`. Names are stored in lower case, as
//! PDDL is case-insensitive. Variables are numbered by scope depth: an action's parameters are 0, 1, …; the variables
//! that a quantifier introduces take the next numbers inside its body and are free again after it.

use crate::span::Span;

macro_rules! index {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);

        impl $name {
            /// The position as a plain index.
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }

        impl From<usize> for $name {
            fn from(index: usize) -> Self {
                Self(index as u32)
            }
        }
    };
}
pub(crate) use index;

index!(/** Position in [`Domain::types`]. */ TypeId);
index!(/** Position in [`Domain::predicates`]. */ PredicateId);
index!(/** Position in [`Domain::actions`]. */ ActionId);
index!(/** Position in [`Problem::objects`]. */ ObjectId);
index!(/** A variable, numbered by scope depth. */ VariableId);

impl TypeId {
    /// The root type, `object`.
    pub const OBJECT: TypeId = TypeId(0);
}

/// A planning domain whose names are all resolved.
#[derive(Clone, Debug, PartialEq)]
pub struct Domain {
    /// The domain's name.
    pub name: String,
    /// Requirement flags as written, without the colon, in order.
    pub requirements: Vec<String>,
    /// All types; the first is `object`.
    pub types: Vec<Type>,
    /// Declared constants, in order; they take the first object ids of every problem.
    pub constants: Vec<Object>,
    /// Objects that the domain names but leaves to the problem to declare. They take the object ids right after the
    /// constants; a problem that does not declare one of them is an error that points here.
    pub pending: Vec<PendingObject>,
    /// Predicates, in order of declaration. States are printed in this order.
    pub predicates: Vec<Predicate>,
    /// Derived predicates' rules, in order.
    pub axioms: Vec<Axiom>,
    /// Actions, in order.
    pub actions: Vec<Action>,
    /// Whether `(total-cost)` is declared or used.
    pub has_total_cost: bool,
    /// Other numeric functions used only as action costs, such as `(road-length ?a ?b)`.
    pub cost_functions: Vec<CostFunction>,
    /// What was accepted although the standard forbids it.
    pub warnings: Vec<Warning>,
}

/// A type and the types it is directly a kind of.
#[derive(Clone, Debug, PartialEq)]
pub struct Type {
    /// The type's name.
    pub name: String,
    /// Direct supertypes; empty only for `object`.
    pub parents: Vec<TypeId>,
    /// Where it was declared.
    pub span: Span,
}

/// A constant or object.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// The object's name.
    pub name: String,
    /// Its declared type; several for `(either …)`.
    pub types: Vec<TypeId>,
    /// Where it was declared.
    pub span: Span,
}

/// An object that the domain uses and only the problem declares.
#[derive(Clone, Debug, PartialEq)]
pub struct PendingObject {
    /// The object's name.
    pub name: String,
    /// For each use, the types of which it must be one (any of them), and where it stands.
    pub uses: Vec<(Vec<TypeId>, Span)>,
}

/// A typed parameter or quantified variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The variable's name, without the question mark.
    pub name: String,
    /// The types of which an argument must be one; several for `(either …)`.
    pub types: Vec<TypeId>,
    /// Where it was declared.
    pub span: Span,
}

/// A predicate's signature.
#[derive(Clone, Debug, PartialEq)]
pub struct Predicate {
    /// The predicate's name.
    pub name: String,
    /// Its parameters.
    pub parameters: Vec<Parameter>,
    /// Whether axioms define it.
    pub derived: bool,
    /// Where it was declared.
    pub span: Span,
}

/// A numeric function that appears only in costs.
#[derive(Clone, Debug, PartialEq)]
pub struct CostFunction {
    /// The function's name.
    pub name: String,
    /// Its parameters.
    pub parameters: Vec<Parameter>,
}

/// `(:derived (p ?x …) condition)`: the condition's variables 0.. are the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Axiom {
    /// The derived predicate.
    pub predicate: PredicateId,
    /// The head's parameters.
    pub parameters: Vec<Parameter>,
    /// When the head holds.
    pub condition: Condition,
    /// Where it was written.
    pub span: Span,
}

/// A lifted action.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// The action's name.
    pub name: String,
    /// Its parameters, variables 0, 1, ….
    pub parameters: Vec<Parameter>,
    /// What must hold before; `And([])` when missing.
    pub precondition: Condition,
    /// What changes; `And([])` when missing.
    pub effect: Effect,
    /// Where it was written.
    pub span: Span,
}

/// A variable or an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Term {
    /// A variable in scope.
    Variable(VariableId),
    /// A constant, a pending object or (in problems) any object.
    Object(ObjectId),
}

/// A predicate applied to terms.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Atom {
    /// The predicate.
    pub predicate: PredicateId,
    /// As many terms as the predicate has parameters.
    pub terms: Vec<Term>,
}

/// A precondition, goal or effect condition.
#[derive(Clone, Debug, PartialEq)]
pub enum Condition {
    /// All hold; true when empty.
    And(Vec<Condition>),
    /// Some holds; false when empty.
    Or(Vec<Condition>),
    /// It does not hold.
    Not(Box<Condition>),
    /// If the first holds, so does the second.
    Imply(Box<Condition>, Box<Condition>),
    /// The body holds for every binding of the parameters.
    Forall(Vec<Parameter>, Box<Condition>),
    /// The body holds for some binding of the parameters.
    Exists(Vec<Parameter>, Box<Condition>),
    /// The atom is true.
    Atom(Atom),
    /// Both terms denote the same object.
    Equals(Term, Term),
}

/// What an action does. Conditions read the state before the action; deletes apply before adds.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// All of them.
    And(Vec<Effect>),
    /// The atom becomes true.
    Add(Atom),
    /// The atom becomes false, unless another effect adds it.
    Delete(Atom),
    /// The effect happens if the condition held before.
    When(Condition, Box<Effect>),
    /// The effect happens for every binding of the parameters.
    Forall(Vec<Parameter>, Box<Effect>),
    /// `(increase (total-cost) …)`.
    IncreaseCost(Cost),
}

/// The amount by which an action raises `total-cost`.
#[derive(Clone, Debug, PartialEq)]
pub enum Cost {
    /// A number as written.
    Number(f64),
    /// A cost function (position in [`Domain::cost_functions`]) applied to terms.
    Function(usize, Vec<Term>),
}

/// A problem of a domain, all names resolved.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// The problem's name.
    pub name: String,
    /// Constants, then the domain's pending objects, then the other objects in order of declaration.
    pub objects: Vec<Object>,
    /// Atoms that are true at the start, in order of writing, duplicates removed.
    pub init: Vec<GroundAtom>,
    /// Values of cost functions: (function, arguments, value).
    pub costs: Vec<(usize, Vec<ObjectId>, f64)>,
    /// What must hold at the end.
    pub goal: Condition,
    /// Whether `(:metric minimize (total-cost))` stands there.
    pub minimizes_cost: bool,
    /// Where the goal was written.
    pub goal_span: Span,
    /// Requirement flags as written, without the colon, in order.
    pub requirements: Vec<String>,
    /// What was accepted although the standard forbids it.
    pub warnings: Vec<Warning>,
}

/// A predicate applied to objects.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct GroundAtom {
    /// The predicate.
    pub predicate: PredicateId,
    /// As many objects as the predicate has parameters.
    pub args: Vec<ObjectId>,
}

/// Something accepted that a strict reader would refuse.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// One sentence, lower case, no full stop.
    pub message: String,
    /// Where.
    pub span: Span,
}
