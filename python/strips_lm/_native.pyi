"""The oracle, in Rust.

Texts in, plans, counts and verdicts out. Every call that may be long leaves the interpreter free and answers Ctrl-C.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, TypeAlias, final, overload

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "OUTCOMES",
    "CanonicalCodec",
    "Completion",
    "DataError",
    "Domain",
    "Gpt2Rows",
    "Gpt2Weights",
    "Judge",
    "Judgement",
    "Legend",
    "LimitError",
    "MaskedDecoder",
    "PddlError",
    "PlanIterator",
    "PlanSet",
    "Plans",
    "Problem",
    "Prover",
    "RecordStream",
    "Task",
    "Verdict",
    "__version__",
    "attend",
    "attend_back",
    "judge",
    "parse_completions",
    "render_prompt",
    "split_plans",
    "split_texts",
    "state_graph",
]
__version__: str

OUTCOMES: list[str]
"""Every outcome of a verdict; `outcomes` and `validate_ids` give positions in it."""

_Semantics: TypeAlias = Literal["first-goal", "any", "simple"]
_Plan: TypeAlias = tuple[str, ...]
"""Operator names, such as `("(pick cup)", "(place cup shelf)")`."""

class PddlError(ValueError):
    """A PDDL text that is wrong; `str` shows the line with a caret."""

    kind: str
    file: str
    line: int
    column: int
    message: str

class LimitError(RuntimeError):
    """A budget was spent before the work was done."""

    kind: str

class DataError(ValueError):
    """A mistake in a template, lexicon or data file; `str` has its file, line and column."""

@final
class Domain:
    """A planning domain, every name resolved and every type checked."""

    @staticmethod
    def parse(text: str | bytes, file: str = "<domain>") -> Domain:
        """Parses a PDDL domain; `file` is what messages call it.

        Raises:
            PddlError: the text is no domain of the supported language.
        """
    @property
    def name(self) -> str:
        """The domain's name."""
    @property
    def types(self) -> list[tuple[str, list[str]]]:
        """Every type with its direct supertypes; `object` comes first."""
    @property
    def constants(self) -> list[tuple[str, str]]:
        """Every constant with its type."""
    @property
    def pending(self) -> list[str]:
        """Objects that the domain uses but leaves to problems to declare; they come right after the constants."""
    @property
    def predicates(self) -> list[tuple[str, list[str]]]:
        """Every predicate with its parameters' types."""
    @property
    def actions(self) -> list[tuple[str, list[str]]]:
        """Every action with its parameters' types."""
    @property
    def warnings(self) -> list[str]:
        """What was accepted although the standard forbids it, a line each."""
    def to_pddl(self) -> str:
        """The domain as PDDL; parsing it gives the same domain again."""

@final
class Problem:
    """A problem of a domain."""

    @staticmethod
    def parse(text: str | bytes, domain: Domain, file: str = "<problem>") -> Problem:
        """Parses a PDDL problem of `domain`; `file` is what messages call it.

        Raises:
            PddlError: the text is no problem of the domain.
        """
    @property
    def name(self) -> str:
        """The problem's name."""
    @property
    def objects(self) -> list[tuple[str, str]]:
        """Every object with its type: constants first, then the problem's own."""
    @property
    def warnings(self) -> list[str]:
        """What was accepted although the standard forbids it, a line each."""
    def to_pddl(self) -> str:
        """The problem as PDDL; parsing it gives the same problem again."""
    def rename(self, names: Sequence[str]) -> Problem:
        """The same problem with its objects called `names`.

        Raises:
            ValueError: the names are not all different, not one an object, or change the domain's own.
        """

