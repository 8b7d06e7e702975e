"""Scores of models on suites: every plan checked by the oracle against its prompt's own PDDL problem.

Free greedy decoding comes first; every mode in which the oracle takes part is marked. All models see the same prompts
in the same order. What is found is a `Results`; printing is the command line's concern.
"""

from __future__ import annotations

import time
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strips_lm import tokenizer as tokenizers
from strips_lm.config import ConfigError, RunConfig, versions
from strips_lm.config.names import suggestion
from strips_lm.config.sections import RERANKS, SUITES
from strips_lm.evaluate.likelihood import measure
from strips_lm.evaluate.renaming import Names, invariance
from strips_lm.evaluate.results import OWN_SAMPLE, Example, Invariance, Model, Output, Results, Score
from strips_lm.evaluate.suite import Suite
from strips_lm.evaluate.suites import DataFolder
from strips_lm.evaluate.tally import Trial, own_choices, tally
from strips_lm.folders import data_sets
from strips_lm.generate import GUIDED, Batch, Planner, check_decode
from strips_lm.guide import canonical, check_domain
from strips_lm.model import checkpoint_folder
from strips_lm.rerank import rate
from strips_lm.stepwise import stepwise

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from strips_lm._native import Judgement


def evaluate(
    config: RunConfig,
    data: str | Path,
    models: Sequence[str | Path],
    tell: Callable[[str], None],
    tick: Callable[[str, int, int], None] | None = None,
) -> Results:
    """Evaluate models on a data set, or on each of a mixture's, whose suites are then called `domain/suite`.

    Raises:
        ConfigError: there is no such suite or way of decoding, or a model cannot be decoded so.
    """
    folders = [DataFolder(folder) for folder in data_sets(Path(data))]
    if len(folders) == 1:
        return Evaluation(config, folders[0], tell, tick).run(models)
    if config.evaluate.problems:
        raise ConfigError("`--problems` are of one domain\nhint: `--data` with that domain's folder of the mixture")
    whole = Results(data=str(data), config=_settings(config), created=_now(), versions=versions())
    for folder, part in zip(folders, _parts(config, folders), strict=True):
        tell(f"{folder.path.name}:")
        found = Evaluation(part, folder, tell, tick).run(models)
        found.prefix_suites(folder.path.name)
        whole.join(found)
    return whole


def _parts(config: RunConfig, folders: Sequence[DataFolder]) -> list[RunConfig]:
    """The configuration for each of a mixture's data sets: the suites that it has.

    Raises:
        ConfigError: a suite is in none of them.
    """
    there = [set(folder.suites()) for folder in folders]
    for suite in config.evaluate.suites:
        if config.evaluate.suites != SUITES and not any(suite in names for names in there):
            raise ConfigError(f"no suite `{suite}` in any data set{suggestion(suite, set().union(*there))}")
    suites = [tuple(suite for suite in config.evaluate.suites if suite in names) for names in there]
    return [replace(config, evaluate=replace(config.evaluate, suites=found)) for found in suites]


