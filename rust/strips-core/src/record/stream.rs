//! From a domain's files and a configuration to any range of any split's records.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::config::{ConfigMistake, RecordConfig};
use super::draw::Book;
use super::given_problems::{self, Given};
use super::kept_problems::kept;
use super::large_problems;
use super::midway_problems::{draws, midway};
use super::problems::{OperatorLists, Workshop, open_task};
use super::random_problems::{self, Start, Wanted};
use super::shape::Shape;
use super::splits::{Pools, Solved, Split};
use super::table::{Batch, ProblemTable, template_name};
use super::template_problems;
use crate::augment::{Lexicon, LexiconError, Template, read_template};
use crate::pddl::ast::Domain;
use crate::pddl::{PddlError, Source, parse_domain};
use crate::task::{LimitError, Limits};

/// Records that one thread makes at a time.
const CHUNK: u64 = 256;
/// Most random starts that are made before their problems are counted.
const STARTS: usize = 32;
/// How many problems of `longer` and of `more-objects` come from one start of a template.
const SUITE_GOALS: usize = 2;
/// Most states explored from one start of these suites.
const SUITE_STATES: usize = 20_000;

/// The texts that make up a domain.
#[derive(Clone, Debug)]
pub struct DomainFiles {
    /// `domain.pddl`.
    pub domain: Source,
    /// `lexicon.toml`.
    pub lexicon: Option<Source>,
    /// `templates/*.pddl`, in the order of their names.
    pub templates: Vec<Source>,
    /// `random.pddl`.
    pub random: Option<Source>,
    /// `large.pddl`.
    pub large: Option<Source>,
    /// Problems that are used with their own goals, and from whose initial states random goals start where asked.
    pub problems: Vec<Source>,
}

