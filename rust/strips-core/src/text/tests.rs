//! The format as a whole: the report's figure to the letter, and laws between rendering and parsing.

use proptest::prelude::*;

use super::*;
use crate::pddl::ast::{Action, Atom, Condition, Domain, Effect, Object, Parameter, Predicate, Type, TypeId};
use crate::pddl::ast::{ActionId, GroundAtom, ObjectId, PredicateId};
use crate::span::Span;

/// The manipulation domain's signature; of what actions do, only which predicates they change.
pub(crate) fn manipulation() -> Domain {
    let kind = |name: &str, parent: Option<u32>| Type {
        name: name.into(),
        parents: parent.map(TypeId).into_iter().collect(),
        span: Span::default(),
    };
    let parameters = |arity: usize| (0..arity).map(parameter).collect::<Vec<_>>();
    let predicate = |(name, arity): &(&str, usize)| Predicate {
        name: (*name).into(),
        parameters: parameters(*arity),
        derived: false,
        span: Span::default(),
    };
    let action = |(name, arity): &(&str, usize)| Action {
        name: (*name).into(),
        parameters: parameters(*arity),
        precondition: Condition::And(vec![]),
        effect: Effect::And((0..5).map(|id| Effect::Add(Atom { predicate: PredicateId(id), terms: vec![] })).collect()),
        span: Span::default(),
    };
    Domain {
        name: "manipulation".into(),
        requirements: vec![],
        types: vec![
            kind("object", None),
            kind("physobj", Some(0)),
            kind("movable", Some(1)),
            kind("fixture", Some(1)),
            kind("tool", Some(2)),
            kind("openable", Some(2)),
            kind("vessel", Some(5)),
            kind("container", Some(5)),
        ],
        constants: vec![object("table", 3)],
        pending: vec![],
        predicates: [("inhand", 1), ("inworkspace", 1), ("on", 2), ("in", 2), ("opened", 1)]
            .iter()
            .map(predicate)
            .collect(),
        axioms: vec![],
        actions: [("pick", 1), ("place", 2), ("push", 3), ("open", 1), ("close", 1)].iter().map(action).collect(),
        has_total_cost: false,
        cost_functions: vec![],
        warnings: vec![],
    }
}

fn parameter(number: usize) -> Parameter {
    Parameter { name: format!("x{number}"), types: vec![TypeId::OBJECT], span: Span::default() }
}

pub(crate) fn object(name: &str, kind: u32) -> Object {
    Object { name: name.into(), types: vec![TypeId(kind)], span: Span::default() }
}

fn atom(predicate: u32, args: &[u32]) -> GroundAtom {
    GroundAtom { predicate: PredicateId(predicate), args: args.iter().map(|&object| ObjectId(object)).collect() }
}

const WORDS: [&str; 5] = ["lift", "put", "push", "open", "close"];

/// Figure 4 of the report, its line breaks made spaces, its end token spelled as its start token is.
pub(crate) const FIGURE_4: &str = "<|startoftext|> \
    <GOAL> inworkspace(table), inworkspace(teabag), inworkspace(cup), on(teabag, cup), on(cup, table), opened(cup) \
    <INIT> inworkspace(table), inworkspace(teabag), inworkspace(cup), on(teabag, shelf), on(cup, shelf) \
    <ACTION> lift(cup) \
    <STATE> inhand(cup), inworkspace(table), inworkspace(teabag), inworkspace(cup), on(teabag, shelf) \
    <ACTION> put(cup, table) \
    <STATE> inworkspace(table), inworkspace(teabag), inworkspace(cup), on(teabag, shelf), on(cup, table) \
    <ACTION> open(cup) \
    <STATE> inworkspace(table), inworkspace(teabag), inworkspace(cup), on(teabag, shelf), on(cup, table), opened(cup) \
    <ACTION> lift(teabag) \
    <STATE> inhand(teabag), inworkspace(table), inworkspace(teabag), inworkspace(cup), on(cup, table), opened(cup) \
    <ACTION> put(teabag, cup) \
    <STATE> inworkspace(table), inworkspace(teabag), inworkspace(cup), on(teabag, cup), on(cup, table), opened(cup) \
    <|endoftext|>";

type Step = (ActionId, Vec<ObjectId>, Vec<GroundAtom>);

