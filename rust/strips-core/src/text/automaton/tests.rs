//! What the automaton allows is what can be executed, and all of it that visits no state twice.

use std::collections::BTreeSet;

use super::*;
use crate::pddl::{Source, parse_domain, parse_problem};
use crate::random::Random;
use crate::search::{PlanSet, Reach, Semantics, StateSpace};
use crate::task::ground;
use crate::task::limits::Limits;
use crate::text::canonical::{Hints, Synonyms};
use crate::text::{Goal, Naming, Style, goal_literals, parse_completion, render_completion, render_prompt};
use crate::validate::validate_operators;

/// A robot, rooms, and lamps that all go out when the fuse blows; some effects are conditional.
const DOMAIN: &str = "(define (domain lamps) (:requirements :typing :conditional-effects :negative-preconditions)
    (:types room lamp) (:constants hall - room)
    (:predicates (robot ?r - room) (door ?a ?b - room) (hangs ?l - lamp ?r - room) (lit ?l - lamp) (blown))
    (:action go :parameters (?a ?b - room) :precondition (and (robot ?a) (door ?a ?b))
        :effect (and (robot ?b) (not (robot ?a))))
    (:action light :parameters (?l - lamp ?r - room) :precondition (and (robot ?r) (hangs ?l ?r) (not (blown)))
        :effect (lit ?l))
    (:action overload :parameters () :precondition (not (blown))
        :effect (and (blown) (forall (?l - lamp) (when (lit ?l) (not (lit ?l))))))
    (:action mend :parameters () :precondition (and (robot hall) (blown)) :effect (not (blown))))";

const PROBLEM: &str = "(define (problem two) (:domain lamps) (:objects attic - room red blue - lamp)
    (:init (robot hall) (door hall attic) (door attic hall) (hangs red attic) (hangs blue hall) (lit red))
    (:goal (and (lit blue) (not (lit red)) (robot attic))))";

fn lamps() -> Arc<Task> {
    lamps_of(PROBLEM)
}

fn lamps_of(problem: &str) -> Arc<Task> {
    let domain = Arc::new(parse_domain(&Source::new("domain", DOMAIN)).unwrap());
    let problem = parse_problem(&Source::new("problem", problem), &domain, None).unwrap();
    Arc::new(ground(domain, Arc::new(problem), &Limits::default()).unwrap())
}

const WORDS: [&str; 4] = ["walk", "kindle", "overload", "repair"];

/// A task, the codec and the rest that a walk needs.
struct Scene {
    task: Arc<Task>,
    codec: Arc<Codec>,
    names: Vec<String>,
    prompt: String,
    legend: Legend,
    spoken: Arc<SpokenTask>,
}

impl Scene {
    fn new(layout: Layout, stop_at_goal: bool) -> Self {
        Self::of(lamps(), |codec| codec, layout, stop_at_goal)
    }

    /// With each object's type before each mention of it.
    fn saying_kinds(layout: Layout, stop_at_goal: bool) -> Self {
        Self::of(lamps(), Codec::saying_kinds, layout, stop_at_goal)
    }

    fn of(task: Arc<Task>, kind: fn(Codec) -> Codec, layout: Layout, stop_at_goal: bool) -> Self {
        let codec = Arc::new(kind(Codec::new(&[(&task.domain, Synonyms::default())], layout)));
        let names: Vec<String> = ["hall", "loft", "ruby", "azure"].map(str::to_owned).to_vec();
        let mut scene = Self {
            spoken: Arc::new(SpokenTask::new(
                task.clone(),
                Arc::new(SuccessorGenerator::new(&task)),
                codec.clone(),
                &Legend::default(),
                None,
                stop_at_goal,
            )),
            prompt: String::new(),
            legend: Legend::default(),
            task,
            codec,
            names,
        };
        scene.speak(stop_at_goal);
        scene
    }

