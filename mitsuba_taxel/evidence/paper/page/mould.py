"""The page of printed moulds: sensitivities of the experiments' pads with steps, beside what was measured."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import xarray as xr

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.mould import LAYERS, POINTS, MouldFigures, MouldWalls, mould_figures, walls
from mitsuba_taxel.evidence.paper.page.words import micro, paragraph

Moulds = Mapping[MouldWalls, Mapping[str, xr.Dataset]]
_HEAD = """\
# Printed moulds

For readers of the paper who ask what the steps of its printed moulds do to a sensor.

Written by `{command}`; do not edit by hand. Every number comes from the runs.

"""
_ABOUT = """\
The pads of the experiments have 6 x 2 cells. Here their moulds are printed in layers of {layers} mm, along z or x, or
smooth; roofs are isotropic or Lambertian; and black sides reflect 0, 5 or 20 %. Forces are those of the experiments: 0
to 10 N normal to the pad, then 0 to 4 N along x or y at 10 N. Slopes are mean slopes in µW/N for 1 W per LED, of the
least and the most sensitive of 12 taxels. Nonlinearity (equation 7) and tangential slopes are those of the most
sensitive taxel. Errors are one standard deviation, of light ({paths} paths a reading), finite elements and surfaces.
{done} of {total} combinations are computed."""


def write_moulds(studies: Moulds, docs: Path, command: str) -> Path:
    """Write ``mould.md``; returns the page."""
    total = sum(1 for _ in walls())
    about = _ABOUT.format(
        layers=", ".join(f"{layer:g}" for layer in LAYERS if layer), paths=32 * POINTS, done=len(studies), total=total
    )
    figures = {wall: mould_figures(paths) for wall, paths in studies.items()}
    page = docs / "mould.md"
    parts = [_HEAD.format(command=command) + paragraph(about.replace("\n", " ")), _computed(figures), _measured()]
    write_text(page, "\n\n".join(parts) + "\n")
    return page


def _computed(figures: Mapping[MouldWalls, MouldFigures]) -> str:
    head = ("shape", "mould", "roof", "sides", "least", "most", "nonlinearity [%]", "along x", "along y")
    rows = [
        (
            wall.cell,
            wall.mould,
            wall.roof,
            f"{wall.side:.0%}",
            *(micro(*value) for value in (row.least, row.most)),
            with_error(*row.nonlinearity),
            *(micro(*value) for value in (row.along_x, row.along_y)),
        )
        for wall, row in figures.items()
    ]
    return markdown_table(head, rows, head[:3])


def _measured() -> str:
    head = ("measured, Tables 2 to 4", "least [mV/N]", "most [mV/N]", "nonlinearity [%]", "along x", "along y")
    rows = [
        (
            cell,
            *(f"{1e3 * value:.3g}" for value in paper.MEASURED_NORMAL[cell]),
            f"{paper.MEASURED_NONLINEARITY[cell]:g}",
            *(f"{1e3 * value:.3g}" for value in paper.MEASURED_TANGENTIAL[cell]),
        )
        for cell in paper.MEASURED_NORMAL
    ]
    return markdown_table(head, rows)
