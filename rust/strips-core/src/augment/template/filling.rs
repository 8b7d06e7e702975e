//! Filling a template: choices made, placeholders made objects.

use super::choices::{Choices, Odometer};
use super::{Array, Form, Hole, Kind, Pattern, Template};
use crate::pddl::ast::{Atom, Condition, Domain, GroundAtom, Object, ObjectId, Problem, Term, TypeId};
use crate::random::Random;
use crate::span::Span;

impl Template {
    /// Every problem that the template stands for, in a fixed order; those that differ only in names may repeat.
    pub fn expand<'t>(&'t self, domain: &'t Domain) -> impl Iterator<Item = Problem> + 't {
        let mut odometer = Some(Odometer::default());
        std::iter::from_fn(move || {
            let choices = odometer.as_mut()?;
            let problem = Filling::new(self, domain).fill(choices, self.distractors);
            if !choices.advance() {
                odometer = None;
            }
            Some(problem)
        })
    }

    /// One problem with choices drawn at random, and this many distractors more than the template asks for.
    pub fn draw(&self, domain: &Domain, surplus: (usize, usize), random: &mut Random) -> Problem {
        let (least, most) = self.distractors;
        Filling::new(self, domain).fill(random, (least + surplus.0, most + surplus.1))
    }

    /// The most objects that a problem of this template has, constants included.
    pub fn most_objects(&self, domain: &Domain) -> usize {
        let arrays: usize = self.arrays.iter().map(|array| array.sizes.iter().product::<usize>()).sum();
        domain.constants.len() + self.placeholders.len() + arrays + self.distractors.1
    }
}

impl Template {
    /// By how much the least and the most distractors must rise for every problem to have exactly `objects` objects;
    /// none where the template has no distractors, as in hanoi, where every disc has its place.
    pub fn surplus_for(&self, domain: &Domain, objects: usize) -> Option<(usize, usize)> {
        let (least, most) = self.distractors;
        let more = objects.saturating_sub(self.most_objects(domain));
        (!self.kinds.is_empty()).then_some((most - least + more, more))
    }
}

struct Filling<'t> {
    template: &'t Template,
    domain: &'t Domain,
    objects: Vec<Object>,
    init: Vec<GroundAtom>,
}

impl<'t> Filling<'t> {
    fn new(template: &'t Template, domain: &'t Domain) -> Self {
        Self { template, domain, objects: domain.constants.clone(), init: Vec::new() }
    }

    fn fill(mut self, choices: &mut impl Choices, (least, most): (usize, usize)) -> Problem {
        let template = self.template;
        for types in &template.placeholders {
            self.add_object(types[choose_one(choices, types.len())]);
        }
        template.arrays.iter().for_each(|array| self.add_array(array, choices));
        self.place_all(&template.init, &[], choices);
        let count = if template.kinds.is_empty() { 0 } else { least + choose_one(choices, most - least + 1) };
        let mut kind = 0;
        for _ in 0..count {
            let least = if choices.lists_multisets() { kind } else { 0 };
            kind = least + choose_one(choices, template.kinds.len() - least);
            self.add_distractor(&template.kinds[kind], choices);
        }
        self.finish()
    }

    fn add_object(&mut self, type_id: TypeId) -> ObjectId {
        let name = format!("o{}", self.objects.len() - self.domain.constants.len());
        self.objects.push(Object { name, types: vec![type_id], span: Span::default() });
        ObjectId::from(self.objects.len() - 1)
    }

    fn add_distractor(&mut self, kind: &Kind, choices: &mut impl Choices) {
        let this = self.add_object(kind.types[choose_one(choices, kind.types.len())]);
        self.place_all(&kind.forms, &[this], choices);
    }

    fn add_array(&mut self, array: &Array, choices: &mut impl Choices) {
        let objects: Vec<ObjectId> =
            (0..array.sizes.iter().product()).map(|_| self.add_object(array.type_id)).collect();
        for rule in &array.rules {
            for positions in rule.of.positions(&array.sizes) {
                let local: Vec<ObjectId> = positions.into_iter().map(|at| objects[at]).collect();
                self.place_all(&rule.forms, &local, choices);
            }
        }
    }

