"""What a check says of a scene."""

from __future__ import annotations

from dataclasses import dataclass

SEVERITIES = ("error", "warning", "note")
"""Error: the scene cannot be read, or reads wrongly. Warning: it hardly means what it says. Note: good to know."""


@dataclass(frozen=True)
class Finding:
    """One thing to know of a scene, in one sentence.

    Attributes
    ----------
    severity : str
        One of :data:`SEVERITIES`.
    message : str
        What is wrong, and what to do.
    file, line : str and int
        Where; line 0 stands for the scene as a whole.
    """

    severity: str
    message: str
    file: str
    line: int

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        return f"{place}: {self.severity}: {self.message}"
