"""The two ways a request can fail, and interrupts that look like failures."""

from __future__ import annotations

MOST_LETTERS = 1000
"""Largest length of a message, since quoted values may be of any length."""


class InputError(ValueError):
    """Invalid input: the message names the parameter, its value and what is allowed.

    The command line prints it and exits with code 2. It is one line, whatever it quotes.

    Attributes
    ----------
    part : object
        The object of a scene that caused the error, if known.
    """

    def __init__(self, message: object, part: object = None) -> None:
        super().__init__(one_line(message))
        self.part = part


class ComputationError(RuntimeError):
    """A computation on valid input failed: the message says where it stopped and why.

    The command line prints it and exits with code 1. It is one line, whatever it quotes.
    """

    def __init__(self, message: object) -> None:
        super().__init__(one_line(message))


class UnusedDefault(UserWarning):
    """A ``<default>`` of a scene that nothing uses."""


def one_line(message: object) -> str:
    """A message on one line, shortened in the middle if too long."""
    line = " ".join(str(message).split())
    half = MOST_LETTERS // 2
    return line if len(line) <= MOST_LETTERS else f"{line[:half]} [...] {line[-half:]}"


def comes_from_interrupt(error: BaseException | None) -> bool:
    """Whether an interrupt caused an error: during the recording of a kernel it is wrapped in one.

    Parameters
    ----------
    error : BaseException or None
        With its causes.

    Returns
    -------
    bool
        Whether a KeyboardInterrupt is among them.
    """
    return error is not None and (isinstance(error, KeyboardInterrupt) or comes_from_interrupt(error.__cause__))
