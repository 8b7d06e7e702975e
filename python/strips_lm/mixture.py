"""A mixture: a data set for each of several domains, side by side in one folder, to train one model on all of them.

    DIR/<domain>/…      a data set like any other: it can be verified, shown, trained on and evaluated by itself
    DIR/README.md       a card with which `datasets.load_dataset(DIR)` reads the records of all domains
    DIR/run.toml        the configuration of the whole
    DIR/manifest.json   the hash of each data set's own manifest; written last

Whoever reads a mixture needs only the folders, so one may be put together by hand (`folders.data_sets`).
Never imports torch.
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from strips_lm.card import mixture_card
from strips_lm.config.names import ConfigError, suggestion
from strips_lm.shards import here, read_digest, refuse_other, write_data_set, write_once
from strips_lm.sources import built_in_domains, fitting, read_sources
from strips_lm.storage import open_store

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from strips_lm.config import RunConfig
    from strips_lm.shards import MakeShards, Tick, Warn
    from strips_lm.storage import Digest, Store


def write_mixture(
    out: str | Path,
    config: RunConfig,
    *,
    jobs: int = 0,
    make_shards: MakeShards = here,
    tick: Tick = lambda *_: None,
    warn: Warn = lambda _: None,
) -> bool:
    """Writes a data set of each domain, or goes on where an earlier run stopped; whether anything was left to write.

    Raises:
        ConfigError: as `write_data_set`; or the configuration is not one of a mixture.
    """
    parts, store = configurations(config), open_store(out)
    refuse_other(store, config, {})
    if store.read("manifest.json") is not None:
        return False
    write_once(store, "run.toml", config.text().encode())
    for name, part in parts.items():
        sources, place = read_sources(name), f"{out}/{name}"
        if write_data_set(place, part, sources, jobs=jobs, make_shards=make_shards, tick=tick, warn=warn):
            warn(f"{place}: written")
    splits = {name: _manifest(store, name)["splits"] for name in parts}
    write_once(store, "README.md", mixture_card(config, splits).encode())
    manifest = {"content_hash": config.content_hash(), "files": files(store, parts)}
    store.write("manifest.json", (json.dumps(manifest, indent=1) + "\n").encode())
    return True


def configurations(config: RunConfig) -> dict[str, RunConfig]:
    """The configuration of each domain's data set: its share of the pairs.

    Raises:
        ConfigError: problems are given, which are of one domain; or a share is of no domain, or all are 0.
    """
    data, domains = config.data, built_in_domains()
    if data.problems:
        raise ConfigError("`data.problems` are of one domain: say which instead of `all`")
    for name in data.shares:
        if name not in domains:
            raise ConfigError(f"`data.shares`: no domain `{name}`{suggestion(name, domains)}")
    weights = {name: data.shares.get(name, 1.0) for name in domains if data.shares.get(name, 1.0) > 0.0}
    if not weights:
        raise ConfigError("`data.shares` leave no domain")
    pairs = {name: max(1, round(data.pairs * weight / sum(weights.values()))) for name, weight in weights.items()}
    parts = {name: fitting(replace(data, domain=name, shares={}, pairs=count)) for name, count in pairs.items()}
    return {name: replace(config, data=part) for name, part in parts.items()}


def files(store: Store, domains: Iterable[str]) -> dict[str, Digest]:
    """Size and SHA-256 of what a mixture has beside the files that its data sets' manifests list."""
    names = ["README.md", "run.toml", *(f"{domain}/manifest.json" for domain in domains)]
    found = {name: read_digest(store, name) for name in names}
    return {name: digest for name, digest in found.items() if digest is not None}


def _manifest(store: Store, domain: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(store.read(f"{domain}/manifest.json") or b"{}")
    return found