/// Why there are no records.
#[derive(Clone, Debug, thiserror::Error)]
pub enum RecordError {
    /// A domain, problem or template is wrong.
    #[error("{0}")]
    Pddl(#[from] PddlError),
    /// The lexicon is wrong.
    #[error("{0}")]
    Lexicon(#[from] LexiconError),
    /// The configuration is wrong.
    #[error("{0}")]
    Config(#[from] ConfigMistake),
    /// A given problem's goal cannot be said in a prompt.
    #[error("{0}\nhint: `--random-goals` draws goals that prompts can say")]
    Goal(PddlError),
    /// A budget was spent.
    #[error("{0}")]
    Limit(#[from] LimitError),
    /// The configuration and the files leave nothing to train on.
    #[error(
        "`{domain}` has no problems to make records of: no template, no random start, or no goal within reach{}",
        advice(left_out, *random_goals)
    )]
    NoProblems {
        /// The domain's name.
        domain: String,
        /// A line for each given problem whose own goal gives no records.
        left_out: Vec<String>,
        /// Whether goals were to be drawn from the given problems' states, too.
        random_goals: bool,
    },
}

/// Most given problems that a message tells of.
const TOLD: usize = 5;

/// What became of the given problems, and what else can be asked for.
fn advice(left_out: &[String], random_goals: bool) -> String {
    if left_out.is_empty() {
        return "\nhint: give problems of the domain by `--problems`; `--random-goals` draws goals from their states"
            .into();
    }
    let more = (left_out.len() > TOLD).then(|| format!("… and {} more", left_out.len() - TOLD));
    let lines: Vec<String> = left_out.iter().take(TOLD).cloned().chain(more).collect();
    let hint = if random_goals {
        "hint: no state within reach of the problems makes a goal, either: give others, from whose initial state something can be done"
    } else {
        "hint: `--max-steps` asks for longer plans, `--random-goals` for goals within reach of the problems"
    };
    format!("\n  {}\n{hint}", lines.join("\n  "))
}

/// The files, read.
struct Parts {
    domain: Arc<Domain>,
    lexicon: Lexicon,
    templates: Vec<Template>,
    given: Vec<Given>,
    random: Option<Template>,
    large: Option<Template>,
}

/// All records of a data set, made on demand.
pub struct RecordStream {
    book: Book,
    left_out: Vec<String>,
}

impl RecordStream {
    /// Reads the files, makes and solves every problem, and sorts them into splits; on the current thread pool.
    ///
    /// # Errors
    /// The first mistake in a file or the configuration, or a limit.
    pub fn new(files: &DomainFiles, config: RecordConfig, limits: Limits) -> Result<Self, RecordError> {
        config.check()?;
        let parts = read(files, config.random_goals)?;
        if config.predicate_words > 0.0 && !parts.lexicon.has_predicate_words(&parts.domain) {
            return Err(ConfigMistake::PredicateWords.into());
        }
        let held_out = held_out(&parts.templates, &config)?;
        let workshop =
            Workshop { domain: parts.domain.clone(), config: &config, limits, operators: OperatorLists::default() };
        let (given, left_out) = given_problems::shapes(&workshop, &parts.given)?;
        let mut solved = solve(&workshop, &parts, given)?;
        solved.variants = midways(&workshop, &solved, &held_out)?;
        solved.variants.extend(kept_problems(&workshop, &solved.random)?);
        let pools = Pools::new(solved, &held_out, &config);
        if pools.of(Split::Train).groups.is_empty() {
            let (domain, random_goals) = (parts.domain.name.clone(), config.random_goals);
            return Err(RecordError::NoProblems { domain, left_out, random_goals });
        }
        let templates = parts.templates.iter().map(|template| template.name.clone()).collect();
        let (domain, lexicon, negatives) = (parts.domain, parts.lexicon, config.negative_weights());
        let book = Book { domain, config, negatives, lexicon, templates, pools };
        Ok(Self { book, left_out })
    }

    /// A line for each given problem whose own goal gives no records.
    pub fn left_out(&self) -> &[String] {
        &self.left_out
    }

    /// The splits that have records, and how many each has.
    pub fn splits(&self) -> Vec<(Split, u64)> {
        Split::ALL.into_iter().map(|split| (split, self.len(split))).filter(|&(_, records)| records > 0).collect()
    }

    /// How many records the split has.
    pub fn len(&self, split: Split) -> u64 {
        let (config, lexicon) = (&self.book.config, &self.book.lexicon);
        let testable = match split {
            Split::UnseenObjects => lexicon.has_held_out_names(),
            Split::UnseenActions => lexicon.has_held_out_words(),
            Split::UnseenPredicates => config.predicate_words > 0.0 && lexicon.has_held_out_predicate_words(),
            _ => true,
        };
        match split {
            _ if !testable || self.book.pools.of(split).groups.is_empty() => 0,
            Split::Train => config.pairs - config.validation_records(),
            Split::Validation => config.validation_records(),
            Split::Large => config.large_records,
            _ => config.suite_records,
        }
    }

    /// The records of the range, on the current thread pool; the same for any number of threads.
    pub fn batch(&self, split: Split, range: Range<u64>) -> Batch {
        self.batch_within(split, range, &Limits::default()).expect("the default limits set no time")
    }

    /// The same, as long as nobody interrupts and there is time.
    ///
    /// # Errors
    /// [`LimitError::Interrupted`] and [`LimitError::Time`].
    pub fn batch_within(&self, split: Split, range: Range<u64>, limits: &Limits) -> Result<Batch, LimitError> {
        let watch = limits.start();
        let starts: Vec<u64> = range.clone().step_by(CHUNK as usize).collect();
        let chunk = |&start: &u64| {
            watch.check()?;
            let (mut text, mut batch) = (String::new(), Batch::with_room(CHUNK as usize));
            (start..range.end.min(start + CHUNK))
                .for_each(|index| self.book.write(split, index, &mut text, &mut batch));
            Ok(batch)
        };
        Ok(Batch::joined(&starts.par_iter().map(chunk).collect::<Result<Vec<_>, _>>()?))
    }

    /// How many problems the records refer to.
    pub fn problems(&self) -> usize {
        self.book.pools.shapes.len()
    }

    /// A problem, by its id.
    pub fn problem(&self, id: usize) -> &Shape {
        &self.book.pools.shapes[id]
    }

    /// The problems that the records refer to.
    ///
    /// # Errors
    /// [`LimitError::Interrupted`] and [`LimitError::Time`].
    pub fn problem_table(&self, limits: &Limits) -> Result<ProblemTable, LimitError> {
        let watch = limits.start();
        let ids: Vec<usize> = (0..self.problems()).collect();
        let part = |ids: &[usize]| {
            watch.check()?;
            let mut table = ProblemTable::default();
            for &id in ids {
                let shape = self.problem(id);
                table.push(id, shape, template_name(shape.source, &self.book.templates));
            }
            Ok(table)
        };
        Ok(ProblemTable::joined(&ids.par_chunks(CHUNK as usize).map(part).collect::<Result<Vec<_>, _>>()?))
    }
}

fn read(files: &DomainFiles, random_goals: bool) -> Result<Parts, RecordError> {
    let domain = Arc::new(parse_domain(&files.domain)?);
    let lexicon = match &files.lexicon {
        Some(source) => Lexicon::read(source, &domain)?,
        None => Lexicon::bare(&domain),
    };
    let template = |source: &Source| read_template(source, &domain);
    let templates = files.templates.iter().map(template).collect::<Result<Vec<_>, _>>()?;
    let problem = |source: &Source| Given::read(source, &domain, &files.domain);
    let given = files.problems.iter().map(problem).collect::<Result<Vec<_>, _>>()?;
    let random = match &files.random {
        Some(source) if !random_goals || given.is_empty() => Some(template(source)?),
        _ => None,
    };
    let large = files.large.as_ref().map(template).transpose()?;
    Ok(Parts { domain, lexicon, templates, given, random, large })
}

fn held_out(templates: &[Template], config: &RecordConfig) -> Result<Vec<usize>, ConfigMistake> {
    let number = |name: &String| {
        let found = templates.iter().position(|template| template.name == *name);
        found.ok_or_else(|| ConfigMistake::Template(name.clone()))
    };
    config.held_out_templates.iter().map(number).collect()
}

fn solve(workshop: &Workshop, parts: &Parts, given: Vec<Shape>) -> Result<Solved, RecordError> {
    let config = workshop.config;
    let template = |(number, template): (usize, &Template)| template_problems::shapes(workshop, number, template);
    let templates = parts.templates.iter().enumerate().map(template).collect::<Result<Vec<_>, _>>()?;
    let mut solved = Solved { templates, given, ..Solved::default() };
    if config.large_records > 0 {
        let large = large_template(parts, config)?;
        let from = |number| large_problems::shapes(workshop, &large, number);
        solved.large = collect(from, large_problems::GOALS, config.large_records as usize)?;
    }
    let start = match &parts.random {
        Some(template) => Start::Template(template),
        None if config.random_goals && !parts.given.is_empty() => {
            let open = |given: &Given| open_task(workshop, given.problem.clone());
            Start::Problems(parts.given.iter().map(open).collect::<Result<_, _>>()?)
        }
        None => return Ok(solved),
    };
    let start = &start;
    let trained = Wanted {
        purpose: "random problem",
        surplus: (0, 0),
        steps: (1, config.max_steps),
        states: config.states_per_start,
        goals: config.goals_per_state,
    };
    let collect = |wanted: Wanted, enough| {
        collect(|number| random_problems::shapes(workshop, start, wanted, number), wanted.goals, enough)
    };
    solved.random = collect(trained, config.random_problems)?;
    if config.suite_records == 0 {
        return Ok(solved);
    }
    // A problem for each record: under other names it is the same question, and counts once.
    let problems = config.suite_records as usize;
    let goals = if matches!(start, Start::Template(_)) { SUITE_GOALS } else { config.goals_per_state };
    let suite = Wanted { states: SUITE_STATES, goals, ..trained };
    let longer = Wanted { purpose: "longer", steps: config.longer_steps, ..suite };
    solved.longer = collect(longer, problems)?;
    if let Start::Template(random) = start {
        let most =
            parts.templates.iter().chain([*random]).map(|template| template.most_objects(&workshop.domain)).max();
        if let Some(surplus) = random.surplus_for(&workshop.domain, most.unwrap_or(0) + config.more_objects) {
            let more = Wanted { purpose: "more objects", surplus, ..suite };
            solved.more_objects = collect(more, problems)?;
        }
    }
    Ok(solved)
}

/// Problems from midway of those that training may have.
fn midways(workshop: &Workshop, solved: &Solved, held_out: &[usize]) -> Result<Vec<Shape>, LimitError> {
    if workshop.config.midway_share <= 0.0 {
        return Ok(Vec::new());
    }
    let kept = solved.templates.iter().enumerate().filter(|(number, _)| !held_out.contains(number));
    let groups = kept.map(|(_, shapes)| shapes).chain([&solved.given]).map(|shapes| (shapes, draws(shapes.len())));
    let whole: Vec<(&Shape, usize)> = groups
        .chain([(&solved.random, 1)])
        .flat_map(|(shapes, draws)| shapes.iter().flat_map(move |shape| (0..draws).map(move |number| (shape, number))))
        .collect();
    let found = whole.par_iter().map(|&(shape, number)| midway(workshop, shape, number));
    let found = found.collect::<Result<Vec<_>, _>>()?;
    Ok(found.into_iter().flatten().collect())
}

/// Of random problems those that ask for something to be as it was, too.
fn kept_problems(workshop: &Workshop, random: &[Shape]) -> Result<Vec<Shape>, LimitError> {
    if workshop.config.kept_share <= 0.0 {
        return Ok(Vec::new());
    }
    let found = random.par_iter().map(|shape| kept(workshop, shape)).collect::<Result<Vec<_>, _>>()?;
    Ok(found.into_iter().flatten().collect())
}

/// The template of `large`, of the sizes that the configuration asks for.
fn large_template(parts: &Parts, config: &RecordConfig) -> Result<Template, ConfigMistake> {
    let mut template = parts.large.clone().ok_or(ConfigMistake::NoLarge)?;
    for (name, sizes) in &config.large_sizes {
        let resized = parts.domain.type_id(name).and_then(|type_id| template.resized(type_id, sizes));
        template = resized.ok_or_else(|| ConfigMistake::LargeSizes(name.clone()))?;
    }
    Ok(template)
}

/// Problems from one start after the other, each of which gives about `goals`, until there are enough, or starts keep
/// giving nothing.
fn collect(
    from: impl Fn(usize) -> Result<Vec<Shape>, LimitError> + Sync,
    goals: usize,
    enough: usize,
) -> Result<Vec<Shape>, LimitError> {
    let (mut shapes, mut seen) = (Vec::new(), rustc_hash::FxHashSet::default());
    let (mut next, most) = (0, STARTS * (4 * enough.div_ceil(goals * STARTS) + 4));
    while shapes.len() < enough && next < most {
        // No more starts at a time than are likely to be needed: some take long.
        let starts = (enough - shapes.len()).div_ceil(goals).clamp(4, STARTS).min(most - next);
        let found = (next..next + starts).into_par_iter().map(&from).collect::<Result<Vec<_>, _>>()?;
        shapes.extend(found.into_iter().flatten().filter(|shape| seen.insert(shape.hash)));
        next += starts;
    }
    shapes.truncate(enough);
    Ok(shapes)
}
