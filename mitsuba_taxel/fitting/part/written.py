"""The file of a fitted part, and the fit in words."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.fitting.part.part_fit import PartFit, PartUnknown


def write_part(fit: PartFit, file: str | Path) -> None:
    """Write the fitted part as a TOML file, which scenes name as their ``part``.

    Parameters
    ----------
    fit : PartFit
        Result of `fit_part`.
    file : str or Path
        File to be written.

    Raises
    ------
    ComputationError
        if the file cannot be written.
    """
    import tomli_w

    part = fit.part
    sources = dict(part.sources)
    for unknown in fit.unknowns:
        words = f"fitted to {fit.curve.file} by `taxel fit`, 95 % interval {interval_text(unknown)}"
        sources |= dict.fromkeys(unknown.entries, words)
    sources["distance_curve"] = fit.curve.file
    rows = zip(fit.curve.heights.tolist(), fit.curve.currents.tolist(), strict=True)
    content: dict[str, Any] = {
        "title": part.title,
        "source": part.source,
        "body": list(part.body),
        "wavelength": part.wavelength,
        "resin_index": _short(part.stated["resin_index"]),
        "unknown": list(part.unknown),
        "distance_curve": [[_short(height), _short(current)] for height, current in rows],
        "distance_reflector": part.distance_reflector,
        "emitter": {name: _short(value) for name, value in part.stated["emitter"].items()},
        "detector": {name: _short(value) for name, value in part.stated["detector"].items()},
        "electrical": part.electrical,
        "sources": sources,
    }
    write_text(Path(file), tomli_w.dumps({name: value for name, value in content.items() if value not in ([], {})}))


def _short(value: Any) -> Any:
    return float(f"{value:.5g}") if isinstance(value, float) else value


def interval_text(unknown: PartUnknown) -> str:
    """State the confidence interval of an unknown in words; an end that is a limit of the allowed values is marked as
    such.

    Parameters
    ----------
    unknown : PartUnknown
        A fitted unknown.

    Returns
    -------
    str
        Words, such as ``0.02 (limit) to 0.31 mm``.
    """
    low, high = unknown.interval
    ends = [
        f"{end:.3g}" + (" (limit)" if end == limit else "")
        for end, limit in ((low, unknown.low), (high, unknown.high))
    ]
    return " to ".join(ends) + (f" {unknown.unit}" if unknown.unit else "")


def part_answer(fit: PartFit) -> str:
    """State the fitted numbers in one line.

    Parameters
    ----------
    fit : PartFit
        Result of `fit_part`.

    Returns
    -------
    str
        One line.
    """
    values = [f"{u.name} = {u.value:.3g} {u.unit}".rstrip() for u in fit.unknowns]
    words = ("" if unknown.determined else " (not determined)" for unknown in fit.unknowns)
    return ", ".join(map("".join, zip(values, words, strict=True))) + "."
