"""Hands on the page: what its script may order, where tips go by keys and drags, and how an arm waits for a browser."""

from __future__ import annotations

import json
import math
import os
import random
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
import viser
from hypothesis import given
from hypothesis import strategies as st
from ligature.cockpit.address import Address
from ligature.cockpit.arm_facts import ArmFacts
from ligature.cockpit.gate import Gate
from ligature.cockpit.hands import Hands, Sightline
from ligature.cockpit.intake import rejections
from ligature.cockpit.orders import FARTHEST, HELP, MODES, MOST_HEIGHT, ORDERS, PHASES, Drag, Order, read_order
from ligature.cockpit.page import SLOW, behind, serve
from ligature.cockpit.pursuit import LINEAR, ArmPursuits, TwistPursuit
from ligature.cockpit.rhythm import LEAST, MOST, RISE, Rhythm
from ligature.cockpit.stage import work_place
from ligature.cockpit.starter import Starter
from ligature.cockpit.wire import MOST_RATE, PATH, Wire
from ligature.model.frames import inverse
from ligature.render.camera import view_of
from ligature.robots.operating_state import State
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tests.cockpit.conftest import until

ROOT = Path(__file__).resolve().parents[2]
MESSAGES = 100_000 if os.environ.get("LIGATURE_EXAMPLES") == "new" else 3_000
ODD = (
    None, True, False, 0, 1, -1, 0.5, 2, 1e308, math.inf, -math.inf, math.nan, 10**400, "", "fine", "start", "pick", "x" * 10_000, [], [0] * 7,
    [1] * 7, [2] * 7, [0] * 8, [math.nan] * 7, ["start", 0, 0], ["start", 0, 1e9], ["no", 0, 0], [[], 0, 0], [True, 480, False],
    [True, -1, True], [1, 480, True], [True, 1e9, True], {}, {"do": 1}, [[[[]]]],
)  # fmt: skip


# --- orders: what enters -------------------------------------------------------------------------


def sound(order: Order) -> bool:
    """Whether a person with this page could have ordered that."""
    word, value = order
    if word in ("seen", "start", "hold", "next", "csv"):
        return value is None
    if word == "move":
        return len(value) == 7 and all(type(v) is float and -1.0 <= v <= 1.0 for v in value)
    if word == "drag":
        return value.phase in PHASES and max(abs(value.right), abs(value.up)) <= FARTHEST
    if word == "view":
        return type(value.large) is bool and type(value.stereo) is bool and 0 <= value.height <= MOST_HEIGHT
    if word == "speed":
        return value in MODES
    if word == "dark":
        return type(value) is bool
    if word == "assist":
        return value in HELP
    if word == "drive":
        return type(value) is float and 0.0 <= value <= 1.0
    return word == "hello" and type(value) is str and len(value) <= 100


def odd_message(rng: random.Random) -> Any:
    words = [*ORDERS, "silent", "", "__class__", 3, None]
    message = {"do": rng.choice(words), "value": rng.choice(ODD)}
    if rng.random() < 0.1:
        message[rng.choice(["uuid", "x"])] = rng.choice(ODD)
    text = json.dumps(message)
    if rng.random() < 0.2:
        at = rng.randrange(len(text))
        text = text[:at] + rng.choice('[]{},:"0e\x00') + text[at + rng.randint(0, 2) :]
    return text


def test_whatever_is_sent_only_sound_orders_are_read() -> None:
    rng, words = random.Random(7), set()
    for _ in range(MESSAGES):
        order = read_order(odd_message(rng))
        assert order is None or sound(order), order
        words.add(None if order is None else order.word)
    assert words == {None, *ORDERS}, "each order is read at times"


@given(st.one_of(st.text(), st.binary(), st.recursive(st.none() | st.floats() | st.text(), st.lists).map(json.dumps)))
def test_text_that_is_no_order_is_none(text: Any) -> None:
    order = read_order(text)
    assert order is None or sound(order)


def test_deep_nesting_is_no_order() -> None:
    assert read_order("[" * 499) is None
    assert read_order('{"do":' * 80) is None


