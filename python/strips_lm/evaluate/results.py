"""What an evaluation finds, as values and as `results.json` (docs/results-format.md). It computes nothing."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from strips_lm.config import ConfigError

FORMAT = "strips-lm results 1"
"""The first field of every file, and its version."""

OWN_SAMPLE = "own-sample"
"""The kind of a wrong text that the model itself drew."""

TIMING = ("seconds", "prompts_per_second", "tokens_per_second", "verify_seconds")
"""Fields that differ from run to run."""

COUNTED = ("problems", "effective", "valid_low", "valid_high")
"""Fields of a score that cannot be compared with those of a file from before problems were counted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """One model's plans on one suite by one way of decoding."""

    model: str
    """The model's name in `models`."""
    suite: str
    """The suite's name, or the folder of PDDL problems."""
    decode: str
    """`greedy`, `sample`, `beam`, `masked`, `search`, `best-of-8 by head`, …"""
    oracle_helps: bool
    """Whether the oracle took part in decoding or choosing; such rows stand apart."""
    prompts: int
    """Prompts tried."""
    valid: int
    """Prompts whose plan the oracle found valid for the prompt's own PDDL problem."""
    valid_low: float
    """Lower end of the share's 95 % interval (Wilson, of `effective` prompts)."""
    valid_high: float
    """Upper end."""
    optimal: int
    """Valid plans that are as short as the shortest, where that is known."""
    surplus_mean: float | None
    """Steps of a valid plan beyond the shortest's, on average."""
    executable_share: float | None
    """Steps executed before the first that could not be, as a share of the steps emitted; mean over prompts."""
    states: int
    """States emitted after executable steps."""
    states_right: int
    """Of these, the ones equal to the true state."""
    traces_right: int
    """Prompts with a valid plan whose every state is right as well."""
    unfinished: int
    """Texts that did not end with the stop token."""
    malformed: int
    """Texts that are not of the format."""
    verdicts: dict[str, int]
    """Prompts by verdict."""
    failed_at: dict[str, int]
    """Invalid plans by the step that failed, from 1; length + 1 is the goal; `-` where there is no step."""
    by_length: dict[str, list[int]]
    """[valid, prompts] by the shortest plan's length."""
    tokens: int
    """Tokens generated."""
    seconds: float
    """Wall-clock time of decoding."""
    prompts_per_second: float
    """Prompts by `seconds`."""
    tokens_per_second: float
    """Tokens by `seconds`."""
    verify_seconds: float
    """Wall-clock time of parsing and checking."""
    digest: str
    """SHA-256 over all texts in order: equal digests, equal outputs."""
    removed_share: float | None = None
    """`masked`, `search`: the model's probability that the mask took away, mean over its choices; else none."""
    by_oracle: int = 0
    """With `generate.fallback`: prompts that the oracle's own search answered, the model having come to no plan."""
    optimum_known: int | None = None
    """Valid plans whose problem's shortest plan is known; none where that is all of them."""
    problems: int | None = None
    """Different problems among the prompts, names apart; none in files of before it was counted."""
    effective: float | None = None
    """How many prompts of different problems the prompts are worth (Kish 1965): one problem under other names is the
    same question to a model that reads slots. None in files of before, whose intervals took every prompt for one."""
    by_template: dict[str, list[int]] = field(default_factory=dict)
    """[valid, prompts] by the template of the problem, `random` for random ones; empty for problems of your own."""

    @property
    def comparable(self) -> int:
        """Valid plans whose length can be compared with a shortest plan's."""
        return self.valid if self.optimum_known is None else self.optimum_known

    @property
    def repeats(self) -> bool:
        """Whether a problem comes more than once."""
        return self.problems is not None and self.problems < self.prompts

    @property
    def share(self) -> float:
        """Share of valid plans."""
        return self.valid / self.prompts if self.prompts else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Likelihood:
    """How well one model predicts one suite's plans, and how well its second head tells plans from corruptions."""

    model: str
    """The model's name in `models`."""
    suite: str
    """The suite's name."""
    records: int
    """Pairs measured."""
    left_out: int
    """Pairs that the model's context cannot hold."""
    tokens: int
    """Scored tokens: those of the plans (actions, states, the end), not of the prompts."""
    perplexity: float
    """2^H with H the cross-entropy in bits a scored token."""
    floor: float | None
    """The perplexity of a perfect model: the plan is drawn uniformly from `plan_count` plans, the rest is certain."""
    bits_per_plan: float
    """Cross-entropy in bits a plan, which compares between tokenizers."""
    floor_bits_per_plan: float | None
    """The same of a perfect model."""
    choices: int
    """Pairs judged by the second head; 0 where the model has none."""
    choices_right: int
    """Of these, the ones where the plan scored above its corruption."""
    by_negative: dict[str, list[int]]
    """[right, pairs] by the kind of corruption. `own-sample` pairs, not counted in `choices`, are the model's own; `…
    by likelihood` and `… by replan` say how often these, not the head, score the right one higher."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Invariance:
    """How often a model's greedy plan stays the same, up to names, when a suite's problems are renamed."""

    model: str
    suite: str
    problems: int
    renamed: int
    """Renamings of all problems together."""
    same: int
    """Of these, the ones whose plan is that of the names given, with the names exchanged."""
    always: int
    """Problems whose plan is the same under all their renamings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """What one model wrote for a prompt, and what the oracle says."""

    model: str
    decode: str
    text: str
    plan: str
    verdict: str
    step: int | None
    reason: str
    finished: bool
    operator_probabilities: list[float] = field(default_factory=list)
    """The model's probability of each step's operator, given all before it; without a mask, whatever the decoding."""
    state_probabilities: list[float] = field(default_factory=list)
    """The same of the state after each step."""
    end_probability: float | None = None
    """The same of ending where the text ends; none where it does not end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    """One prompt and every model's output."""

    suite: str
    index: int
    prompt: str
    problem: str
    reference: str
    outputs: list[Output]


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A checkpoint that was evaluated."""

    name: str
    path: str
    kind: str
    tokenizer: str
    parameters: int


@dataclass(slots=True, kw_only=True)
class Results:
    """Everything that `evaluate` found, and what it takes to find it again."""

    data: str
    """The data set's folder."""
    config: dict[str, Any]
    """The sections `generate` and `evaluate`, and the seed."""
    versions: dict[str, str] = field(default_factory=dict)
    created: str = ""
    models: list[Model] = field(default_factory=list)
    scores: list[Score] = field(default_factory=list)
    likelihoods: list[Likelihood] = field(default_factory=list)
    examples: list[Example] = field(default_factory=list)
    invariances: list[Invariance] = field(default_factory=list)

    def save(self, path: str | Path) -> None:
        """Write `results.json`, whole or not at all."""
        target = Path(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        part = target.with_name(target.name + ".part")
        part.write_text(json.dumps({"format": FORMAT, **asdict(self)}, indent=1) + "\n", encoding="utf-8")
        part.replace(target)

    @classmethod
    def load(cls, path: str | Path) -> Results:
        """Read `results.json`.

        Raises:
            ConfigError: it is not one, or of another version.
        """
        try:
            found = json.loads(Path(path).read_text(encoding="utf-8"))
            return cls._from_dict(found)
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise ConfigError(f"{path}: not a results file of this version: {error}") from None

    @classmethod
    def _from_dict(cls, found: dict[str, Any]) -> Results:
        if found.pop("format") != FORMAT:
            raise ValueError(f"the format is not {FORMAT!r}")
        for model in found.get("models", []):  # What files of before have, always empty.
            model.pop("seconds_trained", None)
            model.pop("steps_trained", None)
        parts = {"models": Model, "scores": Score, "likelihoods": Likelihood, "invariances": Invariance}
        for name, kind in parts.items():
            found[name] = [kind(**item) for item in found.get(name, [])]
        found["examples"] = [_example(item) for item in found["examples"]]
        return cls(**found)

    def prefix_suites(self, domain: str) -> None:
        """Call the suites of one of a mixture's data sets by its name too: `ferry/seen`."""
        self.scores = [replace(part, suite=f"{domain}/{part.suite}") for part in self.scores]
        self.likelihoods = [replace(part, suite=f"{domain}/{part.suite}") for part in self.likelihoods]
        self.invariances = [replace(part, suite=f"{domain}/{part.suite}") for part in self.invariances]
        self.examples = [replace(part, suite=f"{domain}/{part.suite}") for part in self.examples]

    def join(self, other: Results) -> None:
        """Add what another evaluation found; where both have a score, this one's stays."""
        names = {model.name for model in self.models}
        self.models += [model for model in other.models if model.name not in names]
        scores = {(s.model, s.suite, s.decode) for s in self.scores}
        self.scores += [s for s in other.scores if (s.model, s.suite, s.decode) not in scores]
        likelihoods = {(k.model, k.suite) for k in self.likelihoods}
        self.likelihoods += [k for k in other.likelihoods if (k.model, k.suite) not in likelihoods]
        known = {(k.model, k.suite) for k in self.invariances}
        self.invariances += [k for k in other.invariances if (k.model, k.suite) not in known]
        self._join_examples(other)

    def _join_examples(self, other: Results) -> None:
        """Outputs for the same prompt stand together."""
        known = {(e.suite, e.index, e.prompt): e for e in self.examples}
        for example in other.examples:
            same = known.get((example.suite, example.index, example.prompt))
            if same is None:
                self.examples.append(example)
            else:
                same.outputs.extend(example.outputs)


def _example(item: dict[str, Any]) -> Example:
    return Example(**{**item, "outputs": [Output(**output) for output in item["outputs"]]})


def differences(old: Results, new: Results) -> list[str]:
    """One sentence for each score or likelihood of `old` that `new` does not repeat, timings aside."""
    found = []
    for before, after in _pairs(old, new):
        where = " ".join(getattr(before, name) for name in ("model", "suite", "decode") if hasattr(before, name))
        if after is None:
            found.append(f"{where}: missing")
            continue
        found += [f"{where}: {line}" for line in _unequal(before, after)]
    return found


def _pairs(old: Results, new: Results) -> list[tuple[Any, Any]]:
    scores = {(s.model, s.suite, s.decode): s for s in new.scores}
    likelihoods = {(k.model, k.suite): k for k in new.likelihoods}
    invariances = {(k.model, k.suite): k for k in new.invariances}
    return (
        [(s, scores.get((s.model, s.suite, s.decode))) for s in old.scores]
        + [(k, likelihoods.get((k.model, k.suite))) for k in old.likelihoods]
        + [(k, invariances.get((k.model, k.suite))) for k in old.invariances]
    )


def _unequal(before: Any, after: Any) -> list[str]:
    lines = []
    earlier = isinstance(before, Score) and before.effective is None
    left_out = TIMING + COUNTED if earlier else TIMING
    for part in fields(before):
        old, new = getattr(before, part.name), getattr(after, part.name)
        if part.name not in left_out and not _same(old, new):
            lines.append(f"{part.name} was {old}, is {new}")
    return lines


def _same(old: Any, new: Any) -> bool:
    """Equality; measured logarithms may differ in the last digits from machine to machine."""
    if isinstance(old, float) and isinstance(new, float):
        return abs(old - new) <= 1e-4 * max(abs(old), abs(new))
    return bool(old == new)
