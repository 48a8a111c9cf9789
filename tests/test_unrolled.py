"""Equations compiled to straight code, against NumPy and exact sums."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from ligature.kernels import compiled
from ligature.unrolled import cross_matrix, lower, symmetric, unrolled
from numba.core.errors import TypingError


@unrolled(A=(3, 3), r=(3,), skip=(), out=(3, 3))
def _carry(i, A, r, skip, out):
    out[i] = lower(skip.choose(i, cross_matrix(r[i]) @ symmetric(A[i]) @ cross_matrix(r[i]).T + np.eye(3), 0.0))


@compiled
def _carry_each(A, r, skip, out):
    for i in range(A.shape[0]):
        _carry(i, A, r, skip, out)


@compiled
def _carry_pairs(A, r, skip, out):
    for i in range(A.shape[0] // 2):
        _carry((i, A.shape[0] - 1 - i), A, r, skip, out)


@unrolled(a=(), b=(), c=(), out=(4,))
def _sums(i, a, b, c, out):
    x, y, z = a[i].item(), b[i].item(), c[i].item()
    out[i] = np.array([x * y + z, z - x * y, x * y - z, 1.0 / x])


@compiled
def _sum_up(a, b, c, out):
    _sums(0, a, b, c, out)


def _exact(r):
    x, y, z = r
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


@pytest.mark.parametrize("seed", range(5))
def test_rows_and_pairs_of_rows_follow_the_equation_with_the_same_bits(seed):
    rng = np.random.default_rng(seed)
    A, r, skip = rng.normal(size=(6, 3, 3)), rng.normal(size=(6, 3)), rng.random(6) < 0.4
    each, pairs = np.full((2, 6, 3, 3), 7.0)
    _carry_each(A, r, skip, each)
    _carry_pairs(A, r, skip, pairs)
    assert each.tobytes() == pairs.tobytes()
    for i in range(6):
        whole = np.tril(A[i]) + np.tril(A[i], -1).T
        known = np.zeros((3, 3)) if skip[i] else _exact(r[i]) @ whole @ _exact(r[i]).T + np.eye(3)
        assert np.tril(each[i]) == pytest.approx(np.tril(known), abs=1e-12)
        assert (each[i][np.triu_indices(3, 1)] == 7.0).all(), "the upper half was stored"


numbers = st.floats(-1e3, 1e3).filter(lambda x: abs(x) > 1e-3)


@given(arrays(float, (3, 1), elements=numbers))
def test_a_sum_with_a_product_is_rounded_once(given_numbers):
    a, b, c = given_numbers
    out = np.empty((1, 4))
    _sum_up(a, b, c, out)
    x, y, z = (Fraction(float(n[0])) for n in (a, b, c))
    assert out[0].tolist() == [float(x * y + z), float(z - x * y), float(x * y - z), 1.0 / float(x)]


def test_an_array_with_gaps_is_refused():
    wide = np.zeros((4, 3, 6))
    with pytest.raises(TypingError, match="'A' of _carry must be a contiguous array"):
        _carry_each(wide[:, :, ::2], np.zeros((4, 3)), np.zeros(4, np.bool_), np.zeros((4, 3, 3)))
