//! One record: a problem, a plan, names, words, a style and a negative, all drawn from the record's own stream.

use std::borrow::Cow;

use super::config::RecordConfig;
use super::shape::Shape;
use super::splits::{Pools, Split};
use super::table::{Batch, UNKNOWN, count, template_name};
use crate::augment::Lexicon;
use crate::negative::{Corruption, Goal as WantedGoal, Negative, Step, draw_negative, trace};
use crate::pddl::ast::{Domain, Object};
use crate::random::Random;
use crate::task::{Fact, State};
use crate::text::{self, Naming, Style, render_completion, render_prompt};

/// What every record is drawn from.
pub(super) struct Book {
    pub domain: std::sync::Arc<Domain>,
    pub config: RecordConfig,
    /// The weight of each kind of negative, in the order of [`Corruption::ALL`].
    pub negatives: [f64; Corruption::ALL.len()],
    pub lexicon: Lexicon,
    pub templates: Vec<String>,
    pub pools: Pools,
}

/// A record before it is written down.
struct Drawn<'b> {
    shape: &'b Shape,
    id: usize,
    steps: Vec<Step<'b>>,
    last: State,
    names: Vec<Cow<'b, str>>,
    /// A word for each action and, in data sets where predicates have words too, for each predicate.
    words: Vec<&'b str>,
    /// How many of `words` the text says: none, the actions', or all; the others are the domain's names.
    said: usize,
    style: Style,
    negative: Negative<'b>,
}

impl Book {
    /// Adds the record with this index of the split to the batch; `text` is room to write in.
    pub fn write(&self, split: Split, index: u64, text: &mut String, batch: &mut Batch) {
        let random = Random::new(self.config.seed, index).fork(split.name());
        let seed = random.fork("seed").bits();
        let drawn = self.draw(split, index, &random);
        self.write_texts(&drawn, &mut random.fork("order"), text, batch);
        self.write_facts(&drawn, text, batch);
        batch.index.push(index.cast_signed());
        batch.seed.push(seed);
    }

    fn draw(&self, split: Split, index: u64, random: &Random) -> Drawn<'_> {
        let id = self.pools.of(split).draw(index, &mut random.fork("shape")) as usize;
        let shape = &self.pools.shapes[id];
        let (steps, last) = trace(&shape.task, random.fork("plan").choice::<Vec<_>>(&shape.plans));
        let naming = split.naming(&self.config);
        let objects: &[Object] = &shape.task.problem.objects;
        let names = naming.draw_names(&self.domain, &self.lexicon, objects, &mut random.fork("names"));
        let mut random_style = random.fork("style");
        let paper = random_style.chance(split.paper_share(&self.config));
        let style = if paper { Style::Paper } else { Style::Typed };
        let uses_words = random_style.chance(split.words_share(&self.config)) || paper;
        let (words, said) = self.draw_words(split, uses_words, paper, random);
        let negative = draw_negative(&shape.task, &shape.goal, &steps, &self.negatives, &mut random.fork("negative"));
        Drawn { shape, id, steps, last, names, words, said, style, negative }
    }

    /// Words for actions and, where the configuration has words for predicates, for these; and how many of them are said.
    ///
    /// Without a legend, as in the report's style (`paper`), a reader could not know what a predicate's word means.
    fn draw_words(&self, split: Split, uses_words: bool, paper: bool, random: &Random) -> (Vec<&str>, usize) {
        let (domain, lexicon, naming) = (&self.domain, &self.lexicon, split.naming(&self.config));
        let mut words = if uses_words {
            naming.draw_words(domain, lexicon, &mut random.fork("words"))
        } else {
            domain.actions.iter().map(|action| &action.name[..]).collect()
        };
        let mut said = if uses_words { words.len() } else { 0 };
        if self.config.predicate_words > 0.0 {
            let mut random = random.fork("predicate words");
            if random.chance(split.predicate_words(&self.config)) && uses_words && !paper {
                words.extend(naming.draw_predicate_words(domain, lexicon, &mut random));
                said = words.len();
            } else {
                words.extend(domain.predicates.iter().map(|predicate| &predicate.name[..]));
            }
        }
        (words, said)
    }

    fn write_texts(&self, drawn: &Drawn<'_>, random: &mut Random, text: &mut String, batch: &mut Batch) {
        let task = &drawn.shape.task;
        let names: Vec<&str> = drawn.names.iter().map(|name| &name[..]).collect();
        let naming = Naming::new(&self.domain, &task.problem.objects, &names, &drawn.words[..drawn.said]);
        text.clear();
        self.write_prompt(&naming, drawn, random, text);
        batch.prompt.push(text);
        for (steps, column) in [(&drawn.steps, &mut batch.completion), (&drawn.negative.steps, &mut batch.negative)] {
            text.clear();
            let parts = steps.iter().map(|step| (step.action, &step.args[..], &step.state[..]));
            render_completion(&naming, parts, text);
            column.push(text);
        }
    }

    fn write_prompt(&self, naming: &Naming<'_, &str>, drawn: &Drawn<'_>, random: &mut Random, out: &mut String) {
        let task = &drawn.shape.task;
        let shuffled = random.chance(self.config.shuffled_share);
        let mut init = task.atoms_by_reference(&task.init);
        shuffle_if(shuffled, &mut init, random);
        match &drawn.shape.goal {
            WantedGoal::State(_) => {
                let mut atoms = task.atoms_by_reference(&drawn.last);
                shuffle_if(shuffled, &mut atoms, random);
                render_prompt(naming, drawn.style, text::Goal::State(&atoms), &init, out);
            }
            WantedGoal::Literals(literals) => {
                let mut literals: Vec<(&Fact, bool)> = literals.iter().map(|(fact, value)| (fact, *value)).collect();
                shuffle_if(shuffled, &mut literals, random);
                render_prompt(naming, drawn.style, text::Goal::Problem(&literals), &init, out);
            }
        }
    }

    fn write_facts(&self, drawn: &Drawn<'_>, text: &mut String, batch: &mut Batch) {
        let Drawn { shape, negative, .. } = drawn;
        text.clear();
        self.write_ipc(&drawn.steps, &drawn.names, text);
        batch.plan.push(text);
        batch.negative_kind.push(negative.kind.name());
        batch.negative_verdict.push(negative.fault.kind.name());
        batch.negative_step.push(count(negative.fault.step));
        batch.problem_id.push(count(drawn.id));
        batch.names.push(&drawn.names);
        batch.words.push(&drawn.words);
        batch.template.push(template_name(shape.source, &self.templates));
        batch.style.push(drawn.style.name());
        batch.goal_style.push(shape.goal_style().name());
        batch.steps.push(count(drawn.steps.len()));
        batch.optimal_steps.push(shape.shortest.map_or(UNKNOWN, count));
        batch.plan_count.push(&shape.plan_count.to_string());
    }

    /// The plan with the domain's actions and the record's names, one operator a line.
    fn write_ipc(&self, steps: &[Step<'_>], names: &[Cow<'_, str>], out: &mut String) {
        for (number, step) in steps.iter().enumerate() {
            out.push_str(if number == 0 { "(" } else { "\n(" });
            out.push_str(&self.domain.actions[step.action.index()].name);
            for object in step.args.iter() {
                out.push(' ');
                out.push_str(&names[object.index()]);
            }
            out.push(')');
        }
    }
}

fn shuffle_if<T>(shuffled: bool, items: &mut [T], random: &mut Random) {
    if shuffled {
        random.shuffle(items);
    }
}
