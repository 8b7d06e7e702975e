//! Which problems belong to which split: nothing that a suite holds out reaches training.

use rustc_hash::{FxHashMap, FxHashSet};

use super::config::RecordConfig;
use super::shape::{Shape, Source};
use crate::augment::{Hold, Names, Naming};
use crate::pddl::ast::ActionId;
use crate::random::Random;
use crate::task::OperatorId;

/// A part of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Split {
    /// For training.
    Train,
    /// For choosing checkpoints.
    Validation,
    /// New records of what was trained.
    Seen,
    /// Held-out object names.
    UnseenObjects,
    /// Held-out made-up words for objects.
    UnseenMadeUpNames,
    /// Held-out words for actions.
    UnseenActions,
    /// Held-out words for predicates.
    UnseenPredicates,
    /// Held-out problems.
    UnseenShapes,
    /// Held-out templates.
    UnseenTemplate,
    /// More objects than in training.
    MoreObjects,
    /// Longer plans than in training.
    Longer,
    /// Problems of the sizes that are asked for, too large to see all their states.
    Large,
}

impl Split {
    /// Every split, in the order in which they are written.
    pub const ALL: [Split; 12] = [
        Self::Train,
        Self::Validation,
        Self::Seen,
        Self::UnseenObjects,
        Self::UnseenMadeUpNames,
        Self::UnseenActions,
        Self::UnseenPredicates,
        Self::UnseenShapes,
        Self::UnseenTemplate,
        Self::MoreObjects,
        Self::Longer,
        Self::Large,
    ];

    /// The split's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Validation => "validation",
            Self::Seen => "seen",
            Self::UnseenObjects => "unseen-objects",
            Self::UnseenMadeUpNames => "unseen-made-up-names",
            Self::UnseenActions => "unseen-actions",
            Self::UnseenPredicates => "unseen-predicates",
            Self::UnseenShapes => "unseen-shapes",
            Self::UnseenTemplate => "unseen-template",
            Self::MoreObjects => "more-objects",
            Self::Longer => "longer",
            Self::Large => "large",
        }
    }

    /// The split of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|split| split.name() == name)
    }

    /// How the split's records name things.
    pub(super) fn naming(self, config: &RecordConfig) -> Naming {
        let names = match self {
            Self::UnseenObjects => Names::HeldOut,
            Self::UnseenMadeUpNames => Names::MadeUp,
            _ => Names::Trained { made_up: config.made_up_share },
        };
        let hold = |held_out| if held_out { Hold::HeldOut } else { Hold::Trained };
        let (words, predicates) = (hold(self == Self::UnseenActions), hold(self == Self::UnseenPredicates));
        Naming { names, words, predicates }
    }

    /// Share of the split's records in the report's style, which has no legend.
    pub(super) fn paper_share(self, config: &RecordConfig) -> f64 {
        if self == Self::UnseenPredicates { 0.0 } else { config.paper_share }
    }

    /// Share of the split's typed records that give the words for actions.
    pub(super) fn words_share(self, config: &RecordConfig) -> f64 {
        if matches!(self, Self::UnseenActions | Self::UnseenPredicates) { 1.0 } else { config.words_share }
    }

    /// Share of the records with a legend that give words for predicates, too.
    pub(super) fn predicate_words(self, config: &RecordConfig) -> f64 {
        if self == Self::UnseenPredicates { 1.0 } else { config.predicate_words }
    }
}

/// The problems of each split, as positions in one list.
#[derive(Clone, Debug, Default)]
pub(super) struct Pools {
    pub shapes: Vec<Shape>,
    trained: Pool,
    /// The trained problems in the proportions of suites.
    tried: Pool,
    validation: Pool,
    unseen_shapes: Pool,
    unseen_template: Pool,
    more_objects: Pool,
    longer: Pool,
    large: Pool,
}

/// Groups of problems, each with a weight; a record draws a group, then one of its problems.
#[derive(Clone, Debug, Default)]
pub(super) struct Pool {
    pub weights: Vec<f64>,
    pub groups: Vec<Group>,
    /// Whether records take the problems in turn, so that none comes again before all were there.
    in_turn: bool,
}

/// Problems of one origin.
#[derive(Clone, Debug, Default)]
pub(super) struct Group {
    ids: Vec<u32>,
    /// The sum of the weights up to each problem; empty where all are equally likely.
    sums: Vec<usize>,
}

