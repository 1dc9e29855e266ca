"""The parts of a rerun: what each computes, which are asked for, and what is there already."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.reproduce import analog, loading, paper, plate, variations
from mitsuba_taxel.reproduce.store import MissingStudy, Store

Part = Callable[..., Any]


def _nominal(store: Store, *, workers: int | None) -> dict[str, Any]:
    return {cell: loading.nominal(store, cell, workers) for cell in paper.CELLS}


def _beyond(store: Store, *, workers: int | None) -> dict[str, Any]:
    """Needs the nominal readings, whose number of light paths it takes."""
    settings = {cell: loading.settings_of(paths["fz"]) for cell, paths in _nominal(store, workers=workers).items()}
    return {cell: loading.beyond(store, cell, settings[cell], workers) for cell in paper.CELLS}


def _roofs(store: Store, *, workers: int | None) -> dict[str, Any]:
    return {cell: loading.roof_heights(store, cell) for cell in paper.CELLS}


def _analog(store: Store, *, workers: int | None) -> dict[str, Any]:
    return {cell: analog.counted(store, cell) for cell in paper.CELLS}


PARTS: dict[str, Part] = {
    "fig4": plate.heights,
    "fig5": partial(plate.edges, axis="x"),
    "fig6": partial(plate.edges, axis="y"),
    "peak": plate.peak_heights,
    "nominal": _nominal,
    "roofs": _roofs,
    "beyond": _beyond,
    "variations": variations.vary,
    "analog": _analog,
}
"""By name; each returns its studies, from disk where they are there."""

GROUPS = {"optics": ("fig4", "fig5", "fig6", "peak"), "nominal": ("nominal", "roofs")}


def chosen(only: str | None) -> list[str]:
    """Names of the parts that a comma-separated list of parts and groups asks for, all without one.

    Raises
    ------
    InputError
        if there is no such part.
    """
    if only is None:
        return list(PARTS)
    wanted: list[str] = []
    for word in (word.strip() for word in only.split(",")):
        if word not in PARTS and word not in GROUPS:
            allowed = ", ".join(dict.fromkeys([*GROUPS, *PARTS]))
            raise InputError(f"only = {word!r} is not allowed: some of {allowed} are needed.")
        wanted.extend(GROUPS.get(word, (word,)))
    return [name for name in PARTS if name in wanted]


def compute(folder: Path, names: Sequence[str], workers: int | None, announce: Callable[[str], None]) -> None:
    """Compute what is missing of the parts called ``names`` and store it in ``folder``.

    Parameters
    ----------
    announce : called with the name of each study that is about to be computed
    """
    store = Store(folder, announce)
    for name in names:
        PARTS[name](store, workers=workers)


def complete(folder: Path) -> dict[str, Any]:
    """The studies of every part that is complete in ``folder``, by the name of the part."""
    store, found = Store(folder), {}
    for name, part in PARTS.items():
        try:
            found[name] = part(store, workers=None)
        except MissingStudy:
            continue
    return found
