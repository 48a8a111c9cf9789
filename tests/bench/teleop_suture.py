"""A suture by hands, over ROS alone: drivers of a haptic pen and of a Razer Hydra drive both arms through a throw.

``python -m tests.bench.teleop_suture``: the drivers publish what real ones do; who holds the devices plans as
``examples/suture.py``, and sees the needle, the arms and the set-up joints by their topics. Reach, grasp, lift, hand
over, drive through two holes, pull out; then ten clutches with the needle in the jaw, the pen over to the other arm
and back, the camera by both hands, and everything that a device can do wrong. Motions are paced by simulated time, so
that a busy machine only takes longer. Exit status 1 when a step fails or a figure is out of its bound.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import ligature
import numpy as np
from ligature.cli.master import master_answers
from ligature.model.frames import frame, inverse, pose7_matrix
from ligature.model.scene import ArmKind
from ligature.robots.fitting import psm_kinematics
from ligature.tasks.throws import NeedleArc
from numpy.typing import NDArray

from tests.ros.drivers import TIMEOUT, Driver, Paddle, Pen, apart, patiently, wait_for_listener
from tests.waiting import until

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples"))

import suture  # noqa: E402

Array = NDArray[np.float64]

SCALE = 0.5
JAW = (suture.SHUT, suture.OPEN)
CONFIG = f"""
camera: ECM
settings: {{scale: {SCALE}, max velocity: 1.0, timeout: 4.0, align: false, jaw: [{JAW[0]}, {JAW[1]}], jaw speed: 2.5}}
devices:
  pen: {{kind: touch, topic: /arm1/, buttons: {{grey: clutch, white: close}}}}
  paddle: {{kind: hydra, paddle: left, buttons: {{bumper: clutch}}}}
pairs:
  pen: [PSM1, PSM2]
  paddle: [PSM2, PSM1]