@final
class Task:
    """A problem grounded to facts and operators; nothing that can ever be applied is left out."""

    def __new__(
        cls,
        domain: Domain,
        problem: Problem,
        *,
        max_operators: int | None = None,
        max_facts: int | None = None,
        max_bytes: int | None = None,
        time_limit: float | None = None,
    ) -> Task:
        """Grounds a problem.

        Raises:
            LimitError: more operators or facts than allowed, more memory or more seconds.
        """
    @property
    def num_facts(self) -> int:
        """How many facts can differ between reachable states."""
    @property
    def num_operators(self) -> int:
        """How many operators there are."""
    def operator_name(self, operator: int) -> str:
        """An operator's name, such as `(pick cup)`."""
    def plan_set(
        self,
        max_steps: int,
        semantics: _Semantics = "first-goal",
        *,
        max_states: int | None = None,
        max_bytes: int | None = None,
        time_limit: float | None = None,
    ) -> PlanSet:
        """All plans of at most `max_steps` steps.

        Raises:
            LimitError: more states than allowed, more memory or more seconds.
        """

    def shortest_plan(
        self,
        max_steps: int | None = None,
        *,
        max_states: int | None = None,
        max_bytes: int | None = None,
        time_limit: float | None = None,
    ) -> _Plan | None:
        """The first of the shortest plans of at most `max_steps` steps, or `None` where there is none.

        What the plan set of any semantics begins with, by a search that ends where it meets the goal.

        Raises:
            LimitError: more states than allowed, more memory or more seconds.
        """
    def initial_state(self) -> NDArray[np.uint64]:
        """The initial state, as one row (1, words).

        A state is a row of words in which bit `i` is fact `i`. The calls below take many at once, any states of the
        task's facts, reachable or not, and work in parallel.
        """
    def pack(self, states: Sequence[Sequence[str]]) -> NDArray[np.uint64]:
        """Packs states given by their true atoms, such as `(on cup table)`: (states, words).

        Atoms that can never become false may be left out, derived ones are computed.

        Raises:
            ValueError: no reachable state has an atom.
        """
    def atoms(self, states: NDArray[np.uint64]) -> list[list[str]]:
        """The atoms of each state, those that never change and derived ones included."""
    def is_goal(self, states: NDArray[np.uint64]) -> NDArray[np.bool_]:
        """Whether each state satisfies the goal."""
    def applicable(self, states: NDArray[np.uint64]) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:
        """The operators that may be applied in each state.

        Returns operator ids and offsets: those of state `i` are `operators[offsets[i]:offsets[i + 1]]`, ascending.
        """
    def successor(self, states: NDArray[np.uint64], operators: NDArray[np.uint32]) -> NDArray[np.uint64]:
        """The state after `operators[i]` in `states[i]`, for each row.

        Raises:
            ValueError: an operator is not applicable; the first such row is named.
        """
    def distance_to_goal(
        self,
        states: NDArray[np.uint64],
        max_steps: int | None = None,
        *,
        max_states: int | None = None,
        max_bytes: int | None = None,
        time_limit: float | None = None,
    ) -> NDArray[np.int64]:
        """The fewest steps from each state to the goal; -1 where there is no way of at most `max_steps`.

        One search from all the states together: it costs as much as the states within `max_steps` of any of them.

        Raises:
            LimitError: more states than allowed, more memory or more seconds.
        """
    def validate(self, text: str) -> Verdict:
        """The verdict on a plan in IPC form."""
    def validate_many(self, texts: Sequence[str]) -> list[Verdict]:
        """The verdict on each plan, in order; in parallel."""
    def outcomes(self, texts: Sequence[str]) -> NDArray[np.uint8]:
        """The outcome of each plan, in order, as a position in `OUTCOMES`; in parallel."""
    def validate_ids(
        self, operators: NDArray[np.uint32], offsets: NDArray[np.int64]
    ) -> tuple[NDArray[np.uint8], NDArray[np.uint32]]:
        """The outcome of each plan given as operator ids, plan `i` being `operators[offsets[i]:offsets[i + 1]]`.

        Returns positions in `OUTCOMES`, and the step at fault (0 where there is none).

        Raises:
            ValueError: the offsets do not ascend within the operators.
        """

