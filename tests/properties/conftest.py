"""Solutions kept apart from the user's, and a process in which to measure what may be broken."""

from __future__ import annotations

import json
import select
import subprocess
import sys
from pathlib import Path

import pytest

SECONDS = 60.0
"""Time that one scene may take."""


@pytest.fixture(scope="session", autouse=True)
def own_solutions(tmp_path_factory):
    """Keep the solutions of these tests away from the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path_factory.mktemp("solutions")))
        yield


class IsolatedProcess:
    """A process that measures scenes, and is begun anew when it has died."""

    def __init__(self) -> None:
        self.process: subprocess.Popen | None = None

    def measure(self, path: Path) -> tuple[str, str] | None:
        """What came of measuring a scene: nothing, or an error's kind and message."""
        if self.process is None:
            command = [sys.executable, str(Path(__file__).with_name("worker.py"))]
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
            )
        self.process.stdin.write(json.dumps(str(path)).encode() + b"\n")
        self.process.stdin.flush()
        if not select.select([self.process.stdout], [], [], SECONDS)[0]:
            self.end()
            return "hang", f"no answer after {SECONDS:g} s"
        line = self.process.stdout.readline()
        if not line:
            code = self.process.wait()
            self.end()
            return "death", f"the process ended with {code}"
        return json.loads(line)

    def end(self) -> None:
        if self.process is not None:
            with self.process as process:
                process.kill()
            self.process = None


@pytest.fixture(scope="session")
def isolated():
    """A process of its own in which to measure scenes."""
    process = IsolatedProcess()
    yield process
    process.end()
