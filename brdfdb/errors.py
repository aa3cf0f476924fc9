"""The errors of this package: one base class, so that a caller can tell a refused input from a bug."""

from __future__ import annotations


class BrdfdbError(Exception):
    """An error that the user can act on; str() is one sentence that says what was given and what is allowed."""


class ParameterError(BrdfdbError, ValueError):
    """An argument that is not allowed.

    Parameters
    ----------
    parameter : str
        Name of the argument, as the caller gives it.
    sentence : str
        What is wrong with the value and what is allowed; it follows the name and a colon.
    value : object
        The value that was given.
    allowed : object
        The values that are allowed: an interval (low, high), a tuple of names, or a short description.
    """

    def __init__(self, parameter: str, sentence: str, value: object = None, allowed: object = None) -> None:
        super().__init__(parameter, sentence, value, allowed)
        self.parameter, self.sentence, self.value, self.allowed = parameter, sentence, value, allowed

    def __str__(self) -> str:
        return f"{self.parameter}: {self.sentence}"