class Evaluation:
    """One run of the evaluation; `tell` gets a line for each thing that is done, `tick` the prompts done so far."""

    def __init__(
        self,
        config: RunConfig,
        data: DataFolder,
        tell: Callable[[str], None],
        tick: Callable[[str, int, int], None] | None = None,
    ) -> None:
        """Check the names of suites and ways of decoding before any work."""
        for decode in config.evaluate.decodes:
            check_decode(decode)
        self.config, self.data, self.tell, self.tick = config, data, tell, tick
        limit = config.evaluate.limit
        self.suites = [Suite.open(data, name, limit) for name in self._names()]
        self.suites += [Suite.of_problems(data, folder, limit) for folder in config.evaluate.problems]
        self.results = Results(data=str(data.path), config=_settings(config), created=_now(), versions=versions())

    def _names(self) -> list[str]:
        """The suites that are asked for; of the default those that the data set has."""
        named, there = self.config.evaluate.suites, self.data.suites()
        missing = [name for name in named if name not in there] if named == SUITES else []
        for name in missing:
            self.tell(f"{self.data.path.name}: no suite `{name}`, left out")
        return [name for name in named if name not in missing]

    def run(self, folders: Sequence[str | Path]) -> Results:
        """Evaluate each model on each suite.

        Raises:
            ConfigError: a model cannot be decoded in one of the ways asked for.
        """
        if set(GUIDED) & set(self.config.evaluate.decodes):
            for folder in folders:
                words = canonical(tokenizers.load(checkpoint_folder(folder))).of_domain(self.data.domain)
                check_domain(words, self.data.domain)
        for name, folder in zip(model_names(folders), folders, strict=True):
            planner = Planner.load(folder, self.config.generate, self.config.seed).for_domain(self.data.domain)
            self.results.models.append(describe(name, folder, planner))
            for suite in self.suites:
                self._try(planner, name, suite)
        return self.results

    def _try(self, planner: Planner, name: str, suite: Suite) -> None:
        """One model on one suite: every way of decoding, then likelihoods."""
        own: dict[str, list[int]] = {}
        for decode in self.config.evaluate.decodes:
            if decode == "best-of-k":
                own = self._best_of_k(planner, name, suite)
            else:
                ticker, tasks = self._ticker(name, suite, decode), suite.oracle(self.data.domain)
                made = planner.complete([i.prompt for i in suite.items], decode, tick=ticker, tasks=tasks)
                self._score(planner, name, suite, self._label(decode), made)
        self._rename(planner, name, suite)
        if not suite.of_records:
            return
        pairs = self.data.items(suite.name, self.config.evaluate.pairs, distinct=False)
        found = measure(planner, name, suite.name, pairs)
        found = replace(found, by_negative={**found.by_negative, **own})
        self.results.likelihoods.append(found)
        self.tell(f"{name} {suite.name}: perplexity {found.perplexity:.4f} over {found.tokens} tokens")

    def _rename(self, planner: Planner, name: str, suite: Suite) -> None:
        """The suite's first problems under other names."""
        config = self.config.evaluate
        items = suite.items[: config.renamed_problems]
        if not items or not config.renamings:
            return
        constants = {constant for constant, _ in self.data.domain.constants}
        pool = sorted({word for item in suite.items for word in item.names} - constants)
        found = invariance(planner, items, Names(pool, constants, config.renamings, self.config.seed))
        same = Invariance(model=name, suite=suite.name, **found)
        self.results.invariances.append(same)
        share = 100 * same.same / same.renamed if same.renamed else 100.0
        self.tell(f"{name} {suite.name}: {share:.1f} % of {same.renamed} renamings leave the plan as it is")

    def _label(self, decode: str) -> str:
        """What a way of decoding is called in the results."""
        generate = self.config.generate
        if decode == "replan" and generate.attempts > 1:
            return f"replan, up to {generate.attempts} times"
        return f"{decode} with fallback" if generate.fallback and decode in GUIDED else decode

    def _best_of_k(self, planner: Planner, name: str, suite: Suite) -> dict[str, list[int]]:
        """The same samples chosen by the head, by likelihood, step by step and by the oracle.

        Of each way without the oracle, by its kind in the results: [right, pairs] of a prompt's valid samples against
        its others.
        """
        drawn = planner.draw([item.prompt for item in suite.items], self._ticker(name, suite, "best-of-k"))

        def judge(numbers: Sequence[int], texts: Sequence[str]) -> list[bool]:
            return [j.verdict.is_valid for j in suite.judge(self.data.domain, numbers, texts)]

        choices = [choice for choice in RERANKS if choice != "head" or planner.judging.has_head]
        ratings = {choice: rate(planner, drawn, choice, judge) for choice in choices}
        label = f"best-of-{self.config.generate.samples} by"
        self._score(planner, name, suite, f"{label} first", planner.choose(drawn))
        for choice, rating in ratings.items():
            self._score(planner, name, suite, f"{label} {choice}", planner.choose(drawn, rating))
        prompts, valid = [g.prompt for g in drawn.made], ratings.pop("oracle").scores
        right = [bool(ok) and g.finished for ok, g in zip(valid, drawn.made, strict=True)]
        return {
            OWN_SAMPLE if choice == "head" else f"{OWN_SAMPLE} by {choice}": own_choices(prompts, right, rating.scores)
            for choice, rating in ratings.items()
        }

    def _score(self, planner: Planner, name: str, suite: Suite, decode: str, made: Batch) -> None:
        """Have the oracle judge the completions, and keep the score and some examples."""
        texts = [c.text for c in made.completions]
        suite.prepare(self.data.domain)
        started = time.perf_counter()
        judgements = suite.judge(self.data.domain, range(len(texts)), texts)
        trial = Trial(
            model=name,
            suite=suite.name,
            decode=decode,
            oracle_helps=decode.split(" ", maxsplit=1)[0] in GUIDED or decode.endswith("oracle"),
            texts=texts,
            finished=[c.finished for c in made.completions],
            optimal_steps=[item.optimal_steps for item in suite.items],
            templates=[item.template for item in suite.items],
            problems=suite.problem_numbers(),
            tokens=made.tokens,
            seconds=made.seconds,
            verify_seconds=time.perf_counter() - started,
            removed_share=made.removed_share,
            by_oracle=sum(c.by_oracle for c in made.completions),
        )
        score = tally(trial, judgements)
        self.results.scores.append(score)
        self._keep_examples(planner, suite, score, texts, judgements)
        self.tell(_line(score))

    def _keep_examples(
        self, planner: Planner, suite: Suite, score: Score, texts: Sequence[str], judgements: Sequence[Judgement]
    ) -> None:
        """The outputs for the suite's first prompts, with the model's probability of each step."""
        count = min(self.config.evaluate.examples, len(texts))
        prompts = [item.prompt for item in suite.items[:count]]
        for index, probable in enumerate(stepwise(planner, prompts, texts[:count])):
            verdict = judgements[index].verdict
            output = Output(
                model=score.model,
                decode=score.decode,
                text=texts[index],
                plan=judgements[index].plan,
                verdict=verdict.outcome,
                step=verdict.step,
                reason=verdict.reason,
                finished=judgements[index].finished,
                operator_probabilities=probable.operators,
                state_probabilities=probable.states,
                end_probability=probable.end,
            )
            self._example(suite, index).outputs.append(output)

    def _example(self, suite: Suite, index: int) -> Example:
        """The example of a suite's prompt, new if it is the first time."""
        for example in self.results.examples:
            if (example.suite, example.index) == (suite.name, index):
                return example
        item, problem = suite.items[index], suite.problems[index]
        found = Example(
            suite=suite.name, index=index, prompt=item.prompt, problem=problem, reference=item.plan, outputs=[]
        )
        self.results.examples.append(found)
        return found

    def _ticker(self, name: str, suite: Suite, decode: str) -> Callable[[int], None] | None:
        if self.tick is None:
            return None
        tick, total = self.tick, len(suite.items)
        if decode == "best-of-k":
            total *= self.config.generate.samples
        return lambda done: tick(f"{name} {suite.name} {decode}", done, total)


