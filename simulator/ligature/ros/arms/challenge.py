"""The arms under the names that the suturing challenge's own CRTK node gives them, such as ``/CRTK/psm1/…``.

That node has no operating states: its arms move on every command, and a jaw that closes on something attaches it by the
actuator of the tool. Radians, metres; poses are in the base frame of the arm.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped, TwistStamped
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty

from ligature.model.commands import ActuatorCommand, BodyCommand, Command, CommandType, Release
from ligature.model.frames import frame, matrix_pose7, pose7_matrix, rpy_matrix
from ligature.model.scene import ArmDescription, ArmKind, Scene
from ligature.process import REPEAT
from ligature.robots.arm import CHALLENGE
from ligature.robots.commands import VERBS
from ligature.robots.ecm import SrcCamera
from ligature.ros.arms.outlet import ArmOutlet
from ligature.ros.arms.readings import set_pose

Array = NDArray[np.float64]

QUEUE = 1
PERIOD = 1.0 / 120.0
"""Seconds between two publications, as the challenge's node has it."""

CLOSED = 0.05
"""Jaw value below which the challenge's arms take hold of what both fingers feel."""

GRASPED = ("Needle", "Thread", "Puzzle")
"""What they take hold of, the first that is felt."""

SCENE_BODIES = ("Needle", *(f"{side}{i}" for side in ("Entry", "Exit") for i in range(1, 5)))

TASK_3_JOINTS = (-0.4, -0.22, 0.139, -1.64, -0.37, -0.11)
TASK_3_ARM = "PSM2"
TASK_3_OPEN = 0.8
TASK_3_GRASP = frame(rpy_matrix(-np.pi / 2, 0.0, 0.0), (0.00997302, -0.00521514, 0.00323717))
"""Pose of the needle in the tool yaw link, with which task 3 begins."""

TASK_3_SECONDS = {"reach": 1.5, "bring": 3.0, "grasp": 0.3}
ARRIVED = 5e-4


class ChallengeFace:
    """Topics of the challenge's node over the same arms; ``push`` sends commands to the physics."""

    def __init__(self, scene: Scene, outlets: Sequence[ArmOutlet], push: Callable[[Command], None]) -> None:
        self._scene, self._push = scene, push
        self._state: Any = None
        self._due = 0.0
        root, self._world = f"{scene.world.root}{CHALLENGE}", f"{scene.world.frame_prefix}world"
        self._arms = [
            _Psm(
                f"{root}/{outlet.description.name.lower()}", scene, outlet.index, outlet.description, self._newest, push
            )
            for outlet in outlets
            if outlet.description.kind is ArmKind.PSM
        ]
        tips = [arm.tip for arm in scene.arms if arm.kind is ArmKind.ECM]
        self._camera = _Camera(f"{root}/ecm", scene, tips[0], push) if tips else None
        self._poses = {}
        for name in SCENE_BODIES:
            index = next((b.index for b in scene.bodies if b.identity.name == name), None)
            if index is not None:
                publisher = rospy.Publisher(f"{root}/{name}/measured_cp", PoseStamped, queue_size=QUEUE)
                self._poses[index] = publisher
        self._ready = rospy.Publisher(f"{root}/scene/task_3_setup/ready", Empty, queue_size=QUEUE)
        rospy.Subscriber(f"{root}/scene/task_3_setup/init", Empty, self._set_up_task_3, queue_size=QUEUE)

    def _newest(self) -> Any:
        return self._state

    def publish(self, now: float, state: Any, stamp: Any) -> None:
        """Publish what is due at ``now``, on the monotonic clock."""
        self._state = state
        if now < self._due:
            return
        self._due = max(self._due + PERIOD, now)
        for arm in self._arms:
            arm.publish(state, stamp)
        if self._camera is not None:
            self._camera.publish(state, stamp)
        for body, publisher in self._poses.items():
            publisher.publish(_posed(self._world, state["body_pose"][body], stamp))

    def _set_up_task_3(self, message: Any) -> None:
        """Move the needle into the jaw of the second arm, on a thread of its own."""
        arm = next((arm for arm in self._arms if arm.name == TASK_3_ARM), None)
        needle = next((b.index for b in self._scene.bodies if b.identity.name == "Needle"), None)
        if arm is None or needle is None:
            rospy.logerr(f"task_3_setup: the scene needs {TASK_3_ARM} and a body 'Needle'")
            return
        threading.Thread(target=self._bring_needle, args=(arm, needle), daemon=True).start()

    def _bring_needle(self, arm: _Psm, needle: int) -> None:
        arm.command("servo_jp", TASK_3_JOINTS)
        arm.jaw(TASK_3_OPEN)
        time.sleep(TASK_3_SECONDS["reach"])
        end = time.monotonic() + TASK_3_SECONDS["bring"]
        while time.monotonic() < end:
            poses = self._state["body_pose"]
            goal = matrix_pose7(pose7_matrix(poses[arm.description.tip]) @ TASK_3_GRASP)
            self._push(BodyCommand(needle, CommandType.POSITION, tuple(goal.tolist())))
            if np.linalg.norm(goal[:3] - poses[needle][:3]) < ARRIVED:
                break
            time.sleep(0.02)
        end = time.monotonic() + TASK_3_SECONDS["grasp"]
        while time.monotonic() < end:
            arm.jaw(0.0)
            time.sleep(0.01)
        self._push(Release("body", needle))
        self._ready.publish(Empty())


