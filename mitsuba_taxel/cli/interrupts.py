"""Ctrl-C while the program itself is imported ends it without a traceback; imported before anything else."""

from __future__ import annotations

import signal

_before = signal.getsignal(signal.SIGINT)
try:
    if _before is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
except ValueError:  # in another thread than the main one, which no signal reaches
    pass


def raise_again() -> None:
    """Restore Python's behaviour on Ctrl-C: it raises KeyboardInterrupt."""
    try:
        if _before is signal.default_int_handler:
            signal.signal(signal.SIGINT, _before)
    except ValueError:
        pass
