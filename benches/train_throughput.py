"""Tokens per second of training: our loop's step against the plain path, in one run, on one data set.

The plain path is what a user would write first: transformers' `Trainer` on `GPT2DoubleHeadsModel`, pairs of rows padded
to the longest of the batch, float32, AdamW. Both count tokens without padding, prompts and both completions; ours has
what a pair's rows have in common go through the model once where training would, and is measured without that, too.

On a machine that others use too, compare the tokens per CPU-second of one thread (`OMP_NUM_THREADS=1`).

    python benches/train_throughput.py [--preset tiny] [--seconds 20] [--data DIR] [--plain-batch 16]

Without `--data`, token arrays are drawn with the lengths of the manipulation domain's canonical records. On a machine
with a GPU both run on it, and the share of `--peak` teraflops that our model's flops reach is printed: 6 flops for each
weight and token that meet in a matrix product (the last layer's and the head's only where a loss reads), and
6 * width * length^2 a row and layer for causal attention. Padding, the optimiser and embeddings count nothing, and what
rows share counts once.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from transformers import Trainer, TrainingArguments

from strips_lm.batches import Dress, Plan, build_step, walk
from strips_lm.config import RunConfig
from strips_lm.dataset import PlanDataset, Ragged, open_split, texts
from strips_lm.forward import best_layout
from strips_lm.loss import weighted
from strips_lm.model import make_model
from strips_lm.muon import make_optimizer
from strips_lm.objective import Objective
from strips_lm.tokenizer import make
from strips_lm.tuning import default

VOCABULARY = 96


@dataclass
class Vocabulary:
    """The part of a tokenizer that a model is made for."""

    vocab_size: int = VOCABULARY
    start_id: int = 1
    end_id: int = 0


def drawn_data(records: int = 4096) -> PlanDataset:
    """Random tokens with the lengths of real records: prompts of about 55, completions of about 55."""
    rng = np.random.default_rng(0)

    def ragged() -> Ragged:
        lengths = np.clip(rng.normal(55, 20, records), 8, 200).astype(np.int64)
        tokens = rng.integers(2, VOCABULARY, int(lengths.sum())).astype(np.uint16)
        return Ragged(tokens, np.concatenate(([0], np.cumsum(lengths))))

    every = np.arange(records)
    return PlanDataset(ragged(), ragged(), ragged(), every, np.zeros(records), every, 0, (0, 0))


def ours(
    config: RunConfig, data: PlanDataset, vocabulary, seconds: float, negatives: float, *, borrow: bool = True
) -> dict[str, float]:
    """Tokens a second of the loop's own step, batches built as it goes, with the negatives of a share of the records.

    With `borrow` negatives borrow where they would in training.
    """
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    train = config.train
    model = make_model(config.model, vocabulary, 0).to(device)
    choice = default(train, model, device)
    objective = Objective(model, choice.dtype, compiled=choice.compiled).train()
    optimizer = make_optimizer(model, train)
    layout = best_layout(device, choice.dtype, config.model.dropout)
    layout = layout._replace(borrow=layout.borrow and borrow)
    plan = Plan(train.step_tokens, train.step_pairs, train.batch_tokens, *layout)
    dress = Dress(negatives, offset=train.position_offset)
    seen = steps = flops = 0
    start, work = time.monotonic(), time.process_time()
    for number, records in walk(data, plan, 0):
        step = build_step(data, records, plan, dress, (0, number))
        for batch in step.batches:
            losses = objective(batch.to(device))
            weighted(losses, step.tokens, step.pairs, 1.0, 2.0).backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()
        optimizer.zero_grad()
        if number == WARM:  # the first steps warm the allocator and the kernels
            losses.lm.item()
            seen, steps, flops, start, work = 0, 0, 0, time.monotonic(), time.process_time()
        else:
            seen, steps, flops = seen + step.seen, steps + 1, flops + _flops(config.model, step, model.lm_head)
        if number > WARM and (number % 4 == 0 or device.type == "cpu") and _passed(losses, start) > seconds:
            break
    took, worked = _passed(losses, start), time.process_time() - work
    return {
        "tokens_per_second": seen / took,
        "tokens_per_cpu_second": seen / worked,
        "steps_per_second": steps / took,
        "tokens_per_step": seen / steps,
        "teraflops": flops / took / 1e12,
        "parameters": model.num_parameters(),
        "borrows": layout.borrow,
    }


WARM = 6
"""The step after which the clock starts."""


def _passed(losses, start: float) -> float:
    """Seconds since the start, all work given to a GPU being done."""
    losses.lm.item()
    return time.monotonic() - start


def _flops(model, step, head) -> int:
    """Flops of the matrix products of a step's forward and backward passes, without padding."""
    width, inner = model.width, model.inner or 4 * model.width
    read = sum(len(batch.lm_positions) + batch.mc_token_ids.numel() for batch in step.batches)
    squares = sum(_area(batch) for batch in step.batches)
    tokens = step.seen - sum(sum(batch.borrowed) for batch in step.batches)
    before, after = 3 * width * width, width * width + 2 * width * inner
    linear = tokens * (model.layers * before + (model.layers - 1) * after) + read * (after + head.weight.numel())
    return 6 * linear + 6 * model.layers * width * squares


