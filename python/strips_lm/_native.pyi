"""The oracle, in Rust."""

__version__: str

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
