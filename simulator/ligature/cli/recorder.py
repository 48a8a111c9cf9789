"""Records a run: all of it for ``--record``, and parts of it on request.

A part cannot be simulated again without what was before it. With a page, where one may ask, every command is kept from
the beginning on for that: in the file of ``--record``, else in one without a name that ends with the run.
"""

from __future__ import annotations

import sys
import tempfile
import threading
from collections import deque
from pathlib import Path

from ligature.bus import Block, Recording
from ligature.bus.events import RUN
from ligature.bus.record import Excerpt, Header, Journal, Moment, RecordWriter
from ligature.bus.recording import file_name
from ligature.cli.options import RunOptions
from ligature.model.commands import Command
from ligature.paths import reason
from ligature.process import report
from ligature.simulation import Simulation

FOLDER = Path("recordings")
"""Folder of recordings that are requested by name."""

EVENT = "recording"


class Recorder:
    """Takes every command of a run in the order in which the simulation takes them, with the number of updates before.

    Begins after the first update. Raises SystemExit when the run shall have a record and cannot have one.
    """

    def __init__(self, options: RunOptions, simulation: Simulation, block: Block) -> None:
        self._simulation, self._block = simulation, block
        self._writer: RecordWriter | None = None
        self._journal: Journal | None = None
        self._excerpt: Excerpt | None = None
        self._since = 0.0
        self._copying: list[threading.Thread] = []
        self._copied: deque[tuple[str, bool]] = deque()
        self._why_not = "the run was started without --cockpit and without --record"
        header = Header(options.to_text(), simulation.state_hash())
        if options.record:
            self._begin_record(Path(options.record), header)
        elif options.cockpit:
            try:
                self._journal = Journal(tempfile.TemporaryFile(dir="."), header)  # noqa: SIM115 (open while it runs)
            except OSError as error:
                self._why_not = f"{reason(error)}: '{Path.cwd()}'"

    def _begin_record(self, path: Path, header: Header) -> None:
        try:
            self._journal = self._writer = RecordWriter(path, header)
        except OSError as error:
            report("error", f"cannot record the run: {reason(error)}: '{path}'")
            sys.exit(1)

    # --- while the run goes on ------------------------------------------------------------------

    def note(self, update: int, command: Command) -> None:
        """Write down what is about to be taken."""
        if self._journal is not None:
            try:
                self._journal.write(update, command)
            except OSError as error:
                self._give_up(error)

    def flush(self) -> None:
        """Hand what was written to the disk, and report what was copied, at most once a second."""
        while self._copied:
            self._report(*self._copied.popleft())
        if self._journal is not None:
            try:
                self._journal.flush()
            except OSError as error:
                self._give_up(error)

    def obey(self, update: int, recording: Recording) -> None:
        """Begin a recording, or end the present one."""
        name = file_name(recording.name)
        if name and self._excerpt is not None:
            self._report(f"'{self._excerpt.path}' is being recorded already", True)
        elif name:
            self._begin(update, FOLDER / name)
        elif self._excerpt is not None:
            self._end(update)

    def end(self, update: int) -> None:
        """The run is over: records get their ends and their names."""
        if self._excerpt is not None:
            self._end(update)
        for thread in self._copying:
            thread.join()
        self.flush()
        if self._writer is not None:
            try:
                self._writer.finish(update, self._simulation.state_hash())
            except OSError as error:
                self._give_up(error)
        elif self._journal is not None:
            self._journal.close()

    # --- parts ----------------------------------------------------------------------------------

    def _begin(self, update: int, path: Path) -> None:
        if self._journal is None:
            self._report(f"cannot record this run: {self._why_not}", True)
            return
        try:
            path.parent.mkdir(exist_ok=True)
            self._excerpt = Excerpt(path, self._journal, self._moment(self._journal, update))
        except OSError as error:
            self._report(f"cannot record: {reason(error)}: '{path}'", True)
            return
        self._since = self._simulation.time
        self._block.figures["recording"] = 1
        self._report(f"recording to '{path}' from {self._since:.1f} s")

    def _end(self, update: int) -> None:
        assert self._excerpt is not None and self._journal is not None
        excerpt, self._excerpt = self._excerpt, None
        self._block.figures["recording"] = 0
        try:
            moment = self._moment(self._journal, update)
        except OSError as error:
            excerpt.drop()
            self._give_up(error)
            return
        seconds = self._simulation.time - self._since
        thread = threading.Thread(target=self._copy, args=(excerpt, moment, seconds))
        thread.start()
        self._copying = [other for other in self._copying if other.is_alive()] + [thread]

    def _copy(self, excerpt: Excerpt, moment: Moment, seconds: float) -> None:
        """Copy a file on a thread, since a large one must not delay the loop."""
        try:
            excerpt.finish(moment)
        except OSError as error:
            self._copied.append((f"the recording failed: {reason(error)}: '{excerpt.path}'", True))
        else:
            self._copied.append((f"recorded {seconds:.1f} s to '{excerpt.path}'", False))

    def _moment(self, journal: Journal, update: int) -> Moment:
        return journal.moment(update, self._simulation.state_hash())

    def _give_up(self, error: OSError) -> None:
        """Warn and continue without records: a run matters more than its records."""
        assert self._journal is not None
        if self._writer is not None:
            part = self._writer.abandon()
            report("error", f"recording of the run stopped: {reason(error)}; '{part}' holds the part before")
        self._journal.close()
        self._journal = self._writer = None
        self._why_not = reason(error)
        if self._excerpt is not None:
            self._excerpt.drop()
            self._report(f"the recording failed: {self._why_not}: '{self._excerpt.path}'", True)
        self._excerpt = None
        self._block.figures["recording"] = 0

    def _report(self, text: str, bad: bool = False) -> None:
        """Report to the page, and errors to the terminal too."""
        self._block.events.write(RUN, EVENT, text)
        if bad:
            report("warning", text)
