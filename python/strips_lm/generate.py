"""A checkpoint at work: prompts in, completions out, in one of several ways of decoding.

It joins a tokenizer, a model and a decoder, and knows no planning: what a completion means, and whether its plan holds,
is for the oracle to say. A way of decoding in which the oracle takes part gets it as a function: of texts to choose
among them, of prompts' numbers to guide the model.
"""

from __future__ import annotations

import copy
import math
import time
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from typing import TYPE_CHECKING, Any, Literal, Self, get_args

import torch

from strips_lm import tokenizer as tokenizers
from strips_lm.config import ConfigError
from strips_lm.config.names import suggestion
from strips_lm.decode import Generation, Greedy, Job, Limits, Loop, Sample, run_jobs
from strips_lm.decode.beam import beam_search
from strips_lm.decode.decoders import decoders_of
from strips_lm.decode.masked import MaskedLoop
from strips_lm.decode.search import Budget, SearchLoop
from strips_lm.fallback import Fallback
from strips_lm.guides import oracle_guide
from strips_lm.loss import judges_steps
from strips_lm.model import checkpoint_folder, load_model
from strips_lm.processor import usable_cores
from strips_lm.replan import Encoded, Renewal, replan
from strips_lm.rerank import Drawn, plan_log_chances, rate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from strips_lm._native import Domain
    from strips_lm.config import GenerateConfig
    from strips_lm.decode import Decoder
    from strips_lm.decode.decoders import Decoders
    from strips_lm.decode.masked import Listener
    from strips_lm.guide import Tasks
    from strips_lm.rerank import Judge, Rating
    from strips_lm.tokenizer import PlanTokenizer


Decode = Literal[
    "greedy", "sample", "beam", "best-of-k", "replan", "masked", "masked-replan", "search", "search-replan"
]
"""The ways of decoding."""

DECODES: tuple[str, ...] = get_args(Decode)

GUIDED = ("masked", "masked-replan", "search", "search-replan")
"""Of these, the ones in which the oracle says what may come next."""


@dataclass(frozen=True, slots=True)
class Completion:
    """What a model wrote after one prompt."""

    text: str
    tokens: int
    """Tokens written, the stop token included."""
    finished: bool
    """Whether it ended with the stop token."""
    log_probability: float
    """In nats, of all its tokens; 0 where the way of decoding does not need it."""
    choices: int = 0
    """`masked`: tokens that the model chose, all others being forced; `search`: calls of the model."""
    removed: float = 0.0
    """`masked`, `search`: the probability that the mask took away, summed over the choices."""
    ids: Sequence[int] = ()
    """The tokens themselves."""
    by_oracle: bool = False
    """`generate.fallback`: whether the oracle's own search wrote it, the model having come to no plan."""
    steps_cut: int = 0
    """`masked`: by how many steps the plan is shorter than the one that the model came to."""


@dataclass(frozen=True, slots=True)
class Batch:
    """The completions of many prompts, and how long they took."""

    completions: list[Completion]
    tokens: int
    """Tokens written in all, those of discarded samples included."""
    seconds: float

    @property
    def removed_share(self) -> float | None:
        """`masked`, `search`: the probability that the mask took away at a choice, on average; else `None`."""
        choices = sum(c.choices for c in self.completions)
        return sum(c.removed for c in self.completions) / choices if choices else None


def check_decode(name: str) -> str:
    """The name of a way of decoding.

    Raises:
        ConfigError: there is none of that name.
    """
    if name not in DECODES:
        raise ConfigError(f"no way of decoding `{name}`: one of {', '.join(DECODES)}{suggestion(name, DECODES)}")
    return name