"""

BOUNDS = {
    "set-point from the ideal mapping, mm": 0.1,
    "set-point from the ideal mapping, °": 0.1,
    "free follower from the ideal mapping, mm": 0.1,
    "free follower from the ideal mapping, °": 0.1,
    "jump at a clutch, mm": 0.05,
    "jump at a clutch, °": 0.05,
    "jump at a switch, mm": 0.05,
    "hole to needle, mm": 1.0,
    "camera from the ideal mapping, mm": 0.5,
    "hold after a fault, ms": 100.0,
}
TOUCH = 0.02
"""Newtons on a tip from which on it counts as touching something."""

PUSH = 0.05
"""Newtons or newton metres of a drive from which on an arm that stands pushes something, if only with its shaft: no
gravity acts on the arms, so that the drives of one that is free have nothing to do."""

FREE_RESTS = 10
"""Rests in the air that a run must have at least, for its figures to mean something."""

REST = 0.5
"""Simulated seconds after which an arm that has its last set-point stands."""

SLOW = 0.04
"""Metres per second of a tip on its way."""


class Arm:
    """An arm as its CRTK topics report it: set-point and measured pose (4, 4) in its base."""

    def __init__(self, rospy: Any, name: str) -> None:
        from geometry_msgs.msg import PoseStamped, WrenchStamped
        from sensor_msgs.msg import JointState

        from tests.ros.crtk import Latest

        self.name = name
        self._heard = {
            topic: Latest(rospy, f"/{name}/{topic}", PoseStamped) for topic in ("setpoint_cp", "local/measured_cp")
        }
        self._jaw = Latest(rospy, f"/{name}/jaw/setpoint_js", JointState)
        self._force = Latest(rospy, f"/{name}/body/measured_cf", WrenchStamped)
        self._joints = Latest(rospy, f"/{name}/measured_js", JointState)
        self.setpoints: list[tuple[float, Array]] | None = None
        rospy.Subscriber(f"/{name}/setpoint_cp", PoseStamped, self._keep, queue_size=100, tcp_nodelay=True)

    def _keep(self, message: Any) -> None:
        if self.setpoints is not None:
            p = message.pose.position
            self.setpoints.append((time.monotonic(), np.array([p.x, p.y, p.z])))

    def _pose(self, topic: str) -> Array:
        from tests.ros.crtk import pose7

        return pose7_matrix(pose7(patiently(self._heard[topic].fresh).pose))

    def setpoint(self) -> Array:
        return self._pose("setpoint_cp")

    def measured(self) -> Array:
        return self._pose("local/measured_cp")

    def jaw(self) -> float:
        return float(patiently(self._jaw.fresh).position[0])

    def force(self) -> float:
        """What the tip touches pushes it with, in N."""
        f = patiently(self._force.fresh).wrench.force
        return float(np.linalg.norm([f.x, f.y, f.z]))

    def effort(self) -> float:
        """What the drive does with the largest effort, in N or N m."""
        return float(np.abs(patiently(self._joints.fresh).effort).max())


class Hand:
    """A hand on a device that drives an arm; what the mapping should make of it is computed here, by itself."""

    def __init__(self, driver: Driver, device: str, rospy: Any) -> None:
        from std_msgs.msg import Bool, String

        from tests.ros.conftest import Listener

        self.driver, self.device = driver, device
        self.heard = {
            name: (
                Listener(rospy, f"/{device}_{name}/following", Bool),
                Listener(rospy, f"/{device}_{name}/status", String),
            )
            for name in ("PSM1", "PSM2")
        }
        self.closed = False

    def squeeze(self, closed: bool, grey: bool = False) -> None:
        self.closed = closed
        if isinstance(self.driver, Pen):
            self.driver.press(int(grey), int(closed))
        elif isinstance(self.driver, Paddle):
            self.driver.grip = float(closed)
            self.driver.buttons[0] = grey

    def follows(self, name: str) -> bool:
        messages = self.heard[name][0].messages
        return bool(messages and messages[-1].data)

    def status(self, name: str) -> str:
        messages = self.heard[name][1].messages
        return messages[-1].data if messages else "nothing"

    def take(self, arm: Arm, T_base_view: Array) -> None:
        """Drive an arm from now on, from where both are: the hand rests."""
        until(lambda: self.follows(arm.name), lambda: f"{self.device} does not drive: {self.status(arm.name)}", 60.0)
        self.arm, self._T_base_view = arm, T_base_view
        self._hand, self._tip = self.driver.T.copy(), inverse(T_base_view) @ arm.setpoint()

    def reach(self, T_base_tip: Array) -> None:
        """Hold the device so that the tip should be there."""
        T, A = inverse(self._T_base_view) @ T_base_tip, self.driver.AXES
        R = A.T @ T[:3, :3] @ self._tip[:3, :3].T @ A @ self._hand[:3, :3]
        self.driver.T = frame(R, self._hand[:3, 3] + A.T @ (T[:3, 3] - self._tip[:3, 3]) / SCALE)

    def ideal(self) -> Array:
        """Where the tip should be (4, 4), in its base."""
        A, T = self.driver.AXES, self.driver.T
        R = A @ T[:3, :3] @ self._hand[:3, :3].T @ A.T @ self._tip[:3, :3]
        return self._T_base_view @ frame(R, self._tip[:3, 3] + SCALE * A @ (T[:3, 3] - self._hand[:3, 3]))

    def clutch(self, pressed: bool) -> None:
        self.squeeze(self.closed, pressed)
        until(lambda: self.follows(self.arm.name) is not pressed, lambda: self.status(self.arm.name))
        time.sleep(0.05)


class Operator(suture.Surgeon):
    """The example's surgeon, who has devices in the hands and no simulator."""

    def __init__(self, rospy: Any) -> None:
        from ambf_msgs.msg import RigidBodyState
        from geometry_msgs.msg import PoseStamped

        from tests.ros.crtk import Latest, pose7

        self._scene = scene = ligature.load(suture.SCENE)
        found = scene.needles[0]
        topic = scene.bodies[found.body].identity.topic
        self._seen = Latest(rospy, f"{topic}/State", RigidBodyState)
        self.arc = NeedleArc.of(found, scene.bodies[found.body])
        reported = [arm for arm in scene.arms if arm.kind is ArmKind.PSM]
        self._base = {arm.name: scene.bodies[arm.base].T_world_body for arm in reported}
        self.arms: Any = {arm.name: Kinematic(psm_kinematics(scene, arm)[0]) for arm in reported}
        self.psms = {arm.name: Arm(rospy, arm.name) for arm in reported}
        self.ecm = Latest(rospy, "/ECM/measured_cp", PoseStamped)
        bases = {name: Latest(rospy, f"/SUJ/{name}/local/measured_cp", PoseStamped) for name in (*self._base, "ECM")}
        hands = {"PSM1": Hand(Pen(rospy), "pen", rospy), "PSM2": Hand(Paddle(rospy), "paddle", rospy)}
        self.pen, self.paddle = hands["PSM1"], hands["PSM2"]
        self.hands = hands
        self._T_base_view: dict[str, Array] = {}

        def view(name: str) -> Array:
            T_base, T_ecm = (pose7_matrix(pose7(patiently(bases[each].fresh).pose)) for each in (name, "ECM"))
            return np.asarray(inverse(T_base) @ T_ecm @ self.camera())

        self.view: Callable[[str], Array] = view
        self.figures: dict[str, float] = dict.fromkeys(BOUNDS, 0.0)
        self.free, self.leaning = 0, []

    # --- seeing

    def now(self) -> float:
        """Simulated seconds."""
        return float(patiently(self._seen.fresh).sim_time)

    def camera(self) -> Array:
        from tests.ros.crtk import pose7

        return pose7_matrix(pose7(patiently(self.ecm.fresh).pose))

    def needle(self) -> Array:
        from tests.ros.crtk import pose7

        return np.asarray(pose7_matrix(pose7(patiently(self._seen.fresh).pose)) @ self.arc.T_body_arc)

    def tool(self, name: str) -> Array:
        return np.asarray(self._base[name] @ self.psms[name].measured())

    def hole(self, side: str, pair: int) -> Array:
        body = next(b for b in self._scene.bodies if b.identity.topic.endswith(f"/{side}{pair}"))
        return np.asarray(body.T_world_body[:3, 3])

    def ends(self, pair: int) -> tuple[Array, Array]:
        return self.hole("Entry", pair), self.hole("Exit", pair)

    def holds(self, name: str) -> bool:
        """Whether the needle goes along when the tool does: seen at the next lift."""
        return True

    # --- moving

    def wait(self, seconds: float) -> None:
        end = self.now() + seconds
        until(lambda: self.now() >= end, "simulated time stands still", 60.0 + 60.0 * seconds)

    def glide(self, name: str, poses: Iterator[Array]) -> None:
        hand, way, begin = self.hands[name], list(poses), self.now()
        reached = -1
        while reached < len(way) - 1:
            index = min(int((self.now() - begin) / suture.STREAM), len(way) - 1)
            if index > reached:
                hand.reach(inverse(self._base[name]) @ way[index])
                reached = index
            if not hand.follows(name):
                raise suture.Failure(f"{hand.device} stopped driving {name}: {hand.status(name)}")
            time.sleep(0.005)
        self.judge(name)

    def move(self, name: str, T_world_tool: Array) -> None:
        self.line(name, T_world_tool, SLOW)

    def judge(self, name: str) -> None:
        """Note how far the arm is from the ideal mapping once it has come to rest.

        One that touches something may lean on it: with its tip, which its force reports, or with its shaft on the other
        arm's, which its drives report.
        """
        hand, arm = self.hands[name], self.psms[name]
        ideal, asked = hand.ideal(), (np.inf, np.inf)
        end = time.monotonic() + TIMEOUT
        while max(asked) > 1e-3 and time.monotonic() < end:
            asked = apart(arm.setpoint(), ideal)
            time.sleep(0.01)
        self.wait(REST)
        there, force, effort = apart(arm.measured(), ideal), arm.force(), arm.effort()
        self.note("set-point from the ideal mapping, mm", asked[0])
        self.note("set-point from the ideal mapping, °", asked[1])
        if force < TOUCH and effort < PUSH:
            self.free += 1
            self.note("free follower from the ideal mapping, mm", there[0])
            self.note("free follower from the ideal mapping, °", there[1])
        else:
            self.leaning.append(
                f"{name} {there[0]:.2f} mm and {there[1]:.2f}° with {force:.1f} N on the tip, drives at {effort:.1f}"
            )

    def jaw(self, name: str, angle: float, seconds: float = 0.3) -> None:
        closed = angle < 0.0
        self.hands[name].squeeze(closed)
        until(lambda: abs(self.psms[name].jaw() - JAW[not closed]) < 0.01, f"the jaw of {name} does not move", 60.0)
        self.wait(0.2)

    def prepare(self) -> None:
        for name, hand in self.hands.items():
            hand.take(self.psms[name], self.view(name))

    # --- what is shown

    def note(self, figure: str, value: float) -> None:
        self.figures[figure] = max(self.figures[figure], float(value))

    def done(self, step: str) -> None:
        sys.stdout.write(f"  {step}\n")
        sys.stdout.flush()

    def in_hand(self, name: str) -> Array:
        """The needle in the tool (4, 4)."""
        return np.asarray(inverse(self.tool(name)) @ self.needle())

    def suture_once(self) -> None:
        """The example's throw through the first pair of holes, looked at after each step."""
        driver, puller, throw = "PSM2", "PSM1", self.throw(1)
        height = self.needle()[2, 3]
        self.pick_up(puller, throw)
        lifted = self.needle()[2, 3] - height
        assert lifted > 0.01, f"the needle was lifted by {1e3 * lifted:.1f} mm only"
        self.done(f"reached, grasped, and lifted by {1e3 * lifted:.0f} mm with the pen")
        self.hand_over(puller, driver, throw)
        grasp = self.in_hand(driver)
        self.done("handed over to the arm of the Hydra")
        self.drive(driver, throw)
        for side in ("Entry", "Exit"):
            self.note("hole to needle, mm", 1e3 * self.off_the_needle(self.hole(side, 1)))
        slipped = apart(self.in_hand(driver), grasp)
        self.done(f"driven in at Entry1 and out at Exit1; it slipped by {slipped[0]:.1f} mm in the jaw")
        self.pull_out(puller, driver, throw)
        out = self.needle()[2, 3] - self.hole("Exit", 1)[2]
        assert out > 0.01, f"the needle came out by {1e3 * out:.1f} mm only"
        self.done("pulled out with the pen")

    def off_the_needle(self, place: Array) -> float:
        """Metres from a point to the needle's arc; infinite beyond its ends."""
        local = inverse(self.needle()) @ np.append(place, 1.0)
        angle = np.arctan2(local[1], local[0])
        if not self.arc.begin < angle < self.arc.end:
            return np.inf
        return float(np.hypot(np.hypot(local[0], local[1]) - self.arc.radius, local[2]))

    def clutches(self) -> None:
        """Ten times: clutch, move the hand, let go."""
        arm = self.psms["PSM1"]
        for k in range(10):
            self.wait(0.2)
            before = arm.measured()
            self.pen.clutch(True)
            self.pen.driver.glide((0.02, -0.01, 0.01), (0.0, 0.1, 0.05 * (k - 5)), seconds=0.2)
            self.pen.clutch(False)
            self.wait(0.2)
            for figure, value in zip(("mm", "°"), apart(arm.measured(), before), strict=True):
                self.note(f"jump at a clutch, {figure}", value)
        self.pen.take(arm, self.view("PSM1"))
        self.done("clutched ten times with the needle in the jaw")

    def switch(self, rospy: Any) -> None:
        """The pen drives the other arm, and then its own again."""
        from std_msgs.msg import String

        to = {
            word: wait_for_listener(rospy.Publisher(f"/console/teleop/{word}", String, queue_size=10), 2)
            for word in ("select", "unselect")
        }
        before = {name: arm.measured() for name, arm in self.psms.items()}
        to["unselect"].publish("paddle_PSM2")
        until(lambda: not self.paddle.follows("PSM2"), "the paddle does not let go")
        self.pen.squeeze(False)
        to["select"].publish("pen_PSM2")
        self.pen.take(self.psms["PSM2"], self.view("PSM2"))
        self.wait(0.2)
        for name, arm in self.psms.items():
            self.note("jump at a switch, mm", apart(arm.measured(), before[name])[0])
        self.hands["PSM2"] = self.pen
        up = frame(np.eye(3), (0.0, 0.0, 0.01))
        self.line("PSM2", up @ self.tool("PSM2"))
        self.pen.squeeze(True)
        to["select"].publish("pen_PSM1")
        to["select"].publish("paddle_PSM2")
        self.pen.take(self.psms["PSM1"], self.view("PSM1"))
        self.hands["PSM2"] = self.paddle
        self.paddle.take(self.psms["PSM2"], self.view("PSM2"))
        self.line("PSM1", up @ self.tool("PSM1"))
        held = self.needle()
        self.wait(0.3)
        assert apart(held, self.needle())[0] < 0.5, "the needle was dropped"
        self.done("the pen drove PSM2 and then PSM1 again, which held the needle")

    def drive_camera(self, rospy: Any) -> None:
        """Both hands pull the scene near while the pedal is pressed."""
        from sensor_msgs.msg import Joy
        from std_msgs.msg import Bool

        from tests.ros.conftest import Listener

        pedal = wait_for_listener(rospy.Publisher("/console/camera", Joy, queue_size=10))
        follows = Listener(rospy, "/pen_paddle_ECM/following", Bool)
        before = {name: arm.measured() for name, arm in self.psms.items()}
        camera = self.camera()
        pedal.publish(Joy(buttons=[1]))
        follows.wait(lambda m: m.data, 60.0)
        way = np.array([0.0, 0.0, -0.02])  # in the picture: the scene comes near
        for _ in range(40):
            for hand in (self.pen, self.paddle):
                hand.driver.T = frame(hand.driver.T[:3, :3], hand.driver.T[:3, 3] + hand.driver.AXES.T @ way / 40)
            time.sleep(0.01)
        ideal = camera @ frame(np.eye(3), -way)
        self.wait(1.0)
        self.note("camera from the ideal mapping, mm", apart(self.camera(), ideal)[0])
        pedal.publish(Joy(buttons=[0]))
        for name, hand in self.hands.items():
            hand.take(self.psms[name], self.view(name))
            self.note("jump at a clutch, mm", apart(self.psms[name].measured(), before[name])[0])
        self.done("both hands moved the camera by 20 mm")

    def faults(self, rospy: Any) -> None:
        """What goes wrong while the pen moves: how long the arm goes on."""
        from std_msgs.msg import String

        select = wait_for_listener(rospy.Publisher("/console/teleop/select", String, queue_size=10), 2)

        def mute() -> None:
            self.pen.driver.muted = True

        def sends(*values: float) -> Callable[[], None]:
            def act() -> None:
                self.pen.driver.sent = np.array(values)

            return act

        cases: dict[str, tuple[Callable[[], None], str]] = {
            "silence": (mute, "silent"),
            "a leap": (sends(5, 5, 5, 0, 0, 0, 1), "leapt"),
            "NaN": (sends(np.nan, 0, 0, 0, 0, 0, 1), "invalid poses"),
            "a quaternion of zeros": (sends(0, 0, 0, 0, 0, 0, 0), "invalid poses"),
            "a rival": (lambda: select.publish("paddle_PSM1"), "claims"),
        }
        for what, (act, word) in cases.items():
            took = self.fault(act, word)
            self.note("hold after a fault, ms", took)
            self.done(f"{what}: the arm holds after {took:.0f} ms, and the status states '{self.pen.status('PSM1')}'")
            self.pen.driver.muted, self.pen.driver.sent = False, None
            time.sleep(0.1)
            self.pen.squeeze(True, grey=True)
            time.sleep(0.3)
            self.pen.squeeze(True)
            self.pen.take(self.psms["PSM1"], self.view("PSM1"))
        assert self.paddle.follows("PSM2"), self.paddle.status("PSM2")

    def fault(self, act: Callable[[], None], word: str) -> float:
        """Milliseconds from when something goes wrong in a motion to the last change of the arm's set-point."""
        arm, driver = self.psms["PSM1"], self.pen.driver
        arm.setpoints = []
        step = driver.AXES.T @ np.array([0.0, -0.0005, 0.0])  # 50 mm/s up in the picture
        struck = np.inf
        for k in range(80):
            if k == 20:
                struck = time.monotonic()
                act()
            driver.T = frame(driver.T[:3, :3], driver.T[:3, 3] + (step if k < 20 else -step / 3.0))
            time.sleep(0.01)
        until(lambda: word in self.pen.status("PSM1"), lambda: self.pen.status("PSM1"))
        reported, arm.setpoints = arm.setpoints, None
        last = reported[-1][1]
        changed = [t for t, p in reported if np.linalg.norm(p - last) > 1e-6]
        return 1e3 * max(0.0, changed[-1] - struck) if changed else np.inf


