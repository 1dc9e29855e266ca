"""Answers of workers: processes that may crash, hang or exhaust memory."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Mapping, Sequence


class NoAnswer(Exception):
    """A process that was stopped, or ended badly.

    Attributes
    ----------
    end : str
        "time" or "memory" if it exceeded these, the name of a signal, or "error".
    last : str
        The last line that it printed on standard error.
    """

    def __init__(self, end: str, output: str = "") -> None:
        super().__init__(output)
        self.end, self.last = end, (output.strip().splitlines() or [""])[-1]


def answer_of(
    command: Sequence[str], given: bytes, seconds: float, environment: Mapping[str, str] | None = None
) -> bytes:
    """What a process prints that may crash, hang or exhaust memory.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    given : bytes
        On standard input.
    seconds : float
        After which it is stopped.
    environment : Mapping[str, str], optional
        Of the process; by default that of this one.

    Returns
    -------
    bytes
        From standard output.

    Raises
    ------
    NoAnswer
        if it is stopped or fails.
    """
    try:
        done = subprocess.run(command, input=given, capture_output=True, timeout=seconds, env=environment)
    except subprocess.TimeoutExpired as error:
        raise NoAnswer("time") from error
    if done.returncode == 0:
        return done.stdout
    failed = NoAnswer("error", done.stderr.decode(errors="replace"))
    if any(word in failed.last for word in ("MemoryError", "bad_alloc", "memory allocation")):
        failed.end = "memory"
    elif done.returncode < 0:
        failed.end = signal.Signals(-done.returncode).name
    raise failed
