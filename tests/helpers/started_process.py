"""Processes that tests start, and that do not outlive them: one left behind fails whatever test comes next."""

from __future__ import annotations

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