@final
class PlanSet:
    """All plans of at most `max_steps` steps, shorter ones first, then in the order of their operators.

    A sequence of plans: `plans[i]` finds one by its rank in time linear in its length, a slice gives them as arrays,
    iteration keeps a chunk at a time.
    """

    @property
    def max_steps(self) -> int:
        """The longest plan's steps."""
    @property
    def semantics(self) -> _Semantics:
        """Which sequences count as plans."""
    def count(self) -> int:
        """How many plans there are; exact at any size, where `len` is limited to what an index can hold."""
    def counts(self) -> list[int]:
        """How many plans there are of each length, from 0 to `max_steps`."""
    def __len__(self) -> int: ...
    def __bool__(self) -> bool: ...
    @overload
    def __getitem__(self, index: int, /) -> _Plan: ...
    @overload
    def __getitem__(self, index: slice, /) -> Plans: ...
    def __iter__(self) -> Iterator[_Plan]: ...
    def __contains__(self, plan: Sequence[str | int], /) -> bool: ...
    def rank(self, plan: Sequence[str | int]) -> int | None:
        """The place of a plan (names or ids of its operators) in the set, or `None` where it is not in it."""
    def sample(self, k: int, seed: int, replace: bool = True) -> Plans:
        """Draws `k` plans uniformly; without `replace`, no plan twice. The same seed gives the same plans.

        Raises:
            ValueError: there are too few plans.
        """
    def shortest(self) -> _Plan | None:
        """The first of the shortest plans, or `None` where there is no plan."""
    def shortest_length(self) -> int | None:
        """The steps of a shortest plan, or `None` where there is no plan."""
    def entropy(self) -> float:
        """The entropy, in nats, of a plan drawn uniformly."""
    def next_operators(self, prefix: Sequence[str | int]) -> list[tuple[int | None, int]]:
        """What may follow a prefix of operators: (operator id, number of plans that go on so); `None` is the end."""
    def text(self, start: int | None = None, stop: int | None = None) -> str:
        """The plans from `start` to `stop` in IPC form, a block each, blocks separated by a blank line."""

@final
class PlanIterator:
    """Plans one after another; holds a chunk of them at a time."""

    def __iter__(self) -> PlanIterator: ...
    def __next__(self) -> _Plan: ...

@final
class Plans:
    """Some plans, as two flat arrays: plan `i` has the operators `operators[offsets[i]:offsets[i + 1]]`."""

    @property
    def operators(self) -> NDArray[np.uint32]:
        """Operator ids, plan after plan; read-only."""
    @property
    def offsets(self) -> NDArray[np.int64]:
        """Where each plan begins, and where the last one ends; read-only."""
    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: int, /) -> _Plan: ...
    @overload
    def __getitem__(self, index: slice, /) -> Plans: ...
    def text(self) -> str:
        """The plans in IPC form, a block each, blocks separated by a blank line."""

@final
class Verdict:
    """What is wrong with a plan, and where; or that it is valid."""

    @property
    def outcome(self) -> str:
        """`valid`, or what is wrong.

        One of `syntax`, `unknown_action`, `unknown_object`, `arity`, `type`, `inapplicable` and `goal_not_reached`.
        """
    @property
    def step(self) -> int | None:
        """The step at fault, from 1; the plan's length + 1 for the goal; `None` for `valid` and `syntax`."""
    @property
    def line(self) -> int | None:
        """The line at fault, from 1; `None` where there is none."""
    @property
    def missing(self) -> list[str]:
        """The literals that do not hold and should, as PDDL."""
    @property
    def cost(self) -> float | None:
        """Of a valid plan: what it raises `total-cost` by where the problem minimizes that, else its length."""
    @property
    def reason(self) -> str:
        """What is wrong, in a sentence."""
    @property
    def is_valid(self) -> bool:
        """Whether the plan is valid."""
    def to_dict(self) -> dict[str, object]:
        """The verdict as `validate --json` prints it."""

