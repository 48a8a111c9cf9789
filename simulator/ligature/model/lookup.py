"""The format's look-up by text, by the name that the rooms above know it."""

from ligature.adf.references import candidates, find_by_text

__all__ = ["candidates", "find_by_text"]