def _line(score: Score) -> str:
    where = f"{score.model} {score.suite} {score.decode}"
    spread = f"[{100 * score.valid_low:.1f}, {100 * score.valid_high:.1f}]"
    speed = f"{score.prompts_per_second:.0f} prompts/s"
    mask = "" if score.removed_share is None else f", the mask removed {100 * score.removed_share:.3g} %"
    oracle = f", {score.by_oracle} answered by the oracle's own search" if score.by_oracle else ""
    problems = f" ({score.problems} problems)" if score.repeats else ""
    return f"{where}: {100 * score.share:.1f} % valid {spread} of {score.prompts}{problems}, {speed}{mask}{oracle}"


def _settings(config: RunConfig) -> dict[str, Any]:
    return {"seed": config.seed, "generate": asdict(config.generate), "evaluate": asdict(config.evaluate)}


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def model_names(folders: Sequence[str | Path]) -> list[str]:
    """A short name for each folder: its last part, or as many parts as tell it from the others."""
    parts = [[p for p in Path(folder).resolve().parts if p not in {"best", "last"}] for folder in folders]
    depth = 1
    while len({tuple(p[-depth:]) for p in parts}) < len(parts) and depth < max(map(len, parts)):
        depth += 1
    return ["/".join(p[-depth:]) for p in parts]


def describe(name: str, folder: str | Path, planner: Planner) -> Model:
    """What the results say of a model."""
    place = checkpoint_folder(folder)
    config = RunConfig.load(place / "run.toml") if (place / "run.toml").is_file() else None
    return Model(
        name=name,
        path=str(folder),
        kind=config.model.kind if config else type(planner.model).__name__,
        tokenizer=config.tokenizer.kind if config else type(planner.tokenizer).__name__,
        parameters=sum(p.numel() for p in planner.model.parameters()),
    )
