"""The files that a data set is made from: a built-in domain's folder, a user's own, or a lone domain with problems.

Knows which files there are and reads them; what they mean is the oracle's concern. Never imports torch.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from glob import glob, has_magic
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strips_lm._native import RecordStream
from strips_lm.config import DataConfig
from strips_lm.config.names import ConfigError, suggestion

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    from strips_lm.config import RunConfig

ALL = "all"
"""The name under which all built-in domains are asked for at once."""

NOT_RECORDS = ("domain", "shares", "problems", "format", "shard_records")
"""Fields of `DataConfig` that say where records come from or go to, not what they are."""


@dataclass(frozen=True, slots=True)
class DomainSources:
    """The texts of a domain's folder, by the names under which a data set keeps them."""

    texts: dict[str, str]
    """`domain.pddl`; where there are such, `lexicon.toml`, `{templates,starts}/*.pddl`, `random.pddl`, `large.pddl`."""
    paths: dict[str, str]
    """Where each was read from, for messages."""

    def stream(self, config: RunConfig, jobs: int = 0) -> RecordStream:
        """Makes the record stream; `jobs` threads, 0 for one a core.

        Raises:
            PddlError: a PDDL file is wrong.
            DataError: the lexicon or the configuration is.
        """
        return RecordStream(
            record_config(config),
            domain=self._file("domain.pddl"),
            lexicon=self._file("lexicon.toml") if "lexicon.toml" in self.texts else None,
            templates=[self._file(name) for name in self.texts if name.startswith("templates/")],
            random=self._file("random.pddl") if "random.pddl" in self.texts else None,
            large=self._file("large.pddl") if "large.pddl" in self.texts else None,
            problems=[self._file(name) for name in self.texts if name.startswith("starts/")],
            jobs=jobs,
        )

    def _file(self, name: str) -> tuple[str, str]:
        return self.paths[name], self.texts[name]


def record_config(config: RunConfig) -> str:
    """What decides the records, as JSON for the oracle."""
    fields = {key: value for key, value in asdict(config.data).items() if key not in NOT_RECORDS}
    return json.dumps({"seed": config.seed, **fields})


def fitting(data: DataConfig) -> DataConfig:
    """Leaves out the held-out templates of the default domain where another domain is asked for."""
    default = DataConfig()
    if data.domain not in (default.domain, ALL) and data.held_out_templates == default.held_out_templates:
        return replace(data, held_out_templates=())
    return data


def built_in_domains() -> list[str]:
    """The names of the domains that come with the package."""
    return sorted(entry.name for entry in _package_folder().iterdir() if (entry / "domain.pddl").is_file())


def read_sources(domain: str, problems: tuple[str, ...] = ()) -> DomainSources:
    """Reads a built-in domain by name, a folder, or a PDDL file; `problems` are paths or patterns of further problems.

    Raises:
        ConfigError: there is no such domain, or a pattern fits no file.
        OSError: a file cannot be read.
    """
    found = _find(domain)
    for number, path in enumerate(_expanded(problems)):
        found[f"starts/{number:05d}.pddl"] = path
    texts = {name: entry.read_text(encoding="utf-8") for name, entry in found.items()}
    return DomainSources(texts, {name: str(entry) for name, entry in found.items()})


def _expanded(patterns: tuple[str, ...]) -> list[Path]:
    """The files that the patterns fit, in the order of their names; each once."""
    found: set[str] = set()
    for pattern in patterns:
        fitting = glob(pattern, recursive=True) if has_magic(pattern) and not Path(pattern).exists() else [pattern]  # noqa: PTH207
        if not fitting:
            raise ConfigError(f"no file fits `{pattern}`")
        found.update(fitting)
    return [Path(path) for path in sorted(found)]


def read_kept(folder: Path) -> DomainSources:
    """Reads the sources that a data set keeps."""
    found = _folder_files(folder)
    found |= {f"starts/{path.name}": path for path in sorted((folder / "starts").glob("*.pddl"))}
    texts = {name: entry.read_text(encoding="utf-8") for name, entry in found.items()}
    return DomainSources(texts, {name: str(entry) for name, entry in found.items()})


def _find(domain: str) -> dict[str, Any]:
    path = Path(domain)
    if path.is_file():
        return {"domain.pddl": path}
    if path.is_dir():
        if not (path / "domain.pddl").is_file():
            raise ConfigError(f"{domain}: there is no domain.pddl in this folder")
        return _folder_files(path)
    if domain not in built_in_domains():
        others = f"\nhint: a PDDL file, a folder, or one of {', '.join(built_in_domains())}"
        raise ConfigError(f"no domain `{domain}`{suggestion(domain, built_in_domains()) or others}")
    return _folder_files(_package_folder() / domain)


def _folder_files(folder: Traversable) -> dict[str, Any]:
    templates = folder / "templates"
    entries = sorted(templates.iterdir(), key=lambda entry: entry.name) if templates.is_dir() else []
    found = {name: folder / name for name in ("domain.pddl", "lexicon.toml", "random.pddl", "large.pddl")}
    found = {name: entry for name, entry in found.items() if entry.is_file()}
    return found | {f"templates/{entry.name}": entry for entry in entries if entry.name.endswith(".pddl")}


def _package_folder() -> Traversable:
    return files("strips_lm") / "domains"