    fn naming(&self) -> Naming<'_, String> {
        Naming::new(&self.task.domain, &self.task.problem.objects, &self.names, &[])
    }

    fn speak(&mut self, stop_at_goal: bool) {
        let goal = goal_literals(&self.task.domain, &self.task.problem).unwrap();
        let mut prompt = String::new();
        let words: Vec<String> = WORDS.map(str::to_owned).to_vec();
        let naming = Naming { words: Some(&words[..]), ..self.naming() };
        let init = self.task.atoms(&self.task.init);
        render_prompt(&naming, Style::Typed, Goal::Problem(&goal), &init, &mut prompt);
        self.legend = self.codec.encode(&prompt, &Hints::default()).1;
        let generator = Arc::new(SuccessorGenerator::new(&self.task));
        let (task, codec) = (self.task.clone(), self.codec.clone());
        let spoken = SpokenTask::new(task, generator, codec, &self.legend, Some(&self.names), stop_at_goal);
        self.spoken = Arc::new(spoken);
        self.prompt = prompt;
    }

    /// The states that a plan visits, the first one included.
    fn states(&self, plan: &[OperatorId]) -> Vec<State> {
        let mut states = vec![self.task.init.clone()];
        for operator in plan {
            let next = self.task.apply(&self.task.operators[operator.index()], states.last().unwrap());
            states.push(next);
        }
        states
    }

    /// The text of a plan after the prompt, with the prompt's words.
    fn completion(&self, plan: &[OperatorId]) -> String {
        let words: Vec<String> = WORDS.map(str::to_owned).to_vec();
        let naming = Naming { words: Some(&words[..]), ..self.naming() };
        let atoms: Vec<_> = self.states(plan)[1..].iter().map(|state| self.task.atoms(state)).collect();
        let operators = plan.iter().map(|operator| &self.task.operators[operator.index()]);
        let steps = operators.zip(&atoms).map(|(operator, state)| (operator.action, &operator.args[..], &state[..]));
        let mut text = String::new();
        render_completion(&naming, steps, &mut text);
        text
    }

    /// The canonical words of a plan's completion.
    fn words(&self, plan: &[OperatorId]) -> Vec<Word> {
        let mut words = Vec::new();
        self.codec.encode_into(&format!("{} {}", self.prompt, self.completion(plan)), &Hints::default(), &mut words);
        let prompt = words.iter().position(|&word| word == Marker::Action as Word || word == Marker::End as Word);
        words.split_off(prompt.unwrap())
    }
}

/// Follows `words` through the automaton; whether it allows them all, forces nothing else, and has ended.
fn allows(scene: &Scene, words: &[Word]) -> bool {
    let (mut walk, mut forced) = Walk::start(scene.spoken.clone());
    let mut rest = words;
    loop {
        let Some(left) = rest.strip_prefix(&forced[..]) else { return false };
        let Some((&word, left)) = left.split_first() else { return walk.has_ended() };
        let Ok(more) = walk.advance(word) else { return false };
        (rest, forced) = (left, more);
    }
}

/// Whether the plan visits no state twice.
fn is_simple(scene: &Scene, plan: &[OperatorId]) -> bool {
    let states = scene.states(plan);
    states.iter().collect::<FxHashSet<_>>().len() == states.len()
}

#[test]
fn every_plan_that_visits_no_state_twice_is_allowed_and_no_other() {
    for layout in [Layout::Difference, Layout::Progress, Layout::Report] {
        for (semantics, stop_at_goal) in [(Semantics::Any, false), (Semantics::FirstGoal, true)] {
            for scene in [Scene::new(layout, stop_at_goal), Scene::saying_kinds(layout, stop_at_goal)] {
                let plans = PlanSet::new(scene.task.clone(), 7, semantics, &Limits::default()).unwrap();
                let verdict = |plan: &[OperatorId]| (is_simple(&scene, plan), allows(&scene, &scene.words(plan)));
                let verdicts: Vec<_> = plans.iter().map(|plan| verdict(&plan.0)).collect();
                assert!(verdicts.iter().all(|(simple, allowed)| simple == allowed));
                assert!(verdicts.iter().any(|verdict| verdict.0) && verdicts.iter().any(|verdict| !verdict.0));
            }
        }
    }
}