/// Figure 4's problem: objects (table 0, teabag 1, cup 2, shelf 3), initial state, and the five steps.
fn figure_4() -> (Vec<Object>, Vec<GroundAtom>, Vec<Step>) {
    let objects = vec![object("table", 3), object("teabag", 2), object("cup", 6), object("shelf", 3)];
    let workspace = [atom(1, &[0]), atom(1, &[1]), atom(1, &[2])];
    let state = |before: &[GroundAtom], after: &[GroundAtom]| [before, &workspace, after].concat();
    let (cup_on_table, opened) = (atom(2, &[2, 0]), atom(4, &[2]));
    let init = state(&[], &[atom(2, &[1, 3]), atom(2, &[2, 3])]);
    let states = vec![
        state(&[atom(0, &[2])], &[atom(2, &[1, 3])]),
        state(&[], &[atom(2, &[1, 3]), cup_on_table.clone()]),
        state(&[], &[atom(2, &[1, 3]), cup_on_table.clone(), opened.clone()]),
        state(&[atom(0, &[1])], &[cup_on_table.clone(), opened.clone()]),
        state(&[], &[atom(2, &[1, 2]), cup_on_table, opened]),
    ];
    let calls: [(u32, &[u32]); 5] = [(0, &[2]), (1, &[2, 0]), (3, &[2]), (0, &[1]), (1, &[1, 2])];
    let call = |(action, args): (u32, &[u32])| (ActionId(action), args.iter().map(|&id| ObjectId(id)).collect());
    let steps = calls.map(call).into_iter().zip(states).map(|((action, args), state)| (action, args, state)).collect();
    (objects, init, steps)
}

#[test]
fn the_figure_of_the_report_is_rendered_to_the_letter() {
    let domain = manipulation();
    let (objects, init, steps) = figure_4();
    let naming = Naming { domain: &domain, objects: &objects, names: None, words: Some(&WORDS[..]), predicates: None };
    let goal = steps.last().map(|step| step.2.clone()).unwrap();
    let steps = steps.iter().map(|(action, args, state)| (*action, &args[..], &state[..]));
    assert_eq!(render_record(&naming, Style::Paper, Goal::State(&goal), &init, steps), FIGURE_4);
}

#[test]
fn the_typed_style_says_types_and_words() {
    let domain = manipulation();
    let (objects, init, _) = figure_4();
    let names = ["bench", "sachet", "mug", "rack"];
    let naming = Naming {
        domain: &domain,
        objects: &objects,
        names: Some(&names[..]),
        words: Some(&WORDS[..]),
        predicates: None,
    };
    let goal = [(atom(2, &[2, 0]), true), (atom(4, &[2]), false)];
    let mut text = String::new();
    render_prompt(&naming, Style::Typed, Goal::Problem(&goal), &init[3..], &mut text);
    assert_eq!(
        text,
        "<|startoftext|> <OBJECTS> bench fixture, sachet movable, mug vessel, rack fixture \
         <VOCAB> pick lift, place put, push push, open open, close close \
         <GOAL> on(mug, bench), not opened(mug) <INIT> on(sachet, rack), on(mug, rack)"
    );
    let prompt = parse_prompt(&text).unwrap();
    assert_eq!(prompt.objects.unwrap()[1], ("sachet", "movable"));
    assert_eq!(prompt.vocab.unwrap()[1], ("place", "put"));
    assert_eq!(prompt.goal.iter().map(|literal| literal.1).collect::<Vec<_>>(), [true, false]);
    assert_eq!(prompt.init.len(), 2);
}

#[test]
fn a_legend_may_say_words_for_predicates_after_those_for_actions() {
    let domain = manipulation();
    let (objects, init, _) = figure_4();
    let names = ["bench", "sachet", "mug", "rack"];
    let words = [&WORDS[..], &["held", "near", "atop", "inside", "opened"]].concat();
    let naming = Naming::new(&domain, &objects, &names, &words);
    let mut text = String::new();
    render_prompt(&naming, Style::Typed, Goal::Problem(&[(atom(2, &[2, 0]), true)]), &init[2..], &mut text);
    assert_eq!(
        text.split_once(" <VOCAB>").unwrap().1,
        " pick lift, place put, push push, open open, close close, inhand held, inworkspace near, on atop, in inside, \
         opened opened <GOAL> atop(mug, bench) <INIT> near(mug), atop(sachet, rack), atop(mug, rack)"
    );
    assert_eq!(parse_prompt(&text).unwrap().vocab.unwrap()[7], ("on", "atop"));
}

