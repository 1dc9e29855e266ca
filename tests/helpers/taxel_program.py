"""The `taxel` program within this process, without the second in which one of its own imports mitsuba."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import taxel_cli

PYTHONS_OWN = (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning)
"""Warnings that Python keeps to itself in programs."""


def run_program(folder: Path, *words: object) -> subprocess.CompletedProcess:
    """Run ``taxel`` in a folder, and give what a process of its own would: its exit code, stdout and stderr."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        with _surroundings_of_a_program(folder, [str(word) for word in words], out, err):
            try:
                taxel_cli.main()
                code = 0
            except SystemExit as end:
                code = end.code or 0
        texts = []
        for file in (out, err):
            file.seek(0)
            texts.append(file.read().decode())
    return subprocess.CompletedProcess(["taxel", *words], code, *texts)


@contextmanager
def _surroundings_of_a_program(folder: Path, words: list[str], out: IO[bytes], err: IO[bytes]) -> Iterator[None]:
    """Streams, arguments, working folder, warnings and signals as a program finds them; then all as before."""
    safe_path = os.environ.get("PYTHONSAFEPATH")
    before = sys.argv, sys.stdout, sys.stderr, Path.cwd()
    signals = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    descriptors = [(number, os.dup(number)) for number in (1, 2)]
    sys.stdout.flush()
    sys.stderr.flush()
    os.dup2(out.fileno(), 1)
    os.dup2(err.fileno(), 2)
    sys.argv = ["taxel", *words]
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = open(2, "w", encoding="utf-8", closefd=False, buffering=1, errors="backslashreplace")
    os.chdir(folder)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default")
            for kind in PYTHONS_OWN:
                warnings.simplefilter("ignore", kind)
            yield
    finally:
        sys.stdout.close()
        sys.stderr.close()
        sys.argv, sys.stdout, sys.stderr, cwd = before
        os.chdir(cwd)
        for number, kept in descriptors:
            os.dup2(kept, number)
            os.close(kept)
        for number, handler in signals.items():
            signal.signal(number, handler)
        os.environ.pop("PYTHONSAFEPATH", None)  # the program sets it
        if safe_path is not None:
            os.environ["PYTHONSAFEPATH"] = safe_path
