"""Every number that cannot be simulated beyond a bound has one."""

from __future__ import annotations

import math
from itertools import chain
from pathlib import Path

import pytest
from ligature.adf.nodes import parse
from ligature.adf.schema import blocks, bodies
from ligature.adf.schema.keys import Key, Status, Type
from ligature.adf.values import BadValue, convert

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


def test_a_bound_that_is_too_small_itself_is_reported_as_that() -> None:
    key = Key("mass", Type.NUMBER, least=0.0, above=True)
    for text in ("0", "-1", "-1.0e-300"):
        with pytest.raises(BadValue) as caught:
            convert(key, parse(f"mass: {text}", Path("m.yaml")).entries["mass"][1])
        assert caught.value.expected.startswith("above 0, not ") and caught.value.unusable
    assert convert(key, parse("mass: 1.0e-300", Path("m.yaml")).entries["mass"][1]) == 1e-300