@final
class Judgement:
    """What the oracle says of a generated text."""

    @property
    def verdict(self) -> Verdict:
        """The verdict on the plan; `syntax` where the text is malformed."""
    @property
    def plan(self) -> str:
        """The plan in IPC form, in the domain's action names."""
    @property
    def finished(self) -> bool:
        """Whether the text came to its end token."""
    @property
    def steps(self) -> int:
        """How many steps the text has."""
    @property
    def executable_steps(self) -> int:
        """How many of them can be applied, from the first."""
    @property
    def states_total(self) -> int:
        """How many states the text says."""
    @property
    def states_right(self) -> int:
        """How many of them are the true ones."""
    @property
    def first_wrong_state(self) -> int | None:
        """The step, from 1, after which the first wrong state stands; `None` where all are right."""

@final
class Judge:
    """Prompts' problems, read and grounded once, to judge any number of generated texts against."""

    def __new__(cls, domain: Domain, problems: Sequence[str], words: Sequence[dict[str, str]]) -> Judge:
        """`words[i]` gives the domain's action or predicate for a word of the texts for `problems[i]` (PDDL).

        Raises:
            PddlError: a problem is wrong.
            LimitError: a problem is too large.
            ValueError: the lists differ in length.
        """
    def judge(self, numbers: Sequence[int], completions: Sequence[str]) -> list[Judgement]:
        """Judges texts in parallel, each for the problem of its number.

        Parses each, maps its words back to the domain's, validates the plan and compares its states with the true ones.

        Raises:
            ValueError: the lists differ in length.
            IndexError: there is no problem of a number.
        """
    def __len__(self) -> int: ...

def judge(
    domain: Domain, problems: Sequence[str], completions: Sequence[str], words: Sequence[dict[str, str]]
) -> list[Judgement]:
    """Judges generated texts, each for a problem of its own: `Judge(domain, problems, words)`, used once.

    Raises:
        PddlError: a problem is wrong.
        LimitError: a problem is too large.
        ValueError: the lists differ in length.
    """

def split_plans(text: str) -> list[tuple[int, str]]:
    """Splits a text of many plans, separated by blank lines: each plan's number of lines before it, and its text."""

_TextAtom: TypeAlias = tuple[str, list[str]]
"""An atom as it stands in a text: name and arguments."""

@final
class Completion:
    """A completion as far as it makes sense."""

    @property
    def steps(self) -> list[tuple[_TextAtom, list[_TextAtom] | None]]:
        """For each step the action and the state after it, if the text says one."""
    @property
    def finished(self) -> bool:
        """Whether the end token was reached."""
    @property
    def malformed(self) -> tuple[int, str] | None:
        """Byte offset of what cannot be read, and what was expected there."""

def parse_completions(texts: Sequence[str]) -> list[Completion]:
    """Reads completions; never fails, but says how far each makes sense."""

def split_texts(texts: Sequence[str]) -> tuple[list[str], list[str]]:
    """Parts each text into prompt and completion, without the space between them."""

