"""Suturing tasks: what counts as done, how well, and everything that was measured on the way."""

from ligature.tasks.attempt import TASKS, Attempt
from ligature.tasks.monitor import Measures, Monitor
from ligature.tasks.scenery import MissingBodies, Scenery
from ligature.tasks.scores import (
    EstimationScore,
    InsertionScore,
    SutureScore,
    judge_estimate,
    judge_insertion,
    judge_suture,
)

__all__ = [
    "TASKS",
    "Attempt",
    "EstimationScore",
    "InsertionScore",
    "Measures",
    "MissingBodies",
    "Monitor",
    "Scenery",
    "SutureScore",
    "judge_estimate",
    "judge_insertion",
    "judge_suture",
]
