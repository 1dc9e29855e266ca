"""The two ways a request can fail, and interrupts that look like failures."""

from __future__ import annotations


class InputError(ValueError):
    """What was asked for cannot be: the message names the parameter, its value and what is allowed.

    The command line prints it as one line and exits with code 2.
    """


class ComputationError(RuntimeError):
    """A computation on valid input did not succeed: the message says where it stopped and why.

    The command line prints it as one line and exits with code 1.
    """


def comes_from_interrupt(error: BaseException | None) -> bool:
    """Whether an interrupt is behind an error: where it falls into the recording of a kernel it is wrapped in one."""
    return error is not None and (isinstance(error, KeyboardInterrupt) or comes_from_interrupt(error.__cause__))
