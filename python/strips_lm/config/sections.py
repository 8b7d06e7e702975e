"""The sections of a run's configuration, one dataclass per concern, one line of documentation per field.

A field's owner is the module that reads it; a contradiction is rejected where the section is made.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from strips_lm.config.names import ConfigError


def check(holds: bool, complaint: str) -> None:
    """Raises `ConfigError` with the complaint unless it holds."""
    if not holds:
        raise ConfigError(complaint)


NEGATIVES = (
    "shuffle-actions",
    "shuffle-states",
    "shuffle-both",
    "drop-step",
    "repeat-step",
    "swap-steps",
    "wrong-argument",
    "missing-atom",
    "invented-atom",
    "other-goal",
    "prefix",
)
"""The kinds of negatives; `docs/record-format.md` describes them."""


@dataclass(frozen=True, kw_only=True, slots=True)
class DataConfig:
    """What `gen-data` makes."""

    domain: str = "manipulation"
    """A built-in domain's name, a folder with the same files, or `all`: a data set of each built-in domain."""
    shares: dict[str, float] = field(default_factory=dict)
    """`all`: weight of each domain's `pairs`, 1 where it is not named; 0 leaves it out."""
    problems: tuple[str, ...] = ()
    """PDDL problems of your own, used with their goals; `*`, `?` and `[…]` are expanded."""
    random_goals: bool = False
    """Whether goals are drawn, too, from states that random walks from `problems` reach: one gives thousands."""
    pairs: int = 71_128
    """Pairs of a plan and a negative, over training and validation."""
    validation_share: float = 1 / 6
    """Share of `pairs` in the validation split."""
    validation_by_shape: bool = False
    """Whether the validation split has problems of its own."""
    suite_records: int = 1000
    """Records of each suite; 0 makes none."""
    max_steps: int = 7
    """The longest plan, in steps."""
    plans: Literal["shortest", "all"] = "shortest"
    """Which plans become records: the shortest, or all of at most `max_steps` steps (the report's)."""
    plans_per_problem: int = 16
    """Most plans of one problem; where there are more, as many are drawn uniformly."""
    problems_per_template: int = 400
    """Most problems of one template, the whole-state variants not counted."""
    random_problems: int = 24_000
    """Random problems beside the templates'."""
    goals_per_state: int = 8
    """Goals drawn from each random initial state; from one that `--random-goals` draws, as many times more as
    `states_per_start` goes into the states explored."""
    states_per_start: int = 3000
    """No layer of states is begun from a random initial state once there are so many."""
    template_share: float = 0.5
    """Share of a suite's records from templates, evenly over them; the rest are random problems."""
    train_template_share: float = 0.15
    """The same share for training and validation: templates are learnt long before random problems are."""
    midway_share: float = 0.0
    """Share of training's problems of two steps and more that are trained from a state on their way, too; of a template
    with few problems from several."""
    kept_share: float = 0.0
    """Share of training's random problems with a goal of literals that are trained with one literal more, too: that a
    fact be as it was, which a plan would leave changed (the box shut again)."""
    train_steps_power: int = 0
    """There a problem is as likely as its shortest plan's steps to this power; 0 draws all alike, as suites do. 1 is
    better at long plans and worse at more objects (docs/experiments.md)."""
    train_rarity: float = 0.0
    """There a problem is as likely, too, as the number of problems with the same row of actions in their first plan to
    minus this power: 0 draws all alike, 1 each row of actions. Rare rows are what models get wrong."""
    state_goal_share: float = 0.5
    """Share of random problems whose goal is the whole final state; templates give both kinds unless it is 0 or 1."""
    paper_share: float = 0.0
    """Share of records in the report's style, without types."""
    words_share: float = 0.5
    """Share of typed records with drawn words for actions and their legend."""
    predicate_words: float = 0.0
    """Share of records with such a legend whose predicates, too, go by drawn words."""
    shuffled_share: float = 0.0
    """Share of records whose goal and initial atoms are in random order."""
    made_up_share: float = 0.3
    """Share of objects with made-up names."""
    unseen_shapes_share: float = 0.1
    """Share of problems held out for the suite `unseen-shapes`."""
    held_out_templates: tuple[str, ...] = ("take-out",)
    """Templates held out for the suite `unseen-template`."""
    more_objects: int = 4
    """How many objects more than any trained problem the suite `more-objects` has."""
    longer_steps: tuple[int, ...] = (8, 12)
    """Least and most steps of the shortest plans in the suite `longer`."""
    large_records: int = 0
    """Records of the suite `large`, of problems as large as the domain's `large.pddl` says; 0 makes none."""
    large_sizes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Other sizes, by type, such as `{ball = [30]}` or `{cell = [6, 9]}`."""
    large_walk: tuple[int, ...] = (20, 60)
    """Least and most steps of the random walks at whose ends the goals of `large` are."""
    negatives: dict[str, float] = field(default_factory=lambda: dict.fromkeys(NEGATIVES, 1.0))
    """Weight of each kind of negative."""
    format: Literal["parquet", "jsonl"] = "parquet"
    """How records are written."""
    shard_records: int = 8192
    """Records of one file."""

    def __post_init__(self) -> None:
        check(self.pairs > 0, "`data.pairs` must be positive")
        check(min(self.shares.values(), default=0.0) >= 0.0, "`data.shares` are at least 0")
        check(self.max_steps > 0, "`data.max_steps` must be positive")
        check(self.shard_records > 0, "`data.shard_records` must be positive")
        check(len(self.longer_steps) == 2, "`data.longer_steps` are two numbers")
        check(len(self.large_walk) == 2, "`data.large_walk` are two numbers")
        check(self.large_records >= 0, "`data.large_records` must not be negative")
        check(all(min(sizes, default=0) >= 0 for sizes in self.large_sizes.values()), "`data.large_sizes` are positive")


Layout = Literal["difference", "progress", "report"]
"""How canonical words say goal and states."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TokenizerConfig:
    """How text becomes tokens."""

    kind: Literal["canonical", "typed", "spelled", "bpe"] = "canonical"
    """`canonical`: the lossless rewriting and a small vocabulary of words; `typed`: the same with slots that say their
    object's type; `spelled`: with every object's name in pieces of a byte-level BPE over names; `bpe`: byte-level BPE
    over the text."""
    spelled_types: bool = True
    """`spelled`: whether an object's type stands before each mention of its name."""
    source: str = ""
    """`bpe`: a pre-trained tokenizer's name or folder (`gpt2`); empty trains one on the corpus."""
    vocab_size: int = 1024
    """`bpe` trained on the corpus, `spelled`: the vocabulary, our special tokens among them."""
    layout: Layout = "difference"
    """`canonical`, `typed`, `spelled`: goal and states as differences; the same where each change says whether it
    leads to the goal or away from it (`progress`); or spelled out as in the report (slots alone)."""
    max_slots: int = 32
    """`canonical`, `typed`: slots for objects; a problem with more of them cannot be tokenized."""
    type_slots: int = 24
    """`typed`: slots for objects of one type, or of one kind where a domain without types says kinds by predicates; a
    problem with more of them cannot be tokenized."""

    def __post_init__(self) -> None:
        check(self.vocab_size >= 300, "`tokenizer.vocab_size` must be at least 300: 256 bytes and the special tokens")
        check(min(self.max_slots, self.type_slots) > 0, "`tokenizer.max_slots` and `type_slots` must be positive")


