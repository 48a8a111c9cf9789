"""The table of instruments, and the words by which one is found."""

from __future__ import annotations

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
        ("LARGE_NEEDLE_DRIVER:7", "there is no instrument 7; for example 400006 and 420006 are known"),
        ("400006:LARGE_NEEDLE_DRIVER", "not a tool type; write NAME:NUMBER, for example LARGE_NEEDLE_DRIVER:400006"),
        ("", "'' is not a tool type"),
        *((number, "has a snake wrist, which is not modelled") for number in SNAKES),
    ],
)
def test_words_that_mean_no_instrument_are_answered(words, message):
    with pytest.raises(ValueError, match=message):
        instrument(words)
