//! What a data set is made of.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::negative::Corruption;

/// Which of a problem's plans become records.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlanChoice {
    /// The shortest.
    Shortest,
    /// All of at most `max_steps` steps, up to `plans_per_problem` of them drawn uniformly.
    All,
}

/// Everything that decides what the records are. Same configuration, same bytes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordConfig {
    /// The seed of every draw.
    pub seed: u64,
    /// Records of `train` and `validation` together.
    pub pairs: u64,
    /// Share of `pairs` that goes to `validation`.
    pub validation_share: f64,
    /// Whether `validation` has problems of its own, held out of `train`.
    pub validation_by_shape: bool,
    /// Records of each suite.
    pub suite_records: u64,
    /// Most steps of a plan.
    pub max_steps: usize,
    /// Which plans.
    pub plans: PlanChoice,
    /// Most plans of one problem that records are drawn from.
    pub plans_per_problem: usize,
    /// Most problems of one template.
    pub problems_per_template: usize,
    /// Random problems for training; about that many, as isomorphic ones count once.
    pub random_problems: usize,
    /// Whether given problems are where random goals start from, beside being problems themselves.
    pub random_goals: bool,
    /// Goals drawn from each random initial state; from one of a given problem, as many times more as
    /// `states_per_start` goes into the states explored.
    pub goals_per_state: usize,
    /// No layer of states is begun from a random initial state once there are so many.
    pub states_per_start: usize,
    /// Share of a suite's records from templates, the rest being from random problems.
    pub template_share: f64,
    /// The same share for training and validation.
    pub train_template_share: f64,
    /// Share of training's problems of two steps and more that are trained from midway, too; of a template with few
    /// problems from several states.
    pub midway_share: f64,
    /// Share of training's random problems with a goal of literals that are trained with one literal more, too: that a fact
    /// be as it was, which a plan would leave changed.
    pub kept_share: f64,
    /// In training and validation a problem is as likely as its shortest plan's steps to this power.
    pub train_steps_power: u32,
    /// There a problem is as likely, too, as the number of problems with the same actions in their first plan to minus this
    /// power.
    pub train_rarity: f64,
    /// Share of problems whose goal is the whole final state.
    pub state_goal_share: f64,
    /// Share of records in the report's style.
    pub paper_share: f64,
    /// Share of typed records whose actions are called by drawn words, with the legend; the rest use the domain's.
    pub words_share: f64,
    /// Share of records with a legend whose predicates, too, are called by drawn words.
    pub predicate_words: f64,
    /// Share of records whose initial and goal atoms are in random order.
    pub shuffled_share: f64,
    /// Share of objects that are called by made-up words.
    pub made_up_share: f64,
    /// Share of problems held out for `unseen-shapes`.
    pub unseen_shapes_share: f64,
    /// Templates held out for `unseen-template`.
    pub held_out_templates: Vec<String>,
    /// How many objects more than any trained problem `more-objects` has.
    pub more_objects: usize,
    /// Shortest plans of `longer`, least and most steps.
    pub longer_steps: (usize, usize),
    /// Records of the suite `large`.
    pub large_records: u64,
    /// By type, other sizes than those of `large.pddl`: one number for each dimension of an array.
    pub large_sizes: BTreeMap<String, Vec<usize>>,
    /// Least and most steps of the random walks that lead to the goals of `large`.
    pub large_walk: (usize, usize),
    /// Weight of each kind of negative by its name; kinds that are not named are not drawn.
    pub negatives: BTreeMap<String, f64>,
}

/// The largest `train_steps_power`.
const MOST_POWER: u32 = 4;

