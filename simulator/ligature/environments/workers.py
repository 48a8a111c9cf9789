"""Work shared among processes of this Python, which import nothing from the working folder, as `program` starts them.

Those of ``multiprocessing`` and ``concurrent.futures`` look for Python's own modules there before they do anything.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any

from ligature.process import end_with_parent, ending, program


class WorkerEndedError(RuntimeError):
    """A process ended before its work was done."""


class _Worker:
    """A process that is sent the paths of modules, a function, and then jobs for it."""

    def __init__(self) -> None:
        self.pipe, theirs = Pipe()
        words = program(__name__, str(os.getpid()), str(theirs.fileno()))
        # born with the interrupt blocked, which a terminal sends to all: it is the parent's
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        try:
            self._process = subprocess.Popen(words, pass_fds=(theirs.fileno(),), stdin=subprocess.DEVNULL)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            theirs.close()

    def send(self, sent: Any) -> None:
        """Send what comes next; WorkerEndedError says how the process ended."""
        try:
            self.pipe.send(sent)
        except OSError as error:
            raise self._ended() from error

    def result(self) -> Any:
        """What the job returned; raises what it raised, or WorkerEndedError."""
        try:
            result, error, report = self.pipe.recv()
        except (EOFError, OSError) as shut:
            raise self._ended() from shut
        if error is not None:
            raise error from RuntimeError(report)
        return result

    def close(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._process.wait()
        self.pipe.close()

    def _ended(self) -> WorkerEndedError:
        how = ending(self._process.wait())
        return WorkerEndedError(f"process {self._process.pid}, one of those that share the work, {how}")


def results(function: Callable[[Any], Any], jobs: Sequence[Any], count: int) -> Iterator[Any]:
    """What ``function``, of a module, returns for each of ``jobs``, in their order, from up to ``count`` processes."""
    left, done = iter(enumerate(jobs)), {}
    with ExitStack() as stack:
        busy: dict[Connection, tuple[_Worker, int]] = {}
        for (number, job), _ in zip(left, range(min(count, len(jobs))), strict=False):
            worker = _Worker()
            stack.callback(worker.close)
            for sent in (sys.path, function, job):
                worker.send(sent)
            busy[worker.pipe] = worker, number
        for due in range(len(jobs)):
            while due not in done:
                for pipe in wait(list(busy)):
                    worker, number = busy.pop(pipe)  # type: ignore[arg-type]
                    done[number] = worker.result()
                    if (following := next(left, None)) is not None:
                        worker.send(following[1])
                        busy[worker.pipe] = worker, following[0]
            yield done.pop(due)


def main() -> None:
    """Work for the parent whose number is the first argument, through the pipe that is the second."""
    end_with_parent(int(sys.argv[1]))
    pipe = Connection(int(sys.argv[2]))
    sys.path[:] = pipe.recv()
    function = pipe.recv()
    while True:
        try:
            job = pipe.recv()
        except EOFError:
            return
        try:
            answer: tuple[Any, Exception | None, str] = function(job), None, ""
        except Exception as error:
            answer = None, error, traceback.format_exc()
        try:
            pipe.send(answer)
        except OSError:  # the parent has enough
            return