@final
class Legend:
    """What canonical words leave out of a text: names, words, and what the words cannot say."""

    @property
    def names(self) -> list[str]:
        """The object of each slot."""
    @property
    def words(self) -> list[str]:
        """The word for each action of the domain."""
    @property
    def predicates(self) -> list[str]:
        """The word for each predicate of the domain; empty where all go by their names."""
    def to_json(self) -> str:
        """The legend as JSON."""
    @staticmethod
    def from_json(text: str) -> Legend:
        """The legend that `to_json` wrote.

        Raises:
            DataError: the text is something else.
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class CanonicalCodec:
    """Rewrites texts into few words of a small vocabulary, and back without losing a byte."""

    def __new__(
        cls,
        domain: Domain,
        lexicon: str | None = None,
        *,
        layout: Literal["difference", "progress", "report"] = "difference",
    ) -> CanonicalCodec:
        """The codec of a domain, with the words that a lexicon (TOML) gives for its actions and predicates.

        Raises:
            DataError: the lexicon is no TOML.
        """
    @staticmethod
    def of_domains(
        domains: Sequence[tuple[Domain, str | None]],
        *,
        layout: Literal["difference", "progress", "report"] = "difference",
        kinds: bool = False,
    ) -> CanonicalCodec:
        """The codec of several domains, each with its lexicon, in the order that `domains` of `encode` counts.

        With `kinds` an object's type stands before each mention of it.
        """
    @staticmethod
    def from_json(text: str) -> CanonicalCodec:
        """The codec that `to_json` wrote.

        Raises:
            DataError: the text is something else.
        """
    def to_json(self) -> str:
        """Everything the codec knows, as JSON."""
    @property
    def layout(self) -> Literal["difference", "progress", "report"]:
        """How much the rewriting takes out."""
    @property
    def kinds(self) -> bool:
        """Whether an object's type stands before each mention of it."""
    def vocabulary(self, max_slots: int = 0) -> list[str]:
        """All words in the order of their ids, the slots `o0`, … last."""
    @property
    def first_slot(self) -> int:
        """The id of slot 0; slot `n` is `n` more."""
    def word_of(self, name: str) -> int | None:
        """The id of the word for a type, an action or a predicate of that name; `None` where there is none of it."""
    def encode(
        self,
        texts: Sequence[str],
        words: Sequence[Sequence[str]] | None = None,
        names: Sequence[Sequence[str]] | None = None,
        goal_styles: Sequence[str] | None = None,
        domains: Sequence[int] | None = None,
    ) -> tuple[list[str], list[Legend]]:
        """Words, joined by single spaces, and a legend for each text.

        By row, and optional: the word for each action, object names in order of declaration, `state` or `problem`, and
        the number of the domain. A prompt's words are the same with and without a completion after it.
        """
    def encode_ids(
        self,
        texts: Sequence[str],
        words: Sequence[Sequence[str]] | None = None,
        names: Sequence[Sequence[str]] | None = None,
        goal_styles: Sequence[str] | None = None,
        domains: Sequence[int] | None = None,
    ) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64], list[Legend]]:
        """As `encode`, with ids for words: (ids, row starts and the total, words of each prompt, legends)."""
    def decode(self, rows: Sequence[str], legends: Sequence[Legend]) -> list[str]:
        """The texts of rows of words; never fails. What makes no sense is written as its bare words."""
    def decode_completions(
        self, prompts: Sequence[Sequence[int]], completions: Sequence[Sequence[int]], legends: Sequence[Legend]
    ) -> list[str]:
        """The texts of completions alone, from the ids of their prompts and of their own words; never fails."""

def render_prompt(task: Task, style: Literal["paper", "typed"] = "typed", words: Sequence[str] | None = None) -> str:
    """The prompt of a task: in `typed` its objects with their types, and the words where given.

    `words` has one for each action, then perhaps one for each predicate.

    Raises:
        DataError: the goal is no conjunction of literals, or there are not as many words.
    """

def state_graph(
    task: Task, horizon: int, *, max_states: int = 1000
) -> tuple[list[list[str]], list[int], list[bool], list[tuple[int, int, str]]]:
    """The states on plans of at most `horizon` steps: atoms, depths, goals, and edges (from, to, operator).

    Raises:
        LimitError: there are more than `max_states`.
    """

