"""`ligature.Simulation`: the simulation with cameras.

Cameras read the simulation's state, and `ligature.simulation` knows nothing of them.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from ligature import simulation
from ligature.model.handles import Handles

if TYPE_CHECKING:
    from ligature.render.cameras import CameraHandle, Studio
    from ligature.render.look import Look


class Simulation(simulation.Simulation):
    """A running scene (`ligature.simulation.Simulation`) with cameras.

    OpenGL is loaded when ``cameras`` is used for the first time, and a context is made at the first picture.
    """

    _studio: Studio | None = None

    @cached_property
    def cameras(self) -> Handles[CameraHandle]:
        """Cameras of the scene by name; raises ImportError when OpenGL's Python package is missing."""
        from ligature.render.cameras import Studio, camera_handles

        self._studio = Studio(self)
        return camera_handles(self._studio)

    def change_look(self, look: Look) -> None:
        """Have lights and bodies look otherwise in all pictures from now on.

        Raises ImportError as `cameras` does, TypeError for anything but a look.
        """
        _ = self.cameras
        from ligature.render.look import Look

        if not isinstance(look, Look):
            raise TypeError(f"change_look takes a ligature.render.look.Look, not {look!r}")
        assert self._studio is not None
        self._studio.change_look(look)

    def close(self) -> None:
        """Release the physics engine and OpenGL; the simulation can neither step nor draw after this."""
        if self._studio is not None:
            self._studio.close()
        super().close()
