"""From exceptions to exit codes: one map, one message and at most one hint each, no traceback.

An exception that is not in the map is a fault of ours and keeps its traceback.
"""

from __future__ import annotations

import sys
import traceback

from strips_lm import _native

LEARNING = ("torch", "transformers", "accelerate", "tokenizers", "safetensors", "rich", "matplotlib")
"""What only the learning commands need."""


def report(error: BaseException) -> int:
    """Writes what went wrong to stderr and returns the exit code."""
    code, message = _describe(error)
    sys.stderr.write(f"{message}\n")
    return code


def _describe(error: BaseException) -> tuple[int, str]:
    match error:
        case KeyboardInterrupt():
            return 130, "interrupted"
        case _native.LimitError() | MemoryError():
            return 3, f"error: {str(error) or 'out of memory'}\nhint: raise the limit, or ask for fewer steps"
        case ValueError() if type(error).__module__.startswith("strips_lm."):
            return 2, f"error: {error}"  # ours, and some are of modules that import torch, so none is named here
        case ModuleNotFoundError(name=str(name)) if name.partition(".")[0] in LEARNING:
            return 2, f"error: this command needs {name}\nhint: pip install {' '.join(LEARNING)}"
        case OSError(filename=str(name), strerror=str(reason)):
            return 2, f"error: {name}: {reason.lower()}"
        case _:
            text = "".join(traceback.format_exception(error))
            return 70, f"{text}error: this is a fault of strips-lm, not of its input"
