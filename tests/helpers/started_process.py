"""Processes that tests start, and that do not outlive them: one left behind fails whatever test comes next."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any


@contextmanager
def started(command: Sequence[object], **how: Any) -> Iterator[subprocess.Popen]:
    """A process at work; it is killed in the end, unless it has ended."""
    with subprocess.Popen([str(word) for word in command], **how) as process:
        try:
            yield process
        finally:
            process.kill()


def interrupted(process: subprocess.Popen, seconds: float = 30.0) -> tuple[bytes, bytes]:
    """What a process says that is interrupted: again, if need be, as Python loses an interrupt amid a finaliser."""
    process.send_signal(signal.SIGINT)
    try:
        return process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGINT)
        return process.communicate(timeout=seconds)
