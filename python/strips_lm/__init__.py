"""A complete STRIPS oracle, and language-model planners checked by it.

The oracle is here and needs numpy alone. Learning lives in the modules `tokenizer`, `dataset`, `model`, `train`,
`generate` and `evaluate`, which import torch; this one never does.
"""

from strips_lm._native import (
    DataError,
    Domain,
    LimitError,
    PddlError,
    Plans,
    PlanSet,
    Problem,
    Task,
    Verdict,
    __version__,
)

__all__ = [
    "DataError",
    "Domain",
    "LimitError",
    "PddlError",
    "PlanSet",
    "Plans",
    "Problem",
    "Task",
    "Verdict",
    "__version__",
]
