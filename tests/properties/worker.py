"""The process that measures scenes that may be broken: it answers each name of a file by what came of it, in JSON.

An answer is null where all went well, else the kind of the error and its message. The process has 6 GB of memory, and
prints nothing else.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import warnings
from pathlib import Path

MEMORY = 6 * 2**30


def main() -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    warnings.simplefilter("error")
    warnings.filterwarnings("ignore", ".*nothing uses the <default>")  # which is no error
    for line in sys.stdin:
        print(json.dumps(_outcome(Path(json.loads(line)))), file=answers, flush=True)


def _outcome(path: Path) -> tuple[str, str] | None:
    try:
        _measure(path)
    except Exception as error:
        return type(error).__name__, str(error)
    return None


def _measure(path: Path) -> None:
    import numpy as np

    from mitsuba_taxel import Scene, measure

    readings = measure(Scene.from_file(path), points=4, mechanics_error=False)
    assert np.all(np.isfinite(readings.replicates)), "readings are not finite"
    assert np.all(readings.power >= 0), "readings are negative"


main()
