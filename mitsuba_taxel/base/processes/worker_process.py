"""Output of worker processes, which may crash, hang or exhaust memory."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Mapping, Sequence


class NoAnswer(Exception):
    """A worker process returned no output: it was stopped at a limit, or it failed.

    Attributes
    ----------
    end : str
        "time" or "memory" if the process exceeded a limit; else the name of the signal that ended it, or "error".
    last : str
        Last line of the standard error of the process.
    """

    def __init__(self, end: str, output: str = "") -> None:
        super().__init__(output)
        self.end, self.last = end, (output.strip().splitlines() or [""])[-1]


def answer_of(
    command: Sequence[str], given: bytes, seconds: float, environment: Mapping[str, str] | None = None
) -> bytes:
    """Run a command that may crash, hang or exhaust memory in a separate process, and return its standard output.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    given : bytes
        Bytes written to the standard input of the command.
    seconds : float
        Time after which the process is stopped.
    environment : Mapping[str, str], optional
        Environment of the process; by default the environment of this process.

    Returns
    -------
    bytes
        Standard output.

    Raises
    ------
    NoAnswer
        if the process is stopped or fails.
    """
    try:
        done = subprocess.run(command, input=given, capture_output=True, timeout=seconds, env=environment)
    except subprocess.TimeoutExpired as error:
        raise NoAnswer("time") from error
    if done.returncode == 0:
        return done.stdout
    failed = NoAnswer("error", done.stderr.decode(errors="replace"))
    if any(word in failed.last.lower() for word in ("memoryerror", "bad_alloc", "memory allocation")):
        failed.end = "memory"
    elif done.returncode < 0:
        failed.end = signal.Signals(-done.returncode).name
    raise failed
