"""The two kinds of errors, detection of interrupts that are wrapped in errors, and suggestions for misspelt names."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

MOST_LETTERS = 1000
"""Largest length of a message, in characters; values in a message may be of any length."""


class InputError(ValueError):
    """Invalid input: the message names the parameter, its value and what is allowed.

    The command line prints the message and exits with code 2. The message is always a single line.

    Attributes
    ----------
    part : object
        The object of a scene that caused the error, if known.
    """

    def __init__(self, message: object, part: object = None) -> None:
        super().__init__(one_line(message))
        self.part = part


class ComputationError(RuntimeError):
    """A computation on valid input failed: the message states where it stopped and why.

    The command line prints the message and exits with code 1. The message is always a single line.
    """

    def __init__(self, message: object) -> None:
        super().__init__(one_line(message))


class UnusedDefault(UserWarning):
    """Warning that no element of a scene uses one of its ``<default>``s."""


def one_line(message: object) -> str:
    """A message as a single line, shortened in the middle if it is too long."""
    line = " ".join(str(message).split())
    half = MOST_LETTERS // 2
    return line if len(line) <= MOST_LETTERS else f"{line[:half]} [...] {line[-half:]}"


def comes_from_interrupt(error: BaseException | None) -> bool:
    """Whether an interrupt caused an error: an interrupt during the recording of a kernel is wrapped in an error.

    Parameters
    ----------
    error : BaseException or None
        An error with its causes.

    Returns
    -------
    bool
        True if the error or one of its causes is a KeyboardInterrupt.
    """
    return error is not None and (isinstance(error, KeyboardInterrupt) or comes_from_interrupt(error.__cause__))


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A suggestion for an unknown name.

    Parameters
    ----------
    name : str
        The unknown name.
    known : iterable of str
        Allowed names.

    Returns
    -------
    str
        Text such as " (did you mean pitch?)"; empty if no allowed name is similar.
    """
    close = get_close_matches(name, list(known), n=1)
    return f" (did you mean {close[0]}?)" if close else ""