class Planner:
    """A model and its tokenizer, ready to continue prompts."""

    judging: Planner
    """The planner whose second head chooses: this one itself, or that of the checkpoint `generate.judge`."""
    on_text: Listener | None = None
    """Hears what `masked` and `masked-replan` have written so far, after every choice."""

    def __init__(self, model: Any, tokenizer: PlanTokenizer, config: GenerateConfig, seed: int = 0) -> None:
        """Both as they are, the model trained no further; `seed` decides what `sample` draws."""
        self.model, self.tokenizer, self.config, self.seed = model, tokenizer, config, seed
        self.judging: Planner = self
        self.workers = config.workers or (1 if model.device.type != "cpu" else usable_cores())

    @classmethod
    def load(cls, folder: str | Path, config: GenerateConfig, seed: int = 0, device: str | None = None) -> Self:
        """The planner of a checkpoint's or a run's folder, on a GPU where there is one unless `device` says otherwise.

        Raises:
            ValueError: the folder holds no checkpoint of ours.
        """
        place = checkpoint_folder(folder)
        device = device or ("cuda" if torch.cuda.is_available() else "cpu")
        model: Any = load_model(place)
        found = cls(model.to(device), tokenizers.load(place), config, seed)
        if config.judge:
            found.judging = cls.load(config.judge, replace(config, judge=""), seed, device)
            if not found.judging.judges_steps:
                raise ConfigError(f"{config.judge}: its head judges no steps\nhint: train one with `--preset judge`")
        return found

    def for_domain(self, domain: Domain) -> Self:
        """The same planner for prompts of one domain, which a model that was trained on several must know.

        Raises:
            TokenizerError: it was trained on several, and on none like this.
        """
        found = copy.copy(self)
        found.tokenizer = self.tokenizer.of_domain(domain)
        found.judging = found if self.judging is self else self.judging.for_domain(domain)
        return found

    @property
    def model_context(self) -> int:
        """Positions that the model has."""
        return self._decoder(0).context

    @property
    def has_head(self) -> bool:
        """Whether the model has a multiple-choice head."""
        return hasattr(self.model, "multiple_choice_head")

    @property
    def judges_steps(self) -> bool:
        """Whether the model has a second head, and it judges steps."""
        return self.has_head and judges_steps(self.model)

    def complete(
        self,
        prompts: Sequence[str],
        decode: str,
        judge: Judge | None = None,
        tick: Callable[[int], None] | None = None,
        tasks: Tasks | None = None,
    ) -> Batch:
        """A completion of each prompt; `tick` is called with the number of prompts done so far.

        `best-of-k` may need the oracle as `judge`, `masked` and `search` need it as `tasks`.

        Raises:
            ConfigError: `decode` is none of `DECODES`, or asks for a head or an oracle that is not there.
        """
        check_decode(decode)
        if decode == "best-of-k":
            drawn = self.draw(prompts, tick)
            return self.choose(drawn, rate(self, drawn, self.config.rerank, judge))
        started = time.perf_counter()
        if decode == "replan":
            completions, tokens = self._replan(prompts, tick)
            return Batch(completions, tokens, time.perf_counter() - started)
        asked = Encoded(prompts, *self.tokenizer.encode_prompts(prompts))
        made = self._guided(asked, decode, tasks, tick) if decode in GUIDED else self._decode(asked.ids, decode, tick)
        completions = self._texts(asked.ids, asked.legends, made)
        return Batch(completions, sum(len(g.tokens) for g in made), time.perf_counter() - started)

    def draw(self, prompts: Sequence[str], tick: Callable[[int], None] | None = None) -> Drawn:
        """`config.samples` samples for each prompt, with all that the ways of choosing need."""
        started = time.perf_counter()
        ids, legends = self.tokenizer.encode_prompts(prompts)
        made = self._decode(ids, "sample", tick, draws=self.config.samples, score=True)
        many = [i for i in range(len(ids)) for _ in range(self.config.samples)]
        texts = self._texts([ids[i] for i in many], [legends[i] for i in many], made)
        return Drawn(prompts, ids, made, texts, time.perf_counter() - started)

    def choose(self, drawn: Drawn, rating: Rating | None = None) -> Batch:
        """The best of each prompt's samples by a rating; without one the first, which is what a single one is worth."""
        best = rating.best(drawn) if rating else [i * self.config.samples for i in range(len(drawn.prompts))]
        seconds = drawn.seconds + (rating.seconds if rating else 0.0)
        return Batch([drawn.texts[i] for i in best], sum(len(g.tokens) for g in drawn.made), seconds)

    def _replan(self, prompts: Sequence[str], tick: Callable[[int], None] | None) -> tuple[list[Completion], int]:
        """Plans made of first steps, and the tokens of all that were tried.

        Those that the second head doubts are tried again with drawn steps, `config.attempts` times in all; of a
        prompt's plans the one stays that the head finds likeliest to hold.
        """
        config = self.config
        if config.attempts > 1 and not self.judging.judges_steps:
            raise ConfigError("`generate.attempts` needs a head that judges steps\nhint: `generate.judge` names one")
        self.tokenizer.encode_prompts(prompts)  # a prompt without tokens is the caller's mistake; a state, the model's
        plans = replan(prompts, self.first_steps, config.samples, config.max_new, tick)
        tokens = sum(plan.tokens for plan in plans)
        if config.attempts == 1:
            return plans, tokens
        chances, seeds = plan_log_chances(self.judging, prompts, plans), count(self.seed)

        def drawn(prompts: Sequence[str], draws: int) -> list[list[Completion]]:
            return self.first_steps(prompts, draws, next(seeds))

        for _ in range(1, config.attempts):
            doubted = [i for i, chance in enumerate(chances) if chance <= math.log(0.5)]
            if not doubted:
                break
            asked = [prompts[i] for i in doubted]
            again = replan(asked, drawn, config.samples, config.max_new)
            tokens += sum(plan.tokens for plan in again)
            for i, plan, chance in zip(doubted, again, plan_log_chances(self.judging, asked, again), strict=True):
                if chance > chances[i]:
                    plans[i], chances[i] = plan, chance
        return plans, tokens

    def first_steps(self, prompts: Sequence[str], draws: int, seed: int | None = None) -> list[list[Completion]]:
        """Continuations of each prompt up to its second action, the likeliest first.

        One is the greedy one unless there is a `seed` to draw with, more are drawn. Nothing where a prompt is too long,
        or has no tokens: a state that a model wrote may name more objects than there are slots.
        """
        rows: list[Any] = tokenizers.encode_each(self.tokenizer.encode_prompts, prompts)
        asked = [(i, row[0]) for i, row in enumerate(rows) if row is not None and len(row[0]) < self.model_context]
        action: Any = self.tokenizer.hf.convert_tokens_to_ids("<ACTION>")
        limits = replace(self._limits(), pause=action)
        config = self.config
        greedy = draws == 1 and seed is None
        choose = Greedy() if greedy else Sample(config.top_k, config.top_p, config.temperature)
        jobs = [Job(i, draw, ids) for i, ids in asked for draw in range(draws)]

        def loop() -> Loop:
            return Loop(self._stepping(), choose, limits, seed=self.seed if seed is None else seed, score=draws > 1)

        made = run_jobs(jobs, loop, self.workers)
        texts = self._texts([rows[g.prompt][0] for g in made], [rows[g.prompt][1] for g in made], made)
        nothing = Completion("", 0, finished=False, log_probability=0.0)
        steps: list[list[Completion]] = [[] for _ in prompts]
        for g, text in zip(made, texts, strict=True):
            steps[g.prompt].append(text)
        return [sorted(found, key=lambda step: -step.log_probability) or [nothing] for found in steps]

    def _decode(
        self,
        ids: Sequence[Any],
        decode: str,
        tick: Callable[[int], None] | None,
        draws: int = 1,
        score: bool = False,
    ) -> list[Generation]:
        """Token ids to token ids."""
        limits = self._limits()
        jobs = self._jobs(ids, draws)
        if decode == "beam":
            width, penalty = self.config.beams, self.config.length_penalty
            return beam_search(jobs, self._decoder, limits, width=width, penalty=penalty, rows=self.config.rows)
        config = self.config
        choose = Greedy() if decode == "greedy" else Sample(config.top_k, config.top_p, config.temperature)
        done = _Counter(tick)

        def loop() -> Loop:
            return Loop(self._stepping(), choose, limits, seed=self.seed, score=score, on_done=done)

        return run_jobs(jobs, loop, self.workers)

    def _guided(
        self,
        asked: Encoded,
        decode: str,
        tasks: Tasks | None,
        tick: Callable[[int], None] | None = None,
    ) -> list[Generation]:
        """Token ids to token ids, the oracle saying what may come."""
        if tasks is None:
            raise ConfigError(f"`--decode {decode}` needs the problem to be guided by")
        done, limits = _Counter(tick), self._limits()
        replans = decode.endswith("-replan")
        renewal = Renewal(self.tokenizer, asked) if replans or asked.lists_objects() else None

        def loop() -> MaskedLoop | SearchLoop:
            decoder, guide = self._decoder(self.config.rows), oracle_guide(self.tokenizer, asked.legends, tasks)
            if decode.startswith("search"):
                renew = renewal if replans else None
                return SearchLoop(decoder, guide, limits, budget=self._budget(), on_done=done, renew=renew)
            back, every = self.config.backtrack, 1 if replans else self.config.renew_steps
            return MaskedLoop(
                decoder,
                guide,
                limits,
                on_done=done,
                on_text=self.on_text,
                renew=renewal,
                every=every,
                backtrack=back,
                shorten=self.config.shorten,
            )

        made = run_jobs(self._jobs(asked.ids), loop, self.workers)
        if not self.config.fallback:
            return made
        oracle = Fallback(oracle_guide(self.tokenizer, asked.legends, tasks), self.config.fallback_seconds)
        return [g if g.finished else oracle.answer(g) for g in made]

    def _budget(self) -> Budget:
        config = self.config
        shorter, order = config.search_shorter, config.search_order
        return Budget(calls=config.search_calls, seconds=config.search_seconds, shorter=shorter, order=order)

    def _limits(self) -> Limits:
        return Limits(stop=self.tokenizer.end_id, max_new=self.config.max_new)

    def _jobs(self, ids: Sequence[Any], draws: int = 1) -> list[Job]:
        """`draws` continuations to make of each prompt."""
        too_long = next((len(row) for row in ids if len(row) >= self.model_context), None)
        if too_long:
            raise ConfigError(f"a prompt of {too_long} tokens does not fit the model's context")
        return [Job(i, draw, row) for i, row in enumerate(ids) for draw in range(draws)]

    @cached_property
    def _decoders(self) -> Decoders:
        return decoders_of(self.model)

    def _decoder(self, rows: int) -> Decoder:
        return self._decoders(rows)

    def _stepping(self) -> Decoder:
        """A decoder for texts that grow by a token at a time."""
        return self._decoder(min(self.config.rows, self._decoders.most_stepping))

    def _texts(self, ids: Sequence[Any], legends: Sequence[Any], made: Sequence[Generation]) -> list[Completion]:
        texts = self.tokenizer.decode_completions(ids, [g.tokens for g in made], legends)
        return [
            Completion(
                text,
                len(g.tokens),
                g.finished,
                g.log_probability,
                g.choices,
                g.removed,
                g.tokens,
                g.by_oracle,
                g.steps_cut,
            )
            for text, g in zip(texts, made, strict=True)
        ]


class _Counter:
    """Counts finished continuations for a progress bar."""

    def __init__(self, tick: Callable[[int], None] | None) -> None:
        self.tick, self.count = tick, 0

    def __call__(self, _: Generation) -> None:
        self.count += 1
        if self.tick is not None:
            self.tick(self.count)