@final
class RecordStream:
    """All records of a data set, made on demand; the same bytes for any number of threads."""

    def __new__(
        cls,
        config: str,
        domain: tuple[str, str],
        lexicon: tuple[str, str] | None = None,
        templates: Sequence[tuple[str, str]] = ...,
        random: tuple[str, str] | None = None,
        large: tuple[str, str] | None = None,
        problems: Sequence[tuple[str, str]] = ...,
        jobs: int = 0,
    ) -> RecordStream:
        """Reads the files, each a name and its text, and solves every problem; `config` is JSON.

        Raises:
            PddlError: a PDDL file is wrong.
            DataError: the lexicon or the configuration is wrong.
            LimitError: a problem is too large.
        """
    @property
    def splits(self) -> list[tuple[str, int]]:
        """The splits that have records, in order, and how many each has."""
    @property
    def left_out(self) -> list[str]:
        """A line for each given problem whose own goal gives no records, with its file."""
    def batch(self, split: str, start: int, stop: int) -> dict[str, Any]:
        """Records as columns: arrays of numbers, `(offsets, bytes)` for texts, `(offsets, texts)` for lists.

        Raises:
            ValueError: there is no such split.
            IndexError: it does not have as many records.
        """
    def problems(self) -> dict[str, Any]:
        """The problems that the records refer to, as columns."""

@final
class Prover:
    """Proves records from their columns and the problems' PDDL alone."""

    def __new__(cls, domain: Domain, problems: Sequence[str]) -> Prover: ...
    def hashes(self, state_goals: Sequence[bool]) -> list[tuple[str, int]]:
        """Each problem's canonical hash and number of objects; `state_goals` says which ask for a whole state.

        Raises:
            DataError: a problem cannot be read or grounded.
        """
    def check(self, rows: Sequence[Mapping[str, Any]]) -> list[str | None]:
        """What is wrong with each record, given by its columns; `None` for nothing."""

@final
class Gpt2Weights:
    """A GPT-2's weights, packed for this processor."""

    def __new__(
        cls,
        blocks: Sequence[Sequence[NDArray[np.float32]]],
        tokens: NDArray[np.float32],
        places: NDArray[np.float32],
        norm: tuple[NDArray[np.float32], NDArray[np.float32]],
        head: NDArray[np.float32],
        *,
        heads: int,
        scales: Sequence[float],
        activation: Literal["gelu_new", "relu", "relu2"],
        epsilon: float,
    ) -> Gpt2Weights:
        """Packs the weights.

        Of each of `blocks` the arrays are, in this order, weight and bias of: the first norm, the attention's inputs,
        its projection, the second norm, the inner layer, and the way back; `scales` are the factors of attention's
        scores.
        `tokens` (vocabulary, width) and `places` (positions, width) are what a token begins as, `norm` is the last one,
        `head` is (vocabulary, width).

        Raises:
            ValueError: shapes that do not fit each other, an array that is not contiguous, or no such activation.
        """
    @property
    def context(self) -> int:
        """Positions that the model has."""

@final
class Gpt2Rows:
    """Rows of text that go through a model on one core: what was read of each is kept.

    A row's logits depend on that row alone, to the last bit.
    """

    def __new__(cls, weights: Gpt2Weights, rows: int) -> Gpt2Rows:
        """So many rows that have read nothing."""
    def feed(self, first: int, ids: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.float32]:
        """Appends tokens to the rows from `first` on; the logits after the last of each, (rows, vocabulary).

        Of `ids` (rows, longest) each row gets its first `counts`, at least one.

        Raises:
            ValueError: there are not so many rows, or a token is none of the vocabulary.
        """
    def move(self, sources: Sequence[int], targets: Sequence[int]) -> None:
        """Copies rows over rows, all at once: what is copied is what was there before."""
    def rewind(self, row: int, count: int) -> None:
        """Forgets the tokens of a row but the first `count`."""

