"""Findings of a check."""

from __future__ import annotations

from dataclasses import dataclass

SEVERITIES = ("error", "warning", "note")
"""Error: the scene cannot be read, or gives wrong readings. Warning: probably unintended. Note: for information."""


@dataclass(frozen=True)
class Finding:
    """A finding of `check_scene`: an error, a warning or a note on a scene, in one sentence.

    Attributes
    ----------
    severity : str
        One of :data:`SEVERITIES`.
    message : str
        Description of the error, and the remedy.
    file, line : str and int
        File name and line number; line 0 stands for the whole scene.
    stopped : bool
        Whether a computation stopped, such as the solve for a load that the pad cannot bear.
    """

    severity: str
    message: str
    file: str
    line: int
    stopped: bool = False

    def __str__(self) -> str:
        location = f"{self.file}:{self.line}" if self.line else self.file
        return f"{location}: {self.severity}: {self.message}"
