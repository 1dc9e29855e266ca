"""The share of the cores that one of several processes of tests keeps to, as threads of Dr.Jit spin while they wait."""

from __future__ import annotations

import os


def keep_to_share_of_cores() -> None:
    """Limit threads of this process, where tests run in several."""
    sharing = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    if sharing > 1:
        from mitsuba_taxel.studies.run.processes import keep_to_share

        keep_to_share(sharing)