@final
class MaskedDecoder:
    """Says which tokens may come next if every step is to be executable; states are forced, not chosen.

    A row follows one text after its prompt: `add` begins rows, `mask` says what may be chosen, `advance` takes the
    choices and gives back what is forced after them (the whole next state, and whatever has no alternative), which
    is to be fed to the model in one go. No operator that leads back to a state already visited is allowed.
    """

    def __new__(cls, codec: CanonicalCodec, vocabulary: Sequence[str], *, stop_at_goal: bool = True) -> MaskedDecoder:
        """A decoder without rows; `vocabulary` are the model's tokens by id.

        With `stop_at_goal` the end is the only token where the goal holds; else a plan may also go on there.
        """
    def add(
        self, tasks: Sequence[Task], legends: Sequence[Legend], names: Sequence[Sequence[str]] | None = None
    ) -> tuple[int, list[list[int]]]:
        """Begins a row for each task and its legend; the first row's number, and the tokens forced in each.

        `names` are the prompt's names of the task's objects where they are not the problem's own.

        Raises:
            ValueError: the vocabulary lacks a word that the task needs.
        """
    def advance(self, rows: Sequence[int], tokens: Sequence[int]) -> list[list[int]]:
        """Tells each of `rows` (none twice) the token chosen for it; the tokens forced after it.

        Raises:
            ValueError: a row does not allow its token, or there is no such row.
        """
    def mask(self, rows: Sequence[int]) -> NDArray[np.bool_]:
        """Which tokens may come next: flags (rows, vocabulary). A row without any is stuck or has ended."""
    def status(self, rows: Sequence[int]) -> list[Literal["ended", "stuck", "open"]]:
        """Of each row whether it has ended (its plan is valid), is stuck (nothing may come) or is open."""
    def backtrack(self, row: int) -> tuple[int, list[int]] | None:
        """Takes steps back in a row that is stuck, to the last state from which a step leads to a state never visited.

        The number of steps left and the tokens forced after them, or `None` where nothing is left to try.
        """
    def shortened(self, row: int) -> list[int] | None:
        """The tokens of the shortest plan through states that a row, which has ended, came to.

        `None` where its own plan is that short, or it has not ended.
        """
    def plan(self, row: int) -> list[str]:
        """The operators of a row so far, such as `(pick cup)`."""
    def fork(self, row: int) -> int:
        """A new row that goes on from where `row` is; its number."""
    def remove(self, rows: Sequence[int]) -> None:
        """Forgets rows; their numbers are not given again."""
    def __len__(self) -> int: ...

def attend(
    parts: NDArray[np.float32] | NDArray[np.uint16],
    bounds: NDArray[np.int64],
    *,
    heads: int,
    scale: float,
    borrowed: NDArray[np.int64] | None = None,
    threads: int = 1,
) -> tuple[NDArray[np.float32] | NDArray[np.uint16], NDArray[np.float32]]:
    """Causal self-attention within rows, and the logarithms of the softmaxes' denominators, (tokens, heads).

    `parts` is (tokens, 3 * width): query, key and value of each token, head after head in each; the answer is (tokens,
    width), in the type of `parts`. A row begins at each of `bounds` and ends at the next; tokens outside of all rows
    get zeros. Before its own tokens a row has the first `borrowed` ones, as many as are given for it, of the last row
    before it that borrows none. Numbers are float32, or bfloat16 as unsigned integers of 16 bits. The work is shared
    among `threads`.

    Raises:
        ValueError: shapes or bounds that do not fit each other, or an array that is not contiguous.
    """

def attend_back(
    parts: NDArray[np.float32] | NDArray[np.uint16],
    grads: NDArray[np.float32] | NDArray[np.uint16],
    normalisers: NDArray[np.float32],
    bounds: NDArray[np.int64],
    *,
    heads: int,
    scale: float,
    borrowed: NDArray[np.int64] | None = None,
    threads: int = 1,
) -> NDArray[np.float32] | NDArray[np.uint16]:
    """The gradient of `attend`'s `parts`, in their shape and type.

    `grads` (tokens, width) is that of its first answer, in the type of `parts`; `normalisers` is its second answer.

    Raises:
        ValueError: shapes, types or bounds that do not fit each other, or an array that is not contiguous.
    """
