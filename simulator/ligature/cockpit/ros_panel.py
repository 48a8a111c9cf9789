"""ROS on the page: teleoperation with its pairing and pedals, and how the topics do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from typing import Any, Protocol

from viser import ClientHandle, GuiEvent, ViserServer

from ligature.cockpit.page import badge

MOST_ROWS = 40
"""Most topics that are listed."""


class Topic(Protocol):
    """What is listed of a topic."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def rate(self) -> float | None:
        """Messages a second."""

    @property
    def subscribers(self) -> int:
        """Listeners."""


class Health(Protocol):
    """Where topics come from: `ligature.ros.health.TopicHealth`."""

    answers: bool

    @property
    def topics(self) -> Sequence[Topic]:
        """Topics with subscribers."""

    @property
    def published(self) -> int:
        """How many there are."""


class Remote(Protocol):
    """A running teleoperation: `ligature.teleop.remote.TeleopRemote`."""

    pairs: dict[str, Any]
    scale: float

    def enable(self, on: bool) -> None:
        """Start or stop driving."""

    def select(self, pair: str) -> None:
        """Choose a pair."""

    def unselect(self, pair: str) -> None:
        """Give a pair up."""

    def set_scale(self, scale: float) -> None:
        """Scale all pairs."""

    def press(self, pedal: str, down: bool) -> None:
        """Press a pedal."""


class RosPanel:
    """What everybody sees of ROS; folders that take the operator's controls."""

    def __init__(self, server: ViserServer, health: Health, remote: Remote) -> None:
        self._health, self.remote = health, remote
        self.folder = server.gui.add_folder("Teleoperation", order=50)
        with self.folder:
            self._pairs = server.gui.add_html("")
        with server.gui.add_folder("ROS topics", order=51, expand_by_default=False):
            self._topics = server.gui.add_html("")
        self._shown = ["", ""]

    def refresh(self) -> None:
        """Show what is known now."""
        for i, (handle, words) in enumerate(((self._pairs, self._pair_words()), (self._topics, self._topic_words()))):
            if words != self._shown[i]:
                self._shown[i] = handle.content = words

    def _pair_words(self) -> str:
        rows = []
        for name in sorted(self.remote.pairs):
            pair = self.remote.pairs[name]
            colour = "#237032" if pair.following else "#1864ab" if pair.selected else "#5c636a"
            rows.append(
                f"{badge('drives' if pair.following else 'selected' if pair.selected else 'idle', colour)} "
                f"{escape(pair.leader)} → {escape(pair.follower)} "
                f'<span class="ligature-quiet">{escape(pair.status or pair.current_state)}</span>'
            )
        words = "<br>".join(rows) or "no teleoperation; start <code>ligature teleop</code>"
        return f'<div id="pairs" style="font-size:12px;padding:2px 8px">{words}</div>'

    def _topic_words(self) -> str:
        if not self._health.answers:
            return '<div id="topics" style="font-size:12px;padding:2px 8px">the ROS master does not answer</div>'
        rows = []
        for topic in self._health.topics[:MOST_ROWS]:
            rate = "…" if topic.rate is None else f"{topic.rate:.1f}"
            colour = "#e03131" if topic.rate == 0.0 else "inherit"
            rows.append(
                f'<tr style="color:{colour}"><td>{escape(topic.name)}</td>'
                f'<td style="text-align:right">{rate}</td><td style="text-align:right">{topic.subscribers}</td></tr>'
            )
        head = "<tr><td>heard topic</td><td>Hz</td><td>by</td></tr>"
        rest = max(len(self._health.topics) - MOST_ROWS, 0)
        more = f"<br>and {rest} more" if rest else ""
        return (
            f'<div id="topics" style="font-size:11px;padding:2px 8px">{self._health.published} topics are published'
            f'<table style="width:100%">{head}{"".join(rows)}</table>{more}</div>'
        )


class TeleopControls:
    """The operator's; ``act`` takes a word and a value, on the network's thread."""

    def __init__(self, client: ClientHandle, panel: RosPanel, act: Callable[[str, Any], None]) -> None:
        self.client, self.act = client, act
        gui = client.gui
        self._pairs = tuple(sorted(panel.remote.pairs))
        with panel.folder:
            enabled = gui.add_button_group("Teleop", ("Enable", "Disable"))
            clutch = gui.add_checkbox("Clutch pedal", False)
            camera = gui.add_checkbox("Camera pedal", False)
            scale = gui.add_slider("Scale", 0.05, 1.0, 0.05, min(max(panel.remote.scale, 0.05), 1.0))
            self._handles: list[Any] = [enabled, clutch, camera, scale]
            for pair in self._pairs:
                choice = gui.add_button_group(pair.replace("_", " → "), ("Select", "Unselect"))
                choice.on_click(self._of("pair", pair))
                self._handles.append(choice)
        enabled.on_click(self._of("teleop"))
        clutch.on_update(self._of("pedal", "clutch"))
        camera.on_update(self._of("pedal", "camera"))
        scale.on_update(self._of("scale"))

    def _of(self, word: str, about: str = "") -> Any:
        async def take(event: GuiEvent[Any]) -> None:
            if event.client_id is not None:
                self.act(word, (about, event.target.value) if about else event.target.value)

        return take

    def outdated(self, panel: RosPanel) -> bool:
        """Whether there are other pairs now."""
        return self._pairs != tuple(sorted(panel.remote.pairs))

    def remove(self) -> None:
        """Take the controls off the page."""
        for handle in self._handles:
            handle.remove()


def obey_teleop(remote: Remote, word: str, value: Any) -> bool:
    """Carry out an order of `TeleopControls`; False when the word is none of its."""
    if word == "teleop":
        remote.enable(value == "Enable")
    elif word == "pedal":
        remote.press(value[0], bool(value[1]))
    elif word == "scale":
        remote.set_scale(float(value))
    elif word == "pair":
        (remote.select if value[1] == "Select" else remote.unselect)(value[0])
    else:
        return False
    return True
