"""Two arms make one whole throw of a suture: one drives the needle, the other pulls it and its thread through.

World axes, metres, radians, simulated seconds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals.base import EARLY, HOLD, LOST, REGRASP, UNDONE, Dwell, Progress, aside, base_of, put
from ligature.environments.goals.driving import Insert
from ligature.environments.goals.seams import Pulled, Seam
from ligature.model.frames import frame
from ligature.tasks.throws import UP, best_grasp

Array = NDArray[np.float64]

DRIVER, PULLER = 0, 1


class Suture(Insert):
    """One throw of a suture with two arms, from the needle in the first arm's jaws before the entry.

    The first arm drives the needle through entry and exit, as in `Insert`. The second arm grasps it near its tip, the
    first releases it, and the second pulls out the rest of the needle and 30 mm of thread. The task is done when these
    steps have happened in this order, and only the second arm has held the needle for the last 0.5 s, with the thread
    through both holes. It is lost when no arm holds the needle (for 2 s while it is in tissue), or when neither needle
    nor thread is in the exit any more.
    """

    text = "drive the needle through the tissue, take it with the other arm, and pull its thread through"
    scene, arms, models, steps = "suturing", ("PSM2", "PSM1"), (0, 1, 2, 3, 4, 5), 400
    LENGTH, MORE = 0.03, 0.2
    TAKE, RELEASE = 0.02, 0.02
    """What is left, in metres, until the puller holds the needle, and until the driver no longer does."""
    ENDS = (0.0018, 0.0022, 0.0026)
    """Metres from the needle's tip at which the puller may hold it."""
    MORE_OUT, RAISED = 0.3, 0.04
    """Angle by which all of the needle is drawn beyond the exit; metres that it is then raised at least."""
    WAITING = (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)
    """Joint values of the puller as an episode begins, drawn back from the driver."""
    ASIDE = 0.01
    _KEPT = (*Insert._KEPT, "_driven", "_taken", "_alone", "_done_for", "_nobody", "_drawn")

    def _prepare(self) -> None:
        """Find how the puller holds the needle to draw it out."""
        super()._prepare()
        self._seam = Seam.of(self._simulation, self.scenery, self.arc)
        puller, base = self._arms[PULLER], base_of(self._simulation, self._arms[PULLER])
        out = [self.throw.arc_at(float(a), self.arc) for a in np.linspace(self._last, self.out, 10)]
        way = [*out, frame(np.eye(3), self.RAISED * UP) @ out[-1]]
        grasp = best_grasp(self.arc, self.ENDS, puller.kinematics, base, way, out[0], self._places[0])
        if grasp is None:
            raise ValueError(f"{puller.name} cannot grasp the needle so that it could pull it out")
        self.T_arc_puller = grasp.tool_in_arc(self.arc)
        self._end = self.arc.point(grasp.depth)

    @property
    def last(self) -> float:
        """The angle of the tip past the entry to which the driver is to turn the needle."""
        return self._last

    @property
    def out(self) -> float:
        """The same once all of the needle is beyond the exit."""
        return self.throw.towards_exit + self.arc.end - self.arc.begin + self.MORE_OUT

    @property
    def driven(self) -> bool:
        """Whether the driver has driven the needle through, as far as `Insert` asks for."""
        return bool(self._driven)

    @property
    def taken(self) -> bool:
        """Whether the puller alone has had the needle since."""
        return bool(self._taken)

    def pulled(self) -> Pulled:
        """What is through the holes now."""
        return self._seam.look()

    def settle(self, start: int = 0) -> None:
        """The needle in the driver's jaws before the entry, the puller drawn back."""
        puller = self._arms[PULLER]
        puller.place_jp(self.WAITING)
        puller.adopt()
        super().settle()

    def begin(self, rng: np.random.Generator) -> None:
        """Both hands a little elsewhere, the driver's turned otherwise."""
        puller = self._arms[PULLER]
        put(puller, aside(puller, rng, self.ASIDE, 0.0))
        super().begin(rng)
        self._driven, self._taken, self._done_for, self._drawn = False, False, 0.0, 0.0
        self._alone, self._nobody = Dwell(), Dwell()

    def place(self) -> Array:
        """The place (3,) of the needle at which the puller is to hold it."""
        T = self._pose(self.body) @ self.arc.T_body_arc
        return np.asarray(T[:3, :3] @ self._end + T[:3, 3])

    def target(self) -> Array:
        """Where the tip should be next; once it is out at the exit, where the needle is to be taken and then drawn."""
        if not self._driven:
            return super().target()
        if not self.holds(PULLER):
            return self.place()
        return np.asarray(self._places[1] + (self.LENGTH + 2.0 * self.arc.radius) * UP)

    def observe(self) -> Progress:
        """What is left to drive, to take, to let go and to pull, in metres."""
        far = 0.2 * float(np.linalg.norm(self._tip(PULLER) - self.place()))
        if not self._driven:
            drive = super().observe()
            self._driven = drive.done
            if not drive.done:
                after = self.TAKE + self.RELEASE + self.arc.length + self.LENGTH
                return Progress(drive.left + far + after, lost=drive.lost)
        now, pulled = self._simulation.time, self.pulled()
        self._held, held = self.holds(DRIVER), self.holds(PULLER)
        alone = held and self._simulation.grasps[self._arms[DRIVER].name] is None
        self._taken = self._taken or (alone and pulled.needle_inside)
        self._drawn = pulled.drawn
        through = alone and self._taken and pulled.drawn >= self.LENGTH
        self._done_for = self._alone.observe(through, now)
        if self._done_for >= HOLD - EARLY:
            return Progress(0.0, True)
        left = max(self.arc.length + self.LENGTH - pulled.beyond, 0.0) + UNDONE
        left += self.RELEASE * (not self._taken) + (0.0 if held else self.TAKE + far)
        free = self._nobody.observe(not self._held and not held, now)
        if not pulled.exit_filled:
            return Progress(left, lost="needle and thread are no longer in the exit")
        dropped = free >= (REGRASP if pulled.needle_inside else LOST) - EARLY
        return Progress(left, lost="the needle was dropped" if dropped else "")

    def marks(self) -> Array:
        """Whether the driver holds the needle, the share of the time that it or then the puller must, the stage.

        The stage is a quarter each for the entry and the exit passed, for the needle driven and for it taken.
        """
        time = self._done_for if self._driven else self._kept
        stage = 1.0 if self._driven else self._stage
        return np.array([self._held, min(time / HOLD, 1.0), 0.5 * stage + 0.25 * (self._driven + self._taken)])