def _area(batch) -> int:
    """Twice the pairs of a query and a key that causal attention has, a triangle's half of it left out."""
    lengths = [length for rows, length in batch.blocks for _ in range(rows)]
    borrowed = batch.borrowed or [0] * len(lengths)
    return sum(length * (length + 2 * before) for length, before in zip(lengths, borrowed, strict=True))


class PlainTrainer(Trainer):
    """Adds the multiple-choice loss, which `GPT2DoubleHeadsModel` returns apart."""

    def compute_loss(self, model, inputs, return_outputs=False, num_items_in_batch=None):
        del num_items_in_batch
        out = model(**inputs)
        loss = out.loss + 2.0 * out.mc_loss
        return (loss, out) if return_outputs else loss


def plain_collate(rows):
    """(batch, 2, length) rows padded on the right; labels on the positive's completion."""
    length = max(len(ids) for pair in rows for _, ids in pair)
    ids = torch.zeros(len(rows), 2, length, dtype=torch.long)
    labels = torch.full_like(ids, -100)
    last = torch.zeros(len(rows), 2, dtype=torch.long)
    for index, pair in enumerate(rows):
        for choice, (prompt, tokens) in enumerate(pair):
            ids[index, choice, : len(tokens)] = torch.from_numpy(tokens)
            last[index, choice] = len(tokens) - 1
            if choice == 0:
                labels[index, choice, prompt : len(tokens)] = ids[index, choice, prompt : len(tokens)]
    choice_labels = torch.zeros(len(rows), dtype=torch.long)
    return {"input_ids": ids, "labels": labels, "mc_token_ids": last, "mc_labels": choice_labels}


def plain(config: RunConfig, data: PlanDataset, vocabulary, seconds: float, batch: int) -> dict[str, float]:
    """Tokens a second of transformers' Trainer."""
    rows = []
    for record in np.random.default_rng(1).permutation(data.kept):
        prompt = data.prompts[record].astype(np.int64)
        both = (data.positives[record], data.negatives[record])
        rows.append([(len(prompt), np.concatenate((prompt, part.astype(np.int64)))) for part in both])
    model = make_model(config.model, vocabulary, 0)
    with tempfile.TemporaryDirectory() as folder:
        steps = max(3, int(seconds / _seconds_a_step(model, rows[:batch])))
        arguments = TrainingArguments(
            folder,
            per_device_train_batch_size=batch,
            max_steps=steps,
            report_to=[],
            logging_steps=10**6,
            save_strategy="no",
            remove_unused_columns=False,
            disable_tqdm=True,
        )
        trainer = PlainTrainer(model, arguments, train_dataset=rows, data_collator=plain_collate)
        start, work = time.monotonic(), time.process_time()
        trainer.train()
        took, worked = time.monotonic() - start, time.process_time() - work
    tokens = np.mean([sum(len(ids) for _, ids in pair) for pair in rows])
    seen = float(tokens * batch * steps)
    return {"tokens_per_second": seen / took, "tokens_per_cpu_second": seen / worked}


def _seconds_a_step(model, rows) -> float:
    model.train()
    start = time.monotonic()
    for _ in range(2):
        start = time.monotonic()
        out = model(**plain_collate(rows))
        (out.loss + out.mc_loss).backward()
    model.zero_grad()
    return time.monotonic() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--preset", default="tiny")
    parser.add_argument("--set", dest="overrides", action="append", default=[])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--plain-batch", type=int, default=16)
    parser.add_argument("--data", type=Path)
    parser.add_argument(
        "--peak", type=float, default=989.0, help="teraflops of the GPU (an H100's or H200's in bfloat16)"
    )
    args = parser.parse_args()
    config = RunConfig.load(args.preset, args.overrides)
    vocabulary, data = Vocabulary(), drawn_data()
    if args.data:
        vocabulary = make(config.tokenizer, args.data, texts(args.data))
        data = open_split(args.data, "train", vocabulary, config.model.context, config.train.position_offset)
    found = {
        "preset": args.preset,
        "threads": torch.get_num_threads(),
        "device": torch.cuda.get_device_name() if torch.cuda.is_available() else "cpu",
        "mean_length": float(data.lengths[data.kept].mean()),
        "ours_all_negatives": ours(config, data, vocabulary, args.seconds, 1.0),
        "ours_positives_only": ours(config, data, vocabulary, args.seconds, 0.0),
    }
    if found["ours_all_negatives"]["borrows"]:
        found["ours_nothing_shared"] = ours(config, data, vocabulary, args.seconds, 1.0, borrow=False)
    if torch.cuda.is_available():
        for part in ("ours_all_negatives", "ours_positives_only"):
            found[part]["flops_share"] = found[part]["teraflops"] / args.peak
        found["peak_gib"] = torch.cuda.max_memory_allocated() / 2**30
    found["plain"] = plain(config, data, vocabulary, args.seconds, args.plain_batch)
    for unit in ("tokens_per_second", "tokens_per_cpu_second"):
        found[f"ratio_{unit}"] = found["ours_all_negatives"][unit] / found["plain"][unit]
        if "ours_nothing_shared" in found:
            found[f"sharing_{unit}"] = found["ours_all_negatives"][unit] / found["ours_nothing_shared"][unit]
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