/// A value that the configuration cannot have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConfigMistake {
    /// A share outside of 0 to 1.
    #[error("`data.{0}` is a share: at least 0 and at most 1")]
    Share(&'static str),
    /// A number that must not be zero.
    #[error("`data.{0}` must be positive")]
    Zero(&'static str),
    /// A kind of negative that there is not.
    #[error("`data.negatives` has no kind `{0}`")]
    Negative(String),
    /// No kind of negative has a positive weight, or one has a negative weight.
    #[error("`data.negatives` needs weights that are not negative, one of them positive")]
    Weights,
    /// A power that is not small.
    #[error("`data.train_steps_power` is at most {MOST_POWER}")]
    Power,
    /// A held-out template that there is not.
    #[error("`data.held_out_templates` names `{0}`, which is no template of this domain")]
    Template(String),
    /// Words for predicates are asked for, and there are none.
    #[error("`data.predicate_words` is positive, but the domain's lexicon gives no words for predicates")]
    PredicateWords,
    /// A suite of large problems is asked for, and there is no template for them.
    #[error("`data.large_records` is positive, but the domain's folder has no `large.pddl`")]
    NoLarge,
    /// A size of something that the template has no array of, or not one of as many dimensions.
    #[error("`data.large_sizes` gives sizes of `{0}`, of which `large.pddl` has no array with as many dimensions")]
    LargeSizes(String),
    /// The bounds of the walks of `large` are in the wrong order.
    #[error("`data.large_walk` must be two positive numbers, the second not below the first")]
    LargeWalk,
    /// The bounds of `longer` are in the wrong order.
    #[error("`data.longer_steps` must be two numbers above `data.max_steps`, the second not below the first")]
    Longer,
}

impl RecordConfig {
    /// The first contradiction in the configuration.
    ///
    /// # Errors
    /// See [`ConfigMistake`].
    pub fn check(&self) -> Result<(), ConfigMistake> {
        for (name, share) in self.shares() {
            if !(0.0..=1.0).contains(&share) {
                return Err(ConfigMistake::Share(name));
            }
        }
        for (name, number) in self.numbers() {
            if number == 0 {
                return Err(ConfigMistake::Zero(name));
            }
        }
        if self.train_steps_power > MOST_POWER {
            return Err(ConfigMistake::Power);
        }
        if self.large_walk.0 == 0 || self.large_walk.1 < self.large_walk.0 {
            return Err(ConfigMistake::LargeWalk);
        }
        let (least, most) = self.longer_steps;
        if least <= self.max_steps || most < least {
            return Err(ConfigMistake::Longer);
        }
        self.check_negatives()
    }

    fn shares(&self) -> [(&'static str, f64); 13] {
        [
            ("validation_share", self.validation_share),
            ("template_share", self.template_share),
            ("train_template_share", self.train_template_share),
            ("midway_share", self.midway_share),
            ("kept_share", self.kept_share),
            ("train_rarity", self.train_rarity),
            ("state_goal_share", self.state_goal_share),
            ("paper_share", self.paper_share),
            ("words_share", self.words_share),
            ("predicate_words", self.predicate_words),
            ("shuffled_share", self.shuffled_share),
            ("made_up_share", self.made_up_share),
            ("unseen_shapes_share", self.unseen_shapes_share),
        ]
    }

    fn numbers(&self) -> [(&'static str, usize); 6] {
        [
            ("pairs", self.pairs as usize),
            ("max_steps", self.max_steps),
            ("plans_per_problem", self.plans_per_problem),
            ("problems_per_template", self.problems_per_template),
            ("goals_per_state", self.goals_per_state),
            ("states_per_start", self.states_per_start),
        ]
    }

    fn check_negatives(&self) -> Result<(), ConfigMistake> {
        let known = |name: &String| Corruption::ALL.iter().any(|kind| kind.name() == name);
        if let Some(unknown) = self.negatives.keys().find(|name| !known(name)) {
            return Err(ConfigMistake::Negative(unknown.clone()));
        }
        let weights = self.negative_weights();
        let usable = weights.iter().all(|&weight| weight >= 0.0) && weights.iter().sum::<f64>() > 0.0;
        if usable { Ok(()) } else { Err(ConfigMistake::Weights) }
    }

    /// The weights in the order of [`Corruption::ALL`].
    pub fn negative_weights(&self) -> [f64; Corruption::ALL.len()] {
        Corruption::ALL.map(|kind| self.negatives.get(kind.name()).copied().unwrap_or(0.0))
    }

    /// Records of `validation`.
    #[expect(clippy::cast_sign_loss, reason = "both factors are checked not to be negative")]
    pub fn validation_records(&self) -> u64 {
        (self.pairs as f64 * self.validation_share).round() as u64
    }
}