@pytest.fixture
def wired() -> Iterator[tuple[Wire, int, list[tuple[str, int, Any]], viser.ViserServer]]:
    """A page with a wire, its port and what came by it."""
    wire, heard = Wire(), []
    server = serve(Address("127.0.0.1", 0), Gate(Address("127.0.0.1", 0), ""), wire)
    wire.begin(lambda *what: heard.append(what), server.get_event_loop())
    yield wire, server.get_port(), heard, server
    server.stop()


def test_a_browser_speaks_for_the_page_whose_pass_it_has(wired: Any) -> None:
    wire, port, heard, _ = wired
    key = wire.admit(7)
    with connect(f"ws://127.0.0.1:{port}{PATH}") as line:
        line.send(json.dumps({"do": "hello", "value": key}))
        line.send(json.dumps({"do": "next", "value": None}))
        until(lambda: ("wire", 7, Order("next", None)) in heard, "the order is heard")
        wire.show(b"first")
        wire.show(b"second")
        assert line.recv(timeout=20) in (b"first", b"second")
        wire.inform(7, {"arm": "PSM1"})
        assert json.loads(line.recv(timeout=20)) == {"arm": "PSM1"}, "no picture comes before the last one was seen"
        wire.show(b"third")
        line.send(json.dumps({"do": "seen", "value": None}))
        until(lambda: line.recv(timeout=20) == b"third", "the next picture comes")
    until(lambda: ("wire", 7, Order("silent", None)) in heard, "it is heard that nobody speaks any more")


@pytest.mark.parametrize("first", ['{"do": "hello", "value": "guess"}', '{"do": "next"}', "junk", b"\xff"])
def test_without_the_pass_nobody_is_heard(wired: Any, first: str | bytes) -> None:
    wire, port, heard, _ = wired
    wire.admit(7)
    with connect(f"ws://127.0.0.1:{port}{PATH}") as line:
        line.send(first)
        with pytest.raises(ConnectionClosed):
            line.recv(timeout=20)
    assert not heard


def test_junk_is_not_handed_on_and_a_flood_ends_its_connection(wired: Any) -> None:
    wire, port, heard, _ = wired
    key, rng, before = wire.admit(3), random.Random(9), rejections.count
    line = connect(f"ws://127.0.0.1:{port}{PATH}")
    line.send(json.dumps({"do": "hello", "value": key}))
    begin, sent = time.monotonic(), 0
    with pytest.raises(ConnectionClosed):
        while sent < 100_000:
            line.send(odd_message(rng))
            sent += 1
    spent = time.monotonic() - begin
    until(lambda: heard and heard[-1][2].word == "silent", "its end is heard")
    orders = [what[2] for what in heard[:-1]]
    assert all(sound(order) for order in orders)
    assert len(orders) <= 200 + MOST_RATE * (spent + 1.0)
    assert rejections.count > before


# --- how an arm waits for a browser ----------------------------------------------------------------


@given(st.lists(st.floats(0.0, 10.0), max_size=200))
def test_the_limit_stays_within_its_bounds_whatever_comes(silences: list[float]) -> None:
    rhythm = Rhythm()
    for silence in silences:
        rhythm.note(silence)
        assert LEAST <= rhythm.limit <= MOST
        assert rhythm.pace(rhythm.limit, 0.01) == 0.0


def test_the_limit_goes_with_the_usual_silence_and_comes_back() -> None:
    rhythm = Rhythm()
    assert rhythm.limit == LEAST
    for _ in range(50):
        rhythm.note(0.07)
    assert rhythm.limit == pytest.approx(0.175), "a busy machine"
    rhythm.note(5.0)
    assert rhythm.limit == pytest.approx(0.175), "one absence is no habit"
    for _ in range(100):
        rhythm.note(0.02)
    assert rhythm.limit == LEAST, "a quiet one"


def test_an_arm_slows_down_stands_and_goes_on_smoothly() -> None:
    rhythm, dt = Rhythm(), 0.005
    silence = np.concatenate([np.zeros(40), np.arange(0.0, 0.3, dt), np.zeros(60)])
    pace = np.array([rhythm.pace(float(s), dt) for s in silence])
    assert pace[39] == 1.0
    assert np.all(pace[(silence >= LEAST)] == 0.0)
    assert np.diff(pace)[100:].max() <= dt / RISE + 1e-9, "it does not jump when the browser is back"
    assert np.abs(np.diff(pace)).max() < 0.2
    assert pace[-1] == 1.0


