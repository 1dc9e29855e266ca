"""What a page shows as printed, beside what is printed today."""

from __future__ import annotations

import re

NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
TIMES = re.compile(r"Seconds: ")
"""Start of lines whose numbers are times."""
RELATIVE, UNITS = 0.005, 1.5
"""By how much a number may differ from what is shown: of itself, or in units of its last digit shown."""


def missing_from(shown: str, printed: str) -> str:
    """Empty if the lines shown stand one after the other in what is printed, but for spaces and last digits; else what
    is printed instead."""
    wanted, there = _lines(shown), _lines(printed)
    for start in range(len(there) - len(wanted) + 1):
        if all(map(_alike, wanted, there[start:])):
            return ""
    return f"shown:\n{shown}\nprinted:\n{printed}"


def renewed(shown: str, printed: str) -> str:
    """The lines shown with today's numbers, or as they are where other words are printed."""
    wanted, there = [_words(line) for line in _lines(shown)], printed.splitlines()
    told = [number for number, line in enumerate(there) if line.strip()]
    for start in range(len(told) - len(wanted) + 1):
        places = told[start : start + len(wanted)]
        if wanted == [_words(" ".join(there[place].split())) for place in places]:
            return "\n".join([*(line.rstrip() for line in there[places[0] : places[-1] + 1]), ""])
    return shown


def _words(line: str) -> str:
    return NUMBER.sub("#", line)


def _lines(text: str) -> list[str]:
    return [" ".join(line.split()) for line in text.splitlines() if line.strip()]


def _alike(shown: str, printed: str) -> bool:
    if _words(shown) != _words(printed):
        return False
    if TIMES.match(shown):
        return True
    return all(map(_near, NUMBER.findall(shown), NUMBER.findall(printed)))


def _near(shown: str, printed: str) -> bool:
    digits, _, exponent = shown.partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
    return abs(float(shown) - float(printed)) <= max(UNITS * unit, RELATIVE * abs(float(shown)))
