"""The parts of a rerun: how they are computed and selected, and which are complete."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.evidence.paper import analog, loading, mould, optima, paper, plate, variations
from mitsuba_taxel.evidence.paper.mould import MouldWalls
from mitsuba_taxel.evidence.paper.paper_studies import MissingStudy, PaperStudies, add_seconds
from mitsuba_taxel.evidence.paper.shapes import ShapePart, compute_shapes

Part = Callable[..., Any]

OF_SHAPES: dict[str, ShapePart] = {
    "nominal": loading.nominal,
    "roofs": loading.roof_heights,
    "beyond": loading.beyond,
    "analog": analog.counted,
}
"""Parts computed for each shape separately, so that shapes can be computed concurrently."""


def _stages(names: Sequence[str]) -> list[list[ShapePart]]:
    """The computations for one cell shape, ordered in stages that depend on earlier stages only."""
    independent = [computation for name, computation in OF_SHAPES.items() if name in names and name != "nominal"]
    stages: list[list[ShapePart]] = []
    if set(names) - {"analog"}:
        stages = [[loading.normal], [loading.along_x], [loading.along_y, loading.along_diagonal]]
    return [*stages, independent] if independent else stages


def _of_all_shapes(computation: ShapePart, store: PaperStudies, *, workers: int | None) -> dict[str, Any]:
    return {cell: computation(store, cell) for cell in paper.CELLS}


def _of_walls(rows: Callable[[], Iterator[MouldWalls]], store: PaperStudies, *, workers: int | None) -> Any:
    return mould.moulds(store, workers, rows())


PARTS: dict[str, Part] = {
    "fig4": plate.heights,
    "fig5": partial(plate.edges, axis="x"),
    "fig6": partial(plate.edges, axis="y"),
    "peak": plate.peak_heights,
    **{name: partial(_of_all_shapes, part) for name, part in OF_SHAPES.items()},
    "variations": variations.vary,
    "optimum": optima.optima,
    "mould": partial(_of_walls, mould.design),
    "mould_rest": partial(_of_walls, mould.rest),
}
"""Parts by name; each returns its studies, from disk if available."""

BY_NAME_ONLY = ("mould", "mould_rest")
"""Parts that a rerun without a selection leaves out: they are no simulations of the paper's, and the second takes many
hours."""

GROUPS = {"optics": ("fig4", "fig5", "fig6", "peak"), "nominal": ("nominal", "roofs")}


def chosen(only: str | None) -> list[str]:
    """Resolve a comma-separated list of parts and groups to names of parts. Without a list, all parts are selected
    except `BY_NAME_ONLY`.

    Raises
    ------
    InputError
        if there is no such part.
    """
    if only is None:
        return [name for name in PARTS if name not in BY_NAME_ONLY]
    selected: list[str] = []
    for word in (word.strip() for word in only.split(",")):
        if word not in PARTS and word not in GROUPS:
            allowed = ", ".join(dict.fromkeys([*GROUPS, *PARTS]))
            raise InputError(f"only = {word!r} is not allowed: some of {allowed} are needed.")
        selected.extend(GROUPS.get(word, (word,)))
    return [name for name in PARTS if name in selected]


def compute(
    folder: Path, names: Sequence[str], workers: int | None, announce: Callable[[str], None]
) -> dict[str, float]:
    """Compute the missing studies of the chosen sections of the rerun of the paper, and store them in a folder.

    Parameters
    ----------
    folder : Path
        Folder with the studies of the rerun of the paper.
    names : sequence of str
        Names of the sections, such as ``fig4``: keys of `PARTS`.
    workers : int or None
        Number of worker processes. Each computes one cell shape at a time.
    announce : Callable[[str], None]
        Called with the name of each study before it is computed, in the process that computes it.

    Returns
    -------
    dict[str, float]
        Seconds that the studies took, by stage, summed over processes.
    """
    store = PaperStudies(folder, announce)
    of_shapes = [name for name in names if name in OF_SHAPES]
    if workers and of_shapes:
        add_seconds(store.seconds, compute_shapes(folder, _stages(of_shapes), workers, announce))
    for name in names:
        PARTS[name](store, workers=workers)
    return store.seconds


def complete(folder: Path) -> dict[str, Any]:
    """Read the studies of all parts that are complete in ``folder``, by the name of the part."""
    store, studies = PaperStudies(folder), {}
    for name, computation in PARTS.items():
        try:
            studies[name] = computation(store, workers=None)
        except MissingStudy:
            continue
    return studies
