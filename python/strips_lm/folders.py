"""Where data sets lie: a folder is one data set, or a mixture that holds one for each of several domains.

Knows names of files alone, so that everything that opens data may ask. Never imports torch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from strips_lm.config.names import ConfigError

if TYPE_CHECKING:
    from pathlib import Path

TOKENS = "tokens"
"""The folder in a data set where training keeps token arrays; no part of the data set."""


def data_sets(folder: Path) -> list[Path]:
    """The data set in `folder`, or those in its folders, in the order of their names.

    A folder without any is given back itself, for whoever opens it to complain.
    """
    if (folder / "data").is_dir() or not folder.is_dir():
        return [folder]
    return sorted(path for path in folder.iterdir() if (path / "data").is_dir()) or [folder]


def is_mixture(folder: Path) -> bool:
    """Whether the data sets are in folders of their own."""
    return data_sets(folder) != [folder]


def one_data_set(folder: Path) -> Path:
    """The folder itself, where it is one data set.

    Raises:
        ConfigError: it is a mixture.
    """
    if is_mixture(folder):
        names = ", ".join(part.name for part in data_sets(folder))
        raise ConfigError(f"{folder}: data sets of several domains\nhint: give the folder of one: {names}")
    return folder
