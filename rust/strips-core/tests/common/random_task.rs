//! Random small domains and problems, as syntax trees: every feature of the language, few objects, few facts.
//!
//! Well-typed and stratified, so they can also be printed and parsed again.

use std::sync::Arc;

use strips_core::pddl::ast::{
    Action, ActionId, Atom, Axiom, Condition, Domain, Effect, GroundAtom, Object, ObjectId, Parameter, Predicate,
    PredicateId, Problem, Term, Type, TypeId, VariableId,
};
use strips_core::random::Random;
use strips_core::span::Span;

/// Which features a random task may have.
#[derive(Clone, Copy, Debug)]
pub struct Features {
    /// Disjunctions, quantifiers, conditional effects and axioms besides literals and equality.
    pub adl: bool,
    /// Most objects.
    pub objects: usize,
    /// Most actions.
    pub actions: usize,
}

impl Features {
    /// Everything there is.
    pub const ADL: Self = Self { adl: true, objects: 3, actions: 3 };
    /// Typing, negation and equality alone.
    pub const STRIPS: Self = Self { adl: false, objects: 3, actions: 3 };
}

/// The random task of a seed.
pub fn random_task(seed: u64, features: Features) -> (Arc<Domain>, Arc<Problem>) {
    let mut maker = Maker { random: Random::new(seed, 0), features, domain: empty_domain(), variables: Vec::new() };
    maker.types();
    maker.predicates();
    maker.constants();
    maker.axioms();
    maker.actions();
    let problem = maker.problem();
    (Arc::new(maker.domain), Arc::new(problem))
}

fn empty_domain() -> Domain {
    Domain {
        name: "random".into(),
        requirements: vec!["adl".into(), "derived-predicates".into()],
        types: vec![Type { name: "object".into(), parents: vec![], span: Span::default() }],
        constants: vec![],
        pending: vec![],
        predicates: vec![],
        axioms: vec![],
        actions: vec![],
        has_total_cost: false,
        cost_functions: vec![],
        warnings: vec![],
    }
}

struct Maker {
    random: Random,
    features: Features,
    domain: Domain,
    /// The types of the variables in scope.
    variables: Vec<Vec<TypeId>>,
}

impl Maker {
    fn types(&mut self) {
        for index in 1..=self.random.below(4) {
            let mut parents = vec![TypeId::from(self.random.below(index))];
            let other = TypeId::from(self.random.below(index));
            if self.random.chance(0.2)
                && !parents.contains(&other)
                && other != TypeId::OBJECT
                && parents[0] != TypeId::OBJECT
            {
                parents.push(other);
            }
            self.domain.types.push(Type { name: format!("t{index}"), parents, span: Span::default() });
        }
    }

    fn some_types(&mut self) -> Vec<TypeId> {
        if self.random.chance(0.5) {
            return vec![TypeId::OBJECT];
        }
        let first = TypeId::from(self.random.below(self.domain.types.len()));
        let second = TypeId::from(self.random.below(self.domain.types.len()));
        if self.random.chance(0.1) && first != second { vec![first, second] } else { vec![first] }
    }

    fn parameters(&mut self, prefix: &str, most: usize) -> Vec<Parameter> {
        let parameter = |maker: &mut Self, n| Parameter {
            name: format!("{prefix}{n}"),
            types: maker.some_types(),
            span: Span::default(),
        };
        let count = if self.random.chance(0.15) { 0 } else { 1 + self.random.below(most) };
        (0..count).map(|n| parameter(self, n)).collect()
    }

    fn predicates(&mut self) {
        let derived = if self.features.adl { self.random.below(3) } else { 0 };
        for (class, count) in
            [("static", self.random.below(3)), ("fluent", 2 + self.random.below(2)), ("derived", derived)]
        {
            for n in 0..count {
                let parameters = self.parameters("x", 2);
                let derived = class == "derived";
                self.domain.predicates.push(Predicate {
                    name: format!("{class}{n}"),
                    parameters,
                    derived,
                    span: Span::default(),
                });
            }
        }
    }

    fn constants(&mut self) {
        for n in 0..self.random.below(2) {
            let types = vec![TypeId::from(self.random.below(self.domain.types.len()))];
            self.domain.constants.push(Object { name: format!("c{n}"), types, span: Span::default() });
        }
    }

