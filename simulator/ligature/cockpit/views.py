"""What browsers look at: the camera's picture that is chosen for all, and whether each shows it large or in 3D."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import ClientHandle

from ligature.cockpit.camera_panel import NO_PICTURES
from ligature.cockpit.hands import Sightline
from ligature.cockpit.orders import View
from ligature.cockpit.pictures import HEIGHT, Wish, sights
from ligature.model.scene import Scene

Array = NDArray[np.float64]

SMALL_VIEW = View(False, HEIGHT)
"""View of a browser that has not reported one yet."""


class Views:
    """The views of all browsers on ``scene``; ``state`` is the record that the page reads into."""

    def __init__(self, scene: Scene, state: Any) -> None:
        self._scene, self._state = scene, state
        self.sights = {sight.name: sight for sight in sights(scene)}
        self.chosen = next(iter(self.sights), NO_PICTURES)
        self._views: dict[int, View] = {}

    def report(self, client: int, view: View) -> None:
        """Keep the ``view`` that a browser reports."""
        self._views[client] = view

    @property
    def is_stereo(self) -> bool:
        """Whether the chosen picture is of a pair of cameras."""
        return self.chosen in self.sights and len(self.sights[self.chosen].eyes) > 1

    @property
    def camera(self) -> Sightline | None:
        """Line of sight of the camera whose picture is shown, of the first of two."""
        sight = self.sights.get(self.chosen)
        if sight is None:
            return None
        index = sight.eyes[0][0]
        return Sightline.of(self._scene.cameras[index], self._state["camera_world"][0, index])

    def of(self, client: ClientHandle) -> Sightline:
        """Line of sight of a browser: the camera's if its picture is large, else that of the 3D view."""
        if self._views.get(client.client_id, SMALL_VIEW).large and self.camera is not None:
            return self.camera
        try:
            return Sightline.browser(client.camera.wxyz)
        except AssertionError:  # a browser that has not shown anything yet
            return self.camera or Sightline(np.eye(3), np.zeros(3))

    def wish(self, clients: Collection[int]) -> Wish | None:
        """The picture to draw for the browsers: as large as the largest request."""
        sight = self.sights.get(self.chosen)
        self._views = {client: view for client, view in self._views.items() if client in clients}
        views = [self._views.get(client, SMALL_VIEW) for client in clients]
        seen = [view for view in views if view.height > 0]
        large = [view for view in seen if view.large]
        if sight is None or not seen:
            return None
        if large and not any(view.stereo for view in large):
            sight = sight.mono
        return Wish(sight, max([HEIGHT, *(view.height for view in large)]), bool(large))

    def aim(self, ends: tuple[Array, Array] | None) -> list[float] | None:
        """A way between two points (3,) in the camera's picture: from and to, then millimetres apart and in depth."""
        sight = self.camera
        if ends is None or sight is None:
            return None
        away, deeper = float(np.linalg.norm(ends[1] - ends[0])), sight.depth(ends[1]) - sight.depth(ends[0])
        places = np.concatenate([sight.place(end) for end in ends])
        shown = [*places.round(4).tolist(), round(1e3 * away, 1), round(1e3 * deeper, 1)]
        return shown if np.isfinite(places).all() else None
