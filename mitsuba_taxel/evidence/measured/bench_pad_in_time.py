"""The measured pad under prescribed motions of its indenter: a slow loading cycle, and a hold with release."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.evidence.measured import bench_pad, measured
from mitsuba_taxel.evidence.measured.bench_pad import IndenterPress
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.sensing import Scene, measure

STEPS = 5
"""Number of readings of a cycle while the indenter goes down."""
CYCLE_TRAVEL = max(measured.PRESSES[measured.PRESSED].travels)
"""Largest travel of the cycle in mm."""
REACHED, HELD = 0.1, 30.0
"""Time in s at which the travel of the hold is reached, and duration of the hold."""
HOLD_TIMES = (0.05, 0.2, 0.5, 1.0, 3.0, 8.0, HELD)
"""Times during the hold, in s, at which readings are computed."""
POINTS = 1024
"""Number of light paths for each taxel and randomisation after the release, when changes are small."""

Prony = tuple[tuple[float, float], ...]


class TimedTravel(NamedTuple):
    """A time in s, and the travel of the indenter at this time in mm."""

    time: float
    travel: float


def cycle(
    store: PaperStudies,
    press: IndenterPress,
    prony: Prony,
    late: float = 0.0,
    friction: float = 0.0,
    mesh_size: float | None = None,
    mullins: str = "",
) -> xr.Dataset:
    """Compute force and readings along a loading cycle of the measured duration, from rest to rest, as a dataset over
    ``row`` with the coordinate ``travel``.

    The record begins at a travel of ``late`` mm. The pad is viscoelastic with the terms ``prony``. Without terms it is
    elastic, or has Mullins' effect with the constants ``mullins``, of which the second is relative to the modulus. The
    last row of the cycle, at travel 0, is not computed, because the indenter leaves the pad there.
    """
    fraction = np.concatenate([np.arange(1, STEPS + 1), np.arange(STEPS - 1, 0, -1)]) / STEPS
    times = measured.CYCLE_SECONDS / 2 * np.arange(1, 2 * STEPS) / STEPS
    largest_travel = CYCLE_TRAVEL + late
    rows = [
        TimedTravel(round(float(t), 6), round(float(s) * largest_travel, 6))
        for t, s in zip(times, fraction, strict=True)
    ]
    return _path(store, "cycle", press, prony, rows, bench_pad.POINTS, friction, mesh_size, mullins)


def hold_and_release(
    store: PaperStudies, press: IndenterPress, prony: Prony, late: float = 0.0, mesh_size: float | None = None
) -> xr.Dataset:
    """Compute force and readings at the times of the record while the pad is pressed within 0.1 s, held, and released
    instantly."""
    end = REACHED + HELD
    travel = round(measured.HELD_AT + late, 6)
    hold = [TimedTravel(REACHED, travel), *(TimedTravel(REACHED + time, travel) for time in HOLD_TIMES)]
    release = [TimedTravel(end, 0.0), *(TimedTravel(end + time, 0.0) for time in measured.TAIL_TIMES)]
    return _path(store, "hold", press, prony, [*hold, *release], POINTS, mesh_size=mesh_size)


def _path(
    store: PaperStudies,
    kind: str,
    press: IndenterPress,
    prony: Prony,
    rows: list[TimedTravel],
    points: int,
    friction: float = 0.0,
    mesh_size: float | None = None,
    mullins: str = "",
) -> xr.Dataset:
    size = mesh_size or bench_pad.MESH_SIZE
    terms = "; ".join(f"{weight:.5g} {time:g}" for weight, time in prony)
    request = {**press._asdict(), "prony": terms, "rows": rows, "points": points, "friction": friction}
    request |= {"mesh_size": size}
    settings: tuple[str, ...] = ("rubbed" if friction else "", f"on {size:g}" if mesh_size else "")
    if mullins:
        request |= {"mullins": mullins}
        position = press.name.partition("_at_")[2]
        settings = (*settings, f"softened {mullins}", f"at {position}" if position else "")
    name = "_".join(word for word in (kind, *settings, *terms.split("; ")) if word)
    return store.study(
        f"pressed/{name.replace(' ', '_in_')}",
        request,
        lambda: _computed(store, press, terms, rows, points, friction, size, mullins),
    )


def _computed(
    store: PaperStudies,
    press: IndenterPress,
    terms: str,
    rows: list[TimedTravel],
    points: int,
    friction: float,
    mesh_size: float,
    mullins: str = "",
) -> xr.Dataset:
    file = store.folder / "pressed" / "pad.xml"
    bench_pad.write_scene(file)
    shares = [float(term.split()[0]) for term in terms.split("; ") if term]
    defines: dict[str, Any] = bench_pad.defines_of(press) | {
        "prony": terms,
        "youngs_modulus": 1 / (1 - sum(shares)),
        "friction": friction,
        "mullins": mullins,
        "mesh_size": mesh_size,
    }
    at_rest = measure(Scene(file, defines), points=points, mechanics_error=False)
    history = [f"{row.time!r} 0 0 {-row.travel!r}" for row in rows]
    readings = []
    for number, row in enumerate(rows):
        values = {"time": row.time if terms else 0.0, "uz": -row.travel, "history": "; ".join(history[:number])}
        readings.append(bench_pad.read(Scene(file, defines | values), at_rest, points))
    times, travels = (np.array(values) for values in zip(*rows, strict=True))
    return bench_pad.dataset("row", readings).assign_coords(
        time=("row", times, {"units": "s"}), travel=("row", travels, {"units": "mm"})
    )