/// How much likelier some problems of a group are than others; by default none is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Drawing {
    /// As likely as the shortest plan's steps to this power.
    steps_power: u32,
    /// As likely as the number of problems with the same actions in their first plan to minus this power.
    rarity: f64,
}

/// What the weight of a problem that is the only one of its kind is counted in.
const WHOLE: f64 = 65_536.0;

/// The actions of a problem's first plan, without their arguments.
fn skeleton(shape: &Shape) -> Vec<ActionId> {
    let action = |operator: &OperatorId| shape.task.operators[operator.index()].action;
    shape.plans.first().map(|plan| plan.iter().map(action).collect()).unwrap_or_default()
}

impl Group {
    #[expect(clippy::cast_sign_loss, reason = "a power of a positive number is positive")]
    fn new(ids: Vec<u32>, shapes: &[Shape], drawing: Drawing) -> Self {
        if drawing == Drawing::default() {
            return Self { ids, sums: Vec::new() };
        }
        let mut alike: FxHashMap<Vec<ActionId>, usize> = FxHashMap::default();
        for &id in &ids {
            *alike.entry(skeleton(&shapes[id as usize])).or_default() += 1;
        }
        let mut sum = 0;
        let add = |&id: &u32| {
            let shape = &shapes[id as usize];
            let rarity = (alike[&skeleton(shape)] as f64).powf(-drawing.rarity);
            // Weights are whole numbers: the most common problem's is not zero, and no sum is too large.
            let rarity = ((WHOLE * rarity) as usize).max(1);
            sum += shape.shortest.unwrap_or(1).max(1).pow(drawing.steps_power) * rarity;
            sum
        };
        let sums = ids.iter().map(add).collect();
        Self { ids, sums }
    }

    /// One of its problems.
    fn draw(&self, random: &mut Random) -> u32 {
        let Some(&total) = self.sums.last() else { return *random.choice(&self.ids) };
        let at = random.below(total);
        self.ids[self.sums.partition_point(|&sum| sum <= at)]
    }
}

/// Problems by where they come from, before they are sorted into splits.
#[derive(Default)]
pub(super) struct Solved {
    /// By template.
    pub templates: Vec<Vec<Shape>>,
    /// Given with their goals.
    pub given: Vec<Shape>,
    pub random: Vec<Shape>,
    /// Variants of these, for training alone.
    pub variants: Vec<Shape>,
    pub more_objects: Vec<Shape>,
    pub longer: Vec<Shape>,
    pub large: Vec<Shape>,
}

impl Pools {
    /// Sorts the problems into splits, each kept once.
    pub fn new(solved: Solved, held_out: &[usize], config: &RecordConfig) -> Self {
        let mut sorter = Sorter::new(config);
        let (out, kept): (Vec<_>, Vec<_>) =
            solved.templates.into_iter().enumerate().partition(|(number, _)| held_out.contains(number));
        let unseen_template = sorter.add(out.into_iter().flat_map(|(_, shapes)| shapes));
        let kept = kept.into_iter().flat_map(|(_, shapes)| shapes);
        let candidates = sorter.add(kept.chain(solved.given).chain(solved.random));
        let more_objects = sorter.add(solved.more_objects);
        let longer = sorter.add(solved.longer);
        let large = sorter.add(solved.large);
        // Last, so that none is a problem of another split.
        let variants = sorter.add(solved.variants);
        sorter.finish(&candidates, &variants, [unseen_template, more_objects, longer, large])
    }

    /// The problems that the split's records are drawn from; empty where there are none.
    pub fn of(&self, split: Split) -> &Pool {
        match split {
            Split::Validation if !self.validation.groups.is_empty() => &self.validation,
            Split::UnseenShapes => &self.unseen_shapes,
            Split::UnseenTemplate => &self.unseen_template,
            Split::MoreObjects => &self.more_objects,
            Split::Longer => &self.longer,
            Split::Large => &self.large,
            Split::Train | Split::Validation => &self.trained,
            _ => &self.tried,
        }
    }
}

struct Sorter<'c> {
    config: &'c RecordConfig,
    shapes: Vec<Shape>,
    seen: FxHashSet<u128>,
}

