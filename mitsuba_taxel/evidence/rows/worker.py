"""The process that measures one row: it reads a case from standard input and writes its row to standard output.

Run as ``python -m mitsuba_taxel.evidence.rows.worker BYTES``, with its memory limit.
"""

from __future__ import annotations

import ctypes
import json
import os
import pickle
import resource
import signal
import sys


def main(memory: int) -> None:
    # Not the address space: the driver of a graphics card reserves more than the machine's memory.
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # A parent that is killed cannot end this process itself.
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
    # Standard output is reserved for the row, whatever libraries print.
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    row = pickle.load(sys.stdin.buffer).measured()
    json.dump(vars(row), answer)
    answer.close()


if __name__ == "__main__":
    main(int(sys.argv[1]))