#[test]
fn the_figure_is_parsed_with_and_without_line_breaks() {
    let broken = FIGURE_4.replace(" <", "\n<");
    for text in [FIGURE_4, &broken] {
        let (prompt, completion) = split_text(text);
        let prompt = parse_prompt(prompt).unwrap();
        assert_eq!((prompt.objects, prompt.goal.len(), prompt.init.len()), (None, 6, 5));
        let completion = parse_completion(completion);
        assert_eq!((completion.finished, completion.malformed), (true, None));
        let calls: Vec<_> = completion.steps.iter().map(|step| (step.action.name, &step.action.args[..])).collect();
        assert_eq!(calls[1], ("put", &["cup", "table"][..]));
        assert!(completion.steps.iter().all(|step| step.state.as_ref().is_some_and(|state| state.len() >= 5)));
    }
}

#[test]
fn no_atoms_and_no_arguments_are_written_and_read() {
    let text = "<ACTION> wait() <STATE> <ACTION> rest() <STATE> handempty() <|endoftext|>";
    let completion = parse_completion(text);
    assert_eq!(completion.steps[0].state, Some(vec![]));
    assert_eq!(completion.steps[1].state, Some(vec![TextAtom { name: "handempty", args: vec![] }]));
    assert!(completion.finished);
}

#[test]
fn what_cannot_be_read_is_told_with_its_position() {
    let cases = [
        ("<ACTION> lift cup", 0, 13, "`(`"),
        ("<ACTION> lift(cup) <STATE> inhand(cup) on(a)", 1, 39, "`<ACTION>` or `<|endoftext|>`"),
        ("<ACTION> lift(cup) <STATE> inhand(cup", 1, 37, "`,` or `)`"),
        ("lift(cup)", 0, 0, "`<ACTION>` or `<|endoftext|>`"),
        ("<ACTION> ", 0, 9, "a name"),
    ];
    for (text, steps, offset, expected) in cases {
        let completion = parse_completion(text);
        assert_eq!((completion.steps.len(), completion.finished), (steps, false), "{text}");
        assert_eq!(completion.malformed, Some(Malformed { offset, expected }), "{text}");
    }
    let cut = parse_completion("<ACTION> lift(cup) <STATE> inhand(cup) ");
    assert_eq!((cut.steps.len(), cut.finished, cut.malformed), (1, false, None));
    assert_eq!(parse_completion("<ACTION> lift(cup) <|endoftext|>").steps[0].state, None);
    assert_eq!(parse_prompt("<GOAL> ").unwrap_err().offset, 0);
}

proptest! {
    #[test]
    fn parsing_never_panics(text in "(<ACTION>|<STATE>|<\\|endoftext\\|>|<|[a-c(), é\n]|on\\(a, b\\)| )*") {
        let completion = parse_completion(&text);
        if let Some(malformed) = completion.malformed {
            prop_assert!(malformed.offset <= text.len() && !completion.finished);
        }
        let _ = parse_prompt(&text);
        let (prompt, rest) = split_text(&text);
        prop_assert!(prompt.len() + rest.len() <= text.len());
    }

    #[test]
    fn what_is_rendered_is_read_back(atoms in proptest::collection::vec((0u32..5, [0u32..4, 0..4, 0..4]), 0..9)) {
        let domain = manipulation();
        let (objects, _, _) = figure_4();
        let naming = Naming { domain: &domain, objects: &objects, names: None, words: Some(&WORDS[..]), predicates: None };
        let state: Vec<_> = atoms.iter().map(|(predicate, args)| {
            atom(*predicate, &args[..domain.predicates[*predicate as usize].parameters.len()])
        }).collect();
        let (action, args) = (ActionId(2), [ObjectId(0), ObjectId(1), ObjectId(2)]);
        let text = render_record(&naming, Style::Typed, Goal::State(&state), &state, [(action, &args[..], &state[..])]);
        let (prompt, completion) = split_text(&text);
        let (prompt, completion) = (parse_prompt(prompt).unwrap(), parse_completion(completion));
        prop_assert!(completion.finished);
        prop_assert_eq!(completion.steps[0].state.as_ref(), Some(&prompt.init));
        let read: Vec<_> = prompt.init.iter().map(|found| {
            let args = found.args.iter().map(|name| ObjectId::from(objects.iter().position(|o| o.name == *name).unwrap()));
            GroundAtom { predicate: PredicateId::from(domain.predicates.iter().position(|p| p.name == found.name).unwrap()), args: args.collect() }
        }).collect();
        prop_assert_eq!(read, state);
    }
}
