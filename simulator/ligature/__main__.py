"""The command ``ligature`` as ``python -m ligature``."""

from ligature.cli.command import ligature

ligature()
