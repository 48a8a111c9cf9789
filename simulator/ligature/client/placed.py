"""Handles of cameras and lights, whose poses are in their parent's frame."""

from __future__ import annotations

from ambf_msgs.msg import CameraCmd, CameraState, LightCmd, LightState

from ligature.client.base_object import BaseObject


class _Placed(BaseObject):
    """An object with a commanded pose, which holds until the next command."""

    def _pose_commanded(self) -> None:
        self._cmd.enable_position_controller = True


class Camera(_Placed):
    """A camera."""

    State = CameraState
    Command = CameraCmd


class Light(_Placed):
    """A light."""

    State = LightState
    Command = LightCmd