    fn axioms(&mut self) {
        let derived: Vec<usize> =
            (0..self.domain.predicates.len()).filter(|&p| self.domain.predicates[p].derived).collect();
        for &predicate in &derived {
            for _ in 0..=self.random.below(2) {
                let parameters = self.domain.predicates[predicate].parameters.clone();
                self.variables = parameters.iter().map(|parameter| parameter.types.clone()).collect();
                let mut parts = vec![self.condition(2, predicate)];
                if self.random.chance(0.5) {
                    parts.extend(self.recursion(predicate));
                }
                self.domain.axioms.push(Axiom {
                    predicate: predicate.into(),
                    parameters,
                    condition: Condition::And(parts),
                    span: Span::default(),
                });
            }
        }
    }

    /// A positive use of the predicate inside its own rule.
    fn recursion(&mut self, predicate: usize) -> Option<Condition> {
        let quantified = self.parameters("r", 1);
        let depth = self.variables.len();
        self.variables.extend(quantified.iter().map(|parameter| parameter.types.clone()));
        let atom = self.atom(predicate);
        self.variables.truncate(depth);
        atom.map(|atom| Condition::Exists(quantified, Box::new(Condition::Atom(atom))))
    }

    /// An atom of the predicate with terms of the right types, if there are any.
    fn atom(&mut self, predicate: usize) -> Option<Atom> {
        let parameters = self.domain.predicates[predicate].parameters.clone();
        let terms: Option<Vec<Term>> = parameters.iter().map(|parameter| self.term(&parameter.types)).collect();
        Some(Atom { predicate: predicate.into(), terms: terms? })
    }

    /// A variable in scope or a constant that is always of one of the types.
    fn term(&mut self, wanted: &[TypeId]) -> Option<Term> {
        let fits = |types: &[TypeId]| types.iter().all(|&kind| self.is_any(kind, wanted));
        let variables = (0..self.variables.len()).filter(|&v| fits(&self.variables[v]));
        let mut terms: Vec<Term> = variables.map(|v| Term::Variable(VariableId::from(v))).collect();
        let constants = (0..self.domain.constants.len()).filter(|&c| fits(&self.domain.constants[c].types));
        terms.extend(constants.map(|c| Term::Object(ObjectId::from(c))));
        if terms.is_empty() { None } else { Some(*self.random.choice(&terms)) }
    }

    fn is_any(&self, kind: TypeId, wanted: &[TypeId]) -> bool {
        wanted.contains(&kind)
            || wanted.contains(&TypeId::OBJECT)
            || self.domain.types[kind.index()].parents.iter().any(|&parent| self.is_any(parent, wanted))
    }

    /// A condition over the predicates below `end`.
    fn condition(&mut self, depth: usize, end: usize) -> Condition {
        let kinds = if depth == 0 {
            2
        } else if self.features.adl {
            8
        } else {
            3
        };
        match self.random.below(kinds) {
            1 if self.random.chance(0.3) => self.equality(),
            0 | 1 => self.literal(end),
            2 => Condition::And(self.conditions(depth, end)),
            3 => Condition::Or(self.conditions(depth, end)),
            4 => Condition::Not(Box::new(self.condition(depth - 1, end))),
            5 => {
                let premise = self.condition(depth - 1, end);
                Condition::Imply(Box::new(premise), Box::new(self.condition(depth - 1, end)))
            }
            6 => self.quantified(depth, end, Condition::Forall),
            _ => self.quantified(depth, end, Condition::Exists),
        }
    }

    fn conditions(&mut self, depth: usize, end: usize) -> Vec<Condition> {
        let count = if self.random.chance(0.05) { 0 } else { 1 + self.random.below(3) };
        (0..count).map(|_| self.condition(depth - 1, end)).collect()
    }

    fn quantified(
        &mut self,
        depth: usize,
        end: usize,
        wrap: fn(Vec<Parameter>, Box<Condition>) -> Condition,
    ) -> Condition {
        let scope = self.variables.len();
        let parameters = self.parameters(&format!("q{scope}x"), 2);
        self.variables.extend(parameters.iter().map(|parameter| parameter.types.clone()));
        let body = self.condition(depth - 1, end);
        self.variables.truncate(scope);
        if parameters.is_empty() { body } else { wrap(parameters, Box::new(body)) }
    }

