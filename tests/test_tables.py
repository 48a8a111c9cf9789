"""Groups of arrays reach compiled code by address."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from ligature.kernels import kernel
from ligature.tables import opener, table_of


class Group(NamedTuple):
    weight: np.ndarray
    flag: np.ndarray
    block: np.ndarray


def group(n: int) -> Group:
    return Group(np.arange(n, dtype=float), np.zeros(n, np.bool_), np.zeros((n, 2, 3), np.int64))


open_group = opener(group(1))


@kernel
def fill(table):
    opened = open_group(table)
    for i in range(opened.block.shape[0]):
        opened.flag[i] = i % 2 == 1
        for a in range(opened.block.shape[1]):
            for b in range(opened.block.shape[2]):
                opened.block[i, a, b] = 100 * i + 10 * a + b
        opened.weight[i] += 0.5


def test_compiled_code_reads_and_writes_the_arrays_of_a_table():
    arrays = group(4)
    fill(table_of(arrays))
    assert arrays.flag.tolist() == [False, True, False, True]
    assert arrays.weight.tolist() == [0.5, 1.5, 2.5, 3.5]
    i, a, b = np.indices((4, 2, 3))
    assert (arrays.block == 100 * i + 10 * a + b).all()


def test_an_array_with_gaps_is_refused_by_name():
    with pytest.raises(ValueError, match="'weight' is not contiguous"):
        table_of(group(4)._replace(weight=np.zeros(8)[::2]))
