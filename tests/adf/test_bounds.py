"""Every number that cannot be simulated beyond a bound has one."""

from __future__ import annotations

import math
from itertools import chain

import pytest
from ligature.adf.schema import blocks, bodies
from ligature.adf.schema.keys import Key, Status

SIMULATED = [
    key
    for value in chain(vars(blocks).values(), vars(bodies).values())
    if isinstance(value, tuple)
    for key in value
    if isinstance(key, Key) and key.status in (Status.USED, Status.OURS)
]


@pytest.mark.parametrize("key", [key for key in SIMULATED if key.unit.split(",")[0] == "m"], ids=lambda key: key.path)
def test_a_length_is_bounded(key: Key) -> None:
    assert key.most is not None and math.isfinite(key.most)


@pytest.mark.parametrize(
    "key",
    [key for key in SIMULATED if key.unit.startswith(("N/m", "N·s/m", "kg"))],
    ids=lambda key: key.path,
)
def test_what_gains_energy_below_zero_is_bounded(key: Key) -> None:
    assert key.least is not None and key.least >= 0.0