#[test]
fn whatever_is_chosen_the_text_is_an_executable_plan_with_the_true_states() {
    let scene = Scene::new(Layout::Difference, false);
    let (mut random, mut ended) = (Random::new(1, 0), BTreeSet::new());
    for _ in 0..300 {
        let (mut walk, mut words) = Walk::start(scene.spoken.clone());
        while !walk.has_ended() && !walk.is_stuck() {
            let word = *random.choice(&walk.options());
            words.push(word);
            words.extend(walk.advance(word).unwrap());
        }
        let mut prompt = Vec::new();
        scene.codec.encode_into(&scene.prompt, &Hints::default(), &mut prompt);
        let text = scene.codec.decode_completion(&prompt, &words, &scene.legend);
        let whole = scene.completion(walk.plan());
        assert!(whole.starts_with(&text), "{text}\n{whole}");
        assert_eq!((parse_completion(&text).malformed, parse_completion(&text).finished), (None, walk.has_ended()));
        assert_eq!(validate_operators(&scene.task, walk.plan()).is_valid(), walk.has_ended());
        ended.insert(walk.has_ended());
    }
    assert_eq!(ended.len(), 2, "some walks end and some are stuck");
}

/// Chooses at random until the end; where the walk is stuck it backtracks, and where it cannot it is given back as it is.
fn walk_with_backtracks(scene: &Scene, random: &mut Random) -> (Walk, Vec<Word>, usize) {
    let (mut walk, mut words) = Walk::start(scene.spoken.clone());
    let mut backtracks = 0;
    while !walk.has_ended() {
        if walk.is_stuck() {
            let before = walk.plan().to_vec();
            let Some((steps, forced)) = walk.backtrack() else { break };
            assert!(steps < before.len() && walk.plan()[..steps] == before[..steps]);
            let said = |word: &Word| *word == Marker::Action as Word;
            let steps_begin: Vec<_> = (0..words.len()).filter(|&at| said(&words[at])).collect();
            words.truncate(steps_begin[steps]);
            words.extend(forced);
            backtracks += 1;
            continue;
        }
        let word = *random.choice(&walk.options());
        words.push(word);
        words.extend(walk.advance(word).unwrap());
    }
    (walk, words, backtracks)
}

#[test]
fn a_walk_that_backtracks_where_it_is_stuck_comes_to_the_goal() {
    let scene = Scene::new(Layout::Difference, true);
    let (mut random, mut most) = (Random::new(2, 0), 0);
    for _ in 0..300 {
        let (walk, words, backtracks) = walk_with_backtracks(&scene, &mut random);
        assert!(walk.has_ended() && is_simple(&scene, walk.plan()));
        assert!(validate_operators(&scene.task, walk.plan()).is_valid());
        assert_eq!(words, scene.words(walk.plan()));
        most = most.max(backtracks);
    }
    assert!(most > 1, "some backtrack more than once");
}

#[test]
fn without_a_plan_a_walk_that_backtracks_comes_to_every_state() {
    let problem = PROBLEM.replace("(lit blue) (not (lit red))", "(hangs red hall)");
    let scene = Scene::of(lamps_of(&problem), Codec::saying_kinds, Layout::Difference, true);
    let reachable = StateSpace::explore(&scene.task, Reach::default(), &Limits::default()).unwrap().len();
    let mut random = Random::new(3, 0);
    for _ in 0..30 {
        let (walk, _, _) = walk_with_backtracks(&scene, &mut random);
        assert!(!walk.has_ended() && walk.is_stuck());
        assert_eq!(walk.visited.len(), reachable);
    }
}

/// The fewest steps between two of the states, through these alone: every way, layer by layer.
fn fewest_steps(scene: &Scene, states: &FxHashSet<State>) -> usize {
    let mut layer = FxHashSet::from_iter([scene.task.init.clone()]);
    for steps in 0.. {
        if layer.iter().any(|state| scene.task.goal.holds(state)) {
            return steps;
        }
        let successors = |state: &State| {
            let applicable = scene.task.operators.iter().filter(|operator| operator.applicable(state));
            applicable.map(|operator| scene.task.apply(operator, state)).collect::<Vec<_>>()
        };
        layer = layer.iter().flat_map(successors).filter(|state| states.contains(state)).collect();
    }
    unreachable!("the walk's own plan leads to the goal")
}

