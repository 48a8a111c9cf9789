"""The ROS process: AMBF's topics between the shared-memory bus and a ROS 1 master.

One thread publishes everything; commands come in on rospy's threads; the master is watched on a
third. None of them ever waits for another process.
"""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import Any

import numpy as np
import rosgraph.names
import rospy
from rospy.impl.registration import get_topic_manager
from std_msgs.msg import Bool

from ligature.bus import Block, Outbox
from ligature.bus.stop import Stop
from ligature.model.commands import ParentCommand
from ligature.model.scene import Scene
from ligature.model.state import new_state
from ligature.ros import conversion, names, tissue
from ligature.ros.arms import ArmsNode
from ligature.ros.diagnostics import Diagnostics
from ligature.ros.intake import oversized
from ligature.ros.master import NO_ANSWER, MasterWatch, node_name, takes_time_from_clock
from ligature.ros.pace import PaceServices
from ligature.ros.parameters import Parameters
from ligature.ros.plugins import PluginTemplate, plugin_templates, subscribe_plugins
from ligature.ros.publisher import Publisher
from ligature.ros.reception import Reception
from ligature.ros.registrations import dead_neighbours
from ligature.ros.schedule import Key, Outlet, Schedule
from ligature.ros.start import address_problem, start_node
from ligature.ros.unserved import Unserved

DEFAULT_LOW, DEFAULT_HIGH = 50, 1000
PLUGIN_HZ = 200
"""Messages per second of each topic that a plug-in publishes."""
HAPTICS = "ligature/haptics"
"""Parameter from which teleoperation reads its haptic ``rate`` in Hz and whether it sends ``forces``."""
COUNTING = 1.0
"""Seconds over which pictures are counted."""
REST = 0.0002
"""Seconds of sleep after each publication: a real-time thread that never sleeps would starve all others."""
HOUSEKEEPING = 0.02
"""Seconds between checks of watchdogs and the physics process."""