class _Psm:
    """One arm: six joint values that need no enabling, and a jaw that grasps."""

    def __init__(
        self,
        root: str,
        scene: Scene,
        index: int,
        description: ArmDescription,
        newest: Callable[[], Any],
        push: Callable[[Command], None],
    ) -> None:
        self.name, self.description = description.name, description
        self._index, self._newest, self._push, self._scene = index, newest, push, scene
        frames = scene.world.frame_prefix
        self._world, self._frame = f"{frames}world", f"{frames}{description.name.lower()}/baselink"
        joints = (*description.joints, *description.jaw)
        self._names = [scene.joints[joint].identity.name.replace(" ", "") for joint in joints]
        self._actuator = _near(scene.actuators, description.name)
        self._ghosts = [g.index for g in scene.ghosts if _belongs(g, description.name) and "finger" in g.identity.name]
        self._grasping = False
        self._measured_js = rospy.Publisher(f"{root}/measured_js", JointState, queue_size=QUEUE)
        self._measured_cp = rospy.Publisher(f"{root}/measured_cp", PoseStamped, queue_size=QUEUE)
        self._setpoint_cp = rospy.Publisher(f"{root}/setpoint_cp", PoseStamped, queue_size=QUEUE)
        self._base = rospy.Publisher(f"{root}/T_b_w", PoseStamped, queue_size=QUEUE)
        self._measured_cv = rospy.Publisher(f"{root}/measured_cv", TwistStamped, queue_size=QUEUE)
        for verb in ("servo_jp", "move_jp"):
            _listen(f"{root}/{verb}", JointState, partial(self._joints, verb))
        _listen(f"{root}/servo_jv", JointState, lambda m: self.command("servo_jv", tuple(m.velocity)))
        for verb in ("servo_cp", "servo_cr", "move_cp"):
            _listen(f"{root}/{verb}", PoseStamped, partial(self._pose, verb))
        _listen(f"{root}/jaw/servo_jp", JointState, self._jaw)

    def _joints(self, verb: str, message: Any) -> None:
        self.command(verb, tuple(message.position))

    def _pose(self, verb: str, message: Any) -> None:
        self.command(verb, _numbers(message.pose))

    def _jaw(self, message: Any) -> None:
        if not message.position:
            raise ValueError("jaw/servo_jp takes the angle of a finger, not an empty position")
        self.jaw(message.position[0])

    def command(self, verb: str, values: tuple[float, ...]) -> None:
        """Send a command, which the arm takes where it stands."""
        self._push(VERBS[f"direct/{verb}"](self._index, values))

    def jaw(self, value: float) -> None:
        """Both fingers to ``value``, which opens the jaw by twice that; holds what both feel when nearly closed."""
        self.command("jaw/servo_jp", (2.0 * value,))
        if self._actuator is None:
            return
        if value >= CLOSED:
            self._push(ActuatorCommand(self._actuator, False))
        elif not self._newest()["actuator_active"][self._actuator]:
            felt = self._felt()
            if felt:
                self._push(ActuatorCommand(self._actuator, True, felt))

    def _felt(self) -> str:
        """Identifier of the first body to grasp that either finger touches, or an empty text."""
        sensed = self._newest()["ghost_sensed"][self._ghosts].any(axis=0)
        felt = [self._scene.bodies[b].identity.identifier for b in np.flatnonzero(sensed)]
        for name in GRASPED:
            for identifier in felt:
                if name in identifier.rpartition("BODY ")[2]:
                    return identifier
        return ""

    def publish(self, state: Any, stamp: Any) -> None:
        """Publish six positions and velocities under eight names, as the challenge's node does."""
        record = state["arm"][self._index]
        position, velocity, _ = record["measured_js"][:, :6].tolist()
        message = JointState(name=self._names, position=position, velocity=velocity)
        message.header.stamp = stamp
        self._measured_js.publish(message)
        self._measured_cp.publish(_posed(self._frame, record["local_measured_cp"], stamp))
        self._setpoint_cp.publish(_posed(self._frame, record["local_setpoint_cp"], stamp))
        self._base.publish(_posed(self._world, state["body_pose"][self.description.base], stamp))


