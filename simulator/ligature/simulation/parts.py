"""The subsystems of a simulation: each is made of those before it, and steps in its phase of the tick."""

from __future__ import annotations

from collections.abc import Callable

from ligature.arms import ArmSet
from ligature.grasping import ActuatorAttachments, ActuatorGrasps, Grasps
from ligature.model.commands import Command
from ligature.model.scene import Scene
from ligature.model.subsystem import Subsystem
from ligature.physics import Controllers, World
from ligature.physics.volumes import Volumes
from ligature.plugins import AfterStep, Host, Plugins
from ligature.sensing.actuators import Actuators
from ligature.sensing.contacts import Contacts
from ligature.sensing.ghosts import Ghosts
from ligature.sensing.mounts import Mounts
from ligature.sensing.rays import Rays
from ligature.sensing.targets import Targets
from ligature.sensing.touches import Touches
from ligature.simulation.clock import Clock
from ligature.soft import BeforeRods, Tissues
from ligature.suture import RodQueries, Suture


class Parts:
    """The subsystems of a simulation of ``scene`` with ticks of ``dt`` seconds.

    Parameters
    ----------
    clock
        Counts the ticks, for plug-ins.
    apply
        Takes commands of plug-ins.

    Attributes
    ----------
    phases
        What a tick does, phase by phase: all subsystems in the order of their steps.
    """

    def __init__(self, scene: Scene, dt: float, clock: Clock, apply: Callable[[Command], None]) -> None:
        self.world = World(scene, dt)
        self.suture = Suture(scene, self.world, dt)
        self.mounts = Mounts(scene)
        queries, rods = self.world.queries, self.suture.rods
        targets = Targets(self.world, queries, rods, RodQueries(rods, self.world))
        rays = Rays(scene, targets)
        self.touches = Touches(queries)
        self.arms = ArmSet(scene, self.world, dt)
        actuator_grasps = ActuatorGrasps(scene, self.world)
        self.actuators = Actuators(scene, ActuatorAttachments(scene, self.world, rods, actuator_grasps), rays)
        self.grasps = Grasps(scene, self.world, rods, actuator_grasps, lambda: self.actuators.held)
        self.tissues = Tissues(scene, self.world, rods, dt)
        volumes = Volumes(scene, self.world)
        host = Host(scene, dt, targets, self.world.joints.state, lambda: clock.tick, apply, volumes.of_body)
        self.plugins = Plugins(host)
        before_all, after_all = ((self.plugins,), (AfterStep(self.plugins),)) if scene.plugins else ((), ())
        before_rods, after_rods = ((BeforeRods(self.tissues),), (self.tissues,)) if scene.tissues else ((), ())
        self.phases: dict[str, tuple[Subsystem, ...]] = {
            "control": (*before_all, self.arms, self.actuators, rays, Controllers(self.world)),
            "suture": (*before_rods, self.suture, *after_rods, self.grasps),
            "bodies": (self.world, *((volumes,) if scene.volumes else ())),
            "sensing": (self.touches, self.mounts, Ghosts(scene, queries), Contacts(scene, targets), *after_all),
        }
