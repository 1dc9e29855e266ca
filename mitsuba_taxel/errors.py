"""The two ways a request can fail."""

from __future__ import annotations


class InputError(ValueError):
    """What was asked for cannot be: the message names the parameter, its value and what is allowed.

    The command line prints it as one line and exits with code 2.
    """


class ComputationError(RuntimeError):
    """A computation on valid input did not succeed: the message says where it stopped and why.

    The command line prints it as one line and exits with code 1.
    """
