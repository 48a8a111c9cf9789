"""Devices that need no file, alone and together; and the mouse over a terminal."""

from __future__ import annotations

import math
import os
import pty
import select
import tty
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.cli.main import app
from ligature.teleop.config import with_prefix, with_timeout
from ligature.teleop.devices import mouse
from ligature.teleop.devices.device import Reading
from ligature.teleop.ready import names, of_devices
from ligature.teleop.seat import Seat
from typer.testing import CliRunner


@given(st.lists(st.sampled_from(names()), min_size=1, max_size=6))
def test_any_devices_together_make_a_teleoperation(wanted: Sequence[str]) -> None:
    """No two begin with one arm, each may be handed every arm, and a seat takes them."""
    found = of_devices(wanted)
    begin = [found.begins_with(leader) for leader in found.pairs if found.begins_with(leader)]
    assert len(set(begin)) == len(begin) and begin[0] == "PSM1"
    assert all(set(arms) == {"PSM1", "PSM2"} for arms in found.pairs.values())
    assert set(found.devices) == set(found.pairs) and all(spec.name == name for name, spec in found.devices.items())
    Seat(found.pairs, waiting=found.waiting)


def test_topics_are_given_by_name() -> None:
    found = of_devices(["touch=/arm1/", "touch=/arm2", "gamepad=/pad/joy"])
    assert [spec.topic for spec in found.devices.values()] == ["/arm1/", "/arm2/", "/pad/joy"]
    assert list(found.devices) == ["pen", "pen2", "gamepad"]


@pytest.mark.parametrize(
    "words", [["--device", "hand"], ["--device", "touch="], [], ["file.yaml", "--device", "touch"]]
)
def test_what_is_not_ready_is_named(words: list[str]) -> None:
    result = CliRunner().invoke(app, ["teleop", *words, "--check"])
    assert result.exit_code == 1
    assert "touch" in result.output or "--device" in result.output


@given(seconds=st.floats(allow_nan=True, allow_infinity=True))
def test_all_devices_are_trusted_for_the_timeout_that_is_asked(seconds: float) -> None:
    ready = of_devices(["touch", "gamepad"])
    if 0.0 < seconds < math.inf:
        found = with_timeout(ready, seconds)
        assert {spec.settings for spec in found.devices.values()} == {
            replace(spec.settings, timeout=seconds) for spec in ready.devices.values()
        }
        assert found.pairs == ready.pairs
    else:
        with pytest.raises(ValueError, match="timeout must be above 0 s"):
            with_timeout(ready, seconds)


def test_a_timeout_of_nothing_is_refused() -> None:
    result = CliRunner().invoke(app, ["teleop", "--device", "touch", "--check", "--timeout", "0"])
    assert (result.exit_code, result.output) == (1, "the timeout must be above 0 s, not 0\n")


def drive(chunks: Sequence[bytes], **options: float) -> list[Reading]:
    """What a mouse over a terminal reads of bytes that arrive in chunks."""
    user, end = pty.openpty()
    tty.setraw(user)
    readings: list[Reading] = []
    device = mouse.Adapter(os.ttyname(end), {**mouse.OPTIONS, **options}, readings.append)
    for k, chunk in enumerate(chunks):
        os.write(user, chunk)
        while select.select([end], [], [], 0.02)[0]:  # a terminal hands on what is typed when it comes to it
            device.poll(0.01 * k)
    device.close()
    shown = b""
    while not shown.endswith(mouse.REPORT_OFF):
        assert select.select([user], [], [], 5.0)[0], "the terminal reports the mouse no more"
        shown += os.read(user, 1000)
    assert shown.startswith(mouse.REPORT_ON)
    os.close(user)
    os.close(end)
    return readings


places = st.tuples(st.integers(1, 200), st.integers(1, 60))


@settings(max_examples=40, deadline=None)
@given(st.lists(places, min_size=2, max_size=8), st.lists(st.integers(1, 400), max_size=4), st.integers(-3, 3))
def test_a_drag_moves_by_the_cells_that_it_crosses_however_its_bytes_arrive(
    way: list[tuple[int, int]], cuts: list[int], notches: int
) -> None:
    (x, y), (column, row) = way[0], way[-1]
    data = b"\x1b[<0;%d;%dM" % (x, y) + b"".join(b"\x1b[<32;%d;%dM" % place for place in way)
    data += (
        b"\x1b[<0;%d;%dm" % (column, row)
        + b"\x1b[<32;1;1M"
        + abs(notches) * (b"\x1b[<%d;1;1M" % (64 if notches > 0 else 65))
    )
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    readings = drive([data[a:b] for a, b in zip(edges[:-1], edges[1:], strict=True) if a < b], cell=0.002, notch=0.005)
    assert readings[-1].pose[:3] == pytest.approx([0.002 * (column - x), 0.004 * (row - y), 0.005 * notches])
    assert readings[-1].pose[3:] == pytest.approx([0, 0, 0, 1])


def test_an_escape_key_swallows_nothing() -> None:
    assert drive([b"\x1b", b"d", b"\x1b[A", b"d"])[-1].pose[0] == pytest.approx(2 * mouse.OPTIONS["step"])


def test_a_right_drag_turns_the_middle_button_and_keys_are_buttons() -> None:
    readings = drive(
        [b"\x1b[<2;10;10M\x1b[<34;15;10M", b"\x1b[<2;15;10m\x1b[<1;15;10M", b"\x1b[<1;15;10m d"], roll=0.02
    )
    assert 2 * np.arcsin(readings[0].pose[4]) == pytest.approx(0.1)
    assert [r.buttons["middle"] for r in readings][1:3] == [True, True] and not readings[-1].buttons["middle"]
    assert readings[-1].buttons["space"] and readings[-1].pose[0] == pytest.approx(mouse.OPTIONS["step"])


@given(parts=st.lists(st.from_regex(r"[a-z][a-z0-9_]*", fullmatch=True)), begins=st.booleans(), ends=st.booleans())
def test_topics_of_arms_begin_with_the_prefix_that_is_asked(parts: list[str], begins: bool, ends: bool) -> None:
    text = "/" * begins + "/".join(parts) + "/" * ends
    ready = of_devices(["touch"])
    found = with_prefix(ready, text)
    assert found.prefix == "".join(f"/{part}" for part in parts) + "/"
    assert {**vars(found), "prefix": ""} == {**vars(ready), "prefix": ""}


def test_a_prefix_that_no_name_begins_with_is_refused() -> None:
    result = CliRunner().invoke(app, ["teleop", "--device", "touch", "--check", "--ns", "left arm"])
    assert result.exit_code == 1
    assert "'left arm' cannot begin names of ROS" in result.output
