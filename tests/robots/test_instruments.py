"""The table of instruments, and the words by which one is found."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.robots.instruments import ALIASES, INSTRUMENTS, SNAKES, instrument


@pytest.mark.parametrize("number", INSTRUMENTS)
def test_an_instrument_is_found_by_its_number_and_by_its_type(number):
    found = instrument(number)
    assert found.id == number
    assert instrument(str(number)) is instrument(found.type) is instrument(f"{found.type}[1]") is found
    assert (found.generation == "S") == (number >= 420000)
    assert (found.lower == -found.upper).all()
    assert found.jaw[0] <= 0.0 < found.jaw[1]


def test_the_type_is_name_and_number():
    assert instrument(420006).type == "LARGE_NEEDLE_DRIVER:420006"


def test_a_name_alone_means_the_classic_generation():
    assert instrument("LARGE_NEEDLE_DRIVER").id == 400006
    assert instrument("MEDIUM-LARGE_CLIP_APPLIER").id == 420327


@pytest.mark.parametrize("alias", ALIASES)
def test_other_names_are_known(alias):
    assert instrument(alias).name == ALIASES[alias]


def test_a_geared_variant_has_the_kinematics_of_the_plain_one():
    assert instrument("LARGE_NEEDLE_DRIVER_GEARED:420006") is instrument(420006)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("SPOON", "no instrument is called 'SPOON'"),
        ("SPOON:400006", "instrument 400006 is called LARGE_NEEDLE_DRIVER, not SPOON"),
        ("LARGE_NEEDLE_DRIVER:7", "unknown instrument 7; known are for example 400006 and 420006"),
        ("400006:LARGE_NEEDLE_DRIVER", "not a tool type; write NAME:NUMBER, for example LARGE_NEEDLE_DRIVER:400006"),
        ("", "'' is not a tool type"),
        *((number, "has a snake wrist, which is not modelled") for number in SNAKES),
    ],
)
def test_words_that_mean_no_instrument_are_answered(words, message):
    with pytest.raises(ValueError, match=message):
        instrument(words)


BOTH = {number: number - 20000 for number in INSTRUMENTS if number - 20000 in INSTRUMENTS}
"""Instruments of the S generation that were made for the Classic one too."""


def test_all_but_one_instrument_of_the_later_generation_came_from_the_former():
    assert {number for number in INSTRUMENTS if number >= 420000} == {*BOTH, 420327}


@pytest.mark.parametrize("later", BOTH)
def test_both_generations_of_an_instrument_have_the_same_wrist(later):
    new, old = INSTRUMENTS[later], INSTRUMENTS[BOTH[later]]
    assert new.lengths.wrist == old.lengths.wrist
    assert (new.lower == old.lower).all()
    if later != 420006:  # its jaw opens less far backwards, as dVRK's file of that instrument has it
        assert (new.jaw == old.jaw).all()
    if later != 420296:  # Intuitive calls it LRG before and LARGE after
        assert new.name == old.name


@pytest.mark.parametrize("found", INSTRUMENTS.values(), ids=lambda i: i.type)
def test_an_instrument_could_be_built(found):
    shafts = {"S": {0.467}, "Classic": {0.4162, 0.41557}}[found.generation]
    assert found.lengths.shaft in shafts, "dVRK: the shaft depends on the manipulator alone, but for the stapler"
    assert (found.lengths.shaft == 0.41557) == found.name.startswith("STAPLER") == (found.lengths.wrist == 0.0)
    assert 0.009 <= found.lengths.wrist <= 0.0112 or found.name == "STAPLER_45"
    assert np.pi / 2 < found.upper[0] < 1.5 * np.pi, "a shaft turns by more than half a turn, and by less than 1.5"
    assert (found.upper[1:] <= 1.5708).all() and found.jaw[1] <= np.pi / 2 and found.jaw[0] >= -np.pi / 4
    assert np.allclose(found.R_wrist_tip @ found.R_wrist_tip.T, np.eye(3)) and np.linalg.det(found.R_wrist_tip) > 0.0


def test_needle_drivers_and_forceps_open_by_80_degrees():
    wide = [i for i in INSTRUMENTS.values() if "FORCEPS" in i.name or ("NEEDLE" in i.name and "LARGE" in i.name)]
    assert {round(float(np.degrees(i.jaw[1]))) for i in wide if "SUTURECUT" not in i.name} == {80}