impl<'c> Sorter<'c> {
    fn new(config: &'c RecordConfig) -> Self {
        Self { config, shapes: Vec::new(), seen: FxHashSet::default() }
    }

    /// Takes the problems that are not isomorphic to one taken before.
    fn add(&mut self, shapes: impl IntoIterator<Item = Shape>) -> Vec<u32> {
        let mut ids = Vec::new();
        for shape in shapes {
            if self.seen.insert(shape.hash) {
                ids.push(self.shapes.len() as u32);
                self.shapes.push(shape);
            }
        }
        ids
    }

    fn finish(self, candidates: &[u32], variants: &[u32], [template, objects, longer, large]: [Vec<u32>; 4]) -> Pools {
        let validation = if self.config.validation_by_shape { self.config.validation_share } else { 0.0 };
        let bands = [self.config.unseen_shapes_share, self.config.unseen_shapes_share + validation];
        let band = |id: &u32| {
            // A variant of a held-out problem is held out with it.
            let place = (self.shapes[*id as usize].family >> 64) as u64 as f64 / u64::MAX as f64;
            bands.iter().position(|&end| place < end).unwrap_or(bands.len())
        };
        // Where there are too few problems to hold some out, all of them are trained.
        let few = candidates.iter().all(|id| band(id) < bands.len());
        let band = |id: &u32| if few { bands.len() } else { band(id) };
        let chosen = |wanted| candidates.iter().copied().filter(|id| band(id) == wanted).collect::<Vec<u32>>();
        let (config, shapes) = (self.config, &self.shapes);
        let suite = |ids: Vec<u32>| Pool::new(&ids, shapes, config.template_share, Drawing::default());
        let drawing = Drawing { steps_power: config.train_steps_power, rarity: config.train_rarity };
        let training = |ids: Vec<u32>| Pool::new(&ids, shapes, config.train_template_share, drawing);
        let [unseen_shapes, tried, unseen_template] = [chosen(0), chosen(2), template].map(suite);
        let varied = variants.iter().copied().filter(|id| band(id) == 2);
        let [validation, trained] = [chosen(1), chosen(2).into_iter().chain(varied).collect()].map(training);
        let in_turn = |ids: Vec<u32>| Pool { in_turn: true, ..suite(ids) };
        let [more_objects, longer, large] = [objects, longer, large].map(in_turn);
        Pools {
            shapes: self.shapes,
            trained,
            tried,
            validation,
            unseen_shapes,
            unseen_template,
            more_objects,
            longer,
            large,
        }
    }
}

impl Pool {
    /// One group a template, which share `template_share` evenly, and one of random problems for the rest.
    fn new(ids: &[u32], shapes: &[Shape], template_share: f64, drawing: Drawing) -> Self {
        let mut keys: Vec<Option<usize>> = ids.iter().map(|&id| key(&shapes[id as usize])).collect();
        keys.sort_unstable();
        keys.dedup();
        let templates = keys.iter().flatten().count();
        let weight = |key: &Option<usize>| match key {
            Some(_) => template_share / templates as f64,
            None => 1.0 - template_share,
        };
        let members = |wanted: &Option<usize>| {
            let ids = ids.iter().copied().filter(|&id| key(&shapes[id as usize]) == *wanted).collect();
            Group::new(ids, shapes, drawing)
        };
        let mut weights: Vec<f64> = keys.iter().map(weight).collect();
        if weights.iter().sum::<f64>() <= 0.0 {
            weights.fill(1.0);
        }
        Self { weights, groups: keys.iter().map(members).collect(), in_turn: false }
    }

    /// The problem of the record with this index.
    pub fn draw(&self, index: u64, random: &mut Random) -> u32 {
        if self.in_turn {
            let problems = self.groups.iter().map(|group| group.ids.len() as u64).sum::<u64>();
            let mut all = self.groups.iter().flat_map(|group| &group.ids);
            return *all.nth((index % problems) as usize).expect("the index is below the count");
        }
        self.groups[random.weighted(&self.weights)].draw(random)
    }
}

/// The group that a problem belongs to.
fn key(shape: &Shape) -> Option<usize> {
    match shape.source {
        Source::Template(number) => Some(number),
        // Given problems are one group, which comes after the templates.
        Source::Given => Some(usize::MAX),
        Source::Random | Source::Large => None,
    }
}