@dataclass(frozen=True, kw_only=True, slots=True)
class ModelConfig:
    """The network."""

    kind: Literal["double-head", "lm-head", "lstm"] = "double-head"
    """Which of the three models."""
    layers: int = 4
    """Transformer blocks, or LSTM layers."""
    width: int = 128
    """Width of the hidden states."""
    heads: int = 4
    """Attention heads."""
    inner: int = 0
    """Width inside a block's feed-forward part; 0 is four times `width`."""
    context: int = 1024
    """Positions that the model has; longer records are left out, and counted."""
    activation: Literal["gelu_new", "relu", "relu2"] = "gelu_new"
    """The feed-forward part's activation, by its name in transformers."""
    dropout: float = 0.0
    """Dropout of attention, residuals and embeddings."""
    tied: bool = True
    """Whether the output layer is the embedding's transpose, as in GPT-2."""
    positions: Literal["sinusoid", "normal"] = "sinusoid"
    """What learned positions start from."""
    previous_token_heads: int = 0
    """Heads of the first block that start by looking at the token before, the second at the one before that, and so
    on; needs sinusoid positions."""
    initial: str = ""
    """A checkpoint's name or folder to start from; empty starts from random weights."""

    def __post_init__(self) -> None:
        check(min(self.layers, self.width, self.heads, self.context) > 0, "the sizes in `model` must be positive")
        check(self.width % self.heads == 0, "`model.heads` must divide `model.width`")
        check(0.0 <= self.dropout < 1.0, "`model.dropout` must be at least 0 and less than 1")
        check(
            0 <= self.previous_token_heads <= self.heads,
            f"`model.previous_token_heads` are 0 to `model.heads`, {self.heads}",
        )
        check(
            self.positions == "sinusoid" or not self.previous_token_heads,
            "`model.previous_token_heads` find tokens by sinusoids, and `model.positions` are none\n"
            "hint: `--set model.previous_token_heads=0`",
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainConfig:
    """The training loop."""

    steps: int = 0
    """Optimisation steps; 0 leaves the end to `minutes`."""
    minutes: float = 5.0
    """Wall-clock budget; 0 leaves the end to `steps`. Where both are given the earlier ends the run."""
    step_tokens: int = 4096
    """Tokens an optimisation step (prompts and plans), over all processes; `spelled` counts a name as one."""
    step_pairs: int = 0
    """Records an optimisation step instead of `step_tokens`; 0 counts tokens."""
    batch_tokens: int = 8192
    """Padded tokens that go through the model at once; a step is cut into as many batches as it takes."""
    select_from: int = 1
    """Of the records of so many steps one step's worth is trained on, those with the highest loss above what no model
    could save; 1 trains on all."""
    select_start: float = 0.3
    """Share of the run after which records are selected: before it all of them are news."""
    select_end: float = 1.0
    """Share of the run after which all are trained on again."""
    optimizer: Literal["muon", "adam"] = "muon"
    """`muon`: Muon for inner matrices and AdamW for the rest; `adam`: Adam with decoupled weight decay for all."""
    lr: float = 2e-3
    """Peak learning rate of Adam's parameters."""
    matrix_lr: float = 0.02
    """Peak learning rate of Muon's matrices."""
    betas: tuple[float, ...] = (0.9, 0.95)
    """Adam's decay rates."""
    eps: float = 1e-8
    """Adam's epsilon."""
    momentum: float = 0.95
    """Muon's momentum."""
    weight_decay: float = 0.0
    """Decoupled weight decay."""
    clip: float = 1.0
    """Largest norm of the gradient; 0 does not clip."""
    warmup: float = 0.02
    """Share of the run in which the learning rate rises."""
    cooldown: float = 0.6
    """Share of the run, at its end, in which the learning rate falls in a straight line to zero."""
    shard: bool = False
    """Whether several processes share weights, gradients and the optimiser's state out (FSDP), not each holding all."""
    lm_weight: float = 1.0
    """Weight of the language-model loss."""
    mc_weight: float = 2.0
    """Weight of the multiple-choice loss."""
    mc_share: float = 1.0
    """Share of the records that bring their negative along for the multiple-choice loss."""
    mc_start: float = 0.0
    """Share of the run after which negatives come along."""
    goal_weight: float = 0.0
    """Weight of what the layers are told of states and goals while they train: what each atom is to the goal, and what
    the goal still lacks. Only for GPT-2s on canonical or typed words, where the layout spells states out
    (`tokenizer.layout=report`); 0 tells nothing."""
    own_steps: int = 0
    """Training prompts that the model's own steps are drawn for once `mc_start` is reached: from then on the second
    head learns to say of a single step whether it holds. 0: it tells records from their negatives."""
    position_offset: int = 0
    """Some records start at a random position of 0 to this, so that plans longer than the training's are no news."""
    offset_share: float = 0.3
    """Share of the records that do; the others start at 0, which is much quicker to learn."""
    renumber_share: float = 0.33
    """`canonical`: share of the records with random increasing slot numbers, so that more objects than the training's
    are no news."""
    drawn_names: float = 1.0
    """`spelled`: share of the records whose names are drawn anew each time that they are shown, once drawn names have
    grown (`short_names`); the others keep the data's. 0 draws none at all."""
    short_names: float = 0.0
    """`spelled`: share of the run in which names drawn for training grow from one piece to several: what copying is, is
    learnt from short ones much sooner."""
    precision: Literal["auto", "float32", "bfloat16"] = "auto"
    """Type that the layers run in; `auto` is what the trial finds faster, or without one bfloat16 where the processor
    multiplies it quicker."""
    compile: Literal["auto", "always", "never"] = "auto"
    """Whether `torch.compile` makes the layers' dense parts; `auto` where a trial finds that it pays within the run."""
    autotune: Literal["auto", True, False] = "auto"
    """Whether a short trial chooses what is `auto` above, and the number of threads on a CPU. `auto` is where a run is
    measured in minutes alone: one of so many `steps` is to be repeatable bit for bit, and sums depend on all three."""
    evaluate_every: float = 0.1
    """Share of the run between two measurements on the validation split; the best checkpoint has the lowest."""
    validation_records: int = 1000
    """Records of the validation split that are measured."""
    save_minutes: float = 2.0
    """Minutes between two writes of the last checkpoint; it is also written at the end and on a signal."""
    trackers: tuple[str, ...] = ()
    """Accelerate's trackers to log to, such as `tensorboard`; `metrics.jsonl` is always written."""

    def __post_init__(self) -> None:
        check(self.steps > 0 or self.minutes > 0.0, "`train.steps` or `train.minutes` must be positive")
        check(min(self.step_tokens, self.batch_tokens) > 0, "`train.step_tokens` and `train.batch_tokens` are positive")
        check(self.select_from > 0, "`train.select_from` must be positive")
        check(self.goal_weight >= 0.0, "`train.goal_weight` is at least 0; 0 tells nothing of goals")
        check(self.own_steps >= 0, "`train.own_steps` is a number of prompts; 0 draws none")
        check(len(self.betas) == 2, "`train.betas` are two numbers")
        check(self.warmup + self.cooldown <= 1.0, "`train.warmup` and `train.cooldown` are shares of one run")
        shares = "mc_share", "offset_share", "renumber_share", "drawn_names", "short_names"
        for share in (*shares, "select_start", "select_end"):
            check(0.0 <= getattr(self, share) <= 1.0, f"`train.{share}` is a share: at least 0 and at most 1")


Rerank = Literal["auto", "head", "likelihood", "replan", "oracle"]
"""Who chooses among the samples of `best-of-k`; `auto` is the head if it judges steps, else `replan`."""

RERANKS: tuple[str, ...] = get_args(Rerank)[1:]
"""All of them by name, in the order of the table."""


@dataclass(frozen=True, kw_only=True, slots=True)
class GenerateConfig:
    """How plans are decoded."""

    max_new: int = 4000
    """Longest completion, in tokens, with steps that were taken back; the model's context may end it earlier."""
    top_k: int = 10
    """`sample`: the likeliest tokens that are drawn from; 0 is all."""
    top_p: float = 0.9
    """`sample`: of these, the fewest that hold this share of the probability."""
    temperature: float = 1.0
    """`sample`: divides the logits."""
    beams: int = 4
    """`beam`: continuations kept at every step."""
    length_penalty: float = 1.0
    """`beam`: a finished beam's log-probability is divided by its length to this power."""
    samples: int = 8
    """`best-of-k`: continuations drawn for each prompt."""
    rerank: Rerank = "auto"
    """`best-of-k`: who chooses: the second head, the likelihood, the likelihood of each step where the model is asked
    anew from the state before it (`replan`), or the oracle; `auto` is a head that judges steps, else `replan`."""
    judge: str = ""
    """A checkpoint whose second head judges steps (`train --preset judge`) and chooses in place of the model's own."""
    attempts: int = 1
    """`replan`: plans tried for a prompt, with drawn steps after the first, until the second head finds that one holds;
    needs a head that judges steps (`generate.judge`)."""
    renew_steps: int = 4
    """`masked`: steps after which the model reads a new prompt with the state at hand, if prompts list their objects;
    0 is only where steps were taken back or its context is full. `masked-replan` does so after every step."""
    backtrack: bool = True
    """`masked`: whether steps are taken back where all that may follow lead to states that were there already, so that
    another may be tried; without it such a plan is left unfinished."""
    shorten: bool = True
    """`masked`: whether a plan gives way to the shortest through no other states than those that its text came to, with
    those of steps that were taken back."""
    search_calls: int = 500
    """`search`: calls of the model after which it gives up on a prompt."""
    search_seconds: float = 0.0
    """`search`: a prompt's share of the time after which it gives up as well; 0 is no limit, and repeatable."""
    search_shorter: bool = False
    """`search`: whether it looks for shorter plans after the first, until its budget is spent."""
    search_order: Literal["probability", "discrepancy"] = "probability"
    """`search`: what goes on next, the likeliest text, or the one that gives up least against the model's favourite at
    each choice: that finds more plans of problems far larger than the training's, and longer ones."""
    fallback: bool = False
    """`masked`, `search`: whether the oracle's own search answers where the model comes to no plan."""
    fallback_seconds: float = 10.0
    """Seconds that the oracle's own search may take on a prompt."""
    rows: int = 64
    """Prompts that are decoded at once, in each worker."""
    workers: int = 0
    """Threads that decode, one core each; 0 is one for each core, or a single one on a GPU."""

    def __post_init__(self) -> None:
        check(
            min(self.max_new, self.beams, self.samples, self.attempts, self.rows, self.search_calls) > 0,
            "the sizes in `generate` must be positive",
        )
        check(self.search_seconds >= 0.0, "`generate.search_seconds` is at least 0")
        check(self.fallback_seconds > 0.0, "`generate.fallback_seconds` must be positive")
        check(0.0 < self.top_p <= 1.0, "`generate.top_p` is a share, above 0")
        check(self.temperature > 0.0, "`generate.temperature` must be positive; greedy decoding is `--decode greedy`")
        counts = self.top_k, self.workers, self.renew_steps
        check(min(counts) >= 0, "`generate.top_k`, `generate.workers` and `generate.renew_steps` are at least 0")


SUITES = (
    "seen",
    "unseen-objects",
    "unseen-made-up-names",
    "unseen-actions",
    "unseen-shapes",
    "unseen-template",
    "more-objects",
    "longer",
)
"""The suites that are scored unless others are named, as far as a data set has them."""


@dataclass(frozen=True, kw_only=True, slots=True)
class EvaluateConfig:
    """What is scored."""

    suites: tuple[str, ...] = SUITES
    """Suites of the data set, in the order of the table; those of the default that it does not have are left out."""
    problems: tuple[str, ...] = ()
    """Folders of PDDL problems of the data set's domain, each a suite of its own after those."""
    decodes: tuple[str, ...] = ("greedy",)
    """Ways of decoding, in the order of the table."""
    limit: int = 1000
    """Prompts a suite; 0 is all of them."""
    pairs: int = 500
    """Pairs a suite for perplexity and multiple choice; 0 is all of them."""
    examples: int = 3
    """Outputs a suite that are kept in the results."""
    card: bool = False
    """Whether the scores are written into the card of each checkpoint, also as metadata that hubs read."""
    renamed_problems: int = 0
    """Problems a suite that are asked again under other names, greedily, to see whether the plan stays the same."""
    renamings: int = 100
    """Sets of other names for each of them."""

    def __post_init__(self) -> None:
        counts = self.limit, self.pairs, self.examples, self.renamed_problems, self.renamings
        check(min(counts) >= 0, "the counts in `evaluate` are at least 0")
