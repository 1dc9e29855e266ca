"""The process that one row is measured in: a case comes in at standard input, its row leaves at standard output.

Run as ``python -m mitsuba_taxel.bench.worker BYTES``, with the most memory that it may take.
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
    # Not addresses: the driver of a graphics card reserves more of them than the machine has memory.
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Of a parent that is killed outright nothing is heard.
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
    # Standard output is for the answer alone, whatever the libraries print.
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    row = pickle.load(sys.stdin.buffer).measured()
    json.dump(vars(row), answer)
    answer.close()


if __name__ == "__main__":
    main(int(sys.argv[1]))
