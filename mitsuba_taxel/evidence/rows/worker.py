"""The process that measures one case: it reads the case from standard input and writes its row to standard output.

Run as ``python -m mitsuba_taxel.evidence.rows.worker BYTES``, with its memory limit.
"""

from __future__ import annotations

import json
import os
import pickle
import sys

from mitsuba_taxel.base.processes.system import confine


def main(memory: int) -> None:
    # Not the address space: the driver of a graphics card reserves more than the machine's memory.
    confine(memory, "DATA")
    # Standard output is reserved for the row; output of libraries goes elsewhere.
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    row = pickle.load(sys.stdin.buffer).measured()
    json.dump(vars(row), answer)
    answer.close()


if __name__ == "__main__":
    main(int(sys.argv[1]))
