"""A run is one `RunConfig`: a preset, overrides on top, checked before any work starts, saved beside what it made.

>>> config = RunConfig.load(None, ["data.pairs=100", "seed=3"])
>>> config.data.pairs, config.seed
(100, 3)
"""

from __future__ import annotations

import hashlib
import json
import platform
import tomllib
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strips_lm._native import __version__
from strips_lm.config.fields import build, coerce, field_types, parse_value, to_toml
from strips_lm.config.names import ConfigError, suggestion
from strips_lm.config.sections import (
    DataConfig,
    EvaluateConfig,
    GenerateConfig,
    ModelConfig,
    TokenizerConfig,
    TrainConfig,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "ConfigError",
    "DataConfig",
    "EvaluateConfig",
    "GenerateConfig",
    "ModelConfig",
    "RunConfig",
    "TokenizerConfig",
    "TrainConfig",
    "presets",
    "versions",
]

RECORDED = ("numpy", "pyarrow", "torch", "transformers", "accelerate", "tokenizers")
"""The packages whose versions `run.toml` states beside our own."""

ABOUT = ("content_hash", "versions")
"""What `run.toml` says besides the configuration; not read back."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RunConfig:
    """Everything that decides what a run makes."""

    seed: int = 0
    """The seed from which every random choice of the run is drawn."""
    data: DataConfig = field(default_factory=DataConfig)
    """The data set."""
    tokenizer: TokenizerConfig = field(default_factory=TokenizerConfig)
    """Text to tokens."""
    model: ModelConfig = field(default_factory=ModelConfig)
    """The network."""
    train: TrainConfig = field(default_factory=TrainConfig)
    """The training loop."""
    generate: GenerateConfig = field(default_factory=GenerateConfig)
    """Decoding."""
    evaluate: EvaluateConfig = field(default_factory=EvaluateConfig)
    """Scoring."""

    @classmethod
    def load(cls, preset: str | Path | None = None, overrides: Iterable[str] = ()) -> RunConfig:
        """Reads a preset (a shipped one's name, or a TOML file, `run.toml` included) and puts `key=value` on top.

        Raises:
            ConfigError: no such preset, or a key or value that is not accepted.
            OSError: the file cannot be read.
        """
        table = {} if preset is None else _read(preset)
        if str(preset).endswith(".toml"):
            cls._of_file(table, str(preset))  # so that its own mistakes are not taken for those of overrides
        for override in overrides:
            _set(table, override)
        return cls.from_dict(table)

    @classmethod
    def parse(cls, text: str, name: str) -> RunConfig:
        """Reads the text of a TOML file such as `run.toml`; `name` is for messages.

        Raises:
            ConfigError: it is not TOML, or a key or value is not accepted.
        """
        return cls._of_file(_parse(text, name), name)

    @classmethod
    def _of_file(cls, table: dict[str, Any], name: str) -> RunConfig:
        try:
            return cls.from_dict(table)
        except ConfigError as error:
            raise ConfigError(f"{name}: {error}") from None

    @classmethod
    def from_dict(cls, table: dict[str, Any]) -> RunConfig:
        """Makes the configuration of nested tables, such as `tomllib` reads."""
        hints = field_types(cls)
        values = {key: _without_gone(key, value) for key, value in table.items() if key not in ABOUT}
        for key in values:
            if key not in hints:
                raise ConfigError(f"no section `{key}`{suggestion(key, hints)}")
        return cls(**{key: _part(hints[key], key, value) for key, value in values.items()})

    def to_dict(self) -> dict[str, Any]:
        """The configuration as nested tables."""
        return asdict(self)

    def content_hash(self) -> str:
        """The SHA-256 of the configuration, the same on every machine and for every version of the libraries."""
        canonical = json.dumps(self.to_dict(), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()

    def text(self) -> str:
        """What `run.toml` says: the configuration, its hash, and the versions that it ran with."""
        about = {"content_hash": self.content_hash(), "versions": versions()}
        return to_toml(about | self.to_dict())

    def save(self, path: str | Path) -> None:
        """Writes `run.toml`."""
        Path(path).write_text(self.text(), encoding="utf-8")


GONE = {"train": {"own_negatives": "", "own_share": 0.0}}
"""Fields that earlier versions wrote into `run.toml`, by section, with the value at which they did nothing."""


def _without_gone(section: str, values: Any) -> Any:
    """A section as it is known now: files of earlier versions are read unless they ask for what is gone."""
    gone = GONE.get(section, {})
    if not isinstance(values, dict) or not gone:
        return values
    return {key: value for key, value in values.items() if key not in gone or value != gone[key]}


def presets() -> list[str]:
    """The names of the shipped presets."""
    return sorted(path.name.removesuffix(".toml") for path in _preset_folder().iterdir() if path.name.endswith(".toml"))


def _preset_folder() -> Any:
    return files("strips_lm") / "presets"


def _read(preset: str | Path) -> dict[str, Any]:
    path = Path(preset) if str(preset).endswith(".toml") else _preset_folder() / f"{preset}.toml"
    if not path.is_file() and not str(preset).endswith(".toml"):
        raise ConfigError(f"no preset `{preset}`{suggestion(str(preset), presets())}")
    return _parse(path.read_text(encoding="utf-8"), str(path))


def _parse(text: str, name: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{name}: {error}") from None


def _set(table: dict[str, Any], override: str) -> None:
    key, equals, value = override.partition("=")
    if not equals:
        raise ConfigError(f"`--set {override}` is not of the form key=value")
    *sections, name = key.strip().split(".")
    for section in sections:
        table = table.setdefault(section, {})
        if not isinstance(table, dict):
            raise ConfigError(f"`{section}` in `--set {override}` is no section")
    table[name] = parse_value(value.strip())


def _part(wanted: Any, key: str, value: Any) -> Any:
    if not hasattr(wanted, "__dataclass_fields__"):
        return coerce(wanted, value, key)
    if not isinstance(value, dict):
        raise ConfigError(
            f"`{key}` is a section: set one of its fields, such as `{key}.{next(iter(field_types(wanted)))}`"
        )
    return build(wanted, value, key)


def versions() -> dict[str, str]:
    """The versions of Python, this package and the libraries that it ran with."""
    found = {"python": platform.python_version(), "strips-lm": __version__}
    for package in RECORDED:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
