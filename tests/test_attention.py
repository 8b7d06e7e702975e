"""Attention of the training pass: the binding's against PyTorch's, forward and backward."""

import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from strips_lm import _native
from strips_lm.attention import Rows, attend, kernel

CPU = torch.device("cpu")


def attention(heads, size):
    return SimpleNamespace(num_heads=heads, scaling=1 / math.sqrt(size), training=False)


def row_by_row(parts, lengths, heads):
    """PyTorch's attention in double precision, a row at a time; zeros behind the last row."""
    ends = np.cumsum([0, *lengths])
    mixed = []
    for start, end in pairwise(ends):
        query, key, value = parts[start:end].view(end - start, 3, heads, -1).permute(1, 2, 0, 3)
        mixed.append(F.scaled_dot_product_attention(query, key, value, is_causal=True).transpose(0, 1).flatten(1))
    return torch.cat([*mixed, parts.new_zeros(len(parts) - ends[-1], parts.shape[1] // 3)])


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-5), (torch.bfloat16, 2e-2)])
@pytest.mark.parametrize(("heads", "size"), [(4, 32), (2, 64), (3, 5), (1, 40)])
@pytest.mark.parametrize("threads", [1, 2])
def test_attention_and_its_gradient_are_pytorchs(dtype, tolerance, heads, size, threads):
    torch.manual_seed(0)
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        lengths = [1, 33, 120, 7, 64]
        parts = torch.randn(sum(lengths) + 3, 3 * heads * size).to(dtype).requires_grad_()
        grads = torch.randn(len(parts), heads * size).to(dtype)
        blocks = [(1, length) for length in lengths]
        config = SimpleNamespace(attn_pdrop=0.1)
        rows = Rows.of(SimpleNamespace(config=config, training=False), parts, blocks)
        assert rows.kernel == "native"
        mixed = attend(attention(heads, size), parts, rows)
        assert mixed.dtype == dtype
        mixed.backward(grads)
        exact = parts.detach().double().requires_grad_()
        wanted = row_by_row(exact, lengths, heads)
        wanted.backward(grads.double())
        torch.testing.assert_close(mixed.double(), wanted, rtol=tolerance, atol=tolerance)
        torch.testing.assert_close(parts.grad.double(), exact.grad, rtol=tolerance, atol=tolerance)
    finally:
        torch.set_num_threads(before)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_what_is_borrowed_is_attended_to_as_if_it_were_the_rows_own(dtype):
    """By the binding and by PyTorch: against rows that bring all of their tokens, whose gradients add up."""
    torch.manual_seed(0)
    parts = torch.randn(60, 3 * 24, dtype=dtype).requires_grad_()
    own, borrowed, lenders = [20, 5, 1, 14, 20], [0, 13, 20, 0, 14], [0, 0, 0, 26, 26]
    transformer = SimpleNamespace(config=SimpleNamespace(attn_pdrop=0.0), training=False)
    rows = Rows.of(transformer, parts, [(1, length) for length in own], borrowed)
    assert rows.kernel == ("native" if dtype == torch.float32 else "blocks")
    mixed = attend(attention(3, 8), parts, rows)
    grads = torch.randn_like(mixed)
    mixed.backward(grads)
    exact = parts.detach().double().requires_grad_()
    starts = np.cumsum([0, *own])
    for start, length, lent, lender in zip(starts, own, borrowed, lenders, strict=False):
        row = torch.cat((exact[lender : lender + lent], exact[start : start + length]))
        wanted = row_by_row(row, [len(row)], 3)[lent:]
        torch.testing.assert_close(mixed[start : start + length].double(), wanted, rtol=1e-5, atol=1e-5)
        wanted.backward(grads[start : start + length].double())
    torch.testing.assert_close(parts.grad.double(), exact.grad, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("borrowed", [[1, 0], [0, 3], [0], [0, 1, 1], [0, -1]])
def test_rows_do_not_borrow_what_no_row_has(borrowed):
    parts, bounds = np.zeros((4, 12), np.float32), np.array([0, 2, 4])
    with pytest.raises(ValueError, match="`borrowed` has a count for each row"):
        _native.attend(parts, bounds, heads=2, scale=1.0, borrowed=np.array(borrowed))


def test_a_rows_numbers_do_not_depend_on_the_rows_beside_it():
    parts = torch.randn(90, 3 * 32).numpy()
    beside, _ = _native.attend(parts, np.array([0, 20, 90]), heads=2, scale=0.25)
    alone, _ = _native.attend(parts[20:], np.array([0, 70]), heads=2, scale=0.25)
    assert np.array_equal(beside[20:], alone)


def test_what_the_binding_does_not_have_goes_to_pytorch():
    assert kernel(CPU, torch.float64, 0.0) == "blocks"
    assert kernel(CPU, torch.float32, 0.1) == "blocks"
    assert kernel(CPU, torch.bfloat16, 0.0) == "native"


@pytest.mark.parametrize(
    ("shape", "bounds", "heads", "said"),
    [
        ((4, 12), [0, 5], 2, "`bounds` ascend"),
        ((4, 12), [0, 3, 2], 2, "`bounds` ascend"),
        ((4, 12), [-1, 3], 2, "`bounds` ascend"),
        ((4, 12), [], 2, "`bounds` ascend"),
        ((4, 12), [0, 4], 3, "whole heads"),
        ((4, 12), [0, 4], 0, "whole heads"),
        ((4, 0), [0, 4], 1, "whole heads"),
    ],
)
def test_what_does_not_fit_is_refused(shape, bounds, heads, said):
    with pytest.raises(ValueError, match=said):
        _native.attend(np.zeros(shape, np.float32), np.array(bounds, np.int64), heads=heads, scale=1.0)


def test_gradients_that_do_not_fit_are_refused():
    parts, bounds = np.zeros((4, 12), np.float32), np.array([0, 4])
    mixed, normalisers = _native.attend(parts, bounds, heads=2, scale=1.0)
    with pytest.raises(ValueError, match="one type"):
        _native.attend_back(parts, mixed.astype(np.uint16), normalisers, bounds, heads=2, scale=1.0)
    with pytest.raises(ValueError, match="shapes"):
        _native.attend_back(parts, mixed[:3], normalisers, bounds, heads=2, scale=1.0)
    with pytest.raises(ValueError, match="not contiguous"):
        _native.attend(np.zeros((4, 24), np.float32)[:, ::2], bounds, heads=2, scale=1.0)
