"""Base classes of the cases in the tables of extreme cases."""

from __future__ import annotations

import time
from abc import abstractmethod
from dataclasses import replace
from typing import Any, ClassVar

from mitsuba_taxel.base.processes.system import peak_memory


class TableCase:
    """One row of a table, an instance of ``ROW``, which is measured in a separate process."""

    ROW: ClassVar[type]
    name: str

    def failed(self, end: str) -> Any:
        """The row for a process that returned no row."""
        return self.ROW(self.name, end, wrong="no answer")


class TimedCase(TableCase):
    """A case whose whole measurement is timed."""

    def measured(self) -> Any:
        """The row, measured in this process."""
        start = time.process_time()
        row = self._row()
        return replace(row, seconds=time.process_time() - start, megabytes=peak_memory())

    @abstractmethod
    def _row(self) -> Any:
        """The row of the table, without its CPU time and memory use."""