class Node:
    """The simulator on ROS; raises `ligature.ros.registrations.NameTaken` when another one runs already."""

    def __init__(
        self, scene: Scene, block: Block, min_hz: int | None, max_hz: int | None, policy: str, challenge: bool,
        reference: str = "", haptics: Mapping[str, Any] = MappingProxyType({}), devices: int = 0,
    ) -> None:  # fmt: skip
        self._scene = scene
        self._state = new_state(scene)
        self._block = block
        self._ring = self._block.rings["ros"]
        self._woken = threading.Event()
        name = node_name(scene.world.topic)
        start_node(name)
        self._outbox = Outbox(self._ring)
        self._reception = Reception(scene, self._outbox, self._wake)
        self._world = conversion.WorldTemplate(devices)
        self._frames = 0, time.monotonic()
        if haptics:
            rospy.set_param(f"{scene.world.root}{HAPTICS}", dict(haptics))
        self._publishers: list[Publisher] = []
        outlets = self._advertise(min_hz, max_hz, policy)
        tissues = self._advertise_tissues(outlets)
        plugins = [self._outlet_of_plugin(t, min_hz, max_hz) for t in plugin_templates(scene)]
        self._schedule = Schedule([*outlets, *tissues, *plugins], self._reception.commanded)
        for outlet in outlets[1:]:
            self._reception.subscribe(outlet.template, outlet.topic)
        self._reception.subscribe_world()
        subscribe_plugins(scene, self._outbox.push)
        PaceServices(f"{scene.world.root}ligature", scene, self._block, self._outbox.push)
        self._arms = ArmsNode(scene, self._block, self._outbox, challenge, reference)
        arms = ", ".join(outlet.description.name for outlet in self._arms.outlets) or "none"
        self.summary = f"{2 * len(outlets) + len(tissues)} topics of objects; arms: {arms}"
        self._diagnostics = Diagnostics(self._block, lambda: tissue.statuses(scene, self._state[0]))
        self._placed = {outlet.key: outlet.template for outlet in outlets if outlet.key[0] in ("camera", "light")}
        self._ready = rospy.Publisher(f"{scene.world.root}ligature/ready", Bool, queue_size=1, latch=True)
        self._parameters = Parameters(scene, self._adopt)
        self._unserved = Unserved(scene.world.root, [arm.name for arm in scene.arms])
        self._master = MasterWatch(self._look_at_master)

    def run(self, stop: Stop, on_first: Callable[[], None]) -> None:
        """Publish until ``stop`` is set or the physics process is gone."""
        self._master.start()
        threading.Thread(target=_report_unreachable, name="unreachable", daemon=True).start()
        published, ready, housekeeping = False, False, 0.0
        if self._block.read(self._state):
            self._arms.start(self._state[0])
        while not stop.is_set() and not rospy.is_shutdown():
            now = time.monotonic()
            if now >= housekeeping:
                housekeeping = now + HOUSEKEEPING
                if not self._housekeeping(now):
                    return
            self._woken.clear()
            nap = min(self._schedule.next_due(now), self._arms.next_due(), housekeeping) - now
            if nap > 0.0:
                self._woken.wait(nap)
            elif self._block.read(self._state):
                self._publish(now)
                time.sleep(REST)
                if not published:
                    published = True
                    gc.freeze()  # what a start has made stays: each look at it would hold up all topics for 50 ms
                    on_first()
                if not ready and self._state["update"][0] > 0:  # the first state is there before physics has started
                    ready = True
                    self._ready.publish(True)

    def _look_at_master(self) -> None:
        """What the watch of the master does at every look."""
        self._parameters.poll()
        self._unserved.poll(time.monotonic())

    def _advertise(self, min_hz: int | None, max_hz: int | None, policy: str) -> list[Outlet]:
        """An outlet for the world and one for every object that the name policy lets be seen."""
        low, high = min_hz or DEFAULT_LOW, max_hz or DEFAULT_HIGH
        outlets = [self._outlet(self._world, self._scene.world.topic, "State", low, high)]
        templates = conversion.templates(self._scene)
        objects = [(template.kind, template.identity) for template in templates]
        hidden = []
        for template, topic in zip(templates, names.topics(objects, policy, self._scene.world.topic), strict=True):
            identity = template.identity
            if topic is None:
                hidden.append(identity.topic)
            elif not rosgraph.names.is_legal_name(topic):
                rospy.logwarn(
                    f"'{topic}' is not a valid ROS name and is not advertised; use letters, digits, '_' and '/'"
                )
            else:
                low, high = min_hz or max(identity.publish_low, 1), max_hz or max(identity.publish_high, 1)
                outlets.append(self._outlet(template, topic, "State", low, high))
        if hidden:
            rospy.loginfo(f"not advertised under the name policy '{policy}': {', '.join(hidden)}")
        return outlets

    def _advertise_tissues(self, outlets: list[Outlet]) -> list[Outlet]:
        """Outlets for the bodies of tissue below those of their rigid bodies."""
        bodies = {outlet.key[1]: outlet for outlet in outlets if outlet.key[0] == "body"}
        found = []
        for body in self._scene.tissues:
            own = bodies.get(body.body)
            if own is None:
                continue
            for name, (template, _, rate) in tissue.TOPICS.items():
                low, high = rate or own.low, rate or own.high
                found.append(self._outlet(template(self._scene, body), own.topic, name, low, high))
        return found

    def _outlet_of_plugin(self, template: PluginTemplate, min_hz: int | None, max_hz: int | None) -> Outlet:
        publisher = Publisher(template.topic, type(template.message))
        self._publishers.append(publisher)
        return Outlet(template, template.topic, publisher, min_hz or PLUGIN_HZ, max_hz or PLUGIN_HZ)

    def _outlet(self, template: Any, topic: str, name: str, low: float, high: float) -> Outlet:
        publisher = Publisher(f"{topic}/{name}", type(template.message))
        self._publishers.append(publisher)
        return Outlet(template, topic, publisher, low, high)

    def _wake(self, key: Key, at_once: bool) -> None:
        self._schedule.wake(key, at_once)
        self._woken.set()

    def _adopt(self, command: ParentCommand) -> None:
        """Change the parent of a camera or light, in its messages too."""
        self._outbox.push(command)
        template = self._placed.get((command.kind, command.index))
        if template is not None:
            body = None if command.parent is None else self._scene.bodies[command.parent]
            template.message.parent_name.data = "" if body is None else body.identity.identifier

    def _publish(self, now: float) -> None:
        state = self._state[0]
        sent, missed = self._schedule.publish(now, state, rospy.Time.from_sec(float(state["stamp"])))
        if self._arms.next_due() <= now:
            sent += self._arms.publish(now, state, lambda: self._block.read(self._state))
        figures = self._block.figures
        figures["published"] += np.uint64(sent)
        figures["publish_late"] += np.uint64(missed)

    def _count_pictures(self, now: float) -> None:
        """Pictures per second, for the world's state."""
        before, since = self._frames
        if now - since >= COUNTING:
            drawn = int(self._block.figures["frames"][0])
            self._world.pictures_hz = (drawn - before) / (now - since)
            self._frames = drawn, now

    def _housekeeping(self, now: float) -> bool:
        """Update heartbeat, watchdogs and diagnostics; False when the physics process has ended."""
        self._ring.beat()
        self._reception.watch(now)
        for publisher in self._publishers:
            publisher.flush()
        figures = self._block.figures
        figures["malformed"] = self._reception.rejected + self._arms.rejected + oversized.count
        self._diagnostics.missed = sum(publisher.dropped for publisher in self._publishers) + self._arms.dropped
        self._diagnostics.faults = self._arms.faults
        self._diagnostics.rivals = self._arms.rivals
        self._world.loop_hz = float(figures["loop_hz"][0])
        self._count_pictures(now)
        self._diagnostics.publish(now)
        return self._block.active


def _report_unreachable() -> None:
    """Log why others may not reach this node or may wait for ever, and which nodes of its topics do not answer.

    Each may take seconds to find out.
    """
    if problem := address_problem(rospy.get_node_uri(), rosgraph.get_master_uri()):
        rospy.logwarn(problem)
    with suppress(*NO_ANSWER):
        if takes_time_from_clock():
            rospy.logwarn(
                "/use_sim_time is true: stamps of this run are of the wall clock all the same, and it publishes no "
                "/clock, so that programs may wait for one; set the parameter to false before they start"
            )
    manager = get_topic_manager()
    topics = [topic for topic, _ in (*manager.get_publications(), *manager.get_subscriptions())]
    with suppress(*NO_ANSWER):  # the watch of the master reports it
        for line in dead_neighbours(rospy.get_name(), topics):
            rospy.logwarn(line)