# --- twists and drags ------------------------------------------------------------------------------


def test_a_twist_moves_as_far_as_it_says_and_comes_to_rest() -> None:
    pursuit = TwistPursuit(np.eye(4), np.array([0.02, 0.0, -0.01, 0.0, 0.0, 0.5]))
    for _ in range(100):
        pursuit.advance(0.01)
    pursuit.twist = np.zeros(6)
    steps = 0
    while not pursuit.arrived:
        pursuit.advance(0.01)
        steps += 1
    assert steps < 100
    assert pursuit.goal[:3, 3] == pytest.approx([0.02, 0.0, -0.01], rel=0.02), "what smoothing takes it gives back"
    assert np.arctan2(pursuit.goal[1, 0], pursuit.goal[0, 0]) == pytest.approx(0.5, rel=0.02)
    assert pursuit.goal[:3, :3] @ pursuit.goal[:3, :3].T == pytest.approx(np.eye(3), abs=1e-9)


class Posed:
    """The own scene with PSM1 and PSM2 at home."""

    def __init__(self) -> None:
        self.simulation = ligature.Simulation(ligature.load(ROOT / "scenes" / "suturing_small" / "launch.yaml"))
        scene = self.scene = self.simulation.scene
        self.facts = [ArmFacts.of(scene, index) for index in range(len(scene.arms))]
        sent: list[Any] = []
        starter = Starter(self.facts, sent.append)
        starter.begin()
        for _ in range(400):
            starter.advance(self.simulation.state[0])
            for command in sent:
                self.simulation.apply(command)
            sent.clear()
            self.simulation.step(20)
            if not starter.active:
                break
        self.started = self.simulation.state[0].copy()
        self._look()
        self._bring()
        self._look()
        self.ready = [fact.name for fact in self.facts if fact.ready(self.simulation.state[0])]

    def _bring(self) -> None:
        hands, pursuits = self.hands()
        hands.bring(self.state, work_place(self.scene, self.simulation.state), self.sight)
        for _ in range(400):
            for command in (command for pursuit in pursuits for command in pursuit.advance(0.02)):
                self.simulation.apply(command)
            self.simulation.step(20)

    def _look(self) -> None:
        self.state, scene = self.simulation.state[0].copy(), self.scene
        camera = self.camera = scene.cameras[0]
        self.sight = Sightline.of(camera, self.state["camera_world"][camera.index])
        self.view = view_of(camera, self.state["camera_world"][camera.index])

    def hands(self) -> tuple[Hands, list[ArmPursuits]]:
        pursuits = [ArmPursuits(index) for index in range(len(self.facts))]
        return Hands(self.facts, pursuits), pursuits

    def seen(self, T: np.ndarray) -> np.ndarray:
        """Where the renderer shows the origin of ``T`` in heights of the picture from its middle: another way to it."""
        clip = self.view.projection @ self.view.view @ T[:, 3]
        return 0.5 * clip[:2] / clip[3] * [self.view.width / self.view.height, 1.0]


@pytest.fixture(scope="module")
def posed() -> Iterator[Posed]:
    found = Posed()
    yield found
    found.simulation.close()


def goal_of(posed: Posed, pursuits: list[ArmPursuits], arm: int) -> np.ndarray:
    """World pose (4, 4) that an arm pursues."""
    motion = pursuits[arm]._motion
    assert motion is not None
    target = getattr(motion, "target", motion.goal)
    return inverse(posed.facts[arm].in_reference(posed.state, np.eye(4))) @ target


def test_start_powers_and_homes_the_instruments_alone(posed: Posed) -> None:
    assert posed.ready == ["PSM1", "PSM2"]
    assert posed.state["arm"][2]["operating"] == State.DISABLED


