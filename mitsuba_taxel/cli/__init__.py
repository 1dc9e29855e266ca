"""The `taxel` program."""

from __future__ import annotations


def main() -> None:
    """Run the program."""
    raise SystemExit("not yet")
