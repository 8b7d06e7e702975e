"""From the oracle's judgements to one line of the table. It counts; it decides nothing."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from strips_lm.evaluate.results import Score
from strips_lm.evaluate.statistics import effective, mean, wilson

if TYPE_CHECKING:
    from collections.abc import Sequence

    from strips_lm._native import Judgement

_K = TypeVar("_K", int, str)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What was tried: one model, one suite, one way of decoding, and what it took."""

    model: str
    suite: str
    decode: str
    oracle_helps: bool
    texts: Sequence[str]
    finished: Sequence[bool]
    optimal_steps: Sequence[int]
    """Of the shortest plans; below 0 where that is not known."""
    templates: Sequence[str] = ()
    """Of the prompts' problems, where they have any."""
    problems: Sequence[int] = ()
    """A number for each prompt's problem, names apart; nothing where all are different."""
    tokens: int
    seconds: float
    verify_seconds: float
    removed_share: float | None = None
    by_oracle: int = 0


def tally(trial: Trial, judgements: Sequence[Judgement]) -> Score:
    """The score of a trial, from the judgement of each of its texts."""
    prompts = len(judgements)
    right = [j.verdict.is_valid and done for j, done in zip(judgements, trial.finished, strict=True)]
    problems = trial.problems or range(prompts)
    worth = effective(problems)
    low, high = wilson(sum(right), prompts, worth)
    known = zip(judgements, trial.optimal_steps, right, strict=True)
    surplus = [j.steps - best for j, best, ok in known if ok and best >= 0]
    return Score(
        model=trial.model,
        suite=trial.suite,
        decode=trial.decode,
        oracle_helps=trial.oracle_helps,
        prompts=prompts,
        valid=sum(right),
        valid_low=low,
        valid_high=high,
        optimal=sum(extra == 0 for extra in surplus),
        surplus_mean=mean(surplus),
        executable_share=mean(_executable(j) for j in judgements),
        states=sum(j.states_total for j in judgements),
        states_right=sum(j.states_right for j in judgements),
        traces_right=sum(ok and j.states_right == j.states_total for j, ok in zip(judgements, right, strict=True)),
        unfinished=sum(not done for done in trial.finished),
        malformed=sum(j.verdict.outcome == "syntax" for j in judgements),
        verdicts=_verdicts(judgements, right),
        failed_at=_failed_at(judgements, right),
        by_length=_by_length(trial.optimal_steps, right),
        tokens=trial.tokens,
        seconds=trial.seconds,
        prompts_per_second=prompts / trial.seconds if trial.seconds else 0.0,
        tokens_per_second=trial.tokens / trial.seconds if trial.seconds else 0.0,
        verify_seconds=trial.verify_seconds,
        digest=digest(trial.texts),
        removed_share=trial.removed_share,
        by_oracle=trial.by_oracle,
        optimum_known=None if len(surplus) == sum(right) else len(surplus),
        problems=len(set(problems)),
        effective=worth,
        by_template=dict(sorted(_shares(trial.templates, right).items())) if any(trial.templates) else {},
    )


def _executable(judgement: Judgement) -> float:
    """The share of emitted steps that come before the first failure; all of an empty plan."""
    return judgement.executable_steps / judgement.steps if judgement.steps else 1.0


def _verdicts(judgements: Sequence[Judgement], right: Sequence[bool]) -> dict[str, int]:
    """Prompts by verdict; a plan that would be valid had its text ended is `unfinished`."""
    names = [
        "unfinished" if j.verdict.is_valid and not ok else j.verdict.outcome
        for j, ok in zip(judgements, right, strict=True)
    ]
    return dict(sorted(Counter(names).items(), key=lambda item: (item[0] != "valid", -item[1], item[0])))


def _failed_at(judgements: Sequence[Judgement], right: Sequence[bool]) -> dict[str, int]:
    steps = Counter(j.verdict.step for j, ok in zip(judgements, right, strict=True) if not ok)
    order = sorted(steps, key=lambda step: (step is None, step or 0))
    return {"-" if step is None else str(step): steps[step] for step in order}


def _by_length(lengths: Sequence[int], right: Sequence[bool]) -> dict[str, list[int]]:
    found = _shares(lengths, right)
    return {str(length) if length >= 0 else "?": found[length] for length in sorted(found)}


def _shares(keys: Sequence[_K], right: Sequence[bool]) -> dict[_K, list[int]]:
    """[right, all] of each key."""
    found: dict[_K, list[int]] = {}
    for key, ok in zip(keys, right, strict=True):
        counts = found.setdefault(key, [0, 0])
        counts[0] += ok
        counts[1] += 1
    return found


def own_choices(prompts: Sequence[int], right: Sequence[bool], scores: Sequence[float]) -> list[int]:
    """Over all pairs of a right and a wrong sample for the same prompt: [right one scored higher, pairs]."""
    groups: dict[int, tuple[list[float], list[float]]] = {}
    for prompt, ok, score in zip(prompts, right, scores, strict=True):
        groups.setdefault(prompt, ([], []))[not ok].append(score)
    pairs = [(good, bad) for goods, bads in groups.values() for good in goods for bad in bads]
    return [sum(good > bad for good, bad in pairs), len(pairs)]


def digest(texts: Sequence[str]) -> str:
    """SHA-256 over texts in order."""
    found = hashlib.sha256()
    for text in texts:
        found.update(text.encode() + b"\0")
    return found.hexdigest()