class Kinematic:
    """What the example's plan asks an arm for."""

    def __init__(self, kinematics: Any) -> None:
        self.kinematics = kinematics


def operate() -> dict[str, float]:
    """Do everything, of a simulator and a teleoperation that run; returns the figures."""
    import rospy

    rospy.init_node("operator", anonymous=True, disable_signals=True)
    operator = Operator(rospy)
    operator.prepare()
    operator.suture_once()
    operator.clutches()
    operator.switch(rospy)
    operator.drive_camera(rospy)
    operator.faults(rospy)
    sys.stdout.write(
        f"{operator.free} rests in the air; leaning on something: {', '.join(operator.leaning) or 'none'}\n"
    )
    assert operator.free >= FREE_RESTS, f"only {operator.free} rests in the air, where {FREE_RESTS} should be judged"
    return operator.figures


def main() -> int:
    """Entry point."""
    port = 12100 + os.getpid() % 90
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1")
    command = Path(sys.executable).parent / "ligature"
    run = (command, "run", suture.SCENE, "-p", "500", "--min-hz", "100", "--no-cameras")
    began = time.monotonic()
    programs = [subprocess.Popen(run, stdout=subprocess.DEVNULL)]
    try:
        until(lambda: master_answers(os.environ["ROS_MASTER_URI"]), "the ROS master answers", 60.0)
        with tempfile.TemporaryDirectory() as folder:
            config = Path(folder) / "teleop.yaml"
            config.write_text(CONFIG)
            programs.append(subprocess.Popen((command, "teleop", config), stdout=subprocess.DEVNULL))
            figures = operate()
    except (AssertionError, TimeoutError, suture.Failure) as error:
        sys.stdout.write(f"stopped: {error}\n")
        return 1
    finally:
        for program in reversed(programs):
            program.terminate()
            program.wait()
    sys.stdout.writelines(f"{name}: {value:.3f}, at most {BOUNDS[name]:g}\n" for name, value in figures.items())
    load = os.getloadavg()[0]
    sys.stdout.write(f"took {time.monotonic() - began:.0f} s at a load of {load:.1f} on {os.cpu_count()} cores\n")
    return int(any(not value <= BOUNDS[name] for name, value in figures.items()))


if __name__ == "__main__":
    sys.exit(main())
