//! The grounded task: facts, operators and the goal, as search and validation need them.
//!
//! Grounded words only (Fact, Operator, State, …); the lifted ones live in `pddl::ast`. Facts that no reachable
//! operator can change are compiled away from conditions and kept apart, in [`Task::static_facts`], because states are
//! printed whole. Nothing else is dropped: an operator that is applicable in some reachable state is in the task.

mod cost;
mod facts;
mod ground;
mod lifted;
pub mod limits;
mod names;
mod normal;
mod plan;
mod program;
mod reach;
mod relation;
mod simplify;
pub mod state;
mod strata;
mod universe;

use std::sync::Arc;

use crate::pddl::ast::{ActionId, Domain, GroundAtom, ObjectId, Problem, index};
pub use ground::ground;
pub use limits::{LimitError, Limits, Watch};
pub use state::State;

index!(/** Position in [`Task::facts`]. */ FactId);
index!(/** Position in [`Task::operators`]. */ OperatorId);

/// A ground atom. The same shape as the lifted layer's [`GroundAtom`], under the name that the grounded layer uses.
pub type Fact = GroundAtom;

/// A grounded planning task.
///
/// Orders are part of the contract, as data and plan numbering depend on them: `facts` and `static_facts` ascend by
/// (predicate, arguments), `operators` by (action, arguments).
#[derive(Clone, Debug)]
pub struct Task {
    /// The domain that the indices refer to.
    pub domain: Arc<Domain>,
    /// The problem that the indices refer to.
    pub problem: Arc<Problem>,
    /// Facts whose truth can differ between reachable states; a state has one bit for each, derived ones included.
    pub facts: Vec<Fact>,
    /// Facts (of predicates that are not derived) that are true in every reachable state and are not in `facts`.
    pub static_facts: Vec<Fact>,
    /// The initial state, axioms applied.
    pub init: State,
    /// What a final state must satisfy.
    pub goal: GroundCondition,
    /// Every operator that is applicable in some relaxed-reachable state.
    pub operators: Arc<[Operator]>,
    /// Ground axioms by stratum; empty for tasks without derived predicates.
    pub axioms: AxiomLayers,
}

/// An action with its arguments.
#[derive(Clone, Debug, PartialEq)]
pub struct Operator {
    /// The lifted action.
    pub action: ActionId,
    /// Its arguments, one for each parameter.
    pub args: Vec<ObjectId>,
    /// What must hold before.
    pub precondition: GroundCondition,
    /// What changes. The usual STRIPS operator has exactly one, whose condition is empty.
    pub effects: Vec<GroundEffect>,
    /// By how much it raises `total-cost`; 1 where the domain has no costs.
    pub cost: f64,
}

/// One conditional effect: if `condition` held before, `del_effects` go and then `add_effects` come.
///
/// Over all the effects of an operator that fire, every delete applies before any add.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GroundEffect {
    /// When it fires, read in the state before; empty for always.
    pub condition: GroundCondition,
    /// Facts that become true.
    pub add_effects: Vec<FactId>,
    /// Facts that become false unless some firing effect adds them. Disjoint from this effect's `add_effects`.
    pub del_effects: Vec<FactId>,
}

/// A conjunction over facts: all `positive` true, all `negative` false, and each of `clauses` true.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GroundCondition {
    /// Facts that must be true, ascending.
    pub positive: Vec<FactId>,
    /// Facts that must be false, ascending.
    pub negative: Vec<FactId>,
    /// What is left of disjunctions after simplification; `Or([])` makes the whole unsatisfiable.
    pub clauses: Vec<Formula>,
}

/// A condition in negation normal form that is no plain conjunction of literals.
#[derive(Clone, Debug, PartialEq)]
pub enum Formula {
    /// The fact is true (or false, where the flag is not set).
    Literal(FactId, bool),
    /// All hold.
    And(Vec<Formula>),
    /// Some holds.
    Or(Vec<Formula>),
}

/// Ground axioms, stratum by stratum. Within one, rules apply until nothing changes; negation looks only below.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxiomLayers {
    /// Every derived fact, which is false before the rules apply.
    pub derived: Vec<FactId>,
    /// The rules (head, body) of each stratum, the lowest first.
    pub layers: Vec<Vec<(FactId, GroundCondition)>>,
}