class _Camera:
    """The camera body, displaced from where the scene has it."""

    def __init__(self, root: str, scene: Scene, body: int, push: Callable[[Command], None]) -> None:
        self._body, self._push = body, push
        self._start = scene.bodies[body].T_world_body
        self._kinematics = SrcCamera()
        self._frame = f"{scene.world.frame_prefix}ecm/baselink"
        self._measured_js = rospy.Publisher(f"{root}/measured_js", JointState, queue_size=QUEUE)
        self._measured_cp = rospy.Publisher(f"{root}/measured_cp", PoseStamped, queue_size=QUEUE)
        _listen(f"{root}/servo_jp", JointState, self._servo_jp)

    def _servo_jp(self, message: Any) -> None:
        q = np.array(message.position, dtype=float)
        if len(q) != 4:
            raise ValueError(f"servo_jp takes 4 numbers, not {len(q)}")
        clipped = np.clip(q, self._kinematics.lower, self._kinematics.upper)
        pose = matrix_pose7(self._start @ self._kinematics.forward(clipped))
        self._push(BodyCommand(self._body, CommandType.POSITION, tuple(pose.tolist())))

    def publish(self, state: Any, stamp: Any) -> None:
        """Publish zeros for joints, and the camera's pose in the world, as the challenge's node does."""
        message = JointState(name=[f"j{i}" for i in range(4)], position=[0.0] * 4)
        message.header.stamp = stamp
        self._measured_js.publish(message)
        self._measured_cp.publish(_posed(self._frame, state["body_pose"][self._body], stamp))


def _listen(topic: str, type_: type, take: Callable[[Any], None]) -> None:
    def listen(message: Any) -> None:
        try:
            take(message)
        except ValueError as error:
            rospy.logwarn_throttle(REPEAT, f"{topic}: command rejected: {error}")

    rospy.Subscriber(topic, type_, listen, queue_size=10, tcp_nodelay=True)


def _belongs(item: Any, arm: str) -> bool:
    return f"/{arm.lower()}/" in item.identity.topic.lower()


def _near(actuators: Sequence[Any], arm: str) -> int | None:
    """The first actuator in the namespace of an arm."""
    return next((actuator.index for actuator in actuators if _belongs(actuator, arm)), None)


def _numbers(pose: Any) -> tuple[float, ...]:
    p, q = pose.position, pose.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def _posed(frame_id: str, values: Any, stamp: Any) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id, message.header.stamp = frame_id, stamp
    set_pose(message.pose, values)
    return message