def test_start_brings_tips_into_the_picture(posed: Posed) -> None:
    before = [posed.sight.place(fact.tip_in_world(posed.started)[:3, 3]) for fact in posed.facts[:2]]
    assert not any(np.abs(place).max() < 0.5 for place in before), "they were not there at home"
    places = [posed.sight.place(fact.tip_in_world(posed.state)[:3, 3]) for fact in posed.facts[:2]]
    assert sorted(place[0] for place in places) == pytest.approx([-0.25, 0.25], abs=0.02)
    assert [place[1] for place in places] == pytest.approx([0.0, 0.0], abs=0.02)
    forces = [float(np.linalg.norm(posed.state["arm"][arm]["spatial_measured_cf"][:3])) for arm in (0, 1)]
    assert max(forces) < 5.0, "and touch nothing"


def test_a_tip_is_seen_where_the_renderer_shows_it(posed: Posed) -> None:
    for fact in posed.facts[:2]:
        T = fact.tip_in_world(posed.state)
        assert posed.sight.place(T[:3, 3]) == pytest.approx(posed.seen(T), abs=1e-9)


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.sampled_from([0, 1]))
def test_a_dragged_tip_goes_with_the_pointer_in_its_plane(posed: Posed, right: float, up: float, arm: int) -> None:
    hands, pursuits = posed.hands()
    tip = posed.facts[arm].tip_in_world(posed.state)
    begin = posed.seen(tip) + 0.02
    assert hands.drag(posed.state, Drag("start", *begin), posed.sight) == arm, "who is nearest is taken"
    hands.drag(posed.state, Drag("move", begin[0] + right, begin[1] + up), posed.sight)
    goal = goal_of(posed, pursuits, arm)
    assert posed.seen(goal) - posed.seen(tip) == pytest.approx([right, up], abs=1e-6)
    assert (goal - tip)[:3, 3] @ posed.sight.R[:, 2] == pytest.approx(0.0, abs=1e-9), "it stays as far away"
    assert goal[:3, :3] == pytest.approx(tip[:3, :3], abs=1e-9)
    hands.drag(posed.state, Drag("end", *begin), posed.sight)
    assert hands.drag(posed.state, Drag("move", 0.0, 0.0), posed.sight) is None


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("axis", "way"), [(0, 1.0), (1, -1.0), (2, 1.0)])
def test_a_key_moves_the_tip_as_its_operator_sees_it(posed: Posed, axis: int, way: float, mode: str) -> None:
    hands, pursuits = posed.hands()
    hands.mode = mode
    motion, begin = np.zeros(7), posed.facts[0].tip_in_world(posed.state)
    motion[axis] = way
    for turn in range(50):
        hands.move(motion.tolist(), 0.01 * turn)
        hands.advance(posed.state, posed.sight, 0.01 * turn, 0.01)
        pursuits[0].advance(0.01)
    moved = (goal_of(posed, pursuits, 0) - begin)[:3, 3] @ posed.sight.R
    expected = np.zeros(3)
    expected[axis] = way * LINEAR * MODES[mode] * 0.44  # half a second, less what it takes to get going
    assert moved == pytest.approx(expected, abs=0.05 * LINEAR * MODES[mode])


def test_a_tip_comes_to_rest_when_its_browser_is_silent(posed: Posed) -> None:
    hands, pursuits = posed.hands()
    hands.move([1, 0, 0, 0, 0, 0, 0], 0.0)
    places = []
    for turn in range(100):
        hands.advance(posed.state, posed.sight, 0.01 * turn, 0.01)
        if pursuits[0].active:
            pursuits[0].advance(0.01)
            if pursuits[0].active:
                places.append(goal_of(posed, pursuits, 0)[:3, 3])
    way = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert way.max() > 0.0
    assert way[30:].max(initial=0.0) < 1e-5
    assert not hands.moving
    hands.move([1, 0, 0, 0, 0, 0, 0], 1.0)
    assert not hands.moving, "who was away lets go first"
    hands.move([0] * 7, 1.1)
    hands.move([1, 0, 0, 0, 0, 0, 0], 1.2)
    assert hands.moving


def test_what_lies_behind_for_long_is_not_counted_on() -> None:
    assert behind(1.26) == "1.3 s behind the clock"
    assert behind(1305.0) == behind(SLOW) == "over a minute behind the clock"
