"""Whether packages will be known to the pads of a scene that is being built, which depend on them where they touch."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_TO_COME = ContextVar("packages to come", default=False)


@contextmanager
def announced(to_come: bool) -> Iterator[None]:
    """Let pads whose loads go on wait undeformed for the packages, if these are ``to_come``."""
    token = _TO_COME.set(to_come)
    try:
        yield
    finally:
        _TO_COME.reset(token)


def are_to_come() -> bool:
    """Whether packages are announced."""
    return _TO_COME.get()