#[test]
fn a_shortened_plan_is_the_shortest_through_the_states_of_the_walk() {
    for layout in [Layout::Difference, Layout::Progress, Layout::Report] {
        let scene = Scene::new(layout, true);
        let (mut random, mut shorter) = (Random::new(4, 0), 0);
        for _ in 0..200 {
            let (walk, words, _) = walk_with_backtracks(&scene, &mut random);
            let fewest = fewest_steps(&scene, &walk.visited);
            let Some(shortened) = walk.shortened() else {
                assert_eq!(fewest, walk.plan().len());
                continue;
            };
            let steps = shortened.iter().filter(|&&word| word == Marker::Action as Word).count();
            assert!(steps == fewest && fewest < walk.plan().len() && shortened.len() < words.len());
            assert!(allows(&scene, &shortened), "an executable plan to the goal with the true states");
            shorter += 1;
        }
        assert!((20..180).contains(&shorter), "{shorter}");
    }
}

#[test]
fn a_walk_that_has_not_ended_is_not_shortened() {
    let (walk, _) = Walk::start(Scene::new(Layout::Difference, true).spoken.clone());
    assert_eq!(walk.shortened(), None);
}

#[test]
fn a_word_that_is_not_allowed_is_refused_and_changes_nothing() {
    let scene = Scene::new(Layout::Difference, true);
    let (mut walk, forced) = Walk::start(scene.spoken.clone());
    assert_eq!(forced, [Marker::Action as Word], "the goal does not hold at the start");
    let options = walk.options();
    assert_eq!(walk.advance(Marker::End as Word), Err(NotAllowed(Marker::End as Word)));
    assert_eq!(walk.options(), options);
    let said: Vec<_> = options.iter().map(|&word| scene.codec.vocabulary().join(&[word])).collect();
    assert_eq!(said, ["go", "light", "overload"]);
}

#[test]
fn operators_about_objects_without_a_name_are_left_out() {
    let scene = Scene::new(Layout::Difference, true);
    let mut legend = scene.legend.clone();
    legend.names[2].clear();
    let generator = scene.spoken.generator.clone();
    let spoken = SpokenTask::new(scene.task.clone(), generator, scene.codec.clone(), &legend, Some(&scene.names), true);
    let unsaid = spoken.operators.iter().filter(|words| words.is_empty()).count();
    let about_it = scene.task.operators.iter().filter(|operator| operator.args.iter().any(|arg| arg.0 == 2)).count();
    assert!(unsaid == about_it && unsaid > 0);
}

#[test]
fn rows_in_a_models_own_tokens_move_together() {
    let scene = Scene::new(Layout::Difference, true);
    let mut vocabulary = scene.codec.vocabulary().with_slots(4);
    vocabulary.reverse();
    vocabulary.push("<|padding|>".to_owned());
    let token = |word: &str| vocabulary.iter().position(|known| known == word).unwrap() as u32;
    let mut decoder = MaskedDecoder::new(&scene.codec, &vocabulary);
    let forced = decoder.add(vec![scene.spoken.clone(), scene.spoken.clone()]).unwrap();
    assert_eq!(forced, [[token("<ACTION>")], [token("<ACTION>")]]);
    let forced = decoder.advance(&[1, 0], &[token("light"), token("overload")]).unwrap();
    let said =
        |tokens: &[u32]| tokens.iter().map(|&token| &vocabulary[token as usize][..]).collect::<Vec<_>>().join(" ");
    assert_eq!(said(&forced[0]), "o3 o0 <STATE> +lit o3 <ACTION>");
    assert_eq!(said(&forced[1]), "<STATE> +blown -lit o2 <ACTION>");
    let mut flags = vec![true; 2 * vocabulary.len()];
    decoder.mask(&[0, 1], &mut flags).unwrap();
    let allowed = |row: usize| {
        let flags = &flags[row * vocabulary.len()..][..vocabulary.len()];
        (0..vocabulary.len()).filter(|&token| flags[token]).map(|token| &vocabulary[token][..]).collect::<BTreeSet<_>>()
    };
    assert_eq!((allowed(0), allowed(1)), (BTreeSet::from(["go", "mend"]), BTreeSet::from(["go", "overload"])));
    let copy = decoder.fork(0).unwrap();
    let end = token("<|endoftext|>");
    assert_eq!(decoder.advance(&[copy], &[end]), Err(MaskError::NotAllowed { row: copy, token: end }));
    decoder.remove(&[0]);
    assert_eq!(decoder.advance(&[1, 0], &[0, 0]), Err(MaskError::NoRow { row: 0 }));
    assert_eq!(decoder.walk(1).unwrap().plan().len(), 1);
}
