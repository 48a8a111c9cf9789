"""The physics process: loads the scene, hands it to the other processes, then imports the engines and simulates."""

from __future__ import annotations

from ligature.cli.process import Run, run_process


def main() -> None:
    """Entry point; see `ligature.cli.process`."""
    run_process(_simulate, owner=True)


def _simulate(run: Run) -> None:
    from ligature.cli.loop import simulate  # takes half a second: the others have the scene by now

    simulate(run)
