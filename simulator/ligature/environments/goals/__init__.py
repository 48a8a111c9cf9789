"""The tasks of the environments, by name: `base` has what they share."""

from ligature.environments.goals.base import Goal, Progress, holds
from ligature.environments.goals.driving import Insert, Puncture
from ligature.environments.goals.handing import HandOver
from ligature.environments.goals.pegs import PegTransfer
from ligature.environments.goals.pulling import PullThrough
from ligature.environments.goals.reaching import Pick, Reach
from ligature.environments.goals.stitching import Suture
from ligature.environments.goals.tying import FirstThrow, KnotTie

__all__ = [
    "GOALS",
    "Goal",
    "HandOver",
    "FirstThrow",
    "Insert",
    "KnotTie",
    "PegTransfer",
    "Pick",
    "Progress",
    "PullThrough",
    "Puncture",
    "Reach",
    "Suture",
    "holds",
]

GOALS: dict[str, type[Goal]] = {
    "reach": Reach, "pick": Pick, "insert": Insert, "puncture": Puncture,
    "hand_over": HandOver, "pull_through": PullThrough, "peg_transfer": PegTransfer,
    "suture": Suture, "first_throw": FirstThrow, "knot_tie": KnotTie,
}  # fmt: skip
"""Tasks by name."""