    /// Places forms; `local` are the objects that they are placed for.
    fn place_all(&mut self, forms: &[Form], local: &[ObjectId], choices: &mut impl Choices) {
        for form in forms {
            self.place(form, local, choices);
        }
    }

    fn place(&mut self, form: &Form, local: &[ObjectId], choices: &mut impl Choices) {
        match form {
            Form::Atom(pattern) => {
                let atom = self.ground(pattern, local, choices);
                if !self.init.contains(&atom) {
                    self.init.push(atom);
                }
            }
            Form::And(parts) => self.place_all(parts, local, choices),
            Form::OneOf(options) => {
                let open: Vec<&Form> = options.iter().filter(|option| self.is_open(option, local)).collect();
                if !open.is_empty() {
                    self.place(open[choose_one(choices, open.len())], local, choices);
                }
            }
        }
    }

    /// Whether every `(any …)` of the alternative finds an object.
    fn is_open(&self, form: &Form, local: &[ObjectId]) -> bool {
        match form {
            Form::And(parts) => parts.iter().all(|part| self.is_open(part, local)),
            Form::OneOf(options) => options.iter().any(|option| self.is_open(option, local)),
            Form::Atom(pattern) => pattern.terms.iter().all(|hole| match hole {
                Hole::Any(type_id) => !self.candidates(*type_id, local).is_empty(),
                _ => true,
            }),
        }
    }

    fn candidates(&self, type_id: TypeId, local: &[ObjectId]) -> Vec<ObjectId> {
        let fits = |object: &ObjectId| {
            !local.contains(object) && self.domain.accepts(&[type_id], &self.objects[object.index()])
        };
        (0..self.objects.len()).map(ObjectId::from).filter(fits).collect()
    }

    fn ground(&self, pattern: &Pattern, local: &[ObjectId], choices: &mut impl Choices) -> GroundAtom {
        let fill = |hole: &Hole| match *hole {
            Hole::Constant(object) => object,
            Hole::Placeholder(number) => ObjectId::from(self.domain.constants.len() + number),
            Hole::Local(number) => local[number],
            Hole::Any(type_id) => {
                let candidates = self.candidates(type_id, local);
                candidates[choose_one(choices, candidates.len())]
            }
        };
        GroundAtom { predicate: pattern.predicate, args: pattern.terms.iter().map(fill).collect() }
    }

    fn finish(self) -> Problem {
        let goal = self.template.goal.iter().flatten().map(|(positive, pattern)| self.literal(*positive, pattern));
        let goal = Condition::And(goal.collect());
        problem(self.domain, &self.template.name, self.objects, self.init, goal)
    }

    fn literal(&self, positive: bool, pattern: &Pattern) -> Condition {
        let term = |hole: &Hole| match *hole {
            Hole::Constant(object) => Term::Object(object),
            Hole::Placeholder(number) => Term::Object(ObjectId::from(self.domain.constants.len() + number)),
            Hole::Local(_) | Hole::Any(_) => unreachable!("the reader refuses these in goals"),
        };
        let atom =
            Condition::Atom(Atom { predicate: pattern.predicate, terms: pattern.terms.iter().map(term).collect() });
        if positive { atom } else { Condition::Not(Box::new(atom)) }
    }
}

/// A choice of one among one is none, so that it costs the odometer nothing.
fn choose_one(choices: &mut impl Choices, count: usize) -> usize {
    if count == 1 { 0 } else { choices.choose(count) }
}

/// A problem without costs, its initial atoms in canonical order.
fn problem(domain: &Domain, name: &str, objects: Vec<Object>, mut init: Vec<GroundAtom>, goal: Condition) -> Problem {
    init.sort_unstable();
    let requirements = domain.requirements.clone();
    let (name, costs, warnings) = (name.to_owned(), Vec::new(), Vec::new());
    let (minimizes_cost, goal_span) = (false, Span::default());
    Problem { name, objects, init, costs, goal, minimizes_cost, goal_span, requirements, warnings }
}
