"""The format's look-up by text for other packages, and the exception for a name that finds nothing."""

from ligature.adf.references import candidates, find_by_text

__all__ = ["UnknownNameError", "candidates", "find_by_text"]


class UnknownNameError(KeyError):
    """A name that stands for nothing; its text is the message, where that of a `KeyError` is in quotation marks."""

    def __str__(self) -> str:
        return str(self.args[0])