    fn literal(&mut self, end: usize) -> Condition {
        let predicate = self.random.below(end.max(1));
        match self.atom(predicate) {
            _ if end == 0 => Condition::And(vec![]),
            None => Condition::And(vec![]),
            Some(atom) if self.random.chance(0.35) => Condition::Not(Box::new(Condition::Atom(atom))),
            Some(atom) => Condition::Atom(atom),
        }
    }

    fn equality(&mut self) -> Condition {
        let (left, right) = (self.term(&[TypeId::OBJECT]), self.term(&[TypeId::OBJECT]));
        let (Some(left), Some(right)) = (left, right) else { return Condition::And(vec![]) };
        let equal = Condition::Equals(left, right);
        if self.random.chance(0.6) { Condition::Not(Box::new(equal)) } else { equal }
    }

    fn actions(&mut self) {
        for index in 0..=self.random.below(self.features.actions) {
            let parameters = self.parameters("x", 3);
            self.variables = parameters.iter().map(|parameter| parameter.types.clone()).collect();
            let end = self.domain.predicates.len();
            let parts = (0..self.random.below(3)).map(|_| self.condition(2, end)).collect();
            let effect = Effect::And((0..=self.random.below(4)).map(|_| self.effect(2)).collect());
            self.domain.actions.push(Action {
                name: format!("a{index}"),
                parameters,
                precondition: Condition::And(parts),
                effect,
                span: Span::default(),
            });
        }
    }

    fn effect(&mut self, depth: usize) -> Effect {
        let kinds = if depth == 0 || !self.features.adl { 4 } else { 6 };
        match self.random.below(kinds) {
            0..=3 => self.change(),
            4 => {
                let condition = self.condition(1, self.domain.predicates.len());
                Effect::When(condition, Box::new(self.effect(depth - 1)))
            }
            _ => {
                let scope = self.variables.len();
                let parameters = self.parameters(&format!("e{scope}x"), 2);
                self.variables.extend(parameters.iter().map(|parameter| parameter.types.clone()));
                let inner = self.effect(depth - 1);
                self.variables.truncate(scope);
                if parameters.is_empty() { inner } else { Effect::Forall(parameters, Box::new(inner)) }
            }
        }
    }

    fn change(&mut self) -> Effect {
        let is_fluent = |predicate: &Predicate| predicate.name.starts_with("fluent");
        let fluents: Vec<usize> =
            (0..self.domain.predicates.len()).filter(|&p| is_fluent(&self.domain.predicates[p])).collect();
        let predicate = *self.random.choice(&fluents);
        match self.atom(predicate) {
            None => Effect::And(vec![]),
            Some(atom) if self.random.chance(0.5) => Effect::Add(atom),
            Some(atom) => Effect::Delete(atom),
        }
    }

    fn problem(&mut self) -> Problem {
        let mut objects = self.domain.constants.clone();
        for n in 0..=self.random.below(self.features.objects) {
            objects.push(Object { name: format!("o{n}"), types: self.some_types(), span: Span::default() });
        }
        let init = self.init(&objects);
        self.variables.clear();
        let end = self.domain.predicates.len();
        let goal = Condition::And((0..=self.random.below(2)).map(|_| self.condition(2, end)).collect());
        Problem {
            name: "random".into(),
            objects,
            init,
            costs: vec![],
            goal,
            minimizes_cost: false,
            goal_span: Span::default(),
            requirements: vec![],
            warnings: vec![],
        }
    }

    fn init(&mut self, objects: &[Object]) -> Vec<GroundAtom> {
        let density = 0.2 + 0.6 * self.random.unit();
        let mut init = Vec::new();
        for predicate in (0..self.domain.predicates.len()).filter(|&p| !self.domain.predicates[p].derived) {
            let parameters = &self.domain.predicates[predicate].parameters;
            for args in super::naive::bindings(&self.domain, objects, parameters) {
                if self.random.chance(density) {
                    init.push(GroundAtom { predicate: PredicateId::from(predicate), args });
                }
            }
        }
        self.random.shuffle(&mut init);
        init
    }
}

/// Every action with every well-typed list of arguments.
pub fn all_operators(domain: &Domain, problem: &Problem) -> Vec<(ActionId, Vec<ObjectId>)> {
    let operators = |action: usize| {
        let parameters = &domain.actions[action].parameters;
        super::naive::bindings(domain, &problem.objects, parameters).into_iter().map(move |args| (action.into(), args))
    };
    (0..domain.actions.len()).flat_map(operators).collect()
}
