"""Work in steps: a generator yields a status text and the share done after each step, and returns the result.

Scripts take all steps at once (`finished`). An operator that a user started takes some of them at a time (`InSteps`):
the status bar shows the text, the pointer the share, and Esc ends the work.
"""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from typing import TypeVar

import bpy

T = TypeVar("T")
Steps = Generator[tuple[str, float], None, T]
"""Yields a status text and a share, 0 to 1."""

FIRST, SLICE = 0.3, 0.1
"""Seconds of work before an operator first yields to the window, and between later yields."""

MADE = ("collections", "objects", "meshes", "materials", "images", "cameras", "lights", "curves", "scenes", "texts")
"""Kinds of data that are removed when work is ended early."""


def finished(steps: Steps[T]) -> T:
    """Take all steps, with the share at the pointer; returns their result."""
    manager, shown = bpy.context.window_manager, -1
    manager.progress_begin(0, 100)
    try:
        while True:
            percent = int(100.0 * next(steps)[1])
            if percent != shown:
                manager.progress_update(percent)
            shown = percent
    except StopIteration as end:
        return end.value
    finally:
        steps.close()
        manager.progress_end()


def part(steps: Steps[T], low: float, high: float) -> Steps[T]:
    """Steps that are a part of others, from the share ``low`` to ``high`` of the whole."""
    try:
        while True:
            words, share = next(steps)
            yield words, low + (high - low) * share
    except StopIteration as end:
        return end.value
    finally:
        steps.close()


@contextmanager
def all_or_nothing() -> Iterator[None]:
    """Take away what was made inside, when that fails or its steps are ended."""
    before = _existing()
    try:
        yield
    except BaseException:  # the end of a generator is none of `Exception`
        bpy.data.batch_remove(_existing() - before)
        raise


def _existing() -> set[bpy.types.ID]:
    return {item for name in MADE for item in getattr(bpy.data, name)}


class InSteps:
    """An operator whose work is ``steps(context)``; when a user started it, the work is done in slices.

    While it ``blocks``, all events but Esc are ignored, so that nobody edits what it works on.
    """

    can_end = True
    """Whether Esc still ends it and leaves everything as it was."""

    blocks = True
    asking = False
    _timer = None

    def started(self):
        """Whether a user started the operator and looks on."""
        return self.asking and not bpy.app.background

    def invoke(self, context, event):
        self.asking = True
        return self.execute(context)

    def execute(self, context):
        if not self.started():
            return finished(self.steps(context))
        self._work, self._began, self._words, self._share = self.steps(context), time.monotonic(), "", 0.0
        done = self._slice(FIRST)
        if done is None:
            manager = context.window_manager
            self._timer = manager.event_timer_add(0.02 if self.blocks else 0.1, window=context.window)
            manager.progress_begin(0, 100)
            manager.modal_handler_add(self)
            self._show(context)
            return {"RUNNING_MODAL"}
        self.asking = False  # another execution repeats it with other values
        return done

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS" and self.can_end:
            self.cancel(context)
            self.report({"WARNING"}, f"{self.bl_label} was ended; nothing changed")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"} if self.blocks else {"PASS_THROUGH"}
        try:
            done = self._slice(SLICE)
        except BaseException:
            self._end(context)
            raise
        if done is None:
            self._show(context)
            return {"RUNNING_MODAL"} if self.blocks else {"PASS_THROUGH"}
        self._end(context)
        return done

    def cancel(self, context):
        """End it: by Esc, or with the window."""
        self._work.close()
        self._end(context)

    def _slice(self, seconds):
        """Work for ``seconds``; the result of the operator when it has finished, else None."""
        until = time.monotonic() + seconds
        try:
            while True:
                self._words, self._share = next(self._work)
                if time.monotonic() > until or not self.blocks:
                    return None
        except StopIteration as end:
            return end.value

    def _show(self, context):
        context.window_manager.progress_update(100.0 * self._share)
        end = ". Esc ends it" if self.can_end else ""
        context.workspace.status_text_set(f"{self._words}, {time.monotonic() - self._began:.0f} s{end}")

    def _end(self, context):
        self.asking = False
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            context.window_manager.progress_end()
            context.workspace.status_text_set(None)
            self._timer = None
