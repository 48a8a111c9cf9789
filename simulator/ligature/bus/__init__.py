"""State out, commands in: shared memory between the processes of a running simulator.

One file in shared memory holds the newest state (any number of readers), the loop's figures, and
one ring of commands for each front end. The physics process creates it; a front end attaches with
its name, publishes what it reads and pushes commands into its own ring.
"""

from ligature.bus.block import Block, BusError
from ligature.bus.mailbox import Mailbox
from ligature.bus.pacing import Pacer, Throttle
from ligature.bus.watchdog import Watchdog

__all__ = ["Block", "BusError", "Mailbox", "Pacer", "Throttle", "Watchdog"]
