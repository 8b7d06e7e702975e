//! From ids to text.
//!
//! A legend (`<VOCAB>`) has a word for each action and then, where predicates have words too, one for each of them. That
//! order tells an action from a predicate of the same name, which PDDL allows.

use std::borrow::Borrow;

use super::{ACTION, END, GOAL, INIT, OBJECTS, START, STATE, Style, VOCAB};
use crate::pddl::ast::{ActionId, Domain, GroundAtom, Object, ObjectId, PredicateId};

/// What ids are called in a text: names and words that may differ from those of the domain and the problem.
#[derive(Clone, Copy, Debug)]
pub struct Naming<'a, S = String> {
    /// Gives types their names, and actions and predicates theirs where there are no words.
    pub domain: &'a Domain,
    /// The objects, for their types and (where there are no `names`) names.
    pub objects: &'a [Object],
    /// A name for each object.
    pub names: Option<&'a [S]>,
    /// A word for each action.
    pub words: Option<&'a [S]>,
    /// A word for each predicate.
    pub predicates: Option<&'a [S]>,
}

/// A goal to be rendered.
#[derive(Debug)]
pub enum Goal<'a, A = GroundAtom> {
    /// The whole final state.
    State(&'a [A]),
    /// Literals; the flag is false for a negative one.
    Problem(&'a [(A, bool)]),
}

// Derived, these would ask the same of atoms.
impl<A> Copy for Goal<'_, A> {}

impl<A> Clone for Goal<'_, A> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<'a> Naming<'a> {
    /// The names that the domain and the problem themselves give.
    pub fn own(domain: &'a Domain, objects: &'a [Object]) -> Self {
        Self { domain, objects, names: None, words: None, predicates: None }
    }
}

impl<'a, S: AsRef<str>> Naming<'a, S> {
    /// Drawn names, and words: none, one for each action, or one for each action and then for each predicate.
    pub fn new(domain: &'a Domain, objects: &'a [Object], names: &'a [S], words: &'a [S]) -> Self {
        let (actions, predicates) = words.split_at(words.len().min(domain.actions.len()));
        let some = |words: &'a [S]| (!words.is_empty()).then_some(words);
        Self { domain, objects, names: Some(names), words: some(actions), predicates: some(predicates) }
    }

    /// The object's name.
    pub fn object(&self, object: ObjectId) -> &'a str {
        match self.names {
            Some(names) => names[object.index()].as_ref(),
            None => &self.objects[object.index()].name,
        }
    }

    /// The action's word.
    pub fn action(&self, action: ActionId) -> &'a str {
        match self.words {
            Some(words) => words[action.index()].as_ref(),
            None => &self.domain.actions[action.index()].name,
        }
    }

    /// The predicate's word.
    pub fn predicate(&self, predicate: PredicateId) -> &'a str {
        match self.predicates {
            Some(words) => words[predicate.index()].as_ref(),
            None => &self.domain.predicates[predicate.index()].name,
        }
    }
}

/// Appends a prompt. It ends without a space; [`render_completion`] begins with none.
pub fn render_prompt<S: AsRef<str>, A: Borrow<GroundAtom>>(
    naming: &Naming<'_, S>,
    style: Style,
    goal: Goal<'_, A>,
    init: &[A],
    out: &mut String,
) {
    out.push_str(START);
    if style == Style::Typed {
        render_objects(naming, out);
        render_vocab(naming, out);
    }
    segment(GOAL, out);
    render_goal(naming, goal, out);
    segment(INIT, out);
    render_atoms(naming, init, out);
}

/// Appends a completion: for each step an action's arguments and the whole state after it, then the end token.
///
/// States are expected in canonical order (predicates, then arguments, as declared).
pub fn render_completion<'s, S: AsRef<str>, A: Borrow<GroundAtom> + 's>(
    naming: &Naming<'_, S>,
    steps: impl IntoIterator<Item = (ActionId, &'s [ObjectId], &'s [A])>,
    out: &mut String,
) {
    for (action, args, state) in steps {
        out.push_str(ACTION);
        out.push(' ');
        render_call(naming, naming.action(action), args, out);
        segment(STATE, out);
        render_atoms(naming, state, out);
        out.push(' ');
    }
    out.push_str(END);
}

/// A whole text: prompt, space, completion.
pub fn render_record<'s, S: AsRef<str>>(
    naming: &Naming<'_, S>,
    style: Style,
    goal: Goal<'_>,
    init: &[GroundAtom],
    steps: impl IntoIterator<Item = (ActionId, &'s [ObjectId], &'s [GroundAtom])>,
) -> String {
    let mut out = String::with_capacity(1024);
    render_prompt(naming, style, goal, init, &mut out);
    out.push(' ');
    render_completion(naming, steps, &mut out);
    out
}

/// Appends atoms in the order given, each after a space, commas between them; nothing for none.
pub fn render_atoms<S: AsRef<str>, A: Borrow<GroundAtom>>(naming: &Naming<'_, S>, atoms: &[A], out: &mut String) {
    for (position, atom) in atoms.iter().map(Borrow::borrow).enumerate() {
        out.push_str(if position == 0 { " " } else { ", " });
        render_call(naming, naming.predicate(atom.predicate), &atom.args, out);
    }
}

fn render_goal<S: AsRef<str>, A: Borrow<GroundAtom>>(naming: &Naming<'_, S>, goal: Goal<'_, A>, out: &mut String) {
    let literals = match goal {
        Goal::State(atoms) => return render_atoms(naming, atoms, out),
        Goal::Problem(literals) => literals,
    };
    for (position, (atom, positive)) in literals.iter().enumerate() {
        out.push_str(if position == 0 { " " } else { ", " });
        out.push_str(if *positive { "" } else { "not " });
        let atom = atom.borrow();
        render_call(naming, naming.predicate(atom.predicate), &atom.args, out);
    }
}

fn render_objects<S: AsRef<str>>(naming: &Naming<'_, S>, out: &mut String) {
    segment(OBJECTS, out);
    for (id, object) in naming.objects.iter().enumerate() {
        out.push_str(if id == 0 { " " } else { ", " });
        out.push_str(naming.object(ObjectId::from(id)));
        for (position, kind) in object.types.iter().enumerate() {
            out.push(if position == 0 { ' ' } else { '/' });
            out.push_str(&naming.domain.types[kind.index()].name);
        }
    }
}

fn render_vocab<S: AsRef<str>>(naming: &Naming<'_, S>, out: &mut String) {
    if naming.words.is_none() && naming.predicates.is_none() {
        return;
    }
    segment(VOCAB, out);
    let domain = naming.domain;
    let action = |id: usize| (&domain.actions[id].name, naming.action(ActionId::from(id)));
    let predicate = |id: usize| (&domain.predicates[id].name, naming.predicate(PredicateId::from(id)));
    let predicates = if naming.predicates.is_some() { domain.predicates.len() } else { 0 };
    let pairs = (0..domain.actions.len()).map(action).chain((0..predicates).map(predicate));
    for (position, (name, word)) in pairs.enumerate() {
        out.push_str(if position == 0 { " " } else { ", " });
        out.push_str(name);
        out.push(' ');
        out.push_str(word);
    }
}

fn render_call<S: AsRef<str>>(naming: &Naming<'_, S>, name: &str, args: &[ObjectId], out: &mut String) {
    out.push_str(name);
    out.push('(');
    for (position, &argument) in args.iter().enumerate() {
        if position > 0 {
            out.push_str(", ");
        }
        out.push_str(naming.object(argument));
    }
    out.push(')');
}

fn segment(marker: &str, out: &mut String) {
    out.push(' ');
    out.push_str(marker);
}
