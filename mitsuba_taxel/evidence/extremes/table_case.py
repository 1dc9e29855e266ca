"""Base classes of extreme cases."""

from __future__ import annotations

import time
from abc import abstractmethod
from dataclasses import replace
from typing import Any, ClassVar

from mitsuba_taxel.base.processes.system import peak_memory


class TableCase:
    """A case of a table of extreme cases, such as a load or a circuit at the limit of what is computed.

    Each case is measured in a separate process, and gives one row of the table.

    Attributes
    ----------
    ROW : type
        Class of the row.
    name : str
        Name of the case in the table.
    """

    ROW: ClassVar[type]
    name: str

    def failed(self, end: str) -> Any:
        """The result of a case whose process ended without a result, for the reason ``end``."""
        return self.ROW(self.name, end, wrong="no answer")


class TimedCase(TableCase):
    """A case whose whole measurement is timed."""

    def measured(self) -> Any:
        """Measure this extreme case in the present process, and return the row of the table."""
        start = time.process_time()
        row = self._row()
        return replace(row, seconds=time.process_time() - start, megabytes=peak_memory())

    @abstractmethod
    def _row(self) -> Any:
        """The result of the case, without CPU time and memory."""
