"""A model's own wrong plans, proven wrong, take the place of their records' negatives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow.parquet as pq
import pytest

pytest.importorskip("torch").set_num_threads(1)

from blocks_data import write as write_blocks  # noqa: E402
from strips_lm.config import ConfigError, RunConfig  # noqa: E402
from strips_lm.dataset import DataSetError, open_split, texts  # noqa: E402
from strips_lm.own_negatives import OwnNegative, with_negatives, write  # noqa: E402
from strips_lm.tokenizer import BpeTokenizer  # noqa: E402

if TYPE_CHECKING:
    from pathlib import Path

    from strips_lm.dataset import PlanDataset


def blocks(folder: Path) -> tuple[Path, BpeTokenizer, PlanDataset]:
    """A data set of 20 training records, its tokenizer and its training split."""
    write_blocks(folder, train=20, validation=4)
    tokenizer = BpeTokenizer.train(list(texts(folder)), 300)
    return folder, tokenizer, open_split(folder, "train", tokenizer, 512)


def rows_of(folder: Path, count: int) -> list[OwnNegative]:
    """The first records' plans broken off after a step, as if a model had drawn them."""
    table = pq.read_table(min((folder / "data").glob("train-*.parquet"))).to_pylist()[:count]
    return [OwnNegative(r["index"], r["prompt"], r["words"], "<|endoftext|>", "goal_not_reached") for r in table]


def test_only_the_files_records_get_other_negatives(tmp_path: Path) -> None:
    folder, tokenizer, data = blocks(tmp_path / "data")
    rows = rows_of(folder, 3)
    write(tmp_path / "own.parquet", rows)
    changed = with_negatives(data, tmp_path / "own.parquet", tokenizer, 512)
    own = {row.index for row in rows}
    _, (said,), _ = tokenizer.encode_records([rows[0].prompt], [rows[0].negative])
    for place, index in enumerate(data.index.tolist()):
        wanted = said if index in own else data.negatives[place]
        assert np.array_equal(changed.negatives[place], wanted)
        assert np.array_equal(changed.positives[place], data.positives[place])
    assert np.array_equal(changed.kept, data.kept)
    assert set(pq.read_table(tmp_path / "own.parquet")["negative_kind"].to_pylist()) == {"model-sample"}


def test_a_share_leaves_others_out(tmp_path: Path) -> None:
    folder, tokenizer, data = blocks(tmp_path / "data")
    rows = rows_of(folder, 3)
    write(tmp_path / "own.parquet", rows)
    own = {row.index for row in rows}
    for share, total in ((1.0, 3), (0.5, 6), (0.3, 10), (0.01, len(data))):
        kept = with_negatives(data, tmp_path / "own.parquet", tokenizer, 512, share=share, seed=1).kept
        assert own <= set(data.index[kept].tolist())
        assert len(kept) == len(set(kept.tolist())) == total


def test_a_share_without_a_file_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"needs `train\.own_negatives`"):
        RunConfig.load("tiny", ["train.own_share=0.5"])


def test_another_prompt_or_no_record_is_refused(tmp_path: Path) -> None:
    folder, tokenizer, data = blocks(tmp_path / "data")
    row = rows_of(folder, 1)[0]
    for index, prompt, complaint in ((row.index, row.prompt + ",", "another prompt"), (10**6, row.prompt, "none of")):
        write(tmp_path / "own.parquet", [OwnNegative(index, prompt, row.words, row.negative, "inapplicable")])
        with pytest.raises(DataSetError, match=complaint):
            with_negatives(data, tmp_path / "own.parquet", tokenizer, 512)
    with pytest.raises(DataSetError, match="no such file"):
        with_negatives(data, tmp_path / "missing.parquet", tokenizer, 512)
