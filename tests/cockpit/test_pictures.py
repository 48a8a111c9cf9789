"""How sharp large pictures are: as sharp as the machine draws them often enough, and whole again when it can."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from ligature.cockpit.pictures import HEIGHT, LARGE_REST, LEAST_SHARE, RATE, Sharpness, Sight, Wish

SIGHT = Sight("camera", ((0, ""),))
LARGE = Wish(SIGHT, 480, True)


def drawn(sharpness: Sharpness, whole: float, fixed: float, count: int = 200) -> list[float]:
    """Seconds of each of some pictures: ``fixed``, and ``whole`` more for all pixels."""
    found = []
    for _ in range(count):
        spent = fixed + whole * sharpness.share**2
        sharpness.note(spent)
        found.append(spent)
    return found


@given(st.floats(1e-4, 0.5), st.floats(0.0, 0.02))
def test_pictures_come_often_enough_or_are_as_small_as_they_get(whole: float, fixed: float) -> None:
    sharpness = Sharpness()
    spent = drawn(sharpness, whole, fixed)[-20:]
    enough = (1.0 + LARGE_REST) * sum(spent) / len(spent) <= 1.1 / RATE
    assert enough or sharpness.share == LEAST_SHARE
    if (1.0 + LARGE_REST) * (whole + fixed) < 0.6 / RATE:
        assert sharpness.share == 1.0


@given(st.floats(0.1, 0.5))
def test_a_picture_is_whole_again_when_the_machine_has_time(busy: float) -> None:
    sharpness = Sharpness()
    drawn(sharpness, busy, 0.0)
    assert sharpness.share < 1.0
    drawn(sharpness, 0.02, 0.0)
    assert sharpness.share == 1.0


def test_small_pictures_stay_as_they_are() -> None:
    sharpness = Sharpness()
    drawn(sharpness, 1.0, 0.0)
    assert sharpness.height(LARGE) == 240
    assert sharpness.height(Wish(SIGHT)) == HEIGHT
    assert Sharpness().height(LARGE) == 480
